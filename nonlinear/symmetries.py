"""Scenes whose motion from a start is that of a smaller scene, exactly.

Equal pendula (bit for bit) with equal starts move as one: a pendulum with their masses, dampers and springs added up
pulls the cart as they do together.  A start in space in the vertical plane of the rail stays in it, so angles say
everything; only where joints have springs this is left alone, for a joint in space does not wind up
(`nonlinear.ball_joints`).  What symmetry ties together stays together however unstable that is; real pendula would not.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from modal.rig import ARRAYS, Ints
from nonlinear.directions import directions, velocities
from nonlinear.plant import Group, Plant
from nonlinear.state import Motion, State


@dataclass(frozen=True, eq=False)
class Symmetry:
    """A smaller `plant` that moves in the same way: how to begin there, and how the whole moves, and this in words."""

    plant: Plant
    restrict: Callable[[State], State]
    extend: Callable[[Motion], Motion]
    words: str


def symmetries(plant: Plant, start: State, *, planar: bool = True) -> tuple[Symmetry, ...]:
    """What makes a plant smaller for this start, one after the other; without `planar` a scene in space remains one."""
    found: list[Symmetry] = []
    for find in (in_one_plane, synchronous) if planar else (synchronous,):
        if symmetry := find(plant, start):
            found.append(symmetry)
            plant, start = symmetry.plant, symmetry.restrict(start)
    return tuple(found)


def in_one_plane(plant: Plant, start: State) -> Symmetry | None:
    """The planar scene of a spatial one whose start has nothing across the rail, None for any other."""
    if not plant.spatial or any(group.sprung for group in plant.groups):
        return None
    if np.any(start.links[:, 1]) or np.any(start.link_rates[:, 1]):
        return None
    return Symmetry(replace(plant, spatial=False), _angles, _vectors, "one vertical plane of space")


def _angles(state: State) -> State:
    (sin, _, cos), (along, _, down) = state.links.T, state.link_rates.T
    return replace(state, links=np.arctan2(sin, cos), link_rates=cos * along - sin * down)


def _vectors(motion: Motion) -> Motion:
    u, w = directions(motion.links, 0.0), velocities(motion.links, 0.0, motion.link_rates)
    return replace(motion, links=u, link_rates=w)


def synchronous(plant: Plant, start: State) -> Symmetry | None:
    """One pendulum for all that are equal and start equally, None where no two do."""
    groups: list[Group] = []
    kept, whole = np.zeros(0, dtype=np.int64), np.empty(plant.n_links, dtype=np.int64)
    for group in plant.groups:
        first, place, count = _kinds(group, start)
        index = len(kept) + np.arange(group.n * len(first)).reshape(len(first), group.n).T
        pendula = sum(other.index.shape[1] for other in groups) + np.arange(len(first))
        groups.append(Group(group.block.take(first).heavier(count), index, pendula))
        whole[group.index] = index[:, place]
        kept = np.concatenate((kept, group.index[:, first].T.ravel()))
    if len(kept) == plant.n_links:
        return None
    small = replace(plant, groups=tuple(groups), labels=())
    words = f"{small.n_pendula} of {plant.n_pendula} pendula, the others moving with them"
    return Symmetry(small, lambda state: _picked(state, kept), lambda motion: _spread(motion, whole), words)


def _kinds(group: Group, start: State) -> tuple[Ints, Ints, Ints]:
    """The first pendulum (by column) of each kind, every pendulum's kind, and how many there are of each."""
    columns = [getattr(group.block, name) for name in ARRAYS]
    columns += [part[group.index].reshape(group.n, -1, part[0].size) for part in (start.links, start.link_rates)]
    table = np.hstack([np.moveaxis(column, 1, 0).reshape(group.index.shape[1], -1) for column in columns])
    _, first, place, count = np.unique(table, axis=0, return_index=True, return_inverse=True, return_counts=True)
    order = np.argsort(first)
    return first[order], np.argsort(order)[place.ravel()], count[order]


def _picked(state: State, kept: Ints) -> State:
    return replace(state, links=state.links[kept], link_rates=state.link_rates[kept])


def _spread(motion: Motion, whole: Ints) -> Motion:
    return replace(motion, links=motion.links[:, whole], link_rates=motion.link_rates[:, whole])
