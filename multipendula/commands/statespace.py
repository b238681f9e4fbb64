"""The commands about state-space models: export, gains, response, shaper."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from modal.exports import FORMATS
from multipendula.command import Command
from multipendula.commands.models import add_model_file, add_signals, model_of, scene_at, scene_of
from multipendula.commands.shared import about, draw_in, drawn, estimate_of, listed, noted, output, picture, remark, say
from multipendula.completion import files
from multipendula.options import (
    PICTURES,
    TEXTS,
    Joined,
    add_covariance,
    add_format,
    add_scene,
    add_text,
    add_theme,
    add_words,
    endings,
    number,
    whole,
)
from multipendula.parser import Page

if TYPE_CHECKING:
    from modal.scene import Scene
    from modal.statespace.varying import VaryingModel


def export(options: argparse.Namespace) -> None:
    """Write a state-space model for control software, a simulator or a controller."""
    from modal.errors import SceneError
    from modal.exports import format_named
    from modal.scene import whole_file

    target = format_named(options.to)
    if options.file is None:
        raise SceneError(["-o FILE: is required"])
    scene = scene_at(options)
    about(noted(scene.at(0.0), "a constant linear model"))
    if scene.is_hoisted:
        content = target.write_varying(_varying(scene, options))
        with whole_file(options.file) as stream:
            stream.write(content)
        return
    model = model_of(scene, options)
    if options.discrete:
        from modal.statespace.sampling import sample

        model = sample(model, options.discrete)
    content = target.write(model)
    with whole_file(options.file) as stream:
        stream.write(content)
    if note := target.note(content):
        remark(note)


def _varying(scene: Scene, options: argparse.Namespace) -> VaryingModel:
    """The model along a hoist."""
    from modal.errors import SceneError
    from modal.statespace.varying import varying_model

    asked = [name for name in ("discrete", "minimal", "modes") if getattr(options, name)]
    if asked:
        raise SceneError([f"--{name}: needs constant lengths, and this scene has a hoist" for name in asked])
    return varying_model(scene, None, listed(options.input), listed(options.signals))


def _export_arguments(page: Page) -> None:
    add_scene(page)
    add_signals(page)
    *most, last = FORMATS
    words = f"{', '.join(most)} or {last}"
    add_words(page.written, "--to", (*most, last), comma="", metavar="FORMAT", required=True, help=words)
    words = "the file to write, or - for standard output"
    page.rephrase(r"^format (\S+):", r"--to \1:")
    page.rephrase(r"mat and npz take it$", r"\g<0>, and every format that of one time, --when SECONDS")
    page.rephrase(r"a C header needs a sampled model", "--to c needs --discrete SECONDS")
    add_model_file(page, words, files(()), required=True)
    seconds = number("seconds above 0")
    words = "discretize with this time step, inputs held (zero-order hold)"
    page.asked.add_argument("--discrete", metavar="SECONDS", type=seconds, help=words)
    page.rephrase(r"^step (\S+) s:", r"--discrete \1:")
    smaller = page.asked.add_mutually_exclusive_group()
    smaller.add_argument("--minimal", action="store_true", help="without uncontrollable or unobservable states")
    smaller.add_argument("--modes", metavar="K", type=whole(99999), help="only the K modes that contribute most")
    page.rephrase(r"^(\d+) modes: (?=the model)", r"--modes \1: ")


def gains(options: argparse.Namespace) -> None:
    """Print how well every input reaches each mode and every output sees it."""
    from modal.modes import natural_modes
    from modal.statespace import modal_gains

    scene = scene_of(options, "a constant linear model")
    gains = modal_gains(natural_modes(scene), model_of(scene, options))
    with output(options.file) as write:
        write(gains.text() + "\n")


def _gains_arguments(page: Page) -> None:
    add_scene(page)
    add_signals(page)
    add_model_file(page, "write to this file instead of standard output (-)", files(()))


def response(options: argparse.Namespace) -> None:
    """Draw a Bode plot or an impulse response, or print the response at given frequencies."""
    from math import pi

    import numpy as np

    from modal.errors import SceneError
    from modal.modes import natural_modes
    from modal.scene import STANDARD, require
    from modal.statespace import impulse_table, response_table, to_modal_form

    in_words = options.impulse and getattr(options, "format_asked", False)
    if not (options.file or options.at or in_words):
        raise SceneError(["give a picture to write, -o FILE, or frequencies to print, --at HERTZ"])
    told = STANDARD if in_words and options.file == STANDARD else None
    capability = "an impulse response" if options.impulse else "a frequency response"
    kind, scene = picture(options.file) if options.file and not told else "", scene_of(options, capability)
    require(scene, capability)
    model = model_of(scene, options)
    inputs, outputs = ([signal.name for signal in signals] for signals in (model.inputs, model.outputs))
    source, shown = options.source or inputs[0], listed(options.of)
    problems = [f"--from {source}: must be one of {', '.join(inputs)}"] if source not in inputs else []
    problems += [f"--of {name}: must be one of {', '.join(outputs)}" for name in shown if name not in outputs]
    if problems:
        raise SceneError(problems)
    if options.impulse and options.covariance:
        raise SceneError(["--covariance: gives a band to the Bode plot and to --at, not to --impulse"])
    estimate = estimate_of(scene, options.covariance)
    form, at = to_modal_form(natural_modes(scene), model), inputs.index(source)
    std = None
    if estimate is not None:
        from functools import partial

        from modal.identification import magnitude_std

        std = partial(magnitude_std, model, estimate)
    chosen = [outputs.index(name) for name in shown]
    if options.at:
        every = chosen or list(range(len(outputs)))
        spread = None if std is None else std(2 * pi * np.asarray(options.at))
        say(response_table(form, options.at, at, every, options.format, spread), options.format)
    if in_words:
        with output(told) as write:
            write(impulse_table(form, at, chosen or list(range(len(outputs))), options.format))
    if options.file and not told:
        from modal.plotting import draw_bode, draw_impulse

        with drawn(options.file, options.theme) as stream:
            if options.impulse:
                draw_impulse(form, stream, source=at, outputs=chosen, kind=kind)
            else:
                draw_bode(form, stream, source=at, outputs=chosen, kind=kind, std=std)


def _response_arguments(page: Page) -> None:
    add_scene(page)
    add_covariance(page, "adds standard deviations of magnitudes, in the picture a band of two to either side")
    add_signals(page)
    formats = ("text", "csv", "json")
    page.reports = {f".{TEXTS[form]}": form for form in formats}
    kinds = (*endings(PICTURES), *page.reports)
    words = f"the figure or the numbers as a {', '.join(kinds[:-1])} or {kinds[-1]} file, or - for standard output"
    add_model_file(page, words, files(kinds))
    add_theme(page)
    words = "print magnitude and phase at these frequencies in Hz, separated by commas"
    page.asked.add_argument("--at", metavar="HERTZ", action=Joined, type=_frequencies, help=words)
    add_format(page, formats, help="of what --at prints, and of --impulse in numbers")
    page.asked.add_argument("--from", dest="source", metavar="NAME", help="one input (default: the first)")
    page.asked.add_argument("--of", metavar="NAMES", action=Joined, help="outputs, one or more (default: all)")
    page.rephrase(r"choose at most \d+ outputs$", r"\g<0> with --of")
    words = "the impulse response instead of the Bode plot"
    page.asked.add_argument("--impulse", action="store_true", help=words)


def _frequencies(text: str) -> list[float]:
    return [number("hertz above 0")(part) for part in text.split(",")]


def shaper(options: argparse.Namespace) -> None:
    """Print an input shaper that suppresses residual swing in the slowest modes of a crane."""
    from modal.errors import SceneError
    from modal.report import csv_rows, folded
    from modal.scene import load
    from modal.statespace import shaper_for, swing_words, usual_drive

    scene = noted(load(options.scene), "a shaper")
    drive = options.drive or usual_drive(scene)
    estimate = estimate_of(scene, options.covariance)
    step, tolerance = options.discrete or 0.0, options.tolerance / 100
    found = shaper_for(scene, options.count, options.kind, drive, step=step, tolerance=tolerance)
    remarks = list(swing_words(scene, options.count, drive))
    if estimate is not None:
        from modal.identification import shaped_modes

        shaped = shaped_modes(found, estimate, drive, options.count)
        remarks += [left.words(number) for number, left in enumerate(shaped, 1)]
    if scene.is_hoisted:
        from modal.statespace.hoisting import residual_words

        remarks += residual_words(scene, options.count, options.kind, drive, found)
    is_picture = options.output is not None and options.output.lower().endswith(endings(PICTURES))
    if options.travel is None and (is_picture or options.over is not None):
        raise SceneError([f"{'-o ' + options.output if is_picture else '--over'}: needs --travel METRES"])
    if options.travel is not None:
        from modal.statespace.travels import shaped_travel

        travel = shaped_travel(scene, found, options.travel, options.over, drive)
        remarks += list(travel.words())
        if is_picture:
            draw_in(options, options.output, "modal.plotting", "draw_travel", travel)
    impulses = zip(found.times.tolist(), found.amplitudes.tolist(), strict=True)
    with output(None if is_picture else options.output) as write:
        write("".join(folded(f"# {words}", mark="# ") + "\n" for words in remarks))
        write(csv_rows([("time_s", "amplitude"), *impulses]))


def _shaper_arguments(page: Page) -> None:
    add_scene(page)
    add_covariance(page, "adds what the shaped command leaves over the band of the fitted numbers")
    words = "zvd and ei tolerate more error in the frequencies; um is the shortest, with impulses of both signs"
    page.asked.add_argument("--kind", choices=("zv", "zvd", "ei", "um"), default="zv", help=words)
    words = "impulses at multiples of this time step, the sample time of the controller"
    page.asked.add_argument("--discrete", metavar="SECONDS", type=number("seconds above 0"), help=words)
    page.rephrase(r"^a step of (\S+) s", r"--discrete \1")
    words = "percent of residual swing that ei allows (default 5)"
    percent = number("percent above 0 and at most 50", most=50.0)
    page.asked.add_argument("--tolerance", metavar="PERCENT", type=percent, default=5.0, help=words)
    words = "for the K slowest modes (default 1)"
    page.asked.add_argument("--count", metavar="K", type=whole(99999), default=1, help=words)
    drives = ("cart_acceleration", "cart_velocity", "cart_force")
    words = (
        "what moves the cart: cart_acceleration (default), cart_velocity or cart_force; of a structure the force on "
        "one of its coordinates (default the first), as ship_sway_force"
    )
    add_words(page.asked, "--drive", drives, comma="", metavar="NAME", help=words)
    page.rephrase(r"^drive = '(\S+)':", r"--drive \1:")
    words = "what it moves travels so far, smoothly: tell the swing that is left with and without the shaper"
    page.asked.add_argument("--travel", metavar="METRES", type=number("metres above 0"), help=words)
    words = "duration of the travel (default that of a hoist, else with a tenth of gravity's acceleration)"
    page.asked.add_argument("--over", metavar="SECONDS", type=number("seconds above 0"), help=words)
    page.rephrase(r"^distance (\S+):", r"--travel \1:")
    page.rephrase(r"^duration (\S+):", r"--over \1:")
    add_text(page, pictures=True)
    add_theme(page)


COMMANDS = (
    Command(
        name="export",
        topic="control",
        run=export,
        arguments=_export_arguments,
        details=(
            "z' = A z + B u, y = C z + D u about the scene's equilibrium, with a name and a unit for every state, "
            "input and output; discretized with --discrete. Of a scene with a hoist, A and B are sampled along it (npz "
            "and mat only)."
        ),
        examples=(
            ("export crane-hook --to mat -o crane.mat", "for MATLAB and Octave"),
            (
                "export crane-hook --to control --input cart_acceleration -o crane.py",
                "for python-control, with prescribed cart motion",
            ),
            (
                "export crane-hook --to c --discrete 0.01 --input cart_acceleration --signals angles -o crane.h",
                "for a controller that samples at 100 Hz",
            ),
            ("export paper-cart-3 --to json --minimal -o small.json", "the controllable part: 6 states of 14"),
        ),
    ),
    Command(
        name="gains",
        topic="control",
        run=gains,
        arguments=_gains_arguments,
        details=(
            "Degrees of controllability and observability instead of ranks: the gain of every mode from each input and "
            "to each output, relative to the largest gain of that signal."
        ),
        examples=(
            ("gains crane-two-loads", "how well a force on the trolley reaches each mode"),
            ("gains crane-two-loads --signals cart_position", "which modes the trolley's position alone observes"),
        ),
    ),
    Command(
        name="response",
        topic="control",
        run=response,
        arguments=_response_arguments,
        details=(
            "Magnitude and phase of every output for one input, right however far from the modes, or the impulse "
            "response in closed form. Peaks of damped modes have their true height; below the picture is where "
            "infinite ones are cut."
        ),
        examples=(
            ("response crane-hook -o bode.png", "every output of the crane"),
            (
                "response crane-hook --input cart_acceleration --of theta_1_2 -o load.png",
                "one output, with prescribed trolley motion",
            ),
            (
                "response crane-hook --input 'force:pendulum[0].links[1]' --at 0.1,0.3",
                "to wind on the load: a force at a point",
            ),
            ("response crane-hook --impulse -o impulse.svg", "after an impulse on the trolley; .csv for its numbers"),
            ("response crane-hook --at 0.1,0.3,1 --format json", "numbers instead of a picture"),
        ),
    ),
    Command(
        name="shaper",
        topic="control",
        run=shaper,
        arguments=_shaper_arguments,
        details=(
            "Impulses to convolve a command with, so that the load hangs still at the end of a move (Singer & Seering "
            "1990). The output lists their times and their amplitudes, which sum to one."
        ),
        examples=(
            ("shaper crane-hook", "for the slowest mode"),
            ("shaper crane-hook --kind zvd --count 2", "for both modes, tolerant of errors in cable length"),
            ("shaper crane-hook --kind ei --discrete 0.02", "for a controller that samples at 50 Hz"),
            ("shaper crane-hook --travel 20 -o before_after.png", "a picture of the swing with and without the shaper"),
        ),
    ),
)
