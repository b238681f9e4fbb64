"""A run in one picture: angles, cart, energies, phase portrait and spectrum, with the linear frequencies marked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import IO

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from modal.errors import ComputationError, MultipendulaError
from modal.modes import natural_modes
from modal.plotting import WIDE, caption, colour, dash, framed, headline, ink, legend, muted, save, sheet, thickness
from modal.scene import title_of
from modal.types import Floats
from nonlinear.integration import Trajectory
from nonlinear.postprocessing import power_spectrum, resample

MOST_LINES, MOST_PORTRAITS, MOST_MARKS, FEWEST = 6, 3, 12, 32
MOST_SMOOTHED, POINTS = 20_000, 6000  # size of a run up to which it is interpolated, and points drawn
DEEPEST = 1e-10  # smallest power shown in a spectrum over the strongest line


def draw_run(trajectory: Trajectory, stream: IO[bytes], *, kind: str = "png") -> None:
    """Write the picture of a run as png, svg or pdf; ComputationError for a run of a single instant."""
    save(run_figure(trajectory), stream, kind)


def run_figure(trajectory: Trajectory) -> Figure:
    """The picture of a run; of many links it shows the first few, as its caption says."""
    if len(trajectory.times) < 2:
        raise ComputationError("a run with a single sample cannot be drawn")
    on_cart = trajectory.system.cart is not None
    figure = sheet(WIDE, 8.6 if on_cart else 7.2)
    grid = figure.add_gridspec(6, 2, width_ratios=(3, 2))
    tall = 2 if on_cart else 3
    angles = figure.add_subplot(grid[:tall, 0])
    energies = figure.add_subplot(grid[-tall:, 0], sharex=angles)
    shown = _shown(trajectory)
    smooth = _smooth(trajectory)
    _angles(angles, smooth, shown)
    if on_cart:
        _cart(figure.add_subplot(grid[2:4, 0], sharex=angles), trajectory)
    _energies(energies, trajectory)
    _portrait(figure.add_subplot(grid[:3, 1]), smooth, shown[:MOST_PORTRAITS])
    _spectrum(figure.add_subplot(grid[3:, 1]), trajectory, shown)
    headline(figure, title_of(trajectory.scene), "motion")
    caption(figure, _caption(trajectory, shown))
    return figure


def _smooth(trajectory: Trajectory) -> Trajectory:
    """The run with points between its samples, where these are so few that corners would show."""
    times = trajectory.times
    if len(times) * trajectory.system.n_links > MOST_SMOOTHED:
        return trajectory
    fine = np.linspace(times[0], times[-1], POINTS)
    try:
        return replace(trajectory, times=fine, motion=resample(times, trajectory.motion, fine))
    except ComputationError:
        return trajectory


def _shown(trajectory: Trajectory) -> list[int]:
    """The links drawn: all links of the first pendula, as far as there is room."""
    return list(range(min(trajectory.system.n_links, MOST_LINES)))


def _names(trajectory: Trajectory) -> list[str]:
    """Names of the links: pendulum.link, or the link's number where there is one pendulum."""
    labels = [label for label in trajectory.system.labels if label != "x"]
    places = [label.removeprefix("theta[").removesuffix("]").split(",") for label in labels]
    alone = trajectory.system.n_pendula == 1
    return [f"link {link}" if alone else f"{pendulum}.{link}" for pendulum, link in places]


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


def _draw(axis: Axes, x: Floats, y: Floats, k: int, label: str, first: float = 2.0) -> None:
    axis.plot(x, y, dash(k), color=colour(k), lw=thickness(k, first), label=label)


def _angles(axis: Axes, trajectory: Trajectory, shown: Sequence[int]) -> None:
    values, names = degrees(trajectory)[0], _names(trajectory)
    for k, link in enumerate(shown):
        _draw(axis, trajectory.times, values[:, link], k, names[link])
    from_what = "from the vertical" if trajectory.system.spatial else "from the downward vertical"
    framed(axis, "time (s)", "angle (°)", f"Angles {from_what}")
    legend(axis)


def _cart(axis: Axes, trajectory: Trajectory) -> None:
    axis.plot(trajectory.times, trajectory.motion.cart, color=ink(), lw=1.2)
    framed(axis, "time (s)", "position x (m)", "Cart")


def _energies(axis: Axes, trajectory: Trajectory) -> None:
    """Kinetic and potential energy of one pendulum on a fixed support, else the energies of pendula and cart."""
    mechanics, times = trajectory.mechanics, trajectory.times
    kinetic = mechanics.of_pendula(mechanics.kinetic)
    potential = mechanics.of_pendula(mechanics.potential)
    if trajectory.system.n_pendula == 1 and trajectory.system.cart is None:
        curves = {"kinetic": kinetic[:, 0], "potential": potential[:, 0], "total": (kinetic + potential)[:, 0]}
    else:
        each = (kinetic + potential).T[:MOST_LINES]
        curves = {f"pendulum {number}": energy for number, energy in enumerate(each, 1)}
    for k, (name, energy) in enumerate(curves.items()):
        _draw(axis, times, energy, k, name)
    if trajectory.system.cart is not None:
        axis.plot(times, mechanics.cart_kinetic + mechanics.cart_potential, color=ink(), lw=1.2, label="cart")
    framed(axis, "time (s)", "energy (J)", "Energy above equilibrium")
    axis.set_ylim(min(0.0, axis.get_ylim()[0]), None)
    legend(axis)


def _portrait(axis: Axes, trajectory: Trajectory, shown: Sequence[int]) -> None:
    if trajectory.system.spatial:
        _top_view(axis, trajectory)
        return
    angles, rates = degrees(trajectory)
    names, rests = _names(trajectory), np.where(trajectory.system.by_link("sigma") > 0, 0.0, 180.0)
    for k, link in enumerate(shown):
        _draw(axis, *_around(angles[:, link], rates[:, link], rests[link]), k, names[link], 1.4)
    framed(axis, "angle (°)", "rate (°/s)", "Phase portrait")
    legend(axis)


def _around(angles: Floats, rates: Floats, rest: float) -> tuple[Floats, Floats]:
    """Angles within ±180° of equilibrium, the curve broken where it wraps."""
    folded = (angles - rest + 180) % 360 - 180 + rest
    leaps = np.flatnonzero(np.abs(np.diff(folded)) > 180) + 1
    return np.insert(folded, leaps, np.nan), np.insert(rates, leaps, np.nan)


def _top_view(axis: Axes, trajectory: Trajectory) -> None:
    tips = [int(group.index[-1, k]) for group in trajectory.system.groups for k in range(group.index.shape[1])]
    for k, link in enumerate(sorted(tips)[:MOST_PORTRAITS]):
        x, y = trajectory.mechanics.joints[:, link, :2].T
        _draw(axis, x, y, k, f"pendulum {k + 1}", 1.4)
    axis.set_aspect("equal", adjustable="datalim")
    framed(axis, "along the rail (m)", "across (m)", "Tips from above")
    legend(axis)


def _spectrum(axis: Axes, trajectory: Trajectory, shown: Sequence[int]) -> None:
    framed(axis, "angular frequency ω (rad/s)", "power (°² s)", "Spectrum; dotted: modes")
    times = trajectory.times
    even = len(times) >= FEWEST and np.ptp(np.diff(times)) < 1e-6 * (times[1] - times[0])
    if not even:
        axis.text(0.5, 0.5, "too few or uneven samples", ha="center", color=muted(), transform=axis.transAxes)
        return
    highest = 0.0
    for k, link in enumerate(shown):
        omega, power = _power(trajectory, link)
        _draw(axis, omega, np.where(power > 0, power, np.nan), k, "", 1.7)
        highest = max(highest, float(power.max()))
    marks = _linear(trajectory, float(omega[-1]))
    axis.set_xlim(0, min(omega[-1], 3 * max(marks, default=omega[-1])))
    if highest > 0:
        axis.set_yscale("log")
        axis.set_ylim(highest * DEEPEST, 10 * highest)
    for mark in marks:
        axis.axvline(mark, color=ink(), ls=":", lw=1.0, zorder=1)


def _power(trajectory: Trajectory, link: int) -> tuple[Floats, Floats]:
    """The power spectrum of a link's angle; in space the sum of those along the rail and across it."""
    if not trajectory.system.spatial:
        return power_spectrum(trajectory.times, degrees(trajectory)[0][:, link])
    leans = np.rad2deg(trajectory.motion.links[:, link, :2]).T
    (omega, along), (_, across) = (power_spectrum(trajectory.times, lean) for lean in leans)
    return omega, along + across


def _linear(trajectory: Trajectory, most: float) -> list[float]:
    """The natural frequencies (rad/s) within the picture, where the scene has few enough modes to mark."""
    if trajectory.system.n_links > 40 * MOST_MARKS:
        return []
    try:
        modes = natural_modes(trajectory.scene)
    except MultipendulaError:
        return []
    swinging = modes.omega[modes.eigenvalue.imag != 0]
    return [float(value) for value in swinging if 0 < value < most][:MOST_MARKS]


def _caption(trajectory: Trajectory, shown: Sequence[int]) -> str:
    run, momentum = trajectory.run, trajectory.momentum_drift()
    words = [f"{run.method} at tolerance {run.tolerance:g}, {run.steps} steps"]
    words.append(f"energy drift {trajectory.energy_drift():.1e}")
    words += [f"momentum drift {momentum:.1e}"] if np.isfinite(momentum) else []
    if len(shown) < trajectory.system.n_links:
        words.append(f"the first {len(shown)} of {trajectory.system.n_links} links drawn")
    if run.stopped:
        words.append(run.stopped)
    return "; ".join(words)
