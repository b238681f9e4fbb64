"""Seeded random scenes of every kind the structured solver knows, as extreme as asked."""

from __future__ import annotations

import random

from modal.scene import Bob, Body, Cart, Fixed, Pendulum, Rod, Scene


def random_link(rng: random.Random, spread: float) -> Bob | Rod | Body:
    """A bob, a rod or a body whose centre lies on the link, next to a joint, or beyond the end."""
    m, l = (10.0 ** rng.uniform(-spread, spread) for _ in range(2))
    kind = rng.choice(["bob", "rod", "body"])
    if kind == "bob":
        return Bob(mass=m, length=l)
    if kind == "rod":
        return Rod(mass=m, length=l)
    fraction = rng.choice([rng.uniform(0.01, 1), 1.0, 1 - 10 ** rng.uniform(-9, -1), 10 ** rng.uniform(-6, 1)])
    gyration = rng.choice([0.0, rng.uniform(0, 0.5), 10 ** rng.uniform(-6, 2)])
    return Body(mass=m, length=l, centre=fraction * l, inertia=m * (gyration * l) ** 2)


def random_pendulum(rng: random.Random, spread: float, longest: int = 4) -> Pendulum:
    """One to `longest` links."""
    return Pendulum(links=tuple(random_link(rng, spread) for _ in range(rng.randint(1, longest))))


def random_scene(seed: int, *, copies: bool = False) -> Scene:
    """A scene with a fixed support or a cart, one to four pendula, and mass and length ratios up to 1e±16."""
    rng = random.Random(seed)
    spread = rng.choice([0.3, 1.0, 3.0, 8.0])
    pendula = [random_pendulum(rng, spread) for _ in range(rng.choice([1, 1, 2, 3, 4]))]
    if copies:
        pendula = [p.model_copy(update={"count": rng.randint(1, 3)}) for p in pendula]
        rng.shuffle(pendula)
    total = sum(link.mass for p in pendula for link in p.links)
    support: Fixed | Cart = Fixed()
    if rng.random() < 0.6:
        mass = rng.choice([0.0, total * 10 ** rng.uniform(-12, 12), total * 10 ** rng.uniform(-1, 1)])
        spring = rng.choice([0.0, 0.0, total * 10 ** rng.uniform(-6, 6)])
        support = Cart(mass=mass, stiffness=spring)
    return Scene(gravity=10 ** rng.uniform(-2, 2), support=support, pendulum=tuple(pendula))
