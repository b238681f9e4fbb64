"""The equations of motion in floats, as they are written for scenes of a few links (`nonlinear.dynamics.forms`)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from nonlinear.dynamics.forms import Form, form_of, module_of
from nonlinear.dynamics.minimal import Arranged
from nonlinear.system import Load, System, entries_of, prescribed_of

UNDEFINED = (ZeroDivisionError, OverflowError, ValueError)
"""Raised by Python's floats where NumPy's give inf or nan."""

Rate = Callable[..., list[float]]
Listed = Callable[[float, Sequence[float]], Sequence[float]]


class Written(ABC):
    """Equations that are written out: their `derivative` by what is written for floats and for arrays."""

    @property
    @abstractmethod
    def rate(self) -> Rate:
        """The time derivative of one y in floats, a list, from y and the inputs u."""

    @property
    @abstractmethod
    def rate_of_arrays(self) -> Callable[..., Any]:
        """The same of many y side by side."""

    @property
    @abstractmethod
    def listed(self) -> Listed | None:
        """The inputs u at a time (s) and a state y; None where there are none."""

    @property
    def is_clocked(self) -> bool:
        """Whether the only input is the time."""
        return False

    def derivative(self, time: Any, y: Any) -> Any:
        """The time derivative of one y, (size,), or of many side by side, (size, S), real or complex."""
        slopes = np.empty_like(y)
        if y.ndim > 1:
            for row, rate in zip(slopes, self.rate_of_arrays(y, self.inputs_beside(time, y)), strict=True):
                row[...] = rate
            return slopes
        state = y.tolist()
        try:
            slopes[...] = self.rate(state, self.listed(time, state) if self.listed else ())
        except UNDEFINED:
            slopes[...] = np.nan
        return slopes

    def inputs_beside(self, times: Any, y: Any) -> Any:
        """The inputs (K, S) of states side by side at one time or a time each."""
        if self.listed is None:
            return ()
        each = np.broadcast_to(times, y.shape[1:]).tolist()
        return np.array([self.listed(time, state) for time, state in zip(each, y.T.real, strict=True)]).T


@dataclass(frozen=True, eq=False)
class Generated(Written, Arranged):
    """The equations of `Minimal`, in space of `Spatial`, written out."""

    system: System
    load: Load | None = None
    counts_work: bool = True

    @cached_property
    def form(self) -> Form:
        """What the text depends on."""
        return form_of(self.system, pushed=self.load is not None, works=self.layout.works)

    @cached_property
    def constants(self) -> list[float]:
        """What stands in the text for this scene."""
        numbers = entries_of(self.system), prescribed_of(self.system)
        return module_of(self.form).constants(self.form.numbers(*numbers))

    @cached_property
    def rate(self) -> Rate:
        """The time derivative of one y in floats, a list, from y and the inputs u."""
        return module_of(self.form).function("rates", self.constants)

    @cached_property
    def rate_of_arrays(self) -> Callable[..., Any]:
        """The same of many y side by side."""
        return module_of(self.form).function("rates", self.constants, "arrays")

    @property
    def is_clocked(self) -> bool:
        """Whether the only input is the time."""
        return self.inputs.is_analytic and self.inputs.count == 1

    @cached_property
    def listed(self) -> Listed | None:
        """The inputs u at a time (s) and a state y; None where there are none."""
        if not self.inputs.count:
            return None
        if self.load is None:
            return self.inputs.of_time
        return lambda time, y: self.inputs.listed(time, y, self.layout)

    def inputs_beside(self, times: Any, y: Any) -> Any:
        """The inputs (K, S) of states side by side."""
        if self.load is not None:
            return super().inputs_beside(times, y)
        return [np.broadcast_to(value, y.shape[1:]) for value in self.inputs.beside(times)]
