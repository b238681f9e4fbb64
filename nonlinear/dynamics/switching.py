"""Functions of the equations of motion for event handling, generated for a form (`nonlinear.dynamics.text`).

Escapements kick joints `kicks`, dry friction acts at the `contacts` of a form. Every switch has a value that passes
from below to above 0 if it switches, and the rate of it along y' and the rates of the inputs:

    a kick on the right, then on the left   ±(γ − bent) − angle,  −FAR_BELOW on a side where none is possible
    a contact that slides to the side s     −s γ'
    a contact that sticks                   |τ| − M (1 + firm),   on a rail with a coefficient μ |N| in place of M
    N of such a rail, while it slides       −e N,  e = sign N

An impulse P at a kicked joint acts on the link below and −P on the one above: M(q) (v₊ − v₋) = J.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

from nonlinear.dynamics.contacts import Gripping, contacts_of
from nonlinear.dynamics.forms import Form, TapedEquations, responding
from nonlinear.dynamics.tape import directional_derivatives
from nonlinear.dynamics.text import Module

FAR_BELOW = 1000.0
"""Format: how far below 0 (rad, N or N m) a value is that cannot pass."""
Pairs = tuple[tuple[int, int], ...]


def with_contacts(form: Form) -> Form:
    """The same form with the contacts of its system."""
    contacts = contacts_of(form.system)
    return replace(form, contacts=contacts.pairs, presses=contacts.coefficient > 0)


def state_count(form: Form, kicks: Pairs) -> int:
    """How many numbers of a segment's state the texts take: sides K, signs J, e of such a rail, firmness J."""
    return len(kicks) + 2 * len(form.contacts) + form.presses


def member_numbers(form: Form, kicks: Pairs) -> int:
    """How many numbers of a member they take: bent, angle and impulse (3 K), then M or μ of every contact (J)."""
    return 3 * len(kicks) + len(form.contacts)


@lru_cache(maxsize=64)
def switching_of(form: Form, kicks: Pairs = ()) -> Module:
    """The functions (y, u, v) of a form whose joints `kicks`, pairs of coordinates of v, have escapements.

    v is a direction (size,) of y, then numbers of the state (`state_count`) and of the member, then the rates of the
    inputs before those of contacts.  y' where all contacts slide ("rates"), and where some stick ("sticking"); τ (J,),
    with N after it where the rail has a coefficient ("friction"); y' without friction and M⁻¹Jᵀ (half, J) row by row,
    with N and ∂N/∂τ ("responses"); values and their rates (2 count,), all contacts sliding ("clear") or not ("values"),
    the direction being y'; y after impulses, which stand in place of the sides ("kick"), and the change of it along the
    direction ("kicked", 2 size).
    """
    equations = TapedEquations(form)
    tape, minimal, y, u = equations.tape, equations.minimal, equations.y, equations.u
    size, half, contacts = len(y), minimal.layout.half, len(form.contacts)
    input_count = len(u) - 2 * contacts
    v = tape.inputs("v", size + state_count(form, kicks) + member_numbers(form, kicks) + input_count)
    direction, told_at = v[:size], size + state_count(form, kicks)
    change = [*y, *u[:input_count]], [*direction, *v[len(v) - input_count :]]
    sides, impulses = v[size : size + len(kicks)], v[size : size + len(kicks)]
    texts: dict[str, list[Any]] = {"rates": equations.rates[:size]}
    V, R = _of_kicks(kicks, (y, direction), sides, v[told_at : told_at + 2 * len(kicks)])
    if contacts:
        signs = v[size + len(kicks) : size + len(kicks) + contacts]
        firm = v[told_at - contacts : told_at]
        limits = v[told_at + 3 * len(kicks) : told_at + 3 * len(kicks) + contacts]
        sliding = [-s * joint_value(y[half : 2 * half], pair) for s, pair in zip(signs, form.contacts, strict=True)]
        slowing = [
            -s * joint_value(direction[half : 2 * half], pair) for s, pair in zip(signs, form.contacts, strict=True)
        ]
        rates, friction = minimal.rates_and_friction(y, equations.instant)
        force = [*friction.tau, *([] if friction.normal is None else [friction.normal])]
        texts |= {"sticking": rates.tolist(), "friction": force, "responses": responding(equations, form)}
        slope = directional_derivatives(tape, force, *change)
        texts["clear"] = [*V, *sliding, *R, *slowing]
        for j, s in enumerate(signs):
            firmly, M, dM = 1.0 + firm[j], limits[j], 0.0
            if form.presses and j == 0:
                M, dM = limits[0] * _size(force[-1]), limits[0] * force[-1].where(slope[-1], -slope[-1])
            V.append((s * s).where(sliding[j], _size(force[j]) - M * firmly))
            R.append((s * s).where(slowing[j], force[j].where(slope[j], -slope[j]) - dM * firmly))
        if form.presses:
            s, e = signs[0], v[size + len(kicks) + contacts]
            V.append((s * s).where(-(e * force[-1]), -FAR_BELOW))
            R.append((s * s).where(-(e * slope[-1]), 0.0))
    texts["values"] = [*V, *R]
    texts.setdefault("clear", texts["values"])
    if kicks:
        texts["kick"] = _state_after(equations, kicks, impulses)
        texts["kicked"] = [*texts["kick"], *directional_derivatives(tape, texts["kick"], y, direction)]
    return Module(tape, texts)


def _size(x: Any) -> Any:
    return x.where(x, -x)


def joint_value(values: Any, pair: tuple[int, int]) -> Any:
    """The value below a joint less that above it, of the coordinates of a pair; above −1 stands for what rests."""
    below, above = pair
    return values[below] - values[above] if above >= 0 else values[below]


def _of_kicks(kicks: Pairs, rows: tuple[Any, Any], sides: Any, numbers: Any) -> tuple[list[Any], list[Any]]:
    """The values of kicks to the right, then to the left, and their rates."""
    rests, angle = numbers[: len(kicks)], numbers[len(kicks) :]
    gamma = [joint_value(rows[0], pair) - rest for pair, rest in zip(kicks, rests, strict=True)]
    speed = [joint_value(rows[1], pair) for pair in kicks]
    right = [(-s).where(-FAR_BELOW, g - a) for s, g, a in zip(sides, gamma, angle, strict=True)]
    left = [s.where(-FAR_BELOW, -g - a) for s, g, a in zip(sides, gamma, angle, strict=True)]
    rates = [(-s).where(0.0, r) for s, r in zip(sides, speed, strict=True)]
    return right + left, rates + [s.where(0.0, -r) for s, r in zip(sides, speed, strict=True)]


def _state_after(equations: TapedEquations, kicks: Pairs, impulses: Sequence[Any]) -> list[Any]:
    """The y after impulses, the work of which is Σ P (γ'₋ + γ'₊)/2."""
    layout, y = equations.minimal.layout, equations.y
    half, v = layout.half, y[layout.half : 2 * layout.half]
    at = equations.instant._replace(gripping=Gripping(kicks, [0.0] * len(kicks)))
    columns = equations.minimal.responses(y[:half], at)
    after = v.copy()
    for column, impulse in zip(columns.T, impulses, strict=True):
        after = after + column * impulse
    work = y[2 * half :].copy()
    for pair, impulse in zip(kicks, impulses, strict=True):
        work = work + impulse * (0.5 * (joint_value(v, pair) + joint_value(after, pair)))
    return [*y[:half], *after, *work]
