"""A number of an extension that a scene sets: its name, its unit and the range in which it may lie."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, isfinite
from numbers import Real
from typing import Any

from modal.report import Displayed, Summary


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
