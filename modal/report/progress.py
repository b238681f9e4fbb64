"""What a long computation calls on its way, and the one that says nothing."""

from __future__ import annotations


class Silence:
    """Called with how far a computation has come; says nothing.  Signatures show it by its name, `silent`."""

    def __call__(self, *progress: object) -> None:
        """Say nothing."""

    def __repr__(self) -> str:
        return "silent"

    def __reduce__(self) -> str:
        return "silent"


silent = Silence()
