"""A dense oracle that shares no line with the package: Cartesian kinematics in many-digit arithmetic.

M and K come from the horizontal and vertical positions of the centres of mass, frequencies are certified by the
inertia of K − x M (Sylvester), shapes by inverse iteration.  Coordinates: x (if there is a cart), then angles.
Eliminations are done in balls (python-flint), so that the sign of a pivot is proved or the count refused.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import mpmath as mp
from flint import arb, arb_mat, ctx

from modal.scene import Cart, Scene

BITS = 1200
Matrix = list[list[mp.mpf]]
Balls = list[list[arb]]


@dataclass
class Dense:
    """M and K in many digits, and whether the first coordinate is a cart that nothing holds."""

    M: Matrix
    K: Matrix
    free: bool

    @property
    def size(self) -> int:
        return len(self.M)

    @cached_property
    def balls(self) -> tuple[Balls, Balls]:
        """K and M as balls, from the last coordinate to the first: a cart that joins all pendula comes last."""
        with ctx.workprec(BITS):
            K, M = ([[arb(value) for value in reversed(row)] for row in reversed(A)] for A in (self.K, self.M))
        return K, M

    def below(self, x: mp.mpf) -> int:
        """Number of eigenvalues ω² < x, the zero of a free cart omitted."""
        with ctx.workprec(BITS):
            pivots = _pivots(_shifted(*self.balls, arb(x)))
        if not all(pivot < 0 or pivot > 0 for pivot in pivots):
            raise ArithmeticError(f"{BITS} bits do not tell the sign of every pivot at {x}")
        return sum(pivot < 0 for pivot in pivots) - self.free

    def shape(self, x: mp.mpf, steps: int = 3) -> tuple[mp.mpf, list[mp.mpf]]:
        """Eigenvalue and eigenvector next to x, by Rayleigh quotient iteration."""
        with ctx.workprec(BITS):
            K, M = self.balls
            stiffness, mass, square = arb_mat(K), arb_mat(M), arb(x)
            v = arb_mat([[arb(1) / (3 + i)] for i in reversed(range(self.size))])
            tiny = arb(2) ** -(BITS // 2)
            for step in range(2 + steps):
                if step >= 2:
                    square = _middle(_quadratic(stiffness, v) / _quadratic(mass, v))
                near = square * (1 + tiny) if step >= 2 else square
                solved = arb_mat(_shifted(K, M, near)).solve(mass * v).entries()
                largest = max((_middle(value) for value in solved), key=abs)
                v = arb_mat([[_middle(value / largest)] for value in solved])
        return mp.mpf(square), [mp.mpf(value) for value in reversed(v.entries())]


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
            for link in (part for part in pendulum.links for _ in range(part.count)):
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
                bend = {at: unit} if upper is None else {at: unit, upper: -unit}
                rows.append((mp.mpf(link.rotor_inertia) * mp.mpf(link.gear_ratio) ** 2, bend))
                springs.append((mp.mpf(link.stiffness), bend))
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


def _shifted(K: Balls, M: Balls, x: arb) -> Balls:
    return [[k - x * m for k, m in zip(*rows, strict=True)] for rows in zip(K, M, strict=True)]


def _pivots(A: Balls) -> list[arb]:
    """Of a symmetric matrix, by its upper half; what is exactly zero stays so."""
    n = len(A)
    for k, row in enumerate(A):
        filled = [j for j in range(k + 1, n) if not row[j].is_zero()]
        for at, i in enumerate(filled):
            factor, below = row[i] / row[k], A[i]
            for j in filled[at:]:
                below[j] -= factor * row[j]
    return [A[k][k] for k in range(n)]


def _middle(value: arb) -> arb:
    return value.mid()


def _quadratic(A: arb_mat, v: arb_mat) -> arb:
    return (v.transpose() * A * v)[0, 0]
