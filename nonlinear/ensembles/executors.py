"""Workers: processes on this machine, any other `concurrent.futures.Executor`, or a factory of one.

`Workers` have the `map` of an executor, for single tasks: branches of orbits, fits, cases of a study.

>>> from concurrent.futures import ThreadPoolExecutor
>>> from modal import load
>>> from nonlinear import ensemble
>>> ensemble(load("chain-1"), 1.0, starts=[[0.1], [0.2]], engine="numpy", crew=ThreadPoolExecutor).size
2
"""

from __future__ import annotations

import os
import signal
import sys
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Executor, Future, wait
from contextlib import AbstractContextManager, ExitStack, closing, contextmanager
from dataclasses import dataclass, field
from functools import partial
from itertools import chain, islice
from threading import Thread
from time import monotonic
from typing import Any, Generic, NamedTuple, TypeVar, cast

from modal.errors import ComputationError
from modal.report import Displayed
from nonlinear.dynamics import children_without_interrupts
from nonlinear.integration import validate_whole

DIED = "its process died, perhaps for lack of memory"
DEAD = "the workers have died: give a function that makes an executor in place of one, and their work is repeated"
SIZES = ("_max_workers", "max_workers", "num_workers")
"""Where executors of the standard library and loky, of executorlib and of mpi4py say how many workers they have."""
PROCESS_SECONDS = 2.0
"""Cost: the time to start other processes, and the least remaining work that justifies it; a quarter of that this
process works alone, as small tasks are done by then; benchmarks/ensembles.py."""
P = TypeVar("P")
R = TypeVar("R")
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")


class WorkerPool(NamedTuple):
    """An executor and the number of points it processes at a time."""

    executor: Executor
    size: int


Crew = WorkerPool | Executor | Callable[[], AbstractContextManager[WorkerPool | Executor]]
"""An executor, or a factory of one: its class, a function.  That is asked again where an executor has broken."""


def cores() -> int:
    """Number of cores available to this process."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def processes(count: int) -> Iterator[WorkerPool]:
    """A pool of `count` processes, each with one thread, started afresh on every platform and isolated from Ctrl-C.

    An error or Ctrl-C in the block ends them at once, and so does the end of this process, however it comes. Raise
    ComputationError if they cannot start.
    """
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import active_children, get_context

    others = set(active_children())
    with _one_thread_each():
        pool = ProcessPoolExecutor(count, mp_context=get_context("spawn"), initializer=_begun)
        try:
            _start(pool, count)
            yield WorkerPool(pool, count)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for process in set(active_children()) - others:
                process.terminate()
            raise
        pool.shutdown()


def _begun() -> None:
    """Leave Ctrl-C to the parent process, and end with the parent, however that ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    from multiprocessing import parent_process

    parent = parent_process()
    if parent:
        parent.join()
        os._exit(1)


def _start(pool: Executor, count: int) -> None:
    try:
        with children_without_interrupts():
            first, *_ = [pool.submit(int) for _ in range(count)]
        first.result()
    except BrokenExecutor:
        raise ComputationError(
            "worker processes cannot start: in your own script, put the call under "
            '`if __name__ == "__main__":`, or use workers=1'
        ) from None


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Keeps processes from competing for cores; a number of threads set by the user is kept."""
    ours = [name for name in THREADS if name not in os.environ]
    os.environ.update(dict.fromkeys(ours, "1"))
    try:
        yield
    finally:
        for name in ours:
            os.environ.pop(name, None)


def computed(
    function: Callable[[P], R],
    portions: Iterator[P],
    crew: Crew | None,
    count: int,
    lost: Callable[[P], R],
    divided: Callable[[P], Sequence[P]] | None = None,
) -> Generator[R, None, None]:
    """Yield a function's results for portions as they come, from a crew or `count` processes of this machine.

    Portions whose processes died are computed one by one by a new crew, and `divided`, if they can be, where they die
    again; `lost` is the result of a part whose process dies. Raise ComputationError if an executor has died that
    nobody replaces, or the function fails.
    """
    if crew is not None and not callable(crew):
        if (yield from _shared(function, portions, crew)):
            raise ComputationError(DEAD)
        return
    for first in portions:
        with (crew or partial(processes, count))() as pool:
            parts = deque((yield from _shared(function, chain([first], portions), pool)))
        while parts:
            with (crew or partial(processes, 1))() as worker:
                while parts:
                    part = parts.popleft()
                    if (yield from _shared(function, iter([part]), worker)):
                        smaller = divided(part) if divided else [part]
                        if len(smaller) == 1:
                            yield lost(part)
                        else:
                            parts.extendleft(reversed(smaller))
                        break


def pool_of(crew: Crew) -> WorkerPool:
    """An executor with the number of portions it takes at a time, which most say; of a factory, the number."""
    if isinstance(crew, WorkerPool):
        return crew
    sizes = (getattr(crew, name, None) for name in SIZES)
    return WorkerPool(cast("Executor", crew), next(filter(None, sizes), None) or cores())


class Failure(NamedTuple):
    """The error of a function in a worker: any other is the executor's, which has lost the worker."""

    error: Exception


@dataclass(frozen=True)
class WorkerCall(Generic[P, R]):
    """A function whose errors are distinguished from those of its executor."""

    function: Callable[[P], R]

    def __call__(self, portion: P) -> R | Failure:
        """The function's result, or its error."""
        try:
            return self.function(portion)
        except Exception as error:
            return Failure(error)


def _shared(
    function: Callable[[P], R], portions: Iterator[P], crew: WorkerPool | Executor
) -> Generator[R, None, list[P]]:
    """The function's results for portions, a few in flight at a time; those of an executor that broke are handed back.

    Portions that a working executor has lost or cancelled are submitted again, three times in all, in whatever words it
    tells of it.
    """
    executor, size = pool_of(crew)
    flying: dict[Future[R | Failure], tuple[P, int]] = {}
    try:
        while True:
            more = islice(portions, 2 * size - len(flying))  # one in work, one waiting
            flying |= {_submitted(function, portion, executor): (portion, 1) for portion in more}
            if not flying:
                return []
            done = wait(flying, return_when=FIRST_COMPLETED).done
            broken = any(isinstance(_error_of(future), BrokenExecutor) for future in done)
            lost: list[P] = []
            for future in wait(flying).done if broken else done:
                portion, tries = flying.pop(future)
                error = _error_of(future)
                if error is None:
                    result = future.result()
                    if isinstance(result, Failure):
                        raise result.error
                    yield result
                elif broken:
                    lost.append(portion)
                elif tries == 3 or not isinstance(error, Exception):
                    raise error
                else:
                    flying[_submitted(function, portion, executor)] = portion, tries + 1
            if broken:
                return lost
    except Exception as error:
        raise ComputationError(f"a worker failed: {type(error).__name__}: {error}") from error
    finally:
        for future in flying:
            future.cancel()


def _error_of(future: Future[R | Failure]) -> BaseException | None:
    """The outcome of a task that is done, cancelled ones included."""
    try:
        return future.exception()
    except CancelledError as error:
        return error


def _submitted(function: Callable[[P], R], portion: P, executor: Executor) -> Future[R | Failure]:
    try:
        return executor.submit(WorkerCall(function), portion)
    except BrokenExecutor as error:
        failed: Future[R | Failure] = Future()
        failed.set_exception(error)
        return failed


# ---------------------------------------------------------------------------------------- single tasks


class NumberedTask(NamedTuple):
    """The arguments of one call, and its number."""

    number: int
    arguments: tuple[Any, ...]


class NumberedResult(NamedTuple, Generic[R]):
    """The result of a call, or its error."""

    number: int
    value: R | None
    error: Exception | None = None


@dataclass(eq=False)
class KeptPool:
    """Processes that are started on first request, and reused until one dies or a call fails."""

    stack: ExitStack = field(default_factory=ExitStack)
    pool: WorkerPool | None = None

    @contextmanager
    def lend(self, count: int) -> Iterator[WorkerPool]:
        """At least `count` processes."""
        pool = self.pool
        if pool is None or pool.size < count or getattr(pool.executor, "_broken", False):
            self.stack.close()
            pool = self.pool = self.stack.enter_context(processes(count))
        try:
            yield pool
        except BaseException:
            self.pool = None
            self.stack.__exit__(*sys.exc_info())
            raise


@dataclass(frozen=True, repr=False)
class Workers(Displayed):
    """Workers for independent tasks: `workers` processes, by default one per core, or the executor `crew`.

    Results are the same to the bit on any worker.  This process begins, and starts others once enough is left
    to do; as many workers as things are started at once.

    >>> from nonlinear.ensembles import Workers
    >>> list(Workers().map(abs, [-1, 2, -3]))
    [1, 2, 3]
    """

    what = "Workers"
    shows = "workers: processes; crew: executor"

    workers: int | None = None
    crew: Crew | None = None
    pool: KeptPool | None = None

    def __post_init__(self) -> None:
        validate_whole(1, optional=True, workers=self.workers)

    def map(self, function: Callable[..., R], /, *things: Iterable[Any]) -> Iterator[R]:
        """The function's results, in order; the error of the first that fails is raised in its place.

        Where this process works alone, things are requested one by one. Raise ComputationError for one at which process
        after process dies.
        """
        tasks = (NumberedTask(number, arguments) for number, arguments in enumerate(zip(*things, strict=False)))
        begun, alone = monotonic(), self.crew is None and (self.pool is None or self.pool.pool is None)
        if alone and self.workers not in {None, 1}:
            left = list(tasks)
            tasks, alone = (task for task in left), len(left) > (self.workers or 1)
        while alone and (task := next(tasks, None)) is not None:
            yield function(*task.arguments)
            seconds = monotonic() - begun
            if seconds > PROCESS_SECONDS / 4 and (self.workers or cores()) > 1:
                left = list(tasks)
                alone = len(left) < 2 or seconds / (task.number + 1) * len(left) < PROCESS_SECONDS
                tasks = (each for each in left)
        yield from self._by_crew(function, list(tasks))

    def _by_crew(self, function: Callable[..., R], tasks: list[NumberedTask]) -> Iterator[R]:
        if not tasks or (self.crew is None and len(tasks) < 2):
            yield from (function(*task.arguments) for task in tasks)
            return
        count, early, due = min(self.workers or cores(), len(tasks)), dict[int, NumberedResult[R]](), tasks[0].number
        crew = self.crew or (partial(self.pool.lend, count) if self.pool else None)
        with closing(computed(NumberedCall(function), iter(tasks), crew, count, _failed)) as outcomes:
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
    """A function whose errors come back in the order of its calls."""

    function: Callable[..., R]

    def __call__(self, task: NumberedTask) -> NumberedResult[R]:
        """The function's result, or its error."""
        try:
            return NumberedResult(task.number, self.function(*task.arguments))
        except Exception as error:
            return NumberedResult(task.number, None, error)


def _failed(task: NumberedTask) -> NumberedResult[Any]:
    return NumberedResult(task.number, None, ComputationError(DIED))
