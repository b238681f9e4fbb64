"""Warnings about another distribution called `modal`, whose package overwrites this one."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterable
from pathlib import Path

NAMESAKE = (
    "the distribution 'modal' (the Modal cloud client) is installed next to 'multipendula' in {place}; both own the "
    "import name 'modal' and overwrite each other's files: give each its own virtual environment"
)
OVERWRITTEN = (
    "the package 'modal' in {place} does not belong to multipendula or is incomplete: the Modal cloud client, whose "
    "distribution is also called 'modal', has overwritten or removed its files; give each its own virtual "
    "environment, or repair this one: pip uninstall modal multipendula, then install multipendula again"
)


def warn_about_namesake(search: Iterable[str] | None = None) -> None:
    """Warn if the Modal cloud client is installed on the import path, which overwrites this package."""
    for place in sys.path if search is None else search:
        if place and any(Path(place).glob("modal-*.dist-info")):
            warnings.warn(NAMESAKE.format(place=place), UserWarning, stacklevel=3)
            return


def require_own_package() -> None:
    """Raise ImportError, with the remedy, unless the imported package `modal` is that of multipendula."""
    package = sys.modules["modal"]
    spec = package.__spec__
    read_data = getattr(spec and spec.loader, "get_data", None)
    if not (spec and spec.origin and read_data and b"natural_modes" in read_data(spec.origin)):
        raise ImportError(OVERWRITTEN.format(place=next(iter(package.__path__), "")))
