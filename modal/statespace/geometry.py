"""Positions and motion of the points of a scene: rows over q = (η, θ_1, …), to first order about the equilibrium.

A fixed support and a cart are structures of no and of one coordinate η.  A horizontal displacement is a row h over q:
of a centre h = Φ + Σ_{above} l cos θ + c cos θ, of a lower joint Φ + Σ l cos θ, with the equilibrium's angles θ, 0 or π
without constant forces; a pivot moves along the rail by Φ η, and down by Ψ η.  A horizontal force at that point acts on
q with hᵀ.

Accelerations by generalized forces, M⁻¹ Q, come from an elimination from the tips: exact zeros are 0.0.  A force on a
cart turns the first bob's wire alone; solved with M, the others get 1e-20. Here every chain is represented at its
pivot by an effective mass μ (2, 2) along the rail and down, and a force e. Across a link (w) and along it (u), with
r, p, q and upper of `modal.pair.Constants`, torques T over its length, and a = l θ'',

    P = r + μ_ww,    a = (T + e_w − (upper + μ_ww) y_w − μ_wu y_u)/P,    y_w + a = (T + e_w − q y_w − μ_wu y_u)/P
    μ'_ww = (m J + p μ_ww)/P,    μ'_wu = −q μ_wu/P,    μ'_uu = m + μ_uu − μ_wu²/P
    e'_w = −(q e_w + (upper + μ_ww) T)/P,    e'_u = e_u − μ_wu (T + e_w)/P

where y is the acceleration of the upper joint and primes are for the link above. Bobs have p = q = J = 0, and nothing
is subtracted if all links are vertical, so that a light cart has accelerations of full precision. The pivots move by Π
with the support coordinates η: (M_s + Σ Πᵀ μ Π) η'' = Q_η + Σ Πᵀ e. (The articulated bodies of [Featherstone2008,
§7.3], in the form of `modal.eigen.elimination`, at an infinite frequency.)
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from modal import pair
from modal.assembly import Hanging, Rig, SpringRow, displacements, joints, rig_of
from modal.assembly.squares import carrier_squares, matrix
from modal.eigen import is_singular
from modal.errors import ComputationError
from modal.scene import Scene
from modal.scene.motion import Acting
from modal.scene.points import CarrierPoint, Place
from modal.structure import Row, Structure, slopes, turning
from modal.types import Floats, Ints


class StructureCoordinate(NamedTuple):
    """A coordinate of a structure: its `name` (`lower_m`), its unit, its meaning, and that of a force on it.

    `along` is the motion of its support's origin along the rail per unit.
    """

    name: str
    unit: str
    meaning: str
    pushed: str
    along: float

    @property
    def is_cart(self) -> bool:
        """Whether it is the position of a single cart."""
        return self.name == "x"

    @property
    def force(self) -> str:
        """The name of the force or torque on it."""
        if self.is_cart:
            return "cart_force"
        return f"{self.name.removesuffix(f'_{self.unit}')}_{'torque' if self.unit == 'rad' else 'force'}"

    @property
    def force_unit(self) -> str:
        """N or N m; 1 for a coordinate of a modal support."""
        return {"m": "N", "rad": "N m"}.get(self.unit, "1")

    def derivative(self, order: int) -> str:
        """The name of its rate or its second derivative, as `lower_dot_m_per_s`."""
        dots, unit = "_dot" if order == 1 else "_ddot", f"_{self.unit}_per_s{'' if order == 1 else order}"
        if self.is_cart:
            return self.name + dots
        return self.name.removesuffix(f"_{self.unit}") + dots + unit * bool(self.unit)


WORDS = ("coordinate of the modal support", "generalized force on a coordinate of the modal support")
"""The meaning of coordinates of modal supports, and of forces on them."""


@dataclass(frozen=True, eq=False)
class Geometry:
    """Rows over q of every link's centre, lower joint and angle relative to the link above, each (links, q).

    `labels` (links,) are "p_i", both from 1, every copy numbered; `mass`, moment of `inertia` and linear `drag`
    (links,), `pendulum` (links,) from 0; `rest` (links,) the equilibrium's angles θ and `place` (m) the cart's;
    `length` and `centre` (links,) those of the links, and `across` and `sinking` (links,) their cos θ and −sin θ;
    `down` and `turning` (links, d) the displacement downwards of every link's pivot and the angle of its support by
    every coordinate η. `springs` are those between points. The coordinates of a scene that `is_structured` have signals
    of their own names. If lengths change, `rate` and `bend` (links, q) are the first two derivatives in time of the
    rows of centres and lower joints; in motion `end_rate` and `end_bend` are those of lower joints only.
    """

    structure: Structure
    coordinates: tuple[StructureCoordinate, ...]
    is_structured: bool
    springs: tuple[SpringRow, ...]
    labels: tuple[str, ...]
    pendulum: Ints
    centres: Floats
    joints: Floats
    relative: Floats
    down: Floats
    turning: Floats
    mass: Floats
    inertia: Floats
    drag: Floats
    length: Floats
    centre: Floats
    across: Floats
    sinking: Floats
    rest: Floats
    place: float
    rate: Floats | None = None
    bend: Floats | None = None
    end_rate: Floats | None = None
    end_bend: Floats | None = None

    @property
    def on_cart(self) -> bool:
        """Whether q begins with the x of a single cart."""
        return any(coordinate.is_cart for coordinate in self.coordinates)

    @property
    def leading(self) -> int:
        """The number of coordinates before the angles."""
        return len(self.coordinates)

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return int(self.centres.shape[1])

    @property
    def angles(self) -> Floats:
        """The rows of the absolute angles."""
        return np.eye(self.size)[self.leading :]

    @property
    def momentum(self) -> Floats:
        """The total momentum (q,) at unit velocity along the rail, in the directions of q."""
        momentum: Floats = self.centres.T @ self.mass
        for number, carrier in enumerate(self.structure.carriers):
            if carrier.M is None and carrier.size:
                for column, value in slopes(self.structure, number, carrier.centre)[0].items():
                    momentum[column] += carrier.mass * value
        return momentum

    @property
    def windage(self) -> Floats:
        """The force of still air (q,) against unit velocity of everything along the rail, in the directions of q."""
        return np.asarray(self.centres.T @ self.drag)

    @property
    def tips(self) -> list[int]:
        """The last link of every pendulum."""
        return np.flatnonzero(np.diff(self.pendulum, append=-1)).tolist()

    @cached_property
    def extension(self) -> Floats:
        """The rows (springs, q) of the extensions of all springs."""
        rows = np.zeros((len(self.springs), self.size))
        for k, spring in enumerate(self.springs):
            rows[k, list(spring.row)] = list(spring.row.values())
        return rows

    @cached_property
    def pulls(self) -> Floats:
        """The force along the rail (pendula, springs) that each spring has on every pendulum where its force is 1."""
        pulls = np.zeros((len(self.tips), len(self.springs)))
        for k, spring in enumerate(self.springs):
            for pendulum, sign in spring.on_pendula:
                pulls[pendulum, k] += sign * spring.rail_part
        return pulls


def coordinates_of(structure: Structure) -> tuple[StructureCoordinate, ...]:
    """The coordinates of a structure in their order."""
    if structure.names == ("x",):
        return (StructureCoordinate("x", "m", "position of the cart", "force on the cart along the rail", 1.0),)
    coordinates = []
    for number, carrier in enumerate(structure.carriers):
        at_rest = (0.0,) * carrier.size
        origin = carrier.moving(0 if carrier.M is not None else (0.0, 0.0), at_rest, at_rest).slopes
        for k, suffix in enumerate(carrier.suffixes):
            unit = "" if carrier.M is not None else suffix.rpartition("_")[2]
            described = carrier.path.coordinates[k].described(carrier.path.nouns[0]) if carrier.path else WORDS
            meaning, force_meaning = (f"{words} {carrier.name}" for words in described)
            rail_part = 0.0 if carrier.M is not None or unit == "rad" else float(origin[k][0])
            name = structure.names[structure.offsets[number] + k]
            coordinates.append(StructureCoordinate(name, unit, meaning, force_meaning, rail_part))
    return tuple(coordinates)


def geometry_of(scene: Scene) -> Geometry:
    """The rows of a scene, one for each copy."""
    return geometry_of_rig(rig_of(scene))


def geometry_of_rig(rig: Rig) -> Geometry:
    """The rows of the scene of a rig."""
    hanging = Hanging(rig.on_structure)
    structure, first = hanging.structure, hanging.first
    blocks = [(rig.blocks[block], column) for block, column in hanging.kinds.tolist()]
    sizes = np.diff(first)
    owner, tops, total = np.repeat(np.arange(len(blocks)), sizes), first[:-1], int(first[-1])
    rail_parts, vertical_parts, turning = (part[owner] for part in hanging.phi)
    swung = np.eye(total) - np.eye(total, k=-1)
    swung[tops[1:], tops[1:] - 1] = 0.0
    relative = np.hstack([0.0 * turning, swung])
    relative[tops, : structure.size] -= turning[tops]
    centres, lower_joints = (np.hstack([rail_parts, displacements(blocks, 0, of)]) for of in (None, joints))

    def numbers(name: str) -> Floats:
        parts = ((getattr(block, name), column, block.n) for block, column in blocks)
        return np.concatenate([np.zeros(n) if part is None else part[:, column] for part, column, n in parts])

    return Geometry(
        structure=structure,
        coordinates=coordinates_of(structure),
        is_structured=rig.structure is not None,
        springs=hanging.spring_rows,
        labels=tuple(f"{p}_{i}" for p, size in enumerate(sizes.tolist(), 1) for i in range(1, size + 1)),
        pendulum=owner,
        centres=centres,
        joints=lower_joints,
        relative=relative,
        down=vertical_parts,
        turning=turning,
        **{name: numbers(name) for name in ("mass", "inertia", "drag", "length", "centre", "across", "sinking")},
        rest=rig.rest_angles,
        place=rig.cart_rest,
    )


def carrier_row(structure: Structure, point: CarrierPoint, direction: Acting) -> Row:
    """The generalized force of a force of 1 N, or a torque of 1 N m, on a point of a support, by coordinates."""
    carrier = [body.name for body in structure.carriers].index(point.name)
    if direction == "torque":
        return turning(structure, carrier)
    rail_slopes, vertical_slopes = slopes(structure, carrier, point.place if point.point is None else point.point)
    return (
        rail_slopes if direction == "horizontal" else {column: 0.0 - value for column, value in vertical_slopes.items()}
    )


def row_of(geometry: Geometry, place: Place, direction: Acting) -> Floats:
    """The generalized force (q,) of a force of 1 N or a torque of 1 N m at one link."""
    first, row = geometry.leading, np.zeros(geometry.size)
    if direction == "torque":
        row[first + place.link] = 1.0
        if place.below is None and place.above >= 0:
            row[first + place.above] = -1.0
        if place.below is None and place.above < 0:
            row[:first] = 0.0 - geometry.turning[place.link]
        return row
    way = geometry.across if direction == "horizontal" else -geometry.sinking
    top = int(np.flatnonzero(geometry.pendulum == geometry.pendulum[place.link])[0])
    upper_links = slice(top, place.link)
    row[first + top : first + place.link] = (way * geometry.length)[upper_links]
    distance = geometry.centre[place.link] if place.below is None else place.below
    row[first + place.link] = way[place.link] * distance
    if direction == "horizontal":
        row[:first] = geometry.centres[place.link, :first]
    else:
        row[:first] = 0.0 - geometry.down[place.link]
    return row


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
