"""What each feature of a scene costs: a derivative in floats against that of the plain scene, and whole runs.

    OPENBLAS_NUM_THREADS=1 python benchmarks/engines.py [--quick]

Two bobs with one feature each, over the same two bobs without, of two joints that rub one at rest; whole runs of ten
seconds over those without; then runs of shipped scenes, that of `kapitza` next to the ten lines that a user would
write with SciPy's DOP853.  Runs without friction take compiled code where it is ready, runs with friction never.  What
time brings is listed by itself: one call in floats, one at a thousand times at once, and a run over a whole
record, whose steps end at its breaks.  Process times, the best of several, all in one run.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from math import pi, sin

import numpy as np
from scipy.integrate import solve_ivp

from modal import Bob, Cart, Fixed, InitialCondition, Pendulum, Scene, load
from modal.scene import Hoist, Moved, RandomMotion, RecordMotion, SineMotion, SweepMotion
from modal.scene.feedback import Feedback, GainMatrix
from nonlinear import simulate
from nonlinear.dynamics import Generated
from nonlinear.dynamics.inputs import Inputs
from nonlinear.integration.switches import Switched
from nonlinear.system import AppliedForces, State, initial_state, system_of

RUNS = {
    "kapitza": ("kapitza", 10.0),
    "crane": ("hoisting-crane", 10.0),
    "suspension": ("damped-suspension", 10.0),
}
START = InitialCondition(angles_deg=(30.0, -20.0))


GAINS = GainMatrix(states=("x", "x_dot", "theta_1_1", "theta_dot_1_1"), rows=((8.0, 6.0, -3.0, 2.0),))
LOOP = Feedback(input="cart_force", gains=GAINS)
BROADBAND = RandomMotion(psd=(0.1, 0.1), frequency_hz=(0.05, 25.0), seed=3, duration=60.0)


def of(support: Fixed | Cart | Moved | None = None, damping_ratio: float | None = None, **more: float) -> Scene:
    links = (Bob(mass=1.3, length=1.1, **more), Bob(mass=0.7, length=0.6, **more))
    ratio = {} if damping_ratio is None else {"damping_ratio": damping_ratio}
    return Scene(gravity=9.81, support=support or Fixed(), pendulum=(Pendulum(links=links, start=START),), **ratio)


def hoisted(scene: Scene) -> Scene:
    first, second = scene.pendulum[0].links
    links = (first.replace(hoist=Hoist(to=0.7, duration=3.0)), second)
    return scene.replace(pendulum=(scene.pendulum[0].replace(links=links),))


def inputs_of_time() -> dict[str, Scene]:
    """Scenes that time drives for ten seconds, records of 2,001 samples."""
    times, rng = np.linspace(0.0, 10.0, 2001), np.random.default_rng(1)
    lengths = {"smooth": 1.0 + 0.3 * np.cos(times), "noisy": 1.3 + 1e-4 * rng.standard_normal(2001)}
    swaying = 0.05 * np.sin(3 * times)
    samples = {"smooth": swaying, "noisy": swaying + 1e-5 * rng.standard_normal(2001)}
    scenes = {
        "sine": of(Moved(motion=SineMotion(amplitude=0.02, frequency_hz=2.0))),
        "sweep": of(Moved(motion=SweepMotion(amplitude=0.02, from_hz=0.5, to_hz=5.0, duration=10.0))),
        "1,498 sines": of(Moved(motion=BROADBAND)),
    }
    for name, values in samples.items():
        record = RecordMotion(time_s=tuple(times.tolist()), displacement_m=tuple(values.tolist()))
        scenes[f"record, {name}"] = of(Moved(motion=record))
    for rate in (100, 500, 1000):
        often = np.linspace(0.0, 10.0, 10 * rate + 1)
        accelerations = 0.3 * np.sin(3 * often) + 0.1 * np.sin(19 * often)
        record = RecordMotion(time_s=tuple(often.tolist()), acceleration_m_per_s2=tuple(accelerations.tolist()))
        scenes[f"record at {rate} Hz"] = of(Moved(motion=record))
    for profile in ("smooth", "trapezoidal"):
        scenes[f"hoist, {profile}"] = roped(Hoist(to=0.7, duration=10.0, profile=profile), 1.3)
    for name, values in lengths.items():
        hoist = Hoist(time_s=tuple(times.tolist()), length_m=tuple(values.tolist()))
        scenes[f"hoist, {name} file"] = roped(hoist, float(values[0]))
    return scenes


def roped(hoist: Hoist, length: float) -> Scene:
    bob = Bob(mass=1.0, length=length, hoist=hoist)
    start = InitialCondition(angles_deg=(5.0,))
    return Scene(gravity=9.81, support=Fixed(), pendulum=(Pendulum(links=(bob,), start=start),))


def table_of_inputs(calls: int, share: float) -> None:
    """Print what inputs of time cost."""
    print("\ninputs of time         µs a call  ns side by side   s a run   steps   breaks")
    times = np.random.default_rng(5).uniform(0.0, 10.0, 1000)
    for name, scene in inputs_of_time().items():
        inputs = Inputs(system_of(scene))
        at, some = inputs.of_time, times[: min(calls, 1000)].tolist()
        seconds_each = best(lambda at=at, some=some: [at(time) for time in some], 1) / len(some)
        beside = best(lambda inputs=inputs: inputs.beside(times), 5) / len(times)
        seconds = best(lambda scene=scene: simulate(scene, 10.0 * share, method="DOP853"), 1)
        steps = simulate(scene, 10.0 * share, method="DOP853").run.steps
        row = (
            f"{1e6 * seconds_each:9.2f}  {1e9 * beside:15.1f}  {seconds:8.4f}  {steps:6}  {len(inputs.breaks(1e-9)):7}"
        )
        print(f"{name:22} {row}")


def push(time: float, state: State) -> AppliedForces:
    return AppliedForces(moments=np.array([sin(time), 0.0]))


def features() -> dict[str, tuple[Scene, bool]]:
    """Scenes, and whether a load acts on them."""
    sine = SineMotion(direction="vertical", amplitude=0.02, frequency_hz=2.0)
    random = RandomMotion(psd=(1.0, 1.0), frequency_hz=(0.1, 5.0), seed=3, duration=60.0)
    return {
        "plain": (of(), False),
        "dampers": (of(damping=0.1), False),
        "springs": (of(stiffness=2.0), False),
        "linear drag": (of(drag=0.1), False),
        "quadratic drag": (of(quadratic_drag=0.1), False),
        "damping_ratio": (of(damping_ratio=0.02), False),
        "cart": (of(Cart(mass=2.0)), False),
        "moved by a sine": (of(Moved(motion=sine)), False),
        "moved at random": (of(Moved(motion=random)), False),
        "moved, drag": (of(Moved(motion=sine), drag=0.1), False),
        "hoist": (hoisted(of()), False),
        "hoist, drag": (hoisted(of(drag=0.1)), False),
        "load from Python": (of(), True),
        "cart, feedback": (of(Cart(mass=2.0)).replace(feedback=[LOOP]), False),
        "..., within a limit": (of(Cart(mass=2.0)).replace(feedback=[LOOP.replace(limit=1.0)]), False),
        "joint friction": (of(friction=0.1), False),
        "friction on the rail": (of(Cart(mass=2.0, friction=0.5)), False),
        "... (coefficient)": (of(Cart(mass=2.0, friction_coefficient=0.1)), False),
    }


def chain(links: int, friction: float) -> Scene:
    """Bobs at 30°, each of which rubs in its joint (N m)."""
    bobs = [Bob(mass=1.0, length=1.0, friction=friction) for _ in range(links)]
    start = InitialCondition(angles_deg=(30.0,) * links)
    return Scene(gravity=9.81, support=Fixed(), pendulum=(Pendulum(links=bobs, start=start),))


def table_of_runs(share: float) -> None:
    """Print whole runs of ten seconds over those without the feature."""
    cart = of(Cart(mass=2.0))
    runs = {
        "hoist": (hoisted(of()), of()),
        "broadband PSD": (of(Moved(motion=BROADBAND)), of()),
        "joint friction": (of(friction=0.1), of()),
        "friction on the rail": (of(Cart(mass=2.0, friction=0.5)), cart),
        "... (coefficient)": (of(Cart(mass=2.0, friction_coefficient=0.1)), cart),
        "feedback": (cart.replace(feedback=[LOOP]), cart),
        "feedback at 100 Hz": (cart.replace(feedback=[LOOP.replace(sample_time=0.01)]), cart),
        "eleven rubbing joints": (chain(11, 0.2), chain(11, 0.0)),
    }
    print("\na whole run with             s   over plain   steps")
    for name, scenes in runs.items():
        spent = [best(lambda scene=scene: simulate(scene, 10.0 * share, method="DOP853"), 1) for scene in scenes]
        steps = simulate(scenes[0], 10.0 * share, method="DOP853").run.steps
        print(f"{name:22}  {spent[0]:7.4f}  {spent[0] / spent[1]:7.2f}     {steps:6}")


def best(call: Callable[[], object], times: int) -> float:
    """Seconds of one call, the best of several batches."""
    spent = []
    for _ in range(7):
        begun = time.process_time()
        for _ in range(times):
            call()
        spent.append((time.process_time() - begun) / times)
    return min(spent)


def derivative(scene: Scene, loaded: bool) -> Callable[[], object]:
    """A call of the written rate with its inputs, as in a stage of a step."""
    equations = Generated(system_of(scene), load=push if loaded else None)
    y = equations.begin(initial_state(scene)).tolist()
    if equations.system.rubs:
        return rubbing(equations, y)
    rate, listed = equations.rate, equations.inputs_at
    if listed is None:
        return lambda: rate(y)
    if equations.is_time_only:
        return lambda: rate(y, (0.7,))
    return lambda: rate(y, listed(0.7, y))


def rubbing(free: Generated, y: list[float]) -> Callable[[], object]:
    """The same where a contact sticks and all others slide."""
    equations = Switched(free)
    at, state = equations.switches.places, [1.0] * equations.switches.places.length
    state[at.e - 1] = 0.0 if at.J > 1 else 1.0
    equations.resume(state)
    rate, listed = equations.rate, equations.inputs_at
    assert listed is not None
    return lambda: rate(y, listed(0.7, y))


def by_hand(seconds: float) -> float:
    """The last angle of kapitza by ten lines and SciPy."""
    scene = load("kapitza")
    link, motion = scene.pendulum[0].links[0], scene.support.motion
    omega, phase = 2 * pi * motion.frequency_hz, motion.phase_deg * pi / 180
    inertia, b = link.inertia + link.mass * link.centre**2, link.mass * link.centre

    def rate(t: float, y: np.ndarray) -> list[float]:
        lifted = -motion.amplitude * omega**2 * sin(omega * t + phase)
        return [y[1], -(b * (scene.gravity + lifted) * sin(y[0]) + link.damping * y[1]) / inertia]

    start = initial_state(scene)
    run = solve_ivp(rate, (0, seconds), [start.links[0], start.link_rates[0]], "DOP853", rtol=1e-9, atol=1e-10)
    return float(run.y[0, -1])


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer calls and shorter runs")
    quick = parser.parse_args().quick
    calls, share = (200, 0.1) if quick else (5000, 1.0)
    print("a derivative with            µs   over plain")
    plain = 0.0
    for name, (scene, loaded) in features().items():
        seconds = best(derivative(scene, loaded), calls)
        plain = plain or seconds
        print(f"{name:22}  {1e6 * seconds:7.2f}  {seconds / plain:7.2f}")
    table_of_runs(share)
    table_of_inputs(calls, share)
    print("\na run of                     s     steps  µs a derivative")
    for name, (scene, duration) in RUNS.items():
        scene_of_run, length = load(scene), share * duration
        trajectory = simulate(scene_of_run, length, method="DOP853")
        seconds = best(
            lambda scene_of_run=scene_of_run, length=length: simulate(scene_of_run, length, method="DOP853"), 1
        )
        print(f"{name:22}  {seconds:7.4f}  {trajectory.run.steps:6}  {1e6 * seconds / trajectory.run.calls:7.2f}")
        if name == "kapitza":
            hand, angle = best(lambda length=length: by_hand(length), 1), by_hand(length)
            ends = best(
                lambda scene_of_run=scene_of_run, length=length: simulate(
                    scene_of_run, length, method="DOP853", output=2
                ),
                1,
            )
            apart = abs(angle - float(trajectory.motion.links[-1, 0]))
            print(f"  without samples       {ends:7.4f}")
            print(f"  ten lines by hand     {hand:7.4f}  {ends / hand:6.2f} of it; apart {apart:.1e} rad")


if __name__ == "__main__":
    main()
