"""Search for the optimal parameters: from several starts to all minima, and in the best one to the last digits."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import islice, permutations
from os import PathLike

import numpy as np

from modal.assembly import differences, matrices
from modal.errors import ComputationError, SceneError, gathered, refuse_any
from modal.report import silent
from modal.scene import Scene, validate_scene
from modal.scene.parameters import Place, texts_of
from modal.scene.records import Spectrum, read_spectrum
from modal.statespace.shapers import Kind
from modal.tuning.minimax import COARSE, EDGE, ROUNDS, VALLEY_WIDTH, Evaluate, Evaluation, Minimum, descend
from modal.tuning.model import DAMPING_MIN
from modal.tuning.objective import Aim, Objective, worst_cases
from modal.tuning.pieces import Quantities, Setting
from modal.tuning.quantities import (
    CAN_VANISH,
    SOURCE,
    FreeNumber,
    Quantity,
    find_free,
    key_of,
    parse_limit,
    parse_quantity,
)
from modal.tuning.result import Tuned, Valley, den_hartog, rest_of_scene, single_links, values_for
from modal.types import Crew, Floats, map_by_crew

STARTS = 12
"""Cost: random starts for each free number, of which the best three lead into a descent."""
START_SPREAD = 1.1
"""Tolerance: standard deviation of the logarithms of random starts, three to reach a factor of 30."""
WIDE_START_SPREAD = 2.5
"""Tolerance: the same of a damper, drag or spring, whose size is known to some powers of ten."""
Report = Callable[[float], object]
"""Takes the part of the work that is done."""


def tune(
    scene: Scene,
    free: str | Sequence[str],
    *,
    minimize: str | Sequence[str] = (),
    maximize: str | Sequence[str] = (),
    limits: str | Sequence[str] = (),
    over_hz: tuple[float, float] | None = None,
    psd: Spectrum | str | PathLike[str] | None = None,
    modes: Sequence[int] = (),
    travel: float | None = None,
    over: float | None = None,
    kind: Kind | None = None,
    robust: bool = False,
    crew: Crew | None = None,
    report: Report = silent,
) -> Tuned:
    """Find the parameters at the places `free`, optionally with bounds FROM:TO, that minimize or maximize quantities.

    Quantities are texts such as "peak:x/cart_force", "rms:tip_1", "residual", "damping", "settling", with weights as in
    "2*peak:x/cart_force" (`modal.tuning.quantities`); `limits` such as "rel_1_1=0.2" bound others from above.  Peaks
    are those `over_hz`, by default over all frequencies; `psd` is a spectrum or its file, `modes` are rows of the
    table, `travel` (m) lasts `over` seconds and has a shaper of a `kind`.  A `robust` result is the best for the worst
    case of all masses ±5 %. A `crew` shares random starts, the last descents and the cases of masses; the first
    descents run one after the other, since each may end in a known minimum.

    Raise raise SceneError with every mistake, ComputationError if nothing is best.

    >>> from modal import Bob, Cart, Pendulum, Scene
    >>> damper = Bob(mass=0.5, length=2.0, damping=0.4)
    >>> tower = Scene(gravity=9.81, support=Cart(mass=10.0, stiffness=40.0), pendulum=[Pendulum(links=[damper])])
    >>> places = ["pendulum[0].links[0].length", "pendulum[0].links[0].damping"]
    >>> found = tune(tower, places, minimize=["peak:x/cart_force"])
    >>> round(40 * found.after, 8), len(found.valleys)
    (6.40792077, 1)
    """
    validate_scene(scene)
    aims, problems = _aims(texts_of(minimize), texts_of(maximize))
    found_limits = []
    for text in texts_of(limits):
        with gathered(problems):
            found_limits.append(parse_limit(text, [item.quantity for item in aims]))
    numbers: tuple[FreeNumber, ...] = ()
    with gathered(problems):
        numbers = find_free(scene, texts_of(free, splits_commas=True), lambda place: _begin(scene, place))
    quantities = [*(item.quantity for item in aims), *(item.quantity for item in found_limits)]
    source = next((item.input for item in quantities if item.kind == "rms"), SOURCE)
    spectrum = psd if psd is None or isinstance(psd, Spectrum) else read_spectrum(psd, source != SOURCE)
    setting = Setting(over_hz, spectrum, tuple(modes), travel, over, kind)
    refuse_any(dict.fromkeys(problems))
    objective = Objective(scene, numbers, aims, found_limits, setting)
    initial_pieces = Quantities(scene, (), quantities, setting).at(np.zeros(0))
    starts = list(_starts(objective, crew))
    if over_hz is not None:
        _refuse_no_peak(objective, objective.start)
    if not starts:
        raise ComputationError(_endless(objective))
    size = abs(sum(item.largest for item in objective.evaluate(starts[0], False).costs))
    objective.scale = size if not objective.is_log and size > 0 else 1.0
    valleys = _valleys(objective, starts, report)
    candidates = [valleys[0], *(item for item in valleys[1:2] if not item.certain)]  # uncertain ends may change places
    descents = list(map_by_crew(partial(_descend, objective), [item.point.z for item in candidates], crew))
    deepest = min(range(len(descents)), key=lambda k: descents[k].point.merit)
    best = descents[deepest]
    _centre(objective, best.point.z)
    valleys.insert(0, valleys.pop(valleys.index(candidates[deepest])))
    _refuse_endless(objective, best)
    if robust:
        best = _robust(objective, best, crew)
    _refuse_no_peak(objective, best.point.z)
    _require_damping(objective, best.point.z)
    ends = []
    for k, item in enumerate(valleys):
        numbers_there, value = objective.free_numbers(item.point.z), objective.value((item if k else best).point.z)
        ends.append(Valley(numbers_there, value, item.point.excess <= EDGE, item.certain))
    return Tuned(
        given=scene,
        scene=objective.scene_at(best.point.z),
        objective=objective,
        z=best.point.z,
        pieces_before=tuple(initial_pieces),
        pieces_after=tuple(objective.pieces(best.point.z)),
        valleys=tuple(ends),
        starts=len(starts),
        certain=best.certain,
        robust=robust,
        open=best.open / (1.0 if objective.is_log else max(abs(best.point.cost), 1e-300)),
    )


def _aims(minimize: Sequence[str], maximize: Sequence[str]) -> tuple[list[Aim], list[str]]:
    aims: list[Aim] = []
    problems: list[str] = []
    for texts, is_maximum in ((minimize, False), (maximize, True)):
        for text in texts:
            with gathered(problems):
                aims.append(Aim(parse_quantity(text), is_maximum))
    if not aims and not problems:
        problems.append("give `minimize=…` or `maximize=…`: name a quantity, such as peak:x/cart_force")
    names = [aim.quantity.name for aim in aims]
    problems += [f"{name}: is named twice" for name in dict.fromkeys(names) if names.count(name) > 1]
    return aims, problems


def _begin(scene: Scene, place: Place) -> float:
    """Where the search for a number that is 0 begins: a tenth of critical damping, or of the stiffness there."""

    def arrays(changed_scene: Scene) -> tuple[Floats, ...]:
        linear = matrices(changed_scene)
        return linear.M, linear.K, linear.D

    present = arrays(scene)
    dM, dK, dD = (np.diag(part) for part in differences(scene, place, 1.0, arrays))
    M, K, _ = (np.diag(part) for part in present)
    with np.errstate(all="ignore"):
        sizes = {
            **dict.fromkeys(("mass", "rotor_inertia"), 0.1 * np.abs(M / dM)),
            "stiffness": 0.1 * np.abs(K / dK),
        }.get(key_of(place), 0.2 * np.sqrt(np.abs(M * K)) / np.abs(dD))
    finite_sizes = sizes[np.isfinite(sizes) & (sizes > 0)]
    return float(finite_sizes.min()) if len(finite_sizes) else 1.0


def _starts(objective: Objective, crew: Crew | None) -> Iterator[Floats]:
    """The scene's own numbers, those by Den Hartog's rule, and the best of many random ones, all with finite values."""
    chosen_starts: list[Floats] = []
    for z in (objective.start, *_by_rule(objective)):
        at = np.clip(z, objective.low, objective.high)
        if (
            all(np.abs(at - number).max() > VALLEY_WIDTH / 8 for number in chosen_starts)
            and objective.evaluate(at, False).is_finite
        ):
            chosen_starts.append(at)
            yield at
    rng = np.random.default_rng(1)
    n = len(objective.free)
    spread = [WIDE_START_SPREAD if number.key in CAN_VANISH else START_SPREAD for number in objective.free]
    draws = objective.start + np.array(spread) * rng.standard_normal((STARTS * n, n))
    has_bounds = np.array([number.has_bounds for number in objective.free])
    inside = objective.low + (objective.high - objective.low) * rng.random((STARTS * n, n))
    draws = np.where(has_bounds, inside, np.clip(draws, objective.low, objective.high))
    merits = np.array([*map_by_crew(partial(_merit, objective), draws, crew)])
    n_chosen = 0
    for k in np.argsort(merits, kind="stable").tolist():
        if not np.isfinite(merits[k]) or n_chosen == 3:
            break
        if all(np.abs(draws[k] - number).max() > 2 * VALLEY_WIDTH for number in chosen_starts):
            chosen_starts.append(draws[k])
            n_chosen += 1
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
    if not pendula or not any(item.quantity.kind in {"peak", "rms", "damping", "settling"} for item in objective.aims):
        return
    rest = rest_of_scene(scene, pendula)
    if rest is None:
        return
    columns = {item.path: k for k, item in enumerate(objective.free)}
    modes = range(min(len(rest.omega), len(pendula) + 1))
    ways = permutations(modes, len(pendula)) if len(pendula) <= len(modes) else [(0,) * len(pendula)]
    chosen = list(islice(ways, 3))
    if len(pendula) > 1:
        chosen.append((0,) * len(pendula))
    for way in chosen:
        z = objective.start.copy()
        for k, (p, mode) in enumerate(zip(pendula, way, strict=True)):
            n_absorbers = way.count(mode)
            mu = float(rest.mu[k, mode]) * n_absorbers
            if mu <= 0:
                continue
            f, zeta = den_hartog(mu)
            spread = 1 + 0.1 * (k - (n_absorbers - 1) / 2) if n_absorbers > 1 else 1.0
            values = values_for(scene, p, f * float(rest.omega[mode]) * spread, zeta / np.sqrt(n_absorbers)) or {}
            for path, value in values.items():
                if path in columns:
                    z[columns[path]] = np.log(value)
        yield z


def _valleys(objective: Objective, starts: Sequence[Floats], report: Report) -> list[Minimum]:
    """The different minima that the starts lead into, the best first."""
    minima: list[Minimum] = []
    for number, z in enumerate(starts):
        evaluate = _reported(objective.evaluate, report, number / len(starts), (number + 1) / len(starts))
        try:
            minimum = descend(evaluate, z, objective.low, objective.high, coarse=True, minima=minima)
        except (ComputationError, SceneError):
            continue
        if not minimum.point.is_finite or minimum in minima:
            continue
        alike = [
            other_minimum
            for other_minimum in minima
            if abs(other_minimum.point.merit - minimum.point.merit) <= COARSE * max(1.0, abs(other_minimum.point.merit))
            and np.abs(other_minimum.point.z - minimum.point.z).max() <= VALLEY_WIDTH
        ]
        if not alike:
            minima.append(minimum)
        elif minimum.point.merit < alike[0].point.merit:
            minima[minima.index(alike[0])] = minimum
    if not minima:
        raise ComputationError(_endless(objective))
    return sorted(minima, key=lambda minimum: minimum.point.merit)


def _reported(evaluate: Evaluate, report: Report, begin: float, end: float) -> Evaluate:
    """The same, of every point once, reporting a twentieth of what is left: how many there will be is not known."""
    done = begin
    points: dict[tuple[bytes, bool], Evaluation] = {}

    def reported(z: Floats, with_gradients: bool) -> Evaluation:
        nonlocal done
        key = z.tobytes(), with_gradients
        if key not in points:
            done += (end - done) / 20
            report(done)
            points[key] = evaluate(z, with_gradients)
        return points[key]

    return reported


def _descend(objective: Objective, z: Floats) -> Minimum:
    """The minimum next to z, about which the arrays are interpolated again."""
    _centre(objective, z)
    return descend(_reported(objective.evaluate, silent, 0.0, 1.0), z, objective.low, objective.high)


def _centre(objective: Objective, z: Floats) -> None:
    """Interpolate the arrays about z."""
    for factors in objective.cases:
        objective.quantities.centre(objective.numbers(z), factors)


def _robust(objective: Objective, best: Minimum, crew: Crew | None) -> Minimum:
    """The best for the worst of all masses ±5 %, to which cases are added until none is worse."""
    cases = list(objective.cases)
    for _ in range(ROUNDS):
        cost = objective.evaluate(best.point.z, False).cost
        worse = [
            case
            for case in worst_cases(objective, best.point.z, crew)
            if case.cost > cost + COARSE**2 and case.factors not in cases
        ]
        if not worse:
            break
        cases += [case.factors for case in worse]
        objective.cases = tuple(cases)
        best = _descend(objective, best.point.z)
    return best


# ------------------------------------------------------------------------------------------------------- refusals


def _endless(objective: Objective) -> str:
    """Why no start has a finite value."""
    pieces = objective.pieces(objective.start)
    quantities: list[Quantity] = [
        *(item.quantity for item in objective.aims),
        *(item.quantity for item in objective.limits),
    ]
    for quantity, item in zip(quantities, pieces, strict=True):
        if item.endless:
            return f"{quantity.name}: {item.endless}, whatever the free numbers are"
    return "no start has a finite value"


def _refuse_endless(objective: Objective, best: Minimum) -> None:
    z, point = best.point.z, best.point
    if point.excess > EDGE:
        worst = max(range(len(point.limits)), key=lambda k: point.limits[k].largest)
        limit = objective.limits[worst]
        smallest = float(np.exp(point.limits[worst].largest)) * limit.most
        raise ComputationError(f"{limit.name}: cannot be met within the bounds: {smallest:.6g} is what is left")
    for k, number in enumerate(objective.free):
        if number.has_bounds:
            continue
        for edge, words, way in (
            (objective.high[k], "larger", f"{number.at(number.start):.4g}:{number.at(10 * number.start):.4g}"),
            (objective.low[k], "smaller", f"{number.at(number.start / 10):.4g}:{number.at(number.start):.4g}"),
        ):
            if abs(z[k] - edge) < EDGE:
                raise ComputationError(
                    f"{number.path}: the {words}, the better, without end: give it bounds, such as {number.path}={way}"
                )


def _require_damping(objective: Objective, z: Floats) -> None:
    for aim, piece in zip(objective.aims, objective.pieces(z), strict=False):
        if aim.quantity.kind == "damping" and len(piece.values) and np.abs(piece.values).min() <= DAMPING_MIN:
            number = int(piece.at[np.abs(piece.values).argmin()]) + 1
            raise ComputationError(f"damping: nothing damps mode {number}, whatever the free numbers are")


def _refuse_no_peak(objective: Objective, z: Floats) -> None:
    pieces = objective.pieces(z)
    for aim, piece in zip(objective.aims, pieces, strict=False):
        if aim.quantity.kind == "peak" and len(piece.values) and not piece.inside.any():
            at = float(piece.at[piece.values.argmax()]) / (2 * np.pi)
            where = f"that at {at:.6g} Hz, the end of the band"
            if objective.quantities.setting.band is None:
                slowest = float(np.abs(objective.quantities.form.model(objective.scene_at(z)).poles).max())
                where = "the limit at 0 Hz" if 2 * np.pi * at < slowest else "the limit at high frequencies"
            raise ComputationError(f"{aim.quantity.name}: has no peak: its largest magnitude is {where}")
