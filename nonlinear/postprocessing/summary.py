"""A run in a few lines: what moved how far, how it was computed, and what certifies it."""

from __future__ import annotations

from collections.abc import Iterator
from math import isfinite

import numpy as np

from modal.report import visible
from nonlinear.dynamics import is_unstable_equilibrium
from nonlinear.integration import CLOSED, TRUNCATED, Trajectory, departure
from nonlinear.reduction import CORRECTED, LINEAR

FORMS = {
    "minimal": "minimal coordinates",
    "maximal": "maximal coordinates and pivot forces",
    "hamiltonian": "Hamilton's equations",
    "spatial": "unit vectors",
    TRUNCATED: "a few mode shapes",
    LINEAR: "modes in closed form",
    CORRECTED: "modes in closed form, each with the frequency of its amplitude",
}
MOST_EVENTS = 10
DRIFT = 1e-3  # of what the energies range over


def text(trajectory: Trajectory) -> str:
    """The lines, ready to print."""
    lines = list(_lines(trajectory))
    width = max(len(name) for name, _ in lines)
    title = trajectory.scene.title or "untitled scene"
    return "\n".join(map(visible, [title, *(f"{name:<{width}}  {words}" for name, words in lines)]))


def _lines(trajectory: Trajectory) -> Iterator[tuple[str, str]]:
    run, times = trajectory.run, trajectory.times
    yield "time", f"{times[0]:g} to {times[-1]:.9g} s in {len(times)} samples"
    if run.stopped:
        yield "stopped", run.stopped
    yield from _way(trajectory)
    if isfinite(run.error):
        yield "accuracy", f"no angle is off by more than {run.error:.2g} rad"
    yield from _ranges(trajectory)
    if trajectory.system.kicked:
        yield "drives", f"{len(trajectory.kicks.time)} kicks fed {trajectory.kicks.energy.sum():.6g} J"
    if run.method == CLOSED and trajectory.system.works:
        yield "energy", "what dampers take is not counted in closed form"
    else:
        yield "energy", _drift(trajectory.energy_drift())
    if trajectory.keeps_momentum or trajectory.keeps_spin:
        which = "along the rail" if trajectory.keeps_momentum else "about the vertical"
        yield "momentum", f"drift {trajectory.momentum_drift():.2g}, {which}"
    if run.form in {"maximal", "spatial"}:
        yield "constraints", f"drift {trajectory.constraint_drift():.2g} in a step"
    for happening in trajectory.happenings[:MOST_EVENTS]:
        yield "event", f"{happening.name} at {happening.time:.12g} s"
    if (more := len(trajectory.happenings) - MOST_EVENTS) > 0:
        yield "", f"and {more} more"


def _drift(share: float) -> str:
    trust = "" if share < DRIFT else "; too much to trust this motion: ask for a tighter tolerance or an accuracy"
    return f"drift {share:.2g} of what its energies range over{trust}"


def _way(trajectory: Trajectory) -> Iterator[tuple[str, str]]:
    run = trajectory.run
    yield "equations", FORMS[run.form]
    if is_unstable_equilibrium(trajectory.system, trajectory.motion[0]):
        yield "start", "an unstable rest: what follows is rounding"
    if run.reduced:
        yield "integrated", run.reduced
    if found := departure(trajectory):
        yield "symmetry", found.words
    if run.method == CLOSED:
        yield "integrator", f"none: {run.reason}"
    else:
        yield "integrator", f"{run.method} at tolerance {run.tolerance:g}: {run.reason}"
        yield "cost", f"{run.steps} steps, {run.calls} derivatives"


def _ranges(trajectory: Trajectory) -> Iterator[tuple[str, str]]:
    motion = trajectory.motion
    down = np.clip(motion.links[..., -1], -1.0, 1.0) if trajectory.system.spatial else None
    angles = np.rad2deg(motion.links if down is None else np.arccos(down))
    yield "angles", f"{angles.min():.6g} to {angles.max():.6g} deg" + (" from the vertical" if down is not None else "")
    if trajectory.system.cart:
        yield "cart", f"{motion.cart.min():.6g} to {motion.cart.max():.6g} m"
