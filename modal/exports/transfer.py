"""Transfer functions as JSON: poles, zeros, gain and polynomials of every pair of an input and an output."""

from __future__ import annotations

from modal.errors import ComputationError
from modal.modes import natural_modes
from modal.report import as_json
from modal.statespace import StateSpace, to_modal_form
from modal.statespace.transfer import transfer_functions
from modal.types import Complexes


def write_transfer(model: StateSpace) -> bytes:
    """One object for every pair; ComputationError for a sampled or reduced model."""
    if model.scene is None or model.dt:
        raise ComputationError("transfer functions need a whole model in continuous time")
    form = to_modal_form(natural_modes(model.scene), model)
    records = [
        {
            "input": function.input.name,
            "output": function.output.name,
            "unit": f"{function.output.unit} per {function.input.unit}",
            "gain": function.gain,
            "zeros": _pairs(function.zeros),
            "poles": _pairs(function.poles),
            "numerator": function.numerator.tolist(),
            "denominator": function.denominator.tolist(),
        }
        for row in transfer_functions(form)
        for function in row
    ]
    return as_json({"title": model.title, "transfer_functions": records}).encode()


def _pairs(values: Complexes) -> list[list[float]]:
    return [[value.real, value.imag] for value in values.tolist()]
