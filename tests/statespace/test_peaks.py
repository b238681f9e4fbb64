"""Peaks of a frequency response stand where a dense sampling has its largest values."""

from __future__ import annotations

import json

import numpy as np
import pytest

from modal import load, natural_modes
from modal.statespace import frequency_response, state_space, to_modal_form
from modal.statespace.response import peaks_table


@pytest.mark.parametrize("name", ["tower", "crane-hook"])
def test_peaks_are_those_of_a_dense_sampling(name: str) -> None:
    scene = load(name)
    form = to_modal_form(natural_modes(scene), state_space(scene))
    outputs = range(len(form.model.outputs))
    peaks = json.loads(peaks_table(form, 0, outputs, "json"))["peaks"]
    assert {peak["output"] for peak in peaks} == {output.name for output in form.model.outputs}
    omega = 2 * np.pi * np.geomspace(0.1, 3.0, 20_001)
    for k in outputs:
        rows = [peak for peak in peaks if peak["output"] == form.model.outputs[k].name]
        size = np.abs(frequency_response(form, omega, outputs=[k], inputs=[0], tolerance=1e-8)[0, 0])
        at = np.flatnonzero((size[1:-1] > size[:-2]) & (size[1:-1] > size[2:])) + 1
        assert [peak["frequency_hz"] for peak in rows] == pytest.approx((omega[at] / 2 / np.pi).tolist(), rel=2e-4)
        if name == "tower":
            assert [peak["magnitude"] for peak in rows] == pytest.approx(size[at].tolist(), rel=3e-5)
            assert all(peak["magnitude"] >= largest for peak, largest in zip(rows, size[at], strict=True))
        else:
            assert [peak["magnitude"] for peak in rows] == [None] * 2
