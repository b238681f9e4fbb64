"""Words that a scene does not know: what to write instead."""

from __future__ import annotations

import pytest

from modal import Bob, Pendulum, SceneError
from modal.scene.files import parse
from modal.scene.wording import number_in, suggestion

GOOD = """gravity = 9.81

[support]
kind = "cart"
mass = 3.0

[[pendulum]]
links = [{ kind = "bob", mass = 1.0, length = 2.5 }]
"""
CHANGES = [
    ('[support]\nkind = "cart"', "[cart]", 'cart: is not a table of a scene: write [support] with kind = "cart"'),
    ('[support]\nkind = "cart"', "[trolley]", 'trolley: is not a table of a scene: write [support] with kind = "cart"'),
    (
        "[[pendulum]]",
        "[[bob]]",
        'bob: is not a table of a scene: write links = [{ kind = "bob", … }] in a [[pendulum]]',
    ),
    ("gravity", "[scene]\ngravity", "scene: is not a table: the keys of a scene belong at the top of the file"),
    ("links", 'equilibrium = "up"\nlinks', 'pendulum[0].equilibrium = "up": must be a list: write ["up"]'),
    ("links", 'equilibrium = "upright"\nlinks', 'pendulum[0].equilibrium = "upright": must be a list: write ["up"]'),
    ("links", 'equilibrium = ["upright"]\nlinks', "(did you mean up?)"),
    ("links", "start = { angles_deg = 10.0 }\nlinks", "angles_deg = 10.0: must be a list: write [10.0]"),
    ("links", "start = { angles = [10.0] }\nlinks", "angles: is not a known key (did you mean angles_deg?)"),
    ("links", "start = [10.0]\nlinks", "start: must be a table: write start = { angles_deg = [10.0] }"),
    ("links", "count = 3.0\nlinks", "count = 3.0: must be a whole number: write 3"),
    ("gravity", "g", "g: is not a known key (did you mean gravity?)"),
    ('"cart"', '"trolley"', "(did you mean cart?)"),
    ('"bob"', '"Rod"', "(did you mean rod?)"),
    ('"bob"', '"point"', "(did you mean bob?)"),
    ('kind = "cart"', 'type = "cart"', ": write kind in place of type"),
    ("2.5", '"2,5 m"', 'length = "2,5 m": must be a number: write 2.5 without quotation marks'),
    ("2.5", "2.5, drive = 'vanderpol'", 'must be a table: write drive = { kind = "van-der-pol", … } in a link'),
    ('[support]\nkind = "cart"\nmass = 3.0', 'support = "cart"', 'must be a table: write [support] with kind = "cart"'),
]


@pytest.mark.parametrize(("old", "new", "words"), CHANGES)
def test_what_to_write_instead_is_said(old: str, new: str, words: str) -> None:
    with pytest.raises(SceneError) as caught:
        parse(GOOD.replace(old, new, 1).encode())
    assert any(words in line for line in caught.value.problems), caught.value.problems


def test_parts_made_in_python_say_the_same() -> None:
    with pytest.raises(SceneError, match=r'equilibrium = "up": must be a list: write \["up"\]'):
        Pendulum(links=[Bob(mass=1.0, length=1.0)], equilibrium="up")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("text", "number"),
    [("1.5", "1.5"), ("-3", "-3"), ("−1,5 kg", "-1.5"), ("1e3", "1e3"), ("one", ""), ("1.2.3", ""), ("", "")],
)
def test_a_number_in_a_text_is_found(text: str, number: str) -> None:
    assert number_in(text) == number


def test_a_word_that_is_known_or_like_none_gets_no_suggestion() -> None:
    assert suggestion("zzz", ["bob", "rod"]) == ""
    assert suggestion("lenght", ["length"]) == " (did you mean length?)"
