"""Docstrings are plain text: words, `code` in backticks, equations and layouts indented.  Here they become RST.

Lines that are indented stand as they are, words stand for themselves, and code that names what the reference documents
links to it.  The signature of a part of a scene shows its fields.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from itertools import groupby

from generated import documented
from sphinx.application import Sphinx

from modal.scene.validation import Part

EVERY_NAME = re.compile(r"`([^`]+)`")
ARRAY = re.compile(r"[\w.~]*ndarray\[tuple\[[\w.~]*Any, \.\.\.\], [\w.~]*dtype\[[\w.~]*?(\w+)\]\]")
ARRAYS = {"float64": "Floats", "int64": "Ints", "bool": "Booleans"}
INDENT = 4


def rst(lines: Iterable[str]) -> Iterator[str]:
    """The lines of a docstring as reStructuredText."""
    for example, part in groupby(_examples(lines), key=lambda pair: pair[0]):
        chosen = [line for _, line in part]
        yield from chosen if example else _prose(chosen)


def _examples(lines: Iterable[str]) -> Iterator[tuple[bool, str]]:
    """Each line, and whether it belongs to an example: from `>>>` to the next blank line all stands as it is."""
    inside = False
    for line in lines:
        inside = line.startswith(">>>") or (inside and bool(line.strip()))
        yield inside, line


def _prose(lines: Iterable[str]) -> Iterator[str]:
    """Words and layouts as reStructuredText."""
    for indented, group in groupby(_spread(lines), key=_is_layout):
        if not indented:
            yield from map(_words, group)
            continue
        layout = list(group)
        yield from ("", ".. code-block:: none", "", *layout, "")


def _spread(lines: Iterable[str]) -> Iterator[str]:
    """The same lines, a blank one inside a layout being a part of it."""
    held: list[str] = []
    inside = False
    for line in lines:
        if not line.strip():
            held.append(line)
            continue
        now = _is_layout(line)
        yield from (" " * INDENT if inside and now else "" for _ in held)
        held, inside = [], now
        yield line
    yield from held


def _is_layout(line: str) -> bool:
    return line.startswith(" " * INDENT)


def _words(line: str) -> str:
    pieces = EVERY_NAME.split(line)
    return "".join(_code(piece) if k % 2 else re.sub(r"([\\*_|])", r"\\\1", piece) for k, piece in enumerate(pieces))


def _code(name: str) -> str:
    full = documented().get(name) if "." in name or name[:1].isupper() else None  # `load` may be an argument's name
    return f":py:obj:`{name} <{full}>`" if full else f"``{name}``"


def _process(app: Sphinx, what: str, name: str, thing: object, options: object, lines: list[str]) -> None:
    lines[:] = list(rst(lines))


def _signature(
    app: Sphinx, what: str, name: str, thing: object, options: object, signature: str | None, returned: str | None
) -> tuple[str | None, str | None]:
    """Arrays by their short names; of a part of a scene its fields, with their defaults."""
    if not (isinstance(thing, type) and issubclass(thing, Part)):
        return _short(signature), _short(returned)
    fields = thing.fields.items()
    shown = (name if field.is_required else f"{name}={field.default!r}" for name, field in fields)
    return f"(*, {', '.join(shown)})", returned


def _short(annotations: str | None) -> str | None:
    return annotations and ARRAY.sub(lambda array: ARRAYS.get(array[1], array[0]), annotations)


def _skip(app: Sphinx, what: str, name: str, thing: object, skip: bool, options: object) -> bool | None:
    """Leave out the constants of modules, and what is not to be read of named tuples and parts of scenes."""
    constant = what == "module" and not callable(thing)
    return True if constant or name in {"fields", "model_config"} or type(thing).__name__ == "_tuplegetter" else None


def setup(app: Sphinx) -> None:
    """Take part in a build."""
    app.connect("autodoc-process-docstring", _process)
    app.connect("autodoc-process-signature", _signature)
    app.connect("autodoc-skip-member", _skip)
