"""What the commands about motion take: groups of arguments."""

from __future__ import annotations

import argparse

from multipendula.commands import motion as moving
from multipendula.commands import sweeps as sweeping
from multipendula.commands import synchronization as keeping_time
from multipendula.commands import verification as checks
from multipendula.options import EXPLAIN, RADIANS, SCENE_HELP, Add, angles, number, pictured, themed, whole


def _run_of(add: argparse.ArgumentParser, duration: float) -> None:
    """A scene or a saved run, and how it is to be simulated."""
    seconds = number("seconds above 0")
    add.add_argument("scene", metavar="SCENE", help=f"{SCENE_HELP}; or a saved run (.npz or .csv)")
    add.add_argument("--duration", metavar="SECONDS", type=seconds, help=f"default {duration:g}")
    add.set_defaults(usual=duration)
    add.add_argument("--start", metavar="WORDS", help="scene (default), mode:R:DEG or angles:A,B,... (deg, at rest)")
    add.add_argument(
        "--method", metavar="NAME", help="auto, DOP853, RK45, RK23, Radau, BDF, LSODA, taylor (default auto)"
    )
    forms = "auto (default), minimal, maximal, hamiltonian or spatial"
    add.add_argument("--form", metavar="NAME", help=forms)
    add.add_argument("--tolerance", metavar="T", type=number("1e-15 to 0.01", 0.01, 1e-15), help="default 1e-9")
    add.add_argument("--accuracy", metavar="RAD", type=number(*RADIANS), help="of every angle, instead of a tolerance")
    add.add_argument("--samples", metavar="N", type=whole(100_000_000), help="how many instants are kept")


def motions(command: Add) -> None:
    """Motion at large angles."""
    add = command(moving.simulate, "simulate")
    _run_of(add, 60.0)
    add.add_argument("--output", "-o", metavar="FILE", help="keep the motion in a .npz or .csv file")
    add.add_argument("--keep-modes", metavar="R", type=whole(100_000), help="move in the R lowest modes only")
    add.add_argument("--explain", action="store_true", help=EXPLAIN)

    add = command(moving.plot, "plot")
    _run_of(add, 20.0)
    pictured(add, "--output", "-o", required=True)

    add = command(moving.animate, "animate")
    _run_of(add, 10.0)
    add.add_argument("--output", "-o", metavar="FILE", required=True, help="a .gif, .mp4 or .html file")
    add.add_argument("--fps", metavar="N", type=number("frames a second from 1 to 60", 60, 1))
    add.add_argument(
        "--speed",
        metavar="X",
        type=number("times real time from 0.001 to 1000", 1000, 0.001),
        default=1.0,
        help="default 1",
    )
    add.add_argument("--seconds", metavar="S", type=number("seconds above 0"), help="of film, at most (default 20)")
    themed(add)


def trials(command: Add) -> None:
    """How far the table of modes and other ways to a motion hold, and where none does for long."""
    add = command(checks.check, "check")
    add.add_argument("scene", metavar="SCENE", help=SCENE_HELP)
    add.add_argument("--mode", metavar="1:3", help="only these modes, counted from 1")
    add.add_argument("--amplitude", metavar="DEG,...", type=angles, help="largest angles (default 1,5,10,30)")
    add.add_argument("--general", action="store_true", help="one run from --start, projected on the modes, instead")
    add.add_argument("--start", metavar="WORDS", help="with --general, as in simulate")
    add.add_argument("--duration", metavar="SECONDS", type=number("seconds above 0"), help="with --general")
    add.add_argument("--format", choices=("text", "markdown", "csv", "json"), default="text")
    pictured(add, "--output", "-o")

    add = command(checks.chaos, "chaos")
    add.add_argument("scene", metavar="SCENE", help=f"{SCENE_HELP}; or paper:000, paper:001: what they claim")
    add.add_argument("--duration", metavar="SECONDS", type=number("seconds above 0"), help="default 200 sqrt(l/g)")
    add.add_argument("--ensemble", metavar="E", type=whole(10_000), help="starts side by side (default 16)")
    add.add_argument("--quick", action="store_true", help="a short form of a paper's study")
    pictured(add, "--output", "-o")

    add = command(checks.tradeoff, "tradeoff")
    add.add_argument("scene", metavar="SCENE", help=SCENE_HELP)
    add.add_argument("--start", metavar="WORDS", help="as in simulate")
    add.add_argument("--duration", metavar="SECONDS", type=number("seconds above 0"), default=10.0, help="default 10")
    add.add_argument("--format", choices=("text", "markdown", "csv", "json"), default="text")
    pictured(add, "--output", "-o")

    add = command(checks.advise, "advise")
    add.add_argument("scene", metavar="SCENE", help=SCENE_HELP)
    add.add_argument("--accuracy", metavar="RAD", type=number(*RADIANS), required=True, help="of every angle")
    add.add_argument("--duration", metavar="SECONDS", type=number("seconds above 0"), default=60.0, help="default 60")
    add.add_argument("--start", metavar="WORDS", help="as in simulate")
    add.add_argument("--samples", metavar="N", type=whole(100_000_000), help="how many instants are kept")
    add.add_argument("--format", choices=("text", "markdown", "csv", "json"), default="text")
    add.add_argument("--output", "-o", metavar="FILE", help="keep the motion in a .npz or .csv file")


def synchrony(command: Add) -> None:
    """Scenes that excite themselves."""
    add = command(keeping_time.sync, "sync")
    add.add_argument("scene", metavar="SCENE", help=SCENE_HELP)
    add.add_argument("--duration", metavar="SECONDS", type=number("seconds above 0"), help="default: as predicted")
    add.add_argument("--start", metavar="WORDS", help="as in simulate, in shapes without dampers")
    ways = "follow every way to keep swinging along one number instead, such as support.mass=1:100:30log"
    add.add_argument("--vary", metavar="PLACE=VALUES", help=ways)
    add.add_argument("--format", choices=("text", "json", "csv"), default="text", help="csv with --vary only")
    pictured(add, "--picture", "-o")
    add.add_argument("--film", metavar="FILE", help="a .gif, .mp4 or .html file, lit like a stroboscope")


def sweeps(command: Add) -> None:
    """Scenes by the thousand."""
    add = command(sweeping.sweep, "sweep")
    add.add_argument("scene", metavar="SCENE", help=SCENE_HELP)
    places = "support.mass=1:1000:50log, gravity=1:10:5 or pendulum[*].links[0].length=0.9,1,1.1; one to three of them"
    add.add_argument("--vary", metavar="PLACE=VALUES", action="append", required=True, help=places)
    measures = (
        "frequencies (default), damping, splitting or beat of the modes, amplitude or energy_drift of a run, order, "
        "survivor, locking or pendulum_energy of one that drives itself; more than once for several"
    )
    add.add_argument("--measure", metavar="NAME[:N]", action="append", help=measures)
    add.add_argument("--loci", action="store_true", help="follow all frequencies along one --vary by their shapes")
    add.add_argument("--output", "-o", metavar="FILE", help="keep the numbers in a .npz or .csv file (loci: .csv)")
    pictured(add, "--picture")
    add.add_argument("--workers", metavar="N", type=whole(1000), help="processes (default: one a core)")
    add.add_argument("--scheduler", metavar="ADDRESS", help="a Dask cluster instead, such as tcp://192.168.0.2:8786")
    add.add_argument("--fresh", action="store_true", help="begin anew, whatever an interrupted sweep has kept")
