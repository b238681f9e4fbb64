"""What the README says, done."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from modal import SceneError, natural_modes
from modal.files import parse
from multipendula.cli import main

README = (Path(__file__).parent.parent / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    fenced = re.findall(r"^```(\w*)\n(.*?)^```$", README, flags=re.DOTALL | re.MULTILINE)
    return [text for name, text in fenced if name == language]


def commands() -> list[str]:
    lines = "\n".join(blocks("sh")).splitlines()
    return [line.partition("#")[0].strip() for line in lines if line.startswith("multipendula ")]


def test_the_tour_runs(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert len(commands()) >= 7
    for command in commands():
        words, _, target = command.partition(" > ")
        assert main(shlex.split(words)[1:]) == 0, command
        printed = capsys.readouterr().out
        if target:
            Path(target).write_text(printed, encoding="utf-8")


def test_the_scene_format_is_the_real_one() -> None:
    (text,) = blocks("toml")
    scene = parse(text.encode())
    assert scene.n_links == 2 * 23 + 1
    assert natural_modes(scene).omega[0] == 0.0


def test_the_python_lines_run(capsys: pytest.CaptureFixture[str]) -> None:
    (code,) = blocks("python")
    exec(code, {})
    assert "cart still, 4-fold: antiphase" in capsys.readouterr().out


def test_the_shown_table_is_what_the_command_prints(capsys: pytest.CaptureFixture[str]) -> None:
    main(["table", "paper-cart-2"])
    assert blocks("")[0] == capsys.readouterr().out


def test_the_message_it_quotes_is_the_real_one() -> None:
    links = 'links = [{ kind = "bob", mass = %s, length = 1.0 }]'
    text = "gravity = 1.0\n" + "".join("[[pendulum]]\n" + links % m + "\n" for m in ("1.0", "1.0", "-1.0"))
    with pytest.raises(SceneError) as caught:
        parse(text.encode())
    assert caught.value.problems[0] in README


def test_every_column_is_explained() -> None:
    from modal.tables import COLUMNS

    manual = (Path(__file__).parent.parent / "docs" / "reference" / "columns.md").read_text(encoding="utf-8")
    explained = re.findall(r"\*\*(.*?)\*\*", manual)
    words = ", ".join(explained)
    for column in COLUMNS:
        assert (column.heading.split(" (")[0] in words) if column.shown else f"`{column.key}`" in manual, column.key


def test_the_python_lines_of_the_manual_run(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    page = (Path(__file__).parent.parent / "docs" / "howto" / "python.md").read_text(encoding="utf-8")
    codes = re.findall(r"^```python\n(.*?)^```$", page, flags=re.DOTALL | re.MULTILINE)
    assert len(codes) >= 4
    for code in codes:
        exec(code, {})
    assert "period at 179 deg: " in capsys.readouterr().out
