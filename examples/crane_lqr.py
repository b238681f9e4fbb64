"""Feedback for the shipped cranes: LQR on the trolley's force, a Kalman filter that sees the trolley and the cables.

Run it with `python examples/crane_lqr.py`.  It prints the poles of the loop and asserts that
trolley and loads come to rest, starting 1 m beside the target and swinging.
"""

from __future__ import annotations

import control
import numpy as np

from modal import load, natural_modes
from modal.statespace import StateSpace, modal_gains, state_space, unreached, unseen

SETTLING = 60.0  # s
REST = 0.02  # of the largest deviation at the start


def lqr(model: StateSpace) -> np.ndarray:
    """K of u = −K z: 1 m and 0.1 rad count as much as 2 kN."""
    size = len(model.A) // 2
    weights = np.array([1.0, *np.full(size - 1, 100.0), *np.full(size, 1.0)])
    K, _, _ = control.lqr(model.A, model.B, np.diag(weights), np.eye(1) / 2000.0**2)
    return np.asarray(K)


def kalman(model: StateSpace) -> np.ndarray:
    """L of ẑ' = A ẑ + B u + L (y − C ẑ): wind on every rate, a sensor good to 1 cm and 1 mrad."""
    size = len(model.A) // 2
    noise = np.diag([1e-4, *np.full(len(model.C) - 1, 1e-6)])
    L, _, _ = control.lqe(model.A, np.eye(2 * size), model.C, 1e-3 * np.eye(2 * size), noise)
    return np.asarray(L)


def closed_loop(model: StateSpace, K: np.ndarray, L: np.ndarray) -> np.ndarray:
    """The matrix of (z, ẑ)' when the force is u = −K ẑ."""
    A, B, C = model.A, model.B, model.C
    return np.block([[A, -B @ K], [L @ C, A - B @ K - L @ C]])


def worked(name: str) -> float:
    """The largest deviation left after SETTLING, over that at the start."""
    scene = load(name)
    model = state_space(scene, ("cart_force",), ("cart_position", "angles"))
    gains = modal_gains(natural_modes(scene), model)
    assert unreached(gains) == unseen(gains) == ()
    K, L = lqr(model), kalman(model)
    whole = closed_loop(model, K, L)
    parts = [np.linalg.eigvals(model.A - model.B @ K), np.linalg.eigvals(model.A - L @ model.C)]
    print(f"{scene.title}\n{gains.text()}")
    for label, poles in zip(("regulator", "observer"), parts, strict=True):
        print(f"{label}: " + ", ".join(f"{p:.3f}" for p in sorted(poles, key=abs) if p.imag >= 0))
    assert np.linalg.eigvals(whole).real.max() < 0
    size = len(model.A)
    start = np.zeros(2 * size)
    start[0], start[1 : size // 2] = 1.0, 0.05
    loop = control.ss(whole, np.zeros((2 * size, 1)), np.eye(2 * size), 0)
    times = np.linspace(0.0, SETTLING, 6001)
    states = control.initial_response(loop, times, start).states
    left = float(np.abs(states[:size, -1]).max() / np.abs(states[:size, 0]).max())
    print(f"after {SETTLING:g} s {100 * left:.2g} % is left\n")
    assert left < REST
    return left


def main() -> None:
    """Both cranes."""
    for name in ("crane-hook", "crane-two-loads"):
        worked(name)


if __name__ == "__main__":
    main()
