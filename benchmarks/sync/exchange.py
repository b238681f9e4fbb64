"""Paper 000's cart: the periods with which one double pendulum gives its energy to the other, in the full simulator.

    python benchmarks/sync/exchange.py [--quick]

One pendulum of the shipped scene `paper-cart-2` is released at a small angle, the other hangs.  Each pendulum's motion
is projected on its fixed-base modes, φ_rᵀAφ_s = δ_rs: with η_r = φ_rᵀAθ

    E_r = (η_r'² + ω_r² η_r²)/2,       share of the second pendulum  s_r = E_r2/(E_r1 + E_r2) = (1 − cos Δω_r t)/2

in the family r, slow or fast, whose two modes are Δω_r apart.  s_r rises through one half once per period 2π/Δω_r.
"""

from __future__ import annotations

import argparse
import math

import numpy as np

from modal import Fixed, load, matrices, natural_modes
from modal.types import Floats
from nonlinear.integration import Trajectory
from nonlinear.integration.taylor import available
from nonlinear.simulation import simulate
from nonlinear.system import state_at_rest

FAMILIES = ("slow", "fast")
WINDOW_S = 6.0  # averaging window of shares: some periods of the slow family, little of an exchange


def tabled() -> Floats:
    """2π/Δω (s) of both families, from the table of modes, (2,)."""
    omega = natural_modes(load("paper-cart-2")).omega
    return np.asarray(2 * math.pi / (omega[[2, 4]] - omega[[1, 3]]))


def run(seconds: float, degrees: float) -> Trajectory:
    """One pendulum straight at this angle, the other hanging."""
    scene = load("paper-cart-2")
    start = state_at_rest(scene, [degrees, degrees, 0.0, 0.0])
    method = "taylor" if available() else "DOP853"
    return simulate(scene, seconds, method=method, tolerance=1e-12, start=start, output=int(20 * seconds) + 1)


def shares(trajectory: Trajectory) -> Floats:
    """The second pendulum's share of each family's energy, (2, T)."""
    scene = trajectory.scene
    alone = scene.replace(support=Fixed(), pendulum=scene.pendulum[:1])
    modes, A = natural_modes(alone), matrices(alone).M
    energies = []
    for r in range(2):
        shape = modes.shape(r).angles.real
        shape = shape / math.sqrt(shape @ A @ shape)
        each = [(trajectory.motion.links[:, k : k + 2], trajectory.motion.link_rates[:, k : k + 2]) for k in (0, 2)]
        energies.append([((v @ A @ shape) ** 2 + modes.omega[r] ** 2 * (q @ A @ shape) ** 2) / 2 for q, v in each])
    energy = np.array(energies)
    return np.asarray(energy[:, 1] / energy.sum(1))


def periods(trajectory: Trajectory) -> Floats:
    """Mean period (s) of the exchange in each family, (2,); NaN where fewer than two were seen."""
    width = round(WINDOW_S / (trajectory.times[1] - trajectory.times[0]))
    window = np.ones(width) / width
    times = np.convolve(trajectory.times, window, mode="valid")
    return np.array([_mean_period(times, np.convolve(share, window, mode="valid")) for share in shares(trajectory)])


def _mean_period(times: Floats, share: Floats) -> float:
    below, above = share[:-1] - 0.5, share[1:] - 0.5
    at = np.flatnonzero((below < 0) & (above >= 0))
    passed = times[at] - below[at] * (times[at + 1] - times[at]) / (above[at] - below[at])
    return float((passed[-1] - passed[0]) / (len(passed) - 1)) if len(passed) > 1 else math.nan


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--quick", action="store_true", help="two exchanges of the fast family instead of twenty")
    quick = parser.parse_args().quick
    print("release (°)  family    table (s)    simulated (s)   difference")
    for degrees in (1.0,) if quick else (0.5, 1.0, 2.0, 4.0):
        simulated = periods(run(800.0 if quick else 6500.0, degrees))
        for family, expected, period in zip(FAMILIES, tabled(), simulated, strict=True):
            print(f"{degrees:11g}  {family:6} {expected:12.3f} {period:16.3f} {100 * (period / expected - 1):10.2f} %")


if __name__ == "__main__":
    main()
