"""Motion in the plane in maximal coordinates: paper 000's DAE of cart and double pendula for any plane scene.

Coordinates q = (x, z of the cart; x, z, θ of the centre of every link) with z down, the cart's omitted on a fixed
support.  Every link moves freely under gravity, springs, dampers and loads f, held by pivot forces λ that are unknowns
too: the ground's push up on the cart, then the force from above on every link,

    M q'' + Gᵀ λ = f,   G q'' = γ      5L unknowns, 5L + 3 with a cart: 10 n + 3 for n double pendula

With u = (sin θ, cos θ) along a link, n = (cos θ, −sin θ) across it and e = l − c, link i hangs from h where

    g_i = r_h + e_h u_h − (r_i − c_i u_i) = 0,    G q' = g_i with r' for r and θ' n for u,
    γ_i = e_h θ_h'² u_h + c_i θ_i'² u_i

The end of the support is the cart's centre, whose own constraint, the first, is z = 0.  The matrix is regular although
bobs have no inertia and a cart may have no mass.

The accelerations satisfy the constraints, but round-off and integration errors do not: the system is of index 1, and
positions drift off (linearly with the velocities' error, quadratically with the accelerations').  So between steps
`project` restores q and q' by the smallest mass-weighted change, min ½ δᵀM δ with G δ = −g, one linear system of the
same matrix per Newton step [Hairer2006, §IV.4].  It leaves the
centre of mass and the momentum along the rail unchanged.  Source: paper 000, section IV, corrected
(`modal.symbolic.papers.cart_dae`), written link by link.

Where ropes have a prescribed length the constraints depend on time: the centre of a bob is at c_i = l_i(t) from its
upper pivot, so that

    G q' = −c_i' u_i,      γ_i gains −c_i'' u_i − 2 c_i' θ_i' n_i,

and the winch does the work ∫ Σ c_i' u_i·λ_i dt of the pivot forces.  Since `project` must know the lengths, the time is
a component of y, before the work.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from math import sqrt
from typing import NamedTuple

import numpy as np
import scipy

from modal.errors import ComputationError
from modal.types import EPS, Floats, Ints
from nonlinear.dynamics.forces import cart_force, forces_of, joint_torques, modal_drag, resultants
from nonlinear.dynamics.inputs import with_lengths
from nonlinear.dynamics.mechanics import Reactions
from nonlinear.system import AppliedForces, Load, Motion, State, System

CLOSING_ROUNDS = 6
"""Limit: of Newton's method on the gaps of pivots; those torn so far apart that it takes more are refused."""
OPEN_GAP_MAX = 1e-9
"""Limit: of a pivot, over the reach; torn farther apart, a message says so."""
DENSE_UNKNOWNS_MAX = 120
"""Cost: unknowns up to which a dense matrix is quicker than a sparse one."""
SINGULAR = "an acceleration is undetermined, as for a massless cart above hanging bobs: give the cart some mass"


class Drift(NamedTuple):
    """The widest pivot: a gap of `position` times the longest pendulum L, opening at `velocity` times sqrt(g L)."""

    position: float
    velocity: float


@dataclass(frozen=True, eq=False)
class Maximal:
    """The equations of a plane scene with y = (q, q', work), where ropes are wound y = (q, q', time, work).

    With `corrects_drift` false, `project` reports the drift and leaves it uncorrected, as the paper's method does.
    """

    system: System
    load: Load | None = None
    corrects_drift: bool = True

    @cached_property
    def pivots(self) -> Pivots:
        """The constraints, with the lengths that the scene has without its hoists."""
        return Pivots(self.system)

    def pivots_at(self, time: float) -> Pivots:
        """The constraints at a time (s)."""
        hoisting = self.system.hoisting
        if hoisting is None:
            return self.pivots
        length, *winding = hoisting.at(time)
        groups = [with_lengths(group, hoisting.moving, length[group.index]) for group in self.system.groups]
        return Pivots(replace(self.system, groups=tuple(groups), hoisting=None), *winding)

    def _pivots_of(self, y: Floats) -> Pivots:
        return self.pivots_at(float(y[2 * self.pivots.size]) if self.system.hoisting else 0.0)

    @property
    def works(self) -> bool:
        """Whether the work is the last component of y."""
        return self.system.works or self.load is not None

    def unknowns(self, time: float, y: Floats) -> Floats:
        """The paper's u: q'' (m/s², rad/s²), then `normal` on a cart, then the force from above on every link (N)."""
        return self._solve(time, self._state(y))[0]

    def derivative(self, time: float, y: Floats) -> Floats:
        """The derivative y', (size,)."""
        size = self.pivots.size
        unknowns, power = self._solve(time, self._state(y))
        clock = [1.0] if self.system.hoisting else []
        return np.concatenate((y[size : 2 * size], unknowns[:size], clock, [power] * self.works))

    def _solve(self, time: float, state: State) -> tuple[Floats, float]:
        """The unknowns, and the power (W) of dampers, drives, the load, inertial forces and winches."""
        pivots, forces = self.pivots_at(time), np.zeros(self.pivots.size)
        system, push = pivots.system, self.load(time, state) if self.load else AppliedForces()
        support, links = pivots.parts(forces)
        on_cart, on_links, power = acting(system, state, push)
        support += on_cart, system.gravity * system.cart.mass if system.cart else 0.0
        links[:, 1] = system.gravity * system.mass
        links[:, 2] = on_links
        cart, moving = pivots.parts(pivots.place(state)[1])
        power += add_outside(system, time, state, moving, cart, support, links)
        unknowns = pivots.saddle.solve(state.links, forces, pivots.gamma(state.links, state.link_rates))
        if self.system.hoisting:
            pulls = np.sum(_directions(state.links)[0] * unknowns[-2 * system.n_links :].reshape(-1, 2), axis=1)
            power += float(np.sum(pivots.speed * pulls))
        return unknowns, power

    def _state(self, y: Floats) -> State:
        return self.read(y[None])[0]

    def begin(self, state: State) -> Floats:
        """The vector y at time 0 of a state given by its angles, with closed pivots and zero work."""
        return self.begin_at(state, 0.0)

    def begin_at(self, state: State, time: float) -> Floats:
        """The vector y of a state at a time (s)."""
        clock = [time] if self.system.hoisting else []
        return np.concatenate((*self.pivots_at(time).place(state), clock, [0.0] * self.works))

    def read(self, rows: Floats) -> Motion:
        """The motion in vectors (T, size)."""
        first, size, none = self.pivots.first, self.pivots.size, np.zeros(len(rows))
        links, rates = rows[:, first + 2 : size : 3], rows[:, size + first + 2 : 2 * size : 3]
        cart, cart_rate = (rows[:, 0], rows[:, size]) if first else (none, none)
        return Motion(links, rates, cart, cart_rate, rows[:, -1] if self.works else none)

    @property
    def scale(self) -> Floats:
        """Natural units of y, (size,): l of positions, 1 of angles, and their rates."""
        half, rate = np.full(self.pivots.size, self.system.length), self.system.rate
        self.pivots.parts(half)[1][:, 2] = 1.0
        clock = [1 / rate] if self.system.hoisting else []
        return np.concatenate((half, half * rate, clock, [self.system.energy] * self.works))

    def drift(self, y: Floats) -> Drift:
        """Return the constraint violation of y."""
        (q, v), pivots = self._halves(y), self._pivots_of(y)
        reach, gravity = pivots.reach, self.system.gravity
        return Drift(_widest(pivots.gaps(q)) / reach, _widest(pivots.opening(q, v)) / sqrt(gravity * reach))

    def project(self, y: Floats) -> tuple[Floats, float]:
        """The nearest y that satisfies every constraint, and the largest violation removed, scaled as in `drift`.

        Raise ComputationError if Newton's method does not close the pivots.
        """
        violation, pivots = max(self.drift(y)), self._pivots_of(y)
        if not self.corrects_drift:
            return y, violation
        q, v = self._halves(y)
        q = pivots.closed(q)
        v = v + pivots.step(q, pivots.opening(q, v))
        return np.concatenate((q, v, y[2 * pivots.size :])), violation

    def _halves(self, y: Floats) -> tuple[Floats, Floats]:
        return y[: self.pivots.size], y[self.pivots.size : 2 * self.pivots.size]

    def reactions(self, motion: Motion, times: Floats | None = None) -> Reactions:
        """Every force of a motion, of this system or of any other; a load is evaluated at `times` (T,) in s."""
        size, first = self.pivots.size, self.pivots.first
        at = np.zeros(len(motion.cart)) if times is None else times
        states = [motion[place] for place in range(len(at))]
        unknowns = [self._solve(time, state)[0] for time, state in zip(at, states, strict=True)]
        forces = np.array(unknowns)[:, size:]
        pivots, tops = forces[:, first // 2 :].reshape(len(forces), -1, 2), self.pivots.above < 0
        return Reactions(forces[:, 0] if first else -pivots[:, tops, 1].sum(1), pivots, tops)


def _widest(gaps: Floats) -> float:
    return float(np.abs(gaps).max())


@dataclass(frozen=True, eq=False)
class Pivots:
    """The constraints of a plane scene: 2L on 3L coordinates, and with a cart one more on two more.

    Ropes become longer at a `speed` (m/s) with an `acceleration` (m/s²), 0 or (L,).
    """

    system: System
    speed: Floats | float = 0.0
    acceleration: Floats | float = 0.0

    @cached_property
    def saddle(self) -> Saddle:
        """The matrix of accelerations and forces."""
        return Saddle(self)

    @cached_property
    def first(self) -> int:
        """Number of coordinates of the cart."""
        return 2 if self.system.cart else 0

    @cached_property
    def size(self) -> int:
        """Number of coordinates."""
        return self.first + 3 * self.system.n_links

    @cached_property
    def above(self) -> Ints:
        """The link from which each link hangs, −1 for the support, (L,)."""
        upper = np.full(self.system.n_links, -1)
        for group in self.system.groups:
            upper[group.index[1:]] = group.index[:-1]
        return upper

    @cached_property
    def centre(self) -> Floats:
        """Distance from the upper pivot to the centre of mass (m), (L,)."""
        return self.system.by_link("centre")

    @cached_property
    def rest(self) -> Floats:
        """Distance from the centre of mass to the lower pivot (m), (L,)."""
        return self.system.by_link("length") - self.centre

    @cached_property
    def reach(self) -> float:
        """Length (m) of the longest pendulum, the unit of violations."""
        return max(float(group.block.length.sum(0).max()) for group in self.system.groups)

    def parts(self, q: Floats) -> tuple[Floats, Floats]:
        """Support (2,) and links (L, 3) in a vector of coordinates, of velocities or of accelerations."""
        support = q[:2] if self.first else np.zeros(2)
        return support, q[self.first :].reshape(-1, 3)

    def place(self, state: State) -> tuple[Floats, Floats]:
        """The q and q' of a state, with every constraint satisfied."""
        u, n = _directions(state.links)
        q = self._hang(u, state.links, state.cart, 0.0 * u)
        return q, self._hang(state.link_rates[:, None] * n, state.link_rates, state.cart_rate, self._winding(u))

    def _hang(self, arms: Floats, turns: Floats, cart: float, longer: Floats) -> Floats:
        support = np.array([cart, 0.0])
        links = np.column_stack((arms, turns))
        for group in self.system.groups:
            chain = arms[group.index]
            ends = np.cumsum(group.block.length[..., None] * chain + longer[group.index], axis=0)
            links[group.index, :2] = support + ends - self.rest[group.index][..., None] * chain
        return np.concatenate((support[: self.first], links.ravel()))

    def _winding(self, u: Floats) -> Floats:
        """C' u (m/s) of every link, (L, 2)."""
        return np.asarray(np.transpose(self.speed * u.T))

    def gaps(self, q: Floats) -> Floats:
        """The gaps of the pivots (m)."""
        support, links = self.parts(q)
        return self._gaps(links[:, :2], _directions(links[:, 2])[0], support)

    def opening(self, q: Floats, v: Floats) -> Floats:
        """The rate G q' at which the pivots open (m/s)."""
        support, rates = self.parts(v)
        u, n = _directions(self.parts(q)[1][:, 2])
        opening = self._gaps(rates[:, :2], rates[:, 2:] * n, support)
        opening[-u.size :] += self._winding(u).ravel()
        return opening

    def gamma(self, angles: Floats, rates: Floats) -> Floats:
        """The value γ (m/s²) of G q'' that keeps the pivots closed."""
        u, n = _directions(angles)
        gamma = self._gaps(np.zeros_like(u), rates[:, None] ** 2 * u, np.zeros(2))
        gamma[-u.size :] -= np.ravel(self.acceleration * u.T + 2 * (self.speed * rates) * n.T, order="F")
        return gamma

    def closed(self, q: Floats) -> Floats:
        """The q nearest to this one whose pivots have no gaps; raise ComputationError if Newton's method finds none."""
        extent = self.reach + abs(q[0])
        for _ in range(CLOSING_ROUNDS):
            gaps = self.gaps(q)
            if _widest(gaps) <= 4 * EPS * extent:
                return q
            q = q + self.step(q, gaps)
        gap = _widest(self.gaps(q))
        if not gap <= OPEN_GAP_MAX * extent:
            raise ComputationError(
                f"pivots still {gap:.2g} m apart after {CLOSING_ROUNDS} corrections: too far apart to be closed"
            )
        return q

    def step(self, q: Floats, gaps: Floats) -> Floats:
        """The smallest mass-weighted change δ with G δ = −g, of q or of q'."""
        angles = self.parts(q)[1][:, 2]
        return self.saddle.solve(angles, 0.0, -gaps)[: self.size]

    def _gaps(self, middle: Floats, arms: Floats, support: Floats) -> Floats:
        ends = np.vstack((middle + self.rest[:, None] * arms, support))
        gaps = ends[self.above] - (middle - self.centre[:, None] * arms)
        return np.concatenate((support[self.first // 2 : self.first], gaps.ravel()))


def _directions(angles: Floats) -> tuple[Floats, Floats]:
    """The vectors u along and n across every link as (along the rail, down), (L, 2) each."""
    sin, cos = np.sin(angles), np.cos(angles)
    return np.column_stack((sin, cos)), np.column_stack((cos, -sin))


class Saddle:
    """The scaled entries of one scene's matrix: masses, G and Gᵀ, of which only sines and cosines change."""

    def __init__(self, pivots: Pivots) -> None:
        self.coordinates = pivots.size
        masses, roots = _masses(pivots)
        rows, columns, self.still, self.arm, self.turner = _entries(pivots)
        entries = np.concatenate((self.still, self.arm)) / roots[columns]
        self.scale = np.concatenate((1 / roots, 1 / np.sqrt(np.bincount(rows, entries**2))))
        diagonal, self.size = np.arange(pivots.size), len(self.scale)
        below, above, joining = _rotors(pivots)
        self.rows = np.concatenate((diagonal, below, above, pivots.size + rows, columns))
        self.columns = np.concatenate((diagonal, above, below, columns, pivots.size + rows))
        self.weight = self.scale[self.rows] * self.scale[self.columns]
        self.masses = np.concatenate((masses, joining, joining))
        order = np.arange(1, len(self.rows) + 1)
        self.pattern = scipy.sparse.coo_array((order, (self.rows, self.columns)), shape=(self.size, self.size)).tocsc()

    @property
    def is_dense(self) -> bool:
        """Whether it is solved as a dense matrix."""
        return self.size <= DENSE_UNKNOWNS_MAX

    def solve(self, angles: Floats, upper: Floats | float, lower: Floats | float) -> Floats:
        """The solution (q'', λ) with forces `upper` and accelerations `lower` on the right-hand side.

        Raise ComputationError if the motion is not determined.
        """
        right = np.empty(self.size)
        right[: self.coordinates], right[self.coordinates :] = upper, lower
        try:
            return np.asarray(self.scale * self._solve(self._values(angles), self.scale * right))
        except (np.linalg.LinAlgError, RuntimeError):
            raise ComputationError(SINGULAR) from None

    def _values(self, angles: Floats) -> Floats:
        trig = np.concatenate((np.cos(angles), -np.sin(angles)))
        G = np.concatenate((self.still, self.arm * trig[self.turner]))
        return np.asarray(self.weight * np.concatenate((self.masses, G, G)))

    def _solve(self, values: Floats, right: Floats) -> Floats:
        if not self.is_dense:
            pattern = self.pattern
            matrix = scipy.sparse.csc_array(
                (values[pattern.data - 1], pattern.indices, pattern.indptr), shape=pattern.shape
            )
            return np.asarray(scipy.sparse.linalg.splu(matrix).solve(right))
        dense = np.zeros((self.size, self.size))
        dense[self.rows, self.columns] = values
        return np.asarray(np.linalg.solve(dense, right), dtype=np.float64)


def _masses(pivots: Pivots) -> tuple[Floats, Floats]:
    """The diagonal of M, and the root of each coordinate's inertia, never zero."""
    system, mass, inertia = pivots.system, pivots.system.mass, pivots.system.by_link("inertia")
    cart = [system.cart.mass] * 2 if system.cart else []
    rotor, inner = system.by_link("rotor"), pivots.above >= 0
    inertia = inertia + rotor + np.bincount(pivots.above[inner], rotor[inner], len(rotor))
    links = np.column_stack((mass, mass, inertia))
    turning = np.column_stack((mass, mass, inertia + mass * pivots.centre**2))
    cart_loads = [mass_of_cart + float(mass.sum()) for mass_of_cart in cart]
    return np.concatenate((cart, links.ravel())), np.sqrt(np.concatenate((cart_loads, turning.ravel())))


def _rotors(pivots: Pivots) -> tuple[Ints, Ints, Floats]:
    """The entries of M next to its diagonal: angles of links with a rotor, those of the links above, and −J."""
    rotor = pivots.system.by_link("rotor")
    joined = np.flatnonzero((rotor != 0) & (pivots.above >= 0))
    return pivots.first + 3 * joined + 2, pivots.first + 3 * pivots.above[joined] + 2, -rotor[joined]


def _entries(pivots: Pivots) -> tuple[Ints, Ints, Floats, Floats, Ints]:
    """(rows, columns) of G; its constant entries; the arms of the varying ones, and the link of their (cos, −sin).

    Row r is a pivot's equation along the rail, r + 1 the same pivot's downward one.
    """
    first, links = pivots.first, np.arange(pivots.system.n_links)
    r, x = first // 2 + 2 * links, first + 3 * links
    inner = pivots.above >= 0
    upper = pivots.above[inner]
    on_cart = r[~inner] if first else r[:0]
    cart = np.zeros_like(on_cart)
    constants = [(r, x, -1.0), (r + 1, x + 1, -1.0), (r[inner], x[upper], 1.0), (r[inner] + 1, x[upper] + 1, 1.0)]
    constants += [(on_cart, cart, 1.0), (on_cart + 1, cart + 1, 1.0), (cart[:1], cart[:1] + 1, 1.0)]
    c, e, count = pivots.centre, pivots.rest[upper], len(links)
    turning = [(r, x + 2, c, links), (r + 1, x + 2, c, links + count)]
    turning += [(r[inner], x[upper] + 2, e, upper), (r[inner] + 1, x[upper] + 2, e, upper + count)]
    rows, columns = (np.concatenate([entry[part] for entry in (*constants, *turning)]) for part in (0, 1))
    values = np.concatenate([np.full(len(where), value) for where, _, value in constants])
    arms, turners = (np.concatenate([entry[part] for entry in turning]) for part in (2, 3))
    return rows, columns, values, arms, turners


def add_outside(
    system: System, time: float, state: State, moving: Floats, cart: Floats, on_cart: Floats, on_links: Floats
) -> float:
    """Add inertial forces, drag and the scene's forces; their power (W) at the velocities of links and cart."""
    frame, velocity = system.support, moving[:, :2]
    acceleration, wind = (frame.acceleration(time), frame.velocity(time)) if frame else ((0.0, 0.0), (0.0, 0.0))
    frame_forces = -system.mass[:, None] * acceleration
    if system.has_drag:
        frame_forces = frame_forces + forces_of(system, (velocity + wind)[None])[0]
    on_links[:, :2] += frame_forces
    power = float(np.sum(frame_forces * velocity))
    if system.forces:
        forces, moments, cart_push = resultants(system, state.links, time)
        on_links[:, :2] += forces
        on_links[:, 2] += moments
        on_cart[0] += cart_push
        power += float(np.sum(forces * velocity) + moments @ moving[:, 2] + cart_push * cart[0])
    return power


def acting(system: System, state: State, push: AppliedForces) -> tuple[float, Floats, float]:
    """Force (N) along the rail, generalized forces (N m) on the absolute angles, (L,), and non-conservative power (W).

    They are those of joints, of damping ratios, of a cart's spring and damper and of a load: forces on centres are
    left to the links, which are free.  Conservative forces do not count in the power.
    """
    torques, power = state.links * 0.0, 0.0
    for group in system.groups:
        if group.has_joint_torques:
            angles, rates = state.links[group.index], state.link_rates[group.index]
            torques[group.index], joint_power = joint_torques(group, angles, rates)
            power += float(joint_power)
    if push.moments is not None:
        torques, power = torques + push.moments, power + float(push.moments @ state.link_rates)
    elastic, working = cart_force(system, state.cart, state.cart_rate)
    outside = push.cart + working if system.cart else 0.0
    if system.modal_damping is not None:
        rates = np.append(state.cart_rate, state.link_rates) if system.cart else state.link_rates
        drag = modal_drag(system, rates)
        torques, power = torques + drag[-len(torques) :], power + float(drag[-len(torques) :] @ state.link_rates)
        outside += drag[0] if system.cart else 0.0
    return outside + elastic, torques, power + float(state.cart_rate * outside)
