"""Input shapers beside simulations, published insensitivities and the cranes."""

from __future__ import annotations

import runpy
from pathlib import Path

import control
import numpy as np
import pytest
from control_scenes import crane, mixed, of_control

from modal import Cart, ComputationError, Pendulum, Rod, Scene, SceneError, load, natural_modes
from modal.statespace import (
    over_length,
    residual_vibration,
    robustness,
    shaper_for,
    state_space,
    swing_words,
    swings_of,
)
from modal.statespace.shapers import Shaper, Swing, insensitivity, shaper

EXAMPLES = Path(__file__).parents[2] / "examples"


def left_over(scene: Scene, made: Shaper, drive: str = "cart_acceleration") -> float:
    """The largest angle after a shaped pulse over that after the bare one, simulated by python-control."""
    model = state_space(scene, (drive,), ("angles",))
    times = np.arange(0.0, 60.0, 0.002)
    pulse = np.where(times < 3.0, 1.0, 0.0)
    swings = []
    for command in (pulse, made.shaped(times, pulse)):
        angles = np.atleast_2d(control.forced_response(of_control(model), times, command).outputs)
        swings.append(np.abs(angles[:, times > 3.0 + made.duration + 0.1]).max())
    return float(swings[1] / swings[0])


@pytest.mark.parametrize("kind", ["zv", "zvd"])
@pytest.mark.parametrize("zeta", [0.0, 0.05, 0.4])
def test_nothing_is_left_of_the_mode_itself(kind: str, zeta: float) -> None:
    made = shaper([Swing(3.0, zeta)], kind)
    assert made.amplitudes.sum() == pytest.approx(1.0, rel=1e-15)
    assert residual_vibration(made, 3.0, zeta) < 1e-14
    assert residual_vibration(made, 3.3, zeta) > 1e-3


def test_amplitudes_by_hand() -> None:
    assert shaper([Swing(2.0)]).amplitudes.tolist() == [0.5, 0.5]
    assert shaper([Swing(2.0)]).times == pytest.approx([0.0, np.pi / 2])
    assert shaper([Swing(2.0)], "zvd").amplitudes.tolist() == [0.25, 0.5, 0.25]
    K = np.exp(-0.1 * np.pi / np.sqrt(0.99))
    made = shaper([Swing(2.0, 0.1)])
    assert made.amplitudes == pytest.approx([1 / (1 + K), K / (1 + K)])
    assert made.duration == pytest.approx(np.pi / (2 * np.sqrt(0.99)))


def test_the_formula_of_what_is_left_is_a_simulation() -> None:
    """A damped oscillator struck by the shaper's impulses, its energy's amplitude after the last."""
    omega, zeta, made = 2.3, 0.07, shaper([Swing(2.0, 0.1), Swing(5.0, 0.02)])
    damped = omega * np.sqrt(1 - zeta**2)
    A = np.array([[-zeta * omega, damped], [-damped, -zeta * omega]])
    values, v = np.linalg.eig(A)

    def after(impulses: list[tuple[float, float]]) -> float:
        steps = [(v * np.exp(values * (made.duration - t))) @ np.linalg.inv(v) @ [0.0, a] for t, a in impulses]
        return float(np.linalg.norm(np.sum(steps, axis=0)))

    struck = after(list(zip(made.times, made.amplitudes, strict=True)))
    assert residual_vibration(made, omega, zeta) == pytest.approx(struck, rel=1e-12)


@pytest.mark.parametrize(("kind", "width"), [("zv", 0.064), ("zvd", 0.287)])
def test_insensitivity_at_five_percent(kind: str, width: float) -> None:
    """Singhose's 0.06 and 0.286 for undamped modes; |cos πr/2| and its square say 4/π asin V and 4/π asin √V."""
    low, high = insensitivity(shaper([Swing(2.0)], kind), Swing(2.0))
    exact = 4 / np.pi * np.arcsin(0.05 if kind == "zv" else np.sqrt(0.05))
    assert (high - low) / 2.0 == pytest.approx(exact, rel=1e-12)
    assert (high - low) / 2.0 == pytest.approx(width, abs=5e-4)
    with pytest.raises(ComputationError, match="residual vibration exceeds"):
        insensitivity(shaper([Swing(2.0)], kind), Swing(3.0))


def test_a_prescribed_motion_meets_the_fixed_frequencies_and_a_force_the_free_ones() -> None:
    g, (M, m) = 9.81, (1000.0, 100.0)
    assert [s.omega for s in swings_of(crane())] == pytest.approx([np.sqrt(g / 20), np.sqrt(g / 10)], rel=1e-14)
    equal = swings_of(crane(20.0, 20.0), "cart_force")
    assert [s.omega for s in equal] == pytest.approx([np.sqrt(g / 20 * (1 + 2 * m / M))], rel=1e-14)


@pytest.mark.parametrize("drive", ["cart_acceleration", "cart_velocity", "cart_force"])
def test_a_fixed_support_has_no_shaper(drive: str) -> None:
    with pytest.raises(SceneError, match="the support is fixed"):
        shaper_for(load("chain-2"), drive=drive)


def test_another_drive_is_refused_with_the_nearest_word() -> None:
    for call in (shaper_for, swings_of):
        with pytest.raises(SceneError, match=r"drive = 'force': must be one of .*\(did you mean cart_force\?\)"):
            call(load("crane-hook"), drive="force")
    with pytest.raises(SceneError) as caught:
        swings_of(load("chain-2"), drive="cart_aceleration")
    assert len(caught.value.problems) == 2
    assert "did you mean cart_acceleration?" in caught.value.problems[0]


@pytest.mark.parametrize("drive", ["cart_acceleration", "cart_force"])
def test_an_unstable_equilibrium_has_no_shaper(drive: str) -> None:
    with pytest.raises(ComputationError, match="is unstable"):
        shaper_for(load("cart-upright"), drive=drive)


@pytest.mark.parametrize("name", ["crane-hook", "crane-two-loads", "paper-cart-3", "huygens"])
def test_what_a_shaper_assumes_is_told_with_the_table_beside_it(name: str) -> None:
    """The table's modes that move the cart go to the held ones as the cart gets heavier: followed by their order."""
    scene = load(name)
    held = swings_of(scene)
    told = list(swing_words(scene, len(held)))
    assert told[0].startswith("trolley motion prescribed")
    moving = [mode for mode in natural_modes(scene) if mode.oscillates and mode.cart_participation]
    heavy = [s.omega for s in swings_of(scene.replace(support=Cart(mass=1e9)), "cart_force")]
    assert heavy == pytest.approx([s.omega for s in held], rel=1e-6)
    for number, (swing, mode, words) in enumerate(zip(held, moving, told[1:], strict=True), 1):
        assert words == (
            f"fixed-base mode {number}: {swing.omega:.9g} rad/s, damping ratio {swing.zeta:.4g}; the table, with the "
            f"trolley free: mode {mode.number}, {mode.omega:.9g} rad/s"
        )


def test_under_a_force_a_shaper_is_for_modes_of_the_table() -> None:
    modes = natural_modes(load("crane-hook"))
    assert list(swing_words(load("crane-hook"), 1, "cart_force")) == [
        "trolley pushed by a force: it swings with its load, as in the table",
        f"mode 2: {modes.omega[1]:.9g} rad/s, damping ratio 0",
    ]


@pytest.mark.parametrize("drive", ["cart_acceleration", "cart_force"])
def test_simulated_cranes_come_to_rest(drive: str) -> None:
    scene = load("crane-hook")
    both = shaper_for(scene, 2, drive=drive)
    assert len(both.times) == 4
    assert left_over(scene, both, drive) < 2e-3
    other = shaper_for(scene, 2, drive="cart_force" if drive == "cart_acceleration" else "cart_acceleration")
    assert left_over(scene, other, drive) > 0.1


@pytest.mark.slow
def test_one_mode_is_not_two() -> None:
    scene = crane()
    assert left_over(scene, shaper_for(scene, 2)) < 2e-3
    assert left_over(scene, shaper_for(scene, 1)) > 0.1


@pytest.mark.slow
def test_damped_pendula_come_to_rest() -> None:
    links = [Rod(mass=1.0, length=2.0, damping=0.8)]
    scene = mixed().model_copy(update={"pendulum": (Pendulum(links=links),)})
    swing = swings_of(scene)[0]
    assert 0.03 < swing.zeta < 0.3
    assert left_over(scene, shaper_for(scene)) < 2e-3
    assert left_over(scene, shaper([Swing(swing.omega)])) > 2e-2


def test_robustness_over_cable_length() -> None:
    """For one load ω ~ 1/√l: V is that of the frequency ratio; ZVD holds over a wider range of lengths than ZV."""
    scene = crane().model_copy(update={"pendulum": crane().pendulum[:1]})
    lengths = np.linspace(10.0, 30.0, 21)
    scenes = over_length(scene, lengths)
    assert [s.pendulum[0].links[0].length for s in scenes] == lengths.tolist()
    zv, zvd = (robustness(shaper_for(scene, kind=kind), scenes, lengths) for kind in ("zv", "zvd"))
    ratio = np.sqrt(20.0 / lengths)
    assert zv.residual[:, 0] == pytest.approx(100 * np.abs(np.cos(np.pi * ratio / 2)), abs=1e-10)
    assert zvd.residual[:, 0] == pytest.approx(100 * np.cos(np.pi * ratio / 2) ** 2, abs=1e-10)
    assert lengths[zv.within()].tolist() == [19.0, 20.0, 21.0]
    assert lengths[zvd.within()].tolist() == [16.0, 17.0, 18.0, 19.0, 20.0, 21.0, 22.0, 23.0, 24.0, 25.0, 26.0, 27.0]


def test_commands_are_delayed_and_added() -> None:
    made = Shaper(np.array([0.0, 1.0]), np.array([0.25, 0.75]))
    times = np.linspace(0.0, 3.0, 7)
    assert made.shaped(times, times) == pytest.approx(0.25 * times + 0.75 * np.clip(times - 1, 0, None))
    assert (made * made).amplitudes == pytest.approx([0.0625, 0.1875, 0.1875, 0.5625])


def test_what_does_not_swing_is_refused() -> None:
    with pytest.raises(ComputationError, match="does not oscillate"):
        shaper([Swing(2.0, 1.0)])
    with pytest.raises(ValueError, match="at least one mode"):
        shaper([])
    with pytest.raises(ComputationError, match="excites 2 modes"):
        shaper_for(crane(), 3)
    assert len(swings_of(crane())) == len(natural_modes(crane())) - 1


def test_the_example_of_feedback_runs(capsys: pytest.CaptureFixture[str]) -> None:
    found = runpy.run_path(str(EXAMPLES / "crane_lqr.py"))
    found["main"]()
    printed = capsys.readouterr().out
    assert printed.count("regulator: ") == printed.count("observer: ") == 2
