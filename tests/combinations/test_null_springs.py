"""A spring of stiffness 0 makes a structure of any scene and changes nothing: every verb must say what it says of it.

The scenes with such a spring go by the equations of structures, the plain ones by those of one cart or support.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from modal import Bob, Cart, Fixed, Pendulum, Rod, Scene, load
from modal.errors import SceneError
from modal.scene import Ground, Moved, SineForce, SineMotion, Spring
from modal.scene.parameters import Variation, vary
from modal.scene.supports import Heave, ModalSupport, Swing
from modal.vibration import parametric_stability
from nonlinear import initial_state, simulate
from nonlinear.accuracy.work_precision import late
from nonlinear.chaos import lyapunov_exponent
from nonlinear.dynamics import is_unstable_equilibrium
from nonlinear.ensembles import find_section, find_strobes
from nonlinear.identification import fit, read_recording
from nonlinear.orbits import Flow, follow_forced_orbits, forced_orbit, mode_orbit, nonlinear_mode
from nonlinear.orbits.report import _notes
from nonlinear.postprocessing.summary import text as run_text
from nonlinear.reduction import defect_error, simulate_truncated, superpose
from nonlinear.system import ends_may_meet, state_at_rest, system_of
from nonlinear.verification import check, compare

CART = Scene(
    gravity=9.81,
    support=Cart(mass=3.0),
    pendulum=[
        Pendulum(
            count=2, links=[Bob(mass=1.0, length=1.0), Bob(mass=0.7, length=0.8)], start={"angles_deg": [20.0, 10.0]}
        )
    ],
)
PUSHED = Scene(
    gravity=9.81,
    support=Cart(mass=3.0, damping=0.3),
    pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0, damping=0.1)])],
    force=[SineForce(on="cart", amplitude=2.0, frequency_hz=0.6)],
)
HELD = PUSHED.replace(support=Cart(mass=3.0, damping=0.3, stiffness=20.0))
SHAKE = SineMotion(amplitude=0.05, frequency_hz=0.6)
SHAKEN = Scene(
    gravity=9.81,
    support=Moved(motion=SHAKE),
    pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0, damping=0.1, drag=0.1)])],
)


def nulled(scene: Scene) -> Scene:
    """The same scene with a spring of stiffness 0."""
    end = "cart" if isinstance(scene.support, Cart) else "pendulum[0].links[0]"
    spring = Spring(between=("ground", end), stiffness=0.0)
    if isinstance(scene.support, Moved):
        scene = scene.replace(support=Fixed(), ground=Ground(motion=scene.support.motion))
    return scene.replace(spring=(spring,))


def both(scene: Scene, answer: Callable[[Scene], Any]) -> tuple[Any, Any]:
    """What is said of a scene, and of the same with a null spring, which is a structure."""
    with_spring = nulled(scene)
    assert with_spring.is_structured
    assert not scene.is_structured
    return answer(scene), answer(with_spring)


def upper(values: Any) -> Any:
    """Of multipliers those above or on the real axis, in order."""
    return np.sort_complex(values[values.imag >= 0])


@pytest.mark.parametrize("number", [2, 3])
def test_orbits_of_a_mode(number: int) -> None:
    plain, null = both(CART, lambda scene: mode_orbit(scene, number, 0.3))
    assert plain.symmetric
    assert not null.symmetric
    assert null.omega == pytest.approx(plain.omega, rel=1e-12)
    assert null.energy == pytest.approx(plain.energy, rel=1e-10)
    assert null.floquet.neutral == plain.floquet.neutral == 4
    np.testing.assert_allclose(upper(null.floquet.all), upper(plain.floquet.all), atol=1e-8)


@pytest.mark.parametrize("scene", [PUSHED, HELD, SHAKEN], ids=["free", "held", "moved"])
def test_forced_orbits(scene: Scene) -> None:
    plain, null = both(scene, forced_orbit)
    for name in ("amplitude", "phase", "fed"):
        assert getattr(null, name) == pytest.approx(getattr(plain, name), rel=1e-10)
    assert null.floquet.neutral == plain.floquet.neutral
    np.testing.assert_allclose(null.floquet.all, plain.floquet.all, atol=1e-10)


def test_forced_orbits_along_a_number() -> None:
    variation = Variation("force[0].amplitude", (1.0, 1.1))
    (plain,), (null,) = both(HELD, lambda scene: follow_forced_orbits(scene, variation))
    np.testing.assert_allclose(null.amplitude, plain.amplitude, rtol=1e-9)


def test_exponents_and_sections() -> None:
    plain, null = both(CART, lambda scene: lyapunov_exponent(scene, 7.0, members=2).value)
    assert null == pytest.approx(plain, rel=1e-10)
    plain, null = both(CART, lambda scene: find_section(scene, 4.0, members=2, workers=1, engine="numpy"))
    assert null.to_dict().keys() == plain.to_dict().keys()
    assert null.energy == pytest.approx(plain.energy, rel=1e-13)
    for point, other in zip(null.points(), plain.points(), strict=True):
        np.testing.assert_allclose(point, other, rtol=1e-8, atol=1e-8)
    options: dict[str, Any] = {"members": 2, "settle": 2.0, "workers": 1, "engine": "numpy"}
    plain, null = both(HELD, lambda scene: find_strobes(scene, 8.0, **options))
    np.testing.assert_allclose(null.states[0], plain.states[0], atol=1e-8)


def test_floquet_multipliers() -> None:
    links = [Bob(mass=1.0, length=1.0, damping=0.02), Rod(mass=0.5, length=0.7)]
    moved = Moved(motion=SineMotion(direction="vertical", amplitude=0.05, frequency_hz=1.3))
    scene = Scene(gravity=9.81, support=moved, pendulum=[Pendulum(links=links, count=2)])
    plain, null = both(scene, parametric_stability)
    np.testing.assert_allclose(upper(null.multipliers), upper(plain.multipliers), atol=1e-13)
    assert null.kind == plain.kind


def test_closed_form_and_few_modes() -> None:
    times = np.linspace(0.0, 3.0, 31)
    for corrected in (False, True):
        plain, null = both(CART, lambda scene, c=corrected: superpose(scene, initial_state(scene), corrected=c))
        if not corrected:  # κ of modes of a cart under springs is unknown
            np.testing.assert_allclose(null(times).supports[:, 0], plain(times).cart, atol=1e-14)
            np.testing.assert_allclose(null(times).links, plain(times).links, atol=1e-14)
            assert defect_error(null, 3.0).error == pytest.approx(defect_error(plain, 3.0).error, rel=1e-9)
    plain, null = both(CART, lambda scene: simulate_truncated(scene, 3.0, 3, output=31))
    np.testing.assert_allclose(null.trajectory.motion.links, plain.trajectory.motion.links, atol=1e-13)
    np.testing.assert_allclose(null.trajectory.motion.supports[:, 0], plain.trajectory.motion.cart, atol=1e-13)
    assert null.error == pytest.approx(plain.error, rel=1e-6)


def test_checks_and_comparisons() -> None:
    plain, null = both(CART, lambda scene: check(scene, [2], [5.0], periods=20).rows[0])
    assert null.measurements[0].omega == pytest.approx(plain.measurements[0].omega, rel=1e-9)
    assert null.at_rest[0] == pytest.approx(plain.at_rest[0], rel=1e-5)
    plain, null = both(CART, lambda scene: compare(simulate(scene, 5.0, output=201)))
    assert [row.share for row in null.rows] == pytest.approx([row.share for row in plain.rows], abs=1e-9)
    runs = both(CART, lambda scene: simulate(scene, 2.0, output=81))
    assert late(runs[1].motion, runs[1]) == 0.0


def test_fits(tmp_path: Path) -> None:
    run, rng = simulate(CART, 0.8, output=31), np.random.default_rng(0)
    data = np.column_stack((run.motion.cart, run.motion.links))
    data += 1e-3 * rng.standard_normal(data.shape)
    names = ["x_m", *(f"theta_{p}_{i}_rad" for p in (1, 2) for i in (1, 2))]
    rows, header = np.column_stack((run.times, data)), ",".join(["time_s", *names])
    np.savetxt(tmp_path / "data.csv", rows, delimiter=",", header=header, comments="")

    def fitted(scene: Scene) -> Any:
        wrong = scene.replace(support=Cart(mass=2.7))
        return fit(
            wrong, read_recording(scene, [tmp_path / "data.csv"]), ["support.mass", "pendulum[0].links[0].length"]
        )

    plain, null = both(CART, fitted)
    np.testing.assert_allclose(null.values, plain.values, rtol=1e-9)
    np.testing.assert_allclose(null.stds, plain.stds, rtol=1e-6)


def test_unstable_starts() -> None:
    for angles in ([0.0] * 4, [180.0, 0.0, 0.0, 0.0], [10.0, 0.0, 0.0, 0.0]):
        plain, null = both(
            CART, lambda scene, a=angles: is_unstable_equilibrium(system_of(scene), state_at_rest(scene, a))
        )
        assert null == plain == (180.0 in angles)


def test_a_mode_beyond_a_spring_whose_ends_meet_ends_there() -> None:
    bob = Pendulum(links=[Bob(mass=1.0, length=1.0)])
    spring = Spring(between=("pendulum[0].links[0]@0.5", "pendulum[1].links[0]@0.5"), stiffness=5.0)
    scene = Scene(gravity=9.81, pendulum=[bob, bob.replace(position=(0.1, 0.0))], spring=[spring])
    branch = nonlinear_mode(scene, 2, 0.3, longest=0.5, tolerance=1e-9, locate=False)
    assert not branch.complete
    assert np.sin(branch.orbits[-1].amplitude) == pytest.approx(0.1, rel=1e-3)


# ----------------------------------------------------------------------------------------- where nothing plain is alike

UNLIKE = load(Path(__file__).parent / "scenes" / "structure.toml")
"""A swing and a board, on which left and right differ."""


def test_an_orbit_on_a_board_closes() -> None:
    orbit = mode_orbit(UNLIKE, 2, 0.3)
    run = simulate(UNLIKE.conservative, orbit.period, start=orbit.state, output=3, tolerance=1e-12)
    last = run.motion[-1]
    for closed, other in (
        (last.links, orbit.state.links),
        (last.supports, orbit.state.supports),
        (last.link_rates, 0.0),
    ):
        np.testing.assert_allclose(closed, other, atol=1e-9)
    middle = run.motion[1]
    assert np.abs(middle.link_rates).max() < 1e-9
    assert np.abs(middle.links + orbit.state.links).max() > 1e-4  # at rest as well, but no mirror image


def test_all_modes_are_the_whole_scene_and_closed_form_is_its_limit() -> None:
    start, whole = initial_state(UNLIKE), simulate(UNLIKE, 2.0, output=11)
    truncated = simulate_truncated(UNLIKE, 2.0, 5, output=11)
    np.testing.assert_allclose(truncated.trajectory.motion.supports, whole.motion.supports, atol=1e-8)
    small = vary(UNLIKE, {"pendulum[*].start.angles_deg[0]": 0.01, "pendulum[0].start.angles_deg[1]": 0.01})
    start = initial_state(small)
    linear, true = superpose(small, start, corrected=False), simulate(small, 2.0, output=11)
    missed = np.abs(linear(true.times).links - true.motion.links).max()
    assert 0 < missed < defect_error(linear, 2.0).bounds[-1] < 1e-7


def test_multipliers_of_a_swing_are_those_of_its_flow() -> None:
    links = [Bob(mass=1.0, length=1.0, damping=0.02), Rod(mass=0.5, length=0.7)]
    ground = Ground(motion=SineMotion(direction="vertical", amplitude=0.05, frequency_hz=1.3))
    pendulum = [Pendulum(links=links, count=2)]
    scene = Scene(gravity=9.81, ground=ground, support=Swing(mass=2.0, length=0.5), pendulum=pendulum)
    passed = Flow(system_of(scene))(np.zeros(10), np.eye(10), 1 / 1.3)
    sizes = np.sort(np.abs(np.linalg.eigvals(passed.V)))
    np.testing.assert_allclose(np.sort(np.abs(parametric_stability(scene).multipliers)), sizes, atol=1e-9)
    with pytest.raises(SceneError, match="shakes the weights that its spring carries"):
        parametric_stability(scene.replace(support=Heave(mass=2.0, stiffness=100.0)))


def test_a_fit_reads_coordinates_of_supports(tmp_path: Path) -> None:
    run = simulate(UNLIKE, 2.0, output=101)
    rows = np.column_stack((run.times, run.motion.supports, run.motion.links))
    rows[:, 1:] += 1e-4 * np.random.default_rng(1).standard_normal((101, 5))
    rows[:, 2] = np.degrees(rows[:, 2])
    header = "time_s,left_m,board_deg,theta_1_1_rad,theta_1_2_rad,theta_2_1_rad"
    np.savetxt(tmp_path / "data.csv", rows, delimiter=",", header=header, comments="")
    wrong = vary(UNLIKE, {"support.left.mass": 2.1, "support.board.stiffness": 5.2})
    record = read_recording(UNLIKE, [tmp_path / "data.csv"])
    assert [(sensor.name, sensor.unit) for sensor in record.sensors][:2] == [("board", "rad"), ("left", "m")]
    fitted = fit(wrong, record, ["support.left.mass", "support.board.stiffness"])
    assert np.all(np.abs(fitted.values - [2.0, 5.0]) < 4 * fitted.stds)
    assert np.all(fitted.stds < 0.01)


def test_both_ends_of_a_spring_meet_where_pendula_bring_them_together() -> None:
    first, second = (textbook := load("two-bobs")).pendulum
    bobs, apart = (textbook.replace(pendulum=[first, second.replace(position=(d, 0.0))]) for d in (0.4, 2.1))
    assert ends_may_meet(system_of(bobs))
    assert not ends_may_meet(system_of(apart))
    last = SimpleNamespace(scene=bobs, amplitude=np.radians(23.578), omega=3.44926, cycles=0)
    branch = SimpleNamespace(orbits=[last], special=(), is_forced=False, complete=False, variation=None)
    assert "may pass through zero length" in " ".join(_notes(branch)).replace("\n", " ")  # type: ignore[arg-type]
    assert not ends_may_meet(system_of(load("two-swings")))
    antiphase = vary(bobs, {"pendulum[0].start.angles_deg[0]": -30.0, "pendulum[1].start.angles_deg[0]": 30.0})
    run = simulate(antiphase, 20.0)
    assert run.run.method != "taylor"
    assert run.energy_drift() < 1e-6


def test_a_force_starts_a_scene_at_rest_and_its_summary_tells_angles_in_degrees() -> None:
    ship = load("ship-crane")
    run = simulate(ship.replace(support=ship.support.replace(start=None)), 20.0, output=201)
    assert not run.motion.supports[0].any()
    roll = np.degrees(run.motion.supports[:, 2])
    low, high = (float(word) for word in re.findall(r"ship_roll +(\S+) to (\S+) deg", run_text(run))[0])
    assert low == pytest.approx(roll.min(), rel=1e-3)
    assert high == pytest.approx(roll.max(), rel=1e-3)


def test_a_modal_support_stands_on_ground_at_rest() -> None:
    frame = ModalSupport(name="frame", M=((2.0,),), K=((50.0,),), points=(((1.0,), (0.0,)),))
    hung = [Pendulum(on="frame[0]", links=[Bob(mass=0.5, length=0.7)])]
    with pytest.raises(SceneError, match="does not define how ground motion acts on its own mass"):
        Scene(gravity=9.81, support=frame, ground=Ground(motion=SHAKE), pendulum=hung)
