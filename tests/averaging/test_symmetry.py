"""Copies of steady motions by exchange of equal pendula, against every permutation tried one by one."""

from __future__ import annotations

from functools import cache, partial
from itertools import permutations

import numpy as np
import pytest

from modal.scene import Scene, scene_from
from modal.types import Complexes, Ints
from nonlinear.averaging import (
    RelativeEquilibrium,
    average,
    is_same_motion,
    likeness,
    relative_equilibria,
    relative_equilibrium,
)
from nonlinear.averaging.equilibria import count_copies, exchange, kinds
from nonlinear.ensembles.endings import Outcomes, orbit_near, settle
from nonlinear.orbits import Orbit
from nonlinear.orbits.cycles import cycle_of
from nonlinear.synchronization import rhythm_of
from nonlinear.system import State, motion_of

LENGTHS = (0.249044, 0.249067, 0.250278)
DRIVES = ((0.0005169, 0.003671), (0.000517, 0.003672), (0.0005208, 0.003699))


def metronomes(
    lengths: tuple[float, ...], numbers: tuple[tuple[float, float], ...], mass: float = 17.0, angle: float = 10.0
) -> Scene:
    """Bobs with van der Pol drives on a cart with a damper."""
    drive = {"kind": "van-der-pol", "angle_deg": angle}
    link = {"kind": "bob", "mass": 0.664}
    pendula = [
        {"links": [{**link, "length": length, "damping": damping, "drive": {**drive, "strength": strength}}]}
        for length, (damping, strength) in zip(lengths, numbers, strict=True)
    ]
    return scene_from(
        {"gravity": 9.81, "support": {"kind": "cart", "mass": mass, "damping": 0.51}, "pendulum": pendula}
    )


@cache
def equal(count: int) -> tuple[RelativeEquilibrium, ...]:
    return relative_equilibria(average(metronomes((0.25,) * count, ((0.0005, 0.00367),) * count)))


def splay(states: tuple[RelativeEquilibrium, ...]) -> RelativeEquilibrium:
    """The stable state of three pendula a third of a swing apart."""
    return next(
        state
        for state in states
        if state.is_stable and np.ptp(np.abs(links(state))) < 1e-6 and abs(links(state).sum()) < 0.1
    )


def links(equilibrium: RelativeEquilibrium) -> Complexes:
    return np.asarray(equilibrium.averaged.link_shapes @ equilibrium.z)


def counted(states: Complexes) -> int:
    """How many of these rows (S, N) differ by more than a common phase."""
    distinct: list[Complexes] = []
    for row in states:
        if all(
            abs(abs(np.vdot(row, other)) - np.linalg.norm(row) * np.linalg.norm(other)) > 1e-7 for other in distinct
        ):
            distinct.append(row)
    return len(distinct)


def test_equal_pendula_are_told_from_others() -> None:
    bob = {"kind": "bob", "mass": 1.0, "length": 1.0}
    other = {**bob, "length": 1.1}
    pendula = [{"links": [bob]}, {"links": [other], "count": 2}, {"links": [bob], "start": {"angles_deg": [3.0]}}]
    assert kinds(scene_from({"gravity": 9.81, "pendulum": pendula})).tolist() == [0, 1, 1, 0]


@pytest.mark.parametrize("seed", range(4))
def test_copies_are_those_that_all_permutations_make(seed: int) -> None:
    averaged, random = equal(4)[0].averaged, np.random.default_rng(seed)
    phases = random.choice([1.0, 1j, -1.0, -1j], 4)
    amplitudes = phases * random.choice([0.1, 0.2], 4)
    rows = np.array([amplitudes[list(order)] for order in permutations(range(4))])
    z = averaged.dual.T @ np.concatenate(([0.0], amplitudes))
    assert count_copies(averaged, z) == counted(rows)


def test_both_splay_states_are_one_that_has_two_copies() -> None:
    splayed = splay(equal(3))
    copies = [exchange(splayed.averaged, splayed.z, np.array(order)) for order in permutations(range(3))]
    assert splayed.copies == counted(np.array([splayed.averaged.link_shapes @ z for z in copies])) == 2
    random = np.random.default_rng(3)
    turned = [z * np.exp(1j * random.uniform(0, 6.0)) for z in copies]
    assert np.allclose(likeness(splayed, np.array(turned).T), 1.0, atol=1e-9)
    again = [relative_equilibrium(splayed.averaged, z) for z in turned]
    assert all(
        state and np.allclose(state.z, z, atol=1e-7) and is_same_motion(splayed, state)
        for state, z in zip(again, turned, strict=True)
    )
    assert not any(is_same_motion(splayed, other) for other in equal(3) if other is not splayed)


def test_unequal_pendula_have_both_states_listed() -> None:
    """Two attractors of equal energies by rows and nearly equal growth: 20.1, 18.1, 17.3° and 18.2, 20.1, 17.2°."""
    equilibria = relative_equilibria(average(metronomes(LENGTHS, DRIVES, 17.4823, 10.06)))
    states = [state for state in equilibria if state.is_stable]
    spread = [np.rad2deg(np.abs(links(state))) for state in states if abs(links(state).sum()) < 0.1]
    assert len(spread) == 2
    first, second = sorted(spread, key=lambda angles: -angles[0])
    assert first == pytest.approx([20.1, 18.1, 17.3], abs=0.06)
    assert second == pytest.approx([18.2, 20.1, 17.2], abs=0.06)
    assert not is_same_motion(*[state for state in states if abs(links(state).sum()) < 0.1])


def test_unequal_clocks_rotate_both_ways() -> None:
    """None of their other steady motions has three wide swings: in each of these one clock hardly swings."""
    drive = {"kind": "escapement", "impulse": 0.0021, "angle_deg": 2.0}
    link = {"kind": "bob", "mass": 1.0, "damping": 0.018, "drive": drive}
    support = {"kind": "cart", "mass": 10.0, "damping": 8.0}
    pendula = [{"links": [{**link, "length": length}]} for length in (0.252, 0.2511, 0.2522)]
    scene = scene_from({"gravity": 9.81, "support": support, "pendulum": pendula})
    turns = set()
    for state in relative_equilibria(average(scene)):
        angles = links(state)
        if state.is_stable and np.abs(angles).min() > 0.5 * np.abs(angles).max():
            cycle = links_of_cycle(cycle_of(scene, state))
            assert np.abs(cycle) == pytest.approx(np.abs(angles), rel=0.05)
            assert np.angle(cycle[1:] / cycle[0]) == pytest.approx(np.angle(angles[1:] / angles[0]), abs=0.1)
            turns.add(tuple(np.sign(np.angle(cycle[1:] / cycle[0])).tolist()))
    assert turns == {(1.0, -1.0), (-1.0, 1.0)}


def links_of_cycle(orbit: Orbit) -> Complexes:
    """The fundamentals of the angles of an orbit of the full equations, as complex amplitudes (L,)."""
    return np.asarray(2 * np.fft.fft(orbit.coordinates[:, 1:], axis=0)[1] / len(orbit.coordinates))


def started(equilibrium: RelativeEquilibrium, order: Ints, turn: float) -> State:
    """A state on a copy of the motion, which the full equations keep but for the error of averaging."""
    averaged = equilibrium.averaged
    z = exchange(averaged, equilibrium.z, order) * np.exp(1j * turn)
    q, v = (averaged.shapes @ z).real, (averaged.shapes @ (1j * equilibrium.omega * z)).real
    return State(q[1:], v[1:], float(q[0]), float(v[0]))


def test_starts_on_every_copy_end_in_one_motion_of_two() -> None:
    state = splay(equal(3))
    starts = [started(state, np.array(order), 0.7) for order in permutations(range(3))]
    scene = state.averaged.scene
    outcomes = Outcomes(scene, partial(orbit_near, scene))
    settle([outcomes], np.zeros(6, dtype=int), 200.0, {"starts": motion_of(starts)}, engine="numpy", workers=1)
    (group,) = outcomes.whole()
    assert (rhythm_of(group.beginning.orbit), len(group.members), group.copies) == ("splay", 6, 2)  # type: ignore[union-attr]
    assert state.copies == 2


def test_members_of_a_family_are_one_state_and_recognized_by_their_energies() -> None:
    """Four equal metronomes in antiphase: two pairs, at any angle to each other."""
    family = next(state for state in equal(4) if state.is_family)
    averaged = family.averaged
    size = np.abs(links(family)).mean()
    pairs = [size * np.array([1, -1, turn, -turn]) for turn in np.exp(1j * np.array([0.3, 1.0, 1.5]))]
    z = np.array(
        [
            averaged.dual.T @ np.concatenate(([0.0], amplitudes[list(order)]))
            for amplitudes in pairs
            for order in ((0, 1, 2, 3), (0, 2, 1, 3))
        ]
    )
    assert family.copies == 1
    assert np.all(likeness(family, z.T) > 0.99)
    upright = next(state for state in equal(4) if not state.is_family)
    assert np.all(likeness(upright, z.T) < 0.1)
