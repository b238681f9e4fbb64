"""What each command takes: groups of arguments."""

from __future__ import annotations

import argparse

from multipendula import completion
from multipendula.commands import modes as commands
from multipendula.commands import statespace as models
from multipendula.commands.motion_arguments import motions, sweeps, synchrony, trials
from multipendula.options import EXPLAIN, FORMATS, SCENE_HELP, Add, number, pictured, whole


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


def _tables(command: Add) -> None:
    add = command(commands.scenes, "scenes")
    add.add_argument("name", nargs="?", metavar="NAME", help="print this scene's file, to start one of your own")

    add = command(commands.table, "table")
    add.add_argument("scene", metavar="SCENE", help=SCENE_HELP)
    add.add_argument("--format", choices=FORMATS, default="text")
    add.add_argument("--output", "-o", metavar="FILE", help="write here instead of standard output")
    add.add_argument("--modes", metavar="1:10", help="only these modes, counted from 1")
    add.add_argument("--shapes", action="store_true", help="add mode shapes and energy shares (json only)")
    add.add_argument("--explain", action="store_true", help=EXPLAIN)

    degrees = number("degrees above 0 and at most 90", most=90)
    add = command(commands.shapes, "shapes")
    add.add_argument("scene", metavar="SCENE", help=SCENE_HELP)
    pictured(add, "--output", "-o", required=True)
    add.add_argument("--modes", metavar="1:10", help="only these modes, counted from 1")
    add.add_argument(
        "--amplitude",
        metavar="DEG",
        type=degrees,
        default=25.0,
        help="largest angle drawn (default 25)",
    )

    add = command(commands.explain, "explain")
    add.add_argument("scene", metavar="SCENE", help=SCENE_HELP)
    add.add_argument("--format", choices=("text", "markdown", "json"), default="text")
    pictured(add, "--output", "-o")

    add = command(commands.matrices, "matrices")
    add.add_argument("scene", metavar="SCENE", help=SCENE_HELP)
    add.add_argument("--format", choices=("text", "json"), default="text")
    add.add_argument("--output", "-o", metavar="FILE", help="write here instead of standard output")

    command(commands.schema, "schema")

    add = command(completion.completion, "completion")
    add.add_argument("shell", choices=completion.SHELLS)


def _derivations(command: Add) -> None:
    add = command(commands.derive, "derive")
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

    add = command(commands.enclose, "enclose")
    add.add_argument("scene", metavar="SCENE", help=SCENE_HELP)
    add.add_argument("--digits", metavar="N", type=whole(1000), default=30, help="relative width 10^-N (default 30)")
    add.add_argument("--output", "-o", metavar="FILE", help="write here instead of standard output")


def _models(command: Add) -> None:
    seconds = number("seconds above 0")
    add = command(models.export, "export")
    _signals(add)
    formats = "control, mat, m, json, npz, csv, c, fmu or modelica"
    add.add_argument("--to", required=True, metavar="FORMAT", help=formats)
    add.add_argument("-o", dest="file", metavar="FILE", required=True, help="the file to write, - for standard output")
    add.add_argument("--discrete", metavar="SECONDS", type=seconds, help="sample it, with inputs held in between")
    smaller = add.add_mutually_exclusive_group()
    smaller.add_argument("--minimal", action="store_true", help="without what no input reaches or no output sees")
    smaller.add_argument("--modes", metavar="K", type=whole(99999), help="only the K modes that contribute most")

    add = command(models.gains, "gains")
    _signals(add)

    add = command(models.response, "response")
    _signals(add)
    pictured(add, "-o", dest="file", required=True)
    add.add_argument("--from", dest="source", metavar="NAME", help="which single input (default: the first)")
    add.add_argument("--of", metavar="NAMES", help="which single outputs (default: all)")
    add.add_argument("--impulse", action="store_true", help="the impulse response instead of the Bode plot")

    add = command(models.shaper, "shaper")
    add.add_argument("scene", metavar="SCENE", help=SCENE_HELP)
    add.add_argument("--kind", choices=("zv", "zvd"), default="zv", help="zvd bears more error in the frequencies")
    add.add_argument("--count", metavar="K", type=whole(99999), default=1, help="for the K slowest modes (default 1)")
    drives = ("cart_acceleration", "cart_velocity", "cart_force")
    moves = "what moves the cart: cart_acceleration (default), cart_velocity or cart_force"
    add.add_argument("--drive", metavar="NAME", choices=drives, default=drives[0], help=moves)


GROUPS = (_tables, _derivations, _models, motions, trials, synchrony, sweeps)
