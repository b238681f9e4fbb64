"""The attractors of a driven scene: the periodic motions in which its starts end, found from runs.

Motions that repeat after as many periods of the drives, with as many full turns and the same stroboscopic samples, are
one attractor. They are numbered by period, then turns, then size, whatever engine ran them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from math import degrees, nan
from typing import Any

import numpy as np

from modal.errors import SceneError
from modal.report import Displayed, finite, silent
from modal.scene import Scene, drive_period
from modal.scene.parameters import Variation
from modal.types import Floats
from nonlinear.ensembles.running import Ensemble, ensemble
from nonlinear.ensembles.strobes import settling_time, strobe_times
from nonlinear.postprocessing import largest_angle
from nonlinear.postprocessing.returns import JUDGED_STROBES, clustered, natural_units, repetition
from nonlinear.simulation import simulate
from nonlinear.system import State

EQUAL_ANGLES_GAP = 1e-2
"""Tolerance: between largest angles (deg) that count as equal: mirror images go by their strobes."""


@dataclass(frozen=True, eq=False, repr=False)
class Attractor(Displayed):
    """A periodic motion that attracts: it repeats after `period` periods of the drives, links by whole `turns` further.

    `largest_angle_deg` is that of any link, NaN if links turn over forever; `state` is one of its stroboscopic samples,
    at t = 0 of the drives.
    """

    what = "Attractor"
    shows = "period: period in drives; turns: turns of links; largest_angle_deg: largest angle, °"

    period: int
    turns: tuple[int, ...]
    largest_angle_deg: float
    state: State

    @property
    def name(self) -> str:
        """Its period with its largest angle, or with the turns of its links a period of the drives."""
        if not any(self.turns):
            return f"period {self.period}, largest angle {round(self.largest_angle_deg, 3):.4g}°"
        rates = ", ".join(str(Fraction(turns, self.period)).replace("-", "−") for turns in self.turns)
        return f"period {self.period}, turns {rates} a period"

    def record(self) -> dict[str, Any]:
        """All contents, for JSON."""
        return {
            "name": self.name,
            "period": self.period,
            "turns": list(self.turns),
            "largest_angle_deg": finite(self.largest_angle_deg),
            "angles_deg": np.degrees(self.state.links).tolist(),
            "rates_deg_per_s": np.degrees(self.state.link_rates).tolist(),
            "cart_m": self.state.cart,
            "cart_rate_m_per_s": self.state.cart_rate,
            **({"supports": self.state.supports.tolist()} if len(self.state.supports) else {}),
            **({"support_rates_per_s": self.state.support_rates.tolist()} if len(self.state.supports) else {}),
        }


def find_attractors(
    scene: Scene,
    axes: tuple[Variation, ...],
    duration: float | None = None,
    report: Callable[[float], object] = silent,
    **options: Any,
) -> tuple[Ensemble, tuple[Attractor, ...], Floats]:
    """The members over a grid of starts, the attractors, and each member's attractor from 1, 0 for none, (S,).

    The last 50 stroboscopic samples of `duration` (s) are judged, by default of a transient of ten times the slowest
    decay. Raise SceneError for a shorter one, and where another number than one of the start is varied.
    """
    if other := [axis.path for axis in axes if ".start." not in axis.path]:
        words = (
            "changes the attractors themselves: vary numbers of a start, and follow attractors by `find_bifurcations`"
        )
        raise SceneError([f"vary {path}: {words}" for path in other])
    period = drive_period(scene).seconds
    if duration is None:
        duration = settling_time(scene, period) + JUDGED_STROBES * period
    last = int(duration / period * (1 + 1e-12))
    if last < JUDGED_STROBES:
        raise SceneError([f"duration {duration:g} s: an attractor takes {JUDGED_STROBES} periods of {period:.4g} s"])
    times = strobe_times(period, settle=(last - JUDGED_STROBES + 1) * period)
    ensembled = ensemble(scene, max(duration, times[-1]), vary=axes, output=times.tolist(), report=report, **options)
    if not ensembled.require("start").columns:  # a share without a chunk
        return ensembled, (), np.full(ensembled.size, nan)
    states = [part[:, -JUDGED_STROBES:] for part in ensembled.states()]
    strobes = natural_units(ensembled.question.system, states)
    repeats, turns = repetition(strobes, ensembled.question.system.n_links)
    labels, members = clustered(strobes, repeats, turns)
    attractors = []
    for k in members:
        last_angles, rates, *rest = (rows[k, -1] for rows in states)
        links = last_angles - 2 * np.pi * np.round(last_angles / (2 * np.pi))
        state = State(links, rates, float(rest[0]), float(rest[1]), *rest[2:])
        whole_turns, largest = tuple(turns[k].tolist()), nan
        if not any(whole_turns):
            largest = degrees(largest_angle(simulate(scene, int(repeats[k]) * period, start=state)))
        attractors.append(Attractor(int(repeats[k]), whole_turns, largest, state))
    order = _order(attractors)
    rank = np.zeros(len(order) + 1)
    rank[1 + np.array(order, dtype=int)] = 1 + np.arange(len(order))
    numbers = np.where(np.isnan(strobes).any((1, 2)), nan, rank[labels])
    return ensembled, tuple(attractors[k] for k in order), numbers


def _order(attractors: list[Attractor]) -> list[int]:
    """By period, turns and largest angle; equal ones by the angles of their sample."""
    sizes = np.nan_to_num([each.largest_angle_deg for each in attractors])
    rising = np.argsort(sizes, kind="stable")
    group = np.zeros(len(attractors), dtype=int)
    group[rising] = np.cumsum(np.diff(sizes[rising], prepend=sizes[rising[:1]]) > EQUAL_ANGLES_GAP)
    keys = [
        (each.period, any(each.turns), group[k], each.turns, each.state.links.tolist())
        for k, each in enumerate(attractors)
    ]
    return sorted(range(len(attractors)), key=keys.__getitem__)
