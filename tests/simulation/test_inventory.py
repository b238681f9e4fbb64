"""Only what a scene requires: coordinates, matrices and packages of a run, counted from outside."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from modal import Bob, Cart, Fixed, Pendulum, Scene, natural_modes
from modal.errors import ComputationError
from modal.scene.files import example_text
from multipendula.cli import main
from nonlinear import AppliedForces, simulate, state_at_rest
from nonlinear import files as recordings
from nonlinear.integration import Trajectory
from nonlinear.postprocessing import run_inventory
from nonlinear.reduction import simulate_truncated, start_in_mode
from nonlinear.simulation import advise


def scene_of(
    *, cart: bool = False, space: str = "plane", links: int = 2, pendula: int = 1, damping: float = 0.0
) -> Scene:
    chain = tuple(Bob(mass=1.0, length=1.0, damping=damping) for _ in range(links))
    support = Cart(mass=20.0) if cart else Fixed()
    hung = [Pendulum(links=(*chain[:-1], Bob(mass=1.0 + at, length=1.0))) for at in range(pendula)]
    return Scene(gravity=9.81, space=space, support=support, pendulum=hung)


def run_of(scene: Scene, **how: object) -> Trajectory:
    angles = np.linspace(10, 40, scene.n_links)
    return simulate(scene, 0.3, start=state_at_rest(scene, list(angles)), output=5, **how)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("how", "coordinates", "integrated", "numbers"),
    [
        ({}, 2, 2, 4),
        ({"cart": True}, 3, 3, 6),
        ({"damping": 0.1}, 2, 2, 5),
        ({"cart": True, "pendula": 3}, 7, 7, 14),
        ({"space": "space"}, 4, 2, 4),
        ({"space": "space", "cart": True}, 5, 3, 6),
    ],
)
def test_degrees_of_freedom(how: dict[str, object], coordinates: int, integrated: int, numbers: int) -> None:
    trajectory = run_of(scene_of(**how))  # type: ignore[arg-type]
    inventory = run_inventory(trajectory)
    assert (inventory.coordinates, inventory.integrated, inventory.numbers) == (coordinates, integrated, numbers)
    assert trajectory.equations is not None
    assert len(trajectory.equations.begin(trajectory.final)) == numbers
    assert ("no cart coordinate: the support is fixed" in inventory.left_out) == (trajectory.system.cart is None)
    assert ("no work: nothing damps or drives" in inventory.left_out) == (not how.get("damping"))


@pytest.mark.parametrize(
    ("links", "pendula", "form", "expected"),
    [
        (2, 2, "auto", {}),
        (2, 2, "driven", {}),
        (2, 50, "auto", {}),
        (101, 1, "auto", {}),
        (2, 1, "maximal", {(13, 13): 1}),
    ],
)
def test_matrices_are_those_that_are_really_solved(
    links: int, pendula: int, form: str, expected: dict[tuple[int, ...], int], monkeypatch: pytest.MonkeyPatch
) -> None:
    solved: Counter[tuple[int, ...]] = Counter()

    def counted(solve: Callable[..., Any]) -> Callable[..., Any]:
        def solving(matrix: np.ndarray, right: np.ndarray, **how: Any) -> Any:
            solved[matrix.shape] += 1
            return solve(matrix, right, **how)

        return solving

    scene = scene_of(cart=True, links=links, pendula=pendula)
    monkeypatch.setattr(np.linalg, "solve", counted(np.linalg.solve))
    how = {"load": lambda time, state: AppliedForces()} if form == "driven" else {"form": form}
    inventory = run_inventory(run_of(scene, **how))
    assert set(solved) == set(expected)
    assert sorted(matrix[0] for matrix in inventory.matrices) == sorted(shape[-1] for shape in expected)
    assert sum(number for _, number in inventory.matrices) == sum(
        shape[0] if len(shape) == 3 else 1 for shape in expected
    )
    if not expected:
        how_instead = "O(n) steps along the chains" if links > 2 else "the equations are written out"
        size = links * pendula + 1
        assert f"no matrix of {size} × {size}: {how_instead}" in inventory.left_out


def test_equal_pendula_few_modes_and_closed_forms_leave_out_the_rest() -> None:
    pendulum = Pendulum(links=(Bob(mass=1.0, length=1.0),), count=1000)
    scene = Scene(gravity=9.81, support=Cart(mass=100.0), pendulum=(pendulum,))
    inventory = run_inventory(simulate(scene, 1.0, start=state_at_rest(scene, [20.0]), output=3))
    assert (inventory.coordinates, inventory.integrated, inventory.numbers) == (1001, 2, 4)
    assert "all but 1 of 1000 pendula, the others moving with them" in inventory.left_out
    chain = scene_of(links=12)
    modes = natural_modes(chain)
    start = start_in_mode(chain, modes, 0, 0, 0.05)
    few = run_inventory(simulate_truncated(chain, 1.0, 3, start=start).trajectory)
    assert (few.coordinates, few.integrated, few.matrices) == (12, 3, ((3, 1),))
    none = run_inventory(advise(chain, 1.0, 1e-2, start=start).trajectory)
    assert (none.coordinates, none.integrated, none.numbers) == (12, 0, 0)


def test_a_saved_run_does_not_tell(tmp_path) -> None:  # type: ignore[no-untyped-def]
    recordings.save(run_of(scene_of()), tmp_path / "run.npz")
    with pytest.raises(ComputationError, match="not saved with it"):
        run_inventory(recordings.load(tmp_path / "run.npz"))


def test_a_driven_run_counts_its_work() -> None:
    inventory = run_inventory(run_of(scene_of(), load=lambda time, state: AppliedForces()))
    assert inventory.numbers == 5
    assert not any("work" in sentence for sentence in inventory.left_out)


def test_packages_are_those_of_the_process() -> None:
    code = (
        "import json, sys\n"
        "from modal import load\n"
        "from nonlinear import simulate\n"
        "from nonlinear.postprocessing import run_inventory\n"
        "found = run_inventory(simulate(load('chain-3'), 1.0))\n"
        "print(json.dumps([found.record(), sorted(name for name in sys.modules if '.' not in name)]))\n"
    )
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    record, names = json.loads(shown.stdout)
    assert record["modules"] == ["numpy", "scipy"]
    assert not {"sympy", "control", "matplotlib", "numba", "heyoka", "flint"} & set(names)


def test_the_commands(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["simulate", "chain-3", "--duration", "1", "--explain"]) == 0
    told = capsys.readouterr()
    assert told.err.startswith("Integrated: 3 coordinates, 6 numbers, for a scene of 3 coordinates")
    assert "Integrated" not in told.out
    assert main(["table", "chain-3", "--explain"]) == 0
    assert capsys.readouterr().err.startswith("Built: 3 unknowns for a scene of 3 coordinates")
    (short := tmp_path / "rope.toml").write_text(example_text("rope").replace("count = 1000", "count = 100"))
    words = ["--start", "mode:1:1", "--duration", "1", "--keep-modes", "4", "--explain"]
    assert main(["simulate", str(short), *words]) == 0
    told = capsys.readouterr()
    assert "a few mode shapes" in told.out
    assert "no angle is off by more than" in told.out
    assert "4×4" in told.err
    assert main(["simulate", "chain-3", "--keep-modes", "2", "--form", "maximal", "--accuracy", "0.1"]) == 2
    assert re.search(r"--form: .*--keep-modes", capsys.readouterr().err)


def test_an_implicit_integrator_has_a_matrix_and_series_have_none() -> None:
    assert run_inventory(run_of(scene_of(links=40), method="Radau")).matrices[0] == (80, 1)
    pytest.importorskip("heyoka")
    assert run_inventory(run_of(scene_of(), method="taylor")).matrices == ()
