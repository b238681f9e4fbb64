"""The derive and enclose commands, and how formulas are printed."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest
import sympy as sp
from amounts import usually
from test_cli import printed, refused

from modal import Bob, Cart, Pendulum, Scene, dump, load, natural_modes
from modal.symbolic import coordinate, plain, typeset
from modal.symbolic.papers import CORRECTED, PRINTED, RIGHT, catalogue
from modal.symbolic.typesetting import LINE, broken_lines, is_short, letters


def test_a_derivation_in_text(capsys: pytest.CaptureFixture[str]) -> None:
    text = printed(capsys, "derive", "chain:3")
    assert "6 λ^3 + 18 λ^2 + 9 λ + 1 = 0" in text
    assert "x^3 - 9 x^2 + 18 x - 6 = 0" in text
    assert text.count("checked term by term") == 2
    assert next(line for line in text.splitlines() if line.startswith("---")).count("-") == len("Lagrangian")


@pytest.mark.parametrize(
    "target",
    [
        *("chain:1", "chain:3", "cart:2", "cart:2x1", "paper-cart-2", "metronomes", "chain-spatial"),
        *("paper:000", "paper:001", "paper:002"),
    ],
)
def test_latex_is_balanced(capsys: pytest.CaptureFixture[str], target: str) -> None:
    latex = printed(capsys, "derive", target, "--format", "latex")
    for environment in ("equation*", "align*", "matrix", "cases"):
        assert latex.count(rf"\begin{{{environment}}}") == latex.count(rf"\end{{{environment}}}")
    assert r"\begin{equation*}" in latex
    assert latex.count("$") % 2 == 0
    assert latex.count("{") == latex.count("}")
    assert latex.isascii()


PAPERS = pytest.mark.parametrize("number", ["000", "001", "002"])
ENGINE = shutil.which("pdflatex")
DOCUMENT = "\\documentclass{{article}}\n\\usepackage{{amsmath}}\n\\begin{{document}}\n{}\n\\end{{document}}\n"
LETTERS = ("".join(map(chr, range(0xA1, 0x180))), "".join(map(chr, range(0x20, 0x7F))), "日本語 Ωδ שלום 🙂 ﬁ ✓ \ufffe")


def set_by_latex(latex: str, folder: Path) -> str:
    """The log of pdfLaTeX, which must not stop."""
    (folder / "page.tex").write_text(DOCUMENT.format(latex), encoding="utf-8")
    return compiled(folder / "page.tex")


def compiled(path: Path) -> str:
    command = [str(ENGINE), "-interaction=nonstopmode", "-halt-on-error", path.name]
    ran = subprocess.run(command, cwd=path.parent, capture_output=True, check=False)
    log = path.with_suffix(".log").read_text(encoding="utf-8", errors="replace")
    assert ran.returncode == 0, log[-2000:]
    return log


@PAPERS
def test_formulas_of_the_papers_fit_the_line(capsys: pytest.CaptureFixture[str], number: str, tmp_path: Path) -> None:
    latex = printed(capsys, "derive", f"paper:{number}", "--format", "latex")
    displays = re.findall(r"\\begin\{(?:equation|align)\*\}\n(.*?)\n\\end", latex, flags=re.DOTALL)
    rows = [row for display in displays for row in display.split("\\\\\n")]
    assert max(map(letters, rows)) <= LINE
    assert len(rows) > len(displays) > 10
    if ENGINE:
        assert "Overfull" not in set_by_latex(latex, tmp_path)


@PAPERS
def test_a_broken_formula_has_all_its_parts(number: str) -> None:
    for equation in (line.formula for section in catalogue.paper(number)[1] for line in section.lines):
        whole = sp.latex(equation, long_frac_ratio=2)
        parts = broken_lines(whole, 20.0)
        joined = "".join(parts).replace(r"\bigl", r"\left").replace(r"\bigr", r"\right")
        assert re.sub(r"\s", "", joined) == re.sub(r"\s", "", whole)
        assert len(parts) > 1 or letters(whole) <= 20.0 or "matrix" in whole


def test_the_estimate_of_widths_bites() -> None:
    assert not is_short(" + ".join(["x"] * 40))
    assert broken_lines(r"a \left(b + c\right)", 3.0) == [r"a \bigl(b", r"+ c\bigr)"]
    assert letters(r"\frac{x + y}{z}") < letters("x + y + z") < 2 * letters("x + y")


@pytest.mark.parametrize("title", LETTERS)
def test_titles_beyond_the_fonts_compile(title: str, tmp_path: Path) -> None:
    latex = typeset(title, [], "latex")
    guarded = re.sub(r"\\ifdefined\\Umathchar .\\else(.*?)\\fi\{\}", r"\1", latex)
    assert guarded.isascii()
    assert not set("&%$#_^~") & set(re.sub(r"^%.*|\\.|\$[^$]*\$", "", guarded))
    if ENGINE:
        set_by_latex(latex, tmp_path)


def test_markdown(capsys: pytest.CaptureFixture[str]) -> None:
    text = printed(capsys, "derive", "chain:2", "--symbolic", "masses,lengths", "--format", "markdown")
    assert text.count("$$") % 2 == 0
    assert text.startswith("# A chain of two bobs\n\n## Lagrangian")


def test_only_what_is_asked_for(capsys: pytest.CaptureFixture[str]) -> None:
    text = printed(capsys, "derive", "cart:1", "--show", "polynomial")
    assert "Eigen-polynomial" in text
    assert "Lagrangian" not in text


def test_a_scene_in_exact_numbers(capsys: pytest.CaptureFixture[str]) -> None:
    text = printed(capsys, "derive", "paper-cart-2", "--show", "polynomial,modes")
    assert "880000 ω^4 - 52238250 ω^2 + 337788711 = 0" in text
    assert "ω = 2.71754911798158 rad/s" in text
    assert "rigid translation; ω = 0 rad/s:  ω^2 = 0" in text


@pytest.mark.parametrize("number", ["000", "001", "002"])
def test_every_numbered_equation_is_printed(capsys: pytest.CaptureFixture[str], number: str) -> None:
    text = printed(capsys, "derive", f"paper:{number}")
    headings = re.findall(r"^\((.*?)\)", text, flags=re.MULTILINE)
    expected = {"000": {"III.A", "III.D"}, "001": set(map(str, range(1, 17))), "002": set(map(str, range(1, 16)))}
    covered = set()
    for heading in headings:
        low, _, high = heading.partition("-")
        covered |= set(map(str, range(int(low), int(high) + 1))) if high.isdigit() else {heading}
    assert expected[number] <= covered


def test_closed_forms_of_equal_rods(capsys: pytest.CaptureFixture[str]) -> None:
    text = printed(capsys, "derive", "chain:3", "--links", "rod", "--show", "polynomial,modes")
    assert "26 x^3 - 369 x^2 + 1008 x - 405 = 0" in text
    assert "405 λ^3 + 1008 λ^2 + 369 λ + 26 = 0" in text
    assert text.count("√(g/l)") == 3
    assert ":  x = 3\n" in text


def test_no_mode_goes_missing(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    for target in ("metronomes", "cart-upright", "chain-spatial", "crane-two-loads", "paper-cart-3"):
        text = printed(capsys, "derive", target, "--show", "modes")
        modes = natural_modes(load(target))
        for omega in modes.omega:
            assert leading(omega) in text or omega == 0, (target, omega)


def test_standing_links_with_joint_springs(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path = tmp_path / "sprung.toml"
    links = ", ".join(f'{{ kind = "rod", mass = 1, length = 1, stiffness = {k} }}' for k in (9, 2.5))
    path.write_text(f"gravity = 9.81\n[[pendulum]]\nequilibrium = ['up', 'up']\nlinks = [{links}]\n")
    text = printed(capsys, "derive", str(path), "--show", "modes")
    for value in natural_modes(load(path)).eigenvalue:
        assert leading(abs(value)) in text


def leading(value: float) -> str:
    """The first eight digits, as any longer print of the number begins."""
    return f"{value:.12f}"[:9]


@pytest.mark.parametrize(("stiffness", "words"), [(2.0, "ω = 0 rad/s"), (1.0, "growth rate = 3.53553390593274 1/s")])
def test_a_spring_that_just_holds_or_fails_to(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, stiffness: float, words: str
) -> None:
    """One bob of 0.5 kg standing 0.4 m above its joint at g = 10: x = (k − 2)/0.08."""
    path = tmp_path / "balance.toml"
    link = f'{{ kind = "bob", mass = 0.5, length = 0.4, stiffness = {stiffness} }}'
    path.write_text(f"gravity = 10.0\n[[pendulum]]\nequilibrium = ['up']\nlinks = [{link}]\n")
    assert words in printed(capsys, "derive", str(path), "--show", "modes")


def test_space_has_unit_vectors_and_angles(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path = tmp_path / "space.toml"
    path.write_text(
        "gravity = 9.81\nspace = 'space'\n[support]\nkind = 'cart'\nmass = 2\ndamping = 0.5\n"
        "[[pendulum]]\nlinks = [{ kind = 'bob', mass = 1, length = 1 }]\n"
    )
    text = printed(capsys, "derive", str(path), "--show", "lagrangian,equations")
    assert "e_x · F = 0 with" in text
    assert "x'/2" in text
    assert text.count("for comparison in θ and φ") == 3
    assert "checked term by term" in text


def test_a_scene_in_symbols(capsys: pytest.CaptureFixture[str]) -> None:
    text = printed(capsys, "derive", "crane-hook", "--symbolic", "masses,lengths,gravity,cart", "--show", "matrices")
    assert "m_1 + m_2 + m_c" in text


def test_the_double_pendulum_in_symbols_is_short(capsys: pytest.CaptureFixture[str]) -> None:
    text = printed(capsys, "derive", "chain:2", "--symbolic", "masses,lengths", "--show", "lagrangian,modes")
    assert "V = -m_2 g l_2 cos(θ2) - g l_1 (m_1 + m_2) cos(θ1)" in text
    numbers = {"g": 9.81, "m_1": 0.3, "m_2": 0.1, "l_1": 0.4, "l_2": 0.25}
    squares = []
    for line in text.splitlines():
        if "ω^2 = " in line:
            formulas = re.sub(r"(?<=[\w)]) (?=[\w(])", "*", line.partition(" = ")[2]).replace("^", "**")
            assert len(formulas) < 180
            for formula in (formulas.replace("±", "-"), formulas.replace("±", "+")):
                symbols = {name: sp.Symbol(name) for name in numbers}
                squares.append(float(sp.sympify(formula, locals=symbols).subs(numbers)))
    bobs = [Bob(mass=0.3, length=0.4), Bob(mass=0.1, length=0.25)]
    assert squares == pytest.approx(natural_modes(Scene(gravity=9.81, pendulum=[Pendulum(links=bobs)])).omega ** 2)


def test_copies_share_their_symbols(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path = tmp_path / "copies.toml"
    twins = Pendulum(links=[Bob(mass=0.2, length=0.5)], count=2)
    symbols = ("--symbolic", "masses,lengths,gravity,cart", "--show", "modes")
    dump(Scene(gravity=9.81, support=Cart(mass=2.0), pendulum=[twins]), path)
    text = printed(capsys, "derive", str(path), *symbols)
    assert "the cart moves; natural frequency:  ω^2 = g (2 m + m_c)/(m_c l)" in text
    assert "the cart stays still; natural frequency:  ω^2 = g/l" in text
    other = Pendulum(links=[Bob(mass=0.2, length=0.6)])
    dump(Scene(gravity=9.81, support=Cart(mass=2.0), pendulum=[twins, other]), path)
    text = printed(capsys, "derive", str(path), *symbols[:2], "--show", "matrices")
    assert "2 m_1 + m_3 + m_c" in text


def test_a_single_pendulum_needs_no_number(capsys: pytest.CaptureFixture[str]) -> None:
    text = printed(capsys, "derive", "chain-unequal", "--show", "polynomial,modes")
    assert "in x = ω² (rad²/s²)" in text
    assert "pendulum 1" not in text


def test_hundreds_of_bobs(capsys: pytest.CaptureFixture[str]) -> None:
    count = usually(150, 1000)
    text = printed(capsys, "derive", f"chain:{count}", "--show", "polynomial,modes")
    assert f"{count**2} λ + 1 = 0" in text
    assert "see the table" in text


def test_too_many_symbols(capsys: pytest.CaptureFixture[str]) -> None:
    text = printed(capsys, "derive", "cart:8", "--symbolic", "masses,lengths", "--show", "polynomial,modes")
    assert "too long to write out" in text


def test_another_rest(capsys: pytest.CaptureFixture[str]) -> None:
    text = printed(capsys, "derive", "chain:2", "--equilibrium", "up,down", "--show", "matrices,modes")
    assert "θ1 up, θ2 down" in text
    assert "growth rate = 1.18920711500272 √(g/l):  x = -sqrt(2)" in text


def test_the_papers_as_printed_and_as_corrected(capsys: pytest.CaptureFixture[str]) -> None:
    for number, least in (("000", 15), ("001", 20), ("002", 8)):
        text = printed(capsys, "derive", f"paper:{number}")
        assert len(re.findall(r"^-+$", text, flags=re.MULTILINE)) >= least
        assert PRINTED in text or RIGHT in text
    assert CORRECTED in printed(capsys, "derive", "paper:000")


def test_equations_of_a_paper_by_their_numbers(capsys: pytest.CaptureFixture[str]) -> None:
    """Those of a paper that are asked for; a section's where the paper numbers none, and all that a number covers."""
    for number, show, titles in (
        ("001", "13,15", ["(13) ", *(f"(15) row {i}" for i in (1, 2, 3, 4))]),
        ("001", "12-14", ["(12-14, n = 4)", "(12-14, n = 5)"]),
        ("002", "13", ["(12-13) "]),
        ("000", "V", ["(V) "]),
    ):
        text = printed(capsys, "derive", f"paper:{number}", "--show", show)
        shown = re.findall(r"^\(.*", text, flags=re.MULTILINE)
        assert [line[: len(title)] for line, title in zip(shown, titles, strict=True)] == titles


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("chain:0",), "from 1 to 1000 links in all"),
        (("cart:50x50",), "from 1 to 1000 links in all"),
        (("chain:50",), "for at most 40; choose --show polynomial,modes"),
        (("chain:2x2",), "chain:2x2: "),
        (("paper:003",), "must be one of paper:000, paper:001, paper:002"),
        (("chain:2", "--symbolic", "colours"), "--symbolic colours: must be one of masses, lengths, gravity, cart"),
        (("chain:2", "--show", "all"), "--show all: must be one of"),
        (("chain:2", "--equilibrium", "up"), "must be 2 of down and up"),
        (("no-such-scene",), "no such file"),
        (("crane-hook", "--equilibrium", "up,up"), "chain: and cart: only"),
        (("paper:001", "--symbolic", "masses"), "takes none of"),
        (("paper:001", "--show", "modes"), "--show modes: paper:001 has 1, 2, "),
        (("thousand-pendula",), "for at most 40"),
    ],
)
def test_refusals(capsys: pytest.CaptureFixture[str], words: tuple[str, ...], message: str) -> None:
    assert message in refused(capsys, 2, "derive", *words)


def test_plain_formulas() -> None:
    theta = coordinate("theta", 1, 2)
    assert plain(theta.a + theta.v**2 * sp.Symbol("m_1")) == "m_1 θ1,2'^2 + θ1,2''"
    assert plain(sp.Matrix([[1, sp.Symbol("lambda")]])) == "\n      [ 1  λ ]"


def test_enclosures_on_the_command_line(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("flint")
    lines = printed(capsys, "enclose", "paper-cart-2", "--digits", "40").splitlines()
    assert len(lines) == 5
    assert lines[2].startswith("2.717549117981582332181690721862")


def test_a_title_stays_as_it_is(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path = tmp_path / "odd.toml"
    path.write_text(
        "title = 'cost $5_a & 50% x_1'\ngravity = 9.81\n[[pendulum]]\n"
        "links = [{ kind = 'bob', mass = 1, length = 1 }]\n"
    )
    comment, heading, *_ = printed(capsys, "derive", str(path), "--format", "latex").splitlines()
    assert comment == "% needs the package amsmath"
    assert heading == r"\section*{cost \$5\_a \& 50\% x\_1}"


SWINGS = """
gravity = 9.81
spring = [{ between = ["left", "right_one"], stiffness = 60, damping = 0.1 }]

[[support]]
kind = "swing"
name = "left"
mass = 2
length = 0.25

[[support]]
kind = "tilt"
name = "right_one"
mass = 3
inertia = 0.1
centre = [0.0, 0.2]
position = [2.0, 0.0]

[[pendulum]]
on = "left"
links = [{ kind = "bob", mass = 0.3, length = 0.1 }]
"""


def test_a_structure_bears_the_names_of_its_supports(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path = tmp_path / "swings.toml"
    path.write_text(SWINGS)
    text = printed(capsys, "derive", str(path))
    for line in (
        "kinetic energy of left:  T_1 = s_left'^2",
        "potential energy of spring 1, from left to right_one:  V_4 = 30 (ℓ1 - 2)^2",
        "pull of spring 1:  F_1 = 60 ℓ1 + ℓ1'/10 - 120",
        "for φ_right_one:  ",
        "det(s² M + s D + K)",
    ):
        assert line in text
    assert "dot" not in text
    assert text.count("checked term by term") == 1
    latex = printed(capsys, "derive", str(path), "--symbolic", "supports,springs", "--format", "latex")
    assert r"\ddot{\phi}_{\mathrm{right\_one}}" in latex
    assert r"m_{\mathrm{left}} \dot{s}_{\mathrm{left}}^{2}" in latex
    assert latex.count("{") == latex.count("}")
    assert latex.isascii()


@pytest.mark.parametrize("name", ["paper-cart-2", "metronomes", "cart-upright", "chain-spatial", "beam"])
def test_modes_have_the_numbers_of_the_table(capsys: pytest.CaptureFixture[str], name: str) -> None:
    """Undamped, damped, growing, in space, on a structure."""
    text = printed(capsys, "derive", name, "--show", "modes")
    rows = re.findall(
        r"^  mode (\d+);.*?(?:ω =|growth rate =|decays at|translation)(?: ([\d.]+))?", text, flags=re.MULTILINE
    )
    modes = natural_modes(load(name))
    assert [int(number) for number, _ in rows] == modes.number.tolist()
    assert [float(rate or 0) for _, rate in rows] == pytest.approx(modes.omega, rel=1e-12)


def test_latex_sets_matrices_units_and_words(capsys: pytest.CaptureFixture[str]) -> None:
    latex = printed(capsys, "derive", "beam", "--format", "latex", "--show", "matrices,polynomial,modes")
    assert r"\subsection*{Linearized: $M \ddot{q} + D \dot{q} + K q = 0$}" in latex
    assert r"q = \begin{bmatrix}\phi_{\mathrm{tilt}}\\\theta_{1}\\\theta_{2}\end{bmatrix}" in latex
    assert r"Mode 3; board tilts: pendula in antiphase with the support; $\omega = 12.5646\,\mathrm{rad" in latex
    assert r"$\zeta = 0.0363967$:" in latex
    assert r"s = -0.457312 \pm 12.5563\, i" in latex
    assert r"$\det(s^{2} M + s D + K)$:" in latex


@pytest.mark.parametrize("target", [("chain:3",), ("cart:2x1",), ("two-bobs", "--symbolic", "equal")], ids=str)
def test_slides_are_whole_and_hold_what_they_show(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, target: tuple[str, ...]
) -> None:
    """No line wider than a slide and none below it; every formula is there, and remarks are notes."""
    path = tmp_path / "slides.tex"
    printed(capsys, "derive", *target, "--format", "beamer", "-o", str(path))
    slides = path.read_text(encoding="utf-8")
    plain_latex = printed(capsys, "derive", *target, "--format", "latex")
    displays = [text.count(r"\begin{equation*}") + text.count(r"\begin{align*}") for text in (slides, plain_latex)]
    assert displays[0] == displays[1]
    assert r"\note{$T$ equals the kinetic energy" in slides
    if "two-bobs" in target:
        assert "spring 1, from pendulum 1 to pendulum 2" in slides
        assert "$d$: horizontal distance of pivots" in slides
        assert r"\ell_{1} - d" in slides
        assert "Mode 2; fixed support: antiphase; natural frequency:" in slides
    if "chain:3" in target:
        assert r"\frac{1}{2} m l^{2} \dot{\theta}_{3}^{2}" in slides
    if ENGINE:
        assert "Overfull" not in compiled(path)


def test_free_bodies_are_drawn_or_written(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    for ending, head in (("svg", b"<?xml"), ("tikz", b"\\definecolor"), ("tex", b"\\definecolor")):
        path = tmp_path / f"parts.{ending}"
        printed(capsys, "derive", "cart:1", "--show", "freebody", "--names", "paper", "-o", str(path))
        assert path.read_bytes().startswith(head)
    balances = tmp_path / "balances.tex"
    printed(capsys, "derive", "cart:1x2", "--show", "freebody", "--format", "latex", "-o", str(balances))
    latex = balances.read_text(encoding="utf-8")
    assert latex.isascii()
    assert latex.count(r"\begin{equation*}") + latex.count(r"\begin{align*}") == 13
    assert "13 equations for 13 unknowns" in latex


def test_what_free_bodies_do_not_take_is_said(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    picture = str(tmp_path / "parts.png")
    refusals = {
        ("-o", picture): "only free-body diagrams are drawn",
        ("--names", "paper"): "needs --show freebody",
        ("--show", "freebody,modes"): "cannot be combined with other sections",
        ("--show", "freebody", "--symbolic", "masses"): "not needed for free bodies",
        ("--show", "freebody", "--parts", "2"): "selects what is drawn",
        ("--show", "freebody", "--parts", "2:9", "-o", picture): "the scene has parts 1 to 3",
    }
    for words, message in refusals.items():
        assert message in refused(capsys, 2, "derive", "chain:2", *words)
    assert "at most 40" in refused(capsys, 2, "derive", "chain:50", "--show", "freebody")
