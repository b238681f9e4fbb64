"""Populations in identical motion, each as one pendulum: patterns and their stability by averaged equations.

In a pattern (all populations in phase, or two in antiphase) every population moves as one pendulum of its mass. Small
perturbations fall into sectors that do not mix. Where G exchanges the two populations with their supports, in antiphase
with the sign changed, a pattern is a motion with Gq = q, and

    own                     Gδ = δ: the populations do the same, in another way
    other                   Gδ = −δ: towards the other pattern
    within a population     δ sums up to 0 over its pendula, without force on the support: N − 1 times the same

Without that symmetry own and other are one sector, "common".  The pattern is one oscillation, so that all modes turn
with one rate Ω here (`nonlinear.averaging.equations`): the averaged equations are harmonic balance, and their growth
rates follow from a matrix for each sector.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy

from modal.assembly import matrices
from modal.errors import ComputationError
from modal.modes import natural_modes
from modal.report import Displayed, Summary, brief, counted
from modal.scene import Scene, require
from modal.scene.doors import require_type
from modal.types import Complexes, Floats
from nonlinear.averaging.equations import AveragedEquations, derivative
from nonlinear.averaging.equilibria import (
    SETTLING_STEPS,
    START_ANGLE,
    START_SEED,
    RelativeEquilibrium,
    relative_equilibrium,
)
from nonlinear.averaging.slow_flow import settle
from nonlinear.dynamics.variational import Variational
from nonlinear.system import Population, System, populations_of, representatives, system_of

OWN, OTHER, COMMON, WITHIN = "own", "other", "common", "within a population"
IN_PHASE, ANTIPHASE = "in phase", "antiphase"
SETTLINGS_MAX = 6
"""Limit: stretches of slow flow, each twice as long, after which "no steady motion was found"."""
MOTION_ANGLE_MIN = 1e-3
"""Limit: largest angle (rad) below which a motion "dies out"."""


@dataclass(frozen=True, eq=False, repr=False)
class Sector(Displayed):
    """Perturbations of one kind: an orthonormal `basis` (half, k) of their coordinates."""

    name: str
    basis: Floats

    def _summary(self) -> Summary:
        return Summary(f"{self.name}: {counted(self.basis.shape[1], 'disturbance', 'disturbances')} of a pattern")

    @cached_property
    def states(self) -> Floats:
        """The basis of coordinates and rates, (2 half, 2k)."""
        return np.asarray(scipy.linalg.block_diag(self.basis, self.basis))


@dataclass(frozen=True, eq=False, repr=False)
class Pattern(Displayed):
    """All populations of a scene alike: `few` is the scene of their representatives.

    The motion is one of the first sector; `mean` has a coordinate (half,) of every population's first link, with the
    sign by which it swings.
    """

    name: str
    scene: Scene
    few: Scene
    populations: tuple[Population, ...]
    system: System
    mean: Floats
    sectors: tuple[Sector, ...]

    def _summary(self) -> Summary:
        several = counted(len(self.populations), "population", "populations")
        return Summary(f"{several} {self.name}", [("sectors", ", ".join(sector.name for sector in self.sectors))])

    @property
    def rest(self) -> Floats:
        """The y at rest, (2 half,)."""
        still = np.zeros(self.system.first)
        return np.concatenate((still, self.system.rest, still, np.zeros(self.system.n_links)))

    def at(self, scene: Scene) -> Pattern:
        """The same pattern of a scene with other numbers."""
        return next(pattern for pattern in patterns_of(scene) if pattern.name == self.name)


def patterns_of(scene: Scene) -> tuple[Pattern, ...]:
    """The patterns of a structured scene with one or two populations, all in phase first.

    Raise ComputationError for more populations, and if no small set of pendula represents the others.
    """
    require_type("scene", scene, "Scene")
    populations = populations_of(scene)
    if len(populations) > 2:
        raise ComputationError(f"patterns are those of one or two populations, and this scene has {len(populations)}")
    representative_scene = representatives(scene)
    system = system_of(representative_scene)
    names = (IN_PHASE, ANTIPHASE)[: len(populations)]
    return tuple(_pattern(name, scene, representative_scene, populations, system) for name in names)


def _pattern(
    name: str, scene: Scene, representative_scene: Scene, populations: tuple[Population, ...], system: System
) -> Pattern:
    means, within = _means(populations, system)
    sign = -1.0 if name == ANTIPHASE else 1.0
    supports = np.eye(system.first + system.n_links)[:, : system.first]
    inside = [Sector(WITHIN, basis) for basis in within if basis.size]
    numbered = inside
    if len(inside) > 1:
        numbered = [replace(sector, name=f"within population {k}") for k, sector in enumerate(inside, start=1)]
    basis = np.hstack((supports, *means))
    lead = np.sum([sign**k * mean[:, 0] for k, mean in enumerate(means)], axis=0)
    common = Pattern(name, scene, representative_scene, populations, system, lead, (Sector(COMMON, basis), *numbered))
    if len(populations) == 1:
        return replace(common, sectors=(Sector(OWN, basis), *inside))
    G = _exchange(populations, system, means, sign)
    if G is None:
        return common
    kept_sector, lost_sector = (Sector(word, _eigenspace(G, basis, way)) for word, way in ((OWN, 1.0), (OTHER, -1.0)))
    split = replace(common, sectors=(kept_sector, lost_sector, *inside[:1]))
    return split if _is_invariant(split) else common


def _means(populations: Sequence[Population], system: System) -> tuple[list[Floats], list[Floats]]:
    """Orthonormal coordinates (half, n) of every population: the means of its representatives, and differences."""
    unit = np.eye(system.first + system.n_links)[:, system.first :]
    means, differences, p = [], [], 0
    for population in populations:
        units = [unit[:, system.pendulum == p + k] for k in range(population.halves)]
        means.append(np.sum(units, axis=0) / np.sqrt(population.halves))
        differences.append((units[0] - units[1]) / np.sqrt(2) if population.halves > 1 else units[0][:, :0])
        p += population.halves
    return means, differences


def _exchange(populations: Sequence[Population], system: System, means: Sequence[Floats], sign: float) -> Floats | None:
    """G (half, half) on the means; None if the two populations are no images of each other."""
    first, second = populations
    structure = system.structure
    assert structure is not None
    carriers = [structure.carriers[population.support] for population in populations]
    alike = first.pendulum == second.pendulum and first.size == second.size
    if (
        not alike
        or first.support == second.support
        or carriers[0].kind != carriers[1].kind
        or carriers[0].M is not None
    ):
        return None
    G = sign * (means[0] @ means[1].T + means[1] @ means[0].T)
    image = {first.support: second.support, second.support: first.support}
    for number, carrier in enumerate(structure.carriers):
        to = image.get(number, number)
        for k in range(carrier.size):
            upright = carrier.path is not None and not carrier.path.coordinates[k].is_mirrored
            G[structure.offsets[to] + k, structure.offsets[number] + k] = 1.0 if upright else sign
    return np.asarray(G)


def _eigenspace(G: Floats, span: Floats, way: float) -> Floats:
    """An orthonormal basis (half, k) of the δ in the span of `span` with Gδ = ±δ."""
    U, sizes, _ = np.linalg.svd((span + way * (G @ span)) / 2)
    return np.asarray(U[:, : int(np.count_nonzero(sizes > 0.5))])


def _is_invariant(pattern: Pattern) -> bool:
    """Whether motions of the first sector stay in it, and no sector's perturbations go over into another one."""
    equations = Variational(pattern.system)
    scale, random = equations.scale, np.random.default_rng(START_SEED)
    spaces = [sector.states for sector in pattern.sectors[:2]]
    rounding = np.sqrt(np.finfo(float).eps)
    for _ in range(3):
        inside = spaces[0] @ random.uniform(-0.5, 0.5, spaces[0].shape[1])
        rate, J = equations.linearize(pattern.rest + scale * inside)
        J = J * scale / scale[:, None]
        for space, other_space in (spaces, spaces[::-1]):
            if np.abs(other_space.T @ J @ space).max() > rounding * np.abs(J).max():
                return False
        if np.abs(spaces[1].T @ (rate / scale)).max() > rounding * np.abs(rate / scale).max():
            return False
    return True


@dataclass(frozen=True, eq=False, repr=False)
class AveragedPattern(Displayed):
    """A pattern in the averaged equations: the `state` in its own shapes, and a matrix for each sector."""

    pattern: Pattern
    state: RelativeEquilibrium
    blocks: tuple[Floats, ...]

    def _summary(self) -> Summary:
        rates = brief(np.array(self.growth))
        return Summary(f"{self.pattern.name}, averaged", [("ω (rad/s)", brief(self.omega)), ("growth (1/s)", rates)])

    @property
    def omega(self) -> float:
        """The frequency Ω (rad/s)."""
        return self.state.omega

    @cached_property
    def amplitude(self) -> float:
        """The largest angle (rad)."""
        return self.state.averaged.largest(self.state.z)

    @cached_property
    def exponents(self) -> tuple[Complexes, ...]:
        """The eigenvalues (1/s) of every sector, the neutral one of the first omitted, fastest growing first."""
        exponents = []
        for number, block in enumerate(self.blocks):
            values = np.linalg.eigvals(block).astype(complex)
            if not number:
                values = np.delete(values, np.abs(values).argmin())
            exponents.append(values[np.argsort(-values.real)])
        return tuple(exponents)

    @property
    def growth(self) -> tuple[float, ...]:
        """The largest growth rate (1/s) of every sector."""
        return tuple(float(values[0].real) for values in self.exponents)


def averaged_pattern(pattern: Pattern, near_by: AveragedPattern | None = None) -> AveragedPattern:
    """The pattern in the averaged equations, next to one of a scene with other numbers, or from small swings.

    Raise ComputationError if none is found, or the scene is out of their scope.
    """
    require(pattern.few, "averaging")
    sector_equations = [_sector_equations(pattern, sector) for sector in pattern.sectors]
    first = sector_equations[0]
    if not pattern.system.has_escapements and rest_growth(pattern) <= 0:
        raise ComputationError(f"the motion {pattern.name} dies out: its losses exceed the power of the drives")
    for z in _starts(pattern, first, near_by):
        state = relative_equilibrium(first, z)
        if state is not None and first.largest(state.z) > MOTION_ANGLE_MIN:
            return AveragedPattern(pattern, state, tuple(_block(state, equations) for equations in sector_equations))
    raise ComputationError(f"no steady motion {pattern.name} was found")


def _starts(pattern: Pattern, equations: AveragedEquations, near_by: AveragedPattern | None) -> Iterator[Complexes]:
    """Amplitudes from which Newton's method may find it: those next to, or of slow flow from small swings."""
    if near_by is not None:
        yield equations.dual.T @ (near_by.state.averaged.shapes @ near_by.state.z)
    z: Complexes = np.asarray(equations.dual.T @ pattern.mean, dtype=complex)
    z, shortest = START_ANGLE * z / equations.largest(z), 0.0
    for _ in range(SETTLINGS_MAX):
        motion = settle(equations, z[:, None], SETTLING_STEPS, shortest)[0]
        z, shortest = motion.z[:, -1], 2 * float(motion.times[-1])
        yield z


def rest_growth(pattern: Pattern) -> float:
    """The growth rate (1/s) of small motions of the pattern about rest: no oscillation lasts where all decay."""
    E, J = pattern.sectors[0].states, Variational(pattern.system).linearize(pattern.rest)[1]
    return float(np.linalg.eigvals(E.T @ J @ E).real.max())


def _sector_equations(pattern: Pattern, sector: Sector) -> AveragedEquations:
    """The averaged equations of motions in one sector, in its own modes, all of one band."""
    scene = pattern.few.conservative
    M, E = matrices(scene), sector.basis
    squares, vectors = scipy.linalg.eigh(E.T @ M.K @ E, E.T @ M.M @ E)
    if squares[0] <= 0:
        raise ComputationError("averaged equations need one mode for each coordinate; something moves freely here")
    shapes, none = E @ vectors, np.zeros(len(squares), dtype=np.int64)
    modes = natural_modes(scene)
    return AveragedEquations(pattern.few, pattern.system, modes, shapes, M.M @ shapes, np.sqrt(squares), none, none)


def _block(state: RelativeEquilibrium, sector: AveragedEquations) -> Floats:
    """The derivative (2k, 2k) of the flow by the amplitudes of one sector, next to the state."""
    equations, k = state.averaged, len(sector.omega)
    if sector is equations:
        return derivative(equations.flow, state.z, state.turning)
    joint = replace(
        equations,
        shapes=np.hstack((equations.shapes, sector.shapes)),
        dual=np.hstack((equations.dual, sector.dual)),
        omega=np.concatenate((equations.omega, sector.omega)),
        row=np.concatenate((equations.row, sector.row)),
        band=np.concatenate((equations.band, sector.band)),
    )
    z: Complexes = np.concatenate((state.z, np.zeros(k, dtype=complex)))
    slope = derivative(joint.flow, z, state.turning)
    size = len(z)
    rows = np.r_[size - k : size, 2 * size - k : 2 * size]
    return np.asarray(slope[np.ix_(rows, rows)])
