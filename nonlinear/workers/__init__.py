"""Work spread over processes, or over any other `concurrent.futures.Executor`.

In: a function and portions of work.  Out: what it returns, as it comes; portions whose workers died are handed back.
Start with `executors`; `cluster` reaches the workers of a Dask cluster.
"""

from nonlinear.workers.executors import DIED, WorkerPool, cores, processes, spread

__all__ = ["DIED", "WorkerPool", "cores", "processes", "spread"]
