"""The commands about measurements: fit, poles, mac."""

from __future__ import annotations

import argparse
from dataclasses import replace

from multipendula.command import (
    CREW,
    SCENE,
    Command,
    argument,
    formats,
    kwargs_of,
    main_file,
    option,
    picture_file,
    records,
    report_file,
)
from multipendula.commands.shared import (
    bar,
    crew_of,
    drawn,
    in_a_folder,
    listed,
    noted,
    output,
    picture,
    pictured,
    remark,
    say,
    write_together,
)
from multipendula.completion import files

MEASURED = "measured modes, a CSV file with mode, frequency_hz, std_hz and columns theta_P_L and cart of the shapes"


def fit(options: argparse.Namespace) -> None:
    """Fit numbers of a scene to measured motions or modes, with error bars, and say what the data leave open."""
    from modal.identification import has_modes

    if any(map(has_modes, options.data)):
        _fit_modes(options)
    else:
        _fit_motions(options)


def _fit_modes(options: argparse.Namespace) -> None:
    from modal.errors import SceneError
    from modal.identification import fit_modes, mode_fit_json, mode_fit_text, read_modes
    from modal.scene import dumps, load

    motions = {"--where": options.where, "--scale": options.scale, "--compare": options.compare}
    motions |= {"--window": options.window, "--bootstrap": options.bootstrap, "--column": options.column}
    problems = [
        f"{name}: is for measured motions, and {options.data[0]} has modes" for name, asked in motions.items() if asked
    ]
    if options.angles != "absolute":
        problems.append("--angles: shapes of modes have absolute angles")
    if len(options.data) > 1:
        problems.append("measured modes are read from one file, by itself")
    if problems:
        raise SceneError(problems)
    kind = picture(options.picture, "--picture") if options.picture else ""
    for path in (options.output, options.report, options.picture):
        in_a_folder(path)
    scene = load(options.scene)
    measured = read_modes(scene, options.data[0])
    if measured.unused:
        remark(f"columns not used: {', '.join(measured.unused)}")
    fitted = fit_modes(scene, measured, listed(options.free), priors=options.prior or (), loss=options.loss)
    files = {options.output: dumps(fitted.scene).encode()}
    if options.report:
        files[options.report] = mode_fit_json(fitted).encode()
    if options.picture:
        from modal.plotting import draw_mode_fit

        files[options.picture] = pictured(lambda stream: draw_mode_fit(fitted, stream, kind), options.theme)
    write_together(files)
    say(mode_fit_json(fitted) if options.format == "json" else mode_fit_text(fitted), options.format)


def _fit_motions(options: argparse.Namespace) -> None:
    from modal.identification import find_parameters
    from modal.scene import dumps, load
    from nonlinear.identification import compare, fit_json, fit_text, parse_where, read_recording
    from nonlinear.identification import fit as fitted
    from nonlinear.integration import validate

    scene, draws = load(options.scene), options.bootstrap or 0
    free = listed(options.free)
    more = kwargs_of(options, "--scale", "--loss", "--prior", "--window")
    _, recording, *_ = validate(
        lambda: find_parameters(scene, free, options.prior or ()),
        lambda: read_recording(
            scene,
            options.data,
            where=parse_where(options.where or ()),
            angles=options.angles,
            columns=parse_where(options.column or (), "HEADING=COLUMN, such as t=time_ms"),
        ),
        lambda: options.picture and picture(options.picture, "--picture"),
        *(lambda path=path: in_a_folder(path) for path in (options.output, options.report, options.picture)),
    )
    with crew_of(options) as crew, bar(1.0, "fit") as report:
        laws = listed(options.compare)
        candidates = compare(scene, recording, free, laws, crew=crew, report=report, **more) if laws else []
        estimate = candidates[0].fit if candidates else fitted(scene, recording, free, report=report, **more)
    estimate = replace(estimate, verdict=tuple(map(options.page.in_options, estimate.verdict)))
    if recording.unused:
        remark(f"columns not used: {', '.join(recording.unused)}")
    files = {options.output: dumps(estimate.scene).encode()}
    if options.report:
        files[options.report] = fit_json(estimate, candidates, draws).encode()
    if options.picture:
        from nonlinear.plotting import draw_fit

        kind = picture(options.picture, "--picture")
        files[options.picture] = pictured(lambda stream: draw_fit(estimate, stream, kind), options.theme)
    write_together(files)
    told = fit_json if options.format == "json" else fit_text
    say(told(estimate, candidates, draws), options.format)


def poles(options: argparse.Namespace) -> None:
    """Find frequencies, damping ratios and shapes in measured motions, without a scene."""
    from modal.identification import identify, poles_table
    from nonlinear.identification import parse_where, read_recording
    from nonlinear.integration import validate

    kind = picture(options.output) if options.output else ""
    recording, *_ = validate(
        lambda: read_recording(None, options.data, where=parse_where(options.where or ()), angles=options.angles),
        *(lambda path=path: in_a_folder(path) for path in (options.output, options.identified_modes)),
    )
    absolute = recording.absolute()
    identified = identify(
        [(segment.times, segment.values) for segment in absolute.segments],
        [sensor.name for sensor in absolute.sensors],
        **kwargs_of(options, "--identification", "--excitation", "--order"),
    )
    if recording.unused:
        remark(f"columns not used: {', '.join(recording.unused)}")
    title = ", ".join(dict.fromkeys(segment.file for segment in recording.segments))
    if options.identified_modes:
        with output(options.identified_modes) as write:
            write(poles_table(identified, "csv"))
    if options.output:
        from modal.plotting import draw_poles

        with drawn(options.output, options.theme) as stream:
            draw_poles(identified, stream, kind, title)
    say(poles_table(identified, options.format, title), options.format)


def mac(options: argparse.Namespace) -> None:
    """Compare measured with computed modes: MAC matrix, pairs and errors of frequencies."""
    from modal.identification import assurance_table, compare_modes, read_modes
    from modal.modes import natural_modes
    from modal.scene import load

    kind = picture(options.output) if options.output else ""
    in_a_folder(options.output)
    scene = noted(load(options.scene))
    measured = read_modes(scene, options.data)
    if measured.unused:
        remark(f"columns not used: {', '.join(measured.unused)}")
    comparison = compare_modes(natural_modes(scene), measured)
    if options.output:
        from modal.plotting import draw_assurance

        with drawn(options.output, options.theme) as stream:
            draw_assurance(comparison, stream, kind)
    say(assurance_table(comparison, options.format), options.format)


COMMANDS = (
    Command(
        name="fit",
        topic="measurements",
        run=fit,
        takes=(
            SCENE,
            *records("; or one of measured modes with mode, frequency_hz and std_hz"),
            option("--free, such as 'pendulum[0].links[*].damping', or none to judge the scene", required=True),
            "--prior; repeat for several",
            "--column: t=time_ms, theta_1_1_rad=theta_1_1_deg or theta_1_1_rad=-theta_1_1_rad; repeat for several",
            "--scale",
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
        details=(
            "The initial state of every segment, an offset of each sensor and its delay are fitted along with the free "
            "numbers. Numbers that the data do not determine are held at the scene's values and named. Standard "
            "deviations allow for correlated residuals, and sentences at the end say what the model lacks. The "
            "--workers share the laws of --compare; a thousand draws of --bootstrap, each one step from the fit, take "
            "less time than a process to start."
        ),
        examples=(
            ("simulate chain-2 --duration 8 -o run.csv", "a motion to fit, in place of a measured one"),
            (
                "fit chain-2 run.csv --free 'pendulum[0].links[0].length' -o fitted.toml --report fit.json",
                "a length from it: the scene with the fitted number, and its covariance",
            ),
            ("fit fitted.toml run.csv --free none", "judge a scene: only the start and offsets are fitted"),
        ),
    ),
    Command(
        name="poles",
        topic="measurements",
        run=poles,
        takes=(
            *records(", as for fit"),
            "--excitation: free, nothing but how they began (default), or random, forces like noise",
            "--identification: era, the eigensystem realization (default), or decrement, from the turning points of a "
            "single mode",
            "--order, twice the number of modes and one for offsets (default from the singular values)",
            formats("text", "csv", "json"),
            "--identified-modes",
            *report_file("text", "csv", "json"),
        ),
        details=(
            "Free decays are realized by the eigensystem realization algorithm (Juang & Pappa 1985), and the poles "
            "then fitted to the records themselves; for responses to random excitation the correlations are realized "
            "instead. Frequencies are natural frequencies, as in the table of modes. The picture shows which poles are "
            "stable over its order."
        ),
        examples=(
            (
                "simulate chain-2 --start angles:2,5 --duration 20 -o run.csv",
                "a small swing to measure",
            ),
            ("poles run.csv -o poles.png --identified-modes modes.csv", "its two modes, as a file for fit and mac"),
            ("poles run.csv --format json", "with shapes, standard deviations and the poles of all orders"),
        ),
    ),
    Command(
        name="mac",
        topic="measurements",
        run=mac,
        takes=(
            SCENE,
            argument("data", "MODES.csv", MEASURED, files((".csv",))),
            formats("text", "csv", "json"),
            *report_file("text", "csv", "json"),
        ),
        details=(
            "The modal assurance criterion is 1 where two shapes are equal up to a factor, and 0 where they are "
            "orthogonal. Every measured mode is paired with the computed one most similar to it, without shapes with "
            "that of the nearest frequency."
        ),
        examples=(
            (
                "simulate chain-2 --start angles:2,5 --duration 20 -o run.csv",
                "a small swing to measure",
            ),
            ("poles run.csv --identified-modes modes.csv", "its modes"),
            ("mac chain-2 modes.csv -o mac.png", "beside those of the scene"),
        ),
    ),
)
