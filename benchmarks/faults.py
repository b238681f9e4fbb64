"""Faults to put into the packages, one at a time: a number × 8 or ÷ 8, an operator for its like, a statement less.

The list is fixed by its seed and spread over the subpackages by their lines.
"""

from __future__ import annotations

import ast
import random
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

PACKAGES = ("modal", "nonlinear", "multipendula")
COUNTS = {"number": 50, "operator": 100, "statement": 100}
OPERATORS: dict[type, type] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.And: ast.Or,
    ast.Or: ast.And,
}


@dataclass(frozen=True)
class Fault:
    """A change of one expression or statement: what stands there becomes `new`, the `nth` such text of its scope."""

    kind: str
    file: str
    scope: str
    old: str
    new: str
    nth: int = 0
    name: str = ""

    @property
    def room(self) -> str:
        """The subpackage of the file."""
        return ".".join(Path(self.file).with_suffix("").parts[:2])

    def __str__(self) -> str:
        return f"`{self.file}` {self.scope}: `{' '.join(self.old.split())}` → `{' '.join(self.new.split())}`"


@dataclass(frozen=True)
class Site:
    """A fault with the lines and columns of its text."""

    fault: Fault
    first: tuple[int, int]
    last: tuple[int, int]


class Faults(ast.NodeVisitor):
    """Every fault of one file, in the order of its lines."""

    def __init__(self, file: str, source: str) -> None:
        self.file, self.scopes, self.sites = file, ["<module>"], list[Site]()
        self.lines = source.encode().splitlines(keepends=True)
        self.seen: Counter[tuple[str, str]] = Counter()
        self.visit(ast.parse(source))

    def _text(self, node: Any) -> str:
        lines = self.lines[node.lineno - 1 : node.end_lineno]
        lines[-1] = lines[-1][: node.end_col_offset]
        lines[0] = lines[0][node.col_offset :]
        return b"".join(lines).decode()

    def _add(self, kind: str, node: Any, new: str, name: str = "") -> None:
        scope, old = ".".join(self.scopes), self._text(node)
        nth = self.seen[scope, kind + old + new]
        self.seen[scope, kind + old + new] += 1
        fault = Fault(kind, self.file, scope, old, new, nth, name)
        self.sites.append(
            Site(fault, (node.lineno, node.col_offset), (node.end_lineno, node.end_col_offset)),
        )

    def _scope(self, node: Any) -> None:
        self.scopes.append(node.name)
        self.generic_visit(node)
        self.scopes.pop()

    visit_FunctionDef = visit_AsyncFunctionDef = visit_ClassDef = _scope

    def _number(self, targets: Sequence[ast.expr], value: ast.expr | None) -> None:
        if len(self.scopes) > 1 or not isinstance(targets[0], ast.Name) or value is None:
            return
        for node in ast.walk(value):
            if isinstance(node, ast.Constant) and type(node.value) in {int, float}:
                for sign in "*/":
                    whole = type(node.value) is int
                    self._add(
                        "number", node, f"({node.value} {'//' if whole and sign == '/' else sign} 8)", targets[0].id
                    )

    def visit_Assign(self, node: ast.Assign) -> None:
        """A constant of the module, or a place that is set."""
        self._number(node.targets, node.value)
        if isinstance(node.targets[0], ast.Attribute | ast.Subscript):
            self._statement(node)
        self.generic_visit(node)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        """A constant of the module."""
        self._number([node.target], node.value)
        if node.value is not None:
            self.visit(node.value)

    def _statement(self, node: ast.stmt) -> None:
        if len(self.scopes) > 1:
            self._add("statement", node, "pass")
        self.generic_visit(node)

    visit_AugAssign = visit_Raise = visit_Continue = visit_Break = _statement

    def visit_Expr(self, node: ast.Expr) -> None:
        """A call that is made for what it does; texts stay."""
        if isinstance(node.value, ast.Constant):
            return
        self._statement(node)

    def _swap(self, node: ast.expr, operator: ast.AST) -> bool:
        other = OPERATORS.get(type(operator))
        if other is None or len(self.scopes) == 1:
            return False
        swapped = ast.parse(f"({self._text(node)}\n)", mode="eval").body
        if isinstance(swapped, ast.Compare):
            swapped.ops[0] = other()
        else:
            swapped.op = other()  # type: ignore[attr-defined]
        self._add("operator", node, f"({ast.unparse(swapped)})")
        return True

    def visit_BinOp(self, node: ast.BinOp) -> None:
        """+ and −, for each other."""
        self._swap(node, node.op)
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        """And and or, for each other."""
        self._swap(node, node.op)
        self.generic_visit(node)

    def visit_Compare(self, node: ast.Compare) -> None:
        """< and ≤, > and ≥, for each other."""
        self._swap(node, node.ops[0])
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        """A minus that is dropped."""
        if isinstance(node.op, ast.USub) and len(self.scopes) > 1:
            self._add("operator", node, f"({self._text(node.operand)})")
        self.generic_visit(node)

    def visit_JoinedStr(self, node: ast.JoinedStr) -> None:
        """Messages stay as they are."""


def sources(tree: Path) -> list[str]:
    """The modules of the packages, in the order of their names."""
    return sorted(str(path.relative_to(tree)) for package in PACKAGES for path in (tree / package).rglob("*.py"))


@cache
def sites(tree: Path, file: str) -> list[Site]:
    """Every place of a file where a fault can be put."""
    return Faults(file, (tree / file).read_text(encoding="utf-8")).sites


def faults(tree: Path, seed: int) -> list[Fault]:
    """The list: as many of each kind as COUNTS, each the next after one of so many lines spread evenly over all."""
    rng, chosen = random.Random(seed), list[Fault]()
    files = sources(tree)
    lengths = {file: len((tree / file).read_text(encoding="utf-8").splitlines()) for file in files}
    starts = dict(zip(files, [sum(list(lengths.values())[:k]) for k in range(len(files))], strict=True))
    total = sum(lengths.values())
    for kind, count in COUNTS.items():
        left = sorted(
            (
                (starts[file] + site.first[0], site.first[1], site.fault)
                for file in files
                for site in sites(tree, file)
                if site.fault.kind == kind and (kind != "number" or " * " in site.fault.new)
            ),
            key=lambda place: place[:2],
        )
        begin = rng.random()
        for step in range(count):
            line = (begin + step) * total / count
            place = next((place for place in left if place[0] >= line), left[0])
            left.remove(place)
            chosen.append(place[2])
            if kind == "number":
                chosen += [
                    site.fault
                    for site in sites(tree, place[2].file)
                    if site.fault.kind == kind and site.first == (place[0] - starts[place[2].file], place[1])
                ][1:]
    return chosen


def site_of(tree: Path, fault: Fault) -> Site | None:
    """Where a fault of the list stands, None where its text or its file is gone."""
    there = sites(tree, fault.file) if (tree / fault.file).exists() else []
    return next((site for site in there if site.fault == fault), None)


def with_fault(source: str, site: Site) -> str:
    """The text of a file with one fault; columns count bytes."""
    lines = source.encode().splitlines(keepends=True)
    (first, start), (last, end) = site.first, site.last
    changed = lines[first - 1][:start] + site.fault.new.encode() + lines[last - 1][end:]
    return b"".join([*lines[: first - 1], changed, *lines[last:]]).decode()
