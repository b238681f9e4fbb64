"""Features of scenes that matter to some capability, each with its place, its name and a remedy.

`Scene.features` holds the names of those that a scene has. Their support is defined in `capabilities`; equations of
motion read the numbers of a scene, not its features.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple, Protocol

from modal.scene.laws import JointPart
from modal.scene.links import AnyLink, Escapement, is_lossy
from modal.scene.validation import Part


class Described(Protocol):
    """The attributes of a scene from which features are determined."""

    @property
    def support(self) -> Any:
        """The support, or a list of several."""

    @property
    def supports(self) -> Sequence[Any]:
        """All supports."""

    @property
    def support_names(self) -> Sequence[str]:
        """The name of every support."""

    @property
    def pendulum(self) -> Sequence[Any]:
        """The pendula."""

    @property
    def force(self) -> Sequence[Any]:
        """The forces."""

    @property
    def spring(self) -> Sequence[Any]:
        """The springs between points."""

    @property
    def feedback(self) -> Sequence[Any]:
        """The loops."""

    @property
    def ground(self) -> Any:
        """The ground, where it moves."""

    @property
    def space(self) -> str:
        """In the plane or in space."""

    @property
    def is_structured(self) -> bool:
        """Whether it is a structure."""

    def links(self) -> Iterator[AnyLink]:
        """Every link."""


class Feature(NamedTuple):
    """A feature of scenes: its name in a sentence, a remedy, and the keys of a scene that determine it.

    A scene has it if `has` is true of the value of that key in the scene, a support (one of several keys), a spring, a
    pendulum or a link, and `condition` of the scene.
    """

    words: str
    mend: str
    has: Callable[[Any], Any] = bool
    scene: str = ""
    support: tuple[str, ...] = ()
    spring: str = ""
    pendulum: str = ""
    link: tuple[str, ...] = ()
    condition: Callable[[Described], bool] = lambda scene: True

    def places(self, scene: Described) -> Iterator[str]:
        """Return the places of a scene that have it, such as `pendulum[0].links[1].friction = 0.1`."""
        for where, part, key in self._parts(scene):
            value = getattr(part, key, None)
            if value is not None and self.has(value):
                yield f"{where}{key}{_value_text(value)}"

    def _parts(self, scene: Described) -> Iterator[tuple[str, Any, str]]:
        if self.scene:
            yield "", scene, self.scene
        several = isinstance(scene.support, tuple)
        for i, support in enumerate(scene.supports):
            for key in self.support:
                yield f"support[{i}]." if several else "support.", support, key
        for i, spring in enumerate(scene.spring if self.spring else ()):
            yield f"spring[{i}].", spring, self.spring
        for i, pendulum in enumerate(scene.pendulum):
            if self.pendulum:
                yield f"pendulum[{i}].", pendulum, self.pendulum
            for j, link in enumerate(pendulum.links if self.link else ()):
                yield from ((f"pendulum[{i}].links[{j}].", link, key) for key in self.link)

    def _is_of(self, support: Any) -> bool:
        """Whether a support has it."""
        values = [getattr(support, key, None) for key in self.support]
        return any(value is not None and self.has(value) for value in values)

    def is_in(self, scene: Described, values: Callable[[str], set[Any]]) -> bool:
        """Whether a scene has it; `values` are those of a key of all links."""
        has = self.has
        return self.condition(scene) and bool(
            (self.scene and has(getattr(scene, self.scene)))
            or (self.support and any(map(self._is_of, scene.supports)))
            or (self.spring and any(has(getattr(part, self.spring)) for part in scene.spring))
            or (self.pendulum and any(has(getattr(part, self.pendulum)) for part in scene.pendulum))
            or any(any(map(has, values(key))) for key in self.link)
        )


def _value_text(value: Any) -> str:
    if isinstance(value, str):
        return f' = "{value}"'
    return f" = {value!r}" if isinstance(value, float | int) else ""


def _stays_behind(scene: Described) -> bool:
    """Whether a cart can move while all mass below it is at rest: each pendulum begins with joints that bobs hold."""
    return all(holds_still(pendulum.links) for pendulum in scene.pendulum)


def holds_still(links: Sequence[AnyLink]) -> bool:
    """Whether all mass below a pivot, and every rotor, can stay at rest while the pivot moves."""
    last = next((i for i, link in enumerate(links) if link.inertia or link.centre == link.length), len(links) - 1)
    return not (links[last].inertia or any(link.rotor_inertia for link in links[: last + 2]))


def _ratio(ratios: float | tuple[float, ...]) -> bool:
    return any(ratios) if isinstance(ratios, tuple) else ratios > 0


def _is_structure(scene: Described) -> bool:
    """Whether pendula hang from more than a fixed support, a moved one, or a cart on a rail at rest."""
    support = scene.support
    if isinstance(support, tuple) or support.kind not in {"fixed", "cart", "moved"}:
        return True
    return support.kind == "cart" and bool(scene.spring or scene.ground)


def hangs_plainly(scene: Described) -> bool:
    """Whether all pendula hang from one unnamed fixed, moved or cart support without springs: no name can be wrong."""
    support = scene.support
    if isinstance(support, tuple) or support.kind not in {"fixed", "cart", "moved"} or scene.spring or scene.ground:
        return False
    return not getattr(support, "name", "") and all(pendulum.on is None for pendulum in scene.pendulum)


def _is_one_cart(scene: Described) -> bool:
    return not _is_structure(scene)


def _moves(value: Any) -> bool:
    return value == "moved" if isinstance(value, str) else value is not None


def _damps(value: Any) -> bool:
    """Whether a damper has any number but 0: one, those of a platform, or a matrix."""
    if value is None:
        return False
    if laws := _laws(value):
        return any(not (part.law.is_conservative or part.law.is_drive) for part in laws)
    if isinstance(value, Part):
        return any(number for _, number in value)
    return any(map(any, value)) if isinstance(value, tuple) else value > 0


def _changes(forces: Sequence[Any]) -> bool:
    return any(force.kind != "constant" for force in forces)


def _is_constant(forces: Sequence[Any]) -> bool:
    return any(force.kind == "constant" and force.amplitude for force in forces)


def _laws(value: Any) -> list[JointPart]:
    """The laws among the values of a key of links: of a joint, or its drive."""
    return [part for part in (value if isinstance(value, tuple) else (value,)) if isinstance(part, JointPart)]


def _springs(value: Any) -> bool:
    """Whether a joint has a spring, or a law that acts as one."""
    if isinstance(value, float):
        return value > 0
    return any(part.law.has_potential or part.linear_coefficients[0] for part in _laws(value))


def _any_law(test: Callable[[Any], bool]) -> Callable[[Any], bool]:
    return lambda value: any(test(part.law) for part in _laws(value))


def _supplies_energy(law: Any) -> bool:
    """Whether a law may do so without being omitted as drives are."""
    return not (law.is_conservative or law.is_dissipative or law.is_drive)


def _any_with(name: str) -> Callable[[Sequence[Any]], bool]:
    return lambda parts: any(getattr(part, name) for part in parts)


FEATURES: dict[str, Feature] = {
    "cart": Feature(
        "a cart", 'give the support a kind other than "cart"', "cart".__eq__, support=("kind",), condition=_is_one_cart
    ),
    "massless_cart": Feature(
        "a massless cart above bobs",
        "give the cart a mass",
        (0.0).__eq__,
        support=("mass",),
        condition=lambda scene: _is_one_cart(scene) and _stays_behind(scene),
    ),
    "structure": Feature(
        "a structure",
        "hang the pendula from one cart or a fixed support",
        lambda support: True,
        scene="support",
        condition=_is_structure,
    ),
    "springs": Feature("springs between points", "remove the springs", scene="spring"),
    "moved_support": Feature(
        "a moved support", 'write kind = "fixed" or "cart"', _moves, scene="ground", support=("kind",)
    ),
    "hoist": Feature("a hoist", "remove the hoist", link=("hoist",)),
    "space": Feature("motion in space", 'set space = "plane"', "space".__eq__, scene="space"),
    "copies": Feature("copies of a pendulum", "write one pendulum", (1).__lt__, pendulum="count"),
    "inverted": Feature(
        "inverted links", "let all links hang", lambda ways: "up" in (ways or ()), pendulum="equilibrium"
    ),
    "joint_springs": Feature("springs at joints", "remove the springs", _springs, link=("stiffness", "law")),
    "rotor": Feature("rotors at joints", "remove the rotor_inertia", link=("rotor_inertia",)),
    "dampers": Feature(
        "dampers", "remove the dampers", _damps, support=("damping", "D"), spring="damping", link=("damping", "law")
    ),
    "loss": Feature("loss angles", "remove them, or give dampers", is_lossy, spring="loss", link=("loss", "wire_loss")),
    "linear_drag": Feature("linear drag", "remove the drag", link=("drag", "point_force")),
    "quadratic_drag": Feature("quadratic drag", "remove it, or give drag", link=("quadratic_drag", "point_force")),
    "damping_ratio": Feature("a damping ratio", "give dampers at joints instead", _ratio, scene="damping_ratio"),
    "joint_friction": Feature("dry friction at joints", "remove it, or give dampers", link=("friction",)),
    "rail_friction": Feature("dry friction on the rail", "remove it, or give a damper", support=("friction",)),
    "rail_coefficient": Feature(
        "a coefficient of friction on the rail",
        "give a friction in N, or remove it",
        support=("friction_coefficient",),
    ),
    "escapement": Feature(
        "kicks of escapements", "remove the drives", lambda drive: isinstance(drive, Escapement), link=("drive",)
    ),
    "van_der_pol": Feature(
        "van der Pol drives", "remove the drives", _any_law(lambda law: law.is_drive), link=("drive", "law")
    ),
    "law": Feature("laws of joints", "remove the law", link=("law",)),
    "active_law": Feature("laws that supply energy", "remove the law", _any_law(_supplies_energy), link=("law",)),
    "kinked_law": Feature(
        "laws that are not smooth", "remove the law", _any_law(lambda law: not law.is_smooth), link=("law",)
    ),
    "force": Feature("a force that changes in time", "remove the force", _changes, scene="force"),
    "constant_force": Feature("a constant force", "remove the force", _is_constant, scene="force"),
    "feedback": Feature("feedback", "remove the feedback", scene="feedback"),
    "limited_feedback": Feature("feedback with a limit", "remove the limit", _any_with("limit"), scene="feedback"),
    "sampled_feedback": Feature(
        "feedback in samples", "remove the sample_time", _any_with("sample_time"), scene="feedback"
    ),
    "reference": Feature("a reference of feedback", "remove the reference", _any_with("reference"), scene="feedback"),
    "load": Feature("applied forces", "remove the load"),
}
"""All features by name; a load comes with a call, not with a scene."""

LOSS = frozenset({"dampers", "linear_drag", "damping_ratio"})
FRICTION = frozenset({"joint_friction", "rail_friction", "rail_coefficient"})
DRAG = frozenset({"linear_drag", "quadratic_drag"})
DRIVES = frozenset({"escapement", "van_der_pol"})


def features(scene: Described) -> frozenset[str]:
    """Return the names of all features of a scene.

    >>> from modal import load
    >>> sorted(features(load("huygens")))
    ['cart', 'dampers', 'escapement']
    """
    links = list(scene.links())
    present: dict[str, set[Any]] = {}

    def values(key: str) -> set[Any]:
        if key not in present:
            present[key] = {getattr(link, key) for link in links}
        return present[key]

    return frozenset(name for name, feature in FEATURES.items() if feature.is_in(scene, values))


def varied_features(path: str) -> frozenset[str]:
    """Return the names of the features that a scene has for some values of the number at this path.

    >>> sorted(varied_features("pendulum[0].links[*].quadratic_drag"))
    ['quadratic_drag']
    """
    first, key = path.partition(".")[0].partition("[")[0], path.rpartition(".")[2]
    if first == "support":
        parameter = path.partition(".")[2] if ".damping." in path else key  # damping.sway of a platform
        return frozenset(name for name, feature in FEATURES.items() if parameter.partition(".")[0] in feature.support)
    if {"loss", "wire_loss"} & set(path.replace("[", ".").split(".")):  # also a number of a table
        return frozenset({"loss"})
    if ".links[" in path:
        return frozenset(name for name, feature in FEATURES.items() if key in feature.link)
    part = "spring" if first == "spring" else "scene"
    return frozenset(name for name, feature in FEATURES.items() if getattr(feature, part) == key)
