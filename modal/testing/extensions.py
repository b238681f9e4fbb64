"""Tests of every extension, whatever its kind: its name, its words, and that other processes find it."""

from __future__ import annotations

import pickle
from collections.abc import Iterator, Sequence
from typing import Any, ClassVar

import pytest

from modal.errors import ExtensionError
from modal.extend import Extension, find_extension, register, registration

HOSTILE: tuple[Any, ...] = (float("nan"), float("inf"), -float("inf"), 1e301, "x", "1", "", None, True, [], {})
"""Values that no number of a scene can have."""


class ExtensionTests:
    """Tests of an `extension`, a class: subclasses of this by a name that begins with Test are run by pytest.

    >>> from modal.testing import ExtensionTests
    >>> class TestMine(ExtensionTests):
    ...     pass
    """

    extension: ClassVar[Any]

    @pytest.fixture(autouse=True)
    def _registered(self) -> Iterator[None]:
        """Known by its name, as an installed package is."""
        with registration(self.extension):
            yield

    def cases(self, name: str) -> Sequence[Any] | None:
        """The values of an argument of tests, one test for each; None for what is no such argument."""
        return None

    def pytest_generate_tests(self, metafunc: Any) -> None:
        """A test for each of the cases."""
        for name in metafunc.fixturenames:
            if (cases := self.cases(name)) is not None:
                metafunc.parametrize(name, cases, ids=[f"{name}{k}" for k in range(len(cases))])

    def test_it_is_found_by_its_name(self) -> None:
        """Among those of its kind."""
        assert find_extension(self.extension.kind, self.extension.name) is self.extension

    def test_it_says_what_it_is(self) -> None:
        """In its docstring or words."""
        assert getattr(self.extension, "words", "") or self.extension.__doc__

    def test_it_has_no_mistake(self) -> None:
        """The messages that come before anything is computed."""
        assert not [*self.extension.mistakes()]

    def test_its_name_is_its_own(self) -> None:
        """Another class of the same name is refused."""
        other = type("Other", (Extension,), {"kind": self.extension.kind, "name": self.extension.name})
        with pytest.raises(ExtensionError, match=f"a {self.extension.kind} of this name exists"):
            register(other)

    def test_other_processes_find_it(self) -> None:
        """Its class is at the top level of a module."""
        assert type(pickle.loads(pickle.dumps(self.extension()))) is self.extension
