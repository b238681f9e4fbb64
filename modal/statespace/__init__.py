"""State-space models of a scene for control engineers.

In: a `Scene`, and names of inputs and outputs.  Out: a `StateSpace` with named signals, its modal form, gains,
frequency and impulse responses, reduced models, sampled models, input shapers.

    z' = A z + B u,    y = C z + D u,    z = (q, q')

Start with `model` and `signals`; `loops` closes feedback loops.  `sampling`, `transfer`, `hoisting`, `travels` and
`regulator` need SciPy and are imported by their own paths.
"""

from typing import TYPE_CHECKING

from modal.lazy import lazy_attributes

if TYPE_CHECKING:
    from modal.statespace.modal_form import ModalForm, modal_gains, to_modal_form, unreached, unseen
    from modal.statespace.model import StateSpace, state_space
    from modal.statespace.reduction import minimal, truncate
    from modal.statespace.response import (
        frequency_response,
        impulse_response,
        impulse_table,
        impulse_times,
        response_table,
    )
    from modal.statespace.shapers import (
        drives_of,
        over_length,
        residual_vibration,
        robustness,
        shaper_for,
        swing_words,
        swings_of,
        usual_drive,
        usual_inputs,
    )
    from modal.statespace.signals import Signal

__all__ = [
    "ModalForm",
    "Signal",
    "StateSpace",
    "drives_of",
    "frequency_response",
    "impulse_response",
    "impulse_table",
    "impulse_times",
    "minimal",
    "modal_gains",
    "over_length",
    "residual_vibration",
    "response_table",
    "robustness",
    "shaper_for",
    "state_space",
    "swing_words",
    "swings_of",
    "to_modal_form",
    "truncate",
    "unreached",
    "unseen",
    "usual_drive",
    "usual_inputs",
]

if not TYPE_CHECKING:
    __getattr__ = lazy_attributes(__name__)
