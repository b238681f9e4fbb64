"""The namespace for editors and type checkers: `python docs/namespace.py` makes `multipendula/__init__.pyi`.

Functions have the signatures that they have when they are called, made from the table of options.  One that ends in one
class of results is said to return it (or anything: a text where that is asked for); any other returns anything.
"""

from __future__ import annotations

import ast
import inspect
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import multipendula
from multipendula.commands import NAMES

HOMES: dict[str, tuple[str, ...]] = vars(multipendula)["HOMES"]
STUB = Path(str(multipendula.__file__)).with_suffix(".pyi")
SIGNED = {
    **{"Mapping": "collections.abc", "Sequence": "collections.abc", "PathLike": "os", "Any": "typing"},
    **{"Text": "multipendula.functions", "Sweep": "nonlinear.sweeps"},
}
"""What signatures name, against what the namespace has."""
USUAL = {"export": "StateSpace", "load": "Scene", "simulate": "Trajectory"}
"""What functions return but for a hoist, for a saved run, and where a switch asks for another thing."""
STANDARD = ("collections", "os", "typing")


def stub() -> str:
    """The contents of the stub file."""
    exported = {name: home for home, names in HOMES.items() for name in names}
    functions = {name: group for group, names in NAMES.items() for name in names if name in dir(multipendula)}
    functions |= dict.fromkeys(HOMES["multipendula.functions"], "")
    results = {name: home for group in NAMES for name, home in _results(f"multipendula.commands.{group}")}
    written = [line for name in functions for line in _function(name)]
    text = "\n".join(written)
    named = {name: home for name, home in results.items() if name not in exported and f"> {name} | Any" in text}
    imports = [(home, name) for name, home in (named | SIGNED).items()]
    imports += [(home, f"{name} as {name}") for name, home in exported.items() if name not in functions]
    imports.sort(key=lambda line: (line[0].partition(".")[0] not in STANDARD, line))
    lines = [f"from {home} import {name}" for home, name in imports]
    first = next(at for at, (home, _) in enumerate(imports) if home.partition(".")[0] not in STANDARD)
    head = f'"""The namespace as type checkers see it; made by `python docs/{Path(__file__).name}`."""'
    return "\n".join([head, "", *lines[:first], "", *lines[first:], "", *written, ""])


def _results(module: str) -> Iterator[tuple[str, str]]:
    """The classes that a module of commands imports for annotations, and from where."""
    source = inspect.getsource(import_module(module))
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom) and node.module:
            yield from ((name.name, node.module) for name in node.names if name.name[:1].isupper())


def _function(name: str) -> Iterator[str]:
    """A function, a parameter on each line."""
    signature = inspect.signature(getattr(multipendula, name))
    yield f"def {name}("
    is_by_keyword = False
    for parameter in signature.parameters.values():
        if parameter.kind is parameter.KEYWORD_ONLY and not is_by_keyword:
            is_by_keyword = True
            yield "    *,"
        yield f"    {parameter},".replace("'", "") if parameter.default is parameter.empty else _defaulted(parameter)
    told = USUAL.get(name, str(signature.return_annotation).removesuffix(" | Text"))
    of_one = told if told in {"Text", "None"} else f"{told} | Any" if told.isidentifier() else "Any"
    yield f") -> {of_one}: ..."


def _defaulted(parameter: inspect.Parameter) -> str:
    default = f'"{parameter.default}"' if isinstance(parameter.default, str) else repr(parameter.default)
    return f"    {parameter.name}: {parameter.annotation} = {default},"


if __name__ == "__main__":
    STUB.write_text(stub(), encoding="utf-8")
