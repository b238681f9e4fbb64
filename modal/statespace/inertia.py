"""Accelerations by generalized forces, M⁻¹ Q, by elimination from the tips: exact zeros are 0.0.

A force on a cart turns the first bob's wire alone; solved with M, the others get 1e-20. Here every chain is represented
at its pivot by an effective mass μ (2, 2) along the rail and down, and a force e. Across a link (w) and along it (u),
with r, p, q and upper of `modal.pair.Constants`, torques T over its length, and a = l θ'',

    P = r + μ_ww,    a = (T + e_w − (upper + μ_ww) y_w − μ_wu y_u)/P,    y_w + a = (T + e_w − q y_w − μ_wu y_u)/P
    μ'_ww = (m J + p μ_ww)/P,    μ'_wu = −q μ_wu/P,    μ'_uu = m + μ_uu − μ_wu²/P
    e'_w = −(q e_w + (upper + μ_ww) T)/P,    e'_u = e_u − μ_wu (T + e_w)/P

where y is the acceleration of the upper joint and primes are for the link above. Bobs have p = q = J = 0, and nothing
is subtracted if all links are vertical, so that a light cart has accelerations of full precision. The pivots move by Π
with the support coordinates η: (M_s + Σ Πᵀ μ Π) η'' = Q_η + Σ Πᵀ e. (The articulated bodies of [Featherstone2008,
§7.3], in the form of `modal.eigen.elimination`, at an infinite frequency.)
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from modal import pair
from modal.assembly.squares import carrier_squares, matrix
from modal.eigen import is_singular
from modal.errors import ComputationError
from modal.statespace.geometry import Geometry
from modal.types import Floats

NO_INERTIA = (
    "the mass matrix is singular to double precision (as with a massless cart over bobs): a force gives no "
    "finite acceleration; give the cart or the links some inertia, or prescribe the cart's motion"
)


class _Level(NamedTuple):
    """One link: its directions `turn` (2, 2), w and u by rows, P, q, upper + μ_ww, μ_wu and its loads T + e_w (L,)."""

    turn: Floats
    pivot: float
    q: float
    beta: float
    skew: float
    load: Floats


def accelerations(geometry: Geometry, forces: Floats, given: Floats | None = None) -> Floats:
    """The q'' (q, L) under generalized forces (q, L); where η'' is `given` (η, L), forces on η have no effect.

    Raise ComputationError if a force gives no finite acceleration.
    """
    d, heads = geometry.leading, [0, *(tip + 1 for tip in geometry.tips)]
    on_carriers, torques = forces[:d].copy(), forces[d:].copy()
    chains = [range(*ends) for ends in pairwise(heads)]
    mass, chain_steps = matrix(carrier_squares(geometry.structure, 0.0)[0], d), []
    for chain in chains:
        moves = np.vstack([geometry.centres[chain[0], :d], geometry.down[chain[0]]])
        passed, on_joints = _forces_on_joints(geometry, chain, torques, on_carriers, moves)
        on_carriers -= moves.T @ passed
        steps, mu, e = _eliminate(geometry, chain, torques, on_joints)
        mass += moves.T @ mu @ moves
        on_carriers += moves.T @ e
        chain_steps.append((moves, steps))
    eta = solve_inertia(mass, on_carriers) if given is None else given
    turns = [_descend(steps, moves @ eta) for moves, steps in chain_steps]
    return np.vstack([eta, np.vstack(turns) / geometry.length[:, None]])


def _forces_on_joints(
    geometry: Geometry, chain: range, torques: Floats, on_carriers: Floats, moves: Floats
) -> tuple[Floats, Floats]:
    """The forces along the rail that pass the pivot (2, L), and those on lower joints (n, L), out of `torques`.

    A force on a joint turns every link above it alike and pushes the pivot: as torques these would cancel in bobs only
    to rounding.  `torques` become forces across the links at their lower joints, without what a force is found for.
    """
    on_joints = np.zeros((len(chain), torques.shape[1]))
    way = geometry.across[chain] * geometry.length[chain]
    if np.any(geometry.sinking[chain]):
        torques[chain] /= geometry.length[chain][:, None]
        return np.zeros((2, torques.shape[1])), on_joints
    rail_forces = torques[chain] / way[:, None]
    pushes = np.array([rail_forces[0], 0 * rail_forces[0]])
    is_force = np.all(on_carriers == moves.T @ pushes, axis=0)
    passed = carried = np.where(is_force, rail_forces[0], 0.0)
    for i, link in enumerate(chain):
        goes_on = rail_forces[i] == carried
        if i:
            on_joints[i - 1] = np.where(goes_on, 0.0, carried)
        carried = np.where(goes_on, carried, 0.0)
        torques[link] = np.where(goes_on, 0.0, rail_forces[i]) * geometry.across[link]
    on_joints[-1] = carried
    return np.array([passed, 0 * passed]), on_joints


def _eliminate(
    geometry: Geometry, chain: range, torques: Floats, on_joints: Floats
) -> tuple[list[_Level], Floats, Floats]:
    """The links from the top, and the mass (2, 2) and forces (2, L) at their pivot."""
    steps, mu, e = list[_Level](), np.zeros((2, 2)), np.zeros((2, torques.shape[1]))
    for i, link in zip(reversed(range(len(chain))), reversed(chain), strict=True):
        numbers = (geometry.mass, geometry.length, geometry.centre, geometry.inertia)
        mass, length, centre, inertia = (float(part[link]) for part in numbers)
        part = pair.link_constants(mass, length, centre, inertia, 0.0)
        cosine, sink = geometry.across[link], geometry.sinking[link]
        turn = np.array([[cosine, sink], [-sink, cosine]])
        (across, skew), (_, along) = turn @ mu @ turn.T
        e[0] += on_joints[i]
        e_across, e_along = turn @ e
        P, beta, load = part.r + across, part.upper + across, torques[link] + e_across
        if not P > 0:
            raise ComputationError(NO_INERTIA)
        steps.append(_Level(turn, P, part.q, beta, skew, load))
        cross = -skew * (part.q / P)
        local = np.array([[part.mJ / P + part.p * (across / P), cross], [cross, mass + along - skew * (skew / P)]])
        mu = turn.T @ local @ turn
        e = turn.T @ np.array([-(part.q * e_across + beta * torques[link]) / P, e_along - skew * (load / P)])
    return steps[::-1], mu, e


def _descend(steps: list[_Level], pivot: Floats) -> Floats:
    """The l θ'' (n, L) of a chain whose pivot has the acceleration (2, L)."""
    y, turns = pivot, []
    for turn, P, q, beta, skew, load in steps:
        across, along = turn @ y
        pushed = load - skew * along
        turns.append((pushed - beta * across) / P)
        y = turn.T @ np.array([(pushed - q * across) / P, along])
    return np.array(turns)


def solve_inertia(M: Floats, right: Floats) -> Floats:
    """M⁻¹ right, with M scaled to a diagonal near 1; raise ComputationError if it is singular."""
    refuse_no_inertia(M)
    scale = np.exp2(np.round(np.log2(np.diag(M)) / -2))[:, None]
    return np.asarray(scale * np.linalg.solve(scale * M * scale.T, scale * right), dtype=np.float64)


def refuse_no_inertia(M: Floats) -> None:
    """Raise ComputationError for a mass matrix that is singular, on which a force has no finite acceleration."""
    if len(M) and is_singular(M):
        raise ComputationError(NO_INERTIA)
