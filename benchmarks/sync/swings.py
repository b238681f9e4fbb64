"""Two swings with N metronomes each: where antiphase breaks up, where in phase lasts, and the chimera between them.

    python benchmarks/sync/swings.py [--quick]

After Martens, Thutupalli, Fourrière & Hallatschek, PNAS 110, 10563 (2013); the numbers are ours.  In units of a
metronome's l and √(l/g), with the share μ of the metronomes in all mass M of a swing, W = l over the length of its
rods, its damper c, and a long spring κ between them, which pushes along the rail, a population that moves as one
metronome has the angle φ, and its swing the displacement s along its arc, α = W s,

    φ'' + cos(φ − α) s'' = −sin φ − W s'² sin(φ − α) − ε (φ²/θ₀² − 1) φ'
    s'' + μ [cos(φ − α) φ'' − φ'² sin(φ − α)] = −sin α − c s' − κ (x − x̄) cos α,            x = sin(W s)/W

As two carts of stiffness W there is no arc: α = 0, x = s, and −W s in place of −sin α.  In phase x − x̄ = 0, in
antiphase 2 x.  A disturbance δs is answered by the tangent stiffness of the spring, 2κ cos² α in one sector and 0 in
the other; one of metronomes against each other leaves s(t) as it is.

The thresholds are computed from scenes by `nonlinear.synchronization`, and the growth rates of these equations, written
here and integrated by SciPy, vanish there.  Simulations from one population alike and the other spread over all phases
follow, 2000 periods each, and what 100 s of these cost against one cart with all the metronomes, once compiled.
"""

from __future__ import annotations

import argparse
import math
import time
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from modal import Bob, Scene
from modal.scene import InitialCondition, Pendulum, Spring, VanDerPol
from modal.scene.parameters import Variation
from modal.scene.supports import Cart, Swing
from modal.types import Floats
from nonlinear.integration.readiness import has_package
from nonlinear.orbits import PatternOrbit
from nonlinear.simulation import simulate
from nonlinear.synchronization import PopulationDiagram, follow_populations, phases_of, population_phases

G, LENGTH, MASS = 9.81, 0.1, 3.0
RATE = math.sqrt(G / LENGTH)
MU, W, DAMPER, DRIVE, LIMIT = 0.005, 0.376, 0.05, 0.01, 0.33
UNIT = MASS * G / LENGTH  # N/m, of κ and W
STIFFNESS = "spring[0].stiffness"
PERIOD = 2 * math.pi / RATE
TOLD = {
    "carts": {
        ("antiphase", "within a population"): 0.203647888,
        ("antiphase", "other"): 0.207562587,
        ("in phase", "other"): 0.268650039,
    },
    "swings": {
        ("antiphase", "within a population"): 0.203742614,
        ("antiphase", "other"): 0.207637681,
        ("in phase", "other"): 0.268870566,
    },
}
"""Thresholds κ by kind of support."""


def two_swings(kappa: float, kind: str = "swings", count: int = 15, spread: bool = True) -> Scene:
    """Two swings, or carts of their stiffness, with `count` metronomes each and a spring of κ units between them."""
    mass = MASS * (1 - MU)
    damping = DAMPER * MASS * RATE
    supports: list[Any] = []
    for name, place in (("left", 0.0), ("right", 2.0)):
        common: dict[str, Any] = {"name": name, "mass": mass, "damping": damping, "position": (place, 0.0)}
        if kind == "swings":
            supports.append(Swing(length=LENGTH / W, **common))
        else:
            supports.append(Cart(stiffness=W * UNIT, **common))
    mass_each = MU * MASS / count
    drive = VanDerPol(strength=DRIVE * mass_each * LENGTH**2 * RATE, angle_deg=math.degrees(LIMIT))
    link, angles = Bob(mass=mass_each, length=LENGTH, drive=drive), (math.degrees(2 * LIMIT),)
    starts = InitialCondition(angles_deg=angles), InitialCondition(angles_deg=angles, spread=spread)
    pendula = [
        Pendulum(on=support.name, links=(link,), count=count, start=start)
        for support, start in zip(supports, starts, strict=True)
    ]
    spring = Spring(between=("left", "right"), stiffness=kappa * UNIT)
    return Scene(gravity=G, support=supports, pendulum=pendula, spring=(spring,))


def diagram(kind: str, values: tuple[float, ...] = (0.2, 0.206, 0.215, 0.26, 0.275)) -> PopulationDiagram:
    """The thresholds of scenes along κ, found between these values."""
    stiffness = tuple(UNIT * kappa for kappa in values)
    return follow_populations(two_swings(0.2, kind), Variation(STIFFNESS, stiffness))


# ------------------------------------------------------------------------------------------- the equations above


@dataclass(frozen=True)
class Few:
    """One metronome on one swing in a pattern, the spring answering with `stiffness` κ (x − x̄)/x, 0 or 2κ."""

    stiffness: float
    arc: bool

    def rates(self, y: Any, beside: float = 0.0, s: Any = 0.0) -> Any:
        """The rates of y = (φ, s, φ', s'), a disturbance of `s` meeting a spring stiffer by `beside`."""
        phi, place, turning, speed = y
        alpha = W * place if self.arc else 0.0
        x, slope = (np.sin(alpha) / W, np.cos(alpha)) if self.arc else (place, 1.0)
        back = np.sin(alpha) if self.arc else W * place
        C, S, bend = np.cos(phi - alpha), np.sin(phi - alpha), W * speed**2 if self.arc else 0.0
        first = -np.sin(phi) - bend * S - DRIVE * (phi**2 / LIMIT**2 - 1) * turning
        push = self.stiffness * x * slope + beside * slope.real**2 * (place - s)
        second = -back - DAMPER * speed - push + MU * turning**2 * S
        pushed = (second - MU * C * first) / (1 - MU * C**2)
        return np.array([turning, speed, first - C * pushed, pushed])

    def jacobian(self, y: Floats, beside: float) -> Floats:
        """∂y'/∂y by complex steps."""
        ways = y[:, None] + 1e-30j * np.eye(4)
        return np.asarray(self.rates(ways, beside, y[1]).imag / 1e-30)

    def within(self, y: Floats) -> Floats:
        """∂(φ', φ'')/∂(φ, φ') of one metronome, its swing moving as it does."""
        pushed = self.rates(y)[3]
        phi, place, turning, speed = y
        alpha, bend = (W * place, W * speed**2) if self.arc else (0.0, 0.0)
        curb = DRIVE * (phi**2 / LIMIT**2 - 1)
        slope = -np.cos(phi) - bend * np.cos(phi - alpha) - 2 * DRIVE * phi * turning / LIMIT**2
        return np.array([[0.0, 1.0], [slope + np.sin(phi - alpha) * pushed, -curb]])


def own_growth(kappa: float, kind: str, motion: str, near: PatternOrbit) -> dict[str, float]:
    """The growth rates (1/s) of every sector by the equations above, their orbit found next to one of the scene."""
    spring, across = (0.0, 2 * kappa) if motion == "in phase" else (2 * kappa, 0.0)
    few = Few(spring, kind == "swings")
    at, half = near.orbit.y, len(near.orbit.y) // 2
    y = np.array([at[2], at[0] / LENGTH, at[half + 2] / RATE, at[half] / LENGTH / RATE])
    T = near.orbit.period * RATE

    def flow(_: float, z: Floats) -> Floats:
        y, parts = z[:4], z[4:]
        J, K = few.jacobian(y, 0.0), few.jacobian(y, across - spring)
        A, B, C = parts[:16].reshape(4, 4), parts[16:32].reshape(4, 4), parts[32:].reshape(2, 2)
        return np.concatenate((few.rates(y), (J @ A).ravel(), (K @ B).ravel(), (few.within(y) @ C).ravel()))

    unit = np.concatenate((np.eye(4).ravel(), np.eye(4).ravel(), np.eye(2).ravel()))
    for _ in range(4):
        z = scipy.integrate.solve_ivp(flow, (0, T), [*y, *unit], method="DOP853", rtol=1e-11, atol=1e-13).y[:, -1]
        V = z[4:20].reshape(4, 4)
        J = np.block([[V - np.eye(4), few.rates(z[:4])[:, None]], [np.eye(4)[2], 0.0]])
        step = np.linalg.solve(J, -np.append(z[:4] - y, y[2]))
        if np.abs(step).max() < 1e-9:
            break
        y, T = y + step[:4], T + step[4]
    blocks = V, z[20:36].reshape(4, 4), z[36:].reshape(2, 2)
    sizes = [np.abs(np.linalg.eigvals(block)) for block in blocks]
    sizes[0] = np.delete(sizes[0], np.abs(np.linalg.eigvals(V) - 1).argmin())
    names = "own", "other", "within a population"
    return {name: float(np.log(size.max()) / T * RATE) for name, size in zip(names, sizes, strict=True)}


# --------------------------------------------------------------------------------------------------- simulations


def verdict(kappa: float, periods: float = 2000, tolerance: float = 1e-6) -> tuple[str, Floats, float]:
    """The verdict of a run, R of both populations, and the ratio of their rates."""
    run = simulate(two_swings(kappa), periods * PERIOD, tolerance=tolerance)
    phases = population_phases(phases_of(run))
    assert phases is not None
    return phases.kind, phases.late_order, float(phases.rate[1] / phases.rate[0])


def cost(scene: Scene, method: str, repeats: int = 3) -> float:
    """The seconds that a run of 100 s takes, the least of several: the first of a process also compiles."""
    took = []
    for _ in range(repeats):
        begun = time.process_time()
        simulate(scene, 100.0, method=method)
        took.append(time.process_time() - begun)
    return min(took)


def one_cart() -> Scene:
    """All metronomes of both swings on one cart, spread over all phases, so that none are computed as one."""
    cart = Cart(mass=MASS * (1 - MU), stiffness=W * UNIT, damping=DAMPER * MASS * RATE)
    every = two_swings(0.22).pendulum[1].replace(on=None, count=30)
    return Scene(gravity=G, support=cart, pendulum=[every])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--quick", action="store_true", help="carts only, and 200 periods of one spring")
    quick = parser.parse_args().quick
    print(
        "support  motion     sector                κ found       κ told        averaged   growth there, own equations"
    )
    for kind in ("carts",) if quick else TOLD:
        drawn = diagram(kind)
        for threshold in drawn.thresholds:
            if (threshold.pattern, threshold.sector) not in TOLD[kind]:
                continue
            kappa = threshold.value / UNIT
            branch = next(branch for branch in drawn.branches if branch.name == threshold.pattern)
            orbit = branch.motions[branch.values.tolist().index(threshold.value)].orbit
            assert orbit is not None
            growth = own_growth(kappa, kind, threshold.pattern, orbit)[threshold.sector]
            averaged = math.nan if threshold.averaged is None else threshold.averaged / UNIT
            told = TOLD[kind][threshold.pattern, threshold.sector]
            words = f"{kind:8s} {threshold.pattern:10s} {threshold.sector:20s}  {kappa:.9f}   {told:.9f}"
            print(f"{words}   {averaged:.6f}   {growth:+.0e} 1/s", flush=True)
    print("\nκ      verdict      R₁       R₂       rate of 2 over 1")
    for kappa in (0.22,) if quick else (0.20, 0.22, 0.28):
        begun = time.process_time()
        kind, order, ratio = verdict(kappa, 200 if quick else 2000)
        seconds = time.process_time() - begun
        print(
            f"{kappa:.2f}   {kind:10s}   {order[0]:.4f}   {order[1]:.4f}   {ratio:.4f}   ({seconds:.1f} s)", flush=True
        )
    if not quick:
        print()
        for method in ("DOP853", *["taylor"] * has_package("heyoka")):
            ratio = cost(two_swings(0.22), method) / cost(one_cart(), method)
            print(f"100 s of two swings by {method}: {ratio:.2f} times one cart with 30 metronomes")


if __name__ == "__main__":
    main()
