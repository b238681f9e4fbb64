"""Fits of synthetic records: how often 95 % intervals hold the truth, and whether what is undetermined is named.

    python benchmarks/identification.py --scenes 200

Every scene is random: 1 to 4 links, on and off a cart, viscous and dry friction; its records have noise of 1e-4 to 1e-2
rad, the steps of a 12-bit encoder, offsets and delays.  The fit begins with numbers that are wrong by some 10 %.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace

import numpy as np
from tqdm import tqdm

from modal.errors import MultipendulaError
from modal.identification import find_parameters, numbers_at, scene_with
from modal.scene import Scene, scene_from
from modal.scene.parameters import number_at
from modal.types import Floats
from nonlinear.identification import Fit, Recording, Segment, Sensor, fit
from nonlinear.identification.problem import FitProblem

SEED = 2210
BITS = 12
STEP = 2 * np.pi / 2**BITS
WRONG = 0.1  # standard deviation of ln p of the numbers that a fit begins with
INTERVAL = 1.96
LARGEST = 5.0  # power of a held number that another makes up for


def random_scene(rng: np.random.Generator) -> Scene:
    """A scene of 1 to 4 links with viscous and in half of the cases dry friction."""
    links, on_cart, dry = int(rng.integers(1, 5)), rng.random() < 0.5, rng.random() < 0.5
    chain = []
    for _ in range(links):
        mass, length = rng.uniform(0.5, 2.0), rng.uniform(0.2, 0.5)
        loss = mass * length**1.5 * 9.81**0.5
        link = {"kind": str(rng.choice(["bob", "rod"])), "mass": mass, "length": length}
        link["damping"] = 10 ** rng.uniform(-3, -1.7) * loss
        if dry:
            link["friction"] = 10 ** rng.uniform(-3, -2) * mass * 9.81 * length
        chain.append(link)
    support = {"kind": "fixed"}
    if on_cart:
        support = {"kind": "cart", "mass": rng.uniform(2, 10), "stiffness": rng.uniform(20, 200), "damping": 0.5}
    return scene_from({"gravity": 9.81, "support": support, "pendulum": [{"links": chain}]})


def record(scene: Scene, rng: np.random.Generator) -> Recording:
    """A recording of the scene's motion."""
    links = scene.n_links
    sensors = tuple(Sensor(1, k + 1) for k in range(links))
    times = np.arange(0, rng.uniform(3, 5), 0.01)
    count = int(rng.integers(1, 3))
    blank = tuple(Segment("synthetic", str(s), times, np.zeros((len(times), links))) for s in range(count))
    problem = FitProblem(scene, (), Recording(sensors, blank), np.ones(links), tolerance=1e-10)
    layout, half = problem.layout, problem.coordinates
    u = np.zeros(layout.size)
    for s in range(count):
        state = np.zeros(layout.width)
        state[half - links : half] = rng.normal(0, 0.3, links)
        state[2 * half - links :] = rng.normal(0, 0.5, links)
        u[layout.state(s)] = state
    u[layout.offsets] = rng.normal(0, 0.01, links)
    u[layout.delays] = np.concatenate(([0.0], rng.uniform(-0.3, 0.9, links - 1) * problem.late))
    noise = 10 ** rng.uniform(-4, -2)
    segments = []
    for segment, values in zip(blank, problem.readings(u), strict=True):
        noisy = values + rng.normal(0, noise, values.shape)
        segments.append(replace(segment, values=np.round(noisy / STEP) * STEP))
    return Recording(sensors, tuple(segments))


def free_of(scene: Scene) -> list[str]:
    """Every length, mass, damper and friction, and the cart's: one direction, the common scale, is undetermined."""
    free = ["pendulum[0].links[*].length", "pendulum[0].links[*].mass", "pendulum[0].links[*].damping"]
    if any(link.friction for link in scene.links()):
        free.append("pendulum[0].links[*].friction")
    if scene.support.kind == "cart":
        free += ["support.mass", "support.stiffness", "support.damping"]
    return free


def pulls_of(scene: Scene, fitted: Fit) -> Floats:
    """Errors of the fitted numbers over their standard deviations.

    A held number stays at its wrong value, and the others make up for it as the fit's sentences say.
    """
    true = {parameter.path: number_at(scene, parameter.place) for parameter in fitted.parameters}
    off = {parameter.held: fitted.given_at(parameter.held) / true[parameter.held] for parameter in fitted.undetermined}
    pulls = []
    for k in fitted.fitted:
        path = fitted.parameters[k].path
        powers = [np.clip(parameter.changes.get(path, 0.0), -LARGEST, LARGEST) for parameter in fitted.undetermined]
        made_up = np.prod(
            [off[parameter.held] ** power for parameter, power in zip(fitted.undetermined, powers, strict=True)]
        )
        pulls.append((fitted.values[k] - true[path] * made_up) / fitted.stds[k])
    return np.array(pulls)


def wrong(scene: Scene, rng: np.random.Generator) -> Scene:
    """The scene with other numbers at the places that are freed."""
    parameters = find_parameters(scene, free_of(scene))
    z = np.array(
        [parameter.start + rng.normal(0, WRONG) * (1 if parameter.log else parameter.start) for parameter in parameters]
    )
    return scene_with(scene, numbers_at(parameters, z))


def judged(number: int) -> tuple[Floats, bool, float]:
    """The pulls of one random scene, whether its undetermined scale was named, and the seconds taken."""
    rng = np.random.default_rng([SEED, number])
    scene = random_scene(rng)
    recording = record(scene, rng)
    begun = time.process_time()
    fitted = fit(wrong(scene, rng), recording, free_of(scene))
    named = any("mass" in direction.words for direction in fitted.undetermined)
    return pulls_of(scene, fitted), named, time.process_time() - begun


def main() -> None:
    """Print the shares."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--verbose", action="store_true", help="the errors over standard deviations of every scene")
    options = parser.parse_args()
    pulls, numbers, named, seconds, failed = [], [], 0, 0.0, []
    for number in tqdm(range(options.first, options.first + options.scenes)):
        try:
            errors, was_named, took = judged(number)
        except MultipendulaError as error:
            failed.append(f"{number}: {error}")
            continue
        pulls.append(errors)
        numbers.append(number)
        named += was_named
        seconds += took
        if options.verbose:
            print(number, was_named, f"{took:.1f} s", np.round(errors, 2).tolist(), file=sys.stderr, flush=True)
    every = np.concatenate(pulls)
    held = np.mean(np.abs(every) < INTERVAL)
    worst = [number for number, errors in zip(numbers, pulls, strict=True) if np.abs(errors).max() > 5]
    print(f"{options.scenes} scenes, {len(every)} fitted numbers: {100 * held:.1f} % of 95 % intervals hold the truth")
    print(f"the common scale of masses was named in {named} of {len(pulls)}; {seconds / len(pulls):.1f} s each")
    print(f"beyond 5 standard deviations: scenes {worst}; failed: {failed}")


if __name__ == "__main__":
    main()
