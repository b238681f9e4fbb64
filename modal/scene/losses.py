"""Loss angles: the complex stiffness k (1 + iφ) of a spring or a joint, and of a wire that gravity holds straight.

φ is one number for all frequencies, or a table of them; between two of its frequencies it is a straight line over
logarithmic axes (over linear ones where a number is 0), beyond them it is that of the nearest.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

from modal.scene.stored import Several
from modal.scene.validation import NON_NEGATIVE, Part, Schema, field, list_of, number


class LossTable(Part):
    """Loss angles (rad) at ascending frequencies (Hz).

    >>> from modal.scene import LossTable
    >>> LossTable(frequency_hz=[1.0, 100.0], loss=[1e-4, 1e-3]).loss
    (0.0001, 0.001)
    """

    frequency_hz: Several[float] = field(list_of(number(ge=0, le=1e100)))
    loss: Several[float] = field(list_of(NON_NEGATIVE))

    def problems(self) -> Iterator[str]:
        """Lists that do not fit each other, frequencies that do not ascend."""
        if len(self.frequency_hz) != len(self.loss):
            yield f".loss: has {len(self.loss)} values for {len(self.frequency_hz)} frequencies"
        elif not self.loss:
            yield ".loss: must not be empty"
        if any(later <= earlier for earlier, later in pairwise(self.frequency_hz)):
            yield ".frequency_hz: must be strictly ascending"


Loss = float | LossTable
"""A loss angle at all frequencies, or a table."""
NUMBER, TABLE = "(number)", "(table)"
"""Steps that the validator adds to the place of a loss angle."""


def _which(value: Any) -> str:
    return TABLE if isinstance(value, dict | LossTable) else NUMBER


LOSS_ANGLE: Schema = {
    "type": "tagged-union",
    "choices": {NUMBER: NON_NEGATIVE, TABLE: LossTable.schema()},
    "discriminator": _which,
}
"""A number of at least 0, or a table over frequency."""


def is_lossy(loss: Loss) -> bool:
    """Whether a loss angle is not 0 at some frequency."""
    return any(loss.loss) if isinstance(loss, LossTable) else loss > 0
