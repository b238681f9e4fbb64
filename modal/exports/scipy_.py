"""SciPy: the model as its own class, which knows no names."""

from __future__ import annotations

from typing import Any

from scipy.signal import StateSpace as Continuous
from scipy.signal import dlti

from modal.statespace import StateSpace


def to_scipy(model: StateSpace) -> Any:
    """The `scipy.signal.StateSpace`, a `dlti` for a discrete model."""
    parts = model.A, model.B, model.C, model.D
    return dlti(*parts, dt=model.dt) if model.dt else Continuous(*parts)
