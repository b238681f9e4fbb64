"""Stability of the symmetric motions of populations, by sectors of perturbations, with reasons.

Every population as one pendulum, in phase or in antiphase, is a motion of any such scene. Its perturbations fall into
sectors (`nonlinear.averaging.populations`), and each has a growth rate: by the Floquet multipliers of the periodic
orbit and by the averaged equations. Within a population of pendula with van der Pol drives that rate follows from the
trace and the determinant of one averaged block of two rows, of which the trace vanishes where the amplitude is 1/√2 of
that of a free pendulum: half its energy is drained.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from modal.errors import ComputationError
from modal.report import Displayed, Summary, brief, silent
from modal.scene import Scene, VanDerPol
from modal.scene.doors import require_type
from nonlinear.averaging import AveragedPattern, Pattern, averaged_pattern, patterns_of
from nonlinear.orbits import PatternOrbit, free_amplitude, pattern_orbit


@dataclass(frozen=True, eq=False, repr=False)
class SymmetricMotion(Displayed):
    """A pattern with its periodic orbit, and averaged, where it was found; `silent` says why there is no motion."""

    pattern: Pattern
    averaged: AveragedPattern | None
    orbit: PatternOrbit | None
    silent: str = ""

    def _summary(self) -> Summary:
        if self.orbit is None:
            return Summary(f"Populations {self.pattern.name}: {self.silent}", [])
        return Summary(f"Populations {self.pattern.name}", [("growth (1/s)", brief(np.array(self.orbit.growth)))])

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the sectors."""
        return tuple(sector.name for sector in self.pattern.sectors)

    @property
    def is_stable(self) -> bool:
        """Whether its orbit exists, and perturbations of every sector decay."""
        return self.orbit is not None and self.orbit.is_stable

    @cached_property
    def drained(self) -> float | None:
        """The amplitude of the first population over that of a free pendulum; None if that has no meaning."""
        if self.orbit is None or not self.is_van_der_pol:
            return None
        free = free_amplitude(self.pattern.scene, self.pattern.populations[0].pendulum)
        return self.orbit.amplitudes[0] / free if free else None

    @property
    def is_van_der_pol(self) -> bool:
        """Whether all pendula are single links with van der Pol drives."""
        links = [group.pendulum.links for group in self.pattern.populations]
        return all(
            len(drives) == 1 and drives[0].count == 1 and isinstance(drives[0].drive, VanDerPol) for drives in links
        )

    def reason(self, sector: int) -> str:
        """Why perturbations of a sector within a population grow or are marginal: the trace or the determinant."""
        if self.orbit is None or not self.is_van_der_pol or not self.names[sector].startswith("within"):
            return ""
        if not self.orbit.turns[sector]:
            return "the determinant of its within-block is negative" if self.orbit.growth[sector] > 0 else ""
        share = "" if self.drained is None else f", drained to {self.drained:.3g} of the free amplitude"
        return f"the trace of its within-block is {'positive' if self.orbit.growth[sector] > 0 else 'negative'}{share}"

    def crossing(self, sector: int) -> str:
        """The same at a value where the growth rate of the sector vanishes."""
        if self.orbit is None or not self.is_van_der_pol or not self.names[sector].startswith("within"):
            return ""
        if not self.orbit.turns[sector]:
            return "the determinant of the within-block vanishes"
        share = "" if self.drained is None else f", drained to {self.drained:.4g} of the free amplitude"
        return f"the trace of the within-block vanishes{share}"


def symmetric_motions(scene: Scene, report: Callable[[float], object] = silent) -> tuple[SymmetricMotion, ...]:
    """The patterns of a structured scene with their growth rates; raise ComputationError if populations have none.

    `report` is called with the part of them that is done.
    """
    require_type("scene", scene, "Scene")
    patterns = tuple(patterns_of(scene))
    motions = []
    for count, pattern in enumerate(patterns, start=1):
        motions.append(symmetric_motion(pattern))
        report(count / len(patterns))
    return tuple(motions)


def symmetric_motion(pattern: Pattern, neighbour: SymmetricMotion | None = None) -> SymmetricMotion:
    """A pattern with its growth rates, found compared with those of a scene with other numbers if given."""
    try:
        averaged_motion = averaged_pattern(pattern, None if neighbour is None else neighbour.averaged)
        orbit = pattern_orbit(pattern, averaged_motion)
    except ComputationError as error:
        return SymmetricMotion(pattern, None, None, str(error))
    return SymmetricMotion(pattern, averaged_motion, orbit)
