"""Computation of a chunk of members: at once by an engine, or one at a time by `simulate`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from modal.errors import ComputationError, MultipendulaError
from modal.types import Floats
from nonlinear.dynamics import Lanes
from nonlinear.ensembles import lanes, plain
from nonlinear.ensembles.energies import Accounts
from nonlinear.ensembles.measures import Columns, Context, columns_of_members
from nonlinear.ensembles.members import RATIO, MemberBlock, MemberPart
from nonlinear.ensembles.plain import state_columns
from nonlinear.ensembles.question import LANES, PLAIN, EnsembleRequest
from nonlinear.ensembles.results import MemberResults, Wanted
from nonlinear.integration.readiness import reproducible
from nonlinear.simulation import simulate
from nonlinear.system import Layout, Numbers, apart, numbers_of

DISAGREES = "a run of it alone ends"
Engine = Callable[[Numbers, Floats, Wanted], MemberResults]


@dataclass(frozen=True, eq=False)
class Chunk:
    """S members from `first` on: `columns` (S, ...), crossings apart; why some failed, by their numbers.

    `differences` (rad) are those at the end of members that were also run by themselves; NaN if a member lies beyond
    its horizon.
    """

    first: int
    size: int
    columns: Columns
    reasons: dict[int, str]
    differences: dict[int, float]


def engine_of(name: str) -> Engine:
    """Return the engine of this name; raise MissingExtraError if its requirements are not installed."""
    if name == LANES:
        return lanes.run
    from nonlinear.ensembles import compiled

    return compiled.run


def compute(question: EnsembleRequest, part: MemberPart) -> Chunk:
    """Compute a chunk of a request."""
    if question.engine == PLAIN:
        return _one_by_one(question, part)
    differing = {place: np.ones(1) for place in question.members.part(0, 1).places if "start" not in place}
    layout = Lanes(numbers_of(question.scene, differing, question.system)).layout
    # work is counted where any member might do any
    layout = replace(layout, works=layout.works or any(place[0] == RATIO for place in differing))
    block = part.block(layout)
    results = engine_of(question.engine)(block.numbers, block.y, question.wanted)
    context = Context(question.scene, question.system, block.numbers, layout, block.y, question.wanted)
    drift = Accounts(block.numbers, layout).drift(block.y, results.y, question.duration, results.rubbed)
    return _chunk(question, part, block, context, results, drift)


def _chunk(
    question: EnsembleRequest,
    part: MemberPart,
    block: MemberBlock,
    context: Context,
    results: MemberResults,
    drift: Floats,
) -> Chunk:
    ending, kept = _rows(question, results)
    columns: Columns = {"energy_drift": drift, "error_rad": results.error, "horizon_s": results.horizon}
    columns |= columns_of_members(question.measures.names, context, results, ending)
    if question.keeps_end:
        columns |= states(context.layout, results.y.T)
    if question.times:
        columns |= states(context.layout, kept)
    differences = _differences(question, part, block, context.layout, results)
    failures = results.reasons | _disagreements(part, block, results, differences)
    failed = [*failures]
    for values in columns.values():
        values[failed] = np.nan
    reasons = block.reasons | {int(block.places[k]): reason for k, reason in failures.items()}
    whole = columns
    if len(block.places) < part.size:  # those members that can be, among all
        whole = {name: np.full((part.size, *values.shape[1:]), np.nan) for name, values in columns.items()}
        for name, values in columns.items():
            whole[name][block.places] = values
    if results.crossed is not None:
        whole |= _crossings(context.layout, part, block, results, failed)
    numbered = {part.first + place: reason for place, reason in sorted(reasons.items())}
    return Chunk(part.first, part.size, whole, numbered, differences)


def _rows(question: EnsembleRequest, results: MemberResults) -> tuple[Floats, Floats]:
    """Samples of the last tenth and those to keep, (S, K, size) each."""
    if results.rows is None:
        none = np.empty((results.y.shape[1], 0, len(results.y)))
        return none, none
    times = np.array(question.wanted.times)
    pick = (np.searchsorted(times, moments) for moments in (question.ending, question.times))
    ending, kept = (results.rows[:, rows] for rows in pick)
    return ending, kept


def states(layout: Layout, rows: Floats) -> Columns:
    """The parts of y (..., size) as columns."""
    motion = layout.read(rows.reshape(-1, rows.shape[-1]))
    parts = {column: getattr(motion, part) for part, column in state_columns(layout.is_structured).items()}
    return {name: values.reshape(*rows.shape[:-1], *values.shape[1:]).copy() for name, values in parts.items()}


def _crossings(
    layout: Layout, part: MemberPart, block: MemberBlock, results: MemberResults, failed: list[int]
) -> Columns:
    assert results.crossed is not None
    members, times, rows = results.crossed
    believed = ~np.isin(members, failed)
    members, times, rows = members[believed], times[believed], rows[believed]
    numbers = (part.first + block.places[members]).astype(float)
    crossed = {"member": numbers, "time_s": times} | states(layout, rows)
    return {f"crossing_{name}": values for name, values in crossed.items()}


def _differences(
    question: EnsembleRequest, part: MemberPart, block: MemberBlock, layout: Layout, results: MemberResults
) -> dict[int, float]:
    """The largest angle at the end between members that are checked and runs by themselves."""
    result = {}
    for number in question.checked:
        place = number - part.first
        if not 0 <= place < part.size or place not in set(block.places.tolist()):
            continue
        column = int(np.searchsorted(block.places, place))
        if column in results.reasons:
            continue
        try:
            with reproducible():
                run = simulate(
                    part.scene_of(place),
                    question.duration,
                    start=part.state_of(place),
                    tolerance=question.tolerance,
                    output=2,
                )
        except ComputationError:
            result[number] = float("nan")
            continue
        known = not results.horizon[column] < question.duration
        distance = apart(layout.read(results.y[None, :, column]), run.motion.at(slice(-1, None)))
        result[number] = float(distance[0]) if known else float("nan")
    return result


def _disagreements(
    part: MemberPart, block: MemberBlock, results: MemberResults, differences: dict[int, float]
) -> dict[int, str]:
    """Why checked members are not believed, by column: two right answers differ by the errors of both at most."""
    reasons = {}
    for number, difference in differences.items():
        column = int(np.searchsorted(block.places, number - part.first))
        error = float(results.error[column])
        if difference > 2 * error:
            reasons[column] = f"{DISAGREES} {difference:.1e} rad away, where the estimated error is {error:.1e} rad"
    return reasons


def _one_by_one(question: EnsembleRequest, part: MemberPart) -> Chunk:
    """Every member by `simulate`."""
    rows: list[Columns | None] = []
    reasons: dict[int, str] = {}
    crossings: list[Columns] = []
    for place in range(part.size):
        try:
            member = plain.columns(question, part.scene_of(place), part.state_of(place))
            crossed = {name: member.pop(name) for name in [*member] if name.startswith("crossing_")}
            if crossed:
                number = np.full(len(crossed["crossing_time_s"]), float(part.first + place))
                crossed = {"crossing_member": number, **crossed}
            crossings.append(crossed)
            rows.append(member)
        except MultipendulaError as error:
            reasons[part.first + place] = " ".join(str(error).split())
            rows.append(None)
    first = next((member for member in rows if member is not None), {})
    columns = {
        name: np.array([np.full_like(values, np.nan) if member is None else member[name] for member in rows])
        for name, values in first.items()
    }
    if crossings and crossings[0]:
        columns |= {name: np.concatenate([member[name] for member in crossings]) for name in crossings[0]}
    return Chunk(part.first, part.size, columns, reasons, {})
