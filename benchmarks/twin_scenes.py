"""Random scenes written twice: on a cart or alone, and as the same thing on a structure, or from other entries."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from modal import Bob, Body, Cart, Fixed, ModalSupport, Pendulum, Platform, Rod, Scene, Spring, Swing, Tilt
from modal.scene.supports import Planar

ORDERS = 12
"""Masses of extreme scenes are between 10 to the power of minus this and of this."""
Links = list[Any]
Places = tuple[tuple[str, str], ...]


class Side(NamedTuple):
    """A scene, of whose coordinates the first one times `size`, and then all but `beside` more, are those of its twin.

    `drive` is a group of inputs of which the first one pushes the first coordinate, `outputs` are groups of outputs.
    """

    scene: Scene
    drive: str
    outputs: tuple[str, ...]
    size: float = 1.0
    beside: int = 0


class Twins(NamedTuple):
    """One thing written twice: in which `way`, whether equal at large angles too, and whether its numbers are extreme.

    `places` are pairs of places of one number that both scenes have, the first of them one that may change alone.
    """

    way: str
    first: Side
    second: Side
    large: bool
    extreme: bool
    places: Places = ()


class Numbers:
    """Random numbers of links and carts, extreme ones or such as a laboratory has."""

    def __init__(self, rng: random.Random, extreme: bool) -> None:
        self.rng, self.extreme = rng, extreme
        self.unit = 10.0 ** rng.choice([-6, -3, 0, 3, 6]) if extreme else 1.0
        self.gravity = rng.uniform(1.0, 20.0)

    def mass(self) -> float:
        """In kg."""
        wide = self.extreme and self.rng.random() < 0.4
        return self.rng.uniform(0.2, 5.0) * 10.0 ** (self.rng.randint(-ORDERS, ORDERS) if wide else 0)

    def length(self) -> float:
        """In m."""
        return self.rng.uniform(0.2, 2.0) * self.unit

    def rate(self) -> float:
        """About the angular frequency of a link (rad/s)."""
        return float((self.gravity / self.unit) ** 0.5)

    def some(self, size: float, often: float = 0.5, orders: int = 3) -> float:
        """Zero, or a number near this size, of extreme scenes anywhere near it."""
        wide = self.rng.randint(-orders, orders) if self.extreme else 0
        return size * self.rng.uniform(0.1, 2.0) * 10.0**wide if self.rng.random() < often else 0.0


def link(numbers: Numbers, *, damped: bool, sprung: bool) -> Any:
    rng, mass, length = numbers.rng, numbers.mass(), numbers.length()
    inertia, rate = mass * length**2, numbers.rate()
    extras = {
        "damping": damped * numbers.some(0.05 * inertia * rate, 0.4),
        "stiffness": sprung * numbers.some(0.5 * inertia * rate**2, 0.4),
        "drag": damped * numbers.some(0.03 * mass * rate, 0.3),
    }
    kind = rng.choice([Bob, Rod, Body])
    if kind is Body:
        extras |= {"centre": length * rng.uniform(0.3, 1.2), "inertia": inertia * rng.choice([0.0, rng.uniform(0, 1)])}
    return kind(mass=mass, length=length, **extras)


def pendula(numbers: Numbers, *, loose: bool = False, standing: bool = False, single: bool = False) -> list[Pendulum]:
    """One to three entries of up to three copies; `loose` ones have nothing at their first joints."""
    rng, entries = numbers.rng, []
    damped, sprung = rng.random() < 0.5, rng.random() < 0.5
    for _ in range(rng.randint(1, 3)):
        links = [link(numbers, damped=damped, sprung=sprung) for _ in range(rng.randint(1, 4))]
        if loose:
            links[0] = links[0].replace(stiffness=0.0, damping=0.0)
        up = standing and rng.random() < 0.4
        ways = tuple(rng.choice(["up", "down"]) for _ in links) if up else None
        entries.append(Pendulum(links=links, count=1 if single else rng.randint(1, 3), equilibrium=ways))
    return entries


def cart_numbers(numbers: Numbers, entries: list[Pendulum], *, damped: bool = True) -> dict[str, float]:
    mass = numbers.mass()
    hung = sum(each.mass * each.count for entry in entries for each in entry.links)
    rate = numbers.rate()
    damping = damped * numbers.some(0.1 * (mass + hung) * rate, 0.4)
    return {"mass": mass, "stiffness": numbers.some((mass + hung) * rate**2, 0.6), "damping": damping}


ON_CART = ("cart_position", "angles", "tip_positions", "tip_accelerations", "pivot_forces")
ON_STRUCTURE = ("coordinates", *ON_CART[1:])
ON_CHAIN = ("angles", "tip_positions", "tip_accelerations")
ON_BOARD = ("coordinates", *ON_CHAIN)


def _on_cart(numbers: Numbers, entries: list[Pendulum], cart: dict[str, float]) -> Side:
    return Side(Scene(gravity=numbers.gravity, support=Cart(**cart), pendulum=entries), "cart_force", ON_CART)


def _on_structure(scene: Scene, **more: Any) -> Side:
    return Side(scene, "coordinate_forces", ON_STRUCTURE, **more)


def _hung(entries: list[Pendulum], on: str) -> list[Pendulum]:
    return [entry.replace(on=on) for entry in entries]


def _same(entries: list[Pendulum], *out: str) -> Places:
    """The numbers of links, which stand at the same places in both scenes, but these."""
    names = [name for name in ("length", "mass", "stiffness", "damping", "drag") if name not in out]
    links = (
        f"pendulum[{p}].links[{i}].{n}"
        for p, entry in enumerate(entries)
        for n in names
        for i in range(len(entry.links))
    )
    return tuple((place, place) for place in links)


def _one_above(links: Links) -> Places:
    """Those of a chain whose first link is the support in its twin."""
    names = ("length", "mass", "stiffness", "damping", "drag")
    below = (
        (f"pendulum[0].links[{i}].{n}", f"pendulum[0].links[{i - 1}].{n}") for n in names for i in range(1, len(links))
    )
    return (*below, ("gravity", "gravity"))


# ------------------------------------------------------------------------------------------------------- the ways


def springs(numbers: Numbers) -> Twins:
    """The spring and the damper of a cart as one between points, the cart being there as drawn."""
    entries = pendula(numbers)
    cart = cart_numbers(numbers, entries)
    if not cart["stiffness"] and not cart["damping"]:
        cart["stiffness"] = cart["mass"] * numbers.rate() ** 2
    joined = Spring(between=("cart", "ground"), stiffness=cart["stiffness"], damping=cart["damping"])
    second = Scene(
        gravity=numbers.gravity, support=Cart(mass=cart["mass"]), pendulum=entries, spring=[joined]
    )  # fmt: skip
    places = (*_same(entries), ("support.mass", "support.mass"), ("support.stiffness", "spring[0].stiffness"))
    return Twins("spring", _on_cart(numbers, entries, cart), _on_structure(second), True, numbers.extreme, places)


def beside(numbers: Numbers) -> Twins:
    """A cart next to a wall on which nothing hangs; links may stand on their heads."""
    entries = pendula(numbers, standing=True)
    cart = cart_numbers(numbers, entries)
    supports = [Cart(name="truck", **cart), Fixed(name="wall", position=(7.0, 0.0))]
    second = Scene(gravity=numbers.gravity, support=supports, pendulum=_hung(entries, "truck"))
    carts = ((f"support.{name}", f"support[0].{name}") for name in ("mass", "stiffness", "damping"))
    places = (*_same(entries), *carts)
    return Twins("beside", _on_cart(numbers, entries, cart), _on_structure(second), True, numbers.extreme, places)


def modal(numbers: Numbers) -> Twins:
    """A cart as a modal support of one coordinate, whose mass and stiffness are matrices of one number."""
    entries = pendula(numbers, standing=True)
    cart = cart_numbers(numbers, entries)
    M, K, D = ([[cart[name]]] for name in ("mass", "stiffness", "damping"))
    support = ModalSupport(name="frame", M=M, K=K, D=D, points=[[[1.0], [0.0]]])
    second = Scene(gravity=numbers.gravity, support=support, pendulum=_hung(entries, "frame[0]"))
    return Twins(
        "modal", _on_cart(numbers, entries, cart), _on_structure(second), True, numbers.extreme, _same(entries)
    )


def rods(numbers: Numbers) -> Twins:
    """A cart whose spring has the stiffness of a swing's rods, W/l, more than the swing; at small angles."""
    entries, length = pendula(numbers), numbers.length()
    cart = cart_numbers(numbers, entries)
    weight = numbers.gravity * (cart["mass"] + sum(e.mass * p.count for p in entries for e in p.links))
    second = Scene(gravity=numbers.gravity, support=Swing(name="swing", length=length, **cart), pendulum=entries)
    first = _on_cart(numbers, entries, {**cart, "stiffness": cart["stiffness"] + weight / length})
    return Twins("rods", first, _on_structure(second), False, numbers.extreme, _same(entries, "mass"))


def platform(numbers: Numbers) -> Twins:
    """A platform whose pendula hang from its centre of mass without joint springs: heave and roll are uncoupled."""
    entries = pendula(numbers, loose=True, single=True)
    cart = cart_numbers(numbers, entries)
    hung = cart["mass"] + sum(e.mass for p in entries for e in p.links)
    rate, unit = numbers.rate(), numbers.unit
    stiffness = Planar(sway=cart["stiffness"], heave=361.0 * hung * rate**2, roll=997.0 * hung * (unit * rate) ** 2)
    support = Platform(
        name="ship",
        mass=cart["mass"],
        inertia=hung * unit**2,
        stiffness=stiffness,
        damping=Planar(sway=cart["damping"]),
    )
    second = Scene(gravity=numbers.gravity, support=support, pendulum=entries)
    places = (*_same(entries), ("support.mass", "support.mass"), ("support.stiffness", "support.stiffness.sway"))
    twin = _on_structure(second, beside=2)
    return Twins("platform", _on_cart(numbers, entries, cart), twin, False, numbers.extreme, places)


def _chain(numbers: Numbers, top: Any = None) -> Links:
    rng = numbers.rng
    damped, sprung = rng.random() < 0.5, rng.random() < 0.5
    links = [link(numbers, damped=damped, sprung=sprung) for _ in range(rng.randint(2, 5))]
    return [(top or links[0]).replace(drag=0.0), *links[1:]]


def _alone(numbers: Numbers, links: Links) -> Side:
    return Side(Scene(gravity=numbers.gravity, pendulum=[Pendulum(links=links)]), "joint_torques", ON_CHAIN)


def tilt(numbers: Numbers) -> Twins:
    """The first link of a chain as a board that tilts, from whose lower end the others hang."""
    links = _chain(numbers)
    top, below = links[0], links[1:]
    board = Tilt(
        name="board",
        mass=top.mass,
        inertia=top.inertia,
        centre=(0.0, top.centre),
        stiffness=top.stiffness,
        damping=top.damping,
    )
    second = Scene(gravity=numbers.gravity, support=board, pendulum=[Pendulum(links=below, position=(0.0, top.length))])
    twin, places = Side(second, "coordinate_forces", ON_BOARD), _one_above(links)
    return Twins("tilt", _alone(numbers, links), twin, True, numbers.extreme, places)


def swing(numbers: Numbers) -> Twins:
    """The bob on top of a chain as a swing, whose coordinate is the length of the arc."""
    mass, length = numbers.mass(), numbers.length()
    links = _chain(numbers, Bob(mass=mass, length=length))
    links[1] = links[1].replace(stiffness=0.0, damping=0.0)
    second = Scene(
        gravity=numbers.gravity,
        support=Swing(name="swing", mass=mass, length=length),
        pendulum=[Pendulum(links=links[1:])],
    )
    twin = Side(second, "coordinate_forces", ON_BOARD, size=1 / length)
    places = _one_above(links)
    return Twins("swing", _alone(numbers, links), twin, False, numbers.extreme, places)


def torsion(numbers: Numbers) -> Twins:
    """Joint springs and dampers as torsion between links, the cart's spring as one between points."""
    entries = pendula(numbers, single=True)
    cart = cart_numbers(numbers, entries)
    plain, joined = [], []
    for p, entry in enumerate(entries):
        plain.append(entry.replace(links=[each.replace(stiffness=0.0, damping=0.0) for each in entry.links]))
        for i, each in enumerate(entry.links):
            if each.stiffness or each.damping:
                above = f"pendulum[{p}].links[{i - 1}]" if i else "ground"
                between = (above, f"pendulum[{p}].links[{i}]")
                joined.append(Spring(kind="torsion", between=between, stiffness=each.stiffness, damping=each.damping))
    joined.append(Spring(between=("cart", "ground"), stiffness=cart["mass"] * numbers.rate() ** 2))
    first = _on_cart(numbers, entries, {**cart, "stiffness": joined[-1].stiffness})
    support = Cart(mass=cart["mass"], damping=cart["damping"])
    second = Scene(gravity=numbers.gravity, support=support, pendulum=plain, spring=joined)
    last = f"spring[{len(joined) - 1}].stiffness"
    places = (*_same(entries), ("support.mass", "support.mass"), ("support.stiffness", last))
    return Twins("torsion", first, _on_structure(second), True, numbers.extreme, places)


def entries(numbers: Numbers) -> Twins:
    """The same cart, which may be massless, or fixed support; counts as several entries, bobs and rods as bodies."""
    rng, hung = numbers.rng, pendula(numbers, standing=True)
    cart = cart_numbers(numbers, hung)
    if rng.random() < 0.3:
        cart["mass"] = 0.0
        hung = [_with_inertia(entry) for entry in hung]
    support = Cart(**cart) if rng.random() < 0.8 else Fixed()
    first = Scene(gravity=numbers.gravity, support=support, pendulum=hung)
    second = first.replace(pendulum=list(_each_alone(hung)))
    drive, outputs = ("cart_force", ON_CART) if first.cart else ("joint_torques", ON_CHAIN)
    places = tuple((f"support.{name}",) * 2 for name in ("mass", "stiffness")) if cart["mass"] and first.cart else ()
    sides = Side(first, drive, outputs), Side(second, drive, outputs)
    return Twins("entries", *sides, True, numbers.extreme, places)


def _with_inertia(entry: Pendulum) -> Pendulum:
    """Bobs alone let a massless cart follow without any force."""
    top = entry.links[0]
    rod = Rod(mass=top.mass, length=top.length, stiffness=top.stiffness, damping=top.damping, drag=top.drag)
    return entry.replace(links=[rod, *entry.links[1:]])


def _each_alone(hung: list[Pendulum]) -> Iterator[Pendulum]:
    for entry in hung:
        links = [
            Body(
                mass=each.mass,
                length=each.length,
                centre=each.centre,
                inertia=each.inertia,
                damping=each.damping,
                stiffness=each.stiffness,
                drag=each.drag,
            )
            for each in entry.links
        ]
        yield from [entry.replace(links=links, count=1)] * entry.count


WAYS: tuple[Callable[[Numbers], Twins], ...] = (
    springs, beside, modal, rods, platform, tilt, swing, torsion, entries
)  # fmt: skip


def twins(seed: int) -> Twins:
    """The pair of this number: every way in turn, half of them with extreme numbers."""
    rng = random.Random(f"twins {seed}")
    return WAYS[seed % len(WAYS)](Numbers(rng, extreme=seed // len(WAYS) % 2 == 1))
