"""Ensembles computed in threads are those computed by one thread, to the byte, by every engine.

In each case a random scene is computed twice by every engine: several ensembles one after the other in this thread,
then the same at once in as many threads, and one of them again in chunks that threads share.  Sweeps with runs go the
same way.  The error is the share of the bytes that differ; none may.
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from importlib.util import find_spec
from typing import Any

import numpy as np
from promise import Trial, attack

from modal.scene import Bob, Cart, Pendulum, Rod, Scene
from modal.scene.parameters import parse_variations
from nonlinear.ensembles import Ensemble, ensemble
from nonlinear.ensembles.executors import WorkerPool
from nonlinear.sweeps import Study, parse_measures, sweep

THREADS, MEMBERS, DURATION = 4, 24, 1.5
ENGINES = {"numpy": True, "numba": find_spec("numba") is not None}
MEASURES = ("first_turn", "largest_angle", "lyapunov")


def scene_of(rng: np.random.Generator) -> Scene:
    """One or two pendula of one or two links, half of them on a cart."""
    links = [Bob, Rod][rng.integers(2)]
    pendula = [
        Pendulum(links=[links(mass=rng.uniform(0.3, 2), length=rng.uniform(0.3, 1)) for _ in range(rng.integers(1, 3))])
        for _ in range(rng.integers(1, 3))
    ]
    support = {"support": Cart(mass=rng.uniform(1, 5))} if rng.integers(2) else {}
    return Scene(gravity=9.81, pendulum=pendula, **support)


def bytes_of(members: Ensemble) -> bytes:
    """Everything that was found, in the order of the columns."""
    return b"".join(members.column(name).tobytes() for name in members.columns)


def differing(first: bytes, second: bytes) -> float:
    """The share of bytes that differ."""
    if len(first) != len(second):
        return 1.0
    return float(np.mean(np.frombuffer(first, np.uint8) != np.frombuffer(second, np.uint8)))


def trials(seed: int) -> Iterator[Trial]:
    """Every engine, and a sweep."""
    rng = np.random.default_rng(seed)
    scene = scene_of(rng)
    starts = rng.uniform(-3, 3, (THREADS, MEMBERS, scene.n_links))

    def run(k: int, engine: str, **more: Any) -> bytes:
        measures = [*MEASURES, "section:theta[1,1]=5"]
        options: dict[str, Any] = {"measures": measures, "output": "end", "check": 0, **more}
        return bytes_of(ensemble(scene, DURATION, starts=starts[k], engine=engine, **options))

    with ThreadPoolExecutor(THREADS) as executor:
        for engine in (name for name, there in ENGINES.items() if there):
            alone = [run(k, engine, workers=1) for k in range(THREADS)]
            together = [executor.submit(run, k, engine, workers=1) for k in range(THREADS)]
            for k, (first, second) in enumerate(zip(alone, together, strict=True)):
                yield Trial(f"{engine}, ensemble {k} at once with others", differing(first, second.result()), 0.0)
            crew = WorkerPool(executor, THREADS)
            first, other_bytes = run(0, engine, workers=1, chunk=6), run(0, engine, crew=crew, chunk=6)
            yield Trial(f"{engine}, chunks in threads", differing(first, other_bytes), 0.0)
        yield swept(scene, executor)


def swept(scene: Scene, executor: ThreadPoolExecutor) -> Trial:
    """A sweep whose points threads share, against one in this thread that takes them in the same portions."""
    study = Study(scene, parse_variations(["gravity=9:10:120"]), parse_measures(["frequencies", "energy_drift:1"]))
    with ThreadPoolExecutor(1) as single:
        alone = sweep(study, crew=WorkerPool(single, THREADS))
    shared = sweep(study, crew=WorkerPool(executor, THREADS))
    error = max(differing(alone.values(name).tobytes(), shared.values(name).tobytes()) for name in alone.columns)
    return Trial("sweep", error, 0.0)


if __name__ == "__main__":
    attack(__doc__ or "", trials, cases=20, quick=2)
