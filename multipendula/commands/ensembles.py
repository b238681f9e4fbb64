"""The commands that run many members of a scene: basins, section and spread."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from math import prod
from typing import TYPE_CHECKING, Any, TypeVar

import modal
import nonlinear
from modal.extend.measures import taken_by
from multipendula.command import CREW, SCENE, Command, Option, formats, kwargs_of, option, refuse, report_file
from multipendula.commands.runs import ELSEWHERE, start_of, tell_of_start
from multipendula.commands.shared import bar, crew_of, in_a_folder, picture, remark, say, show
from multipendula.completion import extensions
from multipendula.options import integer, number

if TYPE_CHECKING:
    from modal.report import Result
    from modal.scene import Scene
    from nonlinear.ensembles import Basins, PoincareSection, StroboscopicSection
    from nonlinear.sweeps import Spread

SECTION_MEMBERS = 24
"""Cost: motions of a section by default, each of which is drawn."""
COMPUTED = (
    "--engine (default the fastest, counting what is still to be compiled)",
    option("--tolerance (default 1e-9)", type=number("from 1e-13 to 0.001", 1e-3, 1e-13)),
    *CREW,
    "--share",
    "--folder",
)
Made = TypeVar("Made", bound="Result")
"""Options of the stored end of an ensemble."""
FORMATS = ("text", "csv", "json")
BY_ENERGY, BY_STROBES = ("--energy", "--crossing"), ("--phase-deg", "--spread", "--settle", "--of", "--seed")
"""Options of a section at an energy, and of a stroboscopic one."""


def measured(verb: str, usual: str, **how: Any) -> Option:
    """The measures of every member; the `usual` measure ends the words."""
    known, completion = taken_by(verb, discover=False), extensions("measure", lambda known: verb not in known.refused)
    return option(f"--measure: {', '.join(known)} (default {usual}", completion=completion, **how)


def strobed(transient: str) -> tuple[str, ...]:
    """When a driven scene is sampled, and which of its links are drawn; `transient` says how long by default."""
    return (
        "--phase-deg (default 0)",
        f"--settle (default {transient})",
        "--of: links, such as theta_1_2 (default the first)",
    )


def basins(options: argparse.Namespace) -> Basins | None:
    """Map the outcome for a grid of initial conditions: attractor, time to the first flip, Lyapunov exponent.

    Every start of a grid is simulated, thousands at a time. In a scene with drives the map shows the rhythm that each
    reaches, found as by sync --map: in phase, antiphase, a beat, at rest; in any other scene, when a link first turns
    over the top, or how fast a small error grows. For a scene driven by a sine, --measure attractor gives the periodic
    motion that each start reaches, named by its period and its largest angle. Starts run until they have settled, at
    most for --duration. A random sample is re-run individually, and the largest difference is reported.

    Examples
    --------
    basins chain-2 --duration 2 --vary 'pendulum[0].start.angles_deg[0]=-170:170:12' --vary
    'pendulum[0].start.angles_deg[1]=-170:170:12' -o turns.png
        when a double pendulum first turns over, from 144 starts
    basins chain-2 --measure lyapunov --duration 2 --vary 'pendulum[0].start.angles_deg[0]=0:170:6' --vary
    'pendulum[0].start.angles_deg[1]=0:170:6' --format csv
        a map of the exponent, as a table
    basins shaken-pendulum --measure attractor --vary 'pendulum[0].start.angles_deg[0]=-60:60:4' --vary
    'pendulum[0].start.rates_deg[0]=-90:90:4' -o attractors.png
        small and large steady swings under one drive
    """
    scene = _scene(options)
    axes = nonlinear.ensembles.grid_of(scene, options.vary or ())
    if nonlinear.ensembles.begins_in_mode(scene, axes):
        tell_of_start("every member begins in the shape of the first mode that swings")
    with _engine(options, prod(len(axis.values) for axis in axes)) as more:
        outcome = nonlinear.ensembles.find_basins(scene, options.duration, vary=axes, measure=options.measure, **more)
    return _show(options, "basins_figure", outcome)


def section(options: argparse.Namespace) -> PoincareSection | StroboscopicSection | None:
    """Compute the Poincaré section of a scene at an energy, or of a driven one once per period, from many motions.

    Motions of one energy start at random points of the section, and every crossing is recorded, including the
    start: closed curves are regular motion, clouds chaos. A scene driven by sines, through forces or its support,
    is instead sampled once per common period of the drives, at --phase-deg: a motion of that period is one point,
    one of p periods p points, and a strange attractor is chaos.

    Examples
    --------
    section chain-2 --energy 10 --members 6 --duration 20 -o section.png
        a double pendulum at 10 J
    section driven-pendulum --settle 20 --members 8 --duration 120 -o strobes.png
        the strange attractor of a driven pendulum
    section chain-2 --energy 2 --crossing 'theta[1,2]=0' --members 2 --duration 5 --format csv
        as a table
    """
    scene = _scene(options)
    return (_strobes if scene.is_forced else _crossings)(options, scene)


def _crossings(options: argparse.Namespace, scene: Scene) -> PoincareSection | None:
    refuse(options, "needs a scene that is driven by a sine: a force or a moved support", *BY_STROBES)
    members = options.members or SECTION_MEMBERS
    with _engine(options, members) as more:
        section = nonlinear.ensembles.find_section(
            scene, options.duration, energy=options.energy, crossing=options.crossing, members=members, **more
        )
    if options.energy is None and not nonlinear.system.has_start(scene):
        tell_of_start("its energy is that of the first mode that swings", "--energy chooses another")
    return _show(options, "section_figure", section)


def _strobes(options: argparse.Namespace, scene: Scene) -> StroboscopicSection | None:
    refuse(options, "needs a scene that keeps its energy; of this one the section is stroboscopic", *BY_ENERGY)
    if not nonlinear.system.has_start(scene):
        tell_of_start("motions begin around the shape of its first mode that swings")
    with _engine(options, options.members or SECTION_MEMBERS) as more:
        how = kwargs_of(options, "--members", "--phase-deg", "--spread", "--settle", "--seed")
        strobes = nonlinear.ensembles.find_strobes(scene, options.duration, of=names_of(options), **how, **more)
    return _show(options, "strobes_figure", strobes)


def names_of(options: argparse.Namespace) -> list[str]:
    """The links named by --of."""
    return options.of.split(",") if options.of else []


def spread(options: argparse.Namespace) -> Spread | None:
    """Propagate tolerances of a scene's numbers to its frequencies and its motion by Monte Carlo.

    Numbers are drawn within their tolerances, given as standard deviations or as intervals, or from the covariance
    of a fit; shift:PLACE=WIDTH is drawn once and added to all numbers of a place. The report has quantiles of every
    frequency, bands of the motion with --duration, and which number matters most. In --format csv each line is a
    member, with its angles at every sample of the motion.

    Examples
    --------
    spread paper-cart-2 --uncertain support.mass=2% --uncertain 'pendulum[*].links[*].length=0.01' -o spread.png
        two tolerances, with a figure
    spread paper-cart-1 --uncertain gravity=9.78:9.83 --members 100 --duration 2 --format json
        an interval, and bands of two seconds of motion
    """
    from nonlinear.sweeps import find_spread

    scene = _scene(options)
    members, seed = options.members or 1000, 5 if options.seed is None else options.seed
    if options.folder and not options.duration:
        raise modal.SceneError(["--folder: needs --duration, since frequencies alone are not stored"])
    uncertain = options.uncertain or ([] if options.covariance else _all_numbers(scene))
    with _engine(options, members) as more:
        more["measures"] = options.measure or ()
        more["covariance"] = options.covariance
        start = start_of(scene, None, elsewhere=ELSEWHERE) if options.duration else None
        spreads = find_spread(scene, uncertain, options.duration, members=members, seed=seed, start=start, **more)
    return _show(options, "spread_figure", spreads)


def _all_numbers(scene: Scene) -> list[str]:
    """A tolerance for every number that a scene is made of."""
    numbers = [f"{number.place}=1%" for number in modal.scene.scene_numbers(scene) if number.is_physical]
    remark(f"a standard deviation of 1 % of all {len(numbers)} numbers; --uncertain PLACE=WIDTH sets others")
    return numbers


def _scene(options: argparse.Namespace) -> Scene:
    """The scene, once the picture's name is right."""
    in_a_folder(options.output)
    picture(options.output)
    return modal.load(options.scene)


def _show(options: argparse.Namespace, figure: str, outcome: Made) -> Made | None:
    """The result, once its report and its picture are written; of a share only where it is stored, and None."""
    if tell_of_share(options):
        return None
    show(options, outcome.report(options.format), figure, outcome)
    return outcome


def tell_of_share(options: argparse.Namespace) -> bool:
    """Whether a share was computed, which is reported in place of the result."""
    from modal.report import visible

    if options.share:
        share, where = f"share {options.share[0] + 1} of {options.share[1]}", visible(options.folder)
        say(f"{share} is in {where}: without --share the command combines all shares\n")
    return bool(options.share)


def refuse_homeless(options: argparse.Namespace) -> None:
    """Raise SceneError for a share without a folder."""
    if options.share and not options.folder:
        raise modal.SceneError(["--share: needs --folder"])


@contextmanager
def _engine(options: argparse.Namespace, members: int) -> Iterator[dict[str, Any]]:
    """The arguments of an ensemble, with a progress bar in members."""
    refuse_homeless(options)
    more = kwargs_of(options, "--engine", "--workers", "--folder", "--share", "--tolerance")
    with bar(members, "member") as shown, crew_of(options) as crew:
        yield more | {"report": shown, "crew": crew.crew}


COMMANDS = (
    Command(
        topic="coupling and synchronization",
        run=basins,
        main=("--vary", "--measure", "--duration", "--output"),
        takes=(
            SCENE,
            "--vary, such as pendulum[0].start.angles_deg[0]=-180:180:512; two of them (default two angles, or angle "
            "and rate)",
            measured("basins", "attractor of a scene with drives, else first_turn)", most=1),
            "--duration (default 30 sqrt(l/g), for order as long as sync needs, for attractors at most 4096 swings or "
            "40 slowest decays)",
            *COMPUTED,
            formats(*FORMATS),
            *report_file(*FORMATS),
        ),
    ),
    Command(
        topic="motion",
        run=section,
        main=("--energy", "--crossing", "--members", "--duration", "--output"),
        takes=(
            SCENE,
            "--energy (default that of its start)",
            "--crossing, upwards (>), downwards (<) or both (=): theta[1,1]>0 (default), degrees, or x=0, metres",
            option("--members: motions (default 24)", type=integer(10_000)),
            "--spread, for a driven scene (default 10)",
            "--seed, of a driven scene",
            *strobed("none"),
            "--duration of each motion (default 200 sqrt(l/g), for a driven scene 200 periods after --settle)",
            *COMPUTED,
            formats(*FORMATS),
            *report_file(*FORMATS),
        ),
    ),
    Command(
        topic="motion",
        run=spread,
        main=("--uncertain", "--covariance", "--duration", "--members", "--output"),
        takes=(
            SCENE,
            "--uncertain: its standard deviation, support.mass=0.5 or support.mass=2%%, or its interval, "
            "gravity=9.8:9.83; repeat for several (default 1%% of all)",
            "--covariance: draws its numbers together",
            option("--members: scenes drawn (default 1000)", type=integer(10_000_000)),
            "--seed",
            measured("spread", "all frequencies); repeat for several", keyword="measures"),
            "--duration from the scene's own start (default none: frequencies only)",
            *COMPUTED,
            formats(*FORMATS),
            *report_file(*FORMATS),
        ),
    ),
)
