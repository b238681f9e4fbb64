"""Frequency loci: every natural frequency of a scene along one of its parameters.

In: a `Scene` and a `Variation`.  Out: `Loci`: each mode followed by its shape, and where two loci cross or veer.

    dω²/dp = φᵀ (dK/dp − ω² dM/dp) φ,    φᵀ M φ = 1

Start with `following`, which pairs the modes of neighbouring values, and finds crossings and veerings.
"""

from modal.loci.following import CloseApproach, Loci, follow_loci, loci_csv, loci_text, span_of, state_columns

__all__ = ["CloseApproach", "Loci", "follow_loci", "loci_csv", "loci_text", "span_of", "state_columns"]
__dir__ = __all__.copy
