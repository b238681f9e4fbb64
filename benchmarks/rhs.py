"""One right-hand side of the equations of motion: every body here compared with other engines, in one run.

    OPENBLAS_NUM_THREADS=1 python benchmarks/rhs.py [--quick]

N double pendula of rods of 1 m and 1 kg on a cart of 100 kg, and chains of such rods on a fixed pivot, at a random
state.  Each time is the best of several batches, including the call from Python; engines that are not installed, and
those whose accelerations differ by more than AGREE, are named instead.
"""

from __future__ import annotations

import argparse
import os
import platform
import time
from collections.abc import Callable, Sequence
from importlib.util import find_spec

import numpy as np
import scipy

from modal import Cart, Pendulum, Rod, Scene, matrices
from nonlinear.dynamics import Banded, Minimal, Recursion, compiled
from nonlinear.system import system_of

NUMBERS, CHAINS = (1, 2, 10, 100), (10, 100, 1000)
QUICK_NUMBERS, QUICK_CHAINS = (1, 10), (10, 100)
AGREE = 1e-4
MOST_DENSE = 300
BATCHES, BATCH_SECONDS = 5, 0.02
GRAVITY, CART = 9.81, 100.0

Accelerations = Callable[[], np.ndarray]


def on_cart(number: int) -> Scene:
    pendulum = Pendulum(links=[Rod(mass=1.0, length=1.0, count=2)], count=number)
    return Scene(gravity=GRAVITY, support=Cart(mass=CART), pendulum=[pendulum])


def chain(links: int) -> Scene:
    return Scene(gravity=GRAVITY, pendulum=[Pendulum(links=[Rod(mass=1.0, length=1.0, count=links)])])


# ------------------------------------------------------------------------------------------------------- engines
# Each maker takes a scene and a vector y and returns a call that gives the accelerations; `turn` makes them absolute.


def bound(body: type) -> Callable[[Scene, np.ndarray], Accelerations]:
    def made(scene: Scene, y: np.ndarray) -> Accelerations:
        system = system_of(scene)
        equations = Minimal(system, tuple(body(group) for group in system.groups))
        return lambda: equations.derivative(0.0, y)[equations.layout.half :]

    return made


def by_numba(scene: Scene, y: np.ndarray) -> Accelerations:
    equations = compiled.Compiled(system_of(scene))
    return lambda: equations.derivative(0.0, y)[equations.layout.half :]


def textbook(scene: Scene, y: np.ndarray) -> Accelerations:
    """The full matrix of the cart and all pendula, assembled and solved at every call."""
    system, pair = system_of(scene), matrices(scene).M
    on, half = int(system.cart is not None), len(y) // 2
    A, b = pair[on:, on:], pair[0, on:] if on else None
    weight = np.diag(matrices(scene).K)[on:]
    squares = np.empty(half)

    def accelerations() -> np.ndarray:
        angle, squared = y[on:half], y[half + on :] ** 2
        apart = angle[:, None] - angle
        full, sides = pair.copy(), squares
        full[on:, on:] = A * np.cos(apart)
        sides[on:] = -(A * np.sin(apart)) @ squared - weight * np.sin(angle)
        if on:
            full[0, 1:] = full[1:, 0] = b * np.cos(angle)
            sides[0] = (b * np.sin(angle)) @ squared
        return np.linalg.solve(full, sides)

    return accelerations


def relative(scene: Scene, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Joint coordinates and rates of y, and the matrix that turns them into absolute ones."""
    system, half = system_of(scene), len(y) // 2
    turn = np.eye(half)
    first = half - system.n_links
    for links in (np.flatnonzero(system.pendulum == p) + first for p in range(system.n_pendula)):
        turn[np.ix_(links, links)] = np.tril(np.ones((len(links), len(links))))
    return np.linalg.solve(turn, y[:half]), np.linalg.solve(turn, y[half:]), turn


def mujoco(scene: Scene, y: np.ndarray) -> Accelerations:
    """Its forward dynamics (mj_forward), contacts and constraints off."""
    import mujoco as engine

    spec = engine.MjSpec()
    spec.option.gravity = [0.0, 0.0, -GRAVITY]
    spec.option.disableflags = engine.mjtDisableBit.mjDSBL_CONTACT | engine.mjtDisableBit.mjDSBL_CONSTRAINT
    slide, hinge = engine.mjtJoint.mjJNT_SLIDE, engine.mjtJoint.mjJNT_HINGE
    rod = {"mass": 1.0, "ipos": [0, 0, -0.5], "inertia": [1 / 12, 1 / 12, 1e-9], "explicitinertial": True}
    base = spec.worldbody
    if isinstance(scene.support, Cart):
        base = base.add_body(mass=CART, ipos=[0, 0, 0], inertia=[1, 1, 1], explicitinertial=True)
        base.add_joint(type=slide, axis=[1, 0, 0])
    for _ in range(scene.n_pendula):
        body = base
        for i in range(scene.pendulum[0].n_links):
            body = body.add_body(pos=[0, 0, -1.0 if i else 0.0], **rod)
            body.add_joint(type=hinge, axis=[0, -1, 0])
    model = spec.compile()
    data = engine.MjData(model)
    data.qpos[:], data.qvel[:], turn = relative(scene, y)

    def accelerations() -> np.ndarray:
        engine.mj_forward(model, data)
        return data.qacc

    accelerations.turn = turn  # type: ignore[attr-defined]
    return accelerations


def pinocchio(scene: Scene, y: np.ndarray) -> Accelerations:
    """Its articulated-body algorithm (aba)."""
    import pinocchio as engine

    q, v, turn = relative(scene, y)
    model, base, still = engine.Model(), 0, engine.SE3.Identity()
    model.gravity.linear = np.array([0.0, 0.0, -GRAVITY])
    if isinstance(scene.support, Cart):
        base = model.addJoint(0, engine.JointModelPX(), still, "cart")
        model.appendBodyToJoint(base, engine.Inertia(CART, np.zeros(3), np.eye(3)), still)
    rod = engine.Inertia(1.0, np.array([0.0, 0.0, -0.5]), np.diag([1 / 12, 1 / 12, 1e-9]))
    below = engine.SE3(np.eye(3), np.array([0.0, 0.0, -1.0]))
    about = engine.JointModelRevoluteUnaligned(np.array([0.0, -1.0, 0.0]))
    for p in range(scene.n_pendula):
        parent, place = base, still
        for i in range(scene.pendulum[0].n_links):
            parent, place = model.addJoint(parent, about, place, f"joint {p} {i}"), below
            model.appendBodyToJoint(parent, rod, still)
    data, none = model.createData(), np.zeros(model.nv)

    def accelerations() -> np.ndarray:
        return np.asarray(engine.aba(model, data, q, v, none))

    accelerations.turn = turn  # type: ignore[attr-defined]
    return accelerations


ENGINES: dict[str, tuple[Callable[[Scene, np.ndarray], Accelerations], str | None]] = {
    "Recursion": (bound(Recursion), None),
    "Banded": (bound(Banded), None),
    "Compiled": (by_numba, "numba"),
    "textbook": (textbook, None),
    "MuJoCo": (mujoco, "mujoco"),
    "Pinocchio": (pinocchio, "pinocchio"),
}


# -------------------------------------------------------------------------------------------------------- timing


def microseconds(call: Accelerations) -> float:
    start = time.perf_counter()
    call()
    number = max(1, int(BATCH_SECONDS / max(time.perf_counter() - start, 1e-7)))
    batches = []
    for _ in range(BATCHES):
        start = time.perf_counter()
        for _ in range(number):
            call()
        batches.append((time.perf_counter() - start) / number)
    return min(batches) * 1e6


def too_large(name: str, scene: Scene) -> bool:
    """Whether matrices would exceed memory or time."""
    sizes = {"textbook": scene.n_links, "Pinocchio": scene.n_links}
    return sizes.get(name, 0) > MOST_DENSE


def times(scene: Scene) -> dict[str, float | str]:
    """Microseconds of every engine, or why there are none."""
    half = scene.n_links + isinstance(scene.support, Cart)
    y = np.random.default_rng(1).uniform(-1, 1, 2 * half)
    expected = bound(Recursion)(scene, y)()
    costs: dict[str, float | str] = {}
    for name, (make, package) in ENGINES.items():
        if package and not find_spec(package):
            costs[name] = "not installed"
        elif too_large(name, scene):
            costs[name] = "too large"
        else:
            call = make(scene, y)
            costs[name] = microseconds(call) if agrees(call, expected) else "differs"
    return costs


def agrees(call: Accelerations, expected: np.ndarray) -> bool:
    turn = getattr(call, "turn", None)
    answer = call() if turn is None else turn @ call()
    return bool(np.max(np.abs(answer - expected)) < AGREE * np.max(np.abs(expected)))


def table(rows: Sequence[tuple[str, dict[str, float | str]]]) -> str:
    from tabulate import tabulate

    lines = [(label, *(_cell(value, costs) for value in costs.values())) for label, costs in rows]
    return tabulate(lines, ("scene", *ENGINES), tablefmt="github", disable_numparse=True, stralign="right")


def _cell(value: float | str, costs: dict[str, float | str]) -> str:
    best = min(other for other in costs.values() if isinstance(other, float))
    return value if isinstance(value, str) else f"{value:.3g} ({value / best:.2g})"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="up to 10 pendula and 100 links")
    quick = parser.parse_args().quick
    scenes = [(f"{n} on a cart", on_cart(n)) for n in (QUICK_NUMBERS if quick else NUMBERS)]
    scenes += [(f"chain of {n}", chain(n)) for n in (QUICK_CHAINS if quick else CHAINS)]
    print(f"Microseconds for one right-hand side (times the best of the row); {os.cpu_count()} cores,", end=" ")
    print(f"Python {platform.python_version()}, NumPy {np.__version__}, SciPy {scipy.__version__}.\n")
    print(table([(label, times(scene)) for label, scene in scenes]))
    for name, (_, package) in ENGINES.items():
        if package and not find_spec(package):
            print(f"\n{name}: `{package}` is not installed.")


if __name__ == "__main__":
    main()
