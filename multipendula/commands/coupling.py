"""The command explain: what the cart does to the pendula."""

from __future__ import annotations

import argparse
import sys

from multipendula.command import Command
from multipendula.commands.shared import drawn, picture
from multipendula.options import add_format, add_picture, add_scene
from multipendula.parser import Page


def explain(options: argparse.Namespace) -> None:
    """Say in words, and draw, how the cart couples the pendula."""
    from modal.coupling import coupling_report, explain
    from modal.scene import load

    kind = picture(options.output) if options.output else ""
    coupling = explain(load(options.scene))
    if kind:
        from modal.plotting import draw_coupling

        with drawn(options.output, options.theme) as stream:
            draw_coupling(coupling, stream, kind)
    sys.stdout.write(coupling_report(coupling, options.format))


def _explain_arguments(page: Page) -> None:
    add_scene(page)
    add_format(page, ("text", "markdown", "json"))
    add_picture(page, "--output", "-o")


COMMANDS = (
    Command(
        name="explain",
        topic="coupling and synchronization",
        run=explain,
        arguments=_explain_arguments,
        details=(
            "What mass a force on the cart feels at each frequency, which modes leave the cart still and which move "
            "it, how fast pendula exchange energy, what the cart's mass does to it at both ends, and what dampers take "
            "from each family. Every number stands with its formula."
        ),
        examples=(
            ("explain paper-cart-2", "families, beats and the mass that the cart seems to have"),
            ("explain metronomes -o coupling.png", "in words and in one picture"),
            ("explain crane-two-loads --format markdown", "two loads that differ: who exchanges with whom"),
        ),
    ),
)
