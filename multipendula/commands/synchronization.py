"""The command sync: who keeps time with whom, predicted and simulated, and where along a parameter that changes."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from typing import TYPE_CHECKING

from multipendula.commands.modes import bar, drawn, picture
from multipendula.commands.motion import film_form
from multipendula.commands.runs import in_a_folder, start_of

if TYPE_CHECKING:
    from modal.scene import Scene
    from nonlinear.synchronization import SynchronizationStudy


def sync(options: argparse.Namespace) -> None:
    """Predict which mode survives in a scene that excites itself, simulate it, and measure who keeps time with whom."""
    from modal.scene import load
    from modal.scene.parameters import parse_variations
    from nonlinear.integration import validate

    scene, *_ = validate(
        lambda: load(options.scene),
        lambda: options.vary and parse_variations([options.vary]),
        lambda: _fitting(options),
        lambda: options.picture and picture(options.picture),
        lambda: options.film and film_form(options.film, "--film"),
        lambda: in_a_folder(options.picture),
        lambda: in_a_folder(options.film),
    )
    (_branches if options.vary else _run)(scene, options)


def _fitting(options: argparse.Namespace) -> None:
    from modal.errors import SceneError

    if problems := list(_misfits(options)):
        raise SceneError(problems)


def _misfits(options: argparse.Namespace) -> Iterator[str]:
    if options.vary:
        asked = [name for name in ("duration", "start", "film") if getattr(options, name)]
        yield from (f"--{name}: goes without --vary" for name in asked)
        if options.format == "json":
            yield "--format json: goes without --vary"
    elif options.format == "csv":
        yield "--format csv: needs --vary"


def _run(scene: Scene, options: argparse.Namespace) -> None:
    from nonlinear.synchronization import study_synchronization

    start = start_of(scene, options.start, undamped=True)
    with bar(1.0, "run") as report:
        found = study_synchronization(scene, options.duration, start=start, report=lambda now, end: report(now / end))
    sys.stdout.write(_told(found, options.format))
    if options.picture:
        _draw(found, options.picture, options.theme)
    if options.film:
        _film(found, options.film, options.theme)


def _told(found: SynchronizationStudy, form: str) -> str:
    from modal.report import as_json
    from nonlinear.synchronization import sync_record, sync_text

    return as_json(sync_record(found)) if form == "json" else sync_text(found)


def _draw(found: SynchronizationStudy, name: str, theme: str) -> None:
    from nonlinear.plotting import draw_sync

    with drawn(name, theme) as stream:
        draw_sync(found.trajectory, found.phases, stream, picture(name))


def _film(found: SynchronizationStudy, name: str, theme: str) -> None:
    from nonlinear.plotting import SECONDS, animate, strobe

    form = film_form(name)
    with drawn(name, theme) as stream, bar(SECONDS) as report:
        shown = animate(found.trajectory, stream, form, **strobe(found.phases, form), report=report)
    print(f"multipendula: {shown.frames} frames, one every {shown.motion / shown.frames:.4g} s", file=sys.stderr)


def _branches(scene: Scene, options: argparse.Namespace) -> None:
    from modal.scene.parameters import parse_variations
    from nonlinear.synchronization import branches_csv, branches_text, follow_branches

    (variation,) = parse_variations([options.vary])
    with bar(0, "branch") as report:
        found = follow_branches(scene, variation, report)
    sys.stdout.write(branches_csv(found) if options.format == "csv" else branches_text(found))
    if options.picture:
        from nonlinear.plotting import draw_branches

        with drawn(options.picture, options.theme) as stream:
            draw_branches(found, stream, picture(options.picture))
