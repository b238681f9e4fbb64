"""A process that has loaded nothing yet, on a machine of which a test says what is installed and what is kept."""

from __future__ import annotations

import sys
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import pytest

from nonlinear.integration import readiness, taylor


@dataclass
class Process:
    """At first both extras are installed and nothing is kept."""

    patch: pytest.MonkeyPatch
    home: Path

    def __post_init__(self) -> None:
        for name in ("numba", "heyoka", "nonlinear.integration.compiled"):
            self.patch.delitem(sys.modules, name, raising=False)
        for name in [name for name in sys.modules if name.startswith("lanes_")]:
            self.patch.delitem(sys.modules, name)
        self.patch.setattr(readiness, "_made", set())
        self.patch.setattr(readiness, "_saved", defaultdict(float))
        self.patch.setenv("NUMBA_CACHE_DIR", str(self.home))
        self.install("numba", "heyoka")

    def install(self, *names: str) -> None:
        """Have these packages and no others."""
        self.patch.setattr(readiness, "installed", lambda name: name in names)
        self.patch.setattr(taylor, "available", lambda: "heyoka" in names)

    def load(self, name: str, **more: object) -> None:
        """Have loaded a module with such functions."""
        self.patch.setitem(sys.modules, name, SimpleNamespace(**more))

    def keep(self, module: str, function: str) -> Path:
        """Have kept a function of a module of a package that numba has compiled."""
        package, _, name = module.rpartition(".")
        file = self.home / f"{package.rpartition('.')[2]}_0" / f"{name}.{function}-1.py3.nbi"
        file.parent.mkdir(exist_ok=True)
        file.touch()
        return file
