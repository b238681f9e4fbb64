"""The plane equations of one structure, recorded whole: functions of its state and numbers, in any language.

The functions of `structure_steps` take the numbers p of the scene, y = (η, θ, η', θ', work), and u and v as follows:

    rates       u = the time (s) where something is prescribed, then forces (N, N m) on η and moments on θ: y'
    linear      the same u, v a small change of (η, θ, η', θ') from a state at rest: its rate, drives and quadratic drag
                left out, with the rates of that state itself
    stored      the kinetic and the potential energy (J), the latter from rest
    paired      u = x, v = z, two small motions of (η, θ) from a state at rest: x'Mz, x'Kz, x'Dz without what prescribes
    impelled    u = generalized impulses (N s, N m s) on (η, θ): what they add to the rates

The bilinear forms are second derivatives of the energies and of the power of dampers, by the chain rule on the tape.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from nonlinear.dynamics.energies import energies
from nonlinear.dynamics.forms import Form, TapedEquations, form_of
from nonlinear.dynamics.inputs import QUIET
from nonlinear.dynamics.minimal import Minimal
from nonlinear.dynamics.structure import Carriers, inverted_on_carriers
from nonlinear.dynamics.tape import along
from nonlinear.dynamics.text import Module
from nonlinear.system import System, entries_of, prescribed_of, system_with
from nonlinear.system.numbers import BEFORE, FIELDS, dampers_of

LINEAR = ("strength", "curb", "quadratic_drag")
"""The numbers of links that linear equations leave out."""


@dataclass(frozen=True, eq=False)
class StructureSteps:
    """The functions of a `system` on a structure, of those of its numbers that are not 0, and of all its dampers."""

    system: System

    @cached_property
    def form(self) -> Form:
        """What the text depends on: every damper has a number there."""
        form = form_of(self.system, pushed=True, works=True)
        links, structure = self.system.n_links, self.system.structure
        assert structure is not None
        at = BEFORE + links * FIELDS.index("damping")
        first = BEFORE + links * len(FIELDS)
        every = {*range(at, at + links), *(first + k for k in dampers_of(structure))}
        return replace(form, present=tuple(has or k in every for k, has in enumerate(form.present)))

    @property
    def kept(self) -> list[int]:
        """Which entries of a scene (`nonlinear.system.entries_of`) are the first numbers p."""
        return [k for k, has in enumerate(self.form.present) if has]

    @property
    def numbers(self) -> list[Any]:
        """The numbers p of the system: those entries, then the constants of what is prescribed."""
        return self.form.numbers(entries_of(self.system), prescribed_of(self.system))

    @cached_property
    def module(self) -> Module:
        """The functions, written."""
        equations = TapedEquations(self.form)
        tape, half = equations.tape, equations.minimal.layout.half
        y, (q, v) = equations.y, (equations.y[:half], equations.y[half : 2 * half])
        x, z = ([tape.symbol("in", kind, k) for k in range(half)] for kind in "uv")
        slow = _without(equations, LINEAR)
        smooth = (
            Minimal(slow, equations.bodies, equations.minimal.load).rates(y, equations.instant)[: 2 * half].tolist()
        )
        change = [tape.symbol("in", "v", k) for k in range(2 * half)]
        moved = along(tape, smooth, y[: 2 * half], change)
        parts = energies(equations.system, q, v)
        T, V = parts.moving, parts.stored
        still = replace(slow, support=None, forces=())
        power = Minimal(still, equations.bodies, equations.minimal.load).rates(y, QUIET)[-1]
        mass, drained = (_second(tape, energy, v, x, z) for energy in (T, power))
        functions = {
            "rates": equations.rates,
            "linear": [rate + more for rate, more in zip(smooth, moved, strict=True)],
            "stored": [T, V],
            "paired": [mass, _second(tape, V, q, x, z), -0.5 * drained],
        }
        if self.system.kicked:
            solvers = list(zip(equations.system.groups, equations.bodies, strict=True))
            impulses = np.empty(half, dtype=object)
            impulses[:] = x
            functions["impelled"] = inverted_on_carriers(Carriers(equations.system), solvers, q, impulses).tolist()
        return Module(tape, functions)


def structure_steps(system: System) -> StructureSteps:
    """The functions of a system on a structure."""
    return StructureSteps(system)


def _without(equations: TapedEquations, names: Sequence[str]) -> System:
    """The system of these equations with 0 for these numbers of links."""
    entries, links = [*equations.entries], equations.system.n_links
    for name in names:
        at = BEFORE + links * FIELDS.index(name)
        entries[at : at + links] = [0.0] * links
    return system_with(equations.system, entries)


def _second(tape: Any, value: Any, by: Any, x: Sequence[Any], z: Sequence[Any]) -> Any:
    """The second derivative of a value along x and z."""
    (first,) = along(tape, [value], by, x)
    return along(tape, [first], by, z)[0]
