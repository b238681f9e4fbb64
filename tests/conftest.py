"""What the workers of the tests share: files, cores, compiled modules, and kernels wherever a test has its home."""

import gc
import os
import sys
from pathlib import Path

import pytest

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"):
    os.environ.setdefault(name, "1")
os.environ.setdefault("XDG_CACHE_HOME", str(Path.home() / ".cache"))
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False


def pytest_configure(config: pytest.Config) -> None:
    """Workers take files in the order below: `--no-loadscope-reorder`, which xdist has from 3.8 on."""
    config.option.loadscopereorder = False


LONGEST = ["test_documents.py", "test_clocks.py", "test_branches.py", "test_pictures.py", "test_sync.py"]
"""Files that take a worker half a minute or nearly so."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The longest files first, then those with slow tests, so that no worker waits for another at the end."""
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    longest = {name: place for place, name in enumerate(LONGEST)}
    items.sort(key=lambda item: (longest.get(item.path.name, len(longest)), item.path not in slow))


def pytest_collection_finish() -> None:
    """What was collected stays to the end: garbage is not looked for in it, and seldom elsewhere."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000)


@pytest.fixture(autouse=True)
def nothing_rented() -> None:
    """No test begins with what others have spent: it would decide which engine runs."""
    if readiness := sys.modules.get("nonlinear.integration.readiness"):
        readiness._saved.clear()
