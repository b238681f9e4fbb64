"""Systems in symbols: M, K and D about any equilibrium and the equations of motion, all from the pair (A, b).

About an equilibrium with every link down (σ_i = 1) or up (σ_i = −1), in deviations of the absolute angles,

    M = [[M_tot, σ_i b_i], [σ_i b_i, σ_i σ_j A_ij]],    K = diag(k_c, g σ_i b_i) + torsion springs,

the springs being relaxed at that equilibrium.  In the plane, exactly,

    Σ_j A_ij [cos(θ_i − θ_j) θ_j'' + sin(θ_i − θ_j) θ_j'²] + b_i cos θ_i x'' + g b_i sin θ_i + joints = 0
    M_tot x'' + Σ b_i (cos θ_i θ_i'' − sin θ_i θ_i'²) + c_c x' + k_c x = 0

and in space, with the unit vectors u_i,

    u_i × [Σ_j A_ij u_j'' + b_i x'' e_x − g b_i e_z] = 0,    M_tot x'' + e_x·Σ b_i u_i'' + c_c x' + k_c x = 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import sympy as sp

from modal import pair
from modal.errors import SceneError
from modal.exact import exact, exact_links
from modal.scene import Pendulum, Scene, require, title_of
from modal.symbolic.lagrange import Coordinate, coordinate

SYMBOLIC = ("masses", "lengths", "gravity", "cart", "supports", "springs")
MOST_LINKS = 1000


class Chain(NamedTuple):
    """A pendulum's parameters in SymPy numbers or symbols, top link first, and σ = ±1 for a link down or up."""

    mass: tuple[Any, ...]
    length: tuple[Any, ...]
    centre: tuple[Any, ...]
    inertia: tuple[Any, ...]
    damping: tuple[Any, ...]
    stiffness: tuple[Any, ...]
    sigma: tuple[int, ...]

    @property
    def geometry(self) -> tuple[tuple[Any, ...], ...]:
        """Mass, length, centre and inertia, from which the pair follows."""
        return self.mass, self.length, self.centre, self.inertia


class SymbolicCart(NamedTuple):
    """Mass, damper and spring of a cart."""

    mass: Any
    damping: Any
    stiffness: Any


class OfChains:
    """The angles of the links of chains."""

    chains: tuple[Chain, ...]

    @cached_property
    def links(self) -> list[tuple[int, int]]:
        """(chain, link) of every angle, from 0."""
        return [(p, i) for p, chain in enumerate(self.chains) for i in range(len(chain.mass))]

    @cached_property
    def angles(self) -> list[Coordinate]:
        """θ_i of a single chain, θ_p,i of several."""
        several = len(self.chains) > 1
        return [coordinate("theta", *([p + 1] if several else []), i + 1) for p, i in self.links]


@dataclass(frozen=True, eq=False)
class SymbolicSystem(OfChains):
    """Chains, one for each copy, on a fixed support (`cart` None) or a cart; gravity in the same symbols."""

    title: str
    gravity: Any
    chains: tuple[Chain, ...]
    cart: SymbolicCart | None
    spatial: bool = False

    @cached_property
    def coordinates(self) -> list[Coordinate]:
        """The cart's x, if there is one, then the angles."""
        return [*([coordinate("x")] if self.cart else []), *self.angles]

    @cached_property
    def b(self) -> list[Any]:
        """First moments of all links."""
        moments = (b for chain in self.chains for b in pair.first_moments(chain.mass, chain.length, chain.centre))
        return [sp.factor(b) for b in moments]

    @cached_property
    def A(self) -> Any:
        """Second moments, block by block."""
        blocks = (sp.Matrix(pair.inertia_matrix(*chain.geometry)) for chain in self.chains)
        return sp.diag(*(block.applyfunc(sp.factor) for block in blocks))

    @cached_property
    def sigma(self) -> list[int]:
        """The direction of every link at equilibrium."""
        return [sign for chain in self.chains for sign in chain.sigma]

    @property
    def total_mass(self) -> Any:
        """Total mass of all links and the cart."""
        hanging = sum(sum(chain.mass) for chain in self.chains)
        return hanging + (self.cart.mass if self.cart else 0)

    def matrices(self) -> tuple[Any, Any, Any]:
        """M, K and D about equilibrium, over `coordinates`."""
        turned = sp.diag(*self.sigma)
        M, K = turned * self.A * turned, turned * sp.diag(*(self.gravity * b for b in self.b))
        K, D = K + self._on_joints("stiffness"), self._on_joints("damping")
        if self.cart:
            coupling = turned * sp.Matrix(self.b)
            M = sp.Matrix(sp.BlockMatrix([[sp.Matrix([[self.total_mass]]), coupling.T], [coupling, M]]))
            K, D = sp.diag(self.cart.stiffness, K), sp.diag(self.cart.damping, D)
        return M, K, D

    def _on_joints(self, name: str) -> Any:
        blocks = []
        for chain in self.chains:
            n = len(chain.mass)
            relative = sp.eye(n) - sp.Matrix(n, n, lambda i, j: int(i == j + 1))
            blocks.append(relative.T * sp.diag(*getattr(chain, name)) * relative)
        return sp.diag(*blocks)

    def equations(self) -> list[Any]:
        """Expressions that vanish in a plane motion, one for each of `coordinates`."""
        x = self.coordinates[0] if self.cart else Coordinate(0, 0, 0)
        joints = self.joint_moments()
        equations = [
            sum(
                A * (sp.cos(theta.q - other.q) * other.a + sp.sin(theta.q - other.q) * other.v**2)
                for A, other in zip(self.A.row(i), self.angles, strict=True)
            )
            + b * sp.cos(theta.q) * x.a
            + self.gravity * b * sp.sin(theta.q)
            + joints[i]
            for i, (theta, b) in enumerate(zip(self.angles, self.b, strict=True))
        ]
        if self.cart:
            pulls = zip(self.b, self.angles, strict=True)
            inertial = sum(b * (sp.cos(theta.q) * theta.a - sp.sin(theta.q) * theta.v**2) for b, theta in pulls)
            held = self.cart.damping * x.v + self.cart.stiffness * x.q
            equations.insert(0, self.total_mass * x.a + inertial + held)
        return equations

    def joint_moments(self) -> Any:
        """What the springs and dampers of joints take from each angle (N m): less the generalized forces."""
        theta, rate = (sp.Matrix([getattr(angle, part) for angle in self.angles]) for part in "qv")
        rest = sp.Matrix([0 if sign > 0 else sp.pi for sign in self.sigma])
        return self._on_joints("stiffness") * (theta - rest) + self._on_joints("damping") * rate

    def vector_equations(self) -> list[tuple[Any, Any]]:
        """(u_i, F_i) of a spatial motion, u_i × F_i = 0; on a cart (e_x, F) comes first, e_x·F = 0.

        Raises SceneError for joint springs and dampers, which are not implemented in unit vectors.
        """
        if any(any(chain.stiffness) or any(chain.damping) for chain in self.chains):
            raise SceneError(["joint springs and dampers in space: not implemented in unit vectors"])
        e_x, e_z, x = sp.Symbol("e_x"), sp.Symbol("e_z"), coordinate("x")
        u = [coordinate("u", *angle.q.name.split("_")[1:]) for angle in self.angles]
        equations = []
        if self.cart:
            moved = sum(b * direction.a for b, direction in zip(self.b, u, strict=True))
            held = self.cart.damping * x.v + self.cart.stiffness * x.q
            equations.append((e_x, e_x * (self.total_mass * x.a + held) + moved))
        for i, (direction, b) in enumerate(zip(u, self.b, strict=True)):
            F = sum(A * other.a for A, other in zip(self.A.row(i), u, strict=True)) - self.gravity * b * e_z
            equations.append((direction.q, F + (b * x.a * e_x if self.cart else 0)))
        return equations


def chain(n: int, kind: str = "bob", symbolic: tuple[str, ...] = (), sigma: tuple[int, ...] = ()) -> SymbolicSystem:
    """One chain of n bobs or rods: equal ones m, l unless `symbolic` names masses or lengths."""
    return SymbolicSystem(
        f"{n} {kind}{'s' if n > 1 else ''} in a chain", _gravity(), (_links(n, kind, symbolic, sigma),), None
    )


def cart(
    n: int, count: int = 1, kind: str = "bob", symbolic: tuple[str, ...] = (), sigma: tuple[int, ...] = ()
) -> SymbolicSystem:
    """`count` equal chains of n bobs or rods on a cart of mass m_c."""
    hanging = (_links(n, kind, symbolic, sigma),) * count
    of = f"{n} {kind}{'s' if n > 1 else ''}"
    title = f"A chain of {of} on a cart" if count == 1 else f"{count} chains of {of} each on a cart"
    return SymbolicSystem(title, _gravity(), hanging, SymbolicCart(symbol("m_c"), sp.S.Zero, sp.S.Zero))


def _links(n: int, kind: str, symbolic: tuple[str, ...], sigma: tuple[int, ...]) -> Chain:
    mass = tuple(symbol(f"m_{i}") for i in range(1, n + 1)) if "masses" in symbolic else (symbol("m"),) * n
    length = tuple(symbol(f"l_{i}") for i in range(1, n + 1)) if "lengths" in symbolic else (symbol("l"),) * n
    none = (sp.S.Zero,) * n
    centre, inertia = zip(*map(pair.proportions, (kind,) * n, mass, length), strict=True)
    return Chain(mass, length, centre, inertia, none, none, sigma or (1,) * n)


def of_scene(scene: Scene, symbolic: tuple[str, ...] = ()) -> SymbolicSystem:
    """A scene with its decimals as exact fractions, or as symbols for the quantities in `symbolic` (of SYMBOLIC).

    Copies of a pendulum share their symbols; those of several pendula begin with the number of the first copy.  Raises
    SceneError above MOST_LINKS links, and for what no derivation takes.
    """
    require(scene, "a derivation")
    if scene.n_links > MOST_LINKS:
        raise SceneError([f"the scene has {scene.n_links} links: at most {MOST_LINKS} are written in exact numbers"])
    support = None
    if (cart := scene.cart) is not None:
        mass = symbol("m_c") if "cart" in symbolic else rational(cart.mass)
        support = SymbolicCart(mass, rational(cart.damping), rational(cart.stiffness))
    gravity = _gravity() if "gravity" in symbolic else rational(scene.gravity)
    return SymbolicSystem(title_of(scene), gravity, chains_of(scene, symbolic), support, scene.space == "space")


def chains_of(scene: Scene, symbolic: tuple[str, ...]) -> tuple[Chain, ...]:
    """The chains of a scene, a pendulum's copies one after another."""
    chains: list[Chain] = []
    for pendulum in scene.pendulum:
        prefix = f"{len(chains) + 1}_" if len(scene.pendulum) > 1 else ""
        chains += [_chain_of(pendulum, prefix, symbolic)] * pendulum.count
    return tuple(chains)


def _chain_of(pendulum: Pendulum, prefix: str, symbolic: tuple[str, ...]) -> Chain:
    written = [link for link in pendulum.links for _ in range(link.count)]
    mass, length, centre, inertia, stiffness, sigma = map(list, zip(*exact_links(pendulum), strict=True))
    for i, link in enumerate(written):
        if "masses" in symbolic:
            mass[i] = symbol(f"m_{prefix}{i + 1}")
        if "lengths" in symbolic:
            length[i] = symbol(f"l_{prefix}{i + 1}")
        centre[i], inertia[i] = link.proportions(mass[i], length[i], exact)
    damping = [exact(link.damping) for link in written]
    columns = (mass, length, centre, inertia, damping, stiffness, map(int, sigma))
    return Chain(*(tuple(map(sp.sympify, values)) for values in columns))


def rational(value: float) -> Any:
    """The decimal that a float is written as, as an exact fraction."""
    return sp.Rational(exact(value))


def _gravity() -> Any:
    return symbol("g")


def symbol(name: str) -> Any:
    """A positive number by its name."""
    return sp.Symbol(name, positive=True)
