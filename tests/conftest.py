"""What the workers of the tests share: cores, and a kernel that is compiled once."""

import os

import pytest

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"):
    os.environ.setdefault(name, "1")


def pytest_sessionstart(session: pytest.Session) -> None:
    """Compile the kernel of orbits before the workers start: as long as it is in no cache, they do without it."""
    if not getattr(session.config.option, "numprocesses", 0):
        return
    import numpy as np

    from modal import load
    from modal.eigen.compiling import available
    from nonlinear.orbits.flow import Flow
    from nonlinear.system import system_of

    system = system_of(load("chain-1"))
    if available() and not Flow(system).compiled:
        Flow(system, fast=True)(np.array([0.1, 0.0]), np.eye(2), 0.1)
