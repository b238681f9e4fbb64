"""Trajectories on disk: NPZ holds everything to the last bit, CSV the same numbers to read and plot elsewhere.

Both begin with a header in JSON: the scene, how the run was made and what happened.  In a CSV it stands in a comment on
the first line; a column is named by its quantity, the pendulum and the link (both from 1) and its unit.
"""

from __future__ import annotations

import io
import json
import os
import warnings
from collections.abc import Iterator
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from modal.files import whole_file
from modal.rig import Floats
from modal.scene import described, scene_from
from nonlinear.events import NO_KICKS, Happening, Kicks
from nonlinear.methods import FORMS, choose
from nonlinear.plant import Plant, plant_of
from nonlinear.saved_files import checked_kind, reading
from nonlinear.state import Motion, State
from nonlinear.superposition import CORRECTED, LINEAR
from nonlinear.trajectory import TRUNCATED, Run, Trajectory

VERSION = 1
PARTS = ("links", "link_rates", "cart", "cart_rate", "work")
AXES = ("x", "y", "z")
REDUCED = (TRUNCATED, LINEAR, CORRECTED)


def save(trajectory: Trajectory, path: str | os.PathLike[str]) -> None:
    """Write a .npz or .csv file, whole or not at all; SceneError for another name."""
    content = _npz(trajectory) if checked_kind(path) == ".npz" else _csv(trajectory)
    with whole_file(path) as stream:
        stream.write(content)


def load(path: str | os.PathLike[str]) -> Trajectory:
    """The trajectory in a file that `save` wrote; SceneError says what is wrong with any other.

    Applied forces are code and are not saved: a driven run can be read, but not its reaction forces.
    """
    name, kind = os.fspath(path), checked_kind(path)
    with reading(name, "a trajectory"):
        header, times, parts = _read_npz(name) if kind == ".npz" else _read_csv(name)
        return _trajectory(header, times, parts)


# ------------------------------------------------------------------------------------------------------- header


def _header(trajectory: Trajectory) -> dict[str, Any]:
    events = [
        {"name": e.name, "time_s": e.time, **{part: np.asarray(getattr(e.state, part)).tolist() for part in PARTS[:4]}}
        for e in trajectory.happenings
    ]
    return {
        "multipendula_trajectory": VERSION,
        "scene": described(trajectory.scene),
        "run": asdict(trajectory.run),
        "driven": trajectory.driven,
        "events": events,
        "kicks": {name: part.tolist() for name, part in trajectory.kicks._asdict().items()},
    }


def _trajectory(header: dict[str, Any], times: Floats, parts: dict[str, Floats]) -> Trajectory:
    scene = scene_from(header["scene"])
    plant = plant_of(scene)
    shape = (len(times), plant.n_links, *([3] if plant.spatial else []))
    expected = dict.fromkeys(PARTS, (len(times),)) | {"links": shape, "link_rates": shape}
    if {name: values.shape for name, values in parts.items()} != expected or len(times) == 0:
        raise ValueError
    if not all(np.all(np.isfinite(values)) for values in (times, *parts.values())) or np.any(np.diff(times) <= 0):
        raise ValueError
    events = tuple(Happening(e["name"], e["time_s"], _state(e)) for e in header["events"])
    run = Run(**header["run"])
    if any(type(getattr(run, field.name)).__name__ != field.type for field in fields(Run)):
        raise TypeError
    if run.form in FORMS:
        integrated = replace(plant, spatial=plant.spatial and run.form == "spatial")
        choose(scene, 1.0, run.tolerance, run.method, run.form, plant=integrated)
    elif run.form not in REDUCED:
        raise ValueError
    kept = header.get("kicks", NO_KICKS._asdict())
    kicks = Kicks(*(np.array(kept[name], dtype=own.dtype) for name, own in NO_KICKS._asdict().items()))
    return Trajectory(scene, plant, times, Motion(**parts), run, events, kicks, driven=bool(header["driven"]))


def _state(event: dict[str, Any]) -> State:
    return State(np.array(event["links"]), np.array(event["link_rates"]), event["cart"], event["cart_rate"])


# ---------------------------------------------------------------------------------------------------------- NPZ


def _npz(trajectory: Trajectory) -> bytes:
    stream, motion = io.BytesIO(), trajectory.motion
    parts = {name: getattr(motion, name) for name in PARTS}
    np.savez_compressed(stream, header=json.dumps(_header(trajectory)), times_s=trajectory.times, **parts)
    return stream.getvalue()


def _read_npz(name: str) -> tuple[dict[str, Any], Floats, dict[str, Floats]]:
    content = io.BytesIO(Path(name).read_bytes())
    with np.load(content, allow_pickle=False) as data:
        parts = {part: np.asarray(data[part], dtype=float) for part in PARTS}
        return json.loads(str(data["header"])), np.asarray(data["times_s"], dtype=float), parts


# ---------------------------------------------------------------------------------------------------------- CSV


def columns(plant: Plant) -> list[str]:
    """The names of a CSV's columns, in its order: time, links, their rates, the cart and the work."""
    places = [label[len("theta") :].strip("[]").replace(",", "_") for label in plant.labels if label != "x"]
    if plant.spatial:
        links = [f"u{axis}_{place}" for place in places for axis in AXES]
        rates = [f"u{axis}_dot_{place}_per_s" for place in places for axis in AXES]
    else:
        links = [f"theta_{place}_rad" for place in places]
        rates = [f"theta_dot_{place}_rad_per_s" for place in places]
    return ["time_s", *links, *rates, "x_m", "x_dot_m_per_s", "work_J"]


def _csv(trajectory: Trajectory) -> bytes:
    motion, size = trajectory.motion, len(trajectory.times)
    blocks = [np.reshape(getattr(motion, name), (size, -1)) for name in PARTS]
    rows = np.hstack([trajectory.times[:, None], *blocks])
    return "".join(_lines(json.dumps(_header(trajectory)), columns(trajectory.plant), rows)).encode()


def _lines(header: str, names: list[str], rows: Floats) -> Iterator[str]:
    yield f"# {header}\n"
    yield ",".join(names) + "\n"
    for row in rows.tolist():
        yield ",".join(map(repr, row)) + "\n"


def _read_csv(name: str) -> tuple[dict[str, Any], Floats, dict[str, Floats]]:
    with open(name, encoding="utf-8") as stream:
        header = json.loads(stream.readline().removeprefix("# "))
        names = stream.readline().strip().split(",")
        with warnings.catch_warnings(action="ignore"):
            rows = np.loadtxt(stream, delimiter=",", ndmin=2)
    plant = plant_of(scene_from(header["scene"]))
    if names != columns(plant):
        raise ValueError
    size, width = len(rows), 3 if plant.spatial else 1
    count = plant.n_links * width
    shape = (size, plant.n_links, 3) if plant.spatial else (size, plant.n_links)
    split = [rows[:, 1 : 1 + count].reshape(shape), rows[:, 1 + count : 1 + 2 * count].reshape(shape), *rows[:, -3:].T]
    return header, rows[:, 0], dict(zip(PARTS, split, strict=True))
