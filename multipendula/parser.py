"""The argument parser: help pages with examples, and errors with suggestions and a pointer to help."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from itertools import takewhile, zip_longest
from typing import TYPE_CHECKING, Any, NoReturn

from multipendula.flags import ASIDE, ELSEWHERE, FLAGS, IN_SCENE, STREAM, SYNONYMS

if TYPE_CHECKING:
    from multipendula.flags import Former

ANY = "…"
"""The placeholder of any value of an argument in a message."""
PAGE_COLUMNS = 79
"""Format: columns of a page: a terminal of 80, less one for the cursor."""
HELP_INDENT = 26
"""Format: columns before the meaning of an option."""
SCREEN_LINES = 30
"""Format: lines of a screen, into which the page of `-h` fits."""
ARGUMENT = re.compile(r"argument (?P<name>[^:\s]+): (?P<words>.*)", re.DOTALL)
"""The errors of argparse about one argument, in these words or else in those of its converter, the value first."""
SAID = (
    (r"expected (one|at least one) argument", "{name}: needs a value{value}"),
    (r"not allowed with argument (?P<other>\S+)", "{name}: cannot be combined with {other}"),
    (r"ignored explicit argument .*", "{name}: takes no value"),
    (r"is given twice.*", "{name}: {words}"),
    (r".*", "{name} {words}"),
)

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
    lines = textwrap.wrap(
        joined, PAGE_COLUMNS - 4, subsequent_indent="    ", break_long_words=False, break_on_hyphens=False
    )
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
        self.main: Sequence[str] = ()
        self.asked = self.add_argument_group("arguments")
        self.motion = self.add_argument_group("motion")
        self.computed = self.add_argument_group("computation")
        self.written = self.add_argument_group("output")
        self.more = self.add_argument_group("other")
        self.more.add_argument("-h", "--help", action=Help, nargs=0, help=FLAGS["--help"].meaning)
        self.numerics = self.add_argument_group("numerics")

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
        further = "" if self.name else "\nEvery command has its own help, for example `multipendula table --help`.\n"
        return f"{columns.format_help()}\n{title}:\n{shown(self.examples)}\n{further}"

    def overview(self) -> str:
        """The overview, on one screen: the commands by topic, without their purposes, and first steps."""
        import textwrap

        width = max(map(len, self.topics)) + 2
        topics = (
            textwrap.fill(f"  {topic:<{width}}{', '.join(names)}", PAGE_COLUMNS, subsequent_indent=" " * (width + 2))
            for topic, names in self.topics.items()
            if topic != ASIDE
        )
        about = textwrap.fill(self.description or "", PAGE_COLUMNS)
        steps = f"first steps:\n{shown(self.examples)}"
        further = f"`{self.prog} --help` says what each command does,\n`{self.prog} table -h` how one is used."
        return "\n\n".join([about, "\n".join(["commands:", *topics]), steps, further])

    def screen(self) -> str:
        """The most important part of the page, on one screen: purpose, main options, examples."""
        pages = ("\n\n".join(self._screen(lines)) for lines in (2, 1))
        return min(pages, key=lambda page: page.count("\n") >= SCREEN_LINES)

    def _screen(self, most: int) -> Iterator[str]:
        """The parts of that, of each option this many lines at most."""
        import textwrap

        columns = self._get_formatter()
        options = [action for action in self._actions if action.option_strings]
        first = [action for action in self._actions if not action.option_strings]
        words = [columns._format_args(action, action.dest.upper()) for action in first]
        words += [_brief_name(action) for action in options if action.required]
        yield textwrap.fill(f"usage: {self.prog} {' '.join(words)} [options]", PAGE_COLUMNS, subsequent_indent="    ")
        yield textwrap.fill((self.description or "").partition(". ")[0].removesuffix(".") + ".", PAGE_COLUMNS)
        shown_here = [*first, *(self._option_string_actions[flag] for flag in self.main)]
        yield "\n".join(
            line for action in shown_here for line in self._brief_lines(action, most if action.option_strings else 1)
        )
        yield f"examples:\n{shown(self.examples[:3])}"
        yield f"`{self.prog} --help` has all {len(options)} options and what they mean."

    def _brief_lines(self, action: argparse.Action, most: int) -> list[str]:
        """The meaning of an argument, in at most this many lines."""
        import textwrap

        columns = self._get_formatter()
        name = _brief_name(action) if action.option_strings else columns._format_args(action, action.dest.upper())
        words = columns._expand_help(action) if action.help else "one of these words"
        if action.metavar == "FILE":
            words = words.replace(STREAM, "").removeprefix(f"{FLAGS['--output'].meaning}: ")
        elif action.option_strings and action.choices:
            words = f"{', '.join(map(str, action.choices))}: {words}"
        lines = textwrap.wrap(words, PAGE_COLUMNS - HELP_INDENT)
        if len(lines) > most:
            cut = words[len(" ".join(lines[: most - 1])) :].lstrip()[: PAGE_COLUMNS - HELP_INDENT - 1]
            lines[most - 1 :] = [re.sub("[^ ,]*$", "…", cut, count=1)]
        rest = [" " * HELP_INDENT + line for line in lines]
        return (
            [f"  {name:<{HELP_INDENT - 2}}{lines[0]}", *rest[1:]]
            if len(name) < HELP_INDENT - 3
            else [f"  {name}", *rest]
        )

    def _sections(self) -> Iterator[tuple[str | None, list[argparse.Action]]]:
        """Commands by topic, then arguments by title."""
        for chosen in self._positionals._group_actions:
            lines = {line.dest: line for line in chosen._get_subactions()}  # type: ignore[attr-defined]
            yield from ((topic, [lines[name] for name in names]) for topic, names in self.topics.items())
        for group in (self.asked, self.motion, self.computed, self.written, self.more, self.numerics):
            yield group.title, group._group_actions

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
        """The option for an argument in backticks, with its value or a placeholder."""
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
        """Report the mistake, unknown options and the help page; exit with code 2."""
        from modal.report import visible

        lines = map(visible, filter(None, [*self._in_our_words(message), *self._strangers(), self.pointer]))
        self.exit(2, "".join(f"multipendula: {line}\n" for line in lines))

    def refuse_words(self, words: Sequence[str]) -> NoReturn:
        """Report words that no argument takes."""
        unknown = [word for word in words if word[:1] == "-"]
        short = [f"{word}: no such option" for word in unknown if word[:2] != "--"]
        self.error("\n".join(short if unknown else (f"{word}: unexpected argument" for word in words)))

    def _in_our_words(self, message: str) -> Iterator[str]:
        """An error of argparse in the form of other messages: its subject, and a colon."""
        if about := ARGUMENT.fullmatch(message):
            name, words = about["name"], about["words"]
            action = next((a for a in self._actions if name == argparse._get_action_name(a)), None)
            if action is None or not action.option_strings:
                yield words
                return
            value = f", {action.metavar}" if action.metavar else ""
            for pattern, ours in SAID:
                if match := re.fullmatch(pattern, words, re.DOTALL):
                    more = {key: _long(said) for key, said in match.groupdict().items()}
                    yield ours.format(name=_long(name), words=words, value=value, **more)
                    return
        told, _, names = message.partition(": ")
        if told == "the following arguments are required":
            yield from (f"{_long(name)}: is required" for name in names.split(", "))
        elif told == "ambiguous option":
            option, _, known = names.partition(" could match ")
            yield f"{option}: may be {' or '.join(known.split(', '))}"
        else:
            yield from message.split("\n")

    def _former_options(self) -> Iterator[str]:
        """The message on former spellings of this command's options, which may be beginnings of new ones."""
        words = list(takewhile(lambda word: word != "--", self.given))
        for word, following in zip_longest(words, words[1:], fillvalue=""):
            flag, equals, value = word.partition("=")
            if flag in self.former:
                yield self.former[flag].words(flag, value if equals else following)

    def _strangers(self) -> Iterator[str]:
        """Unknown options, each with the most similar known one; the top level ignores the words of its commands."""
        from modal.errors import spelling_hint

        known = self._option_string_actions
        for word in takewhile(lambda word: word != "--" and (self.name or word[:1] == "-"), self.given):
            name = word.partition("=")[0]
            if name[:2] == "--" and name not in self.former and not any(option.startswith(name) for option in known):
                yield f"{name}: no such option{self._synonym(name) or spelling_hint(name, known)}"

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
            return f": it is set in the scene's file (`scenes NAME -o mine.toml` copies one){varied}"
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
            from modal.errors import spelling_hint

            there = ", ".join(map(str, choices))
            like = f" (did you mean -o FILE.{value}?)" if value in self.kinds else spelling_hint(value, choices)
            if not self.name and value in SYNONYMS:
                like = f" (did you mean {SYNONYMS[value][0]}?)"
            told = f"{like}: must be one of {there}" if self.name else f": no such command{like}; there are {there}"
            raise argparse.ArgumentError(action, f"{value}{told}")


def _long(names: str) -> str:
    """The long name of an option that argparse calls by both."""
    return next((name for name in names.split("/") if name[:2] == "--"), names)


def _brief_name(action: argparse.Action) -> str:
    """An option by one of its names, -o by this, and a placeholder for its value."""
    name = "-o" if "-o" in action.option_strings else action.option_strings[0]
    value = "" if action.nargs == 0 else str(action.metavar or "WORD")
    return f"{name} {value}".strip()


class _Columns(argparse.HelpFormatter):
    def __init__(self, prog: str, **words: Any) -> None:
        super().__init__(prog, **{"width": PAGE_COLUMNS, "max_help_position": HELP_INDENT} | words)


class Help(argparse.Action):
    """Print the whole help page, or with -h one screen of it, and exit."""

    def __call__(self, parser: Any, namespace: object, values: object, option_string: str | None = None) -> None:
        """Print it."""
        brief = parser.screen if parser.name else parser.overview
        parser._print_message(f"{brief()}\n" if option_string == "-h" else parser.format_help(), sys.stdout)
        parser.exit()


class Version(argparse.Action):
    """Print the version and exit."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        """Print it."""
        from importlib.metadata import version

        print(f"multipendula {version('multipendula')}")
        parser.exit()
