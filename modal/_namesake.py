"""The Modal cloud client also installs an import package called `modal`; only one of the two can be there."""

import sys
import warnings
from collections.abc import Iterable
from pathlib import Path

MESSAGE = (
    "the distribution 'modal' (the Modal cloud client) is installed beside 'multipendula' in {place}; both own the "
    "import name 'modal' and overwrite each other's files: give each its own virtual environment"
)


def warn_about_namesake(search: Iterable[str] | None = None) -> None:
    """Warn if a distribution called exactly `modal` is installed on the import path."""
    for place in sys.path if search is None else search:
        if place and any(Path(place).glob("modal-*.dist-info")):
            warnings.warn(MESSAGE.format(place=place), UserWarning, stacklevel=3)
            return
