"""Generated equations of motion (`nonlinear.dynamics.forms`) of one scene, or of many members in lanes.

In every operation of NumPy a lane is a member, with its numbers in arrays; scenes of more links than are written go
by the recursion, with arrays (n, P, S) for numbers.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from nonlinear.dynamics.elimination import loses_digits
from nonlinear.dynamics.forms import Form, form_of, module_of
from nonlinear.dynamics.inputs import Inputs
from nonlinear.dynamics.minimal import Arranged, Minimal, Recursion
from nonlinear.dynamics.text import Module
from nonlinear.system import Layout, Load, Numbers, System

UNDEFINED = (ZeroDivisionError, OverflowError, ValueError)
"""Raised by Python's floats where NumPy's give inf or nan."""

Rate = Callable[..., list[float]]
InputFunction = Callable[[float, Sequence[float]], Sequence[float]]


class Written(ABC):
    """Generated equations: their `derivative` uses the code for floats and for arrays."""

    @property
    @abstractmethod
    def rate(self) -> Rate:
        """The time derivative of one y in floats, a list, from y and the inputs u."""

    @property
    @abstractmethod
    def rate_of_arrays(self) -> Callable[..., Any]:
        """The same of many y at once, as columns."""

    @property
    @abstractmethod
    def inputs_at(self) -> InputFunction | None:
        """The inputs u at a time (s) and a state y; None if there are none."""

    @property
    def is_time_only(self) -> bool:
        """Whether the only input is the time."""
        return False

    def derivative(self, time: Any, y: Any) -> Any:
        """The time derivative of one y, (size,), or of many at once, (size, S), real or complex."""
        slopes = np.empty_like(y)
        if y.ndim > 1:
            for row, rate in zip(slopes, self.rate_of_arrays(y, self.inputs_beside(time, y)), strict=True):
                row[...] = rate
            return slopes
        state = y.tolist()
        try:
            slopes[...] = self.rate(state, self.inputs_at(time, state) if self.inputs_at else ())
        except UNDEFINED:
            slopes[...] = np.nan
        return slopes

    def inputs_beside(self, times: Any, y: Any) -> Any:
        """The inputs (K, S) of several states, at one time or each at its own."""
        if self.inputs_at is None:
            return ()
        times_of_states = np.broadcast_to(times, y.shape[1:]).tolist()
        return np.array([self.inputs_at(time, state) for time, state in zip(times_of_states, y.T.real, strict=True)]).T


@dataclass(frozen=True, eq=False)
class Generated(Written, Arranged):
    """The generated equations of `Minimal`, in space of `Spatial`."""

    system: System
    load: Load | None = None
    counts_work: bool = True

    @cached_property
    def form(self) -> Form:
        """The key of the text."""
        return form_of(self.system, has_load=self.load is not None, works=self.layout.works)

    @property
    def numbers(self) -> list[float]:
        """The numbers p of the form, (P,)."""
        return self.form.numbers_of(self.system)

    @cached_property
    def constants(self) -> list[float]:
        """The numbers in the text for this scene."""
        return module_of(self.form).constants(self.numbers)

    @cached_property
    def rate(self) -> Rate:
        """The time derivative of one y in floats, a list, from y and the inputs u."""
        return module_of(self.form).function("rates", self.constants)

    @cached_property
    def rate_of_arrays(self) -> Callable[..., Any]:
        """The same of many y at once, as columns."""
        return module_of(self.form).function("rates", self.constants, "arrays")

    @property
    def is_time_only(self) -> bool:
        """Whether the only input is the time."""
        return self.inputs.is_analytic and self.inputs.count == 1

    @cached_property
    def inputs_at(self) -> InputFunction | None:
        """The inputs u at a time (s) and a state y; None if there are none."""
        if not self.inputs.count:
            return None
        if self.load is None:
            return self.inputs.of_time
        return lambda time, y: self.inputs.inputs_at(time, y, self.layout)

    def inputs_beside(self, times: Any, y: Any) -> Any:
        """The inputs (K, S) of several states."""
        if self.load is not None:
            return super().inputs_beside(times, y)
        return [np.broadcast_to(value, y.shape[1:]) for value in self.inputs.beside(times)]


WRITTEN_LINKS_MAX = 32
"""Cost: links of a scene whose equations are written out; longer text takes longer to compile than it saves."""
Rates = Callable[..., Sequence[Any]]
"""The function that gives y' from y (size, S) and the times (s), one or a time each, or their inputs where known."""


@dataclass(frozen=True, eq=False)
class Lanes:
    """The equations of members with these `numbers`; `tangent` ones have v after y, and no work.

    Otherwise work is counted where there can be any, and `counts_work` says so.  The `target` of their texts is
    "arrays", or "columns" where y (size, S, 1 + k) has columns with infinitesimal imaginary parts.
    """

    numbers: Numbers
    tangent: bool = False
    counts_work: bool = True
    target: str = "arrays"

    @cached_property
    def system(self) -> System:
        """The form of all members, with the scene's own numbers."""
        return self.numbers.system

    @cached_property
    def layout(self) -> Layout:
        """The parts of y."""
        works = self.numbers.works and not self.tangent and self.counts_work
        return Layout.of(self.system, works=works)

    @property
    def size(self) -> int:
        """Length of y, with v if there is one."""
        return self.layout.size * (1 + self.tangent)

    @cached_property
    def inputs(self) -> Inputs:
        """The time-dependent inputs."""
        return Inputs(self.system, drags=self.numbers.has_drag)

    @cached_property
    def is_written(self) -> bool:
        """Whether the equations are generated."""
        return self.tangent or self.system.n_links <= WRITTEN_LINKS_MAX

    @cached_property
    def form(self) -> Form:
        """The key of the text."""
        numbers = self.numbers.entries, self.numbers.constants
        members = self.numbers.arrays
        frail = [loses_digits(group, members) for group in members.groups]
        return form_of(self.system, *numbers, works=self.layout.works, frail=frail)

    @cached_property
    def module(self) -> Module:
        """The rate of y as it is written."""
        return module_of(self.form, tangent=self.tangent)

    def constants(self, numbers: Numbers) -> list[Any]:
        """The values in the text for these members: numbers and arrays (S,)."""
        return self.module.constants(self.form.numbers(numbers.entries, numbers.constants))

    def rates(self, numbers: Numbers) -> Rates:
        """The rates of this many members as these numbers are of."""
        if self.is_written:
            rates = self.module.function("rates", self.constants(numbers), self.target)
            if not self.inputs.count:
                return lambda y, times=0.0, inputs=(): rates(y)
            return lambda y, times=0.0, inputs=None: rates(y, self.inputs.beside(times) if inputs is None else inputs)
        system = numbers.arrays
        moving = np.zeros(system.n_links) if system.hoisting is None else system.hoisting.moving
        bodies = (None if moving[group.index].any() else Recursion(group) for group in system.groups)
        equations = Minimal(system, tuple(bodies), counts_work=self.layout.works)
        courses = replace(equations.inputs, drags=self.inputs.drags)

        def by_recursion(y: Any, times: Any = 0.0, inputs: Any = None) -> Any:
            u = self.inputs.beside(np.broadcast_to(times, y.shape[1:])) if inputs is None else inputs
            return equations.rates(y, courses.instant(u))

        return by_recursion
