"""Reduced models: without uncontrollable or unobservable states, or with the most important modes.

Equal pendula on a cart that is pushed or driven move alike: N of them are replaced by one, N times as heavy, without
their antiphase modes; on a structure so are the copies of a pendulum, which hang from one point.  Of different pendula
with a common frequency only the controllable combination remains.

The static gain −C A⁻¹ B of the modes that a truncation removes is added to D (residualization, the
mode-acceleration method of Craig & Kurdila, Fundamentals of Structural Dynamics), so that G(0) of all oscillating modes
is unchanged.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal, NamedTuple, get_args

import numpy as np

from modal.assembly import frequencies, ratio_at, rig_of
from modal.errors import ComputationError, SceneError
from modal.modes import Modes, natural_modes
from modal.report import Displayed, Summary, brief, counted, first_line
from modal.scene import Pendulum, Scene
from modal.scene.doors import checked
from modal.scene.points import PendulumPoint, parse_point
from modal.statespace.geometry import geometry_of
from modal.statespace.modal_form import ModalBlock, ModalForm, block_diagonal, to_modal_form, without_noise
from modal.statespace.model import StateSpace, state_space
from modal.statespace.signals import OF_A_CART, SUPPORT, Signal, is_point, own_signals
from modal.types import EPS, NOISE_OF_SUM, NOISE_OF_TERMS, Complexes, Floats

Choice = Literal["contribution", "lowest"]
APART = "acts differently on equal pendula, so they cannot be merged"


# ------------------------------------------------------------------------------------------------ exact reduction


UNDAMPED_RATIO = 1e-11
"""Tolerance: damping ratio below which an eigenvalue computed from A counts as undamped."""
GRAMIAN_RESIDUAL_MAX = 1e-6
"""Tolerance: largest relative residual of the Lyapunov equations for which the gramians are accepted."""


class Folded(NamedTuple):
    """A scene with equal pendula merged into one, the number (from 1) of each kind's first, and its copies."""

    scene: Scene
    first: tuple[int, ...]
    copies: tuple[int, ...]


def fold_equals(scene: Scene) -> Folded:
    """Merge equal pendula into one for each kind, as heavy as all of its copies, in the order of the file.

    On a structure the copies of every entry are of one kind, except those with springs attached. Under constant forces,
    which merged pendula would not share, pendula are not merged; raise SceneError for copies there. Nor are they with
    feedback, which distinguishes them.
    """
    if scene.feedback:
        return Folded(scene, tuple(range(1, scene.n_pendula + 1)), (1,) * scene.n_pendula)
    leans = "constant_force" in scene.features
    several = [f"pendulum[{p}].count = {entry.count}" for p, entry in enumerate(scene.pendulum) if entry.count > 1]
    if leans and several:
        raise SceneError(
            [f"{place}: copies under constant forces are not merged: write them one by one" for place in several]
        )
    members, kinds = rig_of(scene).members, dict[tuple[int, ...], list[int]]()
    for p in range(len(scene.pendulum)):
        kinds.setdefault((p,) if leans or scene.is_structured else members[p][:2], []).append(p)
    spring_pendula = joined_pendula(scene)
    starts = np.cumsum([1, *(entry.count for entry in scene.pendulum)]).tolist()
    first, copies, pendula = list[int](), list[int](), list[Pendulum]()
    for entries in kinds.values():
        entry, start = scene.pendulum[entries[0]], starts[entries[0]]
        count = sum(scene.pendulum[p].count for p in entries)
        is_single = entries[0] in spring_pendula
        first += range(start, start + count) if is_single else [start]
        copies += [1] * count if is_single else [count]
        pendula.append(entry if is_single else heavier(entry, count))
    if max(copies) == 1:
        return Folded(scene, tuple(first), tuple(copies))
    folded_scene = scene.replace(damping_ratio=0.0, pendulum=pendula, force=())
    return Folded(folded_scene.replace(damping_ratio=_damping_ratios(scene, folded_scene)), tuple(first), tuple(copies))


def joined_pendula(scene: Scene) -> set[int]:
    """Return the entries of pendula with springs attached."""
    ends = [parse_point(text) for spring in scene.spring for text in spring.between]
    return {point.pendulum for point in ends if isinstance(point, PendulumPoint)}


def _damping_ratios(scene: Scene, folded_scene: Scene) -> float | tuple[float, ...]:
    """The damping ratios of a scene with the modes numbered as those of the folded one."""
    if not isinstance(scene.damping_ratio, tuple):
        return scene.damping_ratio
    return tuple(ratio_at(rig_of(scene))(frequencies(rig_of(folded_scene))).tolist())


@checked
def minimal(scene: Scene, inputs: tuple[str, ...] = (), outputs: tuple[str, ...] = ()) -> StateSpace:
    """Return the model with the same transfer functions without modes that do not contribute to them.

    Equal pendula are represented by the first of them, under its name. If every remaining mode is controllable and
    observable, the states are angles and rates; else the modal coordinates of those that are. Inputs and outputs are
    the groups of `modal.statespace.model.state_space`, whose errors are raised; SceneError also for forces on pendula
    that have equals, which they would distinguish.
    """
    fold = fold_equals(scene)
    if max(fold.copies) > 1 and (at := [name for name in inputs if is_point(name)]):
        raise SceneError([f"input {name}: {APART}" for name in at])
    model = state_space(fold.scene, inputs, outputs)
    outside = OF_A_CART | SUPPORT.keys() | own_signals(geometry_of(fold.scene))
    inside = [signal.name for signal in model.inputs if signal.name not in outside]
    if inside and max(fold.copies) > 1:
        raise SceneError([f"input {name}: {APART}" for name in inside])
    model = _read_off_the_first(fold, model)
    form = to_modal_form(natural_modes(fold.scene), model)
    blocks = [_rate_alone(form, block) for block in essential(form)]
    is_minimal = sum(len(block.A) for block in blocks) == len(model.A)
    return model if is_minimal else modal_model(form, blocks, model.D)


def essential(form: ModalForm) -> list[ModalBlock]:
    """Return the controllable and observable blocks; equal modes are rotated to minimize their number."""
    controllable = _rotate_equal_modes(form.blocks, [block.left for block in form.blocks], form.model.B)
    return _rotate_equal_modes(controllable, [block.right.T for block in controllable], form.model.C.T)


def modal_model(form: ModalForm, blocks: Sequence[ModalBlock], D: Floats) -> StateSpace:
    """The model of these blocks alone, in modal coordinates, with the same inputs and outputs."""
    rows = np.vstack([np.zeros((0, len(form.model.A))), *(block.left for block in blocks)])
    columns = np.hstack([np.zeros((len(form.model.A), 0)), *(block.right for block in blocks)])
    A = block_diagonal([block.A for block in blocks])
    states = tuple(state for block in blocks for state in block.states)
    return replace(form.model, scene=None, A=A, B=rows @ form.model.B, C=form.model.C @ columns, D=D, states=states)


def _rate_alone(form: ModalForm, block: ModalBlock) -> ModalBlock:
    """The speed alone, for a translation whose position no output sees."""
    translation = np.array_equal(block.A, [[0.0, 1.0], [0.0, 0.0]])
    if not translation or without_noise(block.right.T, form.model.C.T)[0].any():
        return block
    return block._replace(A=np.zeros((1, 1)), right=block.right[:, 1:], left=block.left[1:], states=block.states[1:])


def heavier(pendulum: Pendulum, count: int) -> Pendulum:
    """Return as many copies as one pendulum."""
    return pendulum.replace(links=tuple(link.heavier(count) for link in pendulum.links), count=1, start=None)


def _read_off_the_first(fold: Folded, model: StateSpace) -> StateSpace:
    """Names of the whole scene; a force on a pivot is divided among all pendula that were merged."""
    number = {str(place): first for place, first in enumerate(fold.first, 1)}
    own_names = own_signals(geometry_of(fold.scene))

    def first_name(name: str) -> str:
        if name in own_names:
            return name
        return re.sub(r"_(\d+)", lambda match: f"_{number[match[1]]}", name, count=1)

    def with_first_names(signals: Iterable[Signal]) -> tuple[Signal, ...]:
        return tuple(signal._replace(name=first_name(signal.name)) for signal in signals)

    pivots = [re.fullmatch(r"pivot_force_(\d+)", signal.name) for signal in model.outputs]
    share = np.array([[1.0 / fold.copies[int(pivot[1]) - 1] if pivot else 1.0] for pivot in pivots])
    states, inputs, outputs = map(with_first_names, (model.states, model.inputs, model.outputs))
    point = tuple((first_name(name), value) for name, value in model.operating_point)
    model = replace(model, states=states, inputs=inputs, outputs=outputs, operating_point=point)
    return replace(model, C=model.C * share, D=model.D * share)


def _rotate_equal_modes(blocks: Sequence[ModalBlock], rows: list[Floats], matrix: Floats) -> list[ModalBlock]:
    """The blocks for which rows · matrix is not 0, modes of one frequency rotated to minimize their number."""
    ends = np.cumsum([len(row) for row in rows])
    gains = np.split(without_noise(np.vstack(rows), matrix), ends[:-1]) if rows else []
    fresh = [  # modes of different pendula may have one frequency within rounding
        block.A.shape != next_block.A.shape
        or abs(block.eigenvalue - next_block.eigenvalue) > NOISE_OF_TERMS * abs(block.eigenvalue)
        for block, next_block in pairwise(blocks)
    ]
    cuts = [0, *(k for k, new in enumerate(fresh, 1) if new), len(blocks)]
    new_blocks: list[ModalBlock] = []
    for first, last in pairwise(cuts):
        new_blocks += _independent(blocks[first:last], np.array([gain.ravel() for gain in gains[first:last]]))
    return new_blocks


def _independent(blocks: Sequence[ModalBlock], gains: Floats) -> Sequence[ModalBlock]:
    """As many combinations of blocks of one A as their gains (d, …) have independent rows."""
    if len(blocks) == 1 or not gains.any():
        return blocks if gains.any() else ()
    U, size, _ = np.linalg.svd(gains, full_matrices=False)
    rights, lefts = (np.array([getattr(block, side) for block in blocks]) for side in ("right", "left"))
    return [
        block._replace(right=np.tensordot(turn, rights, 1), left=np.tensordot(turn, lefts, 1))
        for block, turn in zip(blocks, U.T[size > NOISE_OF_SUM * size[0]], strict=False)
    ]


# ------------------------------------------------------------------------------------------------------ truncation


@checked
def truncate(modes: Modes, model: StateSpace, count: int, by: Choice = "contribution") -> StateSpace:
    """The model of `modes.scene` with `count` modes, copies counted, in modal coordinates.

    `by` "contribution" keeps those that contribute most to any one transfer function, "lowest" those of lowest
    frequency. A rigid translation, a prescribed cart and growing modes are always kept, uncontrollable or unobservable
    modes are not; the static gain of all others is added to D, so that G(0) without the rigid part is that of the whole
    model. Raise ValueError for a count below 0 and another `by`, SceneError for more modes than the model has.
    """
    if count < 0 or by not in get_args(Choice):
        raise ValueError(f'count = {count}, by = {by!r}: must be a number of modes, by "contribution" or "lowest"')
    form = to_modal_form(modes, model)
    if count > (total := sum(block.mode is not None for block in form.blocks)):
        raise SceneError([f"count {count}: the model has {total} modes"])
    blocks = essential(form)
    swinging = [
        k
        for k, block in enumerate(blocks)
        if block.mode is not None and not block.is_rigid and block.eigenvalue.real <= 0
    ]
    rank = -_contributions(form, [blocks[k] for k in swinging]) if by == "contribution" else range(len(swinging))
    numbers = {swinging[k] for k in np.argsort(rank, kind="stable")[count:]}
    D = model.D
    for block in (blocks[k] for k in numbers):  # −C A⁻¹ B
        D = D - (model.C @ block.right) @ np.linalg.solve(block.A, block.left @ model.B)
    return modal_model(form, [block for k, block in enumerate(blocks) if k not in numbers], D)


def _contributions(form: ModalForm, blocks: list[ModalBlock]) -> Floats:
    """(K,): the largest share of each block in any channel of Σ |C r| |ℓᵀB|/|λ|ᵏ, k its number of states."""
    total = sum((_size(form, block) for block in blocks), start=np.zeros_like(form.model.D))
    divisors = np.where(total > 0, total, 1.0)
    return np.array([(_size(form, block) / divisors).max(initial=0.0) for block in blocks])


def _size(form: ModalForm, block: ModalBlock) -> Floats:
    """|C r| |ℓᵀB|/|λ|ᵏ in every channel, (p, m)."""
    output_size, input_size = (
        abs(form.model.C @ block.right @ block.seen),
        abs(block.pushed @ block.left @ form.model.B),
    )
    size: Floats = np.outer(output_size, input_size) / abs(block.eigenvalue) ** len(block.A)
    return size


@dataclass(frozen=True, eq=False, repr=False)
class Balanced(Displayed):
    """A reduced model, all n Hankel singular values of the original in descending order, and the error bound.

    `error_bound` is twice the sum of those omitted: no largest singular value of G(iω) is off by more.
    """

    model: StateSpace
    hankel: Floats
    error_bound: float

    def _summary(self) -> Summary:
        title = f"Balanced model of {len(self.model.A)} of {counted(len(self.hankel), 'state', 'states')}"
        return Summary(title, [("error bound", brief(self.error_bound)), ("model", first_line(self.model))])


def balance(model: StateSpace, count: int) -> Balanced:
    """The model reduced to `count` states, with the same inputs and outputs.

    Its states are combinations of all old ones, and the choice depends on the units of inputs and outputs. Raise
    ValueError for a count outside 1 … n; raise ComputationError for a model in discrete time, for one that is not
    stable and damped in every mode, for which gramians do not exist, and for a count beyond the controllable and
    observable states.
    """
    if not 1 <= count <= len(model.A):
        raise ValueError(f"count = {count}: must be between 1 and the {len(model.A)} states of the model")
    if model.dt:
        raise ComputationError("balanced reduction needs a continuous model")
    values, V = np.linalg.eig(model.A)
    _require_damping(values)
    reach, sight = (
        _root(_gramian(model.A, values, V, model.B)),
        _root(_gramian(model.A.T, values, np.asarray(np.linalg.inv(V).T, dtype=np.complex128), model.C.T)),
    )
    U, hankel, Wt = np.linalg.svd(sight.T @ reach)
    order = int(np.count_nonzero(hankel > np.sqrt(EPS) * hankel[0]))  # of square roots of rounded gramians
    if count > order:
        raise ComputationError(
            f"only {order} states are controllable and observable: choose at most as many, or make it minimal first"
        )
    scale = 1 / np.sqrt(hankel[:count])
    columns, rows = reach @ Wt[:count].T * scale, (sight @ U[:, :count] * scale).T
    states = tuple(
        Signal(f"balanced_{k}", "", f"state of Hankel singular value {hankel[k - 1]:.3g}") for k in range(1, count + 1)
    )
    reduced_model = replace(
        model, scene=None, A=rows @ model.A @ columns, B=rows @ model.B, C=model.C @ columns, states=states
    )
    return Balanced(reduced_model, hankel, float(2 * hankel[count:].sum()))


def _require_damping(values: Complexes) -> None:
    upper = values[values.imag >= 0]
    upper = upper[np.argsort(np.abs(upper), kind="stable")]
    rounding = UNDAMPED_RATIO * np.abs(values).max()
    for value in upper.tolist():
        if value.real < -max(rounding, UNDAMPED_RATIO * abs(value)):
            continue
        what = (
            "is a rigid translation"
            if abs(value) <= 1e4 * rounding
            else "grows"
            if value.real > rounding
            else "has ζ = 0"
        )
        raise ComputationError(
            f"balanced reduction needs a stable, damped model: a mode {what} (λ = {value:.3g} 1/s); use modal "
            f"truncation or, if this mode is uncontrollable or unobservable, make the model minimal first"
        )


def _gramian(A: Floats, values: Complexes, V: Complexes, B: Floats) -> Floats:
    """X of A X + X Aᵀ + B Bᵀ = 0."""
    b = np.linalg.solve(V, B.astype(np.complex128))
    X: Floats = (V @ (-(b @ b.conj().T) / (values[:, None] + values.conj())) @ V.conj().T).real
    push = B @ B.T
    if np.linalg.norm(A @ X + X @ A.T + push) > GRAMIAN_RESIDUAL_MAX * (
        np.linalg.norm(push) + 2 * np.linalg.norm(A @ X)
    ):
        raise ComputationError("two modes of this model are equal to double precision: its gramians are uncertain")
    return (X + X.T) / 2


def _root(X: Floats) -> Floats:
    """L with L Lᵀ = X, omitting eigenvalues made negative by rounding."""
    values, vectors = np.linalg.eigh(X)
    root: Floats = vectors * np.sqrt(np.clip(values, 0.0, None))
    return root
