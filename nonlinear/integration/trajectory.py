"""The result of a run: states at sampled times, derived quantities, and the drifts that certify it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from math import inf
from typing import TYPE_CHECKING, Any

import numpy as np

from modal.report import HTML_ROWS, Displayed, Summary, TextResult, counted, deferred, tabulated
from modal.scene import Scene, name_of
from modal.types import Floats
from nonlinear.dynamics import Mechanics
from nonlinear.system import NO_FRICTION, NO_KICKS, Equations, EventRecord, Friction, Kicks, Motion, State, System

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ENERGY_NOISE = 1e-7
"""Tolerance: of the potential energy, the range of energies of a motion that hardly moves and is all rounding."""
SHOWN_ANGLES_MAX = 200_000
"""Cost: angles of a run whose energy drift is computed to be shown (benchmarks/simulation.py)."""
CLOSED = "closed form"  # the method where nothing is integrated
TRUNCATED = "truncated"  # the form with a few mode shapes


@dataclass(frozen=True, repr=False)
class SolverInfo(Displayed):
    """How a trajectory was computed: the form of the equations, the method, and the reason; counts; why it ended.

    `drift` is the largest constraint violation before projection, relative to the lengths of the scene; `reduced`
    describes the integrated system if it was less than the whole scene. `error` is the estimated bound on the error
    of any angle (rad) where an accuracy was requested, inf if it is unknown.

    >>> from modal import load
    >>> from nonlinear import simulate
    >>> how = simulate(load("chain-2"), 1.0, method="RK45", form="minimal").run
    >>> how.form, how.method, how.tolerance, how.steps > 0
    ('minimal', 'RK45', 1e-09, True)
    """

    form: str
    method: str
    reason: str
    tolerance: float
    steps: int = 0
    calls: int = 0
    drift: float = 0.0
    stopped: str = ""
    interrupted: bool = False
    reduced: str = ""
    error: float = inf

    def _summary(self) -> Summary:
        facts = [("tolerance", f"{self.tolerance:g}"), ("steps", str(self.steps)), ("calls", str(self.calls))]
        facts += [(name, text) for name in ("reason", "reduced", "stopped") if (text := getattr(self, name))]
        return Summary(f"Computed by {self.method} in {self.form} form", facts)


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory(TextResult):
    """A scene's motion at `times` (T,) in s, the events on the way, and how it was computed.

    `kicks` are those of escapements, `friction` the phases of dry friction; `driven` says whether anything acted from
    outside, `equations` holds the equations of a run made in this process, which files and pickles omit.

    >>> from modal import load
    >>> from nonlinear import simulate
    >>> run = simulate(load("chain-2"), 1.0, output=5)
    >>> run.times.tolist(), run.motion.links.shape, run.complete
    ([0.0, 0.25, 0.5, 0.75, 1.0], (5, 2), True)
    """

    scene: Scene
    system: System
    times: Floats
    motion: Motion
    run: SolverInfo
    happenings: tuple[EventRecord, ...] = ()
    kicks: Kicks = NO_KICKS
    friction: Friction = NO_FRICTION
    driven: bool = False
    equations: Equations | None = field(default=None, repr=False)
    writer = "nonlinear.postprocessing.summary:text"
    _title, _repr_html_ = Displayed._title, Displayed._repr_html_

    def __repr__(self) -> str:
        quick = len(self.times) * self.system.n_links <= SHOWN_ANGLES_MAX
        return super().__repr__() if quick else Displayed.__repr__(self)

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "equations": None}

    def __copy__(self) -> Trajectory:
        return replace(self)

    @cached_property
    def mechanics(self) -> Mechanics:
        """Positions, energies and momenta."""
        support = self.system.support
        displacements = support.displacements(self.times, 3 if self.system.spatial else 2) if support else None
        return Mechanics(self.system, self.motion, self.times, displacements)

    def at(self, rows: Any) -> Trajectory:
        """The trajectory at some of its times: a slice, indices or a mask."""
        return replace(self, times=self.times[rows], motion=self.motion.at(rows))

    @property
    def final(self) -> State:
        """The last state, from which another run can continue."""
        return self.motion[-1]

    @property
    def complete(self) -> bool:
        """Whether the run reached its end."""
        return not self.run.stopped

    def uninterrupted(self) -> Trajectory:
        """The trajectory itself; KeyboardInterrupt where Ctrl-C cut it short."""
        if self.run.interrupted:
            raise KeyboardInterrupt
        return self

    @cached_property
    def _steady(self) -> Mechanics:
        """The motion in a frame without coasting: rounding would dominate the energy of a fast free cart."""
        if not self.keeps_momentum:
            return self.mechanics
        coasting = self.mechanics.momentum / self.system.total_mass
        return Mechanics(self.system, replace(self.motion, cart_rate=self.motion.cart_rate - coasting), self.times)

    @cached_property
    def energy_scale(self) -> float:
        """The reference of an energy drift (J): the range of the energies over the run, or its work.

        Where hardly anything moves it is ENERGY_NOISE of the potential energy, so that the drift is not all rounding.
        """
        kinetic, potential = self._steady.energies
        ranges = kinetic.max(), np.ptp(potential), abs(self.motion.work).max(), ENERGY_NOISE * abs(potential).max()
        return float(max(ranges)) or 1.0

    @cached_property
    def energy_error(self) -> Floats:
        """(E(t) − E(0) − work done by dampers and applied forces) / `energy_scale`, (T,)."""
        energy = self._steady.energy
        return np.asarray((energy - energy[0] - self.motion.work) / self.energy_scale)

    def energy_drift(self) -> float:
        """The largest |energy_error|."""
        return float(np.max(np.abs(self.energy_error)))

    @property
    def keeps_momentum(self) -> bool:
        """Whether momentum along the rail is conserved: that of a cart which coasts, under no load."""
        return self.system.coasts and not self.driven

    @property
    def keeps_spin(self) -> bool:
        """Whether angular momentum about the vertical is conserved: in space, each pendulum on a fixed support."""
        return self.system.spatial and self.system.first == 0 and not (self.system.works or self.driven)

    def momentum_drift(self) -> float:
        """The largest change of a conserved momentum over Σ m |v| without coasting, or Σ m r |v|; else NaN."""
        mechanics, mass = self.mechanics, self.system.mass
        speed = np.linalg.norm(mechanics.speeds, axis=-1)
        if self.keeps_momentum:
            rail_rate = mechanics.speeds[..., 0] - mechanics.momentum[:, None] / self.system.total_mass
            invariant, scale = mechanics.momentum, (np.hypot(rail_rate, mechanics.speeds[..., -1]) @ mass).max()
        elif self.keeps_spin:
            invariant, scale = mechanics.spin, ((speed * np.linalg.norm(mechanics.centres, axis=-1)) @ mass).max()
        else:
            return float("nan")
        return float(np.max(np.abs(invariant - invariant[0])) / (scale or 1.0))

    def constraint_drift(self) -> float:
        """The largest constraint violation before projection; 0 in minimal coordinates."""
        return self.run.drift

    def to_dict(self) -> dict[str, Floats]:
        """Time, angles, rates, a cart and the work where something does any (T,), by the names of the columns of a CSV.

        >>> from modal import load
        >>> from nonlinear import simulate
        >>> list(simulate(load("chain-1"), 1.0, output=5).to_dict())
        ['time_s', 'theta_1_1_rad', 'theta_dot_1_1_rad_per_s']
        """
        columns: dict[str, Floats] = deferred("nonlinear.files:columns_of")(self)
        return columns

    def to_xarray(self) -> Any:
        """The motion as an `xarray.Dataset` over `time`, `pendulum` and `link`, with units in the attributes.

        In space links have unit vectors over `axis` in place of angles. Pendula with fewer links than others have NaN
        below their last. Raise MissingExtraError without xarray, the extra of that name.
        """
        return deferred("nonlinear.postprocessing.datasets:dataset_of")(self)

    def plot(self, theme: str = "") -> Figure:
        """A matplotlib figure in a theme, light or dark: angles, the cart, energies, phase portrait and spectrum.

        >>> from modal import load
        >>> from nonlinear import simulate
        >>> len(simulate(load("chain-1"), 5.0).plot().axes)
        4
        """
        figure: Figure = deferred("modal.plotting.style:figure_at")(
            "nonlinear.plotting.run:run_figure", self, theme=theme
        )
        return figure

    def _summary(self) -> Summary:
        times, run = self.times, self.run
        several = counted(len(times), "time", "times")
        title = f"Motion of {name_of(self.scene)}: {several} from {times[0]:g} to {times[-1]:g} s"
        facts = [("by", f"{run.method}, {run.form} form")]
        if len(times) * self.system.n_links <= SHOWN_ANGLES_MAX:
            facts.append(("energy drift", f"{self.energy_drift():.1e}"))
        if self.happenings:
            facts.append(("events", str(len(self.happenings))))
        if run.stopped:
            facts.append(("stopped", run.stopped))
        first = self.at(slice(0, HTML_ROWS))
        summary = tabulated(title, facts, first.to_dict())
        return replace(summary, total=len(times))
