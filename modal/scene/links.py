"""A link of a pendulum: its mass and geometry, and the forces on it in addition to gravity.

Link i has mass m_i, length l_i (pivot to next joint), centre of mass at c_i along it and moment of inertia I_i
about that centre, in SI units.
A drive sustains the swing of a clock or a metronome: it acts on the angle γ between a link and the one above, measured
from equilibrium (at a top joint: from the vertical), and with opposite sign on the link above.
Dry friction at a joint opposes sliding with a constant torque, and holds the joint at rest up to that limit.  Drag,
−(drag + quadratic_drag |v|) v, acts at the centre of mass of a link against still air.

A loss angle φ is that of the complex stiffness k (1 + iφ) of a spring or a joint, and of a wire that gravity holds
straight: one number for all frequencies, or a table of them; between two of its frequencies it is linear on logarithmic
axes (on linear ones where a number is 0), beyond them constant.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self

from modal import pair
from modal.report import deferred
from modal.scene.hoist import Hoist
from modal.scene.laws import LAWS, POINT_FORCES, JointPart
from modal.scene.stored import Several
from modal.scene.validation import (
    COUNT,
    NON_NEGATIVE,
    POSITIVE,
    Part,
    Schema,
    any_kind,
    curve_problems,
    field,
    list_of,
    number,
    one_of,
    optional,
)

if TYPE_CHECKING:
    from modal.extend import JointLaw


class LossTable(Part):
    """Loss angles (rad) at ascending frequencies (Hz).

    >>> from modal.scene import LossTable
    >>> LossTable(frequency_hz=[1.0, 100.0], loss=[1e-4, 1e-3]).loss
    (0.0001, 0.001)
    """

    frequency_hz: Several[float] = field(list_of(number(ge=0, le=1e100)), "ascending", "Hz")
    loss: Several[float] = field(list_of(NON_NEGATIVE), "loss angles at these frequencies", "rad")

    def problems(self) -> Iterator[str]:
        """Lists that do not fit each other, frequencies that do not ascend."""
        if not (self.loss or self.frequency_hz):
            yield ".loss: must not be empty"
        yield from curve_problems("frequency_hz", "loss", self.frequency_hz, self.loss)


Loss = float | LossTable
"""A loss angle at all frequencies, or a table."""
NUMBER, TABLE = "(number)", "(table)"
"""Steps that the validator adds to the place of a loss angle."""


def _which(value: Any) -> str:
    return TABLE if isinstance(value, dict | LossTable) else NUMBER


LOSS_ANGLE: Schema = {
    "type": "tagged-union",
    "choices": {NUMBER: NON_NEGATIVE, TABLE: LossTable.schema()},
    "discriminator": _which,
}
"""A number of at least 0, or a table over frequency."""


def is_lossy(loss: Loss) -> bool:
    """Whether a loss angle is nonzero at some frequency."""
    return any(loss.loss) if isinstance(loss, LossTable) else loss > 0


Scalar = Callable[[float], Any]


class VanDerPol(JointPart):
    """The torque e (1 − (γ/γ₀)²) γ': supplies energy within γ₀ and dissipates it beyond.

    Alone on a lightly driven pendulum it keeps the amplitude 2 γ₀, with a damper d at the same joint 2 γ₀ √(1 − d/e)
    [Pantaleone2002, equation (1)].
    """

    kind: Literal["van-der-pol"] = field(one_of("van-der-pol"), default="van-der-pol")
    strength: float = field(POSITIVE, "e", "N m s/rad")
    angle_deg: float = field(number(ge=1e-6, le=180), "γ₀", "°")

    @property
    def law(self) -> JointLaw:
        """The torque at any angle and rate."""
        law: JointLaw = deferred("modal.extend.laws:VanDerPolLaw")()
        return law

    def stronger(self, factor: float) -> VanDerPol:
        """Return the drive with the torque multiplied by a factor."""
        return self.replace(strength=self.strength * factor)


class Escapement(Part):
    """A kick `impulse` (N m s) in the direction of motion each time that |γ| passes `angle_deg` outwards.

    Kicks alternate between the two sides, as the pallets of an anchor do; a swing that stays within the angle gets
    none [Bennett2002, §4].
    """

    kind: Literal["escapement"] = field(one_of("escapement"), default="escapement")
    impulse: float = field(POSITIVE, "of one kick", "N m s")
    angle_deg: float = field(number(ge=0, lt=180), "joint angle of the kick", "°", default=0.0)

    def stronger(self, factor: float) -> Escapement:
        """Return the escapement with the kick multiplied by a factor."""
        return self.replace(impulse=self.impulse * factor)


Drive = VanDerPol | Escapement


class Link(Part):
    """Mass and length of a link, and the forces on it in addition to gravity.

    `loss` is φ of stiffness (1 + iφ), `wire_loss` that of (weight below/length)(1 + iφ), already diluted.
    """

    mass: float = field(POSITIVE, "positive", "kg")
    length: float = field(POSITIVE, "from the upper joint to the next one, or to the end; before a hoist", "m")
    damping: float = field(NON_NEGATIVE, "damper at the upper joint", "N m s/rad", default=0.0)
    stiffness: float = field(NON_NEGATIVE, "spring at the upper joint", "N m/rad", default=0.0)
    friction: float = field(NON_NEGATIVE, "dry friction at the upper joint, in the plane", "N m", default=0.0)
    drag: float = field(NON_NEGATIVE, "linear drag of the centre of mass against still air", "N s/m", default=0.0)
    quadratic_drag: float = field(NON_NEGATIVE, "quadratic drag of the centre of mass", "N s²/m²", default=0.0)
    rotor_inertia: float = field(
        NON_NEGATIVE, "rotor of a drive at the upper joint, before its gear", "kg m²", default=0.0
    )
    gear_ratio: float = field(POSITIVE, "turns of that rotor for one turn of the joint", "", default=1.0)
    loss: Loss = field(LOSS_ANGLE, "loss angle of the spring at the joint, or a table", "rad", default=0.0)
    wire_loss: Loss = field(LOSS_ANGLE, "loss angle of the rope of a bob, diluted, or a table", "rad", default=0.0)
    drive: Drive | None = field(optional(any_kind(VanDerPol, Escapement)), "at the upper joint", default=None)
    law: JointPart | tuple[JointPart, ...] | None = field(LAWS, "laws of the upper joint, by their kinds", default=None)
    point_force: JointPart | tuple[JointPart, ...] | None = field(
        POINT_FORCES, "forces on the centre of mass, by their kinds", default=None
    )
    hoist: Hoist | None = field(optional(Hoist.schema()), "of a bob: how its length changes in time", default=None)
    count: int = field(COUNT, "number of equal links in a row", default=1)

    is_uniform: ClassVar[bool] = True
    """Whether the centre scales with the length and the inertia with mass times length²."""
    extensive: ClassVar[tuple[str, ...]] = (
        *("mass", "damping", "stiffness", "friction", "drag", "quadratic_drag", "rotor_inertia"),
    )

    @property
    def laws(self) -> tuple[JointPart, ...]:
        """The laws of its upper joint, with that of a drive that acts between kicks."""
        return tuple(part for _, part in self.placed_laws)

    @property
    def placed_laws(self) -> list[tuple[tuple[str | int, ...], JointPart]]:
        """Return the same with the path of each."""
        several = isinstance(self.law, tuple)
        laws = self.law if isinstance(self.law, tuple) else (self.law,) if self.law else ()
        placed: list[tuple[tuple[str | int, ...], JointPart]] = []
        for k, part in enumerate(laws):
            placed.append((("law", k) if several else ("law",), part))
        if isinstance(self.drive, VanDerPol):
            placed.append((("drive",), self.drive))
        return placed

    @property
    def placed_forces(self) -> list[tuple[tuple[str | int, ...], Any]]:
        """Return the forces on its centre of mass with the path of each."""
        if not isinstance(self.point_force, tuple):
            return [(("point_force",), self.point_force)] if self.point_force else []
        return [(("point_force", k), part) for k, part in enumerate(self.point_force)]

    @property
    def linear_drag(self) -> float:
        """The linear drag (N s/m), including that of these forces."""
        of_forces: float = sum(part.linear_drag for _, part in self.placed_forces)
        return self.drag + of_forces

    def laws_that(self, stays: Callable[[JointLaw], bool]) -> tuple[JointPart, ...] | None:
        """Return the laws of `law` that are selected."""
        laws = self.law if isinstance(self.law, tuple) else (self.law,) if self.law else ()
        return tuple(part for part in laws if stays(part.law)) or None

    @property
    def reflected_inertia(self) -> float:
        """The inertia J = rotor_inertia · gear_ratio² (kg m²) of its rotor at the upper joint."""
        return self.rotor_inertia * self.gear_ratio**2

    @property
    def linear_coefficients(self) -> tuple[float, float]:
        """Stiffness (N m/rad) and damping (N m s/rad) of the upper joint about equilibrium."""
        if self.law is None:
            return self.stiffness, self.damping
        stiffnesses, dampings = zip(*(part.linear_coefficients for part in self.laws), strict=True)
        return self.stiffness + sum(stiffnesses), self.damping + sum(dampings)

    def heavier(self, factor: float) -> Self:
        """Return as many copies as one link, with a drive as many times stronger; not for links with a law."""
        drive = self.drive and self.drive.stronger(factor)
        return self.replace(drive=drive, **{name: getattr(self, name) * factor for name in self.extensive})

    def problems(self) -> Iterator[str]:
        """A hoist or wire loss of a link other than a bob, a hoist that cannot begin here, a loss without a spring."""
        if is_lossy(self.wire_loss) and getattr(self, "kind", "") != "bob":
            yield '.wire_loss: only a bob hangs on a wire: write kind = "bob", or give loss to a stiffness'
        if is_lossy(self.loss) and not self.stiffness:
            yield ".loss: is that of the joint's stiffness, which is 0: give a stiffness"
        if self.hoist and getattr(self, "kind", "") != "bob":
            yield '.hoist: only the massless rope of a bob can change its length: write kind = "bob"'
        elif self.hoist:
            yield from (f".hoist{problem}" for problem in self.hoist.problems_from(self.length))
        if self.gear_ratio != 1 and not self.rotor_inertia:
            yield f".gear_ratio = {self.gear_ratio:g}: needs a rotor_inertia"

    def length_at(self, time: float) -> float:
        """The length (m) at a time (s)."""
        return float(self.hoist.law(self.length)(time)[0]) if self.hoist else self.length


class _Simple(Link):
    """A link whose centre and inertia follow from its kind, mass and length."""

    kind: str

    def proportions(self, m: Any, l: Any, scalar: Scalar = float) -> tuple[Any, Any]:
        """Centre and inertia for a mass and a length in numbers of any type, made from floats by `scalar`."""
        return pair.proportions(self.kind, m, l)

    @property
    def centre(self) -> float:
        """Distance (m) from the upper joint to the centre of mass."""
        return float(self.proportions(self.mass, self.length)[0])

    @property
    def inertia(self) -> float:
        """Moment of inertia (kg m²) about the centre of mass."""
        return float(self.proportions(self.mass, self.length)[1])


class Bob(_Simple):
    """A point mass at the end of a massless rod: c = l, I = 0.

    >>> from modal import Bob
    >>> bob = Bob(mass=2.0, length=1.5, damping=0.1)
    >>> bob.centre, bob.inertia
    (1.5, 0.0)
    """

    kind: Literal["bob"] = field(one_of("bob"), default="bob")


class Rod(_Simple):
    """A uniform rod: c = l/2, I = m l²/12.

    >>> from modal import Rod
    >>> rod = Rod(mass=3.0, length=2.0)
    >>> rod.centre, rod.inertia
    (1.0, 1.0)
    """

    kind: Literal["rod"] = field(one_of("rod"), default="rod")


class Body(Link):
    """A rigid body: any centre of mass c ≥ 0 (m), on the link or beyond it, and any inertia I ≥ 0 (kg m²).

    >>> from modal import Body
    >>> body = Body(mass=2.0, length=1.0, centre=0.4, inertia=0.05)
    >>> body.centre, body.inertia
    (0.4, 0.05)
    """

    kind: Literal["body"] = field(one_of("body"), default="body")
    centre: float = field(NON_NEGATIVE, "from the upper joint to the centre of mass", "m")
    inertia: float = field(NON_NEGATIVE, "moment of inertia about the centre of mass", "kg m²")

    is_uniform: ClassVar[bool] = False
    extensive: ClassVar[tuple[str, ...]] = (*Link.extensive, "inertia")

    def proportions(self, m: Any, l: Any, scalar: Scalar = float) -> tuple[Any, Any]:
        """Its own centre and inertia, converted by `scalar` to the type of mass and length."""
        return scalar(self.centre), scalar(self.inertia)

    def problems(self) -> Iterator[str]:
        """A body without moment of inertia about its pivot, or with a hoist."""
        yield from super().problems()
        if self.centre == 0 and self.inertia == 0:
            yield ".inertia = 0.0: must be positive if the centre is at the pivot"


AnyLink = Bob | Rod | Body
