"""Joint laws in a scene: `law = { kind = "magnet", strength = 0.02 }`, a table or a list of tables.

The kind is the name of a `JointLaw` (`modal.extend`), its numbers are the parameters of that.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cache, lru_cache, partial
from typing import TYPE_CHECKING, Any

from modal.errors import SceneError
from modal.scene.validation import NUMBER_SIZE_MAX, Part, Schema, field, function_after, number, one_of
from modal.scene.wording import suggestion

if TYPE_CHECKING:
    from modal.extend import JointLaw


class JointPart(Part):
    """The numbers of a joint law.

    >>> from modal.scene import VanDerPol
    >>> VanDerPol(strength=0.1, angle_deg=5.0).numbers
    {'strength': 0.1, 'angle_deg': 5.0}
    """

    @property
    def law(self) -> JointLaw:
        """The law itself."""
        raise NotImplementedError

    @property
    def numbers(self) -> dict[str, float]:
        """Its parameters by name."""
        return {parameter.name: getattr(self, parameter.name) for parameter in self.law.parameters}

    @property
    def linear_coefficients(self) -> tuple[float, float]:
        """Stiffness (N m/rad) and damping (N m s/rad) about equilibrium; 0 for a drive, which linear models ignore."""
        kind: Any = type(self.law)
        return (0.0, 0.0) if self.law.is_drive else _linear_coefficients(kind, tuple(self.numbers.values()))

    @property
    def coefficient_slopes(self) -> dict[str, tuple[float, float]]:
        """Their derivatives with respect to every parameter."""
        return {} if self.law.is_drive else self.law.coefficient_slopes(self.numbers)


class _NamedLaw(JointPart):
    """One that a scene names by its kind, also of forces on centres of mass."""

    @property
    def linear_drag(self) -> float:
        """The linear drag of a force on a centre of mass (N s/m)."""
        law: Any = self.law
        drag: float = law.linear_drag(self.numbers)
        return drag

    def problems(self) -> Iterator[str]:
        """None; a law that violates its own declarations is an error of its own."""
        kind: Any = type(self.law)
        _judge(kind, tuple(self.numbers.values()))
        return iter(())

    def __reduce__(self) -> tuple[Any, ...]:
        return _restore, (type(self.law), self.numbers)


def _restore(law: Any, numbers: dict[str, float]) -> JointPart:
    return part_of(law)(**numbers)


@lru_cache(maxsize=4096)
def _linear_coefficients(law: Any, numbers: tuple[float, ...]) -> tuple[float, float]:
    coefficients: tuple[float, float] = law().linear_coefficients(_by_name(law, numbers))
    return coefficients


@lru_cache(maxsize=4096)
def _judge(law: Any, numbers: tuple[float, ...]) -> None:
    law().judge(_by_name(law, numbers))


def _by_name(law: type[JointLaw], numbers: Sequence[float]) -> dict[str, float]:
    return {parameter.name: value for parameter, value in zip(law.parameters, numbers, strict=True)}


@cache
def part_of(law: Any) -> type[JointPart]:
    """Return the class of scene parts with the parameters of a law.

    >>> from modal.extend.laws import SpringLaw
    >>> part_of(SpringLaw)(stiffness=2.0).linear_coefficients
    (2.0, 0.0)
    """
    fields: dict[str, Any] = {"kind": field(one_of(law.name), default=law.name)}
    for parameter in law.parameters:
        bounds = number(ge=max(parameter.low, -NUMBER_SIZE_MAX), le=min(parameter.high, NUMBER_SIZE_MAX))
        default = {} if parameter.default is None else {"default": parameter.default}
        fields[parameter.name] = field(bounds, parameter.meaning, parameter.unit, **default)
    return type(law.__name__, (_NamedLaw,), {"__doc__": law.__doc__, "__module__": __name__, "law": law(), **fields})


def _laws(value: Any, what: str = "joint law") -> Any:
    """One law of this kind, a tuple of several, or None; ValueError with the places of all mistakes."""
    if value is None or isinstance(value, JointPart):
        return value
    problems: list[str] = []
    is_list = isinstance(value, list | tuple)
    parts = [
        _part(entry, what, f"[{k}]" if is_list else "", problems)
        for k, entry in enumerate(value if is_list else [value])
    ]
    if problems:
        raise ValueError("\n".join(problems))
    return tuple(parts) if is_list else parts[0]


def _part(value: Any, what: str, place: str, problems: list[str]) -> Any:
    """The part of one table; its mistakes join the others."""
    if isinstance(value, JointPart):
        return value
    from modal.extend import find_extension, registered

    names = sorted(registered(what)) if not isinstance(value, Mapping) or "kind" not in value else ()
    if names or not isinstance(value["kind"], str):
        problems.append(f'{place}.kind: is required: write {{ kind = "…" }}, one of {", ".join(names)}')
        return None
    law: Any = find_extension(what, value["kind"])
    if law is None:
        names = sorted(registered(what))
        hint = suggestion(value["kind"], names)
        problems.append(f'{place}.kind = "{value["kind"]}": must be one of {", ".join(names)}{hint}')
        return None
    try:
        return part_of(law).model_validate(dict(value))
    except SceneError as error:
        problems += [f"{place}.{problem}" for problem in error.problems]
        return None


POINT_FORCES: Schema = function_after(partial(_laws, what="point force"), {"type": "any"})
"""A force on a centre of mass, a list of forces, or none."""
LAWS: Schema = function_after(_laws, {"type": "any"})
"""A law, a list of laws, or none."""
