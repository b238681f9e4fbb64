"""The sensitivities of natural frequencies to the numbers of a scene, by their places in its file.

A number of the file may belong to many links: copies of a pendulum, and a run of equal links.  All of them change with
it, so their derivatives add up.

On a structure they come from the derivatives of M, K and D (`modal.assembly.linearization`), of every number that these
depend on:

    ∂λ/∂p = −φᵀ (λ² ∂M/∂p + λ ∂D/∂p + ∂K/∂p) φ / φᵀ (2λ M + D) φ
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from modal.assembly import Arrays, differences, matrices
from modal.errors import ComputationError, SceneError
from modal.modes.mode import Mode
from modal.modes.modes import Modes
from modal.modes.sensitivity import Sensitivities, refuse, sensitivities
from modal.report import NOTHING, folded, grid, listed
from modal.scene import Body, Scene
from modal.scene.parameters import Place, number_at, with_numbers
from modal.scene.validation import Part
from modal.types import Floats

MOST_NUMBERS = 200_000
"""Derivatives beyond which a table is refused."""
HEAD = "Sensitivities (p/ω) ∂ω/∂p: the percentage by which a frequency changes where a number p grows by 1 %."

_WHY = "growing, damped by a damping_ratio, or shared by several modes"


class Sensitivity(NamedTuple):
    """A number p of the scene, ∂ω/∂p in rad/s per unit of p, and (p/ω) ∂ω/∂p; None where it is undefined."""

    number: float
    derivative: float
    relative: float | None

    def record(self) -> dict[str, float | None]:
        """The same for JSON."""
        return {"value": self.number, "d_omega": self.derivative, "relative": self.relative}


def of_mode(modes: Modes, row: Mode) -> dict[str, Sensitivity]:
    """The derivatives of one mode's frequency to a cart's mass and every number above 0, by place.

    Empty where it has none: for frequencies that several modes share, modes that grow or that a `damping_ratio` damps,
    and those beyond double precision.

    >>> from modal import load, natural_modes
    >>> modes = natural_modes(load("chain-1"))
    >>> {place: abs(round(one.relative, 9)) for place, one in of_mode(modes, modes[0]).items()}
    {'pendulum[0].links[0].mass': 0.0, 'pendulum[0].links[0].length': 0.5, 'gravity': 0.5}
    """
    try:
        if modes.rig.structure:
            return dict(_on_structure(modes, row.omega, modes.index_of(row)))
        return dict(_places(modes, row.omega, sensitivities(modes, modes.index_of(row))))
    except ComputationError:
        return {}


LINEARIZED = frozenset(
    {"gravity", "mass", "length", "centre", "inertia", "damping", "stiffness", "drag", "position", "links", "pendulum"}
    | {"support", "spring", "sway", "heave", "roll"}
)
"""Keys of numbers, and of what holds them, on which M, K and D depend."""
NOTHING_OF = 2.0**-40
"""Of the largest entry of a matrix: a change by a number as large as itself that is rounding."""


def _on_structure(modes: Modes, omega: float, number: int) -> Iterator[tuple[str, Sensitivity]]:
    """Those of every number above 0 that may change alone; a board that it would unbalance has none."""
    refuse(modes, number)
    value, phi = complex(modes.eigenvalue[number]), modes.column(modes.shape(number, 0, "mass"))
    dense = modes.matrices
    pencil = phi @ (2 * value * dense.M + dense.D) @ phi
    for place, (dM, dK, dD) in matrix_slopes(modes.scene).items():
        derivative = 0.0
        if value:
            slope = -(phi @ (value**2 * dM + value * dD + dK) @ phi) / pencil
            derivative = float((np.conj(value) * slope).real / abs(value))
        yield with_numbers(place), _sensitivity(number_at(modes.scene, place), derivative, omega)


@lru_cache(maxsize=2)
def matrix_slopes(scene: Scene) -> dict[Place, Arrays]:
    """∂M, ∂K and ∂D by every number but 0 of a scene on a structure, by its place."""
    by_path, matrices_here = {}, _matrices(scene)
    for place in _numbers(scene):
        try:
            slopes = differences(scene, place, 1.0, _matrices)
        except SceneError:
            continue
        size = abs(number_at(scene, place))
        if any(
            size * np.abs(slope).max() > NOTHING_OF * np.abs(S).max()
            for slope, S in zip(slopes, matrices_here, strict=True)
        ):
            by_path[place] = slopes
    return by_path


def _matrices(scene: Scene) -> Arrays:
    dense = matrices(scene)
    return dense.M, dense.K, dense.D


def _numbers(part: Any, at: Place = ()) -> Iterator[Place]:
    """The places of all numbers but 0 that M, K and D depend on."""
    if isinstance(part, Part):
        for name in part.fields:
            if name in LINEARIZED:
                yield from _numbers(getattr(part, name), (*at, name))
    elif isinstance(part, tuple):
        for index, item in enumerate(part):
            yield from _numbers(item, (*at, index))
    elif isinstance(part, float) and part:
        yield at


def _places(modes: Modes, omega: float, slopes: Sensitivities) -> Iterator[tuple[str, Sensitivity]]:
    scene, at = modes.scene, 0
    if (cart := scene.cart) is not None:
        yield "support.mass", _sensitivity(cart.mass, slopes.cart_mass, omega)
        yield from _one("support.damping", cart.damping, slopes.cart_damping, omega)
        yield from _one("support.stiffness", cart.stiffness, slopes.cart_stiffness, omega)
    for p, pendulum in enumerate(scene.pendulum):
        members = slice(at, at + pendulum.count * pendulum.n_links)
        at, first = members.stop, 0
        for i, link in enumerate(pendulum.links):
            run = slice(first, first + link.count)
            first = run.stop

            def whole(values: Floats, links: slice = members, run: slice = run, n: int = pendulum.n_links) -> float:
                return float(values[links].reshape(-1, n)[:, run].sum())

            name = f"pendulum[{p}].links[{i}]"
            yield from _one(f"{name}.mass", link.mass, whole(slopes.mass), omega)
            yield from _one(f"{name}.length", link.length, whole(slopes.length), omega)
            if isinstance(link, Body):
                yield from _one(f"{name}.centre", link.centre, whole(slopes.centre), omega)
                yield from _one(f"{name}.inertia", link.inertia, whole(slopes.inertia), omega)
            yield from _one(f"{name}.damping", link.damping, whole(slopes.damping), omega)
            yield from _one(f"{name}.stiffness", link.stiffness, whole(slopes.stiffness), omega)
            yield from _one(f"{name}.drag", link.drag, whole(slopes.drag), omega)
    yield from _one("gravity", scene.gravity, slopes.gravity, omega)


def _one(path: str, number: float, derivative: float, omega: float) -> Iterator[tuple[str, Sensitivity]]:
    if number:
        yield path, _sensitivity(number, derivative, omega)


def _sensitivity(number: float, derivative: float, omega: float) -> Sensitivity:
    return Sensitivity(number, derivative, number / omega * derivative if omega else None)


def sensitivity_table(modes: Modes, rows: Sequence[Mode], form: str) -> str:
    """A table of the relative sensitivities, a row for each number of the scene and a column for each mode.

    `form` is text, markdown, latex or html.  Raises ComputationError for too many.
    """
    size = len(rows) * 5 * sum(len(pendulum.links) for pendulum in modes.scene.pendulum)
    size *= modes.rig.leading if modes.rig.structure else 1
    if size > MOST_NUMBERS:
        raise ComputationError(f"{size} sensitivities are too many for a table: choose fewer modes")
    each = [of_mode(modes, row) for row in rows]
    places = list(dict.fromkeys(place for by_place in each for place in by_place))
    cells = [
        [
            place,
            *(
                _short(value) if value is not None else NOTHING
                for value in (_relative(by_place, place) for by_place in each)
            ),
        ]
        for place in places
    ]
    headings = ["number", *(f"mode {row.number}" for row in rows)]
    lacking = [f"{row.number}" for row, by_place in zip(rows, each, strict=True) if not by_place]
    which = f"mode{'s' * (len(lacking) > 1)} {listed(lacking, len(lacking))}"
    why = f"No single derivative: {which} ({_WHY})." if lacking else ""
    if form == "text":
        return "\n" + "\n\n".join(part for part in (folded(HEAD), grid(cells, headings), folded(why)) if part) + "\n"
    from tabulate import tabulate

    align = ["left", *["right"] * len(rows)]
    names = {"markdown": "github", "latex": "latex", "html": "html"}
    body = tabulate(cells, headings, tablefmt=names[form], colalign=align, disable_numparse=True) if cells else ""
    line, between = {"markdown": ("{}", "\n\n"), "latex": ("% {}", "\n"), "html": ("<p>{}</p>", "\n")}[form]
    parts = [line.format(HEAD), body, line.format(why) if why else ""]
    return between[1:] + between.join(filter(None, parts)) + "\n"


def _short(value: float) -> str:
    """Four decimals, zero without a sign."""
    return f"{round(value, 4) + 0.0:.4f}"


def _relative(by_place: dict[str, Sensitivity], place: str) -> float | None:
    return by_place[place].relative if place in by_place else None
