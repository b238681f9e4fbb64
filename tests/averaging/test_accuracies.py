"""The tolerances of averaged equations have an effect: eight times or an eighth as much fails."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from modal import load
from nonlinear.averaging import RelativeEquilibrium, average, swinging
from nonlinear.averaging.equations import derivative


def test_derivatives_are_as_accurate_as_central_differences_get() -> None:
    z, turning = np.array([0.3 + 0.4j]), np.ones(1)
    slope = derivative(lambda amplitude, _: amplitude**3, z, turning)
    exact = 3 * z[0] ** 2
    assert np.abs(slope - [[exact.real, -exact.imag], [exact.imag, exact.real]]).max() < 1e-10


@pytest.mark.parametrize(("part", "count"), [(3e-4, 1), (3e-3, 2)])
def test_a_band_is_at_rest_below_a_thousandth(part: float, count: int) -> None:
    equations = average(load("clocks-double"))
    z = np.where(equations.band == 0, 1.0, 0.0).astype(complex)
    z[np.flatnonzero(equations.band == 1)[0]] = part
    assert len(swinging(equations, z)) == count


@pytest.mark.parametrize(("growth", "is_stable"), [(-3e-5, None), (-3e-4, True), (3e-4, False)])
def test_a_motion_whose_growth_is_rounding_is_neutral(growth: float, is_stable: bool | None) -> None:
    state: Any = SimpleNamespace(growth=growth, recovery=1.0)
    assert vars(RelativeEquilibrium)["is_stable"].fget(state) is is_stable
