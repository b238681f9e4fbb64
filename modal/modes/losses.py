"""What loss angles take from every mode: Q from the energy lost per cycle over the energy stored.

With the elongation r_j q of every stiffness k_j with a loss angle φ_j in the mode shape q,

    1/Q = 2ζ + Σ_j k_j φ_j(ω) |r_j q|² / (ω² qᴴ M q),

the modal strain energy (Johnson & Kienholz, AIAA J. 20, 1284 (1982)): to first order in φ the ratio of the imaginary to
the real part of the eigenvalue ω² (1 + i/Q) of K (1 + iφ).  What gravity holds straight stores energy without loss, so
that a stiff pendulum wire dilutes the loss of its bending by itself.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from modal.assembly import Dissipator, loss_angles, loss_at, losses_of
from modal.modes.modes import Modes
from modal.scene.doors import checked
from modal.types import Floats

CLOSE = 3.0
"""Relative differences of ω² over losses below which two modes mix."""
MOST_SHAPES = 60
"""Most shapes of one frequency among which the one that loses most is found."""


@checked
def mode_losses(modes: Modes, indices: Sequence[int] | None = None) -> Floats:
    """The loss angle Σ k φ |r q|²/(ω² qᴴ M q) of the modes with these indices (by default all), from their shapes.

    Of several modes of one frequency it is that of the combination that loses most.  NaN where a mode has no frequency,
    and for more than MOST_SHAPES of one frequency that lose differently.

    >>> from modal import Bob, Pendulum, Scene, natural_modes
    >>> scene = Scene(gravity=9.0, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0, stiffness=1.0, loss=0.01)])])
    >>> mode_losses(natural_modes(scene)).round(12).tolist()  # a tenth of the stiffness
    [0.001]
    """
    chosen = range(len(modes)) if indices is None else indices
    if not modes.scene.has_losses:
        return np.zeros(len(chosen))
    losses = losses_of(modes.scene)
    angles = loss_angles(modes.scene)
    alike = not modes.scene.is_structured and angles is not None
    alike = alike and angles.rig_of(modes.scene)[0].n_kinds == modes.rig.n_kinds  # type: ignore[union-attr]
    return np.array([_loss(modes, index, losses, alike) for index in chosen])


@checked
def quality_factors(modes: Modes, indices: Sequence[int] | None = None) -> Floats:
    """Q of the modes with these indices, by default all: infinite without losses, NaN where one grows or is not known.

    >>> from modal import load, natural_modes
    >>> quality_factors(natural_modes(load("chain-2")))
    array([inf, inf])
    """
    chosen = np.arange(len(modes)) if indices is None else np.asarray(indices, dtype=np.int64)
    ratio = modes.damping_ratio[chosen]
    lost = 2 * ratio + mode_losses(modes, chosen.tolist())
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where((modes.omega[chosen] > 0) & (ratio >= 0) & (ratio < 1), 1 / lost, np.nan)


def sharing(modes: Modes) -> list[int]:
    """The numbers of modes that another is closer to, relative to ω², than CLOSE times the larger of both losses.

    Their shapes mix, so that the first order of each alone is a guide.
    """
    if not modes.scene.has_losses or len(modes) < 2:
        return []
    losses, square = np.nan_to_num(mode_losses(modes)), modes.omega**2
    near = np.diff(square) <= CLOSE * np.maximum(losses[1:], losses[:-1]) * square[1:]
    return [int(number) for number in modes.number[np.append(near, False) | np.append(False, near)]]


def _loss(modes: Modes, index: int, losses: Sequence[Dissipator], alike: bool) -> float:
    omega, copies = float(modes.omega[index]), int(modes.multiplicity[index])
    if not omega or not np.isfinite(omega):
        return float("nan")
    if copies > MOST_SHAPES and not alike:
        return float("nan")
    columns = []
    for copy in range(1 if alike else copies):
        shape = modes.shape(index, copy)
        column = modes.column(shape)
        mass = shape.modal_mass
        if np.iscomplexobj(column):
            mass = float((column.conj() @ modes.matrices.M @ column).real)
        columns.append(column / np.sqrt(mass))
    strength = np.array([lossy.stiffness * float(loss_at(lossy.loss, np.array(omega))) for lossy in losses])
    elongation = _elongations(losses, np.array(columns))
    return float(np.linalg.eigvalsh((elongation.conj() * strength) @ elongation.T)[-1] / omega**2)


def _elongations(losses: Sequence[Dissipator], columns: Floats) -> Floats:
    """The rows of all losses times some shapes, (shapes, losses)."""
    owner = np.repeat(np.arange(len(losses)), [len(lossy.row) for lossy in losses])
    at = np.array([column for lossy in losses for column in lossy.row], dtype=np.int64)
    entries = np.array([value for lossy in losses for value in lossy.row.values()])
    elongations = np.zeros((len(columns), len(losses)), dtype=columns.dtype)
    np.add.at(elongations.T, owner, (columns[:, at] * entries).T)
    return elongations
