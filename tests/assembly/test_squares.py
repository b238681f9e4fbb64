"""Squares of M, K and D in exact fractions: rows against sums known in closed form, and floats against both."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from structured_scenes import STRUCTURED

from modal import Scene, load, matrices
from modal.assembly import rig_of, scene_squares
from modal.assembly.squares import matrix
from modal.scene import ConstantForce

LEANING = load("chain-2").replace(force=(ConstantForce(on="pendulum[0].links[0]", amplitude=3.0),))
SCENES: dict[str, Scene] = (
    STRUCTURED | {name: load(name) for name in ("crane-hook", "paper-cart-2")} | {"leans": LEANING}
)


def fractions(values: object) -> np.ndarray:
    return np.asarray(np.frompyfunc(Fraction, 1, 1)(np.asarray(values, dtype=float)))


@pytest.mark.parametrize("name", SCENES)
def test_squares_in_fractions_are_those_of_floats(name: str) -> None:
    scene = SCENES[name]
    squares, linear = scene_squares(rig_of(scene), fractions), matrices(scene.replace(damping_ratio=0.0))
    for exact, rounded in zip(squares.matrices, (linear.M, linear.K, linear.D), strict=True):
        assert (exact == exact.T).all()
        scale = np.abs(rounded).max() or 1.0
        np.testing.assert_allclose(exact.astype(float), rounded, rtol=1e-14, atol=1e-15 * scale)


@pytest.mark.parametrize("name", SCENES)
def test_sums_known_in_closed_form_are_those_of_the_rows(name: str) -> None:
    """To the last digit: nothing is rounded."""
    squares = scene_squares(rig_of(SCENES[name]), fractions)
    for parts in squares[:3]:
        rows = [part if part.rows is None else part._replace(total=None) for part in parts]
        assert (matrix(rows, squares.n, fractions) == matrix(parts, squares.n, fractions)).all()
