"""Bifurcation diagrams: the last stroboscopic samples of a driven scene at every value of a parameter.

One point is a motion of the period of the drives, two and four those after doublings of the period, many chaos.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from modal.errors import MultipendulaError, SceneError
from modal.report import Drawable, Form, ReportTable, Result, counted, finite, silent
from modal.scene import Scene, drive_period, number_words, require, validate_scene
from modal.scene.doors import checked
from modal.scene.parameters import Variable, Variation, find_places, parse_variations, validate_variations
from modal.types import Floats, Ints
from nonlinear.ensembles.running import ensemble
from nonlinear.ensembles.strobes import (
    links_named,
    settling_time,
    state_records,
    strobe_times,
    validate_strobes,
    within_a_turn,
)
from nonlinear.integration import validate
from nonlinear.postprocessing.returns import JUDGED_STROBES, REPEAT_PERIODS_MAX, natural_units, repetition
from nonlinear.reduction import usual_start
from nonlinear.system import System, system_of

VALUES_TOGETHER = 128
"""Cost: members with periods of their own that are sampled at the times of all of them; benchmarks/ensembles.py."""


@dataclass(frozen=True, eq=False, repr=False)
class BifurcationDiagram(Drawable, Result):
    """The last stroboscopic samples at each of V values: `times` (V, K) in s, `states` as in `strobes`, (V, K, …).

    `settle` (V,) in s is the transient before; values that failed are NaN, with their `reasons`; `shown` are the links
    that are drawn, from 0.
    """

    scene: Scene
    variation: Variation
    phase_deg: float
    settle: Floats
    times: Floats
    states: tuple[Floats, ...]
    reasons: dict[int, str]
    shown: tuple[int, ...]

    what, key = "bifurcation diagram", "strobes"
    figure = "nonlinear.plotting.ensembles:bifurcation_figure"

    @property
    def system(self) -> System:
        """The scene as arrays."""
        return system_of(self.scene)

    @property
    def unit(self) -> str:
        """The unit of the values; of the amplitude of a force N, of a torque N m."""
        _, k, *_ = (*find_places(self.scene, self.variation.path)[0], 0)
        if self.variation.unit or not self.variation.path.startswith("force"):
            return self.variation.unit
        return "N m" if self.scene.force[int(k)].direction == "torque" else "N"

    @property
    def repeats(self) -> Ints:
        """After how many periods the motion repeats, (V,); 0 if it does not within 16."""
        return repetition(natural_units(self.system, self.states), self.system.n_links)[0]

    def points(self, link: int) -> tuple[Floats, Floats]:
        """The values (V K,) and at each the angles of a link in (−180°, 180°]."""
        angles = within_a_turn(np.degrees(self.states[0][..., link]))
        return np.repeat(self.variation.values, angles.shape[1]), angles.ravel()

    def facts(self) -> dict[str, Any]:
        """The varied parameter, and after how many periods the motion repeats."""
        return {
            "place": self.variation.path,
            "unit": self.unit,
            "values": list(self.variation.values),
            "phase_deg": self.phase_deg,
            "settle_s": [finite(seconds) for seconds in self.settle.tolist()],
            "repeats_after_periods": self.repeats.tolist(),
            "failed": {str(k): reason for k, reason in sorted(self.reasons.items())},
        }

    def records(self) -> Iterator[dict[str, Any]]:
        """A row for each sample: the value, after how many periods the motion repeats, the time and the state."""
        repeats = self.repeats.tolist()
        for k, (value, times) in enumerate(zip(self.variation.values, self.times.tolist(), strict=True)):
            if k not in self.reasons:
                of_value = {self.variation.column: value, "repeats_after_periods": repeats[k]}
                strobes = state_records(self.system, [part[k] for part in self.states])
                yield from (of_value | {"time_s": time} | row for time, row in zip(times, strobes, strict=True))

    def parts(self, form: Form = "text") -> Iterator[ReportTable | str]:
        """The periods of the motions at all values, and how they were sampled."""
        yield ReportTable(("repeats after (periods)", "values", "from", "to"), list(self._ranges()))
        values, settle = self.variation.values, self.settle[np.isfinite(self.settle)]
        number = number_words(self.scene, self.variation.path)
        span = f"of the {number} from {values[0]:g} to {values[-1]:g} {self.unit}".rstrip()
        lines = [
            f"{counted(len(values), 'value', 'values')} {span}",
            f"the last {JUDGED_STROBES} stroboscopic samples of each, at {self.phase_deg:g}° of the drives, after a "
            "transient of "
            + (f"{settle.min():.4g} s" if np.ptp(settle) == 0 else f"{settle.min():.4g} to {settle.max():.4g} s"),
        ]
        failed = Counter(self.reasons.values()).items()
        yield "\n".join([*lines, *(f"{counted(count, 'value', 'values')} × {why}" for why, count in failed)])

    def _ranges(self) -> Iterator[tuple[str, ...]]:
        known = np.isfinite(self.times[:, 0]) & ~np.isin(np.arange(len(self.times)), list(self.reasons))
        repeats, values = self.repeats, np.array(self.variation.values)
        for period in sorted(set(repeats[known].tolist()), key=lambda some: some or REPEAT_PERIODS_MAX + 1):
            some = values[known & (repeats == period)]
            name = str(period) if period else f"not within {REPEAT_PERIODS_MAX}, or not yet"
            yield name, str(len(some)), f"{some.min():.6g}", f"{some.max():.6g}"


def find_bifurcations(
    scene: Scene,
    vary: str | Variation,
    *,
    phase_deg: float = 0.0,
    settle: float | None = None,
    of: str | Sequence[str] = (),
    report: Callable[[float], object] = silent,
    **options: Any,
) -> BifurcationDiagram:
    """Compute the last 50 stroboscopic samples of a plane scene driven by sines at every value of a parameter.

    Every value has its own run, from the start of the scene: a transient of `settle` (s), by default ten times the
    slowest decay of its modes and at least 200 periods, then 50 periods, sampled once in each at `phase_deg`. `of`
    names the links to draw, "theta_1_1". `options` are those of `ensemble`; values of a share that others compute are
    NaN. Raise SceneError if no value gives a motion.

    >>> from modal import Bob, Pendulum, Scene
    >>> from modal.scene import SineForce
    >>> push = SineForce(on="pendulum[0].links[0]", amplitude=1.0, frequency_hz=0.5)
    >>> links = [Bob(mass=1.0, length=1.0, damping=2.0)]
    >>> scene = Scene(gravity=9.81, pendulum=[Pendulum(links=links, start={"angles_deg": [20.0]})], force=[push])
    >>> found = find_bifurcations(scene, "force[0].amplitude=1:2:3", settle=30.0, workers=1)
    >>> found.times.shape, found.repeats.tolist()
    ((3, 50), [1, 1, 1])
    """
    validate_scene(scene)
    require(scene, "a stroboscopic section")
    variation, shown, _ = validate(
        lambda: _variation(scene, vary),
        lambda: links_named(of, system_of(scene)),
        lambda: validate_strobes(phase_deg=phase_deg, settle=settle or 0.0),
    )
    periods, transients, reasons = _in_time(scene, variation, settle)
    known, done = np.flatnonzero(np.isfinite(periods)), 0
    times = np.full((len(periods), JUDGED_STROBES), np.nan)
    for k in known:
        times[k] = strobe_times(periods[k], phase_deg, settle=transients[k])
    states = [np.full((*times.shape, *tail), np.nan) for tail in _tails(system_of(scene))]
    groups = [*_parts(periods, known)]
    for number, part in enumerate(groups):
        stored = _stored(number, len(groups), options)
        rows, failed = _strobed(scene, variation, part, times[part], partial(_forward, report, done), stored)
        for state, row in zip(states, rows, strict=True):
            state[part] = row
        reasons |= failed
        done += len(part)
    if len(reasons) == len(times):
        raise SceneError([f"every value failed: {next(iter(reasons.values()))}"])
    return BifurcationDiagram(scene, variation, phase_deg, transients, times, tuple(states), reasons, shown)


def _tails(system: System) -> list[tuple[int, ...]]:
    """The shapes of the parts of a state."""
    links, carried = (system.n_links,), (system.first,)
    return [links, links, (), (), *([carried, carried] if system.structure is not None else [])]


def _variation(scene: Scene, vary: str | Variation) -> Variation:
    """The varied number; raise SceneError for no place, and for one that changes the number of links."""
    variation = parse_variations([vary])[0] if isinstance(vary, str) else vary
    validate_variations(scene, (variation,))
    if variation.path.endswith(".count"):
        raise SceneError([f"vary {variation.path}: changes how many links there are: vary another number"])
    return variation


def _in_time(scene: Scene, variation: Variation, settle: float | None) -> tuple[Floats, Floats, dict[int, str]]:
    """At every value the period and the transient (s), NaN if there is none, and why not."""
    variable, reasons = Variable(scene, [variation.path]), dict[int, str]()
    seconds = np.full((2, len(variation.values)), np.nan)
    for k, value in enumerate(variation.values):
        try:
            scene_there = variable.at({variation.path: value})
            period = drive_period(scene_there).seconds
            seconds[:, k] = period, settling_time(scene_there, period) if settle is None else settle
        except MultipendulaError as error:
            reasons[k] = " ".join(str(error).split())
    return seconds[0], seconds[1], reasons


def _parts(periods: Floats, known: Ints) -> Iterator[Ints]:
    """Values that go together: all that have one period, others in groups of similar ones."""
    ascending = known[np.argsort(periods[known], kind="stable")]
    together = VALUES_TOGETHER if len(np.unique(periods[known])) > 1 else max(len(known), 1)
    for first in range(0, len(known), together):
        yield ascending[first : first + together]


def _stored(number: int, groups: int, options: dict[str, Any]) -> dict[str, Any]:
    """The options of one of the groups: several have a folder each, and begin with the chunks of different shares."""
    if options.get("folder") is None or groups == 1:
        return options
    first, of = options.get("share") or (0, 1)
    folder = Path(options["folder"]) / f"values-{number:04d}"
    return options | {"folder": folder, **({"share": ((first - number) % of, of)} if of > 1 else {})}


def _forward(report: Callable[[float], object], before: int, done: float) -> None:
    report(before + done)


def _strobed(
    scene: Scene,
    variation: Variation,
    part: Ints,
    times: Floats,
    report: Callable[[float], object],
    options: dict[str, Any],
) -> tuple[list[Floats], dict[int, str]]:
    """The states of some values at their `times` (P, K) in s, (P, K, …) each, and why others failed."""
    every = np.unique(times)
    vary = {variation.path: np.array(variation.values)[part]}
    starts = None if ".start." in variation.path else [usual_start(scene)] * len(part)
    more: dict[str, Any] = {"check": 0, **options}
    strobed = ensemble(scene, every[-1], starts=starts, vary=vary, output=every.tolist(), report=report, **more)
    reasons = {int(part[k]): reason for k, reason in strobed.require().failures.items()}
    if len(reasons) == len(part) or not strobed.columns:
        return [np.array(np.nan)] * len(_tails(strobed.question.system)), reasons
    rows = len(strobed.question.times) - len(every) + np.searchsorted(every, times)
    members = np.arange(len(part))[:, None]
    return [state[members, rows] for state in strobed.states()], reasons


# ------------------------------------------------------------------------------------------------------- as text


@checked
def bifurcation_table(shown: BifurcationDiagram, form: Form) -> str:
    """As text, csv (one line per sample) or json, the `form`."""
    return shown.report(form)
