"""Free-body diagrams of a scene: the support and every link with the forces and moments that act on them.

A joint exerts opposite forces and moments on its two parts. x is along the rail and z down (y in paper 000), θ from the
vertical towards +x, and moments are positive in the direction of increasing θ. Names of letters are those of
`modal.symbolic`: `F_1_2` with an index of pendulum and link, `xddot_1_2` for its second derivative.

All efforts on parts are defined here: `modal.symbolic.newton_euler` writes the Newton–Euler equations from them,
`modal.plotting.plot_free_body` draws the diagrams.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple

from modal.errors import SceneError
from modal.report import Displayed, Summary
from modal.scene.capabilities import require
from modal.scene.doors import checked
from modal.scene.links import AnyLink, VanDerPol
from modal.scene.model import Scene
from modal.scene.points import places_of
from modal.scene.titles import title_of

LETTERS = ("own", "paper")
"""Whose letters the parts have: the toolkit's own, or those of paper 000."""
Where = Literal["centre", "upper", "lower", "point", "support"]


class Effort(NamedTuple):
    """A force or a moment on a part, at a point of it: its components by the names of their letters, "" for none.

    They act along +x, down and in the direction of increasing θ, or reversed with `sign` −1. `kind` is "weight",
    "joint" (a joint's force or moment), "normal" (of the rail), "held" (spring, damper and friction between cart and
    rail), "drag" or "applied"; `pendulum` is the number, from 0, of the pendulum that acts on a support. `below` is the
    distance (m) of a "point" from the upper joint, `reach` the name of its letter.
    """

    kind: str
    at: Where
    sign: int
    along: str = ""
    down: str = ""
    turning: str = ""
    pendulum: int = 0
    reach: str = ""
    below: float = 0.0


@dataclass(frozen=True, eq=False, repr=False)
class FreeBody(Displayed):
    """A part by its words, its kind ("cart", "fixed", "moved", "bob", "rod" or "body") and all efforts on it.

    `index` is the index of its letters, `place` the numbers of its pendulum and its link from 0. `mass`, `length`,
    `centre` and `inertia` are names of letters, "" if it has none; `link` is the link of the scene.
    """

    words: str
    kind: str
    index: tuple[int, ...]
    place: tuple[int, int]
    efforts: tuple[Effort, ...]
    mass: str = ""
    length: str = ""
    centre: str = ""
    inertia: str = ""
    link: AnyLink | None = None
    above: bool = False
    """Whether it hangs from another link."""

    def _summary(self) -> Summary:
        rows = ((effort.kind, effort.at, _effort_words(effort)) for effort in self.efforts)
        title = f"{self.words[:1].upper()}{self.words[1:]}, taken apart"
        return Summary(title, [("kind", self.kind)], ("what acts", "where", "letters"), rows, len(self.efforts))

    def with_index(self, letter: str) -> str:
        """A letter with its index."""
        return "_".join((letter, *map(str, self.index)))


@dataclass(frozen=True, eq=False, repr=False)
class FreeBodies(Displayed):
    """All parts of a scene, the support first, then link by link from the top of each pendulum.

    `letters` names their notation; `downward` is that of the second axis, z or y.
    """

    scene: Scene
    letters: str
    parts: tuple[FreeBody, ...]

    @property
    def downward(self) -> str:
        """The letter of the axis that points down."""
        return "y" if self.letters == "paper" else "z"

    @property
    def support(self) -> FreeBody:
        """The cart or the fixed support."""
        return self.parts[0]

    @property
    def pendula(self) -> list[list[FreeBody]]:
        """The links of every pendulum."""
        chains: list[list[FreeBody]] = []
        for part in self.parts[1:]:
            if not part.above:
                chains.append([])
            chains[-1].append(part)
        return chains

    def of(self, part: FreeBody) -> FreeBody | None:
        """Return the link below a link, None at the end."""
        chain = self.pendula[part.place[0]]
        return chain[part.place[1] + 1] if part.place[1] + 1 < len(chain) else None

    def _summary(self) -> Summary:
        rows = ((part.words, ", ".join(_effort_words(effort) for effort in part.efforts)) for part in self.parts)
        return Summary(f"{title_of(self.scene)}, taken apart", [], ("part", "acts on it"), rows, len(self.parts))


def _effort_words(effort: Effort) -> str:
    names = [name for name in (effort.along, effort.down, effort.turning) if name]
    return ", ".join(f"{'-' if effort.sign < 0 else ''}{name}" for name in names)


@checked
def free_bodies(scene: Scene, letters: str = "own") -> FreeBodies:
    """Return the parts of a scene in the plane, with the letters of LETTERS.

    Raise SceneError for unsupported scenes (`CAPABILITIES["a free-body diagram"]`).

    >>> from modal import load
    >>> from modal.scene import free_bodies
    >>> bodies = free_bodies(load("paper-cart-1"), "paper")
    >>> [part.words for part in bodies.parts]
    ['cart', 'link 1', 'link 2']
    >>> [(effort.sign, effort.along, effort.down) for effort in bodies.parts[2].efforts]
    [(1, '', 'm_1_2 g'), (-1, 'R_Px_1', 'R_Py_1')]
    """
    if letters not in LETTERS:
        raise SceneError([f"letters {letters}: must be one of {', '.join(LETTERS)}"])
    require(scene, "a free-body diagram")
    chains = [pendulum.chain for pendulum in scene.hanging]
    has_pendulum_index = len(chains) > 1 or letters == "paper"
    parts = [
        _link(scene, chain, p, i, (p + 1, i + 1) if has_pendulum_index else (i + 1,), letters, len(chains) > 1)
        for p, chain in enumerate(chains)
        for i in range(len(chain))
    ]
    support = _support(scene, chains, letters, has_pendulum_index)
    acting = _applied_efforts(scene, [part.place for part in parts])
    with_forces = (
        replace(part, efforts=(*part.efforts, *acting.get(k, ()))) for k, part in enumerate((support, *parts), -1)
    )
    return FreeBodies(scene, letters, tuple(with_forces))


def _applied_efforts(scene: Scene, places: list[tuple[int, int]]) -> dict[int, list[Effort]]:
    """The forces and torques of a scene by the link that they act on, −1 for the support: F_1, F_2 and so on.

    A torque on a joint acts reversed on the part that the link hangs from.
    """
    efforts: dict[int, list[Effort]] = {}
    for number, force in enumerate(scene.force, 1):
        name, spots = f"F_{number}", places_of(scene, force.on)
        if not spots:
            efforts.setdefault(-1, []).append(Effort("applied", "centre", 1, along=name))
        for link, upper_link, distance in spots:
            acting = efforts.setdefault(link, [])
            if force.direction == "torque":
                acting.append(Effort("applied", "upper" if distance is None else "centre", 1, turning=name))
                if distance is None:
                    at: Where = "lower" if upper_link >= 0 else "support"
                    pendulum = places[link][0]
                    efforts.setdefault(upper_link, []).append(
                        Effort("applied", at, -1, turning=name, pendulum=pendulum)
                    )
                continue
            reach = {} if distance is None else {"reach": f"s_{number}", "below": distance}
            at = "centre" if distance is None else "point"
            if force.direction == "horizontal":
                acting.append(Effort("applied", at, 1, along=name, **reach))  # type: ignore[arg-type]
            else:
                acting.append(Effort("applied", at, -1, down=name, **reach))  # type: ignore[arg-type]
    return efforts


def force_names(letters: str, index: tuple[int, ...]) -> tuple[str, str, int]:
    """The letters of a joint's force along the rail and down, and the sign with which it acts on the link below.

    Paper 000 has R_B at the support, drawn on the first link, and R_P between links, drawn on the upper one; where a
    pendulum has more links, R_P2, R_P3 and so on follow.
    """
    tail = "_".join(map(str, index))
    if letters == "own":
        return f"X_{tail}", f"Z_{tail}", 1
    p, link = index
    pivot = "B" if link == 1 else "P" if link == 2 else f"P{link - 1}"
    return f"R_{pivot}x_{p}", f"R_{pivot}y_{p}", 1 if link == 1 else -1


def has_moment(link: AnyLink) -> bool:
    """Whether a moment acts at the upper joint of a link: of a rotor, a spring, a damper, friction, a drive, a law."""
    return bool(link.rotor_inertia or link.stiffness or link.damping or link.friction or link.drive or link.law)


def _joint(letters: str, index: tuple[int, ...], link: AnyLink, on_lower: bool, at: Where, p: int) -> Iterator[Effort]:
    """The force and the moment of the joint above a link, on that link or reversed on what it hangs from."""
    x, z, sign = force_names(letters, index)
    yield Effort("joint", at, sign if on_lower else -sign, along=x, down=z, pendulum=p)
    if has_moment(link):
        tail = "_".join(map(str, index))
        yield Effort("joint", at, 1 if on_lower else -1, turning=f"M_{tail}", pendulum=p)


def _link(
    scene: Scene, chain: Sequence[AnyLink], p: int, i: int, index: tuple[int, ...], letters: str, several: bool
) -> FreeBody:
    link, tail = chain[i], "_".join(map(str, index))
    efforts = [Effort("weight", "centre", 1, down=f"m_{tail} g"), *_joint(letters, index, link, True, "upper", p)]
    if i + 1 < len(chain):
        efforts += _joint(letters, (*index[:-1], i + 2), chain[i + 1], False, "lower", p)
    if link.drag or link.quadratic_drag or link.point_force:
        efforts.append(Effort("drag", "centre", 1, along=f"D_x_{tail}", down=f"D_{_down(letters)}_{tail}"))
    words = f"link {i + 1} of pendulum {p + 1}" if several else f"link {i + 1}"
    is_body = link.kind == "body"
    return FreeBody(
        words,
        link.kind,
        index,
        (p, i),
        tuple(efforts),
        f"m_{tail}",
        f"l_{tail}",
        f"c_{tail}" if is_body else "",
        f"I_{tail}" if is_body else "",
        link,
        i > 0,
    )


def _down(letters: str) -> str:
    return "y" if letters == "paper" else "z"


def _support(scene: Scene, chains: Sequence[Sequence[AnyLink]], letters: str, has_pendulum_index: bool) -> FreeBody:
    efforts: list[Effort] = []
    cart = scene.cart
    if cart is not None:
        efforts = [Effort("weight", "centre", 1, down="m_c g"), Effort("normal", "support", -1, down=normal(letters))]
        if cart.stiffness or cart.damping or cart.has_friction:
            efforts.append(Effort("held", "centre", 1, along="H"))
    for p, chain in enumerate(chains):
        efforts += _joint(letters, (p + 1, 1) if has_pendulum_index else (1,), chain[0], False, "support", p)
    kind = "cart" if cart is not None else "moved" if scene.is_moved else "fixed"
    words = {"cart": "cart", "moved": "moved support", "fixed": "fixed support"}[kind]
    return FreeBody(words, kind, (), (-1, -1), tuple(efforts), "" if cart is None else "m_c")


def normal(letters: str) -> str:
    """The letter of the rail's push up on the cart, on all its wheels together."""
    return "R" if letters == "paper" else "N"


class JointMoment(NamedTuple):
    """The parts of the moment of a joint, each by the name of its letter, "" where it is not there.

    M = −J γ'' − k γ − d γ' + e (1 − (γ/γ₀)²) γ' + f + K + τ(γ, γ'), γ the angle of the link less that of the one
    above and its value at equilibrium (`upright`: how many half turns that is).  f is dry friction, at most `friction`;
    K the kicks.
    """

    rotor: str
    spring: str
    damper: str
    drive: str
    width: str
    friction: str
    kicks: str
    upright: int
    law: str


def joint_law(bodies: FreeBodies, part: FreeBody) -> JointMoment | None:
    """The moment of the joint above a link; None if there is none."""
    link: Any = part.link
    if link is None or not has_moment(link):
        return None
    pendula = bodies.scene.hanging
    ways = [int(way == "up") for way in pendula[part.place[0]].ways]
    i = part.place[1]
    drives = isinstance(link.drive, VanDerPol)
    return JointMoment(
        part.with_index("J") if link.rotor_inertia else "",
        part.with_index("k") if link.stiffness else "",
        part.with_index("d") if link.damping else "",
        part.with_index("e") if drives else "",
        part.with_index("gamma") if drives else "",
        part.with_index("f") if link.friction else "",
        part.with_index("K") if link.drive and not drives else "",
        ways[i] - (ways[i - 1] if i else 0),
        part.with_index("tau") if link.law else "",
    )
