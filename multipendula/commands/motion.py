"""The commands about motion at large angles: simulate, plot, animate."""

from __future__ import annotations

import argparse
import sys
from time import perf_counter

from multipendula.commands.modes import bar, drawn, picture
from multipendula.commands.runs import in_few_modes, run_of, shown_of, whole

FILMS = ("gif", "mp4", "html")


def simulate(options: argparse.Namespace) -> None:
    """Simulate the motion at large angles, with its certificates."""
    from modal.report import visible
    from modal.scene import STANDARD
    from nonlinear import files as recordings
    from nonlinear.files import checked_kind
    from nonlinear.integration import SimulationError
    from nonlinear.postprocessing import summary

    begun, run = perf_counter(), in_few_modes if options.keep_modes else run_of
    try:
        trajectory = run(options, lambda: options.output and checked_kind(options.output))
    except SimulationError as error:
        if options.output:
            recordings.save(error.trajectory, options.output)
        raise
    spent = perf_counter() - begun
    if options.output:
        recordings.save(trajectory, options.output)
    target = "standard output" if options.output == STANDARD else options.output
    print(summary.text(trajectory))
    print(f"computed in {spent:.3g} s" + (f", kept in {visible(target)}" if options.output else ""))
    if options.explain:
        from nonlinear.postprocessing import run_inventory

        sys.stderr.write(run_inventory(trajectory).text())
    whole(trajectory)


def plot(options: argparse.Namespace) -> None:
    """Draw a run: angles, cart, energies, phase portrait, and spectrum with the linear frequencies."""
    from nonlinear.plotting import draw_run

    trajectory = shown_of(options, lambda: picture(options.output))
    with drawn(options.output, options.theme) as stream:
        draw_run(trajectory, stream, kind=picture(options.output))


def animate(options: argparse.Namespace) -> None:
    """Make a film of a run: the pendula, their trails and their energies."""
    from nonlinear.plotting import animate as film

    trajectory, form = shown_of(options, lambda: film_form(options.output)), film_form(options.output)
    with drawn(options.output, options.theme) as stream, bar(options.seconds or 20.0) as report:
        shown = film(
            trajectory, stream, form, fps=options.fps, speed=options.speed, seconds=options.seconds, report=report
        )
    print(f"{shown.frames} frames, {shown.seconds:.3g} s of film for {shown.motion:.3g} s of motion")
    if shown.left_out > 0:
        print(f"multipendula: {shown.left_out:.3g} s of the run left out; --seconds or --speed", file=sys.stderr)


def film_form(name: str, option: str = "-o") -> str:
    """The kind of film that a file name asks for."""
    from modal.scene import kind_of

    return kind_of(name, FILMS, f"{option} ")
