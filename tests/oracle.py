"""A dense oracle that shares no line with the package: Cartesian kinematics in many-digit arithmetic.

M and K come from the horizontal and vertical positions of the centres of mass, frequencies are certified by the
inertia of K − x M (Sylvester), shapes by inverse iteration.  Coordinates: x (if there is a cart), then angles.
"""

from __future__ import annotations

from dataclasses import dataclass

import mpmath as mp

from modal.scene import Cart, Scene

BITS = 1200
Matrix = list[list[mp.mpf]]


@dataclass
class Dense:
    """M and K in many digits, and whether the first coordinate is a cart that nothing holds."""

    M: Matrix
    K: Matrix
    free: bool

    @property
    def size(self) -> int:
        return len(self.M)

    def below(self, x: mp.mpf) -> int:
        """Number of eigenvalues ω² < x, the zero of a free cart left out."""
        negative = sum(pivot < 0 for pivot in _pivots(_shifted(self, x)))
        return negative - self.free

    def shape(self, x: mp.mpf, steps: int = 3) -> tuple[mp.mpf, list[mp.mpf]]:
        """Eigenvalue and eigenvector next to x, by Rayleigh quotient iteration."""
        v = [mp.mpf(1) / (3 + i) for i in range(self.size)]
        for _ in range(2):
            v = _solved(self, x, v)
        for _ in range(steps):
            x = _quadratic(self.K, v) / _quadratic(self.M, v)
            v = _solved(self, x * (1 + mp.mpf(2) ** -(BITS // 2)), v)
        return x, v


def dense(scene: Scene) -> Dense:
    """The scene's matrices, every copy written out; for spatial scenes the plane of the rail."""
    mp.mp.prec = BITS
    cart = isinstance(scene.support, Cart)
    g = mp.mpf(scene.gravity)
    rows: list[tuple[mp.mpf, dict[int, mp.mpf]]] = []  # mass or inertia, and the velocity it moves with
    lift: dict[int, mp.mpf] = {}
    springs: list[tuple[mp.mpf, dict[int, mp.mpf]]] = []
    at = int(cart)
    unit = mp.mpf(1)
    base = {0: unit} if cart else {}
    if isinstance(scene.support, Cart):
        rows.append((mp.mpf(scene.support.mass), base))
        springs.append((mp.mpf(scene.support.stiffness), base))
    for pendulum in scene.pendulum:
        for _ in range(pendulum.count):
            pivot, upper = dict(base), None
            for link in (one for one in pendulum.links for _ in range(one.count)):
                m, l = mp.mpf(link.mass), mp.mpf(link.length)
                if link.kind == "bob":
                    c, I = l, mp.mpf(0)
                elif link.kind == "rod":
                    c, I = l / 2, m * l * l / 12
                else:
                    c, I = mp.mpf(link.centre), mp.mpf(link.inertia)
                rows += [(m, {**pivot, at: c}), (I, {at: unit})]
                for above, arm in pivot.items():
                    if above >= cart:
                        lift[above] = lift.get(above, mp.mpf(0)) + m * arm
                lift[at] = lift.get(at, mp.mpf(0)) + m * c
                springs.append((mp.mpf(link.stiffness), {at: unit} if upper is None else {at: unit, upper: -unit}))
                pivot[at], upper = l, at
                at += 1
    M, K = _zeros(at), _zeros(at)
    for weight, speed in rows:
        _add(M, weight, speed)
    for weight, turn in springs:
        _add(K, weight, turn)
    for i, moment in lift.items():
        K[i][i] += g * moment
    return Dense(M, K, cart and scene.support.stiffness == 0)


def _zeros(n: int) -> Matrix:
    return [[mp.mpf(0)] * n for _ in range(n)]


def _add(A: Matrix, weight: mp.mpf, v: dict[int, mp.mpf]) -> None:
    for i, a in v.items():
        for j, b in v.items():
            A[i][j] += weight * a * b


def _shifted(dense: Dense, x: mp.mpf) -> Matrix:
    return [[k - x * m for k, m in zip(*rows, strict=True)] for rows in zip(dense.K, dense.M, strict=True)]


def _pivots(A: Matrix) -> list[mp.mpf]:
    n = len(A)
    for k in range(n):
        for i in range(k + 1, n):
            factor = A[i][k] / A[k][k]
            for j in range(i, n):
                A[i][j] -= factor * A[k][j]
                A[j][i] = A[i][j]
    return [A[k][k] for k in range(n)]


def _solved(dense: Dense, x: mp.mpf, v: list[mp.mpf]) -> list[mp.mpf]:
    """(K − x M)⁻¹ M v, scaled to a largest entry of 1."""
    n = dense.size
    A = [[*row, mp.fdot(m, v)] for row, m in zip(_shifted(dense, x), dense.M, strict=True)]
    for k in range(n):
        for i in range(k + 1, n):
            factor = A[i][k] / A[k][k]
            for j in range(k + 1, n + 1):
                A[i][j] -= factor * A[k][j]
    found = [mp.mpf(0)] * n
    for i in reversed(range(n)):
        found[i] = (A[i][n] - mp.fdot(A[i][i + 1 : n], found[i + 1 :])) / A[i][i]
    largest = max(found, key=abs)
    return [value / largest for value in found]


def _quadratic(A: Matrix, v: list[mp.mpf]) -> mp.mpf:
    return mp.fdot(v, [mp.fdot(row, v) for row in A])
