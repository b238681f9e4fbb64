"""What `table` computes again about its rows on request: angles by periodic orbits, and proofs of frequencies.

A proof says for every row between which squares of frequencies its own is, and how many are below both: what
`check_proof.py` counts again.  It is that file which judges here too, so that a table says no more than a reader will
find; neither affects the frequencies of the table.
"""

from __future__ import annotations

import argparse
import json
import os
import tomllib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from decimal import Decimal
from fractions import Fraction
from math import ceil, degrees, floor, inf, sqrt
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from modal.eigen.amplitude import ONE_PERCENT
from modal.errors import ComputationError, MultipendulaError, SceneError
from modal.modes import Mode, Modes, tables
from modal.report import as_json
from modal.scene import Fixed, Scene, dumps, example_names, require
from modal.scene.contents import text_of
from modal.scene.files import example_text
from multipendula import check_proof
from multipendula.check_proof import NotProvedError, Sums, UnreadableError
from multipendula.commands.shared import bar, estimate_of, in_a_folder, output, remark

if TYPE_CHECKING:
    from modal.exact.enclosures import SceneInBalls

WHAT = "python check_proof.py SCENE.toml TABLE.json PROOF.json re-checks it, with Python's standard library alone"


class Evidence(NamedTuple):
    """The rows of a table and the source of their starred angles; by number deviations of ω and ζ, and proofs."""

    rows: list[Mode]
    starred: str
    stds: dict[int, tuple[float, float]] | None
    proofs: dict[int, str] | None


def evidence(options: argparse.Namespace, modes: Modes, rows: list[Mode], starred: str) -> Evidence:
    """Requested additions to the rows; a proof goes into its file."""
    estimate = estimate_of(modes.scene, options.covariance)
    stds = proofs = None
    if estimate:
        from modal.identification import mode_stds

        deviations = mode_stds(modes, estimate, [modes.index_of(row) for row in rows])
        stds = {row.number: (each.omega, each.zeta) for row, each in zip(rows, deviations, strict=True)}
    if options.orbits:
        rows, starred = angles_by_orbits(modes, rows)
    if options.prove:
        in_a_folder(options.prove, option="--prove")
        if not options.prove.endswith(".json") or options.prove in (options.scene, options.output):
            raise SceneError([f"--prove {options.prove}: a proof needs a .json file of its own"])
        with bar(float(len(rows)), "row", "proof") as report, output(options.prove) as write:
            text, proofs = prove(modes, rows, options.scene, report)
            write(text)
        if "proved" in proofs.values():
            remark(f"to re-check it: python -m multipendula.check_proof SCENE.toml TABLE.json {options.prove}")
        if reasons := sorted({claim["why"] for claim in json.loads(text)["modes"] if claim.keys() == {"mode", "why"}}):
            remark(f"not proved: {'; '.join(reasons[:3])}")
        if "enclosed" in proofs.values():
            remark("enclosed by ball arithmetic about an enclosed equilibrium; check_proof.py does not re-check it")
        if swings_alone(modes.scene):
            remark("the 1 % angle is enclosed: between {:.2f}° and {:.2f}°".format(*angle_of_one_link()))
    return Evidence(rows, starred, stds, proofs)


def angles_by_orbits(modes: Modes, rows: Sequence[Mode]) -> tuple[list[Mode], str]:
    """The rows with the 1 % angles of starred modes from periodic orbits, and the source of these angles."""
    from nonlinear.orbits import orbit_where_off

    replaced, missing = [], []
    for row in rows:
        angle = row.linear_to_1_percent_deg
        if row.resonances:
            try:
                orbit = orbit_where_off(modes.scene, row.number)
                angle = degrees(orbit.amplitude) if orbit else inf
            except MultipendulaError as error:
                missing.append(f"{tables.GUIDE} for mode {row.number} ({error})")
        replaced.append(replace(row, linear_to_1_percent_deg=angle))
    return replaced, "; ".join(["the 1 % angle is that of the mode's periodic orbits", *missing])


def swings_alone(scene: Scene) -> bool:
    """Whether every pendulum is one link on a fixed support, which gravity alone turns back."""
    is_free = scene.support == Fixed() and scene.features <= {"copies", "rotor"}
    return is_free and all(pendulum.n_links == 1 for pendulum in scene.pendulum)


def angle_of_one_link() -> tuple[float, float]:
    """Two angles (deg, rounded outwards) between which the frequency of one link is 1 % below that of small swings.

    For |a| ≤ 2, 0 ≤ ω(a)/ω₀ − 1 + a²/16 ≤ a⁴/3072, by the arithmetic-geometric mean (docs/explanation/proof.md).

    >>> angle_of_one_link()
    (22.91, 22.93)
    """
    low = 16 * ONE_PERCENT
    high = (1 - sqrt(1 - low / 48)) * 96  # where a²/16 − a⁴/3072 is 1 %
    return floor(100 * degrees(sqrt(low))) / 100, ceil(100 * degrees(sqrt(high))) / 100


def prove(
    modes: Modes, rows: Sequence[Mode], source: object, report: Callable[[float], object]
) -> tuple[str, dict[int, str]]:
    """A proof of these rows as JSON, and by their numbers "proved", "enclosed" or "not proved".

    `source` is where the scene was read; `report` is called with the number of rows that are done.
    """
    scene = scene_data(modes.scene, source)
    try:
        blocks, why = check_proof.blocks_of(scene), ""
    except (UnreadableError, NotProvedError) as error:
        blocks, why = [], str(error)
    if modes.scene.has_modal_damping and modes.scene.has_dampers:
        blocks, why = [], "damping ratios with dampers make a matrix that is not rational"
    prover = _Prover(blocks, why, first_numbers(modes), balls=balls_of(modes.scene))
    claims, words = [], {}
    for done, row in enumerate(rows, start=1):
        claim = prover.claim(row, complex(modes.eigenvalue[modes.index_of(row)]))
        verdict = check_proof.judge(tables.record_of(row), claim, blocks, prover.bits)
        is_enclosed = "enclosed" in claim
        words[row.number] = "proved" if verdict.proved else "enclosed" if is_enclosed else "not proved"
        claims.append(claim if verdict.proved or is_enclosed else {"mode": row.number, "why": verdict.words})
        report(done)
    return as_json({"what": WHAT, "scene": scene, "bits": prover.bits, "modes": claims}), words


def balls_of(scene: Scene) -> SceneInBalls | None:
    """The counts in balls of an undamped scene whose links lean; None of any other, and without python-flint."""
    from modal.exact.enclosures import SceneInBalls

    if "constant_force" not in scene.features:
        return None
    try:
        require(scene, "an enclosure")
        balls = SceneInBalls(scene)
        balls.blocks()
    except MultipendulaError:
        return None
    return balls


def scene_data(scene: Scene, source: object) -> dict[str, Any]:
    """The content of a scene's file as it was written; of any other scene that of the file which `dump` would write."""
    name = os.fspath(source) if isinstance(source, str | os.PathLike) else ""
    if name and Path(name).is_file():
        return tomllib.loads(text_of(name).replace("\r\n", "\n"))
    return tomllib.loads(example_text(name) if name in example_names() else dumps(scene))


def first_numbers(modes: Modes) -> dict[int, int]:
    """The number of the first frequency of every row, counting all in ascending order of ω²; none of some modes."""
    if modes.is_partial:
        return {}
    numbers, at = {}, 1
    for row in sorted(modes.every, key=lambda row: -row.omega if row.growth_rate is not None else row.omega):
        numbers[row.number] = at
        at += row.multiplicity
    return numbers


class _Prover:
    """The claims about rows of a table, for the sums of squares of its scene.

    Of more coordinates `in_fractions` these grow so long that integers rounded outwards are sooner done, and of more
    coordinates `in_polynomials` roots are not counted (`benchmarks/proofs.py`).
    """

    def __init__(
        self,
        blocks: list[Sums],
        why: str,
        numbers: dict[int, int],
        in_fractions: int = 40,
        in_polynomials: int = 12,
        balls: SceneInBalls | None = None,
    ) -> None:
        self.blocks, self.why, self.numbers, self.balls = blocks, why, numbers, balls
        self.is_damped = any(any(block.D) for block in blocks)
        largest = max((len(block.M) for block in blocks), default=0)
        self.bits = 0 if largest <= in_fractions else 128
        if self.is_damped and largest > in_polynomials:
            self.why = f"with dampers, polynomials of at most {in_polynomials} coordinates are made"

    def claim(self, row: Mode, root: complex) -> dict[str, Any]:
        """The claim for a row with this eigenvalue (rad/s), as in the proof."""
        try:
            if self.balls and not row.is_uncertain:
                return {"mode": row.number, "why": self.why, "enclosed": self._counts(row)}
            if self.why or row.is_uncertain:
                return {"mode": row.number, "why": self.why or "no digit of it is certain"}
            return {"mode": row.number, **(self._roots(row, root) if self.is_damped else self._counts(row))}
        except (NotProvedError, ComputationError) as error:
            return {"mode": row.number, "why": str(error)}

    def _counts(self, row: Mode) -> dict[str, Any]:
        for low, high in intervals(row):
            gain = 1 if self.bits and low != high else 0
            try:
                before, upto = self._below(Fraction(low), -gain)[0], sum(self._below(Fraction(high), gain))
            except NotProvedError as error:
                problem = error
                continue
            first = self.numbers.get(row.number, before + 1)
            numbers = [first, first + row.multiplicity - 1]
            if not before < first <= numbers[1] <= upto:
                problem = NotProvedError(f"{before} are below its interval, {upto} up to its end")
                continue
            return {"omega_squared": [low, high], "counts": [before, upto], "numbers": numbers}
        raise problem

    def _below(self, x: Fraction, gain: int) -> tuple[int, int]:
        """How many ω² are below x, and how many are x."""
        return (self.balls.count(x), 0) if self.balls else check_proof.count(self.blocks, x, self.bits, gain)

    def _roots(self, row: Mode, root: complex) -> dict[str, Any]:
        radius = 0.9 * row.omega * row.relative_error_bound  # with the rounding of its centre it is within the bound
        roots = check_proof.count_roots(self.blocks, *map(Fraction, (root.real, root.imag, radius)))
        return {"centre": [root.real, root.imag], "radius": radius, "roots": roots}


def intervals(row: Mode) -> Iterator[tuple[str, str]]:
    """Ends of intervals within the bound of a row, decimals of its ω², negative where it grows; more digits in turn.

    An end may be a root of a part of the scene, where the count ends before its time; then the next is tried.
    """
    omega, error = Fraction(row.omega), Fraction(row.relative_error_bound)
    ends = [(omega * (1 - error)) ** 2, (omega * (1 + error)) ** 2]
    low, high = (-ends[1], -ends[0]) if row.growth_rate is not None else ends
    for digits in (2, 4, 6):
        places = 0
        while 0 < (high - low) * 10**places < 10**digits:
            places += 1
        first, last = ceil(low * 10**places), floor(high * 10**places)
        yield str(Decimal(f"{first}e-{places}")), str(Decimal(f"{last}e-{places}"))
