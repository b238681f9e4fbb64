"""The checks of every part of a scene, and their messages.

Numbers must be finite and in range, and keys known.  A mistake is raised as the project's own error with a message such
as `pendulum[2].links[0].mass = -1.0: must be positive`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import pairwise
from operator import index
from typing import Any, ClassVar, NamedTuple, Self, cast, dataclass_transform

from pydantic_core import SchemaValidator, ValidationError

from modal.errors import SceneError
from modal.report import deferred
from modal.scene.stored import PartDocumentation, PartSignature

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
ONE, LIST = "(one)", "(list)"
ADDED = {ONE, LIST, "(number)", "(table)"}
"""Steps that the validator adds to the place of a value that may be one or a list, or a number or a table."""
UNREAD = "is read with the scene file that names it: load that file, or give the numbers themselves"
"""Of a file where a part is made by hand."""
Schema = dict[str, Any]
"""A schema of pydantic's validator for a value."""
REQUIRED = object()
problems_of = deferred("modal.scene.mistakes:problems_of")
"""One line per mistake; loaded with the first one."""


def _zero_or_sizeable(value: float) -> float:
    if 0 < value < NUMBER_SIZE_MIN:
        raise ValueError(f"must be 0 or at least {NUMBER_SIZE_MIN:g}")
    return value


def _to_integer(value: object) -> object:
    """NumPy's integers as Python's; True and False are rejected."""
    try:
        return value if isinstance(value, bool) else index(value)  # type: ignore[arg-type]
    except TypeError:
        return value


def _several(value: object) -> object:
    """A value that must be a list; a single part is rejected, although its fields could be iterated."""
    if isinstance(value, Part):
        raise ValueError(f"must be a list: write [{type(value).__name__}(…)]")
    return value


def refuse_file(value: object) -> object:
    """The numbers of a part; the name of a file, which is read with the scene, is rejected."""
    if isinstance(value, str):
        raise ValueError(UNREAD)
    return value


def curve_problems(x: str, y: str, places: Sequence[float], values: Sequence[float], least: int = 0) -> Iterator[str]:
    """Return why values are no curve over times or frequencies, by their keys: number, or places that do not ascend."""
    is_in_time = x == "time_s"
    if len(places) != len(values):
        yield f".{y}: has {len(values)} values for {len(places)} {'times' if is_in_time else 'frequencies'}"
    elif len(values) < least:
        few = f".{x}: has {len(values)} samples" if is_in_time else f".{y}: has {len(values)} values"
        yield f"{few}: at least {least} are needed"
    if any(later <= earlier for earlier, later in pairwise(places)):
        yield f".{x}: must be strictly ascending"


def function_before(function: Callable[[Any], Any], schema: Schema) -> Schema:
    """Return a schema applied to the function's result for a value."""
    return {"type": "function-before", "function": {"type": "no-info", "function": function}, "schema": schema}


def function_after(function: Callable[[Any], Any], schema: Schema) -> Schema:
    """Return a schema that applies the function to the checked value."""
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
    """Text of this many letters at most."""
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


def parts_later(module: str) -> Schema:
    """Any number of parts in a list, by the function `parts_of` of a module, which is loaded with the first one."""

    def read(values: Any) -> Any:
        return deferred(f"{module}:parts_of")(values) if values and isinstance(values, list | tuple) else values

    return function_before(read, list_of({"type": "any", "metadata": {"module": module}}))


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
        """Its meaning and unit, and the words that it may be."""
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
        default = {} if self.is_required else {"type": "default", "schema": self.schema, "default": self.default}
        return {"type": "model-field", "schema": default or self.schema}


def field(schema: Schema, meaning: str = "", unit: str = "", *, default: Any = REQUIRED) -> Any:
    """A field of a part, for use in a class body."""
    return Field(schema, meaning, unit, default)


@dataclass_transform(kw_only_default=True, frozen_default=True, field_specifiers=(field,))
class Part:
    """An immutable part of a scene, checked on construction; `replace` returns a changed copy.

    Raise SceneError with every mistake and its place.
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
    """Names that `dir` and completion omit, with all names that begin with an underscore."""
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
        TAGS.update(cls.fields["kind"].schema["expected"] if "kind" in cls.fields else [])
        kinds = {key: list(_kinds(field.schema)) for key, field in cls.fields.items() if key != "kind"}
        KINDS.update({key: ", ".join(f'"{kind}"' for kind in words) for key, words in kinds.items() if words})

    def __init__(self, /, **data: Any) -> None:
        """Raise SceneError."""
        try:
            self._validator().validate_python(data, self_instance=self)
        except ValidationError as error:
            raise SceneError(tuple(problems_of(error))) from None

    def problems(self) -> Iterator[str]:
        """Problems of fields that are valid individually, each beginning with its place."""
        return iter(())

    @classmethod
    def model_validate(cls, data: object) -> Self:
        """Return the part described by a mapping or given as a part; raise SceneError with every mistake."""
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
        """Return the JSON Schema of the mappings that `model_validate` accepts; descriptions omit Python examples."""
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
        """Return all fields as nested mappings, which `model_validate` reads back."""
        return {name: _dump(value) for name, value in self}

    def replace(self, **changes: Any) -> Self:
        """Return a copy with other values under these keys, checked again; raise SceneError with all mistakes.

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
    if isinstance(schema, dict) and (module := schema.get("metadata", {}).get("module")):
        return _with_references(deferred(f"{module}:schema_of")())
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


def _kinds(schema: Schema) -> Iterator[str]:
    """The kinds of the parts that a schema allows."""
    if schema["type"] == "tagged-union":
        choices = schema["choices"]
        yield from _kinds(choices[ONE]) if ONE in choices else choices
    else:
        for inner in [schema.get("schema"), *schema.get("items_schema", ())]:
            if inner and schema["type"] != "model":
                yield from _kinds(inner)
