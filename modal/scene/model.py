"""A scene: a support and its pendula, checked when made and immutable.

    gravity g;  a fixed support or a cart on a straight horizontal rail;  pendula, each a chain of links (`links`).

All numbers are SI; angles in a scene file are degrees from the downward vertical.  Dry friction on the rail opposes
sliding with a constant force, and holds what is at rest up to that limit.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from os import PathLike, fspath
from typing import Any, Literal
from unicodedata import category

from modal.errors import SceneError
from modal.report import Displayed, Summary, deferred
from modal.scene.features import DRAG, DRIVES, FRICTION, LOSS, features
from modal.scene.links import AnyLink, Bob, Body, Rod
from modal.scene.motion import FORCE, ConstantForce, Force, Moved
from modal.scene.points import point_problems
from modal.scene.validation import (
    COUNT,
    NON_NEGATIVE,
    POSITIVE,
    REAL,
    Part,
    after,
    any_kind,
    field,
    list_of,
    number,
    one_of,
    one_or_list,
    optional,
    parts,
    parts_or_none,
)

MAX_CHAIN = 20_000
MAX_LINKS = 10_000_000
Way = Literal["down", "up"]
RATIO = number(ge=0, lt=1)


class InitialCondition(Part):
    """The initial condition of a simulation: one angle (deg) and one rate (deg/s) per link, top to bottom.

    `azimuths_deg` turns each link's plane about the vertical; only a scene in space may have it.

    >>> from modal import Bob, InitialCondition, Pendulum
    >>> start = InitialCondition(angles_deg=[30.0, 0.0])
    >>> Pendulum(links=[Bob(mass=1.0, length=1.0, count=2)], start=start).start.angles_deg
    (30.0, 0.0)
    """

    angles_deg: tuple[float, ...] = field(list_of(REAL))
    rates_deg: tuple[float, ...] | None = field(optional(list_of(REAL)), default=None)
    azimuths_deg: tuple[float, ...] | None = field(optional(list_of(REAL)), default=None)


class Pendulum(Part):
    """A chain of links, top to bottom, in `count` copies.

    `equilibrium` gives for each link whether it points down or up; the scene is linearized about that equilibrium.

    >>> from modal import Bob, Pendulum, Rod
    >>> pendulum = Pendulum(links=[Rod(mass=1.0, length=0.5), Bob(mass=1.0, length=1.0)], count=3)
    >>> pendulum.n_links, pendulum.ways
    (2, ('down', 'down'))
    """

    links: tuple[AnyLink, ...] = field(parts(any_kind(Bob, Rod, Body)))
    count: int = field(COUNT, default=1)
    equilibrium: tuple[Way, ...] | None = field(optional(list_of(one_of("down", "up"))), default=None)
    start: InitialCondition | None = field(optional(InitialCondition.schema()), default=None)

    @property
    def n_links(self) -> int:
        """Number of links of one copy, counting repeats."""
        return sum(link.count for link in self.links)

    @property
    def ways(self) -> tuple[Way, ...]:
        """The direction of every link of one copy at equilibrium."""
        hanging: tuple[Way, ...] = ("down",)
        return self.equilibrium or hanging * self.n_links

    def problems(self) -> Iterator[str]:
        """Lists that do not fit the links, and a last link on which gravity does not act."""
        if self.n_links > MAX_CHAIN:
            yield f".links: has {self.n_links} links, counting repeats: at most {MAX_CHAIN}"
            return
        if self.links[-1].centre == 0:
            at = f".links[{len(self.links) - 1}].centre = 0.0"
            yield f"{at}: must be positive in the last link, or gravity does not act on it"
        lists = [("equilibrium", self.equilibrium), *((f"start.{name}", values) for name, values in self.start or ())]
        for name, values in lists:
            if values is not None and len(values) != self.n_links:
                yield f".{name}: has {len(values)} values for {self.n_links} links"


class Fixed(Part):
    """A support that does not move.

    >>> from modal import Bob, Fixed, Pendulum, Scene
    >>> scene = Scene(gravity=9.81, support=Fixed(), pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0)])])
    >>> scene.support == Scene(gravity=9.81, pendulum=scene.pendulum).support  # supports are fixed unless given
    True
    """

    kind: Literal["fixed"] = field(one_of("fixed"), default="fixed")


class Cart(Part):
    """A cart on the rail: mass (kg, may be 0), damper (N s/m) and spring (N/m) to the ground, and dry friction.

    Friction is either a force, `friction` (N), or `friction_coefficient` times the size of the rail's reaction: the
    rail holds the cart from above and below.

    >>> from modal import Bob, Cart, Pendulum, Scene, natural_frequencies
    >>> scene = Scene(gravity=9.0, support=Cart(mass=1.0), pendulum=[Pendulum(links=[Bob(mass=3.0, length=1.0)])])
    >>> [round(float(omega), 12) for omega in natural_frequencies([scene])[0]]  # 0 and √(g/l (1 + 3/1))
    [0.0, 6.0]
    """

    kind: Literal["cart"] = field(one_of("cart"), default="cart")
    mass: float = field(NON_NEGATIVE)
    damping: float = field(NON_NEGATIVE, default=0.0)
    stiffness: float = field(NON_NEGATIVE, default=0.0)
    friction: float = field(NON_NEGATIVE, default=0.0)
    friction_coefficient: float = field(NON_NEGATIVE, default=0.0)

    @property
    def has_friction(self) -> bool:
        """Whether dry friction acts on the rail."""
        return self.friction > 0 or self.friction_coefficient > 0

    def problems(self) -> Iterator[str]:
        """Friction given twice."""
        if self.friction and self.friction_coefficient:
            yield f".friction_coefficient = {self.friction_coefficient!r}: cannot be combined with friction"


def _one_line(title: str) -> str:
    if any(category(letter) in {"Cc", "Zl", "Zp"} for letter in title):
        raise ValueError("must be one line without control characters")
    return title


class Scene(Displayed, Part):
    """Gravity (m/s²), a support and at least one pendulum, in the vertical plane or in space.

    `damping_ratio` ζ is that of all modes of the scene without dampers, or of each by its number in the table; it is
    added to the dampers (`modal.assembly.modal_damping`).

    >>> from modal import Bob, Pendulum, Scene
    >>> scene = Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0)], count=5)])
    >>> scene.n_pendula, scene.support.kind
    (5, 'fixed')
    >>> scene.replace(gravity=1.62).gravity  # scenes are immutable: this is another one
    1.62
    """

    __slots__ = ("_features",)

    title: str = field(after(_one_line, {"type": "str", "max_length": 200}), default="")
    gravity: float = field(POSITIVE)
    space: Literal["plane", "space"] = field(one_of("plane", "space"), default="plane")
    support: Fixed | Cart | Moved = field(any_kind(Fixed, Cart, Moved), default=Fixed())
    damping_ratio: float | tuple[float, ...] = field(one_or_list(RATIO), default=0.0)
    pendulum: tuple[Pendulum, ...] = field(parts(Pendulum.schema()))
    force: tuple[Force, ...] = field(parts_or_none(FORCE), default=())

    @property
    def features(self) -> frozenset[str]:
        """The names of what it has (`modal.scene.features`), found once."""
        found: frozenset[str] | None = getattr(self, "_features", None)
        if found is None:
            object.__setattr__(self, "_features", found := features(self))
        return found

    @property
    def n_pendula(self) -> int:
        """Number of pendula, counting copies."""
        return sum(pendulum.count for pendulum in self.pendulum)

    @property
    def n_links(self) -> int:
        """Number of links in the whole scene, counting copies."""
        return sum(pendulum.count * pendulum.n_links for pendulum in self.pendulum)

    @property
    def has_damping(self) -> bool:
        """Whether anything in the linearized scene dissipates energy."""
        return not self.features.isdisjoint(LOSS)

    @property
    def has_modal_damping(self) -> bool:
        """Whether any mode has a damping ratio of its own."""
        return "damping_ratio" in self.features

    @property
    def has_dampers(self) -> bool:
        """Whether the cart or any joint has a damper, or any link linear drag."""
        return not self.features.isdisjoint(LOSS - {"damping_ratio"})

    @property
    def has_friction(self) -> bool:
        """Whether there is dry friction at a joint or on the rail."""
        return not self.features.isdisjoint(FRICTION)

    @property
    def is_gripped(self) -> bool:
        """Whether the rail alone has dry friction, which holds the cart in the end while the pendula swing on."""
        return self.has_friction and "joint_friction" not in self.features

    @property
    def has_drag(self) -> bool:
        """Whether there is drag on any link, linear or quadratic."""
        return not self.features.isdisjoint(DRAG)

    @property
    def frictionless(self) -> Scene:
        """The same scene without dry friction."""
        if not self.has_friction:
            return self
        still = self._with(friction=0.0)
        rail = {"friction": 0.0, "friction_coefficient": 0.0}
        return still.replace(support=self.support.replace(**rail)) if isinstance(self.support, Cart) else still

    @property
    def linearizable(self) -> Scene:
        """The same scene without what its linear equations leave out: drives, dry friction and quadratic drag."""
        scene = self.undriven.frictionless
        return scene._with(quadratic_drag=0.0) if "quadratic_drag" in scene.features else scene

    @property
    def is_driven(self) -> bool:
        """Whether any joint has a drive."""
        return not self.features.isdisjoint(DRIVES)

    @property
    def is_hoisted(self) -> bool:
        """Whether the length of any link changes in time."""
        return "hoist" in self.features

    def at(self, time: float) -> Scene:
        """The same scene with all lengths fixed at their values at a time (s)."""
        pendula = tuple(
            one.replace(links=tuple(link.replace(length=link.length_at(time), hoist=None) for link in one.links))
            for one in self.pendulum
        )
        return self.replace(pendulum=pendula) if self.is_hoisted else self

    @property
    def is_moved(self) -> bool:
        """Whether the support moves as prescribed."""
        return "moved_support" in self.features

    @property
    def still(self) -> Scene:
        """The same scene with its support at rest."""
        return self.replace(support=Fixed()) if self.is_moved else self

    @property
    def is_forced(self) -> bool:
        """Whether the support moves, or forces act that change in time."""
        return not self.features.isdisjoint({"moved_support", "force"})

    @property
    def unforced(self) -> Scene:
        """The same scene without forces that change in time."""
        constant = tuple(one for one in self.force if isinstance(one, ConstantForce))
        return self.replace(force=constant) if "force" in self.features else self

    @property
    def undriven(self) -> Scene:
        """The same scene without drives."""
        return self._with(drive=None) if self.is_driven else self

    @property
    def conservative(self) -> Scene:
        """The same scene without drives, dampers, dry friction and drag."""
        loose = self._with(drive=None, damping=0.0, friction=0.0, drag=0.0, quadratic_drag=0.0)
        still, cart = loose.replace(damping_ratio=0.0), self.support
        rail = {"damping": 0.0, "friction": 0.0, "friction_coefficient": 0.0}
        return still.replace(support=cart.replace(**rail)) if isinstance(cart, Cart) else still

    @property
    def in_plane(self) -> Scene:
        """The same scene in the plane of the rail, without azimuths in its starts."""
        pendula = (one.replace(start=one.start and one.start.replace(azimuths_deg=None)) for one in self.pendulum)
        return self.replace(space="plane", pendulum=tuple(pendula))

    def _with(self, **joint: Any) -> Scene:
        """The same scene with these numbers at every joint."""
        links = (tuple(link.replace(**joint) for link in one.links) for one in self.pendulum)
        pendula = (one.replace(links=own) for one, own in zip(self.pendulum, links, strict=True))
        return self.replace(pendulum=tuple(pendula))

    @property
    def stands(self) -> bool:
        """Whether any link is inverted at equilibrium."""
        return "inverted" in self.features

    def links(self) -> Iterator[AnyLink]:
        """Every link as specified: copies and runs of equal links once each."""
        return (link for pendulum in self.pendulum for link in pendulum.links)

    def _summary(self) -> Summary:
        found: Summary = deferred("modal.scene.summary:summarize")(self)
        return found

    def problems(self) -> Iterator[str]:
        """Too many links, and features that this space does not allow."""
        if self.n_links > MAX_LINKS:
            yield f"the scene has {self.n_links} links in all: at most {MAX_LINKS}"
        if self.has_modal_damping and self.is_hoisted:
            yield ".damping_ratio: belongs to modes of constant lengths, and a hoist changes them: give dampers instead"
        for index, pendulum in enumerate(self.pendulum):
            if self.space == "plane" and pendulum.start and pendulum.start.azimuths_deg:
                yield f'.pendulum[{index}].start.azimuths_deg: needs space = "space"'
            for at, link in enumerate(pendulum.links if self.space == "space" else ()):
                if link.drive:
                    yield f'.pendulum[{index}].links[{at}].drive: needs space = "plane"'
                if link.friction:
                    yield f'.pendulum[{index}].links[{at}].friction = {link.friction!r}: needs space = "plane"'
        yield from self._rail_problems()
        for at, force in enumerate(self.force):
            yield from (f'.force[{at}].on = "{force.on}": {words}' for words in point_problems(self, force.on))
            if self.space == "space":
                yield f'.force[{at}]: needs space = "plane"'

    def _rail_problems(self) -> Iterator[str]:
        if not isinstance(self.support, Cart) or not self.support.has_friction:
            return
        name = "friction" if self.support.friction else "friction_coefficient"
        at = f".support.{name} = {getattr(self.support, name)!r}"
        if self.space == "space":
            yield f'{at}: needs space = "plane"'
        if {"rail_coefficient", "escapement"} <= self.features:
            yield f"{at}: cannot be combined with escapements, whose kicks the rail would feel: give friction"


def validate_scene(given: object) -> Scene:
    """The scene itself; SceneError for anything else, with a hint."""
    if isinstance(given, Scene):
        return given
    meant = f': load("{fspath(given)}") gives one' if isinstance(given, str | PathLike) else ""
    raise SceneError([f"a Scene is required, not {type(given).__name__}{meant}"])


def validate_scenes(given: object) -> Sequence[Scene]:
    """A list of scenes; SceneError for anything else, with the place of what is none."""
    if isinstance(given, str) or not isinstance(given, Sequence):
        raise SceneError([f"a list of Scenes is required, not {type(given).__name__}"])
    wrong = [k for k, one in enumerate(given) if not isinstance(one, Scene)]
    if wrong:
        raise SceneError([f"scenes[{wrong[0]}]: a Scene is required, not {type(given[wrong[0]]).__name__}"])
    return given


def scene_from(data: object) -> Scene:
    """The scene described by nested mappings, as in a scene file; SceneError lists every mistake."""
    return Scene.model_validate(data)


def describe(part: Part) -> dict[str, Any]:
    """The mapping that `scene_from` reads back as an equal object: kinds first, without defaults."""
    found: dict[str, Any] = {"kind": part.kind} if hasattr(part, "kind") else {}
    for name, own in part.fields.items():
        value = getattr(part, name)
        if name != "kind" and value is not None and (own.is_required or value != own.default):
            found[name] = _plain(value)
    return found


def _plain(value: Any) -> Any:
    if isinstance(value, Part):
        return describe(value)
    return [_plain(item) for item in value] if isinstance(value, tuple) else value
