"""Formats of others, and ours held to the same."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from modal.errors import ExtensionError
from modal.exports import CsvTable, JsonFile, read_json
from modal.extend import Format, registration
from modal.statespace import StateSpace
from modal.testing import FormatTests


class Lists(Format):
    """The matrices as lists of rows."""

    name, extension, what = "lists", ".lists", "the matrices as lists of rows, nothing else"

    def write(self, model: StateSpace) -> bytes:
        return json.dumps({name: getattr(model, name).tolist() for name in "ABCD"}).encode()


class TestLists(FormatTests):
    extension = Lists

    @staticmethod
    def read(content: bytes) -> Sequence[Any]:
        data = json.loads(content)
        return [np.array(data[name]) if data[name] and data[name][0] else data[name] for name in "AC"][:1]


class TestJson(FormatTests):
    extension = JsonFile

    @staticmethod
    def read(content: bytes) -> Sequence[Any]:
        model = read_json(content)
        return model.A, model.B, model.C, model.D


class TestCsv(FormatTests):
    extension = CsvTable

    @staticmethod
    def read(content: bytes) -> Sequence[Any]:
        rows = [row for row in csv.DictReader(io.StringIO(content.decode())) if row["matrix"] == "A"]
        size = round(len(rows) ** 0.5)
        return [np.array([float(row["value"]) for row in rows]).reshape(size, size)]


def test_what_is_no_bytes_is_the_extensions_own_error() -> None:
    wrong = type("Wrong", (Format,), {"name": "wrong", "extension": ".w", "what": "w", "write": lambda self, m: "text"})
    with pytest.raises(ExtensionError, match=r"extension wrong \(package tests\): write returned str: must be"):
        wrong().content(None)
    nameless = type("Nameless", (Format,), {"name": "nameless", "extension": "w", "what": "w"})
    words = "its extension 'w' must begin with a point; has no write"
    with pytest.raises(ExtensionError, match=words), registration(nameless):
        pass
