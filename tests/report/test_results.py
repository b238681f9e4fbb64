"""Results of every public function, small ones made here: what they show, their columns and their figures."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from copy import copy, deepcopy
from functools import cache
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from shown import assert_shown

import modal
from modal.assembly import matrices
from modal.coupling import explain
from modal.errors import ComputationError
from modal.identification import identify
from modal.loci import follow_loci
from modal.modes import mode_energies, natural_modes
from modal.modes.sensitivity import sensitivities
from modal.scene.parameters import parse_variations
from modal.statespace import modal_gains, state_space, to_modal_form
from modal.statespace.reduction import balance
from modal.statespace.sampling import sample
from modal.statespace.shapers import shaper_for
from modal.statespace.transfer import transfer_functions
from nonlinear import ensemble, simulate
from nonlinear.averaging import average
from nonlinear.chaos import lyapunov_exponent
from nonlinear.ensembles import find_basins, find_section
from nonlinear.identification import Recording, Segment, Sensor, fit
from nonlinear.orbits import nonlinear_mode
from nonlinear.sweeps import Study, find_spread, parse_measures, sweep
from nonlinear.synchronization import phases_of
from nonlinear.verification import check


@cache
def run_of() -> Any:
    return simulate(modal.load("chain-1"), 6.0, output=301)


def recording() -> Recording:
    run = run_of()
    return Recording((Sensor(1, 1),), (Segment("swing.csv", "", run.times, run.motion.links),))


def decay() -> Any:
    times = np.arange(0, 20, 0.02)
    values = np.exp(-0.05 * times) * np.cos(3.0 * times)
    return identify([(times, values[:, None])], ["theta"])


def small_sweep() -> Any:
    axis = parse_variations(["gravity=9:10:13"])
    return sweep(Study(modal.load("chain-2"), axis, parse_measures(["frequencies"])), workers=1)


def crane() -> Any:
    return natural_modes(modal.load("crane-hook"))


def form() -> Any:
    return to_modal_form(crane(), state_space(modal.load("crane-hook")))


RESULTS: dict[str, Callable[[], Any]] = {
    "coupling": lambda: explain(modal.load("paper-cart-2")),
    "sensitivities": lambda: sensitivities(crane(), 2),
    "energies": lambda: mode_energies(crane()),
    "matrices": lambda: matrices(modal.load("paper-cart-3")),
    "state space": lambda: state_space(modal.load("crane-hook")),
    "modal form": form,
    "gains": lambda: modal_gains(crane(), state_space(modal.load("crane-hook"))),
    "transfer function": lambda: transfer_functions(form())[0][0],
    "reduced": lambda: balance(state_space(modal.load("clocks-double"), outputs=("angles",)), 4),
    "shaper": lambda: shaper_for(modal.load("crane-hook")),
    "loci": lambda: follow_loci(
        modal.load("crane-two-loads"), parse_variations(["pendulum[0].links[0].length=5:20:5"])[0]
    ),
    "run": run_of,
    "motion": lambda: run_of().motion,
    "state": lambda: run_of().final,
    "how": lambda: run_of().run,
    "mechanics": lambda: run_of().mechanics,
    "ensemble": lambda: ensemble(modal.load("chain-1"), 0.5, vary={"gravity": [9.8, 1.6]}, engine="numpy", workers=1),
    "basins": lambda: find_basins(
        modal.load("chain-2"),
        0.5,
        vary=[f"pendulum[0].start.angles_deg[{k}]=-90:90:4" for k in (0, 1)],
        engine="numpy",
        workers=1,
        check=0,
    ),
    "section": lambda: find_section(modal.load("chain-2"), 5.0, members=2, engine="numpy", workers=1, check=0),
    "spread": lambda: find_spread(modal.load("chain-2"), ["gravity=0.1"], members=50),
    "branch": lambda: nonlinear_mode(modal.load("chain-2"), 1, 0.3),
    "identified": decay,
    "sweep": small_sweep,
    "check": lambda: check(modal.load("chain-1"), [0], [1.0, 5.0], periods=20),
    "averaged": lambda: average(modal.load("huygens")),
    "phases": lambda: phases_of(run_of()),
}


PLAIN = {"mechanics"}
"""Results that are shown by their fields alone."""


@pytest.mark.parametrize("name", RESULTS)
def test_a_result_shows_itself(name: str) -> None:
    shown = RESULTS[name]()
    assert_shown(shown)
    assert not repr(shown).startswith(f"{type(shown).__name__}\n") or name in PLAIN
    if hasattr(shown, "to_dict") and name != "state space":
        columns = shown.to_dict()
        assert len(columns) > 0
        assert len({len(values) for values in columns.values()}) == 1
    if hasattr(shown, "plot"):
        assert isinstance(shown.plot(), Figure)


@pytest.mark.parametrize("name", RESULTS)
def test_a_result_can_be_copied_and_pickled(name: str) -> None:
    original = RESULTS[name]()
    for other in (copy(original), deepcopy(original), pickle.loads(pickle.dumps(original))):
        assert type(other) is type(original)
        assert repr(other) == repr(original)


@pytest.mark.parametrize(
    "name", ["rope", "crane-hook", "paper-cart-2", "crane-two-loads", "cart-upright", "chain-spatial"]
)
def test_modes_can_be_pickled(name: str) -> None:
    modes = natural_modes(modal.load(name), modes=slice(0, 4))
    same = pickle.loads(pickle.dumps(modes))
    assert same.table("csv") == modes.table("csv")


def test_a_pickled_run_leaves_its_equations() -> None:
    run = run_of()
    assert copy(run).equations is run.equations is not None
    same = pickle.loads(pickle.dumps(run))
    assert same.equations is None
    np.testing.assert_array_equal(same.motion.links, run.motion.links)


def test_a_fit_shows_its_numbers() -> None:
    fitted = fit(modal.load("chain-1"), recording(), ["gravity"])
    assert_shown(fitted, "gravity", "m/s²")
    columns = fitted.to_dict()
    assert columns["number"].tolist() == ["gravity"]
    assert columns["fitted"][0] == fitted.values[0] == pytest.approx(9.81, rel=1e-6)
    assert columns["std"][0] == fitted.stds[0]
    assert isinstance(fitted.plot(), Figure)


def test_an_exponent_shows_itself() -> None:
    exponent = lyapunov_exponent(modal.load("chain-2"), duration=20.0, members=2)
    assert_shown(exponent)


def test_a_model_without_its_scene_is_not_drawn() -> None:
    whole = state_space(modal.load("crane-hook"))
    with pytest.raises(ComputationError, match="whole model"):
        sample(whole, 0.1).plot()
    assert whole.to_dict()["inputs"] == ["cart_force"]


def test_columns_of_a_sweep_are_its_points() -> None:
    swept = small_sweep()
    columns = swept.to_dict()
    for row in swept.rows:
        assert columns["gravity_m_per_s2"][row.index] == swept.study.point(row.index)["gravity"]
        assert all(columns[name][row.index] == value for name, value in row.numbers.items())
    assert repr(swept).startswith("13 of 13 points, 0 failed\n  quantity")


def test_columns_of_a_branch_are_its_orbits() -> None:
    branch = nonlinear_mode(modal.load("chain-1"), 1, 0.5)
    columns = branch.to_dict()
    for k, orbit in enumerate(branch.orbits):
        assert columns["omega_rad_per_s"][k] == pytest.approx(2 * np.pi / orbit.period)
        assert columns["largest_angle_deg"][k] == pytest.approx(np.degrees(orbit.amplitude))
    assert repr(branch.orbits[0]).startswith('Periodic orbit of "A single bob')


def test_columns_of_basins_are_the_map() -> None:
    basins = RESULTS["basins"]()
    columns = basins.to_dict()
    y, x = basins.axes
    for i, value in enumerate(y.values):
        for j, other in enumerate(x.values):
            row = (columns[y.column] == value) & (columns[x.column] == other)
            np.testing.assert_array_equal(columns[basins.column][row], basins.values[i, j])


def test_columns_of_members_are_what_was_varied() -> None:
    runs = ensemble(modal.load("chain-1"), 0.2, vary=["gravity=9:10:3"], engine="numpy", workers=1, check=0)
    assert runs.to_dict()["gravity"].tolist() == [9.0, 9.5, 10.0]
    assert "varied gravity" in repr(runs)
