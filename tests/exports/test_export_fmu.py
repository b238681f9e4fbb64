"""The FMU in FMPy, held against python-control; its source compiled without warnings."""

from __future__ import annotations

import ctypes
import re
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import control
import numpy as np
import pytest
from amounts import usually
from exported import DT, SCENES, assert_close, assert_matrices, assert_poles, held_inputs, model_of, names
from numpy.typing import NDArray

from modal import SceneError, load, natural_modes
from modal.exports import FORMATS, fmu
from modal.exports.fmu import variables
from modal.exports.scripts import to_control
from modal.exports.text import identifier
from modal.statespace import StateSpace, state_space
from modal.statespace.sampling import reach, sample
from nonlinear import simulate, state_at_rest

fmpy = pytest.importorskip("fmpy", reason="FMPy is not installed")
needs_a_compiler = pytest.mark.skipif(fmu.compiler() is None, reason="no C compiler for 64-bit Linux is installed")
EVERY_SCENE = pytest.mark.parametrize("scene", usually([SCENES[0], SCENES[-1]], SCENES))
BOTH = pytest.mark.parametrize("dt", [0.0, DT], ids=["continuous", "discrete"])
STRICT = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-Wno-unused-parameter", "-shared", "-fPIC")


def written(folder: Path, content: bytes) -> str:
    path = folder / "model.fmu"
    path.write_bytes(content)
    return str(path)


@contextmanager
def instance(folder: Path, model: StateSpace, step: float = DT) -> Iterator[Any]:
    """A running slave."""
    path = written(folder, fmu.write_fmu(model, step))
    unzipped = fmpy.extract(path, str(folder / "unzipped"))
    slave = fmpy.instantiate_fmu(unzipped, fmpy.read_model_description(path), "CoSimulation")
    slave.setupExperiment(startTime=0.0)
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    yield slave
    slave.terminate()
    slave.freeInstance()


def references(model: StateSpace, role: str) -> list[int]:
    return [k for k, variable in enumerate(variables(model)) if variable.role == role]


def stepped(slave: Any, model: StateSpace, inputs: NDArray[np.float64], h: float) -> NDArray[np.float64]:
    """Outputs (p, steps), each read under its input before the step, as z[k] and u[k] give them."""
    outputs = []
    for k, u in enumerate(inputs.T):
        slave.setReal(references(model, "input"), list(u))
        outputs.append(slave.getReal(references(model, "output")))
        slave.doStep(currentCommunicationPoint=k * h, communicationStepSize=h)
    return np.array(outputs).T


@EVERY_SCENE
@BOTH
def test_fmpy_finds_no_problem(scene: str, dt: float, tmp_path: Path) -> None:
    from fmpy.validation import validate_fmu

    model = model_of(scene, dt)
    path = written(tmp_path, FORMATS["fmu"].write(model))
    assert validate_fmu(path) == []
    description = fmpy.read_model_description(path)
    by_role: dict[str, list[Any]] = {"input": [], "local": [], "output": [], "parameter": []}
    for variable in description.modelVariables:
        by_role[variable.causality].append(variable) if not variable.derivative else None
    for role, signals in zip(by_role, (model.inputs, model.states, model.outputs, model.states), strict=True):
        assert [v.name.removeprefix("state.").removesuffix("_start") for v in by_role[role]] == names(signals)
        assert [v.unit for v in by_role[role]] == [s.unit.replace(" ", ".").replace("^", "") for s in signals]
    assert [v.valueReference for v in description.modelVariables] == list(range(len(description.modelVariables)))
    assert description.coSimulation.canHandleVariableCommunicationStepSize is (dt == 0)
    assert float(description.defaultExperiment.stepSize) == DT
    rates = [variable for variable in description.modelVariables if variable.derivative]
    assert [rate.name for rate in rates] == [f"der({rate.derivative.name})" for rate in rates]
    assert (description.modelExchange is None, len(rates)) == ((True, 0) if dt else (False, len(model.states)))
    known = names(model.inputs) + ([] if dt else [f"state.{name}" for name in names(model.states)])
    gains = {"outputs": model.D if dt else np.hstack((model.D, model.C))}
    gains |= {} if dt else {"derivatives": np.hstack((model.B, model.A))}
    for part, rows in gains.items():
        through = [[known.index(v.name) for v in unknown.dependencies] for unknown in getattr(description, part)]
        assert through == [list(np.flatnonzero(row)) for row in rows]


@EVERY_SCENE
@BOTH
@needs_a_compiler
def test_steps_of_the_default_length_are_controls(scene: str, dt: float, tmp_path: Path) -> None:
    model = model_of(scene, dt)
    inputs = held_inputs(model, 300)
    with instance(tmp_path, model) as slave:
        outputs = stepped(slave, model, inputs, DT)
    held = model if dt else sample(model, DT)
    expected = control.forced_response(to_control(held), np.arange(300) * DT, inputs).outputs
    assert_close(outputs, expected, 1e-11)


@EVERY_SCENE
@pytest.mark.parametrize("h", [0.003, 0.25])
@needs_a_compiler
def test_steps_of_any_length_are_exact_too(scene: str, h: float, tmp_path: Path) -> None:
    model = model_of(scene)
    inputs = held_inputs(model, 50)
    with instance(tmp_path, model) as slave:
        outputs = stepped(slave, model, inputs, h)
    expected = control.forced_response(to_control(sample(model, h)), np.arange(50) * h, inputs).outputs
    assert_close(outputs, expected, 1e-10)


@EVERY_SCENE
@needs_a_compiler
def test_the_series_is_exact_over_its_longest_piece(scene: str, tmp_path: Path) -> None:
    model = model_of(scene)
    h = 0.99 / reach(model.A)
    inputs = held_inputs(model, 20)
    with instance(tmp_path, model, 10 * h) as slave:
        outputs = stepped(slave, model, inputs, h)
    expected = control.forced_response(to_control(sample(model, h)), np.arange(20) * h, inputs).outputs
    assert_close(outputs, expected, 1e-12)


@EVERY_SCENE
@needs_a_compiler
def test_fmpy_simulates_a_constant_input_as_control_does(scene: str, tmp_path: Path) -> None:
    model = model_of(scene)
    path = written(tmp_path, fmu.write_fmu(model))
    start = {name: 1.0 + k for k, name in enumerate(names(model.inputs))}
    simulated = fmpy.simulate_fmu(path, stop_time=2.0, step_size=DT, output_interval=DT, start_values=start)
    times = simulated["time"]
    assert len(times) == 201
    constant = np.tile(np.array(list(start.values()))[:, None], len(times))
    expected = control.forced_response(to_control(model), np.arange(201) * DT, constant).outputs
    assert_close([simulated[name] for name in names(model.outputs)], expected, 1e-8)


@needs_a_compiler
def test_both_kinds_move_as_the_nonlinear_simulation_does(tmp_path: Path) -> None:
    """From 1e-5 rad, linear to seven digits, as the unit from 1 rad: by CVode, and with exact steps."""
    scene, angle = load("crane-hook"), 1e-5
    path = written(tmp_path, fmu.write_fmu(state_space(scene), 0.05))
    columns = simulate(
        scene, 4.0, output=81, start=state_at_rest(scene, np.degrees([angle, -angle])), tolerance=1e-12
    ).to_dict()
    angles = np.array([columns["theta_1_1_rad"], columns["theta_1_2_rad"]])
    starts = {"theta_1_1_start": 1.0, "theta_1_2_start": -1.0}
    for kind, options in (("CoSimulation", {}), ("ModelExchange", {"solver": "CVode", "relative_tolerance": 1e-12})):
        simulated = fmpy.simulate_fmu(
            path, fmi_type=kind, stop_time=4.0, step_size=0.05, output_interval=0.05, start_values=starts, **options
        )
        assert np.abs([simulated["theta_1_1"], simulated["theta_1_2"]] - angles / angle).max() < 1e-7
        assert np.abs(simulated["x"] - columns["x_m"] / angle).max() < 1e-7 * np.abs(simulated["x"]).max()


@contextmanager
def exchanged(folder: Path, model: StateSpace) -> Iterator[Any]:
    """A model for exchange, in continuous time."""
    path = written(folder, fmu.write_fmu(model))
    unzipped = fmpy.extract(path, str(folder / "unzipped"))
    unit = fmpy.instantiate_fmu(unzipped, fmpy.read_model_description(path), "ModelExchange")
    unit.setupExperiment(startTime=0.0)
    unit.enterInitializationMode()
    yield unit
    unit.terminate()
    unit.freeInstance()


@EVERY_SCENE
@needs_a_compiler
def test_rates_and_their_derivatives_are_the_matrices(scene: str, tmp_path: Path) -> None:
    model = model_of(scene)
    n, rng = len(model.states), np.random.default_rng(5)
    z, z0, u = (rng.normal(size=size).tolist() for size in (n, n, len(model.inputs)))
    kinds = ("input", "state", "output", "start", "derivative")
    inputs, states, outputs, starts, rates = (references(model, role) for role in kinds)
    with exchanged(tmp_path, model) as unit:
        unit.setReal(starts, z0)
        assert unit.getReal(states) == z0
        unit.exitInitializationMode()
        unit.setReal(inputs, u)
        assert_close(np.array(unit.getReal(rates)), model.A @ z0 + model.B @ u, 1e-13)
        unit.enterContinuousTimeMode()
        values = (ctypes.c_double * n)(*z)
        unit.setContinuousStates(values, n)
        rates_now = (ctypes.c_double * n)()
        unit.getDerivatives(rates_now, n)
        assert_close(np.array(rates_now), model.A @ z + model.B @ u, 1e-13)
        assert_close(np.array(unit.getReal(outputs)), model.C @ z + model.D @ u, 1e-13)
        change = np.eye(len(inputs) + n)
        by_all = [unit.getDirectionalDerivative([*rates, *outputs], [*inputs, *states], list(row)) for row in change]
        np.testing.assert_array_equal(np.array(by_all).T, np.block([[model.B, model.A], [model.D, model.C]]))
        with pytest.raises(fmpy.fmi1.FMICallException):
            unit.getDirectionalDerivative([states[0]], [inputs[0]], [1.0])


@needs_a_compiler
def test_a_sampled_model_is_for_co_simulation_alone(tmp_path: Path) -> None:
    path = written(tmp_path, fmu.write_fmu(model_of("crane-hook", DT)))
    description = fmpy.read_model_description(path)
    assert description.modelExchange is None
    with pytest.raises(Exception, match="is not supported"):
        fmpy.simulate_fmu(path, fmi_type="ModelExchange", stop_time=1.0)


@EVERY_SCENE
@BOTH
def test_names_are_those_of_modelica(scene: str, dt: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """A compiler of Modelica lists the block's inputs, outputs, parameters and states."""
    monkeypatch.setattr(fmu, "which", lambda command: None)
    model = model_of(scene, dt)
    text = FORMATS["modelica"].write(model).decode()
    public, _, hidden = text.partition("\nprotected\n")
    record = re.search(r"  record States\n(.*?)  end States;", public, re.DOTALL)
    assert record
    declared = {
        kind: re.findall(rf"^  {kind} Real (\w+)", public, re.MULTILINE) for kind in ("input", "output", "parameter")
    }
    declared["local"] = [f"state.{name}" for name in re.findall(r"Real (\w+)", record[1])]
    listed: dict[str, list[str]] = {kind: [] for kind in declared}
    for variable in fmpy.read_model_description(BytesIO(fmu.write_fmu(model))).modelVariables:
        if not variable.derivative:
            listed[variable.causality].append(variable.name)
    assert listed == declared
    assert re.findall(r"(\S+)\(start = (\w+), fixed = true\)", public.partition("States state(")[2]) == [
        (name.removeprefix("state."), start)
        for name, start in zip(declared["local"], declared["parameter"], strict=True)
    ]
    assert "final parameter Real A[" in hidden


@needs_a_compiler
def test_states_start_where_they_are_told(tmp_path: Path) -> None:
    model = state_space(load("crane-hook"))
    path = written(tmp_path, fmu.write_fmu(model))
    simulated = fmpy.simulate_fmu(
        path,
        stop_time=5.0,
        output_interval=0.05,
        start_values={"theta_1_1_start": 0.1, "x_dot_start": -0.2},
        output=["theta_1_1", "state.theta_dot_1_2", "x"],
    )
    z0 = np.array([0.0, 0.1, 0.0, -0.2, 0.0, 0.0])
    expected = control.initial_response(to_control(model), np.arange(101) * 0.05, z0)
    assert_close(simulated["theta_1_1"], expected.outputs[1], 1e-8)
    assert_close(simulated["x"], expected.outputs[0], 1e-8)
    assert_close(simulated["state.theta_dot_1_2"], expected.states[5], 1e-8)


@EVERY_SCENE
@needs_a_compiler
def test_the_binary_holds_the_tables_poles(scene: str, tmp_path: Path) -> None:
    """Unit vectors through one step give the columns of the transition matrix."""
    model = model_of(scene)
    columns = []
    with instance(tmp_path, model) as slave:
        for k in references(model, "start"):
            slave.reset()
            slave.setReal([k], [1.0])
            slave.doStep(currentCommunicationPoint=0.0, communicationStepSize=DT)
            columns.append(slave.getReal(references(model, "state")))
    assert_poles(np.array(columns).T, load(scene), DT)


@needs_a_compiler
def test_a_discrete_model_takes_whole_steps_only(tmp_path: Path) -> None:
    model = model_of("crane-hook", DT)
    inputs = np.repeat(held_inputs(model, 20), 3, axis=1)
    expected = control.forced_response(to_control(model), np.arange(60) * DT, inputs).outputs[:, ::3]
    with instance(tmp_path, model) as slave:
        assert_close(stepped(slave, model, inputs[:, ::3], 3 * DT), expected, 1e-11)
        for h in (DT / 2, 1.5 * DT):
            with pytest.raises(fmpy.fmi1.FMICallException):
                slave.doStep(currentCommunicationPoint=0.6, communicationStepSize=h)


@needs_a_compiler
def test_what_the_slave_refuses(tmp_path: Path) -> None:
    model = model_of("chain-3")
    inner, outer, start = (references(model, role)[0] for role in ("state", "output", "start"))
    with instance(tmp_path, model) as slave:
        refused = (
            lambda: slave.setReal([inner], [1.0]),
            lambda: slave.setReal([start], [1.0]),
            lambda: slave.setReal([outer], [1.0]),
            lambda: slave.getReal([len(variables(model))]),
            lambda: slave.getInteger([0]),
            lambda: slave.doStep(currentCommunicationPoint=0.0, communicationStepSize=-DT),
            lambda: slave.doStep(currentCommunicationPoint=0.0, communicationStepSize=float("nan")),
        )
        for call in refused:
            with pytest.raises(fmpy.fmi1.FMICallException):
                call()
        slave.reset()
        slave.setReal([start], [1.0])
        assert slave.getReal([inner, start]) == [1.0, 1.0]


@needs_a_compiler
def test_a_slave_goes_back_to_a_kept_state(tmp_path: Path) -> None:
    model = model_of("crane-hook")
    inputs = held_inputs(model, 30)
    with instance(tmp_path, model) as slave:
        stepped(slave, model, inputs, DT)
        kept = slave.getFMUState()
        content = slave.serializeFMUState(kept)
        first = stepped(slave, model, inputs, DT)
        slave.setFMUState(kept)
        second = stepped(slave, model, inputs, DT)
        slave.freeFMUState(kept)
        slave.setFMUState(slave.deserializeFMUState(content))
        third = stepped(slave, model, inputs, DT)
        slave.reset()
        fresh = stepped(slave, model, inputs, DT)
    np.testing.assert_array_equal(first, second)
    np.testing.assert_array_equal(first, third)
    assert np.abs(first - fresh).max() > 1e-6


@needs_a_compiler
def test_another_models_guid_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path, fmu.write_fmu(model_of("chain-3")))
    description = fmpy.read_model_description(path)
    description.guid = "{another}"
    with pytest.raises(Exception, match="instantiate"):
        fmpy.instantiate_fmu(fmpy.extract(path, str(tmp_path / "unzipped")), description, "CoSimulation")


def test_the_guid_follows_the_model(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fmu, "which", lambda command: None)

    def guid(model: StateSpace, step: float = DT) -> str:
        return str(fmpy.read_model_description(BytesIO(fmu.write_fmu(model, step))).guid)

    model = model_of("chain-3")
    other = replace(model, A=model.A * np.nextafter(1.0, 2.0))
    guids = [guid(model), guid(other), guid(model, 0.02), guid(replace(model, title="another"))]
    assert guids[0] == guid(model)
    assert len(set(guids)) == len(guids)


@BOTH
def test_without_a_compiler_the_source_compiles_elsewhere(
    dt: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = model_of("crane-hook", dt)
    monkeypatch.setattr(fmu, "which", lambda command: None)
    content = FORMATS["fmu"].write(model)
    assert "no binary" in FORMATS["fmu"].note(content)
    with ZipFile(BytesIO(content)) as archive:
        assert archive.namelist() == ["modelDescription.xml", "sources/linear_fmu.c", "sources/model.h"]
        archive.extractall(tmp_path)
    (build,) = fmpy.read_model_description(BytesIO(content)).buildConfigurations
    assert build.sourceFileSets[0].sourceFiles == ["linear_fmu.c"]
    command = shutil.which("cc") or shutil.which("gcc")
    if command is None:
        pytest.skip("no C compiler is installed")
    ran = subprocess.run(
        [command, *STRICT, "-DFMI2_FUNCTION_PREFIX=crane_", "linear_fmu.c", "-o", str(tmp_path / "crane.so")],
        cwd=tmp_path / "sources",
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.returncode == 0, ran.stderr
    library = ctypes.CDLL(str(tmp_path / "crane.so"))
    library.crane_fmi2GetVersion.restype = ctypes.c_char_p
    assert library.crane_fmi2GetVersion() == b"2.0"


def test_a_broken_compiler_leaves_the_source(monkeypatch: pytest.MonkeyPatch) -> None:
    for command in (shutil.which("false"), "/nowhere/cc"):
        monkeypatch.setattr(fmu, "which", lambda name, command=command: command)
        text = fmu.note(fmu.write_fmu(model_of("chain-3")))
        assert "64-bit Linux" in text
        assert "64-bit Windows" in text


@needs_a_compiler
def test_with_compilers_there_is_nothing_to_tell(tmp_path: Path) -> None:
    """The library for Windows has the functions of the one for Linux; without a cross compiler a note says so."""
    model, cross = model_of("chain-3"), shutil.which(fmu.CROSS_COMPILER)
    content = FORMATS["fmu"].write(model)
    assert ("no binary for 64-bit Windows" in FORMATS["fmu"].note(content)) == (cross is None)
    name = identifier(model.title)
    with ZipFile(BytesIO(content)) as archive:
        shared = archive.read(f"binaries/linux64/{name}.so")
        assert shared.startswith(b"\x7fELF")
        if cross is None:
            return
        library = archive.read(f"binaries/win64/{name}.dll")
    assert library.startswith(b"MZ")
    functions = set(re.findall(rb"fmi2[A-Z]\w+", shared))
    assert len(functions) > 30
    assert set(re.findall(rb"fmi2[A-Z]\w+", library)) == functions


@needs_a_compiler
def test_many_links(tmp_path: Path) -> None:
    """Torques at every joint, a hundred states or more: half default steps, so that the series is used."""
    from modal import Bob, Pendulum, Scene

    scene = Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0, count=usually(50, 200))])])
    model = state_space(scene)
    inputs = held_inputs(model, 5)
    with instance(tmp_path, model) as slave:
        outputs = stepped(slave, model, inputs, DT / 2)
    expected = control.forced_response(to_control(sample(model, DT / 2)), np.arange(5) * DT / 2, inputs).outputs
    assert_close(outputs, expected, 1e-8)


def test_a_step_must_be_positive() -> None:
    with pytest.raises(SceneError, match="must be a positive number of seconds"):
        fmu.write_fmu(model_of("chain-3"), 0.0)


def test_matrices_in_the_source_are_the_models(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fmu, "which", lambda command: None)
    model = model_of("crane-hook")
    with ZipFile(BytesIO(fmu.write_fmu(model))) as archive:
        text = archive.read("sources/model.h").decode()
    matrices = []
    for name, matrix in zip("ABCD", (model.A, model.B, model.C, model.D), strict=True):
        block = text.partition(f"double {name}[")[2].partition("= {")[2].partition("};")[0]
        assert "[" not in block
        numbers = block.replace("{", " ").replace("}", " ").replace(",", " ").split()
        matrices.append(np.array(list(map(float.fromhex, numbers))).reshape(matrix.shape))
    assert_matrices(model, matrices)
    assert_poles(matrices[0], load("crane-hook"))


def test_units_outside_the_grammar_are_left_out() -> None:
    """Modal coordinates have units with roots, which neither Modelica nor FMI can write."""
    from modal.exports.source import write_modelica
    from modal.statespace import truncate

    scene = load("crane-hook")
    model = truncate(natural_modes(scene), state_space(scene), 1)
    assert any("(" in state.unit for state in model.states)
    assert "kg(" not in write_modelica(model).decode()
    with ZipFile(BytesIO(FORMATS["fmu"].write(model))) as packed:
        assert b"kg(" not in packed.read("modelDescription.xml")


def test_inputs_are_held_and_the_description_says_so(tmp_path: Path) -> None:
    """A ramp handed over in steps of h gives the answer to stairs: exactly that of the model sampled with h."""
    model, h = model_of("crane-hook"), 0.05
    with ZipFile(BytesIO(fmu.write_fmu(model))) as archive:
        about = archive.read("modelDescription.xml").decode()
    assert "inputs are held" in about
    assert 'canInterpolateInputs="false"' in about
    ramp = np.outer(np.ones(len(model.inputs)), np.arange(40) * h)
    held = sample(model, h)
    z, stairs = np.zeros(len(held.A)), []
    for u in ramp.T:
        stairs.append(held.C @ z + held.D @ u)
        z = held.A @ z + held.B @ u
    with instance(tmp_path, model) as slave:
        outputs = stepped(slave, model, ramp, h)
    assert_close(outputs, np.array(stairs).T, 1e-9)
