"""The commands about measurements: fit, poles."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import modal
import nonlinear
from multipendula.command import (
    CREW,
    SCENE,
    Command,
    formats,
    kwargs_of,
    main_file,
    option,
    picture_file,
    records,
    refuse,
    report_file,
)
from multipendula.commands.shared import (
    bar,
    crew_of,
    draw_in,
    in_a_folder,
    listed,
    missing,
    noted,
    output,
    picture,
    pictured,
    remark,
    say,
    scene_bytes,
    show,
    write_together,
)

if TYPE_CHECKING:
    from modal.identification import Assurance, Identified, ModeFit
    from modal.scene import Scene
    from nonlinear.identification import Fit, Recording

OF_MOTIONS = (
    "--where",
    "--every",
    "--column",
    "--pixel",
    "--angles",
    "--excitation",
    "--identification",
    "--order",
    "--identified-modes",
)
OF_FITTED_MOTIONS = (
    *("--where", "--every", "--scale", "--shift", "--compare", "--window", "--bootstrap"),
    *("--column", "--pixel", "--angles"),
)
"""Options of `poles` and of `fit` that a file of modes does not take."""


def fit(options: argparse.Namespace) -> Fit | ModeFit | None:
    """Fit parameters to measured motions or modes, with error bars, and report what the data do not determine.

    Sensors are angles, rates, the cart, places of links' ends and accelerations along and across links. The initial
    state of every segment, an offset of each sensor and its delay are fitted along with the free numbers. --free
    same:PLACE is one number for several places, shift:PLACE one that is added to each of theirs. Numbers that the
    data do not determine are held at the scene's values and named. Standard deviations allow for correlated
    residuals, and sentences at the end say what the model lacks. The --workers share the laws of --compare.

    Examples
    --------
    simulate chain-2 --duration 8 -o run.csv
        a motion to fit, in place of a measured one
    fit chain-2 run.csv --free 'pendulum[0].links[0].length' -o fitted.toml --report fit.json
        a length from it: the scene with the fitted number, and its covariance
    fit fitted.toml run.csv --free none
        test a scene as it is: only the start and offsets are fitted
    """
    from modal.identification import has_modes

    if options.free is None:
        raise missing(modal.load(options.scene), "--free", "")
    return (_fit_modes if any(map(has_modes, options.data)) else _fit_motions)(options)


def _fit_modes(options: argparse.Namespace) -> ModeFit:
    from modal.identification import fit_modes, mode_fit_json, mode_fit_text, read_modes

    refuse(options, f"applies to measured motions, and {options.data[0]} contains modes", *OF_FITTED_MOTIONS)
    if len(options.data) > 1:
        raise modal.SceneError(["measured modes are read from a single file"])
    picture(options.picture, "--picture")
    in_a_folder(options.output, options.report, options.picture)
    scene = modal.load(options.scene)
    measured = read_modes(scene, options.data[0])
    _tell_of_unused(measured.unused)
    fitted = fit_modes(scene, measured, listed(options.free), priors=options.prior or (), loss=options.loss)
    files = {options.output: scene_bytes(options, fitted.scene)}
    if options.report:
        files[options.report] = mode_fit_json(fitted).encode()
    write_together(files | pictured(options, "modal.plotting", "mode_fit_figure", fitted))
    say(mode_fit_json(fitted) if options.format == "json" else mode_fit_text(fitted), options.format)
    return fitted


def _fit_motions(options: argparse.Namespace) -> Fit | None:
    from modal.identification import find_parameters
    from nonlinear.identification import compare, fit_json, fit_text
    from nonlinear.identification import fit as fitted

    scene, draws = modal.load(options.scene), options.bootstrap or 0
    free = listed(options.free)
    more = kwargs_of(options, "--scale", "--shift", "--loss", "--prior", "--window")
    _, recording, *_ = nonlinear.integration.validate(
        lambda: find_parameters(scene, free, options.prior or ()),
        lambda: _recording(options, scene),
        lambda: picture(options.picture, "--picture"),
        lambda: in_a_folder(options.output, options.report, options.picture),
    )
    with crew_of(options) as crew, bar(1.0, "fit") as report:
        laws = listed(options.compare)
        candidates = compare(scene, recording, free, laws, crew=crew, report=report, **more) if laws else []
        estimate = candidates[0].fit if candidates else fitted(scene, recording, free, report=report, **more)
    estimate = replace(estimate, verdict=tuple(map(options.page.in_options, estimate.verdict)))
    _tell_of_readings(recording)
    files = {options.output: scene_bytes(options, estimate.scene)}
    if options.report:
        files[options.report] = fit_json(estimate, candidates, draws).encode()
    write_together(files | pictured(options, "nonlinear.plotting", "fit_figure", estimate))
    told = fit_json if options.format == "json" else fit_text
    say(told(estimate, candidates, draws), options.format)
    return None if candidates or draws else estimate


def _recording(options: argparse.Namespace, scene: Scene | None) -> Recording:
    """The recording in the files, with the rows and columns that the options say."""
    from nonlinear.identification import parse_where, read_recording

    return read_recording(
        scene,
        options.data,
        where=parse_where(options.where or (), "COLUMN=VALUE, such as use=identify or time_s=6.2:19"),
        angles=options.angles,
        columns=parse_where(options.column or (), "HEADING=COLUMN, such as t=time_ms"),
        every=options.every or 1,
        pixel=options.pixel,
    )


def poles(options: argparse.Namespace) -> Identified | Assurance:
    """Find frequencies, damping ratios and shapes in measured motions; with a scene, compare them with its modes.

    Free decays are realized by the eigensystem realization algorithm (Juang & Pappa 1985), and the poles then
    fitted to the records themselves; for responses to random excitation the correlations are realized instead.
    Frequencies are natural frequencies, as in the table of modes. The picture shows which poles are stable over its
    order. With --scene, every measured mode is paired with the computed one most similar to it, without shapes with
    that of the nearest frequency: the modal assurance criterion (MAC) is 1 where two shapes are equal up to a
    factor, and 0 where they are orthogonal.

    Examples
    --------
    simulate chain-2 --start angles:2,5 --duration 20 -o run.csv
        a small swing to measure
    poles run.csv -o poles.png --identified-modes modes.csv
        its two modes, and as a file
    poles modes.csv --scene chain-2 -o mac.png
        compared with those of a scene
    poles run.csv --format json
        with shapes, standard deviations and the poles of all orders
    """
    from modal.identification import has_modes, poles_table

    picture(options.output)
    in_a_folder(options.output, options.identified_modes)
    scene = noted(modal.load(options.scene)) if options.scene else None
    if any(map(has_modes, options.data)):
        if scene is None or len(options.data) > 1:
            raise modal.SceneError([f"{options.data[0]}: contains modes: give a single such file, and --scene SCENE"])
        refuse(options, f"applies to measured motions, and {options.data[0]} contains modes", *OF_MOTIONS)
        return _compare(options, scene, None)
    identified, title = _identified(options)
    if options.identified_modes:
        with output(options.identified_modes) as write:
            write(poles_table(identified, "csv"))
    if scene is not None:
        return _compare(options, scene, poles_table(identified, "csv"))
    draw_in(options, options.output, "modal.plotting", "poles_figure", identified, title=title)
    say(poles_table(identified, options.format, title), options.format)
    return identified


def _identified(options: argparse.Namespace) -> tuple[Identified, str]:
    """The modes in measured motions, and the files of these."""
    from modal.identification import identify

    recording = _recording(options, None).absolute()
    identified = identify(
        [(segment.times, segment.values) for segment in recording.segments],
        [sensor.name for sensor in recording.sensors],
        **kwargs_of(options, "--identification", "--excitation", "--order"),
    )
    _tell_of_readings(recording)
    return identified, ", ".join(dict.fromkeys(segment.file for segment in recording.segments))


def _compare(options: argparse.Namespace, scene: Scene, table: str | None) -> Assurance:
    """MAC matrix, pairs and errors of frequencies of the modes in a table, or else in the file."""
    from modal.identification import assurance_table, compare_modes, parse_modes, read_modes

    (name, *_) = options.data
    measured = read_modes(scene, name) if table is None else parse_modes(scene, name, table)
    _tell_of_unused(measured.unused)
    comparison = compare_modes(modal.natural_modes(scene), measured)
    text = assurance_table(comparison, options.format)
    show(options, text, "assurance_figure", comparison, room="modal.plotting")
    return comparison


def _tell_of_readings(recording: Recording) -> None:
    remark("\n".join(recording.readings))
    _tell_of_unused(recording.unused)


def _tell_of_unused(columns: Sequence[str]) -> None:
    if columns:
        remark(f"columns not used: {', '.join(columns)}")


COMMANDS = (
    Command(
        topic="measurements",
        run=fit,
        main=("--free", "--output", "--report", "--picture", "--compare"),
        takes=(
            SCENE,
            *records("; or one of measured modes with mode, frequency_hz and std_hz"),
            option("--free, such as 'pendulum[0].links[*].damping', or none to test the model as it is"),
            "--prior; repeat for several",
            "--scale",
            "--shift",
            "--loss (default linear); the others give less weight to outliers",
            "--window, which join (multiple shooting), for a long segment that is chaotic",
            "--bootstrap (block bootstrap)",
            "--compare: viscous, coulomb, drag, or several joined by +; the best by BIC is reported",
            main_file("the scene with the fitted numbers", ("toml",)),
            "--report: with the covariance",
            *picture_file("record, fitted motion and residuals"),
            *CREW,
            formats("text", "json"),
        ),
    ),
    Command(
        topic="measurements",
        run=poles,
        main=("--output", "--identified-modes", "--scene", "--excitation", "--format"),
        takes=(
            *records(", as for fit; or, for --scene, one of measured modes with mode, frequency_hz, std_hz and shapes"),
            "--scene, whose MAC matrix, pairs and errors of frequencies are then shown instead",
            "--excitation: free decay (default), or random, by forces like noise",
            "--identification: era, the eigensystem realization (default), or decrement, from the turning points of a "
            "single mode",
            "--order, twice the number of modes and one for offsets (default from the singular values)",
            formats("text", "csv", "json"),
            "--identified-modes",
            *report_file("text", "csv", "json"),
        ),
    ),
)
