"""Who keeps time with whom: prediction and simulation compared, in words, numbers, a picture and a film."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from math import pi
from pathlib import Path
from typing import Any

import floquet
import numpy as np
import pytest
from PIL import Image

from modal import load
from modal.errors import ComputationError
from modal.modes import table_numbers
from modal.scene import Scene, scene_from
from modal.scene.parameters import vary
from multipendula.cli import main
from nonlinear.averaging import Prediction, RelativeEquilibrium, average, predict, relative_equilibria
from nonlinear.plotting import SECONDS, strobe
from nonlinear.plotting.animation import STROBE_FRAMES
from nonlinear.simulation import simulate
from nonlinear.synchronization import (
    SynchronizationStudy,
    agreement,
    phases_of,
    study_synchronization,
    sync_record,
    sync_text,
)
from nonlinear.synchronization.patterns import own_amplitudes
from nonlinear.synchronization.study import PERIODS_MAX, usual_duration
from nonlinear.system import state_at_rest

VAN_DER_POL = {"kind": "van-der-pol", "strength": 0.05, "angle_deg": 5.0}
ESCAPEMENT = {"kind": "escapement", "impulse": 0.01, "angle_deg": 2.0}
FILE = """
title = "Two clocks"
gravity = 9.81
support = {{ kind = "cart", mass = 50.0, damping = 1.0 }}
[[pendulum]]
links = [{{ kind = "bob", mass = 1.0, length = 1.0, damping = 0.01, drive = {drive} }}]
start = {{ angles_deg = [10.0] }}
[[pendulum]]
links = [{{ kind = "bob", mass = 1.0, length = 1.0, damping = 0.01, drive = {drive} }}]
start = {{ angles_deg = [4.0] }}
"""


def clocks(
    *angles: float, drive: Any = VAN_DER_POL, mass: float = 50.0, damping: float = 1.0, joint: float = 0.01
) -> Scene:
    """Equal bobs of 1 kg and 1 m on a cart."""
    link = {"kind": "bob", "mass": 1.0, "length": 1.0, "damping": joint, "drive": drive}
    return scene_from(
        {
            "gravity": 9.81,
            "support": {"kind": "cart", "mass": mass, "damping": damping},
            "pendulum": [{"links": [link], "start": {"angles_deg": [angle]}} for angle in angles],
        }
    )


WIDE = floquet.metronomes(14.0)
GROWTH = 0.056325  # 1/s, of their antiphase, by the multipliers of `floquet.near`


@cache
def pair() -> SynchronizationStudy:
    return study_synchronization(clocks(10.0, 4.0))


def states(scene: Scene) -> dict[str, RelativeEquilibrium]:
    return {agreement(equilibrium): equilibrium for equilibrium in relative_equilibria(average(scene))}


def test_the_predicted_survivor_is_the_simulated_one() -> None:
    study = pair()
    assert study.theory
    assert study.survival
    assert study.agrees is True
    assert study.theory.prediction.row + 1 == study.survival.survivor == 3


def test_the_predicted_locking_time_is_the_simulated_one() -> None:
    study = pair()
    assert study.theory
    assert study.survival
    measured = study.survival.locking_time()
    assert measured
    assert study.theory.prediction.locking_time() == pytest.approx(measured, rel=0.1)


def test_the_words_hold_the_numbers() -> None:
    study = pair()
    assert study.survival
    text = sync_text(study, words=True)
    assert "cart still: antiphase" in text
    assert "cart moves: in phase" in text
    assert f"{study.survival.locking_time():.6g} s" in text
    assert "As predicted." in text
    assert "They neglect" in text


def test_the_verdict_of_a_study_comes_first() -> None:
    study = pair()
    _, told, table, *_ = sync_text(study).split("\n\n")
    assert "wins, as predicted" in told
    assert len(told.splitlines()) <= 5
    assert table.startswith("Steady motions")
    assert "Order parameter" not in sync_text(study)
    assert " ".join(sync_record(study)["verdict_sentences"]) == " ".join(told.split())


def test_where_no_mode_wins_none_is_said_to_survive(monkeypatch: pytest.MonkeyPatch) -> None:
    study = pair()
    assert study.theory
    monkeypatch.setattr(Prediction, "share", 0.509)
    shared = replace(study.theory, prediction=replace(study.theory.prediction))
    assert "no mode wins: the strongest has 50.9 % of the energy" in shared.prediction.doubts
    text = " ".join(sync_text(replace(study, theory=shared), words=True).split())
    assert "No mode wins: mode" in text
    assert "survives" not in text
    assert "no mode wins:" not in text


def test_the_records_hold_the_same_numbers() -> None:
    study = pair()
    told = json.loads(json.dumps(sync_record(study), allow_nan=False))
    assert study.survival
    assert told["simulation"]["survivor"] == told["prediction"]["survivor"] == study.survival.survivor + 1
    assert told["simulation"]["order_parameter"] == pytest.approx(1.0, abs=1e-3)
    assert [configuration["mode"] for configuration in told["configurations"]] == [3, 4]
    assert all(configuration["lasts"] for configuration in told["configurations"])


def test_a_start_that_only_symmetry_keeps_is_judged_by_one_beside() -> None:
    """Metronomes in exact antiphase, that neighbours leave, go where real ones would: in phase."""
    scene = WIDE.scene
    study = study_synchronization(scene, start=state_at_rest(scene, (26.0, -26.0)), tolerance=1e-7)
    assert study.theory
    assert study.survival
    said = study.theory.prediction
    assert said.unstable
    assert (said.unstable.row, said.row, study.survival.survivor) == (1, 2, 3)
    assert study.agrees is True
    assert 0 < abs(study.trajectory.motion.links[0] - np.radians([26.0, -26.0])).max() < np.radians(4.0)
    text, told, number = sync_text(study, words=True), sync_record(study)["prediction"], table_numbers(scene)
    assert f"mode {number[1]} survives (antiphase), but that motion is unstable" in " ".join(text.split())
    assert "from a start nearby" in text
    assert (told["unstable"]["mode"], told["survivor"]) == (number[1], number[2])
    assert told["unstable"]["growth_rate_per_s"] == pytest.approx(GROWTH, abs=1e-3)


def test_clocks_on_a_heavy_beam_stay_in_phase_by_symmetry_alone() -> None:
    scene = vary(load("huygens"), {"support.mass": 40.0})
    said = predict(scene, state_at_rest(scene, (7.0, 7.0)))
    assert said.unstable
    assert said.unstable.relaxation == pytest.approx(289, rel=0.05)
    assert (said.unstable.row, said.row, said.share > 0.99) == (2, 1, True)


def test_a_run_that_ends_before_the_predicted_time_proves_nothing() -> None:
    """Metronomes nearly in antiphase, which they leave later, by themselves."""
    start = state_at_rest(WIDE.scene, (26.0, -24.0))
    study = study_synchronization(WIDE.scene, 2.0, start=start, tolerance=1e-7)
    assert study.theory
    assert study.survival
    assert study.theory.prediction.unstable is None
    np.testing.assert_array_equal(study.theory.prediction.start.links, start.links)
    assert (study.theory.prediction.row, study.survival.survivor) == (2, 2)
    assert study.agrees is None
    text = " ".join(sync_text(study, words=True).split())
    assert "it cannot show whether the prediction is right" in text
    assert "not what was predicted" not in text


def test_of_many_steady_motions_all_that_last_have_a_line() -> None:
    """And the first of the others; the JSON form has all."""
    theory = pair().theory
    assert theory
    unstable = next(
        equilibrium for equilibrium in relative_equilibria(average(WIDE.scene)) if not equilibrium.is_stable
    )
    few, many = ((unstable,) * count + theory.configurations for count in (5, 40))
    for configurations, shown in ((few, 7), (many, 10)):
        study = replace(pair(), theory=replace(theory, configurations=configurations))
        assert study.theory
        study.theory.__dict__["orbits"] = (None,) * len(configurations)
        table = sync_text(study).split("\n\n")[2].splitlines()
        assert len(table) == 3 + shown
        assert sum(", e-folding" in line and " stable" in line for line in table) == 2
        assert ("32 more, all unstable, are in the JSON output." in sync_text(study, words=True)) == (
            configurations is many
        )
        assert len(sync_record(study)["configurations"]) == len(configurations)


def test_what_does_not_excite_itself_has_no_prediction() -> None:
    study = study_synchronization(clocks(10.0, 4.0, drive=None), 60.0)
    assert study.theory is None
    assert study.agrees is None
    assert "No prediction: nothing drives this scene" in sync_text(study, words=True)
    assert sync_record(study)["prediction"] is None


def test_a_swing_that_dies_out_is_said_to() -> None:
    weak = {"kind": "van-der-pol", "strength": 0.002, "angle_deg": 5.0}
    study = study_synchronization(clocks(10.0, 4.0, drive=weak, joint=0.1), 20.0)
    assert study.theory
    assert study.theory.prediction.motion.dies
    assert study.agrees is None
    assert "The swing dies out" in sync_text(study, words=True)
    assert "none was found" in sync_text(study, words=True)


def test_a_start_at_rest_has_no_prediction() -> None:
    with pytest.raises(ComputationError, match="starts at rest"):
        predict(clocks(0.0, 0.0))


def test_the_energy_balance_of_escapements_closes() -> None:
    study = of_run(pair(), clocks(10.0, -8.0, drive=ESCAPEMENT), 10.0, tolerance=1e-12)
    kicks = study.trajectory.kicks
    assert len(kicks.time) > 15
    assert study.trajectory.energy_drift() < 1e-9
    assert f"{len(kicks.time)} kicks supplied {kicks.energy.sum():.6g} J" in sync_text(study, words=True)


def test_hundreds_of_driven_pendula() -> None:
    rng = np.random.default_rng(3)
    study = study_synchronization(clocks(*rng.uniform(-15.0, 15.0, 401).tolist(), mass=5e4), 1.0)
    assert study.theory is None
    assert "400 links" in study.silent
    assert study.phases.order[-1, 0] < 1.0
    assert study.trajectory.energy_drift() < 1e-7


def test_patterns_of_two_and_three() -> None:
    two, three = states(clocks(10.0, 4.0)), states(clocks(10.0, 4.0, 1.0))
    assert set(two) == {"in phase", "antiphase"}
    assert own_amplitudes(two["antiphase"]).sum() == pytest.approx(0.0, abs=1e-9)
    assert np.ptp(own_amplitudes(two["in phase"])) == pytest.approx(0.0, abs=1e-9)
    splay = next(state for words, state in three.items() if words != "in phase")
    assert abs(np.sum(own_amplitudes(splay))) < 1e-6


def test_the_amplitudes_of_configurations_are_those_of_a_simulation() -> None:
    steady = states(clocks(10.0, 4.0))
    for words, angles in {"in phase": (9.0, 9.0), "antiphase": (9.0, -9.0)}.items():
        run = simulate(clocks(*angles), 400.0)
        late = run.motion.links[len(run.times) // 2 :]
        assert np.abs(own_amplitudes(steady[words])).max() == pytest.approx(np.abs(late).max(), rel=5e-3)


def test_the_usual_run_is_as_long_as_the_prediction_needs_and_no_longer_than_most() -> None:
    theory = pair().theory
    assert theory
    locking = theory.prediction.locking_time()
    assert locking
    period = 2 * pi / theory.prediction.averaged.omega.min()
    assert 1.5 * locking < usual_duration(pair().scene, theory) < min(1.5 * locking + 31 * period, PERIODS_MAX * period)


def test_a_film_is_lit_a_little_later_in_every_swing() -> None:
    run = simulate(clocks(10.0, 4.0), 2000.0)
    phases = phases_of(run)
    lit = strobe(phases, "gif")
    swings_apart = lit["speed"] / lit["fps"] * phases.omega[0, 0] / (2 * pi)
    assert swings_apart % 1 == pytest.approx(1 / STROBE_FRAMES)
    assert SECONDS / 2 < 2000.0 / lit["speed"] <= SECONDS


def test_a_short_run_is_shown_at_its_own_speed() -> None:
    assert strobe(phases_of(simulate(clocks(10.0, 4.0), 10.0)), "gif")["speed"] == pytest.approx(1.0)


def written(folder: Path, drive: str = '{ kind = "van-der-pol", strength = 0.05, angle_deg = 5.0 }') -> str:
    path = folder / "clocks.toml"
    path.write_text(FILE.format(drive=drive))
    return str(path)


def test_the_command_draws_and_films(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    picture, film = tmp_path / "sync.png", tmp_path / "sync.gif"
    code = main(["sync", written(tmp_path), "--duration", "1", "-o", str(picture), "--film", str(film)])
    assert code == 0
    assert "wins, by the prediction" in capsys.readouterr().out
    with Image.open(picture) as image, Image.open(film) as moving:
        assert np.asarray(image.convert("L")).std() > 5
        assert getattr(moving, "n_frames", 1) > 15


def test_the_command_writes_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["sync", written(tmp_path), "--duration", "30", "--format", "json"]) == 0
    assert json.loads(capsys.readouterr().out)["simulation"]["duration_s"] == pytest.approx(30.0)


def test_every_mistake_of_a_call_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bad = written(tmp_path, '{ kind = "escapement", impulse = -1.0 }')
    code = main(["sync", bad, "-o", "sync.doc", "--film", str(tmp_path / "none" / "sync.avi")])
    said = capsys.readouterr().err
    assert code == 2
    assert "pendulum[0].links[0].drive.impulse = -1.0: must be positive" in said
    assert "sync.doc: the name must end in" in said
    assert "sync.avi: the name must end in" in said
    assert "there is no folder" in said


def test_a_scene_in_space_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["sync", "chain-spatial", "--duration", "5"]) == 2
    assert "is computed in the plane" in capsys.readouterr().err


def test_a_single_pendulum_locks_with_nobody() -> None:
    words = sync_text(study_synchronization(clocks(10.0, mass=1e6, damping=0.0), 30.0), words=True)
    assert "Mean frequency 3.1" in words
    assert "locked" not in words
    assert "All other" not in words


def test_still_pendula_and_short_runs_claim_no_frequency() -> None:
    still = sync_text(study_synchronization(clocks(0.0, 0.0), 30.0), words=True)
    assert "nan" not in still
    assert "no frequency" in still
    assert "too short to tell whether they lock" in sync_text(study_synchronization(clocks(10.0, 4.0), 0.1), words=True)


def of_run(
    study: SynchronizationStudy, scene: Scene, seconds: float = 20.0, tolerance: float | None = None
) -> SynchronizationStudy:
    """The same without a prediction, and of another scene's run."""
    run = simulate(scene, seconds, tolerance=tolerance)
    return replace(study, scene=scene, theory=None, trajectory=run, phases=phases_of(run))


def test_what_dampers_took_is_said_only_of_dampers() -> None:
    """Not with van der Pol drives in addition to kicks, nor where there are no dampers."""
    scene = clocks(10.0, 4.0, drive=ESCAPEMENT)
    links = [pendulum.links[0] for pendulum in scene.pendulum]
    driven = links[0].model_copy(update={"drive": clocks(1.0).pendulum[0].links[0].drive})
    mixed = (scene.pendulum[0].model_copy(update={"links": (driven,)}), scene.pendulum[1])
    study = of_run(pair(), scene.model_copy(update={"pendulum": mixed}))
    rest = float(study.trajectory.motion.work[-1] - study.trajectory.kicks.energy.sum())
    assert f"van der Pol drives and dampers together did {rest:.6g} J" in sync_text(study, words=True)
    assert "dampers dissipated" not in sync_text(study, words=True)
    assert "dampers dissipated" in sync_text(of_run(study, scene), words=True)
    loose = scene.conservative
    kicked = [link.model_copy(update={"damping": 0.0}) for link in links]
    pendula = [
        pendulum.model_copy(update={"links": (link,)}) for pendulum, link in zip(loose.pendulum, kicked, strict=True)
    ]
    words = sync_text(of_run(study, loose.model_copy(update={"pendulum": tuple(pendula)})), words=True)
    assert "supplied" in words
    assert "dampers dissipated" not in words


def test_a_start_in_a_mode_counts_modes_as_the_page_does(capsys: pytest.CaptureFixture[str]) -> None:
    """Row 3 of the table is antiphase; row 2 is the beam against its dampers, from which nothing can swing."""
    assert main(["sync", "huygens", "--start", "mode:2:6", "--duration", "10"]) == 2
    assert "--start mode:2: is overdamped" in capsys.readouterr().err
    assert main(["sync", "huygens", "--start", "mode:3:6", "--duration", "10"]) == 0
    assert "Mode 3 (cart still: antiphase) wins, as predicted: in the simulation it contains 100 %" in (
        said := capsys.readouterr().out
    )
    assert "Modes are numbered as in the table" in said
