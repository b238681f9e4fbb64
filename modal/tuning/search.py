"""The best numbers of a scene: from several starts into every valley, and in the best one to the last digits."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import permutations
from os import PathLike

import numpy as np

from modal.assembly import differences, matrices
from modal.errors import ComputationError, SceneError
from modal.report import silent
from modal.scene import Scene, validate_scene
from modal.scene.parameters import Place
from modal.scene.records import Spectrum, read_spectrum
from modal.statespace.shapers import Kind
from modal.tuning.closed_forms import beside, den_hartog, single_links, values_for
from modal.tuning.minimax import ALLOWED, Minimum, descend
from modal.tuning.objective import Aim, Objective
from modal.tuning.peaks import UNDAMPED
from modal.tuning.pieces import Setting
from modal.tuning.quantities import SOURCE, FreeNumber, Quantity, find_free, key_of, parse_limit, parse_quantity
from modal.tuning.result import Tuned, Valley
from modal.tuning.worth import worst_cases
from modal.types import Floats

TRIED, KEPT = 12, 3
"""Random starts for each free number, of which so many lead into a descent."""
SPREAD, WIDE = 1.1, 2.5
"""Standard deviations of the logarithms of random starts, of a damper, drag or spring the second."""
DISTINCT, SAME = 0.3, 0.02
"""Distance of two starts, and of two ends in one valley, in logarithms."""
ALIKE = 1e-3
"""Of two costs in one valley."""
RULES = 4
"""Most starts by Den Hartog's rule."""
CASES = 8
"""Rounds of adding the worst case of what is tuned so far."""
EDGE = 1e-6
Report = Callable[[str], object]


def tune(
    scene: Scene,
    free: Sequence[str],
    *,
    minimize: Sequence[str] = (),
    maximize: Sequence[str] = (),
    limits: Sequence[str] = (),
    over_hz: tuple[float, float] | None = None,
    psd: Spectrum | str | PathLike[str] | None = None,
    modes: Sequence[int] = (),
    travel: float | None = None,
    over: float | None = None,
    kind: Kind | None = None,
    robust: bool = False,
    report: Report = silent,
) -> Tuned:
    """The numbers at the places `free`, each perhaps with bounds FROM:TO, that make quantities least or largest.

    Quantities are texts such as "peak:x/cart_force", "rms:tip_1", "residual", "damping", "settling", with weights as in
    "2*peak:x/cart_force" (`modal.tuning.quantities`); `limits` such as "rel_1_1=0.2" bound others from above.  Peaks
    are those `over_hz`, by default over all frequencies; `psd` is a spectrum or its file, `modes` are rows of the
    table, `travel` (m) lasts `over` seconds and has a shaper of a `kind`.  A `robust` result is the best for the worst
    case of all masses ±5 %.  Raises SceneError that names every mistake, ComputationError where nothing is best.

    >>> from modal import Bob, Cart, Pendulum, Scene
    >>> damper = Bob(mass=0.5, length=2.0, damping=0.4)
    >>> tower = Scene(gravity=9.81, support=Cart(mass=10.0, stiffness=40.0), pendulum=[Pendulum(links=[damper])])
    >>> places = ["pendulum[0].links[0].length", "pendulum[0].links[0].damping"]
    >>> found = tune(tower, places, minimize=["peak:x/cart_force"])
    >>> round(40 * found.after, 8), len(found.valleys)
    (6.40792077, 1)
    """
    validate_scene(scene)
    aims, problems = _aims(minimize, maximize)
    found_limits = []
    for text in limits:
        try:
            found_limits.append(parse_limit(text, [one.quantity for one in aims]))
        except SceneError as error:
            problems += error.problems
    numbers: tuple[FreeNumber, ...] = ()
    try:
        numbers = find_free(scene, free, lambda place: _begin(scene, place))
    except SceneError as error:
        problems += error.problems
    every = [*(one.quantity for one in aims), *(one.quantity for one in found_limits)]
    source = next((one.input for one in every if one.kind == "rms"), SOURCE)
    spectrum = psd if psd is None or isinstance(psd, Spectrum) else read_spectrum(psd, source != SOURCE)
    setting = Setting(over_hz, spectrum, tuple(modes), travel, over, kind)
    if problems:
        raise SceneError(list(dict.fromkeys(problems)))
    objective = Objective(scene, numbers, aims, found_limits, setting)
    before = objective.pieces(np.log([one.value or one.start for one in numbers]))
    starts = list(_starts(objective))
    report(f"{len(starts)} starts")
    if over_hz is not None:
        _refuse_no_peak(objective, objective.start)
    if not starts:
        raise ComputationError(_endless(objective))
    size = abs(sum(one.largest for one in objective.evaluate(starts[0], False).costs))
    objective.scale = size if not objective.is_log and size > 0 else 1.0
    valleys = _valleys(objective, starts)
    best = _descended(objective, valleys[0].point.z)
    _refuse_endless(objective, best)
    if robust:
        best = _robust(objective, best)
    _refuse_no_peak(objective, best.point.z)
    _refuse_undamped(objective, best.point.z)
    ends = tuple(
        Valley(
            objective.numbers(one.point.z),
            objective.value(one.point.z) if k else objective.value(best.point.z),
            one.point.excess <= ALLOWED,
            one.certain,
        )
        for k, one in enumerate(valleys)
    )
    return Tuned(
        given=scene,
        scene=objective.scene_at(best.point.z),
        objective=objective,
        z=best.point.z,
        pieces_before=tuple(before),
        pieces_after=tuple(objective.pieces(best.point.z)),
        valleys=ends,
        starts=len(starts),
        certain=best.certain,
        robust=robust,
    )


def _aims(minimize: Sequence[str], maximize: Sequence[str]) -> tuple[list[Aim], list[str]]:
    aims: list[Aim] = []
    problems: list[str] = []
    for texts, maximized in ((minimize, False), (maximize, True)):
        for text in texts:
            try:
                aims.append(Aim(parse_quantity(text), maximized))
            except SceneError as error:
                problems += error.problems
    if not aims and not problems:
        problems.append("nothing is minimized or maximized: name a quantity, such as peak:x/cart_force")
    names = [one.quantity.name for one in aims]
    problems += [f"{name}: is named twice" for name in dict.fromkeys(names) if names.count(name) > 1]
    return aims, problems


def _begin(scene: Scene, place: Place) -> float:
    """Where the search for a number that is 0 begins: a tenth of critical damping, or of the stiffness there."""

    def arrays(one: Scene) -> tuple[Floats, ...]:
        found = matrices(one)
        return found.M, found.K, found.D

    own = arrays(scene)
    dM, dK, dD = (np.diag(part) for part in differences(scene, place, 1.0, arrays))
    M, K, _ = (np.diag(part) for part in own)
    with np.errstate(all="ignore"):
        sizes = {
            "mass": 0.1 * np.abs(M / dM),
            "stiffness": 0.1 * np.abs(K / dK),
        }.get(key_of(place), 0.2 * np.sqrt(np.abs(M * K)) / np.abs(dD))
    known = sizes[np.isfinite(sizes) & (sizes > 0)]
    return float(known.min()) if len(known) else 1.0


def _starts(objective: Objective) -> Iterator[Floats]:
    """The scene's own numbers, those by Den Hartog's rule, and the best of many random ones, all with finite values."""
    tried: list[Floats] = []
    for z in (objective.start, *_by_rule(objective)):
        at = np.clip(z, objective.low, objective.high)
        if all(np.abs(at - one).max() > SAME for one in tried) and objective.evaluate(at, False).is_finite:
            tried.append(at)
            yield at
    rng = np.random.default_rng(1)
    n = len(objective.free)
    spread = np.array([WIDE if one.key in {"damping", "drag", "stiffness"} else SPREAD for one in objective.free])
    draws = objective.start + spread * rng.standard_normal((TRIED * n, n))
    bounded = np.array([one.bounded for one in objective.free])
    inside = objective.low + (objective.high - objective.low) * rng.random((TRIED * n, n))
    draws = np.where(bounded, inside, np.clip(draws, objective.low, objective.high))
    merits = np.array([_merit(objective, one) for one in draws])
    kept = 0
    for k in np.argsort(merits, kind="stable").tolist():
        if not np.isfinite(merits[k]) or kept == KEPT:
            break
        if all(np.abs(draws[k] - one).max() > DISTINCT for one in tried):
            tried.append(draws[k])
            kept += 1
            yield draws[k]


def _merit(objective: Objective, z: Floats) -> float:
    try:
        return objective.evaluate(z, False).merit
    except (ComputationError, SceneError):
        return np.inf


def _by_rule(objective: Objective) -> Iterator[Floats]:
    """Starts in which pendula of one link are the dampers of different modes, by Den Hartog's rule."""
    scene = objective.quantities.scene
    pendula = single_links(scene, objective.free)
    if not pendula or not any(one.quantity.kind in {"peak", "rms", "damping", "settling"} for one in objective.aims):
        return
    found = beside(scene, pendula)
    if found is None:
        return
    own = {one.path: k for k, one in enumerate(objective.free)}
    modes = range(min(len(found.omega), len(pendula) + 1))
    ways = permutations(modes, len(pendula)) if len(pendula) <= len(modes) else [(0,) * len(pendula)]
    chosen = [way for _, way in zip(range(RULES - 1), ways, strict=False)]
    if len(pendula) > 1:
        chosen.append((0,) * len(pendula))
    for way in chosen:
        z = objective.start.copy()
        for k, (p, mode) in enumerate(zip(pendula, way, strict=True)):
            together = way.count(mode)
            mu = float(found.mu[k, mode]) * together
            if mu <= 0:
                continue
            f, zeta = den_hartog(mu)
            spread = 1 + 0.1 * (k - (together - 1) / 2) if together > 1 else 1.0
            values = values_for(scene, p, f * float(found.omega[mode]) * spread, zeta / np.sqrt(together)) or {}
            for path, value in values.items():
                if path in own:
                    z[own[path]] = np.log(value)
        yield z


def _valleys(objective: Objective, starts: Sequence[Floats]) -> list[Minimum]:
    """The different minima that the starts lead into, the best first."""
    found: list[Minimum] = []
    for z in starts:
        try:
            one = descend(objective.evaluate, z, objective.low, objective.high, coarse=True, known=found)
        except (ComputationError, SceneError):
            continue
        if not one.point.is_finite or one in found:
            continue
        alike = [
            other
            for other in found
            if abs(other.point.merit - one.point.merit) <= ALIKE * max(1.0, abs(other.point.merit))
            and np.abs(other.point.z - one.point.z).max() <= 10 * SAME
        ]
        if not alike:
            found.append(one)
        elif one.point.merit < alike[0].point.merit:
            found[found.index(alike[0])] = one
    if not found:
        raise ComputationError(_endless(objective))
    return sorted(found, key=lambda one: one.point.merit)


def _descended(objective: Objective, z: Floats) -> Minimum:
    """The minimum beside z, about which the arrays are interpolated anew."""
    for factors in objective.cases:
        objective.quantities.centre(objective.numbers(z), factors)
    return descend(objective.evaluate, z, objective.low, objective.high)


def _robust(objective: Objective, best: Minimum) -> Minimum:
    """The best for the worst of all masses ±5 %, to which cases are added until none is worse."""
    cases = list(objective.cases)
    for _ in range(CASES):
        here = objective.evaluate(best.point.z, False).cost
        worse = [
            one for one in worst_cases(objective, best.point.z) if one.cost > here + EDGE and one.factors not in cases
        ]
        if not worse:
            break
        cases += [one.factors for one in worse]
        objective.cases = tuple(cases)
        best = _descended(objective, best.point.z)
    return best


# ------------------------------------------------------------------------------------------------------- refusals


def _endless(objective: Objective) -> str:
    """Why no start has a finite value."""
    found = objective.pieces(objective.start)
    quantities: list[Quantity] = [
        *(one.quantity for one in objective.aims),
        *(one.quantity for one in objective.limits),
    ]
    for quantity, one in zip(quantities, found, strict=True):
        if one.endless:
            return f"{quantity.name}: {one.endless}, whatever the free numbers are"
    return "no start has a finite value"


def _refuse_endless(objective: Objective, best: Minimum) -> None:
    z, point = best.point.z, best.point
    if point.excess > ALLOWED:
        worst = max(range(len(point.limits)), key=lambda k: point.limits[k].largest)
        limit = objective.limits[worst]
        least = float(np.exp(point.limits[worst].largest)) * limit.most
        raise ComputationError(f"{limit.name}: cannot be met within the bounds: {least:.6g} is what is left")
    for k, one in enumerate(objective.free):
        if one.bounded:
            continue
        for edge, words, way in (
            (objective.high[k], "larger", f"{one.start:.4g}:{10 * one.start:.4g}"),
            (objective.low[k], "smaller", f"{one.start / 10:.4g}:{one.start:.4g}"),
        ):
            if abs(z[k] - edge) < EDGE:
                raise ComputationError(
                    f"{one.path}: the {words}, the better, without end: give it bounds, such as {one.path}={way}"
                )


def _refuse_undamped(objective: Objective, z: Floats) -> None:
    for aim, one in zip(objective.aims, objective.pieces(z), strict=False):
        if aim.quantity.kind == "damping" and len(one.values) and np.abs(one.values).min() <= UNDAMPED:
            number = int(one.at[np.abs(one.values).argmin()]) + 1
            raise ComputationError(f"damping: nothing damps mode {number}, whatever the free numbers are")


def _refuse_no_peak(objective: Objective, z: Floats) -> None:
    found = objective.pieces(z)
    for aim, one in zip(objective.aims, found, strict=False):
        if aim.quantity.kind == "peak" and len(one.values) and not one.inside.any():
            at = float(one.at[one.values.argmax()]) / (2 * np.pi)
            where = f"that at {at:.6g} Hz, the end of the band"
            if objective.quantities.setting.band is None:
                slowest = float(np.abs(objective.quantities.numbers.model(objective.scene_at(z)).poles).max())
                where = "the limit at 0 Hz" if 2 * np.pi * at < slowest else "the limit at high frequencies"
            raise ComputationError(f"{aim.quantity.name}: has no peak: its largest magnitude is {where}")
