"""Another distribution that bears an import name of this one."""

import shutil
import subprocess
import sys
import warnings
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import pytest

from modal.namesake import warn_about_namesake


def test_the_other_distribution_is_named(tmp_path: Path) -> None:
    (tmp_path / "modal-1.2.dist-info").mkdir()
    with pytest.warns(UserWarning, match="the Modal cloud client"):
        warn_about_namesake(["", str(tmp_path)])


@pytest.mark.parametrize("folder", ["modal_client-1.2.dist-info", "multimodal-1.dist-info", "modal"])
def test_others_are_not(tmp_path: Path, folder: str) -> None:
    (tmp_path / folder).mkdir()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warn_about_namesake([str(tmp_path), str(tmp_path / "nowhere")])


ROOT = Path(__file__).parent.parent
COPIED = (
    *("modal/lazy.py", "modal/namesake.py", "nonlinear/__init__.py"),
    *("multipendula/__init__.py", "multipendula/__main__.py"),
)


def run_beside(folder: Path, *arguments: str) -> tuple[int, str]:
    """Exit code and messages of Python that finds the packages of a folder and no others."""
    done = subprocess.run(
        [sys.executable, "-S", *arguments],
        cwd=folder,
        env={"PYTHONPATH": str(folder)},
        capture_output=True,
        text=True,
        check=False,
    )
    return done.returncode, done.stderr


@pytest.mark.parametrize(
    "client", ["class App: ...", "import a_package_that_is_missing", None], ids=["runs", "fails", "gone"]
)
def test_an_overwritten_package_is_told_with_the_way_out(tmp_path: Path, client: str | None) -> None:
    """The client installed last, with and without what it needs, and removed again."""
    for name in COPIED:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    if client is not None:
        (tmp_path / "modal" / "__init__.py").write_text(client)
    code, said = run_beside(tmp_path, "-m", "multipendula", "table", "chain-1")
    assert code == 1
    assert "pip uninstall modal multipendula" in said
    assert "Traceback" not in said
    if client != "import a_package_that_is_missing":
        code, said = run_beside(tmp_path, "-c", "import nonlinear")
        assert code == 1
        assert "ImportError: the package 'modal' in" in said
        assert "pip uninstall modal multipendula" in said


def hatch_build() -> ModuleType:
    """What hatch runs while it builds."""
    pytest.importorskip("hatchling")
    spec = spec_from_file_location("hatch_build", ROOT / ".ci" / "hatch_build.py")
    assert spec
    assert spec.loader
    hooks = module_from_spec(spec)
    spec.loader.exec_module(hooks)
    return hooks


def test_a_build_for_an_environment_with_the_client_is_refused(tmp_path: Path) -> None:
    hook = hatch_build()
    assert hook.namesake(str(tmp_path)) is None
    (tmp_path / "modal-1.2.dist-info").mkdir()
    assert hook.namesake(str(tmp_path / "nowhere"), str(tmp_path)) == str(tmp_path)


def test_the_description_on_an_index_leads_to_no_file() -> None:
    hook = hatch_build()
    text = hook.for_index((ROOT / "README.md").read_text(encoding="utf-8"))
    assert text.startswith("# multipendula\n\nNatural frequencies")
    assert "A tour shows all" in " ".join(text.split())
    assert [word for word in ("](docs", "](CHANGELOG", "<picture", "<img", "](notebooks") if word in text] == []
    assert hook.for_index("[a](https://b.c) [d](e.md#f) ![g](h.png)") == "[a](https://b.c) d "


@pytest.mark.parametrize("module", ["modal", "nonlinear"])
def test_what_is_not_there_is_said_with_the_package(module: str) -> None:
    with pytest.raises(AttributeError, match=f"module '{module}' has no attribute 'nothing'"):
        import_module(module).nothing  # noqa: B018
