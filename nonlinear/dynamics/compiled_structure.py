"""The equations of structures compiled by numba (extra `fast`): loops over flat arrays of supports, links and springs.

The operations at each are the text of `nonlinear.dynamics.structure` and `recursion` and of
`modal.structure.carriers`; here is only its order.  Modal supports and those that others write are left to the written
text and to NumPy.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from modal.errors import SceneError
from modal.scene.carriers import along_arc, swing_path
from modal.structure import CarrierEnd, End, LinkEnd
from modal.structure.carriers import turn_displacement, turn_point
from modal.types import Booleans, Floats, Ints
from nonlinear.dynamics.compiling import in_place
from nonlinear.dynamics.forces import joint_law
from nonlinear.dynamics.programs import run_program
from nonlinear.dynamics.recursion import (
    Answer,
    RecursiveLink,
    Turn,
    driven,
    link_acceleration,
    link_response,
    tip_response,
)
from nonlinear.dynamics.structure import Carriers, eliminate, slack, stretch_law, versine
from nonlinear.dynamics.text import sincos
from nonlinear.system import System

STRAIGHT, ARC, TURNING = range(3)
"""Kinds of coordinates: along a line, of a swing along its arc, of rotation."""
TIGHT, LOOSE, TORSION = range(3)
GROUND, ON_LINK, ON_CARRIER = range(3)

_sincos, _joint_law, _versine, _driven = map(in_place, (sincos, joint_law, versine, driven))
_tip_response, _link_response, _link_acceleration = map(in_place, (tip_response, link_response, link_acceleration))
_swung, _turn_motion, _along_arc = map(in_place, (swing_path, turn_point, along_arc))
_turn_displacement, _stretch_law = map(in_place, (turn_displacement, stretch_law))
_slack, _eliminate = map(in_place, (slack, eliminate))


class FlatStructure(NamedTuple):
    """A structure in flat arrays; the last are storage for results.

    Of every coordinate `kind`, `length` of rods, and `law` (d, 3): stiffness, damping, carried weight; of every support
    its first coordinate (c + 1,), the one that is its angle or −1, and `body` (c, 4): mass, inertia about its origin,
    centre; of every pendulum its `carrier`, `where` (P, 2) it hangs, and whether its first joint moves as that of the
    one before it; of every spring `spring` (E,), `numbers` (E, 5): k, d, Δ₀, |Δ₀|, and of its ends `ends` (E, 2, 2):
    kind and number, for those between angles a coordinate or −1, with `points` (E, 2, 2); `pulls` says whether any ends
    at a link.
    """

    kind: Ints
    length: Floats
    law: Floats
    first: Ints
    angle: Ints
    body: Floats
    carrier: Ints
    where: Floats
    alike: Booleans
    spring: Ints
    numbers: Floats
    ends: Ints
    points: Floats
    pulls: bool
    A: Floats
    right: Floats
    slopes: Floats
    turns: Floats
    bias: Floats
    joint_motion: Floats
    loads: Floats


def with_own_room(flat: FlatStructure) -> FlatStructure:
    """Return the same with its own work arrays."""
    names = ("A", "right", "slopes", "turns", "bias", "joint_motion", "loads")
    return flat._replace(**{name: getattr(flat, name).copy() for name in names})


def flat_of(system: System) -> FlatStructure:
    """Return the arrays of a system on a structure; raise SceneError for unsupported kinds of supports."""
    carriers = Carriers(system)
    if unknown := [carrier for carrier in carriers.structure.carriers if not carrier.is_compiled]:
        raise SceneError([f"support.{each.name}: supports of kind {each.kind} are not compiled" for each in unknown])
    structure, d, links = carriers.structure, carriers.structure.size, system.n_links
    kind, slopes, length, law = np.zeros(d, dtype=np.int64), np.zeros((2, d)), np.ones(d), np.zeros((d, 3))
    angle, body = np.full(len(structure.carriers), -1), np.zeros((len(structure.carriers), 4))
    for number, carrier in enumerate(structure.carriers):
        s, h = carrier.centre
        body[number] = carrier.mass, carrier.inertia + carrier.mass * (s * s + h * h), s, h
        at = structure.angle_of(number)
        angle[number] = -1 if at is None else at
        for k, row in enumerate(zip(carrier.stiffness, carrier.damping, strict=True), structure.offsets[number]):
            law[k] = *row, carriers.weights[k]
            kind[k] = TURNING if k == at else ARC if carrier.bends and at is None else STRAIGHT
            length[k] = carrier.values.get("length", 1.0)
            if kind[k] == STRAIGHT:
                zeros = [0.0] * carrier.size
                slopes[:, k] = carrier.moving((0.0, 0.0), zeros, zeros).slopes[k - structure.offsets[number]]
    springs = structure.springs
    kinds, numbers = np.zeros(len(springs), dtype=np.int64), np.zeros((len(springs), 5))
    ends, points = np.zeros((len(springs), 2, 2), dtype=np.int64), np.zeros((len(springs), 2, 2))
    if carriers.springs:
        numbers[:, :2] = np.transpose(carriers.springs.numbers)
        for number, entry in enumerate(carriers.springs.kinds):
            kinds[entry] = number
        if len(tight := carriers.springs.kinds[0]):
            offsets, rest = carriers.springs.drawn_vectors
            numbers[tight, 2:4], numbers[tight, 4] = offsets.T, rest
        for k, spring in enumerate(springs):
            for side, end in enumerate(spring.ends):
                ends[k, side], points[k, side] = _end(carriers, end, spring.torsion)
    room = np.zeros((d, d)), np.zeros(d), slopes, np.zeros((3, d)), np.zeros((2, len(angle))), *np.zeros((2, 4, links))
    pivots, pulls = structure.pivots, bool(np.any(ends[..., 0] == ON_LINK))
    alike = [
        entry.carrier == previous.carrier and (entry.where == previous.where or angle[entry.carrier] < 0)
        for entry, previous in zip(pivots[1:], pivots[:-1], strict=True)
    ]
    supports = kind, length, law, np.array(structure.offsets), angle, body
    carriers_of_pivots, where = zip(*((pivot.carrier, pivot.where) for pivot in pivots), strict=True)
    hanging = np.array(carriers_of_pivots), np.array(where, dtype=float), np.array([False, *alike])
    return FlatStructure(*supports, *hanging, kinds, numbers, ends, points, pulls, *room)


def _end(carriers: Carriers, end: End, torsion: bool) -> tuple[tuple[int, int], tuple[Any, Any]]:
    structure = carriers.structure
    if isinstance(end, LinkEnd):
        if torsion:
            return (ON_LINK, structure.size + end.link), (0.0, 0.0)
        assert carriers.springs is not None
        return (ON_LINK, end.link), (carriers.springs.below(end), 0.0)
    if isinstance(end, CarrierEnd):
        if torsion:
            angle = structure.angle_of(end.carrier)
            return (ON_CARRIER, -1 if angle is None else angle), (0.0, 0.0)
        assert isinstance(end.where, tuple)
        return (ON_CARRIER, end.carrier), end.where
    return (GROUND, -1), (0.0, 0.0)


@in_place
def _slope(F, y, half, carrier, s, h):  # type: ignore[no-untyped-def]
    """Slopes of a point of a support, in F.slopes, and its bias; only what an angle does depends on the point."""
    bx, bz, k = F.bias[0, carrier], F.bias[1, carrier], F.angle[carrier]
    if k >= 0:
        _, slope, bias = _turn_motion(s, h, F.turns[0, k], F.turns[1, k], y[half + k])
        F.slopes[0, k], F.slopes[1, k] = slope
        bx, bz = bx + bias[0], bz + bias[1]
    return bx, bz


@in_place
def _times_slopes(F, values, start, carrier):  # type: ignore[no-untyped-def]
    """J times the numbers of a support among `values`, with the slopes that are in F."""
    x = z = 0.0
    for k in range(F.first[carrier], F.first[carrier + 1]):
        x, z = x + F.slopes[0, k] * values[start + k], z + F.slopes[1, k] * values[start + k]
    return x, z


@in_place
def _displacement(F, y, carrier, s, h):  # type: ignore[no-untyped-def]
    """How far a point of a support is from where it is drawn."""
    x = z = 0.0
    for k in range(F.first[carrier], F.first[carrier + 1]):
        if F.kind[k] == STRAIGHT:
            dx, dz = F.slopes[0, k] * y[k], F.slopes[1, k] * y[k]
        elif F.kind[k] == ARC:
            dx, dz = _along_arc(F.length[k], F.turns[0, k], F.turns[2, k])
        else:
            dx, dz = _turn_displacement(s, h, F.turns[0, k], F.turns[2, k])
        x, z = x + dx, z + dz
    return x, z


@in_place
def _push(F, carrier, x, z):  # type: ignore[no-untyped-def]
    """A force on the point whose slopes are in F."""
    for k in range(F.first[carrier], F.first[carrier + 1]):
        F.right[k] += F.slopes[0, k] * x + F.slopes[1, k] * z


@in_place
def _chain_motion(F, y, links, first, half, sin, cos):  # type: ignore[no-untyped-def]
    """Displacements and velocities of the upper joints of all links, into F.joint_motion."""
    d, motion = len(F.kind), F.joint_motion
    for p in range(len(first) - 1):
        c, s, h = F.carrier[p], F.where[p, 0], F.where[p, 1]
        _slope(F, y, half, c, s, h)
        x, z = _displacement(F, y, c, s, h)
        vx, vz = _times_slopes(F, y, half, c)
        for i in range(first[p], first[p + 1]):
            motion[0, i], motion[1, i], motion[2, i], motion[3, i] = x, z, vx, vz
            l, w = links[i, 1], y[half + d + i]
            x, z = x + l * sin[i], z - l * _versine(y[d + i])
            vx, vz = vx + l * (cos[i] * w), vz - l * (sin[i] * w)


@in_place
def _ending(F, y, half, sin, cos, k, side):  # type: ignore[no-untyped-def]
    """Displacement and velocity of one end of a spring."""
    d, at, a, b = len(F.kind), F.ends[k, side, 1], F.points[k, side, 0], F.points[k, side, 1]
    if F.ends[k, side, 0] == ON_LINK:
        w = y[half + d + at]
        x, z = F.joint_motion[0, at] + a * sin[at], F.joint_motion[1, at] - a * _versine(y[d + at])
        return x, z, F.joint_motion[2, at] + a * (cos[at] * w), F.joint_motion[3, at] - a * (sin[at] * w)
    if F.ends[k, side, 0] == ON_CARRIER:
        _slope(F, y, half, at, a, b)
        x, z = _displacement(F, y, at, a, b)
        vx, vz = _times_slopes(F, y, half, at)
        return x, z, vx, vz
    return 0.0, 0.0, 0.0, 0.0


@in_place
def _pull_end(F, y, half, k, side, x, z):  # type: ignore[no-untyped-def]
    """The force (x, z) on one end of a spring."""
    at, a, b = F.ends[k, side, 1], F.points[k, side, 0], F.points[k, side, 1]
    if F.ends[k, side, 0] == ON_LINK:
        F.loads[0, at] += x
        F.loads[1, at] += z
        F.loads[2, at] += a * x
        F.loads[3, at] += a * z
    elif F.ends[k, side, 0] == ON_CARRIER:
        _slope(F, y, half, at, a, b)
        _push(F, at, x, z)


@in_place
def _spring_forces(F, y, half, sin, cos, torque):  # type: ignore[no-untyped-def]
    """Forces of all springs between points, into F.loads, F.right and `torque`; the power of their dampers."""
    d, power = len(F.kind), 0.0
    for k in range(len(F.spring)):
        n = F.numbers[k]
        if F.spring[k] == TORSION:
            angle, turning = 0.0, 0.0
            for side in range(2):
                at, sign = F.ends[k, side, 1], 2.0 * side - 1.0
                if at >= 0:
                    angle, turning = angle + sign * y[at], turning + sign * y[half + at]
            speed = n[0] * angle + n[1] * turning
            power -= n[1] * (turning * turning)
            for side in range(2):
                at, sign = F.ends[k, side, 1], 1.0 - 2.0 * side
                if at >= d:
                    torque[at - d] += sign * speed
                elif at >= 0:
                    F.right[at] += sign * speed
            continue
        ax, az, avx, avz = _ending(F, y, half, sin, cos, k, 0)
        bx, bz, bvx, bvz = _ending(F, y, half, sin, cos, k, 1)
        x, z, vx, vz = bx - ax, bz - az, bvx - avx, bvz - avz
        if F.spring[k] == TIGHT:
            _, _, fx, fz, spring_power = _stretch_law(n[0], n[1], n[2], n[3], n[4], x, z, vx, vz)
        else:
            _, _, fx, fz, spring_power = _slack(n[0], n[1], x, z, vx, vz)
        power += spring_power
        _pull_end(F, y, half, k, 0, fx, fz)
        _pull_end(F, y, half, k, 1, -fx, -fz)
    return power


@in_place
def _carrier_terms(F, y, half, gravity):  # type: ignore[no-untyped-def]
    """The supports' own inertia, springs, dampers and weights, into F.A and F.right; the power of their dampers."""
    power = 0.0
    for k in range(len(F.kind)):
        if F.kind[k] != STRAIGHT:
            angle = y[k] / F.length[k]
            F.turns[0, k], F.turns[1, k] = _sincos(angle)
            F.turns[2, k] = _versine(angle) if len(F.spring) else 0.0
    for c in range(len(F.angle)):
        m, about, s, h = F.body[c, 0], F.body[c, 1], F.body[c, 2], F.body[c, 3]
        for k in range(F.first[c], F.first[c + 1]):
            if F.kind[k] == ARC:
                slope, bias = _swung(F.turns[0, k], F.turns[1, k], F.length[k], y[half + k])
                F.slopes[0, k], F.slopes[1, k] = slope
                F.bias[0, c], F.bias[1, c] = bias
        bx, bz = _slope(F, y, half, c, s, h)
        for k in range(F.first[c], F.first[c + 1]):
            elastic, working = _joint_law(y[k], y[half + k], F.law[k, 0], F.law[k, 1])
            ax, az = bx, bz - gravity
            if F.kind[k] != STRAIGHT:
                ax, az = 0.0, -gravity
            F.right[k] = elastic + working - m * (F.slopes[0, k] * ax + F.slopes[1, k] * az) - F.law[k, 2]
            power += working * y[half + k]
            for j in range(F.first[c], k + 1):
                F.A[k, j] = m * (F.slopes[0, k] * F.slopes[0, j] + F.slopes[1, k] * F.slopes[1, j])
            if F.kind[k] == TURNING:
                F.A[k, k] = about
            elif F.kind[k] == ARC:
                F.A[k, k] = m
    return power


@in_place
def link_at(links, i):  # type: ignore[no-untyped-def]
    """The numbers of a link, as the text of one step along its chain takes them."""
    return RecursiveLink(links[i, 0], links[i, 1], links[i, 2], links[i, 3], links[i, 4], links[i, 5], links[i, 6])


@in_place
def joint_moment(laws, law, bend, speed):  # type: ignore[no-untyped-def]
    """Moment (N m) of the spring, damper and laws above a link with the constants `law`, and the power (W) of working.

    `bend` is the angle between the link and what is above it.
    """
    elastic, working = _joint_law(bend - law[9], speed, law[7], law[8])
    if law[11]:
        conserved, driving = run_program(laws, int(law[10]), int(law[11]), bend - law[9], speed)
        elastic, working = elastic + conserved, working + driving
    return elastic + working, working * speed


@in_place
def _hinge(F, links, laws, y, half, i, top, c):  # type: ignore[no-untyped-def]
    """Moment (N m) on link i of the spring, damper and laws above it, and the power (W) of the parts that do work."""
    at, law = len(F.kind) + i, links[i]
    bend, speed = y[at], y[half + at]
    if i > top:
        bend, speed = bend - y[at - 1], speed - y[half + at - 1]
    elif F.angle[c] >= 0:
        bend, speed = bend - y[F.angle[c]], speed - y[half + F.angle[c]]
    return joint_moment(laws, law, bend, speed)


@in_place
def _project(F, y, half, gravity, p, part):  # type: ignore[no-untyped-def]
    """The reaction of the pendula that end with p, on the coordinates of their support."""
    c = F.carrier[p]
    bx, bz = _slope(F, y, half, c, F.where[p, 0], F.where[p, 1])
    fx, fz = _driven(part.xx, part.xz, part.zz, bx, bz - gravity)
    _push(F, c, -(part.px + fx), -(part.pz + fz))
    for k in range(F.first[c], F.first[c + 1]):
        mx, mz = _driven(part.xx, part.xz, part.zz, F.slopes[0, k], F.slopes[1, k])
        for j in range(F.first[c], k + 1):
            F.A[k, j] += F.slopes[0, j] * mx + F.slopes[1, j] * mz


@in_place
def _climb(y, links, laws, first, half, gravity, has_joint_torques, F, turns, torque):  # type: ignore[no-untyped-def]
    """The upward pass of all pendula; `torque` is that of springs between angles.  The power (W) of joints."""
    d, power = len(F.kind), 0.0
    rates, sin, cos, hx, hz, e = y[half + d : 2 * half], turns[0], turns[1], turns[2], turns[3], turns[4]
    xx = xz = zz = px = pz = 0.0
    for p in range(len(first) - 1):
        answer, hinge_below, tx, tz = Answer(0.0, 0.0, 0.0, 0.0, 0.0), 0.0, 0.0, 0.0
        c, hinge = F.carrier[p], 0.0
        for i in range(first[p + 1] - 1, first[p] - 1, -1):
            Q = 0.0
            if has_joint_torques:
                hinge, joint_power = _hinge(F, links, laws, y, half, i, first[p], c)
                Q, hinge_below, power = hinge - hinge_below, hinge, power + joint_power
            if F.pulls:
                ax, az = links[i, 1] * tx + F.loads[2, i], links[i, 1] * tz + F.loads[3, i]
                Q += torque[i] + (cos[i] * ax - sin[i] * az)
                tx, tz = tx + F.loads[0, i], tz + F.loads[1, i]
            if i == first[p + 1] - 1:
                answer, turn = _tip_response(link_at(links, i), sin[i], cos[i], rates[i], Q)
            else:
                answer, turn = _link_response(link_at(links, i), answer, sin[i], cos[i], rates[i], Q)
            share = 1.0 / turn.D
            hx[i], hz[i], e[i] = share * turn.hx, share * turn.hz, share * turn.e
        if F.angle[c] >= 0:
            F.right[F.angle[c]] -= hinge
        xx, xz, zz, px, pz = xx + answer.xx, xz + answer.xz, zz + answer.zz, px + answer.px - tx, pz + answer.pz - tz
        if p == len(first) - 2 or not F.alike[p + 1]:
            _project(F, y, half, gravity, p, Answer(xx, xz, zz, px, pz))
            xx = xz = zz = px = pz = 0.0
    return power


@in_place
def _descend(y, links, first, half, gravity, F, turns, slopes):  # type: ignore[no-untyped-def]
    """The downward pass, which gives θ''."""
    d = len(F.kind)
    rates, sin, cos, hx, hz, e = y[half + d : 2 * half], turns[0], turns[1], turns[2], turns[3], turns[4]
    startx = startz = 0.0
    for p in range(len(first) - 1):
        c = F.carrier[p]
        if not F.alike[p]:
            bx, bz = _slope(F, y, half, c, F.where[p, 0], F.where[p, 1])
            x, z = _times_slopes(F, F.right, 0, c)
            startx, startz = x + bx, z + (bz - gravity)
        ax, az = startx, startz
        for i in range(first[p], first[p + 1]):
            turn = Turn(hx[i], hz[i], e[i], 1.0, sin[i], cos[i], rates[i])
            slopes[i], ax, az = _link_acceleration(link_at(links, i), turn, ax, az)


@in_place
def rate_on_carriers(y, links, laws, first, gravity, has_joint_torques, works, F, turns, slopes):  # type: ignore[no-untyped-def]
    """The whole of `Minimal.derivative` on a structure, into `slopes`; `turns` as in `nonlinear.dynamics.compiled`."""
    d = len(F.kind)
    half = d + len(links)
    torque = slopes[half + d : 2 * half]
    for i in range(half):
        slopes[i] = y[half + i]
    power = _carrier_terms(F, y, half, gravity)
    if len(F.spring):
        if F.pulls:
            for i in range(len(links)):
                torque[i] = F.loads[0, i] = F.loads[1, i] = F.loads[2, i] = F.loads[3, i] = 0.0
            _chain_motion(F, y, links, first, half, turns[0], turns[1])
        power += _spring_forces(F, y, half, turns[0], turns[1], torque)
    power += _climb(y, links, laws, first, half, gravity, has_joint_torques, F, turns, torque)
    for c in range(len(F.angle)):
        _eliminate(F.A, F.right, F.first[c], F.first[c + 1])
    for k in range(d):
        slopes[half + k] = F.right[k]
    _descend(y, links, first, half, gravity, F, turns, torque)
    if works:
        slopes[2 * half] = power
