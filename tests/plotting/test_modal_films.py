"""Films of modes: a loop without a seam, shapes that are those of the modes, and files that are whole or absent."""

from __future__ import annotations

import shutil
import sys
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from amounts import usually
from PIL import Image, ImageChops

import modal
from modal.errors import ComputationError, SceneError
from modal.modes import Modes, natural_modes
from modal.plotting import film_modes
from modal.plotting.films import DECAYING, LOOP, ModalFilm, motion
from modal.plotting.shapes import layout_of
from modal.plotting.style import theme
from modal.scene import Bob, Pendulum, Scene


def modes_of(name: str) -> Modes:
    return natural_modes(modal.load(name))


def film_of(modes: Modes, numbers: list[int], rate: float = 10.0, amplitude_deg: float = 20.0) -> ModalFilm:
    with theme("light"):
        return ModalFilm(modes, numbers, rate, amplitude_deg)


def lines(film: ModalFilm, panel: int = 0) -> list[np.ndarray]:
    """The points of the chains that a panel draws now."""
    drawn = [
        artist for artist in film.panels[panel].artists if hasattr(artist, "get_xydata") and artist.get_zorder() >= 2
    ]
    return [line.get_xydata() for line in drawn if line.get_linestyle() == "-" and line.get_marker() == "None"]


def test_bobs_are_where_the_mode_has_them() -> None:
    """Two bobs in mode 2: joints of the drawing from the shape, frame by frame, and from its closed form 1 : −√2."""
    film = film_of(modes_of("chain-2"), [1])
    angles = np.radians(20.0) * np.array([-1 / np.sqrt(2), 1.0])
    for frame in range(film.count):
        film.show(frame)
        turned = angles * np.cos(2 * np.pi * frame / film.count)
        expected = np.cumsum([[0.0, 0.0], *np.column_stack((np.sin(turned), -np.cos(turned)))], axis=0)
        points = lines(film)[0]
        assert min(np.abs(points - expected).max(), np.abs(points * [-1, 1] - expected).max()) < 1e-12


def test_a_damped_shape_turns_with_its_phases() -> None:
    """A damper at one joint: the angle of each link over the loop is a Re(φ e^{−2πis})."""
    links = [Bob(mass=1.0, length=1.0, damping=2.0), Bob(mass=1.0, length=1.0)]
    modes = natural_modes(Scene(gravity=9.81, pendulum=[Pendulum(links=links)]))
    number = next(
        k for k in range(len(modes)) if np.abs(modes.shape(k).angles.imag).max() > 0.1 and modes[k].oscillates
    )
    shape, film = modes.shape(number), film_of(modes, [number])
    largest = None
    for frame in range(film.count):
        film.show(frame)
        first = lines(film)[0]
        angle = np.arctan2(*(first[1] - first[0]) * [1, -1])
        turned = (shape.angles[0] * np.exp(-2j * np.pi * frame / film.count)).real
        if largest is None:
            largest = angle / turned
        assert angle == pytest.approx(largest * turned, abs=1e-12)
    assert 0 < largest <= np.radians(20.0) + 1e-12


@pytest.mark.parametrize("name", usually(["huygens"], ["chain-2", "huygens", "cart-upright"]))
def test_the_loop_has_no_seam(name: str) -> None:
    """From the last frame to the first it is no farther than between any others, and no frame is shown twice."""
    modes = modes_of(name)
    for row in modes:
        if row.omega == 0:
            continue
        s = np.linspace(0, 1, 401)
        at = np.array([motion(row, phase) for phase in s])
        assert abs(at[-1] - at[0]) < 1e-12
        assert np.abs(np.diff(at)).max() < 0.035
    film = film_of(modes, list(range(len(modes))), rate=5.0)
    images = [film.image(frame) for frame in range(film.count)]
    steps = [
        np.asarray(ImageChops.difference(image, other), dtype=float).sum()
        for image, other in zip(images, [*images[1:], images[0]], strict=True)
    ]
    assert 0 < steps[-1] <= 1.3 * max(steps[:-1])
    assert film.count == round(LOOP * 5.0)


def test_an_overdamped_mode_decays_and_a_growing_one_grows() -> None:
    overdamped = modes_of("huygens")[1]
    s = np.linspace(0, DECAYING, 9)
    decay = np.array([motion(overdamped, phase) for phase in s])
    assert overdamped.is_overdamped
    assert not overdamped.oscillates
    np.testing.assert_allclose(np.log(decay), -4 * s / DECAYING, atol=1e-12)
    growing = modes_of("cart-upright")[3]
    assert growing.growth_rate
    assert not growing.is_overdamped
    grown = np.array([motion(growing, phase) for phase in 1 - s])
    np.testing.assert_allclose(grown, decay, rtol=1e-12)


def test_a_rigid_translation_stands_with_an_arrow() -> None:
    film = film_of(modes_of("paper-cart-2"), [0, 1])
    film.show(3)
    assert film.panels[0].artists == []
    assert len(film.panels[1].artists) > 0
    assert len(film.panels[0].axis.texts) == 1


def test_of_many_pendula_angles_are_drawn_over_their_numbers() -> None:
    modes = modes_of("thousand-pendula")
    film = film_of(modes, [500])
    film.show(0)
    (line,) = lines(film)
    assert line[:, 0].tolist() == list(range(1, 1001))
    np.testing.assert_allclose(line[:, 1], 20.0 * modes.shape(500).angles, rtol=1e-12)
    assert film.panels[0].axis.get_ylabel() == "angle (°)"


@pytest.mark.parametrize("name", usually(["huygens"], ["paper-cart-2", "huygens"]))
def test_everything_stays_inside_its_panel(name: str) -> None:
    modes = modes_of(name)
    film = film_of(modes, list(range(len(modes))))
    layout = layout_of(modes)
    for frame in range(film.count):
        film.show(frame)
        for panel in range(len(film.panels)):
            for points in lines(film, panel):
                assert np.abs(points[:, 0]).max() < layout.half_width
                assert layout.bottom < points[:, 1].min()
                assert points[:, 1].max() < layout.top


def written(form: str, **options: object) -> bytes:
    stream = BytesIO()
    with theme("light"):
        film_modes(modes_of("chain-1"), stream, form, **options)
    return stream.getvalue()


def test_a_gif_goes_round_for_ever() -> None:
    film = written("gif")
    picture = Image.open(BytesIO(film))
    assert picture.info["loop"] == 0
    assert picture.n_frames == round(LOOP * 25)
    assert picture.info["duration"] == 40
    assert len(film) < 200_000


def test_a_page_holds_every_frame() -> None:
    page = written("html", fps=5.0).decode()
    assert page.count('",\n') == round(LOOP * 5)
    assert "http" not in page


def test_mp4_of_any_size_of_figure() -> None:
    pytest.importorskip("imageio_ffmpeg")
    assert written("mp4", fps=10.0)[4:8] == b"ftyp"


def test_mp4_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda name: None)
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(ComputationError, match="`video`"):
        written("mp4")


def test_what_cannot_be_filmed_is_refused() -> None:
    with pytest.raises(SceneError, match="one of gif, mp4, html"):
        written("avi")
    with pytest.raises(SceneError, match="fps"):
        written("gif", fps=1000.0)
    with pytest.raises(ComputationError, match="at most 24"):
        written("gif", numbers=range(25))


def test_a_file_is_whole_or_absent(tmp_path: Path) -> None:
    modes = modes_of("chain-1")

    def stop(done: float) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        modes.animate(tmp_path / "a.gif", report=stop)
    assert list(tmp_path.iterdir()) == []
    modes.animate(tmp_path / "a.gif", fps=5.0)
    with Image.open(tmp_path / "a.gif") as picture:
        assert picture.n_frames == round(LOOP * 5)
