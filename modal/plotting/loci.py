"""Frequency loci as a picture, crossings and veerings marked."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from modal.errors import ComputationError
from modal.plotting.layout import headline, key, set_values
from modal.plotting.style import HUES, MOST_CURVES, colour, ink, paper, spots, stack
from modal.scene import title_of

if TYPE_CHECKING:
    from modal.loci import CloseApproach, Loci

MARKS = {"crossing": "X", "veering": "o"}


def loci_figure(loci: Loci) -> Figure:
    """ω (rad/s) of every locus against the parameter, one colour each, crosses at crossings, gaps ringed at veerings.

    A rigid translation, ω = 0 throughout, is omitted. Raise ComputationError for more loci than one picture holds and
    where none oscillates.
    """
    columns = np.flatnonzero(loci.omega.any(axis=0)).tolist()
    if not 1 <= len(columns) <= MOST_CURVES:
        raise ComputationError(f"{len(columns)} loci do not fit in a figure: from 1 to {MOST_CURVES}")
    figure, (axis,) = stack(1, 2)
    lines = [_locus(axis, loci, k) for k in columns]
    for meeting in loci.encounters:
        _mark(axis, meeting)
    axis.set_ylabel("angular frequency ω (rad/s)")
    set_values(axis, loci.scene, loci.variation)
    headline(figure, title_of(loci.scene), "frequency loci")
    key(figure, [*lines, *_encounter_lines(loci)], columns=2 if len(columns) <= HUES else 4)
    return figure


def _locus(axis: Axes, loci: Loci, k: int) -> Line2D:
    fold = f" ({loci.multiplicity[k]}-fold)" if loci.multiplicity[k] > 1 else ""
    label = f"locus {loci.names[k]}{fold}"
    omega = loci.omega[:, k]
    return axis.plot(loci.values, omega, color=colour(k), zorder=3, label=label, **spots(k, omega))[0]


def _mark(axis: Axes, meeting: CloseApproach) -> None:
    axis.add_line(_sign(meeting.kind, [meeting.value], [meeting.omega]))
    if meeting.kind == "veering":
        ends = meeting.omega - meeting.gap / 2, meeting.omega + meeting.gap / 2
        axis.plot([meeting.value] * 2, ends, color=ink(), lw=1.1, zorder=4)


def _sign(kind: str, x: Sequence[float], y: Sequence[float], label: str = "") -> Line2D:
    face, edge, size = (ink(), paper(), 9) if kind == "crossing" else ("none", ink(), 13)
    return Line2D(x, y, ls="", marker=MARKS[kind], mfc=face, mec=edge, ms=size, mew=1.1, zorder=5, label=label)


def _encounter_lines(loci: Loci) -> list[Line2D]:
    """Encounters individually where they are few, else the number of each kind."""
    meetings = loci.encounters
    if len(meetings) <= HUES:
        return [_sign(meeting.kind, [], [], encounter_words(meeting, loci)) for meeting in meetings]
    counts = {kind: sum(meeting.kind == kind for meeting in meetings) for kind in MARKS}
    return [_sign(kind, [], [], f"{count} × {kind}") for kind, count in counts.items() if count]


def encounter_words(meeting: CloseApproach, loci: Loci) -> str:
    """An encounter in one line."""
    a, b = (loci.names[number] for number in meeting.loci)
    gap = "" if meeting.kind == "crossing" else f", gap {meeting.gap:.4g} rad/s"
    return f"{meeting.kind} {a} · {b} at {meeting.value:.5g} {loci.variation.unit}".rstrip() + gap
