"""Supported combinations: every capability with an entry for every feature, defined once and checked on input.

An entry is of one of these kinds; a test checks that no feature is without one:

    takes      it is in the result
    leaves     it is omitted, and the sentence is printed with the result
    refuses    SceneError before anything is computed: PLACE: WHAT WHY: THE WAY OUT, where WHY does not say it
    singly     it is taken, but members of an ensemble go one by one, for this reason
    unless     it is taken, except where this message says why not
    beside     it cannot be combined with this capability

`conflicts` are pairs of features that are supported alone but not together; a scene needs one feature of each set in
`needs`. `instead` is an alternative capability, which a refusal mentions if it supports the feature. The manual prints
the table (docs/reference/combinations.md).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Set
from typing import Any, NamedTuple

from modal.errors import refuse_any
from modal.scene.doors import require_type
from modal.scene.features import DRAG, DRIVES, FEATURES, FRICTION, LOSS
from modal.scene.model import Scene

Names = Set[str]
Sentences = Mapping[str, str]
NONE: Sentences = {}
KINDS = ("leaves", "refuses", "singly", "unless", "beside")
"""The kinds of entries that have sentences."""


class Capability(NamedTuple):
    """The entries of a capability for all features; its `name` begins the sentences of its refusals."""

    name: str
    takes: Names
    leaves: Sentences = NONE
    refuses: Sentences = NONE
    singly: Sentences = NONE
    unless: Sentences = NONE
    beside: Sentences = NONE
    conflicts: Mapping[tuple[str, str], str] = {}
    needs: Mapping[frozenset[str], str] = {}
    instead: tuple[str, str] = ("", "")

    def entries(self, feature: str) -> list[tuple[str, str]]:
        """Return the kind of every entry for a feature, with its sentence: exactly one."""
        sentences = [(kind, getattr(self, kind)[feature]) for kind in KINDS if feature in getattr(self, kind)]
        return [("takes", "")] * (feature in self.takes) + sentences


def _sentences(names: Names, why: str) -> Sentences:
    """One sentence for several features, each of which stands for {it} in it."""
    return {name: why.replace("{it}", FEATURES[name].words) for name in sorted(names)}


def _of(words: str) -> frozenset[str]:
    return frozenset(words.split())


# ------------------------------------------------------------------------------------------------------- features

SHAPE = _of("cart copies inverted joint_springs rotor")
STRUCTURED = _of("structure springs")
LINEAR = SHAPE | LOSS | {"massless_cart", "space"}
FORCED = _of("force constant_force")
ACTING = SHAPE | LOSS | DRAG | FORCED | {"moved_support", "load"}
DRIVEN_IN_TIME = _of("force moved_support")
LOOPS = _of("feedback limited_feedback sampled_feedback reference")
LOSING = LOSS | DRAG | FRICTION | {"van_der_pol"}

# ------------------------------------------------------------------------------------------------------- sentences

UNDRIVEN = "Drives are omitted: they sustain small swings without changing the modes."
RUBBING = "Dry friction is omitted: at a given amplitude it acts as a damping ratio, and eventually it stops a swing."
SMALL = {UNDRIVEN, "Quadratic drag is omitted: it dies out with the square of the speed."}
"""Sentences on features without effect in linear models."""
GRIPPED = (
    "Dry friction on the rail is omitted: at a given amplitude it acts as a damping ratio, and eventually it holds the "
    "cart, below which the load swings on as from a fixed support."
)
ABOUT: Sentences = {
    **_sentences(DRIVES, UNDRIVEN),
    "moved_support": "The support's motion is omitted: the modes are those about a support at rest.",
    "force": "Forces that change in time are omitted: the modes are those about the equilibrium without them.",
    "joint_friction": RUBBING,
    **_sentences(FRICTION - {"joint_friction"}, GRIPPED),
    "quadratic_drag": "Quadratic drag is omitted: it dies out with the square of the speed.",
}
HOISTED = "Lengths change with the hoist: these are the modes at the lengths before it; hoist lists them along it."
OMITTED: Sentences = {"hoist": HOISTED, **ABOUT}
"""The omissions of the linear model of a scene; `ABOUT` where lengths are constant."""

HELD: Sentences = {
    **OMITTED,
    "hoist": "Lengths change with the hoist: these are the equations at the lengths before it.",
}
"""The omissions of equations in symbols."""

IN_LOOPS: Sentences = {
    "limited_feedback": "Limits of feedback are omitted: small motions do not reach them.",
    "sampled_feedback": "Samples and delays of feedback are omitted: these are the poles of continuous loops.",
    "reference": "References of feedback are omitted: these are the poles about the rest.",
}
"""The omissions of linear models with closed loops."""

CONSTANT: Sentences = {"hoist": "needs constant lengths"}
SHIFTED: Sentences = {"constant_force": "is computed about links that hang or stand straight, which it tilts"}
LEANING: Sentences = {"constant_force": "there is no equilibrium"}
"""Constant forces move the equilibrium, and a scene is linearized about it; or they leave none."""
STILL: Sentences = {
    "moved_support": "needs a support at rest; simulate follows a moved one",
    **_sentences(FORCED, "needs a scene without forces; simulate takes them"),
}
IN_TIME_ALONE: Sentences = {name: words for name, words in STILL.items() if name not in LEANING}
PLANE: Sentences = {"space": "is computed in the plane"}
NO_RATIO: Sentences = {"damping_ratio": "does not support damping ratios of modes"}
STICKS = _sentences(FRICTION, "does not support stick-slip motion")
SWITCHES: Sentences = {**STICKS, "escapement": "does not end its steps at kicks"}
LOSSES = _sentences(LOSS - {"damping_ratio"}, "needs a scene without losses")
UNDAMPED: Sentences = {
    "damping_ratio": "The damping ratio is omitted: natural frequencies and shapes are the same without it."
}
LOSSLESS: Sentences = {
    "loss": "Loss angles are omitted: they are a complex stiffness at each frequency, which response, vibration and "
    "table take."
}
IN_TIME: Sentences = {
    "loss": "does not support loss angles, which are defined at a frequency: response, vibration and table take them"
}
"""The sentence on k (1 + iφ): no equations of motion in time have such a spring."""
UNLOADED: Sentences = {"load": "only `simulate` takes applied forces"}
HANGS_STRAIGHT = "a massless cart has no equation of motion where all that pulls it hangs straight down"
ENDS: Sentences = {"massless_cart": HANGS_STRAIGHT}
STOPS: Sentences = {"massless_cart": "the step needed is smaller than the spacing between numbers"}
NO_INERTIA: Sentences = {"massless_cart": "has no equation of motion where all that pulls the cart hangs straight down"}
NO_SMOOTH: Sentences = {"escapement": "needs smooth motion, without kicks"}
NO_SERIES = "has a series of a sine or of polynomials only"
KINK: Sentences = {"quadratic_drag": "has no series across the kink of |v| v at rest"}
ALONE = _sentences(FRICTION | _of("space escapement sampled_feedback"), "does not support {it}; engine simulate does")
TOGETHER = {"escapement", "joint_friction", "rail_friction", "rail_coefficient"}
BESIDE_NONE = {name: words for name, words in ALONE.items() if name not in TOGETHER}
HOISTING = {
    ("hoist", "damping_ratio"): "a hoist changes the modes that have damping ratios",
}
MINIMAL = ("form minimal", "form minimal takes it")
UNRUBBED = {
    (kind, name): "dry friction on structures is not solved" for kind in sorted(STRUCTURED) for name in FRICTION
}
"""Combinations that are refused: dry friction, and structures or springs between points."""
AIRLESS = {
    (kind, name): "Hill's equations on structures do not include drag"
    for kind in sorted(STRUCTURED)
    for name in sorted(DRAG)
}
EXCITED = {DRIVES | {"active_law"}: "nothing drives this scene; add a drive to a joint"}

# ------------------------------------------------------------------------------------------------------- the table

AT_ONE_TIME: Sentences = {"hoist": "needs constant lengths: take those of one time, `Scene.at(seconds)`"}
TABLE = Capability(
    "the table of modes",
    LINEAR | STRUCTURED | {"loss", "feedback", "sampled_feedback"},
    leaves={**OMITTED, **{name: words for name, words in IN_LOOPS.items() if name != "sampled_feedback"}},
    unless=LEANING,
    conflicts={("feedback", "loss"): "loops are closed in time, where no spring has a loss angle"},
)
CONSTANT_MODEL = Capability(
    "a constant linear model",
    LINEAR - {"massless_cart"} | STRUCTURED | {"feedback"},
    leaves={**ABOUT, **LOSSLESS, **IN_LOOPS},
    refuses=AT_ONE_TIME,
    unless={"massless_cart": "the mass matrix is singular", **LEANING},
)
MOVED_MODEL = CONSTANT_MODEL._replace(
    name="a linear model of a moved support",
    takes=CONSTANT_MODEL.takes - {"feedback"},
    leaves={**ABOUT, **LOSSLESS},
)
RESPONDING: Sentences = {**ABOUT, **IN_LOOPS}
GROWS = {**CONSTANT_MODEL.unless, "inverted": "grows by itself"}
AVERAGED = Capability(
    "averaging",
    SHAPE - {"inverted"} | LOSS | {"joint_friction"} | DRIVES | STRUCTURED,
    refuses={
        **STILL,
        **CONSTANT,
        **PLANE,
        **NO_INERTIA,
        "inverted": "needs hanging links",
        "quadratic_drag": "has no exact average of quadratic drag",
        **_sentences(FRICTION - {"joint_friction"}, "cannot tell when a cart sticks"),
    },
)

PERIODIC = Capability(
    "a periodic orbit",
    SHAPE | LOSS | DRAG | DRIVES | FRICTION | STRUCTURED | {"constant_force"},
    refuses={**IN_TIME_ALONE, **CONSTANT, **PLANE},
    unless=ENDS,
)

FORCED_ORBIT = Capability(
    "a forced periodic orbit",
    SHAPE | LOSS | DRAG | FRICTION | DRIVES | FORCED | STRUCTURED | {"moved_support"},
    refuses={**CONSTANT, **PLANE},
    unless=ENDS,
    needs={DRIVEN_IN_TIME: 'nothing drives this scene: give it a [[force]], or a support of kind = "moved"'},
)

SECTIONED = Capability(
    "a Poincaré section",
    SHAPE | STRUCTURED,
    refuses={
        **STILL,
        **_sentences(_of("moved_support force"), "needs a motion that keeps its energy: find_strobes takes it"),
        **CONSTANT,
        **PLANE,
        **_sentences(LOSS | DRAG | FRICTION | DRIVES, "needs a motion that keeps its energy"),
    },
    unless=ENDS,
)
STROBED = Capability(
    "a stroboscopic section",
    SHAPE | LOSS | DRAG | FRICTION | DRIVES | FORCED | STRUCTURED | {"moved_support", "hoist"},
    refuses=PLANE,
    unless=STOPS,
    needs={DRIVEN_IN_TIME: "a stroboscopic section needs a period: a sine that moves the support or acts as a force"},
)

TOGETHER_LOOPS = LOOPS - {"sampled_feedback"}
SIDE_BY_SIDE = Capability(
    "engine numpy",
    SHAPE | DRAG | LOSS | DRIVES | TOGETHER | FORCED | STRUCTURED | TOGETHER_LOOPS | {"moved_support", "hoist"},
    refuses=BESIDE_NONE,
    unless=STOPS,
)

UNSWITCHED = Capability(
    "a method other than DOP853",
    ACTING | {"van_der_pol", "hoist", "space"} | STRUCTURED | LOOPS,
    refuses=SWITCHES,
    unless=ENDS,
    instead=("form minimal", "method DOP853 takes it"),
)

BODILESS: Sentences = {
    "structure": "does not support structures",
    "springs": "does not support springs between points",
}
STRUCTURES: Sentences = {
    "structure": "does not support structures yet",
    "springs": "does not support springs between points yet",
}
UNTOLD: Sentences = {**STRUCTURES, **IN_TIME, "feedback": "does not close loops of feedback"}
"""Default refusals of a capability for structures, loss angles and feedback."""


LIKE = {"law": (), "active_law": ("van_der_pol",), "kinked_law": ()}
"""The entry of a joint law, by its nature, from the entries of springs and dampers."""
SPATIAL_LAWS = {("space", "law"): "a joint in space bends about two axes, and a law has one"}
LEANING_LAWS = {("law", "constant_force"): "the equilibrium under a force is found without laws"}
"""Entries that do not extend to joint laws."""
SPATIAL_ROTORS = {("space", "rotor"): "a joint in space bends about two axes, and a rotor turns about one"}


def _with_laws(capability: Capability) -> Capability:
    """A capability with entries for joint laws by their nature.

    What is omitted because it vanishes at small angles, or sustains small swings, is no reason: laws have derivatives.
    """
    taken = set(capability.takes)
    sentences: dict[str, Any] = {kind: dict(getattr(capability, kind)) for kind in KINDS}
    for name, models in LIKE.items():
        entries = [entry for model in models for entry in capability.entries(model)]
        reasons = [(kind, why) for kind, why in entries if kind in KINDS and not (kind == "leaves" and why in SMALL)]
        if not reasons and not capability.entries(name):
            taken.add(name)
        for kind, why in reasons[:1]:
            sentences[kind][name] = why
    conflicts = {**SPATIAL_LAWS, **SPATIAL_ROTORS, **LEANING_LAWS, **capability.conflicts}
    return capability._replace(takes=taken, conflicts=conflicts, **sentences)


def _complete(capability: Capability) -> Capability:
    """A capability with default entries, for structures, losses, loads and friction."""
    refusals_of_silent = {name: words for name, words in UNTOLD.items() if not capability.entries(name)}
    load_sentences = {} if capability.entries("load") else UNLOADED
    friction_conflicts = UNRUBBED if capability.takes & FRICTION and capability.takes >= STRUCTURED else {}
    completed = capability._replace(
        refuses={**capability.refuses, **refusals_of_silent},
        beside={**capability.beside, **load_sentences, **_of_loops(capability)},
        conflicts={**friction_conflicts, **capability.conflicts},
    )
    return _with_laws(completed)


def _of_loops(capability: Capability) -> Sentences:
    """The entries of kinds of loops where feedback itself is refused or omitted."""
    silent = [name for name in sorted(LOOPS - {"feedback"}) if not capability.entries(name)]
    why = "has no part in what is refused or left out as feedback"
    return {} if "feedback" in capability.takes else dict.fromkeys(silent, why)


CAPABILITIES: dict[str, Capability] = {
    capability.name: _complete(capability)
    for capability in (
        TABLE,
        TABLE._replace(name="mode shapes", takes=TABLE.takes - {"loss"}, leaves={**TABLE.leaves, **LOSSLESS}),
        Capability(
            "the explanation of the coupling",
            LINEAR - {"inverted"} | {"structure", "springs"},
            leaves={**OMITTED, **LOSSLESS},
            refuses={**SHIFTED, "inverted": "has no frequency for a standing link"},
        ),
        CONSTANT_MODEL,
        CONSTANT_MODEL._replace(name="a frequency response", takes=CONSTANT_MODEL.takes | {"loss"}, leaves=RESPONDING),
        CONSTANT_MODEL._replace(name="an impulse response", leaves=RESPONDING, refuses={**AT_ONE_TIME, **IN_TIME}),
        MOVED_MODEL,
        MOVED_MODEL._replace(
            name="a shock",
            leaves=ABOUT,
            refuses={**MOVED_MODEL.refuses, **IN_TIME},
        ),
        MOVED_MODEL._replace(
            name="random vibration",
            takes=MOVED_MODEL.takes - {"inverted"} | {"loss"},
            leaves=ABOUT,
            unless=GROWS,
        ),
        CONSTANT_MODEL._replace(
            name="thermal noise",
            takes=CONSTANT_MODEL.takes - {"inverted", "feedback"} | {"loss"},
            leaves=ABOUT,
            unless=GROWS,
        ),
        Capability(
            "a shaper",
            LINEAR - {"inverted"} | STRUCTURED,
            leaves={**OMITTED, **LOSSLESS},
            unless={"inverted": "is unstable", **LEANING},
            needs={_of("cart structure"): 'support.kind: a shaper needs kind = "cart", or a structure'},
        ),
        Capability(
            "a derivative of modes",
            LINEAR - NO_RATIO.keys() | STRUCTURED,
            leaves={**OMITTED, **LOSSLESS},
            refuses={**NO_RATIO, **SHIFTED},
        ),
        Capability(
            "tuning",
            LINEAR - NO_RATIO.keys() - {"massless_cart", "inverted"} | STRUCTURED,
            leaves=OMITTED,
            refuses={
                "damping_ratio": "cannot vary damping ratios of modes",
                "inverted": "needs a stable equilibrium",
            },
            unless={"massless_cart": "the mass matrix is singular", **LEANING},
        ),
        Capability(
            "a derivation",
            SHAPE | {"dampers", "massless_cart", "space", "structure", "springs"},
            leaves={**HELD, **LOSSLESS, **UNDAMPED},
            refuses={**SHIFTED, **_sentences(_of("linear_drag"), "has no symbols for {it}")},
        ),
        Capability(
            "a free-body diagram",
            SHAPE | DRAG | FRICTION | DRIVES | FORCED | {"dampers", "massless_cart", "moved_support"},
            leaves={"hoist": HELD["hoist"], **LOSSLESS},
            refuses={
                "space": "is drawn in the plane",
                "damping_ratio": "has no part on which dampers of modes act",
                "structure": "is drawn for pendula on one cart or on a fixed support",
                "springs": "is drawn for parts that only joints hold together",
            },
        ),
        Capability(
            "a polynomial in ω²",
            LINEAR - LOSS,
            leaves={**OMITTED, **LOSSLESS, **UNDAMPED},
            refuses={**LOSSES, **SHIFTED, **BODILESS},
        ),
        Capability(
            "an enclosure",
            LINEAR - LOSS | STRUCTURED,
            leaves={**OMITTED, **LOSSLESS, **UNDAMPED},
            refuses={**LOSSES, "law": "reads numbers of springs alone"},
            unless=LEANING,
        ),
        Capability(
            "the live page",
            SHAPE | {"dampers", "moved_support", "force"} | DRAG | DRIVES | FRICTION | STRUCTURED,
            refuses=_sentences(_of("constant_force hoist space damping_ratio massless_cart loss"), "cannot show {it}"),
            conflicts={
                ("rotor", name): "the live page cannot show dry friction together with rotors" for name in FRICTION
            },
        ),
        Capability(
            "form minimal",
            ACTING | FRICTION | DRIVES | STRUCTURED | LOOPS | {"hoist"},
            refuses=PLANE,
            unless=ENDS,
            conflicts={
                **HOISTING,
                ("hoist", "escapement"): "kicks act on constant lengths",
            },
        ),
        Capability(
            "form spatial",
            (ACTING | {"space"}) - NO_RATIO.keys(),
            refuses={
                **NO_RATIO,
                "hoist": "changes lengths in the plane only",
                **_sentences(FRICTION | DRIVES, "acts on angles in the plane"),
            },
            unless=ENDS,
            beside=_sentences(STRUCTURED, "a structure moves in the plane"),
            needs={_of("space"): 'form spatial: works in space only: set space = "space"'},
        ),
        Capability(
            "form maximal",
            ACTING | {"hoist", "van_der_pol"},
            refuses={**PLANE, **STICKS, **NO_SMOOTH, **BODILESS},
            unless=ENDS,
            conflicts=HOISTING,
            instead=MINIMAL,
        ),
        Capability(
            "form hamiltonian",
            ACTING | STRUCTURED | LOOPS - {"sampled_feedback"} | {"van_der_pol", "space"},
            refuses={**STICKS, **NO_SMOOTH, **CONSTANT, "sampled_feedback": "takes no samples"},
            unless=ENDS,
            conflicts={("space", "damping_ratio"): "motion in space has no damping ratios"},
            instead=MINIMAL,
        ),
        Capability(
            "method taylor",
            SHAPE | LOSS | {"van_der_pol"} | STRUCTURED | {"constant_force", "feedback", "reference"},
            refuses={
                "limited_feedback": "has no series across the kink where an input reaches its limit",
                "sampled_feedback": NO_SERIES,
                **PLANE,
                **SWITCHES,
                **KINK,
                "kinked_law": "has no series across a kink",
                "load": "has no series of forces from Python",
            },
            unless={**ENDS, **_sentences(_of("moved_support force hoist"), NO_SERIES)},
            instead=("form minimal", "method DOP853 takes it"),
        ),
        Capability(
            "a proved motion",
            SHAPE | LOSS | {"van_der_pol"} | STRUCTURED | {"constant_force", "feedback", "reference"},
            refuses={
                "limited_feedback": "has no series across the kink where an input reaches its limit",
                **_sentences(_of("hoist sampled_feedback"), "follows sines in time alone"),
                **PLANE,
                **SWITCHES,
                "kinked_law": "has no series across a kink",
                "load": "has no series of forces from Python",
            },
            unless={**ENDS, **KINK, **_sentences(_of("moved_support force"), "follows sines in time alone")},
        ),
        Capability(
            "compiled equations",
            SHAPE | {"van_der_pol"} | STRUCTURED | {"dampers"},
            refuses=_sentences(
                FRICTION | DRAG | FORCED | LOOPS | _of("escapement space hoist moved_support damping_ratio load"),
                "do not cover {it}",
            ),
            unless=ENDS,
            conflicts={
                ("rotor", name): "compiled equations of structures have no rotors" for name in sorted(STRUCTURED)
            },
            instead=("form minimal", "method DOP853 takes it"),
        ),
        UNSWITCHED,
        UNSWITCHED._replace(
            name="an implicit method",
            takes=UNSWITCHED.takes - {"space"},
            refuses={**UNSWITCHED.refuses, "space": "cannot keep the constraints of motion in space"},
        ),
        SIDE_BY_SIDE,
        SIDE_BY_SIDE._replace(
            name="engine numba",
            takes=SIDE_BY_SIDE.takes - {"moved_support", "force"},
            unless={
                **STOPS,
                **_sentences(_of("moved_support force"), "takes no sweep, and no sine together with a record"),
            },
        ),
        SIDE_BY_SIDE._replace(name="an ensemble", refuses=NONE, singly=BESIDE_NONE),
        Capability(
            "motion in a few modes",
            SHAPE | LOSS | STRUCTURED | {"quadratic_drag"},
            refuses={
                **STILL,
                **_sentences(
                    DRIVEN_IN_TIME, "has no error estimate where what acts in time moves modes that are left out"
                ),
                **CONSTANT,
                **PLANE,
                **STICKS,
                **_sentences(DRIVES, "has no drives"),
                **NO_INERTIA,
            },
        ),
        Capability(
            "motion in closed form",
            LINEAR | STRUCTURED,
            leaves=_sentences(DRIVES, UNDRIVEN),
            refuses={**STILL, **CONSTANT, **STICKS, "quadratic_drag": "has no term for quadratic drag"},
            conflicts={("space", "damping_ratio"): "motion in space has no damping ratios"},
        ),
        Capability(
            "a comparison of methods",
            ACTING - {"load"} | FRICTION | DRIVES | STRUCTURED | LOOPS | {"space", "hoist"},
            unless=ENDS,
        ),
        Capability(
            "a check of modes",
            LINEAR | STRUCTURED,
            leaves={**OMITTED, **LOSSLESS},
            unless=LEANING,
            conflicts={("space", "damping_ratio"): "motion in space has no damping ratios"},
        ),
        Capability(
            "a comparison with modes",
            SHAPE | LOSS | DRAG | FRICTION | DRIVES | STRUCTURED | DRIVEN_IN_TIME,
            refuses={**CONSTANT, **PLANE},
            unless={**ENDS, **LEANING},
        ),
        Capability(
            "a periodic orbit of a mode",
            SHAPE - {"inverted"} | STRUCTURED,
            leaves={
                "dampers": "Dampers are omitted: the orbits of a mode conserve energy.",
                "loss": "Loss angles are omitted: the orbits of a mode conserve energy.",
                "damping_ratio": "Damping ratios are omitted: the orbits of a mode conserve energy.",
                **_sentences(DRAG, "Drag is omitted: the orbits of a mode conserve energy."),
                **_sentences(FRICTION, "Dry friction is omitted: the orbits of a mode conserve energy."),
                **_sentences(DRIVES, "Drives are omitted: the orbits of a mode conserve energy."),
                "moved_support": "The support's motion is omitted: the orbits of a mode conserve energy.",
                "force": "Forces that change in time are omitted: the orbits of a mode conserve energy.",
                "hoist": "The hoist is omitted: the orbits of a mode are those at the lengths before it.",
            },
            refuses={**SHIFTED, **PLANE},
            unless={"inverted": "grows without swinging", "massless_cart": HANGS_STRAIGHT},
        ),
        PERIODIC,
        PERIODIC._replace(name="a limit cycle", needs=EXCITED),
        FORCED_ORBIT,
        Capability(
            "a Lyapunov exponent",
            SHAPE | LOSS | DRAG | FRICTION | DRIVES | FORCED | STRUCTURED | {"moved_support", "hoist"},
            refuses=PLANE,
            unless=STOPS,
        ),
        Capability(
            "a model along a motion",
            SHAPE | LOSS | DRAG | FORCED | STRUCTURED | {"moved_support", "van_der_pol"},
            refuses={**STICKS, **PLANE, **AT_ONE_TIME, "escapement": "has no term for kicks"},
            unless=ENDS,
        ),
        SECTIONED,
        Capability(
            "a start by its energy",
            SHAPE | STRUCTURED | LOSS | DRAG | FRICTION | DRIVES | {"force"},
            refuses={
                **PLANE,
                "moved_support": "counts energy in a frame at rest",
                "hoist": "counts no energy of a rope that is wound up",
                "constant_force": "counts no energy of forces",
            },
            unless=ENDS,
        ),
        STROBED,
        STROBED._replace(
            name="an attractor",
            needs={
                DRIVEN_IN_TIME: "an attractor needs a period: a sine that moves the support or acts as a force",
                LOSING: "an attractor needs losses: dampers, drag or friction",
            },
        ),
        Capability(
            "a Floquet multiplier",
            SHAPE - {"cart"} | LOSS | STRUCTURED | {"quadratic_drag", "moved_support", "space"},
            refuses={
                **_sentences(FORCED, "needs a scene without forces"),
                **_sentences(FRICTION, "does not support stick-slip motion"),
                **_sentences(DRIVES, "is computed without drives"),
                "hoist": "needs constant lengths",
            },
            conflicts=AIRLESS,
            beside=_sentences(_of("cart massless_cart"), "a cart is not a support that moves as prescribed"),
            needs={_of("moved_support"): 'support.kind: a Floquet multiplier needs kind = "moved"'},
        ),
        AVERAGED,
        AVERAGED._replace(name="a prediction of synchronization", needs=EXCITED),
        AVERAGED._replace(name="a branch of configurations", needs=EXCITED),
        Capability(
            "synchronization",
            SHAPE - {"inverted"} | LOSS | DRAG | FRICTION | DRIVES | STRUCTURED | DRIVEN_IN_TIME,
            refuses={**SHIFTED, **CONSTANT, **PLANE, "inverted": "compares phases of hanging pendula"},
            unless=ENDS,
        ),
        Capability(
            "a fit of motions",
            SHAPE | {"dampers", "moved_support", "hoist"} | DRAG | FRICTION | DRIVES | FORCED | STRUCTURED,
            refuses={**PLANE, "damping_ratio": "holds the dampers of modes while it varies these"},
            unless=ENDS,
        ),
    )
}


def refusals(scene: Scene, capability: str, *further_features: str) -> list[str]:
    """Return a sentence for every feature of a scene, with the `further_features` of a call, that is refused."""
    require_type("scene", scene, "Scene")
    rules, has = CAPABILITIES[capability], scene.features | set(further_features)
    reasons = [f"{_place(scene, name)}: {rules.name} {_why(rules, name)}" for name in rules.refuses if name in has]
    reasons += [f"{_place(scene, a)}: {why}: remove {b}" for (a, b), why in rules.conflicts.items() if {a, b} <= has]
    return reasons + [why for names, why in rules.needs.items() if not names & has]


def _matches(sentences: Sentences, has: Names) -> Iterator[tuple[str, str]]:
    return ((name, why) for name, why in sentences.items() if name in has)


def _why(capability: Capability, name: str) -> str:
    """Return why a capability refuses a feature, and the remedy."""
    why, (substitute, words) = capability.refuses[name], capability.instead
    advice = f"; {words}" if substitute and name in CAPABILITIES[substitute].takes else ""
    return why if ": " in why else f"{why}: {FEATURES[name].mend}{advice}"


def _place(scene: Scene, name: str) -> str:
    return next(FEATURES[name].places(scene), name)


def require(scene: Scene, capability: str, *further_features: str) -> None:
    """Raise SceneError with every reason unless the scene, with the `further_features` of the call, is supported.

    >>> from modal import load
    >>> require(load("huygens"), "a Poincaré section")
    Traceback (most recent call last):
    ...
    modal.errors.SceneError: ...
    """
    refuse_any(refusals(scene, capability, *further_features))


def left_out(scene: Scene, capability: str = "the table of modes") -> tuple[str, ...]:
    """Return a sentence for each feature of a scene that a capability ignores."""
    require_type("scene", scene, "Scene")
    idle = [f"spring[{k}] does nothing: its stiffness and damping are 0." for k in scene.idle_springs]
    return tuple(
        dict.fromkeys([*(words for _, words in _matches(CAPABILITIES[capability].leaves, scene.features)), *idle])
    )


def one_by_one(scene: Scene, *further_features: str) -> str:
    """Return why members of a scene, some with `further_features`, are simulated one at a time; "" if at once."""
    require_type("scene", scene, "Scene")
    matches = _matches(CAPABILITIES["an ensemble"].singly, scene.features | set(further_features))
    return next((f"no engine takes {FEATURES[name].words} side by side" for name, _ in matches), "")
