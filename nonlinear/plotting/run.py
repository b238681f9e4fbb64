"""A run in one picture: angles, cart, energies, phase portrait and spectrum, with the linear frequencies marked."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from modal.errors import ComputationError, MultipendulaError
from modal.modes import natural_modes
from modal.plotting.curves import draw_curves, is_blob, pick
from modal.plotting.layout import caption, even_choice, headline, legend, mark_modes, set_frame
from modal.plotting.style import (
    CURVE_POINTS,
    HUES,
    VISIBLE_SHARE,
    WIDE,
    colour,
    ink,
    rest,
    secondary_colour,
    sheet_of_rows,
)
from modal.plotting.vibration import QUANTITIES
from modal.scene import Scene, title_of
from modal.scene.doors import require_type
from modal.scene.signal_names import link_names, signal_words
from modal.statespace.loops import loops_of
from modal.types import Floats
from nonlinear.dynamics.inputs import HeldInputs, input_of
from nonlinear.integration import Trajectory
from nonlinear.plotting.scene import ANGLES_AT_ONCE, carrier_name
from nonlinear.postprocessing import WINDOW_NAME, power_spectrum, resample, resolution
from nonlinear.system import Layout

SPECTRUM_SAMPLES = 32
"""Limit: fewest samples of a spectrum: "too few or uneven samples"."""
PORTRAIT_SWINGS = 100
"""Format: swings from which on a portrait is drawn as dots: this many lines fill it."""
STILL_METRES = 1e-9
"""Format: motion of a cart that is at rest but for rounding, which is not magnified."""
SPECTRUM_DEPTH = 1e-10
"""Format: smallest power that a spectrum shows over the strongest line: below are the side lobes of its window."""


class _CurvePanel(NamedTuple):
    """A title, the label of the axis, and curves (T,) by their names."""

    title: str
    label: str
    curves: dict[str, Floats]


@dataclass(frozen=True)
class _DrawnLinks:
    """The links drawn, from 0, their names, and how many links they stand for, with those that coincide with them."""

    links: list[int]
    names: list[str]
    stand_for: int

    @classmethod
    def of(cls, trajectory: Trajectory) -> _DrawnLinks:
        """Of many links some evenly spaced."""
        links, names, stand_for = pick(degrees(trajectory)[0].T, link_names(trajectory.system.labels), HUES)
        return cls(links.tolist(), names, stand_for)


def run_figure(trajectory: Trajectory) -> Figure:
    """The picture of a run; of many links it draws some and the range of all, as its caption says.

    Links that move alike throughout are one curve with one name.  Raise ComputationError for a run of a single instant.
    """
    require_type("trajectory", trajectory, "Trajectory")
    if len(trajectory.times) < 2:
        raise ComputationError("a run with a single sample cannot be drawn")
    smooth = _smooth(trajectory)
    feedback, notes = _feedback_panels(smooth)
    panels = [*_carrier_panels(smooth), *_prescribed_panels(smooth), *feedback]
    figure = sheet_of_rows(max(5 + len(panels), 6) / 2, WIDE)
    rows = 6 if len(panels) < 2 else 2 * (2 + len(panels))
    grid = figure.add_gridspec(rows, 2, width_ratios=(3, 2))
    tall = 2 if panels else 3
    angles = figure.add_subplot(grid[:tall, 0])
    energies = figure.add_subplot(grid[-tall:, 0], sharex=angles)
    links = _DrawnLinks.of(trajectory)
    _angles(angles, smooth, links)
    for k, panel in enumerate(panels):
        _draw_panel(figure.add_subplot(grid[2 + 2 * k : 4 + 2 * k, 0], sharex=angles), smooth.times, panel)
    _energies(energies, trajectory)
    _portrait(figure.add_subplot(grid[: rows // 2, 1]), smooth, links)
    _spectrum(figure.add_subplot(grid[rows // 2 :, 1]), trajectory, links)
    headline(figure, title_of(trajectory.scene), "motion")
    caption(figure, "; ".join([_caption(trajectory, links), *notes]))
    return figure


def _smooth(trajectory: Trajectory) -> Trajectory:
    """The run with points between its samples, where these are so few that corners would show."""
    times = trajectory.times
    if len(times) >= CURVE_POINTS or CURVE_POINTS * trajectory.system.n_links > ANGLES_AT_ONCE:
        return trajectory
    fine = np.linspace(times[0], times[-1], CURVE_POINTS)
    try:
        return replace(trajectory, times=fine, motion=resample(times, trajectory.motion, fine))
    except ComputationError:
        return trajectory


def degrees(trajectory: Trajectory) -> tuple[Floats, Floats]:
    """Angles (deg) and rates (deg/s) of every link, (T, L); in space those of the angle from the vertical."""
    motion = trajectory.motion
    if not trajectory.system.spatial:
        return np.rad2deg(motion.links), np.rad2deg(motion.link_rates)
    down, rate = motion.links[..., 2], motion.link_rates[..., 2]
    side = np.linalg.norm(motion.links[..., :2], axis=-1)
    with np.errstate(all="ignore"):
        slope = np.where(side > 0, -rate / side, np.linalg.norm(motion.link_rates, axis=-1))
    return np.rad2deg(np.arctan2(side, down)), np.rad2deg(slope)


def _range(axis: Axes, times: Floats, values: Floats, what: str) -> None:
    """The range of all curves (T, K), in grey behind those drawn."""
    style: dict[str, Any] = {"color": rest(), "alpha": 0.6, "lw": 0, "zorder": 0}
    axis.fill_between(times, values.min(1), values.max(1), label=f"range of all {values.shape[1]} {what}", **style)


def _angles(axis: Axes, trajectory: Trajectory, chosen_links: _DrawnLinks) -> None:
    values, times = degrees(trajectory)[0], trajectory.times
    curves = [(times, values[:, link]) for link in chosen_links.links]
    has_band = draw_curves(axis, curves, names=chosen_links.names, bands=True)
    single = trajectory.system.n_pendula in (1, trajectory.system.n_links)
    if chosen_links.stand_for < values.shape[1]:
        _range(axis, times, values, "pendula" if single and trajectory.system.n_pendula > 1 else "links")
    from_what = "from the vertical" if trajectory.system.spatial else "from the downward vertical"
    set_frame(axis, "time (s)", "angle (°)", f"Angles {from_what}")
    legend(axis, least_count=1 if has_band else 2)


def _carrier_panels(trajectory: Trajectory) -> list[_CurvePanel]:
    """The supports of the pendula, a panel for each unit."""
    system, carriers = trajectory.system, dict[str, dict[str, Floats]]()
    coordinates = Layout.of(system, works=False).carrier_coordinates(trajectory.motion)[0].T
    for name, values in zip(system.labels, coordinates, strict=False):
        unit = "rad" if name.endswith("_rad") else "m" if name == "x" or name.endswith("_m") else "each unit"
        column = np.rad2deg(values) if unit == "rad" else values
        carriers.setdefault(unit, {})[name.removesuffix(f"_{unit}").replace("_", " ")] = column
    words = {"rad": "angle (°)", "m": "displacement (m)", "each unit": "coordinate (each unit)"}
    if system.cart is not None:
        return [_CurvePanel("Cart", "position x (m)", curves) for curves in carriers.values()]
    return [_CurvePanel("Structure", words[unit], curves) for unit, curves in carriers.items()]


def _feedback_panels(trajectory: Trajectory) -> tuple[list[_CurvePanel], list[str]]:
    """The inputs of feedback loops, a panel for each unit, and notes; loops that act on one place are added."""
    system, exerted, notes = trajectory.system, dict[str, dict[str, Floats]](), list[str]()
    if not system.loops:
        return [], notes
    states, held_inputs = Layout.of(system, works=False).rows(trajectory.motion).T, iter(list[Floats]())
    try:
        held_inputs = iter(_held_inputs(trajectory))
    except ComputationError:
        notes = ["no sampled feedback drawn: samples of the run are too far apart"]
    for loop, acting in zip(loops_of(trajectory.scene), system.loops, strict=True):
        values = next(held_inputs, None) if acting.sample_time else input_of(acting, states)
        if values is not None:
            curves, name = exerted.setdefault(loop.signal.unit, {}), signal_words(loop.signal.name)
            curves[name] = curves.get(name, 0.0) + values
    labels = {unit: f"{QUANTITIES.get(unit, 'generalized force')} ({unit})" for unit in exerted}
    return [_CurvePanel("Feedback", labels[unit], curves) for unit, curves in exerted.items()], notes


def _held_inputs(trajectory: Trajectory) -> Iterable[Floats]:
    """What each sampled loop exerts (T,); ComputationError where the run has too few samples to tell."""
    system, times, held = trajectory.system, trajectory.times, HeldInputs(trajectory.system.loops)
    if system.is_sampled:
        samples = held.begin(float(times[0]), float(times[-1]))
        states = Layout.of(system, works=False).rows(resample(times, trajectory.motion, np.array(samples)))
        for time, state in zip(samples, states, strict=True):
            held.take(time, state.tolist())
    return held.beside(times)


def _prescribed_panels(trajectory: Trajectory) -> list[_CurvePanel]:
    """The prescribed motions, of the support or the ground and hoisted lengths."""
    system, times, panels = trajectory.system, trajectory.times, list[_CurvePanel]()
    if system.support:
        right, *_, down = system.support.displacements(times, 2).T
        ways = {"to the right": right, "upwards": -down}
        curves = {name: values for name, values in ways.items() if np.any(values)}
        owner = "Ground" if system.structure is not None else "Support"
        panels.append(_CurvePanel(f"{owner}, as prescribed", "displacement (m)", curves or {"to the right": right}))
    if system.hoisting is not None:
        lengths, moving = system.hoisting.at(times)[0], system.hoisting.moving
        names = link_names(system.labels)
        curves = {names[link]: lengths[:, link] for link in np.flatnonzero(moving).tolist()}
        panels.append(_CurvePanel("Hoist, as prescribed", "length (m)", curves))
    return panels


def _draw_panel(axis: Axes, times: Floats, panel: _CurvePanel) -> None:
    names, values = list(panel.curves), list(panel.curves.values())
    numbers, labels, stand_for = pick(np.array(values), names, HUES)
    if len(names) == 1:
        has_band = _carrier(axis, times, values[0], names[0])
    else:
        has_band = draw_curves(axis, [(times, values[k]) for k in numbers], names=labels, bands=True)
    part = f": {stand_for} of {len(names)}" if stand_for < len(names) else ""
    set_frame(axis, "time (s)", panel.label, panel.title + part)
    if panel.label.endswith("(m)") and np.ptp(values, axis=1).max() < STILL_METRES:
        axis.set_ylim(values[0][0] - 1, values[0][0] + 1)
    legend(axis, least_count=2 if panel.title == "Cart" and not has_band else 1)


def _carrier(axis: Axes, times: Floats, values: Floats, name: str) -> bool:
    """The curve of the supports of the pendula, in ink; whether it is a band."""
    return draw_curves(axis, [(times, values)], names=[name], bands=True, color=ink(), lw=1.2)


def _energies(axis: Axes, trajectory: Trajectory) -> None:
    """Kinetic and potential energy of one pendulum on a fixed support, else the energies of pendula and cart."""
    mechanics, times = trajectory.mechanics, trajectory.times
    kinetic = mechanics.of_pendula(mechanics.kinetic)
    potential = mechanics.of_pendula(mechanics.potential)
    carrier, energy = carrier_name(trajectory.system), kinetic + potential
    curves, stand_for = {"kinetic": kinetic[:, 0], "potential": potential[:, 0], "total": energy[:, 0]}, 1
    if energy.shape[1] > 1 or carrier:
        names = [f"pendulum {k}" for k in range(1, energy.shape[1] + 1)]
        numbers, labels, stand_for = pick(energy.T, names, HUES)
        curves = dict(zip(labels, energy[:, numbers].T, strict=True))
    draw_curves(axis, [(times, energy) for energy in curves.values()], names=list(curves), bands=True)
    if carrier:
        _carrier(axis, times, mechanics.cart_kinetic + mechanics.cart_potential, carrier)
    if stand_for < energy.shape[1]:
        _range(axis, times, energy, "pendula")
    set_frame(axis, "time (s)", "energy (J)", "Energy above equilibrium")
    axis.set_ylim(min(0.0, axis.get_ylim()[0]), None)
    legend(axis)


def _portrait(axis: Axes, trajectory: Trajectory, chosen_links: _DrawnLinks) -> None:
    if trajectory.system.spatial:
        _top_view(axis, trajectory)
        return
    (angles, rates), rests = degrees(trajectory), np.where(trajectory.system.by_link("sigma") > 0, 0.0, 180.0)
    curves = [_wrap(angles[:, link], rates[:, link], rests[link]) for link in chosen_links.links]
    if any(is_blob(angles[:, link], PORTRAIT_SWINGS, np.ptp(angles[:, link])) for link in chosen_links.links):
        for k, (curve, name) in enumerate(zip(curves, chosen_links.names, strict=True)):
            axis.plot(*curve, ls="", marker=".", ms=1.6, mew=0, color=colour(k), label="_dots", rasterized=True)
            axis.plot([], [], ls="", marker="o", ms=5, color=colour(k), label=name)
        words = "Phase portraits of the same links,\nsamples as dots"
    else:
        draw_curves(axis, curves, names=chosen_links.names, first=1)
        words = "Phase portraits of the same links"
    set_frame(axis, "angle (°)", "rate (°/s)", words)
    legend(axis, 3)


def _wrap(angles: Floats, rates: Floats, rest: float) -> tuple[Floats, Floats]:
    """Angles within ±180° of equilibrium, the curve broken where it wraps."""
    wrapped_angles = (angles - rest + 180) % 360 - 180 + rest
    leaps = np.flatnonzero(np.abs(np.diff(wrapped_angles)) > 180) + 1
    return np.insert(wrapped_angles, leaps, np.nan), np.insert(rates, leaps, np.nan)


def _top_view(axis: Axes, trajectory: Trajectory) -> None:
    tips = sorted(int(group.index[-1, k]) for group in trajectory.system.groups for k in range(group.index.shape[1]))
    choice = even_choice(len(tips), HUES)
    curves = [tuple(trajectory.mechanics.joints[:, tips[k], :2].T) for k in choice]
    draw_curves(axis, curves, names=[f"pendulum {k + 1}" for k in choice], first=1)
    axis.set_aspect("equal", adjustable="datalim")
    axis.locator_params(axis="x", nbins=5)
    part = f" of {len(choice)} of {len(tips)} pendula" if len(choice) < len(tips) else ""
    set_frame(axis, "along the rail (m)", "across (m)", f"Tips{part} from above")
    legend(axis, 3)


def _spectrum(axis: Axes, trajectory: Trajectory, chosen_links: _DrawnLinks) -> None:
    set_frame(axis, "angular frequency ω (rad/s)", "power (°² s)")
    times = trajectory.times
    is_even = len(times) >= SPECTRUM_SAMPLES and np.ptp(np.diff(times)) < 1e-6 * (times[1] - times[0])
    if not is_even:
        axis.set_title("Spectrum", loc="left")
        axis.text(
            0.5, 0.5, "too few or uneven samples", ha="center", color=secondary_colour(), transform=axis.transAxes
        )
        return
    spectra = [_power(trajectory, link) for link in chosen_links.links]
    omega, highest = spectra[0][0], max(float(power.max()) for _, power in spectra)
    marks = _linear(trajectory.scene, float(omega[-1]))
    last = min(omega[-1], max(3 * max(marks) if marks else _reach(spectra), 2 * resolution(times)))
    is_shown = omega <= 1.1 * last
    lowest = highest * SPECTRUM_DEPTH
    powers = [np.where((power > 0) & is_shown, np.maximum(power, lowest / 10), np.nan) for _, power in spectra]
    has_band = draw_curves(axis, [(omega[is_shown], power[is_shown]) for power in powers], log="y", bands=True)
    axis.set_xlim(0, last)
    if highest > 0:
        axis.set_yscale("log")
        axis.set_ylim(lowest, 10 * highest)
    mark_modes(axis, list(enumerate(marks, 1)), has_numbers=False)
    words = f"; dotted: modes{_without(trajectory.scene)}" if marks else ""
    words += "; bands: least to most" if has_band else ""
    axis.set_title(f"Spectrum{words}\n{WINDOW_NAME} window, resolution {resolution(times):.2g} rad/s", loc="left")


def _without(scene: Scene) -> str:
    """The effects that the marked modes omit, where they move the peaks."""
    if scene.is_hoisted:
        return " before the hoist"
    return " without dry friction" if scene.has_friction else ""


def _reach(spectra: list[tuple[Floats, Floats]]) -> float:
    """The angular frequency (rad/s) above which no power of note is seen."""
    highest = max(float(power.max()) for _, power in spectra)
    return max(float(omega[power >= VISIBLE_SHARE * highest].max(initial=0.0)) for omega, power in spectra)


def _power(trajectory: Trajectory, link: int) -> tuple[Floats, Floats]:
    """The power spectrum of a link's angle; in space the sum of those along the rail and across it."""
    if not trajectory.system.spatial:
        return power_spectrum(trajectory.times, degrees(trajectory)[0][:, link])
    leans = np.rad2deg(trajectory.motion.links[:, link, :2]).T
    (omega, along_rail), (_, across_rail) = (power_spectrum(trajectory.times, lean) for lean in leans)
    return omega, along_rail + across_rail


def _linear(scene: Scene, highest: float) -> list[float]:
    """The natural frequencies (rad/s) up to the highest that is drawn, none where they cannot be computed."""
    try:
        modes = natural_modes(scene)
    except MultipendulaError:
        return []
    swinging = modes.omega[modes.eigenvalue.imag != 0]
    return [float(value) for value in swinging if 0 < value < highest]


def resolving_duration(scene: Scene, shortest: float, *, times_as_long: float = 5.0, most_modes: int = 12) -> float:
    """How long (s) a run of a scene of few modes is whose spectrum separates those that this many times as long could.

    >>> from modal import load
    >>> resolving_duration(load("tower"), 20.0), resolving_duration(load("paper-cart-2"), 20.0)
    (65.0, 20.0)
    """
    omega = np.unique(_linear(scene, np.inf))
    if len(omega) > most_modes:
        return shortest
    needed = resolution(np.array([0.0, 1.0])) / np.diff(omega)
    return float(np.ceil(needed[needed <= times_as_long * shortest].max(initial=shortest)))


def _caption(trajectory: Trajectory, chosen_links: _DrawnLinks) -> str:
    info, momentum = trajectory.run, trajectory.momentum_drift()
    words = [f"{info.method} at tolerance {info.tolerance:g}, {info.steps} steps"]
    words.append(f"energy drift {trajectory.energy_drift():.1e}")
    words += [f"momentum drift {momentum:.1e}"] if np.isfinite(momentum) else []
    links = trajectory.system.n_links
    if chosen_links.stand_for < links:
        words.append(f"{chosen_links.stand_for} of {links} links drawn, evenly spaced")
    if info.stopped:
        words.append(info.stopped)
    return "; ".join(words)
