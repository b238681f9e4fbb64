"""DOP853 over lanes as a module of its own for every form of scene, written out for numba (extra `fast`).

The equations are the text of `nonlinear.dynamics.forms`; sine and cosine, sums over stages and the control of steps are
loops over WIDTH lanes without a branch, which the compiler turns into vector instructions.  The text depends on the
form alone, not on its numbers: it is kept on disk, where numba keeps what it compiles beside it.

Steps in which something happens that is measured are put into a buffer, to be looked at in NumPy.
"""

from __future__ import annotations

import os
import sys
from functools import lru_cache
from hashlib import sha256
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from tempfile import mkdtemp
from threading import Lock
from types import ModuleType

from modal.scene import whole_file
from nonlinear.dynamics import Lanes, undisturbed
from nonlinear.integration.method import FIFTH, NODES, ROWS, STAGES, THIRD, weighted
from nonlinear.integration.steppers import BESIDE
from nonlinear.integration.watches import ASIDE, ROUNDING, UNKNOWN

COMPILING = "Compiling the equations of this form, which takes some ten seconds; the result is saved for later runs."
MAKING = Lock()
WIDTH, BESIDE_LINKS = 16, 8  # lanes; numbers of each beside those of its links
HEAD = '''"""Written by multipendula, which writes it again if it is changed."""
from math import floor, log, sqrt
from numpy import isfinite, spacing
from modal.eigen.compiling import vectorized

D, HALF, FIRST, CONSTANTS, WIDTH = {size}, {half}, {first}, {constants}, {width}
TOP, TURN = 3.141592653589793, 6.283185307179586
T, H, REFUSED, FRESH, DUE, LARGEST, ERROR, HORIZON, TURNED = range(9)
ASIDE, ROUNDING, UNKNOWN, CLEAR = {aside!r}, {rounding!r}, {unknown!r}, {clear!r}


@vectorized
def sincos(x):
    q = floor(x * 0.6366197723675814 + 0.5)
    r = ((x - q * 1.5707963267341256) - q * 6.077100506303966e-11) - q * 2.0222662487959506e-21
    z = r * r
    a = -2.50507602534068634195e-08 + z * 1.58969099521155010221e-10
    a = 8.33333333332248946124e-03 + z * (-1.98412698298579493134e-04 + z * (2.75573137070700676789e-06 + z * a))
    s = r + r * z * (-1.66666666666666324348e-01 + z * a)
    b = 2.08757232129817482790e-09 - z * 1.13596475577881948265e-11
    b = -1.38888888888741095749e-03 + z * (2.48015872894767294178e-05 + z * (-2.75573143513906633035e-07 + z * b))
    c = 1.0 - (0.5 * z - z * z * (4.16666666666666019037e-02 + z * b))
    m = q - 4.0 * floor(q * 0.25)
    high = floor(m * 0.5)
    odd, sign = m - 2.0 * high, 1.0 - 2.0 * high
    even = 1.0 - odd
    return sign * (even * s + odd * c), sign * (even * c - odd * s)

'''
CLOCK = """
@vectorized
def inputs(part, h, front, tables, u):
    for k in range(WIDTH):
        u[0, k] = front[T, k] + part * h[k]

"""
TABLES = """
@vectorized
def inputs(part, h, front, tables, u):
    first, knots, origins, coefficients, periods = tables
    for k in range(WIDTH):
        clear = CLEAR * spacing(front[T, k] + h[k])
        time = max(min(front[T, k] + part * h[k], front[T, k] + h[k] - clear), front[T, k] + clear)
        for j in range(len(periods)):
            t = time - floor(time / periods[j]) * periods[j] if isfinite(periods[j]) else time
            low, high = first[j], first[j + 1] - 1
            while low < high:
                middle = (low + high) // 2
                if knots[middle] <= t:
                    low = middle + 1
                else:
                    high = middle
            s, found = t - origins[low], 0.0
            for power in range(coefficients.shape[1]):
                found = found * s + coefficients[low, power]
            u[j, k] = found

"""
CONTROL = """
@vectorized
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


@vectorized
def load(k, member, task, front, y, c, rel, ab, sc, loc, v):
    begun, given, relative, absolute, first, ends, longest, scale, local, tables = task
    for i in range(D):
        y[i, k] = begun[i, member]
        ab[i, k] = absolute[i, member]
        sc[i, k] = scale[i, member % scale.shape[1]]
    for i in range(CONSTANTS):
        c[i, k] = given[i, member % given.shape[1]]
    rel[k], loc[k] = relative[member], local[member]
    for i in range(len(front)):
        front[i, k] = 0.0
    front[H, k], front[FRESH, k], front[HORIZON, k] = min(first[member], longest, ends[0]), 1.0, float("inf")
    for i in range(2 * HALF):
        v[i, k] = 1.0 / sqrt(2.0 * HALF)
    for i in range(FIRST, HALF):
        front[LARGEST, k] = max(front[LARGEST, k], abs(y[i, k]))


@vectorized
def reach(k, i, y, z, K, h):
    low, high = min(y[i, k], z[i, k]), max(y[i, k], z[i, k])
    slow, fast = K[0, i, k], K[0, i, k]
    for j in range(1, 13):
        slow, fast = min(slow, K[j, i, k]), max(fast, K[j, i, k])
    if slow < 0.0 and fast > 0.0:
        beyond = 0.5 * h * max(-slow, fast)
        return low - beyond, high + beyond
    return low, high


@vectorized
def happens(k, y, z, K, h, front, times, wants, level):
    due = int(front[DUE, k])
    if wants[0] and due < len(times) and times[due] <= front[T, k] + h:
        return True
    for i in range(FIRST, HALF):
        turns = wants[1] and front[TURNED + i - FIRST, k] < 2.0
        if turns or wants[2]:
            low, high = reach(k, i, y, z, K, h)
            if turns and floor((low - TOP) / TURN) != floor((high - TOP) / TURN):
                return True
            if wants[2] and max(-low, high) > max(front[LARGEST, k], abs(z[i, k])):
                return True
    if wants[3]:
        low, high = reach(k, wants[4], y, z, K, h)
        if wants[4] < FIRST:
            return (low >= level) != (high >= level)
        return floor((low - level) / TURN) != floor((high - level) / TURN)
    return False


@vectorized
def grown(z, h, g, K, sc, v, w):
    for i in range(HALF):
        for k in range(WIDTH):
            faster = v[HALF + i, k] * sc[HALF + i, k] + h[k] * ((g[HALF + i, k] - K[12, HALF + i, k]) / ASIDE)
            w[HALF + i, k] = faster / sc[HALF + i, k]
            w[i, k] = v[i, k] + h[k] * faster / sc[i, k]
    for k in range(WIDTH):
        total = 0.0
        for i in range(2 * HALF):
            total += w[i, k] * w[i, k]
        g[0, k] = sqrt(total)


@vectorized
def run(task, times, wants, level, members, counts, front, y, z, K, c, rel, ab, sc, loc, v, w, g, h, err, ok,
        out, error, horizon, gain, status, which, marks, before, after, stages, u):
    ends, longest, tables, size = task[5], task[6], task[9], task[0].shape[1]
    end = ends[len(ends) - 1]
    filled, room = 0, len(which) - WIDTH
    while filled <= room:
        fresh = False
        for k in range(WIDTH):
            if members[k] < 0 and counts[0] < size:
                members[k] = counts[0]
                load(k, counts[0], task, front, y, c, rel, ab, sc, loc, v)
                counts[0] += 1
            fresh = fresh or front[FRESH, k] == 1.0
        if fresh:
            {start}rates(y, {u}c, g)
            for k in range(WIDTH):
                if front[FRESH, k] == 1.0:
                    front[FRESH, k] = 0.0
                    for i in range(D):
                        K[0, i, k] = g[i, k]
        busy = False
        for k in range(WIDTH):
            busy = busy or members[k] >= 0
            h[k] = front[H, k]
        if not busy:
            return -1 - filled
        attempt(y, h, c, K, z, front, tables, u)
        errors(y, z, K, rel, ab, h, err)
        if wants[5]:
            for i in range(D):
                for k in range(WIDTH):
                    w[i, k] = z[i, k]
            for i in range(2 * HALF):
                for k in range(WIDTH):
                    w[i, k] += ASIDE * v[i, k] * sc[i, k]
            {end}rates(w, {u}c, g)
            grown(z, h, g, K, sc, v, w)
        for k in range(WIDTH):
            ok[k] = 0.0
            if members[k] < 0:
                continue
            member, e = members[k], err[k]
            taken = e < 1.0
            factor = 0.9 * sqrt(sqrt(sqrt(1.0 / e))) if e > 0.0 else 10.0
            factor = min(10.0, max(0.2, factor)) if isfinite(e) else 0.2
            if not taken or front[REFUSED, k] == 1.0:
                factor = min(factor, 1.0)
            front[REFUSED, k] = 0.0 if taken else 1.0
            if not taken:
                front[H, k] = h[k] * factor
                if not front[H, k] >= 10.0 * spacing(front[T, k]):
                    finite = True
                    for i in range(D):
                        finite = finite and isfinite(K[0, i, k])
                    status[member] = 1 if finite else 2
                    horizon[member], error[member], gain[member] = front[T, k], front[ERROR, k], front[T, k]
                    for i in range(D):
                        out[i, member] = y[i, k]
                    members[k], front[H, k] = -1, 0.0
                continue
            ok[k] = 1.0
            if happens(k, y, z, K, h[k], front, times, wants, level):
                which[filled], marks[0, filled], marks[1, filled] = member, front[T, k], h[k]
                for i in range(D):
                    before[i, filled], after[i, filled] = y[i, k], z[i, k]
                    for j in range(13):
                        stages[j, i, filled] = K[j, i, k]
                filled += 1
                due = int(front[DUE, k])
                while wants[0] and due < len(times) and times[due] <= front[T, k] + h[k]:
                    due += 1
                front[DUE, k] = due
                for i in range(FIRST, HALF):
                    if floor((y[i, k] - TOP) / TURN) != floor((z[i, k] - TOP) / TURN):
                        front[TURNED + i - FIRST, k] += 1.0
            if wants[2]:
                for i in range(FIRST, HALF):
                    front[LARGEST, k] = max(front[LARGEST, k], abs(z[i, k]))
            ahead = 0
            while ahead < len(ends) - 1 and ends[ahead] <= front[T, k]:
                ahead += 1
            front[T, k] += h[k]
            if ahead < len(ends) - 1 and front[T, k] >= ends[ahead] - CLEAR * spacing(ends[ahead]):
                front[T, k], front[FRESH, k] = ends[ahead], 1.0
                ahead += 1
            front[H, k] = min(h[k] * factor, longest, ends[ahead] - front[T, k])
            if wants[5] and isfinite(g[0, k]) and g[0, k] > 0.0:
                far = 0.0
                for i in range(FIRST, HALF):
                    far = max(far, abs(z[i, k]))
                front[ERROR, k] = front[ERROR, k] * g[0, k] + max(loc[k], ROUNDING * far)
                for i in range(2 * HALF):
                    v[i, k] = w[i, k] / g[0, k]
                if front[ERROR, k] > UNKNOWN and front[HORIZON, k] == float("inf"):
                    front[HORIZON, k] = front[T, k]
            if wants[6]:
                total = 0.0
                for i in range(D // 2, D):
                    total += (z[i, k] / sc[i, k]) ** 2
                length = sqrt(total)
                gain[member] += log(length)
                for i in range(D // 2, D):
                    z[i, k] /= length
                    K[12, i, k] /= length
            if front[T, k] >= end * (1.0 - 4e-16):
                error[member], horizon[member] = front[ERROR, k], front[HORIZON, k]
                for i in range(D):
                    out[i, member] = z[i, k]
                members[k], front[H, k] = -1, 0.0
        for i in range(D):
            for k in range(WIDTH):
                y[i, k] = z[i, k] if ok[k] > 0.0 else y[i, k]
                K[0, i, k] = K[12, i, k] if ok[k] > 0.0 else K[0, i, k]
    return filled
"""


def source(lanes: Lanes) -> str:
    """The text of the module for this form of scene."""
    layout = lanes.layout
    head = HEAD.format(
        size=lanes.size,
        half=layout.half,
        first=int(layout.on_cart),
        constants=len(lanes.module.names),
        width=WIDTH,
        aside=ASIDE,
        rounding=ROUNDING,
        unknown=UNKNOWN,
        clear=float(BESIDE),
    )
    fifth, third = (weighted(shares, "K[{}, i, k]") for shares in (FIFTH, THIRD))
    looped = lanes.module.looped("rates")
    timed = looped.startswith("def rates(y, u,")
    before, u = "inputs({}, h, front, tables, u); " if timed else "", "u, " if timed else ""
    read = (CLOCK if lanes.inputs.is_analytic else TABLES) if timed else ""
    control = CONTROL.replace("{start}", before.format(0.0)).replace("{end}", before.format(1.0)).replace("{u}", u)
    rates = f"\n@vectorized\n{looped}\n"
    return head + read + rates + _attempt(before, u) + control.format(fifth=fifth, third=third)


def _attempt(before: str, u: str) -> str:
    lines = ["", "@vectorized", "def attempt(y, h, c, K, z, front, tables, u):"]
    for stage in range(1, STAGES + 1):
        summed = weighted(ROWS[stage], "K[{}, i, k]")
        lines += [" for i in range(D):", "  for k in range(WIDTH):", f"   z[i, k] = y[i, k] + h[k] * ({summed})"]
        lines += [f" {before.format(NODES[stage])}rates(z, {u}c, K[{stage}])"]
    return "\n".join(lines) + "\n\n"


def folder() -> Path:
    """Where the modules are kept."""
    home = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(home) / "multipendula"


def path_of(text: str) -> Path:
    """The file of a module."""
    return folder() / f"lanes_{sha256(text.encode()).hexdigest()[:20]}.py"


def compiled_at(path: Path) -> bool:
    """Whether the module of this name has been compiled on this machine."""
    return path.exists() and any(path.parent.parent.rglob(f"{path.stem}.run-*.nbi"))


def module_of(text: str) -> ModuleType:
    """The module with this text, on disk where there is a place for it; one thread makes it, others wait."""
    with MAKING:
        return _module_of(text)


@lru_cache(maxsize=32)
def _module_of(text: str) -> ModuleType:
    path = path_of(text)
    if not compiled_at(path) and sys.stderr.isatty():
        print(COMPILING, file=sys.stderr)
    try:
        path = _written(path, text)
    except OSError:
        path = _written(Path(mkdtemp(prefix="multipendula-")) / path.name, text)
    spec = spec_from_file_location(path.stem, path)
    assert spec
    assert spec.loader
    module = sys.modules[path.stem] = module_from_spec(spec)
    with undisturbed():
        spec.loader.exec_module(module)
    return module


def _written(path: Path, text: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        with whole_file(path) as stream:
            stream.write(text.encode())
    return path
