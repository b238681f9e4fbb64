"""Stroboscopic sections: a driven scene sampled once per period of its drives, and after how many periods it repeats.

    t_k = (φ/360° + k) T,    y(t_{k+p}) = y(t_k) + 2π n

A motion of period p comes back after p periods T, its links by n full turns further: p points of the section; one that
is quasi-periodic fills a curve, a chaotic one a strange attractor.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import ceil, inf, isfinite, radians
from typing import Any

import numpy as np

from modal.errors import MultipendulaError, SceneError, refuse_any
from modal.modes import natural_modes
from modal.report import Form, counted, silent
from modal.scene import Scene, drive_period, require, validate_scene
from modal.scene.doors import checked, formerly
from modal.scene.parameters import texts_of
from modal.types import Floats, Ints
from nonlinear.averaging.prediction import E_FOLDING_TIMES
from nonlinear.chaos.lyapunov import nearby
from nonlinear.ensembles.measures import places
from nonlinear.ensembles.running import Ensemble, EnsembleResult, ensemble
from nonlinear.integration import validate, validate_whole
from nonlinear.postprocessing.returns import JUDGED_STROBES, REPEAT_PERIODS_MAX, natural_units, repetition
from nonlinear.reduction import usual_start
from nonlinear.synchronization.study import USUAL_PERIODS
from nonlinear.system import System, system_of

# ------------------------------------------------------------------------------------------------------- in time


def strobe_times(period: float, phase_deg: float = 0.0, *, settle: float = 0.0, count: int = JUDGED_STROBES) -> Floats:
    """The first `count` times (s) from `settle` (s) on at which the drives are at a phase (deg) of their period (s).

    >>> strobe_times(2.0, 90.0, settle=3.0, count=3).tolist()
    [4.5, 6.5, 8.5]
    """
    part = phase_deg / 360 % 1.0
    first = max(ceil(settle / period - part - 1e-9), 0)
    return np.asarray((part + first + np.arange(count)) * period)


def settling_time(scene: Scene, period: float) -> float:
    """Ten times the slowest decay of the modes (s), where there is one, and at least 200 periods."""
    try:
        decay = [-float(value.real) for value in natural_modes(scene).eigenvalue if value.real < 0]
    except MultipendulaError:
        decay = []
    return max(E_FOLDING_TIMES / min(decay) if decay else 0.0, USUAL_PERIODS * period)


def repetition_words(period: Ints) -> str:
    """Return how many motions have which period.

    >>> repetition_words(np.array([1, 2, 2, 0]))
    '1 motion has period 1, 2 motions have period 2, 1 motion does not repeat within 16 periods, or not yet'
    """
    lines = [
        f"{counted(count, 'motion has', 'motions have')} period {p}"
        for p, count in sorted(Counter(period.tolist()).items())
        if p
    ]
    if count := int(np.count_nonzero(period == 0)):
        lines.append(
            f"{counted(count, 'motion does', 'motions do')} not repeat within {REPEAT_PERIODS_MAX} periods, or not yet"
        )
    return ", ".join(lines)


# ------------------------------------------------------------------------------------------------------- the section


@dataclass(frozen=True, eq=False, repr=False)
class StroboscopicSection(EnsembleResult):
    """Stroboscopic samples at `times` (K,) in s, once a `period` (s) at `phase_deg` of it, from `settle` (s) on.

    Starts lie within `spread_deg` of the scene's; `shown` are the links that are drawn, from 0.
    """

    ensemble: Ensemble
    times: Floats
    period: float
    phase_deg: float
    spread_deg: float
    settle: float
    shown: tuple[int, ...]

    what, key = "stroboscopic section", "strobes"
    figure = "nonlinear.plotting.ensembles:strobes_figure"

    @property
    def states(self) -> list[Floats]:
        """Angles of links and their rates, (S, K, L), place and speed of the cart, (S, K), at the stroboscopic samples.

        On a structure its coordinates and their rates, (S, K, d), follow.
        """
        return [part[:, -len(self.times) :] for part in self.ensemble.states()]

    @property
    def repeats(self) -> Ints:
        """After how many periods each motion repeats, by its last samples, (S,); 0 for none."""
        states = [rows[:, -JUDGED_STROBES:] for rows in self.states]
        return repetition(natural_units(self.system, states), self.system.n_links)[0]

    def points(self, link: int) -> tuple[Floats, Floats]:
        """The angle of a link in (−180°, 180°] and its rate in °/s, (S, K) each."""
        angle, rate = (np.degrees(rows[..., link]) for rows in self.states[:2])
        return within_a_turn(angle), rate

    def facts(self) -> dict[str, Any]:
        """The sampling times, and the method."""
        return {
            "period_s": self.period,
            "phase_deg": self.phase_deg,
            "spread_deg": self.spread_deg,
            "settle_s": self.settle,
            **self.ensemble.record(),
            "repeats_after_periods": self.repeats.tolist(),
        }

    def records(self) -> Iterator[dict[str, Any]]:
        """A row for each sample: which motion from 1, the time, angles, rates and the cart."""
        times, states = self.times.tolist(), self.states
        for motion in range(self.ensemble.size):
            of_motion = state_records(self.system, [part[motion] for part in states])
            for time, record in zip(times, of_motion, strict=True):
                yield {"motion": motion + 1, "time_s": time} | record

    def parts(self, form: Form = "text") -> Iterator[str]:
        """The number of motions, the sampling times, and after how many periods they repeat."""
        motions, times = counted(self.ensemble.size, "motion", "motions"), counted(len(self.times), "time", "times")
        lines = [
            f"{motions} of {self.ensemble.question.duration:.4g} s, sampled once per period of {self.period:.6g} s, "
            f"at {self.phase_deg:g}°, {times} from {self.times[0]:.4g} s on",
            f"starts within {self.spread_deg:g}° of the scene's",
            repetition_words(self.repeats),
            self.ensemble.words(),
        ]
        yield "\n".join(lines)


def within_a_turn(angle: Floats) -> Floats:
    """Angles (deg) in (−180°, 180°].

    >>> within_a_turn(np.array([190.0, -180.0])).tolist()
    [-170.0, 180.0]
    """
    return np.asarray(180 - (180 - angle) % 360)


@formerly(orbits="members")
def find_strobes(
    scene: Scene,
    duration: float | None = None,
    *,
    phase_deg: float = 0.0,
    spread_deg: float = 10.0,
    settle: float = 0.0,
    members: int = 24,
    of: str | Sequence[str] = (),
    seed: int = 7,
    report: Callable[[float], object] = silent,
    **options: Any,
) -> StroboscopicSection:
    """Compute the stroboscopic section of a plane scene driven by sines, from many starts.

    Each of `members` motions begins as the scene does, all but the first with angles up to `spread_deg` aside, drawn by
    `seed`, and is sampled once a period, at `phase_deg` of it, from `settle` (s) to the `duration` (s), by default
    200 periods later. `of` names the links to draw, "theta_1_1". `options` are those of `ensemble`. Raise SceneError
    for a scene without a common period of its drives, and where nothing would be seen.

    >>> from modal import Bob, Pendulum, Scene
    >>> from modal.scene import SineForce
    >>> push = SineForce(on="pendulum[0].links[0]", amplitude=1.0, frequency_hz=0.5)
    >>> links = [Bob(mass=1.0, length=1.0, damping=2.0)]
    >>> scene = Scene(gravity=9.81, pendulum=[Pendulum(links=links, start={"angles_deg": [20.0]})], force=[push])
    >>> found = find_strobes(scene, 60.0, settle=20.0, members=2, workers=1)
    >>> found.period, found.times.tolist()[:3], found.repeats.tolist()
    (2.0, [20.0, 22.0, 24.0], [1, 1])
    """
    validate_scene(scene)
    require(scene, "a stroboscopic section")
    validate(
        lambda: validate_whole(1, members=members),
        lambda: validate_whole(0, seed=seed),
        lambda: validate_strobes(phase_deg=phase_deg, spread_deg=spread_deg, settle=settle),
    )
    period, system = drive_period(scene).seconds, system_of(scene)
    shown = links_named(of, system)
    until = settle + USUAL_PERIODS * period if duration is None else duration
    times = strobe_times(period, phase_deg, settle=settle, count=max(int((until - settle) / period) + 1, 1))
    times = times[times <= until * (1 + 1e-12)]
    if not len(times):
        raise SceneError(
            [f"duration {until:g} s: no stroboscopic sample comes after {settle:g} s, at a period of {period:.4g} s"]
        )
    starts = nearby(usual_start(scene), members, radians(spread_deg), np.random.default_rng(seed))
    motions = ensemble(scene, max(until, times[-1]), starts=starts, output=times.tolist(), report=report, **options)
    return StroboscopicSection(motions.require(), times, period, phase_deg, spread_deg, settle, shown)


def links_named(names: str | Sequence[str], system: System) -> tuple[int, ...]:
    """The links, from 0, of names such as "theta_1_2", by default the first; raise SceneError with every mistake."""
    names, known = texts_of(names, splits_commas=True), [f"theta_{place}" for place in places(system)]
    refuse_any(f"of {name}: must be one of {', '.join(known)}" for name in names if name not in known)
    return tuple(dict.fromkeys(map(known.index, names))) or (0,)


def validate_strobes(*, phase_deg: float, spread_deg: float = 0.0, settle: float = 0.0) -> None:
    """Raise SceneError for a phase, a spread of starts or a transient that cannot be."""
    problems = [] if isfinite(phase_deg) else [f"phase_deg {phase_deg!r}: must be a number of degrees"]
    for name, value in (("spread_deg", spread_deg), ("settle", settle)):
        problems += [] if 0 <= value < inf else [f"{name} {value!r}: must be at least 0"]
    refuse_any(problems)


# ------------------------------------------------------------------------------------------------------- as text


@checked
def strobes_table(section: StroboscopicSection, form: Form) -> str:
    """As text, csv (one line per sample) or json, the `form`."""
    return section.report(form)


def state_records(system: System, states: Sequence[Floats], carted: bool | None = None) -> Iterator[dict[str, float]]:
    """The records of states (links, their rates, cart, its rate), (N, ...), one each, `carted` or not."""
    named, carted = places(system), system.cart is not None if carted is None else carted
    for links, rates, x, speed, *carried in zip(*(part.tolist() for part in states), strict=True):
        yield (
            {f"theta_{place}_rad": part for place, part in zip(named, links, strict=True)}
            | {f"theta_dot_{place}_rad_per_s": part for place, part in zip(named, rates, strict=True)}
            | ({"x_m": x, "x_dot_m_per_s": speed} if carted else {})
            | (dict(zip(system.first_columns, (*carried[0], *carried[1]), strict=True)) if carried else {})
        )
