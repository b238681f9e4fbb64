"""The columns of modes as arrays: those of the table's JSON and CSV, those of the rows one by one, and their cost."""

from __future__ import annotations

import csv
import io
import json
from typing import Any

import numpy as np
import pytest

import modal
from modal.eigen import ModalSpectrum
from modal.modes import Modes, natural_modes
from modal.scene import Bob, Cart, Pendulum, Rod, Scene

NAMES = {
    "mode": "number",
    "omega_rad_per_s": "omega",
    "frequency_hz": "frequency",
    "period_s": "period",
    "damping_ratio": "damping_ratio",
    "growth_rate_per_s": "growth_rate",
    "multiplicity": "multiplicity",
    "family": "family",
    "cart_participation": "cart_participation",
    "effective_mass_kg": "effective_mass",
    "effective_mass_share": "effective_mass_share",
    "effective_mass_across_kg": "effective_mass_across",
    "linear_to_1_percent_deg": "linear_to_1_percent_deg",
    "kappa_per_rad2": "kappa",
    "resonances": "resonances",
    "residual": "residual",
    "relative_error_bound": "relative_error_bound",
    "indistinct": "indistinct",
}
"""The names of the arrays by the keys of the table."""
WITHOUT_SHAPES = (
    *("number", "eigenvalue", "omega", "frequency", "period", "damping_ratio", "growth_rate", "multiplicity"),
    *("error", "relative_error_bound", "indistinct"),
)


def beyond_precision() -> Scene:
    """A link that stands a hair below the point at which its spring would hold it."""
    rod = Rod(mass=1.0, length=1.0, stiffness=9.81 / 2 * (1 + 1e-14))
    return Scene(gravity=9.81, pendulum=[Pendulum(links=[rod], equilibrium=["up"])])


def family() -> Scene:
    """Five equal pendula in space and two others of the same length, with damping by mode."""
    equal = Pendulum(links=[Bob(mass=1.0, length=1.0)], count=5)
    other = Pendulum(links=[Bob(mass=2.0, length=1.0)], count=2)
    return Scene(gravity=9.81, space="space", support=Cart(mass=3.0), pendulum=[equal, other])


SCENES = {
    name: modal.load(name)
    for name in ("paper-cart-3", "huygens", "clocks-double", "cart-upright", "chain-spatial", "metronomes")
} | {
    "ratio": modal.load("paper-cart-2").replace(damping_ratio=0.02),
    "overdamped": modal.load("chain-2").replace(
        pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0, damping=40.0), Bob(mass=1.0, length=1.0)])]
    ),
    "family": family(),
    "beyond": beyond_precision(),
}


def modes_of(name: str) -> Modes:
    return natural_modes(SCENES[name])


def as_text(value: Any) -> str:
    """A value as a CSV file has it: nothing where it is undefined or infinite."""
    if value is None or (isinstance(value, float) and not np.isfinite(value)):
        return ""
    return str(value.item() if isinstance(value, np.generic) else value)


def number(value: Any) -> Any:
    return np.nan if value is None else value


@pytest.mark.parametrize("name", SCENES)
def test_columns_are_those_of_the_table(name: str) -> None:
    modes = modes_of(name)
    rows = json.loads(modes.table("json"))["modes"]
    with np.errstate(all="ignore"):
        for key, attribute in NAMES.items():
            column = getattr(modes, attribute)
            assert column.shape == (len(modes),)
            told = [row[key] if key != "resonances" else "; ".join(row[key]) for row in rows]
            if column.dtype.kind in "US":
                assert column.tolist() == told
            else:  # JSON has no infinity, which stands for "never"
                finite = np.where(np.isfinite(column.astype(float)), column.astype(float), np.nan)
                np.testing.assert_array_equal(finite, np.array([number(value) for value in told], dtype=float))


@pytest.mark.parametrize("name", SCENES)
def test_columns_are_those_of_the_rows_one_by_one(name: str) -> None:
    modes = modes_of(name)
    every = {key: [] for key in NAMES.values()}
    for mode in modes_of(name):
        for key, values in every.items():
            values.append(
                "; ".join(mode.resonances) if key == "resonances" else number(getattr(mode, key, mode.number))
            )
    for key, values in every.items():
        np.testing.assert_array_equal(getattr(modes, key), np.array(values))
    assert modes.description.tolist() == [mode.description for mode in modes]


@pytest.mark.parametrize("name", ["huygens", "overdamped", "cart-upright"])
def test_columns_of_frequencies_follow_from_eigenvalues(name: str) -> None:
    modes = modes_of(name)
    re, im = modes.eigenvalue.real, modes.eigenvalue.imag
    swings = im > 0
    assert swings.any()
    assert not swings.all()
    np.testing.assert_allclose(modes.period[swings], 2 * np.pi / im[swings], rtol=1e-12)
    np.testing.assert_allclose(modes.frequency[swings], np.hypot(re, im)[swings] / (2 * np.pi), rtol=1e-14)
    assert np.isnan(modes.period[~swings]).all()
    np.testing.assert_allclose(np.nan_to_num(modes.growth_rate), np.where(re > 0, re, 0.0), rtol=1e-12)


def test_no_digit_of_an_uncertain_frequency_is_shown() -> None:
    modes = modes_of("beyond")
    assert np.isnan([modes.damping_ratio[0], modes.frequency[0], modes.period[0]]).all()
    assert not any(f"{modes.omega[0]:.3g}"[:4] in text for text in (repr(modes), repr(modes[0]), modes._repr_html_()))


def test_to_dict_has_every_column_of_the_csv() -> None:
    modes = modes_of("huygens")
    record = modes.to_dict()
    head, *lines = csv.reader(io.StringIO(modes.table("csv")))
    assert list(record) == head
    assert lines == [list(map(as_text, row)) for row in zip(*(record[key].tolist() for key in head), strict=True)]


@pytest.mark.parametrize("name", ["huygens", "paper-cart-3", "cart-upright"])
def test_a_mode_by_itself_has_its_row_of_the_columns(name: str) -> None:
    modes = modes_of(name)
    record = modes.to_dict()
    for k, mode in enumerate(modes):
        row = mode.to_dict()
        assert list(row) == [key for key in record if key != "fixed_base_effective_mass_kg"]
        assert [*map(as_text, row.values())] == [as_text(record[key][k]) for key in row]
        assert not any(value != value for value in row.values())


def test_a_data_frame_is_the_table() -> None:
    pandas = pytest.importorskip("pandas")
    modes = modes_of("paper-cart-3")
    frame = pandas.DataFrame(modes.to_dict()).set_index("mode")
    told = pandas.read_csv(io.StringIO(modes.table("csv")), keep_default_na=True).set_index("mode")
    assert list(frame.columns) == list(told.columns)
    np.testing.assert_allclose(frame["omega_rad_per_s"], told["omega_rad_per_s"], rtol=0)
    assert frame.loc[2, "family"] == told.loc[2, "family"] == modes[1].family
    shape = pandas.DataFrame(modes.shape(1).to_dict())
    assert shape["kinetic_energy_share"].sum() == pytest.approx(1.0)


def test_frequencies_need_no_shape(monkeypatch: pytest.MonkeyPatch) -> None:
    """A hundred thousand pendula, and a rope of a thousand links, without the details of a single one."""

    def never(self: ModalSpectrum, *arguments: object) -> object:
        raise AssertionError("a shape was computed")

    crowd = Scene(
        gravity=9.81,
        support=Cart(mass=10.0),
        pendulum=[
            Pendulum(links=[Bob(mass=1.0, length=1.0)], count=99_999),
            Pendulum(links=[Bob(mass=1.0, length=2.0)]),
        ],
    )
    for scene in (crowd, modal.load("rope")):
        modes = natural_modes(scene)
        with monkeypatch.context() as patch:
            patch.setattr(ModalSpectrum, "details", never)
            for name in WITHOUT_SHAPES:
                assert len(getattr(modes, name)) == len(modes)
            with pytest.raises(AssertionError, match="a shape"):
                _ = modes.effective_mass


def test_the_rows_are_computed_once_for_all_columns(monkeypatch: pytest.MonkeyPatch) -> None:
    modes, asked = modes_of("paper-cart-3"), []
    details = ModalSpectrum.details

    def counted(self: ModalSpectrum, *arguments: Any) -> Any:
        asked.append(arguments)
        return details(self, *arguments)

    monkeypatch.setattr(ModalSpectrum, "details", counted)
    first = modes.family
    once = len(asked)
    assert once > 0
    assert (modes.effective_mass >= 0).all()
    assert modes.description.tolist() == first.tolist()
    assert len(modes.residual) == len(modes)
    assert len(asked) == once


def test_columns_cannot_be_written() -> None:
    modes = modes_of("paper-cart-3")
    for name in (*WITHOUT_SHAPES, *NAMES.values()):
        with pytest.raises(ValueError, match="read-only"):
            getattr(modes, name)[0] = getattr(modes, name)[1]


def test_selected_modes_keep_their_numbers() -> None:
    chosen = natural_modes(modal.load("rope"), modes=slice(3, 6))
    assert chosen.number.tolist() == [4, 5, 6]
    (first, *_) = json.loads(chosen.table("json", shapes=True))["modes"]
    assert first["mode"] == 4
    assert first["shapes"][0]["angles_rad"] == pytest.approx(
        natural_modes(modal.load("rope"), modes=slice(0, 4)).shape(3).angles
    )
    assert chosen.to_dict()["mode"].tolist() == [4, 5, 6]
    assert len(chosen.plot([0, 2]).axes) == 2


def test_the_table_is_that_of_the_command(capsys: pytest.CaptureFixture[str]) -> None:
    from multipendula.cli import main

    assert main(["table", "paper-cart-2", "--format", "csv"]) == 0
    assert capsys.readouterr().out == natural_modes(modal.load("paper-cart-2")).table("csv")
