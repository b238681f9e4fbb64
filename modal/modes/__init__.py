"""The modes of a scene: their table, their shapes, and the sensitivity of both to a parameter.

In: a `Scene`.  Out: `Modes`, one `Mode` per row, with frequency, damping ratio, shape, participation factor, modal
effective mass, the amplitude at which the small-angle frequency is off by 1 %, a residual and an error bound.

    q(t) = Re Σ_r c_r φ_r e^{λ_r t}

Start with `modes`. `numbering` gives a mode the same number everywhere, `tables` prints, `rope` is the limit of long
chains. The names below are loaded on first use.
"""

from typing import TYPE_CHECKING

from modal.lazy import lazy_attributes

if TYPE_CHECKING:
    from modal.eigen import UNCERTAIN
    from modal.modes.dissipation import mode_losses, quality_factors, sliding_modes, stop_of
    from modal.modes.energies import ModeEnergies, mode_energies
    from modal.modes.frequencies import natural_frequencies
    from modal.modes.mode import Mode
    from modal.modes.modes import MOST_LISTED, ModalMatrix, Modes, all_shapes, equilibrium_words, natural_modes
    from modal.modes.numbering import MOST_COMPARED, counterparts, letters, number_labels, pair_rows, table_numbers
    from modal.modes.rope import hanging_rope, rope_error_of_bobs, rope_error_of_rods
    from modal.modes.rows import moving_words
    from modal.modes.sensitivity import sensitivities
    from modal.modes.shapes import Shape
    from modal.modes.tables import table

__all__ = [
    "MOST_COMPARED",
    "MOST_LISTED",
    "UNCERTAIN",
    "ModalMatrix",
    "Mode",
    "ModeEnergies",
    "Modes",
    "Shape",
    "all_shapes",
    "counterparts",
    "equilibrium_words",
    "hanging_rope",
    "letters",
    "mode_energies",
    "mode_losses",
    "moving_words",
    "natural_frequencies",
    "natural_modes",
    "number_labels",
    "pair_rows",
    "quality_factors",
    "rope_error_of_bobs",
    "rope_error_of_rods",
    "sensitivities",
    "sliding_modes",
    "stop_of",
    "table",
    "table_numbers",
]

if not TYPE_CHECKING:
    __getattr__ = lazy_attributes(__name__)
