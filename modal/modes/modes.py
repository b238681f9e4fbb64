"""The modes of a scene: their columns, their rows and their shapes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby
from math import isnan
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import NDArray

from modal.assembly import Rig
from modal.eigen import UNCERTAIN, Limits, SpectrumPart, notes
from modal.errors import SceneError
from modal.modes.eigenvalues import Eigenvalues, ShortChain, read_only
from modal.modes.mode import Mode
from modal.modes.rows import mode_rows, row_of
from modal.modes.shapes import Shape, expand, validate_normalisation
from modal.report import HTML_ROWS, TEXT_ROWS, Displayed, Summary, TextResult, counted, deferred, more, scrolled
from modal.scene import Scene, left_out, validate_scene
from modal.scene.doors import checked, require_type
from modal.types import NUMBERS_IN_CHUNK, Booleans, Floats, Ints

if TYPE_CHECKING:
    from os import PathLike

    from matplotlib.figure import Figure

    from modal.assembly import Matrices

GROWING = "Growing modes get nothing of the scene's damping_ratio, which belongs to modes that oscillate."
SELECTED = "Only some of the modes were computed, and resonances among these alone."
MOST_LISTED = 8
"""Format: the items of a list that a sentence names; … or a number stands for the rest."""
"""Numbers of a shape at once; angles of a pendulum, and different pendula, that a sentence names."""


@dataclass(frozen=True, eq=False, repr=False)
class Modes(TextResult, Eigenvalues, Sequence[Mode]):
    """All modes of a scene in ascending order of natural frequency, one entry for each distinct one.

    Columns are read-only arrays (R,).  Those that need no shape take no extra time: `number`, `eigenvalue`, `omega`,
    `frequency`, `period`, `damping_ratio`, `growth_rate`, `multiplicity`, `error` and `indistinct`.  The others, from
    `description` to `residual`, compute the row of every mode at their first use; indexing computes a `Mode`.

    >>> from modal import load, natural_modes
    >>> modes = natural_modes(load("paper-cart-2"))
    >>> len(modes), modes.multiplicity.tolist()
    (5, [1, 1, 1, 1, 1])
    >>> modes.frequency.round(4).tolist()
    [0.0, 0.4266, 0.4325, 1.1441, 1.1474]
    >>> round(float(modes.omega[1]), 8), modes[1].family
    (2.68011401, 'cart still: antiphase, slow')
    """

    internal = Displayed.internal | {
        *("every", "first", "hanging", "inertia", "limits", "natural", "on_cart", "place", "rig", "selected"),
        *("short", "spectrum", "units", "which"),
    }

    @overload
    def __getitem__(self, index: int) -> Mode: ...
    @overload
    def __getitem__(self, index: slice) -> list[Mode]: ...
    def __getitem__(self, index: int | slice) -> Mode | list[Mode]:
        if isinstance(index, slice):
            return list(self.rows(range(len(self))[index]))
        return next(self.rows([index]))

    def place(self, index: int) -> int:
        """Return an index from 0, also for negative ones; raise IndexError if there is no such mode."""
        try:
            return range(len(self))[index]
        except IndexError:
            of_number = f"; mode {index} of the table is modes[{index - 1}]" if index == len(self) else ""
            there = counted(len(self), "mode has the index 0", f"modes have indices 0 to {len(self) - 1}")
            words = f"there is no mode of index {index}: {there}{of_number}"
            raise IndexError(words) from None
        except TypeError:
            words = f"modes[{index!r}]: modes have indices from 0; columns are attributes, such as modes.omega"
            raise TypeError(words) from None

    def index_of(self, row: Mode) -> int:
        """The index of a row, from 0: its number counts all modes of the scene from 1, also where some were selected.

        >>> from modal import load, natural_modes
        >>> some = natural_modes(load("rope"), modes=slice(3, 6))
        >>> some[1].number, some.index_of(some[1])
        (5, 1)
        """
        return row.number - 1 - self.first

    def __iter__(self) -> Iterator[Mode]:
        return self.rows(range(len(self)))

    def rows(self, numbers: Sequence[int]) -> Iterator[Mode]:
        """The modes with these indices (from 0), computed together, a bounded amount of memory at a time."""
        size = max(1, NUMBERS_IN_CHUNK // max(1, sum(block.mass.size for block in self.rig.blocks)))
        places = [self.place(number) for number in numbers]
        for start in range(0, len(places), size):
            chunk = places[start : start + size]
            with np.errstate(all="ignore"):
                described_rows = dict(mode_rows(self, chunk))
            yield from (self._with_masses(number, described_rows[number]) for number in chunk)

    def _with_masses(self, index: int, mode: Mode) -> Mode:
        """The row with the effective masses of the mode without dampers, where dampers are light."""
        if not self.rig.is_damped or not isnan(mode.effective_mass):
            return mode
        with np.errstate(all="ignore"):
            masses = deferred("modal.modes.numbering:undamped_masses")(self)
        mass_along, mass_across = float(masses.along[index]), float(masses.across[index])
        return replace(
            mode,
            effective_mass=mass_along,
            effective_mass_share=mass_along / self.rig.total_mass,
            effective_mass_across=mass_across if isnan(mode.effective_mass_across) else mode.effective_mass_across,
        )

    # -------------------------------------------------------------------------------- columns that need the rows

    @cached_property
    def every(self) -> tuple[Mode, ...]:
        """The row of every mode."""
        return tuple(self)

    def _column(self, name: str) -> NDArray[Any]:
        return read_only(np.array([getattr(mode, name) for mode in self.every]))

    @cached_property
    def family(self) -> NDArray[np.str_]:
        """The description of the motion in words, (R,)."""
        return self._column("family")

    @property
    def description(self) -> NDArray[np.str_]:
        """The description of the motion in words, (R,): the `family`, under the heading of the table."""
        return self.family

    @cached_property
    def cart_participation(self) -> Floats:
        """The share of the cart's velocity just after a sudden push, (R,)."""
        return self._column("cart_participation")

    @cached_property
    def effective_mass(self) -> Floats:
        """Modal effective masses (R,) in kg along the rail; those without dampers if these are light, else NaN."""
        return self._column("effective_mass")

    @cached_property
    def effective_mass_share(self) -> Floats:
        """The same over the total mass of the scene, (R,)."""
        return self._column("effective_mass_share")

    @cached_property
    def effective_mass_across(self) -> Floats:
        """Modal effective masses (R,) in kg across the rail, in space."""
        return self._column("effective_mass_across")

    @cached_property
    def kappa(self) -> Floats:
        """κ (R,) in 1/rad² in ω(a) = ω(1 + κa²), a the largest angle; NaN if it is undefined."""
        return self._column("kappa")

    @cached_property
    def linear_to_1_percent_deg(self) -> Floats:
        """The largest angles (R,) in degrees at which ω is 1 % off."""
        return self._column("linear_to_1_percent_deg")

    @cached_property
    def resonances(self) -> NDArray[np.str_]:
        """The modes near 1:1, 1:2 or 1:3 that make this angle a guide, in words, (R,); "" if there are none."""
        return read_only(np.array(["; ".join(mode.resonances) for mode in self.every]))

    @cached_property
    def residual(self) -> Floats:
        """The misfits of frequency and shape, (R,), see `Mode`."""
        return self._column("residual")

    # ------------------------------------------------------------------------------------------- shapes and notes

    @cached_property
    def matrices(self) -> Matrices:
        """M, K and D of the scene along the rail; raises ComputationError if it is too large for dense matrices."""
        matrices: Matrices = deferred("modal.assembly:matrices_of")(self.rig)
        return matrices

    @cached_property
    def matrix(self) -> ModalMatrix:
        """The modal matrix Φ of all modes and copies, in the order of the table."""
        shapes = [(row, copy, shape) for row, part in enumerate(all_shapes(self)) for copy, shape in enumerate(part)]
        columns = np.array([self.column(shape) for *_, shape in shapes]).T
        row, copy = (np.array([place[part] for place in shapes], dtype=np.int64) for part in (0, 1))
        is_across = np.array([shape.across for *_, shape in shapes], dtype=bool)
        return ModalMatrix(columns, row, copy, is_across, self.matrices.M)

    def column(self, shape: Shape) -> NDArray[Any]:
        """A shape as one vector (n,): the cart or the structure, then every link in the order of the file."""
        return np.concatenate((shape.leading[: self.rig.leading], shape.angles))

    def shape(self, number: int, copy: int = 0, normalise: str = "angle") -> Shape:
        """The copy-th basis vector of the mode with index `number`, both from 0 (`Mode.number` counts from 1).

        `normalise` is "angle" (the largest angle is 1 rad; where there is none, the cart moves 1 m) or "mass"
        (φᵀMφ = 1).  The vectors of one row are orthogonal in M: equal pendula in antiphase are spanned by
        (1, −1, 0, …), (1, 1, −2, 0, …), … along the rail, then one pendulum at a time across it; different pendula
        of equal frequency as in `modal.eigen.coupled`.  The sign makes the first of the largest angles positive.
        If no digit of the frequency is certain, `Shape.uncertain` is set. Raise IndexError for a mode or copy that does
        not exist, ValueError for another normalisation.
        """
        how, index, number = validate_normalisation(normalise), copy, self.place(number)
        for part in self.spectrum.groups[number]:
            if 0 <= index < part.copies:
                details = self.spectrum.details(part.source, [part.row_of(index)])
                uncertain = bool(self.error[number] >= UNCERTAIN)
                return expand(self.rig, self.units, part, index, details, how, uncertain=uncertain)
            index -= part.copies
        raise IndexError(f"mode index {number} has {self.multiplicity[number]} basis vectors: there is no index {copy}")

    @cached_property
    def notes(self) -> tuple[str, ...]:
        """Omissions and approximations, with reasons."""
        with np.errstate(all="ignore"):
            of_routes = notes(self.spectrum.sources)
        grows = self.scene.has_modal_damping and bool(((self.eigenvalue.real > 0) & (self.eigenvalue.imag == 0)).any())
        remarks = (*equilibrium_words(self.rig), *left_out(self.scene))
        return *of_routes, *[GROWING] * grows, *remarks, *[SELECTED] * self.is_partial

    @cached_property
    def route(self) -> str:
        """The methods used, in words."""
        used = {part.source for parts in self.spectrum.groups for part in parts}
        return ", ".join(dict.fromkeys(self.spectrum.sources[source].route for source in sorted(used)))

    # ------------------------------------------------------------------------------------ tables, figures and films

    def table(self, form: str = "text", rows: Sequence[Mode] | None = None, **options: Any) -> str:
        """The table of all modes, or of some `rows`, as text, markdown, latex, csv, html or json, as `form` says.

        `options` are those of `modal.modes.tables.table`.

        >>> from modal import load, natural_modes
        >>> modes = natural_modes(load("paper-cart-2"))
        >>> print(modes.table("csv", modes[1:2])[:40])
        mode,omega_rad_per_s,frequency_hz,period
        """
        text: str = deferred("modal.modes.tables:table")(self, self.every if rows is None else rows, form, **options)
        return text

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """Every column of the table (R,) by its key in CSV and JSON, with its unit; NaN if there is no value.

        `pandas.DataFrame(modes.to_dict())` is the table.

        >>> from modal import load, natural_modes
        >>> natural_modes(load("chain-2")).to_dict()["frequency_hz"].round(4).tolist()
        [0.3815, 0.9211]
        """
        columns: dict[str, NDArray[Any]] = deferred("modal.modes.tables:table_of")(self)
        return columns

    def plot(self, numbers: Sequence[int] | None = None, **options: Any) -> Figure:
        """A matplotlib figure of the shapes of the modes with these indices (from 0), by default the first ones.

        `options` are those of `modal.plotting.shapes.shapes_figure`, and a `theme`, light or dark.

        >>> from modal import load, natural_modes
        >>> len(natural_modes(load("chain-3")).plot(amplitude_deg=15.0).axes)
        3
        """
        figure: Figure = deferred("modal.plotting.style:figure_at")(
            "modal.plotting.shapes:shapes_figure", self, _indices(numbers), **options
        )
        return figure

    def animate(self, path: str | PathLike[str], numbers: Sequence[int] | None = None, **options: Any) -> None:
        """Write a film of these modes (indices from 0) to a .gif, .mp4 or .html file, by default of the first ones.

        `options` are those of `modal.plotting.films.film_modes`.
        """
        deferred("modal.plotting.films:save_film")(self, path, _indices(numbers), **options)

    def _lines(self) -> list[str]:
        """The table of the first modes, and how many more there are."""
        lines = self.table("text", self[:TEXT_ROWS]).rstrip("\n").split("\n")
        hidden_rows = len(self) - TEXT_ROWS
        return [*lines[: lines.index("", 2)], f"… {hidden_rows} more"] if hidden_rows > 0 else lines

    def _repr_html_(self) -> str:
        head = self[:HTML_ROWS]
        return scrolled(self.table("html", head), more(len(self) - len(head)))


def _indices(numbers: Sequence[int] | None) -> Sequence[int] | None:
    """The same; raise SceneError for anything but a list of indices, or an empty one."""
    if numbers is not None and (np.ndim(numbers) != 1 or not np.size(numbers)):
        raise SceneError([f"{numbers!r:.40}: must be indices of modes from 0, such as [0, 1]"])
    return numbers


@checked
def natural_modes(scene: Scene, *, accuracy: float | None = None, modes: slice | None = None) -> Modes:
    """All modes of a scene about its equilibrium: hanging, inverted by `equilibrium`, or displaced by constant forces.

    Parameters
    ----------
    scene
        Any scene. The notes of the table name features that small angles ignore, such as dry friction.
    accuracy
        The largest relative error of ω that is allowed. Dense eigenvalues are used if they are known to be within it,
        which is faster for chains of more than twenty links; for shorter ones computing every digit is faster. None
        computes every digit that the data determine.
    modes
        The modes to compute, counted from 0: `slice(0, 3)` of a long chain costs little.  None computes all.

    Returns
    -------
    Modes
        One entry for each distinct frequency, in ascending order, with columns as arrays, shapes, a table and a figure.

    Raises
    ------
    SceneError
        Constant forces leave no equilibrium (`modal.assembly.equilibrium_of`).
    ComputationError
        Double precision or memory does not suffice.
    ValueError
        The accuracy is not positive, or the slice has a step.

    Notes
    -----
    Methods and their sources are given in the modules that `modal.eigen.spectrum` chooses from.

    Examples
    --------
    >>> from modal import load
    >>> [round(mode.frequency, 4) for mode in natural_modes(load("rope"), modes=slice(1, 4))]
    [1.3758, 2.1569, 2.939]
    """
    if modes is not None:
        require_type("modes", modes, "slice")
    limits = Limits(validate_accuracy(accuracy), _lowest(modes))
    if validate_scene(scene).feedback:
        closed_modes: Modes = deferred("modal.modes.closed:closed_modes")(scene, modes)
        return closed_modes
    if modes is None and (chain := ShortChain.of(scene)):
        return Modes(scene, short_chain=chain)
    solution = Modes(scene, limits, modes)
    _ = solution.spectrum  # raises here if it cannot be computed
    return solution


def equilibrium_words(rig: Rig) -> tuple[str, ...]:
    """Return the angles of an equilibrium displaced by constant forces in one sentence; none for any other.

    >>> from modal import load, natural_modes
    >>> from modal.scene import ConstantForce
    >>> wind = ConstantForce(on="pendulum[0].links[0]", amplitude=9.81)
    >>> equilibrium_words(natural_modes(load("chain-2").replace(force=(wind,))).rig)
    ('The equilibrium under the constant forces: 45.0°, 45.0°.',)
    """
    if not rig.leans:
        return ()
    sizes = [rig.blocks[block].n for block, _, copies in rig.members for _ in range(copies)]
    chain_angles = np.split(np.degrees(rig.rest_angles) + 0.0, np.cumsum(sizes)[:-1])
    words = []
    for angles in chain_angles:
        listed_angles = [f"{angle:.1f}°" for angle in angles[:MOST_LISTED].tolist()]
        words.append(", ".join(listed_angles + ["…"] * (len(angles) > MOST_LISTED)))
    runs = [(phrase, len(list(group))) for phrase, group in groupby(words)]
    phrases = [phrase if count == 1 else f"{phrase} ({count} times)" for phrase, count in runs[:MOST_LISTED]]
    phrases += ["…"] * (len(runs) > MOST_LISTED)
    cart = f"the cart at {rig.cart_rest:.4g} m, links at " if rig.cart_rest else ""
    return (f"The equilibrium under the constant forces: {cart}{'; '.join(phrases)}.",)


def validate_accuracy(accuracy: float | None) -> float:
    """Return the accuracy, 0 for every digit; raise ValueError for an invalid one."""
    if accuracy is not None and not 0 < accuracy < 1:
        raise ValueError(f"accuracy = {accuracy}: must be above 0 and below 1, or None for every digit")
    return accuracy or 0.0


def _lowest(modes: slice | None) -> int | None:
    """The number of lowest modes that a slice needs, None for all."""
    if modes is None:
        return None
    if modes.step not in {None, 1}:
        raise ValueError(f"modes = {modes}: a slice with a step is not supported")
    backwards = (modes.start or 0) < 0 or modes.stop is None or modes.stop < 0
    return None if backwards else int(modes.stop)


# --------------------------------------------------------------------------------------------- all shapes as one matrix


@dataclass(frozen=True, eq=False, repr=False)
class ModalMatrix(Displayed):
    """Φ (n, C): every shape as a column with φᵀMφ = 1, the cart (if there is one) first, then all links.

    `row` and `copy` (C,), both from 0, give the position of a shape in the table, `across` (C,) whether it moves across
    the rail, where M differs.
    """

    shapes: NDArray[Any]
    row: Ints
    copy: Ints
    across: Booleans
    M: Floats

    def _summary(self) -> Summary:
        size, count = self.shapes.shape
        kind = "complex" if np.iscomplexobj(self.shapes) else "real"
        return Summary(f"Modal matrix of {count} {kind} shapes over {size} coordinates, φᵀMφ = 1")

    @cached_property
    def dual(self) -> NDArray[Any]:
        """MΦ (n, C): for shapes without dampers (MΦ)ᵀq are the modal coordinates of a motion q."""
        return np.asarray(self.M @ self.shapes)

    @property
    def real(self) -> ModalMatrix:
        """The matrix of an undamped scene, whose shapes are real."""
        return replace(self, shapes=self.shapes.real)

    def take(self, columns: NDArray[Any]) -> ModalMatrix:
        """Some of the columns, by index or by a mask."""
        row, copy, across = (part[columns] for part in (self.row, self.copy, self.across))
        return ModalMatrix(self.shapes.T[columns].T, row, copy, across, self.M)


def all_shapes(modes: Eigenvalues) -> list[list[Shape]]:
    """`modes.shape(number, copy, "mass")` for every mode and copy."""
    groups, rows = modes.spectrum.groups, _rows(modes)
    details = {source: modes.spectrum.details(source, list(places)) for source, places in rows.items()}

    def shape(part: SpectrumPart, copy: int, uncertain: bool) -> Shape:
        row = row_of(details[part.source], rows[part.source][part.row_of(copy)])
        return expand(modes.rig, modes.units, part, copy, row, "mass", uncertain=uncertain)

    return [
        [shape(part, copy, bool(error >= UNCERTAIN)) for part in parts for copy in range(part.copies)]
        for parts, error in zip(groups, modes.error, strict=True)
    ]


def _rows(modes: Eigenvalues) -> dict[int, dict[int, int]]:
    """The required rows of every source, with their positions among these."""
    rows: dict[int, dict[int, int]] = {}
    for part in (part for parts in modes.spectrum.groups for part in parts):
        places = rows.setdefault(part.source, {})
        for copy in range(part.copies):
            places.setdefault(part.row_of(copy), len(places))
    return rows
