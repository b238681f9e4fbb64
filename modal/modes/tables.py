"""The table of modes as text, Markdown, LaTeX, CSV, HTML or JSON, one list of columns for all."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from math import isnan, nan
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from modal.errors import ComputationError, SceneError, spelling_hint
from modal.modes.columns import (
    COLUMNS,
    Column,
    OfRows,
    Stds,
    added_by,
    columns_of,
    printed_columns,
    proof_columns,
    spare_headings,
)
from modal.modes.mode import Mode
from modal.modes.modes import Modes
from modal.report import (
    LEFT,
    NOTHING,
    ReportTable,
    Summary,
    as_json,
    csv_rows,
    deferred,
    finite,
    folded,
    headed,
    html,
    layout,
    limit,
    markdown,
    one_line,
)
from modal.scene import describe, title_of
from modal.scene.doors import checked

if TYPE_CHECKING:
    from modal.modes.energies import ModeEnergies

__all__ = ["GUIDE", "table"]

MOST_SHAPE_NUMBERS = 5_000_000
"""Limit: angles of the shapes of one document, refused beyond as too many."""
GUIDE = "the 1 % angle is approximate"
UNDAMPED = "Effective masses are those of the modes without dampers; – where dampers change a shape too much."
SPLIT = "± –: the numbers split a frequency that several modes share, so it has no standard deviation of its own."


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
    from tabulate import tabulate

    align = ["left" if heading in LEFT else "right" for heading in table.headings]
    names = {"markdown": "github", "latex": "latex", "html": "html"}
    body = tabulate(table.cells, table.headings, tablefmt=names[form], colalign=align, disable_numparse=True)
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


def _tabulate(name: str, columns: Sequence[Column], cells: list[list[str]], headings: list[str]) -> str:
    from tabulate import tabulate

    return tabulate(cells, headings, tablefmt=name, colalign=_align(columns) if cells else None, disable_numparse=True)


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
    body = _tabulate("github", columns, cells, [column.heading for column in columns])
    paragraphs = (f"\n{markdown(note)}" for note in notes)
    return "\n".join([f"**{markdown(title_of(modes.scene))}**", "", body, *paragraphs]) + "\n"


def _latex(modes: Modes, columns: Sequence[Column], cells: list[list[str]], notes: list[str]) -> str:
    plain = [
        [cell.replace(NOTHING, "--").replace(">", "$>$").replace("~", r"\textasciitilde{}") for cell in row]
        for row in cells
    ]
    body = _tabulate("latex_raw", columns, plain, [column.latex_heading for column in columns])
    return "\n".join([f"% {line}" for line in (one_line(title_of(modes.scene)), *notes)] + [body]) + "\n"


def _html(modes: Modes, columns: Sequence[Column], cells: list[list[str]], notes: list[str]) -> str:
    body = _tabulate("html", columns, cells, [column.heading for column in columns])
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
