"""Compression in the link of a bob: a rope in its place would be slack.

The tension of a link without mass is the force on it from above along it, of which its bob tells at any state,

    S = −F · u,    F = Σ m (a − g) − drag − springs,  over the bob and all below it.

Between samples the angles are the quintics through them, their rates and their accelerations; in space and where
accelerations are computed one by one they are the cubics through samples and rates. S is that of the equations of
motion at these states, and its zeros are found on them. Links that stand up at rest are no ropes and are omitted.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from modal.errors import ComputationError
from modal.report import Displayed, Summary, counted
from modal.scene import Bob, Scene
from modal.scene.doors import checked
from modal.types import Floats, Ints
from nonlinear.dynamics import vectors
from nonlinear.integration import Trajectory
from nonlinear.integration.within import crossing
from nonlinear.postprocessing.reaction_forces import reaction_forces_of, side_by_side, states_and_slopes
from nonlinear.postprocessing.resampling import resample

TENSIONS_MAX = 500_000
"""Limit: tensions at samples, computed at once."""
STATES_MAX = 2_000
"""Limit: states whose forces are computed one by one."""
PUSH_NOISE = 1e-9
"""Tolerance: of the weight below, a push that is rounding of accelerations."""
LINKS_SHOWN = 6
"""Format: links that are listed individually."""


@dataclass(frozen=True, repr=False)
class PushingLink(Displayed):
    """A bob's link that pushes in these `intervals` (s), by the numbers of its pendulum and its own, from 1.

    Copies of a pendulum count each; `largest` is the largest push at a sample or halfway between two (N).
    """

    pendulum: int
    link: int
    intervals: tuple[tuple[float, float], ...]
    largest: float

    def _summary(self) -> Summary:
        return Summary(f"Link {self.link} of pendulum {self.pendulum}: {self.when}")

    def record(self) -> dict[str, Any]:
        """Everything, for JSON."""
        intervals = [list(interval) for interval in self.intervals]
        return {"pendulum": self.pendulum, "link": self.link, "intervals_s": intervals, "largest_N": self.largest}

    @property
    def when(self) -> str:
        """The first few intervals, and how many more there are."""
        intervals = ", ".join(f"{since:.6g} to {until:.6g}" for since, until in self.intervals[:3])
        remaining = len(self.intervals) - 3
        suffix = f" and in {counted(remaining, 'more interval', 'more intervals')}" if remaining > 0 else ""
        return f"pushes from {intervals} s{suffix}"


@checked
def pushing_links(trajectory: Trajectory) -> tuple[PushingLink, ...]:
    """Every link of a bob that pushes somewhere in a run.

    Parameters
    ----------
    trajectory
        A run whose samples are near enough to each other to interpolate.

    Returns
    -------
    tuple of PushingLink
        Their numbers, the intervals in which they push (s), and the largest push (N).

    Raises
    ------
    ComputationError
        These samples do not determine it, or it takes long.

    Examples
    --------
    >>> import numpy as np
    >>> from modal import load
    >>> from nonlinear import simulate, state_at_rest
    >>> from nonlinear.postprocessing import pushing_links
    >>> scene = load("chain-1")
    >>> (link,) = pushing_links(simulate(scene, 1.0, start=state_at_rest(scene, [120.0])))
    >>> link.when.startswith("pushes from 0 to 0.")
    True
    """
    ropes = _ropes(trajectory.scene)
    if not ropes.size:
        return ()
    times, motion = trajectory.times, trajectory.motion
    if len(times) < 2:
        raise ComputationError("a single sample gives no interval")
    is_vectorial = side_by_side(trajectory)
    if is_vectorial and len(times) * trajectory.system.n_links > TENSIONS_MAX:
        raise ComputationError(f"{len(times)} samples of {trajectory.system.n_links} links are too many")
    if not is_vectorial and len(times) > STATES_MAX:
        raise ComputationError(f"{len(times)} samples are too many, where the forces are computed one by one")
    halfway = (times[1:] + times[:-1]) / 2
    resample(times, motion, halfway)  # raises where samples are too far apart
    between = _quintic(trajectory) if is_vectorial else _cubic(trajectory)

    def tension(at: Floats) -> Floats:
        return _tensions(between(at))[:, ropes] + PUSH_NOISE * _weights(trajectory.scene)[ropes]

    grid = np.empty(2 * len(times) - 1)
    grid[::2], grid[1::2] = times, halfway
    values = np.empty((len(grid), len(ropes)))
    values[::2] = _tensions(trajectory)[:, ropes] + PUSH_NOISE * _weights(trajectory.scene)[ropes]
    values[1::2] = tension(halfway)
    return tuple(_pushing(trajectory, grid, values, tension, ropes))


@checked
def slack_words(trajectory: Trajectory) -> list[str]:
    """A sentence for each link that pushes; why it cannot be decided, where there are ropes and it cannot."""
    try:
        return words_of(pushing_links(trajectory), trajectory.scene)
    except ComputationError as error:
        return [f"whether a rope would be slack was not determined: {error}"]


def words_of(links: Sequence[PushingLink], scene: Scene) -> list[str]:
    """A sentence for each link that pushes in a run of a scene."""
    several = sum(pendulum.count for pendulum in scene.pendulum) > 1
    words = [
        f"link {link.link}{f' of pendulum {link.pendulum}' * several} {link.when}: a rope would be slack there"
        for link in links[:LINKS_SHOWN]
    ]
    remaining = len(links) - LINKS_SHOWN
    return words + ([f"{counted(remaining, 'more link pushes', 'more links push')}"] if remaining > 0 else [])


def _ropes(scene: Scene) -> Ints:
    """The links, counted with copies, that may be ropes: those of bobs that hang."""
    is_rope = [
        isinstance(link, Bob) and way == "down"
        for pendulum in scene.hanging
        for link, way in zip(pendulum.chain, pendulum.ways, strict=True)
    ]
    return np.flatnonzero(is_rope)


def _weights(scene: Scene) -> Floats:
    """The weight (N) of every link."""
    masses = [link.mass for pendulum in scene.hanging for link in pendulum.chain]
    return scene.gravity * np.array(masses)


def _tensions(trajectory: Trajectory) -> Floats:
    """S (T, L) in N at the samples of a run."""
    u, _ = vectors(trajectory.motion)
    return np.asarray(-np.sum(reaction_forces_of(trajectory).pivots * u, axis=-1))


def _cubic(trajectory: Trajectory) -> Callable[[Floats], Trajectory]:
    """The run at other times, by the cubics through neighbouring samples."""
    return lambda at: replace(trajectory, times=at, motion=resample(trajectory.times, trajectory.motion, at))


def _quintic(trajectory: Trajectory) -> Callable[[Floats], Trajectory]:
    """The run at other times, by the quintics through neighbouring samples, their rates and their accelerations."""
    layout, rows, slopes = states_and_slopes(trajectory)
    half, times = layout.half, trajectory.times
    q, v, a = rows[:, :half], rows[:, half : 2 * half], slopes[:, half : 2 * half]

    def at(moments: Floats) -> Trajectory:
        sample = np.clip(np.searchsorted(times, moments, side="right") - 1, 0, len(times) - 2)
        h = (times[sample + 1] - times[sample])[:, None]
        s = (moments - times[sample])[:, None] / h
        q0, v0, a0 = q[sample], v[sample], a[sample]
        d0 = q[sample + 1] - q0 - h * v0 - h**2 * a0 / 2  # cubic to quintic terms until the next sample
        d1, d2 = h * (v[sample + 1] - v0 - h * a0), h**2 * (a[sample + 1] - a0)
        c3, c4, c5 = 10 * d0 - 4 * d1 + d2 / 2, -15 * d0 + 7 * d1 - d2, 6 * d0 - 3 * d1 + d2 / 2
        states = np.zeros((len(moments), rows.shape[1]))
        states[:, :half] = q0 + s * (h * v0 + s * (h**2 * a0 / 2 + s * (c3 + s * (c4 + s * c5))))
        states[:, half : 2 * half] = v0 + s * (h * a0 + s * (3 * c3 + s * (4 * c4 + s * 5 * c5)) / h)
        return replace(trajectory, times=moments, motion=layout.read(states))

    return at


def _pushing(
    trajectory: Trajectory, grid: Floats, values: Floats, tension: Callable[[Floats], Floats], ropes: Ints
) -> list[PushingLink]:
    """The links that push, from tensions (G, R) at a grid of times and at any others."""
    pushes = values < 0
    at, column = np.nonzero(pushes[1:] != pushes[:-1])
    rows = np.arange(len(at))
    zeros = crossing(lambda times: tension(times)[rows, column], grid[at], grid[at + 1]) if len(at) else grid[at]
    system = trajectory.system
    places = [label[len("theta") :].strip("[]").split(",") for label in system.labels[system.first :]]
    rounding, links = PUSH_NOISE * _weights(trajectory.scene), []
    for number, link in enumerate(ropes):
        if not pushes[:, number].any():
            continue
        edges = [*zeros[column == number].tolist()]
        if pushes[0, number]:
            edges.insert(0, float(grid[0]))
        if pushes[-1, number]:
            edges.append(float(grid[-1]))
        intervals = tuple(zip(edges[::2], edges[1::2], strict=True))
        pendulum, place = map(int, places[link])
        links.append(PushingLink(pendulum, place, intervals, float(rounding[link] - values[:, number].min())))
    return links
