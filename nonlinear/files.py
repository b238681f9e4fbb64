"""Trajectories on disk: NPZ stores every bit, CSV holds the same numbers for other programs.

Both have a record in JSON: the scene, how the run was made, and its events. That of a CSV stands next to it, in
FILE.csv.json, or as a comment on its first line, where files had it before; a column is named by its quantity, the
pendulum and the link (both from 1) and its unit. Both carry a checksum, and a file that has been altered is refused.
"""

from __future__ import annotations

import io
import json
import os
import warnings
from collections.abc import Iterable
from dataclasses import asdict, fields, replace
from math import isnan, nan
from typing import Any

import numpy as np

from modal.errors import SceneError
from modal.report import csv_comment, csv_rows, deferred
from modal.scene import Scene, describe, kind_of, scene_from, sealed, whole_file
from modal.scene.doors import checked
from modal.scene.sealed import finite_array, index, reading, require_keys
from modal.types import Floats
from nonlinear.dynamics import links_of_contacts
from nonlinear.integration import FORMS, PROVED, SCIPY, TRUNCATED, SolverInfo, Trajectory, validate_method
from nonlinear.reduction import CORRECTED, LINEAR
from nonlinear.system import (
    NO_FRICTION,
    NO_KICKS,
    UP,
    EventRecord,
    Friction,
    Kicks,
    Motion,
    State,
    System,
    system_of,
)

KINDS = ("npz", "csv")
HEADER = "header"
COMMENT = "# {"
FILE_VERSION = 1
"""Format: version of the files, in their headers."""
PARTS = ("links", "link_rates", "cart", "cart_rate", "work")
CARRIED = ("supports", "support_rates")
"""The coordinates of a structure and their rates, in files of scenes that have one."""
TIMES = "times_s"
AXES = ("x", "y", "z")
SUPPORT = ("support_m", "support_dot_m_per_s", "support_ddot_m_per_s2")
"""Columns of a support that moves in one direction, along the rail or upwards; computed when the file is written."""
BOTH_WAYS = tuple(
    name.replace("support", f"support_{way}", 1) for way in ("horizontal", "vertical") for name in SUPPORT
)
"""Of one that moves in both."""
REDUCED = (TRUNCATED, LINEAR, CORRECTED)


@checked
def save(trajectory: Trajectory, path: str | os.PathLike[str]) -> None:
    """Write a trajectory to a file, completely or not at all.

    Parameters
    ----------
    trajectory
        The run.  Applied forces are code and are not saved.
    path
        A name that ends in .npz (everything, read back by `load`), .csv or .mat (columns for other programs).

    Raises
    ------
    SceneError
        The name ends otherwise.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from modal import load as load_scene
    >>> from nonlinear import load, save, simulate
    >>> run = simulate(load_scene("chain-1"), 1.0)
    >>> with TemporaryDirectory() as folder:
    ...     save(run, path := Path(folder) / "run.npz")
    ...     same = load(path)
    >>> bool((same.motion.links == run.motion.links).all())
    True
    """
    if trajectory.system.hoisting and trajectory.system.hoisting.custom_laws:
        raise SceneError([f"{path}: lengths given in Python are not saved: write the hoist in the scene"])
    kind = kind_of(path, (*KINDS, "mat"))
    if kind == "csv":
        write_csv(path, _header(trajectory), [columns(trajectory), *rows_of(trajectory).tolist()])
        return
    if kind == "npz":
        parts = {name: getattr(trajectory.motion, name) for name in (*PARTS, *_support_parts(trajectory.system))}
        content = as_npz(_header(trajectory), {TIMES: trajectory.times} | parts)
    else:
        content = deferred("modal.exports.scripts:write_columns")(columns_of(trajectory))
    with whole_file(path) as stream:
        stream.write(content)


def load(path: str | os.PathLike[str] | Trajectory) -> Trajectory:
    """Read a trajectory from a file written by `save`.

    Parameters
    ----------
    path
        The .npz or .csv file.  A trajectory is its own.

    Returns
    -------
    Trajectory
        The run with its scene.  A driven run can be read, but its reaction forces cannot be computed: applied forces
        are code and are not saved.

    Raises
    ------
    SceneError
        The file cannot be read, or is none of `save`'s; the message says what is wrong with it.

    Examples
    --------
    >>> from modal import SceneError
    >>> from nonlinear import load
    >>> try:
    ...     load("nosuch.npz")
    ... except SceneError as error:
    ...     print(error)
    nosuch.npz: cannot be read: No such file or directory
    """
    if isinstance(path, Trajectory):
        return path
    name, kind = os.fspath(path), checked_kind(path)
    with reading(name, "trajectory"):
        if kind == "csv":
            return _trajectory(*_read_csv(name))
        header, parts = from_npz(name)
        return _trajectory(header, parts.pop(TIMES), parts)


# ------------------------------------------------------------ what files of results share


def checked_kind(path: str | os.PathLike[str]) -> str:
    """The suffix of a file name, npz for standard output; raise SceneError for any other than .npz and .csv."""
    return kind_of(path, KINDS)


def write_csv(path: str | os.PathLike[str], header: dict[str, Any], rows: Iterable[Iterable[Any]]) -> None:
    """Write the rows as a CSV file and the header next to it, both completely or not at all.

    The checksum in the header is that of the text in which the header is a comment before the rows.
    """
    text = sealed.sealed_text(COMMENT, f" {csv_comment(json.dumps(header))[1:]}\n" + csv_rows(rows))
    record, _, table = text.partition(b"\n")
    with whole_file(record_of(path)) as numbers, whole_file(path) as stream:
        numbers.write(record.removeprefix(b"# ") + b"\n")
        stream.write(table)
        numbers.flush()
        stream.flush()


def record_of(path: str | os.PathLike[str]) -> str:
    """The file next to a CSV that has its header."""
    return f"{os.fspath(path)}.json"


def from_csv(path: str | os.PathLike[str]) -> tuple[dict[str, Any], str]:
    """The header of a CSV file, from its first line or from the file next to it, and the text below it."""
    content = sealed.content(path)
    if not content.startswith(b"#"):
        if not os.path.exists(record_of(path)):
            raise SceneError([f"has no record: {os.path.basename(record_of(path))} must be next to it"])
        content = b"# " + sealed.content(record_of(path)).rstrip(b"\n") + b"\n" + content
    sealed.verify_sealed_text(content, COMMENT)
    first, _, rest = content.decode().partition("\n")
    header: dict[str, Any] = json.loads(first.removeprefix("# "))
    del header["sha256"]
    return header, rest


def as_npz(header: dict[str, Any], arrays: dict[str, Any]) -> bytes:
    """An NPZ file of the arrays, with the header stored as a string array."""
    return sealed.archive({HEADER: np.array(json.dumps(header))} | arrays)


def from_npz(path: str | os.PathLike[str]) -> tuple[dict[str, Any], dict[str, Any]]:
    """The header of an NPZ file and its other arrays."""
    arrays = sealed.unpack(sealed.content(path))
    header: dict[str, Any] = json.loads(str(arrays.pop(HEADER)))
    return header, arrays


# ------------------------------------------------------------------------------------------------------- header


def _header(trajectory: Trajectory) -> dict[str, Any]:
    states = (*PARTS[:4], *_support_parts(trajectory.system))
    events = [
        {"name": e.name, "time_s": e.time, **{part: np.asarray(getattr(e.state, part)).tolist() for part in states}}
        for e in trajectory.happenings
    ]
    friction_record = {
        "friction": {name: np.asarray(part).tolist() for name, part in trajectory.friction._asdict().items()}
    }
    if isnan(trajectory.friction.rest):
        friction_record["friction"]["rest"] = None
    return {
        "multipendula_trajectory": FILE_VERSION,
        "scene": describe(trajectory.scene),
        "run": asdict(trajectory.run),
        "driven": trajectory.driven,
        "events": events,
        "kicks": {name: part.tolist() for name, part in trajectory.kicks._asdict().items()},
        **(friction_record if trajectory.system.rubs else {}),
    }


def _trajectory(header: dict[str, Any], times: Floats, parts: dict[str, Floats]) -> Trajectory:
    friction_record = header.pop("friction", None)
    require_keys(header, "multipendula_trajectory", "scene", "run", "driven", "events", "kicks")
    if header["multipendula_trajectory"] != FILE_VERSION or type(header["driven"]) is not bool:
        raise ValueError
    scene = scene_from(header["scene"])
    system = system_of(scene)
    shape = (len(times), system.n_links, *([3] if system.spatial else []))
    shapes = dict.fromkeys(PARTS, (len(times),)) | {"links": shape, "link_rates": shape}
    shapes |= dict.fromkeys(_support_parts(system), (len(times), system.first))
    require_keys(parts, *shapes)
    motion = Motion(**{name: finite_array(parts[name], *shapes[name]) for name in shapes})
    if len(times) == 0 or np.any(np.diff(finite_array(times, len(times))) <= 0):
        raise ValueError
    events = tuple(_happening(event, shape[1:], system) for event in header["events"])
    kicks = _kicks(header["kicks"], system.n_links)
    if system.rubs != (friction_record is not None):
        raise ValueError
    friction = _friction(friction_record, system) if system.rubs else NO_FRICTION
    info = _solver_info(header["run"], system, scene)
    return Trajectory(scene, system, times, motion, info, events, kicks, friction, driven=header["driven"])


def _solver_info(record: dict[str, Any], system: System, scene: Scene) -> SolverInfo:
    info = SolverInfo(**record)
    values = [(getattr(info, field.name), field.type) for field in fields(SolverInfo)]
    if any(type(value).__name__ != kind or (kind == "float" and isnan(value)) for value, kind in values):
        raise TypeError
    if info.form in FORMS:
        integration_system = replace(system, spatial=system.spatial and info.form in {"spatial", "hamiltonian"})
        validate_method(scene, form=info.form, system=integration_system)
    if info.method not in (*SCIPY, "taylor", PROVED) if info.form in FORMS else info.form not in REDUCED:
        raise ValueError
    return info


def _support_parts(system: System) -> tuple[str, ...]:
    return CARRIED if system.structure is not None else ()


def _happening(event: dict[str, Any], shape: tuple[int, ...], system: System) -> EventRecord:
    require_keys(event, "name", "time_s", *PARTS[:4], *_support_parts(system))
    time, cart, cart_rate = finite_array([event["time_s"], event["cart"], event["cart_rate"]], 3).tolist()
    support_values = {name: finite_array(event[name], system.first) for name in _support_parts(system)}
    links = finite_array(event["links"], *shape), finite_array(event["link_rates"], *shape)
    state = State(*links, cart, cart_rate, **support_values)
    return EventRecord(str(event["name"]), time, state)


def _kicks(record: dict[str, Any], n_links: int) -> Kicks:
    require_keys(record, *NO_KICKS._fields)
    size = len(record["time"])
    link = np.array([index(number, n_links) for number in record["link"]], dtype=np.int64)
    if len(link) != size:
        raise ValueError
    return Kicks(link=link, **{name: finite_array(record[name], size) for name in ("time", "impulse", "energy")})


def _friction(record: dict[str, Any], system: System) -> Friction:
    require_keys(record, *NO_FRICTION._fields)
    link, places = (
        np.array([index(number + 1, system.n_links + 1) - 1 for number in record[name]], dtype=np.int64)
        for name in ("link", "places")
    )
    if not np.array_equal(places, links_of_contacts(system)) or not np.all(np.isin(link, places)):
        raise ValueError
    begin, end = (finite_array(record[name], len(link)) for name in ("begin", "end"))
    work = finite_array(record["work"], len(places))
    rest = nan if record["rest"] is None else float(finite_array([record["rest"]], 1)[0])
    return Friction(link, begin, end, places, work, rest)


# ---------------------------------------------------------------------------------------------------------- CSV


def columns(trajectory: Trajectory) -> list[str]:
    """The names of a CSV's columns, in order: time, links, their rates, the cart and the work, a moving support.

    There is no cart where none moves, and no work where nothing does any.  On a structure its coordinates and their
    rates stand in the place of the cart's, and the work is followed by extension and pull of every spring between
    points.
    """
    system = trajectory.system
    work = ["work_J"] * _works(trajectory)
    first = system.first_columns if system.first else ()
    return [*_of_links(system), *first, *work, *_of_springs(system), *_of_support(system)]


def _works(trajectory: Trajectory) -> bool:
    return trajectory.system.works or trajectory.driven or bool(np.any(trajectory.motion.work))


def _of_links(system: System) -> list[str]:
    places = [label[len("theta") :].strip("[]").replace(",", "_") for label in system.labels[system.first :]]
    if system.spatial:
        links = [f"u{axis}_{place}" for place in places for axis in AXES]
        rates = [f"u{axis}_dot_{place}_per_s" for place in places for axis in AXES]
    else:
        links = [f"theta_{place}_rad" for place in places]
        rates = [f"theta_dot_{place}_rad_per_s" for place in places]
    return ["time_s", *links, *rates]


def _of_springs(system: System) -> list[str]:
    """Extension (m, rad) and pull (N, N m) of every spring between points, counted from 0 with its copies."""
    springs = system.structure.springs if system.structure else ()
    return [
        f"spring_{name}[{k}]"
        for k, spring in enumerate(springs)
        for name in (("angle_rad", "torque_N_m") if spring.torsion else ("extension_m", "force_N"))
    ]


def _of_support(system: System) -> tuple[str, ...]:
    moving = len(system.support.motions) if system.support else 0
    return ((), SUPPORT, BOTH_WAYS)[moving]


def rows_of(trajectory: Trajectory) -> Floats:
    """The numbers of the motion, a column for each of `columns`, (T, C)."""
    motion, size, system = trajectory.motion, len(trajectory.times), trajectory.system
    support_parts = _support_parts(system) or (PARTS[2:4] if system.first else ())
    work = PARTS[4:] if _works(trajectory) else ()
    blocks = [np.reshape(getattr(motion, name), (size, -1)) for name in (*PARTS[:2], *support_parts, *work)]
    if system.structure is not None and system.structure.springs:
        extension, pull, _ = trajectory.mechanics.springs
        blocks.append(np.stack((extension, pull), axis=2).reshape(size, -1))
    if support := trajectory.system.support:
        motions = [motion for _, motion in sorted(support.motions, key=lambda pair: pair[0] == UP)]
        blocks += [motion.derivative(trajectory.times, order)[:, None] for motion in motions for order in range(3)]
    return np.hstack([trajectory.times[:, None], *blocks])


def columns_of(trajectory: Trajectory) -> dict[str, Floats]:
    """The numbers (T,) of the motion by the names of the columns of a CSV."""
    return dict(zip(columns(trajectory), rows_of(trajectory).T, strict=True))


def _read_csv(name: str) -> tuple[dict[str, Any], Floats, dict[str, Floats]]:
    header, text = from_csv(name)
    names, _, numbers = text.partition("\n")
    with warnings.catch_warnings(action="ignore"):
        rows = np.loadtxt(io.StringIO(numbers), delimiter=",", comments=None, ndmin=2)
    system = system_of(scene_from(header["scene"]))
    columns, links, first = names.split(","), _of_links(system), system.first_columns
    allowed_columns = [*links, *first, "work_J", *_of_springs(system), *_of_support(system)]
    if columns != [name for name in allowed_columns if name in columns] or not {*allowed_columns} - {
        *first,
        "work_J",
    } <= {*columns}:
        raise ValueError
    size, none = len(rows), np.zeros(len(rows))
    at = dict(zip(columns, rows.T, strict=True))
    shape = (size, system.n_links, 3) if system.spatial else (size, system.n_links)
    angles, rates = np.split(rows[:, 1 : len(links)], 2, axis=1)
    parts = {"links": angles.reshape(shape), "link_rates": rates.reshape(shape), "work": at.get("work_J", none)}
    if system.structure is None:
        cart = {name: at.get(key, none) for name, key in zip(PARTS[2:4], first, strict=True)}
        return header, rows[:, 0], parts | cart
    supports = np.split(np.transpose([at[name] for name in first]), 2, axis=1)
    return header, rows[:, 0], parts | dict.fromkeys(PARTS[2:4], none) | dict(zip(CARRIED, supports, strict=True))
