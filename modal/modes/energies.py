"""Energy distribution of a mode: kinetic by link and support, potential by weight and spring, dissipated by damper.

In q(t) = Re φ e^{λt} every square of M, K and D (`modal.assembly.squares`), of size s along a row r, has

    T = ½ m |λ|² |r·φ|² / 2,      V = ½ k |r·φ|² / 2,      W = d |λ|² |r·φ|² / 2

on average over a cycle, without growth or decay.  φᴴ(λ²M + λD + K)φ = 0 is a quadratic equation in λ with
real coefficients, so that for any dampers ΣT = ΣV, and ζ = Σ W / (4 |λ| ΣT): a damper has the same share of ζ as of W.
For a real λ the three have these ratios at any time. A loss angle φ_j dissipates like a damper k φ_j/ω.

The weight of link i has the energy m_i g times the rise of its centre, Σ_k ½ r_ik |φ_k|², r_ik its displacement along
the rail by every angle of its chain: negative for inverted links. Adams and MotionSolve print the same tables.
"""

from __future__ import annotations

from bisect import bisect
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from modal.assembly import Dissipator, Hanging, dissipators_of
from modal.assembly.linearization import DENSE_COORDINATES_MAX
from modal.assembly.squares import ALONG, JOINT, SPRING, SUPPORT, WEIGHT, WIRE, SquareRows, carrier_squares
from modal.eigen import UNCERTAIN
from modal.errors import ComputationError, SceneError
from modal.modes.dissipation import elongations
from modal.modes.modes import Modes
from modal.report import TABLE_ROWS, ReportColumn, ReportTable, Result, finite
from modal.scene import Scene
from modal.scene.doors import checked
from modal.types import EPS, Floats

ENERGIES = KINETIC, POTENTIAL, DISSIPATED = "kinetic", "potential", "dissipated"
WHAT_LOSES = {"damping": "joint damper", "drag": "drag on link", "loss": "joint loss", "wire_loss": "wire loss"}
SUM_WORDS = {
    "link": "pendulum",
    "weight of link": "weight of pendulum",
    "drag on link": "drag on pendulum",
    **{f"joint {what}": f"joint {what}s of pendulum" for what in ("spring", "damper")},
    **{f"{where} loss": f"{where} losses of pendulum" for where in ("joint", "wire")},
}
"""The shares that are summed by pendulum, and the name of the sum."""
MEANING = "Distribution of the energy of each mode: percent of each kind of energy, averaged over a cycle."
DAMPED = "The share of a damper in ζ is its share of the dissipated energy."
SIGNS = (
    "Below 0: weights of standing parts, which pull away from equilibrium. With these the potential energy adds up "
    "to 100 for an oscillating mode, and to -100 for a growing one."
)
SHARED = "For modes that share a frequency, the mean over all of them."


class EnergyShare(NamedTuple):
    """The share of a `part` of a scene in an `energy` of each mode, in per cent (R,).

    The part has a sort, and belongs to a `link` of the scene, counting copies from 0, or to none, −1.
    """

    energy: str
    sort: str
    label: str
    link: int
    percent: Floats

    @property
    def part(self) -> str:
        """The part that has it."""
        return f"{self.sort} {self.label}".rstrip()

    @property
    def words(self) -> str:
        """The part that has it, as the text calls it."""
        pendulum, _, link = self.label.partition("_")
        if self.link < 0 or not link:
            return self.part
        return f"{self.sort} {'' if self.sort.endswith('link') else 'of link '}{link} of pendulum {pendulum}"

    @property
    def pendulum(self) -> str:
        """The number of its pendulum."""
        return self.label.partition("_")[0] if self.link >= 0 else ""

    @property
    def key(self) -> str:
        """Its name in CSV and JSON."""
        return f"{self.energy}_percent_{self.part.replace(' ', '_')}"


@dataclass(frozen=True, eq=False, repr=False)
class ModeEnergies(Result):
    """The energy distribution of some modes, numbered as in the table: a row for each part of the scene."""

    scene: Scene
    modes: tuple[int, ...]
    rows: tuple[EnergyShare, ...]
    is_shared: bool
    what = "energies of modes"
    key = "energies"

    def columns(self) -> Sequence[ReportColumn]:
        """The energy and the part, and the share in every mode."""
        shares = [
            ReportColumn(_share_of(k), f"mode_{number}_percent", f"mode {number}", "z.2f")
            for k, number in enumerate(self.modes)
        ]
        return (
            ReportColumn("energy", "energy", "of"),
            ReportColumn("part", "part"),
            ReportColumn("words", None, "part"),
            *shares,
        )

    def footnotes(self) -> Iterable[str]:
        """Notes on the meaning of the shares."""
        if any(row.energy == DISSIPATED for row in self.rows):
            yield DAMPED
        if any((row.percent < 0).any() for row in self.rows):
            yield SIGNS
        if self.is_shared:
            yield SHARED

    def parts(self, form: str = "text") -> tuple[str, ReportTable, str]:
        """A table for text output: for long scenes sums by pendulum and the largest of these."""
        rows = [row for energy in ENERGIES for row in self._head(energy)]
        return MEANING, ReportTable.of(self.columns(), rows), "\n".join(self.footnotes())

    def of_mode(self, number: int) -> dict[str, dict[str, float | None]]:
        """The shares of one mode by energy and part, for JSON."""
        at, shares = self.modes.index(number), dict[str, dict[str, float | None]]()
        for row in self.rows:
            shares.setdefault(f"{row.energy}_percent", {})[row.part] = finite(float(row.percent[at]))
        return shares

    def _head(self, energy: str) -> list[EnergyShare]:
        rows = [row for row in self.rows if row.energy == energy]
        if len(rows) > TABLE_ROWS and len({row.pendulum for row in rows if row.pendulum}) > 1:
            rows = _by_pendulum(rows)
        if len(rows) <= TABLE_ROWS:
            return rows
        sizes = [float(np.abs(np.nan_to_num(row.percent)).max(initial=0).round(6)) for row in rows]
        largest = sorted(sorted(range(len(rows)), key=lambda k: -sizes[k])[: TABLE_ROWS - 1])
        rest = [row.percent for k, row in enumerate(rows) if k not in set(largest)]
        return [*(rows[k] for k in largest), EnergyShare(energy, f"{len(rest)} others", "", -1, np.sum(rest, axis=0))]


def _share_of(k: int) -> Callable[[EnergyShare], float]:
    return lambda row: float(row.percent[k])


def _by_pendulum(rows: Sequence[EnergyShare]) -> list[EnergyShare]:
    """Rows of links as one row for each pendulum and sort."""
    sums: dict[tuple[str, str], EnergyShare] = {}
    for row in rows:
        sort, label = row.sort, row.label
        if row.pendulum:
            sort, label = SUM_WORDS[sort], row.pendulum
        before = sums.get((sort, label))
        percent = row.percent if before is None else before.percent + row.percent
        sums[sort, label] = row._replace(sort=sort, label=label, percent=percent)
    return list(sums.values())


@checked
def mode_energies(modes: Modes, indices: Sequence[int] | None = None) -> ModeEnergies:
    """Return the energy distribution of the modes with these indices (from 0, by default all).

    NaN if a mode has no energy of a kind, as the translation of a free cart has no potential energy, and if no digit of
    a frequency is certain. Raise ComputationError for too many links.

    >>> from modal import load, natural_modes
    >>> energies = mode_energies(natural_modes(load("chain-2")))
    >>> [(row.part, row.percent.round(1).tolist()) for row in energies.rows if row.energy == "kinetic"]
    [('link 1_1', [14.6, 85.4]), ('link 1_2', [85.4, 14.6])]
    """
    if modes.scene.feedback:
        raise SceneError(["feedback: shares of energy do not support loops of feedback, which are not symmetric"])
    chosen = [modes.place(index) for index in (range(len(modes)) if indices is None else indices)]
    parts = _Parts(modes)
    shares = np.array([parts.shares(index) for index in chosen]).reshape(len(chosen), len(parts.names))
    rows = [EnergyShare(*name, percent) for name, percent in zip(parts.names, shares.T, strict=True)]
    sorts = list(dict.fromkeys(row.sort for row in rows))
    rows.sort(key=lambda row: (ENERGIES.index(row.energy), sorts.index(row.sort), row.link))
    is_shared = bool((modes.multiplicity[chosen] > 1).any())
    return ModeEnergies(modes.scene, tuple(modes.number[chosen].tolist()), tuple(rows), is_shared)


Name = tuple[str, str, str, int]
"""The energy, sort, label and link of a share."""


Squares = Callable[[Any], Floats]
Source = tuple[list[int], Squares]
"""Squares (N,) for a shape (n,), and the numbers (N,) of their names."""


class _Parts:
    """Everything that has energy in the modes of a scene, by name."""

    def __init__(self, modes: Modes) -> None:
        rig, scene, self.modes = modes.rig, modes.scene, modes
        if sum(block.n**2 * block.count.sum() for block in rig.blocks) > DENSE_COORDINATES_MAX**2:
            raise ComputationError("energies: displacements of all centres by all angles are too many numbers")
        self.hanging, self.numbers = Hanging(rig), dict[Name, int]()
        squares = self.hanging.squares()
        of_carriers = [len(part) for part in carrier_squares(self.hanging.structure, rig.gravity)]
        self.sources = [
            *self._of_carriers(squares.inertia[: of_carriers[0]], squares.stiffness[: of_carriers[1]]),
            *self._of_links(squares.inertia[of_carriers[0] :], squares.stiffness[of_carriers[1] :]),
        ]
        self.dampers = dissipators_of(scene.replace(damping_ratio=0.0))
        self.damper_places = [self._number(DISSIPATED, *self._damper(damper)) for damper in self.dampers]
        self.modal = self._number(DISSIPATED, "damping_ratio") if scene.has_modal_damping else None
        self.names = list(self.numbers)
        self.energy = np.array([name[0] for name in self.names])

    def _number(self, energy: str, sort: str, label: str = "", link: int = -1) -> int:
        return self.numbers.setdefault((energy, sort, label, link), len(self.numbers))

    def _of_carriers(self, inertia: list[SquareRows], stiffness: list[SquareRows]) -> Iterator[Source]:
        """The terms of the supports themselves."""
        structure = self.hanging.structure
        for part in inertia:
            carrier = int(part.numbers[0, 0])
            if part.kind == SUPPORT:
                carrier = self._carrier(carrier)
            yield [self._number(KINETIC, structure.carriers[carrier].name)], _squares_of(part)
        for part in stiffness:
            at = int(part.numbers[0, 0])
            carrier = self._carrier(at)
            body = structure.carriers[carrier]
            way = body.way(at - structure.offsets[carrier]) if part.row_source is not None else ""
            sort = "weight of" if part.kind == WEIGHT else "spring of"
            yield [self._number(POTENTIAL, sort, f"{body.name} {way}".strip())], _squares_of(part)

    def _of_links(self, inertia: list[SquareRows], stiffness: list[SquareRows]) -> Iterator[Source]:
        """The terms of links and of springs between points."""
        leans, forces = self.modes.rig.leans, (POTENTIAL, "constant forces")
        for part in inertia:
            links = part.numbers.ravel().tolist()
            yield self._links(KINETIC, "link", links), _squares_of(part)
        for part in (part for part in inertia if part.kind == ALONG):
            links, weights = part.numbers.ravel().tolist(), self._weights(part)
            yield self._links(POTENTIAL, "weight of link", links), weights
            if leans:
                yield [self._number(*forces)] * len(links), _negative(weights)
        for part in stiffness:
            numbers = part.numbers.ravel().tolist()
            if part.kind == JOINT:
                stiff = np.flatnonzero(part.size)
                links = [numbers[k] for k in stiff]
                yield self._links(POTENTIAL, "joint spring", links), _squares_of(part, stiff)
            elif part.kind == SPRING:
                label = self.hanging.spring_rows[numbers[0]].label
                yield [self._number(POTENTIAL, "spring", label)], _squares_of(part)
            elif part.kind == WIRE and leans:
                yield [self._number(*forces)] * len(numbers), _squares_of(part)

    def _carrier(self, coordinate: int) -> int:
        return bisect(self.hanging.structure.offsets, coordinate) - 1

    def _links(self, energy: str, sort: str, links: Iterable[int]) -> list[int]:
        return [self._number(energy, sort, *self._label(link)) for link in links]

    def _label(self, link: int) -> tuple[str, int]:
        """The name of a link as in `theta_1_2`, and the link."""
        pendulum = self.hanging.owner(link)
        return f"{pendulum + 1}_{link - int(self.hanging.first[pendulum]) + 1}", link

    def _damper(self, damper: Dissipator) -> tuple[Any, ...]:
        """The name of a damper or a loss angle."""
        place, _, key = damper.place.rpartition(".")
        if damper.kind == SPRING:
            label = self.hanging.spring_rows[damper.number].label
            return "loss of spring" if key == "loss" else "damper of spring", label
        if damper.number >= 0:
            return WHAT_LOSES[key], *self._label(damper.number)
        carrier = self._carrier(min(damper.row))
        way = key if place.endswith("damping") else ""
        return "damper of", f"{self.hanging.structure.carriers[carrier].name} {way}".strip()

    def _weights(self, part: SquareRows) -> Squares:
        """Twice the second-order rise of each weight, by the angles above it and by its pivot."""
        arms = part.rows[..., -part.at.shape[1] :]
        pivots = [self.hanging.owner(link) for link in part.numbers[:, 0].tolist()]
        bends = self.hanging.bends[pivots]
        weight = self.modes.rig.gravity * part.size

        def squares(phi: Any) -> Floats:
            turns, moves = np.abs(phi[part.at]) ** 2, np.abs(phi[: bends.shape[1]]) ** 2
            return np.ravel(weight * ((arms @ turns[..., None])[..., 0] + (bends @ moves)[:, None]))

        return squares

    def shares(self, index: int) -> Floats:
        """The share of every name in its energy in a mode, in per cent (N,); of modes of one frequency their mean."""
        fold, energies = int(self.modes.multiplicity[index]), np.zeros(len(self.names))
        if not self.modes.error[index] < UNCERTAIN:
            return energies + np.nan
        for copy in range(fold):
            energies += self._energies(index, copy)
        with np.errstate(all="ignore"):
            for energy in ENERGIES:
                chosen = self.energy == energy
                energies[chosen] *= 100 / abs(energies[chosen].sum())
        return energies

    def _energies(self, index: int, copy: int) -> Floats:
        """The energies of one shape, as φᴴMφ = 1; NaN if rounding keeps them from their balance."""
        value = complex(self.modes.eigenvalue[index])
        phi = self.modes.column(self.modes.shape(index, copy))
        energies = np.zeros(len(self.names))
        for places, squares in self.sources:
            np.add.at(energies, places, squares(phi))
        m = energies[self.energy == KINETIC].sum()
        potential = energies[self.energy == POTENTIAL]
        k, d = potential.sum(), 0.0
        if value:
            stretch = np.abs(elongations(self.dampers, phi[None])[0]) ** 2
            strength = [float(damper.strength(np.array(abs(value)))) for damper in self.dampers]
            np.add.at(energies, self.damper_places, strength * stretch)
            d = sum(damper.damping * square for damper, square in zip(self.dampers, stretch.tolist(), strict=True))
            if self.modal is not None:
                whole = -(value * m + k / value).real
                energies[self.modal], d = whole - d, whole
        terms = abs(value) ** 2 * m + abs(value * d) + np.abs(potential).sum()
        # second order in the error of a shape, first order in that of its shares
        is_balanced = bool(abs(value**2 * m + value * d + k) <= (EPS**0.5 + 4 * self.modes.error[index]) * terms)
        return energies / m if is_balanced else np.full(len(energies), np.nan)


def _negative(squares: Squares) -> Squares:
    return lambda phi: -squares(phi)


def _squares_of(part: SquareRows, chosen: Any = slice(None)) -> Squares:
    """The squares of a part for a shape, (N,), or the chosen ones; of a modal support, without rows, their sum."""
    if part.row_source is None and part.total is not None:
        at, matrix = part.at[0], part.total[0]
        return lambda phi: np.array([np.vdot(phi[at], matrix @ phi[at]).real])
    rows = part.rows

    def squares(phi: Any) -> Floats:
        moves = phi[part.at]
        if rows is not None and part.moves is not None:
            moves = np.concatenate(((part.moves @ phi[part.columns])[:, None], moves), axis=1)
        z = moves if rows is None else (rows @ moves[..., None])[..., 0]
        return np.asarray(np.ravel(part.size * np.abs(z) ** 2)[chosen])

    return squares
