"""Every file format read back by a client of its own."""

from __future__ import annotations

import csv
import io
import json
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import control
import mpmath as mp
import numpy as np
import pytest
import scipy.io
import scipy.signal
from exported import (
    DT,
    SCENES,
    assert_close,
    assert_matrices,
    assert_poles,
    assert_spectrum,
    held_inputs,
    model_of,
    names,
)

from modal import Bob, Cart, ComputationError, Pendulum, Scene, SceneError, load
from modal.exports import FORMATS, find_format
from modal.exports.data import read_json, read_npz, write_json, write_npz
from modal.exports.scripts import to_control, to_scipy, write_mat
from modal.exports.source import public_names
from modal.exports.text import IDENTIFIER_LETTERS, identifier, identifiers
from modal.statespace import Signal, StateSpace, state_space
from modal.statespace.sampling import METHODS, reach, sample

BOTH = pytest.mark.parametrize("dt", [0.0, DT], ids=["continuous", "discrete"])
EVERY_SCENE = pytest.mark.parametrize("scene", SCENES)
EVIL = 'Größe */ /* "2" \\ \'x\' %d \n{"a": 1}; end <&> ∀'
EQUAL_LOADS = Scene(
    gravity=9.81,
    support=Cart(mass=3.0),
    pendulum=[Pendulum(links=[Bob(mass=1.0, length=2.0)], count=3)],
)


def empty(n: int, m: int, p: int) -> StateSpace:
    """Random matrices of any sizes, nought included."""
    rng = np.random.default_rng(1)
    A, B, C, D = (rng.normal(size=shape) for shape in ((n, n), (n, m), (p, n), (p, m)))
    states, inputs, outputs = (
        tuple(Signal(f"{letter}{k}", "m", "of a kind") for k in range(size))
        for letter, size in zip("xuy", (n, m, p), strict=True)
    )
    return StateSpace(A, B, C, D, states, inputs, outputs, dt=0.5)


def everything(model: StateSpace) -> tuple[Any, ...]:
    return model.states, model.inputs, model.outputs, model.dt, model.title, model.operating_point


# ------------------------------------------------------------------------------------------------------- the formats


@EVERY_SCENE
@BOTH
def test_json_and_npz_give_back_an_equal_model(scene: str, dt: float) -> None:
    model = model_of(scene, dt)
    for restored in (read_json(write_json(model)), read_npz(write_npz(model))):
        assert_matrices(model, (restored.A, restored.B, restored.C, restored.D))
        assert everything(restored) == everything(model)
        assert_poles(restored.A, load(scene), dt)


@EVERY_SCENE
def test_json_is_plain_json_for_any_client(scene: str) -> None:
    model = model_of(scene)
    data = json.loads(FORMATS["json"].write(model))
    assert_matrices(model, [np.array(data[name]) for name in "ABCD"])
    assert [state["name"] for state in data["states"]] == names(model.states)
    assert data["outputs"][0] == model.outputs[0]._asdict()


@EVERY_SCENE
@BOTH
def test_control_by_object_and_by_script(scene: str, dt: float) -> None:
    model = model_of(scene, dt)
    space: dict[str, Any] = {}
    exec(compile(FORMATS["control"].write(model), "model.py", "exec"), space)
    for system in (to_control(model), space["system"]):
        assert isinstance(system, control.StateSpace)
        assert_matrices(model, (system.A, system.B, system.C, system.D))
        assert system.dt == dt
        assert system.isctime(strict=True) == (dt == 0)
        assert system.state_labels == names(model.states)
        assert system.input_labels == names(model.inputs)
        assert system.output_labels == names(model.outputs)
        assert system.name == identifier(model.title)
        assert_poles(system.A, load(scene), dt)


def test_control_finds_a_signal_by_its_name() -> None:
    system = to_control(state_space(load("crane-hook")))
    part = system["theta_1_2", "cart_force"]
    w = 0.5
    np.testing.assert_allclose(part(1j * w), system(1j * w)[2, 0], rtol=1e-13)


@EVERY_SCENE
@BOTH
def test_scipy(scene: str, dt: float) -> None:
    model = model_of(scene, dt)
    system = to_scipy(model)
    assert isinstance(system, scipy.signal.dlti if dt else scipy.signal.lti)
    assert_matrices(model, (system.A, system.B, system.C, system.D))
    assert system.dt == (dt or None)


@EVERY_SCENE
@BOTH
def test_mat(scene: str, dt: float) -> None:
    model = model_of(scene, dt)
    data = scipy.io.loadmat(io.BytesIO(FORMATS["mat"].write(model)), squeeze_me=False)
    assert_matrices(model, [data[name] for name in "ABCD"])
    assert (data["dt"].item(), data["title"].item()) == (dt, model.title)
    for kind, signals in (("state", model.states), ("input", model.inputs), ("output", model.outputs)):
        cells = [data[f"{kind}_{field}s"] for field in ("name", "unit", "meaning")]
        assert cells[0].shape == (len(signals), 1)
        assert [tuple(c.item() for c in row) for row in zip(*(cell[:, 0] for cell in cells), strict=True)] == [*signals]
    point = data["operating_point"][0, 0]
    kept = zip((cell.item() for cell in point["names"][:, 0]), point["values"][:, 0], strict=True)
    assert tuple(kept) == model.operating_point
    assert_poles(data["A"], load(scene), dt)


@EVERY_SCENE
@BOTH
def test_csv(scene: str, dt: float) -> None:
    model = model_of(scene, dt)
    rows = list(csv.DictReader(io.StringIO(FORMATS["csv"].write(model).decode())))
    matrices = [np.full(matrix.shape, np.nan) for matrix in (model.A, model.B, model.C, model.D)]
    sides = {"A": (model.states,) * 2, "B": (model.states, model.inputs)}
    sides |= {"C": (model.outputs, model.states), "D": (model.outputs, model.inputs)}
    for row in rows:
        if row["matrix"] not in sides:
            continue
        at = int(row["row"]) - 1, int(row["column"]) - 1
        matrices["ABCD".index(row["matrix"])][at] = float(row["value"])
        for side, place, which in zip(sides[row["matrix"]], at, ("row", "column"), strict=True):
            assert (row[f"{which}_name"], row[f"{which}_unit"]) == side[place][:2]
    assert_matrices(model, matrices)
    assert_poles(matrices[0], load(scene), dt)
    assert [row["value"] for row in rows if row["matrix"] in {"title", "dt"}] == [model.title, repr(dt)]
    kept = [(row["row_name"], float(row["value"])) for row in rows if row["matrix"] == "operating_point"]
    assert kept == [*model.operating_point]


def literals(text: str, begin: str, end: str) -> Any:
    """The numbers between two marks, a row a line."""
    block = text.partition(begin)[2].partition(end)[0]
    return np.array([[float(x) for x in re.split(r"[\s,;]+", line.strip(" ,;"))] for line in block.strip().split("\n")])


@EVERY_SCENE
@BOTH
def test_m_script_as_text(scene: str, dt: float) -> None:
    model = model_of(scene, dt)
    text = FORMATS["m"].write(model).decode()
    assert_matrices(model, [literals(text, f"\n{name} = [\n", "\n];") for name in "ABCD"])
    assert_poles(literals(text, "\nA = [\n", "\n];"), load(scene), dt)
    assert re.findall(r"^  '(\w+)'  % ", text, re.MULTILINE) == names(model.states + model.inputs + model.outputs)
    assert f"dt = {dt!r};" in text
    assert f"ss(A, B, C, D{', dt' if dt else ''})" in text
    assert text.count("if ") - text.count("elseif ") + text.count("try\n") == len(re.findall(r"^ *end$", text, re.M))


@EVERY_SCENE
@BOTH
def test_modelica_as_text(scene: str, dt: float) -> None:
    model = model_of(scene, dt)
    text = FORMATS["modelica"].write(model).decode()
    assert_matrices(model, [literals(text, f"Real {name}[{shape}] = [\n", "];") for name, shape in shapes(model)])
    assert_poles(literals(text, f"Real A[{len(model.A)}, {len(model.A)}] = [\n", "];"), load(scene), dt)
    declared = re.findall(r"^  (?:input |output |final |parameter |discrete )*Real (\w+)", text, re.MULTILINE)
    assert len(set(declared)) == len(declared)
    assert re.findall(r"^  input Real (\w+)\(unit = \"(\S+)\"\)", text, re.MULTILINE) == [
        (s.name, s.unit.replace(" ", ".")) for s in model.inputs
    ]
    assert re.findall(r"^  output Real (\w+)", text, re.MULTILINE) == names(model.outputs)
    assert re.findall(r"^  (\w+) = y\[(\d+)\];", text, re.MULTILINE) == [
        (s.name, str(k)) for k, s in enumerate(model.outputs, 1)
    ]
    assert text.count("{") == text.count("}")
    assert (text.count("("), text.count("[")) == (text.count(")"), text.count("]"))
    assert re.match(r"block (\w+) ", text)[1] == re.search(r"\nend (\w+);\n$", text)[1]  # type: ignore[index]
    assert ("der(state." in text, "sample(0.0, 0.01)" in text) == (dt == 0, dt > 0)


HARNESS = """
model Harness
  {block} unit({start} = 0.1);
equation
{inputs}
end Harness;
"""
"""Inputs that are 0.3, 0.6, … from the beginning, and a state that starts at 0.1."""


@EVERY_SCENE
@BOTH
def test_a_modelica_compiler_moves_the_block_as_control_does(scene: str, dt: float) -> None:
    rumoca = pytest.importorskip("rumoca", reason="the Modelica compiler rumoca is not installed")
    model = model_of(scene, 0.5 if dt else 0.0)
    words = public_names(model)
    inputs = "\n".join(f"  unit.{word} = {0.3 * k!r};" for k, word in enumerate(words.inputs, 1))
    harness = HARNESS.format(block=words.block, start=words.starts[0], inputs=inputs)
    compiled = rumoca.Session().loads(FORMATS["modelica"].write(model).decode() + harness, model="Harness")
    config = rumoca.SimConfig(rtol=1e-10, atol=1e-12)
    columns = compiled.simulate(t=(0.0, 2.0), dt=0.5, config=config).to_dict()
    times = np.arange(5) * 0.5
    last = np.searchsorted(columns["time"], times + 1e-6) - 1  # after events, of which a time has two values
    z0 = np.eye(len(model.A))[0] * 0.1
    u = np.array([[0.3 * k] * 5 for k in range(1, len(model.inputs) + 1)])
    expected = control.forced_response(to_control(model), times, u, z0).outputs
    outputs = np.array([columns["data"][f"unit.{word}"][last] for word in words.outputs])
    assert np.abs(outputs - expected).max() < 1e-6 * np.abs(expected).max()


def shapes(model: StateSpace) -> list[tuple[str, str]]:
    pairs = zip("ABCD", (model.A, model.B, model.C, model.D), strict=True)
    return [(name, f"{matrix.shape[0]}, {matrix.shape[1]}") for name, matrix in pairs]


OCTAVE = """
pkg load control
function show(label, x)
  printf("%s", label);
  printf(" %.17g", [real(x(:)), imag(x(:))].');
  printf("\\n");
end
load model.mat
show("mat", eig(A));
printf("names"); printf(" %s", state_names{:}, input_names{:}, output_names{:}); printf("\\n");
clear -variables
model_script
show("m", eig(sys.a));
printf("names"); printf(" %s", get(sys, "stname"){:}, get(sys, "inname"){:}, get(sys, "outname"){:}); printf("\\n");
show("dt", get(sys, "tsam"));
show("bode", freqresp(sys, 0.5));
if (dt == 0)
  try
    show("lqr", lqr(sys, eye(rows(A)), eye(columns(B))));
  catch
    disp("lqr-refused");
  end
end
disp("end");
"""


@EVERY_SCENE
@BOTH
def test_octave_loads_both(scene: str, dt: float, tmp_path: Path) -> None:
    model = model_of(scene, dt)
    (tmp_path / "model.mat").write_bytes(FORMATS["mat"].write(model))
    (tmp_path / "model_script.m").write_bytes(FORMATS["m"].write(model))
    shown = octave(tmp_path)
    for kind in ("mat", "m"):
        assert_spectrum(shown[kind][0], load(scene), dt, 1e-10)
    every = names(model.states + model.inputs + model.outputs)
    assert shown["names"] == [every, every]
    assert shown["dt"][0] == [dt]
    system = to_control(model)
    response = system(np.exp(0.5j * dt) if dt else 0.5j).flatten(order="F")
    assert_close(shown["bode"][0], response, 1e-10)
    if scene in {"chain-3", "crane-hook", "crane-two-loads", "cart-upright"} and not dt:
        gain = control.lqr(system, np.eye(len(model.A)), np.eye(len(model.inputs)))[0].flatten(order="F")
        assert_close(shown["lqr"][0], gain, 1e-10 if scene == "chain-3" else 1e-8)


def octave(folder: Path) -> dict[str, list[Any]]:
    """What OCTAVE prints, line by line under its labels: names, or complex numbers."""
    command = shutil.which("octave-cli") or shutil.which("octave")
    if command is None:
        pytest.skip("Octave is not installed")
    if subprocess.run([command, "--eval", "pkg load control"], capture_output=True, check=False).returncode:
        pytest.skip("Octave is here without its control package")
    (folder / "main.m").write_text(OCTAVE)
    ran = subprocess.run([command, "--quiet", "main.m"], cwd=folder, capture_output=True, text=True, check=False)
    assert ran.stdout.rstrip().endswith("end"), ran.stderr
    shown: dict[str, list[Any]] = {}
    for label, *words in map(str.split, ran.stdout.splitlines()):
        numbers = [] if label == "names" else list(map(float, words))
        pairs = [complex(*pair) for pair in zip(numbers[::2], numbers[1::2], strict=True)]
        shown.setdefault(label, []).append(words if label == "names" else pairs)
    return shown


# ----------------------------------------------------------------------------------------------------- sampling


@EVERY_SCENE
@pytest.mark.parametrize(("method", "theirs"), [("zoh", "zoh"), ("foh", "foh"), ("tustin", "bilinear")])
@pytest.mark.parametrize("dt", [0.002, 0.05])
def test_sampling_beside_scipy(scene: str, method: str, theirs: str, dt: float) -> None:
    model = model_of(scene)
    sampled = sample(model, dt, method)
    expected = scipy.signal.cont2discrete((model.A, model.B, model.C, model.D), dt, theirs)[:4]
    for mine, other in zip((sampled.A, sampled.B, sampled.C, sampled.D), expected, strict=True):
        np.testing.assert_allclose(mine, other, rtol=1e-11, atol=1e-13 * abs(other).max())
    assert sampled.dt == dt
    assert everything(replace(sampled, dt=0.0)) == everything(model)


@EVERY_SCENE
def test_sampling_to_many_digits(scene: str) -> None:
    """Every entry of the zero-order hold against 50 digits of the exponential series."""
    model = model_of(scene)
    n, m = model.B.shape
    with mp.workdps(50):
        whole = mp.zeros(n + m)
        whole[:n, :n], whole[:n, n:] = mp.matrix(model.A.tolist()), mp.matrix(model.B.tolist())
        exact = np.array(mp.expm(whole * mp.mpf(DT)).tolist(), dtype=float)
    sampled = sample(model, DT)
    np.testing.assert_allclose(sampled.A, exact[:n, :n], rtol=1e-13, atol=1e-18)
    np.testing.assert_allclose(sampled.B, exact[:n, n:], rtol=1e-13, atol=1e-18)


@EVERY_SCENE
def test_a_held_input_as_control_integrates_it(scene: str) -> None:
    model = model_of(scene)
    times = np.arange(200) * DT
    constant = np.ones((len(model.inputs), len(times)))
    expected = control.forced_response(to_control(model), times, constant)
    response = control.forced_response(to_control(sample(model, DT)), times, constant)
    assert_close(response.outputs, expected.outputs, 1e-9)


@EVERY_SCENE
def test_a_first_order_hold_follows_lines_exactly(scene: str) -> None:
    model = model_of(scene)
    times = np.arange(200) * DT
    inputs = held_inputs(model, 200)
    inputs[:, 0] = 0.0
    expected = control.forced_response(to_control(model), times, inputs)
    response = control.forced_response(to_control(sample(model, DT, "foh")), times, inputs)
    assert_close(response.outputs, expected.outputs, 1e-9)


def test_tustin_is_the_bilinear_map_of_the_transfer_function() -> None:
    model = model_of("crane-hook")
    sampled = to_control(sample(model, DT, "tustin"))
    point = np.exp(1j * 0.7 * DT)
    np.testing.assert_allclose(sampled(point), to_control(model)(2 / DT * (point - 1) / (point + 1)), rtol=1e-9)


def test_repeated_and_zero_modes_do_not_disturb_sampling() -> None:
    model = state_space(EQUAL_LOADS, ("cart_force",))
    once, twice = sample(model, 0.125), sample(model, 0.25)
    np.testing.assert_allclose(once.A @ once.A, twice.A, rtol=1e-13, atol=1e-15)
    np.testing.assert_allclose(once.A @ once.B + once.B, twice.B, rtol=1e-13, atol=1e-17)
    assert_poles(once.A, EQUAL_LOADS, 0.125)
    rigid = np.zeros(len(model.A))
    rigid[len(rigid) // 2] = 1.0
    expected = rigid.copy()
    expected[0] = 0.125
    np.testing.assert_allclose(once.A @ rigid, expected, rtol=1e-15, atol=0)


def test_sampling_does_not_depend_on_the_units() -> None:
    """In kilometres and tonnes the same model, scaled: no digit is lost to large and small numbers together."""
    model = state_space(load("metronomes"), ("cart_force",))
    scale = np.array([2.0**-40, 1, 1, 2.0**-40, 1, 1])
    sampled = sample(
        replace(model, A=scale[:, None] * model.A / scale, B=scale[:, None] * model.B, C=model.C / scale), DT
    )
    expected = sample(model, DT)
    np.testing.assert_allclose(sampled.A, scale[:, None] * expected.A / scale, rtol=1e-13, atol=0)
    np.testing.assert_allclose(sampled.B, scale[:, None] * expected.B, rtol=1e-13, atol=0)


@pytest.mark.parametrize("dt", [0.0, -1.0, np.nan, np.inf])
def test_a_step_must_be_positive(dt: float) -> None:
    with pytest.raises(SceneError, match=rf"step {dt}.*: must be a (positive|finite) number"):
        sample(model_of("chain-3"), dt)


def test_what_sampling_refuses() -> None:
    with pytest.raises(SceneError, match=r"already discrete, with a step of 0\.01 s"):
        sample(model_of("chain-3", DT), DT)
    with pytest.raises(SceneError, match="method euler: must be one of zoh, foh, tustin"):
        sample(model_of("chain-3"), DT, "euler")
    with pytest.raises(ComputationError, match="overflows"):
        sample(model_of("cart-upright"), 1e3)


def test_reach_bounds_every_pole() -> None:
    for scene in SCENES:
        model = model_of(scene)
        assert abs(np.linalg.eigvals(model.A)).max() <= reach(model.A) < 100
    assert reach(np.zeros((0, 0))) == 0.0


# ------------------------------------------------------------------------------------------------ all of them


def test_an_unknown_format_lists_the_others() -> None:
    with pytest.raises(
        SceneError, match="format word: must be one of control, mat, m, json, npz, tf, csv, c, fmu, modelica"
    ):
        find_format("word")
    assert find_format("mat").extension == ".mat"
    assert len({form.extension for form in FORMATS.values()}) == len(FORMATS)


def test_the_table_of_formats_loads_none_of_them() -> None:
    code = "import sys, modal.exports; print([m for m in sys.modules if m in {'scipy', 'control'} or 'exports.' in m])"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout.strip() == "[]"


@pytest.mark.parametrize("name", [name for name in FORMATS if name not in {"fmu", "tf"}])
def test_the_same_model_gives_the_same_bytes(name: str) -> None:
    model = model_of("crane-hook", DT)
    assert FORMATS[name].write(model) == FORMATS[name].write(model)


@pytest.mark.parametrize("name", [name for name in FORMATS if name != "tf"])
def test_long_chains_in_every_format(name: str) -> None:
    scene = Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0, count=30)])])
    model = state_space(scene, ("joint_torques",), ("angles",))
    assert model.A.shape == (60, 60)
    content = FORMATS[name].write(sample(model, DT) if name == "c" else model)
    assert len(content) > 20_000


@pytest.mark.parametrize("size", [(0, 0, 0), (0, 2, 3), (2, 0, 3), (3, 2, 0), (1, 1, 1)])
def test_empty_sides(size: tuple[int, int, int]) -> None:
    model = empty(*size)
    for restored in (read_json(write_json(model)), read_npz(write_npz(model))):
        assert_matrices(model, (restored.A, restored.B, restored.C, restored.D))
        assert everything(restored) == everything(model)
    assert scipy.io.loadmat(io.BytesIO(write_mat(model)))["D"].shape == (size[2], size[1])
    assert all(form.write(model) for name, form in FORMATS.items() if name != "tf")


def test_a_title_breaks_out_of_no_comment() -> None:
    model = replace(model_of("chain-3", DT), title=EVIL)
    for restored in (read_json(write_json(model)), read_npz(write_npz(model))):
        assert restored.title == EVIL
    space: dict[str, Any] = {}
    exec(compile(FORMATS["control"].write(model), "model.py", "exec"), space)
    assert space["system"].name == identifier(EVIL)
    assert FORMATS["modelica"].write(model).decode().startswith(f'block {identifier(EVIL)} "Größe */ /* \\"2\\" \\\\ ')
    assert FORMATS["m"].write(model).decode().splitlines()[1].startswith("% z[k+1]")
    loaded = scipy.io.loadmat(io.BytesIO(write_mat(model)))
    assert loaded["title"].item().isascii()
    assert loaded["title_utf8"].tobytes().decode() == EVIL


# ---------------------------------------------------------------------------------------------------- the helpers


def test_identifiers_are_valid_and_unique() -> None:
    words = ["a b", "a_b", "2", "", "é", "a-b", "x" * 99, "x" * 98]
    names = identifiers(words, keywords=["e"])
    assert names == (
        "a_b",
        "a_b_2",
        "n_2",
        "signal",
        "e_2",
        "a_b_3",
        "x" * IDENTIFIER_LETTERS,
        "x" * IDENTIFIER_LETTERS + "_2",
    )
    assert all(word.isidentifier() and word.isascii() for word in names)


def test_a_long_title_ends_with_a_word() -> None:
    title = "Crane trolley with a hook and a load"
    assert identifier(title) == title.replace(" ", "_")
    words = identifier(" ".join(["swing"] * 20)).split("_")
    assert set(words) == {"swing"}
    assert len("_".join(words)) <= IDENTIFIER_LETTERS


def test_modelica_keywords_and_our_own_names_are_avoided() -> None:
    model = replace(empty(1, 2, 2), inputs=(Signal("u", "N", ""), Signal("when", "N", "")), title="model")
    text = FORMATS["modelica"].write(model).decode()
    assert "input Real u_2(" in text
    assert "input Real when_2(" in text
    assert text.startswith("block model_2 ")


def test_the_checks_bite() -> None:
    model, scene = model_of("crane-hook"), load("crane-hook")
    wrong = model.A.copy()
    wrong[4, 2] *= 1 + 1e-11
    with pytest.raises(AssertionError):
        assert_poles(wrong, scene)
    with pytest.raises(AssertionError):
        assert_poles(sample(model, DT).A, scene)
    with pytest.raises(AssertionError, match="left over"):
        assert_poles(np.diag([*np.linalg.eigvals(model.A), 1.0]), scene)
    wrong[4, 2] = np.nextafter(model.A[4, 2], 9)
    with pytest.raises(AssertionError):
        assert_matrices(model, (wrong, model.B, model.C, model.D))
    with pytest.raises(AssertionError):
        assert_close([[1.0, 1.0 + 2e-9]], np.ones((1, 2)), 1e-9)


def test_every_method_is_tested() -> None:
    assert set(METHODS) == {"zoh", "foh", "tustin"}


def test_models_are_read_from_paths_as_from_bytes(tmp_path: Path) -> None:
    model = model_of("crane-hook", DT)
    for name, write, read in (("m.json", write_json, read_json), ("m.npz", write_npz, read_npz)):
        path = tmp_path / name
        path.write_bytes(write(model))
        for source in (path, str(path), path.read_bytes()):
            restored = read(source)
            assert (restored.A.tolist(), restored.inputs, restored.title) == (
                model.A.tolist(),
                model.inputs,
                model.title,
            )
        with pytest.raises(SceneError, match=r"not there.*: cannot be read: No such file"):
            read(tmp_path / "not there")
