"""Compilation of functions by numba (extra `fast`)."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from importlib.util import find_spec
from textwrap import dedent
from typing import Any


def available() -> bool:
    """Whether numba is installed."""
    return find_spec("numba") is not None


def compiled(function: Any, **options: Any) -> Any:
    """The compiled function, cached on disk where there is a folder for it; the function itself without numba."""
    try:
        from numba import njit
    except ImportError:
        return function
    try:
        return njit(cache=True, error_model="numpy", **options)(function)
    except RuntimeError:
        return njit(error_model="numpy", **options)(function)


def vectorized(function: Any, **options: Any) -> Any:
    """As `compiled`, with products and sums contracted and added up in any order, as vector instructions want it."""
    return compiled(function, fastmath={"contract", "nsz", "reassoc"}, **options)


def in_place(function: Any, **options: Any) -> Any:
    """As `vectorized`, for what makes no array of its own but reads and fills those of its caller.

    Their references are not counted, which in small functions takes longer than what they compute.
    """
    return vectorized(function, _nrt=False, **options)


def inner(function: Callable[..., Any], decorator: str) -> str:
    """The source of the functions that a function defines and returns, as functions of a module, each decorated."""
    lines = inspect.getsource(function).splitlines()
    first = next(k for k, line in enumerate(lines) if line.startswith("    def "))
    body = dedent("\n".join(lines[first : len(lines) - 1])).splitlines()
    return "\n".join(f"@{decorator}\n{line}" if line.startswith("def ") else line for line in body)
