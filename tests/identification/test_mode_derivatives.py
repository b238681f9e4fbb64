"""Derivatives of eigenvalues and shapes by numbers of a scene: against sensitivities, and against 40 digits."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest

from modal import load
from modal.assembly import differences, matrices
from modal.errors import SceneError
from modal.identification.identifiability import ModeDerivatives, matrix_derivatives, polar
from modal.identification.parameters import natural_unit
from modal.modes import natural_modes
from modal.modes.sensitivity import sensitivities
from modal.scene import Scene
from modal.scene.parameters import find_places, number_at, vary


def derived(scene: Scene, paths: list[str]) -> ModeDerivatives:
    places = [find_places(scene, path)[0] for path in paths]
    units = [natural_unit(scene, place) for place in places]
    return ModeDerivatives(natural_modes(scene), *matrix_derivatives(scene, [(place,) for place in places], units))


def damped() -> Scene:
    joints = {"pendulum[0].links[0].damping": 300.0, "pendulum[0].links[1].drag": 4.0, "support.damping": 90.0}
    return vary(load("crane-hook"), joints)


@pytest.mark.parametrize("name", ["crane-hook", "chain-3", "paper-cart-2", "metronomes"])
def test_undamped_ones_are_the_sensitivities_in_closed_form(name: str) -> None:
    scene = load(name).conservative
    modes = natural_modes(scene)
    paths = ["gravity", "pendulum[0].links[0].mass", "pendulum[0].links[0].length"]
    derivatives = derived(scene, paths)
    sizes = next(link.count for link in scene.pendulum[0].links)
    checked = 0
    for row in range(len(modes)):
        if modes.multiplicity[row] > 1 or modes.omega[row] == 0:
            continue
        closed = sensitivities(modes, row)
        links = scene.pendulum[0].n_links
        indices = [k * links + i for k in range(scene.pendulum[0].count) for i in range(sizes)]
        expected = [closed.gravity, closed.mass[indices].sum(), closed.length[indices].sum()]
        slope, _ = polar(complex(modes.eigenvalue[row]), derivatives.eigenvalue(row))
        assert np.allclose(slope, expected, rtol=1e-9, atol=1e-12 * modes.omega[row])
        checked += 1
    assert checked


def exact_pair(scene: Scene, near: complex) -> tuple[mpmath.mpc, list[mpmath.mpc]]:
    """The eigenvalue nearest to one and its shape, scaled to 1 in the last coordinate, in 40 digits."""
    model = matrices(scene)
    M, K, D = (mpmath.matrix(part.tolist()) for part in (model.M, model.K, model.D))
    n, inverse = M.rows, M**-1
    A = mpmath.zeros(2 * n)
    for i in range(n):
        A[i, n + i] = 1
    A[n:, :n], A[n:, n:] = -inverse * K, -inverse * D
    values, vectors = mpmath.eig(A)
    at = min(range(2 * n), key=lambda k: abs(values[k] - near))
    return values[at], [vectors[i, at] / vectors[n - 1, at] for i in range(n)]


@pytest.mark.parametrize("path", ["gravity", "pendulum[0].links[0].length", "pendulum[0].links[0].damping"])
def test_damped_ones_are_those_of_forty_digits(path: str) -> None:
    scene = damped()
    derivatives, modes = derived(scene, [path]), natural_modes(scene)
    row = int(np.flatnonzero(modes.eigenvalue.imag > 0)[-1])
    value = number_at(scene, find_places(scene, path)[0])
    h = 2.0**-20 * value
    with mpmath.workdps(40):
        (high, up), (low, down) = (
            exact_pair(vary(scene, {path: value + s * h}), modes.eigenvalue[row]) for s in (1, -1)
        )
        slope = complex((high - low) / (2 * h))
        shape = np.array([complex((a - b) / (2 * h)) for a, b in zip(up, down, strict=True)])
    assert abs(derivatives.eigenvalue(row)[0] / slope - 1) < 1e-9
    phi, by, by_value = derivatives.shape(row)
    assert abs(by_value[0] / slope - 1) < 1e-9
    scaled = by[:, 0] / phi[-1] - phi * by[-1, 0] / phi[-1] ** 2
    assert np.abs(scaled - shape).max() < 1e-8 * np.abs(shape).max()


def test_a_frequency_shared_by_equal_pendula_has_a_derivative_by_all_of_them_and_splits_by_one() -> None:
    scene = load("chain-2")
    pair = scene.replace(pendulum=(scene.pendulum[0], scene.pendulum[0]))
    both = load("chain-2").replace(pendulum=(scene.pendulum[0].replace(count=2),))
    alone = derived(scene, ["gravity", "pendulum[0].links[0].length"])
    together = derived(both, ["gravity", "pendulum[0].links[0].length"])
    apart = derived(pair, ["gravity", "pendulum[0].links[0].length"])
    for row in (0, 1):
        assert together.modes.multiplicity[row] == 2
        assert np.allclose(together.eigenvalue(row), alone.eigenvalue(row), rtol=1e-12)
        assert np.allclose(apart.eigenvalue(row)[0], alone.eigenvalue(row)[0], rtol=1e-12)
        assert np.isnan(apart.eigenvalue(row)[1])


def test_damped_sensitivities_in_closed_form_are_those_of_the_matrices() -> None:
    cart = ("mass", "damping")
    first, second = ("mass", "length", "damping"), ("mass", "length", "drag")
    paths = [f"support.{name}" for name in cart] + [f"pendulum[0].links[0].{name}" for name in first]
    paths += [f"pendulum[0].links[1].{name}" for name in second] + ["gravity"]
    derivatives = derived(damped(), paths)
    assert np.count_nonzero(derivatives.modes.eigenvalue.real) == 3
    for row in range(1, 4):
        exact = sensitivities(derivatives.modes, row)
        closed = [exact.cart_mass, exact.cart_damping, *(getattr(exact, name)[0] for name in first)]
        closed += [*(getattr(exact, name)[1] for name in second), exact.gravity]
        slope, ratio = polar(complex(derivatives.modes.eigenvalue[row]), derivatives.eigenvalue(row))
        sizes = np.abs([number_at(damped(), find_places(damped(), path)[0]) for path in paths])
        np.testing.assert_allclose(sizes * closed, sizes * slope, rtol=1e-9, atol=1e-11 * derivatives.modes.omega[row])
        assert np.any(ratio) == (derivatives.modes.eigenvalue[row].imag != 0)


def test_difference_quotients_of_squares_are_exact_at_zero_and_elsewhere() -> None:
    scene = load("crane-hook")

    def square(scene: Scene) -> tuple[np.ndarray, ...]:
        return (np.array([3 * scene.support.damping**2 + 5 * scene.support.damping + 1]),)

    place = find_places(scene, "support.damping")[0]
    assert differences(scene, place, 7.0, square)[0] == pytest.approx(5, rel=1e-14)
    moved = vary(scene, {"support.damping": 2.0})
    assert differences(moved, place, 7.0, square)[0] == pytest.approx(17, rel=1e-14)


def test_a_count_is_no_number_with_a_derivative() -> None:
    scene = load("chain-3")
    with pytest.raises(SceneError, match="count"):
        differences(scene, ("pendulum", 0, "links", 0, "count"), 1.0, lambda varied: (np.zeros(1),))
