"""Everything this project refuses to do, under one base class."""

from collections.abc import Iterable, Sequence
from difflib import get_close_matches


class MultipendulaError(Exception):
    """Base of every error raised on purpose."""


class SceneError(MultipendulaError, ValueError):
    """A scene that cannot be used: `problems` names every mistake and where it stands."""

    def __init__(self, problems: Sequence[str]) -> None:
        self.problems = tuple(problems)
        super().__init__("\n".join(self.problems))


class ComputationError(MultipendulaError, ArithmeticError):
    """A valid scene whose answer double precision or this machine's memory cannot give."""


class MissingExtraError(MultipendulaError, ImportError):
    """An optional package is not installed; the message names the extra that brings it."""

    def __init__(self, package: str, extra: str) -> None:
        super().__init__(f'{package} is missing: pip install "multipendula[{extra}]"')


def meant(word: str, known: Iterable[str], most: int = 1, near: float = 0.6) -> str:
    """A question after what a mistyped word may have meant, nothing where no known one is near.

    >>> meant("lenght", ["mass", "length"])
    ' (did you mean length?)'
    """
    found = get_close_matches(word, list(known), most, near)
    return f" (did you mean {' or '.join(found)}?)" if found else ""
