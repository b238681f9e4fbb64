"""The result of an optimization: parameters, sensitivities, minima, closed forms, dampers, curves before and after.

Of one pendulum as an absorber of one mode the optimum has closed forms, Den Hartog's and exact ones.  A pendulum of
one link with the inertia A about its joint and the first moment b is, next to a support that it pulls by b, a mass
b²/A on a spring, leaving the support M + m − b²/A. With μ their ratio, ω_1² = k/(M + m − b²/A), f = ω_d/ω_1 and ζ =
c/(2 A ω_d), the peak of k|x/F| is least, to first order about its two fixed points, for

    f = 1/(1 + μ),    ζ = √(3μ/(8(1 + μ)))                      [DenHartog1956, §3.3]

and exactly, of a support without a damper, for [Nishihara2002]

    f = 2/(1+μ) √(2(16+23μ+9μ²+2(2+μ)√(4+3μ))/(3(64+80μ+27μ²))),    ζ = ¼√((8+9μ−4√(4+3μ))/(1+μ))

On several supports the mode nearest to the pendulum stands for the support: with φᵀMφ = 1 and the row M_j of the
pendulum, μ = (M_j φ)²/A.  There both are a rule, not the best.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import sqrt, tau
from typing import Any, NamedTuple

import numpy as np
import scipy

from modal.assembly import matrices
from modal.report import (
    NOTHING,
    Displayed,
    Drawable,
    ReportColumn,
    ReportTable,
    TextResult,
    as_json,
    capital,
    finite,
    grid,
    percent,
    records_of,
    titled,
)
from modal.scene import Scene, number_words, title_of
from modal.scene.doors import checked
from modal.scene.parameters import Place, with_numbers
from modal.tuning.minimax import COARSE, EDGE
from modal.tuning.model import SIDE_POINTS, find_peaks
from modal.tuning.objective import MASS_SHARE, Load, MassCase, Objective, Worth, extreme, loads, worst_case, worths
from modal.tuning.pieces import Pieces, Quantities
from modal.tuning.quantities import FreeNumber, Quantity
from modal.types import Floats


def den_hartog(mu: float) -> tuple[float, float]:
    """The f and ζ of Den Hartog.

    >>> [round(value, 6) for value in den_hartog(0.05)]
    [0.952381, 0.133631]
    """
    return 1 / (1 + mu), sqrt(3 * mu / (8 * (1 + mu)))


def exact_optimum(mu: float) -> tuple[float, float]:
    """The f and ζ of the least peak of a support without a damper.

    >>> [round(value, 8) for value in exact_optimum(0.05)]
    [0.95237204, 0.13393773]
    """
    root = sqrt(4 + 3 * mu)
    inner = 2 * (16 + 23 * mu + 9 * mu**2 + 2 * (2 + mu) * root) / (3 * (64 + 80 * mu + 27 * mu**2))
    return 2 / (1 + mu) * sqrt(inner), sqrt((8 + 9 * mu - 4 * root) / (1 + mu)) / 4


@dataclass(frozen=True, repr=False)
class Absorber(Displayed):
    """A pendulum of one link, at `pendulum` of the scene, next to a mode of the rest.

    `mu` is the ratio of masses, `omega` (rad/s) and `damping_ratio` are those of the mode, `f` and `zeta` the
    pendulum's own frequency over it and its own damping ratio; `alone` where the rest has one coordinate.
    """

    what = "Pendulum as an absorber"
    shows = (
        "pendulum: pendulum; mu: mass ratio μ; omega: ω of the mode, rad/s; damping_ratio: damping ratio of the mode;"
        " f: tuning; zeta: damping ratio of the absorber"
    )

    pendulum: int
    mu: float
    omega: float
    damping_ratio: float
    f: float
    zeta: float
    alone: bool

    @property
    def den_hartog(self) -> tuple[float, float]:
        """The f and ζ of Den Hartog."""
        return den_hartog(self.mu)

    @property
    def exact(self) -> tuple[float, float]:
        """The f and ζ of the least peak of a support without a damper."""
        return exact_optimum(self.mu)


@dataclass(frozen=True, eq=False)
class Beside:
    """The modes of the supports without the pendula: `omega` (R,) and ratios (R,), and of pendula μ by mode."""

    omega: Floats
    damping_ratio: Floats
    pendula: tuple[int, ...]
    mu: Floats
    own_omega: Floats
    zeta: Floats


def rest_of_scene(scene: Scene, pendula: Sequence[int]) -> Beside | None:
    """The rest of a scene without these pendula of one link; None if it has no modes, or springs couple them."""
    linear = matrices(scene)
    counts = [pendulum.count * sum(link.count for link in pendulum.links) for pendulum in scene.pendulum]
    first = len(linear.M) - sum(counts)
    starts = first + np.concatenate(([0], np.cumsum(counts)))
    columns = np.array([int(starts[p]) + k for p in pendula for k in range(counts[p])])
    rest = np.setdiff1d(np.arange(len(linear.M)), columns)
    if not len(rest):
        return None
    K, D, M = linear.K, linear.D, linear.M
    if np.abs(K[np.ix_(columns, rest)]).max(initial=0.0) > 1e-9 * np.abs(np.diag(K)[columns]).max():
        return None
    A = np.diag(M)[columns]
    rows = M[np.ix_(columns, rest)]
    base = M[np.ix_(rest, rest)] - rows.T @ (rows / A[:, None])
    try:
        squares, phi = scipy.linalg.eigh(K[np.ix_(rest, rest)], base)
    except np.linalg.LinAlgError:
        return None
    oscillates = squares > 1e-12 * squares.max(initial=0.0)
    if not oscillates.any():
        return None
    omega, phi = np.sqrt(squares[oscillates]), phi[:, oscillates]
    ratio = np.einsum("ir,ij,jr->r", phi, D[np.ix_(rest, rest)], phi) / (2 * omega)
    mu = np.zeros((len(pendula), len(omega)))
    own_omega, zeta = np.zeros(len(pendula)), np.zeros(len(pendula))
    at = 0
    for k, p in enumerate(pendula):
        rows_of_pendulum = slice(at, at + counts[p])
        mu[k] = ((rows[rows_of_pendulum] @ phi) ** 2 / A[rows_of_pendulum, None]).sum(0)
        own_omega[k] = np.sqrt(K[columns[at], columns[at]] / A[at])
        zeta[k] = D[columns[at], columns[at]] / (2 * A[at] * own_omega[k])
        at += counts[p]
    return Beside(omega, ratio, tuple(pendula), mu, own_omega, zeta)


def single_links(scene: Scene, free: Sequence[FreeNumber]) -> list[int]:
    """The pendula of one hanging link that has a free number."""
    free_pendula = {number.place[1] for number in free if number.place[0] == "pendulum" and "links" in number.place}
    return [
        p
        for p, number in enumerate(scene.pendulum)
        if p in free_pendula
        and len(number.links) == 1
        and number.links[0].count == 1
        and "up" not in (number.equilibrium or ())
    ]


@checked
def absorbers(scene: Scene, free: Sequence[FreeNumber]) -> tuple[Absorber, ...]:
    """Return the tuned pendula of one link, each with the mode of the rest nearest to its own frequency."""
    pendula = single_links(scene, free)
    rest = rest_of_scene(scene, pendula) if pendula else None
    if rest is None:
        return ()
    all_absorbers = []
    for k, p in enumerate(rest.pendula):
        mode = int(np.abs(np.log(rest.omega / rest.own_omega[k])).argmin())
        omega, mu = float(rest.omega[mode]), float(rest.mu[k, mode])
        if mu <= 0:
            continue
        ratio, f = float(rest.damping_ratio[mode]), float(rest.own_omega[k]) / omega
        all_absorbers.append(Absorber(p, mu, omega, ratio, f, float(rest.zeta[k]), len(rest.omega) == 1))
    return tuple(all_absorbers)


def values_for(scene: Scene, p: int, omega: float, zeta: float) -> dict[str, float] | None:
    """The length and the damper of a pendulum of one bob or rod with this frequency and damping ratio of its own."""
    link = scene.pendulum[p].links[0]
    if link.kind == "body" or link.linear_coefficients[0] or link.rotor_inertia:
        return None
    share = 1.0 if link.kind == "bob" else 2.0 / 3.0
    length = scene.gravity / omega**2 / share
    inertia = link.mass * length**2 * (1.0 if link.kind == "bob" else 1.0 / 3.0)
    place: Place = ("pendulum", p, "links", 0)
    return {
        with_numbers((*place, "length")): length,
        with_numbers((*place, "damping")): 2 * zeta * inertia * omega,
    }


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
    writer = "modal.tuning.result:tuned_text"
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
        models = [quantities.form.model(scene) for scene in (self.given, self.scene)]
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


EQUAL_PEAKS = 1e-6
"""Tolerance: relative, of peaks that are listed as equally high: of their written digits."""


def tuned_record(result: Tuned, curves: bool = True) -> dict[str, Any]:
    """Everything about a result for JSON."""
    objective = result.objective
    record: dict[str, Any] = {
        "title": result.given.title,
        "objective": [_aim_record(result, k) for k in range(len(objective.aims))],
        "before": finite(result.before),
        "after": finite(result.after),
        "robust": result.robust,
        "limits": [_limit_record(result, k) for k in range(len(objective.limits))],
        "numbers": records_of(NUMBER, _numbers(result)),
        "starts": result.starts,
        "valleys": [
            {
                "numbers": valley.numbers.tolist(),
                "objective": finite(valley.value),
                "limits_kept": valley.kept,
                "settled": valley.certain,
            }
            for valley in result.valleys
        ],
        "exact": result.certain,
        "last_gain": result.open,
        "rules": [_rule_record(rule) for rule in result.rules],
        "worst_case": {
            "masses": MASS_SHARE,
            "before": finite(result.worst_before),
            "after": finite(result.worst.value),
            "factors": {with_numbers(place): factor for place, factor in result.worst.factors.items()},
        },
        "dampers": records_of(LOAD, result.loads),
    }
    if curves:
        record["curves"] = [
            {
                "response": curve.name,
                "unit": curve.unit,
                "frequency_hz": curve.frequency_hz.tolist(),
                "before": list(map(finite, curve.before.tolist())),
                "after": list(map(finite, curve.after.tolist())),
            }
            for curve in result.curves()
        ]
    return record


def tuned_json(result: Tuned, further_keys: dict[str, Any] | None = None) -> str:
    """Return the same as text, with further details of the result."""
    return as_json({**tuned_record(result), **(further_keys or {})})


def _aim_record(result: Tuned, k: int) -> dict[str, Any]:
    aim, pieces = result.objective.aims[k], result.pieces_after[k]
    quantity = aim.quantity
    record: dict[str, Any] = {
        "quantity": quantity.name,
        "maximized": aim.maximized,
        "weight": quantity.weight,
        "unit": result.unit(quantity),
        **_change(result, k),
    }
    if quantity.kind == "peak":
        order = np.argsort(pieces.at, kind="stable")
        record["peaks"] = [
            {"frequency_hz": float(pieces.at[j]) / tau, "magnitude": float(pieces.values[j])}
            for j in order
            if pieces.inside[j]
        ]
    return record


def _limit_record(result: Tuned, k: int) -> dict[str, Any]:
    limit = result.objective.limits[k]
    return {"quantity": limit.quantity.name, "most": limit.most, **_change(result, len(result.objective.aims) + k)}


def _change(result: Tuned, k: int) -> dict[str, float | None]:
    """The value of quantity k before and after."""
    quantity = result.objective.quantities.quantities[k]
    sides = {"before": result.pieces_before, "after": result.pieces_after}
    return {name: finite(extreme(quantity, pieces[k])) for name, pieces in sides.items()}


def _change_words(change: float) -> str:
    return f"{100 * change:+.3g} %" if np.isfinite(change) else NOTHING


NUMBER = (
    ReportColumn("number.path", "place"),
    ReportColumn("number.words", None, "number"),
    ReportColumn("number.unit_name", "unit", "unit"),
    ReportColumn("number.value", "before", "before", "{:.6g}".format),
    ReportColumn("value", "after", "after", "{:.9g}".format),
    ReportColumn(lambda row: list(row.number.bounds) if row.number.has_bounds else None, "bounds"),
    ReportColumn("worth.larger", "one_percent_larger", "+1 %", _change_words),
    ReportColumn("worth.smaller", "one_percent_smaller", "−1 %", _change_words),
    ReportColumn(lambda row: [finite(row.worth.low), finite(row.worth.high)], "within_one_percent"),
    ReportColumn("worth.low", None, "from", lambda low: f"{low:.5g}" if low else "any"),
    ReportColumn("worth.high", None, "to", lambda high: f"{high:.5g}" if np.isfinite(high) else "any"),
)
"""The quantities of a number."""
SHIFTS = " Of a shift it is 1 % of the least number that it shifts."
WORTH = (
    "+1 % and −1 %: how much worse the objective is if a number is 1 % larger or smaller. From … to: the range in "
    "which it is at most 1 % worse."
)


class _Number(NamedTuple):
    """A free parameter, its sensitivity, and its optimal value."""

    number: FreeNumber
    worth: Worth
    value: float


def _numbers(result: Tuned) -> list[_Number]:
    return list(map(_Number, result.objective.free, result.worths, result.objective.free_numbers(result.z).tolist()))


def _rule_record(rule: Rule) -> dict[str, Any]:
    absorber = rule.absorber
    f, zeta = absorber.den_hartog
    exact = dict(zip(("f", "zeta"), absorber.exact, strict=True))
    return {
        "pendulum": absorber.pendulum,
        "mass_ratio": absorber.mu,
        "mode_omega_rad_per_s": absorber.omega,
        "mode_damping_ratio": absorber.damping_ratio,
        "alone": absorber.alone,
        "found": {"f": absorber.f, "zeta": absorber.zeta},
        "den_hartog": {"f": f, "zeta": zeta, "values": rule.values, "objective": finite(rule.value)},
        "exact_without_a_damper_of_the_carrier": exact if absorber.alone else None,
    }


LOAD = (
    ReportColumn("path", "damper"),
    ReportColumn("per", "per"),
    ReportColumn("stroke", "stroke"),
    ReportColumn("unit", "stroke_unit"),
    ReportColumn("at_hz", "stroke_at_hz"),
    ReportColumn("effort", "effort"),
    ReportColumn("effort_unit", "effort_unit"),
    ReportColumn("effort_at_hz", "effort_at_hz"),
)
"""The quantities of a damper."""


def tuned_text(result: Tuned, further_text: str = "") -> str:
    """Return the result as text."""
    numbers = ReportTable.of(NUMBER, _numbers(result)).written()
    worth = WORTH + SHIFTS * any(number.unknown.is_shift for number in result.objective.free)
    parts = [
        _objective_table(result),
        numbers,
        worth,
        "\n".join(_sentences(result)),
        _rules_table(result),
        further_text,
    ]
    return titled(title_of(result.given), "tuned", parts, "text")


def _objective_table(result: Tuned) -> str:
    headings = ["", "quantity", "unit", "before", "after", "peaks (Hz)"]
    rows, objective = [], result.objective
    ways = [
        f"{'maximize' if aim.maximized else 'minimize'}{f' ×{aim.quantity.weight:g}' * (aim.quantity.weight != 1)}"
        for aim in objective.aims
    ]
    ways += [f"at most {limit.most:g}" for limit in objective.limits]
    for k, (way, quantity) in enumerate(zip(ways, objective.quantities.quantities, strict=True)):
        piece, peaks = result.pieces_after[k], ""
        if quantity.kind == "peak" and k < len(objective.aims):
            largest = piece.values.max()
            equal = sorted(piece.at[piece.inside & (piece.values >= largest * (1 - EQUAL_PEAKS))].tolist())
            peaks = ", ".join(f"{at / tau:.5g}" for at in equal)
        values = [f"{extreme(quantity, pieces[k]):.8g}" for pieces in (result.pieces_before, result.pieces_after)]
        rows.append([way, quantity.words, result.unit(quantity), *values, peaks])
    if not any(row[-1] for row in rows):
        rows, headings = [row[:-1] for row in rows], headings[:-1]
    return grid(rows, headings)


def _sentences(result: Tuned) -> Iterator[str]:
    objective = result.objective
    ends, first = result.valleys, result.valleys[0].value
    values = ", ".join(f"{valley.value:.6g}" for valley in ends)
    alike = [valley for valley in ends if abs(valley.value - first) <= COARSE * abs(first)]
    if result.starts == 1:
        yield "Only one start had a finite value."
    elif len(ends) == 1:
        yield f"All {result.starts} starts converged to the same minimum."
    elif all(valley.certain for valley in ends):
        equal = f"; {len(alike)} of them are equally low" * (len(alike) > 1)
        yield f"{result.starts} starts converged to {len(ends)} minima: {values}{equal}."
    else:
        yield f"{result.starts} starts ended at {values}; the best is kept."
    if not result.certain:
        yield (
            "Newton's method did not converge: modes may coincide here, where the objective has no second "
            f"derivatives. The last restart still improved it by {percent(result.open)}."
        )
    for aim, pieces in zip(objective.aims, result.pieces_after, strict=False):
        if aim.quantity.kind == "peak" and not aim.maximized and not pieces.hertz(int(pieces.values.argmax())):
            yield f"{capital(aim.quantity.words)} is largest at 0 Hz, where no damper acts; no peak is higher."
    at_bounds = [
        number.words
        for number, z, low, high in zip(objective.free, result.z, objective.low, objective.high, strict=True)
        if min(z - low, high - z) < EDGE
    ]
    if at_bounds:
        yield f"At its bound: {', '.join(at_bounds)}."
    worst = result.worst
    if worst.factors:
        words = "Tuned for the worst case" if result.robust else "Worst case"
        values = f"{worst.value:.6g}, before {result.worst_before:.6g}"
        yield f"{words} of all masses ±{percent(MASS_SHARE)}: {values} ({worst.words(result.given)})."
    for load in result.loads:
        per, where = (f" per {load.per}", f" at {load.at_hz:.4g} Hz") if load.per else (" RMS", "")
        what = "torque" if load.unit == "rad" else "force"
        effort = f"{what} {load.effort:.5g} {load.effort_unit}{per}"
        damper = capital(number_words(result.given, load.path))
        yield f"{damper}: stroke {load.stroke:.5g} {load.unit}{per}{where}, {effort}."


def _rules_table(result: Tuned) -> str:
    if not result.rules:
        return ""
    headings = ("pendulum", "μ", "mode", "rule", "f", "ζ", "objective")
    rows, notes = [], []

    def add(names: Sequence[str], rule: str, f: float, zeta: float, value: str) -> None:
        rows.append([*names, rule, f"{f:.8f}", f"{zeta:.8f}", value])

    for rule in result.rules:
        absorber, again = rule.absorber, ("", "", "")
        words = f"{absorber.omega / tau:.5g} Hz, ζ {absorber.damping_ratio:.4g}"
        name = number_words(result.given, f"pendulum[{absorber.pendulum}].count").rpartition(" of ")[2]
        names = (name, f"{absorber.mu:.6g}", words)
        add(names, "this optimum", absorber.f, absorber.zeta, f"{result.after:.8g}")
        add(again, "Den Hartog", *absorber.den_hartog, f"{rule.value:.8g}" if np.isfinite(rule.value) else "")
        if absorber.alone:
            add(again, "exact if ζ were 0" if absorber.damping_ratio > EQUAL_PEAKS else "exact", *absorber.exact, "")
        else:
            notes = ["Den Hartog's rule with several carriers is for the mode nearest to the pendulum alone."]
    return "\n\n".join([grid(rows, headings, spare=["unit"]), *notes])
