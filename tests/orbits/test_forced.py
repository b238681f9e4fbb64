"""Periodic motions under drives: against equations written here, settled runs and perturbed ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import pairwise
from math import exp, pi
from typing import Any

import numpy as np
import pytest
from amounts import usually
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from modal.errors import ComputationError, SceneError
from modal.scene import Scene, drive_period, scene_from
from modal.scene.parameters import parse_variations
from modal.types import Floats
from nonlinear.orbits import (
    Branch,
    Flow,
    Orbit,
    Special,
    follow_forced_orbits,
    forced_orbit,
    leaving_branch,
    linear_response,
    orbits_text,
)
from nonlinear.postprocessing import reaction_forces_of
from nonlinear.simulation import simulate
from nonlinear.system import State

BOB = {"kind": "bob", "mass": 1.0, "length": 1.0}
HERTZ = "support.motion.frequency_hz"


def scene_of(links: list[dict[str, Any]], **more: Any) -> Scene:
    return scene_from({"gravity": 9.81, "pendulum": [{"links": links}], **more})


def shaken(links: list[dict[str, Any]], hertz: float = 0.45, **more: Any) -> Scene:
    motion = {"kind": "sine", "amplitude": 0.02, "frequency_hz": hertz} | more
    return scene_of(links, support={"kind": "moved", "motion": motion})


def followed(scene: Scene, words: str, **more: Any) -> tuple[Branch, ...]:
    (variation,) = parse_variations([words])
    return follow_forced_orbits(scene, variation, **more)


def monodromy(f: Callable[..., Any], y: Floats, period: float, *args: float) -> tuple[Floats, Floats]:
    """The end of a motion of analytic equations and its derivative by the start, from imaginary parts."""
    ends = [
        solve_ivp(f, (0, period), y + 1e-20j * e, method="DOP853", rtol=1e-12, atol=1e-13, args=args).y[:, -1]
        for e in np.eye(len(y))
    ]
    return ends[0].real, np.array([end.imag for end in ends]).T / 1e-20


def is_special(f: Callable[..., Any], special: Special, multiplier: float, value: float) -> bool:
    """Whether these equations have that orbit at a value of the number, and the multiplier.

    At a fold the value is wrong by the square of what a multiplier misses.
    """
    orbit = special.orbit
    end, M = monodromy(f, orbit.y, orbit.period, value)
    missed = np.abs(np.linalg.eigvals(M) - multiplier).min()
    return bool(np.abs(end - orbit.y).max() < 1e-9 and missed < (1e-5 if special.kind == "fold" else 3e-8))


def along_the_rail(t: float, y: Any, hertz: float) -> Any:
    """θ'' = −(g sin θ + s'' cos θ)/l − 0.05 θ', s = 0.02 sin Ωt."""
    rate = 2 * pi * hertz
    pushed = -0.02 * rate**2 * np.sin(rate * t)
    return np.array([y[1], -9.81 * np.sin(y[0]) - pushed * np.cos(y[0]) - 0.05 * y[1]])


@cache
def resonance() -> Branch:
    (branch,) = followed(shaken([BOB | {"damping": 0.05}]), f"{HERTZ}=0.45:0.50:2")
    return branch


@pytest.mark.parametrize("words", ["0.3:0.36:5", "0.3:0.36:4log", "0.3,0.31,0.36"])
def test_the_values_that_are_asked_for_are_on_the_branch(words: str) -> None:
    """Each once, in the order of the branch, and the steps between them are those of the range alone."""
    text = f"{HERTZ}={words}"
    (branch,) = followed(shaken([BOB | {"damping": 0.5}]), text)
    (plain,) = followed(shaken([BOB | {"damping": 0.5}]), f"{HERTZ}=0.3:0.36:2")
    for value in parse_variations([text])[0].values:
        assert np.sum(np.abs(branch.value - value) < 1e-9) == 1
    assert np.all(np.diff(branch.value) > 0)
    assert len(branch.points) == len(plain.points) + len(parse_variations([text])[0].values) - 2
    assert all(orbit.residual < 1e-9 for orbit in branch.orbits)


def test_an_orbit_of_a_branch_takes_few_flows(monkeypatch: pytest.MonkeyPatch) -> None:
    """Newton's steps from the tangent, two mostly, and the orbit itself, of one period each."""
    count, flow = [0], Flow.__call__

    def counted(self: Flow, *arguments: Any, **more: Any) -> Any:
        count[0] += 1
        return flow(self, *arguments, **more)

    monkeypatch.setattr(Flow, "__call__", counted)
    (branch,) = followed(shaken([BOB | {"damping": 0.05}]), f"{HERTZ}=0.47:0.48:2", longest=0.05)
    assert len(branch.orbits) > 20
    assert count[0] < 4 * len(branch.orbits)


@pytest.mark.xdist_group("resonance")
def test_folds_of_a_shaken_pendulum() -> None:
    low, high = (special for special in resonance().special)
    assert [low.kind, high.kind] == ["fold", "fold"]
    for special, hertz, angle in ((high, 0.466204506125, 58.3115), (low, 0.483101024404, 25.3866)):
        orbit = special.orbit
        assert orbit.value == pytest.approx(hertz, abs=1e-11)
        assert np.degrees(orbit.amplitude) == pytest.approx(angle, abs=1e-4)
        assert orbit.floquet.all == pytest.approx([1.0, exp(-0.05 * orbit.period)], abs=1e-7)
        assert is_special(along_the_rail, special, 1.0, hertz)


@pytest.mark.xdist_group("resonance")
def test_a_drawn_branch_is_smooth_and_goes_through_the_range() -> None:
    branch = resonance()
    assert branch.complete
    assert branch.value[[0, -1]] == pytest.approx([0.45, 0.50])
    for before, after in pairwise(branch.orbits):
        assert abs(after.amplitude / before.amplitude - 1) <= 0.02
        assert abs(np.angle(np.exp(1j * (after.phase - before.phase)))) <= 0.1
    fates = [orbit.is_stable for orbit in branch.orbits]
    assert [a for a, b in pairwise([*fates, None]) if a is not b] == [True, False, True]
    for orbit in branch.orbits[::30]:
        assert np.prod(orbit.floquet.all) == pytest.approx(exp(-0.05 * orbit.period), abs=1e-9)
        assert orbit.fed == pytest.approx(dissipated(orbit), rel=2e-5)


def dissipated(orbit: Orbit) -> float:
    """∮ 0.05 θ'² dt of the equation above."""
    times = np.linspace(0, orbit.period, 401)
    run = solve_ivp(along_the_rail, (0, orbit.period), orbit.y, "DOP853", times, rtol=1e-11, args=(orbit.value,))
    return float(0.05 * np.mean(run.y[1, :-1] ** 2) * orbit.period)


def test_a_range_between_the_folds_has_two_branches_and_says_where_one_turns_back() -> None:
    lower, upper = followed(shaken([BOB | {"damping": 0.05}]), f"{HERTZ}=0.475:0.49:2")
    assert lower.returns
    assert not upper.returns
    assert [special_point.kind for special_point in lower.special] == ["fold"]
    assert upper.special == ()
    assert upper.value[-1] == pytest.approx(lower.value[0])
    assert upper.amplitude[-1] > lower.amplitude[-1] > lower.amplitude[0]
    assert "another fold may lie beyond" in orbits_text(lower.orbits[0].scene, [lower])


# ------------------------------------------------------------------------------------------------ torque-driven

RATE = 2 * pi
NATURAL = 1.5 * RATE
LENGTH = 9.81 / NATURAL**2
UNIT = NATURAL**2 * LENGTH**2  # N m of γ = 1


def taylor(t: float, y: Any, gamma: float) -> Any:
    """θ'' = −2βθ' − ω₀² sin θ + γ ω₀² cos ωt (Taylor, Classical Mechanics, ch. 12)."""
    return np.array([y[1], -NATURAL / 2 * y[1] + NATURAL**2 * (gamma * np.cos(RATE * t) - np.sin(y[0]))])


@cache
def driven() -> list[Branch]:
    link = BOB | {"length": LENGTH, "damping": NATURAL / 2 * LENGTH**2}
    torque = {"on": "pendulum[0].links[0]", "direction": "torque", "kind": "sine", "amplitude": UNIT}
    scene = scene_of([link], force=[torque | {"frequency_hz": 1.0, "phase_deg": 90.0}])
    (branch,) = followed(scene, f"force[0].amplitude={0.98 * UNIT!r}:{1.09 * UNIT!r}:2")
    branches = [branch]
    for kind in ("branch point", "period doubling", *usually((), ("period doubling",))):
        branches.append(
            leaving_branch(
                branches[-1],
                next(special_point for special_point in branches[-1].special if special_point.kind == kind),
                max_orbits=40,
            )
        )
    return branches


def test_a_driven_pendulum_loses_its_symmetry_and_doubles_its_period() -> None:
    told = (("branch point", 1.00431948), ("period doubling", 1.0663728625))
    told += (("period doubling", 1.0793139059), *usually((), (("period doubling", 1.0820843843),)))
    for k, ((kind, gamma), branch) in enumerate(zip(told, driven(), strict=True)):
        special = next(special_point for special_point in branch.special if special_point.kind == kind)
        cycles, sign = max(1, 2 ** (k - 1)), 1.0 if k == 0 else -1.0
        assert special.orbit.value == pytest.approx(gamma * UNIT, abs=6e-9 * UNIT)
        assert special.orbit.cycles == cycles
        assert (special.of == "symmetry") is (k == 0)
        assert special.orbit.is_symmetric is (k == 0)
        assert is_special(taylor, special, sign, special.orbit.value / UNIT)


# ---------------------------------------------------------------------------------------------- a double pendulum


def double(t: float, y: Any, hertz: float) -> Any:
    """Two bobs of 1 kg on rods of 1 m, 0.03 N m s/rad at both joints, the support at 0.02 m sin Ωt along the rail."""
    rate, (a, b, p, q) = 2 * pi * hertz, y
    s = -0.02 * rate**2 * np.sin(rate * t)
    c, d = np.cos(a - b), np.sin(a - b)
    lower = 0.03 * (q - p)
    first = -2 * 9.81 * np.sin(a) - 2 * s * np.cos(a) - d * q * q - 0.03 * p + lower
    two = -9.81 * np.sin(b) - s * np.cos(b) + d * p * p - lower
    return np.array([p, q, (first - c * two) / (2 - c * c), (2 * two - c * first) / (2 - c * c)])


def test_folds_of_a_shaken_double_pendulum() -> None:
    (branch,) = followed(shaken([BOB | {"damping": 0.03}] * 2), f"{HERTZ}=0.34:0.385:2")
    assert [special_point.kind for special_point in branch.special] == ["fold", "fold"]
    for special, hertz in zip(branch.special, (0.37281333449, 0.34181686637), strict=True):
        assert special.orbit.value == pytest.approx(hertz, abs=1e-10)
        assert is_special(double, special, 1.0, hertz)


# ------------------------------------------------------------------------------------------------ what drives take

TWO_WAYS = [
    {"kind": "sine", "amplitude": 0.02, "frequency_hz": 0.8, "phase_deg": 20.0},
    {"kind": "sine", "amplitude": 0.01, "frequency_hz": 1.2, "direction": "vertical"},
]
AIRY = BOB | {"damping": 0.1, "drag": 0.2, "quadratic_drag": 0.3}
PUSH = {"on": "pendulum[0].links[1]@0.5", "kind": "sine", "amplitude": 2.0, "frequency_hz": 0.7}
HELD = {"on": "pendulum[0].links[0]", "kind": "constant", "amplitude": 2.0}
LEVER = {"on": "pendulum[0].links[0]", "direction": "torque", "kind": "sine", "amplitude": 0.5, "frequency_hz": 0.35}
CART = {"kind": "cart", "mass": 3.0, "damping": 1.0}
PAIR = [{"count": 2, "links": [BOB | {"damping": 0.2}]}, {"links": [BOB | {"length": 0.7, "damping": 0.2}]}]
PULL = {"on": "cart", "kind": "sine", "amplitude": 2.0, "frequency_hz": 0.6}
STANDING = {"equilibrium": ["up"], "links": [BOB | {"stiffness": 30.0, "damping": 1.0}]}
SCENES = {
    "both ways in air": scene_of([AIRY, AIRY], support={"kind": "moved", "motion": TWO_WAYS}),
    "forces": scene_of([BOB | {"damping": 0.3}] * 2, force=[PUSH, HELD, LEVER]),
    "damping ratio": scene_of([BOB, BOB], damping_ratio=0.05, force=[PUSH]),
    "free cart": scene_from({"gravity": 9.81, "support": CART, "pendulum": PAIR, "force": [PULL]}),
    "free cart in air": scene_of([AIRY], support={"kind": "cart", "mass": 3.0}, force=[PULL]),
    "inverted": scene_from({"gravity": 9.81, "pendulum": [STANDING], "force": [PULL | {"on": "pendulum[0].links[0]"}]}),
}


@pytest.mark.parametrize("name", SCENES)
def test_a_settled_run_lies_on_the_orbit_and_perturbed_ones_have_its_multipliers(name: str) -> None:
    scene = SCENES[name]
    orbit = forced_orbit(scene)
    layout, scale, size = orbit.flow.equations.layout, orbit.flow.scale, len(orbit.y)
    assert orbit.is_stable
    assert orbit.residual < 1e-11

    def end(start: State, periods: int) -> Floats:
        times = [0.0, periods * orbit.period]
        run = simulate(scene, times[-1], start=start, output=times, tolerance=1e-12)
        return np.asarray(layout.begin(run.final)[:size] / scale)

    nudges = 1e-6 * np.eye(size)
    ends = [[end(layout.state(orbit.y + sign * e * scale), 1) for e in nudges] for sign in (1, -1)]
    M = (np.array(ends[0]) - np.array(ends[1])).T / 2e-6
    expected, values = np.linalg.eigvals(M), orbit.floquet.all.tolist()
    for value in expected:
        at = int(np.abs(np.array(values) - value).argmin())
        assert values.pop(at) == pytest.approx(value, abs=1e-6)
    rates = np.log(np.abs(orbit.floquet.others).max()) / orbit.period
    away = orbit.y.copy()
    away[layout.half + layout.first] += 0.01 * scale[-1]
    settled = end(layout.state(away), int(np.ceil(np.log(1e-9) / rates / orbit.period)))
    missed = settled - orbit.y / scale
    assert np.abs(missed[orbit.floquet.neutral :]).max() < 1e-6
    assert orbit.floquet.neutral == int(name.startswith("free"))


@pytest.mark.parametrize("name", ["both ways in air", "forces", "damping ratio"])
def test_what_drives_feed_is_what_is_lost(name: str) -> None:
    """The work of applied forces and of the support's pull on the pivots, from a run's own accelerations."""
    scene = SCENES[name]
    orbit = forced_orbit(scene)
    times = np.linspace(0.0, orbit.period, 801)
    run = simulate(scene, orbit.period, start=orbit.state, output=times.tolist(), tolerance=1e-11)
    system, fed = run.system, 0.0
    if system.support:
        pulls = reaction_forces_of(run).pivots[:, 0]
        fed += float(np.mean((pulls * system.support.velocities(times, 2)).sum(1)[:-1])) * orbit.period
    theta, rates = run.motion.links, run.motion.link_rates
    for force in scene.force:
        if force.kind == "constant" or force.direction == "torque":
            continue
        lever = 1.5 if "@" in force.on else 1.0
        speed = np.cos(theta[:, 0]) * rates[:, 0] + (lever - 1.0) * np.cos(theta[:, 1]) * rates[:, 1]
        size = force.amplitude * np.sin(2 * pi * force.frequency_hz * times)
        fed += float(np.mean((size * speed)[:-1])) * orbit.period
    for force in scene.force:
        if force.direction == "torque":
            size = force.amplitude * np.sin(2 * pi * force.frequency_hz * times)
            fed += float(np.mean((size * rates[:, 0])[:-1])) * orbit.period
    assert orbit.fed == pytest.approx(fed, rel=1e-4)


# --------------------------------------------------------------------------------------- turns, subharmonics, linear


def test_a_rotation_gains_a_whole_turn_in_a_period() -> None:
    scene = shaken([BOB | {"damping": 0.02}], 1.5, amplitude=0.3)
    orbit = forced_orbit(scene, start=settled_state(scene, State(np.zeros(1), np.array([2 * pi * 1.5])), 60))
    assert orbit.turns == (1,)
    assert orbit.cycles == 1
    run = simulate(scene, orbit.period, start=orbit.state, output=[0.0, orbit.period], tolerance=1e-12)
    assert run.final.links - orbit.state.links == pytest.approx([2 * pi], abs=1e-8)
    assert run.final.link_rates == pytest.approx(orbit.state.link_rates, abs=1e-8)
    assert np.prod(orbit.floquet.all) == pytest.approx(exp(-0.02 * orbit.period), abs=1e-8)


def settled_state(scene: Scene, start: State, periods: int) -> State:
    return simulate(scene, periods * drive_period(scene).seconds, start=start, output=2, tolerance=1e-9).final


def test_a_vertical_shake_doubles_the_period_where_floquets_multiplier_passes_minus_one() -> None:
    """The boundary of Mathieu's first tongue, with damping, and the swing that leaves it."""

    def straight(t: float, y: Any, size: float) -> Any:
        lift = -size * 4 * pi**2 * np.sin(2 * pi * t)
        return np.array([y[1], -(9.81 + lift) * y[0] - 0.1 * y[1]])

    def trace(size: float) -> float:
        return float(np.linalg.det(monodromy(straight, np.ones(2), 1.0, size)[1] + np.eye(2)))

    scene = shaken([BOB | {"damping": 0.1}], 1.0, direction="vertical")
    (branch,) = followed(scene, "support.motion.amplitude=0.005:0.05:2")
    (special,) = branch.special
    assert special.kind == "period doubling"
    assert branch.amplitude.max() < 1e-9
    assert special.orbit.value == pytest.approx(brentq(trace, 0.005, 0.05, xtol=1e-13), abs=1e-10)
    swing = leaving_branch(branch, special, max_orbits=12)
    assert swing.orbits[-1].cycles == 2
    assert swing.orbits[-1].amplitude > 0.01
    again = forced_orbit(swing.orbits[-1].scene, start=swing.orbits[-1].state, periods=2)
    assert again.amplitude == pytest.approx(swing.orbits[-1].amplitude, rel=1e-8)


def test_the_linear_response_is_that_of_the_impedance() -> None:
    scene = shaken([BOB | {"damping": 0.1}], 0.3, amplitude=1e-4)
    rate = 2 * pi * 0.3
    told = 1e-4 * rate**2 / abs(9.81 - rate**2 + 0.1j * rate)
    assert linear_response(scene).amplitude == pytest.approx(told, rel=1e-3)
    orbit = forced_orbit(scene)
    assert orbit.amplitude == pytest.approx(told, rel=1e-5)
    assert orbit.phase == pytest.approx(-np.angle(9.81 - rate**2 + 0.1j * rate), abs=1e-6)


# -------------------------------------------------------------------------------------------------------- bad input


RECORD = {"kind": "record", "time_s": [0, 1, 2, 3], "displacement_m": [0, 1, 0, 1]}


@pytest.mark.parametrize(
    ("scene", "words", "message"),
    [
        (shaken([BOB]), "gravity=9.8", "two or more values"),
        (
            scene_of([BOB, BOB], force=[PUSH, LEVER]),
            "force[0].frequency_hz=0.6:0.8:2",
            "must be the frequency of every",
        ),
        (scene_of([BOB, BOB], force=[PUSH, LEVER | {"frequency_hz": 0.5**0.5}]), "gravity=9:10:2", "no common period"),
        (scene_of([BOB], support={"kind": "moved", "motion": RECORD}), "gravity=9:10:2", "is not periodic"),
        (scene_of([BOB]), "gravity=9:10:2", "nothing drives this scene"),
        (
            scene_of([BOB | {"hoist": {"to": 0.8, "duration": 2.0}}], force=[HELD, LEVER]),
            "gravity=9:10:2",
            "constant lengths",
        ),
    ],
)
def test_bad_input_gets_one_clear_message(scene: Scene, words: str, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        followed(scene, words)


def test_an_end_of_the_range_without_a_motion_is_named() -> None:
    (branch,) = followed(shaken([BOB | {"damping": 0.05}]), "support.motion.amplitude=0.001:0.0011:2")
    cut = replace(branch, points=branch.points[:-1], complete=False)
    texts = [" ".join(orbits_text(branch.orbits[0].scene, [shown]).split()) for shown in (branch, cut)]
    assert "at amplitude of the motion of the support = 0.0011 m no motion was found" in texts[1]
    assert "was followed no further than amplitude of the motion of the support = 0.00" in texts[1]
    assert "no motion was found" not in texts[0]


def test_where_nothing_repeats_a_message_says_where_it_was_looked_for() -> None:
    """A constant force moves a cart that nothing holds for ever."""
    push = {"on": "cart", "kind": "constant", "amplitude": 3.0}
    scene = scene_of([BOB], support={"kind": "cart", "mass": 3.0}, force=[PULL, push])
    with pytest.raises(ComputationError, match=r"gravity = 9 and 10: no periodic motion .*: give another start"):
        followed(scene, "gravity=9:10:2")
