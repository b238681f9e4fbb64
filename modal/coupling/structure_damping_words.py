"""The damping of a structure with pendula in words: every mode, what survives, and what drives feed."""

from __future__ import annotations

from collections.abc import Iterator

from modal.coupling.damping import Damped
from modal.coupling.structures import StructureCoupling
from modal.coupling.wording import MOST_LISTED
from modal.report import capital, listed, rad, short

NEGLIGIBLE = 1e-12


def damping(coupling: StructureCoupling) -> Iterator[str]:
    """Sentences about every mode, about the survivors, and about drives."""
    scene = coupling.scene
    if not (scene.has_damping or scene.is_driven):
        yield "Nothing dissipates energy [D = 0]: in the linear scene every mode keeps its amplitude."
        return
    modes = coupling.damped
    for mode in modes[:MOST_LISTED] if scene.has_damping else ():
        yield _damped(coupling, mode)
    if len(modes) > MOST_LISTED and scene.has_damping:
        yield f"{len(modes) - MOST_LISTED} more modes are in the JSON form."
    if scene.has_damping and modes and not scene.is_driven:
        last, first = (choose(modes, key=lambda mode: mode.decay) for choose in (min, max))
        spared = [mode for mode in modes if mode.decay <= NEGLIGIBLE * first.decay]
        if spared:
            names = [_named(coupling, mode) for mode in spared[:MOST_LISTED]]
            yield f"Not damped at all [σ = 0]: {listed(names, len(spared))}. In the end only these swing."
        elif last.decay < first.decay:
            yield (
                f"The slowest to decay is {_named(coupling, last)}: it falls to 1/e in {short(1 / last.decay)} s, "
                f"{short(first.decay / last.decay)} times as long as the fastest, {_named(coupling, first)}."
            )
    for mode in [mode for mode in modes if mode.from_drives][:MOST_LISTED]:
        net = mode.from_drives - mode.decay
        yield (
            f"The drives feed {_named(coupling, mode)} with {short(mode.from_drives)} 1/s "
            f"[Σ e_i(θ_i − θ_i−1)²/2φᵀMφ]: {'it grows from rest' if net > 0 else 'it dies out nevertheless'}, "
            f"net {short(net)} 1/s."
        )
    if scene.is_driven:
        yield "Linear modes cannot tell which mode wins at large angles; `sync` can."


def _named(coupling: StructureCoupling, mode: Damped) -> str:
    number = coupling.number(mode.omega)
    whose = f", {mode.kind} in antiphase" if mode.kind else ""
    still = "still" if mode.still else "moves"
    moves = f" (structure {still}{whose})" if coupling.reduced.d else f" ({mode.kind} in antiphase)" if whose else ""
    return f"{'the mode' if number is None else f'mode {number}'} at {rad(mode.omega)}{moves}"


def _damped(coupling: StructureCoupling, mode: Damped) -> str:
    parts = [
        (mode.from_cart, "from the dampers of the structure and its springs"),
        (mode.from_joints, "from the joints"),
        (mode.from_drag, "from drag"),
        (mode.from_ratio, "from the damping ratio [ζω]"),
    ]
    each = [f"{short(value)} {where}" for value, where in parts if value > NEGLIGIBLE * mode.rate]
    first = (
        f"{capital(_named(coupling, mode))}: damping ratio {short(mode.ratio)} [σ/ω], rate {short(mode.rate)} 1/s "
        f"[σ = φᵀDφ/2φᵀMφ]{', ' + listed(each, len(each)) if each else ''}"
    )
    if mode.exact is None:
        return f"{first}."
    kind = f"damping ratio {short(mode.decay / abs(mode.exact))}" if mode.exact.imag else "overdamped"
    return f"{first}; the damped scene itself: {kind}, rate {short(mode.decay)} 1/s [−Re λ]."
