"""Describing functions of escapements and of dry friction: torques synchronous with the oscillation.

A kick P at the angle a of a joint that swings with the complex amplitude Γ at the rate Ω, |Γ| > a, has the harmonics

    T_h = (2 P Ω/π) (e^{iα} Γ/|Γ|)^h,     cos α = (a + P κ/2πΩ)/|Γ|,     h = 1, 3, 5, …

of two kicks per period [Gelb1968, ch. 2 and 5].  A kick leaves a
corner in the oscillation.  With κ = Σ γ_r², the inverse of the inertia at the joint, the harmonics from the
third on add up to −2 P κ/πΩ · Σ 1/(h² − 1) = −P κ/2πΩ at the kick, if all modes oscillate at about Ω: the first
harmonic has to reach that far beyond a.  Among several frequency bands Γ is that of the band that swings the joint
most; the others shift a, and with it α, and add their speed to Ω|Γ| sin α.

Dry friction −M sign γ' depends on the velocity alone.  With γ' = V cos ψ + v, v that of the other bands, ρ = v/V and
cos β = −ρ, its harmonics in ψ and its mean over ψ are

    −(4M/πh) sin hβ cos hψ,        −(2M/π) arcsin ρ,

so that, of one frequency, the first is −(4M/π) cos ψ whatever V is, and next to it a weaker one is damped in proportion
to its own velocity (dither: Gelb & Vander Velde, ch. 6). This is exact as long as the joint slides.

Arrays are over B bands, J joints and S states: `swing` Γ of every band (B, J, S), `turning` Ω (B, S), `impulse` and
`angle` (J,), the `corner` Pκ/2π (J, S).
"""

from __future__ import annotations

import numpy as np

from modal.types import Booleans, Complexes, Floats

KICK_SINE_MIN = 0.1
"""Physics: least sin α: the describing function is singular where the swing only grazes the angle [Gelb1968]."""
KICK_CORNER_MAX = 0.2
"""Physics: largest corner of a kick over |Γ|, which is a small addition to a harmonic [Gelb1968, ch. 2]."""
AMPLITUDE_FLOOR = 1e-100
"""Format: below any amplitude, so that nothing is divided by 0, and the square of its inverse is finite."""


def pulls(
    impulse: Floats, angle: Floats, corner: Floats, swing: Complexes, turning: Floats, phases: Complexes
) -> tuple[Complexes, Complexes]:
    """First and third harmonics of the torques (B, J, S), as means over the phases e^{iχ} (B, K) of the other bands."""
    if len(swing) == 1:
        return _single_band_pulls(impulse, angle, corner, swing, turning)
    first = _leading(swing)
    leading, rate = (np.where(first, values, 0.0).sum(axis=0) for values in (swing, turning[:, None]))
    size = np.maximum(np.abs(leading), AMPLITUDE_FLOOR)[..., None]
    turn = phases[:, None, None]
    rest = np.where(first, 0.0, swing)
    aside, speeding = (np.sum(v[..., None] * turn, axis=0).real for v in (rest, 1j * turning[:, None] * rest))
    within = np.minimum((corner / rate)[..., None], KICK_CORNER_MAX * size)
    cosine = (angle[:, None, None] + within - aside) / size
    sine = np.sqrt(np.maximum(1 - cosine**2, KICK_SINE_MIN**2))
    often = np.where(np.abs(cosine) < 1, np.maximum(rate[..., None] + speeding / (size * sine), 0.0), 0.0)
    lead_phase, scale = (cosine + 1j * sine) * leading[..., None] / size, 2 / np.pi * impulse[:, None]
    lead, third = (np.mean(often * lead_phase**harmonic, axis=-1) for harmonic in (1, 3))
    others = np.mean(often * turn.conj(), axis=-1)
    return np.asarray(scale * np.where(first, lead, others)), np.asarray(scale * np.where(first, third, 0.0))


def _single_band_pulls(
    impulse: Floats, angle: Floats, corner: Floats, swing: Complexes, turning: Floats
) -> tuple[Complexes, Complexes]:
    """The same of one band, where no other shifts the kicks: in a third of the time for few pendula."""
    size, rate = np.maximum(np.abs(swing), AMPLITUDE_FLOOR), turning[:, None]
    cosine = (angle[:, None] + np.minimum(corner / rate, KICK_CORNER_MAX * size)) / size
    sine = np.sqrt(np.maximum(1 - cosine**2, KICK_SINE_MIN**2))
    lead_phase = (cosine + 1j * sine) * swing / size
    lead = 2 / np.pi * impulse[:, None] * np.where(np.abs(cosine) < 1, rate, 0.0) * lead_phase
    return lead, lead * lead_phase**2


def rubbing_torques(limit: Floats, swing: Complexes, turning: Floats, phases: Complexes) -> tuple[Complexes, Complexes]:
    """First and third harmonics of dry friction (B, J, S) with the limits M (J,), as means over the other phases."""
    speed = 1j * turning[:, None] * swing
    first = _leading(speed)
    leading = np.where(first, speed, 0.0).sum(axis=0)
    size = np.maximum(np.abs(leading), AMPLITUDE_FLOOR)
    turn = phases[:, None, None]
    aside = np.sum(np.where(first, 0.0, speed)[..., None] * turn, axis=0).real
    share = np.clip(aside / size[..., None], -1.0, 1.0)
    sine = np.sqrt(1 - share**2)
    lead_phase = leading / size
    lead = 4 / np.pi * np.mean(sine, axis=-1) * lead_phase
    third = 4 / (3 * np.pi) * np.mean(3 * sine - 4 * sine**3, axis=-1) * lead_phase**3
    others = 4 / np.pi * np.mean(np.arcsin(share) * turn.conj(), axis=-1)
    torque = -limit[:, None]
    return np.asarray(torque * np.where(first, lead, others)), np.asarray(torque * np.where(first, third, 0.0))


def mixing_ratio(angle: Floats, swing: Complexes, turning: Floats) -> float:
    """The largest speed of the other bands over the leading band's when that kicks.

    From 1 on a joint may pass the angle twice on one side but is kicked only once.
    """
    first, size = _leading(swing), np.abs(swing).max(axis=0)
    fast = turning[:, None] * np.abs(swing)
    room = np.maximum(1 - (angle[:, None] / np.maximum(size, AMPLITUDE_FLOOR)) ** 2, 0.0)
    leading, rest = (np.where(chosen, fast, 0.0).sum(axis=0) for chosen in (first, ~first))
    has_kick = room > 0
    return float(np.max(rest[has_kick] / (leading[has_kick] * np.sqrt(room[has_kick])), initial=0.0))


def _leading(swing: Complexes) -> Booleans:
    """Which band swings each joint most, (B, J, S)."""
    return np.asarray(np.arange(len(swing))[:, None, None] == np.abs(swing).argmax(axis=0))
