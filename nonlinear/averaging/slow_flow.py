"""Averaged equations integrated in time: which modes grow, which decay, and when one remains."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import ceil, pi

import numpy as np

from modal.errors import ComputationError
from modal.report import Displayed
from modal.types import Booleans, Complexes, Floats
from nonlinear.averaging.equations import AveragedEquations, derivative

STEP_GROWTH_MAX = 0.4
"""Tolerance: largest growth within a step, of which the method of fourth order errs by 1e-4."""
STEP_TURN_MAX = 1.0
"""Tolerance: largest rotation (rad) within a step, which Lawson's form takes exactly except for the rotated terms."""
BEAT_PLACES = 8
"""Tolerance: places within a step at which amplitudes that rotate freely are sampled: they miss 8 % of a beat."""
SLOW_FIRST_PERIODS = 64
"""Cost: fast periods in the first part; benchmarks/sync/survivors.py."""
SLOW_STEPS_MAX = 6000
"""Limit: "averaged equations need more than 6000 steps"."""
PART_TIMES = 50
"""Cost: times stored of a part, a third of them where only its end counts; benchmarks/sync/survivors.py."""
STEADY_CHANGE_MAX = 0.1
"""Cost: change of amplitudes that keeps the pace; benchmarks/sync/survivors.py."""
HASTE_MAX = 1.5
"""Tolerance: change of the pace that keeps the step: errors grow with its fourth power, to the fivefold."""
STOPPED_AMPLITUDE_RATIO = 0.01
"""Physics: fall of amplitudes within an interval that dry friction alone causes: it stops them there."""
CALM_ENERGY_RATIO = 1e-3
"""Tolerance: of the energy, the part that may change rows in half the time of a settled motion; a tenth of LOCKED."""
LONE_ENERGY_RATIO = 3e-4
"""Tolerance: of the energy, the share of all other rows once one has won: enough below LOCKED."""
DEAD_AMPLITUDE_RATIO = 1e-4
"""Limit: of the initial amplitude, below which the motion, or one of its bands, "dies out"."""
LOCKED = 0.01
"""Limit: largest fraction of the energy outside the locked mode, as "99 % of the energy" says."""
AVERAGED_ANGLE_MAX = pi
"""Limit: largest angle (rad): beyond it links turn over, and "drives are too strong for averaged equations"."""


@dataclass(frozen=True, eq=False, repr=False)
class SlowFlow(Displayed):
    """Amplitudes z (C, T) at `times` (T,) in s, whether they have settled, and the least `reach` of escapements.

    The reach (`AveragedEquations.reach`) is the least at any time, also within a beat between two times.
    """

    averaged: AveragedEquations
    times: Floats
    z: Complexes
    settled: bool
    reach: float = np.inf

    @cached_property
    def share(self) -> Floats:
        """Fraction of the energy in every row of the table, (R, T); all 0 if nothing moves."""
        energy = self.averaged.energies(self.z)
        total = energy.sum(axis=0)
        return np.asarray(np.divide(energy, total, out=np.zeros_like(energy), where=total > 0))

    @property
    def dies(self) -> bool:
        """Whether the motion has died out."""
        return bool(np.abs(self.z[:, -1]).max() <= DEAD_AMPLITUDE_RATIO * np.abs(self.z[:, 0]).max())

    @property
    def survivor(self) -> int:
        """The row with most energy at the end, from 0."""
        return int(self.share[:, -1].argmax())

    def locking_time(self, threshold: float = LOCKED) -> float | None:
        """The time (s) from which all rows but the survivor stay below this fraction of the energy; None if never."""
        return below_for_good(self.times, 1 - self.share[self.survivor], threshold)


def below_for_good(times: Floats, values: Floats, threshold: float) -> float | None:
    """The time from which values (T,) stay below the threshold, interpolated linearly; None if they end above it.

    A NaN counts as above the threshold, up to the next sample.
    """
    exceedances = np.flatnonzero(~(values <= threshold))
    if not len(exceedances):
        return float(times[0])
    last = int(exceedances[-1])
    if last == len(times) - 1:
        return None
    high, low = values[last], values[last + 1]
    if not np.isfinite(high):
        return float(times[last + 1])
    return float(times[last] + (times[last + 1] - times[last]) * (high - threshold) / (high - low))


@dataclass
class _Stretch:
    """Amplitudes z (C, S) with a number of steps of h (s) to take, and the rotation rates (B, S) of their bands.

    `pace` is the number of steps per second that suits them, `reach` (S,) the least of escapements so far.
    """

    z: Complexes
    turning: Floats
    pace: float
    reach: Floats
    h: float = 0.0
    steps: int = 0


Settling = Generator[_Stretch, None, tuple[SlowFlow, ...]]  # yields a stretch, and continues from its end


def settle(
    equations: AveragedEquations, starts: Complexes, max_steps: int = SLOW_STEPS_MAX, shortest: float = 0.0
) -> tuple[SlowFlow, ...]:
    """The slow flow from each of these amplitudes (C, S) until all have settled, or for `max_steps` steps.

    Each is followed for at least `shortest` seconds, however little changes, because motions leave an unstable state
    slowly. Pendula that drift past each other never settle; motions that grow beyond half a turn are not
    followed any further.
    """
    return _follow(equations, [_settling(equations, starts, max_steps, shortest)])[0]


def settle_apart(
    averaged_equations: AveragedEquations, starts: Complexes, active: Booleans, max_steps: int = SLOW_STEPS_MAX
) -> Iterator[Complexes]:
    """The end (C,) of the same from each start, restricted to its retained modes (C, S).

    Each has its own steps, HASTE_MAX times as long, and few of them where the motion is slow.
    """
    restrictions = [
        averaged_equations if modes.all() else averaged_equations.restricted_to(modes) for modes in active.T
    ]
    pairs = zip(restrictions, starts.T, strict=True)
    motions = [_settling(equations, start[:, None], max_steps, 0.0, coarse=True) for equations, start in pairs]
    yield from (motion.z[:, -1] for (motion,) in _follow(averaged_equations, motions, active))


@np.errstate(all="ignore")
def _follow(
    equations: AveragedEquations, motions: Sequence[Settling], active: Booleans | None = None
) -> list[tuple[SlowFlow, ...]]:
    """The results of all motions, advanced together: evaluating few pendula costs as much as many."""
    flows: dict[int, tuple[SlowFlow, ...]] = {}
    going = dict(enumerate(map(next, motions)))
    while going:
        _advance(equations, list(going.values()), None if active is None else active[:, list(going)])
        for number in [number for number, stretch in going.items() if not stretch.steps]:
            try:
                going[number] = next(motions[number])
            except StopIteration as ended:
                flows[number] = ended.value
                del going[number]
    return [flows[number] for number in range(len(motions))]


def _settling(
    equations: AveragedEquations, starts: Complexes, max_steps: int, shortest: float, coarse: bool = False
) -> Settling:
    state = _begin_stretch(equations, starts, equations.reach(starts))
    until = min(SLOW_FIRST_PERIODS * 2 * pi / float(equations.omega.min()), max_steps / state.pace)
    state, times, z = yield from _part(equations, state, 0.0, until, coarse)
    going = _going(equations, z, starts)
    while (going.any() or times[-1] < shortest) and not runs_away(equations, state.z):
        state, last = _begin_stretch(equations, state.z, state.reach), float(times[-1])
        if last * state.pace >= max_steps / 2:
            break
        state, more_times, further = yield from _part(equations, state, last, last, coarse)
        going = _going(equations, further, starts)
        times, z = np.append(times, more_times[1:]), np.concatenate((z, further[..., 1:]), axis=-1)
    results = zip(np.moveaxis(z, 1, 0), ~going, state.reach.tolist(), strict=True)
    return tuple(
        SlowFlow(equations, times, amplitudes, bool(is_settled), reach) for amplitudes, is_settled, reach in results
    )


def _begin_stretch(equations: AveragedEquations, z: Complexes, reach: Floats) -> _Stretch:
    """The motions that begin with amplitudes (C, S)."""
    turning = equations.turning(z)
    return _Stretch(z, turning, _pace(equations, z, turning), reach)


def runs_away(equations: AveragedEquations, z: Complexes) -> bool:
    """Whether any of these amplitudes (C, ...) is beyond the range of averaged equations."""
    return not equations.largest(z) <= AVERAGED_ANGLE_MAX


def _part(
    equations: AveragedEquations, state: _Stretch, begin: float, duration: float, coarse: bool
) -> Generator[_Stretch, None, tuple[_Stretch, Floats, Complexes]]:
    """The state at the end, and amplitudes at PART_TIMES + 1 times, in steps that fit both ends of every interval.

    If only the end counts (`coarse`), at times a step apart where that is longer, and its rates Ω set the pace.
    """
    width, count = 1.0, PART_TIMES
    if coarse:  # Newton's method corrects the end
        width = HASTE_MAX
        count = min(PART_TIMES, max(PART_TIMES // 3, ceil(duration * state.pace / width)))
    span, amplitudes = duration / count, [state.z]
    while len(amplitudes) <= count:
        if len(amplitudes) > 1 and runs_away(equations, state.z):
            amplitudes += [state.z] * (count + 1 - len(amplitudes))
            break
        steps = max(1, ceil(span * state.pace / width))
        yield (further := replace(state, h=span / steps, steps=steps))
        z, before = further.z, np.abs(state.z)
        if equations.system.rubs:  # dry friction has brought the motion to rest within the interval
            z = np.where(np.abs(z).max(axis=0) <= STOPPED_AMPLITUDE_RATIO * before.max(axis=0), 0.0, z)
        further.z = z
        if np.abs(before - np.abs(z)).max() > STEADY_CHANGE_MAX * before.max():
            turning = further.turning if coarse else equations.turning(z)
            further.pace = 2 * state.pace if runs_away(equations, z) else _pace(equations, z, turning)
        if further.pace <= HASTE_MAX * state.pace:
            state, amplitudes = further, [*amplitudes, z]
        elif duration / PART_TIMES * further.pace <= SLOW_STEPS_MAX:
            state.pace = further.pace
        elif runs_away(equations, z):
            state, amplitudes = further, amplitudes + [z] * (count + 1 - len(amplitudes))
        else:
            raise ComputationError(f"averaged equations need more than {SLOW_STEPS_MAX} steps for {span:.3g} s")
    return state, begin + np.linspace(0.0, duration, count + 1), np.moveaxis(np.array(amplitudes), 0, -1)


def _advance(equations: AveragedEquations, stretches: Sequence[_Stretch], active: Booleans | None) -> None:
    """Advance to the first end of a stretch, by Lawson's form of the Runge–Kutta method."""
    states = ((stretch.z, stretch.turning, stretch.reach) for stretch in stretches)
    z, turning, reach = (np.hstack(parts) for parts in zip(*states, strict=True))
    h = np.concatenate([np.full(stretch.z.shape[1], stretch.h) for stretch in stretches])
    steps = min(stretch.steps for stretch in stretches)
    for _ in range(steps):
        a, spin = equations.forcing(z, turning, active), 1j * equations.detuning(turning)
        if active is None and equations.system.has_escapements:  # otherwise only the end counts
            # the least while amplitudes rotate freely through a step, as in a beat
            places = z[..., None] * np.exp((h * spin)[..., None] * np.arange(BEAT_PLACES) / BEAT_PLACES)
            reaches = equations.reach(places.reshape(len(z), -1)).reshape(-1, BEAT_PLACES)
            reach = np.minimum(reach, reaches.min(axis=-1))
        turn = np.exp(h / 2 * spin)
        half = turn * z
        b = equations.forcing(half + h / 2 * turn * a, turning, active)
        c = equations.forcing(half + h / 2 * b, turning, active)
        d = equations.forcing(turn * half + h * turn * c, turning, active)
        turning, z = (
            equations.rotation_rates(turning, z, a + spin * z),
            turn * half + h / 6 * (turn**2 * a + 2 * turn * (b + c) + d),
        )
    ends = np.cumsum([stretch.z.shape[1] for stretch in stretches])[:-1]
    for stretch, *parts in zip(
        stretches, *(np.split(part, ends, axis=-1) for part in (z, turning, reach)), strict=True
    ):
        stretch.z, stretch.turning, stretch.reach = parts
        stretch.steps -= steps


def _pace(equations: AveragedEquations, z: Complexes, turning: Floats) -> float:
    """Steps per second from these amplitudes (C, S) on; modes that are omitted set no pace."""
    is_active, moving = equations.shapes.any(axis=0), z.any(axis=0)
    drift = float(np.abs(equations.detuning(turning)[is_active]).max()) / STEP_TURN_MAX
    if not moving.any():
        return drift
    both_parts = np.tile(is_active, 2)
    slopes = derivative(equations.smooth, z[:, moving], turning[:, moving])[:, both_parts][:, :, both_parts]
    return max(float(np.linalg.norm(slopes, 2, axis=(1, 2)).max()) / STEP_GROWTH_MAX, drift)


def _going(equations: AveragedEquations, z: Complexes, starts: Complexes) -> Booleans:
    """Which of the motions (C, S, T) are still undecided, (S,): neither settled nor dead nor one growing row."""
    energy = equations.energies(z[..., z.shape[-1] // 2 :])
    total = energy.sum(axis=0)
    changing = np.ptp(energy, axis=-1).max(axis=0) > CALM_ENERGY_RATIO * total.max(axis=-1)
    others = 1 - energy.max(axis=0) / np.where(total > 0, total, 1.0)
    falling = total[:, -1] < (1 - CALM_ENERGY_RATIO) * total[:, 0]
    open_yet = falling | (others.max(axis=-1) > LONE_ENERGY_RATIO)
    alive = np.abs(z[..., -1]).max(axis=0) > DEAD_AMPLITUDE_RATIO * np.abs(starts).max(axis=0)
    return np.asarray(changing & open_yet & alive)
