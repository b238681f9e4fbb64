"""What the commands about motion share: which run is meant, where it starts, how its progress is shown."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from modal.scene import Scene
    from nonlinear.state import State
    from nonlinear.trajectory import Trajectory

RECORDINGS = (".npz", ".csv")


def run_of(options: argparse.Namespace) -> Trajectory:
    """A new run of a scene, or the continuation of a saved one."""
    from modal.errors import SceneError
    from modal.files import load
    from nonlinear import recordings
    from nonlinear.simulation import resumed
    from nonlinear.simulation import simulate as run

    settings = {name: getattr(options, name) for name in ("method", "form", "tolerance")}
    settings["output"] = options.samples
    if options.scene.endswith(RECORDINGS):
        if options.start:
            raise SceneError(["--start: a saved run goes on from its last state"])
        with bar(options.duration) as report:
            return resumed(recordings.load(options.scene), options.duration, report=report, **settings)
    scene = load(options.scene)
    start = start_of(scene, options.start)
    with bar(options.duration) as report:
        return run(scene, options.duration, start=start, report=report, **settings)


def start_of(scene: Scene, words: str | None) -> State | None:
    """None for the file's own start, mode:R:DEG for a mode's shape, angles:A,B,... for angles at rest."""
    from modal.errors import SceneError
    from nonlinear import starts

    if words is None or words == "scene":
        return None
    kind, _, rest = words.partition(":")
    try:
        numbers = [float(word) for word in rest.replace(":", ",").split(",")]
    except ValueError:
        numbers = []
    if kind == "angles" and numbers:
        return starts.released(scene, numbers)
    if kind == "mode" and len(numbers) == 2 and numbers[0] == int(numbers[0]):
        return _in_mode(scene, int(numbers[0]), numbers[1])
    raise SceneError([f"--start {words}: must be scene, mode:R:DEG such as mode:2:10, or angles:A,B,... in degrees"])


def _in_mode(scene: Scene, number: int, degrees: float) -> State:
    from math import radians

    from modal.errors import SceneError
    from modal.modes import natural_modes
    from nonlinear.directions import of_plane
    from nonlinear.modal_coordinates import start_in_mode

    modes = natural_modes(scene)
    if not 1 <= number <= len(modes):
        raise SceneError([f"--start mode:{number}: the scene has modes 1 to {len(modes)}"])
    if modes.omega[number - 1] == 0:
        raise SceneError([f"--start mode:{number}: a rigid translation has no angle"])
    if not 0 < abs(degrees) <= 180:
        raise SceneError([f"--start mode:{number}:{degrees:g}: the largest angle must be a number of at most 180 deg"])
    state = start_in_mode(scene, modes, number - 1, 0, radians(degrees))
    return state if scene.space == "plane" else of_plane(state)


@contextmanager
def bar(total: float, unit: str = "s") -> Iterator[Callable[[float], object]]:
    """A progress bar, by default in seconds of pendulum time, on a terminal and for what takes a while."""
    if not sys.stderr.isatty():
        yield lambda elapsed: None
        return
    from tqdm import tqdm

    with tqdm(total=total, unit=unit, unit_scale=True, delay=1.0, leave=False) as shown:
        yield lambda elapsed: shown.update(elapsed - shown.n)


def shown_of(options: argparse.Namespace) -> Trajectory:
    """A saved run as it is, or a new one of a scene."""
    from nonlinear import recordings

    if options.scene.endswith(RECORDINGS):
        return recordings.load(options.scene)
    return run_of(options)
