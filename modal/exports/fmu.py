"""FMI 2.0 co-simulation: a zip of description, C source and, where a compiler is found, a Linux binary.

Inputs are held over every communication step, as co-simulation has it without derivatives of inputs: the answer to a
ramp lags by half a step.  Over the default step the step is exact; `linear_fmu.c` bridges any other one to rounding.
"""

from __future__ import annotations

import platform
import subprocess
import sys
from collections.abc import Iterator
from importlib.resources import files
from io import BytesIO
from pathlib import Path
from shutil import which
from tempfile import TemporaryDirectory
from uuid import NAMESPACE_URL, uuid5
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

from modal.exports.c_text import c_matrix, hexadecimal
from modal.exports.fmu_description import description
from modal.exports.identifiers import identifier
from modal.exports.text import heading, joined
from modal.report import c_comment
from modal.statespace import StateSpace
from modal.statespace.sampling import reach, sample

DEFAULT_STEP = 0.01
COMPILERS = ("cc", "gcc", "clang")
FLAGS = ("-std=c99", "-O2", "-shared", "-fPIC", "-fvisibility=hidden")
SOURCE = "linear_fmu.c"
SOURCE_ONLY = "no C compiler for 64-bit Linux here: the FMU holds C source and no binary; compile it where it will run"
LONGEST_COMPILATION = 120.0


def write_fmu(model: StateSpace, step: float = DEFAULT_STEP) -> bytes:
    """The FMU; `step` in seconds is the default communication step, that of a discrete model is its own.

    The same model gives the same source and GUID.  Raises SceneError for a step that is not positive.
    """
    name = identifier(heading(model))
    held, step = (model, model.dt) if model.dt else (sample(model, step), step)
    source, code = files("modal.exports").joinpath(SOURCE).read_bytes(), list(_matrices(model, held))
    guid = f"{{{uuid5(NAMESPACE_URL, repr((name, step, model.states, model.inputs, model.outputs, code)))}}}"
    header = joined([*_sizes(model, step, guid), *code])
    content = {
        "modelDescription.xml": description(model, step, guid, SOURCE),
        f"sources/{SOURCE}": source,
        "sources/model.h": header,
    }
    if binary := _compiled({SOURCE: source, "model.h": header}):
        content[f"binaries/linux64/{name}.so"] = binary
    return _zipped(content)


def note(content: bytes) -> str:
    """What to tell about an FMU: that no binary is in it, or nothing."""
    with ZipFile(BytesIO(content)) as archive:
        return "" if any(name.startswith("binaries/") for name in archive.namelist()) else SOURCE_ONLY


def compiler() -> str | None:
    """A C compiler that makes 64-bit Linux binaries, if there is one."""
    if not sys.platform.startswith("linux") or platform.machine() not in {"x86_64", "AMD64"}:
        return None
    return next(filter(None, map(which, COMPILERS)), None)


def _sizes(model: StateSpace, step: float, guid: str) -> Iterator[str]:
    yield c_comment(heading(model))
    yield f'#define MODEL_GUID "{guid}"'
    yield f"#define CONTINUOUS {int(not model.dt)}"
    yield f"#define STEP {step!r}"
    for name, signals in (("INPUTS", model.inputs), ("STATES", model.states), ("OUTPUTS", model.outputs)):
        yield f"#define {name} {len(signals)}"


def _matrices(model: StateSpace, held: StateSpace) -> Iterator[str]:
    listed = {"PHI": held.A, "GAMMA": held.B, "C": model.C, "D": model.D}
    if not model.dt:
        listed |= {"A": model.A, "B": model.B}
        yield f"#define REACH {reach(model.A)!r}"
    for name, values in listed.items():
        yield from c_matrix(name, values, hexadecimal, by_place=True)


def _compiled(sources: dict[str, bytes]) -> bytes:
    """The shared library, or nothing."""
    command = compiler()
    if command is None:
        return b""
    with TemporaryDirectory() as folder:
        for name, content in sources.items():
            (Path(folder) / name).write_bytes(content)
        try:
            subprocess.run(
                [command, *FLAGS, SOURCE, "-o", "model.so"],
                cwd=folder,
                capture_output=True,
                check=True,
                timeout=LONGEST_COMPILATION,
            )
        except (OSError, subprocess.SubprocessError):
            return b""
        return (Path(folder) / "model.so").read_bytes()


def _zipped(content: dict[str, bytes]) -> bytes:
    stream = BytesIO()
    with ZipFile(stream, "w", ZIP_DEFLATED) as archive:
        for name, data in content.items():
            archive.writestr(ZipInfo(name), data, ZIP_DEFLATED, compresslevel=1)
    return stream.getvalue()
