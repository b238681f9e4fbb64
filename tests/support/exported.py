"""What every export is held against: the table's poles, the matrices themselves; `test_exports.py` shows they bite."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from modal import Scene, load, natural_modes
from modal.statespace import StateSpace, state_space
from modal.statespace.sampling import sample

SCENES = ("crane-hook", "crane-two-loads", "paper-cart-2", "metronomes", "cart-upright", "chain-3")
EVERYTHING = ("cart_position", "angles", "rates", "tip_positions", "tip_accelerations", "pivot_forces")
DT = 0.01


def model_of(name: str, dt: float = 0.0) -> StateSpace:
    """A shipped scene with more outputs than states, so that no two sides agree in size, and a D that is not zero."""
    scene = load(name)
    on_cart = scene.support.kind == "cart"
    model = state_space(scene, ("cart_force", "link_forces") if on_cart else (), EVERYTHING[not on_cart :])
    assert model.D.any() or not on_cart
    return sample(model, dt) if dt else model


def expected_poles(scene: Scene) -> NDArray[np.complex128]:
    """Every pole that is not zero, from the table of modes."""
    modes = natural_modes(scene)
    moving = np.repeat(modes.eigenvalue, modes.multiplicity)
    moving = moving[moving != 0]
    damped = bool(np.any((moving.real != 0) & (moving.imag != 0)))
    if damped:
        pairs = moving[moving.imag != 0]
        return np.concatenate([pairs, pairs.conj(), moving[moving.imag == 0]])
    return np.concatenate([moving, -moving])


def assert_poles(A: Any, scene: Scene, dt: float = 0.0, relative: float = 1e-12) -> None:
    """The eigenvalues of A are the table's, exp(λ dt) where dt > 0, and what is left over stands still."""
    assert_spectrum(np.linalg.eigvals(np.asarray(A)), scene, dt, relative)


def assert_spectrum(eigenvalues: Any, scene: Scene, dt: float = 0.0, relative: float = 1e-12) -> None:
    """The same of eigenvalues."""
    eigenvalues = np.asarray(eigenvalues, dtype=complex)
    poles = expected_poles(scene)
    for pole in np.exp(poles * dt) if dt else poles:
        near = int(np.argmin(abs(eigenvalues - pole)))
        error = abs(eigenvalues[near] - pole)
        assert error <= relative * abs(pole), f"{eigenvalues[near]} beside {pole}"
        eigenvalues = np.delete(eigenvalues, near)
    assert np.all(abs(eigenvalues - bool(dt)) < 1e-6), f"left over: {eigenvalues}"


def assert_matrices(model: StateSpace, matrices: Sequence[Any]) -> None:
    """A, B, C and D to the last bit (zeros of either sign)."""
    for matrix, expected in zip(matrices, (model.A, model.B, model.C, model.D), strict=True):
        np.testing.assert_array_equal(np.asarray(matrix), expected, strict=True)


def names(signals: Sequence[Any]) -> list[str]:
    """Names in order."""
    return [signal.name for signal in signals]


def held_inputs(model: StateSpace, steps: int, seed: int = 0) -> NDArray[np.float64]:
    """Random inputs (m, steps)."""
    return np.random.default_rng(seed).normal(size=(len(model.inputs), steps))


def assert_close(values: Any, expected: Any, relative: float) -> None:
    """To a share of each row's largest value."""
    scale = np.abs(expected).max(axis=-1, keepdims=True)
    assert scale.max() > 0
    error = np.abs(np.asarray(values) - expected)
    assert np.all(error <= relative * np.maximum(scale, scale.max() * 1e-6)), float((error / scale.max()).max())
