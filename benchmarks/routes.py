"""The same motion by many routes: this project's own, a textbook right-hand side with SciPy, and other engines.

A route takes a `Problem` and a setting (a tolerance, or a step in s), prepares what it needs, and returns a task that
integrates to the end and gives the absolute angles (L,) there.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np
from problems import Problem
from scipy.integrate import solve_ivp

from modal import Scene, matrices
from modal.plotting.style import colour, ink, secondary_colour
from nonlinear.dynamics import Generated
from nonlinear.dynamics.compiled import Compiled
from nonlinear.integration import Choice, equations_of, estimate_timescales
from nonlinear.integration import taylor as series
from nonlinear.integration.driver import Drive
from nonlinear.integration.floats import FloatStepper
from nonlinear.integration.steppers import Pace, SciPyStepper, Stepper
from nonlinear.integration.taylor import TaylorStepper, first_step
from nonlinear.system import Equations, State, System, of_plane, system_of

SAMPLES = 1000  # of what takes samples on its way

Task = Callable[[], np.ndarray]
Maker = Callable[[Problem, float], Task]


class Route(NamedTuple):
    """How a route is prepared, its settings from coarse to fine, the package that it needs, and its style."""

    make: Maker
    settings: tuple[float, ...]
    package: str
    hue: Callable[[], str]
    mark: str
    ours: bool = True


# ---------------------------------------------------------------------------------------------------------- ours


def driven(equations: Equations, stepper: Stepper, problem: Problem) -> np.ndarray:
    record = Drive(stepper, equations, np.array([0.0, problem.duration])).run()
    return equations.read(record.rows).links[-1]


def compiled_stepper() -> Any:
    return import_module("nonlinear.integration.compiled").CompiledStepper


def stepper_of(equations: Equations, start: State, duration: float, tolerance: float) -> Stepper:
    """DOP853 as in a run: in floats for generated equations, compiled, or SciPy's."""
    begun = (0.0, equations.begin(start), duration, tolerance, tolerance * equations.scale)
    if isinstance(equations, Generated):
        return FloatStepper(equations, *begun)
    if isinstance(equations, Compiled):
        return compiled_stepper()(equations, *begun)
    return SciPyStepper("DOP853", equations.derivative, *begun)


def by_steps(equations: Equations, start: State, problem: Problem, tolerance: float) -> np.ndarray:
    return driven(equations, stepper_of(equations, start, problem.duration, tolerance), problem)


def default(problem: Problem, tolerance: float) -> Task:
    equations = equations_of(system_of(problem.scene), Choice("minimal", "DOP853", False, ""))
    by_steps(equations, problem.start, problem._replace(duration=1e-3), tolerance)
    return lambda: by_steps(equations, problem.start, problem, tolerance)


def numba_body(problem: Problem, tolerance: float) -> Task:
    equations = Compiled(system_of(problem.scene))
    by_steps(equations, problem.start, problem._replace(duration=1e-3), tolerance)
    return lambda: by_steps(equations, problem.start, problem, tolerance)


def maximal(problem: Problem, tolerance: float) -> Task:
    equations = equations_of(system_of(problem.scene), Choice("maximal", "DOP853", False, ""))
    return lambda: by_steps(equations, problem.start, problem, tolerance)


def spatial(problem: Problem, tolerance: float) -> Task:
    twin = problem.scene.replace(space="space")
    equations = equations_of(system_of(twin), Choice("spatial", "DOP853", False, ""))

    def task() -> np.ndarray:
        u = by_steps(equations, of_plane(problem.start), problem, tolerance)
        return np.arctan2(u[:, 0], u[:, 2])

    return task


def taylor(problem: Problem, tolerance: float) -> Task:
    equations = equations_of(system_of(problem.scene), Choice("minimal", "taylor", False, ""))
    cap = first_step(estimate_timescales(problem.scene).swing)
    first = equations.begin(problem.start)
    stepper = TaylorStepper(equations, first, 0.0, problem.duration, tolerance, Pace(cap))

    def task() -> np.ndarray:
        stepper.restart(first, 0.0)
        return driven(equations, stepper, problem)

    return task


def forget() -> None:
    """Make heyoka compile every series anew: its cache on disk serves only the same scene again."""

    def without_disk() -> Any:
        engine = import_module("heyoka")
        engine.llvm_state.set_diskcache_enabled(False)
        return engine

    series._heyoka = without_disk


# -------------------------------------------------------------------------------------------------------- rivals


def textbook(scene: Scene) -> Callable[[float, np.ndarray], np.ndarray]:
    """The full matrix of the cart and all pendula, assembled and solved at every call; no dampers, no springs."""
    on, linear = int(system_of(scene).cart is not None), matrices(scene)
    M, weight, half = linear.M, np.diag(linear.K)[on:], len(linear.M)
    A, b = M[on:, on:], M[0, on:]

    def derivative(time: float, y: np.ndarray) -> np.ndarray:
        angle, squared, full, sides = y[on:half], y[half + on :] ** 2, M.copy(), np.empty(half)
        apart = angle[:, None] - angle
        full[on:, on:] = A * np.cos(apart)
        sides[on:] = -(A * np.sin(apart)) @ squared - weight * np.sin(angle)
        if on:
            full[0, 1:] = full[1:, 0] = b * np.cos(angle)
            sides[0] = (b * np.sin(angle)) @ squared
        return np.concatenate((y[half:], np.linalg.solve(full, sides)))

    return derivative


def dense(method: str) -> Maker:
    def made(problem: Problem, tolerance: float) -> Task:
        f, on = textbook(problem.scene), int(system_of(problem.scene).cart is not None)
        y = np.concatenate((np.zeros(on), problem.angles, np.zeros(on + len(problem.angles))))
        span = (0.0, problem.duration)
        return lambda: solve_ivp(f, span, y, method, rtol=tolerance, atol=tolerance).y[on : len(y) // 2, -1]

    return made


def numba_alone(problem: Problem, step: float) -> Task:
    """The textbook under the classical Runge–Kutta method, all of it compiled by numba."""
    from rival_numba import integrated

    on, linear = int(system_of(problem.scene).cart is not None), matrices(problem.scene)
    M, weight = np.array(linear.M, dtype=float), np.diag(linear.K)[on:].copy()
    y = np.concatenate((np.zeros(on), problem.angles, np.zeros(on + len(problem.angles))))
    integrated(M, weight, on, y.copy(), step, 1)
    return lambda: integrated(M, weight, on, y.copy(), step, round(problem.duration / step))[on : len(M)]


def numba_dop853(problem: Problem, tolerance: float) -> Task:
    """DOP853 of the equations of double pendula on a cart, or of a chain of bobs, written by hand for numba."""
    import rival_numba as rival

    system, linear = system_of(problem.scene), matrices(problem.scene)
    on, g, samples = int(system.cart is not None), system.gravity, np.linspace(0.0, problem.duration, SAMPLES + 1)[1:]
    y = np.concatenate((np.zeros(on), problem.angles, np.zeros(on + len(problem.angles))))
    rows = np.empty((SAMPLES, len(y)))
    if on:
        M = np.array(linear.M, dtype=float)
        run, p = rival.stepping(rival.doubles), (g, M[0, 0], M[1, 1], M[1, 2], M[2, 2], M[0, 1], M[0, 2])
    else:
        numbers = [np.ascontiguousarray(system.by_link(name)) for name in ("mass", "length")]
        run, p = rival.stepping(rival.bobs), (g, *numbers, *np.empty((5, system.n_links)))

    def task(end: float = problem.duration) -> np.ndarray:
        run(y.copy(), p, end, tolerance, tolerance, samples, rows)
        return rows[-1, on : len(y) // 2].copy()

    task(1e-3)
    return task


def heyoka_alone(problem: Problem, tolerance: float) -> Task:
    """Heyoka alone, on the same expressions, from the start to the end without samples."""
    equations = Generated(system_of(problem.scene))
    cap, first = first_step(estimate_timescales(problem.scene).swing), equations.begin(problem.start)
    integrator = series.integrator_of(equations, series.uneven(tolerance))

    def task() -> np.ndarray:
        integrator.time, integrator.state[:] = 0.0, first
        integrator.step(max_delta_t=cap)
        integrator.propagate_until(problem.duration)
        return equations.read(np.array(integrator.state)[None]).links[0]

    return task


def relative(system: System, angles: np.ndarray) -> np.ndarray:
    """Joint angles of absolute ones, in the order of the file."""
    joints = np.empty_like(angles)
    for group in system.groups:
        joints[group.index] = np.diff(angles[group.index], axis=0, prepend=0.0)
    return joints


def absolute(system: System, joints: np.ndarray) -> np.ndarray:
    angles = np.empty_like(joints)
    for group in system.groups:
        angles[group.index] = np.cumsum(joints[group.index], axis=0)
    return angles


def links_of(system: System) -> list[tuple[bool, float, float, float, float]]:
    """Whether it is the top of its pendulum, mass, length, centre and moment of inertia of every link."""
    tops = np.diff(system.pendulum, prepend=-1) > 0
    numbers = (system.by_link(name) for name in ("mass", "length", "centre", "inertia"))
    return list(zip(tops, *numbers, strict=True))


def mujoco(problem: Problem, step: float) -> Task:
    """Its own RK4, contacts and constraints off, the loop over the steps in C."""
    import mujoco as engine

    system = system_of(problem.scene)
    model = _mujoco_model(engine, system, step)

    def task() -> np.ndarray:
        data = engine.MjData(model)
        data.qpos[model.nq - system.n_links :] = relative(system, problem.angles)
        engine.mj_step(model, data, nstep=round(problem.duration / step))
        return absolute(system, data.qpos[model.nq - system.n_links :])

    return task


def _mujoco_model(engine: object, system: System, step: float) -> object:
    spec, smallest = engine.MjSpec(), 1e-14
    spec.option.gravity, spec.option.timestep = [0.0, 0.0, -system.gravity], step
    spec.option.integrator = engine.mjtIntegrator.mjINT_RK4
    spec.option.disableflags = engine.mjtDisableBit.mjDSBL_CONTACT | engine.mjtDisableBit.mjDSBL_CONSTRAINT
    base, length = spec.worldbody, 0.0
    if system.cart:
        base = base.add_body(mass=system.cart.mass, ipos=[0, 0, 0], inertia=[1, 1, 1], explicitinertial=True)
        base.add_joint(type=engine.mjtJoint.mjJNT_SLIDE, axis=[1, 0, 0])
    body = base
    for top, m, l, c, moment in links_of(system):
        parent, place = (base, 0.0) if top else (body, -length)
        turns = [moment or smallest, moment or smallest, smallest]
        body = parent.add_body(pos=[0, 0, place], mass=m, ipos=[0, 0, -c], inertia=turns, explicitinertial=True)
        body.add_joint(type=engine.mjtJoint.mjJNT_HINGE, axis=[0, -1, 0])
        length = l
    return spec.compile()


def pinocchio(problem: Problem, step: float) -> Task:
    """Its articulated-body algorithm under the classical Runge–Kutta method in Python."""
    import pinocchio as engine

    system = system_of(problem.scene)
    model = _pinocchio_model(engine, system)
    data, none, half = model.createData(), np.zeros(model.nv), model.nv

    def rate(y: np.ndarray) -> np.ndarray:
        return np.concatenate((y[half:], engine.aba(model, data, y[:half], y[half:], none)))

    def task() -> np.ndarray:
        y = np.zeros(2 * half)
        y[half - system.n_links : half] = relative(system, problem.angles)
        for _ in range(round(problem.duration / step)):
            y = runge_kutta(rate, y, step)
        return absolute(system, y[half - system.n_links : half])

    return task


def runge_kutta(rate: Callable[[np.ndarray], np.ndarray], y: np.ndarray, h: float) -> np.ndarray:
    a = rate(y)
    b = rate(y + h / 2 * a)
    c = rate(y + h / 2 * b)
    return y + h / 6 * (a + 2 * (b + c) + rate(y + h * c))


def _pinocchio_model(engine: object, system: System) -> object:
    model, base, still = engine.Model(), 0, engine.SE3.Identity()
    model.gravity.linear = np.array([0.0, 0.0, -system.gravity])
    if system.cart:
        base = model.addJoint(0, engine.JointModelPX(), still, "cart")
        model.appendBodyToJoint(base, engine.Inertia(system.cart.mass, np.zeros(3), np.eye(3)), still)
    about, joint, length = engine.JointModelRevoluteUnaligned(np.array([0.0, -1.0, 0.0])), base, 0.0
    for number, (top, m, l, c, moment) in enumerate(links_of(system)):
        parent, drop = (base, 0.0) if top else (joint, length)
        place = engine.SE3(np.eye(3), np.array([0.0, 0.0, -drop]))
        joint, length = model.addJoint(parent, about, place, f"joint {number}"), l
        solid = engine.Inertia(m, np.array([0.0, 0.0, -c]), np.diag([moment, moment, 0.0]))
        model.appendBodyToJoint(joint, solid, still)
    return model


TOLERANCES, SERIES, STEPS = (
    (1e-4, 1e-6, 1e-8, 1e-10, 1e-12),
    (1e-6, 1e-9, 1e-12),
    (0.02, 0.01, 0.005, 0.002, 0.001, 0.0005, 0.0002),
)
DEFAULT = "ours, default"
ROUTES = {
    DEFAULT: Route(default, TOLERANCES, "numpy", partial(colour, 0), "o"),
    "ours, numba": Route(numba_body, TOLERANCES, "numba", partial(colour, 2), "s"),
    "ours, Taylor": Route(taylor, SERIES, "heyoka", partial(colour, 4), "^"),
    "ours, maximal": Route(maximal, TOLERANCES, "numpy", partial(colour, 5), "D"),
    "ours, in space": Route(spatial, TOLERANCES, "numpy", partial(colour, 3), "v"),
    "dense, DOP853": Route(dense("DOP853"), TOLERANCES, "scipy", secondary_colour, "o", False),
    "dense, LSODA": Route(dense("LSODA"), TOLERANCES, "scipy", secondary_colour, "s", False),
    "MuJoCo, RK4": Route(mujoco, STEPS, "mujoco", partial(colour, 1), "D", False),
    "heyoka alone": Route(heyoka_alone, SERIES, "heyoka", ink, "^", False),
    "numba alone, RK4": Route(numba_alone, STEPS, "numba", ink, "s", False),
    "numba alone, DOP853": Route(numba_dop853, TOLERANCES, "numba", ink, "D", False),
    "Pinocchio, RK4": Route(pinocchio, STEPS, "pinocchio", ink, "v", False),
}
