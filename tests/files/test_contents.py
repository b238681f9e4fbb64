"""Files that are no files: devices without an end and pipes without a writer, for every reader of a file."""

import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from modal import load
from modal.errors import SceneError
from modal.exports.data import read_json, read_npz
from modal.identification.estimate import read_estimate
from modal.identification.measured import has_modes, read_modes
from modal.scene.contents import FILE_BYTES_MAX, PIECE_BYTES, content_of, first_line, read_within_limit, text_of
from modal.scene.records import read_lengths, read_record, read_spectrum
from nonlinear import load as load_run
from nonlinear.identification import read_recording
from nonlinear.sweeps import files as sweeps

SCENE = load("chain-2")
PATIENCE = 5  # s, where nothing takes a hundredth
NAMED = """gravity = 9.81
{}
[[pendulum]]
links = [{{ kind = "bob", mass = 1.0, length = 1.0{} }}]
"""
READERS: dict[str, Callable[[Path], Any]] = {
    "content": content_of,
    "modes": lambda path: read_modes(SCENE, path),
    "estimate": lambda path: read_estimate(SCENE, path),
    "recording": lambda path: read_recording(SCENE, [path]),
    "recording of any scene": lambda path: read_recording(None, [path]),
    "record": read_record,
    "lengths": read_lengths,
    "spectrum": read_spectrum,
    "model in JSON": read_json,
    "model in NPZ": read_npz,
    "hoist of a scene": lambda path: _scene(path, "", f', hoist = {{ file = "{path}" }}'),
    "motion of a scene": lambda path: _scene(
        path, f'[support]\nkind = "moved"\nmotion = {{ kind = "record", file = "{path}" }}', ""
    ),
    "force of a scene": lambda path: _scene(
        path, f'[[force]]\non = "pendulum[0]"\nkind = "record"\nfile = "{path}"', ""
    ),
}


def _scene(path: Path, head: str, link: str) -> None:
    scene = Path(os.environ["PLACE"]) / "scene.toml"
    scene.write_text(NAMED.format(head, link), encoding="utf-8")
    load(scene)


@contextmanager
def patience() -> Iterator[None]:
    """A block that fails where it waits for ever."""

    def ring(*_: object) -> None:
        raise TimeoutError

    before = signal.signal(signal.SIGALRM, ring)
    signal.alarm(PATIENCE)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with names here")
@pytest.mark.parametrize("reader", READERS)
def test_what_is_no_file_is_refused_at_once(reader: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PLACE", str(tmp_path))
    os.mkfifo(tmp_path / "pipe")
    for path in (Path("/dev/zero"), tmp_path / "pipe", tmp_path):
        with patience(), pytest.raises(SceneError, match="not a file"):
            READERS[reader](path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with names here")
def test_saved_runs_and_sweeps_that_are_pipes_are_refused(tmp_path: Path) -> None:
    for name, read in (("a.npz", load_run), ("a.csv", load_run), ("b.npz", sweeps.load), ("b.csv", sweeps.load)):
        os.mkfifo(tmp_path / name)
        with patience(), pytest.raises(SceneError, match=f"{name}: not a file"):
            read(tmp_path / name)


def test_the_first_line_is_looked_for_at_the_beginning_only(tmp_path: Path) -> None:
    path = tmp_path / "modes.csv"
    path.write_text("# of a rig\nmode,frequency_hz,std_hz\n", encoding="utf-8-sig")
    assert first_line(path) == "mode,frequency_hz,std_hz"
    assert has_modes(path)
    path.write_bytes(b"#" * (PIECE_BYTES + 1) + b"\nmode\n")
    assert not has_modes(path)
    os.mkfifo(tmp_path / "pipe")
    with patience():
        assert [has_modes(other) for other in (tmp_path / "pipe", "/dev/zero", tmp_path / "none")] == [False] * 3


def test_a_file_of_the_largest_size_is_read_and_a_larger_one_is_not(tmp_path: Path) -> None:
    path = tmp_path / "data"
    path.write_bytes(b"12345")
    assert content_of(path, 5) == b"12345"
    with pytest.raises(SceneError, match=r"^is larger than 4 bytes$"):
        content_of(path, 4)
    with path.open("rb") as stream, pytest.raises(SceneError, match=r"^is larger than 4 bytes$"):
        read_within_limit(stream, 4)
    with path.open("r+b") as stream:
        stream.truncate(FILE_BYTES_MAX + 1)
    with pytest.raises(SceneError, match=f"is larger than {FILE_BYTES_MAX} bytes"):
        text_of(path)


def test_text_that_is_none_and_names_that_are_none_have_their_sentence(tmp_path: Path) -> None:
    path = tmp_path / "data"
    path.write_bytes(b"ab\xff")
    for name, words in (
        (path, "is not a text file: byte 2 is not UTF-8"),
        ("a\0b", "cannot be read"),
        ("none", "No such file"),
    ):
        with pytest.raises(SceneError, match=words):
            text_of(name)
