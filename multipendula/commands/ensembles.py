"""The commands that run many members of a scene: basins, section and spread."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from math import prod
from typing import TYPE_CHECKING, Any

from multipendula.command import Command
from multipendula.commands.runs import ELSEWHERE, start_of, tell_of_start
from multipendula.commands.shared import bar, draw_in, estimate_of, forewarning, in_a_folder, picture, say
from multipendula.completion import places
from multipendula.options import (
    add_covariance,
    add_duration,
    add_format,
    add_report,
    add_scene,
    add_strobes,
    add_words,
    number,
    offer,
    whole,
)
from multipendula.parser import Page

if TYPE_CHECKING:
    from modal.scene import Scene

FORMATS = ("text", "csv", "json")
ENGINES = ("auto", "numpy", "numba", "heyoka", "simulate")
BY_ENERGY, BY_STROBES = ("energy", "at"), ("phase_deg", "spread", "settle", "of", "seed")
"""Options of a section at an energy, and of a stroboscopic one."""


def basins(options: argparse.Namespace) -> None:
    """Map which motion each start of a grid ends in: a rhythm, an attractor, a first turn over the top, an exponent."""
    from nonlinear.ensembles import basins_table, begins_in_mode, find_basins, grid_of

    scene = _scene(options)
    axes = grid_of(scene, options.vary or ())
    if begins_in_mode(scene, axes):
        tell_of_start("every member begins in the shape of the first mode that swings")
    with _engine(options, scene, prod(len(axis.values) for axis in axes)) as more:
        found = find_basins(scene, options.duration, vary=axes, measure=options.measure, folder=options.folder, **more)
    say(basins_table(found, options.format), options.format)
    draw_in(options, options.output, "nonlinear.plotting", "draw_basins", found)


def _basins_arguments(page: Page) -> None:
    from nonlinear.measures import taken_by

    add_scene(page)
    words = "two numbers, such as pendulum[0].start.angles_deg[0]=-180:180:512 (default: angles, or angle and rate)"
    offer(page.asked.add_argument("--vary", metavar="PLACE=VALUES", action="append", help=words), places)
    page.rephrase(r"by find_bifurcations$", "by sweep --strobe")
    words = f"{', '.join(taken_by('basins'))} (default: configuration of a scene with drives, else first_turn)"
    add_words(page.asked, "--measure", taken_by("basins"), comma="", metavar="NAME[:N]", help=f"{words}; N seconds")
    page.rephrase(r"^measure (\S+): cannot be combined with a duration$", r"--measure \1: has its own --duration")
    add_duration(page, "default 30 sqrt(l/g), for a rhythm as long as sync needs, for attractors ten slowest decays")
    _add_engine(page)
    words = "keep finished chunks in this folder, and go on there after an interruption"
    page.written.add_argument("--folder", metavar="FOLDER", help=words)
    add_format(page, FORMATS)
    add_report(page, FORMATS)


def section(options: argparse.Namespace) -> None:
    """Compute the Poincaré section of a scene at an energy, of a driven one once a period, from many motions."""
    scene = _scene(options)
    (_strobes if scene.is_forced else _crossings)(options, scene)


def _crossings(options: argparse.Namespace, scene: Scene) -> None:
    from nonlinear.ensembles import find_section, section_table
    from nonlinear.system import has_start

    refuse(options, BY_STROBES, "needs a scene that is driven by a sine: a force or a moved support")
    orbits = options.orbits or 24
    with _engine(options, scene, orbits) as more:
        found = find_section(scene, options.duration, energy=options.energy, at=options.at, orbits=orbits, **more)
    if options.energy is None and not has_start(scene):
        tell_of_start("its energy is that of the first mode that swings", "--energy chooses another")
    say(section_table(found, options.format), options.format)
    draw_in(options, options.output, "nonlinear.plotting", "draw_section", found)


def _strobes(options: argparse.Namespace, scene: Scene) -> None:
    from nonlinear.ensembles import find_strobes, strobes_table
    from nonlinear.system import has_start

    refuse(options, BY_ENERGY, "needs a scene that keeps its energy; of this one the section is stroboscopic")
    if not has_start(scene):
        tell_of_start("motions begin around the shape of its first mode that swings")
    asked = {"orbits": options.orbits, "phase_deg": options.phase_deg, "spread_deg": options.spread}
    asked |= {"settle": options.settle, "seed": options.seed, "of": names_of(options)}
    with _engine(options, scene, options.orbits or 24) as more:
        more |= {name: value for name, value in asked.items() if value is not None}
        found = find_strobes(scene, options.duration, **more)
    say(strobes_table(found, options.format), options.format)
    draw_in(options, options.output, "nonlinear.plotting", "draw_strobes", found)


def refuse(options: argparse.Namespace, names: Sequence[str], why: str) -> None:
    """SceneError for those of these options that were given."""
    from modal.errors import SceneError

    if problems := [f"--{name.replace('_', '-')}: {why}" for name in names if getattr(options, name) is not None]:
        raise SceneError(problems)


def names_of(options: argparse.Namespace) -> list[str]:
    """The links named by --of."""
    return options.of.split(",") if options.of else []


def _section_arguments(page: Page) -> None:
    add_scene(page)
    words = "energy above the scene's rest in joules (default: that of its start)"
    page.asked.add_argument("--energy", metavar="JOULES", type=_joules, help=words)
    words = "what is passed, upwards (>), downwards (<) or both (=): theta[1,1]>0 (default), degrees, or x=0, metres"
    page.asked.add_argument("--at", metavar="COORDINATE", help=words)
    page.asked.add_argument("--orbits", metavar="N", type=whole(10_000), help="number of motions (default 24)")
    words = "largest distance of starting angles from the scene's, of a driven scene (default 10)"
    page.asked.add_argument("--spread", metavar="DEG", type=number("degrees from 0", least=0.0), help=words)
    page.asked.add_argument("--seed", metavar="N", type=whole(2**31), help="of the random starts of a driven scene")
    add_strobes(page, "none")
    add_duration(page, "of each (default 200 sqrt(l/g), of a driven scene 200 periods after --settle)")
    _add_engine(page)
    add_format(page, FORMATS)
    add_report(page, FORMATS)
    page.rephrase(r"(?<=no mode swings)$", ": give --energy")


def spread(options: argparse.Namespace) -> None:
    """Propagate tolerances of a scene's numbers to its frequencies and its motion by Monte Carlo."""
    from modal.errors import SceneError
    from nonlinear.sweeps import find_spread, spread_table

    scene = _scene(options)
    members, seed = options.members or 1000, options.seed or 5
    with _engine(options, scene, members) as more:
        more["measures"] = options.measure or ()
        more["estimate"] = estimate_of(scene, options.covariance)
        if more["estimate"] is None and not options.tolerance:
            raise SceneError(["spread needs --tolerance PLACE=WIDTH or --covariance FIT.json"])
        start = start_of(scene, None, elsewhere=ELSEWHERE) if options.duration else None
        found = find_spread(
            scene, options.tolerance or (), options.duration, members=members, seed=seed, start=start, **more
        )
    say(spread_table(found, options.format), options.format)
    draw_in(options, options.output, "nonlinear.plotting", "draw_spread", found)


def _spread_arguments(page: Page) -> None:
    from nonlinear.measures import taken_by

    add_scene(page)
    words = (
        "a number with its standard deviation, support.mass=0.5 or support.mass=2%%, or its interval, "
        "gravity=9.8:9.83; repeat for several"
    )
    tolerance = page.asked.add_argument("--tolerance", metavar="PLACE=WIDTH", action="append", help=words)
    offer(tolerance, places)
    add_covariance(page, "draws its numbers together")
    page.asked.add_argument("--members", metavar="N", type=whole(10_000_000), help="number drawn (default 1000)")
    page.asked.add_argument("--seed", metavar="N", type=whole(2**31), help="of the random numbers")
    words = f"{', '.join(taken_by('spread'))} (default: all frequencies); repeat for several"
    add_words(page.asked, "--measure", taken_by("spread"), comma="", metavar="NAME[:N]", action="append", help=words)
    add_duration(page, "of the motion, from the scene's own start (default: frequencies only)")
    _add_engine(page)
    add_format(page, FORMATS)
    add_report(page, FORMATS)
    page.rephrase(r"members (\d+): must be", r"--members \1: must be")


def _joules(text: str) -> float:
    """An energy, also one below that of rest."""
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not abs(value) < float("inf"):
        raise argparse.ArgumentTypeError(f"{text}: must be a number of joules")
    return value


def _scene(options: argparse.Namespace) -> Scene:
    """The scene, once the picture's name is right."""
    from modal.scene import load

    in_a_folder(options.output)
    if options.output:
        picture(options.output)
    return load(options.scene)


def _add_engine(page: Page) -> None:
    page.computed.add_argument(
        "--engine", choices=ENGINES, default="auto", help="default: the fastest, counting what is still to be compiled"
    )
    words = "of the integrator (default 1e-9)"
    numbers = number("from 1e-13 to 1e-3", 1e-3, 1e-13)
    page.computed.add_argument("--integrator-tolerance", metavar="TOL", type=numbers, default=1e-9, help=words)
    page.computed.add_argument("--workers", metavar="N", type=whole(1000), help="processes (default: one per core)")
    page.computed.add_argument("--scheduler", metavar="ADDRESS", help="a Dask cluster, such as tcp://192.168.0.2:8786")


@contextmanager
def _engine(options: argparse.Namespace, scene: Scene, members: int) -> Iterator[dict[str, Any]]:
    """The arguments of an ensemble, with a progress bar in members."""
    more: dict[str, Any] = {
        "engine": options.engine,
        "tolerance": options.integrator_tolerance,
        "workers": options.workers,
    }
    with bar(members, "member") as shown:
        report = forewarning(shown, scene, options.duration, members, options.integrator_tolerance)
        if not options.scheduler:
            yield more | {"report": report}
            return
        from nonlinear.ensembles.cluster import cluster

        with cluster(options.scheduler) as crew:
            yield more | {"report": report, "crew": crew}


COMMANDS = (
    Command(
        name="basins",
        topic="coupling and synchronization",
        run=basins,
        arguments=_basins_arguments,
        details=(
            "Every start of a grid is simulated, thousands side by side. In a scene with drives the map tells which "
            "steady oscillation of sync each ends in; in any other when a link first goes over the top, or how fast a "
            "small error grows. Of a scene that a sine drives --measure attractor tells the periodic motion each start "
            "ends in, named by its period and its largest angle. A random sample is run by itself as well, and the "
            "largest difference stated."
        ),
        examples=(
            (
                "basins chain-2 --duration 2 --vary 'pendulum[0].start.angles_deg[0]=-170:170:12' "
                "--vary 'pendulum[0].start.angles_deg[1]=-170:170:12' -o turns.png",
                "when a double pendulum first turns over, from 144 starts",
            ),
            (
                "basins chain-2 --measure lyapunov --duration 2 --vary 'pendulum[0].start.angles_deg[0]=0:170:6' "
                "--vary 'pendulum[0].start.angles_deg[1]=0:170:6' --format csv",
                "a map of the exponent, as a table",
            ),
            (
                "basins shaken_pendulum.toml --measure attractor --vary 'pendulum[0].start.angles_deg[0]=-60:60:4' "
                "--vary 'pendulum[0].start.rates_deg[0]=-90:90:4' -o attractors.png",
                "small and large swings of a scene of the folder examples",
            ),
        ),
    ),
    Command(
        name="section",
        topic="motion",
        run=section,
        arguments=_section_arguments,
        details=(
            "Motions with one energy start at random on the section, and each crossing is recorded, the start among "
            "them: closed curves are regular motion, clouds chaos. A scene that sines drive, by forces or by its "
            "support, is looked at once a period of all of them instead, at --phase-deg: a point is a motion of that "
            "period, p points one of p periods, a strange attractor chaos."
        ),
        examples=(
            ("section chain-2 --energy 10 --orbits 6 --duration 20 -o section.png", "a double pendulum at 10 J"),
            (
                "section driven_pendulum.toml --settle 20 --orbits 8 --duration 120 -o strobes.png",
                "the strange attractor of a scene of the folder examples",
            ),
            ("section chain-2 --energy 2 --at 'theta[1,2]=0' --orbits 2 --duration 5 --format csv", "as a table"),
        ),
    ),
    Command(
        name="spread",
        topic="motion",
        run=spread,
        arguments=_spread_arguments,
        details=(
            "Numbers are drawn within their tolerances, given as standard deviations or as intervals, or from the "
            "covariance of a fit. Reported are "
            "quantiles of every frequency, with --duration bands of the motion, and which number matters most. In "
            "--format csv each line is a member, with its angles at every sample of the motion."
        ),
        examples=(
            (
                "spread paper-cart-2 --tolerance support.mass=2% --tolerance 'pendulum[*].links[*].length=0.01' "
                "-o spread.png",
                "two tolerances, with a figure",
            ),
            (
                "spread paper-cart-1 --tolerance gravity=9.78:9.83 --members 100 --duration 2 --format json",
                "an interval, and bands of two seconds of motion",
            ),
        ),
    ),
)
