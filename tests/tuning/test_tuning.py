"""Best numbers by two routes: closed forms, equal peaks by Newton's method in 25 digits, and other engines."""

from __future__ import annotations

import json
from functools import cache
from math import log, sqrt
from pathlib import Path
from typing import Any

import mpmath as mp
import numpy as np
import pytest

from modal import Bob, Body, Cart, ComputationError, Pendulum, Rod, Scene, SceneError, load
from modal.identification.identifiability import polar
from modal.plotting import tuning_figure
from modal.scene import scene_from
from modal.scene.parameters import vary, with_numbers
from modal.scene.records import Spectrum
from modal.statespace.channels import Channel, channel_model
from modal.statespace.hoisting import Travel, travel_swing
from modal.statespace.response import ExactResponse
from modal.tuning import Tuned, den_hartog, exact_optimum, tune, tuned_record, tuned_text
from modal.tuning.minimax import Evaluation, Faces, descend
from modal.tuning.model import find_peaks, interpolate
from modal.tuning.objective import Objective
from modal.tuning.pieces import Pieces, Quantities
from modal.types import Floats
from modal.vibration import random_response
from multipendula import cli

K, M, G = 40.0, 10.0, 9.81
LENGTH, DAMPING = "pendulum[0].links[0].length", "pendulum[0].links[0].damping"
BOTH = [LENGTH, DAMPING]
PEAK = "peak:x/cart_force"
# f = ω_d/ω_1, ζ and the least peak of k|x/F|, by μ and ζ_1 (filed with the request for this command)
BEST = {
    (0.01, 0.0): (0.99009863, 0.06096178, 14.17964337),
    (0.01, 0.05): (0.98067471, 0.06795535, 6.25086920),
    (0.05, 0.0): (0.95237204, 0.13393773, 6.40792077),
    (0.05, 0.02): (0.94609100, 0.13697183, 5.26715749),
    (0.05, 0.05): (0.93535342, 0.14118530, 4.14621074),
    (0.10, 0.0): (0.90905829, 0.18546984, 4.58916557),
    (0.10, 0.05): (0.88751951, 0.19247170, 3.33685170),
}


def carrier(mu: float = 0.05, ratio: float = 0.0, damping: float = 0.4) -> Scene:
    """A bob of μ times a cart's mass, the cart with this damping ratio."""
    bob = Bob(mass=mu * M, length=2.4, damping=damping)
    cart = Cart(mass=M, stiffness=K, damping=2 * ratio * sqrt(K * M))
    return Scene(gravity=G, support=cart, pendulum=[Pendulum(links=[bob])])


@cache
def tuned(mu: float, ratio: float) -> Tuned:
    return tune(carrier(mu, ratio), BOTH, minimize=[PEAK])


def own_values(tuned: Tuned, mu: float) -> tuple[float, float]:
    """f and ζ of the bob."""
    length, damping = tuned.numbers[LENGTH], tuned.numbers[DAMPING]
    omega = sqrt(G / length)
    return omega / sqrt(K / M), damping / (2 * mu * M * length**2 * omega)


@pytest.mark.parametrize(("mu", "ratio"), BEST)
def test_the_least_highest_peak_is_the_known_one(mu: float, ratio: float) -> None:
    tuning = tuned(mu, ratio)
    assert tuning.certain
    assert [*own_values(tuning, mu), K * tuning.after] == pytest.approx(BEST[mu, ratio], abs=6e-9)
    if ratio == 0:
        assert own_values(tuning, mu) == pytest.approx(exact_optimum(mu), rel=1e-10)


@pytest.mark.parametrize(("mu", "ratio"), [(0.01, 0.0), (0.05, 0.02), (0.1, 0.05)])
def test_equal_peaks_by_newton_in_25_digits_are_the_same(mu: float, ratio: float) -> None:
    """In mpmath, from the equations of two masses; nothing of the linear model is used."""
    tuning = tuned(mu, ratio)
    start = own_values(tuning, mu)

    def height(w: mp.mpf, f: mp.mpf, z: mp.mpf) -> mp.mpf:
        spring, rest = mu * f * f + 2j * w * z * f * mu, 1 - w * w + 2j * w * ratio
        return mp.log(abs((spring - mu * w * w) / ((rest + spring) * (spring - mu * w * w) - spring**2)))

    def slope(orders: tuple[int, int, int], *at: mp.mpf) -> mp.mpf:
        return mp.diff(height, at, orders)

    def conditions(f: mp.mpf, z: mp.mpf, v: mp.mpf, w: mp.mpf, share: mp.mpf) -> list[mp.mpf]:
        balance = [
            share * slope(order, v, f, z) + (1 - share) * slope(order, w, f, z) for order in ((0, 1, 0), (0, 0, 1))
        ]
        level = height(v, f, z) - height(w, f, z)
        return [level, slope((1, 0, 0), v, f, z), slope((1, 0, 0), w, f, z), *balance]

    at = tuning.pieces_after[0]
    peaks = sorted((at.at[at.inside] / sqrt(K / M)).tolist())
    with mp.workdps(30):
        f, z, v, *_ = mp.findroot(conditions, (*start, peaks[0], peaks[-1], 0.5), tol=1e-20)
        assert own_values(tuning, mu) == pytest.approx((float(f), float(z)), rel=1e-10)
        assert K * tuning.after == pytest.approx(float(mp.exp(height(v, f, z))), rel=1e-11)


@pytest.mark.parametrize("link", [Rod(mass=0.6, length=3.0, damping=0.3), Bob(mass=0.5, length=2.0, damping=0.1)])
def test_the_mass_of_a_damper_is_its_b_squared_over_A(link: Rod | Bob) -> None:
    scene = carrier().replace(pendulum=[Pendulum(links=[link])])
    tuned = tune(scene, BOTH, minimize=[PEAK])
    (rule,) = tuned.rules
    share = 0.75 if isinstance(link, Rod) else 1.0
    mu = share * link.mass / (M + (1 - share) * link.mass)
    assert rule.absorber.mu == pytest.approx(mu, rel=1e-12)
    assert (rule.absorber.f, rule.absorber.zeta) == pytest.approx(exact_optimum(mu), rel=1e-9)
    assert den_hartog(mu) == pytest.approx((1 / (1 + mu), sqrt(3 * mu / 8 / (1 + mu))))
    assert rule.value > tuned.after


# ------------------------------------------------------------------------------------------------- two dampers


def tower(storeys: int) -> Scene:
    carts = [{"name": f"s{i + 1}", "kind": "cart", "mass": 4e5} for i in range(storeys)]
    springs = [
        {"between": ["ground" if i == 0 else f"s{i}", f"s{i + 1}"], "stiffness": 6e8 * (1 - 0.05 * i), "damping": 2e6}
        for i in range(storeys)
    ]
    bobs = [
        {"on": f"s{storeys}", "links": [{"kind": "bob", "mass": 4e4, "length": 0.6, "damping": 1e4}]},
        {"on": f"s{storeys // 2 + 1}", "links": [{"kind": "bob", "mass": 2e4, "length": 0.1, "damping": 1e3}]},
    ]
    return scene_from({"gravity": G, "support": carts, "spring": springs, "pendulum": bobs})


def test_two_dampers_of_a_tower_level_three_peaks() -> None:
    """At the best numbers no direction lowers all of the highest peaks, which another engine finds equal."""
    free = ["pendulum[*].links[0].length", "pendulum[*].links[0].damping"]
    tuned = tune(tower(4), free, minimize=["peak:s4_m/s4_force"])
    at = tuned.pieces_after[0]
    equal = at.inside & (at.values > at.values.max() * (1 - 1e-9))
    assert tuned.certain
    assert equal.sum() == 3
    form = channel_model(tuned.scene, [Channel("s4_m", "s4_force")])
    row, column = form.signals[0]
    sizes = np.abs(ExactResponse(tuned.scene, [column], [row]).response_at(at.at[equal]))[0, 0]
    assert sizes == pytest.approx(np.full(3, tuned.after), rel=1e-10)
    highest = tuned.objective.evaluate(tuned.z, True).costs[0]
    gradients = highest.gradients[highest.values > highest.values.max() - 1e-9]
    weights = np.linalg.lstsq(np.vstack((gradients.T, np.ones(len(gradients)))), [0, 0, 0, 0, 1], rcond=None)[0]
    assert weights.min() > 0
    assert np.abs(gradients.T @ weights).max() < 1e-8
    assert len(tuned.valleys) >= 1
    assert tuned.after < min(rule.value for rule in tuned.rules)


# ------------------------------------------------------------------------------------------- responses by numbers


@pytest.mark.parametrize(
    "channel",
    [
        Channel("x", "support_acceleration"),
        Channel("tip_ddot_1", "support_velocity"),
        Channel("pivot_force_1", "support_acceleration"),
        Channel("theta_1_2", "support_displacement"),
        Channel("pivot_force_1", "force_1_1"),
        Channel("theta_1_1", "cart_acceleration"),
        Channel("rel_1_2", "torque_1_2"),
        Channel("tip_1", "force:pendulum[0].links[1]@0.2"),
    ],
)
def test_responses_and_their_derivatives_are_those_of_elimination(channel: Channel) -> None:
    links = [
        Bob(mass=0.5, length=2.4, damping=0.4, drag=0.2),
        Body(mass=0.3, length=1.0, centre=0.4, inertia=0.02, stiffness=0.3),
    ]
    scene = carrier(ratio=0.02).replace(pendulum=[Pendulum(links=links)])
    places = [("pendulum", 0, "links", 0, "length"), ("pendulum", 0, "links", 1, "mass"), ("support", "damping")]
    form = channel_model(scene, [channel])
    values = np.array([2.4, 0.3, scene.support.damping])
    omega = np.array([0.7, 1.9, 4.0])
    row, column = form.signals[0]

    def scene_at(point: np.ndarray) -> Scene:
        return vary(scene, dict(zip(map(with_numbers, places), point.tolist(), strict=True)))

    def true(point: np.ndarray) -> np.ndarray:
        return ExactResponse(scene_at(point), [column], [row]).response_at(omega)[0, 0]

    H, by = form.model(scene).gradient(0, omega, form.slopes(scene, places))
    assert pytest.approx(true(values), rel=1e-12) == H
    for k, value in enumerate(values):
        step = 1e-4 * value * np.eye(3)[k]
        quotient = (
            8 * (true(values + step) - true(values - step)) - true(values + 2 * step) + true(values - 2 * step)
        ) / (12 * step[k])
        assert by[:, k] == pytest.approx(quotient, rel=1e-7, abs=1e-9 * np.abs(quotient).max())
    polynomial = interpolate(lambda point: form.arrays(scene_at(point)), values)
    assert polynomial is not None
    for part, other in zip(polynomial.arrays(3 * values), form.arrays(scene_at(3 * values)), strict=True):
        assert part == pytest.approx(other, rel=1e-11, abs=1e-13)


def test_peaks_are_where_the_slope_vanishes() -> None:
    scene = carrier(ratio=0.01)
    model = channel_model(scene, [Channel("x", "cart_force")]).model(scene)
    peaks = find_peaks(model, 0, None)
    H, slope = model.slope(0, peaks.omega[peaks.inside])
    assert peaks.inside.sum() == 2
    assert np.abs((np.conj(H) * slope).real / np.abs(H) ** 2).max() < 1e-9


# --------------------------------------------------------------------------------------------------- quantities


def test_the_rms_is_that_of_vibration_and_least() -> None:
    noise = Spectrum((0.1, 1.0), (1e-3, 1e-3), "acceleration")
    tuned = tune(carrier(ratio=0.02), BOTH, minimize=["rms:x_dot"], limits=["rms:rel_1_1=0.5"], psd=noise)
    outputs = random_response(tuned.scene, noise, ("cart_velocity", "relative_angles"))
    assert [tuned.after, tuned.pieces_after[1].values[0]] == pytest.approx(outputs.rms, rel=1e-9)
    assert all(worth.larger > 0 and worth.smaller > 0 for worth in tuned.worths)


def test_a_limit_of_the_stroke_is_kept_and_costs_something() -> None:
    free = tuned(0.05, 0.02)
    most = 0.8 * free.loads[0].stroke
    tuning = tune(carrier(0.05, 0.02), BOTH, minimize=[PEAK], limits=[f"rel_1_1={most}"])
    assert tuning.loads[0].stroke == pytest.approx(most, rel=1e-8)
    assert tuning.after > free.after
    assert tuning.loads[0].effort > 0


def test_the_largest_damping_is_that_of_equal_pairs_of_poles() -> None:
    """Of an undamped cart both pairs meet at f = 1/(1 + μ) and ζ = √(μ/(1 + μ)), with √μ/2 for every mode."""
    mu = 0.1
    tuned = tune(carrier(mu), BOTH, maximize=["damping"])
    assert own_values(tuned, mu) == pytest.approx((1 / (1 + mu), sqrt(mu / (1 + mu))), rel=2e-3)
    assert tuned.after == pytest.approx(sqrt(mu) / 2, rel=2e-2)
    settling = tune(carrier(mu), [f"{LENGTH}=2.97:2.98", DAMPING], minimize=["settling"])
    decay = -settling.objective.pieces(settling.z)[0].values.max()
    assert settling.after == pytest.approx(-decay)
    assert settling.after < settling.before
    assert settling.after == pytest.approx(log(50) / (sqrt(mu) / 2 * sqrt(K / M) / sqrt(1 + mu)), rel=0.1)


def test_a_descent_goes_along_the_ridge_on_which_modes_meet() -> None:
    """From where linear programs stop, with ζ = 0.2307, to √μ/2 = 0.25 at the largest mass allowed, μ = 0.25."""

    def evaluate(z: np.ndarray, with_gradients: bool) -> Evaluation:
        length, damping, mass = np.exp(z)
        m, inertia, zero = mass * length, mass * length**2, np.zeros((2, 2))
        heavy = np.array([[M + mass, m], [m, inertia]])
        matrices = heavy, np.diag([K, G * m]), np.diag([0.0, damping])
        dM = [[[0, m], [m, 2 * inertia]], zero, [[mass, m], [m, inertia]]]
        dK, dD = [np.diag([0, G * m]), zero, np.diag([0, G * m])], [zero, np.diag([0, damping]), zero]
        A = np.block([[zero, np.eye(2)], [-np.linalg.solve(heavy, matrices[1]), -np.linalg.solve(heavy, matrices[2])]])
        values, vectors = np.linalg.eig(A)
        zeta, slopes = [], []
        for value, phi in zip(values[values.imag > 0], vectors[:2, values.imag > 0].T, strict=True):
            below = phi @ (2 * value * matrices[0] + matrices[2]) @ phi
            parts = zip(np.array(dM), np.array(dK), np.array(dD), strict=True)
            by = [-(phi @ (value**2 * a + b + value * c) @ phi) / below for a, b, c in parts]
            zeta.append(-value.real / abs(value))
            slopes.append(polar(value, np.array(by))[1])
        return Evaluation(z, (Faces(-np.array(zeta), -np.array(slopes), np.arange(len(zeta)) + 1.0),), ())

    low, high = np.log([0.05, 0.01, 0.5]), np.log([50.0, 5e3, 2.5])
    ridge = np.log([3.60794919, 38.29232703, 2.12901961])
    assert evaluate(ridge, False).cost == pytest.approx(-0.2307065, rel=1e-4)
    end = descend(evaluate, ridge, low, high)
    assert end.point.cost == pytest.approx(-0.25, rel=1e-6)
    assert np.exp(end.point.z) == pytest.approx([G / K * M * 1.25**2, 52.537, 2.5], rel=1e-3)
    assert end.certain or end.open < 1e-4


def test_a_descent_that_is_certain_does_not_begin_anew() -> None:
    """|z − 1| is least where both pieces meet; each further start would take about as many evaluations."""
    points = list[float]()

    def evaluate(z: np.ndarray, with_gradients: bool) -> Evaluation:
        points.append(z[0])
        values, gradients = np.array([z[0] - 1.0, 1.0 - z[0]]), np.array([[1.0], [-1.0]])
        return Evaluation(z, (Faces(values, gradients, np.array([1.0, 2.0])),), ())

    end = descend(evaluate, np.array([0.3]), np.array([-3.0]), np.array([3.0]))
    assert end.certain
    assert end.point.z == pytest.approx(1.0)
    assert len(points) < 15


@pytest.mark.parametrize("count", [5, 6])
def test_a_figure_holds_five_panels(count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    tuning = tuned(0.05, 0.0)
    (curve,) = tuning.curves()
    monkeypatch.setattr(Tuned, "curves", lambda _: (curve,) * count)
    if count == 5:
        assert len(tuning_figure(tuning).axes) == 5
    else:
        with pytest.raises(ComputationError, match="6 responses do not fit"):
            tuning_figure(tuning)


def test_the_residual_of_a_travel_is_least_where_the_period_fits() -> None:
    """x = d (10 s³ − 15 s⁴ + 6 s⁵) leaves nothing where its spectrum vanishes at the mode: sin a = 3a/(3 − a²)."""
    duration = 3.0
    scene = Scene(gravity=G, support=Cart(mass=M), pendulum=[Pendulum(links=[Bob(mass=0.5, length=0.5)])])
    tuned = tune(scene, [f"{LENGTH}=0.6:0.8"], minimize=["residual"], travel=2.0, over=duration)
    with mp.workdps(20):
        half = mp.findroot(lambda a: (3 - a * a) * mp.sin(a) - 3 * a * mp.cos(a), 5.763)
    assert tuned.numbers[LENGTH] == pytest.approx(G / float(2 * half / duration) ** 2, rel=1e-5)
    assert travel_swing(tuned.scene, Travel(2.0, 0.0, duration)) < 1e-5


def test_a_number_that_changes_nothing_is_left_after_some_fifty_scenes(monkeypatch: pytest.MonkeyPatch) -> None:
    """The other pendulum swings most: a search must not halve its steps where the cost changes by rounding alone."""
    scenes, evaluate = [], Objective.evaluate

    def count(objective: Objective, z: Floats, with_gradients: bool) -> Evaluation:
        scenes.append(z)
        return evaluate(objective, z, with_gradients)

    monkeypatch.setattr(Objective, "evaluate", count)
    pendula = [Pendulum(links=[Bob(mass=0.5, length=length)]) for length in (0.5, 0.9)]
    scene = Scene(gravity=G, support=Cart(mass=M), pendulum=pendula)
    tuning = tune(scene, [f"{LENGTH}=0.3:0.8"], minimize=["residual"], travel=2.0, over=3.0)
    assert tuning.after == pytest.approx(travel_swing(scene, Travel(2.0, 0.0, 3.0)), rel=1e-12)
    assert len(scenes) <= 60


def test_one_number_stops_at_its_bound_and_its_travel_is_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    scenes: set[bytes] = set()
    done: list[float] = []
    at = Quantities.at

    def count(quantities: Quantities, values: Floats, *args: Any, **options: Any) -> list[Pieces]:
        scenes.add(values.tobytes())
        return at(quantities, values, *args, **options)

    monkeypatch.setattr(Quantities, "at", count)
    crane = load("hoisting-crane")
    tuning = tune(crane, ["pendulum[0].links[0].length=10:12"], minimize=["residual"], travel=10.0, report=done.append)
    assert tuning.numbers["pendulum[0].links[0].length"] == pytest.approx(10.0)
    assert len(scenes) < 40
    assert len(done) == len(set(done)) > 1
    assert done == sorted(done)
    before, after = tuning_figure(tuning).axes
    for axis, scene in ((before, crane), (after, tuning.scene)):
        swing = np.degrees(travel_swing(scene, Travel.along(scene, 10.0, None)))
        assert axis.lines[-2].get_ydata()[0] == pytest.approx(swing, rel=1e-6)


def test_robust_numbers_are_the_best_for_the_worst_masses() -> None:
    plain, robust = tuned(0.05, 0.02), tune(carrier(0.05, 0.02), BOTH, minimize=[PEAK], robust=True)
    assert robust.worst.value < plain.worst.value
    assert robust.after > plain.after
    corners = [
        robust.objective.value(robust.z, {("support", "mass"): a, ("pendulum", 0, "links", 0, "mass"): b})
        for a in (0.95, 1.05)
        for b in (0.95, 1.05)
    ]
    assert robust.worst.value == pytest.approx(max(corners))
    assert sorted(corners)[-1] == pytest.approx(sorted(corners)[-2], rel=1e-6)


def test_what_a_number_is_worth_is_where_the_objective_is_one_percent_off() -> None:
    tuning = tuned(0.05, 0.02)
    for k, worth in enumerate(tuning.worths):
        for edge in (worth.low, worth.high):
            z = tuning.z.copy()
            z[k] = log(edge)
            assert tuning.objective.value(z) / tuning.after == pytest.approx(1.01, abs=1e-5)
    text = tuned_text(tuning)
    assert "same minimum" in text
    assert "Den Hartog" in text


def test_a_static_magnitude_that_nothing_lowers_is_said_to_be_one() -> None:
    scene = carrier(0.2, 0.9, damping=0.02)
    tuning = tune(scene, [f"{DAMPING}=0.005:0.05"], minimize=[PEAK])
    assert K * tuning.after == pytest.approx(1.0, rel=1e-7)
    assert "largest at 0 Hz" in tuned_text(tuning)


# ---------------------------------------------------------------------------------------------------- bad input


REFUSED = [
    (["pendulum[0].count"], {}, "pendulum[0].count: is a count"),
    (["gravity=3:2"], {}, "cannot be met"),
    ([f"{LENGTH}=1"], {}, "bounds are FROM:TO"),
    ([LENGTH, LENGTH], {}, "is freed twice"),
    (["pendulum[0].links[0].mass=0:1"], {}, "cannot be met"),
    (BOTH, {"minimize": ["peek:x/cart_force"]}, "did you mean peak?"),
    (BOTH, {"minimize": ["peak:x"]}, "must be peak:OUTPUT/INPUT"),
    (BOTH, {"minimize": ["0*settling"]}, "a weight is a number above 0"),
    (BOTH, {"minimize": ["peak:y/cart_force"]}, "output y: must be one of"),
    (BOTH, {"minimize": ["peak:x/cart_farce"]}, "did you mean cart_force?"),
    (BOTH, {"minimize": ["rms:x"]}, "rms: needs `psd=…`"),
    (BOTH, {"minimize": ["residual"]}, "residual: needs `travel=…`"),
    (BOTH, {"minimize": []}, "give `minimize=…` or `maximize=…`"),
    (BOTH, {"modes": [1]}, "mode: is for"),
    (BOTH, {"limits": ["rel_1_1"]}, "must be OUTPUT=VALUE"),
]


@pytest.mark.parametrize(("free", "more", "words"), REFUSED)
def test_bad_input_is_one_sentence(free: list[str], more: dict[str, list[str]], words: str) -> None:
    with pytest.raises(SceneError) as refusal:
        tune(carrier(), free, **{"minimize": [PEAK], **more})
    assert len(refusal.value.problems) == 1
    assert words in refusal.value.problems[0]


def test_what_has_no_best_is_refused() -> None:
    with pytest.raises(ComputationError, match=r"grows without bound at 0.35.* Hz, where nothing damps a mode"):
        tune(carrier(damping=0.0), [LENGTH], minimize=[PEAK])
    with pytest.raises(ComputationError, match=r"has no peak: .* the end of the band"):
        tune(carrier(), BOTH, minimize=[PEAK], over_hz=(2.0, 3.0))
    with pytest.raises(ComputationError, match="cannot be met within the bounds"):
        tune(carrier(), [f"{LENGTH}=2:3", f"{DAMPING}=0.1:1"], minimize=[PEAK], limits=["rel_1_1=0.001"])
    with pytest.raises(ComputationError, match="without end: give it bounds"):
        tune(carrier(ratio=0.02), ["pendulum[0].links[0].mass", *BOTH], minimize=[PEAK])
    board = {
        "gravity": G,
        "support": {"name": "board", "kind": "tilt", "mass": 2.0, "inertia": 0.1, "centre": [0.1, 0.3]},
        "pendulum": [{"on": "board", "position": [-0.2, 0.0], "links": [{"kind": "bob", "mass": 1.0, "length": 0.4}]}],
    }
    with pytest.raises(SceneError, match="changes the equilibrium"):
        tune(scene_from(board), ["pendulum[0].links[0].mass"], minimize=["settling"])


def test_the_command_writes_all_or_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from modal.scene import dump, load

    monkeypatch.chdir(tmp_path)
    dump(carrier(0.05, 0.02), "tower.toml")
    words = f"tune tower.toml --free {LENGTH},{DAMPING} --minimize {PEAK}".split()
    assert (
        cli.main([*words, "-o", "best.toml", "--report", "r.json", "--picture", "p.svg", "--largest-angle", "5"]) == 0
    )
    report = json.loads(Path("r.json").read_text())
    best = load("best.toml")
    assert best.pendulum[0].links[0].length == pytest.approx(tuned(0.05, 0.02).numbers[LENGTH])
    assert K * report["after"] == pytest.approx(BEST[0.05, 0.02][2], rel=1e-8)
    assert report["numbers"][0]["place"] == LENGTH
    assert len(report["objective"][0]["peaks"]) == 2
    swing = report["finite_swing"]
    assert swing["largest_angle_deg"] == pytest.approx(5, rel=3e-3)
    assert swing["peak"] == pytest.approx(report["after"], rel=0.02)
    assert Path("p.svg").stat().st_size > 1000
    assert {with_numbers(place) for place in tuned(0.05, 0.02).worst.factors} == {
        "support.mass",
        "pendulum[0].links[0].mass",
    }
    assert set(tuned_record(tuned(0.05, 0.02))) | {"finite_swing"} == set(report)
    capsys.readouterr()
    assert cli.main([*words, "--max", "rel_1_1=-1", "-o", "none.toml", "--report", "none.json"]) != 0
    assert "rel_1_1=-1" in capsys.readouterr().err
    assert not Path("none.toml").exists()
    assert not Path("none.json").exists()


def test_a_peak_without_a_damper_was_infinite_before() -> None:
    tuned = tune(load("crane-hook"), ["pendulum[0].links[0].damping"], minimize=["peak:theta_1_2/cart_acceleration"])
    assert tuned.before == np.inf
    assert tuned.after < 0.2
