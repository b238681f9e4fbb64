"""What a run was computed with, and what its scene did not require: coordinates, matrices, packages.

The system of equations that ran is looked at, the process says which packages it has loaded; nothing is a forecast.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from modal.eigen import counted
from modal.errors import ComputationError
from modal.modes.solution_report import loaded, not_loaded
from nonlinear.dynamics import Dense, Reduced, Small
from nonlinear.integration import CLOSED, EXPLICIT, SCIPY, TRUNCATED, SolverInfo, Trajectory
from nonlinear.system import System

IMPLICIT = tuple(method for method in SCIPY if method not in EXPLICIT)


@dataclass(frozen=True)
class Inventory:
    """Coordinates of the whole scene and of what was integrated, numbers in y, dense matrices (order, how many).

    `coordinates` counts every copy, both directions in space, the cart.  `left_out` are sentences, `modules` the larger
    packages that this process has loaded.
    """

    coordinates: int
    integrated: int
    numbers: int
    matrices: tuple[tuple[int, int], ...]
    left_out: tuple[str, ...]
    modules: tuple[str, ...]

    def text(self) -> str:
        """For a terminal."""
        sizes = ", ".join((f"{number} × " if number > 1 else "") + f"{n}×{n}" for n, number in self.matrices)
        whole = counted(self.coordinates, "coordinate")
        return "\n".join(
            [
                f"Integrated: {counted(self.integrated, 'coordinate')}, {self.numbers} numbers, for a scene of {whole}",
                f"  matrices: {sizes or 'none'}",
                f"  packages: {', '.join(self.modules)}",
                "Left out:",
                *(f"  {sentence}" for sentence in self.left_out),
                "",
            ]
        )

    def record(self) -> dict[str, Any]:
        """For JSON; all numbers are counts."""
        return dict(vars(self)) | {"matrices": [{"order": n, "number": number} for n, number in self.matrices]}


def run_inventory(trajectory: Trajectory) -> Inventory:
    """Of a run made in this process; ComputationError for one that was read from a file."""
    system, equations = trajectory.system, trajectory.equations
    if trajectory.run.method == CLOSED:
        return Inventory(_freedom(system), 0, 0, (), ("no integration: the modes say it", *not_loaded()), loaded())
    if equations is None:
        raise ComputationError("what a saved run was computed with is not saved with it")
    inner: Any = equations.inner if isinstance(equations, Reduced) else equations
    form, numbers = trajectory.run.form, len(inner.scale)
    matrices = tuple(_matrices(inner, trajectory.run))
    integrated = (
        numbers // 2 if form == "maximal" else inner.shapes.shape[1] if form == TRUNCATED else _freedom(inner.system)
    )
    left_out = (*_coordinates(trajectory, inner), *_dense(integrated, matrices), *not_loaded())
    return Inventory(_freedom(system), integrated, numbers, matrices, left_out, loaded())


def _freedom(system: System) -> int:
    return system.n_links * (2 if system.spatial else 1) + (system.cart is not None)


def _matrices(inner: Any, run: SolverInfo) -> Iterator[tuple[int, int]]:
    """The dense matrices of one derivative, and an implicit integrator's own; series have none."""
    if run.method in IMPLICIT:
        yield len(inner.scale), 1
    if run.form == TRUNCATED:
        yield inner.shapes.shape[1], 1
    elif run.form == "maximal":
        if inner.saddle.is_dense:
            yield inner.saddle.size, 1
    elif isinstance(inner, Small) and run.method != "taylor":
        yield inner.layout.half, 1
    elif run.method != "taylor":
        for group, body in zip(inner.system.groups, getattr(inner, "bodies", ()), strict=False):
            if isinstance(body, Dense):
                yield group.n, group.index.shape[1]


def _coordinates(trajectory: Trajectory, inner: Any) -> Iterator[str]:
    run = trajectory.run
    if trajectory.system.cart is None:
        yield "no cart coordinate: the support is fixed"
    if run.reduced:
        yield f"all but {run.reduced}"
    if run.form == TRUNCATED:
        yield f"every mode but {inner.shapes.shape[1]} shapes"
    if run.form != "maximal":
        yield "no pivot forces: only maximal coordinates need them"
    if len(inner.scale) % 2 == 0:
        yield "no work: nothing damps or drives"


def _dense(integrated: int, matrices: tuple[tuple[int, int], ...]) -> Iterator[str]:
    largest = max((order for order, _ in matrices), default=0)
    if not largest:
        yield f"no matrix of {integrated} × {integrated}: O(n) steps along the chains"
    elif largest < integrated:
        yield f"no matrix of {integrated} × {integrated}: {largest} × {largest} are the largest"
