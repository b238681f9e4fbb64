"""The modal coordinates of a motion: the contribution of each mode at every time.

With q = (x, θ − rest), v = q' and the shapes φ of an undamped scene, orthogonal in M, the modal coordinates are

    η_r = φ_rᵀ M q / φ_rᵀ M φ_r,     q = Σ_r φ_r η_r.

With dampers, shapes and eigenvalues are complex.  They are orthogonal in the first-order form of the equations
[Tisseur2001, §3.5], which separates even modes that dampers couple:

    z_r = φ_rᵀ [(λ_r M + D) q + M v] / φ_rᵀ (2 λ_r M + D) φ_r,     q = Σ_r 2 Re φ_r z_r,     η_r = 2 Re z_r,

a z_r without a conjugate (λ_r real) counting once.  For D = 0 and λ = iω both agree.  In linear motion every
z_r varies as exp(λ_r t).  Modes that share an eigenvalue are separated by their small Gram matrix.  A translation that
no damper brakes, λ = 0 and Dφ = 0, is a double eigenvalue with one shape: its η and η' are separate, by the first form,
because φᵀM q' is its momentum, which every other mode leaves at 0.

Conversion between a motion in space and two motions in vertical planes, exact for small angles.

With θ from equilibrium and p = θ (cos φ, sin φ) along the rail and across it, s = sin θ/θ, σ = −1 for inverted links:

    u = σ (s p, cos θ),    u' = σ (s p' + r (p·p') p, −s p·p'),    r = (θ cos θ − sin θ)/θ³

so that p is an angle in the plane relative to equilibrium; for an inverted link it has the opposite sign.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import radians
from typing import Any

import numpy as np

from modal.assembly import Matrices, equilibrium_of
from modal.errors import ComputationError, SceneError
from modal.modes import UNCERTAIN, Modes, table_numbers
from modal.report import Displayed
from modal.scene import Scene, validate_scene
from modal.scene.doors import checked, checked_index
from modal.types import Complexes, Floats, Ints
from nonlinear.integration import modes_of
from nonlinear.system import Layout, Motion, State, has_start, initial_state, of_plane, system_of

USUAL_DEG = 5.0
"""Limit: the usual start, which `start` replaces: the largest angle of any link."""


@dataclass(frozen=True, eq=False, repr=False)
class ModalMotion(Displayed):
    """C modal coordinates of a motion at T times, with `number` and `copy` (C,) of the shapes, both from 0.

    `coordinate` η and `rate` η' (T, C) are in rad and rad/s of the largest angle (in m of the cart where the shape has
    no angle).  `displacement` q and `velocity` v (T, n) are the whole motion about equilibrium, `shapes` (n, C) the φ.
    """

    what = "Modal coordinates of a motion"
    shows = "number: modes counted from 0; coordinate: coordinates; rate: rates"

    modes: Modes
    matrices: Matrices
    number: Ints
    copy: Ints
    shapes: Complexes
    coordinate: Floats
    rate: Floats
    displacement: Floats
    velocity: Floats

    @cached_property
    def energy(self) -> Floats:
        """Energy (J) that each mode would have by itself, (T, C): ½ m_r (η'² + ω_r² η²) for an undamped scene."""
        parts = [self._energy(*self.part(at)) for at in range(len(self.number))]
        return np.stack(parts, axis=1)

    @cached_property
    def total_energy(self) -> Floats:
        """½ vᵀMv + ½ qᵀKq (J), the energy of the whole motion to second order in the angles, (T,)."""
        return self._energy(self.displacement, self.velocity)

    def part(self, at: int) -> tuple[Floats, Floats]:
        """The contribution of the at-th coordinate to q and v, (T, n)."""
        value = self.modes.eigenvalue[self.number[at]]
        phi, eta, rate = self.shapes[:, at], self.coordinate[:, at], self.rate[:, at]
        if phi.imag.any() and value.imag:
            imaginary = (value.real * eta - rate) / value.imag
            z = (eta + 1j * imaginary)[:, None] * phi
            return z.real, (value * z).real
        return np.outer(eta, phi.real), np.outer(rate, phi.real)

    def share_outside(self, at: int) -> Floats:
        """Fraction of the energy outside the at-th mode, (T,)."""
        part, speed = self.part(at)
        return self._energy(self.displacement - part, self.velocity - speed) / self.total_energy

    def _energy(self, q: Floats, v: Floats) -> Floats:
        M, K = self.matrices.M, self.matrices.K
        return np.asarray((np.sum(v @ M * v, axis=1) + np.sum(q @ K * q, axis=1)) / 2)


def modal_motion(motion: Motion, modes: Modes, numbers: Sequence[int] | None = None) -> ModalMotion:
    """Project a motion in the plane on the modes with these indices (from 0; by default all), all copies of each.

    For a scene in space the modes along the rail are used, which lie in the plane. Raise ComputationError for a motion
    out of the plane and for more coordinates than `modal.assembly.linearization` assembles.
    """
    q, v = deflection(modes.scene, motion)
    linear = modes.matrices
    rows = range(len(modes)) if numbers is None else numbers
    mode_shapes = [(number, *along_rail(modes, number)) for number in rows]
    D = None if modes.is_classical or not linear.D.any() else linear.D
    coordinates = [_project(linear.M, D, modes.eigenvalue[number], phi, q, v) for number, _, phi in mode_shapes]
    none = np.zeros((len(q), 0))
    number = np.array([number for number, copies, _ in mode_shapes for _ in copies], dtype=np.int64)
    copy = np.array([copy for _, copies, _ in mode_shapes for copy in copies], dtype=np.int64)
    shapes = np.hstack([np.zeros((q.shape[1], 0)), *(phi for _, _, phi in mode_shapes)]).astype(complex)
    eta, rate = (np.hstack([none, *(pair[k] for pair in coordinates)]) for k in (0, 1))
    return ModalMotion(modes, linear, number, copy, shapes, eta, rate, q, v)


@checked
def deflection(scene: Scene, motion: Motion) -> tuple[Floats, Floats]:
    """The q and v (T, n): the cart or the structure, then every link's angle, from the equilibrium."""
    if motion.links.ndim != 2:
        raise ComputationError("modal coordinates: only for motion in the plane")
    q, v = np.split(layout_of(scene).rows(motion), 2, axis=1)
    return q - rest_coordinates(scene), v


def layout_of(scene: Scene) -> Layout:
    """The arrangement of (q, v) in the plane."""
    return Layout.of(system_of(scene), works=False)


def rest_angles(scene: Scene) -> Floats:
    """Equilibrium angle (L,) of every link: 0 hanging, π inverted, or where constant forces move it."""
    validate_scene(scene)
    if equilibrium := equilibrium_of(scene):
        return equilibrium.rest.angle
    ways = [way for pendulum in scene.pendulum for _ in range(pendulum.count) for way in pendulum.ways]
    return np.where(np.array(ways) == "up", np.pi, 0.0)


def rest_coordinates(scene: Scene) -> Floats:
    """The q (n,) at equilibrium: the displacement (m) of a cart is 0, or where constant forces move it."""
    angles, equilibrium = rest_angles(scene), equilibrium_of(scene)
    on_supports = np.zeros(layout_of(scene).half - len(angles))
    if equilibrium and scene.cart is not None:
        on_supports[0] = equilibrium.cart
    return np.concatenate((on_supports, angles))


@checked
def along_rail(modes: Modes, number: int) -> tuple[list[int], Any]:
    """The copies (from 0) of a mode that move along the rail, and their shapes (n, copies)."""
    checked_index("number", number, 0, len(modes) - 1)
    shapes = [modes.shape(number, copy) for copy in range(int(modes.multiplicity[number]))]
    copies = [copy for copy, shape in enumerate(shapes) if not shape.across]
    vectors = [modes.column(shapes[copy]) for copy in copies]
    size = modes.scene.n_links + modes.on_cart
    return copies, np.array(vectors).T if copies else np.zeros((size, 0))


def _project(M: Floats, D: Floats | None, value: complex, phi: Any, q: Floats, v: Floats) -> tuple[Floats, Floats]:
    """η and η' (T, copies); D is None where dampers leave the undamped shapes as they are."""
    if D is None or not (value or (D @ phi).any()):
        dual = M @ np.linalg.solve(phi.T @ M @ phi, phi.T).T
        return q @ dual, v @ dual
    weight = value * M + D
    dual = np.linalg.solve(phi.T @ (weight + value * M) @ phi, phi.T).T
    z = (1 + (value.imag != 0)) * (q @ (weight @ dual) + v @ (M @ dual))
    return z.real, (value * z).real


@checked
def start_in_mode(scene: Scene, modes: Modes, number: int, copy: int = 0, amplitude: float = 0.1) -> State:
    """A start in the copy-th shape of the mode with index `number`, both from 0, with largest angle `amplitude` (rad).

    It is at rest, except that a damped mode starts with its own velocities, Re λφ, to exclude other modes. For a shape
    without angles the cart is displaced by `amplitude` m. Raise ComputationError for a shape across the rail.
    """
    checked_index("number", number, 0, len(modes) - 1)
    checked_index("copy", copy, 0, int(modes.multiplicity[number]) - 1)
    shape = modes.shape(number, copy)
    if shape.across:
        raise ComputationError(f"mode {number + 1}: shape {copy + 1} moves across the rail")
    value = modes.eigenvalue[number] if scene.has_damping else 0.0
    cart, angles, supports = amplitude * complex(shape.cart), amplitude * shape.angles, amplitude * shape.supports
    return State(
        links=modes.rig.rest_angles + angles.real,
        link_rates=(value * angles).real + np.zeros(len(angles)),
        cart=modes.rig.cart_rest + cart.real,
        cart_rate=(value * cart).real,
        supports=np.real(supports) + 0.0,
        support_rates=np.real(value * supports) + 0.0,
    )


@checked
def first_that_swings(scene: Scene, *, undamped: bool = False) -> int:
    """The number in the table of the first mode that swings along the rail; SceneError if there is none.

    `undamped` asks for one that swings without the dampers.
    """
    modes = modes_of(scene.conservative if undamped else scene)
    is_along = np.array([any(part.along_count for part in parts) for parts in modes.spectrum.groups])
    swings = (modes.eigenvalue.imag > 0) & (modes.error < UNCERTAIN) & is_along
    numbers = table_numbers(scene)[swings] if undamped else 1 + np.flatnonzero(swings)
    if not numbers.size:
        raise SceneError(["no pendulum has a start, and no mode swings"])
    return int(numbers.min())


@checked
def copy_along(modes: Modes, row: int) -> int:
    """The index of the first shape along the rail, of those that share a frequency; 0 if all are across.

    >>> from modal import load, natural_modes
    >>> copy_along(natural_modes(load("chain-spatial")), 0)
    0
    """
    checked_index("row", row, 0, len(modes) - 1)
    copies = range(int(modes.multiplicity[row]))
    return next((copy for copy in copies if not modes.shape(row, copy).across), 0)


def usual_start(scene: Scene) -> State:
    """The start in the scene file, or else the first mode that swings along the rail, its largest angle USUAL_DEG.

    >>> from math import degrees
    >>> from modal import load
    >>> from nonlinear.reduction import usual_start
    >>> float(round(degrees(abs(usual_start(load("rope")).links).max()), 9))
    5.0
    """
    validate_scene(scene)
    if has_start(scene):
        return initial_state(scene)
    modes, row = modes_of(scene), first_that_swings(scene) - 1
    state = start_in_mode(scene, modes, row, copy_along(modes, row), radians(USUAL_DEG))
    return state if scene.space == "plane" else of_plane(state)


SERIES_ANGLE = 0.02
"""Tolerance: rad, below which series replace quotients, whose digits cancel: an error of 1e-13 on either side."""


def split(scene: Scene, start: State) -> tuple[State, State]:
    """The plane states along the rail, with the cart, and across it."""
    rest = rest_angles(scene)
    u, w = (np.cos(rest)[:, None] * part for part in (start.links, start.link_rates))
    theta = np.arctan2(np.hypot(u[:, 0], u[:, 1]), u[:, 2])
    s, r = (part[:, None] for part in factors(theta))
    p = u[:, :2] / s
    rate = (w[:, :2] + r / s * w[:, 2:] * p) / s
    along = State(rest + p[:, 0], rate[:, 0], start.cart, start.cart_rate)
    return along, State(rest + p[:, 1], rate[:, 1])


def join(scene: Scene, along: Motion, across: Motion) -> Motion:
    """Unit vectors (T, L, 3) and their rates."""
    rest = rest_angles(scene)
    p = np.stack((along.links - rest, across.links - rest), axis=-1)
    rate = np.stack((along.link_rates, across.link_rates), axis=-1)
    theta, sigma = np.linalg.norm(p, axis=-1), np.cos(rest)[:, None]
    s, r = factors(theta)
    inner = np.sum(p * rate, axis=-1)
    u = sigma * np.concatenate((s[..., None] * p, np.cos(theta)[..., None]), axis=-1)
    flat = s[..., None] * rate + (r * inner)[..., None] * p
    w = sigma * np.concatenate((flat, (-s * inner)[..., None]), axis=-1)
    return Motion(u, w, along.cart, along.cart_rate, along.work)


def factors(theta: Floats) -> tuple[Floats, Floats]:
    """The s and r of angles θ ≥ 0 (rad)."""
    is_small = theta < SERIES_ANGLE
    safe = np.where(is_small, 1.0, theta)
    r = (safe * np.cos(safe) - np.sin(safe)) / safe**3
    series = -1 / 3 + theta**2 / 30 - theta**4 / 840
    return np.sinc(theta / np.pi), np.where(is_small, series, r)
