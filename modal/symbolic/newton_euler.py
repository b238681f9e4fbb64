"""Newton–Euler equations of every part of a scene, and the constraints that join the parts: paper 000, IV.

A cart has Σ F = m a along and down, a link the same and Σ M = I θ'' about its centre; each link hangs by its upper
joint, whose acceleration is that of the chain above, two equations more; the rail keeps a cart from sinking.  With n
links 5n equations, and 3 of a cart, for as many accelerations and forces: 10n + 3 for n double pendula.  In these
all of them are linear,

    A u = F,    u = (accelerations of the cart and of every link, the rail's push, the joints' forces)

Which force acts on which part is read from `modal.scene.free_body` alone, centre and inertia of a rod or a bob from
`modal.pair`; nothing here calls the numeric equations of `nonlinear`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import sympy as sp

from modal import pair
from modal.errors import SceneError
from modal.extend.registry import call
from modal.report import Displayed, Summary, capital
from modal.scene import title_of
from modal.scene.free_body import Effort, FreeBodies, FreeBody, force_names, joint_law, normal
from modal.symbolic.carriers import Coordinate, coordinate
from modal.symbolic.derivation import MOST_WRITTEN
from modal.symbolic.papers import equal, residual
from modal.symbolic.typesetting import Line, Section

STILL = ("fixed", "moved")
"""Kinds of supports whose motion is known, so that no balance is written of them."""


@dataclass(frozen=True, eq=False, repr=False)
class NewtonEuler(Displayed):
    """The equations of the parts of a scene, `bodies`, in symbols.

    >>> from modal import load
    >>> from modal.scene import free_bodies
    >>> system = NewtonEuler(free_bodies(load("paper-cart-3"), "paper"))
    >>> len(system.equations), len(system.unknowns), system.equations[0]
    (33, 33, Eq(-R_Bx_1 - R_Bx_2 - R_Bx_3, m_c*xddot))
    """

    bodies: FreeBodies

    def _summary(self) -> Summary:
        facts = [("parts", str(len(self.bodies.parts))), ("equations", str(len(self.unknowns)))]
        return Summary(f"Balances of Newton and Euler, {title_of(self.bodies.scene)}", facts)

    @cached_property
    def equations(self) -> list[Any]:
        """All of them: balances of every part in turn, then constraints."""
        balances = [form for part in self.bodies.parts for _, form in self.balances(part)]
        return [*balances, *(form for _, form in self.constraints())]

    @cached_property
    def unknowns(self) -> list[Any]:
        """Accelerations of the cart, then of each link, the rail's push, the force of each joint: as many."""
        links = self.bodies.parts[1:]
        accelerations = [c.a for part in links for c in self.motion(part)]
        pairs = (force_names(self.bodies.letters, part.index)[:2] for part in links)
        forces = [sp.Symbol(name) for pair_of_names in pairs for name in pair_of_names]
        if self.bodies.support.kind != "cart":
            return [*accelerations, *forces]
        x, z, _ = self.motion(self.bodies.support)
        return [x.a, z.a, *accelerations, sp.Symbol(normal(self.bodies.letters)), *forces]

    def linear_system(self) -> tuple[Any, Any]:
        """A and F of A u = F."""
        A, F = sp.linear_eq_to_matrix([residual(form) for form in self.equations], self.unknowns)
        return A, F

    def motion(self, part: FreeBody) -> tuple[Coordinate, Coordinate, Coordinate]:
        """The place of a part's centre, along the rail and down, and its angle."""
        down = self.bodies.downward
        return tuple(coordinate(name, *part.index) for name in ("x", down, "theta"))  # type: ignore[return-value]

    def proportions(self, part: FreeBody) -> tuple[Any, Any]:
        """The centre and the inertia of a link, as its kind makes them from its mass and length."""
        if part.kind == "body":
            return sp.Symbol(part.centre), sp.Symbol(part.inertia)
        centre, inertia = pair.proportions(part.kind, sp.Symbol(part.mass), sp.Symbol(part.length))
        return centre, sp.sympify(inertia)

    def balances(self, part: FreeBody) -> Iterator[tuple[str, Any]]:
        """Σ F = m a along the rail and down, and Σ M = I θ'' about the centre of a link."""
        if part.kind in STILL:
            return
        x, z, theta = self.motion(part)
        m = sp.Symbol(part.mass)
        rail_forces = [effort.sign * sp.Symbol(effort.along) for effort in part.efforts if effort.along]
        down = [effort.sign * _product(effort.down) for effort in part.efforts if effort.down]
        yield "momentum along the rail", equal(sp.Add(*rail_forces), m * x.a)
        yield "momentum down", equal(sp.Add(*down), m * z.a)
        if part.kind != "cart":
            moments = sp.Add(*(self._moment(part, effort) for effort in part.efforts))
            yield "moments about the centre", equal(moments, self.proportions(part)[1] * theta.a)

    def _moment(self, part: FreeBody, effort: Effort) -> Any:
        """The moment of an effort about the centre, positive the way θ grows."""
        if effort.turning:
            return effort.sign * sp.Symbol(effort.turning)
        if effort.at == "centre":
            return sp.S.Zero
        centre, theta = self.proportions(part)[0], self.motion(part)[2].q
        reach = {"upper": sp.S.Zero, "lower": sp.Symbol(part.length)}.get(effort.at, sp.Symbol(effort.reach))
        arm = reach - centre
        x_force, z_force = (_product(name) if name else sp.S.Zero for name in (effort.along, effort.down))
        return sp.expand(effort.sign * arm * (x_force * sp.cos(theta) - z_force * sp.sin(theta)))

    def constraints(self) -> Iterator[tuple[str, Any]]:
        """The rail below the cart, and of every link the acceleration of its centre along the rail and down."""
        support = self.bodies.support
        pivot_x, pivot_z = self.support_accelerations()
        if support.kind == "cart":
            x, z, _ = self.motion(support)
            pivot_x = x.a
            yield "the cart stays on the rail", equal(z.a, 0)
        for chain in self.bodies.pendula:
            joint_x, joint_z = pivot_x, pivot_z
            for part in chain:
                x, z, theta = self.motion(part)
                swing, sink = _unit_acceleration(theta)
                centre, length = self.proportions(part)[0], sp.Symbol(part.length)
                yield f"{part.words} along the rail", equal(x.a, joint_x + centre * swing)
                yield f"{part.words} down", equal(z.a, joint_z + centre * sink)
                joint_x, joint_z = joint_x + length * swing, joint_z + length * sink

    def support_accelerations(self) -> tuple[Any, Any]:
        """The accelerations of a support that moves along the rail and down, a_x and a_z; 0 if it does not."""
        ways = {motion.direction for motion in self.bodies.scene.motions}
        names = (("horizontal", "a_x"), ("vertical", f"a_{self.bodies.downward}"))
        x_acceleration, z_acceleration = (sp.Symbol(name) if way in ways else sp.S.Zero for way, name in names)
        return x_acceleration, z_acceleration

    def laws(self) -> Iterator[tuple[str, Any]]:
        """Return joint moments, drag, and spring and damper forces as functions of the motion."""
        cart = self.bodies.scene.cart
        if any(effort.kind == "held" for effort in self.bodies.support.efforts) and cart is not None:
            x = self.motion(self.bodies.support)[0]
            forces = [-sp.Symbol("k_c") * x.q] if cart.stiffness else []
            forces += [-sp.Symbol("d_c") * x.v] if cart.damping else []
            forces += [sp.Symbol("f_c")] if cart.has_friction else []
            yield "force between cart and rail", equal(sp.Symbol("H"), sp.Add(*forces))
        for chain in self.bodies.pendula:
            upper_part: FreeBody | None = None
            for part in chain:
                yield from self._joint(part, upper_part)
                yield from self._drag(part)
                upper_part = part

    def _joint(self, part: FreeBody, upper_part: FreeBody | None) -> Iterator[tuple[str, Any]]:
        law = joint_law(self.bodies, part)
        if law is None:
            return
        theta = self.motion(part)[2]
        upper = self.motion(upper_part)[2] if upper_part else Coordinate(sp.S.Zero, sp.S.Zero, sp.S.Zero)
        bend, rate = theta.q - upper.q - law.upright * sp.pi, theta.v - upper.v
        terms = [-sp.Symbol(law.rotor) * (theta.a - upper.a)] if law.rotor else []
        terms += [-sp.Symbol(law.spring) * bend] if law.spring else []
        terms += [-sp.Symbol(law.damper) * rate] if law.damper else []
        if law.drive:
            terms.append(sp.Symbol(law.drive) * (1 - bend**2 / sp.Symbol(law.width) ** 2) * rate)
        terms += [sp.Symbol(name) for name in (law.friction, law.kicks, law.law) if name]
        yield f"moment of the joint above {part.words}", equal(sp.Symbol(part.with_index("M")), sp.Add(*terms))
        if law.friction:
            yield f"{law.friction}: dry friction, against the sliding, as large as needed while the joint sticks", None
        if law.law:
            names = ", ".join(law_part.law.name for law_part in part.link.laws)  # type: ignore[union-attr]
            yield f"{law.law}: the torque of {names}, of the bend of the joint and of its rate", None
        if law.kicks:
            yield f"{law.kicks}: the kicks of the escapement, short and along the motion", None

    def _drag(self, part: FreeBody) -> Iterator[tuple[str, Any]]:
        link: Any = part.link
        x, z, _ = self.motion(part)
        strength = sp.Symbol(part.with_index("a")) if link.drag else sp.S.Zero
        if link.quadratic_drag:
            strength += sp.Symbol(part.with_index("b")) * sp.sqrt(x.v**2 + z.v**2)
        along, down = -strength * x.v, -strength * z.v
        for _, named in link.placed_forces if link else ():
            force = call(named.law, "force", [x.v, z.v], named.numbers, shape=(2,))
            along, down = along + force[0], down + force[1]
        for effort in part.efforts:
            if effort.kind == "drag":
                yield f"drag of {part.words} along the rail", equal(sp.Symbol(effort.along), along)
                yield f"drag of {part.words} down", equal(sp.Symbol(effort.down), down)


def _product(names: str) -> Any:
    return sp.Mul(*map(sp.Symbol, names.split()))


def _unit_acceleration(theta: Coordinate) -> tuple[Any, Any]:
    """The acceleration along the rail and down of a point at the distance 1 on a link from its upper joint."""
    sin, cos = sp.sin(theta.q), sp.cos(theta.q)
    return theta.a * cos - theta.v**2 * sin, -theta.a * sin - theta.v**2 * cos


def part_sections(bodies: FreeBodies) -> list[Section]:
    """A section for every part, for the constraints and for what forces are; last how many equations there are.

    Raise SceneError for more links than readable equations allow.

    >>> from modal import load
    >>> from modal.scene import free_bodies
    >>> [section.title for section in part_sections(free_bodies(load("chain-1")))]
    ['Link 1', 'Constraints', 'Count']
    """
    if (links := len(bodies.parts) - 1) > MOST_WRITTEN:
        message = f"{links} links: balances are written for at most {MOST_WRITTEN}; a picture draws those of some parts"
        raise SceneError([message])
    system = NewtonEuler(bodies)
    sections = [
        Section(capital(part.words), [Line(words, form) for words, form in system.balances(part)])
        for part in bodies.parts
        if part.kind not in STILL
    ]
    sections.append(Section("Constraints", [Line(words, form) for words, form in system.constraints()]))
    if laws := [Line(words, form) for words, form in system.laws()]:
        sections.append(Section("Forces that the motion makes", laws))
    return [*sections, Section("Count", [Line(_count_words(system))])]


def _count_words(system: NewtonEuler) -> str:
    equations, unknowns = len(system.equations), len(system.unknowns)
    accelerations = unknowns - 2 * len(system.bodies.parts[1:]) - (system.bodies.support.kind == "cart")
    return (
        f"{equations} equations for {unknowns} unknowns: {accelerations} accelerations and "
        f"{unknowns - accelerations} forces"
    )
