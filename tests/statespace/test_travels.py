"""A travel of a crane as it is and shaped: histories by other routes, residuals of the hoist, and the picture."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from amounts import usually
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from seen import flaws, hidden_curves

import modal
from modal import Bob, Cart, Pendulum, Scene, load
from modal.errors import SceneError
from modal.plotting import travel_figure
from modal.plotting.style import MARKED, theme
from modal.scene import Moved, RecordMotion
from modal.statespace import shaper_for
from modal.statespace.hoisting import Travel, travel_residuals
from modal.statespace.travels import ShapedTravel, shaped_travel
from multipendula.cli import main
from nonlinear.simulation import simulate
from nonlinear.system import state_at_rest


def crane(damping: float = 0.0, **cart: float) -> Scene:
    pendulum = Pendulum(links=[Bob(mass=2.0, length=1.5, damping=damping)])
    return Scene(gravity=9.81, support=Cart(mass=5.0, **cart), pendulum=[pendulum])


def test_a_prescribed_travel_swings_the_load_as_its_equation_says() -> None:
    """θ'' + c θ'/(m l²) + (g/l) θ = −x''/l, by another integrator."""
    scene, l, c = crane(damping=0.3), 1.5, 0.3 / (2.0 * 1.5**2)
    shaper = shaper_for(scene, kind="zvd")
    swing = shaped_travel(scene, shaper, 2.0, 1.7)
    travel = Travel(2.0, 0.0, 1.7)
    for row, train in enumerate(([(0.0, 1.0)], list(zip(shaper.times, shaper.amplitudes, strict=True)))):

        def slope(t: float, y: np.ndarray, train: list = train) -> list[float]:
            pushed = sum(a * float(travel.motion(np.array([t - at]))[2, 0]) for at, a in train)
            return [y[1], -(9.81 / l) * y[0] - c * y[1] - pushed / l]

        other = solve_ivp(
            slope, (0, swing.times[-1]), [0, 0], t_eval=swing.times, rtol=1e-10, atol=1e-12, max_step=0.05
        )
        assert swing.angles[row, :, 0] == pytest.approx(other.y[0], abs=1e-7)
    late = swing.times > swing.over[0]
    assert np.abs(swing.angles[0, late]).max() <= swing.residual[0] * (1 + 1e-9)
    assert swing.residual[1] < 1e-9


def test_a_small_travel_is_that_of_the_nonlinear_equations() -> None:
    scene = load("crane-hook")
    swing = shaped_travel(scene, shaper_for(scene, 2), 0.02, 9.0)
    for row in (0, 1):
        motion = RecordMotion(time_s=swing.times.tolist(), displacement_m=swing.command[row].tolist())
        moved = scene.replace(support=Moved(motion=motion), pendulum=[scene.pendulum[0].replace(start=None)])
        run = simulate(moved, float(swing.times[-1]), start=state_at_rest(moved, [0.0, 0.0]))
        expected = CubicSpline(swing.times, swing.angles[row])(run.times)
        assert run.motion.links == pytest.approx(expected, abs=2e-4 * np.abs(expected).max())


def test_a_force_moves_the_cart_so_far_and_no_further() -> None:
    """No outer force but that: the centre of mass is where the travel is, F/(total mass) is its acceleration."""
    scene = crane()
    swing = shaped_travel(scene, shaper_for(scene, drive="cart_force"), 3.0, 4.0, "cart_force")
    x, theta = swing.moved, swing.angles[..., 0]
    centre = x + 2.0 * 1.5 * theta / 7.0
    assert centre[0] == pytest.approx(Travel(3.0, 0.0, 4.0).motion(swing.times)[0], abs=1e-8)
    assert swing.command[0] == pytest.approx(7.0 * Travel(3.0, 0.0, 4.0).motion(swing.times)[2], abs=1e-6)
    assert swing.unit == "N"
    assert swing.residual[1] < 1e-8 < 0.01 < swing.residual[0]


def test_a_cart_on_a_spring_and_a_ship_at_its_moorings_are_held_where_they_went() -> None:
    sprung = crane(stiffness=30.0)
    swing = shaped_travel(sprung, shaper_for(sprung, drive="cart_force"), 0.5, drive="cart_force")
    assert swing.command[:, -1] == pytest.approx(30.0 * 0.5)
    ship = load("ship-crane")
    swing = shaped_travel(ship, shaper_for(ship, drive="ship_sway_force"), 2.0, drive="ship_sway_force")
    assert swing.command[:, -1] == pytest.approx(2.0 / np.linalg.inv(modal.matrices(ship).K)[0, 0])
    assert swing.moved[:, -1] == pytest.approx(2.0, rel=1e-3)


@pytest.fixture(scope="module")
def hoisted() -> ShapedTravel:
    scene = load("hoisting-crane")
    return shaped_travel(scene, shaper_for(scene.at(0.0)), 10.0)


def test_along_a_hoist_the_residuals_are_those_of_the_hoist(hoisted: ShapedTravel) -> None:
    expected = travel_residuals(hoisted.scene, Travel.along(hoisted.scene, 10.0))
    assert hoisted.residual == pytest.approx([expected[0].angle, expected[1].angle], rel=1e-6)
    assert hoisted.over == pytest.approx([8.0, 8.0 + shaper_for(hoisted.scene.at(0.0)).duration])


@pytest.mark.parametrize("name", usually(["light"], ["light", "dark"]))
def test_the_picture_marks_the_residual_swing_of_both(hoisted: ShapedTravel, name: str) -> None:
    with theme(name):
        figure = travel_figure(hoisted)
    assert flaws(figure) == []
    command, rope, *swings = figure.axes
    assert rope.get_ylabel() == "length (m)"
    assert command.get_ylabel() == "position (m)"
    for row, axis in enumerate(swings):
        bounds = [line for line in axis.lines if line.get_linestyle() == MARKED and len(set(line.get_ydata())) == 1]
        assert sorted(line.get_ydata()[0] for line in bounds) == pytest.approx(
            np.degrees([-hoisted.residual[row], hoisted.residual[row]])
        )
        assert {line.get_xdata()[0] for line in bounds} == {hoisted.over[row]}
        assert axis.texts[0].get_text() == f"residual swing {np.degrees(hoisted.residual[row]):.3g}°"
    assert hidden_curves(figure) == []


def test_any_crane_is_drawn_before_and_after(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for scene, distance in usually(
        [("ship-crane", "2")], [("crane-hook", "20"), ("ship-crane", "2"), ("tower", "0.1")]
    ):
        path = tmp_path / f"{scene}.png"
        assert main(["shaper", scene, "--travel", distance, "-o", str(path)]) == 0
        assert path.read_bytes().startswith(b"\x89PNG")
        printed = capsys.readouterr().out
        assert f"# a travel of {distance} m shaped: residual swing" in printed
        assert "time_s,amplitude\n0.0," in printed


def test_a_picture_needs_a_travel_and_a_travel_a_length(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert main(["shaper", "crane-hook", "-o", str(tmp_path / "a.png")]) == 2
    assert "--picture: needs --travel METRES" in capsys.readouterr().err
    assert main(["shaper", "crane-hook", "--over", "3"]) == 2
    assert "--over: needs --travel METRES" in capsys.readouterr().err
    scene = crane()
    with pytest.raises(SceneError, match="distance"):
        shaped_travel(scene, shaper_for(scene), -1.0)
