"""Fits of synthetic records by every kind of sensor: how often 95 % intervals hold the truth.

    python benchmarks/sensors.py --seeds 100

Each record is integrated by SciPy from equations written out by hand (`tests/identification/test_sensors.py`), a bob on
a fixed support or two on a cart, with white noise, an unknown offset of every sensor and the delays of those behind the
first.  The fit begins with lengths and dampers that are wrong by several percent.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np
from tqdm import tqdm

from modal.errors import MultipendulaError
from modal.types import Floats
from nonlinear.identification import fit, read_recording

sys.path += [str(Path(__file__).parents[1] / "tests" / folder) for folder in ("identification", "support")]

from test_sensors import DAMPERS, LENGTHS, oracle, scene_of

INTERVAL = 1.96
PIXEL = 0.002
LATEST = 0.01
"""Physics: the longest delay (s) of a sensor, which is below a tenth of sqrt(l/g)."""
KINDS = {
    "gyro": ["theta_dot_1_1_deg_per_s"],
    "accelerometer along": ["acceleration_along_1_1_m_per_s2@0.2"],
    "accelerometer across": ["acceleration_across_1_1_m_per_s2@0.2"],
    "phone": [
        "acceleration_along_1_1_m_per_s2@0.2",
        "acceleration_across_1_1_m_per_s2@0.2",
        "theta_dot_1_1_deg_per_s",
    ],
    "mark": ["x_1_1_m", "y_1_1_m"],
    "mark in pixels": ["x_1_1_px"],
    "gyros on a cart": ["theta_dot_1_1_deg_per_s", "theta_dot_1_2_deg_per_s"],
    "marks on a cart": ["x_1_1_m", "x_1_2_m"],
    "angle between links": ["theta_1_1_rad", "theta_1_2_relative_rad"],
    "accelerometer and gyro on a cart": ["acceleration_across_1_2_m_per_s2@0.2", "theta_dot_1_1_deg_per_s"],
}
"""The sensors of each kind, the last four on two links and a cart."""


def signal(motion: object, column: str, t: Floats) -> tuple[Floats, float]:
    """What a column reads of a motion at times (s), and the standard deviation of its noise."""
    name, _, distance = column.partition("@")
    words = name.split("_")
    link = int(words[words.index("1") + 1])
    if name.startswith("theta_dot"):
        return np.degrees(motion.rate(t, link)), 0.5
    if name.startswith("acceleration"):
        return motion.force(t, link, float(distance))[("along", "across").index(words[1])], 0.05
    if "relative" in words:
        return motion.angle(t, link) - motion.angle(t, link - 1), 2e-3
    if name.startswith("theta"):
        return motion.angle(t, link), 2e-3
    place = motion.point(t, link, LENGTHS[link - 1])["xy".index(words[0])]
    return (place / PIXEL, 1.0) if name.endswith("_px") else (place, 2e-3)


def pulls_of(kind: str, seed: int) -> Floats:
    """Errors over standard deviations of the lengths and dampers of one record."""
    columns, rng = KINDS[kind], np.random.default_rng(seed)
    links = 2 if kind.endswith(("cart", "links")) else 1
    angles = rng.choice([-1, 1], links) * rng.uniform(0.2, 0.8, links)
    begun = [*([rng.normal(0, 0.02)] if links > 1 else []), *angles]
    begun += [*([rng.normal(0, 0.1)] if links > 1 else []), *rng.normal(0, 0.7, links)]
    motion, t = oracle(begun, 3.1), np.arange(0.0, 3.0, 0.02)
    record = {"time_s": t}
    for k, column in enumerate(columns):
        delay = rng.uniform(0, LATEST) if k else 0.0
        values, noise = signal(motion, column, t - delay)
        record[column] = values + rng.normal(0, 5 * noise) + rng.normal(0, noise, len(t))
    recording = read_recording(scene_of(links), [record], pixel=PIXEL)
    free = ["pendulum[0].links[*].length", "pendulum[0].links[*].damping"]
    fitted = fit(scene_of(links, 1 + rng.choice([-1, 1]) * 0.05), recording, free)
    if not fitted.fits:
        raise MultipendulaError(fitted.verdict[0])
    truth = np.array([*LENGTHS[:links], *DAMPERS[:links]])
    return ((fitted.values - truth) / fitted.stds)[fitted.fitted]


def main() -> None:
    """Print the shares."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--kind", choices=KINDS, help="one kind alone")
    options = parser.parse_args()
    for kind in [options.kind] if options.kind else KINDS:
        pulls, failed, begun = [], [], time.process_time()
        for seed in tqdm(range(options.seeds), leave=False):
            try:
                pulls.append(pulls_of(kind, seed))
            except MultipendulaError as error:
                failed.append(f"{seed}: {error}")
        numbers = np.concatenate(pulls) if pulls else np.zeros(0)
        held = float(np.mean(np.abs(numbers) < INTERVAL)) if len(numbers) else 0.0
        seconds = (time.process_time() - begun) / options.seeds
        print(f"{kind}: {held:.3f} of {len(numbers)} intervals hold the truth; {seconds:.2f} s each", flush=True)
        if failed:
            print(f"  {len(failed)} failed: {failed[0]}", flush=True)


if __name__ == "__main__":
    main()
