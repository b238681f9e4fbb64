"""The command line: parse, run one of `multipendula.commands`, and turn what it refuses into an exit code.

Exit codes: 0, 1 for what could not be computed or written, 2 for bad input.
"""

from __future__ import annotations

import argparse
import errno
import os
import re
import sys
from collections.abc import Callable, Sequence
from io import TextIOWrapper

from multipendula.arguments import GROUPS
from multipendula.completion import complete
from multipendula.pages import Page, pointer
from multipendula.topics import ABOUT, TELLS

os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")

USER_ERRORS = {errno.ENOENT, errno.ENOTDIR, errno.EISDIR, errno.EACCES, errno.EPERM, errno.EROFS, errno.ENAMETOOLONG}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code."""
    parser = _parser()
    if "_ARGCOMPLETE" in os.environ:
        complete(parser)
    options, strangers = parser.parse_known_args(arguments)
    if strangers:
        options.page.error(f"unrecognized arguments: {' '.join(strangers)}")
    from modal.errors import MultipendulaError, SceneError

    if sys.stdout is None:
        return _refuse("standard output is closed", 1)
    if isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")
    try:
        options.run(options)
        sys.stdout.flush()
    except SceneError as error:
        return _refuse(error, 2, options.page.name)
    except MultipendulaError as error:
        return _refuse(error, 1)
    except MemoryError:
        return _refuse("there is not enough memory for this scene", 1)
    except KeyboardInterrupt:
        return _refuse("interrupted", 130)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except OSError as error:
        return _refuse(
            f"cannot write{_named(error)}: {error.strerror or error}", 2 if error.errno in USER_ERRORS else 1
        )
    return 0


def _refuse(problem: object, code: int, command: str = "") -> int:
    lines = str(problem).splitlines()
    if any(re.match("--?[a-z]", line) for line in lines):
        lines.append(pointer(command))
    for line in lines:
        print(f"multipendula: {line}", file=sys.stderr)
    return code


def _named(error: OSError) -> str:
    return f" {error.filename}" if error.filename else ""


def _parser() -> Page:
    parser = Page(prog="multipendula", description=ABOUT)
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version and leave")
    added = parser.add_subparsers(metavar="COMMAND", required=True)

    def command(run: Callable[[argparse.Namespace], None], name: str) -> argparse.ArgumentParser:
        words = (run.__doc__ or "").strip()
        made = added.add_parser(name, help=words, description=f"{words} {TELLS[name]}")
        made.set_defaults(run=run, page=made)
        return made

    for group in GROUPS:
        group(command)
    return parser


class _Version(argparse.Action):
    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        from importlib.metadata import version

        print(f"multipendula {version('multipendula')}")
        parser.exit()
