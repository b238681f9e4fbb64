"""The registry of extensions: classes by kind and name, entry points read on first need, and attribution of errors.

A class is known by its `kind` and `name`.  Those of installed packages are entry points of the group
`multipendula.extensions`, each a class or a module with such classes; they are loaded once, when an unknown name or all
names are requested. One that cannot be loaded does not affect the others.  A `Parameter` is a number of an
extension that a scene sets.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from math import inf, isfinite
from numbers import Real
from typing import Any, ClassVar, TypeVar

from modal.errors import ExtensionError, MultipendulaError
from modal.report import Displayed, Summary

KINDS = ("joint law", "point force", "support", "measure", "format")
"""The kinds of extensions."""
GROUP = "multipendula.extensions"
"""The group of entry points."""
HOMES: dict[str, str] = {
    **dict.fromkeys(("joint law", "point force"), "modal.extend.laws"),
    **{"support": "modal.scene.carriers", "measure": "nonlinear.measures", "format": "modal.exports"},
}
"""Modules with the classes of this project, which are imported when their kind is requested."""
OURS = ("modal", "nonlinear")
"""Packages whose errors are their own."""
NAME = re.compile(r"[a-z][a-z0-9_-]*")
"""Valid names of extensions."""


class Extension:
    """Base of all extensions: a kind, set by the base class, and a name used in files and options.

    >>> from modal.extend import Extension
    >>> Extension.kind in ("joint law", "")
    True
    """

    kind: ClassVar[str] = ""
    name: ClassVar[str] = ""

    @classmethod
    def mistakes(cls) -> Iterator[str]:
        """Return what is wrong with the class itself, in words, before anything is computed with it."""
        yield from ()


T = TypeVar("T")


class _Registry:
    """The classes by kind and name, the package of each that is installed, and those that could not be loaded."""

    def __init__(self) -> None:
        self.classes: dict[str, dict[str, type[Extension]]] = {kind: {} for kind in KINDS}
        self.packages: dict[type, str] = {}
        self.failures: tuple[ExtensionError, ...] = ()
        self.is_complete = False

    def of_kind(self, kind: str) -> dict[str, type[Extension]]:
        """The available classes, ours among them."""
        if kind in HOMES:
            import_module(HOMES[kind])
        return self.classes[kind]

    def discover(self) -> None:
        """Load the entry points, unless they are."""
        if self.is_complete:
            return
        self.is_complete = True
        from importlib.metadata import entry_points

        failures = []
        for entry in sorted(entry_points(group=GROUP), key=lambda entry: (entry.name, entry.value)):
            package = f"{entry.dist.name} {entry.dist.version}" if entry.dist else entry.value
            try:
                self._take(entry.load(), package)
            except ExtensionError as error:
                failures.append(error)
            except Exception as error:
                words = f"loading {entry.value} raised {type(error).__name__}: {error}"
                failures.append(ExtensionError(f"extension {entry.name} (package {package}): {words}"))
        self.failures = tuple(failures)

    def _take(self, loaded: Any, package: str) -> None:
        if isinstance(loaded, type):
            classes = [loaded]
        else:
            inside = [thing for thing in vars(loaded).values() if isinstance(thing, type)]
            classes = [
                thing for thing in inside if issubclass(thing, Extension) and thing.__module__ == loaded.__name__
            ]
        for cls in classes:
            self.packages[cls] = package
            register(cls)


_registry = _Registry()


def register(cls: type[T]) -> type[T]:
    """Register a class by its kind and name and return it; raise ExtensionError if it is invalid or the name is taken.

    >>> from modal.extend import register
    >>> try:
    ...     register(int)
    ... except Exception as error:
    ...     print(error)
    extension int (package builtins): is no class of modal.extend
    """
    if getattr(cls, "kind", "") not in KINDS or not issubclass(cls, Extension):
        raise mistake_of(cls, "is no class of modal.extend")
    if not NAME.fullmatch(str(cls.name)):
        raise mistake_of(cls, f"its name {cls.name!r} must be small letters, digits, - and _")
    known: type[Any] = _registry.of_kind(cls.kind).get(cls.name, cls)
    if _definition(known) != _definition(cls):
        raise mistake_of(cls, f"a {cls.kind} of this name exists, of {package_of(known)}")
    if known.__module__ != cls.__module__:
        return known  # of a file that is imported under two names
    if mistakes := [*cls.mistakes()]:
        raise mistake_of(cls, "; ".join(mistakes))
    _registry.classes[cls.kind][cls.name] = cls
    return cls


def _definition(cls: type) -> tuple[str, str]:
    """Where a class is defined: a cell that is run again, or a module that is loaded again, redefines it."""
    return getattr(sys.modules.get(cls.__module__), "__file__", None) or cls.__module__, cls.__qualname__


def registered(kind: str, *, discover: bool = True) -> Mapping[str, type[Any]]:
    """Return all classes of a kind by name, including those of installed packages; without `discover` only loaded ones.

    >>> from modal.extend import registered
    >>> "nosuch" in registered("joint law")
    False
    """
    if discover:
        _registry.discover()
    return _registry.of_kind(kind)


def find_extension(kind: str, name: str) -> type[Any] | None:
    """Return the class of a kind and name, None if there is none; entry points are read for an unknown name.

    >>> from modal.extend import find_extension
    >>> find_extension("joint law", "nosuch")
    """
    if name not in _registry.of_kind(kind):
        _registry.discover()
    cls = _registry.classes[kind].get(name)
    if cls is None and _registry.failures:
        raise _registry.failures[0]
    return cls


@contextmanager
def registration(cls: type[Extension]) -> Iterator[type[Extension]]:
    """Register a class within a context: for tests.

    >>> from modal.extend import Extension, registration
    """
    was_known = _registry.classes[cls.kind].get(cls.name) is cls
    try:
        yield register(cls)
    finally:
        if not was_known and _registry.classes[cls.kind].get(cls.name) is cls:
            del _registry.classes[cls.kind][cls.name]


def package_of(cls: type) -> str:
    """Return the distribution of a class with its version, or its module."""
    return _registry.packages.get(cls) or cls.__module__.partition(".")[0]


def mistake_of(extension: Any, words: str) -> ExtensionError:
    """Return the error that attributes a mistake to an extension: its class, or one of its objects."""
    cls = extension if isinstance(extension, type) else type(extension)
    return ExtensionError(f"extension {getattr(cls, 'name', '') or cls.__name__} (package {package_of(cls)}): {words}")


def call(extension: Any, function: str, *arguments: Any, shape: tuple[int, ...] | None = None) -> Any:
    """Return the result of a function of an extension; raise ExtensionError if it fails or returns a wrong shape.

    >>> from modal.extend.registry import call
    >>> call("aba", "count", "a", shape=())
    2
    """
    try:
        value = getattr(extension, function)(*arguments)
    except Exception as error:
        if isinstance(error, MultipendulaError) or package_of(type(extension)) in OURS:
            raise
        raise mistake_of(extension, f"{function} raised {type(error).__name__}: {error}") from error
    if shape is not None:
        import numpy as np

        if np.shape(value) != shape:
            raise mistake_of(extension, f"{function} returned shape {np.shape(value)}: must be {shape}")
    return value


@dataclass(frozen=True, repr=False)
class Parameter(Displayed):
    """A number from `low` to `high`, both included, given in scenes by `name`, with an optional `default`.

    Without a default a scene must give it. `unit` is its SI unit, "" for a ratio, `meaning` its description.

    >>> from modal.extend import Parameter
    >>> Parameter("strength", "N m", low=0.0).mistake(-1.0)
    'must be at least 0'
    """

    name: str
    unit: str = ""
    low: float = -inf
    high: float = inf
    default: float | None = None
    meaning: str = ""

    def _summary(self) -> Summary:
        facts = [("range", f"{self.low:g} to {self.high:g}")]
        facts += [] if self.default is None else [("default", f"{self.default:g}")]
        return Summary(f"Parameter {self.name} ({self.unit or '1'})", facts)

    def mistake(self, value: Any) -> str:
        """Return what is wrong with a value, "" if nothing is."""
        if isinstance(value, bool) or not isinstance(value, Real):
            return "must be a number"
        number = float(value)
        if not isfinite(number):
            return "must be finite"
        if number < self.low:
            return f"must be at least {self.low:g}"
        return f"must be at most {self.high:g}" if number > self.high else ""
