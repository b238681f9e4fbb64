"""Prescribed lengths of the ropes of a scene as functions of time, and the linear equations along them.

A bob at the end of a rope with length l(t) moves sideways by l θ and down by l. The displacements h q of all centres
along the rail therefore have rows h of lengths that change in time, (h q)'' = h q'' + 2 h' q' + h'' q, and every centre
has the velocity w_k = Σ_{j≤k} σ_j l_j' downwards even at rest. With the masses m and the coefficients d of drag

    D += Σ m hᵀ 2h' + d hᵀh,    K += Σ m hᵀ h'' + d hᵀ h',

and the force that pulls a mass k down, and restores all links above it, is m_k (g − w_k') − d_k w_k in place of m_k g.
Quadratic drag |v| v is linear in a motion that is small compared with w: it adds `quadratic_drag` |w| to d, and twice
that to the drag of a pivot that moves up and down. On a structure (`modal.assembly.structure`) rows begin with those of
the pivots, and what draws the masses down bends its coordinates; what it pushes up and down as it speeds up is no term
of these.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from math import isfinite
from typing import Any

import numpy as np

from modal.assembly.arrays import Rig, rig_of
from modal.assembly.linearization import Matrices, coordinate_labels, matrices_of
from modal.assembly.structure import Hanging, scene_squares
from modal.errors import SceneError
from modal.scene import Bob, Scene, validate_scene
from modal.scene.doors import checked
from modal.scene.points import PendulumPoint, parse_point
from modal.types import Floats, Ints

Law = Callable[[Any], tuple[Any, Any, Any]]
"""Length (m), speed (m/s) and acceleration (m/s²) at times (s)."""
Hoists = Mapping[tuple[int, int], Any]
"""Laws by pendulum and link entry of the scene, both from 0: splines with derivatives, or functions as `Law`."""


POSITIVE = "hoist: a length must be a positive number of metres, with finite speed, at all times"
LEANS = (
    "force: along a hoist the equilibrium under constant forces would change: remove the force, or take the lengths of "
    "one time, `Scene.at(seconds)`"
)


@dataclass(frozen=True, eq=False)
class Hoisting:
    """The lengths (L,) of all links, in the order of the file, with the positions (k,) and laws of the variable ones.

    `custom_laws` are those given in place of the scene's.
    """

    base: Floats
    laws: tuple[tuple[Ints, Law], ...]
    custom_laws: Hoists | None = None

    @cached_property
    def moving(self) -> Any:
        """Which links (L,) change their length."""
        moving = np.zeros(len(self.base), dtype=bool)
        for index, _ in self.laws:
            moving[index] = True
        return moving

    @cached_property
    def breaks(self) -> tuple[float, ...]:
        """The times (s) at which a derivative of a length may jump, ascending."""
        return tuple(sorted({time for _, law in self.laws for time in getattr(law, "breaks", ())}))

    def at(self, times: Any) -> tuple[Floats, Floats, Floats]:
        """Lengths (..., L) in m, their speeds (m/s) and accelerations (m/s²) at times (...) in s.

        Raise SceneError if a law gives a length that is not positive, or values that are not finite.
        """
        shape = (*np.shape(times), len(self.base))
        lengths = np.broadcast_to(self.base, shape).copy(), np.zeros(shape), np.zeros(shape)
        for index, law in self.laws:
            for array, part in zip(lengths, law(times), strict=True):
                array[..., index] = np.asarray(part, dtype=np.float64)[..., None]
        if not (np.all(lengths[0] > 0) and all(np.all(np.isfinite(part)) for part in lengths)):
            raise SceneError([POSITIVE])
        return lengths


@dataclass(frozen=True)
class Spline:
    """The law of a spline with `derivative`, or of a function of one time that returns three numbers."""

    function: Any

    def __call__(self, times: Any) -> tuple[Any, Any, Any]:
        """Length, speed and acceleration."""
        if hasattr(self.function, "derivative"):
            return self.function(times), self._speed(times), self._acceleration(times)
        if np.ndim(times):
            columns = np.array([self.function(float(time)) for time in np.ravel(times)]).T
            return tuple(column.reshape(np.shape(times)) for column in columns)
        return self.function(float(times))  # type: ignore[no-any-return]

    @cached_property
    def _speed(self) -> Any:
        return self.function.derivative(1)

    @cached_property
    def _acceleration(self) -> Any:
        return self.function.derivative(2)

    def at(self, time: float) -> tuple[float, float, float]:
        """Return the same at one time (s) in plain floats; raise SceneError as `Hoisting.at` does."""
        length, speed, acceleration = (float(part) for part in self(time))
        if not (length > 0 and isfinite(length + speed + acceleration)):
            raise SceneError([POSITIVE])
        return length, speed, acceleration

    @property
    def breaks(self) -> tuple[float, ...]:
        """The knots of a spline."""
        return tuple(np.unique(getattr(self.function, "x", ())).tolist())


def hoisting_of(scene: Scene, hoists: Hoists | None = None) -> Hoisting | None:
    """Return the lengths of a scene, with the laws `hoists` in place of its own; None if no length changes.

    Raise SceneError for a law of a link that is not a bob or does not exist, and for one that does not return three
    numbers.
    """
    validate_scene(scene)
    if not (hoists or scene.is_hoisted):
        return None
    if not isinstance(hoists or {}, Mapping):
        raise SceneError(["hoist: must be a mapping such as {(0, 0): spline}"])
    custom_laws = dict(hoists or {})
    base: list[float] = []
    laws: list[tuple[Ints, Law]] = []
    for p, pendulum in enumerate(scene.pendulum):
        at, places = len(base), []
        for i, link in enumerate(pendulum.links):
            places.append((i, len(base) - at + np.arange(link.count)))
            base += [link.length] * link.count
        base += base[at:] * (pendulum.count - 1)
        first = at + pendulum.n_links * np.arange(pendulum.count)
        for i, links in places:
            link, function = pendulum.links[i], custom_laws.pop((p, i), None)
            index = np.add.outer(first, links).ravel()
            if function is not None:
                laws.append((index, _law_of(function, link, f"hoist of pendulum[{p}].links[{i}]")))
            elif link.hoist:
                laws.append((index, link.hoist.law(link.length)))
    if custom_laws:
        raise SceneError(
            [f"hoist: {place!r} is not a pair of a pendulum and a link of this scene" for place in custom_laws]
        )
    return Hoisting(np.array(base), tuple(laws), hoists or None)


def _law_of(function: Any, link: Any, place: str) -> Spline:
    if not isinstance(link, Bob):
        raise SceneError([f"{place}: only the massless rope of a bob can change its length"])
    law = Spline(function)
    try:
        values = tuple(float(part) for part in law(0.0))
        fits = len(values) == 3
    except (TypeError, ValueError):
        fits = False
    if not fits:
        words = "must be a spline with derivatives, or a function of time that returns length, speed and acceleration"
        raise SceneError([f"{place}: {words}"])
    return law


@dataclass(frozen=True, eq=False)
class HoistInstant:
    """The linear equations of L links at one time: M, K, D and the additional terms of a changing length.

    `rate` and `bend` (L, q) are the first and second derivatives in time of the displacements along the rail, per
    coordinate, of every link's centre, which are those of its lower joint; `drag` (L,) in N s/m acts on the centre.
    """

    matrices: Matrices
    rate: Floats
    bend: Floats
    drag: Floats


def matrices_at(scene: Scene, time: float) -> Matrices:
    """M, K and D (SI) of M q'' + D q' + K q = 0 at a time (s), for changing lengths; only M is symmetric then."""
    validate_scene(scene)
    return matrices_along(scene)(time)


def matrices_along(scene: Scene) -> Callable[[Any], Matrices]:
    """Return `matrices_at` as a function of a time (s), or along a hoist of many (...)."""
    validate_scene(scene)
    if not scene.is_hoisted:
        constant = matrices_of(rig_of(scene))
        return lambda time: constant
    instant_at = instants(scene)
    return lambda time: instant_at(time).matrices


@checked
def no_hoist(scene: Scene) -> SceneError:
    """Return the error of a scene without a hoist, which says what to write where to add one."""
    none = "hoist: no link of this scene has one"
    places = ((p, i, link) for p, pendulum in enumerate(scene.pendulum) for i, link in enumerate(pendulum.links))
    for p, i, link in places:
        if isinstance(link, Bob):
            key = f"hoist = {{ to = {link.length / 2:g}, duration = 10.0 }}"
            return SceneError([f"{none}: write {key} in pendulum[{p}].links[{i}] to halve its length within 10 s"])
    return SceneError([f"{none}, and only a link of kind bob can be hoisted"])


def instants(scene: Scene) -> Callable[[float], HoistInstant]:
    """Return the linear equations of a scene with a hoist as a function of a time (s), or of many (...).

    Raise SceneError for a scene without a hoist, or with constant forces, whose equilibrium would change with the
    lengths.
    """
    validate_scene(scene)
    hoisting, rig = hoisting_of(scene), rig_of(scene)
    if hoisting is None:
        raise no_hoist(scene)
    if rig.leans:
        raise SceneError([LEANS])
    if rig.structure:
        _refuse_springs(scene)
    hanging, first = Hanging(rig), rig.leading
    chains = [(rig.blocks[block], column) for block, column in hanging.kinds.tolist()]
    mass, inertia, linear, centre, sigma = (
        np.concatenate([getattr(block, name)[:, column] for block, column in chains])
        for name in ("mass", "inertia", "drag", "centre", "sigma")
    )
    owner = np.repeat(np.arange(len(chains)), np.diff(hanging.first))
    pivot_rows, down, curvatures = (rows[owner] for rows in (hanging.phi.rail, hanging.phi.down, hanging.bends))
    labels, quadratic, sunk = coordinate_labels(rig), quadratic_drags(scene), down.T
    pattern = np.tril(owner[:, None] == owner) * sigma
    lever_rows = np.where(hoisting.moving, pattern, np.tril(pattern, -1))
    arms = np.diag(~hoisting.moving * sigma * centre)
    index, (bare_M, bare_K, bare_D) = np.arange(first, first + len(mass)), _without_links(rig)
    resting: dict[bytes, HoistInstant] = {}

    def rest(time: float) -> HoistInstant:
        none = np.zeros((len(mass), first + len(mass)))
        return HoistInstant(matrices_of(rig_of(scene.at(time))), none, none, linear)

    def at(time: float) -> HoistInstant:
        length, speed, acceleration = (part[..., None, :] for part in hoisting.at(time))
        if not (np.ndim(time) or speed.any() or acceleration.any()):
            key = length.tobytes()
            return resting[key] if key in resting else resting.setdefault(key, rest(time))
        pivots = np.broadcast_to(pivot_rows, (*np.shape(time), *pivot_rows.shape))
        rows = np.concatenate((pivots, lever_rows * length + arms), -1)
        columns = rows.swapaxes(-1, -2)
        rate, bend = (np.concatenate((0 * pivots, pattern * part), -1) for part in (speed, acceleration))
        falling, fall_acceleration = rate.sum(-1), bend.sum(-1)
        drag = linear + quadratic * np.abs(falling)
        massive, drag_columns = columns * mass, columns * drag[..., None, :]
        M = massive @ rows + bare_M
        M[..., index, index] += inertia
        M[..., :first, :first] += (sunk * mass) @ down
        pull = mass * (rig.gravity - fall_acceleration) - drag * falling
        K = bare_K + massive @ bend + drag_columns @ rate
        K[..., index, index] += (columns @ pull[..., None])[..., first:, 0]
        K[..., range(first), range(first)] += pull @ curvatures
        D = bare_D + 2 * massive @ rate + drag_columns @ rows
        D[..., :first, :first] += (sunk * (linear + 2 * quadratic * np.abs(falling))[..., None, :]) @ down
        return HoistInstant(Matrices(M, K, D, labels), rate, bend, drag)

    return at


def _without_links(rig: Rig) -> tuple[Floats, Floats, Floats]:
    """M, K and D of what carries links that weigh nothing, with their joints."""
    names = ("mass", "inertia", "drag")
    blocks = (replace(block, **{name: 0 * getattr(block, name) for name in names}) for block in rig.blocks)
    return scene_squares(replace(rig, blocks=tuple(blocks))).matrices


def _refuse_springs(scene: Scene) -> None:
    """SceneError for springs at links of pendula that a hoist makes longer or shorter, which would stretch them."""
    problems = []
    for index, spring in enumerate(scene.spring if scene.is_hoisted else ()):
        for end, text in enumerate(spring.between):
            point = parse_point(text)
            if spring.kind == "torsion" or not isinstance(point, PendulumPoint):
                continue
            if any(link.hoist for link in scene.pendulum[point.pendulum].links[: point.link + 1]):
                at = f'spring[{index}].between[{end}] = "{text}"'
                problems.append(f"{at}: the hoist would stretch it: there is no equilibrium along it")
    if problems:
        raise SceneError(problems)


def quadratic_drags(scene: Scene) -> Floats:
    """Return the coefficient of every link (L,), in the order of the file."""
    validate_scene(scene)
    return np.concatenate(
        [np.tile([link.quadratic_drag for link in pendulum.chain], pendulum.count) for pendulum in scene.pendulum]
    )
