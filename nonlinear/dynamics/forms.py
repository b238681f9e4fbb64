"""Generated equations of a form of scene, shared by all scenes that differ only in their numbers.

The lines of `nonlinear.dynamics.minimal`, in space of `nonlinear.dynamics.spatial`, are run once with symbols in place
of numbers, state and inputs, and what they leave on the tape is written (`nonlinear.dynamics.text`).  A number that is
0, and a centre at the end of its link, belong to the form: terms that vanish with them are not in the text.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache, partial
from typing import Any

import numpy as np

from modal.structure import End, GroundEnd, LinkEnd
from modal.types import Ints
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
        (_table(group.index), _table(group.block.sigma), _can_eliminate(group, is_frail) and _pays(group, system))
        for group, is_frail in zip(system.groups, weak, strict=True)
    )
    D = motion_constants[: 0 if system.modal_damping is None else np.size(system.modal_damping)]
    return Form(
        chains,
        _present(numbers),
        tuple(l is c or bool(np.array_equal(l, c)) for l, c in zip(length, centre, strict=True)),
        _present(D),
        tuple(tuple(places.tolist()) for places, _ in hoisting.laws) if hoisting else (),
        support.directions if support else (),
        tuple((force.places, force.direction, _carrier(force.carrier)) for force in system.forces),
        len(motion_constants) - len(D) if system.is_analytic or system.loops else None,
        has_load,
        system.works or has_load if works is None else works,
        (),
        False,
        system.spatial,
        shape_of(system),
        tuple(tuple(map(_shape_of_term, (*group.laws, *group.point_forces))) for group in system.groups),
        (system.is_analytic, *(loop.shape for loop in system.loops)),
        system,
    )


def _shape_of_term(term: JointTerm) -> tuple[Any, ...]:
    """The non-numeric part of the joint laws."""
    return (
        type(term.law),
        term.order,
        *(tuple(np.ravel(part).tolist()) for part in (term.rows, term.columns, term.scale)),
    )


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


def _carrier(end: Any) -> Any:
    return None if end is None else (end.carrier, end.where)


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


def _can_eliminate(group: Group, frail: bool) -> bool:
    return group.n <= MATRIX_LINKS_MAX and not frail


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
    return Module(
        equations.tape,
        {
            "rates": [
                *equations.sticking_rates,
                *directional_derivatives(equations.tape, equations.sticking_rates, equations.y, v),
            ]
        },
    )


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
