"""Files that are read back: any damage is refused in one line, and nothing is unpacked that does not fit."""

from __future__ import annotations

import io
import json
import random
import re
import tracemalloc
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sweep_measures
from amounts import usually
from forged import forged, with_record

from modal import SceneError, load
from modal.exports.data import read_json, read_npz, write_json, write_npz
from modal.scene import sealed
from modal.scene.parameters import parse_variations
from modal.statespace import state_space
from multipendula.cli import main
from nonlinear import files as recordings
from nonlinear.simulation import simulate
from nonlinear.sweeps import Study, open_checkpoint, parse_measures, sweep
from nonlinear.sweeps import files as sweep_files

Reader = Callable[[Path], object]
Files = dict[str, tuple[Path, Reader]]
STUDY = Study(
    load("paper-cart-2"),
    parse_variations(["support.mass=1:10:3log", "gravity=1,2"]),
    parse_measures(["frequencies:2", "beat"]),
)


def _journalled(path: Path) -> object:
    with open_checkpoint(path, STUDY) as kept:
        return kept.rows


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[Path, Reader]]:
    """One of every kind, and what reads it."""
    folder = tmp_path_factory.mktemp("files")
    run, swept, model = (
        simulate(load("paper-cart-1"), 0.1, output=4),
        sweep(STUDY, workers=1),
        state_space(load("chain-1")),
    )
    made: dict[str, tuple[Path, Reader]] = {}
    for kind in ("npz", "csv"):
        recordings.save(run, folder / f"run.{kind}")
        sweep_files.save(swept, folder / f"sweep.{kind}")
        made[f"run.{kind}"] = folder / f"run.{kind}", recordings.load
        made[f"sweep.{kind}"] = folder / f"sweep.{kind}", sweep_files.load
    (folder / "model.npz").write_bytes(write_npz(model))
    (folder / "model.json").write_bytes(write_json(model))
    made["model.npz"] = folder / "model.npz", lambda path: read_npz(path.read_bytes())
    made["model.json"] = folder / "model.json", lambda path: read_json(path.read_bytes())
    with open_checkpoint(folder / "journal", STUDY) as kept:
        kept.add(swept.rows)
    made["journal"] = folder / "journal", _journalled
    return made


KINDS = ("run.npz", "run.csv", "sweep.npz", "sweep.csv", "model.npz", "model.json", "journal")


def changed(content: bytes) -> Iterator[bytes]:
    """Flipped bits, files cut short anywhere and at the end of a line, and longer ones."""
    rng = random.Random(16)
    for _ in range(60):
        at = rng.randrange(len(content))
        yield content[:at] + bytes([content[at] ^ 1 << rng.randrange(8)]) + content[at + 1 :]
    yield from (content[: rng.randrange(len(content))] for _ in range(10))
    yield content[: content[:-1].rfind(b"\n") + 1]
    yield content + b"\n"
    yield content + b"1,2,3\n"


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "journal"])
def test_a_changed_file_is_refused_in_one_line(kind: str, files: Files, tmp_path: Path) -> None:
    good, read = files[kind]
    read(good)
    path, beside = tmp_path / kind, good.with_name(f"{kind}.json")
    if beside.exists():
        (tmp_path / beside.name).write_bytes(beside.read_bytes())
    for content in changed(good.read_bytes()):
        path.write_bytes(content)
        with pytest.raises(SceneError) as caught:
            read(path)
        assert len(str(caught.value).splitlines()) == 1


def test_a_changed_journal_is_refused_or_only_shorter(files: Files, tmp_path: Path) -> None:
    good, read = files["journal"]
    rows, path = read(good), tmp_path / "journal"
    refused = shorter = 0
    for content in changed(good.read_bytes()):
        path.write_bytes(content)
        try:
            left = read(path)
        except SceneError as error:
            refused += bool(re.search("line [0-9]+ is damaged|another sweep|is not the journal", str(error)))
        else:
            assert left == rows[: len(left)]  # type: ignore[arg-type, index]
            shorter += 1
    assert refused + shorter == len(list(changed(good.read_bytes())))
    assert refused > 50


def test_a_line_of_another_journal_is_no_line_of_this_one(tmp_path: Path) -> None:
    other = Study(STUDY.scene, STUDY.variations, parse_measures(["frequencies:2"]))
    for name, study in (("a", STUDY), ("b", other)):
        with open_checkpoint(tmp_path / name, study) as kept:
            kept.add(sweep(study, workers=1).rows[:2])
    first, *_ = (tmp_path / "a").read_bytes().splitlines(keepends=True)
    (tmp_path / "a").write_bytes(first + (tmp_path / "b").read_bytes().splitlines(keepends=True)[1])
    with pytest.raises(SceneError, match="line 2 is damaged: remove it"):
        _journalled(tmp_path / "a")


def test_a_removed_line_is_measured_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SWEEP_LOG", str(tmp_path / "log"))
    study, path = (
        Study(STUDY.scene, parse_variations(["support.mass=1,2,3"]), (sweep_measures.PRODUCT,)),
        tmp_path / "j",
    )
    with open_checkpoint(path, study) as kept:
        whole = sweep(study, journal=kept, workers=1)
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join(lines[:2] + lines[3:]))
    with open_checkpoint(path, study) as kept:
        assert sweep(study, journal=kept, workers=1).rows == whole.rows
    assert sweep_measures.logged() == ["1", "2", "3", "2"]


# --------------------------------------------------------------------------------------------------------- forgery


def _bomb(stream: io.BytesIO, head: bytes, size: int) -> None:
    with (
        zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as zipped,
        zipped.open("links.npy", "w", force_zip64=True) as part,
    ):
        part.write(head)
        for _ in range(size >> 20):
            part.write(bytes(1 << 20))


def _head(shape: str) -> bytes:
    words = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}"
    words += " " * (117 - len(words)) + "\n"
    return b"\x93NUMPY\x01\x00" + len(words).to_bytes(2, "little") + words.encode()


ALL = usually(1 << 27, 1 << 31)


@pytest.mark.parametrize(
    ("head", "size"),
    [
        (_head(f"({ALL >> 3},)"), ALL),
        (_head(f"({10**30},)"), 1 << 20),
        (_head(f"({10**30}, 0)"), 0),
        (_head("((((1,),),),)"), 0),
        (_head("(-1,)"), 0),
        (b"\x93NUMPY\x03\x00" + bytes(4), 0),
        (b"", 0),
    ],
)
def test_a_bomb_is_not_unpacked(head: bytes, size: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With a checksum that holds: only the sizes can show it; a small bomb where less may be read."""
    monkeypatch.setattr(sealed, "SEALED_BYTES_MAX", sealed.SEALED_BYTES_MAX * ALL >> 31)
    stream = io.BytesIO()
    _bomb(stream, head, size)
    with zipfile.ZipFile(stream, "a") as zipped:
        zipped.comment = bytes(64)
    path = tmp_path / "run.npz"
    path.write_bytes(forged(stream.getvalue()))
    tracemalloc.start()
    try:
        with pytest.raises(SceneError, match=r"run\.npz: "):
            recordings.load(path)
        assert tracemalloc.get_traced_memory()[1] < 1 << 25
    finally:
        tracemalloc.stop()


def test_no_pickle_is_opened(tmp_path: Path) -> None:
    stream = io.BytesIO()
    np.savez(stream, header=np.array([{}], dtype=object))
    with zipfile.ZipFile(stream, "a") as zipped:
        zipped.comment = bytes(64)
    (tmp_path / "run.npz").write_bytes(forged(stream.getvalue()))
    with pytest.raises(SceneError, match="not a trajectory saved by"):
        recordings.load(tmp_path / "run.npz")


def _header(content: bytes, edit: Callable[[dict[str, Any]], object]) -> bytes:
    first, _, rest = content.partition(b"\n")
    header = json.loads(first[2:])
    edit(header)
    return forged(b"# " + json.dumps(header).encode() + b"\n" + rest)


@pytest.mark.parametrize(
    ("kind", "edit"),
    [
        ("run.csv", lambda header: header["events"].append({"name": "x"})),
        ("run.csv", lambda header: header.update(strange=1)),
        ("run.csv", lambda header: header.update(driven=0)),
        ("run.csv", lambda header: header["run"].update(error=float("nan"))),
        ("run.csv", lambda header: header["kicks"].update(time=[1.0], link=[True], impulse=[1.0], energy=[1.0])),
        ("run.csv", lambda header: header["kicks"].update(time=[float("nan")], link=[0], impulse=[1.0], energy=[1.0])),
        ("sweep.csv", lambda header: header.update(done=[True, *range(1, 6)])),
        ("sweep.csv", lambda header: header.update(done=[1, 0, 2, 3, 4, 5])),
        ("sweep.csv", lambda header: header["columns"].append("alien")),
        ("sweep.csv", lambda header: header["failed"].update({"2": "never"})),
    ],
)
def test_what_nobody_wrote_is_refused(
    kind: str, edit: Callable[[dict[str, Any]], object], files: Files, tmp_path: Path
) -> None:
    good, read = files[kind]
    path = tmp_path / kind
    path.write_bytes(_header(with_record(good), lambda header: None))
    read(path)
    path.write_bytes(_header(with_record(good), edit))
    with pytest.raises(SceneError, match="saved by this version of multipendula"):
        read(path)


def test_alien_arrays_and_other_axes_are_refused(files: Files, tmp_path: Path) -> None:
    for kind, name in (("sweep.npz", "gravity_m_per_s2"), ("run.npz", "links"), ("model.npz", "A")):
        good, read = files[kind]
        arrays = sealed.unpack(good.read_bytes())
        for other in (arrays | {"alien": np.zeros(3)}, arrays | {name: arrays[name] * np.nan}):
            (tmp_path / kind).write_bytes(sealed.archive(other))
            with pytest.raises(SceneError, match="this version"):
                read(tmp_path / kind)


def test_other_programs_read_them_still(files: Files) -> None:
    run = recordings.load(files["run.csv"][0])
    table = np.loadtxt(files["run.csv"][0], delimiter=",", skiprows=1)
    assert np.array_equal(table[:, 0], run.times)
    with np.load(files["run.npz"][0]) as data:
        assert np.array_equal(data["links"], run.motion.links)
    assert json.loads(files["model.json"][0].read_bytes())["dt"] == 0


def test_the_command_says_so_and_leaves_with_2(
    files: Files, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    content = with_record(files["run.csv"][0])
    for words, damaged in (
        ("is damaged", content[:-1]),
        ("has no record: run.csv.json must be next to it", content[40:]),
    ):
        (tmp_path / "run.csv").write_bytes(damaged)
        assert main(["simulate", str(tmp_path / "run.csv")]) == 2
        assert capsys.readouterr().err.startswith(f"multipendula: {tmp_path / 'run.csv'}: {words}")
