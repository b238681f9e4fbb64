"""Code generation from a tape: functions of (y, u, v) in Python and for compilers, with shared constants.

Operations on the numbers p of a scene alone are written separately and done once (`Module.constants`): for one scene in
floats, for many at once in arrays.  The rest is straight-line code without arrays, matrices or loops; for few links
Python's floats are several times faster in it than NumPy, which would spend most of its time on calls.  The same text
serves floats, arrays of many states, complex numbers and heyoka's expressions; numba gets loops over lanes, the live
page JavaScript.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from functools import cache, lru_cache
from itertools import pairwise
from math import floor
from typing import Any

import numpy as np

from nonlinear.dynamics.tape import DIVISOR_MIN, Symbol, Tape, order, uses, where

WIDE_ARRAY_NUMBERS = 200
"""Cost: complex numbers from which a first-order formula is quicker than NumPy's complex functions."""
NESTING_MAX = 40
"""Format: of parentheses, which parsers limit."""
KINDS = ("y", "u", "v")
"""The arguments of a function that is written, in this order; those of no use are empty."""
FUNCTIONS: dict[str, Mapping[str, Any]] = {
    "floats": {
        **{name: getattr(math, name) for name in ("sin", "cos", "sqrt", "exp", "log", "tanh")},
        "arctan": math.atan,
        "where": lambda x, a, b: a if x > 0 else b,
    },
    "arrays": {
        **{name: getattr(np, name) for name in ("sin", "cos", "sqrt", "arctan", "exp", "log", "tanh")},
        "where": where,
    },
}
Function = Callable[..., Any]


def _is_wide(z: Any) -> bool:
    return isinstance(z, np.ndarray) and z.dtype.kind == "c" and z.size >= WIDE_ARRAY_NUMBERS


def _first_order(function: Callable[[Any], Any], slope: Callable[[Any, Any], Any]) -> Callable[[Any], Any]:
    """A function of complex arrays (..., k) whose columns differ in imaginary parts, the squares of which are nothing.

    `slope` is its derivative, from x and the function there; of few the function itself is as fast.
    """

    def apply(z: Any) -> Any:
        if not _is_wide(z):
            return function(z)
        x = z.real[..., :1]
        value, result = function(x), np.empty(z.shape, dtype=complex)
        result.real = value
        np.multiply(slope(x, value), z.imag, out=result.imag)
        return result

    return apply


def _root(x: Any) -> Any:
    """The square root, also of a square of nothing but an infinitesimal."""
    return np.sqrt(x if x.dtype.kind == "c" else np.maximum(x, 0.0))


def _sincos(z: Any) -> tuple[Any, Any]:
    """Sine and cosine of columns."""
    if not _is_wide(z):
        return np.sin(z), np.cos(z)
    x, sine, cosine = z.real[..., :1], np.empty_like(z), np.empty_like(z)
    s, c = np.sin(x), np.cos(x)
    sine.real, cosine.real = s, c
    np.multiply(c, z.imag, out=sine.imag)
    np.multiply(-s, z.imag, out=cosine.imag)
    return sine, cosine


def _inverse(z: Any) -> Any:
    """1/z of columns: NumPy's division of complex numbers takes ten times as long as its product."""
    if not _is_wide(z):
        return 1.0 / z
    quotient = np.empty_like(z)
    inverse = 1.0 / z.real
    quotient.real = inverse
    inverse *= -inverse
    np.multiply(inverse, z.imag, out=quotient.imag)
    return quotient


FUNCTIONS["columns"] = {
    "sincos": _sincos,
    "inverse": _inverse,
    "sin": lambda z: _sincos(z)[0],
    "cos": lambda z: _sincos(z)[1],
    "sqrt": _first_order(_root, lambda x, value: 0.5 / (value + DIVISOR_MIN)),
    "arctan": _first_order(np.arctan, lambda x, value: 1 / (1 + x * x)),
    "exp": _first_order(np.exp, lambda x, value: value),
    "log": _first_order(np.log, lambda x, value: 1 / x),
    "tanh": _first_order(np.tanh, lambda x, value: 1 - value * value),
    "where": where,
}


class Module:
    """Named functions, each from its components."""

    def __init__(self, tape: Tape, functions: Mapping[str, Sequence[Any]]) -> None:
        self.sizes, self.functions = dict(tape.sizes), {name: list(outputs) for name, outputs in functions.items()}
        used = {name: uses(outputs) for name, outputs in self.functions.items()}
        counts = uses([entry for outputs in self.functions.values() for entry in outputs])
        symbols = order(tape, counts)
        fixed_symbols = _fixed_symbols(symbols)
        ends = _ends(symbols, self.functions.values(), fixed_symbols)
        self._before = _Lines("t")
        self._before.add([symbol for symbol in symbols if id(symbol) in fixed_symbols], counts, ends)
        self.kept = [self._before.names[id(symbol)] for symbol in symbols if id(symbol) in ends]
        constants = {id(symbol): f"c{k}" for k, symbol in enumerate(entry for entry in symbols if id(entry) in ends)}
        self._lines = {name: _Lines("x", constants) for name in functions}
        for name, lines in self._lines.items():
            varying = [symbol for symbol in symbols if id(symbol) in used[name] and id(symbol) not in fixed_symbols]
            lines.add(varying, used[name], set())

    def constants(self, p: Sequence[Any], target: str = "") -> list[Any]:
        """The constants of all functions, from the numbers of one scene, or of many in arrays, or of a `target`."""
        names = "".join(f"p{k}, " for k in range(self.sizes.get("p", 0)))
        body = [f" {names}= p"] * bool(names) + [f" {line}" for line in self._before.lines]
        text = "\n".join(("def constants(p):", *body, f" return [{', '.join(self.kept)}]"))
        usual = "arrays" if any(isinstance(number, np.ndarray) for number in p) else "floats"
        return function_in(text, "constants", target or usual)(p)  # type: ignore[no-any-return]

    @property
    def names(self) -> list[str]:
        """The names of the constants."""
        return [f"c{k}" for k in range(len(self.kept))]

    def components(self, name: str) -> list[str]:
        """Return the results of a function as words."""
        return [self._lines[name].word(output) for output in self.functions[name]]

    @cache  # noqa: B019 - a module is cached with its text
    def python(self, name: str, columns: bool = False) -> str:
        """The source of `made`, which takes the constants and gives the function.

        In that for `columns` sine and cosine of one angle, and the inverse of a divisor, are computed once.
        """
        rows = (f"{''.join(f'{kind}{k}, ' for k in range(self.sizes[kind]))}= {kind}" for kind in self._kinds(name))
        lines = [*self._lines[name].lines, f"return [{', '.join(self.components(name))}]"]
        header: list[str] = []
        if columns:
            pairs, inverses = dict[str, tuple[str, str]](), set[str]()
            pieces = [piece for line in lines for piece in _pair_sines(line, pairs)]
            lines = [line for piece in pieces for line in _invert_divisors(piece, inverses)]
            header = [line for line in lines if re.match(r"ic\d+ =", line)]
            lines = [line for line in lines if line not in header]
        head, body = [f" {line}" for line in header], [f"  {line}" for line in (*rows, *lines)]
        names = ", ".join(self.names)
        return "\n".join((f"def made({names}):", *head, " def made(y, u=(), v=()):", *body, " return made"))

    def function(self, name: str, constants: Sequence[Any], target: str = "floats") -> Function:
        """A function with these constants, for floats, arrays, complex numbers, columns (FUNCTIONS)."""
        text = self.python(name, target == "columns")
        text = with_branches(text) if target == "floats" else text
        return function_in(text, "made", target)(*constants)  # type: ignore[no-any-return]

    def generic_function(self, name: str, constants: Sequence[Any], functions: Mapping[str, Any]) -> Function:
        """A function with these constants, for anything with plain arithmetic and these functions of it."""
        space = dict(functions)
        exec(compile(self.python(name), f"<{name}>", "exec"), space)
        return space["made"](*constants)  # type: ignore[no-any-return]

    def loop_source(self, name: str, alias: str = "") -> str:
        """The source of a loop over lanes (y, u, v, c, o), called `alias`, by default as here, for numba.

        It has WIDTH, `sincos` and `where`, the constants c (C, WIDTH) and the results o; sine and cosine of one angle
        are computed together.
        """
        pairs: dict[str, tuple[str, str]] = {}
        reads = [("c", k) for k in range(len(self.kept))] + [symbol.operation[1:] for symbol in self._lines[name].given]
        lines = [f"  {kind}{k} = {kind}[{k}, k]" for kind, k in reads]
        statements = [
            *self._lines[name].lines,
            *(f"o[{k}, k] = {word}" for k, word in enumerate(self.components(name))),
        ]
        for line in statements:
            lines += [f"  {statement}" for statement in _pair_sines(line, pairs)]
        return "\n".join((f"def {alias or name}(y, u, v, c, o):", " for k in range(WIDTH):", *lines)) + "\n"

    def scalar(self, name: str, alias: str = "") -> str:
        """The source of a function (c, y, u, v) of lists, called `alias`, by default as here, for Python and numba."""
        components = self.components(name)
        reads = self._constants_in((*self._lines[name].lines, *components))
        reads += [f"{kind}{k}" for kind, k in (symbol.operation[1:] for symbol in self._lines[name].given)]
        lines = [*(f"{word} = {word[0]}[{word[1:]}]" for word in reads), *self._lines[name].lines]
        ending = f"return [{', '.join(components)}]"
        return "\n".join((f"def {alias or name}(c, y, u, v):", *(f" {line}" for line in [*lines, ending]))) + "\n"

    def javascript(self, *names: str) -> str:
        """The source of an object of functions, or of those with these names, for JavaScript.

        Sin, cos and sqrt are those of Math.  `constants(p)` returns c; the others are functions (c, y, u, v, o), which
        write into o.
        """
        methods = [_javascript_method("constants(p)", self._before, (), f"return [{', '.join(self.kept)}];")]
        for name, lines in self._lines.items():
            if names and name not in names:
                continue
            components = self.components(name)
            constants = self._constants_in((*lines.lines, *components))
            ends = (f"o[{k}] = {word};" for k, word in enumerate(components))
            methods.append(_javascript_method(f"{name}(c, y, u, v, o)", lines, constants, *ends))
        return "\n".join(("{", *methods, "}"))

    def _constants_in(self, lines: Sequence[str]) -> list[str]:
        """The constants that are read in these lines."""
        words = set(re.findall(r"\bc\d+\b", "\n".join(lines)))
        return [constant for constant in self.names if constant in words]

    def _kinds(self, name: str) -> list[str]:
        kinds = {symbol.operation[1] for symbol in self._lines[name].given}
        return [kind for kind in KINDS if kind in kinds]


class _Lines:
    """Assignments of expressions that are used more than once or nested too deeply, each to a name of this letter."""

    def __init__(self, letter: str, names: Mapping[int, str] | None = None) -> None:
        self.letter, self.names, self.lines = letter, dict(names or {}), list[str]()
        self.given: list[Symbol] = []

    def add(self, symbols: Sequence[Symbol], used: Mapping[int, int], line_ids: set[int]) -> None:
        """Write these symbols, those of `line_ids` in a line of their own."""
        deep: dict[int, int] = {}
        angles = {id(symbol.operation[1]) for symbol in symbols if symbol.operation[0] in {"sin", "cos"}}
        for symbol in symbols:
            operator, *operands = symbol.operation
            is_input = operator == "in"
            words = operands if is_input else [self.word(operand) for operand in operands]
            text = f"{words[0]}{words[1]}" if is_input else operation_text(operator, words)
            deep[id(symbol)] = 0 if is_input else 1 + max(deep.get(id(operand), 0) for operand in operands)
            often = used[id(symbol)] > 1 or id(symbol) in angles
            if id(symbol) in line_ids or (not is_input and (often or deep[id(symbol)] >= NESTING_MAX)):
                name = f"{self.letter}{len(self.lines)}"
                self.lines.append(f"{name} = {text}")
                text, deep[id(symbol)] = name, 0
            self.names[id(symbol)] = text
            self.given += [symbol] * is_input

    def word(self, value: Any) -> str:
        """A value as it is called in the text."""
        return self.names[id(value)] if isinstance(value, Symbol) else repr(float(value))


@lru_cache(maxsize=256)
def with_branches(text: str) -> str:
    """The same text with Python's conditional expressions for `where`, of which only one branch is computed."""
    while (start := text.rfind("where(")) >= 0:
        parts, depth, end = [start + len("where(") - 1], 0, start + len("where(")
        while depth >= 0:
            depth += {"(": 1, ")": -1}.get(text[end], 0)
            if depth < 0 or (depth == 0 and text[end] == ","):
                parts.append(end)
            end += 1
        x, a, b = (text[begin + 1 : stop].strip() for begin, stop in pairwise(parts))
        text = f"{text[:start]}({a} if {x} > 0 else {b}){text[end:]}"
    return text


def operation_text(operator: str, parts: Sequence[str]) -> str:
    """The text of an operation on these operands."""
    if operator in FUNCTIONS["floats"]:
        return f"{operator}({', '.join(parts)})"
    return f"(-{parts[0]})" if operator == "neg" else f"({parts[0]} {operator} {parts[1]})"


def _javascript_method(head: str, lines: _Lines, constants: Sequence[str], *ends: str) -> str:
    """A method of an object in JavaScript: its reads from arrays, its lines, its results."""
    reads = [(constant[0], int(constant[1:])) for constant in constants] + [
        symbol.operation[1:] for symbol in lines.given
    ]
    body = [f"{kind}{k} = {kind}[{k}]" for kind, k in reads] + lines.lines
    return "\n".join((f"{head} {{", *(f"const {line};" for line in body), *ends, "},"))


def _pair_sines(line: str, pairs: dict[str, tuple[str, str]]) -> list[str]:
    """A line in which sines and cosines are names, after the lines that compute those not computed before."""
    definitions = []
    for at, call in enumerate(("sin(", "cos(")):
        while (start := line.find(call)) >= 0:
            end = line.index(")", start)
            angle = line[start + len(call) : end]
            if angle not in pairs:
                pairs[angle] = f"s{len(pairs)}", f"q{len(pairs)}"
                definitions.append(f"{', '.join(pairs[angle])} = sincos({angle})")
            line = line[:start] + pairs[angle][at] + line[end + 1 :]
    return [*definitions, line]


def _invert_divisors(line: str, inverses: set[str]) -> list[str]:
    """A line with products in place of quotients, after the lines that compute inverses not computed before."""
    definitions = []
    for name in re.findall(r" / ([a-z]\w*)\)", line):
        if name not in inverses:
            inverses.add(name)
            definitions.append(f"i{name} = inverse({name})")
    line = re.sub(r" / ([a-z]\w*)\)", r" * i\1)", line).replace(" / (", " * inverse(")
    return [*definitions, line]


def _fixed_symbols(symbols: Sequence[Symbol]) -> set[int]:
    """The nodes that depend on the numbers of a scene alone."""
    fixed_symbols: set[int] = set()
    for symbol in symbols:
        operator, *operands = symbol.operation
        if operator == "in":
            is_constant = operands[0] == "p"
        else:
            is_constant = all(id(operand) in fixed_symbols for operand in operands if isinstance(operand, Symbol))
        if is_constant:
            fixed_symbols.add(id(symbol))
    return fixed_symbols


def _ends(symbols: Sequence[Symbol], functions: Any, fixed_symbols: set[int]) -> set[int]:
    """The constant nodes that others use, or that are returned."""
    values = [operand for symbol in symbols if id(symbol) not in fixed_symbols for operand in symbol.operation[1:]]
    values += [output for outputs in functions for output in outputs]
    return {id(operand) for operand in values if isinstance(operand, Symbol) and id(operand) in fixed_symbols}


def sincos(x: Any) -> Any:
    """Sine and cosine of one angle (rad), reduced by Cody and Waite in three parts, then by Cephes's polynomials."""
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


@lru_cache(maxsize=256)
def function_in(text: str, name: str, target: str = "floats") -> Callable[..., Any]:
    """The function of this name that a source text defines, with the FUNCTIONS of a target."""
    space: dict[str, Any] = dict(FUNCTIONS[target])
    exec(compile(text, f"<{name}>", "exec"), space)
    return space[name]  # type: ignore[no-any-return]
