"""Frequency responses between named signals of a scene, from its arrays: every input to every output.

Pendula are eliminated from their tips (`modal.eigen.elimination`), which leaves the cart's equation

    (k_c + iωd_c − ω²(m_c + Σ μ)) x = F + Σ (e + ω²ε) + (k_c + iωd_c) s

for a force F on it, the ground displaced by s and the loads e + ω²ε that pendula pass on.  A prescribed cart or support
is a displacement x; velocities and accelerations are iω and −ω² times displacements.  A scene with damping ratios,
whose D is full, is eliminated as a whole (`modal.statespace.full_damping`), as is one that leans under constant forces,
one with an input at a point and one on a structure (`modal.statespace.structural`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from modal.assembly import Dissipator, LossAngles, Rig, loss_angles, rig_of
from modal.eigen import FORCE, REPLICAS, Arithmetic, Hung, Load, Rounded, cart_of, evaluated, hung
from modal.scene import Scene
from modal.statespace.full_damping import whole_response
from modal.statespace.places import BASE, GROUND, PAIRS, PUSH, READ, SignalPlace, place_of, place_of_input
from modal.statespace.points import is_point
from modal.statespace.signals import Signal
from modal.types import Complexes, Floats, Ints

TOLERANCE = 1e-12
"""Relative error of every entry."""
NUMBERS = 2**21
"""Floats at once."""
LIMIT = 2.0**-200
"""The frequency, over that of the fastest link alone, that stands for 0."""
Evaluate = Callable[[Arithmetic], Any]


class ExactResponse:
    """G between these signals of a scene of constant lengths, evaluated by elimination wherever it is asked for.

    A dissipator among the inputs is the pair of unit forces along its row.  KeyError for signals that are not those of
    `modal.statespace.signals`.
    """

    def __init__(self, scene: Scene, inputs: Sequence[Signal | Dissipator], outputs: Sequence[Signal]) -> None:
        angles = loss_angles(scene)
        rig, links = angles.rig_of(scene) if angles and not scene.is_structured else (rig_of(scene), [])
        tips = [rig.blocks[block].n - 1 for block, _, copies in rig.members for _ in range(copies)]
        whole = is_whole(scene, inputs)
        self.is_real = not (rig.is_damped or scene.has_modal_damping or scene.has_losses)
        self.unit = float(np.sqrt(rig.gravity / min(float(block.length.min()) for block in rig.blocks)))
        if whole:
            self._evaluate, of, to = whole_response(scene, inputs, outputs)
            orders = [[row.order - column.order for column in of] for row in to]
        else:
            driven = [place_of_input(signal, tips) for signal in inputs]
            read = [place_of(READ, signal.name, tips) for signal in outputs]
            self._evaluate = _from_tips(rig, driven, read, angles, links)
            orders = [[row.order - column.order for column in driven] for row in read]
        self._orders = np.array(orders)[..., None]
        width = sum(block.n * block.size for block in rig.blocks) * (1 + len(inputs)) + len(inputs) * len(outputs)
        width += (sum(tip + 1 for tip in tips) + rig.leading) ** 2 if whole else 0
        self._step = max(1, NUMBERS // width // (REPLICAS + 1))

    def along(self, omega: Floats, tolerance: float = TOLERANCE, remainder: Floats | None = None) -> Complexes:
        """G(iω) (p, m, W) at ω (W,) in rad/s, each entry to this relative error.

        Positive frequencies may be given as sums of two floats: `remainder` (W,) is what one leaves out, which is felt
        within some billionths of a resonance.
        At ω = 0 the limit, infinite where there is none.
        """
        still = omega == 0
        at = np.where(still, LIMIT * self.unit, np.abs(omega))
        response = self._displacements(at, tolerance, is_real=self.is_real, remainder=remainder)
        with np.errstate(all="ignore"):
            response *= np.array([1, 1j, -1, -1j])[self._orders % 4] * np.float_power(at, self._orders)
        return _limits(np.where(omega < 0, np.conj(response), response), still, at)

    def at(self, s: Complexes, tolerance: float = TOLERANCE) -> Complexes:
        """G(s) (p, m, W) at s (W,) in 1/s, each entry to this relative error."""
        response = self._displacements(-1j * s, tolerance, is_real=False)
        return np.asarray(response * np.power(s, self._orders), dtype=np.complex128)

    def roughly_at(self, s: Complexes) -> tuple[Complexes, Floats]:
        """G(s) (p, m, W) in floats, and its rounding error."""
        with np.errstate(all="ignore"):
            values, errors = (numbers := Rounded(-1j * s)).results(self._evaluate(numbers))
            factor = np.power(s, self._orders)
            return values * factor, errors * np.abs(factor)

    def _displacements(
        self, omega: Floats | Complexes, tolerance: float, *, is_real: bool, remainder: Floats | None = None
    ) -> Complexes:
        """Displacements and forces for displacements and forces."""
        beyond = np.zeros(len(omega)) if remainder is None else remainder
        spans = [slice(first, first + self._step) for first in range(0, len(omega), self._step)]
        responses = [
            evaluated(self._evaluate, omega[span], is_real=is_real, tolerance=tolerance, remainder=beyond[span])
            for span in spans
        ]
        return (
            np.concatenate(responses, axis=-1) if responses else np.zeros((*self._orders.shape[:2], 0), np.complex128)
        )


def is_whole(scene: Scene, inputs: Sequence[Signal | Dissipator]) -> bool:
    """Whether a scene is eliminated as a whole for these inputs, and not from the tips of its pendula."""
    leans = "constant_force" in scene.features
    alone = any(
        signal.kind not in PAIRS if isinstance(signal, Dissipator) else is_point(signal.name) for signal in inputs
    )
    return scene.is_structured or scene.has_modal_damping or leans or alone


def _limits(response: Complexes, still: Any, at: Floats) -> Complexes:
    """At ω = 0 powers of the frequency that stands for it become 0 and infinity."""
    if still.any():
        size, edge = np.abs(response), np.sqrt(at)
        response = np.where(still & (size * edge > 1), np.inf, np.where(still & (size < edge), 0.0, response))
    return response


def _from_tips(
    rig: Rig,
    driven: Sequence[SignalPlace],
    read: Sequence[SignalPlace],
    angles: LossAngles | None,
    links: Sequence[Ints],
) -> Evaluate:
    """The evaluation (p, m, W) of displacements for displacements and forces; `links` are those of each block."""
    members = [(block, column) for block, column, copies in rig.members for _ in range(copies)]
    loads: list[list[Load]] = [
        sorted(
            {
                (place.what, place.link)
                for place in driven
                if place.pendulum >= 0 and members[place.pendulum][0] == number
            }
        )
        for number in range(len(rig.blocks))
    ]

    def evaluate(numbers: Arithmetic) -> Any:
        losses: list[Any] = (
            [angles.at(numbers.rates, of_block) for of_block in links] if angles else [None] * len(rig.blocks)
        )
        parts = zip(rig.blocks, loads, losses, strict=True)
        every = [hung(block, of_block, rig.gravity, numbers, lost) for block, of_block, lost in parts]
        nothing = 0 * numbers.omega
        moved = np.array([nothing + place for place in _pivots(rig, every, driven, members, loads, numbers)])
        rows = []
        for row in read:
            if row.pendulum < 0:
                rows.append(moved)
                continue
            block, column = members[row.pendulum]
            values = _read(every[block], rig.blocks[block].n, column, row, numbers)
            G = values[0] * moved
            for k, place in enumerate(driven):
                if place.pendulum == row.pendulum:
                    G[k] = G[k] + values[1 + loads[block].index((place.what, place.link))]
            rows.append(G)
        return np.array(rows)

    return evaluate


def _pivots(
    rig: Rig,
    every: Sequence[Hung],
    driven: Sequence[SignalPlace],
    members: Sequence[tuple[int, int]],
    loads: Sequence[Sequence[Load]],
    numbers: Arithmetic,
) -> list[Any]:
    """The displacement of all pivots for every input."""
    base = any(place.what == BASE for place in driven)
    direct: Any = 0
    inertial: Any = 0
    ground: Any = 1
    if rig.cart and not base:
        counts = (numbers.number(block.count[:, None]) for block in rig.blocks)
        mass = np.sum([(count * place.mass).sum(0) for count, place in zip(counts, every, strict=True)], axis=0)
        direct, inertial, ground = cart_of(rig.cart, mass, numbers)
    pivots: list[Any] = []
    for place in driven:
        if place.pendulum < 0:
            pivots.append({BASE: 1, GROUND: ground, PUSH: direct}[place.what])
            continue
        block, column = members[place.pendulum]
        load = loads[block].index((place.what, place.link))
        pushed = inertial * every[block].inertial[column, load]
        pivots.append(pushed + direct * every[block].direct[column, load] if place.what == FORCE else pushed)
    return pivots


def _read(chain: Hung, links: int, column: int, row: SignalPlace, numbers: Arithmetic) -> Any:
    """An output for a displaced pivot, then for each load, (1 + L, W)."""
    if row.what == "pivot_force":
        square = numbers.omega * numbers.omega
        passed = chain.direct[column] + square * chain.inertial[column]
        return numbers.felt(np.concatenate([(square * chain.mass[column])[None], passed]))
    if row.what == "joint":
        return chain.joints[row.link + 1, column]
    above = chain.angles[row.link - 1, column] if row.what == "rel" and row.link else 0
    return chain.angles[row.link, column] - above
