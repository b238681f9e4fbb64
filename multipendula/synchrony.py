"""The command sync: who keeps time with whom, predicted and simulated."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING

from multipendula.commands import picture
from multipendula.motions import film_form
from multipendula.runs import bar, in_a_folder, start_of

if TYPE_CHECKING:
    from nonlinear.synchrony import Synchrony


def sync(options: argparse.Namespace) -> None:
    """Predict which mode survives in a scene that excites itself, simulate it, and measure who keeps time with whom."""
    from modal.files import load
    from nonlinear.requests import gathered
    from nonlinear.synchrony import synchrony

    scene, *_ = gathered(
        lambda: load(options.scene),
        lambda: options.picture and picture(options.picture),
        lambda: options.film and film_form(options.film),
        *(lambda path=path: in_a_folder(path) for path in (options.picture, options.film)),
    )
    start = start_of(scene, options.start)
    with bar(1.0, "run") as report:
        found = synchrony(
            scene, options.duration, start=start, report=lambda elapsed, duration: report(elapsed / duration)
        )
    sys.stdout.write(_told(found, options.format))
    if options.picture:
        _draw(found, options.picture)
    if options.film:
        _film(found, options.film)


def _told(found: Synchrony, form: str) -> str:
    from nonlinear.check_tables import as_json
    from nonlinear.sync_records import records
    from nonlinear.sync_words import sync_text

    return as_json(records(found)) if form == "json" else sync_text(found)


def _draw(found: Synchrony, name: str) -> None:
    from modal.files import whole_file
    from nonlinear.sync_figures import draw_sync

    with whole_file(name) as stream:
        draw_sync(found.trajectory, found.phases, stream, picture(name))


def _film(found: Synchrony, name: str) -> None:
    from modal.files import whole_file
    from nonlinear.animation import animate
    from nonlinear.strobe import strobed

    form = film_form(name)
    with whole_file(name) as stream, bar(20.0) as report:
        shown = animate(found.trajectory, stream, form, **strobed(found.phases, form), report=report)
    print(f"{shown.frames} frames, one every {shown.motion / shown.frames:.4g} s", file=sys.stderr)
