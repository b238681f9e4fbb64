"""Reaction forces of a trajectory by Newton's second law, from the accelerations at its states.

A rope in place of the link of a bob would be slack where that is compressed.  The tension of a link without mass is the
force on it from above along it, of which its bob tells at any state,

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
from modal.scene.doors import checked, require_type
from modal.types import Floats, Ints
from nonlinear.dynamics import Lanes, Reactions, vectors
from nonlinear.integration import Choice, Trajectory, equations_of
from nonlinear.integration.switches import Switched
from nonlinear.integration.within import between_samples, crossing
from nonlinear.postprocessing.resampling import resample
from nonlinear.system import Layout, Motion, numbers_of

TENSIONS_MAX = 500_000
"""Limit: tensions at samples, computed at once."""
STATES_MAX = 2_000
"""Limit: states whose forces are computed one by one."""
PUSH_NOISE = 1e-9
"""Tolerance: of the weight below, a push that is rounding of accelerations."""
LINKS_SHOWN = 6
"""Format: links that are listed individually."""


def reaction_forces_of(trajectory: Trajectory) -> Reactions:
    """The force at every pivot and that of the rail on the cart, at the sampled times.

    On a structure, where there is no one rail, `normal` is NaN. Raise ComputationError for a saved run with applied
    forces, which are not saved, and for one with sampled feedback.
    """
    require_type("trajectory", trajectory, "Trajectory")
    if trajectory.driven and trajectory.equations is None:
        raise ComputationError("the reaction forces of this run need its applied forces, which are not saved")
    system, motion = trajectory.system, trajectory.motion
    if system.is_sampled:
        raise ComputationError("reaction forces: the held inputs of sampled feedback are not stored with a run")
    support = system.support
    size, times = 3 if system.spatial else 2, trajectory.times
    support_motion = (support.accelerations(times, size), support.velocities(times, size)) if support else None
    pivots = trajectory.mechanics.pivot_forces(_accelerations(trajectory, motion), support_motion)
    tops = np.zeros(system.n_links, dtype=bool)
    tops[np.concatenate([group.index[0] for group in system.groups])] = True
    weight = system.cart.mass * system.gravity if system.cart else 0.0
    normal = weight - pivots[:, tops, -1].sum(1)
    return Reactions(np.full_like(normal, np.nan) if system.structure is not None else normal, pivots, tops)


def side_by_side(trajectory: Trajectory) -> bool:
    """Whether the accelerations at all states are computed at once: in the plane, by equations of the scene."""
    system = trajectory.system
    load = trajectory.equations.load if trajectory.equations else None
    return not (system.spatial or system.rubs or system.hoisting or load or trajectory.driven)


def states_and_slopes(trajectory: Trajectory) -> tuple[Layout, Floats, Floats]:
    """The parts of y, y and y' at all samples, (T, size) each, of a run whose accelerations are computed at once."""
    numbers = numbers_of(trajectory.scene, system=trajectory.system)
    lanes = Lanes(numbers)
    rows = lanes.layout.rows(trajectory.motion)
    slopes = np.empty_like(rows)
    rates = lanes.rates(numbers)(np.ascontiguousarray(rows.T), trajectory.times)
    for column, rate in zip(slopes.T, rates, strict=True):
        column[:] = rate
    return lanes.layout, rows, slopes


def _one_by_one(trajectory: Trajectory, motion: Motion) -> Motion:
    """The rates of all states, by the equations of a run of its own."""
    system = trajectory.system
    load = trajectory.equations.load if trajectory.equations else None
    form = "spatial" if system.spatial else "minimal"
    equations = equations_of(system, Choice(form, "", compiled=False, reason=""), load)
    rows = []
    for at, time in enumerate(trajectory.times.tolist()):
        y = equations.begin(motion[at])
        if isinstance(equations, Switched):
            equations.release(time, y)
        rows.append(equations.derivative(time, y))
    return equations.read(np.array(rows))


def _accelerations(trajectory: Trajectory, motion: Motion) -> tuple[list[Any], Floats]:
    """Those of first joints (`Mechanics.pivot_accelerations`), and unit vectors' second derivatives, (T, L, d)."""
    system = trajectory.system
    if side_by_side(trajectory):
        layout, _, slopes = states_and_slopes(trajectory)
        accelerations = layout.read(slopes)
    else:
        accelerations = _one_by_one(trajectory, motion)
    carrier_accelerations = Layout.of(system, works=False).carrier_coordinates(accelerations)[1]
    pivots = trajectory.mechanics.pivot_accelerations(carrier_accelerations)
    if system.spatial:
        return pivots, accelerations.link_rates
    u, _ = vectors(motion)
    normals = np.stack((u[..., 1], -u[..., 0]), axis=-1)
    return pivots, accelerations.link_rates[..., None] * normals - motion.link_rates[..., None] ** 2 * u


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
    half = layout.half
    q, v, a = rows[:, :half], rows[:, half : 2 * half], slopes[:, half : 2 * half]

    def at(moments: Floats) -> Trajectory:
        places, rates = between_samples(trajectory.times, q, v, a, moments)
        no_work = np.zeros((len(moments), layout.size - 2 * half))
        return replace(trajectory, times=moments, motion=layout.read(np.hstack((places, rates, no_work))))

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
