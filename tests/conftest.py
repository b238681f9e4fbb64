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


LONGEST = [
    "test_documents.py",
    "test_tuning.py",
    "test_advice.py",
    "test_scaling.py",
    "test_fitting.py",
    "test_sync.py",
    "test_strobes.py",
    "test_clocks.py",
    "test_populations.py",
    "test_sweeps.py",
    "test_forced.py",
    "test_extremes_motion.py",
]
"""Files that take a worker more than a quarter of a minute."""
CASES = 4
"""As many of each function are run every day; with `MULTIPENDULA_SCENES=all` all of them."""


def _spread_cases(items: list[pytest.Item]) -> list[pytest.Item]:
    """The first, the last and as many evenly between them of each function's cases."""
    by_function: dict[str, list[pytest.Item]] = {}
    for item in items:
        by_function.setdefault(item.nodeid.partition("[")[0], []).append(item)
    return [
        cases[place]
        for cases in by_function.values()
        for place in sorted({round(step * (len(cases) - 1) / (CASES - 1)) for step in range(CASES)})
    ]


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Few cases of each function, no thorough ones; the longest files first, then those with slow tests."""
    if os.environ.get("MULTIPENDULA_SCENES") != "all":
        later = {"thorough"} if "site" in config.option.markexpr else {"thorough", "site"}
        chosen = _spread_cases([item for item in items if later.isdisjoint(mark.name for mark in item.iter_markers())])
        config.hook.pytest_deselected(items=list(set(items).difference(chosen)))
        items[:] = chosen
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
