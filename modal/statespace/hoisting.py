"""A hoist in the linear model: frequencies along it, and the swing that a travel of the cart leaves.

A slow change of lengths keeps E/ω of every mode (Landau & Lifshitz, Mechanics, §49), so that with φᵀMφ = 1 the
amplitude of a mode is that of its shape times ω^(−1/2); of one pendulum that is l^(−3/4).  Frequencies that approach
each other veer apart, and keep their order, unless nothing couples their modes: those of pendula on a fixed support,
and of equal pendula against each other while the cart stays still, are followed apart from all others.

The swing after a travel is integrated in the time-varying model, without any such assumption, with the motion of the
cart among its states: drag acts against still air, so that the speed of the cart pushes as its acceleration does.  An
input shaper is made for constant lengths; what it leaves where they change is integrated likewise.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from modal.assembly import hoisting_of, matrices, matrices_along, no_hoist, rig_of
from modal.errors import ComputationError, SceneError
from modal.modes import labelled, natural_modes, table_numbers
from modal.report import Displayed
from modal.scene import Body, Fixed, Pendulum, Scene
from modal.scene.points import PendulumPoint, parse_point
from modal.statespace.model import fixed, refuse_no_inertia
from modal.statespace.shapers import UNSHAPED, Drive, Kind, Shaper, Train, drives_of, shaper_for
from modal.statespace.varying import hoisting_times, motion_history, pushed_by
from modal.types import Floats, Ints

LOOKS = 200
"""Times at which the size of a command is looked up."""
MOST_LINKS = 100
"""Links of a scene whose swing is integrated in the time-varying model."""
UNSTABLE = "the equilibrium is unstable along the hoist: no swing is left at rest"


@dataclass(frozen=True, eq=False, repr=False)
class Along(Displayed):
    """Along a hoist at `times` (T,) in s: the changing `lengths` (T, H) in m, R frequencies and adiabatic amplitudes.

    `omega` (T, R) in rad/s are those of the scene with the lengths of each time, one for every mode that oscillates
    along the rail without dampers, ascending at the first time; `swing` (T, R) is the largest angle of a mode over that
    at the first time, if E/ω is conserved.  `names` (R,) are the numbers of the modes in the table at the first time,
    repeated ones lettered, and `links` (H,) the places of the lengths, (pendulum, link) of the scene's entries, from 0.
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
    """Frequencies at evenly spaced times from the begin of the first hoist to the end of the last.

    Under a prescribed motion of the cart they are those on a fixed support.  A massless cart has one mode less; where
    it has a single bob there is none.  Raises SceneError without a hoist, ComputationError for an unstable equilibrium
    and for more than MOST_LINKS links.
    """
    times = hoisting_times(scene, samples)
    _refuse_many(scene)
    places = [
        (p, i) for p, pendulum in enumerate(scene.pendulum) for i, link in enumerate(pendulum.links) if link.hoist
    ]
    lengths = np.array([[scene.pendulum[p].links[i].length_at(time) for p, i in places] for time in times.tolist()])
    held = is_held(scene, drive)
    each = [
        [np.repeat(part, copies, axis=1) for part in _followed(alone, times)]
        for alone, copies in _uncoupled(scene, held)
    ]
    omega, reach = (np.hstack(parts) for parts in zip(*each, strict=True))
    order = np.argsort(omega[0], kind="stable")
    relative = reach[:, order] / np.sqrt(omega[:, order])
    names = _names(scene.at(float(times[0])), omega[0, order], held)
    return Along(scene, drive, times, tuple(places), names, lengths, omega[:, order], relative / relative[0])


def _uncoupled(scene: Scene, held: bool) -> list[tuple[Scene, int]]:
    """Scenes whose modes together are those of this one, whatever the lengths, and how often each mode occurs."""
    still = scene.conservative.in_plane
    if still.is_structured:
        return _uncoupled_on_structure(still)
    equal: Counter[Pendulum] = Counter()
    for pendulum in still.pendulum:
        equal[pendulum.replace(count=1, start=None)] += pendulum.count
    alone = [(still.replace(support=Fixed(), pendulum=(pendulum,)), copies) for pendulum, copies in equal.items()]
    if held or still.cart is None:
        return alone
    together = tuple(_heavier(pendulum, copies) for pendulum, copies in equal.items())
    return [
        (still.replace(pendulum=together), 1),
        *((pendulum, copies - 1) for pendulum, copies in alone if copies > 1),
    ]


def _uncoupled_on_structure(still: Scene) -> list[tuple[Scene, int]]:
    """The same where copies of a pendulum move a structure together; copies that springs join stay as they are."""
    joined = {
        point.pendulum
        for pendulum in still.spring
        for end in pendulum.between
        if isinstance(point := parse_point(end), PendulumPoint)
    }
    together, alone = [], []
    for index, pendulum in enumerate(still.pendulum):
        if pendulum.count == 1 or index in joined:
            together.append(pendulum)
            continue
        together.append(_heavier(pendulum.replace(count=1, start=None), pendulum.count))
        single = pendulum.replace(count=1, start=None, on=None, position=(0.0, 0.0))
        alone.append((still.replace(support=Fixed(), spring=(), ground=None, pendulum=(single,)), pendulum.count - 1))
    return [(still.replace(pendulum=tuple(together)), 1), *alone]


def _heavier(pendulum: Pendulum, copies: int) -> Pendulum:
    """One pendulum that moves a cart as so many equal ones in phase."""
    links = []
    for link in pendulum.links:
        inertia = {"inertia": copies * link.inertia} if isinstance(link, Body) else {}
        links.append(link.replace(mass=copies * link.mass, stiffness=copies * link.stiffness, **inertia))
    return pendulum.replace(links=tuple(links))


def _followed(scene: Scene, times: Floats) -> tuple[Floats, Floats]:
    """ω (T, R) of a scene in which no two modes cross, and the largest angle (T, R) of every shape, φᵀMφ = 1."""
    each = [_modes(scene.at(time)) for time in times.tolist()]
    links = rig_of(scene).leading
    return np.array([omega for omega, _, _ in each]), np.array([np.abs(phi[links:]).max(0) for _, phi, _ in each])


def _names(scene: Scene, omega: Floats, held: bool) -> tuple[str, ...]:
    """The numbers in the table of modes, which has dampers, of these frequencies without, of constant lengths."""
    on_support = fixed(scene) if held else scene
    table = natural_modes(on_support.conservative)
    nearest = np.abs(np.subtract.outer(omega, table.omega)).argmin(1)
    return labelled(table_numbers(on_support, table)[nearest].tolist())


def is_held(scene: Scene, drive: Drive) -> bool:
    """Whether the cart moves as prescribed."""
    return scene.cart is not None and drive != "cart_force"


def _refuse_many(scene: Scene) -> None:
    if scene.n_links > MOST_LINKS:
        raise ComputationError(f"the scene has {scene.n_links} links: a hoist is studied for at most {MOST_LINKS}")


def _modes(scene: Scene) -> tuple[Floats, Floats, Ints]:
    """ω (C,) and Φ (n, C), φᵀMφ = 1, of the modes of constant lengths that oscillate along the rail, without dampers.

    Ascending; the third are the rows (C,) of the table, equal for equal frequencies.
    """
    modes = natural_modes(scene.conservative)
    if np.any(modes.eigenvalue.real > 0):
        raise ComputationError(UNSTABLE)
    along = modes.matrix.take(~modes.matrix.across).real
    swinging = along.take(modes.omega[along.row] > 0)
    return modes.omega[swinging.row], np.asarray(swinging.shapes), swinging.row


@dataclass(frozen=True, eq=False)
class Travel:
    """A travel of the cart by `distance` (m) from `begin` (s) on over `duration` (s): x = d (10 s³ − 15 s⁴ + 6 s⁵)."""

    distance: float
    begin: float
    duration: float

    @classmethod
    def along(cls, scene: Scene, distance: float, duration: float | None = None) -> Travel:
        """From the begin of the first hoist of a scene on, by default until the end of the last.

        >>> from modal import load
        >>> Travel.along(load("hoisting-crane"), 10.0).duration
        8.0
        """
        begin, end = hoisting_times(scene, 2).tolist()
        return cls(distance, begin, duration or end - begin)

    def motion(self, times: Floats) -> Floats:
        """X (m), x' (m/s) and x'' (m/s²) at these times (T,), (3, T)."""
        s, T = np.clip((times - self.begin) / self.duration, 0.0, 1.0), self.duration
        x = s**3 * (10 - 15 * s + 6 * s**2)
        return self.distance * np.array([x, 30 * (s * (1 - s)) ** 2 / T, 60 * s * (1 - s) * (1 - 2 * s) / T**2])

    def shaped(self, train: Train, times: Floats) -> Floats:
        """The sum of such motions (3, T), delayed by the times of a train of impulses, in their amplitudes."""
        return np.asarray(
            sum(a * self.motion(times - at) for at, a in zip(*map(np.ndarray.tolist, train), strict=True))
        )

    def stops(self, train: Train) -> list[float]:
        """The times at which the third derivative of `shaped` jumps."""
        return [self.begin + after + at for at in train[0].tolist() for after in (0.0, self.duration)]


@dataclass(frozen=True)
class Residual:
    """The largest angle (rad) that a link reaches when travel and hoist are over, for a command in `words`.

    From then on without dampers: that to which the swings of all frequencies add up.
    """

    words: str
    angle: float


def travel_residuals(scene: Scene, travel: Travel, *, kind: Kind = "zv", count: int = 1) -> tuple[Residual, ...]:
    """What a travel of the cart leaves: as it is, and shaped for the lengths before the hoist, and for the mean ones.

    The last is that of the travel as it is if the lengths stayed as they are before the hoist.  Raises SceneError for a
    scene without hoist or cart, else as `shaper_for`.
    """
    _refuse_many(scene)
    if scene.cart is None:
        raise SceneError(["travel: the support is fixed: a travel needs a cart"])
    still, mean = scene.at(float(hoisting_times(scene)[0])), mean_lengths(scene)
    name = f"{kind} shaper"
    commands = {
        "the travel as it is": UNSHAPED,
        f"shaped by a {name} for the lengths before the hoist": shaper_for(still, count, kind).train,
        f"shaped by a {name} for the mean lengths": shaper_for(mean, count, kind).train,
    }
    residuals = [Residual(words, _left(scene, travel, train)) for words, train in commands.items()]
    return (*residuals, Residual("the travel as it is, without the hoist", _left(still, travel, UNSHAPED)))


def travel_swing(scene: Scene, travel: Travel, kind: Kind | None = None) -> float:
    """The largest angle (rad) that a travel of the cart leaves, shaped for the lengths before it if a `kind` is given.

    Lengths may change with a hoist or stay.

    >>> from modal import Bob, Cart, Pendulum, Scene
    >>> crane = Scene(gravity=9.81, support=Cart(mass=5.0), pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0)])])
    >>> round(travel_swing(crane, Travel(1.0, 0.0, 2.0)), 6), travel_swing(crane, Travel(1.0, 0.0, 2.0), "zv") < 1e-9
    (0.464359, True)
    """
    _refuse_many(scene)
    if scene.cart is None:
        raise SceneError(["travel: the support is fixed: a travel needs a cart"])
    return _left(scene, travel, UNSHAPED if kind is None else shaper_for(scene.at(travel.begin), 1, kind).train)


def mean_lengths(scene: Scene) -> Scene:
    """The scene with constant lengths, those in time average over the hoist of each link."""
    pendula = tuple(
        pendulum.replace(
            links=tuple(
                link.replace(length=float(np.mean(link.hoist.law(link.length)(_through(link))[0])), hoist=None)
                if link.hoist
                else link
                for link in pendulum.links
            )
        )
        for pendulum in scene.pendulum
    )
    return scene.replace(pendulum=pendula)


def _through(link: object) -> Floats:
    """Midpoints of many equal parts of the time of a link's hoist (s)."""
    knots = link.hoist.law(link.length).knots  # type: ignore[attr-defined]
    edges = np.linspace(knots[0], knots[-1], 4097)
    return np.asarray((edges[1:] + edges[:-1]) / 2)


def _left(scene: Scene, travel: Travel, train: Train) -> float:
    """The largest angle (rad) that a shaped travel of the cart leaves of a state of rest."""
    stops, hoisting = travel.stops(train), hoisting_of(scene)
    pushes = travel.shaped(train, np.linspace(min(stops), max(stops), LOOKS))[2]
    times = np.unique([*stops, *(time for time in (hoisting.breaks if hoisting else ()) if time > min(stops))])
    size = float(np.abs(pushes).max()) / scene.gravity
    states = motion_history(scene, lambda at: travel.shaped(train, at)[2], times, stops, pushed=None, size=size)
    return largest_swing(scene.at(float(times[-1])), states[-1], held=True)


def shaper_residual(scene: Scene, shaper: Shaper, drive: Drive = "cart_acceleration") -> float:
    """What a shaped impulse at the beginning of the hoist leaves, over what the same impulse unshaped leaves.

    At the end of the hoist, or of the impulses if that is later, in the largest angle of any link.  Raises SceneError
    for a scene without hoist, ComputationError for a force on a cart with which the mass matrix is singular.
    """
    _refuse_many(scene)
    hoisting = hoisting_of(scene)
    if hoisting is None:
        raise no_hoist(scene)
    begin, held = hoisting.breaks[0], is_held(scene, drive)
    if not held:
        refuse_no_inertia(matrices_along(scene)(begin).M)
    last = max(hoisting.breaks[-1], begin + shaper.duration)
    pushed = None if held else drives_of(scene).index(drive)
    left = [
        largest_swing(scene.at(last), _impelled(scene, begin + times, amplitudes, last, pushed), held=held)
        for times, amplitudes in (shaper.train, UNSHAPED)
    ]
    return left[0] / left[1]


def _impelled(scene: Scene, times: Floats, amplitudes: Floats, last: float, pushed: int | None) -> Floats:
    """(q, q') after impulses from rest: of a force on a coordinate, or (None) of the speed of a cart that is held."""
    hoisting, along = hoisting_of(scene), matrices_along(scene)
    start = pushed_by(along(float(times[0])), pushed)[1]
    n, size, y = len(start), float(np.abs(start).max()), np.zeros(2 * len(start))
    for time, after, amplitude in zip(times.tolist(), [*times[1:].tolist(), last], amplitudes.tolist(), strict=True):
        y[n:] += amplitude * pushed_by(along(time), pushed)[1]
        knots = [knot for knot in (hoisting.breaks if hoisting else ()) if time < knot < after]
        y = motion_history(
            scene, np.zeros_like, np.unique([time, *knots, after]), (), pushed=pushed, size=size, start=y
        )[-1]
    return y


def largest_swing(scene: Scene, y: Floats, *, held: bool) -> float:
    """The largest angle (rad) that the swings of all frequencies can add up to in any link, about the rest of (q, q').

    Under drag that is the rest beside a cart that moves on.
    """
    linear = matrices(scene)
    first, n = int(held), len(linear.M)
    q, rate = y[first:n].copy(), y[n + first :]
    if held:
        q += np.linalg.solve(linear.K[1:, 1:], linear.D[1:, 0] * y[n])
    omega, phi, row = _modes(fixed(scene) if held else scene)
    if not len(omega):
        return 0.0
    dual = phi.T @ linear.M[first:, first:]
    each = phi[0 if held else rig_of(scene).leading :] * (dual @ q + 1j * (dual @ rate) / omega)
    return float(np.abs(np.add.reduceat(each, np.flatnonzero(np.diff(row, prepend=-1)), axis=1)).sum(1).max())


def residual_words(scene: Scene, count: int, kind: Kind, drive: Drive, shaper: Shaper) -> Iterator[str]:
    """What a hoist leaves of the promise of a shaper for the lengths before it, and of one for the mean lengths."""
    yield "the lengths change with the hoist: this shaper is that of the lengths before it"
    mean = shaper_for(mean_lengths(scene), count, kind, drive)
    left, other = (100 * shaper_residual(scene, tried, drive) for tried in (shaper, mean))
    yield f"along the hoist it leaves {left:.3g} % of the swing of one impulse; one for the mean lengths {other:.3g} %"
