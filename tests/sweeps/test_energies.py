"""Measures against energy: starts drawn at random have it, and what is measured of them is what others measure."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from modal import load
from modal.errors import SceneError
from modal.scene import Scene
from modal.scene.parameters import parse_variations
from nonlinear.chaos import lyapunov_exponent, regular_exponent
from nonlinear.ensembles import starts_at
from nonlinear.plotting import sweep_figure
from nonlinear.sweeps import Study, Sweep, chaos_by_energy, parse_measures, save, sweep, sweep_text
from nonlinear.sweeps import load as loaded
from nonlinear.system import State

ENERGIES, SECONDS, MEMBERS, SEED = (0.05, 30.0), 10.0, 4, 3
CHAIN = load("chain-2")


@cache
def swept() -> Sweep:
    return chaos_by_energy(CHAIN, ENERGIES, SECONDS, members=MEMBERS, seed=SEED, workers=1)


def energy(scene: Scene, state: State, cart: float = 0.0) -> float:
    """½ Σ m v² + ½ M x'² + Σ m g y from the places of bobs and rods' centres of one pendulum, above hanging."""
    pivot, drop, total = np.array([state.cart_rate, 0.0]), 0.0, cart * state.cart_rate**2 / 2
    links = [link for link in scene.pendulum[0].links for _ in range(link.count)]
    for link, angle, rate in zip(links, state.links, state.link_rates, strict=True):
        along = np.array([np.cos(angle), -np.sin(angle)]) * rate
        centre, inertia = link.proportions(link.mass, link.length)
        total += link.mass * np.sum((pivot + centre * along) ** 2) / 2 + inertia * rate**2 / 2
        total += link.mass * scene.gravity * (drop + centre * (1 - np.cos(angle)))
        pivot, drop = pivot + link.length * along, drop + link.length * (1 - np.cos(angle))
    return float(total)


@pytest.mark.parametrize("joules", [1e-4, 3.0, 60.0])
def test_starts_have_their_energy(joules: float) -> None:
    for scene in (CHAIN, load("crane-hook")):
        starts = starts_at(scene, joules, 5, seed=1)
        mass = scene.cart.mass if scene.cart else 0.0
        assert [energy(scene, start, mass) for start in starts] == pytest.approx([joules] * 5, rel=1e-9, abs=1e-11)
        assert len({*(float(start.links[0]) for start in starts)}) == 5


def test_starts_fill_what_the_energy_allows() -> None:
    """Of one link (a pendulum of 1 kg, 1 m), angles are even up to arccos(1 − E/mgl)."""
    starts = starts_at(load("chain-1"), 2.0, 2000, seed=4)
    angles = np.abs([start.links[0] for start in starts])
    bob = load("chain-1").pendulum[0].links[0]
    widest = np.arccos(1 - 2.0 / (bob.mass * load("chain-1").gravity * bob.length))
    assert angles.max() <= widest
    assert np.quantile(angles, [0.25, 0.5, 0.75]) == pytest.approx(
        widest * np.array([0.25, 0.5, 0.75]), abs=0.05 * widest
    )


def test_quantiles_are_those_of_exponents_of_the_same_starts() -> None:
    """The route of `chaos`, which integrates them together in another way: chaos parts the two within their spread."""
    for index, joules in enumerate(ENERGIES):
        starts = starts_at(CHAIN, joules, MEMBERS, seed=(SEED, index))
        expected = lyapunov_exponent(CHAIN, SECONDS, starts=starts).members
        for name, part in (("q05", 0.05), ("median", 0.5), ("q95", 0.95)):
            column = swept().values(f"lyapunov_{name}_per_s")
            assert column[index] == pytest.approx(np.quantile(expected, part), abs=1e-3, rel=0.1 * index)
        limit = regular_exponent(CHAIN, SECONDS)
        assert swept().values("chaotic_share")[index] == np.mean(expected > limit)


def test_small_motion_is_regular_and_large_is_chaotic() -> None:
    limit = regular_exponent(CHAIN, SECONDS)
    assert swept().values("chaotic_share").tolist() == [0.0, 1.0]
    assert abs(swept().values("lyapunov_median_per_s")[0]) < limit / 2
    assert swept().values("lyapunov_q05_per_s")[1] > limit


def test_the_seed_determines_the_starts(tmp_path: Path) -> None:
    """Whoever computes them; and files keep it."""
    first, again, other = (
        chaos_by_energy(CHAIN, ENERGIES[:1], 6.5, members=1, seed=seed, workers=1) for seed in (SEED, SEED, SEED + 1)
    )
    study, shares = first.study, first.values("chaotic_share").tolist()
    assert [row.numbers for row in again.rows] == [row.numbers for row in first.rows]
    assert all(np.isfinite(number) for row in first.rows for number in row.numbers.values())
    assert other.rows[0].numbers != first.rows[0].numbers
    for name in ("energies.npz", "energies.csv"):
        save(first, tmp_path / name)
        kept = loaded(tmp_path / name)
        assert kept.study.fingerprint == study.fingerprint
        assert kept.values("chaotic_share").tolist() == shares
    assert study.fingerprint != other.study.fingerprint


def test_energies_out_of_reach_have_reasons() -> None:
    measures = parse_measures(["largest_angle:0.5"])
    energies = sweep(Study(CHAIN, parse_variations(["start.energy=-3,1,1e12"]), measures, 2), workers=1)
    assert "below 0 J, that of links that all hang" in energies.failures[0]
    assert "links would turn at" in energies.failures[2]
    assert energies.values("largest_angle_median_deg")[1] > 0
    assert "2 starts at random" in sweep_text(energies)


@pytest.mark.parametrize(
    ("scene", "texts", "measure", "members", "words"),
    [
        ("chain-2", ["start.energy=1,2"], "lyapunov", 0, "start.energy: needs `members`"),
        ("chain-2", ["gravity=1,2"], "frequencies", 3, "starts are drawn where start.energy is varied"),
        ("chain-2", ["start.energy=1,2"], "beat", 3, "beat: cannot be measured of starts drawn at an energy"),
        ("chain-2", ["start.energy=1,2"], "lyapunov:1", 3, "must be at least"),
        ("hoisting-crane", ["start.energy=1,2"], "lyapunov", 3, "no energy of a rope that is wound up"),
        ("chain-spatial", ["start.energy=1,2"], "lyapunov", 3, "in the plane"),
    ],
)
def test_what_cannot_be_is_refused(scene: str, texts: list[str], measure: str, members: int, words: str) -> None:
    with pytest.raises(SceneError, match=words):
        Study(load(scene), parse_variations(texts), parse_measures([measure]), members)


def test_energy_goes_beside_numbers_of_the_scene() -> None:
    """The exponent of the other scene, whose starts are its own."""
    axes = parse_variations(["gravity=5,20", "start.energy=2"])
    both = sweep(Study(CHAIN, axes, parse_measures(["largest_angle:1"]), 3, 1), workers=1)
    median = both.values("largest_angle_median_deg")[:, 0]
    assert median[0] > 1.3 * median[1]


def test_the_picture_shows_the_band_and_the_share() -> None:
    figure = swept().plot()
    assert [axis.get_ylabel() for axis in figure.axes] == ["largest Lyapunov exponent (1/s)", "chaotic starts (%)"]
    assert figure.axes[1].lines[0].get_ydata() == pytest.approx([0.0, 100.0])
    legend = figure.axes[0].get_legend()
    assert legend
    assert [words.get_text() for words in legend.get_texts()] == [
        "5 to 95 % of starts",
        "median",
        "limit of regular motion",
    ]
    sweep_figure(swept())
