"""The list of measures: what can be measured of a scene or of its motion, and by which verb.

Each is stated once, with its columns, what it needs, what it is read off and, for a verb that does not take it, the
reason.  How each is computed stands in `nonlinear.ensembles.measures` for motions side by side and in
`nonlinear.sweeps.measures` for scenes one by one, which take the former where both can.

>>> from nonlinear.measures import MEASURES, taken_by
>>> MEASURES["lyapunov"].columns, "beat" in taken_by("basins")
(('lyapunov_per_s',), False)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite

from modal.errors import SceneError, spelling_hint
from modal.report import Displayed, Summary

VERBS = ("sweep", "basins", "spread", "ensemble")
"""Who takes measures: three commands, and the function `ensemble`."""
LONGEST = 1e6  # seconds
MODES, MODE, SECONDS = "modes", "mode", "seconds"
SCENE_ITSELF, WHOLE_MOTION, MEMBERS_AT_ONCE = "the scene", "a whole motion", "members side by side"
LAST_TENTH = "the last tenth of a motion"
"""What measures are read off."""
FORMER = {"amplitude": "largest_angle, with cart_travel beside it"}
"""Names of old, and what they are now."""


@dataclass(frozen=True, repr=False)
class Measure(Displayed):
    """A measure: what `words` say, in these `columns`, whose names end in the unit unless there is none.

    In columns R stands for the number of a mode, P for that of a pendulum, L for that of a link.  `counts` says what
    the N of NAME:N is, "" where there is none; `usual` is N unless told, 0 where that depends on the scene, `most` its
    largest.  `needs` says what a scene must have, `reads` what it is read off, `numbered` whether its columns or values
    number modes, `refused` by which verbs it is not taken and why.
    """

    name: str
    words: str
    columns: tuple[str, ...]
    needs: str
    counts: str = SECONDS
    usual: float = 0.0
    most: float = LONGEST
    reads: str = SCENE_ITSELF
    numbered: bool = False
    refused: Mapping[str, str] = field(default_factory=dict, compare=False)

    def _summary(self) -> Summary:
        facts = [("columns", ", ".join(self.columns)), ("needs", self.needs)]
        return Summary(f"Measure {self.name}: {self.words}", facts)

    @property
    def whole(self) -> bool:
        """Whether N is a whole number."""
        return self.counts != SECONDS

    def validate(self, number: float) -> float:
        """The N itself; SceneError where it is none of such a measure."""
        if not self.counts:
            raise SceneError([f"measure {self.name}:{number:g}: {self.name} takes no number"])
        kind = f"a {'whole ' * self.whole}number above 0 and at most {self.most:g}"
        if not (isfinite(number) and 0 < number <= self.most) or (self.whole and number != int(number)):
            raise SceneError([f"measure {self.name}:{number:g}: must have {kind}"])
        return number


def _refusing(verbs: str, why: str) -> dict[str, str]:
    return dict.fromkeys(verbs.split(), why)


OF_SCENE = _refusing("basins ensemble", "it belongs to a scene whatever its start, and sweep takes it over numbers")
WHOLE = _refusing("basins ensemble", "it is read off a whole motion, and an ensemble keeps none: sweep takes it")
NAMES = _refusing("spread", "it names a motion, and names have no quantiles: basins tells the share of each")
NEXT = "mode N (default: the first oscillating mode) and the next"
OSCILLATING, MOTION, PLANE = "modes that oscillate", "a motion", "motion in the plane"

MEASURES: dict[str, Measure] = {
    measure.name: measure
    for measure in (
        Measure(
            name="frequencies",
            words="the frequencies of the N slowest oscillating modes",
            columns=("omega_R_rad_per_s",),
            needs=OSCILLATING,
            counts=MODES,
            usual=4,
            most=1000,
            numbered=True,
            refused=OF_SCENE,
        ),
        Measure(
            name="damping",
            words="the damping ratios of the N slowest oscillating modes",
            columns=("damping_ratio_R",),
            needs=OSCILLATING,
            counts=MODES,
            usual=4,
            most=1000,
            numbered=True,
            refused=OF_SCENE,
        ),
        Measure(
            name="splitting",
            words=f"the gap between the frequencies of {NEXT}",
            columns=("splitting_R_rad_per_s",),
            needs=OSCILLATING,
            counts=MODE,
            most=1000,
            numbered=True,
            refused=OF_SCENE,
        ),
        Measure(
            name="beat",
            words=f"the beat period of {NEXT}",
            columns=("beat_R_s",),
            needs=OSCILLATING,
            counts=MODE,
            most=1000,
            numbered=True,
            refused=OF_SCENE,
        ),
        Measure(
            name="floquet",
            words="the largest Floquet multiplier of a vertical sine, its growth rate, and what small motion does",
            columns=("largest_multiplier", "growth_rate_per_s", "kind"),
            needs="a support that moves up and down as a sine",
            counts="",
            refused=OF_SCENE,
        ),
        Measure(
            name="largest_angle",
            words="the largest angle of any link in N seconds",
            columns=("largest_angle_deg",),
            needs=MOTION,
            reads=WHOLE_MOTION,
            usual=10,
        ),
        Measure(
            name="cart_travel",
            words="the way between the cart's turning points in N seconds",
            columns=("cart_travel_m",),
            needs="a cart",
            reads=WHOLE_MOTION,
            usual=10,
            refused=WHOLE,
        ),
        Measure(
            name="energy_drift",
            words="the largest drift of energy in N seconds, relative to its range",
            columns=("energy_drift",),
            needs=MOTION,
            reads=WHOLE_MOTION,
            usual=10,
            refused=_refusing("basins ensemble", "an ensemble states the drift of every member beside its measures"),
        ),
        Measure(
            name="first_turn",
            words="the time at which each link first goes over the top, inf where none does in N seconds",
            columns=("first_turn_P_L_s",),
            needs=PLANE,
            reads=MEMBERS_AT_ONCE,
            usual=10,
        ),
        Measure(
            name="lyapunov",
            words="the largest Lyapunov exponent, from N seconds of the motion after half as many",
            columns=("lyapunov_per_s",),
            needs=PLANE,
            reads=MEMBERS_AT_ONCE,
        ),
        Measure(
            name="order",
            words="the order parameter of the phases, its mean over the last tenth of N seconds, from 0 to 1",
            columns=("order",),
            needs="motion in the plane, with constant lengths",
            reads=LAST_TENTH,
            usual=100,
        ),
        Measure(
            name="pendulum_energy",
            words="the mean energies over the last tenth of N seconds: of all pendula, of each, of what carries them",
            columns=("pendula_energy_J", "pendulum_P_energy_J", "cart_energy_J"),
            needs=MOTION,
            reads=LAST_TENTH,
            usual=100,
            refused=_refusing("basins", "it has a number for every pendulum, and a map shows one"),
        ),
        Measure(
            name="survivor",
            words="the mode with most energy after N seconds, and its share",
            columns=("survivor", "survivor_share"),
            needs=PLANE,
            reads=WHOLE_MOTION,
            usual=100,
            numbered=True,
            refused=WHOLE | NAMES,
        ),
        Measure(
            name="locking",
            words="the time from which that mode has 99 %, within N seconds",
            columns=("locking_time_s",),
            needs=PLANE,
            reads=WHOLE_MOTION,
            usual=100,
            refused=WHOLE,
        ),
        Measure(
            name="configuration",
            words="the steady oscillation of sync in which the motion ends after N seconds, by its number, 0 for none",
            columns=("configuration",),
            needs="drives at joints",
            reads=LAST_TENTH,
            usual=100,
            refused=NAMES,
        ),
        Measure(
            name="attractor",
            words="the periodic motion in which the motion ends after N seconds, by its number, 0 for none",
            columns=("attractor",),
            needs="sines that drive it, and losses",
            reads=MEMBERS_AT_ONCE,
            refused=_refusing(
                "sweep spread ensemble",
                "attractors are told apart among many starts: basins maps them, a sweep of strobes follows them",
            ),
        ),
        Measure(
            name="section",
            words="the states at which an angle or the cart passes a value, section:theta[1,1]>0",
            columns=("crossing_…",),
            needs=PLANE,
            reads=MEMBERS_AT_ONCE,
            counts="",
            refused=_refusing("sweep basins spread", "crossings are states: the command section draws them"),
        ),
    )
}
"""All measures, by name."""


def taken_by(verb: str) -> tuple[str, ...]:
    """The names of the measures that one of the VERBS takes."""
    return tuple(name for name, measure in MEASURES.items() if verb not in measure.refused)


def measure_for(verb: str, text: str) -> Measure:
    """The measure that a text such as "beat:3" names; SceneError where there is none, or one that a verb refuses."""
    name = text.partition(":")[0]
    if name not in MEASURES:
        now = f" (is now {FORMER[name]})" if name in FORMER else ""
        hint = now or spelling_hint(name, taken_by(verb)) or f" (must be one of {', '.join(taken_by(verb))})"
        raise SceneError([f"measure {text}: no such measure{hint}"])
    measure = MEASURES[name]
    if why := measure.refused.get(verb):
        raise SceneError([f"measure {text}: {verb} does not take {name}: {why}"])
    return measure


def parse_request(verb: str, text: str) -> tuple[Measure, float]:
    """The measure in a text such as "frequencies:6" and its N, `usual` where it has none; SceneError for a mistake.

    >>> from nonlinear.measures import parse_request
    >>> parse_request("sweep", "frequencies:6")[1], parse_request("sweep", "largest_angle")[1]
    (6.0, 10)
    """
    measure, (_, colon, number) = measure_for(verb, text), text.partition(":")
    if not colon:
        return measure, measure.usual
    try:
        value = float(number)
    except ValueError:
        raise SceneError([f'measure {text}: "{number}" is not a number']) from None
    return measure, measure.validate(value)


def columns_of(name: str, columns: Sequence[str]) -> tuple[str, ...]:
    """Those of some columns that belong to a measure, by the beginnings of its own.

    >>> from nonlinear.measures import columns_of
    >>> columns_of("first_turn", ["energy_drift", "first_turn_1_1_s"])
    ('first_turn_1_1_s',)
    """
    prefixes = tuple(column.partition("_R")[0].partition("_P")[0] for column in MEASURES[name].columns)
    return tuple(column for column in columns if column.startswith(prefixes))
