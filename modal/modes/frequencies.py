"""Natural frequencies of many scenes at once: together where they have one form, else one by one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from modal.assembly import Group, Stack, can_stack, stacked
from modal.eigen import CLOSE, Suspension, chains_of, squares_of
from modal.errors import ComputationError
from modal.modes.modes import natural_modes, validate_accuracy
from modal.scene import Scene
from modal.types import Booleans, Floats

TOGETHER = 2000
"""Number of scenes stacked at once."""


def natural_frequencies(scenes: Sequence[Scene], accuracy: float | None = None) -> Floats:
    """ω = |λ| (S, R) of S scenes in rad/s, each row ascending, each frequency repeated by its multiplicity.

    A free cart's rigid translation is 0.  Scenes of one form, the same kinds of links in the same pendula on the same
    kind of support without dampers and joint springs, are found together, many times faster than one by one; the
    others by `natural_modes`, whose `accuracy` this is.

    >>> from modal import load
    >>> from modal.scene.parameters import vary
    >>> scenes = [vary(load("chain-2"), {"gravity": g}) for g in (9.81, 1.62)]
    >>> natural_frequencies(scenes).round(4).tolist()
    [[2.3972, 5.7874], [0.9742, 2.3518]]

    Raises ValueError where scenes have different numbers of modes, and the errors of `natural_modes`.
    """
    limit = validate_accuracy(accuracy)
    rows: list[Floats] = []
    for at in range(0, len(scenes), TOGETHER):
        rows += _rows(scenes[at : at + TOGETHER], limit)
    if len(sizes := {len(row) for row in rows}) > 1:
        raise ValueError(f"scenes have from {min(sizes)} to {max(sizes)} modes: of one form all have as many")
    return np.array(rows).reshape(len(scenes), -1 if rows else 0)


def _rows(scenes: Sequence[Scene], accuracy: float) -> Iterator[Floats]:
    found = _together(stacked(scenes), accuracy) if can_stack(scenes) else np.full((len(scenes), 1), np.nan)
    for row, scene in zip(found, scenes, strict=True):
        yield _alone(scene, accuracy) if np.isnan(row[0]) else row


def _alone(scene: Scene, accuracy: float) -> Floats:
    modes = natural_modes(scene, accuracy=accuracy or None)
    return np.repeat(modes.omega, modes.multiplicity)


def _together(stack: Stack, accuracy: float) -> Floats:
    """ω (S, R); NaN in the rows of scenes that need individual treatment."""
    supports = len(stack.rate)
    try:
        with np.errstate(all="ignore"):
            found = np.concatenate(list(_squares(stack, accuracy)))
            found.sort(axis=0)
            omega: Floats = (np.sqrt(found) * stack.rate).T
    except ComputationError:
        return np.full((supports, 1), np.nan)
    omega[~np.isfinite(omega).all(1)] = np.nan
    return omega


def _squares(stack: Stack, accuracy: float) -> Iterator[Floats]:
    """ω² (R, S) with multiplicities."""
    held = stack.mass is not None and stack.stiffness is not None
    several = held and sum(len(group.count) for group in stack.groups) > 1
    own = []
    for group in stack.groups:
        times = group.count * (1 + stack.spatial) - held
        if several or times.any():
            squares = _own_squares(group, 0.0 if several else accuracy)
            own.append(squares)
            yield np.repeat(squares, times, axis=1).reshape(-1, len(stack.rate))
    if stack.mass is None or stack.stiffness is None:
        return
    heavy = []
    for group in stack.groups:
        times = group.count[:, None, None]
        heavy.append(chains_of(group.mass * times, group.length, group.centre, group.inertia * times))
    suspension = Suspension(tuple(heavy), stack.mass, stack.stiffness)
    free = bool(stack.stiffness[0] == 0)
    if free:
        yield np.zeros((1, len(stack.rate)))
    size = suspension.size + (not free)
    squares = squares_of(suspension, np.arange(size), size, accuracy).x
    yield np.where(_meet(own) if several else False, np.nan, squares)


def _own_squares(group: Group, accuracy: float) -> Floats:
    """ω² (n, P, S) on fixed supports."""
    n, pendula, _, supports = group.mass.shape
    chains = chains_of(*(values.reshape(n, 1, 1, -1) for values in group.numbers))
    return squares_of(Suspension((chains,)), np.arange(n), n, accuracy).x.reshape(n, pendula, supports)


def _meet(own: Sequence[Floats]) -> Booleans:
    """Whether two fixed-base frequencies of a scene are too close for a common treatment, (S,)."""
    every = np.sort(np.concatenate([squares.reshape(-1, squares.shape[-1]) for squares in own]), axis=0)
    return np.asarray((np.diff(every, axis=0) <= CLOSE * every[1:]).any(0))
