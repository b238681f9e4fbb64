"""Running a sweep on all cores, with each row saved as soon as it is computed, and its report."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Container, Generator, Iterator, Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import product
from time import monotonic
from typing import Any

import numpy as np

from modal.errors import SceneError
from modal.report import Drawable, TextResult, grid, silent, visible
from modal.scene import Scene, SineMotion, left_out, number_words
from modal.scene.doors import checked, formerly, require_type
from modal.scene.parameters import Place, Variable, Variation, find_places, texts_of, variation_of
from modal.scene.signal_names import column_label
from modal.types import Floats
from modal.vibration import Boundary, tongues, vertical_sine
from nonlinear.ensembles.executors import DIED, PROCESS_SECONDS, Crew, computed, cores
from nonlinear.ensembles.store import validate_store
from nonlinear.integration import validate, validate_whole
from nonlinear.sweeps.checkpoint import Checkpoint, RowFolder
from nonlinear.sweeps.measures import parse_measures
from nonlinear.sweeps.study import ENERGY, LYAPUNOV, PointChunk, Row, Study, measure_chunk, measure_each

MEMBERS = 50
"""Limit: default of `members`: starts drawn at every energy."""
REASONS_SHOWN_MAX = 5
"""Format: reasons of failures in a report."""
ENERGY_LINES_MAX = 100
"""Format: lines of a report that has one for every energy."""
DRAWN = "At every energy {} starts at random (seed {}): q05, median and q95 are quantiles over them."
NUMBERED = "Modes are numbered as in the table of the original scene."
Report = Callable[[float], object]
Rows = Generator[list[Row], None, None]


@dataclass(frozen=True, eq=False, repr=False)
class Sweep(Drawable, TextResult):
    """The rows of a study, ascending; `interrupted` says whether Ctrl-C came before the last."""

    study: Study
    rows: tuple[Row, ...]
    interrupted: bool = False

    writer = "nonlinear.sweeps.running:sweep_text"
    figure = "nonlinear.plotting.sweeps:sweep_figure"

    @cached_property
    def columns(self) -> tuple[str, ...]:
        """The names of all numbers, in the order of the fullest row."""
        fullest = max(self.rows, key=lambda row: len(row.numbers), default=Row(0, {}))
        return tuple(dict.fromkeys(name for row in (fullest, *self.rows) for name in row.numbers))

    @property
    def complete(self) -> bool:
        """Whether every point was tried."""
        return len(self.rows) == self.study.size

    @property
    def failures(self) -> dict[int, str]:
        """The reasons why points have no numbers, by their index."""
        return {row.index: row.reason for row in self.rows if row.reason}

    def to_dict(self) -> dict[str, Floats]:
        """The values of the axes and every quantity at every point of the grid, the last axis varying fastest."""
        axes = np.meshgrid(*(variation.values for variation in self.study.variations), indexing="ij")
        columns = {variation.column: grid.ravel() for variation, grid in zip(self.study.variations, axes, strict=True)}
        return columns | {name: self.values(name).ravel() for name in self.columns}

    @cached_property
    def boundaries(self) -> tuple[Boundary, ...]:
        """Those of growth, where `floquet` is measured over the amplitude of a vertical sine, its frequency, or both.

        Traced by continuation from the grid of the sweep, accurate beyond it; amplitudes in m, frequencies in Hz.
        """
        study = self.study
        if "floquet" not in [request.name for request in study.measures]:
            return ()
        sine, places = vertical_sine(study.scene), vertical_places(study.scene)
        values: dict[str, Any] = {"amplitude": sine.amplitude, "frequency_hz": sine.frequency_hz}
        for variation in study.variations:
            varied = set(find_places(study.scene, variation.path)) & places.keys()
            if not varied:
                return ()
            values |= {places[place]: variation.values for place in varied}
        return tongues(study.scene, **values).boundaries

    def values(self, column: str) -> Floats:
        """One quantity over the grid, in the study's shape, NaN if it is unknown."""
        values = np.full(self.study.size, np.nan)
        for row in self.rows:
            values[row.index] = row.numbers.get(column, np.nan)
        return values.reshape(self.study.shape)


def vertical_places(scene: Scene) -> dict[Place, str]:
    """The places of the amplitude and the frequency of a scene's vertical sine, and their names."""
    moved = zip(scene.motion_places, scene.motions, strict=True)
    sines = [at for at, motion in moved if isinstance(motion, SineMotion) and motion.direction == "vertical"]
    return {(*at, name): name for at, name in product(sines, ("amplitude", "frequency_hz"))}


@formerly(study="scene")
def sweep(
    scene: Study | Scene,
    vary: str | Sequence[str] | Sequence[Variation] = (),
    *,
    measures: str | Sequence[str] = ("frequencies",),
    members: int = 0,
    seed: int = 0,
    journal: Checkpoint | None = None,
    folder: str | os.PathLike[str] | None = None,
    share: tuple[int, int] | None = None,
    workers: int | None = None,
    crew: Crew | None = None,
    report: Report = silent,
) -> Sweep:
    """Compute all points of a grid; points already in a journal or a folder are reused, new ones are added to it.

    What the grid is follows the scene, in the texts of the command, or is a `Study` in its place. In a `folder` each
    chunk of points is a file; a `share` (k, n), with k from 0, is every n-th chunk alone, for n processes that know
    nothing of each other. `workers` is a number of processes, 1 to stay in this one; by default, all cores are used
    once the sweep has taken half a second. `crew` is any `concurrent.futures.Executor`, or that of
    `nonlinear.ensembles.cluster`. Rows depend on neither. `report` is given the number of points done. On Ctrl-C the
    rows found so far are returned. Raise ComputationError if workers cannot be started.
    """
    require_type("scene", scene, "Study", "Scene")
    if isinstance(scene, Study):
        study = scene
    else:
        axes = tuple(map(variation_of, [vary] if isinstance(vary, str) else vary))
        study = Study(scene, axes, parse_measures(texts_of(measures)), members, seed)
    validate(lambda: validate_whole(1, optional=True, workers=workers), lambda: validate_store(folder, share))
    kept = journal or (RowFolder(folder, study) if folder is not None else Checkpoint())
    rows = {row.index: row for row in kept.rows}
    left = _left(study, rows, share or (0, 1))
    done, interrupted = study.size - sum(len(wanted) for wanted in left.values()), False
    report(done)
    try:
        with closing(_found(study, left, workers, crew)) as chunks:
            for chunk in chunks:
                kept.add(chunk)
                rows |= {row.index: row for row in chunk}
                done += len(chunk)
                report(done)
    except KeyboardInterrupt:
        interrupted = True
    return Sweep(study, tuple(rows[index] for index in sorted(rows)), interrupted)


@checked
def chaos_by_energy(
    scene: Scene,
    energies: Sequence[float],
    seconds: float | None = None,
    *,
    members: int = MEMBERS,
    seed: int = 0,
    workers: int | None = None,
    report: Report = silent,
) -> Sweep:
    """The largest Lyapunov exponents of starts drawn at random on surfaces of energy.

    Parameters
    ----------
    scene
        A plane scene that keeps its energy.
    energies
        In J above equilibrium, ascending.
    seconds
        The time over which each exponent is measured, after half as many; by default 200 sqrt(l/g) of the longest link.
    members
        Number of starts on each energy.
    seed
        Of the random numbers.
    workers
        A number of processes, 1 to stay in this one.
    report
        Is called with the number of energies done.

    Returns
    -------
    Sweep
        Median and quantiles of 5 and 95 %, and the share of starts whose exponent is too large for regular motion
        (`nonlinear.chaos.regular_exponent`); an energy out of reach has its reason in `failures`.

    Raises
    ------
    SceneError
        The scene does not keep its energy, or the time is too short.

    Examples
    --------
    >>> from modal import load
    >>> from nonlinear.sweeps import chaos_by_energy
    >>> found = chaos_by_energy(load("chain-1"), [0.5, 1.0], 8.0, members=2, workers=1)
    >>> found.columns, found.values("chaotic_share").tolist()
    (('lyapunov_q05_per_s', 'lyapunov_median_per_s', 'lyapunov_q95_per_s', 'chaotic_share'), [0.0, 0.0])
    """
    text = LYAPUNOV if seconds is None else f"{LYAPUNOV}:{float(seconds)!r}"
    axis = Variation(ENERGY, tuple(float(energy) for energy in energies))
    return sweep(Study(scene, (axis,), parse_measures([text]), members, seed), workers=workers, report=report)


def _left(study: Study, known: Container[int], share: tuple[int, int]) -> dict[int, list[int]]:
    """The points of a share that are not known, by the number of their chunk."""
    left: dict[int, list[int]] = {}
    first, of = share
    for number in range(first, -(-study.size // study.chunk), of):
        if wanted := [index for index in study.points_of(number) if index not in known]:
            left[number] = wanted
    return left


def _found(study: Study, left: Mapping[int, Sequence[int]], workers: int | None, crew: Crew | None) -> Rows:
    """The rows that are left, chunk by chunk: here, and where much is left then, by a crew or processes."""
    task, chunks, begun = study.task, (_chunk(study, *each) for each in left.items()), monotonic()
    remaining, count = len(left), workers or cores()
    if crew is None and (workers is None or count == 1):
        for chunk in chunks:
            before = monotonic()
            rows: list[Row] = []
            try:
                for row in measure_each(task, chunk):
                    rows.append(row)
            except KeyboardInterrupt:  # those computed before Ctrl-C are kept
                yield rows
                raise
            yield rows
            remaining -= 1
            if (
                count > 1
                and monotonic() - begun > PROCESS_SECONDS / 4
                and (monotonic() - before) * remaining > PROCESS_SECONDS
            ):
                break
    if remaining:
        yield from computed(partial(measure_chunk, task), chunks, crew, min(count, remaining), _died, _divided)


def _chunk(study: Study, number: int, wanted: Sequence[int]) -> PointChunk:
    return PointChunk([(index, study.point(index)) for index in study.points_of(number)], frozenset(wanted))


def _divided(chunk: PointChunk) -> list[PointChunk]:
    return [PointChunk([point], frozenset([point[0]])) for point in chunk.points if point[0] in chunk.wanted]


def _died(chunk: PointChunk) -> list[Row]:
    return [Row(index, {}, DIED) for index in sorted(chunk.wanted)]


def sweep_text(sweep: Sweep) -> str:
    """Minimum and maximum of every quantity with their locations, then the reasons for points that failed."""
    return "\n".join(_lines(sweep)) + "\n"


def _lines(sweep: Sweep) -> Iterator[str]:
    yield f"{len(sweep.rows)} of {sweep.study.size} points, {len(sweep.failures)} failed"
    if sweep.study.by_energy and len(sweep.study.variations) == 1 and sweep.study.size <= ENERGY_LINES_MAX:
        lines = []
        for row in sweep.rows:
            (energy,) = sweep.study.point(row.index).values()
            lines.append([f"{energy:.6g}", *(f"{row.numbers.get(name, np.nan):.4g}" for name in sweep.columns)])
        yield grid(lines, ("energy (J)", *map(column_label, sweep.columns)))
    else:
        rows = [_range(sweep, name) for name in sweep.columns]
        yield grid(rows, ("quantity", "smallest", "at", "largest", "at"))
    yield from reasons(sweep)
    yield from notes(sweep)
    if sweep.study.members:
        yield DRAWN.format(sweep.study.members, sweep.study.seed)
    elif any(request.measure.is_numbered for request in sweep.study.measures):
        yield NUMBERED


def reasons(sweep: Sweep) -> Iterator[str]:
    """The reasons why points failed, the most frequent first."""
    counts = Counter(sweep.failures.values()).most_common()
    for reason, count in counts[:REASONS_SHOWN_MAX]:
        yield f"{count} × {visible(reason)}"
    if len(counts) > REASONS_SHOWN_MAX:
        yield f"and {len(counts) - REASONS_SHOWN_MAX} other reasons"


def notes(sweep: Sweep) -> tuple[str, ...]:
    """Return a sentence for each effect that frequencies and damping ratios ignore anywhere in the sweep."""
    study = sweep.study
    if not any(request.measure.is_numbered and not request.runs for request in study.measures):
        return ()
    scenes = [study.scene]
    with suppress(SceneError):
        last = study.point(study.size - 1)
        scenes.append(Variable(study.scene, last).at(last))
    return tuple(dict.fromkeys(sentence for scene in scenes for sentence in left_out(scene)))


def _range(sweep: Sweep, name: str) -> tuple[str, ...]:
    values = sweep.values(name).ravel()
    if np.all(np.isnan(values)):
        return column_label(name), "nan", "", "nan", ""
    ends = int(np.nanargmin(values)), int(np.nanargmax(values))
    return (column_label(name), *(words for end in ends for words in (f"{values[end]:.6g}", _place(sweep, end))))


def _place(sweep: Sweep, index: int) -> str:
    study = sweep.study
    units = {variation.path: variation.unit for variation in study.variations}
    return ", ".join(
        f"{'energy' if path == ENERGY else number_words(study.scene, path)} = {value:.6g} {units[path]}".rstrip()
        for path, value in study.point(index).items()
    )
