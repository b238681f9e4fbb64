"""Thermal noise of a scene: fluctuations of every output due to dampers and loss angles at a temperature T.

Each dissipator along a row r, with the coefficient c_j = d + k φ/ω, pushes along its row with a force of the one-sided
PSD 4 k_B T c_j (the fluctuation-dissipation theorem: [Callen1951]), so that

    S_y(f) = 4 k_B T Σ_j c_j(ω) |H_yj(ω)|²,        = 4 k_B T |Im H_xF|/ω   of a displacement x,

which by reciprocity is a sum of (Im k_j) |Δ_j|² over the elongations Δ_j for a force on x: positive terms, where
Im H_xF would cancel for small losses.  H comes from elimination (`modal.statespace.response`), to 13 digits at any
frequency.
For dampers alone ∫ S_x df = k_B T (K⁻¹)_xx; with a constant loss angle the integral grows without bound towards 0 Hz.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import isfinite, tau

import numpy as np
from numpy.typing import ArrayLike

from modal.assembly import Dissipator, dissipators_of
from modal.errors import ComputationError, SceneError
from modal.modes import natural_modes
from modal.scene import Scene, require
from modal.scene.doors import checked
from modal.statespace import state_space, to_modal_form
from modal.statespace.response import ExactResponse
from modal.statespace.structural import MOST_IN_DIGITS, is_small
from modal.types import Complexes, Floats
from modal.vibration.random import ERROR_UNDER_INTEGRAL, ModalResponse, nodes, poles_of

BOLTZMANN = 1.380649e-23
"""Physics: k_B in J/K, exact in the SI (BIPM, The International System of Units, 9th edition, §2.2)."""
USUAL = ("tip_positions",)
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
def thermal_noise(scene: Scene, temperature: float, outputs: tuple[str, ...] = USUAL) -> ThermalNoise:
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
    if problems:
        raise SceneError(problems)
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
