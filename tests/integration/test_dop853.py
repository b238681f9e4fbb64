"""DOP853 in floats and compiled: the equations and the steps of the route in NumPy."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from math import cos, inf, pi, sin
from typing import Any

import numpy as np
import pytest
from dense_form import DenseForm
from scenes import long_scene, motion_scene, random_state
from scipy.integrate import DOP853
from support.amounts import usually
from support.uncompiled import uncompiled

from modal import Bob, Cart, Pendulum, Scene, load
from modal.scene import VanDerPol
from modal.types import Floats
from nonlinear.dynamics import Generated, Mechanics, Minimal, Recursion, Reduced, mechanics
from nonlinear.dynamics.compiled import Compiled, available
from nonlinear.dynamics.elimination import Elimination
from nonlinear.dynamics.text import function_in
from nonlinear.integration import Choice, Request, equations_of, method, methods
from nonlinear.integration.driver import Drive
from nonlinear.integration.floats import FloatStepper, attempt_of, wide_attempt
from nonlinear.integration.method import Shares
from nonlinear.integration.steppers import Pace, SciPyStepper, Sweeper
from nonlinear.simulation import simulate
from nonlinear.system import Event, State, System, initial_state, state_at_rest, system_of

PLAIN = Choice("minimal", "DOP853", False, "")
ENOUGH = 1.5  # s, before chaos has had time


def apart(values: Floats, expected: Floats) -> float:
    return float(np.max(np.abs(values - expected)) / np.max(np.abs(expected)))


def plain(system: System, body: Any = Recursion, **how: Any) -> Minimal:
    return Minimal(system, tuple(body(group, **how) for group in system.groups))


def mixed() -> Scene:
    """Two kinds of pendula, every joint sprung and damped, one driven, on a held cart."""
    links = [Bob(mass=1.0, length=0.7, stiffness=0.3, damping=0.02), Bob(mass=0.4, length=1.1, damping=0.01)]
    drive = Bob(mass=0.5, length=0.9, drive=VanDerPol(strength=0.05, angle_deg=20.0))
    support = Cart(mass=3.0, stiffness=2.0, damping=0.1)
    return Scene(gravity=9.81, support=support, pendulum=[Pendulum(links=links, count=2), Pendulum(links=[drive])])


def leaning(scene: Scene) -> State:
    """At rest, every link a little further out than the one before."""
    return state_at_rest(scene, np.linspace(30.0, 50.0, scene.n_links).tolist())


# ------------------------------------------------------------------------------------------------------- equations


@pytest.mark.parametrize("seed", range(40))
def test_what_is_written_out_is_the_recursion(seed: int) -> None:
    system = system_of(motion_scene(seed))
    y = plain(system).begin(random_state(system, seed))
    assert apart(Generated(system).derivative(0.0, y), plain(system).derivative(0.0, y)) < 1e-12


@pytest.mark.parametrize("seed", range(20))
def test_long_chains_are_written_out_as_the_recursion_to_the_last_digits(seed: int) -> None:
    system = system_of(long_scene(seed, 12))
    y = np.random.default_rng(seed).uniform(-3, 3, plain(system).layout.size)
    assert apart(Generated(system).derivative(0.0, y), plain(system).derivative(0.0, y)) < 1e-11


@pytest.mark.parametrize("seed", range(20))
def test_elimination_is_the_dense_solution_for_one_y_and_for_many(seed: int) -> None:
    system = system_of(motion_scene(seed))
    layout = plain(system).layout
    many = np.random.default_rng(seed).uniform(-3, 3, (layout.size, 7))
    expected = np.array([DenseForm(system).derivative(0.0, y) for y in many.T]).T
    assert apart(Generated(system).derivative(0.0, many), expected) < 1e-11
    assert apart(plain(system, Elimination).derivative(0.0, many[:, 0]), expected[:, 0]) < 1e-11


@pytest.mark.parametrize("seed", range(10))
def test_many_complex_y_go_through_what_is_written_as_through_the_recursion(seed: int) -> None:
    """With a step along the imaginary axis, whose digits are those of a derivative; the work is omitted."""
    system = system_of(motion_scene(seed))
    bodies = tuple(Recursion(group, tail=1) for group in system.groups)
    expected, equations = Minimal(system, bodies, counts_work=False), Generated(system, counts_work=False)
    size = 2 * (system.n_links + (system.cart is not None))
    assert expected.layout.size == equations.layout.size == size
    rng = np.random.default_rng(seed)
    y = rng.uniform(-3, 3, (size, 5)) + 1e-30j * rng.uniform(-1, 1, (size, 5))
    rates, other = equations.derivative(0.0, y), expected.derivative(0.0, y)
    assert apart(rates.real, other.real) < 1e-11
    assert apart(rates.imag, other.imag) < 1e-10


def test_energies_of_few_instants_at_once_are_those_of_all(monkeypatch: pytest.MonkeyPatch) -> None:
    run = simulate(load("paper-cart-3"), 2.0, output=101)
    whole = run.mechanics.energies
    monkeypatch.setattr(mechanics, "NUMBERS_IN_CACHE", 50)
    parts = Mechanics(run.system, run.motion).energies
    for part, other in zip(parts, whole, strict=True):
        assert np.abs(part - other).max() < 1e-14 * np.abs(other).max()
    assert np.array_equal(run.mechanics.energy, sum(whole))


def test_few_links_are_written_out_and_more_go_by_bands_or_recursions() -> None:
    def kind(count: int, pendula: int = 1) -> str:
        chain = Pendulum(links=[Bob(mass=1.0, length=1.0, count=count)], count=pendula)
        support = {"support": Cart(mass=100.0)} if pendula > 1 else {}
        return type(equations_of(system_of(Scene(gravity=9.81, pendulum=[chain], **support)), PLAIN)).__name__

    assert [kind(count) for count in (12, 100, 101)] == ["Generated", "Generated", "Minimal"]
    assert [kind(2, pendula) for pendula in (50, 51)] == ["Generated", "Minimal"]


def test_scenes_that_differ_in_numbers_alone_share_one_text() -> None:
    function_in.cache_clear()
    for mass in (0.3, 0.7, 1.3):
        scene = Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=mass, length=1.7), Bob(mass=0.2, length=0.6)])])
        system = system_of(scene)
        y = np.array([0.3, -0.2, 0.5, 0.9])
        assert apart(Generated(system).derivative(0.0, y), plain(system).derivative(0.0, y)) < 1e-14
    assert function_in.cache_info().misses == 2  # the constants, and the rate


def test_where_nothing_acts_nothing_is_written() -> None:
    """Of a bob at rest on a fixed support only g sin θ is left."""
    bob = system_of(Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0)])]))
    assert Generated(bob).rate.__code__.co_varnames == ("y", "u", "v", "y0", "y1")
    assert Generated(bob).rate.__code__.co_names == ("sin",)


def test_what_has_no_number_is_nan_or_inf_as_in_numpy() -> None:
    free = system_of(Scene(gravity=9.81, support=Cart(mass=0.0), pendulum=[Pendulum(links=[Bob(mass=1, length=1)])]))
    for y in (np.zeros(4), np.array([0.0, inf, 0.0, 0.0])):
        with np.errstate(all="ignore"):
            numbers = plain(free).derivative(0.0, y)
        assert not np.isfinite(numbers).all()
        assert not np.isfinite(Generated(free).derivative(0.0, y)).all()


# ------------------------------------------------------------------------------------------------------------ steps


def both(
    engine: str, scene: Scene, tolerance: float, pace: Pace, duration: float = 3.0
) -> tuple[SciPyStepper, SciPyStepper]:
    """The stepper of an engine and SciPy's for the same equations."""
    system = system_of(scene)
    equations = Generated(system) if engine == "floats" else Compiled(system)
    made: Any = FloatStepper if engine == "floats" else stepper_compiled()
    start = initial_state(scene) if any(each.start for each in scene.pendulum) else leaning(scene)
    arguments = (0.0, equations.begin(start), duration, tolerance, 0.1 * tolerance * equations.scale, pace)
    return made(equations, *arguments), SciPyStepper("DOP853", equations.derivative, *arguments)


def stepper_compiled() -> Any:
    from nonlinear.integration.compiled import CompiledStepper

    return CompiledStepper


fast = pytest.mark.skipif(not available(), reason="numba is not installed")
ENGINES = [
    "floats",
    pytest.param("uncompiled", marks=fast),
    *usually((), (pytest.param("compiled", marks=fast),)),
]
engines = pytest.mark.parametrize("engine", ENGINES, indirect=True)


@pytest.fixture
def engine(request: pytest.FixtureRequest) -> Iterator[str]:
    """Floats, or the kernel for numba as Python runs it or as it is compiled, which takes ten seconds."""
    with uncompiled() if request.param == "uncompiled" else nullcontext():
        yield request.param


NEVER = Event("never", lambda state: 1.0)
PACES = (Pace(0.02), Pace(0.5), Pace(0.01, longest=0.03), Pace(0.05, breaks=(0.7, 1.3), share=0.4))


@engines
@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-9])
@pytest.mark.parametrize("pace", PACES, ids=str)
@pytest.mark.parametrize("scene", [load("chain-3"), load("huygens"), mixed()], ids=lambda scene: scene.title or "mixed")
def test_its_steps_are_those_of_scipy(engine: str, scene: Scene, pace: Pace, tolerance: float) -> None:
    """Estimates of errors are differences of about the tolerance, so that their rounding is some 1e-15 over that.

    A cart between clocks in antiphase stands still but for rounding, which its share of the estimate multiplies.
    They are compared up to a break only: there SciPy's integrator seeks a first step, and floats continue as before.
    """
    near = 1e-12 / tolerance
    ours, theirs = both(engine, scene, tolerance, pace)
    while theirs.time < (pace.breaks[0] / 2 if pace.breaks and engine == "floats" else ENOUGH):
        ours.step()
        theirs.step()
        assert ours.calls == theirs.calls
        assert ours.time == pytest.approx(theirs.time, rel=near)
        within = np.linspace(theirs.before, theirs.time, 5)
        assert apart(ours.inside(within), theirs.inside(within)) < near
    middle = (theirs.before + theirs.time) / 2
    assert apart(ours.exact(middle), theirs.exact(middle)) < near
    assert ours.calls == theirs.calls
    for each in (ours, theirs):
        each.restart(1.01 * each.y)
        each.step()
    assert ours.calls == theirs.calls
    assert ours.time == pytest.approx(theirs.time, rel=10 * near)
    assert apart(ours.y, theirs.y) < 100 * near


@engines
@pytest.mark.parametrize("pace", [Pace(), Pace(breaks=(0.7, 1.3)), Pace(longest=0.002)], ids=str)
@pytest.mark.parametrize("name", ["paper-cart-3", "chain-3", "mixed"])
def test_samples_of_many_steps_at_once_are_those_of_each(name: str, pace: Pace, engine: str) -> None:
    scene = mixed() if name == "mixed" else load(name)
    end = 0.2 if pace.longest < 0.01 else 1.5
    times = np.sort(np.random.default_rng(0).uniform(0.0, end, 150))
    times[0], times[-1] = 0.0, end
    (far, _), (near, _) = (both(engine, scene, 1e-8, pace) for _ in range(2))
    assert isinstance(far, Sweeper)
    rows, ends = [far.y[None]], []
    while sum(map(len, rows)) < len(times):
        samples, passed, _ = far.sweep(times[sum(map(len, rows)) :])
        rows.append(samples)
        ends += passed
    for at, (time, y) in enumerate(ends):
        near.step()
        assert (near.time, near.y.tolist()) == (time, list(y)), at
    by_step = Drive(both(engine, scene, 1e-8, pace)[0], Generated(system_of(scene)), times, events=(NEVER,)).run()
    assert by_step.steps == len(ends)
    assert apart(np.concatenate(rows), by_step.rows) < 1e-13
    assert far.calls == near.calls + 3 * len({np.searchsorted([time for time, _ in ends], when) for when in times[1:]})


@engines
@pytest.mark.parametrize("tolerance", [1e-4, 1e-7, 1e-11])
@pytest.mark.parametrize("name", ["paper-cart-3", "chain-3", "mixed"])
def test_a_run_is_the_run_in_numpy(name: str, tolerance: float, engine: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = mixed() if name == "mixed" else load(name)
    start = leaning(scene) if name == "mixed" else None
    runs = []
    for compiled, written in ((engine != "floats", 100), (False, 0)):
        way = Choice("minimal", "DOP853", compiled, "", tolerance)
        monkeypatch.setattr(methods, "FLOATS", written)
        monkeypatch.setattr(Request, "choice", lambda self, tolerance, way=way: way)
        runs.append(simulate(scene, 2.0, start=start, tolerance=tolerance))
    ours, theirs = runs
    inner: list[Any] = [each.equations for each in runs]
    kinds = [type(each.inner if isinstance(each, Reduced) else each).__name__ for each in inner]
    assert kinds == ["Generated" if engine == "floats" else "Compiled", "Minimal"]
    assert (ours.run.steps, ours.run.calls) == (theirs.run.steps, theirs.run.calls)
    for part in ("links", "link_rates", "cart", "work"):
        mine, other = getattr(ours.motion, part), getattr(theirs.motion, part)
        assert np.max(np.abs(mine - other)) < 1e-11 * max(1.0, float(np.max(np.abs(other))))
    assert ours.energy_drift() <= 1.001 * theirs.energy_drift() + 1e-13


def test_coefficients_are_those_of_scipy() -> None:
    def dense(rows: Sequence[Shares], columns: int) -> Floats:
        matrix = np.zeros((len(rows), columns))
        for row, shares in zip(matrix, rows, strict=True):
            for stage, share in shares:
                row[stage] = share
        return matrix

    assert np.array_equal(dense(method.ROWS, method.STAGES), [*DOP853.A, DOP853.B])
    assert np.array_equal(dense([method.FIFTH, method.THIRD], method.STAGES + 1), [DOP853.E5, DOP853.E3])
    assert np.array_equal(dense(method.MORE, method.STAGES + method.EXTRA + 1), DOP853.A_EXTRA)
    assert np.array_equal(dense(method.POWERS, method.STAGES + method.EXTRA + 1), DOP853.D)
    assert np.array_equal(method.NODES, [*DOP853.C, 1.0, *DOP853.C_EXTRA])


def test_one_step_of_a_known_fall() -> None:
    """One step of one equation whose stages are known: y' = 1 ends where the weights sum to 1."""
    equations = Generated(system_of(Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0)])])))
    stepper = FloatStepper(equations, 0.0, np.array([pi / 2, 0.0]), 1.0, 1e-6, np.full(2, 1e-6), Pace(first=1e-4))
    stepper.step()
    assert stepper.calls == 1 + DOP853.n_stages
    assert stepper.y == pytest.approx([pi / 2 - 9.81e-8 / 2, -9.81e-4], rel=1e-14)


def test_a_report_that_ends_a_run_ends_it_at_its_step() -> None:
    heard: list[float] = []

    def report(elapsed: float) -> None:
        heard.append(elapsed)
        if len(heard) == 40:
            raise KeyboardInterrupt

    run = simulate(load("paper-cart-3"), 10.0, report=report, method="DOP853")
    assert run.run.interrupted
    assert run.run.steps == 40
    assert run.times[-1] == heard[-1]
    whole = simulate(load("paper-cart-3"), heard[-1], method="DOP853", output=2)
    assert np.abs(run.final.links - whole.final.links).max() < 1e-8


def test_angles_far_beyond_any_turn_end_in_words() -> None:
    scene = Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0)])])
    run = simulate(scene, 1e-3, start=state_at_rest(scene, [1e5]), output=3)
    assert run.complete


def test_long_and_short_states_take_the_same_step() -> None:
    rng, size, h = np.random.default_rng(3), 70, 0.05
    y, absolute = rng.uniform(-1.0, 1.0, size), np.full(size, 1e-6).tolist()

    def rate(z: list[float], u: tuple[float, ...]) -> list[float]:
        return [cos(u[0]) - 3.0 * sin(value) * other for value, other in zip(z, z[1:] + z[:1], strict=True)]

    arguments = rate, h, y.tolist(), rate(y.tolist(), (0.2,)), 1e-6, absolute, 0.2, lambda time, z: (time,)
    long = wide_attempt(*arguments, is_time_only=False)
    short = attempt_of(size, ", inputs(t + {} * h, z)")(*arguments)
    assert long[:2] == pytest.approx(short[:2], rel=1e-6)
    for ours, theirs in zip(long[2:], short[2:], strict=True):
        assert np.abs(np.array(ours) - theirs).max() < 2e-14
