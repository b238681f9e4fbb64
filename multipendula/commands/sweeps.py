"""The command sweep: maps over parameters, and frequency loci over one."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import modal
import nonlinear
from multipendula.command import CREW, SCENE, Command, kwargs_of, main_file, misfits, option, picture_file, refuse
from multipendula.commands.ensembles import measured, names_of, refuse_homeless, strobed, tell_of_share
from multipendula.commands.runs import tell_of_start
from multipendula.commands.shared import bar, crew_of, draw_in, missing, output, picture_in_place, say
from multipendula.options import PICTURES, RUNS, integer

if TYPE_CHECKING:
    from modal.loci import Loci
    from nonlinear.ensembles import BifurcationDiagram
    from nonlinear.sweeps import Checkpoint, Study, Sweep


BY_STROBES = ("--phase-deg", "--settle", "--of")
BY_ENERGY, DRAWN = "start.energy", ("--members", "--seed")
"""Quantities varied with random starts, and their options."""
ENDINGS = (*RUNS, "json", *PICTURES)
"""Of the numbers, and of the figure in their place."""


def sweep(options: argparse.Namespace) -> Sweep | Loci | BifurcationDiagram | None:
    """Compute measures of a scene over a parameter grid, or follow its frequencies or strobes along one parameter.

    One to three numbers of a scene, named by their place in the file, are set to every combination of values, on
    all cores. Finished points are saved next to --output or in --folder; after Ctrl-C the same command resumes.
    With --loci the frequencies are followed by their mode shapes along one number, and crossings are distinguished
    from veerings (orbits --vary follows motions at large angles, sync --vary the steady oscillations of a scene
    with drives). With --strobe the motion at every value is sampled 50 times after a transient, once per period of
    the drives: one point is a motion of that period, two or four mean that the period has doubled, many mean chaos.
    With start.energy, --members starts are drawn at random at each energy, and quantiles of every measure are
    reported. With --measure floquet over the amplitude and the frequency of a vertical sine, the boundaries of
    growth are traced and drawn.

    Examples
    --------
    sweep paper-cart-2 --vary support.mass=1:1000:20log --measure beat -o beat.csv
        the beat for 20 masses of the cart
    sweep crane-two-loads --vary 'pendulum[0].links[0].length=6:14:20' --loci --picture loci.png
        frequencies that veer where two lengths are nearly equal
    sweep driven-pendulum --vary 'force[0].amplitude=1.06:1.09:60' --strobe --picture cascade.png
        period doublings of a driven pendulum
    sweep kapitza --vary support.motion.amplitude=0.005:0.03:26 --vary support.motion.frequency_hz=10:40:31
    --measure floquet -o held.png
        where an inverted pendulum is held up, with the boundaries of growth
    sweep chain-2 --vary start.energy=1:20:8 --members 10 --measure lyapunov:20 --picture chaos.png
        how many of ten starts at each energy are chaotic, and how strongly
    """
    if not options.vary:
        raise missing(modal.load(options.scene), "--vary", "={half}:{double}:9")
    picture_in_place(options)
    refuse_homeless(options)
    if not options.strobe:
        refuse(options, "needs --strobe", *BY_STROBES)
    if not any(text.partition("=")[0].strip() == BY_ENERGY for text in options.vary):
        refuse(options, f"needs --vary {BY_ENERGY}=VALUES", *DRAWN)
    return (_loci if options.loci else _strobes if options.strobe else _map)(options)


def _map(options: argparse.Namespace) -> Sweep | None:
    from modal.report import visible
    from modal.scene.parameters import parse_variations
    from nonlinear.sweeps import LYAPUNOV, MEMBERS, Study, parse_measures, reasons, save, sweep_text
    from nonlinear.sweeps import sweep as swept

    by_energy = any(text.partition("=")[0].strip() == BY_ENERGY for text in options.vary)
    _, scene, axes, measures = nonlinear.integration.validate(
        lambda: modal.scene.kind_of(options.output, ENDINGS, "-o ") if options.output else "",
        lambda: modal.load(options.scene),
        lambda: parse_variations(options.vary),
        lambda: parse_measures(options.measure or [LYAPUNOV if by_energy else "frequencies"]),
    )
    drawn_starts = (options.members or MEMBERS, options.seed or 0) if by_energy else ()
    study = Study(scene, axes, measures, *drawn_starts)
    if options.picture:
        from nonlinear.plotting import validate_axes

        validate_axes(axes)
    if not by_energy and any(request.runs for request in measures) and not nonlinear.system.has_start(scene):
        tell_of_start("every point begins in the shape of its first mode that swings")
    if options.folder and options.fresh:
        raise modal.SceneError(["--fresh: cannot be combined with --folder: remove the folder"])
    with _journal(options, study) as kept:
        with crew_of(options) as crew, bar(study.size, "point") as report:
            who = {"workers": options.workers, "crew": crew.crew, "share": options.share}
            outcome = swept(study, journal=kept, report=report, **who)
        if not outcome.interrupted and tell_of_share(options):
            return None
        if len(outcome.failures) == study.size:
            kept.finish()
            raise modal.ComputationError("\n".join(["every point of the sweep failed", *reasons(outcome)]))
        say(sweep_text(outcome))
        if outcome.interrupted:
            if _has_journal(options):
                where = options.folder or f"{options.output}.journal"
                print(f"repeat the command to resume from {visible(where)}", file=sys.stderr)
            raise KeyboardInterrupt
        if options.output:
            save(outcome, options.output)
            kept.finish()
    draw_in(options, options.picture, "nonlinear.plotting", "sweep_figure", outcome)
    return outcome


def _has_journal(options: argparse.Namespace) -> bool:
    """Whether finished points are saved, in a folder or next to the output file; not with standard output."""
    return bool(options.folder or options.output) and (options.folder or options.output) != modal.scene.STANDARD


@contextmanager
def _journal(options: argparse.Namespace, study: Study) -> Iterator[Checkpoint]:
    from nonlinear.sweeps import Checkpoint, RowFolder, open_checkpoint

    if options.folder or not _has_journal(options):
        yield RowFolder(options.folder, study) if options.folder else Checkpoint()
        return
    with open_checkpoint(f"{options.output}.journal", study, fresh=options.fresh) as kept:
        yield kept


def _loci(options: argparse.Namespace) -> Loci:
    from modal.loci import follow_loci, loci_csv, loci_text
    from modal.scene.parameters import parse_variations

    unwanted = ("--measure", "--strobe", "--workers", "--scheduler", "--fresh", "--members", "--folder", "--share")
    problems = misfits(options, "cannot be combined with --loci", *unwanted)
    if len(options.vary) != 1:
        problems.append("--loci: needs exactly one --vary")
    if options.output and options.output != modal.scene.STANDARD and not options.output.lower().endswith(".csv"):
        problems.append(f"-o {options.output}: loci are saved as a .csv file")
    if problems:
        raise modal.SceneError(problems)
    scene, (variation,) = modal.load(options.scene), parse_variations(options.vary)
    with bar(len(variation.values), "value") as report:
        loci = follow_loci(scene, variation, report)
    say(loci_text(loci))
    if options.output:
        with output(options.output) as write:
            write(loci_csv(loci))
    draw_in(options, options.picture, "modal.plotting", "loci_figure", loci)
    return loci


def _strobes(options: argparse.Namespace) -> BifurcationDiagram | None:
    from modal.scene.parameters import parse_variations

    problems = misfits(options, "cannot be combined with --strobe", "--measure", "--fresh")
    if len(options.vary) != 1:
        problems.append("--strobe: needs exactly one --vary")
    if problems:
        raise modal.SceneError(problems)
    form = modal.scene.kind_of(options.output, ("csv", "json"), "-o ") if options.output else ""
    scene, (variation,) = modal.load(options.scene), parse_variations(options.vary)
    if not nonlinear.system.has_start(scene):
        tell_of_start("every value begins in the shape of its first mode that swings")
    more = kwargs_of(options, "--phase-deg", "--settle", "--workers", "--folder", "--share")
    with crew_of(options) as crew, bar(len(variation.values), "value") as report:
        strobes = nonlinear.ensembles.find_bifurcations(
            scene, variation, crew=crew.crew, report=report, of=names_of(options), **more
        )
    if tell_of_share(options):
        return None
    if options.output != modal.scene.STANDARD:
        say(strobes.report())
    if form:
        with output(options.output) as write:
            write(strobes.report("csv" if form == "csv" else "json"))
    draw_in(options, options.picture, "nonlinear.plotting", "bifurcation_figure", strobes)
    return strobes


COMMANDS = (
    Command(
        topic="coupling and synchronization",
        run=sweep,
        main=("--vary", "--measure", "--loci", "--strobe", "--output"),
        takes=(
            SCENE,
            option(
                "--vary: support.mass=1:1000:50log, gravity=1:10:5 or pendulum[*].links[0].length=0.9,1,1.1; one to "
                "three of them; start.energy=1:20:40 (J above rest) draws --members starts at every energy"
            ),
            measured("sweep", "frequencies, over energies lyapunov); repeat for several", keyword="measures"),
            option("--members: starts drawn at every start.energy (default 50)", type=integer(100_000)),
            "--seed (default 0)",
            "--loci",
            "--strobe, along one --vary: a bifurcation diagram of the last 50 (-o: .csv, .json)",
            *strobed("ten times the slowest decay, at least 200 periods"),
            main_file("the numbers (of --loci .csv) or the figure", ENDINGS),
            *picture_file(),
            *CREW,
            "--share",
            "--folder",
            "--fresh",
        ),
    ),
)
