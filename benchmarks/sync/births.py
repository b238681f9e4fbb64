"""Births and deaths of rhythms on random scenes: the map against orbits that are found and followed here.

    python benchmarks/sync/births.py [--scenes 20] [--first 0] [--record FILE]

Two or three metronomes or clocks with escapements hang from one cart, equal or detuned, and its mass, its damper or
the length of a pendulum is varied.  At 7 values starts run by the equations written here (the classical Runge–Kutta
method, kicks at the times of passing) to the passages of the first pendulum, where Newton's method with differences
finds fixed points of the return.  Those that are stable are followed over 61 values; where one ceases to be, by a
multiplier at 1, −1 or on the unit circle, or is lost, a rhythm dies or is born.  The map, of the 7 values, must have
each such end within a step of the sweep, and at each of its values each stable orbit, by its period.  Where it has
more ends, its orbit is followed to them by the equations written here.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from math import pi, sqrt
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

import numpy as np
from clockwork import Clocks, G, kicked, stepped
from numba import njit

from modal import Bob, Cart, Pendulum, Scene
from modal.scene import Escapement, VanDerPol
from modal.scene.parameters import Variation, parse_variations, vary
from nonlinear.ensembles import RhythmMap, find_rhythms, workers_at
from nonlinear.ensembles.rhythms import RhythmEvent

FINE, EVERY = 61, 10  # values of the sweep, and each of how many is one of the map
STEPS, PERIODS, STARTS = 128, 250, 12  # steps a period, periods a start runs, starts at a value of the map
MEMBERS, LIMIT = 24, 400.0  # of the map, s
DIFFERENCE, CLOSED = 1e-4, 1e-9  # of Newton's method: step of differences, largest residual of a fixed point
PERIOD_ERROR = 2e-6  # relative, of the steps taken here


def random_scene(seed: int) -> tuple[Scene, str, float]:
    """A scene, the number that varies with its range, and the largest angle of starts (deg)."""
    random = np.random.default_rng(seed)
    count, mass, length = int(random.choice([2, 3])), 1.0, 0.25
    moment, omega = mass * length**2, sqrt(G / length)
    is_clock, is_detuned = random.random() < 0.5, random.random() < 0.5
    angle = float(random.uniform(2.0, 3.0) if is_clock else random.uniform(8.0, 25.0))
    rate = omega * float(random.uniform(0.01, 0.03) if is_clock else random.uniform(0.03, 0.1))
    pendula = []
    for _ in range(count):
        here = length * (1 + 0.01 * is_detuned * float(random.uniform(-1, 1)))
        if is_clock:
            damping, wide = 2 * moment * rate, angle * float(random.uniform(2.0, 3.0))
            drive = Escapement(impulse=pi * damping * np.radians(wide) / 2, angle_deg=angle)
        else:
            damping, drive = 0.2 * moment * rate, VanDerPol(strength=moment * rate, angle_deg=angle)
        pendula.append(Pendulum(links=[Bob(mass=mass, length=here, damping=damping, drive=drive)]))
    base = count * mass * float(random.uniform(1.5, 8.0))
    cart = Cart(mass=base, damping=base * omega * float(10 ** random.uniform(-2, -0.3)))
    if random.random() < 0.5:
        cart = cart.replace(stiffness=base * (omega * float(random.uniform(0.1, 0.5))) ** 2)
    low, high = {
        "support.mass": (base, 4 * base),
        "support.damping": (cart.damping, 6 * cart.damping),
        "pendulum[0].links[0].length": (0.985 * length, 1.015 * length),
    }[path := str(random.choice(["support.mass", "support.damping", "pendulum[0].links[0].length"]))]
    largest = 3.0 * angle if is_clock else 2 * angle
    return Scene(gravity=G, support=cart, pendulum=pendula), f"{path}={low:.6g}:{high:.6g}", largest


def clocks_of(scene: Scene) -> Clocks:
    """The numbers of a scene of bobs."""
    links = [pendulum.links[0] for pendulum in scene.pendulum]
    drives = [link.drive for link in links]
    columns = (
        [link.mass for link in links],
        [link.mass * link.length for link in links],
        [link.mass * link.length**2 for link in links],
        [link.damping for link in links],
        [getattr(drive, "strength", 0.0) for drive in drives],
        np.radians([drive.angle_deg for drive in drives]),
        [getattr(drive, "impulse", 0.0) for drive in drives],
    )
    cart = scene.support
    return Clocks(*map(np.array, columns), cart.mass, cart.damping, cart.stiffness)


@njit
def returned(p, y, h, sides, times):
    """The state after so many passages of the first pendulum to the right, and the time of the last."""
    n, time = len(p.mass), 0.0
    for _ in range(times):
        for _ in range(20 * STEPS):
            before, y = y, kicked(p, y, h, sides)
            time += h
            if before[0] < 0 <= y[0]:
                break
        for _ in range(4):  # Newton's method for the time of passing, where no kick is near
            part = -y[0] / y[n]
            y, time = stepped(p, y, part), time + part
        y[0] = 0.0
    return y, time


@njit
def sides_at(p, y):
    """Where clocks that swing beyond their limit are kicked next."""
    n = len(p.mass)
    sides = np.ones(n)
    for i in range(n):
        outside = abs(y[i]) >= p.limit[i]
        sides[i] = -np.sign(y[i]) if outside else np.sign(y[n + i]) if y[n + i] != 0 else 1.0
    return sides


def repeating(p: Clocks, y: np.ndarray, largest: float) -> int:
    """After how many passages, up to 8, a state on the section comes back, 1 where the `largest` gap is exceeded."""
    later = (returned(p, y, p.period / STEPS, sides_at(p, y), passages)[0] for passages in range(1, 9))
    gaps = [np.abs(after - y)[: len(p.mass)].max() for after in later]
    return next((passages for passages, gap in enumerate(gaps, 1) if gap < largest), 1)


class FixedPoint(NamedTuple):
    """Of so many returns: the state, its period (s) and the multipliers without that along the orbit."""

    y: np.ndarray
    period: float
    multipliers: np.ndarray
    passages: int

    @property
    def is_stable(self) -> bool:
        """Whether all multipliers lie within the unit circle."""
        return bool(np.abs(self.multipliers).max() < 1)

    @property
    def kind(self) -> str:
        """How it ceased to be stable, by its largest multiplier."""
        largest = self.multipliers[np.abs(self.multipliers).argmax()]
        if abs(largest.imag) > 1e-6:
            return "Neimark–Sacker"
        return "doubling" if largest.real < 0 else "fold or branch point"


def fixed_point(p: Clocks, y: np.ndarray, passages: int) -> FixedPoint | None:
    """The fixed point of so many returns near a state on the section, None where Newton's method finds none."""
    n, h, length = len(p.mass), p.period / STEPS, p.first[0] / p.mass[0]
    unit = np.concatenate((np.ones(n), np.full(n, 2 * pi / p.period), length * np.array([1, 2 * pi / p.period])))
    columns = [i for i in range(1, 2 * n + 2) if i != 2 * n or p.base_spring]
    y = y.copy()
    y[0] = 0.0
    y[2 * n] *= bool(p.base_spring)

    def image(z: np.ndarray) -> tuple[np.ndarray, float]:
        state = y.copy()
        state[columns] = z * unit[columns]
        after, period = returned(p, state, h, sides_at(p, state), passages)
        return after[columns] / unit[columns], period

    z = y[columns] / unit[columns]
    for _ in range(12):
        gap = image(z)[0] - z
        steps = DIFFERENCE * np.eye(len(z))
        slopes = np.array([(image(z + step)[0] - image(z - step)[0]) / (2 * DIFFERENCE) for step in steps]).T
        if not np.all(np.isfinite(slopes)) or np.abs(z).max() > 3:
            return None
        if np.abs(gap).max() < CLOSED:
            y[columns] = z * unit[columns]
            return FixedPoint(y, image(z)[1], np.linalg.eigvals(slopes), passages)
        z = z - np.linalg.solve(slopes - np.eye(len(z)), gap)
    return None


class End(NamedTuple):
    """Where a stable orbit is born or dies as the number grows: between two values of the sweep, and how."""

    low: float
    high: float
    is_birth: bool
    kind: str


def orbits_at(p: Clocks, random: np.random.Generator, largest_deg: float) -> Iterator[FixedPoint]:
    """The stable orbits that starts come near to."""
    n, omega = len(p.mass), 2 * pi / p.period
    for _ in range(STARTS):
        size, phase = np.radians(largest_deg) * random.random(n), 2 * pi * random.random(n)
        y = np.concatenate((size * np.cos(phase), -size * omega * np.sin(phase), (0.0, 0.0)))
        y, _ = returned(p, y, p.period / STEPS, sides_at(p, y), PERIODS)
        is_swinging = np.all(np.isfinite(y)) and y[n] > 0.05 * np.radians(largest_deg) * omega
        point = fixed_point(p, y, repeating(p, y, 1e-5)) if is_swinging else None
        # a slowly decaying motion of another number of swings may hide that it repeats after fewer
        point = point and fixed_point(p, point.y, repeating(p, point.y, 1e-7))
        if point and point.is_stable and np.abs(point.y - y).max() < 0.2 * np.abs(y).max():
            yield point


def is_near(point: FixedPoint, other: FixedPoint, gap: float) -> bool:
    """Whether two fixed points differ by less than this part of their size."""
    return bool(np.abs(point.y - other.y).max() < gap * np.abs(other.y).max())


def followed(
    parts: list[Clocks], begin: int, point: FixedPoint, direction: int
) -> tuple[dict[int, FixedPoint], tuple[int, int, str] | None]:
    """The stable orbits from one on to one side, and between which places and how they end."""
    points, place = {begin: point}, begin
    while 0 <= (following := place + direction) < len(parts):
        before = points.get(place - direction, points[place])
        guesses = 2 * points[place].y - before.y, points[place].y
        near = next(filter(None, (fixed_point(parts[following], y, point.passages) for y in guesses)), None)
        if near is None or not is_near(near, points[place], 0.3):
            return points, (place, following, "lost")
        if not near.is_stable:
            return points, (place, following, near.kind)
        points[following], place = near, following
    return points, None


def swept(scene: Scene, variation: Variation, largest_deg: float) -> tuple[list[dict[int, FixedPoint]], set[End]]:
    """The branches of stable orbits by place, copies among equal pendula included, and where they end."""
    values = variation.values
    parts = [clocks_of(vary(scene, {variation.path: value})) for value in values]
    branches, ends, random = list[dict[int, FixedPoint]](), set[End](), np.random.default_rng(3)
    for begin in range(0, len(values), EVERY):
        for point in orbits_at(parts[begin], random, largest_deg):
            if any(begin in branch and is_near(point, branch[begin], 1e-4) for branch in branches):
                continue
            branch = dict[int, FixedPoint]()
            for direction in (-1, 1):
                points, end = followed(parts, begin, point, direction)
                branch |= points
                if end:
                    low, high = sorted((values[end[0]], values[end[1]]))
                    ends.add(End(low, high, direction < 0, end[2]))
            branches.append(branch)
    return branches, ends


def is_confirmed(event: RhythmEvent, rhythms: RhythmMap, scene: Scene, fine: Variation) -> bool:
    """Whether the orbit that the map follows to a birth or death is stable here too, and ends there."""
    numbers = [
        number
        for number, at in enumerate(rhythms.values)
        if (at.value > event.value) is event.is_birth and any(rhythm.name == event.name for rhythm in at.rhythms)
    ]
    if not numbers:
        return False
    number = min(numbers) if event.is_birth else max(numbers)
    orbit = next(rhythm.orbit for rhythm in rhythms.values[number].rhythms if rhythm.name == event.name)
    # the widest pendulum is the first here: another may be at rest, and never pass
    order, state = np.argsort(-orbit.amplitudes), orbit.state
    parts = [
        Clocks(*(part[order] if np.ndim(part) else part for part in clocks_of(vary(scene, {fine.path: value}))))
        for value in fine.values
    ]
    p = parts[EVERY * number]
    y = np.concatenate((state.links[order], state.link_rates[order], (state.cart, state.cart_rate)))
    y, _ = returned(p, y, p.period / STEPS, sides_at(p, y), 1)
    point = fixed_point(p, y, round(orbit.period / p.period))
    if point is None or not point.is_stable or abs(point.period / orbit.period - 1) > PERIOD_ERROR:
        return False
    _, end = followed(parts, EVERY * number, point, -1 if event.is_birth else 1)
    step = fine.values[1] - fine.values[0]
    return end is not None and all(abs(fine.values[place] - event.value) < 2 * step for place in end[:2])


def missed_of(scene: Scene, variation: Variation, rhythms: RhythmMap, largest_deg: float) -> dict[str, object]:
    """Ends and orbits of the sweep, and those that the map does not have."""
    branches, ends = swept(scene, variation, largest_deg)
    step = variation.values[1] - variation.values[0]
    computed = [event for event in rhythms.births if not event.between]
    same = {
        (end, event)
        for end in ends
        for event in computed
        if event.is_birth == end.is_birth and end.low - step <= event.value <= end.high + step
    }
    missed_ends = sorted(ends - {end for end, _ in same})
    others = [event for event in computed if event not in {event for _, event in same}]
    extra = [
        (event.name, event.is_birth, event.kind, event.value, is_confirmed(event, rhythms, scene, variation))
        for event in others
    ]
    pairs, missed_orbits = 0, []
    for number, at in enumerate(rhythms.values):
        periods = [rhythm.orbit.period for rhythm in at.rhythms if rhythm.orbit]
        for period in {round(branch[EVERY * number].period, 9) for branch in branches if EVERY * number in branch}:
            pairs += 1
            if not any(abs(period / other - 1) < PERIOD_ERROR for other in periods):
                missed_orbits.append((at.value, period))
    return {
        "ends": sorted(ends),
        "missed_ends": missed_ends,
        "extra": extra,
        "orbits": pairs,
        "missed_orbits": missed_orbits,
    }


def compare(seed: int) -> dict[str, object]:
    """The record of a scene."""
    scene, text, largest_deg = random_scene(seed)
    coarse = parse_variations([f"{text}:{(FINE - 1) // EVERY + 1}"])[0]
    fine = parse_variations([f"{text}:{FINE}"])[0]
    begun = perf_counter()
    with workers_at(None, 1) as crew:
        rhythms = find_rhythms(scene, coarse, members=MEMBERS, largest_deg=largest_deg, limit=LIMIT, crew=crew)
    mapped = perf_counter() - begun
    begun = perf_counter()
    missed = missed_of(scene, fine, rhythms, largest_deg)
    kind = "clocks" if isinstance(scene.pendulum[0].links[0].drive, Escapement) else "metronomes"
    about = f"{len(scene.pendulum)} {kind}, {coarse.path}"
    events = [(event.name, event.is_birth, event.kind, event.value, event.between) for event in rhythms.births]
    return {
        "seed": seed,
        "about": about,
        **missed,
        "events": events,
        "map_s": round(mapped, 1),
        "sweep_s": round(perf_counter() - begun, 1),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--scenes", type=int, default=20, help="how many (default: 20)")
    parser.add_argument("--first", type=int, default=0, help="the first seed (default: 0)")
    parser.add_argument("--record", type=Path, help="a file of lines, in which a run that was cut short goes on")
    parser.add_argument("--quick", action="store_true", help="one scene")
    arguments = parser.parse_args()
    lines = arguments.record.read_text().splitlines() if arguments.record and arguments.record.exists() else []
    records = {record["seed"]: record for record in map(json.loads, lines)}
    columns = ("scene", "births and deaths", "missed", "more in the map", "confirmed", "orbits at 7 values", "missed")
    print(f"| {' | '.join(columns)} |\n|---|{'---:|' * (len(columns) - 1)}")
    seeds = range(arguments.first, arguments.first + (1 if arguments.quick else arguments.scenes))
    for seed in seeds:
        if seed not in records:
            records[seed] = compare(seed)
            if arguments.record:
                with arguments.record.open("a") as file:
                    file.write(json.dumps(records[seed]) + "\n")
        at = records[seed]
        more = [len(at["extra"]), sum(is_true for *_, is_true in at["extra"])]
        counts = (len(at["ends"]), len(at["missed_ends"]), *more, at["orbits"], len(at["missed_orbits"]))
        print(f"| {seed}: {at['about']} | {' | '.join(map(str, counts))} |", flush=True)
    sys.exit(any(records[seed]["missed_ends"] or records[seed]["missed_orbits"] for seed in seeds))


if __name__ == "__main__":
    main()
