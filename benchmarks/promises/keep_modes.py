"""Several pendula restricted to their lowest modes: no angle is off by more than was said.

    OPENBLAS_NUM_THREADS=1 python benchmarks/promises/keep_modes.py [--quick] [--cases 200] [--seed 0]

Two to eight pendula of one to four bobs, rods or bodies, some of them twice or three times and some nearly so, every
fifth case with one of 12 to 60 links and every fifth with a long one next to many short bobs, whose modes come next in
the table, on a fixed support or a cart with or without a spring, some with dampers, start in one to three modes, mostly
kept ones, at 2 to 45 degrees and move for 3 to 30 s.  The true error is the distance to the whole scene at a tolerance
of 1e-12, less what a run of it at 1e-11 differs, in every eighth case of few links one in Hamilton's equations.  The
promise is asked at every sample: the worst counts.
"""

from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from promise import Trial, attack

from modal import Bob, Body, Cart, Fixed, Pendulum, Rod, Scene, natural_modes
from nonlinear.reduction import simulate_truncated, start_in_mode
from nonlinear.simulation import simulate
from nonlinear.system import State

SAMPLES = 301
DENSE = 24  # links up to which Hamilton's equations are the second reference, at times


@dataclass(frozen=True)
class Case:
    """A scene, the number of its modes that are kept, its start, its duration (s), and all that in words."""

    scene: Scene
    kept: int
    start: State
    duration: float
    words: str


def case(seed: int) -> Case:
    """One random scene of several pendula with a start."""
    rng = random.Random(seed)
    long = seed % 5 == 4
    pendula = [_pendulum(rng) for _ in range(rng.randint(2, 4 if long else 8))]
    if long:
        pendula[0] = _pendulum(rng, rng.randint(12, 60))
    if seed % 5 == 2:
        bobs = rng.randint(8, 14)
        pendula = [_pendulum(rng, rng.randint(2, 4), rng.uniform(2, 4)), *(_bob(rng) for _ in range(bobs))]
    if rng.random() < 0.3:
        pendula.append(_nearly(pendula[-1], 1 + rng.choice((-1, 1)) * 10 ** rng.uniform(-4, -1.5)))
    total = sum(link.mass for pendulum in pendula for link in pendulum.links)
    mass = total * 10 ** rng.uniform(-1, 1)
    support = rng.choice((Fixed(), Cart(mass=mass), Cart(mass=mass, stiffness=mass * rng.uniform(1, 40))))
    scene = Scene(gravity=9.81, support=support, pendulum=pendula)
    modes = natural_modes(scene.conservative)
    first = int(modes.omega[0] == 0)
    kept = first + rng.randint(1, min(5, len(modes) - first))
    moved = rng.sample(range(first, kept), min(kept - first, rng.randint(1, 3)))
    if rng.random() < 0.15 and kept < len(modes):
        moved.append(rng.randrange(kept, min(kept + 4, len(modes))))
    degrees = 2 * 22.5 ** rng.random()
    parts = [
        start_in_mode(
            scene.conservative,
            modes,
            row,
            rng.randrange(int(modes.multiplicity[row])),
            np.deg2rad(degrees) * rng.uniform(0.2, 1) / len(moved),
        )
        for row in moved
    ]
    links, cart = sum(part.links for part in parts), sum(part.cart for part in parts)
    size = np.deg2rad(degrees) / np.abs(links).max()
    start = State(links * size, np.zeros(len(links)), cart * size)
    duration = rng.uniform(3, 8) if long else 5 * 6 ** rng.random()
    words = f"{len(pendula)} pendula, {scene.n_links} links, {support.kind}, {degrees:.0f} deg, {duration:.0f} s"
    return Case(scene, kept, start, duration, f"{words}, keep {kept} of {len(modes)} modes")


def _bob(rng: random.Random) -> Pendulum:
    return Pendulum(links=[Bob(mass=rng.uniform(0.05, 0.5), length=rng.uniform(0.3, 1.2))])


def _pendulum(rng: random.Random, links: int | None = None, length: float | None = None) -> Pendulum:
    number, damping = links or rng.choice((1, 1, 1, 2, 2, 3, 4)), rng.choice((0, 0, 0, 1))
    length = length or rng.uniform(0.3, 1.5)
    return Pendulum(
        links=[_link(rng, length / number * rng.uniform(0.7, 1.3), damping / number) for _ in range(number)],
        count=rng.choice((1, 1, 1, 2, 3)) if links is None else 1,
    )


def _link(rng: random.Random, length: float, damped: float) -> Bob | Rod | Body:
    mass = 10 ** rng.uniform(-1, 0.5)
    damping = damped * 10 ** rng.uniform(-4, -2) * mass * length
    kind = rng.choice((Bob, Rod, Body))
    more = {"centre": length * rng.uniform(0.3, 1.2), "inertia": mass * length**2 / 12} if kind is Body else {}
    return kind(mass=mass, length=length, damping=damping, **more)


def _nearly(pendulum: Pendulum, ratio: float) -> Pendulum:
    first, *others = pendulum.links
    return Pendulum(links=[first.model_copy(update={"length": first.length * ratio}), *others])


def trials(seed: int) -> Iterator[Trial]:
    """The promise of one case, at the sample where it is nearest to being broken."""
    asked = case(seed)
    reduced = simulate_truncated(asked.scene, asked.duration, asked.kept, start=asked.start, output=SAMPLES)
    few = reduced.trajectory.motion.links
    sure, other = (
        simulate(asked.scene, asked.duration, start=asked.start, output=SAMPLES, tolerance=t, form=form).motion.links
        for t, form in ((1e-12, "auto"), (1e-11, "auto" if seed % 8 or asked.scene.n_links > DENSE else "hamiltonian"))
    )
    true, doubt = (np.abs(a - sure).max(axis=1) for a in (few, other))
    true = np.maximum.accumulate(np.maximum(true - doubt, 0))
    with np.errstate(invalid="ignore"):
        worst = int(np.nanargmax(np.where(true > 0, true / reduced.errors, 0)))
    by = reduced.trajectory.run.reason.partition("; error ")[2]
    yield Trial(f"{asked.words}, {by}", float(true[worst]), float(reduced.errors[worst]))


if __name__ == "__main__":
    attack(__doc__ or "", trials, cases=200, quick=3)
