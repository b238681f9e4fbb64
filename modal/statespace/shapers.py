"""Input shapers: a command split into a few delayed parts that leave no residual vibration in chosen modes.

With T_d = 2π/(ω√(1−ζ²)) and K = exp(−ζπ/√(1−ζ²))

    ZV     amplitudes (1, K)/(1+K)         at 0, T_d/2
    ZVD    amplitudes (1, 2K, K²)/(1+K)²   at 0, T_d/2, T_d      (also insensitive to ω, to first order)

and for several modes the convolution of one shaper for each.  After the last of the impulses A_i at t_i, the residual
vibration of a mode, relative to a single impulse of the same sum at the start, is

    V(ω, ζ) = e^{−ζωt_n} |Σ A_i e^{(ζω + iω√(1−ζ²)) t_i}|.

(Singer & Seering, J. Dyn. Syst. Meas. Control 112, 76 (1990); robustness as the range of V ≤ 5 %: Singhose, Seering &
Singer, J. Mech. Des. 116, 654 (1994).)

The relevant frequencies depend on the drive: if the trolley follows an acceleration or a velocity whatever hangs from
it, the load swings as on a fixed support.  A trolley driven by a force moves with its load, at the free frequencies.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import reduce
from math import exp, pi, sqrt
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike

from modal.eigen import smallest_where
from modal.errors import ComputationError, SceneError, meant
from modal.modes import MOST_COMPARED, Modes, counterparts, natural_modes
from modal.scene import Scene
from modal.statespace.modal_form import fixed
from modal.types import Booleans, Floats

TOLERANCE = 0.05
"""Residual vibration up to which a shaper counts as working."""
REACH, RUNGS = 4, 1000
"""Largest ω of a range over its centre, and the relative step of the search for its edges."""
BEATS = {"zv": (1, 1), "zvd": (1, 2, 1)}
Kind = Literal["zv", "zvd"]
Drive = Literal["cart_force", "cart_acceleration", "cart_velocity"]
ASSUMED = {
    "cart_acceleration": "trolley motion prescribed: the load swings as on a fixed support",
    "cart_velocity": "trolley motion prescribed: the load swings as on a fixed support",
    "cart_force": "trolley pushed by a force: it swings with its load, as in the table",
}


class Swing(NamedTuple):
    """Natural frequency ω (rad/s) and damping ratio ζ of a mode to be left at rest."""

    omega: float
    zeta: float = 0.0


@dataclass(frozen=True, eq=False)
class Shaper:
    """Impulses at `times` (n,) in s, ascending from 0, of `amplitudes` (n,) that add to 1."""

    times: Floats
    amplitudes: Floats

    @property
    def duration(self) -> float:
        """The delay (s) of the end of a shaped command."""
        return float(self.times[-1])

    def shaped(self, times: ArrayLike, command: ArrayLike) -> Floats:
        """Σ A_i u(t − t_i) (T,) of a command u (T,) at ascending times (T,), 0 before the first and linear between."""
        t, u = np.asarray(times, dtype=np.float64), np.asarray(command, dtype=np.float64)
        parts = (a * np.interp(t - at, t, u, left=0.0) for at, a in zip(self.times, self.amplitudes, strict=True))
        return np.asarray(sum(parts), dtype=np.float64)

    def __mul__(self, other: Shaper) -> Shaper:
        """The convolution of two shapers, which suppresses the modes of both."""
        times = np.add.outer(self.times, other.times).ravel()
        order = np.argsort(times, kind="stable")
        return Shaper(times[order], np.outer(self.amplitudes, other.amplitudes).ravel()[order])


def shaper(swings: Sequence[Swing], kind: Kind = "zv") -> Shaper:
    """The ZV or ZVD shaper of one mode, for several the convolution of one each.

    Raises ValueError for another kind and for no modes, ComputationError for a mode that does not oscillate.
    """
    if kind not in BEATS or not swings:
        raise ValueError(f'kind = {kind!r} for {len(swings)} modes: must be "zv" or "zvd", for at least one mode')
    return reduce(Shaper.__mul__, (_single(swing, BEATS[kind]) for swing in swings))


def shaper_for(
    scene: Scene, count: int = 1, kind: Kind = "zv", drive: Drive = "cart_acceleration", first: int = 0
) -> Shaper:
    """The shaper for `count` of the modes found by `swings_of`, from index `first` on."""
    found = swings_of(scene, drive)
    if not 0 <= first < first + count <= len(found):
        raise ComputationError(f"{count} modes from index {first}: this drive excites {len(found)} modes")
    return shaper(found[first : first + count], kind)


def swings_of(scene: Scene, drive: Drive = "cart_acceleration") -> list[Swing]:
    """The modes that a drive excites, in ascending order: fixed-base modes under a prescribed motion.

    Under "cart_force" they are the free modes that move the cart.  Raises SceneError for another drive and for a fixed
    support, ComputationError for an unstable equilibrium.
    """
    modes, rows = _swinging(scene, drive)
    return [Swing(mode.omega, mode.damping_ratio) for mode in modes.rows(rows)]


def _swinging(scene: Scene, drive: Drive) -> tuple[Modes, list[int]]:
    """The modes of the scene with this drive, and the indices of those that it excites."""
    drives = get_args(Drive)
    problems = (
        [] if drive in drives else [f"drive = {drive!r}: must be one of {', '.join(drives)}{meant(drive, drives)}"]
    )
    if scene.support.kind != "cart":
        problems.append("the support is fixed: a shaper needs a cart")
    if problems:
        raise SceneError(problems)
    pushed = drive == "cart_force"
    modes = natural_modes(scene if pushed else fixed(scene))
    every = list(modes)
    if growing := next((mode for mode in every if mode.growth_rate), None):
        raise ComputationError(
            f"the equilibrium is unstable, with a growth rate of {growing.growth_rate:.4g} "
            "1/s: no shaper can suppress that"
        )
    return modes, [mode.number - 1 for mode in every if mode.oscillates and (not pushed or mode.cart_participation)]


def swing_words(scene: Scene, count: int = 1, drive: Drive = "cart_acceleration") -> Iterator[str]:
    """The assumptions of a shaper for the `count` slowest modes, then a line for each, with the table's mode."""
    modes, rows = _swinging(scene, drive)
    pushed, told = drive == "cart_force", scene.n_links <= MOST_COMPARED
    beside = [""] * len(modes) if pushed or not told else _beside(modes, natural_modes(scene))
    yield ASSUMED[drive]
    for number, (row, mode) in enumerate(zip(rows[:count], modes.rows(rows[:count]), strict=True), start=1):
        name = f"mode {mode.number}" if pushed else f"fixed-base mode {number}"
        yield f"{name}: {mode.omega:.9g} rad/s, damping ratio {mode.damping_ratio:.4g}{beside[row]}"


def _beside(modes: Modes, table: Modes) -> list[str]:
    """For every fixed-base mode the most similar mode of the table, with a free cart."""
    moving = {mode.number - 1: mode for mode in table if mode.oscillates and mode.cart_participation}
    if not moving:
        return [""] * len(modes)
    found = (moving[row] for row in counterparts(modes, table, list(moving)).tolist())
    return [f"; the table, with the trolley free: mode {mode.number}, {mode.omega:.9g} rad/s" for mode in found]


def residual_vibration(shaper: Shaper, omega: ArrayLike, zeta: ArrayLike = 0.0) -> Floats:
    """V(ω, ζ): amplitude left after the last impulse over that after a single one at the start; 0 ≤ ζ < 1."""
    w, z = np.broadcast_arrays(np.asarray(omega, dtype=np.float64), np.asarray(zeta, dtype=np.float64))
    exponent = (z + 1j * np.sqrt((1 - z) * (1 + z))) * w
    left = np.exp(exponent[..., None] * shaper.times) @ shaper.amplitudes
    return np.asarray(np.abs(left) * np.exp(-z * w * shaper.duration), dtype=np.float64)


def insensitivity(shaper: Shaper, swing: Swing, tolerance: float = TOLERANCE) -> tuple[float, float]:
    """The range of ω (rad/s) about that of `swing` in which the residual vibration stays below `tolerance`.

    Raises ComputationError if it exceeds it at `swing` itself.
    """

    def works(omega: Floats) -> Booleans:
        return np.asarray(residual_vibration(shaper, omega, swing.zeta) <= tolerance, dtype=np.bool_)

    if not works(np.array([swing.omega]))[0]:
        raise ComputationError(f"at ω = {swing.omega:g} rad/s the residual vibration exceeds {tolerance:.2g}")
    steps = np.arange(1, REACH * RUNGS + 1) / RUNGS
    return _edge(works, swing.omega * steps[RUNGS - 1 :: -1]), _edge(works, swing.omega * steps[RUNGS - 1 :])


def _edge(works: Callable[[Floats], Booleans], ladder: Floats) -> float:
    """The first grid value at which it fails, or the last one if it never does."""
    fails = np.flatnonzero(~works(ladder))
    if not fails.size:
        return float(ladder[-1])
    inside, outside = ladder[[fails[0] - 1]], ladder[[fails[0]]]
    if outside[0] < inside[0]:
        return float(smallest_where(works, outside, inside)[0])
    return float(smallest_where(lambda omega: ~works(omega), inside, outside)[0])


@dataclass(frozen=True, eq=False)
class Robustness:
    """The residual vibration of each mode with a shaper, `residual` (L, R) in percent, over `values` (L,)."""

    values: Floats
    residual: Floats

    def within(self, tolerance: float = TOLERANCE) -> Booleans:
        """Where (L,) no mode retains more than `tolerance`, as a fraction."""
        return np.asarray((self.residual <= 100 * tolerance).all(1), dtype=np.bool_)


def robustness(
    shaper: Shaper, scenes: Sequence[Scene], values: ArrayLike, drive: Drive = "cart_acceleration", count: int = 1
) -> Robustness:
    """Residual vibration of the `count` lowest modes of each of the scenes (L), which belong to `values` (L,)."""
    rows = [
        [float(residual_vibration(shaper, *swing)) for swing in swings_of(scene, drive)[:count]] for scene in scenes
    ]
    return Robustness(np.asarray(values, dtype=np.float64), 100 * np.array(rows).reshape(len(rows), count))


def over_length(scene: Scene, lengths: ArrayLike, pendulum: int = 0, link: int = 0) -> list[Scene]:
    """The scene with these lengths (m) of one link as specified, pendulum and link counted from 0."""
    entry = scene.pendulum[pendulum]
    found = []
    for length in np.asarray(lengths, dtype=np.float64).tolist():
        changed = entry.links[link].replace(length=length)
        links = (*entry.links[:link], changed, *entry.links[link + 1 :])
        pendula = list(scene.pendulum)
        pendula[pendulum] = entry.replace(links=links)
        found.append(scene.replace(pendulum=tuple(pendula)))
    return found


def _single(swing: Swing, beats: tuple[int, ...]) -> Shaper:
    """Impulses half a period apart of amplitudes like those of (1 + K)ⁿ."""
    omega, zeta = swing
    if not (omega > 0 and 0 <= zeta < 1):
        raise ComputationError(
            f"a mode of ω = {omega:g} rad/s and ζ = {zeta:g} does not oscillate: a shaper cannot suppress it"
        )
    root = sqrt((1 - zeta) * (1 + zeta))
    beat = np.arange(len(beats), dtype=np.float64)
    amplitudes: Floats = np.array(beats) * exp(-zeta * pi / root) ** beat
    return Shaper(beat * (pi / (omega * root)), amplitudes / amplitudes.sum())
