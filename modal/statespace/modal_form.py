"""A scene's model in modal form: one block of one or two states for each mode, and the gains of inputs and outputs.

With φ as in `Modes.shape` (which separates equal and zero frequencies as well as any) and z = (q, q'),

    undamped   η'' + ω²η = φᵀF u,           z = (φη, φη'),               φᵀMφ = 1
    damped     α' = λα + ℓᵀB u,             z = 2 Re(rα),                r = (φ, λφ),  ℓ = ((λM + D)φ, Mφ)/s
    real λ     α' = λα + ℓᵀB u,             z = rα,                      s = φᵀ(2λM + D)φ

([Tisseur2001, §3.5]: left and right vectors of a symmetric quadratic eigenvalue problem.) A cart whose acceleration or
velocity is prescribed does not respond to the pendula: it is a separate block, and the modes are the fixed-base modes
of the pendula. So is a support whose acceleration or velocity is prescribed; the modes are then those of the scene. If
springs or drag couple them with its motion, they are deviations from the response to its steady motion, z = X (s, s')
with A X = X [[0, 1], [0, 0]].

Modal gains say how strongly each input excites each mode and each output observes it, instead of ranks.

    undamped   |φᵀF_j| and |c_i φ| with φᵀMφ = 1: their product is the coefficient of 1/(s² + ω²) in G_ij(s)
    damped     |ℓᵀB_j| and |C_i r|, left and right vectors scaled so that the product is the size of the residue,
               of 1/(s² + 2ζωs + ω²) or, for a mode that does not oscillate, of 1/(s − λ)

Modes of equal frequency span a space; an input excites one direction in it, with the norm of its gains over the basis
vectors, and all inputs together control as many copies as the matrix of gains has significant singular values. (Modal
gains as measures of controllability: [Hamdan1989].)
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from modal.errors import ComputationError
from modal.modes import UNCERTAIN, Modes, Shape, all_shapes, natural_modes
from modal.report import NOTHING, Displayed, Drawable, Summary, TextResult, aligned, brief, first_line, folded
from modal.scene.doors import checked
from modal.scene.signal_names import signal_words
from modal.statespace.loops import without_samples
from modal.statespace.model import StateSpace, without_carrier
from modal.statespace.signals import DRIVES, SUPPORT, Signal
from modal.types import EPS, NOISE_OF_SUM, Complexes, Floats, Ints

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Numbers = NDArray[Any]


class ModalBlock(NamedTuple):
    """One mode: its states are left z, and z = right w for states w; A (k, k), right (n, k), left (k, n), k = 1 or 2.

    `mode` is its index in `ModalForm.modes`, None for a cart with prescribed motion, `copy` that of its shape;
    right `seen` is its eigenvector r and `pushed` left the matching ℓ, scaled so that (C r)(ℓᵀB) is the coefficient of
    1/(s² + 2ζωs + ω²) where a mode oscillates, of 1/(s − λ) where it does not.
    """

    mode: int | None
    copy: int
    eigenvalue: complex
    states: tuple[Signal, ...]
    A: Floats
    right: Floats
    left: Floats
    seen: Complexes
    pushed: Complexes

    @property
    def is_rigid(self) -> bool:
        """Whether there is no restoring force."""
        return self.eigenvalue == 0


@dataclass(frozen=True, eq=False, repr=False)
class ModalForm(Drawable, Displayed):
    """A model and its blocks; `modes` are those of its inputs: fixed-base ones if the cart's motion is prescribed."""

    modes: Modes
    model: StateSpace
    blocks: tuple[ModalBlock, ...]
    figure = "modal.plotting.response:bode_figure"

    @property
    def is_held(self) -> bool:
        """Whether the cart's motion is prescribed, so that the modes are those on a fixed support."""
        return any(signal.name in DRIVES for signal in self.model.inputs)

    def _summary(self) -> Summary:
        rows = (
            (
                NOTHING if block.mode is None else str(self.modes.first + block.mode + 1),
                ", ".join(signal.name for signal in block.states),
                brief(block.eigenvalue),
            )
            for block in self.blocks
        )
        title = f"Modal form of {first_line(self.model)}"
        headings = ("mode", "states", "eigenvalue (1/s)")
        return Summary(title, (), headings, rows, len(self.blocks), words=frozenset({1}))

    @cached_property
    def inputs(self) -> list[Floats]:
        """Each block's B, (k, m)."""
        return self._split(np.vstack([block.left for block in self.blocks]) @ self.model.B)

    @cached_property
    def outputs(self) -> list[Floats]:
        """Each block's C, (p, k)."""
        gains = self.model.C @ np.hstack([block.right for block in self.blocks])
        return [part.T for part in self._split(gains.T)]

    def residual(self) -> float:
        """Deviation of left · right from 1 and of left · A · right from the blocks, relative to A's largest entry."""
        left, right = np.vstack([b.left for b in self.blocks]), np.hstack([b.right for b in self.blocks])
        A = block_diagonal([block.A for block in self.blocks])
        size = max(1.0, float(np.abs(A).max()))
        deviation = np.abs(left @ right - np.eye(len(A))).max()
        return float(max(deviation, np.abs(left @ self.model.A @ right - A).max() / size))

    def _split(self, rows: Floats) -> list[Floats]:
        return np.split(rows, np.cumsum([len(block.A) for block in self.blocks])[:-1])


def block_diagonal(blocks: Sequence[Floats]) -> Floats:
    """A block-diagonal matrix."""
    ends = np.cumsum([0, *(len(block) for block in blocks)])
    matrix = np.zeros((ends[-1], ends[-1]))
    for block, first, last in zip(blocks, ends, ends[1:], strict=False):
        matrix[first:last, first:last] = block
    return matrix


@checked
def to_modal_form(modes: Modes, model: StateSpace) -> ModalForm:
    """Decompose the model of `modes.scene` into modes.

    Raise ValueError for the model of another scene, ComputationError for one in discrete time and if dampers make two
    modes coincide.
    """
    if model.dt:
        raise ComputationError("modal form needs a continuous model")
    if "sampled_feedback" in modes.scene.features:
        modes = natural_modes(without_samples(modes.scene))  # the model is that of loops that never wait
    names = {signal.name for signal in model.inputs}
    is_held = bool(names & DRIVES.keys())
    driven_modes = fixed_base(modes) if is_held else modes
    driven = bool(names & {*DRIVES, *SUPPORT} - {"support_displacement"})
    n = len(model.A)
    size = driven_modes.scene.n_links + driven_modes.rig.leading
    if n - 2 * size not in ((1, 2) if driven else (0,)):
        raise ValueError(f"the model has {n} states: it does not belong to this scene, which has {size} coordinates")
    if modes.scene.feedback:
        return ModalForm(driven_modes, model, tuple(_closed_blocks(driven_modes)))
    blocks = [
        *(_cart(model, n - 2 * size, size) if driven else ()),
        *_mode_blocks(driven_modes, n, size, "fixed-base " * is_held, first=int(driven)),
    ]
    if driven and model.A[-size:, [0, size + 1][: n - 2 * size]].any():
        blocks = _with_carrier_motion(blocks, model.A, size, driven_modes)
    if sum(len(block.A) for block in blocks) != n:
        raise ComputationError("the modes of this scene do not span its motion in double precision")
    return ModalForm(driven_modes, model, tuple(blocks))


def plot_model(model: StateSpace, **options: Any) -> Figure:
    """The figure of `ModalForm.plot` of the whole model of a scene; raise ComputationError for any other."""
    if model.scene is None:
        raise ComputationError("only the whole model of a scene can be drawn: this one is sampled, reduced or read")
    return to_modal_form(natural_modes(model.scene), model).plot(**options)


def fixed_base(modes: Modes) -> Modes:
    """The modes with a fixed support: those excited by a prescribed motion of the cart."""
    return natural_modes(without_carrier(modes.scene)) if modes.rig.leading else modes


def _cart(model: StateSpace, states: int, size: int) -> Iterator[ModalBlock]:
    """The prescribed cart: its position and, where its acceleration is given, its velocity."""
    places, eye = [0, size + 1][:states], np.eye(len(model.A))
    names = tuple(model.states[place] for place in places)
    A = model.A[np.ix_(places, places)]
    unit = np.eye(states, dtype=np.complex128)
    yield ModalBlock(None, 0, 0.0, names, A, eye[:, places], eye[places], unit[0], unit[-1])


def _with_carrier_motion(blocks: list[ModalBlock], A: Floats, size: int, modes: Modes) -> list[ModalBlock]:
    """The blocks of a cart or support, the first, and of modes, about where a steady motion of it leaves all else."""
    support, *moving = blocks
    states = len(support.A)
    stiff, damping, pulls = A[-size:, 1 : size + 1], A[-size:, -size:], A[-size:, [0, size + 1][:states]]
    shapes = all_shapes(modes)
    free = [
        np.real(modes.column(shape))
        for number in np.flatnonzero(modes.eigenvalue == 0).tolist()
        for shape in shapes[number]
        if not shape.across
    ]
    X, coasting = np.zeros((len(A), states)), np.array(free).reshape(-1, size).T
    if pulls[:, 0].any():
        X[1 : size + 1, 0] = -np.linalg.solve(stiff, pulls[:, 0])
    if states == 2:
        air = pulls[:, 1] + damping @ X[1 : size + 1, 0]
        columns = np.hstack([stiff, damping @ coasting])
        steady = -(np.linalg.lstsq(columns, air, rcond=None)[0] if free else np.linalg.solve(stiff, air))
        X[1 : size + 1, 0] += coasting @ steady[size:]
        X[1 : size + 1, 1], X[-size:, 1] = steady[:size], X[1 : size + 1, 0]
    return [
        support._replace(right=support.right + X),
        *(block._replace(left=block.left - block.left @ X @ support.left) for block in moving),
    ]


def _mode_blocks(modes: Modes, n: int, size: int, kind: str, first: int) -> Iterator[ModalBlock]:
    """The modes of this kind, their coordinates being states `first` … and their rates the last `size`."""
    linear, shapes = modes.matrices, all_shapes(modes)
    for number, value in enumerate(modes.eigenvalue.tolist()):
        for copy, shape in enumerate(shapes[number]):
            if shape.across:
                continue
            phi: Numbers = modes.column(shape)
            name = f"{number + 1}" if modes.multiplicity[number] == 1 else f"{number + 1}_{copy + 1}"
            forces = linear.D @ phi
            coasts = value == 0 and not np.any(np.abs(forces) > NOISE_OF_SUM * (np.abs(linear.D) @ np.abs(phi)))
            vectors: tuple[Numbers, Numbers, Numbers] = phi, linear.M @ phi, 0 * forces if coasts else forces
            is_real = np.isrealobj(phi) and (not value.imag if modes.is_classical else not vectors[2].any())
            meaning = f"coordinate of {kind}mode {name}"
            if is_real:
                block = _swing(name, meaning, value, *vectors[:2])
            else:
                block = (_pair if value.imag else _single)(name, meaning, value, *vectors)
            right, left = np.zeros((n, len(block.A))), np.zeros((len(block.A), n))
            right[first : first + size], right[n - size :] = np.split(block.right, 2)
            left[:, first : first + size], left[:, n - size :] = np.split(block.left, 2, axis=1)
            yield block._replace(mode=number, copy=copy, right=right, left=left)


def _closed_blocks(modes: Modes) -> list[ModalBlock]:
    """The modes of a scene with feedback, whose left vectors are those of no symmetric pencil: rows of an inverse."""
    blocks = [_closed_block(modes, number, shape) for number, (shape,) in enumerate(all_shapes(modes))]
    every = np.hstack([block.right for block in blocks])
    is_square = every.shape[0] == every.shape[1]
    if not is_square or np.linalg.matrix_rank(every / np.linalg.norm(every, axis=0)) < len(every):
        raise ComputationError("the modes of this scene do not span its motion in double precision")
    lefts = np.split(np.linalg.inv(every), np.cumsum([len(block.A) for block in blocks])[:-1])
    return [block._replace(left=left) for block, left in zip(blocks, lefts, strict=True)]


def _closed_block(modes: Modes, number: int, shape: Shape) -> ModalBlock:
    """A mode of a scene with feedback, without its left vectors."""
    phi: Complexes = modes.column(shape).astype(complex)
    value = complex(modes.eigenvalue[number])
    r, none, unit = np.concatenate((phi, value * phi)), np.zeros((0, 2 * len(phi))), np.ones(1, dtype=complex)
    coasts = value == 0 and not (modes.matrices.D @ phi).any()
    words = f"coordinate of mode {number + 1}"
    states = tuple(Signal(f"eta_{number + 1}_{part}", "", words) for part in range(2 if value.imag or coasts else 1))
    if value.imag:
        return _conjugate_block(value, states, np.column_stack((r.real, r.imag)), none)._replace(mode=number)
    right = (r * np.exp(-1j * np.angle(phi[np.argmax(np.abs(phi))]))).real[:, None]
    if not coasts:
        return ModalBlock(number, 0, value, states, np.array([[value.real]]), right, none, unit, unit)
    right = np.hstack((right, np.concatenate((np.zeros(len(phi)), phi.real))[:, None]))
    seen, pushed = np.eye(2, dtype=complex)
    return ModalBlock(number, 0, value, states, np.array([[0.0, 1.0], [0.0, 0.0]]), right, none, seen, pushed)


def _swing(name: str, meaning: str, value: complex, phi: Floats, Mphi: Floats) -> ModalBlock:
    """Undamped: η and η', also for a rigid translation and, with λ = ±√−ω², for a growing mode."""
    states = (
        Signal(f"eta_{name}", "kg^(1/2) m", meaning),
        Signal(f"eta_dot_{name}", "kg^(1/2) m/s", f"rate of the {meaning}"),
    )
    A, unit = np.array([[0.0, 1.0], [(value**2).real, 0.0]]), np.eye(2)
    dual = Mphi / (phi @ Mphi)
    right, left = (np.asarray(np.kron(unit, part), dtype=np.float64) for part in (phi[:, None], dual))
    seen, pushed = np.array([[1.0, value], [value, 1.0]], dtype=np.complex128)
    return ModalBlock(None, 0, value, states, A, right, left, seen, pushed)


def _pair(name: str, meaning: str, value: complex, phi: Complexes, Mphi: Complexes, Dphi: Complexes) -> ModalBlock:
    """Damped oscillation: 2 Re α and −2 Im α, scaled so that φᵀ(2λM + D)φ = 2i Im λ."""
    states = tuple(Signal(f"eta_{name}_{part}", "", meaning) for part in ("re", "im"))
    slope, target = _slope(value, phi, Mphi, Dphi), 2j * value.imag
    phi, Mphi, Dphi = (part * np.sqrt(target / slope) for part in (phi, Mphi, Dphi))
    right = np.concatenate((phi, value * phi))
    left = np.concatenate((value * Mphi + Dphi, Mphi)) / target
    return _conjugate_block(
        value, states, np.column_stack((right.real, right.imag)), 2 * np.array([left.real, -left.imag])
    )


def _conjugate_block(value: complex, states: tuple[Signal, ...], right: Floats, left: Floats) -> ModalBlock:
    """The block of λ and its conjugate, whose states are the real and the imaginary part."""
    A = np.array([[value.real, value.imag], [-value.imag, value.real]])
    seen, pushed = np.array([[1.0, 1j], [1j * value.imag, value.imag]])
    return ModalBlock(None, 0, value, states, A, right, left, seen, pushed)


def _single(name: str, meaning: str, value: complex, phi: Complexes, Mphi: Complexes, Dphi: Complexes) -> ModalBlock:
    """Damped without oscillation: one state, scaled so that φᵀ(2λM + D)φ = ±1."""
    turn = np.conj(phi[np.argmax(np.abs(phi))])
    shape, Mown, Down = ((part * turn).real for part in (phi, Mphi, Dphi))
    slope, rate = _slope(value.real, shape, Mown, Down).real, value.real
    shape, Mown, Down = (part / np.sqrt(abs(slope)) for part in (shape, Mown, Down))
    states, unit = (Signal(f"eta_{name}", "", meaning),), np.ones(1, dtype=np.complex128)
    right = np.concatenate((shape, rate * shape))[:, None]
    left = np.sign(slope) * np.concatenate((rate * Mown + Down, Mown))[None]
    return ModalBlock(None, 0, value, states, np.array([[rate]]), right, left, unit, unit)


def _slope(value: complex, phi: Numbers, Mphi: Numbers, Dphi: Numbers) -> complex:
    """φᵀ(2λM + D)φ, which vanishes where two modes coincide."""
    terms = phi * (2 * value * Mphi), phi * Dphi
    slope = complex(np.sum(terms))
    if abs(slope) <= 4 * np.sqrt(EPS) * np.abs(terms).sum():
        raise ComputationError("a mode of this scene is critically damped: it has no shape of its own")
    return slope


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
        headings = [mode, "ω (rad/s)", *["multiplicity"] * several, side.verb]
        headings += [signal_words(signal.name) for signal in side.signals]
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
    inputs = without_noise(input_vectors, model.B)
    sides = (
        Side(model.inputs, "controllable", _by_mode(form, inputs)),
        Side(model.outputs, "observable", _by_mode(form, outputs)),
    )
    return Gains(form.modes, form.modes.rig.leading != modes.rig.leading, *sides)


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
