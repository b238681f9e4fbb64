"""Balanced truncation of a stable model, with gramians in closed form from its eigenvectors.

With A V = V diag λ the gramians A P + P Aᵀ = −B Bᵀ and AᵀQ + Q A = −CᵀC are

    P = V X Vᴴ,   X_ij = −(V⁻¹B)_i (V⁻¹B)_j^H/(λ_i + λ̄_j),      Q likewise with the left vectors,

and the Hankel singular values σ are the square roots of the eigenvalues of P Q.  Keeping the states of the largest K
gives max_ω ‖G − G_K‖ ≤ 2 Σ_{k>K} σ_k.  (Moore, IEEE Trans. Autom. Control 26, 17 (1981); square-root form: Tombs &
Postlethwaite, Int. J. Control 46, 1319 (1987); bound: Enns (1984), Glover, Int. J. Control 39, 1115 (1984).)
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from modal.errors import ComputationError
from modal.report import Displayed, Summary, brief, counted, first_line
from modal.statespace.model import StateSpace
from modal.statespace.signals import Signal
from modal.types import Complexes, Floats

UNDAMPED = 1e-11
"""Damping ratio below which an eigenvalue computed from A counts as undamped."""
CERTAIN = 1e-6
"""Largest relative residual of the Lyapunov equations for which the gramians are accepted."""
NEGLIGIBLE = 1e-8
"""Relative size below which Hankel singular values are uncertain, from square roots of rounded gramians."""


@dataclass(frozen=True, eq=False, repr=False)
class Balanced(Displayed):
    """A reduced model, all n Hankel singular values of the original in descending order, and the error bound.

    `error_bound` is twice the sum of those omitted: no largest singular value of G(iω) is off by more.
    """

    model: StateSpace
    hankel: Floats
    error_bound: float

    def _summary(self) -> Summary:
        title = f"Balanced model of {len(self.model.A)} of {counted(len(self.hankel), 'state', 'states')}"
        return Summary(title, [("error bound", brief(self.error_bound)), ("model", first_line(self.model))])


def balance(model: StateSpace, count: int) -> Balanced:
    """The model reduced to `count` states, with the same inputs and outputs.

    Its states are combinations of all old ones, and the choice depends on the units of inputs and outputs.  Raises
    ValueError for a count outside 1 … n; ComputationError for a model in discrete time, for one that is not stable and
    damped in every mode, for which gramians do not exist, and for a count beyond the controllable and observable
    states.
    """
    if not 1 <= count <= len(model.A):
        raise ValueError(f"count = {count}: must be between 1 and the {len(model.A)} states of the model")
    if model.dt:
        raise ComputationError("balanced reduction needs a continuous model")
    values, V = np.linalg.eig(model.A)
    _require_damping(values)
    reach, sight = (
        _root(_gramian(model.A, values, V, model.B)),
        _root(_gramian(model.A.T, *_duals(values, V), model.C.T)),
    )
    U, hankel, Wt = np.linalg.svd(sight.T @ reach)
    kept = int(np.count_nonzero(hankel > NEGLIGIBLE * hankel[0]))
    if count > kept:
        raise ComputationError(
            f"only {kept} states are controllable and observable: choose at most as many, or make it minimal first"
        )
    scale = 1 / np.sqrt(hankel[:count])
    right, left = reach @ Wt[:count].T * scale, (sight @ U[:, :count] * scale).T
    states = tuple(
        Signal(f"balanced_{k}", "", f"state of Hankel singular value {hankel[k - 1]:.3g}") for k in range(1, count + 1)
    )
    reduced = replace(model, scene=None, A=left @ model.A @ right, B=left @ model.B, C=model.C @ right, states=states)
    return Balanced(reduced, hankel, float(2 * hankel[count:].sum()))


def _require_damping(values: Complexes) -> None:
    upper = values[values.imag >= 0]
    upper = upper[np.argsort(np.abs(upper), kind="stable")]
    rounding = UNDAMPED * np.abs(values).max()
    for value in upper.tolist():
        if value.real < -max(rounding, UNDAMPED * abs(value)):
            continue
        what = (
            "is a rigid translation"
            if abs(value) <= 1e4 * rounding
            else "grows"
            if value.real > rounding
            else "has ζ = 0"
        )
        raise ComputationError(
            f"balanced reduction needs a stable, damped model: a mode {what} (λ = {value:.3g} 1/s); modal truncation "
            "does without, and where no input reaches this mode or no output sees it, make the model minimal first"
        )


def _duals(values: Complexes, V: Complexes) -> tuple[Complexes, Complexes]:
    """Eigenvalues and eigenvectors of Aᵀ."""
    return values, np.asarray(np.linalg.inv(V).T, dtype=np.complex128)


def _gramian(A: Floats, values: Complexes, V: Complexes, B: Floats) -> Floats:
    """X of A X + X Aᵀ + B Bᵀ = 0."""
    b = np.linalg.solve(V, B.astype(np.complex128))
    X: Floats = (V @ (-(b @ b.conj().T) / (values[:, None] + values.conj())) @ V.conj().T).real
    push = B @ B.T
    if np.linalg.norm(A @ X + X @ A.T + push) > CERTAIN * (np.linalg.norm(push) + 2 * np.linalg.norm(A @ X)):
        raise ComputationError("two modes of this model are equal to double precision: its gramians are uncertain")
    return (X + X.T) / 2


def _root(X: Floats) -> Floats:
    """L with L Lᵀ = X, omitting eigenvalues made negative by rounding."""
    values, vectors = np.linalg.eigh(X)
    root: Floats = vectors * np.sqrt(np.clip(values, 0.0, None))
    return root
