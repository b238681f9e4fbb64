"""The equilibrium under constant forces and the matrices about it: by SymPy, by the nonlinear equations, by hand."""

from __future__ import annotations

from math import asin, atan2, degrees, pi
from typing import Any

import mpmath as mp
import numpy as np
import pytest
import sympy as sp
from scipy.linalg import eig

from modal import Pendulum, SceneError, matrices, natural_modes
from modal.assembly import equilibrium_of, matrices_at, rig_of
from modal.modes import sensitivities
from modal.modes.dissipation import damping_ratios
from modal.scene import Scene, scene_from
from modal.scene.points import parse_point
from nonlinear import simulate
from nonlinear.dynamics import Generated, Minimal, jacobian_of
from nonlinear.dynamics.minimal import Recursion
from nonlinear.reduction import start_in_mode
from nonlinear.system import State, constants_of, entries_of, system_of
from nonlinear.verification import check

ROD = {"kind": "rod", "mass": 1.0, "length": 1.0}
BOB = {"kind": "bob", "mass": 0.5, "length": 0.8}
HELD = {"kind": "cart", "mass": 2.0, "stiffness": 15.0, "damping": 0.3}
FIXED = {"kind": "fixed"}
G = 9.81


def constant(on: str, amplitude: float, direction: str = "horizontal") -> dict[str, Any]:
    return {"kind": "constant", "on": on, "amplitude": amplitude, "direction": direction}


def pushed(*forces: dict[str, Any], support: dict[str, Any] = FIXED, **more: Any) -> Scene:
    pendulum = {"links": [ROD, BOB]} | more
    return scene_from({"gravity": G, "support": support, "pendulum": [pendulum], "force": [*forces]})


WIND = constant("pendulum[0].links[1]@0.3", 3.0)
LIFT = constant("pendulum[0].links[0]", 4.0, "vertical")
TURN = constant("pendulum[0].links[1]", 0.8, "torque")
ALONE = constant("pendulum[0].links[0]@0", -1.5, "torque")
ON_CART = constant("cart", -5.0)
SPRUNG = [ROD | {"stiffness": 2.0, "damping": 0.1}, BOB | {"stiffness": 1.0, "drag": 0.2}]
AIRY = [ROD | {"drag": 0.3}, BOB | {"drag": 0.1, "damping": 0.05}]
SCENES = {
    "wind": pushed(WIND),
    "all": pushed(WIND, LIFT, TURN, ALONE, ON_CART, support=HELD, count=2),
    "one copy": pushed(constant("pendulum[0].copies[1].links[1]", 3.0), support=HELD, count=3),
    "springs": pushed(WIND, LIFT, TURN, links=SPRUNG),
    "drag": pushed(WIND, LIFT, TURN, links=AIRY, support=HELD),
    "up": pushed(WIND, TURN, equilibrium=["up", "down"]),
    "up on springs": pushed(
        WIND, links=[ROD | {"stiffness": 30.0}, BOB | {"stiffness": 9.0}], equilibrium=["up", "up"]
    ),
    "balanced": pushed(WIND, constant("cart", -3.0), support=HELD | {"stiffness": 0.0}),
    "balloon": pushed(WIND, constant("pendulum[0].links[1]", 20.0, "vertical")),
}


def lagrangian(scene: Scene) -> tuple[list[Any], list[Any], Any, Any, Any]:
    """Coordinates, rates, T, V with the work of constant forces, and R, written out from positions."""
    on_cart, q, v = scene.support.kind == "cart", [], []
    x = sp.Symbol("x") if on_cart else sp.S.Zero
    if on_cart:
        q, v = [x], [sp.Symbol("x_dot")]
    T = V = R = sp.S.Zero
    if on_cart:
        T += scene.support.mass * v[0] ** 2 / 2
        V += scene.support.stiffness * x**2 / 2
        R += scene.support.damping * v[0] ** 2 / 2
    for p, pendulum in enumerate(scene.pendulum):
        links = [(number, link) for number, link in enumerate(pendulum.links) for _ in range(link.count)]
        for copy in range(pendulum.count):
            joint, above, before = sp.Matrix([x, 0]), sp.S.Zero, sp.S.Zero
            for (number, link), way in zip(links, pendulum.ways, strict=True):
                theta, rate = sp.symbols(f"q{len(q)} v{len(q)}")
                q, v = [*q, theta], [*v, rate]
                along = sp.Matrix([sp.sin(theta), sp.cos(theta)])  # along the rail, down
                centre = joint + link.centre * along
                velocity = centre.jacobian(q) * sp.Matrix(v)
                T += link.mass * velocity.dot(velocity) / 2 + link.inertia * rate**2 / 2
                V -= link.mass * G * centre[1]
                R += link.drag * velocity.dot(velocity) / 2
                bent = theta - (sp.pi if way == "up" else 0)
                V += link.stiffness * (bent - above) ** 2 / 2
                R += link.damping * (rate - before) ** 2 / 2
                for force in scene.force:
                    point = parse_point(force.on)
                    if point is None or (point.pendulum, point.link) != (p, number) or point.copy not in {None, copy}:
                        continue
                    at = centre if point.below is None else joint + point.below * along
                    if force.direction == "torque":
                        V -= force.amplitude * (theta - (above if point.below is None else 0))
                    else:
                        V -= force.amplitude * (at[0] if force.direction == "horizontal" else -at[1])
                joint, above, before = joint + link.length * along, bent, rate
    for force in scene.force:
        V -= force.amplitude * x if force.on == "cart" else 0
    return q, v, T, V, R


def rest_of(scene: Scene) -> np.ndarray:
    equilibrium = equilibrium_of(scene)
    assert equilibrium is not None
    return np.append([equilibrium.cart] if scene.support.kind == "cart" else [], equilibrium.rest.angle)


@pytest.mark.parametrize("name", SCENES)
def test_matrices_are_second_derivatives_of_the_lagrangian(name: str) -> None:
    scene = SCENES[name]
    q, v, T, V, R = lagrangian(scene)
    rest = dict(zip(q, rest_of(scene), strict=True))
    slope = np.array([sp.diff(V, coordinate).subs(rest) for coordinate in q], dtype=float)
    assert np.abs(slope).max() < 1e-12
    model = matrices(scene)
    for matrix, function, by in ((model.M, T, v), (model.K, V, q), (model.D, R, v)):
        exact = np.array(sp.hessian(function, by).subs(rest), dtype=float)
        assert matrix == pytest.approx(exact, abs=1e-12)


@pytest.mark.parametrize("name", SCENES)
def test_the_nonlinear_equations_rest_there_and_have_these_slopes(name: str) -> None:
    """Complex steps of the minimal form, and the Jacobian of its tape, against −M⁻¹K and −M⁻¹D."""
    scene, model = SCENES[name], matrices(SCENES[name])
    system, rest = system_of(scene), rest_of(scene)
    first, half = int(scene.support.kind == "cart"), len(rest)
    equations = Minimal(system, tuple(map(Recursion, system.groups)))

    def begin(z: np.ndarray) -> np.ndarray:
        cart, rate = (z[0], z[half]) if first else (0.0, 0.0)
        return equations.begin(State(z[first:half], z[half + first :], cart, rate))

    y = begin(np.append(rest, np.zeros(half)))
    order = np.array([begin(unit) for unit in np.eye(2 * half)]).T  # y = order z, perhaps with a place for work
    back = np.linalg.pinv(order)
    assert np.abs(equations.derivative(0.0, y)).max() < 1e-11
    steps = [equations.derivative(0.0, y + 1e-30j * unit).imag / 1e-30 for unit in np.eye(len(y))]
    complex_steps = back @ np.stack(steps, axis=1) @ order
    exact = -np.linalg.solve(model.M, np.hstack((model.K, model.D)))
    assert complex_steps[half:] == pytest.approx(exact, abs=1e-10 * np.abs(exact).max())
    written = Generated(system)
    module, rows, columns = jacobian_of(written.form)
    numbers = written.form.numbers(entries_of(system), constants_of(system))
    u = written.inputs_at(0.0, y.tolist()) if written.inputs_at else ()
    J = np.zeros((len(y), len(y)))
    J[rows, columns] = module.function("jacobian", module.constants(numbers))(y.tolist(), u)[len(y) :]
    assert (back @ J @ order)[half:] == pytest.approx(exact, abs=1e-10 * np.abs(exact).max())


@pytest.mark.parametrize("name", SCENES)
def test_modes_are_those_of_the_matrices(name: str) -> None:
    modes, model = natural_modes(SCENES[name]), matrices(SCENES[name])
    n = len(model.M)
    state = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(model.M, np.hstack((model.K, model.D)))]])
    values = np.abs(eig(state)[0])
    for omega, bound in zip(modes.omega, modes.error, strict=True):
        apart = 1e-7 if omega == 0 else (bound + 1e-11) * omega
        assert np.abs(values - omega).min() < apart
    assert "about the equilibrium under constant forces" in modes.route
    assert modes.residual.max() < 1e-12
    for number in range(len(modes)):
        for copy in range(int(modes.multiplicity[number])):
            shape = modes.shape(number, copy)
            assert shape.kinetic_energy_share.sum() <= 1 + 1e-12
            if not modes.on_cart:
                assert shape.kinetic_energy_share.sum() == pytest.approx(1.0)


def exact_frequencies(scene: Scene) -> list[Any]:
    """ω (rad/s) of a chain on a fixed support without springs and torques, in 50 digits."""
    links = [link for link in scene.pendulum[0].links for _ in range(link.count)]
    n, mass = len(links), [mp.mpf(link.mass) for link in links]
    b = [mass[i] * links[i].centre + links[i].length * sum(mass[i + 1 :]) for i in range(n)]
    moments = [mass[i] * mp.mpf(links[i].centre) ** 2 + links[i].inertia for i in range(n)]
    moments = [moments[i] + mp.mpf(links[i].length) ** 2 * sum(mass[i + 1 :]) for i in range(n)]
    along, down = [mp.mpf(0)] * n, [mp.mpf(scene.gravity) * below for below in b]
    for force in scene.force:
        point = parse_point(force.on)
        assert point is not None
        for i in range(point.link + 1):
            arm = mp.mpf(links[i].length if i < point.link else links[i].centre)
            if force.direction == "horizontal":
                along[i] += force.amplitude * arm
            else:
                down[i] -= force.amplitude * arm
    angle = [mp.atan2(x, z) for x, z in zip(along, down, strict=True)]
    M, K = mp.matrix(n), mp.matrix(n)
    for i in range(n):
        K[i, i] = mp.hypot(along[i], down[i])
        for j in range(n):
            moment = moments[i] if i == j else b[max(i, j)] * links[min(i, j)].length
            M[i, j] = moment * mp.cos(angle[i] - angle[j])
    return sorted(mp.sqrt(mp.re(square)) for square in mp.eig(M**-1 * K)[0])


def test_errors_are_within_their_bounds() -> None:
    """Of random chains, and near the balance of weight and lift, where rounding turns the links."""
    rng, scenes = np.random.default_rng(1), []
    for _ in range(12):
        n = int(rng.integers(1, 6))
        sizes = 10 ** rng.uniform(-1.5, 1.5, (n, 2))
        links = [{"kind": "bob", "mass": mass, "length": length} for mass, length in sizes.tolist()]
        on = [f"pendulum[0].links[{link}]" for link in rng.integers(n, size=3)]
        sides, lift = rng.normal(0.0, 20.0, 2).tolist(), float(rng.normal())
        forces = [constant(place, side) for place, side in zip(on, sides, strict=False)]
        scenes.append(pushed(*forces, constant(on[2], lift, "vertical"), links=links))
    for left in (1e-3, 1e-6, 1e-9):
        lift = constant("pendulum[0].links[1]", 0.5 * G * (1 - left), "vertical")
        scenes.append(pushed(lift, constant("pendulum[0].links[1]", 0.35 * G * left)))
    with mp.workdps(50):
        for scene in scenes:
            modes = natural_modes(scene)
            for omega, bound, exact in zip(modes.omega, modes.error, exact_frequencies(scene), strict=True):
                assert abs(mp.mpf(float(omega)) / exact - 1) <= bound


def test_effective_masses_add_up() -> None:
    """Of undamped modes along the rail: to pᵀM⁻¹p on a fixed support, with the momentum p at unit velocity."""
    modes = natural_modes(SCENES["wind"])
    p = rig_of(modes.scene).blocks[0]
    moment = (p.across * p.b)[:, 0]
    assert modes.effective_mass.sum() == pytest.approx(float(moment @ np.linalg.solve(modes.matrices.M, moment)))
    held = natural_modes(SCENES["all"].conservative)
    assert held.effective_mass.sum() == pytest.approx(held.rig.total_mass)


def test_one_link_by_hand() -> None:
    """F l cos θ = m g l sin θ, and ω² = √(g² + (F/m)²)/l."""
    scene = pushed(constant("pendulum[0].links[0]", 2.0), links=[BOB])
    modes = natural_modes(scene)
    assert modes.rig.rest_angles[0] == pytest.approx(atan2(2.0, 0.5 * G))
    assert modes.omega[0] ** 2 == pytest.approx(np.hypot(G, 2.0 / 0.5) / 0.8)
    assert "The equilibrium under the constant forces: 22.2°." in modes.notes
    torque = natural_modes(pushed(constant("pendulum[0].links[0]", 1.0, "torque"), links=[BOB]))
    assert torque.rig.rest_angles[0] == pytest.approx(asin(1.0 / (0.5 * G * 0.8)))


def test_links_go_to_the_branch_of_their_direction() -> None:
    wind = constant("pendulum[0].links[0]", 3.0)
    hanging, standing = (pushed(wind, links=[ROD], equilibrium=[way]) for way in ("down", "up"))
    down, up = (natural_modes(example).rig.rest_angles[0] for example in (hanging, standing))
    assert up - down == pytest.approx(pi)
    assert 0 < down < pi / 2
    assert natural_modes(standing).growth_rate[0] > 0
    assert natural_modes(SCENES["balloon"]).rig.rest_angles[1] > pi / 2
    assert np.isnan(natural_modes(SCENES["balloon"]).growth_rate).all()


@pytest.mark.parametrize(
    ("scene", "message"),
    [
        (pushed(WIND, support=HELD | {"stiffness": 0.0}), "the constant forces along the rail add up to 3 N"),
        (pushed(TURN | {"amplitude": 9.0}), r"pendulum\[0\].links\[1\]: a constant torque of 9 N m turns it over"),
        (
            pushed(constant("pendulum[0].copies[1].links[1]", 0.5 * G, "vertical"), count=2),
            r"pendulum\[0\].copies\[1\].links\[1\]: gravity and the constant forces on it and below it cancel",
        ),
        (
            pushed(constant("pendulum[0].links[1]", 30.0, "vertical"), links=SPRUNG),
            r"pendulum\[0\]: its equilibrium under the constant forces is unstable",
        ),
        (pushed(TURN | {"amplitude": 30.0}, links=[ROD | {"stiffness": 2.0}, BOB]), "% of the constant forces"),
    ],
)  # fmt: skip
def test_where_there_is_no_equilibrium_that_is_told(scene: Scene, message: str) -> None:
    for asked in (natural_modes, matrices):
        with pytest.raises(SceneError, match=message):
            asked(scene)
    simulate(scene.replace(pendulum=tuple(started(pendulum) for pendulum in scene.pendulum)), 0.1)


def started(pendulum: Pendulum) -> Pendulum:
    return scene_from(
        {"gravity": G, "pendulum": [{"links": [ROD, BOB], "start": {"angles_deg": [1.0, 2.0]}}]}
    ).pendulum[0].replace(links=pendulum.links, count=pendulum.count)  # fmt: skip


def test_sensitivities_are_refused_in_a_sentence() -> None:
    with pytest.raises(SceneError, match="a derivative of modes is computed about links that hang or stand straight"):
        sensitivities(natural_modes(SCENES["wind"]), 0)


def test_no_constant_force_changes_nothing() -> None:
    plain, idle = pushed(), pushed(WIND | {"amplitude": 0.0})
    assert np.array_equal(matrices(plain).K, matrices(idle).K)
    assert natural_modes(plain).omega.tolist() == natural_modes(idle).omega.tolist()


def test_small_motions_have_the_frequencies_of_the_table() -> None:
    scene = SCENES["all"].conservative
    (row,) = check(scene, [2], [0.5, 1.0]).rows
    for run in row.measurements:
        assert abs(run.shift) < 1e-4
        assert run.outside < 3e-3


def test_a_run_without_a_start_begins_about_the_equilibrium() -> None:
    scene = SCENES["wind"]
    modes = natural_modes(scene)
    state = start_in_mode(scene, modes, 0, amplitude=1e-6)
    assert np.abs(state.links - modes.rig.rest_angles).max() == pytest.approx(1e-6)
    run = simulate(scene, 3.0, start=start_in_mode(scene, modes, 0, amplitude=1e-4), tolerance=1e-12, output=301)
    swing = run.motion.links - modes.rig.rest_angles
    expected = 1e-4 * np.outer(np.cos(modes.omega[0] * run.times), modes.shape(0).angles)
    assert swing == pytest.approx(expected, abs=1e-7)
    assert degrees(np.abs(swing).max()) < 0.006


def test_drag_and_friction_of_a_leaning_mode() -> None:
    """The decay of a run with quadratic drag, which acts along the path of each centre."""
    scene = pushed(constant("pendulum[0].links[0]", 8.0), links=[BOB | {"quadratic_drag": 0.3}])
    modes, amplitude = natural_modes(scene), 0.05
    ratio = damping_ratios(modes, amplitude)[1]
    # a bob on its circle: torque d l³ |θ'| θ', so that ζ = 4 d l a / 3π m wherever it rests
    assert ratio == pytest.approx(4 * 0.3 * 0.8 * amplitude / (3 * pi * 0.5))


def test_a_hoist_under_constant_forces_has_no_model_along_it() -> None:
    rope = BOB | {"hoist": {"to": 1.2, "duration": 3.0}}
    scene = pushed(constant("pendulum[0].links[0]", 3.0), links=[rope])
    with pytest.raises(SceneError, match="along a hoist the equilibrium under constant forces would change"):
        matrices_at(scene, 1.0)
    turned = natural_modes(scene.at(3.0)).rig.rest_angles
    assert turned == pytest.approx([atan2(3.0, 0.5 * G)])
