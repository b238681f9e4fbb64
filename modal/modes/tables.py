"""The table of modes as text, Markdown, LaTeX, CSV, HTML or JSON, with one list of columns for all.

Each column has its key, its value and its heading; options and words choose among them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from math import isfinite, isnan, nan, pi, radians
from textwrap import wrap
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from modal.errors import ComputationError, SceneError, spelling_hint
from modal.modes.mode import Mode
from modal.modes.modes import Modes
from modal.modes.numbering import fixed_base_masses, on_free_cart
from modal.modes.rows import structure_motion
from modal.report import (
    LEFT,
    NOTHING,
    ReportTable,
    Summary,
    as_json,
    csv_rows,
    deferred,
    digits,
    finite,
    folded,
    headed,
    html,
    layout,
    limit,
    line_width,
    markdown,
    one_line,
)
from modal.scene import describe, title_of
from modal.scene.doors import checked
from modal.types import Floats

if TYPE_CHECKING:
    from modal.modes.energies import ModeEnergies

__all__ = ["GUIDE", "table"]

MOST_SHAPE_NUMBERS = 5_000_000
"""Limit: angles of the shapes of one document, refused beyond as too many."""
GUIDE = "the 1 % angle is approximate"
UNDAMPED = "Effective masses are those of the modes without dampers; – where dampers change a shape too much."
SPLIT = "± –: the numbers split a frequency that several modes share, so it has no standard deviation of its own."
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


@checked
def table(
    modes: Modes,
    rows: Sequence[Mode],
    form: str,
    *,
    shapes: bool = False,
    starred: str = GUIDE,
    amplitude_deg: float | None = None,
    stds: Stds | None = None,
    chosen: str = "",
    elsewhere: str = "",
    sensitive: bool = False,
    energies: bool = False,
    left: int = 0,
    proofs: Mapping[int, str] | None = None,
) -> str:
    """Return these rows of `modes` as text, markdown, latex, csv, html or json, as `form` says.

    `shapes` adds mode shapes and energy shares to JSON; ComputationError if they are too many. `starred` explains the 1
    % angle of a starred mode. With `amplitude_deg` a column has the damping ratio at that largest angle, with dry
    friction and quadratic drag; NaN for modes across the rail. With `stds` columns have the standard deviations of ω,
    of the frequency and of the damping ratio.

    Uninformative columns are omitted, except in csv and json. Text that does not fit the current width
    (`modal.report.fitted`) omits more and names them, with the sentence `elsewhere` on where to find them. `chosen` are
    names of columns to print instead, `all`, or after a + to add; a table of chosen columns omits none and is stacked.
    `sensitive` adds the sensitivities of the frequencies to the numbers of the scene, `energies` the energy
    distribution. Text says how many rows are `left` out. The last column shows the `proofs` of rows, by their numbers.
    """
    if form not in (forms := ("text", "csv", "json", *_WRITERS)):
        raise SceneError([f"form {form}: must be one of {', '.join(forms)}{spelling_hint(form, forms)}"])
    columns = columns_of(modes, rows, chosen, stds, amplitude_deg) + proof_columns(proofs)
    if form == "json":
        return _json(modes, rows, columns, shapes=shapes, sensitive=sensitive, energies=energies)
    if form == "csv":
        return _csv(modes, rows, columns, sensitive=sensitive, energies=energies)
    visible_columns = printed_columns(modes, rows, columns, chosen)
    keys = {column.key for column in visible_columns}
    rows = rows if "linear_to_1_percent_deg" in keys else [replace(row, resonances=()) for row in rows]
    cells = [[column.cell(row) for column in visible_columns if column.cell] for row in rows]
    split = stds is not None and any(isnan(stds[row.number][0]) for row in rows if not row.is_uncertain)
    notes = _footnotes(modes, rows, starred, keys) + [SPLIT] * split
    if form == "text":
        room = limit()
        last_lines = [f"… {left} more{room.elsewhere if room else ''}"] * bool(left)
        text = _text(modes, visible_columns, cells, notes, chosen, elsewhere, last_lines)
    else:
        text = _WRITERS[form](modes, visible_columns, cells, notes)
    return text + "".join(_below(modes, rows, form, sensitive=sensitive, energies=energies))


def _below(modes: Modes, rows: Sequence[Mode], form: str, *, sensitive: bool, energies: bool) -> Iterator[str]:
    """The tables that stand below that of the modes."""
    if sensitive:
        yield _further(form, *deferred("modal.modes.sensitivity:sensitivities_of")(modes, rows))
    if energies:
        yield _further(form, *_energies(modes, rows).parts())


def _energies(modes: Modes, rows: Sequence[Mode]) -> ModeEnergies:
    shares: ModeEnergies = deferred("modal.modes.energies:mode_energies")(modes, [modes.index_of(row) for row in rows])
    return shares


def _further(form: str, head: str, table: ReportTable, notes: str) -> str:
    """A table below the first, between a sentence and lines of notes."""
    lines = notes.split("\n") if notes else []
    if form == "text":
        parts = folded(head), table.written(), "\n".join(map(folded, lines))
        return "\n" + "\n\n".join(filter(None, parts)) + "\n"
    align = ["left" if heading in LEFT else "right" for heading in table.headings]
    body = _tabulate("github" if form == "markdown" else form, align, table.cells, table.headings)
    line, between = {"markdown": ("{}", "\n\n"), "latex": ("% {}", "\n"), "html": ("<p>{}</p>", "\n")}[form]
    paragraphs = line.format(head), body if table.cells else "", *map(line.format, lines)
    return between[1:] + between.join(filter(None, paragraphs)) + "\n"


def _records(rows: Sequence[Mode], columns: Sequence[Column]) -> list[dict[str, Any]]:
    """One mapping per mode, all columns, units in the names; None for an undefined value."""
    return [{column.key: finite(column.value(row)) for column in columns} for row in rows]


def _json(
    modes: Modes, rows: Sequence[Mode], columns: Sequence[Column], *, shapes: bool, sensitive: bool, energies: bool
) -> str:
    """JSON: the scene, its modes, the routes taken and notes."""
    records = _records(rows, columns)
    rows_of = [{**record, "resonances": list(row.resonances)} for record, row in zip(records, rows, strict=True)]
    if shapes:
        numbers = sum(row.multiplicity for row in rows) * modes.scene.n_links
        if numbers > MOST_SHAPE_NUMBERS:
            raise ComputationError(f"the requested shapes have {numbers} angles: choose fewer modes with `modes`")
        for record, row in zip(rows_of, rows, strict=True):
            record["shapes"] = [_shape_record(modes, row, k) for k in range(row.multiplicity)]
    if sensitive:
        from modal.modes.sensitivity import of_mode

        for record, row in zip(rows_of, rows, strict=True):
            record["sensitivities"] = {path: slope.record() for path, slope in of_mode(modes, row).items()}
    if energies:
        shares = _energies(modes, rows)
        for record, row in zip(rows_of, rows, strict=True):
            record["energies"] = shares.of_mode(row.number)
    document = {"scene": describe(modes.scene), "modes": rows_of, "route": modes.route, "notes": list(modes.notes)}
    return as_json(document)


def _shape_record(modes: Modes, row: Mode, copy: int) -> dict[str, Any]:
    shape = modes.shape(modes.index_of(row), copy)
    angles = [[z.real, z.imag] for z in shape.angles] if shape.angles.dtype.kind == "c" else shape.angles.tolist()
    cart = [shape.cart.real, shape.cart.imag] if isinstance(shape.cart, complex) else shape.cart
    return {
        "direction": "across the rail" if shape.across else "along the rail",
        "cart_m": cart if isinstance(cart, list) else cart + 0.0,  # no −0
        "angles_rad": angles,
        "modal_mass_kg_m2": shape.modal_mass,
        "participation_factor_per_m": finite(shape.participation_factor),
        "kinetic_energy_share": shape.kinetic_energy_share.tolist(),
        "uncertain": shape.uncertain,
    }


def _footnotes(modes: Modes, rows: Sequence[Mode], starred: str, keys: set[str]) -> list[str]:
    notes = list(modes.notes)
    if any(row.resonances for row in rows):
        notes.append(f"* near a 1:1, 1:2 or 1:3 resonance, with another mode or among its own: {starred}.")
    if modes.is_expanded and modes.not_expanded:
        notes.append(f"1 % angle: not computed {modes.not_expanded}.")
    if any(row.is_uncertain for row in rows):
        notes.append("! beyond double precision: no digit of this frequency is certain.")
    if "period_s" in keys and any(row.oscillates and row.damping_ratio**2 > 2e-7 for row in rows):
        notes.append("f is |λ|/2π as ω is |λ|, but T is that of the damped swing, 2π/|Im λ|.")
    has_masses = not keys.isdisjoint(("effective_mass_kg", "fixed_base_effective_mass_kg"))
    if has_masses and modes.rig.is_damped and any(row.effective_mass > 0 for row in rows):
        notes.append(UNDAMPED)
    if any(row.growth_rate for row in rows):
        pairs = "" if modes.scene.feedback else "; every growing mode is paired with a decaying one"
        notes.append(f"unstable: the scene leaves this equilibrium{pairs}.")
    if modes.scene.has_losses:
        mixing = set(deferred("modal.modes.dissipation:sharing")(modes)) & {row.number for row in rows}
        if mixing:
            numbers = ", ".join(map(str, sorted(mixing)))
            notes.append(f"Q of modes {numbers} is approximate: they are closer together than their losses, and mix.")
    if any(row.indistinct for row in rows):
        notes.append("~ closer to the next frequency than the error bounds can distinguish.")
    return notes


def _csv(modes: Modes, rows: Sequence[Mode], columns: Sequence[Column], *, sensitive: bool, energies: bool) -> str:
    records = _records(rows, columns)
    if sensitive:
        from modal.modes.sensitivity import of_mode

        for record, row in zip(records, rows, strict=True):
            record |= {f"d_omega_d_{path}": finite(slope.derivative) for path, slope in of_mode(modes, row).items()}
    for share in _energies(modes, rows).rows if energies else ():
        for record, percent in zip(records, share.percent.tolist(), strict=True):
            record[share.key] = finite(percent)
    keys = list(records[0]) if records else [column.key for column in columns]
    return csv_rows([keys, *(record.values() for record in records)])


def _tabulate(name: str, align: list[str], cells: Sequence[Sequence[str]], headings: Sequence[str]) -> str:
    from tabulate import tabulate

    return tabulate(cells, headings, tablefmt=name, colalign=align if cells else None, disable_numparse=True)


def _align(columns: Sequence[Column]) -> list[str]:
    return ["left" if column.key in {"family", "proof"} else "right" for column in columns]


def _text(
    modes: Modes,
    columns: Sequence[Column],
    cells: list[list[str]],
    notes: list[str],
    chosen: str,
    elsewhere: str,
    last_lines: list[str],
) -> str:
    """The columns that fit with a line `last_lines`, the names of those that do not, and the notes."""
    headings, extra_keys = [column.heading for column in columns], added_by(modes, chosen, columns)
    spare = spare_headings(columns, extra_keys) if extra_keys or not chosen else []
    body, omissions = layout(cells, headings, _align(columns), spare, elsewhere, whole=True)
    notes = [*omissions, *notes]
    return (
        "\n".join([headed(title_of(modes.scene)), "", body, *map(folded, last_lines), "", *map(folded, notes)]).rstrip()
        + "\n"
    )


def _markdown(modes: Modes, columns: Sequence[Column], cells: list[list[str]], notes: list[str]) -> str:
    body = _tabulate("github", _align(columns), cells, [column.heading for column in columns])
    paragraphs = (f"\n{markdown(note)}" for note in notes)
    return "\n".join([f"**{markdown(title_of(modes.scene))}**", "", body, *paragraphs]) + "\n"


def _latex(modes: Modes, columns: Sequence[Column], cells: list[list[str]], notes: list[str]) -> str:
    plain = [
        [cell.replace(NOTHING, "--").replace(">", "$>$").replace("~", r"\textasciitilde{}") for cell in row]
        for row in cells
    ]
    body = _tabulate("latex_raw", _align(columns), plain, [column.latex_heading for column in columns])
    return "\n".join([f"% {line}" for line in (one_line(title_of(modes.scene)), *notes)] + [body]) + "\n"


def _html(modes: Modes, columns: Sequence[Column], cells: list[list[str]], notes: list[str]) -> str:
    body = _tabulate("html", _align(columns), cells, [column.heading for column in columns])
    caption = f"<table>\n<caption>{html(title_of(modes.scene))}</caption>"
    return "\n".join([body.replace("<table>", caption, 1), *(f"<p>{html(note)}</p>" for note in notes)]) + "\n"


_WRITERS: dict[str, Callable[[Modes, Sequence[Column], list[list[str]], list[str]], str]] = {
    "markdown": _markdown,
    "latex": _latex,
    "html": _html,
}


# ------------------------------------------------------------------------------ as columns, and as they show themselves


OMEGA = "omega_rad_per_s"


def record_of(mode: Mode) -> dict[str, Any]:
    """The row of a mode by the keys of the table, except columns that need more than the row; None for no value."""
    return {column.key: finite(column.value(mode)) for column in COLUMNS if not isinstance(column.value, OfRows)}


def table_of(modes: Modes) -> dict[str, NDArray[Any]]:
    """The columns (R,) of the table by their keys; NaN if there is no value."""
    rows = modes.every
    return {column.key: _array([column.value(row) for row in rows]) for column in columns_of(modes, rows)}


def _array(values: list[Any]) -> NDArray[Any]:
    return np.array([nan if value is None else value for value in values])


def summarize_mode(mode: Mode) -> Summary:
    """Return the number of a mode, its description and its row of the table."""
    columns = {column.key: column for column in COLUMNS if column.cell and not isinstance(column.value, OfRows)}
    cells = {key: column.cell(mode) for key, column in columns.items() if column.cell}
    title = f"Mode {cells.pop('mode')}: {cells.pop('family')}"
    facts = [(columns[key].heading, cell) for key, cell in cells.items() if cell != NOTHING]
    return Summary(title, [(name, cell) for name, cell in facts if cell != "0" or name == columns[OMEGA].heading])
