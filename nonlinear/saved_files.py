"""What all files of results share: the two kinds they come in, and what is said of one that cannot be read."""

from __future__ import annotations

import os
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager

from modal.errors import SceneError

KINDS = (".npz", ".csv")


def checked_kind(path: str | os.PathLike[str]) -> str:
    """The ending of a file's name; SceneError for any other than .npz and .csv."""
    kind = os.path.splitext(os.fspath(path))[1].lower()
    if kind not in KINDS:
        raise SceneError([f"{os.fspath(path)}: the name must end in {' or '.join(KINDS)}"])
    return kind


@contextmanager
def reading(name: str, what: str) -> Iterator[None]:
    """Whatever goes wrong within is told as a SceneError about the file: it is not `what` multipendula has saved."""
    try:
        yield
    except SceneError as error:
        raise SceneError([f"{name}: {problem}" for problem in error.problems]) from None
    except OSError as error:
        raise SceneError([f"{name}: cannot be read: {error.strerror or error}"]) from None
    except (ValueError, KeyError, TypeError, AttributeError, IndexError, EOFError, RecursionError, zipfile.BadZipFile):
        raise SceneError([f"{name}: is not {what} that multipendula has saved"]) from None
