"""One record a command: what it does, what it takes, and what its page of help says."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass

from multipendula.parser import Examples, Page


@dataclass(frozen=True)
class Command:
    """A command under a topic of `multipendula --help`.

    `arguments` adds what it takes to its page, `details` follow the docstring of `run` there, and tests do the
    `examples`, a page in order.
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
        page.set_defaults(run=self.run, page=page)
