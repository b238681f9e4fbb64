"""Hoisting in the linear model: frequencies along it, and the residual swing after a travel of the cart.

A slow change of lengths keeps E/ω of every mode ([Landau1976, §49]), so that with φᵀMφ = 1 the
amplitude of a mode is that of its shape times ω^(−1/2); for one pendulum l^(−3/4). Frequencies that approach each other
veer and keep their order, unless their modes are uncoupled: those of pendula on a fixed support, and of equal pendula
in antiphase, are followed separately.

The swing after a travel is integrated in the time-varying model, without any such assumption, with the motion of the
cart among its states: between two corners of a command and of the laws of lengths by a matrix exponential where lengths
are constant, with u and its derivatives as further states, along a hoist by steps.  Drag acts against still air, so
that the speed of the cart pushes as its acceleration does. An input shaper is designed for constant lengths; its
residual for changing lengths is integrated in the same way.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import ceil, degrees, inf
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np
import scipy

from modal.assembly import Matrices, hoisting_of, matrices, matrices_along, no_hoist, rig_of
from modal.errors import ComputationError, SceneError
from modal.modes import MOST_LISTED, natural_modes, number_labels, table_numbers
from modal.report import Form, ReportColumn, ReportTable, Result, short
from modal.scene import Fixed, Pendulum, Scene
from modal.scene.length_laws import LengthLaw, integrated_law, limited_law, profile_law, superposed
from modal.scene.records import read_record
from modal.scene.signal_names import SUBSCRIPTS, angle_symbol, column_label
from modal.statespace.geometry import refuse_no_inertia
from modal.statespace.model import without_carrier
from modal.statespace.reduction import heavier, joined_pendula
from modal.statespace.sampling import hoisting_times
from modal.statespace.shapers import UNSHAPED, Drive, Kind, Shaper, Train, drives_of, shaper_for
from modal.types import EPS, NOISE_OF_SUM, Floats, Ints

SAMPLES_OF_HISTORY = 600
"""Format: times of the history of a travel, and at which the size of a command is looked up."""
MOST_LINKS = 100
"""Limit: links of a scene whose swing is integrated along a hoist, refused beyond."""
MOST_SWINGS = 1e5
"""Limit: swings of the fastest mode during one law of length, refused beyond."""
POWERS_OF_QUINTIC = 6
"""Format: coefficients of a quintic, of which a travel's law consists."""
TOLERANCE_OF_HOIST = 1e-10
"""Tolerance: relative error of a step along a hoist, a thousandth of it near rest."""
Command = Callable[[Floats], Floats]
Equations = Callable[[Floats], tuple[Floats, Floats]]
SWING = "swing: the largest angle of each mode relative to that at the beginning, if E/ω is conserved (a slow hoist)"
NO_MODE = "with the cart free no mode oscillates: a massless cart stays above its load"
UNSTABLE = "the equilibrium is unstable along the hoist: no swing is left at rest"


@dataclass(frozen=True, eq=False, repr=False)
class Along(Result):
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
    what = "along the hoist"

    def entries(self) -> Iterable[list[float]]:
        """Time, lengths, frequencies and swings."""
        return np.column_stack([self.times, self.lengths, self.omega, self.swing]).tolist()  # type: ignore[no-any-return]

    def columns(self) -> list[ReportColumn]:
        """The columns of the numbers at a time."""
        names = [("time_s", "t (s)")]
        places = [(p + 1, i + 1) for p, i in self.links]
        names += [(f"length_{p}_{i}_m", f"l{angle_symbol(p, i)[1:]} (m)") for p, i in places]
        names += [(key, column_label(key)) for key in (f"omega_{name}_rad_per_s" for name in self.names)]
        names += [(f"swing_{name}", f"swing{name.translate(SUBSCRIPTS)}") for name in self.names]
        return [ReportColumn(itemgetter(k), key, heading, ".6g") for k, (key, heading) in enumerate(names)]

    @property
    def notes(self) -> list[str]:
        """Notes on the laws of the lengths."""
        links = [link for pendulum in self.scene.pendulum for link in pendulum.links if link.hoist]
        laws = [link.hoist.law(link.length) for link in links if link.hoist]
        return list(dict.fromkeys(law.words for law in laws if law.words))

    def parts(
        self, form: Form = "text", *, left: Sequence[Residual] = (), beside: str = ""
    ) -> Iterator[ReportTable | str]:
        """The table, its meaning and omissions, or those `beside` a free cart, and the swing `left` by commands."""
        yield from super().parts(form)
        yield from self.notes
        if self.names:
            damper_note = "; both ω and swing without dampers" if self.scene.has_damping else ""
            yield f"ω: {self.support_words}\n{SWING}{damper_note}"
        else:
            yield "; ".join(filter(None, (NO_MODE, beside)))
        yield residual_lines(left)

    @property
    def support_words(self) -> str:
        """The behaviour of the support while the modes swing."""
        if is_held(self.scene, self.drive):
            return "the cart's motion is prescribed: modes as on a fixed support"
        return "the cart is free and moves with its loads" if self.scene.cart else "about the support of the scene"

    def main_figures(self, left: Sequence[Residual]) -> str:
        """The first and last frequency of each mode, and the residual swing `left` by commands."""
        ends = zip(self.names, *self.omega[[0, -1]].tolist(), strict=True)
        words = [f"ω_{name} {first:.4g} to {last:.4g} rad/s" for name, first, last in ends]
        return f"{', '.join(words[:MOST_LISTED]) or NO_MODE}\n{residual_lines(left)}".rstrip()

    def whole(self, *, left: Sequence[Residual] = ()) -> dict[str, Any]:
        """Every column as an array, and the residual swing."""
        return {
            "title": self.scene.title,
            "drive": self.drive,
            "time_s": self.times.tolist(),
            "modes": self.names,
            "links": [{"pendulum": p + 1, "link": i + 1} for p, i in self.links],
            "length_m": self.lengths.tolist(),
            "omega_rad_per_s": self.omega.tolist(),
            "swing": self.swing.tolist(),
            "residual": [{"command": each.words, "angle_deg": degrees(each.angle)} for each in left],
            "notes": self.notes,
        }


def frequencies_along(scene: Scene, samples: int = 21, drive: Drive = "cart_force") -> Along:
    """Return frequencies at evenly spaced times from the beginning of the first hoist to the end of the last.

    Under a prescribed motion of the cart they are those on a fixed support. A massless cart has one mode less; with a
    single bob there is none. Raise SceneError without a hoist, ComputationError for an unstable equilibrium and for
    more than MOST_LINKS links.
    """
    times = hoisting_times(scene, samples)
    _refuse_many(scene)
    places = [
        (p, i) for p, pendulum in enumerate(scene.pendulum) for i, link in enumerate(pendulum.links) if link.hoist
    ]
    lengths = np.array([[scene.pendulum[p].links[i].length_at(time) for p, i in places] for time in times.tolist()])
    is_prescribed = is_held(scene, drive)
    curves = [
        [np.repeat(part, copies, axis=1) for part in _mode_curves(independent_scene, times)]
        for independent_scene, copies in _independent_scenes(scene, is_prescribed)
    ]
    omega, reach = (np.hstack(parts) for parts in zip(*curves, strict=True))
    order = np.argsort(omega[0], kind="stable")
    relative = reach[:, order] / np.sqrt(omega[:, order])
    names = _names(scene.at(float(times[0])), omega[0, order], is_prescribed)
    return Along(scene, drive, times, tuple(places), names, lengths, omega[:, order], relative / relative[0])


def _independent_scenes(scene: Scene, is_prescribed: bool) -> list[tuple[Scene, int]]:
    """Scenes whose modes together are those of this one, whatever the lengths, and how often each mode occurs."""
    conservative_scene = scene.workless.in_plane
    if conservative_scene.is_structured:
        return _independent_on_structure(conservative_scene)
    equal: Counter[Pendulum] = Counter()
    for pendulum in conservative_scene.pendulum:
        equal[pendulum.replace(count=1, start=None)] += pendulum.count
    single_scenes = [
        (conservative_scene.replace(support=Fixed(), pendulum=(pendulum,)), copies)
        for pendulum, copies in equal.items()
    ]
    if is_prescribed or conservative_scene.cart is None:
        return single_scenes
    merged_pendula = tuple(heavier(pendulum, copies) for pendulum, copies in equal.items())
    return [
        (conservative_scene.replace(pendulum=merged_pendula), 1),
        *((pendulum, copies - 1) for pendulum, copies in single_scenes if copies > 1),
    ]


def _independent_on_structure(conservative_scene: Scene) -> list[tuple[Scene, int]]:
    """The same where copies of a pendulum move a structure together; copies that springs join stay as they are."""
    spring_pendula, merged_pendula, single_scenes = joined_pendula(conservative_scene), [], []
    for index, pendulum in enumerate(conservative_scene.pendulum):
        if pendulum.count == 1 or index in spring_pendula:
            merged_pendula.append(pendulum)
            continue
        merged_pendula.append(heavier(pendulum, pendulum.count))
        single = pendulum.replace(count=1, start=None, on=None, position=(0.0, 0.0))
        single_scenes.append(
            (
                conservative_scene.replace(support=Fixed(), spring=(), ground=None, pendulum=(single,)),
                pendulum.count - 1,
            )
        )
    return [(conservative_scene.replace(pendulum=tuple(merged_pendula)), 1), *single_scenes]


def _mode_curves(scene: Scene, times: Floats) -> tuple[Floats, Floats]:
    """ω (T, R) of a scene in which no two modes cross, and the largest angle (T, R) of every shape, φᵀMφ = 1."""
    instants = [_modes(scene.at(time)) for time in times.tolist()]
    links = rig_of(scene).leading
    return np.array([omega for omega, _, _ in instants]), np.array(
        [np.abs(phi[links:]).max(0) for _, phi, _ in instants]
    )


def _names(scene: Scene, omega: Floats, is_prescribed: bool) -> tuple[str, ...]:
    """The numbers in the table of modes, which has dampers, of these frequencies without, of constant lengths."""
    on_support = without_carrier(scene) if is_prescribed else scene
    table = natural_modes(on_support.conservative)
    nearest = np.abs(np.subtract.outer(omega, table.omega)).argmin(1)
    return number_labels(table_numbers(on_support, table)[nearest].tolist())


def is_held(scene: Scene, drive: Drive) -> bool:
    """Whether the cart's motion is prescribed."""
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
    planar_shapes = modes.matrix.take(~modes.matrix.across).real
    swinging = planar_shapes.take(modes.omega[planar_shapes.row] > 0)
    return modes.omega[swinging.row], np.asarray(swinging.shapes), swinging.row


class TravelLimits(NamedTuple):
    """Limits of a travel: its acceleration (m/s²), its speed (m/s) and its jerk (m/s³).

    With a `step` (s) every phase of it lasts a multiple of that.
    """

    acceleration: float
    speed: float = inf
    jerk: float = inf
    step: float = 0.0


@dataclass(frozen=True, eq=False)
class Travel:
    """A travel of the cart by `distance` (m) from `begin` (s) on over `duration` (s), along a `way` from rest to rest.

    Without one it is x = d (10 s³ − 15 s⁴ + 6 s⁵), s from 0 to 1.
    """

    distance: float
    begin: float
    duration: float
    way: LengthLaw | None = None

    @classmethod
    def along(
        cls, scene: Scene, distance: float | str, duration: float | None = None, limits: TravelLimits | None = None
    ) -> Travel:
        """From the begin of the first hoist of a scene on, by default until the end of the last; else as `planned`.

        >>> from modal import load
        >>> Travel.along(load("hoisting-crane"), 10.0).duration
        8.0
        """
        begin, end = hoisting_times(scene, 2).tolist()
        return cls.planned(distance, begin, duration or end - begin, limits)

    @classmethod
    def planned(
        cls, distance: float | str, begin: float, duration: float, limits: TravelLimits | None = None
    ) -> Travel:
        """From `begin` (s) on over a `duration` (s), within `limits` in the shortest time, or that of a CSV file.

        The file has the accelerations of a cart at rest before and afterwards, which straight lines join, and its times
        are those of the travel. Raise SceneError for a file that is no such record.

        >>> round(Travel.planned(20.0, 0.0, 30.0, TravelLimits(acceleration=0.4, speed=1.5)).duration, 9)
        17.083333333
        """
        if isinstance(distance, str):
            way = _recorded_way(distance)
        elif limits is None:
            return cls(distance, begin, duration)
        else:
            way = limited_law(distance, begin, limits.speed, limits.acceleration, limits.jerk, limits.step)
            phases = np.diff(way.knots)
            if phases.min() < EPS**0.5 * phases.sum():
                raise SceneError(
                    [
                        f"distance {distance:g}: in these limits phases of {phases.min():.2g} and {phases.max():.2g} s "
                        "follow each other, too different for double precision"
                    ]
                )
        first, last = way.breaks[0], way.breaks[-1]
        return cls(way.end, first, last - first, way)

    @property
    def course(self) -> LengthLaw:
        """The way (m) as a function of time."""
        return self.way or profile_law(0.0, self.distance, self.begin, self.duration, None)

    def motion(self, times: Floats) -> Floats:
        """X (m), x' (m/s) and x'' (m/s²) at these times (T,), (3, T)."""
        return np.array(self.course(times))

    def shaped(self, train: Train) -> LengthLaw:
        """The sum of such ways, delayed by the times of a train of impulses, in their amplitudes."""
        return superposed(self.course, *train)


def _recorded_way(path: str) -> LengthLaw:
    """The way of a record of accelerations, which begins and ends at rest."""
    record = read_record(path)
    if "acceleration_m_per_s2" not in record:
        raise SceneError([f"{path}: needs the column acceleration_m_per_s2, that of the cart in a travel"])
    times, values = np.array(record["time_s"]), np.array(record["acceleration_m_per_s2"])
    if len(times) < 2 or np.any(np.diff(times) <= 0):
        raise SceneError([f"{path}: time_s must be strictly ascending, with at least 2 samples"])
    steps = np.diff(values) * np.diff(times) / 2
    speeds = np.concatenate(([0.0], np.cumsum(values[:-1] * np.diff(times) + steps)))
    if abs(speeds[-1]) > max(EPS**0.5 * np.abs(speeds).max(), NOISE_OF_SUM):
        raise SceneError([f"{path}: ends at {speeds[-1]:.4g} m/s: a travel ends at rest"])
    slopes = np.diff(values) / np.diff(times)
    bends = np.abs(np.diff(slopes)) * np.minimum(np.diff(times)[:-1], np.diff(times)[1:])
    is_kink = np.concatenate(([True], bends > NOISE_OF_SUM * np.abs(values).max(), [True]))
    return integrated_law(times[is_kink], values[:-1][is_kink[:-1]], slopes[is_kink[:-1]])


@dataclass(frozen=True)
class Residual:
    """The largest angle (rad) that a link reaches when travel and hoist are over, for a command in `words`.

    From then on without dampers: that to which the swings of all frequencies add up.
    """

    words: str
    angle: float


def residual_lines(residuals: Sequence[Residual]) -> str:
    """The residual swing after commands, a line each."""
    return "\n".join(f"residual swing {short(degrees(each.angle))}°: {each.words}" for each in residuals)


def travel_residuals(scene: Scene, travel: Travel, *, kind: Kind = "zv", count: int = 1) -> tuple[Residual, ...]:
    """Return residuals of a travel: unshaped, and shaped for the initial and for the mean lengths.

    The last is that of the unshaped travel if the lengths did not change. Raise SceneError for a scene without hoist or
    cart, else as `shaper_for`.
    """
    _refuse_travel(scene)
    initial_scene, mean, name = scene.at(float(hoisting_times(scene)[0])), mean_lengths(scene), f"{kind} shaper"
    commands = {
        "unshaped": (scene, UNSHAPED),
        f"shaped by a {name} for the lengths before the hoist": (scene, shaper_for(initial_scene, count, kind).train),
        f"shaped by a {name} for the mean lengths": (scene, shaper_for(mean, count, kind).train),
        "unshaped, without the hoist": (initial_scene, UNSHAPED),
    }
    return tuple(Residual(words, _residual_angle(moved, travel, train)) for words, (moved, train) in commands.items())


def travel_swing(scene: Scene, travel: Travel, kind: Kind | None = None) -> float:
    """Return the largest angle (rad) after a travel of the cart, shaped for the initial lengths if a `kind` is given.

    Lengths may change with a hoist or stay.

    >>> from modal import Bob, Cart, Pendulum, Scene
    >>> crane = Scene(gravity=9.81, support=Cart(mass=5.0), pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0)])])
    >>> round(travel_swing(crane, Travel(1.0, 0.0, 2.0)), 6), travel_swing(crane, Travel(1.0, 0.0, 2.0), "zv") < 1e-9
    (0.464359, True)
    """
    _refuse_travel(scene)
    train = UNSHAPED if kind is None else shaper_for(scene.at(travel.begin), 1, kind).train
    return _residual_angle(scene, travel, train)


def _refuse_travel(scene: Scene) -> None:
    _refuse_many(scene)
    if scene.cart is None:
        raise SceneError(["travel: the support is fixed: a travel needs a cart"])


def mean_lengths(scene: Scene) -> Scene:
    """Return the scene with constant lengths: the time averages over the hoist of each link."""
    return scene.replace(
        pendulum=tuple(
            pendulum.replace(links=tuple(map(_at_mean_length, pendulum.links))) for pendulum in scene.pendulum
        )
    )


def _at_mean_length(link: Any) -> Any:
    """A link with its mean length over the middles of many equal parts of its hoist's time."""
    if not link.hoist:
        return link
    law = link.hoist.law(link.length)
    edges = np.linspace(law.knots[0], law.knots[-1], 4097)
    return link.replace(length=float(np.mean(law((edges[1:] + edges[:-1]) / 2)[0])), hoist=None)


def _residual_angle(scene: Scene, travel: Travel, train: Train) -> float:
    """The largest angle (rad) that a shaped travel of the cart leaves of a state of rest."""
    way, hoisting = travel.shaped(train), hoisting_of(scene)
    stops = way.breaks
    pushes = way(np.linspace(stops[0], stops[-1], SAMPLES_OF_HISTORY))[2]
    times = np.unique([*stops, *(time for time in (hoisting.breaks if hoisting else ()) if time > stops[0])])
    size = float(np.abs(pushes).max()) / scene.gravity
    states = motion_history(scene, lambda at: way(at)[2], times, stops, coordinate=None, size=size)
    return largest_swing(scene.at(float(times[-1])), states[-1], is_prescribed=True)


def shaper_residual(scene: Scene, shaper: Shaper, drive: Drive = "cart_acceleration") -> float:
    """Return the residual of a shaped impulse at the beginning of the hoist, relative to the unshaped impulse.

    At the end of the hoist, or of the impulses if that is later, in the largest angle of any link. Raise SceneError for
    a scene without hoist, ComputationError for a force on a cart with which the mass matrix is singular.
    """
    _refuse_many(scene)
    hoisting = hoisting_of(scene)
    if hoisting is None:
        raise no_hoist(scene)
    begin, is_prescribed = hoisting.breaks[0], is_held(scene, drive)
    if not is_prescribed:
        refuse_no_inertia(matrices_along(scene)(begin).M)
    last = max(hoisting.breaks[-1], begin + shaper.duration)
    coordinate = None if is_prescribed else drives_of(scene).index(drive)
    shaped, unshaped = (
        _impulse_response(scene, begin + times, amplitudes, last, coordinate)
        for times, amplitudes in (shaper.train, UNSHAPED)
    )
    final_scene = scene.at(last)
    residual = largest_swing(final_scene, shaped, is_prescribed=is_prescribed)
    return residual / largest_swing(final_scene, unshaped, is_prescribed=is_prescribed)


def _impulse_response(scene: Scene, times: Floats, amplitudes: Floats, last: float, coordinate: int | None) -> Floats:
    """(q, q') after impulses from rest: of a force on a coordinate, or (None) of the speed of a cart held fixed."""
    hoisting, matrices_at = hoisting_of(scene), matrices_along(scene)
    start = equations_of_push(matrices_at(float(times[0])), coordinate)[1]
    n, size, y = len(start), float(np.abs(start).max()), np.zeros(2 * len(start))
    for time, end, amplitude in zip(times.tolist(), [*times[1:].tolist(), last], amplitudes.tolist(), strict=True):
        y[n:] += amplitude * equations_of_push(matrices_at(time), coordinate)[1]
        knots = [knot for knot in (hoisting.breaks if hoisting else ()) if time < knot < end]
        y = motion_history(
            scene, np.zeros_like, np.unique([time, *knots, end]), (), coordinate=coordinate, size=size, start=y
        )[-1]
    return y


def largest_swing(scene: Scene, y: Floats, *, is_prescribed: bool) -> float:
    """The largest angle (rad) that the swings of all frequencies can add up to in any link, about the rest of (q, q').

    Under drag that is the rest next to a cart that moves on.
    """
    linear = matrices(scene)
    first, n = int(is_prescribed), len(linear.M)
    q, rate = y[first:n].copy(), y[n + first :]
    if is_prescribed:
        q += np.linalg.solve(linear.K[1:, 1:], linear.D[1:, 0] * y[n])
    omega, phi, row = _modes(without_carrier(scene) if is_prescribed else scene)
    if not len(omega):
        return 0.0
    dual = phi.T @ linear.M[first:, first:]
    angles = phi[0 if is_prescribed else rig_of(scene).leading :] * (dual @ q + 1j * (dual @ rate) / omega)
    return float(np.abs(np.add.reduceat(angles, np.flatnonzero(np.diff(row, prepend=-1)), axis=1)).sum(1).max())


def residual_words(scene: Scene, count: int, kind: Kind, drive: Drive, shaper: Shaper) -> Iterator[str]:
    """Return sentences on the residuals of shapers for the initial and for the mean lengths during a hoist."""
    yield "the lengths change with the hoist: this shaper is that of the lengths before it"
    mean = shaper_for(mean_lengths(scene), count, kind, drive)
    shaper_percent, mean_percent = (100 * shaper_residual(scene, variant, drive) for variant in (shaper, mean))
    yield (
        f"along the hoist it leaves {shaper_percent:.3g} % of the swing of one impulse; one for the mean lengths "
        f"{mean_percent:.3g} %"
    )


# ------------------------------------------------------------------------------------------------- motion in time


def motion_history(
    scene: Scene,
    command: Command,
    times: Floats,
    stops: Sequence[float],
    *,
    coordinate: int | None,
    size: float,
    start: Floats | float = 0.0,
) -> Floats:
    """(q, q') (T, 2n) at ascending times (T,) from `start` at the first on, the `stops` of the command among them.

    Between its stops the `command` is at most a quintic: the force on the `coordinate`, or (None) the acceleration of a
    cart whose motion is prescribed.  `size` is that of the motion.
    """
    matrices_at, hoisting = matrices_along(scene), hoisting_of(scene)
    breaks = hoisting.breaks if hoisting else ()
    spans = [getattr(law, "breaks", (-np.inf, np.inf)) for _, law in hoisting.laws] if hoisting else []
    states = np.zeros((len(times), 2 * len(matrices_at(float(times[0])).M)))
    n = states.shape[1] // 2
    states[0] = start
    corners = np.unique([times[0], *stops, *breaks, times[-1]])
    for begin, end in pairwise(corners[(corners >= times[0]) & (corners <= times[-1])].tolist()):
        rows = np.flatnonzero((times >= begin) & (times <= end))
        if not any(span[0] < end and begin < span[-1] for span in spans):
            _advance(states, times, rows, equations_of_push(matrices_at((begin + end) / 2), coordinate), command)
            continue
        stiffness = equations_of_push(matrices_at(begin), coordinate)[0][:, :n]
        swings = (end - begin) * float(np.linalg.norm(stiffness, 2)) ** 0.5 / (2 * np.pi)
        if not swings <= MOST_SWINGS:
            raise ComputationError(f"the hoist takes {swings:.3g} swings: at most {MOST_SWINGS:g} are followed")

        edges = np.unique(np.concatenate((times[rows], np.linspace(begin, end, 2 + ceil(3 * swings)))))
        state, is_sample = states[rows[0]], np.isin(edges, times[rows])
        ends = dict(zip(edges[is_sample].tolist(), rows.tolist(), strict=True))
        steps = _steps(lambda at: equations_of_push(matrices_at(at), coordinate), command, edges, size or 1.0)
        for time, step in steps:
            state = step[:, :-1] @ state + step[:, -1]
            if time in ends:
                states[ends[time]] = state
        if not np.all(np.isfinite(state)):
            raise ComputationError("the motion along the hoist exceeds double precision")
    return states


def _steps(
    equations_at: Equations, command: Command, edges: Floats, size: float, stages: int = 8, entries: int = 2**20
) -> Iterator[tuple[float, Floats]]:
    """The end of each step between `edges`, halved until halves agree, and what becomes in it of (q, q', 1) (2n, 2n+1).

    With 8 `stages` about three steps a swing have all digits.  `entries` bounds the arrays of the steps that are
    computed together.
    """
    n = equations_at(edges[:1])[0].shape[1]
    for first in range(0, len(edges) - 1, together := max(1, entries // (stages * n) ** 2)):
        begin, end = edges[first : first + together + 1][:-1], edges[first + 1 : first + together + 1]
        middle = (begin + end) / 2
        whole, former, latter = (
            _collocated(equations_at, command, *span, stages) for span in ((begin, end), (begin, middle), (middle, end))
        )
        halves = latter[:, :, :-1] @ former
        halves[:, :, -1] += latter[:, :, -1]
        units = np.ones((len(begin), 1, 2 * n + 1))
        units[:, 0, n:-1], units[:, :, -1] = (end - begin)[:, None], size
        difference, scale = (np.abs(part / units).max(2) for part in (whole - halves, halves))
        differs = (difference > TOLERANCE_OF_HOIST * scale).any(1) & (begin < middle) & (middle < end)
        for k, step in enumerate(halves):
            if differs[k]:
                yield from _steps(equations_at, command, np.array([begin[k], middle[k], end[k]]), size)
            else:
                yield float(end[k]), step


def _collocated(equations_at: Equations, command: Command, begin: Floats, end: Floats, stages: int) -> Floats:
    """What becomes of (q, q', 1) in T steps (T, 2n, 2n + 1), by collocation at Gauss's points [Hairer1993, II.7]."""
    points, weights = np.polynomial.legendre.leggauss(stages)
    degrees_of_points = np.arange(stages)[:, None]
    basis = (degrees_of_points + 0.5) * weights * np.polynomial.legendre.legvander(points, stages - 1).T
    a = np.polynomial.legendre.legval(points, np.polynomial.legendre.legint(basis, lbnd=-1)).T / 2
    b, c, h = weights / 2, (1 + points) / 2, (end - begin)[:, None, None, None]
    times = begin[:, None] + c * h[:, :, 0, 0]
    A, B = equations_at(times)
    n = A.shape[2]
    by_place, by_rate = A[..., :n], A[..., n:]
    driven = (B * command(times.ravel()).reshape(times.shape)[..., None])[..., None]
    right = np.concatenate((by_place, h * c[:, None, None] * by_place + by_rate, driven), 3)
    fed_back = np.einsum("ij,tiab->tiajb", a @ a, h**2 * by_place) + np.einsum("ij,tiab->tiajb", a, h * by_rate)
    size = stages * n
    slopes = np.linalg.solve(np.eye(size) - fed_back.reshape(-1, size, size), right.reshape(-1, size, 2 * n + 1))
    slopes = h * slopes.reshape(right.shape)
    step = np.zeros((len(begin), 2 * n, 2 * n + 1)) + np.eye(2 * n, 2 * n + 1)
    step[:, :n, n:-1] += h[..., 0] * np.eye(n)
    step[:, :n] += h[..., 0] * np.einsum("i,tiam->tam", b @ a, slopes)
    step[:, n:] += np.einsum("i,tiam->tam", b, slopes)
    return step


def _advance(states: Floats, times: Floats, rows: Ints, equations: tuple[Floats, Floats], command: Command) -> None:
    """Fill in the states at these rows but the first, of constant equations and a command without a corner."""
    step_matrices: dict[float, tuple[Floats, Floats]] = {}
    for row in rows[1:].tolist():
        begin, end = times[row - 1], times[row]
        step = round(float(end - begin), 12)
        if step not in step_matrices:
            step_matrices[step] = _step(*equations, float(end - begin))
        free, driven = step_matrices[step]
        states[row] = free @ states[row - 1] + driven @ command(np.linspace(begin, end, POWERS_OF_QUINTIC + 2)[1:-1])


def _step(A: Floats, B: Floats, duration: float) -> tuple[Floats, Floats]:
    """The transition over a time of (q, q') (2n, 2n), and of a quintic by its values inside (2n, POWERS_OF_QUINTIC)."""
    n = len(B)
    matrix = np.zeros((2 * n + POWERS_OF_QUINTIC,) * 2)
    matrix[:n, n : 2 * n] = np.eye(n) * duration
    matrix[n : 2 * n, : 2 * n] = A * duration
    matrix[n : 2 * n, 2 * n] = B * duration
    matrix[2 * n :, 2 * n :] = np.eye(POWERS_OF_QUINTIC, k=1)
    rows_of_exponential = scipy.linalg.expm(matrix)[: 2 * n]
    inside = np.linspace(0.0, 1.0, POWERS_OF_QUINTIC + 2)[1:-1]
    rows = inside[:, None] ** np.arange(POWERS_OF_QUINTIC) / scipy.special.factorial(np.arange(POWERS_OF_QUINTIC))
    return rows_of_exponential[:, : 2 * n], np.linalg.solve(rows.T, rows_of_exponential[:, 2 * n :].T).T


def equations_of_push(linear: Matrices, coordinate: int | None) -> tuple[Floats, Floats]:
    """A (..., n, 2n) and B (..., n) of q'' = A (q, q') + B u, u the force on a coordinate or a cart's acceleration."""
    is_prescribed = coordinate is None
    n, first = linear.M.shape[-1], int(is_prescribed)
    force = -linear.M[..., 0] if is_prescribed else np.broadcast_to(np.eye(n)[coordinate or 0], linear.M.shape[:-1])
    right = np.concatenate((-linear.K, -linear.D, force[..., None]), -1)[..., first:, :]
    solution = np.zeros((*linear.M.shape[:-1], 2 * n + 1))
    solution[..., 0, -1] = is_prescribed
    solution[..., first:, :] = np.linalg.solve(linear.M[..., first:, first:], right)
    return solution[..., :-1], solution[..., -1]
