"""The command explain: how the cart, or the structure, couples the pendula."""

from __future__ import annotations

import argparse

from multipendula.command import Command
from multipendula.commands.shared import draw_in, noted, picture, say
from multipendula.options import add_format, add_report, add_scene
from multipendula.parser import Page


def explain(options: argparse.Namespace) -> None:
    """Explain, in words and in a figure, how the cart or the structure couples the pendula."""
    from modal.coupling import coupling_report, explain
    from modal.scene import load

    if options.output:
        picture(options.output)
    coupling = explain(noted(load(options.scene), "the explanation of the coupling"))
    draw_in(options, options.output, "modal.plotting", "draw_coupling", coupling)
    say(coupling_report(coupling, options.format), options.format)


def _explain_arguments(page: Page) -> None:
    add_scene(page)
    add_format(page, ("text", "markdown", "json"))
    add_report(page, ("text", "markdown", "json"))


COMMANDS = (
    Command(
        name="explain",
        topic="coupling and synchronization",
        run=explain,
        arguments=_explain_arguments,
        details=(
            "The dynamic mass that a force on the cart feels at each frequency, which modes leave the cart still and "
            "which move it, how fast pendula exchange energy, the limits of a massless and of an immense cart, and how "
            "dampers affect each family. On a structure: its own modes and the mass that a push along them feels, what "
            "of it each family moves, and the exchange through it and through springs. Every number is given with its "
            "formula."
        ),
        examples=(
            ("explain paper-cart-2", "families of modes, beats and dynamic mass"),
            ("explain metronomes -o coupling.png", "with a figure"),
            ("explain crane-two-loads --format markdown", "the energy exchange of two different loads"),
            ("explain two-swings -o coupling.png", "two populations of metronomes on swings joined by a spring"),
        ),
    ),
)
