"""Structures: supports of pendula other than a fixed support or a single cart, and springs between points.

In: a `Scene`. Out: its `Structure`, supports whose points move exactly, at any angle, with their coordinates η.

    (M_s(η) + Σ J_pᵀ R_p J_p) η'' = Q_s − Σ J_pᵀ [p_p + R_p (J_p' η' − g e_z)]

`outlines` draws it. Start with `carriers`; equations of motion and matrices are derived elsewhere.
"""

from typing import TYPE_CHECKING

from modal.lazy import lazy_attributes

if TYPE_CHECKING:
    from modal.scene.points import CarrierEnd, End, GroundEnd, LinkEnd, Where
    from modal.structure.carriers import PLATFORM, CarrierNumbers, Moving, carrier_numbers
    from modal.structure.outlines import STILL, Piece, Scaffold
    from modal.structure.structure import (
        Phi,
        Row,
        SpringNumbers,
        Structure,
        bends,
        carried_weights,
        coordinate_units,
        drawn_together,
        find_imbalance,
        hung_masses,
        is_damped,
        phi,
        scale_structure,
        slopes,
        structure_of,
        tied,
        turning,
        weights,
    )


if not TYPE_CHECKING:
    __getattr__ = lazy_attributes(__name__)
