"""What responses to every kind of support motion have in common: the modal form that they are sums over."""

from __future__ import annotations

from dataclasses import dataclass

from modal.modes import Modes
from modal.report import Displayed
from modal.statespace import ModalForm
from modal.statespace.signals import Signal


@dataclass(frozen=True, eq=False, repr=False)
class ModalResponse(Displayed):
    """The response of p outputs, as a sum over the modes of `form`."""

    form: ModalForm

    @property
    def modes(self) -> Modes:
        """The modes of the scene."""
        return self.form.modes

    @property
    def outputs(self) -> tuple[Signal, ...]:
        """The outputs."""
        return self.form.model.outputs
