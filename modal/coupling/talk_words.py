"""Which pendula exchange energy and which are kept apart, in words."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from modal.coupling.analysis import Coupling
from modal.coupling.exchange import MOST_MODES, STRONG, EnergyExchange
from modal.coupling.report import ELSEWHERE, GUIDE, MOST_LISTED, ROUGH, left, member, numbered
from modal.report import capital, listed, percent, rad, short

HALF = 0.5


def exchanges(coupling: Coupling) -> Iterator[str]:
    """A sentence about each pair of modes of different pendula, or about all of a crowd together."""
    if len(coupling.names) == 1 or not coupling.on_cart:
        return
    if len(coupling.own.omega) > MOST_MODES:
        yield from _crowd(coupling)
        return
    yield from (_pair(coupling, talk) for talk in coupling.talks[:MOST_LISTED])
    if not coupling.talks:
        yield "Nothing but the pendula resists them [m = 0]: they are tied together and exchange no energy in beats."
    elif (left := len(coupling.talks) - MOST_LISTED) > 0:
        yield f"{left} more pairs are {ELSEWHERE}."


def _pair(coupling: Coupling, talk: EnergyExchange) -> str:
    own = coupling.own
    a, b = (member(coupling, k) for k in (talk.first, talk.second))
    strength = max(float(own.mass[k] * own.count[k]) for k in (talk.first, talk.second)) / abs(talk.cart_mass)
    if strength > STRONG:
        return (
            f"{capital(a)} and {b} are coupled too strongly for beats between two [μ/|m| = {short(strength)}, "
            f"m = {short(talk.cart_mass)} kg]: their energy goes where the modes above carry it."
        )
    if not talk.alone:
        return (
            f"{capital(a)} and {b} are not alone: other modes, or the cart's spring, make the dynamic mass m of all "
            "else change between their frequencies [m(ω_a) ≠ m(ω_b)]; their energy goes where the modes above carry it."
        )
    creeping = [capital(member(coupling, k)) for k in (talk.first, talk.second) if own.rate[k] >= own.omega[k]]
    if creeping:
        return f"{listed(creeping, len(creeping))}: joint dampers let it creep back without a swing [σ ≥ ω], no beats."
    return (
        f"{capital(a)} and {b}: detuning {short(abs(talk.detuning))} rad/s [|δ|, δ = ω_a(1 + μ_a/2m) − "
        f"ω_b(1 + μ_b/2m)] against coupling {short(talk.coupling)} rad/s [g = √(μ_aμ_bω_aω_b)/2|m|, m = "
        f"{short(talk.cart_mass)} kg]: {_passed(talk)}{GUIDE if strength > ROUGH else ''}."
    )


def _passed(talk: EnergyExchange) -> str:
    """Whether they talk, what passes and what comes back."""
    passed, tuned = talk.exchange, abs(talk.detuning) < 2 * talk.coupling
    if passed.lossless:
        return (
            f"{'they talk' if tuned else 'detuning keeps them apart'}. One passes at most {percent(talk.share)} of its "
            f"energy to the other [4g²/(4g² + δ²)] in beats of {short(talk.period)} s [2π/√(4g² + δ²)]"
        )
    verdict = (
        ("they talk" if talk.share > HALF else "dampers keep them apart") if tuned else "detuning keeps them apart"
    )
    back = (
        f"after a beat of {short(talk.period)} s [π/Re Ω, Ω² = g² + δ²/4 with the dampers] at most {left(passed.left)} "
        "is back"
        if passed.beats
        else "nothing comes back in beats [Im Ω > Re Ω, Ω² = g² + δ²/4 with the dampers]"
    )
    return f"{verdict}. With the dampers the other never holds more than {left(talk.share)} of one's energy, and {back}"


def _crowd(coupling: Coupling) -> Iterator[str]:
    """The first modes of different pendula with many: their spread against their collective coupling."""
    own, dynamic = coupling.own, coupling.dynamic
    first = own.number == 1
    omega, mass = own.omega[first], float((own.mass * own.count)[first].sum())
    middle, spread = float(np.median(omega)), float(np.ptp(omega))
    left_out = np.isin(np.arange(len(dynamic.omega)), coupling.pole[first])
    rest = float(dynamic([middle], left_out=left_out[None])[0])
    shift = middle * mass / (2 * rest) if rest else float("inf")
    yield (
        f"{len(own.omega)} modes of {len(coupling.names)} kinds are too many to pair off. Their first modes spread "
        f"over {short(spread)} rad/s [max ω_r − min ω_r] about {rad(middle)} [median], "
        f"{short(spread / max(1, len(omega) - 1))} rad/s from one to the next in the mean; swinging alike they would "
        f"be shifted by {short(shift)} rad/s [½ ω Σμ/m, m = {short(rest)} kg]."
    )
    yield (
        "The shift is the larger: one mode in which they swing together stands out above the others."
        if abs(shift) > spread
        else "The spread is the larger: neighbours in frequency talk, those far apart do not."
    )
    top = max(coupling.cart_modes, key=lambda mode: mode.participation)
    yield (
        f"The mode that moves the cart most, at {rad(top.omega)}{numbered(coupling, top.omega)}, has "
        f"{percent(top.participation)} of its velocity after a push [φ_x²/Σφ_x²]."
    )
