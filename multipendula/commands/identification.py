"""The command that fits a scene to measurements: fit."""

from __future__ import annotations

import argparse
import sys

from multipendula.command import Command
from multipendula.commands.shared import bar, drawn, in_a_folder, listed, output, picture
from multipendula.completion import files, places
from multipendula.options import add_scene, add_theme, add_words, number, offer, whole
from multipendula.parser import Page

LOSSES = ("linear", "soft_l1", "huber", "cauchy")


def fit(options: argparse.Namespace) -> None:
    """Fit numbers of a scene to measured motions, with error bars and what the data leave open."""
    from modal.identification import find_parameters
    from modal.scene import dump, load
    from nonlinear.identification import compare, fit_json, fit_text, parse_where, read_recording
    from nonlinear.identification import fit as fitted
    from nonlinear.integration import validate

    scene, draws = load(options.scene), options.bootstrap or 0
    free = listed(options.free)
    more = {"scaled": options.scale, "loss": options.loss, "priors": options.prior or (), "window": options.window}
    _, recording, *_ = validate(
        lambda: find_parameters(scene, free, options.prior or ()),
        lambda: read_recording(scene, options.data, where=parse_where(options.where or ()), angles=options.angles),
        lambda: options.picture and picture(options.picture, "--picture"),
        *(lambda path=path: in_a_folder(path) for path in (options.output, options.report, options.picture)),
    )
    with bar(1.0, "fit") as report:
        candidates = (
            compare(scene, recording, free, listed(options.compare), report=report, **more) if options.compare else []
        )
        found = candidates[0].fit if candidates else fitted(scene, recording, free, report=report, **more)
    if recording.unused:
        print(f"multipendula: columns not used: {', '.join(recording.unused)}", file=sys.stderr)
    if options.output:
        dump(found.scene, options.output)
    if options.report:
        with output(options.report) as write:
            write(fit_json(found, candidates, draws))
    if options.picture:
        from nonlinear.plotting import draw_fit

        with drawn(options.picture, options.theme) as stream:
            draw_fit(found, stream, picture(options.picture, "--picture"))
    sys.stdout.write(
        fit_json(found, candidates, draws) if options.format == "json" else fit_text(found, candidates, draws)
    )


def _fit_arguments(page: Page) -> None:
    add_scene(page)
    words = "CSV files with time_s and theta_1_1_rad (or _deg), cart_m and the like, one column for each sensor"
    offer(page.asked.add_argument("data", metavar="DATA.csv", nargs="+", help=words), files((".csv",)))
    words = "numbers to fit, separated by commas, such as 'pendulum[0].links[*].damping', or none to judge the scene"
    offer(page.asked.add_argument("--free", metavar="PLACES", required=True, help=words), places)
    words = "what is known of a free number beforehand, PLACE=VALUE±STD; repeat for several"
    page.asked.add_argument("--prior", metavar="PLACE=VALUE±STD", action="append", help=words)
    words = "use only rows with this value in a column, such as use=identify; repeat for several"
    page.asked.add_argument("--where", metavar="COLUMN=VALUE", action="append", help=words)
    words = "absolute, from the vertical (default), or relative, from the link above"
    page.asked.add_argument("--angles", choices=("absolute", "relative"), default="absolute", help=words)
    page.computed.add_argument("--scale", action="store_true", help="fit the scale of every sensor too")
    words = "cost of a residual (default linear); the others give less weight to outliers"
    page.computed.add_argument("--loss", choices=LOSSES, default="linear", help=words)
    words = "fit in windows of so many seconds that join (multiple shooting), where one long segment is chaotic"
    page.computed.add_argument("--window", metavar="SECONDS", type=number("seconds above 0"), help=words)
    words = "check standard deviations by so many resampled records (block bootstrap)"
    page.computed.add_argument("--bootstrap", metavar="N", type=whole(100_000), help=words)
    words = "laws of damping to compare: viscous, coulomb, drag, or several joined by +; the best by BIC is reported"
    add_words(page.computed, "--compare", ("viscous", "coulomb", "drag", "viscous+coulomb"), metavar="LAWS", help=words)
    words = "the scene with the fitted numbers"
    offer(page.written.add_argument("--output", "-o", metavar="FILE", help=words), files((".toml",)))
    words = "the report with its covariance, as JSON"
    offer(page.written.add_argument("--report", metavar="FILE", help=words), files((".json",)))
    words = "draw record, fitted motion and residuals"
    offer(page.written.add_argument("--picture", metavar="FILE", help=words), files((".png", ".svg", ".pdf")))
    add_theme(page)
    words = "what is printed (default text)"
    page.written.add_argument("--format", choices=("text", "json"), default="text", help=words)


COMMANDS = (
    Command(
        name="fit",
        topic="measurements",
        run=fit,
        arguments=_fit_arguments,
        details=(
            "Besides the free numbers, the initial state of every segment, an offset of each sensor and its delay are "
            "fitted. Numbers that the data do not determine are held at the scene's values and named. Standard "
            "deviations allow for correlated residuals, and sentences at the end say what the model lacks."
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
)
