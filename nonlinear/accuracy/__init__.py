"""Computing time against error: the cheapest method for a requested accuracy, and work-precision studies.

In: a scene, an accuracy in rad, a duration.  Out: `Advice`, the run with its evidence, or `WorkPrecision`, every method
with its time and its error against a reference, up to the horizon

    t* = ln(tolerable/ε)/λ

beyond which the motion is unpredictable.  Start with `advice`; `references` has the candidates and the
solutions with which they are compared, `work_precision` compares their times and errors.
"""

from typing import TYPE_CHECKING

from modal.lazy import lazy_attributes

if TYPE_CHECKING:
    from nonlinear.accuracy.advice import Advice, Goal, advice_table, seek_accuracy
    from nonlinear.accuracy.references import Candidate, list_candidates
    from nonlinear.accuracy.work_precision import (
        FrequencyTradeoff,
        WorkPrecision,
        WorkPrecisionRow,
        frequencies_table,
        measure_frequencies,
        measure_work_precision,
        tradeoff_table,
    )

__all__ = [
    "Advice",
    "Candidate",
    "FrequencyTradeoff",
    "Goal",
    "WorkPrecision",
    "WorkPrecisionRow",
    "advice_table",
    "frequencies_table",
    "list_candidates",
    "measure_frequencies",
    "measure_work_precision",
    "seek_accuracy",
    "tradeoff_table",
]

if not TYPE_CHECKING:
    __getattr__ = lazy_attributes(__name__)
