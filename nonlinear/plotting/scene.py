"""The content of a film: the drawn pendula over all frames in the picture's metres, the camera, the energies.

The pivots of all pendula are one point of the equations; the picture separates them.  Space is drawn in oblique
projection: y across the rail is drawn as y/2 to the upper right.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from modal.plotting.layout import OBLIQUE, even_choice
from modal.plotting.shapes import PENDULA_MAX
from modal.scene import AnyLink
from modal.structure import STILL, Piece, Scaffold, structure_of
from modal.types import Floats, Ints
from nonlinear.dynamics import Mechanics, vectors
from nonlinear.integration import Trajectory
from nonlinear.postprocessing import pick_links, resample
from nonlinear.system import Layout, Motion, System

TRAIL_POINTS = 3
"""Format: points of a trail in each frame, so that fast tips have no corners."""
ANGLES_AT_ONCE = 4_000_000
"""Cost: angles whose energies are computed at once, some 500 MB; `benchmarks/simulation_figure.py` has fewer."""
WIDE_BARS = 6
"""Format: bars of energy up to which each is wide, with space for a long name."""
SHORT = {"structure": "base"}


def flat(points: Floats) -> Floats:
    """Points (..., 2) or (..., 3) as in `nonlinear.dynamics.mechanics`, as (..., 2), to the right and up."""
    points_seen = np.stack((points[..., 0], -points[..., -1]), axis=-1)
    return points_seen + points[..., 1:2] * OBLIQUE if points.shape[-1] == 3 else points_seen


@dataclass(frozen=True, eq=False)
class Actor:
    """One pendulum of n links: joints from the pivot down (F, n + 1, 2), centres (F, n, 2) and shadow, all in m.

    `trail` (G, 2) is the path of its tip, with TRAIL_POINTS points per frame.  In the plane there is no shadow: None.
    """

    links: tuple[AnyLink, ...]
    joints: Floats
    centres: Floats
    trail: Floats
    shadow: Floats | None


@dataclass(frozen=True, eq=False)
class FilmEnergies:
    """Kinetic energy and potential energy above equilibrium (J) of the named bodies (F, B) and of the whole (F,)."""

    names: tuple[str, ...]
    kinetic: Floats
    potential: Floats
    totals: tuple[Floats, Floats]


@dataclass(frozen=True, eq=False)
class Stage:
    """The drawn pendula, their supports, the camera, and the length (m) of the longest chain.

    `pieces` are (F, K, 2) each, of one frame where they stand still.  `camera` (F,) is the place of the picture's
    origin along the rail (m), 0 but where it follows a cart.  `floor` is the depth of the floor below the rail (m),
    None in the plane.  A cart alone has a rail with metres along it; `notes` say which parts are not drawn in place.
    """

    actors: tuple[Actor, ...]
    pieces: tuple[Piece, ...]
    camera: Floats
    depth: float
    floor: float | None
    has_rail: bool
    notes: Sequence[str]

    @property
    def follows(self) -> bool:
        """Whether the camera follows the cart."""
        return bool(self.camera.any())

    @cached_property
    def extent(self) -> tuple[Floats, Floats]:
        """The smallest and largest coordinates (m), relative to the camera, of everything that moves."""
        points = [piece.points for piece in self.pieces if not (self.follows and piece.role in STILL)]
        for actor in self.actors:
            points += [actor.joints, actor.centres, *([] if actor.shadow is None else [actor.shadow])]
        horizontal = [(part[..., 0] - self.camera[:, None]).ravel() for part in points]
        ranges = [np.concatenate(values) for values in (horizontal, [part[..., 1].ravel() for part in points])]
        return np.array([values.min() for values in ranges]), np.array([values.max() for values in ranges])


def chosen(system: System) -> Ints:
    """The pendula, from 0, that are drawn: all, or PENDULA_MAX evenly spaced."""
    return even_choice(system.n_pendula, PENDULA_MAX)


def stage_of(trajectory: Trajectory, at: Floats) -> Stage:
    """The drawn pendula at evenly spaced times `at` (F,) in s."""
    system, pendula = trajectory.system, chosen(trajectory.system)
    fine = np.interp(np.arange(TRAIL_POINTS * (len(at) - 1) + 1) / TRAIL_POINTS, np.arange(len(at)), at)
    places = [np.flatnonzero(system.pendulum == pendulum) for pendulum in pendula]
    shaken = np.zeros((len(fine), 3 if system.spatial else 2))
    if system.support:
        shaken = system.support.displacements(fine, shaken.shape[1])
    motions = [resample(trajectory.times, pick_links(trajectory.motion, place), fine) for place in places]
    length, centre = system.by_link("length"), system.by_link("centre")
    if system.hoisting is not None:
        length = system.hoisting.at(fine)[0]
        centre = np.where(system.hoisting.moving, length, centre)
    depth = max(float(length[..., place].sum(-1).max()) for place in places)
    first = np.searchsorted(system.pendulum, np.arange(system.n_pendula + 1))
    scaffold = Scaffold(structure_of(trajectory.scene), pendula, first, depth, has_rails=system.cart is None)
    eta = Layout.of(system, works=False).carrier_coordinates(motions[0])[0]
    hangers = scaffold.pivots(eta).transpose(1, 0, 2) * (1.0, -1.0)
    shapes = [
        _shape(motion, length[..., place], centre[..., place], pivot, shaken)
        for motion, place, pivot in zip(motions, places, hangers, strict=True)
    ]
    floor = max(float(joints[..., -1].max()) for joints, _ in shapes) + 0.3 * depth if system.spatial else None
    hanging = trajectory.scene.hanging
    actors = tuple(
        _actor(hanging[pendulum].chain, joints, centres, floor)
        for pendulum, (joints, centres) in zip(pendula, shapes, strict=True)
    )
    support = np.column_stack((shaken[:, 0], -shaken[:, -1]))[::TRAIL_POINTS]
    joints = {p: actor.joints - support[:, None] for p, actor in zip(pendula.tolist(), actors, strict=True)}
    pieces = tuple(
        piece._replace(points=piece.points + support[:, None]) if support.any() or piece.role not in STILL else piece
        for piece in scaffold.pieces(eta[::TRAIL_POINTS], joints)
    )
    camera = np.zeros(len(at))
    if system.cart is not None:
        cart, (left, right, _) = motions[0].cart[::TRAIL_POINTS] + support[:, 0], scaffold.bodies[0]
        camera = cart if np.ptp(cart) > 0.75 * depth + (right - left) / 4 else camera
    return Stage(actors, pieces, camera, depth, floor, system.cart is not None, scaffold.notes)


def _shape(motion: Motion, length: Floats, centre: Floats, pivots: Floats, support: Floats) -> tuple[Floats, Floats]:
    """Joints (G, n + 1, d) and centres (G, n, d) from `pivots` (G, 2), along the rail and down."""
    directions = vectors(motion)[0]
    joints = np.cumsum(length[..., None] * directions, axis=1)
    joints = np.concatenate((np.zeros_like(joints[:, :1]), joints), axis=1)
    joints[..., 0] += pivots[:, :1]
    joints[..., -1] += pivots[:, 1:]
    joints += support[:, None]
    return joints, joints[:, :-1] + centre[..., None] * directions


def _actor(links: tuple[AnyLink, ...], joints: Floats, centres: Floats, floor: float | None) -> Actor:
    shadow = None
    if floor is not None:
        floor_points = joints[::TRAIL_POINTS].copy()
        floor_points[..., -1] = floor
        shadow = flat(floor_points)
    return Actor(links, flat(joints[::TRAIL_POINTS]), flat(centres[::TRAIL_POINTS]), flat(joints[:, -1]), shadow)


def energies_of(trajectory: Trajectory, at: Floats) -> FilmEnergies:
    """The energies of the drawn pendula, then of their supports, and of everything, at the times `at` (F,) in s."""
    rows = max(1, ANGLES_AT_ONCE // trajectory.system.n_links)
    parts = [_energies(trajectory, at[first : first + rows]) for first in range(0, len(at), rows)]
    kinetic, potential = (np.concatenate([part[k] for part in parts]) for k in (0, 1))
    numbers, carrier = chosen(trajectory.system), carrier_name(trajectory.system)
    bars = np.append(numbers, trajectory.system.n_pendula) if carrier else numbers
    carrier = SHORT.get(carrier, carrier) if len(numbers) > WIDE_BARS else carrier
    names = (*map(str, numbers + 1), *[carrier] * bool(carrier))
    return FilmEnergies(names, kinetic[:, bars], potential[:, bars], (kinetic.sum(1), potential.sum(1)))


def carrier_name(system: System) -> str:
    """The part other than the pendula that has energy, in a word; "" if there is none.

    A structure has that of all springs between points.
    """
    if system.structure is not None:
        return "structure" if system.structure.size else "springs"
    return "cart" if system.cart is not None else ""


def _energies(trajectory: Trajectory, at: Floats) -> tuple[Floats, Floats]:
    """Kinetic energy and potential energy above equilibrium of every pendulum and, last, of cart or structure."""
    mechanics = Mechanics(trajectory.system, resample(trajectory.times, trajectory.motion, at), at)
    kinetic, potential = mechanics.of_pendula(mechanics.kinetic), mechanics.of_pendula(mechanics.potential)
    return np.column_stack((kinetic, mechanics.cart_kinetic)), np.column_stack((potential, mechanics.cart_potential))
