"""A validator's findings in the user's words: `pendulum[2].links[0].mass = -1.0: must be positive`."""

from collections.abc import Iterator, Mapping
from difflib import get_close_matches
from typing import Any

from pydantic import ValidationError

TAGS = frozenset({"bob", "rod", "body", "fixed", "cart"})
KEYS = (
    *("title", "gravity", "space", "support", "pendulum", "links", "start"),
    *("kind", "mass", "length", "centre", "inertia", "damping", "stiffness", "count"),
    *("angles_deg", "rates_deg", "azimuths_deg"),
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
}


def problems_of(error: ValidationError) -> Iterator[str]:
    """One line a mistake, in the order of the file."""
    for finding in error.errors(include_url=False):
        if finding["type"] != "too_short" or not finding["input"]:
            yield _problem(finding)


def _problem(finding: Mapping[str, Any]) -> str:
    place, words = _place(finding["loc"]), _words(finding)
    if finding["type"] == "union_tag_invalid":
        return f"{place}.kind = {_shown(finding['ctx']['tag'])}: {words}"
    if words.startswith("."):
        return (place + words).removeprefix(".")
    silent = finding["type"] in {"missing", "extra_forbidden", "value_error"}
    if silent or isinstance(finding["input"], Mapping | list | tuple):
        return f"{place}: {words}".removeprefix(": ")
    return f"{place} = {_shown(finding['input'])}: {words}".removeprefix(" = ")


def _place(location: tuple[int | str, ...]) -> str:
    parts = [
        f"[{part}]" if isinstance(part, int) else f".{part}"
        for position, part in enumerate(location)
        if not (part in TAGS and position > 0)
    ]
    return "".join(parts).removeprefix(".")


def _words(finding: Mapping[str, Any]) -> str:
    kind, context = finding["type"], finding.get("ctx", {})
    if kind == "extra_forbidden":
        key = str(finding["loc"][-1])
        if key in KEYS:
            return "does not belong here"
        near = get_close_matches(key, KEYS, n=1)
        return "is not a known key" + (f" (did you mean {near[0]}?)" if near else "")
    if kind == "greater_than_equal":
        return _lower_bound(finding["input"], context["ge"])
    if kind == "less_than_equal":
        return f"must be at most {context['le']:g}"
    if kind in {"literal_error", "union_tag_invalid"}:
        return f"must be one of {context.get('expected') or context['expected_tags']}"
    if kind == "value_error":
        return str(context["error"])
    return WORDS.get(kind, str(finding["msg"]))


def _lower_bound(value: float, bound: float) -> str:
    if bound == 0:
        return "must not be negative"
    if value <= 0:
        return "must be positive"
    return f"must be at least {bound:g}"


def _shown(value: object, width: int = 40) -> str:
    text = repr(value)
    return text if len(text) <= width else text[: width - 1] + "…"
