"""Output: tables, CSV and JSON, numbers in running text, escaped text.

In: titles, columns and rows.  Out: text, Markdown, LaTeX, CSV, HTML or JSON in which no text of a scene can act as
markup or code.  This room is independent of pendula.  Start with `escaping`; by `display` results show themselves.
"""

from modal.report.display import (
    HTML_ROWS,
    TEXT_ROWS,
    Displayed,
    Summary,
    brief,
    deferred,
    more,
    scrolled,
    summary_of,
    title_of,
)
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
from modal.report.prose import WIDTH, capital, counted, listed, percent, rad, short, with_unit
from modal.report.tables import NOTHING, as_csv, as_json, digits, finite, grid, titled

__all__ = [
    "HTML_ROWS",
    "LETTERS",
    "NOTHING",
    "TEXT_ROWS",
    "WIDTH",
    "Displayed",
    "Summary",
    "as_csv",
    "as_json",
    "brief",
    "c_comment",
    "capital",
    "counted",
    "csv_cell",
    "csv_comment",
    "csv_rows",
    "deferred",
    "digits",
    "finite",
    "grid",
    "html",
    "json_text",
    "latex",
    "listed",
    "markdown",
    "matlab_text",
    "modelica_text",
    "more",
    "one_line",
    "percent",
    "python_text",
    "rad",
    "scrolled",
    "short",
    "summary_of",
    "title_of",
    "titled",
    "visible",
    "with_unit",
]
