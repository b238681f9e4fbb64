"""Families of modes and their table: what couples them, how strongly, and how slowly they beat.

Pendula of one fixed-base frequency ω_r that something joins form family r.  Those of their combinations that move
nothing else stay at ω_r; each other one, a branch, has a coupling strength ε and a mode of the scene near
ω_r (1 + ε/2).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf, isfinite, sqrt

import numpy as np

from modal.coupling.exchange import FAR, STRONG, Transfer
from modal.modes import lettered
from modal.report import NOTHING, Displayed, short
from modal.types import Complexes, Floats, Ints

ROUGH = 0.02
"""Relative difference of a splitting from that with a constant ε above which both are only a guide."""


@dataclass(frozen=True, eq=False, repr=False)
class FamilyBranch(Displayed):
    """One mode of a family that moves other things: its ε, and its `omega` (rad/s), `splitting` ω − ω_r.

    ε is negative just above another pole or a spring of what moves, infinite where nothing else resists.  A mode that a
    massless cart has lost is at infinity.
    `motion` (d,) is what the structure does, in its own modes, `pattern` (√kg m) the amplitudes of the members.
    `still` where the structure stands, and only springs between pendula split the family.  `damped` is by what complex
    factor dampers outside the family change ε, `cart_mode` the index of the mode among those that move the cart.
    """

    strength: float
    omega: float
    splitting: float
    motion: Floats
    pattern: Floats
    still: bool
    damped: complex = 1.0
    cart_mode: int | None = None

    @property
    def is_finite(self) -> bool:
        """Whether the mode has a frequency."""
        return isfinite(self.omega)

    def is_first_order(self, omega: float) -> bool:
        """Whether ½ ε ω_r of a family at ω_r is near its splitting, and the coupling weak."""
        near = abs(self.strength * omega / 2 - self.splitting) <= FAR * abs(self.splitting)
        return self.is_finite and abs(self.strength) <= STRONG and near

    def is_rough(self, omega: float) -> bool:
        """Whether another family is near: what resists varies from ω_r to the mode, not too much for first order."""
        steady = omega * (sqrt(max(0.0, 1 + self.strength)) - 1)
        return abs(steady - self.splitting) > ROUGH * abs(self.splitting)


@dataclass(frozen=True, eq=False, repr=False)
class Family(Displayed):
    """Modes of single pendula of one frequency `omega` (rad/s): `members` are indices into `FixedBaseModes`.

    There are `fold` in all, counting copies, of which `still` combinations move nothing else.  `mass` is their modal
    effective mass μ_r along the rail (kg), `masses` (d,) that along each mode of the structure, Σ N (Γ Φ u)².
    `exchange` describes the energy of any one pendulum released alone; None where there is only one, where first order
    does not hold, and where the joints damp some of the pendula faster than others; `beats` are its 2π/|Δω| (s), the
    slowest first, of every two levels between which energy passes, and comes back.
    """

    omega: float
    members: tuple[int, ...]
    fold: int
    still: int
    mass: float
    masses: Floats
    branches: tuple[FamilyBranch, ...]
    exchange: Transfer | None = None
    beats: tuple[float, ...] = ()

    @property
    def cart_mode(self) -> int | None:
        """The index of the mode that moves the cart; None where there is none."""
        return self.branches[0].cart_mode if self.branches else None

    @property
    def strength(self) -> float:
        """The largest ε; ε_r = μ_r/m_r for one coordinate, 0 where nothing couples."""
        return max((branch.strength for branch in self.branches), key=abs, default=0.0)

    @property
    def rest(self) -> float:
        """The dynamic mass m_r of everything else at ω_r (kg) for one coordinate; infinite on a fixed support."""
        mass = float(self.masses[0]) if len(self.masses) else self.mass
        return mass / self.strength if self.strength else inf

    @property
    def splitting(self) -> float | None:
        """Δω (rad/s) of the only mode that moves other things; None where there is none, or several."""
        moving = [branch.splitting for branch in self.branches if branch.is_finite]
        return moving[0] if len(moving) == 1 else None

    @property
    def first_order(self) -> float:
        """Δω (rad/s) where what resists changes little from ω_r to the mode, ½ ε_r ω_r."""
        return self.strength * self.omega / 2

    @property
    def is_first_order(self) -> bool:
        """Whether there are modes that move other things, all near ω_r + ½ ε ω_r."""
        return bool(self.branches) and all(branch.is_first_order(self.omega) for branch in self.branches)

    @property
    def is_rough(self) -> bool:
        """Whether a nearby family interferes with one of its modes."""
        return any(branch.is_rough(self.omega) for branch in self.branches)

    @property
    def beat(self) -> float | None:
        """The slowest beat (s), in which energy passes from one pendulum of the family to the others and back."""
        return self.beats[0] if self.beats else None

    def levels(self, copies: Ints, lost: float) -> tuple[Floats, Complexes]:
        """Of every branch, then of what is still: its share of each member released (levels, members), and Δω + iσ.

        `copies` (members,) there are of each, `lost` is the decay rate (1/s) of one pendulum alone.
        """
        levels = [1j * lost + branch.splitting * branch.damped for branch in self.branches]
        patterns = [branch.pattern**2 / (branch.pattern @ branch.pattern) / copies for branch in self.branches]
        weights = np.reshape(patterns, (len(levels), len(copies)))
        if not self.still:
            return weights / weights.sum(0), np.array(levels)
        return np.vstack([weights, np.maximum(1 - weights.sum(0), 0.0)]), np.array([*levels, 1j * lost])


COLUMNS: tuple[tuple[str, Callable[[FamilyRow], float | str | None]], ...] = (
    ("family", lambda row: row.family),
    ("ω (rad/s)", lambda row: row.omega),
    ("effective mass (kg)", lambda row: row.mass),
    ("coupling strength", lambda row: None if row.strength is None else f"{row.strength:.4g}".replace("inf", "∞")),
    ("Δω (rad/s)", lambda row: row.splitting),
    ("beat (s)", lambda row: row.beat),
    ("share halfway (%)", lambda row: None if row.share is None else f"{100 * row.share:.3g}"),
    ("modes", lambda row: row.modes),
    ("moves", lambda row: row.moves or None),
)


@dataclass(frozen=True, repr=False)
class FamilyRow(Displayed):
    """A line of the table, None where a quantity is not defined.

    `omega` ω_r (rad/s) with all else held, `mass` the modal effective mass (kg), `strength` ε, `splitting` Δω (rad/s),
    `beat` (s), and `share`, what the others of the family hold of the energy of one that is released, halfway through a
    beat, or the most that they ever hold with dampers.  `modes` are numbers in the table, `moves` what of a structure
    moves, `fold` how many modes of single pendula the family has.
    """

    family: str
    omega: float
    mass: float | None
    strength: float | None
    splitting: float | None
    beat: float | None
    share: float | None
    modes: str
    moves: str = ""
    fold: int = 1


def family_name(index: int) -> str:
    """A, B, … of families from 0: numbers are for modes."""
    return lettered(index).upper()


def mode_words(still: int | None, moving: int | None, copies: int = 1) -> str:
    """The modes of a family by their numbers: of these `copies` that move nothing else, and the one that does.

    >>> mode_words(3, 4), mode_words(3, 4, 28), mode_words(None, 2)
    ('3 still, 4', '3 still ×28, 4', '2')
    """
    several = f" ×{copies}" if copies > 1 else ""
    parts = [f"{still} still{several}"] * (still is not None) + [str(moving)] * (moving is not None)
    return ", ".join(parts) or NOTHING


def family_cells(rows: Sequence[FamilyRow]) -> tuple[list[str], list[list[str]]]:
    """Headings and cells of the columns that hold anything."""
    columns = {heading: [value(row) for row in rows] for heading, value in COLUMNS}
    shown = {heading: column for heading, column in columns.items() if any(cell is not None for cell in column)}
    return list(shown), [[_cell(shown[heading][k]) for heading in shown] for k in range(len(rows))]


def _cell(value: float | str | None) -> str:
    return NOTHING if value is None else value if isinstance(value, str) else short(value)
