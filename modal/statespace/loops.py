"""Feedback loops as rows over q: the measured outputs, and the generalized forces of the inputs.

An input u = −Σ gain (output − reference) with the generalized force F, and outputs Y0 q + Y1 q', closes to

    M q'' + (D + F Σ gain Y1) q' + (K + F Σ gain Y0) q = 0,

whose matrices are not symmetric.  Measured outputs are linear in the state at every angle: coordinates, angles, angles
to the link above, and their rates.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from modal.assembly import Matrices
from modal.errors import SceneError, gathered, refuse_any, spelling_hint
from modal.scene import Scene
from modal.scene.feedback import Feedback
from modal.statespace.geometry import Geometry, geometry_of
from modal.statespace.signals import (
    EXAMPLES,
    INPUTS,
    PUSHES,
    READINGS,
    Signal,
    by_name,
    inputs_of,
    is_point,
    push_of,
    validate_points,
    validate_signals,
)
from modal.types import Floats

MEASURED = ("coordinates", "coordinate_rates", "angles", "rates", "relative_angles", "relative_rates")
STATES = MEASURED[:4]
NAMED, QUOTED = r"^(input|output) (\S+): ", r'\1 = "\2": '
"""How a message begins of a signal, and how it does of one in a scene."""


class Loop(NamedTuple):
    """One input of an entry of `feedback`: its signal, its generalized force F (q,), and the rows (R, 2 q) measured.

    `number` is that of the entry; `rests` (R,) are what these show at equilibrium, `gains` (R,) those of each.
    """

    number: int
    entry: Feedback
    signal: Signal
    push: Floats
    rows: Floats
    rests: Floats
    gains: Floats


def loops_of(scene: Scene) -> list[Loop]:
    """Return all loops of a scene, input by input; raise SceneError with every unknown signal."""
    geometry, loops, problems = geometry_of(scene), list[Loop](), list[str]()
    for k, entry in enumerate(scene.feedback):
        try:
            loops += _loops_of_entry(scene, geometry, k, entry)
        except SceneError as error:
            problems += [f"feedback[{k}].{re.sub(NAMED, QUOTED, problem)}" for problem in error.problems]
    refuse_any(problems)
    return loops


def _loops_of_entry(scene: Scene, geometry: Geometry, number: int, entry: Feedback) -> list[Loop]:
    signals, pushes, problems = list[Signal](), np.zeros((geometry.size, 0)), list[str]()
    with gathered(problems):
        signals, pushes = inputs_named(scene, geometry, entry.inputs)
    named = _rows(geometry, MEASURED if entry.gains is None else STATES)
    names = entry.gains.states if entry.gains else (str(entry.output),)
    where = "gains" if entry.gains else "output"
    for name in names:
        if name not in named:
            problems.append(f"{where} {name}: must be one of {', '.join(named)}{spelling_hint(name, named)}")
    gains = np.array(entry.gains.rows if entry.gains else [[entry.gain]], dtype=float)
    count = len(signals)
    if count and len(gains) != count:
        words = f"gains: has {len(gains)} rows for {count} inputs" if entry.gains else f"input: has {count} signals"
        problems.append(words if entry.gains else f"{words}: one output acts on one")
    refuse_any(problems)
    rows = np.array([named[name] for name in names])
    rest = np.concatenate((np.full(geometry.leading, geometry.place), geometry.rest, np.zeros(geometry.size)))
    parts = zip(signals, pushes.T, gains, strict=True)
    return [Loop(number, entry, signal, push, rows, rows @ rest, row) for signal, push, row in parts]


def inputs_named(scene: Scene, geometry: Geometry, names: tuple[str, ...]) -> tuple[list[Signal], Floats]:
    """The inputs by these names of groups, single signals and points, and their generalized forces (q, m)."""
    single = by_name(PUSHES, geometry)
    known_names = tuple(name for name in inputs_of(geometry) if name in {*PUSHES, *single})
    if prescribed := [name for name in names if name in INPUTS and name not in PUSHES]:
        raise SceneError([f"input {name}: is prescribed: feedback acts by a force or a torque" for name in prescribed])
    others = tuple(name for name in names if name not in single)
    validate_signals(others, known_names, "input", geometry, is_further=is_point, examples=EXAMPLES)
    validate_points(scene, others)
    groups = [push_of(scene, geometry, name) for name in names]
    return [signal for group in groups for signal in group.signals], np.hstack([group.F for group in groups])


def _rows(geometry: Geometry, groups: tuple[str, ...]) -> dict[str, Floats]:
    """The row (2 q,) of each signal of these groups by its name."""
    none, rows = np.zeros(geometry.size), dict[str, Floats]()
    for group in (READINGS[name](geometry) for name in groups):
        for k, signal in enumerate(group.signals):
            parts = (none if part is None else part[k] for part in (group.position, group.rate))
            rows[signal.name] = np.concatenate([*parts])
    return rows


def problems_of(scene: Scene) -> Iterator[str]:
    """Return what is wrong with the loops of a scene that is valid without them."""
    if scene.space == "space":
        yield '.feedback: needs space = "plane"'
        return
    try:
        loops_of(scene)
    except SceneError as error:
        yield from (f".{problem}" for problem in error.problems)


def without_samples(scene: Scene) -> Scene:
    """The scene with loops that measure and act at every time."""
    return scene.replace(feedback=tuple(loop.replace(sample_time=None, delay=0.0) for loop in scene.feedback))


def unit_of(scene: Scene, number: int, name: str) -> str:
    """The unit of a number of an entry of feedback."""
    if name in {"sample_time", "delay"}:
        return "s"
    loop = next(loop for loop in loops_of(scene) if loop.number == number)
    pushed, geometry = loop.signal.unit, geometry_of(scene)
    signals = [signal for group in MEASURED for signal in READINGS[group](geometry).signals]
    measured = next((signal.unit for signal in signals if signal.name == loop.entry.output), "state")
    if name == "reference":
        return measured
    return pushed if name == "limit" else f"{pushed} per {measured}"


def close(scene: Scene, linear: Matrices) -> Matrices:
    """Return M, D and K with the loops of a scene closed.

    >>> from modal import Bob, Cart, Pendulum, Scene
    >>> hook = Pendulum(links=[Bob(mass=1.0, length=2.0)])
    >>> loop = {"input": "cart_force", "output": "theta_1_1", "gain": 3.0}
    >>> scene = Scene(gravity=9.0, support=Cart(mass=4.0), pendulum=[hook], feedback=[loop])
    >>> from modal import matrices
    >>> matrices(scene).K.tolist()
    [[0.0, 3.0], [0.0, 18.0]]
    """
    K, D, n = linear.K.copy(), linear.D.copy(), len(linear.K)
    for loop in loops_of(scene):
        law = loop.gains @ loop.rows
        K += np.outer(loop.push, law[:n])
        D += np.outer(loop.push, law[n:])
    return replace(linear, K=K, D=D)
