"""Strobes, attractors and bifurcations of driven scenes: against SciPy on equations written here, and closed forms."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from functools import cache
from importlib.util import find_spec
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from seen import flaws

from modal.errors import SceneError
from modal.plotting.style import theme
from modal.scene import (
    Bob,
    Cart,
    ConstantForce,
    Moved,
    Pendulum,
    RecordMotion,
    Scene,
    SineForce,
    SineMotion,
    load,
    scene_from,
)
from modal.scene.parameters import Variation, vary
from modal.types import Floats
from multipendula.cli import main
from nonlinear import simulate
from nonlinear.ensembles import (
    Basins,
    BifurcationDiagram,
    StroboscopicSection,
    basins_table,
    bifurcation_table,
    find_basins,
    find_bifurcations,
    find_section,
    find_strobes,
    grid_of,
    strobes_table,
)
from nonlinear.ensembles.strobes import strobe_times
from nonlinear.plotting import basins_figure, bifurcation_figure, strobes_figure
from nonlinear.postprocessing.returns import clustered, repetition

DRIVEN, SHAKEN = load("driven-pendulum"), load("shaken-pendulum")
ANGLE, RATE = (f"pendulum[0].start.{name}[0]" for name in ("angles_deg", "rates_deg"))
QUICK = "numba" if find_spec("numba") else "numpy"
PUSH = "pendulum[0].links[0]"


@pytest.mark.parametrize(
    ("path", "unit"),
    [("force[0].amplitude", "N"), ("force[1].amplitude", "N m"), ("force[0].frequency_hz", "Hz"), ("gravity", "m/s²")],
)
def test_the_amplitude_of_a_force_has_its_unit(path: str, unit: str) -> None:
    forces = [SineForce(on=PUSH, direction=way, amplitude=1.0, frequency_hz=1.0) for way in ("horizontal", "torque")]
    scene = DRIVEN.replace(force=forces)
    nothing = np.zeros((1, 0))
    states = (nothing,) * 4
    assert BifurcationDiagram(scene, Variation(path, (1.0,)), 0.0, nothing, nothing, states, {}, ()).unit == unit


def shaken(t: float, y: Floats, hertz: float) -> list[float]:
    """θ'' = −(g sin θ + s'' cos θ)/l − 0.05 θ' with l = 1 m and s = 0.02 m sin Ωt."""
    omega = 2 * np.pi * hertz
    support = -0.02 * omega**2 * np.sin(omega * t)
    return [y[1], -9.81 * np.sin(y[0]) - support * np.cos(y[0]) - 0.05 * y[1]]


def driven(t: float, y: Floats, gamma: float, hertz: float = 1.0) -> list[float]:
    """The pendulum of the textbook: θ'' + 2β θ' + ω₀² sin θ = γ ω₀² cos ωt with ω₀ = 3π rad/s, β = ω₀/4."""
    omega = 3 * np.pi
    return [y[1], -omega / 2 * y[1] - omega**2 * np.sin(y[0]) + gamma * omega**2 * np.cos(2 * np.pi * hertz * t)]


def by_scipy(rates: Callable[..., list[float]], begun: list[float], times: Floats, *numbers: float) -> Floats:
    solution = solve_ivp(
        rates, (0.0, times[-1]), begun, method="DOP853", t_eval=times, args=numbers, rtol=1e-11, atol=1e-11
    )
    return np.asarray(solution.y.T)


# ------------------------------------------------------------------------------------------------------- repetition


def test_after_how_many_strobes_motions_repeat() -> None:
    k = np.arange(50)
    motions = {
        "rest": (0 * k, 1, 0),
        "two": (0.3 * (-1.0) ** k, 2, 0),
        "four": (0.3 * (-1.0) ** k + 0.01 * np.cos(np.pi * k / 2), 4, 0),
        "a turn backwards": (0.2 - 2 * np.pi * k, 1, -1),
        "two turns in three": (0.1 * np.cos(2 * np.pi * k / 3) + 4 * np.pi / 3 * k, 3, 2),
        "still on its way": (0.5 + 0.1 * 0.95**k, 0, 0),
        "towards period one": (0.001 * (-0.97) ** k, 0, 0),
        "not periodic": (0.4 * np.sin(k), 0, 0),
        "failed": (np.nan * k, 0, 0),
    }
    strobes = np.array([np.stack([angle, 0.0 * k], axis=1) for angle, _, _ in motions.values()])
    period, turns = repetition(strobes, 1)
    assert period.tolist() == [motion[1] for motion in motions.values()]
    assert turns[:, 0].tolist() == [motion[2] for motion in motions.values()]


def test_one_orbit_is_one_cluster_at_any_strobe_of_it_and_after_any_turns() -> None:
    k = np.arange(50)
    two = np.stack([0.3 * (-1.0) ** k, 0.1 * (-1.0) ** k], axis=1)
    motions = np.array([two, -two, two + np.array([2 * np.pi, 0.0]), 1.1 * two, np.sin(k)[:, None] * [1.0, 1.0]])
    labels, members = clustered(motions, *repetition(motions, 1))
    assert labels.tolist() == [1, 1, 1, 2, 0]
    assert members == [0, 3]


@pytest.mark.parametrize(
    ("phase", "settle", "first"),
    [(0.0, 0.0, 0.0), (90.0, 0.0, 0.5), (-90.0, 0.0, 1.5), (450.0, 4.5, 4.5), (0, 4.1, 6.0)],
)
def test_strobes_come_at_their_phase_after_the_transient(phase: float, settle: float, first: float) -> None:
    assert strobe_times(2.0, phase, settle=settle, count=3) == pytest.approx(first + np.array([0.0, 2.0, 4.0]))


# ------------------------------------------------------------------------------------------------------- sections


def test_strobes_are_those_of_the_equation() -> None:
    strobes = find_strobes(
        vary(DRIVEN, {"force[0].amplitude": 1.06}), 9.0, phase_deg=90.0, settle=2.0, members=3, workers=1
    )
    assert strobes.times == pytest.approx(2.25 + np.arange(7))
    begun = strobes.ensemble.question.members.states
    assert begun is not None
    assert begun.links[0, 0] == -np.pi / 2
    assert np.all(np.abs(begun.links + np.pi / 2) <= np.radians(10.0))
    angles, rates = strobes.points(0)
    for member, start in enumerate(begun.links[:, 0]):
        expected = by_scipy(driven, [start, 0.0], strobes.times, 1.06)
        assert np.radians(rates[member]) == pytest.approx(expected[:, 1], abs=1e-6)
        assert np.exp(1j * np.radians(angles[member])) == pytest.approx(np.exp(1j * expected[:, 0]), abs=1e-7)
    other = find_strobes(DRIVEN, 9.0, members=3, seed=8, workers=1).ensemble.question.members.states
    assert other is not None
    assert other.links[1, 0] != begun.links[1, 0]


def test_strobes_of_two_links_on_a_cart_are_those_of_the_maximal_form() -> None:
    links = [Bob(mass=1.0, length=0.9, damping=0.1), Bob(mass=0.5, length=0.6)]
    forces = [
        SineForce(on="cart", amplitude=2.0, frequency_hz=0.75, phase_deg=20.0),
        SineForce(on="pendulum[0].links[1]", direction="torque", amplitude=0.4, frequency_hz=0.5),
    ]
    start = {"angles_deg": [30.0, -20.0]}
    scene = Scene(gravity=9.81, support=Cart(mass=2.0), pendulum=[Pendulum(links=links, start=start)], force=forces)
    strobes = find_strobes(
        scene, 9.0, members=2, spread_deg=0.0, of=["theta_1_2", "theta_1_1"], engine="numpy", workers=1
    )
    assert strobes.period == 4.0
    assert strobes.shown == (1, 0)
    run = simulate(scene, 9.0, form="maximal", output=[0.0, 4.0, 8.0], tolerance=1e-10)
    for member in (0, 1):
        assert strobes.states[0][member] == pytest.approx(run.motion.links, abs=1e-6)
        assert strobes.states[2][member] == pytest.approx(run.motion.cart, abs=1e-6)
    rows = [*csv.reader(StringIO(strobes_table(strobes, "csv")))]
    assert rows[0][:3] == ["motion", "time_s", "theta_1_1_rad"]
    assert rows[0][-2:] == ["x_m", "x_dot_m_per_s"]
    assert len(rows) == 7


def test_a_weak_drive_ends_in_its_linear_response() -> None:
    """θ = Re (F/(m l²)) e^{iΩt} / (g/l − Ω² + iΩc), from all starts alike."""
    force = SineForce(on=PUSH, direction="torque", amplitude=1e-4, frequency_hz=0.4, phase_deg=90.0)
    links = [Bob(mass=1.0, length=1.0, damping=0.8)]
    scene = Scene(gravity=9.81, pendulum=[Pendulum(links=links, start={"angles_deg": [1.0]})], force=[force])
    strobes = find_strobes(scene, 100.0, settle=60.0, members=3, spread_deg=0.5, tolerance=1e-11, workers=1)
    omega = 0.8 * np.pi
    expected = 1e-4 / (9.81 - omega**2 + 0.8j * omega)
    assert strobes.states[0][..., 0] == pytest.approx(np.full((3, 17), expected.real), abs=1e-9)
    assert strobes.states[1][..., 0] == pytest.approx(np.full((3, 17), (1j * omega * expected).real), abs=1e-8)
    assert strobes.repeats.tolist() == [1, 1, 1]
    told = json.loads(strobes_table(strobes, "json"))
    assert told["repeats_after_periods"] == [1, 1, 1]
    assert told["period_s"] == 2.5
    assert len(told["strobes"]) == 51
    assert "3 motions have period 1" in strobes_table(strobes, "text")


# ------------------------------------------------------------------------------------------------------- attractors


def attractors_of(hertz: float) -> Basins:
    scene = vary(SHAKEN, {"support.motion.frequency_hz": hertz})
    grid = [f"{ANGLE}=-50,10,45", f"{RATE}=-60,30"]
    return find_basins(scene, vary=grid, measure="attractor", engine=QUICK, workers=1, check=0)


def test_small_and_large_swings_coexist_between_the_folds_alone() -> None:
    """Which lie at 0.466204506125 Hz, of 58.3115°, and at 0.483101024404 Hz, of 25.3866°."""
    below, between, above = (attractors_of(hertz) for hertz in (0.460, 0.475, 0.490))
    assert [len(strobes.attractors) for strobes in (below, between, above)] == [1, 2, 1]
    small, large = between.attractors
    assert below.attractors[0].largest_angle_deg < small.largest_angle_deg < 25.3866
    assert 25.3866 < above.attractors[0].largest_angle_deg < large.largest_angle_deg < 58.3115
    assert between.names[1:] == ("period 1, largest angle 11.62°", "period 1, largest angle 51.89°")
    times = np.linspace(500.0, 510.0, 2001)
    assert set(between.values.ravel()) == {1.0, 2.0}
    for number, attractor in enumerate(between.attractors, 1):
        i, j = np.argwhere(between.values == number)[0]
        begun = np.radians([between.axes[0].values[i], between.axes[1].values[j]])
        swing = by_scipy(shaken, begun.tolist(), times, 0.475)[:, 0]
        assert np.degrees(np.abs(swing).max()) == pytest.approx(attractor.largest_angle_deg, abs=0.01)
    assert sum(between.shares().values()) == pytest.approx(1.0)
    record = json.loads(basins_table(between, "json"))
    assert [attractor["period"] for attractor in record["attractors"]] == [1, 1]


def rotor() -> Scene:
    motion = SineMotion(direction="vertical", amplitude=0.1, frequency_hz=2.0)
    start = {"angles_deg": [0.0], "rates_deg": [0.0]}
    links = [Bob(mass=1.0, length=1.0, damping=0.4)]
    return Scene(gravity=9.81, support=Moved(motion=motion), pendulum=[Pendulum(links=links, start=start)])


def test_links_that_turn_over_for_ever_are_told_by_their_turns() -> None:
    basins = find_basins(
        rotor(), 75.0, vary=[f"{ANGLE}=-10,0", f"{RATE}=-720,0,720"], measure="attractor", workers=1, check=1
    )
    assert set(basins.names) >= {"period 1, turns 1 a period", "period 1, turns −1 a period"}
    for place, turns in ((0, (-1,)), (2, (1,))):
        for row in range(2):
            assert basins.attractors[int(basins.values[row, place]) - 1].ending.turns == turns

    def rates(t: float, y: Floats) -> list[float]:
        omega = 4 * np.pi
        return [y[1], -(9.81 - 0.1 * omega**2 * np.sin(omega * t)) * np.sin(y[0]) - 0.4 * y[1]]

    ends = by_scipy(rates, [0.0, 4 * np.pi], np.array([59.0, 59.5]))
    assert ends[1] - ends[0] == pytest.approx([2 * np.pi, 0.0], abs=1e-3)


def test_attractors_do_not_depend_on_who_computes_them() -> None:
    grid = [f"{ANGLE}=0", f"{RATE}=0,720"]
    names = []
    for options in ({"workers": 1}, {"workers": 2, "chunk": 1}, {"engine": "simulate", "workers": 1}):
        basins = find_basins(rotor(), 75.0, vary=grid, measure="attractor", check=0, **options)
        names.append(([basins.names[int(k)] for k in basins.values.ravel()], basins.names))
    assert names[0] == names[1] == names[2]
    assert names[0][1] == ("undecided", "period 1, largest angle 0°", "period 1, turns 1 a period")


def test_the_usual_grid_of_one_driven_link_is_its_angle_and_its_rate() -> None:
    scene = SHAKEN.replace(pendulum=[SHAKEN.pendulum[0].replace(start=None)])
    angle, rate = grid_of(scene)
    assert (angle.path, rate.path) == (ANGLE, RATE)
    assert rate.values[-1] == pytest.approx(np.degrees(2 * np.sqrt(9.81)), rel=5e-3)
    basins = find_basins(scene, 0.5, vary=[f"{ANGLE}=0,1", f"{RATE}=0,300"], measure="largest_angle", workers=1)
    assert basins.values[0, 1] > 10.0 > basins.values[0, 0]


@pytest.mark.parametrize(
    ("scene", "options", "words"),
    [
        (rotor(), {"vary": [f"{ANGLE}=0,1", "gravity=9,10"]}, "gravity: changes the attractors themselves"),
        (rotor(), {"vary": [f"{ANGLE}=0,1", f"{RATE}=0,1"], "duration": 5.0}, "takes 50 periods of 0.5 s"),
        (DRIVEN.replace(force=()), {"vary": [f"{ANGLE}=0,1", f"{ANGLE}=0,1"]}, "nothing drives this scene"),
    ],
)
def test_what_has_no_attractors_is_refused(scene: Scene, options: dict[str, object], words: str) -> None:
    with pytest.raises(SceneError, match=words):
        find_basins(scene, measure="attractor", workers=1, **options)  # type: ignore[arg-type]


def test_without_losses_nothing_attracts() -> None:
    with pytest.raises(SceneError, match="an attractor needs losses"):
        find_basins(
            vary(SHAKEN, {"pendulum[0].links[0].damping": 0.0}),
            vary=[f"{ANGLE}=0,1", f"{RATE}=0,1"],
            measure="attractor",
        )


# ------------------------------------------------------------------------------------------------------- bifurcations


def test_periods_double_where_they_are_known_to() -> None:
    """At γ = 1.0663728625, 1.0793139059 and 1.0820843843: midway between them a strobe has 1, 2, 4 and 8 places."""
    doublings = np.array([1.0663728625, 1.0793139059, 1.0820843843])
    values = [1.062, *((doublings[1:] + doublings[:-1]) / 2), 1.0824, 1.105]
    text = f"force[0].amplitude={','.join(map(repr, map(float, values)))}"
    bifurcations = find_bifurcations(DRIVEN, text, workers=1, engine=QUICK)
    assert bifurcations.repeats.tolist() == [1, 2, 4, 8, 0]
    assert bifurcations.settle.tolist() == [200.0] * 5
    assert bifurcations.unit == "N m"
    for k, count in enumerate([1, 2, 4, 8]):
        assert len(np.unique(np.round(bifurcations.states[0][k, :, 0], 3))) == count
    assert len(np.unique(np.round(bifurcations.states[0][4, :, 0], 3))) > 40
    expected = by_scipy(driven, [-np.pi / 2, 0.0], bifurcations.times[2], bifurcations.variation.values[2])
    assert np.sort(bifurcations.states[0][2, :, 0])[::13] == pytest.approx(np.sort(expected[:, 0])[::13], abs=1e-5)
    rows = [*csv.reader(StringIO(bifurcation_table(bifurcations, "csv")))]
    assert len(rows) == 1 + 5 * 50
    assert rows[0][:3] == ["force[0].amplitude", "repeats_after_periods", "time_s"]
    assert "after a transient of 200 s" in bifurcation_table(bifurcations, "text")


def test_every_frequency_has_its_own_strobes() -> None:
    bifurcations = find_bifurcations(
        DRIVEN, "force[0].frequency_hz=0.9,1.0,1.3", phase_deg=180.0, settle=3.0, workers=1
    )
    for k, hertz in enumerate((0.9, 1.0, 1.3)):
        assert bifurcations.times[k] == pytest.approx((np.ceil(3.0 * hertz - 0.5) + 0.5 + np.arange(50)) / hertz)
        expected = by_scipy(driven, [-np.pi / 2, 0.0], bifurcations.times[k, :8], 1.105, hertz)
        assert bifurcations.states[0][k, :8, 0] == pytest.approx(expected[:, 0], abs=1e-5)
    apart = find_bifurcations(
        DRIVEN, "force[0].frequency_hz=0.9,1.3", phase_deg=180.0, settle=3.0, workers=1, engine=QUICK
    )
    assert apart.states[0][:, :8] == pytest.approx(bifurcations.states[0][::2, :8], abs=1e-5)


def test_pendula_on_two_carts_have_a_diagram_with_both() -> None:
    """The strobes of a value are those of a run of it: of links and of the carts."""
    drawn = [
        {
            "on": name,
            "links": [{"kind": "bob", "mass": 1.0, "length": 1.0, "damping": 2.0}],
            "start": {"angles_deg": [20]},
        }
        for name in ("a", "b")
    ]
    carts = [{"kind": "cart", "name": name, "mass": 2.0, "stiffness": 30.0, "damping": 2.0} for name in ("a", "b")]
    push = {"on": "pendulum[0].links[0]", "kind": "sine", "amplitude": 1.0, "frequency_hz": 0.5}
    scene = scene_from({"gravity": 9.81, "support": carts, "pendulum": drawn, "force": [push]})
    diagram = find_bifurcations(scene, "force[0].amplitude=1:2:2", settle=10.0, workers=1, engine=QUICK)
    run = simulate(vary(scene, {"force[0].amplitude": 2.0}), diagram.times[1, -1], output=[0.0, *diagram.times[1]])
    assert np.allclose(diagram.states[0][1], run.motion.links[1:], atol=1e-6)
    assert np.allclose(diagram.states[4][1], run.motion.supports[1:], atol=1e-6)
    assert "a_m" in diagram.to_dict()


def test_values_without_a_common_period_fail_alone() -> None:
    forces = [SineForce(on=PUSH, amplitude=1.0, frequency_hz=hertz) for hertz in (1.0, 0.5)]
    scene = DRIVEN.replace(force=forces)
    bifurcations = find_bifurcations(scene, "force[1].frequency_hz=0.5,0.6180339887,0.75", settle=5.0, workers=1)
    assert list(bifurcations.reasons) == [1]
    assert "no common period" in bifurcations.reasons[1]
    assert np.isnan(bifurcations.states[0][1]).all()
    assert np.isfinite(bifurcations.states[0][[0, 2]]).all()
    assert bifurcations.times[2, 1] - bifurcations.times[2, 0] == pytest.approx(4.0)
    told = json.loads(bifurcation_table(bifurcations, "json"))
    assert told["unit"] == "Hz"
    assert told["settle_s"] == [5.0, None, 5.0]
    assert len(told["strobes"]) == 100


# ------------------------------------------------------------------------------------------------------- refusals


RECORD = RecordMotion(time_s=(0.0, 1.0, 2.0, 3.0), displacement_m=(0.0, 0.1, 0.0, 0.1))


@pytest.mark.parametrize(
    ("scene", "words"),
    [
        (DRIVEN.replace(force=()), "a stroboscopic section needs a period"),
        (DRIVEN.replace(force=[ConstantForce(on=PUSH, amplitude=1.0)]), "a stroboscopic section needs a period"),
        (SHAKEN.replace(support=Moved(motion=RECORD)), "is not periodic"),
    ],
)
def test_scenes_without_a_period_have_no_strobes(scene: Scene, words: str) -> None:
    with pytest.raises(SceneError, match=words):
        find_strobes(scene)
    with pytest.raises(SceneError, match=words):
        find_bifurcations(scene, "gravity=9:10:2")


def test_every_mistake_is_named_at_once() -> None:
    with pytest.raises(SceneError) as told:
        find_strobes(DRIVEN, members=0, phase_deg=np.nan, spread_deg=-1.0, settle=np.inf)
    assert len(told.value.problems) == 4
    with pytest.raises(SceneError, match=r"theta_2_1: must be one of theta_1_1"):
        find_strobes(DRIVEN, of=["theta_2_1"])
    with pytest.raises(SceneError, match="no stroboscopic sample comes after 20 s"):
        find_strobes(DRIVEN, 20.2, settle=20.0, phase_deg=180.0)
    with pytest.raises(SceneError, match="how many links there are"):
        find_bifurcations(DRIVEN, "pendulum[0].count=1:2:2")
    with pytest.raises(SceneError, match="find_strobes takes it"):
        find_section(DRIVEN)


# ------------------------------------------------------------------------------------------------------- pictures


@cache
def drawn() -> tuple[StroboscopicSection, Basins, BifurcationDiagram]:
    grid = [f"{ANGLE}=-10,10", f"{RATE}=0,720"]
    return (
        find_strobes(DRIVEN, 30.0, members=8, workers=1, check=0),
        find_basins(rotor(), 75.0, vary=grid, measure="attractor", workers=1, check=0),
        find_bifurcations(DRIVEN, "force[0].amplitude=1.06:1.1:20", settle=9.0, workers=1),
    )


@pytest.mark.parametrize("name", ["light", "dark"])
def test_nothing_is_wrong_with_pictures(name: str) -> None:
    strobes, basins, bifurcations = drawn()
    with theme(name):
        figures = [strobes_figure(strobes), basins_figure(basins), bifurcation_figure(bifurcations)]
    for figure in figures:
        assert flaws(figure) == []


# ------------------------------------------------------------------------------------------------------- commands


def test_the_commands_write_what_they_show(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path, picture, table = "driven-pendulum", tmp_path / "one.png", tmp_path / "one.csv"
    strobed = ["--phase-deg", "90", "--settle", "5", "--workers", "1"]
    words = ["section", path, "--members", "2", "--spread", "3", "--seed", "4", "--duration", "8", *strobed]
    assert main([*words, "-o", str(picture)]) == 0
    assert "sampled once per period of 1 s, at 90°, 3 times from 5.25 s on" in capsys.readouterr().out.replace(
        "\n", " "
    )
    assert picture.stat().st_size > 5000
    assert main([*words, "--format", "csv"]) == 0
    assert len(capsys.readouterr().out.splitlines()) == 7
    words = ["sweep", path, "--vary", "force[0].amplitude=1:1.06:2", "--strobe", *strobed, "--of", "theta_1_1"]
    assert main([*words, "-o", str(table), "--picture", str(picture)]) == 0
    assert "bifurcation diagram" in capsys.readouterr().out
    assert len(table.read_text().splitlines()) == 101
    assert main([*words, "-o", "-"]) == 0
    assert capsys.readouterr().out == table.read_text()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("section driven --energy 3 --crossing theta[1,1]=0", "--energy: needs a scene that keeps its energy"),
        ("section chain-2 --phase-deg 3 --spread 2 --of theta_1_1", "--spread: needs a scene that is driven"),
        ("section driven --of theta_3", "--of theta_3: must be one of theta_1_1"),
        ("sweep driven --vary gravity=9:10:2 --settle 3", "--settle: needs --strobe"),
        ("sweep driven --vary gravity=9:10:2 --strobe --measure beat", "--measure: cannot be combined with --strobe"),
        ("sweep driven --vary gravity=9:10:2 --vary damping_ratio=0:1:2 --strobe", "needs exactly one --vary"),
        ("sweep driven --vary gravity=9:10:2 --strobe -o x.npz", "-o x.npz: the name must end in .csv or .json"),
        ("sweep driven --vary gravity=9:10:2 --strobe --loci", "--strobe: cannot be combined with --loci"),
    ],
)
def test_options_that_do_not_fit_are_named(words: str, message: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(words.replace("driven", "driven-pendulum").split()) == 2
    assert message in " ".join(capsys.readouterr().err.split())
