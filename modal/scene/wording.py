"""Synonyms in scene files: other names of keys and kinds, and tables named by their kinds."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable

from modal.errors import spelling_hint

OTHER_NAMES = {
    **dict.fromkeys(("g", "g_m_per_s2", "gravitation", "gravity_m_per_s2"), "gravity"),
    **dict.fromkeys(("m", "mass_kg", "weight"), "mass"),
    **dict.fromkeys(("l", "length_m", "len", "rope"), "length"),
    **dict.fromkeys(("bobs", "rods", "bodies", "segments", "chain"), "links"),
    **dict.fromkeys(("n", "number", "copies", "repeat", "times"), "count"),
    **dict.fromkeys(("c", "damper", "friction_viscous", "viscous"), "damping"),
    **dict.fromkeys(("k", "spring_constant"), "stiffness"),
    **dict.fromkeys(("i", "moment_of_inertia", "j"), "inertia"),
    **dict.fromkeys(("armature", "rotor", "motor_inertia"), "rotor_inertia"),
    **dict.fromkeys(("gear", "gearing", "reduction"), "gear_ratio"),
    **dict.fromkeys(("cg", "com", "center", "centre_of_mass", "center_of_mass"), "centre"),
    **dict.fromkeys(("zeta", "damping_ratios"), "damping_ratio"),
    **dict.fromkeys(("mu", "friction_coeff", "coulomb"), "friction_coefficient"),
    **dict.fromkeys(("angle", "angles", "theta", "theta_deg"), "angles_deg"),
    **dict.fromkeys(("rates", "omega", "angular_velocity"), "rates_deg"),
    **dict.fromkeys(("initial", "initial_condition", "initial_conditions", "release"), "start"),
    **dict.fromkeys(("type", "shape"), "kind"),
    **dict.fromkeys(("description", "caption"), "title"),
    **dict.fromkeys(("f", "frequency", "freq", "f_hz"), "frequency_hz"),
    **dict.fromkeys(("phase", "phi"), "phase_deg"),
    **dict.fromkeys(("trolley", "carriage", "slider"), "cart"),
    **dict.fromkeys(("point", "point mass", "particle", "ball", "mass point"), "bob"),
    **dict.fromkeys(("stick", "bar", "beam", "uniform rod"), "rod"),
    **dict.fromkeys(("rigid", "rigid body", "compound", "solid"), "body"),
    **dict.fromkeys(("wall", "ceiling", "ground", "rigid support"), "fixed"),
    **dict.fromkeys(("shaken", "moving", "prescribed"), "moved"),
    **dict.fromkeys(("vdp", "van der pol", "vanderpol", "van_der_pol"), "van-der-pol"),
    **dict.fromkeys(("upright", "inverted", "standing", "upward"), "up"),
    **dict.fromkeys(("hanging", "downward", "hangs"), "down"),
    **dict.fromkeys(("2d", "planar"), "plane"),
    **dict.fromkeys(("3d", "spatial"), "space"),
}
"""What other programs and books call keys, kinds and words of a scene, in small letters."""
OUTSIDE = dict.fromkeys(
    ("spring", "elastic", "extensible", "rubber", "springpendulum", "spring pendulum", "elastic pendulum"),
    ": a link that stretches (an elastic pendulum) is not supported: SymPy mechanics derives one, MuJoCo simulates "
    "one as a "
    "slide joint with stiffness; the stiffness of a link is that of its joint, and [[spring]] joins supports",
)
"""Kinds of links that there are not, with the way out."""
TABLES = {
    "support": '[support] with kind = "{0}"',
    "links": 'links = [{{ kind = "{0}", … }}] in a [[pendulum]]',
    "drive": 'drive = {{ kind = "{0}", … }} in a link',
    "motion": 'motion = {{ kind = "{0}", … }} in [support] or [ground]',
    "force": '[[force]] with kind = "{0}"',
    "spring": '[[spring]] with kind = "{0}"',
}
"""How a part of each kind is written, by its key."""
NUMBER = re.compile(r"\s*([-+−]?\d+)(?:([.,])(\d+))?([eE][-+]?\d+)?\s*(?:[^\d.,].*)?")


def suggestion(word: str, known_words: Iterable[str]) -> str:
    """Return the meaning of a word, ` (did you mean …?)`, or "" if no known word is a synonym or similar.

    >>> suggestion("trolley", ["fixed", "cart"]), suggestion("Rod", ["bob", "rod"])
    (' (did you mean cart?)', ' (did you mean rod?)')
    """
    words = list(known_words)
    small = word.lower().strip()
    if small in OUTSIDE and "bob" in words:
        return OUTSIDE[small]
    for candidate in (OTHER_NAMES.get(small, ""), small):
        if candidate in words and candidate != word:
            return f" (did you mean {candidate}?)"
    return spelling_hint(word, words)


def as_table(kind: str, homes: dict[str, str]) -> str:
    """Return how to write a part whose table was named by its kind; "" if no key has parts of it.

    `homes` are the keys with the kinds that they have, as a message lists them.
    """
    key = next((key for key in TABLES if f'"{kind}"' in homes.get(key, "")), "")
    return TABLES[key].format(kind) if key else ""


def number_in(text: str) -> str:
    """Return the number in a text, as a scene file writes it, "" if there is none.

    >>> number_in("9,81 m/s²"), number_in("1.5"), number_in("one")
    ('9.81', '1.5', '')
    """
    match = NUMBER.fullmatch(text)
    if match is None:
        return ""
    integer_part, _, decimals, power = match.groups()
    return integer_part.replace("−", "-") + (f".{decimals}" if decimals else "") + (power or "")


def in_brackets(value: object, text: str) -> str:
    """Return how to write one value where a list is required."""
    direction = OTHER_NAMES.get(value.lower(), "") if isinstance(value, str) else ""
    return f"[{json.dumps(direction)}]" if direction in {"up", "down"} else f"[{text}]"
