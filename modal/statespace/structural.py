"""Frequency responses by elimination of the full matrices, in any arithmetic, for any support.

    (K + iωD − ω²M) q = F,      y = (Y0 + iω Y1 − ω² Y2) q + thrust

over q = (η, θ_1, …): for a force F of each input, ω²p − iωw for the ground displaced by 1 m, p and w being the total
momentum and drag at unit velocity along the rail, and −(K + iωD − ω²M)_x for a prescribed cart x, whose row is omitted.
The matrices are the squares of the scene (`modal.assembly.squares`), in the elimination's arithmetic.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from decimal import Context, Decimal, localcontext
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from modal.assembly import SPRING, Dissipator, Rig, loss_at, losses_of, ratio_at, rig_of, scene_squares
from modal.eigen import REFINED_DIGITS, Arithmetic, Digits
from modal.scene import Scene
from modal.statespace.geometry import Geometry, geometry_of_rig
from modal.statespace.model import without_carrier
from modal.statespace.signals import (
    PRESCRIBED,
    PUSHES,
    READINGS,
    OutputGroup,
    Signal,
    by_name,
    input_at_point,
    is_point,
    point_input,
)
from modal.types import Booleans, Floats

MOST_IN_DIGITS = 40
"""Limit: coordinates for which D_modal is computed in digits; beyond, a response with it is that of its modes."""


class Given(NamedTuple):
    """An input: its generalized force (q,) and that on every pendulum, or what it moves, and its order."""

    F: Floats
    thrust: Floats
    moves: str = ""
    order: int = 0


class Reading(NamedTuple):
    """An output: rows (q,) that multiply q, q' and q'', the lowest being of `order`; `moved` is added by the ground.

    `pulls` (springs,) are the parts of the forces of springs between points in it.
    """

    rows: tuple[Floats | None, ...]
    order: int
    moved: tuple[float, int]
    pendulum: int | None
    pulls: Floats | None = None


def _dense(dissipator: Dissipator, size: int) -> Floats:
    row = np.zeros(size)
    row[list(dissipator.row)] = list(dissipator.row.values())
    return row


def loss_matrix(losses: Sequence[Dissipator], size: int, numbers: Arithmetic) -> Any:
    """Im K (size, size, W) = Σ k φ r rᵀ."""
    matrix = numbers.number(np.zeros((size, size, 1))) + 0 * numbers.omega
    for dissipator in losses:
        at, entries = list(dissipator.row), numbers.number(list(dissipator.row.values()))
        strength = numbers.number(dissipator.stiffness * loss_at(dissipator.loss, numbers.rates))
        matrix[np.ix_(at, at)] = matrix[np.ix_(at, at)] + (entries[:, None] * entries)[..., None] * strength
    return matrix


def find_inputs(scene: Scene, geometry: Geometry, signals: Sequence[Signal | Dissipator]) -> list[Given]:
    """The definitions of these inputs; raise KeyError for an unknown name."""
    none = np.zeros(geometry.size), np.zeros(len(geometry.tips))
    groups, pushes = by_name(PUSHES, geometry), []
    for signal in signals:
        if isinstance(signal, Dissipator):
            pushes.append(Given(_dense(signal, geometry.size), none[1]))
        elif is_point(signal.name):
            at_point = input_at_point(geometry, point_input(scene, signal.name))
            pushes.append(Given(at_point.F[:, 0], at_point.thrust[:, 0]))
        elif signal.name in PRESCRIBED:
            is_cart, order = PRESCRIBED[signal.name]
            pushes.append(Given(*none, "cart" if is_cart else "ground", order))
        else:
            group, k = groups[signal.name]
            pushes.append(Given(group.F[:, k], group.thrust[:, k]))
    return pushes


def find_outputs(geometry: Geometry, signals: Sequence[Signal]) -> list[Reading]:
    """The definitions of these outputs; raise KeyError for an unknown name."""
    groups = by_name(READINGS, geometry)
    return [_reading(*groups[signal.name]) for signal in signals]


def _reading(group: OutputGroup, k: int) -> Reading:
    parts = (group.position, group.rate, None if group.pushed else group.acceleration)
    rows = tuple(None if part is None or not part[k].any() else part[k] for part in parts)
    translation = 0.0 if group.translation is None or group.pushed else float(group.translation[k])
    lowest = next((order for order, row in enumerate(rows) if row is not None), 0)
    pulls = None if group.pulls is None else group.pulls[k]
    return Reading(rows, 0 if group.pushed else lowest, (translation, group.order), k if group.pushed else None, pulls)


def structural_response(
    geometry: Geometry,
    rig: Rig,
    driven: Sequence[Given],
    outputs: Sequence[Reading],
    dampers: Any = None,
    losses: Sequence[Dissipator] = (),
) -> Callable[[Arithmetic], Any]:
    """The evaluation (p, m, W) of outputs for inputs, each divided by the power of iω that its order is.

    `dampers` are those of modes (n, n), in decimals; `losses` are all loss angles.
    """
    pulling = [loss for loss in losses if loss.kind == SPRING]
    n_prescribed = int(any(push.moves == "cart" for push in driven))
    pattern = np.any([part != 0 for part in scene_squares(rig).matrices], axis=0)
    for loss in losses:
        pattern[np.ix_(list(loss.row), list(loss.row))] = True
    is_damped = rig.is_damped or dampers is not None

    def evaluate(numbers: Arithmetic) -> Any:
        squares = scene_squares(rig, numbers.number)
        M, K, D = (matrix[..., None] for matrix in squares.matrices)
        omega, combine = numbers.omega, numbers.round_off
        square = omega * omega
        if dampers is not None:
            D = D + numbers.exact(dampers)[..., None]
        if losses:
            K = K + numbers.imaginary(loss_matrix(losses, len(K), numbers))
        A = combine(K + numbers.imaginary(D) * omega - square * M if is_damped else K - square * M)
        zero, none = 0 * omega, 0 * A[:, :1]
        motion_force = square * squares.momentum[:, None]
        if geometry.drag.any():
            motion_force = motion_force - numbers.imaginary(squares.windage[:, None]) * omega
        columns = [
            motion_force if push.moves == "ground"
            else -A[:, 0] if push.moves == "cart"
            else numbers.number(push.F)[:, None]
            for push in driven
        ]  # fmt: skip
        F = np.stack([column + none[:, 0] for column in columns], axis=1)
        q = np.array(F)
        is_nonzero = None if dampers is not None else pattern[n_prescribed:, n_prescribed:]
        q[n_prescribed:] = solve_symmetric(A[n_prescribed:, n_prescribed:], F[n_prescribed:], numbers, is_nonzero)
        if n_prescribed:
            q[0] = np.array([zero + int(push.moves == "cart") for push in driven])
        ground_motion = np.array([zero + int(push.moves == "ground") for push in driven])
        read_off = _Answer(geometry, numbers, q, ground_motion, is_damped=is_damped)
        return np.array([combine(read_off.output(row, driven, pulling)) for row in outputs])

    return evaluate


class _Answer:
    """The coordinates q (n, m, W) for every input, and whether each displaces the ground, `carried` (m, W)."""

    def __init__(self, geometry: Geometry, numbers: Arithmetic, q: Any, ground_motion: Any, *, is_damped: bool) -> None:
        self.geometry, self.numbers, self.q, self.carried = geometry, numbers, q, ground_motion
        self.powers = [1, numbers.imaginary(numbers.omega) if is_damped else None, -(numbers.omega * numbers.omega)]

    def product(self, row: Floats) -> Any:
        """A row (q,) times q, (m, W)."""
        return (self.numbers.number(row)[:, None, None] * self.q).sum(0)

    def output(self, row: Reading, driven: Sequence[Given], pulling: Sequence[Dissipator]) -> Any:
        """An output (m, W) for every input."""
        number, output = self.numbers.number, 0 * self.q[0]
        for order, part in enumerate(row.rows):
            if part is not None:
                output = output + self.powers[order - row.order] * self.product(part)
        translation, order = row.moved
        if translation:
            output = output + self.powers[order - row.order] * number(translation) * self.carried
        for spring in pulling if row.pulls is not None else ():
            pull = row.pulls[spring.number] * spring.stiffness  # type: ignore[index]
            loss_part = number(pull * loss_at(spring.loss, self.numbers.rates)) * self.product(
                _dense(spring, len(self.q))
            )
            output = output + self.numbers.imaginary(loss_part)
        return output if row.pendulum is None else self._on_pivot(output, row.pendulum, driven)

    def _on_pivot(self, output: Any, pendulum: int, driven: Sequence[Given]) -> Any:
        """The other forces on a pivot: inertia, drag, and the forces on the pendulum."""
        geometry, number = self.geometry, self.numbers.number
        for i in np.flatnonzero(geometry.pendulum == pendulum):
            if geometry.drag[i]:
                output = output - self.powers[1] * number(geometry.drag[i]) * self.carried
            displacement = self.product(geometry.centres[i]) + self.carried
            output = output - self.powers[2] * number(geometry.mass[i]) * displacement
        return output + number(np.array([push.thrust[pendulum] for push in driven]))[:, None]


def solve_symmetric(A: Any, F: Any, numbers: Arithmetic, is_nonzero: Booleans | None = None) -> Any:
    """A⁻¹ F (n, m, W) of a symmetric A (n, n, W), the last row first.

    `is_nonzero` (n, n) says where A is not 0; None for everywhere.
    """
    A, F, size = np.array(A), np.array(F), len(A)
    rows, diagonal = [], [A[k, k] for k in range(size)]
    fill_in = None if is_nonzero is None else is_nonzero.copy()
    for k in range(size - 1, -1, -1):
        P = numbers.pivot(A[k, k], diagonal[k])
        at: Any = slice(k) if fill_in is None else np.flatnonzero(fill_in[k, :k])
        block = (at, at) if fill_in is None else np.ix_(at, at)
        row = numbers.round_off(A[k, at] / P)
        A[block] = numbers.round_off(A[block] - A[at, k][:, None] * row)
        F[at] = numbers.round_off(F[at] - row[:, None] * F[k])
        F[k] = numbers.round_off(F[k] / P)
        rows.append((at, row))
        if fill_in is not None:
            fill_in[block] = True
    for k, (at, row) in enumerate(rows[::-1]):
        if len(row):
            F[k] = numbers.round_off(F[k] - (row[:, None] * F[at]).sum(0))
    return F


def whole_response(
    scene: Scene, inputs: Sequence[Signal | Dissipator], outputs: Sequence[Signal]
) -> tuple[Callable[[Arithmetic], Any], list[Given], list[Reading]]:
    """The evaluation (p, m, W) of a whole scene, with the definitions of its inputs and outputs."""
    rig = rig_of(scene).on_structure
    geometry = geometry_of_rig(rig)
    driven, outputs_read = find_inputs(scene, geometry, inputs), find_outputs(geometry, outputs)
    dampers: Any = None
    if scene.has_modal_damping:
        is_prescribed = any(push.moves == "cart" for push in driven)
        dampers = _pad_above(in_digits(without_carrier(scene)), 1) if is_prescribed else in_digits(scene)
    losses = losses_of(scene) if scene.has_losses else []
    return structural_response(geometry, rig, driven, outputs_read, dampers, losses), driven, outputs_read


def is_small(scene: Scene) -> bool:
    """Whether D_modal of this scene can be computed in decimals in seconds."""
    return scene.n_links + rig_of(scene).leading <= MOST_IN_DIGITS


# ------------------------------------------------------------------------------------------------------- D_modal


@lru_cache(maxsize=8)
def in_digits(scene: Scene) -> Any:
    """D_modal (n, n) in decimals."""
    rig = rig_of(scene)
    with localcontext(Context(prec=REFINED_DIGITS)):
        numbers = Digits(np.ones(1), REFINED_DIGITS, is_real=True)
        M, K, _ = scene_squares(rig, numbers.number).matrices
        free = int(rig.cart is not None and rig.cart.stiffness == 0)
        if free:
            M, K = M[1:, 1:] - M[1:, :1] * M[:1, 1:] / M[0, 0], K[1:, 1:]
        square, momentum = _modes(M, K)
        smallest = max(square).scaleb(-REFINED_DIGITS // 2)
        swings = [k for k, value in enumerate(square) if value > (smallest if rig.structure else 0)]
        omega = [square[k].sqrt() for k in swings]
        ratios = ratio_at(rig)(np.array(omega, dtype=np.float64))
        strength = [2 * Decimal(ratio) * value for ratio, value in zip(ratios.tolist(), omega, strict=True)]
        C = momentum[:, swings]
        return _pad_above((C * np.array(strength, dtype=object)) @ C.T, free)


def _pad_above(D: Any, rows: int) -> Any:
    """A square matrix with as many rows and columns of zeros before it."""
    new_matrix = np.full((len(D) + rows,) * 2, Decimal(0), dtype=object)
    new_matrix[rows:, rows:] = D
    return new_matrix


def _modes(M: Any, K: Any) -> tuple[list[Decimal], Any]:
    """ω² of every mode with a mass and Mφ (n, R), φᵀMφ = 1; of a singular M from the factors of K."""
    L = _cholesky(M)
    if L is not None:
        square, V = _jacobi(_in_factors(L, K))
        return square, L @ V
    L = _cholesky(K)
    assert L is not None
    inverse, V = _jacobi(_in_factors(L, M))
    numbers = [k for k, value in enumerate(inverse) if value > max(inverse).scaleb(-REFINED_DIGITS // 2)]
    roots = np.array([inverse[k].sqrt() for k in numbers], dtype=object)
    return [1 / inverse[k] for k in numbers], (L @ V[:, numbers]) * roots


def _cholesky(S: Any) -> Any:
    """L with LLᵀ = S; None where S is singular to half the digits."""
    L = np.array(S)
    for k in range(len(L)):
        L[k, k + 1 :] = Decimal(0)
        square = L[k, k] - (L[k, :k] * L[k, :k]).sum()
        if square <= abs(S[k, k]).scaleb(-REFINED_DIGITS // 2):
            return None
        L[k, k] = square.sqrt()
        L[k + 1 :, k] = (L[k + 1 :, k] - (L[k + 1 :, :k] * L[k, :k]).sum(1)) / L[k, k]
    return L


def _in_factors(L: Any, S: Any) -> Any:
    """L⁻¹ S L⁻ᵀ."""
    return _forward(L, _forward(L, S).T)


def _forward(L: Any, S: Any) -> Any:
    solution = np.array(S)
    for k in range(len(L)):
        solution[k] = (solution[k] - (L[k, :k, None] * solution[:k]).sum(0)) / L[k, k]
    return solution


def _jacobi(S: Any) -> tuple[list[Decimal], Any]:
    """Eigenvalues and eigenvectors of a symmetric S."""
    S, size = (S + S.T) / 2, len(S)
    V: Any = np.frompyfunc(Decimal, 1, 1)(np.eye(size))
    has_rotated = True
    while has_rotated:  # each sweep squares the off-diagonal part
        has_rotated = False
        for i in range(size):
            for j in range(i + 1, size):
                if abs(S[i, j]) <= (abs(S[i, i] * S[j, j])).sqrt().scaleb(3 - REFINED_DIGITS):
                    continue
                has_rotated = True
                tau = (S[j, j] - S[i, i]) / (2 * S[i, j])
                t = (1 if tau >= 0 else -1) / (abs(tau) + (1 + tau * tau).sqrt())
                c = 1 / (1 + t * t).sqrt()
                s = c * t
                S[i], S[j] = c * S[i] - s * S[j], s * S[i] + c * S[j]
                S[:, i], S[:, j] = c * S[:, i] - s * S[:, j], s * S[:, i] + c * S[:, j]
                V[:, i], V[:, j] = c * V[:, i] - s * V[:, j], s * V[:, i] + c * V[:, j]
    return [S[k, k] for k in range(size)], V
