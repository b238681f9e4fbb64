"""Input shapers: a command is split into a few delayed parts that leave no residual vibration in chosen modes.

With T_d = 2π/(ω√(1−ζ²)) and K = exp(−ζπ/√(1−ζ²))

    ZV     amplitudes (1, K)/(1+K)                       at 0, T_d/2
    ZVD    amplitudes (1, 2K, K²)/(1+K)²                 at 0, T_d/2, T_d   (insensitive to ω to first order)
    ZVDD   amplitudes (1, 3K, 3K², K³)/(1+K)³            at 0, T_d/2, …     (to second order, ZVDDD to third)
    MZV    amplitudes ∝ (1, √2 K^¾, K^{3/2})             at 0, 3T_d/8, 3T_d/4
    EI     amplitudes ∝ (1+v, 2(1−v)K, (1+v)K²)          at 0, T_d/2, T_d   (V ≤ a tolerance about ω)
    EI2    amplitudes (a, (½−a)K, (½−a)K², aK³)          a = (3x² + 2x + 3v²)/(16x),  x³ = v² (1 + √(1−v²))
    EI3    amplitudes (a, bK, (1−2a−2b)K², bK³, aK⁴)     a = (1 + 3v + √(8v(1+v)))/16,  b = (1−v)/4
    UM     amplitudes (1, −1, 1)                         at 0, ≈ T_d/6, ≈ T_d/3

where v is the tolerance for an undamped mode, and for a damped one the value that makes the highest hump of V the
tolerance. They are multiplied to add up to 1; for several modes the shaper is the convolution of one for each. After
the last of the impulses A_i at t_i, the residual vibration of a mode, relative to a single impulse of the same sum at
the start, is

    V(ω, ζ) = e^{−ζωt_n} |Σ A_i e^{s t_i}|,     s = ζω + iω√(1−ζ²).

A controller that samples every h can only act at multiples of h.  There the impulse K at T_d/2, for which K e^{s T_d/2}
= −1, becomes two at the multiples around it, with Σ a e^{s t} = −1 as before: the sampled command of a ZV or ZVD shaper
leaves no residual in the mode. Those of UM are divided between neighbouring samples in the same way.

([Singer1990]; robustness as the range of V ≤ 5 %, and EI: [Singhose1994]; humps: [Singhose1997a]; MZV,
between ZV and ZVD in length and in robustness: [Butyugin2020]; UM: [Singhose1997]; on a grid: [Murphy1992].)

The relevant frequencies depend on the drive: if the trolley follows an acceleration or a velocity regardless of its
load, the load swings as on a fixed support. A trolley driven by a force moves with its load, at the free frequencies,
and so does a structure moved by a force on one of its coordinates, such as `ship_sway_force`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import product
from math import exp, floor, pi, sqrt
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike

from modal.eigen import smallest_where
from modal.errors import ComputationError, refuse_any, spelling_hint
from modal.modes import MOST_COMPARED, Mode, Modes, counterparts, natural_modes
from modal.report import Displayed, Summary, counted, tabulated
from modal.scene import Scene, refusals, validate_scene
from modal.scene.doors import checked, checked_index, require_type
from modal.scene.parameters import vary
from modal.statespace.geometry import coordinates_of
from modal.statespace.model import without_carrier
from modal.structure import structure_of
from modal.types import EPS, NEWTON_ROUNDS, NOISE_OF_SUM, Booleans, Complexes, Floats

TOLERANCE_OF_RESIDUAL = 0.05
"""Limit: residual vibration up to which a shaper counts as working, the default of `tolerance`."""
SAMPLES_OF_CURVE = 2001
"""Tolerance: frequencies among which the hump of an EI shaper, or the edge of a range, is found, then refined."""
Kind = Literal["zv", "zvd", "zvdd", "zvddd", "mzv", "ei", "ei2", "ei3", "um"]
Train = tuple[Floats, Floats]
"""Times (n,) in s and amplitudes (n,) of impulses."""
UNSHAPED: Train = np.zeros(1), np.ones(1)
Drive = Literal["cart_force", "cart_acceleration", "cart_velocity"] | str
"""What moves the cart, or the force on a coordinate of a structure by its name."""
PUSH, HELD = "cart_force", ("cart_acceleration", "cart_velocity")
ASSUMED = {
    "cart_acceleration": "trolley motion prescribed: the load swings as on a fixed support",
    "cart_velocity": "trolley motion prescribed: the load swings as on a fixed support",
    "cart_force": "trolley pushed by a force: it swings with its load, as in the table",
}


class DampedSwing(NamedTuple):
    """Natural frequency ω (rad/s) and damping ratio ζ of a mode to be left at rest."""

    omega: float
    zeta: float = 0.0


@dataclass(frozen=True, eq=False, repr=False)
class Shaper(Displayed):
    """Impulses at `times` (n,) in s, ascending from 0, of `amplitudes` (n,) that add to 1.

    The times are multiples of `step` (s) where that is not 0.
    """

    times: Floats
    amplitudes: Floats
    step: float = 0.0

    def _summary(self) -> Summary:
        facts = [("at multiples of", f"{self.step:g} s")] if self.step else []
        title = f"Input shaper of {counted(len(self.times), 'impulse', 'impulses')}, {self.duration:.4g} s long"
        return tabulated(title, facts, {"time (s)": self.times, "amplitude": self.amplitudes})

    @property
    def train(self) -> Train:
        """The impulses."""
        return self.times, self.amplitudes

    @property
    def duration(self) -> float:
        """The delay (s) of the end of a shaped command."""
        return float(self.times[-1])

    def shaped(self, times: ArrayLike, command: ArrayLike) -> Floats:
        """Σ A_i u(t − t_i) (T,) of a command u (T,) at ascending times (T,), 0 before the first and linear between."""
        t, u = np.asarray(times, dtype=np.float64), np.asarray(command, dtype=np.float64)
        parts = (a * np.interp(t - at, t, u, left=0.0) for at, a in zip(self.times, self.amplitudes, strict=True))
        return np.asarray(sum(parts), dtype=np.float64)

    def __mul__(self, second: Shaper) -> Shaper:
        """The convolution of two shapers of one step, which suppresses the modes of both."""
        return Shaper(*_convolve(self.train, second.train, self.step), self.step)


def shaper(
    swings: Sequence[DampedSwing], kind: Kind = "zv", step: float = 0.0, tolerance: float = TOLERANCE_OF_RESIDUAL
) -> Shaper:
    """Return the shaper of one mode, or the convolution for several, on the grid of a `step` (s) if that is not 0.

    `tolerance` is the residual that a shaper with humps (ei, ei2, ei3) may leave about ω. Raise ValueError for another
    kind, for no modes, for a negative step and a tolerance outside of 0 to 1, ComputationError for a mode that does not
    oscillate and for too long a step.
    """
    if kind not in get_args(Kind) or not swings:
        words = ", ".join(f'"{name}"' for name in get_args(Kind))
        raise ValueError(f"kind = {kind!r} for {len(swings)} modes: must be one of {words}, for at least one mode")
    if not (0 <= step < np.inf and 0 < tolerance < 1):
        raise ValueError(f"step = {step} s, tolerance = {tolerance}: must be at least 0 s, and between 0 and 1")
    return reduce(Shaper.__mul__, (_single(swing, kind, step, tolerance) for swing in swings))


@checked
def shaper_for(
    scene: Scene,
    count: int = 1,
    kind: Kind = "zv",
    drive: Drive = "cart_acceleration",
    first: int = 0,
    *,
    step: float = 0.0,
    tolerance: float = TOLERANCE_OF_RESIDUAL,
) -> Shaper:
    """The `shaper` for `count` of the modes found by `swings_of`, from index `first` on."""
    swings = swings_of(scene, drive)
    if not 0 <= first < first + count <= len(swings):
        mode_words = counted(len(swings), "mode", "modes")
        place = f" from index {first}" if first else ""
        raise ComputationError(f"count {count}{place}: this drive excites {mode_words}")
    return shaper(swings[first : first + count], kind, step, tolerance)


def swings_of(scene: Scene, drive: Drive = "cart_acceleration") -> list[DampedSwing]:
    """Return the modes that a drive excites, in ascending order: fixed-base modes under a prescribed motion.

    Under "cart_force" they are the free modes that move the cart, under the force on a coordinate of a structure those
    that move this. Raise SceneError for a drive that the scene does not have and for a fixed support, ComputationError
    for an unstable equilibrium.
    """
    validate_scene(scene)
    modes, rows = swing_rows(scene, drive)
    return [DampedSwing(mode.omega, mode.damping_ratio) for mode in modes.rows(rows)]


def swing_rows(scene: Scene, drive: Drive) -> tuple[Modes, list[int]]:
    """The modes of the scene with this drive, and the indices of those that it excites."""
    drives = drives_of(scene)
    problems = (
        [f"drive {drive!r}: must be one of {', '.join(drives)}{spelling_hint(str(drive), drives)}"]
        if drives and drive not in drives
        else []
    )
    problems += refusals(scene, "a shaper")
    if not (drives or problems):
        problems = ["support: a shaper needs a coordinate that a force moves, and all supports are fixed"]
    refuse_any(problems)
    is_force = drive not in HELD
    modes = natural_modes(scene if is_force else without_carrier(scene))
    all_modes = list(modes)
    if growing := next((mode for mode in all_modes if mode.growth_rate), None):
        raise ComputationError(
            f"the equilibrium is unstable, with a growth rate of {growing.growth_rate:.4g} "
            "1/s: no shaper can suppress that"
        )
    if not is_force:
        return modes, [mode.number - 1 for mode in all_modes if mode.oscillates]
    return modes, [mode.number - 1 for mode in _driven_modes(modes, drives.index(drive))]


def drives_of(scene: Scene) -> tuple[str, ...]:
    """The drives that a scene has: forces on coordinates in their order, then prescribed motions of one cart alone.

    >>> from modal import load
    >>> drives_of(load("crane-hook")), drives_of(load("tower"))
    (('cart_force', 'cart_acceleration', 'cart_velocity'), ('floor1_force', 'floor2_force'))
    """
    require_type("scene", scene, "Scene")
    names = [coordinate.force for coordinate in coordinates_of(structure_of(scene))] if scene.is_structured else [PUSH]
    return (*names, *(HELD if names == [PUSH] else ()))


def usual_drive(scene: Scene) -> Drive:
    """Return the default drive: the acceleration of a free cart, else the force on a coordinate.

    Of a structure that is the first.

    >>> from modal import load
    >>> usual_drive(load("crane-hook")), usual_drive(load("clocks-double")), usual_drive(load("tower"))
    ('cart_acceleration', 'cart_force', 'floor1_force')
    """
    require_type("scene", scene, "Scene")
    drives = drives_of(scene)
    is_free = HELD[0] in drives and not (scene.cart and scene.cart.stiffness)
    return HELD[0] if is_free or not drives else drives[0]


@checked
def usual_inputs(scene: Scene) -> tuple[str, ...]:
    """The inputs of a model where none are named: `usual_drive` of one cart, otherwise those of `state_space`.

    Those of a structure are the forces on all coordinates, of which the first is `usual_drive`.

    >>> from modal import load
    >>> usual_inputs(load("crane-hook")), usual_inputs(load("tower"))
    (('cart_acceleration',), ())
    """
    is_single = scene.cart is not None and not scene.feedback
    return (usual_drive(scene),) if is_single else ()


def _driven_modes(modes: Modes, coordinate: int) -> list[Mode]:
    """The modes that oscillate and move a coordinate of the support, whose own force then excites them."""
    swinging = [mode for mode in modes if mode.oscillates]
    if modes.rig.structure is None:
        return [mode for mode in swinging if mode.cart_participation]
    shapes, amplitudes = modes.matrix, np.zeros(len(modes))
    size = np.sqrt(modes.matrices.M[coordinate, coordinate])
    np.maximum.at(amplitudes, shapes.row, np.abs(shapes.shapes[coordinate]) * size)
    return [mode for mode in swinging if amplitudes[mode.number - 1] > NOISE_OF_SUM]


@checked
def swing_words(scene: Scene, count: int = 1, drive: Drive = "cart_acceleration") -> Iterator[str]:
    """The assumptions of a shaper for the `count` slowest modes, then a line for each, with the table's mode."""
    modes, rows = swing_rows(scene, drive)
    is_force, has_table = drive not in HELD, scene.n_links <= MOST_COMPARED
    similar_modes = [""] * len(modes) if is_force or not has_table else _similar_modes(modes, natural_modes(scene))
    yield (
        ASSUMED.get(drive)
        or f"{drive}: the driven coordinate moves with everything that the structure carries, as in the table"
    )
    for number, (row, mode) in enumerate(zip(rows[:count], modes.rows(rows[:count]), strict=True), start=1):
        name = f"mode {mode.number}" if is_force else f"fixed-base mode {number}"
        yield f"{name}: {mode.omega:.9g} rad/s, damping ratio {mode.damping_ratio:.4g}{similar_modes[row]}"


def _similar_modes(modes: Modes, table: Modes) -> list[str]:
    """For every fixed-base mode the most similar mode of the table, with a free cart."""
    moving = {mode.number - 1: mode for mode in _driven_modes(table, 0)}
    if not moving:
        return [""] * len(modes)
    similar = (moving[row] for row in counterparts(modes, table, list(moving)).tolist())
    return [f"; the table, with the trolley free: mode {mode.number}, {mode.omega:.9g} rad/s" for mode in similar]


def residual_vibration(shaper: Shaper, omega: ArrayLike, zeta: ArrayLike = 0.0) -> Floats:
    """V(ω, ζ): amplitude left after the last impulse over that after a single one at the start; 0 ≤ ζ < 1."""
    w, z = np.broadcast_arrays(np.asarray(omega, dtype=np.float64), np.asarray(zeta, dtype=np.float64))
    exponent = (z + 1j * np.sqrt((1 - z) * (1 + z))) * w
    remainder = np.exp(exponent[..., None] * shaper.times) @ shaper.amplitudes
    return np.asarray(np.abs(remainder) * np.exp(-z * w * shaper.duration), dtype=np.float64)


def insensitivity(shaper: Shaper, swing: DampedSwing, tolerance: float = TOLERANCE_OF_RESIDUAL) -> tuple[float, float]:
    """The range of ω (rad/s) about that of `swing` in which the residual vibration stays below `tolerance`.

    Raise ComputationError if it exceeds it at `swing` itself.
    """

    def works(omega: Floats) -> Booleans:
        return np.asarray(residual_vibration(shaper, omega, swing.zeta) <= tolerance, dtype=np.bool_)

    if not works(np.array([swing.omega]))[0]:
        raise ComputationError(f"at ω = {swing.omega:g} rad/s the residual vibration exceeds {tolerance:.2g}")
    down, up = np.linspace(1.0, 1e-3, SAMPLES_OF_CURVE), np.linspace(1.0, 4.0, SAMPLES_OF_CURVE)
    return _edge(works, swing.omega * down), _edge(works, swing.omega * up)


def _edge(works: Callable[[Floats], Booleans], ladder: Floats) -> float:
    """The first grid value at which it fails, or the last one if it never does."""
    fails = np.flatnonzero(~works(ladder))
    if not fails.size:
        return float(ladder[-1])
    inside, outside = ladder[[fails[0] - 1]], ladder[[fails[0]]]
    if outside[0] < inside[0]:
        return float(smallest_where(works, outside, inside)[0])
    return float(smallest_where(lambda omega: ~works(omega), inside, outside)[0])


@dataclass(frozen=True, eq=False, repr=False)
class Robustness(Displayed):
    """The residual vibration of each mode with a shaper, `residual` (L, R) in percent, over `values` (L,)."""

    values: Floats
    residual: Floats

    def _summary(self) -> Summary:
        columns = {"value": self.values}
        columns |= {f"mode {k} (%)": residual for k, residual in enumerate(self.residual.T, 1)}
        return tabulated("Residual vibration with a shaper", [], columns)

    def within(self, tolerance: float = TOLERANCE_OF_RESIDUAL) -> Booleans:
        """Return where (L,) no mode retains more than `tolerance`, as a fraction."""
        return np.asarray((self.residual <= 100 * tolerance).all(1), dtype=np.bool_)


def robustness(
    shaper: Shaper, scenes: Sequence[Scene], values: ArrayLike, drive: Drive = "cart_acceleration", count: int = 1
) -> Robustness:
    """Residual vibration of the `count` lowest modes of each of the scenes (L), which belong to `values` (L,)."""
    rows = [
        [float(residual_vibration(shaper, *swing)) for swing in swings_of(scene, drive)[:count]] for scene in scenes
    ]
    return Robustness(np.asarray(values, dtype=np.float64), 100 * np.array(rows).reshape(len(rows), count))


@checked
def over_length(scene: Scene, lengths: ArrayLike, pendulum: int = 0, link: int = 0) -> list[Scene]:
    """The scene with these lengths (m) of one link as specified, pendulum and link counted from 0."""
    checked_index("pendulum", pendulum, 0, len(scene.pendulum) - 1)
    checked_index("link", link, 0, len(scene.pendulum[pendulum].links) - 1)
    path = f"pendulum[{pendulum}].links[{link}].length"
    return [vary(scene, {path: length}) for length in np.asarray(lengths, dtype=np.float64).tolist()]


def _single(swing: DampedSwing, kind: Kind, step: float, tolerance: float) -> Shaper:
    omega, zeta = swing
    if not (omega > 0 and 0 <= zeta < 1):
        raise ComputationError(
            f"a mode of ω = {omega:g} rad/s and ζ = {zeta:g} does not oscillate: a shaper cannot suppress it"
        )
    s = complex(zeta, sqrt((1 - zeta) * (1 + zeta))) * omega
    if step > pi / s.imag:
        raise ComputationError(f"step {step:g}: is longer than half the period of a mode, {pi / s.imag:g} s")
    if kind == "um":
        return Shaper(*_unity_magnitude(s, step), step)
    if kind == "mzv":
        return _sum_of_powers((1.0, sqrt(2.0), 1.0), _turn(s, 0.75 * pi, step), step)
    half = _turn(s, pi, step)
    if kind in HUMPED:
        return _tolerant(swing, half, step, tolerance, HUMPED[kind])
    return _sum_of_powers(BINOMIAL[kind], half, step)


def _sum_of_powers(weights: Sequence[float], half: Train, step: float) -> Shaper:
    """Σ w_k of the k-fold convolution of the pair that acts as half a period, divided by the sum of all amplitudes."""
    power, trains = (np.zeros(1), np.ones(1)), []
    for weight in weights:
        trains.append((power[0], weight * power[1]))
        power = _convolve(power, half, step)
    times, amplitudes = (np.concatenate(parts) for parts in zip(*trains, strict=True))
    times, amplitudes = _merge((times, amplitudes), step)
    return Shaper(times, amplitudes / amplitudes.sum(), step)


def _two_humps(v: float) -> tuple[float, ...]:
    x = (v**2 * (1 + sqrt(1 - v**2))) ** (1 / 3)
    outer = (3 * x**2 + 2 * x + 3 * v**2) / (16 * x)
    return outer, 0.5 - outer, 0.5 - outer, outer


def _three_humps(v: float) -> tuple[float, ...]:
    outer, inner = (1 + 3 * v + sqrt(8 * v * (1 + v))) / 16, (1 - v) / 4
    return outer, inner, 1 - 2 * (outer + inner), inner, outer


BINOMIAL = {"zv": (1.0, 1.0), "zvd": (1.0, 2.0, 1.0), "zvdd": (1.0, 3.0, 3.0, 1.0), "zvddd": (1.0, 4.0, 6.0, 4.0, 1.0)}
HUMPED = {"ei": lambda v: (1 + v, 2 * (1 - v), 1 + v), "ei2": _two_humps, "ei3": _three_humps}
"""The weights of impulses half a period apart, by what an undamped mode may retain."""


def _tolerant(
    swing: DampedSwing, half: Train, step: float, tolerance: float, weights_of: Callable[[float], tuple[float, ...]]
) -> Shaper:
    """Weights of the v that makes the highest hump of V between its zeros `tolerance`."""
    v, omega = tolerance, swing.omega * np.linspace(0.3, 1.7, SAMPLES_OF_CURVE)
    for _ in range(NEWTON_ROUNDS):
        weights = weights_of(v)
        shaper = _sum_of_powers(weights, half, step)
        residuals = residual_vibration(shaper, omega, swing.zeta)
        humps = 1 + np.flatnonzero((residuals[1:-1] >= residuals[:-2]) & (residuals[1:-1] > residuals[2:]))
        if len(humps) < len(weights) - 2:
            raise ComputationError("a mode so strongly damped has no EI shaper with so many humps")
        at = humps[residuals[humps].argmax()]
        previous, peak, following = residuals[at - 1 : at + 2]
        v *= tolerance / (peak + (following - previous) ** 2 / (8 * (2 * peak - following - previous)))
    return shaper


def _turn(s: complex, angle: float, step: float) -> Train:
    """Impulses with Σ a e^{st} = e^{i angle}: one as much later, or two at the samples around."""
    delay = angle / s.imag
    if not step or abs(delay / step - round(delay / step)) < np.sqrt(EPS):
        return np.array([delay]), np.array([exp(-s.real * delay)])
    times = step * (floor(delay / step) + np.arange(2.0))
    return times, _real_weights(np.exp(s * times), np.exp(1j * angle))


def _unity_magnitude(s: complex, step: float) -> Train:
    """Impulses 1, −1, 1 with 1 − e^{st₂} + e^{st₃} = 0, the last two between samples shared by them."""
    second, third = pi / (3 * s.imag), 2 * pi / (3 * s.imag)
    for _ in range(NEWTON_ROUNDS):
        two, three = np.exp(s * second), np.exp(s * third)
        change = _real_weights(np.array([s * two, -s * three]), 1 - two + three)
        second, third = second + change[0], third + change[1]
    if not 0 < second < third:
        raise ComputationError("a mode so strongly damped has no UM shaper")
    if not step:
        return np.array([0.0, second, third]), np.array([1.0, -1.0, 1.0])
    for shift, second_shift in product((0, -1, 1), repeat=2):
        ticks = np.array([floor(second / step) + shift, floor(third / step) + second_shift])
        if not 0 < ticks[0] < ticks[1]:
            continue
        early, late = np.exp(s * step * ticks), np.exp(s * step * (ticks + 1))
        shares = _real_weights(np.array([-1.0, 1.0]) * (late - early), early[0] - early[1] - 1)
        if (shares >= 0).all() and (shares <= 1).all():
            a, b = shares
            times = step * np.array([0, ticks[0], ticks[0] + 1, ticks[1], ticks[1] + 1])
            return _merge((times, np.array([1.0, a - 1, -a, 1 - b, b])), step)
    raise ComputationError(f"step {step:g}: is too long for a UM shaper of a mode of {s.imag:g} rad/s")


def _real_weights(vectors: Complexes, target: complex) -> Floats:
    """The real weights (2,) of two complex numbers that add up to a third."""
    return np.linalg.solve(np.array([vectors.real, vectors.imag]), [np.real(target), np.imag(target)])


def _convolve(first: Train, second: Train, step: float) -> Train:
    return _merge((np.add.outer(first[0], second[0]).ravel(), np.outer(first[1], second[1]).ravel()), step)


def _merge(train: Train, step: float) -> Train:
    """In ascending order, those at one sample together, without empty ones."""
    times, amplitudes = train
    if step:
        ticks, at = np.unique(np.rint(times / step), return_inverse=True)
        times, amplitudes = ticks * step, np.bincount(at, amplitudes).astype(np.float64)
    order = np.argsort(times, kind="stable")
    order = order[amplitudes[order] != 0]
    return times[order], amplitudes[order]
