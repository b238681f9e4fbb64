"""A scene's model in modal form: one block of one or two states for each mode.

With φ as in `Modes.shape` (which separates equal and zero frequencies as well as any) and z = (q, q'),

    undamped   η'' + ω²η = φᵀF u,           z = (φη, φη'),               φᵀMφ = 1
    damped     α' = λα + ℓᵀB u,             z = 2 Re(rα),                r = (φ, λφ),  ℓ = ((λM + D)φ, Mφ)/s
    real λ     α' = λα + ℓᵀB u,             z = rα,                      s = φᵀ(2λM + D)φ

([Tisseur2001, §3.5]: left and right vectors of a symmetric quadratic eigenvalue problem.) A cart whose acceleration or
velocity is prescribed does not respond to the pendula: it is a separate block, and the modes are the fixed-base modes
of the pendula. So is a support whose acceleration or velocity is prescribed; the modes are then those of the scene. If
springs or drag couple them with its motion, they are deviations from the response to its steady motion, z = X (s, s')
with A X = X [[0, 1], [0, 0]].
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from modal.errors import ComputationError
from modal.modes import Modes, all_shapes, natural_modes
from modal.report import NOTHING, Displayed, Drawable, Summary, brief, first_line
from modal.scene.doors import checked
from modal.statespace.loops import without_samples
from modal.statespace.model import StateSpace, without_carrier
from modal.statespace.signals import DRIVES, SUPPORT, Signal
from modal.types import EPS, NOISE_OF_SUM, Complexes, Floats

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
        blocks = _closed_blocks(driven_modes, size)
        return ModalForm(driven_modes, model, tuple(blocks))
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


def _closed_blocks(modes: Modes, size: int) -> list[ModalBlock]:
    """The modes of a scene with feedback, whose left vectors are those of no symmetric pencil: rows of an inverse."""
    columns: list[tuple[int, complex, Floats, Floats]] = []
    for number, ((shape,), value) in enumerate(zip(all_shapes(modes), modes.eigenvalue.tolist(), strict=True)):
        phi: Complexes = modes.column(shape).astype(complex)
        r = np.concatenate((phi, value * phi))
        if value.imag:
            A = np.array([[value.real, value.imag], [-value.imag, value.real]])
            columns.append((number, value, A, np.column_stack((r.real, r.imag))))
            continue
        turn = np.exp(-1j * np.angle(phi[np.argmax(np.abs(phi))]))
        right, coasts = (r * turn).real[:, None], value == 0 and not (modes.matrices.D @ phi).any()
        if coasts:
            right = np.hstack((right, np.concatenate((np.zeros(size), phi.real))[:, None]))
        columns.append(
            (number, value, np.array([[0.0, 1.0], [0.0, 0.0]]) if coasts else np.array([[value.real]]), right)
        )
    every = np.hstack([right for *_, right in columns])
    if every.shape[1] != 2 * size or np.linalg.matrix_rank(every / np.linalg.norm(every, axis=0)) < 2 * size:
        raise ComputationError("the modes of this scene do not span its motion in double precision")
    lefts = np.split(np.linalg.inv(every), np.cumsum([len(A) for _, _, A, _ in columns])[:-1])
    blocks = []
    for (number, value, A, right), left in zip(columns, lefts, strict=True):
        states = tuple(
            Signal(f"eta_{number + 1}_{part}", "", f"coordinate of mode {number + 1}") for part in range(len(A))
        )
        seen, pushed = np.ones(1, dtype=complex), np.ones(1, dtype=complex)
        if value.imag:
            seen, pushed = np.array([1.0, 1j]), np.array([1j, 1.0]) * value.imag
        elif len(A) == 2:
            seen, pushed = np.array([1.0, 0j]), np.array([0j, 1.0])
        blocks.append(ModalBlock(number, 0, value, states, A, right, left, seen, pushed))
    return blocks


def _swing(name: str, meaning: str, value: complex, phi: Floats, Mphi: Floats) -> ModalBlock:
    """Undamped: η and η', also for a rigid translation and, with λ = ±√−ω², for a growing mode."""
    states = (
        Signal(f"eta_{name}", "kg^(1/2) m", meaning),
        Signal(f"eta_dot_{name}", "kg^(1/2) m/s", f"rate of the {meaning}"),
    )
    A, unit = np.array([[0.0, 1.0], [(value**2).real, 0.0]]), np.eye(2)
    right, left = np.kron(unit, phi[:, None]), np.kron(unit, Mphi / (phi @ Mphi))
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
    seen, pushed = np.array([1.0, 1j]), np.array([1j, 1.0]) * value.imag
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
