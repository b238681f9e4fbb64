"""Forces at points of a scene and supports that move both ways: between all forms, by hand, and in every engine."""

from __future__ import annotations

from contextlib import nullcontext
from math import cos, radians, sin, tau
from typing import Any

import numpy as np
import pytest
from amounts import usually
from scipy.integrate import solve_ivp
from support.loops import interpreted

from modal.scene import Scene, scene_from
from nonlinear import ensemble, files, simulate
from nonlinear.dynamics import Maximal
from nonlinear.postprocessing import reaction_forces_of

ROD = {"kind": "rod", "mass": 1.0, "length": 1.0}
BOB = {"kind": "bob", "mass": 1.0, "length": 1.0}
PUSHES = [
    {"on": "pendulum[0].links[1]@0.3", "kind": "sine", "amplitude": 2.0, "frequency_hz": 0.7, "phase_deg": 20.0},
    {"on": "pendulum[0].links[0]", "direction": "vertical", "kind": "constant", "amplitude": 3.0},
    {"on": "pendulum[0].links[1]", "direction": "torque", "kind": "sine", "amplitude": 0.8, "frequency_hz": 0.4},
    {"on": "pendulum[0].links[1]@0", "direction": "torque", "kind": "constant", "amplitude": 0.1},
]
ON_CART = {"on": "cart", "kind": "sine", "amplitude": 5.0, "frequency_hz": 0.3}
RECORD = {
    "on": "pendulum[0].copies[1].links[1]",
    "kind": "record",
    "time_s": [0.5, 1.0, 1.5, 2.0, 2.5],
    "force_n": [0, 1, 3, 1, 0.5],
}
RANDOM = {
    "on": "pendulum[0].links[0]",
    "kind": "random",
    "psd": [1.0, 1.0],
    "frequency_hz": [0.5, 3.0],
    "seed": 1,
    "duration": 10.0,
}
SWEEP = {"on": "pendulum[0].links[0]", "kind": "sweep", "amplitude": 1.0, "from_hz": 0.2, "to_hz": 1.0, "duration": 2.0}
CART = {"kind": "cart", "mass": 2.0}
FIXED = {"kind": "fixed"}


def pushed(
    *forces: dict[str, Any], support: dict[str, Any] = FIXED, links: list[dict[str, Any]] | None = None, count: int = 2
) -> Scene:
    chain = links or [ROD, ROD | {"mass": 0.5, "damping": 0.1}]
    pendulum = {"count": count, "links": chain, "start": {"angles_deg": [30.0, -20.0][: len(chain)]}}
    return scene_from({"gravity": 9.81, "support": support, "pendulum": [pendulum], "force": [*forces]})


def forms_agree(scene: Scene, *forms: str, duration: float = usually(0.8, 2.0)) -> None:
    """Whether all forms give one motion, and energy changes by the work alone."""
    first = simulate(scene, duration, tolerance=1e-11, output=7)
    for run in [first, *(simulate(scene, duration, tolerance=1e-11, output=7, form=form) for form in forms)]:
        assert run.motion.links == pytest.approx(first.motion.links, abs=2e-9)
        books = run.mechanics.energy - run.motion.work
        assert np.ptp(books) < 1e-8 * max(1.0, np.abs(run.motion.work).max())
        assert np.abs(run.motion.work).max() > 1e-3


@pytest.mark.parametrize(
    ("support", "forces"),
    usually(
        [(FIXED, [*PUSHES, RECORD, SWEEP]), (CART, [*PUSHES, ON_CART, RANDOM])],
        [
            (FIXED, PUSHES),
            (CART, [*PUSHES, ON_CART]),
            (FIXED, [*PUSHES, RECORD, SWEEP]),
            (CART, [*PUSHES, ON_CART, RANDOM]),
        ],
    ),
)
def test_all_forms_give_one_motion(support: dict[str, Any], forces: list[dict[str, Any]]) -> None:
    forms_agree(pushed(*forces, support=support), "maximal", "hamiltonian")


SHAKEN = [
    {"kind": "sine", "amplitude": 0.05, "frequency_hz": 1.0},
    {"kind": "sine", "direction": "vertical", "amplitude": 0.03, "frequency_hz": 1.7},
]
DISPLACED = {"kind": "record", "time_s": [0, 1, 2, 3], "displacement_m": [0, 0.1, 0.1, 0]}
PUSH_LOWER = [
    {"on": "pendulum[0].links[1]", "kind": "sine", "amplitude": 2.0, "frequency_hz": 0.7},
    PUSHES[1],
    PUSHES[2],
]
AIRY = [BOB | {"quadratic_drag": 0.2}, BOB | {"drag": 0.1}]
REEL = [BOB | {"hoist": {"to": 1.5, "duration": 2.0}}, BOB | {"mass": 0.3}]


@pytest.mark.parametrize(
    ("support", "links", "forces"),
    [
        (CART, REEL, PUSH_LOWER),
        (CART, AIRY, PUSH_LOWER),
        ({"kind": "moved", "motion": SHAKEN}, AIRY, []),
        ({"kind": "moved", "motion": SHAKEN}, AIRY, PUSH_LOWER),
        ({"kind": "moved", "motion": SHAKEN}, REEL, PUSH_LOWER),
        (
            {"kind": "moved", "motion": [DISPLACED, SHAKEN[1]]},
            AIRY,
            PUSH_LOWER,
        ),
    ],
    ids=["hoist", "drag", "both-ways", "both-ways-and-forces", "hoist-and-both-ways", "record-and-sine"],
)  # fmt: skip
def test_forces_act_beside_hoists_drag_and_a_support_that_moves_both_ways(
    support: dict[str, Any], links: list[dict[str, Any]], forces: list[dict[str, Any]]
) -> None:
    forms_agree(pushed(*forces, support=support, links=links, count=1), "maximal")


def test_two_bobs_are_those_of_newtons_law_by_hand() -> None:
    """Lagrange's equations with virtual work F·∂r/∂θ, written out for two bobs of 1 kg and 1 m."""
    forces = [
        {"on": "pendulum[0].links[1]@0.5", "kind": "sine", "amplitude": 2.0, "frequency_hz": 0.7},
        PUSHES[1] | {"on": "pendulum[0].links[0]@0.25", "kind": "sine", "frequency_hz": 0.2},
        {"on": "pendulum[0].links[1]", "direction": "torque", "kind": "constant", "amplitude": 0.4},
    ]  # fmt: skip

    def rate(t: float, y: np.ndarray) -> list[float]:
        a, b, p, q = y
        along, up = 2.0 * sin(tau * 0.7 * t), 3.0 * sin(tau * 0.2 * t)
        first = along * cos(a) + up * 0.25 * sin(a) - 0.4
        second = along * 0.5 * cos(b) + 0.4
        left = [[2.0, cos(a - b)], [cos(a - b), 1.0]]
        right = [first - q * q * sin(a - b) - 2 * 9.81 * sin(a), second + p * p * sin(a - b) - 9.81 * sin(b)]
        return [p, q, *np.linalg.solve(left, right)]

    run = simulate(pushed(*forces, links=[BOB, BOB], count=1), 3.0, tolerance=1e-12, output=7)
    start = [radians(30.0), radians(-20.0), 0.0, 0.0]
    exact = solve_ivp(rate, (0.0, 3.0), start, "DOP853", rtol=1e-12, atol=1e-13, t_eval=run.times).y[:2].T
    assert run.motion.links == pytest.approx(exact, abs=1e-9)


@pytest.mark.parametrize("engine", ["numpy", "numba"])
def test_members_are_single_runs(engine: str) -> None:
    """The loop for numba as Python; `ensembles/test_clocks.py` compiles one that has functions of time."""
    scene, paths = (
        pushed(*PUSHES, ON_CART, support=CART),
        ("force[0].amplitude", "force[4].frequency_hz", "force[1].amplitude"),
    )
    values = [(1.5, 0.3, 3.0), (2.0, 0.4, -1.0)]
    varied = dict(zip(paths, map(list, zip(*values, strict=True)), strict=True))
    with interpreted() if engine == "numba" else nullcontext():
        runs = ensemble(scene, 1.5, vary=varied, engine=engine, workers=1, tolerance=1e-11)
    for member, (push, hz, lift) in enumerate(values):
        forces = list(scene.force)
        for at, change in ((0, {"amplitude": push}), (4, {"frequency_hz": hz}), (1, {"amplitude": lift})):
            forces[at] = forces[at].replace(**change)
        run = simulate(scene.replace(force=tuple(forces)), 1.5, tolerance=1e-11, output=2)
        assert runs.final.links[member] == pytest.approx(run.motion.links[-1], abs=1e-8)


def test_taylor_series_follow_sines_and_constant_forces() -> None:
    pytest.importorskip("heyoka")
    scene = pushed(*PUSHES)
    series = simulate(scene, 2.0, method="taylor", tolerance=1e-13, output=3)
    assert series.motion.links == pytest.approx(simulate(scene, 2.0, tolerance=1e-12, output=3).motion.links, abs=1e-9)


def test_reaction_forces_balance_what_acts() -> None:
    run = simulate(pushed(*PUSHES, ON_CART, support=CART), 2.0, tolerance=1e-11, output=5)
    newton, saddle = reaction_forces_of(run), Maximal(run.system).reactions(run.motion, run.times)
    assert newton.pivots == pytest.approx(saddle.pivots, abs=1e-9)
    assert newton.normal == pytest.approx(saddle.normal, abs=1e-9)


def test_dry_friction_on_joints_and_rail_under_forces() -> None:
    rubbing = [BOB | {"friction": 0.3}, BOB | {"friction": 0.1}]
    scene = pushed(*PUSH_LOWER, support=CART | {"friction_coefficient": 0.05}, links=rubbing, count=1)
    run = simulate(scene, 0.8, tolerance=1e-10, output=5)
    assert np.ptp(run.mechanics.energy - run.motion.work) < 1e-8


def test_runs_under_forces_are_saved(tmp_path: Any) -> None:
    scene = pushed(*PUSH_LOWER, support={"kind": "moved", "motion": SHAKEN}, links=AIRY, count=1)
    run = simulate(scene, 1.0, output=5)
    for name in ("run.npz", "run.csv"):
        files.save(run, tmp_path / name)
        read = files.load(tmp_path / name)
        assert read.scene == scene
        assert np.array_equal(read.motion.links, run.motion.links)
        assert reaction_forces_of(read).pivots == pytest.approx(reaction_forces_of(run).pivots, rel=1e-12)
    assert {"support_horizontal_m", "support_vertical_ddot_m_per_s2"} <= set(files.columns(run))
