"""Travels within limits of speed, acceleration and jerk: their ways, their files, and the swing that they leave."""

from __future__ import annotations

from itertools import pairwise
from math import inf
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from modal import Bob, Cart, Pendulum, Scene, load
from modal.errors import SceneError
from modal.scene.length_laws import limited_law, superposed
from modal.scene.records import read_record
from modal.statespace import shaper_for
from modal.statespace.hoisting import Travel, TravelLimits, travel_residuals
from modal.statespace.travels import shaped_travel
from multipendula.cli import main
from nonlinear.verification import swing_after

G = 9.81


def crane(mass: float = 5.0, **cart: float) -> Scene:
    return Scene(
        gravity=G, support=Cart(mass=mass, **cart), pendulum=[Pendulum(links=[Bob(mass=2.0, length=1.5, damping=0.3)])]
    )


@pytest.mark.parametrize(
    ("limits", "phases"),
    [
        ((1.5, 0.4, inf), [3.75, 20 / 1.5 - 3.75, 3.75]),
        ((9.0, 0.4, inf), [50**0.5, 50**0.5]),
        ((1.5, 0.4, 2.0), [0.2, 3.55, 0.2, 20 / 1.5 - 3.95, 0.2, 3.55, 0.2]),
        ((1.5, 9.0, 0.5), [3**0.5, 3**0.5, 20 / 1.5 - 2 * 3**0.5, 3**0.5, 3**0.5]),
        ((99.0, 99.0, 0.5), [20 ** (1 / 3)] * 4),
    ],
    ids=["trapezoid", "triangle", "S-curve", "no constant acceleration", "no cruise"],
)
def test_phases_by_hand(limits: tuple[float, float, float], phases: list[float]) -> None:
    """The last: d = 2 j t³ with four phases of jerk."""
    law = limited_law(20.0, 3.0, *limits)
    assert np.diff(law.knots) == pytest.approx(phases, rel=1e-12)
    assert law.end == pytest.approx(20.0, rel=1e-12)


@pytest.mark.parametrize("seed", range(6))
def test_a_travel_is_as_fast_as_its_limits_allow(seed: int) -> None:
    """Within them everywhere, at one of them everywhere, and the integral of its acceleration, by quadrature."""
    rng = np.random.default_rng(seed)
    d, v, a, j = 10 ** rng.uniform(-2, 2, 4)
    law = limited_law(d, 0.0, v, a, j)
    middles = (law.knots[1:] + law.knots[:-1]) / 2
    sizes = np.abs(np.array([*law(middles)[1:], 6 * law.coefficients[:, 3]])) / np.array([[v], [a], [j]])
    assert sizes.max() <= 1 + 1e-9
    assert np.allclose(sizes.max(0), 1, rtol=1e-9)
    speed = quad(lambda t: float(law(t)[2]), 0, middles[-1], points=law.knots[1:-1], limit=200)[0]
    assert float(law(middles[-1])[1]) == pytest.approx(speed, rel=1e-7, abs=1e-9 * v)
    slow = limited_law(d, 0.0, v, a, j, step=law.knots[-1] / 50)
    assert slow.knots / (law.knots[-1] / 50) == pytest.approx(np.rint(slow.knots / (law.knots[-1] / 50)), abs=1e-9)
    assert np.abs(slow(slow.knots[:-1])[2]).max() <= a * (1 + 1e-12)


def test_a_shaped_way_is_the_sum_of_delayed_ones() -> None:
    law, delays, amplitudes = (
        limited_law(3.0, 1.0, 1.0, 0.5, 2.0),
        np.array([0.0, 0.7, 4.0]),
        np.array([0.5, -0.2, 0.7]),
    )
    times = np.linspace(0.0, 14.0, 301)
    expected = sum(a * np.array(law(times - at)) for at, a in zip(delays, amplitudes, strict=True))
    assert np.array(superposed(law, delays, amplitudes)(times)) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("jerk", [inf, 2.0])
def test_the_swing_is_that_of_the_equations_by_hand(jerk: float) -> None:
    """l θ'' + c θ'/(m l) + g θ = −x'', and with sin θ and cos θ in the full equations: SciPy's own integrator."""
    scene, l, c = crane(), 1.5, 0.3 / (2.0 * 1.5**2)
    travel = shaped_travel(scene, shaper_for(scene, kind="zvd"), 4.0, limits=TravelLimits(0.9, 1.1, jerk))
    full = swing_after(travel)
    for row, way in enumerate(travel.ways):
        for sine, cosine, left in ((float, lambda _: 1.0, travel.residual[row]), (np.sin, np.cos, full[row])):

            def slope(t: float, y: np.ndarray, sine=sine, cosine=cosine, way=way) -> list[float]:  # type: ignore[no-untyped-def]
                return [y[1], -(G / l) * sine(y[0]) - c * y[1] - float(way(t)[2]) * cosine(y[0]) / l]

            y, knots = np.zeros(2), way.knots.tolist()
            for begin, end in pairwise(knots):
                inside = lambda t, y, end=end: slope(min(t, np.nextafter(end, 0)), y)  # noqa: E731
                y = solve_ivp(inside, (begin, end), y, "DOP853", rtol=1e-11, atol=1e-13).y[:, -1]
            if sine is float:
                assert left == pytest.approx(np.hypot(y[0], y[1] / np.sqrt(G / l)), rel=1e-6, abs=1e-9)
            else:
                after = solve_ivp(slope, (end, travel.times[-1]), y, rtol=1e-10, atol=1e-12, max_step=0.01).y[0]
                assert left == pytest.approx(np.ptp(after) / 2, rel=2e-2, abs=1e-5)
    assert travel.residual[1] < 1e-9 < 0.01 < travel.residual[0]
    assert travel.peaks[0] == pytest.approx([1.1, 0.9], rel=1e-9)


@pytest.mark.parametrize(("jerk", "step"), [(inf, 0.0), (2.0, 0.0), (inf, 0.05), (2.0, 0.05)])
def test_a_profile_is_read_as_the_travel_that_it_was(tmp_path: Path, jerk: float, step: float) -> None:
    """What it leaves after its shaper is nothing still: straight lines between its accelerations are the travel."""
    scene, path = crane(), tmp_path / "profile.csv"
    shaper = shaper_for(scene, kind="zvd", step=step)
    travel = shaped_travel(scene, shaper, 4.0, limits=TravelLimits(0.9, 1.1, jerk, step))
    columns = travel.columns(step=step)
    rows = "\n".join(",".join(map(repr, row)) for row in np.array(list(columns.values())).T.tolist())
    path.write_text(f"# told\n{','.join(columns)}\n{rows}\n", encoding="utf-8")
    assert list(columns) == ["time_s", "displacement_m", "velocity_m_per_s", "acceleration_m_per_s2"]
    record = read_record(path)
    assert record["interpolation"] == "linear"
    if step:
        assert np.diff(record["time_s"]) == pytest.approx(step, rel=1e-9)
    again = Travel.planned(str(path), 0.0, 0.0)
    assert again.distance == pytest.approx(4.0, rel=1e-9)
    late = again.duration - np.ptp(travel.ways[1].knots)
    assert np.array(again.course(np.linspace(0, 9, 50) + late / 2)[:2]) == pytest.approx(
        np.array(travel.ways[1](np.linspace(0, 9, 50))[:2]), abs=0.9 * step / 4 + 1e-6
    )
    assert shaped_travel(scene, shaper, str(path)).residual[0] < 1e-7


def test_columns_that_contradict_each_other_are_refused(tmp_path: Path) -> None:
    t = np.linspace(0, 2, 41)
    columns = {"time_s": t, "displacement_m": t**3 / 6, "velocity_m_per_s": t**2 / 2, "acceleration_m_per_s2": t}
    path = tmp_path / "motion.csv"

    def written(**changes: np.ndarray) -> Path:
        rows = np.array(list((columns | changes).values())).T
        path.write_text("\n".join([",".join(columns), *(",".join(map(str, row)) for row in rows)]), encoding="utf-8")
        return path

    assert read_record(written())["acceleration_m_per_s2"] == tuple(t.tolist())
    for key, change in (("velocity_m_per_s", 0.2), ("displacement_m", 0.1)):
        with pytest.raises(SceneError, match=f"{key} is not what acceleration_m_per_s2 gives from rest: "):
            read_record(written(**{key: columns[key] + change}))
    with pytest.raises(SceneError, match="ends at 2 m/s: a travel ends at rest"):
        Travel.planned(str(written()), 0.0, 0.0)
    with pytest.raises(SceneError) as caught:
        read_record(written(velocity_m_per_s=-columns["velocity_m_per_s"]), has_quotes=False)
    assert not any(character.isdigit() for character in str(caught.value).replace(str(path), "").replace("s2", ""))


def test_five_commands_take_the_profile_back(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    profile, picture, scene = (tmp_path / name for name in ("profile.csv", "before.png", "scene.toml"))
    limits = ("--travel", "4", "--max-speed", "1.1", "--max-acceleration", "0.3")
    words = ("shaper", "crane-hook", *limits, "--kind", "zvd", "-o", str(profile), "--picture", str(picture))
    assert main(words) == 0
    told = capsys.readouterr().out
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert "a travel of 4 m shaped: residual swing " in told
    assert "in the full equations; it takes " in told
    support = f'[support]\nkind = "moved"\nmotion = {{ kind = "record", file = "{profile}" }}\n'
    links = '[[pendulum]]\nlinks = [{ kind = "bob", mass = 50.0, length = 12.0 }]\n'
    scene.write_text(f"gravity = 9.81\n{support}{links}", encoding="utf-8")
    assert load(scene).support.motion.interpolation == "linear"
    assert main(("simulate", str(scene), "--duration", "1", "-o", str(tmp_path / "run.npz"))) == 0
    capsys.readouterr()
    assert main(("hoist", "hoisting-crane", "--travel", str(profile), "--samples", "2")) == 0
    left = travel_residuals(load("hoisting-crane"), Travel.planned(str(profile), 0.0, 0.0))
    assert f"residual swing {np.degrees(left[0].angle):.6g}°: unshaped" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--max-speed", "1"), "--max-speed: needs --travel METRES"),
        (("--travel", "2", "--max-speed", "1", "--max-jerk", "1"), "--max-speed: needs --max-acceleration"),
        (("--travel", "2", "--max-acceleration", "1", "--over", "3"), "--over: cannot be combined with --max-acceler"),
        (("--travel", "no.csv", "--over", "3"), "--over: cannot be combined with --travel no.csv"),
        (("--travel", "no.csv"), "no.csv: cannot be read"),
        (("--range", "gravity=3"), "--range gravity=3: must be PLACE=FROM:TO"),
        (("--range", "gravity=1:2", "--kind", "zv"), "--kind: cannot be combined with --range"),
    ],
)
def test_limits_that_do_not_fit_are_refused(
    capsys: pytest.CaptureFixture[str], words: tuple[str, ...], message: str
) -> None:
    assert main(("shaper", "crane-hook", *words)) == 2
    streams = capsys.readouterr()
    assert message in streams.err
    assert streams.out == ""


def test_export_response_and_shaper_take_one_input(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    for scene, name, words in (
        ("crane-hook", "cart_acceleration", "cart acceleration"),
        ("clocks-double", "cart_force", "force on the cart"),
        ("tower", "floor1_force", "floor1 force"),
    ):
        assert main(("export", scene, "-o", str(tmp_path / "model.json"))) == 0
        assert f"input {name} (" in capsys.readouterr().out
        assert main(("response", scene)) == 0
        assert f"peaks of the response to {words} (" in capsys.readouterr().out
        assert main(("shaper", scene)) == 0
        assert f"# {name}: " in capsys.readouterr().out
