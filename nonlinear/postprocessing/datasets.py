"""Trajectories and ensembles as labelled data sets; the only user of xarray.

A trajectory is over `time`, `pendulum` and `link`, numbered from 1 as in the table.  Every variable and coordinate has
its unit in the attribute `units` and a `long_name`, by which xarray labels its figures.  An ensemble is over `member`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any

import numpy as np

from modal.errors import ComputationError, MissingExtraError
from modal.scene import title_of
from modal.types import Floats, Ints
from nonlinear.integration import Trajectory
from nonlinear.integration.arguments import NUMBERS_MAX

AXES = ("x", "y", "z")
"""Along the rail, across it, down."""


def dataset_of(trajectory: Trajectory) -> Any:
    """The `xarray.Dataset` of `Trajectory.to_xarray`.

    Raise MissingExtraError without xarray, ComputationError if pendula of very different length would fill it with NaN.
    """
    xarray = _xarray()
    system, motion, run, scene = trajectory.system, trajectory.motion, trajectory.run, trajectory.scene
    pendulum = system.pendulum
    first = np.searchsorted(pendulum, pendulum)
    place = pendulum, np.asarray(np.arange(len(pendulum)) - first)
    counts = (system.n_pendula, int(place[1].max()) + 1)
    if len(trajectory.times) * counts[0] * counts[1] > NUMBERS_MAX:  # with those that fill up shorter pendula
        raise ComputationError(
            f"a data set of {len(trajectory.times)} × {counts[0]} × {counts[1]} numbers is too large"
        )
    spatial = system.spatial
    dims = ("time", "pendulum", "link", *["axis"] * spatial)
    links, rates = (_spread(values, place, counts) for values in (motion.links, motion.link_rates))
    variables: dict[str, Any] = {"work": ("time", motion.work, _attributes("J", "work of dampers and applied forces"))}
    if spatial:
        variables["direction"] = (dims, links, _attributes("1", "unit vector along the link"))
        variables["direction_rate"] = (dims, rates, _attributes("1/s", "its rate"))
    else:
        variables["angle"] = (dims, links, _attributes("rad", "angle from the downward vertical"))
        variables["angular_rate"] = (dims, rates, _attributes("rad/s", "angular rate"))
    if system.cart is not None:
        variables["cart"] = ("time", motion.cart, _attributes("m", "position of the cart"))
        variables["cart_rate"] = ("time", motion.cart_rate, _attributes("m/s", "velocity of the cart"))
    if system.structure is not None:
        for k, name in enumerate(system.structure.names):
            unit = "rad" if k in system.structure.turning else "m"
            variables[name] = ("time", motion.supports[:, k], _attributes(unit, f"coordinate {name} of the structure"))
            variables[f"{name}_rate"] = ("time", motion.support_rates[:, k], _attributes(f"{unit}/s", "its rate"))
    coordinates = {
        "time": ("time", trajectory.times, _attributes("s", "time")),
        "pendulum": np.arange(1, counts[0] + 1),
        "link": np.arange(1, counts[1] + 1),
        **({"axis": list(AXES)} if spatial else {}),
    }
    title = title_of(scene)
    attributes = {"title": title, "form": run.form, "method": run.method, "tolerance": run.tolerance}
    return xarray.Dataset(variables, coordinates, attributes)


def dataset_of_rows(
    size: int,
    coordinates: Mapping[str, Floats],
    columns: Mapping[str, tuple[int, ...]],
    rows: Callable[[str, Ints, tuple[int, ...]], Floats],
    attributes: Mapping[str, Any],
) -> Any:
    """The `xarray.Dataset` over this many members of columns (size, …), each given by the shape for one member.

    `rows` gives some members of a column of such a shape, and is asked when numbers are used.
    """
    xarray = _xarray()
    indexing, backends = (import_module(f"xarray.{name}") for name in ("core.indexing", "backends"))

    class ColumnOnDisk(backends.BackendArray):  # type: ignore[misc, name-defined]
        """A column that is read where it is requested."""

        def __init__(self, name: str) -> None:
            self.name, self.shape, self.dtype = name, (size, *columns[name]), np.dtype(float)

        def __getitem__(self, key: Any) -> Any:
            outer = indexing.IndexingSupport.OUTER
            return indexing.explicit_indexing_adapter(key, self.shape, outer, self._read)

        def _read(self, key: tuple[Any, ...]) -> Floats:
            members = np.arange(size)[key[0]]
            values = rows(self.name, np.atleast_1d(members), self.shape[1:])
            for axis in range(len(key) - 1, 0, -1):
                values = values[(*[slice(None)] * axis, key[axis])]
            return np.asarray(values if np.ndim(members) else values[0])

    variables = {
        name: (("member", *(f"{name}_{k}" for k in range(len(tail)))), indexing.LazilyIndexedArray(ColumnOnDisk(name)))
        for name, tail in columns.items()
    }
    member_coordinates = {name: ("member", values) for name, values in coordinates.items()}
    return xarray.Dataset(variables, {"member": np.arange(size), **member_coordinates}, attributes)


def _xarray() -> Any:
    try:
        return import_module("xarray")
    except ImportError:
        raise MissingExtraError("xarray", "xarray") from None


def _attributes(units: str, long_name: str) -> dict[str, str]:
    return {"units": units, "long_name": long_name}


def _spread(values: Floats, place: tuple[Ints, Ints], counts: tuple[int, int]) -> Floats:
    """Values (T, L, …) over pendula and links, (T, P, n, …), NaN if there is no link."""
    spread = np.full((len(values), *counts, *values.shape[2:]), np.nan)
    spread[:, place[0], place[1]] = values
    return spread
