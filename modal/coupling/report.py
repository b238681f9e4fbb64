"""The coupling of a scene as a report: the verdict, the table of families, what both omit, and everything in words.

Its JSON form has every number, units in the names, None if it is infinite or undefined; modes are numbered as in the
table.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from textwrap import TextWrapper, wrap
from typing import Any

from modal.coupling.analysis import Coupling
from modal.coupling.damping import Damped
from modal.coupling.dynamic_mass import CartMode
from modal.coupling.families import EnergyExchange, Family, FamilyRow, family_name, family_table
from modal.coupling.verdict import damping, verdict
from modal.coupling.words import (
    ELSEWHERE,
    exchanges,
    families,
    limits,
    list_limit,
    own_mode_words,
    pendula_words,
    push_words,
)
from modal.report import Form, as_json, counted, entitled, finite, line_width, markdown, rad, titled
from modal.scene import describe, title_of
from modal.scene.doors import checked

FORMS = ("text", "markdown", "json")
WHAT = "what couples the pendula"


@dataclass(frozen=True)
class ReportSection:
    """A title and sentences."""

    title: str
    sentences: tuple[str, ...]


@checked
def coupling_report(coupling: Coupling, form: Form = "text", *, words: bool = False, elsewhere: str = "") -> str:
    """The report as "text", "markdown" or "json", the last with every number (units in the names).

    First the verdict, then a table of the families, then what both omit, which ends with the sentence `elsewhere` on
    where to find more. `words` adds every number in a sentence with its formula. Raise ValueError for another form.
    """
    if form not in FORMS:
        raise ValueError(f"form = {form!r}: must be one of {', '.join(FORMS)}")
    rows = coupling.rows()
    sentences, omissions = verdict(coupling, rows), left_out(coupling)
    if form == "json":
        return as_json({**coupling_record(coupling), "verdict_sentences": list(sentences), "left_out": list(omissions)})
    names = {family_name(index) for index in range(list_limit(coupling))}
    rows = [row for row in rows if row.family in names]
    parts = [
        "\n".join(_verse(sentences, form)),
        family_table(rows).written(form),
        "\n".join(_verse([*_columns(coupling, rows), *omissions, *filter(None, (elsewhere,))], form)),
    ]
    told_in_words = sections(coupling) if words else ()
    if form == "markdown":
        return _markdown(entitled(title_of(coupling.scene), WHAT), parts, told_in_words)
    return titled(title_of(coupling.scene), WHAT, [*parts, *map(_text, told_in_words)], form)


def _verse(sentences: Sequence[str], form: str) -> Sequence[str]:
    """A sentence a line."""
    if form == "markdown":
        return [f"- {markdown(sentence)}" for sentence in sentences]
    return [line for sentence in sentences for line in wrap(sentence, line_width(), break_on_hyphens=False)]


def _columns(coupling: Coupling, rows: Sequence[FamilyRow]) -> Iterator[str]:
    """The meanings of the table's columns."""
    if any(row.splitting is not None for row in rows):
        rest, carriers = ("all else", "something else") if coupling.scene.is_structured else ("the cart", "the cart")
        shift = (
            f"the shift of the mode that moves {carriers}" if coupling.reduced.d else "how far each mode lies from ω"
        )
        yield f"Each family: pendula that swing at ω with {rest} held. Δω: {shift}."
        if any(family.beats and len(family.branches) > 1 for family in coupling.families):
            yield "Beat: 2π over the difference of two Δω of the family, the slowest."
        if coupling.scene.has_damping and any(row.beat is not None for row in rows):
            yield "Δω is without dampers, the beat with them: hence it is not 2π/Δω."
    if any(row.share is not None for row in rows):
        yield (
            "Share: the largest part of one pendulum's energy that the others ever receive; dampers dissipate the rest."
            if coupling.scene.has_damping
            else "Share: the part of one pendulum's energy that the others have after half a beat."
        )


def left_out(coupling: Coupling) -> tuple[str, ...]:
    """Return sentences on what the verdict and the table omit."""
    return tuple(_left_out(coupling))


def _left_out(coupling: Coupling) -> Iterator[str]:
    families, limit = coupling.families, list_limit(coupling)
    if len(families) > limit:
        extra_families = counted(len(families) - limit, "more family is", "more families are")
        yield f"{extra_families} {ELSEWHERE}, up to {rad(families[-1].omega)}."
    locking = coupling.scene.is_structured or coupling.on_cart
    also = " Synchronization requires dampers and drives; see `sync`." * (locking and coupling.scene.n_pendula > 1)
    yield f"Large angles are omitted: the table of modes states at which angle a frequency is 1 % off.{also}"
    if coupling.rig.spatial:
        yield "Motion across the rail is omitted: there nothing couples the pendula at small angles."
    if coupling.secular and coupling.reduced.d and any(link.drag for link in coupling.scene.links()):
        rest = f"as if the {coupling.noun} were at rest"
        yield f"Beats count the drag of pendula {rest}; the damping of the modes has all of it."


def sections(coupling: Coupling) -> tuple[ReportSection, ...]:
    """The sections of the report."""
    on_structure = coupling.scene.is_structured
    support = [("The structure alone", own_mode_words)]
    if not on_structure:
        support = [("Dynamic mass of the cart" if coupling.on_cart else "Dynamic mass of a cart", push_words)]
    parts = [
        ("The pendula", pendula_words),
        *support,
        ("Families of modes", families),
        *[("The cart's mass from 0 to ∞", limits)] * (not on_structure),
        ("Exchange of energy between pendula", exchanges),
        ("Damping by mode" if on_structure else "Damping by family", damping),
    ]
    all_sections = (ReportSection(title, tuple(write(coupling))) for title, write in parts)
    return tuple(section for section in all_sections if section.sentences)


def _text(section: ReportSection) -> str:
    wrapper = TextWrapper(line_width(), "- ", "  ", break_long_words=False, break_on_hyphens=False)
    return "\n".join([section.title, "-" * len(section.title), *map(wrapper.fill, section.sentences)])


def _markdown(title: str, parts: Sequence[str], words: Sequence[ReportSection]) -> str:
    lines = [f"# {markdown(title)}"]
    for part in filter(None, parts):
        lines += ["", part]
    for section in words:
        lines += ["", f"## {section.title}", "", *(f"- {sentence}" for sentence in section.sentences)]
    return "\n".join(lines) + "\n"


# ----------------------------------------------------------------------------------------------------- the JSON form


def coupling_record(coupling: Coupling) -> dict[str, Any]:
    """The contents of the JSON form; a structure's own modes are s1, s2, … over its `coordinates`."""
    on_structure = coupling.scene.is_structured
    moving = {} if on_structure else {"cart_modes": [_cart_mode(coupling, mode) for mode in coupling.cart_modes]}
    return {
        "scene": describe(coupling.scene),
        **(_of_structure if on_structure else _of_cart)(coupling),
        "families": [_family(coupling, *entry) for entry in enumerate(coupling.families)],
        **moving,
        "pairs": [_pair(coupling, pair) for pair in coupling.pairs],
        "damping": [_damping_record(coupling, mode) for mode in coupling.damped_modes],
    }


def _of_cart(coupling: Coupling) -> dict[str, Any]:
    dynamic = coupling.dynamic
    return {
        "total_mass_kg": dynamic.at_rest if coupling.on_cart else None,
        "cart_mass_kg": dynamic.cart if coupling.on_cart else None,
        "residual_mass_kg": dynamic.residual,
        "cart_stiffness_n_per_m": dynamic.spring,
        "sum_rule_residual": coupling.residual(),
    }


def _of_structure(coupling: Coupling) -> dict[str, Any]:
    return {
        "coordinates": list(coupling.structure.names),
        "springs": len(coupling.structure.springs),
        "structure_modes": [
            {
                "omega_rad_per_s": mode.omega,
                "shape": mode.shape.tolist(),
                "mass": mode.mass,
                "mass_for_a_fast_push": float(fast),
            }
            for mode, fast in zip(coupling.modes, coupling.fast.tolist(), strict=True)
        ],
        "scene_modes_of_the_structure": [
            {"mode": coupling.number(omega), "omega_rad_per_s": omega, "structure_motion": motion.tolist()}
            for omega, motion in coupling.structure_modes
        ],
    }


def _family(coupling: Coupling, index: int, family: Family) -> dict[str, Any]:
    on_structure, is_unmoved = coupling.scene.is_structured, coupling.on_cart and family.still
    name, members = family_name(index), [_member(coupling, k) for k in family.members]
    share = family.exchange.most if family.exchange else None
    if not on_structure:
        moving = next((branch.omega for branch in family.branches if branch.is_finite), None)
        return {
            "family": name,
            "omega_cart_still_rad_per_s": family.omega,
            "members": members,
            "fold": family.fold,
            "modal_effective_mass_kg": family.mass,
            "dynamic_mass_of_the_rest_kg": finite(family.rest),
            "coupling_strength": finite(family.strength),
            "cart_mode": None if moving is None else coupling.number(moving),
            "mode_cart_still": coupling.number(family.omega) if is_unmoved else None,
            "splitting_rad_per_s": family.splitting,
            "beat_period_s": family.beat,
            "energy_share_of_the_others": share,
            "energy_left_after_a_beat": family.exchange.left if family.exchange and family.beat else None,
        }
    return {
        "family": name,
        "omega_all_else_held_rad_per_s": family.omega,
        "members": members,
        "fold": family.fold,
        "combinations_that_move_nothing_else": family.still,
        "mode_of_these": coupling.number(family.omega) if family.still else None,
        "modal_effective_mass_kg": family.masses.tolist(),
        "modes": [
            {
                "mode": coupling.number(branch.omega),
                "omega_rad_per_s": branch.omega,
                "splitting_rad_per_s": branch.splitting,
                "coupling_strength": finite(branch.strength),
                "structure_still": branch.still,
                "structure_motion": branch.motion.tolist(),
                "modal_effective_mass_kg": coupling.effective_mass(family, branch),
                "beat_period_s": coupling.beat(family, branch),
                "pattern": branch.pattern.tolist(),
            }
            for branch in family.branches
            if branch.is_finite
        ],
        "beat_periods_s": list(family.beats),
        "energy_share_of_the_others": share,
    }


def _member(coupling: Coupling, k: int) -> dict[str, Any]:
    modes = coupling.fixed_base
    return {
        "pendulum": coupling.names[modes.kind[k]],
        "mode_of_the_pendulum": int(modes.number[k]),
        "copies": int(modes.count[k]),
        "modal_effective_mass_of_one_kg": float(modes.mass[k]),
    }


def _pair(coupling: Coupling, pair: EnergyExchange) -> dict[str, Any]:
    size: dict[str, float | None] = {"coupling_strength": pair.strength}
    if coupling.on_cart:
        size = {"dynamic_mass_between_kg": finite(pair.cart_mass)}
    is_pair = pair.alone or not coupling.on_cart
    return {
        "first": _member(coupling, pair.first),
        "second": _member(coupling, pair.second),
        "detuning_rad_per_s": pair.detuning,
        "coupling_rad_per_s": pair.coupling,
        **size,
        "energy_share": pair.share if is_pair else None,
        "beat_period_s": finite(pair.period) if is_pair and pair.exchange.beats else None,
        "energy_left_after_a_beat": pair.exchange.left if is_pair and pair.exchange.beats else None,
    }


def _cart_mode(coupling: Coupling, mode: CartMode) -> dict[str, Any]:
    return {
        "mode": coupling.number(mode.omega),
        "omega_rad_per_s": mode.omega,
        "cart_participation": mode.participation,
        "omega_massless_cart_rad_per_s": finite(mode.light),
        "omega_immense_cart_rad_per_s": mode.heavy,
        "family": None if mode.family is None else family_name(mode.family),
    }


def _damping_record(coupling: Coupling, mode: Damped) -> dict[str, Any]:
    return {
        "mode": coupling.number(mode.omega),
        "omega_rad_per_s": mode.omega,
        "fold": mode.fold,
        "cart_still": mode.still,
        "pendulum": mode.kind,
        "rate_from_cart_per_s": mode.from_cart,
        "rate_from_joints_per_s": mode.from_joints,
        "rate_from_drag_per_s": mode.from_drag,
        "rate_fed_by_drives_per_s": mode.from_drives,
        "damping_ratio_first_order": mode.ratio,
        "exact_rate_per_s": None if mode.exact is None else mode.decay,
        "exact_omega_rad_per_s": None if mode.exact is None else abs(mode.exact),
        "drive_gain_per_kg_m2": mode.excitation,
        "drive_threshold_n_m_s_per_rad": finite(mode.threshold),
    }
