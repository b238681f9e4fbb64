"""The base class of formats: how a state-space model becomes the bytes of a file."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar

from modal.errors import SceneError
from modal.extend.registry import Extension, call, mistake_of, registered


class Format(Extension):
    """A format of `export`: the `extension` of its files, `what` is written, and the function that writes it.

    `tools` are names of programs that read such files, which users may give instead of the format.  `write` takes a
    `StateSpace`, with A, B, C, D, dt, title and the names and units of states, inputs and outputs.

    >>> from modal.extend import Format
    >>> class Diagonal(Format):
    ...     name, extension, what = "diagonal", ".txt", "the diagonal of A"
    ...
    ...     def write(self, model):
    ...         return " ".join(map(repr, model.A.diagonal().tolist())).encode()
    >>> Diagonal().note(b"")
    ''
    """

    kind = "format"
    extension: ClassVar[str] = ""
    what: ClassVar[str] = ""
    tools: ClassVar[tuple[str, ...]] = ()

    @classmethod
    def mistakes(cls) -> Iterator[str]:
        """Missing attributes, and a missing function."""
        if not cls.extension.startswith("."):
            yield f"its extension {cls.extension!r} must begin with a point"
        if not cls.what:
            yield "does not say what is written"
        if cls.write is Format.write:
            yield "has no write"

    def write(self, model: Any) -> bytes:
        """Return the bytes of the file of a `StateSpace`."""
        raise NotImplementedError

    def write_varying(self, model: Any) -> bytes:
        """Return the bytes of a model along a hoist or a run; raise SceneError if the format has none."""
        forms = registered("format", discover=False)
        able = ", ".join(name for name, form in forms.items() if form.write_varying is not Format.write_varying)
        raise SceneError(
            [
                f"format {self.name}: holds a constant model, and a hoist or a run makes it vary in time: {able} take "
                "it, and every format that of one time, `Scene.at(seconds)`"
            ]
        )

    def note(self, content: bytes) -> str:
        """Return a note for the user about these bytes, usually empty."""
        return ""

    def content(self, model: Any, *, is_varying: bool = False) -> bytes:
        """Return the bytes of a model, which may vary with time; raise ExtensionError if they are not bytes."""
        content = call(self, "write_varying" if is_varying else "write", model)
        if not isinstance(content, bytes):
            raise mistake_of(self, f"write returned {type(content).__name__}: must be bytes")
        return content
