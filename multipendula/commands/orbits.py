"""The command orbits: nonlinear modes, limit cycles and motions under drives, followed with their stability."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import TYPE_CHECKING

import modal
import nonlinear
from multipendula.command import CREW, SCENE, Command, formats, misfits, once, report_file
from multipendula.commands.runs import start_of
from multipendula.commands.shared import bar, crew_of, draw_in, drawn, film_form, noted, remark, say, validated, warned

if TYPE_CHECKING:
    from modal.scene import Scene
    from modal.types import Crew
    from nonlinear.orbits import Branch, Special
    from nonlinear.system import State

SETTLING_PERIODS = 100
"""Limit: periods of the slowest mode after which a run is taken to have settled; `--duration` chooses others."""


def orbits(options: argparse.Namespace) -> tuple[Branch, ...]:
    """Follow periodic orbits: a mode to large angles, or limit cycles along a number, with their stability.

    With --mode, the periodic motions that begin in a mode of the table, without dampers and drives, are followed to
    large angles: the frequency against the amplitude (backbone), and at which angle the motion loses its stability.
    With --vary, the limit cycles of a scene with drives are followed along one number, through their folds (sync
    --vary finds sooner where they begin and end; sweep --loci follows small motion), or the motions of a scene
    under forces or on a moved support that repeat with the period of these; with both, the mode's orbit of one
    amplitude. Every orbit closes in the full equations, its stability is that of its Floquet multipliers, and
    folds, branch points, period doublings and tori are located. A branch is followed from orbit to orbit, by one
    process; the limit cycles from one end of a range, and the branches that --enter follows, are shared among the
    --workers.

    Examples
    --------
    orbits chain-2 --mode 1 --largest-angle 120 -o backbone.png
        the slow mode of two rods, to 120 degrees
    orbits paper-cart-2 --mode 3 --largest-angle 60 --format json
        every orbit with its multipliers
    orbits metronomes --vary support.mass=0.5:5:2log -o cycles.png
        two metronomes in phase and in antiphase, on beams of 0.5 to 5 kg
    orbits shaken-pendulum --vary support.motion.frequency_hz=0.40:0.55:2 -o resonance.png
        largest angle against frequency of a pendulum on a shaken support
    """
    from nonlinear.orbits import oscillating

    scene = warned(validated(options, options.output, _misfits(options)), "a periodic orbit")
    if not (options.mode or options.vary):
        options.mode = _first_mode(scene)
    with crew_of(options) as crew:
        branches = _mode(scene, options) if options.mode else _cycles(scene, options, crew)
        newest = branches
        for _ in range((options.depth or 1) if options.enter else 0):
            newest = tuple(_entered(newest, crew))
            branches = (*branches, *newest)
    modes, row = oscillating(scene, options.mode) if options.mode and not options.vary else (None, 0)
    say(_text(scene, branches, branches[0].linear if modes else None, options.format), options.format)
    mode = modes[row] if modes else None
    draw_in(options, options.output, "nonlinear.plotting", "orbits_figure", scene, branches, mode=mode)
    if options.film:
        from nonlinear.plotting import film_orbit

        form, orbit = film_form(options.film, "--film"), branches[0].orbits[-1]
        with drawn(options.film, options.theme) as stream, bar(10) as report:
            film_orbit(orbit, stream, form, modes=modes, row=row, report=report)
    return branches


def _first_mode(scene: Scene) -> int:
    """The number of the first mode that has periodic orbits."""
    from nonlinear.orbits import oscillating

    for number in range(1, len(modal.natural_modes(scene)) + 1):
        try:
            oscillating(scene, number)
        except modal.SceneError:
            continue
        remark(f"of mode {number}: --mode R follows another, --vary PLACE=VALUES orbits along a number")
        return number
    return 1


def _misfits(options: argparse.Namespace) -> Iterator[str]:
    if options.largest_angle and options.vary and not options.mode:
        yield "--largest-angle: needs --mode"
    if options.settled and (options.mode or not options.vary):
        yield "--settled: needs --vary and no --mode"
    if options.enter and options.mode and options.vary:
        yield "--enter: cannot be combined with both --mode and --vary"
    if options.depth and not options.enter:
        yield "--depth: needs --enter"
    if options.periods and (options.mode or not options.vary):
        yield "--periods: needs --vary and no --mode"
    if not options.settled:
        yield from misfits(options, "needs --settled", "--start", "--duration")
    if options.mode and not options.enter:
        why = "needs --enter, or --vary without --mode: a branch is followed by one"
        yield from misfits(options, why, "--workers", "--scheduler")


def _mode(scene: Scene, options: argparse.Namespace) -> tuple[Branch, ...]:
    from math import radians

    from nonlinear.orbits import mode_along, nonlinear_mode

    noted(scene, "a periodic orbit of a mode")
    largest = options.largest_angle or 90.0
    if options.vary:
        with bar(0, "orbits") as report:
            return (mode_along(scene, options.mode, options.vary, radians(largest), report=report),)
    with bar(largest, "deg") as report:
        return (nonlinear_mode(scene, options.mode, radians(largest), report=report),)


def _cycles(scene: Scene, options: argparse.Namespace, crew: Crew) -> tuple[Branch, ...]:
    from modal.scene.parameters import parse_variations
    from nonlinear.orbits import follow_cycles, follow_forced_orbits, require_cycles, require_forced_orbits

    (variation,) = parse_variations([options.vary])
    if scene.is_forced:
        periods = options.periods or 1
        require_forced_orbits(scene, variation)
        begun = _settled(scene, variation.path, variation.values[0], options)[0] if options.settled else None
        with bar(0, "branches") as report:
            return follow_forced_orbits(scene, variation, start=begun, periods=periods, report=report)
    if options.periods:
        raise modal.SceneError(['--periods: needs a [[force]], or a support of kind = "moved"'])
    require_cycles(scene, variation)
    start = _settled(scene, variation.path, variation.values[0], options) if options.settled else None
    with bar(0, "branches") as report:
        return follow_cycles(scene, variation, start=start, crew=crew, report=report)


def _settled(scene: Scene, path: str, value: float, options: argparse.Namespace) -> tuple[State, float]:
    """The last state of a run at the first value of the number, and the time between its last two swings.

    Under drives the run takes whole periods of these, and the time is theirs.
    """
    from math import ceil, pi

    from modal.scene.parameters import vary
    from nonlinear.orbits import last_swing

    here = vary(scene, {path: value})
    slowest = min(float(omega) for omega in nonlinear.integration.modes_of(here).omega if omega > 0)
    duration = options.duration or SETTLING_PERIODS * 2 * pi / slowest
    period = modal.scene.drive_period(here).seconds * (options.periods or 1) if here.is_forced else None
    if period:
        duration = ceil(duration / period) * period
    with bar(duration) as report:
        run = nonlinear.simulate(here, duration, start=start_of(here, options.start), report=report).uninterrupted()
    if period:
        return run.final, period
    return run.final, last_swing(run.times, run.motion)


def _entered(branches: tuple[Branch, ...], crew: Crew) -> Iterator[Branch]:
    from modal.types import map_by_crew
    from nonlinear.orbits import LEAVES

    left = [(branch, special) for branch in branches for special in branch.special if special.kind in LEAVES]
    with bar(len(left), "branch") as report:
        for done, entry in enumerate(map_by_crew(_entered_at, left, crew), 1):
            report(done)
            if isinstance(entry, modal.ComputationError):
                remark(entry)
            else:
                yield entry


def _entered_at(left: tuple[Branch, Special]) -> Branch | modal.ComputationError:
    from nonlinear.orbits import leaving_branch

    try:
        return leaving_branch(*left)
    except modal.ComputationError as error:
        return error


def _text(scene: Scene, branches: tuple[Branch, ...], linear: float | None, form: str) -> str:
    from modal.report import as_json
    from nonlinear.orbits import orbits_csv, orbits_record, orbits_text

    if form == "json":
        return as_json(orbits_record(branches))
    return orbits_csv(branches) if form == "csv" else orbits_text(scene, branches, linear)


COMMANDS = (
    Command(
        topic="motion",
        run=orbits,
        main=("--mode", "--largest-angle", "--vary", "--format", "--output"),
        takes=(
            SCENE,
            once("--mode, to follow without dampers and drives (default the first that swings)"),
            "--largest-angle, with --mode (default 90)",
            once(
                "--vary, such as support.mass=1:100:2log, along which orbits are followed: the limit cycles of a scene "
                "with drives at joints, the motions of the period of a moved support and of forces, or with --mode the "
                "orbit of one largest angle"
            ),
            "--enter at branch points and period doublings",
            "--depth, with --enter (default 1)",
            "--periods, under forces or on a moved support (default 1)",
            "--settled, with --vary, instead of at predicted oscillations",
            "--start, with --settled, as in simulate",
            f"--duration, with --settled (default {SETTLING_PERIODS} periods of the slowest mode)",
            formats("text", "csv", "json"),
            *report_file("text", "csv", "json"),
            "--film: the last orbit next to the linear mode",
            *CREW,
        ),
    ),
)
