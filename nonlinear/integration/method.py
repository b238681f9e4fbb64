"""DOP853 (Hairer, Nørsett and Wanner, Solving Ordinary Differential Equations I, 1993, §II.5) as data and as texts.

The coefficients are read from SciPy's method and stand nowhere else; every loop over steps, in floats, in lanes of
NumPy, compiled, takes from here its sums over stages, its error and the length of its next step, so that all of them
take the same steps.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt
from typing import Any

import numpy as np
from scipy.integrate import DOP853

from modal.types import Floats

STAGES, EXTRA = DOP853.n_stages, len(DOP853.A_EXTRA)
SAFETY, SHRINKS, GROWS, POWER = 0.9, 0.2, 10.0, -1 / 8
"""Of the length of the next step over that of this one, whose error over the tolerance is raised to a power."""

Shares = Sequence[tuple[int, float]]


def _shares(row: Any) -> Shares:
    return tuple((stage, float(share)) for stage, share in enumerate(row) if share)


ROWS: Sequence[Shares] = (*(_shares(row[:stage]) for stage, row in enumerate(DOP853.A)), _shares(DOP853.B))
"""Of the rates at earlier stages in y at every stage; the last is the end of the step."""
END, FIFTH, THIRD = ROWS[STAGES], _shares(DOP853.E5), _shares(DOP853.E3)
"""Of the rates at all stages in the end of the step, and in its errors of fifth and third order."""
MORE, POWERS = [_shares(row) for row in DOP853.A_EXTRA], [_shares(row) for row in DOP853.D]
"""Of the rates at all stages in y at further ones, and of these as well in the last terms of the interpolant."""
NODES: Sequence[float] = tuple(map(float, (*DOP853.C, 1.0, *DOP853.C_EXTRA)))
"""The part of a step at each stage, the end of the step, and the further stages."""
SEEN = (6, 8, 10)
"""Stages at which y may be looked at on the way: ascending in time."""
LOOKS = (0.0, *(NODES[stage] for stage in SEEN), 1.0)
"""The parts of a step at which switches are looked at."""


def weighted(shares: Shares, name: str) -> str:
    """The text of a sum over stages, whose rates have this name with the number of the stage in place of {}."""
    return " + ".join(f"{share!r} * {name.format(stage)}" for stage, share in shares)


def summed(shares: Shares, stages: Floats, found: Floats, work: Floats) -> None:
    """A sum over stages into `found`; `work` is an array like it."""
    (stage, share), *others = shares
    np.multiply(stages[stage], share, out=found)
    for stage, share in others:
        np.multiply(stages[stage], share, out=work)
        found += work


def interpolated(part: Any, terms: Sequence[Any]) -> Any:
    """What y has gained at a part of the step, from the `terms` of the interpolant."""
    found = 0.0 * terms[0]
    for number in range(len(terms)):
        found = (found + terms[-1 - number]) * (1 - part if number % 2 else part)
    return found


def terms_of(length: Any, moved: Any, stages: Any) -> list[Any]:
    """The terms of the interpolant of a step in which y has `moved`, from the rates at all stages and further ones."""
    powers = (sum(share * stages[stage] for stage, share in shares) for shares in POWERS)
    return [*begun(moved, length * stages[0], length * stages[STAGES]), *(length * own for own in powers)]


def begun(moved: Any, first: Any, last: Any) -> tuple[Any, Any, Any]:
    """The first three terms, of a cubic: from what y has moved, and its rates at both ends times the step."""
    return moved, first - moved, 2 * moved - last - first


def controlled(fifth: float, third: float, length: float, size: float, refused: bool) -> tuple[float, float]:
    """The error over the tolerance, and the length of the next step over this one.

    `fifth` and `third` are sums over `size` components of the squares of errors over their tolerances; after a step
    that was `refused` none is longer.  Run by Python and compiled by numba.
    """
    both = fifth + 0.01 * third
    error = length * fifth / sqrt(both * size) if both else 0.0
    if error < 1.0:
        grown = min(GROWS, SAFETY * error**POWER) if error else GROWS
        return error, min(1.0, grown) if refused else grown
    return error, max(SHRINKS, SAFETY * error**POWER) if error < np.inf else SHRINKS


def steered(fifth: Floats, third: Floats, length: Floats, size: int, refused: Any) -> tuple[Floats, Floats]:
    """The same as `controlled` of many steps at once."""
    both = fifth + 0.01 * third
    with np.errstate(invalid="ignore", divide="ignore"):
        error = np.where(both == 0, 0.0, length * fifth / np.sqrt(both * size))
        factor = np.clip(SAFETY * error**POWER, SHRINKS, GROWS)
    most = np.where((error < 1) & ~refused, GROWS, 1.0)
    return error, np.where(np.isfinite(factor), np.minimum(factor, most), SHRINKS)
