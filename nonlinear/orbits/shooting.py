"""Periodic orbits of any scene in the plane by multiple shooting.

The period T is divided into equal segments that begin at y_0, y_1, …:

    φ_{T/m}(y_k) = y_{k+1},   φ_{T/m}(y_{m−1}) = y_0

with T unknown unless drives of that period set it; then angles may gain full turns in it [Keller1976], [Seydel2010, ch.
7]. The phase of a free oscillation is chosen so that one link turns back at the start, or with dry friction, which
stops there, passes its angle at rest to the right; a free cart starts at 0, supports at 0 in the mean. In
a conservative scene these equations follow from each other in part, and solutions form families. A number of the scene
may be a further unknown.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from modal.errors import ComputationError, SceneError
from modal.scene import Scene, drive_period, require
from modal.scene.parameters import Variable, Variation, find_places, vary, with_numbers
from modal.types import Floats
from nonlinear.dynamics.variational import Force
from nonlinear.integration.switches import numbers_of as switching_of
from nonlinear.orbits.continuation import place_in, value_in
from nonlinear.orbits.floquet import Floquet, of_monodromy, scaled_translations
from nonlinear.orbits.flow import ORBIT_TOLERANCE, Arrival, Flow, NumberChange, Path
from nonlinear.orbits.orbit import Orbit
from nonlinear.system import system_of, translations

TOLERANCE_MIN = 1e-15
"""Limit: least `tolerance`, "must be a finite number from 1e-15 to 0.01"."""
TOLERANCE_MAX = 1e-2
"""Limit: largest `tolerance`."""


@dataclass(frozen=True)
class Clock:
    """The period (s) that drives set; where their common frequency is the number that is varied, at this `value` of it.

    >>> Clock(2.0, value=0.5).period(0.25)
    4.0
    """

    seconds: float
    value: float | None = None

    def period(self, value: float | None) -> float:
        """The period (s) at a value of the number."""
        return self.seconds if self.value is None or value is None else self.seconds * self.value / value

    def slope(self, value: float | None) -> float:
        """Its derivative by the number."""
        return 0.0 if self.value is None or value is None else -self.period(value) / value


@dataclass(frozen=True, eq=False)
class FlowAt:
    """The flow of a scene for a value of the `variation`, with its change with that number; for None of itself."""

    scene: Scene
    variation: Variation | None
    capability: str
    tolerance: float
    force: Force | None

    def __getstate__(self) -> dict[str, Any]:
        """Without the flows that were made."""
        return {attribute.name: getattr(self, attribute.name) for attribute in fields(self)}

    def __call__(self, value: float | None) -> Flow:
        """The flow, cached for the values requested last."""
        return self._cache(value)

    @cached_property
    def _cache(self) -> Callable[[float | None], Flow]:
        return lru_cache(maxsize=8)(self._make)

    def _make(self, value: float | None) -> Flow:
        scene = self.scene if value is None or self.variation is None else self._scene_at(value)
        require(scene, self.capability)
        flow = Flow(system_of(scene), self.tolerance, force=self.force)
        if value is None or self.variation is None:
            return flow
        return replace(flow, change=_change(self._scene_at, value, flow))

    @cached_property
    def _scene_at(self) -> Callable[[float], Scene]:
        path = self.variation.path if self.variation else ""
        variable = Variable(self.scene, [path])
        return lambda value: variable.at({path: value})


@dataclass(frozen=True, eq=False)
class Shooting:
    """The equations of periodic orbits: u = (y_0, …, y_{m−1} in natural units, T sqrt(g/l), place in the range).

    `flow_at` gives the flow for a value of the `variation` (None: of the scene itself); the `leader` (from 0) turns
    back at the start, or passes rest there (`passes`). With a `clock`, T is no unknown and there is no leader; it has
    `cycles` periods of the drives, and links gain `turns` (L,) full turns in it.
    """

    scene: Scene
    flow_at: FlowAt
    leader: int = 0
    segments: int = 2
    clock: Clock | None = None
    variation: Variation | None = None
    cycles: int = 0
    turns: tuple[int, ...] = ()

    @cached_property
    def first(self) -> Flow:
        """The flow that sets the units."""
        return self.flow_at(self.variation.values[0] if self.variation else None)

    @property
    def size(self) -> int:
        """Length of y."""
        return len(self.first.scale)

    @cached_property
    def conservative(self) -> bool:
        """Whether energy is conserved except for drives in time: multipliers come in pairs μ, 1/μ."""
        system = self.first.system
        works = system.dissipates or system.excites or system.hoisting is not None
        return not (works or self.first.force or self.first.switched_equations)

    @cached_property
    def gain(self) -> Floats:
        """The increment of y over a period, in natural units, (d,)."""
        gain, layout = np.zeros(self.size), self.first.equations.layout
        if self.turns:
            gain[layout.first : layout.half] = 2 * np.pi * np.array(self.turns)
        return gain / self.first.scale

    @cached_property
    def free(self) -> Floats:
        """Translations (m) of a free cart or of free supports, (k, first)."""
        moves = translations(self.first.system)
        return moves[:0] if self.first.force else moves

    # -------------------------------------------------------------------------------------------------- unknowns

    def unknown(self, states: Floats, period: float, value: float | None = None) -> Floats:
        """The vector u of the beginnings of all segments (m, d), the period (s) and the value of the number."""
        parts = [(states / self.first.scale).ravel()]
        if self.clock is None:
            parts.append(np.array([period * self.first.system.rate]))
        if self.variation:
            assert value is not None
            parts.append(np.array([place_in(self.variation, value)]))
        return np.concatenate(parts)

    def period(self, u: Floats) -> float:
        """The period (s)."""
        if self.clock:
            return self.clock.period(self.value(u))
        return float(u[self.segments * self.size]) / self.first.system.rate

    def states(self, u: Floats) -> Floats:
        """The beginnings of all segments, (m, d)."""
        return np.asarray(u[: self.segments * self.size].reshape(self.segments, -1) * self.first.scale)

    def value(self, u: Floats) -> float | None:
        """The value of the number, None without one."""
        return value_in(self.variation, float(u[-1])) if self.variation else None

    # -------------------------------------------------------------------------------------------------- equations

    def equations(self, u: Floats) -> tuple[Floats, Floats]:
        """How far the segments miss each other, in natural units, and the derivatives."""
        flow, states, period = self.flow_at(self.value(u)), self.states(u), self.period(u)
        m, d, scale = self.segments, self.size, self.first.scale
        ends = self._arrivals(flow, states, period)
        r, J = np.zeros(m * d), np.zeros((m * d, len(u)))
        for k, end in enumerate(ends):
            rows, following = slice(k * d, (k + 1) * d), (k + 1) % m
            r[rows] = (end.y - states[following]) / scale
            J[rows, k * d : (k + 1) * d] += end.V[:, :d] / scale[:, None]
            J[rows, following * d : (following + 1) * d] -= np.eye(d)
            if self.clock is None:
                J[rows, m * d] = end.path.rates[-1] / scale / m / self.first.system.rate
        r[-d:] -= self.gain
        if self.variation:
            J[:, -1] = self._by_value(self.variation, u, flow, ends)
        conditions, offset = self._conditions(len(u))
        return np.concatenate((r, conditions @ u - offset)), np.vstack((J, conditions))

    def _arrivals(self, flow: Flow, states: Floats, period: float) -> list[Arrival]:
        """The ends of all segments, with derivatives by their beginnings in natural units."""
        part, V = period / self.segments, np.diag(self.first.scale)
        return [flow(y, V, part, start=k * part) for k, y in enumerate(states)]

    def _by_value(self, variation: Variation, u: Floats, flow: Flow, ends: list[Arrival]) -> Floats:
        """The derivative of the ends by the place of the number, (m d,)."""
        place, low, high = float(u[-1]), variation.values[0], variation.values[-1]
        stretch = value_in(variation, place) * np.log(high / low) if variation.log else high - low
        shifts = np.concatenate([self._time_shift(k, end, u) for k, end in enumerate(ends)])
        if flow.change is not None:
            value_slopes = np.concatenate([end.V[:, -1] / self.first.scale for end in ends])
            return np.asarray(value_slopes + shifts) * stretch
        # the form of the equations changes with the number: a one-sided difference into the range, of which rounding
        # and curvature take equal parts
        nudge = float(np.copysign(flow.tolerance**0.5, 0.5 - place))
        flow, none = self.flow_at(value_in(variation, place + nudge)), np.zeros((self.size, 0))
        part = self.period(u) / self.segments
        neighbours = [flow(y, none, part, start=k * part).y for k, y in enumerate(self.states(u))]
        slopes = [
            (neighbour - end.y) / self.first.scale / nudge for neighbour, end in zip(neighbours, ends, strict=True)
        ]
        return np.concatenate(slopes) + shifts * stretch

    def _time_shift(self, k: int, end: Arrival, u: Floats) -> Floats:
        """The effect of a change of the number on the end of segment k, in natural units, by its time alone."""
        slope = self.clock.slope(self.value(u)) / self.segments if self.clock else 0.0
        if not slope:
            return np.zeros(self.size)
        scale, rates = self.first.scale, end.path.rates
        start_slope = end.V[:, : self.size] @ (rates[0] / scale)
        return np.asarray(slope * ((k + 1) * rates[-1] - k * start_slope) / scale)

    @cached_property
    def passes(self) -> bool:
        """Whether the leader passes its angle at rest at the start."""
        return bool(self.first.equations.form.contacts)

    def _conditions(self, length: int) -> tuple[Floats, Floats]:
        """Rows that fix the phase and the place of the cart, and their values."""
        layout, rows, offsets = self.first.equations.layout, [], np.zeros(length)
        place = layout.first + self.leader
        if self.clock is None:
            rows.append(place if self.passes else layout.half + place)
            offsets[place] = self.first.rest[place] / self.first.scale[place] if self.passes else 0.0
        conditions, offset = np.eye(length)[rows], offsets[rows]
        translation_rows = np.pad(self._scaled_translations, ((0, 0), (0, length - self.size)))
        return np.vstack((conditions, translation_rows)), np.append(offset, np.zeros(len(translation_rows)))

    @cached_property
    def _scaled_translations(self) -> Floats:
        """The effect of translations on y, in natural units, by at most 1, (k, d)."""
        return scaled_translations(self.free, self.first.scale)

    def centred_state(self, y: Floats) -> Floats:
        """The same y moved along free coordinates to its start, the sum of such displacements being 0."""
        centred_y = y.copy()
        for translation in self.free:
            centred_y[: len(translation)] -= translation * (
                translation @ centred_y[: len(translation)] / (translation @ translation)
            )
        return centred_y

    # -------------------------------------------------------------------------------------------------- solutions

    def orbit(self, u: Floats) -> Orbit:
        """The orbit of a solution, with its multipliers."""
        value = self.value(u)
        flow, states, period = self.flow_at(value), self.states(u), self.period(u)
        ends = self._arrivals(flow, states, period)
        scale, M = self.first.scale, np.eye(self.size)
        for end in ends:
            M = (end.V[:, : self.size] / scale[:, None]) @ M
        gaps = (np.array([end.y for end in ends]) - np.roll(states, -1, axis=0)) / scale
        gaps[-1] -= self.gain
        floquet = self._multipliers(flow, states[0], ends[0].path.rates[0], M)
        path = _join([end.path for end in ends], period / self.segments)
        scene = vary(self.scene, {self.variation.path: value}) if self.variation and value is not None else self.scene
        residual = float(np.abs(gaps).max())
        return Orbit(scene, flow, states[0], period, floquet, residual, path, False, value, self.cycles, self.turns)

    def _multipliers(self, flow: Flow, y: Floats, rates: Floats, M: Floats) -> Floquet:
        """The multipliers from the monodromy matrix in natural units, and y' at the start."""
        equations, scale, right, left = flow.equations, self.first.scale, [], []
        if self.clock is None:
            right.append(rates / scale)
        for translation, shift in zip(self.free, self._scaled_translations, strict=True):
            slopes = [slope * scale for slope in self._conserved_slopes(flow, y, translation)]
            left += slopes
            if not slopes or not slopes[0][0]:
                right.append(shift)
        if self.conservative and self.clock is None:
            left.append(equations.energy_slope(y) * scale)
        return of_monodromy(M, right, left, conservative=self.conservative)

    def _conserved_slopes(self, flow: Flow, y: Floats, translation: Floats) -> list[Floats]:
        """The derivative by y of the momentum that a translation conserves, none where it is not conserved."""
        system = flow.system
        if system.structure is None:
            # quadratic drag takes momentum that its impulse does not account for
            has_drag = any(group.quadratic_drag is not None or group.point_forces for group in system.groups)
            return [] if has_drag else [flow.equations.momentum_slope(y)]
        if system.dissipates:
            return []
        half = flow.equations.layout.half
        return [flow.equations.impulse_slope(y, np.pad(translation, (0, half - len(translation))))]

    def energy_slope(self, u: Floats, tangent: Floats) -> float:
        """The derivative of the energy (J) at the start along a branch."""
        d = self.size
        return float(self.first.equations.energy_slope(self.states(u)[0]) @ (tangent[:d] * self.first.scale))


def _join(paths: list[Path], part: float) -> Path:
    times = np.concatenate([path.times + k * part for k, path in enumerate(paths)])
    return Path(times, np.vstack([path.states for path in paths]), np.vstack([path.rates for path in paths]))


def shooting(
    scene: Scene,
    *,
    leader: int = 0,
    tolerance: float = ORBIT_TOLERANCE,
    segments: int = 2,
    force: Force | None = None,
    variation: Variation | None = None,
    cycles: int = 0,
) -> Shooting:
    """The equations of a scene in the plane, with the period of this many `cycles` of its drives, if any.

    SceneError in space, and where the scene has what periodic orbits do not follow.
    """
    capability = "a forced periodic orbit" if cycles else "a periodic orbit"
    require(scene, capability)

    flow_at = FlowAt(scene, variation, capability, tolerance, force)
    clock = _clock(scene, variation, cycles) if cycles else None
    return Shooting(scene, flow_at, leader, segments, clock, variation, cycles)


def _clock(scene: Scene, variation: Variation | None, cycles: int) -> Clock:
    """The clock of a scene's drives; raise SceneError if they have no common period or only some frequencies vary."""
    if variation is None:
        return Clock(cycles * drive_period(scene).seconds)
    value = variation.values[0]
    varied_places = {with_numbers(place) for place in find_places(scene, variation.path)}
    drives = drive_period(vary(scene, {variation.path: value}))
    moved_places = [place for place in drives.places if place in varied_places]
    fixed_places = [f"{place} is not varied with it" for place in drives.places if place not in varied_places]
    if moved_places and fixed_places:
        raise SceneError([f"{variation.path}: must be the frequency of every drive: {', '.join(fixed_places)}"])
    return Clock(cycles * drives.seconds, value if moved_places else None)


def _change(scene_at: Callable[[float], Scene], value: float, flow: Flow) -> NumberChange | None:
    """The derivative of the numbers of the equations by a number of the scene, by central differences.

    None if a scene next to has another form, as a number is 0 there.
    """
    samples, aside = [], float(np.finfo(float).eps ** (1 / 3)) * abs(value)
    reference = switching_of(flow.system)
    for neighbour_value in (value - aside, value + aside):
        try:
            system = system_of(scene_at(neighbour_value))
        except SceneError:
            return None
        equations = replace(flow.equations, system=system)
        switching = switching_of(system)
        if equations.form != flow.equations.form or len(switching) != len(reference):
            return None
        samples.append((np.array(equations.numbers), np.array(switching)))
    if not aside:
        return None
    return NumberChange(*((after - before) / (2 * aside) for before, after in zip(*samples, strict=True)))


def spread(problem: Shooting, flow: Flow, y: Floats, period: float) -> Floats:
    """The beginnings of all segments (m, d) on the motion from y."""
    states, none, part = [y], np.zeros((len(y), 0)), period / problem.segments
    for k in range(problem.segments - 1):
        states.append(flow(states[-1], none, part, start=k * part).y)
    if not np.all(np.isfinite(states)):
        raise ComputationError("the motion leaves all bounds within a period")
    return np.array(states)
