"""The commands about motion at large angles: simulate, plot, animate."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from time import perf_counter
from typing import TYPE_CHECKING

import modal
import nonlinear
from multipendula.command import RUN, THEME, Command, formats, kwargs_of, main_file, refuse
from multipendula.commands.runs import RunOptions, motion, recorded, start_of
from multipendula.commands.shared import (
    bar,
    draw_in,
    drawn,
    estimate_of,
    film_form,
    in_a_folder,
    made,
    output,
    picture,
    remark,
    say,
)
from multipendula.options import FILMS, PICTURES, REPORTS, RUNS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from modal.identification import Estimate
    from modal.report import Form
    from nonlinear.ensembles import Compilation
    from nonlinear.integration import Trajectory, Tube

BAND_MEMBERS = 200
"""Format: members of a band from 5 to 95 %, so that ten lie beyond either edge."""
WRITTEN = (*RUNS, "mat")
"""The kinds of files of a motion, of which MATLAB's is not read back."""
COMPILED = ("txt", "json")
OF_TUBES = ("--proved", "--duration", "--start", "--samples", "--accuracy", "--format", "--output", "--quiet")
"""Options that --proved takes."""
OF_COMPILING = ("--compile", "--tolerance", "--format", "--output", "--quiet")
"""Options that --compile takes."""


def simulate(options: argparse.Namespace) -> Trajectory | Compilation | Tube:
    """Simulate the motion at large angles, with checks of its accuracy.

    The full equations at any angle, with checks of the run: the drift of energy, momentum and constraints. The
    initial condition is the scene's own, a mode at an amplitude, or angles at rest. A saved run is continued. With
    --accuracy, the cheapest method that meets it is found: modes in closed form for small motions, a few modes for
    long chains, otherwise integration; every attempt is listed, the last with evidence that its error is below
    that. With --proved every number has a radius within which the motion provably lies; a saved run contains the
    midpoints. numba (extra `fast`) and heyoka (extra `taylor`) are many times faster than Python once compiled,
    which takes seconds to a minute for each form of scene: commands compile where that pays off, --compile does so
    in advance. The scene's numbers may change afterwards, as long as none becomes or ceases to be zero; heyoka's
    code holds for one tolerance.

    Examples
    --------
    simulate paper-cart-3 --duration 20 -o run.npz
        from the scene's own start: level links at rest
    simulate chain-2 --start angles:60,0 --duration 10 --accuracy 1e-6
        every angle accurate to a microradian, and what was tried for it
    simulate chain-2 --proved --duration 2 --accuracy 1e-20
        at 11 times, with 20 proved digits
    simulate run.npz --duration 10 -o more.npz
        continue the saved run
    simulate chain-2 --compile
        before many runs of double pendulums
    """
    if options.compile:
        return _compile(options)
    if options.scene is None:
        options.page.error("SCENE: is required")
    if options.proved:
        return _enclose(options)
    from modal.report import visible
    from nonlinear.postprocessing import summary

    band = _banded(options)
    begun = perf_counter()
    try:
        trajectory = _trajectory(options)
    except nonlinear.SimulationError as error:
        if options.output:
            place = _place_of_part(options.output)
            nonlinear.files.save(error.trajectory, place)
            remark(f"the computed part is saved in {visible(place)}")
        raise
    spent = perf_counter() - begun
    output = _place_of_part(options.output) if options.output and trajectory.run.interrupted else options.output
    if output:
        nonlinear.files.save(trajectory, output)
    target = "standard output" if output == modal.scene.STANDARD else output
    if options.format == "text":
        say(f"{summary.text(trajectory, ropes=not options.quiet)}\n")
        say(f"computed in {spent:.3g} s" + (f", saved in {visible(target)}\n" if output else "\n"))
    if band is not None and not trajectory.run.interrupted:
        _print_band(options, band)
    if options.explain:
        from nonlinear.postprocessing import run_inventory

        sys.stderr.write(run_inventory(trajectory).text())
    return trajectory.uninterrupted()


def _trajectory(options: argparse.Namespace) -> Trajectory:
    """The run; of a scene with --accuracy, the attempts to meet it are printed first."""
    told = RunOptions.of(options)

    def named() -> None:
        if options.output:
            modal.scene.kind_of(options.output, WRITTEN, "-o ")

    if options.accuracy is None or options.keep_modes or recorded(options.scene):
        refuse(options, "needs --accuracy RAD of a scene, --proved or --compile", "--format")
        return told.run(named)
    refuse(options, "cannot be combined with --accuracy", "--tolerance")
    from nonlinear.accuracy import advice_table

    advice = told.advice(named)
    say(advice_table(advice, options.format) + "\n" * (options.format == "text"), options.format)
    return nonlinear.simulation.certain(advice)


def _place_of_part(output: str) -> str:
    """Where a run that did not reach its end is saved: next to a file that is there, which may be a whole one."""
    from pathlib import Path

    path = Path(output)
    return str(path.with_stem(f"{path.stem}.part")) if path.is_file() else output


def _banded(options: argparse.Namespace) -> Estimate | None:
    """The covariance of the scene's numbers, once the name of a picture of the band is right."""
    if options.covariance is None:
        if options.band:
            raise modal.SceneError(["--band: needs --covariance FIT.json"])
        return None
    if recorded(options.scene):
        raise modal.SceneError([f"--covariance: needs the scene that was fitted, and {options.scene} is a saved run"])
    if options.keep_modes:
        raise modal.SceneError(["--covariance: cannot be combined with --keep-modes"])
    estimate = estimate_of(modal.load(options.scene), options.covariance)
    in_a_folder(options.band)
    picture(options.band, "--band")
    return estimate


def _print_band(options: argparse.Namespace, estimate: Estimate) -> None:
    """How wide the motion is where the numbers vary by their covariance."""
    from nonlinear.sweeps import find_spread, motion_words

    scene, duration = estimate.scene, options.duration or options.usual
    start = start_of(scene, options.start, told=True)
    with bar(BAND_MEMBERS, "member") as report:
        members = find_spread(
            scene, (), duration, members=BAND_MEMBERS, covariance=estimate, start=start, report=report, check=0
        )
    say(f"band of {members.size} members with {members.words}, from 5 to 95 %:\n{motion_words(members)}\n")
    if members.failures:
        say(f"{len(members.failures)} members failed: {next(iter(members.failures.values()))}\n")
    draw_in(options, options.band, "nonlinear.plotting", "spread_figure", members)


def plot(options: argparse.Namespace) -> Figure | None:
    """Draw a run: angles, cart, energies, phase portrait, and spectrum with the linear frequencies.

    The run is a saved one, or of a scene that is simulated first: without --duration for as long as the spectrum
    takes to separate its modes, 100 s at most. Dotted lines in the spectrum are the frequencies of the table of
    modes. Links that move alike share a curve; of many, some are drawn with the range of all.

    Examples
    --------
    simulate paper-cart-3 --duration 10 -o run.npz
        a run to draw
    plot run.npz -o run.png
        angles, cart, energies, phase portrait, spectrum
    plot chain-2 --start mode:1:30 --duration 10 -o mode.svg
        simulate and plot at once
    """
    run = replace(RunOptions.of(options), resolves_modes=True)
    trajectory = run.shown(lambda: picture(options.output))
    if options.output is None:
        return trajectory.plot(theme=options.theme)
    draw_in(options, options.output, "nonlinear.plotting", "run_figure", trajectory)
    links, seconds = trajectory.scene.n_links, trajectory.times[-1] - trajectory.times[0]
    made(options.output, f"{seconds:.4g} s of motion of {links} link{'s' * (links > 1)}")
    return None


def animate(options: argparse.Namespace) -> None:
    """Make a film of a run: the pendula, their trails and their energies.

    The run is a saved one, or of a scene that is simulated first. A GIF plays everywhere, MP4 needs the extra
    `video`, HTML is a page with controls.

    Examples
    --------
    simulate chain-2 --start angles:90,90 --duration 4 -o run.npz
        a run to film
    animate run.npz --seconds 2 -o run.gif
        the first two seconds of film
    animate run.npz --speed 4 --fps 15 -o fast.html
        all of it at four times real speed, with controls
    """
    from nonlinear.plotting import animate as film

    trajectory = RunOptions.of(options).shown(lambda: film_form(options.output))
    form = film_form(options.output)
    with drawn(options.output, options.theme) as stream, bar(options.seconds or 20.0) as report:
        how = kwargs_of(options, "--fps", "--speed", "--seconds")
        shown = film(trajectory, stream, form, report=report, **how)
    made(options.output, f"{shown.frames} frames, {shown.seconds:.3g} s of film for {shown.motion:.3g} s of motion")
    if shown.left_out > 0:
        remark(f"{shown.left_out:.3g} s of the run omitted; use --seconds or --speed")


def _take_only(options: argparse.Namespace, flag: str, *names: str) -> None:
    """Raise SceneError for options that do not go with this one."""
    others = (option.name for option in options.command.options if option.name.startswith("--"))
    refuse(options, f"cannot be combined with {flag}", *(name for name in others if name not in names))


def _form_of_report(options: argparse.Namespace, kinds: Sequence[str]) -> Form:
    """The format of a report, by the name of its file unless one is requested; SceneError for other kinds of files."""
    form: Form = options.format
    if not options.output or options.output == modal.scene.STANDARD:
        return form
    kind = modal.scene.kind_of(options.output, kinds, "-o ")
    return "json" if kind == "json" and not getattr(options, "format_asked", False) else form


def _enclose(options: argparse.Namespace) -> Tube:
    """A tube that provably contains the motion; a file of a run has its midpoints."""
    _take_only(options, "--proved", *OF_TUBES)
    if recorded(options.scene):
        raise modal.SceneError([f"--proved: needs a scene, and {options.scene} is a saved run"])
    form = _form_of_report(options, (*WRITTEN, *COMPILED))
    in_a_folder(options.output)
    scene, duration = modal.load(options.scene), options.duration or 10.0
    start, how = start_of(scene, options.start), kwargs_of(options, "--samples")
    with bar(duration) as report:
        tube = nonlinear.integration.enclose_motion(
            scene, duration, radius=options.accuracy or 1e-10, start=start, report=report, **how
        )
    is_run = options.output is not None and options.output.lower().endswith(tuple(f".{kind}" for kind in WRITTEN))
    if is_run:
        nonlinear.files.save(tube.trajectory, options.output)
    with output(None if is_run else options.output) as write:
        write(tube.report(form))
    return tube


def _compile(options: argparse.Namespace) -> Compilation:
    """Compile what the fast integrators need for a scene, or for any, and keep it for later commands."""
    _take_only(options, "--compile", *OF_COMPILING)
    form = _form_of_report(options, COMPILED)
    compiled = nonlinear.compile_engines(
        modal.load(options.scene) if options.scene else None, **kwargs_of(options, "--tolerance")
    )
    with output(options.output) as write:
        write(nonlinear.ensembles.compilation_table(compiled, form))
    return compiled


COMMANDS = (
    Command(
        topic="motion",
        run=simulate,
        main=("--duration", "--start", "--accuracy", "--samples", "--output"),
        takes=(
            RUN._replace(how={"nargs": "?"}),
            *motion(60.0)[1:],
            "--proved, over 10 s by default, with a radius of at most --accuracy (default 1e-10) at 11 --samples",
            "--compile, for one scene or, without one, for all; nothing is simulated",
            formats(*REPORTS, more=" (default text), by --accuracy or --proved, and by --compile as text or json"),
            "--covariance: adds the band of the motion over the fitted numbers",
            "--band",
            THEME,
            main_file("the motion; of --compile the report", (*WRITTEN, *COMPILED)),
            "--explain",
        ),
    ),
    Command(
        topic="motion",
        run=plot,
        main=("--output", "--duration", "--start"),
        takes=(*motion(20.0), main_file("the figure", PICTURES, "-plot.png"), THEME),
    ),
    Command(
        topic="motion",
        run=animate,
        main=("--output", "--duration", "--speed", "--seconds", "--start"),
        takes=(
            *motion(10.0),
            main_file("the film", FILMS, "-film.gif"),
            "--fps",
            "--speed (default 1)",
            "--seconds (default 20)",
            THEME,
        ),
    ),
)
