"""python-control: the model as its own class."""

from __future__ import annotations

import control  # type: ignore[import-untyped]

from modal.exports.identifiers import identifier
from modal.exports.text import heading
from modal.statespace import StateSpace


def to_control(model: StateSpace) -> control.StateSpace:
    """The `control.StateSpace` with labels, sample time and name."""
    states, inputs, outputs = ([s.name for s in kind] for kind in (model.states, model.inputs, model.outputs))
    return control.StateSpace(
        *(model.A, model.B, model.C, model.D, model.dt),
        name=identifier(heading(model)),
        states=states,
        inputs=inputs,
        outputs=outputs,
    )
