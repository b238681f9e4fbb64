"""A scene in few words: its title or, without one, a description of its contents, and a row for each pendulum."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from itertools import accumulate, groupby, islice
from typing import Any

from modal.report import Summary, brief, capital, listed
from modal.scene.doors import require_type
from modal.scene.links import AnyLink, Body
from modal.scene.model import Pendulum, Scene
from modal.scene.validation import Part

NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve")
SINGLE = {"bob": "simple ", "rod": "rod ", "rigid body": "compound "}
NAMES = {1: "", 2: "double ", 3: "triple "}
WORDS = {
    "fixed": ("fixed support", "fixed supports"),
    "heave": ("support that heaves", "supports that heave"),
    "modal": ("linear structure", "linear structures"),
    "tilt": ("board that tilts", "boards that tilt"),
}
"""Supports in words, one and several, where they are called otherwise than their kind says."""
TITLE_SORTS_MAX = 3
"""Format: sorts of pendula or links that a title names one by one."""


def title_of(scene: Scene) -> str:
    """Return the scene's title, or a description of its contents.

    >>> from modal import Bob, Cart, Pendulum, Rod, Scene
    >>> rods = Pendulum(links=[Rod(mass=1.0, length=1.0, count=2)], count=2)
    >>> title_of(Scene(gravity=9.81, support=Cart(mass=1.0), pendulum=[rods]))
    'Two double pendula of rods on a cart'
    >>> title_of(Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0, count=5)])]))
    'A chain of five bobs on a fixed support'
    """
    require_type("scene", scene, "Scene")
    if scene.title:
        return scene.title
    return capital(what_hangs(scene))


def what_hangs(scene: Scene) -> str:
    """Return the pendula and their support in words, whatever the title.

    >>> from modal import load
    >>> what_hangs(load("paper-cart-2"))
    'two double pendula of rods on a cart'
    """
    require_type("scene", scene, "Scene")
    return f"{_pendula(scene)} on {_support(scene)}{', in space' if scene.space == 'space' else ''}"


def name_of(scene: Scene) -> str:
    """Return its title in quotation marks, or else a description of its contents."""
    require_type("scene", scene, "Scene")
    return f'"{scene.title}"' if scene.title else what_hangs(scene)


def _support(scene: Scene) -> str:
    springs = ", joined by a spring" if len(scene.spring) == 1 else ", joined by springs" if scene.spring else ""
    return _supports(scene) + springs


def _nouns(support: Any) -> tuple[str, str]:
    """The name of a support of its kind, singular and plural."""
    return WORDS.get(support.kind) or support.path.nouns


def _supports(scene: Scene) -> str:
    if "structure" in scene.features:
        counts = Counter(_nouns(support) for support in scene.supports)
        words = [f"a {singular}" if n == 1 else f"{_number(n)} {plural}" for (singular, plural), n in counts.items()]
        return listed(words, len(words))
    if (cart := scene.cart) is not None:
        what = "cart" if cart.mass else "massless cart"
        return f"a {what} with a spring" if cart.stiffness else f"a {what}"
    return "a moved support" if scene.is_moved else "a fixed support"


def _pendula(scene: Scene) -> str:
    """All pendula, equal sorts together."""
    counts: dict[str, tuple[str, int]] = {}
    for pendulum in scene.pendulum:
        singular, plural_words = _sort(pendulum)
        counts[singular] = plural_words, counts.get(singular, (plural_words, 0))[1] + pendulum.count
    if len(counts) > TITLE_SORTS_MAX:
        return f"{_number(scene.n_pendula)} pendula of {_number(scene.n_links)} links in all"
    phrases = [
        singular if count == 1 else f"{_number(count)} {plural_words}"
        for singular, (plural_words, count) in counts.items()
    ]
    return listed(phrases, len(phrases))


def _sort(pendulum: Pendulum) -> tuple[str, str]:
    """A pendulum in words, one and several of its sort."""
    n, links = pendulum.n_links, _links(pendulum)
    up = sum(way == "up" for way in pendulum.ways)
    adjective = "inverted " if up == n else "partly inverted " if up else ""
    springs = " with springs" if any(link.stiffness for link in pendulum.links) else ""
    article = "an" if adjective[:1] == "i" else "a"
    if n in NAMES:
        which = f" of {links}" if n > 1 else ""
        name = f"{adjective}{NAMES[n] or SINGLE[_kind_of(pendulum.links[0])]}"
        return f"{article} {name}pendulum{which}{springs}", f"{name}pendula{which}{springs}"
    return f"{article} {adjective}chain of {links}{springs}", f"{adjective}chains of {links}{springs}"


def _links(pendulum: Pendulum) -> str:
    """The links from top to bottom by their kinds, with their numbers unless the name of the pendulum has them."""
    runs = runs_of(pendulum.links)
    if len(runs) == 1:
        (kind, count), n = runs[0], pendulum.n_links
        return plural(kind, count) if n in NAMES and n > 1 else f"{_number(count)} {plural(kind, count)}"
    if len(runs) > TITLE_SORTS_MAX:
        return f"{_number(pendulum.n_links)} links"
    phrases = [f"{_number(count)} {plural(kind, count)}" for kind, count in runs]
    return listed(phrases, len(phrases))


def runs_of(links: Iterable[AnyLink]) -> list[tuple[str, int]]:
    """Return runs of links of one kind: the kind in words, and their number."""
    return [(kind, sum(link.count for link in links_in_row)) for kind, links_in_row in groupby(links, _kind_of)]


def _kind_of(link: AnyLink) -> str:
    return "rigid body" if isinstance(link, Body) else link.kind


def plural(kind: str, count: int) -> str:
    """Return the plural of a kind of links, without their number."""
    if count == 1:
        return kind
    return "rigid bodies" if kind == "rigid body" else f"{kind}s"


def _number(count: int) -> str:
    return NUMBERS[count] if count < len(NUMBERS) else str(count)


TABLE_ITEMS_MAX = 4
"""Format: items of a cell that are written one by one."""
HEADINGS = ("pendulum", "links", "mass (kg)", "length (m)", "also")
ALSO = ("damping", "stiffness", "friction", "drag", "quadratic_drag", "rotor_inertia", "drive", "hoist")
CART = (("mass", "kg"), ("damping", "N s/m"), ("stiffness", "N/m"), ("friction", "N"), ("friction_coefficient", ""))


def summarize(scene: Scene) -> Summary:
    """Return a summary of a scene, with a row for each entry of `pendulum`."""
    facts = [("gravity", f"{scene.gravity:g} m/s²"), ("links", str(scene.n_links)), *_facts(scene)]
    if scene.damping_ratio:
        facts.append(("damping ratio", brief(scene.damping_ratio)))
    if scene.stands:
        facts.append(("equilibrium", "inverted"))
    title = f'Scene "{scene.title}": {what_hangs(scene)}' if scene.title else f"Scene: {what_hangs(scene)}"
    rows = _rows(scene.pendulum)
    return Summary(title, facts, HEADINGS, rows, len(scene.pendulum), words=frozenset({1, 4}))


def _facts(scene: Scene) -> Iterator[tuple[str, str]]:
    if (cart := scene.cart) is not None:
        values = ((name, getattr(cart, name), unit) for name, unit in CART)
        yield "cart", ", ".join(f"{name} {value:g} {unit}".rstrip() for name, value, unit in values if value)
    elif scene.is_moved:
        yield "motion", " and ".join(motion.kind for motion in scene.motions)
    if "structure" in scene.features:
        for name, support in zip(scene.support_names, scene.supports, strict=True):
            yield name, ", ".join(_numbers_of(support)) or support.kind
    if scene.spring:
        yield "springs", ", ".join(" – ".join(spring.between) for spring in scene.spring[:TABLE_ITEMS_MAX])
    if scene.feedback:
        yield "feedback", ", ".join(" and ".join(loop.inputs) for loop in scene.feedback[:TABLE_ITEMS_MAX])
    if scene.force:
        yield "forces", ", ".join(f"{force.kind} on {force.on}" for force in scene.force[:TABLE_ITEMS_MAX])


def _numbers_of(support: Part) -> Iterator[str]:
    """The kind of a support and its numbers."""
    yield str(getattr(support, "kind", ""))
    for name in ("mass", "inertia", "length", "damping", "stiffness"):
        value = getattr(support, name, 0.0)
        if isinstance(value, Part):
            yield from (f"{name} in {way} {number:g}" for way, number in value if number)
        elif value:
            yield f"{name} {value:g}"


def _rows(pendula: Sequence[Pendulum]) -> Iterator[tuple[str, ...]]:
    last = accumulate(pendulum.count for pendulum in pendula)
    for pendulum, end in zip(pendula, last, strict=True):
        first = end - pendulum.count + 1
        also = [name.replace("_", " ") for name in ALSO if any(getattr(link, name) for link in pendulum.links)]
        yield (
            str(first) if first == end else f"{first}–{end}",
            _first_words(f"{count} {plural(kind, count)}" for kind, count in runs_of(pendulum.links)),
            _first_words(_times(link.count, link.mass) for link in pendulum.links),
            _first_words(_times(link.count, link.length) for link in pendulum.links),
            ", ".join([*also, *["start"] * (pendulum.start is not None)]),
        )


def _times(count: int, value: float) -> str:
    return f"{count} × {value:g}" if count > 1 else f"{value:g}"


def _first_words(words: Iterable[str]) -> str:
    beginning = list(islice(words, TABLE_ITEMS_MAX + 1))
    return ", ".join(beginning if len(beginning) <= TABLE_ITEMS_MAX else [*beginning[:TABLE_ITEMS_MAX], "…"])
