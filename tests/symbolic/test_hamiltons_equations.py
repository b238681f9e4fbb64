"""Hamilton's equations in symbols are the numbers of the recursion, with neighbours alone for bobs."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from scenes import decimal_scene, spatial_scene
from test_cli import printed, refused

from modal import Bob, Cart, Pendulum, Scene, load
from modal.symbolic import derive, plain, symbolic_structure
from modal.symbolic.derivation import chain
from modal.symbolic.hamiltonian import (
    along_equations,
    inverse,
    lengthwise_symbols,
    momentum,
    momentum_rates,
    numbers,
    velocities,
)
from nonlinear.dynamics import Hamiltonian
from nonlinear.system import system_of


@pytest.mark.parametrize("seed", range(1, 6))
def test_in_the_plane_they_are_the_recursions(seed: int) -> None:
    """Rods, bodies, springs, dampers, standing links: s from its linear equations, then q' and p'."""
    scene = decimal_scene(seed)
    system, equations, rng = symbolic_structure(scene), Hamiltonian(system_of(scene)), np.random.default_rng(seed)
    half = equations.layout.half
    y = np.concatenate((rng.uniform(-2, 2, half), rng.normal(size=half)))
    theirs = equations.derivative(0.0, np.append(y, [0.0] * (equations.layout.size - 2 * half)))[: 2 * half]
    W, s, p = inverse(system), lengthwise_symbols(system), [momentum(c) for c in system.coordinates]
    assert W is not None
    put = dict(zip((c.q for c in (*system.coordinates, *p)), y.tolist(), strict=True))
    A, right = sp.linear_eq_to_matrix([form.subs(put) for form in along_equations(system, W, p, s)], s)
    put |= dict(zip(s, np.linalg.solve(*(np.array(part, dtype=float) for part in (A, right))).ravel(), strict=True))
    v = [float(form.subs(put)) for form in velocities(system, W, p, s)]
    put |= dict(zip((c.v for c in system.coordinates), v, strict=True))
    slopes = [float(form.subs(put)) for form in momentum_rates(system, s)]
    np.testing.assert_allclose([*v, *slopes], theirs, rtol=0, atol=1e-10 * np.abs(theirs).max())


@pytest.mark.parametrize("seed", range(4))
def test_in_space_they_are_the_recursions(seed: int) -> None:
    """u' = W P along each link with P = π + s u, and π' as printed."""
    scene = spatial_scene(seed)
    links = [[link.replace(damping=0.0, stiffness=0.0) for link in pendulum.links] for pendulum in scene.pendulum]
    pendula = tuple(
        pendulum.replace(links=tuple(chain), count=1) for pendulum, chain in zip(scene.pendulum, links, strict=True)
    )
    scene = scene.replace(pendulum=pendula)
    equations, rng = Hamiltonian(system_of(scene)), np.random.default_rng(seed)
    half, first, count = equations.layout.half, equations.layout.first, equations.system.n_links
    u, pi = rng.normal(size=(2, count, 3))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    pi -= np.sum(u * pi, axis=1, keepdims=True) * u
    x, p_x = rng.normal(size=2)
    y = np.concatenate(([x] * first, u.ravel(), [p_x] * first, pi.ravel(), [0.0] * (equations.layout.size - 2 * half)))
    theirs = equations.derivative(0.0, y)
    W = np.array(np.linalg.inv(np.array(numbers(symbolic_structure(scene)), dtype=float)))
    moved = [np.array([p_x, 0, 0])] * first
    across = [np.eye(3)[1:]] * first + [direction[None] for direction in u]  # directions in which nothing moves
    free = np.array([*moved, *pi])
    rows = [(k, axis) for k, axes in enumerate(across) for axis in axes]
    A = np.array([[W[i, j] * (a @ b) for j, b in rows] for i, a in rows])
    s = np.linalg.solve(A, [-(W[i] @ free) @ a for i, a in rows])
    for (k, axis), part in zip(rows, s, strict=True):
        free[k] = free[k] + part * axis
    v = W @ free
    multipliers, w = s[len(s) - count :, None], v[first:]
    b = np.array([float(value) for value in symbolic_structure(scene).b])
    F = np.outer(scene.gravity * b, [0, 0, 1])
    slopes = F - np.sum(u * F, axis=1, keepdims=True) * u - multipliers * w - np.sum(w * pi, axis=1, keepdims=True) * u
    held = [-scene.support.stiffness * x - scene.support.damping * v[0, 0]] if isinstance(scene.support, Cart) else []
    expected = np.concatenate((v[:first, 0], w.ravel(), held, slopes.ravel()))
    np.testing.assert_allclose(theirs[: 2 * half], expected, rtol=0, atol=1e-11 * np.abs(expected).max())


def test_bobs_have_neighbours_alone_and_rods_have_not() -> None:
    """Paper 001's "only the nearest neighbours", for n masses: true of the inverse, with masses and lengths unequal."""
    bobs, rods = inverse(chain(4, "bob", ("masses", "lengths"))), inverse(chain(4, "rod"))
    assert all((bobs[i, j] == 0) == (abs(i - j) > 1) for i in range(4) for j in range(4))
    assert all(rods)
    assert inverse(chain(5, "rod", ("masses", "lengths"))) is None
    assert sp.simplify(bobs * numbers(chain(4, "bob", ("masses", "lengths")))) == sp.eye(4)


def test_one_and_two_bobs_are_those_of_textbooks() -> None:
    (section,) = derive(chain(2, "bob", ("masses", "lengths")), ("hamiltonian",))
    whole = next(line.formula for line in section.lines if line.words == "written out")
    m1, m2, l1, l2 = sp.symbols("m_1 m_2 l_1 l_2", positive=True)
    p1, p2, a, b, V = sp.symbols("p_1 p_2 theta_1 theta_2 V")
    top = m2 * l2**2 * p1**2 + (m1 + m2) * l1**2 * p2**2 - 2 * m2 * l1 * l2 * p1 * p2 * sp.cos(a - b)
    textbook = top / (2 * m2 * l1**2 * l2**2 * (m1 + m2 * sp.sin(a - b) ** 2)) + V
    assert sp.simplify(whole.rhs - textbook) == 0
    assert any("checked term by term" in line.words for line in section.lines)


def test_a_structure_has_momenta_too() -> None:
    (section,) = derive(symbolic_structure(load("two-bobs")), ("hamiltonian",))
    text = "\n".join(plain(line.formula) for line in section.lines if line.formula is not None)
    assert "p2' =" in text


def test_what_has_no_inverse_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    scene = Scene(gravity=9.81, support=Cart(mass=0.0), pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0)])])
    (section,) = derive(symbolic_structure(scene), ("hamiltonian",))
    assert "no inverse" in section.lines[-1].words
    latex = printed(capsys, "derive", "cart:2", "--show", "hamiltonian", "--format", "latex")
    assert latex.isascii()
    assert latex.count("{") == latex.count("}")
    assert "hamiltonian" in refused(capsys, 2, "derive", "chain:2", "--show", "hamilton")
