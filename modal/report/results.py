"""A result as its command prints it: a title, then tables and sentences; also as Markdown, CSV, JSON, HTML and LaTeX.

    class Check(Result): ...

A class says `what` it is, which `columns` its rows have, which `footnotes` stand below them, and the `facts` that JSON
has next to them. One that prints more than a table says which `parts` it has, and one with other records which. Every
form is written from these, and what shows at the prompt is how the text begins.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import islice
from operator import attrgetter
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from modal.report.display import HTML_ROWS, PROMPT_LINES, TEXT_ROWS, Displayed, Summary, by_column, deferred, scrolled
from modal.report.escaping import html, latex, visible
from modal.report.fitting import TABLE_ROWS, TableLimit, fitted, folded
from modal.report.prose import WIDTH
from modal.report.tables import LEFT, NOTHING, Form, as_csv, as_json, finite, grid, headed, layout, titled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SIGNIFICANT = re.compile(r"[-+]?\.(\d+)g")
DECIMAL = re.compile(r"(?P<sign>[-+]?)(?P<whole>\d+)(?:\.(?P<decimals>\d+))?")
NOTEBOOK_LINES = 40
"""Format: lines of a result that is text in a notebook."""


class ReportColumn(NamedTuple):
    """A quantity of every row: its `value`, a function or the name of an attribute, its `key` and its `heading`.

    Without a key it is in text alone, without a heading in records alone.  `shown` writes a finite value in text, as a
    format, or as a function any value.

    >>> size = ReportColumn(len, "size_m", "size (m)", ".1f")
    >>> size.cell("abc"), size.of("abc"), ReportColumn(float, "x", "x").cell("nan")
    ('3.0', 3, '–')
    """

    value: str | Callable[[Any], Any]
    key: str | None = None
    heading: str | None = None
    shown: str | Callable[[Any], str] = ""

    def of(self, row: Any) -> Any:
        """The value of a row."""
        return attrgetter(self.value)(row) if isinstance(self.value, str) else self.value(row)

    def cell(self, row: Any) -> str:
        """The value of a row in text."""
        value = self.of(row)
        if callable(self.shown):
            return self.shown(value)
        return NOTHING if finite(value) is None else format(value, self.shown)

    def cells(self, rows: Sequence[Any]) -> list[str]:
        """The values of these rows in text; of a format with significant digits none is dropped that others show."""
        written = [self.cell(row) for row in rows]
        digits = SIGNIFICANT.fullmatch(self.shown) if isinstance(self.shown, str) else None
        return evened(written, int(digits[1])) if digits else written


def evened(numbers: Sequence[str], significant: int) -> list[str]:
    """Decimal numbers with as many decimals as the one that has most, and with this many significant digits at most.

    >>> evened(["7.18867087", "7.2094781", "12.5", "0", "1e-09"], 9)
    ['7.18867087', '7.20947810', '12.5000000', '0', '1e-09']
    """
    parts = [DECIMAL.fullmatch(number) for number in numbers]
    most = max((len(part["decimals"] or "") for part in parts if part), default=0)

    def full(number: str, part: re.Match[str] | None) -> str:
        if part is None or not float(number):
            return number
        decimals = part["decimals"] or ""
        room = min(most - len(decimals), significant - len((part["whole"] + decimals).lstrip("0")))
        return number if room <= 0 else f"{part['sign']}{part['whole']}.{decimals}{'0' * room}"

    return [full(number, part) for number, part in zip(numbers, parts, strict=True)]


class ReportTable(NamedTuple):
    """Cells of text under headings; columns of the `spare` ones are omitted first where there is no room for all."""

    headings: Sequence[str]
    cells: Sequence[Sequence[str]]
    spare: Sequence[str] = ()

    @classmethod
    def of(cls, columns: Iterable[ReportColumn], rows: Iterable[Any]) -> ReportTable:
        """The columns that have a heading, of these rows."""
        shown, every = [column for column in columns if column.heading is not None], list(rows)
        cells = zip(*(column.cells(every) for column in shown), strict=True)
        return cls([str(column.heading) for column in shown], [list(row) for row in cells])

    def written(self, form: str = "text") -> str:
        """The table as text or Markdown; the empty string if it has no rows."""
        return grid(self.cells, self.headings, form, self.spare)

    def beginning(self, rows: int) -> tuple[str, int]:
        """The table as text to the end of these rows, as it is laid out for more, and how many follow."""
        align = ["left" if heading in LEFT else "right" for heading in self.headings]
        body, _ = layout(self.cells, self.headings, align, self.spare)
        lines, hidden = body.split("\n"), min(len(self.cells), TABLE_ROWS) - rows
        return "\n".join(lines[: -hidden or None] if hidden > 0 else lines), max(len(self.cells) - rows, 0)


def records_of(columns: Iterable[ReportColumn], rows: Iterable[Any]) -> list[dict[str, Any]]:
    """A mapping for each row, of the columns that have a key; None if a value is not finite."""
    kept = [column for column in columns if column.key]
    return [{str(column.key): finite(column.of(row)) for column in kept} for row in rows]


class TextResult(Displayed):
    """A result whose display is the beginning of its command's `text`, for a terminal of WIDTH columns.

    The `writer`, a `module:function`, writes it.
    """

    __slots__ = ()
    writer: ClassVar[str]

    def text(self) -> str:
        """The report as text."""
        written: str = deferred(self.writer)(self)
        return written

    def _title(self) -> str:
        return next(iter(self._lines()))

    def _lines(self) -> Iterable[str]:
        """The lines that may be shown."""
        return folded("\n".join(map(visible, self.text().rstrip("\n").split("\n")))).split("\n")

    def __repr__(self) -> str:
        with fitted(WIDTH, most=TableLimit(TABLE_ROWS)):
            lines = list(islice(self._lines(), PROMPT_LINES + 1))
        return "\n".join(lines if len(lines) <= PROMPT_LINES else [*lines[: PROMPT_LINES - 1], "…"])

    def _repr_html_(self) -> str:
        with fitted(WIDTH, most=TableLimit(TABLE_ROWS)):
            lines = list(islice(self._lines(), NOTEBOOK_LINES + 1))
        shown = "\n".join(map(html, lines[:NOTEBOOK_LINES]))
        return scrolled(f"<pre>{shown}</pre>", "<p>…</p>" * (len(lines) > NOTEBOOK_LINES))


class Result(TextResult):
    """A result about a `scene` in all output forms; its parts are computed only as far as they are shown."""

    __slots__ = ()
    what: ClassVar[str] = ""
    key: ClassVar[str] = "rows"
    """Its description, under the title of the scene, and the key of its records in JSON."""
    scene: Any
    rows: Any

    def titles(self) -> tuple[str, str]:
        """The title of the scene, and that of the report."""
        return deferred("modal.scene:title_of")(self.scene), self.what

    def entries(self) -> Iterable[Any]:
        """The objects with a row each."""
        return tuple(self.rows)

    def columns(self) -> Sequence[ReportColumn]:
        """The quantities of a row."""
        return ()

    def footnotes(self) -> Iterable[str]:
        """Lines below the table."""
        return ()

    def facts(self) -> dict[str, Any]:
        """The JSON keys before the records."""
        return {}

    def parts(self, form: Form = "text") -> Iterable[ReportTable | str]:
        """The parts printed below the title."""
        yield ReportTable.of(self.columns(), self.entries())
        yield "\n".join(self.footnotes())

    def records(self) -> Iterable[dict[str, Any]]:
        """The rows of CSV; None if a value has no meaning."""
        return records_of(self.columns(), self.entries())

    def whole(self) -> dict[str, Any]:
        """The contents of JSON."""
        described = {"scene": deferred("modal.scene:describe")(self.scene)}
        rows = [{key: finite(value) for key, value in record.items()} for record in self.records()]
        return {**described, **self.facts(), self.key: rows}

    def to_dict(self) -> dict[str, Any]:
        """The rows of CSV as arrays by their keys."""
        return by_column(list(self.records()))

    def report(self, form: Form = "text", *, title: str = "", **more: Any) -> str:
        """The whole of it as text, markdown, csv or json, the `form`, under a title in place of the scene's.

        `more` is for its parts or its contents.
        """
        if form == "csv":
            return as_csv(list(self.records()))
        parts: Callable[..., Iterable[ReportTable | str]] = self.parts
        whole: Callable[..., dict[str, Any]] = self.whole
        if form == "json":
            return as_json(whole(**more))
        scene, what = self.titles()
        return titled(title or scene, what, [_written(part, form) for part in parts(form, **more)], form)

    def text(self) -> str:
        """The report as text."""
        return self.report()

    def _lines(self) -> Iterator[str]:
        """How the text begins: to the end of the first table of which rows are omitted."""
        scene, what = self.titles()
        yield from headed(f"{scene}: {what}").split("\n")
        for part in self.parts():
            text, left = _written(part, "text"), 0
            if isinstance(part, ReportTable) and len(part.cells) > TEXT_ROWS:
                text, left = part.beginning(TEXT_ROWS)
            if not text:
                continue
            yield ""
            yield from (line for whole in text.split("\n") for line in folded(visible(whole)).split("\n"))
            if left > 0:
                yield f"… {left} more"
                return

    def _repr_html_(self) -> str:
        parts, tables = [f"<p><strong>{html(': '.join(self.titles()))}</strong></p>"], 0
        for part in self.parts():
            if isinstance(part, ReportTable):
                words = frozenset(k for k, heading in enumerate(part.headings) if heading in LEFT)
                parts.append(Summary("", (), part.headings, part.cells, len(part.cells), words).table())
                tables += 1
            else:
                parts += [f"<p>{html(line)}</p>" for line in part.split("\n") if line]
            if tables == 2:
                break
        return scrolled(*parts)

    def _repr_latex_(self) -> str | None:
        table = next((part for part in self.parts() if isinstance(part, ReportTable)), None)
        if table is None:
            return None
        lines = [" & ".join(map(latex, row)) + r" \\" for row in (table.headings, *table.cells[:HTML_ROWS])]
        align = "".join("l" if heading in LEFT else "r" for heading in table.headings)
        return "\n".join([rf"\begin{{tabular}}{{{align}}}", lines[0], r"\hline", *lines[1:], r"\end{tabular}"])


def _written(part: ReportTable | str, form: str) -> str:
    return part if isinstance(part, str) else part.written(form)


class Drawable:
    """A result with a figure, which the function at `figure`, a `module:name`, draws."""

    __slots__ = ()
    figure: ClassVar[str]

    def plot(self, **options: Any) -> Figure:
        """A matplotlib figure; the options are those of the function of `modal.plotting` or `nonlinear.plotting`.

        A `theme`, light or dark, is an option of all; by default it is the style in force, and light where that is
        matplotlib's own.
        """
        drawn: Figure = deferred("modal.plotting.style:figure_at")(self.figure, self, **options)
        return drawn
