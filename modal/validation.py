"""What every part of a scene is checked by: finite numbers in range, no unknown keys, the project's own error."""

from __future__ import annotations

from collections.abc import Iterable
from operator import index
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from modal.errors import SceneError
from modal.messages import problems_of

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
    """An immutable part of a scene."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


P = TypeVar("P", bound=BaseModel)


def insist(part: P, problems: Iterable[str]) -> P:
    """The part itself; ValueError with one line a problem."""
    if found := list(problems):
        raise ValueError("\n".join(found))
    return part
