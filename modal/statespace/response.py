"""Frequency and impulse responses in closed form.

A block of two states with matrix A has (s − A)⁻¹ = (s + A − tr A)/(s² − s tr A + det A), so that

    G(s) = D + Σ_k (s N1_k + N0_k)/(s² + 2ζ_kω_k s + ω_k²),      N1 = C B,   N0 = C (A − tr A) B,

a rigid translation (ω = 0) among them; a non-oscillating mode, of one state, adds C B/(s − λ). Far from the modes this
sum cancels, so the frequency response of a whole model comes from elimination, and from
the sum only where its poles lie. In time, with a = tr A/2 and ν² = det A − a²,

    h(t) = D δ(t) + Σ_k e^{at} C [cos νt + (A − a) sin(νt)/ν] B,

where sin(νt)/ν is t for ν = 0 and a hyperbolic sine for ν² < 0.  (Ewins, Modal Testing, ch. 2.)

Peaks are looked for within some half-widths |Re λ| of Im λ, where λ is the eigenvalue of a mode, between ever closer
frequencies.  That of an undamped mode is infinite, at its own frequency.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from modal.assembly import CART, DRAG, JOINT, WIRE, Dissipator, LossAngles, Rig, loss_angles, rig_of
from modal.eigen import (
    FORCE,
    REPLICAS,
    TORQUE,
    TURN,
    Arithmetic,
    ChainResponse,
    Load,
    Rounded,
    cart_of,
    chain_response,
    precise_values,
)
from modal.errors import ComputationError
from modal.modes import mode_losses
from modal.report import NOTHING, as_csv, as_json, finite, grid, titled
from modal.scene import Scene, require, title_of
from modal.scene.signal_names import signal_label, signal_words, unit_words
from modal.statespace.modal_form import ModalBlock, ModalForm
from modal.statespace.signals import Signal, is_point
from modal.statespace.structural import is_small, whole_response
from modal.types import EPS, NUMBERS_IN_CHUNK, Complexes, Floats, Ints

GROUND, BASE, PUSH = "ground", "base", "push"


GIVEN = {
    "cart_force": (PUSH, 0),
    "torque": (TORQUE, 0),
    "force": (FORCE, 0),
    "cart_velocity": (BASE, 1),
    "cart_acceleration": (BASE, 2),
    "support_displacement": (GROUND, 0),
    "support_velocity": (GROUND, 1),
    "support_acceleration": (GROUND, 2),
}
READ = {
    "x": ("x", 0),
    "x_dot": ("x", 1),
    "theta": ("theta", 0),
    "theta_dot": ("theta", 1),
    "rel": ("rel", 0),
    "rel_dot": ("rel", 1),
    "joint": ("joint", 0),
    "tip": ("joint", 0),
    "tip_ddot": ("joint", 2),
    "pivot_force": ("pivot_force", 0),
}
NAME = re.compile(r"(\w+?)(?:_(\d+))?(?:_(\d+))?")
PAIRS = {JOINT: TORQUE, WIRE: TURN, DRAG: FORCE, CART: PUSH}
"""The name of the pair of forces of a dissipator, by its kind."""
TOLERANCE_OF_RESPONSE = 1e-12
"""Limit: relative error of every entry, the default of `tolerance`."""
STATIC_FREQUENCY = 2.0**-200
"""Tolerance: frequency that stands for 0, over that of the fastest link alone: its fourth power is still a float."""
Evaluate = Callable[[Arithmetic], Any]
FEWEST_TIMES = 2000
"""Format: fewest times of an impulse response that is computed for a figure or a file."""
MOST_TIMES = 20_000
"""Format: most times of a history that is computed for a figure or a file."""
ROWS_OF_HISTORY = 41
"""Format: times of an impulse response that is printed as text."""
HEADINGS = {
    "frequency_hz": "f (Hz)",
    "magnitude_std": "±",
    "magnitude_db": "dB",
    "phase_deg": "phase (°)",
}


class SignalPlace(NamedTuple):
    """The kind of a signal, the order of its derivative, and its pendulum and link, from 0."""

    what: str
    order: int
    pendulum: int = -1
    link: int = -1


def place_of(kinds: dict[str, tuple[str, int]], name: str, tips: Sequence[int]) -> SignalPlace:
    """Where a signal of this name is; `tips` are the last links of all pendula.  Raise KeyError for an unknown name."""
    match = NAME.fullmatch(name)
    if not match:
        raise KeyError(name)
    prefix, pendulum, link = match.groups()
    number = int(pendulum) - 1 if pendulum else -1
    return SignalPlace(*kinds[prefix], number, int(link) - 1 if link else tips[number] if pendulum else -1)


def place_of_input(driven: Signal | Dissipator, tips: Sequence[int]) -> SignalPlace:
    """Return where an input acts, possibly as a pair of forces. Raise KeyError for an unknown name."""
    if isinstance(driven, Dissipator):
        pendulum, link = -1, driven.number
        while link >= 0 and pendulum + 1 < len(tips):
            pendulum += 1
            if link <= tips[pendulum]:
                break
            link -= tips[pendulum] + 1
        return SignalPlace(PAIRS[driven.kind], 0, pendulum, link)
    return place_of(GIVEN, driven.name, tips)


class ExactResponse:
    """G between these signals of a scene of constant lengths, evaluated by elimination.

    A dissipator among the inputs is the pair of unit forces along its row. Raise KeyError for signals that are not
    those of `modal.statespace.signals`.
    """

    def __init__(self, scene: Scene, inputs: Sequence[Signal | Dissipator], outputs: Sequence[Signal]) -> None:
        angles = loss_angles(scene)
        rig, links = angles.rig_of(scene) if angles and not scene.is_structured else (rig_of(scene), [])
        tips = [rig.blocks[block].n - 1 for block, _, copies in rig.members for _ in range(copies)]
        needs_structure = needs_whole_structure(scene, inputs)
        self.is_real = not (rig.is_damped or scene.has_modal_damping or scene.has_losses)
        self.unit = float(np.sqrt(rig.gravity / min(float(block.length.min()) for block in rig.blocks)))
        if needs_structure:
            self._evaluate, of, to = whole_response(scene, inputs, outputs)
            orders = [[row.order - column.order for column in of] for row in to]
        else:
            driven = [place_of_input(signal, tips) for signal in inputs]
            places = [place_of(READ, signal.name, tips) for signal in outputs]
            self._evaluate = _from_tips(rig, driven, places, angles, links)
            orders = [[row.order - column.order for column in driven] for row in places]
        self._orders = np.array(orders)[..., None]
        width = sum(block.n * block.size for block in rig.blocks) * (1 + len(inputs)) + len(inputs) * len(outputs)
        width += (sum(tip + 1 for tip in tips) + rig.leading) ** 2 if needs_structure else 0
        self._step = max(1, NUMBERS_IN_CHUNK // width // (REPLICAS + 1))

    def response_at(
        self, omega: Floats, tolerance: float = TOLERANCE_OF_RESPONSE, remainder: Floats | None = None
    ) -> Complexes:
        """G(iω) (p, m, W) at ω (W,) in rad/s, each entry to this relative error.

        Positive frequencies may be given as sums of two floats: `remainder` (W,) is the part omitted by one float,
        which matters within some billionths of a resonance. At ω = 0 the limit, infinite if there is none.
        """
        is_static = omega == 0
        at = np.where(is_static, STATIC_FREQUENCY * self.unit, np.abs(omega))
        response = self._displacements(at, tolerance, is_real=self.is_real, remainder=remainder)
        with np.errstate(all="ignore"):
            response *= np.array([1, 1j, -1, -1j])[self._orders % 4] * np.float_power(at, self._orders)
        return _limits(np.where(omega < 0, np.conj(response), response), is_static, at)

    def at(self, s: Complexes, tolerance: float = TOLERANCE_OF_RESPONSE) -> Complexes:
        """G(s) (p, m, W) at s (W,) in 1/s, each entry to this relative error."""
        response = self._displacements(-1j * s, tolerance, is_real=False)
        return np.asarray(response * np.power(s, self._orders), dtype=np.complex128)

    def roughly_at(self, s: Complexes) -> tuple[Complexes, Floats]:
        """G(s) (p, m, W) in floats, and its rounding error."""
        with np.errstate(all="ignore"):
            values, errors = (numbers := Rounded(-1j * s)).results(self._evaluate(numbers))
            factor = np.power(s, self._orders)
            return values * factor, errors * np.abs(factor)

    def _displacements(
        self, omega: Floats | Complexes, tolerance: float, *, is_real: bool, remainder: Floats | None = None
    ) -> Complexes:
        """Displacements and forces for displacements and forces."""
        remainders = np.zeros(len(omega)) if remainder is None else remainder
        spans = [slice(first, first + self._step) for first in range(0, len(omega), self._step)]
        responses = [
            precise_values(self._evaluate, omega[s], is_real=is_real, tolerance=tolerance, remainder=remainders[s])
            for s in spans
        ]
        return (
            np.concatenate(responses, axis=-1) if responses else np.zeros((*self._orders.shape[:2], 0), np.complex128)
        )


def needs_whole_structure(scene: Scene, inputs: Sequence[Signal | Dissipator]) -> bool:
    """Whether a scene is eliminated as a whole for these inputs, and not from the tips of its pendula."""
    leans = "constant_force" in scene.features
    has_special_input = any(
        signal.kind not in PAIRS if isinstance(signal, Dissipator) else is_point(signal.name) for signal in inputs
    )
    return scene.is_structured or scene.has_modal_damping or leans or has_special_input


def _limits(response: Complexes, is_static: Any, at: Floats) -> Complexes:
    """At ω = 0 powers of the frequency that stands for it become 0 and infinity."""
    if is_static.any():
        size, edge = np.abs(response), np.sqrt(at)
        response = np.where(is_static & (size * edge > 1), np.inf, np.where(is_static & (size < edge), 0.0, response))
    return response


def _from_tips(
    rig: Rig,
    driven: Sequence[SignalPlace],
    outputs: Sequence[SignalPlace],
    angles: LossAngles | None,
    links: Sequence[Ints],
) -> Evaluate:
    """The evaluation (p, m, W) of displacements for displacements and forces; `links` are those of each block."""
    members = [(block, column) for block, column, copies in rig.members for _ in range(copies)]
    loads: list[list[Load]] = [
        sorted(
            {
                (place.what, place.link)
                for place in driven
                if place.pendulum >= 0 and members[place.pendulum][0] == number
            }
        )
        for number in range(len(rig.blocks))
    ]

    def evaluate(numbers: Arithmetic) -> Any:
        losses: list[Any] = (
            [angles.at(numbers.rates, of_block) for of_block in links] if angles else [None] * len(rig.blocks)
        )
        parts = zip(rig.blocks, loads, losses, strict=True)
        chains = [chain_response(block, of_block, rig.gravity, numbers, losses) for block, of_block, losses in parts]
        nothing = 0 * numbers.omega
        pivots = np.array([nothing + place for place in _pivots(rig, chains, driven, members, loads, numbers)])
        rows = []
        for row in outputs:
            if row.pendulum < 0:
                rows.append(pivots)
                continue
            block, column = members[row.pendulum]
            values = _output_of(chains[block], column, row, numbers)
            G = values[0] * pivots
            for k, place in enumerate(driven):
                if place.pendulum == row.pendulum:
                    G[k] = G[k] + values[1 + loads[block].index((place.what, place.link))]
            rows.append(G)
        return np.array(rows)

    return evaluate


def _pivots(
    rig: Rig,
    chains: Sequence[ChainResponse],
    driven: Sequence[SignalPlace],
    members: Sequence[tuple[int, int]],
    loads: Sequence[Sequence[Load]],
    numbers: Arithmetic,
) -> list[Any]:
    """The displacement of all pivots for every input."""
    base = any(place.what == BASE for place in driven)
    direct: Any = 0
    inertial: Any = 0
    ground: Any = 1
    if rig.cart and not base:
        counts = (numbers.number(block.count[:, None]) for block in rig.blocks)
        mass = np.sum([(count * place.mass).sum(0) for count, place in zip(counts, chains, strict=True)], axis=0)
        direct, inertial, ground = cart_of(rig.cart, mass, numbers)
    pivots: list[Any] = []
    for place in driven:
        if place.pendulum < 0:
            pivots.append({BASE: 1, GROUND: ground, PUSH: direct}[place.what])
            continue
        block, column = members[place.pendulum]
        load = loads[block].index((place.what, place.link))
        response = inertial * chains[block].inertial[column, load]
        pivots.append(response + direct * chains[block].direct[column, load] if place.what == FORCE else response)
    return pivots


def _output_of(chain: ChainResponse, column: int, row: SignalPlace, numbers: Arithmetic) -> Any:
    """An output for a displaced pivot, then for each load, (1 + L, W)."""
    if row.what == "pivot_force":
        square = numbers.omega * numbers.omega
        transmission = chain.direct[column] + square * chain.inertial[column]
        return numbers.round_off(np.concatenate([(square * chain.mass[column])[None], transmission]))
    if row.what == "joint":
        return chain.joints[row.link + 1, column]
    upper_angle = chain.angles[row.link - 1, column] if row.what == "rel" and row.link else 0
    return chain.angles[row.link, column] - upper_angle


class Term(NamedTuple):
    """The contribution of one mode to G: (N1 s + N0)/(c2 s² + c1 s + c0), N1, N0 (p, m); `mode` as in `ModalBlock`."""

    mode: int | None
    N1: Floats
    N0: Floats
    c: tuple[float, float, float]

    def at(self, s: Complexes) -> tuple[Complexes, Complexes]:
        """Numerators (p, m, W) and denominators (W,)."""
        c2, c1, c0 = self.c
        return self.N1[..., None] * s + self.N0[..., None], (c2 * s + c1) * s + c0


def terms(form: ModalForm) -> Iterator[Term]:
    """The contribution of each mode to G, one for each copy; one for a prescribed cart."""
    for block, B, C in zip(form.blocks, form.inputs, form.outputs, strict=True):
        A, trace = block.A, float(np.trace(block.A))
        if len(A) == 1:
            yield Term(block.mode, 0 * C @ B, C @ B, (0.0, 1.0, -trace))
        else:
            determinant = float(A[0, 0] * A[1, 1] - A[0, 1] * A[1, 0])
            yield Term(block.mode, C @ B, C @ (A @ B - trace * B), (1.0, -trace, determinant))


def frequency_response(
    form: ModalForm,
    omega: ArrayLike,
    *,
    outputs: Sequence[int] | None = None,
    inputs: Sequence[int] | None = None,
    tolerance: float = TOLERANCE_OF_RESPONSE,
    remainder: Floats | None = None,
) -> Complexes:
    """G(iω) (p, m, W) at the angular frequencies ω (W,) in rad/s: output's unit over input's.

    Of these outputs and inputs (indices; by default all), each entry to a relative error of `tolerance` for the numbers
    of the scene as they are, however far ω is from the modes; with damping ratios, constant forces or inputs at points
    and more coordinates than `modal.statespace.structural.MOST` the sum over modes, to 1e-12 of its largest term.
    Infinite exactly at a controllable and observable undamped mode, including ω = 0; with loss angles, which the modal
    form does not represent, from elimination alone. `remainder` as in `ExactResponse.along`.
    """
    at, model = np.atleast_1d(np.asarray(omega, dtype=np.float64)), form.model
    rows = range(len(model.outputs)) if outputs is None else outputs
    columns = range(len(model.inputs)) if inputs is None else inputs
    outputs_read, driven = [model.outputs[k] for k in rows], [model.inputs[k] for k in columns]
    scene, chosen = model.scene or form.modes.scene, np.ix_(rows, columns)
    s = np.asarray(1j * at, dtype=np.complex128)
    can_eliminate = not needs_whole_structure(scene, driven) or is_small(scene) or scene.has_losses
    is_eliminated = can_eliminate and not scene.feedback
    response = np.repeat(model.D[chosen][..., None], len(at), axis=2).astype(np.complex128)
    if is_eliminated:
        response = ExactResponse(scene, driven, outputs_read).response_at(at, tolerance, remainder)
    for term in terms(form):
        numerator, denominator = term._replace(N1=term.N1[chosen], N0=term.N0[chosen]).at(s)
        pole = denominator == 0
        if not is_eliminated:
            response += numerator / np.where(pole, 1.0, denominator)
        if not scene.has_losses:
            response[(numerator != 0) & pole & (not is_eliminated or at != 0)] = np.inf
    return response


def response_table(
    form: ModalForm,
    frequencies: Sequence[float],
    source: int,
    outputs: Sequence[int],
    to: str,
    std: Floats | None = None,
) -> str:
    """Magnitude and phase of some outputs for one input at these frequencies (Hz), as "text", "csv" or "json".

    `std` (p, m, W) are standard deviations of the magnitudes, in columns of their own.  An undamped mode that is
    hit exactly has no finite magnitude: NaN, in JSON null.
    """
    G = frequency_response(form, 2 * np.pi * np.asarray(frequencies))[:, source]
    size = np.where(np.isfinite(G), np.abs(G), np.nan)
    phase = np.where(np.isfinite(G) & (G != 0), np.degrees(np.angle(G)), np.nan)
    with np.errstate(divide="ignore"):
        decibel = 20 * np.log10(size)
    spread = {} if std is None else {"magnitude_std": std[:, source]}
    signals, driven = form.model.outputs, form.model.inputs[source]
    if to == "json":
        values = {"magnitude": size, "phase_deg": phase, **spread}
        return as_json(
            {
                "input": driven.name,
                "unit": {signals[k].name: f"{signals[k].unit} per {driven.unit}" for k in outputs},
                "frequency_hz": list(frequencies),
                **{
                    key: {signals[k].name: list(map(finite, part[k].tolist())) for k in outputs}
                    for key, part in values.items()
                },
            }
        )
    values = {"magnitude": size, **spread, "magnitude_db": decibel, "phase_deg": phase}
    records = [
        {
            "frequency_hz": frequency,
            "output": signals[k].name,
            "unit": f"{signals[k].unit} per {driven.unit}",
            **{key: part[k, at] for key, part in values.items()},
        }
        for k in outputs
        for at, frequency in enumerate(frequencies)
    ]
    return signal_table(form, f"response to {signal_label(driven)}", records, to)


def signal_table(
    form: ModalForm, what: str, records: Sequence[dict[str, Any]], to: str, notes: Sequence[str] = ()
) -> str:
    """Records of one set of keys, outputs and their units among these, as "csv" or as text with this title."""
    if to == "csv":
        return as_csv(records)
    headings = [HEADINGS.get(key, key) for record in records[:1] for key in record]
    cells = [[_cell(key, value) for key, value in record.items()] for record in records]
    return titled(title_of(form.modes.scene), what, [grid(cells, headings), *notes], "text")


def _cell(key: str, value: Any) -> str:
    words = {"output": signal_words, "unit": unit_words}
    if key in words:
        return words[key](value)
    return NOTHING if np.isnan(value) else f"{value:.6g}".replace("inf", "∞")


def impulse_times(form: ModalForm, duration: float | None = None) -> Floats:
    """Times (T,) in s that show every mode, from 0 to `duration` (default: four periods of the slowest oscillation)."""
    swinging = [value.imag for value in form.modes.eigenvalue.tolist() if value.imag > 0] or [1.0]
    end = duration or 8 * np.pi / min(swinging)
    return np.linspace(0.0, end, int(np.clip(40 * end * max(swinging) / (2 * np.pi), FEWEST_TIMES, MOST_TIMES)))


def impulse_table(form: ModalForm, source: int, outputs: Sequence[int], to: str) -> str:
    """h(t) of some outputs for one input as "text" (ROWS_OF_HISTORY times), "csv" or "json" (`impulse_times`)."""
    times = impulse_times(form)
    if to == "text":
        times = np.linspace(0.0, times[-1], ROWS_OF_HISTORY)
    h, signals, driven = impulse_response(form, times)[:, source], form.model.outputs, form.model.inputs[source]
    units = {signals[k].name: f"{signals[k].unit} per {driven.unit} s" for k in outputs}
    if to == "json":
        values = {signals[k].name: list(map(finite, h[k].tolist())) for k in outputs}
        return as_json({"input": driven.name, "unit": units, "time_s": times.tolist(), "response": values})
    if to == "csv":
        names = ("time_s", "output", "unit", "response")
        records = ((t, signals[k].name, h[k, at]) for k in outputs for at, t in enumerate(times.tolist()))
        return as_csv([dict(zip(names, (t, name, units[name], value), strict=True)) for t, name, value in records])
    headings = ("t (s)", *(f"{signal_words(name)} ({unit_words(unit)})" for name, unit in units.items()))
    cells = [[f"{value:.6g}" for value in (t, *h[list(outputs), at].tolist())] for at, t in enumerate(times.tolist())]
    what = f"impulse response to {signal_label(driven)}"
    return titled(title_of(form.modes.scene), what, [grid(cells, headings)], "text")


def impulse_response(form: ModalForm, times: ArrayLike) -> Floats:
    """h(t) (p, m, T) just after and at times t ≥ 0 (T,) in s: output's unit over that of the input times a second.

    The impulse D δ(t) itself, for an output with direct feedthrough, is omitted.  SceneError with loss angles.
    """
    require(form.model.scene or form.modes.scene, "an impulse response")
    t = np.atleast_1d(np.asarray(times, dtype=np.float64))
    response = np.zeros((*form.model.D.shape, len(t)))
    for block, B, C in zip(form.blocks, form.inputs, form.outputs, strict=True):
        cosine, sine, a = _evolution(block, t)
        response += (C @ B)[..., None] * cosine + (C @ (block.A @ B - a * B))[..., None] * sine
    return response


def _evolution(block: ModalBlock, t: Floats) -> tuple[Floats, Floats, float]:
    """e^{at} cos νt and e^{at} sin(νt)/ν (T,), with a: e^{At} = the first + (A − a) times the second."""
    A = block.A
    a = float(np.trace(A)) / len(A)
    if len(A) == 1:
        return np.exp(a * t), 0 * t, a
    nu = np.sqrt(complex(A[0, 0] * A[1, 1] - A[0, 1] * A[1, 0] - a * a))
    odd = np.sin(nu * t) / nu if nu else t
    return np.exp(a * t) * np.cos(nu * t).real, np.exp(a * t) * np.real(odd), a


MOST_SLOW_MODES = 12
"""Format: modes whose peaks are printed, the slowest, as the heading says."""
MOST_OUTPUTS = 24
"""Limit: outputs whose peaks are printed, refused beyond."""
HALF_WIDTHS_OF_PEAK = 10.0
"""Tolerance: half-widths of a mode within which its peak is looked for."""
POINTS_OF_PEAK = 24
"""Cost: frequencies at once, of which the three around the highest bound the next, closer ones."""


def peaks_table(form: ModalForm, source: int, outputs: Sequence[int], to: str) -> str:
    """The peaks of some outputs for one input at the slowest modes, as "text", "csv" or "json".

    Infinite magnitudes are null in JSON and empty in CSV.
    """
    if len(outputs) > MOST_OUTPUTS:
        raise ComputationError(f"{len(outputs)} outputs: choose at most {MOST_OUTPUTS} with `outputs`")
    driven, records = form.model.inputs[source], list(_records(form, source, outputs))
    notes = [] if records else ["No output has a peak."]
    if any(np.isinf(record["magnitude"]) for record in records):
        notes.append("∞: an undamped mode; give its links or joints damping.")
    if to != "text":
        records = [{key: finite(value) for key, value in record.items()} for record in records]
    if to == "json":
        return as_json({"input": driven.name, "peaks": records})
    slowest = f" of the {MOST_SLOW_MODES} slowest modes" if len(_oscillating(form)) > MOST_SLOW_MODES else ""
    return signal_table(form, f"peaks of the response to {signal_label(driven)}{slowest}", records, to, notes)


def _records(form: ModalForm, source: int, outputs: Sequence[int]) -> Iterator[dict[str, Any]]:
    driven, losses = form.model.inputs[source], np.nan_to_num(mode_losses(form.modes))
    rows = _oscillating(form)[:MOST_SLOW_MODES]
    if not rows:
        return
    poles = form.modes.eigenvalue[rows]
    widths = np.abs(poles.real) + losses[rows] * poles.imag / 2
    aside = np.geomspace(1 / HALF_WIDTHS_OF_PEAK, HALF_WIDTHS_OF_PEAK, POINTS_OF_PEAK)
    aside = np.concatenate((-aside, [0.0], aside))
    close_points = (poles.imag[:, None] + widths[:, None] * aside).ravel()
    between = np.geomspace(poles.imag.min() / 2, poles.imag.max() * 2, POINTS_OF_PEAK)
    omega = np.unique(np.concatenate((between, close_points[close_points > 0])))

    def size(k: int, at: Floats) -> Floats:
        return np.asarray(np.abs(frequency_response(form, at, outputs=[k], inputs=[source])[0, 0]))

    for k in outputs:
        for at, height in _peaks(lambda at, k=k: size(k, at), omega):  # type: ignore[misc]
            yield {
                "output": form.model.outputs[k].name,
                "unit": f"{form.model.outputs[k].unit} per {driven.unit}",
                "frequency_hz": at / (2 * np.pi),
                "magnitude": height,
                "magnitude_db": 20 * np.log10(height),
            }


def _peaks(size: Callable[[Floats], Floats], omega: Floats) -> Iterator[tuple[float, float]]:
    """Where a magnitude is larger than to either side, found between the frequencies next to it, and how large."""
    heights = size(omega)
    for k in np.flatnonzero((heights[1:-1] > heights[:-2]) & (heights[1:-1] >= heights[2:])) + 1:
        low, at, high, height = omega[k - 1], omega[k], omega[k + 1], heights[k]
        drop = height
        while np.isfinite(height) and drop > TOLERANCE_OF_RESPONSE * height and high - low > 4 * EPS * high:
            inner = np.linspace(low, high, POINTS_OF_PEAK)
            values = size(inner)
            best = int(np.clip(values.argmax(), 1, POINTS_OF_PEAK - 2))
            low, at, high = inner[best - 1 : best + 2]
            height = values[best]
            drop = height - values[[best - 1, best + 1]].min()
        yield float(at), float(height)


def _oscillating(form: ModalForm) -> list[int]:
    """The rows of modes that oscillate, of each frequency the first."""
    rates = form.modes.eigenvalue
    return [row for row in range(len(rates)) if rates[row].imag > 0 and (row == 0 or rates[row] != rates[row - 1])]
