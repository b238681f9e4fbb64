"""Scalar functions of Python as JavaScript: the changes at a switch are written once (`nonlinear.integration.changes`).

Such functions have numbers, booleans and lists, `for` over lists and ranges, `if`, comprehensions, and of the built-ins
those of `CALLED`: what Python runs and numba compiles.  Anything else is a TypeError that names its line.  A sum of
lists must show as such, by a display, a slice, a comprehension or a function named in `lists`.
"""

from __future__ import annotations

import ast
import inspect
from collections.abc import Callable, Collection, Sequence
from textwrap import dedent
from typing import Any

HELPERS = """
const $range = (from, to, step = 1) => {
  const [first, end] = to === undefined ? [0, from] : [from, to];
  return Array.from({ length: Math.max(0, Math.ceil((end - first) / step)) }, (_, i) => first + step * i);
};
const $repeated = (list, count) => Array.from({ length: count }, () => list[0]);
const $sum = (list) => list.reduce((total, value) => total + value, 0);
"""
CALLED = {
    **{name: f"Math.{name}" for name in ("abs", "max", "min", "sqrt", "sin", "cos")},
    **{"float": "Number", "int": "Math.trunc", "range": "$range", "sum": "$sum"},
}
OPERATORS = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Mod: "%", ast.Pow: "**"}
RESERVED = {"new": "next", "var": "value_", "let": "let_", "this": "this_", "in": "in_"}
"""Names that Python has free and JavaScript has not."""
COMPARED = {ast.Eq: "===", ast.NotEq: "!==", ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">="}


def functions_of(source: str, lists: Collection[str] = ()) -> str:
    """The functions of a source text, each as a JavaScript function with its own names; `lists` return lists."""
    tree = ast.parse(dedent(source))
    writer = _Writer(frozenset(lists))
    return "\n".join(writer.function(node, "") for node in tree.body if isinstance(node, ast.FunctionDef))


def function_source(functions: Sequence[Callable[..., Any]], lists: Collection[str] = ()) -> str:
    """The same of functions."""
    return "\n".join(functions_of(inspect.getsource(function), lists) for function in functions)


def method_source(methods: Sequence[Callable[..., Any]]) -> str:
    """Methods as functions of their object, whose attributes are numbers; they may call each other."""
    return function_source(methods)


class _Writer:
    def __init__(self, lists: frozenset[str]) -> None:
        self.lists = lists

    # ------------------------------------------------------------------------------------------------ statements

    def function(self, node: ast.FunctionDef, indent: str) -> str:
        names = [argument.arg for argument in node.args.args]
        local = sorted(RESERVED.get(name, name) for name in _assigned(node.body) - set(names))
        head = f"{indent}function {node.name}({', '.join(names)}) {{"
        lines = [f"{indent}  let {', '.join(local)};"] if local else []
        return "\n".join((head, *lines, *self.block(node.body, indent + "  "), f"{indent}}}"))

    def block(self, body: Sequence[ast.stmt], indent: str) -> list[str]:
        return [line for node in body for line in self.statement(node, indent)]

    def statement(self, node: ast.stmt, indent: str) -> list[str]:
        match node:
            case ast.Expr(value=ast.Constant(value=str())):
                return []
            case ast.Expr(value=value):
                return [f"{indent}{self.expression(value)};"]
            case ast.Return(value=value):
                return [f"{indent}return{'' if value is None else ' ' + self.expression(value)};"]
            case ast.Assign(targets=[target], value=value):
                return [f"{indent}{self.target(target)} = {self.expression(value)};"]
            case ast.AugAssign(target=target, op=op, value=value):
                return [f"{indent}{self.target(target)} {OPERATORS[type(op)]}= {self.expression(value)};"]
            case ast.For(target=target, iter=over, body=body, orelse=[]):
                head = f"{indent}for (const {self.target(target)} of {self.expression(over)}) {{"
                return [head, *self.block(body, indent + "  "), f"{indent}}}"]
            case ast.If(test=test, body=body, orelse=other):
                lines = [f"{indent}if ({self.expression(test)}) {{", *self.block(body, indent + "  ")]
                if other:
                    lines += [f"{indent}}} else {{", *self.block(other, indent + "  ")]
                return [*lines, f"{indent}}}"]
            case ast.Continue():
                return [f"{indent}continue;"]
        raise TypeError(f"line {node.lineno}: no {type(node).__name__} in scalar functions")

    def target(self, node: ast.expr) -> str:
        if isinstance(node, ast.Tuple):
            return f"[{', '.join(map(self.target, node.elts))}]"
        return self.expression(node)

    # ----------------------------------------------------------------------------------------------- expressions

    def expression(self, node: ast.expr) -> str:  # noqa: PLR0912
        match node:
            case ast.Constant(value=bool() as value):
                return str(value).lower()
            case ast.Constant(value=int() | float() as value):
                return repr(value)
            case ast.Name(id=name):
                return RESERVED.get(name, name)
            case ast.Attribute(value=ast.Name(id="self"), attr=name):
                return f"self.{name}"
            case ast.Subscript(value=value, slice=ast.Slice(lower=low, upper=high, step=None)):
                ends = [self.expression(low) if low else "0", *([self.expression(high)] if high else [])]
                return f"{self.expression(value)}.slice({', '.join(ends)})"
            case ast.Subscript(value=value, slice=at):
                return f"{self.expression(value)}[{self.expression(at)}]"
            case ast.List(elts=parts) | ast.Tuple(elts=parts):
                return f"[{', '.join(map(self.expression, parts))}]"
            case ast.Starred(value=value):
                return f"...{self.expression(value)}"
            case ast.UnaryOp(op=op, operand=value):
                return f"({'!' if isinstance(op, ast.Not) else '-'}{self.expression(value)})"
            case ast.BinOp():
                return self.operation(node)
            case ast.BoolOp(op=op, values=values):
                return f"({(' && ' if isinstance(op, ast.And) else ' || ').join(map(self.expression, values))})"
            case ast.Compare(left=left, ops=ops, comparators=others):
                words = [self.expression(operand) for operand in (left, *others)]
                pairs = zip(words, ops, words[1:], strict=False)
                return f"({' && '.join(f'{a} {COMPARED[type(op)]} {b}' for a, op, b in pairs)})"
            case ast.IfExp(test=test, body=body, orelse=other):
                return f"({self.expression(test)} ? {self.expression(body)} : {self.expression(other)})"
            case ast.ListComp(elt=value, generators=generators):
                return self.comprehension(value, generators)
            case ast.Call():
                return self.call(node)
        raise TypeError(f"line {node.lineno}: no {type(node).__name__} in scalar functions")

    def operation(self, node: ast.BinOp) -> str:
        left, right = self.expression(node.left), self.expression(node.right)
        if isinstance(node.op, ast.Mult) and self.is_list(node.left):
            return f"$repeated({left}, {right})"
        if isinstance(node.op, ast.Add) and (self.is_list(node.left) or self.is_list(node.right)):
            return f"[...{left}, ...{right}]"
        return f"({left} {OPERATORS[type(node.op)]} {right})"

    def is_list(self, node: ast.expr) -> bool:
        match node:
            case ast.List() | ast.ListComp() | ast.Subscript(slice=ast.Slice()):
                return True
            case ast.BinOp(left=left, right=right):
                return self.is_list(left) or self.is_list(right)
            case ast.Call(func=ast.Name(id=name)):
                return name in self.lists
        return False

    def comprehension(self, value: ast.expr, generators: Sequence[ast.comprehension]) -> str:
        first, *rest = generators
        over, name = self.expression(first.iter), self.target(first.target)
        over += "".join(f".filter(({name}) => {self.expression(test)})" for test in first.ifs)
        inner = self.comprehension(value, rest) if rest else self.expression(value)
        return f"{over}.{'flatMap' if rest else 'map'}(({name}) => {inner})"

    def call(self, node: ast.Call) -> str:
        arguments = [self.expression(argument) for argument in node.args]
        match node.func:
            case ast.Name(id="len"):
                return f"{arguments[0]}.length"
            case ast.Name(id=name):
                return f"{CALLED.get(name, name)}({', '.join(arguments)})"
            case ast.Attribute(value=ast.Name(id="self"), attr=name):
                return f"{name}({', '.join(('self', *arguments))})"
            case ast.Attribute(value=value, attr="append"):
                return f"{self.expression(value)}.push({', '.join(arguments)})"
        raise TypeError(f"line {node.lineno}: no call of {ast.unparse(node.func)} in scalar functions")


def _assigned(body: Sequence[ast.stmt]) -> set[str]:
    """The names that a function assigns, but those of its loops."""
    names: set[str] = set()
    for node in body:
        match node:
            case ast.Assign(targets=targets):
                names |= {leaf.id for target in targets for leaf in _parts(target) if isinstance(leaf, ast.Name)}
            case ast.AugAssign(target=ast.Name(id=name)):
                names.add(name)
            case ast.For(body=inner) | ast.If(body=inner):
                names |= _assigned(inner) | _assigned(node.orelse)
    return names


def _parts(target: ast.expr) -> list[ast.expr]:
    return [leaf for part in target.elts for leaf in _parts(part)] if isinstance(target, ast.Tuple) else [target]
