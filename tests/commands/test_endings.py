"""However it ends, by Ctrl-C, a request to end, a kill or a full disk: the right code and nothing left behind."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import sweep_measures
from amounts import usually
from test_sweeps import SCRIPT

from modal import SceneError, load
from modal.scene import whole_file
from modal.scene.parameters import parse_variations
from multipendula.cli import main
from nonlinear.dynamics import without_interrupts
from nonlinear.plotting import animate
from nonlinear.simulation import simulate
from nonlinear.sweeps import Study, open_checkpoint

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals and limits of POSIX")
COMMAND = [sys.executable, "-m", "multipendula"]


@pytest.fixture(autouse=True)
def _log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SWEEP_LOG", str(tmp_path / "log"))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(sys.path))


def eventually(holds: Callable[[], bool], seconds: float = 600.0) -> bool:
    deadline = time.monotonic() + seconds
    while not holds():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.05)
    return True


def children(parent: int) -> set[int]:
    """Of a process, by what the system says."""
    listed = subprocess.run(["ps", "-eo", "pid=,ppid="], capture_output=True, text=True, check=True).stdout
    return {int(child) for child, above in map(str.split, listed.splitlines()) if int(above) == parent}


def is_there(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    state = subprocess.run(
        ["ps", "-o", "stat=", "-p", str(process)], capture_output=True, text=True, check=False
    ).stdout
    return bool(state.strip()) and not state.startswith("Z")


def slow_study() -> Study:
    return Study(load("paper-cart-2"), parse_variations(["support.mass=1,2,3"]), (sweep_measures.PRODUCT,))


def test_a_journal_has_one_sweep_at_a_time(tmp_path: Path) -> None:
    study, path = slow_study(), tmp_path / "j"
    with open_checkpoint(path, study) as kept:
        with pytest.raises(SceneError, match="j: another process is writing it"), open_checkpoint(path, study):
            pass
        kept.finish()
    assert not path.exists()
    with open_checkpoint(path, study) as kept:
        assert kept.rows == ()
    assert path.exists()


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_a_sweep_that_is_ended_leaves_no_workers_and_no_lock(number: int, tmp_path: Path) -> None:
    (tmp_path / "script.py").write_text(SCRIPT)
    path = tmp_path / "j"
    command = [sys.executable, str(tmp_path / "script.py"), str(path)]
    study = Study(
        load("paper-cart-2"),
        parse_variations(["support.mass=1:400:400"]),
        (replace(sweep_measures.SLOW, number=0.05),),
    )
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as running:
        assert eventually(
            lambda: path.exists() and path.read_bytes().count(b"\n") > 1 and len(sweep_measures.logged()) > 3
        )
        with pytest.raises(SceneError, match="another process"), open_checkpoint(path, study):
            pass
        workers = children(running.pid)
        assert len(workers) >= 2
        os.kill(running.pid, number)
        running.wait(timeout=600)
        assert eventually(lambda: not any(map(is_there, workers)))
    with open_checkpoint(path, study) as kept:
        assert kept.rows


def test_two_sweeps_to_one_file_end_with_one_whole_result(tmp_path: Path) -> None:
    words = ["sweep", "paper-cart-2", "--vary", "support.mass=1:100:20", "--measure", "energy_drift:2"]
    command = [*COMMAND, *words, "--workers", "1", "-o", str(tmp_path / "m.csv")]
    both = [subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) for _ in range(2)]
    codes = {running.communicate(timeout=600)[1]: running.returncode for running in both}
    assert (tmp_path / "m.csv").read_text().count("\n") == 21
    assert set(codes.values()) <= {0, 2}
    assert all("another process is writing it" in told for told, code in codes.items() if code)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["m.csv", "m.csv.json"]


@pytest.mark.parametrize(
    ("number", "delay"),
    usually(
        [(signal.SIGINT, 0.05), (signal.SIGTERM, 1.0)],
        [(signal.SIGINT, 0.05), (signal.SIGTERM, 0.3), (signal.SIGINT, 1.2), (signal.SIGTERM, 1.2)],
    ),
)
def test_a_command_that_is_ended_says_so_in_one_line(number: int, delay: float, tmp_path: Path) -> None:
    """While it loads as well as at work."""
    words = ["animate", "chain-3", "--duration", "600", "--seconds", "600", "-o", str(tmp_path / "f.html")]
    begins = (
        "import sys; from multipendula.cli import main; sys.stderr.write('.'); sys.stderr.flush(); sys.exit(main())"
    )
    with subprocess.Popen(
        [sys.executable, "-c", begins, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as running:
        assert running.stderr
        assert running.stderr.read(1) == b"."
        time.sleep(delay)
        os.kill(running.pid, number)
        told = running.communicate(timeout=600)[1]
    assert (running.returncode, told) == (130, b"multipendula: interrupted\n")
    assert not list(tmp_path.iterdir())


def test_an_interrupt_that_is_lost_without_a_trace_is_raised_again(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def goes_on(*_: Any) -> None:
        with suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        assert eventually(lambda: False, 60)

    monkeypatch.setattr("multipendula.cli.INTERRUPT_SECONDS", 0.1)
    monkeypatch.setattr("modal.scene.load", goes_on)
    assert main(["table", "chain-1"]) == 130
    assert capsys.readouterr().err == "multipendula: interrupted\n"


def ffmpeg() -> None:
    pytest.importorskip("imageio_ffmpeg")


def test_ctrl_c_at_the_first_import_is_ctrl_c() -> None:
    code = (
        "import sys\n"
        "class Interrupting:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name == 'multipendula.cli':\n"
        "            raise KeyboardInterrupt\n"
        "from multipendula.__main__ import main\n"
        "sys.meta_path.insert(0, Interrupting())\n"
        "sys.exit(main())\n"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout, ended.stderr) == (130, "", "multipendula: interrupted\n")


def test_ctrl_c_during_an_mp4_is_ctrl_c(tmp_path: Path) -> None:
    ffmpeg()
    words = ["animate", "chain-3", "--duration", "600", "--seconds", "600", "-o", str(tmp_path / "f.mp4")]
    with subprocess.Popen(
        [*COMMAND, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True
    ) as running:
        assert eventually(lambda: children(running.pid) or running.poll() is not None)
        encoder = children(running.pid)
        time.sleep(0.3)
        os.killpg(running.pid, signal.SIGINT)
        told = running.communicate(timeout=600)[1]
    assert (running.returncode, told) == (130, b"multipendula: interrupted\n")
    assert eventually(lambda: not any(map(is_there, encoder)))
    assert not list(tmp_path.iterdir())


def test_an_interrupt_that_a_library_swallows_is_one_all_the_same(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def loses(*_: Any) -> None:
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt:
            raise ImportError("numpy._core.multiarray failed to import") from None

    monkeypatch.setattr("modal.scene.load", loses)
    assert main(["table", "chain-1"]) == 130
    assert capsys.readouterr().err == "multipendula: interrupted\n"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_what_is_put_off_comes_in_its_time(number: int) -> None:
    done = False
    before = signal.signal(number, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt), without_interrupts():  # noqa: PT012
            signal.raise_signal(number)
            done = True
    finally:
        signal.signal(number, before)
    assert done


# ---------------------------------------------------------------------------------------------------- full disks


@pytest.mark.parametrize("room", [0, 3000])
@pytest.mark.parametrize(
    "words",
    [
        "table chain-3 --format json --shapes",
        "shapes chain-3",
        "explain paper-cart-2",
        "animate chain-2 --duration 1 --seconds 0.2",
        "simulate chain-2 --duration 1",
        "sweep chain-2 --vary gravity=1:2:9",
        "export paper-cart-2",
    ],
)
def test_a_full_disk_leaves_nothing(words: str, room: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    resource = pytest.importorskip("resource")
    kinds = {"table": "json", "shapes": "pdf", "explain": "svg", "animate": "gif", "simulate": "npz", "sweep": "csv"}
    kind = kinds.get(words.split(maxsplit=1)[0], "json")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, before[1]))
    extra = ["--to", "json"] if words.startswith("export") else []
    try:
        code = main([*words.split(), *extra, "-o", str(tmp_path / f"f.{kind}")])
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    told = capsys.readouterr().err
    left = {path.name for path in tmp_path.iterdir()} - {"log"}
    assert not [name for name in left if name.startswith(".multipendula")]
    written = left - {"f.csv.json"} if code == 0 else left
    assert (code, written) == (0, {f"f.{kind}"}) or (
        code == 1 and left <= {"f.csv.journal"} and "File too large" in told
    )
    assert code or room > 0


def test_an_mp4_that_has_no_room_is_told_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ffmpeg()
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, before[1]))
    try:
        code = main(["animate", "chain-2", "--duration", "1", "--seconds", "0.2", "-o", str(tmp_path / "f.mp4")])
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    told = capsys.readouterr().err
    assert code == 1
    assert len(told.splitlines()) == 1
    assert "rawvideo" not in told
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("form", ["gif", "html"])
def test_a_disk_that_is_full_when_the_file_is_closed(form: str, tmp_path: Path) -> None:
    """Closing writes what is left once more, and fails once more."""
    resource = pytest.importorskip("resource")
    run = simulate(load("chain-1"), 0.2, output=9)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        with pytest.raises(OSError, match="too large") as caught, whole_file(tmp_path / "f") as stream:  # noqa: PT012
            resource.setrlimit(resource.RLIMIT_FSIZE, (10, before[1]))
            animate(run, stream, form, seconds=0.1)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert caught.value.errno == errno.EFBIG
    assert caught.value.filename == str(tmp_path / "f")
    assert not list(tmp_path.iterdir())


def test_the_file_that_does_not_fit_is_the_one_that_is_named(tmp_path: Path) -> None:
    """Not that within which it is written."""
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        with pytest.raises(OSError, match="too large") as caught, whole_file(tmp_path / "outer"):  # noqa: PT012
            resource.setrlimit(resource.RLIMIT_FSIZE, (10, before[1]))
            with whole_file(tmp_path / "inner") as stream:
                stream.write(bytes(99))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert caught.value.filename == str(tmp_path / "inner")
    assert not list(tmp_path.iterdir())
