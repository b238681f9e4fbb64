"""One scene with arrays of numbers: the frequencies of each scene, without making any."""

import numpy as np
import pytest
from compare import assert_certified

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
    natural_frequencies,
    natural_modes,
)
from modal.assembly import rig_of
from modal.eigen import Suspension, seeds, squares
from modal.modes import frequencies
from modal.scene import parameters
from modal.scene.parameters import vary
from modal.types import Floats

PLACES = ("gravity", "support.mass", "pendulum[0].links[0].mass", "pendulum[0].links[1].length")
LINKS = (Rod(mass=1.0, length=1.0), Body(mass=0.5, length=0.7, centre=0.3, inertia=0.02), Bob(mass=2.0, length=1.5))


def chain(support: Cart, links: tuple[Rod | Body | Bob, ...] = LINKS, **options: object) -> Scene:
    return Scene(gravity=9.81, support=support, pendulum=[Pendulum(links=links)], **options)  # type: ignore[arg-type]


def one_by_one(scene: Scene, values: dict[str, Floats]) -> Floats:
    rows = []
    for k in range(len(next(iter(values.values())))):
        modes = natural_modes(vary(scene, {path: float(column[k]) for path, column in values.items()}))
        rows.append(np.repeat(modes.omega, modes.multiplicity))
    return np.array(rows)


def numbers(scale: float, count: int = 12) -> dict[str, Floats]:
    random = np.random.default_rng(1)
    return {path: 10 ** random.uniform(-scale, scale, count) for path in PLACES}


@pytest.fixture
def no_scenes(monkeypatch: pytest.MonkeyPatch) -> None:
    def made(*_: object) -> None:
        raise AssertionError("a scene was made")

    monkeypatch.setattr(parameters, "scene_from", made)
    monkeypatch.setattr(frequencies, "_one", made)


@pytest.mark.parametrize("scale", [0.3, 3.0, 12.0])
@pytest.mark.parametrize("stiffness", [0.0, 3.0])
def test_the_frequencies_are_those_of_each_scene(scale: float, stiffness: float) -> None:
    scene, values = chain(Cart(mass=2.0, stiffness=stiffness)), numbers(scale)
    np.testing.assert_array_max_ulp(natural_frequencies(scene, vary=values), one_by_one(scene, values), 4)


def test_different_pendula_on_a_fixed_support_are_in_one_order() -> None:
    beside = [Pendulum(links=[Bob(mass=m, length=length)], count=2) for m, length in ((1.0, 1.4), (2.0, 9.7))]
    scene, values = Scene(gravity=9.81, pendulum=beside), {"gravity": np.array([1.6, 9.8])}
    np.testing.assert_array_max_ulp(natural_frequencies(scene, vary=values), one_by_one(scene, values), 2)


@pytest.mark.parametrize("name", ["paper-cart-2", "chain-spatial", "crane-hook"])
def test_several_pendula_and_space(name: str) -> None:
    scene, values = (
        load(name),
        {"gravity": np.array([1.6, 9.8, 24.8]), "pendulum[*].links[*].mass": np.array([1.0, 2.0, 9.0])},
    )
    np.testing.assert_array_max_ulp(natural_frequencies(scene, vary=values), one_by_one(scene, values), 2)


@pytest.mark.parametrize("seed", range(3))
def test_every_digit_is_that_of_many(seed: int) -> None:
    values = {path: column[seed : seed + 2] for path, column in numbers(2.0).items()}
    for k, row in enumerate(natural_frequencies(chain(Cart(mass=2.0)), vary=values)):
        modes = natural_modes(vary(chain(Cart(mass=2.0)), {path: float(column[k]) for path, column in values.items()}))
        assert_certified(modes, float(modes.error.max()))
        np.testing.assert_array_max_ulp(row, modes.omega, 4)


@pytest.mark.usefixtures("no_scenes")
def test_no_scene_is_made() -> None:
    scene = chain(Cart(mass=2.0))
    assert natural_frequencies(scene, vary=numbers(1.0)).shape == (12, 4)
    springs = {"support.stiffness": [1.0, 2.0], "pendulum[0].links[1].centre": [0.2, 0.3]}
    assert natural_frequencies(scene, 1e-8, vary=springs).shape == (2, 4)


def test_two_counts_confirm_a_mode_of_a_scene(monkeypatch: pytest.MonkeyPatch) -> None:
    trials = []
    reached = squares._is_past

    def counted(problem: squares.Counting, wanted: Floats, points: Floats) -> Floats:
        trials.append(points.size)
        return reached(problem, wanted, points)  # type: ignore[arg-type, return-value]

    monkeypatch.setattr(squares, "_is_past", counted)
    monkeypatch.setattr(squares, "search", None)
    values = {path: column[:6] for path, column in numbers(0.1).items()}
    natural_frequencies(chain(Cart(mass=2.0)), vary=values)
    assert trials == [2 * 3 * 6]
    natural_frequencies(chain(Cart(mass=2.0)), 1e-8, vary=values)
    assert trials == [2 * 3 * 6]


def test_shapes_broadcast_and_grids_have_an_axis_for_each_place() -> None:
    scene = load("paper-cart-2")
    frequencies = natural_frequencies(scene, vary={"support.mass": [[1.0], [100.0]], "gravity": [1.6, 9.8, 24.8]})
    assert frequencies.shape == (2, 3, 5)
    np.testing.assert_array_equal(
        frequencies, natural_frequencies(scene, vary=["support.mass=1,100", "gravity=1.6,9.8,24.8"])
    )
    np.testing.assert_array_equal(natural_frequencies(scene, vary={}), natural_frequencies(scene))
    assert natural_frequencies(scene, vary={"gravity": 1.6}).shape == (5,)
    assert natural_frequencies(scene, vary={"gravity": []}).shape == (0, 5)


def test_a_zero_is_another_form() -> None:
    scene, stiffness = chain(Cart(mass=2.0)), np.array([0.0, 1.0, 0.0, 4.0])
    frequencies = natural_frequencies(scene, vary={"support.stiffness": stiffness})
    np.testing.assert_array_max_ulp(frequencies, one_by_one(scene, {"support.stiffness": stiffness}), 2)
    assert (frequencies[:, 0] == 0).tolist() == [True, False, True, False]


@pytest.mark.parametrize("path", ["pendulum[0].links[0].damping", "pendulum[0].links[0].stiffness", "damping_ratio"])
def test_what_is_more_than_a_number_goes_one_by_one(path: str) -> None:
    values = {path: np.array([0.01, 0.02])}
    np.testing.assert_array_equal(
        natural_frequencies(load("chain-3"), vary=values), one_by_one(load("chain-3"), values)
    )


def test_one_message_names_every_mistake() -> None:
    scene = load("paper-cart-2")
    wrong = {"support.mas": [1.0], "pendulum[0].links[0].mass": ["a"], "gravity": [np.nan], 4: [1.0]}
    with pytest.raises(SceneError) as caught:
        natural_frequencies(scene, vary=wrong)  # type: ignore[dict-item]
    assert [problem.split(":")[0] for problem in caught.value.problems] == [
        "support.mas",
        "vary 'pendulum[0].links[0].mass'",
        "gravity",
        "vary 4",
    ]
    with pytest.raises(SceneError) as caught:
        natural_frequencies(scene, vary={"gravity": [9.8, -1.0], "support.mass": [0.0, 1e-200, 1.0]})
    assert [problem.split()[0].rstrip(":") for problem in caught.value.problems] == ["gravity", "support.mass"]
    for vary_, word in (
        ({"gravity": [1.0, 2.0], "support.mass": [1.0, 2.0, 3.0]}, "broadcast"),
        ({"pendulum[*].links[*].mass": 1.0, "pendulum[0].links[0].mass": 2.0}, "twice"),
        (["gravity=1,2", "nothing=1,2"], "nothing"),
        ({"pendulum[0].count": [1.0, 1.5]}, "whole"),
    ):
        with pytest.raises(SceneError, match=word):
            natural_frequencies(scene, vary=vary_)  # type: ignore[arg-type]
    with pytest.raises(SceneError, match="at most 100000000 members"):
        natural_frequencies(scene, vary=["gravity=1:2:100000", "support.mass=1:2:100000"])
    body = {"pendulum[0].links[1].centre": [0.0, 0.1, 0.0], "pendulum[0].links[1].inertia": [0.0, 0.0, 1.0]}
    with pytest.raises(SceneError, match=r"member 0: pendulum\[0\].links\[1\].inertia"):
        natural_frequencies(chain(Cart(mass=1.0)), vary=body)
    with pytest.raises(SceneError, match="one scene"):
        natural_frequencies([scene], vary={"gravity": [1.0]})
    with pytest.raises(ComputationError):
        natural_frequencies(load("huygens"), vary={"support.mass": [0.0, 1.0]})


# ------------------------------------------------------------------------------------------ few modes of a long chain


@pytest.mark.parametrize("support", [Fixed(), Cart(mass=100.0), Cart(mass=1e-6)], ids=repr)
def test_lanczos_seeds_are_near_the_lowest_modes(support: Fixed | Cart) -> None:
    scene = Scene(gravity=9.81, support=support, pendulum=[Pendulum(links=[Rod(mass=1.0, length=1.0, count=300)])])
    rig = rig_of(scene).natural()[0]
    suspension = Suspension.on_cart(rig.blocks, rig.cart) if rig.cart else Suspension.on_fixed_support(rig.blocks[0])
    few, error = seeds.slow_seeds(suspension, 4)
    np.testing.assert_allclose(few, seeds.seeds(suspension)[0][:4], rtol=1e-10)
    assert error.max() < 1e-8
    some = natural_modes(scene, modes=slice(0, 4))
    np.testing.assert_array_max_ulp(some.omega, natural_modes(scene).omega[:4], 1)


def test_few_modes_of_a_long_chain_take_few_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    trials = []
    reached = squares._is_past

    def counted(problem: squares.Counting, wanted: Floats, points: Floats) -> Floats:
        trials.append(points.size)
        return reached(problem, wanted, points)  # type: ignore[arg-type, return-value]

    monkeypatch.setattr(squares, "_is_past", counted)
    assert len(natural_modes(load("rope"), modes=slice(0, 3))) == 3
    assert trials == [3 * (2 * squares.PLACES_OF_SECOND_GUESS + 1)]


@pytest.mark.parametrize("accuracy", [None, 1e-6])
def test_a_mode_that_lanczos_misses_is_told_by_the_count(
    accuracy: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    def second_on(suspension: Suspension, number: int) -> tuple[Floats, Floats]:
        return tuple(values[1:] for values in seeds.slow_seeds(suspension, number + 1))  # type: ignore[return-value]

    scene = Scene(gravity=9.81, pendulum=[Pendulum(links=[Rod(mass=1.0, length=1.0, count=300)])])
    expected = natural_modes(scene).omega[:3]
    monkeypatch.setattr(squares, "slow_seeds", second_on)
    modes = natural_modes(scene, modes=slice(0, 3), accuracy=accuracy)
    np.testing.assert_allclose(modes.omega, expected, rtol=accuracy or 4e-16)
