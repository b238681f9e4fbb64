"""What every part of a scene is checked by: finite numbers in range, no unknown keys, the project's own error."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from operator import index
from typing import TYPE_CHECKING, Annotated, Any, Self, TypeVar

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from modal.errors import SceneError
from modal.scene.messages import problems_of

LARGEST = 1e100
SMALLEST = 1e-100
MAX_COPIES = 1_000_000

Positive = Annotated[float, Field(strict=True, ge=SMALLEST, le=LARGEST)]


def _zero_or_sizeable(value: float) -> float:
    if 0 < value < SMALLEST:
        raise ValueError(f"must be 0 or at least {SMALLEST:g}")
    return value


NonNegative = Annotated[float, Field(strict=True, ge=0, le=LARGEST), AfterValidator(_zero_or_sizeable)]
Real = Annotated[float, Field(strict=True, ge=-LARGEST, le=LARGEST)]


def _whole(value: object) -> object:
    """NumPy's whole numbers as Python's; True and False are none."""
    try:
        return value if isinstance(value, bool) else index(value)  # type: ignore[arg-type]
    except TypeError:
        return value


def _several(value: object) -> object:
    """What is to be a list; a part by itself is none, though its fields could be gone through."""
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
    """An immutable part of a scene: `replace` gives one like it."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    def replace(self, **changes: Any) -> Self:
        """The same with other values under these keys, checked anew; SceneError names every mistake and its place.

        >>> from modal import load
        >>> scene = load("paper-cart-2")
        >>> scene.replace(gravity=1.62, support=scene.support.replace(mass=7.0)).support.mass
        7.0
        """
        return type(self)(**{name: getattr(self, name) for name in type(self).model_fields} | changes)

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Pydantic's way to the same: `update` is checked as in `replace`."""
        return self.replace(**update) if update else super().model_copy(deep=deep)

    def copy(self, **options: Any) -> Self:
        """The older name of `model_copy`."""
        return self.model_copy(**options)


P = TypeVar("P", bound=BaseModel)


def validate(part: P, problems: Iterable[str]) -> P:
    """The part itself; ValueError with one line a problem."""
    if found := list(problems):
        raise ValueError("\n".join(found))
    return part
