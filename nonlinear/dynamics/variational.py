"""The derivatives of the equations of motion in the plane, on the tape of their text, for variational equations.

    y' = f(y, u),   V' = J V,   J = ∂f/∂y

So are those of what a motion conserves: all are recorded from the plain arithmetic of the equations and of the energies
(`nonlinear.dynamics.tape`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from modal.errors import ComputationError
from modal.types import IMAGINARY_STEP, Floats
from nonlinear.dynamics.elimination import SINGULAR
from nonlinear.dynamics.forces import cart_force, modal_drag, plane_drag
from nonlinear.dynamics.forms import Form, Symbolic, form_of, jacobian_of, module_of, switching_of, with_contacts
from nonlinear.dynamics.generated import UNDEFINED, Generated, InputFunction
from nonlinear.dynamics.mechanics import energies
from nonlinear.dynamics.tape import gradient, partials
from nonlinear.dynamics.text import Module

Force = Callable[[float], Floats]
WRITTEN_DERIVATIVES_MAX = 8
"""Cost: links up to which entries of J are written one by one; longer scenes have J v written, in all directions.

A cart with a chain of eight takes 9 µs a state rather than 23 µs, 1,200 at once, but 105 ms rather than 28 ms to be
written.
"""


@dataclass(frozen=True, eq=False)
class Variational(Generated):
    """The equations of `Generated` without work, y = (x, θ, x', θ'), with their derivatives.

    A `force` (half,) of the time acts from outside, in every coordinate (N, N m).  Inputs u are those of time, then it,
    then those of contacts with dry friction.
    """

    counts_work: bool = False
    force: Force | None = None

    @cached_property
    def form(self) -> Form:
        """The key of the text."""
        return with_contacts(form_of(self.system, has_load=self.force is not None, works=False))

    @cached_property
    def inputs_at(self) -> InputFunction | None:
        """The inputs u at a time (s) before those of contacts; None if there are none."""
        force, inputs = self.force, super().inputs_at
        if force is None:
            return inputs
        return lambda time, y: [*(inputs(time, y) if inputs else ()), *np.asarray(force(time), dtype=float).tolist()]

    @property
    def is_time_only(self) -> bool:
        """Whether the only input is the time."""
        return self.force is None and super().is_time_only

    @property
    def size(self) -> int:
        """Length of y."""
        return self.layout.size

    def linearize(self, y: Any, u: Any = ()) -> tuple[Floats, Floats]:
        """The derivative y' (d, ...) and its Jacobian by y, (..., d, d), of one y (d,) or many at once, (d, S).

        `u` are the inputs (`nonlinear.dynamics.inputs`), (K,) or (K, S). Raise ComputationError if the mass matrix of
        one y is singular.
        """
        y = np.asarray(y)
        target = "floats" if y.ndim == 1 else "arrays"
        try:
            if self.system.n_links > WRITTEN_DERIVATIVES_MAX:
                return self._by_directions(y, u)
            values = self._derivatives[target](y.tolist() if y.ndim == 1 else y, u)
        except UNDEFINED:
            raise ComputationError(SINGULAR) from None
        _, rows, columns = jacobian_of(self.form)
        rate, J = np.empty(y.shape), np.zeros((*y.shape[1:], self.size, self.size))
        for k, value in enumerate(values[: self.size]):
            rate[k] = value
        for row, column, value in zip(rows, columns, values[self.size :], strict=True):
            J[..., row, column] = value
        return rate, J

    @cached_property
    def _derivatives(self) -> dict[str, Any]:
        module, _, _ = jacobian_of(self.form)
        constants = module.constants(self.numbers)
        return {target: module.function("jacobian", constants, target) for target in ("floats", "arrays")}

    @cached_property
    def tangent(self) -> Any:
        """The function (y', J v) of arrays, from (y, v) as one sequence and the inputs u."""
        module = module_of(self.form, tangent=True)
        constants = module.constants(self.numbers)
        return module.function("rates", constants, "arrays")

    def _by_directions(self, y: Floats, u: Any) -> tuple[Floats, Floats]:
        size, inputs = self.size, [np.asarray(value)[..., None] for value in u]
        directions = np.eye(size).reshape(size, *[1] * (y.ndim - 1), size)
        with np.errstate(all="ignore"):
            values = self.tangent([*y[..., None], *directions], inputs)
        rate, J = np.empty(y.shape), np.empty((*y.shape[1:], size, size))
        for k in range(size):
            rate[k] = np.asarray(values[k])[..., 0] if np.ndim(values[k]) else values[k]
            J[..., k, :] = values[size + k]
        return rate, J

    def moved_by(self, change: Floats, y: Floats, u: Any = (), input_change: Any = ()) -> Floats:
        """The derivative (d, S) of y' at many y at once (d, S) along a change δp (P,) of the numbers.

        The inputs u (K, S) change by `input_change` (K, S), by default not at all.
        """
        name = "sticking" if self.form.contacts else "rates"
        module = switching_of(self.form) if self.form.contacts else module_of(self.form)
        pairs = zip(self.numbers, change.tolist(), strict=True)
        p = [np.array([value + 1j * IMAGINARY_STEP * step]) for value, step in pairs]
        inputs = np.asarray(u) + 1j * IMAGINARY_STEP * np.asarray(input_change) if len(input_change) else u
        with np.errstate(all="ignore"):
            values = module.function(name, module.constants(p), "arrays")([*y.astype(complex)], inputs)
        return (
            np.array([np.broadcast_to(np.imag(value), y.shape[1:]) for value in values[: self.size]]) / IMAGINARY_STEP
        )

    def energy_slope(self, y: Floats) -> Floats:
        """The derivative of the energy (J) by y, (d,)."""
        return np.array(self._gradient("energy")(y.tolist()))

    def momenta(self, q: Floats, v: Floats) -> Floats:
        """The momenta ∂T/∂q' = M(q) v (half, S) at many coordinates q and rates v (half, S)."""
        return np.array([np.broadcast_to(value, q.shape[1:]) for value in self._momenta([*q, *v])])

    def impulse_slope(self, y: Floats, displacement: Floats) -> Floats:
        """The derivative by y (d,) of the momentum of a structure along a displacement (half,) of its coordinates."""
        half = self.layout.half
        q, v = y[:half, None], y[half:, None]
        changes = self.momenta(q + 1j * IMAGINARY_STEP * np.eye(half), np.broadcast_to(v, (half, half)))
        return np.concatenate(
            (displacement @ changes.imag / IMAGINARY_STEP, self.momenta(q, displacement[:, None])[:, 0])
        )

    @cached_property
    def _momenta(self) -> Any:
        return self._gradient("momenta", "arrays")

    def momentum_slope(self, y: Floats) -> Floats:
        """The derivative by y, (d,), of the invariant of a cart without a spring: p_x and the impulse of dampers.

        That is p_x + c x + Σ c_k x_k + D_x·q with the dampings c of the cart and c_k of the centres of links, at x_k,
        and the row D_x of damping ratios.
        """
        return np.array(self._gradient("momentum")(y.tolist()))

    def _gradient(self, name: str, target: str = "floats") -> Any:
        """A function of `_gradients`."""
        module = _gradients(self._free_form)
        return module.function(name, module.constants(self._free_form.numbers_of(self.system)), target)

    @cached_property
    def _free_form(self) -> Form:
        """The form of the same system, without applied forces."""
        return form_of(self.system, works=False)


@lru_cache(maxsize=64)
def _gradients(form: Form) -> Module:
    """The functions "energy" and, on one cart, "momentum" of a form, the derivatives of both by y, and "momenta"."""
    symbolic = Symbolic(form)
    tape, system = symbolic.tape, symbolic.system
    half = system.n_links + system.first
    y = tape.inputs("y", 2 * half)
    parts = energies(system, y[:half], y[half:])
    energy, p = gradient(tape, parts.total, y), gradient(tape, parts.moving, y[half:])
    functions = {"energy": energy, "momenta": p}
    if system.cart:
        links, rates, speed = y[1:half], y[half + 1 :], y[half]
        outside = cart_force(system, 0.0, speed)[1]
        if system.modal_damping is not None:
            outside = outside + modal_drag(system, y[half:])[0]
        for group in system.groups:
            if group.has_drag:
                external = plane_drag(group, links[group.index], rates[group.index], (speed, 0.0))
                outside = outside + external.along_rail
        momentum_slopes, resistance_slopes = partials(tape, [p[0], outside], list(y))
        functions["momentum"] = [
            momentum_slopes.get(k, 0.0) - (resistance_slopes.get(half + k, 0.0) if k < half else 0.0)
            for k in range(2 * half)
        ]
    return Module(tape, functions)
