"""Natural frequencies of many scenes at once: together if they have one form, else one by one."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from math import prod

import numpy as np

from modal.assembly import Stack, can_stack, keep_form, stack_scenes, vary_scene
from modal.eigen import CLOSE, Suspension, squares_of
from modal.errors import ComputationError, SceneError
from modal.modes.eigenvalues import ShortChain
from modal.modes.modes import natural_modes, validate_accuracy
from modal.scene import Scene, validate_scenes
from modal.scene.parameters import Variable, Vary, parse_arrays, parse_vary, validate_arrays
from modal.types import Booleans, Floats

LINKS_OF_PIECE = 10_000
"""Cost: links of all scenes stacked at once: one array of their numbers stays in cache (benchmarks/modes.py)."""
MOST_MEMBERS = 100_000_000
"""Limit: members of one call, refused beyond as a number of `vary`."""


def natural_frequencies(
    scenes: Scene | Sequence[Scene], accuracy: float | None = None, *, vary: Vary | None = None
) -> Floats:
    """Return natural frequencies ω = |λ| of one scene or many, ascending, each repeated by its multiplicity.

    Scenes of one form, the same kinds of links in the same pendula on the same kind of support without dampers and
    joint springs, are solved together, many times faster than one by one. The others use `natural_modes`, also if a
    varied number changes the form.

    Parameters
    ----------
    scenes
        A scene, or a sequence of S scenes with equally many modes.
    accuracy
        The largest relative error of ω that is allowed, as that of `natural_modes`.  None computes every digit:
        relative errors are at most 2⁻⁵² larger than the bounds `error` of `Modes`.
    vary
        Other numbers of one scene, in the units of scene files.  Arrays at their places, `{"support.mass": masses}`,
        broadcast to one shape (…).  A grid, `["support.mass=1:100:50log", "gravity=1.6,9.8"]`, has an axis for each
        place.  No scenes are made, which would take longer than their frequencies.

    Returns
    -------
    numpy.ndarray
        Frequencies in rad/s: (R,) of a scene, (S, R) of S scenes, (…, R) with `vary`. The rigid translation of a free
        cart is 0; a mode without a certain digit is NaN.

    Raises
    ------
    SceneError
        The scene cannot have some of the numbers: the message names every place and number.
    ValueError
        The scenes have different numbers of modes.
    ComputationError
        Double precision or memory does not suffice.

    Examples
    --------
    >>> from modal import load
    >>> natural_frequencies(load("chain-2")).round(4).tolist()
    [2.3972, 5.7874]
    >>> natural_frequencies(load("chain-2"), vary={"gravity": [9.81, 1.62]}).round(4).tolist()
    [[2.3972, 5.7874], [0.9742, 2.3518]]
    >>> natural_frequencies(load("paper-cart-2"), vary=["support.mass=1:100:50log", "gravity=1.6,9.8"]).shape
    (50, 2, 5)
    """
    limit = validate_accuracy(accuracy)
    if isinstance(scenes, Scene):
        return _one(scenes, limit) if vary is None else _frequencies_of_variations(scenes, vary, limit)
    if vary is not None:
        raise SceneError(["vary: the numbers of one scene can be varied, not those of several"])
    validate_scenes(scenes)
    pieces = _pieces(scenes[0], len(scenes)) if len(scenes) else []

    def of_piece(part: Sequence[Scene]) -> Floats:
        omegas = _solve_together(stack_scenes(part), limit) if can_stack(part) else np.full((len(part), 1), np.nan)
        return _fill_missing(omegas, lambda missing: [part[k] for k in missing], limit)

    return _concatenate([of_piece(scenes[piece]) for piece in pieces])


def _frequencies_of_variations(scene: Scene, vary: Vary, accuracy: float) -> Floats:
    if not isinstance(vary, Mapping):
        axes, _ = parse_vary(scene, vary)
        grids = np.meshgrid(*(axis.values for axis in axes), indexing="ij", sparse=True)
        vary = dict(zip((axis.path for axis in axes), grids, strict=True))
    variable, arrays = parse_arrays(scene, vary)
    validate_arrays(variable, arrays)
    try:
        shape = np.broadcast_shapes(*(values.shape for values in arrays.values()))
    except ValueError:
        shapes = ", ".join(f"{values.shape} at {path}" for path, values in arrays.items())
        raise SceneError([f"vary: arrays must have shapes that broadcast together, not {shapes}"]) from None
    if not (size := prod(shape)) or not arrays:
        frequencies = _one(scene, accuracy)
        return np.broadcast_to(frequencies, (*shape, len(frequencies))).copy()
    if size > MOST_MEMBERS:
        raise SceneError([f"vary: at most {MOST_MEMBERS} members, not {size}"])
    members = {path: np.broadcast_to(values, shape).ravel() for path, values in arrays.items()}
    frequencies = _concatenate([_of_numbers(variable, members, piece, accuracy) for piece in _pieces(scene, size)])
    return frequencies.reshape(*shape, -1)


def _pieces(scene: Scene, size: int) -> list[slice]:
    step = max(1, LINKS_OF_PIECE // sum(pendulum.n_links for pendulum in scene.pendulum))
    return [slice(at, at + step) for at in range(0, size, step)]


def _of_numbers(variable: Variable, members: Mapping[str, Floats], piece: slice, accuracy: float) -> Floats:
    """ω (S, R) of a scene with these numbers at its paths, a piece of them."""
    values = {path: values_of[piece] for path, values_of in members.items()}
    numbers = {place: values_of for path, values_of in values.items() for place in variable.places[path]}
    keeps_form = keep_form(numbers)
    stack = vary_scene(variable.scene, {place: values_of[keeps_form] for place, values_of in numbers.items()})
    omegas = np.full((len(keeps_form), 1), np.nan)
    if stack and keeps_form.any():
        rows = _solve_together(stack, accuracy)
        omegas = np.full((len(keeps_form), rows.shape[1]), np.nan)
        omegas[keeps_form] = rows
    return _fill_missing(omegas, partial(_make_scenes, variable, values, piece.start), accuracy)


def _make_scenes(variable: Variable, values: Mapping[str, Floats], first: int, missing: Sequence[int]) -> list[Scene]:
    """The scenes of some members; SceneError that names all of those whose numbers cannot be together."""
    scenes, problems = [], list[str]()
    for k in missing:
        try:
            scenes.append(variable.at({path: float(column[k]) for path, column in values.items()}))
        except SceneError as error:
            problems += [f"member {first + k}: {problem}" for problem in error.problems]
    if problems:
        raise SceneError(problems)
    return scenes


def _fill_missing(omegas: Floats, scenes_of: Callable[[Sequence[int]], list[Scene]], accuracy: float) -> Floats:
    """The rows with those of NaN from their scenes, one by one."""
    missing = np.flatnonzero(np.isnan(omegas[:, 0]))
    if not missing.size:
        return omegas
    rows = [_one(scene, accuracy) for scene in scenes_of(missing.tolist())]
    if missing.size == len(omegas):
        return _concatenate([row[None] for row in rows])
    _concatenate([omegas[:0], *(row[None] for row in rows)])
    omegas[missing] = rows
    return omegas


def _concatenate(pieces: Sequence[Floats]) -> Floats:
    """All rows; raise ValueError if they are of different lengths."""
    if len(sizes := {piece.shape[1] for piece in pieces}) > 1:
        raise ValueError(f"scenes have from {min(sizes)} to {max(sizes)} modes: of one form all have as many")
    return np.concatenate(pieces) if pieces else np.zeros((0, 0))


def _one(scene: Scene, accuracy: float) -> Floats:
    if chain := ShortChain.of(scene):
        return chain.omega
    modes = natural_modes(scene, accuracy=accuracy or None)
    return np.repeat(modes.omega, modes.multiplicity)


def _solve_together(stack: Stack, accuracy: float) -> Floats:
    """ω (S, R); NaN in the rows of scenes that need individual treatment."""
    supports = len(stack.rate)
    try:
        with np.errstate(all="ignore"):
            squares = np.concatenate(list(_squares(stack, accuracy)))
            if (squares[1:] < squares[:-1]).any():
                squares.sort(axis=0)
            omega: Floats = np.sqrt(squares) * stack.rate
    except ComputationError:
        return np.full((supports, 1), np.nan)
    omega[:, ~np.isfinite(omega).all(0)] = np.nan
    return omega.T


def _squares(stack: Stack, accuracy: float) -> Iterator[Floats]:
    """ω² (R, S) with multiplicities."""
    cart, several = stack.cart, stack.cart is not None and sum(block.size for block in stack.blocks) > 1
    stretches = []
    for block in stack.blocks:
        times = block.count * (1 + stack.spatial) - (cart is not None)
        if several or times.any():
            squares = _squares_of(Suspension.on_fixed_support(block), block.n, 0.0 if several else accuracy)
            squares = squares.reshape(block.n, block.size, -1)
            stretches.append(squares)
            yield np.repeat(squares, times, axis=1).reshape(-1, len(stack.rate))
    if cart is None:
        return
    suspension = Suspension.on_cart([block.heavier(block.count[:, None, None]) for block in stack.blocks], cart)
    free = bool(cart.stiffness[0] == 0)
    if free:
        yield np.zeros((1, len(stack.rate)))
    size = suspension.size + (not free)
    squares = _squares_of(suspension, size, accuracy)
    yield np.where(_meet(stretches) if several else False, np.nan, squares)


def _squares_of(suspension: Suspension, modes: int, accuracy: float) -> Floats:
    """All ω² (R, S), rounded as those of many supports also if there is one: no member depends on the others."""
    is_single = suspension.supports == 1
    several = suspension.take(np.zeros(2, dtype=np.int64)) if is_single else suspension
    squares = squares_of(several, np.arange(modes), modes, accuracy).x
    return squares[:, :1] if is_single else squares


def _meet(stretches: Sequence[Floats]) -> Booleans:
    """Whether two fixed-base frequencies of a scene are too close for a common treatment, (S,)."""
    all_squares = np.sort(np.concatenate([squares.reshape(-1, squares.shape[-1]) for squares in stretches]), axis=0)
    return np.asarray((np.diff(all_squares, axis=0) <= CLOSE * all_squares[1:]).any(0))
