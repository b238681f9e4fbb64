"""What each way costs, and that what a process has paid for is not counted again."""

from __future__ import annotations

import os
import sys
from math import inf
from pathlib import Path
from types import SimpleNamespace

import pytest

from modal import Bob, Pendulum, Scene, load
from nonlinear.dynamics import compiled as kernels
from nonlinear.integration import choose, costs, methods, taylor
from nonlinear.integration.costs import COMPILED, HEYOKA, LINKED, NUMBA
from nonlinear.simulation import simulate
from nonlinear.system import state_at_rest, system_of

fast = pytest.mark.skipif(not kernels.available(), reason="numba is not installed")
series = pytest.mark.skipif(not taylor.available(), reason="heyoka is not installed")
CART = load("paper-cart-2")


@pytest.fixture
def fresh(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """A process that has loaded nothing yet, with both extras installed."""
    for name in ("numba", "heyoka", "nonlinear.integration.compiled"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    monkeypatch.setattr(taylor, "_COMPILED", taylor.Originals())
    monkeypatch.setattr(taylor, "available", lambda: True)
    for module in (costs, methods):
        monkeypatch.setattr(module, "find_spec", lambda name: SimpleNamespace())
    monkeypatch.setattr(costs, "kept", lambda: True)
    return monkeypatch


def chosen(scene: Scene, duration: float, tolerance: float = 1e-9) -> tuple[str, bool]:
    found = choose(scene, duration, tolerance)
    return found.method, found.compiled


def test_loading_and_compiling_count_where_they_are_still_to_be_paid(fresh: pytest.MonkeyPatch) -> None:
    assert costs.owed_to_numba() == NUMBA + LINKED
    fresh.setattr(costs, "kept", lambda: False)
    assert costs.owed_to_numba() == NUMBA + LINKED + COMPILED
    fresh.setitem(sys.modules, "numba", SimpleNamespace())
    assert costs.owed_to_numba() == LINKED + COMPILED
    fresh.setitem(sys.modules, "nonlinear.integration.compiled", SimpleNamespace(loaded=lambda: True))
    assert costs.owed_to_numba() == 0.0
    first = costs.owed_to_heyoka(system_of(CART), 1e-9)
    fresh.setitem(sys.modules, "heyoka", SimpleNamespace())
    assert costs.owed_to_heyoka(system_of(CART), 1e-9) == pytest.approx(first - HEYOKA)
    fresh.setattr(taylor, "ready", lambda system, tolerance: True)
    assert costs.owed_to_heyoka(system_of(CART), 1e-9) == 0.0


def test_what_is_not_installed_is_never_taken(fresh: pytest.MonkeyPatch) -> None:
    fresh.setattr(taylor, "available", lambda: False)
    for module in (costs, methods):
        fresh.setattr(module, "find_spec", lambda name: None)
    assert costs.owed_to_numba() == costs.owed_to_heyoka(system_of(CART), 1e-9) == inf
    assert chosen(CART, 1e6) == ("DOP853", False)


def test_a_short_run_takes_floats_and_a_long_one_what_pays(fresh: pytest.MonkeyPatch) -> None:
    chain = Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0, count=100)])])
    assert chosen(CART, 10.0) == ("DOP853", False)
    assert chosen(CART, 1000.0) != ("DOP853", False)
    assert chosen(chain, 10.0) == ("DOP853", True)
    fresh.setattr(costs, "kept", lambda: False)
    assert chosen(chain, 10.0) == ("DOP853", False)
    fresh.setitem(sys.modules, "nonlinear.integration.compiled", SimpleNamespace(loaded=lambda: True))
    assert chosen(CART, 10.0) == ("DOP853", True)
    assert choose(CART, 10.0, 1e-9, "RK45").compiled is False


def test_a_file_that_numba_keeps_is_found_and_one_older_than_the_source_is_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert not costs.kept()
    file = tmp_path / "integration_0" / "compiled._steps-1.py3.nbi"
    file.parent.mkdir()
    file.touch()
    assert costs.kept()
    os.utime(file, (0, 0))
    assert not costs.kept()


@fast
def test_numba_keeps_the_integrator_where_it_is_looked_for() -> None:
    from nonlinear.integration import compiled

    scene = load("chain-3")
    simulate(scene, 0.1, method="DOP853")
    equations = kernels.Compiled(system_of(scene))
    start = equations.begin(state_at_rest(scene, [10.0, 20.0, 30.0]))
    stepper = compiled.CompiledStepper(equations, 0.0, start, 1.0, 1e-6, 1e-6 * equations.scale)
    stepper.step()
    assert compiled.loaded()
    assert costs.owed_to_numba() == 0.0
    assert costs.kept() == bool(compiled._steps.stats.cache_path)


@fast
def test_compiling_is_announced_on_a_terminal_where_nothing_is_kept(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from nonlinear.integration import compiled

    for there, kept, terminal in (
        (False, False, True),
        (False, False, False),
        (False, True, True),
        (True, False, True),
    ):
        monkeypatch.setattr(compiled, "loaded", lambda there=there: there)
        monkeypatch.setattr(compiled, "kept", lambda kept=kept: kept)
        monkeypatch.setattr(sys.stderr, "isatty", lambda terminal=terminal: terminal)
        with compiled.announced():
            pass
        assert bool(capsys.readouterr().err) == (not there and not kept and terminal)


@series
def test_a_series_that_is_compiled_counts_no_more(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(taylor, "_COMPILED", taylor.Originals())
    scene, tolerance = load("chain-2"), 1e-13
    before = costs.costs(scene, system_of(scene), 1.0, tolerance)["taylor"]
    simulate(scene, 0.1, method="taylor", tolerance=tolerance, start=state_at_rest(scene, [100.0, 100.0]))
    after = costs.costs(scene, system_of(scene), 1.0, tolerance)["taylor"]
    assert after < 0.1 < before
