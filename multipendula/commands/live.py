"""The command of the live page: play."""

from __future__ import annotations

import argparse
from typing import Any

import modal
import nonlinear
from multipendula.command import RUN, Command, main_file
from multipendula.commands.runs import recorded
from multipendula.commands.shared import in_a_folder, made, remark

KINDS = ("html",)


def play(options: argparse.Namespace) -> None:
    """Write a page to play with: the scene swings there, changes as you drag it, and shows its modes.

    One HTML file that any browser opens, without a server or a network. Drag a mass, a length or the cart's mass
    and the table follows; choose a mode and it swings; pull a bob and the full equations run next to the linear
    prediction. A saved run plays with speed, step and scrub controls. Scenes in the plane of at most 60 links,
    structures of at most 40 coordinates with those of links, scenes with dry friction or forces of at most 12;
    without hoists, constant forces or damping ratios.

    Examples
    --------
    play paper-cart-2 -o page.html
        two double pendula on a cart, to play with
    play ship-crane -o ship.html
        a ship that rolls under its crane: drag the hull
    simulate clocks-double --duration 20 -o run.npz
        a run to play
    play run.npz -o run.html
        the saved run, with its controls
    """
    from multipendula.page import page

    *_, (data, recording) = nonlinear.integration.validate(
        lambda: modal.scene.kind_of(options.output, KINDS, "-o "),
        lambda: in_a_folder(options.output),
        lambda: _shown(options.scene),
    )
    content = page(data, recording).encode()
    with modal.scene.whole_file(options.output) as stream:
        stream.write(content)
    made(options.output, f"{len(content) / 1000:.0f} kB, open it in any browser")
    if recording and recording["samples"] < recording["of"]:
        words = f"{recording['samples']} of {recording['of']} samples of the run are in the page"
        remark(words)


def _shown(name: str) -> tuple[dict[str, Any], dict[str, Any] | None]:
    from multipendula.page import recording_of, scene_data

    if not recorded(name):
        return scene_data(modal.load(name)), None
    trajectory = nonlinear.files.load(name)
    return scene_data(trajectory.scene), recording_of(trajectory)


COMMANDS = (Command(topic="motion", run=play, main=("--output",), takes=(RUN, main_file("the page", KINDS, ".html"))),)
