"""The pictures of the docs: a table, the files it makes, and the pages that show them."""

from __future__ import annotations

import re
import shlex
import sys
import tomllib
from pathlib import Path

import pytest
from PIL import Image

from multipendula.cli import _parser

ROOT = Path(__file__).parents[2]
PICTURES = ROOT / "docs" / "pictures"
TABLE = tomllib.loads((ROOT / "docs" / "pictures.toml").read_text(encoding="utf-8"))
SECTIONS = {"modes", "coupling", "motion", "accuracy", "synchronization", "control", "chaos", "ensembles", "papers"}
MEASURED = {"benchmark", "simulation-benchmark", "extremes-modes", "extremes-simulation"}
"""Made by the benchmarks, in the light theme only."""
SEEN = {"play", "play-phone"}
"""Screenshots (`docs/screenshots.py`), in both themes."""

pytestmark = pytest.mark.skipif(not PICTURES.is_dir(), reason="a source distribution is without them")


def files(name: str) -> list[Path]:
    form = TABLE[name].get("form", "png")
    return [PICTURES / f"{name}{end}.{form}" for end in ("", "-dark")]


@pytest.mark.parametrize("name", TABLE)
def test_every_picture_is_told_and_made_in_both_themes(name: str) -> None:
    picture = TABLE[name]
    assert picture.keys() - {"form", "before"} == {"section", "title", "command", "caption", "alt"}
    assert picture["section"] in SECTIONS
    assert all(picture[key].endswith(".") for key in ("caption", "alt"))
    command = _parser().parse_args([*shlex.split(picture["command"]), "--theme", "dark"])
    assert command.theme == "dark"
    assert "{out}" in picture["command"]
    assert ("before" in picture) == ("{run}" in picture["command"])
    corners = []
    for path in files(name):
        with Image.open(path) as image:
            corners.append(sum(image.convert("RGB").getpixel((1, 1))))  # type: ignore[arg-type]
        assert path.stat().st_size < (1_500_000 if path.suffix == ".gif" else 165_000)
    assert corners[0] > 700 > 150 > corners[1]


def test_every_file_is_one_of_the_table() -> None:
    known = {path.name for name in TABLE for path in files(name)} | {
        f"{name}{end}.png" for name in MEASURED | SEEN for end in ("", "-dark")
    }
    assert {path.name for path in PICTURES.iterdir()} == known


@pytest.mark.parametrize("page", [ROOT / "README.md", *(ROOT / "docs").glob("*.md")], ids=lambda page: page.name)
def test_every_picture_that_a_page_shows_is_there(page: Path) -> None:
    shown = re.findall(r'!\[[^\]]*\]\(([^)]+)\)|(?:src|srcset)="([^"]+)"', page.read_text(encoding="utf-8"))
    for link in ("".join(pair) for pair in shown):
        assert (page.parent / link).is_file(), link


def test_a_name_that_is_no_picture_is_refused() -> None:
    import subprocess

    made = subprocess.run(
        [sys.executable, ROOT / "docs" / "pictures.py", "moon"], check=False, capture_output=True, text=True
    )
    assert made.returncode == 1
    assert "no picture is called moon: choose from shapes, " in made.stderr


def test_every_scene_of_the_gallery_is_drawn_within_its_frame() -> None:
    from xml.etree import ElementTree

    import playing

    for name, (scene, _) in playing.pages().items():
        drawn = ElementTree.fromstring(playing.sketch(scene))
        lines = [line.get("points", "").split() for line in drawn.iter("polyline")]
        count = sum(pendulum.count for pendulum in scene.pendulum)
        assert len(lines) == (count if scene.is_structured else min(playing.MOST, count)), name
        assert len(lines[0]) == 1 + sum(link.count for link in scene.pendulum[0].links)
        points = [tuple(map(float, point.split(","))) for line in lines for point in line]
        assert all(0 <= x <= playing.WIDTH and 0 <= y <= playing.HEIGHT for x, y in points), name
        assert max(abs(x - points[0][0]) for x, _ in points) > 10 or scene.n_links > playing.MOST_LINKS, name
