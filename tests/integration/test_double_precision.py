"""Where double precision runs out: what keeps its digits there, and what says that it cannot."""

from __future__ import annotations

import numpy as np
import pytest
from amounts import usually
from test_bodies import apart, exact

from modal import Bob, Cart, ComputationError, Pendulum, Rod, Scene, SceneError
from nonlinear.dynamics import Banded, Generated, Recursion
from nonlinear.integration import Choice, Trajectory, equations_of
from nonlinear.integration.methods import body_of
from nonlinear.integration.steppers import tolerance_factor
from nonlinear.simulation import simulate
from nonlinear.system import AppliedForces, State, system_of

MINIMAL = Choice("minimal", "", compiled=False, reason="")


def chain(*masses: float, kind: type = Bob, cart: Cart | None = None) -> Scene:
    """Links of one metre."""
    pendulum = [Pendulum(links=[kind(mass=mass, length=1.0) for mass in masses])]
    return Scene(gravity=9.81, pendulum=pendulum, **({"support": cart} if cart else {}))


# ------------------------------------------------------------------------------------------ light above heavy


@pytest.mark.parametrize("ratio", [1e2, 1e4, 1e8, 1e12, 1e16])
@pytest.mark.parametrize("before", [(), (1.0,), (1.0, 0.3)])
def test_a_light_link_above_a_heavy_one_keeps_its_digits(before: tuple[float, ...], ratio: float) -> None:
    scene = chain(*before, 1.0, ratio, cart=Cart(mass=1e3 * ratio))
    equations, n = equations_of(system_of(scene), MINIMAL), len(before) + 2
    fast = ratio**-0.5
    y = np.concatenate(([0.0], 0.3 * fast * (-1.0) ** np.arange(n), [0.0], np.linspace(-1, 1, n)))
    assert apart(equations.derivative(0.0, y)[-n:], exact(scene, y)[1:]) < 1e-12


@pytest.mark.parametrize("kind", [Bob, Rod])
def test_ordinary_links_stay_on_the_fast_body(kind: type) -> None:
    for masses in ((1.0, 1.0), (1.0, 500.0), (1.0, 1e-8)):
        system = system_of(chain(*masses, kind=kind))
        assert type(equations_of(system, MINIMAL)) is Generated
        assert type(equations_of(system, MINIMAL, lambda time, state: AppliedForces())) is Generated
    system = system_of(chain(1.0, 1.0, 1.0, 999.0, kind=kind))
    assert type(body_of(system.groups[0], system)) is Banded
    system = system_of(chain(1.0, 1.0, 1.0, 2000.0, kind=kind))
    assert type(body_of(system.groups[0], system)) is Recursion


def test_a_mass_ratio_of_1e12_swings_right() -> None:
    """The light bob is on a taut string of two lengths: θ'' = −2 (g/l) (m2/m1) θ for tiny θ."""
    ratio, tiny = 1e12, 1e-12
    start = State(np.array([tiny, -tiny]), np.zeros(2))
    run = simulate(chain(1.0, ratio), 2 * ratio**-0.5, start=start, output=9)
    right = tiny * np.cos(np.sqrt(2 * 9.81 * ratio) * run.times)
    assert run.motion.links[:, 0] == pytest.approx(right, abs=1e-8 * tiny)


# --------------------------------------------------------------------------------------------- no beginning


@pytest.mark.parametrize("method", ["DOP853", "Radau", "LSODA", "taylor"])
def test_a_motion_without_a_finite_beginning_is_refused_at_once(method: str) -> None:
    if method == "taylor":
        pytest.importorskip("heyoka")
    start = State(np.array([0.1]), np.array([1e200]))
    scene = chain(1.0, cart=Cart(mass=1.0))
    with pytest.raises(ComputationError, match=r"accelerations at the start are not finite.*units"):
        simulate(scene, 1.0, start=start, method=method, output=2)


def test_a_massless_cart_that_nothing_pulls_has_no_beginning() -> None:
    start = State(np.zeros(1), np.ones(1))
    with pytest.raises(ComputationError, match=r"not finite.*give it a mass"):
        simulate(chain(1.0, cart=Cart(mass=0.0)), 1.0, start=start, method="DOP853", output=2)


# ------------------------------------------------------------------------------------------------- other units


def springs_and_dampers(mass: float = 1.0, length: float = 1.0) -> Scene:
    """A cart and three links in units of so many kg and m, gravity being the same: seconds go with √length."""
    moment, second = mass * length**2, np.sqrt(length)
    joint = {"damping": 0.1 * moment / second, "stiffness": 2.0 * mass * length}
    upper, lower = Rod(mass=mass, length=length), Rod(mass=0.5 * mass, length=0.7 * length, **joint)
    cart = Cart(mass=3 * mass, damping=0.2 * mass / second, stiffness=5 * mass / length)
    bob = Bob(mass=mass, length=1.3 * length, **joint)
    return Scene(gravity=9.81, support=cart, pendulum=[Pendulum(links=[upper, lower]), Pendulum(links=[bob])])


@pytest.mark.parametrize(
    ("method", "form"),
    [
        ("DOP853", "minimal"),
        ("DOP853", "maximal"),
        ("RK23", "minimal"),
        *usually([], [("RK45", "minimal"), ("Radau", "hamiltonian")]),
    ],
)
def test_another_second_changes_no_step(method: str, form: str) -> None:
    start, k = State(np.array([1.0, 0.5, -0.8]), np.zeros(3)), 9
    run = simulate(springs_and_dampers(), 2.0, start=start, method=method, form=form, tolerance=1e-7, output=9)
    other = springs_and_dampers(4.0**-k, 4.0**k)
    same = simulate(other, 2.0 * 2**k, start=start, method=method, form=form, tolerance=1e-7, output=9)
    assert (run.run.steps, run.run.calls) == (same.run.steps, same.run.calls)
    assert run.motion.links == pytest.approx(same.motion.links, abs=1e-10)


@pytest.mark.parametrize("form", ["minimal", "hamiltonian", "maximal"])
@pytest.mark.parametrize(("kilograms", "metres"), [(-320, -320), (320, 320), (-220, 0), (0, 110)])
def test_far_units_change_nothing(kilograms: int, metres: int, form: str) -> None:
    """At the same second: gravity goes with lengths."""
    mass, length, c = 2.0**kilograms, 2.0**metres, 0.1 * (abs(kilograms) < 300)
    links = [Rod(mass=mass, length=length), Rod(mass=0.5 * mass, length=0.7 * length, damping=c * mass * length**2)]
    far = Scene(gravity=9.81 * length, support=Cart(mass=3 * mass), pendulum=[Pendulum(links=links)])
    links = [Rod(mass=1.0, length=1.0), Rod(mass=0.5, length=0.7, damping=c)]
    metric = Scene(gravity=9.81, support=Cart(mass=3.0), pendulum=[Pendulum(links=links)])
    run, right = (
        simulate(
            scene, 1.0, start=State(np.array([1.0, 0.5]), np.zeros(2), 0.3 * unit), form=form, output=5, method="DOP853"
        )
        for scene, unit in ((far, length), (metric, 1.0))
    )
    assert run.run.reduced == f"in units of 2^{kilograms + 1} kg and 2^{metres + 1} m"
    assert right.run.reduced == ""
    assert run.motion.links == pytest.approx(right.motion.links, abs=1e-12)
    assert run.motion.cart / length == pytest.approx(right.motion.cart, abs=1e-12)
    assert run.motion.work / mass / length**2 == pytest.approx(right.motion.work, abs=1e-12)
    assert run.energy_drift() == pytest.approx(right.energy_drift(), rel=1e-3)


@pytest.mark.parametrize(("mass", "length"), [(1e-50, 1e-50), (1.0, 1e-75), (1e50, 1e50)])
def test_an_ordinary_link_beside_one_beyond_all_measure_is_refused(mass: float, length: float) -> None:
    links = [Rod(mass=1.0, length=1.0), Rod(mass=mass, length=length)]
    with pytest.raises(SceneError, match=r"m l² ranges from .* cannot square: choose other units"):
        simulate(Scene(gravity=9.81, pendulum=[Pendulum(links=links)]), 1e-3, start=State(np.ones(2), np.zeros(2)))


# ------------------------------------------------------------------------------------------------- far away

TURNS = 1_000_000


def sprung(stiffness: float) -> Scene:
    links = [Bob(mass=1.0, length=1.0), Bob(mass=0.7, length=0.6, stiffness=stiffness), Bob(mass=0.4, length=0.8)]
    return Scene(gravity=9.81, support=Cart(mass=2.0), pendulum=[Pendulum(links=links)])


@pytest.mark.parametrize(
    ("method", "stiffness"),
    [("DOP853", 0.0), ("DOP853", 3.0), ("taylor", 3.0), *usually([], [("taylor", 0.0)])],
)
def test_whole_turns_and_a_far_cart_cost_nothing(stiffness: float, method: str) -> None:
    """At the sprung joint two links turn together; 1e6 turns and 1e8 m leave 1e-9 of an angle."""
    if method == "taylor":
        pytest.importorskip("heyoka")
    angles, turns = np.array([0.9, -0.4, 0.6]), 2 * np.pi * TURNS * np.array([1, 1, -2])
    options = {"method": method, "tolerance": 1e-12, "output": 9}
    near = simulate(sprung(stiffness), 5.0, start=State(angles, np.zeros(3)), **options)
    far = simulate(sprung(stiffness), 5.0, start=State(angles + turns, np.zeros(3), 1e8), **options)
    assert far.run.reduced == "whole turns and the cart's travel so far removed"
    assert far.run.steps == pytest.approx(near.run.steps, abs=2)
    assert far.motion.links - turns == pytest.approx(near.motion.links, abs=1e-7)
    assert far.motion.cart - 1e8 == pytest.approx(near.motion.cart, abs=1e-7)


def test_a_spring_that_is_wound_up_stays_so() -> None:
    scene = sprung(0.01)
    start = State(np.array([0.9, -0.4 + 20 * np.pi, 0.6]), np.zeros(3), 1e3)
    moved = simulate(scene, 1.0, start=start, tolerance=1e-12, output=3, method="DOP853")
    plain = simulate(
        scene, 1.0, start=start, tolerance=1e-14, output=3, method="DOP853", load=lambda *_: AppliedForces()
    )
    assert (bool(moved.run.reduced), plain.run.reduced) == (True, "")
    assert moved.motion.links == pytest.approx(plain.motion.links, abs=1e-8)


@pytest.mark.parametrize("speed", [0.0, 10.0, 1e8])
def test_the_energy_of_coasting_hides_nothing_and_spoils_nothing(speed: float) -> None:
    start = State(np.array([1.0]), np.zeros(1), 0.0, speed)
    scene = chain(1.0, cart=Cart(mass=1.0))
    right, rough = (
        simulate(scene, 5.0, start=start, output=21, method=method, tolerance=tolerance).energy_drift()
        for method, tolerance in (("DOP853", 1e-12), ("RK23", 1e-3))
    )
    assert right < max(1e-10, 1e-15 * speed)
    assert rough > 1e-4


# ------------------------------------------------------------------------------------------------ maximal


def test_maximal_coordinates_are_refused_where_they_lose_a_link() -> None:
    def asked(ratio: float, form: str) -> Trajectory:
        links = [Bob(mass=1.0, length=1.0), Bob(mass=1.0, length=ratio)]
        scene, start = Scene(gravity=9.81, pendulum=[Pendulum(links=links)]), State(np.array([0.5, 0.8]), np.zeros(2))
        return simulate(scene, ratio**0.5, start=start, form=form, output=3, method="DOP853")

    with pytest.raises(SceneError, match="form maximal: cannot distinguish the ends of a link 1e-16 times as long"):
        asked(1e-16, "maximal")
    assert asked(1e-12, "maximal").motion.links == pytest.approx(asked(1e-12, "minimal").motion.links, abs=1e-8)


# ------------------------------------------------------------------------------------------- many at rest


@pytest.mark.parametrize("count", [300, 3000])
def test_pendula_at_rest_lend_no_tolerance_to_one_that_swings(count: int) -> None:
    """The same pendulum alone, among unequal ones at rest, and where all swing, which costs no step more."""
    pendula = [Pendulum(links=[Bob(mass=1.0, length=1.0 + 1e-9 * k)]) for k in range(count)]
    options = {"output": 6, "method": "DOP853"}

    def swung(pendula: list[Pendulum], angles: list[float]) -> Trajectory:
        start = State(np.array(angles), np.zeros(len(angles)))
        return simulate(Scene(gravity=9.81, pendulum=pendula), 5.0, start=start, **options)

    right = swung(pendula[:1], [1.0])
    idle, busy = swung(pendula, [1.0] + [0.0] * (count - 1)), swung(pendula, [1.0] * count)
    assert idle.motion.links[:, 0] == pytest.approx(right.motion.links[:, 0], abs=4e-9)
    assert busy.run.steps == right.run.steps


def test_the_share_of_what_moves() -> None:
    units = np.full(1000, 3.0)
    assert tolerance_factor(np.zeros(1000), units) == 1.0
    assert tolerance_factor(units * (np.arange(1000) % 2), units) == 1.0
    assert tolerance_factor(units * (np.arange(1000) < 40), units) == pytest.approx(0.4)
    assert tolerance_factor(units * (np.arange(1000) < 2), units) == pytest.approx(np.sqrt(0.032))
    assert tolerance_factor(units[:32] * (np.arange(32) < 1), units[:32]) == 1.0
