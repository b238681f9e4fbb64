"""Names of a package that are loaded on first use, so that help and shell completion do not wait for NumPy."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from functools import cache
from importlib import import_module
from typing import Any

IMPORT = re.compile(r"^    from (\S+) import (\([^)]*\)|.*)", re.MULTILINE)
"""An import of those that a package has for type checkers alone."""


def lazy_attributes(package: str) -> Callable[[str], Any]:
    """Return the `__getattr__` of a package, which loads a name from the module that type checkers import it from.

    It covers the names in `__all__`, further names of modules that need SciPy and that `import *` omits, and these
    modules. `dir` shows all these names. A package of internal names has no `__all__`: its imports list them.
    """

    def find(name: str) -> Any:
        homes = homes_of(package)
        if name == "__all__":
            return sorted(homes)
        if name in homes:
            return getattr(import_module(homes[name]), name)
        if f"{package}.{name}" in homes.values():
            return import_module(f"{package}.{name}")
        raise AttributeError(f"module {package!r} has no attribute {name!r}", name=name, obj=sys.modules[package])

    def names() -> list[str]:
        return sorted({*sys.modules[package].__all__, *homes_of(package)})

    vars(sys.modules[package])["__dir__"] = names
    return find


@cache
def homes_of(package: str) -> dict[str, str]:
    """The names that a package loads on first use, each with its module."""
    offering = sys.modules[package]
    with open(str(offering.__file__), encoding="utf-8") as source:
        imports = IMPORT.findall(source.read())
    homes = {name: home for home, names in imports for name in re.findall(r"\w+", names.partition(" as ")[0])}
    names = vars(offering).get("__all__", homes)
    return {name: home for name, home in homes.items() if name in names or home.startswith(f"{package}.")}
