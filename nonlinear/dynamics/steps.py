"""The plane equations recorded for any language: steps of one link for loops over chains of any length, or a structure.

A step takes the numbers p of its link, its own `y`, what it is handed by its neighbour `u`, and `v` of an earlier step:

    swung       u = velocity of its upper joint in the support's frame (m/s): that of its lower one
    answered    u = `answered` of the link below (zeros below the last), v = `swung` of the upper joint: the response of
                all from its upper joint down (xx, xz, zz, px, pz), torque at that joint, drag of these links (N, along
                the rail and down), power (W) of what does not conserve energy, and hx, hz, e, D of its `Turn`
    fallen      u = ã of its upper joint, v = its own `answered`: that of its lower joint, and θ''
    stored      u = `swung` of its upper joint and energies (J) of the links above: those with its own

with y = (θ, θ', both of the link above, external moment, support's acceleration and velocity along the rail and down).
From the sums of `answered` over all chains, `railed` on a cart and `held` on a support give ã of the first joints and
the power; their y = (x, x', force on the cart, support's acceleration along the rail and down).

The linear equations are the same steps followed by their derivatives: every argument and result has its changes behind
it (`directional_derivatives`). Drives and quadratic drag are omitted of them, and rotors of all but `paired`: with
rotors the equations are recorded whole, as are those of a structure. `paired` are the bilinear forms of small motions x
and z from equilibrium, y = (x, z, both of the link above): u = (speeds x, z, x'Mz, x'Kz, x'Dz) with its link's share.

The equations of one structure are recorded whole.  The functions of `structure_steps` take the numbers p of the scene,
y = (η, θ, η', θ', work), and u and v as follows:

    rates       u = the time (s) where something is prescribed, then forces (N, N m) on η and moments on θ: y'
    linear      the same u, v a small change of (η, θ, η', θ') from a state at rest: its rate, drives and quadratic drag
                omitted, with the rates of that state itself
    stored      the kinetic and the potential energy (J), the latter from rest
    paired      u = x, v = z, two small motions of (η, θ) from a state at rest: x'Mz, x'Kz, x'Dz without what prescribes
    impelled    u = generalized impulses (N s, N m s) on (η, θ): their contribution to the rates

The bilinear forms are second derivatives of the energies and of the power of dampers, by the chain rule on the tape.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from types import SimpleNamespace
from typing import Any

import numpy as np

from modal.extend.laws import VanDerPolLaw
from modal.scene import SineMotion
from modal.vibration import prescribed_motion
from nonlinear.dynamics.bearing import apply_inverse_mass
from nonlinear.dynamics.forces import drag_law, inertial_law, joint_law
from nonlinear.dynamics.forms import Form, TapedEquations, form_of
from nonlinear.dynamics.hamiltonian import without_springs
from nonlinear.dynamics.inputs import QUIET
from nonlinear.dynamics.mechanics import energies
from nonlinear.dynamics.minimal import Minimal
from nonlinear.dynamics.recursion import Answer, RecursiveLink, Turn, link_acceleration, link_response
from nonlinear.dynamics.tape import Tape, directional_derivatives
from nonlinear.dynamics.text import Module
from nonlinear.system import System
from nonlinear.system.numbers import BEFORE, FIELDS, dampers_of

LINK = (
    *("mass", "length", "centre", "inertia", "rotor", "damping", "stiffness", "drag", "quadratic"),
    *("strength", "angle_deg", "static", "sigma", "rest", "bent", "gravity"),
)
"""The numbers p of a link; `static` is the first moment of it and all below, `bent` the relaxed angle at its joint."""
CART = ("mass", "damping", "stiffness", "gravity")
SINE = ("amplitude", "omega", "phase", "along", "down")
Step = Callable[[Any, Any, Any, Any], list[Any]]


def _swing_step(link: Any, y: Any, u: Any, v: Any) -> list[Any]:
    return list(_lower_velocity(link.length, y, u))


def _lower_velocity(distance: Any, y: Any, upper: Any) -> tuple[Any, Any]:
    return upper[0] + distance * (y[0].cos() * y[1]), upper[1] - distance * (y[0].sin() * y[1])


def _answer_step(link: Any, y: Any, u: Any, v: Any) -> list[Any]:
    theta, rate, _, _, moment, *frame = y[:9]
    s, c, support, wind = theta.sin(), theta.cos(), frame[:2], frame[2:]
    bend, speed = y[0] - y[2] - link.bent, y[1] - y[3]
    elastic, working = joint_law(bend, speed, link.stiffness, link.damping)
    working = working + VanDerPolLaw().torque(bend, speed, vars(link))
    torque, (tx, tz) = elastic + working, u[6:8]
    velocity = np.array(_lower_velocity(link.centre, y, v), dtype=object)
    fx, fz = drag_law(velocity + wind, link.drag, link.quadratic)
    drag_torque = c * (link.length * tx + link.centre * fx) - s * (link.length * tz + link.centre * fz)
    rest = link.length - link.centre
    I, static, tip_term = link.inertia, link.mass * link.centre, link.mass * rest * rest
    about_ends = I + static * link.centre, I, I + tip_term, I - static * rest
    constants = RecursiveLink(link.mass, link.length, static, *about_ends)
    answer, turn = link_response(constants, Answer(*u[:5]), s, c, rate, moment + torque - u[5] + drag_torque)
    outside = moment + inertial_law(link.static, s, c, support)
    power = u[8] + working * speed + outside * rate + fx * velocity[0] + fz * velocity[1]
    return [*answer, torque, tx + fx, tz + fz, power, turn.hx, turn.hz, turn.e, turn.D]


def _fall_step(link: Any, y: Any, u: Any, v: Any) -> list[Any]:
    turn = Turn(v[9], v[10], v[11], v[12], y[0].sin(), y[0].cos(), y[1])
    theta2, ax, az = link_acceleration(SimpleNamespace(l=link.length), turn, u[0], u[1])  # type: ignore[arg-type]
    return [ax, az, theta2]


def _energy_step(link: Any, y: Any, u: Any, v: Any) -> list[Any]:
    vx, vz = _lower_velocity(link.centre, y, u)
    kinetic = (link.mass * (vx * vx + vz * vz) + link.inertia * y[1] ** 2) / 2
    lift, gamma = ((y[0] - link.rest) / 2).sin(), y[0] - y[2] - link.bent
    potential = 2 * link.gravity * link.static * link.sigma * lift**2 + link.stiffness * gamma**2 / 2
    return [*_lower_velocity(link.length, y, u), u[2] + kinetic, u[3] + potential]


def _pair_step(link: Any, y: Any, u: Any, v: Any) -> list[Any]:
    x, z, above_x, above_z = y
    turns = link.sigma * x, link.sigma * z
    upper, upper_z = (speed + link.centre * turn for speed, turn in zip(u[:2], turns, strict=True))
    bends = x - above_x, z - above_z
    spring, damper = joint_law(bends[0], bends[0], link.stiffness, link.damping)
    (drag_force,) = drag_law(np.array([upper], dtype=object), link.drag)
    M = u[2] + link.mass * upper * upper_z + link.inertia * turns[0] * turns[1] + link.rotor * bends[0] * bends[1]
    K = u[3] + link.gravity * link.static * link.sigma * x * z - spring * bends[1]
    D = u[4] - damper * bends[1] - drag_force * upper_z
    return [*(speed + link.length * turn for speed, turn in zip(u[:2], turns, strict=True)), M, K, D]


def _rail_step(cart: Any, y: Any, u: Any, v: Any) -> list[Any]:
    x, rate, push, _, down = y
    gravity = cart.gravity - down
    elastic, working = joint_law(x, rate, cart.stiffness, cart.damping)
    outside = push + working
    pull = u[3] - gravity * u[1] - u[6]
    return [(outside + elastic - pull) / (cart.mass + u[0]), -gravity, u[8] + rate * outside]


def _support_step(cart: Any, y: Any, u: Any, v: Any) -> list[Any]:
    return [y[3], y[4] - cart.gravity, u[8]]


def _record(names: tuple[str, ...], steps: Mapping[str, tuple[Step, tuple[int, int, int]]], linear: bool) -> Module:
    tape = Tape()
    p = dict(zip(names, tape.inputs("p", len(names)), strict=True))
    if linear:
        p |= dict.fromkeys(p.keys() & {"strength", "quadratic"}, 0.0)
    functions = {}
    for name, (step, sizes) in steps.items():
        kinds = [(kind, range(size)) for kind, size in zip("yuv", sizes, strict=True)]
        inputs = [[tape.symbol("in", kind, k) for k in places] for kind, places in kinds]
        outputs = step(SimpleNamespace(**p), *inputs)
        if linear:
            changes = [tape.symbol("in", kind, len(places) + k) for kind, places in kinds for k in places]
            outputs += directional_derivatives(
                tape, outputs, [symbol for places in inputs for symbol in places], changes
            )
        functions[name] = outputs
    return Module(tape, functions)


@cache
def link_steps(*, linear: bool = False) -> Module:
    """The steps along a chain, of the numbers LINK; `paired` among those that are not linear."""
    steps = {
        "swung": (_swing_step, (9, 2, 0)),
        "answered": (_answer_step, (9, 13, 2)),
        "fallen": (_fall_step, (9, 3, 13)),
    }
    others = {} if linear else {"stored": (_energy_step, (9, 4, 0)), "paired": (_pair_step, (4, 5, 0))}
    return _record(LINK, {**steps, **others}, linear)


@cache
def support_steps(*, linear: bool = False) -> Module:
    """The motion of the first joints, from the numbers CART."""
    return _record(CART, {"railed": (_rail_step, (5, 13, 0)), "held": (_support_step, (5, 13, 0))}, linear)


@cache
def sine_steps() -> Module:
    """`moved`: displacement, velocity and acceleration of a support, two numbers each, of u = (time,) and SINE."""
    tape = Tape()
    *constants, sideways, down = tape.inputs("p", len(SINE))
    (time,) = tape.inputs("u", 1)
    motion = prescribed_motion(SineMotion(amplitude=1.0, frequency_hz=1.0)).with_constants(constants)
    outputs = [part * motion.derivative(time, order) for order in range(3) for part in (sideways, down)]
    return Module(tape, {"moved": outputs})


@dataclass(frozen=True, eq=False)
class StructureSteps:
    """The functions of a `system` on a structure, of those of its numbers that are not 0, and of all its dampers."""

    system: System

    @cached_property
    def form(self) -> Form:
        """The key of the text: every damper has a number there."""
        form = form_of(self.system, has_load=True, works=True)
        links = self.system.n_links
        at = BEFORE + links * FIELDS.index("damping")
        first = BEFORE + links * len(FIELDS)
        dampers = {*range(at, at + links), *(first + k for k in dampers_of(self.system.suspension))}
        return replace(form, present=tuple(has or k in dampers for k, has in enumerate(form.present)))

    @property
    def entry_numbers(self) -> list[int]:
        """Which entries of a scene (`nonlinear.system.entries_of`) are the first numbers p."""
        return [k for k, has in enumerate(self.form.present) if has]

    @property
    def numbers(self) -> list[Any]:
        """The numbers p of the system: those entries, then the constants of prescribed motions."""
        return self.form.numbers_of(self.system)

    @cached_property
    def module(self) -> Module:
        """The functions, written."""
        equations = TapedEquations(self.form)
        tape, half = equations.tape, equations.minimal.layout.half
        y, (q, v) = equations.y, (equations.y[:half], equations.y[half : 2 * half])
        x, z = ([tape.symbol("in", kind, k) for k in range(half)] for kind in "uv")
        slow = _linearizable(equations)
        smooth = (
            Minimal(slow, equations.bodies, equations.minimal.load).rates(y, equations.instant)[: 2 * half].tolist()
        )
        change = [tape.symbol("in", "v", k) for k in range(2 * half)]
        changes = directional_derivatives(tape, smooth, y[: 2 * half], change)
        parts = energies(equations.system, q, v)
        T, V = parts.moving, parts.potential_energy
        at_rest = replace(slow, support=None, forces=())
        power = Minimal(at_rest, equations.bodies, equations.minimal.load).rates(y, QUIET)[-1]
        mass, damping = (_second(tape, energy, v, x, z) for energy in (T, power))
        stiffness = _second(tape, V, q, x, z)
        if any(not term.law.has_potential for group in slow.groups for term in group.laws):
            forces, _ = Minimal(without_springs(at_rest), equations.bodies, equations.minimal.load).forces(y, QUIET)
            changes_of_forces = directional_derivatives(tape, forces.tolist(), q, x)
            stiffness = stiffness - sum(a * b for a, b in zip(changes_of_forces, z, strict=True))
        functions = {
            "rates": equations.rates,
            "linear": [rate + change_of_rate for rate, change_of_rate in zip(smooth, changes, strict=True)],
            "stored": [T, V],
            "paired": [mass, stiffness, -0.5 * damping],
        }
        if self.system.has_escapements:
            solvers = list(zip(equations.system.groups, equations.bodies, strict=True))
            impulses = np.empty(half, dtype=object)
            impulses[:] = x
            functions["impelled"] = apply_inverse_mass(equations.system, solvers, q, impulses).tolist()
        return Module(tape, functions)


def structure_steps(system: System) -> StructureSteps:
    """The functions of a system on a structure."""
    return StructureSteps(system)


def _linearizable(equations: TapedEquations) -> System:
    """The system of these equations without quadratic drag and drives."""
    groups = (
        replace(group, quadratic_drag=None, laws=tuple(term for term in group.laws if not term.law.is_drive))
        for group in equations.system.groups
    )
    return replace(equations.system, groups=tuple(groups))


def _second(tape: Any, value: Any, by: Any, x: Sequence[Any], z: Sequence[Any]) -> Any:
    """The second derivative of a value along x and z."""
    (first,) = directional_derivatives(tape, [value], by, x)
    return directional_derivatives(tape, [first], by, z)[0]
