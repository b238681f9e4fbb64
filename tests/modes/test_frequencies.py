"""Frequencies to an accuracy, of the lowest modes alone, and of many scenes at once, against those of all modes."""

import numpy as np
import pytest
from amounts import usually
from scenes import extreme_scene, long_scene, mild_scene

from modal import Bob, Cart, Pendulum, Rod, Scene, load, natural_frequencies, natural_modes
from modal.assembly import can_stack
from modal.eigen.spectrum import DENSE
from modal.modes import frequencies
from modal.modes.modes import SELECTED
from modal.scene.parameters import vary


def rods(n: int, support: Cart | None = None) -> Scene:
    options = {"support": support} if support else {}
    return Scene(gravity=9.81, pendulum=[Pendulum(links=[Rod(mass=1.0, length=1.0, count=n)])], **options)


# ---------------------------------------------------------------------------------------------------- an accuracy


@pytest.mark.parametrize("accuracy", [1e-4, 1e-8, 1e-12, 1e-16])
@pytest.mark.parametrize("seed", usually(range(5), range(12)))
def test_modes_are_within_their_bounds_and_those_within_the_accuracy(seed: int, accuracy: float) -> None:
    for scene in (mild_scene(seed), extreme_scene(seed), long_scene(seed)):
        exact, modes = natural_modes(scene), natural_modes(scene, accuracy=accuracy)
        far = np.abs(modes.omega - exact.omega)
        assert np.all(far <= (modes.error + exact.error) * exact.omega)
        assert np.all(modes.error <= np.maximum(accuracy, exact.error) * (1 + 1e-9) + exact.error)


def test_the_route_is_told() -> None:
    assert natural_modes(rods(21), accuracy=1e-8).route == "dense seeds"
    assert natural_modes(rods(21), accuracy=1e-17).route == "effective mass"
    assert natural_modes(rods(21)).route == "effective mass"
    assert DENSE in natural_modes(rods(21), accuracy=1e-8).notes
    assert DENSE not in natural_modes(rods(21)).notes
    uneven = Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=m, length=1.0) for m in (1e-12, 1.0) * 12])])
    assert natural_modes(uneven, accuracy=1e-13).route == "dense seeds, effective mass"


@pytest.mark.parametrize(("support", "route"), [(None, "effective mass"), (Cart(mass=3.0), "exact, effective mass")])
def test_short_chains_get_every_digit_which_costs_less(support: Cart | None, route: str) -> None:
    less, every = natural_modes(rods(20, support), accuracy=1e-3), natural_modes(rods(20, support))
    assert less.route == every.route == route
    assert np.array_equal(less.omega, every.omega)
    assert np.array_equal(less.error, every.error)


def test_long_chains_prove_by_counts_what_no_bound_could() -> None:
    modes = natural_modes(rods(400), accuracy=1e-10)
    assert modes.route == "dense seeds"
    assert modes.error.max() < 1.01e-10
    np.testing.assert_allclose(modes.omega, natural_modes(rods(400)).omega, rtol=1e-10)


@pytest.mark.parametrize("accuracy", [0.0, -1.0, 1.0, float("nan"), float("inf")])
def test_no_such_accuracy(accuracy: float) -> None:
    with pytest.raises(ValueError, match="accuracy"):
        natural_modes(rods(2), accuracy=accuracy)


# -------------------------------------------------------------------------------------------------- some modes


@pytest.mark.parametrize(
    "which", [slice(0, 3), slice(2, 5), slice(None, 4), slice(3, None), slice(-2, None), slice(5, 2)]
)
@pytest.mark.parametrize("name", ["paper-cart-2", "chain-3", "crane-hook", "chain-spatial", "huygens"])
def test_some_modes_are_those_rows_of_the_table(name: str, which: slice) -> None:
    scene = load(name)
    whole, some = natural_modes(scene), natural_modes(scene, modes=which)
    np.testing.assert_array_equal(some.omega, whole.omega[which])
    np.testing.assert_array_equal(some.multiplicity, whole.multiplicity[which])
    rows = range(len(whole))[which]
    assert [mode.number for mode in some] == [row + 1 for row in rows]
    for mode, row in zip(some, rows, strict=True):
        assert mode.kappa == pytest.approx(whole[row].kappa, rel=1e-12, nan_ok=True)
    assert SELECTED in some.notes
    assert SELECTED not in whole.notes


def test_equal_frequencies_of_different_pendula_are_whole_rows() -> None:
    pendulum, other = Pendulum(links=[Bob(mass=1.0, length=1.0)]), Pendulum(links=[Bob(mass=2.0, length=1.0)])
    beside = Pendulum(links=[Rod(mass=1.0, length=0.3, count=3)])
    scene = Scene(gravity=9.81, pendulum=[pendulum, other, beside])
    whole, some = natural_modes(scene), natural_modes(scene, modes=slice(0, 2))
    np.testing.assert_array_equal(some.multiplicity, whole.multiplicity[:2])
    assert 2 in some.multiplicity


def test_a_step_is_not_possible() -> None:
    with pytest.raises(ValueError, match="step"):
        natural_modes(rods(5), modes=slice(0, 4, 2))


def test_three_of_many_links_are_searched_alone() -> None:
    """The first three of 20,000 rods follow a hanging chain's Bessel zeros; none of the others is looked for."""
    modes = natural_modes(rods(20_000), modes=slice(0, 3))
    zeros = np.array([2.404825557695773, 5.520078110286311, 8.653727912911013])
    np.testing.assert_allclose(modes.omega, zeros / 2 * np.sqrt(9.81 / 20_000), rtol=1e-4)
    assert len(modes.spectrum.order) == 3


# -------------------------------------------------------------------------------------------------- many scenes

PLACES = {
    "paper-cart-2": ("support.mass", "pendulum[0].links[0].length"),
    "chain-3": ("gravity", "pendulum[0].links[0].mass"),
    "crane-hook": ("support.mass", "pendulum[0].links[0].length"),
    "chain-spatial": ("gravity", "pendulum[0].links[0].length"),
    "huygens": ("support.mass", "pendulum[0].links[0].mass"),
    "thousand-pendula": ("support.mass", "pendulum[0].links[0].length"),
}


def varied(name: str, count: int = 7) -> list[Scene]:
    return [vary(load(name), dict.fromkeys(PLACES[name], value)) for value in np.geomspace(0.01, 100.0, count).tolist()]


def one_by_one(scenes: list[Scene]) -> list[np.ndarray]:
    return [np.repeat(modes.omega, modes.multiplicity) for modes in map(natural_modes, scenes)]


@pytest.mark.parametrize("name", PLACES)
def test_many_scenes_have_the_frequencies_of_each(name: str) -> None:
    scenes = varied(name, 2 if name == "thousand-pendula" else 7)
    if name == "thousand-pendula":
        scenes = [scene.replace(pendulum=scene.pendulum[:: usually(20, 1)]) for scene in scenes]
    np.testing.assert_array_max_ulp(natural_frequencies(scenes), np.array(one_by_one(scenes)), 2)


@pytest.mark.parametrize("seed", range(30))
def test_random_scenes_of_one_form(seed: int) -> None:
    """The same links with other numbers, from ordinary ones to extreme ones."""
    for scene in (mild_scene(seed), extreme_scene(seed, copies=True)):
        scenes = [scene, *(vary(scene, {"pendulum[*].links[*].mass": 2.0 ** (k / 3)}) for k in range(4))]
        np.testing.assert_array_max_ulp(natural_frequencies(scenes), np.array(one_by_one(scenes)), 4)


def test_scenes_of_one_form_are_not_solved_one_by_one(monkeypatch: pytest.MonkeyPatch) -> None:
    def alone(*_: object) -> None:
        raise AssertionError("one by one")

    monkeypatch.setattr(frequencies, "_one", alone)
    assert natural_frequencies(varied("chain-3")).shape == (7, 3)
    assert natural_frequencies(varied("paper-cart-2", 4)).shape == (4, 5)
    with pytest.raises(AssertionError, match="one by one"):
        natural_frequencies(varied("huygens"))


def test_equal_entries_are_copies_of_one_pendulum(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(frequencies, "_one", None)
    links, masses = [Bob(mass=1.0, length=1.0), Rod(mass=0.5, length=0.7)], np.geomspace(0.1, 50.0, 5)
    written = [Pendulum(links=links), Pendulum(links=[Bob(mass=2.0, length=0.4)]), Pendulum(links=links, count=2)]
    for pendula in (written, [Pendulum(links=links, count=3), written[1]]):
        scene = Scene(gravity=9.81, support=Cart(mass=3.0, stiffness=2.0), pendulum=pendula)
        omegas = natural_frequencies(scene, vary={"support.mass": masses})
        alone = one_by_one([vary(scene, {"support.mass": mass}) for mass in masses.tolist()])
        np.testing.assert_array_max_ulp(omegas, np.array(alone), 2)


@pytest.mark.parametrize("name", ["chain-3", "paper-cart-1", "paper-cart-2", "paper-cart-3"])
def test_no_member_depends_on_the_others(name: str) -> None:
    """To the bit: what a resumed sweep computes is what a whole one does."""
    masses = np.linspace(0.5, 3.0, 5)
    every = natural_frequencies(load(name), vary={"pendulum[0].links[0].mass": masses})
    for k, mass in enumerate(masses.tolist()):
        assert (
            natural_frequencies(load(name), vary={"pendulum[0].links[0].mass": [mass]})[0].tolist() == every[k].tolist()
        )


def test_unequal_pendula_that_meet_are_looked_at_more_closely() -> None:
    pair = [Pendulum(links=[Bob(mass=m, length=1.0)]) for m in (1.0, 2.0)]
    scene = Scene(gravity=9.81, support=Cart(mass=3.0), pendulum=pair)
    scenes = [vary(scene, {"pendulum[1].links[0].length": length}) for length in (0.9, 1.0, 1.0 + 1e-13, 1.1)]
    assert can_stack(scenes)
    np.testing.assert_array_max_ulp(natural_frequencies(scenes), np.array(one_by_one(scenes)), 2)


def test_many_scenes_to_an_accuracy() -> None:
    scenes = varied("paper-cart-2")
    np.testing.assert_allclose(natural_frequencies(scenes, 1e-6), natural_frequencies(scenes), rtol=1e-6)


def test_scenes_of_unlike_sizes_are_refused() -> None:
    with pytest.raises(ValueError, match="from 2 to 3 modes"):
        natural_frequencies([load("chain-2"), load("chain-3")])


def test_no_scenes_have_no_frequencies() -> None:
    assert natural_frequencies([]).shape == (0, 0)
