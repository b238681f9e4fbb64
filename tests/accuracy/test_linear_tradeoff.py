"""Time against accuracy of natural frequencies: errors against closed forms, and the report on them."""

import csv
import io
import json
from collections.abc import Iterator
from itertools import count
from math import inf, isnan, sqrt

import numpy as np
import pytest

from modal import Bob, Cart, Pendulum, Scene, load
from modal.errors import SceneError
from modal.scene.parameters import vary
from nonlinear.accuracy import FrequencyTradeoff, frequencies_table, measure_frequencies, work_precision

TWO = Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0, count=2)])])
GRADED = Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=m, length=1.0) for m in (1.0, 1e-8) * 5])])


@pytest.fixture(scope="module", autouse=True)
def once() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(work_precision, "process_time", count().__next__)
        yield


@pytest.fixture(scope="module")
def graded() -> FrequencyTradeoff:
    return measure_frequencies(GRADED, (1e-8, 1e-3))


def test_errors_are_those_to_the_closed_form(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two equal bobs, ω² = (2 ∓ √2) g/l: dense frequencies that are 1e-6 too high are found to be so."""
    omega = np.sqrt(9.81 * np.array([2 - sqrt(2), 2 + sqrt(2)]))
    monkeypatch.setattr(work_precision, "_dense", lambda planes, size: omega * (1 + 1e-6))
    assert measure_frequencies(TWO).rows[0].error == pytest.approx(1e-6, rel=1e-5)
    monkeypatch.setattr(work_precision, "_dense", lambda planes, size: omega)
    assert measure_frequencies(TWO).rows[0].error < 4e-16


def test_links_that_stand_are_in_order() -> None:
    """An inverted bob held by a spring, and one that falls: ω² = k/m l² ∓ g/l of one, by its size."""
    falling = Pendulum(links=[Bob(mass=1.0, length=2.0)], equilibrium=["up"])
    held = Pendulum(links=[Bob(mass=1.0, length=1.0, stiffness=20.0)], equilibrium=["up"])
    scene = Scene(gravity=9.81, pendulum=[falling, held])
    assert np.allclose([float(x) for x in work_precision._squares(scene)], [-9.81 / 2, 20 - 9.81], rtol=1e-15)
    assert all(row.error < 1e-15 for row in measure_frequencies(scene).rows)


def test_every_way_keeps_its_bound_and_dense_matrices_lose_digits(graded: FrequencyTradeoff) -> None:
    dense, *ours = graded.rows
    assert [row.way for row in ours] == ["to 1e-8", "to 0.001", "every digit"]
    assert dense.error > 1e-10
    assert isnan(dense.bound)
    assert all(row.error <= row.bound for row in ours)
    assert ours[-1].error < 1e-15


@pytest.mark.parametrize("name", ["paper-cart-2", "chain-spatial"])
def test_rigid_motions_copies_and_planes_are_in_order(name: str) -> None:
    assert all(row.error < 1e-12 for row in measure_frequencies(load(name)).rows)


def test_what_gives_up_and_what_is_refused() -> None:
    steep = Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=m, length=1.0) for m in (1.0, 1e-16) * 5])])
    result = measure_frequencies(steep)
    assert result.rows[0].error == inf
    assert json.loads(frequencies_table(result, "json"))["rungs"][0]["error"] is None
    massless = Scene(gravity=9.81, support=Cart(mass=0.0), pendulum=TWO.pendulum)
    assert measure_frequencies(massless).rows[-1].error < 1e-15
    with pytest.raises(SceneError, match="needs a scene without losses"):
        measure_frequencies(vary(TWO, {"pendulum[0].links[0].damping": 0.1}))
    assert measure_frequencies(TWO.replace(damping_ratio=0.1)).rows[0].error < 1e-14
    with pytest.raises(SceneError, match="1001 different frequencies and 1000 links: at most 60"):
        measure_frequencies(load("thousand-pendula"))


def test_tables(graded: FrequencyTradeoff) -> None:
    text = frequencies_table(graded, "text")
    assert all(words in text for words in ("/ dense", "error of ω", "20 digits"))
    rows = list(csv.DictReader(io.StringIO(frequencies_table(graded, "csv"))))
    assert [float(row["error"]) for row in rows] == [row.error for row in graded.rows]
    whole = json.loads(frequencies_table(graded, "json"))
    assert whole["rungs"][0].keys() == {"way", "route", "seconds", "bound", "error", "pareto"}
    assert whole["rungs"][0]["bound"] is None
