"""The plain route: one member by `simulate`, for scenes that no engine takes side by side."""

from __future__ import annotations

from typing import Any

import numpy as np

from modal.errors import SceneError
from modal.scene import Scene
from modal.types import Floats
from nonlinear.ensembles.found import Found, Section
from nonlinear.ensembles.measures import Columns, Context, places
from nonlinear.ensembles.question import Question
from nonlinear.integration import Trajectory
from nonlinear.integration.costs import reproducible
from nonlinear.postprocessing import extremes
from nonlinear.simulation import simulate
from nonlinear.system import Event, Layout, Motion, State, numbers_of

STATES = {
    "links": "links_rad",
    "link_rates": "link_rates_rad_per_s",
    "cart": "cart_m",
    "cart_rate": "cart_rate_m_per_s",
}
"""The parts of a state as columns."""
TURNS, SECTION = "over the top", "section"
IN_SPACE = ("largest_angle", "pendulum_energy")
"""Measures that mean something in space."""


def validate_plain(measures: tuple[str, ...], scene: Scene) -> None:
    """SceneError for measures that runs one by one cannot have."""
    problems = ["lyapunov: needs smooth motion in the plane"] if "lyapunov" in measures else []
    if scene.space == "space":
        problems += [
            f"{name}: only for motion in the plane" for name in measures if name not in (*IN_SPACE, "lyapunov")
        ]
    if problems:
        raise SceneError(problems)


@reproducible()
def columns(question: Question, scene: Scene, start: State) -> Columns:
    """What is asked for of one member, each of shape (...); SimulationError where it cannot reach its end."""
    times = question.wanted.times
    needed = sorted({0.0, *times, question.duration})
    output: Any = None if question.wanted.largest else needed
    events = _events(question, scene)
    run = simulate(scene, question.duration, start=start, tolerance=question.tolerance, output=output, events=events)
    if run.run.interrupted:
        raise KeyboardInterrupt
    sampled = run
    if output is None and times:
        sampled = simulate(scene, question.duration, start=start, tolerance=question.tolerance, output=needed)
    found: Columns = {
        "energy_drift": np.array(run.energy_drift()),
        "error_rad": np.array(np.nan),
        "horizon_s": np.array(np.nan),
    }
    found |= _measured(question, scene, run, sampled)
    rows = np.searchsorted(sampled.times, question.times)
    if question.keeps_end:
        found |= _states(run.motion.at(slice(-1, None)), single=True)
    if question.times:
        found |= _states(sampled.motion.at(rows), single=False)
    return found


def _states(motion: Motion, single: bool) -> Columns:
    parts = {column: getattr(motion, part) for part, column in STATES.items()}
    return {name: own[0] if single else own for name, own in parts.items()}


def _measured(question: Question, scene: Scene, run: Trajectory, sampled: Trajectory) -> Columns:
    found: Columns = {}
    names = question.measures.names
    if run.system.spatial:
        return _in_space(question, run, sampled)
    layout = Layout(run.system.n_links, 1, run.system.cart is not None, run.system.works)
    rows = _rows(layout, sampled)
    ending = rows[np.searchsorted(sampled.times, question.ending)][None] if question.ending else rows[None, :0]
    whole = Found(rows[-1:].T, np.full(1, np.nan), np.full(1, np.nan))
    if "first_turn" in names:
        whole.first_turns = np.array([[_first(run, f"{TURNS} {place}")] for place in places(run.system)])
    if "largest_angle" in names:
        whole.largest = np.array([np.abs(extremes(run.times, run.motion.links, run.motion.link_rates)).max()])
    context = Context(scene, run.system, numbers_of(scene), layout, rows[:1].T, question.wanted)
    for measure in question.measures.measures:
        found |= {name: own[0] for name, own in measure.columns(context, whole, ending).items()}
    if question.measures.section:
        found |= _crossings(run, question.measures.section, layout)
    return found


def _in_space(question: Question, run: Trajectory, sampled: Trajectory) -> Columns:
    found: Columns = {}
    if "largest_angle" in question.measures.names:
        height, _ = extremes(run.times, run.motion.links[..., 2], run.motion.link_rates[..., 2])
        found["largest_angle_deg"] = np.degrees(np.arccos(np.clip(height, -1.0, 1.0)).max())
    if "pendulum_energy" in question.measures.names:
        mechanics = sampled.at(np.searchsorted(sampled.times, question.ending)).mechanics
        mean = mechanics.of_pendula(mechanics.kinetic + mechanics.potential).mean(0)
        found |= {f"pendulum_{p}_energy_J": own for p, own in enumerate(mean, 1)}
    return found


def _rows(layout: Layout, run: Trajectory) -> Floats:
    """The y of a run, (T, size)."""
    motion = run.motion
    cart = ([motion.cart[:, None]], [motion.cart_rate[:, None]]) if layout.on_cart else ([], [])
    work = [motion.work[:, None]] if layout.works else []
    return np.hstack([*cart[0], motion.links, *cart[1], motion.link_rates, *work])


def _events(question: Question, scene: Scene) -> list[Event]:
    found = []
    if question.wanted.first_turns:
        for link, place in enumerate(places(question.system)):
            found.append(Event(f"{TURNS} {place}", lambda state, link=link: float(np.cos(state.links[link] / 2))))  # type: ignore[misc]
    if section := question.measures.section:
        found.append(Event(SECTION, _passing(section, int(question.system.cart is not None))))
    return found


def _passing(section: Section, first: int) -> Any:
    if section.row < first:
        return lambda state: state.cart - section.level
    return lambda state: float(np.sin((state.links[section.row - first] - section.level) / 2))


def _first(run: Trajectory, name: str) -> float:
    return min((event.time for event in run.happenings if event.name == name), default=np.inf)


def _crossings(run: Trajectory, section: Section, layout: Layout) -> Columns:
    first = int(layout.on_cart)
    crossed = []
    for event in run.happenings:
        state = event.state
        speed = state.cart_rate if section.row < first else state.link_rates[section.row - first]
        if event.name == SECTION and section.direction * speed >= 0:
            crossed.append(event)
    count, links = len(crossed), run.system.n_links
    return {
        "crossing_time_s": np.array([event.time for event in crossed]),
        "crossing_links_rad": np.array([event.state.links for event in crossed]).reshape(count, links),
        "crossing_link_rates_rad_per_s": np.array([event.state.link_rates for event in crossed]).reshape(count, links),
        "crossing_cart_m": np.array([event.state.cart for event in crossed]),
        "crossing_cart_rate_m_per_s": np.array([event.state.cart_rate for event in crossed]),
    }
