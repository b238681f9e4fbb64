"""How the cart couples the pendula, in words with the scene's own numbers, each beside the formula it comes from."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from textwrap import TextWrapper

from modal.coupling.analysis import Coupling
from modal.coupling.coupling_records import coupling_record
from modal.coupling.damping_words import damping
from modal.coupling.report import families, limits, numbered, shown
from modal.coupling.talk_words import exchanges
from modal.report import WIDTH, counted, json_text, listed, markdown, rad, short, visible

FORMS = ("text", "markdown", "json")


@dataclass(frozen=True)
class Section:
    """A title and sentences."""

    title: str
    sentences: tuple[str, ...]


def coupling_report(coupling: Coupling, form: str = "text") -> str:
    """The page as "text", "markdown" or "json", the last with every number (units in the names).

    Raises ValueError for another form.
    """
    if form not in FORMS:
        raise ValueError(f"form = {form!r}: must be one of {', '.join(FORMS)}")
    if form == "json":
        return json_text(coupling_record(coupling)) + "\n"
    title = f"{coupling.scene.title or 'This scene'}: what couples the pendula"
    return (_markdown if form == "markdown" else _text)(title, sections(coupling))


def sections(coupling: Coupling) -> tuple[Section, ...]:
    """The page."""
    parts = (
        ("What hangs there", _scene),
        ("What the cart feels" if coupling.on_cart else "What a cart would feel", _felt),
        ("Families of modes", families),
        ("The cart's mass from 0 to ∞", limits),
        ("Who talks to whom", exchanges),
        ("Damping by family", damping),
        ("What this does not say", _unsaid),
    )
    found = (Section(title, tuple(write(coupling))) for title, write in parts)
    return tuple(section for section in found if section.sentences)


def _scene(coupling: Coupling) -> Iterator[str]:
    scene, dynamic = coupling.scene, coupling.dynamic
    kinds = f" of {counted(len(coupling.names), 'kind', 'kinds')}" if scene.n_pendula > 1 else ""
    what = (
        f"{counted(scene.n_pendula, 'pendulum', 'pendula')}{kinds}, {counted(scene.n_links, 'link', 'links')} and "
        f"{short(dynamic.with_cart(0.0).at_rest)} kg in all, {'hangs' if scene.n_pendula == 1 else 'hang'}"
    )
    if coupling.on_cart:
        yield f"{what} from a cart of {short(dynamic.cart)} kg: {short(dynamic.at_rest)} kg [M = m_c + Σ m]."
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
    yield (
        "All frequencies are those of small angles. The table, whose numbers the modes have here, says how far each "
        "can be trusted."
    )


# ------------------------------------------------------------------------------------------------------- dress


def _text(title: str, parts: tuple[Section, ...]) -> str:
    wrapper = TextWrapper(WIDTH, "- ", "  ", break_long_words=False, break_on_hyphens=False)
    lines = [visible(title), "=" * len(visible(title))]
    for part in parts:
        lines += ["", part.title, "-" * len(part.title), *map(wrapper.fill, part.sentences)]
    return "\n".join(lines) + "\n"


def _markdown(title: str, parts: tuple[Section, ...]) -> str:
    lines = [f"# {markdown(title)}"]
    for part in parts:
        lines += ["", f"## {part.title}", "", *(f"- {sentence}" for sentence in part.sentences)]
    return "\n".join(lines) + "\n"
