"""Whether a law of joints is right, by routes that do not know each other.

    ∂τ/∂γ by the tape = by SymPy = by complex steps,    power = dE/dt,    Lagrange's equations at the floats' q'' = 0,

every form of the equations and every engine the same motion, in a chain as on a structure, in Python as on the page;
and one error, with its place, for each number that it cannot have.
"""

from __future__ import annotations

import json
import operator
import pickle
import subprocess
from collections.abc import Mapping, Sequence
from functools import cache, cached_property
from importlib import import_module
from shutil import which
from typing import Any, ClassVar

import numpy as np
import pytest

from modal.errors import MissingExtraError, SceneError
from modal.modes import natural_modes
from modal.report import deferred
from modal.scene import Bob, Cart, Heave, InitialCondition, Pendulum, Rod, Scene, dumps, refusals, scene_from
from modal.scene.files import parse
from modal.scene.parameters import vary
from modal.testing.extensions import HOSTILE, ExtensionTests
from modal.types import IMAGINARY_STEP, Floats

LAW_ERROR_MAX = 1e-9
"""Tolerance: by which derivatives and accelerations may differ, relative to the largest."""
PLACE = "pendulum[0].links[0].law"
"""Where the law is in the scenes."""
OPERATORS = {"+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv, "neg": operator.neg}
ENGINES, FORMS = ("numpy", "numba"), ("maximal", "hamiltonian")
QUESTION = """
const scene = %s, system = $system.systemOf(scene);
const motion = new $motion.Motion(system, $system.startOf(scene, system), { tolerance: 1e-11, linear: false });
motion.advance(%s);
process.stdout.write(JSON.stringify([...motion.y]));
"""
"""Format: of what Node is asked."""


class LawTests(ExtensionTests):
    """Tests of a `JointLaw` with these `parameters`, at joints that swing by up to `reach` (rad and rad/s).

    >>> from modal.testing import LawTests
    >>> class TestMine(LawTests):
    ...     parameters = {"strength": 0.02}
    """

    parameters: ClassVar[Mapping[str, float]] = {}
    reach: ClassVar[float] = 1.0

    def cases(self, name: str) -> Sequence[Any] | None:
        """Angles with rates, states, hostile numbers, parameters, forms and engines."""
        if name == "place":
            return [tuple(row) for row in np.random.default_rng(1).uniform(-self.reach, self.reach, (6, 2)).tolist()]
        if name == "wrong":
            return [*self._wrong_numbers()]
        number_names = [parameter.name for parameter in self.extension.parameters]
        known: dict[str, Sequence[Any]] = {
            "form": FORMS,
            "engine": ENGINES,
            "seed": (1, 2, 3),
            "number_name": tuple(number_names),
        }
        return known.get(name)

    def _wrong_numbers(self) -> list[dict[str, Any]]:
        wrong: list[dict[str, Any]] = [{"nosuch": 1.0}, {"kind": "nosuch"}, {"kind": 1.0}]
        for parameter in self.extension.parameters:
            outside = [parameter.low - 1.0, parameter.high + 1.0]
            wrong += [{parameter.name: value} for value in (*HOSTILE, *outside) if not self._fits(parameter, value)]
        return wrong

    @staticmethod
    def _fits(parameter: Any, value: Any) -> bool:
        return type(value) is float and abs(value) < 1e300 and not parameter.mistake(value)

    # -------------------------------------------------------------------------------------------------- scenes

    def scene(self, angles: Sequence[float] = (40.0, -25.0), **changes: Any) -> Scene:
        """A bob and a rod on a cart, the law at the joint to the cart and at that between them."""
        law: Any = {"kind": self.extension.name, **self.parameters}
        links = [Bob(mass=1.0, length=0.5, law=law), Rod(mass=0.6, length=0.4, law=law)]
        pendulum = Pendulum(links=links, start=InitialCondition(angles_deg=angles), **changes.pop("more", {}))
        return Scene(gravity=9.81, support=changes.pop("support", Cart(mass=2.0, stiffness=3.0)), pendulum=[pendulum])

    @cached_property
    def law(self) -> Any:
        """The law itself."""
        return self.extension()

    def torque(self, angle: Any, rate: Any, **changes: Any) -> Any:
        """Of any scalars."""
        values = {p.name: p.default for p in self.extension.parameters} | dict(self.parameters)
        return self.law.torque(angle, rate, values | changes)

    def states(self, seed: int) -> Floats:
        """States (3, 7) of the scene: x, two angles, their rates, work."""
        return np.hstack([np.random.default_rng(seed).uniform(-self.reach, self.reach, (3, 6)), np.zeros((3, 1))])

    # ---------------------------------------------------------------------------------------------- arithmetic

    def test_it_is_what_it_says_of_itself(self) -> None:
        """Odd, conservative, dissipative; nothing at rest."""
        self.law.judge({p.name: p.default for p in self.extension.parameters} | dict(self.parameters))

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

    # ------------------------------------------------------------------------------------------------- motions

    def test_power_is_the_rate_of_energy(self, seed: int) -> None:
        """At states with large angles, by differences along the motion."""
        equations, step = _equations(self.scene()), 1e-5
        for y in self.states(seed):
            rates = equations.derivative(0.0, y)
            behind, ahead = (_energy(self.scene(), y + h * rates) for h in (-step, step))
            power = rates[-1]
            size = max(1.0, abs(power))
            assert (ahead - behind) / (2 * step) == pytest.approx(power, abs=1e-5 * size)

    def test_lagranges_equations_hold_at_the_accelerations(self, seed: int) -> None:
        """Of symbols, at what floats compute."""
        if self.law.is_drive:
            pytest.skip("symbols leave drives out")
        forms, equations = _lagrange(self.scene()), _equations(self.scene())
        for y in self.states(seed):
            q, v, a = y[:3], y[3:6], equations.derivative(0.0, y)[3:6]
            assert np.abs(forms(*np.stack([q, v, a], axis=1).ravel())).max() < LAW_ERROR_MAX * max(1.0, np.abs(a).max())

    def test_a_mirrored_start_has_the_mirrored_motion(self) -> None:
        """Where the law is odd."""
        angles = (35.0, -20.0)
        run, other = (_simulated(self.scene([sign * angle for angle in angles])) for sign in (1, -1))
        mirrored = np.allclose(run.motion.links, -other.motion.links, rtol=0, atol=1e-5)
        assert mirrored or not self.extension.is_odd

    def test_the_books_of_energy_close(self, seed: int) -> None:
        """From three starts."""
        angles = np.degrees(self.reach) * np.random.default_rng(seed).uniform(-1, 1, 2)
        assert _simulated(self.scene(angles.tolist())).energy_drift() < 1e-6

    def test_every_form_has_the_same_motion(self, form: str) -> None:
        """Of those that take the scene."""
        scene = self.scene()
        if why := refusals(scene, f"form {form}"):
            pytest.skip(why[0])
        run, other = _simulated(scene), _simulated(scene, form=form)
        np.testing.assert_allclose(other.motion.links, run.motion.links, atol=1e-6)

    def test_every_engine_has_the_same_motion(self, engine: str) -> None:
        """Of members side by side."""
        scene, ensemble = self.scene(), deferred("nonlinear:ensemble")
        if why := refusals(scene, f"engine {engine}"):
            pytest.skip(why[0])
        options = {"engine": engine, "output": "end", "check": 0, "workers": 1, "tolerance": 1e-9}
        try:
            members = ensemble(scene, 1.0, vary={"gravity": [9.81, 9.6]}, **options)
        except MissingExtraError as error:
            pytest.skip(str(error))
        assert not members.failures
        np.testing.assert_allclose(members.final.links[0], _simulated(scene).motion.links[-1], atol=1e-6)

    def test_a_structure_has_the_motion_of_a_chain(self) -> None:
        """The same cart, beside a support that nothing hangs from."""
        cart = Cart(name="rail", mass=2.0, stiffness=3.0)
        idle = Heave(name="idle", mass=1.0, stiffness=10.0)
        structured = self.scene(support=[cart, idle], more={"on": "rail"})
        run, other = _simulated(self.scene()), _simulated(structured)
        np.testing.assert_allclose(other.motion.links, run.motion.links, atol=1e-6)

    def test_the_page_has_the_motion_of_python(self) -> None:
        """In Node, where it is installed."""
        if (node := which("node")) is None:
            pytest.skip("no Node is installed here")
        scene, seconds = self.scene(), 1.0
        if why := refusals(scene, "the live page"):
            pytest.skip(why[0])
        data = deferred("multipendula.page:scene_data")(scene)
        names = import_module("multipendula.page.document").PHYSICS
        modules = deferred("multipendula.page:joined")(names, scene_from(data))
        question = QUESTION % (json.dumps(data), seconds)
        ran = subprocess.run([node, "-"], input=modules + question, capture_output=True, text=True, check=False)
        assert ran.returncode == 0, ran.stderr[-2000:]
        np.testing.assert_allclose(json.loads(ran.stdout)[1:3], _simulated(scene).motion.links[-1], atol=1e-7)

    # ------------------------------------------------------------------------------------------- as part of a scene

    def test_a_number_that_it_cannot_have_is_one_error(self, wrong: dict[str, Any]) -> None:
        """With the place."""
        law = {"kind": self.extension.name, **self.parameters} | wrong
        link = {"kind": "bob", "mass": 1.0, "length": 0.5, "law": law}
        with pytest.raises(SceneError) as refused:
            scene_from({"gravity": 9.81, "pendulum": [{"links": [link]}]})
        assert all(problem.startswith(PLACE) for problem in refused.value.problems), refused.value.problems

    def test_a_file_and_another_process_keep_it(self) -> None:
        """Every number as it was."""
        scene = self.scene()
        assert parse(dumps(scene).encode()) == scene
        assert pickle.loads(pickle.dumps(scene)) == scene

    def test_each_number_can_be_varied(self, number_name: str) -> None:
        """By its place, as every number of a scene."""
        scene = self.scene()
        value = getattr(scene.pendulum[0].links[0].law, number_name)
        varied = vary(scene, {f"{PLACE}.{number_name}": value * (1 - 1e-3)})
        assert getattr(varied.pendulum[0].links[0].law, number_name) == value * (1 - 1e-3)
        assert (natural_modes(varied).omega != natural_modes(scene).omega).any() or number_name

    def test_its_parameters_have_names_units_and_ranges(self) -> None:
        """That a page can show."""
        for parameter in self.extension.parameters:
            assert parameter.name.isidentifier()
            assert parameter.low <= parameter.high
            assert parameter.default is None or not parameter.mistake(parameter.default)


# ----------------------------------------------------------------------------------------------------------- routes


def _named(place: Sequence[float]) -> dict[Any, float]:
    symbol = deferred("sympy:Symbol")
    return dict(zip((symbol("gamma", real=True), symbol("rate", real=True)), place, strict=True))


def _symbolic(tests: LawTests) -> list[Any]:
    """The torque of SymPy's symbols, and its derivatives."""
    names = [*_named([0.0, 0.0])]
    torque = deferred("sympy:sympify")(tests.torque(*names))
    return [torque, *(torque.diff(name) for name in names)]


def _recorded(tests: LawTests) -> list[Any]:
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


@cache
def _equations(scene: Scene) -> Any:
    system = deferred("nonlinear:system_of")(scene)
    recursion = deferred("nonlinear.dynamics:Recursion")
    return deferred("nonlinear.dynamics:Minimal")(system, tuple(recursion(group) for group in system.groups))


@cache
def _simulated(scene: Scene, form: str = "minimal") -> Any:
    return deferred("nonlinear:simulate")(scene, 1.0, form=form, tolerance=1e-10, output=11)


def _energy(scene: Scene, y: Floats) -> float:
    """Kinetic and potential energy (J) of a state."""
    motion = deferred("nonlinear:Motion")(
        links=y[None, 1:3], link_rates=y[None, 4:6], cart=y[:1], cart_rate=y[3:4], work=y[6:]
    )
    mechanics = deferred("nonlinear.dynamics:Mechanics")(deferred("nonlinear:system_of")(scene), motion)
    return float(mechanics.energy[0])


@cache
def _lagrange(scene: Scene) -> Any:
    """Lagrange's equations as a function of q, q' and q'' of each coordinate."""
    system = deferred("modal.symbolic:symbolic_structure")(scene)
    names = [part for coordinate in system.coordinates for part in coordinate]
    forms = [system.written_out(form) for form in system.equations()]
    return deferred("sympy:lambdify")(names, forms, "math", cse=True)
