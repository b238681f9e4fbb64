"""What dry friction and quadratic drag do to a mode: an equivalent damping ratio at an amplitude, and when it stops.

In a mode of the conservative scene with the largest angle a, Y_j a being the amplitudes of the sliding contacts and
V_k a those of the centres of mass, a cycle costs the energies 4 M_j Y_j a and (8/3) c_k ω² V_k³ a³.  Over 4π times the
modal energy E = ½ ω² a² φᵀMφ these are damping ratios, as describing functions give them,

    ζ(a) = ζ + Σ_j M_j Y_j / (½ π ω² φᵀMφ a) + Σ_k 4 c_k V_k³ a / (3π φᵀMφ)

(Jacobsen, Trans. ASME 52, APM-52-15 (1930); Den Hartog, Mechanical Vibrations, §8.9).  Friction alone takes 2 a_s from
the amplitude in every half swing, a_s = Σ M_j Y_j / (ω² φᵀMφ) being the largest amplitude at which it holds the mode at
rest: the swing of a single joint is exactly a harmonic one about ±a_s in turn (Lorenz, Lehrbuch der Technischen Physik
I, 1902).  For several contacts, which do not turn together, this is an estimate.
"""

from __future__ import annotations

from math import exp, inf, nan, pi, sqrt
from typing import NamedTuple

import numpy as np

from modal.assembly import centres
from modal.errors import ComputationError
from modal.modes.modes import Modes, natural_modes
from modal.modes.numbering import table_numbers
from modal.scene import Scene, validate_scene

MOST_HALF_SWINGS = 10_000_000


class Sliding(NamedTuple):
    """Of one mode: its number in the table, ω (rad/s), its linear ζ, a_s (rad), and ζ/a of quadratic drag (1/rad)."""

    mode: int
    omega: float
    linear: float
    stuck: float
    air: float

    def damping_ratio(self, amplitude: float) -> float:
        """The equivalent damping ratio ζ(a) at a largest angle a (rad)."""
        return self.linear + 2 * self.stuck / (pi * amplitude) + self.air * amplitude


class Stop(NamedTuple):
    """When friction stops a mode: half swings, the time (s), and the largest angle (rad) at which it may rest."""

    half_swings: float
    time: float
    within: float


def sliding_modes(scene: Scene) -> tuple[Sliding, ...]:
    """Of every mode that oscillates along the rail with its cart and links, in the order of the table.

    Of modes of one frequency only the first shape counts.  ComputationError where the modes cannot be had.
    """
    validate_scene(scene)
    still, table = natural_modes(scene.conservative), natural_modes(scene)
    numbers, sliding = table_numbers(scene, still), []
    joints, rail, weight, quadratic = _limits(scene)
    spans = _centres(still) if quadratic.any() else None
    for row, omega in enumerate(still.omega.tolist()):
        shape = still.shape(row)
        if not omega or shape.across:
            continue
        angles = np.real(shape.angles)
        cart = float(np.real(shape.cart))
        inertia, number = float(shape.modal_mass), int(numbers[row])
        turned = np.abs(_relative(scene, angles))
        slid = joints @ turned + (rail + weight) * abs(cart)
        air = 0.0
        if spans is not None:
            moved = np.hypot(cart + spans[0] @ angles, spans[1] @ angles)
            air = float(4 * (quadratic @ moved**3) / (3 * pi * inertia))
        ratio = float(-table.eigenvalue[number - 1].real / table.omega[number - 1]) if scene.has_damping else 0.0
        sliding.append(Sliding(number, omega, ratio, float(slid) / (omega**2 * inertia), air))
    return tuple(sliding)


def stop_of(sliding: Sliding, amplitude: float) -> Stop:
    """When a mode let go at rest at a largest angle (rad) comes to rest for good; infinite without friction.

    With dampers each half swing multiplies the distance from ±a_s by exp(−πζ/√(1 − ζ²)).  Quadratic drag is left out.
    """
    ratio, stuck = sliding.linear, sliding.stuck
    if stuck <= 0 or ratio >= 1:
        return Stop(inf, inf, nan)
    rate = sliding.omega * sqrt(1 - ratio**2)
    shrink, count = exp(-pi * ratio / sqrt(1 - ratio**2)), 0
    while amplitude > stuck and count < MOST_HALF_SWINGS:
        if ratio <= 0:
            count = int(np.ceil((amplitude - stuck) / (2 * stuck) * (1 - 1e-15)))
            break
        amplitude = abs((amplitude - stuck) * shrink - stuck)
        count += 1
    return Stop(count, count * pi / rate, stuck)


def stop_words(scene: Scene, amplitude_deg: float) -> list[str]:
    """A sentence for every mode that friction stops, let go at a largest angle (deg).

    Friction on the rail alone stops the cart: its work ends there.
    """
    what, after = ("the cart", "; the swing goes on as on a fixed support") if scene.is_gripped else ("it", "")
    words = []
    for sliding in sliding_modes(scene) if scene.has_friction else ():
        stop = stop_of(sliding, float(np.radians(amplitude_deg)))
        if np.isfinite(stop.time):
            words.append(
                f"mode {sliding.mode}: dry friction stops {what} after {stop.time:.4g} s "
                f"({stop.half_swings} half swings) from {amplitude_deg:g} deg, "
                f"within {np.degrees(stop.within):.3g} deg of rest{after}."
            )
    return words


def damping_ratios(modes: Modes, amplitude: float) -> dict[int, float]:
    """ζ(a) of the modes along the rail at a largest angle (rad), by their numbers in the table."""
    if not (scene := modes.scene).has_friction and not any(link.quadratic_drag for link in scene.links()):
        return {row.number: row.damping_ratio for row in modes if row.oscillates}
    return {sliding.mode: sliding.damping_ratio(amplitude) for sliding in sliding_modes(scene)}


def _limits(scene: Scene) -> tuple[np.ndarray, float, float, np.ndarray]:
    """Friction of every joint (L,) in N m, the rail's as a force and by its coefficient (N), and quadratic drag."""
    links = [
        link
        for pendulum in scene.pendulum
        for _ in range(pendulum.count)
        for link in pendulum.links
        for _ in range(link.count)
    ]
    joints, quadratic = (np.array([getattr(link, name) for link in links]) for name in ("friction", "quadratic_drag"))
    cart = scene.cart
    if cart is None:
        return joints, 0.0, 0.0, quadratic
    weight = scene.gravity * (cart.mass + sum(link.mass for link in links))
    return joints, cart.friction, cart.friction_coefficient * weight, quadratic


def _relative(scene: Scene, angles: np.ndarray) -> np.ndarray:
    """The angle of every link relative to the one above, (L,)."""
    relative, at = angles.copy(), 0
    for pendulum in scene.pendulum:
        for _ in range(pendulum.count):
            links = slice(at, at + pendulum.n_links)
            relative[links] = np.diff(angles[links], prepend=0.0)
            at += pendulum.n_links
    return relative


def _centres(modes: Modes) -> np.ndarray:
    """The displacement of every centre of mass along the rail, and downwards, by every angle, (2, L, L)."""
    rig, size = modes.rig, modes.scene.n_links
    if size > 4000:
        raise ComputationError(f"the drag of {size} links on modes: at most 4000 links")
    rows, at = np.zeros((2, size, size)), 0
    for block, column, count in rig.members:
        for _ in range(count):
            each = rig.blocks[block]
            links = slice(at, at + each.n)
            rows[0, links, links] = centres(each, column)
            if each.sinking is not None:
                rows[1, links, links] = centres(each, column, each.sinking)
            at += each.n
    return rows
