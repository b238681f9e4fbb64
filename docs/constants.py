"""Every number that stands as a constant of a module, with its kind and its reason, read from the source.

A constant is written in capitals at the top of its module, one a line, and the docstring below it begins with its kind.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parent.parent
PACKAGES = ("modal", "nonlinear", "multipendula")
KINDS = {
    "Physics": "a value of nature or of a published source",
    "Format": "an encoding, or the size of what is printed or drawn",
    "Tolerance": "decides a digit or a verdict: why this size, and a test feels it × 8 or ÷ 8",
    "Cost": "no result depends on it: what was measured",
    "Limit": "beyond it a message says so, or the user sets it",
}


class Number(NamedTuple):
    """A numeric constant: its module, name and value as written; its kind and reason, "" where none is stated."""

    module: str
    name: str
    value: str
    kind: str
    reason: str


def is_numeric(node: ast.expr | None) -> bool:
    """Whether an expression is a number, or arithmetic or a conversion of one."""
    if isinstance(node, ast.Constant):
        return isinstance(node.value, int | float) and not isinstance(node.value, bool)
    if isinstance(node, ast.UnaryOp):
        return is_numeric(node.operand)
    if isinstance(node, ast.BinOp):
        return is_numeric(node.left) or is_numeric(node.right)
    return isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in ("float", "int")


def numbers_of(module: str, source: str) -> Iterator[Number]:
    """The numeric constants of a module's source."""
    statements = ast.parse(source).body
    for statement, following in zip(statements, [*statements[1:], None], strict=True):
        kind, reason = _declaration(following)
        for name, value in _assignments(statement):
            if name.isupper() and is_numeric(value):
                yield Number(module, name, ast.unparse(value), kind, reason)


def _assignments(statement: ast.stmt) -> Iterator[tuple[str, ast.expr]]:
    if isinstance(statement, ast.AnnAssign) and isinstance(statement.target, ast.Name) and statement.value:
        yield statement.target.id, statement.value
    for target in statement.targets if isinstance(statement, ast.Assign) else ():
        pairs = [(target, statement.value)]
        if isinstance(target, ast.Tuple) and isinstance(statement.value, ast.Tuple):
            pairs = list(zip(target.elts, statement.value.elts, strict=True))
        yield from ((name.id, value) for name, value in pairs if isinstance(name, ast.Name))


def _declaration(statement: ast.stmt | None) -> tuple[str, str]:
    """The kind and the reason in a docstring below a constant, empty where there is none."""
    if not (isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)):
        return "", ""
    kind, _, reason = str(statement.value.value).partition(": ")
    return (kind, " ".join(reason.split())) if kind in KINDS else ("", "")


@cache
def all_numbers() -> list[Number]:
    """The numeric constants of the three packages."""
    numbers = list[Number]()
    for path in sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py")):
        module = ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
        numbers += numbers_of(module, path.read_text(encoding="utf-8"))
    return numbers
