"""Dissipation in a scene: dampers, drag and loss angles, each along one row over the coordinates.

    D = Σ_j d_j r_j r_jᵀ,      Im K = Σ_j k_j φ_j(ω) r_j r_jᵀ,

with the row r of a joint's angle, of a wire's from the vertical, of a spring's extension, of a dragged centre, of a
cart's displacement. A wire's k is the gravitational stiffness of its link, g b (N m/rad): (weight below / l) l². All
terms of a scene's dissipation are positive: power ½ (d + k φ/ω) |r q'|² at ω.
"""

from __future__ import annotations

from bisect import bisect
from collections.abc import Iterable, Iterator
from math import tau
from typing import NamedTuple

import numpy as np

from modal.assembly.arrays import Rig, rig_of
from modal.assembly.modal_damping import modal_dampers
from modal.assembly.squares import DRAG, DRAG_DOWN, JOINT, SPRING, SUPPORT, WIRE, SquareRows
from modal.assembly.structure import Hanging
from modal.scene import LossTable, Scene, is_lossy
from modal.scene.doors import checked
from modal.structure import Row, Structure
from modal.types import EPS, Floats, Ints

Loss = float | LossTable
CART, OTHER = "cart", "other"
DAMPER_KEYS = {JOINT: "damping", SPRING: "damping", DRAG: "drag", DRAG_DOWN: "drag"}
LOSS_KEYS = {JOINT: "loss", SPRING: "loss", WIRE: "wire_loss"}
"""The keys of a scene that squares of D and K belong to, by their kind."""


class Dissipator(NamedTuple):
    """A damper (N s/m or N m s/rad) or a stiffness (N/m or N m/rad) with a loss angle, at a `place` of the scene.

    It acts along `row`, by coordinates. `kind` names its sort; `number` is its link in the scene, counting copies, or
    its row of springs between points, from 0; −1 if it belongs to neither.
    """

    place: str
    kind: str
    row: Row
    damping: float = 0.0
    stiffness: float = 0.0
    loss: Loss = 0.0
    number: int = -1

    def strength(self, omega: Floats) -> Floats:
        """The coefficient d + k φ/ω (W,) of an equal damper at ω (rad/s)."""
        strength = np.full(np.shape(omega), self.damping)
        return strength + self.stiffness * loss_at(self.loss, omega) / omega if is_lossy(self.loss) else strength


def on_lines(frequencies: Floats, values: Floats, f: Floats) -> Floats:
    """Interpolate values given at ascending frequencies to `f`, linearly on logarithmic axes.

    The axes are linear if an end or its frequency is 0; beyond the first and the last the lines are continued.
    """
    at = np.clip(np.searchsorted(frequencies, f, side="right") - 1, 0, len(frequencies) - 2)
    low, high, start, end = frequencies[at], frequencies[at + 1], values[at], values[at + 1]
    straight = start + (end - start) * (f - low) / (high - low)
    positive = (start > 0) & (end > 0) & (low > 0) & (f > 0)
    with np.errstate(all="ignore"):
        power = np.log(end / start) / np.log(high / low)
        power_law = start * (f / low) ** power
    return np.where(positive, power_law, straight)


def loss_at(loss: Loss, omega: Floats) -> Floats:
    """Return a loss angle (W,) at ω (W,) in rad/s; beyond a table it is that of the nearest frequency.

    >>> from modal.scene import LossTable
    >>> loss_at(LossTable(frequency_hz=[1.0, 100.0], loss=[1e-4, 1e-2]), tau * np.array([0.1, 10.0])).tolist()
    [0.0001, 0.001]
    """
    if not isinstance(loss, LossTable):
        return np.full(np.shape(omega), float(loss))
    frequencies, values = np.array(loss.frequency_hz), np.array(loss.loss)
    if len(values) == 1:
        return np.full(np.shape(omega), values[0])
    return on_lines(frequencies, values, np.clip(np.asarray(omega) / tau, frequencies[0], frequencies[-1]))


class LossAngles(NamedTuple):
    """The loss angles of joints and wires of all links (L,) in the order of the file, as places (2, L) in `different`.

    The first of the different ones is 0.
    """

    different: tuple[Loss, ...]
    places: Ints

    def at(self, omega: Floats, links: Ints) -> Floats:
        """Return those of joints and of wires at ω (W,) for links (…), as (2, …, W)."""
        angles = np.array([loss_at(loss, omega) for loss in self.different])
        return np.asarray(angles[self.places[:, links]])

    def rig_of(self, scene: Scene) -> tuple[Rig, list[Ints]]:
        """The arrays of its scene, with pendula of different loss angles separated, and each block's links (n, P)."""
        sizes = [pendulum.n_links for pendulum in scene.pendulum for _ in range(pendulum.count)]
        starts = np.cumsum([0, *sizes])
        firsts = np.cumsum([0, *(pendulum.count for pendulum in scene.pendulum)])[:-1]
        entry_places = [self.places[:, starts[k] : starts[k + 1]] for k in firsts]
        rig = rig_of(scene, [tuple(part.ravel().tolist()) for part in entry_places])
        links = [np.zeros((block.n, block.size), dtype=np.int64) for block in rig.blocks]
        pendulum_number = 0
        for block, column, copies in rig.members:
            links[block][:, column] = starts[pendulum_number] + np.arange(rig.blocks[block].n)
            pendulum_number += copies
        return rig, links


@checked
def loss_angles(scene: Scene) -> LossAngles | None:
    """Return the loss angles of all joints and wires of a scene; None if all are 0."""
    numbers: dict[Loss, int] = {0.0: 0}
    places = [
        [numbers.setdefault(loss if is_lossy(loss) else 0.0, len(numbers)) for loss in (link.loss, link.wire_loss)]
        for pendulum in scene.hanging
        for link in pendulum.chain
    ]
    return LossAngles(tuple(numbers), np.array(places).T) if len(numbers) > 1 else None


def losses_of(scene: Scene) -> list[Dissipator]:
    """Every loss angle of a scene, along its row over the coordinates of `modal.assembly.matrices`."""
    return [dissipator for dissipator in _all_dissipators(scene) if is_lossy(dissipator.loss)]


def dissipators_of(scene: Scene) -> list[Dissipator]:
    """Return all dissipators of a scene near its equilibrium: its D and the imaginary part of its K.

    Raise ComputationError if modal dampers cannot be computed.
    """
    dissipators = [
        dissipator for dissipator in _all_dissipators(scene) if dissipator.damping or is_lossy(dissipator.loss)
    ]
    if scene.has_modal_damping:
        dissipators += _factors("damping_ratio", modal_dampers(rig_of(scene)), 0)
    return dissipators


def _all_dissipators(scene: Scene) -> list[Dissipator]:
    """All squares of D, and those of K that may have a loss angle: of supports, of links from the first on, springs."""
    rig = rig_of(scene)
    hanging = Hanging(rig)
    squares = hanging.squares()
    links = [
        (f"pendulum[{entry}].links[{at}]", link)
        for entry, pendulum in enumerate(scene.pendulum)
        for _ in range(pendulum.count)
        for at, link in enumerate(pendulum.links)
        for _ in range(link.count)
    ]
    springs = [(f"spring[{row.entry}]", scene.spring[row.entry]) for row in hanging.spring_rows]
    dissipators = list[Dissipator]()
    for keys, parts in ((DAMPER_KEYS, squares.damping), (LOSS_KEYS, squares.stiffness)):
        for part in (part for part in parts if part.kind in keys):
            kind, key = DRAG if part.kind == DRAG_DOWN else part.kind, keys[part.kind]
            for number, (at, row, size) in part.elements:
                place, owner = (springs if kind == SPRING else links)[number]
                d, k, loss = (size, 0.0, 0.0) if keys is DAMPER_KEYS else (0.0, size, getattr(owner, key))
                dissipators.append(
                    Dissipator(f"{place}.{key}", kind, dict(zip(at, row, strict=True)), d, k, loss, number)
                )
    dissipators.sort(key=lambda dissipator: (dissipator.kind == SPRING, dissipator.number, dissipator.kind == DRAG))
    return [*_of_supports(scene, rig, hanging.structure, squares.damping), *dissipators]


def _of_supports(scene: Scene, rig: Rig, structure: Structure, damping: Iterable[SquareRows]) -> Iterator[Dissipator]:
    """The dampers of supports."""
    for part in (part for part in damping if part.kind == SUPPORT):
        start = int(part.at[0, 0])
        carrier = bisect(structure.offsets, start) - 1
        place = f"support[{carrier}]" if isinstance(scene.support, tuple) else "support"
        if part.row_source is None:
            yield from _factors(f"{place}.D", part.total[0], start)
            continue
        body, start = structure.carriers[carrier], structure.offsets[carrier]
        for number, (at, row, size) in part.elements:
            suffix = f".{way}" if (way := body.way(number - start)) else ""
            kind = CART if rig.cart else OTHER
            yield Dissipator(f"{place}.damping{suffix}", kind, dict(zip(at, row, strict=True)), size)


def _factors(place: str, D: Floats, start: int) -> list[Dissipator]:
    """The rows of a matrix of dampers of coordinates from `start` on: its eigenvectors."""
    sizes, rows = np.linalg.eigh(D)
    significant = np.flatnonzero(sizes > 4 * len(D) * EPS * sizes[-1]) if len(sizes) else ()
    return [
        Dissipator(
            place, OTHER, {start + k: float(value) for k, value in enumerate(rows[:, j]) if value}, float(sizes[j])
        )
        for j in significant
    ]
