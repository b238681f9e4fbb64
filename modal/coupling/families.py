"""The table of families: what couples them, how strongly, and how slowly they beat, a line a family and mode."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from modal.modes import lettered
from modal.report import NOTHING, Displayed, short

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
