"""Scenes on disk: TOML in and out, the shipped scenes by name, and atomic writing of files."""

from __future__ import annotations

import os
import re
import sys
import tomllib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from io import BytesIO
from pathlib import Path
from threading import Timer
from time import time
from typing import IO, Any

from modal.errors import SceneError, spelling_hint
from modal.scene.contents import SHIPPED, content_of, decode_text, read_within_limit
from modal.scene.doors import checked, require_type
from modal.scene.model import Scene, describe, scene_from

STANDARD = "-"
"""The name of standard input where a file is read, of standard output where one is written."""
TEMPORARY = ".multipendula-"
"""How the names of files begin that are not yet whole."""
FORGOTTEN_SECONDS = 86_400.0
"""Limit: a day, after which nobody is writing a file that is not yet whole: it is removed."""
KEY_PARTS_MAX = 50
"""Limit: of a dotted key, refused beyond; a scene has three, and time and memory grow with their square."""
_PART = r"""(?:[\w-]++ | "(?:\\.|[^"\\\n])*+" | '[^'\n]*+')"""
_DEEP = re.compile(
    rf"""(?P<deep> (?<![\w-]) {_PART} (?:[ \t]*+ \. [ \t]*+ {_PART}){{{KEY_PARTS_MAX}}})"""
    r"""| (?s:\"{3}.*?\"{3}) | (?s:'{3}.*?'{3}) | "(?:\\.|[^"\\\n])*+" | '[^'\n]*+' | \#[^\n]*+""",
    re.VERBOSE,
)
"""A key that is too deep, or a string or comment that may look like one."""


def load(source: str | os.PathLike[str] | Scene) -> Scene:
    """Load the scene at a path, of a shipped name, or from standard input.

    Parameters
    ----------
    source
        A path to a TOML file, the name of a shipped scene (one of `example_names`), or "-" for standard input. A file
        takes precedence over a shipped scene of the same name. A scene is returned as it is.

    Returns
    -------
    Scene
        The checked scene, including the records and matrices that the file names.

    Raises
    ------
    SceneError
        The source cannot be read, is not TOML, or does not describe a valid scene. Every line of the message begins
        with the name of the source, and every mistake has its place.

    Examples
    --------
    >>> from modal import load
    >>> load("paper-cart-2").n_links
    4
    """
    if isinstance(source, Scene):
        return source
    name = os.fspath(source)
    try:
        return parse(_read_content(name), Path(name).parent)
    except SceneError as error:
        raise SceneError([f"{name}: {problem}" for problem in error.problems]) from None


def parse(text: bytes, folder: Path = Path()) -> Scene:
    """Return the scene in a TOML document; files that it names are relative to `folder`."""
    try:
        document = decode_text(text, "scene").replace("\r\n", "\n")
        for key in _DEEP.finditer(document):
            if key["deep"]:
                raise SceneError([f"line {_line(key)}: a key of over {KEY_PARTS_MAX} parts"])
        data = tomllib.loads(document)
    except tomllib.TOMLDecodeError as error:
        from modal.scene.toml_mistakes import mistakes_in

        raise SceneError(mistakes_in(document, error)) from None
    except SceneError:
        raise
    except ValueError as error:
        raise SceneError([f"broken TOML: {error}"]) from None
    except RecursionError:
        raise SceneError(["broken TOML: nested too deeply"]) from None
    if any(word in document for word in ("motion", "force", "file", "gains")):
        from modal.scene.records import with_files_read

        return scene_from(with_files_read(data, folder))
    return scene_from(data)


def _line(match: re.Match[str]) -> int:
    return match.string.count("\n", 0, match.start()) + 1


def dumps(scene: Scene) -> str:
    """Return a TOML document that reads back as an equal scene, bit for bit.

    Parameters
    ----------
    scene
        Any scene.  Records that it read from files are written as lists.

    Returns
    -------
    str
        The document. Numbers have enough digits to restore the same floats.

    Examples
    --------
    >>> from modal import Bob, Pendulum, Scene, dumps
    >>> scene = Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=2.0)])])
    >>> dumps(scene).splitlines()[0]
    'gravity = 9.81'
    >>> parse(dumps(scene).encode()) == scene
    True
    """
    require_type("scene", scene, "Scene")
    import tomli_w

    return tomli_w.dumps(describe(scene))


def dumps_like(scene: Scene, source: str | os.PathLike[str] | Scene, folder: Path = Path()) -> str:
    """Return `dumps` with the comments and the layout of a source that differs only in numbers.

    They are omitted if the source is neither a file nor a shipped scene, or if the text would not read back as the
    scene in `folder`, for example because records that it names are missing there.
    """
    import tomlkit

    if isinstance(source, Scene) or os.fspath(source) == STANDARD:
        return dumps(scene)
    text = decode_text(_read_content(os.fspath(source)), "scene")
    document = tomlkit.parse(text)
    try:
        _edit(document, describe(parse(text.encode(), Path(source).parent)), describe(scene))
        edited = tomlkit.dumps(document)
        if parse(edited.encode(), folder) == scene:
            return edited
    except SceneError:
        pass
    return dumps(scene)


def _edit(container: Any, before: Any, after: Any) -> None:
    """Put the differences into a document whose keys and lists are those of the mappings."""
    places = after if isinstance(after, dict) else range(len(after))
    for place in places:
        old, new = (before.get(place) if isinstance(before, dict) else before[place]), after[place]
        if old == new:
            continue
        is_table = isinstance(old, dict) and isinstance(new, dict)
        if is_table or (isinstance(old, list) and isinstance(new, list) and len(old) == len(new)):
            _edit(container[place], old, new)
        else:
            container[place] = new


@checked
def dump(scene: Scene, path: str | os.PathLike[str]) -> None:
    """Write a scene file, completely or not at all.

    Parameters
    ----------
    scene
        Any scene; the file holds what `dumps` returns.
    path
        Where to write.  An existing file is replaced.

    Raises
    ------
    OSError
        The path cannot be written; the error names it.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from modal import dump, load
    >>> scene = load("chain-2")
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder) / "mine.toml"
    ...     dump(scene, path)
    ...     load(path) == scene
    True
    """
    with whole_file(path) as stream:
        stream.write(dumps(scene).encode())


def schema() -> dict[str, Any]:
    """Return the JSON Schema of a scene file, for editors."""
    document = Scene.model_json_schema()
    for name in ("RandomMotion", "RandomForce"):
        random = document["$defs"][name]["properties"]
        words = random["psd"].pop("description")
        random["psd"] = {"anyOf": [random["psd"], {"type": "string"}], "title": "Psd", "description": words}
    document["$defs"]["Feedback"]["properties"]["gains"]["anyOf"].append({"type": "string"})
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **document}


def example_names() -> list[str]:
    """Return the names of the scenes that come with the package.

    Returns
    -------
    list of str
        In alphabetical order. `load` and every command accept each of them.

    Examples
    --------
    >>> from modal import example_names
    >>> "paper-cart-2" in example_names()
    True
    """
    return sorted(entry.name.removesuffix(".toml") for entry in Path(SHIPPED).iterdir() if entry.name.endswith(".toml"))


def example_text(name: str) -> str:
    """Return the file of a shipped scene; raise SceneError for an unknown name."""
    if name not in example_names():
        raise SceneError([f"{name}: no such shipped scene{_similar_examples(name)}"])
    return Path(SHIPPED, f"{name}.toml").read_text(encoding="utf-8")


def _similar_examples(name: str) -> str:
    return spelling_hint(name, example_names(), limit=3, cutoff=0.5)


def kind_of(path: str | os.PathLike[str], kinds: Sequence[str], prefix: str = "") -> str:
    """Return the suffix of a file name, one of `kinds`; the first of them for standard output.

    Raise SceneError for any other, with the words `prefix` before the name.
    """
    name = os.fspath(path)
    kind = kinds[0] if name == STANDARD else os.path.splitext(name)[1].removeprefix(".").lower()
    if kind not in kinds:
        endings = [f".{ending}" for ending in kinds]
        words = f"the name must end in {' or '.join(filter(None, [', '.join(endings[:-1]), endings[-1]]))}"
        raise SceneError([f"{prefix}{name}: {words}"])
    return kind


@contextmanager
def whole_file(path: str | os.PathLike[str], *, opener: Callable[[str, int], int] | None = None) -> Iterator[IO[bytes]]:
    """Open a binary stream that becomes `path` if the block succeeds and leaves nothing behind if it fails.

    A link is followed; anything but a regular file (a pipe, a device) is written directly; "-" is standard output,
    written at the end. `opener` opens the file with other permissions, as `private` does. Raise OSError if it cannot be
    written, naming `path` or another file that the block writes, and SceneError if binary content would go to a
    terminal.
    """
    if os.fspath(path) == STANDARD:
        buffer = BytesIO()
        yield buffer
        _print(buffer.getvalue())
        return
    target = Path(path)
    if "\0" in os.fspath(path):
        raise SceneError([f"{target}: a file's name has no null character"])
    try:
        special = target.exists() and not target.is_file()
        with open(target, "wb") if special else _temporary(target.resolve(), opener) as stream:
            yield stream
    except OSError as error:
        if not error.filename or Path(str(error.filename)).name.startswith(TEMPORARY):
            error.filename = str(target)
        raise


def _print(content: bytes) -> None:
    """To standard output, as bytes where it takes them."""
    if b"\0" in content and sys.stdout.isatty():
        raise SceneError(["standard output is a terminal, and this file is binary: redirect it to a file or a program"])
    if (binary := getattr(sys.stdout, "buffer", None)) is None:
        sys.stdout.write(content.decode())
        return
    sys.stdout.flush()
    binary.write(content)
    binary.flush()


def _remove_forgotten(folder: Path) -> None:
    """Remove temporary files of processes that were killed while writing."""
    with suppress(OSError):
        for entry in list(os.scandir(folder)):
            if entry.name.startswith(TEMPORARY):
                with suppress(OSError):
                    if time() - entry.stat(follow_symlinks=False).st_mtime > FORGOTTEN_SECONDS:
                        os.unlink(entry.path)


@contextmanager
def _temporary(target: Path, opener: Callable[[str, int], int] | None) -> Iterator[IO[bytes]]:
    temporary = target.parent / f"{TEMPORARY}{os.urandom(8).hex()}"
    _remove_forgotten(target.parent)
    try:
        with open(temporary, "xb", opener=opener) as stream:
            yield stream
            stream.flush()
            os.fsync(stream.fileno())
        if target.exists() and not opener:
            temporary.chmod(target.stat().st_mode & 0o777)
        temporary.replace(target)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def _read_content(name: str) -> bytes:
    try:
        if name == STANDARD:
            if sys.stdin is None:
                raise SceneError(["standard input is closed"])
            with _wait_message("standard input"):
                return read_within_limit(sys.stdin.buffer)
        exists = Path(name).is_file() or Path(name).is_fifo()
        looks_like_path = exists or any(mark in name for mark in (os.sep, "/", "."))
        if not looks_like_path:
            if name not in example_names():
                raise SceneError([f"no such file and no such shipped scene{_similar_examples(name)}"])
            return example_text(name).encode()
        if not exists and (example := Path(name).name.removesuffix(".toml")) in example_names():
            raise SceneError([f"cannot be read: there is no such file (did you mean {example}, a shipped scene?)"])
        if not Path(name).is_fifo():
            return content_of(name)
        with _wait_message(name), open(name, "rb") as stream:
            return read_within_limit(stream)
    except SceneError:
        raise
    except (OSError, ValueError) as error:
        raise SceneError([f"cannot be read: {getattr(error, 'strerror', None) or error}"]) from None


@contextmanager
def _wait_message(name: str) -> Iterator[None]:
    """Say on a terminal that a scene is expected if nothing has arrived for a second."""
    if not sys.stderr or not sys.stderr.isatty():
        yield
        return
    words = Timer(1.0, print, (f"waiting for a scene from {name} …",), {"file": sys.stderr})
    words.daemon = True
    words.start()
    try:
        yield
    finally:
        words.cancel()
