"""Workers: processes on this machine, or any other `concurrent.futures.Executor`."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from contextlib import contextmanager
from itertools import islice
from threading import Thread
from typing import NamedTuple, TypeVar

from modal.errors import ComputationError
from nonlinear.dynamics import children_without_interrupts

AHEAD = 2
"""How many portions a worker has before it, its own included."""
DIED = "its process died, perhaps for lack of memory"
P = TypeVar("P")
R = TypeVar("R")
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")


class WorkerPool(NamedTuple):
    """An executor and the number of points it processes at a time."""

    executor: Executor
    size: int


def cores() -> int:
    """Number of cores available to this process."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def processes(count: int) -> Iterator[WorkerPool]:
    """A pool of `count` processes, each with one thread, started afresh on every platform and isolated from Ctrl-C.

    An error or Ctrl-C in the block ends them at once, and so does the end of this process, however it comes.  Raises
    ComputationError where they cannot start.
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


def spread(
    function: Callable[[P], R], portions: Iterator[P], crew: WorkerPool
) -> Generator[tuple[P, R], None, list[P]]:
    """Portions with what the function makes of them, as they come, a few in flight at a time.

    Portions whose workers died are handed back.  Raises ComputationError where the function fails.
    """
    flying: dict[Future[R], P] = {}
    try:
        while True:
            for portion in islice(portions, AHEAD * crew.size - len(flying)):
                flying[_handed(function, portion, crew)] = portion
            if not flying:
                return []
            done = wait(flying, return_when=FIRST_COMPLETED).done
            if any(isinstance(future.exception(), BrokenExecutor) for future in done):
                break
            for future in done:
                yield flying[future], future.result()
                del flying[future]
        for future in wait(flying).done:
            if not future.exception():
                yield flying[future], future.result()
                del flying[future]
        return list(flying.values())
    except Exception as error:
        raise ComputationError(f"a worker failed: {type(error).__name__}: {error}") from error
    finally:
        for future in flying:
            future.cancel()


def _handed(function: Callable[[P], R], portion: P, crew: WorkerPool) -> Future[R]:
    try:
        return crew.executor.submit(function, portion)
    except BrokenExecutor as error:
        failed: Future[R] = Future()
        failed.set_exception(error)
        return failed
