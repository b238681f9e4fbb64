"""The comparison helpers bite."""

from dataclasses import replace

import numpy as np
import pytest
from compare import assert_certified, assert_shapes, with_spectrum
from oracle import dense

from modal import load, natural_modes


def test_a_frequency_off_by_three_roundings_of_the_tolerance_fails() -> None:
    modes = natural_modes(load("chain-3"))
    off = modes.spectrum.eigenvalue * np.array([1, 1 + 3e-14, 1])
    wrong = with_spectrum(modes, replace(modes.spectrum, eigenvalue=off))
    assert_certified(modes, 1e-14)
    with pytest.raises(AssertionError, match="frequency 1"):
        assert_certified(wrong, 1e-14)


def test_a_missing_frequency_fails() -> None:
    modes = natural_modes(load("chain-3"))
    short = modes.spectrum.take(slice(0, 2))
    with pytest.raises(AssertionError, match="2 frequencies instead of 3"):
        assert_certified(with_spectrum(modes, short), 1e-14)


def test_a_wrong_shape_fails() -> None:
    modes, other = natural_modes(load("chain-3")), natural_modes(load("chain-unequal"))
    assert assert_shapes(modes, dense(modes.scene)) == 3
    with pytest.raises(AssertionError, match="mode 0"):
        assert_shapes(modes, dense(other.scene))
