"""Reductions of a scene with a given start to a smaller or better-scaled scene that moves in exactly the same way.

Equal pendula (bit for bit) with equal starts move as one: a pendulum with their masses, dampers and springs added up
pulls the cart as they do together.  A start in space in the vertical plane of the rail stays in it, so angles
suffice; this is not used where joints have springs, for a joint in space does not wind up
(`nonlinear.dynamics.spatial`).

No force depends on full turns of a joint without a spring, nor on the position of a cart without one: where these are
so large that integrators would scale their tolerance by them, they are removed. Masses and lengths so far from 1 that
double precision cannot square m l² are rescaled by powers of two, relative to the largest; gravity scales with lengths,
so that time is unchanged.

Pendula that symmetry ties stay together, however unstable that is; real pendula would not.  The same holds of equal
pendula that swing in antiphase about a cart at rest, although nothing is reduced there: rounding is as symmetric as the
motion (`exactly_symmetric`).

Also whether a start is an unstable equilibrium of the full equations, which rounding alone would end.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import frexp
from typing import Any

import numpy as np

from modal.assembly import ARRAYS
from modal.structure import scale_structure
from modal.types import IMAGINARY_STEP, NOISE_OF_SUM, NOISE_OF_TERMS, Floats, Ints
from nonlinear.dynamics.contacts import contacts_of
from nonlinear.dynamics.forces import bend, link_torques
from nonlinear.dynamics.minimal import Minimal, Recursion
from nonlinear.dynamics.tape import DIVISOR_MIN
from nonlinear.system import Equations, Group, Load, Motion, State, System, motion_of, of_plane

TRAVEL_MAX = 10.0
"""Tolerance: rad, or lengths of the longest link, beyond which whole turns and travel are removed: they cost digits."""
UNIT_POWER_MAX = 200
"""Tolerance: powers of two of m l² (kg m²) beyond which units are changed: products of five are finite."""


@dataclass(frozen=True, eq=False)
class Symmetry:
    """An equivalent `system`: how to start it, how to recover the whole motion from it, and a description in `words`.

    `ties` says whether it holds motions together that would part under a small perturbation.
    """

    system: System
    restrict: Callable[[State], State]
    extend: Callable[[Motion], Motion]
    words: str
    ties: bool = False


def find_symmetries(system: System, start: State, *, planar: bool = True) -> tuple[Symmetry, ...]:
    """The reductions that apply to a system with this start, to be applied in sequence.

    Without `planar` a scene in space remains spatial.  With dampers of modes, which act on all pendula at once, on
    structures, and with lengths that change, none applies.
    """
    if system.modal_damping is not None or system.hoisting is not None or system.structure is not None:
        return ()
    symmetries: list[Symmetry] = []
    for find in (*([in_one_plane] if planar else []), near_origin, synchronous, natural):
        if symmetry := find(system, start):
            symmetries.append(symmetry)
            system, start = symmetry.system, symmetry.restrict(start)
    return tuple(symmetries)


def symmetrize(symmetries: Sequence[Symmetry], state: State) -> tuple[Motion, Motion]:
    """A state as a motion of one instant, and its nearest neighbour that has these symmetries."""
    like = state
    for symmetry in symmetries:
        like = symmetry.restrict(like)
    image = motion_of([like])
    for symmetry in reversed(symmetries):
        image = symmetry.extend(image)
    return motion_of([state]), image


def in_one_plane(system: System, start: State) -> Symmetry | None:
    """The planar scene of a spatial one whose start has no component across the rail, else None."""
    if not system.spatial or any(group.sprung for group in system.groups):
        return None
    if np.any(start.links[:, 1]) or np.any(start.link_rates[:, 1]):
        return None
    return Symmetry(replace(system, spatial=False), _angles, of_plane, "one vertical plane of space", ties=True)


def _angles(state: State) -> State:
    (sin, _, cos), (along, _, down) = state.links.T, state.link_rates.T
    return replace(state, links=np.arctan2(sin, cos), link_rates=cos * along - sin * down)


def synchronous(system: System, start: State) -> Symmetry | None:
    """One pendulum for each set of equal pendula with equal starts; None if no two match."""
    if system.n_pendula == len(system.groups):
        return None
    groups: list[Group] = []
    link_numbers, sources = np.zeros(0, dtype=np.int64), np.empty(system.n_links, dtype=np.int64)
    for group in system.groups:
        first, place, count = _kinds(group, start)
        index = len(link_numbers) + np.arange(group.n * len(first)).reshape(len(first), group.n).T
        pendula = sum(earlier.index.shape[1] for earlier in groups) + np.arange(len(first))
        excitation = group.excitation and group.excitation.take(first).times(count)
        laws = tuple(term.take(first).times(count) for term in group.laws)
        forces = tuple(term.take(first).times(count) for term in group.point_forces)
        block = group.block.take(first).heavier(count)
        groups.append(Group(block, index, pendula, excitation, laws=laws, point_forces=forces))
        sources[group.index] = index[:, place]
        link_numbers = np.concatenate((link_numbers, group.index[:, first].T.ravel()))
    if len(link_numbers) == system.n_links:
        return None
    small = replace(system, groups=tuple(groups), labels=())
    words = f"{small.n_pendula} of {system.n_pendula} pendula, the others moving with them"
    return Symmetry(
        small, lambda state: _restrict(state, link_numbers), lambda motion: _spread(motion, sources), words, ties=True
    )


def _kinds(group: Group, start: State) -> tuple[Ints, Ints, Ints]:
    """The first pendulum (by column) of each kind, the kind of every pendulum, and the number of each kind."""
    table = _table(group, start)
    _, first, place, count = np.unique(table, axis=0, return_index=True, return_inverse=True, return_counts=True)
    order = np.argsort(first)
    return first[order], np.argsort(order)[place.ravel()], count[order]


def _table(group: Group, start: State) -> Floats:
    """All parameters and initial values of each pendulum, one row each."""
    columns = [getattr(group.block, name) for name in ARRAYS]
    columns += [part[group.index].reshape(group.n, -1, part[0].size) for part in (start.links, start.link_rates)]
    if group.excitation:
        columns += list(group.excitation.table)
    columns += [part for part in (group.friction, group.quadratic_drag) if part is not None]
    for term in (*group.laws, *group.point_forces):
        for number in (1.0, *term.numbers, term.scale):
            columns.append(np.zeros(group.index.shape))
            columns[-1][term.rows, term.columns] = number
    return np.hstack([np.moveaxis(column, 1, 0).reshape(group.index.shape[1], -1) for column in columns])


def _restrict(state: State, link_numbers: Ints) -> State:
    return replace(state, links=state.links[link_numbers], link_rates=state.link_rates[link_numbers])


def _spread(motion: Motion, sources: Ints) -> Motion:
    return replace(motion, links=motion.links[:, sources], link_rates=motion.link_rates[:, sources])


def exactly_symmetric(system: System, start: State) -> bool:
    """Whether a symmetry of the start is preserved exactly by rounding, so that no run shows that it may be unstable.

    True for equal pendula with equal starts; for pendula on a cart that are mirror images of each other or of
    themselves; in space also for a pendulum in the plane of the rail or across it.
    """
    if system.spatial and _flat(system, start):
        return True
    return synchronous(system, start) is not None or _is_mirror_symmetric(system, start)


def _flat(system: System, start: State) -> bool:
    """Whether any pendulum has no component along the rail, or none across it."""
    largest = np.zeros((system.n_pendula, 2))
    for part in (start.links, start.link_rates):
        np.maximum.at(largest, system.pendulum, np.abs(part[:, :2]))
    return bool(np.any(largest == 0))


def _is_mirror_symmetric(system: System, start: State) -> bool:
    """Whether the scene and its start equal their mirror image, modulo full turns."""
    cart = system.cart
    if cart is None or start.cart * cart.stiffness or start.cart_rate * cart.damping:
        return False
    if start.cart_rate and (system.has_drag or system.rail):
        return False
    if system.spatial:
        image = [part * [-1, 1, 1] + 0.0 for part in (start.links, start.link_rates)]
    else:
        angles = start.links - 2 * np.pi * np.round(start.links / (2 * np.pi))
        start = replace(start, links=np.where(angles == -np.pi, np.pi, angles))
        image = [np.where(start.links == np.pi, np.pi, 0.0 - start.links), 0.0 - start.link_rates]
    mirror_image = replace(start, links=image[0], link_rates=image[1])
    for group in system.groups:
        rows, mirror_rows = (
            np.unique(_table(group, state), axis=0, return_counts=True) for state in (start, mirror_image)
        )
        if not (np.array_equal(rows[0], mirror_rows[0]) and np.array_equal(rows[1], mirror_rows[1])):
            return False
    return True


def near_origin(system: System, start: State) -> Symmetry | None:
    """The system without full turns and with its cart at the origin; None where neither is far away."""
    turns = np.zeros_like(start.links) if system.spatial else start.links - _unwind(system, start.links)
    travel = start.cart if system.cart and not system.cart.stiffness else 0.0
    if np.abs(turns).max() < TRAVEL_MAX and abs(travel) < TRAVEL_MAX * system.length:
        return None
    return Symmetry(
        system,
        lambda state: replace(state, links=state.links - turns, cart=state.cart - travel),
        lambda motion: replace(motion, links=motion.links + turns, cart=motion.cart + travel),
        "whole turns and the cart's travel so far removed",
    )


def _unwind(system: System, links: Floats) -> Floats:
    """Angles within half a turn of the downward vertical; joints with a spring or a drive keep their bend."""
    unwound = links.copy()
    for group in system.groups:
        angles = links[group.index]
        within = np.where(np.abs(angles) > np.pi, np.arctan2(np.sin(angles), np.cos(angles)), angles)
        bend = np.diff(angles, axis=0, prepend=0.0)
        above = np.zeros_like(within[0])
        keeps_bend = group.block.stiffness > 0
        for term in group.laws:
            keeps_bend[term.rows, term.columns] = True
        for links_within, link_bend, is_kept in zip(within, bend, keeps_bend, strict=True):
            links_within[is_kept] = (above + link_bend)[is_kept]
            above = links_within
        unwound[group.index] = within
    return unwound


def natural(system: System, start: State) -> Symmetry | None:
    """The system in natural units of mass and length; None where kg and m serve as well."""
    m, l = (frexp(float(system.by_link(name).max()))[1] for name in ("mass", "length"))
    if abs(m) + 2 * abs(l) < UNIT_POWER_MAX or any(group.point_forces for group in system.groups):
        return None
    mass, length, moment = 2.0**m, 2.0**l, 2.0 ** (m + 2 * l)
    units = {"mass": mass, "length": length, "centre": length, "sigma": 1.0}
    numbers = {name: units.get(name, moment) for name in ARRAYS}
    groups = tuple(_in_units(group, numbers, moment) for group in system.groups)
    suspension = scale_structure(system.suspension, mass, length, length)
    small = replace(system, gravity=system.gravity / length, suspension=suspension, groups=groups)
    return Symmetry(
        small,
        lambda state: replace(state, cart=state.cart / length, cart_rate=state.cart_rate / length),
        lambda motion: replace(
            motion, cart=motion.cart * length, cart_rate=motion.cart_rate * length, work=motion.work * moment
        ),
        f"in units of 2^{m} kg and 2^{l} m",
    )


def _in_units(group: Group, units: dict[str, float], moment: float) -> Group:
    numbers = {name: getattr(group.block, name) / unit for name, unit in units.items()}
    excitation = group.excitation and group.excitation.times(1 / moment)
    laws = tuple(term.times(1 / moment) for term in group.laws)
    return replace(group, block=replace(group.block, **numbers), excitation=excitation, laws=laws)


@dataclass(frozen=True, eq=False)
class Reduced:
    """The equations `inner` of the last of these symmetries, read as the motion of the whole `system`."""

    system: System
    inner: Equations
    symmetries: Sequence[Symmetry]

    @property
    def words(self) -> str:
        """A description of the integrated system."""
        return "; ".join(symmetry.words for symmetry in self.symmetries)

    @property
    def load(self) -> Load | None:
        """No external load: it might break the symmetry."""
        return None

    @property
    def scale(self) -> Floats:
        """Natural units of y, (size,)."""
        return self.inner.scale

    def derivative(self, time: float, y: Floats) -> Floats:
        """The time derivative of y, (size,)."""
        return self.inner.derivative(time, y)

    def begin(self, state: State) -> Floats:
        """The vector y of a state."""
        for symmetry in self.symmetries:
            state = symmetry.restrict(state)
        return self.inner.begin(state)

    def read(self, rows: Floats) -> Motion:
        """The motion of the whole system in vectors (T, size)."""
        motion = self.inner.read(rows)
        for symmetry in reversed(self.symmetries):
            motion = symmetry.extend(motion)
        return motion

    def project(self, y: Floats) -> tuple[Floats, float]:
        """The nearest y that satisfies every constraint, and the largest violation removed."""
        return self.inner.project(y)


GROWTH_NOISE = 1e-9
"""Tolerance: of a growth over the largest rate, above rounding."""


def is_unstable_equilibrium(system: System, start: State) -> bool:
    """Whether a start is an unstable equilibrium to within rounding, or on a fixed support any one of its pendula is.

    Nothing moves, the moments of gravity and springs balance, and V has no minimum there.  Where dry friction holds
    every coordinate nothing is unstable.  On a structure all of it is at rest.
    """
    if system.structure is not None:
        return _on_structure(system, start)
    if system.rubs and len(contacts_of(system).below) == system.n_links + system.first:
        return False
    angles = np.arctan2(np.hypot(*start.links.T[:2]), start.links[:, 2]) if system.spatial else start.links
    is_still = ~np.any(start.link_rates.reshape(system.n_links, -1), axis=1)
    verdicts = []
    for group in system.groups:
        weight, group_angles = system.gravity * group.block.b, angles[group.index]
        remainder = np.abs(link_torques(group, group_angles, 0.0 * group_angles) - weight * np.sin(group_angles))
        stiffness = _joint_stiffness(group, group_angles)
        in_balance = remainder <= NOISE_OF_TERMS * (weight + np.abs(stiffness)) * (1 + np.abs(group_angles))
        verdicts.append(
            (np.all(in_balance & is_still[group.index], axis=0), _falls(stiffness, weight * np.cos(group_angles)))
        )
    resting, falling = (np.concatenate(part) for part in zip(*verdicts, strict=True))
    if system.cart is None:
        return bool(np.any(resting & falling))
    has_pull = start.cart * system.cart.stiffness or start.cart_rate * system.cart.damping
    return bool(np.all(resting) and np.any(falling) and not has_pull)


def _on_structure(system: System, start: State) -> bool:
    """Whether everything rests, no coordinate is accelerated, and one of ∂q''/∂q = −M⁻¹K grows."""
    if np.any(start.link_rates) or np.any(start.support_rates):
        return False
    quiet = replace(system, forces=(), support=None, hoisting=None)
    equations = Minimal(quiet, tuple(Recursion(group, tail=1) for group in quiet.groups), counts_work=False)
    y, half = equations.layout.begin(start), equations.layout.half
    units = equations.scale[half:] * system.rate
    if np.any(np.abs(equations.derivative(0.0, y[:, None])[half:, 0]) > NOISE_OF_SUM * units * (1 + np.abs(y).max())):
        return False
    perturbations = np.repeat(y[:, None], half, axis=1) + 1j * IMAGINARY_STEP * np.eye(len(y))[:, :half]
    growing = np.linalg.eigvals(equations.derivative(0.0, perturbations)[half:].imag / IMAGINARY_STEP)
    return bool(growing.real.max() > GROWTH_NOISE * np.abs(growing).max())


def _joint_stiffness(group: Group, angles: Floats) -> Floats:
    """The stiffness (N m/rad) of every joint at these angles, (n, P)."""
    stiffness, gamma = group.block.stiffness + 0.0, bend(group, angles)
    for term in group.laws:
        stiffness[term.rows, term.columns] += term.stiffness(gamma[term.rows, term.columns])
    return stiffness


def _falls(stiffness: Floats, weight: Floats) -> Any:
    """Whether V'' of each chain, with `weight` (n, P) and the joints' `stiffness`, has a negative pivot, (P,)."""
    pivot, falling = np.inf * weight[0], np.zeros(weight.shape[1], dtype=bool)
    for at in range(len(weight) - 1, -1, -1):
        below = stiffness[at + 1] if at + 1 < len(weight) else 0.0 * stiffness[0]
        pivot = weight[at] + stiffness[at] + below - below**2 / pivot
        falling |= pivot < 0
        pivot = np.where(pivot == 0, DIVISOR_MIN, pivot)
    return falling
