"""Types of fields that take any sequence and store a tuple, and the signatures and docstrings of parts.

    links: SeveralKinds[AnyLink, Link] = field(…)

    Pendulum(links=[Bob(mass=1.0, length=2.0)]).links  # a list is given, a tuple is read

A type checker takes `Stored` for a descriptor, whose `__set__` says what a constructor accepts and whose `__get__` what
is read.  A running program does not look at it: the validator's schemas do the work.
"""

from __future__ import annotations

from collections.abc import Sequence
from inspect import Parameter, Signature, cleandoc, get_annotations
from typing import TYPE_CHECKING, Any, Generic, TypeVar, overload

if TYPE_CHECKING:
    from typing import Self

Read = TypeVar("Read")
Accepted = TypeVar("Accepted")
Item = TypeVar("Item")
Base = TypeVar("Base")


class Stored(Generic[Read, Accepted]):
    """A field that is read as the first type and accepts the second."""

    if TYPE_CHECKING:

        @overload
        def __get__(self, part: None, cls: type) -> Self: ...
        @overload
        def __get__(self, part: object, cls: type) -> Read: ...
        def __get__(self, part: object | None, cls: type) -> Self | Read: ...
        def __set__(self, part: object, value: Accepted) -> None: ...


Several = Stored[tuple[Item, ...], Sequence[Item]]
SeveralKinds = Stored[tuple[Item, ...], Sequence[Base]]
"""Several of a union of classes: a checker takes a list of two of them for one of their common base."""
SeveralOrNone = Stored[tuple[Item, ...] | None, Sequence[Item] | None]
OneOrSeveral = Stored[Item | tuple[Item, ...], Item | Sequence[Item]]
OneOrSeveralKinds = Stored[Item | tuple[Item, ...], Base | Sequence[Base]]
Pair = Stored[tuple[Item, Item], Sequence[Item]]
Rows = Stored[tuple[tuple[Item, ...], ...] | None, Sequence[Sequence[Item]] | None]
RowsOfPoints = Stored[tuple[tuple[tuple[Item, ...], ...], ...] | None, Sequence[Sequence[Sequence[Item]]] | None]

ACCEPTED = {
    "Several": "Sequence[{0}]",
    "SeveralKinds": "Sequence[{0}]",
    "SeveralOrNone": "Sequence[{0}] | None",
    "OneOrSeveral": "{0} | Sequence[{0}]",
    "OneOrSeveralKinds": "{0} | Sequence[{0}]",
    "Pair": "Sequence[{0}]",
    "Rows": "Sequence[Sequence[{0}]] | None",
    "RowsOfPoints": "Sequence[Sequence[Sequence[{0}]]] | None",
}
"""What each accepts, as a signature says it."""


class PartSignature:
    """The `__signature__` of a class of parts: its fields, each with the type that it accepts and its default."""

    def __get__(self, part: object, cls: type[Any]) -> Signature:
        if part is not None:
            raise AttributeError("__signature__")
        types = {
            name: annotation for base in reversed(cls.__mro__) for name, annotation in get_annotations(base).items()
        }
        return Signature(
            [
                Parameter(
                    name,
                    Parameter.KEYWORD_ONLY,
                    default=Parameter.empty if field.is_required else field.default,
                    annotation=accepted_type(types[name]),
                )
                for name, field in cls.fields.items()
            ]
        )


class PartDocumentation:
    """The `__doc__` of a class of parts: its words, its fields with meanings and units, its examples."""

    def __init__(self, words: str | None) -> None:
        self.words = words

    def __get__(self, part: object, cls: type[Any]) -> str | None:
        text, sign, examples = cleandoc(self.words or "").partition(">>>")
        fields = (f"{name}\n    {field.words}" for name, field in cls.fields.items())
        documentation = "\n".join([text.rstrip(), "\nParameters\n----------", *fields]) if cls.fields else text
        return f"{documentation}\n\nExamples\n--------\n>>>{examples}" if sign else documentation


def accepted_type(annotation: str) -> str:
    """The type that a field of this annotation accepts.

    >>> accepted_type("SeveralKinds[AnyLink, Link]"), accepted_type("float")
    ('Sequence[AnyLink]', 'float')
    """
    name, _, items = annotation.partition("[")
    return ACCEPTED[name].format(*items.removesuffix("]").split(", ")) if name in ACCEPTED else annotation
