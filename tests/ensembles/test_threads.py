"""Threads: each has its own integrators and its own cached runs, so that the numbers are those of one thread."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from modal import load
from modal.scene.parameters import parse_variations, vary
from nonlinear.dynamics import Generated
from nonlinear.ensembles import ensemble
from nonlinear.ensembles.executors import WorkerPool
from nonlinear.integration import taylor
from nonlinear.sweeps import Study, parse_measures, sweep
from nonlinear.sweeps.measures import Portion
from nonlinear.system import system_of

STARTS = np.random.default_rng(2).uniform(-3, 3, (16, 2))
THREADS = 4


def contents(**options: object) -> bytes:
    """Everything that an ensemble of STARTS finds."""
    measures = ["first_turn", "largest_angle", "lyapunov", "section:theta[1,2]=0"]
    runs = ensemble(load("chain-2"), 0.6, starts=STARTS, measures=measures, output="end", check=0, **options)  # type: ignore[arg-type]
    return b"".join(runs.column(name).tobytes() for name in runs.columns)


def test_ensembles_in_threads_are_those_of_one_thread() -> None:
    alone = contents(engine="numpy", workers=1, chunk=4)
    with ThreadPoolExecutor(THREADS) as executor:
        assert contents(engine="numpy", crew=WorkerPool(executor, THREADS), chunk=4) == alone
        together = [executor.submit(contents, engine="numpy", workers=1, chunk=4) for _ in range(THREADS)]
        assert {future.result() for future in together} == {alone}


def test_whoever_asks_for_a_compiled_series_has_it_alone() -> None:
    pytest.importorskip("heyoka")
    equations = Generated(system_of(load("chain-1")))
    integrator, other = (taylor.integrator_of(equations, 1e-9) for _ in range(2))
    integrator.state[:], integrator.pars[:] = 1.0, 2.0
    assert not np.any(other.state)
    assert not np.any(other.pars == 2.0)


def test_a_portion_keeps_its_runs_while_another_thread_measures() -> None:
    """Runs that were made at once are not those of a scene alone, to the last digit."""
    scenes = [vary(load("chain-2"), {"gravity": 9.0 + 0.1 * k}) for k in range(8)]
    ours, others = Portion(scenes[:4], scenes[0]), Portion(scenes[4:], scenes[0])
    kept = [ours.run(scene, 1.0) for scene in scenes[:4]]
    with ThreadPoolExecutor(1) as executor:
        executor.submit(others.run, scenes[4], 1.0).result()
    assert all(ours.run(scene, 1.0) is trajectory for scene, trajectory in zip(scenes, kept, strict=False))


def test_a_sweep_in_threads_is_that_of_one_thread() -> None:
    study = Study(load("chain-2"), parse_variations(["gravity=9:10:96"]), parse_measures(["frequencies", "damping"]))
    results = []
    for threads in (1, THREADS):
        with ThreadPoolExecutor(threads) as executor:
            results.append(sweep(study, crew=WorkerPool(executor, THREADS)))
    for name in results[0].columns:
        assert results[1].values(name).tobytes() == results[0].values(name).tobytes()
