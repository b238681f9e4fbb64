"""Time-dependent inputs of the equations of motion: support motions, lengths, applied forces.

At one instant these are an `Instant`; as inputs u of what is written they are a list, in this order, each only where a
scene has it:

    the time (s) where the support moves in sines and forces are sines or constant, and no length changes; else of every
    motion of the support its acceleration (m/s²) and, where links have drag, its velocity (m/s), in its direction, then
    the size of every force (N or N m)
    of every law of a hoist the length (m), its speed and its acceleration
    of every loop of feedback that is sampled the input (N or N m) that it holds
    the force on the cart (N) or on each coordinate of a structure (N, N m), and the moment on every link (N m; in space
    its three components), of a load
    of every contact with dry friction the torque or force that it exerts while it slides (N m or N), 0 where it sticks;
    then of every contact 1 where it sticks, 0 where it slides; on a rail with a coefficient μ, first, instead of the
    friction −s μ sign N

Inputs of feedback loops (`nonlinear.system.loops`) for a state in any arithmetic, and held between samples.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf, ulp
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from modal.errors import ComputationError, SceneError
from modal.scene.length_laws import LengthLaw
from modal.types import NOISE_OF_SUM, Floats
from modal.vibration.prescribed import Course, Polynomials, in_floats
from nonlinear.dynamics.contacts import Gripping
from nonlinear.dynamics.structure import array_of
from nonlinear.dynamics.tape import Symbol, where
from nonlinear.system import AppliedForces, Group, Layout, Load, System
from nonlinear.system.system import spread

if TYPE_CHECKING:
    from nonlinear.system.loops import ActingLoop


def input_of(loop: ActingLoop, y: Any) -> Any:
    """The input (N or N m) of a loop at y = (q, q', …), floats, arrays of many states, complex numbers or symbols."""
    total: Any = 0.0
    for k, (gain, (places, rest)) in enumerate(zip(loop.gains, loop.readings, strict=True)):
        value: Any = 0.0 - rest if rest else 0.0
        for place, factor in places:
            value = value + (y[place] if factor == 1.0 else factor * y[place])
        total = total - gain * (value - loop.references[k] if loop.references else value)
    return total if loop.limit is None or not loop.gains else _clip(total, loop.limit)


def _clip(value: Any, limit: Any) -> Any:
    """The value within ±limit."""
    choose = Symbol.where if isinstance(value, Symbol) else where
    below = choose(value - limit, limit, value)
    return choose(-limit - below, -limit, below)


class HeldInputs:
    """The inputs of sampled loops, each computed at its sample time and held until the next one."""

    def __init__(self, loops: Sequence[ActingLoop]) -> None:
        self.loops = [loop for loop in loops if loop.sample_time]
        self.times: list[list[float]] = [[] for _ in self.loops]
        self.inputs: list[list[float]] = [[] for _ in self.loops]

    def begin(self, start: float, end: float, most: int = 1_000_000) -> list[float]:
        """Forget all; the times (s) of samples until the end, ascending; raise SceneError for too many."""
        self.inputs = [[] for _ in self.loops]
        counts = [(end - start) / loop.sample_time * (1 + NOISE_OF_SUM) for loop in self.loops]
        for loop, count in zip(self.loops, counts, strict=True):
            if count > most:
                place = f"feedback[{loop.entry}].sample_time = {loop.sample_time!r}"
                raise SceneError([f"{place}: makes {count:.3g} samples in this run: at most {most} are taken"])
        self.times = [
            (start + loop.sample_time * np.arange(int(count) + 1)).tolist()
            for loop, count in zip(self.loops, counts, strict=True)
        ]
        every = np.unique([time for times in self.times for time in times])
        apart = np.append(True, np.diff(every) > NOISE_OF_SUM * np.abs(every[1:]))
        return [float(time) for time in every[apart]]

    def take(self, time: float, y: Sequence[float]) -> None:
        """The samples that are due at a time (s) and a state."""
        for loop, times, inputs in zip(self.loops, self.times, self.inputs, strict=True):
            k = bisect_right(times, time + NOISE_OF_SUM * abs(time) + ulp(0.0)) - 1
            if k >= 0 and time - times[k] <= NOISE_OF_SUM * abs(time):
                inputs[k:] = [float(input_of(loop, y))]

    def at(self, time: float) -> list[float]:
        """Held inputs of all loops at a time (s) of the motion; raise ComputationError if its samples are not known."""
        held = []
        for loop, times, inputs in zip(self.loops, self.times, self.inputs, strict=True):
            k = bisect_right(times, time) - 1 - loop.delayed_samples
            if not times or k >= len(inputs):
                raise ComputationError("the held inputs of sampled feedback are not stored with a run")
            held.append(inputs[k] if k >= 0 else 0.0)
        return held

    def beside(self, times: Any) -> list[Any]:
        """The same at times (S,) at once, each (S,)."""
        if not self.loops:
            return []
        columns = [self.at(time) for time in np.ravel(times).tolist()]
        return [np.reshape(row, np.shape(times)) for row in zip(*columns, strict=True)]


NOTHING = AppliedForces()
CLOCK = Polynomials(np.empty(0), np.zeros(1), np.array([[0.0, 1.0]]))
"""The time itself."""
BEND_MIN = 10.0
"""Tolerance: bends of accelerations over the tolerance, in gravity, that steps may pass over: they then add less than
the method itself errs by, for smooth records, noisy ones and such with jumps, of 201 to 20,001 samples."""

RECORD_DEGREE = 9
"""Tolerance: of the polynomials by which a record is seen to be smooth, one above the order of the methods."""
LOOKS_OF_WINDOW = 32
"""Tolerance: in the shortest window of a record in which it may be smooth: three times the degree."""
LOOKS_PER_PIECE = 8
"""Cost: of a record of uneven pieces, two to the shortest; one that takes more is not asked whether it is smooth."""


class Lengths(NamedTuple):
    """Lengths (L, ...) of all links at an instant (m), their speeds and accelerations."""

    length: Any
    speed: Any
    acceleration: Any


class Instant(NamedTuple):
    """Accelerations (m/s²) and velocities (m/s) of a moving support along the rail and down, lengths, loads.

    `forces` are the sizes (N or N m) of those of the scene, `held` the inputs of loops that are sampled. The friction
    of contacts that slide is applied; `gripping` says which stick.
    """

    support: tuple[Any, Any] = (0.0, 0.0)
    velocity: tuple[Any, Any] = (0.0, 0.0)
    lengths: Lengths | None = None
    push: AppliedForces = NOTHING
    gripping: Gripping | None = None
    forces: tuple[Any, ...] = ()
    held: tuple[Any, ...] = ()


QUIET = Instant()


@dataclass(frozen=True, eq=False)
class Inputs:
    """The time-dependent inputs of a system under a load, with `contacts` (the coordinates below and above each).

    `drags` says that others of its form, with numbers of their own, have drag.
    """

    system: System
    load: Load | None = None
    contacts: tuple[tuple[int, int], ...] = ()
    drags: bool = False

    @cached_property
    def courses(self) -> tuple[Course, ...]:
        """The functions of time."""
        return self.system.courses(drags=self.drags)

    @cached_property
    def laws(self) -> tuple[Any, ...]:
        """The places (k,) of links that follow a law, and the law."""
        return self.system.hoisting.laws if self.system.hoisting else ()

    @property
    def count(self) -> int:
        """How many inputs u there are."""
        acting = 0 if self.load is None else self._moments + self.system.first
        return self._course_count + 3 * len(self.laws) + len(self.samples.loops) + acting + 2 * len(self.contacts)

    @cached_property
    def samples(self) -> HeldInputs:
        """The held inputs of sampled loops."""
        return HeldInputs(self.system.loops)

    @property
    def _moments(self) -> int:
        return self.system.n_links * (3 if self.system.spatial else 1)

    @property
    def _course_count(self) -> int:
        return 1 if self.is_analytic else len(self.courses)

    @property
    def is_analytic(self) -> bool:
        """Whether all prescribed functions are plain expressions of constants and time."""
        return self.system.is_analytic

    def inputs_at(self, time: float, y: Sequence[float], layout: Layout) -> list[Any]:
        """The inputs u at one time (s), where the load sees the state y."""
        values = [*self.of_time(time)]
        if self.load is not None:
            push = self.load(time, layout.state(np.asarray(y)))
            values += _on_first(push, self.system)
            moments = push.moments
            values += [0.0] * self._moments if moments is None else np.ravel(moments).astype(float).tolist()
        return values

    @cached_property
    def of_time(self) -> Callable[..., Sequence[float]]:
        """The inputs of time alone at one time (s), in floats; a further argument is of no use."""
        if self.samples.loops:
            of_rest, held = Inputs(replace(self.system, loops=()), drags=self.drags).of_time, self.samples.at
            return lambda time, y=(): [*of_rest(time), *held(time)]
        if self.is_analytic and not self.laws:
            return lambda time, y=(): (time,)
        if (polynomials := self.polynomials) is not None:
            return in_floats(polynomials)
        courses = [_clock] if self.is_analytic else [course.at for course in self.courses]
        laws = [in_floats([*_derivatives(law)]) if isinstance(law, LengthLaw) else law.at for _, law in self.laws]
        return lambda time, y=(): [*(at(time) for at in courses), *(number for law in laws for number in law(time))]

    def beside(self, times: Any) -> list[Any]:
        """The inputs of time alone at times of any shape (s), each of that shape."""
        laws = [part for _, law in self.laws for part in law(times)] + self.samples.beside(times)
        return [times, *laws] if self.is_analytic else [course.beside(times) for course in self.courses] + laws

    @cached_property
    def polynomials(self) -> list[Polynomials] | None:
        """Every input of time alone piece by piece; none where the time is the only one; None if any has none."""
        if self.is_analytic and not self.laws:
            return []
        courses = [pieces for course in self.courses if (pieces := course.polynomials)]
        courses = [CLOCK] if self.is_analytic else courses
        if len(courses) < self._course_count or not all(isinstance(law, LengthLaw) for _, law in self.laws):
            return None
        return [*courses, *(pieces for _, law in self.laws for pieces in _derivatives(law))]

    @cached_property
    def pieces(self) -> list[Polynomials] | None:
        """The `polynomials` where every knot is one of the `breaks`, at which a step may end."""
        polynomials = self.polynomials
        return polynomials if polynomials is not None and all(piece.period == inf for piece in polynomials) else None

    def breaks(self, accuracy: float = 0.0) -> list[float]:
        """The times (s), ascending, at which an acceleration of the support or of a length, or a force, jumps or bends.

        Steps that end there keep the order of their method.  For an `accuracy`, a relative tolerance, a knot counts
        where it bends by BEND_MIN times that part of gravity, or of a force as heavy as the lightest link, or of the
        largest value if that is less.
        """
        gravity, times = float(np.min(self.system.gravity)), set[float]()
        accuracy *= BEND_MIN
        for course in self.courses:
            times |= {*course.motion.breaks}
        for course, unit in self._bending(gravity):
            if (pieces := course.polynomials) and pieces.period == inf:
                times |= _bends(pieces, accuracy * min(unit, float(np.abs(pieces.coefficients[:, 0]).max())))
        for _, law in self.laws:
            if isinstance(law, LengthLaw):
                *_, pieces = _derivatives(law)
                times |= {*law.knots[[0, -1]].tolist()} | _bends(pieces, accuracy * gravity)
            else:
                times |= {*getattr(law, "breaks", ())}
        return sorted(times)

    def _bending(self, gravity: float) -> Iterator[tuple[Course, float]]:
        """Accelerations of the support (m/s²) and forces (N, N m), with the unit of each."""
        system = self.system
        forces, count = len(system.forces), len(system.support.motions) if system.support else 0
        yield from ((course, gravity) for course in self.courses[:count])
        weight = gravity * float(np.min(system.by_link("mass"))) if forces else 0.0
        for force, course in zip(system.forces, self.courses[len(self.courses) - forces :], strict=True):
            yield course, weight if force.direction else weight * float(np.min(system.by_link("length")))

    def longest_step(self, accuracy: float = 0.0) -> float:
        """The time (s) in which the support's acceleration and every force change too little to be missed by a step.

        For an `accuracy`, a relative tolerance, records are examined: of one that is smooth over many samples a step
        may pass over as many.
        """
        longest = inf
        for course, unit in self._bending(float(np.min(self.system.gravity))):
            pieces, window = course.polynomials if accuracy else None, 0.0
            if pieces is not None and pieces.period == inf:
                largest = float(np.abs(pieces.coefficients[:, 0]).max())
                window = smooth_window(pieces, course.motion.breaks, BEND_MIN * accuracy * min(unit, largest))
            longest = min(longest, max(course.motion.shortest, window))
        return longest

    def instant(self, u: Sequence[Any]) -> Instant:
        """The instant of these inputs."""
        values = iter(u)
        support = velocity = (0.0, 0.0)
        time = next(values) if self.is_analytic else None
        sizes = [course.of(time) if self.is_analytic else next(values) for course in self.courses]
        if moving := self.system.support:
            count = len(moving.motions)
            support = moving.components(sizes[:count])
            if self.drags or self.system.has_drag:
                velocity = moving.components(sizes[count : 2 * count])
        forces = tuple(sizes[len(sizes) - len(self.system.forces) :])
        lengths = self._lengths([(next(values), next(values), next(values)) for _ in self.laws]) if self.laws else None
        held = tuple(next(values) for _ in self.samples.loops)
        first = self.system.first
        acting = [next(values) for _ in range(first + self._moments)] if self.load else []
        if not self.contacts:
            return Instant(support, velocity, lengths, self._push(acting), None, forces, held)
        acting = acting or [0.0] * (first + self.system.n_links)
        rail_coefficient = next(values) if self.system.rail and self.system.rail.coefficient else None
        for below, above in self.contacts[rail_coefficient is not None :]:
            tau = next(values)
            acting[below] = acting[below] + tau
            if above >= 0:
                acting[above] = acting[above] - tau
        gripping = Gripping(self.contacts, [*values], rail_coefficient)
        return Instant(support, velocity, lengths, self._push(acting), gripping, forces, held)

    def _push(self, acting: Sequence[Any]) -> AppliedForces:
        first = self.system.first
        if not acting:
            return NOTHING
        if self.system.structure is not None:
            return AppliedForces(0.0, array_of(acting[first:]), array_of(acting[:first]))
        return AppliedForces(acting[0] if first else 0.0, array_of(acting[first:]))

    def _lengths(self, laws: Sequence[tuple[Any, Any, Any]]) -> Lengths:
        links = self.system.n_links
        parts = Lengths([0.0] * links, [0.0] * links, [0.0] * links)
        for group in self.system.groups:
            for place, length in zip(group.index, group.block.length, strict=True):
                for link, its in zip(place.tolist(), length, strict=True):
                    parts.length[link] = its
        for (places, _), numbers in zip(self.laws, laws, strict=True):
            for part, number in zip(parts, numbers, strict=True):
                for place in places.tolist():
                    part[place] = number
        return Lengths(*(array_of(part) for part in parts))

    @cached_property
    def _of_time_alone(self) -> Inputs:
        return Inputs(self.system)

    def at(self, time: Any, y: Any, layout: Layout) -> Instant:
        """The instant at one time (s) and state, or at many times at once."""
        instant = self._of_time_alone.instant(self.of_time(time)) if self._of_time_alone.count else QUIET
        return instant._replace(push=self.load(time, layout.state(y))) if self.load else instant


def with_lengths(group: Group, moving: Any, length: Any) -> Group:
    """A group with other lengths (n, P, ...) of its links, of which those that are `moving` (L,) are bobs on ropes."""
    is_on_rope, centre = (spread(part, length) for part in (moving[group.index], group.block.centre))
    return replace(group, block=replace(group.block, length=length, centre=np.where(is_on_rope, length, centre)))


def _on_first(push: AppliedForces, system: System) -> list[float]:
    """The forces of a load on the coordinates before those of links."""
    if system.structure is None:
        return [float(push.cart)] * system.first
    return [0.0] * system.first if push.supports is None else np.asarray(push.supports, dtype=float).tolist()


def _clock(time: float) -> float:
    return time


def at_time(pieces: Sequence[Polynomials], time: float) -> list[float]:
    """Origin and coefficients of the piece of each at a time (s), one after the other."""
    at = [int(np.searchsorted(piece.knots, time, side="right")) for piece in pieces]
    return [
        number
        for piece, k in zip(pieces, at, strict=True)
        for number in (float(piece.origins[k]), *piece.coefficients[k].tolist())
    ]


def _derivatives(law: LengthLaw) -> Iterator[Polynomials]:
    """A length, its speed and its acceleration."""
    coefficients, origins = law.coefficients, np.concatenate((law.knots[:1], law.knots))
    ends = [np.asarray(law(time)[0]) for time in (law.knots[0], law.knots[-1])]
    for order in range(3):
        first, last = np.zeros((2, 1, coefficients.shape[1]))
        first[0, 0], last[0, 0] = ends if order == 0 else (0.0, 0.0)
        yield Polynomials(law.knots, origins, np.concatenate((first, coefficients, last)))
        coefficients = np.append(
            coefficients[:, 1:] * np.arange(1, coefficients.shape[1]), np.zeros((len(coefficients), 1)), axis=1
        )


def _bends(polynomials: Polynomials, threshold: float) -> set[float]:
    """The knots (s) at which a function bends by more than so much."""
    return {*polynomials.knots[polynomials.kinks > threshold].tolist()}


def smooth_window(pieces: Polynomials, breaks: Sequence[float], error: float) -> float:
    """The longest time (s) such that within it, wherever it begins, one such polynomial is right to an `error`.

    Between the `breaks` (s); of windows that double; 0 if the shortest of them already has more to it.
    """
    knots = pieces.knots
    width = float(np.diff(knots).min()) / 2
    ends = np.unique(np.clip([knots[0], *breaks, knots[-1]], knots[0], knots[-1]))
    if ends[-1] - ends[0] > LOOKS_PER_PIECE * len(knots) * width:
        return 0.0
    counts = np.maximum(np.round(np.diff(ends) / width).astype(int), 1)
    stretches = [
        pieces.beside(start + (end - start) * (np.arange(count) + 0.5) / count)
        for start, end, count in zip(ends[:-1], ends[1:], counts.tolist(), strict=True)
    ]
    window, looks = 0.0, LOOKS_OF_WINDOW
    while all(_is_smooth(values, looks, error) for values in stretches):
        if looks >= counts.max():
            return inf
        window, looks = looks * width, 2 * looks
    return window


def _is_smooth(values: Floats, looks: int, error: float) -> bool:
    """Whether a polynomial of RECORD_DEGREE is right to the error in all windows of this many of the values (T,)."""
    looks = min(looks, len(values))
    basis, _ = np.linalg.qr(
        np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, looks), min(RECORD_DEGREE, looks - 1))
    )
    windows = np.lib.stride_tricks.sliding_window_view(values, looks)
    chosen = np.concatenate((windows[:: max(looks // 2, 1)], windows[-1:]))
    fit = np.einsum("lk,wk->wl", basis, np.einsum("wl,lk->wk", chosen, basis))
    return bool(np.abs(chosen - fit).max() <= error)
