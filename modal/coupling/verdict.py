"""The verdict on a coupling in at most five sentences: what couples, how strongly, how slowly it beats, what lasts.

A section of the report treats the effects of dampers and drives on each mode at length.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import isfinite

from modal.coupling.analysis import Coupling
from modal.coupling.damping import Damped
from modal.coupling.families import STRONG_COUPLING, WEAK_COUPLING, EnergyExchange, FamilyRow
from modal.coupling.words import SHARE_GIVEN_MIN, carrier_words, collective_words, fraction, member_words
from modal.modes.dissipation import stop_words
from modal.report import capital, counted, listed, rad, short
from modal.types import NOISE_OF_SUM

SCARCE = "at most 1 % of the energy of one passes to the others"
MOST_LETTERS = 40
"""Format: letters of the names of two pendula that fit in a sentence."""


def verdict(coupling: Coupling, rows: list[FamilyRow]) -> tuple[str, ...]:
    """The sentences, from the table of families."""
    sentences = [_coupling_words(coupling)]
    if coupling.is_coupled:
        sentences += [*_strength(rows), *_beats(coupling, rows), *_between(coupling)]
    return (*sentences, *_lasting(coupling))


def _coupling_words(coupling: Coupling) -> str:
    scene = coupling.scene
    pendula = counted(scene.n_pendula, "pendulum", "pendula")
    if not coupling.is_coupled:
        why = "moves as prescribed" if scene.is_moved else "does not move"
        if scene.n_pendula == 1:
            return f"Nothing is coupled: one pendulum hangs from a support that {why}."
        return f"Nothing couples the {pendula}: their support {why}, and each swings alone."
    if coupling.on_cart:
        dynamic = coupling.dynamic
        spring = f" on a spring of {short(dynamic.spring)} N/m" if dynamic.spring else ""
        cart = f"a cart of {short(dynamic.cart)} kg{spring}" if dynamic.cart else f"a massless cart{spring}"
        if scene.n_pendula == 1:
            return f"{capital(cart)} shifts the frequencies of its one pendulum, which has no partner."
        hanging = dynamic.with_cart(0.0).at_rest
        return f"{capital(cart)} couples {pendula} ({short(hanging)} kg)."
    if scene.n_pendula > 1 and not coupling.joins_pendula:
        return f"Nothing couples the {pendula} with each other: each swings with what it hangs from alone."
    n_springs = len(coupling.structure.springs)
    springs = "a spring" if n_springs == 1 else f"{n_springs} springs"
    parts = [carrier_words(coupling.structure)] * bool(coupling.reduced.d)
    parts += [springs] * bool(coupling.structure.springs)
    single = len(parts) == 1 and parts[0].startswith("a ")
    verb = "couples" if single else "couple"
    if scene.n_pendula == 1:
        return f"One pendulum hangs from {parts[0]}: each shifts the frequencies of the other."
    return f"{capital(' and '.join(parts))} {verb} {pendula}."


def _strength(rows: list[FamilyRow]) -> Iterator[str]:
    coupled_rows = [row for row in rows if row.strength is not None and row.splitting is not None]
    if not coupled_rows:
        return
    strongest = max(coupled_rows, key=lambda row: abs(row.strength or 0.0))
    size = abs(strongest.strength or 0.0)
    if not isfinite(size):
        yield f"The coupling is rigid: nothing else resists family {strongest.family}."
        return
    kind = "weak" if size <= WEAK_COUPLING else "moderate" if size <= STRONG_COUPLING else "strong"
    largest = "at most " if len(coupled_rows) > 1 else ""
    yield f"The coupling is {kind}: its strength is {largest}{size:.3g} (family {strongest.family})."


def _beats(coupling: Coupling, rows: list[FamilyRow]) -> Iterator[str]:
    """The slowest beat, or why there is none within families of several pendula."""
    beating = [row for row in rows if row.beat is not None]
    if not beating:
        yield from _no_beats(coupling)
        return
    row = max(beating, key=lambda row: row.beat or 0.0)
    share_words = ""
    if row.share is not None:
        part = "all the energy" if row.share > 1 - SHARE_GIVEN_MIN else f"{fraction(row.share)} of the energy"
        share_words = f"; after half a beat the other {'pendulum has' if row.fold == 2 else 'pendula have'} {part}"
        if coupling.scene.has_damping:
            who = "the other never receives" if row.fold == 2 else "the others never receive"
            share = fraction(row.share)
            share_words = f"; if one pendulum is set swinging alone, {who} more than {share} of the energy"
    slowest = "The slowest beat takes" if len(beating) > 1 else "The beat takes"
    yield f"{slowest} {row.beat:.4g} s (family {row.family}){share_words}."


def _no_beats(coupling: Coupling) -> Iterator[str]:
    """Why equal pendula do not beat, if there are any."""
    if all(family.fold == 1 for family in coupling.families):
        return
    why = "the coupling is too strong, or another mode too near"
    weak = [family for family in coupling.families if family.fold > 1 and family.is_first_order]
    if weak:
        scarce = any(family.exchange and family.exchange.beats for family in weak)
        why = "dampers end it" if coupling.scene.has_damping and not scarce else SCARCE
    yield f"Equal pendula do not beat: {why}."


def _between(coupling: Coupling) -> Iterator[str]:
    """The exchange between unequal pendula."""
    if len(coupling.names) == 1:
        return
    if words := collective_words(coupling):
        yield words
        return
    pairs = [pair for pair in coupling.pairs if _is_isolated(coupling, pair)]
    if not pairs:
        return
    pair = max(pairs, key=lambda pair: pair.exchange.most)
    names = [member_words(coupling, k) for k in (pair.first, pair.second)]
    who = " and ".join(names) if sum(map(len, names)) <= MOST_LETTERS else "pendula of different kinds"
    transfer, is_in_tune = pair.exchange, abs(pair.detuning) < 2 * abs(pair.coupling)
    period = f" in {transfer.period:.4g} s" if transfer.beats else ""
    why = ": dampers limit it" if is_in_tune else ": detuning limits it"
    if is_in_tune and (transfer.lossless or transfer.most > 0.5):
        why = ""
    part = f"{'at most' if why else 'up to'} {fraction(transfer.most)}"
    yield f"{capital(who)} exchange {part} of their energy{period}{why}."


def _is_isolated(coupling: Coupling, pair: EnergyExchange) -> bool:
    """Whether a pair of different families, whose beats the table does not have, is a pair by itself."""
    if any({pair.first, pair.second} <= set(family.members) for family in coupling.families):
        return False
    return pair.alone if coupling.on_cart else pair.strength <= STRONG_COUPLING and bool(pair.coupling)


def _lasting(coupling: Coupling) -> Iterator[str]:
    """The mode that outlives the others, and the effect of drives."""
    scene = coupling.scene
    if scene.is_driven:
        yield _driven(coupling)
        return
    if not scene.has_damping:
        has_friction = scene.has_friction or scene.has_drag
        else_ = " but friction or drag" if has_friction else ""
        yield f"Nothing{else_} dissipates energy: every mode keeps its amplitude{' at small angles' * has_friction}."
        return
    modes = coupling.damped_modes
    if not modes:
        return
    last, first = _slowest_and_fastest(modes)
    undamped_modes = [mode for mode in modes if mode.decay <= NOISE_OF_SUM * first.decay]
    if undamped_modes:
        who = capital(_subject(coupling, [mode.omega for mode in undamped_modes]))
        yield f"{who} not damped: in the end only {'this swings' if len(undamped_modes) == 1 else 'these swing'}."
    else:
        yield f"{capital(_name(coupling, last.omega))} lasts longest: it falls to 1/e in {1 / last.decay:.4g} s."


def _slowest_and_fastest(modes: Sequence[Damped]) -> tuple[Damped, Damped]:
    """The first modes that decay most slowly and fastest."""
    return min(modes, key=lambda mode: mode.decay), max(modes, key=lambda mode: mode.decay)


def _driven(coupling: Coupling) -> str:
    growing = [mode.omega for mode in coupling.damped_modes if mode.from_drives > mode.decay]
    if growing:
        several = len(set(map(coupling.number, growing))) > 1
        finds = "which of them wins" if several else "how far"
        return f"Drives make {_list_of_modes(coupling, growing)} grow from rest; `sync` finds {finds}."
    if any(mode.from_drives for mode in coupling.damped_modes):
        return "No mode grows from rest: the drives feed each less than its dampers take."
    return "Kicks sustain the swing, and have no rate at rest; `sync` finds which mode wins."


def _name(coupling: Coupling, omega: float) -> str:
    number = coupling.number(omega)
    return f"the mode at {short(omega)} rad/s" if number is None else f"mode {number}"


def _list_of_modes(coupling: Coupling, omegas: list[float]) -> str:
    """Modes 3 and 4; of many how many they are."""
    numbers = sorted({number for omega in omegas if (number := coupling.number(omega)) is not None})
    if not numbers or len(numbers) > 4:
        return f"{len(numbers) or len(omegas)} modes"
    return f"mode{'s' if len(numbers) > 1 else ''} {listed(list(map(str, numbers)), len(numbers))}"


def _subject(coupling: Coupling, omegas: list[float]) -> str:
    words = _list_of_modes(coupling, omegas)
    return f"{words} {'are' if words.startswith('modes') or words.endswith(' modes') else 'is'}"


MOST_DAMPED = 12
"""Format: modes about whose damping a report has a sentence each; more are in the JSON form."""
LET_GO_DEG = 10.0
"""Physics: largest angle from which the report lets modes go that dry friction stops, as its sentence says."""


def damping(coupling: Coupling) -> Iterator[str]:
    """Sentences about every mode, about the survivors, and about a drive."""
    yield from map(capital, stop_words(coupling.scene, LET_GO_DEG)[:MOST_DAMPED])
    if not (coupling.scene.has_damping or coupling.scene.is_driven):
        has_friction = coupling.scene.has_friction or coupling.scene.has_drag
        linear = "in the linear scene " * has_friction
        yield f"Nothing {'else ' * has_friction}dissipates energy [D = 0]: {linear}every mode keeps its amplitude."
        return
    modes = coupling.damped_modes
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


def _mode_name(coupling: Coupling, mode: Damped) -> str:
    """A mode by its frequency and the moving parts."""
    whose = f", {mode.kind}" if mode.kind else ""
    number = coupling.number(mode.omega)
    name = "the mode" if number is None else f"mode {number}"
    if coupling.scene.is_structured and not coupling.reduced.d:
        return f"{name} at {rad(mode.omega)}" + (f" ({mode.kind})" if mode.kind else "")
    return f"{name} at {rad(mode.omega)} ({coupling.noun} {'still' if mode.still else 'moves'}{whose})"


def _mode(coupling: Coupling, mode: Damped) -> str:
    carrier = "the cart's damper [c_c φ_x²/2φᵀMφ]"
    if coupling.scene.is_structured:
        carrier = "the dampers of the structure and its springs [ηᵀD_sη/2φᵀMφ]"
    first = (
        f"{capital(_mode_name(coupling, mode))}: damping ratio {short(mode.ratio)} [σ/ω], rate {short(mode.rate)} 1/s "
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
    return abs(mode.decay - mode.rate) <= WEAK_COUPLING * mode.rate


def _survivors(coupling: Coupling, modes: tuple[Damped, ...]) -> Iterator[str]:
    last, first = _slowest_and_fastest(modes)
    rate_limit = NOISE_OF_SUM * max(mode.rate for mode in modes)
    undamped_modes = [mode for mode in modes if mode.decay <= NOISE_OF_SUM * first.decay and mode.rate <= rate_limit]
    if undamped_modes:
        names = "; ".join(_mode_name(coupling, mode) for mode in undamped_modes[:MOST_DAMPED])
        rest = f"; and {len(undamped_modes) - MOST_DAMPED} more" if len(undamped_modes) > MOST_DAMPED else ""
        yield f"Not damped at all [σ = 0]: {names}{rest}. In the end only these swing."
        if first.from_cart and all(mode.still for mode in undamped_modes):
            yield f"What leaves the {coupling.noun} at rest survives a damper on it: antiphase, as Huygens observed."
    elif last.decay <= 0:
        yield (
            f"The slowest to decay is {_mode_name(coupling, last)}: its rate is beyond double precision next to "
            f"{_mode_name(coupling, first)}."
        )
    elif last.decay < first.decay:
        formula = "1/σ" if last.exact is None else "−1/Re λ"
        yield (
            f"The slowest to decay is {_mode_name(coupling, last)}: it falls to 1/e in {short(1 / last.decay)} s "
            f"[{formula}], {short(first.decay / last.decay)} times as long as the fastest, "
            f"{_mode_name(coupling, first)}."
        )


def _own_drives(coupling: Coupling, modes: tuple[Damped, ...]) -> Iterator[str]:
    """The effect of the scene's van der Pol torques; the kicks of escapements have no rate at equilibrium."""
    driven_modes = [mode for mode in modes if mode.from_drives]
    for mode in driven_modes[:MOST_DAMPED]:
        net = mode.from_drives - mode.decay
        fate = "it grows from rest" if net > 0 else "it dies out nevertheless"
        feed = "[Σ e_i(θ_i − θ_i−1)²/2φᵀMφ]"
        words = f"The drives feed {_mode_name(coupling, mode)} with {short(mode.from_drives)} 1/s {feed}"
        yield f"{words}: {fate}, net {short(net)} 1/s."
    yield "Linear modes cannot predict which mode wins at large angles; `sync` can."


def _drive(coupling: Coupling, modes: tuple[Damped, ...]) -> Iterator[str]:
    excitable_modes = [mode for mode in modes if isfinite(mode.threshold)]
    if not excitable_modes or not all(map(_is_first_order, modes)):
        return
    first = min(excitable_modes, key=lambda mode: mode.threshold)
    yield (
        f"A drive that gives every pendulum the torque e θ_1' at its pivot starts {_mode_name(coupling, first)} first, "
        f"from e = {first.threshold:.4g} N m s/rad on [σ/F, F = Σθ_1²/2φᵀMφ = {short(first.excitation)} 1/(kg m²)]. "
        "Linear modes cannot predict which one wins at large angles."
    )
