"""What each command takes: groups of arguments and the converters that check them."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable

from multipendula import checks, commands, models, motions, sweeps

EXPLAIN = "say what was built for this, and what the scene did not require"
SCENE_HELP = "a scene file, the name of a shipped scene (see `multipendula scenes`), or - for standard input"
FORMATS = ("text", "markdown", "latex", "csv", "html", "json")
RADIANS = ("radians from 1e-14 to 0.3", 0.3, 1e-14)


def _number(words: str, most: float = sys.float_info.max, least: float = 0.0) -> Callable[[str], float]:
    """A converter of numbers above 0, `words` saying which."""

    def converted(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = float("nan")
        if not (0 < value <= most and value >= least):
            raise argparse.ArgumentTypeError(f"{text}: must be a number of {words}")
        return value

    return converted


def _whole(most: int) -> Callable[[str], int]:
    """A converter of whole numbers from 1."""

    def converted(text: str) -> int:
        digits = text.isascii() and text.isdigit() and len(text) <= len(str(most))
        if not digits or not 1 <= int(text) <= most:
            raise argparse.ArgumentTypeError(f"{text}: must be a whole number from 1 to {most}")
        return int(text)

    return converted


def _angles(text: str) -> list[float]:
    """A converter of angles in degrees, with commas."""
    return [_number("degrees above 0 and at most 170", most=170)(word) for word in text.split(",")]


def _signals(add: argparse.ArgumentParser) -> None:
    """The scene and the groups of inputs and outputs of its model."""
    add.add_argument("scene", metavar="SCENE", help=SCENE_HELP)
    add.add_argument(
        "--input",
        metavar="WORDS",
        help="cart_force (default on a cart), cart_acceleration or cart_velocity; joint_torques (default on a fixed "
        "support), link_forces",
    )
    add.add_argument(
        "--output",
        metavar="WORDS",
        help="cart_position,angles (default), cart_velocity, rates, relative_angles, relative_rates, joint_positions, "
        "tip_positions, pivot_forces",
    )


Add = Callable[[Callable[[argparse.Namespace], None], str, str], argparse.ArgumentParser]


def _tables(command: Add) -> None:
    add = command(commands.scenes, "scenes", "scenes crane-hook > my-crane.toml")
    add.add_argument("name", nargs="?", help="print this scene's file, to start one of your own")

    add = command(commands.table, "table", "table rope --modes 1:5 --format markdown")
    add.add_argument("scene", metavar="SCENE", help=SCENE_HELP)
    add.add_argument("--format", choices=FORMATS, default="text")
    add.add_argument("--output", "-o", metavar="FILE", help="write here instead of standard output")
    add.add_argument("--modes", metavar="1:10", help="only these modes, counted from 1")
    add.add_argument("--shapes", action="store_true", help="add mode shapes and energy shares (json only)")
    add.add_argument("--explain", action="store_true", help=EXPLAIN)

    degrees = _number("degrees above 0 and at most 90", most=90)
    add = command(commands.shapes, "shapes", "shapes paper-cart-2 -o shapes.png")
    add.add_argument("scene", metavar="SCENE", help=SCENE_HELP)
    add.add_argument("--output", "-o", metavar="FILE", required=True, help="a .png, .svg or .pdf file")
    add.add_argument("--modes", metavar="1:10", help="only these modes, counted from 1")
    add.add_argument(
        "--amplitude",
        metavar="DEG",
        type=degrees,
        default=25.0,
        help="largest angle drawn (default 25)",
    )

    add = command(commands.explain, "explain", "explain paper-cart-2 -o coupling.png")
    add.add_argument("scene", metavar="SCENE", help=SCENE_HELP)
    add.add_argument("--format", choices=("text", "markdown", "json"), default="text")
    add.add_argument("--output", "-o", metavar="FILE", help="a .png, .svg or .pdf file")

    add = command(commands.matrices, "matrices", "matrices chain-3")
    add.add_argument("scene", metavar="SCENE", help=SCENE_HELP)
    add.add_argument("--format", choices=("text", "json"), default="text")
    add.add_argument("--output", "-o", metavar="FILE", help="write here instead of standard output")

    command(commands.schema, "schema", "schema > scene.schema.json")


def _derivations(command: Add) -> None:
    add = command(commands.derive, "derive", "derive chain:3 --symbolic masses,lengths --format latex")
    add.add_argument(
        "target",
        metavar="TARGET",
        help="chain:N, cart:N (a chain of N links on a cart), cart:PxN (P of them), "
        "paper:000, paper:001 or paper:002 (what it prints and what is right), or a scene",
    )
    add.add_argument("--symbolic", metavar="WORDS", help="in symbols, each link its own: masses,lengths,gravity,cart")
    add.add_argument("--show", metavar="WORDS", help="only these: lagrangian,equations,matrices,polynomial,modes")
    add.add_argument("--links", choices=("bob", "rod"), default="bob", help="what chain: and cart: are made of")
    add.add_argument("--equilibrium", metavar="down,up", help="where the links of chain: and cart: point at rest")
    add.add_argument("--format", choices=("text", "latex", "markdown"), default="text")
    add.add_argument("--output", "-o", metavar="FILE", help="write here instead of standard output")

    add = command(commands.enclose, "enclose", "enclose paper-cart-2 --digits 50")
    add.add_argument("scene", metavar="SCENE", help=SCENE_HELP)
    add.add_argument("--digits", metavar="N", type=_whole(1000), default=30, help="relative width 10^-N (default 30)")
    add.add_argument("--output", "-o", metavar="FILE", help="write here instead of standard output")


def _models(command: Add) -> None:
    seconds = _number("seconds above 0")
    add = command(models.export, "export", "export crane-hook --to mat --discrete 0.01 -o crane.mat")
    _signals(add)
    formats = "control, mat, m, json, npz, csv, c, fmu or modelica"
    add.add_argument("--to", required=True, metavar="FORMAT", help=formats)
    add.add_argument("-o", dest="file", metavar="FILE", required=True, help="the file to write")
    add.add_argument("--discrete", metavar="SECONDS", type=seconds, help="sample it, with inputs held in between")
    smaller = add.add_mutually_exclusive_group()
    smaller.add_argument("--minimal", action="store_true", help="without what no input reaches or no output sees")
    smaller.add_argument("--modes", metavar="K", type=_whole(99999), help="only the K modes that contribute most")

    add = command(models.gains, "gains", "gains crane-two-loads --output cart_position")
    _signals(add)

    add = command(models.response, "response", "response crane-hook -o bode.png")
    _signals(add)
    add.add_argument("-o", dest="file", metavar="FILE", required=True, help="a .png, .svg or .pdf file")
    add.add_argument("--from", dest="source", metavar="NAME", help="which single input (default: the first)")
    add.add_argument("--of", metavar="NAMES", help="which single outputs (default: all)")
    add.add_argument("--impulse", action="store_true", help="the impulse response instead of the Bode plot")

    add = command(models.shaper, "shaper", "shaper crane-hook --kind zvd --count 2")
    add.add_argument("scene", metavar="SCENE", help=SCENE_HELP)
    add.add_argument("--kind", choices=("zv", "zvd"), default="zv", help="zvd bears more error in the frequencies")
    add.add_argument("--count", metavar="K", type=_whole(99999), default=1, help="for the K slowest modes (default 1)")
    drives = ("cart_acceleration", "cart_velocity", "cart_force")
    add.add_argument("--drive", choices=drives, default=drives[0], help="what moves the cart")


def _run_of(add: argparse.ArgumentParser, duration: float) -> None:
    """A scene or a saved run, and how it is to be simulated."""
    seconds = _number("seconds above 0")
    add.add_argument("scene", metavar="SCENE", help=f"{SCENE_HELP}; or a saved run (.npz or .csv)")
    add.add_argument("--duration", metavar="SECONDS", type=seconds, help=f"default {duration:g}")
    add.set_defaults(usual=duration)
    add.add_argument("--start", metavar="WORDS", help="scene (default), mode:R:DEG or angles:A,B,... (deg, at rest)")
    add.add_argument(
        "--method", metavar="NAME", help="auto, DOP853, RK45, RK23, Radau, BDF, LSODA, taylor (default auto)"
    )
    forms = "auto (default), minimal, maximal, hamiltonian or spatial"
    add.add_argument("--form", metavar="NAME", help=forms)
    add.add_argument("--tolerance", metavar="T", type=_number("1e-15 to 0.01", 0.01, 1e-15), help="default 1e-9")
    add.add_argument("--accuracy", metavar="RAD", type=_number(*RADIANS), help="of every angle, instead of a tolerance")
    add.add_argument("--samples", metavar="N", type=_whole(100_000_000), help="how many instants are kept")


def _motions(command: Add) -> None:
    add = command(motions.simulate, "simulate", "simulate paper-cart-3 --duration 60 -o run.npz")
    _run_of(add, 60.0)
    add.add_argument("--output", "-o", metavar="FILE", help="keep the motion in a .npz or .csv file")
    add.add_argument("--keep-modes", metavar="R", type=_whole(100_000), help="move in the R lowest modes only")
    add.add_argument("--explain", action="store_true", help=EXPLAIN)

    add = command(motions.plot, "plot", "plot run.npz -o run.png")
    _run_of(add, 20.0)
    add.add_argument("--output", "-o", metavar="FILE", required=True, help="a .png, .svg or .pdf file")

    add = command(motions.animate, "animate", "animate paper-cart-3 --duration 10 -o run.gif")
    _run_of(add, 10.0)
    add.add_argument("--output", "-o", metavar="FILE", required=True, help="a .gif, .mp4 or .html file")
    add.add_argument("--fps", metavar="N", type=_number("frames a second from 1 to 60", 60, 1))
    add.add_argument(
        "--speed",
        metavar="X",
        type=_number("times real time from 0.001 to 1000", 1000, 0.001),
        default=1.0,
        help="default 1",
    )
    add.add_argument("--seconds", metavar="S", type=_number("seconds above 0"), help="of film, at most (default 20)")

    add = command(checks.check, "check", "check paper-cart-2 --amplitude 1,5,10,30 -o check.png")
    add.add_argument("scene", metavar="SCENE", help=SCENE_HELP)
    add.add_argument("--mode", metavar="1:3", help="only these modes, counted from 1")
    add.add_argument("--amplitude", metavar="DEG,...", type=_angles, help="largest angles (default 1,5,10,30)")
    add.add_argument("--general", action="store_true", help="one run from --start, projected on the modes, instead")
    add.add_argument("--start", metavar="WORDS", help="with --general, as in simulate")
    add.add_argument("--duration", metavar="SECONDS", type=_number("seconds above 0"), help="with --general")
    add.add_argument("--format", choices=("text", "markdown", "csv", "json"), default="text")
    add.add_argument("--output", "-o", metavar="FILE", help="a .png, .svg or .pdf file")

    add = command(checks.chaos, "chaos", "chaos paper-cart-2 -o lyapunov.png")
    add.add_argument("scene", metavar="SCENE", help=f"{SCENE_HELP}; or paper:000, paper:001: what they claim")
    add.add_argument("--duration", metavar="SECONDS", type=_number("seconds above 0"), help="default 200 sqrt(l/g)")
    add.add_argument("--ensemble", metavar="E", type=_whole(10_000), help="starts side by side (default 16)")
    add.add_argument("--quick", action="store_true", help="a short form of a paper's study")
    add.add_argument("--output", "-o", metavar="FILE", help="a .png, .svg or .pdf file")

    add = command(checks.tradeoff, "tradeoff", "tradeoff paper-cart-2 --start mode:2:10 -o tradeoff.png")
    add.add_argument("scene", metavar="SCENE", help=SCENE_HELP)
    add.add_argument("--start", metavar="WORDS", help="as in simulate")
    add.add_argument("--duration", metavar="SECONDS", type=_number("seconds above 0"), default=10.0, help="default 10")
    add.add_argument("--format", choices=("text", "markdown", "csv", "json"), default="text")
    add.add_argument("--output", "-o", metavar="FILE", help="a .png, .svg or .pdf file")

    add = command(checks.advise, "advise", "advise paper-cart-3 --accuracy 1e-3 --duration 60")
    add.add_argument("scene", metavar="SCENE", help=SCENE_HELP)
    add.add_argument("--accuracy", metavar="RAD", type=_number(*RADIANS), required=True, help="of every angle")
    add.add_argument("--duration", metavar="SECONDS", type=_number("seconds above 0"), default=60.0, help="default 60")
    add.add_argument("--start", metavar="WORDS", help="as in simulate")
    add.add_argument("--samples", metavar="N", type=_whole(100_000_000), help="how many instants are kept")
    add.add_argument("--format", choices=("text", "markdown", "csv", "json"), default="text")
    add.add_argument("--output", "-o", metavar="FILE", help="keep the motion in a .npz or .csv file")


def _sweeps(command: Add) -> None:
    example = "sweep paper-cart-2 --vary support.mass=1:1000:50log --measure beat -o beat.csv"
    add = command(sweeps.sweep, "sweep", example)
    add.add_argument("scene", metavar="SCENE", help=SCENE_HELP)
    places = "support.mass=1:1000:50log, gravity=1:10:5 or pendulum[*].links[0].length=0.9,1,1.1; one to three of them"
    add.add_argument("--vary", metavar="PLACE=VALUES", action="append", required=True, help=places)
    measures = "frequencies (default), damping, splitting, beat, amplitude or energy_drift; more than once for several"
    add.add_argument("--measure", metavar="NAME[:N]", action="append", help=measures)
    add.add_argument("--loci", action="store_true", help="follow all frequencies along one --vary by their shapes")
    add.add_argument("--output", "-o", metavar="FILE", help="keep the numbers in a .npz or .csv file (loci: .csv)")
    add.add_argument("--picture", metavar="FILE", help="a .png, .svg or .pdf file")
    add.add_argument("--workers", metavar="N", type=_whole(1000), help="processes (default: one a core)")
    add.add_argument("--scheduler", metavar="ADDRESS", help="a Dask cluster instead, such as tcp://192.168.0.2:8786")
    add.add_argument("--fresh", action="store_true", help="begin anew, whatever an interrupted sweep has kept")


GROUPS = (_tables, _derivations, _models, _motions, _sweeps)
