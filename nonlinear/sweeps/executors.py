"""The workers of a sweep: processes on this machine, or any other `concurrent.futures.Executor`."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor, Executor, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import active_children, get_context, parent_process
from threading import Thread
from typing import NamedTuple

from modal.errors import ComputationError
from nonlinear.dynamics import children_without_interrupts

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
    parent = parent_process()
    if parent:
        parent.join()
        os._exit(1)


def _start(pool: ProcessPoolExecutor, count: int) -> None:
    try:
        with children_without_interrupts():
            first, *_ = [pool.submit(int) for _ in range(count)]
        first.result()
    except BrokenExecutor:
        raise ComputationError(
            "worker processes cannot start: in your own script, put the sweep under "
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
