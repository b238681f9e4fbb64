"""What the tuned dampers have to bear: their stroke and their torque or force, of the peak or the RMS that is tuned."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from modal.report import Displayed
from modal.scene import Scene
from modal.scene.parameters import Place, with_numbers
from modal.statespace.geometry import geometry_of
from modal.tuning.pieces import Pieces, Quantities
from modal.tuning.quantities import Quantity
from modal.types import Floats

if TYPE_CHECKING:
    from modal.tuning.objective import Objective


@dataclass(frozen=True)
class Load(Displayed):
    """The `stroke` of a damper in `unit` (rad or m) and its `effort` in N m or N, per unit of an input or as RMS.

    `at_hz` and `effort_at_hz` are where they are largest, 0 for an RMS.
    """

    path: str
    per: str
    stroke: float
    unit: str
    at_hz: float
    effort: float
    effort_unit: str
    effort_at_hz: float


def loads(objective: Objective, scene: Scene) -> tuple[Load, ...]:
    """Those of the dampers of a scene that belong to links and springs with a free number."""
    aim = next((aim.quantity for aim in objective.aims if aim.quantity.kind in {"peak", "rms"}), None)
    if aim is None:
        return ()
    felt_loads = []
    for place, output, damping, unit in _dampers(objective, scene):
        rate = output.replace("rel_", "rel_dot_", 1)
        quantity = Quantity(aim.kind, output, aim.input)
        outputs = [quantity, Quantity(aim.kind, rate, aim.input)] if unit == "rad" else [quantity]
        felt = Quantities(scene, (), outputs, objective.quantities.setting)
        pieces = felt.at(np.zeros(0))
        if not all(len(aim.values) for aim in pieces):
            continue
        stroke, at = _largest(pieces[0].values, pieces[0])
        if unit == "rad":
            effort, effort_at = _largest(damping * pieces[1].values, pieces[1])
        else:
            effort, effort_at = _largest(damping * pieces[0].values * pieces[0].at, pieces[0])
        per = felt.form.signals[0][1].unit if aim.kind == "peak" else ""
        felt_loads.append(
            Load(with_numbers(place), per, stroke, unit, at, effort, "N m" if unit == "rad" else "N", effort_at)
        )
    return tuple(felt_loads)


def _largest(values: Floats, pieces: Pieces) -> tuple[float, float]:
    """The largest of the values with its frequency (Hz)."""
    best = int(values.argmax())
    return float(values[best]), pieces.hertz(best)


def _dampers(objective: Objective, scene: Scene) -> list[tuple[Place, str, float, str]]:
    """Places of dampers with what they feel, their constants and the unit of their stroke."""
    dampers: list[tuple[Place, str, float, str]] = []
    geometry = geometry_of(scene)
    before = np.concatenate(([0], np.cumsum([entry.count for entry in scene.pendulum])))
    for place in dict.fromkeys(_owner(entry.place) for entry in objective.free):
        if place[0] == "pendulum" and len(place) == 4:
            p, i = int(place[1]), int(place[3])
            link = scene.pendulum[p].links[i]
            number = sum(entry.count for entry in scene.pendulum[p].links[:i]) + 1
            if link.damping:
                dampers.append(((*place, "damping"), f"rel_{before[p] + 1}_{number}", link.damping, "rad"))
        if place[0] == "spring":
            spring = scene.spring[int(place[1])]
            label = str(int(place[1]) + 1)
            labels = [row.label for row in geometry.springs]
            if spring.damping and label in labels and spring.kind == "linear":
                dampers.append(((*place, "damping"), f"spring_extension_{label}", spring.damping, "m"))
    return dampers


def _owner(place: Place) -> Place:
    return place[:4] if place[0] == "pendulum" else place[:2]
