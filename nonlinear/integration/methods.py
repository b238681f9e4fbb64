"""The choice of equations, body and integrator for a run, with its reason, from estimated costs.

Times (s) are those of benchmarks/simulation.py.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from math import pi

import numpy as np

from modal.errors import SceneError, refuse_any, spelling_hint
from modal.scene import CAPABILITIES, Scene, refusals, validate_scene
from nonlinear.dynamics import (
    Banded,
    Generated,
    GroupBody,
    Hamiltonian,
    Maximal,
    Minimal,
    Recursion,
    Reduced,
    Spatial,
    SpatialRecursion,
    Symmetry,
    form_of,
    loses_digits,
    without_interrupts,
)
from nonlinear.dynamics.inputs import Inputs
from nonlinear.integration import taylor
from nonlinear.integration.arguments import TIGHTEST, estimate_timescales
from nonlinear.integration.kernels import integrator
from nonlinear.integration.readiness import Forgone, Offer, best_of, forgone_by
from nonlinear.integration.steppers import EXPLICIT, SCIPY, SMALLEST
from nonlinear.integration.switches import Switched
from nonlinear.system import Equations, Group, Load, System, ends_may_meet, system_of

ASKED = "as requested"
METHODS = ("auto", *SCIPY, "taylor")
FORMS = ("auto", "minimal", "maximal", "hamiltonian", "spatial")
STIFFNESS_RATIO = 30.0
"""Cost: the fastest decay over the fastest oscillation, from which an implicit method is cheaper
(benchmarks/simulation.py)."""
LENGTH_RATIO_MIN = 1e-13
"""Limit: a link's length over the longest, below which positions in maximal coordinates cannot resolve its two ends."""
MOMENT_MAX = 1e140
"""Limit: the largest moment of inertia, and inverse of the smallest, whose square does not overflow."""
FLOATS = 100
"""Cost: links of a scene up to which its equations are written out in floats (benchmarks/forms.py): a run with a chain
of 50 takes 0.5 s so and 0.84 s by a band, of 100 1.25 s and 1.32 s, of 200 2.3 s and 1.36 s; with 50 pairs on a cart
0.9 s and, by the recursion, 1.3 s, with 100 2.1 s and 1.4 s."""
DOP853_TOLERANCE_MIN = 1e-13
"""Tolerance: below which rounding hides the progress of DOP853, and only Taylor series do."""


@dataclass(frozen=True)
class Choice:
    """The form of the equations, their solver, the integrator and its tolerance, and the reason for the choice.

    `forgone` is the saving by compiled code that is not ready.
    """

    form: str
    method: str
    compiled: bool
    reason: str
    tolerance: float = 1e-9
    forgone: Forgone = field(default=(), compare=False, repr=False)


def validate_method(
    scene: Scene,
    method: str = "auto",
    form: str = "auto",
    *,
    driven: bool = False,
    system: System | None = None,
) -> str:
    """The form of the equations; SceneError lists every unknown or unsuitable value.

    `driven` says whether a load acts; `system` is the integrated system, where that is less than the whole scene.
    """
    validate_scene(scene)
    system = system or system_of(scene)
    problems = []
    if method not in METHODS:
        problems.append(f"method {method}: must be one of {', '.join(METHODS)}{spelling_hint(method, METHODS)}")
    if form not in FORMS:
        problems.append(f"form {form}: must be one of {', '.join(FORMS)}{spelling_hint(form, FORMS)}")
        form = "auto"
    scene = scene if system.spatial or scene.space == "plane" else scene.in_plane
    additions = _additions(system, driven)
    full_form = form if form != "auto" else "spatial" if system.spatial else "minimal"
    problems += refusals(scene, f"form {full_form}", *additions)
    if form == "maximal" and (shortest := float(np.min(system.by_link("length"))) / system.length) < LENGTH_RATIO_MIN:
        problems.append(
            f"form maximal: cannot distinguish the ends of a link {shortest:.1g} times as long as the longest apart"
        )
    form = full_form
    if method == "taylor":
        problems += refusals(scene, "method taylor", *additions)
        problems += [] if form == "minimal" else [f"method taylor: has no series in form {form}: choose minimal"]
        where = "support.motion" if system.support else "force" if system.forces else "hoist"
        if Inputs(system).pieces is None:
            words = CAPABILITIES["method taylor"].unless["moved_support"]
            problems.append(f"{where}: method taylor {words}: method DOP853 takes it")
    if method in SCIPY and method != "DOP853":
        stepping = "a method other than DOP853" if method in EXPLICIT else "an implicit method"
        problems += refusals(scene, stepping, *additions)
    if form == "maximal" and method in SCIPY and method not in EXPLICIT:
        problems.append(f"method {method}: cannot keep the constraints of the {form} form; {', '.join(EXPLICIT)} can")
    refuse_any(problems)
    return form


def _additions(system: System, driven: bool) -> list[str]:
    """The data of a run beyond its scene."""
    return [name for name, has in (("load", driven), ("hoist", system.hoisting)) if has]


def choose(
    scene: Scene,
    duration: float,
    tolerance: float,
    method: str = "auto",
    form: str = "auto",
    *,
    driven: bool = False,
    size: float = 1.0,
    system: System | None = None,
    has_watches: bool = False,
) -> Choice:
    """Choose whatever is "auto" for a motion of this size; SceneError lists every unknown or unsuitable value.

    `system` is the integrated system, where that is less than the whole scene; `has_watches` says whether something is
    looked for in every step, which many steps of DOP853 together show, those of series one by one.
    """
    validate_scene(scene)
    system = system or system_of(scene)
    form = validate_method(scene, method, form, driven=driven, system=system)
    scene = scene if system.spatial or scene.space == "plane" else scene.in_plane
    additions = _additions(system, driven)
    plain = form == "minimal" and method != "taylor" and not refusals(scene, "compiled equations", *additions)
    plain = plain and "massless_cart" not in scene.features  # only floats pass close by the rest, where M is singular
    is_written = system.structure is not None and not all(carrier.is_compiled for carrier in system.structure.carriers)
    ways = offers(scene, system, duration, tolerance, size) if plain else {}
    if is_written:
        ways.pop("compiled", None)
    stepwise = has_watches and tolerance >= DOP853_TOLERANCE_MIN
    if method != "auto" or stepwise or tolerance * size < TIGHTEST or ends_may_meet(system):
        ways.pop("taylor", None)
    method, why = _automatic(scene, duration, tolerance, form, ways) if method == "auto" else (method, ASKED)
    if system.n_links <= FLOATS and method != "DOP853":
        ways.pop("compiled", None)
    stepping = {name: way for name, way in ways.items() if name != "taylor"} if method in SCIPY else {}
    takes_kernel = bool(stepping) and best_of(stepping) == "compiled"
    finest = SMALLEST if method in SCIPY else TIGHTEST / size
    rivals = ways if method == "DOP853" else stepping
    forgone = forgone_by(rivals, "compiled" if takes_kernel else "DOP853") if stepping else ()
    return Choice(
        form, method, takes_kernel, why + (", compiled" if takes_kernel else ""), max(tolerance, finest), forgone
    )


def _automatic(
    scene: Scene, duration: float, tolerance: float, form: str, ways: Mapping[str, Offer]
) -> tuple[str, str]:
    """The method and the reason."""
    scales = estimate_timescales(scene)
    if scales.decay * duration > STIFFNESS_RATIO * max(scales.swing * duration, 1.0):
        fast = f"the fastest decay, about {scales.decay:.3g}/s, is far faster than the fastest oscillation"
        if form != "minimal":
            return "DOP853", f"{fast}, but the {form} form has only explicit methods: this takes many steps"
        if refusals(scene, "an implicit method"):
            return "DOP853", f"{fast}, but only DOP853 ends steps at switches: this takes many steps"
        return "Radau", fast
    if "taylor" in ways and tolerance < DOP853_TOLERANCE_MIN:
        return "taylor", "an accuracy near that of double precision, which takes a method of high order"
    if ways and best_of(ways) == "taylor":
        code = ways["taylor"].code
        if code and code.is_ready:
            return "taylor", "its series are compiled already, and faster"
        joint = ", after others," if code and code.saved_seconds > 0.0 else ""
        return "taylor", f"a run long enough{joint} to pay for compiling its series"
    return "DOP853", "the problem is not stiff"


def step_count(periods: float, tolerance: float) -> float:
    """The steps of DOP853 in this many periods at large angles."""
    return 14 * periods * float((1e-6 / tolerance) ** (1 / 8))


def offers(scene: Scene, system: System, duration: float, tolerance: float, size: float = 1.0) -> dict[str, Offer]:
    """Plain DOP853 and, where nothing switches, compiled DOP853 and heyoka's series if they take the `system`."""
    links, longest = system.n_links, max(group.n for group in system.groups)
    periods = duration * estimate_timescales(scene).swing / (2 * pi)
    steps = step_count(periods, tolerance) + 2 * periods * system.kicks_a_period  # one cut short, one to the kick
    in_floats = links <= FLOATS or system.rubs or system.has_escapements
    step_seconds = 1.5e-5 + links * (1e-5 + 6e-7 * min(longest, 32)) if in_floats else 2e-3 + 6e-6 * links
    if system.has_rotors and not in_floats:  # no band, but the recursion link by link
        step_seconds = 2e-3 * links
    if system.rubs or system.has_escapements:
        return {"DOP853": Offer(steps * step_seconds)}
    kernel = integrator(system)
    ways = {"DOP853": Offer(steps * step_seconds), "compiled": Offer(steps * (5e-6 + 8e-7 * links), kernel)}
    if taylor.takes(system):
        step_seconds = 3e-6 + links * (1e-6 if links <= taylor.UNROLLED_LINKS else 1.5e-6 + 2e-7 * longest)
        code = taylor.code_of(form_of(system), Inputs(system).pieces or (), taylor.uneven(tolerance * size))
        ways["taylor"] = Offer(40 * periods * step_seconds, code)
    return ways


def least_seconds(scene: Scene, duration: float, tolerance: float = 1e-9, members: int = 1) -> float:
    """Roughly the time of this many motions of a scene by the fastest way once it is ready, on one core (s)."""
    ways = offers(scene, system_of(scene), duration, tolerance)
    return float(members * min(way.running for way in ways.values()))


def body_of(group: Group, system: System) -> GroupBody:
    """The solver of one group in NumPy: a band for long chains, the recursion for many short ones."""
    # The recursion's time grows with the links of one pendulum, that of a band with all: twenty chains of twenty take a
    # third of the time by a band, two hundred chains of four half the time by the recursion.
    if group.has_rotors or group.n < 4 or group.index.shape[1] >= FLOATS or loses_digits(group, system):
        return Recursion(group)
    return Banded(group)


def validate_room(scene: Scene, system: System) -> None:
    """SceneError that names the extreme links whose moments exceed the range of `system` in its units."""
    moments = system.mass * system.by_link("length") ** 2
    if 1 / MOMENT_MAX < float(moments.min()) <= float(moments.max()) < MOMENT_MAX:
        return
    places = {
        f"pendulum[{i}].links[{j}]": link.mass * link.length**2
        for i, pendulum in enumerate(scene.pendulum)
        for j, link in enumerate(pendulum.links)
    }
    low, high = min(places, key=places.__getitem__), max(places, key=places.__getitem__)
    numbers = f"m l² ranges from {places[low]:.3g} kg m² here to {places[high]:.3g} kg m² in {high}"
    raise SceneError([f"{low}: {numbers}, which double precision cannot square: choose other units"])


def equations_of(
    system: System, choice: Choice, load: Load | None = None, symmetries: Sequence[Symmetry] = ()
) -> Equations:
    """The equations of motion in the chosen form, of the system that remains after symmetry reductions."""
    if symmetries:
        return Reduced(system, equations_of(symmetries[-1].system, choice), symmetries)
    if choice.form == "maximal":
        return Maximal(system, load)
    if system.rubs or system.has_escapements:
        return Switched(Generated(system, load=load))
    if choice.form == "spatial":
        if system.n_links <= FLOATS:  # written out they take a third of NumPy's time
            return Generated(system, load=load)
        return Spatial(system, tuple(SpatialRecursion(group) for group in system.groups), load)
    if choice.form == "hamiltonian":
        return Hamiltonian(system, load)
    if choice.compiled:
        with without_interrupts():
            from nonlinear.dynamics.compiled import Compiled

            return Compiled(system)
    if system.n_links <= FLOATS:
        return Generated(system, load=load)
    if system.hoisting is not None:
        return Minimal(system, (None,) * len(system.groups), load)
    body = Recursion if system.structure is not None else partial(body_of, system=system)
    return Minimal(system, tuple(body(group) for group in system.groups), load)
