"""The result of an optimization: parameters, sensitivities, minima, closed forms, dampers, curves before and after."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from math import tau
from typing import Any, NamedTuple

import numpy as np

from modal.report import Displayed, Drawable, TextResult
from modal.scene import Scene
from modal.tuning.closed_forms import Absorber, absorbers, values_for
from modal.tuning.model import SIDE_POINTS, find_peaks
from modal.tuning.objective import Load, MassCase, Objective, Worth, loads, worst_case, worths
from modal.tuning.pieces import Pieces, Quantities
from modal.tuning.quantities import Quantity
from modal.types import Floats

TUNED_CURVE_POINTS = 400
"""Format: points of a curve, in addition to those near its peaks."""


@dataclass(frozen=True)
class Valley(Displayed):
    """A minimum to which starts converged: its `numbers` and the objective.

    `kept` says whether all limits are, `certain` whether Newton's method settled it.
    """

    numbers: Floats
    value: float
    kept: bool
    certain: bool


class Rule(NamedTuple):
    """Best values in closed form for a pendulum, next to the optimized ones, with the objective that they give."""

    absorber: Absorber
    values: dict[str, float]
    value: float


class Curves(NamedTuple):
    """Magnitudes of a channel before and after at `frequency_hz` (W,), in the unit of the output per input."""

    name: str
    unit: str
    frequency_hz: Floats
    before: Floats
    after: Floats


@dataclass(frozen=True, eq=False, repr=False)
class Tuned(Drawable, TextResult):
    """The tuned `scene`, the original one, and the sensitivities."""

    given: Scene = field(repr=False)
    scene: Scene = field(repr=False)
    objective: Objective = field(repr=False)
    z: Floats
    pieces_before: tuple[Pieces, ...] = field(repr=False)
    pieces_after: tuple[Pieces, ...] = field(repr=False)
    valleys: tuple[Valley, ...] = field(repr=False)
    starts: int
    certain: bool
    robust: bool
    open: float = 0.0
    """The relative gain of the last descent where Newton's method did not converge."""
    writer = "modal.tuning.report:tuned_text"
    figure = "modal.plotting.response:tuning_figure"

    @property
    def numbers(self) -> dict[str, float]:
        """The best numbers by their places."""
        paths = [number.path for number in self.objective.free]
        return dict(zip(paths, self.objective.free_numbers(self.z).tolist(), strict=True))

    @property
    def before(self) -> float:
        """The objective of the scene as it was, in its own unit; a sum of several with their signs and weights."""
        return self.objective.value_of(self.pieces_before)

    @property
    def after(self) -> float:
        """The objective at the best numbers."""
        return self.objective.value_of(self.pieces_after)

    @cached_property
    def worths(self) -> tuple[Worth, ...]:
        """The sensitivity to every parameter."""
        return worths(self._nominal, self.z)

    @cached_property
    def worst(self) -> MassCase:
        """The worst case of the objective for masses ±5 %."""
        return worst_case(self._nominal, self.z)

    @cached_property
    def worst_before(self) -> float:
        """The same of the scene as it was, infinite if it has no value."""
        start = np.log([number.given_level or number.start for number in self.objective.free])
        return worst_case(self._nominal, start).value if np.isfinite(self.before) else np.inf

    @cached_property
    def loads(self) -> tuple[Load, ...]:
        """The loads of the tuned dampers."""
        return loads(self.objective, self.scene)

    @cached_property
    def rules(self) -> tuple[Rule, ...]:
        """Den Hartog's values of tuned pendula for the least motion of their support under a force on it."""
        if not _is_of_den_hartog(self.objective):
            return ()
        return tuple(self._rule(absorber) for absorber in absorbers(self.scene, self.objective.free))

    @property
    def _nominal(self) -> Objective:
        """The objective for the masses as they are."""
        nominal = Objective.__new__(Objective)
        nominal.__dict__.update(self.objective.__dict__)
        nominal.cases = ({},)
        return nominal

    def _rule(self, absorber: Absorber) -> Rule:
        f, zeta = absorber.den_hartog
        values = values_for(self.scene, absorber.pendulum, f * absorber.omega, zeta) or {}
        z, paths = self.z.copy(), [number.path for number in self.objective.free]
        values = {path: value for path, value in values.items() if path in paths}
        for path, value in values.items():
            z[paths.index(path)] = np.log(value)
        return Rule(absorber, values, self._nominal.value(z) if len(values) == 2 else np.nan)

    def curves(self) -> tuple[Curves, ...]:
        """Magnitudes of all peaks that are tuned, before and after, on a grid that is close near them."""
        return tuple(self._curves(aim.quantity) for aim in self.objective.aims if aim.quantity.kind == "peak")

    def _curves(self, quantity: Quantity) -> Curves:
        setting = replace(self.objective.quantities.setting, spectrum=None, modes=(), travel=None)
        quantities = Quantities(self.scene, (), (quantity,), setting)
        models = [quantities.numbers.model(scene) for scene in (self.given, self.scene)]
        peaks = [find_peaks(model, 0, setting.rates) for model in models]
        poles = np.abs(np.concatenate([model.poles_for(0).imag for model in models]))
        rates = np.concatenate([peak.omega[peak.inside] for peak in peaks] or [poles])
        rates = rates if len(rates) else poles[poles > 0]
        low, high = setting.rates or (rates.min() / 3, rates.max() * 3)
        low = max(low, 1e-3 * high)
        frequencies = np.concatenate([poles[poles > 0], rates])
        distances = np.geomspace(1e-4, 0.05, SIDE_POINTS)
        close_points = np.outer(frequencies, 1 + np.concatenate((-distances, [0.0], distances)))
        omega = np.unique(np.concatenate((np.geomspace(low, high, TUNED_CURVE_POINTS), close_points.ravel())))
        omega = omega[(omega >= low) & (omega <= high)]
        before, after = (np.abs(model.response(0, omega)) for model in models)
        row, column = quantities.form.signals[0]
        return Curves(quantity.name, f"{row.unit} per {column.unit}", omega / tau, before, after)

    def unit(self, quantity: Quantity) -> str:
        """The unit of a quantity."""
        return unit_of(self.objective.quantities, quantity)

    # ----------------------------------------------------------------------------------------------- what is shown

    def to_dict(self) -> dict[str, Any]:
        """A row for each free number, (n,): its place, its unit, and its value before and after.

        >>> from modal import Bob, Cart, Pendulum, Scene
        >>> from modal.tuning import tune
        >>> bob = Bob(mass=0.5, length=2.0, damping=0.4)
        >>> tower = Scene(gravity=9.81, support=Cart(mass=10.0, stiffness=40.0), pendulum=[Pendulum(links=[bob])])
        >>> found = tune(tower, ["pendulum[0].links[0].damping"], minimize=["settling"])
        >>> found.to_dict()["before"]
        array([0.4])
        """
        free = self.objective.free
        return {
            "number": np.array([number.path for number in free]),
            "unit": np.array([number.unit_name for number in free]),
            "before": np.array([number.value for number in free]),
            "after": self.objective.free_numbers(self.z),
        }


def unit_of(quantities: Quantities, quantity: Quantity) -> str:
    """The unit of a quantity of a scene."""
    if quantity.kind in {"peak", "rms"}:
        names = [(channel.output, channel.input) for channel in quantities.channels]
        row, column = quantities.form.signals[names.index((quantity.output, quantity.input))]
        return f"{row.unit} per {column.unit}" if quantity.kind == "peak" else row.unit
    return {"residual": "rad", "settling": "s"}.get(quantity.kind, "")


def _is_of_den_hartog(objective: Objective) -> bool:
    """Whether one peak is tuned, of the displacement of a support under a force on it."""
    if len(objective.aims) != 1 or objective.aims[0].quantity.kind != "peak" or objective.aims[0].maximized:
        return False
    quantities = objective.quantities
    at = objective.aims[0].quantity
    kind = quantities.form.kinds[quantities.channels.index((at.output, at.input))]  # type: ignore[arg-type]
    row, column = quantities.form.signals[quantities.channels.index((at.output, at.input))]  # type: ignore[arg-type]
    return (
        not kind.moves and row.unit == "m" and column.unit == "N" and not row.name.startswith(("tip", "joint", "spr"))
    )
