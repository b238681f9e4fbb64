"""Files of other kinds than were asked for: what they are, and what to give instead; text as Windows writes it."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest

from modal import SceneError, dumps, load
from modal.identification import read_modes
from modal.scene.contents import as_text, decode_text, first_line, recognize, text_of
from modal.scene.records import read_record
from nonlinear import load as load_run
from nonlinear import save, simulate
from nonlinear.identification import read_recording

SCENE = load("chain-2")
TOML = dumps(SCENE.replace(title="Zwei Stäbe, ω"))
RECORD = "time_s,acceleration_m_per_s2\n" + "".join(f"{k / 10},{k % 3}\n" for k in range(8))


def zipped(*names: str) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name in names:
            archive.writestr(zipfile.ZipInfo(name), b"x")  # without the time of day: workers must collect the same
    return stream.getvalue()


def npz(**arrays: float) -> bytes:
    stream = io.BytesIO()
    np.savez(stream, **{name: np.array(value) for name, value in arrays.items()})
    return stream.getvalue()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("files")
    run = simulate(SCENE, 0.5, output=6)
    save(run, place / "run.npz")
    save(run, place / "run.csv")
    (place / "mine.toml").write_text(TOML, "utf-8")
    return place


KINDS = {
    b"\x89PNG\r\n\x1a\n": ("picture", "a PNG picture"),
    b'<?xml version="1.0"?>\n<!DOCTYPE svg>\n<svg>': ("picture", "an SVG picture"),
    b"<!DOCTYPE html><title>x</title>": ("page", "a web page"),
    b'{"gravity": 9.81}': ("json", "JSON"),
    b'[\n {"a": 1}]': ("json", "JSON"),
    b"\0\0\0\x18ftypmp42": ("picture", "a film"),
    b"# a comment\ntime_s,theta_1_1_rad\n0.0,1.0\n": ("table", "a CSV table"),
    b"# gravity\n\n[[pendulum]]\nlinks = []": ("scene", "a scene"),
    "# ω\r\ngravity = 9.81\r\n".encode("utf-16"): ("scene", "a scene"),
    npz(A=1.0, B=1.0, C=1.0, D=1.0): ("model", "a model"),
    npz(M=1.0): ("arrays", "an archive of arrays (NPZ)"),
    zipped("[Content_Types].xml", "xl/workbook.xml"): ("excel", "an Excel workbook"),
    zipped("a.txt"): ("zip", "a ZIP archive"),
    b"PK\x03\x04 and no more": ("damaged", "a damaged archive"),
}


@pytest.mark.parametrize("content", KINDS, ids=lambda content: repr(content[:12]))
def test_kinds_are_recognized(content: bytes) -> None:
    kind = recognize(content)
    assert kind is not None
    assert (kind.kind, kind.words) == KINDS[content]


@pytest.mark.parametrize("content", [b"", b"hello", b"a = 1\n", b"\xff\xfe\x00", b"x" * 50_000, b"\n" * 50_000])
def test_what_may_be_anything_is_none(content: bytes) -> None:
    assert recognize(content) is None


@pytest.mark.parametrize("name", ["run.npz", "run.csv"])
def test_a_run_in_place_of_a_scene(name: str, folder: Path) -> None:
    with pytest.raises(SceneError, match=rf"{name}: is a run, not a scene: plot and animate take it"):
        load(folder / name)


def test_a_file_of_another_kind_in_place_of_numbers(folder: Path) -> None:
    for read in (lambda path: read_recording(SCENE, [path]), read_record, lambda path: read_modes(SCENE, path)):
        with pytest.raises(SceneError, match=r"run\.npz: is a run, not a CSV table: save the run under a name"):
            read(folder / "run.npz")
        with pytest.raises(SceneError, match=r"mine\.toml: is a scene, not a CSV table: the scene comes first"):
            read(folder / "mine.toml")
    assert read_recording(SCENE, [folder / "run.csv"]).segments[0].values.shape == (6, 2)


def test_a_file_of_another_kind_in_place_of_a_run(folder: Path) -> None:
    (folder / "model.npz").write_bytes(npz(A=1.0, B=1.0, C=1.0, D=1.0))
    with pytest.raises(SceneError, match="is a model, not a trajectory saved by multipendula"):
        load_run(folder / "model.npz")
    (folder / "cut.npz").write_bytes((folder / "run.npz").read_bytes()[:-70])
    with pytest.raises(SceneError, match="is incomplete, or is not a trajectory"):
        load_run(folder / "cut.npz")


@pytest.mark.parametrize("encoding", ["utf-16", "utf-8-sig", "utf-8", "utf-32"])
def test_text_as_windows_writes_it_is_read(encoding: str, tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_bytes(TOML.replace("\n", "\r\n").encode(encoding))
    assert load(path) == load_of(TOML, tmp_path)
    record = tmp_path / "quake.csv"
    record.write_bytes(RECORD.replace("\n", "\r\n").encode(encoding))
    assert read_record(record)["time_s"][:2] == (0.0, 0.1)
    assert first_line(record) == "time_s,acceleration_m_per_s2"
    assert text_of(record) == RECORD.replace("\n", "\r\n")
    assert as_text(b"\xfe\xff\0a") == "a"


def load_of(text: str, folder: Path) -> object:
    (folder / "plain.toml").write_text(text, "utf-8")
    return load(folder / "plain.toml")


def test_bytes_that_are_no_text_are_told() -> None:
    with pytest.raises(SceneError, match=r"^byte 11 is not UTF-8 text: save the file as UTF-8$"):
        decode_text("# Pendel: für mich".encode("latin-1"), "scene")
    with pytest.raises(SceneError, match=r"^is not a CSV text file: byte 2 is not UTF-8$"):
        decode_text(b"a,\xe9\n1,2\n", "table")
    with pytest.raises(SceneError, match=r"^is a PNG picture, not a text file$"):
        decode_text(b"\x89PNG")
