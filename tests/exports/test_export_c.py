"""The C header compiled, run and held against python-control."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import control
import numpy as np
import pytest
from exported import DT, SCENES, assert_close, assert_matrices, assert_poles, held_inputs, model_of, names
from numpy.typing import NDArray

from modal import Bob, Pendulum, Scene, SceneError, load
from modal.exports import FORMATS
from modal.exports.scripts import to_control
from modal.exports.source import c_matrix, write_c
from modal.exports.text import identifier
from modal.report import c_comment
from modal.statespace import Signal, StateSpace, state_space
from modal.statespace.sampling import sample

STRICT = ("-Wall", "-Wextra", "-Werror", "-pedantic")
CPP = ("c++", "g++", "clang++")
STEPS = 400
MAIN = """\
#include <stdio.h>
#include "model.h"
#include "model.h"

static void show(const double *values, int n)
{{
    int i;
    for (i = 0; i < n; i++) printf("%.17g%c", values[i], i + 1 < n ? ' ' : '\\n');
}}

int main(void)
{{
    double z[{n}] = {{0.0}}, u[{m}], y[{p}];
    int k = 0;
    show(&{name}_A[0][0], {n} * {n});
    show(&{name}_B[0][0], {n} * {m});
    show(&{name}_C[0][0], {p} * {n});
    show(&{name}_D[0][0], {p} * {m});
    while (scanf("%lf", &u[k]) == 1) {{
        if (++k < {m}) continue;
        {name}_step(z, u, y);
        show(y, {p});
        k = 0;
    }}
    return !({NAME}_STATES == {n} && {NAME}_INPUTS == {m} && {NAME}_OUTPUTS == {p} && {NAME}_DT == {dt!r});
}}
"""


def compiled(folder: Path, header: bytes, main: str, compilers: Sequence[str] = ("cc", "gcc")) -> Path:
    compiler = next(filter(None, map(shutil.which, compilers)), None)
    if compiler is None:
        pytest.skip(f"no compiler is installed: {', '.join(compilers)}")
    language, source = ("c++14", "main.cpp") if compilers is CPP else ("c99", "main.c")
    (folder / "model.h").write_bytes(header)
    (folder / source).write_text(main)
    command = [compiler, f"-std={language}", *STRICT, source, "-o", "main"]
    ran = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr
    return folder / "main"


def run(
    folder: Path, model: StateSpace, inputs: NDArray[np.float64], compilers: Sequence[str] = ("cc", "gcc")
) -> tuple[list[NDArray[np.float64]], NDArray[np.float64]]:
    """The matrices that a C program sees and the outputs that it computes."""
    name = identifier(model.title).lower()
    (n, m), p = model.B.shape, len(model.C)
    main = MAIN.format(n=n, m=m, p=p, name=name, NAME=name.upper(), dt=model.dt)
    program = compiled(folder, write_c(model), main, compilers)
    text = "\n".join(" ".join(map(repr, row)) for row in inputs.T.tolist())
    lines = subprocess.run([program], input=text, capture_output=True, text=True, check=True).stdout.splitlines()
    shapes = (n, n), (n, m), (p, n), (p, m)
    matrices = [np.array(line.split(), dtype=float).reshape(shape) for line, shape in zip(lines, shapes, strict=False)]
    return matrices, np.array([line.split() for line in lines[4:]], dtype=float).T


@pytest.mark.parametrize("scene", SCENES)
def test_a_c_program_steps_as_control_does(scene: str, tmp_path: Path) -> None:
    model = model_of(scene, DT)
    inputs = held_inputs(model, STEPS)
    matrices, outputs = run(tmp_path, model, inputs)
    assert_matrices(model, matrices)
    assert_poles(matrices[0], load(scene), DT)
    expected = control.forced_response(to_control(model), np.arange(STEPS) * DT, inputs).outputs
    assert outputs.shape == expected.shape == (len(model.outputs), STEPS)
    assert_close(outputs, expected, 1e-10)


@pytest.mark.parametrize("scene", ["crane-hook", "many"])
def test_a_program_in_cpp_does_the_same(scene: str, tmp_path: Path) -> None:
    """Twelve pendula too, whose sampled matrices of tip positions are mostly zeros."""
    if scene == "many":
        many = load("crane-hook").replace(pendulum=[p.replace(count=12) for p in load("crane-hook").pendulum])
        model = sample(state_space(many, outputs=("tip_positions",)), DT)
        assert np.count_nonzero(model.C) < model.C.size / 8
    else:
        model = model_of(scene, DT)
    inputs = held_inputs(model, 50)
    matrices, outputs = run(tmp_path, model, inputs, CPP)
    assert_matrices(model, matrices)
    assert outputs.tolist() == run(tmp_path, model, inputs)[1].tolist()


def test_two_titles_without_letters_go_into_one_program(tmp_path: Path) -> None:
    titles = ("振り子", "時計", "∀ 2", "∃ 2", "2", "", "!")
    headers = [write_c(replace(model_of("chain-3", DT), title=title)) for title in titles]
    functions = [re.search(rb"(\w+)_step\(", header)[1] for header in headers]  # type: ignore[index]
    assert len(set(functions)) == len(titles)
    for number, header in enumerate(headers):
        (tmp_path / f"model{number}.h").write_bytes(header)
    included = "".join(f'#include "model{number}.h"\n' for number in range(len(headers)))
    compiled(tmp_path, headers[0], f"{included}int main(void) {{ return 0; }}\n")


def test_every_signal_has_its_place_by_name(tmp_path: Path) -> None:
    model = model_of("crane-hook", DT)
    name = identifier(model.title).upper()
    words = [
        f"{name}_{kind}_{word}"
        for kind, signals in (("STATE", model.states), ("INPUT", model.inputs), ("OUTPUT", model.outputs))
        for word in names(signals)
    ]
    lines = "".join(f'printf("%d ", {word});' for word in words)
    program = compiled(
        tmp_path, write_c(model), f'#include <stdio.h>\n#include "model.h"\nint main(void){{{lines}return 0;}}'
    )
    printed = subprocess.run([program], capture_output=True, text=True, check=True).stdout.split()
    sizes = len(model.states), len(model.inputs), len(model.outputs)
    assert [int(word) for word in printed] == [k for size in sizes for k in range(size)]


def test_the_header_needs_nothing_and_may_stay_unused(tmp_path: Path) -> None:
    header = write_c(model_of("chain-3", DT))
    assert b"#include" not in header
    assert b"alloc" not in header
    compiled(tmp_path, header, '#include "model.h"\nint main(void) { return 0; }\n')


@pytest.mark.parametrize("sizes", [(0, 0, 0), (0, 2, 3), (2, 0, 1), (3, 2, 0)])
def test_empty_sides_compile(sizes: tuple[int, int, int], tmp_path: Path) -> None:
    n, m, p = sizes
    rng = np.random.default_rng(2)
    signals = [tuple(Signal(f"s{k}", "m", "one") for k in range(size)) for size in sizes]
    parts = [rng.normal(size=shape) for shape in ((n, n), (n, m), (p, n), (p, m))]
    model = StateSpace(*parts, *signals, dt=1.0)  # type: ignore[arg-type]
    main = f"double at[1 + (PENDULA_STATES == {n})];\nint main(void) {{ at[1] = 0.0; return 0; }}\n"
    compiled(tmp_path, write_c(model), f'#include "model.h"\n{main}')


def test_names_and_titles_that_c_would_not_like(tmp_path: Path) -> None:
    model = model_of("chain-3", DT)
    odd = tuple(Signal(word, "*/", "/* //") for word in ("int", "int", "1 x", "größe", "", "a.b"))
    model = replace(model, states=odd, title='*/ #error "x" \\\n/* 2 int')
    inputs = held_inputs(model, 3)
    matrices, _ = run(tmp_path, model, inputs)
    assert_matrices(model, matrices)
    listed = re.findall(r"_STATE_(\w+),", write_c(model).decode())
    assert listed == ["int", "int_2", "n_1_x", "gro_e", "signal", "a_b"]


def test_a_continuous_model_is_refused() -> None:
    with pytest.raises(SceneError, match=r"`format=c` needs `sample"):
        FORMATS["c"].write(model_of("chain-3"))


def test_comments_and_matrices() -> None:
    assert c_comment("a */ b /* c") == "/* a * / b / * c */"
    assert "\n".join(c_matrix("M", np.array([[0.1, -0.0]]))) == "static const double M[1][2] = {\n    {0.1, 0.0},\n};"
    assert "\n".join(c_matrix("M", np.zeros((0, 3)))) == "static const double M[1][3] = {\n    {0.0}\n};"
    sparse = np.zeros((2, 12))
    sparse[1, 3] = 2.5
    assert list(c_matrix("M", sparse, by_place=True))[1:3] == ["    {0.0},", "    {[3] = 2.5},"]


def test_long_rows_of_zeros_compile_to_the_same_matrix(tmp_path: Path) -> None:
    links = Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0, count=12)])])
    model = sample(state_space(links, ("joint_torques",), ("angles", "tip_positions", "pivot_forces")), DT)
    assert b"[11] =" not in write_c(replace(model, title="t"))
    matrices, _ = run(tmp_path, replace(model, title="t"), held_inputs(model, 2))
    assert_matrices(model, matrices)
