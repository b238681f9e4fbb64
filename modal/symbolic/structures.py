"""Structures in symbols: carriers, the chains that hang from them and springs between points, as energies.

With places of points from `carriers` and along each chain, r_i = r_p + Σ l (sin θ, cos θ),

    T = Σ ½ M |v|² + ½ I φ'² + Σ ½ m |r'|² + ½ I θ'²
    V = −Σ m g z + Σ (½ k η² + W η) + Σ ½ k (ℓ − ℓ₀)² + joints,    R = Σ ½ d ℓ'² + …

W is the slope of the weights along η as drawn, ∂(Σ m g z)/∂η, which the own spring carries; ℓ₀ is the length of a
spring as drawn.  Where that is 0, ½ k |Δr|² and ½ d |Δr'|² replace its terms.  Nothing here calls `modal.structure`,
neither its kinematics nor its lists of pivots and ends: it is another route from a scene to all its numbers.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import sympy as sp

from modal import pair
from modal.errors import SceneError
from modal.report import Displayed, Summary, counted
from modal.scene import ModalSupport, Scene, Spring, places_of, require, title_of
from modal.scene.points import CarrierPoint, GroundPoint, parse_point
from modal.scene.supports import Fixed, Planar
from modal.symbolic.carriers import SymbolicCarrier, Where
from modal.symbolic.lagrange import Coordinate, coordinate, time_derivative
from modal.symbolic.system import MOST_LINKS, Chain, OfChains, chains_of, rational, symbol


class OnCarrier(NamedTuple):
    """A point of a carrier by its index: where a chain hangs, or a spring ends."""

    carrier: int
    where: Where


class OnLink(NamedTuple):
    """A point of a link by its number in the file, `below` its upper joint (None: its centre of mass)."""

    link: int
    below: Any


class OnGround(NamedTuple):
    """A point (along, down) of the ground; None: where the other end is drawn."""

    place: tuple[Any, Any] | None


End = OnCarrier | OnLink | OnGround


class JoinedSpring(NamedTuple):
    """A spring between two ends, or their angles, and its numbers or symbols."""

    ends: tuple[End, End]
    torsion: bool
    stiffness: Any
    damping: Any


class SymbolicSpring(NamedTuple):
    """A spring and damper: what lies between its ends, (Δx, Δz) or one angle, its rest length, and its numbers.

    `rest` None belongs to a torsion spring, or to one of length 0 as drawn; `ell` is the symbol of its length.
    """

    number: int
    between: tuple[Any, ...]
    rest: Any
    stiffness: Any
    damping: Any
    ell: Coordinate

    @property
    def square(self) -> Any:
        """Its length squared, or the square of an angle."""
        return sp.Add(*(part**2 for part in self.between))

    @property
    def stretched(self) -> Any:
        """(ℓ − ℓ₀)², or the square itself where it is 0 as drawn."""
        return self.square if self.rest is None else (self.ell.q - self.rest) ** 2


class Energy(NamedTuple):
    """The kinetic and the potential energy of one part of a structure, by its name."""

    words: str
    T: Any
    V: Any


@dataclass(frozen=True, eq=False, repr=False)
class SymbolicStructure(Displayed, OfChains):
    """Carriers, chains with the points that they hang from, and springs with their two ends; a plane system."""

    title: str
    gravity: Any
    carriers: tuple[SymbolicCarrier, ...]
    chains: tuple[Chain, ...]
    hung: tuple[OnCarrier, ...]
    joined: tuple[JoinedSpring, ...]
    spatial = False
    cart = None

    def _summary(self) -> Summary:
        count = counted(len(self.coordinates), "coordinate", "coordinates")
        supports = ", ".join(f"{carrier.name} ({carrier.kind})" for carrier in self.carriers)
        facts = [("supports", supports), ("pendula", str(len(self.chains))), ("springs", str(len(self.joined)))]
        return Summary(f"{self.title}, {count} in symbols", facts)

    # -------------------------------------------------------------------------------------------------- coordinates

    @cached_property
    def coordinates(self) -> list[Coordinate]:
        """η of all carriers, then the angles."""
        return [*(c for carrier in self.carriers for c in carrier.coordinates), *self.angles]

    @cached_property
    def rest(self) -> dict[Any, Any]:
        """Every coordinate as drawn."""
        sigma = [sign for chain in self.chains for sign in chain.sigma]
        upright = {angle.q: sp.pi for angle, sign in zip(self.angles, sigma, strict=True) if sign < 0}
        return {c.q: upright.get(c.q, sp.S.Zero) for c in self.coordinates}

    @cached_property
    def symbols(self) -> set[Any]:
        """The symbols of its numbers."""
        values = [self.gravity, *(v for chain in self.chains for row in chain for v in row)]
        values += [v for carrier in self.carriers for v in carrier.symbols()]
        values += [v for spring in self.springs for v in (spring.stiffness, spring.damping)]
        return {name for value in values for name in sp.sympify(value).free_symbols}

    def _of_chain(self, p: int) -> list[Coordinate]:
        return [angle for angle, (chain, _) in zip(self.angles, self.links, strict=True) if chain == p]

    # ------------------------------------------------------------------------------------------------------- places

    @cached_property
    def pivots(self) -> list[tuple[Any, Any]]:
        """(along, down) of every first joint."""
        return [self.carriers[hung.carrier].place(hung.where) for hung in self.hung]

    def on_link(self, number: int, below: Any) -> tuple[Any, Any]:
        """A point `below` the upper joint of a link by its number in the file; None is its centre of mass."""
        p, i = self.links[number]
        x, z = self.pivots[p]
        reach = [*self.chains[p].length[:i], self.chains[p].centre[i] if below is None else below]
        for arm, angle in zip(reach, self._of_chain(p), strict=False):
            x, z = x + arm * sp.sin(angle.q), z + arm * sp.cos(angle.q)
        return x, z

    def masses(self) -> Iterator[tuple[Any, tuple[Any, Any]]]:
        """Every mass that gravity pulls, and its place."""
        yield from ((c.mass, c.place(c.centre)) for c in self.carriers if c.mass != 0)
        for number, (p, i) in enumerate(self.links):
            yield self.chains[p].mass[i], self.on_link(number, None)

    def _end(self, end: End, other: End) -> tuple[Any, Any]:
        if isinstance(end, OnLink):
            return self.on_link(*end)
        if isinstance(end, OnCarrier):
            return self.carriers[end.carrier].place(end.where)
        return self._drawn(self._end(other, end)) if end.place is None else end.place

    def _turned(self, end: End) -> Any:
        """The angle at one end of a torsion spring; the ground, and what does not turn, has 0."""
        if isinstance(end, OnLink):
            return self.angles[end.link].q
        angle = self.carriers[end.carrier].angle if isinstance(end, OnCarrier) else None
        return sp.S.Zero if angle is None else angle.q

    def _drawn(self, place: tuple[Any, Any]) -> tuple[Any, Any]:
        along, down = (sp.sympify(part).subs(self.rest) for part in place)
        return along, down

    @cached_property
    def springs(self) -> list[SymbolicSpring]:
        """All springs in the order of the file, those of copies one after another."""
        return [self._spring(number, joined) for number, joined in enumerate(self.joined)]

    def _spring(self, number: int, joined: JoinedSpring) -> SymbolicSpring:
        a, b = joined.ends
        ell, strength = coordinate("ell", number + 1), (joined.stiffness, joined.damping)
        if joined.torsion:
            return SymbolicSpring(number, (self._turned(b) - self._turned(a),), None, *strength, ell)
        between = tuple(far - near for near, far in zip(self._end(a, b), self._end(b, a), strict=True))
        drawn = sp.sqrt(sp.Add(*(sp.sympify(part).subs(self.rest) ** 2 for part in between)))
        return SymbolicSpring(number, between, None if drawn == 0 else sp.simplify(drawn), *strength, ell)

    # ----------------------------------------------------------------------------------------------------- energies

    @cached_property
    def carried(self) -> list[Any]:
        """W (N or N m) of every carrier's coordinates that a spring holds as drawn, and 0 of the others."""
        held = [holds for carrier in self.carriers for holds in carrier.carries]
        weights = [(m * self.gravity, place[1]) for m, place in self.masses()]
        return [
            sp.Add(*(w * sp.diff(z, c.q).subs(self.rest) for w, z in weights)) if holds else sp.S.Zero
            for c, holds in zip(self.coordinates, held, strict=False)
        ]

    @cached_property
    def parts(self) -> list[Energy]:
        """The energies of every carrier and chain; weights count from the drawn origin of the carrier."""
        carried, parts = iter(self.carried), []
        for carrier in self.carriers:
            q = sp.Matrix([c.q for c in carrier.coordinates])
            if q:
                V = (q.T * carrier.stiffness * q)[0] / 2 + sp.Add(*(next(carried) * value for value in q))
                V -= carrier.mass * self.gravity * (carrier.place(carrier.centre)[1] - carrier.position[1])
                parts.append(Energy(carrier.name, carrier.kinetic, sp.expand(V)))
        return parts + [self._of_pendulum(p) for p in range(len(self.chains))]

    @cached_property
    def stored(self) -> list[Energy]:
        """The energies of the springs between points, the length of a stretched one by its symbol ℓ."""
        return [
            Energy(f"spring {spring.number + 1}", sp.S.Zero, spring.stiffness * spring.stretched / 2)
            for spring in self.springs
        ]

    def _of_pendulum(self, p: int) -> Energy:
        """T = ½ m v_p² + Σ b_i v_p·n_i θ_i' + ½ Σ A_ij cos(θ_i − θ_j) θ_i'θ_j' of the pair (A, b), and V."""
        chain, hung, angles = self.chains[p], self.hung[p], self._of_chain(p)
        carrier, total = self.carriers[hung.carrier], sp.Add(*chain.mass)
        b = [sp.factor(moment) for moment in pair.first_moments(chain.mass, chain.length, chain.centre)]
        A = sp.Matrix(pair.inertia_matrix(*chain.geometry)).applyfunc(sp.factor)
        T = total * carrier.speed_squared(hung.where) / 2
        V = -total * self.gravity * (self.pivots[p][1] - carrier.position[1])
        for i, angle in enumerate(angles):
            T += b[i] * carrier.speed_across(hung.where, angle.q) * angle.v + A[i, i] * angle.v**2 / 2
            T += sp.Add(*(A[i, j] * sp.cos(angle.q - angles[j].q) * angle.v * angles[j].v for j in range(i)))
            V -= self.gravity * b[i] * sp.cos(angle.q)
        V += sp.Add(*(k * gamma**2 / 2 for k, gamma in zip(chain.stiffness, self.joints(p), strict=True)))
        where = f" on {carrier.name}" if carrier.coordinates else ""
        return Energy(f"pendulum {p + 1}{where}", sp.expand(T), V)

    def joints(self, p: int, part: str = "q") -> list[Any]:
        """The angles at the joints of a chain from rest, or their rates (`part` v): the first from its carrier."""
        above = self.carriers[self.hung[p].carrier].angle
        upper, relative = getattr(above, part) if above is not None else sp.S.Zero, []
        for angle, sign in zip(self._of_chain(p), self.chains[p].sigma, strict=True):
            value = getattr(angle, part)
            straight = value - (sp.pi if sign < 0 and part == "q" else 0)
            relative.append(straight - upper)
            upper = straight
        return relative

    @cached_property
    def dissipation(self) -> Any:
        """R = ½ η'ᵀ D η' of all carriers + Σ ½ d (rate)² of joints and springs; of a stretched one by the symbol ℓ'."""
        return sp.Add(*self._lost())

    def _lost(self) -> Iterator[Any]:
        for carrier in self.carriers:
            v = sp.Matrix([c.v for c in carrier.coordinates])
            yield sp.expand((v.T * carrier.damping * v)[0]) / 2 if v else sp.S.Zero
        for p, chain in enumerate(self.chains):
            yield from (d * rate**2 / 2 for d, rate in zip(chain.damping, self.joints(p, "v"), strict=True))
        for spring in self.springs:
            rates = [self.rate(part) for part in spring.between] if spring.rest is None else [spring.ell.v]
            yield from (spring.damping * rate**2 / 2 for rate in rates)

    def rate(self, value: Any) -> Any:
        """d/dt of a function of the coordinates."""
        return time_derivative(value, self._among(value))

    def _among(self, value: Any) -> list[Coordinate]:
        """The coordinates that a function has."""
        names = sp.sympify(value).free_symbols
        return [c for c in self.coordinates if names & {c.q, c.v}]

    def cartesian(self) -> Any:
        """T from the rates of all places."""
        turning = [(self.chains[p].inertia[i], angle.v) for (p, i), angle in zip(self.links, self.angles, strict=True)]
        turning += [(c.inertia, c.angle.v) for c in self.carriers if c.angle is not None]
        T = sp.Add(*(m * self.rate(part) ** 2 / 2 for m, place in self.masses() for part in place))
        T += sp.Add(*(c.kinetic for c in self.carriers if c.masses is not None))
        return T + sp.Add(*(I * rate**2 / 2 for I, rate in turning))

    # ---------------------------------------------------------------------------------------------------- equations

    def equations(self) -> list[Any]:
        """Expressions that vanish in motion, one for each coordinate: Lagrange's, part by part.

        A stretched spring pulls with its force F, the symbol that `force_of` explains: F ∂ℓ/∂q, ∂ℓ/∂q = Δr·∂Δr/∂q/ℓ.
        """
        rows = dict.fromkeys((c.q for c in self.coordinates), sp.S.Zero)
        for part in (*self.parts, *self.stored):
            here = self._among(part.T + part.V)
            for c in here:
                inertial = time_derivative(sp.diff(part.T, c.v), here) - sp.diff(part.T, c.q)
                rows[c.q] += sp.expand(inertial) + sp.diff(part.V, c.q)
        for lost in self._lost():
            for c in self._among(lost):
                rows[c.q] += sp.diff(lost, c.v)
        for spring in self.springs:
            if spring.rest is not None:
                for c in self._among(spring.square):
                    along = sp.Add(*(part * sp.diff(part, c.q) for part in spring.between))
                    rows[c.q] += force_symbol(spring) * along / spring.ell.q
        return [rows[c.q] for c in self.coordinates]

    def written_out(self, form: Any) -> Any:
        """An equation with the forces and the lengths of springs in the coordinates."""
        for spring in self.springs:
            if spring.rest is not None:
                ell = sp.sqrt(spring.square)
                form = form.subs(force_symbol(spring), force_of(spring)).subs(spring.ell.v, self.rate(ell))
                form = form.subs(spring.ell.q, ell)
        return form

    def matrices(self) -> tuple[Any, Any, Any]:
        """M, K and D about the drawn rest, over `coordinates`."""
        n = len(self.coordinates)
        M, K, D = (sp.zeros(n, n) for _ in range(3))
        self._inertial(M)
        for part in (*self.parts, *self.stored):
            self._curved(K, part.V)
        for spring in self.springs:
            if spring.rest is not None:
                ell = self._slopes(sp.sqrt(spring.square))
                self._added(K, spring.stiffness, ell)
                self._added(D, spring.damping, ell)
        for lost in self._lost():
            self._curved(D, lost, "v")
        return (M, K, D) if not self.symbols else tuple(A.applyfunc(sp.factor) for A in (M, K, D))

    def _inertial(self, M: Any) -> None:
        for m, place in self.masses():
            for part in place:
                self._added(M, m, self._slopes(part))
        at = 0
        for carrier in self.carriers:
            d = len(carrier.coordinates)
            if carrier.masses is not None:
                M[at : at + d, at : at + d] += carrier.masses
            elif carrier.angle is not None:
                M[at + d - 1, at + d - 1] += carrier.inertia
            at += d
        for i, (p, link) in enumerate(self.links):
            M[at + i, at + i] += self.chains[p].inertia[link]

    def _numbered(self, value: Any) -> list[tuple[int, Coordinate]]:
        among = {c.q for c in self._among(value)}
        return [(i, c) for i, c in enumerate(self.coordinates) if c.q in among]

    def _slopes(self, value: Any) -> dict[int, Any]:
        """∂/∂q at rest."""
        return {i: sp.diff(value, c.q).subs(self.rest) for i, c in self._numbered(value)}

    def _added(self, A: Any, weight: Any, slopes: dict[int, Any]) -> None:
        for i, a in slopes.items():
            for j, b in slopes.items():
                A[i, j] += weight * a * b

    def _curved(self, A: Any, f: Any, by: str = "q") -> None:
        """Second derivatives of a function at rest, by the coordinates or by their rates."""
        numbered = self._numbered(f)
        for i, c in numbered:
            slope = sp.diff(f, getattr(c, by))
            for j, other in numbered:
                A[i, j] += sp.diff(slope, getattr(other, by)).subs(self.rest)

    @cached_property
    def conditions(self) -> dict[Any, Any]:
        """What symbols must make zero for an equilibrium as drawn: ∂V/∂q by coordinate."""
        slopes = {
            c.q: sp.factor(sp.Add(*(sp.diff(part.V, c.q).subs(self.rest) for part in self.parts)))
            for c in (self.coordinates if self.symbols else ())
        }
        return {q: slope for q, slope in slopes.items() if slope.free_symbols}


def force_symbol(spring: SymbolicSpring) -> Any:
    """F of a spring, positive where it pulls."""
    return sp.Symbol(f"F_{spring.number + 1}")


def force_of(spring: SymbolicSpring) -> Any:
    """The pull k (ℓ − ℓ₀) + d ℓ'."""
    return spring.stiffness * (spring.ell.q - spring.rest) + spring.damping * spring.ell.v


def _rationals(values: Sequence[Any]) -> tuple[Any, Any]:
    along, below = map(rational, values)
    return along, below


# --------------------------------------------------------------------------------------------------- from a scene


def of_structured(scene: Scene, symbolic: tuple[str, ...] = ()) -> SymbolicStructure:
    """A structured scene with its decimals as exact fractions, or as symbols for the quantities in `symbolic`.

    Raises SceneError above MOST_LINKS links, and for what no derivation takes.
    """
    require(scene, "a derivation")
    if scene.n_links > MOST_LINKS:
        raise SceneError([f"the scene has {scene.n_links} links: at most {MOST_LINKS} are written in exact numbers"])
    gravity = symbol("g") if "gravity" in symbolic else rational(scene.gravity)
    alone = [support.kind for support in scene.supports] == ["cart"]
    named = zip(scene.supports, scene.support_names, strict=True)
    carriers = tuple(_carrier(support, name, () if alone else (name,), symbolic) for support, name in named)
    hung = tuple(_hung(scene, pendulum) for pendulum in scene.pendulum for _ in range(pendulum.count))
    joined = tuple(
        joined for entry, spring in enumerate(scene.spring) for joined in _joined(scene, entry, spring, symbolic)
    )
    return SymbolicStructure(title_of(scene), gravity, carriers, chains_of(scene, symbolic), hung, joined)


def _carrier(support: Any, name: str, index: tuple[str, ...], symbolic: tuple[str, ...]) -> SymbolicCarrier:
    position = _rationals(support.position)
    if isinstance(support, Fixed):
        return SymbolicCarrier("fixed", name, index, position, sp.zeros(0), sp.zeros(0), ())
    if isinstance(support, ModalSupport):
        M, K, D = (_matrix(rows, len(support.M or ())) for rows in (support.M, support.K, support.D))
        points = tuple(tuple(tuple(map(rational, row)) for row in point) for point in support.points or ())
        return SymbolicCarrier("modal", name, index, position, K, D, (True,) * M.rows, masses=M, points=points)

    def number(letter: str, value: float, *way: str) -> Any:
        kept = "supports" in symbolic or ("cart" in symbolic and (support.kind, letter) == ("cart", "m"))
        return symbol("_".join((letter, name, *way))) if value and kept else rational(value)

    def diagonal(letter: str, values: float | Planar) -> Any:
        if isinstance(values, Planar):
            return sp.diag(*(number(letter, value, way) for way, value in values))
        return sp.diag(number(letter, values))

    stiffness, damping = diagonal("k", support.stiffness), diagonal("d", support.damping)
    return SymbolicCarrier(
        support.kind,
        name,
        index,
        position,
        stiffness,
        damping,
        tuple(k != 0 for k in stiffness.diagonal()),
        number("m", support.mass),
        number("I", getattr(support, "inertia", 0.0)),
        number("L", getattr(support, "length", 0.0)),
        _rationals(getattr(support, "centre", (0.0, 0.0))),
    )


def _matrix(rows: Any, size: int) -> Any:
    return sp.zeros(size, size) if rows is None else sp.Matrix([list(map(rational, row)) for row in rows])


def _hung(scene: Scene, pendulum: Any) -> OnCarrier:
    point = None if pendulum.on is None else parse_point(pendulum.on)
    if not isinstance(point, CarrierPoint):
        return OnCarrier(0, _rationals(pendulum.position))
    where = _rationals(pendulum.position) if point.point is None else point.point
    return OnCarrier(scene.support_names.index(point.name), where)


def _joined(scene: Scene, entry: int, spring: Spring, symbolic: tuple[str, ...]) -> Iterator[JoinedSpring]:
    """The springs that one entry means: one, or one of every copy."""
    numbers = [
        symbol(f"{letter}_{entry + 1}") if value and "springs" in symbolic else rational(value)
        for letter, value in (("k", spring.stiffness), ("d", spring.damping))
    ]
    starts, stops = (list(_ends(scene, text)) for text in spring.between)
    count = max(len(starts), len(stops))
    for a, b in zip(*(ends * count if len(ends) == 1 else ends for ends in (starts, stops)), strict=True):
        yield JoinedSpring((a, b), spring.kind == "torsion", *numbers)


def _ends(scene: Scene, text: str) -> Iterator[End]:
    point = parse_point(text)
    if isinstance(point, GroundPoint):
        yield OnGround(None if point.place is None else _rationals(point.place))
    elif isinstance(point, CarrierPoint):
        where = _rationals(point.place) if point.point is None else point.point
        yield OnCarrier(scene.support_names.index(point.name), where)
    elif point is None:
        yield OnCarrier(scene.support_names.index("cart"), (sp.S.Zero, sp.S.Zero))
    else:
        for place in places_of(scene, text):
            yield OnLink(place.link, None if place.below is None else rational(place.below))
