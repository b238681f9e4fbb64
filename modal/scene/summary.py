"""A scene in few words: what hangs where, and a row for each of its pendula."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import accumulate, islice

from modal.report import Summary, brief
from modal.scene.model import Pendulum, Scene
from modal.scene.titles import plural, runs_of, what_hangs
from modal.scene.validation import Part

MOST_RUNS = 4
HEADINGS = ("pendulum", "links", "mass (kg)", "length (m)", "also")
ALSO = ("damping", "stiffness", "friction", "drag", "quadratic_drag", "drive", "hoist")
CART = (("mass", "kg"), ("damping", "N s/m"), ("stiffness", "N/m"), ("friction", "N"), ("friction_coefficient", ""))


def summarize(scene: Scene) -> Summary:
    """What hangs where, and a row for each entry of `pendulum`."""
    facts = [("gravity", f"{scene.gravity:g} m/s²"), ("links", str(scene.n_links)), *_support(scene)]
    if scene.damping_ratio:
        facts.append(("damping ratio", brief(scene.damping_ratio)))
    if scene.stands:
        facts.append(("equilibrium", "inverted"))
    title = f'Scene "{scene.title}": {what_hangs(scene)}' if scene.title else f"Scene: {what_hangs(scene)}"
    rows = _rows(scene.pendulum)
    return Summary(title, facts, HEADINGS, rows, len(scene.pendulum), words=frozenset({1, 4}))


def _support(scene: Scene) -> Iterator[tuple[str, str]]:
    if (cart := scene.cart) is not None:
        values = ((name, getattr(cart, name), unit) for name, unit in CART)
        yield "cart", ", ".join(f"{name} {value:g} {unit}".rstrip() for name, value, unit in values if value)
    elif scene.is_moved:
        yield "motion", " and ".join(motion.kind for motion in scene.motions)
    if "structure" in scene.features:
        for name, support in zip(scene.support_names, scene.supports, strict=True):
            yield name, ", ".join(_numbers_of(support)) or support.kind
    if scene.spring:
        yield "springs", ", ".join(" – ".join(spring.between) for spring in scene.spring[:MOST_RUNS])
    if scene.force:
        yield "forces", ", ".join(f"{force.kind} on {force.on}" for force in scene.force[:MOST_RUNS])


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
            _cut(f"{count} {plural(kind, count)}" for kind, count in runs_of(pendulum.links)),
            _cut(_times(link.count, link.mass) for link in pendulum.links),
            _cut(_times(link.count, link.length) for link in pendulum.links),
            ", ".join([*also, *["start"] * (pendulum.start is not None)]),
        )


def _times(count: int, value: float) -> str:
    return f"{count} × {value:g}" if count > 1 else f"{value:g}"


def _cut(words: Iterable[str]) -> str:
    shown = list(islice(words, MOST_RUNS + 1))
    return ", ".join(shown if len(shown) <= MOST_RUNS else [*shown[:MOST_RUNS], "…"])
