"""Members of scenes with inputs of time: moved supports, hoists, damping ratios, drag, against individual runs."""

from __future__ import annotations

import numpy as np
import pytest
from amounts import usually
from support.loops import interpreted

from modal.errors import SceneError
from modal.scene import (
    Bob,
    Cart,
    Fixed,
    Hoist,
    Moved,
    Pendulum,
    RandomMotion,
    RecordMotion,
    Rod,
    Scene,
    SineMotion,
    SweepMotion,
)
from modal.scene.parameters import vary
from nonlinear import ensemble, simulate
from nonlinear.dynamics import Generated, Lanes
from nonlinear.ensembles import Ensemble
from nonlinear.system import State, numbers_of, system_of

START = {"angles_deg": (25.0, -40.0)}
TIMES = np.arange(31) * 0.07
MOTIONS = {
    "sine": SineMotion(direction="vertical", amplitude=0.03, frequency_hz=4.0, phase_deg=30.0),
    "sweep": SweepMotion(amplitude=0.05, from_hz=0.5, to_hz=3.0, duration=0.9),
    "record": RecordMotion(time_s=tuple(TIMES), acceleration_m_per_s2=tuple(np.sin(4 * TIMES) * TIMES)),
    "random": RandomMotion(psd=(0.5, 0.5), frequency_hz=(0.5, 6.0), seed=3, duration=20.0),
}
CART = Cart(mass=1.5, stiffness=4.0)
HOISTS = {
    "smooth": Hoist(to=1.5, begin=0.3, duration=0.8),
    "trapezoidal": Hoist(to=0.6, begin=0.2, duration=1.0, profile="trapezoidal"),
}


def scene_of(support: object, drag: float = 0.0, ratio: float = 0.0, hoist: Hoist | None = None) -> Scene:
    links = (Bob(mass=1.0, length=0.9, drag=drag, hoist=hoist), Rod(mass=0.6, length=0.7, drag=drag))
    return Scene(
        gravity=9.81, support=support, damping_ratio=ratio, pendulum=(Pendulum(links=links, start=START, count=1),)
    )


SCENES = {
    **{name: scene_of(Moved(motion=motion)) for name, motion in MOTIONS.items()},
    "sine and ratio": scene_of(Moved(motion=MOTIONS["sine"]), ratio=0.05),
    "ratio": scene_of(CART, ratio=0.05),
    "drag": scene_of(CART, drag=0.3),
    **{name: scene_of(CART, hoist=hoist) for name, hoist in HOISTS.items()},
    "smooth and drag": scene_of(CART, hoist=HOISTS["smooth"], drag=0.3),
    **{f"{name} and drag": scene_of(Moved(motion=motion), drag=0.3) for name, motion in MOTIONS.items()},
}
COMPILED = ["sine", "record", "random", "ratio", "drag", "sine and drag", "record and drag", "smooth and drag"]
MASSES = {"pendulum[0].links[1].mass": [0.4, 0.6, 1.3]}
OPTIONS = {"workers": 1, "check": 0, "output": 7, "tolerance": 1e-10}


def apart(runs: Ensemble) -> float:
    """The largest angle between members and individual runs."""
    most = 0.0
    for k in range(runs.size):
        numbers = {path: float(values[k]) for path, values in runs.members.values.items()}
        run = simulate(vary(runs.question.scene, numbers), 2.0, output=7, tolerance=1e-11)
        most = max(most, float(np.abs(run.motion.links - runs.column("links_rad")[k]).max()))
    return most


@pytest.mark.parametrize("name", SCENES)
def test_members_are_the_runs_of_their_scenes(name: str) -> None:
    runs = ensemble(SCENES[name], 2.0, vary=MASSES, engine="numpy", measures=["largest_angle"], **OPTIONS)
    assert runs.engine == "numpy"
    assert not runs.failures
    assert apart(runs) < 2e-8
    assert runs.energy_drift.max() < 1e-7


@pytest.mark.parametrize(
    ("name", "path", "values"),
    [
        ("sine", "support.motion.amplitude", [0.0, 0.02, 0.05]),
        ("sine", "support.motion.frequency_hz", [1.0, 2.5, 6.0]),
        ("sine", "support.motion.phase_deg", [0.0, 90.0, 200.0]),
        ("ratio", "damping_ratio", [0.0, 0.02, 0.3]),
        ("drag", "damping_ratio", [0.0, 0.02, 0.3]),
        ("drag", "pendulum[0].links[0].drag", [0.0, 0.1, 1.0]),
        ("smooth", "pendulum[0].links[1].length", [0.3, 0.7, 1.0]),
    ],
)
def test_members_differ_in_the_numbers_of_a_feature(name: str, path: str, values: list[float]) -> None:
    runs = ensemble(SCENES[name], 2.0, vary={path: values}, engine="numpy", **OPTIONS)
    assert not runs.failures
    assert apart(runs) < 2e-8
    links = runs.column("links_rad")
    assert min(np.abs(links[k] - links[k - 1]).max() for k in (1, 2)) > 1e-3


def test_members_are_those_of_the_maximal_form() -> None:
    """Which has positions and pivot forces for unknowns, and nothing of the text of the equations."""
    for name in ("sine", "smooth"):
        masses = usually([0.4], [0.4, 1.3])
        runs = ensemble(SCENES[name], 0.7, vary={"pendulum[0].links[1].mass": masses}, engine="numpy", **OPTIONS)
        for k, mass in enumerate(masses):
            scene = vary(SCENES[name], {"pendulum[0].links[1].mass": mass})
            run = simulate(scene, 0.7, output=7, form="maximal", tolerance=1e-10)
            np.testing.assert_allclose(runs.column("links_rad")[k], run.motion.links, atol=3e-7)


@pytest.mark.parametrize(
    ("name", "path", "words"),
    [
        ("sweep", "support.motion.amplitude", "not all are sines"),
        ("smooth", "pendulum[0].links[0].hoist.to", "law of a hoist"),
        ("smooth", "pendulum[0].links[0].length", "law of a hoist"),
    ],
)
def test_members_that_differ_in_their_laws_of_time_go_one_by_one(name: str, path: str, words: str) -> None:
    varied = {path: [0.8, 1.0]}
    runs = ensemble(SCENES[name], 0.2, vary=varied, **{**OPTIONS, "output": "end"})
    assert runs.engine == "simulate"
    assert words in runs.reason
    with pytest.raises(SceneError, match=words):
        ensemble(SCENES[name], 0.2, vary=varied, engine="numpy", **OPTIONS)


@pytest.mark.parametrize("name", ["sine", "random", "trapezoidal", "sine and ratio"])
def test_many_links_go_by_the_recursion(name: str) -> None:
    """Rates of members of 33 links, against those of the same members by the text."""
    scene = SCENES[name]
    first = scene.pendulum[0]
    other = Pendulum(links=(Bob(mass=0.1, length=0.5),), count=31)
    large = scene.replace(pendulum=(first.replace(start=None), other))
    masses = MASSES["pendulum[0].links[1].mass"]
    scenes = [vary(large, {"pendulum[0].links[1].mass": mass}) for mass in masses]
    dampers = [system_of(scene).modal_damping for scene in scenes] if scene.has_modal_damping else None
    at = {("pendulum", 0, "links", 1, "mass"): np.array(masses)}
    lanes = Lanes(numbers_of(large, at, modal=None if dampers is None else np.array(dampers)))
    assert not lanes.is_written
    y = np.random.default_rng(1).standard_normal((lanes.layout.size, 3))
    times = np.array([0.25, 0.5, 1.1])
    rates = np.array(lanes.rates(lanes.numbers)(y, times))
    for k, member in enumerate(scenes):
        expected = Generated(system_of(member)).derivative(float(times[k]), y[:, k])
        np.testing.assert_allclose(rates[:, k], expected, rtol=1e-9, atol=1e-9)


MEASURED = ("largest_angle", "first_turn", "lyapunov", "section:theta[1,2]=0")


def alike(name: str, engine: str, within: float, measures: tuple[str, ...] = MEASURED, seconds: float = 2.0) -> None:
    """Whether members of an engine are those of lanes in NumPy, whatever is measured."""
    options = {**OPTIONS, "vary": MASSES, "measures": measures}
    runs, other = (ensemble(SCENES[name], seconds, engine=chosen, **options) for chosen in ("numpy", engine))
    assert not other.failures
    assert runs.columns == other.columns
    for column in runs.columns:
        if column not in {"energy_drift", "error_rad", "horizon_s"}:
            expected = runs.column(column)
            most = 1e-8 if column == "lyapunov_per_s" else within  # whose transient is a run of its own
            np.testing.assert_allclose(other.column(column), expected, atol=most, rtol=within, err_msg=column)
    assert other.energy_drift.max() < 1e-8
    ratio = other.column("error_rad") / runs.column("error_rad")
    assert np.all((ratio > 1e-3) & (ratio < 1e3))


COMPILED = ["sine", "record", "random", "ratio", "drag", "sine and drag", "smooth and drag", *HOISTS]


@pytest.mark.parametrize("name", usually(["record", "smooth and drag"], COMPILED))
def test_the_loop_that_numba_compiles_takes_the_steps_of_lanes(name: str) -> None:
    with interpreted():
        alike(name, "numba", 1e-9, seconds=1.3)


@pytest.mark.parametrize("name", COMPILED)
def test_compiled_members_are_those_of_lanes(name: str) -> None:
    pytest.importorskip("numba")
    alike(name, "numba", 1e-9)


@pytest.mark.parametrize("name", [*usually((), ("smooth and drag",)), "sine and ratio", "sine and drag", "trapezoidal"])
def test_a_run_by_taylor_series_is_that_of_dop853(name: str) -> None:
    pytest.importorskip("heyoka")
    runs = [simulate(SCENES[name], 2.0, method=method, tolerance=1e-13, output=21) for method in ("taylor", "DOP853")]
    assert np.abs(runs[0].motion.links - runs[1].motion.links).max() < 1e-12
    assert runs[0].energy_drift() < 1e-13


def test_functions_of_time_that_an_engine_cannot_record_are_refused() -> None:
    with pytest.raises(SceneError, match=r"support\.motion: engine numba .*takes no sweep.*: take engine numpy"):
        ensemble(SCENES["sweep"], 2.0, vary=MASSES, engine="numba", **OPTIONS)


@pytest.mark.parametrize("name", ["sweep", "random"])
def test_functions_of_time_without_a_series_are_refused(name: str) -> None:
    pytest.importorskip("heyoka")
    with pytest.raises(SceneError, match=r"support\.motion: method taylor .*a sine"):
        simulate(SCENES[name], 2.0, method="taylor")


@pytest.mark.parametrize("name", ["record", "random", *HOISTS])
def test_polynomials_are_the_functions_of_time(name: str) -> None:
    inputs = Lanes(numbers_of(SCENES[name])).inputs
    times = np.random.default_rng(5).uniform(-0.5, 30.0, 400)
    assert inputs.polynomials
    for polynomial, expected in zip(inputs.polynomials, inputs.beside(times), strict=True):
        t = times % polynomial.period if np.isfinite(polynomial.period) else times
        at = np.searchsorted(polynomial.knots, t, side="right")
        value = sum(
            coefficient * (t - polynomial.origins[at]) ** k
            for k, coefficient in enumerate(polynomial.coefficients[at].T)
        )
        np.testing.assert_allclose(value, expected, atol=1e-12 * np.abs(expected).max())


def test_a_ratio_is_that_of_each_member_where_their_modes_differ() -> None:
    """Alone in its first mode, each member loses 2 ζ ω of its amplitude."""
    masses = {"pendulum[0].links[1].mass": [0.2, 0.6, 3.0]}
    runs = ensemble(scene_of(Fixed(), ratio=0.05), 2.0, vary=masses, engine="numpy", **OPTIONS)
    assert apart(runs) < 2e-8


def test_the_order_of_hoisted_pendula_is_refused() -> None:
    with pytest.raises(SceneError, match="constant lengths"):
        ensemble(SCENES["smooth"], 2.0, vary=MASSES, measures=["order"])


def test_exponents_of_members_on_a_moved_support_are_those_of_two_near_runs() -> None:
    scene = SCENES["sine"]
    runs = ensemble(scene, 2.0, vary=MASSES, engine="numpy", measures=["lyapunov"], **OPTIONS)
    for k, mass in enumerate(MASSES["pendulum[0].links[1].mass"]):
        varied = vary(scene, {"pendulum[0].links[1].mass": mass})
        v = np.random.default_rng(0).standard_normal(4)
        l, g = 0.7, 9.81
        scale = np.array([1, 1, np.sqrt(g / l), np.sqrt(g / l)])
        v = v / np.linalg.norm(v)
        begun = np.append(np.radians(START["angles_deg"]), [0.0, 0.0])
        ends = []
        for sign in (1, -1):
            y = begun + sign * 1e-5 * v * scale
            run = simulate(varied, 3.0, start=State(y[:2], y[2:]), output=[1.0, 3.0], tolerance=1e-12)
            ends.append(np.hstack((run.motion.links, run.motion.link_rates)))
        early, late = np.linalg.norm((ends[0] - ends[1]) / 2e-5 / scale, axis=1)[-2:]
        assert runs.column("lyapunov_per_s")[k] == pytest.approx(np.log(late / early) / 2.0, abs=1e-5)
