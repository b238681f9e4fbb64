"""Trajectories as columns and as data sets: the same numbers as the motion and the CSV."""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np
import pytest

import modal
from modal.errors import ComputationError, MissingExtraError
from modal.scene import Bob, Cart, InitialCondition, Pendulum, Scene
from nonlinear import Trajectory, save, simulate
from nonlinear.postprocessing import datasets


def uneven() -> Trajectory:
    """A double pendulum, two single ones, and a triple one."""
    parts = [
        Pendulum(
            links=[Bob(mass=1.0, length=1.0, count=n)],
            count=count,
            start=InitialCondition(angles_deg=[10.0 * (k + 1) for k in range(n)]),
        )
        for n, count in ((2, 1), (1, 2), (3, 1))
    ]
    return simulate(Scene(gravity=9.81, support=Cart(mass=2.0), pendulum=parts), 0.5, output=6)


def test_columns_are_those_of_the_csv(tmp_path: Path) -> None:
    run = uneven()
    save(run, tmp_path / "run.csv")
    with (tmp_path / "run.csv").open(encoding="utf-8") as stream:
        head, *rows = csv.reader(stream)
    columns = run.to_dict()
    assert list(columns) == head
    np.testing.assert_array_equal(np.array(list(columns.values())).T, np.array(rows, dtype=float))
    np.testing.assert_array_equal(columns["theta_4_3_rad"], run.motion.links[:, 6])


def test_a_data_set_has_the_motion_by_time_pendulum_and_link() -> None:
    pytest.importorskip("xarray")
    run = uneven()
    data, columns = run.to_xarray(), run.to_dict()
    assert dict(data.sizes) == {"time": 6, "pendulum": 4, "link": 3}
    assert data["angle"].dims == ("time", "pendulum", "link")
    for pendulum, links in enumerate((2, 1, 1, 3), start=1):
        for link in range(1, 4):
            angle = data["angle"].sel(pendulum=pendulum, link=link)
            if link <= links:
                np.testing.assert_array_equal(angle, columns[f"theta_{pendulum}_{link}_rad"])
            else:
                assert np.isnan(angle).all()
    np.testing.assert_array_equal(data["cart"], columns["x_m"])
    assert data["time"].attrs["units"] == "s"
    assert data["angular_rate"].attrs["units"] == "rad/s"
    assert data["work"].attrs["units"] == "J"


def test_a_data_set_in_space_has_unit_vectors() -> None:
    pytest.importorskip("xarray")
    run = simulate(modal.load("chain-spatial"), 0.5, output=5)
    data = run.to_xarray()
    assert data["direction"].dims == ("time", "pendulum", "link", "axis")
    assert data["axis"].values.tolist() == ["x", "y", "z"]
    np.testing.assert_allclose((data["direction"] ** 2).sum("axis"), 1.0, rtol=1e-12)
    np.testing.assert_array_equal(data["direction"].sel(axis="y", link=2, pendulum=1), run.to_dict()["uy_1_2"])
    assert "cart" not in data


def test_without_xarray_its_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(MissingExtraError, match=r'xarray is missing: pip install "\.\[xarray\]"'):
        uneven().to_xarray()


def test_a_data_set_that_is_almost_empty_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("xarray")
    monkeypatch.setattr(datasets, "NUMBERS_MAX", 71)
    with pytest.raises(ComputationError, match="6 × 4 × 3"):
        uneven().to_xarray()
