"""What the manual claims next to its blocks, which `test_documents.py` executes."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from modal import SceneError, natural_modes
from modal.scene import parse

FORMAT = (Path(__file__).parents[2] / "docs" / "reference" / "scene.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    fenced = re.findall(r"^```(\w*)\n(.*?)^```$", FORMAT, flags=re.DOTALL | re.MULTILINE)
    return [text for name, text in fenced if name == language]


def test_the_scene_format_is_the_real_one() -> None:
    text = blocks("toml")[0]
    scene = parse(text.encode())
    assert scene.n_links == 2 * 23 + 1
    assert natural_modes(scene).omega[0] == 0.0


def test_the_message_it_quotes_is_the_real_one() -> None:
    links = 'links = [{ kind = "bob", mass = %s, length = 1.0 }]'
    text = "gravity = 1.0\n" + "".join("[[pendulum]]\n" + links % m + "\n" for m in ("1.0", "1.0", "-1.0"))
    with pytest.raises(SceneError) as caught:
        parse(text.encode())
    assert caught.value.problems[0] in FORMAT


def test_every_column_is_explained() -> None:
    from modal.modes.tables import COLUMNS

    manual = (Path(__file__).parents[2] / "docs" / "reference" / "columns.md").read_text(encoding="utf-8")
    explained = re.findall(r"\*\*(.*?)\*\*", manual)
    words = ", ".join(explained)
    for column in COLUMNS:
        assert (column.heading.split(" (")[0] in words) if column.cell else f"`{column.key}`" in manual, column.key
