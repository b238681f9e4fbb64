"""The coupling of a scene as a report: sentences with its numbers, each with its formula."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import isfinite, isinf
from textwrap import TextWrapper

import numpy as np

from modal.coupling.analysis import CartMode, Coupling, Family, family_name
from modal.coupling.damping import Damped
from modal.coupling.exchange import MOST_MODES, STRONG, EnergyExchange, Transfer
from modal.coupling.records import coupling_record
from modal.modes.friction import stop_words
from modal.report import as_json, capital, counted, line_width, listed, markdown, percent, rad, short, visible
from modal.scene import title_of

FORMS = ("text", "markdown", "json")
MOST_LISTED, FEW = 8, 3
ROUGH = 0.1
"""Coupling strength above which first order is only a guide."""
GUIDE = " (only a guide: the coupling is strong)"
NEAR = " (only a guide: another family is near)"
SLIGHT = 1e-4
"""Smallest fraction of an energy that is given as a number."""
ELSEWHERE = "in the JSON form"
HALF = 0.5
MOST_DAMPED = 12
NEGLIGIBLE = 1e-12
LET_GO_DEG = 10.0
"""Largest angle from which the report lets modes go that dry friction stops."""
OFF = 0.1
"""Relative difference of the exact rate from first order that is mentioned."""


@dataclass(frozen=True)
class Section:
    """A title and sentences."""

    title: str
    sentences: tuple[str, ...]


def coupling_report(coupling: Coupling, form: str = "text") -> str:
    """The report as "text", "markdown" or "json", the last with every number (units in the names).

    Raises ValueError for another form.
    """
    if form not in FORMS:
        raise ValueError(f"form = {form!r}: must be one of {', '.join(FORMS)}")
    if form == "json":
        return as_json(coupling_record(coupling))
    title = f"{title_of(coupling.scene)}: what couples the pendula"
    return (_markdown if form == "markdown" else _text)(title, sections(coupling))


def sections(coupling: Coupling) -> tuple[Section, ...]:
    """The sections of the report."""
    parts = (
        ("What hangs there", _scene),
        ("What the cart feels" if coupling.on_cart else "What a cart would feel", _felt),
        ("Families of modes", families),
        ("The cart's mass from 0 to ∞", limits),
        ("Exchange of energy between pendula", exchanges),
        ("Damping by family", damping),
        ("What this does not say", _unsaid),
    )
    found = (Section(title, tuple(write(coupling))) for title, write in parts)
    return tuple(section for section in found if section.sentences)


def _text(title: str, parts: tuple[Section, ...]) -> str:
    wrapper = TextWrapper(line_width(), "- ", "  ", break_long_words=False, break_on_hyphens=False)
    lines = [visible(title), "=" * len(visible(title))]
    for part in parts:
        lines += ["", part.title, "-" * len(part.title), *map(wrapper.fill, part.sentences)]
    return "\n".join(lines) + "\n"


def _markdown(title: str, parts: tuple[Section, ...]) -> str:
    lines = [f"# {markdown(title)}"]
    for part in parts:
        lines += ["", f"## {part.title}", "", *(f"- {sentence}" for sentence in part.sentences)]
    return "\n".join(lines) + "\n"


def shown(coupling: Coupling) -> int:
    """How many entries of each kind are listed, fewer where there are many."""
    return MOST_LISTED if len(coupling.own.omega) <= MOST_MODES else FEW


def member(coupling: Coupling, k: int) -> str:
    """A fixed-base mode by its number and its pendulum."""
    return f"fixed-base mode {coupling.own.number[k]} of {coupling.names[coupling.own.kind[k]]}"


def numbered(coupling: Coupling, omega: float) -> str:
    """The number of a frequency's mode in the table, in parentheses, where it is known."""
    number = coupling.number(omega)
    return "" if number is None else f" (mode {number})"


def left(share: float) -> str:
    """A fraction of an energy in words."""
    return percent(share) if share >= SLIGHT else f"less than {percent(SLIGHT)}"


def _scene(coupling: Coupling) -> Iterator[str]:
    scene, dynamic = coupling.scene, coupling.dynamic
    kinds = f" of {counted(len(coupling.names), 'kind', 'kinds')}" if scene.n_pendula > 1 else ""
    what = (
        f"{counted(scene.n_pendula, 'pendulum', 'pendula')}{kinds}, {counted(scene.n_links, 'link', 'links')} and "
        f"{short(dynamic.with_cart(0.0).at_rest)} kg in all, {'hangs' if scene.n_pendula == 1 else 'hang'}"
    )
    if coupling.on_cart:
        yield f"{what} from a cart of {short(dynamic.cart)} kg: {short(dynamic.at_rest)} kg [M = m_c + Σ m]."
    elif scene.is_moved:
        yield (
            f"{what} from a support that moves as prescribed, whatever hangs from it: nothing couples pendula "
            "[m_c = ∞], and each swings alone. All of this is about the support at rest."
        )
    else:
        yield f"{what} from a fixed support. It does not move, so nothing couples pendula [m_c = ∞]: each swings alone."
    if coupling.on_cart and scene.n_pendula == 1:
        yield "One pendulum has no partner: the cart only shifts its frequencies."
    if dynamic.spring:
        alone = (dynamic.spring / dynamic.at_rest) ** 0.5
        yield (
            f"A spring of {short(dynamic.spring)} N/m holds the cart: with stiff pendula it would swing at "
            f"{rad(alone)} [√(k_c/M)]."
        )
    if coupling.rig.spatial:
        yield (
            "The scene is in space; all of this is the motion along the rail. Across it the support does not move, and "
            "nothing couples the pendula at small angles."
        )


def _felt(coupling: Coupling) -> Iterator[str]:
    dynamic, on_cart = coupling.dynamic, coupling.on_cart
    sum_of_poles = "m_res + Σ μ_r ω_r²/(ω_r² − ω²)"
    fast = f"{short(dynamic.at_infinity)} kg [m_dyn(∞) = m_c + m_res, m_res = {short(dynamic.residual)} kg]"
    if on_cart:
        slow = "the spring [−k_c/ω²]" if dynamic.spring else f"all {short(dynamic.at_rest)} kg [m_dyn(0) = M]"
        spring = "− k_c/ω² + " if dynamic.spring else "+ "
        yield (
            f"A slow push on the cart feels {slow}, a fast one {fast}, and one at ω the dynamic mass "
            f"m_dyn(ω) = m_c {spring}{sum_of_poles}."
        )
    else:
        yield (
            f"Were the support free to move, the pendula would add {short(dynamic.at_rest)} kg to its mass in a "
            f"slow push [Σ m], {short(dynamic.residual)} kg in a fast one [m_res], and at ω {sum_of_poles}."
        )
    most = shown(coupling)
    poles = listed([rad(omega) for omega in dynamic.omega[:most]], len(dynamic.omega))
    yield f"Its poles, where the pendula hold a support still however it is pushed: {poles} [K φ = ω² A φ]."
    if coupling.cart_modes:
        moving = [f"{rad(mode.omega)}{numbered(coupling, mode.omega)}" for mode in coupling.cart_modes[:most]]
        zeros = listed(moving, len(coupling.cart_modes))
        yield f"Its zeros, where the cart swings by itself: {zeros} [m_dyn(ω) = 0]."
    elif on_cart:
        yield "It has no zeros: no mode of finite frequency moves the cart [m_dyn(∞) = 0]."
    if on_cart and not dynamic.spring:
        yield "Besides, the cart and all that hangs from it can drift together [ω = 0]."


def families(coupling: Coupling) -> Iterator[str]:
    """Sentences about each family."""
    every, most = coupling.families, shown(coupling)
    for index, family in enumerate(every[:most]):
        yield _family(coupling, family_name(index), family)
    if len(every) > most:
        yield f"{len(every) - most} more families, up to {rad(every[-1].omega)}, are {ELSEWHERE}."


def limits(coupling: Coupling) -> Iterator[str]:
    """Limits of each mode that moves the cart for cart masses from 0 to ∞."""
    if not coupling.on_cart:
        yield "A fixed support is the limit of an immense cart: the poles above are its frequencies [m_c → ∞]."
        return
    modes, most = coupling.cart_modes, shown(coupling)
    busiest = sorted(range(len(modes)), key=lambda number: -modes[number].participation)[:most]
    yield from (_limit(coupling, modes[number]) for number in sorted(busiest))
    if len(modes) > most:
        yield f"The {len(modes) - most} other modes that move the cart, all of them less, are {ELSEWHERE}."
    if any(family.fold > 1 for family in coupling.families):
        yield "The modes that leave the cart still do not feel its mass at all [ω = ω_r for every m_c]."
    held = ", one to 0 with the cart's spring" if coupling.dynamic.spring else ""
    yield f"As m_c → ∞ every coupling strength goes to 0 [ε_r = μ_r/m_r] and every mode to its pole{held}."


def _family(coupling: Coupling, r: str, family: Family) -> str:
    who = listed([member(coupling, k) for k in family.members[:MOST_LISTED]], len(family.members))
    own = "" if coupling.on_cart else numbered(coupling, family.omega)
    head = (
        f"Family {r}, ω_{r} = {rad(family.omega)}{own} [K φ = ω² A φ]: {who}, of modal effective mass "
        f"{short(family.mass)} kg [μ_{r} = Σ (φᵀb)²/(φᵀAφ)]."
    )
    if not coupling.on_cart:
        return head
    return " ".join((head, *_moved(coupling, r, family), *_beats(coupling, family)))


def _moved(coupling: Coupling, r: str, family: Family) -> Iterator[str]:
    """Which modes of a family stay and which moves the cart, and its coupling strength."""
    several = family.fold > 1
    if several:
        many = counted(family.fold - 1, "combination stays", "combinations stay")
        own = numbered(coupling, family.omega)
        yield f"{many} at ω_{r} with the cart still, in antiphase{own} [Σ φᵀb = 0];"
    if family.cart_mode is None or family.splitting is None:
        yield f"{'the' if several else 'The'} one that moves the cart has gone to infinite frequency [m_dyn(∞) = 0]."
        return
    moved, bare = coupling.cart_modes[family.cart_mode], " without dampers" if coupling.scene.has_damping else ""
    yield (
        f"{'one moves' if several else 'It moves'} the cart, at {rad(moved.omega)}"
        f"{numbered(coupling, moved.omega)} [m_dyn(ω) = 0], Δω = {short(family.splitting)} rad/s away{bare} "
        f"[ω_zero − ω_{r}]."
    )
    if isinf(family.strength):
        yield f"No other inertia opposes it [m_{r} = 0]."
        return
    guess = f", which to first order gives Δω ≈ {short(family.first_order)} rad/s [½ ε_{r} ω_{r}]{_guide(family)}"
    if abs(family.strength) > STRONG:
        guess = ", too strong for first order"
    elif not family.is_first_order:
        guess = f"; m_{r} changes too much up to the zero for first order"
    yield (
        f"Coupling strength ε_{r} = {short(family.strength)} [μ_{r}/m_{r}; m_{r} = {short(family.rest)} kg is the "
        f"dynamic mass of all else at ω_{r}]{guess}."
    )


def _guide(family: Family) -> str:
    return GUIDE if abs(family.strength) > ROUGH else NEAR if family.is_rough else ""


def _beats(coupling: Coupling, family: Family) -> Iterator[str]:
    """Beats within a family."""
    if family.fold == 1 or family.splitting is None:
        return
    passed = family.exchange
    if passed is None and family.is_first_order:
        yield "Dampers drain some of its pendula faster than others: what two of them exchange is said below."
        return
    if passed is None:
        yield "The coupling is too strong, or another family too near, for beats within this one."
        return
    share, n = "", family.fold
    if not passed.lossless:
        yield from _damped_beats(coupling, family, passed)
        return
    if len(family.members) == 1:
        share = f", of which the others hold {percent(4 * (n - 1) / n**2)} halfway [4(N − 1)/N², N = {n}]"
    yield (
        f"One pendulum set swinging alone in this mode recovers its energy after {short(passed.period)} s [2π/|Δω|]"
        f"{share}; a run shorter than half of that shows only part of the "
        f"exchange{_guide(family)}."
    )


def _damped_beats(coupling: Coupling, family: Family, passed: Transfer) -> Iterator[str]:
    """The effect of dampers on beats."""
    sigma = float(coupling.own.rate[family.members[0]])
    if sigma >= family.omega:
        yield "Joint dampers make its pendula overdamped [σ ≥ ω]: there are no beats."
        return
    aside = ", its drives aside," if coupling.scene.is_driven else ""
    most = f"the others never hold more than {left(passed.most)} of the energy given"
    if not passed.beats:
        yield (
            "There are no beats: the motion of the cart decays before its phase has run away from the rest "
            f"[−Re Δλ > Im Δλ]. Of one pendulum set swinging alone{aside}, {most}{_guide(family)}."
        )
        return
    yield (
        f"One pendulum set swinging alone in this mode{aside} recovers {left(passed.left)} of its energy after a "
        f"beat of {short(passed.period)} s [2π/Im Δλ]: dampers take the rest, and {most}{_guide(family)}."
    )


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


def exchanges(coupling: Coupling) -> Iterator[str]:
    """A sentence about each pair of modes of different pendula, or about all of them where there are many."""
    if len(coupling.names) == 1 or not coupling.on_cart:
        return
    if len(coupling.own.omega) > MOST_MODES:
        yield from _many(coupling)
        return
    yield from (_pair(coupling, pair) for pair in coupling.pairs[:MOST_LISTED])
    if not coupling.pairs:
        yield (
            "No inertia but that of the pendula opposes them [m = 0]: they move together and exchange no energy in "
            "beats."
        )
    elif (left := len(coupling.pairs) - MOST_LISTED) > 0:
        yield f"{left} more pairs are {ELSEWHERE}."


def _pair(coupling: Coupling, pair: EnergyExchange) -> str:
    own = coupling.own
    a, b = (member(coupling, k) for k in (pair.first, pair.second))
    strength = max(float(own.mass[k] * own.count[k]) for k in (pair.first, pair.second)) / abs(pair.cart_mass)
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
    creeping = [capital(member(coupling, k)) for k in (pair.first, pair.second) if own.rate[k] >= own.omega[k]]
    if creeping:
        return f"{listed(creeping, len(creeping))}: overdamped by its joints [σ ≥ ω], no beats."
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


def _many(coupling: Coupling) -> Iterator[str]:
    """The first modes of many different pendula: their spread against their collective coupling."""
    own, dynamic = coupling.own, coupling.dynamic
    first = own.number == 1
    omega, mass = own.omega[first], float((own.mass * own.count)[first].sum())
    middle, spread = float(np.median(omega)), float(np.ptp(omega))
    left_out = np.isin(np.arange(len(dynamic.omega)), coupling.pole[first])
    rest = float(dynamic([middle], left_out=left_out[None])[0])
    shift = middle * mass / (2 * rest) if rest else float("inf")
    yield (
        f"{len(own.omega)} modes of {len(coupling.names)} kinds are too many to list in pairs. Their first modes "
        f"spread over {short(spread)} rad/s [max ω_r − min ω_r] about {rad(middle)} [median], "
        f"{short(spread / max(1, len(omega) - 1))} rad/s from one to the next in the mean; swinging alike they would "
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
    return f"{name} at {rad(mode.omega)} (cart {'still' if mode.still else 'moves'}{whose})"


def _mode(coupling: Coupling, mode: Damped) -> str:
    first = (
        f"{capital(_named(coupling, mode))}: damping ratio {short(mode.ratio)} [σ/ω], rate {short(mode.rate)} 1/s "
        f"[σ = φᵀDφ/2φᵀMφ], {short(mode.from_cart)} of it from the cart's damper [c_c φ_x²/2φᵀMφ] and "
        f"{short(mode.from_joints)} from the joints [Σ d_i(θ_i − θ_i−1)²/2φᵀMφ]"
        + (f", {short(mode.from_drag)} from drag [Σ drag_k(h_kᵀφ)²/2φᵀMφ]" if mode.from_drag else "")
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
    most = NEGLIGIBLE * max(mode.rate for mode in modes)
    spared = [mode for mode in modes if mode.decay <= NEGLIGIBLE * first.decay and mode.rate <= most]
    if spared:
        each = "; ".join(_named(coupling, mode) for mode in spared[:MOST_DAMPED])
        rest = f"; and {len(spared) - MOST_DAMPED} more" if len(spared) > MOST_DAMPED else ""
        yield f"Not damped at all [σ = 0]: {each}{rest}. In the end only these swing."
        if first.from_cart and all(mode.still for mode in spared):
            yield "What leaves the cart still survives a damper on it: antiphase, as Huygens saw."
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


def _unsaid(coupling: Coupling) -> Iterator[str]:
    if coupling.on_cart:
        yield (
            "Conservative modes let pendula exchange energy and do nothing else: each mode keeps its own amplitude for "
            "ever, so no detuning, however small, makes pendula lock."
        )
        yield (
            "To fall into step they need something that drains some modes and something that feeds others; which "
            "family then wins depends on both, and on the amplitude. What is said of damping and of a drive here holds "
            "at small angles."
        )
    if coupling.on_cart and any(link.drag for link in coupling.scene.links()):
        yield (
            "The exchange of energy counts the drag of pendula on a cart at rest, to first order: what it does to the "
            "cart, and through the cart to others, is in the damped modes alone."
        )
    yield (
        "All frequencies are those of small angles. The table, whose numbers the modes have here, says how far each "
        "can be trusted."
    )
