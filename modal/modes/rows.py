"""The rows of the table of modes: sums over the parts of each mode, its description and its resonances.

The description says in words whether the support moves, the phases of the pendula, and the order within the chain.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import fields, replace
from itertools import groupby
from math import isfinite, nan, radians
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from modal.assembly import Block, Rig
from modal.eigen import (
    LIGHT,
    UNCERTAIN,
    Details,
    ModeSwing,
    SpectrumPart,
    distortion,
    largest_angle,
    one_percent_amplitude,
)
from modal.errors import ComputationError
from modal.modes.eigenvalues import Eigenvalues
from modal.modes.mode import (
    DISTANCE_OF_DOUBT,
    DOUBT_ELSEWHERE,
    MOST_REFINED,
    PROMISED_ERROR,
    Mode,
    answering,
    is_guide,
    resonances,
)
from modal.modes.shapes import by_kind, displacements, expand, first_of_largest, is_balanced
from modal.report import deferred, listed
from modal.structure import Structure, coordinate_units
from modal.types import Floats, Ints

SHARE_OF_MOTION_MIN = 0.01
"""Tolerance: share of the largest energy, or weight of a coordinate, from which on a motion has a word of its own."""
STRUCTURE_STILL, FREE = "supports at rest", "free"
UNNAMED = {"tilt": "board", "heave": "support", "modal": "structure"}
ALIKE = {"cart": "carts", "swing": "swings"}
COUNTED = ("", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")
FIXED, CART_STILL = "fixed support", "cart still"
BEYOND_DOUBLE = "beyond double precision"


class _RowPart(NamedTuple):
    """A part of a row and its place in the details of its source."""

    part: SpectrumPart
    details: Details
    at: int

    def effective_mass(self, rig: Rig) -> float:
        """Effective mass along the rail; shapes that hold a cart still or move across the rail contribute nothing.

        Combinations of pendula in different places that hold a structure still may push it.
        """
        holds_still = is_balanced(rig, self.part) and not (rig.structure and self.part.kind is None)
        return 0.0 if holds_still or not self.part.along_count else self._effective_mass() * self.part.along_count

    def effective_mass_across(self) -> float:
        """Effective mass across the rail."""
        return self._effective_mass() * self.part.across_count if self.part.across_count else 0.0

    def _effective_mass(self) -> float:
        return float(self.details.effective_mass[self.at])

    @property
    def energy(self) -> Floats:
        """The share (P,) of each kind of pendulum in the kinetic energy."""
        return np.concatenate([share[:, :, self.at].sum(0) for share in self.details.shares])

    @property
    def first_angles(self) -> NDArray[np.inexact]:
        """The angles (P,) of the first links of each kind."""
        return np.concatenate([angle[0, :, self.at] for angle in self.details.angles])


def family(*, where: str, folds: dict[str, int], motion: str, ratio: float) -> str:
    """Return the description of one distinct frequency.

    `where` describes the motion of the support; `folds` counts the shapes of each kind ("" needs no word), `motion`
    comes from `motion_words`, `ratio` is −Re λ/|λ|.
    """
    total = sum(folds.values())
    named_sorts = [(sort, count) for sort, count in folds.items() if count and sort]
    several = len([count for count in folds.values() if count]) > 1
    sorts = (
        [", ".join(f"{sort} {count}" for sort, count in named_sorts)] if several else [sort for sort, _ in named_sorts]
    )
    fate = "unstable" if ratio < -1e-12 else "overdamped" if ratio >= 1.0 else ""
    words = ", ".join(word for word in (*sorts, motion, fate) if word)
    where += f" ({total} degenerate modes)" if total > 1 else ""
    return f"{where}: {words}" if words else where


def motion_words(head: _RowPart, agreement: str) -> str:
    """The given `agreement` of pendula, and the order of the most energetic one's links."""
    shares, busiest = head.details.shares, int(head.energy.argmax())
    sizes = np.cumsum([share.shape[1] for share in shares])
    block = int(np.searchsorted(sizes, busiest, side="right"))
    column = busiest - int(sizes[block]) + shares[block].shape[1]
    chain = _in_phase_with_largest(head.details.angles[block][:, column, head.at])
    return ", ".join(word for word in (agreement, _order(chain)) if word)


def agreement(head: _RowPart, names: list[str], *, several: bool, is_still: bool) -> str:
    """The phase agreement of the top links of all pendula with a fair share of the energy.

    `names` are those of all P kinds; `several` says that one column represents several pendula moving alike, `is_still`
    that the cart does not move.
    """
    top, energy = head.first_angles, head.energy
    if len(top) == 1:
        return "in phase" if several else ""
    busy = energy >= SHARE_OF_MOTION_MIN * energy.max()
    if busy.sum() == 1:
        return f"mostly {names[int(energy.argmax())]}"
    signs = np.sign(_in_phase_with_largest(top[busy]))
    if np.all(signs > 0) or np.all(signs < 0):
        return "in phase"
    return "antiphase" if is_still else "mixed phases"


def _order(chain: NDArray[np.float64]) -> str:
    """Slow and fast for two links; else the number of neighbouring links that move in opposite directions."""
    if len(chain) == 1:
        return ""
    signs = np.sign(chain[chain != 0])
    reversals = int(np.sum(signs[1:] != signs[:-1]))
    if len(chain) == 2:
        return "fast" if reversals else "slow"
    if reversals in (0, len(chain) - 1):
        return "fastest (adjacent links in antiphase)" if reversals else "slowest (all links in phase)"
    return f"{reversals} node{'s' * (reversals > 1)}"


def _in_phase_with_largest(values: NDArray[np.inexact]) -> NDArray[np.float64]:
    largest = values[np.abs(values).argmax()]
    in_phase = values * (np.conj(largest) / abs(largest)) if largest != 0 else values
    real_part: NDArray[np.float64] = in_phase.real
    return real_part


def moving_words(structure: Structure, eta: NDArray[np.inexact], inertia: NDArray[np.float64]) -> str:
    """Return the moving parts of a structure, by its coordinates (d,): two carts in antiphase, board tilts."""
    weight = np.abs(eta) * np.sqrt(inertia)
    moving_coordinates = np.flatnonzero(weight >= SHARE_OF_MOTION_MIN * weight.max()).tolist()
    owners = [int(np.searchsorted(structure.offsets, k, side="right")) - 1 for k in moving_coordinates]
    kinds = {structure.carriers[owner].kind for owner in owners}
    number = len(moving_coordinates)
    if number > 1 and len(kinds) == 1 and (kind := kinds.pop()) in ALIKE:
        signs = np.sign(_in_phase_with_largest(eta[moving_coordinates]))
        phase = "in phase" if (signs > 0).all() else "in antiphase" if number == 2 else "in mixed phases"
        is_all = number == sum(carrier.kind == kind for carrier in structure.carriers)
        if not is_all and number <= 3:
            return f"{listed([_carrier_name(structure, owner) for owner in owners], number)} {phase}"
        return f"{COUNTED[number] if number < len(COUNTED) else number} {ALIKE[kind]} {phase}"
    verbs_of: dict[int, list[str]] = {}
    for k, owner in zip(moving_coordinates, owners, strict=True):
        verb = structure.carriers[owner].verb(k - structure.offsets[owner])
        if verb not in verbs_of.setdefault(owner, []):
            verbs_of[owner].append(verb)
    if len(verbs_of) > 3:
        return f"{number} coordinates move"
    return ", ".join(
        f"{_carrier_name(structure, owner)} {listed(verbs, len(verbs))}" for owner, verbs in verbs_of.items()
    )


def following(head: _RowPart, pivots: Sequence[NDArray[np.inexact]], *, several: bool) -> str:
    """Whether all pendula with a fair share of the energy swing with their pivots (P,) or against; "" for neither.

    `several` says that one column represents several pendula moving alike.
    """
    energy, top = head.energy, head.first_angles
    signs = np.sign((top * np.conj(np.concatenate(pivots))).real)[energy >= SHARE_OF_MOTION_MIN * energy.max()]
    if not (signs > 0).all() and not (signs < 0).all():
        return ""
    pendula = "pendula" if several or len(top) > 1 else "pendulum"
    return f"{pendula} in phase with the support" if signs[0] > 0 else f"{pendula} in antiphase with the support"


def _carrier_name(structure: Structure, owner: int) -> str:
    carrier = structure.carriers[owner]
    return UNNAMED.get(carrier.kind, carrier.name) if carrier.name == carrier.kind else carrier.name


def _head(pieces: list[_RowPart]) -> _RowPart:
    """The piece that moves most of the scene."""
    return next((piece for piece in pieces if not piece.part.is_still), pieces[0])


def mode_rows(modes: Eigenvalues, numbers: Sequence[int]) -> Iterator[tuple[int, Mode]]:
    """The rows of the modes with these indices (from 0), each with its index, in this order."""
    expands = modes.is_expanded  # where `_expanded` finds the resonances
    resonances_of = {n: () if expands else _resonances(modes, n) for n in numbers}
    partners_of = {
        n: [] if resonances_of[n] or expands else answering(modes.omega, n, _partners(modes, n)) for n in numbers
    }
    pieces = _pieces(modes, sorted({*numbers, *(k for pairs in partners_of.values() for _, k in pairs)}))
    for n in numbers:
        mode = _mode(modes, n, pieces[n])
        if expands:
            yield n, _expanded(modes, mode, _head(pieces[n]).part) if pieces[n] else mode
            continue
        answers = (
            _answers(modes, n, partners_of[n], pieces)
            if isfinite(mode.kappa) and mode.kappa and not resonances_of[n]
            else []
        )
        yield n, replace(mode, resonances=(*resonances_of[n], *answers) if isfinite(mode.kappa) else ())


def _expanded(modes: Eigenvalues, mode: Mode, part: SpectrumPart) -> Mode:
    """A mode with κ and its angle of 1 % by the expansion of its motion, and a star where that converges slowly.

    Of several shapes of one frequency it is that of the first, with a star: they differ, and exchange energy.
    """
    unknown, rig = replace(mode, kappa=nan, linear_to_1_percent_deg=nan), modes.rig
    if modes.not_expanded or mode.is_uncertain or not mode.omega or abs(mode.damping_ratio) >= LIGHT:
        return unknown
    if modes.scene.n_links + rig.leading > MOST_REFINED:
        return mode
    details = modes.spectrum.details(part.source, [part.row])
    shape = expand(rig, modes.units, part, 0, details, "angle", uncertain=False)
    phi = np.concatenate([shape.leading[: rig.leading], shape.angles])
    if not shape.angles.any() or np.abs(phi.imag).max() >= LIGHT * np.abs(phi.real).max():
        return unknown
    expansion = modes.finite_motion.expand(phi.real, mode.omega, is_single=mode.multiplicity == 1)
    several = f"1:1 among its own {mode.multiplicity} shapes"
    near = several if mode.multiplicity > 1 else modes.resonance_near(mode, expansion.harmonic)
    return replace(
        mode,
        kappa=expansion.kappa,
        linear_to_1_percent_deg=expansion.one_percent_deg,
        resonances=() if expansion.converges else (near,),
    )


def _pieces(modes: Eigenvalues, numbers: Sequence[int]) -> dict[int, list[_RowPart]]:
    entries = sorted(
        ((part, n) for n in numbers for part in modes.spectrum.groups[n]),
        key=lambda entry: (entry[0].source, entry[0].row),
    )
    pieces: dict[int, list[_RowPart]] = {n: [] for n in numbers}
    for source, members in groupby(entries, key=lambda entry: entry[0].source):
        numbers_of = list(members)
        for (part, n), place in zip(
            numbers_of, _details(modes, source, [part.row for part, _ in numbers_of]), strict=True
        ):
            pieces[n] += [_RowPart(part, *place)] if place else []
    return pieces


def _details(modes: Eigenvalues, source: int, rows: list[int]) -> list[tuple[Details, int] | None]:
    """The details of each row of a source and its place in them; None if double precision does not suffice."""
    try:
        details = modes.spectrum.details(source, rows)
    except ComputationError:
        return [None] if len(rows) == 1 else [_details(modes, source, [row])[0] for row in rows]
    return [(details, at) for at in range(len(rows))]


def _mode(modes: Eigenvalues, number: int, pieces: list[_RowPart]) -> Mode:
    """One row: sums over its pieces, and the shape of the one that moves most of the scene."""
    ratio, unit = float(modes.damping_ratio[number]), modes.units.mass
    known: dict[str, Any] = {
        "number": modes.first + number + 1,
        "omega": float(modes.omega[number]),
        "damping_ratio": ratio,
        "multiplicity": int(modes.multiplicity[number]),
        "resonances": (),
        "relative_error_bound": float(modes.error[number]),
        "indistinct": bool(modes.indistinct[number]),
    }
    if not pieces:
        unknown: dict[str, Any] = dict.fromkeys((field.name for field in fields(Mode)), np.nan)
        return Mode(**{**unknown, **known, "family": f"its shape is {BEYOND_DOUBLE}"})
    head = _head(pieces)
    certain = 1.0 if modes.error[number] < UNCERTAIN else np.nan
    effective = certain * unit * sum(piece.effective_mass(modes.rig) for piece in pieces)
    is_simple = certain == 1 and modes.multiplicity[number] == 1 and not modes.rig.is_damped
    is_refinable = isfinite(effective) and modes.scene.n_links + modes.rig.leading <= MOST_REFINED
    if is_simple and is_refinable and modes.rig.structure:
        effective = _left_of(modes, number, head, effective)
    light = (not modes.is_classical or ratio < LIGHT) and "law" not in modes.scene.features
    kappa = certain * float(head.details.kappa[head.at]) if light else np.nan
    return Mode(
        **known,
        family=_family(modes, number, head, ratio),
        cart_participation=certain * float(sum(p.details.participation[p.at] for p in pieces)),
        effective_mass=effective,
        effective_mass_share=effective / modes.rig.total_mass,
        effective_mass_across=certain * unit * sum(piece.effective_mass_across() for piece in pieces),
        kappa=kappa,
        linear_to_1_percent_deg=one_percent_amplitude(kappa),
        residual=float(max(p.details.residual[p.at] for p in pieces)),
    )


def _left_of(modes: Eigenvalues, number: int, head: _RowPart, effective: float) -> float:
    """The effective mass (kg) of a simple mode, from more digits where terms of its momentum cancel."""
    shape = expand(modes.rig, modes.units, head.part, 0, row_of(head.details, head.at), "mass", uncertain=False)
    if shape.across:
        return effective
    phi = np.concatenate((shape.leading[: modes.rig.leading], shape.angles)).astype(np.complex128)
    momentum: float | None = deferred("modal.modes.squares:momentum_left")(modes, number, phi)
    return effective if momentum is None else momentum**2


def row_of(details: Details, at: int) -> Details:
    """One row of the details, the last axis of every array."""
    single: dict[str, Any] = {}
    for field in fields(details):
        value = getattr(details, field.name)
        single[field.name] = tuple(part[..., [at]] for part in value) if isinstance(value, tuple) else value[[at]]
    return Details(**single)


def _family(modes: Eigenvalues, number: int, head: _RowPart, ratio: float) -> str:
    if np.isnan(ratio):
        return BEYOND_DOUBLE
    if modes.on_cart and modes.eigenvalue[number] == 0:
        return "rigid translation"
    structure, d = modes.hanging.structure, modes.rig.leading
    motions = displacements(modes.rig, head.details)
    eta = np.zeros(d) if head.part.is_still else np.array([part[head.at] for part in motions])
    words = moving_words(structure, eta, modes.inertia) if eta.any() else ""
    still_words = CART_STILL if modes.on_cart else STRUCTURE_STILL if d else FIXED
    folds = dict.fromkeys(("", "antiphase", "across the rail"), 0)
    for part in modes.spectrum.groups[number]:
        folds["antiphase" if is_balanced(modes.rig, part) else ""] += part.along_count
        folds["across the rail" if d else ""] += part.across_count
    motion = FREE
    if modes.eigenvalue[number] != 0:
        motion = _motion(modes, number, head, eta)
    return family(where=words or still_words, folds=folds, motion=motion, ratio=ratio)


def _motion(modes: Eigenvalues, number: int, head: _RowPart, eta: NDArray[np.inexact]) -> str:
    """How the pendula move in a mode, if their supports move by η."""
    if head.part.is_still:
        return motion_words(head, _whose(modes, number, head.part))
    if not any(angle[:, :, head.at].any() for angle in head.details.angles):
        return ""
    several = len(modes.rig.members) > 1 or modes.rig.members[0][2] > 1
    names, cart = list(modes.rig.names.values()), modes.rig.cart
    phase = agreement(head, names, several=several, is_still=not (cart and eta.any()))
    if eta.any() and (not cart or (cart.stiffness and phase in ("", "in phase"))):
        pivots = by_kind(modes.hanging, modes.hanging.phi.rail @ eta)
        phase = following(head, pivots, several=several) or phase
    return motion_words(head, phase)


def structure_motion(modes: Eigenvalues, number: int) -> tuple[Floats, Floats]:
    """The motion of a structure's coordinates (d,) in a mode with a largest angle of 1 rad, and their shares of a push.

    If no link moves, the largest displacement is 1 of its unit; for equal frequencies a shape that moves the structure
    is used. The shares are those of the velocity of each coordinate just after a sudden push on it; they are NaN with
    dampers.
    """
    structure = modes.rig.support
    motion, share, is_found = np.zeros(structure.size), np.zeros(structure.size), False
    for part in (part for part in modes.spectrum.groups[number] if not part.is_still):
        details = modes.spectrum.details(part.source, [part.row])
        eta = np.array([coordinates[0] for coordinates in details.eta])
        parted_rig = modes.spectrum.sources[part.source].matrices.parted_rig  # type: ignore[attr-defined]
        share = share + np.abs(eta) ** 2 / details.modal_mass[0] / parted_rig.accelerances
        if not is_found and eta.any():
            displacement = eta * np.array(coordinate_units(structure, modes.units.length))
            angles = np.concatenate([details.angles[block][:, column, 0] for block, column, _ in modes.rig.members])
            leading = first_of_largest(angles) or displacement[np.abs(displacement).argmax()]
            motion, is_found = (displacement / leading).real + 0.0, True
    return motion, share if not modes.rig.is_damped else np.full(structure.size, np.nan)


def _whose(modes: Eigenvalues, number: int, part: SpectrumPart) -> str:
    """The pendula that move while the others are at rest, where there are different ones."""
    kinds = {piece.kind for piece in modes.spectrum.groups[number]}
    if modes.rig.n_kinds == 1 or part.kind is None or len(kinds) > 1:
        return ""
    return modes.rig.names[part.kind]


def _resonances(modes: Eigenvalues, number: int) -> tuple[str, ...]:
    """Resonances with modes that can exchange energy: all on what moves, on a fixed support the same pendulum's."""
    parts = modes.spectrum.groups[number]
    fold = (
        modes.multiplicity[number]
        if modes.rig.leading
        else 1 + any(part.along_count and part.across_count for part in parts)
    )
    among = (f"1:1 among its own {fold} shapes",) if fold > 1 else ()
    return among + resonances(modes.omega, number, _partners(modes, number), modes.first)


def _partners(modes: Eigenvalues, number: int) -> Ints:
    if modes.rig.leading:
        return np.flatnonzero(modes.is_light)
    kinds = {part.kind for part in modes.spectrum.groups[number]}
    partners = np.array(sorted({row for kind in kinds for row in modes.spectrum.numbers_of_kind[kind]}))
    return np.asarray(partners[modes.is_light[partners]])


def _answers(
    modes: Eigenvalues, number: int, partners: list[tuple[int, int]], pieces: dict[int, list[_RowPart]]
) -> list[str]:
    """The modes whose responses make a mode's angle of 1 % a guide, in words: those that change it most.

    Shapes of other symmetry are not driven: equal pendula in antiphase do not drive shapes in which they move alike.
    """
    head = _head(pieces[number])
    kappa = float(head.details.kappa[head.at])
    alike = [(k, n, piece) for k, n in partners for piece in pieces[n] if piece.part.kind == head.part.kind]
    if not alike:
        return []
    swings = [(harmonic, _swing(modes, partner, piece)) for harmonic, partner, piece in alike]
    error, *changes = distortion(_blocks(modes, head.part), _swing(modes, number, head), swings, kappa).tolist()
    ratios = (modes.omega[partner] / modes.omega[number] / harmonic for harmonic, partner, _ in alike)
    shares = [1.0 if abs(ratio - 1) < DISTANCE_OF_DOUBT else DOUBT_ELSEWHERE for ratio in ratios]
    doubt = sum(share * abs(change) for share, change in zip(shares, changes, strict=True) if change)
    if not is_guide(radians(one_percent_amplitude(kappa)), error, doubt):
        return []
    largest = max(map(abs, changes))
    words = [
        f"1:{harmonic} with mode {modes.first + partner + 1}"
        for (harmonic, partner, _), change in zip(alike, changes, strict=True)
        if abs(change) >= min(largest, PROMISED_ERROR)
    ]
    return list(dict.fromkeys(words))


def _swing(modes: Eigenvalues, number: int, piece: _RowPart) -> ModeSwing:
    details, at = piece.details, [piece.at]
    angles = tuple(angle[:, :, at].real for angle in details.angles)
    largest = largest_angle(angles)
    return ModeSwing(
        x=np.abs(modes.spectrum.eigenvalue[[number]]) ** 2,
        modal_mass=details.modal_mass[at] / largest**2,
        cart=details.cart[at].real / largest,
        angles=tuple(angle / largest for angle in angles),
    )


def _blocks(modes: Eigenvalues, part: SpectrumPart) -> tuple[Block, ...]:
    """What moves in the shapes of a part, in natural units: one chain, or all as heavy as their copies."""
    blocks = modes.natural.blocks
    if part.kind:
        block, column = part.kind
        return (blocks[block].take(np.array([column])),)
    return tuple(block.heavier(block.count) for block in blocks)
