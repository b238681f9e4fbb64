"""Tubes around a motion: balls at every time that provably contain each coordinate and rate (extra `certified`)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from decimal import ROUND_CEILING, Context, Decimal
from fractions import Fraction
from functools import cached_property
from math import ceil, log10
from typing import Any, NamedTuple

import numpy as np

from modal.errors import ComputationError, SceneError
from modal.exact import flint
from modal.report import ReportColumn, Result, silent
from modal.scene import CAPABILITIES, Scene, require
from modal.scene.doors import checked, checked_number
from modal.scene.signal_names import symbols_in
from modal.types import Floats
from nonlinear.dynamics import Generated
from nonlinear.dynamics.generated import WRITTEN_LINKS_MAX
from nonlinear.integration.arguments import TIGHTEST, sample_times
from nonlinear.integration.lohner import LohnerSet
from nonlinear.integration.trajectory import SolverInfo, Trajectory
from nonlinear.system import State, System, apart, initial_state, system_of, validate_state

PROVED = "proved"  # the method of a trajectory of midpoints


def at_most(value: Decimal | float, digits: int = 2) -> str:
    """A number in this many digits, rounded up.

    >>> at_most(1.01e-7), at_most(Decimal(3))
    ('1.1e-7', '3.0e+0')
    """
    return f"{Context(prec=digits, rounding=ROUND_CEILING).create_decimal(Decimal(value)):.{digits - 1}e}"


class DecimalBall(NamedTuple):
    """All numbers within `radius` of `mid`, both exact."""

    mid: Decimal
    radius: Decimal

    @property
    def words(self) -> str:
        """The digits of the midpoint that are certain, at most 17."""
        size = abs(self.mid)
        certain = 17 if not self.radius else int((size / self.radius).log10()) if size > self.radius else 0
        return f"{self.mid:.{min(certain, 17)}g}" if certain > 0 else f"0 ± {at_most(size + self.radius, 1)}"


class TubeRow(NamedTuple):
    """A time (s) and balls around y there: coordinates (rad, m), then their rates, then the work (J) where any is."""

    time: float
    balls: tuple[DecimalBall, ...]
    size: int

    @property
    def radius(self) -> float:
        """The largest radius of a coordinate or a rate, in SI units."""
        return float(max(ball.radius for ball in self.balls[: self.size]))


@dataclass(frozen=True, eq=False, repr=False)
class Tube(Result):
    """A proved motion: `rows` with a ball around every coordinate and rate of the motion at these times.

    It began with the `start` as it is stored, in double precision, and the numbers of the equations are those of the
    other methods.  `digits` were carried in this many `steps`.
    """

    what = "proved motion"

    scene: Scene
    system: System
    rows: tuple[TubeRow, ...]
    start: State
    digits: int
    steps: int

    @property
    def radius(self) -> float:
        """The largest radius of a coordinate or a rate at any of the times, in SI units."""
        return max(row.radius for row in self.rows)

    @cached_property
    def trajectory(self) -> Trajectory:
        """The midpoints, rounded to double precision, as a run whose `run.error` is proved."""
        layout = Generated(self.system).layout
        mids = np.array([[float(ball.mid) for ball in row.balls] for row in self.rows])
        size = float(np.abs(mids[:, : 2 * layout.half]).max())
        run = SolverInfo(
            "minimal", PROVED, "enclosed", TIGHTEST, self.steps, error=self.radius + float(np.spacing(size))
        )
        times = np.array([row.time for row in self.rows])
        return Trajectory(self.scene, self.system, times, layout.read(mids), run)

    @property
    def radii(self) -> Floats:
        """The largest radius (T,) of a coordinate or a rate at every time."""
        return np.array([row.radius for row in self.rows])

    def distance(self, trajectory: Trajectory) -> Floats:
        """Bounds (T,) on the error of any angle (rad) of a run of the same motion, sampled at the same times."""
        rounding = float(self.trajectory.run.error) - self.radius
        return np.asarray(apart(trajectory.motion, self.trajectory.motion) + self.radii + rounding)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The components of y as a CSV of a run calls them."""
        keys, links, first = list(self.trajectory.to_dict()), self.system.n_links, self.system.first
        links_end, first_end = 1 + 2 * links, 1 + 2 * links + 2 * first
        angles, rates = keys[1 : 1 + links], keys[1 + links : links_end]
        x, x_rates = keys[links_end : links_end + first], keys[links_end + first : first_end]
        work = keys[first_end : first_end + len(self.rows[0].balls) - 2 * (links + first)]
        return (*x, *angles, *x_rates, *rates, *work)

    def columns(self) -> tuple[ReportColumn, ...]:
        """The time, every component and its radius; in text the coordinates alone."""
        half = self.system.n_links + self.system.first
        columns = [ReportColumn("time", "time_s", "time (s)", ".9g")]
        for k, name in enumerate(self.names):
            heading = (
                f"{symbols_in(self.system.labels[k])} ({'rad' if name.endswith('_rad') else 'm'})" if k < half else None
            )
            columns.append(ReportColumn(_part_of(k, "words"), None, heading, str))
            columns.append(ReportColumn(_part_of(k, "mid"), name))
            columns.append(ReportColumn(_part_of(k, "radius"), f"{name}_radius"))
        return (*columns, ReportColumn("radius", None, "radius", at_most))

    def facts(self) -> dict[str, Any]:
        """The largest radius, and how it was found."""
        return {"radius": self.radius, "digits": self.digits, "steps": self.steps}

    def whole(self) -> dict[str, Any]:
        """The rows, with midpoint and radius of every component as decimal numbers."""
        rows = []
        for row in self.rows:
            balls = [{"mid": str(ball.mid), "radius": str(ball.radius)} for ball in row.balls]
            rows.append({"time_s": row.time} | dict(zip(self.names, balls, strict=True)))
        return {**super().whole(), self.key: rows}

    def footnotes(self) -> Iterator[str]:
        """Notes on the proof."""
        yield (
            f"proved: the motion that begins with the stored numbers stays within {at_most(self.radius)} of these "
            "values at these times, in rad, m and their rates; uncertain digits are omitted."
        )
        yield f"{self.steps} Taylor steps with {self.digits} digits, in ball arithmetic."


def _part_of(component: int, part: str) -> Callable[[TubeRow], str]:
    """A column's value: a part of the ball around this component, as a decimal number."""
    return lambda row: str(getattr(row.balls[component], part))


@checked
def enclose_motion(
    scene: Scene,
    duration: float,
    *,
    radius: float = 1e-10,
    output: int | Sequence[float] | Floats | None = 11,
    start: State | None = None,
    start_time: float = 0.0,
    report: Callable[[float], object] = silent,
    digits_max: int = 300,
) -> Tube:
    """Enclose the motion of a scene over `duration` seconds in a tube of at most this `radius`.

    Digits are added, from the beginning again, until the radius is met: of chaotic motion it grows exponentially
    [Lohner1988].

    Parameters
    ----------
    scene
        A scene in the plane whose equations are analytic; an error names what is not.
    duration
        The time (s).
    radius
        The largest radius of any coordinate (rad, m) or rate at any of the times, from 1e-200 to 1e-6.
    output
        A number of evenly spaced times, or times after the start (s), ascending.
    start
        The initial condition in place of that of the scene file, taken as stored.
    start_time
        The time (s) of the start, for drives that depend on it.
    report
        Is called with the time reached (s) after every step.
    digits_max
        The most digits that are tried.

    Returns
    -------
    Tube
        Balls around every coordinate and rate at these times.

    Raises
    ------
    SceneError
        Arguments are invalid, or the scene has what no tube follows.
    ComputationError
        Nothing encloses the motion from some time on, as where quadratic drag meets a mass at rest.
    MissingExtraError
        python-flint is not installed (extra `certified`).

    Examples
    --------
    >>> from modal import load
    >>> from nonlinear.integration import enclose_motion
    >>> tube = enclose_motion(load("chain-1"), 1.0, radius=1e-20, output=3)
    >>> tube.rows[-1].balls[0].words, tube.radius < 1e-20
    ('-0.17451208681762761', True)
    """
    require(scene, "a proved motion")
    flint()
    checked_number("radius", radius, 1e-200, 1e-6)
    system = system_of(scene)
    if system.n_links > WRITTEN_LINKS_MAX:
        raise SceneError([f"the scene has {system.n_links} links: a proved motion takes at most {WRITTEN_LINKS_MAX}"])
    equations = Generated(system)
    if equations.inputs.count and not equations.is_time_only:
        raise SceneError(["a proved motion supports only sines in time, not records, sweeps or other functions"])
    times = sample_times(scene, duration, start_time, output)
    state = validate_state(start if start is not None else initial_state(scene), system)
    y = [flint().arb(number) for number in equations.layout.begin(state).tolist()]
    digits = ceil(-log10(radius)) + 6
    while digits <= digits_max:
        carried = LohnerSet(equations, y, Fraction(start_time), digits)
        try:
            rows = tuple(_rows(carried, times, radius, report))
        except ComputationError as error:
            raise ComputationError("; ".join([str(error), *_kinks(scene)])) from None
        if len(rows) == len(times):
            return Tube(scene, system, rows, state, digits, carried.steps)
        lost = digits + log10(carried.radius)
        expected = ceil(lost * duration / float(carried.time - Fraction(start_time)) - log10(radius)) + 3
        digits = max(digits + 4, min(expected, 2 * digits))
    raise ComputationError(
        f"a radius of {radius:g} until {times[-1]:g} s takes more than {digits_max} digits: ask for a shorter duration"
    )


def _kinks(scene: Scene) -> list[str]:
    """The possible causes of the end of a tube."""
    sentences = CAPABILITIES["a proved motion"].unless
    return [sentences[feature] for feature in ("quadratic_drag", "massless_cart") if feature in scene.features]


def _rows(carried: LohnerSet, times: Floats, radius: float, report: Callable[[float], object]) -> Iterator[TubeRow]:
    """The rows of a tube, as far as its radius is at most this."""
    size, pending = carried.balls.mechanical, times.tolist()
    while pending:
        step = carried.advance()
        while pending and Fraction(pending[0]) <= carried.time:
            balls = step.at(Fraction(pending[0]))
            row = TubeRow(pending[0], tuple(_decimal(ball, radius) for ball in balls), size)
            if row.radius > radius:
                return
            yield row
            pending.pop(0)
        if carried.radius > radius:
            return
        report(min(float(carried.time), float(times[-1])))


def _decimal(ball: Any, radius: float) -> DecimalBall:
    """A ball in decimal numbers around it, to a thousandth of its radius, or of the one requested if that is more."""
    size, finest = abs(float(ball.mid())), max(float(ball.rad()), radius) / 1000
    digits = max(17, ceil(log10(size / finest))) if size else 17
    mid, rest, exponent = ball.mid_rad_10exp(digits)
    return DecimalBall(Decimal(f"{mid}E{exponent}"), Decimal(f"{rest}E{exponent}"))
