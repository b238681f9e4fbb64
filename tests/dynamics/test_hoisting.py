"""Ropes of prescribed length: exact solutions, Cartesian equations, energy books, and what refuses them."""

import re
from itertools import pairwise

import numpy as np
import pytest
from amounts import usually
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.special import jv, yv

from modal import load
from modal.assembly import matrices
from modal.errors import ComputationError, SceneError
from modal.scene import Bob, Body, Cart, Fixed, Hoist, Pendulum, Rod, Scene
from nonlinear import files
from nonlinear.dynamics import Generated, Maximal, Mechanics, module_of
from nonlinear.orbits.shooting import shooting
from nonlinear.postprocessing import reaction_forces_of
from nonlinear.reduction import simulate_truncated, superpose
from nonlinear.simulation import resume, simulate
from nonlinear.synchronization import study_synchronization
from nonlinear.system import State, system_of

G = 9.81


def single(length: float, hoist: Hoist | None = None) -> Scene:
    return Scene(gravity=G, pendulum=(Pendulum(links=(Bob(mass=2.0, length=length, hoist=hoist),)),))


def mixed(support: Fixed | Cart) -> Scene:
    """Bobs on changing ropes between rods and bodies, some of them copies."""
    links = (
        Bob(mass=2.0, length=1.0, damping=0.1, hoist=Hoist(to=0.5, duration=2.0)),
        Rod(mass=1.0, length=0.7, stiffness=3.0),
        Bob(mass=0.3, length=0.5, hoist=Hoist(to=1.5, begin=0.5, duration=1.0, profile="trapezoidal")),
        Body(mass=0.4, length=0.4, centre=0.3, inertia=0.05),
    )
    pendula = (Pendulum(count=2, links=links), Pendulum(links=(Bob(mass=1.0, length=1.0),)))
    return Scene(gravity=G, support=support, pendulum=pendula)


def swinging(scene: Scene) -> State:
    return State(np.linspace(-0.8, 1.0, scene.n_links), np.linspace(1.0, -0.5, scene.n_links))


@pytest.mark.parametrize("speed", [-0.4, 0.7])
def test_uniform_hoisting_is_lewins_pendulum(speed: float) -> None:
    """θ = (a J₁(x) + b Y₁(x))/x with x = 2 √(g l)/v solves l θ'' + 2 v θ' + g θ = 0, l = l₀ + v t."""
    first, angle, rate = 3.0, 1e-6, 2e-6

    def columns(length: np.ndarray) -> np.ndarray:
        x = 2 * np.sqrt(G * length) / abs(speed)
        return np.array([jv(1, x) / x, yv(1, x) / x])

    def slopes(length: float) -> np.ndarray:
        # (Z₁(x)/x)' = −Z₂(x)/x, dx/dt = (2 g/v²) (v/x) sign
        x = 2 * np.sqrt(G * length) / abs(speed)
        return -np.array([jv(2, x), yv(2, x)]) / x * (2 * G / (abs(speed) * x)) * np.sign(speed)

    weights = np.linalg.solve(np.array([columns(np.array(first)), slopes(first)]), [angle, rate])
    run = simulate(
        single(first),
        5.0,
        start=State(np.array([angle]), np.array([rate])),
        hoist={(0, 0): lambda t: (first + speed * t, speed, 0.0)},
        tolerance=1e-13,
        output=100,
    )
    exact = weights @ columns(first + speed * run.times)
    assert np.abs(run.motion.links[:, 0] - exact).max() < 1e-10 * np.abs(exact).max()


@pytest.mark.parametrize("profile", ["smooth", "trapezoidal"])
def test_large_swings_obey_the_textbook_equation(profile: str) -> None:
    scene = single(5.0, Hoist(to=2.0, begin=0.5, duration=4.0, profile=profile))
    law = scene.pendulum[0].links[0].hoist.law(5.0)

    def rate(t: float, y: np.ndarray) -> list[float]:
        length, speed, _ = map(float, law(t))
        return [y[1], -(2 * speed * y[1] + G * np.sin(y[0])) / length]

    y = np.array([0.7, 0.2])
    for begin, end in pairwise([0.0, *law.breaks, 6.0]):
        y = solve_ivp(rate, (begin, end), y, method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    run = simulate(scene, 6.0, start=State(np.array([0.7]), np.array([0.2])), tolerance=1e-12, output=2)
    assert np.abs(y - [run.final.links[0], run.final.link_rates[0]]).max() < 1e-10
    assert run.energy_drift() < 1e-9


def test_a_chain_of_bobs_obeys_cartesian_equations() -> None:
    """Points under gravity and the tensions T that keep |r_i − r_{i−1}| = l_i(t)."""
    hoists = (Hoist(to=0.6, duration=2.0), None, Hoist(to=1.4, begin=0.3, duration=1.2))
    mass, length = np.array([1.0, 0.5, 2.0]), np.array([1.0, 0.7, 0.9])
    links = tuple(Bob(mass=m, length=l, hoist=h) for m, l, h in zip(mass, length, hoists, strict=True))
    scene = Scene(gravity=G, pendulum=(Pendulum(links=links),))

    def lengths(t: float) -> np.ndarray:
        return np.array([[float(v) for v in link.hoist.law(link.length)(t)] if link.hoist else [link.length, 0, 0]
                         for link in links]).T  # fmt: skip

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        r, v = y.reshape(2, 3, 2)
        l, speed, acceleration = lengths(t)
        d, w = np.diff(r, axis=0, prepend=0.0), np.diff(v, axis=0, prepend=0.0)
        # a_i = g + (T_{i+1} d_{i+1} − T_i d_i)/m_i;  d_i·(a_i − a_{i−1}) = l l'' + l'² − w²
        pull = np.zeros((3, 3, 2))
        for i in range(3):
            pull[i, i] -= d[i] / mass[i]
            if i:
                pull[i - 1, i] += d[i] / mass[i - 1]
        relative = np.diff(pull, axis=0, prepend=0.0)
        matrix = np.einsum("ic,ijc->ij", d, relative)
        right = l * acceleration + speed**2 - np.sum(w * w, axis=1)
        right[0] -= d[0] @ [0.0, G]
        tension = np.linalg.solve(matrix, right)
        a = np.einsum("ijc,j->ic", pull, tension) + np.array([0.0, G])
        return np.concatenate((v.ravel(), a.ravel()))

    theta, omega = np.array([0.6, -0.3, 0.9]), np.array([0.5, 1.0, -0.7])
    u, n = np.array([np.sin(theta), np.cos(theta)]).T, np.array([np.cos(theta), -np.sin(theta)]).T
    y = np.concatenate((np.cumsum(length[:, None] * u, 0).ravel(), np.cumsum((length * omega)[:, None] * n, 0).ravel()))
    for begin, end in pairwise([0.0, 0.3, 1.5, 2.0]):
        y = solve_ivp(rate, (begin, end), y, method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    run = simulate(scene, 2.0, start=State(theta, omega), tolerance=1e-12, output=2)
    spans = np.diff(y[:6].reshape(3, 2), axis=0, prepend=0.0)
    assert np.abs(np.arctan2(*spans.T) - run.final.links).max() < 1e-9
    assert np.abs(np.linalg.norm(spans, axis=1) - [0.6, 0.7, 1.4]).max() < 1e-9


@pytest.mark.parametrize(
    "support", usually([Cart(mass=3.0)], [Fixed(), Cart(mass=3.0), Cart(mass=3.0, damping=0.2, stiffness=5.0)])
)
def test_maximal_coordinates_move_alike_and_both_close_their_books(support: Fixed | Cart) -> None:
    scene = mixed(support)
    start, how = swinging(scene), {"tolerance": 1e-11, "output": 20, "start_time": 0.3}
    run = simulate(scene, 0.6, start=start, **how)
    other = simulate(scene, 0.6, start=start, form="maximal", **how)
    assert isinstance(run.equations, Generated)
    assert isinstance(other.equations, Maximal)
    assert np.abs(run.motion.links - other.motion.links).max() < 1e-9
    assert np.abs(run.motion.work - other.motion.work).max() < 1e-9 * run.energy_scale
    assert abs(run.motion.work).max() > 0.1 * run.energy_scale
    assert run.energy_drift() < 1e-9
    assert other.energy_drift() < 1e-9
    assert support != Cart(mass=3.0) or run.momentum_drift() < 1e-9


def test_pivot_forces_are_the_multipliers() -> None:
    scene = mixed(Cart(mass=3.0))
    run = simulate(scene, 0.5, start=swinging(scene), output=5)
    equations = Maximal(run.system)
    for at, time in enumerate(run.times.tolist()):
        unknowns, _ = equations._solve(time, run.motion[at])
        pivots = unknowns[-2 * run.system.n_links :].reshape(-1, 2)
        assert np.allclose(reaction_forces_of(run).pivots[at], pivots, rtol=1e-9, atol=1e-9)


def test_power_is_the_rate_of_energy() -> None:
    scene = mixed(Cart(mass=3.0, damping=0.5))
    system, step = system_of(scene), 1e-5
    equations = Generated(system)
    y = equations.begin(swinging(scene))

    def energy(time: float, row: np.ndarray) -> float:
        return float(Mechanics(system, equations.read(row[None]), np.array([time])).energy[0])

    slope = equations.derivative(0.8, y)
    power = (energy(0.8 + step, y + step * slope) - energy(0.8 - step, y - step * slope)) / (2 * step)
    assert power == pytest.approx(slope[-1], rel=1e-7)


def test_a_hoist_takes_few_operations_more() -> None:
    """Those of the text of two bobs, the upper on a rope: 25 with constant lengths, 50 with the winch's power."""
    rope = Hoist(to=0.7, duration=3.0)
    counts = []
    for hoist in (None, rope):
        links = (Bob(mass=1.3, length=1.1, hoist=hoist), Bob(mass=0.7, length=0.6))
        form = Generated(system_of(Scene(gravity=9.81, support=Fixed(), pendulum=(Pendulum(links=links),)))).form
        counts.append(len(re.findall(r" [-+*/] ", module_of(form).python("rates"))))
    assert counts[0] <= 25
    assert counts[1] <= 50


def adiabatic(duration: float) -> float:
    """The largest relative change of E/ω of a pendulum over two phases of a swing, from 4 m to 1 m."""
    changes = []
    for phase in (0.3, 1.9):
        scene = single(4.0, Hoist(to=1.0, duration=duration))
        omega = np.sqrt(G / np.array([4.0, 1.0]))
        start = State(1e-5 * np.array([np.cos(phase)]), 1e-5 * omega[0] * np.array([np.sin(phase)]))
        end = simulate(scene, duration, start=start, tolerance=1e-9, output=2).final
        action = [
            l**2 * (rate**2 + w**2 * angle**2) / w
            for l, w, angle, rate in zip(
                (4.0, 1.0), omega, (start.links[0], end.links[0]), (start.link_rates[0], end.link_rates[0]), strict=True
            )
        ]
        changes.append(abs(action[1] / action[0] - 1))
    return max(changes)


def test_a_slow_hoist_keeps_energy_over_frequency() -> None:
    errors = [adiabatic(duration) for duration in (6.0, 12.0, 24.0)]
    assert errors[0] < 0.05
    assert errors[1] < errors[0] / 4
    assert errors[2] < errors[1] / 4


def test_splines_and_functions_are_laws() -> None:
    times = np.linspace(0.0, 2.0, 9)
    spline = CubicSpline(times, 1.0 + 0.2 * np.sin(times))
    exact = {(0, 0): lambda t: (spline(t), spline(t, 1), spline(t, 2))}
    start = State(np.array([0.5]), np.zeros(1))
    run, other = (simulate(single(1.0), 2.0, start=start, hoist=hoist, tolerance=1e-11, output=20)
                  for hoist in ({(0, 0): spline}, exact))  # fmt: skip
    assert np.abs(run.motion.links - other.motion.links).max() < 1e-8
    assert np.allclose(np.linalg.norm(run.mechanics.joints[:, 0], axis=1), spline(run.times), rtol=1e-12)
    assert run.energy_drift() < 1e-9
    more = resume(run, 0.1)
    assert more.system.hoisting is not None


def test_wrong_laws_are_named(tmp_path) -> None:
    start = State(np.array([0.5]), np.zeros(1))
    for hoist, words in (
        ({(0, 1): lambda t: (1.0, 0.0, 0.0)}, r"\(0, 1\) is not a pair of a pendulum and a link"),
        ({(0, 0): lambda t: 1.0}, r"pendulum\[0\].links\[0\]: must be a spline"),
        ({(0, 0): 3.0}, r"pendulum\[0\].links\[0\]: must be a spline"),
        (3.0, "must be a mapping"),
        ({(0, 0): lambda t: (1.0 - t, -1.0, 0.0)}, "a length must be a positive number"),
    ):
        with pytest.raises(SceneError, match=words):
            simulate(single(1.0), 2.0, start=start, hoist=hoist)
    run = simulate(single(1.0), 0.1, start=start, hoist={(0, 0): lambda t: (1.0 + t, 1.0, 0.0)}, output=3)
    with pytest.raises(SceneError, match="lengths given in Python are not saved"):
        files.save(run, tmp_path / "run.npz")


@pytest.mark.parametrize("kind", ["npz", "csv"])
def test_runs_are_saved_and_continued_along_the_hoist(tmp_path, kind: str) -> None:
    scene = load("hoisting-crane")
    whole = simulate(scene, 4.0, tolerance=1e-10, output=5)
    files.save(simulate(scene, 2.0, tolerance=1e-10, output=3), tmp_path / f"run.{kind}")
    again = resume(files.load(tmp_path / f"run.{kind}"), 2.0, output=3)
    assert np.abs(again.final.links - whole.final.links).max() < 1e-9
    assert again.energy_drift() < 1e-9
    assert np.allclose(again.mechanics.joints[-1], whole.mechanics.joints[-1], atol=1e-7)


def test_the_linear_equations_are_the_slope_of_the_full_ones() -> None:
    from modal.assembly import matrices_at

    scene = mixed(Cart(mass=3.0, damping=0.2))
    ways = ("down", "up", "down", "down")
    scene = scene.replace(pendulum=(scene.pendulum[0].replace(equilibrium=ways), scene.pendulum[1]))
    system = system_of(scene)
    equations, n, step = Generated(system), scene.n_links + 1, 1e-6
    rest = np.concatenate(([0.0], system.rest, np.zeros(n + 1)))
    for time in (0.4, 0.8, 1.4):
        model = matrices_at(scene, time)
        exact = -np.linalg.solve(model.M, np.hstack((model.K, model.D)))
        for column in range(2 * n):
            moved = np.zeros_like(rest)
            moved[column] = step
            slope = equations.derivative(time, rest + moved) - equations.derivative(time, rest - moved)
            assert np.allclose(slope[n : 2 * n] / (2 * step), exact[:, column], rtol=0, atol=1e-6)
    assert np.array_equal(matrices_at(scene, 10.0).M, matrices(scene.at(10.0)).M)


def test_what_needs_constant_lengths_says_so() -> None:
    scene = load("hoisting-crane")
    start = State(np.zeros(2), np.zeros(2))
    for form in ("hamiltonian",):
        with pytest.raises(SceneError, match="hoist"):
            simulate(scene, 1.0, form=form)
    with pytest.raises(SceneError, match="hoist"):
        simulate(scene.replace(space="space"), 1.0)
    for refused in (
        lambda: superpose(scene, start, corrected=False),
        lambda: simulate_truncated(scene, 1.0),
        lambda: study_synchronization(scene, 1.0),
        lambda: shooting(scene),
    ):
        with pytest.raises(SceneError, match=r"hoist.*constant lengths"):
            refused()
    damped = single(1.0).replace(damping_ratio=0.1)
    with pytest.raises(SceneError, match="damping_ratio"):
        simulate(damped, 1.0, start=State(np.ones(1), np.zeros(1)), hoist={(0, 0): lambda t: (1.0, 0.0, 0.0)})
    with pytest.raises(ComputationError, match="need times"):
        _ = Mechanics(system_of(scene), simulate(scene, 0.1, output=2).motion).joints


def test_a_law_is_refused_wherever_it_gives_no_length() -> None:
    """Between the samples of a run as well."""

    def law(time: float) -> tuple[float, float, float]:
        return (-1.0 if 0.2 < time < 0.8 else 1.0), 0.0, 0.0

    with pytest.raises(SceneError, match="positive number of metres"):
        simulate(single(1.0), 1.0, start=State(np.array([0.1]), np.zeros(1)), hoist={(0, 0): law}, output=2)
