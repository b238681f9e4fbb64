"""The argument parser: help pages with examples, and errors with suggestions and a pointer to help."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from itertools import takewhile, zip_longest
from typing import TYPE_CHECKING, Any, NoReturn

from multipendula.flags import ASIDE, ELSEWHERE, FLAGS, IN_SCENE, SYNONYMS

if TYPE_CHECKING:
    from multipendula.flags import Former

LIKE = 0.7
"""How alike an unknown option and a known one are, for the latter to be suggested."""
MISSING, UNKNOWN = "the following arguments are required: ", "unrecognized arguments: "
REFUSALS = (
    (r"^argument ([^:]+): not allowed with argument (.+)$", r"\1: cannot be combined with \2"),
    (r"^argument ([^:]+): expected .*$", r"\1: needs a value"),
    (r"^argument ([^:]+): (.*)$", r"\1 \2"),
    (r"^ambiguous option: (\S+) could match (.*)$", r"\1: begins several options: \2"),
)
"""How messages of argparse begin and read, and what is said for them."""
ANY = "…"
"""What stands for any value of an argument in a message."""
WIDTH = 79
"""Columns of a page: a terminal of 80, less one for the cursor."""

Examples = tuple[tuple[str, str], ...]
"""Commands, each with a description."""


def shown(examples: Examples) -> str:
    """Examples for a page: the command, continued over lines as a shell reads it, and its description below.

    >>> print(shown((("table chain-3", "three modes"),)))
      multipendula table chain-3
          three modes
    """
    return "\n".join(f"{_folded(f'multipendula {command}')}\n      {words}" for command, words in examples)


def _folded(command: str) -> str:
    """A command wrapped over several lines, with each option and its value on one line."""
    import textwrap

    joined = re.sub(r"( -\S+) (?=[^-])", "\\1\0", command)
    lines = textwrap.wrap(joined, WIDTH - 4, subsequent_indent="    ", break_long_words=False, break_on_hyphens=False)
    return "  " + " \\\n  ".join(lines).replace("\0", " ")


class Page(argparse.ArgumentParser):
    """The parser of one command, or the top-level parser: grouped arguments, and examples."""

    def __init__(self, *, examples: Examples, topics: Mapping[str, Sequence[str]] | None = None, **words: Any) -> None:
        super().__init__(**words, formatter_class=_Columns, add_help=False)
        self.examples, self.topics = examples, topics or {}
        self.given: list[str] = []
        self.reports: dict[str, str] = {}
        self.texts: dict[str, str] = {}
        self.kinds: tuple[str, ...] = ()
        self.usual = ""
        self.keywords: dict[str, str] = {}
        self.refused: dict[str, str] = {}
        self.former: Mapping[str, Former] = {}
        self.asked = self.add_argument_group("arguments")
        self.motion = self.add_argument_group("motion")
        self.computed = self.add_argument_group("computation")
        self.written = self.add_argument_group("output")
        self.more = self.add_argument_group("other")
        self.more.add_argument("-h", "--help", action="help", help=FLAGS["--help"].meaning)

    @property
    def name(self) -> str:
        """The name of the command, empty for the top level."""
        return self.prog.partition(" ")[2]

    @cached_property
    def alone(self) -> argparse._MutuallyExclusiveGroup:
        """Arguments of which one at most is given."""
        return self.asked.add_mutually_exclusive_group()

    @property
    def pointer(self) -> str:
        """The pointer to the help page."""
        return f"see `{self.prog} --help`"

    def format_help(self) -> str:
        """The whole page."""
        columns = self._get_formatter()
        columns.add_usage(self.usage, self._actions, self._mutually_exclusive_groups)
        columns.add_text(self.description)
        for title, actions in self._sections():
            columns.start_section(title)
            columns.add_arguments(actions)
            columns.end_section()
        title = "examples" if self.name else "first steps"
        return f"{columns.format_help()}\n{title}:\n{shown(self.examples)}\n{self._further()}"

    def overview(self) -> str:
        """What there is, on one screen: the commands by topic, without what they do, and first steps."""
        import textwrap

        width = max(map(len, self.topics)) + 2
        topics = (
            textwrap.fill(f"  {topic:<{width}}{', '.join(names)}", WIDTH, subsequent_indent=" " * (width + 2))
            for topic, names in self.topics.items()
            if topic != ASIDE
        )
        about = textwrap.fill(self.description or "", WIDTH)
        steps = f"first steps:\n{shown(self.examples)}"
        further = f"`{self.prog} --help` says what each command does,\n`{self.prog} table --help` how one is used."
        return "\n\n".join([about, "\n".join(["commands:", *topics]), steps, further])

    def _sections(self) -> Iterator[tuple[str | None, list[argparse.Action]]]:
        """Commands by topic, then arguments by title."""
        for chosen in self._positionals._group_actions:
            lines = {line.dest: line for line in chosen._get_subactions()}  # type: ignore[attr-defined]
            yield from ((topic, [lines[name] for name in names]) for topic, names in self.topics.items())
        for group in (self.asked, self.motion, self.computed, self.written, self.more):
            yield group.title, group._group_actions

    def _further(self) -> str:
        return "" if self.name else "\nEvery command has its own help, for example `multipendula table --help`.\n"

    def in_options(self, line: str) -> str:
        """A line of a message of the packages, which do not know the options, in terms of this command's.

        It names an argument at its beginning, before a colon or a value and a colon, or in backticks, perhaps with its
        value, or with an ellipsis or code for any.  A figure's name may end in what its command writes as text too.

        >>> page = Page(prog="multipendula tune", examples=())
        >>> page.keywords = {"output": "--signals", "psd": "--psd"}
        >>> page.in_options("output wind: must be one of x")
        '--signals wind: must be one of x'
        >>> page.in_options("rms: needs `psd=…`")
        'rms: needs --psd CSV'
        """
        if self.reports and line.startswith("-o "):
            known = [f".{kind}" for kind in self.kinds]
            line = re.sub(r"(: the name must end in ).*$", rf"\1{', '.join(known[:-1])} or {known[-1]}", line)
        line = re.sub(r"^\w+(?=:|(?: \S+){1,2}: )", lambda match: self.keywords.get(match[0], match[0]), line)
        return re.sub("`([^`]+)`", self._option_for, line)

    def _option_for(self, match: re.Match[str]) -> str:
        """The option for an argument in backticks, with its value or what stands for any."""
        name, sign, value = re.match(r"([\w.]*)([=(]?)(.*)", match[1]).groups()  # type: ignore[union-attr]
        flag = self.keywords.get(name)
        if flag is None:
            return ELSEWHERE.get(name, match[0])
        import shlex

        metavar = FLAGS[flag].metavar
        if not sign or not metavar:
            return flag
        is_code = sign == "(" or value == ANY or "(" in value
        return f"{flag} {FLAGS[flag].example or metavar if is_code else shlex.quote(value)}"

    def parse_known_args(self, args: Sequence[str] | None = None, namespace: Any = None) -> Any:  # type: ignore[override]
        """As argparse does; the words are kept for error messages."""
        self.given = list(sys.argv[1:] if args is None else args)
        if now := [words for words in self._former_options() if words]:
            self.error("; ".join(dict.fromkeys(now)))
        return super().parse_known_args(self.given, namespace)

    def error(self, message: str) -> NoReturn:
        """Report the mistake and unknown options as every refusal reads, and the help page; exit with code 2."""
        from modal.report import visible

        lines = list(self._strangers())
        if not (lines and message.startswith(UNKNOWN)):
            lines = [*_refusals(message), *lines]
        self.exit(2, "".join(f"multipendula: {visible(line)}\n" for line in (*lines, self.pointer)))

    def _former_options(self) -> Iterator[str]:
        """What to say of former spellings of this command's options, which may be beginnings of new ones."""
        words = list(takewhile(lambda word: word != "--", self.given))
        for word, following in zip_longest(words, words[1:], fillvalue=""):
            flag, equals, value = word.partition("=")
            if flag in self.former:
                yield self.former[flag].words(flag, value if equals else following)

    def _strangers(self) -> Iterator[str]:
        """Unknown options, each with the most similar known one; the top level ignores the words of its commands."""
        from modal.errors import meant

        known = self._option_string_actions
        for word in takewhile(lambda word: word != "--" and (self.name or word[:1] == "-"), self.given):
            name = word.partition("=")[0]
            if name[:2] == "--" and name not in self.former and not any(option.startswith(name) for option in known):
                yield f"{name}: no such option{self._synonym(name) or meant(name, known, near=LIKE)}"

    def _synonym(self, name: str) -> str:
        """The option, perhaps with a value, that this command has for an unknown one; empty if there is none."""
        for words in SYNONYMS.get(name, ()):
            flag, _, value = words.partition(" ")
            action = self._option_string_actions.get(flag)
            if action and (not value or value in (action.choices or (value,))):
                return f" (did you mean {words}?)"
        if name.removeprefix("--") in self.kinds:
            return f" (did you mean -o FILE.{name.removeprefix('--')}?)"
        if name in IN_SCENE:
            varied = next(
                (f", or {flag} varies it" for flag in ("--vary", "--free") if flag in self.keywords.values()), ""
            )
            return f": it stands in the scene's file (`scenes NAME -o mine.toml` copies one){varied}"
        return ""

    def _print_message(self, message: str, file: Any = None) -> None:
        """Raise OSError if it cannot be written, which argparse would swallow."""
        stream = file or sys.stderr
        if message and stream:
            stream.write(message)

    def _get_values(self, action: argparse.Action, arg_strings: list[str]) -> Any:
        """As argparse does, but `--option=--` gives an option no value."""
        if action.option_strings and arg_strings == ["--"]:
            raise argparse.ArgumentError(action, "expected one argument")
        return super()._get_values(action, arg_strings)

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """ArgumentError for a value that is not a choice, with the most similar choice."""
        choices = action.choices
        if choices is not None and value not in choices:
            from modal.errors import meant

            there, near = ", ".join(map(str, choices)), meant(value, choices)
            if not self.name:
                raise argparse.ArgumentError(None, f"{value}: no such command{near}; there are {there}")
            if value in self.kinds:
                near = f" (did you mean -o FILE.{value}?)"
            raise argparse.ArgumentError(action, f"{value}: must be one of {there}{near}")


def _refusals(message: str) -> Iterator[str]:
    """A message of argparse as every refusal reads: the option, perhaps its value, a colon, and what is wrong.

    >>> list(_refusals("argument --duration: ten: must be a number of seconds above 0"))
    ['--duration ten: must be a number of seconds above 0']
    >>> list(_refusals("the following arguments are required: SCENE, --output/-o"))
    ['SCENE: is missing', '-o: is missing']
    """
    message = re.sub(r"--[a-z-]+/(-[a-z])\b", r"\1", message)
    if message.startswith(MISSING):
        yield from (f"{name}: is missing" for name in message.removeprefix(MISSING).split(", "))
        return
    if message.startswith(UNKNOWN):
        yield f"{message.removeprefix(UNKNOWN)}: is more than this command takes"
        return
    for pattern, words in REFUSALS:
        message, changed = re.subn(pattern, words, message, count=1)
        if changed:
            break
    yield message


class _Columns(argparse.HelpFormatter):
    def __init__(self, prog: str, **words: Any) -> None:
        super().__init__(prog, **{"width": WIDTH, "max_help_position": 26} | words)


class Version(argparse.Action):
    """Print the version and exit."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        """Print it."""
        from importlib.metadata import version

        print(f"multipendula {version('multipendula')}")
        parser.exit()
