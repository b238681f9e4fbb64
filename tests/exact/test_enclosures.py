"""Guaranteed enclosures: they hold known zeros, agree with the many-digit oracle, and are as narrow as asked."""

from __future__ import annotations

import random
import sys
import tomllib
from decimal import Decimal
from fractions import Fraction
from itertools import product

import mpmath as mp
import numpy as np
import oracle
import pytest
from amounts import usually
from scenes import extreme_scene, geared, spatial_scene, sprung_scene, structured_scene

from modal import Bob, Body, Cart, ComputationError, Fixed, Pendulum, Rod, Scene, SceneError, load, natural_modes
from modal.assembly import matrices
from modal.errors import MissingExtraError
from modal.exact import enclose
from modal.exact.enclosures import Enclosure, SceneInBalls, _decimal, flint
from modal.scene import ConstantForce, ModalSupport, dumps
from multipendula import check_proof

pytest.importorskip("flint")


def bobs(n: int, **scene: object) -> Scene:
    return Scene(gravity=1.0, pendulum=(Pendulum(links=(Bob(mass=1.0, length=1.0, count=n),)),), **scene)


def square(text: str) -> mp.mpf:
    return mp.mpf(text) ** 2


def assert_proved(scene: Scene, enclosures: list[Enclosure]) -> None:
    """With copies counted, the oracle has at most so many frequencies below each low end and enough below each high."""
    dense = oracle.dense(scene)
    moving = [e for e in enclosures if e.high != "0"]
    assert sum(e.multiplicity for e in enclosures) == natural_modes(scene).multiplicity.sum()
    for e in moving:
        surely = sum(o.multiplicity for o in moving if Decimal(o.high) < Decimal(e.low))
        perhaps = sum(o.multiplicity for o in moving if Decimal(o.low) <= Decimal(e.high))
        assert surely <= dense.below(square(e.low)) <= perhaps - e.multiplicity
        assert surely + e.multiplicity <= dense.below(square(e.high)) <= perhaps


def assert_narrow(enclosures: list[Enclosure], digits: int) -> None:
    for e in enclosures:
        assert mp.mpf(e.high) - mp.mpf(e.low) <= mp.mpf(10) ** -digits * mp.mpf(e.low)


@pytest.mark.parametrize(("n", "digits"), [(1, 30), (3, 60), (20, 30), (60, 100)])
def test_equal_bobs_have_the_zeros_of_laguerre(n: int, digits: int) -> None:
    mp.mp.dps = 3 * digits + 100
    enclosures = enclose(bobs(n), digits)
    assert len(enclosures) == n
    assert_narrow(enclosures, digits)
    for k, e in enumerate(enclosures):
        low, high = mp.laguerre(n, 0, square(e.low)), mp.laguerre(n, 0, square(e.high))
        assert low * high < 0
        assert (low > 0) == (k % 2 == 0)


@pytest.mark.parametrize("seed", range(60))
def test_random_scenes_against_the_oracle(seed: int) -> None:
    scene = extreme_scene(seed, copies=seed % 2 == 0)
    enclosures = enclose(scene, 25)
    assert_narrow(enclosures, 25)
    assert_proved(scene, enclosures)


@pytest.mark.parametrize("seed", range(30))
def test_rotors_and_springs_at_joints_against_the_oracle(seed: int) -> None:
    """As heavy and as stiff as you like, within 12 decades each way."""
    scene = geared(sprung_scene(seed, 2.0), seed, decades=12.0 * (seed % 3) / 2)
    enclosures = enclose(scene, 25)
    assert_narrow(enclosures, 25)
    assert_proved(scene, enclosures)


def below(scene: Scene, square: Fraction) -> tuple[int, int]:
    """How many ω² are below a number and how many up to it, by the checker's own matrices in fractions."""
    n_below, n_equal = check_proof.count(check_proof.blocks_of(tomllib.loads(dumps(scene))), square)
    return n_below, n_below + n_equal


def assert_counted(scene: Scene, enclosures: list[Enclosure]) -> None:
    """As `assert_proved`, with growing modes below 0."""
    signed = [(-(Fraction(e.high) ** 2), -(Fraction(e.low) ** 2)) if e.is_growth else squares(e) for e in enclosures]
    rows = [(*ends, e.multiplicity) for ends, e in zip(signed, enclosures, strict=True)]
    assert sum(e.multiplicity for e in enclosures) == natural_modes(scene).multiplicity.sum()
    for low, high, multiplicity in rows:
        surely = sum(each for _, end, each in rows if end < low)
        perhaps = sum(each for end, _, each in rows if end <= high)
        assert surely <= below(scene, low)[0] <= perhaps - multiplicity
        assert surely + multiplicity <= below(scene, high)[1] <= perhaps


def squares(e: Enclosure) -> tuple[Fraction, Fraction]:
    return Fraction(e.low) ** 2, Fraction(e.high) ** 2


@pytest.mark.parametrize("seed", range(30))
def test_structures_springs_and_standing_links_against_fractions(seed: int) -> None:
    for scene in (structured_scene(seed, 2.0), sprung_scene(seed, 3.0, standing=True), spatial_scene(seed)):
        if not scene.has_dampers:
            enclosures = enclose(scene, 25)
            assert_narrow(enclosures, 25)
            assert_counted(scene, enclosures)


@pytest.mark.parametrize("name", ["two-bobs", "cart-upright"])
def test_shipped_structures_and_standing_links(name: str) -> None:
    scene = load(name)
    enclosures = enclose(scene)
    assert_counted(scene, enclosures)
    assert [e.is_growth for e in enclosures] == sorted((e.is_growth for e in enclosures), reverse=True)


def test_points_of_a_modal_support_move_by_their_rows() -> None:
    """Equal pendula on two of them, against the matrices of the program in 40 digits."""
    frame = ModalSupport(
        M=[[3.0, 0.125], [0.125, 2.0]],
        K=[[16.0, 1.0], [1.0, 9.0]],
        points=[[[0.25, 1.0], [1.0, 0.5]], [[1.0, 0.0], [0.0, 0.5]]],
    )
    bob = Pendulum(links=(Bob(mass=1.0, length=1.0),))
    scene = Scene(gravity=9.0, support=frame, pendulum=(bob.replace(on="modal[0]"), bob.replace(on="modal[1]")))
    dense = matrices(scene)
    with mp.workdps(40):
        M, K = (mp.matrix(S.tolist()) for S in (dense.M, dense.K))
        expected = sorted(mp.sqrt(value.real) for value in mp.eig(M**-1 * K, left=False, right=False))
        for e, omega in zip(enclose(scene, 25), expected, strict=True):
            assert mp.mpf(e.low) < omega < mp.mpf(e.high)


def leaning(*, springs: bool, standing: bool, cart: bool) -> Scene:
    """Three links under a force along the rail, one up, and a torque."""
    links = (
        Bob(mass=1.0, length=1.0, stiffness=20.0 * springs),
        Rod(mass=0.5, length=0.7, stiffness=1.5 * springs),
        Body(mass=0.2, length=0.4, centre=0.1, inertia=0.01),
    )
    forces = (
        ConstantForce(on="pendulum[0].links[1]", amplitude=3.0),
        ConstantForce(on="pendulum[0].links[0]@0.3", amplitude=2.0, direction="torque"),
        ConstantForce(on="pendulum[0].links[2]@0.1", amplitude=1.0, direction="vertical"),
    )
    pendulum = Pendulum(links=links, equilibrium=("up", "down", "down") if standing else None)
    support = Cart(mass=2.0, stiffness=30.0) if cart else Fixed()
    return Scene(gravity=9.81, support=support, pendulum=(pendulum,), force=forces)


def hessian_squares(scene: Scene) -> list[mp.mpf]:
    """ω² of `leaning` by derivatives of its potential, and of all places, at its minimum: nothing of the package."""
    g, cart, (pendulum,) = mp.mpf(scene.gravity), scene.cart, scene.pendulum
    parts = [[mp.mpf(v) for v in (k.mass, k.length, k.centre, k.inertia, k.stiffness)] for k in pendulum.links]
    parts[1][3] = parts[1][0] * parts[1][1] ** 2 / 12
    n, upright = len(parts), [mp.pi * (way == "up") for way in pendulum.ways]

    def places(q: list[mp.mpf]) -> list[tuple[mp.mpf, mp.mpf]]:
        x, z, points = q[n] if cart else mp.mpf(0), mp.mpf(0), []
        for (_, l, c, _, _), angle in zip(parts, q, strict=False):
            points.append((x + c * mp.sin(angle), z + c * mp.cos(angle)))
            x, z = x + l * mp.sin(angle), z + l * mp.cos(angle)
        tip = (x + (mp.mpf(0.1) - l) * mp.sin(q[n - 1]), z + (mp.mpf(0.1) - l) * mp.cos(q[n - 1]))
        return [*points, tip]

    def potential(*q: mp.mpf) -> mp.mpf:
        points = places(list(q))
        energy = -sum(g * part[0] * z for part, (_, z) in zip(parts, points, strict=False))
        bends = [q[i] - upright[i] - (q[i - 1] - upright[i - 1] if i else 0) for i in range(n)]
        energy += sum(part[4] * bend**2 for part, bend in zip(parts, bends, strict=True)) / 2
        energy -= 3 * points[1][0] + 2 * q[0] - points[n][1]
        return energy + (cart.stiffness * q[n] ** 2 / 2 if cart else 0)

    size = n + bool(cart)

    def unit(*where: int) -> tuple[int, ...]:
        return tuple(where.count(i) for i in range(size))

    start = [*natural_modes(scene).rig.rest_angles, *([3.0 / cart.stiffness] if cart else [])]
    slopes = [lambda *q, i=i: mp.diff(potential, q, unit(i)) for i in range(size)]
    rest = [mp.mpf(value) for value in mp.findroot(slopes, start)]
    K = mp.matrix(size, size)
    M = mp.matrix(size, size)
    for i, j in product(range(size), repeat=2):
        K[i, j] = mp.diff(potential, rest, unit(i, j))
        for k, (mass, _, _, inertia, _) in enumerate(parts):
            ways = [
                [mp.diff(lambda *q, k=k, w=w: places(list(q))[k][w], rest, unit(a)) for a in (i, j)] for w in (0, 1)
            ]
            M[i, j] += mass * sum(a * b for a, b in ways) + inertia * (i == j == k)
    if cart:
        M[n, n] += cart.mass
    return sorted((value.real for value in mp.eig(M**-1 * K, left=False, right=False)), key=float)


@pytest.mark.parametrize(("springs", "standing"), [(False, False), (True, False), (True, True), (False, True)])
@pytest.mark.parametrize("cart", [False, True])
def test_rests_that_lean_against_derivatives_of_the_energy(springs: bool, standing: bool, cart: bool) -> None:
    scene = leaning(springs=springs, standing=standing, cart=cart)
    with mp.workdps(60):
        expected = hessian_squares(scene)
        enclosures = enclose(scene, 12)
        assert len(enclosures) == len(expected)
        for e, value in zip(enclosures, expected, strict=True):
            assert e.is_growth == (value < 0)
            assert mp.mpf(e.low) < mp.sqrt(abs(value)) < mp.mpf(e.high)


def test_the_proof_bites() -> None:
    scene = bobs(3)
    enclosures = enclose(scene)
    shifted = [Enclosure(e.high, str(Decimal(e.high) + 1), e.multiplicity, e.label) for e in enclosures]
    with pytest.raises(AssertionError):
        assert_proved(scene, shifted)
    with pytest.raises(AssertionError):
        assert_narrow(enclosures, 40)


def test_the_paper_cart() -> None:
    enclosures = enclose(load("paper-cart-2"))
    assert (enclosures[0].low, enclosures[0].high, enclosures[0].label) == ("0", "0", "rigid translation")
    assert [e.label for e in enclosures[1:]] == ["cart still: pendulum 1", "cart moves"] * 2
    known = ["2.68011401225337", "2.71754911798158", "7.18867087028771", "7.20947810306892"]
    assert [e.low[:16] for e in enclosures[1:]] == known
    assert enclosures[2].text().startswith("2.7175491179815823321816907218")


def test_symmetric_copies_are_counted_not_computed() -> None:
    scene = bobs(2, support=Cart(mass=2.0)).model_dump()
    scene["pendulum"][0]["count"] = 4
    for space, still in (("plane", 3), ("space", 7)):
        enclosures = enclose(Scene.model_validate(scene | {"space": space}))
        assert [e.multiplicity for e in enclosures if e.label == "cart still: pendulum 1"] == [still] * 2
        assert [e.multiplicity for e in enclosures if e.label == "cart moves"] == [1] * 2


def test_a_massless_cart_loses_a_mode() -> None:
    assert [e.label for e in enclose(bobs(1, support=Cart(mass=0.0)))] == ["rigid translation"]
    held = enclose(bobs(1, support=Cart(mass=0.0, stiffness=1.0)))
    assert [Decimal(e.low) ** 2 <= Decimal("0.5") <= Decimal(e.high) ** 2 for e in held] == [True]


def test_bisection_alone_gives_the_same() -> None:
    """Where Newton's iteration fails, from however bad a start."""
    balls = SceneInBalls(bobs(4))
    with flint().ctx.workprec(200):
        arb = flint().arb
        width = arb(10) ** -30
        for index, start in enumerate((arb(40), arb(40), arb("0.001"), arb(1))):
            low, high = balls.bisect(0, index, start, width, 200)
            assert high - low < 3 * width * high
            assert balls.count_in(0, low, 200) == index
            assert balls.count_in(0, high, 200) == index + 1


def test_a_cluster_closer_than_double_precision() -> None:
    """Two pendula on a heavy cart whose squares differ by parts in 10^15, too little for Newton's method."""
    near = (Pendulum(links=(Bob(mass=1.0, length=1.0),)), Pendulum(links=(Bob(mass=1.0, length=1.0 + 2**-52),)))
    scene = Scene(gravity=1.0, support=Cart(mass=1e18), pendulum=near)
    enclosures = enclose(scene, 40)
    assert_narrow(enclosures[1:], 40)
    assert_proved(scene, enclosures)
    assert Decimal(enclosures[1].high) < Decimal(enclosures[2].low)


@pytest.mark.parametrize(("x", "low", "high"), [(2, "1.4142", "1.4143"), (9, "3.0000", "3.0000")])
def test_decimals_are_rounded_outward(x: int, low: str, high: str) -> None:
    assert (_decimal(flint().arb(x), 3, up=False), _decimal(flint().arb(x), 3, up=True)) == (low, high)
    tiny = flint().arb(2) ** -401
    assert Decimal(_decimal(tiny, 3, up=False)) ** 2 < Decimal(2) ** -401 < Decimal(_decimal(tiny, 3, up=True)) ** 2


def test_refusals(monkeypatch: pytest.MonkeyPatch) -> None:
    damped = Scene(gravity=1.0, pendulum=(Pendulum(links=(Bob(mass=1.0, length=1.0, damping=1.0),)),))
    law = {"kind": "van-der-pol", "strength": 1.0, "angle_deg": 5.0}
    lawful = Scene(gravity=1.0, pendulum=[{"links": [{"kind": "bob", "mass": 1.0, "length": 1.0, "law": law}]}])
    for scene in (damped, lawful):
        with pytest.raises(SceneError, match="an enclosure"):
            enclose(scene)
    with pytest.raises(ComputationError, match="bits do not suffice"):
        SceneInBalls(bobs(1)).count(Fraction(1))
    monkeypatch.setitem(sys.modules, "flint", None)
    with pytest.raises(MissingExtraError, match=r"\.\[certified\]"):
        enclose(bobs(1))


def test_progress_is_told_frequency_by_frequency() -> None:
    done: list[float] = []
    scene = Scene(
        gravity=9.81, support=Cart(mass=2.0), pendulum=(Pendulum(links=(Bob(mass=1.0, length=1.0),), count=3),)
    )
    enclosures = enclose(scene, 25, done.append)
    assert len(enclosures) == 1 + len(done)
    assert done == pytest.approx([0.5, 1.0])


BUCKLING = [0.0, 1e-15, 1e-12, 1e-9, 1e-3]


@pytest.mark.parametrize("seed", usually(range(12), range(200)))
def test_standing_links_near_buckling(seed: int) -> None:
    """A spring that carries its link but for rounding: doubles may take the wrong sign, and say so."""
    rng = random.Random(seed)
    kinds = [rng.choice((Bob, Rod)) for _ in range(rng.choice((2, 3)))]
    sizes = [(10 ** rng.uniform(-6, 6), 10 ** rng.uniform(-3, 3), 10 ** rng.uniform(-9, 9)) for _ in kinds]
    links = [kind(mass=m, length=length, stiffness=k) for kind, (m, length, k) in zip(kinds, sizes, strict=True)]
    weight = links[-1].mass * 9.81 * links[-1].length * (0.5 if kinds[-1] is Rod else 1.0)
    links[-1] = links[-1].replace(stiffness=weight * (1 + rng.choice(BUCKLING)))
    scene = Scene(gravity=9.81, pendulum=(Pendulum(links=links, equilibrium=("up",) * len(links)),))
    modes, rows = natural_modes(scene), enclose(scene, 25)
    assert len(rows) == len(links)
    exact = sorted(Decimal(row.low) * (-1 if row.is_growth else 1) for row in rows)
    values = sorted(zip((-value.real or value.imag for value in modes.eigenvalue), modes.error, strict=True))
    for expected, (value, bound) in zip(exact, values, strict=True):
        assert abs(Decimal(float(value)) / expected - 1) <= Decimal(float(bound)) or not np.isfinite(bound)
