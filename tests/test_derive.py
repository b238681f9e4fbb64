"""The derive and enclose commands, and how formulas are printed."""

from __future__ import annotations

import re

import pytest
import sympy as sp
from test_cli import printed, refused

from modal.lagrange import coordinate
from modal.typeset import plain


def test_a_derivation_in_text(capsys: pytest.CaptureFixture[str]) -> None:
    text = printed(capsys, "derive", "chain:3")
    assert "6 λ^3 + 18 λ^2 + 9 λ + 1 = 0" in text
    assert "x^3 - 9 x^2 + 18 x - 6 = 0" in text
    assert text.count("checked term by term") == 2
    assert next(line for line in text.splitlines() if line.startswith("---")).count("-") == len("Lagrangian")


@pytest.mark.parametrize(
    "target", ["chain:1", "chain:2", "cart:2", "cart:2x1", "paper-cart-2", "crane-hook", "paper:001"]
)
def test_latex_is_balanced(capsys: pytest.CaptureFixture[str], target: str) -> None:
    latex = printed(capsys, "derive", target, "--format", "latex")
    for environment in ("equation*", "align*", "matrix", "cases"):
        assert latex.count(rf"\begin{{{environment}}}") == latex.count(rf"\end{{{environment}}}")
    assert r"\begin{equation*}" in latex
    assert latex.count("$") % 2 == 0
    assert latex.count("{") == latex.count("}")
    assert not re.search(r"[θλωφ²√]", latex)


def test_markdown(capsys: pytest.CaptureFixture[str]) -> None:
    text = printed(capsys, "derive", "chain:2", "--symbolic", "masses,lengths", "--format", "markdown")
    assert text.count("$$") % 2 == 0
    assert text.startswith("# 2 bobs in a chain\n\n## Lagrangian")


def test_only_what_is_asked_for(capsys: pytest.CaptureFixture[str]) -> None:
    text = printed(capsys, "derive", "cart:1", "--show", "polynomial")
    assert "Eigen-polynomial" in text
    assert "Lagrangian" not in text


def test_a_scene_in_exact_numbers(capsys: pytest.CaptureFixture[str]) -> None:
    text = printed(capsys, "derive", "paper-cart-2", "--show", "polynomial,modes")
    assert "880000 x^2 - 52238250 x + 337788711 = 0" in text
    assert "ω = 2.71754911798158 rad/s" in text
    assert "rigid translation: ω = 0 rad/s" in text


def test_a_scene_in_symbols(capsys: pytest.CaptureFixture[str]) -> None:
    text = printed(capsys, "derive", "crane-hook", "--symbolic", "masses,lengths,gravity,cart", "--show", "matrices")
    assert "m_1 + m_2 + m_c" in text


def test_a_thousand_bobs(capsys: pytest.CaptureFixture[str]) -> None:
    text = printed(capsys, "derive", "chain:1000", "--show", "polynomial,modes")
    assert "1000000 λ + 1 = 0" in text
    assert "see the table" in text


def test_too_many_symbols(capsys: pytest.CaptureFixture[str]) -> None:
    text = printed(capsys, "derive", "cart:8", "--symbolic", "masses,lengths", "--show", "polynomial,modes")
    assert "too long to write out" in text


def test_another_rest(capsys: pytest.CaptureFixture[str]) -> None:
    text = printed(capsys, "derive", "chain:2", "--equilibrium", "up,down", "--show", "matrices,modes")
    assert "θ1 up, θ2 down" in text
    assert "ω^2 = -sqrt(2) g/l" in text


def test_the_papers_as_printed_and_as_corrected(capsys: pytest.CaptureFixture[str]) -> None:
    for number, least in (("000", 15), ("001", 20), ("002", 8)):
        text = printed(capsys, "derive", f"paper:{number}")
        assert len(re.findall(r"^-+$", text, flags=re.MULTILINE)) >= least
        assert "as the paper prints it" in text
    assert "as it should read" in printed(capsys, "derive", "paper:000")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("chain:0",), "from 1 to 1000 links in all"),
        (("cart:50x50",), "from 1 to 1000 links in all"),
        (("chain:50",), "written out for at most 40; choose --show polynomial,modes"),
        (("chain:2x2",), "a chain hangs alone"),
        (("paper:003",), "must be one of paper:000, paper:001, paper:002"),
        (("chain:2", "--symbolic", "colours"), "colours: must be one of masses, lengths, gravity, cart"),
        (("chain:2", "--show", "all"), "--show all: must be one of"),
        (("chain:2", "--equilibrium", "up"), "must be 2 of down and up"),
        (("no-such-scene",), "no such file"),
        (("thousand-pendula",), "written out for at most 40"),
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
