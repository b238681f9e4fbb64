"""Measurement of members simulated at once, on the way or at their ends, without storing motions.

What there is to measure is listed in `nonlinear.measures`. A measure is requested by its name, a section with what is
passed: `section:theta[1,1]=0`.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from math import ceil, pi, radians
from typing import cast

import numpy as np

from modal.errors import SceneError, gathered, refuse_any
from modal.extend.measures import LAST_TENTH, WHOLE_MOTION, measure_for, taken_by
from modal.extend.registry import mistake_of
from modal.scene import Scene
from modal.types import Floats
from nonlinear.ensembles.energies import Accounts
from nonlinear.ensembles.results import MemberResults, Passing, Wanted
from nonlinear.integration import Trajectory, estimate_timescales, validate
from nonlinear.synchronization import ENDING
from nonlinear.synchronization.phases import fixed_base_amplitudes
from nonlinear.system import Layout, Numbers, System

ENDING_SAMPLES_MAX = 240
"""Tolerance: of the last tenth, 12 to each of its periods, and a tenth of these at least."""
SECTION = re.compile(r"section:\s*([^=<>]+?)\s*(=|<|>)\s*(\S+)\s*")
DIRECTIONS = {"=": 0, ">": 1, "<": -1}
Columns = dict[str, Floats]


@dataclass(frozen=True, eq=False)
class Context:
    """Context of a measure: the scene, its form, the members' numbers and starts."""

    scene: Scene
    system: System
    numbers: Numbers
    layout: Layout
    begun: Floats
    wanted: Wanted

    @property
    def places(self) -> list[str]:
        """Pendulum and link of every link, as in columns."""
        return places(self.system)

    def mean_energies(self, ending: Floats) -> Columns:
        """The mean energies over the samples of the last tenth."""
        sums: Floats = np.zeros((self.system.n_pendula, len(ending)))
        carried: Floats = np.zeros(len(ending))
        accounts = Accounts(self.numbers, self.layout)
        times = ending_times(self.scene, self.wanted.duration) if self.system.hoisting else ()
        for k in range(ending.shape[1]):
            rows = np.ascontiguousarray(ending[:, k].T)
            energies = accounts.energies(rows, time=times[k] if times else 0.0)
            sums += energies.kinetic + energies.potential
            carried += energies.cart_kinetic + energies.cart_potential
        return energy_columns(self.system, sums / ending.shape[1], carried / ending.shape[1])

    def order(self, ending: Floats) -> Floats:
        """The order parameter of each member; modes are those of the scene itself, whose numbers they may not have."""
        first, half = self.layout.first, self.layout.half
        links, rates = ending[..., first:half], ending[..., half + first : 2 * half]
        parts = (part.reshape(-1, half - first) for part in (links, rates))
        z, omega, mass = fixed_base_amplitudes(self.system, *parts)
        z = z.reshape(*ending.shape[:2], *z.shape[1:])
        size = np.abs(z)
        leading = np.argmax(np.sum(mass * omega**2 * np.mean(size**2, axis=1), axis=1), axis=1)
        unit = np.divide(z, size, out=np.zeros_like(z), where=size > 0)
        order = np.abs(unit.mean(2)).mean(1)
        return np.asarray(order[np.arange(len(order)), leading])


def ending_times(scene: Scene, duration: float) -> tuple[float, ...]:
    """Samples (s) of the last tenth, some for each of the fastest periods."""
    periods = ENDING * duration * estimate_timescales(scene).swing / (2 * pi)
    count = min(max(ceil(12 * periods), ENDING_SAMPLES_MAX // 10), ENDING_SAMPLES_MAX)
    return tuple(np.linspace((1 - ENDING) * duration, duration, count).tolist())


def places(system: System) -> list[str]:
    """Pendulum and link of every link, counted from 1: 1_2."""
    labels = system.labels[system.first :]
    return [label[len("theta") :].strip("[]").replace(",", "_") for label in labels]


def energy_columns(system: System, pendula: Floats, carried: Floats) -> Columns:
    """The energies (J) of all pendula, of each, (N, ...), and of the cart or the structure, (...)."""
    columns = {"pendula_energy_J": np.asarray(pendula.sum(0))}
    columns |= {f"pendulum_{p}_energy_J": energy for p, energy in enumerate(pendula, 1)}
    return columns | ({"cart_energy_J": np.asarray(carried)} if system.cart or system.structure else {})


@dataclass(frozen=True)
class RequestedMeasures:
    """The measures requested, by their names, and the section."""

    names: tuple[str, ...]
    section: Passing | None = None

    @property
    def ends(self) -> bool:
        """Whether the last tenth is sampled."""
        return any(measure_for("ensemble", name).reads == LAST_TENTH for name in self.names)


def requested_measures(texts: Sequence[str], system: System) -> RequestedMeasures:
    """The measures in texts; raise SceneError with every mistake."""
    if not isinstance(texts, list | tuple) or not all(isinstance(text, str) for text in cast("list[object]", texts)):
        raise SceneError([f"measures {texts!r}: must be a list of names, of {', '.join(taken_by('ensemble'))}"])
    names: list[str] = []
    problems: list[str] = []
    section = None
    for text in texts:
        name = text.partition(":")[0]
        with gathered(problems):
            measure_for("ensemble", text)
            if name in names:
                raise SceneError([f"measure {text}: {name} is requested twice"])
            if name == "section":
                section = section_of(text, system)
            elif name != text:
                raise SceneError([f"measure {text}: {name} takes no number here: the duration is that of the ensemble"])
        names.append(name)
    refuse_any(problems)
    return RequestedMeasures(tuple(names), section)


def section_of(text: str, system: System) -> Passing:
    """The section in a text such as "section:theta[1,1]=0", with > upwards only, with < downwards only (deg or m)."""
    match, known = SECTION.fullmatch(text), [*system.labels]
    if not match or match[1] not in known:
        words = f"must be section:COORDINATE=VALUE, with > for upwards and < for downwards only, of {', '.join(known)}"
        raise SceneError([f"{text}: {words}"])
    try:
        value = float(match[3])
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise SceneError([f'{text}: "{match[3]}" is not a number'])
    row = known.index(match[1])
    turns = row >= system.first or (system.structure is not None and row in system.structure.turning)
    return Passing(row, radians(value) if turns else value, DIRECTIONS[match[2]])


def columns_of_members(
    names: Sequence[str], context: Context, results: MemberResults, ending: Floats, run: Trajectory | None = None
) -> Columns:
    """The columns of these measures, (S, ...); those of a whole motion are read off the `run` of a single member."""
    columns: Columns = {}
    for name in names:
        measure = measure_for("ensemble", name)
        if run is not None and not measure.has("of_members"):
            numbers = measure.values_of("of_motion", run, context.wanted.duration)
            columns |= {column: np.array([number]) for column, number in numbers.items()}
            continue
        measured = measure.values_of("of_members", context, results, ending)
        for column, values in measured.items():
            if np.shape(values)[:1] != (len(ending),):
                raise mistake_of(measure, f"of_members returned {column} for {np.shape(values)[:1]} of {len(ending)}")
        columns |= measured
    return columns


def why_one_by_one(names: Sequence[str]) -> str:
    """Return why members with these measures are simulated one at a time; "" if they can be simulated at once."""
    alone = (name for name in names if not measure_for("ensemble", name).has("of_members"))
    return next((f"measure {name}, which is read off {WHOLE_MOTION}" for name in alone), "")


def validate_measures(names: Sequence[str], scene: Scene, seconds: float | None = None) -> None:
    """Raise SceneError if a measure is none of such a scene, or not from this many seconds."""
    validate(*(partial(measure_for("ensemble", name).require, scene, seconds) for name in names))
