"""One configuration carried from one value of a scene's number to the next.

A configuration at one value, as the physical motion q = Σ_r φ_r z_r, is the start of Newton's method at the next, in
the modes φ' of the scene there: z' = φ'ᵀ M' q.  Steps are halved where amplitudes change too fast, down to RESOLUTION
of the range; what then cannot be continued, or not from there back, is lost.  Where neighbours turn from coming back to
leaving, values between are put in by bisection.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import exp, log

import numpy as np

from modal.scene import Scene
from modal.scene.parameters import Variation
from modal.scene.places import vary
from modal.types import Complexes
from nonlinear.averaging import AveragedEquations, RelativeEquilibrium, average, relative_equilibrium, same, swinging

RESOLUTION = 1e-4  # of the range, in logarithms where the variation is in equal ratios
JUMP = 0.3  # largest change of the amplitudes from one value to the next, over them
CLOSE = 1e-5  # relative: by how much the way back may miss

Step = tuple[float, RelativeEquilibrium]


class Walk:
    """Along the values of a variation, with as many between as amplitudes need."""

    def __init__(self, scene: Scene, variation: Variation) -> None:
        self.scene, self.variation = scene, variation
        self._made: dict[float, AveragedEquations] = {}

    def at(self, value: float) -> AveragedEquations:
        """The averaged equations there."""
        if value not in self._made:
            self._made[value] = average(vary(self.scene, {self.variation.path: value}))
        return self._made[value]

    def whole(self, value: float, state: RelativeEquilibrium) -> list[Step]:
        """All that is reached from a configuration, to both sides, in ascending order."""
        up = [v for v in self.variation.values if v > value]
        down = [v for v in reversed(self.variation.values) if v < value]
        steps = [*reversed(self._followed(value, state, down)), (value, state), *self._followed(value, state, up)]
        return [steps[0], *(step for pair in pairwise(steps) for step in self._sharpened(*pair))]

    def _followed(self, value: float, state: RelativeEquilibrium, further: Sequence[float]) -> list[Step]:
        """To the last of these values, or to where it is lost."""
        found: list[Step] = []
        for target in further:
            found += self._between(found[-1] if found else (value, state), target)
            if not found or found[-1][0] != target:
                break
        return found

    def _between(self, here: Step, target: float) -> list[Step]:
        """What follows up to a value, that included if it is reached."""
        if state := self._next(here, target):
            return [(target, state)]
        if self._close(here[0], target):
            return []
        middle = self._middle(here[0], target)
        half = self._between(here, middle)
        reached = bool(half) and half[-1][0] == middle
        return half + (self._between(half[-1], target) if reached else [])

    def _sharpened(self, before: Step, after: Step) -> list[Step]:
        """What follows a step up to the next, with values between where one lasts and the other does not."""
        if (before[1].lasts is True) == (after[1].lasts is True) or self._close(before[0], after[0]):
            return [after]
        middle = self._middle(before[0], after[0])
        state = self._next(before, middle) or self._next(after, middle)
        if state is None:
            return [after]
        return self._sharpened(before, (middle, state)) + self._sharpened((middle, state), after)

    def _next(self, here: Step, value: float) -> RelativeEquilibrium | None:
        """The same configuration there, None where the way back leads elsewhere: that is another branch."""
        found = self.moved(here[1], value)
        back = self.moved(found, here[0]) if found else None
        return found if back and same(back, here[1], CLOSE) else None

    def moved(self, state: RelativeEquilibrium, value: float) -> RelativeEquilibrium | None:
        """The same configuration at another value, None where there is none nearby."""
        z = _carried(state, self.at(value))
        found = relative_equilibrium(self.at(value), z)
        if found is None or len(swinging(found.averaged, found.z)) != len(swinging(found.averaged, z)):
            return None
        weight = found.averaged.omega
        return found if np.linalg.norm(weight * (found.z - z)) <= JUMP * np.linalg.norm(weight * z) else None

    def _close(self, one: float, other: float) -> bool:
        a, b, first, last = map(self._scaled, (one, other, self.variation.values[0], self.variation.values[-1]))
        return abs(a - b) <= RESOLUTION * (last - first)

    def _middle(self, one: float, other: float) -> float:
        middle = (self._scaled(one) + self._scaled(other)) / 2
        return exp(middle) if self.variation.log else middle

    def _scaled(self, value: float) -> float:
        return log(value) if self.variation.log else value


def _carried(state: RelativeEquilibrium, new: AveragedEquations) -> Complexes:
    """The amplitudes of the same motion in other modes, in as many bands as swung before."""
    z = new.dual.T @ (state.averaged.shapes @ state.z)
    energy = np.bincount(new.band, weights=(new.omega * np.abs(z)) ** 2)
    kept = np.argsort(-energy)[: len(swinging(state.averaged, state.z))]
    return np.where(np.isin(new.band, kept), z, 0.0)
