"""What a fit says of a record with a mistake in it, and that it says nothing of the kind of clean ones."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from amounts import usually

from modal.errors import SceneError
from modal.identification import scene_with
from modal.identification.estimate import estimate_of
from modal.scene import Scene, dump, scene_from
from modal.scene.parameters import number_at
from modal.types import Floats
from multipendula.cli import main
from nonlinear import State, simulate
from nonlinear.identification import Fit, Recording, Segment, Sensor, fit, fit_record, fit_text, read_recording

LINKS: list[dict[str, Any]] = [
    {"kind": "rod", "mass": 1.0, "length": 0.5, "damping": 0.01},
    {"kind": "bob", "mass": 0.6, "length": 0.4, "damping": 0.005},
]
WORDS = ("scale of", "outlier", "jumps by a turn", "look", "has the opposite sign", "exchanged", "does not fit")


def scene_of(links: int, lengths: Floats | None = None) -> Scene:
    """The first links, with their own or these lengths."""
    chain = (
        LINKS[:links]
        if lengths is None
        else [link | {"length": x} for link, x in zip(LINKS[:links], lengths, strict=False)]
    )
    return scene_from({"gravity": 9.81, "pendulum": [{"links": chain}]})


def recorded(scene: Scene, start: list[float], seed: int, *, seconds: float, rates: float = 0.0) -> Recording:
    """Its angles with noise of 1e-3 rad, every 10 ms."""
    times, count = np.arange(0, seconds, 0.01), len(start)
    begin = State(np.radians(start), np.full(count, rates))
    values = simulate(scene, seconds, start=begin, output=times, tolerance=1e-9).motion.links[: len(times)]
    values = values + np.random.default_rng(seed).normal(0, 1e-3, values.shape)
    return Recording(tuple(Sensor(1, k + 1) for k in range(count)), (Segment("", "", times, values),))


@cache
def clean(links: int) -> Recording:
    """A large swing of one link, a smaller one of two, of which a wrong record takes long to be given up."""
    return recorded(scene_of(links), [60.0] if links == 1 else [30.0, -20.0], 1, seconds=1.0 if links == 2 else 6.0)


def changed(record: Recording, by: Callable[[Floats], Floats], time: float = 1.0) -> Recording:
    """With other values and a factor to its times."""
    (segment,) = record.segments
    return replace(record, segments=(replace(segment, times=time * segment.times, values=by(segment.values)),))


def fitted(record: Recording, **more: Any) -> Fit:
    """Its lengths, from one that is wrong by 4 %."""
    off = scene_with(scene_of(len(record.sensors)), {"pendulum[0].links[0].length": 0.52})
    return fit(off, record, ["pendulum[0].links[*].length"], **more)


def said(record: Recording) -> str:
    """What is said of a record, or why it is refused."""
    try:
        return " ".join(fitted(record).verdict)
    except SceneError as error:
        return str(error)


def kicked(values: Floats) -> Floats:
    """With 20 outliers."""
    disturbed = values.copy()
    disturbed[np.random.default_rng(3).choice(len(values), 20, replace=False), 0] += 0.3
    return disturbed


DEFECTS: dict[str, tuple[int, Callable[[Floats], Floats], float, str]] = {
    "degrees": (2, np.degrees, 1.0, "theta_1_1_rad=theta_1_1_deg"),
    "milliseconds": (2, np.array, 1000.0, "time_s=time_ms"),
    "scale": (1, lambda v: 1.03 * v, 1.0, "θ₁₁: a scale of 1.0"),
    "outliers": (1, kicked, 1.0, "20 readings are outliers"),
    "reversed": (2, lambda v: v * [1, -1], 1.0, "has the opposite sign"),
    "exchanged": (2, lambda v: v[:, ::-1], 1.0, "theta_1_1_rad=theta_1_2_rad"),
    "relative": (2, lambda v: np.column_stack((v[:, 0], v[:, 1] - v[:, 0])), 1.0, "`angles=relative`"),
}


@pytest.mark.parametrize(
    "name", usually([name for name in DEFECTS if name not in {"exchanged", "relative", "reversed"}], [*DEFECTS])
)
def test_a_mistake_in_a_record_is_named(name: str) -> None:
    links, by, time, words = DEFECTS[name]
    assert words in said(changed(clean(links), by, time))


@pytest.mark.parametrize("seed", usually(range(3), range(20)))
def test_clean_records_have_no_findings(seed: int) -> None:
    rng = np.random.default_rng(seed)
    links = 1 + seed % 2
    scene = scene_of(links, rng.uniform(0.3, 0.6, 2))
    record = recorded(scene, rng.uniform(-50, 50, links).tolist(), seed, seconds=1.2)
    fitted = fit(scene_with(scene, {"pendulum[0].links[0].damping": 0.02}), record, ["pendulum[0].links[0].damping"])
    assert fitted.fits
    assert not [words for words in WORDS if words in " ".join(fitted.verdict)]
    assert abs(fitted.values[0] - 0.01) < 4.5 * fitted.stds[0]


def test_a_clock_that_jitters_is_not_taken_for_a_wrong_model() -> None:
    scene = scene_with(scene_of(1), {"pendulum[0].links[0].damping": 0.06})
    even = np.arange(0, 12, 0.01)
    late = np.sort(np.clip(even + np.random.default_rng(2).normal(0, 3e-3, len(even)), 0, 12))
    start = State(np.radians([60.0]), np.zeros(1))
    values = simulate(scene, 12.0, start=start, output=np.unique(late), tolerance=1e-9).motion.links[:, :1]
    record = Recording((Sensor(1, 1),), (Segment("", "", even[: len(values)], values[: len(even)]),))
    clocked = fit(scene, record, ["pendulum[0].links[0].length", "pendulum[0].links[0].damping"])
    verdict = " ".join(clocked.verdict)
    assert "as if the clock jittered by" in verdict
    assert "is wrong" not in verdict


def test_angles_of_atan2_are_continued(tmp_path: Path) -> None:
    """A pendulum that turns over: the file has angles between −π and π."""
    whole = recorded(scene_of(1), [90.0], 5, seconds=1.0, rates=9.0)
    (segment,) = whole.segments
    assert np.ptp(segment.values) > 2 * np.pi
    wrapped = changed(whole, lambda v: (v + np.pi) % (2 * np.pi) - np.pi)
    rows = "\n".join(f"{t},{v}" for t, (v,) in zip(segment.times, wrapped.segments[0].values, strict=True))
    (tmp_path / "run.csv").write_text("time_s,theta_1_1_rad\n" + rows)
    read = read_recording(None, [tmp_path / "run.csv"])
    assert read.continued == ("theta_1_1",)
    turns = (read.segments[0].values - segment.values) / (2 * np.pi)
    assert turns == pytest.approx(np.full_like(turns, np.round(turns[0])), abs=1e-12)
    estimated = fitted(read)
    assert estimated.values == pytest.approx([0.5], abs=1e-3)
    assert "jumps by a turn" in estimated.verdict[0]
    assert "unwrap_angles()" in fitted(wrapped).verdict[0]
    assert whole.unwrap_angles() is whole


def test_a_fit_that_does_not_fit_draws_no_conclusions() -> None:
    """Two links with a record of one that is not theirs: no error bars, no covariance, nothing said of a damper."""
    record = changed(clean(1), lambda v: v + 0.3 * np.sin(np.linspace(0, 60, len(v)))[:, None])
    fitted = fit(scene_of(1), record, ["pendulum[0].links[0].length", "pendulum[0].links[0].damping"])
    assert not fitted.fits
    assert np.isnan(fitted.stds).all()
    assert np.isnan(fitted.bootstrap(2)).all()
    assert "no sign" not in " ".join(fitted.verdict)
    assert "±" not in fit_text(fitted)
    report = json.loads(json.dumps(fit_record(fitted)))
    assert report["fits"] is False
    assert report["covariance"] is None
    assert [parameter["std"] for parameter in report["parameters"]] == [None, None]
    with pytest.raises(SceneError, match="does not fit its record"):
        estimate_of(fitted.scene, report)


def test_windows_find_the_right_minimum() -> None:
    """A damped chain that turns over, in windows of more than a period of its small swings."""
    first = {"kind": "body", "mass": 1.0, "length": 0.5, "centre": 0.27, "inertia": 0.02, "damping": 0.01}
    true = scene_from(
        {"gravity": 9.81, "pendulum": [{"links": [first, LINKS[1] | {"length": 0.43, "damping": 0.004}]}]}
    )
    record = recorded(true, [150.0, 120.0], 2, seconds=usually(3.0, 6.0))
    record = replace(
        record,
        segments=tuple(
            replace(segment, times=segment.times[::2], values=segment.values[::2]) for segment in record.segments
        ),
    )
    places = [f"pendulum[0].links[{at}" for at in ("0].centre", "1].length", "0].damping")]
    off = scene_with(true, dict(zip(places, (0.26, 0.45, 0.012), strict=True)))
    fitted = fit(off, record, places, window=1.5)
    assert fitted.fits
    truth = [number_at(true, parameter.place) for parameter in fitted.parameters]
    assert np.abs((fitted.values - truth) / fitted.stds).max() < 4.5


def test_standard_deviations_beside_a_held_number_say_so() -> None:
    record = clean(2)
    fitted = fit(scene_of(2), record, ["pendulum[0].links[*].mass", "pendulum[0].links[*].damping"])
    (direction,) = fitted.undetermined
    (words,) = (sentence for sentence in fitted.verdict if "exactly" in sentence)
    assert all(place in words for place in direction.changes)
    assert f"{direction.held} = " in words


def test_columns_with_other_headings_units_and_signs(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("t,a,theta_1_2_rad\n0,10,1\n100,20,2\n200,30,3\n300,40,5\n")
    columns = {"t": "time_ms", "a": "-theta_1_1_deg"}
    read = read_recording(scene_of(2), [path], columns=columns)
    assert read.segments[0].times == pytest.approx([0, 0.1, 0.2, 0.3])
    assert read.segments[0].values[:, 0] == pytest.approx(-np.radians([10, 20, 30, 40]))
    for wrong, words in (
        ({"t": "time_min"}, "column t: time_min: must be"),
        ({"u": "time_s"}, "column u: is missing"),
        (columns | {"theta_1_2_rad": "time_s"}, "the time in two units"),
        (columns | {"theta_1_2_rad": "theta_1_1_rad"}, "one sensor in two units"),
    ):
        with pytest.raises(SceneError, match=words):
            read_recording(scene_of(2), [path], columns=wrong)


def test_the_command_names_its_options(tmp_path: Path, monkeypatch: Any, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    dump(scene_of(1), "scene.toml")
    (segment,) = clean(1).segments
    rows = "\n".join(f"{1000 * t},{1.03 * v}" for t, (v,) in zip(segment.times, segment.values, strict=True))
    Path("run.csv").write_text("time_s,theta_1_1_rad\n" + rows)
    words = ["fit", "scene.toml", "run.csv", "--free", "pendulum[0].links[0].length"]
    assert main(words) == 2
    assert "--column time_s=time_ms" in capsys.readouterr().err
    assert main([*words, "--column", "time_s=time_ms"]) == 0
    assert "--scale" in capsys.readouterr().out
