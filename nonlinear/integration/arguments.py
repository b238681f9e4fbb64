"""The arguments of a run, checked before anything is computed, all mistakes at once.

Time scales of oscillation and decay, estimated from the linear modes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import ceil, inf, isfinite, pi, sqrt
from numbers import Integral, Real
from typing import Any

import numpy as np

from modal.assembly import matrices
from modal.errors import ComputationError, SceneError, gathered, refuse_any
from modal.modes import natural_modes
from modal.scene import Scene, validate_scene
from modal.types import Complexes, Floats
from nonlinear.integration.steppers import Pace
from nonlinear.system import AppliedForces, Event, Layout, Load, State, System, system_of

SURVEYED_LINKS_MAX = 2000
"""Cost: links of a scene up to which its modes are computed for its time scales (benchmarks/simulation.py)."""
DENSE_LINKS_MAX = 300
"""Cost: likewise on a structure and with rotors, whose matrices are dense (benchmarks/simulation.py)."""
SAMPLES_PER_PERIOD = 24
"""Cost: default samples in a period of the fastest oscillation, between which cubics are right to 1e-5 of an angle."""
SAMPLES_MIN = 1000
"""Cost: default samples of a short run, which its figures show as a curve."""
SAMPLES_MAX = 100_000
"""Cost: default samples of a long run."""


@dataclass(frozen=True)
class Timescales:
    """The fastest oscillation or growth (rad/s) and the fastest decay (1/s) about equilibrium; `modal` if from modes.

    Otherwise they are estimates, from the shortest link and from each joint's damper and inertia separately.
    """

    swing: float
    decay: float
    modal: bool


modes_of = lru_cache(maxsize=4)(natural_modes)
"""The modes of a scene, computed once for the start, the times and the coordinates of a run."""


@lru_cache(maxsize=4)
def estimate_timescales(scene: Scene) -> Timescales:
    """The time scales of a scene's modes where these are cheap, else estimates."""
    if scene.is_structured and scene.n_links <= DENSE_LINKS_MAX:
        try:
            linear = matrices(scene.linearizable.still.unforced)
            size, M = len(linear.M), linear.M
            A = np.block(
                [[np.zeros((size, size)), np.eye(size)], [-np.linalg.solve(M, linear.K), -np.linalg.solve(M, linear.D)]]
            )
            return _timescales_of(np.linalg.eigvals(A).astype(complex), scene)
        except np.linalg.LinAlgError:  # masses so far apart that rounding leaves M singular
            return _estimate(scene)
    most = DENSE_LINKS_MAX if "rotor" in scene.features else SURVEYED_LINKS_MAX
    if scene.n_links <= most and not scene.is_structured:
        try:
            try:
                eigenvalue = modes_of(scene).eigenvalue
            except SceneError:  # forces that leave no equilibrium
                eigenvalue = modes_of(scene.replace(force=())).eigenvalue
        except ComputationError:
            return _estimate(scene)
        return _timescales_of(eigenvalue, scene)
    return _estimate(scene)


def _timescales_of(eigenvalues: Complexes, scene: Scene) -> Timescales:
    """The time scales of these eigenvalues (1/s)."""
    swings = np.abs(eigenvalues[(np.abs(eigenvalues.imag) > np.abs(eigenvalues.real)) | (eigenvalues.real > 0)])
    swing = float(swings.max(initial=0.0)) or _estimate(scene).swing
    return Timescales(swing, float(np.max(-eigenvalues.real, initial=0.0)), True)


def sample_count(duration: float, swing: float) -> int:
    """The default number of samples of a motion over `duration` (s) whose fastest oscillation is `swing` (rad/s)."""
    return max(ceil(min(duration * swing / (2 * pi) * SAMPLES_PER_PERIOD, SAMPLES_MAX)), SAMPLES_MIN)


def _estimate(scene: Scene) -> Timescales:
    system = system_of(scene)
    decay = max(float(np.max(group.block.damping / (group.moment + group.block.rotor))) for group in system.groups)
    if system.cart and system.cart.mass:
        decay = max(decay, system.cart.damping / system.cart.mass)
    shortest = min(link.length for link in scene.links())
    return Timescales(sqrt(4 * scene.gravity / shortest), decay, False)


LOOSEST = 1e-2
"""Limit: the largest tolerance."""
TIGHTEST = 1e-15
"""Limit: the smallest tolerance, which series alone reach."""
COARSEST = 0.3
"""Limit: the largest accuracy (rad)."""
FINEST = 1e-14
"""Limit: the smallest accuracy (rad)."""
DRIVE_LOOKS = 2000
"""Tolerance: times at which the force of a support is sampled for the size of a motion."""
NUMBERS_MAX = 50_000_000
"""Limit: numbers stored of a run in all, 400 MB."""


def validate(*actions: Callable[[], Any]) -> list[Any]:
    """The results of the actions; one SceneError with the problems of all of them."""
    results: list[Any] = []
    problems: list[str] = []
    for action in actions:
        with gathered(problems):
            results.append(action())
    refuse_any(problems)
    return results


def validate_numbers(duration: float, tolerance: float, start_time: float) -> None:
    """Raise SceneError for an invalid duration, tolerance or start time."""
    checks = {
        f"duration {duration!r}: must be a positive number of seconds": _real(duration) and duration > 0,
        f"tolerance {tolerance!r}: must be from {TIGHTEST:g} to {LOOSEST:g}": _real(tolerance)
        and TIGHTEST <= tolerance <= LOOSEST,
        f"start_time {start_time!r}: must be a number of seconds": _real(start_time),
    }
    refuse_any(problem for problem, holds in checks.items() if not holds)


def validate_whole(minimum: int, *, optional: bool = False, **values: object) -> None:
    """SceneError that names every value that is not an integer from `minimum` on; None is allowed where `optional`."""
    wrong = [
        f"{name} {value!r}: must be a whole number from {minimum}"
        for name, value in values.items()
        if not (optional and value is None)
        and (not isinstance(value, Integral) or isinstance(value, bool) or value < minimum)
    ]
    refuse_any(wrong)


def validate_accuracy(accuracy: float | None) -> None:
    """Raise SceneError for an invalid accuracy."""
    if accuracy is None:
        return
    if not _real(accuracy) or not FINEST <= accuracy <= COARSEST:
        raise SceneError([f"accuracy {accuracy!r}: must be from {FINEST:g} to {COARSEST:g} rad"])


def _real(value: object) -> bool:
    try:
        return isinstance(value, Real) and not isinstance(value, bool) and isfinite(value)
    except OverflowError:  # of a whole number beyond all floats
        return False


def sample_times(
    scene: Scene, duration: float, start_time: float, output: int | Sequence[float] | Floats | None
) -> Floats:
    """The output times from `start_time` on: an evenly spaced number, given times, or a default for the scene."""
    validate_scene(scene)
    validate_numbers(duration, LOOSEST, start_time)
    size = 2 * (scene.n_links * (3 if scene.space == "space" else 1) + 1)
    if output is None:
        shaking = pi / system_of(scene).shortest if scene.is_forced else 0.0
        usual = sample_count(duration, max(estimate_timescales(scene).swing, shaking))
        output = max(2, min(usual, NUMBERS_MAX // size - 1)) + 1
    if isinstance(output, Integral) and not isinstance(output, bool):
        count, limit = int(output), NUMBERS_MAX // size
        if not 2 <= count <= limit:
            raise SceneError([f"output {count}: must be from 2 to {limit} samples for this scene"])
        times = start_time + np.linspace(0.0, duration, count)
    else:
        times = start_time + _times_of(output, duration)
    if np.any(np.diff(times) <= 0):
        raise SceneError([f"duration {duration:g}: too short compared with the start at {start_time:g} s"])
    return np.asarray(times)


def pace_of(breaks: Sequence[float] | Floats | None, max_step: float | None) -> Pace:
    """The pace of a run whose steps end at the times `breaks` (s), in any order, and are no longer than `max_step` (s).

    Raise SceneError for invalid arguments.
    """
    try:
        times = np.array([] if breaks is None else breaks, dtype=float)
    except (TypeError, ValueError):
        times = np.array(np.nan)
    problems = []
    if times.ndim != 1 or not np.all(np.isfinite(times)):
        problems.append("breaks: must be times in seconds")
    if max_step is not None and not (_real(max_step) and max_step > 0):
        problems.append(f"max_step {max_step!r}: must be a positive number of seconds")
    refuse_any(problems)
    return Pace(longest=inf if max_step is None else float(max_step), breaks=tuple(sorted(set(times.tolist()))))


def validate_load(load: object) -> None:
    """Raise SceneError for a load that is no function."""
    if load is not None and not callable(load):
        raise SceneError([f"load {load!r:.60}: must be a function of the time and the state"])


def validate_events(events: object) -> None:
    """Raise SceneError for anything but a list of events."""
    if isinstance(events, str) or not isinstance(events, Sequence) or any(not isinstance(e, Event) for e in events):
        raise SceneError([f"events {events!r:.60}: must be a list of Events"])


def validate_observable(load: Load | None, accuracy: float | None, *hints: object) -> None:
    """Raise SceneError for an accuracy under a load where none of `hints` says how soon the load changes."""
    if load is not None and accuracy is not None and all(hint is None for hint in hints):
        what = "a short one can fall between the steps of every run, so that all agree and are wrong"
        times = "the times at which it jumps as breaks, [] where it never does"
        raise SceneError([f"load: {what}: for an accuracy give {times}, or the shortest time that it acts as max_step"])


def _times_of(output: Any, duration: float) -> Floats:
    try:
        times = np.array(output, dtype=float)
    except (TypeError, ValueError):
        times = np.array(np.nan)
    if times.ndim != 1 or times.size == 0 or not np.all(np.isfinite(times)) or np.any(np.diff(times) <= 0):
        raise SceneError(["output: must be a number of samples or ascending times in seconds"])
    if times[0] < 0 or times[-1] > duration:
        raise SceneError([f"output: must lie between 0 and {duration:g} s"])
    return times if times[0] == 0 else np.concatenate(([0.0], times))


def validate_forces(load: Load | None, system: System, start: State, time: float) -> None:
    """Evaluate a load once, at the start; raise SceneError for anything but `AppliedForces` that fit the scene."""
    if load is None:
        return
    push, shape = load(time, start), (system.n_links, 3) if system.spatial else (system.n_links,)
    if not isinstance(push, AppliedForces):
        raise SceneError([f"load: must return AppliedForces, not {type(push).__name__}"])
    problems = []
    if system.cart is None and push.cart:
        problems.append("load: acts on the cart, but the support is fixed")
    size = system.first if system.structure is not None else 0
    if push.supports is not None and np.shape(push.supports) != (size,):
        problems.append(f"load: supports have shape {np.shape(push.supports)}, this scene needs {(size,)}")
    if push.moments is not None and np.shape(push.moments) != shape:
        problems.append(f"load: moments have shape {np.shape(push.moments)}, this scene needs {shape}")
    if push.cart is None or not all(np.all(np.isfinite(part)) for part in push if part is not None):
        problems.append("load: must be finite")
    refuse_any(problems)


def shaken(system: System, rest: Floats, layout: Layout, y: Floats, scale: Floats, times: Floats) -> Floats:
    """The sizes (S,) of motions that time drives: of their starts, or of their `drive_of`, at most 1."""
    first, half = layout.first, layout.half
    push, sizes = drive_of(system, times), extents(system, rest, layout, y, scale)
    rests = (y[first:half] == rest).all(0) & ~y[half + first : 2 * half].any(0)
    sizes = np.minimum(1.0, np.where((sizes == 1) & (push < 1) & rests, push, np.maximum(push, sizes)))
    return np.asarray(np.where(sizes == 0, 1.0, sizes))


def drive_of(system: System, times: Floats) -> Floats:
    """How strongly time drives a system within times (T,): accelerations over gravity, forces over weights, (S,)."""
    gravity, times = np.atleast_1d(system.gravity), np.linspace(times[0], times[-1], DRIVE_LOOKS)[:, None]
    drive = system.support.largest(times) / gravity if system.support else 0.0
    lightest = np.min([group.block.mass.min((0, 1)) for group in system.groups], axis=0)
    reach = np.max([group.block.length.max((0, 1)) for group in system.groups], axis=0)
    weight = gravity * lightest
    for force in system.forces:
        size = np.abs(force.course.beside(times)).max(0)
        drive = drive + size / (weight * (reach if force.direction is None else 1.0))
    return np.asarray(drive)


def extents(system: System, rest: Floats, layout: Layout, y: Floats, scale: Floats) -> Floats:
    """How far each start y (size, S) is from equilibrium, in natural units: at most 1, and 1 for one exactly there.

    `rest` (…, 1) are links in equilibrium.  Whole turns, the position of a cart without a spring and its coasting
    without a damper do not count.
    """
    half, cart, links = layout.half, system.cart, slice(layout.first, layout.half)
    aside = y[: 2 * half].copy()
    aside[links] -= rest
    if not system.spatial:
        aside[links] = (aside[links] + pi) % (2 * pi) - pi
    parts = np.abs(aside / scale[: 2 * half])
    if cart is not None:
        is_held = np.asarray(cart.stiffness) > 0
        parts[0] *= is_held
        parts[half] *= is_held | (np.asarray(cart.damping) > 0) | bool(system.rail or system.has_drag)
    largest = np.minimum(parts.max(0), 1.0)
    return np.asarray(np.where(largest == 0, 1.0, largest))


def extent(state: State, system: System, times: Floats | None = None) -> float:
    """That of one start, or with `times` (T,) the size of its motion, which time drives."""
    layout = Layout.of(system, works=False, width=3 if system.spatial else 1)
    rest = system.coordinates_at_rest[system.first :]
    y, scale = layout.begin(state)[:, None], layout.natural(system)[:, None]
    start = system, rest.reshape(-1, 1), layout, y, scale
    return float((extents(*start) if times is None else shaken(*start, times))[0])
