"""The command about best numbers: tune."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

import modal
from multipendula.command import CREW, SCENE, Command, formats, kwargs_of, main_file, option, picture_file, refuse
from multipendula.commands.shared import (
    bar,
    crew_of,
    in_a_folder,
    missing,
    noted,
    picture,
    pictured,
    say,
    scene_bytes,
    write_together,
)
from multipendula.options import number

if TYPE_CHECKING:
    from modal.scene.motion import Acting
    from modal.tuning import Tuned
    from nonlinear.orbits import FiniteSwing

AIMS = ("--minimize", "--maximize", "--max", "--over-hz", "--psd", "--mode", "--travel", "--over", "--kind")
TUNED_BAND_RATIO = 1.4
"""Format: how far the band of forced orbits goes beyond the outermost peaks; `--band` chooses another."""


def tune(options: argparse.Namespace) -> Tuned | None:
    """Optimize parameters for peaks, RMS, decay or residual swing, with sensitivities.

    At small angles, with exact derivatives and all peaks at once, from several starts. The report compares the
    optimum with Den Hartog's rule where it applies, and has the sensitivity to each number, the range within which
    the objective is at most 1 % worse, the worst case of all masses ±5 %, and stroke and torque of the dampers. The
    --workers share random starts, the last descents and the cases of masses.

    Examples
    --------
    tune tower --free 'pendulum[0].links[0].length,pendulum[0].links[0].damping' --minimize
    peak:floor2_m/floor2_force -o tuned.toml --report report.json
        the damper that minimizes the motion of the roof under a force on it
    tune tower --free 'pendulum[0].links[0].length=1:3,pendulum[0].links[0].damping' --minimize
    peak:floor2_m/support_acceleration --max rel_1_1=6 --picture tuned.png
        when the ground shakes, with bounds and a limit to the damper's stroke
    tune tower --free 'pendulum[0].links[0].damping' --minimize settling
        the damper with the shortest settling time
    """
    if not options.free:
        raise missing(modal.load(options.scene), "--free", "={half}:{double}", " --minimize settling")
    picture(options.picture, "--picture")
    for flag, path in (("-o", options.output), ("--report", options.report), ("--picture", options.picture)):
        in_a_folder(path, option=flag)
    scene = noted(modal.load(options.scene), "tuning" if options.travel is None else "a shaper")
    problems, aims = list[str](), (*(options.minimize or ()), *(options.maximize or ()))
    is_of_peak = bool(aims) and aims[0].rpartition("*")[2].strip().startswith("peak:")
    if options.largest_angle is not None and not is_of_peak:
        problems.append("--largest-angle: needs an objective of the form peak:OUTPUT/INPUT")
    if options.picture and not any("peak:" in aim or "residual" in aim for aim in aims):
        problems.append("--picture: needs an objective of the form peak:OUTPUT/INPUT, or residual")
    if problems:
        raise modal.SceneError(problems)
    if options.travel is None:
        refuse(options, "needs --travel METRES", "--over", "--kind")
    with crew_of(options) as crew, bar(1.0, title="tuning") as report:
        how = kwargs_of(options, *AIMS)
        best = modal.tuning.tune(scene, options.free, robust=options.robust, crew=crew, report=report, **how)
    swing = None if options.largest_angle is None else _swing(best, options.largest_angle)
    record = {} if swing is None else {"finite_swing": _swing_record(swing, best)}
    told = modal.tuning.tuned_json(best, record) if options.report or options.format == "json" else ""
    text = (
        ""
        if options.format == "json"
        else modal.tuning.tuned_text(best, "" if swing is None else _swing_words(swing, best))
    )
    files = {options.output: scene_bytes(options, best.scene), options.report: told.encode()}
    write_together(files | pictured(options, "modal.plotting", "tuning_figure", best))
    say(told if options.format == "json" else text, options.format)
    return None if swing else best


def _swing(best: Tuned, degrees: float) -> FiniteSwing:
    """The highest peak of the first quantity at finite swing."""
    from math import radians, tau

    from modal.statespace.signals import is_point, point_input
    from nonlinear.orbits import finite_swing

    quantity = best.objective.aims[0].quantity
    scene = best.scene
    on: str
    direction: Acting
    if quantity.input == "cart_force":
        on, direction = "cart", "horizontal"
    elif is_point(quantity.input):
        point = point_input(scene, quantity.input)
        on, direction = point.on, point.direction
    else:
        raise modal.SceneError(
            ["--largest-angle: forced orbits are computed under cart_force, or a force at a point, force:POINT"]
        )
    labels = ["x"] * (scene.cart is not None)
    counts = [pendulum.n_links for pendulum in scene.pendulum for _ in range(pendulum.count)]
    labels += [f"theta_{p}_{i}" for p, links in enumerate(counts, 1) for i in range(1, links + 1)]
    if quantity.output not in labels:
        raise modal.SceneError(
            [f"--largest-angle: forced orbits give the outputs {', '.join(labels[:6])}, not {quantity.output}"]
        )
    at = best.pieces_after[0]
    peaks = at.at[at.inside] / tau
    band = best.objective.quantities.setting.band or (peaks.min() / TUNED_BAND_RATIO, peaks.max() * TUNED_BAND_RATIO)
    return finite_swing(scene, on, direction, labels.index(quantity.output), radians(degrees), band)


def _swing_record(swing: FiniteSwing, best: Tuned) -> dict[str, Any]:
    from math import degrees

    return {
        "quantity": best.objective.aims[0].quantity.name,
        "largest_angle_deg": degrees(swing.angle),
        "force": swing.size,
        "peak": swing.peak,
        "frequency_hz": swing.frequency,
        "stable": swing.stable,
        "curve": {"frequency_hz": swing.frequencies.tolist(), "response": swing.responses.tolist()},
    }


def _swing_words(swing: FiniteSwing, best: Tuned) -> str:
    from math import degrees

    from modal.tuning.objective import extreme

    quantity = best.objective.aims[0].quantity
    linear = extreme(quantity, best.pieces_after[0])
    change = 100 * (swing.peak / linear - 1)
    return (
        f"At finite swing, a force of {swing.size:.5g} with which a link turns by {degrees(swing.angle):.4g}°: "
        f"{quantity.words} is {swing.peak:.6g} at {swing.frequency:.5g} Hz ({change:+.3g} %), "
        f"{'stable' if swing.stable else 'unstable'}."
    )


COMMANDS = (
    Command(
        topic="control",
        run=tune,
        main=("--free", "--minimize", "--max", "--output", "--picture"),
        takes=(
            SCENE,
            option(
                "--free, each perhaps with bounds, such as 'pendulum[0].links[0].length=0.5:2,"
                "pendulum[0].links[0].damping'"
            ),
            "--minimize: peak:OUTPUT/INPUT, such as peak:x/cart_force, the largest magnitude over frequencies; "
            "rms:OUTPUT under --psd; residual, the angle that a --travel leaves; damping, the least ratio of the "
            "modes; settling, the time to 2 percent; a measure of one column of modes, such as splitting:1; "
            "with a weight as in 2*peak:x/cart_force; repeat for several",
            "--maximize, as for --minimize; repeat for several",
            "--max, such as rel_1_1=0.2, the stroke of a damper, as peak or RMS like the first quantity; or any "
            "quantity, such as settling=60; repeat for several",
            "--over-hz, such as 0.1:2 (default all)",
            "--psd, for rms: of the support's acceleration, or of the input of rms:OUTPUT/INPUT, as in vibration",
            option("--mode, to which damping and settling are limited; repeat for several", keyword="modes"),
            option("--travel, for residual, smoothly, as in hoist", type=number("metres above 0")),
            "--over (default that of the hoist)",
            "--kind of the travel, for the lengths before it (default none)",
            "--robust",
            option(
                "--largest-angle: adds the peak of the tuned scene at such a finite swing, by forced orbits",
                group="computed",
            ),
            main_file("the scene with the best numbers", ("toml",)),
            "--report: with the curves",
            *picture_file("the peaks, or the swing of a travel, before and after"),
            *CREW,
            formats("text", "json"),
        ),
    ),
)
