"""DOP853 [Hairer1993, §II.5] as data and as texts.

The coefficients are those of Hairer's `dop853.f`, rounded to doubles, and stand nowhere else; every loop over steps, in
floats, in lanes of NumPy, compiled, takes from here its sums over stages, its error and the length of its next step, so
that all of them take the same steps.  SciPy's method, a route of its own in the tests, has the same numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt
from typing import Any

import numpy as np

from modal.types import Floats

STAGES = 12
"""Format: evaluations of a step; the last is the first of the next."""
STEP_SAFETY = 0.9
"""Format: of the next length, by which errors are kept below the tolerance [Hairer1993, §II.5]."""
STEP_RATIO_MIN = 0.2
"""Format: the least of the length of the next step over that of this one, in SciPy."""
STEP_RATIO_MAX = 10.0
"""Format: the largest of the length of the next step over that of this one, in SciPy."""
ERROR_POWER = -1 / 8
"""Format: of the error over the tolerance in the next length, for an error of seventh order."""

Shares = Sequence[tuple[int, float]]

# fmt: off
ROWS: Sequence[Shares] = (
    (),
    ((0, 0.05260015195876773),),
    ((0, 0.0197250569845379), (1, 0.0591751709536137)),
    ((0, 0.02958758547680685), (2, 0.08876275643042054)),
    ((0, 0.2413651341592667), (2, -0.8845494793282861), (3, 0.924834003261792)),
    ((0, 0.037037037037037035), (3, 0.17082860872947386), (4, 0.12546768756682242)),
    ((0, 0.037109375), (3, 0.17025221101954405), (4, 0.06021653898045596), (5, -0.017578125)),
    (
        (0, 0.03709200011850479), (3, 0.17038392571223998), (4, 0.10726203044637328), (5, -0.015319437748624402),
        (6, 0.008273789163814023),
    ),
    (
        (0, 0.6241109587160757), (3, -3.3608926294469414), (4, -0.868219346841726), (5, 27.59209969944671),
        (6, 20.154067550477894), (7, -43.48988418106996),
    ),
    (
        (0, 0.47766253643826434), (3, -2.4881146199716677), (4, -0.590290826836843), (5, 21.230051448181193),
        (6, 15.279233632882423), (7, -33.28821096898486), (8, -0.020331201708508627),
    ),
    (
        (0, -0.9371424300859873), (3, 5.186372428844064), (4, 1.0914373489967295), (5, -8.149787010746927),
        (6, -18.52006565999696), (7, 22.739487099350505), (8, 2.4936055526796523), (9, -3.0467644718982196),
    ),
    (
        (0, 2.273310147516538), (3, -10.53449546673725), (4, -2.0008720582248625), (5, -17.9589318631188),
        (6, 27.94888452941996), (7, -2.8589982771350235), (8, -8.87285693353063), (9, 12.360567175794303),
        (10, 0.6433927460157636),
    ),
    (
        (0, 0.054293734116568765), (5, 4.450312892752409), (6, 1.8915178993145003), (7, -5.801203960010585),
        (8, 0.3111643669578199), (9, -0.1521609496625161), (10, 0.20136540080403034), (11, 0.04471061572777259),
    ),
)
"""Of the rates at earlier stages in y at every stage; the last is the end of the step."""
END = ROWS[STAGES]
FIFTH: Shares = (
    (0, 0.01312004499419488), (5, -1.2251564463762044), (6, -0.4957589496572502), (7, 1.6643771824549864),
    (8, -0.35032884874997366), (9, 0.3341791187130175), (10, 0.08192320648511571), (11, -0.022355307863886294),
)
THIRD: Shares = (
    (0, -0.18980075407240762), (5, 4.450312892752409), (6, 1.8915178993145003), (7, -5.801203960010585),
    (8, -0.4226823213237919), (9, -0.1521609496625161), (10, 0.20136540080403034), (11, 0.02265179219836082),
)
"""Of the rates at all stages in the end of the step, and in its errors of fifth and third order."""
MORE: Sequence[Shares] = (
    (
        (0, 0.056167502283047954), (6, 0.25350021021662483), (7, -0.2462390374708025), (8, -0.12419142326381637),
        (9, 0.15329179827876568), (10, 0.00820105229563469), (11, 0.007567897660545699), (12, -0.008298),
    ),
    (
        (0, 0.03183464816350214), (5, 0.028300909672366776), (6, 0.053541988307438566), (7, -0.05492374857139099),
        (10, -0.00010834732869724932), (11, 0.0003825710908356584), (12, -0.00034046500868740456),
        (13, 0.1413124436746325),
    ),
    (
        (0, -0.42889630158379194), (5, -4.697621415361164), (6, 7.683421196062599), (7, 4.06898981839711),
        (8, 0.3567271874552811), (12, -0.0013990241651590145), (13, 2.9475147891527724), (14, -9.15095847217987),
    ),
)
POWERS: Sequence[Shares] = (
    (
        (0, -8.428938276109013), (5, 0.5667149535193777), (6, -3.0689499459498917), (7, 2.38466765651207),
        (8, 2.117034582445028), (9, -0.871391583777973), (10, 2.2404374302607883), (11, 0.6315787787694688),
        (12, -0.08899033645133331), (13, 18.148505520854727), (14, -9.194632392478356), (15, -4.436036387594894),
    ),
    (
        (0, 10.427508642579134), (5, 242.28349177525817), (6, 165.20045171727028), (7, -374.5467547226902),
        (8, -22.113666853125306), (9, 7.733432668472264), (10, -30.674084731089398), (11, -9.332130526430229),
        (12, 15.697238121770845), (13, -31.139403219565178), (14, -9.35292435884448), (15, 35.81684148639408),
    ),
    (
        (0, 19.985053242002433), (5, -387.0373087493518), (6, -189.17813819516758), (7, 527.8081592054236),
        (8, -11.57390253995963), (9, 6.8812326946963), (10, -1.0006050966910838), (11, 0.7777137798053443),
        (12, -2.778205752353508), (13, -60.19669523126412), (14, 84.32040550667716), (15, 11.99229113618279),
    ),
    (
        (0, -25.69393346270375), (5, -154.18974869023643), (6, -231.5293791760455), (7, 357.6391179106141),
        (8, 93.40532418362432), (9, -37.45832313645163), (10, 104.0996495089623), (11, 29.8402934266605),
        (12, -43.53345659001114), (13, 96.32455395918828), (14, -39.17726167561544), (15, -149.72683625798564),
    ),
)
"""Of the rates at all stages in y at further ones, and of these as well in the last terms of the interpolant."""
EXTRA = len(MORE)
SUMS = (*ROWS, *MORE)
"""Those of y at every stage, further ones included."""
WEIGHTS = [np.array([dict(row).get(stage, 0.0) for stage in range(row[-1][0] + 1 if row else 0)]) for row in SUMS]
"""The same as arrays, with those that are 0."""
ERRORS = np.array([[dict(row).get(stage, 0.0) for stage in range(STAGES + 1)] for row in (FIFTH, THIRD)])
NODES: Sequence[float] = (
    0.0, 0.05260015195876773, 0.0789002279381516, 0.1183503419072274, 0.2816496580927726, 0.3333333333333333,
    0.25, 0.3076923076923077, 0.6512820512820513, 0.6, 0.8571428571428571, 1.0, 1.0, 0.1, 0.2,
    0.7777777777777778,
)
# fmt: on
"""The part of a step at each stage, the end of the step, and the further stages."""
SEEN = (6, 8, 10)
"""Stages at which y may be sampled within a step: ascending in time."""
LOOKS = (0.0, *(NODES[stage] for stage in SEEN), 1.0)
"""The parts of a step at which switches are examined."""


def weighted_sum(shares: Shares, name: str) -> str:
    """The text of a sum over stages, whose rates have this name with the number of the stage in place of {}."""
    return " + ".join(f"{share!r} * {name.format(stage)}" for stage, share in shares)


def sum_stages(shares: Shares, stages: Floats, total: Floats, work: Floats) -> None:
    """A sum over stages into `total`; `work` is an array like it."""
    (stage, share), *others = shares
    np.multiply(stages[stage], share, out=total)
    for stage, share in others:
        np.multiply(stages[stage], share, out=work)
        total += work


def advance(stage: int, start: Floats, length: Floats, stages: Floats, y: Floats, work: Floats) -> None:
    """The y at a stage, also a further one, from that `start` and the rates at stages before, in place.

    Sums over columns next to motions, arrays (size, S, 1 + k), are products of BLAS: rounded otherwise, and faster.
    """
    if y.ndim < 3:
        sum_stages(SUMS[stage], stages, y, work)
    else:
        weights = WEIGHTS[stage]
        np.dot(weights, stages.reshape(len(stages), -1)[: len(weights)], out=y.reshape(-1))
    y *= length
    y += start


def gain_at(part: Any, terms: Sequence[Any]) -> Any:
    """The increment of y at a part of the step, from the `terms` of the interpolant."""
    gain = 0.0 * terms[0]
    for number in range(len(terms)):
        gain = (gain + terms[-1 - number]) * (1 - part if number % 2 else part)
    return gain


def terms_of(length: Any, displacement: Any, stages: Any) -> list[Any]:
    """The terms of the interpolant, from the `displacement` of y and the rates at all stages and further ones."""
    powers = (sum(share * stages[stage] for stage, share in shares) for shares in POWERS)
    return [
        *cubic_terms(displacement, length * stages[0], length * stages[STAGES]),
        *(length * power for power in powers),
    ]


def cubic_terms(displacement: Any, first: Any, last: Any) -> tuple[Any, Any, Any]:
    """The first three terms, of a cubic: from the increment of y, and its rates at both ends times the step."""
    return displacement, first - displacement, 2 * displacement - last - first


_EACH = np.eye(STAGES + 1 + EXTRA)
TERMS = np.array(terms_of(1.0, sum(share * _EACH[stage] for stage, share in END), _EACH))
"""The terms of the interpolant of a step of length 1 from the rates at all stages and further ones, (7, 16)."""


def within_shares(part: Floats) -> Floats:
    """The weights of the rates at all stages in the increment of y at parts (...) of a step of length 1, (..., 16)."""
    factors = np.empty((len(TERMS), part.size))
    factors[0] = row = part.ravel()
    for number in range(1, len(TERMS)):
        np.multiply(factors[number - 1], 1 - row if number % 2 else row, out=factors[number])
    return np.asarray((factors.T @ TERMS).reshape(*part.shape, -1))


def control_step(fifth: float, third: float, length: float, size: float, is_retry: bool) -> tuple[float, float]:
    """The error over the tolerance, and the length of the next step over this one.

    `fifth` and `third` are sums over `size` components of the squares of errors over their tolerances; after a step
    that was refused, an `is_retry`, none is longer.  `nonlinear.integration.loops` has the same with three roots for
    the power.
    """
    total = fifth + 0.01 * third
    error = length * fifth / sqrt(total * size) if total else 0.0
    if error < 1.0:
        grown = min(STEP_RATIO_MAX, STEP_SAFETY * error**ERROR_POWER) if error else STEP_RATIO_MAX
        return error, min(1.0, grown) if is_retry else grown
    return error, max(STEP_RATIO_MIN, STEP_SAFETY * error**ERROR_POWER) if error < np.inf else STEP_RATIO_MIN


def control_steps(fifth: Floats, third: Floats, length: Floats, size: int, is_retry: Any) -> tuple[Floats, Floats]:
    """The same as `control_step` of many steps at once."""
    total = fifth + 0.01 * third
    with np.errstate(invalid="ignore", divide="ignore"):
        error = np.where(total == 0, 0.0, length * fifth / np.sqrt(total * size))
        factor = np.clip(STEP_SAFETY * error**ERROR_POWER, STEP_RATIO_MIN, STEP_RATIO_MAX)
    limit = np.where((error < 1) & ~is_retry, STEP_RATIO_MAX, 1.0)
    return error, np.where(np.isfinite(factor), np.minimum(factor, limit), STEP_RATIO_MIN)
