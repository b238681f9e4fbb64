"""Tests of extensions that affect the motion, by independent methods.

Power is dE/dt; Lagrange's equations of symbols hold at the accelerations of floats, which small motions follow as modes
do; every form of the equations and every engine has the same motion, in a chain as on a structure, in Python as on the
page; and each number that it cannot have is one error, with its place.
"""

from __future__ import annotations

import json
import pickle
import subprocess
from collections.abc import Mapping, Sequence
from functools import cache
from importlib import import_module
from shutil import which
from typing import Any, ClassVar

import numpy as np
import pytest

from modal.errors import MissingExtraError, SceneError
from modal.modes import natural_modes
from modal.report import deferred
from modal.scene import InitialCondition, Scene, dumps, refusals, scene_from
from modal.scene.files import parse
from modal.scene.parameters import find_places, number_at, vary
from modal.testing.extensions import HOSTILE, ExtensionTests
from modal.types import Floats

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
