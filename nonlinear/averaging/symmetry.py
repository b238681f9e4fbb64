"""Copies of a motion: equal pendula exchanged, and the phase of every band shifted.

All pendula hang from one support, so that a motion in which equal ones have exchanged their parts is a motion too, and
averaged equations do not know phases common to a band:

    z' = e^{iφ_b} Φ⁻¹ P Φ z

is as good a state as z, for every permutation P of equal pendula.  The two splay states of three equal metronomes are
such copies.  A mirror image θ → −θ, x → −x is the motion itself, half a swing later.

A motion is compared pendulum by pendulum: one that swings widest is brought to each pendulum that could have its part,
which gives the φ_b, and the others are assigned to it as well as they fit.
"""

from __future__ import annotations

from collections import Counter
from functools import lru_cache
from math import factorial, prod

import numpy as np
import scipy

from modal.scene import Scene
from modal.types import Booleans, Complexes, Floats, Ints
from nonlinear.averaging.equations import AveragedEquations
from nonlinear.system import burdens

IMAGES_MAX = 24
"""Cost: pendula tried as the image of the widest; benchmarks/sync/exchange.py."""
AMPLITUDE_DIFFERENCE_MIN = 1e-3
"""Tolerance: over the widest amplitude, from which on two pendula do not do the same, and a band is not at rest:
settling leaves 1e-4."""


@lru_cache(maxsize=16)
def kinds(scene: Scene) -> Ints:
    """The number of the first pendulum that each is equal to but for its start, from 0, (N,).

    Equal ones bear equal springs and forces.
    """
    bare = [pendulum.replace(start=None, count=1) for pendulum in scene.pendulum]
    numbers = [
        bare.index(plain) for plain, pendulum in zip(bare, scene.pendulum, strict=True) for _ in range(pendulum.count)
    ]
    first: dict[tuple[int, int], int] = {}
    return np.array([first.setdefault(pair, p) for p, pair in enumerate(zip(numbers, burdens(scene), strict=True))])


def exchange(equations: AveragedEquations, z: Complexes, order: Ints) -> Complexes:
    """Amplitudes (C,) of the motion in which pendulum p does what pendulum `order[p]` does in z (C,)."""
    q = equations.shapes @ z
    first, places = equations.system.first, _places(equations)
    new_q = q.copy()
    for p, source in enumerate(order):
        new_q[first + places[p]] = q[first + places[source]]
    return np.asarray(equations.dual.T @ new_q)


def spread_evenly(equations: AveragedEquations, z: Complexes) -> Complexes:
    """Amplitudes (C,) of pendula that all swing as wide as the widest in z (C,), one after the other in time."""
    first, places = equations.system.first, _places(equations)
    links = equations.link_shapes @ z
    widest = np.abs(links).max()
    for p, place in enumerate(places):
        shape = links[place] if np.abs(links[place]).max() > AMPLITUDE_DIFFERENCE_MIN * widest else np.ones(len(place))
        lead = shape[np.abs(shape).argmax()]
        links[place] = widest / lead * np.exp(2j * np.pi * p / len(places)) * shape
    return np.asarray(links @ equations.dual[first:])


def overlap(equations: AveragedEquations, reference: Complexes, z: Complexes) -> Floats:
    """How alike amplitudes z (C, S) are to `one` (C,), but for size and the phase of each band: from 0 to 1, (S,)."""
    weights = equations.omega**2
    products = ((weights * reference.conj())[:, None] * z)[None] * equations.member[..., None]
    norm = np.sqrt(np.sum(weights * np.abs(reference) ** 2) * (weights @ np.abs(z) ** 2))
    alike = np.abs(products.sum(axis=1)).sum(axis=0)
    return np.asarray(np.divide(alike, norm, out=np.zeros_like(norm), where=norm > 0))


def order_of(equations: AveragedEquations, reference: Complexes, z: Complexes) -> Ints:
    """The exchange of equal pendula (N,) that makes z (C,) as like `one` (C,) as possible."""
    links, others = _by_pendulum(equations, reference), _by_pendulum(equations, z)
    kind = kinds(equations.scene)
    best, order = -np.inf, np.arange(len(kind))
    for turn in _turns(links, others, kind):
        gain = np.einsum("pnb,qnb->pq", links.conj(), others * turn).real
        rows, columns = scipy.optimize.linear_sum_assignment(
            np.where(kind[:, None] == kind, gain, -1e9 * np.abs(gain).max()), True
        )
        if (total := float(gain[rows, columns].sum())) > best:
            best, order = total, columns
    return order


def count_copies(equations: AveragedEquations, z: Complexes) -> int:
    """How many different motions the exchanges of equal pendula make of z (C,): N! over those that change nothing."""
    kind, links = kinds(equations.scene), _by_pendulum(equations, z)
    alike = _alike(links, links, kind)
    set_sizes = map(sum, set(map(tuple, alike.tolist())))
    distinct: list[Complexes] = []
    for turn in _turns(links, links, kind, max_images=len(kind)):
        if all(np.abs(turn - neighbour).max() > AMPLITUDE_DIFFERENCE_MIN for neighbour in distinct):
            matches = _alike(links, links * turn, kind)
            if np.array_equal(np.sort(matches.sum(axis=0)), np.sort(alike.sum(axis=0))) and matches.any(axis=0).all():
                distinct.append(turn)
    n_permutations = prod(map(factorial, Counter(kind.tolist()).values()))
    return n_permutations // (max(len(distinct), 1) * prod(map(factorial, set_sizes)))


def _turns(links: Complexes, others: Complexes, kind: Ints, max_images: int = IMAGES_MAX) -> list[Complexes]:
    """The factors e^{−iφ_b} (B,) that bring the images of the pendulum that swings widest to its phases."""
    size = np.abs(links).max(axis=(1, 2))
    widest = int(size.argmax())
    images = np.flatnonzero(kind == kind[widest])
    images = images[np.argsort(np.abs(np.abs(others).max(axis=(1, 2))[images] - size[widest]), kind="stable")][
        :max_images
    ]
    shifts = (np.sum(links[widest] * others[image].conj(), axis=0) for image in images)
    return [np.where(np.abs(shift) > 0, shift / np.maximum(np.abs(shift), 1e-300), 1.0) for shift in shifts]


def _alike(links: Complexes, others: Complexes, kind: Ints) -> Booleans:
    """Which pendula of one kind do the same in two motions, (N, N)."""
    distance = np.abs(links[:, None] - others[None]).max(axis=(2, 3))
    return np.asarray((distance <= AMPLITUDE_DIFFERENCE_MIN * np.abs(links).max()) & (kind[:, None] == kind))


def _places(equations: AveragedEquations) -> list[Ints]:
    """The links of every pendulum from top to bottom."""
    places: dict[int, Ints] = {}
    for group in equations.system.groups:
        places.update(zip(group.pendula.tolist(), group.index.T, strict=True))
    return [places[p] for p in range(len(places))]


def _by_pendulum(equations: AveragedEquations, z: Complexes) -> Complexes:
    """Complex angles (rad) of every link in every band, (N, n, B), 0 beyond the last link of a pendulum."""
    links, places = equations.link_shapes @ (z[:, None] * equations.member.T), _places(equations)
    angles = np.zeros((len(places), max(map(len, places)), links.shape[1]), dtype=complex)
    for p, place in enumerate(places):
        angles[p, : len(place)] = links[place]
    return angles
