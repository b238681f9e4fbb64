"""Supports of pendula: a fixed support, a cart on the rail, or bodies that swing, tilt, heave and roll.

A support is a rigid body with the position and the angle (x, z, φ) of its origin, x along the rail, z down, φ positive
as angles of links are: its point (s, h), s along it and h below its origin as drawn, lies at

    (x + s cos φ + h sin φ,  z − s sin φ + h cos φ)

`position` is the origin as drawn. Its own spring acts on the displacement from the drawn equilibrium, where it carries
the weight; its damper acts to the ground. Points of a "modal" support move by linear combinations of its coordinates.
Springs join points of supports, of links and of the ground.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import lru_cache
from io import BytesIO
from os import PathLike
from typing import Any, ClassVar, Literal

import numpy as np

from modal.errors import SceneError
from modal.extend import Support, SupportCoordinate
from modal.scene.carriers import CartMotion, HeaveMotion, PlatformMotion, SwingMotion, TiltMotion
from modal.scene.contents import FILE_BYTES_MAX
from modal.scene.links import LOSS_ANGLE, Loss, is_lossy
from modal.scene.points import point_text
from modal.scene.stored import Pair, Rows, RowsOfPoints, Several, SeveralOrNone
from modal.scene.validation import (
    FILE_NAME,
    NON_NEGATIVE,
    POSITIVE,
    REAL,
    REALS,
    REALS_OR_NONE,
    UNREAD,
    Part,
    field,
    function_after,
    list_of,
    one_of,
    optional,
    text,
)
from modal.types import Floats

ASYMMETRY_MAX = 1e-10
"""Tolerance: of a matrix, of its largest entry, as of files of ten digits; and how negative an eigenvalue may be."""
SUPPORT_COORDINATES_MAX = 500
"""Limit: coordinates of a support that is given by matrices; more are refused."""
SUPPORT_POINTS_MAX = 10_000
"""Limit: points of a support that is given by matrices; more are refused."""
Matrix = tuple[tuple[float, ...], ...]


@lru_cache(maxsize=16)
def matrix_problems(M: Matrix, K: Matrix, D: Matrix | None, points: tuple[Matrix, ...]) -> tuple[str, ...]:
    """Return what is wrong with M, K, D (d, d) and points (P, 2, d), each line beginning with its key."""
    return tuple(_matrix_problems(M, K, D, points))


def _matrix_problems(M: Matrix, K: Matrix, D: Matrix | None, points: tuple[Matrix, ...]) -> Iterator[str]:
    size = len(M)
    if not 0 < size <= SUPPORT_COORDINATES_MAX:
        yield f".M: has {size} rows: from 1 to {SUPPORT_COORDINATES_MAX} are possible"
        return
    square = [(name, matrix) for name, matrix in (("M", M), ("K", K), ("D", D)) if matrix is not None]
    wrong = [name for name, matrix in square if len(matrix) != size or any(len(row) != size for row in matrix)]
    yield from (f".{name}: must have {size} rows of {size} numbers, as M has rows" for name in wrong)
    if not 0 < len(points) <= SUPPORT_POINTS_MAX:
        yield f".points: has {len(points)} points: from 1 to {SUPPORT_POINTS_MAX} are possible"
    for k, point in enumerate(points):
        if len(point) != 2 or any(len(row) != size for row in point):
            yield f".points[{k}]: must be 2 lists of {size} numbers: displacements along and down"
            break
    if not wrong:
        yield from _sign_problems({name: np.array(matrix) for name, matrix in square})


def _sign_problems(matrices: Mapping[str, Floats]) -> Iterator[str]:
    """Matrices that are not symmetric, not positive definite, or not semidefinite."""
    skew = [
        name
        for name, matrix in matrices.items()
        if np.abs(matrix - matrix.T).max() > ASYMMETRY_MAX * np.abs(matrix).max()
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
            if values[0] < -ASYMMETRY_MAX * max(values[-1], 0.0):
                yield f".{name}: must be positive semidefinite"


# ------------------------------------------------------------------------------------------------------- files

ARRAYS = ("M", "K", "D", "points")
RANKS = {"M": 2, "K": 2, "D": 2, "points": 3}


def read_matrices(path: str | PathLike[str]) -> dict[str, Any]:
    """Return M, K, points and, if present, D of an NPZ file written by NumPy, as nested lists; others are ignored.

    Nothing is unpickled, and nothing unpacked before its size is known.  SceneError, with the file's name, for any
    other file.
    """
    from zipfile import ZipFile

    from modal.scene.sealed import content, members_of, reading

    with reading(path, "NPZ file of M, K and points"), ZipFile(BytesIO(content(path))) as zip_file:
        arrays = members_of(zip_file, ARRAYS, FILE_BYTES_MAX)
        if missing := [name for name in ("M", "K", "points") if name not in arrays]:
            raise SceneError([f"has no array {', '.join(missing)}"])
        for name, matrix in arrays.items():
            if matrix.dtype.kind not in "fiu" or matrix.ndim != RANKS[name]:
                raise SceneError([f"{name}: must be an array of real numbers with {RANKS[name]} axes"])
        return {name: matrix.astype(float).tolist() for name, matrix in arrays.items()}


NAME = re.compile(r"[A-Za-z0-9_]+", re.ASCII)
PAIR = {"type": "tuple", "items_schema": [REAL, REAL]}
ROWS = list_of(REALS)


def _name(text: str) -> str:
    if text and not NAME.fullmatch(text):
        raise ValueError("must consist of letters, digits and _")
    return text


class Placed(Part):
    """A support with a `name` for its points, and the `position` (along, below) of its origin (m)."""

    name: str = field(function_after(_name, text(60)), "by which it is called, required among several", default="")
    position: Pair[float] = field(PAIR, "of its origin as drawn: along the rail and down", "m", default=(0.0, 0.0))


class Fixed(Placed):
    """A support that does not move.

    >>> from modal import Bob, Fixed, Pendulum, Scene
    >>> scene = Scene(gravity=9.81, support=Fixed(), pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0)])])
    >>> scene.support == Scene(gravity=9.81, pendulum=scene.pendulum).support  # supports are fixed unless given
    True
    """

    kind: Literal["fixed"] = field(one_of("fixed"), default="fixed")


class Displaced(Part):
    """A start by a displacement from rest and its rate."""

    displacement: float = field(REAL, "at the start", "m", default=0.0)
    rate: float = field(REAL, "at the start", "m/s", default=0.0)


class Turned(Part):
    """A start by an angle from rest and its rate."""

    angle_deg: float = field(REAL, "at the start", "°", default=0.0)
    rate_deg: float = field(REAL, "at the start", "°/s", default=0.0)


class Cart(Placed):
    """A cart on the rail.

    Dry friction is either a force, `friction` (N), or `friction_coefficient` times the magnitude of the normal force:
    the rail guides the cart from above and below.

    >>> from modal import Bob, Cart, Pendulum, Scene, natural_frequencies
    >>> scene = Scene(gravity=9.0, support=Cart(mass=1.0), pendulum=[Pendulum(links=[Bob(mass=3.0, length=1.0)])])
    >>> [round(float(omega), 12) for omega in natural_frequencies([scene])[0]]  # 0 and √(g/l (1 + 3/1))
    [0.0, 6.0]
    """

    path: ClassVar[Support] = CartMotion()
    kind: Literal["cart"] = field(one_of("cart"), default="cart")
    mass: float = field(NON_NEGATIVE, "may be 0", "kg")
    damping: float = field(NON_NEGATIVE, "damper to the ground", "N s/m", default=0.0)
    stiffness: float = field(NON_NEGATIVE, "spring to the ground", "N/m", default=0.0)
    friction: float = field(NON_NEGATIVE, "dry friction on the rail", "N", default=0.0)
    friction_coefficient: float = field(NON_NEGATIVE, "as a share of the rail's reaction", default=0.0)
    start: Displaced | None = field(optional(Displaced.schema()), "of a simulation", default=None)

    @property
    def has_friction(self) -> bool:
        """Whether dry friction acts on the rail."""
        return self.friction > 0 or self.friction_coefficient > 0

    def problems(self) -> Iterator[str]:
        """Friction given twice."""
        if self.friction and self.friction_coefficient:
            yield f".friction_coefficient = {self.friction_coefficient!r}: cannot be combined with friction"


class Swing(Placed):
    """A platform on parallel rods: it moves along an arc and does not turn; its coordinate is that displacement (m).

    >>> from modal import Bob, Cart, Pendulum, Scene, Swing, natural_frequencies
    >>> swing = Scene(
    ...     gravity=9.81, support=Swing(mass=2.0, length=0.5), pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0)])]
    ... )
    >>> cart = swing.replace(support=Cart(mass=2.0, stiffness=(2.0 + 1.0) * 9.81 / 0.5))  # the same for small motions
    >>> [[round(float(omega), 12) for omega in each] for each in natural_frequencies([swing, cart])]
    [[2.825590223186, 6.013405016348], [2.825590223186, 6.013405016348]]
    """

    path: ClassVar[Support] = SwingMotion()
    kind: Literal["swing"] = field(one_of("swing"), default="swing")
    mass: float = field(POSITIVE, "positive", "kg")
    length: float = field(POSITIVE, "of its rods", "m")
    damping: float = field(NON_NEGATIVE, "damper to the ground", "N s/m", default=0.0)
    stiffness: float = field(NON_NEGATIVE, "spring to the ground", "N/m", default=0.0)
    start: Displaced | None = field(optional(Displaced.schema()), "of a simulation", default=None)


class Tilt(Placed):
    """A board that turns about an axis, its origin; its coordinate is its angle (rad).

    >>> from modal import load
    >>> load("beam").support.centre  # above the axis
    (0.0, -0.3)
    """

    path: ClassVar[Support] = TiltMotion()
    kind: Literal["tilt"] = field(one_of("tilt"), default="tilt")
    mass: float = field(POSITIVE, "positive", "kg")
    inertia: float = field(NON_NEGATIVE, "moment of inertia about the centre of mass", "kg m²")
    centre: Pair[float] = field(PAIR, "of mass: along and below the origin, as drawn", "m", default=(0.0, 0.0))
    damping: float = field(NON_NEGATIVE, "damper to the ground", "N m s/rad", default=0.0)
    stiffness: float = field(NON_NEGATIVE, "spring to the ground", "N m/rad", default=0.0)
    start: Turned | None = field(optional(Turned.schema()), "of a simulation", default=None)

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

    path: ClassVar[Support] = HeaveMotion()
    kind: Literal["heave"] = field(one_of("heave"), default="heave")
    mass: float = field(POSITIVE, "positive", "kg")
    damping: float = field(NON_NEGATIVE, "damper to the ground", "N s/m", default=0.0)
    stiffness: float = field(NON_NEGATIVE, "spring to the ground", "N/m", default=0.0)
    start: Displaced | None = field(optional(Displaced.schema()), "of a simulation", default=None)


class Planar(Part):
    """Springs or dampers of a platform, one for each coordinate."""

    sway: float = field(NON_NEGATIVE, "along the rail", "N/m or N s/m", default=0.0)
    heave: float = field(NON_NEGATIVE, "up and down", "N/m or N s/m", default=0.0)
    roll: float = field(NON_NEGATIVE, "turning", "N m/rad or N m s/rad", default=0.0)


class Adrift(Part):
    """A start of a platform: displacements from rest and their rates."""

    sway: float = field(REAL, "along the rail", "m", default=0.0)
    heave: float = field(REAL, "upwards", "m", default=0.0)
    roll_deg: float = field(REAL, "turned as angles of links are", "°", default=0.0)
    sway_rate: float = field(REAL, "along the rail", "m/s", default=0.0)
    heave_rate: float = field(REAL, "upwards", "m/s", default=0.0)
    roll_rate_deg: float = field(REAL, "turning", "°/s", default=0.0)


class Platform(Placed):
    """A body that is free in sway (m, along the rail), heave (m, up) and roll (rad); numbers as those of `Tilt`.

    >>> from modal import load
    >>> load("ship-crane").support.stiffness.heave
    5000000.0
    """

    path: ClassVar[Support] = PlatformMotion()
    kind: Literal["platform"] = field(one_of("platform"), default="platform")
    mass: float = field(POSITIVE, "positive", "kg")
    inertia: float = field(POSITIVE, "moment of inertia about the centre of mass", "kg m²")
    centre: Pair[float] = field(PAIR, "of mass: along and below the origin, as drawn", "m", default=(0.0, 0.0))
    damping: Planar = field(Planar.schema(), "dampers to the ground", default=Planar())
    stiffness: Planar = field(Planar.schema(), "springs to the ground", default=Planar())
    start: Adrift | None = field(optional(Adrift.schema()), "of a simulation", default=None)


class Combined(Part):
    """A start of a modal support: a value and a rate of each of its coordinates."""

    displacements: Several[float] = field(REALS, "one for each coordinate")
    rates: SeveralOrNone[float] = field(REALS_OR_NONE, "one for each coordinate, all 0 unless given", default=None)


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
    file: str | None = field(FILE_NAME, "name of an NPZ file with M, K, points and perhaps D", default=None)
    M: Rows[float] = field(optional(ROWS), "mass matrix (d, d)", "SI", default=None)
    K: Rows[float] = field(optional(ROWS), "stiffness matrix (d, d)", "SI", default=None)
    D: Rows[float] = field(optional(ROWS), "damping matrix (d, d), 0 unless given", "SI", default=None)
    points: RowsOfPoints[float] = field(
        optional(list_of(ROWS)), "(P, 2, d), along and down, by coordinate", default=None
    )
    start: Combined | None = field(optional(Combined.schema()), "of a simulation", default=None)

    def problems(self) -> Iterator[str]:
        """A file that was not read, arrays that are missing or inconsistent, a start that does not fit."""
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


def law_values(law: float | Part) -> tuple[float, ...]:
    """Return the stiffness or the damping of each coordinate of a support."""
    return tuple(value for _, value in law) if isinstance(law, Part) else (law,)


def start_keys(coordinate: SupportCoordinate) -> tuple[str, str]:
    """Return the keys of a start for a coordinate and its rate, such as `sway` and `sway_rate`."""
    ending, alone = ("_deg", "angle") if coordinate.unit == "rad" else ("", "displacement")
    way = coordinate.way
    return f"{way or alone}{ending}", f"{way}_rate{ending}" if way else f"rate{ending}"


Carrier = Cart | Swing | Tilt | Heave | Platform | ModalSupport
"""The supports that have coordinates of their own."""


END = function_after(point_text, text(200))


class Spring(Part):
    """A spring and a damper between two points (`modal.scene.points`), unstretched as drawn.

    With `kind = "torsion"` it acts between the angles of two links, or of a link and a support that turns, or the
    ground. `loss` is φ of the stiffness k (1 + iφ).

    >>> from modal.scene import Spring
    >>> Spring(between=["pendulum[0].links[0]@0.5", "ground@1.0,0.5"], stiffness=5.0).kind
    'linear'
    """

    kind: Literal["linear", "torsion"] = field(
        one_of("linear", "torsion"), "between points or angles", default="linear"
    )
    between: Pair[str] = field({"type": "tuple", "items_schema": [END, END]}, "two points, or the ground")
    stiffness: float = field(NON_NEGATIVE, "unstretched as drawn", "N/m, of torsion N m/rad", default=0.0)
    damping: float = field(NON_NEGATIVE, "damper in parallel", "N s/m, of torsion N m s/rad", default=0.0)
    loss: Loss = field(LOSS_ANGLE, "loss angle of the stiffness, or a table", "rad", default=0.0)

    def problems(self) -> Iterator[str]:
        """A loss without a stiffness."""
        if is_lossy(self.loss) and not self.stiffness:
            yield ".loss: is that of the stiffness, which is 0: give a stiffness"
