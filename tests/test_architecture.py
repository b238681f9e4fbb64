"""The house: imports run downhill, heavy packages stay out of the main job."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PACKAGES = ("modal", "nonlinear", "multipendula")
MAP = re.findall(r"^\| `([\w.]+)` \|", (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8"), flags=re.MULTILINE)
SYMPY = "lagrange lagrangian kinetic symbolic polynomial_roots eigen_polynomials eigen_sections derivation typeset"
SYMPY += " papers papers.cart"
SYMPY += " papers.cart_dae papers.planar papers.spatial papers.spatial_azimuth"
HEAVY = {
    "matplotlib": {
        "modal.plotting.palette",
        "modal.plotting.style",
        "modal.plotting.layout",
        "modal.plotting.sliders",
        "modal.plotting.shapes",
        "modal.plotting.response",
    }
    | {f"modal.{name}" for name in ("mass_figures", "cart_mass_figures", "coupling_figures", "loci_figures")}
    | {
        f"nonlinear.{name}"
        for name in ("figures", "check_figures", "chaos_figures", "sweep_figures", "sync_figures", "tradeoff_figures")
    }
    | {"nonlinear.plotting.branches"}
    | {f"nonlinear.{name}" for name in ("scenery", "gauges", "film")}
    | {"nonlinear.plotting.animation"},
    "scipy": {"modal.statespace.sampling", "modal.exports.mat", "modal.exports.scipy_"}
    | {
        f"nonlinear.{name}"
        for name in ("banded", "escapements", "integrate", "lyapunov", "saddle", "slow_motion", "spectra", "steppers")
    },
    "sympy": {f"modal.{name}" for name in SYMPY.split()},
    "control": {"modal.exports.control_"},
    "flint": {"modal.exact.balls"},
    "numba": {"nonlinear.dynamics.compiled"},
    "heyoka": {"nonlinear.integration.taylor"},
    "distributed": {"nonlinear.sweeps.cluster"},
}


def module_name(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


@cache
def sources() -> dict[str, Path]:
    return {module_name(path): path for package in PACKAGES for path in (ROOT / package).rglob("*.py")}


@cache
def imports(path: Path) -> set[str]:
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {name.name for name in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            known = sources()
            full = {f"{node.module}.{name.name}" for name in node.names}
            found |= {name if name in known else node.module for name in full}
    return found


def upward(order: list[str], imported: dict[str, set[str]]) -> set[tuple[str, str]]:
    """Imports of a module that the map does not name earlier."""
    return {
        (name, target)
        for place, name in enumerate(order)
        for target in imported[name] & imported.keys()
        if target not in order[:place]
    }


def test_the_map_names_every_module() -> None:
    assert sorted(MAP) == sorted(sources())


def test_imports_run_downhill() -> None:
    """Which also excludes circles."""
    assert upward(MAP, {name: imports(path) - {name} for name, path in sources().items()}) == set()


def test_nobody_imports_the_command_and_modal_nothing_of_nonlinear() -> None:
    for name, path in sources().items():
        package = name.partition(".")[0]
        used = {target.partition(".")[0] for target in imports(path)} & set(PACKAGES)
        assert used <= set(PACKAGES[: PACKAGES.index(package) + 1]), name


def test_the_check_of_imports_bites(tmp_path: Path) -> None:
    assert upward(["a", "b"], {"a": {"b"}, "b": {"numpy"}}) == {("a", "b")}
    assert upward(["a", "b"], {"a": {"b"}, "b": {"a"}}) == {("a", "b")}
    (tmp_path / "a.py").write_text("def f():\n    import matplotlib.pyplot\n")
    assert imports(tmp_path / "a.py") == {"matplotlib.pyplot"}


@pytest.mark.parametrize("name", sources())
def test_one_module_for_each_heavy_import(name: str) -> None:
    used = {target.partition(".")[0] for target in imports(sources()[name])}
    assert {heavy for heavy in HEAVY if heavy in used and name not in HEAVY[heavy]} == set()


@pytest.mark.parametrize("job", ["import modal", "import modal; list(modal.natural_modes(modal.load('paper-cart-2')))"])
def test_the_main_job_loads_no_heavy_package(job: str) -> None:
    code = f"import sys; {job}; print(sorted({{name.partition('.')[0] for name in sys.modules}}))"
    loaded = ast.literal_eval(
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    )
    assert HEAVY.keys() & set(loaded) == set()
    assert "numpy" in loaded


OPTION = re.compile(r"(?<![\w-])--[a-z]|(?<![\w-])-[a-z] |--?[a-z]+ FILE")


def spoken(source: str) -> list[str]:
    """All text in a module that is no docstring."""
    tree = ast.parse(source)
    homes = (ast.Module, ast.ClassDef, ast.FunctionDef)
    told = {
        id(node.body[0].value) for node in ast.walk(tree) if isinstance(node, homes) and hasattr(node.body[0], "value")
    }
    texts = (node for node in ast.walk(tree) if isinstance(node, ast.Constant) and id(node) not in told)
    return [node.value for node in texts if isinstance(node.value, str)]


@pytest.mark.parametrize("name", [name for name in sources() if not name.startswith("multipendula")])
def test_the_packages_know_no_option_of_the_command(name: str) -> None:
    assert [text for text in spoken(sources()[name].read_text(encoding="utf-8")) if OPTION.search(text)] == []


def test_the_search_for_options_bites() -> None:
    source = '"""About --modes."""\nraise ValueError(f"--to {name}: no", "write -o FILE", "a - b, -1, well-made, a--b")'
    assert [text for text in spoken(source) if OPTION.search(text)] == ["write -o FILE", "--to "]
