"""Arguments shared by the commands about motion: the run, and its initial condition."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

import modal
import nonlinear
from multipendula.command import RUN, SCENE, TOLERANCE, Takes, option
from multipendula.commands.shared import bar, forewarning, in_a_folder, remark
from multipendula.options import FORMS, METHODS, RUNS, endings

if TYPE_CHECKING:
    from modal.scene import Scene
    from nonlinear.accuracy import Advice
    from nonlinear.integration import Trajectory
    from nonlinear.system import State

START = (
    ": scene (default; without one mode:R:5, R the first that swings), mode:R:DEG, orbit:R:DEG (a periodic orbit), "
    "orbit (the motion that repeats with the drives) or angles:A,B,... (deg, at rest)"
)
MOTION = {
    "start": f"--start{START}",
    "samples": "--samples",
    "method": f"--method: {', '.join(METHODS)} (default auto)",
    "form": f"--form: {', '.join(FORMS)} (default auto)",
    "tolerance": TOLERANCE,
    "accuracy": "--accuracy, instead of a tolerance",
    "keep_modes": "--keep-modes",
}
"""The options of a motion other than its duration, by name: every command that simulates one takes them from here."""
Check = Callable[[], object]
Computed = TypeVar("Computed")
HOW = ("method", "form", "tolerance", "accuracy")


def motion(duration: float, *, runs: bool = True, without: Sequence[str] = ()) -> tuple[Takes, ...]:
    """Arguments of a command that simulates: a scene, or with `runs` a saved run, too, and all options but some."""
    taken = (words for name, words in MOTION.items() if name not in without)
    return (RUN if runs else SCENE, option(f"--duration (default {duration:g})", usual=duration), *taken)


@dataclass(frozen=True)
class RunOptions:
    """The request for a motion: a scene or a saved run, its duration (s), and options by name, if given.

    `output` is the file that the command writes, whose folder is looked for before anything is computed; where it
    `resolves_modes`, a default duration is long enough for the spectrum to separate them.
    """

    scene: Any
    duration: float
    given: Mapping[str, Any]
    output: str | None = None
    resolves_modes: bool = False

    @classmethod
    def of(cls, options: argparse.Namespace) -> RunOptions:
        """Those of a command line."""
        arguments = {name: value for name in ("duration", *MOTION) if (value := getattr(options, name, None))}
        return cls(options.scene, options.duration or options.usual, arguments, options.output)

    @property
    def how(self) -> dict[str, Any]:
        """How a motion is computed: arguments of `simulate`."""
        return {name: self.given[name] for name in HOW if name in self.given}

    def run(self, *checks: Check) -> Trajectory:
        """A new run of a scene, or the continuation of a saved one, once the `checks` have passed."""
        if "keep_modes" in self.given:
            return self._in_few_modes(*checks)
        if recorded(self.scene):
            return self._continued(*checks)

        return self._computed(nonlinear.simulate, checks)

    def advice(self, *checks: Check) -> Advice:
        """The cheapest method for the accuracy, which `run` takes as well, with everything that was tried."""
        return self._computed(nonlinear.simulation.advise, checks)

    def shown(self, *checks: Check) -> Trajectory:
        """A saved run unchanged, or a new complete run of a scene."""
        if not recorded(self.scene):
            return self.run(*checks).uninterrupted()
        if self.given:
            raise modal.SceneError([f"--{name.replace('_', '-')}: cannot change a saved run" for name in self.given])
        trajectory: Trajectory = nonlinear.integration.validate(
            *checks, self._place, lambda: nonlinear.files.load(self.scene)
        )[-1]
        return trajectory

    def _place(self) -> None:
        in_a_folder(self.output)

    def _computed(self, function: Callable[..., Computed], checks: Sequence[Check]) -> Computed:
        """The result of a function with the arguments of `simulate` for a scene and its start."""
        scene = modal.load(self.scene)
        words = {name: self.given.get(name, "auto") for name in ("method", "form")}
        *_, start, _ = nonlinear.integration.validate(
            *checks,
            self._place,
            lambda: start_of(scene, self.given.get("start")),
            lambda: nonlinear.integration.validate_method(scene, **words),
        )
        duration = self.duration
        if self.resolves_modes and "duration" not in self.given:
            from nonlinear.plotting.run import resolving_duration

            duration = resolving_duration(scene, duration)
        with bar(duration) as bar_report:
            report = forewarning(bar_report, scene, duration)
            samples = self.given.get("samples")
            return function(scene, duration, start=start, output=samples, report=report, **self.how)

    def _continued(self, *checks: Check) -> Trajectory:
        *_, before = nonlinear.integration.validate(
            *checks, self._place, self._unstarted, lambda: nonlinear.files.load(self.scene)
        )
        with bar(self.duration) as bar_report:
            report = forewarning(bar_report, before.scene, self.duration)
            return nonlinear.resume(before, self.duration, output=self.given.get("samples"), report=report, **self.how)

    def _unstarted(self) -> None:
        if "start" in self.given:
            raise modal.SceneError(["--start: a saved run continues from its last state"])

    def _in_few_modes(self, *checks: Check) -> Trajectory:
        """A new run of a scene, restricted to its lowest modes by --keep-modes."""
        from nonlinear.reduction import simulate_truncated

        *_, scene = nonlinear.integration.validate(
            *checks, self._place, self._whole_scene, lambda: modal.load(self.scene)
        )
        how = {name: self.given[name] for name in ("method", "tolerance") if name in self.given}
        start, samples = start_of(scene, self.given.get("start")), self.given.get("samples")
        modes = self.given["keep_modes"]
        with bar(self.duration) as report:
            reduced = simulate_truncated(scene, self.duration, modes, start=start, output=samples, report=report, **how)
        return reduced.trajectory

    def _whole_scene(self) -> None:
        """Raise SceneError for options incompatible with --keep-modes."""
        asked = [name for name in ("form", "accuracy") if name in self.given]
        problems = [f"--{name}: cannot be combined with --keep-modes" for name in asked]
        if recorded(self.scene):
            problems.append(f"{self.scene}: is a saved run, and --keep-modes needs a scene")
        if problems:
            raise modal.SceneError(problems)


def recorded(source: object) -> bool:
    """Whether it is a run, or the name of a saved one."""
    return source.lower().endswith(endings(RUNS)) if isinstance(source, str) else type(source).__name__ == "Trajectory"


ELSEWHERE = "another one: start = { angles_deg = [...] } in an entry of the file"
"""How a scene gets a start where a command has no --start."""


def start_of(
    scene: Scene, words: str | State | None, *, undamped: bool = False, told: bool = False, elsewhere: str = ""
) -> State | None:
    """None for the file's own start, else a mode's shape, a periodic orbit, or angles at rest, as these words say.

    A state is its own.

    Without words a scene that has no start gets the first mode that swings along the rail; a note to standard error
    says so, unless that has been `told`, and what to do `elsewhere` where a command has no --start.  `undamped` selects
    the shape without dampers; R is the number in the table of the scene even then.
    """
    if not isinstance(words, str | None):
        return words
    if words is None and not nonlinear.system.has_start(scene):
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
            return nonlinear.system.initial.state_at_rest(scene, [float(word) for word in rest.split(",")])
        if kind == "mode":
            return _in_mode(scene, int(number), float(degrees), undamped=undamped)
        if words == "orbit":
            from nonlinear.orbits import forced_orbit

            return forced_orbit(scene).state
        if kind == "orbit":
            return _on_orbit(scene, int(number), float(degrees))
    except ValueError as error:
        if isinstance(error, modal.SceneError):
            raise
    forms = "scene, mode:R:DEG such as mode:2:10, orbit:R:DEG, orbit, or angles:A,B,... in degrees"
    raise modal.SceneError([f"--start {words}: must be {forms}"])


def tell_of_start(where: str, how: str = "") -> None:
    """A note to standard error on where a scene begins that has no start of its own."""
    from nonlinear.reduction import USUAL_DEG

    note = f"the scene has no start: {where}, its largest angle {USUAL_DEG:g}°"
    remark(f"{note}{f' ({how})' if how else ''}")


def _usual_start(scene: Scene, *, undamped: bool) -> str:
    """The words for the first mode that swings along the rail, at a small angle; SceneError if there is none."""
    from nonlinear.reduction import USUAL_DEG, first_that_swings

    try:
        number = first_that_swings(scene, undamped=undamped)
    except modal.SceneError as error:
        raise modal.SceneError([f"{error}: give --start angles:10,20,... in degrees"]) from None
    return f"mode:{number}:{USUAL_DEG:g}"


def _on_orbit(scene: Scene, number: int, degrees: float) -> nonlinear.State:
    from math import radians

    from nonlinear.orbits import mode_orbit

    if not 0 < abs(degrees) < 180:
        raise modal.SceneError(
            [f"--start orbit:{number}:{degrees:g}: the largest angle must be a number below 180 deg"]
        )
    orbit = mode_orbit(scene, number, radians(abs(degrees)))
    if degrees > 0:
        return orbit.state
    return nonlinear.State(2 * orbit.flow.system.rest - orbit.state.links, orbit.state.link_rates, -orbit.state.cart)


def _in_mode(scene: Scene, number: int, degrees: float, *, undamped: bool) -> State:
    from math import radians

    import numpy as np

    from nonlinear.reduction import copy_along, start_in_mode

    modes = nonlinear.integration.modes_of(scene)
    if not 1 <= number <= len(modes):
        raise modal.SceneError([f"--start mode:{number}: the scene has modes 1 to {len(modes)}"])
    if modes.omega[number - 1] == 0:
        raise modal.SceneError([f"--start mode:{number}: a rigid translation has no angle"])
    if not 0 < abs(degrees) <= 180:
        raise modal.SceneError(
            [f"--start mode:{number}:{degrees:g}: the largest angle must be a number of at most 180 deg"]
        )
    row = number - 1
    if undamped:
        rows = np.flatnonzero(modal.modes.table_numbers(scene) == number)
        if not rows.size:
            raise modal.SceneError([f"--start mode:{number}: is overdamped and does not oscillate"])
        scene, row = scene.conservative, int(rows[0])
        modes = nonlinear.integration.modes_of(scene)
    state = start_in_mode(scene, modes, row, copy_along(modes, row), radians(degrees))
    return state if scene.space == "plane" else nonlinear.system.of_plane(state)
