"""Arguments shared by the commands about motion: the run, and its initial condition."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import TYPE_CHECKING

from multipendula.commands.shared import bar, forewarning, in_a_folder, remark
from multipendula.options import (
    RUNS,
    add_accuracy,
    add_duration,
    add_run,
    add_samples,
    add_start,
    add_tolerance,
    add_words,
    endings,
)
from multipendula.parser import Page

if TYPE_CHECKING:
    from modal.scene import Scene
    from nonlinear.integration import Trajectory
    from nonlinear.system import State

"""Largest angle of a scene without a start."""
START = (
    ": scene (default; without one mode:R:5, R the first that swings), mode:R:DEG, orbit:R:DEG (a periodic orbit), "
    "orbit (the motion that repeats with the drives) or angles:A,B,... (deg, at rest)"
)
HOW = ("method", "form", "tolerance", "accuracy")


def add_run_arguments(page: Page, duration: float) -> None:
    """A scene or a saved run, and how to simulate it, by default for `duration` (s)."""
    add_run(page)
    add_duration(page, f" (default {duration:g})")
    page.set_defaults(usual=duration)
    add_start(page, START)
    methods = ("auto", "DOP853", "RK45", "RK23", "Radau", "BDF", "LSODA", "taylor")
    add_words(page.computed, "--method", methods, f": {', '.join(methods)} (default auto)", comma="")
    forms = ("auto", "minimal", "maximal", "hamiltonian", "spatial")
    add_words(page.computed, "--form", forms, f": {', '.join(forms)} (default auto)", comma="")
    add_tolerance(page)
    add_accuracy(page, ", instead of a tolerance")
    add_samples(page)


def recorded(name: str) -> bool:
    """Whether a name is the name of a saved run."""
    return name.lower().endswith(endings(RUNS))


def run_of(options: argparse.Namespace, target: Callable[[], object]) -> Trajectory:
    """A new run of a scene, or the continuation of a saved one, once `target` has accepted the file to write."""
    from modal.scene import load
    from nonlinear import files as recordings
    from nonlinear.integration import validate, validate_method
    from nonlinear.simulation import resume
    from nonlinear.simulation import simulate as run

    duration = options.duration or options.usual
    given = {name: getattr(options, name) for name in HOW if getattr(options, name)}
    if recorded(options.scene):
        before = validate(
            target,
            lambda: in_a_folder(options.output),
            lambda: _unstarted(options),
            lambda: recordings.load(options.scene),
        )[-1]
        with bar(duration) as report:
            told = forewarning(report, before.scene, duration)
            return resume(before, duration, output=options.samples, report=told, **given)
    scene = load(options.scene)
    words = {name: given.get(name, "auto") for name in ("method", "form")}
    *_, start, _ = validate(
        target,
        lambda: in_a_folder(options.output),
        lambda: start_of(scene, options.start),
        lambda: validate_method(scene, **words),
    )
    with bar(duration) as report:
        told = forewarning(report, scene, duration)
        return run(scene, duration, start=start, output=options.samples, report=told, **given)


def in_few_modes(options: argparse.Namespace, target: Callable[[], object]) -> Trajectory:
    """A new run of a scene, restricted to its lowest modes by --keep-modes."""
    from modal.errors import SceneError
    from modal.scene import load
    from nonlinear.integration import validate
    from nonlinear.reduction import simulate_truncated

    def fitting() -> None:
        problems = [
            f"--{name}: cannot be combined with --keep-modes" for name in ("form", "accuracy") if getattr(options, name)
        ]
        if recorded(options.scene):
            problems.append(f"{options.scene}: is a saved run, and --keep-modes needs a scene")
        if problems:
            raise SceneError(problems)

    *_, scene = validate(target, lambda: in_a_folder(options.output), fitting, lambda: load(options.scene))
    duration = options.duration or options.usual
    given = {name: getattr(options, name) for name in ("method", "tolerance") if getattr(options, name)}
    with bar(duration) as report:
        return simulate_truncated(
            scene,
            duration,
            options.keep_modes,
            start=start_of(scene, options.start),
            output=options.samples,
            report=report,
            **given,
        ).trajectory


def _unstarted(options: argparse.Namespace) -> None:
    from modal.errors import SceneError

    if options.start:
        raise SceneError(["--start: a saved run continues from its last state"])


ELSEWHERE = "another one: start = { angles_deg = [...] } in an entry of the file"
"""How a scene gets a start where a command has no --start."""


def start_of(
    scene: Scene, words: str | None, *, undamped: bool = False, told: bool = False, elsewhere: str = ""
) -> State | None:
    """None for the file's own start, else a mode's shape, a periodic orbit, or angles at rest, as these words say.

    Without words a scene that has no start gets the first mode that swings along the rail; a note to standard error
    says so, unless that has been `told`, and what to do `elsewhere` where a command has no --start.  `undamped` selects
    the shape without dampers; R is the number in the table of the scene even then.
    """
    from modal.errors import SceneError
    from nonlinear.system import has_start
    from nonlinear.system import initial as starts

    if words is None and not has_start(scene):
        words = _usual_start(scene, undamped=undamped)
        number, _, _ = words.removeprefix("mode:").partition(":")
        if not told:
            tell_of_start(f"it begins in the shape of mode {number}", elsewhere or f"--start {words}")
    if words is None or words == "scene":
        return None
    kind, _, rest = words.partition(":")
    number, _, degrees = rest.partition(":")
    try:
        if kind == "angles":
            return starts.state_at_rest(scene, [float(word) for word in rest.split(",")])
        if kind == "mode":
            return _in_mode(scene, int(number), float(degrees), undamped=undamped)
        if words == "orbit":
            return _under_drives(scene)
        if kind == "orbit":
            return _on_orbit(scene, int(number), float(degrees))
    except ValueError as error:
        if isinstance(error, SceneError):
            raise
    forms = "scene, mode:R:DEG such as mode:2:10, orbit:R:DEG, orbit, or angles:A,B,... in degrees"
    raise SceneError([f"--start {words}: must be {forms}"])


def tell_of_start(where: str, how: str = "") -> None:
    """A note to standard error on where a scene begins that has no start of its own."""
    from nonlinear.reduction import USUAL_DEG

    note = f"the scene has no start: {where}, its largest angle {USUAL_DEG:g}°"
    remark(f"{note}{f' ({how})' if how else ''}")


def _usual_start(scene: Scene, *, undamped: bool) -> str:
    """The words for the first mode that swings along the rail, at a small angle; SceneError if there is none."""
    from modal.errors import SceneError
    from nonlinear.reduction import USUAL_DEG, first_that_swings

    try:
        number = first_that_swings(scene, undamped=undamped)
    except SceneError as error:
        raise SceneError([f"{error}: give --start angles:10,20,... in degrees"]) from None
    return f"mode:{number}:{USUAL_DEG:g}"


def _under_drives(scene: Scene) -> State:
    """The start of the motion that repeats with the drives."""
    from nonlinear.orbits import forced_orbit

    return forced_orbit(scene).state


def _on_orbit(scene: Scene, number: int, degrees: float) -> State:
    from math import radians

    from modal.errors import SceneError
    from nonlinear.orbits import mode_orbit
    from nonlinear.system import State

    if not 0 < abs(degrees) < 180:
        raise SceneError([f"--start orbit:{number}:{degrees:g}: the largest angle must be a number below 180 deg"])
    orbit = mode_orbit(scene, number, radians(abs(degrees)))
    if degrees > 0:
        return orbit.state
    return State(2 * orbit.flow.system.rest - orbit.state.links, orbit.state.link_rates, -orbit.state.cart)


def _in_mode(scene: Scene, number: int, degrees: float, *, undamped: bool) -> State:
    from math import radians

    import numpy as np

    from modal.errors import SceneError
    from modal.modes import table_numbers
    from nonlinear.integration import modes_of
    from nonlinear.reduction import copy_along, start_in_mode
    from nonlinear.system import of_plane

    modes = modes_of(scene)
    if not 1 <= number <= len(modes):
        raise SceneError([f"--start mode:{number}: the scene has modes 1 to {len(modes)}"])
    if modes.omega[number - 1] == 0:
        raise SceneError([f"--start mode:{number}: a rigid translation has no angle"])
    if not 0 < abs(degrees) <= 180:
        raise SceneError([f"--start mode:{number}:{degrees:g}: the largest angle must be a number of at most 180 deg"])
    row = number - 1
    if undamped:
        found = np.flatnonzero(table_numbers(scene) == number)
        if not found.size:
            raise SceneError([f"--start mode:{number}: is a mode of the dampers alone, which does not oscillate"])
        scene, row = scene.conservative, int(found[0])
        modes = modes_of(scene)
    state = start_in_mode(scene, modes, row, copy_along(modes, row), radians(degrees))
    return state if scene.space == "plane" else of_plane(state)


def shown_of(options: argparse.Namespace, target: Callable[[], object]) -> Trajectory:
    """A saved run unchanged, or a new complete run of a scene."""
    from modal.errors import SceneError
    from nonlinear import files as recordings
    from nonlinear.integration import validate

    if not recorded(options.scene):
        return whole(run_of(options, target))
    asked = [name for name in ("start", "duration", *HOW, "samples") if getattr(options, name)]
    if asked:
        raise SceneError([f"--{name}: cannot change a saved run" for name in asked])
    found: Trajectory = validate(target, lambda: in_a_folder(options.output), lambda: recordings.load(options.scene))[
        -1
    ]
    return found


def whole(trajectory: Trajectory) -> Trajectory:
    """The trajectory itself; KeyboardInterrupt where Ctrl-C cut it short."""
    if trajectory.run.interrupted:
        raise KeyboardInterrupt
    return trajectory
