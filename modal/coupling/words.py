"""The sections of the report in words: pendula, coupling, families, limits, and energy exchange."""

from __future__ import annotations

from collections.abc import Iterator
from math import isinf

import numpy as np

from modal.coupling.analysis import Coupling
from modal.coupling.dynamic_mass import CartMode
from modal.coupling.families import (
    MOST_PAIRED_MODES,
    STRONG_COUPLING,
    WEAK_COUPLING,
    EnergyExchange,
    Family,
    FamilyBranch,
    Transfer,
    family_name,
)
from modal.modes import MOST_LISTED
from modal.report import capital, counted, listed, percent, rad, short
from modal.structure import CarrierNumbers, Structure
from modal.types import NOISE_OF_SUM

GUIDE = " (approximate: the coupling is not weak)"
NEAR = " (approximate: another family is near)"
SHARE_GIVEN_MIN = 1e-4
"""Format: smallest fraction of an energy that is given as a number."""
ELSEWHERE = "in the JSON form"


def list_limit(coupling: Coupling) -> int:
    """Return how many entries of each kind are listed, fewer if there are many."""
    return MOST_LISTED if len(coupling.fixed_base.omega) <= MOST_PAIRED_MODES else 3


def member_words(coupling: Coupling, k: int) -> str:
    """Return a fixed-base mode by its pendulum, and by its number if the pendulum has several."""
    modes = coupling.fixed_base
    name = coupling.names[modes.kind[k]]
    several = int(np.sum(modes.kind == modes.kind[k])) > 1
    return f"fixed-base mode {modes.number[k]} of {name}" if several else name


def number_words(coupling: Coupling, omega: float) -> str:
    """The number of a frequency's mode in the table, in parentheses, where it is known."""
    number = coupling.number(omega)
    return "" if number is None else f" (mode {number})"


def fraction(share: float) -> str:
    """A fraction of an energy in words."""
    return percent(share) if share >= SHARE_GIVEN_MIN else f"less than {percent(SHARE_GIVEN_MIN)}"


def carrier_words(structure: Structure) -> str:
    """Return the supports in words: 2 swings (left and right), or a board."""
    by_kind: dict[str, list[CarrierNumbers]] = {}
    for carrier in structure.carriers:
        if carrier.size:
            by_kind.setdefault(carrier.kind, []).append(carrier)
    phrases = []
    for kind, carriers in by_kind.items():
        names = [carrier.name for carrier in carriers]
        singular, plural = carriers[0].path.nouns if carriers[0].path else ("structure", "structures")
        count = f"a {singular}" if len(names) == 1 else f"{len(names)} {plural}"
        phrases.append(count + ("" if names == [kind] else f" ({listed(names[:MOST_LISTED], len(names))})"))
    return listed(phrases, len(phrases))


# ----------------------------------------------------------------------------------------- what hangs, what is felt


def pendula_words(coupling: Coupling) -> Iterator[str]:
    """Return sentences on pendula, supports and springs."""
    scene, structure = coupling.scene, coupling.structure
    pendula, kinds = counted(scene.n_pendula, "pendulum", "pendula"), len({(p.chain, p.ways) for p in scene.pendulum})
    pendula += f" of {kinds} kinds" if kinds > 1 else ""
    pendula = pendula.replace(" ", " equal ", 1) if scene.n_pendula > kinds == 1 else pendula
    hanging = sum(float(np.sum(block.mass.sum(0) * block.count)) for block in coupling.rig.blocks)
    what = (
        f"{pendula}, {counted(scene.n_links, 'link', 'links')} and "
        f"{short(hanging)} kg in all, {'hangs' if scene.n_pendula == 1 else 'hang'}"
    )
    if coupling.on_cart:
        dynamic = coupling.dynamic
        yield f"{what} from a cart of {short(dynamic.cart)} kg: {short(dynamic.at_rest)} kg [M = m_c + Σ m]."
        if scene.n_pendula == 1:
            yield "One pendulum has no partner: the cart only shifts its frequencies."
        if dynamic.spring:
            rail_omega = (dynamic.spring / dynamic.at_rest) ** 0.5
            yield (
                f"A spring of {short(dynamic.spring)} N/m holds the cart: with stiff pendula it would swing at "
                f"{rad(rail_omega)} [√(k_c/M)]."
            )
    elif structure.size:
        names = [*structure.names[:MOST_LISTED], *["…"] * (structure.size > MOST_LISTED)]
        size = counted(structure.size, "coordinate", "coordinates")
        yield f"{what} from {carrier_words(structure)}: {size} [{', '.join(names)}]."
    elif structure.springs:
        yield f"{what} from a support that does not move: only springs between them couple them."
    elif scene.is_moved and not scene.is_structured:
        yield (
            f"{what} from a support that moves as prescribed, whatever hangs from it: nothing couples pendula "
            "[m_c = ∞], and each swings alone. All of this is about the support at rest."
        )
    else:
        yield f"{what} from a fixed support. It does not move, so nothing couples pendula [m_c = ∞]: each swings alone."
    if count := len(structure.springs):
        to_links = len(coupling.reduced.hanging.tied)
        acts = "acts" if count == 1 else "act"
        end_words = f" and {acts} on {counted(to_links, 'pendulum', 'pendula')}" if to_links else ""
        yield f"{counted(count, 'spring joins', 'springs join')} points of the scene{end_words}."
    if scene.is_moved and scene.is_structured:
        yield "The ground moves as prescribed: all of this is about the ground at rest."
    if coupling.rig.spatial:
        yield (
            "The scene is in space; all of this is the motion along the rail. Across it the support does not move, and "
            "nothing couples the pendula at small angles."
        )


def push_words(coupling: Coupling) -> Iterator[str]:
    """Return sentences on the dynamic mass of the cart, or of a massless cart on a fixed support."""
    dynamic, on_cart = coupling.dynamic, coupling.on_cart
    sum_of_poles = "m_res + Σ μ_r ω_r²/(ω_r² − ω²)"
    fast = f"{short(dynamic.at_infinity)} kg [m_dyn(∞) = m_c + m_res, m_res = {short(dynamic.residual)} kg]"
    if on_cart:
        slow = "the spring [−k_c/ω²]" if dynamic.spring else f"all {short(dynamic.at_rest)} kg [m_dyn(0) = M]"
        spring = "− k_c/ω² + " if dynamic.spring else "+ "
        yield (
            f"A slow force on the cart acts on {slow}, a fast one on {fast}, and one at ω on the dynamic mass "
            f"m_dyn(ω) = m_c {spring}{sum_of_poles}."
        )
    else:
        yield (
            f"Were the support free to move, the pendula would add {short(dynamic.at_rest)} kg to its mass for a "
            f"slow force [Σ m], {short(dynamic.residual)} kg for a fast one [m_res], and at ω {sum_of_poles}."
        )
    limit = list_limit(coupling)
    poles = listed([rad(omega) for omega in dynamic.omega[:limit]], len(dynamic.omega))
    yield f"Its poles, where the pendula keep the support at rest whatever force acts on it: {poles} [K φ = ω² A φ]."
    if coupling.cart_modes:
        moving = [f"{rad(mode.omega)}{number_words(coupling, mode.omega)}" for mode in coupling.cart_modes[:limit]]
        zeros = listed(moving, len(coupling.cart_modes))
        yield f"Its zeros, where the cart swings freely: {zeros} [m_dyn(ω) = 0]."
    elif on_cart:
        yield "It has no zeros: no mode of finite frequency moves the cart [m_dyn(∞) = 0]."
    if on_cart and not dynamic.spring:
        yield "The cart and all that hangs from it can also drift together [ω = 0]."


def own_mode_words(coupling: Coupling) -> Iterator[str]:
    """The structure's own modes, and the modes of the scene that are mostly its own."""
    modes = coupling.modes
    if not modes:
        return
    fast = coupling.fast
    for s, mode in enumerate(modes[:MOST_LISTED], 1):
        rate = f"at {rad(mode.omega)}" if mode.omega else "held by nothing [ω = 0]"
        yield (
            f"Mode s{s} of the structure, its pendula as if they were stiff: {coupling.words(mode.shape)}, {rate}"
            f"{' [K_s u = ω²(M_s + Σ m ΦᵀΦ + Σ m ΨᵀΨ) u]' if s == 1 else ''}. A slow force along it moves "
            f"{short(mode.mass)} kg [uᵀMu, at the point that moves most], a fast one "
            f"{short(float(fast[s - 1]))} kg, while the pendula stay behind."
        )
    if len(modes) > MOST_LISTED:
        yield f"{len(modes) - MOST_LISTED} more are {ELSEWHERE}."
    yield (
        "A force along these modes acts, at ω, on the dynamic mass matrix −UᵀS(ω²)U/ω², with the dynamic stiffness "
        "S(x) = K_s − x(M_s + Σ Φᵀ diag(m_dyn(x), m) Φ); where S is singular the scene swings freely [det S = 0]."
    )
    for omega, motion in coupling.structure_modes[:MOST_LISTED]:
        words = coupling.words(coupling.basis @ motion)
        rate = f"at {rad(omega)}" if omega else "a drift, ω = 0"
        yield f"In the scene, with the pendula swinging: {words}, {rate}{number_words(coupling, omega)}."


# ------------------------------------------------------------------------------------------------------- families


def families(coupling: Coupling) -> Iterator[str]:
    """Sentences about each family."""
    all_families, limit = coupling.families, list_limit(coupling)
    for index, family in enumerate(all_families[:limit]):
        yield _family(coupling, family_name(index), family)
    if len(all_families) > limit:
        yield f"{len(all_families) - limit} more families, up to {rad(all_families[-1].omega)}, are {ELSEWHERE}."


def _family(coupling: Coupling, r: str, family: Family) -> str:
    who = listed([member_words(coupling, k) for k in family.members[:MOST_LISTED]], len(family.members))
    number = "" if coupling.is_coupled else number_words(coupling, family.omega)
    mass = f"{short(family.mass)} kg [μ_{r} = Σ (φᵀb)²/(φᵀAφ)]"
    if coupling.scene.is_structured and len(family.masses):
        directions = np.flatnonzero(family.masses > NOISE_OF_SUM * family.masses.max()).tolist()
        phrases = [f"{short(float(family.masses[s]))} kg along s{s + 1}" for s in directions[:MOST_LISTED]]
        mass = f"{listed(phrases, len(directions))} [μ = Σ N(φᵀb Φu)²/φᵀAφ]" if directions else mass
    head = f"Family {r}, ω_{r} = {rad(family.omega)}{number} [K φ = ω² A φ]: {who}, of modal effective mass {mass}."
    if not coupling.is_coupled:
        return head
    words = [head]
    if family.still:
        still_words = counted(family.still, "combination stays", "combinations stay")
        moves = "moves" if family.still == 1 else "move"
        rest = "with the cart still, in antiphase" if coupling.on_cart else f"and {moves} nothing else"
        end = ";" if family.branches else "."
        words.append(f"{still_words} at ω_{r} {rest}{number_words(coupling, family.omega)} [Σ φᵀb = 0]{end}")
    for branch in family.branches[:MOST_LISTED]:
        words += [*_motion_sentences(coupling, r, family, branch), *_strength(coupling, r, family, branch)]
    return " ".join((*words, *_beats(coupling, family)))


def _motion_sentences(coupling: Coupling, r: str, family: Family, branch: FamilyBranch) -> Iterator[str]:
    """How a mode of a family moves, and where it is."""
    several = family.still > 0
    if not branch.is_finite:
        yield f"{'the' if several else 'The'} one that moves the cart has gone to infinite frequency [m_dyn(∞) = 0]."
        return
    bare = " without dampers" if coupling.scene.has_damping else ""
    how, formula = f"{'one moves' if several else 'It moves'} the cart,", "[m_dyn(ω) = 0]"
    if not coupling.on_cart:
        phrases = [coupling.motion_words(branch), _pattern(family, branch)]
        how, formula = ", ".join(filter(None, phrases)) or "one", "[det S = 0]"
        how = how if several and branch is family.branches[0] else capital(how)
    yield (
        f"{how} at {rad(branch.omega)}{number_words(coupling, branch.omega)} {formula}, "
        f"Δω = {short(branch.splitting)} rad/s away{bare} [ω_zero − ω_{r}]."
    )


def _pattern(family: Family, branch: FamilyBranch) -> str:
    """The pendula of two members, whether they swing alike."""
    if len(family.members) != 2 or abs(branch.pattern).min() < 0.1 * abs(branch.pattern).max():
        return ""
    who = "the two pendula" if family.fold == 2 else "its two groups of pendula"
    return f"{who} swing in {'phase' if branch.pattern[0] * branch.pattern[1] > 0 else 'antiphase'}"


def _strength(coupling: Coupling, r: str, family: Family, branch: FamilyBranch) -> Iterator[str]:
    """The coupling strength of a mode, and its first-order approximation."""
    if not branch.is_finite:
        return
    if isinf(branch.strength):
        yield f"No other inertia opposes it [m_{r} = 0]."
        return
    first = branch.strength * family.omega / 2
    guess = f", which to first order gives Δω ≈ {short(first)} rad/s [½ ε_{r} ω_{r}]{_guide(family, branch)}"
    what = f"m_{r}" if coupling.secular else "what resists"
    if abs(branch.strength) > STRONG_COUPLING:
        guess = ", too strong for first order"
    elif not branch.is_first_order(family.omega):
        guess = f"; {what} changes too much up to the zero for first order"
    resists = f"[ε_{r} ω_{r}² of F]"
    if coupling.on_cart:
        resists = f"[μ_{r}/m_{r}; m_{r} = {short(family.rest)} kg is the dynamic mass of all else at ω_{r}]"
    yield f"Coupling strength ε_{r} = {short(branch.strength)} {resists}{guess}."


def _guide(family: Family, branch: FamilyBranch) -> str:
    return GUIDE if abs(branch.strength) > WEAK_COUPLING else NEAR if branch.is_rough(family.omega) else ""


def _beats(coupling: Coupling, family: Family) -> Iterator[str]:
    """Beats within a family."""
    moving = [branch for branch in family.branches if branch.is_finite]
    if family.fold == 1 or not moving:
        return
    exchange, n = family.exchange, family.fold
    if exchange is None:
        yield (
            "Dampers drain some of its pendula faster than others: what two of them exchange is said below."
            if family.is_first_order
            else "The coupling is too strong, or another family too near, for beats within this one."
        )
        return
    guide = max((_guide(family, branch) for branch in moving), key=len)
    if not exchange.lossless:
        yield from _damped_beats(coupling, family, exchange, guide)
        return
    if len(moving) > 1 or not family.still:
        if family.beats:
            times = listed([f"{short(beat)} s" for beat in family.beats[:3]], len(family.beats))
            yield f"Energy given to one of them beats with {times} [2π/|Δω| of two of these modes]{guide}."
        return
    share = ""
    if len(family.members) == 1:
        part = "all of it" if n == 2 else percent(4 * (n - 1) / n**2)
        share = f"; after half a beat the others have {part} [4(N − 1)/N², N = {n}]"
    yield (
        f"One pendulum set swinging alone in this mode recovers its energy after {short(exchange.period)} s [2π/|Δω|]"
        f"{share}. A run shorter than half of that shows only part of the exchange{guide}."
    )


def _damped_beats(coupling: Coupling, family: Family, exchange: Transfer, guide: str) -> Iterator[str]:
    """The effect of dampers on beats."""
    sigma = float(coupling.fixed_base.rate[family.members[0]])
    if sigma >= family.omega:
        yield "Joint dampers make its pendula overdamped [σ ≥ ω]: there are no beats."
        return
    aside = ", its drives aside," if coupling.scene.is_driven else ""
    limit_words = f"the others never receive more than {fraction(exchange.most)} of the energy given"
    if not exchange.beats:
        yield (
            f"There are no beats: the motion of the {coupling.noun} decays before it has run out of phase with the "
            f"rest [−Re Δλ > Im Δλ]. Of one pendulum set swinging alone{aside}, {limit_words}{guide}."
        )
        return
    yield (
        f"One pendulum set swinging alone in this mode{aside} recovers {fraction(exchange.left)} of its energy after a "
        f"beat of {short(exchange.period)} s [2π/Im Δλ]: dampers dissipate the rest, and {limit_words}{guide}."
    )


def limits(coupling: Coupling) -> Iterator[str]:
    """Limits of each mode that moves the cart for cart masses from 0 to ∞."""
    if not coupling.on_cart:
        yield "A fixed support is the limit of an immense cart: the poles above are its frequencies [m_c → ∞]."
        return
    modes, limit = coupling.cart_modes, list_limit(coupling)
    busiest = sorted(range(len(modes)), key=lambda number: -modes[number].participation)[:limit]
    yield from (_limit(coupling, modes[number]) for number in sorted(busiest))
    if len(modes) > limit:
        yield f"The {len(modes) - limit} other modes that move the cart, all of them less, are {ELSEWHERE}."
    if any(family.fold > 1 for family in coupling.families):
        yield "The modes that leave the cart at rest do not depend on its mass [ω = ω_r for every m_c]."
    spring_words = ", one to 0 with the cart's spring" if coupling.dynamic.spring else ""
    yield f"As m_c → ∞ every coupling strength goes to 0 [ε_r = μ_r/m_r] and every mode to its pole{spring_words}."


def _limit(coupling: Coupling, mode: CartMode) -> str:
    number = coupling.number(mode.omega)
    name = "A mode that moves the cart" if number is None else f"Mode {number}"
    whose = f"of family {family_name(mode.family)}" if mode.family is not None else "of the cart on its spring"
    heavy, why = (rad(mode.heavy), "the pole below") if mode.heavy else ("0", "√(k_c/m_c)")
    return (
        f"{name}, {whose}, now at {rad(mode.omega)} with {percent(mode.participation)} of the "
        f"cart's velocity after a push [φ_x²/Σφ_x²], goes to {rad(mode.light)} with a massless cart [zero of "
        f"m_dyn − m_c] and to {heavy} with an immense one [{why}]."
    )


# ---------------------------------------------------------------------------------------------- exchange of energy


def exchanges(coupling: Coupling) -> Iterator[str]:
    """A sentence about each pair of modes of different pendula, or about all of them where there are many."""
    if len(coupling.names) == 1 or not coupling.is_coupled:
        return
    if len(coupling.fixed_base.omega) > MOST_PAIRED_MODES:
        yield from _spread_sentences(coupling)
        return
    pairs = [pair for pair in coupling.pairs if coupling.on_cart or pair.coupling or pair.share > SHARE_GIVEN_MIN]
    yield from (_pair(coupling, pair) for pair in pairs[:MOST_LISTED])
    if not coupling.pairs:
        yield (
            "Only the inertia of the pendula opposes them [m = 0]: they move together and exchange no energy in beats."
        )
    elif (remainder := len(pairs) - MOST_LISTED) > 0:
        yield f"{remainder} more pairs are {ELSEWHERE}."


def _pair(coupling: Coupling, pair: EnergyExchange) -> str:
    modes, on_cart = coupling.fixed_base, coupling.on_cart
    a, b = (member_words(coupling, k) for k in (pair.first, pair.second))
    resists = f"m = {short(pair.cart_mass)} kg"
    if pair.strength > STRONG_COUPLING:
        why = f"[μ/|m| = {short(pair.strength)}, {resists}]" if on_cart else f"[|F|/ω² = {short(pair.strength)}]"
        return (
            f"{capital(a)} and {b} are coupled too strongly for beats between two {why}: "
            "their energy goes where the modes above carry it."
        )
    if on_cart and not pair.alone:
        return (
            f"{capital(a)} and {b} are not alone: other modes, or the cart's spring, make the dynamic mass m of all "
            "else change between their frequencies [m(ω_a) ≠ m(ω_b)]; their energy goes where the modes above carry it."
        )
    overdamped_pendula = [
        capital(member_words(coupling, k)) for k in (pair.first, pair.second) if modes.rate[k] >= modes.omega[k]
    ]
    if overdamped_pendula:
        return f"{listed(overdamped_pendula, len(overdamped_pendula))}: overdamped by its joints [σ ≥ ω], no beats."
    copies = int(max(modes.count[[pair.first, pair.second]]))
    alike = ", all copies moving alike" if copies > 1 and not on_cart else ""
    delta = "δ = ω_a + F_aa/2ω_a − ω_b − F_bb/2ω_b" if not on_cart else "δ = ω_a(1 + μ_a/2m) − ω_b(1 + μ_b/2m)"
    g = f"g = √(μ_aμ_bω_aω_b)/2|m|, {resists}" if on_cart else "g = F_ab/2√(ω_aω_b)"
    others = "" if pair.alone else "; others of the same frequency take part"
    return (
        f"{capital(a)} and {b}{alike}: detuning {short(abs(pair.detuning))} rad/s [|δ|, {delta}] against coupling "
        f"{short(abs(pair.coupling))} rad/s [{g}]: {_exchange_words(pair)}{others}"
        f"{GUIDE if pair.strength > WEAK_COUPLING else ''}."
    )


def _exchange_words(pair: EnergyExchange) -> str:
    """Whether they exchange energy, how much, and how much comes back."""
    transfer, is_in_tune = pair.exchange, abs(pair.detuning) < 2 * abs(pair.coupling)
    if transfer.lossless:
        return (
            f"{'they exchange energy' if is_in_tune else 'detuning suppresses the exchange'}. One transfers at most "
            f"{percent(pair.share)} of its energy to the other [4g²/(4g² + δ²)] in beats of {short(pair.period)} s "
            "[2π/√(4g² + δ²)]"
        )
    verdict = "they exchange energy" if pair.share > 0.5 else "damping suppresses the exchange"
    if not is_in_tune:
        verdict = "detuning suppresses the exchange"
    back = (
        f"after a beat of {short(pair.period)} s [π/Re Ω, Ω² = g² + δ²/4 with the dampers] at most "
        f"{fraction(transfer.left)} is back"
        if transfer.beats
        else "nothing comes back in beats [Im Ω > Re Ω, Ω² = g² + δ²/4 with the dampers]"
    )
    part = fraction(pair.share)
    return f"{verdict}. With the dampers the other never receives more than {part} of one's energy, and {back}"


def collective_words(coupling: Coupling) -> str:
    """One sentence on many different pendula that swing alike; empty where pairs are listed."""
    if len(coupling.fixed_base.omega) <= MOST_PAIRED_MODES or not coupling.on_cart:
        return ""
    _, spread, shift, _ = _collective_shift(coupling)
    if abs(shift) > spread:
        return "The cart shifts them together by more than they differ: one mode stands out."
    return "They differ by more than the cart shifts them: only neighbours in frequency exchange."


def _collective_shift(coupling: Coupling) -> tuple[float, float, float, float]:
    """Of first modes their median and their spread, their shift (rad/s) if they swing alike, and m (kg) of the rest."""
    modes, dynamic = coupling.fixed_base, coupling.dynamic
    first = modes.number == 1
    omega, mass = modes.omega[first], float((modes.mass * modes.count)[first].sum())
    middle, spread = float(np.median(omega)), float(np.ptp(omega))
    left_out = np.array([bool(first[list(family.members)].any()) for family in coupling.families])
    rest = float(dynamic([middle], left_out=left_out[None])[0])
    return middle, spread, middle * mass / (2 * rest) if rest else float("inf"), rest


def _spread_sentences(coupling: Coupling) -> Iterator[str]:
    """The first modes of many different pendula: their spread against their collective coupling."""
    modes = coupling.fixed_base
    head = f"{len(modes.omega)} modes of {len(coupling.names)} kinds are too many to list in pairs."
    if not coupling.on_cart:
        yield head
        return
    middle, spread, shift, rest = _collective_shift(coupling)
    count = int(np.sum(modes.number == 1))
    yield (
        f"{head} Their first modes "
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
        f"The mode that moves the cart most, at {rad(top.omega)}{number_words(coupling, top.omega)}, has "
        f"{percent(top.participation)} of its velocity after a push [φ_x²/Σφ_x²]."
    )
