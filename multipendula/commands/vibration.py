"""The command about a moving support at small angles: vibration, at random or by a record, and thermal noise."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import modal
from multipendula.command import SCENE, Command, option, picture_file, refuse, text_file
from multipendula.commands.shared import about, draw_in, listed, noted, output, picture_in_place, remark
from multipendula.completion import words

if TYPE_CHECKING:
    from modal.scene import Scene
    from modal.vibration import RandomResponse, ShockResponse, ThermalNoise

COLUMNS = "HEADING=COLUMN, such as t=time_ms"
"""The message on a wrong --column."""
USUAL = "support_acceleration"
OUTPUTS = (
    *("angles", "tip_accelerations", "rates", "relative_angles", "relative_rates", "joint_positions"),
    *("tip_positions", "cart_position", "cart_velocity", "pivot_forces"),
    *("coordinates", "coordinate_rates", "coordinate_accelerations", "spring_forces", "spring_extensions"),
)
WRITTEN = (
    option(f"--signals: angles,tip_accelerations (default), {', '.join(OUTPUTS[2:])}", completion=words(OUTPUTS)),
    *text_file("text", "csv", "json", drawn=True),
    *picture_file(),
)
"""The outputs of the model, and the files."""


def vibration(options: argparse.Namespace) -> RandomResponse | ThermalNoise | ShockResponse | None:
    """Compute the response to a shaking support or a force, at random or by a record, and thermal noise.

    In closed form over the modes, at small angles. The PSD is interpolated by straight lines over logarithmic axes
    and is zero outside its frequencies. The RMS of each mode alone is compared with Miles' equation; an undamped
    mode that the noise excites has no finite RMS. CSV and JSON contain the PSDs. With --temperature, the thermal
    noise of dampers, drag and loss angles by the fluctuation-dissipation theorem, of tip_positions by default. A
    --record is interpolated by a spline, and every mode is followed exactly through it and for two of the slowest
    periods after it: peaks by output and by mode, those of the modes combined by SRSS and CQC, and the effective
    masses with the number of modes that account for 90 % of the mass.

    Examples
    --------
    vibration damped-suspension --psd ground.csv
        a shipped scene on quiet ground, whose spectrum is shipped too
    vibration tower --record quake.csv --baseline velocity --picture shock.png
        peaks in an earthquake, without drift (a shipped record)
    vibration suspension --temperature 290 --at 1,10,100
        the thermal noise of the shipped suspension, by wire
    vibration damped-suspension --psd ground.csv --signals tip_positions --picture psd.png
        how the mirror moves in the laboratory, with a figure
    """
    from modal.vibration import random_report

    if options.record is not None:
        return _shock(options)
    refuse(options, "needs --record CSV", "--baseline")
    if options.temperature is not None:
        return _thermal(options)
    if options.psd is None:
        raise modal.SceneError(["give --psd CSV, --temperature KELVIN, or both; or --record CSV"])
    if options.at:
        raise modal.SceneError(["--at: applies to thermal noise: give --temperature KELVIN"])

    response: RandomResponse = _report(options, partial(_random, options), random_report, "random_figure")
    return response


def _white_level(text: str, unit: str) -> float:
    """A number above 0, or 0 for the name of a file; SceneError for any other number."""
    try:
        level = float(text)
    except ValueError:
        return 0.0
    if not 0 < level < float("inf"):
        raise modal.SceneError(
            [f"--psd {text}: must be a number of {unit} above 0, or a file with frequency_hz and psd"]
        )
    return level


def _random(options: argparse.Namespace, scene: Scene, **outputs: tuple[str, ...]) -> RandomResponse:
    """The response to the PSD in a file, or of a number to a white one over the band of the modes, as reported."""
    from os.path import exists

    from modal.scene.records import read_spectrum
    from modal.scene.tables import parse_where
    from modal.vibration import random_response
    from modal.vibration.random import white_spectrum

    supports = options.input == USUAL
    unit = "(m/s²)²/Hz" if supports else "N²/Hz"
    level = 0.0 if exists(options.psd) else _white_level(options.psd, unit)
    if level:
        refuse(options, f"names columns of a file, and --psd {options.psd} is a number", "--column")
    spectrum = (
        white_spectrum(scene, level)
        if level
        else read_spectrum(options.psd, not supports, columns=parse_where(options.column or (), COLUMNS))
    )
    response = random_response(scene, spectrum, source=options.input, **outputs)
    if level:
        low, high = spectrum.frequency_hz
        band = "a third of the slowest mode to three times the fastest"
        remark(f"a white PSD of {level:g} {unit} from {low:.4g} to {high:.4g} Hz, {band}")
    return response


def _thermal(options: argparse.Namespace) -> ThermalNoise | None:
    """The thermal noise, with the response to a PSD next to it where there is one."""
    from modal.vibration import thermal_noise, thermal_report
    from modal.vibration.random import INPUT

    if options.psd is None and options.input != INPUT:
        raise modal.SceneError([f"--input {options.input}: is the input of a PSD: give --psd CSV"])
    picture_in_place(options)
    scene = about(noted(modal.load(options.scene), "thermal noise"))
    outputs = listed(options.signals) or ("tip_positions",)
    noise, beside = thermal_noise(scene, options.temperature, outputs), None
    if options.psd is not None:
        beside = _random(options, scene, outputs=outputs)
    at = options.at or ()
    draw_in(options, options.picture, "modal.plotting.vibration", "thermal_figure", noise, beside, at)
    with output(options.output) as write:
        write(thermal_report(noise, options.format, beside, at))
    return None if beside or at else noise


def _shock(options: argparse.Namespace) -> ShockResponse:
    """The response of every mode and output to a record of the support's motion, and its peaks."""
    from modal.scene.records import read_record
    from modal.scene.tables import parse_where
    from modal.vibration import shock_report, shock_response

    refuse(options, "cannot be combined with --record", "--psd", "--temperature", "--at", "--input")
    columns = parse_where(options.column or (), COLUMNS)

    def respond(scene: Scene, **outputs: tuple[str, ...]) -> Any:
        motion = modal.scene.RecordMotion(**read_record(options.record, columns=columns), baseline=options.baseline)
        return shock_response(scene, motion, **outputs)

    response: ShockResponse = _report(options, respond, shock_report, "shock_figure")
    return response


def _report(
    options: argparse.Namespace, respond: Callable[..., Any], written: Callable[[Any, Any], str], figure: str
) -> Any:
    """The response of the scene as a report and as a picture, whose name is judged before anything is computed."""
    picture_in_place(options)
    scene = about(noted(modal.load(options.scene)))
    response = respond(scene, **({"outputs": listed(options.signals)} if options.signals else {}))
    draw_in(options, options.picture, "modal.plotting.vibration", figure, response)
    with output(options.output) as write:
        write(written(response, options.format))
    return response


COMMANDS = (
    Command(
        topic="control",
        run=vibration,
        main=("--psd", "--record", "--temperature", "--signals", "--output"),
        takes=(
            SCENE,
            "--psd of the support's motion along the rail, with frequency_hz, and psd in (m/s²)²/Hz or velocity_psd or "
            "displacement_psd; of a force, with psd in N²/Hz, where --input names one; or a number, white noise",
            "--temperature, reported with a budget by place; with that of the PSD where there is a --psd",
            "--at: the thermal noise (default some over its band)",
            "--record: time_s, and displacement_m, velocity_m_per_s or acceleration_m_per_s2 of the support",
            "--column of the --record or the --psd: t=time_ms, quake=acceleration_g; repeat for several",
            "--baseline, with --record (default keep): velocity removes a constant acceleration so that the support "
            "ends with the velocity it began with",
            option(
                "--input: the one that the PSD is of, support_acceleration (default), cart_force, on a structure the "
                "force on a coordinate, such as floor2_force, force:POINT, lift:POINT or torque:POINT, with a POINT "
                "such as pendulum[0].links[1]@0.5, or force[0] of the scene",
                completion=words((USUAL, "cart_force", "force:", "lift:", "torque:", "force[0]")),
                default=USUAL,
            ),
            *WRITTEN,
        ),
    ),
)
