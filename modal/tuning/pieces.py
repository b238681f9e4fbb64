"""Quantities of a scene as the largest, or least, of smooth numbers: their pieces, with exact derivatives.

    peak        |H(iω_k)| at every peak; its derivative holds ω, since ∂|H|/∂ω = 0 there
    rms         √∫ |H|² S df and ∫ Re(H̄ ∂H) S df, by the rule of `modal.vibration`
    damping     ζ_k of every mode that swings, of Re λ_k and |λ_k|
    settling    ln 50 / −Re λ_k
    residual    one number, as is a measure

The derivative of these is a difference quotient of four values, all others are exact.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import log, tau

import numpy as np

from modal.errors import ComputationError, SceneError, refuse_any
from modal.identification.identifiability import ModeDerivatives, polar
from modal.modes import Modes, natural_modes
from modal.report import deferred
from modal.scene import Scene, require
from modal.scene.parameters import Place, Variable, number_at, vary, with_numbers
from modal.scene.records import Spectrum
from modal.statespace.channels import Arrays, Channel, Model, channel_model
from modal.statespace.hoisting import Travel, travel_swing
from modal.statespace.shapers import Kind
from modal.tuning.model import (
    COORDINATES_MAX,
    DAMPING_MIN,
    STILL_RATE,
    Interpolated,
    find_peaks,
    interpolate,
)
from modal.tuning.quantities import FreeNumber, Quantity
from modal.types import Booleans, Floats
from modal.vibration.random import input_psd, nodes, stretches

FIFTY = log(50.0)
QUOTIENT_STEP_OF_PIECES = (2**6 * np.finfo(float).eps) ** 0.2
"""Tolerance: relative, of a difference quotient of four values, at which truncation and rounding are alike: a swing,
the product of many steps of its motion, is right to 2⁶ ε."""
PAIRS = ((1, 2 / 3), (2, -1 / 12))


@dataclass(frozen=True)
class Setting:
    """The setting of the quantities: a `band` in Hz, a PSD, modes by number, a travel (m, s) and its shaper."""

    band: tuple[float, float] | None = None
    spectrum: Spectrum | None = None
    modes: tuple[int, ...] = ()
    travel: float | None = None
    over: float | None = None
    kind: Kind | None = None

    @property
    def rates(self) -> tuple[float, float] | None:
        """The band in rad/s."""
        return None if self.band is None else (tau * self.band[0], tau * self.band[1])


@dataclass(frozen=True, eq=False)
class Pieces:
    """Numbers `values` (P,), of which a quantity is the largest or least, and `gradients` (P, n) by the free numbers.

    `at` (P,) are what they belong to: frequencies in rad/s, or numbers of modes; `inside` (P,) tells maxima of a
    response from ends of a band, `helps` (P,) values next to peaks that are no pieces but bounds. A quantity without a
    finite value has no pieces and says in `endless` why.
    """

    values: Floats
    gradients: Floats
    at: Floats
    inside: Booleans
    endless: str = ""
    helps: Booleans | None = None
    static: float = 0.0
    """The frequency (rad/s) that stands for 0."""

    def hertz(self, k: int) -> float:
        """The frequency of a piece in Hz."""
        return 0.0 if self.at[k] == self.static else float(self.at[k]) / tau

    @classmethod
    def none(cls, words: str, n: int) -> Pieces:
        """Those of a quantity without a finite value."""
        return cls(np.zeros(0), np.zeros((0, n)), np.zeros(0), np.zeros(0, bool), words)


class Quantities:
    """The pieces of `quantities` of a scene at values of its `free` numbers, and at `factors` of other masses."""

    def __init__(
        self, scene: Scene, free: Sequence[FreeNumber], quantities: Sequence[Quantity], setting: Setting
    ) -> None:
        self.scene, self.free, self.quantities, self.setting = scene, tuple(free), tuple(quantities), setting
        _validate(scene, quantities, setting)
        self.channels = list(
            dict.fromkeys(Channel(entry.output, entry.input) for entry in quantities if entry.kind in {"peak", "rms"})
        )
        self.form = channel_model(scene, self.channels)
        places = [place for entry in free for place in entry.places]
        self.places = (*places, *(place for place in masses_of(scene) if place not in places))
        self.given = {place: number_at(scene, place) for place in self.places}
        self._paths = [with_numbers(place) for place in self.places]
        self._variable = Variable(scene, self._paths)

    def scene_at(self, values: Floats, factors: Mapping[Place, float] | None = None) -> Scene:
        """The scene with these free numbers (n,), and with others, or these, times factors."""
        numbers = self.given.copy()
        for entry, value in zip(self.free, values.tolist(), strict=False):
            numbers |= entry.numbers(value)
        for place, factor in (factors or {}).items():
            numbers[place] *= factor
        return self._variable.at(dict(zip(self._paths, numbers.values(), strict=True))) if numbers else self.scene

    @cached_property
    def _polynomials(self) -> dict[tuple[tuple[Place, float], ...], tuple[Floats, Interpolated | None]]:
        """Arrays as polynomials in the free numbers, by the factors of masses."""
        return {}

    def centre(self, values: Floats, factors: Mapping[Place, float] | None = None) -> None:
        """Interpolate the arrays about these free numbers (n,)."""
        key = tuple(sorted((factors or {}).items(), key=str))
        centre = np.array(values)
        self._polynomials[key] = (
            centre,
            interpolate(lambda numbers: self.form.arrays(self.scene_at(numbers, factors)), centre),
        )

    def polynomial(self, values: Floats, factors: Mapping[Place, float] | None = None) -> Interpolated | None:
        """The arrays as polynomials in the free numbers, None if they are none."""
        key = tuple(sorted((factors or {}).items(), key=str))
        if key not in self._polynomials:
            self.centre(values, factors)
        return self._polynomials[key][1]

    def at(
        self,
        values: Floats,
        factors: Mapping[Place, float] | None = None,
        *,
        by: Sequence[tuple[Place, ...]] | None = None,
    ) -> list[Pieces]:
        """The pieces of every quantity; gradients by numbers before factors, each at its places, none by default."""
        evaluation = At(self, values, factors, tuple(by or ()))
        return [evaluation.pieces(quantity) for quantity in self.quantities]


class At:
    """Quantities of one scene."""

    def __init__(
        self,
        problem: Quantities,
        values: Floats,
        factors: Mapping[Place, float] | None,
        by: tuple[tuple[Place, ...], ...],
    ) -> None:
        self.problem, self.values, self.factors, self.by = problem, values, factors, by
        self.setting = problem.setting
        column_of = {number.places: k for k, number in enumerate(problem.free)}
        self._columns = [column_of[places] for places in by if places in column_of]
        is_own = len(self._columns) == len(by) and bool(column_of) and bool(by or not factors)
        self._polynomial = problem.polynomial(values, factors) if is_own else None

    @cached_property
    def scene(self) -> Scene:
        """The scene itself."""
        return self.problem.scene_at(self.values, self.factors)

    @cached_property
    def model(self) -> Model:
        """Its responses."""
        if self._polynomial is None:
            return self.problem.form.model(self.scene)
        return Model(self.problem.form.kinds, self._polynomial.arrays(self.values))

    @cached_property
    def slopes(self) -> Arrays:
        """Derivatives of its arrays by the numbers before factors: of a shared one the sum over its places."""
        if self._polynomial is not None:
            return self._polynomial.slopes(self.values, self._columns)
        places = [place for shared in self.by for place in shared]
        slopes = self.problem.form.slopes(self.scene, places)
        factors = np.array([self._factor(place) for place in places])
        begins = np.cumsum([0, *map(len, self.by[:-1])])
        return Arrays(*(np.add.reduceat(part * factors.reshape(-1, *[1] * (part.ndim - 1)), begins) for part in slopes))

    def _factor(self, place: Place) -> float:
        return (self.factors or {}).get(place, 1.0)

    @cached_property
    def modes(self) -> Modes:
        """Its modes."""
        return natural_modes(self.scene)

    @cached_property
    def rates(self) -> tuple[list[int], list[complex], Floats]:
        """Rows of the modes that move, their λ and ∂λ/∂p (K, n)."""
        modes = self.modes
        smallest = STILL_RATE * float(modes.omega.max(initial=0.0))
        chosen = [number - 1 for number in self.setting.modes] or range(len(modes))
        rows = [k for k in chosen if k < len(modes) and modes.omega[k] > smallest]
        values = [complex(modes.eigenvalue[k]) for k in rows]
        if not self.by:
            return rows, values, np.zeros((len(rows), 0))
        derivatives = ModeDerivatives(modes, self.slopes.M, self.slopes.K, self.slopes.D)
        slopes = np.array([derivatives.eigenvalue(k) for k in rows])
        return rows, values, np.where(np.isfinite(slopes), slopes, 0.0)

    def pieces(self, quantity: Quantity) -> Pieces:
        """The pieces of a quantity."""
        of = {
            "peak": self._peak,
            "rms": self._rms,
            "damping": self._damping,
            "settling": self._settling,
            "residual": self._residual,
        }
        return of.get(quantity.kind, self._measure)(quantity)

    def _channel(self, quantity: Quantity) -> int:
        return self.problem.channels.index(Channel(quantity.output, quantity.input))

    def _peak(self, quantity: Quantity) -> Pieces:
        channel, n = self._channel(quantity), len(self.by)
        peaks = find_peaks(self.model, channel, self.setting.rates)
        if peaks.endless:
            return Pieces.none(f"its magnitude grows without bound {peaks.endless}", n)
        if not self.by:
            size = np.abs(self.model.response(channel, peaks.omega))
            return Pieces(size, np.zeros((len(size), 0)), peaks.omega, peaks.inside, static=peaks.static)
        omega = np.concatenate((peaks.omega, peaks.beside))
        H, slopes = self.model.gradient(channel, omega, self.slopes)
        size = np.abs(H)
        by = (np.conj(H)[:, None] * slopes).real / np.where(size > 0, size, 1.0)[:, None]
        helps = np.arange(len(omega)) >= len(peaks.omega)
        inside = np.concatenate((peaks.inside, np.zeros(len(peaks.beside), bool)))
        return Pieces(size, by, omega, inside, helps=helps)

    def _rms(self, quantity: Quantity) -> Pieces:
        channel, n = self._channel(quantity), len(self.by)
        spectrum = self.setting.spectrum
        assert spectrum is not None
        poles = self.model.poles_for(channel)
        poles = poles[poles.imag >= 0]
        total, slope = 0.0, np.zeros(n)
        for low, high in stretches(spectrum):
            has_no_damping = (np.abs(poles.real) <= DAMPING_MIN * np.abs(poles)) & (poles.imag > 0)
            for pole in poles[has_no_damping & (poles.imag >= low) & (poles.imag <= high)].tolist():
                at_pole, beside = np.abs(self.model.response(channel, pole.imag * np.array([1 + 1e-9, 1.01])))
                if at_pole > 1e6 * beside:
                    words = f"it grows without bound: nothing damps a mode at {pole.imag / tau:.6g} Hz"
                    return Pieces.none(words, n)
            for omega, _, weight in nodes(low, high, poles[~has_no_damping].tolist()):
                S = weight * input_psd(spectrum, quantity.input, omega / tau) / tau
                if n:
                    H, by = self.model.gradient(channel, omega, self.slopes)
                    slope += S @ (np.conj(H)[:, None] * by).real
                else:
                    H = self.model.response(channel, omega)
                total += float(S @ np.abs(H) ** 2)
        size = np.sqrt(total)
        if not np.isfinite(size):
            return Pieces.none("it grows without bound", n)
        return Pieces(np.array([size]), (slope / (size or 1.0))[None], np.zeros(1), np.ones(1, bool))

    def _damping(self, quantity: Quantity) -> Pieces:
        rows, values, slopes = self.rates
        swings = [k for k, value in enumerate(values) if value.imag > 0]
        if not swings:
            return Pieces.none("no mode swings", len(self.by))
        zeta = np.array([-values[k].real / abs(values[k]) for k in swings])
        by = np.array([polar(values[k], slopes[k])[1] for k in swings]).reshape(len(swings), len(self.by))
        return Pieces(zeta, by, np.array([rows[k] for k in swings], float), np.ones(len(swings), bool))

    def _settling(self, quantity: Quantity) -> Pieces:
        rows, values, slopes = self.rates
        decay = np.array([-value.real for value in values])
        smallest = DAMPING_MIN * np.abs(values)
        if not len(rows) or (decay <= smallest).any():
            words = (
                "no mode moves" if not len(rows) else f"mode {rows[int((decay - smallest).argmin())] + 1} never settles"
            )
            return Pieces.none(words, len(self.by))
        by = (FIFTY / decay**2)[:, None] * slopes.real
        return Pieces(FIFTY / decay, by, np.array(rows, float), np.ones(len(rows), bool))

    def _residual(self, quantity: Quantity) -> Pieces:
        return self._differentiated(self._swing)

    def _measure(self, quantity: Quantity) -> Pieces:
        measure, number = quantity.request
        portion = deferred("nonlinear.sweeps.measures:Portion")([], self.problem.scene)

        def value(scene: Scene) -> float:
            (measured,) = measure.of_scene(scene, number, portion).values()
            return measured

        pieces = self._differentiated(value)
        return pieces if np.isfinite(pieces.values).all() else Pieces.none("it has no finite value", len(self.by))

    def _differentiated(self, function: Callable[[Scene], float]) -> Pieces:
        """A number of a scene with its difference quotients."""
        value = function(self.scene)
        by = np.zeros(len(self.by))
        for k, places in enumerate(self.by):
            numbers = {place: number_at(self.scene, place) for place in places}
            step = QUOTIENT_STEP_OF_PIECES * min(number / self._factor(place) for place, number in numbers.items())
            for multiple, weight in PAIRS:
                pair = [function(self._moved(numbers, way * multiple * step)) for way in (1, -1)]
                by[k] += weight * (pair[0] - pair[1]) / step
        return Pieces(np.array([value]), by[None], np.zeros(1), np.ones(1, bool))

    def _moved(self, numbers: Mapping[Place, float], step: float) -> Scene:
        """The scene with a step of the number that these places share before their factors."""
        return vary(
            self.scene,
            {with_numbers(place): number + self._factor(place) * step for place, number in numbers.items()},
        )

    def _swing(self, scene: Scene) -> float:
        setting = self.setting
        assert setting.travel is not None
        travel = travel_of(scene, setting.travel, setting.over)
        return travel_swing(scene, travel, setting.kind)


def travel_of(scene: Scene, distance: float, over: float | None) -> Travel:
    """The travel of a scene's cart, from the begin of its hoist on, or from 0 s over a duration that must be given."""
    if scene.is_hoisted:
        return Travel.along(scene, distance, over)
    if over is None:
        raise SceneError(["over: a travel of a scene without a hoist needs its duration in seconds"])
    return Travel(distance, 0.0, over)


def masses_of(scene: Scene) -> list[Place]:
    """The places of all masses of supports and links."""
    places: list[Place] = []
    several = isinstance(scene.support, tuple)
    for k, support in enumerate(scene.supports):
        if getattr(support, "mass", 0.0):
            places.append(("support", k, "mass") if several else ("support", "mass"))
    for p, pendulum in enumerate(scene.pendulum):
        places += [("pendulum", p, "links", i, "mass") for i in range(len(pendulum.links))]
    return places


def _validate(scene: Scene, quantities: Sequence[Quantity], setting: Setting) -> None:
    """Raise SceneError for quantities that this scene, or their range, does not have."""
    kinds = {quantity.kind for quantity in quantities}
    if kinds - {"residual"}:
        require(scene, "tuning")
    problems = [*_travel_problems(scene, kinds, setting), *_psd_problems(quantities, setting)]
    if setting.band is not None and "peak" not in kinds:
        problems.append("band: is for a quantity peak:OUTPUT/INPUT")
    if setting.band is not None and not 0 <= setting.band[0] < setting.band[1] < np.inf:
        problems.append(
            f"band {setting.band[0]:g}:{setting.band[1]:g}: must run from a frequency to a larger one, in Hz"
        )
    if setting.modes and not kinds & {"damping", "settling"}:
        problems.append("mode: is for the quantities damping and settling")
    if not problems and setting.modes:
        total = len(natural_modes(scene))
        problems += [f"mode {k}: the scene has modes 1 to {total}" for k in setting.modes if not 1 <= k <= total]
    refuse_any(problems)
    size = scene.n_links + len(scene.supports)
    if size > COORDINATES_MAX:
        raise ComputationError(f"the scene has {size} coordinates: at most {COORDINATES_MAX} are tuned")


def _travel_problems(scene: Scene, kinds: set[str], setting: Setting) -> Iterator[str]:
    if "residual" not in kinds:
        if setting.travel is not None:
            yield "travel: is for the quantity residual"
        return
    if setting.travel is None:
        yield "residual: needs `travel=…`"
    if scene.cart is None:
        yield "residual: needs a cart that travels"
    elif setting.travel is not None and not scene.is_hoisted and setting.over is None:
        yield "residual: a travel of a scene without a hoist needs its duration: give `over=…`"


def _psd_problems(quantities: Sequence[Quantity], setting: Setting) -> Iterator[str]:
    sources = sorted({quantity.input for quantity in quantities if quantity.kind == "rms"})
    if sources and setting.spectrum is None:
        yield "rms: needs `psd=…`"
    if setting.spectrum is not None and not sources:
        yield "psd: is for a quantity rms:OUTPUT"
    if len(sources) > 1:
        yield f"rms: the PSD is of one input, and these are {', '.join(sources)}"
