"""The table of modes as text, Markdown, LaTeX, CSV, HTML or JSON: one list of columns, many dresses."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from html import escape
from math import isfinite
from typing import Any

from modal.errors import ComputationError
from modal.linear import Matrices
from modal.mode import Mode
from modal.modes import Modes
from modal.rig import Floats
from modal.scene import Scene, described

MOST_SHAPE_NUMBERS = 5_000_000
FORMATS = ("text", "markdown", "latex", "csv", "html", "json")
Value = float | int | str | bool | None


@dataclass(frozen=True)
class Column:
    """A machine name with its unit, a heading for people (plain and LaTeX), a value and how people see it."""

    key: str
    heading: str
    latex: str
    value: Callable[[Mode], Value]
    form: str = "{}"
    only_if: Callable[[Modes], bool] = lambda modes: True


COLUMNS = (
    Column("mode", "mode", "mode", lambda m: m.number),
    Column("omega_rad_per_s", "ω (rad/s)", r"$\omega$ (rad/s)", lambda m: m.omega, "{:.9g}"),
    Column("frequency_hz", "f (Hz)", r"$f$ (Hz)", lambda m: m.frequency, "{:.7g}"),
    Column("period_s", "T (s)", r"$T$ (s)", lambda m: m.period, "{:.7g}"),
    Column(
        "damping_ratio", "ζ", r"$\zeta$", lambda m: m.damping_ratio, "{:.4g}", lambda modes: modes.scene.has_damping
    ),
    Column("multiplicity", "fold", "fold", lambda m: m.multiplicity),
    Column("family", "family", "family", lambda m: m.family),
    Column(
        "cart_participation",
        "cart part.",
        "cart part.",
        lambda m: m.cart_participation,
        "{:.4g}",
        lambda modes: modes.rig.cart is not None,
    ),
    Column("effective_mass_kg", "eff. mass (kg)", r"$\mu$ (kg)", lambda m: m.effective_mass, "{:.6g}"),
    Column("effective_mass_share", "share", "share", lambda m: m.effective_mass_share, "{:.4g}"),
    Column(
        "effective_mass_across_kg",
        "across (kg)",
        r"$\mu_y$ (kg)",
        lambda m: m.effective_mass_across,
        "{:.6g}",
        lambda modes: modes.rig.spatial,
    ),
    Column(
        "linear_to_1_percent_deg",
        "1 % at (°)",
        r"1\,\% at ($^\circ$)",
        lambda m: m.linear_to_1_percent_deg,
        "{:.3g}",
    ),
    Column("amplitude_coefficient_per_rad2", "κ", r"$\kappa$", lambda m: m.kappa, "{:.4g}", lambda modes: False),
    Column("resonances", "resonances", "resonances", lambda m: "; ".join(m.resonances), "{}", lambda modes: False),
    Column("residual", "residual", "residual", lambda m: m.residual, "{:.1e}", lambda modes: False),
    Column("relative_error_bound", "± rel.", r"$\pm$ rel.", lambda m: m.relative_error_bound, "{:.0e}"),
    Column("indistinct", "", "", lambda m: m.indistinct, "{}", lambda modes: False),
)


def table(modes: Modes, rows: Sequence[Mode], form: str, *, shapes: bool = False) -> str:
    """These rows of `modes` in one of FORMATS; `shapes` adds mode shapes and energy shares to JSON."""
    if form == "json":
        return json_table(modes, rows, shapes=shapes)
    if form == "csv":
        return _csv(rows)
    columns = [column for column in COLUMNS if column.only_if(modes)]
    cells = [[_shown(column, row) for column in columns] for row in rows]
    return _DRESSES[form](modes, columns, cells, _footnotes(modes, rows))


def records(rows: Sequence[Mode]) -> list[dict[str, Value]]:
    """One mapping a mode, all columns, units in the names."""
    return [{column.key: _finite(column.value(row)) for column in COLUMNS} for row in rows]


def json_table(modes: Modes, rows: Sequence[Mode], *, shapes: bool) -> str:
    """JSON: the scene, its modes, the route that was taken and notes."""
    found: list[dict[str, Any]] = [
        {**record, "resonances": list(row.resonances)} for record, row in zip(records(rows), rows, strict=True)
    ]
    if shapes:
        numbers = sum(row.multiplicity for row in rows) * modes.scene.n_links
        if numbers > MOST_SHAPE_NUMBERS:
            raise ComputationError(f"the shapes asked for hold {numbers} angles: choose fewer modes with --modes")
        for record, row in zip(found, rows, strict=True):
            record["shapes"] = [_shape_record(modes, row.number - 1, k) for k in range(row.multiplicity)]
    whole = {"scene": described(modes.scene), "modes": found, "route": modes.route, "notes": list(modes.notes)}
    return json.dumps(whole, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def _shape_record(modes: Modes, number: int, copy: int) -> dict[str, Any]:
    shape = modes.shape(number, copy)
    angles = [[z.real, z.imag] for z in shape.angles] if shape.angles.dtype.kind == "c" else shape.angles.tolist()
    cart = [shape.cart.real, shape.cart.imag] if isinstance(shape.cart, complex) else shape.cart
    return {
        "direction": "across the rail" if shape.across else "along the rail",
        "cart_m": cart,
        "angles_rad": angles,
        "kinetic_energy_share": shape.kinetic_energy_share.tolist(),
    }


def _finite(value: Value) -> Value:
    """The value, or None where it has no meaning."""
    return None if isinstance(value, float) and not isfinite(value) else value


def _shown(column: Column, row: Mode) -> str:
    value = _finite(column.value(row))
    if value is None:
        return "–"
    if column.key == "mode":
        marks = (("*", bool(row.resonances)), ("~", row.indistinct), ("!", row.is_uncertain))
        return f"{value}{''.join(mark for mark, holds in marks if holds)}"
    if column.key == "linear_to_1_percent_deg" and isinstance(value, float) and value > 90:
        return ">90"
    return column.form.format(value)


def _footnotes(modes: Modes, rows: Sequence[Mode]) -> list[str]:
    notes = list(modes.notes)
    if any(row.resonances for row in rows):
        notes.append("* near a 1:1 or 1:3 resonance with another mode: the 1 % amplitude is a guide there.")
    if any(row.is_uncertain for row in rows):
        notes.append("! beyond double precision: no digit of this frequency is certain.")
    if any(row.indistinct for row in rows):
        notes.append("~ closer to a neighbour than the error bounds can tell apart.")
    return notes


def _csv(rows: Sequence[Mode]) -> str:
    stream = io.StringIO()
    writer = csv.DictWriter(stream, [column.key for column in COLUMNS], lineterminator="\n")
    writer.writeheader()
    writer.writerows(records(rows))
    return stream.getvalue()


def _dressed(name: str, columns: Sequence[Column], cells: list[list[str]], headings: list[str]) -> str:
    from tabulate import tabulate

    align = ["left" if column.key == "family" else "right" for column in columns]
    return tabulate(cells, headings, tablefmt=name, colalign=align if cells else None, disable_numparse=True)


def _title(modes: Modes) -> str:
    return modes.scene.title or "Modes"


def _text(modes: Modes, columns: Sequence[Column], cells: list[list[str]], notes: list[str]) -> str:
    """Aligned by hand: the default format imports nothing, so that the command starts quickly."""
    headings = [column.heading for column in columns]
    widths = [max(map(len, column)) for column in zip(headings, *cells, strict=True)]
    lines = [headings, ["-" * width for width in widths], *cells]
    return (
        "\n".join([_title(modes), "", *(_aligned(columns, widths, line) for line in lines), "", *notes]).rstrip() + "\n"
    )


def _aligned(columns: Sequence[Column], widths: list[int], cells: list[str]) -> str:
    padded = (
        cell.ljust(width) if column.key == "family" else cell.rjust(width)
        for column, width, cell in zip(columns, widths, cells, strict=True)
    )
    return "  ".join(padded).rstrip()


def _markdown(modes: Modes, columns: Sequence[Column], cells: list[list[str]], notes: list[str]) -> str:
    body = _dressed("github", columns, cells, [column.heading for column in columns])
    return "\n".join([f"**{_title(modes)}**", "", body, *(f"\n{note}" for note in notes)]) + "\n"


def _latex(modes: Modes, columns: Sequence[Column], cells: list[list[str]], notes: list[str]) -> str:
    plain = [
        [cell.replace("–", "--").replace(">", "$>$").replace("~", r"\textasciitilde{}") for cell in row]
        for row in cells
    ]
    body = _dressed("latex_raw", columns, plain, [column.latex for column in columns])
    return "\n".join([f"% {line}" for line in (_title(modes).replace("\n", " "), *notes)] + [body]) + "\n"


def _html(modes: Modes, columns: Sequence[Column], cells: list[list[str]], notes: list[str]) -> str:
    body = _dressed("html", columns, cells, [column.heading for column in columns])
    caption = f"<table>\n<caption>{escape(_title(modes))}</caption>"
    return "\n".join([body.replace("<table>", caption, 1), *(f"<p>{escape(note)}</p>" for note in notes)]) + "\n"


_DRESSES = {"text": _text, "markdown": _markdown, "latex": _latex, "html": _html}


def matrices_table(scene: Scene, found: Matrices, form: str) -> str:
    """M, K and D as text or JSON."""
    named = {"M": found.M, "K": found.K, "D": found.D}
    if form == "json":
        whole = {
            "scene": described(scene),
            "coordinates": list(found.labels),
            **{name: matrix.tolist() for name, matrix in named.items()},
        }
        return json.dumps(whole, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    parts = [f"coordinates ({len(found.labels)}): {', '.join(found.labels)}"]
    for name, matrix in named.items():
        parts.append(f"{name} = 0" if not matrix.any() else f"{name} =\n{_grid(matrix)}")
    return "\n\n".join(parts) + "\n"


def _grid(matrix: Floats) -> str:
    cells = [[f"{value:.10g}" for value in row] for row in matrix]
    width = max(len(cell) for row in cells for cell in row)
    return "\n".join("  " + "  ".join(cell.rjust(width) for cell in row) for row in cells)
