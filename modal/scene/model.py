"""A scene: a support and its pendula, checked when made and immutable.

    gravity g;  a fixed support or a cart on a straight horizontal rail;  pendula, each a chain of links.

Link i has mass m_i, length l_i (pivot to next joint), centre of mass at c_i along it and moment of inertia I_i
about that centre.  All numbers are SI; angles in a scene file are degrees from the downward vertical.
A drive sustains the swing of a clock or a metronome: it acts on the angle γ between a link and the one above, measured
from equilibrium (at a top joint: from the vertical), and with opposite sign on the link above.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from os import PathLike, fspath
from typing import Annotated, Any, ClassVar, Literal, Self
from unicodedata import category

from pydantic import BaseModel, Field, ValidationError, field_validator, model_validator

from modal import pair
from modal.errors import SceneError
from modal.scene.validation import Checked, Count, NonNegative, Positive, Real, Several, problems_of, validate

MAX_CHAIN = 20_000
MAX_LINKS = 10_000_000
Way = Literal["down", "up"]
Scalar = Callable[[float], Any]
Acute = Annotated[float, Field(strict=True, ge=0, lt=180)]
Turn = Annotated[float, Field(strict=True, ge=1e-6, le=180)]


class VanDerPol(Checked):
    """The torque e (1 − (γ/γ₀)²) γ': supplies energy within γ₀ and dissipates it beyond.

    `strength` e (N m s/rad), `angle_deg` γ₀ (Pantaleone, Am. J. Phys. 70, 992 (2002), equation (1)).  Alone on a
    lightly driven pendulum it keeps the amplitude 2 γ₀, with a damper d at the same joint 2 γ₀ √(1 − d/e).
    """

    kind: Literal["van-der-pol"] = "van-der-pol"
    strength: Positive
    angle_deg: Turn


class Escapement(Checked):
    """A kick `impulse` (N m s) in the direction of motion each time that |γ| passes `angle_deg` outwards.

    Kicks alternate between the two sides, as the pallets of an anchor do; a swing that stays within the angle gets
    none (Bennett, Schatz, Rockwood & Wiesenfeld, Proc. R. Soc. A 458, 563 (2002), §4).
    """

    kind: Literal["escapement"] = "escapement"
    impulse: Positive
    angle_deg: Acute = 0.0


Drive = Annotated[VanDerPol | Escapement, Field(discriminator="kind")]


class Link(Checked):
    """Mass (kg) and length (m) of a link, and the damper (N m s/rad), spring (N m/rad) and drive at its upper joint."""

    mass: Positive
    length: Positive
    damping: NonNegative = 0.0
    stiffness: NonNegative = 0.0
    drive: Drive | None = None
    count: Count = 1

    is_uniform: ClassVar[bool] = True
    """Whether the centre scales with the length and the inertia with mass times length²."""
    extensive: ClassVar[tuple[str, ...]] = ("mass", "damping", "stiffness")

    def heavier(self, factor: int) -> Self:
        """That many copies as one."""
        return self.replace(**{name: getattr(self, name) * factor for name in self.extensive})


class _Simple(Link):
    """A link whose centre and inertia follow from its kind, mass and length."""

    kind: str

    def proportions(self, m: Any, l: Any, scalar: Scalar = float) -> tuple[Any, Any]:
        """Centre and inertia for a mass and a length in numbers of any type, made from floats by `scalar`."""
        return pair.proportions(self.kind, m, l)

    @property
    def centre(self) -> float:
        """Distance (m) from the upper joint to the centre of mass."""
        return float(self.proportions(self.mass, self.length)[0])

    @property
    def inertia(self) -> float:
        """Moment of inertia (kg m²) about the centre of mass."""
        return float(self.proportions(self.mass, self.length)[1])


class Bob(_Simple):
    """A point mass at the end of a massless rod: c = l, I = 0."""

    kind: Literal["bob"] = "bob"


class Rod(_Simple):
    """A uniform rod: c = l/2, I = m l²/12."""

    kind: Literal["rod"] = "rod"


class Body(Link):
    """A rigid body: any centre of mass c ≥ 0 (m), on the link or beyond it, and any inertia I ≥ 0 (kg m²)."""

    kind: Literal["body"] = "body"
    centre: NonNegative
    inertia: NonNegative

    is_uniform: ClassVar[bool] = False
    extensive: ClassVar[tuple[str, ...]] = (*Link.extensive, "inertia")

    def proportions(self, m: Any, l: Any, scalar: Scalar = float) -> tuple[Any, Any]:
        """Its own centre and inertia, converted by `scalar` to the type of mass and length."""
        return scalar(self.centre), scalar(self.inertia)

    @model_validator(mode="after")
    def _turns(self) -> Body:
        if self.centre == 0 and self.inertia == 0:
            raise ValueError(".inertia = 0.0: must be positive if the centre is at the pivot")
        return self


AnyLink = Bob | Rod | Body


class InitialCondition(Checked):
    """The initial condition of a simulation: one angle (deg) and one rate (deg/s) per link, top to bottom.

    `azimuths_deg` turns each link's plane about the vertical; only a scene in space may have it.
    """

    angles_deg: tuple[Real, ...]
    rates_deg: tuple[Real, ...] | None = None
    azimuths_deg: tuple[Real, ...] | None = None


class Pendulum(Checked):
    """A chain of links, top to bottom, in `count` copies.

    `equilibrium` gives for each link whether it points down or up; the scene is linearized about that equilibrium.
    """

    links: Annotated[tuple[Annotated[AnyLink, Field(discriminator="kind")], ...], Field(min_length=1), Several]
    count: Count = 1
    equilibrium: tuple[Way, ...] | None = None
    start: InitialCondition | None = None

    @property
    def n_links(self) -> int:
        """Number of links of one copy, counting repeats."""
        return sum(link.count for link in self.links)

    @property
    def ways(self) -> tuple[Way, ...]:
        """The direction of every link of one copy at equilibrium."""
        hanging: tuple[Way, ...] = ("down",)
        return self.equilibrium or hanging * self.n_links

    @model_validator(mode="after")
    def _consistent(self) -> Pendulum:
        return validate(self, self._problems())

    def _problems(self) -> Iterator[str]:
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


class Fixed(Checked):
    """A support that does not move."""

    kind: Literal["fixed"] = "fixed"


class Cart(Checked):
    """A cart on the rail: mass (kg, may be 0), damper (N s/m) and spring (N/m) to the ground."""

    kind: Literal["cart"] = "cart"
    mass: NonNegative
    damping: NonNegative = 0.0
    stiffness: NonNegative = 0.0


class Scene(Checked):
    """Gravity (m/s²), a support and at least one pendulum, in the vertical plane or in space."""

    title: Annotated[str, Field(max_length=200)] = ""
    gravity: Positive
    space: Literal["plane", "space"] = "plane"
    support: Annotated[Fixed | Cart, Field(discriminator="kind")] = Fixed()
    pendulum: Annotated[tuple[Pendulum, ...], Field(min_length=1), Several]

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
        """Whether anything in the scene dissipates energy."""
        return (isinstance(self.support, Cart) and self.support.damping > 0) or any(
            link.damping > 0 for link in self.links()
        )

    @property
    def is_driven(self) -> bool:
        """Whether any joint has a drive."""
        return any(link.drive for link in self.links())

    @property
    def undriven(self) -> Scene:
        """The same scene without drives."""
        return self._with(drive=None) if self.is_driven else self

    @property
    def conservative(self) -> Scene:
        """The same scene without drives and dampers."""
        still = self._with(drive=None, damping=0.0)
        held = isinstance(self.support, Cart)
        return still.replace(support=self.support.replace(damping=0.0)) if held else still

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
        return any("up" in pendulum.ways for pendulum in self.pendulum)

    def links(self) -> Iterator[Bob | Rod | Body]:
        """Every link as specified: copies and runs of equal links once each."""
        return (link for pendulum in self.pendulum for link in pendulum.links)

    @field_validator("title")
    @classmethod
    def _one_line(cls, title: str) -> str:
        if any(category(letter) in {"Cc", "Zl", "Zp"} for letter in title):
            raise ValueError("must be one line without control characters")
        return title

    @model_validator(mode="after")
    def _consistent(self) -> Scene:
        return validate(self, self._problems())

    def _problems(self) -> Iterator[str]:
        if self.n_links > MAX_LINKS:
            yield f"the scene has {self.n_links} links in all: at most {MAX_LINKS}"
        for index, pendulum in enumerate(self.pendulum):
            if self.space == "plane" and pendulum.start and pendulum.start.azimuths_deg:
                yield f'.pendulum[{index}].start.azimuths_deg: needs space = "space"'
            for number, link in enumerate(pendulum.links if self.space == "space" else ()):
                if link.drive:
                    yield f'.pendulum[{index}].links[{number}].drive: needs space = "plane"'


def validate_scene(given: object) -> Scene:
    """The scene itself; SceneError for anything else, with a hint."""
    if isinstance(given, Scene):
        return given
    meant = f': load("{fspath(given)}") gives one' if isinstance(given, str | PathLike) else ""
    raise SceneError([f"a Scene is required, not {type(given).__name__}{meant}"])


def scene_from(data: object) -> Scene:
    """The scene described by nested mappings, as in a scene file; SceneError lists every mistake."""
    try:
        return Scene.model_validate(data)
    except ValidationError as error:
        raise SceneError(tuple(problems_of(error))) from None


def describe(part: BaseModel) -> dict[str, Any]:
    """The mapping that `scene_from` reads back as an equal object: kinds first, without defaults."""
    found: dict[str, Any] = {"kind": part.kind} if hasattr(part, "kind") else {}
    for name, field in type(part).model_fields.items():
        value = getattr(part, name)
        if name != "kind" and value is not None and (field.is_required() or value != field.default):
            found[name] = _plain(value)
    return found


def _plain(value: Any) -> Any:
    if isinstance(value, BaseModel):
        return describe(value)
    return [_plain(item) for item in value] if isinstance(value, tuple) else value
