"""The flow of the equations of motion with its derivative by the start: DOP853 for y and the variational equations.

    y' = f(y),   V' = J(y) V

Both take the same steps, whose length the error of y controls: y goes first, in floats, and the effect of a step on V
follows for many steps at once.  Steps end at kicks of escapements and where dry friction stops, sticks or breaks loose,
each of which carries V by its saltation matrix (`nonlinear.integration.changes`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property, partial
from math import ceil
from typing import Any, NamedTuple

import numpy as np
import scipy

from modal.errors import ComputationError
from modal.report import Displayed
from modal.types import IMAGINARY_STEP, Floats
from nonlinear.averaging.equations import ARRAY_ENTRIES
from nonlinear.dynamics.elimination import SINGULAR
from nonlinear.dynamics.generated import UNDEFINED, InputFunction, Rate
from nonlinear.dynamics.variational import Force, Variational
from nonlinear.integration.crowds import imaginary_after_kick, impulses_since
from nonlinear.integration.floats import FloatDOP853, FloatStep, Numbers, attempt_of
from nonlinear.integration.method import (
    ERROR_POWER,
    FIFTH,
    NODES,
    ROWS,
    STAGES,
    STEP_SAFETY,
    THIRD,
    Shares,
    control_steps,
)
from nonlinear.integration.switches import Switched
from nonlinear.system import System

ORBIT_TOLERANCE = 1e-12
"""Limit: default of `tolerance`: orbits close to 1e-11 then, and their multipliers are known to 1e-7; smaller angles,
energies and periods than it cannot be requested."""
FLOW_STEPS_MAX = 20_000
"""Limit: steps, beyond which "the motion takes too many steps to be followed over a period"."""
STILL_STEP_WAY = 1e-3
"""Cost: way of y in natural units, in a step in which it hardly moves, so that its error says nothing of V;
benchmarks/orbits.py."""
STILL_STEP_ERROR = 100
"""Tolerance: step tolerances by which such a step may err in V: V itself is wanted less accurate than y."""
STEP_DIVISIONS_MAX = 7
"""Limit: divisions of divided steps, beyond which "the derivatives of the motion cannot be followed"."""
UNFOLLOWED = "the derivatives of the motion cannot be followed over a period"


class Path(NamedTuple):
    """The ends of K steps: times (s), y and y' there, (K,) and (K, d); after a kick the same time once more."""

    times: Floats
    states: Floats
    rates: Floats


class NumberChange(NamedTuple):
    """A change of the numbers of equations, (P,), and of those of their switches, (g,)."""

    numbers: Floats
    switching: Floats


class Arrival(NamedTuple):
    """The end of a flow: y (d,), V (d, m), the state of its switches, and the path."""

    y: Floats
    V: Floats
    state: list[float]
    path: Path


def _dense(rows: Sequence[Shares]) -> Floats:
    """Shares of the rates at the stages, row by row, (rows, STAGES)."""
    dense = np.zeros((len(rows), STAGES))
    for shares, row in zip(dense, rows, strict=True):
        for stage, share in row:
            if stage < STAGES:
                shares[stage] = share
    return dense


SHARES = _dense(ROWS)
ERRORS = _dense((FIFTH, THIRD))


@dataclass(frozen=True, eq=False, repr=False)
class Flow(Displayed):
    """The flow of a system with this tolerance; `force` (n,) of the time acts from outside, in every coordinate.

    With a `change` of its numbers V has a last column, the change of y with them.
    """

    what = "Flow of a system"
    shows = "system: system; tolerance: tolerance"

    system: System
    tolerance: float = ORBIT_TOLERANCE
    force: Force | None = None
    change: NumberChange | None = None
    equations: Variational = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "equations", Variational(self.system, force=self.force))

    def __getstate__(self) -> dict[str, Any]:
        """Without derived attributes: generated functions cannot be pickled."""
        return {attribute.name: getattr(self, attribute.name) for attribute in fields(self)}

    @cached_property
    def scale(self) -> Floats:
        """Natural units of y, (d,)."""
        return self.equations.scale

    @cached_property
    def rest(self) -> Floats:
        """The equilibrium, (n,)."""
        return np.concatenate((np.zeros(self.equations.layout.first), self.system.rest))

    @cached_property
    def switched_equations(self) -> Switched | None:
        """The equations with their switches."""
        rubs = bool(self.equations.form.contacts)
        return Switched(self.equations) if self.system.has_escapements or rubs else None

    def __call__(
        self, y: Floats, V: Floats, duration: float, state: list[float] | None = None, start: float = 0.0
    ) -> Arrival:
        """The end of a motion from y, with V carried along; `state` is that of its switches, if it continues there."""
        solver, switched_equations = self._solver(y, duration, state, start), self.switched_equations
        samples, parts = [(0.0, y, solver.f)], list[FloatStep | Floats]()
        while True:
            if switched_equations and switched_equations.met_switch is not None:
                parts.append(self._through(solver, switched_equations))
                samples.append((solver.t - start, solver.y, solver.f))
            if solver.t >= solver.t_bound or (switched_equations and switched_equations.rests):
                break
            steps, _, _ = solver.advance((), 1)
            if not steps or len(samples) > FLOW_STEPS_MAX:
                raise ComputationError("the motion takes too many steps to be followed over a period")
            parts += steps
            samples.append((solver.t - start, solver.y, solver.f))
        times, states, rates = map(np.array, zip(*samples, strict=True))
        end_V = self._carry(V, parts) if V.shape[1] else V
        return Arrival(
            states[-1], end_V, switched_equations.state if switched_equations else [], Path(times, states, rates)
        )

    def _through(self, solver: FloatDOP853, switched_equations: Switched) -> Floats:
        """The change of V by the switch that was met, whose state and numbers hold from then on."""
        switches, j, S = switched_equations.switches, switched_equations.met_switch or 0, np.eye(len(solver.y)).tolist()
        u = [*self.equations.inputs_at(solver.t, ())] if self.equations.inputs_at else []  # before those of contacts
        held_inputs, count_before = [*u, *switched_equations.contact_inputs], len(switches.events)
        y, f = solver.y, solver.f.tolist()
        solver.switch(S)
        if self.change is None:
            return np.array(S).T
        saltation: Floats = scipy.linalg.block_diag(np.array(S).T, 1.0)
        if j < 2 * switches.places.K:
            parts = zip((self.equations.numbers, switches.numbers), self.change, strict=True)
            form, kicks = (
                [np.array([a + 1j * IMAGINARY_STEP * b]) for a, b in zip(*pair, strict=True)] for pair in parts
            )
            impulses = impulses_since(switches, count_before)
            jump_slope = imaginary_after_kick(
                switches, (form, kicks), j, y[:, None] + 0j, f, impulses, held_inputs, switched_equations.state, u
            )
            saltation[:-1, -1] = jump_slope[:, 0] / IMAGINARY_STEP
        return saltation

    def _solver(self, y: Floats, duration: float, state: list[float] | None, start: float) -> FloatDOP853:
        """The stepper from y."""
        equations = self.switched_equations or self.equations
        if self.switched_equations:
            self.switched_equations.switches.events.clear()
            if state:
                self.switched_equations.resume([*state])
            else:
                self.switched_equations.release(start, y)
        options: Any = {"rtol": self.tolerance, "atol": self.tolerance * self.scale}
        rates = (equations.rate, equations.inputs_at, equations.is_time_only, equations.derivative)
        try:
            solver = FloatDOP853(*rates, start, y, start + duration, **options)
        except UNDEFINED:
            raise ComputationError(SINGULAR) from None
        solver.switching = self.switched_equations
        if not np.all(np.isfinite(solver.f)):
            raise ComputationError(SINGULAR)
        return solver

    def _attempt(self, time: float, y: Numbers, rate: Numbers, length: float, contact_inputs: Numbers) -> Any:
        """The end of one step and its stages."""
        inputs_at = self._listed_with(contact_inputs)
        attempt = attempt_of(self.equations.size, ", inputs(t + {} * h, z)")
        smallest = (self.tolerance * self.scale).tolist()
        return attempt(self._rate, length, y, rate, self.tolerance, smallest, time, inputs_at)[2:4]

    @cached_property
    def _rate(self) -> Rate:
        """The y' from y and all inputs, whatever sticks."""
        if self.switched_equations and self.equations.form.contacts:
            return partial(self.switched_equations.switches.function("sticking"), v=())
        return self.equations.rate

    def _listed_with(self, contact_inputs: Numbers) -> InputFunction:
        """All inputs at a time (s) of a step with those of contacts."""
        timed_inputs = self.equations.inputs_at
        return lambda time, y: [*(timed_inputs(time, y) if timed_inputs else ()), *contact_inputs]

    def _carry(self, V: Floats, parts: Sequence[FloatStep | Floats]) -> Floats:
        """V at the end of these steps and of the saltation matrices between them."""
        steps, size = [part for part in parts if isinstance(part, FloatStep)], len(V)
        chunk = max(1, ARRAY_ENTRIES // (STAGES * size**2))
        maps = (step_map for k in range(0, len(steps), chunk) for step_map in self._step_maps(steps[k : k + chunk]))
        if self.change is not None:
            V = scipy.linalg.block_diag(V, 1.0)
        for part in parts:
            V = (next(maps) if isinstance(part, FloatStep) else part) @ V
        return V[:size]

    def _step_maps(self, steps: Sequence[FloatStep], depth: int = 0) -> Floats:
        """The effect of each of these steps on V, (N, d, d).

        Where y hardly moves, as at an unstable equilibrium, its error says nothing of V: a step that errs in V is
        divided. Raise ComputationError if that is so again and again, as where both ends of a spring meet.
        """
        if depth > STEP_DIVISIONS_MAX:
            raise ComputationError(UNFOLLOWED)
        maps, errors = self._maps(steps)
        for k, error in errors.items():
            if error <= STILL_STEP_ERROR:
                continue
            parts = ceil(min(error / STILL_STEP_ERROR, 1e8) ** -ERROR_POWER / STEP_SAFETY) + 1
            product = np.eye(maps.shape[-1])
            for piece in self._step_maps(self._divide(steps[k], parts), depth + 1):
                product = piece @ product
            maps[k] = product
        return maps

    def _divide(self, step: FloatStep, parts: int) -> list[FloatStep]:
        """The same step in equal parts."""
        pieces, y, length = list[FloatStep](), step.before, (step.end - step.start) / parts
        if step.start + length == step.start:
            raise ComputationError(UNFOLLOWED)
        inputs_at = self._listed_with(step.contact_inputs)
        for k in range(parts):
            time = step.start + k * length
            end, stages = self._attempt(time, y, self._rate(y, inputs_at(time, y)), length, step.contact_inputs)
            pieces.append(FloatStep(time, time + length, y, end, stages, step.contact_inputs))
            y = end
        return pieces

    def _maps(self, steps: Sequence[FloatStep]) -> tuple[Floats, dict[int, float]]:
        """The effect of these steps on V, (N, d, d), and the errors over the tolerance of those where y is still.

        With y of every stage known, J of all of them is computed at once.
        """
        times, lengths = np.array([(step.start, step.end - step.start) for step in steps]).T
        starts, stages = np.array([step.before for step in steps]).T, np.array([step.stages for step in steps])
        n_steps, size = len(steps), len(starts)
        inner = lengths[:, None] * np.tensordot(SHARES[:STAGES], stages[:, :STAGES], (1, 1)).transpose(2, 1, 0)
        y, u = (starts[..., None] + inner).reshape(size, -1), np.empty((0, n_steps * STAGES))
        if self.equations.form.contacts or self.equations.inputs_at:
            at = times[:, None] + lengths[:, None] * np.array(NODES[:STAGES])
            inputs = [self._listed_with(step.contact_inputs) for step in steps]
            u = np.array(
                [inputs_at(time, ()) for inputs_at, row in zip(inputs, at.tolist(), strict=True) for time in row]
            ).T
        J = self.equations.linearize(y, u)[1]
        if self.change is not None:
            size += 1
            J = np.pad(J, ((0, 0), (0, 1), (0, 1)))
            J[:, :-1, -1] = self.equations.moved_by(self.change.numbers, y, u, self._input_slopes(u)).T
        J = J.reshape(n_steps, STAGES, size, size) * lengths[:, None, None, None]
        K, unit = np.empty((STAGES, n_steps, size, size)), np.eye(size)
        flat = K.reshape(STAGES, -1)
        for stage in range(STAGES):
            K[stage] = J[:, stage] @ (unit + (SHARES[stage, :stage] @ flat[:stage]).reshape(n_steps, size, size))
        ends = unit + (SHARES[STAGES] @ flat).reshape(n_steps, size, size)
        ways = lengths * (np.abs(stages).max(1) / self.scale).max(1)
        still_steps = np.flatnonzero(ways < STILL_STEP_WAY)
        return np.asarray(ends), dict(zip(still_steps.tolist(), self._errors(K[:, still_steps]).tolist(), strict=True))

    def _input_slopes(self, u: Floats) -> Floats:
        """The change of the inputs u (K, S) with the numbers: those of contacts are their limits, but for a sign."""
        slopes, contacts = np.zeros_like(u), len(self.equations.form.contacts)
        if contacts and self.change is not None and self.switched_equations:
            switches = self.switched_equations.switches
            at = switches.places
            limits = slice(3 * at.K, 3 * at.K + contacts)
            part = self.change.switching[limits] / np.array(switches.numbers[limits])
            slopes[-2 * contacts : -contacts] = u[-2 * contacts : -contacts] * part[:, None]
        return slopes

    def _errors(self, K: Floats) -> Floats:
        """The errors (N,) over the tolerance, in natural units, of steps with these changes at the stages."""
        size = len(self.scale)
        K = K[..., :size, :size]
        stages, n_steps = K.shape[:2]
        errors = (ERRORS @ K.reshape(stages, -1)).reshape(2, n_steps, size, size) * (self.scale / self.scale[:, None])
        fifth, third = (errors**2).sum((2, 3)) / (size * self.tolerance**2)
        return control_steps(fifth, third, np.ones(n_steps), size, False)[0]
