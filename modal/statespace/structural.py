"""Frequency responses by elimination of the whole, in any arithmetic: a fixed support or a cart is a structure, too.

    (K + iωD − ω²M) q = F,      y = (Y0 + iω Y1 − ω² Y2) q + thrust

over q = (η, θ_1, …): for a force F of each input, ω²p − iωw for the ground displaced by 1 m, p and w being the momentum
and the windage of everything at unit velocity along the rail, and −(K + iωD − ω²M)_x for a prescribed cart x, whose row
is left out.  The matrices are the squares of the scene (`modal.assembly.squares`), in the elimination's arithmetic.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from modal.assembly import SPRING, Dissipator, Rig, loss_at, scene_squares
from modal.eigen import Arithmetic
from modal.scene import Scene
from modal.statespace.geometry import Geometry
from modal.statespace.points import is_point, point_input, pushed
from modal.statespace.signals import PRESCRIBED, PUSHES, READINGS, OutputGroup, Signal
from modal.types import Booleans, Floats


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


def row_in(dissipator: Dissipator, size: int, numbers: Arithmetic) -> Any:
    """The generalized force (size, 1) of a pair of unit forces along the row of a dissipator."""
    return numbers.number(_dense(dissipator, size))[:, None]


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


def inputs_named(scene: Scene, geometry: Geometry, signals: Sequence[Signal | Dissipator]) -> list[Given]:
    """What these inputs are; KeyError for an unknown name."""
    none = np.zeros(geometry.size), np.zeros(len(geometry.tips))
    every: dict[str, Given] = {}
    for group in (make(geometry) for make in PUSHES.values()):
        for k, signal in enumerate(group.signals):
            every[signal.name] = Given(group.F[:, k], group.thrust[:, k])
    for name, (held, order) in PRESCRIBED.items():
        every[name] = Given(*none, "cart" if held else "ground", order)
    pushes = []
    for wanted in signals:
        if isinstance(wanted, Dissipator):
            pushes.append(Given(_dense(wanted, geometry.size), none[1]))
        elif is_point(wanted.name):
            at_point = pushed(geometry, point_input(scene, wanted.name))
            pushes.append(Given(at_point.F[:, 0], at_point.thrust[:, 0]))
        else:
            pushes.append(every[wanted.name])
    return pushes


def outputs_named(geometry: Geometry, signals: Sequence[Signal]) -> list[Reading]:
    """What these outputs are; KeyError for an unknown name."""
    every: dict[str, Reading] = {}
    for group in (make(geometry) for make in READINGS.values()):
        for k, signal in enumerate(group.signals):
            every[signal.name] = _reading(group, k)
    return [every[signal.name] for signal in signals]


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
    read: Sequence[Reading],
    dampers: Any = None,
    losses: Sequence[Dissipator] = (),
) -> Callable[[Arithmetic], Any]:
    """The evaluation (p, m, W) of outputs for inputs, each divided by the power of iω that its order is.

    `dampers` are those of modes (n, n), in decimals; `losses` are all loss angles.
    """
    pulling = [loss for loss in losses if loss.kind == SPRING]
    held, pattern = int(any(push.moves == "cart" for push in driven)), _filled(rig)
    for loss in losses:
        pattern[np.ix_(list(loss.row), list(loss.row))] = True
    is_damped = rig.is_damped or dampers is not None

    def evaluate(numbers: Arithmetic) -> Any:
        squares = scene_squares(rig, numbers.number)
        M, K, D = (matrix[..., None] for matrix in squares.matrices)
        omega, felt = numbers.omega, numbers.felt
        square = omega * omega
        if dampers is not None:
            D = D + numbers.exact(dampers)[..., None]
        if losses:
            K = K + numbers.imaginary(loss_matrix(losses, len(K), numbers))
        A = felt(K + numbers.imaginary(D) * omega - square * M if is_damped else K - square * M)
        zero, none = 0 * omega, 0 * A[:, :1]
        moved = square * squares.momentum[:, None]
        if geometry.drag.any():
            moved = moved - numbers.imaginary(squares.windage[:, None]) * omega
        columns = [
            moved if push.moves == "ground"
            else -A[:, 0] if push.moves == "cart"
            else numbers.number(push.F)[:, None]
            for push in driven
        ]  # fmt: skip
        F = np.stack([column + none[:, 0] for column in columns], axis=1)
        q = np.array(F)
        filled = None if dampers is not None else pattern[held:, held:]
        q[held:] = solved(A[held:, held:], F[held:], numbers, filled)
        if held:
            q[0] = np.array([zero + int(push.moves == "cart") for push in driven])
        carried = np.array([zero + int(push.moves == "ground") for push in driven])
        powers = [1, numbers.imaginary(omega) if is_damped else None, -square]
        outputs = []
        for row in read:
            output = 0 * q[0]
            for order, part in enumerate(row.rows):
                if part is not None:
                    moved = (numbers.number(part)[:, None, None] * q).sum(0)
                    output = output + powers[order - row.order] * moved
            translation, order = row.moved
            if translation:
                output = output + powers[order - row.order] * numbers.number(translation) * carried
            for spring in pulling if row.pulls is not None else ():
                pull = row.pulls[spring.number] * spring.stiffness  # type: ignore[index]
                longer = (row_in(spring, len(q), numbers)[:, None] * q).sum(0)
                output = output + numbers.imaginary(numbers.number(pull * loss_at(spring.loss, numbers.rates)) * longer)
            if row.pendulum is not None:
                for i in np.flatnonzero(geometry.pendulum == row.pendulum):
                    if geometry.drag[i]:
                        output = output - powers[1] * numbers.number(geometry.drag[i]) * carried
                    moved = (numbers.number(geometry.centres[i])[:, None, None] * q).sum(0)
                    output = output + square * numbers.number(geometry.mass[i]) * (moved + carried)
                output = output + numbers.number(np.array([push.thrust[row.pendulum] for push in driven]))[:, None]
            outputs.append(felt(output))
        return np.array(outputs)

    return evaluate


def _filled(rig: Rig) -> Booleans:
    """Which entries (n, n) of M, K or D are not 0: pendula meet in springs and the structure alone."""
    M, K, D = scene_squares(rig).matrices
    return np.asarray((M != 0) | (K != 0) | (D != 0))


def solved(A: Any, F: Any, numbers: Arithmetic, filled: Booleans | None = None) -> Any:
    """A⁻¹ F (n, m, W) of a symmetric A (n, n, W), the last row first.

    `filled` (n, n) tells where A is not 0; None for anywhere.
    """
    A, F, size = np.array(A), np.array(F), len(A)
    rows, diagonal = [], [A[k, k] for k in range(size)]
    there = None if filled is None else filled.copy()
    for k in range(size - 1, -1, -1):
        P = numbers.pivot(A[k, k], diagonal[k])
        at: Any = slice(k) if there is None else np.flatnonzero(there[k, :k])
        block = (at, at) if there is None else np.ix_(at, at)
        row = numbers.felt(A[k, at] / P)
        A[block] = numbers.felt(A[block] - A[at, k][:, None] * row)
        F[at] = numbers.felt(F[at] - row[:, None] * F[k])
        F[k] = numbers.felt(F[k] / P)
        rows.append((at, row))
        if there is not None:
            there[block] = True
    for k, (at, row) in enumerate(rows[::-1]):
        if len(row):
            F[k] = numbers.felt(F[k] - (row[:, None] * F[at]).sum(0))
    return F
