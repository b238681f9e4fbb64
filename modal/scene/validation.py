"""The checks of every part of a scene, and their messages.

Numbers must be finite and in range, and keys known.  A mistake is raised as the project's own error with a message such
as `pendulum[2].links[0].mass = -1.0: must be positive`.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Mapping
from datetime import date, time
from operator import index
from typing import Any, ClassVar, NamedTuple, Self, cast, dataclass_transform

from pydantic_core import SchemaValidator, ValidationError

from modal.errors import SIMILARITY_MIN, SceneError, first_of, spelling_hint
from modal.scene.stored import PartDocumentation, PartSignature
from modal.scene.wording import OTHER_NAMES, as_table, in_brackets, number_in, suggestion

NUMBER_SIZE_MAX = 1e100
"""Limit: of any number of a scene; larger ones are refused."""
NUMBER_SIZE_MIN = 1e-100
"""Limit: of a number of a scene that is not 0; smaller ones are refused."""
COPIES_MAX = 1_000_000
"""Limit: of a pendulum, a link or a spring; more are refused."""
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
LISTS_OF_TABLES = {
    "pendulum": "[[pendulum]]",
    "force": "[[force]]",
    "spring": "[[spring]]",
    "links": "links = [{ … }, …]",
}
ONE, LIST = "(one)", "(list)"
ADDED = {ONE, LIST, "(number)", "(table)"}
"""Steps that the validator adds to the place of a value that may be one or a list, or a number or a table."""
UNREAD = "is read with the scene file that names it: load that file, or give the numbers themselves"
"""Of a file where a part is made by hand."""
Schema = dict[str, Any]
"""A schema of pydantic's validator for a value."""
REQUIRED = object()


def _zero_or_sizeable(value: float) -> float:
    if 0 < value < NUMBER_SIZE_MIN:
        raise ValueError(f"must be 0 or at least {NUMBER_SIZE_MIN:g}")
    return value


def _to_integer(value: object) -> object:
    """NumPy's whole numbers as Python's; True and False are rejected."""
    try:
        return value if isinstance(value, bool) else index(value)  # type: ignore[arg-type]
    except TypeError:
        return value


def _several(value: object) -> object:
    """A value that must be a list; a single part is rejected, although its fields could be iterated."""
    if isinstance(value, Part):
        raise ValueError(f"must be a list: write [{type(value).__name__}(…)]")
    return value


def function_before(function: Callable[[Any], Any], schema: Schema) -> Schema:
    """The schema applied to the function's result for a value."""
    return {"type": "function-before", "function": {"type": "no-info", "function": function}, "schema": schema}


def function_after(function: Callable[[Any], Any], schema: Schema) -> Schema:
    """The function applied to a value that the schema has checked."""
    return {"type": "function-after", "function": {"type": "no-info", "function": function}, "schema": schema}


def number(**bounds: float) -> Schema:
    """A finite number within bounds: ge, gt, le, lt."""
    return {"type": "float", "strict": True, "allow_inf_nan": False, **bounds}


POSITIVE = number(ge=NUMBER_SIZE_MIN, le=NUMBER_SIZE_MAX)
NON_NEGATIVE = function_after(_zero_or_sizeable, number(ge=0, le=NUMBER_SIZE_MAX))
REAL = number(ge=-NUMBER_SIZE_MAX, le=NUMBER_SIZE_MAX)
TRUTH: Schema = {"type": "bool", "strict": True}
COUNT = function_before(_to_integer, {"type": "int", "strict": True, "ge": 1, "le": COPIES_MAX})


def one_of(*words: str) -> Schema:
    """One of these words."""
    return {"type": "literal", "expected": list(words)}


def optional(schema: Schema) -> Schema:
    """The same, or None."""
    return {"type": "nullable", "schema": schema}


def list_of(schema: Schema) -> Schema:
    """Values in a list."""
    return {"type": "tuple", "items_schema": [schema], "variadic_item_index": 0}


REALS = list_of(REAL)
REALS_OR_NONE = optional(REALS)


def text(longest: int) -> Schema:
    """Text of so many letters at most."""
    return {"type": "str", "max_length": longest}


FILE_NAME = optional(text(4096))


def one_or_list(schema: Schema) -> Schema:
    """One value, or a list with at least one."""

    def which(value: Any) -> str:
        return LIST if isinstance(value, list | tuple) else ONE

    choices = {ONE: schema, LIST: list_of(schema) | {"min_length": 1}}
    return {"type": "tagged-union", "choices": choices, "discriminator": which}


def parts(schema: Schema) -> Schema:
    """At least one part in a list."""
    return function_before(_several, list_of(schema) | {"min_length": 1})


def parts_or_none(schema: Schema) -> Schema:
    """Any number of parts in a list."""
    return function_before(_several, list_of(schema))


def any_kind(*kinds: type[Part], others: Callable[[str], type[Part] | None] | None = None) -> Schema:
    """A part of one of these kinds, or of a kind whose class `others` know."""
    choices = {kind: part.schema() for part in kinds for kind in part.fields["kind"].schema["expected"]}
    union = {"type": "tagged-union", "choices": choices, "discriminator": "kind", "from_attributes": True}
    if others is None:
        return union

    def validate(value: Any, validator: Callable[[Any], Any]) -> Any:
        kind = value.get("kind") if isinstance(value, Mapping) else getattr(value, "kind", None)
        part = others(kind) if isinstance(kind, str) and kind not in choices else None
        if part is None or isinstance(value, part):
            return validator(value) if part is None else value
        try:
            return part.model_validate(value)
        except SceneError as error:
            raise ValueError("\n".join(f".{problem}" for problem in error.problems)) from None

    return {"type": "function-wrap", "function": {"type": "no-info", "function": validate}, "schema": union}


class Field(NamedTuple):
    """The schema of a field, its meaning, its unit, and its default value."""

    schema: Schema
    meaning: str = ""
    unit: str = ""
    default: Any = REQUIRED

    @property
    def words(self) -> str:
        """What it is: the words that it may be, its meaning and its unit."""
        choices = " or ".join(f'"{word}"' for word in self.schema.get("expected", ()))
        meaning = ": ".join(filter(None, (choices, self.meaning)))
        return f"{meaning} ({self.unit})" if self.unit else meaning

    @property
    def is_required(self) -> bool:
        """Whether it must be given."""
        return self.default is REQUIRED

    @property
    def full_schema(self) -> Schema:
        """The schema with the default."""
        schema = (
            self.schema if self.is_required else {"type": "default", "schema": self.schema, "default": self.default}
        )
        return {"type": "model-field", "schema": schema}


def field(schema: Schema, meaning: str = "", unit: str = "", *, default: Any = REQUIRED) -> Any:
    """A field of a part, for use in a class body."""
    return Field(schema, meaning, unit, default)


@dataclass_transform(kw_only_default=True, frozen_default=True, field_specifiers=(field,))
class Part:
    """An immutable part of a scene, checked when it is made; `replace` returns a changed copy.

    SceneError names every mistake and its place.
    """

    __slots__ = ("__dict__", "__pydantic_extra__", "__pydantic_fields_set__", "__pydantic_private__")
    fields: ClassVar[dict[str, Field]] = {}
    __signature__ = PartSignature()
    machinery: ClassVar[frozenset[str]] = frozenset(
        {
            *("fields", "machinery", "model_config", "model_copy", "model_dump", "model_json_schema", "model_validate"),
            *("copy", "problems", "schema"),
        }
    )
    """What `dir` and completion leave out, with all names that begin with an underscore."""
    _compiled: ClassVar[SchemaValidator]
    model_config: ClassVar[dict[str, Any]] = {"extra": "forbid"}

    def __init_subclass__(cls) -> None:
        """Take the fields out of the class; register the keys and kinds of a new part."""
        own_fields = {name: value for name, value in vars(cls).items() if isinstance(value, Field)}
        for name in own_fields:
            delattr(cls, name)
        base_fields = (vars(base).get("fields", {}) for base in reversed(cls.__mro__[1:]))
        cls.fields = {name: field for fields in base_fields for name, field in fields.items()} | own_fields
        cls.__doc__ = PartDocumentation(vars(cls).get("__doc__"))  # type: ignore[assignment]
        KEYS.update(cls.fields)
        TAGS.update(_kinds_of(cls))
        kinds = {key: list(_kinds(field.schema)) for key, field in cls.fields.items() if key != "kind"}
        KINDS.update(
            {
                key: ", ".join(f'"{kind}"' for kind in kinds_of_key)
                for key, kinds_of_key in kinds.items()
                if kinds_of_key
            }
        )

    def __init__(self, /, **data: Any) -> None:
        """Raises SceneError."""
        try:
            self._validator().validate_python(data, self_instance=self)
        except ValidationError as error:
            raise SceneError(tuple(problems_of(error))) from None

    def problems(self) -> Iterator[str]:
        """Problems of fields that are valid individually, each beginning with its place."""
        return iter(())

    @classmethod
    def model_validate(cls, data: object) -> Self:
        """The part described by a mapping or given as a part; SceneError lists every mistake."""
        try:
            return cast("Self", cls._validator().validate_python(data))
        except ValidationError as error:
            raise SceneError(tuple(problems_of(error))) from None

    @classmethod
    def schema(cls) -> Schema:
        """The schema by which it is checked."""
        fields = {name: field.full_schema for name, field in cls.fields.items()}
        inner = {"type": "model-fields", "fields": fields, "extra_behavior": "forbid"}
        return function_after(_consistent, {"type": "model", "cls": cls, "schema": inner})

    @classmethod
    def _validator(cls) -> SchemaValidator:
        if "_compiled" not in vars(cls):
            cls._compiled = SchemaValidator(cls.schema(), {"title": cls.__name__})
        return cls._compiled

    @classmethod
    def model_json_schema(cls) -> dict[str, Any]:
        """The JSON Schema of the mappings that `model_validate` accepts; descriptions leave out examples in Python."""
        from pydantic.json_schema import GenerateJsonSchema

        schema = _with_references(cls.schema())
        document = GenerateJsonSchema().generate(schema)
        parts = {part.__name__: part for part in _parts(schema)}
        for part in (document, *document.get("$defs", {}).values()):
            if part.get("title") in parts:
                part["description"] = part["description"].partition("\n\nParameters\n")[0]
                for name, field in parts[part["title"]].fields.items():
                    part["properties"][name]["description"] = field.words
        return document

    def model_dump(self) -> dict[str, Any]:
        """All fields as nested mappings, which `model_validate` reads back."""
        return {name: _dump(value) for name, value in self}

    def replace(self, **changes: Any) -> Self:
        """A copy with other values under these keys, checked again; SceneError names every mistake and its place.

        >>> from modal import load
        >>> scene = load("paper-cart-2")
        >>> scene.replace(gravity=1.62, support=scene.support.replace(mass=7.0)).support.mass
        7.0
        """
        return type(self)(**{**self.__dict__, **changes})

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Another name of `replace`."""
        return self.replace(**update or {})

    def copy(self, **options: Any) -> Self:
        """Another name of `model_copy`."""
        return self.model_copy(**options)

    def __dir__(self) -> list[str]:
        names = (name for name in super().__dir__() if name not in self.machinery)
        return sorted(name for name in names if not name.startswith("_"))

    def __copy__(self) -> Self:
        return self

    def __deepcopy__(self, memo: object) -> Self:
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        return _restore, (type(self), self.__dict__)

    def __setattr__(self, name: str, value: object) -> None:
        raise SceneError([f"{name}: is frozen: replace({name}=…) gives a changed copy"])

    __delattr__ = __setattr__  # type: ignore[assignment]

    def __iter__(self) -> Iterator[tuple[str, Any]]:
        return iter(self.__dict__.items())

    def __eq__(self, other: object) -> bool:
        return self.__dict__ == other.__dict__ if type(other) is type(self) else NotImplemented

    def __hash__(self) -> int:
        return hash((type(self), *self.__dict__.values()))

    def __repr__(self) -> str:
        """As it is written in Python, without defaults; of long lists the beginning."""
        items = ((name, value) for name, value in self if value != self.fields[name].default)
        return f"{type(self).__name__}({', '.join(f'{name}={_value_text(value)}' for name, value in items)})"


def _value_text(value: Any) -> str:
    """As in Python, of a long list the first items and the number of the others."""
    if not isinstance(value, tuple) or len(value) <= 3:
        return repr(value)
    return f"({', '.join(map(repr, value[:3]))}, … {len(value) - 3} more)"


def _dump(value: Any) -> Any:
    if isinstance(value, Part):
        return value.model_dump()
    return tuple(map(_dump, value)) if isinstance(value, tuple) else value


def _restore(cls: type[Part], values: dict[str, Any]) -> Part:
    """A part that has already been checked."""
    part = cls.__new__(cls)
    part.__dict__.update(values)
    return part


def _consistent(part: Part) -> Part:
    """The part itself; ValueError with one line per problem."""
    if problems := list(part.problems()):
        raise ValueError("\n".join(problems))
    return part


def _with_references(schema: Any) -> Any:
    """A schema whose parts have names to refer to, and defaults that JSON can write."""
    if isinstance(schema, list):
        return [_with_references(inner) for inner in schema]
    if not isinstance(schema, dict):
        return schema.__dict__ if isinstance(schema, Part) else schema
    references = {key: _with_references(value) for key, value in schema.items()}
    return references | {"ref": f"scene.{schema['cls'].__name__}:0"} if schema.get("type") == "model" else references


def _parts(schema: Any) -> Iterator[type[Part]]:
    """The classes of parts in a schema."""
    if isinstance(schema, dict) and schema.get("type") == "model":
        yield schema["cls"]
    for inner in schema.values() if isinstance(schema, dict) else schema if isinstance(schema, list) else ():
        yield from _parts(inner)


def _kinds_of(cls: type[Part]) -> list[str]:
    return cls.fields["kind"].schema["expected"] if "kind" in cls.fields else []


def _kinds(schema: Schema) -> Iterator[str]:
    """The kinds of the parts that a schema allows."""
    if schema["type"] == "tagged-union":
        choices = schema["choices"]
        yield from _kinds(choices[ONE]) if ONE in choices else choices
    else:
        for inner in [schema.get("schema"), *schema.get("items_schema", ())]:
            if inner and schema["type"] != "model":
                yield from _kinds(inner)


def problems_of(error: ValidationError) -> Iterator[str]:
    """One line per mistake, in the order of the file, and the number omitted where there are many."""
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
"""What is said where the published number of a body was taken for another."""


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
        wrong_key = next((word for word in ("type", "shape", "Kind") if word in dict(_items(finding["input"]))), "")
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
    """What is wrong with a key that is not known where it stands."""
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


def _items(value: object) -> Iterator[tuple[str, object]]:
    return iter(value.items()) if isinstance(value, Mapping) else iter(())


def _as_part(key: str, value: object) -> str:
    """How a part is written of which the kind alone was given, or the angles of a start."""
    if key == "start" and isinstance(value, int | float | list):
        angles = value if isinstance(value, list) else [value]
        return f": write start = {{ angles_deg = {_file_text(angles)} }}"
    return _as_kind(key, value) if isinstance(value, str) else ""


def _as_kind(key: str, word: str) -> str:
    """How a part is written of which the kind alone was given."""
    kinds = re.findall('"([^"]*)"', KINDS.get(key, ""))
    kind = word if word in kinds else OTHER_NAMES.get(word.lower(), "")
    return f": write {as_table(kind, {key: KINDS[key]})}" if kind in kinds and key in KINDS else ""


def _lower_bound(value: float, limit: float) -> str:
    if limit == 0:
        return "must not be negative"
    if value <= 0:
        return "must be positive"
    return f"must be at least {_limit_text(limit)}"


def _limit_text(value: float) -> str:
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
