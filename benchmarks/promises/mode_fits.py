"""Fits to measured modes and poles of clean swings: intervals hold the truth, and no mode is invented.

Lengths (and masses, where shapes are measured) of two or three bobs are fitted to their modes with noise drawn anew,
from a start that is wrong by a quarter; some lengths are nearly equal, where derivatives hardly distinguish them.  An
interval is 1.96 standard deviations to either side, of the fit or of another solution that it names, the one nearer
to the truth.  Of right intervals 5 % miss by chance, so misses are counted together.  Poles are those of nonlinear
swings of 2° to 3° without noise, of two or three links or of two pendula on a cart: the number of modes, and each
frequency that changes with amplitude.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from promise import Trial, attack

from modal.identification import MeasuredMode, MeasuredModes, ModeFit, fit_modes, identify
from modal.identification.measured import turned
from modal.modes import natural_modes
from modal.scene import Bob, Cart, Fixed, Pendulum, Scene
from modal.scene.parameters import find_places, number_at, vary
from nonlinear.simulation import simulate
from nonlinear.system import state_at_rest

FITS = 40  # intervals of how many fits are judged together
CHANCE = 1e-3  # of more misses than are promised, where the intervals are right
NEARLY_EQUAL, SHAPED = 0.3, 0.3  # parts of the scenes
SHAPE_STD, WRONG = 1e-3, 0.25
HARDLY = 5.0  # standard deviations


def bobs(masses: np.ndarray, lengths: np.ndarray, damping: float = 0.0) -> Pendulum:
    """One below the other."""
    return Pendulum(links=tuple(Bob(mass=m, length=l, damping=damping) for m, l in zip(masses, lengths, strict=True)))


def fitted(seed: int) -> tuple[Scene, ModeFit]:
    """A random scene, and the fit to its modes with noise."""
    rng = np.random.default_rng([1, seed])
    n = int(rng.integers(2, 4))
    masses, lengths = rng.uniform(0.1, 1, n), rng.uniform(0.2, 1, n)
    if rng.random() < NEARLY_EQUAL:
        lengths[1] = lengths[0] * (1 + rng.choice([-1, 1]) * 10 ** rng.uniform(-2.5, -0.5))
    scene, std = Scene(gravity=9.81, pendulum=(bobs(masses, lengths),)), 10 ** rng.uniform(-5, -2.5)
    shaped, modes, rows = rng.random() < SHAPED, natural_modes(scene), []
    for k, mode in enumerate(modes):
        frequency = mode.omega / (2 * np.pi)
        shape = turned(modes.matrix.shapes[:, k].astype(complex)).real
        shape = shape / np.abs(shape).max() + SHAPE_STD * rng.standard_normal(n)
        shape_of = (shape, SHAPE_STD) if shaped else (None, None)
        rows.append(MeasuredMode(mode.number, frequency * (1 + std * rng.standard_normal()), std * frequency))
        rows[-1] = MeasuredMode(rows[-1].number, rows[-1].frequency, rows[-1].std, None, None, *shape_of)
    measured = MeasuredModes("modes.csv", tuple(rows), tuple((1, k + 1) for k in range(n)) if shaped else ())
    free = [f"pendulum[0].links[{k}].length" for k in range(n)]
    free += [f"pendulum[0].links[{k}].mass" for k in range(1, n)] * shaped
    start = {
        path: number_at(scene, find_places(scene, path)[0]) * np.exp(WRONG * rng.standard_normal()) for path in free
    }
    return scene, fit_modes(vary(scene, start), measured, free)


def pulls(scene: Scene, result: ModeFit) -> np.ndarray:
    """Errors over standard deviations, of the solution that is nearest to the truth."""
    true = np.array([number_at(scene, solution.place) for solution in result.parameters])
    each = [
        np.abs(solution.values - true)[result.fitted] / solution.stds[result.fitted]
        for solution in (result, *result.others)
    ]
    return min(each, key=lambda errors: float(errors.max()))


def most_misses(count: int) -> int:
    """So many of `count` intervals of 95 % miss more often than with a probability of CHANCE."""
    from scipy.stats import binom

    return int(binom.isf(CHANCE, count, 0.05))


def fits(seed: int) -> Iterator[Trial]:
    """Misses among the intervals of FITS fits."""
    every = np.concatenate([pulls(*fitted(FITS * seed + k)) for k in range(FITS)])
    misses = int(np.count_nonzero(every > 1.96))
    yield Trial(f"misses of {len(every)} intervals", misses, most_misses(len(every)))


def swinging(rng: np.random.Generator) -> Scene:
    """Two or three bobs, or two nearly equal pendula on a heavy cart, with light dampers."""
    kind = rng.integers(3)
    n = 1 if kind == 0 else int(kind) + 1
    masses, lengths = rng.uniform(0.1, 1, n), rng.uniform(0.2, 1, n)
    damping = 10 ** rng.uniform(-3.5, -2) * float((masses * lengths**2).min()) * np.sqrt(9.81 / lengths.sum())
    if kind:
        return Scene(gravity=9.81, pendulum=(bobs(masses, lengths, damping),), support=Fixed())
    both = tuple(bobs(masses, lengths * (1 + rng.uniform(0, 0.01)), damping) for _ in range(2))
    return Scene(gravity=9.81, pendulum=both, support=Cart(mass=float(masses[0]) * rng.uniform(10, 100)))


def swings(seed: int) -> Iterator[Trial]:
    """Modes too many in a clean record, and frequencies of small swings."""
    rng = np.random.default_rng([2, seed])
    scene = swinging(rng)
    duration, links = rng.uniform(10, 90), scene.n_links
    start = rng.choice([-1, 1], links) * rng.uniform(0.3, 1, links)
    start *= rng.uniform(2, 3) / np.abs(start).max()
    times = np.arange(0, duration, 1 / rng.choice([25, 50]))
    run = simulate(scene, duration, start=state_at_rest(scene, start.tolist()), output=times, tolerance=1e-10)
    names = [f"theta_{p}_{l + 1}" for p, pendulum in enumerate(scene.pendulum, 1) for l in range(len(pendulum.links))]
    identified = identify([(run.times, run.motion.links)], names).modes
    hertz = [mode.omega / (2 * np.pi) for mode in natural_modes(scene) if mode.oscillates and mode.omega > 0]
    yield Trial("modes too many", max(0, len(identified) - len(hertz)), 0)
    for mode_read in identified:
        if mode_read.frequency_shift is not None and len(identified) == len(hertz):
            near = min(hertz, key=lambda f: abs(f - mode_read.frequency))
            told = f"frequency {near:.6g} Hz, which a swing changes by {mode_read.frequency_shift:.2g}"
            yield Trial(told, abs(mode_read.frequency - near), HARDLY * mode_read.frequency_std)


def trials(seed: int) -> Iterator[Trial]:
    """Of both: FITS fits with the seeds that are multiples of FITS, a swing with each."""
    if seed % FITS == 0:
        yield from fits(seed // FITS)
    yield from swings(seed)


if __name__ == "__main__":
    attack(__doc__ or "", trials, cases=200, quick=4)
