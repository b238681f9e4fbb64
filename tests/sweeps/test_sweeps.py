"""Sweeps: what is varied, who measures, what is kept, and how all of it is refused."""

from __future__ import annotations

import io
import json
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import product
from math import inf, isnan, pi, sqrt
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
import sweep_measures
from forged import forged, with_record

from modal import Bob, Cart, ComputationError, Fixed, Pendulum, Scene, SceneError, load, matrices, natural_modes
from modal.errors import MissingExtraError
from modal.extend import registered, registration
from modal.extend.measures import taken_by
from modal.plotting import save
from modal.scene import InitialCondition
from modal.scene.parameters import (
    VARIED_VALUES_MAX,
    Variation,
    find_places,
    parse_variations,
    validate_variations,
    vary,
    with_numbers,
)
from nonlinear.ensembles import WorkerPool
from nonlinear.ensembles.cluster import cluster
from nonlinear.plotting.sweeps import label, sweep_figure
from nonlinear.simulation import simulate
from nonlinear.sweeps import Study, Sweep, open_checkpoint, parse_measures, sweep
from nonlinear.sweeps import files as sweep_files
from nonlinear.sweeps.measures import RequestedMeasure
from nonlinear.sweeps.running import DIED
from nonlinear.sweeps.study import POINTS_MAX, Row

PAPER = load("paper-cart-2")
G = 9.81
MASSES = "support.mass=1,2,3,4,5,6"


@pytest.fixture(autouse=True)
def _log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SWEEP_LOG", str(tmp_path / "log"))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(sys.path))


def study(*texts: str, measure: RequestedMeasure = sweep_measures.PRODUCT, number: float = 2.0) -> Study:
    return Study(PAPER, parse_variations(texts or [MASSES]), (replace(measure, number=number),))


# --------------------------------------------------------------------------------------------------- variations


def test_values_are_lists_ranges_and_ratios() -> None:
    linear, ratios, listed, single = parse_variations(
        ["gravity=1:2:5", "support.mass=1:1000:4log", "support.damping=0,.5,1e1", "support.stiffness=3"]
    )
    assert linear.values == (1.0, 1.25, 1.5, 1.75, 2.0)
    assert np.allclose(ratios.values, (1, 10, 100, 1000), rtol=1e-14)
    assert (ratios.values[0], ratios.values[-1]) == (1.0, 1000.0)
    assert (linear.log, ratios.log) == (False, True)
    assert listed.values == (0.0, 0.5, 10.0)
    assert single.values == (3.0,)
    assert [v.unit for v in (linear, ratios, listed, single)] == ["m/s²", "kg", "N s/m", "N/m"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("support.mass", "must be PLACE=VALUES"),
        ("support.mass=1:2:0", "from 2 to"),
        ("support.mass=1:2:1", "from 2 to"),
        (f"support.mass=1:2:{VARIED_VALUES_MAX + 1}", "from 2 to"),
        ("support.mass=1:2:99999999999", "a range has from 2 to"),
        ("support.mass=2:1:5", "from a smaller to a larger"),
        ("support.mass=1:1:5", "from a smaller to a larger"),
        ("support.mass=1:nan:5", "from a smaller to a larger"),
        ("support.mass=1:inf:5", "from a smaller to a larger"),
        ("support.mass=1:1e300:5", "from a smaller to a larger"),
        ("support.mass=0:1:5log", "begins above 0"),
        ("support.mass=-1:1:5log", "begins above 0"),
        ("support.mass=1:2", "a range is"),
        ("support.mass=1:2:3:4", "a range is"),
        ("support.mass=1:2:3lin", "a range is"),
        ("support.mass=", "is not a number"),
        ("support.mass=1,,2", "is not a number"),
        ("support.mass=1_0", "is not a number"),
        ("support.mass=2**3", "is not a number"),
        ("support.mass=nan", "must be finite"),
        ("support.mass=3,2,1", "ascending"),
        ("support.mass=1,1", "ascending"),
        ("support.mass=1:1.0000000000000002:9", "ascending"),
        ("__import__('os').x=1", "is not a place"),
        ("support.__class__=1", "is not a number of this scene"),
        ("support.mas=1", "did you mean support.mass"),
        ("pendulum[2].count=1", "did you mean pendulum"),
        ("pendulum[0].links[0].centre=1", "is not a number of this scene"),
        ("pendulum[-1].count=1", "is not a place"),
        ("pendulum=1", "is not a number of this scene"),
        ("support.kind=1", "is not a number of this scene"),
        ("title[*]=1", "is not a number of this scene"),
        ("support.mass=-1:1:3", r"support.mass = -1.0: must not be negative"),
        ("pendulum[0].links[0].mass=0:1:3", r"links\[0\].mass = 0.0: must be positive"),
        ("pendulum[*].count=1:2:3", r"pendulum\[1\].count = 1.5: must be a whole number"),
    ],
)
def test_bad_variations_are_refused(text: str, words: str) -> None:
    with pytest.raises(SceneError, match=words):
        validate_variations(PAPER, parse_variations([text]))


def test_a_start_that_no_pendulum_has_cannot_be_varied() -> None:
    with pytest.raises(SceneError, match=r"is not a number of this scene: its file gives no pendulum a `start`"):
        validate_variations(load("rope"), parse_variations(["pendulum[0].start.angles_deg[0]=1:2:3"]))
    with pytest.raises(SceneError, match="did you mean"):
        validate_variations(PAPER, parse_variations(["pendulum[0].start.angle_deg[0]=1:2:3"]))


def test_all_mistakes_are_named_at_once() -> None:
    with pytest.raises(SceneError) as caught:
        parse_variations(["support.mass=1:2:0", "gravity=x", "gravity=1"])
    assert len(caught.value.problems) == 2
    with pytest.raises(SceneError) as caught:
        Study(
            PAPER, parse_variations(["support.mas=1", "pendulum[*].count=1.5", "pendulum[0].count=2", "gravity=0"]), ()
        )
    assert len(caught.value.problems) == 7, caught.value.problems


def test_one_value_goes_to_every_place_that_a_path_means() -> None:
    assert [with_numbers(place) for place in find_places(PAPER, "pendulum[*].links[*].damping")] == [
        f"pendulum[{k}].links[0].damping" for k in (0, 1)
    ]
    many = Scene(gravity=9.81, pendulum=(Pendulum(links=(Bob(mass=1.0, length=1.0),) * 3),) * 2)
    changed = vary(many, {"pendulum[*].links[1].damping": 0.5, "gravity": 2.0})
    assert [link.damping for link in changed.links()] == [0, 0.5, 0, 0, 0.5, 0]
    assert changed.gravity == 2.0
    assert many.gravity == 9.81
    assert vary(PAPER, {"pendulum[1].count": 3.0}).n_pendula == 4
    assert vary(PAPER, {"pendulum[0].start.angles_deg[1]": 7.0}).pendulum[0].start.angles_deg == (90, 7)
    assert vary(PAPER, {}) == PAPER


def test_a_variation_in_python_is_checked_too() -> None:
    for path, values, log in [("a b", (1.0,), False), ("gravity", (), False), ("gravity", (-1.0, 1.0), True)]:
        with pytest.raises(SceneError):
            Variation(path, values, log)


# ----------------------------------------------------------------------------------------------------- measures


def test_measures_of_the_paper_s_cart() -> None:
    """Published in the design: ω = 2.68011401, 2.71754912, 7.18867087, 7.20947810 rad/s; beats 167.8 s and 302.0 s."""
    frequencies, beat, upper, gap, ratio = (
        measure.of(PAPER) for measure in parse_measures(["frequencies", "beat", "beat:4", "splitting", "damping:2"])
    )
    expected = [2.68011401, 2.71754912, 7.18867087, 7.20947810]
    assert list(frequencies.values()) == pytest.approx(expected, rel=3e-9)
    assert list(frequencies) == [f"omega_{k}_rad_per_s" for k in (2, 3, 4, 5)]
    assert beat == {"beat_2_s": pytest.approx(167.8, abs=0.05)}
    assert upper == {"beat_4_s": pytest.approx(302.0, abs=0.05)}
    assert gap["splitting_2_rad_per_s"] * beat["beat_2_s"] == pytest.approx(2 * pi, rel=1e-12)
    assert ratio == {"damping_ratio_2": 0.0, "damping_ratio_3": 0.0}


def test_equal_frequencies_count_each() -> None:
    twins = Scene(gravity=9.81, support=Fixed(), pendulum=(Pendulum(links=(Bob(mass=1.0, length=1.0),), count=2),))
    detuned = Scene(gravity=9.81, support=Fixed(), pendulum=(Pendulum(links=(Bob(mass=1.0, length=1.1),)),))
    unequal = twins.replace(pendulum=(twins.pendulum[0].replace(count=1), *detuned.pendulum))
    assert parse_measures(["beat"])[0].of(twins, unequal) == {"beat_1_s": inf}
    assert list(parse_measures(["frequencies:9"])[0].of(twins)) == ["omega_1_rad_per_s", "omega_1b_rad_per_s"]
    assert list(parse_measures(["frequencies:9"])[0].of(twins, unequal)) == ["omega_1_rad_per_s", "omega_2_rad_per_s"]
    with pytest.raises(ComputationError, match="no mode oscillates after mode 1 of the table: 2 modes"):
        parse_measures(["splitting"])[0].of(twins)
    with pytest.raises(ComputationError, match="mode 2 of the table does not oscillate: 2 modes"):
        parse_measures(["splitting:2"])[0].of(twins)
    with pytest.raises(ComputationError, match="1 mode oscillates"):
        parse_measures(["beat"])[0].of(load("chain-1"))


def test_damping_of_one_pendulum() -> None:
    """m l² θ'' + c θ' + m g l θ = 0: ζ = c/(2 m l² ω)."""
    link = Bob(mass=2.0, length=0.5, damping=0.1)
    scene = Scene(gravity=9.81, pendulum=(Pendulum(links=(link,)),))
    expected = 0.1 / (2 * 2.0 * 0.25 * sqrt(9.81 / 0.5))
    assert parse_measures(["damping"])[0].of(scene) == {"damping_ratio_1": pytest.approx(expected, rel=1e-12)}


def test_a_dragged_cart_s_creep_is_not_counted() -> None:
    ratios = parse_measures(["damping:9"])[0].of(load("metronomes"))
    assert all(ratio < 0.5 for ratio in ratios.values())


def test_measures_of_runs_are_those_of_the_trajectory() -> None:
    scene = load("crane-two-loads")
    run = simulate(scene, 3.0)
    measured = {
        column: number
        for request in parse_measures(["largest_angle:3", "cart_travel:3", "energy_drift:3"])
        for column, number in request.of(scene).items()
    }
    assert measured["largest_angle_deg"] == pytest.approx(np.degrees(np.abs(run.motion.links).max()), rel=1e-3)
    assert measured["cart_travel_m"] == pytest.approx(np.ptp(run.motion.cart), rel=1e-3)
    assert measured["energy_drift"] == run.energy_drift()
    leaning = load("chain-spatial")
    first = max(leaning.pendulum[0].start.angles_deg)
    assert parse_measures(["largest_angle:0.01"])[0].of(leaning)["largest_angle_deg"] == pytest.approx(first, rel=1e-2)


@pytest.mark.parametrize("damping", [0.5, 2.0, 5.0])
def test_damped_modes_beat_with_the_imaginary_parts(damping: float) -> None:
    """Joint dampers slow what swings and leave |λ| nearly alone: beats go with Im λ, of the state matrix here."""
    scene = Scene(gravity=9.81, support=Cart(mass=20.0), pendulum=[pendulum(2, damping)])
    written, n = matrices(scene), 3
    inverse = np.linalg.inv(written.M)
    state = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ written.K, -inverse @ written.D]])
    values = np.linalg.eigvals(state)
    first, second = np.sort(values[values.imag > 1e-6].imag)[:2]
    (splitting,), (beat,) = (parse_measures([name])[0].of(scene).values() for name in ("splitting", "beat"))
    assert splitting == pytest.approx(second - first, rel=1e-9)
    assert beat == pytest.approx(2 * pi / (second - first), rel=1e-9)
    sizes = np.sort(np.abs(values[values.imag > 1e-6]))
    assert damping < 5 or sizes[1] - sizes[0] != pytest.approx(second - first, rel=0.2)


def pendulum(count: int, damping: float) -> Pendulum:
    return Pendulum(links=[Bob(mass=1.0, length=1.0, damping=damping)], count=count)


@pytest.mark.parametrize("space", ["plane", "space"])
def test_the_amplitude_is_that_of_the_turning_point(space: Literal["plane", "space"]) -> None:
    """Energy shows it: cos θ = cos θ₀ − l θ₀'²/2g on a fixed support, where a whole turn would leave 180°."""
    start = InitialCondition(angles_deg=(20.0,), rates_deg=(180.0,), azimuths_deg=(35.0,) if space == "space" else None)
    scene = Scene(gravity=G, space=space, pendulum=(Pendulum(links=(Bob(mass=1.0, length=1.0),), start=start),))
    highest = np.degrees(np.arccos(np.cos(np.radians(20)) - np.pi**2 / (2 * G)))
    for seconds in ("10", "31"):
        measured = parse_measures([f"largest_angle:{seconds}"])[0].of(scene)
        assert measured["largest_angle_deg"] == pytest.approx(highest, rel=1e-7)


def test_the_travel_is_that_between_turning_points() -> None:
    """Let go at rest, what hangs from a free cart swings to the other side as far, and the centre of mass stays."""
    pendulum = Pendulum(links=(Bob(mass=1.0, length=1.0),), start=InitialCondition(angles_deg=(50.0,)))
    scene = Scene(gravity=G, support=Cart(mass=3.0), pendulum=(pendulum,))
    measured = parse_measures(["cart_travel:7"])[0].of(scene)
    assert measured["cart_travel_m"] == pytest.approx(2 * np.sin(np.radians(50)) / 4, rel=1e-7)


@pytest.mark.parametrize("text", ["", "frequency", "beat:0", "beat:1.5", "beat:x", "beat:nan", "beat:-1", "beat:1e9"])
def test_bad_measures_are_refused(text: str) -> None:
    with pytest.raises(SceneError, match=r"measure|must have a whole|is not a number"):
        parse_measures([text])


def test_every_measure_has_words_and_a_usual_number() -> None:
    assert tuple(request.name for request in parse_measures(taken_by("sweep"))) == taken_by("sweep")
    assert all(measure.words and measure.columns and measure.needs for measure in registered("measure").values())
    with pytest.raises(SceneError, match="requested twice"):
        parse_measures(["frequencies", "frequencies:4"])
    with pytest.raises(SceneError, match="largest_angle is requested twice"):
        parse_measures(["largest_angle:1", "largest_angle:2"])


# ------------------------------------------------------------------------------------------------------- sweeps


def test_a_grid_is_the_direct_loop() -> None:
    asking = Study(
        PAPER, parse_variations(["support.mass=1:100:3log", "gravity=1,9.81"]), parse_measures(["frequencies:2"])
    )
    swept = sweep(asking, workers=1)
    assert swept.complete
    assert not swept.failures
    grid = swept.values("omega_2_rad_per_s")
    assert grid.shape == (3, 2)
    axes = [variation.values for variation in asking.variations]
    for (i, mass), (j, gravity) in product(enumerate(axes[0]), enumerate(axes[1])):
        direct = natural_modes(vary(PAPER, {"support.mass": mass, "gravity": gravity}))
        assert grid[i, j] == pytest.approx(direct.omega[1], rel=5e-16)


def test_points_run_with_the_last_axis_fastest() -> None:
    swept = sweep(study("support.mass=1,2,3", "support.damping=0,10", "gravity=5,6"), workers=1)
    expected = [[[2 * mass + damping] * 2 for damping in (0, 10)] for mass in (1, 2, 3)]
    assert np.array_equal(swept.values("product_kg"), expected)
    assert swept.study.point(5) == {"support.mass": 2, "support.damping": 0, "gravity": 6}


def test_a_point_that_fails_hurts_no_other() -> None:
    swept = sweep(study(measure=sweep_measures.FAILING, number=3.0), workers=1)
    assert swept.failures == {2: "RuntimeError: nothing to see"}
    assert isnan(swept.values("product_kg")[2])
    assert np.array_equal(np.delete(swept.values("product_kg"), 2), [1, 2, 4, 5, 6])
    crossed = sweep(study("pendulum[0].links[0].count=1,2", "support.mass=1,2"), workers=1)
    assert list(crossed.failures) == [0, 1]
    assert "angles_deg: has 2 values for 1 links" in crossed.failures[0]


def test_a_point_whose_time_is_too_short_hurts_no_other() -> None:
    lengths = parse_variations(["pendulum[0].links[0].length=1,50"])
    asking = Study(load("chain-1"), lengths, parse_measures(["lyapunov:10"]))
    swept = sweep(asking, workers=1)
    assert list(swept.failures) == [1]
    assert "must be at least 45.2 s for this scene" in swept.failures[1]
    assert np.isfinite(swept.values("lyapunov_per_s")[0])


def test_a_point_that_kills_its_process_is_found_and_the_rest_is_measured() -> None:
    frequencies = parse_measures(["frequencies:2"])
    asking = study("support.mass=1,2,3,4", measure=sweep_measures.DYING, number=3.0)
    swept = sweep(Study(PAPER, asking.variations, (*asking.measures, *frequencies)), workers=2)
    assert swept.failures == {2: DIED}
    here = sweep(Study(PAPER, asking.variations, frequencies), workers=1).values("omega_2_rad_per_s")
    assert np.array_equal(np.delete(swept.values("omega_2_rad_per_s"), 2), np.delete(here, 2))
    assert np.array_equal(np.delete(swept.values("product_kg"), 2), [1, 2, 4])


def test_progress_is_told() -> None:
    heard: list[float] = []
    sweep(study(), workers=1, report=heard.append)
    assert heard == sorted(set(heard))
    assert (heard[0], heard[-1]) == (0, 6)


def test_what_cannot_be_a_study() -> None:
    thousand = ["support.mass=1:2:1001", "support.damping=1:2:1000"]
    for texts, words in [
        ([], "1 to 3 variations"),
        (["gravity=1", "support.mass=1", "support.damping=1", "support.stiffness=1"], "1 to 3 variations"),
        (thousand, f"at most {POINTS_MAX}"),
        (["gravity=1:2:2", "gravity=1:2:2"], "gravity: is varied twice"),
        (["pendulum[*].count=1", "pendulum[1].count=1"], r"pendulum\[1\].count: is varied twice"),
    ]:
        with pytest.raises(SceneError, match=words):
            Study(PAPER, parse_variations(texts), parse_measures(["beat"]))
    with pytest.raises(SceneError, match="needs a measure"):
        Study(PAPER, parse_variations([MASSES]), ())


# ------------------------------------------------------------------------------------------------------ journal


def run_with_journal(path: Path, asking: Study, workers: int = 1) -> Sweep:
    with open_checkpoint(path, asking) as kept:
        return sweep(asking, journal=kept, workers=workers)


def test_ctrl_c_keeps_what_is_done_and_the_rest_is_done_later(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asking, path = study(measure=sweep_measures.INTERRUPTED, number=4.0), tmp_path / "s.journal"
    monkeypatch.setenv("SWEEP_INTERRUPTS", "1")
    cut = run_with_journal(path, asking)
    assert cut.interrupted
    assert [row.index for row in cut.rows] == [0, 1, 2]
    assert sweep_measures.logged() == ["1", "2", "3"]
    monkeypatch.delenv("SWEEP_INTERRUPTS")
    whole = run_with_journal(path, asking)
    assert whole.complete
    assert not whole.interrupted
    assert sweep_measures.logged() == ["1", "2", "3", "4", "5", "6"]
    assert whole.rows == sweep(asking, workers=1).rows


def test_a_torn_line_is_dropped_and_failures_are_tried_again(tmp_path: Path) -> None:
    path = tmp_path / "s.journal"
    first = run_with_journal(path, study(measure=sweep_measures.FAILING, number=3.0))
    assert len(sweep_measures.logged()) == 5
    path.write_bytes(path.read_bytes()[:-4])
    again = run_with_journal(path, study(measure=sweep_measures.FAILING, number=3.0))
    assert sweep_measures.logged()[5:] == ["6"]
    assert again.rows == first.rows
    with open_checkpoint(path, study(number=9.0), fresh=True) as kept:
        assert kept.rows == ()
    path.write_bytes(path.read_bytes()[:20])
    assert run_with_journal(path, study(measure=sweep_measures.FAILING, number=3.0)).rows == first.rows
    assert len(sweep_measures.logged()) == 11


@pytest.mark.parametrize("varied", ["gravity=9:10:140", "start.energy=1:9:300"])
def test_rows_depend_on_the_study_alone(varied: str, tmp_path: Path) -> None:
    """Not on how many compute them, nor on which a sweep that was killed has left: to the last bit."""
    measures = parse_measures(["largest_angle:0.5", "first_turn:0.5"])
    asking = Study(load("chain-2"), parse_variations([varied]), measures, 2 if "energy" in varied else 0)
    assert 1 < asking.chunk < asking.size
    alone = run_with_journal(tmp_path / "alone", asking)
    assert not alone.failures
    with ThreadPoolExecutor(2) as threads:
        assert sweep(asking, crew=WorkerPool(threads, 2)).rows == alone.rows
    head, *lines = (tmp_path / "alone").read_bytes().splitlines(keepends=True)
    (tmp_path / "killed").write_bytes(head + b"".join(lines[5:-1:3]) + lines[-1][:20])
    assert run_with_journal(tmp_path / "killed", asking, workers=2).rows == alone.rows


def test_a_full_disk_is_named(tmp_path: Path) -> None:
    resource = pytest.importorskip("resource")
    path, before = tmp_path / "j", resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (256, before[1]))
    try:
        with pytest.raises(OSError, match="File too large") as caught:
            run_with_journal(path, study("support.mass=1:2:100", measure=sweep_measures.PRODUCT))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert caught.value.filename == str(path)


def test_numbers_survive_the_journal_bit_for_bit(tmp_path: Path) -> None:
    asking = Study(PAPER, parse_variations(["support.mass=1:7:3"]), parse_measures(["frequencies", "beat"]))
    first = run_with_journal(tmp_path / "j", asking)
    with open_checkpoint(tmp_path / "j", asking) as kept:
        assert kept.rows == first.rows


def test_a_journal_of_another_sweep_is_refused(tmp_path: Path) -> None:
    path, asking = tmp_path / "s.journal", study()
    run_with_journal(path, asking)
    content = path.read_bytes()
    heavier = vary(PAPER, {"pendulum[0].links[0].mass": 1.5})
    others = (
        Study(heavier, asking.variations, asking.measures),
        study("support.mass=1,2,3,4,5,7"),
        study(number=3.0),
        study(measure=sweep_measures.FAILING),
    )
    for other in others:
        with pytest.raises(SceneError, match="belongs to another sweep"):
            run_with_journal(path, other)
    for text, words in [
        (b"precious text\n", "is not the journal"),
        (b"precious text", "is not the journal"),
        (content + b"[1]\n", "line 8 is damaged"),
        (content + b'[99, {}, ""]\n', "line 8 is damaged"),
        (content + b'[true, {"a": "x"}, ""]\n', "line 8 is damaged"),
    ]:
        path.write_bytes(text)
        with pytest.raises(SceneError, match=words):
            run_with_journal(path, asking)
        assert path.read_bytes() == text
    path.write_bytes(b"precious text")
    with pytest.raises(SceneError, match="is not the journal"), open_checkpoint(path, asking, fresh=True):
        pass


SCRIPT = """
import sys
from dataclasses import replace
import sweep_measures
from modal import load
from modal.scene.parameters import parse_variations
from nonlinear.sweeps.checkpoint import open_checkpoint
from nonlinear.sweeps import Study
from nonlinear.sweeps import sweep

if __name__ == "__main__":
    axes, measures = parse_variations(["support.mass=1:400:400"]), (replace(sweep_measures.SLOW, number=0.05),)
    study = Study(load("paper-cart-2"), axes, measures)
    with open_checkpoint(sys.argv[1], study) as kept:
        found = sweep(study, journal=kept, workers=2)
    print("interrupted", found.interrupted, len(found.rows))
"""


@pytest.mark.skipif(sys.platform == "win32", reason="SIGINT is sent otherwise there")
@pytest.mark.parametrize("done", [0, 60])
def test_ctrl_c_ends_worker_processes_at_once(done: int, tmp_path: Path) -> None:
    """While they are starting as well as at work, and none of them says a word."""
    (tmp_path / "script.py").write_text(SCRIPT)
    command = [sys.executable, str(tmp_path / "script.py"), str(tmp_path / "j")]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as running:
        deadline = time.monotonic() + 600
        while not (tmp_path / "j").exists() or len(sweep_measures.logged()) < done:
            assert time.monotonic() < deadline
            assert running.poll() is None
            time.sleep(0.05)
        time.sleep(0.4)
        os.killpg(running.pid, signal.SIGINT)
        out, err = running.communicate(timeout=600)
    assert running.returncode == 0, err
    assert out.startswith("interrupted True")
    assert err == ""
    kept = len((tmp_path / "j").read_text().splitlines()) - 1
    assert kept == int(out.split()[-1])
    assert kept < 400
    assert kept > 0 or not done


def test_a_script_without_a_guard_is_told_so(tmp_path: Path) -> None:
    (tmp_path / "script.py").write_text(SCRIPT.replace('if __name__ == "__main__":', "if True:"))
    command = [sys.executable, str(tmp_path / "script.py"), str(tmp_path / "j")]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=600)
    assert done.returncode == 1
    assert "worker processes cannot start" in done.stderr.splitlines()[-1]


# -------------------------------------------------------------------------------------------------------- files


def both_ways() -> list[Sweep]:
    grid = Study(
        PAPER, parse_variations(["support.mass=1:10:3log", "gravity=1,2"]), parse_measures(["frequencies:2", "beat"])
    )
    whole = sweep(grid, workers=1)
    failing = sweep(study(measure=sweep_measures.FAILING, number=3.0), workers=1)
    partial = Sweep(whole.study, whole.rows[1:4], interrupted=True)
    return [whole, failing, partial]


@pytest.mark.parametrize("kind", ["npz", "csv"])
def test_what_is_read_is_what_was_saved(kind: str, tmp_path: Path) -> None:
    with registration(sweep_measures.Failing):
        for saved in both_ways():
            path = tmp_path / f"s.{kind}"
            sweep_files.save(saved, path)
            read = sweep_files.load(path)
            assert (read.study, read.rows, read.interrupted) == (saved.study, saved.rows, saved.interrupted)
            assert read.columns == saved.columns


def test_files_name_axes_and_units(tmp_path: Path) -> None:
    whole = both_ways()[0]
    sweep_files.save(whole, tmp_path / "s.csv")
    names, *rows = (tmp_path / "s.csv").read_text().splitlines()
    assert json.loads((tmp_path / "s.csv.json").read_text())["multipendula_sweep"]["scene"]["gravity"] == 9.81
    assert names == "support.mass_kg,gravity_m_per_s2,omega_2_rad_per_s,omega_3_rad_per_s,beat_2_s,reason"
    assert len(rows) == 6
    assert rows[1].startswith("1.0,2.0,")
    sweep_files.save(whole, tmp_path / "s.npz")
    data = np.load(tmp_path / "s.npz")
    assert np.allclose(data["support.mass_kg"], [1, sqrt(10), 10], rtol=1e-14)
    assert data["beat_2_s"].shape == (3, 2)


def test_files_and_journals_of_earlier_are_read(tmp_path: Path) -> None:
    written = Path(__file__).parent / "written"
    whole, table = (sweep_files.load(written / name) for name in ("sweep.npz", "sweep.csv"))
    path = tmp_path / "sweep.npz.journal"
    path.write_bytes((written / path.name).read_bytes())
    with open_checkpoint(path, whole.study) as kept:
        assert kept.rows == whole.rows == table.rows
    again = sweep(whole.study, workers=1)
    assert again.columns == whole.columns
    for name in whole.columns:
        assert np.allclose(again.values(name), whole.values(name), rtol=1e-9), name


def test_other_files_are_refused_in_one_line(tmp_path: Path) -> None:
    whole = both_ways()[0]
    for kind in ("npz", "csv"):
        sweep_files.save(whole, tmp_path / f"good.{kind}")
    text = with_record(tmp_path / "good.csv").decode()
    files = {
        "empty.npz": b"",
        "empty.csv": b"",
        "torn.npz": (tmp_path / "good.npz").read_bytes()[:-100],
        "other.csv": b"a,b\n1,2\n",
        "short.csv": "\n".join(text.splitlines()[:-1]).encode(),
        "words.csv": text.replace("beat_2_s,", "beat,").encode(),
        "letters.csv": text.replace(text.splitlines()[3].split(",")[2], "abc").encode(),
        "measure.csv": text.replace('"beat"', '"beet"').encode(),
        "axes.csv": text.replace('"path": "gravity"', '"path": "gravitas"').encode(),
        "binary.csv": b"\xff\xfe\x00",
    }
    for name, content in files.items():
        (tmp_path / name).write_bytes(forged(content))
        with pytest.raises(SceneError) as caught:
            sweep_files.load(tmp_path / name)
        assert len(caught.value.problems) == 1, name
        assert str(tmp_path / name) in caught.value.problems[0]
    for name in ("missing.npz", "s.json"):
        with pytest.raises(SceneError, match=name):
            sweep_files.load(tmp_path / name)


# ------------------------------------------------------------------------------------------------------ figures


def test_curves_and_maps_are_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    whole, failing, _ = both_ways()
    for swept in (whole, failing):
        stream = io.BytesIO()
        save(sweep_figure(swept), stream, "png")
        assert stream.getvalue().startswith(b"\x89PNG")
    assert (label("omega_2b_rad_per_s"), label("beat_1_s")) == ("ω₂b (rad/s)", "beat of mode 1 (s)")
    assert (label("survivor_share"), label("omega_2_rad_per_s")) == ("its share of the energy (–)", "ω₂ (rad/s)")
    nothing = Sweep(whole.study, ())
    cube = Sweep(study("support.mass=1,2", "gravity=1,2", "support.damping=1,2"), failing.rows)
    for bad, words in [(nothing, "nothing to draw"), (cube, "one or two parameters")]:
        with pytest.raises(ComputationError, match=words):
            save(sweep_figure(bad), io.BytesIO(), "png")


def test_every_column_of_maps_has_its_axis_and_whole_numbers_have_ticks_of_their_own() -> None:
    asking = study("support.mass=1,2", "gravity=1,2")
    numbers = ("first", "second", "third", "fourth")
    rows = tuple(Row(k, dict.fromkeys(numbers, k + 0.5) | {"row": 2.0 + k % 2}) for k in range(4))
    figure = sweep_figure(Sweep(asking, rows))
    figure.canvas.draw()
    maps, bars = figure.axes[:5], figure.axes[5:]
    assert [bool(axis.get_xlabel()) for axis in maps] == [False, False, False, True, True]
    assert all(any(text.get_text() for text in axis.get_xticklabels()) for axis in maps[3:])
    assert [text.get_text() for text in bars[4].get_yticklabels()] == ["2", "3"]


# ------------------------------------------------------------------------------------------------------ cluster


def test_without_distributed_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(MissingExtraError, match=r"\.\[cluster\]"), cluster("tcp://127.0.0.1:1"):
        pass


@pytest.mark.filterwarnings("ignore")
def test_a_cluster_measures_what_this_process_does(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    asking = Study(PAPER, parse_variations(["support.mass=1:100:9log"]), parse_measures(["frequencies:2"]))
    with (
        distributed.LocalCluster(
            n_workers=1, threads_per_worker=2, processes=True, dashboard_address=None, local_directory=str(tmp_path)
        ) as local,
        cluster(local.scheduler_address, patience=600.0) as crew,
    ):
        assert crew.size == 2
        heard: list[float] = []
        there = sweep(asking, crew=crew, report=heard.append)
        failing = sweep(study(measure=sweep_measures.FAILING, number=3.0), crew=crew)
    assert there.rows == sweep(asking, workers=1).rows
    assert heard[-1] == 9
    assert list(failing.failures) == [2]


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "nonsense", "ftp://a:b"])
def test_no_scheduler_is_said(address: str) -> None:
    pytest.importorskip("distributed")
    with pytest.raises(ComputationError, match="no scheduler responds"), cluster(address, patience=0.5):
        pass


def test_rows_that_are_compared_hold_no_nan() -> None:
    assert not any(isnan(value) for swept in both_ways() for row in swept.rows for value in row.numbers.values())


@pytest.mark.parametrize("workers", [0, -1, 1.5, float("nan"), "2", True])
def test_a_number_of_workers_that_is_none_is_named(workers: object) -> None:
    study = Study(load("chain-1"), parse_variations(["gravity=1:2:2"]), parse_measures(["frequencies"]))
    with pytest.raises(SceneError, match=f"^workers {workers!r}: must be a whole number"):
        sweep(study, workers=workers)  # type: ignore[arg-type]
