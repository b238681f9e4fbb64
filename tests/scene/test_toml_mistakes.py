"""Usual mistakes in TOML: the place, the line with a caret, and a guess that is right."""

from __future__ import annotations

import random
import tomllib
from pathlib import Path

import pytest

from modal import SceneError, example_names, load
from modal.scene.files import example_text, parse
from modal.scene.toml_mistakes import GUESSED_LETTERS_MAX, mistakes_in

GOOD = """gravity = 9.81

[support]
kind = "cart"
mass = 3.0

[[pendulum]]
links = [{ kind = "bob", mass = 1.0, length = 2.5 }]
"""
CARTS = '[support]\nkind = "cart"\nmass = 1.0\n[[pen'

MISTAKES = {
    "a number has a decimal point, not a comma": [("2.5", "2,5"), ("9.81", "9,81")],
    'text is written in quotation marks: "cart"': [('"cart"', "cart")],
    'text is written in quotation marks: "bob"': [('"bob"', "bob"), ('"bob"', 'bob"')],
    "this quotation mark is not closed": [('"cart"', '"cart'), ('"bob"', '"bob')],
    "“ is a curly quotation mark": [('"cart"', "“cart”"), ('"bob"', "“bob”")],
    "‘ is a curly quotation mark": [('"cart"', "‘cart’")],
    "− is not plain text": [("mass = 3.0", "damping = −0.0\nmass = 3.0")],
    "a special space": [("gravity = 9", "gravity\xa0= 9")],
    "a table in braces { … } is written on one line": [("1.0, l", "1.0,\n          l"), ("{ k", "{ # one\n  k")],
    "a table in braces ends without a comma": [("2.5 }", "2.5, }")],
    "a key has an equals sign, not a colon": [
        ("mass = 3", "mass: 3"),
        ("mass = 1", "mass: 1"),
        ("gravity =", '"gravity":'),
    ],
    "a key has one equals sign": [("gravity =", "gravity =="), ("gravity =", "gravity :=")],
    "truth values are true and false": [("[[pen", "start = True\n[[pen")],
    "TOML has no None": [("mass = 3.0", "mass = 3.0\nstart = None")],
    "a comment begins with #": [
        ("9.81", "9.81 // on earth"),
        ("gravity", "// earth\ngravity"),
        ("gravity", "-- e\ngravity"),
    ],
    "the brackets of a table come in pairs": [("[support]", "[support"), ("[[pendulum]]", "[[pendulum]")],
    "this [ is not closed": [("2.5 }]", "2.5 }\n\n[ground]")],
    "this { is not closed": [("2.5 }]", "2.5 ]")],
    "this bracket closes nothing": [("2.5 }]", "2.5 }]]")],
    "a comma is missing before this": [("1.0, l", "1.0 l")],
    "an equals sign is missing": [("gravity =", "gravity"), ("mass = 3", "mass 3")],
    "gravity stands twice in this table, first in line 1": [("9.81", "9.81\ngravity = 1.62")],
    "mass stands twice in this table": [("1.0, l", "1.0, mass = 1.0, l")],
    "each of several tables has two brackets: [[support]]": [("[[pen", CARTS)],
    "each of several tables has two brackets: [[pendulum]]": [("[[pendulum]]", "[pendulum]\ncount = 1\n[[pendulum]]")],
    "a number has a digit before its point": [("3.0", ".5")],
    "a number has a digit after its point": [("3.0", "3.")],
    "a number begins with no zero": [("3.0", "03")],
    "a value is a number, not a formula": [("3.0", "1/2")],
    "a number is written without its unit": [("3.0", "3.0 kg"), ("9.81", "9.81 m/s²"), ("3.0", "3.0kg # heavy")],
    "a line ends without a semicolon": [("9.81", "9.81;")],
    "a line ends without a comma": [("9.81", "9.81,")],
    "a value is missing here": [("9.81", ""), ("9.81", " # earth")],
    "a backslash is written between single": [("gravity", 'title = "C:\\data"\ngravity')],
    "a list is written in square brackets": [("count", "x"), ("[[pen", "position = (1.0, 2.0)\n[[pen")][1:],
    "each key has a line of its own": [("9.81", '9.81 title = "x"')],
}
CASES = [(words, GOOD.replace(old, new, 1)) for words, changes in MISTAKES.items() for old, new in changes]


def lines_of(document: str) -> list[str]:
    with pytest.raises(tomllib.TOMLDecodeError) as caught:
        tomllib.loads(document)
    return mistakes_in(document, caught.value)


@pytest.mark.parametrize(("words", "document"), CASES)
def test_a_usual_mistake_is_guessed(words: str, document: str) -> None:
    first, source, caret, *meant = lines_of(document)
    assert words in first
    number = int(first.removeprefix("line ").partition(":")[0])
    line = document.split("\n")[number - 1]
    assert source == f"    {line}".replace("\xa0", "\xa0")
    place = len(caret) - 5
    assert caret == f"{' ' * (4 + place)}^"
    assert 0 <= place <= len(line)
    assert len(meant) <= 1
    if meant:
        fixed = document.split("\n")
        fixed[number - 1] = meant[0].removeprefix("    perhaps: ")
        assert fixed[number - 1] != line


def test_the_caret_stands_below_the_place() -> None:
    assert lines_of("a = 1\n\tlength = 1,5 # m") == [
        "line 2: a number has a decimal point, not a comma",
        "    \\tlength = 1,5 # m",
        "                ^",
        "    perhaps: length = 1.5 # m",
    ]


def test_all_mistakes_are_told_at_once(tmp_path: Path) -> None:
    document = GOOD.replace("9.81", "9,81").replace('"cart"', "cart").replace("1.0, l", "1.0,\n l")
    document = document.replace("3.0", "yes")
    path = tmp_path / "mine.toml"
    path.write_text(document, "utf-8")
    with pytest.raises(SceneError) as caught:
        load(path)
    lines = str(caught.value).split("\n")
    assert all(line.startswith(f"{path}: ") for line in lines)
    heads = [line.removeprefix(f"{path}: ") for line in lines if ": line " in line]
    assert [head.partition(":")[0] for head in heads] == ["line 1", "line 4", "line 5", "line 8"]


def test_what_nobody_guesses_is_shown_at_its_place() -> None:
    assert lines_of("x = @") == ["line 1: broken TOML: invalid value", "    x = @", "        ^"]
    long = lines_of("x = [" + "1, " * 200 + "@]")
    assert all(len(line) <= 110 for line in long)
    assert long[1][len(long[2]) - 1] == "@"
    huge = lines_of("a = 1,5 #" + " " * GUESSED_LETTERS_MAX)
    assert huge[0] == "line 1: broken TOML: expected newline or end of document after a statement"


def test_no_letter_that_is_lost_or_added_breaks_the_messages() -> None:
    """Letters of shipped scenes lost, doubled or changed at random: an answer in lines, or a document that reads."""
    chance = random.Random(5)
    problems: list[str] = []
    for name in example_names()[::4]:
        text = example_text(name)
        for _ in range(12):
            at = chance.randrange(len(text))
            changed = text[:at] + chance.choice(["", text[at] * 2, ",", '"', "{", "]", "\n", "“", "="]) + text[at + 1 :]
            try:
                parse(changed.encode())
            except SceneError as error:
                problems += error.problems
    assert len(problems) > 30
    assert not [line for line in problems if "\n" in line]
