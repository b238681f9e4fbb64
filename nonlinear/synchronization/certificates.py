"""Configurations and critical values on the full equations: periodic orbits next to the averaged ones.

An averaged configuration is where Newton's method begins; the Floquet multipliers of the orbit that it finds tell the
stability.  At a critical value of a branch the orbits are followed across it, and the fold, branch point or torus is
located.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from modal.errors import ComputationError
from modal.scene import Scene, refusals
from modal.scene.parameters import Variation
from modal.types import Floats
from nonlinear.averaging import RelativeEquilibrium, swinging
from nonlinear.integration import Trajectory
from nonlinear.orbits import Orbit, Special, cycle_of, first_special_point, last_swing, periodic_orbit
from nonlinear.orbits.cycles import is_same_orbit
from nonlinear.orbits.floquet import CIRCLE_EXCESS_MAX, PAIR_SPLIT_MIN
from nonlinear.orbits.orbit import ORBIT_RESIDUAL_MAX
from nonlinear.synchronization.patterns import own_amplitudes
from nonlinear.system import State, unwound

CERTIFIED_LINKS_MAX = 24
"""Limit: "limit cycles are computed of up to 24" links."""
AVERAGED_FREQUENCY_ERROR = 0.1
"""Physics: largest relative difference of an orbit's frequency from the averaged one, of first order; of its amplitude,
which is of second order in the frequency, three times as much."""
MARGINS = (0.01, 0.05, 0.2)
"""Cost: of the range: how far from a critical value orbits begin, in turn; benchmarks/sync/survivors.py."""


def certified_orbit(scene: Scene, equilibrium: RelativeEquilibrium) -> Orbit | None:
    """The periodic orbit of a configuration, None if none was found close to it."""
    if not _periodic(scene, equilibrium):
        return None
    try:
        orbit = cycle_of(scene, equilibrium)
    except ComputationError:
        return None
    amplitude = float(equilibrium.averaged.largest(equilibrium.z))
    is_close = (
        abs(orbit.omega / equilibrium.omega - 1) < AVERAGED_FREQUENCY_ERROR
        and abs(orbit.amplitude / amplitude - 1) < 3 * AVERAGED_FREQUENCY_ERROR
        and np.abs(own_amplitudes(equilibrium)).max() > 0
    )
    return orbit if is_close else None


def with_distinct_orbits(
    pairs: Iterable[tuple[RelativeEquilibrium, Orbit | None]],
) -> tuple[tuple[RelativeEquilibrium, Orbit | None], ...]:
    """Configurations with their orbits, and of several next to one and the same orbit the first."""
    first: list[tuple[RelativeEquilibrium, Orbit | None]] = []
    for state, orbit in pairs:
        if orbit is None or not any(neighbour and is_same_orbit(orbit, neighbour) for _, neighbour in first):
            first.append((state, orbit))
    return tuple(first)


def orbit_at_the_end(trajectory: Trajectory, within: float = 0.05) -> Orbit | None:
    """The stable periodic orbit in which a run ends, None if its end is not `within` this part of one.

    Newton's method begins at the last state, so that a motion which converges slowly need not be waited for; the
    multipliers of the orbit show that it does converge.  The orbit may be one of a family, as of two pairs of clocks in
    antiphase with any phase between the pairs: multipliers are 1 along the family, to which neighbours converge.
    """
    if certificate_refusal(trajectory.scene):
        return None
    final = unwound(trajectory.final)
    for rcond in (None, PAIR_SPLIT_MIN):  # the second along families
        try:
            period = last_swing(trajectory.times, trajectory.motion)
            orbit = periodic_orbit(trajectory.scene, final, period, rcond=rcond)
        except ComputationError:
            continue
        is_closed = orbit.residual < ORBIT_RESIDUAL_MAX < orbit.amplitude
        is_stable = np.abs(orbit.floquet.others).max(initial=0.0) < 1 + CIRCLE_EXCESS_MAX
        if is_closed and is_stable and _distance(orbit, final) <= within * orbit.amplitude:
            return orbit
    return None


def _distance(orbit: Orbit, state: State) -> float:
    """How far a state is from an orbit (rad): the largest angle θ, or θ'/ω, of any link, across the orbit."""
    angles = orbit.coordinates[:, orbit.flow.equations.layout.first :]
    rates = (np.roll(angles, -1, axis=0) - np.roll(angles, 1, axis=0)) * (len(angles) / (4 * np.pi))
    aside = np.angle(np.exp(1j * (state.links - angles)))
    differences = np.hstack((aside, state.link_rates / orbit.omega - rates))
    nearest = int(np.linalg.norm(differences, axis=1).argmin())
    difference, curve = differences[nearest], np.hstack((angles, rates))
    along = np.roll(curve, -1, axis=0)[nearest] - np.roll(curve, 1, axis=0)[nearest]
    return float(np.abs(difference - along * (difference @ along) / (along @ along)).max())


def certificate_refusal(scene: Scene) -> str:
    """Why no periodic orbit of a scene in the plane is looked for; "" where they are."""
    if scene.n_links > CERTIFIED_LINKS_MAX:
        return f"{scene.n_links} links: limit cycles are computed of up to {CERTIFIED_LINKS_MAX}"
    return "; ".join(refusals(scene, "a periodic orbit"))


def _periodic(scene: Scene, equilibrium: RelativeEquilibrium) -> bool:
    return not certificate_refusal(scene) and len(swinging(equilibrium.averaged, equilibrium.z)) == 1


def critical_point(
    scene: Scene, variation: Variation, states: Sequence[RelativeEquilibrium], values: Floats, at: float
) -> Special | None:
    """The fold, branch point, period doubling or torus of the orbits next to a critical value of a branch.

    None if none was found: where a branch dies out, or next to several frequencies.
    """
    span = abs(_coordinate(variation, variation.values[-1]) - _coordinate(variation, variation.values[0]))
    off = np.array([abs(_coordinate(variation, value) - _coordinate(variation, at)) for value in values])
    tried_states: set[int] = set()
    for share in MARGINS:
        candidates = np.flatnonzero(off >= share * span)
        if (
            not candidates.size
            or (k := int(candidates[off[candidates].argmin()])) in tried_states
            or not _periodic(scene, states[k])
        ):
            continue
        tried_states.add(k)
        if special := special_point_beyond(scene, variation, states[k], float(values[k]), at):
            return special
    return None


def special_point_beyond(
    scene: Scene, variation: Variation, state: RelativeEquilibrium, value: float, at: float
) -> Special | None:
    """The first special point on the orbits that begin next to a configuration at a value, towards another value.

    None if there is none, also where that is the same value.
    """
    try:
        return None if at == value else first_special_point(scene, variation, state, value, at)
    except ComputationError:
        return None


def _coordinate(variation: Variation, value: float) -> float:
    return float(np.log(value)) if variation.log else value
