"""A crew for computations that are shared one by one: branches of orbits, fits, cases of a study, worst cases.

It has the `map` of an executor, to which `modal` and the rooms of `nonlinear` above this one hand what is independent,
and by `executors.computed` has done again what a worker lost.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, field
from functools import partial
from time import monotonic
from typing import Any, Generic, NamedTuple, TypeVar

from modal.errors import ComputationError
from nonlinear.ensembles.cluster import cluster
from nonlinear.ensembles.executors import DIED, Crew, WorkerPool, computed, cores, processes
from nonlinear.integration import validate_whole

PATIENCE = 0.5
"""Seconds that this process works alone before it starts others: what is small is done by then."""
STARTING = 2.0
"""Least seconds of remaining work that justify starting other processes, about what these take to start."""
R = TypeVar("R")


class NumberedTask(NamedTuple):
    """The arguments of one call, and its number."""

    number: int
    arguments: tuple[Any, ...]


class NumberedResult(NamedTuple, Generic[R]):
    """What a call gave, or its error."""

    number: int
    value: R | None
    error: Exception | None = None


@dataclass(eq=False)
class KeptPool:
    """Processes that are started where they are first asked for, and lent again until one dies or a call fails."""

    kept: ExitStack = field(default_factory=ExitStack)
    pool: WorkerPool | None = None

    @contextmanager
    def lent(self, count: int) -> Iterator[WorkerPool]:
        """At least `count` processes."""
        pool = self.pool
        if pool is None or pool.size < count or getattr(pool.executor, "_broken", False):
            self.kept.close()
            pool = self.pool = self.kept.enter_context(processes(count))
        try:
            yield pool
        except BaseException:
            self.pool = None
            self.kept.__exit__(*sys.exc_info())
            raise


@dataclass(frozen=True)
class Workers:
    """Those who compute what is independent: `workers` processes, by default one per core, or the `crew`, an executor.

    Results are the same to the bit whoever computes them.  This process begins, and starts others once enough is left
    to do; as many workers as things are started at once.

    >>> from nonlinear.ensembles import Workers
    >>> list(Workers().map(abs, [-1, 2, -3]))
    [1, 2, 3]
    """

    workers: int | None = None
    crew: Crew | None = None
    pool: KeptPool | None = None

    def __post_init__(self) -> None:
        validate_whole(1, optional=True, workers=self.workers)

    def map(self, function: Callable[..., R], /, *things: Iterable[Any]) -> Iterator[R]:
        """What the function makes of each, in their order; the error of the first that fails is raised in its place.

        Where this process works alone, things are asked for one by one.  Raises ComputationError for one at which
        process after process dies.
        """
        tasks = (NumberedTask(number, arguments) for number, arguments in enumerate(zip(*things, strict=False)))
        begun, alone = monotonic(), self.crew is None and (self.pool is None or self.pool.pool is None)
        if alone and self.workers not in {None, 1}:
            left = list(tasks)
            tasks, alone = (each for each in left), len(left) > (self.workers or 1)
        while alone and (task := next(tasks, None)) is not None:
            yield function(*task.arguments)
            seconds = monotonic() - begun
            if seconds > PATIENCE and (self.workers or cores()) > 1:
                left = list(tasks)
                alone = len(left) < 2 or seconds / (task.number + 1) * len(left) < STARTING
                tasks = (each for each in left)
        yield from self._shared(function, list(tasks))

    def _shared(self, function: Callable[..., R], tasks: list[NumberedTask]) -> Iterator[R]:
        if not tasks or (self.crew is None and len(tasks) < 2):
            yield from (function(*task.arguments) for task in tasks)
            return
        count, early, due = min(self.workers or cores(), len(tasks)), dict[int, NumberedResult[R]](), tasks[0].number
        crew = self.crew or (partial(self.pool.lent, count) if self.pool else None)
        with closing(computed(NumberedCall(function), iter(tasks), crew, count, _whole, _died)) as outcomes:
            for outcome in outcomes:
                early[outcome.number] = outcome
                while due in early:
                    ready = early.pop(due)
                    if ready.error is not None:
                        raise ready.error
                    yield ready.value  # type: ignore[misc]
                    due += 1


@dataclass(frozen=True)
class NumberedCall(Generic[R]):
    """A function whose errors come back in the order of what it is asked."""

    function: Callable[..., R]

    def __call__(self, task: NumberedTask) -> NumberedResult[R]:
        """What the function gives, or its error."""
        try:
            return NumberedResult(task.number, self.function(*task.arguments))
        except Exception as error:
            return NumberedResult(task.number, None, error)


def _whole(task: NumberedTask) -> list[NumberedTask]:
    return [task]


def _died(task: NumberedTask) -> NumberedResult[Any]:
    return NumberedResult(task.number, None, ComputationError(DIED))


@contextmanager
def workers_at(scheduler: str | None, workers: int | None = None) -> Iterator[Workers]:
    """Those of a Dask cluster at the address of its scheduler, or without one processes of this machine.

    The processes are started once.  Raises what `cluster` does.
    """
    if not scheduler:
        with ExitStack() as kept:
            yield Workers(workers, pool=KeptPool(kept))
        return
    with cluster(scheduler) as crew:
        yield Workers(crew=crew)
