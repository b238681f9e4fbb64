"""A result as its command prints it: a title, then tables and sentences; also as Markdown, CSV, JSON, HTML and LaTeX.

    class Check(Result): ...

A class says `what` it is, which `columns` its rows have, which `footnotes` stand below them, and the `facts` that JSON
has next to them. One that prints more than a table says which `parts` it has, and one with other records which. Every
form is written from these, and what shows at the prompt is how the text begins.

At the prompt a result takes some lines, in a notebook a table, both of bounded size.  `Displayed` shows the fields of a
dataclass; a class that has more to say returns its own `Summary`.  The HTML has no
colours of its own, so that it suits a light and a dark page.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass, fields, is_dataclass
from functools import partial
from importlib import import_module
from inspect import Signature, signature
from itertools import accumulate, islice
from numbers import Complex, Real
from operator import attrgetter
from textwrap import wrap
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from modal.report.escaping import html, latex, visible
from modal.report.fitting import TABLE_ROWS, WIDTH, TableLimit, breadth, cut, fitted, folded, padded, short
from modal.report.tables import LEFT, NOTHING, Form, as_csv, as_json, finite, grid, headed, layout, titled, widths_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PROMPT_LINES = 10
"""Format: lines that a result takes at the prompt."""
TEXT_ROWS = 4
"""Format: rows of a table that are shown at the prompt."""
HTML_ROWS = 10
"""Format: rows of a table that are shown in a notebook."""
TABLE_COLUMNS = 12
"""Format: columns of a table that are shown."""
ARRAY_NUMBERS = 5
"""Format: numbers of an array that are shown in full."""
VALUE_LETTERS = 60
"""Format: letters of a text that are shown in full."""
SCROLLED = '<div style="overflow-x: auto">'
APART = ' style="margin-bottom: 1em"'
END, START = ' style="text-align: right"', ' style="text-align: left"'
Facts = Sequence[tuple[str, str]]


@dataclass(frozen=True)
class Summary:
    """The display of a result: a line on its kind and size, facts by name, and the first rows of a table.

    No more than HTML_ROWS of the `rows` are taken, `total` is their number.  The columns in `words` (by index) are
    text, the others numbers.
    """

    title: str
    facts: Facts = ()
    headings: Sequence[str] = ()
    rows: Iterable[Sequence[str]] = ()
    total: int = 0
    words: frozenset[int] = frozenset()

    def text(self) -> str:
        """At most PROMPT_LINES lines of at most WIDTH columns.

        >>> rows = [("1", "0.5"), ("2", "1.2")]
        >>> print(Summary("2 modes", [("gravity", "9.81 m/s²")], ["mode", "f (Hz)"], rows, 2).text())
        2 modes
          gravity 9.81 m/s²
          mode  f (Hz)
             1     0.5
             2     1.2
        """
        facts = "; ".join(f"{visible(name)} {visible(value)}".strip() for name, value in self.facts)
        words = wrap(facts, WIDTH - 2, max_lines=3, placeholder=" …", break_on_hyphens=False)
        lines = [visible(self.title), *(f"  {line}" for line in [*words, *self._grid()])]
        return "\n".join(
            line if breadth(line) <= WIDTH else f"{next(cut(line, WIDTH - 1))}…" for line in lines[:PROMPT_LINES]
        )

    def html(self) -> str:
        """For a notebook: escaped, without colours, wide tables in a box that scrolls."""
        rows = [f"<tr><th{START}>{html(name)}</th><td{START}>{html(value)}</td></tr>" for name, value in self.facts]
        parts = [f"<p><strong>{html(self.title)}</strong></p>"]
        parts += [f"<table{APART}>", *rows, "</table>"] if rows else []
        return scrolled(*parts, self.table())

    def _cells(self, count: int) -> tuple[list[str], list[list[str]], int]:
        """Headings, the first rows and how many more there are; columns beyond TABLE_COLUMNS are omitted."""
        rows = [list(map(visible, row)) for row in islice(self.rows, count)]
        headings = list(map(visible, self.headings))
        if len(headings) > TABLE_COLUMNS:
            headings = [*headings[: TABLE_COLUMNS - 1], f"… {len(headings) - TABLE_COLUMNS + 1} more"]
            rows = [[*row[: TABLE_COLUMNS - 1], "…"] for row in rows]
        return headings, rows, max(0, self.total - len(rows))

    def _grid(self) -> list[str]:
        headings, rows, left = self._cells(TEXT_ROWS)
        if not rows:
            return []
        widths = widths_of(rows, headings)
        fits = _fitting(widths)
        if fits < len(widths):
            widths = [*widths[:fits], 1]
            headings, *rows = ([*line[:fits], "…"] for line in (headings, *rows))

        def line(cells: list[str]) -> str:
            sides = ("left" if k in self.words else "right" for k in range(len(cells)))
            return "  ".join(map(padded, cells, widths, sides)).rstrip()

        return [*map(line, [headings, *rows]), *[f"… {left} more"] * bool(left)]

    def table(self) -> str:
        """The first rows of the table as HTML; nothing without a row."""
        headings, rows, left = self._cells(HTML_ROWS)
        if not rows:
            return ""

        def line(cells: list[str], kind: str) -> str:
            shown = (
                f"<{kind}{START if k in self.words else END}>{html(cell)}</{kind}>" for k, cell in enumerate(cells)
            )
            return f"<tr>{''.join(shown)}</tr>"

        body = [line(row, "td") for row in rows]
        table = ["<table>", f"<thead>{line(headings, 'th')}</thead>", "<tbody>", *body, "</tbody>", "</table>"]
        return "\n".join(filter(None, [*table, more(left)]))


def _fitting(widths: Sequence[int]) -> int:
    """The number of columns for which there is room, with a last one that says that others are omitted."""
    ends = list(accumulate(width + 2 for width in widths))
    room = WIDTH if ends[-1] <= WIDTH else WIDTH - 3
    return max(1, sum(end <= room for end in ends))


class _ResultSignature:
    """The `__signature__` of a class of results: a default that is made for each result is shown as it is made."""

    def __get__(self, result: object, cls: type) -> Signature:
        if result is not None or not is_dataclass(cls):
            raise AttributeError("__signature__")
        factories = {field.name: field.default_factory for field in fields(cls)}
        parts = [
            part.replace(default=made()) if (made := factories.get(part.name, MISSING)) is not MISSING else part
            for part in list(signature(cls.__init__).parameters.values())[1:]
        ]
        return Signature(parts)


class Displayed:
    """A result with a display at the prompt and in notebooks; by default of its fields.

    `dir` and completion show what is public: no name that begins with an underscore, and none of `internal`.
    """

    __slots__ = ()
    what: ClassVar[str] = ""
    """What it is, in words; its class by default."""
    shows: ClassVar[str] = ""
    """What it shows of itself, as in "omega: ω, rad/s; fold: copies"; its fields by default."""
    __signature__ = _ResultSignature()
    internal: ClassVar[frozenset[str]] = frozenset({"internal"})

    def __dir__(self) -> list[str]:
        return sorted(name for name in {*super().__dir__()} - self.internal if not name.startswith("_"))

    def _summary(self) -> Summary:
        """What is shown; override it where a result has more to say than its fields."""
        return summary_of(self)

    def _title(self) -> str:
        """What it is, in a line."""
        return self._summary().title

    def __repr__(self) -> str:
        return self._summary().text()

    def _repr_html_(self) -> str:
        return self._summary().html()


def tabulated(title: str, facts: Facts, columns: Mapping[str, Any], words: Iterable[str] = ()) -> Summary:
    """A summary whose table has these columns, all of one length; those named in `words` are text.

    >>> print(tabulated("Decay", [], {"time_s": [0.0, 0.5], "x_m": [1.0, 0.25]}).text())
    Decay
      time_s   x_m
           0     1
         0.5  0.25
    """
    shown = list(columns.items())[:TABLE_COLUMNS]
    count = len(shown[0][1]) if shown else 0
    rows = ([brief(values[k]) for _, values in shown] for k in range(count))
    texts = frozenset(k for k, (name, _) in enumerate(shown) if name in set(words))
    left = len(columns) - len(shown)
    all_facts = [*facts, ("also", f"{left} more columns")] if left else facts
    return Summary(title, all_facts, [name for name, _ in shown], rows, count, texts)


def by_column(records: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Records as arrays, one for each key of the first; NaN if there is no value.

    >>> by_column([{"x": 1.0}, {"x": 2.0}])
    {'x': array([1., 2.])}
    """
    from numpy import array, nan

    columns = {key: [record[key] for record in records] for key in (records[0] if records else ())}
    return {key: array([nan if value is None else value for value in values]) for key, values in columns.items()}


def summary_of(result: Any) -> Summary:
    """What a result `shows`, or the fields of a dataclass, of a named tuple, or of nothing."""
    if getattr(result, "shows", ""):
        return Summary(result.what, list(_facts(result)))
    if is_dataclass(result):
        names = [field.name for field in fields(result) if field.repr]
    else:
        names = list(getattr(result, "_fields", ()))
    values = ((name, getattr(result, name)) for name in names if not name.startswith("_"))
    return Summary(type(result).__name__, [(name, brief(value)) for name, value in values if value is not None])


def _facts(result: Displayed) -> Iterator[tuple[str, str]]:
    for words in result.shows.split("; "):
        name, _, description = words.partition(": ")
        heading, _, unit = description.partition(", ")
        value = getattr(result, name)
        if value is not None and value is not False and not (isinstance(value, Sequence) and not value):
            yield heading, f"{'' if value is True else brief(value)} {unit}".strip()


def brief(value: Any) -> str:
    """A value on less than a line: small ones in full, of large ones how large they are.

    >>> brief(0.1), brief((1, 2)), brief({"gravity": 9.81}), brief("a" * 100) == "a" * 59 + "…"
    ('0.1', '1, 2', 'gravity', True)
    """
    if isinstance(value, str):
        return value if len(value) <= VALUE_LETTERS else value[: VALUE_LETTERS - 1] + "…"
    if isinstance(value, Complex):
        return _number(value)
    if getattr(value, "ndim", 0):
        return _array(value)
    if isinstance(value, Mapping | Sequence) and not hasattr(value, "_fields") and not isinstance(value, Displayed):
        return _several(value)
    return first_line(value)


def _number(value: Any) -> str:
    """A number with six significant digits."""
    if value != value:  # noqa: PLR0124
        return NOTHING
    if isinstance(value, bool | int):
        return str(value)
    return short(float(value) + 0.0) if isinstance(value, Real) else f"{complex(value):.6g}"


def scrolled(*parts: str) -> str:
    """HTML in a box that scrolls where it is wider than the page."""
    return "\n".join([SCROLLED, *filter(None, parts), "</div>"])


def more(count: int) -> str:
    """Return how many rows are omitted, as HTML; nothing if none are."""
    return f"<p>… {count} more</p>" if count > 0 else ""


def first_line(value: Any) -> str:
    """The first line of what a value shows."""
    if isinstance(value, Displayed):
        return value._title()
    named = callable(value) or hasattr(value, "__dict__") or hasattr(value, "_fields")
    return type(value).__name__ if named else brief(str(value))


def _array(value: Any) -> str:
    if value.ndim == 1 and value.size <= ARRAY_NUMBERS:
        return ", ".join(map(brief, value.tolist())) or "none"
    return f"{' × '.join(map(str, value.shape))} {'numbers' if value.ndim == 1 else 'array'}"


def _several(values: Mapping[Any, Any] | Sequence[Any]) -> str:
    few = [brief(value) for value in islice(values, ARRAY_NUMBERS)]
    more = len(values) - len(few)
    written = ", ".join([*few, *[f"… {more} more"] * bool(more)]) or "none"
    return written if len(written) <= VALUE_LETTERS else f"{len(values)} of {type(next(iter(values))).__name__}"


def deferred(place: str) -> Callable[..., Any]:
    """The function at `module:name`, imported when it is called.

    By it subpackages below that of a result, which import it, draw and write the result.

    >>> deferred("modal.report.results:brief")(0.5)
    '0.5'
    """
    return partial(_call, *place.split(":"))


def _call(module: str, name: str, /, *arguments: Any, **named: Any) -> Any:
    return getattr(import_module(module), name)(*arguments, **named)


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
