"""Compilation of functions by numba (extra `fast`), and the files in which it keeps what it has compiled.

What is kept saves time and nothing else: a file that is cut, damaged, or that others could have written is dropped, and
the function is compiled anew; where nothing can be written it is compiled in every process.
"""

from __future__ import annotations

import inspect
import os
import pickle
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from textwrap import dedent
from typing import IO, Any

from modal.scene.contents import private

DIGEST = sha256().digest_size
OTHERS_WRITE = 0o022
"""Permissions of others to change a file."""
ANY_ORDER = frozenset({"contract", "nsz", "reassoc"})
"""Of products and sums: contracted, and added up in any order, as vector instructions want it."""


def available() -> bool:
    """Whether numba is installed."""
    return find_spec("numba") is not None


def compiled(function: Any, **options: Any) -> Any:
    """The compiled function, cached on disk where there is a folder for it; the function itself without numba."""
    try:
        from numba import njit
    except ImportError:
        return function
    if _has_place(function):
        with suppress(RuntimeError):
            return _kept(njit(cache=True, error_model="numpy", **options)(function))
    return njit(error_model="numpy", **options)(function)


def _has_place(function: Any) -> bool:
    """Whether numba would keep it beside its source or under an absolute path, not in the folder of the moment."""
    if os.environ.get("NUMBA_CACHE_DIR"):
        return True
    beside = Path(inspect.getfile(function)).parent
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~")
    return os.path.isabs(home) or os.access(beside, os.W_OK)


def _kept(dispatcher: Any) -> Any:
    """A compiled function whose files heal, are private, and are read only if no one else can have written them."""
    file = getattr(getattr(dispatcher, "_cache", None), "_cache_file", None)
    if file is not None:
        file.__class__ = type("KeptFile", (KeptFile, type(file)), {})
    return dispatcher


class KeptFile:
    """What differs from numba's own files of one function, an index and one of data for each of its signatures.

    Data begin with their SHA-256.
    """

    _cache_path: str
    _index_name: str
    _data_path: Callable[[str], str]
    _dump: Callable[[Any], bytes]

    def load(self, key: Any) -> Any:
        """What is kept under a key, or None; files that cannot be used are removed."""
        try:
            self._refuse_foreign(Path(self._cache_path) / self._index_name)
            return super().load(key)  # type: ignore[misc]
        except Exception:
            self._drop()
            return None

    def save(self, key: Any, data: Any) -> None:
        """Keep what was compiled, where that is possible."""
        try:
            super().save(key, data)  # type: ignore[misc]
        except Exception:
            self._drop()

    def _drop(self) -> None:
        """Remove the files of the function as far as that is possible."""
        base = self._index_name.removesuffix(".nbi")
        with suppress(OSError):
            for entry in list(os.scandir(self._cache_path)):
                if entry.name.startswith(f"{base}."):
                    with suppress(OSError):
                        os.unlink(entry.path)

    def _refuse_foreign(self, path: Path) -> None:
        """PermissionError for a file that somebody else owns or may change."""
        with suppress(FileNotFoundError):
            status = path.stat()
            if os.name == "posix" and (status.st_uid not in {0, os.geteuid()} or status.st_mode & OTHERS_WRITE):
                raise PermissionError

    def _load_data(self, name: str) -> Any:
        path = Path(self._data_path(name))
        self._refuse_foreign(path)
        content = path.read_bytes()
        if sha256(content[DIGEST:]).digest() != content[:DIGEST]:
            raise ValueError
        return pickle.loads(content[DIGEST:])

    def _save_data(self, name: str, data: Any) -> None:
        content = self._dump(data)
        with self._open_for_write(self._data_path(name)) as stream:
            stream.write(sha256(content).digest() + content)

    @contextmanager
    def _open_for_write(self, path: str) -> Iterator[IO[bytes]]:
        """A file that becomes `path` when the block succeeds, which its owner alone reads and writes."""
        temporary = f"{path}.tmp.{os.urandom(8).hex()}"
        try:
            with open(temporary, "xb", opener=private) as stream:
                yield stream
            os.replace(temporary, path)
        except BaseException:
            with suppress(OSError):
                os.unlink(temporary)
            raise


def vectorized(function: Any, **options: Any) -> Any:
    """As `compiled`, with products and sums in ANY_ORDER."""
    return compiled(function, fastmath=set(ANY_ORDER), **options)


def part(function: Any, **options: Any) -> Any:
    """A function for others that are compiled and hold its code: Python cannot call it, and no file is kept of it."""
    try:
        from numba import njit
    except ImportError:
        return function
    options |= {"error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    return njit(**options)(function)


def vectorized_part(function: Any) -> Any:
    """As `part`, with products and sums in ANY_ORDER."""
    return part(function, fastmath=set(ANY_ORDER))


def in_place(function: Any, **options: Any) -> Any:
    """As `vectorized`, for what makes no array of its own but reads and fills those of its caller.

    Their references are not counted, which in small functions takes longer than what they compute.
    """
    return vectorized(function, _nrt=False, **options)


def inner(function: Callable[..., Any], decorator: str) -> str:
    """The source of the functions that a function defines and returns, as functions of a module, each decorated."""
    lines = inspect.getsource(function).splitlines()
    first = next(k for k, line in enumerate(lines) if line.startswith("    def "))
    body = dedent("\n".join(lines[first : len(lines) - 1])).splitlines()
    return "\n".join(f"@{decorator}\n{line}" if line.startswith("def ") else line for line in body)
