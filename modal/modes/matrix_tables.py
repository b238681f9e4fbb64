"""M, K and D as text or JSON."""

from __future__ import annotations

from modal.assembly import Matrices
from modal.report import json_text
from modal.scene import Scene, describe
from modal.types import Floats


def matrices_table(scene: Scene, found: Matrices, form: str) -> str:
    """M, K and D of a scene; `form` is text or json."""
    named = {"M": found.M, "K": found.K, "D": found.D}
    if form == "json":
        whole = {
            "scene": describe(scene),
            "coordinates": list(found.labels),
            **{name: matrix.tolist() for name, matrix in named.items()},
        }
        return json_text(whole) + "\n"
    parts = [f"coordinates ({len(found.labels)}): {', '.join(found.labels)}"]
    for name, matrix in named.items():
        parts.append(f"{name} = 0" if not matrix.any() else f"{name} =\n{_grid(matrix)}")
    return "\n\n".join(parts) + "\n"


def _grid(matrix: Floats) -> str:
    cells = [[f"{value:.10g}" for value in row] for row in matrix]
    width = max(len(cell) for row in cells for cell in row)
    return "\n".join("  " + "  ".join(cell.rjust(width) for cell in row) for row in cells)
