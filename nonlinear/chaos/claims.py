"""The claims of two papers about chaos as studies, with verdicts based on the intervals of the exponents.

Paper 001: chaos grows with the number of links.  Its rate depends on the time unit; two are used: links of one length
(λ sqrt(l/g)), and a chain of one total length cut into ever more of them (λ sqrt(L/g), L = n l).

Paper 000: hanging double pendula on one cart makes them more predictable.  They are compared with as many of them on a
fixed support, taken together, from the same starts.  Theory contradicts the claim: weakly coupled equal chaotic systems
have a larger λ than uncoupled ones [Daido1984].
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import sqrt

from tabulate import tabulate

from modal.errors import SceneError
from modal.scene import Bob, Cart, Fixed, Pendulum, Rod, Scene
from nonlinear.chaos.studies import DECISIVE_UNCERTAINTIES, Case, ChaosStudy, Finding, compare_starts, scale

Kind = type[Bob] | type[Rod]
Table = tuple[Sequence[str], list[list[str]]]
GRAVITY = 9.81
"""Physics: m/s², as in both papers."""
PAPER_CART_MASS = 100.0
"""Format: kg, the cart of paper 000."""


def study(paper: str, *, quick: bool = False) -> ChaosStudy:
    """The study of paper 000 or 001, or a short version of it; raise SceneError for any other paper."""
    if paper not in _STUDIES:
        raise SceneError([f"paper:{paper}: must be one of {', '.join(f'paper:{name}' for name in _STUDIES)}"])
    return _STUDIES[paper](quick)


def verdicts(finding: Finding) -> list[str]:
    """One sentence for each version of the claim."""
    return _VERDICTS[finding.study.paper](finding)


def text(finding: Finding) -> str:
    """The claim, the table of exponents and the verdicts."""
    study, (headings, rows) = finding.study, _TABLES[finding.study.paper](finding)
    how = (
        f"{study.ensemble} starts at rest with the energy of level links, {study.duration:g} s each; "
        f"± is one standard uncertainty, differences count from {DECISIVE_UNCERTAINTIES:g}"
    )
    table = tabulate(rows, headings, disable_numparse=True, colalign=("left", *["right"] * (len(headings) - 1)))
    return "\n".join([f"Paper {study.paper}: {study.claim}", how, "", table, "", *verdicts(finding)])


# ------------------------------------------------------------------------------------------- paper 001: longer chains


def _chains(quick: bool) -> ChaosStudy:
    kinds: dict[str, Kind] = {"bobs": Bob} if quick else {"bobs": Bob, "rods": Rod}
    cases = tuple(
        Case(name, n, Scene(title=f"chain of {name}: {n}", gravity=GRAVITY, pendulum=(_pendulum(kind, n),)))
        for name, kind in kinds.items()
        for n in range(1, 5 if quick else 6)
    )
    claim = "chaos increases with the number of links"
    return ChaosStudy("001", claim, cases, 15.0 if quick else 60.0, 24 if quick else 48)


def _pendulum(kind: Kind, links: int, copies: int = 1) -> Pendulum:
    return Pendulum(links=(kind(mass=1.0, length=1.0, count=links),), count=copies)


def _chain_table(finding: Finding) -> Table:
    rows = []
    for series, exponents in finding.series().items():
        for case, exponent in exponents:
            links, rate = exponent.scene.n_links, sqrt(GRAVITY)
            units = (1.0, rate, rate / sqrt(links))
            chaotic = f"{exponent.chaotic}/{exponent.ensemble}"
            rows.append([series, f"{case.at:g}", *(exponent.words(unit) for unit in units), chaotic])
    return ("chain of", "links", "λ (1/s), l = 1 m", "λ sqrt(l/g)", "λ sqrt(L/g)", "chaotic"), rows


def _chain_verdicts(finding: Finding) -> list[str]:
    words = []
    for series, exponents in finding.series().items():
        for name, power in (("links of one length", 0.0), ("one total length", 0.5)):
            values = [scale(exponent, exponent.scene.n_links**power) for _, exponent in exponents]
            steps = [compare_starts(lower, upper) for lower, upper in pairwise(values)]
            counts = f"of {len(steps)} steps to one link more λ grows in {steps.count(1)}, falls in {steps.count(-1)}"
            verdict = "not supported" if -1 in steps else "undecided" if 0 in steps else "supported"
            words.append(f"{series}, {name}: {verdict} ({counts}, within uncertainty in {steps.count(0)})")
    return words


# ----------------------------------------------------------------------------------------------- paper 000: on a cart


def _carts(quick: bool) -> ChaosStudy:
    masses = (None, PAPER_CART_MASS, 4.0) if quick else (None, 1000.0, PAPER_CART_MASS, 10.0, 4.0, 1.0)
    numbers = (1, 2) if quick else (1, 2, 3)
    cases = tuple(_cart_case(n, mass) for n in numbers for mass in masses)
    claim = "sharing a cart makes double pendula more predictable"
    return ChaosStudy("000", claim, cases, 15.0 if quick else 60.0, 24 if quick else 48)


def _cart_case(number: int, mass: float | None) -> Case:
    double = "1 double pendulum" if number == 1 else f"{number} double pendula"
    support = Fixed() if mass is None else Cart(mass=mass)
    place = "a fixed support" if mass is None else f"a cart of {mass:g} kg"
    pendulum = (_pendulum(Rod, 2, number),)
    return Case(double, mass, Scene(title=f"{double} on {place}", gravity=GRAVITY, support=support, pendulum=pendulum))


def _signs_of_change(finding: Finding) -> dict[str, list[int]]:
    """For every cart of a series −1 where λ is below that on the fixed support, 1 where it is above, else 0."""
    signs = {}
    for name, cases in finding.series().items():
        fixed_exponent = scale(next(exponent for case, exponent in cases if case.at is None), 1)
        signs[name] = [
            compare_starts(fixed_exponent, scale(exponent, 1)) for case, exponent in cases if case.at is not None
        ]
    return signs


def _cart_table(finding: Finding) -> Table:
    rows = []
    signs = _signs_of_change(finding)
    for name, cases in finding.series().items():
        words = iter([_TOLD[sign] for sign in signs[name]])
        for case, exponent in cases:
            place, how = ("fixed", "") if case.at is None else (f"{case.at:g} kg", next(words))
            rows.append([name, place, exponent.words(), f"{exponent.chaotic}/{exponent.ensemble}", how])
    return ("scene", "support", "λ (1/s)", "chaotic", "than on the fixed one"), rows


_TOLD = {-1: "more predictable", 1: "less predictable", 0: "no difference seen"}


def _cart_verdicts(finding: Finding) -> list[str]:
    words, at_paper_cart = [], []
    for name, signs in _signs_of_change(finding).items():
        verdict = "supported" if set(signs) == {-1} else "not supported" if 1 in signs else "undecided"
        counts = ", ".join(f"{word} with {signs.count(sign)}" for sign, word in _TOLD.items())
        words.append(f"{name}: {verdict} (of {len(signs)} carts {counts})")
        masses = [case.at for case, _ in finding.series()[name] if case.at is not None]
        at_paper_cart.append(f"{name} – {_TOLD[signs[masses.index(PAPER_CART_MASS)]]}")
    return [*words, f"the paper's cart of {PAPER_CART_MASS:g} kg: {'; '.join(at_paper_cart)}"]


_STUDIES = {"000": _carts, "001": _chains}
_TABLES = {"000": _cart_table, "001": _chain_table}
_VERDICTS = {"000": _cart_verdicts, "001": _chain_verdicts}
