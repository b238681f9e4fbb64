"""What a page is given: a scene with every link written out, and a saved motion."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from modal.errors import SceneError
from modal.scene import Moved, Scene, describe, refusals
from modal.types import Floats

if TYPE_CHECKING:
    from nonlinear.integration import Trajectory

MOST_LINKS = 60
MOST_NUMBERS = 30_000
"""Of a recording: 160 kB as 32-bit floats in base64."""


def scene_data(scene: Scene) -> dict[str, Any]:
    """A scene as nested mappings with the keys of its file, each link once for each repetition.

    Raises SceneError, which names everything that a page does not treat.
    """
    if problems := list(_problems(scene)):
        raise SceneError(problems)
    data = describe(scene)
    data.pop("ground", None)
    moved = scene.ground and Moved(motion=scene.ground.motion)
    data["support"] = describe(moved or scene.supports[0])
    for own, pendulum in zip(data["pendulum"], scene.pendulum, strict=True):
        own["links"] = [
            {key: value for key, value in describe(link).items() if key != "count"}
            for link in pendulum.links
            for _ in range(link.count)
        ]
    return data


def _problems(scene: Scene) -> Iterator[str]:
    yield from refusals(scene, "the live page")
    if scene.n_links > MOST_LINKS:
        yield f"the scene has {scene.n_links} links in all: the live page shows at most {MOST_LINKS}"
    motions = scene.motions
    if len(motions) > 1:
        yield "support.motion: the live page moves a support in one direction"
    elif motions and motions[0].kind != "sine":
        yield f'support.motion.kind = "{motions[0].kind}": the live page moves a support in a sine'
    if scene.cart and scene.cart.mass == 0 and "massless_cart" not in scene.features:
        yield "support.mass = 0.0: the live page needs a cart with mass"


def recording_of(trajectory: Trajectory) -> dict[str, Any]:
    """The samples of a motion, evenly thinned out to what a page holds, as 32-bit floats in base64.

    A row is (x, angles, x', rates, work) in SI units; `drift` is that of the energy over the whole run.
    """
    motion, times = trajectory.motion, trajectory.times
    links = trajectory.system.n_links
    width = 2 * (links + 1) + 1
    stride = -(-len(times) * (width + 1) // MOST_NUMBERS)
    rows = np.column_stack((motion.cart, motion.links, motion.cart_rate, motion.link_rates, motion.work))
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
