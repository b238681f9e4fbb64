"""Studies of chaos: scenes started with the same energy, and their Lyapunov exponents compared.

Every pendulum is released at rest with the energy of horizontal links, V = −g Σ b cos θ = 0: half of the energy that
inverts them all, whatever the number of links.  Within that, angles and sides are random.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from math import hypot

import numpy as np

from modal.report import Displayed, TextResult, silent
from modal.scene import Scene
from modal.scene.doors import require_type
from modal.types import Crew, Floats, map_by_crew
from nonlinear.chaos.lyapunov import Exponent, lyapunov_exponent
from nonlinear.system import Group, State, system_of

DECISIVE_UNCERTAINTIES = 3.0
"""Limit: that a difference must exceed, as the table says: it has many pairs, and one in twenty exceeds two."""
LAST_LINK_RATIO = 0.9
"""Format: of the last link's range, with which it may compensate the links above, at most half a radian from level."""


@dataclass(frozen=True, repr=False)
class Case(Displayed):
    """A scene of a study, its series and its position in it (None: the reference of the others)."""

    what = "Scene of a study"
    shows = "series: series; at: position; scene: scene"

    series: str
    at: float | None
    scene: Scene


@dataclass(frozen=True)
class ChaosStudy:
    """A claim in one sentence, the scenes that test it, seconds for each start and the number of starts."""

    paper: str
    claim: str
    cases: tuple[Case, ...]
    duration: float
    ensemble: int


@dataclass(frozen=True, eq=False, repr=False)
class Finding(TextResult):
    """A study with the exponents of its cases."""

    study: ChaosStudy
    exponents: tuple[Exponent, ...]
    writer = "nonlinear.chaos.claims:text"

    def series(self) -> dict[str, list[tuple[Case, Exponent]]]:
        """The cases with their exponents, series by series."""
        cases: dict[str, list[tuple[Case, Exponent]]] = {}
        for case, exponent in zip(self.study.cases, self.exponents, strict=True):
            cases.setdefault(case.series, []).append((case, exponent))
        return cases


def measure(study: ChaosStudy, report: Callable[[float], object] = silent, *, crew: Crew | None = None) -> Finding:
    """The exponents of a study, whose cases a `crew` shares; `report` is called with the number of cases done."""
    require_type("study", study, "ChaosStudy")
    exponents = []
    for exponent in map_by_crew(partial(_exponent, study), study.cases, crew):
        exponents.append(exponent)
        report(len(exponents))
    return Finding(study, tuple(exponents))


def _exponent(study: ChaosStudy, case: Case) -> Exponent:
    starts = level_starts(case.scene, study.ensemble)
    return lyapunov_exponent(case.scene, study.duration, starts=starts)


def level_starts(scene: Scene, ensemble: int, seed: int = 0) -> list[State]:
    """States at rest in which every pendulum has V = −g Σ b cos θ = 0, with random side and angles."""
    system, rng = system_of(scene), np.random.default_rng(seed)
    starts = []
    for _ in range(ensemble):
        angles = np.empty(system.n_links)
        for group in system.groups:
            angles[group.index] = _level(group, rng)
        starts.append(State(angles, np.zeros_like(angles)))
    return starts


def _level(group: Group, rng: np.random.Generator) -> Floats:
    """Angles (n, P): all but the last near 90°, the last such that Σ b cos θ = 0, all on a random side."""
    b = group.block.b
    width = np.minimum(0.5, LAST_LINK_RATIO * b[-1] / np.maximum(b[:-1].sum(0), 1e-300))
    upper = np.pi / 2 + width * rng.uniform(-1, 1, b[:-1].shape)
    last = np.arccos(-np.sum(b[:-1] * np.cos(upper), axis=0) / b[-1])
    return np.asarray(rng.choice((-1.0, 1.0), b.shape[1]) * np.concatenate((upper, last[None])))


def scale(exponent: Exponent, factor: float) -> tuple[float, float]:
    """λ and its standard uncertainty times a factor; where λ is indistinguishable from zero, its possible range."""
    value = exponent.value if exponent.is_positive else 0.0
    error = exponent.error if exponent.is_positive else exponent.bound / exponent.coverage
    return factor * value, factor * error


def compare_starts(first: tuple[float, float], second: tuple[float, float]) -> int:
    """1 where the second is larger beyond their uncertainties, −1 where it is smaller, else 0."""
    difference, error = second[0] - first[0], DECISIVE_UNCERTAINTIES * hypot(first[1], second[1])
    return int(difference > error) - int(difference < -error)
