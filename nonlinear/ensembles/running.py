"""Many members of a scene integrated together, and their results.

>>> import modal
>>> from nonlinear.ensembles import ensemble
>>> found = ensemble(modal.load("chain-2"), 1.0, starts=[[0.1, 0.2], [1.0, 2.0]], measures=["largest_angle"])
>>> found.column("largest_angle_deg").shape
(2,)
"""

from __future__ import annotations

import os
from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import cached_property, partial
from math import isnan
from typing import Any

import numpy as np

from modal.errors import SceneError
from modal.report import Displayed, Drawable, Result, Summary, counted, deferred, finite, silent
from modal.scene import Scene, name_of, require, title_of
from modal.scene.parameters import Vary
from modal.types import Floats, Ints
from nonlinear.chaos.lyapunov import GROWTH_SAMPLES_MAX
from nonlinear.ensembles.computing import DISAGREES, Chunk, compute, engine_of
from nonlinear.ensembles.costs import Decision, choose_engine, seconds_of
from nonlinear.ensembles.executors import DIED, PROCESS_SECONDS, Crew, computed, cores, pool_of
from nonlinear.ensembles.measures import requested_measures, validate_measures
from nonlinear.ensembles.members import Members, Starts, members_of
from nonlinear.ensembles.plain import state_columns, validate_plain
from nonlinear.ensembles.question import (
    ENSEMBLE_TOLERANCE,
    PLAIN,
    RETIRED,
    WITHOUT_SERIES,
    EnsembleRequest,
    chunk_of,
    refused,
    sample_of,
)
from nonlinear.ensembles.store import Parts, engine_of_folder, validate_store
from nonlinear.integration import sample_times, validate, validate_numbers, validate_whole
from nonlinear.integration.readiness import Forgone, lose, rent
from nonlinear.system import Motion, System, system_of

END = "end"
Output = str | int | Sequence[float] | Floats | None
Report = Callable[[float], object]
Numbered = tuple[int, Chunk]


@dataclass(frozen=True, eq=False, repr=False)
class Ensemble(Displayed):
    """The results of S members, in chunks; `reason` explains the engine, `interrupted` says whether it was cut short.

    >>> import numpy as np
    >>> from modal import load
    >>> from nonlinear import ensemble
    >>> found = ensemble(load("chain-1"), 1.0, starts=np.radians([[10.0], [20.0]]), engine="numpy", workers=1)
    >>> found.size, bool((found.energy_drift < 1e-6).all())
    (2, True)
    """

    question: EnsembleRequest
    chunks: Sequence[Chunk] | Parts
    reason: str
    interrupted: bool = False

    @property
    def members(self) -> Members:
        """Who they are."""
        return self.question.members

    @property
    def size(self) -> int:
        """How many there are."""
        return self.members.size

    @property
    def engine(self) -> str:
        """The engine that integrated them."""
        return self.question.engine

    @cached_property
    def columns(self) -> tuple[str, ...]:
        """The names of all stored output."""
        return tuple(dict.fromkeys(name for chunk in self.chunks for name in chunk.columns))

    def column(self, name: str) -> Floats:
        """One quantity of all members, (S, ...), NaN if it is not known; of crossings one after the other."""
        if name not in self.columns:
            raise SceneError([f"{name}: was not stored; there are {', '.join(self.columns)}"])
        if name.startswith("crossing_"):
            return np.concatenate([chunk.columns[name] for chunk in self.chunks if name in chunk.columns])
        whole: Floats | None = None
        for chunk in self.chunks:
            if (values := chunk.columns.get(name)) is not None:
                if whole is None:
                    whole = np.full((self.size, *values.shape[1:]), np.nan)
                whole[chunk.first : chunk.first + chunk.size] = values
        assert whole is not None
        return whole

    def grid(self, name: str) -> Floats:
        """One quantity over the grid of varied numbers."""
        values = self.column(name)
        return values.reshape(*self.members.shape, *values.shape[1:])

    @cached_property
    def failures(self) -> dict[int, str]:
        """Why members failed, by their numbers from 0."""
        return {member: reason for chunk in self.chunks for member, reason in chunk.reasons.items()}

    @property
    def energy_drift(self) -> Floats:
        """Of every member, (S,), relative."""
        return self.column("energy_drift")

    @property
    def beyond(self) -> Any:
        """Which members lie beyond their horizon: where the estimated error of an angle exceeds 0.1 rad, (S,)."""
        return self.column("horizon_s") < self.question.duration

    @cached_property
    def differences(self) -> dict[int, float]:
        """The largest angle (rad) at the end between members and runs by themselves; NaN beyond the horizon."""
        return {member: difference for chunk in self.chunks for member, difference in chunk.differences.items()}

    @property
    def largest_difference(self) -> float:
        """The largest of them; NaN if none was checked within its horizon."""
        return max((angle for angle in self.differences.values() if not isnan(angle)), default=float("nan"))

    @property
    def final(self) -> Motion:
        """The last states of all members; raise SceneError if they were not stored."""
        links, rates, cart, speed, *carried = self.states()
        return Motion(links, rates, cart, speed, np.full(self.size, np.nan), *carried)

    def states(self, prefix: str = "") -> list[Floats]:
        """Angles of links and their rates, place and speed of the cart; on a structure its coordinates and rates, too.

        Those of columns with a `prefix`, such as "crossing_".
        """
        return [
            self.column(prefix + name) for name in state_columns(self.question.system.structure is not None).values()
        ]

    def require(self, each: str = "") -> Ensemble:
        """Itself; KeyboardInterrupt where it was cut short, SceneError where `each` start or value failed."""
        if self.interrupted:
            raise KeyboardInterrupt
        if each and len(self.failures) == self.size:
            raise SceneError([f"every {each} failed: {next(iter(self.failures.values()))}"])
        return self

    def record(self) -> dict[str, Any]:
        """The method, for JSON."""
        return {
            "motions": self.size,
            "duration_s": self.question.duration,
            "engine": self.engine,
            "failed": len(self.failures),
            "largest_energy_drift": finite(float(np.nanmax(self.energy_drift))),
        }

    def to_dict(self) -> dict[str, Floats]:
        """Every quantity that is one number a member, (S,), by its name, after the values that were varied.

        >>> from modal import load
        >>> found = ensemble(load("chain-1"), 1.0, vary={"gravity": [9.8, 1.6]}, engine="numpy", workers=1)
        >>> found.to_dict()["gravity"].tolist()
        [9.8, 1.6]
        """
        varied = self.members.values
        single = [name for name in self.columns if not name.startswith("crossing_")]
        measured = {name: values for name in single if (values := self.column(name)).ndim == 1}
        return {**varied, **measured}

    def to_xarray(self) -> Any:
        """The output as an `xarray.Dataset` over `member`, with the varied numbers; chunks are read as they are used.

        Crossings, which are not one of each member, are omitted.  Raise MissingExtraError without xarray.
        """
        first = next(iter(self.chunks), None)
        columns = {} if first is None else {name: values.shape[1:] for name, values in first.columns.items()}
        kept = {name: tail for name, tail in columns.items() if not name.startswith("crossing_")}
        told = {"title": title_of(self.question.scene), "duration_s": self.question.duration, "engine": self.engine}
        dataset = deferred("nonlinear.postprocessing.datasets:dataset_of_rows")
        return dataset(self.size, self.members.values, kept, self._rows, told)

    def _rows(self, name: str, members: Ints, each: tuple[int, ...]) -> Floats:
        """One quantity of some members, of such a shape each, from their chunks alone; NaN if it is not known."""
        numbers, rows = members // self.question.chunk, np.full((len(members), *each), np.nan)
        for number in np.unique(numbers).tolist():
            if (chunk := self._chunk(number)) is not None and name in chunk.columns:
                here = numbers == number
                rows[here] = chunk.columns[name][members[here] - chunk.first]
        return rows

    def _chunk(self, number: int) -> Chunk | None:
        if isinstance(self.chunks, Parts):
            return self.chunks.read(number) if self.chunks.path(number).exists() else None
        return next((chunk for chunk in self.chunks if chunk.first == number * self.question.chunk), None)

    def _summary(self) -> Summary:
        members, question = counted(self.size, "member", "members"), self.question
        title = f"Ensemble of {members} of {name_of(question.scene)} over {question.duration:g} s"
        facts = [("engine", f"{self.engine}: {self.reason}"), ("tolerance", f"{question.tolerance:g}")]
        facts += [("varied", ", ".join(self.members.paths))] if self.members.paths else []
        facts += [("interrupted", "some members are missing")] if self.interrupted else []
        return Summary(title, facts)

    def words(self) -> str:
        """The number of members, the engine and the accuracy."""
        drift, horizon = self.energy_drift, self.column("horizon_s")
        lost = f"{np.count_nonzero(self.beyond)} members past their predictability horizon"
        told = "horizons not estimated" if np.all(np.isnan(horizon)) else lost
        known = drift[np.isfinite(drift)]
        lines = [f"{self.size} members by {self.engine}: {self.reason}"]
        if len(known):
            lines.append(f"energy drift at most {known.max():.1e}, {told}")
        if count := sum(not isnan(difference) for difference in self.differences.values()):
            lines.append(f"{count} members re-run individually agree to {self.largest_difference:.1e} rad")
        if self.failures:
            lines.append(f"{len(self.failures)} failed")
        if untrue := [member for member, reason in self.failures.items() if reason.startswith(DISAGREES)]:
            names = "members " * (len(untrue) > 1) or "member "
            more = "Members that were not checked may be wrong as well."
            lines += [f"warning: {names}{', '.join(map(str, untrue))}: {self.failures[untrue[0]]}. {more}"]
        return "\n".join(lines)


class EnsembleResult(Drawable, Result):
    """The displayed result of an `ensemble`."""

    ensemble: Ensemble

    @property
    def scene(self) -> Scene:
        """The scene of the members."""
        return self.ensemble.question.scene

    @property
    def system(self) -> System:
        """The scene as arrays."""
        return self.ensemble.question.system


def ensemble(
    scene: Scene,
    duration: float,
    *,
    starts: Starts | None = None,
    vary: Vary | None = None,
    output: Output = None,
    tolerance: float = ENSEMBLE_TOLERANCE,
    measures: Sequence[str] = (),
    engine: str = "auto",
    folder: str | os.PathLike[str] | None = None,
    check: int = 4,
    chunk: int | None = None,
    share: tuple[int, int] | None = None,
    workers: int | None = None,
    crew: Crew | None = None,
    report: Report = silent,
) -> Ensemble:
    """Members of a scene that differ in their starts, or in any of its numbers, integrated together.

    Each member has its own steps.  Results do not depend on `workers` or `crew`.  Ctrl-C returns the results so far.

    Parameters
    ----------
    scene
        The scene that the members share but for their starts and varied numbers.
    duration
        The simulated time (s).
    starts
        Angles (S, links) in rad at rest, or states.
    vary
        A grid such as `["pendulum[0].start.angles_deg[0]=-180:180:512"]`, or one value a member at each place,
        `{"gravity": [9.8, 9.9]}`.
    output
        The stored samples: "end", a number of evenly spaced samples, or their times (s).  With neither `output`
        nor `measures` the end is stored.
    tolerance
        That of `simulate`, for every member.
    measures
        Names of measures computed during the run (`nonlinear.measures`).
    engine
        "auto", "numpy", "numba" (extra `fast`), or "simulate": one by one, which takes every scene.
    folder
        Where each chunk of members is stored as a file.  An interrupted call resumes there.
    check
        How many members, drawn at random, are run by `simulate` too.
    chunk
        Members in a chunk.
    share
        `(k, n)` with k from 0 computes every n-th chunk alone, for n processes that know nothing of each other.
    workers
        A number of processes, 1 to stay in this one.
    crew
        Any `concurrent.futures.Executor` in place of processes, or a factory of one, such as its class: another is made
        where one has broken.  A `WorkerPool` says on how many chunks an executor works at a time.
    report
        Is called with the number of members done; before, its method `expect`, if it has one, with the seconds that the
        others are estimated to take, and the number done.

    Returns
    -------
    Ensemble
        Output and measures of every member, with its `energy_drift`, an estimate of its error, and its horizon.

    Raises
    ------
    SceneError
        Arguments cannot be, or contradict each other.
    MissingExtraError
        The engine needs an extra that is not installed.

    Examples
    --------
    >>> from modal import load
    >>> from nonlinear import ensemble
    >>> pair = ensemble(load("chain-1"), 1.0, vary={"gravity": [9.8, 1.6]}, engine="numpy", workers=1)
    >>> pair.final.links.shape
    (2, 1)
    """
    validate(
        lambda: validate_whole(0, check=check),
        lambda: validate_whole(1, optional=True, chunk=chunk, workers=workers),
        lambda: validate_store(folder, share),
    )
    choice = partial(choose_engine, engine, begun=engine_of_folder(folder) if folder else "", anew=share is not None)
    question, decision = _question(scene, duration, starts, vary, output, tolerance, measures, choice, check, chunk)
    parts = None if folder is None else Parts(folder, question)
    left = _left(question, parts, share)
    if left and question.engine == RETIRED:
        raise SceneError([WITHOUT_SERIES])
    return _run(question, decision, parts, left, workers, crew, report)


def _left(question: EnsembleRequest, parts: Parts | None, share: tuple[int, int] | None) -> list[int]:
    """The chunks to compute."""
    first, of = share or (0, 1)
    return [number for number in range(first, question.chunks, of) if not (parts and parts.done(number))]


def _question(
    scene: Scene,
    duration: float,
    starts: Starts | None,
    vary: Vary | None,
    output: Output,
    tolerance: float,
    measures: Sequence[str],
    choice: Callable[..., Decision],
    check: int,
    chunk: int | None,
) -> tuple[EnsembleRequest, Decision]:
    """The question, and why this engine answers it; raise SceneError with every mistake."""
    require(scene, "an ensemble")
    system = system_of(scene)
    members, wanted, times, *_ = validate(
        lambda: members_of(scene, starts, vary),
        lambda: requested_measures(measures, system),
        lambda: _times(scene, duration, output),
        lambda: validate_numbers(duration, tolerance, 0.0),
    )
    duration, tolerance = float(duration), float(tolerance)
    why_not = refused(members, duration, tolerance)
    decision = choice(why_not, members, duration, tolerance, wanted.names)
    chosen = decision.engine
    if chosen == PLAIN:
        validate_plain(wanted.names)
    if chosen not in (PLAIN, RETIRED):
        engine_of(chosen)
    validate_measures(wanted.names, scene)
    keeps_end = output == END if isinstance(output, str) else output is None and not measures
    checked = () if chosen == PLAIN else sample_of(members.size, check)
    question = EnsembleRequest(members, duration, tolerance, chosen, wanted, times, keeps_end, checked)
    fitting = chunk or chunk_of(scene, duration, tolerance, len(question.wanted.times), chosen)
    if (numbers := members.size * len(times) * 2 * scene.n_links) > 2 * GROWTH_SAMPLES_MAX:
        raise SceneError([f"output: {numbers:.3g} numbers are too many to store: use fewer samples, or measures"])
    return replace(question, chunk=fitting), decision


def _times(scene: Scene, duration: float, output: Output) -> tuple[float, ...]:
    if output is None or (isinstance(output, str) and output == END):
        return ()
    if isinstance(output, str):
        raise SceneError([f'output "{output}": must be "end", a number of samples or their times in seconds'])
    return tuple(sample_times(scene, duration, 0.0, output).tolist())


def _run(
    question: EnsembleRequest,
    decision: Decision,
    parts: Parts | None,
    left: Sequence[int],
    workers: int | None,
    crew: Crew | None,
    report: Report,
) -> Ensemble:
    kept: dict[int, Chunk] = {}
    done = question.members.size - sum(_size(question, number) for number in left)
    report(done)
    if expect := getattr(report, "expect", None):
        expect(_seconds_left(question, len(left), workers, crew), done)
    interrupted = False
    try:
        with closing(_chunks(question, decision.forgone, left, workers, crew)) as chunks:
            for number, chunk in chunks:
                if parts:
                    parts.keep(number, chunk)
                else:
                    kept[number] = chunk
                done += chunk.size
                report(done)
    except KeyboardInterrupt:
        interrupted = True
    return Ensemble(question, parts or [kept[number] for number in sorted(kept)], decision.reason, interrupted)


def _seconds_left(question: EnsembleRequest, left: int, workers: int | None, crew: Crew | None) -> float:
    """Roughly how long this many chunks take together (s)."""
    count = pool_of(crew).size if crew is not None else workers or cores()
    return seconds_of(question, left) / max(min(count, left), 1)


def _size(question: EnsembleRequest, number: int) -> int:
    return min(question.chunk, question.members.size - number * question.chunk)


def _chunks(
    question: EnsembleRequest,
    forgone: Forgone,
    left: Sequence[int],
    workers: int | None,
    crew: Crew | None,
) -> Generator[Numbered, None, None]:
    """The remaining chunks, by their numbers, as they come, without the saving of an engine that is not ready."""
    count = min(workers or cores(), max(len(left), 1))
    few = workers is None and seconds_of(question, len(left)) < PROCESS_SECONDS
    if crew is None and (count == 1 or few):
        for number in left:
            with rent(forgone):
                chunk = compute(question, question.part(number))
            yield number, chunk
        return
    lose(forgone, seconds_of(question, len(left)) / count)
    # with one member's worth of what may be many
    members = question.members
    lists = {path: numbers[:1] for path, numbers in (members.lists or {}).items()}
    states = None if members.states is None else members.states.at(slice(0, 1))
    small = replace(question, members=Members(members.scene, members.axes, lists, states))
    tasks = (ChunkTask(number, small, question.part(number)) for number in left)
    yield from computed(work, tasks, crew, count, _died)


@dataclass(frozen=True, eq=False)
class ChunkTask:
    """A chunk for a worker: its number, the question without other members' numbers, its own members."""

    number: int
    question: EnsembleRequest
    part: Any


def work(task: ChunkTask) -> Numbered:
    """The task of a worker."""
    return task.number, compute(task.question, task.part)


def _died(task: ChunkTask) -> Numbered:
    """A chunk at which its process died."""
    first, size = task.part.first, task.part.size
    return task.number, Chunk(first, size, {}, dict.fromkeys(range(first, first + size), DIED), {})
