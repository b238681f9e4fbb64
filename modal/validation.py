"""What every part of a scene is checked by: finite numbers in range, no unknown keys, the project's own error."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from modal.errors import SceneError
from modal.messages import problems_of

LARGEST = 1e100
SMALLEST = 1e-100

Positive = Annotated[float, Field(strict=True, ge=SMALLEST, le=LARGEST)]


def _zero_or_sizeable(value: float) -> float:
    if 0 < value < SMALLEST:
        raise ValueError(f"must be 0 or at least {SMALLEST:g}")
    return value


NonNegative = Annotated[float, Field(strict=True, ge=0, le=LARGEST), AfterValidator(_zero_or_sizeable)]
Real = Annotated[float, Field(strict=True, ge=-LARGEST, le=LARGEST)]


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
    """An immutable part of a scene."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


P = TypeVar("P", bound=BaseModel)


def insist(part: P, problems: Iterable[str]) -> P:
    """The part itself; ValueError with one line a problem."""
    if found := list(problems):
        raise ValueError("\n".join(found))
    return part
