"""Kicks of escapements as torques in step with the swing: describing functions.

A kick P at the angle a of a joint that swings with the complex amplitude Γ, |Γ| > a, has the mean

    (2 P ω/π) e^{iα} Γ/|Γ|,     cos α = a/|Γ|,     Γ = Σ γ_r z_r,     ω = Re(Σ ω_r γ_r z_r/Γ),

the first harmonic of two kicks a period, ω being the rate at which the phase of the joint turns (Gelb & Vander Velde,
Multiple-Input Describing Functions, 1968, ch. 2 and 5).  Of several bands of frequencies the one that swings the joint
most has this Γ; the others shift a, and with it α, and add their speed to |Γ| ω sin α.

Arrays are over B bands, J joints and S states: `swing` Σ γ_r z_r and `speed` Σ ω_r γ_r z_r of every band (B, J, S),
`impulse` and `angle` (J,).
"""

from __future__ import annotations

import numpy as np

from modal.rig import Booleans, Complexes, Floats

GRAZING = 0.1  # least sin α
NONE = 1e-100


def pulls(impulse: Floats, angle: Floats, swing: Complexes, speed: Complexes, phases: Complexes) -> Complexes:
    """First harmonics of the torques (B, J, S), as means over the phases e^{iχ} (B, K) of all but the leading bands."""
    first = _leading(swing)
    own, fast = (np.where(first, values, 0.0).sum(axis=0) for values in (swing, speed))
    size = np.maximum(np.abs(own), NONE)[..., None]
    turn = phases[:, None, None]
    aside, speeding = ((np.where(first, 0.0, v)[..., None] * turn).sum(axis=0).real for v in (swing, 1j * speed))
    cosine = (angle[:, None, None] - aside) / size
    sine = np.sqrt(np.maximum(1 - cosine**2, GRAZING**2))
    rate = np.real(fast * own.conj())[..., None] / size**2 + speeding / (size * sine)
    often = np.where(np.abs(cosine) < 1, np.maximum(rate, 0.0), 0.0)
    lead = np.mean(often * (cosine + 1j * sine), axis=-1) * own / size[..., 0]
    rest = np.mean(often * turn.conj(), axis=-1)
    return np.asarray(2 / np.pi * impulse[:, None] * np.where(first, lead, rest))


def mixed(angle: Floats, swing: Complexes, speed: Complexes) -> float:
    """The largest speed of the other bands beside the leading one's where it kicks.

    From 1 on a joint may come by twice on one side, and is kicked but once.
    """
    first, size, fast = _leading(swing), np.abs(swing).max(axis=0), np.abs(speed)
    room = np.maximum(1 - (angle[:, None] / np.maximum(size, NONE)) ** 2, 0.0)
    own, rest = (np.where(chosen, fast, 0.0).sum(axis=0) for chosen in (first, ~first))
    kicked = room > 0
    return float(np.max(rest[kicked] / (own[kicked] * np.sqrt(room[kicked])), initial=0.0))


def _leading(swing: Complexes) -> Booleans:
    """Which band swings each joint most, (B, J, S)."""
    return np.asarray(np.arange(len(swing))[:, None, None] == np.abs(swing).argmax(axis=0))
