"""Stationary random vibration: of a scene whose support moves along the rail with a given PSD, and thermal noise.

With H the response of an output to the support's acceleration and S the one-sided PSD of that acceleration,

    S_y(f) = |H(2πi f)|² S(f)        RMS² = ∫ S_y df        RMS² of a mode alone = ∫ |H_r|² S df

H comes from elimination (`modal.statespace.response`), since the sum over its modes H_r cancels far from them, and the
integrals are taken by Gauss's rule on intervals that shrink towards every resonance, to nearly full precision however
sharp it is.  For white noise about a lightly damped
mode with H_r = (N1 s + N0)/(s² + 2ζω s + ω²) they are Miles' equation [Miles1954],

    RMS² ≈ S(ω/2π) (N0²/ω² + N1²) / (8 ζ ω),

of which the acceleration of an oscillator, √(π f Q S/2), is the best-known case.

Thermal noise is that of dampers and loss angles at a temperature T.  Each dissipator along a row r, with the
coefficient c_j = d + k φ/ω, pushes along its row with a force of the one-sided PSD 4 k_B T c_j (the
fluctuation-dissipation theorem: [Callen1951]), so that

    S_y(f) = 4 k_B T Σ_j c_j(ω) |H_yj(ω)|²,        = 4 k_B T |Im H_xF|/ω   of a displacement x,

which by reciprocity is a sum of (Im k_j) |Δ_j|² over the elongations Δ_j for a force on x: positive terms, where
Im H_xF would cancel for small losses.  H comes from elimination (`modal.statespace.response`), to 13 digits at any
frequency.
For dampers alone ∫ S_x df = k_B T (K⁻¹)_xx; with a constant loss angle the integral grows without bound towards 0 Hz.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby
from math import isfinite, tau
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from modal.assembly import Dissipator, dissipators_of, scene_squares
from modal.errors import ComputationError, SceneError, refuse_any
from modal.modes import MOST_LISTED, Modes, mode_losses, natural_modes
from modal.report import TextResult
from modal.scene import Scene, require
from modal.scene.doors import checked
from modal.scene.records import Spectrum
from modal.statespace import ModalForm, frequency_response, state_space, to_modal_form
from modal.statespace.geometry import geometry_of
from modal.statespace.modal_form import without_noise
from modal.statespace.response import ExactResponse, Term, terms
from modal.statespace.signals import EXAMPLES, Signal, is_point, own_inputs, push_of
from modal.statespace.structural import MOST_IN_DIGITS, is_small
from modal.types import EPS, Booleans, Complexes, Floats
from modal.vibration.prescribed import acceleration_psd, psd_at

USUAL = ("angles", "tip_accelerations")
INPUT = "support_acceleration"
NODES, WEIGHTS = np.polynomial.legendre.leggauss(16)
FREQUENCIES_AT_ONCE = 4096
"""Cost: nodes of an integral that are computed at once."""
ERROR_UNDER_INTEGRAL = 1e-10
"""Tolerance: relative error of H under an integral, which an RMS has too; 1e-11 takes five times as long."""
POWER_OF_DRIFT = -0.99
"""Tolerance: power of ω up to which an integral down to 0 is infinite: −1, as estimated from two low frequencies."""
MOST_TERMS = 5e6
"""Limit: modes, squared, times outputs, refused beyond."""
DIVERGES = "undamped and excited by the noise: the RMS grows without bound"
DRIFTS = "grows without bound: the PSD reaches down to 0 Hz, where this output drifts without limit"


def white_spectrum(scene: Scene, level: float) -> Spectrum:
    """A PSD of this level from a third of the frequency of the slowest mode to three times that of the fastest.

    Raise SceneError for a scene in which nothing oscillates.
    """
    rates = natural_modes(scene).eigenvalue.imag
    if not (rates > 0).any():
        raise SceneError(["no mode oscillates, and a white PSD needs their band"])
    ends = rates[rates > 0].min() / 3, rates.max() * 3
    return Spectrum((float(ends[0] / tau), float(ends[1] / tau)), (level, level), "acceleration")


@dataclass(frozen=True, eq=False, repr=False)
class ModalResponse(TextResult):
    """The response of p outputs, as a sum over the modes of `form`."""

    form: ModalForm

    @property
    def modes(self) -> Modes:
        """The modes of the scene."""
        return self.form.modes

    @property
    def outputs(self) -> tuple[Signal, ...]:
        """The outputs."""
        return self.form.model.outputs


@dataclass(frozen=True, eq=False, repr=False)
class RandomResponse(ModalResponse):
    """The response of some outputs (p of them) of a scene to a PSD of its support's motion, or of a force."""

    spectrum: Spectrum
    writer = "modal.vibration.report:random_report"

    @property
    def source(self) -> Signal:
        """The input: the support's acceleration, or a force."""
        return self.form.model.inputs[0]

    def input_psd(self, f: Floats) -> Floats:
        """The PSD of the input, (m/s²)²/Hz of the support's acceleration, at the frequencies f (W,) in Hz."""
        return input_psd(self.spectrum, self.source.name, np.asarray(f, dtype=float))

    def psd(self, f: Floats) -> Floats:
        """The PSD of every output, (p, W) in its unit squared per hertz."""
        H = frequency_response(self.form, tau * np.asarray(f, dtype=float))[:, 0]
        S = self.input_psd(f)
        return np.asarray(np.where(S > 0, np.abs(np.where(S > 0, H, 0.0)) ** 2 * S, 0.0))

    @cached_property
    def _terms(self) -> list[tuple[Term, complex]]:
        """Every term without rounding, and its pole in the upper half-plane, moved by loss angles."""
        losses = np.nan_to_num(mode_losses(self.modes))
        return [(term, _pole(term, 0.0 if term.mode is None else losses[term.mode])) for term in exact_terms(self.form)]

    @cached_property
    def rms(self) -> Floats:
        """The RMS of every output, (p,), infinite if it is."""
        return self._rms_values[0]

    @cached_property
    def by_mode(self) -> Floats:
        """The RMS that every mode alone would give, (R, p)."""
        return self._rms_values[1]

    @cached_property
    def white(self) -> Floats:
        """The same by Miles' equation, (R, p): NaN for modes that do not oscillate."""
        rms = np.full(self.by_mode.shape, np.nan)
        for number in range(len(rms)):
            terms = [(term, pole) for term, pole in self._terms if term.mode == number]
            if not terms or not terms[0][1].imag > 0:
                continue
            omega, decay = abs(terms[0][1]), abs(terms[0][1].real)
            N1, N0 = (sum(getattr(term, name)[:, 0] for term, _ in terms) for name in ("N1", "N0"))
            S = float(self.input_psd(np.array([omega / tau]))[0])
            with np.errstate(all="ignore"):
                mean_square = S * ((N0 / omega) ** 2 + N1**2) / (8 * decay)
            rms[number] = np.where(mean_square > 0, np.sqrt(mean_square), 0.0)
        return rms

    @cached_property
    def words(self) -> tuple[str, ...]:
        """Why some outputs have no finite RMS."""
        endless = np.isinf(self.by_mode)
        words = []
        for k in np.flatnonzero(np.isinf(self.rms)).tolist():
            numbers = np.flatnonzero(endless[:, k]) + 1
            mode_list = ", ".join(map(str, numbers[:MOST_LISTED].tolist()))
            mode_list += f" and {len(numbers) - MOST_LISTED} more" if len(numbers) > MOST_LISTED else ""
            which = f"mode {mode_list} is {DIVERGES}" if len(numbers) == 1 else f"modes {mode_list} are {DIVERGES}"
            words.append(f"{self.outputs[k].name}: {which if len(numbers) else DRIFTS}")
        return tuple(words)

    @cached_property
    def _rms_values(self) -> tuple[Floats, Floats]:
        """RMS of the outputs and of each mode alone."""
        p, R = len(self.outputs), len(self.modes)
        total, mode_squares = np.zeros(p), np.zeros((R, p))
        endless = np.zeros((R, p), dtype=bool)
        for low, high in stretches(self.spectrum):
            excitable = [(term, pole) for term, pole in self._terms if term.N0.any() or term.N1.any()]
            for term, pole in excitable:
                if term.mode is not None and pole.imag > 0 and pole.real == 0 and low <= pole.imag <= high:
                    endless[term.mode] |= _outputs_of_mode(self._terms, term.mode)
            poles = [pole for _, pole in excitable if not (pole.real == 0 and low <= pole.imag <= high)]
            for omega, remainder, weight in nodes(low, high, poles):
                S = weight * self.input_psd(omega / tau) / tau
                for mode, response in self._responses(omega, remainder):
                    if mode is not None:
                        mode_squares[mode] += (np.abs(response) ** 2) @ S
                H = frequency_response(self.form, omega, tolerance=ERROR_UNDER_INTEGRAL, remainder=remainder)[:, 0]
                total += np.where(np.isfinite(H), np.abs(H) ** 2, 0.0) @ S
        output_rms, parts = np.sqrt(total), np.sqrt(mode_squares)
        parts[endless] = np.inf
        output_rms[endless.any(0) | self._drifting()] = np.inf
        return output_rms, parts

    def _drifting(self) -> Booleans:
        """Which outputs have an infinite integral down to 0 Hz, (p,)."""
        f, psd = self.spectrum.frequency_hz, self.spectrum.psd
        if f[0] > 0 or not (psd[0] > 0 or psd[1] > 0):
            return np.zeros(len(self.outputs), dtype=bool)
        low_frequencies = np.array([1e-7, 1e-6]) * f[1]
        size = self.psd(low_frequencies)
        with np.errstate(all="ignore"):
            power = np.log10(size[:, 1] / size[:, 0])
        return np.asarray((size[:, 0] > 0) & (power <= POWER_OF_DRIFT))

    def _responses(self, omega: Floats, remainder: Floats) -> Iterator[tuple[int | None, Complexes]]:
        """The contribution of each mode to H at omega + remainder, (p, W); None for the support itself."""
        s = 1j * omega
        for mode, group in groupby(self._terms, key=lambda entry: entry[0].mode):
            response = np.zeros((len(self.outputs), len(s)), dtype=np.complex128)
            for term, pole in group:
                twice = term.c[0] == 1.0
                lossy = self.modes.scene.has_losses
                second_pole = (-term.c[1] - pole) if twice and (lossy or not pole.imag) else np.conj(pole)
                denominator = 1j * ((omega - pole.imag) + remainder) - pole.real
                denominator = denominator * (s - second_pole) if twice else denominator
                response += (term.N1[:, :1] * s + term.N0[:, :1]) / denominator
            yield mode, response


def input_psd(spectrum: Spectrum, source: str, f: Floats) -> Floats:
    """The PSD of an input at the frequencies f (W,) in Hz, of the support's motion that of its acceleration."""
    if source == INPUT:
        return acceleration_psd(spectrum, f)
    return psd_at(np.array(spectrum.frequency_hz), np.array(spectrum.psd), f)


def stretches(spectrum: Spectrum) -> Iterator[tuple[float, float]]:
    """The intervals (rad/s) between points of a PSD in which it is not zero."""
    f, psd = np.array(spectrum.frequency_hz), np.array(spectrum.psd)
    for k in np.flatnonzero((psd[1:] > 0) | (psd[:-1] > 0)).tolist():
        yield tau * f[k], tau * f[k + 1]


def exact_terms(form: ModalForm) -> Iterator[Term]:
    """The terms of H for the one input, zero if it does not reach or an output does not see a mode.

    Otherwise the rounding of an unexcited mode would ring forever.  A mode φ is reached by pᵀφ, with p the
    generalized force, or for the support's acceleration the momentum or the windage of everything at unit velocity.
    """
    modes, name = form.modes, form.model.inputs[0].name
    shaken = int(name == INPUT)
    if shaken:
        squares = scene_squares(modes.rig)
        p = np.column_stack([squares.momentum, squares.windage])
    else:
        p = push_of(modes.scene, geometry_of(modes.scene), name).F[:, :1]
    for block, term in zip(form.blocks, terms(form), strict=True):
        phi = block.right[shaken : len(p) + shaken]
        is_excitable = block.mode is None or bool(np.any(without_noise(phi.T, p)))
        is_visible = np.any(np.atleast_2d(without_noise(block.right.T, form.model.C.T)), axis=0).astype(float)
        yield term._replace(
            N1=term.N1 * is_visible[:, None] * is_excitable, N0=term.N0 * is_visible[:, None] * is_excitable
        )


def _outputs_of_mode(terms: list[tuple[Term, complex]], mode: int) -> Booleans:
    """The outputs to which a mode contributes, (p,)."""
    is_present = [(term.N0[:, 0] != 0) | (term.N1[:, 0] != 0) for term, _ in terms if term.mode == mode]
    return np.asarray(np.any(is_present, axis=0))


def poles_of(form: ModalForm) -> list[complex]:
    """The pole of every term of a modal form in the upper half-plane, moved by loss angles."""
    losses = np.nan_to_num(mode_losses(form.modes))
    return [_pole(term, 0.0 if term.mode is None else losses[term.mode]) for term in terms(form)]


def _pole(term: Term, loss: float = 0.0) -> complex:
    """The pole of a term, of two conjugate ones the upper, of two real ones the larger; its loss angle moves it."""
    c2, c1, c0 = term.c
    if not c2:
        return complex(-c0)
    a = -c1 / 2
    nu = c0 - a * a
    if loss:
        return complex(a + 1j * np.sqrt(complex(nu, loss * c0)))
    return complex(a, nu**0.5) if nu > 0 else complex(a + (-nu) ** 0.5)


def nodes(low: float, high: float, poles: list[complex]) -> Iterator[tuple[Floats, Floats, Floats]]:
    """Nodes and weights of Gauss's rule from `low` to `high`, on intervals that shrink towards poles, in blocks.

    A node is the sum of two floats: next to a resonance of Q = 10⁹ the rounding of one is 10⁻⁷ of its width.
    """
    edges = {(low, 0.0), (high, 0.0)}
    for pole in {*poles, 0j}:
        middle, width = pole.imag, abs(pole.real)
        width = max(width, low - middle, middle - high) / 2 or EPS**0.5 * high
        while width < high:
            edges |= {edge for edge in (_sum(middle, -width), _sum(middle, width)) if low < edge[0] < high}
            width *= 4  # an end this much further from a resonance than the other: Gauss errs by 3⁻³²
    ends, remainders = np.array(sorted(edges)).T
    half = (np.diff(ends) + np.diff(remainders)) / 2
    omega, remainder = _sum(ends[:-1, None], half[:, None] * (1 + NODES))
    remainder = (remainder + remainders[:-1, None]).ravel()
    omega, weight = omega.ravel(), np.outer(half, WEIGHTS).ravel()
    for at in range(0, len(omega), FREQUENCIES_AT_ONCE):
        part = slice(at, at + FREQUENCIES_AT_ONCE)
        yield omega[part], remainder[part], weight[part]


def _sum(a: Any, b: Any) -> tuple[Any, Any]:
    """The float next to a + b and its rounding error (Knuth, TAOCP 2, §4.2.2, theorem B)."""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


@checked
def random_response(
    scene: Scene, spectrum: Spectrum, outputs: tuple[str, ...] = USUAL, source: str = INPUT
) -> RandomResponse:
    """Compute the response of a scene to a PSD of its support's motion along the rail, at small angles.

    `outputs` are groups of `modal.statespace.signals.OUTPUTS`. Another `source` is "cart_force", on a structure the
    force on a coordinate, or an input at a point, as "force[0]" (`modal.statespace.signals`), of which the PSD is in
    N²/Hz or (N m)²/Hz. Raise ComputationError if a mode grows by itself, since the response is then not stationary, and
    the errors of `state_space` and `to_modal_form`.

    >>> from modal import load
    >>> from modal.scene.records import Spectrum
    >>> wind = Spectrum((0.1, 2.0), (1.0, 1.0), "acceleration")
    >>> scene = load("chain-1").replace(damping_ratio=0.02)
    >>> found = random_response(scene, wind, ("angles",), "force:pendulum[0].links[0]")
    >>> found.source.unit, found.rms.shape
    ('N', (1,))
    """
    names = (INPUT, *(own_inputs(geometry_of(scene)) or ("cart_force",)))
    if source not in {*names, "cart_force"} and not is_point(source):
        raise SceneError([f"input {source}: must be {', '.join(names)}, or {EXAMPLES}"])
    require(scene, "random vibration" if source == INPUT else "a frequency response")
    modes = natural_modes(scene)
    if growing := [number for number, value in enumerate(modes.eigenvalue.tolist(), 1) if value.real > 0]:
        raise ComputationError(f"mode {growing[0]} grows without being driven: there is no stationary random vibration")
    model = state_space(scene, (source,), tuple(outputs))
    if len(modes) ** 2 * len(model.outputs) > MOST_TERMS:
        sizes = f"{len(modes)} modes and {len(model.outputs)} outputs"
        raise ComputationError(
            f"{sizes}: modes² times outputs may be at most {MOST_TERMS:g}; choose fewer outputs with `outputs`"
        )
    return RandomResponse(to_modal_form(modes, model), spectrum)


BOLTZMANN = 1.380649e-23
"""Physics: k_B in J/K, exact in the SI (BIPM, The International System of Units, 9th edition, §2.2)."""
MOST_PAIRS = 20_000
"""Limit: dissipators times outputs, refused beyond."""
HIGHEST_TEMPERATURE = 1e6
"""Limit: kelvins, refused beyond: a number in another unit."""


@dataclass(frozen=True, eq=False, repr=False)
class ThermalNoise(ModalResponse):
    """The thermal noise of p outputs of a scene at a `temperature` (K), from its J `dissipators`."""

    scene: Scene
    temperature: float
    dissipators: tuple[Dissipator, ...]
    writer = "modal.vibration.report:thermal_report"

    @cached_property
    def places(self) -> tuple[str, ...]:
        """The places of dissipation in the scene, copies and repeated links together, in its order."""
        return tuple(dict.fromkeys(dissipator.place for dissipator in self.dissipators))

    @cached_property
    def _elimination(self) -> ExactResponse:
        return ExactResponse(self.scene, self.dissipators, self.outputs)

    def budget(self, f: ArrayLike, tolerance: float = 2e-14) -> Floats:
        """The PSD of every output from each of the `places`, (places, p, W) in its unit squared per hertz.

        At f = 0 that of dampers; infinite there with loss angles.  `tolerance` is the relative error of each response.
        """
        return self._budget(tau * np.atleast_1d(np.asarray(f, dtype=float)), tolerance)

    def _budget(self, omega: Floats, tolerance: float, remainder: Floats | None = None) -> Floats:
        """The same at omega + remainder (W,) in rad/s."""
        budget = np.zeros((len(self.places), len(self.outputs), len(omega)))
        if not self.dissipators:
            return budget
        H: Complexes = self._elimination.response_at(omega, tolerance, remainder)
        with np.errstate(all="ignore"):
            for j, dissipator in enumerate(self.dissipators):
                strength = 4 * BOLTZMANN * self.temperature * dissipator.strength(omega)
                budget[self.places.index(dissipator.place)] += np.where(
                    strength > 0, strength * np.abs(H[:, j]) ** 2, 0.0
                )
        return budget

    def psd(self, f: ArrayLike) -> Floats:
        """The PSD of every output, (p, W) in its unit squared per hertz, at the frequencies f (W,) in Hz."""
        return np.asarray(self.budget(f).sum(0))

    def asd(self, f: ArrayLike) -> Floats:
        """Its square root (p, W), the amplitude spectral density, in the unit per √Hz."""
        return np.sqrt(self.psd(f))

    def rms(self, low: float, high: float) -> Floats:
        """The RMS (p,) of every output from the noise between two frequencies (Hz)."""
        total = np.zeros(len(self.outputs))
        for omega, remainder, weight in nodes(tau * low, tau * high, poles_of(self.form)):
            total += self._budget(omega, ERROR_UNDER_INTEGRAL, remainder).sum(0) @ weight / tau
        return np.sqrt(total)


@checked
def thermal_noise(scene: Scene, temperature: float, outputs: tuple[str, ...] = ("tip_positions",)) -> ThermalNoise:
    """Compute the thermal noise of a scene at a temperature (K), at small angles about its equilibrium.

    `outputs` are groups of `modal.statespace.signals.OUTPUTS` but those of forces. Raise SceneError for a temperature
    that is none, outputs that are forces, and a scene without dampers, drag and loss angles; raise ComputationError if
    a mode grows by itself, and where too much would be computed.

    >>> from modal import Bob, Pendulum, Scene
    >>> scene = Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=40.0, length=0.6, wire_loss=1e-6)])])
    >>> found = thermal_noise(scene, 290.0)
    >>> [f"{value:.4e}" for value in found.asd([10.0, 100.0])[0]]
    ['2.5963e-18', '8.1765e-21']
    """
    problems = []
    if not (isfinite(temperature) and 0 < temperature <= HIGHEST_TEMPERATURE):
        problems.append(f"temperature {temperature:g}: must be above 0 K and at most {HIGHEST_TEMPERATURE:g} K")
    if "pivot_forces" in outputs or any(name.startswith("spring_force") for name in outputs):
        problems.append(
            "outputs: thermal noise is that of positions, angles, their rates and accelerations, not of forces"
        )
    refuse_any(problems)
    require(scene, "thermal noise")
    if not (scene.has_damping or scene.has_losses):
        raise SceneError(["thermal noise: nothing dissipates in this scene: give it dampers, drag, loss or wire_loss"])
    if scene.has_modal_damping and not is_small(scene):
        raise ComputationError(
            f"thermal noise: damping ratios of more than {MOST_IN_DIGITS} coordinates: give dampers instead"
        )
    modes = natural_modes(scene)
    if growing := [number for number, value in enumerate(modes.eigenvalue.tolist(), 1) if value.real > 0]:
        raise ComputationError(f"mode {growing[0]} grows without being driven: there is no thermal equilibrium")
    model = state_space(scene, outputs=outputs)
    dissipators = tuple(dissipators_of(scene))
    if len(dissipators) * len(model.outputs) > MOST_PAIRS:
        sizes = f"{len(dissipators)} places that dissipate and {len(model.outputs)} outputs"
        raise ComputationError(
            f"{sizes}: their product may be at most {MOST_PAIRS}; choose fewer outputs with `outputs`"
        )
    return ThermalNoise(to_modal_form(modes, model), scene, float(temperature), dissipators)
