"""Frequency responses by elimination of the whole: of scenes with damping ratios, whose D is full, and of some others.

These are scenes that lean under constant forces, and any with inputs at points.

    (K + iωD − ω²M) q = F − (K + iωD − ω²M)_x x + ω²p s

over q = (x, θ_1, …), with the force F of each input, a prescribed cart x, whose row is left out, or the momentum p of
everything at unit velocity along the rail, for a support displaced by s.  M, K and D are assembled from the numbers of
the scene in the arithmetic of the elimination, and the modes in D_modal = Σ 2ζω (Mφ)(Mφ)ᵀ are computed in DIGITS digits
by Jacobi's method (Golub & Van Loan, Matrix Computations, §8.5), since K + iωD − ω²M passes on above the modes what D
does and the other two do not.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from decimal import Context, Decimal, localcontext
from functools import lru_cache
from typing import Any

import numpy as np

from modal import pair
from modal.assembly import Dissipator, Rig, losses_of, ratio_at, rig_of
from modal.eigen import FORCE, TORQUE, Arithmetic, Digits
from modal.scene import Scene
from modal.statespace.model import fixed
from modal.statespace.places import BASE, GROUND, PUSH, SignalPlace
from modal.statespace.points import PointInput
from modal.statespace.signals import Signal, geometry_of_rig
from modal.statespace.structural import (
    Given,
    Reading,
    inputs_named,
    loss_matrix,
    matrices_in,
    outputs_named,
    row_in,
    solved,
    structural_response,
)

DIGITS, MOST = 80, 40
"""Digits of D_modal, and most coordinates for which they are computed."""
SWEEPS = 40


def full_response(
    scene: Scene, driven: Sequence[SignalPlace], read: Sequence[SignalPlace]
) -> Callable[[Arithmetic], Any]:
    """The evaluation (p, m, W) of displacements for displacements and forces."""
    rig = rig_of(scene)
    base = any(place.what == BASE for place in driven)
    first = int(rig.cart is not None)
    dampers: Any = None
    if scene.has_modal_damping:
        dampers = in_digits(fixed(scene) if base else scene)
        if base and first:
            dampers = _below(dampers, 1)
    losses = losses_of(scene) if scene.has_losses else []
    moved = [place.what == GROUND or (place.what == BASE and not first) for place in driven]
    prescribed = [place.what == BASE and first == 1 for place in driven]

    def evaluate(numbers: Arithmetic) -> Any:
        links, M, K, D, joints, centres = assembled(rig, numbers)
        square, omega, felt = numbers.omega * numbers.omega, numbers.omega, numbers.felt
        if dampers is not None:
            D = D + numbers.exact(dampers)[..., None]
        if losses:
            K = K + numbers.imaginary(loss_matrix(losses, len(K), numbers))
        A = felt(
            K + numbers.imaginary(D) * omega - square * M
            if rig.is_damped or scene.has_modal_damping
            else K - square * M
        )
        zero = 0 * omega
        momentum = (links.mass[:, None] * centres).sum(0) if not first else M[:, 0]
        loads = (_load(links, place, first, numbers, centres) for place in driven)
        F = np.array([[zero + value for value in load] for load in loads]) + 0 * A[0, 0]
        for k in range(len(driven)):
            F[k] = F[k] + square * momentum if moved[k] else F[k] - A[:, 0] if prescribed[k] else F[k]
        q = np.array(F.swapaxes(0, 1))
        held = int(base and first)
        q[held:] = solved(A[held:, held:], F.swapaxes(0, 1)[held:], numbers)
        if held:
            q[0] = np.array([zero + int(place) for place in prescribed])
        carried = np.array([zero + int(place) for place in moved])
        return np.array([_output(links, row, first, q, carried, joints, centres, driven, numbers) for row in read])

    return evaluate


def on_structure(
    scene: Scene, inputs: Sequence[Signal | Dissipator], outputs: Sequence[Signal]
) -> tuple[Callable[[Arithmetic], Any], list[Given], list[Reading]]:
    """The evaluation (p, m, W) for a scene on a structure, with what its inputs and outputs are."""
    rig = rig_of(scene)
    geometry = geometry_of_rig(rig)
    driven, read = inputs_named(scene, geometry, inputs), outputs_named(geometry, outputs)
    dampers: Any = None
    if scene.has_modal_damping:
        held = any(push.moves == "cart" for push in driven)
        dampers = _below(in_digits(fixed(scene)), 1) if held else in_digits(scene)
    losses = losses_of(scene) if scene.has_losses else []
    return structural_response(geometry, rig, driven, read, dampers, losses), driven, read


def is_small(scene: Scene) -> bool:
    """Whether D_modal of this scene can be computed in decimals in seconds."""
    return scene.n_links + rig_of(scene).leading <= MOST


class Links:
    """The links of all pendula in a row: numbers (n, 1), the pendulum of each and its first link."""

    def __init__(self, rig: Rig, numbers: Arithmetic) -> None:
        hung = [(rig.blocks[block], column) for block, column, copies in rig.members for _ in range(copies)]
        self.sizes = [block.n for block, _ in hung]
        self.firsts = np.cumsum([0, *self.sizes]).tolist()

        def row(name: str) -> Any:
            return numbers.number(np.concatenate([getattr(block, name)[:, column] for block, column in hung]))[:, None]

        self.mass, self.length, self.centre, self.inertia = map(row, ("mass", "length", "centre", "inertia"))
        self.across, self.stiffness, self.damping, self.drag = map(row, ("across", "stiffness", "damping", "drag"))
        self.leans, self.dragged = rig.leans, any(block.drag.any() for block, _ in hung)
        if rig.leans:
            rests = [(block.sinking[:, column], block.rest.held[:, column]) for block, column in hung]  # type: ignore[index, union-attr]
            sinking, held = (np.concatenate(part) for part in zip(*rests, strict=True))
            self.sinking, self.held = numbers.number(sinking)[:, None], numbers.number(held)[:, None]

    def span(self, pendulum: int) -> slice:
        """The links of a pendulum."""
        return slice(self.firsts[pendulum], self.firsts[pendulum + 1])


def assembled(rig: Rig, numbers: Arithmetic) -> tuple[Links, Any, Any, Any, Any, Any]:
    """The links, M, K and D without D_modal (n, n, 1), and the rows (links, n, 1) of lower joints and centres."""
    links, first = Links(rig, numbers), int(rig.cart is not None)
    size = first + len(links.mass)
    zero = numbers.number(np.zeros((size, size, 1)))
    M, K, D = zero + 0, zero + 0, zero + 0
    joints, centres = zero[first:] + 0, zero[first:] + 0
    joints[:, :first] = centres[:, :first] = numbers.number(1.0)
    gravity = numbers.number(rig.gravity)
    for p in range(len(links.sizes)):
        span = links.span(p)
        parts = (links.mass, links.length, links.centre, links.inertia, links.across)
        m, l, c, I, across = (part[span] for part in parts)
        q = slice(span.start + first, span.stop + first)
        ways = across[:, None] * across[None]
        if links.leans:
            ways = ways + links.sinking[span][:, None] * links.sinking[span][None]
            for i in range(len(m)):
                ways[i, i] = numbers.number(1.0)
        M[q, q] = np.array(pair.inertia_matrix(m, l, c, I)) * ways
        b = np.array(pair.first_moments(m, l, c)) * across
        if first:
            M[0, q] = M[q, 0] = b
            M[0, 0] = M[0, 0] + m.sum(0)
        for i in range(len(m)):
            at = q.start + i
            K[at, at] = K[at, at] + (links.held[span][i] if links.leans else gravity * b[i])
            joints[span.start + i, q.start : at + 1] = (across * l)[: i + 1]
            centres[span.start + i, q.start : at] = (across * l)[:i]
            centres[span.start + i, at] = across[i] * c[i]
            for S, strength in ((K, links.stiffness[span][i]), (D, links.damping[span][i])):
                S[at, at] = S[at, at] + strength
                if i:
                    S[at - 1, at - 1] = S[at - 1, at - 1] + strength
                    S[at, at - 1] = S[at, at - 1] - strength
                    S[at - 1, at] = S[at - 1, at] - strength
    if rig.cart is not None:
        M[0, 0] = M[0, 0] + numbers.number(rig.cart.mass)
        K[0, 0], D[0, 0] = numbers.number(rig.cart.stiffness), numbers.number(rig.cart.damping)
    if any(block.drag.any() for block in rig.blocks):
        D = D + (centres[:, :, None] * (links.drag[:, None] * centres)[:, None]).sum(0)
        if links.leans:
            sunk = _sinking(links, first, centres)
            D = D + (sunk[:, :, None] * (links.drag[:, None] * sunk)[:, None]).sum(0)
    return links, M, K, D, joints, centres


def _sinking(links: Links, first: int, centres: Any) -> Any:
    """The displacement downwards of every centre, (links, n, 1)."""
    sinking = 0 * centres
    if links.leans:
        for p in range(len(links.sizes)):
            span = links.span(p)
            for i in range(span.start, span.stop):
                sinking[i, first + span.start : first + i] = (links.sinking * links.length)[span.start : i]
                sinking[i, first + i] = links.sinking[i] * links.centre[i]
    return sinking


def _pushed(links: Links, point: PointInput, first: int, centres: Any, numbers: Arithmetic) -> Any:
    """The generalized force of an input at a point, (n, 1)."""
    force = 0 * centres[0]
    if not point.places:
        force[0] = force[0] + 1
    sinking = _sinking(links, first, centres) if point.direction == "vertical" else centres
    for link, above, below in point.places:
        at = first + link
        if point.direction == "torque":
            force[at] = force[at] + 1
            if below is None and above >= 0:
                force[at - 1] = force[at - 1] - 1
            continue
        sign, rows = (1, centres) if point.direction == "horizontal" else (-1, sinking)
        row = np.array(rows[link])
        if below is not None:
            way = links.across[link] if rows is centres else links.sinking[link] if links.leans else 0 * row[at]
            row[at] = way * numbers.number(below)
        force = force + sign * row
    return force


def _load(links: Links, place: SignalPlace, first: int, numbers: Arithmetic, centres: Any) -> Any:
    """The generalized force of an input, (n, 1)."""
    if place.pair is not None:
        return row_in(place.pair, len(centres[0]), numbers)
    if place.point is not None:
        return _pushed(links, place.point, first, centres, numbers)
    force = 0 * centres[0]
    if place.what == PUSH:
        force[0] = force[0] + 1
    elif place.what == FORCE:
        return centres[links.firsts[place.pendulum] + place.link]
    elif place.what == TORQUE:
        at = first + links.firsts[place.pendulum] + place.link
        force[at] = force[at] + 1
        if place.link:
            force[at - 1] = force[at - 1] - 1
    return force


def _output(
    links: Links,
    row: SignalPlace,
    first: int,
    q: Any,
    carried: Any,
    joints: Any,
    centres: Any,
    driven: Sequence[SignalPlace],
    numbers: Arithmetic,
) -> Any:
    """An output for every input, (m, W)."""
    if row.what == "x":
        return q[0] + carried if first else carried
    at = links.firsts[row.pendulum] + row.link
    if row.what == "joint":
        return (joints[at][:, None] * q).sum(0) + carried
    if row.what != "pivot_force":
        above = q[first + at - 1] if row.what == "rel" and row.link else 0
        return q[first + at] - above
    span, omega = links.span(row.pendulum), numbers.omega
    total = 0 * carried
    for k in range(span.start, span.stop):
        moved = (centres[k][:, None] * q).sum(0)
        total = total + omega * omega * links.mass[k] * (moved + carried)
        total = total - numbers.imaginary(links.drag[k]) * omega * moved if links.dragged else total
    for k, push in enumerate(driven):
        if push.what == FORCE and push.pendulum == row.pendulum:
            total[k] = total[k] + 1
        if push.point is not None and push.point.direction == "horizontal":
            total[k] = total[k] + sum(span.start <= place.link < span.stop for place in push.point.places)
    return total


# ------------------------------------------------------------------------------------------------------- D_modal


@lru_cache(maxsize=8)
def in_digits(scene: Scene) -> Any:
    """D_modal (n, n) in decimals."""
    rig = rig_of(scene)
    with localcontext(Context(prec=DIGITS)):
        numbers = Digits(np.ones(1), DIGITS, is_real=True)
        M, K = matrices_in(rig, numbers)[:2] if rig.structure else assembled(rig, numbers)[1:3]
        free = int(rig.cart is not None and rig.cart.stiffness == 0)
        M, K = M[..., 0], K[..., 0]
        if free:
            M, K = M[1:, 1:] - M[1:, :1] * M[:1, 1:] / M[0, 0], K[1:, 1:]
        square, momentum = _modes(M, K)
        least = max(square).scaleb(-DIGITS // 2)
        swings = [k for k, value in enumerate(square) if value > (least if rig.structure else 0)]
        omega = [square[k].sqrt() for k in swings]
        ratios = ratio_at(rig)(np.array(omega, dtype=np.float64))
        strength = [2 * Decimal(ratio) * value for ratio, value in zip(ratios.tolist(), omega, strict=True)]
        C = momentum[:, swings]
        return _below((C * np.array(strength, dtype=object)) @ C.T, free)


def _below(D: Any, rows: int) -> Any:
    """A square matrix with as many rows and columns of zeros before it."""
    padded = np.full((len(D) + rows,) * 2, Decimal(0), dtype=object)
    padded[rows:, rows:] = D
    return padded


def _modes(M: Any, K: Any) -> tuple[list[Decimal], Any]:
    """ω² of every mode with a mass and Mφ (n, R), φᵀMφ = 1; of a singular M from the factors of K."""
    L = _cholesky(M)
    if L is not None:
        square, V = _jacobi(_in_factors(L, K))
        return square, L @ V
    L = _cholesky(K)
    assert L is not None
    inverse, V = _jacobi(_in_factors(L, M))
    kept = [k for k, value in enumerate(inverse) if value > max(inverse).scaleb(-DIGITS // 2)]
    roots = np.array([inverse[k].sqrt() for k in kept], dtype=object)
    return [1 / inverse[k] for k in kept], (L @ V[:, kept]) * roots


def _cholesky(S: Any) -> Any:
    """L with LLᵀ = S; None where S is singular to half the digits."""
    L = np.array(S)
    for k in range(len(L)):
        L[k, k + 1 :] = Decimal(0)
        square = L[k, k] - (L[k, :k] * L[k, :k]).sum()
        if square <= abs(S[k, k]).scaleb(-DIGITS // 2):
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
    for _ in range(SWEEPS):
        turned = False
        for i in range(size):
            for j in range(i + 1, size):
                if abs(S[i, j]) <= (abs(S[i, i] * S[j, j])).sqrt().scaleb(3 - DIGITS):
                    continue
                turned = True
                tau = (S[j, j] - S[i, i]) / (2 * S[i, j])
                t = (1 if tau >= 0 else -1) / (abs(tau) + (1 + tau * tau).sqrt())
                c = 1 / (1 + t * t).sqrt()
                s = c * t
                S[i], S[j] = c * S[i] - s * S[j], s * S[i] + c * S[j]
                S[:, i], S[:, j] = c * S[:, i] - s * S[:, j], s * S[:, i] + c * S[:, j]
                V[:, i], V[:, j] = c * V[:, i] - s * V[:, j], s * V[:, i] + c * V[:, j]
        if not turned:
            break
    return [S[k, k] for k in range(size)], V
