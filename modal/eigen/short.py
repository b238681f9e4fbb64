"""All frequencies of one short chain, in floats: for so few numbers arrays would cost more than the computation.

The method is that of `squares`: dense seeds, a Rayleigh quotient step at the pivot, and counts on either side of the
float at which they step, link by link with the arithmetic of `recursion` and `seeds`. If counts do not confirm that
float, there is no result, and the general method is used.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, nextafter
from operator import lt

import numpy as np

from modal import pair
from modal.assembly import CartNumbers
from modal.eigen.recursion import (
    NUDGE,
    count_in_floats,
    lever_masses,
    mass_and_energy_in_floats,
)
from modal.eigen.squares import PLACES_OF_SECOND_GUESS
from modal.types import Floats

Link = tuple[float, float, float, float]
Constants = tuple[float, float, float, float, float]
"""1/k, J, m s², m (1 − s)² and m of a link."""

LARGEST_LAST_STEP = 1e-5
"""Cost: relative step of a quotient beyond which the next, off by its square, does not yet justify counts."""


def short_squares(links: Sequence[Link], cart: CartNumbers | None) -> Floats | None:
    """ω² (R,) of the oscillatory modes, ascending, of a chain of links (mass, length, centre, inertia), with g = 1.

    The same floats as `squares_of`; None if counts confirm none near a seed, or two modes meet.
    """
    try:
        squares = _confirmed_squares(links, cart)
    except (ZeroDivisionError, np.linalg.LinAlgError):
        return None
    return np.array(squares) if squares and all(map(lt, squares, squares[1:])) else None


def _confirmed_squares(links: Sequence[Link], cart: CartNumbers | None) -> list[float]:
    """All ω², or none as soon as one is not confirmed; the fastest first, whose seeds have the fewest digits."""
    constants, seed_constants, mass_below = [], [], 0.0
    for m, length, c, inertia in reversed(links):
        link = pair.link_constants(m, length, c, inertia, mass_below)
        J, top_inertia, tip_inertia, cross = lever_masses(link, length, c, inertia)
        constants.append((1 / link.k, J, top_inertia, tip_inertia, m, cross, link.r, link.p, link.q))
        seed_constants.append((link.k, length, link.r + mass_below))
        mass_below += m
    count_constants = [constant[:5] for constant in constants]
    seeds = _seeds(seed_constants, mass_below, cart)
    if cart:
        mass, stiffness = cart.mass, cart.stiffness
        rail, spring, rigid_modes = mass, stiffness, int(stiffness == 0)
    else:  # the first link acts on the others as a cart and its spring on a whole chain
        mass, stiffness = constants.pop()[6], seed_constants[-1][0]
        rail, spring, rigid_modes = -inf, 0.0, 0
    squares: list[float] = []
    for j, seed in reversed([*enumerate(seeds, rigid_modes)]):
        x = seed
        for _ in range(3):
            mu, energy = mass_and_energy_in_floats(constants, x)
            imbalance = (mu + mass - stiffness / x) / (energy + mass)
            x *= 1.0 - imbalance
            if abs(imbalance) < LARGEST_LAST_STEP and (square := _step_of_count(count_constants, rail, spring, j, x)):
                squares.append(square)
                break
        else:
            return []
    return squares[::-1]


@np.errstate(all="ignore")
def _seeds(constants: list[tuple[float, float, float]], hanging: float, cart: CartNumbers | None) -> list[float]:
    """Approximate ω², ascending, as in `modal.eigen.seeds`, from k, l and r + Σ m below of each link, tip first."""
    k, length, diagonal = np.array(constants).T
    root, n = np.sqrt(k), len(constants)
    moment = root * length
    at = 1 if cart and cart.stiffness else 0
    matrix = np.empty((n + at, n + at))
    chain = matrix[at:, at:]
    np.divide(moment, root[:, None], out=chain)
    chain.flat[:: n + 1] = diagonal / k
    if cart:
        total = cart.mass + hanging
        if at:
            matrix[0, 0] = total / cart.stiffness
            matrix[1:, 0] = moment / cart.stiffness**0.5
        else:
            chain -= moment[:, None] * (moment / total)
    seeds: list[float] = (1.0 / np.linalg.eigvalsh(matrix)[::-1]).tolist()
    return seeds


def _step_of_count(
    links: list[Constants], mass: float, stiffness: float, index: int, x: float, nudge: float = 0.0
) -> float:
    """The float within PLACES_OF_SECOND_GUESS of x at which the count passes the number `index`, 0 without one.

    The count is that of a chain on a cart with a rigid translation; a `mass` of −∞ is a fixed support.
    """
    if not 0 < x < inf:
        return 0.0

    def is_past(trial: float) -> bool:
        number, mu = count_in_floats(links, trial, nudge)
        return number + (mu + mass > stiffness / trial) > index

    try:
        high, trial = is_past(x), x
        for _ in range(PLACES_OF_SECOND_GUESS):
            last, trial = trial, nextafter(trial, 0.0 if high else inf)
            if is_past(trial) != high:
                return last if high else trial
    except ZeroDivisionError:
        if nudge:
            raise
        return _step_of_count(links, mass, stiffness, index, x, NUDGE)
    return 0.0
