"""The damping of each mode in words: what survives, and what drives feed."""

from __future__ import annotations

from collections.abc import Iterator
from math import isfinite

from modal.coupling.analysis import Coupling
from modal.coupling.damping import Damped
from modal.coupling.words import NEGLIGIBLE
from modal.modes.dissipation import stop_words
from modal.report import capital, rad, short

MOST_DAMPED = 12
LET_GO_DEG = 10.0
"""Largest angle from which the report lets modes go that dry friction stops."""
OFF = 0.1
"""Relative difference of the exact rate from first order that is mentioned."""


def damping(coupling: Coupling) -> Iterator[str]:
    """Sentences about every mode, about the survivors, and about a drive."""
    yield from map(capital, stop_words(coupling.scene, LET_GO_DEG)[:MOST_DAMPED])
    if not (coupling.scene.has_damping or coupling.scene.is_driven):
        rubbed = coupling.scene.has_friction or coupling.scene.has_drag
        kept = "in the linear scene every mode keeps its amplitude" if rubbed else "every mode keeps its amplitude"
        yield f"Nothing {'else ' if rubbed else ''}dissipates energy [D = 0]: {kept}."
        return
    modes = coupling.damped
    yield from (_mode(coupling, mode) for mode in modes[:MOST_DAMPED] if coupling.scene.has_damping)
    if len(modes) > MOST_DAMPED:
        yield f"{len(modes) - MOST_DAMPED} more modes are in the JSON form."
    if not modes:
        yield "No mode of finite frequency is left to be damped [m_dyn(∞) = 0]."
        return
    if all(mode.exact is None for mode in modes):
        yield "The damped eigenvalues themselves cannot be computed for this scene: all rates are those of first order."
    if coupling.scene.is_driven:
        yield from _own_drives(coupling, modes)
        return
    yield from _survivors(coupling, modes)
    yield from _drive(coupling, modes)


def _named(coupling: Coupling, mode: Damped) -> str:
    """A mode by its frequency and the moving parts."""
    whose = f", {mode.kind}" if mode.kind else ""
    number = coupling.number(mode.omega)
    name = "the mode" if number is None else f"mode {number}"
    if coupling.scene.is_structured and not coupling.reduced.d:
        return f"{name} at {rad(mode.omega)}" + (f" ({mode.kind})" if mode.kind else "")
    what = "structure" if coupling.scene.is_structured else "cart"
    return f"{name} at {rad(mode.omega)} ({what} {'still' if mode.still else 'moves'}{whose})"


def _mode(coupling: Coupling, mode: Damped) -> str:
    carrier = "the cart's damper [c_c φ_x²/2φᵀMφ]"
    if coupling.scene.is_structured:
        carrier = "the dampers of the structure and its springs [ηᵀD_sη/2φᵀMφ]"
    first = (
        f"{capital(_named(coupling, mode))}: damping ratio {short(mode.ratio)} [σ/ω], rate {short(mode.rate)} 1/s "
        f"[σ = φᵀDφ/2φᵀMφ], {short(mode.from_cart)} of it from {carrier} and "
        f"{short(mode.from_joints)} from the joints [Σ d_i(θ_i − θ_i−1)²/2φᵀMφ]"
        + (f", {short(mode.from_drag)} from drag [Σ drag_k(h_kᵀφ)²/2φᵀMφ]" if mode.from_drag else "")
        + (f", {short(mode.from_ratio)} from the damping ratio [ζω]" if mode.from_ratio else "")
    )
    if mode.exact is None:
        return first + "."
    kind = f"damping ratio {short(mode.decay / abs(mode.exact))} [−Re λ/|λ|]" if mode.exact.imag else "overdamped"
    off = "" if _is_first_order(mode) else "; first order no longer holds"
    return f"{first}; the damped scene itself: {kind}, rate {short(mode.decay)} 1/s [−Re λ]{off}."


def _is_first_order(mode: Damped) -> bool:
    return abs(mode.decay - mode.rate) <= OFF * mode.rate


def _survivors(coupling: Coupling, modes: tuple[Damped, ...]) -> Iterator[str]:
    last, first = (choose(modes, key=lambda mode: mode.decay) for choose in (min, max))
    what = "structure" if coupling.scene.is_structured else "cart"
    most = NEGLIGIBLE * max(mode.rate for mode in modes)
    spared = [mode for mode in modes if mode.decay <= NEGLIGIBLE * first.decay and mode.rate <= most]
    if spared:
        each = "; ".join(_named(coupling, mode) for mode in spared[:MOST_DAMPED])
        rest = f"; and {len(spared) - MOST_DAMPED} more" if len(spared) > MOST_DAMPED else ""
        yield f"Not damped at all [σ = 0]: {each}{rest}. In the end only these swing."
        if first.from_cart and all(mode.still for mode in spared):
            yield f"What leaves the {what} still survives a damper on it: antiphase, as Huygens saw."
    elif last.decay <= 0:
        yield (
            f"The slowest to decay is {_named(coupling, last)}: its rate is beyond double precision beside that of "
            f"{_named(coupling, first)}."
        )
    elif last.decay < first.decay:
        formula = "1/σ" if last.exact is None else "−1/Re λ"
        yield (
            f"The slowest to decay is {_named(coupling, last)}: it falls to 1/e in {short(1 / last.decay)} s "
            f"[{formula}], {short(first.decay / last.decay)} times as long as the fastest, {_named(coupling, first)}."
        )


def _own_drives(coupling: Coupling, modes: tuple[Damped, ...]) -> Iterator[str]:
    """The effect of the scene's van der Pol torques; the kicks of escapements have no rate at equilibrium."""
    fed = [mode for mode in modes if mode.from_drives]
    for mode in fed[:MOST_DAMPED]:
        net = mode.from_drives - mode.decay
        fate = "it grows from rest" if net > 0 else "it dies out nevertheless"
        feed = "[Σ e_i(θ_i − θ_i−1)²/2φᵀMφ]"
        words = f"The drives feed {_named(coupling, mode)} with {short(mode.from_drives)} 1/s {feed}"
        yield f"{words}: {fate}, net {short(net)} 1/s."
    yield "Linear modes cannot tell which mode wins at large angles; `sync` can."


def _drive(coupling: Coupling, modes: tuple[Damped, ...]) -> Iterator[str]:
    reached = [mode for mode in modes if isfinite(mode.threshold)]
    if not reached or not all(map(_is_first_order, modes)):
        return
    first = min(reached, key=lambda mode: mode.threshold)
    yield (
        f"A drive that gives every pendulum the torque e θ_1' at its pivot starts {_named(coupling, first)} first, "
        f"from e = {first.threshold:.4g} N m s/rad on [σ/F, F = Σθ_1²/2φᵀMφ = {short(first.fed)} 1/(kg m²)]. Linear "
        "modes cannot tell which one wins at large angles."
    )
