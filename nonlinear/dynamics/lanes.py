"""Equations of motion of many members at once: a lane each, in every operation of NumPy all of them.

A scene of few links is written out as in `nonlinear.dynamics.generated`, the numbers in which members differ being
arguments beside y.  What does not depend on y is written apart and done once for a set of members.  Larger scenes go by
the recursion, with arrays (n, P, S) for numbers.

Tangent equations v' = J(y) v are found by differentiating what is written, operation by operation; y and v are then
one vector.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from nonlinear.dynamics.dense import FRAIL, LIGHT, Elimination
from nonlinear.dynamics.generated import DEEPEST, SHORT, Symbol, Tape, called, function_in, joined, uses
from nonlinear.dynamics.minimal import NOTHING, Minimal, Recursion
from nonlinear.dynamics.recursion import links_of
from nonlinear.system import AppliedForces, Group, Layout, Numbers, System, system_with

WRITTEN = 32  # links of a scene whose equations are written out
Rates = Callable[[Any], Sequence[Any]]


class Spread(Recursion):
    """The recursion for numbers (n, P, S) or (n, P, 1)."""

    def __init__(self, group: Group) -> None:
        self.sine, self.cosine, self.links = np.sin, np.cos, links_of(group)


@dataclass(frozen=True, eq=False)
class Lanes:
    """The equations of members with these `numbers`; `tangent` ones have v after y, and no work.

    Where they are `pushed`, which leaves no work to count, the numbers end with a force on the cart (N) and a moment on
    every link (N m).
    """

    numbers: Numbers
    tangent: bool = False
    pushed: bool = False

    @cached_property
    def system(self) -> System:
        """The form of all members, with the scene's own numbers."""
        return self.numbers.system

    @cached_property
    def layout(self) -> Layout:
        """The parts of y."""
        works = self.numbers.works and not self.tangent and not self.pushed
        return Layout(self.system.n_links, 1, self.system.cart is not None, works)

    @property
    def size(self) -> int:
        """Length of y, with v where there is one."""
        return self.layout.size * (1 + self.tangent)

    @cached_property
    def is_written(self) -> bool:
        """Whether the equations are written out."""
        return self.tangent or (self.system.n_links <= WRITTEN and not self.numbers.dragged)

    @cached_property
    def written(self) -> Written:
        """The rate of y as it is written."""
        return written(self.numbers, self.tangent, self.pushed)

    def rates(self, numbers: Numbers) -> Rates:
        """The function that gives y' of so many members as these numbers are of, from y (size, S)."""
        if self.is_written:
            return self.written.rates(np.sin, np.cos, self.written.constants(numbers))
        system = numbers.arrays
        bodies = tuple(Spread(group) for group in system.groups)
        push = _push(np.broadcast_arrays(*numbers.entries[-1 - system.n_links :])) if self.pushed else NOTHING
        equations = Pushed(system, bodies, counts_work=self.layout.works, push=push)
        return lambda y: equations.derivative(0.0, y)


class Written:
    """The text of y' from what its components are, and of the constants in it from the numbers of a scene."""

    def __init__(self, tape: Tape, components: Sequence[Any], size: int) -> None:
        self.floats: dict[float, str] = {}
        self._names: dict[int, str] = {}
        wanted = uses(components)
        order = [symbol for symbol in tape.known.values() if id(symbol) in wanted]
        still = _still(order)
        ends = _ends(order, components, still)
        first = list(self._lines([symbol for symbol in order if id(symbol) in still], wanted, ends))
        self.kept = [self._names[id(symbol)] for symbol in order if id(symbol) in ends]
        then = list(self._lines([symbol for symbol in order if id(symbol) not in still], wanted, {}))
        found = ", ".join(map(self._word, components))
        named = [*self.floats.values(), *self.kept]
        self.before = "\n".join(
            (f"def constants({', '.join(('p', *self.floats.values()))}):", *first, f" return [{', '.join(self.kept)}]")
        )
        self.text = "\n".join(
            (
                f"def made({', '.join(('sin', 'cos', *named))}):",
                " def rate(y):",
                f"  {', '.join(f'y{i}' for i in range(size))}, = y",
                *(f" {line}" for line in then),
                f"  return [{found}]",
                " return rate",
            )
        )

    def constants(self, numbers: Numbers) -> list[Any]:
        """What stands in the text for these members: numbers and arrays (S,)."""
        given = [numbers.entries[k] for k in numbers.varied]
        still = function_in(self.before, "constants")(dict(zip(numbers.varied, given, strict=True)), *self.floats)
        return [*self.floats, *still]

    def rates(self, sine: Any, cosine: Any, constants: Sequence[Any]) -> Rates:
        """The rate of y, for anything that these two functions and plain arithmetic take."""
        made: Callable[..., Rates] = function_in(self.text, "made")
        return made(sine, cosine, *constants)

    def _lines(self, order: Sequence[Symbol], wanted: dict[int, int], ends: Any) -> Iterator[str]:
        """Every operation that is wanted more than once or kept in a line of its own."""
        deep: dict[int, int] = {}
        for symbol in order:
            operator, *operands = symbol.operation
            given = operator in {"y", "p"}
            if operator == "y":
                text = f"y{operands[0]}"
            else:
                text = f"p[{operands[0]}]" if given else joined(operator, [*map(self._word, operands)])
            deep[id(symbol)] = 0 if given else 1 + max(deep.get(id(operand), 0) for operand in operands)
            if id(symbol) in ends or (not given and (wanted[id(symbol)] > 1 or deep[id(symbol)] >= DEEPEST)):
                name = f"v{len(self._names)}"
                yield f" {name} = {text}"
                text, deep[id(symbol)] = name, 0
            self._names[id(symbol)] = text

    def _word(self, value: Any) -> str:
        if isinstance(value, Symbol):
            return self._names[id(value)]
        return self.floats.setdefault(float(value), f"c{len(self.floats)}")


def _still(order: Sequence[Symbol]) -> set[int]:
    """What does not depend on y."""
    found: set[int] = set()
    for symbol in order:
        operator, *operands = symbol.operation
        if operator == "p" or (
            operator != "y" and all(id(own) in found for own in operands if isinstance(own, Symbol))
        ):
            found.add(id(symbol))
    return found


def _ends(order: Sequence[Symbol], components: Sequence[Any], still: set[int]) -> set[int]:
    """What does not depend on y and is wanted by what does."""
    wanted = [own for symbol in order if id(symbol) not in still for own in symbol.operation[1:]]
    return {id(own) for own in (*wanted, *components) if isinstance(own, Symbol) and id(own) in still}


@dataclass(frozen=True, eq=False)
class Pushed(Minimal):
    """The equations of motion under forces that do not change."""

    push: AppliedForces = NOTHING

    def applied(self, time: float, y: Any) -> AppliedForces:
        """These forces."""
        return self.push


def _push(pushes: Sequence[Any]) -> AppliedForces:
    return AppliedForces(pushes[0], np.array(pushes[1:]))


def written(numbers: Numbers, tangent: bool = False, pushed: bool = False) -> Written:
    """The equations of members that differ in these numbers, as in `Lanes`."""
    tape, varied = Tape(), set(numbers.varied)
    entries = [tape.symbol("p", k) if k in varied else entry for k, entry in enumerate(numbers.entries)]
    system = system_with(numbers.system, entries)
    bodies = tuple(
        Elimination(group, sine=called("sin"), cosine=called("cos"))
        if group.n <= SHORT and not _frail(numbers, group)
        else Recursion(group, sine=called("sin"), cosine=called("cos"))
        for group in system.groups
    )
    push = _push(entries[-1 - system.n_links :]) if pushed else NOTHING
    equations = Pushed(system, bodies, counts_work=not (tangent or pushed), push=push)
    size = equations.layout.size
    y = [tape.symbol("y", i) for i in range(size)]
    components = equations.derivative(0.0, np.array(y, dtype=object)).tolist()
    if not tangent:
        return Written(tape, components, size)
    return Written(tape, [*components, *_derivatives(tape, y, components)], 2 * size)


def _frail(numbers: Numbers, group: Group) -> bool:
    """Whether any member has so light a cart, or a link so light beside one below it, that matrices lose digits."""
    system = numbers.arrays
    own = next(each for each in system.groups if each.index is group.index).block.mass
    heaviest = np.maximum.accumulate(own[::-1])[::-1]
    total = sum(each.block.mass.sum((0, 1)) for each in system.groups)
    light = system.cart is not None and np.any(np.asarray(system.cart.mass) < LIGHT * total)
    return bool(light or np.any(own < FRAIL * heaviest))


def _derivatives(tape: Tape, y: Sequence[Symbol], components: Sequence[Any]) -> list[Any]:
    """Of the components along v, whose symbols follow those of y."""
    size = len(y)
    along: dict[int, Any] = {id(own): tape.symbol("y", size + i) for i, own in enumerate(y)}
    sine, cosine = (lambda one: tape.symbol("sin", one)), (lambda one: tape.symbol("cos", one))
    for symbol in [*tape.known.values()]:
        if id(symbol) in along:
            continue
        operator, *operands = symbol.operation
        d = [along.get(id(own), 0.0) if isinstance(own, Symbol) else 0.0 for own in operands]
        along[id(symbol)] = 0.0 if all(_zero(own) for own in d) else _rule(operator, symbol, operands, d, sine, cosine)
    return [along.get(id(own), 0.0) if isinstance(own, Symbol) else 0.0 for own in components]


def _rule(operator: str, symbol: Symbol, operands: Sequence[Any], d: Sequence[Any], sine: Any, cosine: Any) -> Any:
    """The derivative of one operation."""
    if operator == "+":
        return d[0] + d[1]
    if operator == "-":
        return -d[0] if len(d) == 1 else d[0] - d[1]
    if operator == "*":
        return d[0] * operands[1] + operands[0] * d[1]
    if operator == "/":
        return (d[0] - symbol * d[1]) / operands[1]
    return cosine(operands[0]) * d[0] if operator == "sin" else -(sine(operands[0]) * d[0])


def _zero(value: Any) -> bool:
    return not isinstance(value, Symbol) and value == 0
