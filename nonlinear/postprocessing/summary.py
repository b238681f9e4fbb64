"""A run in a few lines: the range of the motion, the method, the drifts, and the savings.

The report describes the equations that were integrated and the packages that the process has loaded.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from math import degrees, isfinite
from typing import Any

from modal.eigen import noun_count
from modal.errors import ComputationError, SceneError
from modal.modes.solution_report import loaded_packages, packages_not_loaded
from modal.report import visible
from modal.scene import LengthLaw, SineMotion, refusals, title_of
from modal.scene.doors import require_type
from nonlinear.dynamics import Generated, Reduced, is_unstable_equilibrium
from nonlinear.integration import CLOSED, EXPLICIT, SCIPY, TRUNCATED, SolverInfo, Trajectory, departure
from nonlinear.postprocessing.reaction_forces import slack_words
from nonlinear.postprocessing.resampling import Extent, extent_of, extremes, places_of
from nonlinear.reduction import CORRECTED, LINEAR
from nonlinear.system import System

FORMS = {
    "minimal": "minimal coordinates",
    "maximal": "maximal coordinates and pivot forces",
    "hamiltonian": "Hamilton's equations",
    "spatial": "unit vectors",
    TRUNCATED: "a few mode shapes",
    LINEAR: "modes in closed form",
    CORRECTED: "modes in closed form, each with the frequency of its amplitude",
}
EVENTS_SHOWN = 10
"""Format: events that are listed individually."""
FLOQUET_LINKS_MAX = 60
"""Cost: links of which Floquet multipliers are computed along with a run, within a second (benchmarks/modes.py)."""
DRIFT_MAX = 1e-3
"""Limit: energy drift over the range of the energies, beyond which the summary trusts no motion."""
UNITS = {"rad": (degrees(1.0), "deg"), "m": (1.0, "m")}
"""The units in which coordinates of supports are reported, by the unit at the end of their names."""
IMPLICIT = tuple(method for method in SCIPY if method not in EXPLICIT)


def text(trajectory: Trajectory, *, ropes: bool = True) -> str:
    """The lines, ready to print; with `ropes` also which links of bobs push, which takes another look at the run."""
    lines = [*_lines(trajectory)]
    if ropes:
        lines += [("" if number else "ropes", words) for number, words in enumerate(slack_words(trajectory))]
    width = max(len(name) for name, _ in lines)
    title = title_of(trajectory.scene)
    return "\n".join(map(visible, [title, *(f"{name:<{width}}  {words}" for name, words in lines)]))


def _lines(trajectory: Trajectory) -> Iterator[tuple[str, str]]:
    run, times = trajectory.run, trajectory.times
    yield "time", f"{times[0]:g} to {times[-1]:.9g} s in {len(times)} samples"
    if run.stopped:
        yield "stopped", run.stopped
    yield from _way(trajectory)
    if isfinite(run.error):
        yield "accuracy", f"no angle is off by more than {run.error:.2g} rad"
    elif run.form == TRUNCATED:
        yield "accuracy", "unknown: the effect of the omitted shapes was not estimated"
    yield from _ranges(trajectory)
    if trajectory.system.has_escapements:
        yield "drives", f"{len(trajectory.kicks.time)} kicks supplied {trajectory.kicks.energy.sum():.6g} J"
    yield from _friction(trajectory)
    if run.method == CLOSED and trajectory.system.works:
        yield "energy", "the work of dampers is not computed in closed form"
    else:
        yield "energy", _drift(trajectory.energy_drift())
    if trajectory.keeps_momentum or trajectory.keeps_spin:
        which = "along the rail" if trajectory.keeps_momentum else "about the vertical"
        yield "momentum", f"drift {trajectory.momentum_drift():.2g}, {which}"
    if run.form in {"maximal", "spatial"} or (run.form == "hamiltonian" and trajectory.system.spatial):
        yield "constraints", f"drift {trajectory.constraint_drift():.2g} in a step"
    for happening in trajectory.happenings[:EVENTS_SHOWN]:
        yield "event", f"{happening.name} at {happening.time:.12g} s"
    if (remaining := len(trajectory.happenings) - EVENTS_SHOWN) > 0:
        yield "", f"and {remaining} more"


def _friction(trajectory: Trajectory) -> Iterator[tuple[str, str]]:
    """The phases of dry friction."""
    if not trajectory.system.rubs:
        return
    friction = trajectory.friction
    yield (
        "friction",
        f"dissipated {-friction.work.sum():.6g} J; {noun_count(len(friction.link), 'phase', 'phases')} of sticking",
    )
    if isfinite(friction.rest):
        yield "at rest", f"from {friction.rest:.9g} s on"


def _drift(share: float) -> str:
    trust = "" if share < DRIFT_MAX else "; too much to trust this motion: use a tighter tolerance or an accuracy"
    return f"relative drift {share:.2g}{trust}"


def _way(trajectory: Trajectory) -> Iterator[tuple[str, str]]:
    run = trajectory.run
    yield "equations", FORMS[run.form]
    if trajectory.system.support is None and is_unstable_equilibrium(trajectory.system, trajectory.motion[0]):
        yield "start", "an unstable equilibrium: the motion is due to rounding"
    if run.reduced:
        yield "integrated", run.reduced
    if symmetry := departure(trajectory):
        yield "symmetry", symmetry.words
    if run.method == CLOSED:
        yield "integrator", f"none: {run.reason}"
    else:
        yield "integrator", f"{run.method} at tolerance {run.tolerance:g}: {run.reason}"
        yield "cost", f"{run.steps} steps, {run.calls} derivatives"


def _ranges(trajectory: Trajectory) -> Iterator[tuple[str, str]]:
    angles, motion = extent_of(trajectory), trajectory.motion
    where = " from the vertical" if trajectory.system.spatial else ""
    yield "angles", f"{degrees(angles.low):.6g} to {degrees(angles.high):.6g} deg{where}{_at(angles)}"
    if support := trajectory.system.support:
        displacements = [motion.displacement(trajectory.times) for _, motion in support.motions]
        ways = zip(displacements, support.ways, strict=True)
        words = " and ".join(f"{places.min():.6g} to {places.max():.6g} m {way}" for places, way in ways)
        yield "support", f"{words}; angles and energies are in its frame"
    for source in trajectory.system.prescribed_motions:
        if source.words:
            yield "", source.words
    for _, law in trajectory.system.hoisting.laws if trajectory.system.hoisting else ():
        if isinstance(law, LengthLaw) and law.words:
            yield "hoist", law.words
    if trajectory.system.support:
        yield from _parametric(trajectory)
    if structure := trajectory.system.structure:
        for k, name in enumerate(structure.names):
            low, high = (
                float(extreme[k]) for extreme in extremes(trajectory.times, motion.supports, motion.support_rates)
            )
            stem, _, unit = name.rpartition("_")
            factor, display_unit = UNITS.get(unit, (1.0, ""))
            low, high = factor * low, factor * high
            yield stem if display_unit else name, f"{low:.6g} to {high:.6g} {display_unit}".rstrip()
    if trajectory.system.cart:
        places = extent_of(trajectory, places_of)
        yield "cart", f"{places.low:.6g} to {places.high:.6g} m{_at(places)}"


def _at(extent: Extent) -> str:
    return "" if extent.between else ", in the samples"


def _parametric(trajectory: Trajectory) -> Iterator[tuple[str, str]]:
    """Whether small angles grow under a vertical sine, of few links."""
    scene = trajectory.scene
    if scene.n_links > FLOQUET_LINKS_MAX or not scene.is_moved:
        return
    vertical = any(isinstance(motion, SineMotion) and motion.direction == "vertical" for motion in scene.motions)
    if vertical and not refusals(scene, "a Floquet multiplier"):
        from modal.vibration import parametric_stability

        with suppress(SceneError, ComputationError):
            yield "parametric", parametric_stability(scene).words


@dataclass(frozen=True)
class Inventory:
    """Coordinates of the whole scene and of the integrated system, numbers in y, dense matrices (order, count).

    `coordinates` counts every copy, both directions in space, the cart.  `left_out` are sentences, `modules` the larger
    packages that this process has loaded.
    """

    coordinates: int
    integrated: int
    numbers: int
    matrices: tuple[tuple[int, int], ...]
    left_out: tuple[str, ...]
    modules: tuple[str, ...]

    def text(self) -> str:
        """For a terminal."""
        sizes = ", ".join((f"{number} × " if number > 1 else "") + f"{n}×{n}" for n, number in self.matrices)
        total = noun_count(self.coordinates, "coordinate")
        return "\n".join(
            [
                f"Integrated: {noun_count(self.integrated, 'coordinate')}, {self.numbers} numbers, "
                f"for a scene of {total}",
                f"  matrices: {sizes or 'none'}",
                f"  packages: {', '.join(self.modules)}",
                "Left out:",
                *(f"  {sentence}" for sentence in self.left_out),
                "",
            ]
        )

    def record(self) -> dict[str, Any]:
        """For JSON; all numbers are counts."""
        return dict(vars(self)) | {"matrices": [{"order": n, "number": number} for n, number in self.matrices]}


def run_inventory(trajectory: Trajectory) -> Inventory:
    """The inventory of a run made in this process; raise ComputationError for one that was read from a file."""
    require_type("trajectory", trajectory, "Trajectory")
    system, equations = trajectory.system, trajectory.equations
    if trajectory.run.method == CLOSED:
        return Inventory(
            _freedom(system),
            0,
            0,
            (),
            ("no integration: the motion follows from the modes", *packages_not_loaded()),
            loaded_packages(),
        )
    if equations is None:
        raise ComputationError("how a saved run was computed is not saved with it")
    inner: Any = equations.inner if isinstance(equations, Reduced) else equations
    form, numbers = trajectory.run.form, len(inner.scale)
    matrices = tuple(_matrices(inner, trajectory.run))
    size = numbers // 2 if form == "maximal" else inner.shapes.shape[1] if form == TRUNCATED else _freedom(inner.system)
    left_out = (*_coordinates(trajectory, inner), *_dense(size, matrices, inner), *packages_not_loaded())
    return Inventory(_freedom(system), size, numbers, matrices, left_out, loaded_packages())


def _freedom(system: System) -> int:
    return system.n_links * (2 if system.spatial else 1) + system.first


def _matrices(inner: Any, run: SolverInfo) -> Iterator[tuple[int, int]]:
    """The dense matrices of one derivative, and an implicit integrator's own; Taylor series have none."""
    if run.method in IMPLICIT:
        yield len(inner.scale), 1
    if run.form == TRUNCATED:
        yield inner.shapes.shape[1], 1
    elif run.form == "maximal" and inner.pivots.saddle.is_dense:
        yield inner.pivots.saddle.size, 1


def _coordinates(trajectory: Trajectory, inner: Any) -> Iterator[str]:
    run = trajectory.run
    if trajectory.system.first == 0:
        yield f"no cart coordinate: the support {'moves as prescribed' if trajectory.system.support else 'is fixed'}"
    if run.reduced:
        yield f"all but {run.reduced}"
    if run.form == TRUNCATED:
        yield f"every mode but {inner.shapes.shape[1]} shapes"
    if run.form != "maximal":
        yield "no pivot forces: only maximal coordinates need them"
    if len(inner.scale) % 2 == 0:
        yield "no work: nothing damps or drives"


def _dense(size: int, matrices: tuple[tuple[int, int], ...], inner: Any) -> Iterator[str]:
    largest = max((order for order, _ in matrices), default=0)
    if not largest:
        instead = "the equations are written out" if isinstance(inner, Generated) else "O(n) steps along the chains"
        yield f"no matrix of {size} × {size}: {instead}"
    elif largest < size:
        yield f"no matrix of {size} × {size}: {largest} × {largest} are the largest"
