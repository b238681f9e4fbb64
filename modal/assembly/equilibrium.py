"""The equilibrium under constant forces, and the stiffness of every link there.

A force on the point r_i below the upper joint of link i, which is l_i below it for the links above the one that it acts
on, pulls that link like a weight.  With the forces along the rail and upwards, and the torques τ,

    V = −Σ_i (B_z cos θ_i + B_x sin θ_i + τ_i θ_i) + joint springs + k_c x²/2 − (Σ F_along) x,
    B_x = Σ F_along r,    B_z = g b_i − Σ F_up r,

so that without joint springs every link has its own equation, |B| sin(θ_i − φ_i) = τ_i with φ_i the direction of B_i: a
hanging link rests near φ_i, an inverted one near φ_i + π. With joint springs the equilibrium is followed by Newton's
method from the unloaded one while the forces grow to their size.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from modal import pair
from modal.errors import SceneError
from modal.scene import Pendulum, Scene, places_of, validate_scene
from modal.types import EPS, NEWTON_ROUNDS, NOISE_OF_SUM, Floats

LOAD_TURN_MAX = 0.3
"""Tolerance: change (rad) of an angle in a step of the load, so that Newton's method stays on its branch."""
LOAD_STEP_MIN = 2.0**-20
"""Limit: share of the load; a branch that needs a smaller step ends there, as the refusal says."""


class Rest(NamedTuple):
    """The equilibrium of links: angles from hanging (rad), stiffnesses (N m/rad), and the sums of their terms.

    `stiffness` is B_z cos θ + B_x sin θ, the stiffness of a link without springs, `pull` is g b + Σ |F| r.
    """

    angle: Floats
    stiffness: Floats
    pull: Floats

    def scale(self, factor: Any) -> Rest:
        """Return the values for as many equal copies together, or in other units."""
        return self._replace(stiffness=self.stiffness * factor, pull=self.pull * factor)


class Equilibrium(NamedTuple):
    """The equilibrium of a scene under its constant forces: the cart's displacement (m), and every link's `rest`.

    The links, (L,), are in the order of the file, counting copies.
    """

    cart: float
    rest: Rest


class _Load(NamedTuple):
    """On every link (L,) B without gravity along the rail and down, torques, sums of absolute terms; on the cart."""

    horizontal: Floats
    down: Floats
    torque: Floats
    sizes: Floats
    cart: float
    on_cart: float


def equilibrium_of(scene: Scene) -> Equilibrium | None:
    """Return the equilibrium under the constant forces of a scene; None without such forces.

    Raise SceneError if there is no equilibrium: on a free cart with a net force, for a torque that gravity cannot
    balance, for a link without a restoring moment, or if the branch of hanging links ends.

    >>> from modal import load
    >>> equilibrium_of(load("chain-2")) is None
    True
    >>> from modal.scene import ConstantForce
    >>> wind = ConstantForce(on="pendulum[0].links[0]", amplitude=9.81)  # on both of its links
    >>> found = equilibrium_of(load("chain-2").replace(force=(wind,)))
    >>> np.degrees(found.rest.angle).round(3).tolist()
    [45.0, 45.0]
    """
    validate_scene(scene)
    if not scene.force or "constant_force" not in scene.features:
        return None
    load = load_of(scene)
    problems, rests = list(_imbalance(scene, load)), []
    first = 0
    for p, pendulum in enumerate(scene.pendulum):
        chain = _LoadedChain(pendulum, scene.gravity)
        for copy in range(pendulum.count):
            place = f"pendulum[{p}]" + (f".copies[{copy}]" if pendulum.count > 1 else "")
            try:
                rests.append(chain.rest(*(part[first : first + chain.n] for part in load[:4])))
            except SceneError as error:
                problems += [f"{place}{words}" for words in error.problems]
            first += chain.n
    if problems:
        raise SceneError(problems)
    stiffness = scene.cart.stiffness if scene.cart else 0.0
    cart = load.cart / stiffness if stiffness else 0.0
    return Equilibrium(cart, Rest(*(np.concatenate(parts) for parts in zip(*rests, strict=True))))


def load_of(scene: Scene, number: Callable[[Any], Any] = np.asarray) -> _Load:
    """Return the effect of constant forces on every link, in floats or, by `number`, in any other numbers."""
    horizontal, down, torque, sizes = number(np.zeros((4, scene.n_links)))
    reach, centre = number([(link.length, link.centre) for pendulum in scene.hanging for link in pendulum.chain]).T
    top = np.concatenate(
        [np.tile(np.arange(pendulum.n_links), pendulum.count) for pendulum in scene.pendulum]
    )  # links above, in the same chain
    cart = on_cart = 0.0
    for force in scene.force:
        if force.kind != "constant":
            continue
        places = places_of(scene, force.on)
        if force.direction == "horizontal":
            cart += force.amplitude * max(len(places), 1)
            on_cart += abs(force.amplitude) * max(len(places), 1)
        for link, upper_link, distance in places:
            if force.direction == "torque":
                torque[link] += force.amplitude
                sizes[link] += abs(force.amplitude)
                if distance is None and upper_link >= 0:
                    torque[upper_link] -= force.amplitude
                    sizes[upper_link] += abs(force.amplitude)
                continue
            arms = reach[link - top[link] : link + 1].copy()
            arms[-1] = centre[link] if distance is None else distance
            load = horizontal if force.direction == "horizontal" else down
            load[link - top[link] : link + 1] += arms * (force.amplitude if load is horizontal else -force.amplitude)
            sizes[link - top[link] : link + 1] += arms * abs(force.amplitude)
    return _Load(horizontal, down, torque, sizes, cart, on_cart)


def _imbalance(scene: Scene, load: _Load) -> Iterator[str]:
    """What is wrong with a free cart."""
    loose = scene.cart is not None and not scene.cart.stiffness
    if loose and abs(load.cart) > NOISE_OF_SUM * load.on_cart:
        yield (
            f"support.stiffness = 0: the constant forces along the rail add up to {load.cart:.6g} N, which nothing "
            "holds: there is no equilibrium; give the cart a spring, or balance them"
        )


class _LoadedChain:
    """One copy of a pendulum: g b of its links, springs at its joints, and the angles at which these are relaxed."""

    def __init__(self, pendulum: Pendulum, gravity: float) -> None:
        mass, length, centre, self.springs = np.array(
            [(link.mass, link.length, link.centre, link.stiffness) for link in pendulum.chain]
        ).T
        self.n = len(mass)
        self.weight = gravity * np.array(pair.first_moments(mass, length, centre))
        self.stands = np.array([way == "up" for way in pendulum.ways])
        self.relaxed = np.pi * self.stands
        self.names = [f".links[{k}]" for k, link in enumerate(pendulum.links) for _ in range(link.count)]

    def rest(self, horizontal: Floats, down: Floats, torque: Floats, sizes: Floats) -> Rest:
        """The equilibrium under a load on every link, (n,) each; SceneError without one."""
        if self.springs.any():
            theta = self._follow_load(horizontal, down, torque)
        else:
            theta = self._free_angles(horizontal, self.weight + down, torque, sizes)
        stiffness = (self.weight + down) * np.cos(theta) + horizontal * np.sin(theta)
        return Rest(theta, stiffness, self.weight + sizes)

    def _free_angles(self, horizontal: Floats, down: Floats, torque: Floats, sizes: Floats) -> Floats:
        """The angles of links without springs, each separately."""
        pull, problems = np.hypot(horizontal, down), []
        for k in range(self.n):
            if pull[k] <= NOISE_OF_SUM * (self.weight[k] + sizes[k]):
                problems.append(f"{self.names[k]}: gravity and the constant forces on it and below it cancel")
            elif abs(torque[k]) >= pull[k]:
                problems.append(
                    f"{self.names[k]}: a constant torque of {torque[k]:.6g} N m turns it over: gravity and the forces "
                    f"hold at most {pull[k]:.6g} N m"
                )
        if problems:
            raise SceneError([f"{words}: there is no equilibrium" for words in dict.fromkeys(problems)])
        turn = np.arcsin(torque / pull)
        sign = np.where(self.stands, -1.0, 1.0)
        theta: Floats = np.arctan2(sign * horizontal, sign * down) + sign * turn
        return np.asarray(np.where(self.stands & (theta < -NOISE_OF_SUM), theta + 2 * np.pi, theta))

    def _follow_load(self, horizontal: Floats, down: Floats, torque: Floats) -> Floats:
        """With joint springs, from the unloaded equilibrium while the load grows."""
        theta, share, step = self.relaxed.copy(), 0.0, 1.0
        while share < 1:
            step = min(step, 1 - share)
            equilibrium = self._newton(theta, *((share + step) * part for part in (horizontal, down, torque)))
            if equilibrium is None:
                step /= 2
                if step < LOAD_STEP_MIN:
                    raise SceneError([self._ends(share)])
                continue
            theta, share, step = equilibrium, share + step, 1.5 * step
        if not self.stands.any() and np.linalg.eigvalsh(self._stiffness(theta, horizontal, self.weight + down))[0] <= 0:
            raise SceneError(
                [": its equilibrium under the constant forces is unstable: links buckle before they are reached"]
            )
        return theta

    def _ends(self, share: float) -> str:
        return f": at {100 * share:.3g} % of the constant forces its equilibrium ends: there is none under all of them"

    def _newton(self, start: Floats, horizontal: Floats, down: Floats, torque: Floats) -> Floats | None:
        """The equilibrium near a start; None if Newton's method goes elsewhere."""
        theta, total, size = start, self.weight + down, np.inf
        for _ in range(NEWTON_ROUNDS):
            bend = np.diff(theta - self.relaxed, prepend=0.0)
            moments = self.springs * bend
            slope = total * np.sin(theta) - horizontal * np.cos(theta) - torque + moments - np.append(moments[1:], 0.0)
            try:
                change = np.linalg.solve(self._stiffness(theta, horizontal, total), -slope)
            except np.linalg.LinAlgError:
                return None
            last, size = size, float(np.abs(change).max())
            theta = np.asarray(theta + change)
            if not np.abs(theta - start).max() <= LOAD_TURN_MAX:
                return None
            if size <= EPS**0.5 and size >= last / 2:  # rounding is left, which shrinks no more
                return theta
        return None

    def _stiffness(self, theta: Floats, horizontal: Floats, down: Floats) -> Floats:
        """∇²V."""
        K = np.diag(down * np.cos(theta) + horizontal * np.sin(theta) + self.springs + np.append(self.springs[1:], 0.0))
        rows = np.arange(self.n - 1)
        K[rows, rows + 1] = K[rows + 1, rows] = -self.springs[1:]
        return K
