"""What signals and coordinates are called where people read: θ₁₂ or "tip of pendulum 1", not `theta_1_2` or `tip_1`.

Files, options and messages about them have the identifiers.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from modal.report import with_unit

SIGNALS = {
    "theta": "{angle}",
    "theta_dot": "rate of {angle}",
    "theta_relative": "relative {angle}",
    "rel": "relative {angle}",
    "rel_dot": "rate of relative {angle}",
    "joint": "lower end of {link}",
    "tip": "tip of {link}",
    "tip_ddot": "acceleration of the tip of {link}",
    "pivot_force": "force of {link} on its pivot",
    "torque": "torque on {link}",
    "force": "force on {link}",
    "x": "cart position",
    "x_dot": "cart velocity",
    "x_ddot": "cart acceleration",
    "cart_force": "force on the cart",
    "x_end": "horizontal position of the end of {link}",
    "y_end": "vertical position of the end of {link}",
    "acceleration_along": "acceleration along {link}",
    "acceleration_across": "acceleration across {link}",
}
"""The names of signals of linear models; others are words already."""
COLUMNS = {
    "omega": "ω",
    "survivor": "surviving mode",
    "survivor share": "its share of the energy",
    "order": "order parameter R",
    "lyapunov": "largest Lyapunov exponent",
}
"""The names of columns of measures whose keys do not say it."""
SUBSCRIPTS = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")
ANGLE = re.compile(r"theta[_[](\d+)[_,](\d+)\]?")
SIGNAL = re.compile(r"([a-z_]+?)((?:_\d+){0,2})(_relative)?(?:@([\d.]+))?")
COORDINATE = re.compile(r"(\w+?)(_d?dot)?_(?:m|rad)(?:_per_s2?)?")

UNITS = (
    ("_rad_per_s", "rad/s"),
    ("_deg_per_s", "°/s"),
    ("_m_per_s", "m/s"),
    ("_per_s", "1/s"),
    ("_deg", "°"),
    ("_rad", "rad"),
    ("_s", "s"),
    ("_m", "m"),
    ("_kg", "kg"),
    ("_J", "J"),
    ("_W", "W"),
    ("_N", "N"),
)
"""Units that columns of measures state at their ends."""


def angle_symbol(*place: int | str, between: str = "") -> str:
    """The angle of a link, by its pendulum and its number there; a comma separates longer numbers.

    >>> angle_symbol(1, 2), angle_symbol(12, 1)
    ('θ₁₂', 'θ₁₂,₁')
    """
    comma = "," if max(map(len, map(str, place))) > 1 else between
    return "θ" + comma.join(map(str, place)).translate(SUBSCRIPTS)


def symbols_in(text: str) -> str:
    """The text with the symbols of angles in place of their identifiers, `theta[1,2]` or `theta_1_2`.

    >>> symbols_in("crossings of theta[1,2]>0"), symbols_in("theta_1_2 and theta_2_1")
    ('crossings of θ₁₂>0', 'θ₁₂ and θ₂₁')
    """
    return ANGLE.sub(lambda match: angle_symbol(match[1], match[2]), text)


def link_names(labels: Sequence[str]) -> list[str]:
    """Names of the links whose angles are the coordinates `labels`: the number of link or pendulum, or the symbol.

    >>> link_names(["theta[1,1]", "theta[1,2]"]), link_names(["theta[1,1]", "theta[2,1]", "theta[2,2]"])
    (['link 1', 'link 2'], ['θ₁₁', 'θ₂₁', 'θ₂₂'])
    """
    places = [re.findall(r"\d+", label) for label in labels if label.startswith("theta[")]
    pendula = list(dict.fromkeys(pendulum for pendulum, _ in places))
    if len(pendula) == 1:
        return [f"link {link}" for _, link in places]
    if len(pendula) == len(places):
        return [f"pendulum {pendulum}" for pendulum in pendula]
    between = "," if max(map(len, (number for place in places for number in place))) > 1 else ""
    return [angle_symbol(*place, between=between) for place in places]


def signal_words(name: str) -> str:
    """A signal of a linear model or a sensor in words.

    >>> signal_words("theta_1_2"), signal_words("tip_1"), signal_words("floor2_m"), signal_words("support_acceleration")
    ('θ₁₂', 'tip of pendulum 1', 'floor2', 'support acceleration')
    >>> signal_words("theta_1_2_relative"), signal_words("acceleration_along_1_1@0.5")
    ('relative θ₁₂', 'acceleration along link 1 of pendulum 1 at 0.5 m')
    >>> signal_words("force"), signal_words("force_1_2"), signal_words("x")
    ('force', 'force on link 2 of pendulum 1', 'cart position')
    """
    match = SIGNAL.fullmatch(name)
    place = match[2].split("_")[1:] if match else []
    kind = f"{match[1]}{match[3] or ''}" if match else ""
    kind = f"{kind}_end" if kind in {"x", "y"} and place else kind
    if match and kind in SIGNALS and (place or "{link}" not in SIGNALS[kind]):
        owners = [f"{owner} {number}" for owner, number in zip(("pendulum", "link"), place, strict=False)]
        words = SIGNALS[kind].format(angle=angle_symbol(*place or ("",)), link=" of ".join(owners[::-1]))
        return f"{words} at {match[4]} m" if match[4] else words
    if coordinate := COORDINATE.fullmatch(name):
        order = {"_dot": "rate of ", "_ddot": "acceleration of "}.get(coordinate[2], "")
        name = order + coordinate[1]
    return name.replace("_", " ")


def signal_label(signal: Any) -> str:
    """A signal in words with its unit, as in headings."""
    return f"{signal_words(signal.name)} ({unit_words(signal.unit)})"


def unit_words(unit: str) -> str:
    """A unit as it is read, m/s² for m/s^2."""
    return unit.replace("^2", "²")


def column_words(column: str) -> tuple[str, str]:
    """A column's name and unit for display: ("omega 1", "rad/s")."""
    for ending, unit in UNITS:
        if column.endswith(ending):
            return column.removesuffix(ending).replace("_", " "), unit
    return column.replace("_", " "), ""


def column_name(column: str) -> str:
    """Return what a column of a measure is called, without its unit.

    >>> column_name("omega_2_rad_per_s"), column_name("first_turn_1_2_s"), column_name("beat_2_s")
    ('ω₂', 'first turn of θ₁₂', 'beat of mode 2')
    >>> column_name("omega_10a_rad_per_s"), column_name("theta_1_2_deg")
    ('ω₁₀a', 'θ₁₂')
    """
    name = column_words(column)[0]
    name = re.sub(r"^omega (\d+[a-z]*)$", lambda match: "ω" + match[1].translate(SUBSCRIPTS), name)
    name = re.sub(r"^theta (\d+) (\d+)$", lambda match: angle_symbol(match[1], match[2]), name)
    name = re.sub(r"^beat (\d+)", r"beat of mode \1", name)
    name = re.sub(r" (\d+) (\d+)$", lambda match: f" of {angle_symbol(match[1], match[2])}", name)
    return COLUMNS.get(name, name)


def column_label(column: str) -> str:
    """Return a column of a measure as a heading.

    >>> column_label("omega_2_rad_per_s")
    'ω₂ (rad/s)'
    """
    return with_unit(column_name(column), column_words(column)[1])
