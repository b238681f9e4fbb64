"""The coupling through a structure in words: its own modes, the families that they couple, and exchange."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import isfinite

from modal.coupling.exchange import MOST_MODES, STRONG
from modal.coupling.families import family_name
from modal.coupling.structure_damping_words import damping
from modal.coupling.structures import Exchanged, FamilyBranch, PendulumFamily, StructureCoupling
from modal.coupling.wording import MOST_LISTED, SLIGHT, member, numbered
from modal.report import capital, counted, listed, percent, rad, short
from modal.structure import Structure

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
    yield "Families of modes", (_family(coupling, r, family) for r, family in _chosen(coupling.families))
    yield "Exchange of energy between pendula", _exchanges(coupling)
    yield "Damping by mode", damping(coupling)


def _chosen(families: Sequence[PendulumFamily]) -> Iterator[tuple[str, PendulumFamily]]:
    return ((family_name(r), family) for r, family in enumerate(families[:MOST_LISTED]))


def _nouns(kind: str) -> tuple[str, str]:
    """What one carrier is called, and several."""
    return NOUNS.get(kind, (kind, f"{kind}s"))


def carrier_words(structure: Structure) -> str:
    """What pendula hang from: 2 swings (left and right), or a board."""
    by_kind: dict[str, list[str]] = {}
    for carrier in structure.carriers:
        if carrier.size:
            by_kind.setdefault(carrier.kind, []).append(carrier.name)
    each = [
        (f"a {_nouns(kind)[0]}" if len(names) == 1 else f"{len(names)} {_nouns(kind)[1]}")
        + ("" if names == [kind] else f" ({listed(names[:MOST_LISTED], len(names))})")
        for kind, names in by_kind.items()
    ]
    return listed(each, len(each))


# --------------------------------------------------------------------------------------------------------- sections


def _scene(coupling: StructureCoupling) -> Iterator[str]:
    scene, structure = coupling.scene, coupling.structure
    kinds = f" of {counted(len(coupling.names), 'kind', 'kinds')}" if scene.n_pendula > 1 else ""
    hanging = sum(float(block.mass.sum(0) @ block.count) for block in coupling.reduced.hanging.rig.blocks)
    what = (
        f"{counted(scene.n_pendula, 'pendulum', 'pendula')}{kinds}, {counted(scene.n_links, 'link', 'links')} and "
        f"{short(hanging)} kg in all, {'hangs' if scene.n_pendula == 1 else 'hang'}"
    )
    if not any(carrier.size for carrier in structure.carriers):
        yield f"{what} from a support that does not move: only springs between them couple them."
    else:
        named = [*structure.names[:MOST_LISTED], *["…"] * (structure.size > MOST_LISTED)]
        size = counted(structure.size, "coordinate", "coordinates")
        yield f"{what} from {carrier_words(structure)}: {size} [{', '.join(named)}]."
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
        yield f"In the scene, with the pendula swinging: {words}, {rate}{numbered(coupling, omega)}."


def _family(coupling: StructureCoupling, r: str, family: PendulumFamily) -> str:
    who = listed([member(coupling, k) for k in family.members[:MOST_LISTED]], len(family.members))
    words = [f"Family {r}, ω_{r} = {rad(family.omega)}, all else held [K φ = ω² A φ]: {who}."]
    pushed = [s for s, mass in enumerate(family.mass) if mass > NEGLIGIBLE * family.mass.max()]
    if pushed:
        each = [f"{short(float(family.mass[s]))} kg along s{s + 1}" for s in pushed[:MOST_LISTED]]
        words.append(f"It pushes the structure with {listed(each, len(pushed))} [μ = Σ N(φᵀb Φu)²/φᵀAφ].")
    if family.still:
        many = counted(family.still, "combination moves", "combinations move")
        words.append(
            f"{capital(many)} nothing else and {'stays' if family.still == 1 else 'stay'} at ω_{r}"
            f"{numbered(coupling, family.omega)} [Σ φᵀb Φ = 0]."
        )
    words += [_branch(coupling, r, family, branch) for branch in family.branches[:MOST_LISTED]]
    if beats := coupling.beats(family)[:3]:
        times = listed([f"{short(beat)} s" for beat in beats], len(beats))
        words.append(f"Energy given to one of them beats with {times} [2π/|Δω| of two of these modes].")
    return " ".join(words)


def _branch(coupling: StructureCoupling, r: str, family: PendulumFamily, branch: FamilyBranch) -> str:
    how = [coupling.moved(branch), _pattern(family, branch)]
    told = ", ".join(filter(None, how))
    where = f"{rad(branch.omega)}{numbered(coupling, branch.omega)}"
    words = f"{capital(told) if told else 'One'} at {where}, Δω = {short(branch.splitting)} rad/s away"
    if not isfinite(branch.strength):
        return f"{words}: nothing else resists it at ω_{r}."
    guess = f", to first order {short(branch.strength * family.omega / 2)} rad/s [½ ε ω_{r}]"
    if abs(branch.strength) > STRONG:
        guess = ", too strong for first order"
    elif not branch.is_first_order(family.omega):
        guess = "; what resists changes too much up to it for first order"
    return f"{words}: ε = {short(branch.strength)}{guess}."


def _pattern(family: PendulumFamily, branch: FamilyBranch) -> str:
    """The pendula of two members, whether they swing alike."""
    if len(family.members) != 2 or abs(branch.pattern).min() < 0.1 * abs(branch.pattern).max():
        return ""
    return f"its two members in {'phase' if branch.pattern[0] * branch.pattern[1] > 0 else 'antiphase'}"


def _exchanges(coupling: StructureCoupling) -> Iterator[str]:
    if len(coupling.names) == 1:
        return
    if len(coupling.fixed_base.omega) > MOST_MODES:
        yield f"{len(coupling.fixed_base.omega)} modes of {len(coupling.names)} kinds are too many to list in pairs."
        return
    told = [pair for pair in coupling.pairs if pair.coupling or pair.exchange.most > SLIGHT]
    yield from (_pair(coupling, pair) for pair in told[:MOST_LISTED])
    if len(told) > MOST_LISTED:
        yield f"{len(told) - MOST_LISTED} more pairs are in the JSON form."


def _pair(coupling: StructureCoupling, pair: Exchanged) -> str:
    a, b = (member(coupling, k) for k in (pair.first, pair.second))
    if pair.strength > STRONG:
        return (
            f"{capital(a)} and {b} are coupled too strongly for beats between two [|F|/ω² = {short(pair.strength)}]: "
            "their energy goes where the modes above carry it."
        )
    tuned, passed = abs(pair.detuning) < 2 * abs(pair.coupling), pair.exchange
    copies = int(max(coupling.fixed_base.count[[pair.first, pair.second]]))
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
