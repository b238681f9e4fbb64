"""Dissipation of every mode by loss angles, dry friction and quadratic drag.

For loss angles Q is 2π times the energy stored over that lost per cycle: with the elongation r_j q of every stiffness
k_j with a loss angle φ_j in the mode shape q,

    1/Q = 2ζ + Σ_j k_j φ_j(ω) |r_j q|² / (ω² qᴴ M q),

the modal strain energy [Johnson1982]: to first order in φ the ratio of the imaginary to
the real part of the eigenvalue ω² (1 + i/Q) of K (1 + iφ). Gravity stores energy without loss, so it dilutes the
bending loss of a pendulum wire.

In a mode of the conservative scene with the largest angle a, Y_j a being the amplitudes of the sliding contacts and
V_k a those of the centres of mass, a cycle costs the energies 4 M_j Y_j a and (8/3) c_k ω² V_k³ a³.  Over 4π times the
modal energy E = ½ ω² a² φᵀMφ these are damping ratios, as describing functions give them,

    ζ(a) = ζ + Σ_j M_j Y_j / (½ π ω² φᵀMφ a) + Σ_k 4 c_k V_k³ a / (3π φᵀMφ)

[Jacobsen1930], [DenHartog1956, §8.9]. Friction alone reduces the amplitude by 2 a_s in every half swing, a_s = Σ M_j
Y_j / (ω² φᵀMφ) being the largest amplitude at which it holds the mode at rest: the swing of a single joint is exactly a
harmonic one about ±a_s in turn [Lorenz1902]. For several contacts, which do not stop together, this is an estimate.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import expm1, inf, log1p, nan, pi, sqrt
from typing import NamedTuple

import numpy as np

from modal.assembly import Block, Dissipator, Hanging, centres, displacements, loss_angles, loss_at, losses_of
from modal.errors import ComputationError
from modal.modes.modes import Modes, natural_modes
from modal.modes.numbering import table_numbers
from modal.scene import Scene, validate_scene
from modal.scene.doors import checked
from modal.types import EPS, Floats

MOST_SHAPES = 60
"""Limit: shapes of one frequency among which the one that loses most is found; Q is NaN beyond."""


@checked
def mode_losses(modes: Modes, indices: Sequence[int] | None = None) -> Floats:
    """The loss angle Σ k φ |r q|²/(ω² qᴴ M q) of the modes with these indices (by default all), from their shapes.

    For a repeated frequency it is that of the combination with the largest losses. NaN if a mode has no frequency, and
    for more than MOST_SHAPES of one frequency with different losses.

    >>> from modal import Bob, Pendulum, Scene, natural_modes
    >>> scene = Scene(gravity=9.0, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0, stiffness=1.0, loss=0.01)])])
    >>> mode_losses(natural_modes(scene)).round(12).tolist()  # a tenth of the stiffness
    [0.001]
    """
    chosen = range(len(modes)) if indices is None else indices
    if not modes.scene.has_losses:
        return np.zeros(len(chosen))
    losses = losses_of(modes.scene)
    angles = loss_angles(modes.scene)
    alike = not modes.scene.is_structured and angles is not None
    alike = alike and angles.rig_of(modes.scene)[0].n_kinds == modes.rig.n_kinds  # type: ignore[union-attr]
    return np.array([_loss(modes, index, losses, alike) for index in chosen])


@checked
def quality_factors(modes: Modes, indices: Sequence[int] | None = None) -> Floats:
    """Q of the modes with these indices, by default all: infinite without losses, NaN for growing or uncertain modes.

    >>> from modal import load, natural_modes
    >>> quality_factors(natural_modes(load("chain-2")))
    array([inf, inf])
    """
    chosen = np.arange(len(modes)) if indices is None else np.asarray(indices, dtype=np.int64)
    ratio = modes.damping_ratio[chosen]
    loss_factor = 2 * ratio + mode_losses(modes, chosen.tolist())
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where((modes.omega[chosen] > 0) & (ratio >= 0) & (ratio < 1), 1 / loss_factor, np.nan)


def sharing(modes: Modes) -> list[int]:
    """Return the numbers of modes to which another is closer, relative to ω², than three times the larger loss.

    Their shapes mix, so the first order of each alone is approximate.
    """
    if not modes.scene.has_losses or len(modes) < 2:
        return []
    losses, square = np.nan_to_num(mode_losses(modes)), modes.omega**2
    is_near = np.diff(square) <= 3 * np.maximum(losses[1:], losses[:-1]) * square[1:]
    return [int(number) for number in modes.number[np.append(is_near, False) | np.append(False, is_near)]]


def _loss(modes: Modes, index: int, losses: Sequence[Dissipator], alike: bool) -> float:
    omega, copies = float(modes.omega[index]), int(modes.multiplicity[index])
    if not omega or not np.isfinite(omega):
        return float("nan")
    if copies > MOST_SHAPES and not alike:
        return float("nan")
    columns = []
    for copy in range(1 if alike else copies):
        shape = modes.shape(index, copy)
        column = modes.column(shape)
        mass = shape.modal_mass
        if np.iscomplexobj(column):
            mass = float((column.conj() @ modes.matrices.M @ column).real)
        columns.append(column / np.sqrt(mass))
    strength = np.array([lossy.stiffness * float(loss_at(lossy.loss, np.array(omega))) for lossy in losses])
    elongation = elongations(losses, np.array(columns))
    return float(np.linalg.eigvalsh((elongation.conj() * strength) @ elongation.T)[-1] / omega**2)


def elongations(losses: Sequence[Dissipator], columns: Floats) -> Floats:
    """The rows of all losses times some shapes, (shapes, losses)."""
    owner = np.repeat(np.arange(len(losses)), [len(lossy.row) for lossy in losses])
    at = np.array([column for lossy in losses for column in lossy.row], dtype=np.int64)
    entries = np.array([value for lossy in losses for value in lossy.row.values()])
    elongations = np.zeros((len(columns), len(losses)), dtype=columns.dtype)
    np.add.at(elongations.T, owner, (columns[:, at] * entries).T)
    return elongations


class Sliding(NamedTuple):
    """A mode with friction and drag: its number, ω (rad/s), linear ζ, a_s (rad), and ζ/a of quadratic drag (1/rad)."""

    mode: int
    omega: float
    linear: float
    stuck: float
    air: float

    def damping_ratio(self, amplitude: float) -> float:
        """The equivalent damping ratio ζ(a) at a largest angle a (rad)."""
        return self.linear + 2 * self.stuck / (pi * amplitude) + self.air * amplitude


class Stop(NamedTuple):
    """The stop of a mode by friction: half swings, the time (s), and the largest angle (rad) at which it may rest."""

    half_swings: float
    time: float
    within: float


def sliding_modes(scene: Scene) -> tuple[Sliding, ...]:
    """Return these of every mode that oscillates along the rail, in the order of the table.

    For a repeated frequency only the first shape counts. Raise ComputationError if the modes cannot be computed.
    """
    validate_scene(scene)
    undamped_modes, table = natural_modes(scene.conservative), natural_modes(scene)
    numbers, sliding = table_numbers(scene, undamped_modes), []
    joints, rail, weight, quadratic = _limits(scene)
    first = Hanging(undamped_modes.rig).first[:-1]
    spans = _centres(undamped_modes) if quadratic.any() else None
    for row, omega in enumerate(undamped_modes.omega.tolist()):
        shape = undamped_modes.shape(row)
        if not omega or shape.across:
            continue
        angles = np.real(shape.angles)
        cart = float(np.real(shape.cart))
        inertia, number = float(shape.modal_mass), int(numbers[row])
        relative_angles = np.abs(np.diff(angles, prepend=0.0))
        relative_angles[first] = np.abs(angles[first])
        sliding_path = joints @ relative_angles + (rail + weight) * abs(cart)
        air = 0.0
        if spans is not None:
            centre_displacements = np.hypot(cart + spans[0] @ angles, spans[1] @ angles)
            air = float(4 * (quadratic @ centre_displacements**3) / (3 * pi * inertia))
        ratio = float(-table.eigenvalue[number - 1].real / table.omega[number - 1]) if scene.has_damping else 0.0
        sliding.append(Sliding(number, omega, ratio, float(sliding_path) / (omega**2 * inertia), air))
    return tuple(sliding)


def stop_of(sliding: Sliding, amplitude: float) -> Stop:
    """Return when a mode released at rest at a largest angle (rad) finally stops; infinite without friction.

    With dampers each half swing multiplies the distance from ±a_s by exp(−πζ/√(1 − ζ²)). Quadratic drag is ignored.
    """
    ratio, stuck = sliding.linear, sliding.stuck
    if stuck <= 0 or ratio >= 1:
        return Stop(inf, inf, nan)
    rate = sliding.omega * sqrt(1 - ratio**2)
    # a half swing takes a to (a − a_s) e^−δ − a_s: in all a geometric series, of equal steps 2 a_s without dampers
    steps, delta = max(amplitude - stuck, 0.0) / (2 * stuck), pi * ratio / sqrt(1 - ratio**2)
    if delta > 0:
        steps = log1p(-expm1(-delta) * steps) / delta
    count = int(np.ceil(steps * (1 - 4 * EPS)))
    return Stop(count, count * pi / rate, stuck)


def stop_words(scene: Scene, amplitude_deg: float) -> list[str]:
    """Return a sentence for every mode stopped by friction after release at a largest angle (deg).

    Friction on the rail alone stops only the cart.
    """
    what, consequence = ("the cart", "; the swing continues as on a fixed support") if scene.is_gripped else ("it", "")
    words = []
    for sliding in sliding_modes(scene) if scene.has_friction else ():
        stop = stop_of(sliding, float(np.radians(amplitude_deg)))
        if np.isfinite(stop.time):
            words.append(
                f"mode {sliding.mode}: dry friction stops {what} after {stop.time:.4g} s "
                f"({stop.half_swings} half swings) from {amplitude_deg:g} deg, "
                f"within {np.degrees(stop.within):.3g} deg of rest{consequence}."
            )
    return words


def damping_ratios(modes: Modes, amplitude: float) -> dict[int, float]:
    """ζ(a) of the modes along the rail at a largest angle (rad), by their numbers in the table."""
    if not (scene := modes.scene).has_friction and not any(link.quadratic_drag for link in scene.links()):
        return {row.number: row.damping_ratio for row in modes if row.oscillates}
    return {sliding.mode: sliding.damping_ratio(amplitude) for sliding in sliding_modes(scene)}


def _limits(scene: Scene) -> tuple[np.ndarray, float, float, np.ndarray]:
    """Friction of every joint (L,) in N m, the rail's as a force and by its coefficient (N), and quadratic drag."""
    links = [link for pendulum in scene.hanging for link in pendulum.chain]
    joints, quadratic = (np.array([getattr(link, name) for link in links]) for name in ("friction", "quadratic_drag"))
    cart = scene.cart
    if cart is None:
        return joints, 0.0, 0.0, quadratic
    weight = scene.gravity * (cart.mass + sum(link.mass for link in links))
    return joints, cart.friction, cart.friction_coefficient * weight, quadratic


def _centres(modes: Modes) -> np.ndarray:
    """The displacement of every centre of mass along the rail, and downwards, by every angle, (2, L, L)."""
    rig, size = modes.rig, modes.scene.n_links
    if size > 4000:
        raise ComputationError(f"the drag of {size} links on modes: at most 4000 links")
    columns = [(rig.blocks[block], column) for block, column, count in rig.members for _ in range(count)]

    def sinking(chains: Block, column: int) -> Floats:
        return centres(chains, column, np.zeros_like(chains.length) if chains.sinking is None else chains.sinking)

    return np.array([displacements(columns, 0, of) for of in (centres, sinking)])
