"""Tests of joint laws and point forces by independent methods.

    ∂τ/∂γ by the tape = by SymPy = by complex steps

and all that `mechanics` compares of their motions.
"""

from __future__ import annotations

import operator
from collections.abc import Sequence
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
import pytest

from modal.assembly import matrices
from modal.modes import natural_modes
from modal.report import deferred
from modal.scene import Bob, Pendulum, Scene
from modal.testing.mechanics import LAW_ERROR_MAX, MechanicsTests, simulated
from modal.types import IMAGINARY_STEP

OPERATORS = {"+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv, "neg": operator.neg}


class LinkTests(MechanicsTests):
    """Tests of what acts on links by a `key` of theirs, `torque` being a number of it for two others.

    >>> from modal.testing.laws import LinkTests
    >>> LinkTests.key
    'law'
    """

    key: ClassVar[str] = "law"

    def cases(self, name: str) -> Sequence[Any] | None:
        """Also pairs of what it is a function of."""
        if name == "place":
            return [tuple(row) for row in np.random.default_rng(1).uniform(-self.reach, self.reach, (6, 2)).tolist()]
        return super().cases(name)

    @property
    def path(self) -> str:  # type: ignore[override]
        """The path of the bob."""
        return f"pendulum[0].links[0].{self.key}"

    def table(self, **wrong: Any) -> dict[str, Any]:
        """A bob and a rod on a cart, each with it."""
        links = [
            {"kind": "bob", "mass": 1.0, "length": 0.5, self.key: self.written | wrong},
            {"kind": "rod", "mass": 0.6, "length": 0.4, self.key: self.written},
        ]
        cart = {"kind": "cart", "mass": 2.0, "stiffness": 3.0}
        return {"gravity": 9.81, "support": cart, "pendulum": [{"links": links}]}

    @cached_property
    def law(self) -> Any:
        """The law itself."""
        return self.extension()

    @property
    def values(self) -> dict[str, float]:
        """All its parameters."""
        return {p.name: p.default for p in self.extension.parameters} | dict(self.parameters)

    def torque(self, first: Any, second: Any, **changes: Any) -> Any:
        """A number of it, of any scalars."""
        raise NotImplementedError

    def test_it_is_what_it_says_of_itself(self) -> None:
        """Odd, conservative, dissipative; nothing at rest."""
        self.law.judge(self.values)

    def test_floats_arrays_and_symbols_have_one_torque(self, place: tuple[float, float]) -> None:
        """And complex numbers."""
        expected = float(self.torque(*place))
        columns = [np.full((2, 3), value) for value in place]
        np.testing.assert_allclose(self.torque(*columns), expected, rtol=1e-13, atol=1e-300)
        np.testing.assert_allclose(complex(self.torque(*map(complex, place))), expected, rtol=1e-13, atol=1e-300)
        assert _evaluated(_recorded(self)[0], place) == pytest.approx(expected, rel=1e-12, abs=1e-300)
        assert float(_symbolic(self)[0].subs(_named(place))) == pytest.approx(expected, rel=1e-12, abs=1e-300)

    def test_derivatives_by_three_routes(self, place: tuple[float, float]) -> None:
        """By angle and by rate."""
        steps = np.eye(2) * IMAGINARY_STEP * 1j
        by_steps = [complex(self.torque(*(np.array(place) + step))).imag / IMAGINARY_STEP for step in steps]
        size = max(LAW_ERROR_MAX, *map(abs, by_steps))
        by_symbols = [float(slope.subs(_named(place))) for slope in _symbolic(self)[1:]]
        by_tape = [_evaluated(slope, place) for slope in _recorded(self)[1:]]
        np.testing.assert_allclose(by_symbols, by_steps, rtol=LAW_ERROR_MAX, atol=LAW_ERROR_MAX * size)
        np.testing.assert_allclose(by_tape, by_steps, rtol=LAW_ERROR_MAX, atol=LAW_ERROR_MAX * size)

    def test_derivatives_by_each_parameter(self, number_name: str) -> None:
        """By SymPy and by complex steps, as sensitivities and fits take them."""
        value = dict(self.parameters).get(number_name)
        if value is None:
            pytest.skip("its default is used")
        place, symbol = [0.7 * self.reach, -0.4 * self.reach], deferred("sympy:Symbol")(number_name)
        by_steps = complex(self.torque(*place, **{number_name: value + IMAGINARY_STEP * 1j})).imag / IMAGINARY_STEP
        slope = deferred("sympy:diff")(self.torque(*place, **{number_name: symbol}), symbol)
        assert float(slope.subs({symbol: value})) == pytest.approx(by_steps, rel=LAW_ERROR_MAX, abs=LAW_ERROR_MAX)


class LawTests(LinkTests):
    """Tests of a `JointLaw` with these `parameters`, at joints that swing by up to `reach` (rad and rad/s).

    >>> from modal.testing import LawTests
    >>> class TestMine(LawTests):
    ...     parameters = {"strength": 0.02}
    """

    def torque(self, first: Any, second: Any, **changes: Any) -> Any:
        """The torque, from the angle and the rate."""
        return self.law.torque(first, second, self.values | changes)

    def test_small_motion_has_its_slopes(self) -> None:
        """A bob alone: λ² m l² + λ d + m g l + k = 0 with k and d by SymPy."""
        law: Any = {"kind": self.extension.name, **self.parameters}
        scene = Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=0.5, law=law)])])
        k, d = (-float(slope.subs(_named([0.0, 0.0]))) for slope in _symbolic(self)[1:])
        if self.law.is_drive:
            k = d = 0.0
        roots = np.roots([0.25, d, 9.81 * 0.5 + k])
        eigenvalue = complex(natural_modes(scene).eigenvalue[0])
        assert eigenvalue.real == pytest.approx(roots[0].real, abs=LAW_ERROR_MAX)
        assert abs(eigenvalue.imag) == pytest.approx(abs(roots[0].imag), rel=LAW_ERROR_MAX)

    def test_a_mirrored_start_has_the_mirrored_motion(self) -> None:
        """Where the law is odd."""
        angles = (35.0, -20.0)
        run, other = (simulated(self.scene([sign * angle for angle in angles])) for sign in (1, -1))
        mirrored = np.allclose(run.motion.links, -other.motion.links, rtol=0, atol=1e-5)
        assert mirrored or not self.extension.is_odd


class ForceTests(LinkTests):
    """Tests of a `PointForce` with these `parameters`, at velocities of up to `reach` (m/s).

    >>> from modal.testing import ForceTests
    >>> class TestMine(ForceTests):
    ...     parameters = {"drag": 0.1}
    """

    key = "point_force"

    def torque(self, first: Any, second: Any, **changes: Any) -> Any:
        """The force for a velocity: the part along, with twice that down."""
        along, down = self.law.force([first, second], self.values | changes)
        return along + 2 * down

    def test_it_is_alike_in_space(self, place: tuple[float, float]) -> None:
        """Where the third component is 0."""
        x, z = place
        plane, space = (self.law.force(velocity, self.values) for velocity in ([x, z], [x, 0.0, z]))
        assert [space[0], space[2]] == pytest.approx(plane, rel=LAW_ERROR_MAX)
        assert space[1] == 0

    def test_the_matrix_of_damping_has_its_slope(self) -> None:
        """Of a bob alone: d l² with d by differences."""
        force: Any = self.written
        links = [Bob(mass=1.0, length=0.5, point_force=force)]
        D = matrices(Scene(gravity=9.81, pendulum=[Pendulum(links=links)])).D
        ends = [self.law.force([step, 0.0], self.values)[0] for step in (1e-6, -1e-6)]
        assert D[-1, -1] == pytest.approx(0.25 * (ends[1] - ends[0]) / 2e-6, rel=1e-4, abs=LAW_ERROR_MAX)


# ----------------------------------------------------------------------------------------------------------- routes


def _named(place: Sequence[float]) -> dict[Any, float]:
    symbol = deferred("sympy:Symbol")
    return dict(zip((symbol("gamma", real=True), symbol("rate", real=True)), place, strict=True))


def _symbolic(tests: LinkTests) -> list[Any]:
    """The torque of SymPy's symbols, and its derivatives."""
    names = [*_named([0.0, 0.0])]
    torque = deferred("sympy:sympify")(tests.torque(*names))
    return [torque, *(torque.diff(name) for name in names)]


def _recorded(tests: LinkTests) -> list[Any]:
    """The torque on a tape, and its derivatives."""
    tape = deferred("nonlinear.dynamics.tape:Tape")()
    inputs = tape.inputs("y", 2)
    torque = tests.torque(*inputs)
    (slopes,) = deferred("nonlinear.dynamics.tape:partials")(tape, [torque], [*inputs])
    return [torque, *(slopes.get(k, 0.0) for k in range(2))]


def _evaluated(value: Any, place: Sequence[float]) -> float:
    """The number of a recorded symbol, operation by operation."""
    if not hasattr(value, "operation"):
        return float(value)
    name, *operands = value.operation
    if name == "in":
        return float(place[operands[1]])
    numbers = [_evaluated(operand, place) for operand in operands]
    if name == "where":
        return numbers[1] if numbers[0] > 0 else numbers[2]
    function: Any = OPERATORS.get(name) or getattr(np, name)
    return float(function(*numbers))
