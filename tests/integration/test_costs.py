"""Which way of running is taken, given what is loaded, what is kept on disk and what runs have cost so far."""

from __future__ import annotations

import sys
from contextlib import nullcontext
from dataclasses import replace
from math import inf
from pathlib import Path
from types import SimpleNamespace

import pytest
from support.fresh import Process

from modal import Bob, Pendulum, Scene, load
from nonlinear.dynamics import compiled as kernels
from nonlinear.integration import choose, readiness, taylor
from nonlinear.integration.kernels import COMPILING_SECONDS, integrator
from nonlinear.integration.methods import offers
from nonlinear.integration.readiness import (
    LINKING,
    LOADING,
    Code,
    Offer,
    best_of,
    forgone_by,
    look_up,
    lose,
    make_ready,
    rent,
    reproducible,
)
from nonlinear.simulation import simulate
from nonlinear.system import state_at_rest, system_of

pytestmark = pytest.mark.usefixtures("any_engine")

fast = pytest.mark.skipif(not kernels.available(), reason="numba is not installed")
heyoka = pytest.mark.skipif(not taylor.available(), reason="heyoka is not installed")
CART = load("paper-cart-2")
INTEGRATOR = integrator().name
CHAIN = Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0, count=100)])])


@pytest.fixture
def process(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Process:
    return Process(monkeypatch, tmp_path)


def chosen(scene: Scene, duration: float, tolerance: float = 1e-9) -> tuple[str, bool]:
    choice = choose(scene, duration, tolerance)
    return choice.method, choice.compiled


def test_what_is_owed_depends_on_what_is_loaded_and_kept(process: Process) -> None:
    code = Code("numba", "kernel", 7.0)
    loading, linking = LOADING["numba"], LINKING["numba"]
    assert code.owed == pytest.approx(loading + linking + 7.0)
    assert replace(code, kept=True).owed == loading + linking
    process.load("numba")
    assert code.owed == linking + 7.0
    assert replace(code, is_ready=True).owed == 0.0
    assert replace(code, is_ready=True, kept=True, expected_seconds=6.0).anew == loading + 6.0
    with reproducible():
        assert replace(code, is_ready=True).owed == inf
    process.install()
    assert code.owed == code.anew == inf


def test_who_rents_buys_once_the_rent_has_paid_the_price(process: Process) -> None:
    """Runs of one second that would take a tenth: compiling for nine seconds pays after nine of them."""
    process.load("numba")
    price = 9.0 - LINKING["numba"] - 0.05
    code = Code("numba", "kernel", price, expected_seconds=price)
    ways = {
        "plain": Offer(1.0),
        "fast": Offer(0.1, code),
        "slow": Offer(2.0, Code("numba", "other", 0.0, is_ready=True)),
    }
    taken = [best_of(ways)]
    while taken[-1] == "plain" and len(taken) < 20:
        forgone = forgone_by(ways, "plain")
        assert forgone == (("kernel", pytest.approx(0.9)),)
        lose(forgone, 1.0)
        taken.append(best_of(ways))
    assert taken == ["plain"] * 9 + ["fast"]
    assert best_of(ways, anew=True) == "plain"
    assert forgone_by(ways, "fast") == ()
    with reproducible():
        assert forgone_by(ways, "plain") == ()


def test_rent_is_what_a_run_takes(process: Process, monkeypatch: pytest.MonkeyPatch) -> None:
    clock = iter([3.0, 5.0])
    monkeypatch.setattr(readiness, "thread_time", lambda: next(clock))
    with rent((("kernel", 0.5),)):
        pass
    assert Code("numba", "kernel", 1.0).saved_seconds == 1.0


def test_a_run_takes_what_is_ready_and_compiles_what_pays(process: Process) -> None:
    assert chosen(CART, 0.1) == ("DOP853", False)
    assert chosen(CART, 1000.0) != ("DOP853", False)
    assert chosen(CHAIN, 5.0) == ("DOP853", False)
    process.keep(INTEGRATOR)
    assert chosen(CHAIN, 5.0) == ("DOP853", True)
    process.ready(INTEGRATOR)
    assert chosen(CART, 0.1) == ("DOP853", True)
    assert choose(CART, 10.0, 1e-9, "RK45").compiled is False
    with reproducible():
        assert chosen(CART, 1e6) == ("DOP853", False)


def test_a_kept_kernel_serves_a_double_pendulum(process: Process) -> None:
    process.install("numba")
    scene = load("chain-2")
    assert chosen(scene, 1000.0) == ("DOP853", False)
    process.keep(INTEGRATOR)
    assert chosen(scene, 1000.0) == ("DOP853", True)
    assert chosen(scene, 10.0) == ("DOP853", False)


@pytest.mark.parametrize("kept", [True, False])
def test_runs_in_a_loop_come_to_take_the_kernel(process: Process, kept: bool) -> None:
    """Each is too short for it; what they forgo together is not."""
    process.install("numba")
    if kept:
        process.keep(INTEGRATOR)
    choice = choose(CART, 10.0, 1e-9)
    assert not choice.compiled
    ((name, share),) = choice.forgone
    assert name == integrator().name
    assert 0.5 < share < 1
    price = LOADING["numba"] + LINKING["numba"] + (0.0 if kept else COMPILING_SECONDS)
    lose(choice.forgone, 0.5 * price / share)
    assert not choose(CART, 10.0, 1e-9).compiled
    lose(choice.forgone, 0.5 * price / share)
    assert choose(CART, 10.0, 1e-9).compiled


def test_what_is_not_installed_is_never_taken(process: Process) -> None:
    process.install()
    assert chosen(CART, 1e6) == ("DOP853", False)


def test_what_is_noted_is_kept_as_long_as_its_file(process: Process) -> None:
    assert not integrator().kept
    file = process.keep(INTEGRATOR)
    assert integrator().kept
    assert not integrator(system_of(load("two-swings"))).kept
    file.unlink()
    assert not integrator().kept


def series(name: str, expected: float = 2.0) -> Code:
    return look_up("heyoka", name, expected, "series")


def test_what_heyoka_keeps_is_noted_for_other_processes(process: Process) -> None:
    assert not series("some equations").is_ready
    assert not series("some equations").kept
    states = {"get_diskcache_enabled": lambda: True, "get_diskcache_path": lambda: process.home}
    process.load("heyoka", llvm_state=SimpleNamespace(**states))
    with make_ready(series("some equations")):
        pass
    assert series("some equations").is_ready
    process.ready()
    later = series("some equations")
    assert (later.is_ready, later.kept) == (False, True)
    assert not series("other equations").kept
    process.load("heyoka")
    with make_ready(series("third")):
        pass
    process.ready()
    assert not series("third").kept


def test_compiling_takes_as_long_as_it_took_here_last(process: Process, monkeypatch: pytest.MonkeyPatch) -> None:
    """What was never compiled here takes as much longer than expected as what was compiled last."""
    clock = iter([10.0, 14.0, 20.0, 22.0])
    monkeypatch.setattr(readiness, "perf_counter", lambda: next(clock))
    with make_ready(series("some equations")) as compiles:
        for _ in range(2):
            with compiles():
                pass
    process.ready()
    assert series("some equations").compiling == 6.0
    assert series("other equations", 5.0).compiling == 15.0
    assert integrator().compiling == COMPILING_SECONDS
    assert replace(series("some equations"), package="numba").anew == LOADING["numba"] + 2.0
    for note in process.home.rglob("note_*"):
        note.write_bytes(note.read_bytes()[:-3])
    assert series("some equations").compiling == 2.0


@fast
def test_numba_keeps_the_integrator_where_it_is_looked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    from nonlinear.integration import compiled

    scene = load("chain-3")
    equations = kernels.Compiled(system_of(scene))
    start = equations.begin(state_at_rest(scene, [10.0, 20.0, 30.0]))
    stepper = compiled.CompiledStepper(equations, 0.0, start, 1.0, 1e-6, 1e-6 * equations.scale)
    stepper.step()
    assert integrator().is_ready
    monkeypatch.setattr(readiness, "_ready", set())
    assert integrator().kept == bool(compiled.steps.stats.cache_path)


def test_compiling_is_shown_on_a_terminal(
    process: Process, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(readiness, "PROGRESS_DELAY", 0.0)
    for loaded, kept, terminal in (
        (False, False, True),
        (False, False, False),
        (False, True, True),
        (True, False, True),
    ):
        process.ready(*["some equations"][: int(loaded)])
        monkeypatch.setattr(sys.stderr, "isatty", lambda terminal=terminal: terminal)
        with make_ready(series("some equations")) as compiles, nullcontext() if kept else compiles():
            pass
        shown = capsys.readouterr().err
        assert ("compiling series, about" in shown) == (not loaded and not kept and terminal)


@heyoka
def test_a_series_that_is_compiled_is_ready(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(readiness, "_ready", set())
    scene, tolerance = load("chain-2"), 1e-13

    def code() -> Code | None:
        return offers(scene, system_of(scene), 1.0, tolerance)["taylor"].code

    before = code()
    simulate(scene, 0.1, method="taylor", tolerance=tolerance, start=state_at_rest(scene, [100.0, 100.0]))
    after = code()
    assert before
    assert after
    assert (before.is_ready, after.is_ready) == (False, True)
    assert choose(scene, 1.0, tolerance).method == "taylor"
    monkeypatch.setattr(readiness, "_ready", set())
    later = code()
    assert later
    assert later.kept


def test_only_steps_that_end_at_kicks_are_offered_to_clocks() -> None:
    clocks = load("huygens")
    assert set(offers(clocks, system_of(clocks), 1000.0, 1e-9)) == {"DOP853"}
    assert chosen(clocks, 1000.0)[0] == "DOP853"
