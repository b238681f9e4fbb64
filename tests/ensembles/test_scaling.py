"""Chunks: the same bytes whoever computes them and in whatever order, kept through kill −9, and bounded memory."""

from __future__ import annotations

import os
import pickle
import random
import shutil
import signal
import subprocess
import sys
import time
import tracemalloc
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from support.amounts import usually

from modal import load
from modal.errors import ComputationError, SceneError
from modal.scene import Scene, scene_from
from modal.scene.files import TEMPORARY
from nonlinear.ensembles import Ensemble, ensemble
from nonlinear.ensembles.executors import WorkerPool
from nonlinear.ensembles.store import Parts
from nonlinear.files import as_npz, from_npz
from nonlinear.integration import readiness
from nonlinear.integration.methods import choose

STARTS = np.random.default_rng(0).uniform(-2, 2, (60, 2))
MEASURES = ["first_turn", "largest_angle", "section:theta[1,1]=0"]


def run(folder: Path | None, **more: object) -> Ensemble:
    options = {"starts": STARTS, "measures": MEASURES, "output": "end", "chunk": 7, "engine": "numpy", "workers": 1}
    scene = more.pop("scene", load("chain-2"))
    return ensemble(scene, 1.0, folder=folder, **options | more)


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


DRIVE = {"kind": "escapement", "impulse": 0.1, "angle_deg": 3.0}
RUBBING = [{"kind": "bob", "mass": 1.0, "length": 1.0, "friction": friction} for friction in (0.3, 0.2)]
SCENES = {
    "smooth": load("chain-2"),
    "switches": scene_from({"gravity": 9.81, "pendulum": [{"links": [{**RUBBING[0], "drive": DRIVE}, RUBBING[1]]}]}),
}


@pytest.fixture(scope="module", params=usually(["switches"], [*SCENES]))
def whole(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Scene, dict[str, bytes]]:
    """A scene, and what one process writes of it in one go."""
    folder, scene = tmp_path_factory.mktemp(request.param), SCENES[request.param]
    run(folder, scene=scene)
    return scene, contents(folder)


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("alone")
    run(folder)
    return contents(folder)


class Shuffled(Executor):
    """Does what it is given in threads, and in a random order."""

    def __init__(self) -> None:
        self.threads, self.random = ThreadPoolExecutor(3), random.Random(1)

    def submit(self, function, /, *arguments, **more) -> Future:
        def later() -> object:
            time.sleep(self.random.uniform(0, 0.05))
            return function(*arguments, **more)

        return self.threads.submit(later)


class Dying(Executor):
    """Its workers die at the third task."""

    def __init__(self) -> None:
        self.count = 0

    def submit(self, function, /, *arguments, **more) -> Future:
        self.count += 1
        future: Future = Future()
        if self.count < 3:
            future.set_result(function(*arguments, **more))
        else:
            future.set_exception(BrokenExecutor())
        return future


class Losing(Executor):
    """Loses or cancels every task of so many and continues, as executors of clusters do."""

    def __init__(self, every: int, *, cancels: bool = False) -> None:
        self.count, self.every, self.cancels = 0, every, cancels

    def submit(self, function, /, *arguments, **more) -> Future:
        future: Future = Future()
        self.count += 1
        if self.count % self.every == 0 and self.cancels:
            future.cancel()
            future.set_running_or_notify_cancel()
        elif self.count % self.every == 0:
            future.set_exception(RuntimeError("a node was reclaimed"))
        else:
            future.set_result(function(*arguments, **more))
        return future


def test_what_an_executor_loses_in_its_own_words_is_done_again(tmp_path: Path, alone: dict[str, bytes]) -> None:
    for folder, crew in {"lost": Losing(5), "cancelled": Losing(5, cancels=True), "made": ThreadPoolExecutor}.items():
        run(tmp_path / folder, crew=crew)
        assert contents(tmp_path / folder) == alone
    with ThreadPoolExecutor(2) as executor:
        run(tmp_path / "threads", crew=executor)
    assert contents(tmp_path / "threads") == alone
    with pytest.raises(ComputationError, match="a worker failed: RuntimeError: a node was reclaimed"):
        run(None, crew=Losing(1))


@pytest.mark.parametrize("name", ["loky", "processes"])
def test_an_executor_whose_worker_is_killed_is_made_anew(tmp_path: Path, alone: dict[str, bytes], name: str) -> None:
    make = ProcessPoolExecutor if name == "processes" else pytest.importorskip("loky").get_reusable_executor
    made: list[Executor] = []
    heard: list[float] = []

    def crew() -> Executor:
        made.append(make(max_workers=2))
        return made[-1]

    def killing(done: float) -> None:
        heard.append(done)
        if len(heard) == 3:
            os.kill(next(iter(made[0]._processes)), signal.SIGKILL)  # type: ignore[attr-defined]

    run(tmp_path, crew=crew, report=killing)
    assert contents(tmp_path) == alone
    assert len(made) > 1


def test_the_bytes_do_not_depend_on_workers(tmp_path: Path, alone: dict[str, bytes]) -> None:
    assert len(alone) == 10
    run(tmp_path / "shuffled", crew=WorkerPool(Shuffled(), 3))
    assert contents(tmp_path / "shuffled") == alone


def test_the_bytes_are_those_of_processes(tmp_path: Path, alone: dict[str, bytes]) -> None:
    run(tmp_path / "processes", workers=2)
    assert contents(tmp_path / "processes") == alone


@pytest.mark.parametrize("engine", usually(["numpy"], ["numpy", "numba"]))
def test_the_bytes_of_members_with_switches_do_not_depend_on_who_computes_them(tmp_path: Path, engine: str) -> None:
    if engine == "numba":
        pytest.importorskip("numba")
    options = {"scene": SCENES["switches"], "engine": engine}
    run(tmp_path / "alone", **options)
    alone = contents(tmp_path / "alone")
    run(tmp_path / "shuffled", crew=WorkerPool(Shuffled(), 3), **options)
    run(tmp_path / "processes", workers=2, **options)
    with pytest.raises(ComputationError, match="died"):
        run(tmp_path / "died", crew=WorkerPool(Dying(), 1), **options)
    run(tmp_path / "died", **options)
    for folder in ("shuffled", "processes", "died"):
        assert contents(tmp_path / folder) == alone


@pytest.mark.usefixtures("any_engine")
def test_the_bytes_do_not_depend_on_what_is_loaded(
    tmp_path: Path, alone: dict[str, bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The runs that members are compared with are not compiled, not even where that would cost nothing."""
    pytest.importorskip("numba")
    monkeypatch.setattr(readiness, "_ready", {"DOP853"})
    assert choose(load("chain-2"), 1.0, 1e-9, "DOP853").compiled
    run(tmp_path / "loaded")
    assert contents(tmp_path / "loaded") == alone


def test_what_dead_workers_leave_is_done_by_the_next_call(tmp_path: Path, alone: dict[str, bytes]) -> None:
    with pytest.raises(ComputationError, match="died"):
        run(tmp_path, crew=WorkerPool(Dying(), 1))
    done = contents(tmp_path)
    assert 1 < len(done) < len(alone)
    assert done.items() <= alone.items()
    runs = run(tmp_path)
    assert contents(tmp_path) == alone
    assert runs.column("links_rad").shape == (60, 2)


def test_kill_9_loses_at_most_a_chunk(tmp_path: Path, whole: tuple[Scene, dict[str, bytes]]) -> None:
    """A process is killed as soon as three chunks are there; the next resumes, and all is the same to the byte."""
    scene, alone = whole
    code = (
        "import pickle, sys, numpy as np; from nonlinear.ensembles import ensemble\n"
        f"scene = pickle.loads({pickle.dumps(scene)!r})\n"
        "starts = np.random.default_rng(0).uniform(-2, 2, (60, 2))\n"
        "def waiting(done):\n    if done >= 21:\n        print('there', flush=True); sys.stdin.read()\n"
        f"ensemble(scene, 1.0, starts=starts, measures={MEASURES!r}, output='end', chunk=7, engine='numpy',"
        " workers=1, folder=sys.argv[1], report=waiting)"
    )
    command = [sys.executable, "-c", code, os.fspath(tmp_path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout
        assert process.stdout.readline() == b"there\n"
        process.send_signal(signal.SIGKILL)
        process.wait()
    before = {path: path.stat().st_mtime_ns for path in tmp_path.glob("part-*.npz")}
    assert 2 <= len(before) < 9
    heard: list[float] = []
    run(tmp_path, scene=scene, report=heard.append)
    assert heard[0] == 7 * len(before)
    assert {path: path.stat().st_mtime_ns for path in before} == before
    assert contents(tmp_path) == alone


KILLED = """
import os, pickle, signal, sys, time
from nonlinear.ensembles import ensemble

def written():
    return sum(name.startswith("part") for name in os.listdir(sys.argv[1]))

question, shares, moments = pickle.load(sys.stdin.buffer)
os.mkdir(sys.argv[1])
ensemble(**question | {"starts": question["starts"][:2]})
for moment in moments:
    before = written()
    children = []
    for share in shares:
        child = os.fork()
        if not child:
            ensemble(folder=sys.argv[1], share=share, **question)
            os._exit(0)
        children.append(child)
    while moment > 0 and written() == before:
        time.sleep(0.001)
    time.sleep(abs(moment))
    for child in children:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
    print(written())
"""
"""Processes that compute their shares of an ensemble, killed at moments (s) after a chunk; negative, after a start."""


@pytest.mark.parametrize(("processes", "kills"), usually([(1, 3)], [(1, 10), (2, 10)]))
def test_kill_9_at_any_moment_changes_nothing(tmp_path: Path, processes: int, kills: int) -> None:
    """In one process, and in two that share a folder: whoever resumes ends with the same bytes."""
    drawn = np.random.default_rng(processes)
    question = {"scene": load("chain-2"), "duration": 1.0, "starts": drawn.uniform(-2, 2, (90, 2)), "engine": "numpy"}
    question |= {"measures": MEASURES, "output": "end", "chunk": 3, "workers": 1, "check": 4}
    shares = [(k, processes) for k in range(processes)] if processes > 1 else [None]
    told = pickle.dumps((question, shares, drawn.uniform(-0.1, 0.1, kills).tolist()))
    command = [sys.executable, "-c", KILLED, os.fspath(tmp_path / "killed")]
    done = subprocess.run(command, input=told, capture_output=True, check=True, timeout=600)
    counts = [int(line) for line in done.stdout.split()]
    assert counts == sorted(counts)
    assert 0 < counts[-1] < 30
    ensemble(folder=tmp_path / "killed", **question)
    ensemble(folder=tmp_path / "alone", **question)
    parts = {name: data for name, data in contents(tmp_path / "killed").items() if not name.startswith(TEMPORARY)}
    assert parts == contents(tmp_path / "alone")


def test_another_ensemble_does_not_go_into_the_same_folder(tmp_path: Path, alone: dict[str, bytes]) -> None:
    run(tmp_path, starts=STARTS[:10])
    for other in ({"starts": STARTS[:11]}, {"starts": STARTS[:10] + 1e-9}, {"starts": STARTS[:10], "tolerance": 1e-8}):
        with pytest.raises(SceneError, match="holds another ensemble"):
            run(tmp_path, **other)


def test_a_damaged_part_is_refused(tmp_path: Path) -> None:
    runs = run(tmp_path, starts=STARTS[:10])
    path = tmp_path / "part-000001.npz"
    path.write_bytes(path.read_bytes()[:-40])
    with pytest.raises(SceneError, match="part-000001"):
        runs.column("energy_drift")
    with pytest.raises(SceneError, match="part-000001"):
        run(tmp_path, starts=STARTS[:10])


def test_a_chunk_of_another_ensemble_is_refused(tmp_path: Path) -> None:
    """Or of another place, before anything is computed."""
    folder, other = tmp_path / "one", tmp_path / "other"
    run(folder, starts=STARTS[:14])
    run(other, starts=STARTS[:14] / 2)
    (folder / "part-000001.npz").write_bytes((other / "part-000001.npz").read_bytes())
    with pytest.raises(SceneError, match=r"part-000001\.npz: is a chunk of another ensemble: remove it"):
        run(folder, starts=STARTS[:14])
    (other / "part-000001.npz").write_bytes((other / "part-000000.npz").read_bytes())
    with pytest.raises(SceneError, match=r"part-000001\.npz: holds members 0 to 6, not 7 to 13"):
        run(other, starts=STARTS[:14] / 2)


def test_a_chunk_that_was_altered_is_refused_with_one_sentence(tmp_path: Path) -> None:
    """Also where whoever altered it has made its checksum anew."""
    run(tmp_path, starts=STARTS[:7])
    path = tmp_path / "part-000000.npz"
    header, columns = from_npz(path)
    half = {name: column[:3] for name, column in columns.items()}
    words = {name: np.array(["a"] * len(column)) for name, column in columns.items()}
    numbers = [{"first": float("inf")}, {"reasons": {"99": "x"}}, {"differences_rad": {"3": "0x1p99999"}}]
    forgeries = [(header, {}), (header, half), (header, words), *((header | changes, columns) for changes in numbers)]
    for content in (*(as_npz(*forgery) for forgery in forgeries), b"", path.read_bytes()[:-1]):
        path.write_bytes(content)
        with pytest.raises(SceneError, match=rf"^{path}: [^\n]*$"):
            run(tmp_path, starts=STARTS[:7])


def test_a_header_of_an_ensemble_that_is_none_is_refused(tmp_path: Path) -> None:
    run(tmp_path, starts=STARTS[:7])
    path = tmp_path / "ensemble.json"
    for content in (b"\xff\xfe", b"[" * 100_000, b"[]"):
        path.write_bytes(content)
        with pytest.raises(SceneError, match="holds another ensemble"):
            run(tmp_path, starts=STARTS[:7])
    path.unlink()
    os.mkfifo(path)
    with pytest.raises(SceneError, match=r"ensemble\.json: not a file"):
        run(tmp_path, starts=STARTS[:7])


def test_chunks_in_memory_and_on_disk_say_the_same(tmp_path: Path) -> None:
    kept, memory = run(tmp_path), run(None)
    assert kept.columns == memory.columns
    for name in memory.columns:
        np.testing.assert_array_equal(kept.column(name), memory.column(name))
    assert kept.differences == memory.differences
    assert kept.words() == memory.words()


def test_a_folder_is_one_data_set_of_which_chunks_are_read_as_they_are_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("xarray")
    asked: dict[str, object] = {"output": 3, "chunk": 2, "measures": MEASURES}
    kept = run(tmp_path, starts=STARTS[:9], share=(0, 2), **asked)
    some = kept.to_xarray()
    assert np.isnan(some.energy_drift.values).tolist() == [False, False, True, True] * 2 + [False]
    whole = run(tmp_path, starts=STARTS[:9], **asked)
    read: list[int] = []
    monkeypatch.setattr(
        Parts, "read", lambda parts, number, once=Parts.read: read.append(number) or once(parts, number)
    )
    data, links = whole.to_xarray(), whole.column("links_rad")
    read.clear()
    assert data.links_rad.shape == links.shape
    np.testing.assert_array_equal(data.links_rad[3:6, 1, ::-1].values, links[3:6, 1, ::-1])
    assert read == [1, 2]
    np.testing.assert_array_equal(data.links_rad[8, :, 0].values, links[8, :, 0])
    for name in data.data_vars:
        np.testing.assert_array_equal(data[name].values, whole.column(name))
    assert {*data.data_vars} == {name for name in whole.columns if not name.startswith("crossing_")}
    memory = run(None, starts=STARTS[:9], **asked).to_xarray()
    np.testing.assert_array_equal(memory.links_rad.values, links)


def test_a_folder_of_earlier_is_read_and_goes_on(tmp_path: Path) -> None:
    """The folder was written by version 1; its chunks are not computed again, and one that is removed is as it was."""
    shutil.copytree(Path(__file__).parent / "written", tmp_path / "written")
    before = contents(tmp_path / "written")
    question = {"starts": [[0.1], [0.2], [3.0]], "measures": ["largest_angle", "section:theta[1,1]=0"], "chunk": 2}
    scene, heard = load("chain-1").model_copy(update={"title": "Chain of 1 equal bob"}), list[float]()
    runs = run(tmp_path / "written", scene=scene, report=heard.append, **question)
    assert heard == [3]
    assert contents(tmp_path / "written") == before
    assert np.allclose(runs.column("largest_angle_deg"), np.degrees([0.1, 0.2, 3.0]), rtol=1e-9)
    (tmp_path / "written" / "part-000001.npz").unlink()
    again = run(tmp_path / "written", scene=scene, **question)
    for name in runs.columns:
        assert np.allclose(again.column(name), runs.column(name), rtol=1e-9, atol=1e-9, equal_nan=True), name


def peak(members: int) -> float:
    starts = np.random.default_rng(0).uniform(-2, 2, (members, 2))
    tracemalloc.start()
    options = {"measures": ["first_turn"], "workers": 1, "check": 0, "engine": "numpy", "chunk": 2048}
    ensemble(load("chain-2"), 0.02, starts=starts, **options)
    used = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return used


def test_memory_grows_by_what_is_kept_alone() -> None:
    """Five numbers a member: of a million under 1 GB, by the slope between 10,000 and 40,000."""
    slope = (peak(40_000) - peak(10_000)) / 30_000
    assert slope < 8 * 5 * 2.5
    assert peak(10_000) + slope * 990_000 < 1e9


def test_ctrl_c_keeps_what_is_known() -> None:
    def impatient(done: float) -> None:
        if done >= 14:
            raise KeyboardInterrupt

    runs = run(None, report=impatient)
    assert runs.interrupted
    assert np.count_nonzero(np.isfinite(runs.energy_drift)) == 14


@pytest.fixture
def cluster_of_two() -> Iterator[object]:
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
    ) as cluster:
        yield cluster


@pytest.mark.filterwarnings("ignore")
def test_a_dask_worker_that_is_killed_changes_nothing(
    tmp_path: Path, whole: tuple[Scene, dict[str, bytes]], cluster_of_two: object
) -> None:
    from nonlinear.ensembles.cluster import cluster

    scene, alone = whole
    heard: list[float] = []

    def killing(done: float) -> None:
        heard.append(done)
        if len(heard) == 3:
            first = next(iter(cluster_of_two.workers.values()))  # type: ignore[attr-defined]
            os.kill(first.pid, signal.SIGKILL)

    with cluster(cluster_of_two.scheduler_address, patience=600.0) as crew:  # type: ignore[attr-defined]
        run(tmp_path, scene=scene, crew=crew, report=killing)
    assert contents(tmp_path) == alone


def test_shares_make_up_the_whole(tmp_path: Path, alone: dict[str, bytes]) -> None:
    """Three calls that know nothing of each other, and one that puts their parts together."""
    for number in (2, 0, 1):
        part = run(tmp_path, share=(number, 3))
        assert np.isnan(part.energy_drift).any() == (number != 1)
    assert contents(tmp_path) == alone
    assert np.isfinite(run(tmp_path).energy_drift).all()
    with pytest.raises(SceneError, match="share"):
        run(tmp_path, share=(3, 3))
