"""Pictures of runs: every panel says something, in units, within the figure."""

from __future__ import annotations

from io import BytesIO
from typing import Any

import numpy as np
import pytest
from amounts import usually
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from scipy.signal import periodogram

import modal
from modal import Bob, Cart, ModalSupport, Pendulum, Scene
from modal.errors import ComputationError
from modal.plotting import save
from modal.plotting.layout import headline
from modal.plotting.style import CURVE_POINTS
from nonlinear.integration import Trajectory
from nonlinear.plotting.run import run_figure
from nonlinear.postprocessing import power_spectrum
from nonlinear.simulation import simulate
from nonlinear.system import state_at_rest


def run(name: str, seconds: float = 8.0, **options: Any) -> Trajectory:
    return simulate(modal.load(name), seconds, method="DOP853", tolerance=1e-8, **options)


def panel(figure: Figure, title: str) -> Axes:
    (chosen,) = [axis for axis in figure.axes if title in axis.get_title(loc="left")]
    return chosen


@pytest.mark.parametrize(
    "name", ["chain-spatial", "crane-hook", "paper-cart-3", "chain-5", "metronomes"][: usually(2, 5)]
)
def test_every_panel_has_curves_units_and_room(name: str) -> None:
    figure = run_figure(run(name))
    figure.canvas.draw()
    assert len(figure.axes) == (5 if modal.load(name).support.kind == "cart" else 4)
    page = figure.bbox
    for axis in figure.axes:
        assert axis.lines
        assert any(np.ptp(np.nan_to_num(line.get_ydata().astype(float))) > 0 for line in axis.lines)
        for label in (axis.get_xlabel(), axis.get_ylabel()):
            assert label.endswith(")")
            assert "(" in label
        for text in (axis.xaxis.label, axis.yaxis.label, axis.title):
            box = text.get_window_extent()
            assert box.x0 >= page.x0 - 1
            assert box.x1 <= page.x1 + 1
            assert box.y0 >= page.y0 - 1
            assert box.y1 <= page.y1 + 1


def test_the_spectrum_of_a_small_swing_stands_on_the_tables_frequency() -> None:
    scene = modal.load("chain-1")
    run = simulate(scene, 60.0, start=state_at_rest(scene, [1.0]), method="DOP853")
    omega, power = power_spectrum(run.times, np.rad2deg(run.motion.links[:, 0]))
    expected = modal.natural_modes(scene).omega[0]
    assert abs(omega[np.argmax(power)] - expected) <= omega[1]
    marks = [line for line in panel(run_figure(run), "Spectrum").lines if line.get_linestyle() == ":"]
    assert [line.get_xdata()[0] for line in marks] == pytest.approx([expected])


def test_the_spectrum_marks_no_mode_that_does_not_swing() -> None:
    scene = modal.load("huygens")
    rows = list(modal.natural_modes(scene))
    lines = panel(run_figure(simulate(scene, 5.0)), "Spectrum").lines
    marks = sorted(float(line.get_xdata()[0]) for line in lines if line.get_linestyle() == ":")
    assert marks == [row.omega for row in rows if row.oscillates]
    assert any(row.omega and not row.oscillates for row in rows)


def test_the_spectrum_says_what_its_modes_do_not_know_of() -> None:
    hoisted = run("hoisting-crane", 3.0)
    scene = Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0, friction=0.01)])])
    rubbed = simulate(scene, 3.0, start=state_at_rest(scene, [5.0]))
    for trajectory, words in ((hoisted, "modes before the hoist"), (rubbed, "modes without dry friction")):
        assert words in panel(run_figure(trajectory), "Spectrum").get_title(loc="left")


def test_the_power_spectrum_keeps_the_mean_square() -> None:
    times = np.linspace(0, 100, 5001)
    omega, power = power_spectrum(times, 3 * np.sin(7 * times))
    assert np.sum(power) * omega[1] / (2 * np.pi) == pytest.approx(4.5, rel=1e-2)


@pytest.mark.parametrize("count", [7, 500])
def test_the_power_spectrum_is_that_of_scipy(count: int) -> None:
    times = np.linspace(2.0, 9.0, count)
    values = np.random.default_rng(0).normal(size=count) + 3 * times
    omega, power = power_spectrum(times, values)
    options = {"fs": (count - 1) / 7, "window": "blackmanharris", "detrend": "linear", "nfft": 8 * count}
    frequency, density = periodogram(values, **options)
    np.testing.assert_allclose(omega, 2 * np.pi * frequency, rtol=1e-14)
    np.testing.assert_allclose(power, density, atol=1e-12 * density.max())


def test_a_link_that_goes_round_stays_in_the_portrait() -> None:
    scene = modal.load("chain-1")
    spun = simulate(scene, 5, start=state_at_rest(scene, [170.0]).__class__(np.zeros(1), np.array([10.0])))
    assert spun.motion.links.max() > 4 * np.pi
    (curve,) = panel(run_figure(spun), "Phase portrait").lines
    angles = curve.get_xdata().astype(float)
    assert np.nanmax(np.abs(angles)) <= 180
    assert np.nanmax(np.abs(np.diff(angles))) < 180


def test_crowds_standstill_and_few_samples_can_be_drawn() -> None:
    double = Pendulum(links=(Bob(mass=1, length=1), Bob(mass=1, length=1)), count=50)
    crowd = Scene(gravity=9.81, support=Cart(mass=10.0), pendulum=(double,))
    figure = run_figure(simulate(crowd, 1.0, start=state_at_rest(crowd, [10, 20]), method="DOP853"))
    assert "of 100 links drawn" not in figure.get_supxlabel()
    names = [text.get_text() for text in panel(figure, "Angles").get_legend().get_texts()]
    assert names == ["θ₁,₁–θ₅₀,₁ coincide", "θ₁,₂–θ₅₀,₂ coincide"]
    still = modal.load("chain-2")
    for options in ({"output": 3}, {"start": state_at_rest(still, [0, 0])}, {"output": [0, 0.5, 2, 3]})[
        : usually(1, 3)
    ]:
        stream = BytesIO()
        save(run_figure(run("chain-2", **options)), stream, "svg")
        assert b"<svg" in stream.getvalue()


def test_of_a_large_crowd_one_may_swing_almost_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where no modes are marked, the spectrum reaches as far as those that swing."""

    def refuse(scene: Scene) -> None:
        raise ComputationError("no modes")

    monkeypatch.setattr("nonlinear.plotting.run.natural_modes", refuse)
    pendulum, other = (Pendulum(links=(Bob(mass=1e-6, length=length),)) for length in (1.0, 1.3))
    pair = Scene(gravity=9.81, support=Cart(mass=1e6), pendulum=(pendulum, other))
    figure = run_figure(simulate(pair, 8.0, start=state_at_rest(pair, [0, 10]), method="DOP853"))
    assert 2.7 < panel(figure, "Spectrum").get_xlim()[1] < 20


def test_a_hundred_swings_have_no_corners() -> None:
    """The portrait has points between the samples, however many pendula there are."""
    crowd = Scene(gravity=9.81, pendulum=(Pendulum(links=(Bob(mass=1, length=0.1),), count=100),))
    run = simulate(crowd, 20.0, start=state_at_rest(crowd, [30]), method="DOP853")
    assert len(run.times) * 100 > 20_000
    (line,) = panel(run_figure(run), "Phase portraits").lines
    assert len(line.get_xdata()) == CURVE_POINTS


def test_a_single_instant_is_refused() -> None:
    scene = modal.load("chain-2")
    run = simulate(scene, 1.0, output=[0])
    with pytest.raises(ComputationError, match="single sample"):
        run_figure(run)


@pytest.mark.parametrize("words", ["Metronomes with weights " * 8, "$a$ and $b"])
def test_a_title_stays_within_its_figure(words: str) -> None:
    figure = Figure(figsize=(8.0, 6.0), layout="constrained")
    FigureCanvasAgg(figure)
    figure.subplots()
    headline(figure, words, "motion")
    figure.canvas.draw()
    (title,) = figure.texts
    box = title.get_window_extent()
    assert box.x0 >= 0
    assert box.x1 <= figure.bbox.width
    assert title.get_text().split() == f"{words}: motion".split()


PUSHES = (
    {"input": "cart_force", "output": "x_dot", "gain": 6.0, "limit": 1.0, "sample_time": 0.05, "delay": 0.1},
    {"input": "cart_force", "output": "x", "gain": 2.0},
    {"input": "joint_torques", "output": "theta_dot_1_1", "gain": 0.5},
)


def test_the_forces_of_loops_are_drawn_and_change_the_momentum_by_their_integral() -> None:
    hook = Pendulum(links=[Bob(mass=1.0, length=1.0)], start={"angles_deg": [30.0]})
    scene = Scene(gravity=9.81, support=Cart(mass=3.0), pendulum=[hook], feedback=PUSHES)
    trajectory = simulate(scene, 4.0, tolerance=1e-10, output=2001)
    figure = run_figure(trajectory)
    force, torque = (axis for axis in figure.axes if axis.get_title(loc="left") == "Feedback")
    assert (force.get_ylabel(), torque.get_ylabel()) == ("force (N)", "torque (N m)")
    times, pushes = (np.asarray(values, dtype=float) for values in force.lines[0].get_data())
    impulse = np.append(0.0, np.cumsum(np.diff(times) * (pushes[1:] + pushes[:-1]) / 2))
    change = trajectory.mechanics.momentum - trajectory.mechanics.momentum[0]
    assert np.abs(change).max() > 0.1
    # Each held push is drawn up to half a step off.
    assert np.abs(np.interp(trajectory.times, times, impulse) - change).max() < 2e-3
    turning = np.asarray(torque.lines[0].get_ydata(), dtype=float)
    drawn_rates = -2.0 * np.interp(trajectory.times, times, turning)
    assert np.abs(drawn_rates - trajectory.motion.link_rates[:, 0]).max() < 1e-3
    coarse = run_figure(simulate(scene, 4.0, output=5))
    assert "no sampled feedback drawn" in coarse.get_supxlabel()
    loops = [axis.get_ylabel() for axis in coarse.axes if axis.get_title(loc="left") == "Feedback"]
    assert loops == ["force (N)", "torque (N m)"]  # of the loops without samples


def test_a_force_on_a_modal_coordinate_is_drawn() -> None:
    frame = ModalSupport(name="frame", M=((2.0,),), K=((50.0,),), points=(((1.0,), (0.0,)),))
    hung = Pendulum(on="frame[0]", links=[Bob(mass=1.0, length=1.0)], start={"angles_deg": [30.0]})
    loop = {"input": "frame_1_force", "output": "theta_1_1", "gain": 2.0}
    trajectory = simulate(Scene(gravity=9.81, support=frame, pendulum=[hung], feedback=[loop]), 1.0)
    axis = panel(run_figure(trajectory), "Feedback")
    assert axis.get_ylabel() == "generalized force (1)"
    assert axis.lines[0].get_ydata()[0] == pytest.approx(-2.0 * np.radians(30.0))


def test_the_small_torque_of_a_light_pendulum_is_no_rounding() -> None:
    hung = Pendulum(links=[Bob(mass=1e-9, length=0.01)], start={"angles_deg": [1.0]})
    loop = {"input": "joint_torques", "output": "theta_1_1", "gain": 1e-12}
    axis = panel(run_figure(simulate(Scene(gravity=9.81, pendulum=[hung], feedback=[loop]), 1.0)), "Feedback")
    low, high = axis.get_ylim()
    assert high - low < 2 * np.ptp(np.asarray(axis.lines[0].get_ydata(), dtype=float))
