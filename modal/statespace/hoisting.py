"""A hoist in the linear model: frequencies along it, and the swing that a travel of the cart leaves.

A slow change of lengths keeps E/ω of every mode (Landau & Lifshitz, Mechanics, §49), so that with φᵀMφ = 1 the
amplitude of a mode is that of its shape times ω^(−1/2); of one pendulum that is l^(−3/4).  The swing after a travel is
integrated in the time-varying model z' = A(t) z + B(t) a(t), a the acceleration of the cart, without any such
assumption.  An input shaper is made for constant lengths; what it leaves where they change is integrated likewise.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import eigh

from modal.assembly import Matrices, hoisting_of, matrices, matrices_along, matrices_at
from modal.errors import ComputationError, SceneError
from modal.modes import labelled, natural_modes, table_numbers
from modal.report import Displayed
from modal.scene import Scene
from modal.statespace.model import fixed
from modal.statespace.shapers import Drive, Kind, Shaper, shaper_for
from modal.statespace.varying import hoisting_times
from modal.types import Floats

TOLERANCE = 1e-10
MOST_LINKS = 100
"""Links of a scene whose swing is integrated in the time-varying model."""
UNSTABLE = "the equilibrium is unstable along the hoist: no swing is left at rest"
Pulse = Callable[[float], float]


@dataclass(frozen=True, eq=False, repr=False)
class Along(Displayed):
    """Along a hoist at `times` (T,) in s: the changing `lengths` (T, H) in m, R frequencies and adiabatic amplitudes.

    `omega` (T, R) in rad/s, ascending, are those of the scene with the lengths of each time, each once for every mode
    that oscillates along the rail without dampers; `swing` (T, R) is the largest angle of a mode over that at the first
    time, if E/ω is conserved.  `names` (R,) are the numbers of the modes in the table at the first time, repeated ones
    lettered, and `links` (H,) the places of the lengths, (pendulum, link) of the scene's entries, from 0.
    """

    scene: Scene
    drive: Drive
    times: Floats
    links: tuple[tuple[int, int], ...]
    names: tuple[str, ...]
    lengths: Floats
    omega: Floats
    swing: Floats


def frequencies_along(scene: Scene, samples: int = 21, drive: Drive = "cart_force") -> Along:
    """Frequencies at evenly spaced times from the first to the last moment of a hoist.

    Under a prescribed motion of the cart they are those on a fixed support.  Raises SceneError without a hoist,
    ComputationError for an unstable equilibrium and for more than MOST_LINKS links.
    """
    times = hoisting_times(scene, samples)
    _refuse_many(scene)
    places = [
        (p, i) for p, pendulum in enumerate(scene.pendulum) for i, link in enumerate(pendulum.links) if link.hoist
    ]
    lengths = np.array([[scene.pendulum[p].links[i].length_at(time) for p, i in places] for time in times.tolist()])
    held = _is_held(scene, drive)
    found = [_modes(scene.at(time), held) for time in times.tolist()]
    omega, reach = (np.array(part) for part in zip(*((o, _angles(scene, phi, held)) for o, phi in found), strict=True))
    relative = np.abs(reach).max(1) / np.sqrt(omega)
    names = _names(scene.at(float(times[0])), omega[0], held)
    return Along(scene, drive, times, tuple(places), names, lengths, omega, relative / relative[0])


def _names(scene: Scene, omega: Floats, held: bool) -> tuple[str, ...]:
    """The numbers in the table of modes, which has dampers, of these frequencies without, of constant lengths."""
    own = fixed(scene) if held else scene
    table = natural_modes(own.conservative)
    nearest = np.abs(np.subtract.outer(omega, table.omega)).argmin(1)
    return labelled(table_numbers(own, table)[nearest].tolist())


def _is_held(scene: Scene, drive: Drive) -> bool:
    """Whether the cart moves as prescribed."""
    return scene.support.kind == "cart" and drive != "cart_force"


def _refuse_many(scene: Scene) -> None:
    if scene.n_links > MOST_LINKS:
        raise ComputationError(f"the scene has {scene.n_links} links: a hoist is studied for at most {MOST_LINKS}")


def _modes(scene: Scene, held: bool) -> tuple[Floats, Floats]:
    """ω (R,) and Φ (n, R), φᵀMφ = 1, of the oscillating modes along the rail for constant lengths, ascending."""
    found = matrices(scene.conservative)
    first = int(held)
    square, phi = eigh(found.K[first:, first:], found.M[first:, first:])
    free = int(not held and scene.support.kind == "cart" and scene.support.stiffness == 0)
    if np.any(square[free:] <= 0):
        raise ComputationError(UNSTABLE)
    return np.sqrt(square[free:]), phi[:, free:]


def _angles(scene: Scene, phi: Floats, held: bool) -> Floats:
    """The rows of the links."""
    return phi[int(scene.support.kind == "cart" and not held) :]


@dataclass(frozen=True, eq=False)
class Travel:
    """A travel of the cart by `distance` (m) from `begin` (s) on over `duration` (s): x = d (10 s³ − 15 s⁴ + 6 s⁵)."""

    distance: float
    begin: float
    duration: float

    def acceleration(self, time: float) -> float:
        """In m/s²; 0 before and after."""
        s = (time - self.begin) / self.duration
        return self.distance / self.duration**2 * 60 * s * (1 - s) * (1 - 2 * s) if 0 < s < 1 else 0.0


@dataclass(frozen=True)
class Residual:
    """The largest angle (rad) that a link reaches when travel and hoist are over, for a command in `words`."""

    words: str
    angle: float


def travel_residuals(scene: Scene, travel: Travel, *, kind: Kind = "zv", count: int = 1) -> tuple[Residual, ...]:
    """What a travel of the cart leaves: as it is, and shaped for the lengths before the hoist, and for the mean ones.

    The last is that of the travel as it is if the lengths stayed as they are before the hoist.  Raises SceneError for a
    scene without hoist or cart, else as `shaper_for`.
    """
    _refuse_many(scene)
    if scene.support.kind != "cart":
        raise SceneError(["travel: the support is fixed: a travel needs a cart"])
    still, mean = scene.at(hoisting_times(scene)[0]), mean_lengths(scene)
    name = f"{kind} shaper"
    commands: list[tuple[str, Shaper | None]] = [("the travel as it is", None)]
    commands += [(f"shaped by a {name} for the lengths before the hoist", shaper_for(still, count, kind))]
    commands += [(f"shaped by a {name} for the mean lengths", shaper_for(mean, count, kind))]
    found = [
        Residual(words, _left(scene, _shaped(travel, shaper), _stops(travel, shaper))) for words, shaper in commands
    ]
    constant = _left(still, travel.acceleration, _stops(travel, None))
    return (*found, Residual("the travel as it is, without the hoist", constant))


def mean_lengths(scene: Scene) -> Scene:
    """The scene with constant lengths, those in time average over the hoist of each link."""
    pendula = tuple(
        one.replace(
            links=tuple(
                link.replace(length=float(np.mean(link.hoist.law(link.length)(_through(link))[0])), hoist=None)
                if link.hoist
                else link
                for link in one.links
            )
        )
        for one in scene.pendulum
    )
    return scene.replace(pendulum=pendula)


def _through(link: object) -> Floats:
    """Midpoints of many equal parts of the time of a link's hoist (s)."""
    knots = link.hoist.law(link.length).knots  # type: ignore[attr-defined]
    edges = np.linspace(knots[0], knots[-1], 4097)
    return np.asarray((edges[1:] + edges[:-1]) / 2)


def _shaped(travel: Travel, shaper: Shaper | None) -> Pulse:
    if shaper is None:
        return travel.acceleration
    parts = list(zip(shaper.times.tolist(), shaper.amplitudes.tolist(), strict=True))
    return lambda time: sum(a * travel.acceleration(time - at) for at, a in parts)


def _stops(travel: Travel, shaper: Shaper | None) -> list[float]:
    """The times at which the third derivative of a shaped travel jumps."""
    delays = [0.0] if shaper is None else shaper.times.tolist()
    return [travel.begin + own + at for at in delays for own in (0.0, travel.duration)]


def _left(scene: Scene, command: Pulse, stops: Sequence[float]) -> float:
    """The largest angle (rad) that remains of a state of rest under an acceleration of the cart."""
    n = scene.n_links
    end, y = _integrated(scene, np.zeros(2 * n), command, [min(stops), *stops], held=True)
    return _amplitude(scene.at(end), y, held=True)


def shaper_residual(scene: Scene, shaper: Shaper, drive: Drive = "cart_acceleration") -> float:
    """What a shaped impulse at the begin of the hoist leaves, over what the same impulse unshaped leaves.

    At the end of the hoist, or of the impulses if that is later, in the largest angle of any link.
    """
    _refuse_many(scene)
    hoisting = hoisting_of(scene)
    if hoisting is None:
        raise SceneError(["hoist: no link of this scene has one"])
    begin, held = hoisting.breaks[0], _is_held(scene, drive)
    last = max(hoisting.breaks[-1], begin + shaper.duration)
    found = [
        _amplitude(scene.at(last), _impelled(scene, begin + times, amplitudes, last, held), held=held)
        for times, amplitudes in ((shaper.times, shaper.amplitudes), (np.zeros(1), np.ones(1)))
    ]
    return found[0] / found[1]


def _impelled(scene: Scene, times: Floats, amplitudes: Floats, last: float, held: bool) -> Floats:
    """(q, q') at a time after impulses from rest."""
    y, now = np.zeros(2 * (scene.n_links + int(not held))), float(times[0])
    for time, amplitude in zip(times.tolist(), amplitudes.tolist(), strict=True):
        if time > now:
            now, y = _integrated(scene, y, None, [now, time], held=held)
        y[len(y) // 2 :] += amplitude * _push(scene, time, held)
    return _integrated(scene, y, None, [now, last], held=held)[1] if last > now else y


def _push(scene: Scene, time: float, held: bool) -> Floats:
    """The change of q' by a unit impulse: of the cart's speed where its motion is prescribed, else of a force on it."""
    M = matrices_at(scene, time).M
    inertia, force = (M[1:, 1:], -M[1:, 0]) if held else (M, np.eye(len(M))[0])
    return np.asarray(np.linalg.solve(inertia, force), dtype=np.float64)


def _integrated(
    scene: Scene, y: Floats, command: Pulse | None, stops: Sequence[float], *, held: bool
) -> tuple[float, Floats]:
    """The time of the last stop, or of the hoist's end if it drives and that is later, and (q, q') there."""
    hoisting = hoisting_of(scene)
    knots = list(hoisting.breaks) if hoisting else []
    last = max(*stops, *knots) if command else stops[-1]
    cuts = sorted({stops[0], last, *(time for time in (*stops, *knots) if stops[0] < time < last)})
    first = int(held)
    along = matrices_along(scene)
    constant = None if knots else _law(along(0.0), first)

    def rate(time: float, state: Floats) -> Floats:
        A, B = constant or _law(along(time), first)
        half = len(state) // 2
        forced = B * command(time) if command else 0.0
        return np.concatenate((state[half:], A @ state + forced))

    for begin, end in pairwise(cuts):
        inside = (begin, end - 1e-12 * (end - begin))
        found = solve_ivp(rate, inside, y, method="DOP853", rtol=TOLERANCE, atol=TOLERANCE * 1e-3)
        y = np.asarray(found.y[:, -1], dtype=np.float64)
    return last, y


def _law(found: Matrices, first: int) -> tuple[Floats, Floats]:
    """Q'' = A (q, q') + B a of the coordinates from `first` on, a the acceleration of the cart."""
    M, K, D = (part[first:, first:] for part in (found.M, found.K, found.D))
    solved: Floats = np.asarray(np.linalg.solve(M, np.hstack((-K, -D, -found.M[first:, :1]))), dtype=np.float64)
    return solved[:, :-1], solved[:, -1]


def _amplitude(scene: Scene, y: Floats, *, held: bool) -> float:
    """The largest angle (rad) that free swings of all modes can add up to in any link."""
    omega, phi = _modes(scene, held)
    first = int(held)
    dual = phi.T @ matrices(scene).M[first:, first:]
    half = len(y) // 2
    size = np.hypot(dual @ y[:half], dual @ y[half:] / omega)
    return float((np.abs(_angles(scene, phi, held)) @ size).max())


def residual_words(scene: Scene, count: int, kind: Kind, drive: Drive, shaper: Shaper) -> Iterator[str]:
    """What a hoist leaves of the promise of a shaper for the lengths before it, and of one for the mean lengths."""
    yield "the lengths change with the hoist: this shaper is that of the lengths before it"
    mean = shaper_for(mean_lengths(scene), count, kind, drive)
    left, other = (100 * shaper_residual(scene, one, drive) for one in (shaper, mean))
    yield f"along the hoist it leaves {left:.3g} % of the swing of one impulse; one for the mean lengths {other:.3g} %"
