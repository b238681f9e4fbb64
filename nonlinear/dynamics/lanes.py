"""Equations of motion of many members at once: a lane each, in every operation of NumPy all of them.

A scene of few links is written out as in `nonlinear.dynamics.forms`, with the numbers of the members as arrays; larger
ones go by the recursion, with arrays (n, P, S) for numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from nonlinear.dynamics.dense import FRAIL, LIGHT
from nonlinear.dynamics.forms import Form, form_of, module_of
from nonlinear.dynamics.inputs import QUIET
from nonlinear.dynamics.minimal import Minimal, Recursion
from nonlinear.dynamics.recursion import links_of
from nonlinear.dynamics.text import Module
from nonlinear.system import AppliedForces, Group, Layout, Numbers, System

WRITTEN = 32  # links of a scene whose equations are written out
Rates = Callable[[Any], Sequence[Any]]


class Spread(Recursion):
    """The recursion for numbers (n, P, S) or (n, P, 1)."""

    def __init__(self, group: Group) -> None:
        self.sine, self.cosine, self.links, self.winding = np.sin, np.cos, links_of(group), None


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
        return self.tangent or self.system.n_links <= WRITTEN

    @cached_property
    def form(self) -> Form:
        """What the text depends on."""
        entries, _ = self._parted(self.numbers)
        frail = [_frail(self.numbers, group) for group in self.system.groups]
        return form_of(self.system, entries, pushed=self.pushed, works=self.layout.works, frail=frail)

    @cached_property
    def module(self) -> Module:
        """The rate of y as it is written."""
        return module_of(self.form, tangent=self.tangent)

    def constants(self, numbers: Numbers) -> list[Any]:
        """What stands in the text for these members: numbers and arrays (S,)."""
        return self.module.constants(self.form.numbers(self._parted(numbers)[0], self.system))

    def rates(self, numbers: Numbers) -> Rates:
        """The function that gives y' of so many members as these numbers are of, from y (size, S)."""
        push = self._parted(numbers)[1]
        if self.is_written:
            rates = self.module.function("rates", self.constants(numbers), "arrays")
            return (lambda y: rates(y, push)) if push else rates
        system = numbers.arrays
        equations = Minimal(system, tuple(Spread(group) for group in system.groups), counts_work=self.layout.works)
        moments = AppliedForces(push[0], np.array(np.broadcast_arrays(*push[1:]))) if push else QUIET.push
        return lambda y: equations.rates(y, QUIET._replace(push=moments))

    def _parted(self, numbers: Numbers) -> tuple[Sequence[Any], Sequence[Any]]:
        """The numbers of the scene, and the forces."""
        if not self.pushed:
            return numbers.entries, ()
        links, on_cart = self.system.n_links, self.system.cart is not None
        own, push = numbers.entries[: -1 - links], numbers.entries[-1 - links :]
        return own, push if on_cart else push[1:]


def _frail(numbers: Numbers, group: Group) -> bool:
    """Whether any member has so light a cart, or a link so light beside one below it, that matrices lose digits."""
    system = numbers.arrays
    own = next(each for each in system.groups if each.index is group.index).block.mass
    heaviest = np.maximum.accumulate(own[::-1])[::-1]
    total = sum(each.block.mass.sum((0, 1)) for each in system.groups)
    light = system.cart is not None and np.any(np.asarray(system.cart.mass) < LIGHT * total)
    return bool(light or np.any(own < FRAIL * heaviest))
