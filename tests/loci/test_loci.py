"""Frequency loci: modes followed by shape, crossings distinguished from veerings, gaps against closed forms."""

from __future__ import annotations

import io
from itertools import pairwise
from math import sqrt

import numpy as np
import pytest
from amounts import usually
from scenes import motion_scene

from modal import (
    Bob,
    Body,
    Cart,
    ComputationError,
    Fixed,
    Pendulum,
    Rod,
    Scene,
    SceneError,
    load,
    matrices,
    natural_modes,
)
from modal.loci import Loci, follow_loci
from modal.loci.following import follow, overlaps, solve_at
from modal.plotting import loci_figure, save
from modal.plotting.loci import encounter_words
from modal.scene.parameters import parse_variations, vary

LENGTH = "pendulum[0].links[0].length"
G = 9.81


def pair(support: Fixed | Cart, **more: str) -> Scene:
    """Two simple pendula, the second of 1.2 m."""
    bobs = (Pendulum(links=(Bob(mass=1.0, length=length),)) for length in (1.0, 1.2))
    return Scene(gravity=G, support=support, pendulum=tuple(bobs), **more)


def of(scene: Scene, text: str) -> Loci:
    return follow_loci(scene, parse_variations([text])[0])


def test_uncoupled_pendula_cross_where_their_lengths_are_equal() -> None:
    loci = of(pair(Fixed()), f"{LENGTH}=0.8:1.7:20")
    (meeting,) = loci.encounters
    assert meeting.kind == "crossing"
    assert meeting.loci == (0, 1)
    assert meeting.value == pytest.approx(1.2, rel=1e-14)
    assert meeting.omega == pytest.approx(sqrt(G / 1.2), rel=1e-14)
    assert meeting.gap < 1e-14
    assert meeting.exchange < 1e-14
    assert np.allclose(loci.omega[:, 0], sqrt(G / 1.2), rtol=1e-14)
    assert np.allclose(loci.omega[:, 1], np.sqrt(G / loci.values), rtol=1e-14)


def test_a_crossing_on_a_value_of_the_grid_is_one_crossing() -> None:
    loci = of(pair(Fixed()), f"{LENGTH}=0.8,1.2,1.6")
    assert [(m.kind, m.value, m.gap) for m in loci.encounters] == [("crossing", 1.2, 0.0)]
    assert np.allclose(loci.omega[:, 1], np.sqrt(G / loci.values), rtol=1e-14)


def test_meeting_at_an_end_is_no_crossing() -> None:
    assert of(pair(Fixed()), f"{LENGTH}=0.8,1.0,1.2").encounters == ()


def test_in_space_both_directions_go_together() -> None:
    loci = of(pair(Fixed(), space="space"), f"{LENGTH}=0.8:1.7:9")
    assert loci.multiplicity.tolist() == [2, 2]
    assert [m.kind for m in loci.encounters] == ["crossing"]


@pytest.mark.parametrize("mass", [30.0, 100.0, 1e4, 1e8, 1e12])
def test_on_a_heavy_cart_they_veer_by_the_coupling(mass: float) -> None:
    """Equal pendula of 1 kg: ω_in² = ω_0² (1 + 2m/m_c), ω_anti = ω_0."""
    loci = of(pair(Cart(mass=mass)), f"{LENGTH}=0.8:1.7:8")
    (meeting,) = loci.encounters
    coupling = 2 / mass
    gap = sqrt(G / 1.2) * coupling / (1 + sqrt(1 + coupling))
    assert meeting.kind == "veering"
    assert meeting.loci == (1, 2)
    assert meeting.gap == pytest.approx(gap, rel=1.5 * coupling + 2e-3)
    assert meeting.gap <= gap + 1e-15
    assert meeting.value == pytest.approx(1.2, rel=2 * coupling + 1e-8)
    assert meeting.exchange > 0.25
    assert np.all(np.diff(loci.omega, axis=1) > 0), "loci that veer keep their order"


def dense_gap(scene: Scene, value: float) -> float:
    model = matrices(vary(scene, {LENGTH: value}))
    omega = np.sqrt(np.maximum(np.linalg.eigvals(np.linalg.solve(model.M, model.K)).real, 0))
    low, high = np.sort(omega)[1:]
    return float(high - low)


def test_the_smallest_gap_is_that_of_a_dense_scan() -> None:
    scene = load("crane-two-loads")
    (meeting,) = of(scene, f"{LENGTH}=5:20:6").encounters
    scan = [dense_gap(scene, value) for value in np.linspace(9.9, 10.3, 401)]
    assert meeting.gap == pytest.approx(min(scan), rel=1e-5)
    assert meeting.gap <= min(scan) + 1e-12
    assert meeting.value == pytest.approx(9.9 + 0.001 * int(np.argmin(scan)), abs=2e-3)


@pytest.mark.parametrize("seed", usually(range(0, 4, 2), range(6)))
def test_loci_hold_all_frequencies_and_shapes_go_on(seed: int) -> None:
    scene = motion_scene(seed, damped=False, standing=False)
    loci = of(scene, f"{LENGTH}=0.2:4:7log")
    for value in (loci.variation.values[0], loci.variation.values[3], loci.variation.values[-1]):
        modes = natural_modes(vary(scene, {LENGTH: value}))
        mine = np.repeat(loci.omega[np.flatnonzero(loci.values == value)[0]], loci.multiplicity)
        assert np.allclose(np.sort(mine), np.repeat(modes.omega, modes.multiplicity), rtol=1e-12)
    assert set(loci.variation.values) <= set(loci.values.tolist())
    assert np.all(np.diff(loci.values) > 0)


def test_antiphase_copies_cross_what_moves_the_cart() -> None:
    """Three equal pendula hold the cart still in two ways; their frequency passes those of the other pendula."""
    three = Pendulum(links=(Bob(mass=1.0, length=1.2),), count=3)
    scene = Scene(gravity=G, support=Cart(mass=50.0), pendulum=(three, Pendulum(links=(Rod(mass=1.0, length=1.0),))))
    loci = of(scene, f"{LENGTH}=0.3:3:9log")
    double = int(np.flatnonzero(loci.multiplicity == 2)[0])
    assert np.allclose(loci.omega[:, double], np.sqrt(G / loci.values), rtol=1e-13)
    kinds = {kind: [m for m in loci.encounters if m.kind == kind] for kind in ("crossing", "veering")}
    assert [double in m.loci for m in kinds["crossing"]] == [True]
    assert [double in m.loci for m in kinds["veering"]] == [False]
    other = next(k for k in kinds["crossing"][0].loci if k != double)
    sides = [np.sign(loci.omega[row, other] - loci.omega[row, double]) for row in (0, -1)]
    assert sides[0] == -sides[1] != 0


def test_a_smallest_gap_without_exchange_of_shapes_is_no_veering() -> None:
    """A body's ω² = m g c/(I + m c²) is largest at c = √(I/m), here just below that of a free bob next to it."""
    body = Body(mass=1.0, length=1.0, centre=0.3, inertia=0.25)
    scene = Scene(gravity=G, pendulum=(Pendulum(links=(body,)), Pendulum(links=(Bob(mass=1.0, length=0.9),))))
    loci = of(scene, "pendulum[0].links[0].centre=0.1:2:20")
    gap = np.abs(np.diff(loci.omega, axis=1))[:, 0]
    assert 0 < np.argmin(gap) < len(gap) - 1
    assert gap.min() < min(gap[0], gap[-1]) / 2
    assert loci.encounters == ()


def test_only_neighbours_veer() -> None:
    """A spring on the trolley: its mode veers from the slower load's, no more."""
    loci = of(load("crane-two-loads"), "support.stiffness=0:5000:6")
    gap = loci.omega[:, 2] - loci.omega[:, 0]
    assert 0 < np.argmin(gap) < len(gap) - 1
    assert [(m.kind, m.loci) for m in loci.encounters] == [("veering", (0, 1))]


def test_a_degenerate_space_is_followed_by_projection() -> None:
    """At equal lengths the modes of two free pendula may be any mixture: the follower finds the unmixed ones."""
    scene = pair(Fixed())
    before, after = (solve_at(scene, LENGTH, value) for value in (1.15, 1.2))
    turn = np.array([[np.cos(0.7), np.sin(0.7)], [-np.sin(0.7), np.cos(0.7)]])
    mixed = after.in_order(np.arange(2), after.shapes @ turn)
    followed, sure = follow(before, mixed)
    assert sure
    assert np.allclose(overlaps(before, followed), np.eye(2), atol=1e-12)
    assert np.max(np.abs(overlaps(before, mixed) - np.eye(2))) > 0.2


def test_shapes_are_compared_by_the_mass_matrix() -> None:
    scene, n = load("chain-unequal"), 3
    here = solve_at(scene, LENGTH, 1.0)
    assert np.allclose(overlaps(here, here), np.eye(n), atol=1e-12)
    assert np.allclose(here.shapes[0].T @ matrices(scene).M @ here.shapes[0], np.eye(n), atol=1e-12)
    there = solve_at(scene, LENGTH, 1.1)
    assert 0.9 < overlaps(here, there)[0, 0] ** 2 < 1 - 1e-9


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("metronomes", "gravity=5:10:3", "decay or grow"),
        ("cart-upright", "gravity=5:10:3", "decay or grow"),
        ("thousand-pendula", "gravity=5:10:3", "too many to follow"),
        ("paper-cart-2", "support.mass=0:10:3", ""),
    ],
)
def test_what_cannot_be_followed_is_refused(name: str, text: str, words: str) -> None:
    if words:
        with pytest.raises(ComputationError, match=words):
            of(load(name), text)
    else:
        assert of(load(name), text).omega.shape[1] == 5


def test_a_mode_that_comes_from_nowhere_is_said() -> None:
    scene = pair(Cart(mass=1.0))
    with pytest.raises(ComputationError, match="number of modes changes"):
        of(scene, "support.mass=0,1,2")


@pytest.mark.parametrize("text", ["pendulum[0].count=1,2,3", f"{LENGTH}=1.0", "support.mas=1:2:3"])
def test_loci_need_a_smooth_parameter(text: str) -> None:
    with pytest.raises(SceneError):
        of(load("paper-cart-2"), text)


def test_progress_is_told_value_by_value() -> None:
    heard: list[float] = []
    follow_loci(load("chain-3"), parse_variations([f"{LENGTH}=1:2:4"])[0], heard.append)
    assert heard == [2, 3, 4]
    assert all(later > earlier for earlier, later in pairwise(heard))


@pytest.mark.parametrize("kind", usually(["svg"], ["png", "svg", "pdf"]))
def test_a_picture_is_drawn(kind: str) -> None:
    loci = of(load("crane-two-loads"), f"{LENGTH}=5:20:4log")
    stream = io.BytesIO()
    save(loci_figure(loci), stream, kind)
    assert len(stream.getvalue()) > 5000
    words = encounter_words(loci.encounters[0], loci)
    assert words == "veering 2 · 3 at 10.083 m, gap 0.09444 rad/s"
