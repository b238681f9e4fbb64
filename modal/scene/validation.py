"""The checks of every part of a scene, and their messages.

Numbers must be finite and in range, and keys known.  A mistake is raised as the project's own error with a message such
as `pendulum[2].links[0].mass = -1.0: must be positive`.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping
from datetime import date, time
from operator import index
from typing import TYPE_CHECKING, Annotated, Any, Self, TypeVar, get_args

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from modal.errors import SceneError, first_of, meant

LARGEST = 1e100
SMALLEST = 1e-100
MAX_COPIES = 1_000_000
TAGS: set[str] = set()
"""The kinds of all parts."""
KINDS: dict[str, str] = {}
"""The kinds of the parts under a key, as a message lists them."""
KEYS: set[str] = set()
"""The keys of all parts."""
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
LISTS_OF_TABLES = {"pendulum": "[[pendulum]]", "links": "links = [{ … }, …]"}
Positive = Annotated[float, Field(strict=True, ge=SMALLEST, le=LARGEST)]


def _zero_or_sizeable(value: float) -> float:
    if 0 < value < SMALLEST:
        raise ValueError(f"must be 0 or at least {SMALLEST:g}")
    return value


NonNegative = Annotated[float, Field(strict=True, ge=0, le=LARGEST), AfterValidator(_zero_or_sizeable)]
Real = Annotated[float, Field(strict=True, ge=-LARGEST, le=LARGEST)]


def _whole(value: object) -> object:
    """NumPy's whole numbers as Python's; True and False are rejected."""
    try:
        return value if isinstance(value, bool) else index(value)  # type: ignore[arg-type]
    except TypeError:
        return value


def _several(value: object) -> object:
    """A value that must be a list; a single part is rejected, although its fields could be iterated."""
    if isinstance(value, BaseModel):
        raise ValueError(f"must be a list: write [{type(value).__name__}(…)]")
    return value


Several = BeforeValidator(_several)
"""Marks a list of parts."""
Count = Annotated[int, Field(strict=True, ge=1, le=MAX_COPIES), BeforeValidator(_whole)]


if TYPE_CHECKING:
    from pydantic._internal._model_construction import ModelMetaclass
else:
    ModelMetaclass = type(BaseModel)


class _Raising(ModelMetaclass):
    """Makes a direct call, `Bob(mass=-1, ...)`, raise the project's own error."""

    def __call__(cls, /, *args: Any, **data: Any) -> Any:  # noqa: N805
        try:
            return super().__call__(*args, **data)
        except ValidationError as error:
            raise SceneError(tuple(problems_of(error))) from None


class Checked(BaseModel, metaclass=_Raising):
    """An immutable part of a scene; `replace` returns a changed copy."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @classmethod
    def __pydantic_init_subclass__(cls, **options: Any) -> None:
        """Register the keys and kinds of a new part."""
        KEYS.update(cls.model_fields)
        TAGS.update(_kinds(cls))
        kinds = {key: list(_kinds(field.annotation)) for key, field in cls.model_fields.items()}
        KINDS.update({key: ", ".join(f'"{kind}"' for kind in found) for key, found in kinds.items() if found})

    def replace(self, **changes: Any) -> Self:
        """A copy with other values under these keys, checked again; SceneError names every mistake and its place.

        >>> from modal import load
        >>> scene = load("paper-cart-2")
        >>> scene.replace(gravity=1.62, support=scene.support.replace(mass=7.0)).support.mass
        7.0
        """
        return type(self)(**{name: getattr(self, name) for name in type(self).model_fields} | changes)

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Pydantic's equivalent: `update` is checked as in `replace`."""
        return self.replace(**update) if update else super().model_copy(deep=deep)

    def copy(self, **options: Any) -> Self:
        """The older name of `model_copy`."""
        return self.model_copy(**options)


def _kinds(annotation: Any) -> Iterator[str]:
    """The kinds of the parts in an annotation, in its order."""
    if isinstance(annotation, type) and issubclass(annotation, Checked):
        if "kind" in annotation.model_fields:
            yield from get_args(annotation.model_fields["kind"].annotation)
    else:
        for part in get_args(annotation):
            yield from _kinds(part)


P = TypeVar("P", bound=BaseModel)


def validate(part: P, problems: Iterable[str]) -> P:
    """The part itself; ValueError with one line per problem."""
    if found := list(problems):
        raise ValueError("\n".join(found))
    return part


def problems_of(error: ValidationError) -> Iterator[str]:
    """One line per mistake, in the order of the file, and the number omitted where there are many."""
    found = [one for one in error.errors(include_url=False) if one["type"] != "too_short" or not one["input"]]
    lines = (_problem(one, words) for one in found for words in _words(one).splitlines())
    yield from first_of(lines, sum(map(_size, found)))


def _size(finding: Mapping[str, Any]) -> int:
    """The number of mistakes in one finding."""
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
    """The location as written in the file, without the kinds that the validator adds after a support or a link."""
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
    if kind == "union_tag_not_found":
        return f"needs a kind, one of {KINDS[next(key for key in reversed(finding['loc']) if isinstance(key, str))]}"
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
