"""State-space models of a scene with named signals: z' = A z + B u, y = C z + D u about its equilibrium.

With M q'' + D q' + K q = F u over q = (x, θ_1, …), deviations from the equilibrium, z = (q, q'),

    A = [[0, 1], [−M⁻¹K, −M⁻¹D]],    B = [[0], [M⁻¹F]].

A cart whose motion is prescribed is no longer free.  With its column b of M and an acceleration a,

    A_θ θ'' + D_θ θ' + K_θ θ = F_θ u − b a,    x'' = a,

and for a velocity w the rates become p = θ' + A_θ⁻¹ b w, which does not jump when w does:

    x' = w,    θ' = p − A_θ⁻¹ b w,    p' = −A_θ⁻¹ (K_θ θ + D_θ θ' − F_θ u).

A support displaced by s, or the ground under a cart, gives in its own frame the inertial forces −p s'', with p the
total momentum at unit velocity along the rail, and −w s' of the drag of still air. An acceleration and a velocity are
treated alike, with all of q for θ and p for b; for a displacement, with J = M⁻¹ p and the states η = q + J s and r = η'
− M⁻¹ (D J − w) s,

    η' = r + M⁻¹ (D J − w) s,    M r' = −D η' − K (η − J s) + F u.

Under a prescribed motion of a cart the modes are those on a fixed support, and a scene's `damping_ratio` is theirs.
On a structure q begins with its coordinates η instead of x, and its supports move with the ground (`signals`).

In space the model is that of the motion along the rail.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from modal.assembly import HoistInstant, Matrices, matrices
from modal.errors import ComputationError, SceneError
from modal.report import Displayed, Drawable, Summary, counted, deferred
from modal.scene import Fixed, Scene, require, validate_scene
from modal.scene.doors import checked
from modal.scene.points import CarrierPoint, parse_point
from modal.statespace.geometry import Geometry, accelerations, geometry_of
from modal.statespace.signals import (
    DRIVES,
    EXAMPLES,
    PRESCRIBED,
    READINGS,
    SUPPORT,
    InputGroup,
    OutputGroup,
    Signal,
    inputs_of,
    is_point,
    outputs_of,
    push_of,
    reading_in,
    validate_points,
    validate_signals,
)
from modal.structure import CarrierNumbers
from modal.types import EPS, Floats

LARGEST_STATE = 4000
"""Limit: states of a model, refused beyond."""
NO_SHARE = (
    "a modal support does not say how the ground's motion drives its coordinates: give it as forces on these, or "
    "write the structure as carts"
)


@dataclass(frozen=True, eq=False, repr=False)
class StateSpace(Drawable, Displayed):
    """z' = A z + B u (z[k+1] = A z[k] + B u[k] where dt > 0), y = C z + D u.

    A (n, n), B (n, m), C (p, n), D (p, m) in SI units; `states`, `inputs` and `outputs` name rows and columns; `dt` is
    the sample time in seconds, 0 for continuous time; `operating_point` the values from which angles deviate (rad), and
    the cart's position if constant forces displace it (m), in motion all coordinates, rates and accelerations; `scene`
    the one whose whole model this is, None for sampled and reduced ones and those from files.
    """

    A: Floats
    B: Floats
    C: Floats
    D: Floats
    states: tuple[Signal, ...]
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    dt: float = 0.0
    title: str = ""
    operating_point: tuple[tuple[str, float], ...] = ()
    scene: Scene | None = None
    figure = "modal.statespace.modal_form:plot_model"

    def to_dict(self) -> dict[str, Any]:
        """A, B, C and D, the names of states, inputs and outputs, and the sample time in s.

        >>> from modal import load
        >>> from modal.statespace import state_space
        >>> found = state_space(load("chain-1")).to_dict()
        >>> found["states"], found["A"].shape
        (['theta_1_1', 'theta_dot_1_1'], (2, 2))
        """
        names = {side: [signal.name for signal in getattr(self, side)] for side in ("states", "inputs", "outputs")}
        return {"A": self.A, "B": self.B, "C": self.C, "D": self.D, **names, "dt_s": self.dt}

    def to_control(self) -> Any:
        """The `control.StateSpace` of python-control, with the names of states, inputs and outputs.

        >>> from modal import load
        >>> from modal.statespace import state_space
        >>> state_space(load("chain-1")).to_control().input_labels
        ['torque_1_1']
        """
        return deferred("modal.exports.scripts:to_control")(self)

    def _summary(self) -> Summary:
        kind = f"sampled every {self.dt:g} s" if self.dt else "continuous"
        sizes = f"{len(self.A)} states, {counted(len(self.inputs), 'input', 'inputs')}, "
        sizes += counted(len(self.outputs), "output", "outputs")
        title = f'State space of "{self.title}": {sizes}, {kind}' if self.title else f"State space: {sizes}, {kind}"
        sides = {"input": self.inputs, "output": self.outputs, "state": self.states}
        rows = [
            (side, signal.name, signal.unit, signal.meaning) for side, signals in sides.items() for signal in signals
        ]
        return Summary(title, (), ("signal", "name", "unit", "meaning"), rows, len(rows), words=frozenset(range(4)))


Pair = tuple[Floats, Floats]
Maps = tuple[Pair | None, ...]


class _Motion(NamedTuple):
    """A and B with the maps from (z, u) to q, q' and q'', each a pair; None if they contain impulses.

    `support` are the maps to the displacement of a moving support, its velocity and its acceleration.
    """

    A: Floats
    B: Floats
    maps: Maps
    states: list[Signal]
    support: Maps = ()


class LocalModel(NamedTuple):
    """The equations q'' = f(q, q', F) near a state: −∂f/∂q and −∂f/∂q' (q, q), and a function for ∂f/∂F F.

    `geometry` has the rows of all points at that state, `operating_point` its values.
    """

    geometry: Geometry
    K: Floats
    D: Floats
    accelerations: Callable[[Floats], Floats]
    operating_point: tuple[tuple[str, float], ...]

    def split(self, F: Floats, *, is_prescribed: bool) -> tuple[Floats, Floats, Floats]:
        """M⁻¹ K, M⁻¹ D and M⁻¹ F; where the first coordinate's acceleration is given, it is the first input."""
        if not is_prescribed:
            return self.K, self.D, self.accelerations(F)
        solution = self.accelerations(np.hstack([np.eye(len(F), 1), F]))
        column = solution[:, :1] / solution[0, 0]
        K, D, F = (part - column * part[:1] for part in (self.K, self.D, solution[:, 1:]))
        return K, D, np.hstack([column, F])


@checked
def state_space(scene: Scene, inputs: tuple[str, ...] = (), outputs: tuple[str, ...] = ()) -> StateSpace:
    """The model of a scene with these groups of inputs and outputs (`modal.statespace.signals.INPUTS` and `OUTPUTS`).

    Inputs may also be points, as "force:pendulum[0].links[1]@0.5" (`modal.statespace.signals`), and on a structure the
    force on one coordinate by its name; outputs may be the names of its coordinates, of their rates and of springs.  By
    default the input is the force on a cart, the forces on all coordinates of a structure, or else the joint torques,
    and the outputs are the cart's position or the coordinates of the structure, and the absolute angles. Raise
    SceneError for groups that the scene does not have, ComputationError if M is singular or the model has more than
    LARGEST_STATE states.
    """
    require(validate_scene(scene), "a constant linear model")
    return assemble(scene, None, inputs, outputs)


def assemble(
    scene: Scene,
    instant: HoistInstant | None,
    inputs: tuple[str, ...] = (),
    outputs: tuple[str, ...] = (),
    local: LocalModel | None = None,
) -> StateSpace:
    """The model of a scene of constant lengths as in `state_space`, at a moment of a hoist, or at a state."""
    if 2 * scene.n_links > LARGEST_STATE:
        raise ComputationError(f"the model would have over {2 * scene.n_links} states: at most {LARGEST_STATE}")
    geometry = local.geometry if local else geometry_of(scene)
    if instant:
        geometry = replace(geometry, rate=instant.rate, bend=instant.bend, drag=instant.drag)
    usual = _usual(geometry)
    input_names = validate_signals(
        inputs or usual[0], inputs_of(geometry), "input", geometry, is_further=is_point, examples=EXAMPLES
    )
    validate_points(scene, input_names)
    output_names = validate_signals(outputs or usual[1], outputs_of(geometry), "output", geometry)
    if scene.feedback and (prescribed := [name for name in input_names if name in DRIVES | SUPPORT]):
        raise SceneError([f"input {prescribed[0]}: is a motion: beside feedback, inputs are forces and torques"])
    drive, push = _drive(input_names), _pushes(scene, geometry, input_names)
    if drive in SUPPORT:
        require(scene, "a linear model of a moved support")
        if any(carrier.M is not None for carrier in geometry.structure.carriers):
            raise SceneError([f"input {drive}: {NO_SHARE}"])
    matrices_by = _fixed_base_matrices if drive in DRIVES and scene.has_modal_damping else matrices
    linear = local or (instant.matrices if instant else matrices_by(scene))
    with np.errstate(all="ignore"):
        motion = _motion(linear, geometry, push.F, drive)
        C, D, signals = _outputs(motion, geometry, push, [reading_in(geometry, name) for name in output_names])
    if not all(np.all(np.isfinite(part)) for part in (motion.A, motion.B, C, D)):
        raise ComputationError("the ratios in this scene are beyond double precision: its model overflows")
    driven = [(DRIVES | SUPPORT)[drive]] if drive else []
    if local:
        motion = motion._replace(states=_in_motion(motion.states))
        signals = _in_motion(signals)
    resting = [
        *([("x", geometry.place)] if geometry.place else []),
        *((f"theta_{label}", angle) for label, angle in zip(geometry.labels, geometry.rest.tolist(), strict=True)),
    ]
    names = tuple(motion.states), tuple(driven + push.signals), tuple(signals)
    point, whole_scene = (local.operating_point, None) if local else (tuple(resting), scene)
    return StateSpace(*(motion.A, motion.B, C, D), *names, title=scene.title, operating_point=point, scene=whole_scene)


def _in_motion(signals: list[Signal]) -> list[Signal]:
    """Signals that deviate from a motion."""
    return [
        signal._replace(meaning=signal.meaning.replace("from equilibrium", "from the motion")) for signal in signals
    ]


def _usual(geometry: Geometry) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The inputs and outputs of a model for which none are named."""
    if geometry.on_cart:
        return ("cart_force",), ("cart_position", "angles")
    if geometry.leading:
        return ("coordinate_forces",), ("coordinates", "angles")
    return ("joint_torques",), ("angles",)


def without_carrier(scene: Scene) -> Scene:
    """The same pendula on a fixed support; raise SceneError for damping ratios by mode, which are those of other modes.

    Of a scene with one cart alone: springs that end on it end on the ground in its place.
    """
    if isinstance(scene.damping_ratio, tuple) and getattr(scene.support, "kind", "") == "cart":
        raise SceneError(
            [
                "damping_ratio: is listed by the modes with the cart free, but under a prescribed motion of the cart "
                "the modes are those on a fixed support: give one ratio for all modes"
            ]
        )
    cart, places = scene.support, [parse_point(force.on) for force in scene.force]
    forces_and_points = zip(scene.force, places, strict=True)
    forces = tuple(
        force for force, point in forces_and_points if point is not None and not isinstance(point, CarrierPoint)
    )
    position = getattr(cart, "position", (0.0, 0.0))
    fixed_scene = scene.replace(
        support=Fixed(name=getattr(cart, "name", ""), position=position), spring=(), force=forces
    )
    springs = [
        spring.replace(between=tuple(_held_end(text, position) for text in spring.between)) for spring in scene.spring
    ]
    return fixed_scene.replace(
        spring=tuple(kept_spring for kept_spring in springs if any("pendulum" in text for text in kept_spring.between))
    )


def _held_end(text: str, cart: tuple[float, float]) -> str:
    """The end of a spring on a cart held fixed at this place: a point of the ground."""
    point = parse_point(text)
    if point is not None and not isinstance(point, CarrierPoint):
        return text
    s, h = point.place if point is not None else (0.0, 0.0)
    return f"ground@{cart[0] + s!r},{cart[1] + h!r}"


def _fixed_base_matrices(scene: Scene) -> Matrices:
    """M, K and D with the modal dampers of the pendula on a fixed support, whose modes a prescribed motion excites."""
    bare, hanging = matrices(scene.replace(damping_ratio=0.0)), matrices(without_carrier(scene))
    D = bare.D.copy()
    D[1:, 1:] = hanging.D
    return replace(bare, D=D)


def _drive(names: tuple[str, ...]) -> str | None:
    drives = [name for name in names if name in DRIVES]
    if len(drives) > 1 or (drives and "cart_force" in names):
        raise SceneError(["input: choose only one of the cart's force, acceleration and velocity"])
    drives += [name for name in names if name in SUPPORT]
    if len(drives) > 1:
        raise SceneError([f"input: choose only one of {' and '.join(drives)}"])
    return drives[0] if drives else None


def _pushes(scene: Scene, geometry: Geometry, names: tuple[str, ...]) -> InputGroup:
    """All generalized forces as columns, in the requested order."""
    pushes = [push_of(scene, geometry, name) for name in names if name not in DRIVES | SUPPORT]
    none = np.zeros((geometry.size, 0)), np.zeros((len(geometry.tips), 0))
    return InputGroup(
        [signal for push in pushes for signal in push.signals],
        np.hstack([none[0], *(push.F for push in pushes)]),
        np.hstack([none[1], *(push.thrust for push in pushes)]),
    )


def _motion(linear: Matrices | LocalModel, geometry: Geometry, F: Floats, drive: str | None) -> _Motion:
    """A and B over the coordinates Q, the first of which is what the input prescribes, a cart's place or the support's.

    Q'' = −K Q − D Q' + F u, of which s'' = u.  Where the velocity is given, Q' less F u takes the place of Q', and
    where the displacement is, Q less F u that of Q; s' and then s are no states.
    """
    is_prescribed, order = PRESCRIBED.get(drive or "", (False, 2))
    if isinstance(linear, LocalModel):
        K, D, F = linear.split(F, is_prescribed=is_prescribed)
    elif drive:
        K, D, F = _partition(linear, geometry, F, is_prescribed=is_prescribed)
    else:
        K, D, F = _split(geometry, linear.K, linear.D, F)
    n, eye = len(K), np.eye(2 * len(K))
    rates, slopes = np.zeros_like(F), F.copy()
    place, columns_to_drop = np.zeros_like(F), [0, n][order:] if order < 2 else []
    if order == 0:
        place[:, :1], rates[:, :1] = F[:, :1], -D @ F[:, :1]
    if order == 1:
        rates[:, :1] = F[:, :1]
    if order < 2:
        slopes[:, :1] = -K @ place[:, :1] - D @ rates[:, :1]
    parts = eye[:n], eye[n:], -np.hstack([K, D])
    q, rate, second = (
        (np.delete(part, columns_to_drop, 1), by) for part, by in zip(parts, (place, rates, slopes), strict=True)
    )
    A, B = (np.delete(np.vstack([rate[k], second[k]]), columns_to_drop, 0) + 0.0 for k in (0, 1))
    maps: Maps = (q, rate if order else None, second if order == 2 else None)
    states = _states(geometry, drive, order)
    if drive is None or is_prescribed:
        return _Motion(A, B, maps, states)
    of_support, of_scene = (tuple(_rows(part, rows) for part in maps) for rows in (slice(1), slice(1, None)))
    return _Motion(A, B, of_scene, states, of_support)


def _rows(maps: Pair | None, rows: slice) -> Pair | None:
    return None if maps is None else (maps[0][rows], maps[1][rows])


def _partition(
    linear: Matrices, geometry: Geometry, F: Floats, *, is_prescribed: bool
) -> tuple[Floats, Floats, Floats]:
    """K, D and F of `_motion` next to a cart that moves as prescribed, the first coordinate, or on a support under all.

    J = M⁻¹ p is exact where everything can move along with the ground, as on a cart.
    """
    none = np.zeros((1, geometry.size + (not is_prescribed)))
    K, D = linear.K, linear.D
    pushed_by_support = np.zeros((len(F), 1))
    if is_prescribed:
        given = np.zeros((1, 2 * geometry.size + 1 + F.shape[1]))
        given[0, 2 * geometry.size] = 1.0
        K, D, F = (part[1:] for part in _split(geometry, K, D, np.hstack([pushed_by_support, F]), given))
    else:
        # the motion (q,) in which everything translates along the rail by 1 m, where there is one
        motion = np.zeros(geometry.size)
        motion[: geometry.leading] = [coordinate.along for coordinate in geometry.coordinates]
        carriers = all(_may_translate(carrier) for carrier in geometry.structure.carriers)
        translation = motion if carriers and np.all(geometry.centres @ motion == 1.0) else None
        if translation is None:
            pushed_by_support = -geometry.momentum[:, None]
        K, D = np.hstack([0 * pushed_by_support, K]), np.hstack([geometry.windage[:, None], D])
        K, D, F = _split(geometry, K, D, np.hstack([pushed_by_support, F]))
        if translation is not None:
            F[:, 0] = -translation
    return np.vstack([none, K]), np.vstack([none, D]), np.vstack([np.eye(1, F.shape[1]), F])


def _split(
    geometry: Geometry, K: Floats, D: Floats, F: Floats, given: Floats | None = None
) -> tuple[Floats, Floats, Floats]:
    """M⁻¹ K, M⁻¹ D and M⁻¹ F; the `given` quantity is the acceleration of a cart that moves as prescribed."""
    solution = accelerations(geometry, np.hstack([K, D, F]), given)
    K, D, F = np.split(solution, np.cumsum([K.shape[1], D.shape[1]]), axis=1)
    return K, D, F


def _may_translate(carrier: CarrierNumbers) -> bool:
    """Whether a support's own mass, if it has any, can move along the rail and do nothing else."""
    if not carrier.size or carrier.M is not None:
        return not carrier.size
    zeros = (0.0,) * carrier.size
    slopes = carrier.moving(carrier.centre, zeros, zeros).slopes
    return any(slope == (1.0, 0.0) for k, slope in enumerate(slopes) if k != carrier.turning)


PLACED = (("support", "m", "displacement"), ("support_dot", "m/s", "velocity"))


def _states(geometry: Geometry, drive: str | None, order: int) -> list[Signal]:
    """The names of the states that `_motion` adds."""
    places, rates = (
        [signal for name in names for signal in READINGS[name](geometry).signals]
        for names in (("coordinates", "angles"), ("coordinate_rates", "rates"))
    )
    if drive is None or drive in DRIVES:
        if order == 2:
            return places + rates
        meaning = "rate of the angle, minus the cart's contribution"
        return places + [Signal(s.name.replace("theta_dot", "p"), s.unit, meaning) for s in rates[1:]]
    support = [Signal(name, unit, f"{word} of the support") for name, unit, word in PLACED]
    if order == 2:
        return [support[0], *places, support[1], *rates]
    smooth = ", less what a jump of the support adds"
    free = [Signal(s.name.replace("_dot", "_dot_free"), s.unit, s.meaning + smooth) for s in rates]
    if order == 1:
        return [support[0], *places, *free]
    return [*(Signal(s.name + "_free", s.unit, s.meaning + smooth) for s in places), *free]


READ = {True: "pivot_forces", False: "tip_accelerations"}


def _impulse_problem(reading: OutputGroup, motion: _Motion) -> str:
    if not motion.support:
        return f"output {READ[reading.pushed]}: a cart whose velocity jumps has impulses there"
    names = ", ".join(signal.name for signal in reading.signals[:2])
    if reading.acceleration is not None:
        return f"output {names}: a support whose velocity jumps has impulses there: give its acceleration"
    return f"output {names}: jumps of the support's displacement have no finite rates: give its velocity"


def _outputs(
    motion: _Motion, geometry: Geometry, push: InputGroup, readings: list[OutputGroup]
) -> tuple[Floats, Floats, list[Signal]]:
    C, D = [], []
    for reading in readings:
        inward, through = (np.zeros((2, len(reading.signals), part.shape[1])) for part in (motion.A, motion.B))
        parts = (reading.position, reading.rate, reading.acceleration)
        grounds = motion.support or (None,) * 3
        for part, maps, ground_column, ground in zip(parts, motion.maps, reading.carried, grounds, strict=True):
            if part is not None and maps is None:
                raise SceneError([_impulse_problem(reading, motion)])
            if part is not None and maps is not None:
                inward, through = inward + _sums(part, maps[0]), through + _sums(part, maps[1])
            if ground_column is not None and ground is not None:
                column = ground_column[:, None]
                inward, through = inward + _sums(column, ground[0]), through + _sums(column, ground[1])
        if reading.pushed and push.signals:
            through[:, :, -len(push.signals) :] += push.thrust, np.abs(push.thrust)
        C.append(_without_rounding(inward, geometry.size))
        D.append(_without_rounding(through, geometry.size))
    return np.vstack(C) + 0.0, np.vstack(D) + 0.0, [signal for reading in readings for signal in reading.signals]


def _sums(part: Floats, values: Floats) -> Floats:
    """The product of both, and the sum of the magnitudes of its terms."""
    return np.array([part @ values, np.abs(part) @ np.abs(values)])


def _without_rounding(sums: Floats, n: int) -> Floats:
    """`_sums` of n products or more; 0.0 where their rounding is all that is left of terms of this magnitude."""
    total, magnitude = sums
    return np.where(np.abs(total) <= n * EPS * magnitude, 0.0, total)
