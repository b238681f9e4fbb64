"""A record of how the modes of a scene were computed: problem sizes, avoided work, and packages loaded.

The sizes are reported by the sources of the modes, the packages are those that the process has loaded; nothing is
predicted. The report is a snapshot: packages loaded for other purposes count as well.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from modal.assembly import Rig
from modal.eigen import FreeMotions, ModalSpectrum, noun_count
from modal.modes.modes import Modes

PACKAGES = (
    *("numpy", "scipy", "sympy", "control", "matplotlib", "numba"),
    *("heyoka", "flint", "distributed", "pandas", "xarray"),
)


@dataclass(frozen=True)
class ProblemGroup:
    """Problems of one form: their number, `unknowns` in each, and the number of modes of the scene from them."""

    what: str
    route: str
    problems: int
    unknowns: int
    modes: int


@dataclass(frozen=True)
class Matrix:
    """A number of dense square matrices of one name and order."""

    name: str
    order: int
    number: int


@dataclass(frozen=True)
class SolutionReport:
    """A record of the computation of a scene's modes.

    `coordinates` counts those of the whole scene: every copy, both directions in space, the cart.  `left_out` are
    sentences, `modules` the larger packages that this process has loaded.
    """

    coordinates: int
    parts: tuple[ProblemGroup, ...]
    matrices: tuple[Matrix, ...]
    complex_problem: bool
    left_out: tuple[str, ...]
    modules: tuple[str, ...]

    @property
    def unknowns(self) -> int:
        """The number of unknowns in all parts together."""
        return sum(part.problems * part.unknowns for part in self.parts)

    def text(self) -> str:
        """The report for a terminal, in at most 25 lines."""
        unknowns = noun_count(self.unknowns, "unknown")
        coordinates = noun_count(self.coordinates, "coordinate")
        return "\n".join(
            [
                f"Built: {unknowns} for a scene of {coordinates}",
                f"{'unknowns':>12}  {'modes':>8}  {'route':<16}  of what",
                *_first((_row(part) for part in self.parts), indent=" " * 8),
                f"  matrices: {', '.join(_first(map(_size_words, self.matrices))) or 'none'}",
                f"  packages: {', '.join(self.modules)}",
                "Left out:",
                *(f"  {sentence}" for sentence in self.left_out),
                "",
            ]
        )

    def record(self) -> dict[str, Any]:
        """The report for JSON; all numbers are counts."""
        return {
            "coordinates": self.coordinates,
            "unknowns": self.unknowns,
            "parts": [dict(vars(part)) for part in self.parts],
            "matrices": [dict(vars(matrix)) for matrix in self.matrices],
            "complex_problem": self.complex_problem,
            "left_out": list(self.left_out),
            "modules": list(self.modules),
        }


def report_solution(modes: Modes) -> SolutionReport:
    """The record of the computation of these modes."""
    return SolutionReport(
        coordinates=coordinates(modes.rig),
        parts=_parts(modes.spectrum),
        matrices=_matrices(modes.spectrum),
        complex_problem=any(source.problem_size.is_complex for source in modes.spectrum.sources),
        left_out=(*_coordinates_left_out(modes.rig), *_solving_left_out(modes), *packages_not_loaded()),
        modules=loaded_packages(),
    )


def _parts(spectrum: ModalSpectrum) -> tuple[ProblemGroup, ...]:
    """One part for each source, equal ones merged."""
    mode_counts = Counter[int]()
    for part in (part for parts in spectrum.groups for part in parts):
        mode_counts[part.source] += part.copies
    totals: dict[tuple[str, str, int], tuple[int, int]] = {}
    for index, source in enumerate(spectrum.sources):
        size = source.problem_size
        kind = size.what, source.route, size.unknowns
        problems, modes = totals.get(kind, (0, 0))
        totals[kind] = problems + size.problems, modes + mode_counts[index]
    return tuple(
        ProblemGroup(what, route, problems, unknowns, modes)
        for (what, route, unknowns), (problems, modes) in totals.items()
    )


def _matrices(spectrum: ModalSpectrum) -> tuple[Matrix, ...]:
    """The matrices, the largest first, equal ones merged."""
    counts = Counter[tuple[str, int]]()
    for name, order, number in (matrix for source in spectrum.sources for matrix in source.problem_size.matrices):
        counts[name, order] += number
    return tuple(Matrix(name, order, counts[name, order]) for name, order in sorted(counts, key=lambda key: -key[1]))


def coordinates(rig: Rig) -> int:
    """Number of coordinates of the whole scene: every copy, both directions in space, the cart's or the structure's."""
    links = sum(int(block.count.sum()) * block.n for block in rig.blocks)
    return links * (2 if rig.spatial else 1) + rig.leading


def _coordinates_left_out(rig: Rig) -> Iterator[str]:
    if not rig.leading:
        yield "no cart coordinate: the support is fixed"
    if rig.spatial:
        yield (
            "no cart coordinate across the rail, where it cannot move"
            if rig.cart
            else "one vertical plane instead of two: about equilibrium both are equivalent"
        )
    pendula = sum(int(block.count.sum()) for block in rig.blocks)
    if pendula > rig.n_kinds:
        largest_count = max(int(block.count.max()) for block in rig.blocks)
        times = (
            f" with {largest_count if rig.n_kinds == 1 else f'up to {largest_count}'} times the masses"
            if rig.cart
            else ""
        )
        alike = "equal ones move alike" + ("   or hold the cart still" if rig.cart else "")
        yield f"{noun_count(rig.n_kinds, 'pendulum', 'pendula')}{times} instead of {pendula}: {alike}"


def _solving_left_out(modes: Modes) -> Iterator[str]:
    sources, size = modes.spectrum.sources, coordinates(modes.rig)
    sizes = [source.problem_size for source in sources]
    if modes.rig.cart and any(isinstance(source, FreeMotions) for source in sources):
        yield "no search for the free cart's own frequency: 0 exactly"
    why = "the scene's damping_ratio leaves the undamped shapes" if modes.is_classical else "nothing damps"
    if not any(route.is_complex for route in sizes):
        yield f"no complex eigenproblem: {why}"
    orders = [order for route in sizes for name, order, _ in route.matrices if name == "M"]
    if not orders:
        has_seeds = any(name == "seeds" for route in sizes for name, *_ in route.matrices)
        counts = "its counts confirm seeds" if has_seeds else "O(n) numbers"
        yield f"no M and K of {size} × {size}: frequencies come from the effective mass, {counts}"
    elif not any(name == "D" for route in sizes for name, *_ in route.matrices):
        yield f"no damping matrix: {why}"
    if orders and max(orders) < size:
        yield f"no M and K of {size} × {size}: {max(orders)} × {max(orders)} are the largest"


def loaded_packages() -> tuple[str, ...]:
    """The larger packages that this process has loaded."""
    return tuple(name for name in PACKAGES if sys.modules.get(name))


def packages_not_loaded() -> Iterator[str]:
    """A sentence on the packages not loaded."""
    missing = [name for name in PACKAGES if name not in loaded_packages()]
    if missing:
        yield f"not imported: {', '.join(missing)}"


def _row(part: ProblemGroup) -> str:
    unknowns = f"{part.problems} × {part.unknowns}" if part.problems > 1 else str(part.unknowns)
    purpose = "" if part.modes else ", for what is coupled below"
    return f"{unknowns:>12}  {part.modes:>8}  {part.route:<16}  {part.what}{purpose}"


def _size_words(matrix: Matrix) -> str:
    several = f"{matrix.number} × " if matrix.number > 1 else ""
    return f"{several}{matrix.name} {matrix.order}×{matrix.order}"


def _first(words: Iterable[str], indent: str = "", most: int = 6) -> list[str]:
    all_words = list(words)
    hidden = len(all_words) - most
    return all_words[:most] + ([f"{indent}and {hidden} more"] if hidden > 0 else [])
