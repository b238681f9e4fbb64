"""How many random scenes are tried: a sample every day, all of them with MULTIPENDULA_SCENES=all in the environment."""

from __future__ import annotations

import os
from typing import TypeVar

T = TypeVar("T")


def usually(sample: T, everything: T) -> T:
    """What is tried: the sample, or everything if it is asked for."""
    return everything if os.environ.get("MULTIPENDULA_SCENES") == "all" else sample
