"""The command `play` and what it writes: size, refusals, and nothing of a scene that acts as markup or code."""

from __future__ import annotations

import re
from base64 import b64decode, b64encode
from hashlib import sha256
from html import unescape
from html.parser import HTMLParser
from pathlib import Path
from tomllib import loads

import numpy as np
import pytest

from modal.errors import SceneError
from modal.scene import Moved, RandomMotion, Scene, dump, example_names, load, refusals, scene_from
from multipendula.cli import main
from multipendula.page import LARGEST, MODULES, MOST_LINKS, page, recording_of, scene_data
from multipendula.page.document import HERE
from nonlinear import simulate


class Elements(HTMLParser):
    """The tags of a document, and the text of those elements that hold some."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.texts: dict[str, str] = {}
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_data(self, data: str) -> None:
        tag, attrs = self.tags[-1] if self.tags else ("", {})
        name = attrs.get("id") or attrs.get("type") or tag
        self.texts[name] = self.texts.get(name, "") + data


def test_a_page_is_one_small_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = tmp_path / "page.html"
    assert main(["play", "paper-cart-3", "-o", str(target)]) == 0
    assert "page.html: " in capsys.readouterr().out
    assert target.stat().st_size < LARGEST
    text = target.read_text(encoding="utf-8")
    assert not re.search(r"https?:|@import|url\(|\bfetch\(|XMLHttpRequest|WebSocket|importScripts", text)
    outside = {"src", "href", "srcset", "data", "action"}
    asked = [(tag, attrs) for tag, attrs in Elements(text).tags if outside & attrs.keys()]
    assert [tag for tag, _ in asked] == ["link"]  # the favicon, which is in the page
    assert str(asked[0][1]["href"]).startswith("data:image/svg+xml,")


def test_the_longest_run_still_fits(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run, target = tmp_path / "run.npz", tmp_path / "run.html"
    assert main(["simulate", "paper-cart-3", "--duration", "20", "--samples", "20001", "-o", str(run)]) == 0
    assert main(["play", str(run), "-o", str(target)]) == 0
    assert "of 20001 samples" in capsys.readouterr().err
    assert target.stat().st_size < LARGEST


def test_a_recording_holds_the_samples() -> None:
    run = simulate(load("paper-cart-2"), 3.0, output=31)
    recording = recording_of(run)
    n = run.system.n_links
    assert (recording["samples"], recording["of"], recording["width"]) == (31, 31, 2 * n + 3)
    rows = np.frombuffer(b64decode(recording["rows"]), dtype="<f4").reshape(31, -1)
    assert rows[:, 1 : n + 1] == pytest.approx(run.motion.links, rel=1e-6)
    assert rows[:, n + 2 : 2 * n + 2] == pytest.approx(run.motion.link_rates, rel=1e-6, abs=1e-6)
    assert np.frombuffer(b64decode(recording["times"]), dtype="<f4") == pytest.approx(run.times, rel=1e-6)
    assert recording["drift"] == run.energy_drift()


HOSTILE = "</script><script>alert(1)</script><!--<img src=x onerror=alert(2)>&amp;\"'{{script}}"


def test_a_title_is_text_and_nothing_else() -> None:
    scene = load("chain-1").replace(title=HOSTILE)
    usual, hostile = (Elements(page(scene_data(shown))) for shown in (load("chain-1"), scene))
    assert [tag for tag, _ in hostile.tags] == [tag for tag, _ in usual.tags]
    assert hostile.texts["title"].count(HOSTILE) == 2
    assert loads(f"x = {hostile.texts['data'].partition('title')[2].partition(': ')[2].split(', ')[0]}")["x"] == HOSTILE


def test_the_policy_admits_this_script_and_no_other() -> None:
    text = page(scene_data(load("chain-1")))
    policy = unescape(next(str(attrs["content"]) for _, attrs in Elements(text).tags if "http-equiv" in attrs))
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    for kind, element in (
        ("script", re.search(r'<script type="module">(.*)</script>', text, flags=re.S)),
        ("style", re.search(r"<style>(.*)</style>", text, flags=re.S)),
    ):
        assert element
        assert f"{kind}-src 'sha256-{b64encode(sha256(element[1].encode()).digest()).decode()}'" in policy


WRITTEN = {"drawing", "prescribed", "steps", "structure", "tableau", "whole"}
"""Modules of the page that are written from Python and have no file."""


def test_modules_stand_below_what_they_import() -> None:
    assert {path.stem for path in (HERE / "modules").glob("*.js")} | WRITTEN == set(MODULES)
    for place, name in enumerate(MODULES):
        if name in WRITTEN:
            continue
        text = (HERE / "modules" / f"{name}.js").read_text(encoding="utf-8")
        assert set(re.findall(r'from "\./(\w+)\.js"', text)) <= set(MODULES[:place]), name
        assert text.startswith("//"), name
        assert text.count("\n") <= 400, name


ODD = {
    "space": (load("chain-spatial"), "space = "),
    "links": (load("rope"), "1000 links in all"),
    "hoist": (load("hoisting-crane"), r"pendulum\[0\].links\[0\].hoist: the live page"),
    "random": (
        load("chain-2").replace(
            support=Moved(motion=RandomMotion(psd=(1.0, 1.0), frequency_hz=(1, 60), seed=1, duration=99.0))
        ),
        'support.motion.kind = "random": the live page cannot show more than 2000 samples or sines of it',
    ),
    "ratio": (load("chain-2").replace(damping_ratio=0.1), r"damping_ratio = 0\.1: .*dampers"),
    "massless": (
        load("paper-cart-2").replace(support=load("paper-cart-2").support.replace(mass=0.0)),
        "cannot show a cart",
    ),
}


@pytest.mark.parametrize("name", ODD)
def test_what_a_page_does_not_treat_is_named(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene, words = ODD[name]
    with pytest.raises(SceneError, match=words):
        scene_data(scene)
    dump(scene, tmp_path / "odd.toml")
    assert main(["play", str(tmp_path / "odd.toml"), "-o", str(tmp_path / "a.html")]) == 2
    assert "live page" in capsys.readouterr().err
    assert not (tmp_path / "a.html").exists()


@pytest.mark.parametrize(
    "words", [("chain-1", "-o", "a.png"), ("nosuch", "-o", "a.html"), ("chain-1", "-o", "no/a.html")]
)
def test_a_wrong_call_is_refused(
    words: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["play", *words]) == 2
    assert "Traceback" not in capsys.readouterr().err


@pytest.mark.parametrize("name", [name for name in example_names() if load(name).n_links <= MOST_LINKS])
def test_what_a_page_is_given_is_the_whole_scene(name: str) -> None:
    scene = load(name)
    if refusals(scene, "the live page"):
        return
    back: Scene = scene_from(scene_data(scene))
    assert [link for pendulum in back.pendulum for link in pendulum.links] == [
        link.replace(count=1) for pendulum in scene.pendulum for link in pendulum.links for _ in range(link.count)
    ]
    assert (back.gravity, back.support, back.title) == (scene.gravity, scene.support, scene.title)
