"""A scene as arrays with an entry for every copy of a pendulum, since each may start differently.

Pendula with the same number of links form one group of (n, P) arrays; `index` gives the positions of their links in the
order of the file, pendulum by pendulum, top to bottom, which is the order of all output.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from math import inf, radians
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from modal.assembly import (
    Block,
    CartNumbers,
    Hoisting,
    Hoists,
    coordinate_labels,
    hoisting_of,
    modal_dampers,
    rig_of,
)
from modal.extend import JointLaw
from modal.report import Displayed, Summary, counted, deferred
from modal.scene import Escapement, Pendulum, Scene, validate_scene
from modal.structure import CarrierEnd, End, GroundEnd, LinkEnd, Structure, drawn_together, is_damped
from modal.types import IMAGINARY_STEP, Floats, Ints
from nonlinear.system.prescribed import ActingForce, MovingSupport, acting_forces, moving_support

if TYPE_CHECKING:
    from modal.vibration import Course, PrescribedMotion
    from nonlinear.system.loops import ActingLoop


@dataclass(frozen=True, eq=False)
class Excitation:
    """Kicks at the joints of P pendula of n links; each array is (n, P), 0 at joints without any.

    A kick has an `impulse` (N m s) and comes at an `angle` (rad).
    """

    impulse: Floats
    angle: Floats

    @property
    def table(self) -> Floats:
        """Both arrays, (2, n, P)."""
        return np.array([self.impulse, self.angle])

    def take(self, columns: Ints) -> Excitation:
        """The excitation of the pendula in these columns."""
        return Excitation(*self.table[:, :, columns])

    def times(self, factor: Any) -> Excitation:
        """The excitation with kicks multiplied by a factor."""
        return Excitation(self.impulse * factor, self.angle)


def excitation_of(pendula: Sequence[Pendulum]) -> Excitation | None:
    """The kicks of pendula with equally many links, one column each; None if there are none."""
    drives = [[link.drive for link in pendulum.chain] for pendulum in pendula]
    numbers = [
        [(drive.impulse, radians(drive.angle_deg)) if isinstance(drive, Escapement) else (0.0, 0.0) for drive in chain]
        for chain in drives
    ]
    excitation = Excitation(*np.ascontiguousarray(np.array(numbers).transpose(2, 1, 0)))
    return excitation if excitation.impulse.any() else None


@dataclass(frozen=True, eq=False)
class JointTerm:
    """A law at the joints (rows, columns) of a group, (C,) each, with its parameters `numbers`, (C, ...) each.

    Its torques are multiplied by `scale`; `order` is its place among the laws of these links.  One that does not
    `pull` has no torque of its potential.
    """

    law: JointLaw
    order: int
    rows: Ints
    columns: Ints
    numbers: tuple[Any, ...]
    scale: Any = 1.0
    pulls: bool = True

    def torques(self, bends: Any, rates: Any) -> tuple[Any, Any]:
        """The conservative part and the part that does work (N m), (C, ...), from these joints' bends and rates."""
        elastic, working = self.law.torques(bends, rates, self._parameters(bends))
        return self._times_scale(elastic) if self.pulls else 0.0, self._times_scale(working)

    def energy(self, bends: Any) -> Any:
        """The energy (J) of its potential above that at rest, (C, ...)."""
        if not self.law.has_potential:
            return 0.0
        parameters = self._parameters(bends)
        bent, at_rest = (self.law.potential(angle, parameters) for angle in (bends, 0.0 * bends))
        return self._times_scale(bent - at_rest)

    def _times_scale(self, values: Any) -> Any:
        return values * spread(np.asarray(self.scale), values) if np.any(self.scale != 1.0) else values

    def _parameters(self, like: Any) -> dict[str, Any]:
        names = (parameter.name for parameter in self.law.parameters)
        return {name: spread(number, like) for name, number in zip(names, self.numbers, strict=True)}

    def forces(self, velocities: Any) -> Any:
        """The forces (N) of one on centres of mass, (d, C, ...), at velocities (m/s)."""
        law: Any = self.law
        force = law.force(list(velocities), self._parameters(velocities[0]))
        return np.stack([self._times_scale(part + 0.0 * velocities[0]) for part in force])

    def stiffness(self, bends: Floats) -> Floats:
        """The stiffness (N m/rad) at these bends, (C,), by a complex step."""
        return np.asarray(-np.imag(sum(self.torques(bends + 1j * IMAGINARY_STEP, 0.0 * bends))) / IMAGINARY_STEP)

    def take(self, columns: Ints) -> JointTerm:
        """The term of the pendula in these columns, as many as there are."""
        places = [(j, k) for k, column in enumerate(columns.tolist()) for j in np.flatnonzero(self.columns == column)]
        which, new_columns = np.array(places, dtype=np.int64).reshape(-1, 2).T
        scale = self.scale[which] if np.ndim(self.scale) else self.scale
        numbers = tuple(number[which] for number in self.numbers)
        return replace(self, rows=self.rows[which], columns=new_columns, numbers=numbers, scale=scale)

    def at(self, which: int) -> JointTerm:
        """The term of one of its joints."""
        one = slice(which, which + 1)
        scale = self.scale[one] if np.ndim(self.scale) else self.scale
        numbers = tuple(number[one] for number in self.numbers)
        return replace(self, rows=self.rows[one], columns=self.columns[one], numbers=numbers, scale=scale)

    def times(self, factor: Any) -> JointTerm:
        """The term with this many times the torques, one number or one for every pendulum."""
        return replace(self, scale=self.scale * (factor[self.columns] if np.ndim(factor) else factor))


def spread(constant: Any, like: Any) -> Any:
    """An array of constants, of joints or of links, next to values with further axes."""
    return constant.reshape(*constant.shape, *[1] * (np.ndim(like) - constant.ndim))


def joint_terms(pendula: Sequence[Pendulum], where: str = "placed_laws") -> tuple[JointTerm, ...]:
    """The laws at the joints of pendula with equally many links, one column each, or the forces on their centres."""
    places: dict[tuple[type[JointLaw], int], list[tuple[int, int, dict[str, float]]]] = {}
    for column, pendulum in enumerate(pendula):
        for row, link in enumerate(pendulum.chain):
            for k, (_, part) in enumerate(getattr(link, where)):
                places.setdefault((type(part.law), k), []).append((row, column, part.numbers))
    terms = []
    for (law, order), entries in places.items():
        rows, columns, numbers = zip(*entries, strict=True)
        arrays = tuple(np.array([values[parameter.name] for values in numbers]) for parameter in law.parameters)
        terms.append(JointTerm(law(), order, np.array(rows), np.array(columns), arrays))
    return tuple(terms)


def _link_numbers(pendula: Sequence[Pendulum], name: str) -> Floats | None:
    """A number of every link, (n, P), of pendula with equally many links; None if all are 0."""
    numbers = np.array([[getattr(link, name) for link in pendulum.chain] for pendulum in pendula]).T
    return np.ascontiguousarray(numbers) if numbers.any() else None


@dataclass(frozen=True, eq=False)
class Group:
    """P pendula of n links: their arrays (n, P), the position of every link in the file (n, P), their numbers (P,).

    `excitation` are the kicks of their joints, `friction` their dry friction (N m) and `quadratic_drag` (N s²/m²) that
    of their links, both (n, P); each may be None. `laws` act at their joints next to springs and dampers,
    `point_forces` on their centres next to drag.
    """

    block: Block
    index: Ints
    pendula: Ints
    excitation: Excitation | None = None
    friction: Floats | None = None
    quadratic_drag: Floats | None = None
    laws: tuple[JointTerm, ...] = ()
    point_forces: tuple[JointTerm, ...] = ()

    @property
    def n(self) -> int:
        """Number of links in each pendulum."""
        return self.block.n

    @cached_property
    def moment(self) -> Floats:
        """Moment of inertia about the upper joint, I + m c² (kg m²), (n, P)."""
        return self.block.inertia + self.block.mass * self.block.centre**2

    @cached_property
    def static(self) -> Floats:
        """First moment m c (kg m) about the upper joint, (n, P)."""
        return self.block.mass * self.block.centre

    @cached_property
    def rest(self) -> Floats:
        """Equilibrium angle (rad) of every link, (n, P)."""
        return np.where(self.block.sigma > 0, 0.0, np.pi)

    @cached_property
    def joint_rest(self) -> Floats:
        """Angle (rad) of every link relative to the one above at which its joint spring is relaxed, (n, P)."""
        return np.diff(self.rest, axis=0, prepend=0.0)

    @cached_property
    def has_rotors(self) -> bool:
        """Whether any joint has a rotor."""
        return bool(self.block.rotor.any())

    @cached_property
    def sprung(self) -> bool:
        """Whether any joint has a spring, or a law with a potential."""
        return bool(self.block.stiffness.any()) or any(term.law.has_potential for term in self.laws)

    @cached_property
    def has_dampers(self) -> bool:
        """Whether any joint has a damper, or a law that dissipates."""
        return bool(self.block.damping.any()) or any(term.law.is_dissipative for term in self.laws)

    @cached_property
    def has_drag(self) -> bool:
        """Whether any link has drag."""
        return self.quadratic_drag is not None or bool(self.block.drag.any()) or bool(self.point_forces)

    @cached_property
    def has_active_laws(self) -> bool:
        """Whether any joint has a law that may supply energy."""
        return any(not (term.law.is_conservative or term.law.is_dissipative) for term in self.laws)

    @property
    def has_escapements(self) -> bool:
        """Whether any joint has an escapement."""
        return self.excitation is not None

    @cached_property
    def has_joint_torques(self) -> bool:
        """Whether the joints exert torques between kicks."""
        return self.sprung or self.has_dampers or bool(self.laws)


class Rail(NamedTuple):
    """Dry friction on the rail: a force (N), or a coefficient of the rail's reaction."""

    friction: float
    coefficient: float


@dataclass(frozen=True, eq=False, repr=False)
class System(Displayed):
    """Gravity, the supports of the pendula and the groups of these, in SI units.

    `modal_damping` (n, n) is the D_modal of a plane scene's damping ratios in the coordinates (x, links), or None;
    `hoisting` the lengths that change in time, of which the groups hold the first; `support` the motion of a support
    that moves as prescribed, in whose frame the scene is then described; `rail` the dry friction on the rail; `forces`
    act on points of links and on the cart. The `suspension` holds the supports of the pendula: no coordinates for a
    fixed support, one for a cart, and if the scene `is_structured` any `structure`, of whose springs `slack` says which
    have no length as drawn. `loops` of feedback act like forces, by their measurements.

    >>> from modal import load
    >>> from nonlinear import system_of
    >>> system = system_of(load("paper-cart-2"))
    >>> system.labels, system.spatial
    (('x', 'theta[1,1]', 'theta[1,2]', 'theta[2,1]', 'theta[2,2]'), False)
    """

    gravity: float
    suspension: Structure
    groups: tuple[Group, ...]
    spatial: bool
    labels: tuple[str, ...]
    modal_damping: Floats | None = None
    hoisting: Hoisting | None = None
    support: MovingSupport | None = None
    rail: Rail | None = None
    forces: tuple[ActingForce, ...] = ()
    is_structured: bool = False
    slack: tuple[bool, ...] = ()
    loops: tuple[ActingLoop, ...] = ()

    def _summary(self) -> Summary:
        where = "on a cart" if self.cart else "on a support that moves" if self.support else "on a fixed support"
        where = f"on a structure of {counted(self.first, 'coordinate', 'coordinates')}" if self.structure else where
        space = " in space" if self.spatial else ""
        links, pendula = counted(self.n_links, "link", "links"), counted(self.n_pendula, "pendulum", "pendula")
        return Summary(f"System of {links} in {pendula} {where}{space}", [("gravity", f"{self.gravity:g} m/s²")])

    @property
    def structure(self) -> Structure | None:
        """The suspension where it is more than a fixed support or one cart, else None."""
        return self.suspension if self.is_structured else None

    @cached_property
    def cart(self) -> CartNumbers | None:
        """The cart that alone carries the pendula; None on a fixed support and on a structure."""
        if self.is_structured or not self.first:
            return None
        (carrier,) = self.suspension.carriers
        return CartNumbers(carrier.mass, *carrier.damping, *carrier.stiffness)

    @property
    def first(self) -> int:
        """How many coordinates there are before those of links."""
        return self.suspension.size

    @property
    def first_units(self) -> Floats:
        """Natural units of these, (first,): the longest link for displacements (m), 1 for angles (rad)."""
        units = np.full(self.first, self.length)
        units[list(self.suspension.turning)] = 1.0
        return units

    @property
    def first_columns(self) -> list[str]:
        """How files name these, then their rates: NAME_m, NAME_m_per_s; of one cart and of none x_m, x_dot_m_per_s."""
        if self.structure is None:
            return ["x_m", "x_dot_m_per_s"]
        names = ["x_m" if name == "x" else name for name in self.structure.names]
        return names + ["x_dot_m_per_s" if name == "x_m" else f"{name}_per_s" for name in names]

    @cached_property
    def n_links(self) -> int:
        """Number of links, counting copies."""
        return sum(group.index.size for group in self.groups)

    @cached_property
    def n_pendula(self) -> int:
        """Number of pendula, counting copies."""
        return sum(group.index.shape[1] for group in self.groups)

    @cached_property
    def rest(self) -> Floats:
        """Equilibrium angle (rad) of every link, in the order of the file, (L,)."""
        angles = np.empty(self.n_links)
        for group in self.groups:
            angles[group.index] = group.rest
        return angles

    @cached_property
    def coordinates_at_rest(self) -> Floats:
        """The coordinates q at rest: 0 before those of links, then `rest`, in space unit vectors, (half,)."""
        links = np.outer(self.by_link("sigma"), [0.0, 0.0, 1.0]) if self.spatial else self.rest
        return np.concatenate((np.zeros(self.first), links.ravel()))

    @cached_property
    def mass(self) -> Floats:
        """Mass (kg) of every link in the order of the file, (L,)."""
        return self.by_link("mass")

    @cached_property
    def total_mass(self) -> float:
        """Total mass of all links and of their supports, modal supports excepted (kg)."""
        return float(self.mass.sum()) + sum(float(carrier.mass) for carrier in self.suspension.carriers)

    @cached_property
    def pendulum(self) -> Ints:
        """The pendulum, from 0, to which each link belongs, (L,)."""
        pendula = np.empty(self.n_links, dtype=np.int64)
        for group in self.groups:
            pendula[group.index] = group.pendula
        return pendula

    @cached_property
    def length(self) -> float:
        """Length of the longest link (m)."""
        return float(self.by_link("length").max())

    @property
    def rate(self) -> float:
        """Natural unit of angular rates, sqrt(g/l) of the longest link (rad/s)."""
        return float(np.sqrt(self.gravity / self.length))

    @cached_property
    def energy(self) -> float:
        """Natural unit of energies, g Σ b (J)."""
        return self.gravity * sum(float(group.block.b.sum()) for group in self.groups)

    @cached_property
    def may_turn_singular(self) -> bool:
        """Whether the mass matrix may turn singular on the way: of a massless cart, while damped motions decay."""
        loses = self.dissipates or bool(self.loops)
        return bool(self.cart and not np.any(self.cart.mass) and loses and not self.spatial)

    @property
    def dissipates(self) -> bool:
        """Whether there is any damper, drag or dry friction."""
        has_dampers = is_damped(self.suspension) or any(group.has_dampers for group in self.groups)
        return self.modal_damping is not None or has_dampers or self.has_drag or self.rubs

    @property
    def has_drag(self) -> bool:
        """Whether any link has drag."""
        return any(group.has_drag for group in self.groups)

    @property
    def rubs(self) -> bool:
        """Whether there is dry friction at a joint or on the rail."""
        return self.rail is not None or any(group.friction is not None for group in self.groups)

    @property
    def coasts(self) -> bool:
        """Whether nothing outside pushes along the rail: a cart without spring, damper, friction, drag or force."""
        cart = self.cart
        has_push = self.rail is not None or self.has_drag or bool(self.acting)
        return cart is not None and not (np.any(cart.damping) or np.any(cart.stiffness) or has_push)

    @property
    def has_rotors(self) -> bool:
        """Whether any joint has a rotor."""
        return any(group.has_rotors for group in self.groups)

    @property
    def excites(self) -> bool:
        """Whether any joint is self-excited."""
        return self.has_escapements or any(group.has_active_laws for group in self.groups)

    @property
    def has_escapements(self) -> bool:
        """Whether any joint has an escapement."""
        return any(group.has_escapements for group in self.groups)

    @property
    def kicks_a_period(self) -> int:
        """Kicks of all escapements in one period."""
        return sum(2 * int(np.count_nonzero(group.excitation.impulse)) for group in self.groups if group.excitation)

    @property
    def works(self) -> bool:
        """Whether energy enters or leaves the system."""
        moves = self.hoisting is not None or bool(self.prescribed_motions)
        return self.dissipates or self.excites or moves or bool(self.loops)

    @property
    def is_sampled(self) -> bool:
        """Whether any loop holds its input between samples."""
        return any(loop.sample_time for loop in self.loops)

    @property
    def acting(self) -> tuple[ActingForce, ...]:
        """All that acts on points and coordinates: forces, then feedback loops."""
        return (*self.forces, *self.loops)

    @cached_property
    def prescribed_motions(self) -> tuple[PrescribedMotion, ...]:
        """The functions of time that move the support and act as forces, in the order of the scene."""
        motions = [motion for _, motion in self.support.motions] if self.support else []
        return (*motions, *(force.motion for force in self.forces))

    def courses(self, *, drags: bool = False) -> tuple[Course, ...]:
        """The inputs: the support's accelerations, where links have drag its velocities; sizes of forces."""
        if not self.prescribed_motions:
            return ()
        from modal.vibration import Course

        support_motions = self.prescribed_motions[: len(self.prescribed_motions) - len(self.forces)]
        orders = ((2, 1) if drags or self.has_drag else (2,)) if support_motions else ()
        accelerations = [Course(motion, order) for order in orders for motion in support_motions]
        return (*accelerations, *(force.course for force in self.forces))

    @cached_property
    def is_analytic(self) -> bool:
        """Whether all that time brings is plain arithmetic of constants and of the time."""
        return bool(self.prescribed_motions) and all(motion.constants for motion in self.prescribed_motions)

    @property
    def shortest(self) -> float:
        """The time (s) in which a support or a force may change substantially."""
        return min((motion.shortest for motion in self.prescribed_motions), default=inf)

    def by_link(self, name: str) -> Floats:
        """An array of the blocks in the order of the file, (L,)."""
        values = np.empty(self.n_links)
        for group in self.groups:
            values[group.index] = getattr(group.block, name)
        return values


@lru_cache(maxsize=4)
def _modal_dampers(scene: Scene) -> Floats:
    """D_modal of a scene, computed once for all that ask for its system."""
    D = modal_dampers(rig_of(scene))
    D.flags.writeable = False
    return D


def system_of(scene: Scene, hoists: Hoists | None = None) -> System:
    """The arrays of a scene, with an entry for each copy of a pendulum.

    Parameters
    ----------
    scene
        Any scene, in the plane or in space.
    hoists
        Laws of lengths in place of the scene's own, as those of `simulate`.

    Returns
    -------
    System
        The numbers that the equations of motion read, in SI units, and the labels of the coordinates.

    Examples
    --------
    >>> from modal import load
    >>> from nonlinear import system_of
    >>> len(system_of(load("paper-cart-2")).groups)
    1
    """
    validate_scene(scene)
    lawless = scene.without_laws
    rig = rig_of(lawless.replace(force=()) if scene.force else lawless)
    hanging = scene.hanging
    sizes = np.array([rig.blocks[block].n for block, _, copies in rig.members for _ in range(copies)])
    columns = np.array([(block, column) for block, column, copies in rig.members for _ in range(copies)])
    first = np.concatenate(([0], np.cumsum(sizes)[:-1]))
    groups = []
    for number, block in enumerate(rig.blocks):
        pendula = np.flatnonzero(columns[:, 0] == number)
        index = first[pendula] + np.arange(block.n)[:, None]
        alike = [hanging[p] for p in pendula]
        excitation = excitation_of(alike) if scene.is_driven else None
        laws = joint_terms(alike) if scene.has_laws else ()
        forces = joint_terms(alike, "placed_forces") if scene.has_drag else ()
        friction = _link_numbers(alike, "friction") if scene.has_friction else None
        drag = _link_numbers(alike, "quadratic_drag") if scene.has_drag else None
        groups.append(Group(block.take(columns[pendula, 1]), index, pendula, excitation, friction, drag, laws, forces))
    modal = _modal_dampers(scene) if scene.has_modal_damping and not rig.spatial else None
    labels, hoisting = coordinate_labels(rig), hoisting_of(scene, hoists)
    support, cart = moving_support(scene.motions) if scene.is_moved else None, scene.cart
    rail = Rail(cart.friction, cart.friction_coefficient) if cart and cart.has_friction else None
    sources = modal, hoisting, support, rail, acting_forces(scene)
    system = System(
        rig.gravity, rig.support, tuple(groups), rig.spatial, labels, *sources, is_structured=scene.is_structured
    )
    loops = deferred("nonlinear.system.loops:acting_loops")(scene) if scene.feedback else ()
    return replace(system, slack=tuple(map(bool, slack_of(system))), loops=loops)


def place_of(system: System, link: int) -> tuple[Any, int, int]:
    """The group, row and column of a link in the order of the file."""
    for group in system.groups:
        rows, columns = np.nonzero(group.index == link)
        if len(rows):
            return group, int(rows[0]), int(columns[0])
    raise IndexError(link)


def drawn_place(system: System, end: End) -> tuple[Any, Any] | None:
    """Where an end is drawn (m); None for the ground below the other end."""
    structure = system.suspension
    if isinstance(end, GroundEnd):
        return end.place
    if isinstance(end, CarrierEnd):
        return _drawn_point(structure, end.carrier, end.where)
    group, row, column = place_of(system, end.link)
    pivot = structure.pivots[int(group.pendula[column])]
    x, z = _drawn_point(structure, pivot.carrier, pivot.where)
    for upper in range(row):
        z = z + group.block.length[upper, column]
    return x, z + (group.block.centre[row, column] if end.below is None else end.below)


def _drawn_point(structure: Structure, number: int, where: Any) -> tuple[Any, Any]:
    carrier = structure.carriers[number]
    if isinstance(where, int):
        return carrier.position
    return carrier.position[0] + where[0], carrier.position[1] + where[1]


def ends_may_meet(system: System) -> bool:
    """Whether pendula can bring both ends of a spring with a length as drawn together, where its force turns round.

    There it jumps, which series of a motion do not see and error control does; supports are taken to stay apart.
    """
    for spring in system.suspension.springs:
        if spring.torsion or not np.any(spring.stiffness) or not any(isinstance(end, LinkEnd) for end in spring.ends):
            continue
        first, second = (drawn_place(system, end) for end in spring.ends)
        if first is not None and second is not None and not np.all(drawn_together(first, second)):
            length = np.min(np.hypot(np.subtract(first[0], second[0]), np.subtract(first[1], second[1])))
            if length <= sum(_reach(system, end) for end in spring.ends):
                return True
    return False


def _reach(system: System, end: End) -> float:
    """How far (m) a pendulum brings an end from where it is drawn."""
    if not isinstance(end, LinkEnd):
        return 0.0
    group, row, column = place_of(system, end.link)
    distance = group.block.centre[row, column] if end.below is None else end.below
    return 2 * float(np.max(np.sum(group.block.length[:row, column], axis=0) + distance))


def slack_of(system: System) -> tuple[Any, ...]:
    """Which springs of a structure have no length as drawn, of arrays each; no torsion spring has one."""
    slack = []
    for spring in system.suspension.springs:
        first, second = (None, None) if spring.torsion else (drawn_place(system, end) for end in spring.ends)
        slack.append(first is None or second is None or drawn_together(first, second))
    return tuple(slack)
