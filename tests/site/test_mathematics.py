"""Where the manual's formulas get MathJax from, with a registry that is made up."""

from __future__ import annotations

import os
import stat
from pathlib import Path

import mathematics
import pytest


@pytest.fixture(autouse=True)
def apart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No packages but those that a test puts there."""
    monkeypatch.delenv("MATHJAX", raising=False)
    monkeypatch.setattr(mathematics, "ROOT", tmp_path)
    monkeypatch.setattr(mathematics, "FETCHED", tmp_path / "fetched")


def packages(modules: Path) -> Path:
    """Folders as npm makes them; that of MathJax."""
    for name, parts in mathematics.PARTS.items():
        for part in parts:
            path = modules / name / part
            path.parent.mkdir(parents=True, exist_ok=True)
            if path.suffix or path.name == "LICENSE":
                path.write_text(part)
            else:
                path.mkdir()
                (path / "one.js").write_text(part)
    return modules / "mathjax"


def registry(folder: Path, monkeypatch: pytest.MonkeyPatch, script: str) -> None:
    """An `npm` that does this, first on the path."""
    npm = folder / "bin" / "npm"
    npm.parent.mkdir()
    npm.write_text(f"#!/bin/sh\n{script}\n")
    npm.chmod(npm.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("PATH", f"{npm.parent}:{os.environ['PATH']}")


def test_the_named_folder_comes_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    packages(tmp_path / "node_modules")
    assert mathematics.packages_of()["mathjax"] == tmp_path / "node_modules" / "mathjax"
    monkeypatch.setenv("MATHJAX", str(packages(tmp_path / "mine")))
    assert mathematics.packages_of()["mathjax"] == tmp_path / "mine" / "mathjax"
    monkeypatch.setenv("MATHJAX", str(tmp_path / "nowhere"))
    assert mathematics.packages_of() is None


def test_what_is_served_is_what_a_page_may_load(tmp_path: Path) -> None:
    packages(tmp_path / "node_modules")
    target = tmp_path / "static" / "mathjax"
    (target / "old").mkdir(parents=True)
    mathematics.serve(mathematics.packages_of(), target)
    served = {str(path.relative_to(target)) for path in target.rglob("*") if path.is_file()}
    assert served == {
        "LICENSE", "tex-svg.js", "a11y/assistive-mml.js", "input/tex/extensions/one.js",
        "mathjax-newcm-font/svg/dynamic/one.js",
    }  # fmt: skip
    mathematics.serve(None, target)
    assert not target.exists()


@pytest.mark.skipif(os.name == "nt", reason="the registry is a shell script")
@pytest.mark.parametrize(
    ("script", "said"), [("exit 1", ""), ("echo another > mathjax.tgz", "is not the known archive")]
)
def test_another_archive_is_not_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], script: str, said: str
) -> None:
    registry(tmp_path, monkeypatch, script)
    assert mathematics.packages_of() is None
    assert said in capsys.readouterr().err
    assert not (tmp_path / "fetched").exists()


def test_without_npm_nothing_is_fetched(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    assert mathematics.packages_of() is None
