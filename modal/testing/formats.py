"""Tests of formats: bytes for every model, reproducible output, and reading back if there is a reader."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

from modal.errors import SceneError
from modal.exports import FORMATS, find_format, format_of_file
from modal.extend import Format
from modal.report import deferred
from modal.scene import load
from modal.statespace import StateSpace, state_space
from modal.statespace.sampling import sample
from modal.testing.extensions import ExtensionTests

SCENES = ("chain-1", "chain-3", "paper-cart-2", "crane-hook", "cart-upright", "huygens")
TITLES = ('a "title"', "*/ /*", "{}; \\ % ' <&>", "Größe ∀", "")
"""Characters that a title may contain."""


class FormatTests(ExtensionTests):
    """Tests of a format: `read` gets A, B, C, D back from its bytes, None if nobody can read them.

    >>> from modal.testing import FormatTests
    >>> class TestMine(FormatTests):
    ...     @staticmethod
    ...     def read(content):
    ...         return None
    """

    step: ClassVar[float] = 0.0
    """Of a discrete model (s), for formats that hold no other."""

    @staticmethod
    def read(content: bytes) -> Sequence[Any] | None:
        """A, B, C and D as written."""
        return None

    def cases(self, name: str) -> Sequence[Any] | None:
        """Models by the names of scenes, titles."""
        return {"scene_name": SCENES, "title": TITLES}.get(name)

    def model_of(self, scene_name: str) -> StateSpace:
        """The model of a scene."""
        model = state_space(load(scene_name))
        return sample(model, self.step) if self.step else model

    def test_it_writes_bytes_of_every_model(self, scene_name: str) -> None:
        """And a note about them is text."""
        form, model = self.extension(), self.model_of(scene_name)
        content = form.content(model)
        assert isinstance(form.note(content), str)

    def test_it_writes_twice_alike(self, scene_name: str) -> None:
        """Byte for byte."""
        model = self.model_of(scene_name)
        assert self.extension().content(model) == self.extension().content(model)

    def test_what_is_read_back_is_what_was_written(self, scene_name: str) -> None:
        """Every number exactly."""
        model = self.model_of(scene_name)
        back = self.read(self.extension().content(model))
        for read, written in zip(back or (), (model.A, model.B, model.C, model.D), strict=False):
            np.testing.assert_array_equal(read, written)

    def test_a_title_does_no_harm(self, title: str) -> None:
        """The same numbers are read back under any title."""
        model = replace(self.model_of("chain-3"), title=title)
        back = self.read(self.extension().content(model))
        for read, written in zip(back or (), (model.A, model.B, model.C, model.D), strict=False):
            np.testing.assert_array_equal(read, written)

    def test_a_discrete_model_is_another(self) -> None:
        """Its numbers are those of a step."""
        model = self.model_of("chain-2")
        stepped = sample(state_space(load("chain-2")), 0.02)
        assert self.extension().content(stepped) != self.extension().content(replace(stepped, A=2 * model.A))

    def test_a_hoist_is_written_or_refused(self) -> None:
        """By one error that says which formats take it."""
        if self.extension.write_varying is Format.write_varying:
            with pytest.raises(SceneError, match="holds a constant model"):
                self.extension().content(None, is_varying=True)

    def test_its_ending_is_its_own(self) -> None:
        """No other format has it."""
        others = [form.extension for name, form in FORMATS.items() if name != self.extension.name]
        assert self.extension.extension not in others
        assert format_of_file(f"model{self.extension.extension}") == self.extension.name

    def test_it_is_among_the_formats(self) -> None:
        """That an unknown name is reported."""
        assert type(find_format(self.extension.name)) is self.extension
        with pytest.raises(SceneError, match=self.extension.name):
            find_format("nosuch")

    def test_the_command_writes_it(self, tmp_path: Path) -> None:
        """By its name, and by the ending of a file."""
        main, files = deferred("multipendula.cli:main"), [tmp_path / f"{k}{self.extension.extension}" for k in "ab"]
        step = ["--discrete", f"{self.step:g}"] if self.step else []
        assert main(["export", "chain-2", "--to", self.extension.name, "-o", str(files[0]), *step]) == 0
        assert main(["export", "chain-2", "-o", str(files[1]), *step]) == 0
        assert files[0].read_bytes() == files[1].read_bytes() == self.extension().content(self.model_of("chain-2"))
