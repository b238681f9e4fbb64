"""Generated equations of a form of scene, shared by all scenes that differ only in their numbers.

The lines of `nonlinear.dynamics.minimal`, in space of `nonlinear.dynamics.spatial`, are run once with symbols in place
of numbers, state and inputs, and what they leave on the tape is written (`nonlinear.dynamics.text`).  A number that is
0, and a centre at the end of its link, belong to the form: terms that vanish with them are not in the text.

Functions of the equations of motion for event handling, generated for a form (`nonlinear.dynamics.text`).

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
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache, partial
from typing import Any

import numpy as np

from modal.structure import End, GroundEnd, LinkEnd
from modal.types import Ints
from nonlinear.dynamics.contacts import Gripping, contacts_of
from nonlinear.dynamics.elimination import Elimination, loses_digits
from nonlinear.dynamics.inputs import Inputs
from nonlinear.dynamics.minimal import GroupBody, Minimal, Recursion
from nonlinear.dynamics.spatial import Spatial, SpatialRecursion
from nonlinear.dynamics.tape import Tape, directional_derivatives, partials
from nonlinear.dynamics.text import Module
from nonlinear.system import (
    AppliedForces,
    Group,
    JointTerm,
    System,
    constants_of,
    entries_of,
    system_with,
    system_with_constants,
)
from nonlinear.system.numbers import BEFORE, FIELDS

MATRIX_LINKS_MAX = 6
"""Cost: links of a chain up to which its matrix takes fewer operations than the recursion."""
Table = tuple[tuple[Any, ...], ...]


@dataclass(frozen=True)
class Form:
    """The properties on which the generated code depends; a `system` of this form.

    `chains` are the places of links and their directions at equilibrium group by group, and whether their equations are
    solved by elimination; `present` says which numbers (`nonlinear.system.numbers`) are not 0, `ends` which links have
    their centre at their end, `ratios` which entries of the modal damping are not 0, `laws` the links that follow each
    law of a hoist; `directions` are those in which a support moves, `forces` where forces act and in which direction,
    `constant_count` how many constants of what is prescribed and of `loops` are numbers, None without any; equations
    have a load where `has_load`, `works` ones the work; `contacts` are the coordinates below and above each contact
    with dry friction, none where that is omitted, and on a rail that `presses` it has a coefficient; `spatial` ones
    have three numbers a link. `structure` is the shape of the supports of the pendula (`shape_of`), `joint_laws` that
    of the joint laws.
    """

    chains: tuple[tuple[Table, Table, bool], ...]
    present: tuple[bool, ...]
    ends: tuple[bool, ...]
    ratios: tuple[bool, ...]
    laws: Table
    directions: Table
    forces: Table
    constant_count: int | None
    has_load: bool
    works: bool
    contacts: tuple[tuple[int, int], ...]
    presses: bool
    spatial: bool
    structure: tuple[Any, ...]
    joint_laws: tuple[Any, ...]
    loops: tuple[Any, ...]
    system: System = field(compare=False, repr=False)

    @property
    def first(self) -> int:
        """The number of coordinates before those of links."""
        return self.system.first

    @property
    def count(self) -> int:
        """The number of parameters p."""
        return sum(self.present) + sum(self.ratios) + (self.constant_count or 0)

    def numbers(self, entries: Sequence[Any], constants: Sequence[Any]) -> list[Any]:
        """The numbers p of a scene of this form, or of many (`nonlinear.system.Numbers`)."""
        numbers, has = (*entries, *constants), (*self.present, *self.ratios, *[True] * (self.constant_count or 0))
        return [number for number, is_present in zip(numbers, has, strict=True) if is_present]

    def numbers_of(self, system: System) -> list[Any]:
        """Those of a system's own."""
        return self.numbers(entries_of(system), constants_of(system))


def form_of(
    system: System,
    entries: Sequence[Any] | None = None,
    constants: Sequence[Any] | None = None,
    *,
    has_load: bool = False,
    works: bool | None = None,
    frail: Sequence[bool] | None = None,
) -> Form:
    """The form of a system with its own numbers or others, arrays where members differ.

    `works` says whether the work is counted, by default where there can be any; `frail` are groups whose dense matrices
    lose digits.
    """
    numbers = entries_of(system) if entries is None else entries
    motion_constants = constants_of(system) if constants is None else constants
    weak = [loses_digits(group, system) for group in system.groups] if frail is None else frail
    links, hoisting, support = system.n_links, system.hoisting, system.support
    at = {name: BEFORE + links * FIELDS.index(name) for name in ("length", "centre")}
    length, centre = (numbers[place : place + links] for place in at.values())
    chains = tuple(
        (_table(group.index), _table(group.block.sigma), not is_frail and _pays(group, system))
        for group, is_frail in zip(system.groups, weak, strict=True)
    )
    D = motion_constants[: 0 if system.modal_damping is None else np.size(system.modal_damping)]
    ends = tuple(l is c or bool(np.array_equal(l, c)) for l, c in zip(length, centre, strict=True))
    laws = tuple(tuple(places.tolist()) for places, _ in hoisting.laws) if hoisting else ()
    forces = tuple((force.places, force.direction, force.carrier and tuple(force.carrier)) for force in system.forces)
    constant_count = len(motion_constants) - len(D) if system.is_analytic or system.loops else None
    counts_work = system.works or has_load if works is None else works
    joint_laws = tuple(tuple(map(_shape_of_term, (*group.laws, *group.point_forces))) for group in system.groups)
    loops = (system.is_analytic, *(loop.shape for loop in system.loops))
    numbers_of_links = chains, _present(numbers), ends, _present(D)
    inputs = laws, support.directions if support else (), forces, constant_count, has_load, counts_work
    laws_of_parts = shape_of(system), joint_laws, loops
    parts: Any = (*numbers_of_links, *inputs, (), False, system.spatial, *laws_of_parts, system)
    return Form(*parts)


def _shape_of_term(term: JointTerm) -> tuple[Any, ...]:
    """The non-numeric part of the joint laws."""
    places = (tuple(np.ravel(part).tolist()) for part in (term.rows, term.columns, term.scale))
    return type(term.law), term.order, *places


def _present(entries: Sequence[Any]) -> tuple[bool, ...]:
    return tuple(isinstance(entry, np.ndarray) or bool(entry) for entry in entries)


def shape_of(system: System) -> tuple[Any, ...]:
    """The non-numeric part of a structure: kinds, where pendula hang, where springs end, which have no length."""
    structure = system.suspension
    pivot_numbers = {pivot: k for k, pivot in enumerate(dict.fromkeys(map(id, structure.pivots)))}
    carriers = tuple(
        (part.kind, part.size, None if part.points is None else len(part.points)) for part in structure.carriers
    )
    pivots = tuple((pivot_numbers[id(pivot)], pivot.carrier, _point_number(pivot.where)) for pivot in structure.pivots)
    springs = tuple((*map(_end, part.ends), part.torsion) for part in structure.springs)
    return carriers, pivots, springs, system.slack


def _point_number(where: Any) -> int | None:
    return where if isinstance(where, int) else None


def _end(end: End) -> tuple[Any, ...]:
    if isinstance(end, LinkEnd):
        return "link", end.link, end.below is None
    if isinstance(end, GroundEnd):
        return "ground", end.place is None
    return "carrier", end.carrier, _point_number(end.where)


def _table(values: Any) -> Table:
    return tuple(map(tuple, values.tolist()))


def _pays(group: Group, system: System) -> bool:
    """Whether matrices take fewer operations than the recursion: those of fewer links under several coordinates."""
    structure = system.suspension
    size = max(structure.carriers[structure.pivots[pendulum].carrier].size for pendulum in group.pendula.tolist())
    return group.n <= (MATRIX_LINKS_MAX if size <= 1 else 2)


class Symbolic:
    """A system of a form with symbols for its numbers, and the solvers of its groups."""

    def __init__(self, form: Form) -> None:
        self.tape = Tape()
        self.numbers = self.tape.inputs("p", form.count)
        p = iter(self.numbers)
        entries = [next(p) if has else 0.0 for has in form.present]
        links = form.system.n_links
        at = {name: BEFORE + links * FIELDS.index(name) for name in ("length", "centre")}
        for k, is_at_end in enumerate(form.ends):
            if is_at_end:
                entries[at["centre"] + k] = entries[at["length"] + k]
        ratios = [next(p) if has else 0.0 for has in form.ratios]
        self.entries = tuple(entries)
        self.system = system_with_constants(system_with(form.system, entries), [*ratios, *p])
        self.bodies: tuple[GroupBody, ...] = tuple(
            (SpatialRecursion if form.spatial else Elimination if dense else Recursion)(group)
            for group, (_, _, dense) in zip(self.system.groups, form.chains, strict=True)
        )


class TapedEquations(Symbolic):
    """The rates y' of a form on a tape, from the symbols y, of the inputs u and of the numbers p."""

    def __init__(self, form: Form) -> None:
        super().__init__(form)
        moving = np.array([place for law in form.laws for place in law], dtype=np.int64)
        bodies = (
            type(body) if np.isin(group.index, moving).any() else body
            for group, body in zip(self.system.groups, self.bodies, strict=True)
        )
        load = _unknown if form.has_load else None
        kind = Spatial if form.spatial else Minimal
        self.minimal = kind(self.system, tuple(bodies), load, counts_work=form.works)
        inputs = Inputs(self.system, load, form.contacts)
        self.y = self.tape.inputs("y", self.minimal.layout.size)
        self.u = self.tape.inputs("u", inputs.count)
        self.instant = inputs.instant(self.u)

    @cached_property
    def rates(self) -> list[Any]:
        """The rates y', with contacts that all slide, and N of a rail with a coefficient."""
        sliding, minimal = self.instant._replace(gripping=None), self.minimal
        if self.instant.gripping is None or self.instant.gripping.rail_coefficient is None:
            return minimal.rates(self.y, sliding).tolist()  # type: ignore[no-any-return]
        force, accelerations = self.tape.symbol("in", "rail", 0), slice(minimal.layout.half, 2 * minimal.layout.half)
        with_force = sliding._replace(push=sliding.push._replace(cart=sliding.push.cart + force))
        response = directional_derivatives(self.tape, minimal.rates(self.y, with_force)[accelerations], [force], [1.0])
        rates, friction = minimal.rates_and_friction(self.y, self.instant, np.array(response))
        return [*rates.tolist(), friction.normal]

    @cached_property
    def sticking_rates(self) -> list[Any]:
        """The rates y' where contacts may stick, as their inputs say."""
        return (
            self.minimal.rates_and_friction(self.y, self.instant)[0].tolist() if self.instant.gripping else self.rates
        )


def _unknown(time: float, state: Any) -> AppliedForces:
    raise NotImplementedError("applied forces are inputs of the code that is written")


@lru_cache(maxsize=64)
def module_of(form: Form, *, tangent: bool = False) -> Module:
    """The function "rates" of a form: y', or with `tangent` (y', J v), both from (y, v) as one vector."""
    equations = TapedEquations(form)
    if not tangent:
        return Module(equations.tape, {"rates": equations.rates})
    v = equations.tape.inputs("y", len(equations.y))
    rates = equations.sticking_rates
    return Module(equations.tape, {"rates": [*rates, *directional_derivatives(equations.tape, rates, equations.y, v)]})


@lru_cache(maxsize=64)
def jacobian_of(form: Form) -> tuple[Module, Ints, Ints]:
    """The function "jacobian" of a form: y', then the entries of ∂y'/∂y that are not always 0, at these places."""
    equations = TapedEquations(form)
    slopes = partials(equations.tape, equations.sticking_rates, equations.y)
    places = np.array([(row, column) for row, row_slopes in enumerate(slopes) for column in row_slopes]).reshape(-1, 2)
    entries = [slope for row_slopes in slopes for slope in row_slopes.values()]
    return Module(equations.tape, {"jacobian": [*equations.sticking_rates, *entries]}), places[:, 0], places[:, 1]


def responding(equations: TapedEquations, form: Form) -> list[Any]:
    """The y' of a form with `contacts` without friction, then M⁻¹Jᵀ (half, J) row by row.

    Where the rail has a coefficient N and ∂N/∂τ (J,) follow.
    """
    minimal, half = equations.minimal, equations.minimal.layout.half
    free = minimal.rates(equations.y, equations.instant._replace(gripping=None))
    columns = minimal.responses(equations.y[:half], equations.instant)
    outputs = [*free.tolist(), *columns.ravel().tolist()]
    if not form.presses:
        return outputs
    normal = partial(minimal.reaction, equations.y, equations.instant)
    return [*outputs, normal(free[half : 2 * half]), *(normal(column, False) for column in columns.T)]


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
