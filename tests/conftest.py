"""What the workers of the tests share: files, cores, compiled modules, and kernels wherever a test has its home."""

import gc
import os
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path

import pytest
from daily_set import QUICK, by_function, in_order, read

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"):
    os.environ.setdefault(name, "1")
os.environ.setdefault("XDG_CACHE_HOME", str(Path.home() / ".cache"))
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False


def pytest_configure(config: pytest.Config) -> None:
    """Workers take files in the order below: `--no-loadscope-reorder`, which xdist has from 3.8 on."""
    config.option.loadscopereorder = False


SCENES = os.environ.get("MULTIPENDULA_SCENES")
"""`all` cases, four of `each` function, or those of every day."""
DAILY = read()
MANUAL = ("site", "page")
"""The manual, its pictures and lessons, and the commands that they show: not of every day."""


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """What belongs to the manual is not even read where nobody names it."""
    if SCENES == "all" or any(f"tests/{folder}" in argument for folder in MANUAL for argument in config.args):
        return None
    return (collection_path.parent == Path(__file__).parent and collection_path.name in MANUAL) or None


def _chosen(name: str, cases: list[pytest.Item], *, named: bool) -> list[pytest.Item]:
    """The cases of a function that run, in a file that is named or not."""
    if SCENES == "each" or cases[0].path.parent.name in MANUAL:
        return in_order(cases)
    if row := DAILY.get(name):
        return in_order(cases)[: None if named else row.cases]
    return cases


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """The cases of every day, unless all are asked for or a file is named; the files that take longest first."""
    if SCENES != "all":
        named = any(".py" in argument for argument in config.args)
        functions = by_function(items, lambda item: item.nodeid)
        chosen = {item for name, cases in functions.items() for item in _chosen(name, cases, named=named)}
        config.hook.pytest_deselected(items=[item for item in items if item not in chosen])
        items[:] = [item for item in items if item in chosen]
    taken = Counter[Path]()
    for item in items:
        if row := DAILY.get(item.nodeid.partition("[")[0]):
            taken[item.path] += row.seconds
            if row.seconds >= QUICK:
                item.add_marker("slow")
    items.sort(key=lambda item: -taken[item.path])


def pytest_collection_finish() -> None:
    """What was collected stays to the end: garbage is not looked for in it, and seldom elsewhere."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000)


@pytest.fixture(scope="session", autouse=True)
def same_engine() -> Iterator[None]:
    """Nothing runs by another engine for what its process, or this machine, has compiled before."""
    from nonlinear.integration.readiness import reproducible

    with reproducible():
        yield


@pytest.fixture
def any_engine(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Engines are chosen as for users, beginning with none that has been paid for."""
    from nonlinear.integration import readiness

    monkeypatch.setattr(readiness, "_saved_seconds", defaultdict(float))
    token = readiness._reproducible_share.set(False)
    yield
    readiness._reproducible_share.reset(token)
