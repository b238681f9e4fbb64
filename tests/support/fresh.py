"""A process that has loaded nothing yet, on a machine of which a test says what is installed and what is kept."""

from __future__ import annotations

import sys
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import pytest

from nonlinear.integration import readiness, taylor
from nonlinear.integration.readiness import Note


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
        self.patch.setattr(readiness, "_ready", set())
        self.patch.setattr(readiness, "_saved_seconds", defaultdict(float))
        self.patch.setenv("NUMBA_CACHE_DIR", str(self.home))
        self.install("numba", "heyoka")

    def install(self, *names: str) -> None:
        """Have these packages and no others."""
        self.patch.setattr(readiness, "has_package", lambda name: name in names)
        self.patch.setattr(taylor, "available", lambda: "heyoka" in names)

    def load(self, name: str, **more: object) -> None:
        """Have loaded a module with such functions."""
        self.patch.setitem(sys.modules, name, SimpleNamespace(**more))

    def ready(self, *names: str) -> None:
        """Have loaded code of these names."""
        self.patch.setattr(readiness, "_ready", set(names))

    def keep(self, name: str, package: str = "numba") -> Path:
        """Have noted that a package keeps code of this name, in a file."""
        file = self.home / "kept"
        file.touch()
        Note(kept=str(file)).write(readiness._note_name(package, name))
        return file
