"""Scenes at the limits of what can be specified: families that sweep one number each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from modal import Bob, Cart, Fixed, Pendulum, Rod, Scene

G = 9.81
TEN = 10


class Family(NamedTuple):
    """A sweep: its scenes by parameter, the axis label, and whether splittings are compared rather than ω."""

    name: str
    axis: str
    scene: Callable[[float], Scene]
    parameters: Sequence[float]
    splitting: bool = False


def decades(first: int, last: int, step: int = 2) -> tuple[float, ...]:
    return tuple(10.0**k for k in range(first, last + 1, step))


def chain(links: Sequence[Bob | Rod], support: Cart | None = None, **more: object) -> Scene:
    return Scene(gravity=G, support=support or Fixed(), pendulum=[Pendulum(links=links, **more)])


def equal(kind: type[Bob | Rod], n: float) -> Scene:
    return chain([kind(mass=1.0, length=1.0, count=int(n))])


def geometric(what: str, ratio: float) -> Scene:
    """Ten bobs; mass or length of the last over that of the first is `ratio`."""
    values = [{"mass": 1.0, "length": 1.0} | {what: ratio ** (k / (TEN - 1))} for k in range(TEN)]
    return chain([Bob(**value) for value in values])


def odd(what: str, at: int, ratio: float) -> Scene:
    """Ten bobs, equal except one."""
    values = [{"mass": 1.0, "length": 1.0} | ({what: ratio} if k == at else {}) for k in range(TEN)]
    return chain([Bob(**value) for value in values])


def four_kinds(mass: float) -> Scene:
    """A cart with chains of one to four different rods."""
    chains = [Pendulum(links=[Rod(mass=1.0 + k, length=1.0 + 0.1 * k, count=1 + k)]) for k in range(4)]
    return Scene(gravity=G, support=Cart(mass=mass), pendulum=chains)


def fallen(gravity: float) -> Scene:
    return chain([Rod(mass=1.0, length=1.0, count=TEN)], Cart(mass=1.0)).replace(gravity=gravity)


def detuned(delta: float, cart: float = 1.0) -> Scene:
    """Three bobs of lengths 1, 1 + δ and 1 + 2δ on a cart."""
    bobs = [Pendulum(links=[Bob(mass=1.0, length=1.0 + k * delta)]) for k in range(3)]
    return Scene(gravity=G, support=Cart(mass=cart), pendulum=bobs)


def sprung_joints(stiffness: float) -> Scene:
    return chain([Rod(mass=1.0, length=1.0, stiffness=stiffness)] + [Rod(mass=1.0, length=1.0)] * 4)


def sprung_cart(stiffness: float) -> Scene:
    return chain([Rod(mass=1.0, length=1.0)] * 5, Cart(mass=1.0, stiffness=stiffness))


def damped_joints(damping: float) -> Scene:
    return chain([Rod(mass=1.0, length=1.0, damping=damping)] + [Rod(mass=1.0, length=1.0)] * 3)


def damped_cart(damping: float) -> Scene:
    return chain([Rod(mass=1.0, length=1.0)] * 3, Cart(mass=1.0, damping=damping))


def near_buckling(above: float) -> Scene:
    """Three inverted bobs on equal joint springs, stiffer than the critical ones by this fraction."""
    steps = np.eye(3) - np.eye(3, k=-1)
    weight = np.sqrt(G * np.array([3.0, 2.0, 1.0]))
    critical = 1.0 / float(np.linalg.eigvalsh(steps.T @ steps / weight / weight[:, None])[0])
    return chain([Bob(mass=1.0, length=1.0, stiffness=critical * (1 + above))] * 3, equilibrium=("up",) * 3)


def crowd(n: float, spread: float, mass: float = 1.0) -> Scene:
    """A cart with n different bobs; masses and lengths over `spread` decades either way."""
    values = 10.0 ** np.random.default_rng(1).uniform(-spread, spread, (int(n), 2))
    bobs = [Pendulum(links=(Bob(mass=m, length=l),)) for m, l in values.tolist()]
    return Scene(gravity=G, support=Cart(mass=mass), pendulum=bobs)


def copies(n: float) -> Scene:
    double = Pendulum(links=(Rod(mass=1.0, length=1.0, count=2),), count=int(n))
    return Scene(gravity=G, support=Cart(mass=1.0), pendulum=[double])


RATIOS, STRENGTHS, DETUNINGS = decades(-16, 16), decades(-12, 12), decades(-15, -1, 1)
PLACES = {"top": 0, "middle": TEN // 2, "bottom": TEN - 1}
LENGTHS = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 10_000)

FAMILIES = (
    Family("equal bobs", "bobs in a chain", partial(equal, Bob), LENGTHS),
    Family("equal rods", "rods in a chain", partial(equal, Rod), LENGTHS),
    Family("mass ratio", "mass of last bob / first of ten", partial(geometric, "mass"), RATIOS),
    Family("length ratio", "length of last link / first of ten", partial(geometric, "length"), RATIOS),
    *(
        Family(f"odd {what}, {where}", f"{what} of one / the other nine", partial(odd, what, at), decades(-16, 16, 8))
        for what in ("mass", "length")
        for where, at in PLACES.items()
    ),
    Family("cart", "mass of the cart (kg)", four_kinds, (0.0, *STRENGTHS)),
    Family("gravity", "gravity (m/s²)", fallen, decades(-6, 6)),
    Family("detuning", "relative detuning of three pendula", detuned, DETUNINGS, splitting=True),
    Family("detuning, heavy cart", "relative detuning", partial(detuned, cart=1e12), DETUNINGS, splitting=True),
    Family("joint spring", "torsion spring at the top (N m/rad)", sprung_joints, STRENGTHS),
    Family("cart spring", "spring on the cart (N/m)", sprung_cart, STRENGTHS),
    Family("joint damper", "damper at the top joint (N m s/rad)", damped_joints, STRENGTHS),
    Family("cart damper", "damper on a free cart (N s/m)", damped_cart, STRENGTHS),
    Family("near buckling", "spring above the critical one (relative)", near_buckling, DETUNINGS),
    Family("different pendula", "pendula on a cart", partial(crowd, spread=0.02), (10, 100, 1000, 100_000)),
    Family("extreme pendula", "pendula on a cart", partial(crowd, spread=8.0), (10, 100, 1000, 100_000)),
    Family("equal pendula", "double pendula on a cart", copies, (10, 100, 1000, 100_000)),
)
SHOWN = (
    "equal rods", "mass ratio", "length ratio", "cart spring",
    "detuning", "joint spring", "joint damper", "near buckling",
)  # fmt: skip
