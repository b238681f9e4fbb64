"""Positions and velocities of a scene: at one time, or at several along a leading axis.

The integrator's vector is y = (x, links, x', links', work): x and x' only with a cart, work only where it is
integrated.  On a structure the coordinates η of its supports stand in the place of x.

In space a link is the unit vector u = (sin θ cos φ, sin θ sin φ, cos θ), along the rail, across it, down: θ is the
angle from the downward vertical, φ the azimuth from the rail; the last axis of an array holds the components.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, NamedTuple, Protocol, TypeVar

import numpy as np

from modal.report import Displayed, Summary, brief, counted, summary_of
from modal.types import Floats
from nonlinear.system.system import System


@dataclass(frozen=True, eq=False, repr=False)
class State(Displayed):
    """Links in the order of the file: angles (L,) in rad from the downward vertical, unit vectors in space.

    In space `links` is (L, 3) with components along the rail, across it and down, `link_rates` (L, 3) its derivative
    (1/s).  `cart` (m) and `cart_rate` (m/s) are 0 on a fixed support.  `supports` and `support_rates` (d,) are the
    coordinates of a structure (m, rad) and their rates, empty on any other support.

    >>> import numpy as np
    >>> from modal import load
    >>> from nonlinear import State, simulate
    >>> run = simulate(load("chain-2"), 1.0, start=State(np.radians([10.0, 0.0]), np.zeros(2)))
    >>> round(float(np.degrees(run.motion[0].links[0])), 9)
    10.0
    """

    links: Floats
    link_rates: Floats
    cart: float = 0.0
    cart_rate: float = 0.0
    supports: Floats = field(default_factory=lambda: np.zeros(0))
    support_rates: Floats = field(default_factory=lambda: np.zeros(0))

    def _summary(self) -> Summary:
        facts = [("cart (m)", brief(self.cart)), ("cart rate (m/s)", brief(self.cart_rate))]
        if len(self.supports):
            pairs = zip(self.supports, self.support_rates, strict=True)
            facts = [
                (f"support {k}", f"{brief(place)}, rate {brief(rate)}") for k, (place, rate) in enumerate(pairs, 1)
            ]
        spatial = self.links.ndim == 2
        names = ("direction", "rate (1/s)") if spatial else ("angle (rad)", "rate (rad/s)")
        rows = (
            (str(link), brief(angle), brief(rate))
            for link, (angle, rate) in enumerate(zip(self.links, self.link_rates, strict=True), start=1)
        )
        title = f"State of {counted(len(self.links), 'link', 'links')}"
        return Summary(title, facts, ("link", *names), rows, len(self.links))


@dataclass(frozen=True, eq=False, repr=False)
class Motion(Displayed):
    """States at T times: `links` and `link_rates` (T, L) or (T, L, 3), `cart` and `cart_rate` (T,).

    `work` (T,) is the work of dampers and applied forces since the start (J).  `supports` and `support_rates` (T, d)
    are the coordinates of a structure and their rates, (T, 0) on any other support.

    >>> from modal import load
    >>> from nonlinear import simulate
    >>> motion = simulate(load("chain-2"), 1.0, output=5).motion
    >>> motion.links.shape, motion[-1].links.shape, motion.cart.tolist()
    ((5, 2), (2,), [0.0, 0.0, 0.0, 0.0, 0.0])
    """

    links: Floats
    link_rates: Floats
    cart: Floats
    cart_rate: Floats
    work: Floats
    supports: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    support_rates: Floats = field(default_factory=lambda: np.zeros((0, 0)))

    def __post_init__(self) -> None:
        if not self.supports.size:
            none = np.zeros((len(self.cart), 0))
            object.__setattr__(self, "supports", none)
            object.__setattr__(self, "support_rates", none)

    def _summary(self) -> Summary:
        count, links = self.links.shape[:2]
        space = " in space" if self.links.ndim == 3 else ""
        return Summary(f"States of {counted(links, 'link', 'links')}{space} at {counted(count, 'time', 'times')}")

    def __getitem__(self, at: int) -> State:
        cart = float(self.cart[at]), float(self.cart_rate[at])
        return State(self.links[at], self.link_rates[at], *cart, self.supports[at], self.support_rates[at])

    def at(self, rows: Any) -> Motion:
        """The motion at some of the times: a slice, indices or a mask."""
        return Motion(*(getattr(self, part.name)[rows] for part in fields(self)))


def apart(motion: Motion, other: Motion) -> Floats:
    """The largest angle (rad) between the links of two motions at every time, (T,), modulo full turns."""
    if motion.links.ndim == 3:
        chord = np.linalg.norm(motion.links - other.links, axis=-1)
        return np.asarray(2 * np.arcsin(np.minimum(chord / 2, 1.0)).max(axis=1))
    difference = motion.links - other.links
    return np.asarray(np.abs(difference - 2 * np.pi * np.round(difference / (2 * np.pi))).max(axis=1))


class AppliedForces(NamedTuple):
    """External loads: a force on the cart (N) and moments on links, (L,) or in space (L, 3) (N m).

    `supports` (d,) are generalized forces (N, N m) on the coordinates of a structure.

    >>> from modal import load
    >>> from nonlinear import AppliedForces, simulate, state_at_rest
    >>> scene = load("paper-cart-1")
    >>> start = state_at_rest(scene, [0.0, 0.0])
    >>> run = simulate(scene, 1.0, start=start, load=lambda t, state: AppliedForces(cart=2.0), breaks=[])
    >>> run.driven, bool(run.motion.cart[-1] > 0)
    (True, True)
    """

    cart: float = 0.0
    moments: Floats | None = None
    supports: Floats | None = None

    def __repr__(self) -> str:
        acts = self.cart or self.moments is not None or self.supports is not None
        return summary_of(self).text() if acts else "no forces"


Load = Callable[[float, State], AppliedForces]


class Equations(Protocol):
    """Equations of motion in the form an integrator needs."""

    @property
    def system(self) -> System:
        """The scene as arrays."""

    @property
    def load(self) -> Load | None:
        """The external load."""

    def derivative(self, time: float, y: Floats) -> Floats:
        """The time derivative of y, (size,)."""

    def begin(self, state: State) -> Floats:
        """The vector y of a state."""

    def read(self, rows: Floats) -> Motion:
        """The motion in vectors (T, size)."""

    @property
    def scale(self) -> Floats:
        """Natural units of y, (size,)."""

    def project(self, y: Floats) -> tuple[Floats, float]:
        """The nearest y that satisfies every constraint, and the largest violation removed (0 without any)."""


@dataclass(frozen=True)
class Layout:
    """The arrangement of y: `width` numbers per link, `first` coordinates before those of links.

    `works` says whether the work is the last component of y, `is_structured` whether the first coordinates are those of
    a structure, not of one cart.
    """

    links: int
    width: int
    first: int
    works: bool
    is_structured: bool = False

    @classmethod
    def of(cls, system: System, *, works: bool, width: int = 1) -> Layout:
        """That of the y of a system."""
        return cls(system.n_links, width, system.first, works, system.structure is not None)

    @property
    def half(self) -> int:
        """Number of coordinates."""
        return self.first + self.links * self.width

    @property
    def size(self) -> int:
        """Length of y."""
        return 2 * self.half + self.works

    def begin(self, state: State) -> Floats:
        """The vector y of a state, with zero work."""
        head: Any = []
        rate: Any = []
        if self.first:
            head, rate = [state.cart], [state.cart_rate]
        if self.is_structured:
            head, rate = state.supports, state.support_rates
        work = [0.0] if self.works else []
        return np.concatenate((head, np.ravel(state.links), rate, np.ravel(state.link_rates), work))

    def rows(self, motion: Motion) -> Floats:
        """The vectors y (T, size) of a motion."""
        head, rate = self.carrier_coordinates(motion)
        links, rates = (np.reshape(entries, (len(entries), -1)) for entries in (motion.links, motion.link_rates))
        return np.hstack([head, links, rate, rates, *[motion.work[:, None]] * self.works])

    def carrier_coordinates(self, motion: Motion) -> tuple[Floats, Floats]:
        """The coordinates of the supports of the pendula, and their rates, (T, first) each."""
        if self.is_structured:
            return motion.supports, motion.support_rates
        return motion.cart[:, None][:, : self.first], motion.cart_rate[:, None][:, : self.first]

    def read(self, rows: Floats) -> Motion:
        """The motion in vectors (T, size)."""
        times, first, none = len(rows), self.first, np.zeros(len(rows))
        shape = (times, self.links) if self.width == 1 else (times, self.links, self.width)
        q, v = rows[:, : self.half], rows[:, self.half : 2 * self.half]
        on_cart, carriers = first and not self.is_structured, first if self.is_structured else 0
        return Motion(
            links=q[:, first:].reshape(shape),
            link_rates=v[:, first:].reshape(shape),
            cart=q[:, 0] if on_cart else none,
            cart_rate=v[:, 0] if on_cart else none,
            work=rows[:, -1] if self.works else none,
            supports=q[:, :carriers],
            support_rates=v[:, :carriers],
        )

    def natural(self, system: System) -> Floats:
        """Natural units of y, (size,).

        1 for links, l for the cart, sqrt(g/l) and l sqrt(g/l) for their rates, g Σ b for work.
        """
        half = np.ones(self.half)
        half[: self.first] = system.first_units
        return np.concatenate((half, half * system.rate, [system.energy] * self.works))

    def state(self, y: Floats) -> State:
        """The state of one vector y."""
        return self.read(y[None])[0]


StateOrMotion = TypeVar("StateOrMotion", State, Motion)


def unit_vectors(angles: Any, azimuths: Any) -> Floats:
    """Unit vectors (..., 3) of θ and φ (rad)."""
    theta, phi = np.broadcast_arrays(angles, azimuths)
    return np.stack((np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)), axis=-1)


def velocities(angles: Any, azimuths: Any, rates: Any) -> Floats:
    """Time derivatives (..., 3) in 1/s of unit vectors whose θ changes at `rates` (rad/s) with φ fixed."""
    theta, phi, rate = np.broadcast_arrays(angles, azimuths, rates)
    tangents = np.stack((np.cos(theta) * np.cos(phi), np.cos(theta) * np.sin(phi), -np.sin(theta)), axis=-1)
    return np.asarray(rate[..., None] * tangents)


def motion_of(states: Sequence[State]) -> Motion:
    """States as rows, without work."""
    links, rates, cart, speed, *supports = (
        np.array([getattr(state, part) for state in states])
        for part in ("links", "link_rates", "cart", "cart_rate", "supports", "support_rates")
    )
    return Motion(links, rates, cart, speed, np.zeros(len(states)), *supports)


def of_plane(state: StateOrMotion) -> StateOrMotion:
    """Angles (..., L) as unit vectors (..., L, 3) in the vertical plane of the rail."""
    u, w = unit_vectors(state.links, 0.0), velocities(state.links, 0.0, state.link_rates)
    return replace(state, links=u, link_rates=w)


def angles_of(u: Floats) -> tuple[Floats, Floats]:
    """θ in [0, π] and φ in (−π, π] (rad) of vectors (..., 3) of any length; φ is 0 on the vertical."""
    x, y, z = np.moveaxis(u, -1, 0)
    return np.arctan2(np.hypot(x, y), z), np.arctan2(y, x)


def unwound(state: State) -> State:
    """The same state with all links turned back by whole turns, to angles from −180° to 180°."""
    return replace(state, links=state.links - 2 * np.pi * np.round(state.links / (2 * np.pi)))
