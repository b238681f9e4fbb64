"""The exchange of energy between pendula in words: a sentence about each pair of modes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from modal.coupling.analysis import Coupling
from modal.coupling.exchange import MOST_MODES, STRONG, EnergyExchange
from modal.coupling.wording import ELSEWHERE, GUIDE, MOST_LISTED, ROUGH, left, member, numbered
from modal.report import capital, listed, percent, rad, short

HALF = 0.5


def exchanges(coupling: Coupling) -> Iterator[str]:
    """A sentence about each pair of modes of different pendula, or about all of them where there are many."""
    if len(coupling.names) == 1 or not coupling.on_cart:
        return
    if len(coupling.fixed_base.omega) > MOST_MODES:
        yield from _many(coupling)
        return
    yield from (_pair(coupling, pair) for pair in coupling.pairs[:MOST_LISTED])
    if not coupling.pairs:
        yield (
            "Only the inertia of the pendula opposes them [m = 0]: they move together and exchange no energy in beats."
        )
    elif (left := len(coupling.pairs) - MOST_LISTED) > 0:
        yield f"{left} more pairs are {ELSEWHERE}."


def _pair(coupling: Coupling, pair: EnergyExchange) -> str:
    modes = coupling.fixed_base
    a, b = (member(coupling, k) for k in (pair.first, pair.second))
    strength = max(float(modes.mass[k] * modes.count[k]) for k in (pair.first, pair.second)) / abs(pair.cart_mass)
    if strength > STRONG:
        return (
            f"{capital(a)} and {b} are coupled too strongly for beats between two [μ/|m| = {short(strength)}, "
            f"m = {short(pair.cart_mass)} kg]: their energy goes where the modes above carry it."
        )
    if not pair.alone:
        return (
            f"{capital(a)} and {b} are not alone: other modes, or the cart's spring, make the dynamic mass m of all "
            "else change between their frequencies [m(ω_a) ≠ m(ω_b)]; their energy goes where the modes above carry it."
        )
    overdamped = [capital(member(coupling, k)) for k in (pair.first, pair.second) if modes.rate[k] >= modes.omega[k]]
    if overdamped:
        return f"{listed(overdamped, len(overdamped))}: overdamped by its joints [σ ≥ ω], no beats."
    return (
        f"{capital(a)} and {b}: detuning {short(abs(pair.detuning))} rad/s [|δ|, δ = ω_a(1 + μ_a/2m) − "
        f"ω_b(1 + μ_b/2m)] against coupling {short(pair.coupling)} rad/s [g = √(μ_aμ_bω_aω_b)/2|m|, m = "
        f"{short(pair.cart_mass)} kg]: {_passed(pair)}{GUIDE if strength > ROUGH else ''}."
    )


def _passed(pair: EnergyExchange) -> str:
    """Whether they exchange energy, how much, and how much comes back."""
    passed, tuned = pair.exchange, abs(pair.detuning) < 2 * pair.coupling
    if passed.lossless:
        return (
            f"{'they exchange energy' if tuned else 'detuning suppresses the exchange'}. One passes at most "
            f"{percent(pair.share)} of its energy to the other [4g²/(4g² + δ²)] in beats of {short(pair.period)} s "
            "[2π/√(4g² + δ²)]"
        )
    verdict = (
        ("they exchange energy" if pair.share > HALF else "damping suppresses the exchange")
        if tuned
        else "detuning suppresses the exchange"
    )
    back = (
        f"after a beat of {short(pair.period)} s [π/Re Ω, Ω² = g² + δ²/4 with the dampers] at most {left(passed.left)} "
        "is back"
        if passed.beats
        else "nothing comes back in beats [Im Ω > Re Ω, Ω² = g² + δ²/4 with the dampers]"
    )
    return f"{verdict}. With the dampers the other never holds more than {left(pair.share)} of one's energy, and {back}"


def collective(coupling: Coupling) -> str:
    """One sentence on many different pendula that swing alike; empty where pairs are listed."""
    if len(coupling.fixed_base.omega) <= MOST_MODES or not coupling.on_cart:
        return ""
    _, spread, shift, _ = _together(coupling)
    if abs(shift) > spread:
        return "The cart shifts them together by more than they differ: one mode stands out."
    return "They differ by more than the cart shifts them: only neighbours in frequency exchange."


def _together(coupling: Coupling) -> tuple[float, float, float, float]:
    """Of first modes their median and their spread, their shift (rad/s) if they swing alike, and m (kg) of the rest."""
    modes, dynamic = coupling.fixed_base, coupling.dynamic
    first = modes.number == 1
    omega, mass = modes.omega[first], float((modes.mass * modes.count)[first].sum())
    middle, spread = float(np.median(omega)), float(np.ptp(omega))
    left_out = np.isin(np.arange(len(dynamic.omega)), coupling.pole[first])
    rest = float(dynamic([middle], left_out=left_out[None])[0])
    return middle, spread, middle * mass / (2 * rest) if rest else float("inf"), rest


def _many(coupling: Coupling) -> Iterator[str]:
    """The first modes of many different pendula: their spread against their collective coupling."""
    modes = coupling.fixed_base
    middle, spread, shift, rest = _together(coupling)
    count = int(np.sum(modes.number == 1))
    yield (
        f"{len(modes.omega)} modes of {len(coupling.names)} kinds are too many to list in pairs. Their first modes "
        f"spread over {short(spread)} rad/s [max ω_r − min ω_r] about {rad(middle)} [median], "
        f"{short(spread / max(1, count - 1))} rad/s from one to the next in the mean; swinging alike they would "
        f"be shifted by {short(shift)} rad/s [½ ω Σμ/m, m = {short(rest)} kg]."
    )
    yield (
        "The shift is the larger: one mode in which they swing together stands out from the others."
        if abs(shift) > spread
        else "The spread is the larger: neighbours in frequency exchange energy, those far apart do not."
    )
    top = max(coupling.cart_modes, key=lambda mode: mode.participation)
    yield (
        f"The mode that moves the cart most, at {rad(top.omega)}{numbered(coupling, top.omega)}, has "
        f"{percent(top.participation)} of its velocity after a push [φ_x²/Σφ_x²]."
    )
