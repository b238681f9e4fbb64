"""Files of a command: all or none, errors that name their own, and no forgotten ones."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest

from modal.scene import Bob, Cart, Pendulum, Scene, files, whole_file
from multipendula.commands import shared
from multipendula.commands.shared import write_together


def test_of_files_that_belong_together_all_or_none_are_written(tmp_path: Path) -> None:
    first, second = tmp_path / "x.toml", tmp_path / "none" / "y.json"
    first.write_text("before", encoding="utf-8")
    with pytest.raises(OSError, match=r"none/y\.json"):
        write_together({str(first): b"after", str(second): b"{}"})
    assert first.read_text(encoding="utf-8") == "before"
    second.parent.mkdir()
    write_together({str(first): b"after", str(second): b"{}", None: b"nowhere"})
    assert (first.read_bytes(), second.read_bytes()) == (b"after", b"{}")
    assert len([*tmp_path.iterdir()]) == 2


def test_an_error_names_the_file_that_it_is_of(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="inner") as caught, whole_file(tmp_path / "outer"):
        raise OSError(28, "No space left on device", "inner")
    assert caught.value.filename == "inner"
    with pytest.raises(OSError, match="outer"), whole_file(tmp_path / "outer"):
        raise OSError(28, "No space left on device")


def test_what_a_killed_process_left_is_removed_by_a_later_one(tmp_path: Path) -> None:
    old, young = (tmp_path / f"{files.TEMPORARY}{name}" for name in ("old", "young"))
    for path in (old, young):
        path.write_bytes(b"part")
    os.utime(old, (time.time() - files.FORGOTTEN_SECONDS - 60,) * 2)
    with whole_file(tmp_path / "x") as stream:
        stream.write(b"x")
    assert {path.name for path in tmp_path.iterdir()} == {"x", young.name}


def test_modes_of_many_supports_say_first_how_long_they_take(capsys: pytest.CaptureFixture[str]) -> None:
    supports = [Cart(name=f"c{k}", mass=1.0, stiffness=1.0) for k in range(300)]
    pendulum = Pendulum(on="c0", links=(Bob(mass=1.0, length=1.0),))
    shared.large(Scene(gravity=9.81, support=supports[:9], pendulum=(pendulum,)))
    assert not capsys.readouterr().err
    shared.large(Scene(gravity=9.81, support=supports, pendulum=(pendulum,)))
    assert "the modes of 300 coordinates of supports take some 8 s" in capsys.readouterr().err
