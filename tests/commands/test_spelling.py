"""Text where an encoding lacks letters, as on Windows: spelled, never replaced by question marks."""

from __future__ import annotations

import json
import re
import sys
from contextlib import suppress
from io import BytesIO, TextIOWrapper

import pytest

from modal.report.fitting import breadth, fitted
from modal.report.spelling import SPELLED, SPELLINGS, spelled
from multipendula.cli import main

SAID = {
    ("table paper-cart-2", "ascii"): ["omega (rad/s)", "rel. error <=", "deg)"],
    ("table paper-cart-2", "cp1252"): ["omega (rad/s)", "rel. error <=", "(°)"],
    ("explain crane-two-loads", "ascii"): ["omega", "Delta omega"],
    ("check chain-1 --amplitudes 5", "cp1252"): ["omega"],
    ("sync huygens --duration 0.5", "ascii"): ["deg"],
    ("derive chain:2", "ascii"): ["lambda = -g/(l omega^2)", "theta1''"],
    ("derive chain:2", "cp1252"): ["lambda = -g/(l omega²)"],
    ("table --help", "ascii"): ["usage:"],
    ("table nosuch-ω", "ascii"): ["nosuch-omega"],
}
"""Commands and encodings, with words of what is printed."""


def printed(command: str, encoding: str, monkeypatch: pytest.MonkeyPatch) -> str:
    """What a command prints on streams of an encoding, as PYTHONIOENCODING sets it."""
    stream = TextIOWrapper(BytesIO(), encoding, errors="strict", write_through=True)
    monkeypatch.setenv("PYTHONIOENCODING", encoding)
    with monkeypatch.context() as patch:
        patch.setattr(sys, "stdout", stream)
        patch.setattr(sys, "stderr", stream)
        with suppress(SystemExit):
            main(command.split())
        stream.flush()
    content = stream.buffer
    assert isinstance(content, BytesIO)
    return content.getvalue().decode(encoding)


@pytest.mark.parametrize(("command", "encoding"), SAID)
def test_letters_that_an_encoding_lacks_are_spelled(
    command: str, encoding: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = printed(command, encoding, monkeypatch)
    assert [words for words in SAID[command, encoding] if words not in text] == []
    assert "?" not in text
    assert r"\u" not in text


def test_text_into_a_pipe_is_utf_8_unless_an_encoding_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    stream = TextIOWrapper(BytesIO(), "cp1252")
    monkeypatch.delenv("PYTHONIOENCODING", raising=False)
    monkeypatch.setattr(sys, "stdout", stream)
    main(["table", "chain-2"])
    stream.flush()
    assert (stream.encoding, "ω" in stream.buffer.getvalue().decode()) == ("utf-8", True)  # type: ignore[attr-defined]


def test_columns_stay_columns(monkeypatch: pytest.MonkeyPatch) -> None:
    lines = printed("table paper-cart-2", "ascii", monkeypatch).split("\n")
    rule = next(line for line in lines if line.startswith("----"))
    heading = lines[lines.index(rule) - 1]
    ends = [match.end() for match in re.finditer("-+", rule)]
    assert [match.end() for match in re.finditer(r"\S+(?: \S+)*", heading)][1:4] == ends[1:4]
    with fitted(None, "ascii"):
        assert breadth("ω ≤ 1°") == len("omega <= 1 deg")
    with fitted(None, "cp1252"):
        assert breadth("ω ≤ 1°") == len("omega <= 1°")
    assert breadth("ω ≤ 1°") == 6


def test_json_stays_json(monkeypatch: pytest.MonkeyPatch) -> None:
    title = "“Δω” ≤ 振り子 ½ \U0001f600 ¡"
    written = json.dumps({"title": title}, ensure_ascii=False)
    read = json.loads(written.encode("ascii", SPELLED))["title"]
    assert read == "'Delta omega' <= 振り子 (1/2) \U0001f600 ¡"
    assert not set('"\\') & set("".join(SPELLINGS.values()))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("ω² = g/l", "omega^2 = g/l"),
        ("s⁻² and 10⁻¹²", "s^-2 and 10^-12"),
        ("φᵀAφ, Σmᵣ", "phi^T A phi, Sigma m_r"),
        ("λ₁₂ ± 3°", "lambda_12 +- 3 deg"),
        ("Müller, Straße, ẍ, θ̇, ς", "Muller, Strasse, x_ddot, theta_dot, sigma"),
        ("振\ud800", "\\u632f\\ud800"),
        ("plain", "plain"),
    ],
)
def test_spellings(text: str, expected: str) -> None:
    assert spelled(text) == expected


def test_raised_letters_are_spelled_together() -> None:
    assert spelled("s⁻² ω²", "cp1252") == "s^-2 omega²"
    assert spelled("m² ± 1° é", "cp1252") == "m² ± 1° é"
