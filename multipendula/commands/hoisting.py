"""The command about ropes that change their length: hoist."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

import modal
from multipendula.command import SCENE, Command, formats, option, refuse, report_file
from multipendula.commands.shared import draw_in, made, noted, picture, remark, say
from multipendula.completion import words
from multipendula.options import integer

if TYPE_CHECKING:
    from modal.statespace.hoisting import Along, Residual, TravelLimits


LIMITS = (
    "--max-acceleration: the travel takes the shortest time",
    "--max-speed, with --max-acceleration: trapezoidal speed",
    "--max-jerk, with --max-acceleration: an S-curve of speed",
)
"""The options that limit a travel."""


def limits_of(options: argparse.Namespace) -> TravelLimits | None:
    """The limits within which the cart travels, None if there are none; SceneError for options that do not fit."""
    from math import inf

    from modal.statespace.hoisting import TravelLimits

    limits = "--max-speed", "--max-acceleration", "--max-jerk"
    if options.travel is None:
        refuse(options, "needs --travel METRES", "--over", *limits)
    if isinstance(options.travel, str):
        refuse(options, f"cannot be combined with --travel {options.travel}, a travel over time", "--over", *limits)
    if options.max_acceleration is None:
        refuse(options, "needs --max-acceleration", "--max-speed", "--max-jerk")
        return None
    refuse(options, "cannot be combined with --max-acceleration, at which a travel takes the shortest time", "--over")
    step = getattr(options, "discrete", None) or 0.0
    return TravelLimits(options.max_acceleration, options.max_speed or inf, options.max_jerk or inf, step)


BESIDE = "--drive cart_acceleration lists the modes with the cart's motion prescribed"
DRIVES = ("cart_force", "cart_acceleration")


def hoist(options: argparse.Namespace) -> Along | None:
    """Print lengths and frequencies along a hoist, and the residual swing after combined hoisting and travel.

    For a scene in which ropes change their length: the lengths and the frequencies at each time, and how a slow
    hoist changes the swing of each mode. With --travel the linear model, which varies in time, is integrated for a
    cart that travels meanwhile, with and without an input shaper.

    Examples
    --------
    hoist hoisting-crane
        frequencies of the shipped crane along its hoist
    hoist hoisting-crane --travel 10 --kind zvd
        the residual swing after a travel of 10 m, with and without shapers
    hoist hoisting-crane --travel 10 --max-speed 1.5 --max-acceleration 0.4
        a travel at the speed and the acceleration of the drive
    hoist hoisting-crane --format csv -o hoist.png
        numbers, and a picture
    """
    from modal.statespace.hoisting import Travel, frequencies_along, travel_residuals

    picture(options.output)
    limits = limits_of(options)
    if options.travel is None:
        refuse(options, "needs --travel METRES", "--kind", "--count")
    if options.travel and options.drive == DRIVES[0]:
        raise modal.SceneError(
            [f"--drive {options.drive}: a travel prescribes the motion of its cart: leave out --travel"]
        )
    scene = modal.load(options.scene)
    noted(scene.at(0.0), "mode shapes")
    drive = options.drive or DRIVES[bool(options.travel)]
    along = frequencies_along(scene, options.samples, drive)
    left: tuple[Residual, ...] = ()
    if options.travel:
        travel = Travel.along(scene, options.travel, options.over, limits)
        left = travel_residuals(scene, travel, kind=options.kind or "zv", count=options.count or 1)
    say(_written(along, left, options), options.format)
    if name := getattr(options, "format_words", "").removeprefix("-o "):
        remark(f"{name}: {along.main_figures(left)}")
    if options.output and options.travel:
        from modal.statespace import shaper_for
        from modal.statespace.travels import shaped_travel

        start = along.times[0]
        shaper = shaper_for(scene.at(start), options.count or 1, options.kind or "zv")
        shaped = shaped_travel(scene, shaper, options.travel, options.over, limits=limits)
        draw_in(options, options.output, "modal.plotting", "travel_figure", shaped)
        _made(options, f"the travel of {shaped.distance:g} m, unshaped and shaped")
    elif options.output:
        smooth = frequencies_along(scene, max(options.samples, 201), drive)
        draw_in(options, options.output, "modal.plotting", "hoist_figure", smooth)
        _made(options, "lengths, frequencies and swing along the hoist")
    return None if left else along


def _made(options: argparse.Namespace, words: str) -> None:
    if options.format == "text":
        made(options.output, words)


def _written(along: Along, left: tuple[Residual, ...], options: argparse.Namespace) -> str:
    """The table in the format requested."""
    from math import degrees

    if options.format == "text":
        return along.report("text", left=left, beside=BESIDE)
    if options.format == "json":
        return along.report("json", left=left)
    head = (f"# residual swing {degrees(residue.angle)!r} deg: {residue.words}\n" for residue in left)
    return "".join(head) + along.report("csv")


COMMANDS = (
    Command(
        topic="control",
        run=hoist,
        main=("--travel", "--over", "--kind", "--samples", "--output"),
        takes=(
            SCENE,
            option("--samples, along the hoist (default 11)", group="asked", type=integer(10_000), default=11),
            option(
                "--drive: cart_force (default), the frequencies with the cart free; or cart_acceleration (default with "
                "--travel), with its motion prescribed",
                completion=words(DRIVES, ""),
                choices=DRIVES,
            ),
            "--travel, smoothly from the beginning of the hoist, or the CSV file of a travel; reports the residual "
            "swing",
            "--over (default that of the hoist)",
            *LIMITS,
            "--kind of the travel (default zv)",
            "--count (default 1)",
            formats("text", "csv", "json"),
            *report_file("text", "csv", "json"),
        ),
    ),
)
