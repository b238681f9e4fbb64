"""All mode shapes of a scene at once: what `Modes.shape` gives one by one, each source asked for its rows together."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from modal.eigen import Details, Part
from modal.modes.mode import UNCERTAIN
from modal.modes.modes import Modes
from modal.modes.shapes import Shape, expand


def all_shapes(modes: Modes) -> list[list[Shape]]:
    """`modes.shape(number, copy, "mass")` for every mode and copy."""
    groups, rows = modes.spectrum.groups, _rows(modes)
    details = {source: modes.spectrum.details(source, list(own)) for source, own in rows.items()}

    def shape(part: Part, copy: int, uncertain: bool) -> Shape:
        row = _row(details[part.source], rows[part.source][part.row_of(copy)])
        return expand(modes.rig, modes.units, part, copy, row, "mass", uncertain=uncertain)

    return [
        [shape(part, copy, bool(error >= UNCERTAIN)) for part in parts for copy in range(part.along + part.across)]
        for parts, error in zip(groups, modes.error, strict=True)
    ]


def _rows(modes: Modes) -> dict[int, dict[int, int]]:
    """For every source the rows that are needed, and their places among these."""
    found: dict[int, dict[int, int]] = {}
    for part in (part for parts in modes.spectrum.groups for part in parts):
        own = found.setdefault(part.source, {})
        for copy in range(part.along + part.across):
            own.setdefault(part.row_of(copy), len(own))
    return found


def _row(details: Details, at: int) -> Details:
    """One row of them, the last axis of every array."""
    one: dict[str, Any] = {}
    for field in fields(details):
        value = getattr(details, field.name)
        one[field.name] = tuple(part[..., [at]] for part in value) if isinstance(value, tuple) else value[[at]]
    return Details(**one)
