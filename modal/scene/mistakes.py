"""Messages about mistakes in a scene: the place as in the file, the rule, and how to write it."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from datetime import date, time
from typing import Any

from pydantic_core import ValidationError

from modal.errors import SIMILARITY_MIN, first_of, spelling_hint
from modal.scene.validation import ADDED, KEYS, KINDS, TAGS
from modal.scene.wording import OTHER_NAMES, as_table, in_brackets, number_in, suggestion

WORDS = {
    "finite_number": "must be finite",
    "float_type": "must be a number",
    "int_type": "must be a whole number",
    "string_type": "must be text",
    "tuple_type": "must be a list",
    "model_type": "must be a table",
    "model_attributes_type": "must be a table",
    "missing": "is required",
    "too_short": "must not be empty",
    "string_too_long": "is too long",
}
LISTS_OF_TABLES = {
    "pendulum": "[[pendulum]]",
    "force": "[[force]]",
    "spring": "[[spring]]",
    "feedback": "[[feedback]]",
    "links": "links = [{ … }, …]",
}


def problems_of(error: ValidationError) -> Iterator[str]:
    """Return one line per mistake, in the order of the file, and the number omitted if there are many."""
    findings = [
        finding for finding in error.errors(include_url=False) if finding["type"] != "too_short" or not finding["input"]
    ]
    lines = (_problem(finding, words) for finding in findings for words in _words(finding).splitlines())
    yield from first_of(lines, sum(map(_size, findings)))


def _size(finding: Mapping[str, Any]) -> int:
    """The number of mistakes in one finding."""
    return str(finding["ctx"]["error"]).count("\n") + 1 if finding["type"] == "value_error" else 1


def _problem(finding: Mapping[str, Any], words: str) -> str:
    place = _place(finding["loc"], is_key=finding["type"] == "extra_forbidden")
    if finding["type"] == "union_tag_invalid":
        return f"{place}.kind = {_file_text(finding['ctx']['tag'])}: {words}"
    if words.startswith((".", "[")):
        return (place + words).removeprefix(".")
    silent = finding["type"] in {"missing", "extra_forbidden", "value_error"}
    if silent or isinstance(finding["input"], Mapping | list | tuple):
        return f"{place}: {words}".removeprefix(": ")
    return f"{place} = {_file_text(finding['input'])}: {words}".removeprefix(" = ")


def _in_file(location: tuple[int | str, ...]) -> tuple[int | str, ...]:
    """A location without the marks of one or several and of a number or a table, which no file has."""
    return tuple(part for part in location if part not in ADDED)


def _place(location: tuple[int | str, ...], is_key: bool) -> str:
    """The location as written in the file, without the kinds that the validator adds after a support or a link."""
    parts, location = [], _in_file(location)
    for position, part in enumerate(location):
        preceding = location[max(0, position - 2) : position]
        follows_key = preceding[-1:] in {("support",), ("drive",), ("motion",)} or (
            preceding[:1] in {("support",), ("links",), ("force",), ("motion",)} and isinstance(preceding[-1], int)
        )
        is_tag = part in TAGS and follows_key and not (is_key and position == len(location) - 1)
        if not is_tag:
            parts.append(f"[{part}]" if isinstance(part, int) else f".{_key(part)}")
    return "".join(parts).removeprefix(".")


def _key(name: str) -> str:
    """A key as a scene file writes it."""
    return name if re.fullmatch("[A-Za-z0-9_-]+", name) else _file_text(name)


ABOUT_CENTRE = ": it is the moment about the centre of mass, that about the joint less m c²"
"""The hint where the published number of a body was mistaken for another."""


def _words(finding: Mapping[str, Any]) -> str:
    kind, context = finding["type"], finding.get("ctx", {})
    if kind == "extra_forbidden":
        return _unknown(str(finding["loc"][-1]), is_table=isinstance(finding["input"], dict | list))
    if kind == "greater_than_equal":
        about = ABOUT_CENTRE if finding["loc"][-1] == "inertia" else ""
        return _lower_bound(finding["input"], context["ge"]) + about
    if kind == "less_than":
        return f"must be below {_limit_text(context['lt'])}"
    if kind == "less_than_equal":
        return f"must be at most {_limit_text(context['le'])}"
    if kind in {"float_type", "int_type"} and isinstance(finding["input"], str | float):
        return WORDS[kind] + _as_number(finding["input"], is_whole=kind == "int_type")
    if kind == "float_type" and isinstance(finding["input"], int) and not isinstance(finding["input"], bool):
        return "is too large"
    if kind == "tuple_type" and isinstance(finding["input"], Mapping):
        return f"must be a list: write {LISTS_OF_TABLES.get(str(finding['loc'][-1]), '[…]')}"
    if kind == "tuple_type" and isinstance(finding["input"], str | int | float):
        return f"must be a list: write {in_brackets(finding['input'], _file_text(finding['input']))}"
    if kind.startswith("model_"):
        return WORDS[kind] + _as_part(str(next(reversed(_in_file(finding["loc"])), "")), finding["input"])
    if kind == "union_tag_not_found":
        key = next(part for part in reversed(_in_file(finding["loc"])) if isinstance(part, str))
        keys = finding["input"] if isinstance(finding["input"], Mapping) else ()
        wrong_key = next((word for word in ("type", "shape", "Kind") if word in keys), "")
        return f"needs a kind, one of {KINDS[key]}" + f": write kind in place of {wrong_key}" * bool(wrong_key)
    if kind in {"literal_error", "union_tag_invalid"}:
        choices = str(context.get("expected") or context["expected_tags"])
        word = context.get("tag", finding["input"])
        hint = suggestion(word, re.findall("'([^']*)'", choices)) if isinstance(word, str) else ""
        return f"must be one of {choices}".replace("'", '"') + hint
    if kind == "value_error":
        return str(context["error"])
    return WORDS.get(kind, str(finding["msg"]))


def _unknown(key: str, is_table: bool) -> str:
    """The mistake of a key that is unknown at its place."""
    if key in KEYS:
        return "does not belong here" + spelling_hint(key, KEYS - {key}, cutoff=SIMILARITY_MIN)
    kind = key if key in TAGS else OTHER_NAMES.get(key.lower(), "")
    if key == "scene" and is_table:
        return "is not a table: the keys of a scene belong at the top of the file"
    if kind in TAGS and is_table and (table := as_table(kind, KINDS)):
        return f"is not a table of a scene: write {table}"
    if key in TAGS:
        return f'is not a known key: write kind = "{key}"'
    return "is not a known key" + suggestion(key, KEYS)


def _as_number(value: str | float, is_whole: bool) -> str:
    """How a number is written that stands as text, or with a point where it has to be whole."""
    number = number_in(value) if isinstance(value, str) else f"{value:g}"
    fits = number and (not is_whole or re.fullmatch(r"[-+]?\d+", number))
    return f": write {number}" + " without quotation marks" * isinstance(value, str) if fits else ""


def _as_part(key: str, value: object) -> str:
    """How a part is written of which the kind alone was given, or the angles of a start."""
    if key == "start" and isinstance(value, int | float | list):
        angles = value if isinstance(value, list) else [value]
        return f": write start = {{ angles_deg = {_file_text(angles)} }}"
    if not isinstance(value, str):
        return ""
    kinds = re.findall('"([^"]*)"', KINDS.get(key, ""))
    kind = value if value in kinds else OTHER_NAMES.get(value.lower(), "")
    return f": write {as_table(kind, {key: KINDS[key]})}" if kind in kinds else ""


def _lower_bound(value: float, limit: float) -> str:
    if limit == 0:
        return "must not be negative"
    if value <= 0:
        return "must be positive"
    return f"must be at least {_limit_text(limit)}"


def _limit_text(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _file_text(value: object, width: int = 40) -> str:
    """As a scene file writes it."""
    if isinstance(value, int) and value.bit_length() > 1024:
        return "(an enormous integer)"
    if isinstance(value, str | bool):
        text = json.dumps(value, ensure_ascii=False)
    else:
        text = value.isoformat() if isinstance(value, date | time) else repr(value)
    return text if len(text) <= width else text[: width - 1] + "…"
