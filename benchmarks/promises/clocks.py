"""What `sync` calls certain, and what it calls "As predicted", on random clocks, against a simulation of its own.

Two to four clocks with escapements hang from one cart, equal or unequal, some of them starting below the angle of
their escapement.  The oracle has its own equations of motion, its own integrator and its own kicks, runs at least
twice as long, and divides the energy among modes of its own.  Two promises are tried: a survivor without a doubt has
the claimed share of the energy at the end, and a run "as predicted" has it at the end of that run.  A third is tried
where the prediction is contradicted: a run that settles on a stable orbit stays there.  A fourth is that a run which
beats goes on between the same two shares.  How many sets are certain, contradicted, beating and doubted is counted.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from math import pi, sqrt

import numba
import numpy as np
from promise import Trial, Tried, attack
from scipy.linalg import eigh

from modal import Bob, Cart, Pendulum, Scene
from modal.errors import ComputationError
from modal.scene import Escapement, InitialCondition
from modal.types import Floats
from nonlinear.simulation import resume, simulate
from nonlinear.synchronization.certificates import orbit_at_the_end
from nonlinear.synchronization.modal_energy import find_survival
from nonlinear.synchronization.phases import phases_of
from nonlinear.synchronization.study import (
    SynchronizationStudy,
    Theory,
    joined,
    longest_duration,
    theory_of_scene,
    usual_duration,
)
from nonlinear.system import State

WITHIN = 0.06  # the largest difference of a share that is no other motion: that of `sync` with a margin for the oracle
PER_PERIOD = 256  # steps of the oracle
LONGEST = 10_000.0  # s
SHORTEST_PERIODS = 250  # of the slowest mode: the first run, which doubles until it decides


def clocks(seed: int) -> Scene:
    """Random clocks on a cart."""
    random = np.random.default_rng(seed)
    count = int(random.choice([2, 3, 4], p=[0.5, 0.3, 0.2]))
    mass, length = float(random.uniform(0.3, 1.6)), 0.25
    free = bool(random.random() < 0.6)
    cart = Cart(
        mass=float(random.uniform(3.0, 20.0)) * mass * count / 2,
        stiffness=0.0 if free else float(random.uniform(0.5, 5.0)),
        damping=float(random.choice([0.0, random.uniform(0.02, 0.5)])) if free else float(random.uniform(0.02, 0.3)),
    )
    unequal = 0.003 * float(random.choice([0.0, 1.0]))
    low = bool(random.random() < 0.4)
    pendula = []
    decay, wide = float(random.uniform(0.02, 0.05)), np.deg2rad(random.uniform(6.0, 9.0))
    for place in range(count):
        length_of = length * (1 + unequal * float(random.uniform(-1.0, 1.0)))
        damping = 2 * decay * mass * length**2 * (1 + 100 * unequal * float(random.uniform(-1.0, 1.0)))
        impulse = pi * damping * wide / 2 / sqrt(1 - (np.deg2rad(2.0) / wide) ** 2)
        below = low and place == 0
        angle = float(random.uniform(0.3, 1.9) if below else random.uniform(3.0, 10.0)) * float(random.choice([-1, 1]))
        drive = Escapement(impulse=float(impulse), angle_deg=2.0)
        link = Bob(mass=mass, length=length_of, damping=damping, drive=drive)
        pendula.append(Pendulum(links=[link], start=InitialCondition(angles_deg=(angle,))))
    return Scene(gravity=9.81, support=cart, pendulum=pendula)


@numba.njit(cache=False)
def _rates(y: Floats, numbers: Floats, cart: Floats, out: Floats) -> None:
    n = numbers.shape[1]
    mass, length, damping = numbers[0], numbers[1], numbers[2]
    total, push = cart[0], -cart[1] * y[0] - cart[2] * y[n + 1]
    for p in range(n):
        sine, cosine, speed = np.sin(y[1 + p]), np.cos(y[1 + p]), y[n + 2 + p]
        total += mass[p] * (1 - cosine**2)
        push += mass[p] * length[p] * speed**2 * sine
        push += cosine * (mass[p] * cart[3] * sine + damping[p] * speed / length[p])
    pull = push / total
    out[0], out[n + 1] = y[n + 1], pull
    for p in range(n):
        speed = y[n + 2 + p]
        out[1 + p] = speed
        bend = cart[3] * np.sin(y[1 + p]) + np.cos(y[1 + p]) * pull
        out[n + 2 + p] = -bend / length[p] - damping[p] * speed / (mass[p] * length[p] ** 2)


@numba.njit(cache=False)
def _stepped(y: Floats, h: float, numbers: Floats, cart: Floats) -> Floats:
    a, b, c, d = np.empty_like(y), np.empty_like(y), np.empty_like(y), np.empty_like(y)
    _rates(y, numbers, cart, a)
    _rates(y + h / 2 * a, numbers, cart, b)
    _rates(y + h / 2 * b, numbers, cart, c)
    _rates(y + h * c, numbers, cart, d)
    return y + h / 6 * (a + 2 * b + 2 * c + d)


@numba.njit(cache=False)
def _kick(y: Floats, p: int, impulse: float, numbers: Floats, cart: Floats) -> None:
    """The impulse on one clock, M Δv = J; its moment on the cart does not push it."""
    n = numbers.shape[1]
    mass, length = numbers[0], numbers[1]
    total = cart[0]
    for k in range(n):
        total += mass[k] * (1 - np.cos(y[1 + k]) ** 2)
    jump = -np.cos(y[1 + p]) * impulse / length[p] / total
    y[n + 1] += jump
    for k in range(n):
        y[n + 2 + k] -= np.cos(y[1 + k]) * jump / length[k]
    y[n + 2 + p] += impulse / (mass[p] * length[p] ** 2)


@numba.njit(cache=False)
def run(y: Floats, h: float, marks: Floats, numbers: Floats, cart: Floats) -> Floats:
    """The states at the `marks`: Runge and Kutta's method with steps of at most h, cut at the kicks by bisection."""
    n = numbers.shape[1]
    impulse, angle = numbers[3], numbers[4]
    side, now, states = np.zeros(n), 0.0, np.empty((len(marks), len(y)))
    for k in range(len(marks)):
        while now < marks[k]:
            step = min(h, marks[k] - now)
            if step < 1e-12:
                break
            after = _stepped(y, step, numbers, cart)
            who, way, first = -1, 0.0, step
            for p in range(n):
                for s in (1.0, -1.0):
                    if side[p] == -s or s * y[1 + p] >= angle[p] or s * after[1 + p] < angle[p]:
                        continue
                    low, high = 0.0, step
                    for _ in range(45):
                        middle = (low + high) / 2
                        if s * _stepped(y, middle, numbers, cart)[1 + p] < angle[p]:
                            low = middle
                        else:
                            high = middle
                    if who < 0 or high < first:
                        who, way, first = p, s, high
            if who < 0:
                y, now = after, now + step
                continue
            y = _stepped(y, first, numbers, cart)
            now += first
            _kick(y, who, way * impulse[who], numbers, cart)
            side[who] = -way
        states[k] = y
    return states


class Oracle:
    """Shares of the energy by frequency, from its own simulation."""

    def __init__(self, scene: Scene, start: State, ends: tuple[float, ...]) -> None:
        links = [pendulum.links[0] for pendulum in scene.pendulum]
        cart = scene.support
        self.numbers = np.array(
            [
                (link.mass, link.length, link.damping, link.drive.impulse, np.deg2rad(link.drive.angle_deg))
                for link in links
            ]
        ).T.copy()
        self.cart = np.array([cart.mass, cart.stiffness, cart.damping, scene.gravity])
        mass, length = self.numbers[:2]
        M = np.diag([cart.mass + mass.sum(), *mass * length**2])
        M[0, 1:] = M[1:, 0] = mass * length
        squares, self.shapes = eigh(np.diag([cart.stiffness, *mass * length * scene.gravity]), M)
        self.M, self.omega = M, np.sqrt(np.maximum(squares, 0.0))
        period = 2 * pi / self.omega[-1]
        windows = [np.linspace(end - 20 * period, end, 400) for end in ends]
        y = np.concatenate(([start.cart], start.links, [start.cart_rate], start.link_rates)).astype(float)
        rows = run(y, period / PER_PERIOD, np.concatenate(windows), self.numbers, self.cart)
        self.ends = dict(zip(ends, np.split(rows, len(ends)), strict=True))

    def share(self, end: float, omega: float) -> float:
        """The mean share of the modes of this frequency (rad/s) in the last swings before an end (s)."""
        rows = self.ends[end]
        half = rows.shape[1] // 2
        q, v = (part @ self.M @ self.shapes for part in (rows[:, :half], rows[:, half:]))
        energy = np.where(self.omega > 1e-3, v**2 + (self.omega * q) ** 2, 0.0).mean(axis=0)
        return float(energy[np.abs(self.omega - omega) < 1e-7 * omega].sum() / energy.sum())


def judged(scene: Scene, theory: Theory) -> SynchronizationStudy:
    """What `sync` says of a scene, of the shortest of some runs that decides, the last as long as its longest.

    Most sets are slow because a default run ends when the predicted motion has locked: the orbit next to the end of a
    shorter one has multipliers that show as much.
    """
    prediction = theory.prediction
    longest = longest_duration(theory, usual_duration(scene, theory))
    length = min(SHORTEST_PERIODS * 2 * pi / float(prediction.averaged.omega.min()), longest)
    trajectory = simulate(scene, length, start=prediction.start)
    while True:
        try:
            survival, unmeasured = find_survival(trajectory, prediction.averaged.modes), ""
        except ComputationError as error:
            survival, unmeasured = None, str(error)
        orbit = orbit_at_the_end(trajectory) if survival and theory.doubts else None
        study = SynchronizationStudy(scene, theory, "", trajectory, phases_of(trajectory), survival, unmeasured, orbit)
        has_ended = not study.doubts or (study.agrees is False and orbit) or (survival and survival.beat)
        if has_ended or length >= longest:
            return study
        more = min(length, longest - length)
        trajectory, length = joined(trajectory, resume(trajectory, more)), length + more


def trials(seed: int) -> Iterator[Trial]:
    """The promises that one set of clocks is given."""
    scene = clocks(seed)
    try:
        theory = theory_of_scene(scene)
        if theory.prediction.motion.dies:
            return
        study = judged(scene, theory)
    except ComputationError:
        return
    survival = study.survival
    if survival is None:
        return
    prediction, duration = theory.prediction, float(study.trajectory.times[-1])
    settled = max(2 * duration, min(2 * float(prediction.motion.times[-1]), LONGEST))
    oracle = Oracle(scene, prediction.start, (duration, settled))
    omega = float(prediction.averaged.modes[prediction.row].omega)
    about = f"{len(scene.pendulum)} clocks, mode {prediction.number}"
    if survival.beat:
        share = oracle.share(settled, float(survival.mode.omega))
        error = max(survival.beat.low - share, share - survival.beat.high, 0.0)
        yield Trial(f"beats, and says so: {about}", error, WITHIN)
    elif not study.doubts:
        yield Trial(f"certain: {about}", abs(oracle.share(settled, omega) - prediction.share), WITHIN)
    elif study.agrees is False and study.orbit:
        settled_omega = float(survival.mode.omega)
        error = abs(oracle.share(settled, settled_omega) - survival.survivor_share)
        yield Trial(f"contradicted, and settled elsewhere: {about}", error, WITHIN)
    else:
        yield Trial(f"doubted, {study.verdict}: {about}", 0.0, WITHIN)
    if study.agrees and not survival.beat:
        yield Trial(f"as predicted: {about}", abs(oracle.share(duration, omega) - prediction.share), WITHIN)


def claims(tried: Tried) -> str:
    """How many sets have which claim."""
    counts = Counter(trial.about.split(":")[0] for _, trial in tried if not trial.about.startswith("as predicted"))
    return f"sets: {', '.join(f'{number} {claim}' for claim, number in counts.most_common())}"


if __name__ == "__main__":
    attack(__doc__ or "", trials, cases=100, quick=1, summary=claims)
