"""M, K and D about a scene's equilibrium as dense matrices: for printing, small problems and reference results.

    M = [[M_tot, σ_i b_i], [σ_i b_i, σ_i σ_j A_ij]],   K = diag(k_c, g σ_i b_i) + torsion springs,
    D = diag(c_c, 0) + joint dampers + Σ_k drag_k h_k h_kᵀ

over the coordinates x (on a cart) or η (of a structure, `modal.assembly.structure`), then the absolute angle of every
link from equilibrium, pendulum by pendulum, top to bottom; σ_i is 1 for a hanging link and −1 for an inverted one.  A
spring or damper at a joint acts on the difference of two neighbouring angles, the spring being relaxed at
equilibrium.  The row h_k is the displacement of the centre of link k along the rail, (1, σ_1 l_1, …, σ_{k−1} l_{k−1},
σ_k c_k); in space h_k without the cart describes the motion across it.  A scene's `damping_ratio` adds D_modal
(`modal.assembly.modal_damping`).

Under constant forces everything refers to the displaced equilibrium (`modal.assembly.equilibrium`): with its angles θ,
M_ij = A_ij cos(θ_i − θ_j) and M_0i = b_i cos θ_i, K has B_z cos θ + B_x sin θ in place of g σ b, and drag a second row
for the displacement downwards, with −sin θ in place of σ.

M, K and D, and other arrays of a scene, are polynomials of degree 2 at most in each of its numbers, so that a
difference quotient with a large step

    ∂f/∂p = (f(p + h) − f(p − h))/2h,     at p = 0 (4 f(h) − f(2h) − 3 f(0))/2h

is the derivative up to rounding. Lengths and positions of a structure turn its springs and change the paths of its
supports: there the quotient of eight values p ± h, …, p ± 4h has an error of h⁸ f⁽⁹⁾/630, below rounding for h = p/128.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from modal.assembly.arrays import Block, Rig, rig_of
from modal.assembly.modal_damping import modal_dampers
from modal.assembly.squares import Columns, SceneSquares, displacement_rows
from modal.assembly.structure import scene_squares
from modal.errors import ComputationError, SceneError
from modal.report import Displayed, Summary, aligned, as_json, breadth, brief, counted, deferred, fits, folded
from modal.scene import Scene, describe
from modal.scene.doors import checked, require_type
from modal.scene.parameters import Place, Variable, number_at, with_numbers
from modal.scene.signal_names import symbols_in
from modal.types import Floats

DENSE_COORDINATES_MAX = 4000
"""Limit: coordinates of dense M, K and D, of their dampers by modes and of derivatives by squares."""


@dataclass(frozen=True, eq=False, repr=False)
class Matrices(Displayed):
    """Symmetric M, K and D of one plane, with the name of each coordinate (units: m for x, rad for angles).

    >>> from modal import load, matrices
    >>> found = matrices(load("paper-cart-1"))
    >>> found.labels, found.M.shape, bool((found.M == found.M.T).all())
    (('x', 'theta[1,1]', 'theta[1,2]'), (3, 3), True)
    """

    M: Floats
    K: Floats
    D: Floats
    labels: tuple[str, ...]

    def _summary(self) -> Summary:
        rows = ([label, *map(brief, row)] for label, row in zip(self.labels, self.M, strict=True))
        title = f"M, K and D over {counted(len(self.labels), 'coordinate', 'coordinates')}"
        headings = ("M", *self.labels)
        facts = [("D", "0")] if not self.D.any() else []
        return Summary(title, facts, headings, rows, len(self.labels), words=frozenset({0}))


def matrices(scene: Scene) -> Matrices:
    """Return the mass, stiffness and damping matrix of a scene at small angles about its equilibrium.

    They are the matrices of M q'' + D q' + K q = 0 with q = (x, θ): the cart's position, or the coordinates of a
    structure, then the absolute angle of every link of every copy.

    Parameters
    ----------
    scene
        Any scene.  For a scene in space the matrices describe the motion along the rail; across it a cart is a fixed
        support.

    Returns
    -------
    Matrices
        `M`, `K` and `D`, (n, n), in SI units (kg, kg m and kg m² in M), with `labels` of the coordinates; symmetric,
        except K and D of a scene with feedback.

    Raises
    ------
    ComputationError
        The scene has more than `DENSE_COORDINATES_MAX` coordinates.
    SceneError
        Constant forces leave no equilibrium.

    Examples
    --------
    >>> from modal import Bob, Pendulum, Scene, matrices
    >>> double = matrices(Scene(gravity=9.0, pendulum=[Pendulum(links=[Bob(mass=1.0, length=2.0, count=2)])]))
    >>> double.M.tolist()  # m l² (2, 1; 1, 1)
    [[8.0, 4.0], [4.0, 4.0]]
    >>> double.K.tolist()  # m g l diag(2, 1)
    [[36.0, 0.0], [0.0, 18.0]]
    """
    linear = matrices_of(rig_of(scene))
    return deferred("modal.statespace.loops:close")(scene, linear) if scene.feedback else linear


def matrices_of(rig: Rig, squares: SceneSquares | None = None) -> Matrices:
    """Return M, K and D from a scene's arrays, or from its `squares` if they are known."""
    size = sum(rig.blocks[block].n * copies for block, _, copies in rig.members) + rig.leading
    if size > DENSE_COORDINATES_MAX:
        raise ComputationError(
            f"M, K and D would be dense {size} × {size} matrices: at most {DENSE_COORDINATES_MAX} coordinates are "
            "allowed"
        )
    M, K, D = (squares or scene_squares(rig)).matrices
    return Matrices(M, K, D + modal_dampers(rig) if rig.damping_ratio else D, coordinate_labels(rig))


def coordinate_labels(rig: Rig) -> tuple[str, ...]:
    """`x` or the names of a structure's coordinates, then `theta[pendulum,link]`, both from 1, copies separately."""
    links = [rig.blocks[block].n for block, _, copies in rig.members for _ in range(copies)]
    angles = [f"theta[{p},{i}]" for p, n in enumerate(links, 1) for i in range(1, n + 1)]
    return (*rig.support.names, *angles)


STEPS = (2.0**-2, 2.0**-6, 2.0**-12)
"""Relative steps, the first that the scene's own bounds allow."""
QUOTIENT_STEP = 2.0**-7
"""Tolerance: relative step at which truncation of order 8 and rounding over the step are alike."""
WEIGHTS = (4 / 5, -1 / 5, 4 / 105, -1 / 280)
"""Weights of the quotient of eight values [Fornberg1988, table 1]."""
BENDING = frozenset({"length", "position"})
"""Keys of numbers in which the matrices of a structure are no polynomials."""
Arrays = tuple[NDArray[Any], ...]


def differences(scene: Scene, place: Place, unit: float, arrays_of: Callable[[Scene], Arrays]) -> Arrays:
    """Return derivatives, by the number at a place, of arrays that are polynomials of degree at most 2 in it.

    On a structure they may be any smooth functions of lengths and positions. `unit` is the size of a step from 0. Raise
    SceneError if the scene allows no step to either side.
    """
    require_type("scene", scene, "Scene")
    path, value = with_numbers(place), number_at(scene, place)
    variable = Variable(scene, [path])

    def at(number: float) -> Arrays:
        return arrays_of(variable.at({path: number}))

    if scene.is_structured and not BENDING.isdisjoint(place):
        step = QUOTIENT_STEP * (abs(value) or unit)
        pairs = [(at(value + k * step), at(value - k * step)) for k in range(1, len(WEIGHTS) + 1)]
        parts = zip(*(zip(*pair, strict=True) for pair in pairs), strict=True)
        return tuple(
            sum(weight * (b - a) for weight, (b, a) in zip(WEIGHTS, part, strict=True)) / step for part in parts
        )
    if value == 0:
        none, once, twice = at(0.0), at(unit), at(2 * unit)
        return tuple((4 * b - c - 3 * a) / (2 * unit) for a, b, c in zip(none, once, twice, strict=True))
    for step in STEPS:
        low, high = value * (1 - step), value * (1 + step)
        try:
            return tuple((b - a) / (high - low) for a, b in zip(at(low), at(high), strict=True))
        except SceneError:
            continue
    raise SceneError([f"{path} = {value:g}: is at a bound, and has no derivative there"])


@checked
def shared_differences(
    scene: Scene, places: Sequence[Place], unit: float, arrays_of: Callable[[Scene], Arrays]
) -> Arrays:
    """Return derivatives by one number that these places share, or that is added to theirs: the sum over the places."""
    parts = [differences(scene, place, unit, arrays_of) for place in places]
    return tuple(sum(slopes[1:], slopes[0]) for slopes in zip(*parts, strict=True))


# -------------------------------------------------------------------------------------------------- as they are printed


def matrices_table(scene: Scene, dense: Matrices, form: str) -> str:
    """M, K and D of a scene; `form` is text or json."""
    by_name = {"M": dense.M, "K": dense.K, "D": dense.D}
    if form == "json":
        numbers = {name: matrix.tolist() for name, matrix in by_name.items()}
        return as_json({"scene": describe(scene), "coordinates": list(dense.labels), **numbers})
    labels = list(map(symbols_in, dense.labels))
    parts = [folded(f"coordinates ({len(labels)}): {', '.join(labels)}")]
    for name, matrix in by_name.items():
        parts.append(f"{name} = 0" if not matrix.any() else f"{name} =\n{_grid(matrix, labels)}")
    return "\n\n".join(parts) + "\n"


def _grid(matrix: Floats, labels: Sequence[str]) -> str:
    """The matrix, or where it is too wide parts of its columns below each other, under their coordinates."""
    cells = [[f"{value:.10g}" for value in row] for row in matrix]
    width = max(len(cell) for row in cells for cell in row)
    rows = ["  " + "  ".join(cell.rjust(width) for cell in row) for row in cells]
    if fits(breadth(rows[0])):
        return "\n".join(rows)
    rows_of_labels = [[name, *row] for name, row in zip(labels, cells, strict=True)]
    return aligned(rows_of_labels, ["", *labels], ["right"] * (1 + len(labels)))


# ---------------------------------------------------------------------------------------------- rows of displacements


def centres(block: Block, column: int, way: Floats | None = None) -> Floats:
    """Return the displacement of the centre of every link of a chain along the rail, by every angle, (n, n).

    A `way` is another direction: the motion (n, P) of the end of every link there, per length and angle.
    """
    moves = block.across if way is None else way
    arms, reach = (moves[:, [column]] * part[:, [column]] for part in (block.length, block.centre))
    return np.asarray(displacement_rows(arms, reach)[0])


def joints(block: Block, column: int) -> Floats:
    """Return the same for the lower joint of every link."""
    return centres(replace(block, centre=block.length), column)


def displacements(columns: Columns, first: int, of: Callable[[Block, int], Floats] | None = None) -> Floats:
    """Return the displacement along the rail of the point `of` every link, rows (links, first + links).

    The default is its centre. The `first` coordinates move everything alike.
    """
    n = sum(block.n for block, _ in columns)
    rows, at = np.zeros((n, first + n)), 0
    rows[:, :first] = 1.0
    for block, column in columns:
        rows[at : at + block.n, first + at : first + at + block.n] = (of or centres)(block, column)
        at += block.n
    return rows
