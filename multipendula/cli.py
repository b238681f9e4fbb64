"""The command line: parse, run one of `multipendula.commands`, and turn errors into messages and exit codes.

Exit codes: 0; 1 if something cannot be computed or written; 2 for bad input; 130 for Ctrl-C and other requests to
terminate.  Only the standard library is imported before `main` handles Ctrl-C.
"""

from __future__ import annotations

import codecs
import errno
import os
import re
import signal
import sys
import threading
import warnings
from _thread import interrupt_main
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stderr, redirect_stdout, suppress
from io import StringIO, TextIOBase, TextIOWrapper
from typing import TYPE_CHECKING, Any, TextIO

if TYPE_CHECKING:
    import argparse

    from modal.errors import SceneError
    from modal.report import TableLimit
    from multipendula.parser import Page

os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")

USER_ERRORS = {errno.ENOENT, errno.ENOTDIR, errno.EISDIR, errno.EACCES, errno.EPERM, errno.EROFS, errno.ENAMETOOLONG}
PLACE = re.compile(r"(pendulum\[|support\b|gravity\b)(?![^:\s]*=)")
ENDING = ("SIGINT", "SIGTERM", "SIGHUP", "SIGALRM")
SPELLED = "multipendula.spelled"
"""The error handler of `modal.report.spelling`, by its name: the module is loaded where a letter has to be spelled."""
INTERRUPT_SECONDS = 5.0
"""Format: seconds after which an interrupt that has not ended the command is raised again."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code."""
    alone = arguments is None
    if alone:
        warnings.simplefilter("ignore", RuntimeWarning)
    with _stoppable(alone) as stopped:
        try:
            return _obey(arguments, stopped)
        except BaseException as error:
            if not stopped and not isinstance(error, KeyboardInterrupt):
                raise
        return _refuse("interrupted", 130)


@contextmanager
def _stoppable(alone: bool) -> Iterator[list[int]]:
    """Make Ctrl-C and requests to terminate raise KeyboardInterrupt, and again if a library swallows it and continues.

    If this is `alone` in its process, they are ignored afterwards, as the process ends anyway.
    """
    came: list[int] = []

    def stop(number: int, frame: object) -> None:
        came.append(number)
        _remind(INTERRUPT_SECONDS)
        raise KeyboardInterrupt

    def unheard(lost: sys.UnraisableHookArgs) -> None:
        """If a destructor has swallowed a KeyboardInterrupt, raise it again."""
        if isinstance(lost.exc_value, KeyboardInterrupt):
            threading.Timer(0.01, interrupt_main).start()
        else:
            told(lost)

    numbers = [getattr(signal, name) for name in ENDING if hasattr(signal, name)]
    here = threading.current_thread() is threading.main_thread()
    before = {n: was for n in numbers if here and (was := signal.getsignal(n)) not in {None, signal.SIG_IGN}}
    told, sys.unraisablehook = sys.unraisablehook, unheard
    for number in before:
        signal.signal(number, stop)
    try:
        yield came
    finally:
        if came:
            _remind(0)
        for number, handler in before.items():
            signal.signal(number, signal.SIG_IGN if alone else handler)
        sys.unraisablehook = told


def _remind(seconds: float) -> None:
    """Where the platform has timers, raise the interrupt again after this many seconds, never for 0."""
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, seconds)


def _obey(arguments: Sequence[str] | None, stopped: Sequence[int]) -> int:
    _spell()
    given = sys.argv[1:] if arguments is None else arguments
    if "_ARGCOMPLETE" in os.environ:
        from multipendula.completion import begun, complete

        complete(_parser(begun()))
    if not given:
        return _print_overview(_parser())
    if given[0] == "help":
        given = [*given[1:2], "--help"]
    try:
        page, words = _page(given)
        options, strangers = page.parse_known_args(words)
    except SystemExit as leaving:
        return _left(leaving)
    except OSError as error:
        return _answer(error, None)
    if strangers:
        options.page.refuse_words(strangers)
    if sys.stdout is None:
        return _refuse("standard output is closed", 1)
    try:
        perform(options)
        sys.stdout.flush()
    except BaseException as error:
        if stopped:
            raise KeyboardInterrupt from None
        return _answer(error, options)
    return 0


def perform(options: argparse.Namespace) -> Any:
    """Run the command of these options, and return its result."""
    with _channels(options), _reported(options):
        return options.run(options)


def _spell() -> None:
    """Text into a pipe or a file is UTF-8, unless PYTHONIOENCODING names an encoding; others are spelled."""
    codecs.register_error(SPELLED, _spelled)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            if "PYTHONIOENCODING" not in os.environ and not stream.isatty():
                stream.reconfigure(encoding="utf-8")
            stream.reconfigure(errors=SPELLED)


def _spelled(error: UnicodeError) -> tuple[str, int]:
    """The spelling of letters that a stream lacks."""
    from modal.report.spelling import spell

    return spell(error)


def _charset() -> str | None:
    """The encoding of standard output if it lacks letters."""
    encoding = getattr(sys.stdout, "encoding", None) or "utf-8"
    return None if encoding.lower().startswith("utf") else encoding


def _print_overview(parser: Page) -> int:
    """The commands, on one screen."""
    if sys.stdout is None:
        return _refuse("standard output is closed", 1)
    try:
        print(parser.overview())
        sys.stdout.flush()
    except OSError as error:
        return _answer(error, None)
    return 0


def _left(leaving: SystemExit) -> int:
    """Exit as argparse wants to, unless its help page could not be printed."""
    try:
        if sys.stdout:
            sys.stdout.flush()
    except OSError as error:
        return _answer(error, None)
    raise leaving


def _answer(error: BaseException, options: argparse.Namespace | None) -> int:
    """Report an error that a command raises, and return its exit code; unexpected errors are raised again."""
    from modal.errors import ExtensionError, MultipendulaError, SceneError
    from modal.report import visible

    page = options.page if options else None
    if isinstance(error, SceneError):
        return _refuse(_in_its_file(error, options), 2, page)
    if isinstance(error, MultipendulaError):
        return _refuse(error, 2 if isinstance(error, ExtensionError) else 1, page)
    if isinstance(error, MemoryError):
        return _refuse("there is not enough memory for this scene", 1)
    if isinstance(error, OSError):
        if not error.filename:
            with suppress(OSError):
                os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if isinstance(error, BrokenPipeError):
            return 0
        name = f" {error.filename}" if error.filename else ""
        words = visible(f"cannot write{name}: {error.strerror or error}")
        return _refuse(words, 2 if error.errno in USER_ERRORS else 1)
    raise error


def _in_its_file(error: SceneError, options: argparse.Namespace | None) -> str:
    """The message with the scene's file before each place in it, unless an option has set the value."""
    from modal.report import visible

    scene = getattr(options, "scene", None) if not hasattr(options, "vary") else None
    lines = str(error).splitlines()
    return "\n".join(f"{visible(scene)}: {line}" if scene and PLACE.match(line) else line for line in lines)


@contextmanager
def _channels(options: argparse.Namespace) -> Iterator[None]:
    """Set where words go and how wide text is.

    If a file is written to standard output, all text is printed to standard error instead.  With --quiet nothing is
    printed but the result: the file of -o, or else the text.
    """
    from modal.errors import SceneError
    from modal.report import fitted
    from modal.scene import STANDARD, kind_of
    from multipendula.command import file_beside
    from multipendula.commands.shared import is_new

    if options.page.usual and options.output is None:
        options.output = file_beside(options.scene, options.page.usual)
    files = [action for action in options.page._actions if action.metavar == "FILE" and action.option_strings]
    named = [(action.option_strings[0], vars(options)[action.dest]) for action in files]
    if unnamed := [option for option, name in named if name == ""]:
        raise SceneError([f"{option}: the name of the file is empty" for option in unnamed])
    if why := options.page.refused.get(os.path.splitext(getattr(options, "output", None) or "")[1].lower()):
        raise SceneError([f"-o {options.output}: {why}"])
    if options.page.texts and is_new(options.output):
        kind_of(options.output, options.page.kinds, "-o ")
    to_output = [option for option, name in named if name == STANDARD]
    if len(to_output) > 1:
        raise SceneError([f"{', '.join(to_output)}: at most one of them can be - (standard output)"])
    if options.quiet and getattr(options, "explain", False):
        raise SceneError(["--quiet: cannot be combined with --explain"])
    written = any("-o" in action.option_strings and vars(options)[action.dest] is not None for action in files)
    words = _Aside(sys.stdout, quiet=options.quiet) if to_output or (options.quiet and written) else sys.stdout
    notes = StringIO() if options.quiet else sys.stderr
    with fitted(_columns(), _charset(), _limit(options)), redirect_stdout(words), redirect_stderr(notes):
        yield


def _limit(options: argparse.Namespace) -> TableLimit | None:
    """How much of a table a terminal shows: all where a format, rows or columns were requested."""
    from modal.report import TABLE_ROWS, TableLimit

    chosen = ("format_asked", "modes", "columns", "places")
    asked = any(getattr(options, name, None) for name in chosen)
    ways = ["--format text"] * hasattr(options, "format") + ["a pipe"]
    return None if asked else TableLimit(TABLE_ROWS, f"; {' or '.join(ways)} shows all")


@contextmanager
def _reported(options: argparse.Namespace) -> Iterator[None]:
    """Write the text to the file of -o instead, where a name that could be a figure's ends in a format of text.

    The name sets the format; raise SceneError if --format is that of another name, but .txt takes all.
    """
    place = next((action.dest for action in options.page._actions if "-o" in action.option_strings), "")
    name = getattr(options, place, None) or ""
    ending = os.path.splitext(name)[1].lower()
    form = options.page.reports.get(ending)
    asked = options.format if getattr(options, "format_asked", False) else None
    by_name = form or options.page.texts.get(ending)
    if asked and by_name and by_name not in {asked, "text"} and (asked, by_name) != ("beamer", "latex"):
        from modal.errors import SceneError

        raise SceneError([f"--format {asked}: cannot be combined with -o {name}"])
    if by_name and not asked:
        options.format = by_name
    if form is None:
        yield
        return
    from modal.report import fitted
    from modal.scene import whole_file
    from multipendula.commands.shared import encoded, in_a_folder, text_into

    in_a_folder(name)
    options.format_asked = True
    setattr(options, place, None)
    options.format_words = f"-o {name}"
    with whole_file(name) as stream, fitted(None), text_into(StringIO()) as text:
        yield
        stream.write(encoded(name, text.getvalue()))


def _columns() -> int | None:
    """The columns of the terminal, or those that COLUMNS says it has; None for a pipe or a file, which wrap no line."""
    if not sys.stdout.isatty():
        return None
    from shutil import get_terminal_size

    return get_terminal_size().columns


class _Aside(TextIOBase):
    """A stream with its text diverted to standard error, or to nowhere; bytes still go to it."""

    def __init__(self, output: TextIO, *, quiet: bool) -> None:
        self.output, self.quiet = output, quiet
        if hasattr(self.output, "buffer"):
            self.buffer = self.output.buffer

    def write(self, text: str) -> int:
        return len(text) if self.quiet else sys.stderr.write(text)

    def flush(self) -> None:
        self.output.flush()

    def isatty(self) -> bool:
        return self.output.isatty()


def _refuse(problem: object, code: int, page: Page | None = None) -> int:
    lines = str(problem).split("\n")
    if page:
        lines = [page.in_options(line) for line in lines]
        if any(re.match("--?[a-z]", line) for line in lines):
            lines.append(page.pointer)
    for line in lines:
        print(f"multipendula: {line}", file=sys.stderr)
    return code


def _page(given: Sequence[str]) -> tuple[Page, Sequence[str]]:
    """The page of the command that is called, and its words; that of all commands, and all words, where none is."""
    from multipendula.commands import command_named
    from multipendula.flags import FORMER_COMMANDS

    if command := command_named(given[0]):
        return command.page(), given[1:]
    parser = _parser()
    if now := FORMER_COMMANDS.get(given[0]):
        parser.error(f"{given[0]}: is now `multipendula {now}`")
    return parser, given


def _parser(name: str = "") -> Page:
    """The page of all commands, or of the one called `name` alone."""
    from multipendula.commands import ABOUT, COMMANDS, FIRST, command_named
    from multipendula.flags import ASIDE
    from multipendula.parser import Page, Version

    topics: dict[str, list[str]] = {}
    command = command_named(name)
    commands = (command,) if command else COMMANDS
    for command in sorted(commands, key=lambda command: command.topic == ASIDE):
        topics.setdefault(command.topic, []).append(command.name)
    parser = Page(prog="multipendula", description=ABOUT, examples=FIRST, topics=topics)
    parser.more.add_argument("--version", action=Version, nargs=0, help="print the version and exit")
    pages = parser.add_subparsers(metavar="COMMAND", required=True)
    for command in commands:
        command.page(pages.add_parser)
    return parser
