"""What an audit says was built, against what was: calls of LAPACK, searches, bytes, imports, coordinates by hand."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import product
from typing import Any

import numpy as np
import pytest
import scipy.linalg
from amounts import usually
from test_architecture import HEAVY

from modal import (
    Bob,
    Body,
    Cart,
    ComputationError,
    Fixed,
    Pendulum,
    Rod,
    Scene,
    load,
    matrices,
    natural_modes,
)
from modal.assembly import assemble_pendula, rig_of
from modal.eigen import chains, dense, sources, squares, structured
from modal.eigen import coupled as crowd
from modal.eigen.component_matrices import ComponentMatrices
from modal.eigen.components import PartedRig
from modal.eigen.recursion import Suspension
from modal.modes.solution_report import PACKAGES, SolutionReport, report_solution


def rods(n: int, count: int = 1, length: float = 1.0, **link: float) -> Pendulum:
    return Pendulum(links=(Rod(mass=1.0, length=length, count=n, **link),), count=count)


def bobs(n: int, **link: float) -> Pendulum:
    return Pendulum(links=(Bob(mass=1.0, length=1.0, count=n, **link),))


def scene(*pendula: Pendulum, cart: Cart | None = None, space: str = "plane") -> Scene:
    return Scene(gravity=9.81, support=cart or Fixed(), space=space, pendulum=pendula)


CART = Cart(mass=5.0)
EQUAL, DIFFERENT = ((2, 3),), ((2, 2), (3, 1))
UNKNOWNS = {
    # on a cart, pendula as (links, copies): counted by hand
    (False, EQUAL): 2,  # one pendulum
    (False, DIFFERENT): 2 + 3,  # one of each
    (True, EQUAL): 2 + 3,  # one with the cart still, one with the cart
    (True, DIFFERENT): 2 + 3 + 6,  # each with the cart still, all with the cart
}


@pytest.mark.parametrize(
    ("on_cart", "in_space", "pendula", "damped"),
    list(product([False, True], [False, True], [EQUAL, DIFFERENT], [0.0, 0.01])),
)
def test_degrees_of_freedom(on_cart: bool, in_space: bool, pendula: tuple[tuple[int, int], ...], damped: float) -> None:
    example = scene(
        *(rods(n, count, damping=damped) for n, count in pendula),
        cart=CART if on_cart else None,
        space="space" if in_space else "plane",
    )
    modes = natural_modes(example)
    report = report_solution(modes)
    links = {EQUAL: 6, DIFFERENT: 7}[pendula]
    assert report.coordinates == (2 if in_space else 1) * links + on_cart == modes.multiplicity.sum()
    assert len(matrices(example).M) == links + on_cart
    unneeded = 3 if on_cart and damped and not in_space and pendula == DIFFERENT else 0  # matrices ask for no poles
    assert report.unknowns == UNKNOWNS[on_cart, pendula] - unneeded
    assert sum(part.modes for part in report.parts) == report.coordinates
    assert report.complex_problem == bool(damped)


# --------------------------------------------------------------------------------- what LAPACK was really handed


@pytest.fixture
def handed(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, int, bool]]:
    """Name, largest side and whether complex, of every call that numpy.linalg and scipy.linalg get."""
    calls: list[tuple[str, int, bool]] = []

    def watched(name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any, **named: Any) -> Any:
            arrays = [value for value in arguments if isinstance(value, np.ndarray)]
            calls.append((name, max(max(a.shape[-2:]) for a in arrays), any(np.iscomplexobj(a) for a in arrays)))
            return function(*arguments, **named)

        return call

    names = (
        "eig",
        "eigh",
        "eigvals",
        "eigvalsh",
        "solve",
        "cholesky",
        "inv",
        "pinv",
        "svd",
        "qr",
        "lstsq",
        "det",
        "norm",
    )
    for module, name in product((np.linalg, scipy.linalg), names):
        if hasattr(module, name):
            monkeypatch.setattr(module, name, watched(name, getattr(module, name)))
    return calls


def test_the_watch_on_lapack_bites(handed: list[tuple[str, int, bool]]) -> None:
    np.linalg.eigvalsh(np.eye(7))
    scipy.linalg.solve(np.eye(3), 1j * np.ones(3))
    assert handed == [("eigvalsh", 7, False), ("solve", 3, True)]


LONG = tuple(rods(n) for n in range(1, 34)) + tuple(rods(n, length=1.5) for n in (10, 20, 30))
ROUTES = {
    "chain": (scene(rods(5)), 0),
    "thousand": (scene(rods(3, 1000), cart=CART), 0),
    "different": (scene(rods(3), rods(2, length=2.0), cart=CART, space="space"), 0),
    "crowd": (scene(*LONG, cart=CART), 0),
    "few": (scene(*LONG[:6], rods(4, length=2.0), cart=CART), 0),
    "springs": (scene(rods(4, 9, stiffness=0.5)), 0),
    "springs on a cart": (scene(rods(4, 9, stiffness=0.5), cart=CART), 0),
    "held cart": (scene(rods(2, stiffness=0.5), cart=Cart(mass=1.0, stiffness=2.0)), 0),
    "one damper": (scene(rods(4, damping=0.1), rods(3, length=2.0)), 8),
    "dashpot": (scene(rods(4, 9), cart=Cart(mass=1.0, damping=0.3)), 10),
    "damped": (scene(rods(4, 9, damping=0.1), cart=CART), 8),
    "upright": (
        scene(Pendulum(links=(Rod(mass=1.0, length=1.0, count=2),), equilibrium=("down", "up")), cart=CART),
        0,
    ),
    "springs on a massless cart": (scene(bobs(2, stiffness=0.5), cart=Cart(mass=0.0)), 3),
}


@pytest.mark.parametrize("name", ROUTES)
def test_lapack_gets_what_the_audit_tells(name: str, handed: list[tuple[str, int, bool]]) -> None:
    """`largest` order, by hand: of the coordinates or, with dampers, of the states; tables of shapes ask no more.

    Seeds of structured routes are eigenvalues alone, of matrices as large as one problem, chains of one link apart.
    """
    example, largest = ROUTES[name]
    modes = natural_modes(example)
    list(modes)
    report = report_solution(modes)
    asked = [matrix for matrix in report.matrices if matrix.name not in {"own shapes", "seeds"}]
    seeds = [matrix.order for matrix in report.matrices if matrix.name == "seeds"]
    order = max((size for name, size, _ in handed if name == "eigvalsh"), default=0)
    assert order == max(seeds, default=0) or example.has_damping
    assert max((size for name, size, _ in handed if name != "eigvalsh"), default=0) <= largest
    assert max((matrix.order for matrix in asked), default=0) == largest
    solved = {kind: sum(m.number for m in asked if m.name == kind) for kind in ("symmetric", "state")}
    calls = [call for call, *_ in handed]
    assert solved == {"symmetric": calls.count("eigh"), "state": calls.count("eig")}
    assert report.complex_problem == ("eig" in calls)
    assert report.complex_problem == example.has_damping
    assert example.has_damping or not any(is_complex for *_, is_complex in handed)
    shapes = [source._dense.shape for source in modes.spectrum.sources if source.route == "dense"]
    assert all(np.iscomplexobj(shape) == report.complex_problem for shape in shapes)


# --------------------------------------------------------------------------------------------- searches and bytes


def test_every_different_chain_is_searched_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two kinds of two links, one of them twice: its antiphase modes are among those that couple the kinds."""
    searched: list[int] = []

    def watched(block: Any, limits: Any) -> Any:
        searched.append(block.size)
        return chains.fixed_squares(block, limits)

    monkeypatch.setattr(sources, "fixed_squares", watched)
    modes = natural_modes(scene(rods(2, 2), rods(2, length=2.0), cart=CART))
    report = report_solution(modes)
    assert sum(searched) == 2 == report.parts[0].problems
    assert [part.modes for part in report.parts] == [2, 1, 4]


def test_modes_that_nobody_takes_name_no_route() -> None:
    modes = natural_modes(load("thousand-pendula"))
    assert modes.route == "exact, secular equation"
    assert [(part.modes, part.problems) for part in report_solution(modes).parts] == [(0, 1000), (1, 1), (1000, 1)]


def peak(job: Callable[[], object]) -> int:
    """Bytes that a job holds at most."""
    tracemalloc.start()
    try:
        job()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_a_thousand_equal_pendula_take_the_memory_of_two() -> None:
    two, thousand = (scene(rods(3, count), cart=CART) for count in (2, 1000))
    list(natural_modes(two))
    few, many = (min(peak(lambda: list(natural_modes(example))) for _ in range(3)) for example in (two, thousand))  # noqa: B023
    assert many < 1.2 * few
    different = scene(*(rods(3, length=1.0 + k / 1000) for k in range(1000)), cart=CART)
    assert peak(lambda: natural_modes(different)) > 10 * peak(lambda: natural_modes(two))


def test_a_long_chain_takes_memory_in_proportion(monkeypatch: pytest.MonkeyPatch) -> None:
    """One step of the search for all frequencies is as large as any; an n × n array would be 288 MB."""

    def one_step(problem: Suspension, wanted: Any, low: Any, high: Any) -> Any:
        trial = np.linspace(*(end[0].view(float) for end in (low, high)), len(wanted)).reshape(-1, 1)
        problem.count(trial)
        return trial

    monkeypatch.setattr(squares, "_bisect_between", one_step)
    natural_modes(scene(rods(400)))[0]
    part, whole = (peak(lambda n=n: natural_modes(scene(rods(n)))[0]) for n in (800, 6_000))
    assert whole < 10 * part
    assert whole < 6_000**2 * 8 / 5


def test_rows_of_a_dense_scene_take_a_few_matrices() -> None:
    example = scene(rods(60, stiffness=0.1), cart=Cart(mass=1.0, stiffness=1.0))
    assert peak(lambda: list(natural_modes(example))) < 40 * 61**2 * 8


def test_shapes_of_a_crowd_piece_by_piece(monkeypatch: pytest.MonkeyPatch) -> None:
    block = rig_of(scene(rods(5), rods(5, length=1.5), rods(5, length=0.7))).natural()[0].blocks[0]
    square = chains.fixed_squares(block).x
    whole = crowd._own_modes(block, square)
    monkeypatch.setattr(crowd, "NUMBERS_IN_CHUNK", 20)
    pieces = crowd._own_modes(block, square)
    for name in ("momentum", "modal_mass", "turn"):
        np.testing.assert_array_equal(getattr(whole, name), getattr(pieces, name))


# ---------------------------------------------------------------------------------------- matrices not asked for


@pytest.mark.parametrize(("link", "limit"), [({"stiffness": 1.0}, 2000), ({"damping": 1.0}, 500)])
def test_too_large_is_said_before_a_matrix_is_built(
    link: dict[str, float], limit: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    def built(*_: object, **__: object) -> None:
        raise AssertionError("a matrix was built")

    monkeypatch.setattr(ComponentMatrices, "_factor", built)
    monkeypatch.setattr(structured, "MOST_LINKS_TOGETHER", 2)
    with pytest.raises(ComputationError, match=f"{limit + 1} coordinates, at most {limit}"):
        natural_modes(scene(rods(limit, **link), cart=CART))
    with pytest.raises(AssertionError, match="was built"):
        natural_modes(scene(rods(3, **link), cart=CART))


def test_no_damping_matrix_without_dampers(monkeypatch: pytest.MonkeyPatch) -> None:
    def built(*_: object, **__: object) -> None:
        raise AssertionError("D was built")

    monkeypatch.setattr(structured.OnStructure, "_dampers", property(built))
    modes = natural_modes(ROUTES["springs on a massless cart"][0])
    assert len(list(modes)) == 2
    assert "no damping matrix: nothing damps" in report_solution(modes).left_out
    with pytest.raises(AssertionError, match="D was built"):
        list(natural_modes(scene(rods(3, damping=1.0))))


@pytest.mark.parametrize("cart", [None, CART, Cart(mass=1.0, stiffness=30.0)])
def test_terms_that_cancel_in_an_upright_scene(cart: Cart | None, monkeypatch: pytest.MonkeyPatch) -> None:
    """Their sizes add up to the diagonal of K with every link hanging."""
    handed: list[Any] = []

    def watched(*arguments: Any, **named: Any) -> dense.Eigen:
        handed.append(named["terms"])
        return dense_indefinite(*arguments, **named)

    dense_indefinite = dense.indefinite_modes
    monkeypatch.setattr(dense, "indefinite_modes", watched)
    links = tuple(Body(mass=m, length=1.0, centre=0.4, inertia=0.1, stiffness=3.0) for m in (1.0, 2.0, 0.5))
    upright = Pendulum(links=links, equilibrium=("up", "down", "up"))
    other = Pendulum(links=links[:2], equilibrium=("down", "up"))
    example = scene(upright, other, cart=cart) if cart else scene(upright)
    rig = rig_of(example).natural()[0]
    carried = PartedRig(rig)
    assert structured.OnStructure(ComponentMatrices(carried, carried.all_pendula))._dense.order
    hanging = [(replace(b, sigma=np.abs(b.sigma)), p) for b in rig.blocks for p in range(b.size)]
    diagonal = np.diag(assemble_pendula(hanging, rig.cart, 1.0)[1])
    eliminated = len(diagonal) - len(handed[0])  # a free cart, which has no term
    assert not diagonal[:eliminated].any()
    np.testing.assert_allclose(handed[0], diagonal[eliminated:], rtol=1e-14)


# ----------------------------------------------------------------------------------------------------- in words


WORDS = {
    "no cart coordinate: the support is fixed": {"chain", "springs", "one damper"},
    "no cart coordinate across the rail": {"different"},
    "1 pendulum with 1000 times the masses instead of 1000": {"thousand"},
    "1 pendulum instead of 9": {"springs"},
    "no search for the free cart's own frequency": {
        "thousand",
        "different",
        "crowd",
        "few",
        "springs on a cart",
        "dashpot",
        "damped",
        "upright",
        "springs on a massless cart",
    },
    "no complex eigenproblem": ROUTES.keys() - {"one damper", "dashpot", "damped"},
    "frequencies come from the effective mass": ROUTES.keys()
    - {"one damper", "dashpot", "damped", "springs on a massless cart"},
    "no M and K of 37 × 37: 5 × 5 are the largest": {"dashpot", "damped"},
    "no damping matrix": {"springs on a massless cart"},
}


@cache
def found_in(name: str) -> SolutionReport:
    return report_solution(natural_modes(ROUTES[name][0]))


@pytest.mark.parametrize("sentence", WORDS)
def test_only_what_applies_is_said(sentence: str) -> None:
    assert {name for name in ROUTES if any(sentence in words for words in found_in(name).left_out)} == WORDS[sentence]


def test_one_plane_instead_of_two() -> None:
    flat, deep = (report_solution(natural_modes(scene(rods(3), space=space))) for space in ("plane", "space"))
    assert (flat.unknowns, flat.coordinates, deep.unknowns, deep.coordinates) == (3, 3, 3, 6)
    assert set(deep.left_out) - set(flat.left_out) >= {
        "one vertical plane instead of two: about equilibrium both are equivalent"
    }


def test_text_stays_short_and_holds_the_numbers() -> None:
    many = scene(*(rods(n, n % 3 + 1, damping=0.01) for n in range(1, 14)), space="space")
    report = report_solution(natural_modes(many))
    lines = report.text().splitlines()
    assert len(lines) <= 25
    assert max(map(len, lines)) <= 110
    assert lines[0] == f"Built: {sum(range(1, 14))} unknowns for a scene of {report.coordinates} coordinates"
    assert "        and 7 more" in lines
    crowded = found_in("crowd").text()
    assert re.search(r"matrices: .*own shapes 32×32, .*, and \d\d more\n", crowded)


def test_shapes_of_a_crowd_count_as_matrices() -> None:
    every = found_in("crowd").matrices
    assert {m.name for m in every} == {"own shapes", "seeds"}
    matrices = [matrix for matrix in every if matrix.name == "own shapes"]
    assert sum(m.number * m.order for m in matrices) == sum(p.n_links for p in LONG) - 1
    assert {m.order: m.number for m in matrices}[30] == 2


def test_record_is_json() -> None:
    report = found_in("damped")
    record = json.loads(json.dumps(report.record()))
    assert record["coordinates"] == 37
    assert record["unknowns"] == sum(part["problems"] * part["unknowns"] for part in record["parts"]) == 9
    assert {(m["name"], m["order"], m["number"]) for m in record["matrices"]} == {
        *((name, order, 1) for name in "MKD" for order in (4, 5)),
        ("state", 8, 2),
    }
    assert record["complex_problem"] is True
    assert record["modules"] == list(report.modules)


# --------------------------------------------------------------------------------------------------------- imports


def test_every_heavy_package_is_watched() -> None:
    assert set(PACKAGES) == HEAVY.keys() | {"numpy"}


@pytest.mark.parametrize("others", usually([("scipy",)], [(), ("scipy",), ("matplotlib",)]))
def test_modules_are_those_of_the_process(others: tuple[str, ...]) -> None:
    code = "import json, sys\n" + "".join(f"import {name}\n" for name in others)
    code += "from multipendula.cli import main\nmain(['table', 'chain-3'])\n"
    code += "from modal import load, natural_modes\nfrom modal.modes.solution_report import report_solution\n"
    code += "print(json.dumps(report_solution(natural_modes(load('chain-3'))).record()))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    record = json.loads(done.stdout.splitlines()[-1])
    loaded = {"numpy", *others}
    assert set(record["modules"]) == loaded
    missing = record["left_out"][-1].removeprefix("not imported: ").split(", ")
    assert set(missing) == set(PACKAGES) - loaded
