"""What tuning finds, with what it is worth: numbers, valleys, rules beside them, dampers, and curves before and after."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import tau
from typing import Any, NamedTuple

import numpy as np

from modal.report import Displayed, Summary, as_json, counted, deferred, finite, grid, percent, titled
from modal.scene import Scene, title_of
from modal.scene.parameters import with_numbers
from modal.tuning.closed_forms import Absorber, absorbers, values_for
from modal.tuning.loads import Load, loads
from modal.tuning.objective import Objective, extreme
from modal.tuning.peaks import find_peaks
from modal.tuning.pieces import Pieces, Quantities
from modal.tuning.quantities import Quantity
from modal.tuning.worth import SHARE, Case, Worth, worst_case, worths
from modal.types import Floats

CURVE = 400
NEAR = 24
BESIDE = 3.0
"""Points of a curve, points near each peak, and how far a curve goes beyond the outermost peaks."""
EQUAL, ALIKE = 1e-6, 1e-3
SHOWN = 6
"""Valleys of which the depth is told."""


@dataclass(frozen=True)
class Valley(Displayed):
    """A minimum that starts led into: its `numbers` and the objective there; whether limits are kept, and it is settled."""

    numbers: Floats
    value: float
    kept: bool
    certain: bool


class Rule(NamedTuple):
    """Best values in closed form for a pendulum, beside those that were found, with the objective that they give."""

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
class Tuned(Displayed):
    """The tuned `scene`, what it was, and what its numbers are worth."""

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

    @property
    def numbers(self) -> dict[str, float]:
        """The best numbers by their places."""
        return dict(
            zip([one.path for one in self.objective.free], self.objective.numbers(self.z).tolist(), strict=True)
        )

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
        """What every number is worth."""
        return worths(self._nominal, self.z)

    @cached_property
    def worst(self) -> Case:
        """The worst that masses ±5 % make of the objective."""
        return worst_case(self._nominal, self.z)

    @cached_property
    def worst_before(self) -> float:
        """The same of the scene as it was, infinite where it has no value."""
        start = np.log([one.value or one.start for one in self.objective.free])
        return worst_case(self._nominal, start).value if np.isfinite(self.before) else np.inf

    @cached_property
    def loads(self) -> tuple[Load, ...]:
        """What the tuned dampers have to bear."""
        return loads(self.objective, self.scene)

    @cached_property
    def rules(self) -> tuple[Rule, ...]:
        """Den Hartog's values of tuned pendula where a force on what carries them is to move it least."""
        if not _is_of_den_hartog(self.objective):
            return ()
        return tuple(self._rule(one) for one in absorbers(self.scene, self.objective.free))

    @property
    def _nominal(self) -> Objective:
        """The objective for the masses as they are."""
        found = Objective.__new__(Objective)
        found.__dict__.update(self.objective.__dict__)
        found.cases = ({},)
        return found

    def _rule(self, one: Absorber) -> Rule:
        f, zeta = one.den_hartog
        values = values_for(self.scene, one.pendulum, f * one.omega, zeta) or {}
        z, own = self.z.copy(), [number.path for number in self.objective.free]
        values = {path: value for path, value in values.items() if path in own}
        for path, value in values.items():
            z[own.index(path)] = np.log(value)
        return Rule(one, values, self._nominal.value(z) if len(values) == 2 else np.nan)

    def curves(self) -> tuple[Curves, ...]:
        """Magnitudes of all peaks that are tuned, before and after, on a grid that is close near them."""
        return tuple(self._curves(one.quantity) for one in self.objective.aims if one.quantity.kind == "peak")

    def _curves(self, quantity: Quantity) -> Curves:
        setting = replace(self.objective.quantities.setting, spectrum=None, modes=(), travel=None)
        own = Quantities(self.scene, (), (quantity,), setting)
        models = [own.numbers.model(scene) for scene in (self.given, self.scene)]
        peaks = [find_peaks(model, 0, setting.rates) for model in models]
        poles = np.abs(np.concatenate([model.poles_for(0).imag for model in models]))
        rates = np.concatenate([one.omega[one.inside] for one in peaks] or [poles])
        rates = rates if len(rates) else poles[poles > 0]
        low, high = setting.rates or (rates.min() / BESIDE, rates.max() * BESIDE)
        low = max(low, 1e-3 * high)
        near = np.concatenate([poles[poles > 0], rates])
        close = np.outer(
            near, 1 + np.concatenate((-np.geomspace(1e-4, 0.05, NEAR), [0.0], np.geomspace(1e-4, 0.05, NEAR)))
        )
        omega = np.unique(np.concatenate((np.geomspace(low, high, CURVE), close.ravel())))
        omega = omega[(omega >= low) & (omega <= high)]
        before, after = (np.abs(model.response(0, omega)) for model in models)
        row, column = own.form.signals[0]
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
            "number": np.array([one.path for one in free]),
            "unit": np.array([one.unit_name for one in free]),
            "before": np.array([one.value for one in free]),
            "after": self.objective.numbers(self.z),
        }

    def plot(self, **options: Any) -> Any:
        """A matplotlib figure of the curves before and after; `options` are those of `modal.plotting.tuning_figure`."""
        return deferred("modal.plotting.tuning:tuning_figure")(self, **options)

    def _summary(self) -> Summary:
        aims = "; ".join(one.words for one in self.objective.aims)
        title = f"Tuned {counted(len(self.objective.free), 'number', 'numbers')}: {aims}"
        facts = [("objective", f"{self.before:.6g} → {self.after:.6g}")]
        table = self.to_dict()
        columns = [[*map(str, table["number"])], *([f"{v:.6g}" for v in table[name]] for name in ("before", "after"))]
        rows = list(zip(*columns, strict=True))
        return Summary(title, facts, ("number", "before", "after"), rows, len(rows), words=frozenset({0}))


def unit_of(own: Quantities, quantity: Quantity) -> str:
    """The unit of a quantity of a scene."""
    if quantity.kind in {"peak", "rms"}:
        names = [(channel.output, channel.input) for channel in own.channels]
        row, column = own.form.signals[names.index((quantity.output, quantity.input))]
        return f"{row.unit} per {column.unit}" if quantity.kind == "peak" else row.unit
    return {"residual": "rad", "settling": "s"}.get(quantity.kind, "")


def _is_of_den_hartog(objective: Objective) -> bool:
    """Whether one peak is tuned, of the displacement of a carrier under a force on it."""
    if len(objective.aims) != 1 or objective.aims[0].quantity.kind != "peak" or objective.aims[0].maximized:
        return False
    own = objective.quantities
    at = objective.aims[0].quantity
    kind = own.form.kinds[own.channels.index((at.output, at.input))]  # type: ignore[arg-type]
    row, column = own.form.signals[own.channels.index((at.output, at.input))]  # type: ignore[arg-type]
    return (
        not kind.moves and row.unit == "m" and column.unit == "N" and not row.name.startswith(("tip", "joint", "spr"))
    )


# ------------------------------------------------------------------------------------------------------- reports


def tuned_record(found: Tuned, curves: bool = True) -> dict[str, Any]:
    """Everything about a result for JSON."""
    objective = found.objective
    record: dict[str, Any] = {
        "title": found.given.title,
        "objective": [_aim_record(found, k) for k in range(len(objective.aims))],
        "before": finite(found.before),
        "after": finite(found.after),
        "robust": found.robust,
        "limits": [_limit_record(found, k) for k in range(len(objective.limits))],
        "numbers": [_number_record(found, k) for k in range(len(objective.free))],
        "starts": found.starts,
        "valleys": [
            {
                "numbers": one.numbers.tolist(),
                "objective": finite(one.value),
                "limits_kept": one.kept,
                "settled": one.certain,
            }
            for one in found.valleys
        ],
        "exact": found.certain,
        "rules": [_rule_record(one) for one in found.rules],
        "worst_case": {
            "masses": SHARE,
            "before": finite(found.worst_before),
            "after": finite(found.worst.value),
            "factors": {with_numbers(place): factor for place, factor in found.worst.factors.items()},
        },
        "dampers": [_load_record(one) for one in found.loads],
    }
    if curves:
        record["curves"] = [
            {
                "response": one.name,
                "unit": one.unit,
                "frequency_hz": one.frequency_hz.tolist(),
                "before": list(map(finite, one.before.tolist())),
                "after": list(map(finite, one.after.tolist())),
            }
            for one in found.curves()
        ]
    return record


def tuned_json(found: Tuned, more: dict[str, Any] | None = None) -> str:
    """The same as text, with what else is known of the result."""
    return as_json({**tuned_record(found), **(more or {})})


def _aim_record(found: Tuned, k: int) -> dict[str, Any]:
    aim, own = found.objective.aims[k], found.pieces_after[k]
    quantity = aim.quantity
    record: dict[str, Any] = {
        "quantity": quantity.name,
        "maximized": aim.maximized,
        "weight": quantity.weight,
        "unit": found.unit(quantity),
        "before": finite(extreme(quantity, found.pieces_before[k])),
        "after": finite(extreme(quantity, own)),
    }
    if quantity.kind == "peak":
        order = np.argsort(own.at, kind="stable")
        record["peaks"] = [
            {"frequency_hz": float(own.at[j]) / tau, "magnitude": float(own.values[j])} for j in order if own.inside[j]
        ]
    return record


def _limit_record(found: Tuned, k: int) -> dict[str, Any]:
    limit = found.objective.limits[k]
    at = len(found.objective.aims) + k
    return {
        "quantity": limit.quantity.name,
        "most": limit.most,
        "before": finite(extreme(limit.quantity, found.pieces_before[at])),
        "after": finite(extreme(limit.quantity, found.pieces_after[at])),
    }


def _number_record(found: Tuned, k: int) -> dict[str, Any]:
    one, worth = found.objective.free[k], found.worths[k]
    return {
        "place": one.path,
        "unit": one.unit_name,
        "before": one.value,
        "after": float(np.exp(found.z[k])),
        "bounds": [one.low, one.high] if one.bounded else None,
        "one_percent_larger": finite(worth.larger),
        "one_percent_smaller": finite(worth.smaller),
        "within_one_percent": [finite(worth.low), finite(worth.high)],
    }


def _rule_record(one: Rule) -> dict[str, Any]:
    own = one.absorber
    f, zeta = own.den_hartog
    exact = dict(zip(("f", "zeta"), own.exact, strict=True))
    return {
        "pendulum": own.pendulum,
        "mass_ratio": own.mu,
        "mode_omega_rad_per_s": own.omega,
        "mode_damping_ratio": own.damping_ratio,
        "alone": own.alone,
        "found": {"f": own.f, "zeta": own.zeta},
        "den_hartog": {"f": f, "zeta": zeta, "values": one.values, "objective": finite(one.value)},
        "exact_without_a_damper_of_the_carrier": exact if own.alone else None,
    }


def _load_record(one: Load) -> dict[str, Any]:
    return {
        "damper": one.path,
        "per": one.per,
        "stroke": one.stroke,
        "stroke_unit": one.unit,
        "stroke_at_hz": one.at_hz,
        "effort": one.effort,
        "effort_unit": one.effort_unit,
        "effort_at_hz": one.effort_at_hz,
    }


def tuned_text(found: Tuned, more: str = "") -> str:
    """What was found, as text."""
    parts = [_objective_table(found), _numbers_table(found)]
    parts += ["\n".join(_sentences(found))]
    rules = _rules_table(found)
    parts += [rules] if rules else []
    parts += [more] if more else []
    return titled(title_of(found.given), "tuned", parts, "text")


def _objective_table(found: Tuned) -> str:
    headings = ("", "quantity", "unit", "before", "after", "peaks (Hz)")
    rows = []
    for k, aim in enumerate(found.objective.aims):
        one, quantity = found.pieces_after[k], aim.quantity
        peaks = ""
        if quantity.kind == "peak":
            largest = one.values.max()
            equal = sorted(one.at[one.inside & (one.values >= largest * (1 - EQUAL))].tolist())
            peaks = ", ".join(f"{at / tau:.5g}" for at in equal)
        values = [f"{extreme(quantity, own[k]):.8g}" for own in (found.pieces_before, found.pieces_after)]
        way = "largest" if aim.maximized else "least"
        rows.append(
            [
                f"{way}{f' ×{quantity.weight:g}' * (quantity.weight != 1)}",
                quantity.name,
                found.unit(quantity),
                *values,
                peaks,
            ]
        )
    for k, limit in enumerate(found.objective.limits):
        at = len(found.objective.aims) + k
        values = [f"{extreme(limit.quantity, own[at]):.8g}" for own in (found.pieces_before, found.pieces_after)]
        rows.append([f"at most {limit.most:g}", limit.quantity.name, found.unit(limit.quantity), *values, ""])
    if not any(row[-1] for row in rows):
        rows, headings = [row[:-1] for row in rows], headings[:-1]
    return grid(rows, headings)


def _numbers_table(found: Tuned) -> str:
    headings = ("number", "unit", "before", "after", "+1 %", "−1 %", "from", "to")
    rows = []
    for one, worth, value in zip(found.objective.free, found.worths, np.exp(found.z).tolist(), strict=True):
        changes = [f"{100 * change:+.3g} %" if np.isfinite(change) else "–" for change in (worth.larger, worth.smaller)]
        ends = [f"{worth.low:.5g}" if worth.low else "any", f"{worth.high:.5g}" if np.isfinite(worth.high) else "any"]
        rows.append([one.path, one.unit_name, f"{one.value:.6g}", f"{value:.9g}", *changes, *ends])
    words = (
        "+1 % and −1 %: by how much the objective is worse where a number is so much larger or smaller. "
        "From … to: where it is at most 1 % worse."
    )
    return grid(rows, headings) + "\n\n" + words


def _sentences(found: Tuned) -> Iterator[str]:
    own = found.objective
    ends, first = found.valleys, found.valleys[0].value
    values = ", ".join(f"{one.value:.6g}" for one in ends[:SHOWN]) + ", …" * (len(ends) > SHOWN)
    alike = [one for one in ends if abs(one.value - first) <= ALIKE * abs(first)]
    if found.starts == 1:
        yield "One start had a finite value."
    elif len(ends) == 1:
        yield f"{found.starts} starts led into one valley."
    elif all(one.certain for one in ends):
        equal = f"; {len(alike)} of them are equally deep" * (len(alike) > 1)
        yield f"{found.starts} starts led into {len(ends)} valleys: {values}{equal}."
    else:
        yield f"{found.starts} starts ended at {values}; the best is kept."
    if not found.certain:
        yield "The last digits were not settled by Newton's method: pieces of the objective meet there in a corner or a root."
    at_bounds = [
        one.path
        for one, z, low, high in zip(own.free, found.z, own.low, own.high, strict=True)
        if min(z - low, high - z) < 1e-9
    ]
    if at_bounds:
        yield f"At its bound: {', '.join(at_bounds)}."
    worst = found.worst
    if worst.factors:
        words = "Tuned for the worst case" if found.robust else "Worst case"
        yield f"{words} of all masses ±{percent(SHARE)}: {worst.value:.6g}, before {found.worst_before:.6g} ({worst.words})."
    for one in found.loads:
        per, where = (f" per {one.per}", f" at {one.at_hz:.4g} Hz") if one.per else (" RMS", "")
        what = "torque" if one.unit == "rad" else "force"
        yield f"{one.path}: stroke {one.stroke:.5g} {one.unit}{per}{where}, {what} {one.effort:.5g} {one.effort_unit}{per}."


def _rules_table(found: Tuned) -> str:
    if not found.rules:
        return ""
    headings = ("pendulum", "μ", "beside", "", "f", "ζ", "objective")
    rows, notes = [], []
    for one in found.rules:
        own = one.absorber
        words = f"{own.omega / tau:.5g} Hz, ζ {own.damping_ratio:.4g}"
        name = f"pendulum[{own.pendulum}]"
        rows.append([name, f"{own.mu:.6g}", words, "found", f"{own.f:.8f}", f"{own.zeta:.8f}", f"{found.after:.8g}"])
        f, zeta = own.den_hartog
        value = f"{one.value:.8g}" if np.isfinite(one.value) else ""
        rows.append(["", "", "", "Den Hartog", f"{f:.8f}", f"{zeta:.8f}", value])
        if own.alone:
            f, zeta = own.exact
            rows.append(
                [
                    "",
                    "",
                    "",
                    "exact if ζ were 0" if own.damping_ratio > EQUAL else "exact",
                    f"{f:.8f}",
                    f"{zeta:.8f}",
                    "",
                ]
            )
        else:
            notes = ["Den Hartog's rule beside several carriers is for the mode nearest to the pendulum alone."]
    return "\n\n".join([grid(rows, headings), *notes])
