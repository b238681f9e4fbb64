"""The model as an object of another package, loaded on use: python-control, SciPy."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from modal.exports.identifiers import identifier
from modal.exports.text import heading
from modal.statespace import StateSpace

if TYPE_CHECKING:
    import control  # type: ignore[import-untyped]


def to_control(model: StateSpace) -> control.StateSpace:
    """The `control.StateSpace` with labels, sample time and name."""
    from control import StateSpace as Labelled

    states, inputs, outputs = ([s.name for s in kind] for kind in (model.states, model.inputs, model.outputs))
    return Labelled(
        *(model.A, model.B, model.C, model.D, model.dt),
        name=identifier(heading(model)),
        states=states,
        inputs=inputs,
        outputs=outputs,
    )


def to_scipy(model: StateSpace) -> Any:
    """The `scipy.signal.StateSpace`, or a `dlti` for a discrete model; neither has names."""
    from scipy.signal import StateSpace as Continuous
    from scipy.signal import dlti

    parts = model.A, model.B, model.C, model.D
    return dlti(*parts, dt=model.dt) if model.dt else Continuous(*parts)
