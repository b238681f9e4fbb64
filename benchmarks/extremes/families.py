"""Scenes at the limits of what can be specified, each with its reference motion."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import NamedTuple

import digits
import elliptic
import numpy as np

from modal import Bob, Cart, Pendulum, Rod, Scene
from nonlinear import simulate
from nonlinear.system import State

G, SAMPLES = 9.81, 5
Reference = Callable[[], np.ndarray]


class Case(NamedTuple):
    """A family and its parameter; the scene, released at rest, its times (s), and reference angles (T, L)."""

    family: str
    parameter: float
    scene: Scene
    start: State
    times: np.ndarray
    reference: Reference
    options: dict[str, object] = {}  # noqa: RUF012


def at_rest(angles: object) -> State:
    links = np.array(angles, dtype=float)
    return State(links, np.zeros(links.size))


def hung(*links: object, cart: Cart | None = None, gravity: float = G, count: int = 1) -> Scene:
    pendulum = [Pendulum(links=list(links), count=count)]
    return Scene(gravity=gravity, pendulum=pendulum, **({"support": cart} if cart else {}))


def bob(mass: float = 1.0, length: float = 1.0, **more: float) -> Bob:
    return Bob(mass=mass, length=length, **more)


def case(family: str, parameter: float, scene: Scene, angles: object, duration: float) -> Case:
    """A case with the textbook in forty digits as reference."""
    start, times = at_rest(angles), duration * np.arange(1, SAMPLES + 1) / SAMPLES
    return Case(family, parameter, scene, start, times, partial(digits.motion, scene, start, times))


def single(family: str, parameter: float, scene: Scene, angles: object, duration: float, square: float = G) -> Case:
    """A case whose reference is one simple pendulum that all links follow, left or right."""
    start, times = at_rest(angles), duration * np.arange(1, SAMPLES + 1) / SAMPLES
    size, sides = float(abs(start.links[0])), np.sign(start.links)

    def right() -> np.ndarray:
        return elliptic.angles(size, square, times)[:, None] * sides

    return Case(family, parameter, scene, start, times, right)


def links(quick: bool) -> Iterator[Case]:
    """Chains of bobs of 1 kg every metre, straight at 10°: up to three with digits as reference, then two bodies."""
    for n, duration in ((1, 2.0), (2, 2.0), (3, 2.0), (10, 2.0), (100, 1.0), (1000, 0.2), (10_000, 0.02)):
        if quick and n > 100:
            return
        scene, angles = hung(bob(count=n) if n > 1 else bob()), np.full(n, np.deg2rad(10))
        chain = case("links of a chain", n, scene, angles, duration)
        yield chain if n <= 3 else chain._replace(reference=partial(_tight, chain))


def _tight(tried: Case) -> np.ndarray:
    """The reference by the recursion at the finest tolerance; the compared runs use dense or banded bodies."""
    trajectory = simulate(
        tried.scene, tried.times[-1], start=tried.start, output=tried.times, tolerance=1e-14, method="DOP853"
    )
    return trajectory.motion.links[1:]


def pendula(quick: bool) -> Iterator[Case]:
    """Simple pendula alternately at ±30° on a cart: the cart is still, and each moves as a simple pendulum."""
    for n in (2, 10, 100, 1000, 10_000)[: 3 if quick else None]:
        angles = np.deg2rad(30) * (-1.0) ** np.arange(n)
        yield single("pendula on a cart", n, hung(bob(), cart=Cart(mass=10.0), count=n), angles, 5.0)


def decades(low: int, high: int, every: int, quick: bool) -> list[float]:
    powers = [10.0**power for power in range(low, high + 1, every)]
    return powers[:: max(1, len(powers) // 2)] if quick else powers


def masses(quick: bool) -> Iterator[Case]:
    """Lower over upper mass; with a light upper bob the joint oscillates fast, at its largest amplitude."""
    for ratio in decades(-16, 16, 4, quick):
        fast = min(1.0, ratio**-0.5)
        angles = (0.3 * fast, -0.3 * fast) if ratio > 1 else (0.5, 0.8)
        yield case("mass ratio", ratio, hung(bob(), bob(mass=ratio)), angles, 2.0 * fast)


def lengths(quick: bool) -> Iterator[Case]:
    for ratio in decades(-16, 16, 4, quick):
        yield case("length ratio", ratio, hung(bob(), bob(length=ratio)), (0.5, 0.8), min(1.0, 3 * ratio**0.5))


def carts(quick: bool) -> Iterator[Case]:
    """A light cart oscillates fast under the bob, at its largest amplitude."""
    for mass in decades(-12, 12, 4, quick):
        fast = min(1.0, mass**0.5)
        yield case("cart mass", mass, hung(bob(), cart=Cart(mass=mass)), (0.5 * fast,), 2.0 * fast)
    yield case("massless cart", 0.0, hung(Rod(mass=1.0, length=1.0), cart=Cart(mass=0.0)), (0.5,), 2.0)
    yield case("massless cart of a bob", 0.0, hung(bob(), cart=Cart(mass=0.0)), (0.5,), 0.3)._replace(
        reference=lambda: np.full((SAMPLES, 1), np.nan)
    )


def gravities(quick: bool) -> Iterator[Case]:
    for g in decades(-6, 6, 2, quick):
        yield single("gravity", g, hung(bob(), gravity=g), (np.pi / 2,), 10 / g**0.5, square=g)


def amplitudes(quick: bool) -> Iterator[Case]:
    for degrees in (1e-12, 1e-9, 1e-6, 1e-3, 1.0, 90.0)[:: 3 if quick else 1]:
        yield single("amplitude", degrees, hung(bob()), (np.deg2rad(degrees),), 10.0)
    for below in (10.0, 1.0, 0.1, 1e-3, 1e-6)[:: 2 if quick else 1]:
        yield single("below the top", below, hung(bob()), (np.pi - np.deg2rad(below),), 10.0)


def detunings(quick: bool) -> Iterator[Case]:
    for apart in decades(-16, -1, 3, quick):
        pair = [Pendulum(links=[bob(length=length)]) for length in (1.0, 1.0 + apart)]
        scene = Scene(gravity=G, support=Cart(mass=10.0), pendulum=pair)
        yield case("detuning", apart, scene, (0.2, 0.0), 2.0 if quick else 10.0)


def dampers(quick: bool) -> Iterator[Case]:
    """A heavily damped pendulum: with digits as reference, then by the remaining creep, accurate to g/(l c²)."""
    for c in (1.0, 10.0, 1e6, 1e9, 1e12)[:: 2 if quick else 1]:
        damped = case("damper", c, hung(bob(damping=c)), (1.0,), 2.0 if c < 100 else c / G)
        yield damped if c < 100 else damped._replace(reference=partial(_crept, damped))
    stiff = hung(bob(), bob(damping=1e12))
    yield single("damper that stiffens a joint", 1e12, stiff, (1.0, 1.0), 3.0, square=3 * G / 5)
    yield single("damper of the cart", 1e12, hung(bob(), cart=Cart(mass=1.0, damping=1e12)), (1.0,), 3.0)


def _crept(damped: Case) -> np.ndarray:
    c = next(damped.scene.links()).damping
    return np.array([[elliptic.creeping(1.0, G / c, time)] for time in damped.times])


def springs(quick: bool) -> Iterator[Case]:
    for k in decades(3, 12, 3, quick):
        yield case("spring", k, hung(bob(), bob(stiffness=k)), (0.5, 0.5 + k**-0.5), 30 * k**-0.5)


def hours(quick: bool) -> Iterator[Case]:
    """Ten hours: a simple pendulum, and two on a cart at ±5°."""
    duration, fine = (360.0, 1e-12) if quick else (36_000.0, 1e-15)
    for degrees in (5.0, 90.0):
        swing = single("ten hours", degrees, hung(bob()), (np.deg2rad(degrees),), duration)
        yield swing._replace(options={"method": "taylor", "tolerance": fine})
    if quick:  # the series of a double pendulum takes half a minute to compile
        return
    rods = hung(Rod(mass=1.0, length=1.0, count=2), cart=Cart(mass=100.0), count=2)
    paper = case("ten hours, paper cart", 5.0, rods, np.deg2rad([5.0, 5.0, 0.0, 0.0]), duration)
    yield paper._replace(options={"method": "taylor", "tolerance": fine}, reference=partial(_coarser, paper))


def _coarser(swing: Case) -> np.ndarray:
    """The reference by series of another order."""
    trajectory = simulate(
        swing.scene, swing.times[-1], start=swing.start, output=swing.times, method="taylor", tolerance=1e-13
    )
    return trajectory.motion.links[1:]


FAMILIES = (
    links, pendula, masses, lengths, carts, gravities, amplitudes, detunings, dampers, springs, hours,
)  # fmt: skip


def cases(quick: bool) -> Iterator[Case]:
    for family in FAMILIES:
        yield from family(quick)
