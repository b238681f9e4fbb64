"""Names of a package that are loaded on first use, so that help and shell completion do not wait for NumPy."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def lazy_attributes(
    package: str, homes: tuple[str, ...], later: Mapping[str, str] | None = None
) -> Callable[[str], Any]:
    """The `__getattr__` of a package: it loads the names in `__all__` from its modules `homes`, and these modules.

    The names in `later`, each with its module, need SciPy: `import *` leaves them out.  `dir` shows all these names.
    """

    def find(name: str) -> Any:
        offering = sys.modules[package]
        if name in homes:
            return import_module(f"{package}.{name}")
        if name in offering.__all__:
            return next(getattr(module, name) for module in map(find, homes) if hasattr(module, name))
        if later and name in later:
            return getattr(import_module(f"{package}.{later[name]}"), name)
        raise AttributeError(f"module {package!r} has no attribute {name!r}", name=name, obj=offering)

    def names() -> list[str]:
        return sorted({*sys.modules[package].__all__, *(later or ())})

    vars(sys.modules[package])["__dir__"] = names
    return find
