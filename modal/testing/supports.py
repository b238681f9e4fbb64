"""Tests of supports: derivatives of the position by SymPy and by jets, and all comparisons of `mechanics`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np
import pytest

from modal.report import deferred
from modal.testing.mechanics import LAW_ERROR_MAX, MechanicsTests


class SupportTests(MechanicsTests):
    """Tests of a `Support` with these `parameters`, which are all numbers that a scene gives it, its mass with them.

    >>> from modal.testing import SupportTests
    >>> class TestMine(SupportTests):
    ...     parameters = {"mass": 2.0, "inertia": 0.1, "radius": 0.3}
    """

    path: ClassVar[str] = "support"
    engines: ClassVar[tuple[str, ...]] = ("numpy",)

    def table(self, **wrong: Any) -> dict[str, Any]:
        """A bob and a rod below it."""
        links = [{"kind": "bob", "mass": 1.0, "length": 0.5}, {"kind": "rod", "mass": 0.6, "length": 0.4}]
        return {"gravity": 9.81, "support": self.written | wrong, "pendulum": [{"links": links}]}

    def test_its_motion_is_the_derivative_of_its_place(self, seed: int) -> None:
        """By symbols; its potential's slopes, too."""
        path, symbols = self.extension(), deferred("sympy:symbols")
        d = len(path.coordinates)
        eta, rates = np.random.default_rng(seed).uniform(-self.reach, self.reach, (2, d)).tolist()
        numbers = {p.name: self.parameters.get(p.name, p.default) for p in path.parameters}
        q: Sequence[Any] = symbols(f"q0:{d}")
        at = dict(zip(q, eta, strict=True))
        place = [deferred("sympy:sympify")(part) for part in path.place(q, numbers)]
        displacement, slopes, bend = path.motion(eta, rates, numbers)
        for part, expression in zip(displacement, place, strict=True):
            assert float(part) == pytest.approx(float(expression.subs(at)), rel=LAW_ERROR_MAX, abs=LAW_ERROR_MAX)
        for row, name in zip(slopes, q, strict=True):
            expected = [float(part.diff(name).subs(at)) for part in place]
            assert [*map(float, row)] == pytest.approx(expected, rel=LAW_ERROR_MAX, abs=LAW_ERROR_MAX)
        pairs = [*zip(q, rates, strict=True)]
        for part, expression in zip(bend, place, strict=True):
            expected = sum(float(expression.diff(a, b).subs(at)) * u * v for a, u in pairs for b, v in pairs)
            assert float(part) == pytest.approx(expected, rel=LAW_ERROR_MAX, abs=LAW_ERROR_MAX)
        energy = deferred("sympy:sympify")(path.potential(q, numbers))
        for jet, name in zip(path.forces(eta, numbers) or [], q, strict=False):
            assert float(jet.first) == pytest.approx(
                float(energy.diff(name).subs(at)), rel=LAW_ERROR_MAX, abs=LAW_ERROR_MAX
            )
