"""The command explain: how the cart, or the structure, couples the pendula."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

import modal
from multipendula.command import SCENE, Command, formats, report_file
from multipendula.commands.shared import noted, picture, show

if TYPE_CHECKING:
    from modal.coupling import Coupling

MORE = "--words explains everything in sentences with formulas; --format json contains every number."
MAP = "`multipendula sync {} --vary NUMBER=FIRST:LAST:COUNT --map` shows which long-term motions occur, and how often."


def explain(options: argparse.Namespace) -> Coupling:
    """Explain how the cart or the structure couples the pendula: verdict, table of families, figure.

    First the verdict: what couples the pendula, how strongly, and the slowest beat. Then one table of the families
    of modes, and what both neglect. With --words everything is explained in sentences, every number with its
    formula: the dynamic mass of the cart at each frequency, which modes leave the cart at rest and which move it,
    the exchange of energy, the limits of a massless and of an immense cart, and the damping of each mode. For a
    structure: its own modes and their dynamic mass, what each family moves, and the exchange through it and through
    springs.

    Examples
    --------
    explain paper-cart-2
        what couples two double pendula: families of modes and beats
    explain paper-cart-2 --words
        the same in sentences, with formulas
    explain metronomes -o coupling.png
        with a figure
    explain crane-two-loads --format markdown
        the energy exchange of two different loads
    explain two-swings -o coupling.png
        two populations of metronomes on swings joined by a spring
    """
    from modal.coupling import coupling_report, explain

    picture(options.output)
    coupling = explain(noted(modal.load(options.scene), "the explanation of the coupling"))
    elsewhere = [MORE] * (not options.words) + [MAP.format(options.scene)] * coupling.scene.is_driven
    report = coupling_report(coupling, options.format, words=options.words, elsewhere="\n".join(elsewhere))
    show(options, report, "coupling_figure", coupling, room="modal.plotting")
    return coupling


COMMANDS = (
    Command(
        topic="coupling and synchronization",
        run=explain,
        main=("--words", "--format", "--output"),
        takes=(
            SCENE,
            formats("text", "markdown", "json"),
            "--words, every number with its formula",
            *report_file("text", "markdown", "json"),
        ),
    ),
)
