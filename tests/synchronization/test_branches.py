"""Branches of configurations: critical detuning, coupling and damping, against theory on paper and the simulator."""

from __future__ import annotations

import csv
import json
from functools import lru_cache
from io import BytesIO, StringIO
from math import sqrt
from typing import Any

import numpy as np
import pytest
from amounts import usually
from scipy.optimize import brentq, fsolve, minimize_scalar

import modal
from modal import Bob, Body, Cart, Pendulum, Scene, load
from modal.assembly import matrices
from modal.errors import ComputationError, SceneError
from modal.plotting import save
from modal.scene import Escapement, VanDerPol
from modal.scene.parameters import parse_variations, vary
from nonlinear.averaging import RelativeEquilibrium, average, relative_equilibria, relative_equilibrium
from nonlinear.plotting import branches_figure
from nonlinear.simulation import simulate
from nonlinear.synchronization import (
    Branches,
    EquilibriumBranch,
    Phases,
    agreement,
    branches_csv,
    branches_text,
    find_survival,
    follow_branches,
    phases_of,
)
from nonlinear.synchronization.branch_report import branches_json
from nonlinear.synchronization.certificates import certified_orbit
from nonlinear.synchronization.continuation import Walk
from nonlinear.synchronization.patterns import own_amplitudes
from nonlinear.system import State

GRAVITY, ANGLE = 9.81, 5.0
GENTLE = 0.01  # N m s/rad: a drive that leaves no trace of e/ω in what first order says
KICKS = Escapement(impulse=3e-7, angle_deg=1.0)
LENGTH = "pendulum[1].links[0].length"
MASSES = "pendulum[0].links[*].mass"


def clocks(mass: float, damping: float, length: float = 1.0, strength: float = 0.05) -> Scene:
    drive = VanDerPol(strength=strength, angle_deg=ANGLE)
    pendula = tuple(
        Pendulum(links=(Bob(mass=1.0, length=pendulum_length, drive=drive),)) for pendulum_length in (1.0, length)
    )
    return Scene(gravity=GRAVITY, support=Cart(mass=mass, damping=damping), pendulum=pendula)


@lru_cache
def followed(scene: Scene, text: str) -> Branches:
    return follow_branches(scene, parse_variations([text])[0])


def named(branches: Branches, words: str) -> EquilibriumBranch:
    (chosen,) = [chosen for chosen in branches.branches if chosen.words.startswith(words)]
    return chosen


def critical(branch: EquilibriumBranch, *kinds: str) -> float:
    (value,) = [change.value for change in branch.changes if change.kind in kinds]
    return value


def near(branch: EquilibriumBranch, scene: Scene, value: float) -> RelativeEquilibrium:
    """The configuration there, or the last one before it is lost."""
    at = int(np.abs(branch.values - value).argmin())
    moved = Walk(scene, branch.variation).move(branch.states[at], value)
    return moved or branch.states[at]


def run_from(
    scene: Scene, path: str, value: float, state: RelativeEquilibrium, duration: float, aside: float
) -> Phases:
    """The full equations from a configuration, the first pendulum a little off."""
    q = state.averaged.shapes @ state.z
    q[1] *= aside
    v = (1j * state.omega * q).real
    start = State(q[1:].real, v[1:], float(q[0].real), float(v[0]))
    return phases_of(simulate(vary(scene, {path: value}), duration, start=start, tolerance=1e-8))


def difference(phases: Phases) -> Any:
    """Phase of the second pendulum before the first (rad) over the last quarter."""
    late = phases.times > 0.75 * phases.times[-1]
    return np.unwrap(phases.phase[late, 1, 0] - phases.phase[late, 0, 0])


# --------------------------------------------------------------------------------------------- critical detuning


def coupling(mass: float, damping: float) -> complex:
    """κ of A_k' = … + κ(A₁ + A₂): the cart, pulled by m l ω² ΣA, pushes back with X = −(m l/M) ΣA/(1 − ic/ωM)."""
    whole, omega = mass + 2, sqrt(GRAVITY)
    return 1j * omega / (2 * whole) / (1 - 1j * damping / (omega * whole))


def detuning(mass: float, damping: float) -> float:
    """The largest Δω (rad/s) at which two of A_k' = (p − (q + in)|A_k|² + iδ_k) A_k + κ(A₁ + A₂) stay locked.

    Their sizes r_k and phase ψ between them, r₂ followed along ψ from in phase; Δω(ψ) = δ₁ − δ₂ is an outcome.
    """
    kappa, omega, limit = coupling(mass, damping), sqrt(GRAVITY), np.radians(ANGLE)
    p, q, n = GENTLE / 2, GENTLE / (8 * limit**2), omega / 16

    def rates(r: Any, psi: float) -> Any:
        pull = kappa * (1 + np.array([r[1] / r[0] * np.exp(1j * psi), r[0] / r[1] * np.exp(-1j * psi)]))
        return p - (q + 1j * n) * np.asarray(r) ** 2 + pull

    def needed(psi: float) -> float:
        r = fsolve(lambda r: rates(r, psi).real, [2 * limit] * 2, xtol=1e-13)
        return float(np.diff(rates(r, psi).imag)[0])

    minimum = minimize_scalar(lambda psi: -abs(needed(psi)), bounds=(0.2, 1.7), method="bounded")
    return float(-minimum.fun)


def length_of(change: float) -> float:
    """How much longer the second pendulum is to be slower by this (rad/s)."""
    return GRAVITY / (sqrt(GRAVITY) - change) ** 2 - 1


def test_critical_detuning_of_weak_coupling_is_adlers() -> None:
    """Phases by themselves: Δω = 2 |Re κ + (n/q) Im κ|; n/q as larger swings are slower."""
    mass, damping = 20_000.0, 2000.0
    branches = followed(clocks(mass, damping, strength=GENTLE), f"{LENGTH}=1:1.0002:2")
    kappa = coupling(mass, damping)
    slower = sqrt(GRAVITY) * np.radians(ANGLE) ** 2 / (2 * GENTLE)
    expected = length_of(2 * abs(kappa.real + slower * kappa.imag))
    ends = [critical(named(branches, words), "disappears") - 1 for words in ("in phase", "antiphase")]
    assert ends[0] == pytest.approx(ends[1], abs=2e-4 * 2e-4)
    assert ends[0] == pytest.approx(expected, rel=0.03)
    assert not named(branches, "antiphase").intervals
    assert named(branches, "in phase").words == "in phase → 88° apart"


@pytest.mark.parametrize("mass", usually([1500.0], [4000.0, 1500.0]))
def test_critical_detuning_is_that_of_two_amplitude_equations(mass: float) -> None:
    branches = followed(clocks(mass, 5.0, strength=GENTLE), f"{LENGTH}=1:{1 + 10 / mass}:2")
    end = critical(named(branches, "in phase"), "disappears") - 1
    assert end == pytest.approx(length_of(detuning(mass, 5.0)), rel=0.02)
    ((low, high),) = named(branches, "in phase").intervals
    assert (low, high) == pytest.approx((1.0, 1 + end), abs=0.03 * end)


@pytest.mark.parametrize(("part", "locked"), [(0.9, True), (1.1, False)])
def test_the_simulator_locks_within_the_critical_detuning_and_drifts_beyond(part: float, locked: bool) -> None:
    scene = clocks(200.0, 5.0)
    branch = named(followed(scene, f"{LENGTH}=1:1.01:2"), "in phase")
    value = 1 + part * (critical(branch, "disappears") - 1)
    phases = run_from(scene, LENGTH, value, near(branch, scene, value), 3000.0, 1.0)
    assert phases.locked == locked
    assert (np.ptp(phases.frequency) < 1e-6) == locked
    assert (abs(np.ptp(difference(phases))) < 0.1) == locked


# ---------------------------------------------------------------------------------------------- critical coupling


FATES = [("antiphase", "loses stability"), ("in phase", "becomes stable")]


@pytest.mark.parametrize(("words", "kind"), usually(FATES[:1], FATES))
def test_critical_coupling_is_that_of_the_simulator(words: str, kind: str) -> None:
    """By the cart's mass: beyond it phases swing or another configuration is gone to."""
    scene = clocks(50.0, 15.0, 1.01)
    branches = followed(scene, "support.mass=20:500:2log")
    apart = np.degrees(np.angle(ratio(named(branches, "in phase").states[-1])))
    ends = {agreement(branch.states[-1]) for branch in branches.branches}
    assert ends == {"pendulum 2 alone", f"{abs(apart):.0f}° apart"}
    branch = named(branches, words)
    value = critical(branch, kind)
    inside, outside = (0.9, 1.1) if kind == "loses stability" else (1.1, 0.9)
    steady, left = (
        run_from(scene, "support.mass", part * value, near(branch, scene, part * value), 2000.0, 0.9)
        for part in (inside, outside)
    )
    angle = np.angle(np.exp(1j * (np.mean(difference(steady)) - np.angle(ratio(near(branch, scene, inside * value))))))
    assert np.ptp(difference(steady)) < 0.03
    assert abs(angle) < 0.05
    away = np.abs(np.exp(1j * difference(left)) - np.exp(1j * np.angle(ratio(near(branch, scene, outside * value)))))
    assert away.max() > 0.3


def ratio(state: RelativeEquilibrium) -> complex:
    first, other = own_amplitudes(state)
    return complex(other / first)


# ------------------------------------------------------------------------------------------------ change of fate


def metronomes(drive: VanDerPol) -> Scene:
    link = Body(mass=0.025, length=0.1, centre=0.02, inertia=1e-5, damping=1e-6, drive=drive)
    return Scene(gravity=GRAVITY, support=Cart(mass=0.1, damping=0.01), pendulum=(Pendulum(links=(link,), count=2),))


def fed() -> Branches:
    return followed(metronomes(VanDerPol(strength=4e-6, angle_deg=10.0)), "support.damping=0.01:0.2:2log")


def growth_in_phase(damping: float, scene: Scene, strength: float) -> float:
    """Re λ (1/s) of the small swing of two equal pendula with the cart, by the state matrix."""
    written = matrices(scene.undriven)
    inverse, D = np.linalg.inv(written.M), np.diag([damping, *(np.diag(written.D)[1:] - strength)])
    state = np.block([[np.zeros((3, 3)), np.eye(3)], [-inverse @ written.K, -inverse @ D]])
    values, vectors = np.linalg.eig(state)
    together = (values.imag > 1) & (abs(vectors[1] - vectors[2]) < 1e-6 * abs(vectors[1]))
    return float(values[together].real.item())


def test_metronomes_keep_in_phase_up_to_a_critical_damping() -> None:
    """Pantaleone (2002) has them in phase on a light base.

    By hand: fed at the rate p, drained by the base at σ, in phase keeps q|A|² = p − σ.  A swing across it is fed at the
    mean of both phases, p − 2q|A|² = 2σ − p, as the base splits frequencies too far for it to be pulled along.  So
    antiphase grows from σ = p/2 on, half the damping at which in phase dies out, which the linear scene knows exactly.
    """
    scene, branch = fed().scene, named(fed(), "in phase")
    value = critical(branch, "loses stability")
    assert critical(branch, "dies out") == pytest.approx(
        brentq(growth_in_phase, 0.1, 0.2, args=(scene, 4e-6)), rel=1e-3
    )
    assert critical(branch, "dies out") == pytest.approx(2 * value, rel=2e-2)


def test_metronomes_leave_in_phase_beyond_the_critical_damping_in_the_simulator_too() -> None:
    scene, branch = fed().scene, named(fed(), "in phase")
    value = critical(branch, "loses stability")
    for part, survivor in ((0.85, 3), (1.15, 2)):
        phases = run_from(scene, "support.damping", part * value, near(branch, scene, part * value), 600.0, 0.9)
        assert find_survival(phases.trajectory).survivor == survivor
        assert phases.order[-1, 0] == pytest.approx(survivor - 2, abs=1e-3)


def test_an_escapement_too_keeps_them_in_phase_up_to_a_critical_damping() -> None:
    """On a heavier base, that splits frequencies by 2 %; growth or decay of antiphase in the simulator's energies."""
    link = Body(mass=0.025, length=0.1, centre=0.02, inertia=1e-5, damping=1e-6, drive=KICKS)
    scene = Scene(gravity=GRAVITY, support=Cart(mass=0.6), pendulum=(Pendulum(links=(link,), count=2),))
    branch = named(followed(scene, "support.damping=0.3:3:2log"), "in phase")
    value = critical(branch, "loses stability")
    for part in (0.85, 1.15):
        phases = run_from(scene, "support.damping", part * value, near(branch, scene, part * value), 150.0, 0.9)
        share = find_survival(phases.trajectory).share[:, 0]
        early, late = (share[(phases.times > at) & (phases.times < at + 20)].mean() for at in (20, 125))
        assert (late > early) == (part > 1)


# --------------------------------------------------------------------------------------------------- two links


STRENGTH = 0.01


def double() -> Scene:
    links = (Bob(mass=1.0, length=0.5, drive=VanDerPol(strength=STRENGTH, angle_deg=5.0)),) * 2
    return Scene(gravity=GRAVITY, support=Cart(mass=20.0, damping=4.0), pendulum=(Pendulum(links=links, count=2),))


def test_in_phase_of_double_pendula_dies_out_where_a_small_swing_no_longer_grows() -> None:
    """The slow one, by eigenvalues, followed from a configuration that Newton's method finds from its mode."""
    scene, (variation,) = double(), parse_variations([f"{MASSES}=0.3:10:2log"])
    walk = Walk(scene, variation)
    averaged = walk.at(variation.values[0])
    z = np.where(averaged.row == 2, 0.2, 0.0) / np.abs(averaged.link_shapes).max(axis=0)
    state = relative_equilibrium(averaged, z.astype(complex))
    assert state
    assert (agreement(state), averaged.modes[state.row].family) == ("in phase", "cart moves: in phase, slow")
    values, states = zip(*walk.trace(variation.values[0], state), strict=True)
    branch = EquilibriumBranch(variation, np.array(values), states)
    end = critical(branch, "dies out")
    assert growth(scene, STRENGTH, 0.97 * end, 0) > 0 > growth(scene, STRENGTH, 1.03 * end, 0)


def test_four_configurations_of_double_pendula() -> None:
    """Slow or fast, cart still or moving; in phase dies out where a small swing no longer grows, by eigenvalues."""
    scene = double()
    branches = followed(scene, f"{MASSES}=0.1:10:2log")
    pure = [branch for branch in branches.branches if "frequencies" not in branch.words]
    families = [branch.states[0].averaged.modes[branch.states[0].row].family for branch in pure]
    expected = ["antiphase, slow", "in phase, slow", "antiphase, fast", "in phase, fast"]
    assert [family.partition(": ")[2] for family in families] == expected
    assert [branch.words for branch in pure] == ["antiphase", "in phase"] * 2
    assert [float(branch.values[-1]) for branch in pure[::2]] == [10.0, 10.0]
    for branch, place in zip(pure[1::2], (0, 1), strict=True):
        end = critical(branch, "dies out")
        assert growth(scene, STRENGTH, 0.97 * end, place) > 0 > growth(scene, STRENGTH, 1.03 * end, place)


def growth(scene: Scene, strength: float, mass: float, place: int) -> float:
    """Of the slow (0) or fast (1) swing of both pendula in phase, both links of each fed within small angles (1/s)."""
    linear = matrices(vary(scene, {MASSES: mass}).undriven)
    turns = np.array([[1.0, 0.0], [-1.0, 1.0]])
    fed = np.zeros((5, 5))
    fed[1:, 1:] = strength * np.kron(np.eye(2), turns.T @ turns)
    both = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1], [0, 1, 0], [0, 0, 1]])
    M, K, D = (both.T @ part @ both for part in (linear.M, linear.K, linear.D - fed))
    upper = np.hstack((np.zeros((3, 3)), np.eye(3)))
    eigenvalues = np.linalg.eigvals(np.vstack((upper, -np.linalg.solve(M, np.hstack((K, D))))))
    turning = eigenvalues[eigenvalues.imag > 1.0]
    return float(turning[np.argsort(turning.imag)][place].real)


def test_what_leaves_another_branch_begins_there() -> None:
    """Fast antiphase of the clocks sheds, where it stops lasting, a swing that shares its energy with in phase."""
    branches = followed(modal.load("clocks-double"), "support.mass=7:10:2")
    (shed,) = [
        branch
        for branch in branches.branches
        if [change.kind for change in branch.changes] == ["appears", "loses stability"]
    ]
    (pure,) = [
        branch for branch in branches.branches if [change.kind for change in branch.changes] == ["loses stability"]
    ]
    assert shed.values[0] == pytest.approx(pure.changes[0].value, abs=0.02)
    assert shed.states[-1].share.max() < 0.999 < min(state.share.max() for state in pure.states)


# ------------------------------------------------------------------------------------------- in print and drawn


def test_what_is_printed_is_what_was_found() -> None:
    branches = fed()
    text = branches_text(branches)
    for branch in branches.branches:
        assert branch.words in text
    for intervals in [each.intervals for group in (branches.branches, branches.exact) for each in group]:
        assert ", ".join(f"{low:.5g} to {high:.5g}" for low, high in intervals) in text
    for change, _ in branches.changes:
        assert f"{change.value:.5g}" in text
    rows = list(csv.DictReader(StringIO(branches_csv(branches))))
    record = json.loads(branches_json(branches))
    assert [str(row["branch"]) for row in record["rows"]] == [row["branch"] for row in rows]
    assert [change["averaged"] for change in record["changes"]] == [change.value for change, _ in branches.changes]
    assert all(change["distance"] == change["exact"] - change["averaged"] for change in record["changes"])
    assert record["branches"][1]["stable_averaged"] != record["branches"][1]["stable_exact"]
    assert len(rows) == sum(len(branch.values) for branch in branches.branches)
    head = [
        "support.damping_N_s_per_m",
        "omega_rad_per_s",
        "stable",
        "largest_angle_deg",
        "growth_per_s",
        "exact_omega_rad_per_s",
        "exact_stable",
        "exact_largest_angle_deg",
        "exact_growth_per_s",
        "branch",
        "pendula",
    ]
    assert list(rows[0]) == head
    for number, branch in enumerate(branches.branches, start=1):
        of_branch = [row for row in rows if row["branch"] == str(number)]
        assert [float(row["support.damping_N_s_per_m"]) for row in of_branch] == branch.values.tolist()
        assert [row["stable"] == "1" for row in of_branch] == list(branch.is_stable)
        assert all(float(row["growth_per_s"]) < 0 for row in of_branch if row["stable"] == "1")
        assert all(float(row["growth_per_s"]) > -1e-4 for row in of_branch if row["stable"] == "0")
        rates = [(row["exact_stable"], float(row["exact_growth_per_s"])) for row in of_branch if row["exact_stable"]]
        assert len(rates) > len(of_branch) / 2
        assert all((rate < 0) == (stable == "1") for stable, rate in rates)


def test_what_is_drawn_is_what_was_found() -> None:
    branches = fed()
    figure = branches_figure(branches)
    figure.canvas.draw()
    upper, lower, rates = figure.axes
    assert (upper.get_ylabel(), rates.get_xlabel(), lower.get_xscale()) == (
        "largest angle (°)",
        "damping of the cart (N s/m)",
        "log",
    )
    for branch, exact in zip(branches.branches, branches.exact, strict=True):
        for low, high in exact.intervals:
            full = [line.get_xdata() for line in lower.lines if line.get_ls() == "-"]
            assert any(abs(x[0] / low - 1) < 1e-9 and abs(x[-1] / high - 1) < 1e-9 for x in full)
        dashed = [line.get_data() for line in lower.lines if line.get_ls() == "--"]
        assert any(np.isin(branch.values, x).all() and np.isin(branch.omega, y).all() for x, y in dashed)
    marks = {
        shape: sorted(float(x) for line in lower.lines if line.get_marker() == shape for x in line.get_xdata())
        for shape in "ox"
    }
    assert marks["o"] == [special.orbit.value for special in branches.exact[1].points]
    assert marks["x"] == [change.value for change, _ in branches.changes]
    stream = BytesIO()
    save(branches_figure(branches), stream, "svg")
    assert b"<svg" in stream.getvalue()
    with pytest.raises(ComputationError, match="0 configurations"):
        branches_figure(Branches(branches.scene, branches.variation, ()))


def test_words_and_refusals() -> None:
    branches = fed()
    assert [branch.words for branch in branches.branches] == ["antiphase", "in phase"]
    with pytest.raises(SceneError, match="nothing drives"):
        follow_branches(modal.load("paper-cart-2"), parse_variations(["support.mass=1:2:3"])[0])
    with pytest.raises(SceneError, match="two or more values"):
        follow_branches(branches.scene, parse_variations(["support.mass=1"])[0])
    with pytest.raises(SceneError, match="two or more values"):
        follow_branches(branches.scene, parse_variations(["pendulum[0].count=1,2"])[0])


def test_branches_beside_the_same_orbits_are_listed_once() -> None:
    """Averaged equations of light metronomes have two motions in phase, the full ones a single orbit near both."""
    scene = vary(load("metronomes"), {"support.mass": 0.05})
    averaged = [state for state in relative_equilibria(average(scene)) if agreement(state) == "in phase"]
    orbits = [certified_orbit(scene, state) for state in averaged]
    assert len(averaged) == 2
    assert len({round(orbit.omega, 6) for orbit in orbits if orbit}) == 1
    branches = follow_branches(scene, "support.mass=0.05:0.06:2").branches
    assert [branch.words for branch in branches].count("in phase") == 1
