"""What van der Pol torques feed small swings with: the strength e at every joint, by kinds of pendula."""

from __future__ import annotations

import numpy as np

from modal.assembly import Rig
from modal.scene import Pendulum, Scene, VanDerPol
from modal.types import Floats


def negative_damping(scene: Scene, rig: Rig) -> tuple[Floats, ...]:
    """Strengths e (N m s/rad) of one copy, (n, P) of each block; of equal pendula with unequal drives, their mean."""
    found = tuple(np.zeros_like(block.damping) for block in rig.blocks)
    for pendulum, (block, column, copies) in zip(scene.pendulum, rig.members, strict=True):
        found[block][:, column] += np.array(_of(pendulum)) * copies / rig.blocks[block].count[column]
    return found


def _of(pendulum: Pendulum) -> list[float]:
    drives = (link.drive for link in pendulum.links for _ in range(link.count))
    return [drive.strength if isinstance(drive, VanDerPol) else 0.0 for drive in drives]
