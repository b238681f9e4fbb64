"""Output: tables, CSV and JSON, numbers in running text, escaped text.

In: titles, columns and rows.  Out: text, Markdown, LaTeX, CSV, HTML or JSON in which no text of a scene can act as
markup or code; text fits the columns of a terminal where `fitted` sets them.  This room is independent of pendula.
Start with `escaping`.
"""

from modal.report.escaping import (
    LETTERS,
    c_comment,
    csv_cell,
    csv_comment,
    csv_rows,
    html,
    json_text,
    latex,
    markdown,
    matlab_text,
    modelica_text,
    one_line,
    python_text,
    visible,
)
from modal.report.fitting import breadth, columns, filled, fitted, folded, padded
from modal.report.prose import WIDTH, capital, counted, line_width, listed, percent, rad, short, with_unit
from modal.report.tables import NOTHING, aligned, as_csv, as_json, digits, finite, full, grid, titled, widths_of

__all__ = [
    "LETTERS",
    "NOTHING",
    "WIDTH",
    "aligned",
    "as_csv",
    "as_json",
    "breadth",
    "c_comment",
    "capital",
    "columns",
    "counted",
    "csv_cell",
    "csv_comment",
    "csv_rows",
    "digits",
    "filled",
    "finite",
    "fitted",
    "folded",
    "full",
    "grid",
    "html",
    "json_text",
    "latex",
    "line_width",
    "listed",
    "markdown",
    "matlab_text",
    "modelica_text",
    "one_line",
    "padded",
    "percent",
    "python_text",
    "rad",
    "short",
    "titled",
    "visible",
    "widths_of",
    "with_unit",
]
