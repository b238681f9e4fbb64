"""Tangent dynamics and Lyapunov exponents: against differences, SymPy, linear modes, shadows and scaling laws."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pytest
import sympy as sp
from dense_form import DenseForm
from scenes import extreme_scene
from scipy.integrate import solve_ivp

from modal.errors import SceneError
from modal.modes import natural_modes
from modal.plotting import save
from modal.scene import Bob, Cart, InitialCondition, Pendulum, Rod, Scene
from modal.types import Floats
from nonlinear.chaos import Case, Exponent, Finding, lyapunov_exponent, measure, study, text
from nonlinear.chaos.claims import verdicts
from nonlinear.chaos.studies import ChaosStudy, level_starts
from nonlinear.dynamics import Mechanics
from nonlinear.dynamics.variational import Variational
from nonlinear.plotting import exponent_figure, finding_figure
from nonlinear.sweeps import parse_measures
from nonlinear.system import Layout, State, system_of

G = 9.81


def chain(links: int, *, kind: type[Bob] | type[Rod] = Bob, gravity: float = G, **more: object) -> Scene:
    link = kind(mass=1.0, length=1.0, count=links)
    return Scene(title="chain", gravity=gravity, pendulum=(Pendulum(links=(link,), **more),))


def released(links: int, degrees: float, **more: object) -> Scene:
    return chain(links, start=InitialCondition(angles_deg=(degrees,) * links), **more)


DAMPED = Scene(
    gravity=G,
    support=Cart(mass=2.0, damping=0.3, stiffness=5.0),
    pendulum=(
        Pendulum(links=(Rod(mass=1.0, length=0.7, damping=0.1, stiffness=0.4), Bob(mass=0.5, length=0.4))),
        Pendulum(links=(Bob(mass=0.3, length=1.0, damping=0.2),)),
    ),
)


# ------------------------------------------------------------------------------------------------ tangent dynamics


def product(equations: Variational, y: Floats, v: Floats) -> tuple[Floats, Floats]:
    """y' and J v, (size, E) each."""
    rates = np.array(np.broadcast_arrays(*equations.tangent([*y, *v])))
    return rates[: len(y)], rates[len(y) :]


@pytest.mark.parametrize("scene", [DAMPED, chain(3), *map(extreme_scene, (4, 8, 15))], ids=range(5))
def test_the_tangent_is_the_slope_of_the_derivative(scene: Scene) -> None:
    equations, rng = Variational(system_of(scene)), np.random.default_rng(3)
    size, units = equations.size, equations.layout.natural(equations.system)[:, None]
    y = rng.uniform(-1, 1, (size, 5)) * units
    v = rng.standard_normal((size, 5)) * units
    f, Jv = product(equations, y, v)
    step = 1e-3
    ahead, behind, far, back = (equations.derivative(0.0, y + k * step * v) for k in (1, -1, 2, -2))
    slope = (8 * (ahead - behind) - (far - back)) / (12 * step)
    assert np.allclose(f, equations.derivative(0.0, y), rtol=1e-13, atol=1e-13 * np.abs(f).max())
    assert np.abs((slope - Jv) / np.abs(Jv).max(1, keepdims=True)).max() < 1e-8


def test_the_motion_carried_along_is_the_simulated_one() -> None:
    """The dense form with its work column, one trajectory at a time, gives the same y'."""
    system = system_of(DAMPED)
    equations, plain = Variational(system), DenseForm(system)
    y = np.random.default_rng(1).standard_normal((equations.size, 3))
    f, _ = product(equations, y, np.ones_like(y))
    for k in range(3):
        assert np.allclose(f[:, k], plain.derivative(0.0, np.append(y[:, k], 0.0))[:-1], rtol=1e-12)


def test_the_tangent_is_sympys_jacobian() -> None:
    """A bob on a cart: x'' and θ'' solved by SymPy from the Lagrangian's equations."""
    x, w, t, u, m, M, l = sp.symbols("x w t u m M l")
    a, b = sp.symbols("a b")
    pushed = (M + m) * a + m * l * (b * sp.cos(t) - u**2 * sp.sin(t))
    turned = m * l * (a * sp.cos(t) + l * b + G * sp.sin(t))
    solved = sp.solve((pushed, turned), (a, b))
    numbers = {m: 0.7, M: 1.9, l: 1.3, x: 0.2, t: 0.9, w: -0.4, u: 2.1}
    exact = sp.Matrix([w, u, solved[a], solved[b]]).jacobian([x, t, w, u]).subs(numbers)
    scene = Scene(gravity=G, support=Cart(mass=1.9), pendulum=(Pendulum(links=(Bob(mass=0.7, length=1.3),)),))
    y = np.array([0.2, 0.9, -0.4, 2.1])[:, None]
    _, J = product(Variational(system_of(scene)), np.tile(y, 4), np.eye(4))
    assert np.allclose(J, np.array(exact.tolist(), dtype=float), rtol=1e-13, atol=1e-13)


# -------------------------------------------------------------------------------------------- where λ is known


def test_regular_motion_is_not_told_from_zero() -> None:
    exponent = lyapunov_exponent(released(1, 90), 40.0, members=8)
    assert not exponent.is_positive
    assert exponent.chaotic == 0
    assert 0 < exponent.bound < 0.1
    assert exponent.words().startswith("< ")
    assert "not distinguishable from zero" in exponent.text()


@pytest.mark.parametrize(("links", "up"), [(1, 1), (2, 1), (2, 2), (3, 2)])
def test_at_a_standing_rest_it_is_the_fastest_growth_rate(links: int, up: int) -> None:
    """For one link sqrt(g/l).  The last links stand, the others hang; round-off tips them over only later."""
    ways = ("down",) * (links - up) + ("up",) * up
    scene = chain(
        links, equilibrium=ways, start=InitialCondition(angles_deg=tuple(180.0 * (way == "up") for way in ways))
    )
    rate = max(mode.growth_rate or 0.0 for mode in natural_modes(scene))
    assert links > 1 or rate == pytest.approx(np.sqrt(G), rel=1e-14)
    exponent = lyapunov_exponent(scene, 7.0, members=4, spread=0.0)
    early, late = np.searchsorted(exponent.times, [14 / rate, 22 / rate])
    grown = exponent.growth[early:late].sum(0) / (exponent.times[late] - exponent.times[early])
    assert grown == pytest.approx([rate] * 4, rel=1e-6 if links == 1 else 1e-4)


def test_the_tangent_at_a_standing_rest_has_the_modes_of_the_table() -> None:
    scene = chain(3, kind=Rod, equilibrium=("up", "down", "up"))
    y = np.array([np.pi, 0, np.pi, 0, 0, 0])[:, None]
    _, jacobian = product(Variational(system_of(scene)), np.tile(y, 6), np.eye(6))
    modes = natural_modes(scene)
    expected = sorted([*modes.eigenvalue, *-modes.eigenvalue], key=lambda s: (round(s.real, 6), s.imag))
    eigenvalues = sorted(np.linalg.eigvals(jacobian), key=lambda s: (round(s.real, 6), s.imag))
    assert np.allclose(eigenvalues, expected, rtol=0, atol=1e-10)


def test_dampers_make_it_the_slowest_decay() -> None:
    """Two rods on a damped cart, all but at rest: the modal table's slowest decay, and no energy to be kept."""
    joint = {"mass": 1.0, "length": 1.0, "damping": 0.5}
    scene = Scene(
        gravity=G,
        support=Cart(mass=1.0, damping=1.0, stiffness=6.0),
        pendulum=(Pendulum(links=(Rod(**joint), Rod(**joint)), start=InitialCondition(angles_deg=(0.01, 0.01))),),
    )
    exponent = lyapunov_exponent(scene, 60.0, members=4)
    assert exponent.value == pytest.approx(max(natural_modes(scene).eigenvalue.real), abs=1 / 60)
    assert exponent.value < -0.1
    assert not exponent.is_positive
    assert np.isnan(exponent.energy_drift)


def test_gravity_only_sets_the_clock() -> None:
    """g → 4 g from the same angles doubles every λ: the same growth in half the time."""
    slow, fast = (
        lyapunov_exponent(released(2, 120, gravity=g), 20 / np.sqrt(g), members=3, tolerance=1e-11) for g in (1.0, 4.0)
    )
    assert fast.times[-1] == slow.times[-1] / 2
    assert slow.growth.sum(0).min() > 2
    assert np.allclose(fast.growth.sum(0), slow.growth.sum(0), rtol=1e-6)


# --------------------------------------------------------------------------------- a second route: shadow trajectories


def double_pendulum(y: np.ndarray) -> np.ndarray:
    """Two bobs of 1 kg on 1 m each, g = 9.81, written out: y = (θ1, θ2, θ1', θ2'), with any axes behind."""
    a, b, v, w = y
    c, s = np.cos(a - b), np.sin(a - b)
    first, second = -s * w * w - 2 * G * np.sin(a), s * v * v - G * np.sin(b)
    return np.array([v, w, (first - c * second) / (2 - c * c), (2 * second - c * first) / (2 - c * c)])


def shadow_growth(y: np.ndarray, aside: np.ndarray, end: float) -> np.ndarray:
    """ln(|v(end)| / |v(0)|) (E,) of small asides, from trajectories a little to either side; |v| in units of √(g/l)."""
    near, both = 1e-8, np.stack((y + 1e-8 * aside, y - 1e-8 * aside), axis=2)
    run = solve_ivp(
        lambda t, z: double_pendulum(z.reshape(both.shape)).ravel(),
        (0.0, end),
        both.ravel(),
        method="DOP853",
        rtol=1e-12,
        atol=1e-13,
    )
    ahead, behind = np.moveaxis(run.y[:, -1].reshape(both.shape), 2, 0)
    units = np.array([1.0, 1.0, np.sqrt(G), np.sqrt(G)])[:, None]
    length = np.linalg.norm((ahead - behind) / (2 * near * units), axis=0)
    return np.log(length / np.linalg.norm(aside / units, axis=0))


def test_two_routes_agree_at_high_energy() -> None:
    """Over a time in which rounding does not yet choose another motion, start by start: no chaotic sample decides."""
    angles = np.radians(150) + np.random.default_rng(77).uniform(-0.1, 0.1, (4, 2))
    exponent = lyapunov_exponent(chain(2), 6.4, starts=[State(a, np.zeros(2)) for a in angles], tolerance=1e-11, seed=3)
    drawn = np.random.default_rng(0).standard_normal((4, 1))  # the same direction for all
    aside = np.tile(drawn * np.array([1.0, 1.0, np.sqrt(G), np.sqrt(G)])[:, None], 4)
    expected = shadow_growth(np.concatenate((angles.T, np.zeros((2, 4)))), aside, exponent.times[-1])
    assert expected.max() > 8
    assert exponent.growth.sum(0) == pytest.approx(expected, abs=1e-3)


@pytest.fixture(scope="module")
def many() -> Exponent:
    return lyapunov_exponent(released(2, 150), 24.0, members=32, tolerance=1e-6)


def test_the_exponent_is_that_of_64_runs_of_an_hour(many: Exponent) -> None:
    """1.3087 ± 0.0035 1/s from 64 shadow trajectories of 4000 s each."""
    assert many.is_positive
    assert many.error < 0.08
    assert abs(many.value - 1.3087) < 6 * np.hypot(many.error, 0.0035)
    assert 0 < many.energy_drift < 5e-4


def test_independent_ensembles_agree_within_their_uncertainty(many: Exponent) -> None:
    """Four at once, by their Birge ratio: χ² per degree of freedom."""
    parts = [replace(many, growth=growth) for growth in np.split(many.growth, 4, axis=1)]
    values, errors = np.array([(part.value, part.error) for part in parts]).T
    assert np.mean([part.value for part in parts]) == pytest.approx(many.value, rel=1e-12)
    assert np.sum(((values - many.value) / errors) ** 2) / 3 < 8
    assert np.median(errors) == pytest.approx(2 * many.error, rel=0.6)


def drawn(rng: np.random.Generator, ensemble: int, sticks: float) -> Exponent:
    """An exponent of 1/s whose starts differ by 0.2, and keep differing for so long."""
    times, growth = np.arange(0.0, 61.0), rng.standard_normal((60, ensemble))
    for k in range(1, 60):
        growth[k] = np.exp(-1 / sticks) * growth[k - 1] + np.sqrt(-np.expm1(-2 / sticks)) * growth[k]
    return Exponent(chain(2), times, 1 + growth, transient=20.0, energy_drift=0.0)


@pytest.mark.parametrize(("ensemble", "sticks"), [(1, 2.0), (4, 2.0), (4, 10.0), (16, 10.0)])
def test_intervals_hold_the_exponent_as_often_as_they_say(ensemble: int, sticks: float) -> None:
    rng = np.random.default_rng(11)
    exponents = [drawn(rng, ensemble, sticks) for _ in range(600)]
    assert 0.935 < np.mean([abs(exponent.value - 1) < exponent.half_width for exponent in exponents]) < 0.99


def test_a_single_start_says_that_it_is_judged_by_blocks() -> None:
    rng = np.random.default_rng(2)
    single, four = (drawn(rng, ensemble, 2.0) for ensemble in (1, 4))
    assert single.error == pytest.approx(1.4 * single.blocks.std(ddof=1) / np.sqrt(10))
    assert (single.coverage, four.coverage) == pytest.approx((2.262, 3.182), abs=1e-3)
    assert "widened 1.4-fold: use 4 starts or more" in single.text()
    assert "take 4" not in four.text()
    low, high = four.value - four.half_width, four.value + four.half_width
    assert f"95 % confidence interval: {low:.3g} to {high:.3g} 1/s" in four.text()


def test_a_constructed_growth_is_read_off_exactly() -> None:
    times, rng = np.arange(0.0, 61.0), np.random.default_rng(2)
    noise = rng.standard_normal((60, 200))
    exponent = Exponent(chain(2), times, 0.7 + noise, transient=20.0, energy_drift=0.0)
    assert exponent.duration == 40.0
    assert exponent.value == pytest.approx(0.7 + noise[20:].mean(), rel=1e-12)
    assert exponent.error == pytest.approx(1 / np.sqrt(40 * 200), rel=0.5)
    assert exponent.running()[1][-1] == pytest.approx(exponent.members)
    assert exponent.floor == pytest.approx((1 + np.log(60 * np.sqrt(G))) / 40)
    assert not replace(exponent, growth=0 * exponent.growth).is_positive
    linear = np.diff(np.log(np.maximum(times, 0.5)))[:, None]
    assert not replace(exponent, growth=linear).is_positive


def test_regular_islands_are_told_from_the_chaos_around_them() -> None:
    rng = np.random.default_rng(5)
    mixed = drawn(rng, 40, 2.0)
    mixed.growth[:, :10] = 0.0
    alone = mixed.of_the_chaotic
    assert (mixed.chaotic, alone.ensemble) == (30, 30)
    assert mixed.value == pytest.approx(0.75 * alone.value, rel=1e-12)
    assert mixed.error > 1.2 * alone.error
    assert f"of those alone {alone.equation}" in mixed.text()
    assert "of those alone" not in alone.text()


@pytest.mark.parametrize(
    ("scene", "duration", "words"),
    [(released(1, 90), 1.0, "at least 6.39 s"), (released(1, 90).model_copy(update={"space": "space"}), 30.0, "plane")],
)
def test_what_cannot_be_is_refused(scene: Scene, duration: float, words: str) -> None:
    with pytest.raises(SceneError, match=words):
        lyapunov_exponent(scene, duration)


# --------------------------------------------------------------------------------------------------- the two claims


@pytest.mark.parametrize("case", [*study("000").cases, *study("001").cases], ids=lambda case: case.scene.title)
def test_every_start_has_the_energy_of_level_links(case: Case) -> None:
    system = system_of(case.scene)
    layout = Layout.of(system, works=False)
    y = np.stack([layout.begin(state) for state in level_starts(case.scene, 6)], axis=1)
    mechanics = Mechanics(system, layout.read(y.T))
    level = np.zeros(system.n_pendula)
    for group in system.groups:
        level[group.pendula] = G * group.block.b.sum(0)
    assert np.abs(mechanics.of_pendula(mechanics.potential) - level).max() < 1e-12 * G * system.n_links**2
    assert case.scene.n_links == 1 or np.ptp(np.abs(mechanics.motion.links), axis=0).min() > 1e-3


def constant(scene: Scene, rate: float, error: float) -> Exponent:
    """An exponent of exactly this value and standard uncertainty."""
    times = np.arange(0.0, 1501.0)
    wave = np.tile([1.0, -1.0], 5).repeat(100) * 3 * error
    growth = np.tile(np.concatenate((np.zeros(500), rate + wave))[:, None], 48)
    return Exponent(scene, times, growth, 500.0, 0.0)


def made(paper: str, rates: list[float], error: float = 0.011) -> Finding:
    short = study(paper, quick=True)
    return Finding(short, tuple(constant(c.scene, r, error) for c, r in zip(short.cases, rates, strict=True)))


def test_verdicts_compare_intervals() -> None:
    assert constant(chain(1), 1.0, 0.01).error == pytest.approx(0.01)
    growing, falling, level = made("001", [0, 1, 2, 3]), made("001", [0, 1, 0.9, 2]), made("001", [0, 1, 1.01, 2])
    assert [v.split(": ")[1].split(" ")[0] for v in verdicts(growing)] == ["supported", "supported"]
    assert "bobs, links of one length: not supported" in verdicts(falling)[0]
    assert "bobs, links of one length: undecided" in verdicts(level)[0]
    assert "one total length: supported" in verdicts(level)[1]
    carts = verdicts(made("000", [1.0, 0.8, 0.9, 1.0, 1.0, 1.3]))
    assert carts[0].startswith("1 double pendulum: supported")
    assert carts[1].startswith("2 double pendula: not supported")


def test_tables_and_pictures_of_both_claims() -> None:
    for paper, rates in (("001", [0.0, 1.0, 2.0, 3.0]), ("000", [1.0, 0.8, 0.9, 1.0, 1.0, 1.3])):
        finding = made(paper, rates)
        assert f"{rates[-1]:.3f} ± 0.011" in text(finding)
        stream = io.BytesIO()
        save(finding_figure(finding), stream, "png")
        save(exponent_figure(finding.exponents[0]), stream, "png")
        assert stream.getvalue().count(b"\x89PNG") == 2
    assert "< 0.00" in text(made("001", [0.0, 1.0, 2.0, 3.0]))


def test_a_study_is_measured_case_by_case() -> None:
    short = study("001", quick=True)
    done: list[float] = []
    tiny = ChaosStudy("001", short.claim, short.cases[:1], 7.0, 3)
    finding = measure(tiny, done.append)
    assert done == [1]
    assert not finding.exponents[0].is_positive
    assert finding.exponents[0].ensemble == 3
    with pytest.raises(SceneError, match="paper:002: must be one of paper:000, paper:001"):
        study("002")


def test_progress_is_told_at_every_step() -> None:
    """Not only where v is brought back: ten thousand starts take a while until then."""
    seen: list[float] = []
    exponent = lyapunov_exponent(released(1, 90), 7.0, members=1, report=seen.append)
    assert len(seen) > len(exponent.times)
    assert seen == sorted(seen)
    assert seen[-1] == pytest.approx(10.5)


def test_starts_replace_the_scenes_own() -> None:
    state = State(np.array([3.0, 3.0]), np.zeros(2))
    exponent = lyapunov_exponent(chain(2), 7.0, starts=[state, state])
    assert exponent.ensemble == 2


def test_linear_drag_is_in_the_exponent_and_in_its_sweep() -> None:
    """A motion that dies out has the slowest decay of the linear scene as its exponent."""
    link = Bob(mass=1.0, length=1.0, drag=2.0)
    start = InitialCondition(angles_deg=(20.0,))
    scene = Scene(gravity=9.81, pendulum=(Pendulum(links=(link,), start=start),))
    slowest = float(natural_modes(scene).eigenvalue.real.max())
    assert lyapunov_exponent(scene, 40.0, members=1).value == pytest.approx(slowest, rel=6e-3)
    (swept,) = parse_measures(["lyapunov:40"])
    assert swept.of(scene)["lyapunov_per_s"] == pytest.approx(slowest, rel=6e-3)
