"""DOP853 over lanes as a module of its own for every form of scene, written out for numba (extra `fast`).

The equations and switches are the texts of `nonlinear.dynamics`, the method is `nonlinear.integration.method`, and what
is done with them stands in `nonlinear.integration` as Python: `loops`, `meeting`, `changes`. The module depends on the
form alone, not on its numbers: it is cached on disk, with numba's compiled code next to it.
"""

from __future__ import annotations

import inspect
import sys
from functools import cache, lru_cache
from hashlib import sha256
from pathlib import Path
from threading import Lock
from types import ModuleType
from typing import Any

from modal.errors import SceneError
from modal.scene import whole_file
from modal.scene.contents import content_of, private
from nonlinear.dynamics import Lanes, sincos, without_interrupts
from nonlinear.dynamics.compiling import inner, source_of
from nonlinear.integration import loops, meeting
from nonlinear.integration.changes import WHERE
from nonlinear.integration.crowds import Crowd
from nonlinear.integration.loops import CLOCK, SIZES, TABLES, looping
from nonlinear.integration.method import FIFTH, NODES, ROWS, SEEN, STAGES, THIRD, weighted_sum
from nonlinear.integration.readiness import Code, folder, look_up, made_private, temporary
from nonlinear.system import System

COMPILING_SECONDS = 6.0
"""Cost: seconds to compile an integrator, as expected before one was measured (benchmarks/engines.py)."""
LINK_COMPILING_SECONDS = 0.55
"""Cost: seconds more for the text of each link, as expected before one was measured (benchmarks/engines.py)."""
LANE_LINKS_MAX = 32
"""Limit: links of a scene up to which ensembles are compiled, beyond which that takes minutes."""
MAKING = Lock()
HEAD = '"""Written by multipendula, which runs what it has written and no other file of this name."""'
IMPORTED = """from math import floor, inf, log, pi, sqrt, tau
from typing import Any
from numpy import exp, isfinite, spacing, tanh, zeros
from nonlinear.dynamics.compiling import compiled, part, vectorized_part"""
ERRORS = """
@vectorized_part
def errors(y, z, K, rel, ab, h, err):
 for k in range(WIDTH):
  e5 = 0.0
  e3 = 0.0
  for i in range(D):
   scale = 1.0 / (ab[i, k] + rel[k] * max(abs(y[i, k]), abs(z[i, k])))
   a = ({fifth}) * scale
   b = ({third}) * scale
   e5 += a * a
   e3 += b * b
  both = e5 + 0.01 * e3
  err[k] = h[k] * e5 / sqrt(both * D) if both != 0.0 else 0.0
"""


def source(lanes: Lanes, crowd: Crowd | None = None) -> str:
    """The text of the module for this form of scene and its switches."""
    sizes, layout = dict.fromkeys(SIZES, 0), lanes.layout
    switches, (module, name) = (crowd.switches, crowd.equations) if crowd else (None, (lanes.module, "rates"))
    sizes |= {"D": lanes.size, "SIZE": layout.size, "HALF": layout.half, "FIRST": layout.first}
    sizes |= {"CONSTANTS": len(module.names), "TIMED": lanes.inputs.count}
    if lanes.inputs.count:
        sizes["DRIVEN"] = CLOCK if lanes.inputs.polynomials == [] else TABLES
    texts = [_vectorize(source_of(sincos))]
    if switches:
        at = switches.places
        sizes |= {"N": switches.count, "M": at.length, "TOLD": at.state_count, "HELD": 2 * at.J}
        sizes |= {"KICKS": at.K, "PRESSES": int(at.presses)}
        functions = filter(inspect.isfunction, vars(meeting).values())
        texts += [*(f"@part\n{source_of(function)}" for function in functions), switches.source()]
        texts += [_vectorize(switches.module.loop_source("values"))]
    elif "where(" in module.loop_source(name):
        texts += [_vectorize(WHERE)]
    texts += [_vectorize(module.loop_source(name, "rates")), _attempt(sizes["DRIVEN"] > 0, switches is not None)]
    fifth, third = (weighted_sum(shares, "K[{}, i, k]") for shares in (FIFTH, THIRD))
    texts += [ERRORS.format(fifth=fifth, third=third)]
    constants = {name: value for name, value in (vars(meeting) | vars(loops) | sizes).items() if name.isupper()}
    numbers = [f"{name} = {value!r}" for name, value in constants.items() if isinstance(value, int | float | tuple)]
    return "\n".join((HEAD, IMPORTED, *numbers, *texts, _loop())) + "\n"


@cache
def _loop() -> str:
    """The functions of `looping`, of which Python calls the last alone."""
    return inner(looping, "part").replace("@part\ndef run(", "@compiled\ndef run(")


def _vectorize(text: str) -> str:
    return f"@vectorized_part\n{text}"


def _attempt(driven: bool, switches: bool) -> str:
    lines, looks = ["", "@vectorized_part", "def attempt(y, h, c, K, z, front, tables, u, s, d, V, rel, ab, err):"], 0
    for stage in range(1, STAGES + 1):
        terms = weighted_sum(ROWS[stage], "K[{}, i, k]")
        lines += [" for i in range(D):", "  for k in range(WIDTH):", f"   z[i, k] = y[i, k] + h[k] * ({terms})"]
        lines += [f" driven({NODES[stage]!r}, h, front, tables, u, s)"] * driven + [f" rates(z, u, s, c, K[{stage}])"]
        if switches and stage in (*SEEN, STAGES):
            looks += 1
            lines += [f" look(z, K[{stage}], u, s, d, V[{looks}])"]
    return "\n".join((*lines, " errors(y, z, K, rel, ab, h, err)")) + "\n"


def path_of(text: str) -> Path:
    """The file of a module, a mere name where there is no folder for it."""
    name = f"lanes_{sha256(text.encode()).hexdigest()[:20]}.py"
    try:
        return folder() / name
    except OSError:
        return Path(name)


def code_of(lanes: Lanes, crowd: Crowd | None = None) -> Code:
    """The module for this form of scene and its switches, and how far it is."""
    return code_of_text(lanes, source(lanes, crowd), has_switches=crowd is not None)


def code_of_text(lanes: Lanes, text: str, *, has_switches: bool) -> Code:
    """The same where its text is known."""
    name = path_of(text).stem
    seconds = (COMPILING_SECONDS + LINK_COMPILING_SECONDS * lanes.system.n_links) * (3 if has_switches else 1)
    return look_up(
        "numba", name, seconds, "the equations of this form", lambda: getattr(sys.modules.get(name), "run", None)
    )


def integrator(system: System | None = None) -> Code:
    """The compiled integrator, or that of such systems on structures or with rotors, and how far it is."""
    kind = "" if system is None else " on structures" if system.structure else " with rotors" * system.has_rotors

    def steps() -> Any:
        return getattr(sys.modules.get("nonlinear.integration.compiled"), "steps", None)

    return look_up("numba", f"DOP853{kind}", COMPILING_SECONDS, "the integrator", steps)


def module_of(text: str) -> ModuleType:
    """The module with this text, on disk where there is a place for it; one thread makes it, others wait."""
    with MAKING:
        return _module_of(text)


@lru_cache(maxsize=32)
def _module_of(text: str) -> ModuleType:
    path = path_of(text)
    module = sys.modules[path.stem] = ModuleType(path.stem)
    module.__file__ = _write_module(path.name, text)
    code = compile(text, module.__file__, "exec")  # here, so that no bytecode next to the file is run
    with without_interrupts():
        exec(code, module.__dict__)
    return module


def _write_module(name: str, text: str) -> str:
    """The path of a file with this text, in the folder of kernels or a temporary one; a mere name where none can be."""
    for place in (folder, temporary):
        try:
            path = made_private(place()) / name
            if not _holds(path, text.encode()):
                with whole_file(path, opener=private) as stream:
                    stream.write(text.encode())
        except OSError:
            continue
        return str(path)
    return f"<{name}>"


def _holds(path: Path, content: bytes) -> bool:
    try:
        return content_of(path) == content
    except SceneError:
        return False
