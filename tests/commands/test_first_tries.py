"""The first try works, and a guess is answered with what there is."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest
from documents import ROOT, Page
from scipy.io import loadmat

from multipendula.cli import main


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def told(capsys: pytest.CaptureFixture[str], words: str, code: int = 0) -> str:
    """What a command says, on standard output where it succeeds, else on standard error."""
    try:
        ended = main(words.split())
    except SystemExit as left:
        ended = left.code  # type: ignore[assignment]
    streams = capsys.readouterr()
    assert ended == code, streams.err
    assert "Traceback" not in streams.err
    return streams.err if code else streams.out


@pytest.mark.parametrize(
    ("words", "name", "line"),
    [
        ("shapes chain-2", "chain-2-shapes.png", "modes 1 to 2"),
        ("plot chain-2 --duration 1", "chain-2-plot.png", "1 s of motion of 2 links"),
        ("animate chain-1 --duration 0.2", "chain-1-film.gif", "5 frames, 0.2 s of film for 0.2 s of motion"),
        ("play chain-2", "chain-2.html", "kB, open it in any browser"),
        ("export chain-1 --to json", "chain-1.json", "2 states; input torque_1_1 (N m); output theta_1_1 (rad)"),
    ],
)
def test_a_file_without_a_name_is_called_as_the_scene(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, words: str, name: str, line: str
) -> None:
    text = told(capsys, words)
    assert text.startswith(f"{name}: ")
    assert text.endswith(f"{line}\n")
    assert [path.name for path in tmp_path.iterdir()] == [name]
    assert (tmp_path / name).stat().st_size > 300


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ("orbits chain-2 --largest-angle 5", "branch 1, from mode 1"),
        ("response crane-hook", "peaks of the response to cart acceleration (m/s²)"),
        ("spread chain-2 --members 50", "50 members with gravity = 9.81 ± 0.0981 m/s²"),
        ("vibration tower --psd 1e-3", "RMS from 0.115437 to 2.8089 Hz"),
        ("table chain-2 --places", "pendulum[0].links[0].length"),
    ],
)
def test_a_command_does_the_obvious(capsys: pytest.CaptureFixture[str], words: str, line: str) -> None:
    assert line in told(capsys, words)


def test_columns_are_written_for_matlab(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    told(capsys, "simulate paper-cart-1 --duration 0.1 -o run.mat")
    told(capsys, "simulate paper-cart-1 --duration 0.1 -o run.csv")
    told(capsys, "table paper-cart-1 -o modes.mat")
    told(capsys, "table paper-cart-1 -o modes.csv")
    for name in ("run", "modes"):
        columns = loadmat(tmp_path / f"{name}.mat")
        lines = (tmp_path / f"{name}.csv").read_text(encoding="utf-8").splitlines()
        names, *rows = csv.reader(line for line in lines if not line.startswith("#"))
        assert set(names) == {key for key in columns if not key.startswith("__")}
        for heading, *words in zip(names, *rows, strict=True):
            column = columns[heading][:, 0]
            if column.dtype == object:
                assert [str(*cell) for cell in column] == words
            else:
                assert [f"{value}" for value in column] == [f"{float(word or 'nan')}" for word in words]


@pytest.mark.parametrize(
    "words", ["table chain-1 --format json -o a.mat", "matrices chain-1 -o a.mat", "explain paper-cart-1 -o a.mat"]
)
def test_no_file_is_of_another_kind_than_its_name_says(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, words: str
) -> None:
    assert "-o a.mat" in told(capsys, words, 2)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("words", "example"),
    [
        ("sweep chain-2", "--vary 'pendulum[0].links[0].length=0.5:2:9'"),
        ("tune chain-2", "--free 'pendulum[0].links[0].length=0.5:2' --minimize settling"),
    ],
)
def test_numbers_are_listed_where_one_has_to_be_chosen(
    capsys: pytest.CaptureFixture[str], words: str, example: str
) -> None:
    text = told(capsys, words, 2)
    assert example in text
    assert "  pendulum[0].links[0].mass = 1 kg\n" in text
    assert "table SCENE --places lists all" in text


def test_guesses_are_answered_as_the_manual_says() -> None:
    page = (ROOT / "docs" / "howto" / "troubleshooting.md").read_text(encoding="utf-8")
    Page("guesses").done(page.partition("## Guesses\n")[2].partition("\n## ")[0])


def test_a_robot_description_becomes_a_scene_as_the_manual_says() -> None:
    page = (ROOT / "docs" / "howto" / "scene.md").read_text(encoding="utf-8")
    Page("a robot description").done(page.partition("## A robot description\n")[2].partition("\n## ")[0])
