"""The record of a command: what it does, its arguments, and its help."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import NamedTuple

from multipendula.flags import FORMER
from multipendula.options import add_quiet
from multipendula.parser import Examples, Page


class Command(NamedTuple):
    """A command under a topic of `multipendula --help`.

    `arguments` adds the arguments to its page, where `details` follow the docstring of `run`.  Tests run the
    `examples` of each page in order.
    """

    name: str
    topic: str
    run: Callable[[argparse.Namespace], None]
    arguments: Callable[[Page], None]
    details: str
    examples: Examples

    @property
    def summary(self) -> str:
        """What it does, on one line."""
        return (self.run.__doc__ or "").strip()

    def add_to(self, pages: argparse._SubParsersAction[Page]) -> None:
        """Add its page to those of the other commands."""
        page = pages.add_parser(
            self.name, help=self.summary, description=f"{self.summary} {self.details}", examples=self.examples
        )
        self.arguments(page)
        add_quiet(page)
        page.former = {flag: former for (command, flag), former in FORMER.items() if command == self.name}
        page.set_defaults(run=self.run, page=page)
