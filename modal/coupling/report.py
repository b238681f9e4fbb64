"""The coupling of a scene as a report: the verdict, the table of families, what both leave out, and all in words."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import isinf
from textwrap import TextWrapper, wrap

from modal.coupling.analysis import CartMode, Coupling, Family
from modal.coupling.damping_words import damping
from modal.coupling.exchange import STRONG, Transfer
from modal.coupling.exchange_words import exchanges
from modal.coupling.families import FamilyRow, family_cells, family_name
from modal.coupling.records import coupling_record, structure_record
from modal.coupling.structure_words import structure_sections
from modal.coupling.structures import StructureCoupling
from modal.coupling.verdict import verdict
from modal.coupling.wording import ELSEWHERE, GUIDE, MOST_LISTED, ROUGH, left, member, numbered, shown
from modal.report import Form, as_json, counted, grid, headed, line_width, listed, markdown, percent, rad, short
from modal.scene import title_of
from modal.scene.doors import checked

FORMS = ("text", "markdown", "json")
NEAR = " (approximate: another family is near)"


@dataclass(frozen=True)
class ReportSection:
    """A title and sentences."""

    title: str
    sentences: tuple[str, ...]


@checked
def coupling_report(
    coupling: Coupling | StructureCoupling, form: Form = "text", *, words: bool = False, elsewhere: str = ""
) -> str:
    """The report as "text", "markdown" or "json", the last with every number (units in the names).

    First the verdict, then a table of the families, then what both leave out, which ends with the sentence `elsewhere`
    on where more is.  `words` adds every number in a sentence with its formula.  Raises ValueError for another form.
    """
    if form not in FORMS:
        raise ValueError(f"form = {form!r}: must be one of {', '.join(FORMS)}")
    rows = coupling.rows()
    told, left = verdict(coupling, rows), left_out(coupling)
    if form == "json":
        record = structure_record if isinstance(coupling, StructureCoupling) else coupling_record
        return as_json({**record(coupling), "verdict_sentences": list(told), "left_out": list(left)})  # type: ignore[arg-type]
    title = f"{title_of(coupling.scene)}: what couples the pendula"
    names = {family_name(index) for index in range(shown(coupling))}
    rows = [row for row in rows if row.family in names]
    headings, cells = family_cells(rows)
    parts = [
        "\n".join(_verse(told, form)),
        grid(cells, headings, form),
        "\n".join(_verse([*_columns(coupling, rows), *left, *filter(None, (elsewhere,))], form)),
    ]
    return (_markdown if form == "markdown" else _text)(title, parts, sections(coupling) if words else ())


def _verse(sentences: Sequence[str], form: str) -> Sequence[str]:
    """A sentence a line."""
    if form == "markdown":
        return [f"- {markdown(sentence)}" for sentence in sentences]
    return [filled for sentence in sentences for filled in wrap(sentence, line_width(), break_on_hyphens=False)]


def _columns(coupling: Coupling | StructureCoupling, rows: Sequence[FamilyRow]) -> Iterator[str]:
    """What the columns of the table mean."""
    if any(row.splitting is not None for row in rows):
        held, moved = ("the cart", "the cart") if isinstance(coupling, Coupling) else ("all else", "something else")
        yield f"Each family: pendula that swing at ω with {held} held. Δω: the shift of the mode that moves {moved}."
    if any(row.share is not None for row in rows):
        yield (
            "Share: the most of one pendulum's energy that the others ever hold; dampers take the rest."
            if coupling.scene.has_damping
            else "Share: what the others hold of one pendulum's energy after half a beat."
        )


def left_out(coupling: Coupling | StructureCoupling) -> tuple[str, ...]:
    """Sentences on what the verdict and the table leave out."""
    return tuple(_left_out(coupling))


def _left_out(coupling: Coupling | StructureCoupling) -> Iterator[str]:
    every, most = coupling.families, shown(coupling)
    if len(every) > most:
        more = counted(len(every) - most, "more family is", "more families are")
        yield f"{more} {ELSEWHERE}, up to {rad(every[-1].omega)}."
    locking = isinstance(coupling, StructureCoupling) or coupling.on_cart
    also = " Locking takes dampers and drives (`sync`)." if locking and coupling.scene.n_pendula > 1 else ""
    yield f"Large angles are left out: the table of modes tells at which angle a frequency is 1 % off.{also}"
    if isinstance(coupling, StructureCoupling):
        return
    if coupling.rig.spatial:
        yield "Motion across the rail is left out: there nothing couples the pendula at small angles."
    if coupling.on_cart and any(link.drag for link in coupling.scene.links()):
        yield "Beats count the drag of pendula as if the cart were at rest; the damping of the modes has all of it."


def sections(coupling: Coupling | StructureCoupling) -> tuple[ReportSection, ...]:
    """The sections of the report."""
    if isinstance(coupling, StructureCoupling):
        written = (ReportSection(title, tuple(sentences)) for title, sentences in structure_sections(coupling))
        return tuple(section for section in written if section.sentences)
    return _of_cart(coupling)


def _of_cart(coupling: Coupling) -> tuple[ReportSection, ...]:
    parts = (
        ("What hangs there", _scene),
        ("What the cart feels" if coupling.on_cart else "What a cart would feel", _felt),
        ("Families of modes", families),
        ("The cart's mass from 0 to ∞", limits),
        ("Exchange of energy between pendula", exchanges),
        ("Damping by family", damping),
    )
    written = (ReportSection(title, tuple(write(coupling))) for title, write in parts)
    return tuple(section for section in written if section.sentences)


def _text(title: str, parts: Sequence[str], words: Sequence[ReportSection]) -> str:
    wrapper = TextWrapper(line_width(), "- ", "  ", break_long_words=False, break_on_hyphens=False)
    lines = [headed(title)]
    for part in filter(None, parts):
        lines += ["", part]
    for section in words:
        lines += ["", section.title, "-" * len(section.title), *map(wrapper.fill, section.sentences)]
    return "\n".join(lines) + "\n"


def _markdown(title: str, parts: Sequence[str], words: Sequence[ReportSection]) -> str:
    lines = [f"# {markdown(title)}"]
    for part in filter(None, parts):
        lines += ["", part]
    for section in words:
        lines += ["", f"## {section.title}", "", *(f"- {sentence}" for sentence in section.sentences)]
    return "\n".join(lines) + "\n"


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
        yield "The cart and all that hangs from it can also drift together [ω = 0]."


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
    number = "" if coupling.on_cart else numbered(coupling, family.omega)
    head = (
        f"Family {r}, ω_{r} = {rad(family.omega)}{number} [K φ = ω² A φ]: {who}, of modal effective mass "
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
        number = numbered(coupling, family.omega)
        yield f"{many} at ω_{r} with the cart still, in antiphase{number} [Σ φᵀb = 0];"
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
        held = "all of it" if n == 2 else percent(4 * (n - 1) / n**2)
        share = f"; halfway, the others hold {held} [4(N − 1)/N², N = {n}]"
    yield (
        f"One pendulum set swinging alone in this mode recovers its energy after {short(passed.period)} s [2π/|Δω|]"
        f"{share}. A run shorter than half of that shows only part of the exchange{_guide(family)}."
    )


def _damped_beats(coupling: Coupling, family: Family, passed: Transfer) -> Iterator[str]:
    """The effect of dampers on beats."""
    sigma = float(coupling.fixed_base.rate[family.members[0]])
    if sigma >= family.omega:
        yield "Joint dampers make its pendula overdamped [σ ≥ ω]: there are no beats."
        return
    aside = ", its drives aside," if coupling.scene.is_driven else ""
    most = f"the others never hold more than {left(passed.most)} of the energy given"
    if not passed.beats:
        yield (
            "There are no beats: the motion of the cart decays before it has run out of phase with the rest "
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
