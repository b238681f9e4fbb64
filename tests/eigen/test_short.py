"""One short chain in floats: the same floats as the general route, and no more counts than it takes."""

import copy
import pickle
import random
import sys
from collections import Counter
from types import FrameType

import numpy as np
import pytest
from compare import assert_certified
from scenes import mild_scene

from modal import Bob, Body, Cart, Fixed, Modes, Pendulum, Rod, Scene, natural_frequencies, natural_modes
from modal.assembly import rig_of, single
from modal.eigen import find_spectrum, short, short_squares
from modal.modes.eigenvalues import Short

ULPS = 4
SUPPORTS = (Fixed(), Cart(mass=100.0), Cart(mass=1e-12), Cart(mass=1e12), Cart(mass=1.0, stiffness=3.0))


def random_chain(seed: int, spread: float, support: Fixed | Cart) -> Scene:
    rng = random.Random(seed)
    links: list[Bob | Rod | Body] = []
    for _ in range(rng.randint(1, 20)):
        mass, length = 10 ** rng.uniform(-spread, spread), 10 ** rng.uniform(-spread / 3, spread / 3)
        body = Body(mass=mass, length=length, centre=1.2 * length, inertia=rng.choice([0.0, 0.1]) * mass * length**2)
        links.append(rng.choice([Bob(mass=mass, length=length), Rod(mass=mass, length=length), body]))
    return Scene(gravity=9.81, support=support, pendulum=[Pendulum(links=links)])


def rods(n: int) -> Scene:
    return Scene(
        gravity=9.81, support=Cart(mass=100.0), pendulum=[Pendulum(links=[Rod(mass=1.0, length=1.0, count=n)])]
    )


@pytest.mark.parametrize("support", SUPPORTS, ids=repr)
@pytest.mark.parametrize("spread", [0.0, 0.3, 3.0, 12.0])
def test_the_floats_are_those_of_the_general_route(support: Fixed | Cart, spread: float) -> None:
    solved = 0
    for seed in range(8):
        scene = random_chain(seed, spread, support)
        if (short := Short.of(scene)) is None:
            continue
        solved += 1
        natural, units = rig_of(scene).natural()
        with np.errstate(all="ignore"):
            expected = find_spectrum(natural)
        np.testing.assert_array_max_ulp(short.omega, np.abs(expected.eigenvalue * units.rate), ULPS)
        np.testing.assert_array_equal(short.error, expected.error)
    usual = spread <= 0.3 and support != Cart(mass=1e12)  # a cart at rest in all modes says nothing of them
    assert solved >= (5 if usual else 1)


@pytest.mark.parametrize("seed", range(5))
def test_every_digit_is_that_of_many(seed: int) -> None:
    modes = natural_modes(random_chain(seed, 0.3, SUPPORTS[seed % len(SUPPORTS)]))
    assert_certified(modes, float(modes.error.max()))


@pytest.mark.parametrize("n", [1, 2, 10, 20])
def test_two_counts_confirm_a_mode(n: int, monkeypatch: pytest.MonkeyPatch) -> None:
    swept, calls = short.swept, Counter[str]()

    def counted(*arguments: object) -> tuple[int, float]:
        calls["counts"] += 1
        return swept(*arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(short, "omega_of_carts", counted)
    assert natural_frequencies(rods(n)).shape == (n + 1,)
    assert 2 * n <= calls["counts"] <= 2.5 * n + 1


def calls_of(scene: Scene) -> int:
    """Calls of Python functions until the frequencies of a scene are there."""
    made = 0

    def profile(_: FrameType, event: str, __: object) -> None:
        nonlocal made
        made += event == "call"

    natural_modes(scene).omega.sum()
    sys.setprofile(profile)
    try:
        natural_modes(scene).omega.sum()
    finally:
        sys.setprofile(None)
    return made


def test_a_small_table_takes_few_calls() -> None:
    assert calls_of(rods(2)) <= 70
    assert calls_of(rods(10)) <= 150


def test_arrays_and_sources_wait_for_shapes() -> None:
    modes = natural_modes(rods(3))
    assert modes.short
    assert len(modes) == 4
    assert modes.omega[0] == 0
    assert modes.multiplicity.tolist() == [1, 1, 1, 1]
    assert not {"rig", "spectrum", "_whole"} & set(vars(modes))
    np.testing.assert_array_equal(modes.omega, np.abs(modes.spectrum.eigenvalue * modes.units.rate))
    np.testing.assert_array_equal(modes.error, modes.spectrum.error)
    assert modes[1].residual < 1e-12


def test_what_waits_behaves_as_what_is_there() -> None:
    scene = rods(3)
    lazy, eager = natural_modes(scene), Modes(scene)
    assert eager.short is None
    assert dir(lazy) == dir(eager)
    assert repr(lazy) == repr(eager)
    assert lazy.table() == eager.table()
    for again in (pickle.loads(pickle.dumps(natural_modes(scene))), copy.deepcopy(natural_modes(scene))):
        np.testing.assert_array_equal(again.omega, eager.omega)
        assert again.table() == eager.table()
    with pytest.raises(AttributeError):
        natural_modes(scene).scene = scene  # type: ignore[misc]
    with pytest.raises(ValueError, match="read-only"):
        natural_modes(scene).omega[0] = 1.0


def test_only_a_short_plain_chain_is_one() -> None:
    assert single(rods(20))
    assert single(rods(21)) is None
    for key in ("damping", "stiffness", "drag"):
        links = [Rod(mass=1.0, length=1.0, **{key: 0.1})]
        assert single(Scene(gravity=9.81, pendulum=[Pendulum(links=links)])) is None
    assert single(Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0)], count=2)])) is None
    assert single(mild_scene(0)) is None or len(mild_scene(0).pendulum) == 1


def test_an_exact_zero_is_nudged() -> None:
    """At ω² = k/r of one bob the pivot is exactly zero."""
    chain = single(Scene(gravity=1.0, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0)])]))
    assert chain
    assert short_squares(chain.links, chain.cart) == pytest.approx(chain.units.length, abs=0)
