"""The flow and its derivative: against complex steps, between the plain and the compiled body, and by identities."""

from __future__ import annotations

import numpy as np
import pytest
from amounts import usually
from support.scenes import motion_scene, plane_scene, random_state

from modal import load
from modal.eigen.compiling import available
from nonlinear.dynamics import Minimal, Recursion
from nonlinear.dynamics.variational import Variational
from nonlinear.orbits import Flow
from nonlinear.system import system_of


@pytest.mark.parametrize("seed", range(20))
def test_the_jacobian_agrees_with_complex_steps_through_the_recursion(seed: int) -> None:
    system = system_of(plane_scene(seed))
    equations = Variational(system)
    passes = Minimal(system, tuple(Recursion(group, tail=1) for group in system.groups), counts_work=False)
    y = passes.begin(random_state(system, seed))
    rate, slope = equations.linearized(y)
    stepped = passes.derivative(0.0, y[:, None] + 1e-30j * np.eye(len(y)))
    assert rate == pytest.approx(stepped[:, 0].real, rel=1e-11, abs=1e-11 * np.abs(rate).max())
    assert slope == pytest.approx(stepped.imag / 1e-30, rel=1e-10, abs=1e-11 * np.abs(slope).max())


@pytest.mark.slow
@pytest.mark.parametrize("seed", usually(range(4), range(8)))
def test_the_flows_derivative_has_the_determinant_of_the_divergence(seed: int) -> None:
    """d(log det V)/dt = tr J (Liouville), with the integral by Gauss's rule on the steps of the flow."""
    system = system_of(motion_scene(seed, longest=2, most=2))
    flow = Flow(system, 1e-12, fast=False)
    y = flow.equations.begin(random_state(system, seed))
    x, w = np.polynomial.legendre.leggauss(12)
    passed = flow(y, np.eye(len(y)), 0.25)
    total, here = 0.0, y
    for begin, end in zip(passed.path.times[:-1], passed.path.times[1:], strict=True):
        at, now = begin, here
        for node, weight in zip(x, w, strict=True):
            time = (begin + end) / 2 + (end - begin) / 2 * node
            now, at = flow(now, np.zeros((len(y), 0)), time - at).y, time
            total += weight * (end - begin) / 2 * np.trace(flow.equations.linearized(now)[1])
        here = flow(now, np.zeros((len(y), 0)), end - at).y
    assert np.log(np.linalg.det(passed.V)) == pytest.approx(total, abs=1e-8 * max(1.0, abs(total)))


@pytest.mark.parametrize("seed", range(8))
def test_gradients_of_energy_and_momentum_are_carried_by_the_flow(seed: int) -> None:
    """Left vectors of the flow's derivative: ∇E(φ(y)) V = ∇E(y) where nothing drains energy, momentum likewise."""
    system = system_of(motion_scene(seed, damped=False, longest=2, most=2))
    flow = Flow(system, 1e-12, fast=False)
    y = flow.equations.begin(random_state(system, seed))
    passed = flow(y, np.eye(len(y)), 0.4)
    gradients = [flow.equations.energy_slope]
    if system.cart and not system.cart.stiffness:
        gradients.append(flow.equations.momentum_slope)
    for gradient in gradients:
        before = gradient(y)
        assert gradient(passed.y) @ passed.V == pytest.approx(before, abs=1e-9 * np.abs(before).max())


@pytest.mark.slow
@pytest.mark.skipif(not available(), reason="needs numba")
@pytest.mark.parametrize("seed", range(8))
def test_the_compiled_flow_agrees_with_the_plain_one(seed: int) -> None:
    system = system_of(motion_scene(seed, longest=2))
    plain, fast = (Flow(system, 1e-12, fast=choice) for choice in (False, True))
    y = plain.equations.begin(random_state(system, seed))
    one, other = (flow(y, np.eye(len(y)), 0.5) for flow in (plain, fast))
    assert len(one.path.times) == len(other.path.times)
    assert one.y == pytest.approx(other.y, rel=1e-11, abs=1e-11)
    assert pytest.approx(other.V, rel=1e-10, abs=1e-11 * np.abs(one.V).max()) == one.V


@pytest.mark.skipif(not available(), reason="needs numba")
def test_compiled_kicks_agree_with_the_plain_ones() -> None:
    """Clocks that are kicked one after the other, and both at once: then along what keeps them together.

    Which of two equal kicks at one time comes first is a matter of rounding, and derivatives across depend on it.
    """
    together = np.kron(np.eye(2), np.array([[1.0, 0.0], [0.0, 1.0], [0.0, 1.0]]))
    for turned in ((0.11, -0.1), (0.1, 0.1)):
        system = system_of(load("huygens"))
        plain, fast = (Flow(system, 1e-12, fast=choice) for choice in (False, True))
        y = np.array([0.0, *turned, 0.0, 0.0, 0.0])
        one, other = (flow(y, np.eye(6), 1.3) for flow in (plain, fast))
        assert one.side.tolist() == other.side.tolist()
        assert np.sum(np.diff(one.path.times) == 0) >= 2
        assert one.y == pytest.approx(other.y, abs=1e-11)
        along = together if turned[0] == turned[1] else np.eye(6)
        assert pytest.approx(other.V @ along, rel=1e-8, abs=1e-8 * np.abs(one.V).max()) == one.V @ along
