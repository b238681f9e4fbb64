"""Films: frames are the motion, everything stands inside the picture, and each form holds what it says."""

from __future__ import annotations

import shutil
import sys
from functools import cache
from io import BytesIO
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from amounts import usually
from PIL import Image

import modal
from modal.errors import ComputationError, SceneError
from modal.scene import Bob, Body, Cart, Fixed, InitialCondition, Pendulum, Scene
from nonlinear.dynamics import vectors
from nonlinear.integration import Trajectory
from nonlinear.plotting import animate
from nonlinear.plotting.animation import Film, Shown
from nonlinear.plotting.scene import PENDULA_MAX, energies_of, stage_of
from nonlinear.postprocessing import pick_links, resample
from nonlinear.simulation import simulate
from nonlinear.system import State, initial_state


def run(name: str, duration: float = 1.0, **options: Any) -> Trajectory:
    return simulate(modal.load(name), duration, method="DOP853", **options)


def film(trajectory: Trajectory, form: str, **options: Any) -> tuple[Shown, bytes]:
    stream = BytesIO()
    return animate(trajectory, stream, form, **options), stream.getvalue()


def single(title: str = "One", angle: float = 40.0, count: int = 1, **support: Any) -> Scene:
    start = InitialCondition(angles_deg=(angle,))
    pendulum = Pendulum(links=(Bob(mass=1.0, length=1.0),), count=count, start=start)
    return Scene(title=title, gravity=9.81, pendulum=(pendulum,), **support)


@pytest.mark.parametrize("name", ["paper-cart-3", "chain-spatial"])
def test_frames_agree_with_a_denser_simulation(name: str) -> None:
    at = np.linspace(0, 2, 61)
    coarse, dense = run(name, 2.0, output=101), run(name, 2.0, output=at)
    resampled = resample(coarse.times, coarse.motion, at)
    for vector, true, most in zip(vectors(resampled), vectors(dense.motion), (1e-4, 1e-2), strict=True):
        assert 1e-9 < np.abs(vector - true).max() < most
    assert np.abs(resampled.cart - dense.motion.cart).max() < 1e-6


def test_resampling_is_of_fourth_order() -> None:
    true = run("paper-cart-1", 2.0, output=401, tolerance=1e-12)

    def error(samples: int) -> float:
        some = run("paper-cart-1", 2.0, output=samples, tolerance=1e-12)
        return float(np.abs(resample(some.times, some.motion, true.times).links - true.motion.links).max())

    assert abs(np.log2(error(51) / error(101)) - 4) < 0.3


def test_samples_come_back_and_unit_vectors_stay_unit() -> None:
    spatial = run("chain-spatial", 1.0, output=41)
    back = resample(spatial.times, spatial.motion, spatial.times)
    assert np.abs(back.links - spatial.motion.links).max() < 1e-14
    assert np.abs(back.link_rates - spatial.motion.link_rates).max() < 1e-9
    between = resample(spatial.times, spatial.motion, np.linspace(0, 1, 77))
    assert np.abs(np.linalg.norm(between.links, axis=-1) - 1).max() < 1e-15
    assert np.abs(np.sum(between.links * between.link_rates, axis=-1)).max() < 1e-14


def test_samples_too_far_apart_are_refused_with_how_many_there_should_be() -> None:
    coarse = run("paper-cart-3", 4.0, output=9)
    with pytest.raises(ComputationError, match=r"`output=\d+`$") as caught:
        film(coarse, "gif")
    wanted = int(str(caught.value).rpartition("=")[2].strip("`"))
    enough = run("paper-cart-3", 4.0, output=wanted)
    resample(enough.times, enough.motion, enough.times)


def test_gif_counts_frames_and_hundredths_and_repeats() -> None:
    shown, data = film(run("paper-cart-3", 1.0), "gif")
    picture = Image.open(BytesIO(data))
    assert shown == Shown(25, 25.0, 1.0, 0.0)
    assert picture.n_frames == 25
    assert picture.info["loop"] == 0
    assert picture.info["duration"] == 40
    assert picture.size == (800, 450)
    frames = []
    for k in range(3):
        picture.seek(8 * k)
        frames.append(np.asarray(picture.convert("RGB")).astype(int))
    assert all(np.abs(a - b).max() > 100 for a, b in pairwise(frames))
    assert frames[0][-1, -1].tolist() == [255, 255, 255]


def test_speed_seconds_and_rate_say_how_much_is_shown() -> None:
    trajectory = run("chain-1", 2.0)
    shown, data = film(trajectory, "gif", speed=0.5, seconds=0.6, fps=30)
    assert shown.fps == 100 / 3
    assert shown.frames == Image.open(BytesIO(data)).n_frames == 20
    assert shown.seconds == pytest.approx(0.6)
    assert shown.motion == pytest.approx(0.3)
    assert shown.left_out == pytest.approx(1.7)


def test_html_escapes_the_title_and_holds_every_frame() -> None:
    shown, data = film(simulate(single("<b>Tick & tock</b>"), 0.2), "html")
    page = data.decode()
    assert "<title>&lt;b&gt;Tick &amp; tock&lt;/b&gt;</title>" in page
    assert "<b>" not in page
    assert page.count('"iVBOR') == shown.frames == 6
    assert "http" not in page


def test_letters_that_the_font_has_not_are_drawn_without_a_warning() -> None:
    _, page = film(simulate(single("振り子"), 0.1), "html")
    assert "<title>振り子</title>" in page.decode()


def test_mp4_is_a_film_or_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda name: None)
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(ComputationError, match="`video`"):
        film(run("chain-1", 0.5), "mp4")


def test_mp4_of_the_extra() -> None:
    pytest.importorskip("imageio_ffmpeg")
    done: list[float] = []
    shown, data = film(run("chain-1", 0.2), "mp4", report=done.append)
    assert data[4:8] == b"ftyp"
    assert len(done) == shown.frames == 6
    assert done[-1] == pytest.approx(0.2)


def test_a_failing_ffmpeg_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("modal.plotting.films.find_ffmpeg", lambda: "/bin/false")
    with pytest.raises(ComputationError, match="could not write"):
        film(run("chain-1", 0.2), "mp4")


@pytest.mark.parametrize(
    ("form", "options", "words"),
    [
        ("avi", {}, "one of gif, mp4, html"),
        ("gif", {"fps": 0.5}, "fps 0.5"),
        ("gif", {"speed": 0.0}, "speed"),
        ("html", {"seconds": float("nan")}, "seconds"),
        ("html", {"seconds": 1e6, "speed": 1e-6}, "at most 20000"),
    ],
)
def test_what_cannot_be_is_refused(form: str, options: dict[str, float], words: str) -> None:
    with pytest.raises(SceneError, match=words):
        film(run("chain-1", 0.5), form, **options)


@cache
def scenes() -> dict[str, Trajectory]:
    body = Body(mass=1.0, length=0.5, centre=0.8, inertia=0.1)
    overhung = Scene(gravity=9.81, pendulum=(Pendulum(links=(body,), start=InitialCondition(angles_deg=(120.0,))),))
    moving = State(np.array([0.7]), np.zeros(1), 0.0, 30.0)
    pushed = simulate(single(support=Cart(mass=1.0)), 2.0, start=moving)
    return {
        "cart": run("paper-cart-3", 1.0),
        "space": run("chain-spatial", 1.0),
        "crowd": simulate(single(count=4000), 0.5),
        "single": simulate(single("Ünï " + "W" * 196), 0.5),
        "standstill": simulate(single("数" * 100, angle=0.0), 0.5),
        "overhung": simulate(overhung, 1.0),
        "drifting": pushed,
        "metronomes": run("metronomes", 1.0),
    }


@pytest.mark.parametrize("support", [{}, {"support": Cart(mass=1.0)}])
def test_a_film_shows_the_lines_of_its_axis_with_a_rail_only(support: dict[str, Any]) -> None:
    trajectory = simulate(single(**support), 0.5)
    scenery = Film(trajectory, np.linspace(0, 0.5, 3), 10.0, 1.0).scenery
    assert set(scenery.axis.spines.values()).isdisjoint(scenery.moving) == (not support)


@pytest.mark.parametrize(
    "case", ["drifting", "overhung", "cart", "space", "crowd", "single", "standstill", "metronomes"][: usually(3, 8)]
)
@pytest.mark.filterwarnings("ignore:Glyph")
def test_everything_stands_inside_the_picture(case: str) -> None:
    trajectory = scenes()[case]
    drawn = Film(trajectory, np.linspace(0, trajectory.times[-1], 11), 10.0, 1.0)
    panel = drawn.scenery.axis.get_window_extent()
    for frame in range(11):
        drawn.show(frame)
        for player in drawn.scenery.players:
            points = np.concatenate((player.line.get_xydata(), player.actor.centres[frame]))
            seen = drawn.scenery.axis.transData.transform(points)
            assert np.all((seen > panel.min + 5) & (seen < panel.max - 5))
    drawn.canvas.draw()
    page = drawn.figure.bbox
    boxes = [part.get_window_extent() for part in drawn.figure.texts]
    boxes += [axis.get_tightbbox() for axis in drawn.figure.axes[1:]]
    rail = drawn.scenery.axis.get_xticklabels()[1:-1] if drawn.scenery.axis.axison else []
    boxes += [label.get_window_extent() for label in rail]
    for box in boxes:
        assert page.x0 <= box.x0 < box.x1 <= page.x1
        assert page.y0 <= box.y0 < box.y1 <= page.y1
    title, clock, caption = (text.get_window_extent() for text in drawn.figure.texts)
    assert title.x1 < clock.x0
    assert caption.y1 < panel.y1 < title.y0


def test_lengths_are_drawn_true_and_the_scale_is_equal() -> None:
    trajectory = run("paper-cart-3", 1.0)
    at = np.linspace(0, 1, 7)
    for actor in stage_of(trajectory, at).actors:
        assert np.linalg.norm(np.diff(actor.joints, axis=1), axis=-1) == pytest.approx(1.0, abs=1e-12)
    axis = Film(trajectory, at, 6.0, 1.0).scenery.axis
    zero, unit = axis.transData.transform([(0, 0), (1, 1)])
    assert unit[0] - zero[0] == pytest.approx(unit[1] - zero[1])


def test_the_camera_follows_a_cart_that_leaves() -> None:
    assert not stage_of(run("paper-cart-3", 1.0), np.linspace(0, 1, 5)).follows
    stage = stage_of(scenes()["drifting"], np.linspace(0, 2, 5))
    assert stage.follows
    assert np.ptp(stage.extent[0]) < 5 < np.ptp(stage.camera)


def unequal_in_space(support: Fixed | Cart, rate: float) -> Trajectory:
    pendula = [
        Pendulum(links=(Bob(mass=1.0, length=length),) * count, start=InitialCondition(angles_deg=(6.0,) * count))
        for length, count in ((1.0, 2), (0.75, 1), (0.4, 3))
    ]
    scene = Scene(gravity=9.81, space="space", support=support, pendulum=pendula)
    begun = initial_state(scene)
    return simulate(scene, 2.0, start=State(begun.links, begun.link_rates, 0.0, rate), output=41)


@pytest.mark.parametrize(("support", "rate"), [(Fixed(), 0.0), (Cart(mass=1.0), 20.0)])
def test_shadows_of_pendula_of_any_number_of_links_fall_on_the_floor(support: Fixed | Cart, rate: float) -> None:
    drawn = Film(unequal_in_space(support, rate), np.linspace(0, 2, 5), 10.0, 1.0)
    assert drawn.scenery.stage.follows == bool(rate)
    (floor,) = [patch for patch in drawn.scenery.axis.patches if patch not in drawn.scenery.drawn]
    for actor in drawn.scenery.stage.actors:
        assert actor.shadow is not None
        assert np.all(floor.get_path().contains_points(actor.shadow.reshape(-1, 2)))


def test_a_crowd_is_thinned_out_and_said_so() -> None:
    crowd = scenes()["crowd"]
    drawn = Film(crowd, np.linspace(0, 0.5, 3), 25.0, 1.0)
    assert len(drawn.scenery.players) == PENDULA_MAX
    assert f"{PENDULA_MAX} of 4000 pendula" in drawn.figure.texts[2].get_text()


@pytest.mark.parametrize("name", ["paper-cart-3", "chain-spatial", "metronomes"])
def test_energies_of_the_bars_are_those_of_the_run(name: str) -> None:
    trajectory = run(name, 1.0)
    energies, mechanics = energies_of(trajectory, trajectory.times[::40]), trajectory.mechanics
    assert energies.kinetic.sum(1) == pytest.approx(energies.totals[0])
    whole = energies.totals[0] + energies.totals[1]
    assert whole - whole[0] == pytest.approx((mechanics.energy - mechanics.energy[0])[::40], abs=1e-9 * whole[0])
    assert np.all(energies.potential >= -1e-12)


def test_picked_links_move_as_they_did() -> None:
    trajectory = run("paper-cart-3", 1.0)
    some = pick_links(trajectory.motion, np.array([4, 1]))
    assert np.array_equal(some.links[:, 1], trajectory.motion.links[:, 1])
    assert np.array_equal(some.link_rates[:, 0], trajectory.motion.link_rates[:, 4])
