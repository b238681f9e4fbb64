"""The columns of the table of modes, each with its key, its value and its heading, and the choice among them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from math import isfinite, nan, pi, radians
from textwrap import wrap
from typing import Any, NamedTuple

import numpy as np

from modal.errors import SceneError, spelling_hint
from modal.modes.mode import Mode
from modal.modes.modes import Modes
from modal.modes.numbering import fixed_base_masses, on_free_cart
from modal.modes.rows import structure_motion
from modal.report import NOTHING, deferred, digits, line_width
from modal.types import Floats

Stds = Mapping[int, tuple[float, float]]
"""Standard deviations of ω (rad/s) and of the damping ratio by the number of the mode."""
Value = float | int | str | bool | None
EVERY = "all"
M_EFF = r"$m_\mathrm{eff}$"


class OfRows:
    """A value that needs more than its own row: the function of all modes and of the rows that computes theirs."""

    def __init__(self, compute: Callable[[Modes, Sequence[Mode]], Floats]) -> None:
        self.compute = compute

    def __call__(self, mode: Mode) -> float:
        """No number of one row alone."""
        return nan


class Column(NamedTuple):
    """A key with its unit, its value and, if it is printed, a heading, plain and in LaTeX, and a format.

    The format is at most so many significant `digits`, or a `text`. `only_if` says for which scenes the column is
    informative. A column that is not `usual` is shown on request.
    """

    key: str
    value: Callable[[Mode], Value]
    heading: str = ""
    latex: str = ""
    digits: int = 0
    only_if: Callable[[Modes], bool] = lambda modes: True
    text: Callable[[Mode], str] | None = None
    usual: bool = True

    @property
    def cell(self) -> Callable[[Mode], str] | None:
        """The value as it is printed, None if it is not."""
        return _digits(self.digits, self.value) if self.digits else self.text

    @property
    def latex_heading(self) -> str:
        """The heading in LaTeX."""
        return self.latex or self.heading

    def with_values(self, modes: Modes, rows: Sequence[Mode]) -> Column:
        """Return the same with the values of these rows, computed on first use."""
        if not isinstance(self.value, OfRows):
            return self
        compute = self.value.compute

        @cache
        def values() -> dict[int, float]:
            return dict(zip([row.number for row in rows], compute(modes, rows).tolist(), strict=True))

        def value(mode: Mode) -> float:
            return values()[mode.number]

        return self._replace(value=value)


def _digits(limit: int, value: Callable[[Mode], Any]) -> Callable[[Mode], str]:
    """At most `limit` significant digits, and no more than the bound on ω allows."""

    def cell(mode: Mode) -> str:
        number = value(mode)
        return NOTHING if number is None or mode.is_uncertain else digits(number, mode.relative_error_bound, limit)

    return cell


def _number_with_marks(mode: Mode) -> str:
    marks = (("*", bool(mode.resonances)), ("~", mode.indistinct), ("!", mode.is_uncertain))
    return f"{mode.number}{''.join(mark for mark, holds in marks if holds)}"


def _bound_text(mode: Mode) -> str:
    return f"{mode.relative_error_bound:.0e}"


def _angle_text(mode: Mode) -> str:
    angle = mode.linear_to_1_percent_deg
    return ">90" if angle > 90 and isfinite(mode.kappa) and mode.kappa else _digits(3, lambda m: angle)(mode)


def _swings_freely(modes: Modes) -> bool:
    return on_free_cart(modes.rig)


def _has_copies(modes: Modes) -> bool:
    return bool((modes.multiplicity > 1).any())


def _has_own_mass(modes: Modes) -> bool:
    """Not on a free cart, where the rigid translation has all of it and every other mode none."""
    return not on_free_cart(modes.rig)


def _indices(modes: Modes, rows: Sequence[Mode]) -> list[int]:
    return [modes.index_of(row) for row in rows]


@OfRows
def _quality_factors(modes: Modes, rows: Sequence[Mode]) -> Floats:
    factors: Floats = deferred("modal.modes.dissipation:quality_factors")(modes, _indices(modes, rows))
    return factors


@OfRows
def _fixed_base(modes: Modes, rows: Sequence[Mode]) -> Floats:
    return fixed_base_masses(modes, _indices(modes, rows), [row.effective_mass for row in rows])


@OfRows
def _participation(modes: Modes, rows: Sequence[Mode]) -> Floats:
    return np.array([modes.shape(row).participation_factor + 0.0 for row in _indices(modes, rows)])


@OfRows
def _cumulative(modes: Modes, rows: Sequence[Mode]) -> Floats:
    """The share of the total mass in each of these modes and all below it."""
    indices = _indices(modes, rows)
    last = max(indices, default=-1) + 1
    lower = np.full(last, nan) if modes.first else [mode.effective_mass_share for mode in modes.rows(range(last))]
    return np.asarray(np.cumsum(lower)[indices])


@OfRows
def _cumulative_held(modes: Modes, rows: Sequence[Mode]) -> Floats:
    """The same of the fixed-base modes, of the mass of the pendula."""
    indices = _indices(modes, rows)
    last = max(indices, default=-1) + 1
    lower = np.full(last, nan) if modes.first else fixed_base_masses(modes, range(last))
    hanging = modes.rig.total_mass - (modes.rig.cart.mass if modes.rig.cart else 0.0)
    return np.asarray(np.cumsum(lower)[indices] / hanging)


COLUMNS = (
    Column("mode", lambda m: m.number, "mode", text=_number_with_marks),
    Column("omega_rad_per_s", lambda m: m.omega, "ω (rad/s)", r"$\omega$ (rad/s)", 9),
    Column("frequency_hz", lambda m: m.frequency, "f (Hz)", r"$f$ (Hz)", 7),
    Column("period_s", lambda m: m.period, "T (s)", r"$T$ (s)", 7),
    Column("damping_ratio", lambda m: m.damping_ratio, "ζ", r"$\zeta$", 4, lambda modes: modes.scene.has_damping),
    Column("quality_factor", _quality_factors, "Q", "$Q$", 5, lambda modes: modes.scene.has_losses, usual=False),
    Column("growth_rate_per_s", lambda m: m.growth_rate, "growth (1/s)", "", 7, lambda modes: modes.scene.stands),
    Column("multiplicity", lambda m: m.multiplicity, "multiplicity", "", 0, _has_copies, lambda m: str(m.multiplicity)),
    Column("family", lambda m: m.family, "description", text=lambda m: m.family),
    Column("cart_participation", lambda m: m.cart_participation, "cart part.", "", 4, lambda modes: modes.on_cart),
    Column("effective_mass_kg", lambda m: m.effective_mass, "eff. mass (kg)", f"{M_EFF} (kg)", 6, _has_own_mass),
    Column("effective_mass_share", lambda m: m.effective_mass_share, "share", "", 4, _has_own_mass),
    Column(
        "fixed_base_effective_mass_kg",
        _fixed_base,
        "fixed-base mass (kg)",
        f"fixed-base {M_EFF} (kg)",
        6,
        _swings_freely,
    ),
    Column(
        "effective_mass_across_kg",
        lambda m: m.effective_mass_across,
        "across (kg)",
        f"{M_EFF} across (kg)",
        6,
        lambda modes: modes.rig.spatial,
    ),
    Column(
        "linear_to_1_percent_deg",
        lambda m: m.linear_to_1_percent_deg,
        "1 % at (°)",
        r"1\,\% at ($^\circ$)",
        text=_angle_text,
    ),
    Column("kappa_per_rad2", lambda m: m.kappa),
    Column("resonances", lambda m: "; ".join(m.resonances)),
    Column("residual", lambda m: m.residual),
    Column(
        "relative_error_bound",
        lambda m: m.relative_error_bound,
        "rel. error ≤",
        r"rel.\ error $\leq$",
        text=_bound_text,
    ),
    Column("indistinct", lambda m: m.indistinct),
    Column("participation_factor_per_m", _participation, "part. factor (1/m)", r"$\Gamma$ (1/m)", 6, usual=False),
    Column("cumulative_effective_mass_share", _cumulative, "cum. share", "", 4, _has_own_mass, usual=False),
    Column("cumulative_fixed_base_mass_share", _cumulative_held, "cum. fixed-base", "", 4, _swings_freely, usual=False),
)
DROPPED = (
    *("relative_error_bound", "effective_mass_share", "effective_mass_across_kg", "fixed_base_effective_mass_kg"),
    *("effective_mass_kg", "cart_participation", "multiplicity", "period_s", "linear_to_1_percent_deg"),
    *("growth_rate_per_s", "damping_ratio_std", "frequency_std_hz", "omega_std_rad_per_s", "damping_ratio_at"),
    "frequency_hz",
)
"""The columns that a narrow terminal omits, the first to go first; keys, or how they begin."""


def columns_of(
    modes: Modes, rows: Sequence[Mode], chosen: str = "", stds: Stds | None = None, amplitude_deg: float | None = None
) -> list[Column]:
    """All columns of a table with these rows: the usual ones, those of the options, and those that are `chosen`.

    Raise SceneError for an unknown name in `chosen`.
    """
    columns = list(COLUMNS) if stds is None else _with_stds(stds)
    if amplitude_deg is not None:
        columns.insert(
            1 + [column.key for column in columns].index("damping_ratio"), _at_amplitude(modes, amplitude_deg)
        )
    if modes.scene.is_structured:
        at = [column.key for column in columns].index("cart_participation")
        columns[at : at + 1] = coordinate_columns(modes, rows)
    if modes.scene.has_losses:
        columns = [column._replace(usual=True) if column.key == "quality_factor" else column for column in columns]
    chosen_keys = _chosen_keys(modes, chosen, columns)
    return [column.with_values(modes, rows) for column in columns if column.usual or column.key in chosen_keys]


def coordinate_columns(modes: Modes, rows: Sequence[Mode]) -> list[Column]:
    """Return a column for each coordinate of a structure: its displacement in the shape of each mode.

    The largest angle of the shape is 1 rad. Further columns on request have the share of each coordinate's velocity
    just after a sudden push on it.
    """

    @cache
    def shapes_and_shares() -> tuple[Floats, Floats]:
        parts = [structure_motion(modes, index) for index in _indices(modes, rows)]
        shapes, shares = (np.array([part[k] for part in parts]).reshape(len(rows), -1) for k in (0, 1))
        return shapes, shares

    def column(k: int, name: str, which: int) -> Column:
        @OfRows
        def values(modes: Modes, rows: Sequence[Mode]) -> Floats:
            return np.asarray(shapes_and_shares()[which][:, k])

        key, heading = f"{name}_participation", f"{name} part."
        if not which:
            label, _, unit = name.rpartition("_")
            key, heading = name, f"{label} ({unit})" if label and unit in {"m", "rad"} else name
        return Column(key, values, heading, digits=4, usual=not which)

    return [column(k, name, which) for which in (0, 1) for k, name in enumerate(modes.rig.support.names)]


def added_by(modes: Modes, chosen: str, columns: Sequence[Column]) -> frozenset[str]:
    """The keys of the columns that a choice adds to the usual ones."""
    return frozenset(_chosen_keys(modes, chosen, columns)) if chosen.startswith("+") else frozenset()


def printed_columns(modes: Modes, rows: Sequence[Mode], columns: Sequence[Column], chosen: str = "") -> list[Column]:
    """Return the columns that are printed: the informative ones, or those that are `chosen`."""
    with_heading = [column for column in columns if column.cell]
    if chosen == EVERY:
        return with_heading
    chosen_keys = _chosen_keys(modes, chosen, with_heading)
    if chosen and not chosen.startswith("+"):
        return [column for column in with_heading if column.key in {*chosen_keys, "mode", "proof"}]
    return [column for column in with_heading if column.key in chosen_keys or _says_something(modes, rows, column)]


def _says_something(modes: Modes, rows: Sequence[Mode], column: Column) -> bool:
    is_usual = column.only_if(modes) and column.usual
    return is_usual and (column.cell is None or not rows or any(column.cell(row) != NOTHING for row in rows))


def _chosen_keys(modes: Modes, chosen: str, columns: Sequence[Column]) -> set[str]:
    """The keys of the columns with these names, separated by commas, perhaps after a +.

    A name is a key, a heading, or how keys begin: then those are meant that say something about the scene, if any do.
    """
    printable = [column for column in columns if column.cell]
    if chosen == EVERY:
        return {column.key for column in printable}
    keys, problems, has_hints = set[str](), [], True
    for name in dict.fromkeys(word.strip() for word in chosen.removeprefix("+").split(",") if chosen):
        matching = {column.key for column in printable if name in {column.key, column.heading}}
        completions = [column for column in printable if name and column.key.startswith(name)]
        matching = (
            matching
            or {column.key for column in completions if column.only_if(modes)}
            or {column.key for column in completions}
        )
        keys |= matching
        if not matching:
            hint = spelling_hint(name, [column.key for column in printable])
            has_hints = has_hints and bool(hint)
            problems.append(f"columns {name or chosen}: no such column{hint}")
    if problems:
        names = ", ".join(column.key for column in printable)
        overview = [] if has_hints else wrap(f"columns are {EVERY}, {names}", line_width() - len("multipendula: "))
        raise SceneError([*problems, *overview])
    return keys


def spare_headings(columns: Sequence[Column], exceptions: frozenset[str] = frozenset()) -> list[str]:
    """Return the headings that a narrow terminal omits, in the order of DROPPED, except `exceptions`."""
    order = [c.heading for start in DROPPED for c in columns if c.key.startswith(start) and c.key not in exceptions]
    return list(dict.fromkeys(order))


def proof_columns(proofs: Mapping[int, str] | None) -> list[Column]:
    """Return the columns on the proof of each row, by the number of its mode."""

    def word(mode: Mode) -> str:
        return (proofs or {})[mode.number]

    return [Column("proof", word, "proof", text=word)] if proofs else []


def _with_stds(stds: Stds) -> list[Column]:
    """All columns, with standard deviations next to their quantities."""
    std_columns = {
        "omega_rad_per_s": ("omega_std_rad_per_s", 0, 1.0, "± (rad/s)", r"$\pm$ (rad/s)"),
        "frequency_hz": ("frequency_std_hz", 0, 1 / (2 * pi), "± (Hz)", r"$\pm$ (Hz)"),
        "damping_ratio": ("damping_ratio_std", 1, 1.0, "± ζ", r"$\pm\zeta$"),
    }
    columns = []
    for column in COLUMNS:
        columns.append(column)
        if std := std_columns.get(column.key):
            key, which, factor, heading, latex = std

            def value(mode: Mode, column: Column = column, which: int = which, factor: float = factor) -> float:
                return nan if column.value(mode) is None else factor * stds[mode.number][which]

            columns.append(Column(key, value, heading, latex, 2, column.only_if))
    return columns


def _at_amplitude(modes: Modes, amplitude_deg: float) -> Column:
    """The damping ratio with dry friction and quadratic drag at a largest angle (deg)."""
    from modal.modes.dissipation import damping_ratios

    ratios = damping_ratios(modes, radians(amplitude_deg))
    angle = f"{amplitude_deg:g}"

    def ratio(mode: Mode) -> float:
        return ratios.get(mode.number, nan)

    heading = f"ζ({angle}°)", rf"$\zeta({angle}^\circ)$"
    return Column(f"damping_ratio_at_{angle}_deg", ratio, *heading, 4)
