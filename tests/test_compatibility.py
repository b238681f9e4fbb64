"""Others that bear the import names: another distribution, and what version 0.1.0 called things."""

import shutil
import subprocess
import sys
import warnings
from importlib import import_module
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from math import inf
from pathlib import Path
from types import ModuleType

import pytest

from modal import _compatibility, load
from modal._compatibility import warn_about_namesake
from nonlinear import simulate
from nonlinear.accuracy import Candidate, measure_work_precision


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
COPIED = ("modal/_compatibility.py", "nonlinear/__init__.py", "multipendula/__init__.py", "multipendula/__main__.py")


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


@pytest.mark.slow
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
    assert "a tour shows all" in " ".join(text.split())
    assert [word for word in ("](docs", "](CHANGELOG", "<picture", "<img", "](notebooks") if word in text] == []
    assert hook.for_index("[a](https://b.c) [d](e.md#f) ![g](h.png)") == "[a](https://b.c) d "


DOCUMENTED = """
modal Bob Body Cart Fixed Pendulum Rod Scene SceneError Start dump dumps load matrices natural_modes pair shipped
modal.certified enclosures
modal.closed_forms hanging_rope rope_error_of_bobs rope_error_of_rods
modal.coupling explained
modal.coupling_figures coupling_figure
modal.decay damped_modes
modal.derivation derivation
modal.drives VanDerPol
modal.exports.control_ to_control
modal.feeding strengths
modal.figures shapes_figure
modal.files parse
modal.gains modal_gains unreached
modal.lagrange lagrange_equations time_derivative
modal.lagrangian lagrangian vanishes
modal.loci loci
modal.modal_form modal_form
modal.papers cart cart_dae planar residual spatial
modal.polynomial_roots roots
modal.polynomials equal_bobs of_scene
modal.reduction minimal
modal.response_figures bode_figure
modal.rig rig_of
modal.sensitivity sensitivities
modal.shapers over_length residual_vibration robustness shaper_for swings_of
modal.sliders slide
modal.statespace state_space
modal.symbolic chain
modal.tables table
modal.typeset plain typeset
modal.variations parsed
nonlinear Push State crossing load plant_of released resumed save simulate start_of turning
nonlinear.advice advised
nonlinear.animation animate
nonlinear.averaged averaged
nonlinear.branch_figures branches_figure
nonlinear.branches branches
nonlinear.check check
nonlinear.check_figures check_figure
nonlinear.ladder ladder
nonlinear.lines lines
nonlinear.lyapunov lyapunov_exponent
nonlinear.maximal Maximal
nonlinear.modal_coordinates modal_motion start_in_mode
nonlinear.phases phases_of
nonlinear.reactions reactions
nonlinear.simulation advise resumed
nonlinear.slow_motion settled
nonlinear.state State apart
nonlinear.sweep_files load
nonlinear.sweeps sweep
nonlinear.sync_figures sync_figure
nonlinear.synchrony synchrony theory_of
nonlinear.tradeoff tradeoff
nonlinear.tradeoff_figures tradeoff_figure
nonlinear.tradeoff_tables tradeoff_table
nonlinear.truncation truncated
"""
"""What the manual of version 0.1.0 imported, a module a line."""
PATHS = [(module, name) for module, *names in map(str.split, DOCUMENTED.strip().splitlines()) for name in names]


@pytest.mark.parametrize(("module", "name"), PATHS)
def test_what_the_first_version_imported_is_still_there(module: str, name: str) -> None:
    """Under its own name, or with a warning that names the new one."""
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        found = getattr(__import__(module, fromlist=[name]), name)
    for warning in heard:
        assert issubclass(warning.category, DeprecationWarning)
        home, _, new = str(warning.message).partition(" is ")[2].split(" now;")[0].rpartition(".")
        assert getattr(import_module(home), new) is found


def test_old_modules_lead_to_new_ones() -> None:
    for old, new in _compatibility._moved().items():
        assert find_spec(old), old
        assert import_module(new).__name__ == new


def test_renamed_things_are_there() -> None:
    for home, pairs in _compatibility.RENAMED.items():
        for old, new in (pair.split("=") for pair in pairs.split()):
            assert hasattr(import_module(home), new), (home, new)
            assert old not in vars(import_module(home)), (home, old)


def test_what_never_was_there_is_not() -> None:
    for module in ("modal", "nonlinear", "modal.scene", "modal.tables", "nonlinear.simulation"):
        with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
            import_module(module).nothing  # noqa: B018
    assert find_spec("modal.nothing") is None
    assert find_spec("nonlinear.nothing") is None


def test_work_precision_takes_candidates_by_their_old_name() -> None:
    with pytest.warns(DeprecationWarning, match=r"rungs=…\) is candidates=… now"):
        found = measure_work_precision(load("chain-1"), 0.1, rungs=[Candidate("minimal", "RK45", 1e-3)], patience=inf)  # type: ignore[call-arg]
    with pytest.warns(DeprecationWarning, match=r"Row\.rung is Row\.candidate now"):
        assert found.rows[1].rung is found.rows[1].candidate


def test_a_trajectory_has_a_system() -> None:
    run = simulate(load("chain-1"), 0.1)
    with pytest.warns(DeprecationWarning, match=r"Trajectory\.plant is Trajectory\.system now"):
        assert run.plant is run.system
