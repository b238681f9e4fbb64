"""What pendula hang from: a fixed support, a cart on the rail, or carriers that swing, tilt, heave and roll.

A carrier is a rigid body with the place and the angle (x, z, φ) of its origin, x along the rail, z down, φ positive as
angles of links are: its point (s, h), s along it and h below its origin as drawn, lies at

    (x + s cos φ + h sin φ,  z − s sin φ + h cos φ)

`position` is the origin as drawn.  Its own spring acts on the displacement from the drawn rest, where it carries the
weight; its damper acts to the ground.  Points of a "modal" support move by linear combinations of its coordinates.
Springs join points of supports, of links and of the ground.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import lru_cache
from io import BytesIO
from os import PathLike
from typing import Any, Literal

import numpy as np

from modal.errors import SceneError
from modal.scene.links import LOSS_ANGLE, Loss, is_lossy
from modal.scene.points import parse_point
from modal.scene.stored import Pair, Rows, RowsOfPoints, Several, SeveralOrNone
from modal.scene.validation import NON_NEGATIVE, POSITIVE, REAL, UNREAD, Part, after, field, list_of, one_of, optional
from modal.types import Floats

SYMMETRIC = 1e-10
"""How far from symmetric a matrix may be, of its largest entry; and how negative an eigenvalue of one without sign."""
MOST_COORDINATES, MOST_POINTS = 500, 10_000
Matrix = tuple[tuple[float, ...], ...]


@lru_cache(maxsize=16)
def matrix_problems(M: Matrix, K: Matrix, D: Matrix | None, points: tuple[Matrix, ...]) -> tuple[str, ...]:
    """What is wrong with M, K, D (d, d) and points (P, 2, d), each line beginning with its key."""
    return tuple(_matrix_problems(M, K, D, points))


def _matrix_problems(M: Matrix, K: Matrix, D: Matrix | None, points: tuple[Matrix, ...]) -> Iterator[str]:
    size = len(M)
    if not 0 < size <= MOST_COORDINATES:
        yield f".M: has {size} rows: from 1 to {MOST_COORDINATES} are possible"
        return
    square = [(name, matrix) for name, matrix in (("M", M), ("K", K), ("D", D)) if matrix is not None]
    wrong = [name for name, matrix in square if len(matrix) != size or any(len(row) != size for row in matrix)]
    yield from (f".{name}: must have {size} rows of {size} numbers, as M has rows" for name in wrong)
    if not 0 < len(points) <= MOST_POINTS:
        yield f".points: has {len(points)} points: from 1 to {MOST_POINTS} are possible"
    for k, point in enumerate(points):
        if len(point) != 2 or any(len(row) != size for row in point):
            yield f".points[{k}]: must be 2 lists of {size} numbers: displacements along and down"
            break
    if not wrong:
        yield from _sign_problems({name: np.array(matrix) for name, matrix in square})


def _sign_problems(matrices: Mapping[str, Floats]) -> Iterator[str]:
    """Matrices that are not symmetric, not positive definite, or not semidefinite."""
    skew = [
        name for name, matrix in matrices.items() if np.abs(matrix - matrix.T).max() > SYMMETRIC * np.abs(matrix).max()
    ]
    yield from (f".{name}: must be symmetric" for name in skew)
    if "M" in skew:
        return
    try:
        inverse = np.linalg.inv(np.linalg.cholesky(matrices["M"]))
    except np.linalg.LinAlgError:
        yield ".M: must be positive definite"
        return
    for name, matrix in matrices.items():
        if name != "M" and name not in skew:
            values = np.linalg.eigvalsh(inverse @ matrix @ inverse.T)
            if values[0] < -SYMMETRIC * max(values[-1], 0.0):
                yield f".{name}: must be positive semidefinite"


# ------------------------------------------------------------------------------------------------------- files

ARRAYS = ("M", "K", "D", "points")
LARGEST_FILE = 64_000_000
"""Bytes of all arrays of a file, unpacked."""
RANKS = {"M": 2, "K": 2, "D": 2, "points": 3}


def read_matrices(path: str | PathLike[str]) -> dict[str, Any]:
    """M, K, points and, where it is there, D of an NPZ file as NumPy writes it, as nested lists; others are ignored.

    Nothing is unpickled, and nothing unpacked before its size is known.  SceneError, with the file's name, for any
    other file.
    """
    from zipfile import ZipFile

    from modal.scene.sealed import content, members_of, reading

    with reading(path, "NPZ file of M, K and points"), ZipFile(BytesIO(content(path))) as zipped:
        arrays = members_of(zipped, ARRAYS, LARGEST_FILE)
        if missing := [name for name in ("M", "K", "points") if name not in arrays]:
            raise SceneError([f"has no array {', '.join(missing)}"])
        for name, matrix in arrays.items():
            if matrix.dtype.kind not in "fiu" or matrix.ndim != RANKS[name]:
                raise SceneError([f"{name}: must be an array of real numbers with {RANKS[name]} axes"])
        return {name: matrix.astype(float).tolist() for name, matrix in arrays.items()}


NAME = re.compile(r"[A-Za-z0-9_]+", re.ASCII)
PAIR = {"type": "tuple", "items_schema": [REAL, REAL]}
ROWS = list_of(list_of(REAL))


def _name(text: str) -> str:
    if text and not NAME.fullmatch(text):
        raise ValueError("must consist of letters, digits and _")
    return text


class Placed(Part):
    """What has a `name`, by which its points are called, and a `position` (along, below) of its origin (m)."""

    name: str = field(after(_name, {"type": "str", "max_length": 60}), default="")
    position: Pair[float] = field(PAIR, default=(0.0, 0.0))


class Fixed(Placed):
    """A support that does not move.

    >>> from modal import Bob, Fixed, Pendulum, Scene
    >>> scene = Scene(gravity=9.81, support=Fixed(), pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0)])])
    >>> scene.support == Scene(gravity=9.81, pendulum=scene.pendulum).support  # supports are fixed unless given
    True
    """

    kind: Literal["fixed"] = field(one_of("fixed"), default="fixed")


class Displaced(Part):
    """A start by a displacement (m) from rest and its rate (m/s)."""

    displacement: float = field(REAL, default=0.0)
    rate: float = field(REAL, default=0.0)


class Turned(Part):
    """A start by an angle (deg) from rest and its rate (deg/s)."""

    angle_deg: float = field(REAL, default=0.0)
    rate_deg: float = field(REAL, default=0.0)


class Cart(Placed):
    """A cart on the rail: mass (kg, may be 0), damper (N s/m) and spring (N/m) to the ground, and dry friction.

    Friction is either a force, `friction` (N), or `friction_coefficient` times the size of the rail's reaction: the
    rail holds the cart from above and below.

    >>> from modal import Bob, Cart, Pendulum, Scene, natural_frequencies
    >>> scene = Scene(gravity=9.0, support=Cart(mass=1.0), pendulum=[Pendulum(links=[Bob(mass=3.0, length=1.0)])])
    >>> [round(float(omega), 12) for omega in natural_frequencies([scene])[0]]  # 0 and √(g/l (1 + 3/1))
    [0.0, 6.0]
    """

    kind: Literal["cart"] = field(one_of("cart"), default="cart")
    mass: float = field(NON_NEGATIVE)
    damping: float = field(NON_NEGATIVE, default=0.0)
    stiffness: float = field(NON_NEGATIVE, default=0.0)
    friction: float = field(NON_NEGATIVE, default=0.0)
    friction_coefficient: float = field(NON_NEGATIVE, default=0.0)
    start: Displaced | None = field(optional(Displaced.schema()), default=None)

    @property
    def has_friction(self) -> bool:
        """Whether dry friction acts on the rail."""
        return self.friction > 0 or self.friction_coefficient > 0

    def problems(self) -> Iterator[str]:
        """Friction given twice."""
        if self.friction and self.friction_coefficient:
            yield f".friction_coefficient = {self.friction_coefficient!r}: cannot be combined with friction"


class Swing(Placed):
    """A platform on parallel rods of one `length` (m): it moves along an arc and does not turn.

    Its coordinate is the displacement along the arc (m); `stiffness` (N/m) and `damping` (N s/m) belong to it.

    >>> from modal import Bob, Cart, Pendulum, Scene, Swing, natural_frequencies
    >>> swing = Scene(
    ...     gravity=9.81, support=Swing(mass=2.0, length=0.5), pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0)])]
    ... )
    >>> cart = swing.replace(support=Cart(mass=2.0, stiffness=(2.0 + 1.0) * 9.81 / 0.5))  # the same for small motions
    >>> [[round(float(omega), 12) for omega in each] for each in natural_frequencies([swing, cart])]
    [[2.825590223186, 6.013405016348], [2.825590223186, 6.013405016348]]
    """

    kind: Literal["swing"] = field(one_of("swing"), default="swing")
    mass: float = field(POSITIVE)
    length: float = field(POSITIVE)
    damping: float = field(NON_NEGATIVE, default=0.0)
    stiffness: float = field(NON_NEGATIVE, default=0.0)
    start: Displaced | None = field(optional(Displaced.schema()), default=None)


class Tilt(Placed):
    """A board that turns about an axis, its origin: mass (kg), moment of inertia about its centre of mass (kg m²).

    `centre` is the centre of mass as drawn, (along, below) the axis (m).  Its coordinate is its angle (rad);
    `stiffness` is in N m/rad, `damping` in N m s/rad.

    >>> from modal import load
    >>> load("beam").support.centre  # above the axis
    (0.0, -0.3)
    """

    kind: Literal["tilt"] = field(one_of("tilt"), default="tilt")
    mass: float = field(POSITIVE)
    inertia: float = field(NON_NEGATIVE)
    centre: Pair[float] = field(PAIR, default=(0.0, 0.0))
    damping: float = field(NON_NEGATIVE, default=0.0)
    stiffness: float = field(NON_NEGATIVE, default=0.0)
    start: Turned | None = field(optional(Turned.schema()), default=None)

    def problems(self) -> Iterator[str]:
        """A board without a moment of inertia."""
        if self.inertia == 0 and self.centre == (0.0, 0.0):
            yield ".inertia = 0.0: must be positive for a board whose centre of mass is on the axis"


class Heave(Placed):
    """A support that moves up and down alone; its coordinate is the displacement upwards (m).

    >>> from modal import Bob, Heave, Pendulum, Scene, natural_frequencies
    >>> hung = Pendulum(links=[Bob(mass=1.0, length=1.0)])
    >>> scene = Scene(gravity=9.0, support=Heave(mass=3.0, stiffness=16.0), pendulum=[hung])
    >>> [round(float(omega), 12) for omega in natural_frequencies([scene])[0]]  # √(k/(M + m)) and √(g/l)
    [2.0, 3.0]
    """

    kind: Literal["heave"] = field(one_of("heave"), default="heave")
    mass: float = field(POSITIVE)
    damping: float = field(NON_NEGATIVE, default=0.0)
    stiffness: float = field(NON_NEGATIVE, default=0.0)
    start: Displaced | None = field(optional(Displaced.schema()), default=None)


class Planar(Part):
    """A number for each coordinate of a platform: N/m and N m/rad of springs, N s/m and N m s/rad of dampers."""

    sway: float = field(NON_NEGATIVE, default=0.0)
    heave: float = field(NON_NEGATIVE, default=0.0)
    roll: float = field(NON_NEGATIVE, default=0.0)


class Adrift(Part):
    """A start of a platform: displacements (m, deg) from rest and their rates (m/s, deg/s)."""

    sway: float = field(REAL, default=0.0)
    heave: float = field(REAL, default=0.0)
    roll_deg: float = field(REAL, default=0.0)
    sway_rate: float = field(REAL, default=0.0)
    heave_rate: float = field(REAL, default=0.0)
    roll_rate_deg: float = field(REAL, default=0.0)


class Platform(Placed):
    """A body that is free in sway (m, along the rail), heave (m, up) and roll (rad); numbers as those of `Tilt`.

    >>> from modal import load
    >>> load("ship-crane").support.stiffness.heave
    5000000.0
    """

    kind: Literal["platform"] = field(one_of("platform"), default="platform")
    mass: float = field(POSITIVE)
    inertia: float = field(POSITIVE)
    centre: Pair[float] = field(PAIR, default=(0.0, 0.0))
    damping: Planar = field(Planar.schema(), default=Planar())
    stiffness: Planar = field(Planar.schema(), default=Planar())
    start: Adrift | None = field(optional(Adrift.schema()), default=None)


class Combined(Part):
    """A start of a modal support: a value and a rate of each of its coordinates."""

    displacements: Several[float] = field(list_of(REAL))
    rates: SeveralOrNone[float] = field(optional(list_of(REAL)), default=None)


class ModalSupport(Placed):
    """A linear structure of d coordinates: mass matrix `M`, stiffness `K`, optional damping `D`, (d, d) each.

    `points` (P, 2, d) are the displacements along the rail and down of each of its points by each coordinate; a
    pendulum hangs `on = "NAME[3]"`.  An NPZ `file` with these arrays is read with the scene file that names it.

    >>> from modal import Bob, ModalSupport, Pendulum, Scene, natural_frequencies
    >>> frame = ModalSupport(M=[[3.0]], K=[[16.0]], points=[[[0.0], [1.0]]])  # one point, which moves down with η
    >>> hung = Pendulum(on="modal[0]", links=[Bob(mass=1.0, length=1.0)])
    >>> scene = Scene(gravity=9.0, support=frame, pendulum=[hung])
    >>> [round(float(omega), 12) for omega in natural_frequencies([scene])[0]]
    [2.0, 3.0]
    """

    kind: Literal["modal"] = field(one_of("modal"), default="modal")
    file: str | None = field(optional({"type": "str", "max_length": 4096}), default=None)
    M: Rows[float] = field(optional(ROWS), default=None)
    K: Rows[float] = field(optional(ROWS), default=None)
    D: Rows[float] = field(optional(ROWS), default=None)
    points: RowsOfPoints[float] = field(optional(list_of(ROWS)), default=None)
    start: Combined | None = field(optional(Combined.schema()), default=None)

    def problems(self) -> Iterator[str]:
        """A file that is not read, arrays that are missing or do not fit, a start that does not."""
        if self.file is not None:
            yield f".file: {UNREAD}"
            return
        if self.M is None or self.K is None or self.points is None:
            missing = [name for name in ("M", "K", "points") if getattr(self, name) is None]
            yield f"needs a file, or {', '.join(missing)}"
            return
        yield from matrix_problems(self.M, self.K, self.D, self.points)
        for name, values in self.start or ():
            if values is not None and len(values) != len(self.M):
                yield f".start.{name}: has {len(values)} values for {len(self.M)} coordinates"


Carrier = Cart | Swing | Tilt | Heave | Platform | ModalSupport
"""The supports that have coordinates of their own."""


def _end(text: str) -> str:
    parse_point(text)
    return text


END = after(_end, {"type": "str", "max_length": 200})


class Spring(Part):
    """A spring (N/m) and damper (N s/m) between two points (`modal.scene.points`), unstretched as drawn.

    With `kind = "torsion"` (N m/rad, N m s/rad) it acts between the angles of two links, or of a link and a carrier
    that turns, or the ground.  `loss` is the loss angle φ of the stiffness, k (1 + iφ).

    >>> from modal.scene import Spring
    >>> Spring(between=["pendulum[0].links[0]@0.5", "ground@1.0,0.5"], stiffness=5.0).kind
    'linear'
    """

    kind: Literal["linear", "torsion"] = field(one_of("linear", "torsion"), default="linear")
    between: Pair[str] = field({"type": "tuple", "items_schema": [END, END]})
    stiffness: float = field(NON_NEGATIVE, default=0.0)
    damping: float = field(NON_NEGATIVE, default=0.0)
    loss: Loss = field(LOSS_ANGLE, default=0.0)

    def problems(self) -> Iterator[str]:
        """The loss of no stiffness."""
        if is_lossy(self.loss) and not self.stiffness:
            yield ".loss: is that of the stiffness, which is 0: give a stiffness"
