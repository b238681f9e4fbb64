"""Who is known by which name: entry points are read once and late, and one that fails spoils no other."""

from __future__ import annotations

import subprocess
import sys
from importlib.metadata import EntryPoint
from math import inf
from types import ModuleType
from typing import Any

import mpmath
import numpy as np
import pytest
import sympy

from modal.errors import ExtensionError, MultipendulaError
from modal.extend import Format, Measure, Parameter, cos, exp, find_extension, log, registered, sin, sqrt, tanh
from modal.extend import registry as room
from multipendula.cli import main
from nonlinear.dynamics.tape import Tape


@pytest.fixture
def packages(monkeypatch: pytest.MonkeyPatch) -> list[EntryPoint]:
    """What is installed, of which nothing is known yet."""
    entries: list[EntryPoint] = []
    fresh = room._Registry()
    fresh.classes = {kind: {**registered(kind, discover=False)} for kind in room.KINDS}
    monkeypatch.setattr(room, "_registry", fresh)
    monkeypatch.setattr("importlib.metadata.entry_points", lambda group: entries if group == room.GROUP else [])
    return entries


def entry(monkeypatch: pytest.MonkeyPatch, name: str, **inside: Any) -> EntryPoint:
    """A module with these classes, as an entry point."""
    module = ModuleType(name)
    for key, thing in inside.items():
        thing.__module__ = name
        setattr(module, key, thing)
    monkeypatch.setitem(sys.modules, name, module)
    return EntryPoint(name, name, room.GROUP)


def measure(name: str) -> type[Measure]:
    return type("Some", (Measure,), {"name": name, "words": "w", "columns": ("c",), "of_modes": lambda *_: 1.0})


def test_a_module_is_read_when_a_name_is_missed(packages: list[EntryPoint], monkeypatch: pytest.MonkeyPatch) -> None:
    packages.append(entry(monkeypatch, "stranger", Some=measure("stranger")))
    assert "stranger" not in registered("measure", discover=False)
    assert find_extension("measure", "beat") is not None
    assert not room._registry.is_complete
    assert find_extension("measure", "stranger") is sys.modules["stranger"].Some
    assert room._registry.is_complete


def test_one_that_fails_spoils_no_other(packages: list[EntryPoint], monkeypatch: pytest.MonkeyPatch) -> None:
    packages += [EntryPoint("broken", "no_such_module", room.GROUP), entry(monkeypatch, "good", Some=measure("good"))]
    assert "good" in registered("measure")
    assert find_extension("format", "csv") is not None
    with pytest.raises(ExtensionError, match=r"extension broken \(package .*\): loading no_such_module raised"):
        find_extension("format", "nosuch")


def test_a_name_of_ours_is_refused(
    packages: list[EntryPoint], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    packages.append(entry(monkeypatch, "thief", Some=measure("beat")))
    assert find_extension("measure", "beat").__module__ == "nonlinear.measures"  # type: ignore[union-attr]
    assert main(["export", "chain-2", "--to", "nosuch", "-o", "x.y"]) == 2
    assert "extension beat (package thief" in capsys.readouterr().err


def test_a_list_shows_what_is_installed(packages: list[EntryPoint], monkeypatch: pytest.MonkeyPatch) -> None:
    lists = type("Lists", (Format,), {"name": "lists", "extension": ".l", "what": "w", "write": lambda s, m: b""})
    packages.append(entry(monkeypatch, "lister", Lists=lists))
    from multipendula.completion import extensions

    assert "lists" in [*extensions("format")("")]


def test_a_table_reads_no_entry_point() -> None:
    code = "import sys; from multipendula.cli import main; main(['table', 'chain-2']); print(*sys.modules)"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "importlib.metadata" not in ran.stdout.splitlines()[-1].split()


@pytest.mark.parametrize("function", [sin, cos, exp, log, sqrt, tanh])
def test_a_function_takes_every_scalar(function: Any) -> None:
    """Against many digits."""
    x, expected = 0.7, float(getattr(mpmath, function.__name__)(0.7))
    symbol = sympy.Symbol("x")
    objects = function(np.array([sympy.Float(x, 30), mpmath.mpf(x)], dtype=object))
    numbers = [function(x), function(np.float64(x)), function(np.full(2, x))[1], *map(float, objects)]
    numbers += [complex(function(complex(x))).real, float(function(symbol).subs({symbol: x})), function(mpmath.mpf(x))]
    assert [float(number) for number in numbers] == pytest.approx([expected] * len(numbers), rel=1e-15)
    recorded = function(Tape().inputs("y", 1)[0])
    assert recorded.operation[0] == function.__name__


@pytest.mark.parametrize(
    ("value", "words"),
    [
        *((1.0, ""), (True, "must be a number"), ("1", "must be a number"), (inf, "must be finite")),
        *((-1, "must be at least 0"), (11, "must be at most 10")),
    ],
)
def test_a_parameter_says_what_is_wrong(value: Any, words: str) -> None:
    assert Parameter("strength", "N m", 0.0, 10.0).mistake(value) == words


def test_an_extensions_error_is_one_of_ours_and_the_users() -> None:
    assert issubclass(ExtensionError, MultipendulaError)
