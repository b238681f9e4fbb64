"""The commands that test predictions and methods: check, chaos and tradeoff."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

import modal
import nonlinear
from multipendula.command import CREW, SCENE, Command, formats, option, refuse, report_file, scene_argument
from multipendula.commands.runs import ELSEWHERE, RunOptions, motion, recorded, start_of
from multipendula.commands.shared import bar, chosen, crew_of, forewarning, in_a_folder, picture, remark, show, warned
from multipendula.options import REPORTS, integer

if TYPE_CHECKING:
    from modal.scene import Scene
    from nonlinear.accuracy import FrequencyTradeoff, WorkPrecision
    from nonlinear.chaos import Exponent, Finding
    from nonlinear.integration import Trajectory
    from nonlinear.verification import Check, Comparison


def check(options: argparse.Namespace) -> Check | Comparison:
    """Check the table of modes against simulation: measure the frequencies at several amplitudes.

    Every mode is released at several amplitudes and simulated for 40 periods; its frequency is measured and
    compared with the table's predictions: the small-angle frequency, its shift with amplitude, and the angle at
    which it is off by 1 %. With --general one run is projected on the modes instead, and with --proved its true
    error is reported. The report begins with the accuracy of the predictions.

    Examples
    --------
    check chain-2 --modes 1 --amplitudes 10,30
        the slow mode at two amplitudes
    check crane-hook --modes 2 --amplitudes 20 -o check.png
        with a figure
    check chain-2 --general --start angles:10,0 --duration 30
        one run, projected on the modes
    """
    _place(options)
    scene = modal.load(_scene(options))
    outcome: Check | Comparison
    outcome, table, figure = _general(options, scene) if options.general else _mode_by_mode(options, scene)
    show(options, table(outcome, options.format), figure, outcome)
    return outcome


def _mode_by_mode(options: argparse.Namespace, scene: Scene) -> tuple[Any, Any, str]:
    from nonlinear.verification import AMPLITUDES_DEG, check_table
    from nonlinear.verification import check as checked

    asked = (f"--{name.replace('_', '-')}" for name in RunOptions.of(options).given)
    refuse(options, "needs --general", "--proved", *asked)
    numbers = chosen(options.modes, len(modal.natural_modes(scene)))
    with bar(len(numbers), "mode") as report:
        outcome = checked(scene, list(numbers), options.amplitudes or AMPLITUDES_DEG, report=report)
    return outcome, check_table, "check_figure"


def _general(options: argparse.Namespace, scene: Scene) -> tuple[Any, Any, str]:
    from nonlinear.verification import compare, comparison_table

    refuse(options, "cannot be combined with --general", "--modes", "--amplitudes")
    modal.scene.require(scene, "a comparison with modes")
    trajectory = RunOptions.of(options).shown()
    if options.proved:
        _judge(trajectory)
    return compare(trajectory), comparison_table, "spectrum_figure"


def _judge(trajectory: Trajectory) -> None:
    """A note on the true error of a run, by a tube that provably contains the motion."""
    from nonlinear.integration.tubes import at_most

    times = trajectory.times - trajectory.times[0]
    with bar(float(times[-1]), "s", "proof") as report:
        tube = nonlinear.integration.enclose_motion(
            trajectory.scene, float(times[-1]), output=times, start=trajectory.motion[0], report=report
        )
    remark(f"proved: no angle of the run is off by more than {at_most(tube.distance(trajectory).max())} rad")


def _place(options: argparse.Namespace) -> None:
    in_a_folder(options.output)
    picture(options.output)


def _scene(options: argparse.Namespace) -> Any:
    if recorded(options.scene):
        raise modal.SceneError([f"{options.scene}: is a saved run, and this command needs a scene"])
    return options.scene


def chaos(options: argparse.Namespace) -> Exponent | Finding:
    """Measure the largest Lyapunov exponent, or test what paper 000 or 001 claims about it.

    The largest Lyapunov exponent with its uncertainty, from tangent vectors along an ensemble of starts, or an
    upper bound if it is indistinguishable from zero. The first start is the scene's own, the others are within 0.1
    degrees of it: to find chaos, give the scene large angles. paper:000 and paper:001 test the claims of two
    papers. The --workers share 256 starts at a time, of a paper's study its scenes.

    Examples
    --------
    chaos chain-2 --duration 10 --members 4
        a quick estimate for a double pendulum
    chaos paper-cart-1 --duration 20 -o lyapunov.png
        16 starts, with a figure of the convergence
    """
    _place(options)
    is_of_paper = str(options.scene).startswith("paper:")
    outcome = _claims(options) if is_of_paper else _exponent(options)
    show(options, f"{outcome.text()}\n", "finding_figure" if is_of_paper else "exponent_figure", outcome)
    return outcome


def _exponent(options: argparse.Namespace) -> Exponent:
    from nonlinear.chaos import TRANSIENT, lyapunov_exponent, usual_duration

    if options.quick:
        raise modal.SceneError(["--quick: works with paper:000 and paper:001 only"])
    scene = warned(modal.load(_scene(options)), "a Lyapunov exponent")
    duration = options.duration or usual_duration(scene)
    members, start = options.members or 16, start_of(scene, None, elsewhere=ELSEWHERE)
    with crew_of(options) as crew, bar((1 + TRANSIENT) * duration) as report:
        told = forewarning(report, scene, (1 + TRANSIENT) * duration, members)
        return lyapunov_exponent(scene, duration, members=members, start=start, crew=crew, report=told)


def _claims(options: argparse.Namespace) -> Finding:
    from nonlinear.chaos import measure, study

    if options.duration or options.members:
        raise modal.SceneError([f"{options.scene}: has its own --duration and --members; --quick makes it short"])
    chosen = study(options.scene.removeprefix("paper:"), quick=options.quick)
    with crew_of(options) as crew, bar(len(chosen.cases), "scene") as report:
        return measure(chosen, report, crew=crew)


def tradeoff(options: argparse.Namespace) -> WorkPrecision | FrequencyTradeoff:
    """Measure the time and error of every method for a motion, from linear modes to the finest integration.

    Linear modes, modes with corrected frequencies, and every integrator at several tolerances, plain and compiled:
    the cost and the error of each, and the time up to which errors can be measured, or true errors with --proved.
    With --linear the frequencies instead: by dense matrices, to a relative error, and with every digit.

    Examples
    --------
    tradeoff chain-1 --start mode:1:10 --duration 2
        every method for two seconds of a small swing
    tradeoff chain-1 --start angles:60 --duration 1 -o t.png
        with a figure: time against error
    tradeoff paper-cart-2 --linear
        all frequencies: dense matrices, to 1e-8, every digit
    """
    _place(options)
    scene = modal.load(_scene(options))
    comparison: WorkPrecision | FrequencyTradeoff
    comparison, text = (_of_frequencies if options.linear else _of_motion)(options, scene)
    show(options, text, "frequencies_figure" if options.linear else "tradeoff_figure", comparison)
    return comparison


def _of_motion(options: argparse.Namespace, scene: Scene) -> tuple[Any, str]:
    from nonlinear.accuracy import list_candidates, tradeoff_table
    from nonlinear.accuracy import measure_work_precision as compared

    refuse(options, "needs --linear", "--relative-error")
    start, duration = start_of(scene, options.start), options.duration or 10.0
    with bar(len(list_candidates(scene)) + 1, "candidate") as report:
        told = forewarning(report, scene, duration)
        comparison = compared(scene, duration, start=start, proved=options.proved, report=told)
    return comparison, tradeoff_table(comparison, options.format)


def _of_frequencies(options: argparse.Namespace, scene: Scene) -> tuple[Any, str]:
    from nonlinear.accuracy import frequencies_table, measure_frequencies

    refuse(options, "applies to motions: omit --linear", "--start", "--duration", "--proved")
    comparison = measure_frequencies(scene, (options.relative_error or 1e-8,))
    return comparison, frequencies_table(comparison, options.format)


COMMANDS = (
    Command(
        topic="motion",
        run=check,
        main=("--modes", "--amplitudes", "--general", "--format", "--output"),
        takes=(
            *motion(120.0, runs=False, without=("keep_modes",)),
            "--modes, counted from 1 (default all)",
            "--amplitudes (default 1,5,10,30)",
            "--general",
            "--proved, in which that run is",
            formats(*REPORTS),
            *report_file(*REPORTS),
        ),
    ),
    Command(
        topic="motion",
        run=tradeoff,
        main=("--duration", "--start", "--linear", "--format", "--output"),
        takes=(
            SCENE,
            "--start, as in simulate",
            "--duration (default 10)",
            "--proved, by which errors are measured",
            "--linear: dense matrices, a relative error that is allowed, every digit",
            "--relative-error that --linear allows (default 1e-08)",
            formats(*REPORTS),
            *report_file(*REPORTS),
        ),
    ),
    Command(
        topic="motion",
        run=chaos,
        main=("--duration", "--members", "--quick", "--output"),
        takes=(
            scene_argument("; or paper:000, paper:001 to test their claims", names=("paper:000", "paper:001")),
            "--duration (default 200 sqrt(l/g))",
            option("--members: starts (default 16)", type=integer(10_000)),
            "--quick of a paper's study",
            *CREW,
            *report_file(),
        ),
    ),
)
