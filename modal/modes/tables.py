"""The table of modes as text, Markdown, LaTeX, CSV, HTML or JSON, one list of columns for all; M, K and D likewise."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite, isnan, log10, nan, pi, radians
from typing import Any

from modal.assembly import Matrices
from modal.errors import ComputationError
from modal.modes.mode import Mode
from modal.modes.modes import Modes
from modal.report import NOTHING, as_json, csv_rows, finite, html, markdown, one_line, visible
from modal.scene import Scene, describe
from modal.types import Floats

MOST_SHAPE_NUMBERS = 5_000_000
GUIDE = "the 1 % amplitude is a guide"
SPLIT = "± –: the numbers split a frequency that several modes share, so it has no standard deviation of its own."
Stds = Mapping[int, tuple[float, float]]
"""Standard deviations of ω (rad/s) and of the damping ratio by the number of the mode."""
Value = float | int | str | bool | None


@dataclass(frozen=True)
class Column:
    """A key with its unit, its value and, if it is printed, a heading, plain and in LaTeX, and a format."""

    key: str
    value: Callable[[Mode], Value]
    heading: str = ""
    latex: str = ""
    shown: Callable[[Mode], str] | None = None
    only_if: Callable[[Modes], bool] = lambda modes: True

    @property
    def headed(self) -> str:
        """The heading in LaTeX."""
        return self.latex or self.heading


def _digits(most: int, value: Callable[[Mode], float | None]) -> Callable[[Mode], str]:
    """At most `most` significant digits, and no more than the bound on ω allows."""

    def shown(mode: Mode) -> str:
        number, bound = value(mode), mode.relative_error_bound
        if number is None or not isfinite(number) or mode.is_uncertain:
            return NOTHING
        certain = most if bound == 0 else min(most, max(1, int(-log10(bound))))
        return f"{number:.{certain}g}"

    return shown


def _marked(mode: Mode) -> str:
    marks = (("*", bool(mode.resonances)), ("~", mode.indistinct), ("!", mode.is_uncertain))
    return f"{mode.number}{''.join(mark for mark, holds in marks if holds)}"


def _trusted(mode: Mode) -> str:
    angle = mode.linear_to_1_percent_deg
    return ">90" if angle > 90 and isfinite(mode.kappa) and mode.kappa else _digits(3, lambda m: angle)(mode)


def _number(
    key: str,
    value: Callable[[Mode], float | None],
    heading: str,
    latex: str,
    digits: int,
    only_if: Callable[[Modes], bool] = lambda modes: True,
) -> Column:
    return Column(key, value, heading, latex, _digits(digits, value), only_if)


COLUMNS = (
    Column("mode", lambda m: m.number, "mode", shown=_marked),
    _number("omega_rad_per_s", lambda m: m.omega, "ω (rad/s)", r"$\omega$ (rad/s)", 9),
    _number("frequency_hz", lambda m: m.frequency, "f (Hz)", r"$f$ (Hz)", 7),
    _number("period_s", lambda m: m.period, "T (s)", r"$T$ (s)", 7),
    _number("damping_ratio", lambda m: m.damping_ratio, "ζ", r"$\zeta$", 4, lambda modes: modes.scene.has_damping),
    _number("growth_rate_per_s", lambda m: m.growth_rate, "growth (1/s)", "", 7, lambda modes: modes.scene.stands),
    Column("multiplicity", lambda m: m.multiplicity, "multiplicity", shown=lambda m: str(m.multiplicity)),
    Column("family", lambda m: m.family, "description", shown=lambda m: m.family),
    _number("cart_participation", lambda m: m.cart_participation, "cart part.", "", 4, lambda modes: modes.on_cart),
    _number("effective_mass_kg", lambda m: m.effective_mass, "eff. mass (kg)", r"$m_\mathrm{eff}$ (kg)", 6),
    _number("effective_mass_share", lambda m: m.effective_mass_share, "share", "", 4),
    _number(
        "effective_mass_across_kg",
        lambda m: m.effective_mass_across,
        "across (kg)",
        r"$m_\mathrm{eff}$ across (kg)",
        6,
        lambda modes: modes.rig.spatial,
    ),
    Column(
        "linear_to_1_percent_deg", lambda m: m.linear_to_1_percent_deg, "1 % at (°)", r"1\,\% at ($^\circ$)", _trusted
    ),
    Column("kappa_per_rad2", lambda m: m.kappa),
    Column("resonances", lambda m: "; ".join(m.resonances)),
    Column("residual", lambda m: m.residual),
    Column(
        "relative_error_bound",
        lambda m: m.relative_error_bound,
        "rel. error ≤",
        r"rel.\ error $\leq$",
        lambda m: f"{m.relative_error_bound:.0e}",
    ),
    Column("indistinct", lambda m: m.indistinct),
)


def table(
    modes: Modes,
    rows: Sequence[Mode],
    form: str,
    *,
    shapes: bool = False,
    starred: str = GUIDE,
    amplitude_deg: float | None = None,
    stds: Stds | None = None,
) -> str:
    """These rows of `modes` as text, markdown, latex, csv, html or json, as `form` says.

    `shapes` adds mode shapes and energy shares to JSON; ComputationError if they are too many.  `starred` says what the
    1 % amplitude of a starred mode is.  With `amplitude_deg` a column has the damping ratio at that largest angle, with
    dry friction and quadratic drag; NaN for modes across the rail.  With `stds` columns have the standard deviations of
    ω, of the frequency and of the damping ratio.
    """
    every = list(COLUMNS) if stds is None else _with_stds(stds)
    if amplitude_deg is not None:
        every.insert(1 + [column.key for column in every].index("damping_ratio"), _at_amplitude(modes, amplitude_deg))
    if form == "json":
        return _json(modes, rows, every, shapes=shapes)
    if form == "csv":
        return _csv(rows, every)
    columns = [column for column in every if column.shown and column.only_if(modes)]
    cells = [[column.shown(row) for column in columns if column.shown] for row in rows]
    split = stds is not None and any(isnan(stds[row.number][0]) for row in rows if not row.is_uncertain)
    return _WRITERS[form](modes, columns, cells, _footnotes(modes, rows, starred) + [SPLIT] * split)


def _with_stds(stds: Stds) -> list[Column]:
    """All columns, with those of standard deviations beside what they are of."""
    beside = {
        "omega_rad_per_s": ("omega_std_rad_per_s", 0, 1.0, "± (rad/s)", r"$\pm$ (rad/s)"),
        "frequency_hz": ("frequency_std_hz", 0, 1 / (2 * pi), "± (Hz)", r"$\pm$ (Hz)"),
        "damping_ratio": ("damping_ratio_std", 1, 1.0, "± ζ", r"$\pm\zeta$"),
    }
    found = []
    for column in COLUMNS:
        found.append(column)
        if own := beside.get(column.key):
            key, which, factor, heading, latex = own

            def value(mode: Mode, column: Column = column, which: int = which, factor: float = factor) -> float:
                return nan if column.value(mode) is None else factor * stds[mode.number][which]

            found.append(_number(key, value, heading, latex, 2, column.only_if))
    return found


def _at_amplitude(modes: Modes, amplitude_deg: float) -> Column:
    """The damping ratio with dry friction and quadratic drag at a largest angle (deg)."""
    from modal.modes.friction import damping_ratios

    found = damping_ratios(modes, radians(amplitude_deg))
    angle = f"{amplitude_deg:g}"

    def ratio(mode: Mode) -> float:
        return found.get(mode.number, nan)

    heading = f"ζ({angle}°)", rf"$\zeta({angle}^\circ)$"
    return Column(f"damping_ratio_at_{angle}_deg", ratio, *heading, _digits(4, ratio))


def _records(rows: Sequence[Mode], columns: Sequence[Column]) -> list[dict[str, Any]]:
    """One mapping per mode, all columns, units in the names; None for an undefined value."""
    return [{column.key: finite(column.value(row)) for column in columns} for row in rows]


def _json(modes: Modes, rows: Sequence[Mode], columns: Sequence[Column], *, shapes: bool) -> str:
    """JSON: the scene, its modes, the routes taken and notes."""
    records = _records(rows, columns)
    found = [{**record, "resonances": list(row.resonances)} for record, row in zip(records, rows, strict=True)]
    if shapes:
        numbers = sum(row.multiplicity for row in rows) * modes.scene.n_links
        if numbers > MOST_SHAPE_NUMBERS:
            raise ComputationError(f"the requested shapes have {numbers} angles: choose fewer modes")
        for record, row in zip(found, rows, strict=True):
            record["shapes"] = [_shape_record(modes, row.number - 1, k) for k in range(row.multiplicity)]
    whole = {"scene": describe(modes.scene), "modes": found, "route": modes.route, "notes": list(modes.notes)}
    return as_json(whole)


def _shape_record(modes: Modes, number: int, copy: int) -> dict[str, Any]:
    shape = modes.shape(number, copy)
    angles = [[z.real, z.imag] for z in shape.angles] if shape.angles.dtype.kind == "c" else shape.angles.tolist()
    cart = [shape.cart.real, shape.cart.imag] if isinstance(shape.cart, complex) else shape.cart
    return {
        "direction": "across the rail" if shape.across else "along the rail",
        "cart_m": cart,
        "angles_rad": angles,
        "modal_mass_kg_m2": shape.modal_mass,
        "participation_factor_per_m": finite(shape.participation_factor),
        "kinetic_energy_share": shape.kinetic_energy_share.tolist(),
        "uncertain": shape.uncertain,
    }


def _footnotes(modes: Modes, rows: Sequence[Mode], starred: str) -> list[str]:
    notes = list(modes.notes)
    if any(row.resonances for row in rows):
        notes.append(f"* near a 1:1 or 1:3 resonance, with another mode or among its own: {starred}.")
    if any(row.is_uncertain for row in rows):
        notes.append("! beyond double precision: no digit of this frequency is certain.")
    if any(row.growth_rate for row in rows):
        notes.append("unstable: the scene leaves this equilibrium; every growing mode is paired with a decaying one.")
    if any(row.indistinct for row in rows):
        notes.append("~ closer to the next frequency than the error bounds can distinguish.")
    return notes


def _csv(rows: Sequence[Mode], columns: Sequence[Column]) -> str:
    return csv_rows([[column.key for column in columns], *(record.values() for record in _records(rows, columns))])


def _formatted(name: str, columns: Sequence[Column], cells: list[list[str]], headings: list[str]) -> str:
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
    grid = (_aligned(columns, widths, line) for line in lines)
    return "\n".join([visible(_title(modes)), "", *grid, "", *notes]).rstrip() + "\n"


def _aligned(columns: Sequence[Column], widths: list[int], cells: list[str]) -> str:
    padded = (
        cell.ljust(width) if column.key == "family" else cell.rjust(width)
        for column, width, cell in zip(columns, widths, cells, strict=True)
    )
    return "  ".join(padded).rstrip()


def _markdown(modes: Modes, columns: Sequence[Column], cells: list[list[str]], notes: list[str]) -> str:
    body = _formatted("github", columns, cells, [column.heading for column in columns])
    return "\n".join([f"**{markdown(_title(modes))}**", "", body, *(f"\n{note}" for note in notes)]) + "\n"


def _latex(modes: Modes, columns: Sequence[Column], cells: list[list[str]], notes: list[str]) -> str:
    plain = [
        [cell.replace(NOTHING, "--").replace(">", "$>$").replace("~", r"\textasciitilde{}") for cell in row]
        for row in cells
    ]
    body = _formatted("latex_raw", columns, plain, [column.headed for column in columns])
    return "\n".join([f"% {line}" for line in (one_line(_title(modes)), *notes)] + [body]) + "\n"


def _html(modes: Modes, columns: Sequence[Column], cells: list[list[str]], notes: list[str]) -> str:
    body = _formatted("html", columns, cells, [column.heading for column in columns])
    caption = f"<table>\n<caption>{html(_title(modes))}</caption>"
    return "\n".join([body.replace("<table>", caption, 1), *(f"<p>{html(note)}</p>" for note in notes)]) + "\n"


_WRITERS = {"text": _text, "markdown": _markdown, "latex": _latex, "html": _html}


def matrices_table(scene: Scene, found: Matrices, form: str) -> str:
    """M, K and D of a scene; `form` is text or json."""
    named = {"M": found.M, "K": found.K, "D": found.D}
    if form == "json":
        whole = {
            "scene": describe(scene),
            "coordinates": list(found.labels),
            **{name: matrix.tolist() for name, matrix in named.items()},
        }
        return as_json(whole)
    parts = [f"coordinates ({len(found.labels)}): {', '.join(found.labels)}"]
    for name, matrix in named.items():
        parts.append(f"{name} = 0" if not matrix.any() else f"{name} =\n{_grid(matrix)}")
    return "\n\n".join(parts) + "\n"


def _grid(matrix: Floats) -> str:
    cells = [[f"{value:.10g}" for value in row] for row in matrix]
    width = max(len(cell) for row in cells for cell in row)
    return "\n".join("  " + "  ".join(cell.rjust(width) for cell in row) for row in cells)
