"""What a command is, what it takes of the table of options, and what it says after the meaning of each."""

from __future__ import annotations

import argparse
import os
import re
from collections.abc import Callable, Mapping, Sequence
from textwrap import dedent
from typing import Any, NamedTuple

from multipendula.completion import Completer, files, scenes
from multipendula.flags import FLAGS, FORMER, Flag
from multipendula.options import MOVING, PICTURES, RUNS, TEXTS, endings
from multipendula.parser import Examples, Page


class Option(NamedTuple):
    """An option or an argument of a command.

    On its page `more` stands after the meaning, or after that of a file its contents.  `how` goes to argparse, and
    `ends` to the page: which endings of its file choose a format, and which are refused.  A file that is not named is
    called as the scene, with `usual` for the end of its name.
    """

    name: str
    flag: Flag
    more: str = ""
    how: Mapping[str, Any] | None = None
    ends: Mapping[str, Mapping[str, str]] | None = None
    usual: str = ""

    @property
    def dest(self) -> str:
        """Its name in a parser."""
        return (self.how or {}).get("dest", self.name.removeprefix("--").replace("-", "_"))  # type: ignore[no-any-return]

    @property
    def keyword(self) -> str:
        """The argument of the packages' functions that it becomes."""
        return self.flag.keyword or self.dest

    @property
    def words(self) -> str:
        """Its text on the help page."""
        ends = endings(self.flag.kinds)
        told = f"{', '.join(ends[:-1])} or {ends[-1]}" if ends[1:] else "".join(ends)
        usual = f" (default SCENE{self.usual})" if self.usual else ""
        return f"{self.flag.words}{self.more}{(', as ' if self.more else ': ') if told else ''}{told}{usual}"

    def add_to(self, page: Page) -> None:
        """Add it to a page."""
        flag, name = self.flag, self.name
        names = [name, flag.short] if flag.short else [name]
        extra = dict(self.how or {})
        if "usual" in extra:
            page.set_defaults(usual=extra.pop("usual"))
        is_switch = name in FLAGS and not flag.metavar and not flag.choices
        how = {
            "type": flag.type,
            "action": "store_true" if is_switch else flag.action,
            "choices": flag.choices,
            "default": flag.default,
        }
        how = {key: value for key, value in (how | {"metavar": flag.metavar or None}).items() if value is not None}
        action = getattr(page, flag.group).add_argument(*names, help=self.words, **how, **extra)
        offered = files(endings(flag.kinds)) if flag.metavar == "FILE" else flag.completion
        if offered:
            action.completer = offered
        if name in FLAGS and flag.metavar != "FILE":
            page.keywords |= dict.fromkeys((self.dest, *flag.names, self.keyword), name)
        if flag.short == "-o":
            page.kinds, page.usual = flag.kinds, self.usual
        for kept, formats in (self.ends or {}).items():
            setattr(page, kept, dict(formats))


Takes = str | Option
"""An option as it stands in the table, with the words after its meaning: "--modes, counted from 1"."""
CREW = ("--workers (default one per core)", "--scheduler, such as tcp://192.168.0.2:8786")
THEME = "--theme (default light)"
TOLERANCE = "--tolerance (default 1e-9)"


def option(words: str, **changes: Any) -> Option:
    """An option with what this command changes: fields of its entry in the table, or arguments of argparse."""
    name, more = re.match(r"(--[a-z-]+)(.*)", words, re.DOTALL).groups()  # type: ignore[union-attr]
    fields = {key: changes.pop(key) for key in Flag._fields if key in changes}
    return Option(name, FLAGS[name]._replace(**fields), more, changes)


def argument(name: str, metavar: str, words: str, completion: Completer | None = None, **how: Any) -> Option:
    """An argument that is given without a flag."""
    return Option(name, Flag(metavar, words, completion=completion), how=how)


def scene_argument(more: str = "", kinds: Sequence[str] = ("toml",), names: Sequence[str] = (), **how: Any) -> Option:
    """The scene; `more` describes other accepted files, with these endings or names."""
    words = "a scene file, the name of a shipped scene (see `multipendula scenes`), or - for standard input"
    return argument("scene", "SCENE", words + more, scenes(endings(kinds), names), **how)


SCENE = scene_argument()
RUN = scene_argument(f"; or a saved run ({' or '.join(endings(RUNS))})", ("toml", *RUNS))


def once(words: str, **changes: Any) -> Option:
    """An option that is given several times elsewhere, of which this command takes one."""
    return option(words, most=1, **changes)


TABLES = (".csv", ".tsv", ".txt", ".dat", ".mat", ".npz", ".parquet")
"""Endings of tables of numbers."""


def records(more: str = "") -> tuple[Takes, ...]:
    """Files of measured motions, the rows that are used, and the meaning of their angles."""
    words = f"files with time_s and theta_1_1_rad (or _deg), cart_m and other sensors, CSV or other tables{more}"
    return (
        argument("data", "DATA.csv", words, files(TABLES), nargs="+"),
        "--where: those with this value or range in a column: use=identify or time_s=6.2:19; repeat for several",
        "--every",
        "--column: t=time_ms, theta_1_1_rad=theta_1_1_deg or theta_1_1_rad=-theta_1_1_rad; repeat for several",
        "--pixel",
        "--angles (default absolute)",
    )


def main_file(what: str, kinds: Sequence[str], usual: str = "") -> Option:
    """The file of the main result, its contents, and the end of its name after the scene's where none is given."""
    return option(f"--output: {what}", kinds=tuple(kinds))._replace(usual=usual)


def file_beside(scene: object, end: str) -> str:
    """A file in this folder that is called as a scene, with this end of its name.

    >>> file_beside("scenes/mine.toml", "-shapes.png"), file_beside("-", ".mat")
    ('mine-shapes.png', 'scene.mat')
    """
    stem = os.path.basename(scene) if isinstance(scene, str) and scene != "-" else "scene"
    return next((stem.removesuffix(f".{kind}") for kind in ("toml", *RUNS) if stem.endswith(f".{kind}")), stem) + end


def formats(*names: str, more: str = "") -> Option:
    """The format of the output."""
    return option(f"--format{more or f' (default {names[0]})'}", choices=names, default=names[0])


def _formats_by_ending(names: Sequence[str]) -> dict[str, str]:
    """The format for each ending of a file; slides have none of their own, a MAT file has the columns of CSV."""
    return {f".{TEXTS[name]}": name for name in names if name in TEXTS} | ({".mat": "csv"} if "csv" in names else {})


def text_file(*names: str, kind: str = "", drawn: bool = False, more: Sequence[str] = ()) -> tuple[Option, ...]:
    """The format of the output, and a file for it, in the format that its name ends in unless one is requested.

    Text of one format alone is a file of this `kind`, or of any.  A figure may be `drawn` there instead
    (`shared.picture_in_place`), also in `more` formats.
    """
    kinds = [
        *([kind] if kind else ()),
        *(end[1:] for end in _formats_by_ending(names)),
        *((*PICTURES, *more) if drawn else ()),
    ]
    what = "text or a figure" if drawn else "text"
    refused = dict.fromkeys(endings(MOVING if drawn else (*PICTURES, *MOVING)), f"this command writes {what}")
    file = main_file("the text or the figure" if drawn else "the text", kinds)
    texts = {f".{kind}": "text"} if kind else _formats_by_ending(names)
    ends = {"texts": texts, "refused": refused}
    return (*([formats(*names)] if names else ()), file._replace(ends=ends))


def report_file(*names: str) -> tuple[Takes, ...]:
    """A file for a figure, or for the text instead, in the one of these formats that its name ends in, and colours."""
    ends = _formats_by_ending(names or ("text",))
    file = main_file("the figure or the text", (*PICTURES, *(end[1:] for end in ends)))
    return (file._replace(ends={"reports": ends}), THEME)


def picture_file(what: str = "") -> tuple[Takes, ...]:
    """A file for a figure next to the main result, and its colours."""
    return (f"--picture{what and ': '}{what}", THEME)


EXAMPLES = re.compile(r"\n *Examples\n *-+\n")
EXAMPLE = re.compile(r"((?:^\S.*\n)+)((?:^ +.*\n?)+)", re.MULTILINE)
"""Where the examples of a docstring begin, and one of them: a command, and its description further to the right."""


class Command(NamedTuple):
    """A command under a topic of `multipendula --help`.

    It is called as the function `run`, whose docstring is the text of its page: a line, the details, and examples, each
    a command with its description below.  On the screen of -h are the `main` options, five at most, and the first three
    examples.  Tests run all of these in order.
    """

    topic: str
    run: Callable[[argparse.Namespace], Any]
    takes: tuple[Takes, ...]
    main: tuple[str, ...]

    @property
    def name(self) -> str:
        """Its name."""
        return self.run.__name__

    @property
    def summary(self) -> str:
        """Its purpose, on one line."""
        return (self.run.__doc__ or "").partition("\n")[0]

    @property
    def details(self) -> str:
        """What its page says after that."""
        text, *_ = EXAMPLES.split(self.run.__doc__ or "")
        return " ".join(text.split()).removeprefix(self.summary).lstrip()

    @property
    def examples(self) -> Examples:
        """Commands, each with a description."""
        _, *texts = EXAMPLES.split(self.run.__doc__ or "")  # without docstrings (python -OO) there are none
        examples = (example for text in texts for example in EXAMPLE.findall(dedent(text)))
        return tuple((" ".join(words.split()), " ".join(about.split())) for words, about in examples)

    @property
    def options(self) -> tuple[Option, ...]:
        """Its options, with those of every command."""
        return tuple(option(taken) if isinstance(taken, str) else taken for taken in (*self.takes, "--quiet"))

    def page(self, make: Callable[..., Page] | None = None) -> Page:
        """Its page, made by itself or by the `add_parser` of a page of several commands."""
        about: dict[str, Any] = {"description": f"{self.summary} {self.details}", "examples": self.examples}
        page = make(self.name, help=self.summary, **about) if make else Page(prog=f"multipendula {self.name}", **about)
        for taken in self.options:
            taken.add_to(page)
        page.former = {flag: former for (command, flag), former in FORMER.items() if command == self.name}
        page.main = self.main
        page.set_defaults(run=self.run, page=page, command=self)
        return page


def kwargs_of(options: argparse.Namespace, *flags: str) -> dict[str, Any]:
    """The arguments that these options of a command become, without those that were not given."""
    taken = {option.name: option for option in options.command.options}
    values = {taken[flag].keyword: getattr(options, taken[flag].dest) for flag in flags}
    return {keyword: value for keyword, value in values.items() if value is not None}


def misfits(options: argparse.Namespace, why: str, *flags: str) -> list[str]:
    """The remark on those of these options of a command that have another value than their default."""
    taken = {option.name: option.dest for option in options.command.options}
    given = [flag for flag in flags if getattr(options, taken[flag]) != options.page.get_default(taken[flag])]
    return [f"{flag}: {why}" for flag in given]


def refuse(options: argparse.Namespace, why: str, *flags: str) -> None:
    """Raise SceneError for those of these options that have another value than their default."""
    from modal.errors import refuse_any

    refuse_any(misfits(options, why, *flags))
