"""The data of a page: a scene with every link written out, and a saved motion."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from modal.errors import refuse_any
from modal.modes import natural_modes
from modal.scene import Moved, Scene, describe, refusals
from modal.scene.parameters import with_numbers
from modal.scene.points import PendulumPoint, parse_point
from modal.structure import structure_of
from modal.types import Floats
from multipendula.page.equations import PIECES_MAX, SWITCHED_LINKS_MAX, is_structural, long_ones

if TYPE_CHECKING:
    from nonlinear.integration import Trajectory

MOST_LINKS = 60
"""Limit: links of a scene: "the live page cannot show more than 60"."""
PAGE_COORDINATES_MAX = 40
"""Limit: coordinates of a structure with its links, whose equations stand in the page: "cannot show more than 40"."""
RECORDING_NUMBERS = 26_000
"""Format: numbers of a recording: 139 kB as 32-bit floats in base64."""


def scene_data(scene: Scene) -> dict[str, Any]:
    """A scene as nested mappings with the keys of its file, each link once for each repetition.

    Raise SceneError, which names everything that the page cannot show.
    """
    refuse_any(_problems(scene))
    data = describe(scene)
    if is_structural(scene):
        if "support" not in data:
            data["support"] = describe(scene.supports[0])
        _renumber(data, scene)
    else:
        _renumber(data, scene)
        data.pop("ground", None)
        moved = scene.ground and Moved(motion=scene.ground.motion)
        data["support"] = describe(moved or scene.supports[0])
    for entry, pendulum in zip(data["pendulum"], scene.pendulum, strict=True):
        entry["links"] = [
            {key: value for key, value in describe(link).items() if key != "count"} for link in pendulum.chain
        ]
    return data


def _problems(scene: Scene) -> Iterator[str]:
    yield from refusals(scene, "the live page")
    if scene.n_links > MOST_LINKS:
        yield f"the scene has {scene.n_links} links in all: the live page cannot show more than {MOST_LINKS}"
    long, words = set(long_ones(scene)), f"the live page cannot show more than {PIECES_MAX} samples or sines of it"
    for place, motion in zip(scene.motion_places, scene.motions, strict=True):
        if motion.kind in long:
            yield f'{with_numbers(place)}.kind = "{motion.kind}": {words}'
    for k, force in enumerate(scene.force):
        if force.kind in long:
            yield f'force[{k}].kind = "{force.kind}": {words}'
    if is_structural(scene):
        yield from _structure_problems(scene)
    elif (scene.has_friction or scene.force) and scene.n_links > SWITCHED_LINKS_MAX:
        what = "dry friction" if scene.has_friction else "forces"
        words = f"cannot show {what} on more than {SWITCHED_LINKS_MAX} links"
        yield f"the scene has {scene.n_links} links in all: the live page {words}"
    else:
        yield from _named_problems(scene)
    if scene.cart and scene.cart.mass == 0 and "massless_cart" not in scene.features:
        yield "support.mass = 0.0: the live page cannot show a cart without mass"


def _structure_problems(scene: Scene) -> Iterator[str]:
    """Parts of a structure that the page cannot show."""
    count = scene.n_links + structure_of(scene).size
    if scene.n_links <= MOST_LINKS and count > PAGE_COORDINATES_MAX:
        words = f"the live page cannot show more than {PAGE_COORDINATES_MAX}"
        yield f"the structure has {count} coordinates, links included: {words}"
    yield from _named_problems(scene)


def _named_problems(scene: Scene) -> Iterator[str]:
    """Points of links that stand for several."""
    for place, text in _named_points(scene):
        point = parse_point(text)
        if isinstance(point, PendulumPoint) and scene.pendulum[point.pendulum].links[point.link].count > 1:
            yield f'{place} = "{text}": the live page cannot show what acts on all links of an entry with a count'


def _named_points(scene: Scene) -> Iterator[tuple[str, str]]:
    """Every text that names a point, with its place."""
    for k, force in enumerate(scene.force):
        yield f"force[{k}].on", force.on
    for k, spring in enumerate(scene.spring):
        for end, text in enumerate(spring.between):
            yield f"spring[{k}].between[{end}]", text


def _renumber(data: dict[str, Any], scene: Scene) -> None:
    """Points of links by their numbers where every link stands by itself."""
    for force in data.get("force", []):
        force["on"] = _renumbered(force["on"], scene)
    for spring in data.get("spring", []):
        spring["between"] = [_renumbered(text, scene) for text in spring["between"]]


def _renumbered(text: str, scene: Scene) -> str:
    point = parse_point(text)
    if not isinstance(point, PendulumPoint):
        return text
    number = sum(link.count for link in scene.pendulum[point.pendulum].links[: point.link])
    return text.replace(f".links[{point.link}]", f".links[{number}]")


def known_rows(scene: Scene) -> list[dict[str, Any]] | None:
    """κ, the 1 % angle and the star of every row of the table of a structure, which the page cannot compute.

    A row without a finite angle is empty. None where there is none, or the page computes them itself.
    """
    if not is_structural(scene):
        return None
    rows = [
        {"kappa": mode.kappa, "onePercent": mode.linear_to_1_percent_deg, "resonant": bool(mode.resonances)}
        if np.isfinite(mode.linear_to_1_percent_deg)
        else {}
        for mode in natural_modes(scene)
    ]
    return rows if any(rows) else None


def recording_of(trajectory: Trajectory) -> dict[str, Any]:
    """The samples of a motion, evenly thinned out to the capacity of a page, as 32-bit floats in base64.

    A row is (x, angles, x', rates, work) in SI units, with the coordinates of a structure for x; `drift` is that of the
    energy over the whole run.
    """
    motion, times = trajectory.motion, trajectory.times
    first, rate = motion.cart, motion.cart_rate
    if trajectory.scene.is_structured:
        first, rate = motion.supports, motion.support_rates
    elif is_structural(trajectory.scene) and not trajectory.scene.cart:
        first, rate = np.zeros((2, len(times), 0))
    rows = np.column_stack((first, motion.links, rate, motion.link_rates, motion.work))
    width = rows.shape[1]
    stride = -(-len(times) * (width + 1) // RECORDING_NUMBERS)
    kept = np.unique(np.append(np.arange(0, len(times), stride), len(times) - 1))
    return {
        "times": _packed(times[kept] - times[0]),
        "rows": _packed(rows[kept]),
        "width": width,
        "begin": float(times[0]),
        "drift": trajectory.energy_drift(),
        "samples": len(kept),
        "of": len(times),
    }


def _packed(values: Floats) -> str:
    return b64encode(np.ascontiguousarray(values, dtype="<f4").tobytes()).decode()
