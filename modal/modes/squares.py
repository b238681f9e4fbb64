"""The displacements in a mode of a structure whose squares are its energies, and their dependence on parameters.

M, K and D are sums of sizes s times the squares of rows r over the coordinates (`modal.assembly.squares`), so that

    φᵀ ∂(λ²M + λD + K)/∂p φ = Σ λᵏ (∂s/∂p z² + 2 s z ∂r/∂p·φ),      z = r·φ, k = 2, 1, 0

in which a displacement z that is the small difference of large terms is lost with φ rounded: there the mode is refined
in many digits (`refine`), by Newton's iteration of λ in yᵀP(λ)y with P(λ)y = P'(λ)φ, P = λ²M + λD + K.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from decimal import Context, Decimal, localcontext
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from modal.assembly import Arrays, differences, rig_of, scene_squares
from modal.assembly.linearization import DENSE_COORDINATES_MAX
from modal.assembly.squares import SceneSquares, SquareRows
from modal.assembly.structure import modal_supports
from modal.eigen import REFINED_DIGITS, Digits
from modal.errors import ComputationError, SceneError
from modal.modes.mode import MOST_REFINED
from modal.scene import Scene
from modal.scene.parameters import Place, number_at
from modal.scene.validation import Part
from modal.types import EPS, NEWTON_ROUNDS, NOISE_OF_SUM, Complexes, Floats, Ints

if TYPE_CHECKING:
    from modal.modes.eigenvalues import Eigenvalues

CANCELLED = 1e-13
"""Tolerance: error of a relative derivative above which its mode is refined in many digits."""
UNSURE = 1e-9
"""Tolerance: error of a relative derivative above which it is refused: nine digits are promised."""
KEPT_SHARE_OF_MOMENTUM = 1e-3
"""Tolerance: share of the terms of a momentum above which its digits suffice, without refinement."""
Keys = list[tuple[str, int, int]]


LINEARIZED = frozenset(
    {"gravity", "mass", "length", "centre", "inertia", "damping", "stiffness", "drag", "position", "links", "pendulum"}
    | {"support", "spring", "sway", "heave", "roll", "rotor_inertia", "gear_ratio"}
)
"""Keys of numbers, and of their tables, on which M, K and D depend."""


class _Change(NamedTuple):
    """The changes of `Rows` by a number: sizes (k,) and entries of rows (e,), at these places."""

    size_places: Ints
    size: Floats
    square: Ints
    column: Ints
    entry: Floats


class Rows(NamedTuple):
    """Squares of K, D and M, one after another: `size` (N,) times that of `rows` (N, n), with λ to the `power` (N,).

    `keys` distinguish the squares of two scenes of one form.
    """

    size: Any
    rows: Any
    power: Ints
    keys: Keys

    def in_order(self, keys: Keys) -> tuple[Any, Any]:
        """Return size and rows in the order of other keys; missing ones are 0."""
        if keys == self.keys:
            return self.size, self.rows
        places = {key: place for place, key in enumerate(self.keys)}
        size, rows = np.zeros(len(keys)), np.zeros((len(keys), self.rows.shape[1]))
        for place, key in enumerate(keys):
            if (position := places.get(key)) is not None:
                size[place], rows[place] = self.size[position], self.rows[position]
        return size, rows


def rows_of(squares: SceneSquares) -> Rows:
    """Return the squares of a scene with their rows; modal supports have none."""
    parts = [
        (part, power)
        for power, group in enumerate((squares.stiffness, squares.damping, squares.inertia))
        for part in group
        if part.row_source is not None or part.total is None
    ]
    counts, keys = Counter[tuple[str, int]](), []
    for part, power in parts:
        for number in part.numbers.ravel().tolist():
            key = f"{power} {part.kind}", number
            keys.append((*key, counts[key]))
            counts[key] += 1
    size = np.concatenate([part.size.ravel() for part, _ in parts])
    rows = np.concatenate([_over_all(part, squares.n, squares.number) for part, _ in parts])
    return Rows(size, rows, np.repeat([power for _, power in parts], [part.size.size for part, _ in parts]), keys)


def _over_all(part: SquareRows, n: int, number: Callable[[Any], Any]) -> Any:
    """The rows of a part (P R, n)."""
    P, R = part.size.shape
    array, rows = number(np.zeros((P, R, n))), part.rows
    pendula, within = np.arange(P)[:, None, None], np.arange(R)[:, None]
    if rows is None:
        array[pendula[..., 0], within[:, 0], part.at] = number(np.ones(1))[0]
        return array.reshape(-1, n)
    if part.moves is not None:
        array[:, :, part.columns] = rows[:, :, :1] * part.moves[:, None, :]
        rows = rows[:, :, 1:]
    array[pendula, within, part.at[:, None, :]] = rows
    return array.reshape(-1, n)


class Refined(NamedTuple):
    """The displacements z (N,) of `rows_of`, the shape (n,) and the momentum along the rail, to the last digit."""

    z: Complexes
    phi: Complexes
    momentum: complex


def refine(scene: Scene, value: complex, phi: Complexes, within: float) -> Refined:
    """Refine a simple mode in decimals.

    `value` is its eigenvalue, correct `within` this relative error, and `phi` its shape, in the scale of which both
    are. Raise ComputationError if there is no mode there.
    """
    if len(phi) > MOST_REFINED:
        raise ComputationError(f"more than {MOST_REFINED} coordinates: its digits are not refined")
    with localcontext(Context(prec=REFINED_DIGITS)):
        numbers = Digits(np.ones(1), REFINED_DIGITS, is_real=not scene.has_damping)
        matrices, rows, momentum = _in_digits(scene)
        eigenvalue, shape = _newton(numbers, [numbers.exact(S) for S in matrices], value, phi)
        if not abs(eigenvalue - value) <= within * abs(value):
            raise ComputationError("its digits are not found")
        names = () if numbers.is_real else ("real", "imag")
        parts = [np.array([getattr(entry, name) for entry in shape]) for name in names] or [shape]
        rests = [np.array([_rest(momentum, part)]) for part in parts]
        columns = [np.concatenate((rows @ p, p, rest)).astype(np.float64) for p, rest in zip(parts, rests, strict=True)]
    column = columns[0] + 1j * columns[-1] if len(columns) > 1 else columns[0].astype(np.complex128)
    return Refined(column[: len(rows)], column[len(rows) : -1], complex(column[-1]))


def _rest(row: Any, shape: Any) -> Decimal:
    """A row times a shape, 0 where half of the digits cancel."""
    terms = row * shape
    total: Decimal = terms.sum()
    return total if abs(total) > np.abs(terms).sum().scaleb(-REFINED_DIGITS // 2) else Decimal(0)


@lru_cache(maxsize=2)
def _in_digits(scene: Scene) -> tuple[tuple[Any, Any, Any], Any, Any]:
    """M, K and D, the rows of `rows_of` and the momentum along the rail, in decimals."""
    squares = scene_squares(rig_of(scene), Digits(np.ones(1), REFINED_DIGITS, is_real=True).number)
    return squares.matrices, rows_of(squares).rows, squares.momentum


def _newton(numbers: Digits, pencil: list[Any], value: complex, phi: Complexes) -> tuple[complex, Any]:
    """The eigenvalue, and its shape (n,) in digits, in the scale of φ."""
    M, K, D = pencil
    weight = np.array([abs(complex(entry)) for entry in M.diagonal()])
    largest = int((np.sqrt(weight) * np.abs(phi)).argmax())
    shape = _number(numbers, phi)
    rate = _number(numbers, np.array([(value / 1j) ** 2 if numbers.is_real else value]))[0]
    scale = shape[largest]
    for _ in range(NEWTON_ROUNDS):
        P, slope = (K - rate * M, -M) if numbers.is_real else (rate * rate * M + rate * D + K, (rate + rate) * M + D)
        load = slope @ shape
        shape = _solve(P, load, numbers)
        step = (shape @ load) / (shape @ (slope @ shape))
        rate, shape = rate - step, shape * (scale / shape[largest])
        if abs(complex(step)) <= 10.0 ** (-REFINED_DIGITS // 2) * abs(complex(rate)):
            break
    eigenvalue = 1j * np.sqrt(complex(rate)) if numbers.is_real else complex(rate)
    return complex(eigenvalue), shape


def _number(numbers: Digits, values: Complexes) -> Any:
    exact = numbers.number(values.real)
    return exact if numbers.is_real else exact + numbers.imaginary(numbers.number(values.imag))


def _solve(P: Any, right: Any, numbers: Digits) -> Any:
    """P⁻¹ times a column, by elimination with pivots of the largest in each column."""
    S, n = np.concatenate((P, right[:, None]), axis=1), len(P)
    smallest = numbers.exact(np.array([Decimal(1).scaleb(-4 * REFINED_DIGITS)]))[0]
    for k in range(n):
        sizes = np.abs(S[k:, k].astype(np.complex128))
        top = k + int(sizes.argmax())
        S[[k, top]] = S[[top, k]]
        if S[k, k] == 0:
            S[k, k] = smallest
        factors = S[k + 1 :, k] / S[k, k]
        S[k + 1 :, k + 1 :] = S[k + 1 :, k + 1 :] - factors[:, None] * S[k, k + 1 :]
    solution = S[:, n]
    for k in range(n - 1, -1, -1):
        solution[k] = solution[k] / S[k, k]
        solution[:k] = solution[:k] - S[:k, k] * solution[k]
    return solution


def slopes_by_squares(modes: Eigenvalues, number: int, phi: Complexes) -> dict[Place, float]:
    """∂ω/∂p of a simple mode of shape φ (n,) on a structure by every nonzero number that may change alone.

    Raise ComputationError if cancellation leaves few digits of a derivative.
    """
    if len(phi) > DENSE_COORDINATES_MAX:
        raise ComputationError(
            f"more than {DENSE_COORDINATES_MAX} coordinates: derivatives need dense rows of their squares"
        )
    value, (rows, changes) = complex(modes.eigenvalue[number]), square_changes(modes.scene)
    if not value:
        return dict.fromkeys(changes, 0.0)
    weight = (rows.size * (rows.power == 2)) @ rows.rows**2
    floor = np.where((phi == 0) & (weight > 0), 4 * len(phi) / np.sqrt(np.where(weight > 0, weight, 1.0)), 0.0)
    motion = _MovedShape(value, phi, rows.rows @ phi, EPS * (np.abs(rows.rows) @ (np.abs(phi) + floor)))
    derivatives, error = _slopes(modes, rows, changes, motion)
    if error > CANCELLED:
        z, phi, _ = refine(modes.scene, value, phi, 2 * float(modes.error[number]) + CANCELLED)
        derivatives, error = _slopes(modes, rows, changes, _MovedShape(value, phi, z, EPS * np.abs(z)))
        if not error <= UNSURE:
            raise ComputationError("its derivatives are beyond double precision")
    return derivatives


class _MovedShape(NamedTuple):
    """An eigenvalue, its shape (n,), and displacements z (N,) with their rounding."""

    value: complex
    phi: Complexes
    z: Complexes
    rounding: Floats


def _slopes(
    modes: Eigenvalues, rows: Rows, changes: dict[Place, _Change], motion: _MovedShape
) -> tuple[dict[Place, float], float]:
    """The derivatives by each number, and the largest error of p/ω ∂ω/∂p by rounding."""
    value, phi, z, rounding = motion
    pencil = np.sum(rows.power * value ** (rows.power - 1.0) * rows.size * z**2)
    M, _, D = modal_supports(modes.rig.support) if modes.rig.leading else (np.zeros((0, 0)),) * 3
    eta = phi[: len(M)]
    pencil += eta @ (2 * value * M + D) @ eta
    power, derivatives, worst = value**rows.power, dict[Place, float](), 0.0
    for place, change in changes.items():
        s, r = change.size_places, change.square
        turn, push = change.entry * phi[change.column], 2 * power[r] * rows.size[r]
        terms = np.concatenate((power[s] * change.size * z[s] ** 2, push * z[r] * turn))
        unsure = np.sum(np.abs(power[s] * change.size) * (2 * np.abs(z[s]) + rounding[s]) * rounding[s])
        unsure += np.sum(np.abs(push * turn) * rounding[r]) + EPS * np.sum(np.abs(terms))
        slope = -terms.sum() / pencil
        derivatives[place] = float((np.conj(value) * slope).real / abs(value))
        worst = max(worst, abs(number_at(modes.scene, place)) * float(unsure) / abs(pencil * value))
    return derivatives, worst


@lru_cache(maxsize=2)
def square_changes(scene: Scene) -> tuple[Rows, dict[Place, _Change]]:
    """Return the squares of a scene on a structure, and their changes with every nonzero number, by its place."""
    by_place, base = {}, rows_of(scene_squares(rig_of(scene)))

    def of(variation: Scene) -> Arrays:
        return rows_of(scene_squares(rig_of(variation))).in_order(base.keys)

    for place in _numbers(scene):
        try:
            size, rows = differences(scene, place, 1.0, of)
        except SceneError:
            continue
        number = abs(number_at(scene, place))
        size_places = np.flatnonzero(number * np.abs(size) > NOISE_OF_SUM * np.abs(base.size))
        square, column = np.nonzero(number * np.abs(rows) > NOISE_OF_SUM * np.abs(base.rows))
        if len(size_places) or len(square):
            by_place[place] = _Change(size_places, size[size_places], square, column, rows[square, column])
    return base, by_place


def _numbers(part: Any, at: Place = ()) -> Iterator[Place]:
    """The places of all numbers but 0 that M, K and D depend on."""
    if isinstance(part, Part):
        for name in part.fields:
            if name in LINEARIZED:
                yield from _numbers(getattr(part, name), (*at, name))
    elif isinstance(part, tuple):
        for index, item in enumerate(part):
            yield from _numbers(item, (*at, index))
    elif isinstance(part, float) and part:
        yield at


@lru_cache(maxsize=2)
def _momentum(scene: Scene) -> Floats:
    """That along the rail by the rate of every coordinate (n,)."""
    return np.asarray(scene_squares(rig_of(scene)).momentum)


def momentum_left(modes: Eigenvalues, number: int, phi: Complexes) -> float | None:
    """Return φᵀMe of a simple undamped mode on a structure if its terms cancel; None if floats suffice.

    e moves everything along the rail by 1; `phi` is the shape (n,).
    """
    value, row = complex(modes.eigenvalue[number]), _momentum(modes.scene)
    if not value or abs(row @ phi) > KEPT_SHARE_OF_MOMENTUM * (np.abs(row) @ np.abs(phi)):
        return None
    try:
        return refine(modes.scene, value, phi, 2 * float(modes.error[number]) + CANCELLED).momentum.real
    except ComputationError:
        return None
