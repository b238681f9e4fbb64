"""The linear model along a hoist, z' = A(t) z + B(t) u, y = C z + D u, sampled in time.

States, inputs and outputs are those of `modal.statespace.model`; lengths and their rates enter A and B through
`modal.assembly.hoisting`.  Between two corners of a command and of the laws of lengths it is a matrix exponential where
lengths are constant, with u and its derivatives as further states; along a hoist it is integrated.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy
from numpy.typing import ArrayLike

from modal.assembly import Matrices, hoisting_of, instants, matrices_along, no_hoist
from modal.errors import ComputationError, SceneError
from modal.report import Displayed
from modal.scene import Scene, validate_scene
from modal.statespace.model import StateSpace, assembled
from modal.statespace.signals import Signal
from modal.types import Floats, Ints

SAMPLES = 201
MOST_NUMBERS = 50_000_000
MOST_SWINGS = 1e5  # of the fastest mode during one law of length
POWERS = 6
"""Coefficients of a quintic."""
TOLERANCE = 1e-10
Command = Callable[[Floats], Floats]
JUMPING = {
    "cart_velocity": "cart_acceleration",
    "support_velocity": "support_acceleration",
    "support_displacement": "support_acceleration",
}
"""Inputs whose models would need the change of the mass matrix along a hoist, and what to use."""


@dataclass(frozen=True, eq=False, repr=False)
class VaryingModel(Displayed):
    """A (T, n, n) and B (T, n, m) at `times` (T,) in s; C (p, n) and D (p, m), with times in front where they vary.

    Everything else is as in `StateSpace`.
    """

    times: Floats
    A: Floats
    B: Floats
    C: Floats
    D: Floats
    states: tuple[Signal, ...]
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    title: str
    operating_point: tuple[tuple[str, float], ...]
    scene: Scene


def hoisting_times(scene: Scene, samples: int = SAMPLES) -> Floats:
    """Evenly spaced times (samples,) in s from the begin of the first hoist to the end of the last.

    SceneError for a scene without a hoist.
    """
    hoisting = hoisting_of(validate_scene(scene))
    if hoisting is None:
        raise no_hoist(scene)
    if samples < 2:
        raise SceneError([f"samples {samples}: must be at least 2"])
    return np.linspace(hoisting.breaks[0], hoisting.breaks[-1], samples)


def varying_model(
    scene: Scene,
    times: ArrayLike | None = None,
    inputs: tuple[str, ...] = (),
    outputs: tuple[str, ...] = (),
) -> VaryingModel:
    """The model of a scene with a hoist at these times (T,) in s, by default `hoisting_times`.

    Raises SceneError for a scene without one and for a prescribed velocity of the cart or displacement
    of the support, else as `state_space`.
    """
    usual = hoisting_times(scene)
    at = usual if times is None else np.atleast_1d(np.asarray(times, dtype=np.float64))
    if at.ndim != 1 or not np.all(np.isfinite(at)) or np.any(np.diff(at) <= 0):
        raise SceneError(["times: must be ascending times in seconds"])
    problems = [
        f"input {name}: along a hoist its model would need the change of the mass matrix; use {JUMPING[name]}"
        for name in inputs
        if name in JUMPING
    ]
    if problems:
        raise SceneError(problems)
    along = instants(scene)

    def model(time: float) -> StateSpace:
        return assembled(scene.at(time), along(time), inputs, outputs)

    first = model(float(at[0]))
    if len(at) * (first.A.size + first.B.size) > MOST_NUMBERS:
        raise ComputationError(f"a model of {len(first.A)} states at {len(at)} times is too large: use fewer times")
    each = [first, *map(model, at[1:].tolist())]
    A, B, C, D = (np.array([getattr(sampled, name) for sampled in each]) for name in "ABCD")
    return VaryingModel(
        at, A, B, _constant(C), _constant(D), first.states, first.inputs, first.outputs, scene.title,
        first.operating_point, scene,
    )  # fmt: skip


def model_at(scene: Scene, time: float, inputs: tuple[str, ...] = (), outputs: tuple[str, ...] = ()) -> StateSpace:
    """The model at one time (s), in which the speeds and accelerations of the lengths are damping and stiffness."""
    return assembled(scene.at(time), instants(scene)(time), inputs, outputs)


def _constant(values: Floats) -> Floats:
    return np.asarray(values[0]) if np.array_equal(values, np.broadcast_to(values[0], values.shape)) else values


# -------------------------------------------------------------------------------------------------------- motion


def motion_history(
    scene: Scene,
    command: Command,
    times: Floats,
    stops: Sequence[float],
    *,
    pushed: int | None,
    size: float,
    start: Floats | float = 0.0,
) -> Floats:
    """(q, q') (T, 2n) at ascending times (T,) from `start` at the first on, the `stops` of the command among them.

    Between its stops the `command` is a quintic: the force on the coordinate `pushed`, or (None) the acceleration of a
    cart whose motion is prescribed.  `size` is that of the motion.
    """
    along, hoisting = matrices_along(scene), hoisting_of(scene)
    breaks = hoisting.breaks if hoisting else ()
    spans = [getattr(law, "breaks", (-np.inf, np.inf)) for _, law in hoisting.laws] if hoisting else []
    states = np.zeros((len(times), 2 * len(along(float(times[0])).M)))
    n = states.shape[1] // 2
    states[0] = start
    corners = np.unique([times[0], *stops, *breaks, times[-1]])
    for begin, end in pairwise(corners[(corners >= times[0]) & (corners <= times[-1])].tolist()):
        rows = np.flatnonzero((times >= begin) & (times <= end))
        if not any(span[0] < end and begin < span[-1] for span in spans):
            _advance(states, times, rows, pushed_by(along((begin + end) / 2), pushed), command)
            continue
        swings = (
            (end - begin) * float(np.linalg.norm(pushed_by(along(begin), pushed)[0][:, :n], 2)) ** 0.5 / (2 * np.pi)
        )
        if not swings <= MOST_SWINGS:
            raise ComputationError(f"the hoist takes {swings:.3g} swings: at most {MOST_SWINGS:g} are followed")

        def slope(time: float, state: Floats, last: float = float(np.nextafter(end, begin))) -> Floats:
            A, B = pushed_by(along(min(time, last)), pushed)
            return np.concatenate((state[n:], A @ state + B * command(np.array([time]))[0]))

        solved = scipy.integrate.solve_ivp(
            slope,
            (begin, end),
            states[rows[0]],
            method="DOP853",
            t_eval=times[rows],
            rtol=TOLERANCE,
            atol=TOLERANCE * 1e-3 * size,
        )
        if not solved.success:
            raise ComputationError(f"the motion along the hoist cannot be integrated: {solved.message}")
        states[rows] = solved.y.T
    return states


def _advance(states: Floats, times: Floats, rows: Ints, equations: tuple[Floats, Floats], command: Command) -> None:
    """Fill in the states at these rows but the first, of constant equations and a command without a corner."""
    known: dict[float, tuple[Floats, Floats]] = {}
    for row in rows[1:].tolist():
        begin, end = times[row - 1], times[row]
        step = round(float(end - begin), 12)
        if step not in known:
            known[step] = _step(*equations, float(end - begin))
        free, driven = known[step]
        states[row] = free @ states[row - 1] + driven @ command(np.linspace(begin, end, POWERS + 2)[1:-1])


def _step(A: Floats, B: Floats, duration: float) -> tuple[Floats, Floats]:
    """What becomes of (q, q') (2n, 2n), and of a quintic by its values inside (2n, POWERS), in a time."""
    n = len(B)
    whole = np.zeros((2 * n + POWERS,) * 2)
    whole[:n, n : 2 * n] = np.eye(n) * duration
    whole[n : 2 * n, : 2 * n] = A * duration
    whole[n : 2 * n, 2 * n] = B * duration
    whole[2 * n :, 2 * n :] = np.eye(POWERS, k=1)
    moved = scipy.linalg.expm(whole)[: 2 * n]
    inside = np.linspace(0.0, 1.0, POWERS + 2)[1:-1]
    rows = inside[:, None] ** np.arange(POWERS) / scipy.special.factorial(np.arange(POWERS))
    return moved[:, : 2 * n], np.linalg.solve(rows.T, moved[:, 2 * n :].T).T


def pushed_by(linear: Matrices, pushed: int | None) -> tuple[Floats, Floats]:
    """A (n, 2n) and B (n,) of q'' = A (q, q') + B u, u the force on a coordinate, else the acceleration of a cart."""
    held = pushed is None
    n, first = len(linear.M), int(held)
    force = -linear.M[:, 0] if held else np.eye(n)[pushed or 0]
    right = np.hstack((-linear.K, -linear.D, force[:, None]))[first:]
    solved = np.eye(n, 2 * n + 1, 2 * n) if held else np.zeros((n, 2 * n + 1))
    solved[first:] = np.linalg.solve(linear.M[first:, first:], right)
    return solved[:, :-1], solved[:, -1]
