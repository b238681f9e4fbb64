"""Self-excitation at a joint, as a scene file says it: what keeps a clock or a metronome going.

Both act on the angle γ of a link to the one above, counted from the rest (at a top joint: to the vertical), and with
opposite sign on the link above.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from modal.scene.validation import Checked, Positive

Acute = Annotated[float, Field(strict=True, ge=0, lt=180)]
Turn = Annotated[float, Field(strict=True, ge=1e-6, le=180)]


class VanDerPol(Checked):
    """The torque e (1 − (γ/γ₀)²) γ': feeds within γ₀ and drains beyond.

    `strength` e (N m s/rad), `angle_deg` γ₀ (Pantaleone, Am. J. Phys. 70, 992 (2002), equation (1)).  Alone on a
    lightly driven pendulum it keeps the amplitude 2 γ₀, beside a damper d at the same joint 2 γ₀ √(1 − d/e).
    """

    kind: Literal["van-der-pol"] = "van-der-pol"
    strength: Positive
    angle_deg: Turn


class Escapement(Checked):
    """A kick `impulse` (N m s) along the swing each time that |γ| passes `angle_deg` on its way out.

    Kicks alternate between the two sides, as the pallets of an anchor do; a swing that stays within the angle gets
    none (Bennett, Schatz, Rockwood & Wiesenfeld, Proc. R. Soc. A 458, 563 (2002), §4).
    """

    kind: Literal["escapement"] = "escapement"
    impulse: Positive
    angle_deg: Acute = 0.0


Drive = Annotated[VanDerPol | Escapement, Field(discriminator="kind")]
