"""Numbers that several places share, tuned: against one entry of two copies, and a search over an own response."""

from __future__ import annotations

import numpy as np
import pytest
import scipy

from modal.errors import SceneError
from modal.scene import Bob, Cart, Pendulum, Scene
from modal.tuning import tune, tuned_record
from modal.tuning.objective import Aim, Objective
from modal.tuning.pieces import Setting
from modal.tuning.quantities import find_free, parse_quantity

CART = Cart(mass=10.0, stiffness=40.0)
SHIFT, SAME = "shift:pendulum[*].links[0].length", "same:pendulum[*].links[0].damping"
PEAK = "peak:x/cart_force"


def on_a_cart(*pendula: Pendulum) -> Scene:
    return Scene(gravity=9.81, support=CART, pendulum=pendula)


def absorber(length: float, damping: float = 0.2, count: int = 1) -> Pendulum:
    return Pendulum(links=(Bob(mass=0.25, length=length, damping=damping),), count=count)


def peak(lengths: np.ndarray, damping: float) -> float:
    """The largest |x/F| of a cart with bobs of 0.25 kg, from its own equations."""
    m, omega = 0.25, np.linspace(1.4, 2.7, 100_001)
    stiffness = 40.0 - omega**2 * (10.0 + m * len(lengths))
    for l in lengths.tolist():
        stiffness = stiffness - (m * l * omega**2) ** 2 / (m * 9.81 * l + 1j * omega * damping - m * l**2 * omega**2)
    return float(np.abs(1 / stiffness).max())


def test_two_pendula_that_share_their_numbers_are_one_of_two_copies() -> None:
    apart, copies = on_a_cart(absorber(2.2), absorber(2.2)), on_a_cart(absorber(2.2, count=2))
    keys = ("length", "damping")
    shared = tune(apart, [f"same:pendulum[*].links[0].{key}" for key in keys], minimize=[PEAK])
    single = tune(copies, [f"pendulum[0].links[0].{key}" for key in keys], minimize=[PEAK])
    assert shared.after == pytest.approx(single.after, rel=1e-9)
    assert [*shared.numbers.values()] == pytest.approx([*single.numbers.values()], rel=1e-6)
    assert len({pendulum.links[0] for pendulum in shared.scene.pendulum}) == 1


def test_a_shift_of_two_lengths_is_that_of_a_search_over_an_own_response() -> None:
    lengths = np.array([2.0, 2.3])
    tuned = tune(on_a_cart(*map(absorber, lengths.tolist())), [f"{SHIFT}=-0.5:0.8"], minimize=[PEAK])
    direct = scipy.optimize.minimize_scalar(
        lambda u: peak(lengths + u, 0.2), bounds=(-0.5, 0.8), method="bounded", options={"xatol": 1e-6}
    )
    assert tuned.after == pytest.approx(direct.fun, rel=1e-5)
    assert tuned.numbers[SHIFT] == pytest.approx(direct.x, abs=1e-3)
    (number,) = tuned_record(tuned)["numbers"]
    assert (number["place"], number["before"], number["unit"]) == (SHIFT, 0.0, "m")
    assert number["bounds"] == pytest.approx([-0.5, 0.8])
    assert number["after"] == tuned.to_dict()["after"][0] == tuned.numbers[SHIFT]
    low, high = number["within_one_percent"]
    assert low < number["after"] < high
    for end in (low, high):
        assert peak(lengths + end, 0.2) == pytest.approx(1.01 * tuned.after, rel=1e-3)


@pytest.mark.parametrize("factors", [{}, {("pendulum", 1, "links", 0, "mass"): 1.05, ("support", "mass"): 0.95}])
def test_gradients_of_shared_numbers_are_difference_quotients(factors: dict[tuple[str | int, ...], float]) -> None:
    scene = on_a_cart(absorber(2.0), absorber(2.3, 0.3))
    free = find_free(scene, [SHIFT, SAME, "same:pendulum[*].links[0].mass"], lambda place: 1.0)
    objective = Objective(scene, free, [Aim(parse_quantity(PEAK), False)], [], Setting())
    objective.cases = (factors,)
    z = objective.start + 0.05
    (cost,) = objective.evaluate(z, True).costs
    best = int(cost.values.argmax())
    for k, step in enumerate(1e-5 * np.eye(3)):
        ends = [objective.evaluate(z + way * step, False).costs[0].largest for way in (1, -1)]
        assert cost.gradients[best, k] == pytest.approx((ends[0] - ends[1]) / 2e-5, rel=1e-5, abs=1e-7)


@pytest.mark.parametrize(
    ("free", "words"),
    [
        ([f"{SHIFT}=-2.5:1"], "pendulum[0].links[0].length = -0.5: must be positive: its bound cannot be met"),
        ([f"{SHIFT}=1:-1"], "bounds go from a number to a larger one"),
        ([SHIFT, "pendulum[0].links[0].length"], f"is freed twice, in {SHIFT}"),
        (["same:pendulum[0].links[0].length+support.mass"], "what they share has one unit"),
    ],
)
def test_shared_numbers_that_cannot_be_tuned(free: list[str], words: str) -> None:
    with pytest.raises(SceneError) as caught:
        tune(on_a_cart(absorber(2.0), absorber(2.3)), free, minimize=[PEAK])
    assert words in str(caught.value)
