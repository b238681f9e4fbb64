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
from modal.report import Displayed, Summary, counted
from modal.scene import Escapement, Pendulum, Scene, VanDerPol, validate_scene
from modal.structure import Structure, is_damped
from modal.types import Floats, Ints
from nonlinear.system.prescribed import ActingForce, MovingSupport, acting_forces, moving_support
from nonlinear.system.springs import slack_of

if TYPE_CHECKING:
    from modal.vibration import Course, PrescribedMotion

NONE = (0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Excitation:
    """Self-excitation at the joints of P pendula of n links; each array is (n, P), 0 at joints without any.

    `strength` e and `curb` e/γ₀² (N m s/rad, N m s/rad³) give the torque (e − curb γ²) γ'; a kick has an `impulse`
    (N m s) and comes at an `angle` (rad).
    """

    strength: Floats
    curb: Floats
    impulse: Floats
    angle: Floats

    @property
    def steady(self) -> bool:
        """Whether any joint has a van der Pol torque."""
        return bool(self.strength.any())

    @property
    def kicks(self) -> bool:
        """Whether any joint has an escapement."""
        return bool(self.impulse.any())

    @property
    def table(self) -> Floats:
        """All four arrays, (4, n, P)."""
        return np.array([self.strength, self.curb, self.impulse, self.angle])

    def take(self, columns: Ints) -> Excitation:
        """The excitation of the pendula in these columns."""
        return Excitation(*self.table[:, :, columns])

    def times(self, factor: Any) -> Excitation:
        """The excitation with torques and kicks multiplied by a factor."""
        return Excitation(self.strength * factor, self.curb * factor, self.impulse * factor, self.angle)


def excitation_of(pendula: Sequence[Pendulum]) -> Excitation | None:
    """The excitation of pendula with equally many links, one column each; None where there is none."""
    if not any(link.drive for pendulum in pendula for link in pendulum.links):
        return None
    numbers = [[_numbers(link.drive) for link in pendulum.links for _ in range(link.count)] for pendulum in pendula]
    return Excitation(*np.ascontiguousarray(np.array(numbers).transpose(2, 1, 0)))


def _numbers(drive: VanDerPol | Escapement | None) -> tuple[float, float, float, float]:
    if drive is None:
        return NONE
    angle = radians(drive.angle_deg)
    if isinstance(drive, Escapement):
        return 0.0, 0.0, drive.impulse, angle
    return drive.strength, drive.strength / angle**2, 0.0, 0.0


def _link_numbers(pendula: Sequence[Pendulum], name: str) -> Floats | None:
    """A number of every link, (n, P), of pendula with equally many links; None where all are 0."""
    numbers = np.array(
        [[getattr(link, name) for link in pendulum.links for _ in range(link.count)] for pendulum in pendula]
    ).T
    return np.ascontiguousarray(numbers) if numbers.any() else None


@dataclass(frozen=True, eq=False)
class Group:
    """P pendula of n links: their arrays (n, P), the position of every link in the file (n, P), their numbers (P,).

    `excitation` is the drive of their joints, `friction` their dry friction (N m) and `quadratic_drag` (N s²/m²) that
    of their links, both (n, P); each may be None.
    """

    block: Block
    index: Ints
    pendula: Ints
    excitation: Excitation | None = None
    friction: Floats | None = None
    quadratic_drag: Floats | None = None

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
    def sprung(self) -> bool:
        """Whether any joint has a spring."""
        return bool(self.block.stiffness.any())

    @cached_property
    def has_dampers(self) -> bool:
        """Whether any joint has a damper."""
        return bool(self.block.damping.any())

    @cached_property
    def has_drag(self) -> bool:
        """Whether any link has drag."""
        return self.quadratic_drag is not None or bool(self.block.drag.any())

    @cached_property
    def has_van_der_pol(self) -> bool:
        """Whether any joint has a van der Pol torque."""
        return self.excitation is not None and self.excitation.steady

    @property
    def has_escapements(self) -> bool:
        """Whether any joint has an escapement."""
        return self.excitation is not None and self.excitation.kicks

    @cached_property
    def has_joint_torques(self) -> bool:
        """Whether the joints exert torques between kicks."""
        return self.sprung or self.has_dampers or self.has_van_der_pol


class Rail(NamedTuple):
    """Dry friction on the rail: a force (N), or a coefficient of the rail's reaction."""

    friction: float
    coefficient: float


@dataclass(frozen=True, eq=False, repr=False)
class System(Displayed):
    """Gravity, what carries the pendula and the groups of these, in SI units.

    `modal_damping` (n, n) is the D_modal of a plane scene's damping ratios in the coordinates (x, links), or None;
    `hoisting` the lengths that change in time, of which the groups hold the first; `support` the motion of a support
    that moves as prescribed, in whose frame the scene is then described; `rail` the dry friction on the rail; `forces`
    act on points of links and on the cart.  The `suspension` is what carries the pendula: of no coordinates on a fixed
    support, of one on a cart, and where the scene `is_structured` any `structure`, of whose springs `slack` tells which
    have no length as drawn.

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
    def mass(self) -> Floats:
        """Mass (kg) of every link in the order of the file, (L,)."""
        return self.by_link("mass")

    @cached_property
    def total_mass(self) -> float:
        """Total mass of all links and of what carries them, modal carriers excepted (kg)."""
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
        """Whether the mass matrix may turn singular on the way: of a massless cart, while what is damped decays."""
        return bool(self.cart and not np.any(self.cart.mass) and self.dissipates and not self.spatial)

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
        has_push = self.rail is not None or self.has_drag or bool(self.forces)
        return cart is not None and not (np.any(cart.damping) or np.any(cart.stiffness) or has_push)

    @property
    def excites(self) -> bool:
        """Whether any joint is self-excited."""
        return self.has_escapements or any(group.has_van_der_pol for group in self.groups)

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
        return self.dissipates or self.excites or self.hoisting is not None or bool(self.prescribed_motions)

    @cached_property
    def prescribed_motions(self) -> tuple[PrescribedMotion, ...]:
        """The functions of time that move the support and act as forces, in the order of the scene."""
        motions = [motion for _, motion in self.support.motions] if self.support else []
        return (*motions, *(force.motion for force in self.forces))

    def courses(self, *, drags: bool = False) -> tuple[Course, ...]:
        """What these bring: the support's accelerations, where links have drag its velocities; sizes of forces."""
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
    rig = rig_of(scene.replace(force=()) if scene.force else scene)
    hanging = [pendulum for pendulum in scene.pendulum for _ in range(pendulum.count)]
    sizes = np.array([rig.blocks[block].n for block, _, copies in rig.members for _ in range(copies)])
    columns = np.array([(block, column) for block, column, copies in rig.members for _ in range(copies)])
    first = np.concatenate(([0], np.cumsum(sizes)[:-1]))
    groups = []
    for number, block in enumerate(rig.blocks):
        pendula = np.flatnonzero(columns[:, 0] == number)
        index = first[pendula] + np.arange(block.n)[:, None]
        alike = [hanging[p] for p in pendula]
        excitation = excitation_of(alike) if scene.is_driven else None
        friction = _link_numbers(alike, "friction") if scene.has_friction else None
        drag = _link_numbers(alike, "quadratic_drag") if scene.has_drag else None
        groups.append(Group(block.take(columns[pendula, 1]), index, pendula, excitation, friction, drag))
    modal = _modal_dampers(scene) if scene.has_modal_damping and not rig.spatial else None
    labels, hoisting = coordinate_labels(rig), hoisting_of(scene, hoists)
    sources = modal, hoisting, _support(scene), _rail(scene), acting_forces(scene)
    system = System(
        rig.gravity, rig.support, tuple(groups), rig.spatial, labels, *sources, is_structured=scene.is_structured
    )
    return replace(system, slack=tuple(map(bool, slack_of(system))))


def _support(scene: Scene) -> MovingSupport | None:
    if not scene.is_moved:
        return None
    return moving_support(scene.motions)


def _rail(scene: Scene) -> Rail | None:
    cart = scene.cart
    return Rail(cart.friction, cart.friction_coefficient) if cart and cart.has_friction else None
