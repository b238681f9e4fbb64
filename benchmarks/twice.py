"""Random scenes written twice, on a cart and as the same thing on a structure: every verb's numbers compared.

    python benchmarks/twice.py [--scenes 200] [--from 0] [--quick] [--keep FOLDER] [--verbs VERB …]

Pairs are those of `twin_scenes.py`; half of them have masses of 24 orders, with springs, dampers and lengths to match.
For each verb the table has how many pairs both sides answer, the largest difference of ordinary and of extreme ones,
relative to each number's own size (shapes, motions, and what a table promises of its largest entry: to that of the row,
in coordinates scaled by their masses), how many pairs differ by more than LIMIT, and of these how many where all
frequencies of both sides are bounded to less.  Where one side has no number, or is refused, is counted by itself.
`--keep` puts both scene files and what differs into a folder.  Exit code 1 where no bound admits a difference.
"""

from __future__ import annotations

import argparse
import json
import sys
import warnings
from collections.abc import Callable, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from tabulate import tabulate
from twin_scenes import Side, Twins, twins

from modal import ComputationError, dumps, matrices, natural_frequencies, natural_modes, tune
from modal.coupling import explain
from modal.errors import MultipendulaError
from modal.exports import FORMATS
from modal.loci import follow_loci
from modal.modes import Modes, quality_factors
from modal.modes import table as written
from modal.scene.parameters import find_places, number_at, parse_variations
from modal.scene.records import Spectrum
from modal.statespace import StateSpace, frequency_response, modal_gains, state_space, to_modal_form
from modal.types import Floats
from modal.vibration import random_response, thermal_noise
from nonlinear import State, simulate

LIMIT = 1e-12
QUICK = 18
SWING = 0.2
"""The largest angle (rad) of simulated motions."""
WARM = 290.0
FEW = 4
"""Places from either end of which sensitivities are compared; most links of a scene that is tuned, or shaken."""


class Answers(NamedTuple):
    """Numbers by name, each to be compared with its size, or of `rows` (…, n) with the largest of its row."""

    numbers: dict[str, Any]
    rows: dict[str, Any] = {}  # noqa: RUF012


class Seen:
    """A side of a pair, and its numbers in its twin's coordinates; `places` are those of numbers that both have."""

    def __init__(self, side: Side, places: Sequence[str] = ()) -> None:
        self.side, self.scene, self.places = side, side.scene, places

    @cached_property
    def modes(self) -> Modes:
        """The table."""
        return natural_modes(self.scene)

    @cached_property
    def model(self) -> StateSpace:
        """From forces on the coordinates, or torques of joints, to everything that moves."""
        return state_space(self.scene, (self.side.drive,), self.side.outputs)

    @cached_property
    def omega(self) -> Floats:
        """All natural frequencies."""
        return natural_frequencies(self.scene)

    @property
    def bound(self) -> float:
        """The largest stated bound of a frequency; infinite where there are no modes."""
        try:
            return float(np.nanmax(self.modes.error, initial=0.0))
        except ComputationError:
            return np.inf

    @cached_property
    def both(self) -> list[int]:
        """The indices of the modes that its twin has too: additional parts are still in them."""
        modes, beside = self.modes, self.side.beside
        if not beside:
            return list(range(len(modes)))
        columns = np.array([modes.column(modes.shape(k)) for k in range(len(modes))])
        weights = modes.matrices.M.diagonal() * abs(columns) ** 2
        alone = weights[:, 1 : 1 + beside].sum(1) / weights.sum(1)
        return np.flatnonzero(alone < 0.5).tolist()

    def rows(self, rows: Any, power: int = 1) -> Any:
        """Rows over q without the additional parts, the first of them in the unit of the twin's first coordinate."""
        kept = np.delete(np.array(rows), range(1, 1 + self.side.beside), axis=0)
        kept[:1] *= self.side.size**power if self.leading else 1.0
        return kept

    def square(self, square: Any, power: int = -1) -> Any:
        """A matrix over q on both sides: by default one of forces by displacements, of which the columns get 1/size."""
        return self.rows(self.rows(square, power).T, -1).T

    @property
    def leading(self) -> bool:
        """Whether q begins with anything but an angle of a link."""
        return len(matrices(self.scene).M) > self.scene.n_links

    @property
    def inertia(self) -> Floats:
        """The square roots of the diagonal of M, by which coordinates of different units are compared."""
        return np.sqrt(self.square(matrices(self.scene).M).diagonal())

    @property
    def kept(self) -> list[int]:
        """The outputs of the model that its twin has too."""
        return [k for k in range(len(self.model.outputs)) if not 1 <= k <= self.side.beside]

    @property
    def ends(self) -> tuple[float, float]:
        """The lowest and the highest frequency of what its twin has too."""
        omega = self.modes.omega[self.both] if self.side.beside else self.omega
        return float(omega[omega > 0].min()), float(np.nanmax(omega))

    @property
    def points(self) -> Floats:
        """Frequencies (rad/s) from far below the modes to far above, the same for both of a pair."""
        low, high = (10.0 ** round(float(np.log10(each))) for each in self.ends)
        return np.geomspace(0.0317 * low, 31.7 * high, 9)


# ------------------------------------------------------------------------------------------------------- the verbs


def frequencies(seen: Seen) -> Answers:
    if seen.side.beside:
        return Answers({"omega": np.repeat(seen.modes.omega[seen.both], seen.modes.multiplicity[seen.both])})
    return Answers({"omega": seen.omega})


def table(seen: Seen) -> Answers:
    names = ("omega", "damping_ratio", "multiplicity")
    return Answers({name: getattr(seen.modes, name)[seen.both] for name in names})


def shapes(seen: Seen) -> Answers:
    """Sums of φφᵀ over the modes of each frequency, which no choice of a basis changes."""
    modes, scale = seen.modes, seen.inertia
    squares = []
    for k in seen.both:
        several = int(modes.multiplicity[k])
        if several > 1 and np.iscomplexobj(modes.shape(k).angles):
            continue
        columns = [scale * seen.rows(modes.column(modes.shape(k, copy, "mass"))) for copy in range(several)]
        if np.iscomplexobj(columns[0]):
            columns = [column / column[np.abs(column).argmax()] for column in columns]
        squares.append(sum(np.outer(column, column).ravel() for column in columns))
    return Answers({}, {"shape": np.array(squares)})


def participation(seen: Seen) -> Answers:
    rows = [seen.modes[k] for k in seen.both]
    keys = ("effective_mass", "effective_mass_share", "kappa", "linear_to_1_percent_deg")
    keys += ("cart_participation",) * (seen.scene.cart is not None)
    return Answers({key: np.array([getattr(row, key) for row in rows]) for key in keys})


def fixed_base(seen: Seen) -> Answers:
    column = np.array(seen.modes.to_dict()["fixed_base_effective_mass_kg"], dtype=float)
    return Answers({"mass": column[seen.both]})


def quality(seen: Seen) -> Answers:
    return Answers({"Q": quality_factors(seen.modes, seen.both)})


def coupling(seen: Seen) -> Answers:
    families = explain(seen.scene).families
    names = ("omega", "fold", "still", "mass", "strength", "splitting", "beat")
    numbers: dict[str, Any] = {
        name: np.array([getattr(f, name) or 0.0 for f in families], dtype=float) for name in names
    }
    branches = [branch for family in families for branch in family.branches]
    numbers["branches"] = np.array([branch.omega for branch in branches])
    numbers["strengths"] = np.array([branch.strength for branch in branches])
    numbers["others hold"] = np.array([f.exchange.most if f.exchange else np.nan for f in families])
    return Answers(numbers)


def dense(seen: Seen) -> Answers:
    model = matrices(seen.scene)
    return Answers({name: seen.square(getattr(model, name)) for name in ("M", "K", "D")})


def export(seen: Seen) -> Answers:
    """A, B and C as a file of the model has them, rates and forces scaled by masses, each over its largest entry."""
    record = json.loads(FORMATS["json"].write(seen.model))
    A, B, C = (np.array(record[name]) for name in "ABC")
    n, scale = len(A) // 2, seen.inertia
    parts = {"A": A[n:, :n], "A of rates": A[n:, n:]}
    rows = {name: scale[:, None] * seen.square(part, 1) / scale for name, part in parts.items()}
    rows["B"] = (scale * seen.rows(B[n:, 0]) * _force(seen))[None]
    outputs = C[seen.kept]
    outputs[:1] *= _force(seen)
    rows["C"] = np.hstack([seen.rows(part.T, -1).T / scale for part in (outputs[:, :n], outputs[:, n:])])
    return Answers({}, {name: part.ravel() for name, part in rows.items()})


def _force(seen: Seen) -> float:
    """What a force on the first coordinate is for its twin, and the displacement."""
    return seen.side.size if seen.leading else 1.0


def response(seen: Seen) -> Answers:
    form = to_modal_form(seen.modes, seen.model)
    H = frequency_response(form, seen.points, inputs=[0], outputs=seen.kept)[:, 0]
    H[:1] *= _force(seen)
    return Answers({"H": H * _force(seen)})


def transmissibility(seen: Seen) -> Answers:
    model = state_space(seen.scene, ("support_acceleration",), ("tip_positions", "tip_accelerations"))
    return Answers({"T": frequency_response(to_modal_form(seen.modes, model), seen.points)[:, 0]})


def gains(seen: Seen) -> Answers:
    sides = modal_gains(seen.modes, seen.model)
    outputs = sides.outputs.gain[np.ix_(seen.both, seen.kept)]
    outputs[:, :1] *= _force(seen)
    return Answers({"input": sides.inputs.gain[seen.both, 0] * _force(seen)}, {"outputs": outputs})


def sensitivities(seen: Seen) -> Answers:
    """(p/ω) ∂ω/∂p of the places that both have other than 1, about the size of the largest: its digits are promised."""
    record = json.loads(written(seen.modes, [seen.modes[k] for k in seen.both], "json", sensitive=True))
    slopes = [row["sensitivities"] for row in record["modes"]]
    rows = [[1.0, *(slope[p]["relative"] if p in slope else np.nan for p in seen.places)] for slope in slopes]
    return Answers({}, {"relative": np.array(rows, dtype=float)})


def vibration(seen: Seen) -> Answers:
    wind = Spectrum((1e-9, 1e9), (1.0, 1.0), "acceleration")
    shaken = random_response(seen.scene, wind, ("tip_positions",))
    return Answers({"PSD": shaken.psd(seen.points / 6.283), "rms": shaken.rms})


def thermal(seen: Seen) -> Answers:
    return Answers({"ASD": thermal_noise(seen.scene, WARM).asd(seen.points / 6.283)})


def loci(seen: Seen) -> Answers:
    if not seen.places:
        return Answers({})
    place, *_ = seen.places
    middle = number(seen, place)
    tracks = follow_loci(seen.scene, parse_variations([f"{place}={0.8 * middle!r}:{1.3 * middle!r}:3"])[0])
    ends = np.sort(tracks.omega[[0, -1]], axis=1)
    return Answers({"omega": ends[:, : len(seen.omega)]})


def number(seen: Seen, place: str) -> float:
    return number_at(seen.scene, find_places(seen.scene, place)[0])


def tuning(seen: Seen) -> Answers:
    quantity = f"peak:{seen.model.outputs[0].name}/{seen.model.inputs[0].name}"
    place = seen.places[0]
    middle = number(seen, place)
    tuned = tune(seen.scene, [f"{place}={0.5 * middle!r}:{2 * middle!r}"], minimize=[quantity])
    before, after = (peak * _force(seen) ** 2 for peak in (tuned.before, tuned.after))
    return Answers({"before": np.array([before]), "after": np.array([after])})


def motion(seen: Seen) -> Answers:
    """Five instants of about the fastest period, released from angles of either sign."""
    scene, links, turned = seen.scene, seen.scene.n_links, seen.side.outputs[-1] != "pivot_forces"
    up = [way == "up" for p in scene.pendulum for _ in range(p.count) for way in p.ways]
    stand = np.pi * np.array(up)
    unit = 1.0 if turned else max(link.length for p in scene.pendulum for link in p.links)
    angles = SWING * np.cos(1.0 + np.arange(links + seen.leading))
    first, hung = unit * angles[: int(seen.leading)] / seen.side.size, angles[int(seen.leading) :] + stand
    structured = scene.is_structured
    still = np.zeros(len(first) * structured)
    cart = 0.0 if structured or not len(first) else float(first[0])
    start = State(hung, np.zeros(links), cart, supports=first if structured else still, support_rates=still)
    step = 10.0 ** np.floor(np.log10(2 / seen.ends[1]))
    run = simulate(scene, 5 * step, start=start, output=5, tolerance=1e-13)
    led = run.motion.supports if structured else run.motion.cart[:, None][:, : len(first)]
    return Answers({}, {"q": np.hstack([led * seen.side.size / unit, run.motion.links - stand])})


VERBS: dict[str, Callable[[Seen], Answers]] = {
    "frequencies": frequencies,
    "table": table,
    "shapes": shapes,
    "participation": participation,
    "fixed-base masses": fixed_base,
    "quality": quality,
    "explain": coupling,
    "matrices": dense,
    "export": export,
    "response": response,
    "transmissibility": transmissibility,
    "gains": gains,
    "sensitivities": sensitivities,
    "vibration": vibration,
    "thermal noise": thermal,
    "loci": loci,
    "tune": tuning,
    "simulate": motion,
}


# ------------------------------------------------------------------------------------------------------- comparison


class Compared(NamedTuple):
    """One verb of one pair: what became of it, the largest difference and its number, and whether bounds admit it."""

    verb: str
    became: str
    difference: float = 0.0
    where: str = ""
    admitted: bool = False


def compare(pair: Twins, verb: str, sides: tuple[Seen, Seen]) -> Compared:
    answers, refusals = [], []
    for seen in sides:
        try:
            answers.append(VERBS[verb](seen))
        except (MultipendulaError, ValueError, ArithmeticError) as error:
            refusals.append(f"{type(error).__name__}: {error}")
    if refusals:
        became = "refused" if len(refusals) == 2 else "refused once"
        return Compared(verb, became, where=" | ".join(refusals)[:300])
    first, second = answers
    worst = [(0.0, "")]
    missing = []
    for of_rows, (mine, theirs) in ((False, (first.numbers, second.numbers)), (True, (first.rows, second.rows))):
        for name in [name for name in mine if name in theirs]:
            apart, lost = difference(np.asarray(mine[name]), np.asarray(theirs[name]), of_rows)
            worst.append((apart, name))
            missing += [name] * lost
    largest, where = max(worst)
    admitted = largest > LIMIT and any(not seen.bound < LIMIT / 10 for seen in sides)
    return Compared(verb, "unknown once" if missing and largest <= LIMIT else "answered", largest, where, admitted)


def difference(first: Any, second: Any, of_rows: bool) -> tuple[float, bool]:
    """The largest relative difference of two arrays, and whether one has numbers where the other has none."""
    if first.shape != second.shape:
        return np.inf, False
    if not first.size:
        return 0.0, False
    lost = bool((np.isnan(first) != np.isnan(second)).any())
    apart = np.where(first == second, 0.0, np.abs(first - second))
    size = np.maximum(np.abs(first), np.abs(second))
    if of_rows:
        size = np.broadcast_to(np.nanmax(np.where(np.isnan(size), 0.0, size), axis=-1, keepdims=True), size.shape)
    with np.errstate(all="ignore"):
        relative = np.where(apart > 0, apart / size, 0.0)
    return float(np.nanmax(np.where(np.isnan(apart), 0.0, relative))), lost


def judge(seed: int, verbs: Sequence[str]) -> tuple[Twins, list[Compared]]:
    pair = twins(seed)
    places = [*pair.places[:FEW], *pair.places[FEW:][-FEW:]]
    sides = Seen(pair.first, [a for a, _ in places]), Seen(pair.second, [b for _, b in places])
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        return pair, [compare(pair, verb, sides) for verb in verbs if fits(pair, verb)]


def fits(pair: Twins, verb: str) -> bool:
    """Whether the verb says the same of both: at large angles, or of pendula of which one is the support itself."""
    alone = pair.way in {"tilt", "swing"}
    damped = pair.first.scene.has_damping
    if (verb == "loci" and damped) or (verb == "thermal noise" and not damped):
        return False
    if verb == "explain":
        return not alone and not pair.second.beside
    if verb == "fixed-base masses":
        return not alone
    if verb == "simulate":
        return pair.large and not pair.extreme
    few = pair.first.scene.n_links <= FEW
    if verb == "vibration":
        return few
    if verb == "loci":
        return not pair.second.beside
    return verb != "tune" or (few and not pair.extreme and damped and bool(pair.places))


def keep(folder: Path, seed: int, pair: Twins, apart: Sequence[Compared]) -> None:
    """Both scene files and what differs."""
    for name, side in (("first", pair.first), ("second", pair.second)):
        (folder / f"{seed:03d}-{pair.way}-{name}.toml").write_text(dumps(side.scene), encoding="utf-8")
    lines = [f"{row.verb}: {row.became} {row.difference:.3e} {row.where} admitted={row.admitted}" for row in apart]
    (folder / f"{seed:03d}-{pair.way}.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")


def report(judged: dict[int, tuple[Twins, list[Compared]]]) -> str:
    lines, listed = [], []
    for verb in VERBS:
        each = [(seed, pair, row) for seed, (pair, rows) in judged.items() for row in rows if row.verb == verb]
        known = [(seed, pair, row) for seed, pair, row in each if row.became in {"answered", "unknown once"}]
        worst = [max((o.difference for _, p, o in known if p.extreme is kind), default=0.0) for kind in (False, True)]
        apart = [(seed, pair, row) for seed, pair, row in known if row.difference > LIMIT]
        once = [row.became for *_, row in each]
        unbounded = sum(not row.admitted for *_, row in apart)
        lines.append((
            verb, len(known), *(f"{w:.0e}" for w in worst), len(apart), unbounded,
            once.count("unknown once"), once.count("refused once"), once.count("refused"),
        ))  # fmt: skip
        listed += [f"{seed} {pair.way}: {verb}: {row.difference:.1e} of {row.where}" for seed, pair, row in apart]
    headings = (
        *("verb", "pairs", "ordinary", "extreme", f"above {LIMIT:g}", "of these bounded"),
        *("unknown once", "refused once", "refused"),
    )
    return tabulate(lines, headings, tablefmt="github") + "\n\n" + "\n".join(listed)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=200)
    parser.add_argument("--from", type=int, default=0, dest="first")
    parser.add_argument("--quick", action="store_true", help=f"{QUICK} pairs")
    parser.add_argument("--keep", type=Path)
    parser.add_argument("--verbs", nargs="*", default=list(VERBS), choices=list(VERBS))
    asked = parser.parse_args(arguments)
    judged = {}
    for seed in range(asked.first, asked.first + (QUICK if asked.quick else asked.scenes)):
        judged[seed] = judge(seed, asked.verbs)
        apart = [row for row in judged[seed][1] if row.difference > LIMIT or "once" in row.became]
        if asked.keep and apart:
            asked.keep.mkdir(parents=True, exist_ok=True)
            keep(asked.keep, seed, judged[seed][0], apart)
    print(report(judged))
    return int(any(row.difference > LIMIT and not row.admitted for _, rows in judged.values() for row in rows))


if __name__ == "__main__":
    sys.exit(main())
