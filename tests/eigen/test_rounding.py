"""What rounding must not decide: orders of elimination, exact zeros, what has cancelled, and bounds that say so."""

from __future__ import annotations

import numpy as np
import pytest

from modal import Bob, ComputationError, Pendulum, Scene
from modal.assembly import rig_of
from modal.eigen import dense, product, trees
from modal.eigen.components import StillGroup

EPS = np.finfo(float).eps


def graded(seed: int, rows: int, columns: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return 10 ** rng.uniform(-6, 6, (rows, 1)) * rng.normal(size=(rows, columns)) * 10 ** rng.uniform(-3, 3, columns)


@pytest.mark.parametrize("seed", range(4))
def test_a_triangle_has_its_largest_columns_first(seed: int) -> None:
    """The definition of QR with pivoting: R_jj² is at least the sum of squares of what is left of each later column."""
    F = graded(seed, 6, 4)
    R, order = product._triangular(product._sort_rows(F))
    left = np.cumsum(R[::-1] ** 2, axis=0)[::-1]
    assert all(R[j, j] ** 2 >= left[j, j:].max() * (1 - 1e-12) for j in range(4))
    np.testing.assert_allclose(abs(R), abs(np.linalg.qr(F[:, order])[1]), rtol=1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_complete_pivoting_leaves_no_entry_above_one(seed: int) -> None:
    """Neither factor next to the diagonal has an entry above 1, so that both are well conditioned."""
    G = graded(seed, 6, 4)
    L, d, U = product._complete_pivoting(G, 4)
    assert max(abs(L).max(), abs(U).max()) <= 1
    assert np.all(np.diff(abs(d)) < 0)
    np.testing.assert_allclose((L * d) @ U, G, rtol=1e-9, atol=1e-12 * abs(G).max())


def test_a_pivot_of_zero_counts_as_below() -> None:
    """One bob with a spring, D = g/l + s/(m l²) − x in units of 1: at x = 2 it has no sign but the nudge's."""
    links = (Bob(mass=1.0, length=1.0, stiffness=1.0),)
    (block,) = rig_of(Scene(gravity=1.0, pendulum=[Pendulum(links=links)])).blocks
    x = np.array([np.nextafter(2.0, 0.0), 2.0, np.nextafter(2.0, 3.0)])
    below, mass = trees.sprung_count_and_mass(block, x)
    assert below.tolist() == [[0, 1, 1]]
    assert np.sign(mass).tolist() == [[1, -1, -1]]


@pytest.mark.parametrize(("turn", "pushes"), [(0.0, False), (2.0**-49, False), (2.0**-47, True), (0.1, True)])
def test_a_push_that_has_cancelled_is_none(turn: float, pushes: bool) -> None:
    """The push √count less its part along `moving`, which is turned away from it by a small angle."""
    counts = np.array([1, 4, 4])
    moving = np.cos(turn) * np.array([[1.0], [2.0], [2.0]]) / 3 + np.sin(turn) * np.array([[2.0], [1.0], [-2.0]]) / 3
    group = StillGroup.of(0, np.arange(3), counts, moving)
    assert (group.pushes, group.number) == (pushes, 2)
    np.testing.assert_allclose(group.moving.T @ group.moving, np.eye(1 + pushes), atol=1e-15)


def test_undamped_modes_are_refused_where_their_bound_says_nothing() -> None:
    """Of K = 1 and M = diag(1, d) it is 4ε (1 + (1 + d)/ω⁻²): half of ω at the limit, a few roundings for d = 1/2."""
    with pytest.raises(ComputationError, match="spread too far"):
        dense.undamped_modes(np.diag([1.0, 7 * EPS]), np.eye(2), np.diag([1.0, 7 * EPS]), singular=False)
    last = dense.undamped_modes(np.diag([1.0, 9 * EPS]), np.eye(2), np.diag([1.0, 9 * EPS]), singular=False)
    assert 0.25 < last.error.max() < 0.5
    easy = dense.undamped_modes(np.diag([1.0, 0.5]), np.eye(2), np.diag([1.0, 0.5]), singular=False)
    np.testing.assert_allclose(easy.eigenvalue.imag, [1.0, np.sqrt(2)], rtol=EPS)
    np.testing.assert_allclose(easy.error, 4 * EPS * np.array([2.5, 4.0]), rtol=1e-12)
