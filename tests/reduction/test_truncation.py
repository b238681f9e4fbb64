"""Truncated modes: the reduced equations are the scene's own projected, and the stated error is the true one."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import few_modes
import numpy as np
import pytest
from amounts import usually
from scenes import blowing, minimal, plane_scene, random_state
from test_hamiltonian import dense_M, vectors

from modal.errors import SceneError
from modal.modes import natural_modes
from modal.scene import Bob, Cart, Fixed, Pendulum, Rod, Scene
from nonlinear.integration import Trajectory, modes_of
from nonlinear.postprocessing import summary
from nonlinear.reduction import simulate_truncated, start_in_mode, survey_modes
from nonlinear.reduction.truncation import Kept, Survey, Truncated
from nonlinear.simulation import simulate
from nonlinear.system import State, system_of


def chain(seed: int, links: int, support: Fixed | Cart | None = None) -> Scene:
    rng = np.random.default_rng(seed)
    kind = [Bob, Rod][seed % 2]
    hung = tuple(kind(mass=m, length=l) for m, l in rng.uniform(0.3, 1.5, (links, 2)))
    return Scene(gravity=9.81, support=support or Fixed(), pendulum=(Pendulum(links=hung),))


def survey_of(scene: Scene, start: State | None = None) -> Survey:
    system, still = system_of(scene), np.zeros(scene.n_links)
    return survey_modes(scene, system, start or State(still, still))


def start_of(scene: Scene, seed: int) -> State:
    """At rest in up to three of the lowest modes, 0.1° to 20°, every other seed with a little of all modes."""
    rng = np.random.default_rng(seed)
    survey, first = survey_of(scene), int(natural_modes(scene).omega[0] == 0)
    reach = np.abs(survey.shapes[-scene.n_links :]).max(axis=0)
    amount = np.zeros(len(reach))
    amount[first : first + rng.integers(1, 4)] = rng.normal()
    if seed % 2:
        amount[first:] += 3e-4 * rng.normal(size=len(reach) - first)
    q = survey.shapes[:, first:] @ (amount / np.where(reach, reach, 1.0))[first:]
    q *= np.deg2rad(10 ** rng.uniform(-1, np.log10(20))) / np.abs(q[-scene.n_links :]).max()
    return State(q[-scene.n_links :], np.zeros(scene.n_links), float(q[0]) if len(q) > scene.n_links else 0.0)


def apart(run: object, other: object) -> float:
    return float(np.abs(run.motion.links - other.motion.links).max())  # type: ignore[attr-defined]


@pytest.mark.parametrize("seed", range(40))
def test_the_reduced_equations_are_the_scenes_own_projected(seed: int) -> None:
    """ΦᵀM(q) Φ η'' = ΦᵀM(q) q'' of the whole scene at the same state, for any Φ, dampers, springs and loads."""
    scene = plane_scene(seed)
    system, rng = system_of(scene), np.random.default_rng(seed)
    load = blowing if system.cart and seed % 2 else None
    state = random_state(system, seed)
    q, v = vectors(system, state)
    shapes = np.column_stack((q, v, rng.normal(size=(len(q), min(2, len(q) - 1)))))[:, : len(q)]
    equations = Truncated(system, np.zeros(len(q)), shapes, shapes, load)
    eta = np.zeros(2 * equations.size + equations.works)
    eta[0], eta[equations.size + 1] = 1.0, 1.0
    if equations.size < 2:
        eta[1] = v[0] / q[0]
    whole = minimal(system, load)
    rates, theirs = equations.derivative(0.3, eta), whole.derivative(0.3, whole.begin(state))
    M, half = dense_M(scene, q), len(q)
    expected = np.linalg.solve(shapes.T @ M @ shapes, shapes.T @ M @ theirs[half : 2 * half])
    np.testing.assert_allclose(
        rates[equations.size : 2 * equations.size], expected, rtol=1e-7, atol=1e-8 * abs(expected).max()
    )
    if equations.works:
        assert rates[-1] == pytest.approx(theirs[-1], rel=1e-12)


@pytest.mark.parametrize("seed", usually([2, 5], [0, 2, 3, 5, 7, 9]))
def test_all_modes_are_the_whole_scene(seed: int) -> None:
    """With springs, dampers, standing links and a cart, far from rest."""
    scene = plane_scene(seed)
    system = system_of(scene)
    start = random_state(system, seed)
    everything = len(natural_modes(scene.conservative))
    truncated = simulate_truncated(scene, 0.3, everything, start=start, tolerance=1e-11, output=20)
    whole = simulate(scene, 0.3, start=start, tolerance=1e-12, output=20)
    assert apart(truncated.trajectory, whole) < 1e-8
    assert truncated.outside == 0
    assert truncated.trajectory.energy_drift() < 1e-9


@pytest.mark.parametrize("count", [1, 3, 6])
@pytest.mark.parametrize("support", [Fixed(), Cart(mass=2.0, stiffness=3.0), Cart(mass=2.0)])
def test_energy_is_kept_by_any_number_of_modes(count: int, support: Fixed | Cart) -> None:
    scene = chain(3, 8, support)
    start = State(np.linspace(0.5, 1.5, 8), np.linspace(-1.0, 1.0, 8))
    truncated = simulate_truncated(scene, 0.4, count, start=start, tolerance=1e-13, output=30)
    assert np.ptp(truncated.trajectory.mechanics.energy) < 1e-10 * truncated.trajectory.energy_scale


def test_dampers_take_what_the_energy_loses() -> None:
    damped = chain(1, 5, Cart(mass=2.0, damping=0.5))
    start = State(np.linspace(0.2, 0.6, 5), np.zeros(5))
    trajectory = simulate_truncated(damped, 2.0, 3, start=start, tolerance=1e-12, output=50).trajectory
    assert trajectory.motion.work[-1] < -1e-3 * trajectory.energy_scale
    assert trajectory.energy_drift() < 1e-10


@pytest.mark.parametrize("seed", range(4))
def test_small_motions_swing_at_the_tables_frequencies(seed: int) -> None:
    scene = chain(seed, 7, Cart(mass=1.0, stiffness=2.0) if seed % 2 else None)
    equations, h = survey_of(scene).equations(np.arange(5)), 1e-5
    slopes = [
        (equations.derivative(0.0, h * unit) - equations.derivative(0.0, -h * unit)) / (2 * h) for unit in np.eye(10)
    ]
    omega = natural_modes(scene).omega[:5]
    np.testing.assert_allclose(np.array(slopes)[:5, 5:], -np.diag(omega**2), atol=1e-7 * omega[-1] ** 2)


@pytest.mark.parametrize("count", [1, 2, 6])
@pytest.mark.parametrize("number", [0, 1])
def test_the_backbone_is_right_with_any_number_of_modes(count: int, number: int) -> None:
    """The Lagrangian is even about the rest: one mode alone has the κ of the table, by its zero crossings."""
    scene, a = chain(5, 6), 0.04
    if count <= number:
        count = number + 1
    modes = natural_modes(scene)
    period, kappa = 2 * np.pi / modes.omega[number], modes[number].kappa
    start = start_in_mode(scene, modes, number, amplitude=a)
    trajectory = simulate_truncated(scene, 0.8 * period, count, start=start, tolerance=1e-13, output=4001).trajectory
    survey = survey_of(scene)
    eta, t = trajectory.motion.links @ survey.dual[:, number], trajectory.times
    at = np.flatnonzero(eta[1:] * eta[:-1] < 0)
    zeros = t[at] - eta[at] * (t[at + 1] - t[at]) / (eta[at + 1] - eta[at])
    omega = np.pi / (zeros[1] - zeros[0])
    assert (omega / modes.omega[number] - 1) / a**2 == pytest.approx(kappa, rel=0.03)


def test_the_stated_error_is_honest() -> None:
    ratios = []
    for seed in usually(range(0, 30, 2), range(30)):
        support = [Fixed(), Cart(mass=3.0), Cart(mass=8.0, stiffness=5.0)][seed % 3]
        scene = chain(seed, 4 + seed % 6, support)
        start = start_of(scene, seed)
        few = None if seed % 5 else 3
        truncated = simulate_truncated(scene, 2.0, few, start=start, tolerance=1e-7, output=60)
        whole = simulate(scene, 2.0, start=start, tolerance=1e-10, output=60)
        ratios.append(truncated.error / apart(truncated.trajectory, whole))
    assert np.sum(np.array(ratios) < 1) <= 1
    assert np.median(ratios) < 10


TUNED = Scene(
    gravity=9.81,
    pendulum=(Pendulum(links=(Bob(mass=1.0, length=1.0, count=5), Bob(mass=0.415, length=1.0))),),
)


def test_a_left_out_mode_at_three_times_the_frequency_is_seen() -> None:
    """ω₃/ω₁ = 3.0005: the third mode takes energy for as long as the run lasts, and the second does not show it."""
    modes = natural_modes(TUNED)
    assert modes.omega[2] / modes.omega[0] == pytest.approx(3.0005, abs=5e-5)
    start = start_in_mode(TUNED, modes, 0, 0, np.deg2rad(20.0))
    truncated = simulate_truncated(TUNED, 25.0, 1, start=start, output=251, tolerance=1e-7)
    whole = simulate(TUNED, 25.0, start=start, tolerance=1e-11, output=251)
    true = np.maximum.accumulate(np.abs(truncated.trajectory.motion.links - whole.motion.links).max(axis=1))
    assert np.all(truncated.errors >= true)
    assert truncated.error == truncated.trajectory.run.error < 4 * true[-1]
    assert true[-1] > 3 * true[50]
    assert truncated.errors[-1] > 2 * truncated.errors[50]


def crowd(support: Fixed | Cart) -> Scene:
    """Three rods in one pendulum next to nine bobs: the next modes of the table are those of the bobs."""
    rods = Pendulum(links=(Rod(mass=1.0, length=1.0),) * 3)
    bobs = [Pendulum(links=(Bob(mass=0.1, length=0.95 - 0.05 * k),)) for k in range(9)]
    return Scene(gravity=9.81, support=support, pendulum=[rods, *bobs])


@cache
def whole_crowd(support: Fixed | Cart, number: int) -> tuple[State, Trajectory]:
    scene = crowd(support)
    start = start_in_mode(scene, natural_modes(scene), number, 0, np.deg2rad(40.0))
    return start, simulate(scene, 20.0, start=start, tolerance=1e-10, output=1001)


@pytest.mark.parametrize("cheap", [True, False])
@pytest.mark.parametrize(
    ("support", "number", "off"), usually([(Fixed(), 0, 0.128)], [(Fixed(), 0, 0.128), (Cart(mass=50.0), 1, 0.106)])
)
def test_the_error_is_that_of_the_pendulum_that_moves_whoever_comes_next_in_the_table(
    support: Fixed | Cart, number: int, off: float, cheap: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By the whole scene, and by the shapes that the kept ones excite."""
    monkeypatch.setattr(Survey, "cheap", lambda *_: cheap)
    start, whole = whole_crowd(support, number)
    truncated = simulate_truncated(crowd(support), 20.0, number + 1, start=start, output=1001, tolerance=1e-6)
    true = np.maximum.accumulate(np.abs(truncated.trajectory.motion.links - whole.motion.links).max(axis=1))
    assert true[-1] == pytest.approx(off, abs=1e-3)
    assert np.all(truncated.errors >= true)
    assert truncated.error < 3 * true[-1]
    assert ("all shapes" in truncated.trajectory.run.reason) == cheap


def test_on_a_fixed_support_other_pendula_do_not_judge() -> None:
    scene = crowd(Fixed())
    modes = natural_modes(scene)
    start = start_in_mode(scene, modes, 0, 0, np.deg2rad(20.0))
    survey, looked = survey_of(scene, start), np.linspace(0, 3, 301)
    run = simulate_truncated(scene, 3.0, 1, start=start, output=looked).trajectory
    assert len(judging := survey.judging(run, 1, looked)) > 1
    assert np.all(survey.shapes[3:, judging] == 0)


@pytest.mark.parametrize("support", [Fixed(), Cart(mass=2.0)])
def test_what_left_out_shapes_do_is_what_they_do_in_the_whole_scene(support: Fixed | Cart) -> None:
    """Projected on each neglected shape, the whole motion moves it as far as the residual of one mode says."""
    scene = chain(4, 6, support)
    modes = natural_modes(scene)
    first = int(modes.omega[0] == 0)
    start, times = start_in_mode(scene, modes, first, 0, 0.1), np.linspace(0, 4, 801)
    survey = survey_of(scene, start)
    run = simulate_truncated(scene, 4.0, first + 1, start=start, output=times).trajectory
    left, responses = survey.excitation(run, np.arange(first + 1), times)
    whole = simulate(scene, 4.0, start=start, tolerance=1e-13, output=times).motion
    q = whole.links if not first else np.column_stack((whole.cart, whole.links))
    eta = np.abs(q @ survey.dual[:, left])
    np.testing.assert_allclose(responses.peaks[-1], eta.max(axis=0), rtol=0.05)
    assert np.all(responses.sum(times) * 1.05 >= np.abs(whole.links - run.motion.links).max(axis=1) - 1e-3)


@pytest.mark.parametrize("samples", [2, 3, 40])
def test_few_samples_are_judged_as_many(samples: int) -> None:
    """A distance that happens to vanish at the samples is not the error."""
    start = start_in_mode(TUNED, natural_modes(TUNED), 0, 0, np.deg2rad(20.0))
    few, many = (simulate_truncated(TUNED, 5.0, 1, start=start, output=n, tolerance=1e-7) for n in (samples, 801))
    assert few.error == pytest.approx(many.error, rel=0.02)


@pytest.mark.parametrize("seed", usually([710007, 710012], [710003, 710006, 710007, 710010, 710012, 710016]))
def test_no_error_is_stated_below_the_true_one(seed: int) -> None:
    """A share of `benchmarks/few_modes.py`: chains in and out of resonance, at every instant."""
    judged = few_modes.judged(replace(few_modes.held(seed), duration=8.0))
    assert judged.certain
    assert judged.least > 1.0
    assert judged.stated < 10 * judged.true


def test_what_lies_outside_is_what_is_left_out() -> None:
    """The share is 1 − that of the kept modes by energy; in the highest mode alone three modes hold nothing."""
    scene = chain(2, 6)
    modes = natural_modes(scene)
    low, high = (start_in_mode(scene, modes, number, amplitude=1e-3) for number in (0, 5))
    mixed = State(low.links + high.links, low.link_rates)
    shares = np.array([0.5 * natural_modes(scene).shape(n).modal_mass * (modes.omega[n] * 1e-3) ** 2 for n in (0, 5)])
    truncated = simulate_truncated(scene, 0.5, 3, start=mixed, output=30)
    assert truncated.outside == pytest.approx(shares[1] / shares.sum(), rel=1e-9)
    assert simulate_truncated(scene, 0.5, 3, start=high, output=30).outside == pytest.approx(1.0)
    assert simulate_truncated(scene, 0.5, 3, start=high, output=30).error >= 1e-3
    assert simulate_truncated(scene, 0.5, start=low, output=30).outside < 1e-20


def test_copies_stay_together_and_a_free_cart_keeps_its_translation() -> None:
    pendulum = Pendulum(links=(Bob(mass=1.0, length=1.0), Bob(mass=1.0, length=0.5)), count=3)
    scene = Scene(gravity=9.81, support=Cart(mass=5.0), pendulum=(pendulum,))
    start = State(np.linspace(-0.3, 0.2, 6), np.zeros(6), cart_rate=0.7)
    truncated = simulate_truncated(scene, 3.0, 2, start=start, output=30)
    assert truncated.kept == (Kept(1, 1), Kept(2, 1), Kept(2, 2))
    assert truncated.omega == pytest.approx(natural_modes(scene).omega[[0, 1, 1]])
    assert truncated.frozen == pytest.approx(2 * np.pi / natural_modes(scene).omega[1])
    assert truncated.trajectory.momentum_drift() < 1e-9
    total = truncated.trajectory.system.total_mass
    assert truncated.trajectory.mechanics.momentum[0] == pytest.approx(0.7 * total, rel=1e-12)
    assert simulate_truncated(scene, 3.0, 1, start=start, output=30).frozen == np.inf


def test_a_scene_at_rest_stays_there() -> None:
    scene = chain(0, 5)
    truncated = simulate_truncated(scene, 1.0, start=State(np.zeros(5), np.zeros(5)), output=10)
    assert truncated.outside == 0
    assert truncated.error == 0
    assert np.all(truncated.trajectory.motion.links == 0)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"modes": 0}, "modes 0: must be a whole number from 1"),
        ({"modes": 2.0}, "modes 2.0: must be a whole number"),
        ({"modes": True}, "modes True: must be a whole number"),
        ({"modes": 6}, "modes 6: this scene has 5"),
        ({"method": "taylor"}, "method taylor: must be one of"),
        ({"tolerance": 0.0}, "tolerance 0.0"),
        ({"duration": -1.0}, "duration -1.0"),
        ({"start": State(np.zeros(4), np.zeros(5))}, "start.links: has shape"),
        ({"output": 1}, "output 1"),
    ],
)
def test_what_cannot_be_is_refused(changes: dict[str, object], words: str) -> None:
    options = {"duration": 1.0, "start": State(np.zeros(5), np.zeros(5))} | changes
    with pytest.raises(SceneError, match=words):
        simulate_truncated(chain(0, 5), **options)  # type: ignore[arg-type]


def test_space_is_refused() -> None:
    scene = chain(0, 3).model_copy(update={"space": "space"})
    with pytest.raises(SceneError, match=r"^space = "):
        simulate_truncated(scene, 1.0)


def test_modes_that_do_not_span_the_motion_are_refused() -> None:
    """Without a mass the cart of a bob has no equation of its own at rest."""
    with pytest.raises(SceneError, match=r"support\.mass = 0\.0"):
        simulate_truncated(chain(0, 2, Cart(mass=0.0)), 1.0, start=State(np.full(2, 0.1), np.zeros(2)))


def test_without_its_second_run_nothing_is_stated() -> None:
    begun: list[float] = []

    def stop(elapsed: float) -> None:
        begun.append(elapsed)
        if len(begun) > 1 and begun[-1] < begun[-2]:
            raise KeyboardInterrupt

    start = State(np.full(3, 0.2), np.zeros(3))
    truncated = simulate_truncated(chain(0, 3), 1.0, 1, start=start, output=10, report=stop)
    assert truncated.trajectory.complete
    assert truncated.error == np.inf
    assert "not estimated" in truncated.trajectory.run.reason
    assert "was not estimated" in summary.text(truncated.trajectory)


def test_modes_are_found_once_for_the_times_and_the_coordinates_of_a_run() -> None:
    scene = Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0, count=7)])])
    modes_of.cache_clear()
    start = start_in_mode(scene, modes_of(scene), 0, 0, 0.05)
    simulate_truncated(scene, 0.5, 3, start=start)
    assert modes_of.cache_info().misses == 1
    assert modes_of.cache_info().hits >= 1
