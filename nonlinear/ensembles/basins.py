"""Basins of attraction: a measure over two parameters of a scene, usually two initial angles.

Of a scene with drives that is the attractor (`endings`); of any other the time of the first turn over the top, whose
map is a fractal, or the exponent of a small error.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import product
from math import degrees, prod, sqrt
from typing import Any

import numpy as np

from modal.errors import ComputationError, SceneError, refuse_any
from modal.extend.measures import columns_of, parse_request
from modal.report import Form, ReportTable, finite, silent
from modal.scene import InitialCondition, Pendulum, Scene, describe, require
from modal.scene.doors import checked, checked_number
from modal.scene.parameters import Variation, parse_variations
from modal.scene.signal_names import column_label
from modal.types import Floats
from nonlinear.ensembles.endings import UNDECIDED, EndingGroup, Outcomes, orbit_near, settle
from nonlinear.ensembles.rhythm_borders import name_of
from nonlinear.ensembles.running import Ensemble, EnsembleResult, ensemble
from nonlinear.ensembles.runs import form_of
from nonlinear.reduction import usual_start
from nonlinear.synchronization.study import theory_of_scene
from nonlinear.synchronization.study import usual_duration as sync_duration
from nonlinear.system import has_start

GRID_SIZE = 64
"""Limit: default of `vary`: places along each of two angles."""
GRID_SIZE_ONE_BY_ONE = 12
"""Limit: the same where each start takes as long as a run of its own."""
GRID_ANGLE_MAX = 170.0
"""Limit: default of `vary`: how far (deg) from hanging."""
EARLIEST = "first_turn_s"
ATTRACTOR = "attractor"
CHANGES_ATTRACTORS = (
    "changes the attractors themselves: vary numbers of a start, and follow attractors by `find_bifurcations`, or by "
    "`find_rhythms` in a scene with drives at joints"
)
BASIN_TIMES = 30.0
"""Limit: default of `duration` in sqrt(l/g)."""


@dataclass(frozen=True, eq=False, repr=False)
class Basins(EnsembleResult):
    """A measure over the grid of two numbers: `column` is its name with its unit.

    For attractors no start ran longer than `limit` (s), and `ensemble` is the first round of runs; the measure is then
    their number from 1, 0 for undecided.
    """

    ensemble: Ensemble
    column: str
    attractors: tuple[EndingGroup, ...] = ()
    limit: float | None = None

    what = "where starts end"
    figure = "nonlinear.plotting.ensembles:basins_figure"

    @property
    def axes(self) -> tuple[Variation, ...]:
        """The varied parameters."""
        return self.ensemble.members.axes

    @cached_property
    def values(self) -> Floats:
        """The measure over the grid; inf of a start from which no link turns over, NaN of one that failed."""
        members = self.ensemble
        if self.limit:
            numbers = np.zeros(members.size)
            for number, group in enumerate(self.attractors, 1):
                numbers[list(group.members)] = number
            numbers[list(members.failures)] = np.nan
            return numbers.reshape(members.members.shape)
        if self.column != EARLIEST:
            return members.grid(self.column)
        return np.asarray(
            np.min([members.grid(name) for name in members.columns if name.startswith("first_turn_")], axis=0)
        )

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the attractors, after that of what has not settled."""
        return (UNDECIDED, *(group.name for group in self.attractors)) if self.limit else ()

    @property
    def duration(self) -> float:
        """The longest run of a start (s)."""
        return self.limit or self.ensemble.question.duration

    def shares(self) -> dict[str, float]:
        """The shares of the outcomes."""
        known = self.values[~np.isnan(self.values)]
        total = max(known.size, 1)
        if self.names:
            return {name: float(np.count_nonzero(known == k)) / total for k, name in enumerate(self.names)}
        if self.column == EARLIEST:
            turned = float(np.count_nonzero(np.isfinite(known))) / total
            return {"a link turns over": turned, "no link turns over": 1 - turned}
        return {}

    def records(self) -> Iterator[dict[str, Any]]:
        """The two varied parameters and the measure, for every start."""
        y, x = self.axes
        for (row, other), value in zip(product(y.values, x.values), self.values.ravel().tolist(), strict=True):
            yield {y.column: row, x.column: other, self.column: value}

    def parts(self, form: Form = "text") -> Iterator[ReportTable | str]:
        """The shares of the outcomes, and the durations."""
        yield ReportTable(
            ("starts (%)", "description"), [(f"{100 * share:.3g}", name) for name, share in self.shares().items()]
        )
        known = self.values[np.isfinite(self.values)]
        if not self.names and known.size:
            low, middle, high = known.min(), np.median(known), known.max()
            yield f"{column_label(self.column)}: from {low:.4g} to {high:.4g}, median {middle:.4g}"
        until = "until it had settled, at most " if self.limit else ""
        yield f"Each start was simulated {until}for {self.duration:.4g} s."
        yield self.ensemble.words()

    def whole(self) -> dict[str, Any]:
        """Everything, for JSON: the values row by row, None for inf and NaN."""
        members = self.ensemble
        return {
            "scene": describe(self.scene),
            "axes": [{"place": axis.path, "unit": axis.unit, "values": list(axis.values)} for axis in self.axes],
            "duration_s": self.duration,
            "tolerance": members.question.tolerance,
            "engine": members.engine,
            "members": members.size,
            "failed": len(members.failures),
            "beyond_horizon": int(np.count_nonzero(members.beyond)),
            "largest_energy_drift": finite(float(np.nanmax(members.energy_drift))),
            "largest_difference_rad": finite(members.largest_difference),
            "shares": self.shares(),
            "names": list(self.names),
            **({"attractors": [each.record() for each in self.attractors]} if self.limit else {}),
            self.column: [[finite(float(value)) for value in row] for row in self.values],
        }


@checked
def find_basins(
    scene: Scene,
    duration: float | None = None,
    *,
    vary: Sequence[str] | Sequence[Variation] = (),
    measure: str | None = None,
    report: Callable[[float], object] = silent,
    **options: Any,
) -> Basins:
    """Compute a measure over two parameters of a scene, by default the first angles of its first two pendula or links.

    Where no start is given or varied, all begin in the usual one of the scene. `measure` is one that `basins` takes in
    `nonlinear.measures`, NAME or NAME:N for this many seconds in place of a `duration`; `options` are those of
    `ensemble`. Raise SceneError for anything else.
    """
    axes = grid_of(scene, vary)
    measure, duration = _measure_of(scene, measure, duration)
    if measure == ATTRACTOR:
        return _attractors(scene, axes, duration, report=report, **options)
    require(scene, "an ensemble")
    started, starts = with_starts(scene, axes), None
    if begins_in_mode(scene, axes):
        started, starts = scene, [usual_start(scene)] * prod(len(axis.values) for axis in axes)
    mapped = ensemble(
        started,
        usual_duration(scene, measure) if duration is None else duration,
        starts=starts,
        vary=axes,
        measures=[measure],
        report=report,
        **options,
    ).require("start")
    column = EARLIEST if measure == "first_turn" else next(iter(columns_of(measure, mapped.columns)), measure)
    return Basins(mapped, column)


def _measure_of(scene: Scene, text: str | None, duration: float | None) -> tuple[str, float | None]:
    """The name of the measure in a text, and for how long (s), None if nothing says so."""
    if text is None:
        return ATTRACTOR if scene.is_driven else "first_turn", duration
    measure, seconds = parse_request("basins", text)
    if ":" not in text:
        return measure.name, duration
    if duration is not None:
        raise SceneError([f"measure {text}: has its own `duration`"])
    return measure.name, seconds


def _attractors(scene: Scene, axes: tuple[Variation, ...], limit: float | None, **options: Any) -> Basins:
    """The attractors over two numbers of the start; raise SceneError where another number is varied."""
    require(scene, "an attractor" if scene.is_forced else "a limit cycle")
    refuse_any(f"vary {axis.path}: {CHANGES_ATTRACTORS}" for axis in axes if ".start." not in axis.path)
    started = with_starts(scene, axes)
    outcomes = Outcomes(started, partial(orbit_near, started))
    default = outcomes.returns.rounds * outcomes.returns.first_round
    limit = default if limit is None else checked_number("duration", limit, 0.0)
    place = np.zeros(prod(len(axis.values) for axis in axes), dtype=int)
    first = settle([outcomes], place, limit, {"vary": axes}, **options).require("start")
    groups = _named([group for group in outcomes.whole() if group.name != UNDECIDED])
    return Basins(first, ATTRACTOR, tuple(groups), limit)


def _named(groups: Sequence[EndingGroup]) -> Iterator[EndingGroup]:
    """Groups with the names of their rhythms; several of one name with what distinguishes them, at least a number."""
    names = Counter(map(name_of, groups))
    places: Counter[str] = Counter()
    for group in groups:
        name, orbit, slow_period = name_of(group), group.beginning and group.beginning.orbit, group.ending.slow_period
        if names[name] > 1:
            name += f", {degrees(orbit.amplitude):.5g}°" if orbit else f", {slow_period:.5g} s" if slow_period else ""
            places[name] += 1
            name += f" ({places[name]})" if places[name] > 1 else ""
        yield replace(group, name=name)


@checked
def grid_of(scene: Scene, vary: Sequence[str] | Sequence[Variation] = ()) -> tuple[Variation, ...]:
    """The two numbers that are varied; raise SceneError if there are more or fewer."""
    wanted = vary or usual_axes(scene)
    texts = [axis for axis in wanted if isinstance(axis, str)]
    axes = parse_variations(texts) if texts else tuple(axis for axis in wanted if isinstance(axis, Variation))
    if len(axes) != 2:
        example = "'pendulum[0].start.angles_deg[0]=-170:170:60'"
        raise SceneError([f"vary: a map has two axes, not {len(axes)}, such as {example} and that of angles_deg[1]"])
    return axes


def usual_duration(scene: Scene, measure: str) -> float:
    """A multiple of sqrt(l/g) of the longest link (s); for `order` as long as `sync` runs until one survives."""
    if measure == "order" and scene.is_driven:
        with suppress(ComputationError):
            return sync_duration(scene, theory_of_scene(scene, usual_start(scene)))
    return float(BASIN_TIMES * np.sqrt(max(link.length for link in scene.links()) / scene.gravity))


@checked
def begins_in_mode(scene: Scene, axes: Sequence[Variation]) -> bool:
    """Whether a scene without a start is varied in other numbers than a start."""
    return not has_start(scene) and not any(".start." in axis.path for axis in axes)


def with_starts(scene: Scene, axes: Sequence[Variation] = ()) -> Scene:
    """The scene with a start of every pendulum; those without one are at rest, with rates where these are varied."""
    rates = any(".start.rates_deg" in axis.path for axis in axes)

    def started(pendulum: Pendulum) -> Pendulum:
        angles = tuple(0.0 if way == "down" else 180.0 for way in pendulum.ways)
        start = pendulum.start or InitialCondition(angles_deg=angles)
        if rates and start.rates_deg is None:
            start = start.replace(rates_deg=(0.0,) * pendulum.n_links)
        return pendulum.replace(start=start)

    return scene.replace(pendulum=tuple(map(started, scene.pendulum)))


def usual_axes(scene: Scene) -> list[str]:
    """The first angles of the first two pendula, or of the first two links where there is but one entry.

    Of a driven scene of one link they are its angle and its rate, up to that which takes it over the top.
    """
    first = scene.pendulum[0]
    if len(scene.pendulum) > 1:
        places = ["pendulum[0].start.angles_deg[0]", "pendulum[1].start.angles_deg[0]"]
    elif first.n_links > 1:
        places = [f"pendulum[0].start.angles_deg[{link}]" for link in range(2)]
    elif scene.is_forced:
        most = 2 * degrees(sqrt(scene.gravity / first.links[0].length))
        return [
            f"pendulum[0].start.angles_deg[0]={-GRID_ANGLE_MAX:g}:{GRID_ANGLE_MAX:g}:{GRID_SIZE}",
            f"pendulum[0].start.rates_deg[0]={-most:.3g}:{most:.3g}:{GRID_SIZE}",
        ]
    else:
        raise SceneError(["vary: this scene has one starting angle: choose two numbers"])
    size = GRID_SIZE if form_of(scene) is not None else GRID_SIZE_ONE_BY_ONE
    return [f"{place}={-GRID_ANGLE_MAX:g}:{GRID_ANGLE_MAX:g}:{size}" for place in places]


@checked
def basins_table(basins: Basins, form: Form) -> str:
    """As text, csv (one line a start) or json, the `form`."""
    return basins.report(form)
