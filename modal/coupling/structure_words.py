"""The coupling through a structure in words: its own modes, the families that they couple, exchange, damping."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import isfinite

import numpy as np

from modal.coupling.damping import Damped
from modal.coupling.exchange import MOST_MODES, STRONG
from modal.coupling.structures import Branch, Exchanged, PendulumFamily, StructureCoupling
from modal.modes import lettered
from modal.report import capital, counted, listed, percent, rad, short

MOST_LISTED = 8
SLIGHT = 1e-4
NEGLIGIBLE = 1e-12
NOUNS = {
    "tilt": ("board", "boards"),
    "heave": ("heaving support", "heaving supports"),
    "modal": ("structure", "structures"),
}


def structure_sections(coupling: StructureCoupling) -> Iterator[tuple[str, Iterator[str]]]:
    """The titles and sentences of the report."""
    yield "What hangs there", _scene(coupling)
    yield "The structure alone", _alone(coupling)
    yield "Families of modes", (_family(coupling, r, one) for r, one in _chosen(coupling.families))
    yield "Exchange of energy between pendula", _exchanges(coupling)
    yield "Damping by mode", _damping(coupling)
    yield "What this does not say", _unsaid(coupling)


def _chosen(families: Sequence[PendulumFamily]) -> Iterator[tuple[str, PendulumFamily]]:
    return ((lettered(r).upper(), one) for r, one in enumerate(families[:MOST_LISTED]))


def _nouns(kind: str) -> tuple[str, str]:
    """What one carrier is called, and several."""
    return NOUNS.get(kind, (kind, f"{kind}s"))


def _moved(coupling: StructureCoupling, branch: Branch) -> str:
    """What the structure does in a mode of the scene."""
    if branch.still:
        return "structure still" if coupling.reduced.d else ""
    return coupling.words(coupling.basis @ branch.motion)


def _numbered(coupling: StructureCoupling, omega: float) -> str:
    number = coupling.number(omega)
    return "" if number is None else f" (mode {number})"


def _member(coupling: StructureCoupling, k: int) -> str:
    own = coupling.own
    number = own.number[k]
    several = int(np.sum(own.kind == own.kind[k])) > 1
    return f"mode {number} of {coupling.names[own.kind[k]]}" if several else coupling.names[own.kind[k]]


# --------------------------------------------------------------------------------------------------------- sections


def _scene(coupling: StructureCoupling) -> Iterator[str]:
    scene, structure = coupling.scene, coupling.structure
    kinds = f" of {counted(len(coupling.names), 'kind', 'kinds')}" if scene.n_pendula > 1 else ""
    hanging = sum(float(block.mass.sum(0) @ block.count) for block in coupling.reduced.hanging.rig.blocks)
    what = (
        f"{counted(scene.n_pendula, 'pendulum', 'pendula')}{kinds}, {counted(scene.n_links, 'link', 'links')} and "
        f"{short(hanging)} kg in all, {'hangs' if scene.n_pendula == 1 else 'hang'}"
    )
    by_kind: dict[str, list[str]] = {}
    for own in structure.carriers:
        if own.size:
            by_kind.setdefault(own.kind, []).append(own.name)
    if not by_kind:
        yield f"{what} from a support that does not move: only springs between them couple them."
    else:
        each = [
            f"{counted(len(names), *_nouns(kind))}"
            + ("" if names == [kind] else f" ({listed(names[:MOST_LISTED], len(names))})")
            for kind, names in by_kind.items()
        ]
        named = [*structure.names[:MOST_LISTED], *["…"] * (structure.size > MOST_LISTED)]
        size = counted(structure.size, "coordinate", "coordinates")
        yield f"{what} from {listed(each, len(each))}: {size} [{', '.join(named)}]."
    if structure.springs:
        to_links = len(coupling.reduced.hanging.tied)
        joined = f" and act on {counted(to_links, 'pendulum', 'pendula')}" if to_links else ""
        count = len(structure.springs)
        joined = joined.replace(" act ", " acts ") if count == 1 else joined
        yield f"{counted(count, 'spring joins', 'springs join')} points of the scene{joined}."
    if scene.is_moved:
        yield "The ground moves as prescribed: all of this is about the ground at rest."


def _alone(coupling: StructureCoupling) -> Iterator[str]:
    modes = coupling.modes
    if not modes:
        return
    fast = coupling.fast
    for s, mode in enumerate(modes[:MOST_LISTED], 1):
        rate = f"at {rad(mode.omega)}" if mode.omega else "held by nothing [ω = 0]"
        yield (
            f"Mode s{s} of the structure, its pendula as if they were stiff: {coupling.words(mode.shape)}, {rate}"
            f"{' [K_s u = ω²(M_s + Σ m ΦᵀΦ + Σ m ΨᵀΨ) u]' if s == 1 else ''}. A slow push along it moves "
            f"{short(mode.mass)} kg [uᵀMu, at the point that moves most], a fast one "
            f"{short(float(fast[s - 1]))} kg, the pendula left behind."
        )
    if len(modes) > MOST_LISTED:
        yield f"{len(modes) - MOST_LISTED} more are in the JSON form."
    yield (
        "At ω a push along these modes feels the dynamic mass matrix −UᵀS(ω²)U/ω², with the dynamic stiffness "
        "S(x) = K_s − x(M_s + Σ Φᵀ diag(m_dyn(x), m) Φ); where S is singular the scene swings by itself [det S = 0]."
    )
    for omega, motion in coupling.structure_modes[:MOST_LISTED]:
        words = coupling.words(coupling.basis @ motion)
        rate = f"at {rad(omega)}" if omega else "a drift, ω = 0"
        yield f"In the scene, with the pendula swinging: {words}, {rate}{_numbered(coupling, omega)}."


def _family(coupling: StructureCoupling, r: str, family: PendulumFamily) -> str:
    who = listed([_member(coupling, k) for k in family.members[:MOST_LISTED]], len(family.members))
    words = [f"Family {r}, ω_{r} = {rad(family.omega)}, all else held [K φ = ω² A φ]: {who}."]
    pushed = [s for s, mass in enumerate(family.mass) if mass > NEGLIGIBLE * family.mass.max()]
    if pushed:
        each = [f"{short(float(family.mass[s]))} kg along s{s + 1}" for s in pushed[:MOST_LISTED]]
        words.append(f"It pushes the structure with {listed(each, len(pushed))} [μ = Σ N(φᵀb Φu)²/φᵀAφ].")
    if family.still:
        many = counted(family.still, "combination moves", "combinations move")
        words.append(
            f"{capital(many)} nothing else and {'stays' if family.still == 1 else 'stay'} at ω_{r}"
            f"{_numbered(coupling, family.omega)} [Σ φᵀb Φ = 0]."
        )
    words += [_branch(coupling, r, family, branch) for branch in family.branches[:MOST_LISTED]]
    if beats := coupling.beats(family)[:3]:
        times = listed([f"{short(beat)} s" for beat in beats], len(beats))
        words.append(f"Energy given to one of them beats with {times} [2π/|Δω| of two of these modes].")
    return " ".join(words)


def _branch(coupling: StructureCoupling, r: str, family: PendulumFamily, branch: Branch) -> str:
    how = [_moved(coupling, branch), _pattern(family, branch)]
    told = ", ".join(filter(None, how))
    where = f"{rad(branch.omega)}{_numbered(coupling, branch.omega)}"
    words = f"{capital(told) if told else 'One'} at {where}, Δω = {short(branch.splitting)} rad/s away"
    if not isfinite(branch.strength):
        return f"{words}: nothing else resists it at ω_{r}."
    guess = f", to first order {short(branch.strength * family.omega / 2)} rad/s [½ ε ω_{r}]"
    if abs(branch.strength) > STRONG:
        guess = ", too strong for first order"
    elif not branch.is_first_order(family.omega):
        guess = "; what resists changes too much up to it for first order"
    return f"{words}: ε = {short(branch.strength)}{guess}."


def _pattern(family: PendulumFamily, branch: Branch) -> str:
    """The pendula of two members, whether they swing alike."""
    if len(family.members) != 2 or abs(branch.pattern).min() < 0.1 * abs(branch.pattern).max():
        return ""
    return f"its two members in {'phase' if branch.pattern[0] * branch.pattern[1] > 0 else 'antiphase'}"


def _exchanges(coupling: StructureCoupling) -> Iterator[str]:
    if len(coupling.names) == 1:
        return
    if len(coupling.own.omega) > MOST_MODES:
        yield f"{len(coupling.own.omega)} modes of {len(coupling.names)} kinds are too many to list in pairs."
        return
    told = [pair for pair in coupling.pairs if pair.coupling or pair.exchange.most > SLIGHT]
    yield from (_pair(coupling, pair) for pair in told[:MOST_LISTED])
    if len(told) > MOST_LISTED:
        yield f"{len(told) - MOST_LISTED} more pairs are in the JSON form."


def _pair(coupling: StructureCoupling, pair: Exchanged) -> str:
    a, b = (_member(coupling, k) for k in (pair.first, pair.second))
    if pair.strength > STRONG:
        return (
            f"{capital(a)} and {b} are coupled too strongly for beats between two [|F|/ω² = {short(pair.strength)}]: "
            "their energy goes where the modes above carry it."
        )
    tuned, passed = abs(pair.detuning) < 2 * abs(pair.coupling), pair.exchange
    copies = int(max(coupling.own.count[[pair.first, pair.second]]))
    alike = ", all copies moving alike" if copies > 1 else ""
    head = (
        f"{capital(a)} and {b}{alike}: detuning {short(abs(pair.detuning))} rad/s [|δ|, δ = ω_a + F_aa/2ω_a − ω_b − "
        f"F_bb/2ω_b] against coupling {short(abs(pair.coupling))} rad/s [g = F_ab/2√(ω_aω_b)]: "
    )
    if not tuned:
        verdict = "detuning suppresses the exchange"
    else:
        verdict = "they exchange energy" if passed.most > SLIGHT else "damping suppresses the exchange"
    most = percent(passed.most) if passed.most >= SLIGHT else f"less than {percent(SLIGHT)}"
    ends = f", in beats of {short(passed.period)} s [2π/√(4g² + δ²)]" if passed.beats else ", without beats"
    lost = "" if passed.lossless else " with the dampers"
    others = "" if pair.alone else "; others of the same frequency take part"
    return f"{head}{verdict}. The other has at most {most} of one's energy{lost}{ends}{others}."


def _damping(coupling: StructureCoupling) -> Iterator[str]:
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


def _unsaid(coupling: StructureCoupling) -> Iterator[str]:
    yield (
        "Conservative modes let pendula exchange energy and do nothing else: no detuning, however small, makes pendula "
        "lock. To fall into step they need something that drains some modes and something that feeds others."
    )
    yield (
        "All frequencies are those of small motions about the scene as drawn. The table, whose numbers the modes have "
        "here, says how far each can be trusted."
    )
