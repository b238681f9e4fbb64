"""Frequency and impulse responses in closed form.

A block of two states with matrix A has (s − A)⁻¹ = (s + A − tr A)/(s² − s tr A + det A), so that

    G(s) = D + Σ_k (s N1_k + N0_k)/(s² + 2ζ_kω_k s + ω_k²),      N1 = C B,   N0 = C (A − tr A) B,

a rigid translation (ω = 0) among them; a non-oscillating mode, of one state, adds C B/(s − λ).  Far from the modes that
sum cancels, so that the frequency response of a whole model comes from elimination (`modal.statespace.frequency`), and
from the sum only where its poles lie.  In time, with a = tr A/2 and ν² = det A − a²,

    h(t) = D δ(t) + Σ_k e^{at} C [cos νt + (A − a) sin(νt)/ν] B,

where sin(νt)/ν is t for ν = 0 and a hyperbolic sine for ν² < 0.  (Ewins, Modal Testing, ch. 2.)
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from modal.report import as_csv, as_json, finite, grid, titled
from modal.scene import require, title_of
from modal.statespace.frequency import TOLERANCE, ExactResponse, is_whole
from modal.statespace.full_damping import is_small
from modal.statespace.modal_form import ModalBlock, ModalForm
from modal.types import Complexes, Floats

POINTS, LONGEST, ROWS = 2000, 20_000, 41
"""Fewest and most times of an impulse response, and those that are printed as text."""


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
    tolerance: float = TOLERANCE,
    remainder: Floats | None = None,
) -> Complexes:
    """G(iω) (p, m, W) at the angular frequencies ω (W,) in rad/s: output's unit over input's.

    Of these outputs and inputs (indices; by default all), each entry to a relative error of `tolerance` for the numbers
    of the scene as they are, however far ω is from the modes; with damping ratios, constant forces or inputs at points
    and more coordinates than `modal.statespace.full_damping.MOST` the sum over modes, to 1e-12 of its largest term.
    Infinite exactly at an undamped mode that the input reaches and the output sees, including ω = 0; with loss angles,
    which the modal form does not represent, from elimination alone.  `remainder` as in `ExactResponse.along`.
    """
    at, model = np.atleast_1d(np.asarray(omega, dtype=np.float64)), form.model
    rows = range(len(model.outputs)) if outputs is None else outputs
    columns = range(len(model.inputs)) if inputs is None else inputs
    read, driven = [model.outputs[k] for k in rows], [model.inputs[k] for k in columns]
    scene, chosen = model.scene or form.modes.scene, np.ix_(rows, columns)
    s = np.asarray(1j * at, dtype=np.complex128)
    eliminated = not is_whole(scene, driven) or is_small(scene) or scene.has_losses
    response = np.repeat(model.D[chosen][..., None], len(at), axis=2).astype(np.complex128)
    if eliminated:
        response = ExactResponse(scene, driven, read).along(at, tolerance, remainder)
    for term in terms(form):
        above, below = term._replace(N1=term.N1[chosen], N0=term.N0[chosen]).at(s)
        pole = below == 0
        if not eliminated:
            response += above / np.where(pole, 1.0, below)
        if not scene.has_losses:
            response[(above != 0) & pole & (not eliminated or at != 0)] = np.inf
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
    spread = None if std is None else std[:, source]
    signals, driven = form.model.outputs, form.model.inputs[source]
    if to == "json":
        rows: dict[str, Any] = {
            "input": driven.name,
            "unit": {signals[k].name: f"{signals[k].unit} per {driven.unit}" for k in outputs},
            "frequency_hz": list(frequencies),
            "magnitude": {signals[k].name: list(map(finite, size[k].tolist())) for k in outputs},
            "phase_deg": {signals[k].name: list(map(finite, phase[k].tolist())) for k in outputs},
        }
        if spread is not None:
            rows["magnitude_std"] = {signals[k].name: list(map(finite, spread[k].tolist())) for k in outputs}
        return as_json(rows)
    records = [
        {
            "frequency_hz": frequency,
            "output": signals[k].name,
            "unit": f"{signals[k].unit} per {driven.unit}",
            "magnitude": size[k, at],
            **({} if spread is None else {"magnitude_std": spread[k, at]}),
            "magnitude_db": decibel[k, at],
            "phase_deg": phase[k, at],
        }
        for k in outputs
        for at, frequency in enumerate(frequencies)
    ]
    if to == "csv":
        return as_csv(records)
    headings = ("f (Hz)", "output", "unit", "magnitude", *["±"] * (spread is not None), "dB", "phase (°)")
    cells = [[_shown(value) for value in record.values()] for record in records]
    what = f"response to {driven.name} ({driven.unit})"
    return titled(title_of(form.modes.scene), what, [grid(cells, headings)], "text")


def _shown(value: str | float) -> str:
    return value if isinstance(value, str) else f"{value:.6g}" if np.isfinite(value) else "–"


def impulse_times(form: ModalForm, duration: float | None = None) -> Floats:
    """Times (T,) in s that show every mode, from 0 to `duration` (default: four periods of the slowest oscillation)."""
    swinging = [value.imag for value in form.modes.eigenvalue.tolist() if value.imag > 0] or [1.0]
    end = duration or 8 * np.pi / min(swinging)
    return np.linspace(0.0, end, int(np.clip(40 * end * max(swinging) / (2 * np.pi), POINTS, LONGEST)))


def impulse_table(form: ModalForm, source: int, outputs: Sequence[int], to: str) -> str:
    """h(t) of some outputs for one input as "text" (ROWS times), "csv" or "json" (`impulse_times`)."""
    times = impulse_times(form)
    if to == "text":
        times = np.linspace(0.0, times[-1], ROWS)
    h, signals, driven = impulse_response(form, times)[:, source], form.model.outputs, form.model.inputs[source]
    units = {signals[k].name: f"{signals[k].unit} per {driven.unit} s" for k in outputs}
    if to == "json":
        values = {signals[k].name: list(map(finite, h[k].tolist())) for k in outputs}
        return as_json({"input": driven.name, "unit": units, "time_s": times.tolist(), "response": values})
    if to == "csv":
        names = ("time_s", "output", "unit", "response")
        every = ((t, signals[k].name, h[k, at]) for k in outputs for at, t in enumerate(times.tolist()))
        return as_csv([dict(zip(names, (t, name, units[name], value), strict=True)) for t, name, value in every])
    headings = ("t (s)", *(f"{name} ({unit})" for name, unit in units.items()))
    cells = [[f"{t:.6g}", *map(_shown, h[list(outputs), at].tolist())] for at, t in enumerate(times.tolist())]
    what = f"impulse response to {driven.name} ({driven.unit})"
    return titled(title_of(form.modes.scene), what, [grid(cells, headings)], "text")


def impulse_response(form: ModalForm, times: ArrayLike) -> Floats:
    """h(t) (p, m, T) just after and at times t ≥ 0 (T,) in s: output's unit over that of the input times a second.

    The impulse D δ(t) itself, for an output with direct feedthrough, is omitted.  SceneError with loss angles.
    """
    require(form.model.scene or form.modes.scene, "an impulse response")
    t = np.atleast_1d(np.asarray(times, dtype=np.float64))
    response = np.zeros((*form.model.D.shape, len(t)))
    for block, B, C in zip(form.blocks, form.inputs, form.outputs, strict=True):
        even, odd, a = _evolution(block, t)
        response += (C @ B)[..., None] * even + (C @ (block.A @ B - a * B))[..., None] * odd
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
