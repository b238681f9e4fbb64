"""Inputs of loops of feedback (`nonlinear.system.loops`): of a state in any arithmetic, and held between samples."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from nonlinear.dynamics.tape import Symbol, where

if TYPE_CHECKING:
    from nonlinear.system.loops import ActingLoop


def input_of(loop: ActingLoop, y: Any) -> Any:
    """The input (N or N m) of a loop at y = (q, q', …), floats, arrays of many states, complex numbers or symbols."""
    total: Any = 0.0
    for k, (gain, (places, rest)) in enumerate(zip(loop.gains, loop.readings, strict=True)):
        value: Any = 0.0 - rest if rest else 0.0
        for place, factor in places:
            value = value + (y[place] if factor == 1.0 else factor * y[place])
        total = total - gain * (value - loop.references[k] if loop.references else value)
    return total if loop.limit is None else _clip(total, loop.limit)


def _clip(value: Any, limit: Any) -> Any:
    """The value within ±limit."""
    choose = Symbol.where if isinstance(value, Symbol) else where
    below = choose(value - limit, limit, value)
    return choose(-limit - below, -limit, below)
