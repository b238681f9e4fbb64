"""Poincaré sections at an energy: where many motions of a conservative scene pass one value of one coordinate.

Starts lie on the section and have the energy (`nonlinear.ensembles.surfaces`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import sqrt
from typing import TYPE_CHECKING, Any

import numpy as np

from modal.errors import SceneError
from modal.report import Displayed, Form, Summary, as_csv, as_json, by_column, deferred, finite, silent, titled
from modal.scene import Scene, describe, name_of, require, title_of
from modal.scene.doors import checked, checked_index, checked_number
from modal.types import Floats
from nonlinear.ensembles.measures import section_of
from nonlinear.ensembles.plain import CARRIED
from nonlinear.ensembles.results import Passing
from nonlinear.ensembles.running import Ensemble, ensemble
from nonlinear.ensembles.surfaces import energy_of, starts_at
from nonlinear.reduction import usual_start
from nonlinear.system import System, system_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ORBITS, PERIODS = 24, 200.0  # motions, and how long each goes on in sqrt(l/g), where nobody says
MOST_ORBITS = 100_000


@dataclass(frozen=True, eq=False, repr=False)
class PoincareSection(Displayed):
    """The crossings of an ensemble at an `energy` (J) above the scene's rest, drawn by one of its coordinates."""

    ensemble: Ensemble
    energy: float
    section: Passing
    coordinate: str
    shown: str

    @property
    def system(self) -> System:
        """The scene as arrays."""
        return self.ensemble.question.system

    @property
    def orbit(self) -> Floats:
        """Which motion crosses, from 0, (C,)."""
        return self.ensemble.column("crossing_member")

    def to_dict(self) -> dict[str, Any]:
        """A row for each crossing: which motion from 1, the time, angles, rates and the cart."""
        return by_column(_records(self))

    def plot(self) -> Figure:
        """A matplotlib figure of the crossings."""
        figure: Figure = deferred("nonlinear.plotting.ensembles:section_figure")(self)
        return figure

    def _summary(self) -> Summary:
        members = self.ensemble
        title = f"Poincaré section of {name_of(members.question.scene)} at {self.coordinate}"
        facts = [
            ("crossings", str(len(self.orbit))),
            ("motions", str(members.size)),
            ("duration", f"{members.question.duration:g} s"),
            ("energy", f"{self.energy:.6g} J above rest"),
        ]
        return Summary(title, facts)

    def points(self) -> tuple[Floats, Floats]:
        """What is drawn: an angle in (−180°, 180°] and its rate in °/s, or the cart's m and m/s, (C,) each."""
        place = self.system.labels.index(self.shown)
        if self.system.structure is not None and place < self.system.first:
            return tuple(self.ensemble.column(f"crossing_{name}")[:, place] for name in CARRIED.values())  # type: ignore[return-value]
        if self.shown == "x":
            return self.ensemble.column("crossing_cart_m"), self.ensemble.column("crossing_cart_rate_m_per_s")
        link = place - self.system.first
        angle = np.degrees(self.ensemble.column("crossing_links_rad")[:, link])
        rate = np.degrees(self.ensemble.column("crossing_link_rates_rad_per_s")[:, link])
        return np.asarray(180 - (180 - angle) % 360), rate


@checked
def find_section(
    scene: Scene,
    duration: float | None = None,
    *,
    energy: float | None = None,
    at: str | None = None,
    orbits: int = ORBITS,
    report: Callable[[float], object] = silent,
    **options: Any,
) -> PoincareSection:
    """The section of a conservative plane scene at an energy (J), by default that of its usual start.

    `at` is a coordinate with what it passes, such as "theta[1,1]>0" (deg, or m of the cart), by default the first
    angle upwards through 0.  SceneError for a scene that does not keep its energy, and where no start has it.
    """
    require(scene, "a Poincaré section")
    checked_index("orbits", orbits, 1, MOST_ORBITS)
    system = system_of(scene)
    text = at or f"{system.labels[system.first]}>0"
    section = section_of(f"section:{text}", system)
    energy = _usual_energy(scene) if energy is None else checked_number("energy", energy)
    starts = starts_at(scene, energy, orbits, section=section)
    length = PERIODS * sqrt(max(link.length for link in scene.links()) / scene.gravity)
    members = ensemble(scene, duration or length, starts=starts, measures=[f"section:{text}"], report=report, **options)
    if members.interrupted:
        raise KeyboardInterrupt
    crossed = system.labels[section.row]
    others = [label for label in system.labels[system.first :] if label != crossed]
    return PoincareSection(members, energy, section, text, (others or [crossed])[0])


@checked
def section_table(section: PoincareSection, form: Form) -> str:
    """As text, csv (one line a crossing) or json, the `form`."""
    if form == "csv":
        return as_csv(_records(section))
    if form == "json":
        return as_json(_whole(section))
    scene, counts = (
        section.ensemble.question.scene,
        np.bincount(section.orbit.astype(int), minlength=section.ensemble.size),
    )
    lines = [
        f"{len(section.orbit)} crossings of {section.coordinate} by {section.ensemble.size} motions "
        f"of {section.ensemble.question.duration:.4g} s, {counts.min()} to {counts.max()} each",
        f"energy {section.energy:.6g} J above the scene's rest",
        section.ensemble.words(),
    ]
    return titled(title_of(scene), "Poincaré section", ["\n".join(lines)], "text")


def _usual_energy(scene: Scene) -> float:
    """The energy of the scene's own start, or of its first mode."""
    try:
        return energy_of(scene, usual_start(scene))
    except SceneError as error:
        raise SceneError([f"{error}: give `energy`"]) from None


def _records(section: PoincareSection) -> list[dict[str, Any]]:
    labels = section.system.labels[section.system.first :]
    places = [label[len("theta") :].strip("[]").replace(",", "_") for label in labels]
    column = section.ensemble.column
    rows = zip(
        section.orbit.astype(int).tolist(),
        column("crossing_time_s").tolist(),
        column("crossing_links_rad").tolist(),
        column("crossing_link_rates_rad_per_s").tolist(),
        _carried(section),
        strict=True,
    )
    return [
        {"motion": motion + 1, "time_s": time}
        | {f"theta_{place}_rad": value for place, value in zip(places, links, strict=True)}
        | {f"theta_dot_{place}_rad_per_s": value for place, value in zip(places, rates, strict=True)}
        | carried
        for motion, time, links, rates, carried in rows
    ]


def _carried(section: PoincareSection) -> list[dict[str, float]]:
    """The cart, or the coordinates of a structure, at every crossing."""
    names = ("cart_m", "cart_rate_m_per_s") if section.system.structure is None else CARRIED.values()
    columns = [section.ensemble.column(f"crossing_{name}") for name in names]
    rows = np.hstack([each.reshape(len(section.orbit), -1) for each in columns]).tolist()
    return [dict(zip(section.system.first_columns, row, strict=True)) for row in rows]


def _whole(section: PoincareSection) -> dict[str, Any]:
    members = section.ensemble
    return {
        "scene": describe(members.question.scene),
        "section": section.coordinate,
        "energy_J": section.energy,
        "motions": members.size,
        "duration_s": members.question.duration,
        "engine": members.engine,
        "failed": len(members.failures),
        "largest_energy_drift": finite(float(np.nanmax(members.energy_drift))),
        "crossings": _records(section),
    }
