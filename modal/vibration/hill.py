"""Hill's equations: small angles of pendula on a support with a vertical sine motion.

Pendula on such a support are not coupled. In the modal coordinates y of one, φᵀMφ = 1, over the phase τ = Ωt of a
displacement −A cos τ upwards,

    y'' + (D/Ω + A |sin τ| E) y' + (ω²/Ω² + A P cos τ + (A/Ω) S sin τ + A² Q |sin τ| sin τ) y = 0

P is that of the sums p_i = σ_i b_i; the air that streams past a centre presses on it with (d + q |v|) v, drag d and
quadratic drag q, as its weight does: S and Q are P with d and q in place of masses, and E the damping of q |v| next to
that of d in D. Without springs at joints P = ω²/g is diagonal, and without dampers every mode obeys an equation of its
own, Mathieu's. Coordinates that nothing couples are separate systems here.

The matrices are analytic on each half of the period: both halves are integrated by Taylor series, many pairs (A, Ω) at
once, also complex ones, whose imaginary parts carry derivatives.  Without losses the motion is reversible and
symplectic: with the first half N = [a b; c d] and R = diag(1, −1), the monodromy matrix is R N⁻¹ R N, so that its
half-traces, the (μ + 1/μ)/2, are the eigenvalues of dᵀa + bᵀc = 1 + 2 bᵀc = 2 dᵀa − 1 (of one angle:
[Magnus1966, §1.2]).

Solutions grow where a Floquet multiplier μ, an eigenvalue of the matrix that takes (θ, θ') across one period, lies
outside the unit circle: with the period of the support where μ > 1, with twice the period where μ < −1, and with two
frequencies that add up to a multiple of the support's, or differ by one, where μ is complex
[Yakubovich1975, chapter V].  The unstable regions of Mathieu's equation are the tongues of the chart of Ince and Strutt
[McLachlan1947, §4.10], and an inverted pendulum stands where a²Ω² exceeds about 2 g l [Kapitza1951], [Landau1976, §30].
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import reduce
from math import ceil, log, log2, pi, tau
from typing import Any

import numpy as np
from numpy.typing import NDArray

from modal.assembly import matrices, quadratic_drags, rig_of
from modal.errors import ComputationError, SceneError, refuse_any
from modal.report import Displayed, Summary, brief
from modal.scene import Scene, SineMotion, require, validate_scene, validate_scenes
from modal.statespace.geometry import geometry_of
from modal.structure import hung_masses, structure_of, weights
from modal.types import NOISE_OF_SUM, NUMBERS_IN_CHUNK, Booleans, Complexes, Floats

ORDER = 28
"""Tolerance: terms of a series; the remainder of a step, REACH^ORDER/ORDER! = 5e-19, is below rounding."""
REACH = 2.5
"""Tolerance: most radians of the fastest oscillation in a step of the series."""
Numbers = NDArray[Any]
"""Real ones, or complex ones with derivatives in their imaginary parts."""


CERTAIN_DISTANCE = 1e-9
"""Tolerance: distance from 1 above which |μ| counts as larger or smaller."""
COUPLED_DISTANCE = 1e-7
"""Tolerance: the same of modes that couple without losses, whose multipliers have half of all digits where two meet."""
KINDS = {
    -1: "decays",
    0: "neutral",
    1: "grows at the frequency",
    2: "grows at half the frequency",
    3: "grows at a combination",
}
"""What small angles do, by number: the periods of the support after which a growing motion repeats but for its size, 3
where it never does."""


@dataclass(frozen=True, eq=False)
class HillSystem:
    """Modes that couple to each other, of `count` equal pendula.

    `square` are the ω² (m,), negative of those that fall over; P, D, S, Q and E are (m, m).
    """

    count: int
    square: Floats
    P: Floats
    D: Floats
    S: Floats
    Q: Floats
    E: Floats

    @property
    def size(self) -> int:
        """Number of modes."""
        return len(self.square)

    @property
    def is_reversible(self) -> bool:
        """Whether there are no losses."""
        return not any(part.any() for part in (self.D, self.S, self.Q, self.E))

    def monodromy(self, amplitude: Numbers, omega: Numbers) -> Numbers:
        """The matrices (B, 2m, 2m) that take (y, y') across one period, of amplitudes (m) and Ω (rad/s), both (B,)."""
        first = self.half(amplitude, omega, 1)
        if not self.is_reversible:
            return np.asarray(self.half(amplitude, omega, -1) @ first)
        a, b, c, d = quarters(first)
        return np.block([[_t(d) @ a + _t(b) @ c, 2 * _t(d) @ b], [2 * _t(c) @ a, _t(c) @ b + _t(a) @ d]])

    def half(self, amplitude: Numbers, omega: Numbers, sign: int) -> Numbers:
        """The matrices (B, 2m, 2m) across the first half of the period (sign 1) or the second (−1)."""
        amplitude, omega = np.broadcast_arrays(amplitude, omega)
        size = 2 * self.size
        matrices = np.empty((amplitude.size, size, size), dtype=np.result_type(amplitude, omega, np.float64))
        steps = self._steps(np.abs(amplitude), np.abs(omega))
        for count in np.unique(steps):
            alike, room = np.flatnonzero(steps == count), max(1, NUMBERS_IN_CHUNK // (ORDER * size**2 * count))
            for part in np.split(alike, range(room, len(alike), room)):
                matrices[part] = self._half_period_matrix(amplitude[part], omega[part], sign, int(count))
        return matrices

    def _steps(self, amplitude: Floats, omega: Floats) -> NDArray[np.int64]:
        """Steps of half a period, few different numbers of them."""
        size = {name: _norm(getattr(self, name)) for name in "PSQE"}
        square = np.abs(self.square).max() / omega**2 + amplitude * (size["P"] + size["S"] / omega)
        rate = np.sqrt(square + amplitude**2 * size["Q"]) + _norm(self.D) / omega + amplitude * size["E"]
        bounds = np.maximum(4, rate * pi / REACH)
        return np.array([ceil(2 ** (ceil(2 * log2(limit)) / 2)) for limit in bounds], dtype=np.int64)

    def _half_period_matrix(self, amplitude: Numbers, omega: Numbers, sign: int, count: int) -> Numbers:
        """The product of the matrices of all steps, of which many are computed at once."""
        room = max(1, NUMBERS_IN_CHUNK // (ORDER * 4 * self.size**2 * amplitude.size))
        portions = np.split(np.arange(count), range(room, count, room))
        steps = (self._steps_at(portion * pi / count, pi / count, amplitude, omega, sign) for portion in portions)
        return np.asarray(
            reduce(lambda product, factor: factor @ product, (matrix for portion in steps for matrix in portion))
        )

    def _steps_at(self, phase: Floats, step: float, amplitude: Numbers, omega: Numbers, sign: int) -> Numbers:
        """The matrices (K, B, 2m, 2m) across steps from these phases (K,) of the half period."""
        m, k = self.size, np.arange(ORDER + 1)
        A, rate = amplitude[:, None, None], 1 / omega[:, None, None]
        powers = np.cumprod(np.concatenate(([1.0], step / k[1:])))
        angle = phase[:, None] + k * pi / 2 + (0.0 if sign > 0 else pi)
        cosine: Numbers = np.cos(angle) * powers
        sine: Numbers = np.sin(angle) * powers
        absolute, stiffness = sign * sine, self.square[:, None] * rate**2
        square: Numbers = np.array([np.convolve(*factors)[: ORDER + 1] for factors in zip(absolute, sine, strict=True)])
        Y, V = np.zeros((2, len(phase), ORDER + 1, len(A), m, 2 * m), dtype=A.dtype)
        Y[:, 0, :, :, :m] = V[:, 0, :, :, m:] = np.eye(m)
        for j in range(ORDER):
            force: Any = stiffness * Y[:, j] + A * (self.P @ _product(cosine, Y, j))
            if not self.is_reversible:
                force += rate * (self.D @ V[:, j]) + A * rate * (self.S @ _product(sine, Y, j))
            if self.E.any():
                force += A * (self.E @ _product(absolute, V, j)) + A**2 * (self.Q @ _product(square, Y, j))
            Y[:, j + 1], V[:, j + 1] = V[:, j] * (step / (j + 1)), force * (-step / (j + 1))
        return np.concatenate((Y.sum(axis=1), V.sum(axis=1)), axis=2)

    def traces(self, amplitude: Numbers, omega: Numbers) -> Numbers:
        """Matrices (B, m, m) whose eigenvalues are (μ + 1/μ)/2 of all multipliers, where nothing takes energy out."""
        _, b, c, _ = quarters(self.half(amplitude, omega, 1))
        return np.asarray(np.eye(self.size) + 2 * _t(b) @ c)

    def multipliers(self, amplitude: Floats, omega: Floats) -> Complexes:
        """Floquet multipliers (B, 2m) at amplitudes (m) and Ω (rad/s), both (B,), in no order."""
        if not self.is_reversible:
            return np.linalg.eigvals(self.monodromy(amplitude, omega)).astype(np.complex128)
        if self.size > 1:
            trace = np.linalg.eigvals(self.traces(amplitude, omega)).astype(np.complex128)
            root = np.sqrt(trace - 1) * np.sqrt(trace + 1)
        else:
            a, b, c, d = (part[:, 0] for part in quarters(self.half(amplitude, omega, 1)))
            trace, root = 1 + 2 * b * c + 0j, 2 * np.sqrt(a * b * c * d + 0j)
        larger = np.where(np.abs(trace + root) >= np.abs(trace - root), trace + root, trace - root)
        return np.concatenate((larger, 1 / larger), axis=1)


def quarters(N: Numbers) -> tuple[Numbers, Numbers, Numbers, Numbers]:
    """a, b, c and d of matrices [a b; c d]."""
    m = N.shape[-1] // 2
    return N[..., :m, :m], N[..., :m, m:], N[..., m:, :m], N[..., m:, m:]


def _product(series: Numbers, Y: Numbers, j: int) -> Numbers:
    """Coefficient j of the product of series of numbers (K, J) and of matrices (K, J, ...)."""
    terms = Y[:, : j + 1].reshape(len(Y), j + 1, -1)
    return (series[:, None, j::-1] @ terms).reshape(len(Y), *Y.shape[2:])


def _t(part: Numbers) -> Numbers:
    return np.swapaxes(part, -1, -2)


def _norm(part: Floats) -> float:
    return float(np.linalg.norm(part, 2))


# ----------------------------------------------------------------------------------------------------- from a scene


def vertical_sine(scene: Scene) -> SineMotion:
    """The vertical motion of a scene's support; raise SceneError for what Floquet multipliers do not take.

    >>> from modal import Bob, Pendulum, Scene
    >>> from modal.scene import Moved, SineMotion
    >>> shaken = Moved(motion=SineMotion(direction="vertical", amplitude=0.02, frequency_hz=2.0))
    >>> vertical_sine(Scene(gravity=9.81, support=shaken, pendulum=[Pendulum(links=[Bob(mass=1, length=1)])])).amplitude
    0.02
    """
    validate_scene(scene)
    require(scene, "a Floquet multiplier")
    at = f"{scene.motion_places[0][0]}.motion"
    vertical = next((motion for motion in scene.motions if motion.direction == "vertical"), None)
    if not isinstance(vertical, SineMotion):
        what = "moves along the rail only" if vertical is None else f'moves vertically with kind = "{vertical.kind}"'
        raise SceneError([f'{at}: a Floquet multiplier needs a vertical motion of kind = "sine": this {what}'])
    if len(scene.motions) > 1 and "quadratic_drag" in scene.features:
        raise SceneError(
            [f"{at}: quadratic drag couples both motions: a Floquet multiplier takes a vertical one alone"]
        )
    return vertical


def hill_systems(scene: Scene) -> tuple[HillSystem, ...]:
    """The systems of a scene, whatever the amplitude and the frequency of its support; equal pendula once.

    Raise SceneError for a scene without vertical sine or whose weights act on support coordinates, ComputationError for
    masses beyond double precision.
    """
    vertical_sine(scene)
    return tuple(_on_structure(scene) if scene.is_structured else _systems(scene))


def _on_structure(scene: Scene) -> Iterator[HillSystem]:
    """Those of a structure, all coordinates together, with P = ∂K/∂g; raise SceneError if weights push supports."""
    structure = structure_of(scene)
    problems = [
        f"{name}: the ground shakes the weights that its spring carries, which then never rests: a Floquet multiplier "
        "needs weights that balance"
        for name, weight in zip(structure.names, weights(structure, hung_masses(scene), scene.gravity), strict=True)
        if abs(weight.force) > NOISE_OF_SUM * weight.size
    ]
    refuse_any(problems)
    linear = matrices(scene)
    heavier = matrices(scene.replace(gravity=2 * scene.gravity))
    square, shapes = _modes(linear.M, linear.K)
    P = shapes.T @ ((heavier.K - linear.K) / scene.gravity) @ shapes
    none = np.zeros_like(P)
    return _apart(1, square, (P, shapes.T @ linear.D @ shapes, none, none, none))


def _systems(scene: Scene) -> Iterator[HillSystem]:
    linear, geometry, rig = matrices(scene), geometry_of(scene), rig_of(scene)
    quadratic, at = quadratic_drags(scene), 0
    counts: dict[tuple[int, int, bytes], int] = {}
    places: dict[tuple[int, int, bytes], slice] = {}
    for block, column, copies in rig.members:
        n = rig.blocks[block].n
        kind = (block, column, quadratic[at : at + n].tobytes())
        places.setdefault(kind, slice(at, at + n))
        counts[kind] = counts.get(kind, 0) + copies
        at += copies * n
    for kind, span in places.items():
        h, sprung = geometry.centres[span, span], bool(rig.blocks[kind[0]].stiffness[:, kind[1]].any())
        square, shapes = _modes(linear.M[span, span], linear.K[span, span])

        def in_modes(strength: Floats, h: Floats = h, shapes: Floats = shapes) -> Floats:
            return np.asarray(shapes.T @ ((h.T @ strength)[:, None] * shapes))

        P = in_modes(geometry.mass[span]) if sprung else np.diag(square / scene.gravity)
        E = shapes.T @ (h.T * quadratic[span]) @ h @ shapes
        drags = in_modes(geometry.drag[span]), in_modes(quadratic[span])
        parts = (P, shapes.T @ linear.D[span, span] @ shapes, *drags, E)
        yield from _apart(counts[kind], square, parts)


def _apart(count: int, square: Floats, parts: tuple[Floats, ...]) -> Iterator[HillSystem]:
    """The systems of modes that these matrices P, D, S, Q and E couple."""
    for alike in _coupled_sets(parts):
        cut = np.ix_(alike, alike)
        yield HillSystem(count, square[alike], *(part[cut] for part in parts))


def _modes(M: Floats, K: Floats) -> tuple[Floats, Floats]:
    """ω² (n,) ascending and the shapes (n, n), columns with φᵀMφ = 1."""
    scale = 1 / np.sqrt(np.diag(M))
    try:
        L = np.linalg.cholesky(M * scale * scale[:, None])
    except np.linalg.LinAlgError:
        raise ComputationError("the mass matrix of a pendulum is singular in double precision") from None
    inner = np.linalg.solve(L, np.linalg.solve(L, K * scale * scale[:, None]).T)
    square, v = np.linalg.eigh((inner + inner.T) / 2)
    return square, np.linalg.solve(L.T, v) * scale[:, None]


def _coupled_sets(parts: tuple[Floats, ...]) -> list[Booleans]:
    """The sets of coordinates that these matrices couple."""
    is_linked = np.eye(len(parts[0]), dtype=bool)
    for part in parts:
        is_linked |= np.abs(part) > NOISE_OF_SUM * np.abs(part).max()
    for _ in range(ceil(log2(max(2, len(is_linked))))):
        is_linked = is_linked.astype(np.float64) @ is_linked > 0
    return list(np.unique(is_linked, axis=0)) if len(is_linked) else []


@dataclass(frozen=True, eq=False, repr=False)
class ParametricStability(Displayed):
    """Floquet multipliers (2n,) of the small angles of a scene over one `period` (s) of its support, largest first."""

    multipliers: Complexes
    period: float
    certain: float = CERTAIN_DISTANCE

    @property
    def largest(self) -> float:
        """The largest |μ|."""
        return float(abs(self.multipliers[0]))

    @property
    def growth_rate(self) -> float:
        """The rate (1/s) at which small angles grow, negative where they decay."""
        return log(max(self.largest, 1e-300)) / self.period

    @property
    def number(self) -> int:
        """The behaviour of small angles, by its number in KINDS."""
        first = self.multipliers[0]
        if self.largest <= 1 + self.certain:
            return 0 if self.largest >= 1 - self.certain else -1
        return 3 if abs(first.imag) > self.certain * abs(first) else 1 if first.real > 0 else 2

    @property
    def kind(self) -> str:
        """The behaviour of small angles in words."""
        return KINDS[self.number]

    @property
    def grows(self) -> bool:
        """Whether small angles grow."""
        return self.number > 0

    @property
    def words(self) -> str:
        """One line."""
        what = self.kind if self.number else "neither grows nor decays"
        return f"small motion {what}: the largest Floquet multiplier of a period is {self.largest:.6g}"

    def _summary(self) -> Summary:
        rows = [
            [brief(multiplier.real), brief(multiplier.imag), brief(abs(multiplier))] for multiplier in self.multipliers
        ]
        facts = [("period", f"{self.period:.6g} s"), ("growth rate", f"{self.growth_rate:.6g} 1/s")]
        return Summary(self.words, facts, ("Re", "Im", "size"), rows, len(rows))


def parametric_stability(scene: Scene) -> ParametricStability:
    """Compute the stability of a scene with a vertical sine motion of its support, hanging or inverted, with any links.

    A motion along the rail next to it pushes small angles and does not change their growth. Raise SceneError for any
    other motion, and for features that Hill's equation lacks: forces, friction, drives, hoists.

    >>> from modal import Bob, Pendulum, Scene
    >>> from modal.scene import Moved, SineMotion
    >>> shaken = Moved(motion=SineMotion(direction="vertical", amplitude=0.02, frequency_hz=1.0))
    >>> scene = Scene(gravity=9.81, support=shaken, pendulum=[Pendulum(links=[Bob(mass=1, length=1)])])
    >>> found = parametric_stability(scene)
    >>> found.kind, round(found.growth_rate, 6)
    ('grows at half the frequency', 0.062242)
    """
    validate_scene(scene)
    return stabilities([scene])[0]


def stabilities(scenes: Sequence[Scene]) -> list[ParametricStability]:
    """Compute that of several scenes, together if they differ only in their support motion; SceneError as above.

    >>> from modal import Bob, Pendulum, Scene
    >>> from modal.scene import Moved, SineMotion
    >>> from modal.scene.parameters import vary
    >>> shaken = Moved(motion=SineMotion(direction="vertical", amplitude=0.02, frequency_hz=1.0))
    >>> scene = Scene(gravity=9.81, support=shaken, pendulum=[Pendulum(links=[Bob(mass=1, length=1)])])
    >>> several = [vary(scene, {"support.motion.frequency_hz": hertz}) for hertz in (0.9, 1.0)]
    >>> [one.kind for one in stabilities(several)]
    ['neutral', 'grows at half the frequency']
    """
    validate_scenes(scenes)
    answers: list[ParametricStability | None] = [None] * len(scenes)
    groups: dict[tuple[object, ...], list[int]] = {}
    sines = [vertical_sine(scene) for scene in scenes]
    for at, scene in enumerate(scenes):
        carriers = (scene.supports, scene.spring) if scene.is_structured else ()
        groups.setdefault((scene.gravity, scene.pendulum, scene.damping_ratio, scene.space, carriers), []).append(at)
    for alike in groups.values():
        systems = hill_systems(scenes[alike[0]])
        amplitude, hertz = np.array([(sines[at].amplitude, sines[at].frequency_hz) for at in alike]).T
        for at, values, certain in zip(alike, *_multipliers(systems, amplitude, tau * hertz), strict=True):
            answers[at] = ParametricStability(values, 1 / sines[at].frequency_hz, float(certain))
    return [answer for answer in answers if answer]


def _multipliers(systems: Sequence[HillSystem], amplitude: Floats, omega: Floats) -> tuple[Complexes, Floats]:
    """All multipliers (B, 2n), largest first, and what is certain of the largest (B,)."""
    values, certain = [], []
    for system in systems:
        of_system = system.multipliers(amplitude, omega)
        values.append(np.tile(of_system, (1, system.count)))
        room = COUPLED_DISTANCE if system.is_reversible and system.size > 1 else CERTAIN_DISTANCE
        certain.append(np.full(values[-1].shape, room))
    values_of_all, rooms = np.concatenate(values, axis=1), np.concatenate(certain, axis=1)
    order = np.argsort(-np.abs(values_of_all), axis=1, kind="stable")
    return np.take_along_axis(values_of_all, order, 1), np.take_along_axis(rooms, order, 1)[:, 0]
