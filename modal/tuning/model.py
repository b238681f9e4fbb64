"""The linear model of a scene as functions of its free numbers, and its responses with exact derivatives.

    Z x = F,   Zᵀ y = Yᵀ,   H = Y x + thrust,      Z = K + sD + s²M,   s = iω

    dH = Y' x + yᵀ (F' − Z' x) + thrust',          by a number of the scene, or by ω

x and y are two solutions of one matrix, for any number of derivatives.  M, K, D and the rows of outputs and inputs are
polynomials in each number, differentiated exactly (`modal.assembly.differences`).  Where the cart's motion is
prescribed, its row is left out and x_0 = s^(−order) of the input.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import scipy

from modal.assembly import differences, matrices_of, rig_of, scene_squares
from modal.errors import SceneError, spelling_hint
from modal.scene import Scene, require
from modal.scene.parameters import Place, Variable, with_numbers
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
from modal.types import Booleans, Complexes, Floats

COORDINATES_MAX = 200
"""Limit: coordinates of a scene that can be tuned: "at most 200 are tuned"."""
Source = tuple[str, int]
"""A group of inputs or outputs (`PUSHES`, `READINGS`) and a signal's index in it."""
GRID_REACH = 30.0
"""Tolerance: the grid's end over the fastest pole, and the slowest over its beginning: beyond, |H| is monotonic."""
WITHIN = np.concatenate(([0.0], np.geomspace(0.08, 40.0, 9)))
"""Distances of points of the grid from a pole, in its damping rates."""
GRID_POINTS = 80
"""Tolerance: points of the grid in addition to those of poles: zeros between them part peaks by far more."""
FAR_FREQUENCY = 1e-4
"""Tolerance: a frequency, over that of the slowest pole, that stands for 0, its inverse for infinity, and a distance
from an undamped pole at which an infinite peak shows: what is left out is of second order."""
STILL_RATE = 8 * np.sqrt(np.finfo(float).eps)
"""Tolerance: of the fastest mode, a rate below which a mode moves freely: λ² is right to its ε."""
DAMPING_MIN = 1e-11
"""Tolerance: damping ratio of a mode that nothing damps: rounding leaves so much."""
SIDE_POINTS = 24
"""Cost: most frequencies beside peaks at which |H| bounds the largest."""


class Channel(NamedTuple):
    """The names of an output and of an input."""

    output: str
    input: str


class Arrays(NamedTuple):
    """A model in numbers: M, K, D (n, n), `carried` (2, n) at unit velocity, windage and momentum, and channels' rows.

    `F` (C, n) are forces for a unit of the input, `Y` (C, 3, n) what multiplies q, q' and q'', `thrust` (C,) what the
    input adds directly, `translation` (C, 3) what the ground's displacement, velocity and acceleration add.
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
    """What does not depend on the numbers: what the input moves and how often differentiated."""

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


def channel_model(scene: Scene, channels: Sequence[Channel]) -> ChannelModel:
    """The channels of a scene; SceneError names every signal that it does not have, and what its model refuses."""
    geometry = geometry_of(scene)
    absent_group = "coordinate_forces" if geometry.on_cart else "cart_force"
    inputs = _sources({name: PUSHES[name](geometry) for name in PUSHES if name != absent_group})
    known_outputs = outputs_of(geometry)
    names = [name for name in READINGS if name in known_outputs and (name not in OF_A_CART or geometry.on_cart)]
    outputs = _sources({name: READINGS[name](geometry) for name in names})
    problems: list[str] = []
    try:
        validate_points(scene, [channel.input for channel in channels if is_point(channel.input)])
    except SceneError as error:
        problems += error.problems
    for channel in channels:
        if channel.output not in outputs:
            problems.append(f"output {channel.output}: {_among([*outputs], channel.output)}")
        if channel.input not in {*inputs, *PRESCRIBED} and not is_point(channel.input):
            problems.append(f"input {channel.input}: {_among([*inputs, *PRESCRIBED], channel.input)}, or {EXAMPLES}")
        if channel.input in DRIVES and not geometry.on_cart:
            problems.append(f"input {channel.input}: there is no cart alone")
        if channel.input in SUPPORT:
            problems += _moved_problems(scene, geometry, channel.input)
    if problems:
        raise SceneError(list(dict.fromkeys(problems)))
    output_sources = tuple(outputs[channel.output][0] for channel in channels)
    input_sources: list[Source | None] = []
    signals: list[tuple[Signal, Signal]] = []
    for output, name in channels:
        source: Source | None
        if is_point(name):
            source, signal = (name, 0), Signal(name, "N m" if name.startswith("torque") else "N", "")
        else:
            source, signal = inputs[name] if name in inputs else (None, {**SUPPORT, **DRIVES}[name])
        input_sources.append(source)
        signals.append((outputs[output][1], signal))
    kinds = tuple(
        ChannelKind(
            "" if channel.input not in PRESCRIBED else "ground" if channel.input in SUPPORT else "cart",
            PRESCRIBED.get(channel.input, ("", 0))[1],
        )
        for channel in channels
    )
    return ChannelModel(tuple(channels), kinds, tuple(signals), output_sources, tuple(input_sources))


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


# ------------------------------------------------------------------------------------------------ functions of numbers


class TunedNumbers:
    """The arrays of a scene at values of its free numbers and at factors of others, with their derivatives."""

    def __init__(self, scene: Scene, places: Sequence[Place], form: ChannelModel) -> None:
        self.scene, self.places, self.form = scene, tuple(places), form
        self.paths = [with_numbers(place) for place in places]
        self._variable = Variable(scene, self.paths)

    def scene_at(self, values: Floats) -> Scene:
        """The scene with these numbers (n,)."""
        if not self.paths:
            return self.scene
        return self._variable.at(dict(zip(self.paths, map(float, values), strict=True)))

    def model(self, scene: Scene) -> Model:
        """The model of a scene."""
        return Model(self.form.kinds, self.form.arrays(scene), lambda places: self.slopes(scene, places))

    def slopes(self, scene: Scene, places: Sequence[Place]) -> Arrays:
        """Derivatives of all arrays by the numbers at these places, in the first axis."""
        parts_of_slopes = [differences(scene, place, 1.0, self.form.arrays) for place in places]
        return Arrays(*(np.array(part) for part in zip(*parts_of_slopes, strict=True)))


@dataclass(eq=False)
class Model:
    """Responses of the channels of a model; `differentiate` gives its derivatives by numbers at places."""

    kinds: tuple[ChannelKind, ...]
    arrays: Arrays
    differentiate: Callable[[Sequence[Place]], Arrays]

    @cached_property
    def poles(self) -> Complexes:
        """Those of everything that moves freely, in 1/s."""
        return poles_of(self.arrays)

    @cached_property
    def held_poles(self) -> Complexes:
        """Those next to a cart whose motion is prescribed."""
        a = self.arrays
        return poles_of(a._replace(M=a.M[1:, 1:], K=a.K[1:, 1:], D=a.D[1:, 1:]))

    def poles_for(self, channel: int) -> Complexes:
        """Those that a channel may have."""
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
        x, y, first = np.zeros_like(rows), np.zeros_like(rows), int(kind.moves == "cart")
        if first:
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


@dataclass(frozen=True, eq=False)
class Peaks:
    """Frequencies `omega` (P,) in rad/s of maxima of |H| and of the ends of the band; `inside` (P,) are maxima.

    `beside` (Q,) are frequencies of the grid where |H| is nearly as large: as numbers change, two peaks may merge and
    one wander fast, while |H| at a frequency changes slowly.  `endless` says where |H| has no bound, if it has none.
    """

    omega: Floats
    inside: Booleans
    beside: Floats
    endless: str = ""
    static: float = 0.0
    """The frequency that stands for 0 where no band bounds the response."""

    @classmethod
    def none(cls, words: str) -> Peaks:
        """Those of a response without bound."""
        return cls(np.zeros(0), np.zeros(0, bool), np.zeros(0), words)


def find_peaks(model: Model, channel: int, band: tuple[float, float] | None) -> Peaks:
    """The peaks of a channel over a band (rad/s), by default over all frequencies."""
    poles = model.poles_for(channel)
    poles = poles[(poles.imag >= 0) & (np.abs(poles) > 0)]
    rates = np.abs(poles)
    rates = rates[rates > STILL_RATE * rates.max(initial=0.0)] if len(rates) else np.ones(1)
    low, high = band or (float(rates.min()) * FAR_FREQUENCY, float(rates.max()) / FAR_FREQUENCY)
    inner = band or (float(rates.min()) / GRID_REACH, float(rates.max()) * GRID_REACH)
    for pole in poles[np.abs(poles.real) <= DAMPING_MIN * np.abs(poles)].tolist():
        at = abs(pole.imag)
        if low <= at <= high and _is_infinite(model, channel, at):
            return Peaks.none(f"at {at / (2 * np.pi):.6g} Hz, where nothing damps a mode")
    omega = _grid(poles, *inner)
    if band is None:
        omega = np.concatenate(([low], omega, [high]))
    with np.errstate(all="ignore"):
        size = np.abs(model.response(channel, omega))
    size = np.where(np.isfinite(size), size, 0.0)
    if band is None and size[0] > 5 * size[1] > 0:
        return Peaks.none("towards 0 Hz: give `over_hz=…`")
    if band is None and size[-1] > 5 * size[-2] > 0 and size[-1] > FAR_FREQUENCY * size.max():
        return Peaks.none("towards high frequencies: give `over_hz=…`")
    at = np.flatnonzero((size[1:-1] > size[:-2]) & (size[1:-1] >= size[2:])) + 1
    turning = _refine_maxima(model, channel, omega[at - 1], omega[at], omega[at + 1]) if len(at) else np.zeros(0)
    ends = [k for k, neighbour in ((0, 1), (-1, -2)) if size[k] >= size[neighbour] and size[k] > 0]
    all_omega = np.concatenate((turning, omega[ends]))
    large_samples = np.flatnonzero(size >= 0.8 * size.max())
    places = np.linspace(0, len(large_samples) - 1, min(len(large_samples), SIDE_POINTS)).astype(int)
    large_samples = large_samples[places]
    return Peaks(all_omega, np.arange(len(all_omega)) < len(turning), omega[large_samples], static=0.0 if band else low)


def _grid(poles: np.ndarray, low: float, high: float) -> Floats:
    width = np.maximum(np.abs(poles.real), 1e-9 * np.abs(poles))[:, None]
    close_points = (np.abs(poles.imag)[:, None] + width * np.concatenate((-WITHIN[::-1], WITHIN))).ravel()
    close_points = np.concatenate((close_points, np.abs(poles)))
    close_points = close_points[(close_points > low) & (close_points < high)]
    return np.unique(np.concatenate((np.geomspace(low, high, GRID_POINTS), close_points)))


def _is_infinite(model: Model, channel: int, omega: float) -> bool:
    """Whether |H| grows as the inverse of the distance from an undamped pole, which may be in no output."""
    far, near = FAR_FREQUENCY, FAR_FREQUENCY / 64
    sizes = np.abs(model.response(channel, omega * np.array([1 + far, 1 + near, 1 - far, 1 - near])))
    return bool(max(sizes[1] / sizes[0], sizes[3] / sizes[2]) > far / near / 4)


def _refine_maxima(model: Model, channel: int, low: Floats, middle: Floats, high: Floats) -> Floats:
    """Maxima of |H| between the ends of intervals in whose middle it is larger than at both, (P,)."""
    part = np.linspace(0.0, 1.0, 4)
    for _ in range(4):
        left, right = (middle - low)[:, None] * part, (high - middle)[:, None] * part[1:]
        at = np.concatenate((low[:, None] + left, middle[:, None] + right), 1)
        size = np.abs(model.response(channel, at.ravel())).reshape(at.shape)
        best = np.clip(size.argmax(1), 1, at.shape[1] - 2)
        rows = np.arange(len(at))
        low, middle, high = at[rows, best - 1], at[rows, best], at[rows, best + 1]
    return _level(model, channel, low, high)


def _level(model: Model, channel: int, low: Floats, high: Floats) -> Floats:
    """Zeros of the slope of |H| between ends where it rises and falls, by the Illinois method."""

    def rise(omega: Floats) -> Floats:
        H, slope = model.slope(channel, omega)
        return np.asarray((np.conj(H) * slope).real / np.abs(H) ** 2)

    a, b, fa, fb = low, high, rise(low), rise(high)
    for _ in range(40):  # four or five are usual: each two double the digits
        with np.errstate(all="ignore"):
            c = np.where(fa - fb == 0, (a + b) / 2, (a * fb - b * fa) / (fb - fa))
        c = np.where((c > np.minimum(a, b)) & (c < np.maximum(a, b)), c, (a + b) / 2)
        step, fc = np.abs(c - b), rise(c)
        has_crossed = fc * fb <= 0
        a, fa = np.where(has_crossed, b, a), np.where(has_crossed, fb, fa / 2)
        b, fb = c, fc
        if np.all((step <= 2 * np.finfo(float).eps * np.abs(b)) | (fc == 0)):
            break
    return b
