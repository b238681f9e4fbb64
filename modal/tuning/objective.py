"""What is minimized: quantities with weights and limits, in the logarithms of free numbers, over several cases."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from modal.report import Displayed, Summary
from modal.scene import Scene
from modal.scene.parameters import Place
from modal.tuning.minimax import APART, HELPING, Evaluation, Faces
from modal.tuning.pieces import Pieces, Quantities, Setting
from modal.tuning.quantities import FreeNumber, Limit, Quantity
from modal.types import Floats

Factors = Mapping[Place, float]


@dataclass(frozen=True, repr=False)
class Aim(Displayed):
    """A quantity that is to be small, or large where it is `maximized`."""

    quantity: Quantity
    maximized: bool = False

    @property
    def sign(self) -> float:
        """Of its cost, times its weight."""
        return -self.quantity.weight if self.maximized else self.quantity.weight

    def _summary(self) -> Summary:
        return Summary(self.words)

    @property
    def words(self) -> str:
        """What is done with it."""
        weight = f"{self.quantity.weight:g}*" if self.quantity.weight != 1 else ""
        return f"{'maximize' if self.maximized else 'minimize'} {weight}{self.quantity.name}"


class Objective:
    """Costs and limits of a scene at z, logarithms of its free numbers.

    One quantity that is positive by nature counts by its logarithm, a sum or a damping ratio by itself over `scale`.
    `cases` are factors of masses; of every cost the worst of them counts.
    """

    def __init__(
        self,
        scene: Scene,
        free: Sequence[FreeNumber],
        aims: Sequence[Aim],
        limits: Sequence[Limit],
        setting: Setting,
    ) -> None:
        self.aims, self.limits, self.free = tuple(aims), tuple(limits), tuple(free)
        every = [*(named.quantity for named in aims), *(named.quantity for named in limits)]
        self.quantities = Quantities(scene, free, every, setting)
        self.is_log = len(aims) == 1 and aims[0].quantity.kind != "damping"
        self.scale = 1.0
        self.cases: tuple[Factors, ...] = ({},)
        self.low = np.log([named.low for named in free])
        self.high = np.log([named.high for named in free])
        self.start = np.log([named.start for named in free])
        self._places = [named.place for named in free]

    def numbers(self, z: Floats) -> Floats:
        """The free numbers (n,)."""
        return np.asarray(np.exp(z))

    def scene_at(self, z: Floats, factors: Factors | None = None) -> Scene:
        """The scene with these numbers."""
        return self.quantities.scene_at(self.numbers(z), factors)

    def pieces(self, z: Floats, factors: Factors | None = None) -> list[Pieces]:
        """Those of every quantity without derivatives, those of limits last."""
        return self.quantities.at(self.numbers(z), factors)

    def evaluate(self, z: Floats, with_gradients: bool) -> Evaluation:
        """Costs and limits, the worst of all cases."""
        values, n = self.numbers(z), len(z)
        every: list[list[Faces]] = []
        for k, factors in enumerate(self.cases):
            pieces = self.quantities.at(values, factors, by=self._places if with_gradients else None)
            varied = np.array([values[j] * factors.get(place, 1.0) for j, place in enumerate(self._places)])
            every.append(
                [self._face(j, piece, varied, k, n, with_gradients=with_gradients) for j, piece in enumerate(pieces)]
            )
        faces = [_joined(parts) for parts in zip(*every, strict=True)]
        return Evaluation(np.asarray(z), tuple(faces[: len(self.aims)]), tuple(faces[len(self.aims) :]))

    def _face(self, j: int, piece: Pieces, varied: Floats, case: int, n: int, *, with_gradients: bool) -> Faces:
        values, gradients, at = piece.values, piece.gradients, piece.at
        slopes = gradients * varied if with_gradients else np.zeros((len(values), n))
        labels = np.log(np.maximum(at, 1e-12)) + APART * case
        labels = labels if piece.helps is None else labels + HELPING * piece.helps
        if j >= len(self.aims):
            limit = self.limits[j - len(self.aims)]
            return Faces(np.log(np.maximum(values, 1e-300) / limit.most), _relative(slopes, values), labels)
        aim = self.aims[j]
        sign = aim.sign
        is_convex = (sign > 0) == aim.quantity.is_largest
        if len(values) and not is_convex:
            best = int(values.argmax() if aim.quantity.is_largest else values.argmin())
            values, slopes, labels = values[[best]], slopes[[best]], labels[[best]]
        if self.is_log:
            way = float(np.sign(sign))
            return Faces(way * np.log(np.maximum(values, 1e-300)), way * _relative(slopes, values), labels)
        return Faces(sign * values / self.scale, sign * slopes / self.scale, labels)

    def value_of(self, pieces: Sequence[Pieces]) -> float:
        """The objective itself, a quantity alone without its sign and weight; infinite where it has no value."""
        values = [extreme(aim.quantity, piece) for aim, piece in zip(self.aims, pieces, strict=False)]
        if len(self.aims) == 1:
            return values[0]
        return float(sum(aim.sign * value for aim, value in zip(self.aims, values, strict=True)))

    def value(self, z: Floats, factors: Factors | None = None) -> float:
        """The same at z."""
        return self.value_of(self.pieces(z, factors))

    @property
    def direction(self) -> float:
        """1 where a larger objective is worse, −1 where it is better."""
        return -1.0 if len(self.aims) == 1 and self.aims[0].maximized else 1.0


def extreme(quantity: Quantity, pieces: Pieces) -> float:
    """The quantity itself, infinite where it has no value."""
    if not len(pieces.values):
        return np.inf if quantity.is_largest else -np.inf
    return float(pieces.values.max() if quantity.is_largest else pieces.values.min())


def _relative(slopes: Floats, values: Floats) -> Floats:
    return np.asarray(slopes / np.maximum(values, 1e-300)[:, None])


def _joined(parts: Sequence[Faces]) -> Faces:
    if any(not len(part.values) for part in parts):
        return next(part for part in parts if not len(part.values))
    return Faces(
        np.concatenate([part.values for part in parts]),
        np.concatenate([part.gradients for part in parts]),
        np.concatenate([part.at for part in parts]),
    )
