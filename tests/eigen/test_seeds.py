"""Seeds, Rayleigh quotient steps and Sturm counts lead to the floats at which bisection alone ends."""

import random

import mpmath as mp
import numpy as np
import pytest
from oracle import dense
from scenes import extreme_pendulum, extreme_scene, long_scene

from modal import Bob, Cart, Fixed, Pendulum, Rod, Scene, natural_modes
from modal.assembly import rig_of
from modal.eigen import recursion, seeds, squares
from modal.eigen.coupled import CartPendula
from modal.eigen.recursion import Suspension
from modal.eigen.seeds import at_pivot
from modal.eigen.squares import confirm, locate, search, squares_of
from modal.types import Floats, Ints

ULPS = 4
SUPPORTS = (Fixed(), Cart(mass=100.0), Cart(mass=1e-6), Cart(mass=0.0), Cart(mass=1.0, stiffness=3.0))


def suspended(scene: Scene) -> tuple[Suspension, int]:
    """What hangs there, on a fixed support the first block, and how many modes it has."""
    rig = rig_of(scene).natural()[0]
    if rig.cart is None:
        return Suspension.on_fixed_support(rig.blocks[0]), rig.blocks[0].n
    return Suspension.on_cart(rig.blocks, rig.cart), CartPendula(rig).n_modes


def bits(x: Floats) -> Ints:
    return np.ascontiguousarray(x).view(np.int64)


def random_chain(n: int, spread: float, support: Fixed | Cart, seed: int) -> Scene:
    rng = random.Random(seed)
    numbers = [(10 ** rng.uniform(-spread, spread), 10 ** rng.uniform(-spread, spread)) for _ in range(n)]
    links = [rng.choice([Bob, Rod])(mass=m, length=l) for m, l in numbers]
    return Scene(gravity=9.81, support=support, pendulum=[Pendulum(links=links)])


def assert_bisection_agrees(scene: Scene) -> None:
    suspension, modes = suspended(scene)
    places = np.arange(modes)
    roots = squares_of(suspension, places, modes)
    expected = locate(suspension, places, modes)
    assert np.abs(bits(roots.x) - bits(expected)).max(initial=0) <= ULPS
    assert not roots.error.any()


@pytest.mark.parametrize("support", SUPPORTS, ids=lambda support: f"{support.kind} {getattr(support, 'mass', '')}")
@pytest.mark.parametrize("spread", [0.0, 0.3, 1.0, 3.0, 6.0])
@pytest.mark.parametrize("n", [1, 2, 12, 60])
def test_chains_of_any_ratio(n: int, spread: float, support: Fixed | Cart) -> None:
    assert_bisection_agrees(random_chain(n, spread, support, n))


@pytest.mark.parametrize("seed", range(40))
def test_several_pendula(seed: int) -> None:
    assert_bisection_agrees(long_scene(seed, 12))
    assert_bisection_agrees(extreme_scene(seed))


@pytest.mark.parametrize("n", [1, 3, 30])
@pytest.mark.parametrize("support", SUPPORTS[:2] + SUPPORTS[4:], ids=lambda support: support.kind)
def test_seeds_are_within_their_bounds(n: int, support: Fixed | Cart) -> None:
    for seed in range(10):
        suspension, modes = suspended(random_chain(n, 1.0, support, seed))
        guess, error = (values[:modes] for values in seeds.seeds(suspension))
        exact = locate(suspension, np.arange(modes), modes)
        assert np.all(np.abs(guess / exact - 1) <= error)


@pytest.mark.parametrize("accuracy", [1e-12, 1e-8, 1e-3])
def test_the_terms_of_a_difference_bound_its_error(accuracy: float) -> None:
    """Light carts under heavy pendula; the count of the oracle in 400 bits tells where each frequency is."""
    rng = random.Random(int(1 / accuracy))
    scenes = [
        Scene(gravity=9.81, support=Cart(mass=1e-9), pendulum=[Pendulum(count=2, links=[Bob(mass=1.0, length=1.0)])])
    ]
    for _ in range(60):
        support = Cart(mass=10.0 ** rng.uniform(-12, 12))
        pendula = [extreme_pendulum(rng, rng.choice([0.3, 3.0, 12.0]), longest=3) for _ in range(rng.randint(1, 3))]
        scenes.append(Scene(gravity=9.81, support=support, pendulum=tuple(pendula)))
    for scene in scenes:
        modes, problem = natural_modes(scene, accuracy=accuracy), dense(scene)
        ends = np.cumsum(modes.multiplicity)
        for omega, error, copies, end in zip(modes.omega, modes.error, modes.multiplicity, ends, strict=True):
            if omega > 0:
                assert error <= accuracy + 1e-14
                few, many = (problem.below((mp.mpf(omega) * (1 + sign * mp.mpf(error))) ** 2) for sign in (-1, 1))
                assert many - few >= copies, (scene, omega, error)
                assert few <= end + 1 - copies


def test_a_step_squares_what_was_missed() -> None:
    """From a relative distance of 1e-6, on a chain whose frequencies are well apart."""
    suspension, modes = suspended(random_chain(6, 0.1, Cart(mass=3.0), 1))
    exact = locate(suspension, np.arange(modes), modes)
    assert np.abs(at_pivot(suspension, exact * (1 + 1e-6)) / exact - 1).max() < 1e-8


@pytest.mark.parametrize("off", [1 + 1e-12, 1 + 1e-6, 0.5, 40.0, np.nan, np.inf, -1.0, 0.0])
def test_wrong_guesses_are_found_out(off: float) -> None:
    suspension, modes = suspended(random_chain(5, 0.5, Cart(mass=3.0), 2))
    places = np.arange(modes)
    exact = locate(suspension, places, modes)
    near, missed = confirm(suspension, places, exact)
    assert not missed.any()
    np.testing.assert_array_equal(near, exact)
    with np.errstate(all="ignore"):
        wrong = exact * off
        assert confirm(suspension, places, wrong)[1].all()
        claimed = np.full(exact.shape, np.inf if not np.isfinite(off) else 1e-13)
        np.testing.assert_array_equal(search(suspension, places, wrong, claimed, modes), exact)


def test_without_a_dense_matrix_it_is_bisection(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = random_chain(8, 1.0, Cart(mass=1.0), 3)
    expected = natural_modes(scene).omega

    def fails(suspension: Suspension) -> None:
        raise np.linalg.LinAlgError

    monkeypatch.setattr(squares, "seeds", fails)
    np.testing.assert_array_equal(natural_modes(scene).omega, expected)


@pytest.mark.parametrize("seed", range(6))
def test_scalar_arithmetic_is_that_of_numpy(seed: int) -> None:
    """Bit for bit, at trial values on either side of every frequency, and next to the exact zero of a pivot.

    Floats stop where a pivot is zero.
    """
    rng = np.random.default_rng(seed)
    numbers = 10 ** rng.uniform(-2, 2, (2, 1 + 5 * seed, 1, 1, 1))
    hung = recursion.chains_of(numbers[0], numbers[1], numbers[1] / 2, numbers[0] * numbers[1] ** 2 / 12)
    x = np.append(10 ** rng.uniform(-6, 6, 33), 1 / (hung.r * hung.inverse)[0, 0, 0])[:, None]
    rows = (hung.inverse, hung.J, hung.top_inertia, hung.tip_inertia, hung.m, hung.cross, hung.r, hung.p, hung.q)
    links = list(zip(*(values[::-1, 0, 0, 0].tolist() for values in rows), strict=True))
    counted = [link[:5] for link in links]
    with np.errstate(all="ignore"):
        each = [
            (recursion._count_in_arrays(hung, x, 0.0), lambda y: recursion.count_in_floats(counted, y)),
            (
                recursion._count_in_arrays(hung, x, recursion.NUDGE),
                lambda y: recursion.count_in_floats(counted, y, recursion.NUDGE),
            ),
            (seeds._mass_and_energy(hung, x), lambda y: recursion.mass_and_energy_in_floats(links, y)),
        ]
    for expected, by_numbers in each:
        for k, y in enumerate(x[:, 0].tolist()):
            wanted = [values[0, k, 0] for values in expected]
            if np.isfinite(wanted).all():
                assert list(by_numbers(y)) == wanted
            else:
                with pytest.raises(ZeroDivisionError):
                    by_numbers(y)


def test_counts_are_few(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 100 rods: one confirmation of all, and the additional work for the slowest mode."""
    asked: list[int] = []
    count = Suspension.count
    monkeypatch.setattr(Suspension, "count", lambda self, x: asked.append(x.size) or count(self, x))
    natural_modes(Scene(gravity=9.81, pendulum=[Pendulum(links=[Rod(mass=1.0, length=1.0, count=100)])]))
    assert len(asked) <= 6
    assert sum(asked) < 1000
