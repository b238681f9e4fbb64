"""Basins, sections and spreads, against formulas, individual runs and the prediction of synchronization."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from io import StringIO
from itertools import product
from pathlib import Path
from re import escape
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from amounts import usually
from seen import flaws

from modal import load
from modal.errors import SceneError
from modal.loci import follow_loci, loci_text
from modal.modes import natural_modes
from modal.scene import Bob, Cart, Pendulum, Scene, VanDerPol
from modal.scene.parameters import parse_variations, vary
from nonlinear import State, simulate
from nonlinear.chaos import lyapunov_exponent
from nonlinear.ensembles import (
    basins_table,
    find_basins,
    find_section,
    grid_of,
    section_table,
)
from nonlinear.ensembles.basins import _named
from nonlinear.ensembles.endings import EndingGroup
from nonlinear.ensembles.rhythm_borders import name_of
from nonlinear.ensembles.rhythm_maps import MapTask
from nonlinear.reduction import usual_start
from nonlinear.sweeps import Study, find_spread, parse_measures, spread_table, sweep, sweep_text
from nonlinear.sweeps.spread import Tolerance
from nonlinear.synchronization import Ending, study_synchronization
from nonlinear.synchronization.study import theory_of_scene, usual_duration
from nonlinear.system import motion_of

CLOCKS = [f"pendulum[{p}].start.angles_deg[0]=-30:30:3" for p in range(2)]
GRID = ["pendulum[0].start.angles_deg[0]=-170:170:8", "pendulum[0].start.angles_deg[1]=-170:170:8"]


def test_the_map_of_first_turns_has_its_symmetry_and_agrees_with_runs() -> None:
    """Mirror images turn over at the same time; a start that cannot reach the top by its energy never does."""
    basins = find_basins(load("chain-2"), 3.0, vary=GRID, workers=1)
    assert basins.column == "first_turn_s"
    np.testing.assert_allclose(basins.values, basins.values[::-1, ::-1], atol=1e-6)
    angles = np.radians(np.linspace(-170, 170, 8))
    upper, two = np.meshgrid(angles, angles, indexing="ij")
    energy = 2 * (1 - np.cos(upper)) + (1 - np.cos(two))
    assert np.all(np.isinf(basins.values[energy < 2]))
    shares = basins.shares()
    assert sum(shares.values()) == pytest.approx(1.0)
    assert shares["a link turns over"] == np.mean(np.isfinite(basins.values))
    record = json.loads(basins_table(basins, "json"))
    assert np.array(record["first_turn_s"], dtype=object).shape == (8, 8)
    rows = [*csv.reader(StringIO(basins_table(basins, "csv")))]
    assert len(rows) == 65
    assert float(rows[1 + 8 * 3 + 5][2]) == basins.values[3, 5]


def test_basins_of_two_clocks_are_those_that_sync_finds() -> None:
    """Van der Pol clocks on a beam with a damper: where each of four starts ends is what `sync` sees of it."""
    links = (Bob(mass=1.0, length=1.0, drive=VanDerPol(strength=0.2, angle_deg=5.0)),)
    scene = Scene(gravity=9.81, support=Cart(mass=20.0, damping=2.0), pendulum=[Pendulum(links=links)] * 2)
    grid = [f"pendulum[{p}].start.angles_deg[0]=-12,9" for p in range(2)]
    basins = find_basins(scene, vary=grid, workers=1)
    assert basins.column == "attractor"
    for i, angle in enumerate((-12, 9)):
        for j, other in enumerate((-12, 9)):
            start = State(np.radians([angle, other]), np.zeros(2))
            study = study_synchronization(scene, 250.0, start=start)
            order = study.phases.order[-50:, 0].mean()
            assert basins.names[int(basins.values[i, j])] == ("in phase" if order > 0.9 else "antiphase")
            assert order > 0.9 or order < 0.1
    assert sum(basins.shares().values()) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("scene", "angles", "limit", "names"),
    [
        (load("huygens"), (-30, 20), 400.0, {"antiphase", "at rest"}),
        (vary(load("metronomes"), {"support.mass": 0.06}), (-60, 40), 300.0, {"in phase", "beat"}),
    ],
)
def test_starts_end_where_a_map_of_rhythms_sees_them_end(
    scene: Scene, angles: tuple[float, ...], limit: float, names: set[str]
) -> None:
    """The same starts by both, in the same rhythms; a clock that dies is at rest, as a run of it alone shows."""
    grid = [f"pendulum[{p}].start.angles_deg[0]={','.join(map(str, angles))}" for p in range(2)]
    basins = find_basins(scene, limit, vary=grid, engine="numpy", workers=1, check=0)
    assert {group.name for group in basins.attractors} == names
    starts = [State(np.radians(pair), np.zeros(2)) for pair in product(angles, angles)]
    (number,) = parse_variations(["support.mass=0.01:100:2"])
    groups = MapTask(scene, number, motion_of(starts), limit, "numpy")(scene.supports[0].mass)
    assert [(name_of(group), sorted(group.members)) for group in groups] == [
        (group.name, sorted(group.members)) for group in basins.attractors
    ]
    record = json.loads(basins_table(basins, "json"))
    assert [entry["name"] for entry in record["attractors"]] == [*basins.names[1:]]
    assert (record["duration_s"], sum(basins.shares().values())) == (limit, pytest.approx(1.0))
    dead = dict.fromkeys(k for group in groups if group.name == "at rest" for k in group.members)
    for k in [*dead][:1]:
        run = simulate(scene, 300.0, start=starts[k], output=301)
        swings = [np.abs(np.degrees(run.motion.links[part])).max() for part in (slice(100, 200), slice(200, 300))]
        assert swings[1] < swings[0] < 3.0


def test_crossings_of_a_section_have_its_energy() -> None:
    scene = load("chain-2")
    section = find_section(scene, 8.0, energy=12.0, members=5, workers=1)
    links, rates = (section.ensemble.column(f"crossing_{name}") for name in ("links_rad", "link_rates_rad_per_s"))
    np.testing.assert_allclose(np.sin(links[:, 0]), 0.0, atol=1e-7)
    assert np.all(rates[:, 0] > 0)
    speed = rates[:, 0] ** 2 + rates[:, 1] ** 2 / 2 + rates.prod(axis=1) * np.cos(links[:, 0] - links[:, 1])
    potential = 9.81 * (2 * (1 - np.cos(links[:, 0])) + 1 - np.cos(links[:, 1]))
    np.testing.assert_allclose(speed + potential, 12.0, rtol=1e-7)
    assert len(csv.DictReader(StringIO(section_table(section, "csv"))).fieldnames or ()) == 8
    assert len(json.loads(section_table(section, "json"))["crossings"]) == len(links)


def test_a_section_downwards_has_other_crossings() -> None:
    scene = load("chain-2")
    ways = {
        way: find_section(scene, 6.0, energy=8.0, crossing=f"theta[1,2]{way}0", members=3, workers=1, check=0)
        for way in "<>="
    }
    for way, sign in (("<", -1), (">", 1)):
        assert np.all(sign * ways[way].ensemble.column("crossing_link_rates_rad_per_s")[:, 1] >= 0)
    both = ways["="].ensemble.column("crossing_link_rates_rad_per_s")[:, 1]
    assert (both > 0).any()
    assert (both < 0).any()


def test_the_spread_of_a_simple_pendulum_is_that_of_the_formula() -> None:
    """ω = √(g/l): (σ_ω/ω)² = ¼ ((σ_g/g)² + (σ_l/l)²), and each share in proportion."""
    scene = Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=2.0)])])
    texts = ["gravity=1%", "pendulum[0].links[0].length=0.04", "pendulum[0].links[0].mass=0.9:1.1"]
    spread = find_spread(scene, texts, members=5_000)
    mass = "pendulum[0].links[0].mass from 0.9 to 1.1 kg"
    assert spread.words == f"gravity = 9.81 ± 0.0981 m/s², pendulum[0].links[0].length = 2 ± 0.04 m, {mass}"
    (record,) = spread.frequencies
    expected = 0.5 * np.hypot(0.01, 0.02) * np.sqrt(9.81 / 2)
    assert record["standard_deviation_rad_per_s"] == pytest.approx(expected, rel=0.03)
    shares = record["shares"]
    assert shares["gravity"] == pytest.approx(0.2, abs=0.02)
    assert shares["pendulum[0].links[0].length"] == pytest.approx(0.8, abs=0.02)
    assert shares["pendulum[0].links[0].mass"] < 0.001
    assert record["matters_most"] == "pendulum[0].links[0].length"
    normal = np.array([record[f"q{q}_rad_per_s"] for q in ("05", "50", "95")])
    np.testing.assert_allclose(normal, np.sqrt(9.81 / 2) + expected * np.array([-1.645, 0, 1.645]), rtol=2e-3)


def test_bands_of_motion_are_quantiles_of_runs() -> None:
    scene = load("paper-cart-1")
    spread = find_spread(scene, ["support.mass=80:120"], 1.0, members=9, workers=1)
    masses = spread.values["support.mass"]
    angles = []
    for mass in masses:
        run = simulate(scene.replace(support=scene.support.replace(mass=float(mass))), 1.0, output=201)
        angles.append(np.degrees(run.motion.links))
    np.testing.assert_allclose(spread.bands, np.quantile(angles, (0.05, 0.5, 0.95), axis=0), atol=1e-6)
    rows = [*csv.DictReader(StringIO(spread_table(spread, "csv")))]
    for row, angle in zip(rows, angles, strict=True):
        assert float(row["theta_1_1_at_0.25_s_deg"]) == pytest.approx(angle[50, 0], abs=1e-6)
        assert float(row["theta_1_1_at_1_s_deg"]) == pytest.approx(angle[-1, 0], abs=1e-6)
    assert json.loads(spread_table(spread, "json"))["motion"]["time_s"][-1] == 1.0


def test_tolerances_have_the_units_of_what_carries_them() -> None:
    """A spring between points, a floor and a board: N/m, kg and N m/rad."""
    told = {
        ("two-bobs", "spring[0].stiffness"): "N/m",
        ("tower", "support.floor1.mass"): "kg",
        ("beam", "support.stiffness"): "N m/rad",
        ("beam", "pendulum[0].links[0].stiffness"): "N m/rad",
    }
    for (name, path), unit in told.items():
        scene = load(name)
        assert Tolerance(path, sigma=0.5).around(scene).endswith(f" ± 0.5 {unit}")
        assert Tolerance(path, low=0.5, high=1.0).around(scene).endswith(f" to 1 {unit}")


@pytest.mark.parametrize(
    ("texts", "words"),
    [
        ([], "needs a tolerance"),
        (["gravity"], "must be PLACE="),
        (["gravity=-1"], "must be above 0"),
        (["gravity=2:1"], "from a smaller"),
        (["gravity=x"], "is not a number"),
        (["mass=1"], "is not a number of this scene"),
        (["gravity=1", "gravity=2"], "has two tolerances"),
        (["pendulum[0].count=1"], "has no tolerance"),
    ],
)
def test_what_is_no_tolerance_is_told(texts: list[str], words: str) -> None:
    with pytest.raises(SceneError, match=words):
        find_spread(load("chain-2"), texts)


@pytest.mark.parametrize("number", [-1, 1.5, np.nan, "2", None, True])
def test_numbers_of_a_study_that_are_none_are_named(number: object) -> None:
    chain: Any = load("chain-2")
    calls: dict[str, Callable[[Any], object]] = {
        "spread": lambda n: find_spread(chain, ["gravity=1%"], members=n),
        "seed": lambda n: find_spread(chain, ["gravity=1%"], members=3, seed=n),
        "section": lambda n: find_section(chain, 1.0, members=n),
        "exponent": lambda n: lyapunov_exponent(chain, 30.0, members=n),
    }
    for verb, call in calls.items():
        name = "seed" if verb == "seed" else "members"
        with pytest.raises(SceneError, match=escape(f"{name} {number!r}: must be a whole number")):
            call(number)


def test_studies_that_cannot_be_are_told() -> None:
    with pytest.raises(SceneError, match="that of links that all hang"):
        find_section(load("chain-2"), energy=-1.0)
    with pytest.raises(SceneError, match=escape("crossing theta[1,9]: must be COORDINATE=VALUE")):
        find_section(load("chain-2"), crossing="theta[1,9]")
    with pytest.raises(SceneError, match="remove the dampers"):
        find_section(load("metronomes"), energy=1.0)
    with pytest.raises(SceneError, match="a map has two axes"):
        find_basins(load("chain-2"), vary=GRID[:1])
    with pytest.raises(SceneError, match="must be one of"):
        find_basins(load("chain-2"), vary=GRID, measure="colour")


@pytest.mark.parametrize("name", usually(["dark"], ["light", "dark"]))
def test_nothing_is_wrong_with_pictures(name: str) -> None:
    from modal.plotting.style import theme
    from nonlinear.plotting import basins_figure, section_figure, spread_figure

    with theme(name):
        figures = [
            basins_figure(find_basins(load("chain-2"), 2.0, vary=GRID, workers=1, check=0)),
            basins_figure(find_basins(load("metronomes"), 1.0, vary=CLOCKS, workers=1, check=0)),
            section_figure(find_section(load("chain-2"), 4.0, energy=12.0, members=3, workers=1, check=0)),
            spread_figure(find_spread(load("paper-cart-1"), ["gravity=1%"], 0.5, members=20, workers=1, check=0)),
        ]
    for figure in figures:
        assert flaws(figure) == []


def test_bands_in_space_are_of_angles_from_the_vertical() -> None:
    """A start in the plane of the rail: the same sizes as in the plane."""
    flat = load("chain-2")
    spreads = [find_spread(example, ["gravity=1%"], 0.5, members=6) for example in (flat, flat.replace(space="space"))]
    assert spreads[1].bands[1] == pytest.approx(np.abs(spreads[0].bands[1]), abs=1e-4)
    assert "widest" in spread_table(spreads[1], "text")


METRONOMES = vary(load("metronomes"), {"support.mass": 0.12})
UNSTARTED = METRONOMES.replace(pendulum=tuple(pendulum.replace(start=None) for pendulum in METRONOMES.pendulum))


def test_starts_of_a_scene_without_one_run_as_long_as_sync_needs() -> None:
    """Not as long as at rest, where nothing begins."""
    grid = ["pendulum[0].start.angles_deg[0]=5,20", "pendulum[1].start.angles_deg[0]=10,15"]
    basins = find_basins(UNSTARTED, vary=grid, measure="order", workers=1)
    theory = theory_of_scene(UNSTARTED, usual_start(UNSTARTED))
    assert basins.ensemble.question.duration == usual_duration(UNSTARTED, theory)
    assert np.all(basins.values > 0.999)
    assert f"each simulated for {basins.ensemble.question.duration:.4g} s\n" in basins_table(basins, "text")


def test_members_without_a_start_begin_in_a_mode() -> None:
    """Where no start is varied either: at rest nothing would move."""
    grid = ["support.mass=0.1,0.2", "gravity=9.8,9.9"]
    basins = find_basins(UNSTARTED, 1.0, vary=grid, measure="largest_angle", workers=1)
    begun = basins.ensemble.question.members.states
    assert begun is not None
    assert np.degrees(np.abs(begun.links)).max(axis=1) == pytest.approx(5.0)
    assert np.all(basins.values > 4.9)
    with pytest.raises(SceneError, match="gravity: changes the attractors themselves"):
        find_basins(UNSTARTED, 0.5, vary=grid, workers=1)


def test_rounds_go_on_where_calls_and_shares_stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The rounds of two that know nothing of each other, each as far as both are; combined, nothing runs again."""
    options = {"vary": [f"pendulum[{p}].start.angles_deg[0]=-3,20" for p in range(2)], "engine": "numpy", "check": 0}
    alone = find_basins(METRONOMES, 110.0, workers=1, **options)  # type: ignore[arg-type]
    folder = str(tmp_path / "rounds")
    for share in ((0, 2), (1, 2), (0, 2), (1, 2)):
        find_basins(METRONOMES, 110.0, workers=1, chunk=2, folder=folder, share=share, **options)  # type: ignore[arg-type]
    assert sorted(path.name for path in (tmp_path / "rounds").iterdir()) == [
        "ensemble.json", "part-000000.npz", "part-000001.npz", "round-2"
    ]  # fmt: skip
    monkeypatch.setattr("nonlinear.ensembles.running.compute", lambda *_: pytest.fail("computed again"))
    shown = list[float]()
    together = find_basins(METRONOMES, 110.0, workers=1, chunk=2, folder=folder, report=shown.append, **options)  # type: ignore[arg-type]
    assert together.report("csv") == alone.report("csv")
    assert shown == sorted(shown)


def test_runs_too_short_for_a_passage_are_undecided() -> None:
    grid = [f"pendulum[{p}].start.angles_deg[0]=-3,20" for p in range(2)]
    basins = find_basins(METRONOMES, 1e-6, vary=grid, workers=1, engine="numpy", check=0)
    assert (basins.names, basins.values.tolist()) == (("undecided",), [[0.0, 0.0], [0.0, 0.0]])


def test_attractors_of_one_name_are_told_by_their_angles(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("nonlinear.ensembles.basins.name_of", lambda group: group.name)
    ending = Ending("periodic", 1.0, np.zeros((0, 0)), State(np.zeros(2), np.zeros(2)))
    groups = [
        EndingGroup(name, (k,), ending, beginning=SimpleNamespace(orbit=SimpleNamespace(amplitude=0.1 * k)))  # type: ignore[arg-type]
        for k, name in enumerate(["in phase", "antiphase", "in phase"])
    ]
    assert [group.name for group in _named(groups)] == ["in phase, 0°", "antiphase", "in phase, 11.459°"]


def test_the_usual_grid_is_fine_where_members_go_side_by_side() -> None:
    assert [len(axis.values) for axis in grid_of(load("metronomes"))] == [64, 64]
    assert [len(axis.values) for axis in grid_of(load("huygens"))] == [64, 64]


def test_the_usual_energy_of_a_section_is_that_of_the_usual_start() -> None:
    scene = Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=0.15, length=0.25)] * 2)])
    section = find_section(scene, 2.0, members=2, workers=1)
    assert section.energy == pytest.approx(simulate(scene, 0.1, start=usual_start(scene)).mechanics.energy[0])


@pytest.mark.parametrize(
    ("numbers", "count"), [({}, 0), ({"pendulum[0].links[0].friction": 0.1}, 1), ({"support.friction": 1.0}, 1)]
)
def test_a_spread_of_frequencies_says_what_they_leave_out(numbers: dict[str, float], count: int) -> None:
    """In the words of the table, as do sweeps."""
    scene = vary(load("paper-cart-1"), numbers)
    spread = find_spread(scene, ["gravity=1%"], members=3)
    notes = [*natural_modes(scene).notes]
    assert len(notes) == count
    assert json.loads(spread_table(spread, "json"))["notes"] == notes
    swept = sweep_text(sweep(Study(scene, parse_variations(["gravity=9,10"]), parse_measures(["frequencies"]))))
    loci = loci_text(follow_loci(scene, parse_variations(["gravity=9,10"])[0]))
    for text in (spread_table(spread, "text"), swept, loci):
        assert all(note in text for note in notes)


def test_a_sweep_into_friction_says_what_it_leaves_out() -> None:
    """Runs, which have it, say nothing."""
    axes = parse_variations(["pendulum[0].links[0].friction=0,0.1"])
    (note,) = natural_modes(vary(load("chain-1"), {"pendulum[0].links[0].friction": 0.1})).notes
    for measure, told in (("frequencies", True), ("energy_drift:0.1", False)):
        study = Study(load("chain-1"), axes, parse_measures([measure]))
        assert (note in sweep_text(sweep(study, workers=1))) == told
