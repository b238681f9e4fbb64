"""The live pages of the shipped scenes: `python docs/playing.py FOLDER` writes them, as the manual's build does.

`sketch` draws a scene for the list of them, as it hangs at its start.
"""

from __future__ import annotations

import sys
from functools import cache
from itertools import accumulate, chain, repeat
from math import cos, radians, sin
from pathlib import Path

from modal.errors import SceneError
from modal.scene import Pendulum, Scene, example_names, load
from multipendula.page import page, scene_data


@cache
def pages() -> dict[str, tuple[Scene, str]]:
    """Every shipped scene by its name, and why it has no page (empty where it has one)."""
    return {name: (load(name), _reason(load(name))) for name in example_names()}


def _reason(scene: Scene) -> str:
    try:
        scene_data(scene)
    except SceneError as error:
        return "; ".join(error.problems)
    return ""


MOST = 9
"""Pendula of a sketch; of more, as many are drawn."""
WIDTH, HEIGHT = 200.0, 120.0
MARGIN = 14.0


def sketch(scene: Scene) -> str:
    """The scene at its start as SVG: support, links and joints, in colours by pendulum."""
    pendula = list(chain.from_iterable(repeat(one, one.count) for one in scene.pendulum))[:MOST]
    shapes = [_points(one) for one in pendula]
    reach = max(sum(link.length * link.count for link in one.links) for one in pendula)
    room = 0.62 * reach if len(pendula) < 5 else 0.3 * reach
    hung = [[(x + place * room, y) for x, y in shape] for place, shape in enumerate(shapes)]
    across = [x for shape in hung for x, _ in shape]
    down = [y for shape in hung for _, y in shape] + [0.0]
    wide, high = max(across) - min(across), max(down) - min(down)
    scale = min((WIDTH - 2 * MARGIN) / max(wide, 1e-9), (HEIGHT - 2 * MARGIN) / max(high, 1e-9))
    left, top = (WIDTH - scale * wide) / 2 - scale * min(across), (HEIGHT - scale * high) / 2 - scale * min(down)
    lines = [
        f'<polyline class="c{place % 3}" points="'
        + " ".join(f"{left + scale * x:.1f},{top + scale * y:.1f}" for x, y in shape)
        + '"/>'
        for place, shape in enumerate(hung)
    ]
    first, last = left - 10, left + scale * room * (len(hung) - 1) + 10
    support = f'<path class="support" d="M{first:.1f} {top:.1f}H{last:.1f}"/>'
    if scene.support.kind == "cart":
        support += f'<path class="rail" d="M2 {top + 4:.1f}H{WIDTH - 2:.0f}"/>'
    return f'<svg viewBox="0 0 {WIDTH:.0f} {HEIGHT:.0f}" aria-hidden="true">{support}{"".join(lines)}</svg>'


def _points(pendulum: Pendulum) -> list[tuple[float, float]]:
    """Joints of a pendulum from the top (m): along the rail, down."""
    start = pendulum.start
    angles = (
        list(start.angles_deg) if start else [180.0 if side == "up" else 0.0 for side in pendulum.equilibrium or ()]
    )
    angles = angles or [0.0] * sum(link.count for link in pendulum.links)
    lengths = chain.from_iterable(repeat(link.length, link.count) for link in pendulum.links)
    steps = [(one * sin(radians(angle)), one * cos(radians(angle))) for one, angle in zip(lengths, angles, strict=True)]
    return list(accumulate(steps, lambda at, by: (at[0] + by[0], at[1] + by[1]), initial=(0.0, 0.0)))


def build(folder: Path) -> None:
    """Write the page of every scene that has one."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, (scene, why) in pages().items():
        if not why:
            (folder / f"{name}.html").write_text(page(scene_data(scene)), encoding="utf-8")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("which folder? python docs/playing.py FOLDER")
    build(Path(sys.argv[1]))
