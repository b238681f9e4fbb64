"""The commands for derivations and proofs: derive, enclose."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import TYPE_CHECKING

import modal
from multipendula.command import SCENE, THEME, Command, argument, option, text_file
from multipendula.commands.shared import bar, drawn, in_a_folder, listed, noted, output
from multipendula.completion import scenes, words
from multipendula.options import PICTURES

if TYPE_CHECKING:
    from modal.exact.enclosures import Enclosure

SECTIONS = ("lagrangian", "equations", "matrices", "polynomial", "modes")
SYMBOLS = ("masses", "lengths", "gravity", "cart", "supports", "springs", "equal")
ALONE = ("hamiltonian", "freebody")
TARGETS = ("chain:", "cart:", "paper:000", "paper:001", "paper:002")
TARGET = (
    "chain:N, cart:N (a chain of N links on a cart), cart:PxN (P of them), paper:000, paper:001 or paper:002 (as "
    "printed and corrected), or a scene"
)


def derive(options: argparse.Namespace) -> None:
    """Derive equations of motion, matrices, eigen-polynomial and modes in symbols.

    The whole derivation from the Lagrangian to the modes, to read or to paste into lecture notes. For a few links
    every step is confirmed by a second method. paper:000, paper:001 and paper:002 give a paper's equations as
    printed and corrected.

    Examples
    --------
    derive chain:3
        three bobs: Lagrangian, equations, M and K, polynomial, modes
    derive chain:2 --symbolic masses,lengths --format latex
        with a symbol for every mass and length
    derive paper:002 --show 4,11
        two equations of a paper, as printed and corrected
    derive chain:3 --show hamiltonian
        Hamilton's equations, which join neighbours only
    derive paper-cart-2 --show freebody --names paper -o parts.svg
        its links taken apart, in 000's letters
    """
    from modal.report import folded
    from modal.symbolic import derivation, typesetting

    show, symbols, ways = (listed(getattr(options, name)) for name in ("show", "symbolic", "equilibrium"))
    of_paper, known = str(options.target).startswith("paper:"), (*derivation.SECTIONS, *ALONE)
    if unknown := [word for word in show if not of_paper and word not in known]:
        raise modal.SceneError([f"--show {word}: must be one of {', '.join(known)}" for word in unknown])
    if "freebody" in show and not of_paper:
        _take_apart(options, show)
        return
    if problems := list(_of_free_bodies(options)):
        raise modal.SceneError(problems)
    if of_paper:
        if symbols or ways or options.links != "bob":
            raise modal.SceneError([f"{options.target}: cannot be combined with --symbolic, --links or --equilibrium"])
        from modal.symbolic.papers import catalogue

        title, sections = catalogue.paper(options.target.removeprefix("paper:"), show)
    else:
        system, scene = derivation.target(options.target, options.links, symbols, ways)
        title = system.title
        sections = list(derivation.derive(system, show or derivation.SECTIONS, noted(scene, "a derivation")))
        sections[:0] = [derivation.symbols_section(system)] * ("equal" in symbols and bool(system.values))
    with output(options.output) as write:
        text = typesetting.typeset(title, sections, options.format)
        write(folded(text) if options.format == "text" else text)


def _of_free_bodies(options: argparse.Namespace) -> Iterator[str]:
    """Options given that only free bodies take."""
    if _drawing(options):
        yield f"-o {options.output}: only free-body diagrams are drawn: add --show freebody, or write text"
    for name in ("names", "parts"):
        if getattr(options, name):
            yield f"--{name}: needs --show freebody"


def _drawing(options: argparse.Namespace) -> str:
    """The format of a picture, by the file to write: svg, png, pdf or tikz; "" for text."""
    ending = str(options.output or "").lower().rpartition(".")[2]
    if ending == "tex" and "freebody" in listed(options.show) and not getattr(options, "format_asked", False):
        return "tikz"
    return ending if ending in (*PICTURES, "tikz") else ""


def _take_apart(options: argparse.Namespace, show: tuple[str, ...]) -> None:
    """The parts of a scene: their diagrams in a picture, or the balances of each as text."""
    from modal.report import folded
    from modal.symbolic import derivation, newton_euler, typesetting

    problems = ["--show freebody: cannot be combined with other sections"] * (len(show) > 1)
    problems += ["--symbolic: not needed for free bodies, whose numbers are all symbols"] * bool(options.symbolic)
    if problems:
        raise modal.SceneError(problems)
    scene = derivation.scene_of(options.target, options.links, listed(options.equilibrium))
    letters, form = options.names or "own", _drawing(options)
    if not form:
        if options.parts:
            raise modal.SceneError(["--parts: selects what is drawn; the equations always cover all parts"])
        bodies = modal.scene.free_bodies(noted(scene, "a free-body diagram"), letters)
        with output(options.output) as write:
            text = typesetting.typeset(modal.scene.title_of(scene), newton_euler.part_sections(bodies), options.format)
            write(folded(text) if options.format == "text" else text)
        return
    from modal.plotting import free_body_tikz, plot_free_body, save

    noted(scene, "a free-body diagram")
    in_a_folder(options.output)
    if form == "tikz":
        picture = free_body_tikz(scene, letters, options.parts or "")
        with output(options.output) as write:
            write(picture)
        return
    with drawn(options.output, options.theme) as stream:
        save(plot_free_body(scene, letters=letters, parts=options.parts or ""), stream, form)


def enclose(options: argparse.Namespace) -> tuple[Enclosure, ...]:
    """Print a proved enclosure of every natural frequency, to any number of digits.

    Two decimal numbers between which each frequency provably lies, by ball arithmetic. Needs the extra `certified`
    and a scene without dampers and joint laws. For a growing mode the growth rate is enclosed.

    Examples
    --------
    enclose chain-3
        30 digits, proved
    enclose paper-cart-2 --digits 50
        50 digits
    """
    from modal.exact import enclose
    from modal.report import folded

    in_a_folder(options.output)
    scene = noted(modal.load(options.scene), "an enclosure")
    with bar(1.0, "scene") as report:
        rows = tuple(enclose(scene, options.digits, report))
    with output(options.output) as write:
        for row in rows:
            folds = f", {row.multiplicity}-fold" if row.multiplicity > 1 else ""
            name, unit = ("growth rate", "1/s") if row.is_growth else ("omega", "rad/s")
            write(folded(f"{row.low} <= {name} <= {row.high} {unit}  {row.label}{folds}") + "\n")
    return rows


COMMANDS = (
    Command(
        topic="symbols and proof",
        run=derive,
        main=("--show", "--symbolic", "--equilibrium", "--format", "--output"),
        takes=(
            argument("target", "TARGET", TARGET, scenes((".toml",), TARGETS)),
            option(
                f"--symbolic, one for each link, shared by copies: {','.join(SYMBOLS)}, the last for all "
                "of them, with one symbol for numbers that are equal in the file",
                completion=words(SYMBOLS),
            ),
            option(
                f"--show that are shown (default all): {','.join(SECTIONS)}; where they are named: {','.join(ALONE)}; "
                "of a paper its equations, such as 4,12",
                completion=words((*SECTIONS, *ALONE)),
            ),
            "--links of chain: and cart: (default bob)",
            "--equilibrium of chain: and cart: (default down)",
            "--names: paper 000's or the toolkit's own (default own), of --show freebody",
            "--parts (default 1:12), of --show freebody",
            *text_file("text", "latex", "markdown", "beamer", drawn=True, more=("tikz",)),
            THEME,
        ),
    ),
    Command(
        topic="symbols and proof",
        run=enclose,
        main=("--digits", "--output"),
        takes=(SCENE, "--digits: a relative width of 10^-N (default 30)", *text_file(kind="txt")),
    ),
)
