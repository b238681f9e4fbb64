"""Optimization of parameters: dampers, lengths or springs for the best peaks, RMS, decay or residual swing.

In: a scene, the places of free numbers with bounds, and quantities to minimize or maximize. Out: a `Tuned` with the
scene of the best numbers, the sensitivity to each, Den Hartog's values next to them, and curves before and after.

    min over p of max over k |H(iω_k; p)|,      dH = −yᵀ dZ x

Start with `search`; `quantities` names what is tuned, `model` has responses with exact derivatives and all peaks,
`minimax` the descent and Newton's method on equal peaks, `objective` the objective and the sensitivities.
"""

from modal.tuning.objective import Aim, Load, MassCase, Worth
from modal.tuning.quantities import FreeNumber, Limit, Quantity, parse_limit, parse_quantity
from modal.tuning.result import (
    Absorber,
    Curves,
    Rule,
    Tuned,
    Valley,
    absorbers,
    den_hartog,
    exact_optimum,
    tuned_json,
    tuned_record,
    tuned_text,
)
from modal.tuning.search import tune

__all__ = [
    "Absorber",
    "Aim",
    "Curves",
    "FreeNumber",
    "Limit",
    "Load",
    "MassCase",
    "Quantity",
    "Rule",
    "Tuned",
    "Valley",
    "Worth",
    "absorbers",
    "den_hartog",
    "exact_optimum",
    "parse_limit",
    "parse_quantity",
    "tune",
    "tuned_json",
    "tuned_record",
    "tuned_text",
]
__dir__ = __all__.copy
