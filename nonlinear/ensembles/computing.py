"""A chunk of members, computed: by an engine side by side, or one by one by `simulate`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from modal.errors import ComputationError, MultipendulaError
from modal.types import Floats
from nonlinear.dynamics import Lanes
from nonlinear.ensembles import lanes, plain
from nonlinear.ensembles.energies import Accounts
from nonlinear.ensembles.measures import COLUMNS, Columns, Context
from nonlinear.ensembles.members import RATIO, MemberBlock, MemberPart
from nonlinear.ensembles.plain import state_columns
from nonlinear.ensembles.question import COMPILED, LANES, PLAIN, EnsembleRequest
from nonlinear.ensembles.results import MemberResults, Wanted
from nonlinear.integration.readiness import reproducible
from nonlinear.simulation import simulate
from nonlinear.system import Layout, Numbers, apart, numbers_of

Engine = Callable[[Numbers, Floats, Wanted], MemberResults]


@dataclass(frozen=True, eq=False)
class Chunk:
    """S members from `first` on: `columns` (S, ...), crossings apart; why some failed, by their numbers.

    `differences` (rad) are those at the end of members that were also run by themselves; NaN where a member lies beyond
    its horizon.
    """

    first: int
    size: int
    columns: Columns
    reasons: dict[int, str]
    differences: dict[int, float]


def engine_of(name: str) -> Engine:
    """The engine of this name; MissingExtraError where what it needs is not installed."""
    if name == LANES:
        return lanes.run
    if name == COMPILED:
        from nonlinear.ensembles import compiled

        return compiled.run
    from nonlinear.ensembles import series

    return series.run


def compute(question: EnsembleRequest, part: MemberPart) -> Chunk:
    """A chunk of a question."""
    if question.engine == PLAIN:
        return _one_by_one(question, part)
    layout = _layout(question)
    block = part.block(layout)
    found = engine_of(question.engine)(block.numbers, block.y, question.wanted)
    context = Context(question.scene, question.system, block.numbers, layout, block.y, question.wanted)
    drift = Accounts(block.numbers, layout).drift(block.y, found.y, question.duration, found.rubbed)
    return _chunk(question, part, block, context, found, drift)


def _layout(question: EnsembleRequest) -> Layout:
    """The parts of y; work is counted where any member might do any."""
    differing = {place: np.ones(1) for place in question.members.part(0, 1).places if "start" not in place}
    found = Lanes(numbers_of(question.scene, differing, question.system)).layout
    return replace(found, works=found.works or any(place[0] == RATIO for place in differing))


def _chunk(
    question: EnsembleRequest,
    part: MemberPart,
    block: MemberBlock,
    context: Context,
    found: MemberResults,
    drift: Floats,
) -> Chunk:
    ending, kept = _rows(question, found)
    columns: Columns = {"energy_drift": drift, "error_rad": found.error, "horizon_s": found.horizon}
    for name in question.measures.names:
        columns |= COLUMNS[name](context, found, ending)
    if question.keeps_end:
        columns |= states(context.layout, found.y.T)
    if question.times:
        columns |= states(context.layout, kept)
    failed = [*found.reasons]
    for own in columns.values():
        own[failed] = np.nan
    reasons = block.reasons | {int(block.places[k]): reason for k, reason in found.reasons.items()}
    whole = {name: _placed(own, block, part.size) for name, own in columns.items()}
    if found.crossed is not None:
        whole |= _crossings(context.layout, part, block, found)
    differences = _differences(question, part, block, context.layout, found)
    numbered = {part.first + place: reason for place, reason in sorted(reasons.items())}
    return Chunk(part.first, part.size, whole, numbered, differences)


def _rows(question: EnsembleRequest, found: MemberResults) -> tuple[Floats, Floats]:
    """Samples of the last tenth and those to keep, (S, K, size) each."""
    if found.rows is None:
        none = np.empty((found.y.shape[1], 0, len(found.y)))
        return none, none
    times = np.array(question.wanted.times)
    pick = (np.searchsorted(times, own) for own in (question.ending, question.times))
    ending, kept = (found.rows[:, rows] for rows in pick)
    return ending, kept


def states(layout: Layout, rows: Floats) -> Columns:
    """The parts of y (..., size) as columns."""
    motion = layout.read(rows.reshape(-1, rows.shape[-1]))
    found = {column: getattr(motion, part) for part, column in state_columns(layout.is_structured).items()}
    return {name: own.reshape(*rows.shape[:-1], *own.shape[1:]).copy() for name, own in found.items()}


def _placed(own: Floats, block: MemberBlock, size: int) -> Floats:
    """A column of those members that can be among all."""
    if len(block.places) == size:
        return own
    whole = np.full((size, *own.shape[1:]), np.nan)
    whole[block.places] = own
    return whole


def _crossings(layout: Layout, part: MemberPart, block: MemberBlock, found: MemberResults) -> Columns:
    assert found.crossed is not None
    members, times, rows = found.crossed
    numbers = (part.first + block.places[members]).astype(float)
    crossed = {"member": numbers, "time_s": times} | states(layout, rows)
    return {f"crossing_{name}": own for name, own in crossed.items()}


def _differences(
    question: EnsembleRequest, part: MemberPart, block: MemberBlock, layout: Layout, found: MemberResults
) -> dict[int, float]:
    """The largest angle at the end between members that are checked and runs by themselves."""
    result = {}
    for number in question.checked:
        place = number - part.first
        if not 0 <= place < part.size or place not in set(block.places.tolist()):
            continue
        column = int(np.searchsorted(block.places, place))
        if column in found.reasons:
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
        known = not found.horizon[column] < question.duration
        distance = apart(layout.read(found.y[None, :, column]), run.motion.at(slice(-1, None)))
        result[number] = float(distance[0]) if known else float("nan")
    return result


def _one_by_one(question: EnsembleRequest, part: MemberPart) -> Chunk:
    """Every member by `simulate`."""
    rows: list[Columns | None] = []
    reasons: dict[int, str] = {}
    crossings: list[Columns] = []
    for place in range(part.size):
        try:
            one = plain.columns(question, part.scene_of(place), part.state_of(place))
            crossings.append(_of_member(part.first + place, one))
            rows.append(one)
        except MultipendulaError as error:
            reasons[part.first + place] = " ".join(str(error).split())
            rows.append(None)
    first = next((one for one in rows if one is not None), {})
    columns = {
        name: np.array([np.full_like(own, np.nan) if one is None else one[name] for one in rows])
        for name, own in first.items()
    }
    if crossings and crossings[0]:
        columns |= {name: np.concatenate([one[name] for one in crossings]) for name in crossings[0]}
    return Chunk(part.first, part.size, columns, reasons, {})


def _of_member(number: int, columns: Columns) -> Columns:
    """The crossings of a run by itself, taken out of its columns."""
    found = {name: columns.pop(name) for name in [*columns] if name.startswith("crossing_")}
    if found:
        found = {"crossing_member": np.full(len(found["crossing_time_s"]), float(number)), **found}
    return found
