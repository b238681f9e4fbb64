"""Natural frequencies at the extremes, compared with `scipy.linalg.eigh` and `eig` on the assembled matrices.

    python benchmarks/extremes/modes.py [--quick] [--write]

Every family sweeps one number; the reference is `many_digits.py`.  An error of 1 means that no digit is right.
`--write` puts a line for each case into docs/benchmarks/extremes-modes.csv and the figure into docs/pictures/.
"""

from __future__ import annotations

import argparse
import csv
import warnings
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import mpmath as mp
import numpy as np
from many_digits import Counter, eigenvalues, relative_errors, squares, unlike
from modes_families import FAMILIES, Family
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, LinAlgWarning, eig, eigh

from modal import ComputationError, Scene, matrices, natural_modes
from modal.modes import UNCERTAIN, Modes

DOCS = Path(__file__).parents[2] / "docs"
SMALL, LARGEST_RIVAL, SAMPLED = 20, 1000, 6
QUICK_LINKS = 10
Values = NDArray[np.complex128]
Judge = Callable[[Values], NDArray[np.float64]]


class Case(NamedTuple):
    """One scene: worst relative errors (NaN: not tried), our worst stated bound, and the messages."""

    family: str
    parameter: float
    ours: float
    bound: float
    eigh: float
    eig: float
    outcome: str


# ----------------------------------------------------------------------------------------------------- judging


def judge_of(scene: Scene, *, splitting: bool) -> Judge:
    """A function from λ, ascending, to relative errors (R,), one for each value given."""
    if scene.n_links > SMALL:
        return _counting(scene)
    if scene.has_damping:
        exact = eigenvalues(scene)
        return lambda values: unlike(values, exact)
    truth = squares(scene)
    if not splitting:
        return lambda values: relative_errors(_signed(values), truth)
    with mp.workdps(60):
        roots = [mp.sqrt(x) for x in truth]
        gaps = [(b - a) ** 2 for a, b in pairwise(roots)]
    return lambda values: relative_errors(np.diff(_signed(values)), gaps)


def _signed(values: Values) -> NDArray[np.float64]:
    """±√|ω²| with the sign of ω² = −λ²."""
    return np.where(np.isnan(values), np.nan, np.sign(-(values**2).real) * np.abs(values))


def _counting(scene: Scene) -> Judge:
    counter = Counter(scene)

    def judged(values: Values) -> NDArray[np.float64]:
        chosen = np.unique(np.linspace(0, len(values) - 1, SAMPLED).astype(int))
        errors = np.zeros(len(values))
        errors[chosen] = [counter.error(float(abs(values[k])), int(k)) for k in chosen]
        return errors

    return judged


def worst(errors: NDArray[np.float64]) -> float:
    return float(min(1.0, np.where(np.isnan(errors), 1.0, errors).max(initial=0.0)))


# ----------------------------------------------------------------------------------------------------- solvers


def ours(scene: Scene, judge: Judge) -> tuple[float, float, str]:
    """Worst error of the rows that claim an accuracy, the worst bound among them, and the remarks."""
    try:
        modes = natural_modes(scene)
    except ComputationError as error:
        return np.nan, np.nan, f"refuses: {error}"
    value, error = (np.repeat(part, modes.multiplicity) for part in (modes.eigenvalue, modes.error))
    value, error = value[value != 0], error[value != 0]
    errors = judge(value)
    if len(errors) == len(value) - 1:
        error = between(np.abs(value), error)
        return (
            worst(errors),
            float(error.max()),
            _said(modes) + "; a splitting below the bounds: a note" * bool(error.max() >= 1),
        )
    claims = error < UNCERTAIN
    return worst(errors[claims]), float(error[claims].max(initial=0.0)), _said(modes)


def between(omega: NDArray[np.float64], error: NDArray[np.float64]) -> NDArray[np.float64]:
    """The relative errors of frequency differences from bounds on neighbouring frequencies, at most 1."""
    gap, doubt = np.diff(omega), (error * omega)[1:] + (error * omega)[:-1]
    return np.where(gap > doubt, doubt / np.where(gap > 0, gap, 1.0), 1.0)


def _said(modes: Modes) -> str:
    marked = int(np.sum(modes.error >= UNCERTAIN))
    close = int(modes.indistinct.sum()) if len(modes) <= LARGEST_RIVAL else 0
    words = [f"! on {marked} of {len(modes)} rows"] * (marked > 0) + [f"~ on {close}"] * (close > 0)
    return "; ".join([*words, *modes.notes]) or "answers"


def symmetric(scene: Scene) -> tuple[Values, str]:
    """λ by `eigh(K, M)`."""
    linear = matrices(scene)
    return _oscillating(scene, eigh(linear.K, linear.M, eigvals_only=True).astype(complex))


def general(scene: Scene) -> tuple[Values, str]:
    """λ by `eig`: of the pencil, or with dampers of the state matrix."""
    linear = matrices(scene)
    if not scene.has_damping:
        return _oscillating(scene, eig(linear.K, linear.M, right=False))
    n = len(linear.M)
    inverse = np.linalg.solve(linear.M, np.hstack([linear.K, linear.D]))
    values = eig(np.block([[np.zeros((n, n)), np.eye(n)], [-inverse]]), right=False)
    values = values[np.argsort(np.abs(values))][_free(scene) :]
    growing = int(np.sum(values.real > 0))
    return values[values.imag >= 0], f"{growing} growing" if growing else ""


def _free(scene: Scene) -> int:
    return int(scene.support.kind == "cart" and scene.support.stiffness == 0)


def _oscillating(scene: Scene, square: Values) -> tuple[Values, str]:
    """iω from ω², without the zero of a free cart and infinite values, with a count of impossible ones."""
    finite = square[np.isfinite(square)]
    finite = finite[np.argsort(np.abs(finite))][_free(scene) :]
    finite = finite[np.argsort(finite.real)]
    below = 0 if scene.stands else int(np.sum(finite.real <= 0))
    turned, lost = int(np.sum(finite.imag != 0)), int(np.sum(~np.isfinite(square)))
    counted = {"with ω² ≤ 0": below, "complex": turned, "infinite": lost}
    words = [f"{number} {what}" for what, number in counted.items() if number]
    real = np.where((finite.real > 0) | scene.stands, finite.real, np.nan)
    return 1j * np.sqrt(real.astype(complex)), ", ".join(words)


def rival(solve: Callable[[Scene], tuple[Values, str]], scene: Scene, judge: Judge) -> tuple[float, str]:
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore", LinAlgWarning)
            values, words = solve(scene)
        return worst(judge(values)), words
    except (LinAlgError, ValueError) as error:
        return 1.0, f"raises {type(error).__name__}"


def case(family: Family, parameter: float) -> Case:
    scene = family.scene(parameter)
    judge = judge_of(scene, splitting=family.splitting)
    error, bound, said = ours(scene, judge)
    tried = {"eigh": symmetric, "eig": general} if scene.n_links <= LARGEST_RIVAL else {}
    if scene.has_damping:
        tried.pop("eigh")
    rivals = {name: rival(solve, scene, judge) for name, solve in tried.items()}
    words = "; ".join([said, *(f"{name}: {text}" for name, (_, text) in rivals.items() if text)])
    errors = [rivals[name][0] if name in rivals else np.nan for name in ("eigh", "eig")]
    return Case(family.name, parameter, error, bound, *errors, words)


def cases(*, quick: bool) -> list[Case]:
    swept = [(family, p) for family in FAMILIES for p in family.parameters]
    chosen = [(f, p) for f, p in swept if not quick or f.scene(p).n_links <= QUICK_LINKS]
    return [_told(case(family, parameter)) for family, parameter in chosen]


def _told(case_told: Case) -> Case:
    numbers = "  ".join(f"{name} {getattr(case_told, name):8.1e}" for name in ("ours", "bound", "eigh", "eig"))
    print(f"{case_told.family:22} {case_told.parameter:8.0e}  {numbers}  {case_told.outcome}", flush=True)
    return case_told


def write(judged_cases: Sequence[Case]) -> None:
    from modes_figure import figure

    with (DOCS / "benchmarks" / "extremes-modes.csv").open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(("family", "parameter", "error", "stated_bound", "error_eigh", "error_eig", "outcome"))
        table.writerows(
            (f, f"{p:g}", *("" if np.isnan(e) else f"{e:.1e}" for e in rest), o) for f, p, *rest, o in judged_cases
        )
    figure(judged_cases, DOCS / "pictures" / "extremes-modes.png")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help=f"scenes of at most {QUICK_LINKS} links")
    parser.add_argument("--write", action="store_true", help="write the cases and the figure into docs/")
    options = parser.parse_args()
    judged_cases = cases(quick=options.quick)
    if options.write:
        write(judged_cases)


if __name__ == "__main__":
    main()
