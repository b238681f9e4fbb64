"""Which equations, body and integrator a run takes, and why."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec

import numpy as np

from modal.errors import SceneError
from modal.modes import natural_modes
from modal.scene import Scene
from nonlinear.minimal import Minimal, Recursion
from nonlinear.plant import Group, Plant
from nonlinear.short import Dense
from nonlinear.state import Load, System
from nonlinear.steppers import EXPLICIT, SCIPY
from nonlinear.suspended import Body

METHODS = ("auto", *SCIPY, "taylor")
FORMS = ("auto", "minimal", "maximal", "hamiltonian", "spatial")
MOST_SURVEYED = 2000  # links of a scene whose modes are asked for first
STIFF = 30.0  # fastest decay over the fastest swing
LIGHT = 1e-2  # a cart lighter than this share of what hangs from it: the dense form would lose digits
SHORT, FEW = 12, 200  # links of a short chain; pendula of a group that is solved as one band
TAYLOR_LINKS, FINE, LONG = 40, 1e-11, 2000.0  # links that compile quickly; tolerance and periods that pay for it
PLAIN_CALL, PLAIN_LINK, COMPILER = 3e-5, 5e-8, 2.0  # seconds: one derivative in NumPy, each link's part, the compiler


@dataclass(frozen=True)
class Survey:
    """The fastest swing and the fastest decay of a scene about its rest (rad/s, 1/s); zero where unknown."""

    swing: float
    decay: float


@dataclass(frozen=True)
class Choice:
    """The form of the equations, who solves them, the integrator, and why these were taken."""

    form: str
    method: str
    compiled: bool
    reason: str


def survey(scene: Scene) -> Survey:
    """What the linear modes say beforehand of the time scales."""
    if scene.n_links > MOST_SURVEYED:
        return Survey(0.0, 0.0)
    found = natural_modes(scene).eigenvalue
    swings = np.abs(found[np.abs(found.imag) > np.abs(found.real)])
    return Survey(float(swings.max(initial=0.0)), float(np.max(-found.real, initial=0.0)))


def choose(
    scene: Scene, duration: float, tolerance: float, method: str = "auto", form: str = "auto", *, driven: bool = False
) -> Choice:
    """Fill in what is "auto"; SceneError names every word that is unknown or does not fit the scene."""
    space = scene.space == "space"
    problems = [] if method in METHODS else [f"method {method}: must be one of {', '.join(METHODS)}"]
    if form not in FORMS:
        problems.append(f"form {form}: must be one of {', '.join(FORMS)}")
    elif space and form not in {"auto", "spatial"}:
        problems.append(f"form {form}: is for the plane, and this scene is in space")
    if method == "taylor" and (space or form not in {"auto", "minimal"} or driven):
        problems.append("method taylor: runs plane scenes in minimal coordinates without applied forces")
    form = form if form != "auto" else "spatial" if space else "minimal"
    if form in {"spatial", "maximal"} and method in SCIPY and method not in EXPLICIT:
        problems.append(f"method {method}: cannot keep the constraints of the {form} form; {', '.join(EXPLICIT)} can")
    if problems:
        raise SceneError(problems)
    method, why = (method, "as asked for") if method != "auto" else _automatic(scene, duration, tolerance, form, driven)
    compiled = form == "minimal" and not driven and method in SCIPY and _worth_compiling(scene, duration, tolerance)
    return Choice(form, method, compiled, why + (", compiled" if compiled else ""))


def _automatic(scene: Scene, duration: float, tolerance: float, form: str, driven: bool) -> tuple[str, str]:
    if form == "minimal" and scene.has_damping:
        found = survey(scene)
        if found.decay > STIFF * max(found.swing, 1 / duration):
            return "Radau", f"the fastest decay, {found.decay:.3g}/s, is far faster than the fastest swing"
    if form == "minimal" and not driven and _taylor_pays(scene, duration, tolerance):
        return "taylor", "a long or very accurate run, and heyoka is installed"
    return "DOP853", "no part of the motion decays far faster than it swings"


def periods(scene: Scene, duration: float) -> float:
    """Roughly how many of its fastest periods a scene goes through."""
    swing = survey(scene).swing
    shortest = min(link.length for link in scene.links())
    return duration * (swing or float(np.sqrt(4 * scene.gravity / shortest))) / (2 * np.pi)


def _taylor_pays(scene: Scene, duration: float, tolerance: float) -> bool:
    if find_spec("heyoka") is None or scene.n_links > TAYLOR_LINKS:
        return False
    return tolerance < FINE or periods(scene, duration) > LONG


def _worth_compiling(scene: Scene, duration: float, tolerance: float) -> bool:
    """Whether what a compiled body saves is more than loading the compiler costs, about a second."""
    if find_spec("numba") is None:
        return False
    calls = 12 * 4 * periods(scene, duration) * (1e-6 / tolerance) ** (1 / 8)
    return bool(calls * (PLAIN_CALL + PLAIN_LINK * scene.n_links) > COMPILER)


def body_of(group: Group, plant: Plant) -> Body:
    """Who solves one group in NumPy: dense matrices for short chains, a band for long ones, else the recursion."""
    hanging = sum(float(g.block.mass.sum()) for g in plant.groups)
    if plant.cart is not None and plant.cart.mass < LIGHT * hanging:
        return Recursion(group)
    if group.n <= SHORT:
        return Dense(group)
    from nonlinear.banded import Banded

    return Banded(group) if group.index.shape[1] <= FEW else Recursion(group)


def system_of(plant: Plant, choice: Choice, load: Load | None = None) -> System:
    """The equations of motion in the chosen form."""
    if choice.form == "spatial":
        from nonlinear.spatial import Recursion as InSpace
        from nonlinear.spatial import Spatial

        return Spatial(plant, tuple(InSpace(group) for group in plant.groups), load)
    if choice.form == "maximal":
        from nonlinear.maximal import Maximal

        return Maximal(plant, load)
    if choice.form == "hamiltonian":
        from nonlinear.hamiltonian import Hamiltonian

        return Hamiltonian(plant, load)
    if choice.compiled:
        from nonlinear.compiled import Compiled

        return Compiled(plant)
    return Minimal(plant, tuple(body_of(group, plant) for group in plant.groups), load)
