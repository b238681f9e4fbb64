"""The complementarity problem of dry friction, which decides which contacts stick, in scalars.

Of J contacts with γ'' = a + Gτ, G symmetric and positive definite, those at rest obey |τ| ≤ M: γ'' = 0 inside the
limit, else γ'' is against τ.  The first contact that violates this changes its state until none does: finite for a
positive definite G ([Murty1974]; with bounds [Judice1994]).  On a rail with a coefficient μ the limit is μ|N|, N =
normal₀ + Σ normal_j τ_j: every state of the rail is tried with either sign e of N, τ₀ = −s μ e (normal₀ + Σ normal_j
τ_j)/(1 + s μ e normal_0), s being the side to which it slides, so that friction at the joints sees a + G₀ τ₀ as one
more response to its own torques.

Arguments are lists of floats, G row by row.  Run by Python, compiled by numba (`nonlinear.integration.changes`).
"""

from __future__ import annotations

from typing import Any

EXCESS = 1e-12
"""Tolerance: rounding of a torque relative to its limit, and of an acceleration relative to its parts."""
UNBOUNDED = 1e301
"""Format: a limit that nothing exceeds; infinity times 0 would be no number."""


def solve_definite(G: Any, b: Any, n: int) -> Any:
    """The solution (n,) of a symmetric positive definite system."""
    A, x = [*G], [*b]
    for k in range(n):
        for i in range(k + 1, n):
            share = A[i * n + k] / A[k * n + k]
            for j in range(k, n):
                A[i * n + j] -= share * A[k * n + j]
            x[i] -= share * x[k]
    for k in range(n - 1, -1, -1):
        for i in range(k + 1, n):
            x[k] -= A[k * n + i] * x[i]
        x[k] /= A[k * n + k]
    return x


def friction_of(a: Any, G: Any, limit: Any, sign: Any, n: int) -> Any:
    """The friction τ (n,) where contacts with a sign slide and all others stick."""
    tau = [-sign[i] * limit[i] if sign[i] != 0 else 0.0 for i in range(n)]
    stuck = [i for i in range(n) if sign[i] == 0]
    right = []
    for i in stuck:
        right.append(-a[i] - sum([G[i * n + k] * tau[k] for k in range(n)]))
    holding = solve_definite([G[i * n + k] for i in stuck for k in stuck], right, len(stuck))
    for k in range(len(stuck)):
        tau[stuck[k]] = holding[k]
    return tau


def consistent(a: Any, G: Any, limit: Any, sign: Any, n: int) -> Any:
    """The friction τ (n,) and the signs (n,) that contacts of sign 0 begin with; τ is empty if there are none."""
    rest, signs = [s == 0 for s in sign], [*sign]
    scale = []
    for i in range(n):
        free, limit_sum = a[i], 0.0
        for k in range(n):
            if not rest[k]:
                free -= G[i * n + k] * sign[k] * limit[k]
            elif limit[k] < UNBOUNDED:
                limit_sum += abs(G[i * n + k]) * limit[k]
        scale.append(abs(free) + limit_sum)
    for _ in range(64 * (1 + n) + 3 ** min(n, 12)):
        tau, wrong = friction_of(a, G, limit, signs, n), -1
        for i in range(n):
            if wrong < 0 and rest[i]:
                if signs[i] == 0:
                    if abs(tau[i]) > limit[i] * (1 + EXCESS):
                        wrong = i
                else:
                    acceleration = a[i] + sum([G[i * n + k] * tau[k] for k in range(n)])
                    if acceleration * signs[i] < -EXCESS * scale[i]:
                        wrong = i
        if wrong < 0:
            return tau, signs
        signs[wrong] = 0.0 if signs[wrong] != 0 else -1.0 if tau[wrong] > 0 else 1.0
    return [0.0] * 0, signs


def on_rail(a: Any, G: Any, limit: Any, sign: Any, normal: Any, J: int) -> Any:
    """The friction τ (J,), signs (J,) and e where contact 0 has the coefficient limit₀; τ is empty without any."""
    mu, n = limit[0], normal[1:]
    if sign[0] == 0:
        tau, signs = consistent(a, G, [UNBOUNDED, *limit[1:]], sign, J)
        N = normal[0] + sum([n[k] * tau[k] for k in range(len(tau))])
        if len(tau) > 0 and abs(tau[0]) <= mu * abs(N) * (1 + EXCESS):
            return tau, signs, 1.0 if N >= 0 else -1.0
    for s in [sign[0]] if sign[0] != 0 else [1.0, -1.0]:
        for e in [1.0, -1.0]:
            share = -s * e * mu / (1 + s * e * mu * n[0])
            rest, G1 = [a[i] + G[i * J] * share * normal[0] for i in range(1, J)], [0.0] * 0
            for i in range(1, J):
                for k in range(1, J):
                    G1.append(G[i * J + k] + G[i * J] * share * n[k])
            tau, signs = consistent(rest, G1, limit[1:], sign[1:], J - 1)
            if len(tau) < J - 1:
                continue
            rail = share * (normal[0] + sum([n[k + 1] * tau[k] for k in range(J - 1)]))
            frictions = [rail, *tau]
            N = normal[0] + sum([n[k] * frictions[k] for k in range(J)])
            starts = a[0] + sum([G[k] * frictions[k] for k in range(J)])
            if N * e >= 0 and (sign[0] != 0 or starts * s >= 0):
                return frictions, [s, *signs], e
    return [0.0] * 0, [*sign], 0.0
