"""Derivatives of modes by numbers of a scene, and the combinations of numbers that the data determine.

Identifiability is judged by the singular values of a Jacobian.  With J = U S Vᵀ, the derivatives of readings in units
of their noise, a step along the direction v_k changes the readings by s_k standard deviations, so 1/s_k is the
standard deviation of that combination [Bellman1970], [Ljung1999, §4.6].  A direction that is not determined is closed
by holding one of its parameters at the value that the scene gives.

Derivatives of M, K and D are difference quotients with large steps (`modal.assembly.linearization`).
With Q = λ²M + λD + K, Q_p = λ²M_p + λD_p + K_p and Q_λ = 2λM + D a simple
eigenvalue and its shape follow from

    [ Q    Q_λ φ ] [ φ_p ]     [ −Q_p φ ]
    [ φᴴ     0   ] [ λ_p ]  =  [   0    ]

[Andrew1993, §2], of which λ_p = −φᵀQ_pφ/φᵀQ_λφ.  An eigenvalue
shared by the shapes Φ keeps one derivative where ΦᵀQ_pΦ is a multiple of ΦᵀQ_λΦ, and splits where it is not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from modal.assembly import Arrays, matrices, shared_differences
from modal.identification.parameters import Parameter
from modal.modes import UNCERTAIN, Modes
from modal.report import Displayed, listed
from modal.scene import Scene, require
from modal.scene.parameters import Place
from modal.types import Complexes, Floats, Ints

DERIVATIVE_ROUNDING = 8 * np.sqrt(np.finfo(float).eps)
"""Tolerance: relative, of derivatives: shapes that are hardly different have half of the digits."""


def require_polynomial(scene: Scene) -> None:
    """Raise SceneError if M, K or D are no polynomials in the numbers of a scene."""
    require(scene, "a derivative of modes")


def matrix_derivatives(
    scene: Scene, shared: Sequence[Sequence[Place]], units: Sequence[float]
) -> tuple[Floats, Floats, Floats]:
    """M, K and D (p, n, n) differentiated by numbers, each at the places that share it."""
    require_polynomial(scene)

    def of(varied: Scene) -> Arrays:
        linear = matrices(varied)
        return linear.M, linear.K, linear.D

    parts = [shared_differences(scene, places, unit, of) for places, unit in zip(shared, units, strict=True)]
    M, K, D = (np.array(rows) for rows in zip(*parts, strict=True))
    return M, K, D


class ModeDerivatives:
    """Derivatives of the modes of a scene by p numbers, from those of its matrices, each (p, n, n)."""

    def __init__(self, modes: Modes, dM: Floats, dK: Floats, dD: Floats) -> None:
        self.modes, self.dM, self.dK, self.dD = modes, dM, dK, dD
        self.M, self.K, self.D = modes.matrices.M, modes.matrices.K, modes.matrices.D
        self.shapes = modes.matrix

    def eigenvalue(self, row: int) -> Complexes:
        """∂λ/∂p (p,) of the mode with index `row`; NaN if it splits, and where no digit of it is certain."""
        value = complex(self.modes.eigenvalue[row])
        if not self.modes.error[row] < UNCERTAIN:
            return np.full(len(self.dM), np.nan + 0j)
        if value == 0:
            return np.zeros(len(self.dM), dtype=np.complex128)
        slopes = []
        for across in (False, True):
            phi = self.shapes.shapes[:, (self.shapes.row == row) & (self.shapes.across == across)]
            if phi.shape[1]:
                slopes.append(self._of_group(value, phi.astype(np.complex128)))
        by_shape = np.concatenate(slopes, axis=1)
        first = by_shape[:, :1]
        size = np.maximum(np.abs(by_shape).max(axis=1, keepdims=True), 1e-12 * abs(value))
        splits = np.any(np.abs(by_shape - first) > DERIVATIVE_ROUNDING * size, axis=1)
        return np.asarray(np.where(splits, np.nan, first[:, 0]))

    def _of_group(self, value: complex, phi: Complexes) -> Complexes:
        """Derivatives (p, copies) by each of the shapes; NaN if they are coupled."""
        pencil = phi.T @ (2 * value * self.M + self.D) @ phi
        Q_p = value**2 * self.dM + value * self.dD + self.dK
        change = np.einsum("ia,pij,jb->pab", phi, Q_p, phi, optimize=True)
        slope = -np.linalg.solve(pencil, change)
        slopes = np.einsum("paa->pa", slope).copy()
        off = np.abs(slope - np.einsum("pa,ab->pab", slopes, np.eye(phi.shape[1]))).max(axis=(1, 2))
        slopes[off > DERIVATIVE_ROUNDING * np.abs(slope).max(axis=(1, 2))] = np.nan
        return np.asarray(slopes)

    def shape(self, row: int) -> tuple[Complexes, Complexes, Complexes]:
        """φ (n,), ∂φ/∂p (n, p) and ∂λ/∂p (p,) of a mode that is alone with its frequency; φᴴφ_p = 0."""
        value = complex(self.modes.eigenvalue[row])
        phi = self.shapes.shapes[:, self.shapes.row == row][:, 0].astype(np.complex128)
        n = len(phi)
        unit = np.sqrt(np.abs(np.diag(value**2 * self.M)) + np.abs(np.diag(self.K)))
        Q = value**2 * self.M + value * self.D + self.K
        border = (2 * value * self.M + self.D) @ phi
        right = -np.einsum("pij,j->ip", value**2 * self.dM + value * self.dD + self.dK, phi)
        bordered = np.zeros((n + 1, n + 1), dtype=np.complex128)
        bordered[:n, :n] = Q / unit[:, None] / unit
        size = np.linalg.norm(border / unit)
        bordered[:n, n] = border / unit / size
        bordered[n, :n] = phi.conj() / unit / np.linalg.norm(phi / unit)
        solution = np.linalg.solve(bordered, np.vstack((right / unit[:, None], np.zeros((1, right.shape[1])))))
        return phi, solution[:n] / unit[:, None], solution[n] / size


def polar(value: complex, slope: Complexes) -> tuple[Floats, Floats]:
    """∂ω/∂p and ∂ζ/∂p (p,) of ω = |λ| and ζ = −Re λ/|λ| from λ and ∂λ/∂p."""
    omega = abs(value)
    if omega == 0:
        return np.zeros(len(slope)), np.zeros(len(slope))
    rate = (np.conj(value) * slope).real / omega
    if value.imag == 0:
        return np.asarray(rate), np.zeros(len(slope))
    return np.asarray(rate), np.asarray(-slope.real / omega + value.real * rate / omega**2)


CHANGE_MIN = 0.02
"""Tolerance: of relative changes, which data with noise leave with some two digits: smaller ones are not named."""


def _all(words: Sequence[str]) -> str:
    return listed(words, len(words))


@dataclass(frozen=True, repr=False)
class Undetermined(Displayed):
    """A direction in which parameters change together without effect: `held` is the one fixed at its value.

    `changes` are the relative changes of numbers, by path, for a change of 1 of the fixed one.
    """

    what = "Numbers that change together without effect"
    shows = "changes: changes; held: held"

    held: str
    changes: dict[str, float]

    @property
    def words(self) -> str:
        """The direction in a sentence."""
        if not self.changes:
            return f"{self.held} has hardly any effect on these data"
        paths = [self.held, *self.changes]
        is_product = not any(map(_is_shift, paths))
        if is_product and all(abs(change - 1) < CHANGE_MIN for change in self.changes.values()):
            return f"only ratios of {_all(paths)} are determined: a common factor changes nothing"
        others = _all([f"{path} by {change:+.2g} %{_of_what(path)}" for path, change in self.changes.items()])
        return (
            f"{self.held} cannot be distinguished from others: changing it by 1 %{_of_what(self.held)} and {others} "
            "leaves the motion unchanged"
        )


def _is_shift(path: str) -> bool:
    return path.startswith("shift:")


def _of_what(path: str) -> str:
    """The quantity to which a change is relative, where that is not the number itself."""
    return " of the mean of the numbers that it shifts" if _is_shift(path) else ""


@dataclass(frozen=True, eq=False, repr=False)
class Determined(Displayed):
    """Which parameters `kept` (indices) are determined when the others, `held`, stay; and why, a direction each."""

    what = "What the data determine"
    shows = (
        "kept: numbers that they determine; held: numbers that stay; directions: undetermined directions; condition: "
        "condition number"
    )

    kept: Ints
    held: Ints
    directions: tuple[Undetermined, ...]
    condition: float


def find_determined(
    J: Floats, parameters: Sequence[Parameter], values: Floats, *, vague: float = 1.0, held: Sequence[int] = ()
) -> Determined:
    """From J (N, p), derivatives by z in units of the noise, of parameters at these z (p,).

    Nuisances have been projected out of J.  A standard deviation of z above `vague`, by default 100 % or a natural
    unit, is none; `held` stay in any case.
    """
    count = len(parameters)
    kept = np.setdiff1d(np.arange(count), np.array(held, dtype=np.int64))
    held_columns: list[int] = [*held]
    R: Floats = np.asarray(np.linalg.qr(J, mode="r")) if len(J) > count else J
    while len(kept):
        singular, V = _singular(R[:, kept])
        null = (singular <= DERIVATIVE_ROUNDING * singular[0]) | (singular < 1 / vague)
        if not null.any():
            break
        pivots = scipy.linalg.qr(V[null], mode="economic", pivoting=True)[2]
        worst = kept[np.sort(pivots[: int(null.sum())])]
        held_columns += worst.tolist()
        kept = np.setdiff1d(kept, worst)
    stay = np.array(sorted(held_columns), dtype=np.int64)
    singular = _singular(R[:, kept])[0] if len(kept) else np.ones(1)
    condition = float(singular[0] / singular[-1])
    return Determined(kept, stay, tuple(_directions(R, kept, stay, parameters, values)), condition)


def _singular(J: Floats) -> tuple[Floats, Floats]:
    """All singular values, also those that are zero for want of rows, and the right vectors."""
    padded_rows = np.vstack((J, np.zeros((max(0, J.shape[1] - len(J)), J.shape[1]))))
    _, singular, V = np.linalg.svd(padded_rows, full_matrices=False)
    return singular, V


def _directions(
    R: Floats, kept: Ints, held: Ints, parameters: Sequence[Parameter], values: Floats
) -> list[Undetermined]:
    """How the free ones compensate for a change of each fixed one, as far as they can."""
    directions = []
    answer = -np.linalg.lstsq(R[:, kept], R[:, held], rcond=None)[0] if len(kept) else np.zeros((0, len(held)))
    relative = [parameter.relative_slope(z) for parameter, z in zip(parameters, values, strict=True)]
    for k, number in enumerate(held):
        remainder = (
            np.linalg.norm(R[:, number] + R[:, kept] @ answer[:, k]) if len(kept) else np.linalg.norm(R[:, number])
        )
        size = np.linalg.norm(R[:, number])
        changes = {}
        if np.isfinite(relative[number]) and remainder < size / 2:
            raw = {
                int(j): answer[i, k] * relative[j] / relative[number]
                for i, j in enumerate(kept)
                if np.isfinite(relative[j])
            }
            largest = max([1.0, *map(abs, raw.values())])
            changes = {parameters[j].path: float(c) for j, c in raw.items() if abs(c) > CHANGE_MIN * largest}
        directions.append(Undetermined(parameters[number].path, changes))
    return directions


@dataclass(frozen=True)
class Combination:
    """A product of powers of numbers that is determined although they are not: its value and standard deviation."""

    words: str
    value: float
    std: float


def find_combinations(
    determined: Determined, parameters: Sequence[Parameter], values: Floats, stds: Floats
) -> tuple[Combination, ...]:
    """The combinations of free with fixed numbers; `stds` (p,) in the numbers' units, the fixed ones being exact.

    A shift is in none, since it is a term and no factor.
    """
    at = {parameter.path: k for k, parameter in enumerate(parameters)}
    numbers = [parameter.at(float(z)) for parameter, z in zip(parameters, values, strict=True)]
    powers: dict[str, dict[str, float]] = {}
    for direction in determined.directions:
        for path, change in direction.changes.items():
            powers.setdefault(path, {})[direction.held] = change
    combinations = []
    for path, exponents in powers.items():
        if any(map(_is_shift, [path, *exponents])):
            continue
        k = at[path]
        factor = float(np.prod([numbers[at[held]] ** -power for held, power in exponents.items()]))
        words = path
        for held, power in exponents.items():
            sign = " / " if power > 0 else " · "
            words += f"{sign}{held}" if abs(abs(power) - 1) < CHANGE_MIN else f"{sign}{held}^{abs(power):.3g}"
        combinations.append(Combination(words, numbers[k] * factor, float(stds[k]) * factor))
    return tuple(combinations)
