"""The exceptions that this project raises on purpose, under one base class."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from itertools import islice

from modal.report import visible

SIMILARITY_MIN = 0.8
"""Tolerance: of a mistyped word to one that is suggested where many are known, or in large letters."""
MISTAKES_LISTED_MAX = 50
"""Limit: mistakes of a message; of more it says "and … more mistakes"."""
LONG_QUOTATION = re.compile(r'("[^"]{0,200})([^"]*)"|(\S{200})\S+')
"""A quotation, or a word of over 200 letters: of long ones a message has the first 200."""


def _first_letters(quotation: re.Match[str]) -> str:
    """A long quotation or word as far as a message has it, a short quotation as it is."""
    if word := quotation[3]:
        return f"{word}…"
    return f'{quotation[1]}{"…" if quotation[2] else ""}"'


class MultipendulaError(Exception):
    """Base class of all errors raised on purpose; quoted text in its message is escaped and safe on a terminal.

    >>> from modal import MultipendulaError, load
    >>> try:
    ...     load("nosuch")
    ... except MultipendulaError as error:
    ...     print(type(error).__name__)
    SceneError
    """

    def __init__(self, message: object = "") -> None:
        lines = map(visible, str(message).split("\n"))
        super().__init__("\n".join(LONG_QUOTATION.sub(_first_letters, line) for line in lines))


class SceneError(MultipendulaError, ValueError):
    """A scene that cannot be used: `problems` lists all mistakes with their places, the message shows the first ones.

    >>> from modal import Bob, SceneError
    >>> try:
    ...     Bob(mass=-1.0, length=0.0)
    ... except SceneError as error:
    ...     print(error)
    mass = -1.0: must be positive
    length = 0.0: must be positive
    """

    def __init__(self, problems: Sequence[str]) -> None:
        self.problems = tuple(map(visible, problems))
        super().__init__("\n".join(first_of(iter(self.problems), len(self.problems))))

    def __reduce__(self) -> tuple[type[SceneError], tuple[tuple[str, ...]]]:
        """The constructor's arguments: a pickled error keeps its mistakes separate."""
        return type(self), (self.problems,)


def refuse_any(problems: Iterable[str]) -> None:
    """Raise SceneError with these mistakes, if there are any."""
    if mistakes := [*problems]:
        raise SceneError(mistakes)


@contextmanager
def gathered(problems: list[str]) -> Iterator[None]:
    """Collect the mistakes of a SceneError raised in the block, so that further mistakes are found."""
    try:
        yield
    except SceneError as error:
        problems += error.problems


class ComputationError(MultipendulaError, ArithmeticError):
    """A valid scene whose result exceeds double precision or the memory of this machine.

    >>> from modal import ComputationError, load, matrices
    >>> scene = load("rope")
    >>> many = scene.replace(pendulum=[scene.pendulum[0].replace(count=100)])
    >>> try:
    ...     matrices(many)
    ... except ComputationError:
    ...     print("too large for dense matrices")
    too large for dense matrices
    """


class MissingExtraError(MultipendulaError, ImportError):
    """An optional package is not installed; the message names the extra that provides it."""

    def __init__(self, package: str, extra: str) -> None:
        self.missing = package, extra
        super().__init__(f"{package} is missing: {installing(extra)}")

    def __reduce__(self) -> tuple[type[MissingExtraError], tuple[str, str]]:
        """The constructor's arguments."""
        return type(self), self.missing


class ExtensionError(MultipendulaError):
    """An invalid extension, or one that raises or returns a wrong shape; the message has its name and package.

    >>> from modal import Bob
    >>> from modal.errors import ExtensionError
    >>> from modal.extend import register
    >>> try:
    ...     register(Bob)
    ... except ExtensionError as error:
    ...     print(error)
    extension Bob (package modal): is no class of modal.extend
    """


def installing(extra: str) -> str:
    """Return how to install an extra: from a clone, as long as no package index has it.

    >>> installing("fast")
    'pip install ".[fast]" in a clone of multipendula'
    """
    return f'pip install ".[{extra}]" in a clone of multipendula'


def first_of(problems: Iterator[str], count: int) -> Iterator[str]:
    """Return the first of `count` mistakes and the number of others; a single other one is listed, not counted."""
    yield from islice(problems, MISTAKES_LISTED_MAX)
    if count > MISTAKES_LISTED_MAX + 1:
        yield f"and {count - MISTAKES_LISTED_MAX} more mistakes"
    else:
        yield from problems


def spelling_hint(word: str, words: Iterable[str], limit: int = 1, cutoff: float = 0.6) -> str:
    """Return a suggestion for a mistyped word, ` (did you mean …?)`, or "" if no known word is similar.

    >>> spelling_hint("lenght", ["mass", "length"])
    ' (did you mean length?)'
    """
    from difflib import get_close_matches

    candidates = list(words)
    small = {candidate.lower(): candidate for candidate in reversed(candidates)}
    similar = get_close_matches(word, candidates, limit, cutoff) or [
        small[candidate]
        for candidate in get_close_matches(word.lower(), list(small), limit, max(cutoff, SIMILARITY_MIN))
    ]
    return f" (did you mean {' or '.join(similar)}?)" if similar else ""
