"""Starts drawn at random on an energy surface of a conservative plane scene, where a section asks for it on that, too.

Angles are even over all that the energy allows; the rates have the direction of a normal distribution, and are scaled
so that kinetic energy makes up what potential energy leaves.  A cart begins in the middle of its rail.  As no spring
stores less than nothing, each link alone bounds its angle,

    g b (1 − cos θ) ≤ E − E_lowest,

within which angles are drawn until all together leave a kinetic energy; on a section and on a structure they are drawn
from all round.
"""

from __future__ import annotations

import numpy as np

from modal.errors import SceneError
from modal.scene import Scene
from modal.types import Floats
from nonlinear.dynamics import Lanes
from nonlinear.ensembles.energies import Accounts
from nonlinear.ensembles.results import Passing
from nonlinear.integration import estimate_timescales
from nonlinear.system import Numbers, State, numbers_of

TRIES = 20_000  # starts drawn for each one that has the energy
ROUNDS = 20  # in which they are drawn
SEED = 7
FASTEST = 1e4  # of the scene's fastest swing: a motion with faster links takes days


def energy_of(scene: Scene, state: State) -> float:
    """Of a state (J), above the scene's rest."""
    numbers = numbers_of(scene)
    layout = Lanes(numbers).layout
    return float(Accounts(numbers, layout).energies(layout.begin(state)[:, None]).total[0])


def starts_at(
    scene: Scene, energy: float, count: int, *, section: Passing | None = None, seed: int | tuple[int, ...] = SEED
) -> list[State]:
    """So many states with this energy (J) above rest, on a section if there is one; SceneError where none is found."""
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
    for _ in range(ROUNDS):
        y = np.zeros((layout.size, TRIES // ROUNDS * max(1, count // 10)))
        y[first:half] = widest * rng.uniform(-1.0, 1.0, (half - first, y.shape[1]))
        if section:
            y[section.row] = section.level
        y[half : 2 * half] = rng.standard_normal((half, y.shape[1]))
        if section and section.direction:
            y[half + section.row] = section.direction * np.abs(y[half + section.row])
        energies = accounts.energies(y)
        left = energy - energies.stored
        good = np.flatnonzero(left >= 0)
        y = y[:, good]
        y[half : 2 * half] *= np.sqrt(left[good] / energies.moving[good])
        if (fastest := float(np.abs(y[half + first : 2 * half]).max(initial=0.0))) > FASTEST * pace:
            told = f"links would turn at {fastest:.3g} rad/s, over {FASTEST:g} times as fast as the scene swings"
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
