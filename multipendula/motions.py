"""The commands about motion at large angles: simulate, plot, animate, check, chaos."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import perf_counter
from typing import IO, TYPE_CHECKING, Any

from multipendula.commands import chosen, picture

if TYPE_CHECKING:
    from modal.scene import Scene
    from nonlinear.state import State
    from nonlinear.trajectory import Trajectory

RECORDINGS = (".npz", ".csv")
FILMS = ("gif", "mp4", "html")


def simulate(options: argparse.Namespace) -> None:
    """Simulate the motion at large angles, with its certificates."""
    from nonlinear import recordings, summary
    from nonlinear.simulation import SimulationError

    if options.output:
        recordings.checked_kind(options.output)
    begun = perf_counter()
    try:
        trajectory = _run(options)
    except SimulationError as error:
        if options.output:
            recordings.save(error.trajectory, options.output)
        raise
    spent = perf_counter() - begun
    if options.output:
        recordings.save(trajectory, options.output)
    print(summary.text(trajectory))
    print(f"computed in {spent:.3g} s" + (f", kept in {options.output}" if options.output else ""))
    if "interrupted" in trajectory.run.stopped:
        raise KeyboardInterrupt


def plot(options: argparse.Namespace) -> None:
    """Draw a run: angles, cart, energies, phase portrait, and spectrum with the linear frequencies."""
    from modal.files import whole_file
    from nonlinear.figures import draw_run

    kind, trajectory = picture(options.output), _shown(options)
    with whole_file(options.output) as stream:
        draw_run(trajectory, stream, kind=kind)


def animate(options: argparse.Namespace) -> None:
    """Make a film of a run: the pendula, their trails and their energies."""
    from modal.files import whole_file
    from nonlinear.animation import animate as film

    form, trajectory = film_form(options.output), _shown(options)
    with whole_file(options.output) as stream, _bar(options.seconds or 20.0) as report:
        shown = film(
            trajectory, stream, form, fps=options.fps, speed=options.speed, seconds=options.seconds, report=report
        )
    print(f"{shown.frames} frames, {shown.seconds:.3g} s of film for {shown.motion:.3g} s of motion")
    if shown.left_out > 0:
        print(f"multipendula: {shown.left_out:.3g} s of the run left out; --seconds or --speed", file=sys.stderr)


def film_form(name: str) -> str:
    """The kind of film that a file name asks for."""
    from modal.errors import SceneError

    form = os.path.splitext(name)[1].removeprefix(".").lower()
    if form not in FILMS:
        raise SceneError([f"-o {name}: the name must end in .gif, .mp4 or .html"])
    return form


def check(options: argparse.Namespace) -> None:
    """Measure how far the table of modes holds: frequencies at several amplitudes beside its own."""
    from modal.files import load, whole_file

    kind = picture(options.output) if options.output else ""
    scene = load(options.scene)
    found, table, draw = _general(options, scene) if options.general else _mode_by_mode(options, scene)
    if options.output:
        with whole_file(options.output) as stream:
            draw(found, stream, kind)
    sys.stdout.write(table(found, options.format))


def _mode_by_mode(options: argparse.Namespace, scene: Scene) -> tuple[Any, Any, Any]:
    from modal.modes import natural_modes
    from nonlinear.check import AMPLITUDES_DEG
    from nonlinear.check import check as checked
    from nonlinear.check_tables import check_table

    numbers = chosen(options.mode, len(natural_modes(scene)), "--mode")
    with _bar(len(numbers), "mode") as report:
        found = checked(scene, list(numbers), options.amplitude or AMPLITUDES_DEG, report=report)
    from nonlinear.check_figures import draw_check

    return found, check_table, draw_check


def _general(options: argparse.Namespace, scene: Scene) -> tuple[Any, Any, Any]:
    from nonlinear.compare import compare
    from nonlinear.compare_tables import comparison_table
    from nonlinear.simulation import simulate as run

    with _bar(options.duration) as report:
        trajectory = run(scene, options.duration, start=_start(scene, options.start), report=report)
    from nonlinear.check_figures import draw_spectrum

    return compare(trajectory), comparison_table, draw_spectrum


def chaos(options: argparse.Namespace) -> None:
    """Measure the largest Lyapunov exponent, or what paper 000 or 001 claims of it."""
    kind = picture(options.output) if options.output else ""
    text, draw = _claims(options) if options.scene.startswith("paper:") else _exponent(options)
    if options.output:
        from modal.files import whole_file

        with whole_file(options.output) as stream:
            draw(stream, kind)
    print(text)


Drawn = tuple[str, Callable[[IO[bytes], str], None]]


def _exponent(options: argparse.Namespace) -> Drawn:
    from modal.errors import SceneError
    from modal.files import load
    from nonlinear.lyapunov import TRANSIENT, lyapunov_exponent, usual_duration

    if options.quick:
        raise SceneError(["--quick: is for paper:000 and paper:001"])
    scene = load(options.scene)
    duration = options.duration or usual_duration(scene)
    with _bar((1 + TRANSIENT) * duration) as report:
        found = lyapunov_exponent(scene, duration, ensemble=options.ensemble or 16, report=report)

    def draw(stream: IO[bytes], kind: str) -> None:
        from nonlinear.chaos_figures import draw_running

        draw_running(found, stream, kind=kind)

    return found.text(), draw


def _claims(options: argparse.Namespace) -> Drawn:
    from modal.errors import SceneError
    from nonlinear.chaos_claims import study, text
    from nonlinear.chaos_studies import measure

    if options.duration or options.ensemble:
        raise SceneError([f"{options.scene}: has its own --duration and --ensemble; --quick makes it short"])
    chosen = study(options.scene.removeprefix("paper:"), quick=options.quick)
    with _bar(len(chosen.cases), "scene") as report:
        finding = measure(chosen, report)

    def draw(stream: IO[bytes], kind: str) -> None:
        from nonlinear.chaos_figures import draw_finding

        draw_finding(finding, stream, kind=kind)

    return text(finding), draw


def _run(options: argparse.Namespace) -> Trajectory:
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
        with _bar(options.duration) as report:
            return resumed(recordings.load(options.scene), options.duration, report=report, **settings)
    scene = load(options.scene)
    start = _start(scene, options.start)
    with _bar(options.duration) as report:
        return run(scene, options.duration, start=start, report=report, **settings)


def _start(scene: Scene, words: str | None) -> State | None:
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
def _bar(total: float, unit: str = "s") -> Iterator[Callable[[float], object]]:
    """A progress bar, by default in seconds of pendulum time, on a terminal and for what takes a while."""
    if not sys.stderr.isatty():
        yield lambda elapsed: None
        return
    from tqdm import tqdm

    with tqdm(total=total, unit=unit, unit_scale=True, delay=1.0, leave=False) as bar:
        yield lambda elapsed: bar.update(elapsed - bar.n)


def _shown(options: argparse.Namespace) -> Trajectory:
    """A saved run as it is, or a new one of a scene."""
    from nonlinear import recordings

    if options.scene.endswith(RECORDINGS):
        return recordings.load(options.scene)
    return _run(options)
