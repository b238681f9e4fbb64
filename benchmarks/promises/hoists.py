"""Hoists: frequencies, swing, the model in time and what travels and shapers leave, against Newton's equations.

The oracle knows no matrices of the packages.  Each bob k hangs on ropes with the directions u_j and their normals n_j,
r_k = r_0 + Σ_{j≤k} l_j(t) u_j; d'Alembert's principle, Σ_{k≥i} (m_k r_k'' − m_k g − F_k)·l_i n_i = torques at joints,
with the drag F = −(d + d₂ |v|) v of the whole velocity v, is integrated at any angle in complex numbers.  Its motion
for a command of the size iε has the linear response as its imaginary part, exact to rounding.

    python benchmarks/promises/hoists.py [--quick] [--cases N] [--seed N]
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from promise import Trial, attack
from scipy.integrate import solve_ivp
from scipy.linalg import eigh, expm

from modal import Bob, Cart, Pendulum, Scene
from modal.scene import Hoist
from modal.statespace import shaper_for
from modal.statespace.hoisting import Travel, frequencies_along, shaper_residual, travel_residuals
from modal.statespace.sampling import varying_model

TINY = 1e-30
PROMISED = 1e-7
"""Of the largest swing of its kind, for what is integrated; matrices and frequencies keep EXACT of a row."""
EXACT = 1e-9
OUTPUTS = ("cart_position", "angles", "rates", "joint_positions", "tip_accelerations", "pivot_forces")


@dataclass(frozen=True)
class Rope:
    """One link: a bob's mass, drag, quadratic drag and damper, and the length as a function of time."""

    mass: float
    drag: float
    quadratic: float
    damping: float
    stiffness: float
    first: float
    last: float
    begin: float
    duration: float
    ramp: float

    def __call__(self, time: float) -> tuple[float, float, float]:
        """Length, speed, acceleration; the smooth law where `ramp` is 0."""
        change, s = self.last - self.first, (time - self.begin) / self.duration
        if s < 0 or s >= 1 or not change:
            return (self.last if s >= 1 else self.first), 0.0, 0.0
        if not self.ramp:
            place, rate = 10 * s**3 - 15 * s**4 + 6 * s**5, 30 * s**2 * (1 - s) ** 2
            bend = 60 * s * (1 - s) * (1 - 2 * s)
        else:
            r, top = self.ramp, 1 / (1 - self.ramp)
            if s < r:
                place, rate, bend = top * s**2 / (2 * r), top * s / r, top / r
            elif s < 1 - r:
                place, rate, bend = top * (s - r / 2), top, 0.0
            else:
                place, rate, bend = 1 - top * (1 - s) ** 2 / (2 * r), top * (1 - s) / r, -top / r
        return self.first + change * place, change * rate / self.duration, change * bend / self.duration**2

    @property
    def breaks(self) -> list[float]:
        """Times at which a derivative jumps."""
        inside = [self.ramp, 1 - self.ramp] if self.ramp else []
        return [self.begin + s * self.duration for s in (0.0, *inside, 1.0)] if self.first != self.last else []


Chains = list[list[Rope]]


@dataclass(frozen=True)
class Oracle:
    """Chains of bobs on one cart: mass, damper and spring of the cart, and gravity."""

    chains: Chains
    cart: float
    damping: float
    stiffness: float
    gravity: float

    def second(self, time: float, q: Any, rate: Any, drive: Any, held: bool) -> tuple[Any, Any, Any]:
        """Second derivatives of q = (x, θ …), the accelerations of all ends, and the horizontal forces on all pivots.

        `drive` is the acceleration of the cart if it is held, else the force on it.
        """
        size = len(q)
        M, right = np.zeros((size, size), complex), np.zeros(size, complex)
        parts, at = [], 1
        for chain in self.chains:
            jacobian, bias, v = np.zeros((2, size), complex), np.zeros(2, complex), np.array([rate[0], 0], complex)
            jacobian[0, 0] = 1.0
            for i, rope in enumerate(chain):
                k = at + i
                l, speed, bend = rope(time)
                u, n = np.array([np.sin(q[k]), np.cos(q[k])]), np.array([np.cos(q[k]), -np.sin(q[k])])
                jacobian = jacobian.copy()
                jacobian[:, k] = l * n
                bias = bias + 2 * speed * rate[k] * n + (bend - l * rate[k] ** 2) * u
                v = v + speed * u + l * rate[k] * n
                force = -(rope.drag + rope.quadratic * np.sqrt(v @ v)) * v
                weight = np.array([0, rope.mass * self.gravity])
                M += rope.mass * jacobian.T @ jacobian
                right += jacobian.T @ (force + weight - rope.mass * bias)
                parts.append((jacobian, bias, rope.mass, force))
                before = (q[k - 1], rate[k - 1]) if i else (0.0, 0.0)
                torque = -rope.damping * (rate[k] - before[1]) - rope.stiffness * (q[k] - before[0])
                right[k] += torque
                if i:
                    right[k - 1] -= torque
            at += len(chain)
        M[0, 0] += self.cart
        right[0] += -self.damping * rate[0] - self.stiffness * q[0]
        if held:
            second = np.concatenate(([drive], np.linalg.solve(M[1:, 1:], right[1:] - M[1:, 0] * drive)))
        else:
            right[0] += drive
            second = np.linalg.solve(M, right)
        tips, pushes, index = [], [], 0
        for chain in self.chains:
            push = 0.0
            for _ in chain:
                jacobian, bias, mass, force = parts[index]
                acceleration = jacobian @ second + bias
                push += force[0] - mass * acceleration[0]
                index += 1
            tips.append(acceleration[0])
            pushes.append(push)
        return second, np.array(tips), np.array(pushes)

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return 1 + sum(map(len, self.chains))

    @property
    def breaks(self) -> list[float]:
        """Of all ropes."""
        return [time for chain in self.chains for rope in chain for time in rope.breaks]

    def changes(self, time: float) -> bool:
        """Whether a rope moves at this time."""
        return any(any(rope(time)[1:]) for chain in self.chains for rope in chain)

    def slopes(self, time: float, held: bool) -> Any:
        """The matrix of (q, q') at rest and without a drive."""
        n, steps = self.size, 1j * TINY * np.eye(2 * self.size)
        second = [self.second(time, step[:n], step[n:], 0.0, held)[0].imag / TINY for step in steps]
        return np.vstack((np.eye(n, 2 * n, n), np.array(second).T))

    def moved(self, y: Any, stops: list[float], drive: Callable[[float], float], held: bool) -> Any:
        """The linear response (q, q') at the last stop to a drive, from (q, q') at the first."""
        cuts, n = sorted(set(stops)), self.size
        z = 1j * TINY * np.asarray(y)
        scale = TINY * max(1e-3, float(np.abs(y).max()))
        for begin, end in pairwise(cuts):
            inside = begin + 1e-14 * (end - begin), np.nextafter(end, begin)
            looks = np.linspace(begin, end, 5)[1:-1].tolist()
            if not any(drive(time) for time in looks) and not self.changes(looks[0]):
                z = expm(self.slopes(looks[0], held) * (end - begin)) @ z
                continue

            def slope(time: float, z: Any, inside: Any = inside) -> Any:
                now = min(max(time, inside[0]), inside[1])
                second = self.second(now, z[:n], z[n:], 1j * TINY * drive(now), held)[0]
                return np.concatenate((z[n:], 1j * second.imag))

            solution = solve_ivp(slope, (begin, end), z, "DOP853", rtol=1e-11, atol=1e-13 * scale)
            z = solution.y[:, -1]
        return z.imag / TINY

    def modes(self, time: float, held: bool) -> tuple[Any, Any, Any]:
        """ω, Φ over (x, θ …) with φᵀMφ = 1 and M of the lengths of a time at rest, x omitted where it is held."""
        n, at, first = self.size, 1, int(held)
        M, K = np.zeros((n, n)), np.zeros((n, n))
        for chain in self.chains:
            row = np.eye(1, n)[0]
            for i, rope in enumerate(chain):
                row = row.copy()
                row[at + i] = rope(time)[0]
                M += rope.mass * np.outer(row, row)
                K[np.diag_indices(n)] += rope.mass * self.gravity * np.where(np.arange(n) > 0, row, 0)
                turned = np.eye(n)[at + i] - (np.eye(n)[at + i - 1] if i else 0)
                K += rope.stiffness * np.outer(turned, turned)
            at += len(chain)
        M[0, 0] += self.cart
        K[0, 0] += self.stiffness
        square, phi = eigh(K[first:, first:], M[first:, first:])
        swinging = square > 1e-9 * square.max()
        return np.sqrt(square[swinging]), phi[:, swinging], M[first:, first:]

    def left(self, time: float, y: Any, held: bool) -> float:
        """The largest angle that free swings without dampers add up to."""
        omega, phi, M = self.modes(time, held)
        first, n = int(held), self.size
        q, rate = y[first:n].copy(), y[n + first :]
        if held and y[n]:
            q -= self.settled(time + 1.0, y[n])  # when all ropes are at rest, whatever the rounding
        z = phi.T @ M @ q + 1j * (phi.T @ M @ rate) / omega
        each = (phi * z)[1 - first :]
        groups = np.cumsum(np.diff(omega, prepend=omega[0]) > 1e-9 * omega)
        return float(sum(np.abs(each[:, groups == group].sum(1)) for group in set(groups.tolist())).max())

    def settled(self, time: float, speed: float) -> Any:
        """The angles at which the chains hang still next to a cart of this speed."""
        n = self.size
        zero = np.zeros(n, complex)
        pushed = zero.copy()
        pushed[0] = 1j * TINY * speed
        columns = [self.second(time, 1j * TINY * e, zero, 0.0, True)[0].imag / TINY for e in np.eye(n)[1:]]
        push = self.second(time, zero, pushed, 0.0, True)[0].imag / TINY
        return -np.linalg.solve(np.array(columns).T[1:], push[1:])


def draw(seed: int) -> tuple[Scene, Oracle, Travel]:
    """A random scene, the same for the oracle, and a travel."""
    rng = np.random.default_rng([2031, seed])
    chains, pendula = [], []
    gravity = float(rng.choice([9.81, 1.62, 9.80665]))
    dragging, resting = rng.random() < 0.7, rng.random() < 0.3
    for p in range(rng.integers(1, 3)):
        size = int(rng.integers(1, 4))
        ropes, links = [], []
        some = rng.choice(size, rng.integers(1, size + 1), replace=False).tolist()
        hoisted = set(some if p == 0 or rng.random() < 0.5 else [])
        for i in range(size):
            first = float(rng.uniform(0.5, 8.0))
            moves = i in hoisted
            rope = Rope(
                mass=float(10 ** rng.uniform(-1, 2)),
                drag=float(10 ** rng.uniform(-2, 0.5)) * dragging * (rng.random() < 0.7),
                quadratic=float(10 ** rng.uniform(-2, 0.5)) * dragging * (rng.random() < 0.3),
                damping=float(10 ** rng.uniform(-2, 0.5)) * (rng.random() < 0.4),
                stiffness=float(10 ** rng.uniform(-1, 1)) * (rng.random() < 0.2),
                first=first,
                last=float(first * rng.uniform(0.4, 1.8)) if moves else first,
                begin=float(rng.choice([0.0, rng.uniform(0, 5), rng.uniform(20, 200)])) if moves else 0.0,
                duration=float(rng.uniform(1.0, 8.0)) if moves else 1.0,
                ramp=float(rng.choice([0.0, rng.uniform(0.05, 0.5)])) if moves else 0.0,
            )
            ropes.append(rope)
            shape: dict[str, Any] = {"profile": "trapezoidal", "ramp": rope.ramp} if rope.ramp else {}
            hoist = Hoist(to=rope.last, begin=rope.begin, duration=rope.duration, **shape) if moves else None
            links.append(
                Bob(
                    mass=rope.mass, length=first, drag=rope.drag, quadratic_drag=rope.quadratic, damping=rope.damping,
                    stiffness=rope.stiffness, hoist=hoist,
                )
            )  # fmt: skip
        count = int(rng.choice([1, 1, 2]))
        chains += [ropes] * count
        pendula.append(Pendulum(links=tuple(links), count=count))
    cart = Cart(
        mass=float(10 ** rng.uniform(0, 3)),
        damping=0.0 if resting else float(10 ** rng.uniform(-1, 1)) * (rng.random() < 0.4),
        stiffness=float(10 ** rng.uniform(0, 2)) * (rng.random() < 0.2),
    )
    oracle = Oracle(chains, cart.mass, cart.damping, cart.stiffness, gravity)
    travel = Travel(float(10 ** rng.uniform(-1, 1)), min(oracle.breaks), float(rng.uniform(2.0, 8.0)))
    return Scene(gravity=gravity, support=cart, pendulum=tuple(pendula)), oracle, travel


def pulse(travel: Travel, time: float) -> float:
    """The acceleration of a travel by the second derivative of its polynomial."""
    place = np.polynomial.Polynomial([0, 0, 0, 10, -15, 6]) * travel.distance
    s = (time - travel.begin) / travel.duration
    return float(place.deriv(2)(s)) / travel.duration**2 if 0 <= s <= 1 else 0.0


def still(scene: Scene, lengths: Callable[[Any], float]) -> Scene:
    """The scene with constant lengths."""
    pendula = [
        pendulum.replace(links=tuple(link.replace(length=lengths(link), hoist=None) for link in pendulum.links))
        for pendulum in scene.pendulum
    ]
    return scene.replace(pendulum=tuple(pendula))


def travelling(scene: Scene, oracle: Oracle, travel: Travel) -> Iterator[Trial]:
    """What travels leave, shaped and not, with and without the hoist."""
    mean = still(scene, lambda link: (link.length + link.hoist.to) / 2 if link.hoist else link.length)
    before = still(scene, lambda link: link.length)
    constant = replace(oracle, chains=[[replace(rope, last=rope.first) for rope in chain] for chain in oracle.chains])
    commands: list[tuple[Oracle, Any]] = [(oracle, [(0.0, 1.0)])]
    for constant_lengths in (before, mean):
        train = shaper_for(constant_lengths)
        commands.append((oracle, list(zip(train.times.tolist(), train.amplitudes.tolist(), strict=True))))
    commands.append((constant, [(0.0, 1.0)]))
    true = []
    for oracle_of, parts in commands:
        stops = [travel.begin + at + after for at, _ in parts for after in (0.0, travel.duration)]
        stops += [time for time in oracle_of.breaks if time >= travel.begin]

        def drive(time: float, parts: Any = parts) -> float:
            return sum(share * pulse(travel, time - at) for at, share in parts)

        y = oracle_of.moved(np.zeros(2 * oracle_of.size), stops, drive, held=True)
        true.append(oracle_of.left(max(stops), y, held=True))
    assert Travel.along(scene, 1.0).begin == travel.begin
    for residual, angle in zip(travel_residuals(scene, travel), true, strict=True):
        yield Trial(f"swing left, {residual.words}", abs(residual.angle - angle), PROMISED * max(true))


def shaping(scene: Scene, oracle: Oracle, drive: Any) -> Iterator[Trial]:
    """What a shaper for the lengths before the hoist leaves of the swing of one impulse."""
    held = drive == "cart_acceleration"
    train, begin = shaper_for(still(scene, lambda link: link.length), 1, "zv", drive), min(oracle.breaks)
    last, size = max(*oracle.breaks, begin + train.duration), []
    for parts in (zip(train.times.tolist(), train.amplitudes.tolist(), strict=True), [(0.0, 1.0)]):
        y, now = np.zeros(2 * oracle.size), begin
        rest = np.zeros(oracle.size, complex)
        for at, share in parts:
            if begin + at > now:
                y = oracle.moved(y, [now, begin + at, *_between(oracle, now, begin + at)], lambda _: 0.0, held)
                now = begin + at
            y[oracle.size :] += share * oracle.second(now, rest, rest, 1j * TINY, held)[0].imag / TINY
        if last > now:
            y = oracle.moved(y, [now, last, *_between(oracle, now, last)], lambda _: 0.0, held)
        size.append(oracle.left(last, y, held))
    error = abs(shaper_residual(scene, train, drive) - size[0] / size[1])
    yield Trial(f"share left by a shaper, {drive}", error, PROMISED * max(1.0, size[0] / size[1]))


def _between(oracle: Oracle, first: float, last: float) -> list[float]:
    return [time for time in oracle.breaks if first < time < last]


def tables(scene: Scene, oracle: Oracle, drive: Any) -> Iterator[Trial]:
    """Frequencies and adiabatic swing at the begin, within and at the end of the hoist."""
    held = drive == "cart_acceleration"
    along = frequencies_along(scene, 4, drive)
    yield Trial("first time of the table", abs(along.times[0] - min(oracle.breaks)), 0.0)
    yield Trial("last time of the table", abs(along.times[-1] - max(oracle.breaks)), 1e-12 * max(oracle.breaks))
    for time, omega in zip(along.times.tolist(), along.omega, strict=True):
        exact = oracle.modes(time, held)[0]
        yield Trial(f"frequencies, {drive}", float(np.abs(np.sort(omega) / exact - 1).max()), EXACT)
    # each pendulum alone on a fixed support, and one alone on a cart, keeps the order of its modes
    if held or len(oracle.chains) == 1:
        exact = [_swing(replace(oracle, chains=[chain]), along.times, held) for chain in oracle.chains]
        first, swing = (np.hstack(part) for part in zip(*exact, strict=True))
        order = np.argsort(first, kind="stable")
        yield Trial(f"swing, {drive}", float(np.abs(along.swing / swing[:, order] - 1).max()), 1e-8)


def _swing(oracle: Oracle, times: Any, held: bool) -> tuple[Any, Any]:
    """ω at the first time, and of every mode the largest angle over that at the first time, E/ω being conserved."""
    each = [oracle.modes(time, held) for time in times.tolist()]
    size = np.array([np.abs(phi[1 - int(held) :]).max(0) / np.sqrt(omega) for omega, phi, _ in each])
    return each[0][0], size / size[0]


def model(scene: Scene, oracle: Oracle, drive: str, rng: np.random.Generator) -> Iterator[Trial]:
    """A, B, C and D at random times within the hoist: column by column the slope of Newton's equations."""
    held, n = drive == "cart_acceleration", oracle.size
    times = np.sort(rng.uniform(min(oracle.breaks), max(oracle.breaks), 3))
    varying = varying_model(scene, times, (drive,), OUTPUTS)
    for at, time in enumerate(times.tolist()):
        exact = []
        for column in np.eye(2 * n + 1):
            z = 1j * TINY * column
            second, tips, pushes = oracle.second(time, z[:n], z[n:-1], z[-1], held)
            lengths = [[rope(time)[0] for rope in chain] for chain in oracle.chains]
            joints, k = [], 1
            for chain_lengths in lengths:
                joints.append(z[0] + np.cumsum(np.array(chain_lengths) * z[k : k + len(chain_lengths)]))
                k += len(chain_lengths)
            exact.append(
                np.concatenate((z[n:-1], second, z[:1], z[1:n], z[n + 1 : -1], *joints, tips, pushes)).imag / TINY
            )
        whole = np.array(exact).T
        C, D = (part[at] if part.ndim == 3 else part for part in (varying.C, varying.D))
        printed = np.vstack((np.hstack((varying.A[at], varying.B[at])), np.hstack((C, D))))
        size = np.abs(whole).max(1, keepdims=True)
        # states in metres, radians and per second differ in size: by row
        error = float((np.abs(printed - whole) / np.where(size, size, 1)).max())
        yield Trial(f"model in time, {drive}", error, EXACT)


def trials(seed: int) -> Iterator[Trial]:
    """All numbers of one random hoist."""
    scene, oracle, travel = draw(seed)
    yield from travelling(scene, oracle, travel)
    for drive in ("cart_acceleration", "cart_force"):
        yield from shaping(scene, oracle, drive)
        yield from tables(scene, oracle, drive)
        yield from model(scene, oracle, drive, np.random.default_rng(seed))


if __name__ == "__main__":
    attack(__doc__, trials, cases=100, quick=2)
