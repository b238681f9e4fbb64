"""Levels of fidelity: modes in closed form, every candidate against a reference, and until when it can judge."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import replace
from importlib.util import find_spec
from itertools import count
from math import nan, pi, radians
from pathlib import Path

import numpy as np
import pytest
from amounts import usually
from scenes import motion_scene
from scipy.linalg import expm
from uncompiled import uncompiled

from modal import Bob, Cart, ComputationError, Pendulum, Rod, Scene, load, matrices, natural_modes
from modal.plotting import save
from nonlinear.accuracy import (
    Candidate,
    WorkPrecision,
    WorkPrecisionRow,
    list_candidates,
    measure_work_precision,
    tradeoff_table,
)
from nonlinear.accuracy import work_precision as module
from nonlinear.accuracy.references import GivenUpError, Question, Reference, reference_of
from nonlinear.accuracy.work_precision import late
from nonlinear.integration import aside, slightly
from nonlinear.plotting import tradeoff_figure
from nonlinear.reduction import CORRECTED, LINEAR, deflection, rest_angles, start_in_mode, superpose
from nonlinear.reduction.modal_coordinates import join, split
from nonlinear.simulation import simulate
from nonlinear.system import Motion, State, apart, initial_state, of_plane, system_of

PAPER = load("paper-cart-2")
MODES = natural_modes(PAPER)
ENDS = (Candidate(LINEAR), Candidate(CORRECTED))
TRANSLATING = Scene(
    gravity=9.81,
    support=Cart(mass=3.0),
    pendulum=(Pendulum(links=(Rod(mass=1.0, length=0.8, damping=0.05), Bob(mass=0.5, length=0.3))),),
)
SPATIAL = load("chain-spatial")


KINDS = Path(__file__).parents[1] / "combinations" / "scenes"


def in_mode(number: int, degrees: float) -> State:
    return start_in_mode(PAPER, MODES, number, 0, radians(degrees))


def by_exponential(scene: Scene, start: State, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Q and v (T, n) of the linear equations, by the exponential of the state matrix."""
    model, size = matrices(scene), scene.n_links + (scene.support.kind == "cart")
    A = np.block(
        [
            [np.zeros((size, size)), np.eye(size)],
            [-np.linalg.solve(model.M, model.K), -np.linalg.solve(model.M, model.D)],
        ]
    )
    z = np.concatenate([part[0] for part in deflection(scene, instant(start))])
    rows = np.array([expm(A * time) @ z for time in times])
    return rows[:, :size], rows[:, size:]


def instant(start: State) -> Motion:
    cart, rate = np.array([start.cart]), np.array([start.cart_rate])
    return Motion(start.links[None], start.link_rates[None], cart, rate, np.zeros(1))


def off_rest(scene: Scene, seed: int) -> State:
    rng, on = np.random.default_rng(seed), scene.support.kind == "cart"
    angles, rates = 0.1 * rng.normal(size=(2, scene.n_links))
    return State(rest_angles(scene) + angles, rates, *(0.1 * rng.normal(size=2) if on else (0.0, 0.0)))


@pytest.mark.parametrize("scene", [*map(motion_scene, range(12)), PAPER, TRANSLATING, load("cart-upright")])
def test_the_linear_rung_is_the_exponential_of_the_state_matrix(scene: Scene) -> None:
    start, times = off_rest(scene, 5), np.linspace(0.0, 3.0, 7)
    computed = deflection(scene, superpose(scene, start, corrected=False)(times))
    for ours, theirs in zip(computed, by_exponential(scene, start, times), strict=True):
        assert np.abs(ours - theirs).max() < 1e-8 * np.abs(theirs).max()
        assert np.abs(ours - 1.001 * theirs).max() > 1e-8 * np.abs(theirs).max()


def test_the_corrected_rung_turns_at_its_own_frequency() -> None:
    for number in (1, 3):
        start, omega = in_mode(number, 6.0), MODES.omega[number]
        shifted = omega * (1 + MODES[number].kappa * radians(6.0) ** 2)
        motion = superpose(PAPER, start, corrected=True)(np.array([0.0, 2 * pi / shifted, 2 * pi / omega]))
        assert np.allclose(motion.links[0], motion.links[1], atol=1e-12)
        assert np.abs(motion.links[0] - motion.links[2]).max() > 1e-7


def test_a_damped_correction_fades_with_the_amplitude() -> None:
    """The phase by quadrature of ω (1 + κ a(t)²)."""
    modes = natural_modes(TRANSLATING)
    number = next(k for k in range(len(modes)) if modes.eigenvalue[k].imag)
    value, kappa, a = modes.eigenvalue[number], modes[number].kappa, 0.3
    start = start_in_mode(TRANSLATING, modes, number, 0, a)
    times = np.linspace(0.0, 20.0, 2001)
    links = superpose(TRANSLATING, start, corrected=True)(times).links
    speed = value.imag * (1 + kappa * (a * np.exp(value.real * times)) ** 2)
    phase = np.concatenate(([0.0], np.cumsum((speed[1:] + speed[:-1]) / 2 * np.diff(times))))
    expected = np.outer(a * np.exp(value.real * times + 1j * phase), modes.shape(number).angles).real
    assert np.abs(links - expected).max() < 1e-5
    assert np.abs(links - superpose(TRANSLATING, start, corrected=False)(times).links).max() > 1e-2


def test_modes_that_do_not_add_up_are_refused() -> None:
    critical = Pendulum(links=(Bob(mass=1.0, length=1.0, damping=2 * np.sqrt(9.81)),))
    with pytest.raises(ComputationError, match="do not span"):
        superpose(Scene(gravity=9.81, pendulum=(critical,)), State(np.array([0.1]), np.zeros(1)), corrected=False)


def test_the_error_of_the_linear_rung_grows_as_the_square_of_the_amplitude() -> None:
    """Its motion is early by κ a² t, which the phase measures; the mean over the last fifth is 0.9 of the end."""
    shifts = []
    for degrees in (1.0, 2.0):
        diagram = measure_work_precision(PAPER, 6.0, start=in_mode(1, degrees), candidates=ENDS)
        shifts.append(diagram.rows[1].shift)
        assert shifts[-1] == pytest.approx(MODES[1].kappa * radians(degrees) ** 2 * 5.4, rel=0.03)
        assert abs(diagram.rows[2].shift) < 0.02 * abs(shifts[-1])
    assert shifts[1] / shifts[0] == pytest.approx(4.0, rel=0.01)


@pytest.mark.parametrize("number", [1, 2, 3, 4])
def test_the_corrected_rung_beats_the_linear_one(number: int) -> None:
    diagram = measure_work_precision(PAPER, 8.0, start=in_mode(number, 15.0 if number < 3 else 5.0), candidates=ENDS)
    reference, linear, corrected = diagram.rows
    assert corrected.error < 0.6 * linear.error
    assert abs(corrected.shift) < 0.1 * abs(linear.shift)
    assert reference.error == 0.0
    assert np.isnan(reference.shift)
    assert diagram.reference.whole


@pytest.fixture(scope="module", autouse=True)
def steps_for_seconds() -> Iterator[None]:
    """A clock on which a step of an integration takes 0.1 ms, however busy the machine is; each runs once.

    What numba compiles is run by Python, but where every case is run.
    """
    with usually(uncompiled, nullcontext)(), pytest.MonkeyPatch.context() as patched:
        clock = count()
        patched.setattr(module, "perf_counter", count().__next__)
        patched.setattr("nonlinear.accuracy.references.perf_counter", lambda: 1e-4 * next(clock))
        yield


@pytest.fixture(scope="module")
def short() -> WorkPrecision:
    candidates = [candidate for candidate in list_candidates(PAPER) if candidate.modal or candidate.tolerance > 1e-10]
    return measure_work_precision(PAPER, 1.5, candidates=candidates)


def test_every_family_gets_closer_with_its_tolerance(short: WorkPrecision) -> None:
    families: dict[str, list[WorkPrecisionRow]] = {}
    for row in short.rows[1:]:
        families.setdefault(row.candidate.family, []).append(row)
    assert {"minimal RK23", "minimal Radau", "minimal LSODA", "maximal DOP853"} < families.keys()
    for name, rows in families.items():
        if not rows[0].candidate.modal:
            errors = [short.measurable_error(row) for row in rows]
            assert errors == sorted(errors, reverse=True), name
            assert errors[-1] < 1e-4 * errors[0], name
            assert rows[-1].drift < 1e-7, name
            assert name.endswith("taylor") or rows[-1].calls > rows[0].calls


def test_the_front_is_beaten_by_none(short: WorkPrecision) -> None:
    for row in short.pareto:
        better = [
            r
            for r in short.rows[1:]
            if r.seconds < row.seconds and short.measurable_error(r) <= short.measurable_error(row)
        ]
        assert better == []
    row, candidate = short.rows[1], Candidate("minimal", "RK45", 1e-3)
    made = [
        replace(row, candidate=candidate, seconds=t, error=e)
        for t, e in [(1.0, 1e-2), (2.0, 1e-1), (3.0, 1e-3), (3.0, 1.0)]
    ]
    front = replace(short, rows=(short.rows[0], *made)).pareto
    assert [(point.seconds, point.error) for point in front] == [(1.0, 1e-2), (3.0, 1e-3)]
    equal = [replace(made[0], seconds=t, error=short.reference.floor * e) for t, e in [(1.0, 0.9), (2.0, 0.1)]]
    assert replace(short, rows=tuple(equal)).pareto == (equal[0],)


def test_a_chaotic_run_is_compared_up_to_its_horizon_only() -> None:
    diagram = measure_work_precision(PAPER, 60.0, candidates=(Candidate("minimal", "DOP853", 1e-9),))
    reference = diagram.reference
    assert 5.0 < reference.horizon < 30.0
    assert not reference.whole
    assert reference.difference[-1] < 1e-8
    assert 0.3 < reference.exponent < 3.0
    assert reference.floor < diagram.rows[1].error < 1.0
    assert "are compared" in tradeoff_table(diagram, "text")
    longer = np.linspace(0.0, 2 * reference.horizon, 400)
    runs = [simulate(PAPER, longer[-1], output=longer, tolerance=tolerance) for tolerance in (1e-12, 3e-13)]
    gone = apart(runs[0].motion, runs[1].motion)
    assert gone[-1] > 1e3 * gone[:200].max()


def test_a_regular_run_is_compared_whole() -> None:
    reference = reference_of(Question(PAPER, in_mode(1, 5.0), np.linspace(0.0, 20.0, 301)))
    assert reference.whole
    assert reference.floor < 1e-9
    assert reference.growth[-1] < 100


def test_references_that_disagree_at_once_judge_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    pair = Candidate("minimal", "DOP853", 1e-12), Candidate("minimal", "RK23", 1e-3)
    monkeypatch.setattr("nonlinear.accuracy.references.choose_references", lambda scene: pair)
    with pytest.raises(ComputationError, match="disagree from"):
        reference_of(Question(PAPER, initial_state(PAPER), np.linspace(0.0, 2.0, 11)))


def test_a_late_motion_is_late() -> None:
    times = np.linspace(0.0, 10.0, 501)
    start = in_mode(1, 5.0)
    exact = Candidate(LINEAR).prepare(Question(PAPER, start, times))()
    behind = superpose(PAPER, start, corrected=False)(times - 0.01)
    assert late(behind, exact) == pytest.approx(0.01, rel=5e-3)
    assert np.isnan(late(replace(behind, links=behind.links + 2.0), exact))


def test_what_no_shift_explains_is_not_late(short: WorkPrecision) -> None:
    """A motion that has died away, where an error over no velocity would be thousands of seconds."""
    pendulum = Pendulum(links=(Bob(mass=1.0, length=1.0, damping=2 * np.sqrt(9.81)),), start={"angles_deg": [60.0]})
    diagram = measure_work_precision(
        Scene(gravity=9.81, pendulum=(pendulum,)), 10.0, candidates=(Candidate("minimal", "RK23", 1e-3),)
    )
    assert diagram.rows[1].error > 1e-4
    assert np.isnan(diagram.rows[1].shift)
    certain = [row.error > short.reference.floor for row in short.rows]
    assert not all(certain)
    assert not any(np.isfinite(row.shift) for row, sure in zip(short.rows, certain, strict=True) if not sure)
    assert any(np.isfinite(row.shift) for row in short.rows)


def test_a_long_chaotic_run_is_not_computed_beyond_its_horizon(monkeypatch: pytest.MonkeyPatch) -> None:
    asked, original = [], module.reference_of

    def listening(question: Question) -> Reference:
        asked.append(question.times[-1])
        return original(question)

    monkeypatch.setattr(module, "reference_of", listening)
    diagram = measure_work_precision(PAPER, 1e300, candidates=(Candidate(LINEAR),))
    assert max(asked) < 200.0
    assert 5.0 < diagram.reference.horizon < 30.0
    assert len(diagram.reference.trajectory.times) > 100
    assert diagram.reference.duration == 1e300
    assert not diagram.reference.whole


def test_a_reference_that_takes_too_long_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "REFERENCE_PATIENCE", 1e-2)
    with pytest.raises(ComputationError, match=r"the reference was given up after .* use a shorter duration"):
        measure_work_precision(PAPER, 5.0)


def test_a_run_that_plainly_takes_too_long_is_given_up_soon(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a clock that advances by 1 s at every look, half of the patience is over at the tenth step."""
    clock = count()
    monkeypatch.setattr("nonlinear.accuracy.references.perf_counter", lambda: float(next(clock)))
    far, near = (Question(PAPER, in_mode(1, 5.0), np.linspace(0.0, end, 11), patience=20.0) for end in (1e4, 0.1))
    with pytest.raises(GivenUpError, match=r"given up after 11 s, at .* s of the motion"):
        Candidate("minimal", "RK45", 1e-6).prepare(far)()
    assert Candidate("minimal", "RK45", 1e-6).prepare(near)().times[-1] == 0.1


def test_a_twin_of_a_tiny_start_is_another_start() -> None:
    """Where 1e-9 of the motion is less than the rounding of an angle near 180 degrees."""
    upright = load("cart-upright")
    start = State(rest_angles(upright) + 1e-8, np.zeros(upright.n_links))
    system = system_of(upright)
    moved = aside(system, start, slightly(system, start)).links - start.links
    assert np.all((moved > 1e-13) & (moved < 1e-3 * 1e-8))


def test_a_reference_cut_short_without_growth_is_told_of(short: WorkPrecision) -> None:
    still = replace(short.reference, growth=np.ones_like(short.reference.growth), duration=60.0)
    text = tradeoff_table(replace(short, reference=still), "text")
    assert "only the first 1.5 s of 60 s are compared" in text
    growing = replace(still, growth=np.exp(2.0 * still.trajectory.times))
    assert "e-folding time of a small error is 0.5 s" in tradeoff_table(replace(short, reference=growing), "text")


def test_two_planes_and_back() -> None:
    start = initial_state(SPATIAL)
    along, across = (instant(part) for part in split(SPATIAL, start))
    back = join(SPATIAL, along, across)
    assert np.allclose(back.links[0], start.links, atol=1e-14)
    assert np.allclose(back.link_rates[0], start.link_rates, atol=1e-14)
    rng = np.random.default_rng(3)
    flat = State(0.8 * rng.normal(size=3), rng.normal(size=3))
    plane, none = split(SPATIAL, of_plane(flat))
    assert np.allclose([plane.links, plane.link_rates], [flat.links, flat.link_rates], atol=1e-14)
    assert np.abs([none.links, none.link_rates]).max() < 1e-14


def test_noted_in_space_are_linear() -> None:
    errors = []
    for size in (2e-2, 1e-2):
        rng = np.random.default_rng(1)
        p, rates = size * rng.normal(size=(2, 2, 3))
        moved = join(SPATIAL, *(instant(State(*parts)) for parts in zip(p, rates, strict=True)))[0]
        run = simulate(SPATIAL, 2.0, start=moved, output=41, tolerance=1e-11)
        motion = superpose(SPATIAL, moved, corrected=False)(run.times)
        errors.append(apart(motion, run.motion).max())
    assert errors[0] < 1e-3
    assert errors[0] / errors[1] == pytest.approx(8.0, rel=0.1)


def test_a_family_that_takes_too_long_is_left() -> None:
    candidates = [
        Candidate("minimal", "RK23", 1e-3),
        *(Candidate("minimal", "RK23", t) for t in (1e-10, 1e-12)),
        Candidate(LINEAR),
    ]
    diagram = measure_work_precision(PAPER, 1.0, candidates=candidates, patience=0.1)
    assert [row.candidate.name for row in diagram.rows[1:]] == ["minimal RK23 0.001", LINEAR]
    assert diagram.skipped[0][0] == "minimal RK23"
    assert "given up after 0." in diagram.skipped[0][1]
    assert not diagram.interrupted


def test_an_interrupt_keeps_what_is_done(monkeypatch: pytest.MonkeyPatch) -> None:
    original, asked, heard = (
        module.measure,
        [Candidate(LINEAR), Candidate(CORRECTED), Candidate("minimal", "RK45", 1e-3)],
        [],
    )

    def impatient(candidate: Candidate, *rest: object) -> WorkPrecisionRow:
        if candidate.kind == CORRECTED:
            raise KeyboardInterrupt
        return original(candidate, *rest)

    monkeypatch.setattr(module, "measure", impatient)
    diagram = measure_work_precision(PAPER, 1.0, candidates=asked, report=heard.append)
    assert [row.candidate.name for row in diagram.rows[1:]] == [LINEAR]
    assert diagram.interrupted
    assert [name for name, _ in diagram.skipped] == [CORRECTED, "minimal RK45 0.001"]
    assert heard == sorted(heard)
    assert 0 < heard[0] < 1
    assert heard[-1] == 2


def test_an_interrupt_between_rungs_keeps_them_too() -> None:
    def stopping(done: float) -> None:
        if done == 2:
            raise KeyboardInterrupt

    diagram = measure_work_precision(PAPER, 1.0, candidates=ENDS, report=stopping)
    assert [row.candidate.name for row in diagram.rows[1:]] == [LINEAR]
    assert diagram.skipped == ((CORRECTED, "interrupted"),)


def test_tables(short: WorkPrecision) -> None:
    text = tradeoff_table(short, "text")
    for words in (
        "time (ms)",
        "error (rad)",
        "late (s)",
        "checked against",
        "all 1.5 s are compared",
        "modulo whole turns",
    ):
        assert words in text
    assert tradeoff_table(short, "markdown").startswith("**Two double pendula")
    rows = list(csv.DictReader(io.StringIO(tradeoff_table(short, "csv"))))
    assert len(rows) == len(short.rows)
    assert float(rows[1]["error_rad"]) == short.rows[1].error
    assert {"seconds", "prepared_seconds", "derivatives", "late_s", "energy_drift", "pareto"} < rows[0].keys()
    whole = json.loads(tradeoff_table(short, "json"))
    assert whole["horizon_s"] == 1.5
    assert whole["rungs"][0]["certain"] is False
    lost = replace(short, rows=(replace(short.rows[1], shift=nan, drift=nan),))
    assert json.loads(tradeoff_table(lost, "json"))["rungs"][0]["late_s"] is None
    assert "–" in tradeoff_table(lost, "text")


def test_the_picture(short: WorkPrecision) -> None:
    stream = io.BytesIO()
    save(tradeoff_figure(short), stream, "svg")
    assert b"<svg" in stream.getvalue()
    with pytest.raises(ComputationError, match="nothing to draw"):
        save(tradeoff_figure(replace(short, rows=short.rows[:1])), stream, "png")


@pytest.mark.parametrize(
    ("kind", "refused"),
    [
        ("joint_friction", {LINEAR, "maximal DOP853", "minimal RK45", "minimal taylor"}),
        ("rail_coefficient", {LINEAR, "maximal DOP853", "minimal RK45", "minimal taylor"}),
        ("escapement", {"maximal DOP853", "minimal RK45", "minimal taylor"}),
        ("hoist_and_drag", {LINEAR, "minimal taylor"}),
        ("moved_vertical_and_drag", {LINEAR, "minimal taylor"}),
    ],
)
def test_methods_are_compared_on_every_kind_of_scene(kind: str, refused: set[str]) -> None:
    """By references of two kinds; what does not take the scene is omitted with the reason."""
    tight = [Candidate("minimal", method, 1e-9) for method in ("DOP853", "RK45")]
    asked = [Candidate(LINEAR), *tight, Candidate("maximal", "DOP853", 1e-9)]
    if find_spec("heyoka") or "minimal taylor" in refused:
        asked.append(Candidate("minimal", "taylor", 1e-9))
    diagram = measure_work_precision(load(KINDS / f"{kind}.toml"), 0.5, candidates=asked, patience=60.0)
    assert diagram.reference.whole
    assert diagram.reference.floor < 1e-7
    left = {family for family, _ in diagram.skipped} - {"minimal taylor"} | {"minimal taylor"} & refused
    assert left == refused
    tight = [candidate for candidate in tight if candidate.family not in refused]
    rows = [row for row in diagram.rows if row.candidate in tight]
    assert [row.candidate for row in rows] == tight
    for row in rows:
        assert diagram.measurable_error(row) < 1e-7
        assert abs(row.drift) < 1e-7
