"""The command sync: which pendula synchronize, predicted and simulated, and where that changes along a parameter."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import nonlinear
from multipendula.command import CREW, SCENE, Command, formats, misfits, option, report_file
from multipendula.commands.runs import start_of
from multipendula.commands.shared import (
    HOUR,
    bar,
    crew_of,
    drawn,
    film_form,
    forewarning,
    remark,
    show,
    stages,
    validated,
)
from multipendula.options import integer

if TYPE_CHECKING:
    from modal.scene import Scene
    from modal.scene.parameters import Variation
    from nonlinear.ensembles import RhythmGrid, RhythmMap
    from nonlinear.synchronization import Branches, PopulationDiagram, SynchronizationStudy


MORE = "--words describes prediction and simulation in sentences."


def sync(options: argparse.Namespace) -> SynchronizationStudy | Branches | PopulationDiagram | RhythmMap | RhythmGrid:
    """Predict which mode survives in a scene with drives, simulate it, and measure which pendula synchronize.

    For scenes with drives (van der Pol torques or escapements). Averaged equations predict the steady oscillations,
    and which of them this start ends in and when; a simulation of the full equations then measures the same. The
    verdict comes first: which mode wins, and from when on. With --vary every steady oscillation is followed along
    one number of the scene instead, by averaged equations, with the stability of the periodic orbit of the full
    equations next to it (orbits --vary follows limit cycles of the full equations, sweep --loci the frequencies of
    small motion). For equal pendula on the supports of a structure it says which population is
    locked, and to which; then follow the growth rates of the motions in which every population is one pendulum, and
    with --vary the values at which these become or cease to be stable. With --vary the oscillations found at one
    value, and their critical values, are shared among the --workers; each is followed from value to value by one.
    With --map the same starts run at every value until their returns to a section show which motion they reach: the
    share of each rhythm with its 95 % interval, its orbit, and where it appears, disappears or changes its
    stability in the full equations.

    Examples
    --------
    sync metronomes -o sync.png --film sync.gif
        two metronomes on a light base, with a figure and a film
    sync huygens --vary support.mass=3:30:3log -o branches.png
        the range of each steady oscillation
    sync metronomes --vary support.mass=0.1:0.2:2 --map --members 2 -o map.png
        the rhythms of two metronomes on bases of 0.1 and 0.2 kg
    sync two-swings --duration 60
        two swings with 15 metronomes each, of which one half synchronizes
    """
    scene = validated(options, options.output, _misfits(options))
    return (_map if options.map else _branches if options.vary else _run)(scene, options)


def _misfits(options: argparse.Namespace) -> Iterator[str]:
    form = getattr(options, "format_words", f"--format {options.format}")
    if options.map:
        yield from misfits(options, "cannot be combined with --map", "--start", "--film", "--words")
        if not options.vary:
            yield "--map: needs --vary"
        elif len(options.vary) > 2:
            yield "--vary: a map goes along one number or two"
        return
    yield from misfits(options, "needs --map", "--members", "--spread", "--seed", "--folder")
    if options.vary:
        if len(options.vary) > 1:
            yield "--vary: two numbers need --map"
        yield from misfits(options, "cannot be combined with --vary", "--duration", "--start", "--film", "--words")
        return
    yield from misfits(options, "needs --vary", "--workers", "--scheduler")
    if options.format == "csv":
        yield f"{form}: needs --vary"


def _run(scene: Scene, options: argparse.Namespace) -> SynchronizationStudy:
    from modal.report import as_json
    from nonlinear.synchronization import study_synchronization, sync_record, sync_text

    start = start_of(scene, options.start, undamped=True)
    with stages("predicting", "simulating") as (predicting, simulating):
        lengths: dict[float, Callable[[float], object]] = {}

        def report(now: float, end: float) -> None:
            lengths.setdefault(end, forewarning(simulating, scene, end, least=HOUR / 60))(now / end)

        study = study_synchronization(scene, options.duration, start=start, predicting=predicting, report=report)
    if options.format == "json":
        text = as_json(sync_record(study))
    else:
        text = sync_text(study, words=options.words, elsewhere="" if options.words else MORE)
    show(options, text, "sync_figure", study.trajectory, study.phases)
    if options.film:
        _film(study, options.film, options.theme)
    return study


def _film(study: SynchronizationStudy, name: str, theme: str) -> None:
    from nonlinear.plotting import SECONDS, animate, strobe

    form = film_form(name)
    with drawn(name, theme) as stream, bar(SECONDS) as report:
        shown = animate(study.trajectory, stream, form, **strobe(study.phases, form), report=report)
    remark(f"{shown.frames} frames, one every {shown.motion / shown.frames:.4g} s")


def _branches(scene: Scene, options: argparse.Namespace) -> Branches | PopulationDiagram:
    from modal.scene.parameters import parse_variations
    from nonlinear.synchronization import branches_csv, branches_text, follow_branches, has_patterns
    from nonlinear.synchronization.branch_report import branches_json

    (variation,) = parse_variations(options.vary)
    if has_patterns(scene):
        return _diagram(scene, variation, options)
    with crew_of(options) as crew, bar(0, "branches") as report:
        branches = follow_branches(scene, variation, report, crew=crew)
    writers = {"text": branches_text, "csv": branches_csv, "json": branches_json}
    show(options, writers[options.format](branches), "branches_figure", branches)
    return branches


def _map(scene: Scene, options: argparse.Namespace) -> RhythmMap | RhythmGrid:
    from math import prod

    from modal.scene.parameters import parse_variations

    axes = parse_variations(options.vary)
    names = {"members": options.members, "largest_deg": options.spread, "seed": options.seed}
    names |= {"limit": options.duration, "folder": options.folder}
    how = {name: value for name, value in names.items() if value is not None}
    with crew_of(options) as crew, bar(prod(len(axis.values) for axis in axes), "value") as report:
        if len(axes) == 2:
            outcome: RhythmMap | RhythmGrid = nonlinear.ensembles.find_rhythm_grid(
                scene, axes, crew=crew, report=report, **how
            )
        else:
            outcome = nonlinear.ensembles.find_rhythms(scene, axes[0], crew=crew, report=report, **how)
    show(options, outcome.report(options.format), "grid_figure" if len(axes) > 1 else "rhythm_figure", outcome)
    return outcome


def _diagram(scene: Scene, variation: Variation, options: argparse.Namespace) -> PopulationDiagram:
    from nonlinear.synchronization import diagram_csv, diagram_text, follow_populations
    from nonlinear.synchronization.population_report import diagram_json

    with crew_of(options) as crew, bar(0, "motions") as report:
        diagram = follow_populations(scene, variation, report, crew=crew)
    writers = {"text": diagram_text, "csv": diagram_csv, "json": diagram_json}
    show(options, writers[options.format](diagram), "populations_figure", diagram)
    return diagram


COMMANDS = (
    Command(
        topic="coupling and synchronization",
        run=sync,
        main=("--duration", "--start", "--vary", "--film", "--output"),
        takes=(
            SCENE,
            "--duration (default as predicted), with --map the longest run (default 4096 periods)",
            "--start, as in simulate, with undamped mode shapes",
            "--vary, such as support.mass=1:100:30log, along which every steady oscillation is followed instead; with "
            "--map also a second number",
            "--map",
            option(
                "--members, with --map (default 300 starts at each value, of two numbers 20)", type=integer(100_000)
            ),
            option(
                "--spread: with --map, the largest starting angle (default twice the drives' angle)",
                keyword="largest_deg",
            ),
            "--seed, with --map (default 7)",
            "--folder, with --map",
            formats("text", "csv", "json", more=" (default text); csv with --vary only"),
            "--words: prediction and simulation",
            *report_file("text", "csv", "json"),
            "--film: a stroboscopic one",
            *CREW,
        ),
    ),
)
