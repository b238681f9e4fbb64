"""Pictures of structures: everything where the equations have it, and nothing upon anything else."""

from __future__ import annotations

import io
from functools import cache

import numpy as np
import pytest
from seen import flaws

from modal import load, natural_modes
from modal.coupling import explain
from modal.modes import Modes
from modal.plotting import coupling_figure, film_modes, shapes_figure, sketch_figure, theme
from modal.plotting.shapes import layout_of
from modal.scene import Scene
from modal.structure import Piece, Scaffold, structure_of
from nonlinear import State, simulate
from nonlinear.dynamics import Mechanics
from nonlinear.integration import Trajectory
from nonlinear.plotting.animation import Film
from nonlinear.plotting.run import run_figure
from nonlinear.plotting.scene import stage_of
from nonlinear.postprocessing import resample
from nonlinear.system import state_at_rest


@cache
def modes(name: str) -> Modes:
    return natural_modes(load(name).conservative)


@cache
def run(name: str) -> Trajectory:
    scene: Scene = load(name)
    start: State | None = state_at_rest(scene, [10.0]) if name == "ship-crane" else None
    return simulate(scene, 20.0 if name == "ship-crane" else 2.0, start=start, output=101)


def scaffold(name: str) -> Scaffold:
    scaffold = layout_of(modes(name)).scaffold
    assert scaffold is not None
    return scaffold


def of_role(pieces: list[Piece], role: str) -> list[Piece]:
    return [piece for piece in pieces if piece.role == role]


# ---------------------------------------------------------------------------------------------- where things are


def test_rods_of_a_swing_keep_their_length_at_any_angle() -> None:
    eta = np.array([[0.0, 0.0], [0.2, -0.3], [0.4, 0.1]])
    rods = of_role(scaffold("two-swings").pieces(eta, {}), "line")
    assert len(rods) == 4
    for rod in rods:
        lengths = np.linalg.norm(rod.points[:, 1] - rod.points[:, 0], axis=-1)
        assert lengths == pytest.approx(np.full(3, 0.26595745), rel=1e-12)


def test_bodies_are_rigid_and_turn_about_their_axis() -> None:
    eta = np.array([[0.0], [0.7]])
    made = scaffold("beam")
    (board,) = of_role(made.pieces(eta, {}), "body")
    apart = np.linalg.norm(board.points[:, :, None] - board.points[:, None], axis=-1)
    assert apart[1] == pytest.approx(apart[0], abs=1e-12)
    assert np.linalg.norm(board.points, axis=-1)[1] == pytest.approx(
        np.linalg.norm(board.points[0], axis=-1), rel=1e-12
    )
    turned = made.pivots(eta)
    angle = np.arctan2(*(turned[1, 1] - turned[1, 0])[::-1])
    assert abs(angle) == pytest.approx(0.7, rel=1e-12)


@pytest.mark.parametrize("name", ["ship-crane", "beam", "two-bobs"])
def test_pendula_of_a_film_hang_where_the_equations_have_them(name: str) -> None:
    """The stage's joints against positions from the mechanics of the run."""
    trajectory = run(name)
    at = np.linspace(0.0, trajectory.times[-1], 7)
    stage = stage_of(trajectory, at)
    assert not stage.notes
    exact = Mechanics(trajectory.system, resample(trajectory.times, trajectory.motion, at), at)
    starts = exact.joints - trajectory.system.by_link("length")[:, None] * exact.vectors[0]
    for k, actor in enumerate(stage.actors):
        ends = exact.joints[:, k] * (1.0, -1.0)
        assert actor.joints[:, 1] == pytest.approx(ends, abs=1e-12)
        assert actor.joints[:, 0] == pytest.approx(starts[:, k] * (1.0, -1.0), abs=1e-12)


def test_a_spring_between_pendula_ends_on_them() -> None:
    trajectory = run("two-bobs")
    stage = stage_of(trajectory, np.linspace(0.0, 2.0, 7))
    (spring,) = of_role(list(stage.pieces), "spring")
    for end, actor in ((0, stage.actors[0]), (-1, stage.actors[1])):
        assert spring.points[:, end] == pytest.approx(actor.joints.mean(1), abs=1e-12)


def test_a_spring_between_carriers_joins_the_edges_of_their_bodies() -> None:
    made = scaffold("two-swings")
    pieces = made.pieces(np.zeros((1, 2)), {})
    halves = [piece for piece in of_role(pieces, "spring") if piece.points.shape[1] > 2]
    left, right = of_role(pieces, "body")
    assert halves[0].points[0, 0, 0] == pytest.approx(left.points[..., 0].max())
    assert halves[1].points[0, 0, 0] == pytest.approx(right.points[..., 0].min())


def test_a_long_gap_is_shortened_and_its_spring_is_broken() -> None:
    made = scaffold("two-swings")
    pieces = made.pieces(np.zeros((1, 2)), {})
    left, right = of_role(pieces, "body")
    assert right.points[..., 0].min() - left.points[..., 0].max() == pytest.approx(2.5 * made.unit)
    assert len(of_role(pieces, "spring")) == 4
    assert "long gaps between supports shortened" in made.notes
    assert made.structure.carriers[1].position[0] - made.structure.carriers[0].position[0] == 2.0


def test_carts_that_springs_join_from_the_ground_are_storeys() -> None:
    """Each above the one that carries it; the pendulum hangs within, and columns end on both floors as they sway."""
    made = scaffold("tower")
    assert made.storeys == (0, 1)
    eta = np.array([[0.0, 0.0], [0.1, 0.3]])
    pieces = made.pieces(eta, {})
    lower, upper = of_role(pieces, "body")
    assert 0 < lower.points[..., 1].min() < lower.points[..., 1].max() < upper.points[..., 1].min() - made.unit
    assert np.ptp(upper.points[1] - upper.points[0], axis=0) == pytest.approx([0.0, 0.0], abs=1e-12)
    assert not of_role(pieces, "spring")
    first, second, *_ = (column.points for column in of_role(pieces, "line")[::2])
    assert first[:, 0] == pytest.approx(first[0, 0] + np.zeros((2, 2)))
    assert first[1, -1, 0] - first[0, -1, 0] == pytest.approx(0.1)
    assert second[1, 0, 0] - second[0, 0, 0] == pytest.approx(0.1)
    assert second[1, -1, 0] - second[0, -1, 0] == pytest.approx(0.3)


def test_carts_that_no_line_of_springs_joins_are_set_apart_with_their_names() -> None:
    """A second spring to the ground is none of a tower."""
    scene = load("tower").conservative
    braced = scene.replace(spring=(*scene.spring, scene.spring[0].replace(between=("ground", "floor2"))))
    made = layout_of(natural_modes(braced)).scaffold
    assert made.storeys == ()
    assert made.shifts[0, 0] == 0 < made.shifts[1, 0]
    bodies = [piece for piece in of_role(made.pieces(np.zeros((1, 2)), {}), "body") if piece.points.shape[1] == 4]
    assert bodies[0].points[..., 0].max() < bodies[1].points[..., 0].min()
    assert [name for name, *_ in made.names] == ["floor1", "floor2"]


def test_equal_pendula_on_one_point_are_set_apart() -> None:
    made = scaffold("two-swings")
    structure = structure_of(load("two-swings"))
    assert len({structure.pivots[p] for p in made.pendula.tolist()}) == 2
    x = made.pivots(np.zeros((1, 2)))[0, :, 0]
    assert np.diff(np.sort(x)).min() > 0.03
    assert len(x) == 30


# ------------------------------------------------------------------------------------------------ whole pictures


@pytest.mark.parametrize("name", ["tower", "two-swings", "beam"])
def test_panels_hold_all_that_moves(name: str) -> None:
    """No bob at the end of its swing is cut off."""
    with theme("light"):
        figure = shapes_figure(modes(name))
    for axis in figure.axes:
        (left, right), (bottom, top) = axis.get_xlim(), axis.get_ylim()
        points = np.concatenate([line.get_xydata() for line in axis.lines])
        assert left < points[:, 0].min() < points[:, 0].max() < right
        assert bottom < points[:, 1].min() < points[:, 1].max() < top


@pytest.mark.parametrize("name", ["beam", "ship-crane"])
def test_pictures_of_structures_are_seen(name: str) -> None:
    with theme("light"):
        assert flaws(shapes_figure(modes(name))) == []
        assert flaws(run_figure(run(name))) == []
    with theme("dark"):
        assert flaws(coupling_figure(explain(load(name)))) == []
        film = Film(run(name), np.linspace(0.0, 2.0, 3), 20.0, 1.0)
        film.show(2)
        assert flaws(film.figure) == []


def test_a_picture_of_a_run_has_the_structure_by_units() -> None:
    titles = [
        axis.get_ylabel() for axis in run_figure(run("ship-crane")).axes if axis.get_title(loc="left") == "Structure"
    ]
    assert titles == ["displacement (m)", "angle (°)"]


def test_a_film_of_modes_moves_the_structure() -> None:
    stream = io.BytesIO()
    film = film_modes(modes("beam"), stream, "gif", [0], fps=2.0)
    assert stream.getvalue()[:3] == b"GIF"
    assert len(film.panels) == 1


@pytest.mark.parametrize(
    ("name", "symbols"),
    [
        ("two-swings", ["$x_\\mathrm{left}$", "$x_\\mathrm{right}$", "$k$", "$\\theta_{2}$"]),
        ("beam", ["$m_s$", "$\\varphi$", "$k$"]),
        ("two-bobs", ["$k$", "$\\theta_{1}$"]),
    ],
)
def test_a_sketch_names_the_coordinates_of_a_structure(name: str, symbols: list[str]) -> None:
    """Of fifteen equal metronomes one is drawn."""
    figure = sketch_figure(load(name))
    told = [text.get_text() for text in figure.axes[0].texts]
    assert set(symbols) <= set(told)
    assert sum(text.startswith("$\\theta") for text in told) == 2
    figure.draw_without_rendering()
    (left, low), (right, high) = figure.bbox.get_points()
    for text in figure.axes[0].texts:
        box = text.get_window_extent()
        assert box.x0 >= left
        assert box.x1 <= right
        assert box.y0 >= low
        assert box.y1 <= high
