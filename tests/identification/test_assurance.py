"""MAC matrices against their definition in many digits, and pairs of measured with computed modes."""

from __future__ import annotations

import json

import mpmath
import numpy as np
import pytest

from modal import load
from modal.identification import MeasuredMode, MeasuredModes, assurance_table, compare_modes
from modal.identification.decays import modal_assurance
from modal.modes import natural_modes
from modal.scene.parameters import vary


def by_definition(shape: np.ndarray, other: np.ndarray) -> float:
    with mpmath.workdps(40):
        phi, psi = (mpmath.matrix([complex(value) for value in vector]) for vector in (shape, other))
        inner = sum(mpmath.conj(a) * b for a, b in zip(phi, psi, strict=True))
        sizes = [sum(abs(a) ** 2 for a in vector) for vector in (phi, psi)]
        return float(abs(inner) ** 2 / (sizes[0] * sizes[1]))


def test_the_matrix_is_its_definition() -> None:
    rng = np.random.default_rng(0)
    shapes, other = (rng.standard_normal((5, n)) + 1j * rng.standard_normal((5, n)) for n in (3, 4))
    assurance = modal_assurance(shapes, other)
    expected = [[by_definition(shapes[:, r], other[:, s]) for s in range(4)] for r in range(3)]
    assert np.allclose(assurance, expected, rtol=1e-13)
    assert np.allclose(np.diag(modal_assurance(shapes, 2j * shapes)), 1, rtol=1e-14)
    assert modal_assurance(0 * shapes, other).max() == 0


def measured(swapped: bool = False) -> MeasuredModes:
    modes = natural_modes(load("chain-3"))
    shapes = modes.matrix.shapes.T
    order = (1, 0, 2) if swapped else (0, 1, 2)
    measured_modes = [
        MeasuredMode(k + 1, float(modes.omega[row]) / (2 * np.pi) * 1.01, 1e-3, None, None, -2.5 * shapes[row])
        for k, row in enumerate(order)
    ]
    return MeasuredModes("m.csv", tuple(measured_modes), ((1, 1), (1, 2), (1, 3)))


def test_shapes_pair_modes_whatever_their_numbers() -> None:
    scene = load("chain-3")
    modes = natural_modes(scene)
    comparison = compare_modes(modes, measured(swapped=True))
    assert [(pair.measured.number, pair.computed.number) for pair in comparison.pairs] == [(1, 2), (2, 1), (3, 3)]
    assert all(pair.mac == pytest.approx(1, abs=1e-12) for pair in comparison.pairs)
    assert all(pair.error == pytest.approx(1 / 1.01 - 1, rel=1e-9) for pair in comparison.pairs)
    for r, mode in enumerate(comparison.measured.modes):
        for s in range(3):
            assert mode.shape is not None
            assert comparison.mac[r, s] == pytest.approx(
                by_definition(mode.shape, modes.matrix.shapes[:, s]), rel=1e-12, abs=1e-14
            )
    assert any("is like mode 2 of the table" in note for note in comparison.notes)


def test_without_shapes_frequencies_pair_modes() -> None:
    measurement = MeasuredModes("m.csv", (MeasuredMode(1, 1.2, 1e-3), MeasuredMode(2, 0.34, 1e-3)))
    comparison = compare_modes(natural_modes(load("chain-3")), measurement)
    assert [(pair.measured.number, pair.computed.number) for pair in comparison.pairs] == [(1, 3), (2, 1)]
    assert np.isnan(comparison.mac).all()


def test_a_shared_frequency_is_compared_with_its_nearest_shape() -> None:
    pendulum = load("chain-2").pendulum[0]
    scene = load("chain-2").replace(pendulum=(pendulum.replace(count=2),))
    single = natural_modes(load("chain-2")).matrix.shapes[:, 0]
    mixed = np.concatenate((0.3 * single, -1.1 * single))
    measurement = MeasuredModes(
        "m.csv", (MeasuredMode(1, 0.4, 1e-3, None, None, mixed),), ((1, 1), (1, 2), (2, 1), (2, 2))
    )
    comparison = compare_modes(natural_modes(scene), measurement)
    assert comparison.mac[0, 0] == pytest.approx(1, abs=1e-12)
    assert comparison.pairs[0].computed.number == 1


def test_a_damped_shape_is_compared_by_its_real_part() -> None:
    scene = vary(load("chain-3"), {"pendulum[0].links[0].damping": 0.05})
    comparison = compare_modes(natural_modes(scene), measured())
    assert np.diag(comparison.mac).min() > 0.999


def test_formats_hold_the_same_numbers() -> None:
    comparison = compare_modes(natural_modes(load("chain-3")), measured())
    whole = json.loads(assurance_table(comparison, "json"))
    assert np.allclose(whole["mac"], comparison.mac)
    assert whole["pairs"][0]["relative_error"] == pytest.approx(1 / 1.01 - 1)
    header, first, *_ = assurance_table(comparison, "csv").splitlines()
    assert header == "measured,mode_1,mode_2,mode_3"
    assert np.allclose(list(map(float, first.split(",")[1:])), comparison.mac[0])
    assert "MAC" in assurance_table(comparison, "text")
