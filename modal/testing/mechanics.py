"""Tests of extensions that affect the motion, by independent methods.

Power is dE/dt; Lagrange's equations of symbols hold at the accelerations of floats, which small motions follow as modes
do; every form of the equations and every engine has the same motion, in a chain as on a structure, in Python as on the
page; and each number that it cannot have is one error, with its place.

Of joint laws and point forces also

    ∂τ/∂γ by the tape = by SymPy = by complex steps

and of supports the derivatives of the position by SymPy and by jets.
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

from modal.assembly import matrices
from modal.errors import MissingExtraError, SceneError
from modal.modes import natural_modes
from modal.report import deferred
from modal.scene import Bob, InitialCondition, Pendulum, Scene, dumps, refusals, scene_from
from modal.scene.files import parse
from modal.scene.parameters import find_places, number_at, vary
from modal.testing.extensions import HOSTILE, ExtensionTests
from modal.types import IMAGINARY_STEP, Floats

LAW_ERROR_MAX = 1e-9
"""Tolerance: by which derivatives and accelerations may differ, relative to the largest."""
QUESTION = """
const scene = %s, system = $system.systemOf(scene);
const motion = new $motion.Motion(system, $system.startOf(scene, system), { tolerance: 1e-11, linear: false });
motion.advance(%s);
process.stdout.write(JSON.stringify([...motion.y]));
"""
"""Format: of the question to Node."""


class MechanicsTests(ExtensionTests):
    """Tests of what has these `parameters` at a `path` of scenes, in motions by up to `reach` (m, rad and per second).

    >>> from modal.testing.mechanics import MechanicsTests
    >>> MechanicsTests.reach
    1.0
    """

    parameters: ClassVar[Mapping[str, Any]] = {}
    reach: ClassVar[float] = 1.0
    path: ClassVar[str] = ""
    engines: ClassVar[tuple[str, ...]] = ("numpy", "numba")

    def cases(self, name: str) -> Sequence[Any] | None:
        """States, hostile numbers, parameters, forms and engines."""
        known: dict[str, Sequence[Any]] = {
            "wrong": [*self._wrong_numbers()],
            "form": ("maximal", "hamiltonian"),
            "engine": self.engines,
            "seed": (1, 2, 3),
            "number_name": tuple(parameter.name for parameter in self.extension.parameters),
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

    @property
    def written(self) -> dict[str, Any]:
        """As in a scene."""
        return {"kind": self.extension.name, **self.parameters}

    def table(self, **wrong: Any) -> dict[str, Any]:
        """A scene with it, a bob and a rod, as in a file; `wrong` takes the place of numbers."""
        raise NotImplementedError

    def scene(self, angles: Sequence[float] = (40.0, -25.0)) -> Scene:
        """The same with a start."""
        scene = scene_from(self.table())
        pendulum = scene.pendulum[0].replace(start=InitialCondition(angles_deg=angles))
        return scene.replace(pendulum=[pendulum])

    def states(self, seed: int) -> Floats:
        """Three states of the scene: coordinates of the support, two angles, the rates of all, work."""
        layout = _equations(self.scene()).layout
        moving = np.random.default_rng(seed).uniform(-self.reach, self.reach, (3, 2 * layout.half))
        return np.hstack([moving, np.zeros((3, layout.size - 2 * layout.half))])

    # ------------------------------------------------------------------------------------------------- motions

    def test_power_is_the_rate_of_energy(self, seed: int) -> None:
        """At states with large angles, by differences along the motion."""
        equations, step = _equations(self.scene()), 1e-5
        for y in self.states(seed):
            rates = equations.derivative(0.0, y)
            behind, ahead = (_energy(self.scene(), y + h * rates) for h in (-step, step))
            power = rates[-1] if equations.layout.works else 0.0
            assert (ahead - behind) / (2 * step) == pytest.approx(power, abs=1e-5 * max(1.0, abs(power)))

    def test_nothing_is_stored_at_rest(self) -> None:
        """Energies are those above equilibrium, whatever the potential is there."""
        equations = _equations(self.scene())
        at_rest = _energy(self.scene(), np.zeros(2 * equations.layout.half + 1))
        assert at_rest == pytest.approx(0.0, abs=LAW_ERROR_MAX)

    def test_lagranges_equations_hold_at_the_accelerations(self, seed: int) -> None:
        """Symbols, which omit drives, against floats."""
        if why := refusals(self.scene(), "a derivation") or ["drives"] * ("van_der_pol" in self.scene().features):
            pytest.skip(why[0])
        forms, equations = _lagrange(self.scene()), _equations(self.scene())
        half = equations.layout.half
        for y in self.states(seed):
            q, v, a = y[:half], y[half : 2 * half], equations.derivative(0.0, y)[half : 2 * half]
            assert np.abs(forms(*np.stack([q, v, a], axis=1).ravel())).max() < LAW_ERROR_MAX * max(1.0, np.abs(a).max())

    def test_modes_are_those_of_the_accelerations(self) -> None:
        """By differences about rest."""
        scene = self.scene().undriven
        equations, step = _equations(scene), 1e-6
        half, rest = equations.layout.half, np.zeros(equations.layout.size)
        rest[equations.layout.first : half] = equations.system.rest
        ways = step * np.eye(len(rest))[: 2 * half]
        ends = [[equations.derivative(0.0, rest + sign * way)[: 2 * half] for way in ways] for sign in (1, -1)]
        eigenvalues = np.linalg.eigvals((np.array(ends[0]) - ends[1]).T / (2 * step))
        for eigenvalue in map(complex, natural_modes(scene).eigenvalue):
            assert np.abs(eigenvalues - eigenvalue).min() < 1e-4 * max(1.0, abs(eigenvalue))

    def test_the_books_of_energy_close(self, seed: int) -> None:
        """From three starts."""
        angles = np.degrees(self.reach) * np.random.default_rng(seed).uniform(-1, 1, 2)
        assert simulated(self.scene(angles.tolist())).energy_drift() < 1e-6

    def test_every_form_has_the_same_motion(self, form: str) -> None:
        """Of those that take the scene."""
        scene = self.scene()
        if why := refusals(scene, f"form {form}"):
            pytest.skip(why[0])
        run, other = simulated(scene), simulated(scene, form=form)
        np.testing.assert_allclose(other.motion.links, run.motion.links, atol=1e-6)

    def test_every_engine_has_the_same_motion(self, engine: str) -> None:
        """Of an ensemble, all members at once."""
        scene, ensemble = self.scene(), deferred("nonlinear:ensemble")
        if why := refusals(scene, f"engine {engine}"):
            pytest.skip(why[0])
        options = {"engine": engine, "output": "end", "check": 0, "workers": 1, "tolerance": 1e-9}
        try:
            members = ensemble(scene, 1.0, vary={"gravity": [9.81, 9.6]}, **options)
        except MissingExtraError as error:
            pytest.skip(str(error))
        assert not members.failures
        np.testing.assert_allclose(members.final.links[0], simulated(scene).motion.links[-1], atol=1e-6)

    def test_a_structure_has_the_motion_of_a_chain(self) -> None:
        """The same support, next to one that nothing hangs from."""
        table = self.table()
        idle = {"kind": "heave", "name": "idle", "mass": 1.0, "stiffness": 10.0}
        table |= {"support": [{**table["support"], "name": "rail"}, idle]}
        table["pendulum"][0] |= {"on": "rail", "start": {"angles_deg": [40.0, -25.0]}}
        run, other = simulated(self.scene()), simulated(scene_from(table))
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
        layout = _equations(scene).layout
        links = json.loads(ran.stdout)[layout.first : layout.half]
        np.testing.assert_allclose(links, simulated(scene).motion.links[-1], atol=1e-7)

    # ------------------------------------------------------------------------------------------- as part of a scene

    def test_a_number_that_it_cannot_have_is_one_error(self, wrong: dict[str, Any]) -> None:
        """With the place."""
        with pytest.raises(SceneError) as refused:
            scene_from(self.table(**wrong))
        assert all(problem.startswith(self.path) for problem in refused.value.problems), refused.value.problems

    def test_a_file_and_another_process_keep_it(self) -> None:
        """Every number as it was."""
        scene = self.scene()
        assert parse(dumps(scene).encode()) == scene
        assert pickle.loads(pickle.dumps(scene)) == scene

    def test_each_number_can_be_varied(self, number_name: str) -> None:
        """By its place, as every number of a scene."""
        scene, path = self.scene(), f"{self.path}.{number_name}"
        (place,) = find_places(scene, path)
        value = number_at(scene, place) * (1 - 1e-3)
        assert number_at(vary(scene, {path: value}), place) == value

    def test_its_parameters_have_names_units_and_ranges(self) -> None:
        """That a page can show."""
        for parameter in self.extension.parameters:
            assert parameter.name.isidentifier()
            assert parameter.low <= parameter.high
            assert parameter.default is None or not parameter.mistake(parameter.default)


@cache
def _equations(scene: Scene) -> Any:
    system = deferred("nonlinear:system_of")(scene)
    recursion = deferred("nonlinear.dynamics:Recursion")
    return deferred("nonlinear.dynamics:Minimal")(system, tuple(recursion(group) for group in system.groups))


@cache
def simulated(scene: Scene, form: str = "minimal") -> Any:
    """A second of its motion."""
    return deferred("nonlinear:simulate")(scene, 1.0, form=form, tolerance=1e-10, output=11)


def _energy(scene: Scene, y: Floats) -> float:
    """Kinetic and potential energy (J) of a state."""
    equations, energies = _equations(scene), deferred("nonlinear.dynamics.mechanics:energies")
    half = equations.layout.half
    return float(energies(equations.system, y[:half, None], y[half : 2 * half, None]).total[0])


@cache
def _lagrange(scene: Scene) -> Any:
    """Lagrange's equations as a function of q, q' and q'' of each coordinate."""
    system = deferred("modal.symbolic:symbolic_structure")(scene)
    names = [part for coordinate in system.coordinates for part in coordinate]
    forms = [system.written_out(form) for form in system.equations()]
    return deferred("sympy:lambdify")(names, forms, "math", cse=True)


OPERATORS = {"+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv, "neg": operator.neg}


class LinkTests(MechanicsTests):
    """Tests of what acts on links by a `key` of theirs, `torque` being a number of it for two others.

    >>> from modal.testing.mechanics import LinkTests
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
