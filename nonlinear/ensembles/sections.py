"""Poincaré sections at an energy: crossings of many motions of a conservative scene through one value of a coordinate.

Starts lie on the section and have the energy.  They are drawn at random: angles are even over all that it allows; the
rates have normally distributed directions and are scaled so that kinetic energy is the part that potential energy
leaves.  A cart begins in the middle of its rail.  As no spring stores less than nothing, each link alone bounds its
angle,

    g b (1 − cos θ) ≤ E − E_lowest,

within which angles are drawn until all together leave a kinetic energy; on a section and on a structure they are drawn
from all round.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from modal.errors import SceneError
from modal.report import Form, silent
from modal.scene import Scene, require
from modal.scene.doors import checked, checked_index, checked_number, formerly
from modal.scene.signal_names import symbols_in
from modal.types import Floats
from nonlinear.chaos import usual_duration
from nonlinear.dynamics import Lanes
from nonlinear.ensembles.energies import Accounts
from nonlinear.ensembles.measures import section_of
from nonlinear.ensembles.results import Passing
from nonlinear.ensembles.running import Ensemble, EnsembleResult, ensemble
from nonlinear.ensembles.strobes import state_records, within_a_turn
from nonlinear.integration import estimate_timescales
from nonlinear.reduction import usual_start
from nonlinear.system import Numbers, State, numbers_of, system_of

MEMBERS_MAX = 100_000
"""Limit: "members …: must be at most 100000"."""
ROUND_DRAWS = 1_000
"""Format: starts drawn at once for every ten requested, on which the random ones depend."""
DRAW_ROUNDS_MAX = 20
"""Limit: rounds in which "no start drawn at random has this energy"."""
LINK_RATE_MAX = 1e4
"""Limit: of the scene's fastest swing: "links would turn … times as fast as the scene swings", which takes days."""


@dataclass(frozen=True, eq=False, repr=False)
class PoincareSection(EnsembleResult):
    """The crossings of an ensemble at an `energy` (J) above equilibrium, drawn by one of its coordinates."""

    ensemble: Ensemble
    energy: float
    section: Passing
    coordinate: str
    shown: str

    what, key = "Poincaré section", "crossings"
    figure = "nonlinear.plotting.ensembles:section_figure"

    @property
    def orbit(self) -> Floats:
        """The motion of each crossing, from 0, (C,)."""
        return self.ensemble.column("crossing_member")

    def facts(self) -> dict[str, Any]:
        """The section, the energy, and the method."""
        return {"section": self.coordinate, "energy_J": self.energy, **self.ensemble.record()}

    def records(self) -> Iterator[dict[str, Any]]:
        """A row for each crossing: which motion from 1, the time, angles, rates and the cart."""
        times, states = self.ensemble.column("crossing_time_s"), self.ensemble.states("crossing_")
        records = state_records(self.system, states, carted=self.system.structure is None)
        for orbit, time, record in zip(self.orbit.tolist(), times.tolist(), records, strict=True):
            yield {"motion": int(orbit) + 1, "time_s": time} | record

    def parts(self, form: Form = "text") -> Iterator[str]:
        """The numbers of crossings and motions, and the energy."""
        orbit, members = self.orbit, self.ensemble
        counts = np.bincount(orbit.astype(int), minlength=members.size)
        lines = [
            f"{len(orbit)} crossings of {symbols_in(self.coordinate)} by {members.size} motions "
            f"of {members.question.duration:.4g} s, {counts.min()} to {counts.max()} each",
            f"energy {self.energy:.6g} J above equilibrium",
            members.words(),
        ]
        yield "\n".join(lines)

    def points(self) -> tuple[Floats, Floats]:
        """Plotted coordinates: an angle in (−180°, 180°] and its rate in °/s, or the cart's m and m/s, (C,) each."""
        links, rates, cart, speed, *carried = self.ensemble.states("crossing_")
        place = self.system.labels.index(self.shown)
        if carried and place < self.system.first:
            return carried[0][:, place], carried[1][:, place]
        if self.shown == "x":
            return cart, speed
        link = place - self.system.first
        return within_a_turn(np.degrees(links[:, link])), np.degrees(rates[:, link])


@formerly(at="crossing", orbits="members")
@checked
def find_section(
    scene: Scene,
    duration: float | None = None,
    *,
    energy: float | None = None,
    crossing: str | None = None,
    members: int = 24,
    report: Callable[[float], object] = silent,
    **options: Any,
) -> PoincareSection:
    """Compute the section of a conservative plane scene at an energy (J), by default that of its usual start.

    `crossing` is a coordinate with its level, such as "theta[1,1]>0" (deg, or m of the cart), by default the first
    angle upwards through 0. Raise SceneError for a scene that does not keep its energy, and where no start has it.
    """
    require(scene, "a Poincaré section")
    checked_index("members", members, 1, MEMBERS_MAX)
    system = system_of(scene)
    text = crossing or f"{system.labels[system.first]}>0"
    try:
        section = section_of(f"section:{text}", system)
    except SceneError as error:
        raise SceneError([f"crossing {problem.replace('section:', '')}" for problem in error.problems]) from None
    if energy is None:
        try:
            energy = energy_of(scene, usual_start(scene))
        except SceneError as error:
            raise SceneError([f"{error}: give `energy`"]) from None
    energy = checked_number("energy", energy)
    starts = starts_at(scene, energy, members, section=section)
    length = duration or usual_duration(scene)
    motions = ensemble(scene, length, starts=starts, measures=[f"section:{text}"], report=report, **options)
    crossed = system.labels[section.row]
    others = [label for label in system.labels[system.first :] if label != crossed]
    return PoincareSection(motions.require(), energy, section, text, (others or [crossed])[0])


@checked
def section_table(section: PoincareSection, form: Form) -> str:
    """As text, csv (one line a crossing) or json, the `form`."""
    return section.report(form)


# ----------------------------------------------------------------------------------------------- starts at an energy


def energy_of(scene: Scene, state: State) -> float:
    """The energy of a state (J), above equilibrium."""
    numbers = numbers_of(scene)
    layout = Lanes(numbers).layout
    return float(Accounts(numbers, layout).energies(layout.begin(state)[:, None]).total[0])


def starts_at(
    scene: Scene, energy: float, count: int, *, section: Passing | None = None, seed: int | tuple[int, ...] = 7
) -> list[State]:
    """States of this energy (J) above rest, on a section if there is one; SceneError where none is found."""
    numbers = numbers_of(scene)
    layout = Lanes(numbers).layout
    accounts, pace = Accounts(numbers, layout), estimate_timescales(scene).swing
    rng, first, half = np.random.default_rng(seed), layout.first, layout.half
    lowest = None if layout.is_structured else float(accounts.lowest.max())
    if lowest is not None and energy < lowest:
        raise SceneError([f"energy {energy:g} J: is below {lowest + 0.0:.6g} J, that of links that all hang"])
    widest: Floats = np.full((half - first, 1), np.pi)
    if lowest is not None and section is None:
        widest = _widest(numbers, energy - lowest)
    starts: list[State] = []
    for _ in range(DRAW_ROUNDS_MAX):
        y = np.zeros((layout.size, ROUND_DRAWS * max(1, count // 10)))
        y[first:half] = widest * rng.uniform(-1.0, 1.0, (half - first, y.shape[1]))
        if section:
            y[section.row] = section.level
        y[half : 2 * half] = rng.standard_normal((half, y.shape[1]))
        if section and section.direction:
            y[half + section.row] = section.direction * np.abs(y[half + section.row])
        energies = accounts.energies(y)
        left = energy - energies.potential_energy
        good = np.flatnonzero(left >= 0)
        y = y[:, good]
        y[half : 2 * half] *= np.sqrt(left[good] / energies.moving[good])
        if (fastest := float(np.abs(y[half + first : 2 * half]).max(initial=0.0))) > LINK_RATE_MAX * pace:
            told = f"links would turn at {fastest:.3g} rad/s, over {LINK_RATE_MAX:g} times as fast as the scene swings"
            raise SceneError([f"energy {energy:g} J: {told}"])
        motion = layout.read(y.T)
        starts += [motion[k] for k in range(min(len(good), count - len(starts)))]
        if len(starts) == count:
            return starts
    words = "no motion of this energy passes the section" if section else "no start drawn at random has this energy"
    raise SceneError([f"energy {energy:g} J: {words}"])


def _widest(numbers: Numbers, above: float) -> Floats:
    """The largest angle (rad) of every link with no more than so much energy (J) above that of hanging, (L, 1)."""
    system = numbers.system
    cosine = np.full((system.n_links, 1), -1.0)
    for group in system.groups:
        cosine[group.index, 0] = 1 - above / (system.gravity * group.block.b)
    return np.asarray(np.arccos(np.clip(cosine, -1.0, 1.0)))
