"""A validator's findings in the user's words: `pendulum[2].links[0].mass = -1.0: must be positive`."""

import json
import re
from collections.abc import Iterator, Mapping
from datetime import date, time
from typing import Any

from pydantic import ValidationError

from modal.errors import first_of, meant

TAGS = frozenset({"bob", "rod", "body", "fixed", "cart", "van-der-pol", "escapement"})
KEYS = (
    *("title", "gravity", "space", "support", "pendulum", "links", "start"),
    *("kind", "mass", "length", "centre", "inertia", "damping", "stiffness", "count"),
    *("drive", "strength", "impulse", "angle_deg"),
    *("equilibrium", "angles_deg", "rates_deg", "azimuths_deg"),
)

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
    "union_tag_not_found": "needs a kind",
    "string_too_long": "is too long",
}
LISTS_OF_TABLES = {"pendulum": "[[pendulum]]", "links": "links = [{ … }, …]"}


def problems_of(error: ValidationError) -> Iterator[str]:
    """One line a mistake, in the order of the file, and how many more there are where they are many."""
    found = [one for one in error.errors(include_url=False) if one["type"] != "too_short" or not one["input"]]
    lines = (_problem(one, words) for one in found for words in _words(one).splitlines())
    yield from first_of(lines, sum(map(_size, found)))


def _size(finding: Mapping[str, Any]) -> int:
    """How many mistakes are found in one."""
    return str(finding["ctx"]["error"]).count("\n") + 1 if finding["type"] == "value_error" else 1


def _problem(finding: Mapping[str, Any], words: str) -> str:
    place = _place(finding["loc"], is_key=finding["type"] == "extra_forbidden")
    if finding["type"] == "union_tag_invalid":
        return f"{place}.kind = {_shown(finding['ctx']['tag'])}: {words}"
    if words.startswith("."):
        return (place + words).removeprefix(".")
    silent = finding["type"] in {"missing", "extra_forbidden", "value_error"}
    if silent or isinstance(finding["input"], Mapping | list | tuple):
        return f"{place}: {words}".removeprefix(": ")
    return f"{place} = {_shown(finding['input'])}: {words}".removeprefix(" = ")


def _place(location: tuple[int | str, ...], is_key: bool) -> str:
    """The location as the file has it, without the kinds that the validator adds behind a support or a link."""
    parts = []
    for position, part in enumerate(location):
        before = location[max(0, position - 2) : position]
        behind = before[-1:] in {("support",), ("drive",)} or (before[:1] == ("links",) and isinstance(before[-1], int))
        added = part in TAGS and behind and not (is_key and position == len(location) - 1)
        if not added:
            parts.append(f"[{part}]" if isinstance(part, int) else f".{_key(part)}")
    return "".join(parts).removeprefix(".")


def _key(name: str) -> str:
    """A key as a scene file writes it."""
    return name if re.fullmatch("[A-Za-z0-9_-]+", name) else _shown(name)


def _words(finding: Mapping[str, Any]) -> str:
    kind, context = finding["type"], finding.get("ctx", {})
    if kind == "extra_forbidden":
        key = str(finding["loc"][-1])
        if key in KEYS:
            return "does not belong here"
        if key in TAGS:
            return f'is not a known key: write kind = "{key}"'
        return "is not a known key" + meant(key, KEYS)
    if kind == "greater_than_equal":
        return _lower_bound(finding["input"], context["ge"])
    if kind == "less_than_equal":
        return f"must be at most {_bound(context['le'])}"
    if kind == "float_type" and isinstance(finding["input"], int) and not isinstance(finding["input"], bool):
        return "is too large"
    if kind == "tuple_type" and isinstance(finding["input"], Mapping):
        return f"must be a list: write {LISTS_OF_TABLES.get(str(finding['loc'][-1]), '[…]')}"
    if kind in {"literal_error", "union_tag_invalid"}:
        return f"must be one of {context.get('expected') or context['expected_tags']}".replace("'", '"')
    if kind == "value_error":
        return str(context["error"])
    return WORDS.get(kind, str(finding["msg"]))


def _lower_bound(value: float, bound: float) -> str:
    if bound == 0:
        return "must not be negative"
    if value <= 0:
        return "must be positive"
    return f"must be at least {_bound(bound)}"


def _bound(value: float) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _shown(value: object, width: int = 40) -> str:
    """As a scene file writes it."""
    if isinstance(value, int) and value.bit_length() > 1024:
        return "(an enormous integer)"
    if isinstance(value, str | bool):
        text = json.dumps(value, ensure_ascii=False)
    else:
        text = value.isoformat() if isinstance(value, date | time) else repr(value)
    return text if len(text) <= width else text[: width - 1] + "…"
