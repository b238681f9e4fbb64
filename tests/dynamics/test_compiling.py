"""What numba keeps on disk: it heals, it is private, and nothing of anybody else's is run."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from collections.abc import Callable, Iterator
from hashlib import sha256
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from threading import Thread
from types import SimpleNamespace
from typing import Any

import pytest

from nonlinear.dynamics import compiling
from nonlinear.dynamics.compiling import KeptFile
from nonlinear.integration import kernels, readiness

pytestmark = pytest.mark.skipif(not compiling.available(), reason="numba is not installed")
TEXT = "from nonlinear.dynamics.compiling import compiled\n\n\n@compiled\ndef run(x):\n    return 2.0 * x + 1.0\n"
posix = pytest.mark.skipif(os.name != "posix", reason="permissions of POSIX")


@pytest.fixture(autouse=True)
def kept_apart(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[None]:
    """Caches below a folder of the test, with the loosest umask."""
    for name in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", str(tmp_path))
    readiness.temporary.cache_clear()
    before = os.umask(0)
    yield
    os.umask(before)
    readiness.temporary.cache_clear()


def loaded(folder: Path) -> Any:
    path = folder / "own.py"
    path.write_text(TEXT, encoding="utf-8")
    spec = spec_from_file_location("own", path)
    assert spec
    assert spec.loader
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.run


def files(folder: Path, ending: str) -> list[Path]:
    return sorted((folder / "__pycache__").glob(f"own.run-*.{ending}"))


def flipped(content: bytes) -> bytes:
    return content[:-200] + bytes([content[-200] ^ 1]) + content[-199:]


@pytest.mark.parametrize("ending", ["nbi", "nbc"])
@pytest.mark.parametrize(
    "damage",
    [
        lambda content: b"",
        lambda content: content[: len(content) // 2],
        lambda content: content[:-1],
        flipped,
        lambda content: content[::-1],
    ],
)
def test_a_damaged_file_is_dropped_and_made_anew(ending: str, damage: Callable[[bytes], bytes], tmp_path: Path) -> None:
    assert loaded(tmp_path)(3.0) == 7.0
    (path,) = files(tmp_path, ending)
    good = path.read_bytes()
    again = loaded(tmp_path)
    assert again(3.0) == 7.0
    assert sum(again.stats.cache_hits.values()) == 1
    path.write_bytes(damage(good))
    healed = loaded(tmp_path)
    assert healed(3.0) == 7.0
    assert sum(healed.stats.cache_misses.values()) == 1
    assert path.stat().st_size >= len(good) - 8
    kernel = loaded(tmp_path)
    assert kernel(3.0) == 7.0
    assert sum(kernel.stats.cache_hits.values()) == 1


def test_parts_of_a_compiled_function_are_in_its_files_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    parts = "\n@part\ndef twice(x):\n    return 2.0 * x\n\n\n@vectorized_part\ndef next(x):\n    return x + 1.0\n\n\n"
    text = TEXT.replace("compiled\n", "compiled, part, vectorized_part\n", 1).replace("2.0 * x + 1.0", "next(twice(x))")
    monkeypatch.setitem(globals(), "TEXT", text.replace("\n@compiled", f"{parts}@compiled"))
    assert loaded(tmp_path)(3.0) == 7.0
    again = loaded(tmp_path)
    assert again(3.0) == 7.0
    assert sum(again.stats.cache_hits.values()) == 1
    kept = [*(tmp_path / "__pycache__").iterdir()]
    assert {path.name.split("-")[0] for path in kept if path.suffix in {".nbi", ".nbc"}} == {"own.run"}


def test_what_is_kept_is_dropped_where_what_it_calls_is_another(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Dates and comments are nothing; a number that it reads, code that it calls, and how that is compiled are."""
    text = TEXT.replace("compiled\n", "compiled, part, vectorized_part\n", 1).replace("2.0 * x", "twice(x)")
    text = text.replace("\n@compiled", "TWO = 2.0\n\n\n@part\ndef twice(x):\n    return TWO * x\n\n\n@compiled")

    def hits(text: str, value: float) -> int:
        monkeypatch.setitem(globals(), "TEXT", text)
        run = loaded(tmp_path)
        assert run(3.0) == value
        return int(sum(run.stats.cache_hits.values()))

    assert [hits(each, 7.0) for each in (text, text, text.replace("TWO * x", "TWO * x  # so"))] == [0, 1, 1]
    for before, after, value in (
        ("= 2.0", "= 4.00", 13.0),
        ("TWO * x", "TWO * (x + 1.0)", 9.0),
        ("+ 1.0", "+ 3.000", 9.0),
        ("@part", "@vectorized_part", 7.0),
    ):
        assert hits(text.replace(before, after), value) == 0


@posix
def test_files_are_private_and_those_that_others_could_write_are_not_read(tmp_path: Path) -> None:
    assert loaded(tmp_path)(3.0) == 7.0
    every = [*files(tmp_path, "nbi"), *files(tmp_path, "nbc")]
    assert [path.stat().st_mode & 0o777 for path in every] == [0o600] * 2
    for path in every:
        path.chmod(0o622)
        again = loaded(tmp_path)
        assert again(3.0) == 7.0
        assert not again.stats.cache_hits
        assert path.stat().st_mode & 0o777 == 0o600


@posix
@pytest.mark.parametrize("ending", ["nbi", "nbc"])
@pytest.mark.parametrize("link", [os.symlink, os.link])
def test_what_a_link_names_is_not_run(ending: str, link: Callable[[Path, Path], None], tmp_path: Path) -> None:
    """The link names another file of the user's own, which is good in itself."""
    assert loaded(tmp_path)(3.0) == 7.0
    (path,) = files(tmp_path, ending)
    there = tmp_path / "there"
    path.rename(there)
    link(there, path)
    again = loaded(tmp_path)
    assert again(3.0) == 7.0
    assert not again.stats.cache_hits
    assert not path.is_symlink()
    assert path.stat().st_nlink == 1


@posix
@pytest.mark.parametrize("ending", ["nbi", "nbc"])
def test_what_is_examined_is_what_is_opened(ending: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever a name becomes after it was examined: here a pickle that runs code takes its place at once."""
    assert loaded(tmp_path)(3.0) == 7.0
    (path,) = files(tmp_path, ending)
    evil, ran, looks = tmp_path / "evil", tmp_path / "ran", 0
    content = pickle.dumps(_Runs(ran))
    evil.write_bytes(content if ending == "nbi" else sha256(content).digest() + content)
    examine = os.stat

    def swapping(place: Any, **options: Any) -> os.stat_result:
        nonlocal looks
        status = examine(place, **options)
        if os.fspath(place) == os.fspath(path) and not looks:
            looks += 1
            path.unlink()
            path.symlink_to(evil)
        return status

    monkeypatch.setattr(os, "stat", swapping)
    monkeypatch.setattr(Path, "stat", swapping)
    assert loaded(tmp_path)(3.0) == 7.0
    assert not ran.exists()


class _Runs:
    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Any, ...]:
        return Path.touch, (self.path,)


@posix
def test_a_folder_that_others_may_change_keeps_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from numba import config

    shared, source = tmp_path / "shared", tmp_path / "source"
    source.mkdir()
    shared.mkdir()
    (shared / "numba").mkdir(mode=0o755)
    monkeypatch.setattr(config, "CACHE_DIR", str(shared / "numba"))
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(shared / "numba"))
    kept = (0o755, True), (0o757, False), (0o1777, True)
    for mode, good in kept:
        shared.chmod(0o755)
        assert loaded(source)(3.0) == 7.0
        shared.chmod(mode)
        again = loaded(source)
        assert again(3.0) == 7.0
        assert bool(again.stats.cache_hits) == good


def test_a_full_disk_costs_time_only(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(compiling.os, "replace", full)
    assert loaded(tmp_path)(3.0) == 7.0
    assert not [*files(tmp_path, "nb*"), *files(tmp_path, "nb*.tmp.*")]


# ------------------------------------------------------------------------------------------------ kernels' folder


def fresh(text: str) -> Any:
    kernels._module_of.cache_clear()
    return kernels.module_of(text)


def test_a_kernel_runs_its_own_text_and_no_bytecode_beside_it(tmp_path: Path) -> None:
    path = kernels.path_of(TEXT)
    assert path.parent == tmp_path / ".cache" / "multipendula"
    assert fresh(TEXT).run(3.0) == 7.0
    if os.name == "posix":
        assert [place.stat().st_mode & 0o777 for place in (path.parent, path)] == [0o700, 0o600]
    assert not [*path.parent.rglob("*.pyc")]
    foreign = path.parent / "__pycache__" / f"{path.stem}.{sys.implementation.cache_tag}.pyc"
    script = f"import py_compile; py_compile.compile(r'{tmp_path / 'foreign.py'}', cfile=r'{foreign}')"
    (tmp_path / "foreign.py").write_text("raise SystemExit(9)\n", encoding="utf-8")
    subprocess.run([sys.executable, "-c", script], check=True)
    path.write_text("raise SystemExit(8)\n", encoding="utf-8")
    assert fresh(TEXT).run(3.0) == 7.0
    assert path.read_text(encoding="utf-8") == TEXT


@posix
@pytest.mark.parametrize("how", ["unwritable", "no folder", "no temporary one"])
def test_without_a_folder_one_temporary_folder_is_used(
    how: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "tmp").mkdir()
    monkeypatch.setattr(readiness, "mkdtemp", lambda prefix: _folder(tmp_path / "tmp" / prefix))
    if how == "unwritable":
        (tmp_path / ".cache").write_text("no folder", encoding="utf-8")
    else:
        monkeypatch.setenv("HOME", "no/such")
    if how == "no temporary one":
        monkeypatch.setattr(readiness, "mkdtemp", _none)
    assert fresh(TEXT).run(3.0) == 7.0
    if how != "no temporary one":
        assert fresh(TEXT + "\n").run(3.0) == 7.0
        assert len([*(tmp_path / "tmp" / "multipendula-").glob("lanes_*.py")]) == 2


@posix
def test_a_folder_of_somebody_else_is_not_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    loose = tmp_path / "loose"
    loose.mkdir(mode=0o777)
    assert readiness.made_private(loose).stat().st_mode & 0o777 == 0o700
    monkeypatch.setattr(readiness.os, "geteuid", lambda: os.getuid() + 1)
    with pytest.raises(PermissionError):
        readiness.made_private(loose)


def _folder(path: Path) -> str:
    path.mkdir(mode=0o700)
    return str(path)


def _none(prefix: str) -> str:
    raise FileNotFoundError(2, "No usable temporary directory")


def test_relative_names_of_caches_are_ignored(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", "relative/cache")
    assert readiness.folder() == tmp_path / ".cache" / "multipendula"
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "there"))
    assert readiness.folder() == tmp_path / "there" / "multipendula"


def test_a_temporary_folder_is_removed_when_its_process_ends(tmp_path: Path) -> None:
    code = "from nonlinear.integration.readiness import folder; print(folder())"
    environment = {**os.environ, "HOME": "no/such", "TMPDIR": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.startswith(str(tmp_path / "multipendula-"))
    assert not [*tmp_path.iterdir()]


def test_what_one_process_compiles_others_wait_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Locks of two open files exclude each other as those of two processes do; nobody waits for ever."""
    first, second = KeptFile(), KeptFile()
    for file in (first, second):
        file._cache_path, file._index_name, file.function = (
            str(tmp_path),
            "module.run.nbi",
            SimpleNamespace(py_func=files),
        )
    ended: list[str] = []

    def waiting() -> None:
        with second.turn():
            ended.append("second")

    with first.turn(), first.turn():
        other = Thread(target=waiting)
        other.start()
        other.join(0.2)
        assert not ended
    other.join()
    assert ended == ["second"]
    monkeypatch.setattr(compiling, "LOCK_SECONDS", 0.1)
    with first.turn(), second.turn():
        ended.append("both")
    assert ended == ["second", "both"]
