"""The folder of a map of rhythms: outcomes of runs, and branches of stable orbits, under the keys of their questions.

Of an orbit the unknowns u and the link that turns back at its start are stored: the rest follows from one period.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from hashlib import sha256
from typing import Any, TypeVar

import numpy as np

from modal.scene import Scene
from modal.scene.parameters import Variation
from nonlinear.ensembles.endings import EndingGroup
from nonlinear.ensembles.store import ChunkFolder
from nonlinear.orbits.cycles import Beginning
from nonlinear.orbits.flow import ORBIT_TOLERANCE
from nonlinear.orbits.orbit import Orbit
from nonlinear.orbits.shooting import Shooting, shooting
from nonlinear.orbits.stable import StableOrbits
from nonlinear.synchronization.attractors import Ending
from nonlinear.system import State

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class RhythmStore:
    """What is computed of a scene along a number, each once if there is a folder.

    A chunk has a `question`: all that it follows from, in addition to what the folder's header says.
    """

    scene: Scene
    variation: Variation
    folder: ChunkFolder | None

    def groups(
        self, question: Sequence[object], compute: Callable[[], tuple[EndingGroup, ...]]
    ) -> tuple[EndingGroup, ...]:
        """Outcomes of runs."""
        return self._stored("run", question, compute, lambda entries: tuple(map(self._group, entries)))

    def beginnings(self, value: float, compute: Callable[[], tuple[Beginning, ...]]) -> tuple[Beginning, ...]:
        """Orbits next to averaged configurations at a value."""
        return self._stored("averaged", [value], compute, lambda entries: tuple(map(self._beginning, entries)))

    def branch(self, beginning: Beginning, compute: Callable[[], StableOrbits]) -> StableOrbits:
        """The branch of stable orbits from a beginning."""

        def read(entry: dict[str, Any]) -> StableOrbits:
            unknowns = np.array(entry["unknowns"])
            birth, death = (entry[name] and (entry[name][0], entry[name][1]) for name in ("birth", "death"))
            return StableOrbits(tuple(map(beginning.problem.orbit, unknowns)), unknowns, birth, death)

        return self._stored("branch", [beginning.problem.leader, beginning.u], compute, read)

    def _stored(self, kind: str, question: Sequence[object], compute: Callable[[], T], read: Callable[[Any], T]) -> T:
        """What a chunk holds, computed and written if it is not there."""
        if self.folder is None:
            return compute()
        name = f"{kind}-{sha256(json.dumps(question, default=_plain).encode()).hexdigest()[:16]}"
        if self.folder.path(name).exists():
            return self.folder.content(name, lambda header, _: read(header["content"]))
        outcome = compute()
        self.folder.write(name, {"content": json.loads(json.dumps(outcome, default=_plain))}, {})
        return outcome

    def _beginning(self, entry: list[Any]) -> Beginning:
        leader, u, _, words = entry
        problem = shooting(self.scene, leader=leader, tolerance=ORBIT_TOLERANCE, variation=self.variation)
        return Beginning(problem, np.array(u), problem.orbit(np.array(u)), words)

    def _group(self, entry: dict[str, Any]) -> EndingGroup:
        ending, beginning = entry["ending"], entry["beginning"]
        parts: dict[str, Any] = {
            name: np.array(part) if isinstance(part, list) else part for name, part in ending["state"].items()
        }
        ending |= {"state": State(**parts), "record": np.array(ending["record"]), "turns": tuple(ending["turns"])}
        entry |= {"ending": Ending(**ending), "beginning": beginning and self._beginning(beginning)}
        fields: dict[str, Any] = {name: tuple(p) if isinstance(p, list) else p for name, p in entry.items()}
        return EndingGroup(**fields)


def _plain(part: Any) -> Any:
    """What JSON holds of anything: of the equations of an orbit the link that turns back, of the orbit nothing."""
    if isinstance(part, Shooting | Orbit):
        return part.leader if isinstance(part, Shooting) else None
    return part.tolist() if isinstance(part, np.ndarray | np.generic) else vars(part)
