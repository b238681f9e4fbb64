"""Measures: their meanings, columns, requirements and computation.

Each is a class of `modal.extend.measures`, as an external package writes one.  A sweep computes it of a scene, from a
`Portion` of scenes; an ensemble, from their `Context`.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from math import inf, nan, pi
from typing import TYPE_CHECKING

from modal.errors import SceneError
from modal.extend.measures import LAST_TENTH, MEMBERS_AT_ONCE, MODE, MODES, Measure
from modal.extend.registry import register

if TYPE_CHECKING:
    from modal.scene import Scene
    from modal.types import Floats
    from nonlinear.ensembles.measures import Context
    from nonlinear.ensembles.results import MemberResults
    from nonlinear.integration import Trajectory
    from nonlinear.sweeps.measures import Portion
    from nonlinear.synchronization.modal_energy import Survival

Numbers = dict[str, float]
NEXT = "mode N (default: the first oscillating mode) and the next"
OSCILLATING, PLANE = "modes that oscillate", "motion in the plane"
NO_QUANTILES = {"spread": "it names a motion, and names have no quantiles: basins reports the share of each"}


@lru_cache(maxsize=1)
def _survival(run: Trajectory) -> Survival:
    from nonlinear.synchronization import find_survival

    return find_survival(run)


class _OfModes(Measure):
    """Measures of the oscillating modes of a scene, whose numbers are those of its table."""

    needs = OSCILLATING
    counts = MODE
    most = 1000
    is_numbered = True


@register
class Frequencies(_OfModes):
    """The lowest natural frequencies |λ|."""

    name = "frequencies"
    words = "the frequencies of the N slowest oscillating modes"
    columns = ("omega_R_rad_per_s",)
    counts = MODES
    usual = 4

    def of_scene(self, scene: Scene, number: float, portion: Portion) -> Numbers:
        """By the numbers of the modes."""
        return {f"omega_{name}_rad_per_s": float(abs(v)) for name, v in portion.slowest(scene, int(number))}


@register
class DampingRatios(_OfModes):
    """The damping ratios −Re λ/|λ| of these modes."""

    name = "damping"
    words = "the damping ratios of the N slowest oscillating modes"
    columns = ("damping_ratio_R",)
    counts = MODES
    usual = 4

    def of_scene(self, scene: Scene, number: float, portion: Portion) -> Numbers:
        """By the numbers of the modes."""
        return {f"damping_ratio_{k}": float(-v.real / abs(v) + 0.0) for k, v in portion.slowest(scene, int(number))}


@register
class Splitting(_OfModes):
    """The frequency gap from one mode to the next."""

    name = "splitting"
    words = f"the gap between the frequencies of {NEXT}"
    columns = ("splitting_R_rad_per_s",)

    def of_scene(self, scene: Scene, number: float, portion: Portion) -> Numbers:
        """By the number of the mode."""
        mode, gap = portion.gap(scene, int(number))
        return {f"splitting_{mode}_rad_per_s": gap}


@register
class BeatPeriod(_OfModes):
    """The beat period 2π/Δω of a mode and the next; infinite if they pass no energy between pendula."""

    name = "beat"
    words = f"the beat period of {NEXT}"
    columns = ("beat_R_s",)

    def of_scene(self, scene: Scene, number: float, portion: Portion) -> Numbers:
        """By the number of the mode."""
        mode, gap = portion.gap(scene, int(number))
        return {f"beat_{mode}_s": 2 * pi / gap if gap and portion.passes(scene, mode) else inf}


@register
class LargestMultiplier(Measure):
    """The largest Floquet multiplier of small angles on a support that moves up and down, and its meaning."""

    name = "floquet"
    words = "the largest Floquet multiplier of a vertical sine, its growth rate, and whether small motion grows"
    columns = ("largest_multiplier", "growth_rate_per_s", "kind")
    needs = "a support that moves up and down as a sine"

    def of_scene(self, scene: Scene, number: float, portion: Portion) -> Numbers:
        """Of scenes that differ in their motion alone, together."""
        stability = portion.stability(scene)
        numbers = stability.largest, stability.growth_rate, float(stability.number)
        return dict(zip(self.columns, numbers, strict=True))

    def require(self, scene: Scene, seconds: float | None) -> None:
        """Raise SceneError for a support without such a motion."""
        from modal.vibration import vertical_sine

        vertical_sine(scene)


@register
class LargestAngle(Measure):
    """The largest angle of any link from the downward vertical, also at turning points between the samples."""

    name = "largest_angle"
    words = "the largest angle of any link in N seconds"
    columns = ("largest_angle_deg",)

    def of_motion(self, run: Trajectory, seconds: float) -> float:
        """In degrees."""
        from nonlinear.postprocessing import largest_angle

        return largest_angle(run) * 180 / pi

    def of_members(self, context: Context, results: MemberResults, ending: Floats) -> Mapping[str, Floats]:
        """As engines find it on the way."""
        assert results.largest is not None
        return {"largest_angle_deg": results.largest * 180 / pi}


@register
class CartTravel(Measure):
    """The peak-to-peak travel of the cart, also at turning points between the samples."""

    name = "cart_travel"
    words = "the distance between the cart's turning points in N seconds"
    columns = ("cart_travel_m",)
    needs = "a cart"

    def of_motion(self, run: Trajectory, seconds: float) -> float:
        """In metres."""
        from nonlinear.postprocessing import extremes

        left, right = extremes(run.times, run.motion.cart, run.motion.cart_rate)
        return float(right - left)


@register
class EnergyDrift(Measure):
    """The energy drift of the run, relative."""

    name = "energy_drift"
    words = "the largest drift of energy in N seconds, relative to its range"
    columns = ("energy_drift",)
    refused = dict.fromkeys(("basins", "ensemble"), "an ensemble states the drift of every member with its measures")

    def of_motion(self, run: Trajectory, seconds: float) -> float:
        """Of the whole run."""
        return run.energy_drift()


@register
class FirstTurn(Measure):
    """When each link first goes over the top."""

    name = "first_turn"
    words = "the time at which each link first turns over the top, inf where none does in N seconds"
    columns = ("first_turn_P_L_s",)
    needs = PLANE
    is_planar = True

    def of_members(self, context: Context, results: MemberResults, ending: Floats) -> Mapping[str, Floats]:
        """As engines find it on the way."""
        assert results.first_turns is not None
        return {f"first_turn_{place}_s": turn for place, turn in zip(context.places, results.first_turns, strict=True)}


@register
class LargestExponent(Measure):
    """The largest Lyapunov exponent."""

    name = "lyapunov"
    words = "the largest Lyapunov exponent, from N seconds of the motion after half as many"
    columns = ("lyapunov_per_s",)
    needs = PLANE
    is_planar = True
    usual = 0.0

    def of_members(self, context: Context, results: MemberResults, ending: Floats) -> Mapping[str, Floats]:
        """From ln |v| of the tangent vector."""
        assert results.stretching is not None
        return {"lyapunov_per_s": results.stretching / context.wanted.duration}

    def require(self, scene: Scene, seconds: float | None) -> None:
        """Raise SceneError if a scene has none, or not from this many seconds, 0 for its usual ones."""
        from modal.scene import require
        from nonlinear.chaos import validate_duration

        super().require(scene, seconds)
        try:
            if seconds is not None:
                require(scene, "a Lyapunov exponent")
            if seconds:
                validate_duration(scene, seconds)
        except SceneError as error:
            raise SceneError([f"measure lyapunov: {problem}" for problem in error.problems]) from None


@register
class OrderParameter(Measure):
    """The mean length of the mean of all e^{iφ}, where φ are the phases of pendula in the mode that has most energy."""

    name = "order"
    words = "the order parameter of the phases, its mean over the last tenth of N seconds, from 0 to 1"
    columns = ("order",)
    needs = "motion in the plane, with constant lengths"
    is_planar = True
    reads = LAST_TENTH
    usual = 100

    def of_members(self, context: Context, results: MemberResults, ending: Floats) -> Mapping[str, Floats]:
        """Over the samples of the last tenth."""
        return {"order": context.order(ending)}

    def require(self, scene: Scene, seconds: float | None) -> None:
        """Raise SceneError for changing lengths."""
        super().require(scene, seconds)
        if scene.is_hoisted:
            raise SceneError(["measure order: needs constant lengths, since modes change with them"])


@register
class MeanEnergies(Measure):
    """The mean energies of the pendula and of their supports."""

    name = "pendulum_energy"
    words = "the mean energies over the last tenth of N seconds: of all pendula, of each, of what carries them"
    columns = ("pendula_energy_J", "pendulum_P_energy_J", "cart_energy_J")
    reads = LAST_TENTH
    usual = 100
    refused = dict.fromkeys(("basins",), "it has a number for every pendulum, and a map shows one")

    def of_members(self, context: Context, results: MemberResults, ending: Floats) -> Mapping[str, Floats]:
        """Over the samples of the last tenth."""
        return context.mean_energies(ending)


@register
class SurvivingMode(Measure):
    """The mode with most energy at the end."""

    name = "survivor"
    words = "the mode with most energy after N seconds, and its share"
    columns = ("survivor", "survivor_share")
    needs = PLANE
    is_planar = is_numbered = True
    usual = 100
    refused = NO_QUANTILES

    def of_motion(self, run: Trajectory, seconds: float) -> Numbers:
        """By its number in the table of the scene itself."""
        survival = _survival(run)
        return {"survivor": float(survival.number), "survivor_share": survival.survivor_share}

    def of_scene(self, scene: Scene, number: float, portion: Portion) -> Numbers:
        """By its number in the table of the portion."""
        numbers = super().of_scene(scene, number, portion)
        return numbers | {"survivor": float(portion.number_in_table(scene, int(numbers["survivor"])))}


@register
class LockingTime(Measure):
    """The time from which all other rows hold less than 1 % together; NaN if never."""

    name = "locking"
    words = "the time from which that mode has 99 %, within N seconds"
    columns = ("locking_time_s",)
    needs = PLANE
    is_planar = True
    usual = 100

    def of_motion(self, run: Trajectory, seconds: float) -> float:
        """In seconds."""
        time = _survival(run).locking_time()
        return nan if time is None else time


@register
class EndingAttractor(Measure):
    """The motion in which the run ends, as distinguished by `nonlinear.ensembles.endings` among many starts."""

    name = "attractor"
    words = "the rhythm or periodic motion that the motion reaches within N seconds, by its number, 0 for none"
    columns = ("attractor",)
    needs = "drives at joints, or sines that drive it and losses"
    reads = MEMBERS_AT_ONCE
    usual = 0.0
    refused = dict.fromkeys(
        ("sweep", "spread", "ensemble"),
        "attractors are distinguished among many starts: basins maps them, a stroboscopic sweep and sync follow them",
    )

    def of_members(self, context: Context, results: MemberResults, ending: Floats) -> Mapping[str, Floats]:
        """None: basins finds them."""
        return {}


@register
class SectionStates(Measure):
    """The states in which a section is crossed, which engines keep next to the columns."""

    name = "section"
    words = "the states at which an angle or the cart passes a value, section:theta[1,1]>0"
    columns = ("crossing_…",)
    needs = PLANE
    is_planar = True
    counts = ""
    usual = 0.0
    refused = dict.fromkeys(("sweep", "basins", "spread"), "crossings are states: the command section draws them")

    def of_members(self, context: Context, results: MemberResults, ending: Floats) -> Mapping[str, Floats]:
        """None next to the crossings."""
        return {}
