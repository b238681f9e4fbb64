"""Scenes written as a cart, or a chain, and as the same thing on a structure: a share of `benchmarks/twice.py`."""

from __future__ import annotations

import pytest
import twice
from twice import LIMIT, judge

VERBS = ("frequencies", "table", "shapes", "explain", "matrices", "export", "response", "gains")
PAIRS = {19: "beside", 38: "modal", 41: "tilt"}
"""Small pairs by number, and how each is written the second time."""


@pytest.mark.parametrize("seed", PAIRS)
def test_every_number_is_the_same(seed: int) -> None:
    pair, rows = judge(seed, VERBS)
    assert pair.way == PAIRS[seed]
    assert {row.became for row in rows} == {"answered"}
    assert max(row.difference for row in rows) < LIMIT


def test_the_comparison_bites(monkeypatch: pytest.MonkeyPatch) -> None:
    """A twin whose cart is heavier by one part in 1e10."""
    pair = twice.twins(19)
    carts = [pair.second.scene.support[0].replace(mass=pair.first.scene.support.mass * (1 + 1e-10))]
    heavier = pair.second.scene.replace(support=[*carts, *pair.second.scene.support[1:]])
    monkeypatch.setattr(twice, "twins", lambda _: pair._replace(second=pair.second._replace(scene=heavier)))
    _, rows = judge(19, ("frequencies", "matrices"))
    assert all(row.difference > LIMIT for row in rows)
