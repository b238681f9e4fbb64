"""The structure of a scene: its carriers, the first joints that they carry, and the springs between points.

With the coordinates η of all carriers one after another, the pivots r_p(η) with J_p = ∂r_p/∂η, and a chain that answers
an acceleration a of its pivot with the force R (a − g e_z) + p,

    (M_s(η) + Σ J_pᵀ R_p J_p) η'' = Q_s − Σ J_pᵀ [p_p + R_p (J_p' η' − g e_z)] − Σ (torques of first joints)

A first joint on a carrier that turns measures its angle from the carrier.  A carrier's own spring acts on η and carries
the weight at the drawn rest: its potential is ½ k η² + W η with W_i = g Σ m ∂z/∂η_i there, where k_i > 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

from modal.scene import Scene
from modal.scene.doors import require_type
from modal.scene.points import End, Where, hanging_points, joined_points
from modal.structure.carriers import CarrierNumbers, carrier_numbers


class Pivot(NamedTuple):
    """Where a pendulum hangs: the index of its carrier, and the point of it."""

    carrier: int
    where: Where


class SpringNumbers(NamedTuple):
    """A spring and damper between two ends, N/m and N s/m; `torsion` N m/rad and N m s/rad between their angles.

    It belongs to this `entry` of the file.
    """

    ends: tuple[End, End]
    torsion: bool
    stiffness: Any
    damping: Any
    entry: int = 0


@dataclass(frozen=True, eq=False)
class Structure:
    """Carriers in the order of the file, a pivot for each pendulum counting copies, springs."""

    carriers: tuple[CarrierNumbers, ...]
    pivots: tuple[Pivot, ...]
    springs: tuple[SpringNumbers, ...]

    @cached_property
    def offsets(self) -> tuple[int, ...]:
        """Where the coordinates of each carrier begin, and how many there are."""
        ends = [0]
        for carrier in self.carriers:
            ends.append(ends[-1] + carrier.size)
        return tuple(ends)

    @property
    def size(self) -> int:
        """How many coordinates η there are."""
        return self.offsets[-1]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The name of every coordinate with its unit: NAME_m, NAME_rad, NAME_sway_m, …; x of one cart alone."""
        if [carrier.kind for carrier in self.carriers] == ["cart"]:
            return ("x",)
        return tuple(f"{carrier.name}_{suffix}" for carrier in self.carriers for suffix in carrier.suffixes)

    @cached_property
    def turning(self) -> tuple[int, ...]:
        """Which of η are angles by which carriers turn."""
        angles = (self.angle_of(carrier) for carrier in range(len(self.carriers)))
        return tuple(angle for angle in angles if angle is not None)

    def part(self, carrier: int, values: Sequence[Any]) -> Sequence[Any]:
        """Those of η that belong to a carrier."""
        return values[self.offsets[carrier] : self.offsets[carrier + 1]]

    def angle_of(self, carrier: int) -> int | None:
        """Which of η is the angle of a carrier; None if it does not turn."""
        turning = self.carriers[carrier].turning
        return None if turning is None else self.offsets[carrier] + turning


def structure_of(scene: Scene) -> Structure:
    """The structure of a scene that is structured (`Scene.is_structured`)."""
    require_type("scene", scene, "Scene")
    carriers = tuple(carrier_numbers(support) for support in scene.supports)
    pivots = tuple(Pivot(*point) for point in hanging_points(scene))
    springs = tuple(
        SpringNumbers(ends, spring.kind == "torsion", spring.stiffness, spring.damping, entry)
        for entry, ends in joined_points(scene)
        for spring in [scene.spring[entry]]
    )
    return Structure(carriers, pivots, springs)
