"""Responses of a scene from single inputs to single outputs, with exact derivatives by its numbers and by frequency.

    Z x = F,   Zᵀ y = Yᵀ,   H = Y x + thrust,      Z = K + sD + s²M,   s = iω

    dH = Y' x + yᵀ (F' − Z' x) + thrust',          by a number of the scene, or by ω

x and y are two solutions of one matrix, for any number of derivatives.  M, K, D and the rows of outputs and inputs are
polynomials in each number, differentiated exactly (`modal.assembly.differences`). If the cart's motion is prescribed,
its row is omitted and x_0 = s^(−order) of the input.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import scipy

from modal.assembly import differences, matrices_of, rig_of, scene_squares
from modal.errors import SceneError, gathered, refuse_any, spelling_hint
from modal.scene import Scene, require
from modal.scene.parameters import Place
from modal.statespace.geometry import Geometry, geometry_of
from modal.statespace.signals import (
    DRIVES,
    EXAMPLES,
    OF_A_CART,
    PRESCRIBED,
    PUSHES,
    READINGS,
    SUPPORT,
    InputGroup,
    OutputGroup,
    Signal,
    input_at_point,
    is_point,
    outputs_of,
    point_input,
    validate_points,
)
from modal.types import Complexes, Floats

Source = tuple[str, int]
"""A group of inputs or outputs (`PUSHES`, `READINGS`) and a signal's index in it."""


class Channel(NamedTuple):
    """The names of an output and of an input."""

    output: str
    input: str


class Arrays(NamedTuple):
    """A model in numbers: M, K, D (n, n), `carried` (2, n) at unit velocity, windage and momentum, and channels' rows.

    `F` (C, n) are forces for a unit of the input, `Y` (C, 3, n) what multiplies q, q' and q'', `thrust` (C,) the direct
    contribution of the input, `translation` (C, 3) those of the ground's displacement, velocity and acceleration.
    """

    M: Any
    K: Any
    D: Any
    carried: Any
    F: Any
    Y: Any
    thrust: Any
    translation: Any


class ChannelKind(NamedTuple):
    """The part independent of the parameters: what the input moves and the order of its derivative.

    It moves the "cart", the "ground" or nothing; "held" is a force next to a cart with prescribed motion.
    """

    moves: str
    order: int


@dataclass(frozen=True, eq=False)
class ChannelModel:
    """A scene by its channels, as a function of numbers; `signals` are outputs and inputs with their units.

    `read` and `given` say where the rows of outputs and the forces of inputs come from.
    """

    channels: tuple[Channel, ...]
    kinds: tuple[ChannelKind, ...]
    signals: tuple[tuple[Signal, Signal], ...]
    read: tuple[Source, ...]
    given: tuple[Source | None, ...]

    def arrays(self, scene: Scene) -> Arrays:
        """The model of a scene of the same form."""
        rig = rig_of(scene)
        geometry, squares = geometry_of(scene), scene_squares(rig)
        linear = matrices_of(rig, squares)
        n, n_channels = geometry.size, len(self.channels)
        Y, F = np.zeros((n_channels, 3, n)), np.zeros((n_channels, n))
        thrust, translation = np.zeros(n_channels), np.zeros((n_channels, 3))
        for c, ((name, k), entry) in enumerate(zip(self.read, self.given, strict=True)):
            group = READINGS[name](geometry)
            for order, part in enumerate((group.position, group.rate, group.acceleration)):
                if part is not None:
                    Y[c, order] = part[k]
            for order, part in enumerate(group.carried):
                if part is not None:
                    translation[c, order] = part[k]
            if entry is not None:
                push = (
                    input_at_point(geometry, point_input(scene, entry[0]))
                    if is_point(entry[0])
                    else PUSHES[entry[0]](geometry)
                )
                F[c] = push.F[:, entry[1]]
                if group.pushed:
                    thrust[c] = push.thrust[k, entry[1]]
        ground_motion = np.stack([squares.windage, squares.momentum])
        return Arrays(linear.M, linear.K, linear.D, ground_motion, F, Y, thrust, translation)

    def model(self, scene: Scene) -> Model:
        """The responses of a scene of the same form."""
        return Model(self.kinds, self.arrays(scene))

    def slopes(self, scene: Scene, places: Sequence[Place]) -> Arrays:
        """Derivatives of all arrays by the numbers at these places, in the first axis."""
        parts = [differences(scene, place, 1.0, self.arrays) for place in places]
        return Arrays(*(np.array(part) for part in zip(*parts, strict=True)))


def channel_model(scene: Scene, channels: Sequence[Channel]) -> ChannelModel:
    """Return the channels of a scene; raise SceneError with every unknown signal, and what its model refuses."""
    geometry = geometry_of(scene)
    absent_group = "coordinate_forces" if geometry.on_cart else "cart_force"
    inputs = _sources({name: PUSHES[name](geometry) for name in PUSHES if name != absent_group})
    known_outputs = outputs_of(geometry)
    names = [name for name in READINGS if name in known_outputs and (name not in OF_A_CART or geometry.on_cart)]
    outputs = _sources({name: READINGS[name](geometry) for name in names})
    problems: list[str] = []
    with gathered(problems):
        validate_points(scene, [channel.input for channel in channels if is_point(channel.input)])
    for channel in channels:
        if channel.output not in outputs:
            problems.append(f"output {channel.output}: {_among([*outputs], channel.output)}")
        if channel.input not in {*inputs, *PRESCRIBED} and not is_point(channel.input):
            problems.append(f"input {channel.input}: {_among([*inputs, *PRESCRIBED], channel.input)}, or {EXAMPLES}")
        if channel.input in DRIVES and not geometry.on_cart:
            problems.append(f"input {channel.input}: there is no cart alone")
        if channel.input in SUPPORT:
            problems += _moved_problems(scene, geometry, channel.input)
    refuse_any(dict.fromkeys(problems))
    output_sources = tuple(outputs[channel.output][0] for channel in channels)
    input_sources: list[Source | None] = []
    signals: list[tuple[Signal, Signal]] = []
    kinds: list[ChannelKind] = []
    prescribed = SUPPORT | DRIVES
    for output, name in channels:
        source: Source | None
        if is_point(name):
            source, signal = (name, 0), Signal(name, "N m" if name.startswith("torque") else "N", "")
        else:
            source, signal = inputs[name] if name in inputs else (None, prescribed[name])
        input_sources.append(source)
        signals.append((outputs[output][1], signal))
        moves = "ground" if name in SUPPORT else "cart" if name in DRIVES else ""
        kinds.append(ChannelKind(moves, PRESCRIBED[name][1] if moves else 0))
    return ChannelModel(tuple(channels), tuple(kinds), tuple(signals), output_sources, tuple(input_sources))


def _among(names: Sequence[str], wrong: str) -> str:
    examples = names[:12]
    more = ", …" * (len(examples) < len(names))
    return f"must be one of {', '.join(examples)}{more}{spelling_hint(wrong, names)}"


def _moved_problems(scene: Scene, geometry: Geometry, name: str) -> list[str]:
    try:
        require(scene, "a linear model of a moved support")
    except SceneError as error:
        return list(error.problems)
    if any(carrier.M is not None for carrier in geometry.structure.carriers):
        return [f"input {name}: a modal support does not say how the ground drives its coordinates: give forces"]
    return []


def _sources(groups: Mapping[str, InputGroup | OutputGroup]) -> dict[str, tuple[Source, Signal]]:
    return {s.name: ((name, k), s) for name, group in groups.items() for k, s in enumerate(group.signals)}


@dataclass(eq=False)
class Model:
    """Responses of the channels of a model."""

    kinds: tuple[ChannelKind, ...]
    arrays: Arrays

    @cached_property
    def poles(self) -> Complexes:
        """The poles of the free system, in 1/s."""
        return poles_of(self.arrays)

    @cached_property
    def held_poles(self) -> Complexes:
        """The poles with a prescribed motion of the cart."""
        a = self.arrays
        return poles_of(a._replace(M=a.M[1:, 1:], K=a.K[1:, 1:], D=a.D[1:, 1:]))

    def condition(self, omega: Floats) -> Floats:
        """The condition number (W,) of the first channel's matrix, infinite at a pole without a damper."""
        first = int(self.kinds[0].moves in {"cart", "held"})
        return np.asarray(np.linalg.cond(self._state(0, omega, adjoint=False).Z[:, first:, first:]))

    def poles_for(self, channel: int) -> Complexes:
        """Return the poles that a channel may have."""
        return self.held_poles if self.kinds[channel].moves == "cart" else self.poles

    def response(self, channel: int, omega: Floats) -> Complexes:
        """H (W,) at ω (W,) in rad/s."""
        state = self._state(channel, omega, adjoint=False)
        return self._value(channel, state)

    def slope(self, channel: int, omega: Floats) -> tuple[Complexes, Complexes]:
        """H and ∂H/∂ω (W,)."""
        state = self._state(channel, omega)
        a, kind, s, x = self.arrays, self.kinds[channel], state.s, state.x
        rows = a.Y[channel, 1] + 2 * s[:, None] * a.Y[channel, 2]
        force_slope = -(a.D @ x[..., None] + 2 * s[:, None, None] * (a.M @ x[..., None]))[..., 0]
        slope = (rows * x).sum(1)
        if kind.moves == "ground":
            force_slope = force_slope - _sum_of_powers(s, 1 - kind.order, a.carried, slope=True)
            slope = slope + _sum_of_powers(s, -kind.order, a.translation[channel], slope=True)
        if kind.moves == "cart":
            factor_slope = -kind.order * s ** (-kind.order - 1.0)
            slope = slope + state.rows[:, 0] * factor_slope
            force_slope = force_slope - (state.Z[:, :, 0]) * factor_slope[:, None]
        return self._value(channel, state), 1j * (slope + (state.y * force_slope).sum(1))

    def gradient(self, channel: int, omega: Floats, slopes: Arrays) -> tuple[Complexes, Complexes]:
        """H (W,) and its derivatives (W, p) by numbers, from those of the arrays."""
        state = self._state(channel, omega)
        kind, s, x, y = self.kinds[channel], state.s, state.x, state.y
        powers = np.stack([np.ones_like(s), s, s * s])
        stiff = np.einsum("wi,pij,wj->wp", y, slopes.K, x, optimize=True)
        damping_part = np.einsum("wi,pij,wj->wp", y, slopes.D, x, optimize=True)
        heavy = np.einsum("wi,pij,wj->wp", y, slopes.M, x, optimize=True)
        gradient = -(stiff + s[:, None] * damping_part + (s * s)[:, None] * heavy)
        gradient += np.einsum("ow,poj,wj->wp", powers, slopes.Y[:, channel], x, optimize=True)
        gradient += np.einsum("wi,pi->wp", y, slopes.F[:, channel]) + slopes.thrust[:, channel]
        if kind.moves == "ground":
            force_part = _sum_of_powers(s, 1 - kind.order, slopes.carried.swapaxes(0, 1)) + np.zeros(
                (len(s), *slopes.F[:, channel].shape)
            )
            gradient -= np.einsum("wi,wpi->wp", y, force_part)
            gradient += _sum_of_powers(s, -kind.order, slopes.translation[:, channel].T)
        return self._value(channel, state), gradient

    def _value(self, channel: int, state: _State) -> Complexes:
        kind = self.kinds[channel]
        value = (state.rows * state.x).sum(1) + self.arrays.thrust[channel]
        if kind.moves == "ground":
            value = value + _sum_of_powers(state.s, -kind.order, self.arrays.translation[channel])
        return np.asarray(value)

    def _state(self, channel: int, omega: Floats, *, adjoint: bool = True) -> _State:
        a, kind = self.arrays, self.kinds[channel]
        s = 1j * np.asarray(omega, dtype=float)
        Z = a.K + s[:, None, None] * a.D + (s * s)[:, None, None] * a.M
        rows = a.Y[channel, 0] + s[:, None] * a.Y[channel, 1] + (s * s)[:, None] * a.Y[channel, 2]
        F = np.repeat(a.F[channel][None].astype(complex), len(s), axis=0)
        if kind.moves == "ground":
            F = F - _sum_of_powers(s, 1 - kind.order, a.carried)
        x, y, first = np.zeros_like(rows), np.zeros_like(rows), int(kind.moves in {"cart", "held"})
        if kind.moves == "cart":
            x[:, 0] = s ** float(-kind.order)
            F = F - Z[:, :, 0] * x[:, :1]
        inner = Z[:, first:, first:]
        right = [F[:, first:]] + [rows[:, first:]] * adjoint
        with np.errstate(all="ignore"):
            try:
                solution = np.linalg.solve(inner, np.stack(right, axis=-1))
            except np.linalg.LinAlgError:
                solution = np.full((*inner.shape[:2], len(right)), np.inf + 0j)
        x[:, first:] = solution[..., 0]
        if adjoint:
            y[:, first:] = solution[..., 1]
        return _State(s, Z, rows, x, y)


def _sum_of_powers(s: Complexes, first: int, parts: Any, *, slope: bool = False) -> Any:
    """Σ s^(first + k) c_k (W, …) of those `parts` c_k that are not 0, or its derivative by s."""
    total: Any = 0.0
    for power, part in enumerate(parts, first):
        if np.any(part) and (power or not slope):
            factor = power * s ** (power - 1.0) if slope else s ** float(power)
            total = total + np.multiply.outer(factor, part)
    return total


class _State(NamedTuple):
    s: Complexes
    Z: Complexes
    rows: Complexes
    x: Complexes
    y: Complexes


def poles_of(arrays: Arrays) -> Complexes:
    """The finite roots λ of det(λ²M + λD + K), in 1/s."""
    M, K, D = arrays.M, arrays.K, arrays.D
    n = len(M)
    unit = 1 / np.sqrt(np.where(np.diag(M) > 0, np.diag(M), np.maximum(np.abs(np.diag(K)), 1e-300)))
    M, K, D = (unit[:, None] * part * unit for part in (M, K, D))
    eye, none = np.eye(n), np.zeros((n, n))
    if np.linalg.cond(M) < 1e14:
        poles = np.linalg.eigvals(np.block([[none, eye], [-np.linalg.solve(M, K), -np.linalg.solve(M, D)]]))
    else:
        companion, inertia = np.block([[none, eye], [-K, -D]]), np.block([[eye, none], [none, M]])
        poles = scipy.linalg.eigvals(companion, inertia)
    return np.asarray(poles[np.isfinite(poles)], dtype=np.complex128)
