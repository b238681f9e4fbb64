"""Scenes on disk: TOML in and out, the shipped scenes by name, and files written whole or not at all."""

from __future__ import annotations

import os
import sys
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.resources import files
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import IO, Any

from modal.errors import SceneError, meant
from modal.scene import Scene, described, scene_from

LARGEST_FILE = 256_000_000
SHIPPED = files("modal") / "scenes"


def load(source: str | os.PathLike[str]) -> Scene:
    """The scene at a path, of a shipped name, or on standard input for "-".

    Raises SceneError, every line of it beginning with the name of the source.
    """
    name = os.fspath(source)
    try:
        return parse(_read(name))
    except SceneError as error:
        raise SceneError([f"{name}: {problem}" for problem in error.problems]) from None


def parse(text: bytes) -> Scene:
    """The scene in a TOML document."""
    try:
        data = tomllib.loads(text.decode("utf-8-sig").replace("\r\n", "\n"))
    except UnicodeDecodeError as error:
        raise SceneError([f"byte {error.start} is not UTF-8 text"]) from None
    except ValueError as error:
        raise SceneError([f"broken TOML: {error}"]) from None
    except RecursionError:
        raise SceneError(["broken TOML: nested too deeply"]) from None
    return scene_from(data)


def dumps(scene: Scene) -> str:
    """The TOML document that reads back as an equal scene, bit for bit."""
    import tomli_w

    return tomli_w.dumps(described(scene))


def dump(scene: Scene, path: str | os.PathLike[str]) -> None:
    """Write a scene file, whole or not at all; OSError names `path` where it cannot be written."""
    with whole_file(path) as stream:
        stream.write(dumps(scene).encode())


def schema() -> dict[str, Any]:
    """The JSON Schema of a scene file, for editors."""
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **Scene.model_json_schema()}


def shipped() -> list[str]:
    """Names of the scenes that come with the package."""
    return sorted(entry.name.removesuffix(".toml") for entry in SHIPPED.iterdir() if entry.name.endswith(".toml"))


def shipped_text(name: str) -> str:
    """The file of a shipped scene; SceneError for an unknown name."""
    if name not in shipped():
        raise SceneError([f"{name}: no such shipped scene{_near(name)}"])
    return (SHIPPED / f"{name}.toml").read_text(encoding="utf-8")


def _near(name: str) -> str:
    return meant(name, shipped(), most=3, near=0.5)


@contextmanager
def whole_file(path: str | os.PathLike[str]) -> Iterator[IO[bytes]]:
    """A binary stream that becomes `path` when the block ends well and leaves nothing behind when it does not.

    A link is followed; what is no file (a pipe, a device) is written to as it comes.  Raises OSError, naming `path`,
    where it cannot be written.
    """
    target = Path(path)
    try:
        special = target.exists() and not target.is_file()
        with open(target, "wb") if special else _temporary(target.resolve()) as stream:
            yield stream
    except OSError as error:
        error.filename = str(target)
        raise


@contextmanager
def _temporary(target: Path) -> Iterator[IO[bytes]]:
    with NamedTemporaryFile(dir=target.parent, prefix=".multipendula-", delete=False) as stream:
        temporary = Path(stream.name)
        try:
            yield stream
            stream.flush()
            os.fsync(stream.fileno())
            temporary.chmod(target.stat().st_mode & 0o777 if target.exists() else 0o666 & ~_umask())
            stream.close()
            temporary.replace(target)
        except BaseException:
            stream.close()
            temporary.unlink(missing_ok=True)
            raise


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def _read(name: str) -> bytes:
    try:
        if name == "-":
            if sys.stdin is None:
                raise SceneError(["standard input is closed"])
            return _limited(sys.stdin.buffer)
        looks_like_path = any(mark in name for mark in (os.sep, "/", ".")) or Path(name).is_file()
        if not looks_like_path:
            if name not in shipped():
                raise SceneError([f"no such file and no such shipped scene{_near(name)}"])
            return shipped_text(name).encode()
        if Path(name).exists() and not Path(name).is_file() and not Path(name).is_fifo():
            raise SceneError(["not a file"])
        with open(name, "rb") as stream:
            return _limited(stream)
    except SceneError:
        raise
    except (OSError, ValueError) as error:
        raise SceneError([f"cannot be read: {getattr(error, 'strerror', None) or error}"]) from None


def _limited(stream: IO[bytes]) -> bytes:
    text = stream.read(LARGEST_FILE + 1)
    if len(text) > LARGEST_FILE:
        raise SceneError([f"is larger than {LARGEST_FILE} bytes"])
    return text
