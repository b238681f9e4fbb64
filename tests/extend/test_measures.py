"""Measures of other packages: their declarations, the verbs that accept them, and the attribution of errors."""

from __future__ import annotations

from types import MappingProxyType
from typing import Any

import numpy as np
import pytest
from scipy.special import agm

from modal import Bob, Pendulum, Scene, load, natural_frequencies
from modal.errors import ExtensionError, SceneError
from modal.extend import Measure, registration
from modal.extend.measures import measure_for, taken_by
from modal.testing import MeasureTests
from modal.tuning import parse_quantity, tune
from modal.tuning.pieces import Quantities, Setting
from modal.tuning.quantities import find_free
from nonlinear.measures import CartTravel, Frequencies, LargestAngle
from nonlinear.sweeps import sweep

OMEGA = np.sort(natural_frequencies(load("chain-2").replace(gravity=9.81)))


class Ratio(Measure):
    """The ratio of the two lowest frequencies."""

    name, words, columns = "ratio", "the second frequency over the first", ("frequency_ratio",)

    def of_modes(self, modes: Any, number: float) -> float:
        return float(modes[1].omega / modes[0].omega)


class Swings(Measure):
    """How the last link moved."""

    name, words = "swings", "the largest angle of the last link, and how often it passes the vertical"
    columns = ("last_angle_rad", "passages")

    def of_motion(self, run: Any, seconds: float) -> tuple[float, float]:
        angles = run.motion.links[:, -1]
        return np.abs(angles).max(), float((angles[1:] * angles[:-1] < 0).sum())


class Slowing(Measure):
    """How much longer a swing of 60° takes than a small one."""

    name, words, columns = "slowing", "the period of an orbit of 60° over that of small motion", ("slowing",)
    amplitude_deg = 60.0

    def of_orbit(self, orbit: Any, number: float) -> float:
        return float(orbit.period * np.sqrt(9.81) / (2 * np.pi))


class TestSlowing(MeasureTests):
    """By the complete elliptic integral, with the arithmetic-geometric mean [Abramowitz1964, §17.6]."""

    extension, number = Slowing, 1.0
    scene = Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0)])])
    expected = MappingProxyType({"slowing": 1 / float(agm(1.0, np.cos(np.radians(30.0))))})


class TestRatio(MeasureTests):
    extension = Ratio
    expected = MappingProxyType({"frequency_ratio": float(OMEGA[-1] / OMEGA[-2])})


class TestSwings(MeasureTests):
    extension = Swings


class TestFrequencies(MeasureTests):
    """Ours is held to the same."""

    extension = Frequencies


class TestCartTravel(MeasureTests):
    extension, scene = CartTravel, "paper-cart-2"


class TestLargestAngle(MeasureTests):
    extension = LargestAngle


def failing(**functions: Any) -> type[Measure]:
    return type("Failing", (Measure,), {"name": "failing", "words": "w", "columns": ("a", "b"), **functions})


@pytest.mark.parametrize(
    ("returned", "words"),
    [
        (1.0, "of_motion returned 1 values: must be 2, of a, b"),
        ([1.0, "x"], "of_motion returned what is no number"),
        ([1.0, [2.0, 3.0]], "of_motion returned what is no number"),
    ],
)
def test_a_wrong_shape_is_the_extensions_own_error(returned: Any, words: str) -> None:
    with pytest.raises(ExtensionError, match=rf"extension failing \(package tests\): {words}"):
        failing(of_motion=lambda self, run, seconds: returned)().values_of("of_motion", None, 1.0)


def test_what_it_raises_is_told_with_its_name() -> None:
    def of_modes(self: Measure, modes: Any, number: float) -> float:
        raise ZeroDivisionError("no modes")

    with registration(failing(of_modes=of_modes)):
        swept = sweep(load("chain-1"), "gravity=9.8,9.9", measures="failing", workers=1)
    assert {*swept.failures.values()} == {
        "extension failing (package tests): of_modes raised ZeroDivisionError: no modes"
    }


def test_errors_of_ours_stay_ours() -> None:
    with pytest.raises(SceneError, match=r"^trajectory: a Trajectory is required"):
        LargestAngle().values_of("of_motion", None, 1.0)
    with pytest.raises(AttributeError):
        CartTravel().values_of("of_motion", None, 1.0)


def test_what_it_does_not_state_is_told_when_it_is_registered() -> None:
    for wrong, words in (
        (failing(), "has none of of_modes, of_orbit, of_motion and of_members"),
        (failing(words="", of_modes=max), "has no words"),
        (failing(name="Not A Name", of_modes=max), "its name 'Not A Name' must be small letters"),
        (failing(name="beat", of_modes=max), "a measure of this name exists, of nonlinear"),
    ):
        with pytest.raises(ExtensionError, match=words), registration(wrong):
            pass
    assert "beat" in taken_by("sweep")
    assert type(measure_for("sweep", "beat")).__module__ == "nonlinear.measures"


class Detuning(Measure):
    """How far the lower frequency is from 3 rad/s."""

    name, words, columns = "detuning", "the square of the lowest frequency less 3 rad/s", ("detuning",)

    def of_modes(self, modes: Any, number: float) -> float:
        return float((min(modes.omega) - 3.0) ** 2)


@pytest.mark.parametrize("aim", ["detuning", "2*detuning"])
def test_a_measure_is_tuned(aim: str) -> None:
    """Where √(g/l) = 3 rad/s; its slope is that of the frequency, −ω/(2 l)."""
    scene = Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=0.8)])])
    with registration(Detuning):
        tuned = tune(scene, ["pendulum[0].links[0].length=0.5:2"], minimize=[aim])
        assert tuned.numbers["pendulum[0].links[0].length"] == pytest.approx(9.81 / 9, rel=1e-4)
        free = find_free(scene, ["pendulum[0].links[0].length"], lambda place: 1.0)
        (piece,) = Quantities(scene, free, [parse_quantity("detuning")], Setting()).at(
            np.array([0.8]), by=[free[0].places]
        )
    omega = np.sqrt(9.81 / 0.8)
    assert piece.gradients[0, 0] == pytest.approx(2 * (omega - 3) * -omega / 1.6, rel=1e-8)


def test_a_period_of_an_orbit_is_tuned() -> None:
    """The period at 60° is that of an elliptic integral, and grows with the root of the length."""
    scene = Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0)])])
    with registration(Slowing):
        place = "pendulum[0].links[0].length"
        free = find_free(scene, [place], lambda place: 1.0)
        quantity = parse_quantity("slowing")
        (piece,) = Quantities(scene, free, [quantity], Setting()).at(np.array([1.0]), by=[free[0].places])
    assert piece.values == pytest.approx(1 / float(agm(1.0, np.cos(np.radians(30.0)))), rel=1e-6)
    assert piece.gradients[0] == pytest.approx(piece.values / 2, rel=1e-5)


def test_what_is_no_aim_is_told() -> None:
    for text in ("largest_angle", "frequencies:2", "nosuch"):
        with pytest.raises(SceneError, match="must be peak:OUTPUT/INPUT"):
            parse_quantity(text)
    with pytest.raises(SceneError, match="must have a whole number"):
        parse_quantity("beat:1.5")
