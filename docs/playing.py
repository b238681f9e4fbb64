"""The live pages of the shipped scenes: `python docs/playing.py FOLDER` writes them, as the manual's build does.

`sketch` draws a scene for the list of them, in its slowest swing.
"""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path

import numpy as np

from modal.errors import SceneError
from modal.modes import natural_modes
from modal.scene import Scene, example_names, load
from multipendula.page import MOST_LINKS, page, scaffold_of, scene_data
from nonlinear.system import system_of


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
WIDTH, HEIGHT, MARGIN = 200.0, 120.0, 14.0
LEAN = 25.0  # ° of the swing


def sketch(scene: Scene) -> str:
    """The scene in its slowest swing (a large one: hanging still) as SVG: support, links, joints."""
    if scene.is_structured:
        return _structure_sketch(scene)
    shapes = _shapes(scene)
    reach = max(np.ptp(shape[:, 1]) for shape in shapes)
    room = (0.62 if len(shapes) < 5 else 0.3) * reach
    hung = [np.add(shape, (place * room, 0)) for place, shape in enumerate(shapes)]
    low, high = np.min(np.vstack(hung), axis=0), np.max(np.vstack(hung), axis=0)
    scale = min((np.array([WIDTH, HEIGHT]) - 2 * MARGIN) / np.maximum(high - low, 1e-9))
    corner = (np.array([WIDTH, HEIGHT]) - scale * (low + high)) / 2
    drawn = [corner + scale * shape for shape in hung]
    left, top = drawn[0][0]
    right = drawn[-1][0, 0]
    parts = [f'<path class="support" d="M{left - 10:.1f} {top:.1f}H{right + 10:.1f}"/>']
    if scene.cart:
        parts.append(f'<path class="rail" d="M2 {top + 4:.1f}H{WIDTH - 2:.0f}"/>')
    for place, shape in enumerate(drawn):
        points = [f"{x:.1f},{y:.1f}" for x, y in shape]
        joints = "".join(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3.5"/>' for x, y in shape[1:] if len(shape) < 9)
        parts.append(f'<g class="c{place % 3}"><polyline points="{" ".join(points)}"/>{joints}</g>')
    return f'<svg viewBox="0 0 {WIDTH:.0f} {HEIGHT:.0f}" aria-hidden="true">{"".join(parts)}</svg>'


def _structure_sketch(scene: Scene) -> str:
    """The same of a structure, as figures draw it, with all its pendula."""
    system, modes = system_of(scene), natural_modes(scene.conservative)
    scaffold, sizes = scaffold_of(system), [each.n_links for each in scene.pendulum for _ in range(each.count)]
    shapes = [modes.shape(k) for k in range(len(modes.omega))]
    parts_moved = [
        (np.abs(moved.angles).max(), np.abs(moved.supports / scaffold.unit).max(initial=0.0)) for moved in shapes
    ]
    # the slowest in which pendula swing as far as the structure goes
    chosen = next((k for k, (swung, carried) in enumerate(parts_moved) if swung >= carried), 0)
    shape, lean = shapes[chosen], np.radians(LEAN) / max(parts_moved[chosen])
    angles = lean * np.real(shape.angles)
    for group in system.groups:
        angles[group.index] += group.rest
    eta = lean * np.real(shape.supports)[None]
    steps = system.by_link("length")[:, None] * np.stack([np.sin(angles), -np.cos(angles)], axis=1)
    ends = np.cumsum(sizes)
    chains = [
        top + np.vstack([[0.0, 0.0], np.cumsum(links, axis=0)])
        for top, links in zip(scaffold.pivots(eta)[0], np.split(steps, ends[:-1]), strict=True)
    ]
    pieces = scaffold.pieces(eta, {k: chain[None] for k, chain in enumerate(chains)})
    every = [piece.points[0] for piece in pieces] + chains
    low, high = np.min(np.vstack(every), axis=0), np.max(np.vstack(every), axis=0)
    scale = min((np.array([WIDTH, HEIGHT]) - 2 * MARGIN) / (high - low))
    corner = np.array([WIDTH, HEIGHT]) / 2 + scale * np.array([-1, 1]) * (low + high) / 2

    def placed(points: np.ndarray) -> list[str]:
        return [f"{x:.1f},{y:.1f}" for x, y in corner + scale * points * [1, -1]]

    parts = []
    for piece in pieces:
        line = "L".join(placed(piece.points[0])) + "Z" * piece.is_outline
        parts.append(f'<path class="{"body" if piece.role == "body" else "rail"}" d="M{line}"/>')
    for k, chain in enumerate(chains):
        points = placed(chain)
        places = [point.split(",") for point in points[1:]]
        joints = "".join(f'<circle cx="{x}" cy="{y}" r="{3.5 if len(chains) < MOST else 2}"/>' for x, y in places)
        parts.append(f'<g class="c{k % 3}"><polyline points="{" ".join(points)}"/>{joints}</g>')
    return f'<svg viewBox="0 0 {WIDTH:.0f} {HEIGHT:.0f}" aria-hidden="true">{"".join(parts)}</svg>'


def _shapes(scene: Scene) -> list[np.ndarray]:
    """The joints of each pendulum from the top (m): along the rail, down."""
    pendula = [each for each in scene.pendulum for _ in range(each.count)]
    lengths = [
        np.repeat([link.length for link in pendulum.links], [link.count for link in pendulum.links])
        for pendulum in pendula
    ]
    inverted = [
        np.array(pendulum.equilibrium or ["down"] * len(l)) == "up"
        for pendulum, l in zip(pendula, lengths, strict=True)
    ]
    lean = np.zeros(scene.n_links)
    if scene.n_links <= MOST_LINKS:
        modes = natural_modes(scene)
        lean = LEAN * np.real(modes.shape(next(i for i, omega in enumerate(modes.omega) if omega)).angles)
    ends = np.cumsum([len(l) for l in lengths])
    shapes = []
    for l, up, theta in list(zip(lengths, inverted, np.split(lean, ends[:-1]), strict=True))[:MOST]:
        angles = np.radians(theta + 180 * up)
        steps = l[:, None] * np.stack([np.sin(angles), np.cos(angles)], axis=1)
        shapes.append(np.vstack([[0.0, 0.0], np.cumsum(steps, axis=0)]))
    return shapes


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
