"""Modal gains: how strongly each input excites each mode and each output observes it, instead of ranks.

    undamped   |φᵀF_j| and |c_i φ| with φᵀMφ = 1: their product is the coefficient of 1/(s² + ω²) in G_ij(s)
    damped     |ℓᵀB_j| and |C_i r|, left and right vectors scaled so that the product is the size of the residue,
               of 1/(s² + 2ζωs + ω²) or, for a mode that does not oscillate, of 1/(s − λ)

Modes of equal frequency span a space; an input excites one direction in it, with the norm of its gains over the basis
vectors, and all inputs together control as many copies as the matrix of gains has significant singular values. (Modal
gains as measures of controllability: [Hamdan1989].)
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from modal.modes import UNCERTAIN, Modes
from modal.report import Displayed, TextResult, aligned, folded
from modal.scene.doors import checked
from modal.scene.signal_names import signal_words
from modal.statespace.modal_form import ModalForm, to_modal_form
from modal.statespace.model import StateSpace
from modal.statespace.signals import Signal
from modal.types import NOISE_OF_SUM, Complexes, Floats, Ints

Number = TypeVar("Number", np.float64, np.complex128)
RELATIVE = "Gains are relative to the largest for each signal."
RELATIVE_GAIN_MIN = 1e-3
"""Limit: relative gain below which a mode is only barely controllable or observable, the default of `threshold`."""


@dataclass(frozen=True, eq=False, repr=False)
class Side(Displayed):
    """The gains of all inputs, or of all outputs: `parts` has for every mode the (d, m) array of its d copies."""

    signals: tuple[Signal, ...]
    verb: str
    parts: tuple[Complexes, ...]

    @cached_property
    def gain(self) -> Floats:
        """(R, m): of an input 1/√kg per N, 1/(√kg m) per N m; of an output in its unit per √kg m of the mode."""
        return np.array([np.linalg.norm(part, axis=0) for part in self.parts])

    @cached_property
    def relative(self) -> Floats:
        """(R, m): the gain over the largest of its column, 1 for the mode with the largest gain for this signal."""
        return self.gain / self._largest

    @cached_property
    def copies(self) -> Ints:
        """(R,): the number of independent copies of each mode that these signals together control or observe."""
        return self._ranks(0.0)

    @property
    def words(self) -> list[list[str]]:
        """By mode and signal "not controllable", "barely (gain 2e-05)" or "controllable"; of outputs "observable"."""
        return [
            [self._word(gain, share) for gain, share in zip(gains, shares, strict=True)]
            for gains, shares in zip(self.gain.tolist(), self.relative.tolist(), strict=True)
        ]

    def missed(self, threshold: float = RELATIVE_GAIN_MIN) -> tuple[int, ...]:
        """Indices, from 0, of modes with a copy below this relative gain for all signals together."""
        present = np.array([len(part) for part in self.parts])
        return tuple(np.flatnonzero(self._ranks(threshold) < present).tolist())

    def _ranks(self, threshold: float) -> Ints:
        largest = self._largest
        rows = (np.linalg.svd(part / largest, compute_uv=False) > max(threshold, NOISE_OF_SUM) for part in self.parts)
        return np.array([np.count_nonzero(row) for row in rows])

    @cached_property
    def _largest(self) -> Floats:
        largest = self.gain.max(0)
        return np.where(largest > 0, largest, 1.0)

    def _word(self, gain: float, share: float) -> str:
        if gain == 0:
            return f"not {self.verb}"
        return self.verb if share >= RELATIVE_GAIN_MIN else f"barely (gain {gain:.0e})"


@dataclass(frozen=True, eq=False, repr=False)
class Gains(TextResult):
    """Controllability, the gains of the `inputs`, and observability, those of the `outputs`, mode by mode.

    If the model prescribes the cart's motion, `held` is true: `modes` are then the fixed-base modes, not the table's.
    """

    modes: Modes
    held: bool
    inputs: Side
    outputs: Side

    def records(self) -> Iterator[dict[str, Any]]:
        """One mapping per mode and signal: mode, omega_rad_per_s, signal, gain, relative, word."""
        for side in (self.inputs, self.outputs):
            for number, words in enumerate(side.words):
                for j, signal in enumerate(side.signals):
                    yield {
                        "mode": number + 1,
                        "omega_rad_per_s": float(self.modes.omega[number]),
                        "signal": signal.name,
                        "gain": float(side.gain[number, j]),
                        "relative": float(side.relative[number, j]),
                        "word": words[j],
                    }

    def text(self) -> str:
        """Two grids, inputs above outputs: gains relative to the largest for each signal, or why there is none.

        `fold` counts the copies in the model: in space those along the rail.
        """
        return f"{self._grid(self.inputs)}\n\n{self._grid(self.outputs)}\n\n{folded(RELATIVE)}\n"

    def _rate(self, number: int) -> str:
        """ω, or the growth or decay rate (1/s) of a mode that does not oscillate; empty if no digit is certain."""
        value = self.modes.eigenvalue[number]
        if self.modes.error[number] >= UNCERTAIN:
            return "–"
        if value.imag > 0 or value == 0:
            return f"{abs(value):.6g}"
        return f"{'grows' if value.real > 0 else 'decays'} {abs(value):.6g} 1/s"

    def _grid(self, side: Side) -> str:
        several = any(len(part) > 1 for part in side.parts)
        mode = "fixed-base mode" if self.held else "mode"
        headings = [
            mode,
            "ω (rad/s)",
            *["multiplicity"] * several,
            side.verb,
            *(signal_words(signal.name) for signal in side.signals),
        ]
        rows = []
        for number, (words, shares) in enumerate(zip(side.words, side.relative.tolist(), strict=True)):
            cells = (f"{share:.2g}" if w == side.verb else w for w, share in zip(words, shares, strict=True))
            fold = [f"{len(side.parts[number])}"] * several
            rows.append([f"{number + 1}", self._rate(number), *fold, f"{side.copies[number]}", *cells])
        return aligned(rows, headings, ["right"] * len(headings), ["multiplicity"])


@checked
def modal_gains(modes: Modes, model: StateSpace) -> Gains:
    """The gains of a model of `modes.scene` from `modal.statespace.model.state_space`.

    A rigid translation whose position is not observed gets the gains of its velocity. Raise the errors of
    `modal.statespace.modal_form.modal_form`.
    """
    form = to_modal_form(modes, model)
    input_vectors = np.array([block.pushed @ block.left for block in form.blocks])
    right = np.array([block.right @ block.seen for block in form.blocks])
    outputs = without_noise(right, model.C.T)
    for k, block in enumerate(form.blocks):
        if block.is_rigid and not outputs[k].any():
            outputs[k] = without_noise(block.right[:, -1], model.C.T)
    return Gains(
        form.modes,
        form.modes.rig.leading != modes.rig.leading,
        Side(model.inputs, "controllable", _by_mode(form, without_noise(input_vectors, model.B))),
        Side(model.outputs, "observable", _by_mode(form, outputs)),
    )


def unseen(gains: Gains, threshold: float = RELATIVE_GAIN_MIN) -> tuple[int, ...]:
    """Return indices, from 0, of modes not observable by the outputs above a relative gain, or not in all copies."""
    return gains.outputs.missed(threshold)


def unreached(gains: Gains, threshold: float = RELATIVE_GAIN_MIN) -> tuple[int, ...]:
    """Return indices, from 0, of modes not controllable by the inputs above a relative gain, or not in all copies."""
    return gains.inputs.missed(threshold)


def without_noise(rows: NDArray[Number], matrix: Floats) -> NDArray[Number]:
    """Gains rows · matrix, set to 0 if they may be rounding."""
    product: NDArray[Number] = rows @ matrix
    return product * (np.abs(product) > NOISE_OF_SUM * (np.abs(rows) @ np.abs(matrix)))


def _by_mode(form: ModalForm, rows: Complexes) -> tuple[Complexes, ...]:
    """The rows of each mode's copies, (d, m)."""
    owner = np.array([-1 if block.mode is None else block.mode for block in form.blocks])
    return tuple(rows[owner == number] for number in range(len(form.modes)))
