"""Random scenes: every kind by its seed, and random states of them.

`extreme_scene`, `sprung_scene` and `structured_scene` go to the ends of what can be written, all others have ordinary
proportions: `mild_scene` for modes, `decimal_scene` for exact arithmetic, `long_scene` for long chains, `plane_scene`
with all that acts in a plane, `spatial_scene` for motion in space, `motion_scene` with a start for runs.
"""

from __future__ import annotations

import random
from math import sin

import numpy as np

from modal.errors import SceneError
from modal.scene import Bob, Body, Cart, Fixed, InitialCondition, Pendulum, Rod, Scene, Spring
from modal.scene.supports import Heave, Planar, Platform, Swing, Tilt
from modal.types import Floats
from nonlinear.dynamics import Minimal, Recursion
from nonlinear.system import AppliedForces, Load, State, System

Generator = np.random.Generator


def extreme_link(rng: random.Random, spread: float) -> Bob | Rod | Body:
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


def extreme_pendulum(rng: random.Random, spread: float, longest: int = 4) -> Pendulum:
    """One to `longest` links."""
    return Pendulum(links=tuple(extreme_link(rng, spread) for _ in range(rng.randint(1, longest))))


def extreme_scene(seed: int, *, copies: bool = False) -> Scene:
    """A scene with a fixed support or a cart, one to four pendula, and mass and length ratios up to 1e±16."""
    rng = random.Random(seed)
    spread = rng.choice([0.3, 1.0, 3.0, 8.0])
    pendula = [extreme_pendulum(rng, spread) for _ in range(rng.choice([1, 1, 2, 3, 4]))]
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


def sprung_scene(seed: int, spread: float, *, standing: bool = False) -> Scene:
    """A random scene with joint springs in most joints, alone or on a free or held cart."""
    rng = random.Random(seed)

    def decades() -> float:
        return 10.0 ** rng.uniform(-spread, spread)

    def pendulum() -> Pendulum:
        links = [extreme_link(rng, spread) for _ in range(rng.randint(1, 4))]
        held = [{"stiffness": 10 * l.mass * l.length * decades() if rng.random() < 0.8 else 0.0} for l in links]
        ways = tuple(rng.choice(["up", "down"]) if standing else "down" for _ in links)
        links = [link.replace(**spring) for link, spring in zip(links, held, strict=True)]
        return Pendulum(links=tuple(links), count=rng.choice([1, 1, 2]), equilibrium=ways)

    pendula = [pendulum() for _ in range(rng.choice([1, 1, 2, 3]))]
    total = sum(link.mass for p in pendula for link in p.links)
    held = rng.choice([0.0, 0.0, total * decades()])
    support = Fixed() if rng.random() < 0.3 else Cart(mass=total * decades(), stiffness=held)
    return Scene(gravity=9.81, support=support, pendulum=tuple(pendula))


def structured_scene(seed: int, spread: float, *, damped: float = 0.0) -> Scene:
    """One to three supports of any kind with joint springs and springs between points; numbers of 10^±spread."""
    rng = random.Random(seed)

    def number() -> float:
        return 10.0 ** rng.uniform(-spread, spread)

    def some(share: float) -> float:
        return number() if rng.random() < share else 0.0

    def support(name: str) -> Fixed | Cart | Swing | Tilt | Heave | Platform:
        kind = rng.choice([Fixed, Cart, Cart, Swing, Tilt, Heave, Platform])
        at = {"name": name, "position": (round(rng.uniform(-2, 2), 3), round(rng.uniform(-0.5, 0.5), 3))}
        numbers = {**at, "mass": number(), "damping": some(damped)}
        body = {**at, "mass": number(), "inertia": number(), "centre": (rng.uniform(-0.2, 0.2), rng.uniform(0, 0.3))}
        if kind is Fixed:
            return Fixed(**at)
        if kind is Cart:
            return Cart(**numbers, stiffness=some(0.6))
        if kind is Swing:
            return Swing(**numbers, length=rng.uniform(0.3, 3), stiffness=some(0.6))
        if kind is Heave:
            return Heave(**numbers, stiffness=number())
        if kind is Tilt:
            return Tilt(**body, stiffness=number(), damping=some(damped))
        ways = Planar(sway=some(damped), heave=some(damped), roll=some(damped))
        return Platform(**body, stiffness=Planar(sway=some(0.6), heave=number(), roll=number()), damping=ways)

    def link() -> Body:
        m, l = number(), 10 ** rng.uniform(-1, 1)
        inertia = m * l * l * 10 ** rng.uniform(-4, 0)
        joint = {"stiffness": some(0.3), "damping": some(damped)}
        return Body(mass=m, length=l, centre=l * rng.uniform(0.3, 1.2), inertia=inertia, **joint)

    names = [f"s{k}" for k in range(rng.randint(1, 3))]
    supports = [support(name) for name in names]
    pendula = [
        Pendulum(
            on=rng.choice(names),
            position=(round(rng.uniform(-1, 1), 3), round(rng.uniform(0, 0.6), 3)),
            links=[link() for _ in range(rng.randint(1, 3))],
            count=rng.choice([1, 1, 2, 3]),
        )
        for _ in range(rng.randint(1, 3))
    ]

    def point() -> str:
        if rng.random() < 0.5:
            return f"{rng.choice(names)}@{rng.uniform(-1, 1):.3f},{rng.uniform(-0.3, 0.3):.3f}"
        if rng.random() < 0.3:
            return f"ground@{rng.uniform(-1, 1):.3f},{rng.uniform(-1, 1):.3f}"
        p = rng.randrange(len(pendula))
        copy = f".copies[{rng.randrange(pendula[p].count)}]" if pendula[p].count > 1 else ""
        return f"pendulum[{p}]{copy}.links[{rng.randrange(len(pendula[p].links))}]"

    scene = Scene(gravity=9.81, support=supports, pendulum=pendula)
    for _ in range(rng.randint(0, 3)):
        spring = Spring(between=(point(), point()), stiffness=number(), damping=some(damped))
        try:
            scene = scene.replace(spring=(*scene.spring, spring))
        except SceneError:  # both ends on one body, or on the ground
            continue
    return scene


def mild_scene(seed: int, **link: float) -> Scene:
    """A well-conditioned random scene on a cart with copies; `link` adds dampers or springs to every joint."""
    rng = np.random.default_rng(seed)
    pendula = [
        Pendulum(
            links=[
                Body(mass=m, length=l, centre=c * l, inertia=i, **link) for m, l, c, i in rng.uniform(0.2, 2, (n, 4))
            ],
            count=int(rng.integers(1, 4)),
        )
        for n in rng.integers(1, 4, size=rng.integers(1, 4))
    ]
    cart = Cart(mass=rng.uniform(0.1, 5), stiffness=float(rng.choice([0.0, 2.0])), damping=0.0)
    return Scene(gravity=9.81, support=cart if seed % 4 else Fixed(), pendulum=pendula)


def decimal(rng: random.Random) -> float:
    return round(rng.uniform(0.1, 3.0), 2)


def decimal_scene(seed: int, *, standing: bool = True, joints: bool = True) -> Scene:
    """Decimals with two places: bobs, rods and bodies, some of them standing, joint springs and dampers, copies."""
    rng = random.Random(seed)
    pendula = []
    for _ in range(rng.choice([1, 1, 2, 3])):
        links = []
        for _ in range(rng.randint(1, 3)):
            extra = {"damping": rng.choice([0.0, decimal(rng)]), "stiffness": rng.choice([0.0, decimal(rng)])}
            size = {"mass": decimal(rng), "length": decimal(rng), **(extra if joints else {})}
            body = {"centre": decimal(rng), "inertia": decimal(rng)}
            links.append(rng.choice([Bob(**size), Rod(**size), Body(**size, **body)]))
        ways = tuple(rng.choice(["down", "down", "up"]) for _ in links) if standing else None
        pendula.append(Pendulum(links=links, count=rng.choice([1, 1, 2]), equilibrium=ways))
    support = rng.choice([Fixed(), Cart(mass=decimal(rng), damping=decimal(rng), stiffness=decimal(rng))])
    return Scene(gravity=9.81, support=support, pendulum=pendula)


def _long_link(rng: random.Random) -> Bob | Rod | Body:
    """With a damper and a spring at its joint, now and then."""
    m, l = (10 ** rng.uniform(-0.5, 0.5) for _ in range(2))
    joint = {"damping": rng.choice([0.0, rng.random()]), "stiffness": rng.choice([0.0, rng.random()])}
    body = Body(mass=m, length=l, centre=rng.uniform(0.2, 1.5) * l, inertia=m * (rng.uniform(0, 0.5) * l) ** 2, **joint)
    return rng.choice([Bob(mass=m, length=l, **joint), Rod(mass=m, length=l, **joint), body])


def long_scene(seed: int, longest: int = 30) -> Scene:
    """Up to four kinds of chains with dampers and springs, some of them copies, some on a cart."""
    rng = random.Random(seed)
    pendula = [
        Pendulum(links=[_long_link(rng) for _ in range(rng.randint(1, longest))], count=rng.randint(1, 3))
        for _ in range(rng.randint(1, 4))
    ]
    cart = Cart(mass=10 ** rng.uniform(-2, 2), damping=rng.choice([0, 1.5]), stiffness=rng.choice([0, 2.5]))
    return Scene(gravity=9.81, support=rng.choice([Fixed(), cart]), pendulum=pendula)


def _plane_link(rng: Generator, kind: str) -> Bob | Rod | Body:
    m, l, c, gyration = rng.uniform(0.3, 2.0, 4)
    joint = {"stiffness": rng.choice([0.0, 5.0]) * c, "damping": rng.choice([0.0, 0.5]) * c}
    if kind == "body":
        return Body(mass=m, length=l, centre=c * l, inertia=rng.choice([0.0, 1.0]) * m * (gyration * l) ** 2, **joint)
    return (Bob if kind == "bob" else Rod)(mass=m, length=l, **joint)


def _plane_pendulum(rng: Generator, top: str) -> Pendulum:
    kinds = [top, *rng.choice(["bob", "rod", "body"], rng.integers(0, 5))]
    ways = tuple(rng.choice(["down", "up"], len(kinds)).tolist())
    return Pendulum(
        links=tuple(_plane_link(rng, kind) for kind in kinds), equilibrium=ways, count=int(rng.integers(1, 3))
    )


def plane_scene(seed: int) -> Scene:
    """Fixed supports, carts heavy, light and massless; a rod on top keeps the massless cart's motion determined."""
    rng = np.random.default_rng(seed)
    tops = ["rod", *rng.choice(["bob", "rod", "body"], rng.integers(0, 4))]
    mass = [None, 0.0, 0.2, 3.0, 100.0][seed % 5]
    spring, damper = rng.choice([0.0, 4.0]), rng.choice([0.0, 0.7])
    support = Fixed() if mass is None else Cart(mass=mass, stiffness=spring, damping=damper)
    return Scene(gravity=9.81, support=support, pendulum=tuple(_plane_pendulum(rng, top) for top in tops))


def _spatial_link(rng: random.Random) -> Bob | Rod | Body:
    """A link of which no constant is tiny: in space a link without inertia under a load is next to singular."""
    m, l = rng.uniform(0.3, 3), rng.uniform(0.3, 2)
    c, I = rng.uniform(0.1, 1.5) * l, rng.choice([0, rng.uniform(0, 0.5)]) * m * l**2
    return rng.choice([Bob(mass=m, length=l), Rod(mass=m, length=l), Body(mass=m, length=l, centre=c, inertia=I)])


def spatial_scene(seed: int, *, still: bool = False, odd: bool = False) -> Scene:
    """One to three pendula of one to four links with dampers, springs and standing rests, mostly on a cart."""
    rng = random.Random(seed)
    pendula = []
    for _ in range(rng.randint(1, 3)):
        links = [extreme_link(rng, 0.3) if odd else _spatial_link(rng) for _ in range(rng.randint(1, 4))]
        extras = [{"damping": rng.choice([0, 0.3]), "stiffness": rng.choice([0, 2.0])} for _ in links]
        links = [link.model_copy(update=extra) for link, extra in zip(links, extras, strict=True)]
        ways = tuple(rng.choice(["down", "up"]) for _ in links)
        pendula.append(Pendulum(links=tuple(links), count=rng.randint(1, 2), equilibrium=ways))
    cart = Cart(mass=rng.uniform(0.1, 9), damping=rng.choice([0, 0.7]), stiffness=rng.choice([0, 3.0]))
    support = Fixed() if still or rng.random() < 0.2 else cart
    return Scene(gravity=rng.uniform(1, 20), space="space", support=support, pendulum=tuple(pendula))


def motion_scene(
    seed: int, *, damped: bool = True, sprung: bool = True, standing: bool = True, longest: int = 4, most: int = 3
) -> Scene:
    """One to `most` pendula of one to `longest` links, on a cart or not, some joints with springs and dampers."""
    rng = random.Random(seed)

    def link() -> Bob | Rod | Body:
        numbers = {"mass": rng.uniform(0.2, 3), "length": rng.uniform(0.3, 2)}
        if damped and rng.random() < 0.3:
            numbers["damping"] = rng.uniform(0.01, 0.3) * numbers["mass"] * numbers["length"] ** 2
        if sprung and rng.random() < 0.3:
            numbers["stiffness"] = rng.uniform(0.1, 5) * numbers["mass"] * numbers["length"] ** 2
        kind = rng.choice([Bob, Rod, Body])
        if kind is Body:
            numbers |= {
                "centre": rng.uniform(0.4, 1.3) * numbers["length"],
                "inertia": rng.choice([0.0, rng.uniform(0, 1)]),
            }
        return kind(**numbers)

    def pendulum() -> Pendulum:
        n = rng.randint(1, longest)
        angles = tuple(rng.uniform(-170, 170) for _ in range(n))
        rates = tuple(rng.uniform(-85, 85) for _ in range(n))
        rest = tuple(rng.choice(["down", "up"]) for _ in range(n)) if standing and rng.random() < 0.2 else None
        start = InitialCondition(angles_deg=angles, rates_deg=rates)
        return Pendulum(links=tuple(link() for _ in range(n)), start=start, equilibrium=rest)

    support: Fixed | Cart = Fixed()
    if rng.random() < 0.7:
        spring, damper = (rng.choice([0.0, rng.uniform(0.1, 30)]) for _ in range(2))
        support = Cart(mass=rng.uniform(0.5, 20), stiffness=spring * sprung, damping=damper * damped)
    pendula = tuple(pendulum() for _ in range(rng.randint(1, most)))
    return Scene(gravity=rng.uniform(1, 15), support=support, pendulum=pendula)


def random_state(system: System, seed: int) -> State:
    rng = np.random.default_rng(seed)
    angles, rates = rng.uniform(-np.pi, np.pi, system.n_links), 2 * rng.normal(size=system.n_links)
    cart, cart_rate = rng.normal(size=2) if system.cart else (0.0, 0.0)
    return State(angles, rates, float(cart), float(cart_rate))


def minimal(system: System, load: Load | None = None) -> Minimal:
    return Minimal(system, tuple(Recursion(group) for group in system.groups), load)


def blowing(time: float, state: State) -> AppliedForces:
    """A load of time and of the state, on everything."""
    moments = 0.3 * np.cos(state.links + time) - 0.1 * state.link_rates
    return AppliedForces(sin(3 * time) - 0.2 * state.cart, moments)


def complex_step(system: System, y: Floats, v: Floats) -> tuple[Floats, Floats]:
    """y' and J v, (size, E) each: f(y + i h v), nothing subtracted (Squire and Trapp, SIAM Review 40, 110, 1998)."""
    passes = Minimal(system, tuple(Recursion(group, tail=1) for group in system.groups), counts_work=False)
    rates = passes.derivative(0.0, y + 1e-30j * v)
    return rates.real, rates.imag / 1e-30


def geared(scene: Scene, seed: int, decades: float = 1.0) -> Scene:
    """The same scene with rotors at four of five joints, as heavy as the links within a factor of 10^±decades."""
    rng = random.Random(f"rotors {seed}")

    def with_rotor(link: Bob | Rod | Body) -> Bob | Rod | Body:
        ratio, inertia = rng.uniform(0.5, 60.0), link.mass * link.length**2 * 10 ** rng.uniform(-decades, decades)
        return link.replace(rotor_inertia=inertia / ratio**2, gear_ratio=ratio) if rng.random() < 0.8 else link

    pendula = [pendulum.replace(links=tuple(map(with_rotor, pendulum.links))) for pendulum in scene.pendulum]
    return scene.replace(pendulum=tuple(pendula))
