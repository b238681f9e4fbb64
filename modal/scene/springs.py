"""Springs and dampers between two points of a scene, or between two angles."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

from modal.scene.losses import LOSS_ANGLE, Loss, is_lossy
from modal.scene.points import parse_point
from modal.scene.stored import Pair
from modal.scene.validation import NON_NEGATIVE, Part, after, field, one_of


def _end(text: str) -> str:
    parse_point(text)
    return text


END = after(_end, {"type": "str", "max_length": 200})


class Spring(Part):
    """A spring (N/m) and damper (N s/m) between two points (`modal.scene.points`), unstretched as drawn.

    With `kind = "torsion"` (N m/rad, N m s/rad) it acts between the angles of two links, or of a link and a carrier
    that turns, or the ground.  `loss` is the loss angle φ of the stiffness, k (1 + iφ).

    >>> from modal.scene import Spring
    >>> Spring(between=["pendulum[0].links[0]@0.5", "ground@1.0,0.5"], stiffness=5.0).kind
    'linear'
    """

    kind: Literal["linear", "torsion"] = field(one_of("linear", "torsion"), default="linear")
    between: Pair[str] = field({"type": "tuple", "items_schema": [END, END]})
    stiffness: float = field(NON_NEGATIVE, default=0.0)
    damping: float = field(NON_NEGATIVE, default=0.0)
    loss: Loss = field(LOSS_ANGLE, default=0.0)

    def problems(self) -> Iterator[str]:
        """The loss of no stiffness."""
        if is_lossy(self.loss) and not self.stiffness:
            yield ".loss: is that of the stiffness, which is 0: give a stiffness"
