"""Docstrings are plain text: words, `code` in backticks, equations and layouts indented.  Here they become RST.

Lines that are indented stand as they are, words stand for themselves, and code that names what the reference documents
links to it.  The signature of a part of a scene shows its fields.

Functions get Parameters, Returns, Raises and Examples (`sections`), as their docstring has them under such headings or,
where it is prose alone, from the signature, from sentences that begin with a parameter, and from those about errors.
Those of a part of a scene are its fields, with the types that they accept.
"""

from __future__ import annotations

import inspect
import re
import sys
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, is_dataclass
from functools import cache
from itertools import groupby
from typing import Any

from docutils import nodes
from generated import ROOT, documented
from sphinx.application import Sphinx

from modal.scene.validation import Part

EVERY_NAME = re.compile(r"`([^`]+)`")
ARRAY = re.compile(r"[\w.~]*ndarray\[tuple\[[\w.~]*Any, \.\.\.\], [\w.~]*dtype\[[\w.~]*?(\w+)\]\]")
ARRAYS = {"float64": "Floats", "int64": "Ints", "bool": "Booleans"}
INDENT = 4
LONG = 8
HEADING = re.compile(r"^(Parameters|Returns|Raises|Notes|Examples)$")
RAISES = re.compile(r"\bRaise(?:s|(?= [A-Z]\w*Error| the errors| what)) (.+?)(?:\.(?=\s|$)|$)")
CLAUSE = re.compile(
    r"(?:[;,]| and) (?:raises? )?((?:[A-Z]\w*Error) (?:for|where|if|with|as|that|says|names|unless|beyond) [^;]*?)"
    r"(?=[;.](?:\s|$)|$)"
)
NEXT_ERROR = re.compile(r"(?:, and |, | and )(?=[A-Z]\w*Error\b)")
SENTENCE = re.compile(r"(?<=[.!?])\s+(?=[A-Z`(])")
WORD = re.compile(r"([A-Za-z_][\w.]*)")
CITATION = re.compile(r"\[([A-Z][A-Za-z]+\d{4}[ab]?)(?:, ([^\]]+))?\]")
MATHEMATICS = re.compile(r"\$([^$]+)\$")


@dataclass
class Sections:
    """What the page of a function says of it, each text as words and `code`."""

    prose: list[str] = field(default_factory=list)
    parameters: dict[str, str] = field(default_factory=dict)
    returns: list[str] = field(default_factory=list)
    raises: dict[str, str] = field(default_factory=dict)
    examples: list[str] = field(default_factory=list)


def sections(lines: Iterable[str], parameters: Iterable[str] = ()) -> Sections:
    """The sections of a docstring, under headings or found in its prose, of a function with these parameters."""
    docstring = list(lines)
    places = [at for at, line in enumerate(docstring[:-1]) if HEADING.match(line) and set(docstring[at + 1]) == {"-"}]
    if not places:
        return _found_in_prose(docstring, list(parameters))
    divided = Sections(docstring[: places[0]])
    for at, end in zip(places, [*places[1:], len(docstring)], strict=True):
        _take(divided, docstring[at], docstring[at + 2 : end])
    return divided


def _take(divided: Sections, heading: str, lines: list[str]) -> None:
    """Put the lines under a heading in their place."""
    if heading == "Examples":
        divided.examples += lines
    elif heading == "Notes":
        divided.prose += ["", *lines]
    elif heading == "Returns":
        divided.returns += [line.strip() for line in lines[1:] if line.strip()]
    else:
        entries = divided.parameters if heading == "Parameters" else divided.raises
        for line in filter(str.strip, lines):
            if not line.startswith(" "):
                name = line.strip()
                entries[name] = ""
            else:
                entries[name] = f"{entries[name]} {line.strip()}".strip()


def _found_in_prose(lines: list[str], parameters: list[str]) -> Sections:
    divided = Sections()
    for is_example, part in groupby(_examples(lines), key=lambda pair: pair[0]):
        chosen = [line for _, line in part]
        if is_example:
            divided.examples += [*chosen, ""]
            continue
        for is_layout, group in groupby(_spread(chosen), key=lambda line: _is_layout(line) or not line.strip()):
            same = list(group)
            divided.prose += same if is_layout else _paragraph(" ".join(same), parameters, divided)
    return divided


def _paragraph(text: str, parameters: list[str], divided: Sections) -> list[str]:
    """What is left of a paragraph without sentences about errors and those that begin with a parameter."""
    for pattern in (RAISES, CLAUSE):
        while told := pattern.search(text):
            for clause in NEXT_ERROR.split(told[1]):
                name, _, words = clause.partition(" ")
                name = name.rstrip(",:")
                known = re.fullmatch(r"[A-Z]\w*Error", name)
                error, words = (name, words) if known else ("", clause)
                divided.raises[error] = "; ".join(filter(None, [divided.raises.get(error, ""), words.strip(" ,")]))
            rest = text[told.end() :]
            text = f"{text[: told.start()].rstrip()}{rest if pattern is CLAUSE else ' ' + rest.strip()}".strip()
    kept = []
    for sentence in SENTENCE.split(text):
        named = re.match(r"`(\w+)(?:`| ?\(|=)", sentence)
        others = {name for name in parameters if re.search(rf"; `{name}`", sentence)}
        if named and named[1] in parameters and not others and not re.match(r"`\w+`[^`.]{0,12}(,| and) `", sentence):
            about = re.sub(r'^`\w+` (?:is|are) (?=[a-z"\d])', "", sentence)
            divided.parameters[named[1]] = f"{divided.parameters.get(named[1], '')} {about}".strip()
        else:
            kept.append(sentence)
    return [" ".join(kept)] if kept else []


def documentation(lines: list[str], thing: object) -> list[str]:
    """The docstring of a function, a class or anything else as reStructuredText, with its sections."""
    signature = _signature_of(thing)
    if signature is None:
        return list(rst(lines))
    divided = sections(lines, signature.parameters)
    written = list(rst(divided.prose))
    written += ["", *_fields(divided, signature, thing), ""]
    if any(map(str.strip, divided.examples)):
        written += [".. rubric:: Examples", "", *divided.examples]
    return written


def _signature_of(thing: object) -> inspect.Signature | None:
    """Of functions, and of classes whose constructor takes their fields."""
    is_record = isinstance(thing, type) and (
        issubclass(thing, Part) or is_dataclass(thing) or hasattr(thing, "_fields")
    )
    if not (inspect.isroutine(thing) or is_record):
        return None
    try:
        return inspect.signature(thing)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        return None


def _fields(divided: Sections, signature: inspect.Signature, thing: object) -> Iterator[str]:
    """Lists of fields, which Sphinx sets as Parameters, Returns and Raises."""
    told = {name: words for names, words in divided.parameters.items() for name in names.replace("*", "").split(", ")}
    for name, parameter in signature.parameters.items():
        if name in ("self", "cls") or name.startswith("_"):
            continue
        shown = {parameter.VAR_POSITIONAL: r"\*", parameter.VAR_KEYWORD: r"\*\*"}.get(parameter.kind, "") + name
        yield f":param {shown}: {_words(told.get(name, ''))}".rstrip()
        if kind := _type(parameter.annotation, thing):
            yield f":type {shown}: {kind}{_usual(parameter.default)}"
    if not isinstance(thing, type):
        kind = _type(signature.return_annotation, thing)
        if divided.returns:
            yield f":returns: {_words(' '.join(divided.returns))}"
        if kind and signature.return_annotation not in (None, "None"):
            yield f":rtype: {kind}"
    for error, words in divided.raises.items():
        yield f":raises {error or 'errors'}: {_words(words)}" if error else f":raises: {_words(words)}"


def _type(annotation: Any, thing: object) -> str:
    """An annotation of a function or class with links to what the reference documents."""
    if annotation is inspect.Parameter.empty:
        return ""
    is_plain = isinstance(annotation, type) and not hasattr(annotation, "__args__")
    text = annotation if isinstance(annotation, str) else annotation.__name__ if is_plain else str(annotation)
    shown = []
    for at, piece in enumerate(WORD.split((_short(text) or "").replace("typing.", ""))):
        full = _documented_as(piece, thing) if at % 2 and piece[:1].isupper() else None
        shown.append(f"\\ :py:obj:`{piece} <{full}>`\\ " if full else re.sub(r"([\\*_|`])", r"\\\1", piece))
    return "".join(shown).removeprefix("\\ ").removesuffix("\\ ").strip()


def _documented_as(name: str, thing: object) -> str | None:
    """The full name under which the reference documents what this name means in the module of a thing."""
    module = sys.modules[getattr(thing, "__module__", "builtins")]
    meant = getattr(module, name, None)
    if isinstance(meant, type):
        full = documented().get(name)
        if full and getattr(sys.modules[full.rpartition(".")[0]], name) is meant:
            return full
        return f"{meant.__module__}.{name}" if meant.__module__ in documented() else None
    return None if name in _ambiguous() else documented().get(name)


@cache
def _ambiguous() -> frozenset[str]:
    """Names of classes that stand in more than one module."""
    sources = (
        path.read_text(encoding="utf-8") for room in ("modal", "nonlinear") for path in (ROOT / room).rglob("*.py")
    )
    count = Counter(name for source in sources for name in re.findall(r"^class (\w+)", source, flags=re.MULTILINE))
    return frozenset(name for name, times in count.items() if times > 1)


def _usual(default: object) -> str:
    if default is inspect.Parameter.empty or default is None:
        return ""
    if isinstance(default, float) and len(repr(default)) > LONG:
        return f", default ``{default:.4g}``"
    return f", default ``{default!r}``" if isinstance(default, bool | int | float | str) else ""


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
    return "".join(_code(piece) if k % 2 else _plain(piece) for k, piece in enumerate(pieces))


def _plain(words: str) -> str:
    """Words that stand for themselves, but for LaTeX between dollars and sources, as [Keller1977, p. 359]."""
    pieces = MATHEMATICS.split(words)
    return "".join(f":math:`{piece}`" if k % 2 else _cited(piece) for k, piece in enumerate(pieces))


def _cited(words: str) -> str:
    """Words with their sources linked to the list of them."""
    text, start = "", 0
    for match in CITATION.finditer(words):
        where = f"{{{match[2]}}}" if match[2] else ""
        text += re.sub(r"([\\*_|])", r"\\\1", words[start : match.start()]) + f":cite:p:`{match[1]}{where}`"
        start = match.end()
    return text + re.sub(r"([\\*_|])", r"\\\1", words[start:])


def _code(name: str) -> str:
    full = documented().get(name) if set("._") & set(name) or name[:1].isupper() else None  # `load` may be an argument
    return f":py:obj:`{name} <{full}>`" if full else f"``{name}``"


def _process(app: Sphinx, what: str, name: str, thing: object, options: object, lines: list[str]) -> None:
    lines[:] = documentation(lines, thing)


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
    hidden = name in {"fields", "internal", "machinery", "model_config"} or type(thing).__name__ == "_tuplegetter"
    return True if constant or hidden else None


def _dashed(app: Sphinx, doctree: nodes.document, docname: str) -> None:
    """A dash between a parameter and its meaning."""
    for text in list(doctree.findall(nodes.Text)):
        if text == " -- ":
            text.parent.replace(text, nodes.Text(" – "))


def setup(app: Sphinx) -> None:
    """Take part in a build."""
    app.connect("doctree-resolved", _dashed)
    app.connect("autodoc-process-docstring", _process)
    app.connect("autodoc-process-signature", _signature)
    app.connect("autodoc-skip-member", _skip)
