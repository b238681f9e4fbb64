"""The commands for derivations and proofs: derive, enclose."""

from __future__ import annotations

import argparse

from multipendula.command import Command
from multipendula.commands.shared import bar, listed, noted, output
from multipendula.completion import scenes
from multipendula.options import add_format, add_option, add_scene, add_text, add_words, offer, whole
from multipendula.parser import Page

TARGETS = ("chain:", "cart:", "paper:000", "paper:001", "paper:002")


def derive(options: argparse.Namespace) -> None:
    """Derive equations of motion, matrices, eigen-polynomial and modes in symbols."""
    from modal.errors import SceneError
    from modal.report import folded
    from modal.symbolic import derivation, typesetting
    from modal.symbolic.papers import catalogue

    show, symbols, ways = (listed(getattr(options, name)) for name in ("show", "symbolic", "equilibrium"))
    if unknown := [word for word in show if word not in derivation.SECTIONS]:
        raise SceneError([f"--show {word}: must be one of {', '.join(derivation.SECTIONS)}" for word in unknown])
    if options.target.startswith("paper:"):
        if show or symbols or ways or options.links != "bob":
            raise SceneError([f"{options.target}: takes none of --show, --symbolic, --links and --equilibrium"])
        title, sections = catalogue.paper(options.target.removeprefix("paper:"))
    else:
        system, scene = derivation.target(options.target, options.links, symbols, ways)
        title = system.title
        sections = list(derivation.derive(system, show or derivation.SECTIONS, scene and noted(scene)))
    with output(options.output) as write:
        text = typesetting.typeset(title, sections, options.format)
        write(folded(text) if options.format == "text" else text)


def _derive_arguments(page: Page) -> None:
    target = page.asked.add_argument(
        "target",
        metavar="TARGET",
        help="chain:N, cart:N (a chain of N links on a cart), cart:PxN (P of them), "
        "paper:000, paper:001 or paper:002 (as printed and corrected), or a scene",
    )
    offer(target, scenes((".toml",), TARGETS))
    symbols = ("masses", "lengths", "gravity", "cart", "supports", "springs")
    more = f", one for each link, shared by copies: {','.join(symbols)}"
    add_words(page.asked, "--symbolic", symbols, more)
    sections = ("lagrangian", "equations", "matrices", "polynomial", "modes")
    add_words(page.written, "--show", sections, f" that are shown (default all): {','.join(sections)}")
    page.rephrase(r"choose polynomial and modes alone$", "choose --show polynomial,modes")
    page.rephrase(r"^symbolic(?= )", "--symbolic")
    page.rephrase(r"a kind of link and an equilibrium are", "--links and --equilibrium are")
    more = " of chain: and cart: (default bob)"
    add_option(page.asked, "--links", more, choices=("bob", "rod"), default="bob")
    add_words(page.asked, "--equilibrium", ("down", "up"), " of chain: and cart: (default down)")
    add_format(page, ("text", "latex", "markdown"))
    add_text(page)


def enclose(options: argparse.Namespace) -> None:
    """Print a proved enclosure of every natural frequency, to any number of digits."""
    from modal.exact import enclose
    from modal.report import folded
    from modal.scene import load

    with output(options.output) as write, bar(1.0, "scene") as report:
        for row in enclose(noted(load(options.scene), "an enclosure"), options.digits, report):
            folds = f", {row.multiplicity}-fold" if row.multiplicity > 1 else ""
            write(folded(f"{row.low} <= omega <= {row.high} rad/s  {row.label}{folds}") + "\n")


def _enclose_arguments(page: Page) -> None:
    add_scene(page)
    more = ": a relative width of 10^-N (default 30)"
    add_option(page.asked, "--digits", more, type=whole(1000), default=30)
    add_text(page)


COMMANDS = (
    Command(
        name="derive",
        topic="symbols and proof",
        run=derive,
        arguments=_derive_arguments,
        details=(
            "The whole derivation from the Lagrangian to the modes, to read or to paste into lecture notes. Each step "
            "is confirmed by a second method. paper:000, paper:001 and paper:002 give a paper's equations as printed "
            "and corrected."
        ),
        examples=(
            ("derive chain:3", "three bobs: Lagrangian, equations, M and K, polynomial, modes"),
            ("derive chain:2 --symbolic masses,lengths --format latex", "with a symbol for every mass and length"),
            ("derive paper-cart-2 --show polynomial", "a scene's polynomial, in exact integers"),
            ("derive two-bobs --symbolic masses,springs", "two pendula and the spring between them"),
            ("derive paper:002", "the equations of a paper, as printed and corrected"),
        ),
    ),
    Command(
        name="enclose",
        topic="symbols and proof",
        run=enclose,
        arguments=_enclose_arguments,
        details=(
            "Two decimals for each frequency, between which it provably lies, by ball arithmetic. Needs the extra "
            "`certified`, and a scene without dampers, joint springs and inverted links."
        ),
        examples=(
            ("enclose chain-3", "30 digits, proved"),
            ("enclose paper-cart-2 --digits 50", "50 digits"),
        ),
    ),
)
