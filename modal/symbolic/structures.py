"""Structures in symbols: energies of supports, their chains and springs between points.

With places of points from `carriers` and along each chain, r_i = r_p + Σ l (sin θ, cos θ),

    T = Σ ½ M |v|² + ½ I φ'² + Σ ½ m |r'|² + ½ I θ'²
    V = −Σ m g z + Σ (½ k η² + W η) + Σ ½ k (ℓ − ℓ₀)² + joints,    R = Σ ½ d ℓ'² + …

W is the slope of the weights along η as drawn, ∂(Σ m g z)/∂η, which the own spring carries; ℓ₀ is the length of a
spring as drawn.  Where that is 0, ½ k |Δr|² and ½ d |Δr'|² replace its terms.  A law of a joint adds

    V = −∫ τ(γ, 0) dγ,    R = −∫ [τ(γ, γ') − τ(γ, 0)] dγ'

Nothing here calls `modal.structure`: it is another route from where chains hang and springs end to all numbers of a
scene.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import sympy as sp

from modal import pair
from modal.errors import SceneError
from modal.exact import exact
from modal.extend.registry import call
from modal.report import Displayed, Summary, counted
from modal.scene.laws import JointPart
from modal.scene.points import CarrierEnd, End, LinkEnd
from modal.symbolic.carriers import Chain, Coordinate, SymbolicCarrier, coordinate, time_derivative
from modal.symbolic.papers import equal
from modal.symbolic.typesetting import in_display

ANGLE, RATE = sp.symbols("gamma gammadot", real=True)


def potential_of(part: JointPart, angle: Any) -> Any:
    """The energy V of a law at an angle, as it says itself or from its torque at rest.

    >>> from modal.extend.laws import SpringLaw
    >>> from modal.scene.laws import part_of
    >>> potential_of(part_of(SpringLaw)(stiffness=3.0), sp.Symbol("theta"))
    3*theta**2/2
    """
    law, numbers = part.law, _numbers(part)
    if law.has_potential:
        return sp.sympify(call(law, "potential", ANGLE, numbers)).subs(ANGLE, angle)
    return -_integral(part, call(law, "torque", ANGLE, sp.S.Zero, numbers), ANGLE).subs(ANGLE, angle)


def dissipation_of(part: JointPart, angle: Any, rate: Any) -> Any:
    """The function R of a law at an angle and a rate.

    >>> from modal.extend.laws import DamperLaw
    >>> from modal.scene.laws import part_of
    >>> dissipation_of(part_of(DamperLaw)(damping=3.0), sp.S.Zero, sp.Symbol("omega"))
    3*omega**2/2
    """
    torque = (call(part.law, "torque", ANGLE, speed, _numbers(part)) for speed in (RATE, sp.S.Zero))
    total, elastic = torque
    return -_integral(part, sp.expand(total - elastic), RATE).subs({ANGLE: angle, RATE: rate}, simultaneous=True)


def _numbers(part: JointPart) -> dict[str, Any]:
    return {name: sp.Rational(exact(value)) for name, value in part.numbers.items()}


def _integral(part: JointPart, torque: Any, by: Any) -> Any:
    """The integral from 0; raise SceneError if SymPy finds none."""
    integral = sp.integrate(sp.sympify(torque), by)
    if integral.has(sp.Integral):
        raise SceneError([f"law {part.law.name}: SymPy finds no integral of its torque: give it a potential"])
    return integral - integral.subs(by, 0)


Place = tuple[Any, ...]
"""Along the rail and down; in space also across."""


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
    def elongation_square(self) -> Any:
        """(ℓ − ℓ₀)², or the square itself where it is 0 as drawn."""
        return self.square if self.rest is None else (self.ell.q - self.rest) ** 2


class Energy(NamedTuple):
    """The kinetic and the potential energy of one part of a structure, by its name."""

    words: str
    T: Any
    V: Any


@dataclass(frozen=True, eq=False, repr=False)
class SymbolicStructure(Displayed):
    """Carriers, chains with the points that they hang from, and springs with their two ends.

    In space, of one support alone, `coordinates` are those along the rail and `azimuths` what is more.  `laws` are
    those of every joint, chain by chain, empty without any; `values` the numbers of its symbols in the file.
    """

    title: str
    gravity: Any
    carriers: tuple[SymbolicCarrier, ...]
    chains: tuple[Chain, ...]
    pivot_ends: tuple[CarrierEnd, ...]
    spring_entries: tuple[JoinedSpring, ...] = ()
    spatial: bool = False
    laws: tuple[tuple[tuple[JointPart, ...], ...], ...] = ()
    values: Mapping[Any, Any] = field(default_factory=dict)

    @property
    def without_laws(self) -> SymbolicStructure:
        """The same without the joint laws: all that has two routes to compare."""
        return replace(self, laws=()) if self.laws else self

    def _summary(self) -> Summary:
        count = counted(len(self.coordinates), "coordinate", "coordinates")
        supports = ", ".join(f"{carrier.name} ({carrier.kind})" for carrier in self.carriers)
        facts = [("supports", supports), ("pendula", str(len(self.chains))), ("springs", str(len(self.spring_entries)))]
        return Summary(f"{self.title}, {count} in symbols", facts)

    def _repr_latex_(self) -> str:
        """M, K and D of the linearized motion."""
        names = [(name, part) for name, part in zip("MKD", self.matrices(), strict=True) if name != "D" or any(part)]
        return "\n".join(in_display(equal(sp.Symbol(name), part)) for name, part in names)

    # -------------------------------------------------------------------------------------------------- coordinates

    @cached_property
    def links(self) -> list[tuple[int, int]]:
        """(chain, link) of every angle, from 0."""
        return [(p, i) for p, chain in enumerate(self.chains) for i in range(len(chain.mass))]

    @cached_property
    def angles(self) -> list[Coordinate]:
        """θ of a single link, θ_i of a single chain, θ_p of several of one link each, θ_p,i of others."""
        has_numbers = len(self.chains) > 1, len(self.links) > len(self.chains)
        return [
            coordinate("theta", *(k + 1 for k, is_numbered in zip(link, has_numbers, strict=True) if is_numbered))
            for link in self.links
        ]

    @cached_property
    def azimuths(self) -> list[Coordinate]:
        """φ of every link in space, numbered like θ."""
        return [coordinate("phi", *indices(angle)) for angle in self.angles if self.spatial]

    @cached_property
    def coordinates(self) -> list[Coordinate]:
        """η of all supports, then the angles."""
        return [*(c for carrier in self.carriers for c in carrier.coordinates), *self.angles]

    @cached_property
    def sigma(self) -> list[int]:
        """The direction of every link at equilibrium."""
        return [sign for chain in self.chains for sign in chain.sigma]

    @cached_property
    def rest(self) -> dict[Any, Any]:
        """Every coordinate as drawn."""
        upright = {angle.q: sp.pi for angle, sign in zip(self.angles, self.sigma, strict=True) if sign < 0}
        return {c.q: upright.get(c.q, sp.S.Zero) for c in self.coordinates}

    @cached_property
    def symbols(self) -> set[Any]:
        """The symbols of its numbers."""
        values = [self.gravity, *(v for chain in self.chains for row in chain for v in row)]
        values += [v for carrier in self.carriers for v in carrier.symbols()]
        values += [v for spring in self.springs for v in (*spring.between, spring.stiffness, spring.damping)]
        names = {name for value in values for name in sp.sympify(value).free_symbols}
        return names - {c.q for c in self.coordinates}

    def _of_chain(self, p: int) -> list[Coordinate]:
        return [angle for angle, (chain, _) in zip(self.angles, self.links, strict=True) if chain == p]

    # ----------------------------------------------------------------------------------------------------- the pair

    @property
    def is_of_pair(self) -> bool:
        """Whether A and b describe the whole system: a fixed support or a cart, with joints only."""
        return not self.spring_entries and [carrier.kind for carrier in self.carriers] in (["fixed"], ["cart"])

    @property
    def has_joint_forces(self) -> bool:
        """Whether there is a rotor, a spring, a damper or a law at a joint."""
        joints = (row for chain in self.chains for row in (chain.rotor, chain.stiffness, chain.damping))
        return any(map(any, joints)) or bool(self.laws)

    @cached_property
    def b(self) -> list[Any]:
        """First moments of all links."""
        moments = (b for chain in self.chains for b in pair.first_moments(chain.mass, chain.length, chain.centre))
        return [sp.factor(b) for b in moments]

    @cached_property
    def A(self) -> Any:
        """Second moments, block by block."""
        blocks = (sp.Matrix(pair.inertia_matrix(*chain.geometry)) for chain in self.chains)
        return sp.diag(*(_symmetric(block, sp.factor) for block in blocks))

    @property
    def total_mass(self) -> Any:
        """Total mass of all links and supports."""
        return sum(sum(chain.mass) for chain in self.chains) + sum(carrier.mass for carrier in self.carriers)

    # ------------------------------------------------------------------------------------------------------- places

    @cached_property
    def pivots(self) -> list[tuple[Any, Any]]:
        """(along, down) of every first joint."""
        return [self.carriers[end.carrier].place(end.where) for end in self.pivot_ends]

    @cached_property
    def directions(self) -> list[Place]:
        """The unit vector along every link."""
        sines = [(sp.sin(angle.q), sp.cos(angle.q)) for angle in self.angles]
        if not self.spatial:
            return list(sines)
        azimuth_parts = [(sp.cos(azimuth.q), sp.sin(azimuth.q)) for azimuth in self.azimuths]
        return [(s * x_part, c, s * y_part) for (s, c), (x_part, y_part) in zip(sines, azimuth_parts, strict=True)]

    def on_link(self, number: int, distance: Any) -> Place:
        """A point `distance` the upper joint of a link by its number in the file; None is its centre of mass."""
        p, i = self.links[number]
        place = (*self.pivots[p], *([sp.S.Zero] * self.spatial))
        reach = [*self.chains[p].length[:i], self.chains[p].centre[i] if distance is None else distance]
        for arm, direction in zip(reach, self.directions[number - i : number + 1], strict=True):
            place = tuple(part + arm * component for part, component in zip(place, direction, strict=True))
        return place

    def masses(self) -> Iterator[tuple[Any, Place]]:
        """Every mass that gravity pulls, and its place."""
        yield from ((c.mass, c.place(c.centre)) for c in self.carriers if c.mass != 0)
        for number, (p, i) in enumerate(self.links):
            yield self.chains[p].mass[i], self.on_link(number, None)

    def _end(self, end: End, other_end: End) -> Place:
        if isinstance(end, LinkEnd):
            return self.on_link(*end)
        if isinstance(end, CarrierEnd):
            return self.carriers[end.carrier].place(end.where)
        return self._at_rest(self._end(other_end, end)) if end.place is None else end.place

    def _angle_at(self, end: End) -> Any:
        """The angle at one end of a torsion spring; the ground, and what does not turn, has 0."""
        if isinstance(end, LinkEnd):
            return self.angles[end.link].q
        angle = self.carriers[end.carrier].angle if isinstance(end, CarrierEnd) else None
        return sp.S.Zero if angle is None else angle.q

    def _at_rest(self, place: Place) -> Place:
        return tuple(sp.sympify(part).subs(self.rest) for part in place)

    @cached_property
    def springs(self) -> list[SymbolicSpring]:
        """All springs in the order of the file, those of copies one after another."""
        return [self._spring(number, entry) for number, entry in enumerate(self.spring_entries)]

    def _spring(self, number: int, entry: JoinedSpring) -> SymbolicSpring:
        a, b = entry.ends
        ell, strength = coordinate("ell", number + 1), (entry.stiffness, entry.damping)
        if entry.torsion:
            return SymbolicSpring(number, (self._angle_at(b) - self._angle_at(a),), None, *strength, ell)
        between = tuple(second - first for first, second in zip(self._end(a, b), self._end(b, a), strict=True))
        rest_length = sp.sqrt(sp.Add(*(sp.sympify(part).subs(self.rest) ** 2 for part in between)))
        return SymbolicSpring(number, between, None if rest_length == 0 else sp.simplify(rest_length), *strength, ell)

    # ----------------------------------------------------------------------------------------------------- energies

    @cached_property
    def carried_weights(self) -> list[Any]:
        """W (N or N m) of every support's coordinates that a spring holds as drawn, and 0 of the others."""
        is_carried = [holds for carrier in self.carriers for holds in carrier.carries]
        weights = [(m * self.gravity, place[1]) for m, place in self.masses()]
        return [
            sp.Add(*(w * sp.diff(z, c.q).subs(self.rest) for w, z in weights)) if holds else sp.S.Zero
            for c, holds in zip(self.coordinates, is_carried, strict=False)
        ]

    @cached_property
    def carrier_energies(self) -> list[Any]:
        """½ k η² + W η of every support."""
        weights, energies = iter(self.carried_weights), []
        for carrier in self.carriers:
            q = sp.Matrix([c.q for c in carrier.coordinates])
            elastic_energy = (q.T * carrier.stiffness * q)[0] / 2 if q else sp.S.Zero
            energies.append(elastic_energy + carrier.stored + sp.Add(*(next(weights) * value for value in q)))
        return energies

    @cached_property
    def parts(self) -> list[Energy]:
        """The energies of every support and chain; weights count from the drawn origin of the support."""
        parts = []
        for carrier, energy in zip(self.carriers, self.carrier_energies, strict=True):
            if carrier.coordinates:
                descent = carrier.place(carrier.centre)[1] - carrier.position[1]
                V = sp.expand(energy - carrier.mass * self.gravity * descent)
                parts.append(Energy(carrier.name, carrier.kinetic, V))
        return parts + [self._of_pendulum(p) for p in range(len(self.chains))]

    @property
    def potential(self) -> Any:
        """V of all masses and springs; weights count from the first joints as drawn."""
        places = [(c.mass, c.place(c.centre)[1] - c.position[1]) for c in self.carriers if c.mass != 0]
        for number, (p, i) in enumerate(self.links):
            places.append((self.chains[p].mass[i], self.on_link(number, None)[1] - self._at_rest(self.pivots[p])[1]))
        joints = map(self.joint_energy, range(len(self.chains)))
        weights = (-m * self.gravity * z for m, z in places)
        return sp.Add(*weights, *self.carrier_energies, *joints, *(spring.V for spring in self.spring_energies))

    @cached_property
    def spring_energies(self) -> list[Energy]:
        """The energies of the springs between points, the length of a stretched one by its symbol ℓ."""
        return [
            Energy(self._words_of(spring), sp.S.Zero, spring.stiffness * spring.elongation_square / 2)
            for spring in self.springs
        ]

    def _words_of(self, spring: SymbolicSpring) -> str:
        """A spring and the parts that it joins."""
        names = []
        for end in self.spring_entries[spring.number].ends:
            if isinstance(end, LinkEnd):
                p, i = self.links[end.link]
                names.append(f"pendulum {p + 1}" + f", link {i + 1}" * (len(self.chains[p].mass) > 1))
            else:
                names.append(self.carriers[end.carrier].name if isinstance(end, CarrierEnd) else "the ground")
        return f"spring {spring.number + 1}, from {' to '.join(names)}"

    def _of_pendulum(self, p: int) -> Energy:
        """T = ½ m v_p² + Σ b_i v_p·n_i θ_i' + ½ Σ A_ij cos(θ_i − θ_j) θ_i'θ_j' of the pair (A, b), and V."""
        chain, pivot_end, angles = self.chains[p], self.pivot_ends[p], self._of_chain(p)
        carrier, total = self.carriers[pivot_end.carrier], sp.Add(*chain.mass)
        first = self.links.index((p, 0))
        b, A = self.b[first : first + len(angles)], self.A[first : first + len(angles), first : first + len(angles)]
        T = total * carrier.speed_square(pivot_end.where) / 2
        V = -total * self.gravity * (self.pivots[p][1] - carrier.position[1])
        for i, angle in enumerate(angles):
            T += b[i] * carrier.speed_across(pivot_end.where, angle.q) * angle.v + A[i, i] * angle.v**2 / 2
            T += sp.Add(*(A[i, j] * sp.cos(angle.q - angles[j].q) * angle.v * angles[j].v for j in range(i)))
            V -= self.gravity * b[i] * sp.cos(angle.q)
        T += self.at_joints(p, chain.rotor, "v")
        V += self.joint_energy(p)
        where = f" on {carrier.name}" if carrier.coordinates else ""
        return Energy(f"pendulum {p + 1}{where}", sp.expand(T), V)

    def joints(self, p: int, part: str = "q") -> list[Any]:
        """The angles at the joints of a chain from rest, or their rates (`part` v): the first from its support."""
        carrier_angle = self.carriers[self.pivot_ends[p].carrier].angle
        upper, relative = getattr(carrier_angle, part) if carrier_angle is not None else sp.S.Zero, []
        for angle, sign in zip(self._of_chain(p), self.chains[p].sigma, strict=True):
            value = getattr(angle, part)
            straight = value - (sp.pi if sign < 0 and part == "q" else 0)
            relative.append(straight - upper)
            upper = straight
        return relative

    def joint_energy(self, p: int) -> Any:
        """The energy of the springs and laws at the joints of a chain, in symbols."""
        laws = zip(self.laws[p], self.joints(p), strict=True) if self.laws else ()
        potentials = (potential_of(part, gamma) for parts, gamma in laws for part in parts)
        return sp.Add(self.at_joints(p, self.chains[p].stiffness), *potentials)

    def joint_dissipation(self, p: int) -> Any:
        """The function R of the dampers and laws at the joints of a chain, whose slopes by rates are torques."""
        laws = zip(self.laws[p], self.joints(p), self.joints(p, "v"), strict=True) if self.laws else ()
        functions = (dissipation_of(part, gamma, rate) for parts, gamma, rate in laws for part in parts)
        return sp.Add(self.at_joints(p, self.chains[p].damping, "v"), *functions)

    def at_joints(self, p: int, strength: Sequence[Any], part: str = "q") -> Any:
        """½ Σ k γ² of a chain, γ its angles at joints from rest or (`part` v) their rates."""
        return sp.Add(*(k * gamma**2 / 2 for k, gamma in zip(strength, self.joints(p, part), strict=True)))

    @cached_property
    def rotor_energy(self) -> Any:
        """½ Σ J (rate)² of the rotors at joints."""
        return sp.Add(*(self.at_joints(p, chain.rotor, "v") for p, chain in enumerate(self.chains)))

    @cached_property
    def dissipation(self) -> Any:
        """R = ½ η'ᵀ D η' of all supports + Σ ½ d (rate)² of joints and springs; of a stretched one by the symbol ℓ'."""
        return sp.Add(*self._dissipations())

    def _dissipations(self) -> Iterator[Any]:
        for carrier in self.carriers:
            v = sp.Matrix([c.v for c in carrier.coordinates])
            yield sp.expand((v.T * carrier.damping * v)[0]) / 2 if v else sp.S.Zero
        yield from map(self.joint_dissipation, range(len(self.chains)))
        for spring in self.springs:
            rates = [self.rate(part) for part in spring.between] if spring.rest is None else [spring.ell.v]
            yield from (spring.damping * rate**2 / 2 for rate in rates)

    def rate(self, value: Any) -> Any:
        """d/dt of a function of the coordinates."""
        return time_derivative(value, self._among(value))

    def _among(self, value: Any) -> list[Coordinate]:
        """The coordinates that a function has."""
        names = sp.sympify(value).free_symbols
        return [c for c in (*self.coordinates, *self.azimuths) if names & {c.q, c.v}]

    def cartesian(self) -> Any:
        """T from the rates of all places."""
        inertia = [self.chains[p].inertia[i] for p, i in self.links]
        turning = [(I, self.rate(part)) for I, u in zip(inertia, self.directions, strict=True) for part in u if I != 0]
        turning += [(c.inertia, c.angle.v) for c in self.carriers if c.angle is not None]
        T = sp.Add(*(m * self.rate(part) ** 2 / 2 for m, place in self.masses() for part in place))
        T += sp.Add(*(c.kinetic for c in self.carriers if c.masses is not None))
        return T + self.rotor_energy + sp.Add(*(I * rate**2 / 2 for I, rate in turning))

    # ---------------------------------------------------------------------------------------------------- equations

    def equations(self) -> list[Any]:
        """Expressions that vanish in motion, one for each coordinate: Lagrange's, part by part.

        A stretched spring pulls with its force F, the symbol that `force_of` explains: F ∂ℓ/∂q, ∂ℓ/∂q = Δr·∂Δr/∂q/ℓ.
        """
        rows = dict.fromkeys((c.q for c in self.coordinates), sp.S.Zero)
        for part in (*self.parts, *self.spring_energies):
            coordinates = self._among(part.T + part.V)
            for c in coordinates:
                inertial = time_derivative(sp.diff(part.T, c.v), coordinates) - sp.diff(part.T, c.q)
                rows[c.q] += sp.expand(inertial) + sp.diff(part.V, c.q)
        for dissipation in self._dissipations():
            for c in self._among(dissipation):
                rows[c.q] += sp.diff(dissipation, c.v)
        for spring in self.springs:
            if spring.rest is not None:
                for c in self._among(spring.square):
                    projection = sp.Add(*(part * sp.diff(part, c.q) for part in spring.between))
                    rows[c.q] += force_symbol(spring) * projection / spring.ell.q
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
        if self.spatial:
            return replace(self, spatial=False).matrices()
        n = len(self.coordinates)
        M, K, D = (sp.zeros(n, n) for _ in range(3))
        self._inertial(M)
        for part in (*self.parts, *self.spring_energies):
            self._add_curvature(K, part.V)
        for spring in self.springs:
            if spring.rest is not None:
                ell = self._slopes(sp.sqrt(spring.square))
                self._add_product(K, spring.stiffness, ell)
                self._add_product(D, spring.damping, ell)
        for dissipation in self._dissipations():
            self._add_curvature(D, dissipation, "v")

        def simpler(entry: Any) -> Any:
            shorter = sp.factor(entry)
            return min(shorter, entry, key=sp.count_ops) if self.is_of_pair else shorter

        return (M, K, D) if not self.symbols else tuple(_symmetric(A, simpler) for A in (M, K, D))

    def _inertial(self, M: Any) -> None:
        for m, place in self.masses():
            for part in place:
                self._add_product(M, m, self._slopes(part))
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
        self._add_curvature(M, sp.expand(self.rotor_energy), "v")

    @cached_property
    def _places(self) -> dict[Any, int]:
        """The number of every coordinate and of its rate."""
        return {name: k for k, c in enumerate(self.coordinates) for name in (c.q, c.v)}

    def _coordinates_in(self, value: Any) -> list[tuple[int, Coordinate]]:
        places = sorted({self._places[name] for name in sp.sympify(value).free_symbols if name in self._places})
        return [(k, self.coordinates[k]) for k in places]

    def _slopes(self, value: Any) -> dict[int, Any]:
        """∂/∂q at rest, term by term."""
        slopes: dict[int, Any] = {}
        for term in sp.Add.make_args(sp.sympify(value)):
            for i, c in self._coordinates_in(term):
                slopes[i] = slopes.get(i, sp.S.Zero) + sp.diff(term, c.q).xreplace(self.rest)
        return slopes

    def _add_product(self, A: Any, weight: Any, slopes: dict[int, Any]) -> None:
        for i, a in slopes.items():
            for j, b in slopes.items():
                A[i, j] += weight * a * b

    def _add_curvature(self, A: Any, f: Any, by: str = "q") -> None:
        """Second derivatives of a function at rest, by the coordinates or by their rates, term by term."""
        rest = {**self.rest, **{c.v: sp.S.Zero for c in self.coordinates}}
        for term in sp.Add.make_args(sp.sympify(f)):
            coordinates = self._coordinates_in(term)
            for i, c in coordinates:
                slope = sp.diff(term, getattr(c, by))
                for j, other_coordinate in coordinates:
                    A[i, j] += sp.diff(slope, getattr(other_coordinate, by)).xreplace(rest)

    @cached_property
    def conditions(self) -> dict[Any, Any]:
        """Return the conditions for an equilibrium as drawn: ∂V/∂q by coordinate."""
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


def _symmetric(matrix: Any, simpler: Callable[[Any], Any]) -> Any:
    """A symmetric matrix with its entries simpler."""
    half = {(i, j): simpler(matrix[i, j]) for i in range(matrix.rows) for j in range(i, matrix.rows)}
    return sp.Matrix(matrix.rows, matrix.rows, lambda i, j: half[min(i, j), max(i, j)])


def indices(angle: Coordinate) -> list[str]:
    """The indices of an angle: the numbers of its chain, if there are several, and of its link."""
    return list(angle.q.name.split("_")[1:])
