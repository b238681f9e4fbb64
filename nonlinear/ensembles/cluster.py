"""The workers of a running Dask cluster, through the extra `cluster`."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

from modal.errors import ComputationError, MissingExtraError
from nonlinear.ensembles.executors import KeptPool, WorkerPool, Workers


@contextmanager
def cluster(address: str, patience: float = 10.0) -> Iterator[WorkerPool]:
    """All workers of a scheduler such as tcp://192.168.0.2:8786; they need this package installed.

    It has `patience` seconds to answer. Raise MissingExtraError without the package `distributed`, ComputationError if
    no scheduler answers or it has no workers.
    """
    try:
        from distributed import Client
    except ImportError:
        raise MissingExtraError("distributed", "cluster") from None
    try:
        client = Client(address, timeout=patience, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        client, reason = None, " ".join(str(error).split())
    if client is None:
        # A client that never connected would otherwise be finalised at any time, and wait for a lock that the start of
        # another one holds.
        gc.collect()
        raise ComputationError(f"{address}: no scheduler responds ({reason})")
    with client:
        size = sum(client.nthreads().values())
        if not size:
            raise ComputationError(f"{address}: the scheduler has no workers")
        executor = client.get_executor()
        try:
            yield WorkerPool(executor, size)
        finally:
            executor.shutdown(wait=False)


@contextmanager
def workers_at(scheduler: str | None, workers: int | None = None) -> Iterator[Workers]:
    """The workers of a Dask cluster at the address of its scheduler, or without one processes of this machine.

    The processes are started once.  Raises what `cluster` does.
    """
    if not scheduler:
        with ExitStack() as stack:
            yield Workers(workers, pool=KeptPool(stack))
        return
    with cluster(scheduler) as crew:
        yield Workers(crew=crew)
