"""A scene: a support and its pendula, immutable and checked on construction.

    gravity g;  a fixed support or a cart on a straight horizontal rail;  pendula, each a chain of links (`links`).

All numbers are SI; angles in a scene file are degrees from the downward vertical. Dry friction on the rail opposes
sliding with a constant force, and holds the cart at rest up to that limit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, Literal
from unicodedata import category

from modal.errors import SceneError
from modal.report import Displayed, Summary, deferred
from modal.scene.doors import problem_of
from modal.scene.features import DRAG, DRIVES, FRICTION, LOSS, features, hangs_plainly
from modal.scene.links import AnyLink, Bob, Body, Link, Rod, is_lossy
from modal.scene.motion import FORCE, AppliedForce, ConstantForce, Force, Ground, Moved, SupportMotion
from modal.scene.points import point_problems
from modal.scene.stored import (
    OneOrSeveral,
    OneOrSeveralKinds,
    Pair,
    PartSignature,
    Several,
    SeveralKinds,
    SeveralOrNone,
)
from modal.scene.supports import (
    PAIR,
    Cart,
    Fixed,
    Heave,
    ModalSupport,
    Placed,
    Platform,
    Spring,
    Swing,
    Tilt,
)
from modal.scene.validation import (
    COUNT,
    POSITIVE,
    REALS,
    REALS_OR_NONE,
    TRUTH,
    Part,
    any_kind,
    field,
    function_after,
    list_of,
    number,
    one_of,
    one_or_list,
    optional,
    parts,
    parts_later,
    parts_or_none,
    text,
)

if TYPE_CHECKING:
    from modal.extend import JointLaw
    from modal.scene.feedback import Feedback

CHAIN_LINKS_MAX = 20_000
"""Limit: links of one chain; more are refused."""
SCENE_LINKS_MAX = 10_000_000
"""Limit: links of a scene in all; more are refused."""
Way = Literal["down", "up"]
RATIO = number(ge=0, lt=1)


class InitialCondition(Part):
    """The initial condition of a simulation: one angle (deg) and one rate (deg/s) per link, top to bottom.

    `azimuths_deg` turns each link's plane about the vertical; only a scene in space may have it.  With `spread`, copy j
    starts at the phase ψ = 2πj/count of the pendulum's own first mode: the angles A cos ψ and the rates −A ω₁ sin ψ.

    >>> from modal import Bob, InitialCondition, Pendulum
    >>> start = InitialCondition(angles_deg=[30.0, 0.0])
    >>> Pendulum(links=[Bob(mass=1.0, length=1.0, count=2)], start=start).start.angles_deg
    (30.0, 0.0)
    """

    angles_deg: Several[float] = field(REALS, "from the vertical, one for each link", "°")
    rates_deg: SeveralOrNone[float] = field(REALS_OR_NONE, "one for each link, or all 0", "°/s", default=None)
    azimuths_deg: SeveralOrNone[float] = field(REALS_OR_NONE, "of each link's vertical plane", "°", default=None)
    spread: bool = field(TRUTH, "whether copies start evenly over a period of the first mode", default=False)


class Pendulum(Part):
    """A chain of links, top to bottom, in `count` copies.

    `equilibrium` gives for each link whether it points down or up; the scene is linearized about that equilibrium.
    `on` names the support from which it hangs, required if there are several; `position` is that of its first joint,
    (along, below) the support's origin as drawn (m).

    >>> from modal import Bob, Pendulum, Rod
    >>> pendulum = Pendulum(links=[Rod(mass=1.0, length=0.5), Bob(mass=1.0, length=1.0)], count=3)
    >>> pendulum.n_links, pendulum.ways
    (2, ('down', 'down'))
    """

    links: SeveralKinds[AnyLink, Link] = field(parts(any_kind(Bob, Rod, Body)), "from top to bottom")
    count: int = field(COUNT, "number of identical copies, each with its own motion", default=1)
    equilibrium: SeveralOrNone[Way] = field(
        optional(list_of(one_of("down", "up"))), "one for each link, or all down", default=None
    )
    start: InitialCondition | None = field(optional(InitialCondition.schema()), "of a simulation", default=None)
    on: str | None = field(optional(text(100)), "name of the support that it hangs from", default=None)
    position: Pair[float] = field(
        PAIR, "of its first joint: along and below the support's origin", "m", default=(0.0, 0.0)
    )

    @property
    def n_links(self) -> int:
        """Number of links of one copy, counting repeats."""
        return sum(link.count for link in self.links)

    @property
    def chain(self) -> tuple[AnyLink, ...]:
        """The links of one copy, each as often as it is there."""
        return tuple(link for link in self.links for _ in range(link.count))

    @property
    def ways(self) -> tuple[Way, ...]:
        """The direction of every link of one copy at equilibrium."""
        hanging: tuple[Way, ...] = ("down",)
        return self.equilibrium or hanging * self.n_links

    def problems(self) -> Iterator[str]:
        """Lists that do not fit the links, an inverted wire, and a last link on which gravity does not act."""
        if self.n_links > CHAIN_LINKS_MAX:
            yield f".links: has {self.n_links} links, counting repeats: at most {CHAIN_LINKS_MAX}"
            return
        if self.links[-1].centre == 0:
            at = f".links[{len(self.links) - 1}].centre = 0.0"
            yield f"{at}: must be positive in the last link, or gravity does not act on it"
        wires = [link.wire_loss for link in self.chain] if "up" in self.ways else []
        for place, (way, loss) in enumerate(zip(self.ways, wires, strict=False)):
            if way == "up" and is_lossy(loss):
                yield f'.equilibrium[{place}] = "up": this link has a wire_loss, and a wire hangs'
        start_lists = [(f"start.{name}", values) for name, values in self.start or () if name != "spread"]
        lists = [("equilibrium", self.equilibrium), *start_lists]
        for name, values in lists:
            if values is not None and len(values) != self.n_links:
                yield f".{name}: has {len(values)} values for {self.n_links} links"
        if self.start and self.start.spread:
            if self.start.rates_deg is not None:
                yield ".start.rates_deg: cannot be combined with spread, which gives the rates"
            if "up" in self.ways:
                yield ".start.spread: belongs to swings, and inverted links have no first mode to spread over"


def _one_line(title: str) -> str:
    if any(category(letter) in {"Cc", "Zl", "Zp"} for letter in title):
        raise ValueError("must be one line without control characters")
    return title


Support = Fixed | Cart | Swing | Tilt | Heave | Platform | ModalSupport
SUPPORTS = (Fixed, Cart, Swing, Tilt, Heave, Platform, ModalSupport)


def _unwrap_single(supports: Any) -> Any:
    """One support of a list that has no other."""
    return supports[0] if isinstance(supports, tuple) and len(supports) == 1 else supports


class Scene(Displayed, Part):
    """Gravity (m/s²), one or several supports and at least one pendulum, in the vertical plane or in space.

    `damping_ratio` ζ applies to all modes of the scene without dampers, or to each by its number in the table; it is
    added to the dampers (`modal.assembly.modal_damping`).

    >>> from modal import Bob, Pendulum, Scene
    >>> scene = Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0)], count=5)])
    >>> scene.n_pendula, scene.support.kind
    (5, 'fixed')
    >>> scene.replace(gravity=1.62).gravity  # scenes are immutable: this is another one
    1.62
    """

    __slots__ = ("_features",)
    __signature__ = PartSignature()

    title: str = field(function_after(_one_line, text(200)), "one line, printed above tables and figures", default="")
    gravity: float = field(POSITIVE, "positive", "m/s²")
    space: Literal["plane", "space"] = field(one_of("plane", "space"), "where it moves", default="plane")
    support: OneOrSeveralKinds[Support | Moved, Placed | Moved] = field(
        function_after(
            _unwrap_single,
            one_or_list(any_kind(*SUPPORTS, Moved, others=deferred("modal.scene.support_kinds:support_part"))),
        ),
        "one, or several of a structure",
        default=Fixed(),
    )
    damping_ratio: OneOrSeveral[float] = field(one_or_list(RATIO), "ζ of all modes, or a list by mode", default=0.0)
    pendulum: Several[Pendulum] = field(parts(Pendulum.schema()), "one or more")
    force: SeveralKinds[Force, AppliedForce] = field(parts_or_none(FORCE), "forces and torques", default=())
    spring: Several[Spring] = field(parts_or_none(Spring.schema()), "springs and dampers between points", default=())
    feedback: Several[Feedback] = field(parts_later("modal.scene.feedback"), "loops that measure and act", default=())
    ground: Ground | None = field(optional(Ground.schema()), "motion of the ground", default=None)

    @property
    def supports(self) -> tuple[Support | Moved, ...]:
        """All supports, as a tuple even for one."""
        return self.support if isinstance(self.support, tuple) else (self.support,)

    @property
    def hanging(self) -> tuple[Pendulum, ...]:
        """Its pendula, each as often as it is there."""
        return tuple(pendulum for pendulum in self.pendulum for _ in range(pendulum.count))

    @property
    def support_names(self) -> tuple[str, ...]:
        """The name of every support, or its kind if it has no name."""
        return tuple(getattr(support, "name", "") or support.kind for support in self.supports)

    @property
    def is_structured(self) -> bool:
        """Whether the supports are more than a fixed, a moved or a cart support, or springs join points.

        A cart is a structure if springs join points or the ground moves.
        """
        return not self.features.isdisjoint({"structure", "springs"})

    @property
    def idle_springs(self) -> list[int]:
        """Which springs between points have neither a stiffness nor a damper."""
        return [k for k, spring in enumerate(self.spring) if not spring.stiffness and not spring.damping]

    @property
    def cart(self) -> Cart | None:
        """The cart of a scene that is not structured, None if there is none."""
        return self.support if isinstance(self.support, Cart) and not self.is_structured else None

    @property
    def motions(self) -> tuple[SupportMotion, ...]:
        """The prescribed motions of the support or the ground; none if both are at rest."""
        return next(
            (moving_part.motions for moving_part in (self.ground, self.support) if isinstance(moving_part, Ground)), ()
        )

    @property
    def motion_places(self) -> tuple[tuple[str | int, ...], ...]:
        """The place of each of `motions`, such as ("ground", "motion", 1)."""
        if not self.motions:
            return ()
        moving_part = self.ground or self.support
        at = ("ground" if self.ground else "support", "motion")
        several = isinstance(moving_part, Ground) and isinstance(moving_part.motion, tuple)
        return tuple((*at, k) if several else at for k in range(len(self.motions)))

    @property
    def features(self) -> frozenset[str]:
        """The names of its features (`modal.scene.features`)."""
        stored_features: frozenset[str] | None = getattr(self, "_features", None)
        if stored_features is None:
            object.__setattr__(self, "_features", stored_features := features(self))
        return stored_features

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
        """Whether the linearized scene dissipates energy, or may do so by feedback."""
        return not self.features.isdisjoint(LOSS | {"feedback"})

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
        """Whether only the rail has dry friction, which finally holds the cart while the pendula keep swinging."""
        return self.has_friction and "joint_friction" not in self.features

    @property
    def has_drag(self) -> bool:
        """Whether there is drag on any link, linear or quadratic."""
        return not self.features.isdisjoint(DRAG)

    @property
    def frictionless(self) -> Scene:
        """The same scene without dry friction."""
        return self._with(friction=0.0)._with_supports(_slippery) if self.has_friction else self

    @property
    def linearizable(self) -> Scene:
        """The same scene without what its linear equations omit: drives, dry friction and quadratic drag."""
        scene = self.undriven.frictionless
        return scene._with(quadratic_drag=0.0) if "quadratic_drag" in scene.features else scene

    @property
    def is_driven(self) -> bool:
        """Whether any joint has a drive."""
        return not self.features.isdisjoint(DRIVES)

    @property
    def has_laws(self) -> bool:
        """Whether any joint has a law of its own, or a drive that acts as one."""
        return not self.features.isdisjoint({"law", "van_der_pol"})

    @property
    def without_laws(self) -> Scene:
        """The same scene without joint laws and point forces given by kind; drives are kept."""
        has_forces = self.has_drag and any(link.point_force for link in self.links())
        return self._with(law=None, point_force=None) if has_forces or "law" in self.features else self

    def _with_laws(self, stays: Callable[[JointLaw], bool]) -> Scene:
        """The same scene with those joint laws alone that stay."""
        if "law" not in self.features:
            return self
        return self._with_links(lambda link: link.replace(law=link.laws_that(stays)))

    @property
    def is_hoisted(self) -> bool:
        """Whether the length of any link changes with time."""
        return "hoist" in self.features

    def at(self, time: float) -> Scene:
        """Return the same scene with all lengths fixed at their values at a time (s)."""
        if not self.is_hoisted:
            return self
        return self._with_links(lambda link: link.replace(length=link.length_at(time), hoist=None))

    @property
    def is_moved(self) -> bool:
        """Whether the support or the ground has a prescribed motion."""
        return "moved_support" in self.features

    @property
    def still(self) -> Scene:
        """The same scene with its support and the ground at rest."""
        if not self.is_moved:
            return self
        return self.replace(ground=None, support=Fixed() if isinstance(self.support, Moved) else self.support)

    @property
    def is_forced(self) -> bool:
        """Whether the support or the ground moves, or time-dependent forces act."""
        return not self.features.isdisjoint({"moved_support", "force"})

    @property
    def unforced(self) -> Scene:
        """The same scene without time-dependent forces."""
        constant = tuple(force for force in self.force if isinstance(force, ConstantForce))
        return self.replace(force=constant) if "force" in self.features else self

    @property
    def timeless(self) -> Scene:
        """The same scene without time dependence: support motions, time-dependent forces and hoists."""
        scene = self.still.unforced
        return scene._with(hoist=None) if scene.is_hoisted else scene

    @property
    def has_losses(self) -> bool:
        """Whether any stiffness or wire has a loss angle."""
        return "loss" in self.features

    @property
    def lossless(self) -> Scene:
        """The same scene without loss angles."""
        if not self.has_losses:
            return self
        springs = tuple(spring.replace(loss=0.0) for spring in self.spring)
        return self._with(loss=0.0, wire_loss=0.0).replace(spring=springs)

    @property
    def undriven(self) -> Scene:
        """The same scene without drives."""
        return self._with(drive=None)._with_laws(lambda law: not law.is_drive) if self.is_driven else self

    @property
    def conservative(self) -> Scene:
        """The same scene without anything that does work: drives, losses and time dependence."""
        return self.timeless.workless

    @property
    def workless(self) -> Scene:
        """The same scene without drives and losses; time dependence is kept."""
        none = {"drive": None, "damping": 0.0, "friction": 0.0, "drag": 0.0, "quadratic_drag": 0.0, "point_force": None}
        loose = self.lossless._with_laws(lambda law: law.is_conservative)._with(**none)
        springs = tuple(spring.replace(damping=0.0) for spring in loose.spring)
        return loose.replace(damping_ratio=0.0, spring=springs, feedback=())._with_supports(_without_damping)

    @property
    def in_plane(self) -> Scene:
        """The same scene in the plane of the rail, without azimuths in its starts."""
        pendula = (
            pendulum.replace(start=pendulum.start and pendulum.start.replace(azimuths_deg=None))
            for pendulum in self.pendulum
        )
        return self.replace(space="plane", pendulum=tuple(pendula))

    def _with(self, **joint: Any) -> Scene:
        """The same scene with these numbers at every joint."""
        return self._with_links(lambda link: link.replace(**joint))

    def _with_links(self, change: Callable[[AnyLink], AnyLink]) -> Scene:
        """The same scene with every link changed."""
        pendula = (pendulum.replace(links=tuple(map(change, pendulum.links))) for pendulum in self.pendulum)
        return self.replace(pendulum=tuple(pendula))

    def _with_supports(self, change: Callable[[Support | Moved], Support | Moved]) -> Scene:
        """The same scene with every support changed."""
        new_supports = tuple(map(change, self.supports))
        return self.replace(support=_unwrap_single(new_supports)) if new_supports != self.supports else self

    @property
    def stands(self) -> bool:
        """Whether any link is inverted at equilibrium."""
        return "inverted" in self.features

    def links(self) -> Iterator[AnyLink]:
        """Every link as specified: copies and runs of equal links are listed once."""
        return (link for pendulum in self.pendulum for link in pendulum.links)

    def _summary(self) -> Summary:
        summary: Summary = deferred("modal.scene.titles:summarize")(self)
        return summary

    def problems(self) -> Iterator[str]:
        """Too many links, features that this space does not allow, inconsistent supports and springs; imbalances."""
        problems = list(self._own_problems())
        yield from problems
        if self.is_structured and not problems:
            unbalanced_words: Iterator[str] = deferred("modal.structure:find_imbalance")(self)
            yield from (f".{words}" for words in unbalanced_words)
        if self.feedback and not problems:
            yield from deferred("modal.statespace.loops:problems_of")(self)

    def _own_problems(self) -> Iterator[str]:
        if self.n_links > SCENE_LINKS_MAX:
            yield f"the scene has {self.n_links} links in all: at most {SCENE_LINKS_MAX}"
        if self.has_modal_damping and self.is_hoisted:
            yield ".damping_ratio: belongs to modes of constant lengths, and a hoist changes them: give dampers instead"
        for index, pendulum in enumerate(self.pendulum):
            if self.space == "plane" and pendulum.start and pendulum.start.azimuths_deg:
                yield f'.pendulum[{index}].start.azimuths_deg: needs space = "space"'
            if self.space == "space" and pendulum.start and pendulum.start.spread:
                yield f'.pendulum[{index}].start.spread: needs space = "plane"'
            for at, link in enumerate(pendulum.links if self.space == "space" else ()):
                if link.drive:
                    yield f'.pendulum[{index}].links[{at}].drive: needs space = "plane"'
                if link.friction:
                    yield f'.pendulum[{index}].links[{at}].friction = {link.friction!r}: needs space = "plane"'
        yield from self._rail_problems()
        if not hangs_plainly(self):
            yield from deferred("modal.scene.structures:structure_problems")(self)
        for at, force in enumerate(self.force):
            words = [*point_problems(self, force.on), *deferred("modal.scene.structures:force_problems")(self, force)]
            yield from (f'.force[{at}].on = "{force.on}": {why}' for why in words)
            if self.space == "space":
                yield f'.force[{at}]: needs space = "plane"'

    def _rail_problems(self) -> Iterator[str]:
        cart = self.cart
        if cart is None or not cart.has_friction:
            return
        name = "friction" if cart.friction else "friction_coefficient"
        at = f".support.{name} = {getattr(cart, name)!r}"
        if self.space == "space":
            yield f'{at}: needs space = "plane"'
        if {"rail_coefficient", "escapement"} <= self.features:
            yield f"{at}: cannot be combined with escapements, whose kicks the rail would feel: give friction"


def _slippery(support: Support | Moved) -> Support | Moved:
    """A support without dry friction."""
    return support.replace(friction=0.0, friction_coefficient=0.0) if isinstance(support, Cart) else support


def _without_damping(support: Support | Moved) -> Support | Moved:
    """A support without damper and dry friction."""
    if isinstance(support, ModalSupport):
        return support.replace(D=None)
    if "damping" not in support.fields:
        return support
    return _slippery(support).replace(damping=support.fields["damping"].default)


def validate_scene(scene: object) -> Scene:
    """Return the scene itself; raise SceneError, with a hint, for anything else."""
    if isinstance(scene, Scene):
        return scene
    raise SceneError([problem_of("Scene", scene)])


def validate_scenes(scenes: object) -> Sequence[Scene]:
    """Return a list of scenes; raise SceneError for anything else, with the place of the wrong entry."""
    if isinstance(scenes, str) or not isinstance(scenes, Sequence):
        raise SceneError([f"a list of Scenes is required, not {type(scenes).__name__}"])
    wrong = [k for k, scene in enumerate(scenes) if not isinstance(scene, Scene)]
    if wrong:
        raise SceneError([f"scenes[{wrong[0]}]: a Scene is required, not {type(scenes[wrong[0]]).__name__}"])
    return scenes


def scene_from(data: object) -> Scene:
    """Return the scene described by nested mappings, as in a scene file; raise SceneError with every mistake."""
    return Scene.model_validate(data)


def describe(part: Part) -> dict[str, Any]:
    """Return the mapping that `scene_from` reads back as an equal object: kinds first, without defaults."""
    data: dict[str, Any] = {"kind": part.kind} if hasattr(part, "kind") else {}
    for name, entry in part.fields.items():
        value = getattr(part, name)
        if name != "kind" and value is not None and (entry.is_required or value != entry.default):
            data[name] = plain_data(value)
    return data


def plain_data(value: Any) -> Any:
    """Return a value of a part in the form of `describe`."""
    if isinstance(value, Part):
        return describe(value)
    return [plain_data(item) for item in value] if isinstance(value, tuple) else value
