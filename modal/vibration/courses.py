"""Functions of time for support motions and forces, with two derivatives, and those in closed form."""

from __future__ import annotations

from abc import ABC, abstractmethod
from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from functools import cached_property
from math import cos, inf, radians, sin, tau
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from modal.scene import (
    ConstantForce,
    SineForce,
    SineMotion,
    SweepForce,
    SweepMotion,
)
from modal.types import Floats


class Polynomials(NamedTuple):
    """A function of time t: Σ c_k (t − t_i)^k in K pieces, of which each ends at one of the `knots` (K − 1,) in s.

    The t_i are the `origins` (K,), c the `coefficients` (K, d). It repeats after the `period` (s), inf if it does not;
    the origins of one that does part the period evenly, from its beginning to its end.
    """

    knots: Floats
    origins: Floats
    coefficients: Floats
    period: float = inf

    def beside(self, times: Floats) -> Floats:
        """The function at times of any shape (s)."""
        if self.period == inf:
            piece = np.searchsorted(self.knots, times, side="right")
        else:
            times = times % self.period
            piece = (times * self.pace + 0.5).astype(np.int64)
        s, value = times - self.origins[piece], np.zeros(np.shape(times))
        for coefficient in self.coefficients.T[::-1]:
            value = value * s + coefficient[piece]
        return value

    @property
    def pace(self) -> float:
        """Pieces a second (1/s) of a function that repeats."""
        return len(self.knots) / self.period

    @property
    def kinks(self) -> Floats:
        """How far the polynomials on both sides of each knot are apart half a piece away from it, at most, (K − 1,)."""
        left_pieces, right_pieces = self.coefficients[:-1], self.coefficients[1:].copy()
        shifted_pieces, s = left_pieces.copy(), (self.knots - self.origins[:-1])[:, None]
        for lowest in range(shifted_pieces.shape[1] - 1):
            for k in reversed(range(lowest, shifted_pieces.shape[1] - 1)):
                shifted_pieces[:, k] += s[:, 0] * shifted_pieces[:, k + 1]
        widths = np.diff(self.knots, prepend=-inf, append=inf)
        widths = np.where(np.isfinite(widths), widths, 0.0)
        reach = np.maximum(widths[:-1], widths[1:])[:, None] / 2
        return np.asarray(
            np.sum(np.abs(right_pieces - shifted_pieces) * reach ** np.arange(shifted_pieces.shape[1]), axis=1)
        )


class FloatRows(dict[int, tuple[float, ...]]):
    """The rows of these arrays joined, in plain floats, made as they are requested, this many at once."""

    BLOCK = 512

    def __init__(self, columns: Sequence[Floats]) -> None:
        super().__init__()
        self.columns = columns

    def __missing__(self, row: int) -> tuple[float, ...]:
        first = row - row % self.BLOCK
        block = np.hstack([column[first : first + self.BLOCK] for column in self.columns])
        self.update(enumerate(map(tuple, block.tolist()), first))
        return self[row]


def in_floats(functions: Sequence[Polynomials]) -> Callable[..., tuple[float, ...]]:
    """The functions at one time (s) in plain floats, as one function that is written for them.

    Those with the same pieces are looked up together; a further argument is of no use.
    """
    alike: dict[tuple[int, int, float], list[int]] = {}
    for k, function in enumerate(functions):
        alike.setdefault((id(function.knots), id(function.origins), function.period), []).append(k)
    space: dict[str, Any] = {"bisect_right": bisect_right}
    lines, values = ["def at(time, y=None):"], dict[int, str]()
    for g, numbers in enumerate(alike.values()):
        first, t, names, columns = functions[numbers[0]], "time", [f"s{g}"], [functions[numbers[0]].origins[:, None]]
        for k in numbers:
            used = functions[k].coefficients
            used = used[:, : 1 + int(np.flatnonzero(used.any(axis=0)).max(initial=0))]
            coefficient_names = [f"c{k}_{power}" for power in range(used.shape[1])]
            values[k] = coefficient_names[-1]
            for name in coefficient_names[-2::-1]:
                values[k] = f"({values[k]} * s{g} + {name})"
            names, columns = names + coefficient_names, [*columns, used]
        space[f"R{g}"], piece = FloatRows(columns), f"bisect_right(K{g}, time)"
        if first.period == inf:
            space[f"K{g}"] = first.knots.tolist()
        else:
            t, piece = f"t{g}", f"int(t{g} * {first.pace!r} + 0.5)"
            lines.append(f" t{g} = time % {first.period!r}")
        lines += [f" {', '.join(names)} = R{g}[{piece}]", f" s{g} = {t} - s{g}"]
    lines.append(f" return ({' '.join(f'{values[k]},' for k in range(len(functions)))})")
    exec(compile("\n".join(lines), "<inputs>", "exec"), space)
    return space["at"]  # type: ignore[no-any-return]


class PrescribedMotion(ABC):
    """A support's displacement (m), velocity (m/s) and acceleration (m/s²) in its direction.

    `breaks` (s) are the times at which its acceleration has a kink or a jump, `shortest` (s) the time in which it may
    change substantially.
    """

    breaks: tuple[float, ...] = ()
    shortest: float = inf
    words: str = ""
    """Remarks for the user."""
    units: Mapping[str, float] = {}
    """The keys of a scene that its constants come from, and the units of these there."""
    force: int = 2
    """The derivative that is the force, where a force is prescribed: a record's ends with it."""

    @property
    def constants(self) -> tuple[Any, ...]:
        """The numbers of a motion that plain arithmetic of these and of the time gives; none of any other."""
        return ()

    def with_constants(self, constants: Sequence[Any]) -> PrescribedMotion:
        """The motion with other constants, of any type that takes plain arithmetic and a sine."""
        raise NotImplementedError

    def polynomials(self, order: int) -> Polynomials | None:
        """The velocity (order 1) or the acceleration (2) piece by piece; None if it is no polynomial."""
        return None

    @abstractmethod
    def derivative(self, time: Any, order: int) -> Any:
        """The derivative of the displacement of this order, 0 to 2, at times of any shape (s)."""

    def beside(self, times: Any, order: int) -> Floats:
        """The velocity (order 1) or the acceleration (2) at many times, as fast as it can be had."""
        return np.asarray(self.derivative(np.asarray(times, dtype=float), order))

    def displacement(self, time: ArrayLike) -> Floats:
        """Displacement (m) at times of any shape (s)."""
        return np.asarray(self.derivative(np.asarray(time, dtype=float), 0))

    def velocity(self, time: ArrayLike) -> Floats:
        """Velocity (m/s)."""
        return np.asarray(self.derivative(np.asarray(time, dtype=float), 1))

    def acceleration(self, time: ArrayLike) -> Floats:
        """Acceleration (m/s²)."""
        return np.asarray(self.derivative(np.asarray(time, dtype=float), 2))

    def acceleration_at(self, time: float) -> float:
        """The acceleration (m/s²) at one time (s)."""
        return float(self.derivative(time, 2))

    def velocity_at(self, time: float) -> float:
        """The velocity (m/s) at one time (s)."""
        return float(self.derivative(time, 1))


class PiecewiseMotion(PrescribedMotion):
    """A motion whose velocity and acceleration are polynomials piece by piece."""

    @abstractmethod
    def polynomials(self, order: int) -> Polynomials:
        """The velocity (order 1) or the acceleration (2)."""

    @cached_property
    def acceleration_at(self) -> Callable[[float], float]:
        """In plain floats, from the polynomials."""
        at = in_floats([self.polynomials(2)])
        return lambda time: at(time)[0]

    @cached_property
    def velocity_at(self) -> Callable[[float], float]:
        """In plain floats, from the polynomials."""
        at = in_floats([self.polynomials(1)])
        return lambda time: at(time)[0]

    def beside(self, times: Any, order: int) -> Floats:
        """From the polynomials."""
        return self.polynomials(order).beside(np.asarray(times, dtype=float))


class Course(NamedTuple):
    """A prescribed time history: a derivative of a function."""

    motion: PrescribedMotion
    order: int

    def of(self, time: Any) -> Any:
        """Its value at a time (s) of any type that takes plain arithmetic."""
        return self.motion.derivative(time, self.order)

    @property
    def at(self) -> Callable[[float], float]:
        """Its value at one time (s), as fast as it can be had."""
        if self.order == 2:
            return self.motion.acceleration_at
        return self.motion.velocity_at if self.order == 1 else lambda time: float(self.motion.derivative(time, 0))

    def beside(self, times: Any) -> Floats:
        """At many times (s)."""
        return self.motion.beside(times, self.order)

    @property
    def polynomials(self) -> Polynomials | None:
        """The value piece by piece; None if it is no polynomial."""
        return self.motion.polynomials(self.order) if self.order else None


class Sine(PrescribedMotion):
    """A sin(ω t + φ)."""

    units = MappingProxyType({"amplitude": 1.0, "frequency_hz": tau, "phase_deg": radians(1.0)})
    force = 0

    def __init__(self, motion: SineMotion | SineForce) -> None:
        self.amplitude, self.omega, self.phase = motion.amplitude, tau * motion.frequency_hz, radians(motion.phase_deg)
        self.shortest = 0.5 / motion.frequency_hz

    @property
    def constants(self) -> tuple[Any, Any, Any]:
        """Amplitude (m), angular frequency (rad/s) and phase (rad)."""
        return self.amplitude, self.omega, self.phase

    def with_constants(self, constants: Sequence[Any]) -> Sine:
        """A sine with these."""
        new_sine = copy(self)
        new_sine.amplitude, new_sine.omega, new_sine.phase = constants
        return new_sine

    def derivative(self, time: Any, order: int) -> Any:
        """A ωⁿ sin(ω t + φ + n π/2)."""
        angle = self.omega * time + self.phase
        return self.amplitude * self.omega**order * (np.sin(angle), np.cos(angle), -np.sin(angle))[order]

    def acceleration_at(self, time: float) -> float:
        """In plain floats."""
        return -self.amplitude * self.omega**2 * sin(self.omega * time + self.phase)

    def velocity_at(self, time: float) -> float:
        """In plain floats."""
        return self.amplitude * self.omega * cos(self.omega * time + self.phase)


class Constant(PrescribedMotion):
    """The same value at all times."""

    units = MappingProxyType({"amplitude": 1.0})
    force = 0

    def __init__(self, motion: ConstantForce) -> None:
        self.amplitude: Any = motion.amplitude

    @property
    def constants(self) -> tuple[Any]:
        """The value."""
        return (self.amplitude,)

    def with_constants(self, constants: Sequence[Any]) -> Constant:
        """Another value."""
        new_constant = copy(self)
        (new_constant.amplitude,) = constants
        return new_constant

    def derivative(self, time: Any, order: int) -> Any:
        """The value, and 0 for derivatives."""
        return self.amplitude + 0.0 * time if order == 0 else 0.0 * time

    def acceleration_at(self, time: float) -> float:
        """Nothing."""
        return 0.0


class SweptSine(PrescribedMotion):
    """A sin(ψ) with ψ'' constant within the duration, zero outside."""

    force = 0

    def __init__(self, motion: SweepMotion | SweepForce) -> None:
        self.amplitude, self.first, self.last = motion.amplitude, tau * motion.from_hz, tau * motion.to_hz
        self.duration = motion.duration
        self.breaks = (0.0, motion.duration)
        self.shortest = 0.5 / max(motion.from_hz, motion.to_hz)

    def acceleration_at(self, time: float) -> float:
        """In plain floats."""
        omega, phase, acceleration = self._turning(time)
        return self.amplitude * (acceleration * cos(phase) - omega * omega * sin(phase))

    def velocity_at(self, time: float) -> float:
        """In plain floats."""
        omega, phase, _ = self._turning(time)
        return self.amplitude * omega * cos(phase)

    def _turning(self, time: float) -> tuple[float, float, float]:
        """Angular frequency (rad/s), phase (rad) and the change of the former (rad/s²) at one time (s)."""
        if time < 0.0:
            return self.first, self.first * time, 0.0
        rate, within = (self.last - self.first) / self.duration, min(time, self.duration)
        omega = self.first + rate * within
        phase = (self.first + omega) / 2 * within + omega * (time - within)
        return omega, phase, rate if time <= self.duration else 0.0

    def derivative(self, time: Any, order: int) -> Any:
        """By the chain rule."""
        within = np.clip(time, 0.0, self.duration)
        rate = (self.last - self.first) / self.duration
        omega = self.first + rate * within
        phase = (self.first + omega) / 2 * within + np.where(within == time, 0.0, omega * (time - within))
        if order == 0:
            return self.amplitude * np.sin(phase)
        if order == 1:
            return self.amplitude * omega * np.cos(phase)
        sweep_rate = np.where(within == time, rate, 0.0)
        return self.amplitude * (sweep_rate * np.cos(phase) - omega**2 * np.sin(phase))
