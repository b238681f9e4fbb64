"""Input shapers against simulations, published insensitivities and the cranes."""

from __future__ import annotations

import runpy
from pathlib import Path

import control
import numpy as np
import pytest
from control_scenes import crane, mixed, of_control
from scipy.linalg import expm

from modal import Cart, ComputationError, Pendulum, Rod, Scene, SceneError, load, natural_modes
from modal.statespace import (
    over_length,
    residual_vibration,
    robustness,
    shaper_for,
    state_space,
    swing_words,
    swings_of,
    to_modal_form,
)
from modal.statespace.model import StateSpace
from modal.statespace.shapers import DampedSwing, Shaper, insensitivity, shaper

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


@pytest.mark.parametrize("step", [0.0, 0.01, 0.3])
@pytest.mark.parametrize("kind", ["zv", "zvd", "um"])
@pytest.mark.parametrize("zeta", [0.0, 0.05, 0.4])
def test_nothing_is_left_of_the_mode_itself(kind: str, zeta: float, step: float) -> None:
    made = shaper([DampedSwing(3.0, zeta)], kind, step)
    assert made.amplitudes.sum() == pytest.approx(1.0, rel=1e-15)
    if step:
        assert made.times == pytest.approx(step * np.rint(made.times / step), rel=1e-15)
    assert (kind == "um") == bool((made.amplitudes < 0).any())
    assert 0 <= np.cumsum(made.amplitudes).min() <= np.cumsum(made.amplitudes).max() <= 1 + 1e-15
    assert residual_vibration(made, 3.0, zeta) < 1e-14
    assert residual_vibration(made, 3.3, zeta) > 1e-3


def test_amplitudes_by_hand() -> None:
    assert shaper([DampedSwing(2.0)]).amplitudes.tolist() == [0.5, 0.5]
    assert shaper([DampedSwing(2.0)]).times == pytest.approx([0.0, np.pi / 2])
    assert shaper([DampedSwing(2.0)], "zvd").amplitudes.tolist() == [0.25, 0.5, 0.25]
    K = np.exp(-0.1 * np.pi / np.sqrt(0.99))
    made = shaper([DampedSwing(2.0, 0.1)])
    assert made.amplitudes == pytest.approx([1 / (1 + K), K / (1 + K)])
    assert made.duration == pytest.approx(np.pi / (2 * np.sqrt(0.99)))


def test_a_unity_magnitude_shaper_by_hand() -> None:
    made = shaper([DampedSwing(2.0)], "um")
    assert made.amplitudes.tolist() == [1.0, -1.0, 1.0]
    assert made.times == pytest.approx([0.0, np.pi / 6, np.pi / 3], rel=1e-14)


@pytest.mark.parametrize("tolerance", [0.02, 0.05, 0.1])
def test_an_undamped_extra_insensitive_shaper_by_hand(tolerance: float) -> None:
    """Singhose, Seering & Singer's amplitudes; zeros of |(1 − V)/2 + (1 + V)/2 cos πr| at cos πr = −(1 − V)/(1 + V)."""
    made = shaper([DampedSwing(2.0)], "ei", tolerance=tolerance)
    assert made.amplitudes == pytest.approx([(1 + tolerance) / 4, (1 - tolerance) / 2, (1 + tolerance) / 4], rel=1e-12)
    assert residual_vibration(made, 2.0) == pytest.approx(tolerance, rel=1e-12)
    zero = np.arccos(-(1 - tolerance) / (1 + tolerance)) / np.pi
    assert residual_vibration(made, [2.0 * zero, 4.0 - 2.0 * zero]) == pytest.approx([0, 0], abs=1e-12)


@pytest.mark.parametrize(("zeta", "step"), [(0.0, 0.01), (0.1, 0.0), (0.1, 0.05), (0.2, 0.3)])
def test_an_extra_insensitive_shaper_keeps_to_its_tolerance_over_a_wider_range(zeta: float, step: float) -> None:
    made, other = (shaper([DampedSwing(3.0, zeta)], kind, step) for kind in ("ei", "zvd"))
    low, high = insensitivity(made, DampedSwing(3.0, zeta), 0.05 * (1 + 1e-6))
    narrow = insensitivity(other, DampedSwing(3.0, zeta))
    assert low < narrow[0] < narrow[1] < high
    left = residual_vibration(made, np.linspace(low, high, 5001), zeta)
    assert 0.05 * (1 - 1e-4) < left[1000:-1000].max() < 0.05 * (1 + 1e-5)


def test_damped_extra_insensitive_amplitudes_are_the_published_fit() -> None:
    """Singhose's polynomials for V = 5 % and ζ = 0.1, to the 1 % of a fit."""
    made = shaper([DampedSwing(3.0, 0.1)], "ei")
    assert made.amplitudes[[0, 2]] == pytest.approx([0.35488, 0.19212], rel=0.015)


@pytest.mark.parametrize("kind", ["zv", "zvd", "um"])
@pytest.mark.parametrize("count", [1, 2])
def test_a_sampled_command_leaves_nothing_in_the_sampled_model(kind: str, count: int) -> None:
    """Powers of the matrix exponential, input held over each step: the modes meant are at rest, to rounding."""
    damped = crane().pendulum[0].links[0].replace(damping=3000.0)
    scene, step = crane().replace(pendulum=(Pendulum(links=(damped,)), crane().pendulum[1])), 0.07
    made = shaper_for(scene, count, kind, step=step)
    form = to_modal_form(natural_modes(scene), sample_free(scene))
    command = np.zeros(2000)
    command[:40] = np.random.default_rng(count).normal(size=40)
    ticks = np.rint(made.times / step).astype(int)
    shaped = sum(
        a * np.concatenate((np.zeros(k), command[: 2000 - k])) for a, k in zip(made.amplitudes, ticks, strict=True)
    )
    last = 41 + ticks[-1]
    swinging = [block for block in form.blocks if block.mode is not None][:count]
    assert len(swinging) == count
    for block, B in zip(form.blocks, form.inputs, strict=True):
        if block not in swinging:
            continue
        states = []
        for u in (command, shaped):
            k = len(block.A)
            exact = expm(step * np.block([[block.A, B], [np.zeros((1, k + 1))]]))
            z = np.zeros(k)
            for value in u[:last]:
                z = exact[:k, :k] @ z + exact[:k, k] * value
            states.append(np.linalg.norm(z))
        assert states[1] < 1e-11 * states[0]


def sample_free(scene: Scene) -> StateSpace:
    return state_space(scene, ("cart_acceleration",), ("angles",))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"step": 2.0}, "step 2: is longer than half the period"),
        ({"kind": "um", "step": 1.0}, "too long for a UM"),
    ],
)
def test_a_step_too_long_is_refused(changes: dict[str, object], words: str) -> None:
    with pytest.raises(ComputationError, match=words):
        shaper([DampedSwing(3.0)], **changes)


@pytest.mark.parametrize("changes", [{"step": -1.0}, {"step": np.nan}, {"tolerance": 0.0}, {"kind": "zvdddd"}])
def test_what_no_shaper_has_is_refused(changes: dict[str, object]) -> None:
    with pytest.raises(ValueError, match="must be"):
        shaper([DampedSwing(3.0)], **changes)


def test_the_formula_of_what_is_left_is_a_simulation() -> None:
    """A damped oscillator struck by the shaper's impulses, its energy's amplitude after the last."""
    omega, zeta, made = 2.3, 0.07, shaper([DampedSwing(2.0, 0.1), DampedSwing(5.0, 0.02)])
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
    low, high = insensitivity(shaper([DampedSwing(2.0)], kind), DampedSwing(2.0))
    exact = 4 / np.pi * np.arcsin(0.05 if kind == "zv" else np.sqrt(0.05))
    assert (high - low) / 2.0 == pytest.approx(exact, rel=1e-12)
    assert (high - low) / 2.0 == pytest.approx(width, abs=5e-4)
    with pytest.raises(ComputationError, match="residual vibration exceeds"):
        insensitivity(shaper([DampedSwing(2.0)], kind), DampedSwing(3.0))


def test_a_prescribed_motion_meets_the_fixed_frequencies_and_a_force_the_free_ones() -> None:
    g, (M, m) = 9.81, (1000.0, 100.0)
    assert [s.omega for s in swings_of(crane())] == pytest.approx([np.sqrt(g / 20), np.sqrt(g / 10)], rel=1e-14)
    equal = swings_of(crane(20.0, 20.0), "cart_force")
    assert [s.omega for s in equal] == pytest.approx([np.sqrt(g / 20 * (1 + 2 * m / M))], rel=1e-14)


@pytest.mark.parametrize("drive", ["cart_acceleration", "cart_velocity", "cart_force"])
def test_a_fixed_support_has_no_shaper(drive: str) -> None:
    with pytest.raises(SceneError, match=r"support\.kind"):
        shaper_for(load("chain-2"), drive=drive)


def test_another_drive_is_refused_with_the_nearest_word() -> None:
    for call in (shaper_for, swings_of):
        with pytest.raises(SceneError, match=r"drive 'force': must be one of .*\(did you mean cart_force\?\)"):
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


def test_one_mode_is_not_two() -> None:
    scene = crane()
    assert left_over(scene, shaper_for(scene, 2)) < 2e-3
    assert left_over(scene, shaper_for(scene, 1)) > 0.1


def test_damped_pendula_come_to_rest() -> None:
    links = [Rod(mass=1.0, length=2.0, damping=0.8)]
    scene = mixed().model_copy(update={"pendulum": (Pendulum(links=links),)})
    swing = swings_of(scene)[0]
    assert 0.03 < swing.zeta < 0.3
    assert left_over(scene, shaper_for(scene)) < 2e-3
    assert left_over(scene, shaper([DampedSwing(swing.omega)])) > 2e-2


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
        shaper([DampedSwing(2.0, 1.0)])
    with pytest.raises(ValueError, match="at least one mode"):
        shaper([])
    with pytest.raises(ComputationError, match="excites 2 modes"):
        shaper_for(crane(), 3)
    assert len(swings_of(crane())) == len(natural_modes(crane())) - 1


def test_the_example_of_feedback_runs(capsys: pytest.CaptureFixture[str]) -> None:
    module = runpy.run_path(str(EXAMPLES / "crane_lqr.py"))
    module["main"]()
    printed = capsys.readouterr().out
    assert printed.count("regulator: ") == printed.count("observer: ") == 2
