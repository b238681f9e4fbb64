"""The synchronization of a scene in numbers, units in the names."""

from __future__ import annotations

from math import degrees
from typing import Any

import numpy as np

from modal.errors import ComputationError
from modal.report import finite
from modal.scene import describe
from nonlinear.averaging import Prediction, RelativeEquilibrium
from nonlinear.postprocessing import last
from nonlinear.synchronization.modal_energy import Survival
from nonlinear.synchronization.patterns import agreement, own_amplitudes
from nonlinear.synchronization.phases import ENDING
from nonlinear.synchronization.study import SynchronizationStudy


def sync_record(found: SynchronizationStudy) -> dict[str, Any]:
    """What `json` writes: modes have their numbers in the table; null where there is no value."""
    theory = found.theory
    return {
        "scene": describe(found.scene),
        "configurations": [_configuration(one) for one in theory.configurations] if theory else None,
        "prediction": _prediction(theory.prediction) if theory else None,
        "no_prediction": found.silent or None,
        "simulation": _simulation(found),
        "agrees": found.agrees,
    }


def _configuration(one: RelativeEquilibrium) -> dict[str, Any]:
    eta = own_amplitudes(one)
    return {
        "mode": one.number,
        "family": one.averaged.modes[one.row].family,
        "pendula": agreement(one),
        "amplitudes_deg": np.rad2deg(np.abs(eta)).tolist(),
        "phases_deg": (np.rad2deg(np.angle(eta / eta[np.abs(eta).argmax()])) % 360).tolist(),
        "omega_rad_per_s": one.omega,
        "lasts": one.lasts,
        "growth_rate_per_s": finite(one.growth),
    }


def _prediction(prediction: Prediction) -> dict[str, Any]:
    return {
        "unstable": _configuration(prediction.unstable) if prediction.unstable else None,
        "dies_out": prediction.motion.dies,
        "survivor": None if prediction.motion.dies else prediction.number,
        "survivor_share": None if prediction.motion.dies else prediction.share,
        "certain": prediction.certain,
        "doubts": list(prediction.doubts),
        "locking_time_s": prediction.locking_time(),
        "locking_time_doubts": list(prediction.timing_doubts),
        "largest_angle_deg": degrees(prediction.averaged.largest(prediction.motion.z[:, -1])),
    }


def _simulation(found: SynchronizationStudy) -> dict[str, Any]:
    trajectory, phases = found.trajectory, found.phases
    late = last(trajectory.times, ENDING)
    return {
        "duration_s": float(trajectory.times[-1]),
        **(_survival(found.survival) if found.survival else {"no_modes": found.unmeasured}),
        "own_mode": phases.leading + 1,
        "order_parameter": float(phases.order[late, phases.leading].mean()),
        **_frequencies(found),
        "energy_of_pendula_J": phases.energy[late].mean(axis=0).tolist(),
        "kicks": len(trajectory.kicks.time),
        "energy_of_kicks_J": float(trajectory.kicks.energy.sum()),
        "work_J": float(trajectory.motion.work[-1]),
        "energy_drift": trajectory.energy_drift(),
    }


def _survival(survival: Survival) -> dict[str, Any]:
    try:
        return {
            "survivor": survival.number,
            "survivor_share": survival.survivor_share,
            "locking_time_s": survival.locking_time(),
        }
    except ComputationError as error:
        return {"survivor": None, "no_survivor": str(error)}


def _frequencies(found: SynchronizationStudy) -> dict[str, Any]:
    try:
        frequencies = found.phases.frequency.tolist()
    except ComputationError as error:
        return {"frequencies_rad_per_s": None, "no_frequencies": str(error)}
    return {"frequencies_rad_per_s": [finite(one) for one in frequencies], "locked": found.phases.locked}
