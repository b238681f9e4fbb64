"""The commands about state-space models: export, response, shaper."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import TYPE_CHECKING

import modal
import nonlinear
from modal.exports import FORMATS, format_of_file
from multipendula.command import (
    SCENE,
    Command,
    file_beside,
    formats,
    main_file,
    option,
    picture_file,
    refuse,
    report_file,
    text_file,
)
from multipendula.commands.hoisting import LIMITS, limits_of
from multipendula.commands.shared import (
    about,
    draw_in,
    estimate_of,
    is_new,
    large,
    listed,
    made,
    noted,
    output,
    picture,
    picture_in_place,
    remark,
    say,
)
from multipendula.completion import extensions, words

if TYPE_CHECKING:
    from modal.scene import Scene
    from modal.statespace import Signal, StateSpace
    from modal.statespace.modal_form import Gains
    from modal.statespace.sampling import VaryingModel
    from modal.statespace.shapers import Shaper
    from modal.statespace.travels import ShapedTravel

SIGNALS_MAX = 6
"""Format: signals of a model that are named."""

OUTPUTS = (
    *("cart_position", "cart_velocity", "angles", "rates", "relative_angles", "relative_rates"),
    *("joint_positions", "tip_positions", "tip_accelerations", "pivot_forces"),
    *("coordinates", "coordinate_rates", "coordinate_accelerations", "spring_forces", "spring_extensions"),
)
"""The groups of outputs of a model."""
INPUTS = (
    *("cart_force", "cart_acceleration", "cart_velocity", "joint_torques", "link_forces", "coordinate_forces"),
    *("support_displacement", "support_velocity", "support_acceleration", "force:", "lift:", "torque:", "force[0]"),
)
SIGNALS = (
    option(
        "--input: cart_acceleration (default on a cart), cart_force (default on one that a spring holds) or "
        "cart_velocity; coordinate_forces (default on a structure) or one of them, such as floor2_force; joint_torques "
        "(default on a fixed support), link_forces; support_displacement, support_velocity or support_acceleration; "
        "force:POINT, lift:POINT or torque:POINT, with a POINT such as pendulum[0].links[1]@0.5 or ship@0.2,0.1; "
        "force[0], the scene's first force",
        completion=words(INPUTS),
    ),
    option(
        "--signals: cart_position,angles (default), cart_velocity, rates, relative_angles, relative_rates, "
        "joint_positions, tip_positions, tip_accelerations, pivot_forces; of a structure coordinates,angles (default), "
        "coordinate_rates, coordinate_accelerations, spring_forces, spring_extensions, or single ones, such as "
        "floor2_m",
        completion=words(OUTPUTS),
    ),
    "--when",
)
"""The groups of inputs and outputs of a model, and the time of a hoist."""


def export(options: argparse.Namespace) -> StateSpace | VaryingModel:
    """Write a state-space model for control software, a simulator or a controller.

    z' = A z + B u, y = C z + D u about the scene's equilibrium, with a name and a unit for every state, input and
    output; discretized with --discrete. For a scene with a hoist, A and B are sampled along it (control, mat and
    npz only). With --start the model is that of deviations from the motion through a state.

    Examples
    --------
    export crane-hook -o crane.mat
        for MATLAB and Octave
    export crane-hook --input cart_force -o crane.py
        for python-control, with a trolley that a force moves
    export crane-hook --discrete 0.01 --signals angles -o crane.h
        for a controller that samples at 100 Hz
    export crane-hook --start angles:30,-20 -o leaning.json
        about a leaning state, for gain scheduling
    export paper-cart-3 --minimal -o small.json
        the controllable part: 6 states of 14
    """
    from modal.exports import find_format

    target = find_format(_format(options))
    name = options.output or file_beside(options.scene, target.extension)
    model = _model_for(options)
    content = target.content(model, is_varying=not hasattr(model, "dt"))
    with modal.scene.whole_file(name) as stream:
        stream.write(content)
    inputs, outputs = map(_listed, (model.inputs, model.outputs))
    made(name, f"{len(model.states)} states; input {inputs}; output {outputs}")
    if note := target.note(content):
        remark(note)
    return model


def _model_for(options: argparse.Namespace) -> StateSpace | VaryingModel:
    """The model at rest, at a state, along a hoist or along a run."""
    scene = scene_at(options)
    if options.start or options.along:
        return _in_motion(scene, options)
    about(noted(scene.at(0.0), "a constant linear model"))
    return _varying(scene, options) if scene.is_hoisted else _sampled(model_of(scene, options), options)


def _in_motion(scene: Scene, options: argparse.Namespace) -> StateSpace | VaryingModel:
    """The model at the state of --start, or along the run of --along."""
    from modal.exports.text import is_moving
    from multipendula.commands.runs import start_of
    from nonlinear.postprocessing.models import model_at, models_along

    modal.scene.require(scene, "a model along a motion")
    word = "--along" if options.along else "--start"
    refuse(options, f"needs the equilibrium: it cannot be combined with {word}", "--minimal", "--dominant")
    signals = inputs_of(scene, options), listed(options.signals)
    if options.along:
        refuse(options, "needs one model: it cannot be combined with --along", "--discrete", "--start")
        run = nonlinear.load(options.along)
        if run.scene != scene:
            raise modal.SceneError([f"--along {options.along}: is not a run of {options.scene}"])
        return models_along(run, *signals)
    start = start_of(scene, options.start)
    model = model_at(scene, nonlinear.initial_state(scene) if start is None else start, *signals)
    if is_moving(model):
        remark(
            "This state is not an equilibrium: the model holds at this instant, for deviations from the motion "
            "through it."
        )
    else:
        frame = ", in the frame of the support that moves" if scene.is_moved else ""
        remark(f"The state stays as it is{frame}: deviations are from it.")
    return _sampled(model, options)


def _format(options: argparse.Namespace) -> str:
    """The format that was requested, or that in which the name of the file ends, which is not that of another."""
    from modal.exports import find_format

    by_name = format_of_file(options.output or "")
    if options.to is None and not by_name:
        every = [form.extension for form in FORMATS.values()]
        ends = f"the name must end in {', '.join(every[:-1])} or {every[-1]}"
        asked = f"-o {options.output}: {ends}" if options.output else f"-o FILE: is required, and {ends}"
        raise modal.SceneError([f"{asked}; or give --to FORMAT"])
    if options.to and options.output != modal.scene.STANDARD and is_new(options.output):
        extension = find_format(options.to).extension
        if not options.output.lower().endswith(extension[extension.rindex(".") :]):
            raise modal.SceneError(
                [f"-o {options.output}: the name must end in {extension}, that of --to {options.to}"]
            )
    return str(options.to or by_name)


def _sampled(model: StateSpace, options: argparse.Namespace) -> StateSpace:
    if not options.discrete:
        return model
    from modal.statespace.sampling import sample

    return sample(model, options.discrete)


def _listed(signals: Sequence[Signal]) -> str:
    """Signals with their units, of many the first."""
    named = [f"{signal.name} ({signal.unit})" for signal in signals]
    return ", ".join(
        named if len(named) <= SIGNALS_MAX + 1 else [*named[:SIGNALS_MAX], f"… {len(named) - SIGNALS_MAX} more"]
    )


def _varying(scene: Scene, options: argparse.Namespace) -> VaryingModel:
    """The model along a hoist."""
    from modal.statespace.sampling import varying_model

    refuse(options, "needs constant lengths, and this scene has a hoist", "--discrete", "--minimal", "--dominant")
    return varying_model(scene, None, inputs_of(scene, options), listed(options.signals))


def response(options: argparse.Namespace) -> Gains | None:
    """Print peaks, values at frequencies, or the gains of every mode, or draw a Bode plot or an impulse response.

    Where every output is largest near each mode; in a picture magnitude and phase of every output for one input,
    accurate at any distance from the modes, or the impulse response in closed form. Peaks of damped modes have
    their true height; a note below the picture says where infinite ones are cut. With --gains, degrees of
    controllability and observability in place of ranks: the gain of every mode from each input and to each output,
    relative to the largest for that signal. With --lqr, the gains K of u = -K z that minimize the integral of the
    squared states and inputs, each relative to its own scale (Bryson's rule).

    Examples
    --------
    response crane-two-loads
        peaks of every output of a crane
    response crane-hook --of theta_1_2 -o bode.png
        the Bode plot of one output; without --of, of every one
    response crane-hook --input cart_force --gains --lqr -o K.csv
        gains of a regulator for trolley and load; --weights sets its speed
    response crane-hook --input 'force:pendulum[0].links[1]' --at 0.1,0.3
        response to wind on the load: a force at a point
    response crane-hook --impulse -o impulse.svg
        after an impulse on the trolley; .csv for its numbers
    """
    from math import pi

    import numpy as np

    from modal.statespace import impulse_table, response_table, to_modal_form
    from modal.statespace.response import peaks_table

    if options.lqr or options.weights:
        _regulator(options)
        return None
    if options.gains:
        return _gains(options)
    in_words = options.impulse and (getattr(options, "format_asked", False) or not options.output)
    told = modal.scene.STANDARD if in_words and options.output == modal.scene.STANDARD else None
    capability = "an impulse response" if options.impulse else "a frequency response"
    if not told:
        picture(options.output)
    scene = scene_of(options, capability)
    modal.scene.require(scene, capability)
    model = model_of(scene, options)
    inputs, outputs = ([signal.name for signal in signals] for signals in (model.inputs, model.outputs))
    source, shown = options.source or inputs[0], listed(options.of)
    problems = [f"--from {source}: must be one of {', '.join(inputs)}"] if source not in inputs else []
    problems += [f"--of {name}: must be one of {', '.join(outputs)}" for name in shown if name not in outputs]
    if problems:
        raise modal.SceneError(problems)
    if options.covariance and (options.impulse or not (options.at or options.output)):
        raise modal.SceneError(
            ["--covariance: gives a band to the Bode plot of -o and to --at, not to --impulse or peaks"]
        )
    estimate = estimate_of(scene, options.covariance)
    form, at = to_modal_form(modal.natural_modes(scene), model), inputs.index(source)
    std = None
    if estimate is not None:
        from functools import partial

        from modal.identification import magnitude_std

        std = partial(magnitude_std, model, estimate)
    chosen = [outputs.index(name) for name in shown]
    every = chosen or list(range(len(outputs)))
    if not (options.at or options.output or in_words):
        say(peaks_table(form, at, every, options.format), options.format)
    if options.at:
        spread = None if std is None else std(2 * pi * np.asarray(options.at))
        say(response_table(form, options.at, at, every, options.format, spread), options.format)
    if in_words:
        with output(told) as write:
            write(impulse_table(form, at, every, options.format))
    if options.output and not told:
        figure, how = ("impulse_figure", {}) if options.impulse else ("bode_figure", {"std": std})
        draw_in(options, options.output, "modal.plotting", figure, form, source=at, outputs=chosen, **how)
        if options.format == "text":
            what = "impulse response" if options.impulse else "Bode plot"
            made(options.output, f"{what} of {', '.join(shown or outputs)} for {source}")

    return None


def _gains(options: argparse.Namespace) -> Gains:
    """How well every input reaches each mode and every output sees it."""
    from modal.statespace import modal_gains

    refuse(options, "cannot be combined with --gains", "--covariance", "--at", "--from", "--of", "--impulse")
    if options.format != "text" or options.output not in {None, modal.scene.STANDARD}:
        words = getattr(options, "format_words", f"-o {options.output}" if options.output else "--format")
        raise modal.SceneError([f"{words}: gains are text: give a file that ends in .txt"])
    scene = scene_of(options, "a constant linear model")
    gains = modal_gains(modal.natural_modes(scene), model_of(scene, options))
    with output(options.output) as write:
        write(gains.text())
    return gains


def _regulator(options: argparse.Namespace) -> None:
    """Write the gains of the linear-quadratic regulator as CSV."""
    from modal.statespace.regulator import regulator

    if not (options.gains and options.lqr):
        raise modal.SceneError(["--lqr: needs --gains" if options.lqr else "--weights: needs --gains --lqr"])
    refuse(options, "cannot be combined with --lqr", "--covariance", "--at", "--from", "--of", "--impulse", "--signals")
    if options.output not in {None, modal.scene.STANDARD} or options.format == "json":
        words = getattr(options, "format_words", f"-o {options.output}" if options.output else "--format")
        raise modal.SceneError([f"{words}: gains of a regulator are CSV: give a file that ends in .csv"])
    files = listed(options.weights)
    if options.weights and len(files) != 2:
        raise modal.SceneError([f"--weights {options.weights}: must be two files, Q.csv,R.csv"])
    scene = scene_of(options, "a constant linear model")
    if scene.feedback:
        remark("The scene's feedback is ignored: the regulator is designed for the open loop.")
    design = regulator(scene, listed(options.input), (files[0], files[1]) if files else None)
    with output(options.output) as write:
        write(design.csv())
    remark(design.words())


def shaper(options: argparse.Namespace) -> Shaper:
    """Print an input shaper that suppresses residual swing in the slowest modes of a crane, or its shaped travel.

    Impulses to convolve a command with, so that the load hangs still at the end of a move (Singer & Seering 1990).
    The output lists their times and their amplitudes, which sum to one. With --travel, a CSV file contains the
    shaped travel: time, position, speed and acceleration of the trolley, as the motion of a support and hoist
    --travel read them, or the force that moves it.

    Examples
    --------
    shaper crane-hook
        for the slowest mode
    shaper crane-hook --kind zvd --count 2
        for both modes, tolerant of errors in cable length
    shaper crane-hook --kind ei --discrete 0.02
        for a controller that samples at 50 Hz
    shaper crane-hook --kind zvd --travel 20 --max-speed 1.5 --max-acceleration 0.4 -o profile.csv
        a trapezoid of the speed, shaped, as samples
    shaper crane-hook --range 'pendulum[0].links[0].length=8:14'
        for every length of the rope between 8 and 14 m
    """
    from modal.report import csv_rows, folded
    from modal.statespace import swing_words, usual_drive

    picture_in_place(options)
    limits = limits_of(options)
    if options.travel is None:
        refuse(options, "needs --travel METRES", "--picture")
    if options.output and not options.output.lower().endswith((".csv", ".txt")):
        raise modal.SceneError([f"-o {options.output}: the name must end in .csv or .txt"])
    scene = noted(modal.load(options.scene), "a shaper")
    drive = options.drive or usual_drive(scene)
    estimate = estimate_of(scene, options.covariance)
    shaped_command, promise = _shaper(scene, drive, options)
    assumption, *modes = swing_words(scene, options.count, drive)
    remarks = [assumption if drive in assumption else f"{drive}: {assumption}", *modes, *promise]
    if estimate is not None:
        from modal.identification import shaped_modes

        shaped = shaped_modes(shaped_command, estimate, drive, options.count)
        remarks += [left.words(number) for number, left in enumerate(shaped, 1)]
    if scene.is_hoisted:
        from modal.statespace.hoisting import residual_words

        remarks += residual_words(scene, options.count, options.kind or "zv", drive, shaped_command)
    columns: dict[str, Sequence[float]] = {
        "time_s": shaped_command.times.tolist(),
        "amplitude": shaped_command.amplitudes.tolist(),
    }
    if options.travel is not None:
        from modal.statespace.travels import shaped_travel

        travel = shaped_travel(scene, shaped_command, options.travel, options.over, drive, limits)
        remarks += list(travel.words(_in_full(travel)))
        draw_in(options, options.picture, "modal.plotting", "travel_figure", travel)
        if (options.output or "").lower().endswith(".csv"):
            profile = travel.columns(step=options.discrete or 0.0)
            columns = {name: values.tolist() for name, values in profile.items()}
            say("".join(f"{words}\n" for words in remarks))
    with output(options.output) as write:
        write("".join(folded(f"# {words}", mark="# ") + "\n" for words in remarks))
        write(csv_rows([tuple(columns), *zip(*columns.values(), strict=True)]))
    return shaped_command


def _shaper(scene: Scene, drive: str, options: argparse.Namespace) -> tuple[Shaper, list[str]]:
    """The shaper, and its guarantee over a range."""
    from modal.statespace import shaper_for

    step, tolerance = options.discrete or 0.0, options.residual / 100
    if not options.range and (options.kind or "zv") not in {"ei", "ei2", "ei3"}:
        refuse(options, "is for --kind ei, ei2 and ei3, and for a --range", "--residual")
    if not options.range:
        return shaper_for(scene, options.count, options.kind or "zv", drive, step=step, tolerance=tolerance), []
    from modal.statespace.insensitive import shaper_over

    refuse(options, "cannot be combined with --range, for which the shortest shaper is found", "--kind")
    made, most = shaper_over(scene, options.range, options.count, drive, step=step, tolerance=tolerance)
    promise = f"{options.range}: at most {100 * most:.4g} % of the swing remains"
    return made, [f"{promise} with the shortest positive impulses, {made.duration:.4g} s long"]


def _in_full(travel: ShapedTravel) -> Sequence[float]:
    """The swing after a travel in the full equations; none, and a note, where these are not integrated."""
    from nonlinear.verification import swing_after

    try:
        return list(swing_after(travel))
    except modal.MultipendulaError as error:
        remark(f"the swing in the full equations could not be computed: {error}")
        return ()


def scene_of(options: argparse.Namespace, capability: str) -> Scene:
    """The scene, with a note on omissions of a capability."""
    return about(large(noted(scene_at(options), capability)))


def scene_at(options: argparse.Namespace) -> Scene:
    """The scene, at the time requested if it has a hoist."""
    scene = modal.load(options.scene)
    if options.when is None:
        return scene
    if not scene.is_hoisted:
        raise modal.SceneError(["--when: this scene has no hoist, so its lengths do not change"])
    return scene.at(options.when)


def model_of(scene: Scene, options: argparse.Namespace) -> StateSpace:
    """The model with the inputs and outputs, and the reduction, given by the options."""
    from modal.statespace import state_space

    inputs, outputs = inputs_of(scene, options), listed(options.signals)
    count = getattr(options, "dominant", None)
    if not getattr(options, "minimal", False) and count is None:
        return state_space(scene, inputs, outputs)
    from modal.statespace import minimal, truncate

    if count is None:
        return minimal(scene, inputs, outputs)
    return truncate(modal.natural_modes(scene), state_space(scene, inputs, outputs), count)


def inputs_of(scene: Scene, options: argparse.Namespace) -> tuple[str, ...]:
    """The inputs that the options name, or that of a shaper of the scene."""
    from modal.statespace import usual_inputs

    return listed(options.input) or usual_inputs(scene)


COMMANDS = (
    Command(
        topic="control",
        run=export,
        main=("--to", "--output", "--input", "--signals", "--discrete"),
        takes=(
            SCENE,
            *SIGNALS,
            option(
                f"--to: {', '.join(list(FORMATS)[:-1])} or {list(FORMATS)[-1]} (default that of --output)",
                completion=extensions("format"),
            ),
            main_file("the model", tuple(form.extension.removeprefix(".") for form in FORMATS.values())),
            "--discrete: the model is discretized, its inputs held between samples (zero-order hold)",
            "--minimal",
            "--dominant",
            "--start, in place of the equilibrium, in the plane: scene, mode:R:DEG, orbit:R:DEG, orbit or "
            "angles:A,B,... (deg, at rest)",
            "--along, a model for each of its times: a run of the scene in the plane (control, mat and npz)",
        ),
    ),
    Command(
        topic="control",
        run=response,
        main=("--output", "--at", "--input", "--signals", "--gains"),
        takes=(
            SCENE,
            "--covariance: adds standard deviations of magnitudes, in the picture a band of two to either side",
            *SIGNALS,
            *report_file("text", "csv", "json"),
            "--at: magnitude and phase",
            formats("text", "csv", "json", more=" of peaks, by --at, and by --impulse in numbers (default text)"),
            option("--from (default the first)", dest="source"),
            option("--of (default all)", keyword="outputs"),
            "--impulse instead",
            "--gains, instead",
            "--lqr, with --gains: written as CSV, which [[feedback]] of a scene takes",
            "--weights of --lqr (default by Bryson's rule, with the scene's own scales)",
        ),
    ),
    Command(
        topic="control",
        run=shaper,
        main=("--kind", "--count", "--travel", "--max-acceleration", "--output"),
        takes=(
            SCENE,
            "--covariance: adds the residual swing over the uncertainty of the fitted numbers",
            "--kind (default zv); mzv, zvd, zvdd, zvddd tolerate growing errors in the frequencies, ei, ei2 and ei3, "
            "with humps, even more; um is the shortest, with impulses of both signs",
            "--range, such as pendulum[0].links[0].length=8:14, in place of --kind",
            "--discrete: impulses come at its multiples, and the samples of a travel",
            "--residual, by ei, ei2, ei3 and over a --range (default 5)",
            option("--count (default 1)", default=1),
            option(
                "--drive: cart_acceleration (default), cart_velocity or cart_force (default of a cart that a spring "
                "holds); of a structure the force on one of its coordinates (default the first), such as "
                "ship_sway_force; export and response have the same default",
                completion=words(("cart_acceleration", "cart_velocity", "cart_force"), ""),
            ),
            "--travel, smoothly, or the CSV file of a travel: reports the residual swing with and without the shaper; "
            "a CSV file has the shaped travel in place of the impulses",
            "--over (default that of the hoist)",
            *LIMITS,
            *text_file(drawn=True),
            *picture_file(),
        ),
    ),
)
