"""M, K and D about a scene's equilibrium as dense matrices: for printing, small problems and reference results.

    M = [[M_tot, σ_i b_i], [σ_i b_i, σ_i σ_j A_ij]],   K = diag(k_c, g σ_i b_i) + torsion springs,
    D = diag(c_c, 0) + joint dampers + Σ_k drag_k h_k h_kᵀ

over the coordinates x (on a cart) or η (of a structure, `modal.assembly.structure`), then the absolute angle of every
link from equilibrium, pendulum by pendulum, top to bottom; σ_i is 1 for a hanging link and −1 for an inverted one.  A
spring or damper at a joint acts on the difference of two neighbouring angles, the spring being relaxed at
equilibrium.  The row h_k is the displacement of the centre of link k along the rail, (1, σ_1 l_1, …, σ_{k−1} l_{k−1},
σ_k c_k); in space h_k without the cart describes the motion across it.  A scene's `damping_ratio` adds D_modal
(`modal.assembly.modal_damping`).

Under constant forces all of it is about the equilibrium that they move the links to (`modal.assembly.equilibrium`):
with its angles θ, M_ij = A_ij cos(θ_i − θ_j) and M_0i = b_i cos θ_i, K has B_z cos θ + B_x sin θ in place of g σ b, and
drag a second row for the displacement downwards, with −sin θ in place of σ.
"""

from __future__ import annotations

from dataclasses import dataclass

from modal.assembly.arrays import Rig, rig_of
from modal.assembly.modal_damping import modal_dampers
from modal.assembly.squares import SceneSquares
from modal.assembly.structure import scene_squares
from modal.errors import ComputationError
from modal.report import Displayed, Summary, brief, counted
from modal.scene import Scene
from modal.types import Floats

LARGEST_DENSE = 4000


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
    """Mass, stiffness and damping matrix of a scene at small angles about its equilibrium.

    They are those of M q'' + D q' + K q = 0 with q = (x, θ): the cart's place, or the coordinates of a structure, then
    the absolute angle of every link of every copy.

    Parameters
    ----------
    scene
        Any scene.  For a scene in space the matrices describe the motion along the rail; across it a cart is a fixed
        support.

    Returns
    -------
    Matrices
        `M`, `K` and `D`, (n, n) and symmetric, in SI units (kg, kg m and kg m² in M), with `labels` of the coordinates.

    Raises
    ------
    ComputationError
        The scene has more than `LARGEST_DENSE` coordinates.
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
    return matrices_of(rig_of(scene))


def matrices_of(rig: Rig, squares: SceneSquares | None = None) -> Matrices:
    """M, K and D from a scene's arrays, or from its `squares` where they are known."""
    size = sum(rig.blocks[block].n * copies for block, _, copies in rig.members) + rig.leading
    if size > LARGEST_DENSE:
        raise ComputationError(
            f"M, K and D would be dense {size} × {size} matrices: at most {LARGEST_DENSE} coordinates are allowed"
        )
    M, K, D = (squares or scene_squares(rig)).matrices
    return Matrices(M, K, D + modal_dampers(rig) if rig.damping_ratio else D, coordinate_labels(rig))


def coordinate_labels(rig: Rig) -> tuple[str, ...]:
    """`x` or the names of a structure's coordinates, then `theta[pendulum,link]`, both from 1, copies separately."""
    links = [rig.blocks[block].n for block, _, copies in rig.members for _ in range(copies)]
    angles = [f"theta[{p},{i}]" for p, n in enumerate(links, 1) for i in range(1, n + 1)]
    leading = rig.structure.names if rig.structure else ["x"] if rig.cart else []
    return (*leading, *angles)
