"""The inputs and outputs of a scene: groups of named signals as rows over q = (x, θ_1, …).

A horizontal displacement, to first order, is a row h over q: of a centre h = e_x + Σ_{above} l cos θ + c cos θ, of a
lower joint e_x + Σ l cos θ, with the equilibrium's angles θ, 0 or π without constant forces.  A horizontal force at
that point acts on q with hᵀ; the force of pendulum p on its pivot is −Σ m h q'' plus the external forces on its links.

Where the support moves (the fixed support, or the ground to which a cart's rail, spring and damper are attached), q is
in its frame; positions, the cart's velocity and forces on pivots are those in the laboratory.

On a structure q = (η, θ_1, …), and a point of a pendulum moves with its pivot: along the rail by Φ η and down by Ψ η.
Its coordinates and their rates are relative to the ground, accelerations are those in the laboratory.  A spring has the
extension e, positive where it is longer, and the force k e + d e', positive where it pulls its ends together.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from modal.assembly import Hanging, Rig, SpringRow, displacements, joints, rig_of
from modal.errors import SceneError, meant
from modal.scene import Scene
from modal.structure import Structure, slopes
from modal.types import Floats


class Signal(NamedTuple):
    """The ASCII name of a state, an input or an output, its unit, and its meaning."""

    name: str
    unit: str
    meaning: str


@dataclass(frozen=True, eq=False)
class Geometry:
    """Rows over q of every link's centre, lower joint and angle relative to the link above, each (links, q).

    `labels` (links,) are "p_i", both from 1, every copy numbered; `mass` (links,), linear `drag` (links,), `pendulum`
    (links,) from 0; `rest` (links,) the equilibrium's angles θ and `place` (m) the cart's; `length` and `centre`
    (links,) those of the links, and `across` and `sinking` (links,) their cos θ and −sin θ; `on_cart` tells whether q
    begins with the x of one cart alone.  Where lengths change, `rate` and `bend` (links, q) are the first two
    derivatives in time of the rows of centres and lower joints.  `carried` is what a structure adds.
    """

    centres: Floats
    joints: Floats
    relative: Floats
    mass: Floats
    drag: Floats
    rest: Floats
    place: float
    length: Floats
    centre: Floats
    across: Floats
    sinking: Floats
    pendulum: Floats
    labels: tuple[str, ...]
    on_cart: bool
    rate: Floats | None = None
    bend: Floats | None = None
    carried: StructureRows | None = None

    @property
    def leading(self) -> int:
        """How many coordinates come before the angles."""
        return self.size - len(self.labels)

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return int(self.centres.shape[1])

    @property
    def angles(self) -> Floats:
        """The rows of the absolute angles."""
        return np.eye(self.size)[self.leading :]

    @property
    def momentum(self) -> Floats:
        """That of everything but a cart alone (q,), at unit velocity along the rail, in the directions of q."""
        hanging: Floats = self.centres.T @ self.mass
        return hanging + self.carried.momentum if self.carried else hanging

    @property
    def windage(self) -> Floats:
        """The force of still air (q,) against unit velocity of everything along the rail, in the directions of q."""
        return np.asarray(self.centres.T @ self.drag)

    @property
    def tips(self) -> list[int]:
        """The last link of every pendulum."""
        return [int(np.flatnonzero(self.pendulum == p)[-1]) for p in np.unique(self.pendulum)]


class StructureCoordinate(NamedTuple):
    """A coordinate of a structure: its `name` (`lower_m`), its unit, what it is, and what a force on it pushes.

    `along` is how far the origin of its carrier moves along the rail with it.
    """

    name: str
    unit: str
    meaning: str
    pushed: str
    along: float

    @property
    def force(self) -> str:
        """The name of the force or torque on it."""
        if self.name == "x":
            return "cart_force"
        return f"{self.name.removesuffix(f'_{self.unit}')}_{'torque' if self.unit == 'rad' else 'force'}"

    @property
    def force_unit(self) -> str:
        """N or N m; 1 of a coordinate of a modal support."""
        return {"m": "N", "rad": "N m"}.get(self.unit, "1")

    def derivative(self, order: int) -> str:
        """The name of its rate or its second derivative, as `lower_dot_m_per_s`."""
        dots, unit = "_dot" if order == 1 else "_ddot", f"_{self.unit}_per_s{'' if order == 1 else order}"
        if self.name == "x":
            return self.name + dots
        return self.name.removesuffix(f"_{self.unit}") + dots + unit * bool(self.unit)


@dataclass(frozen=True, eq=False)
class StructureRows:
    """A structure over q: its d `coordinates`, and `momentum` (q,), that of its own masses at unit velocity along.

    `down` and `turning` (links, q) are the displacement downwards of every link's pivot and the angle of its carrier;
    `springs` the rows of springs between points and angles; `first_links` (pendula + 1,) the first link of each
    pendulum and the number of links.
    """

    structure: Structure
    coordinates: tuple[StructureCoordinate, ...]
    momentum: Floats
    down: Floats
    turning: Floats
    springs: tuple[SpringRow, ...]
    first_links: Sequence[int]

    @cached_property
    def extension(self) -> Floats:
        """The rows (springs, q) of all extensions."""
        rows = np.zeros((len(self.springs), len(self.momentum)))
        for k, spring in enumerate(self.springs):
            for column, value in spring.row.items():
                rows[k, column] = value
        return rows

    @cached_property
    def pulls(self) -> Floats:
        """The force along the rail (pendula, springs) that each spring has on every pendulum where its force is 1."""
        pulls = np.zeros((len(self.first_links) - 1, len(self.springs)))
        for k, spring in enumerate(self.springs):
            for pendulum, sign in spring.on_pendula:
                pulls[pendulum, k] += sign * spring.along
        return pulls


WORDS = {
    "cart": ("displacement of the cart", "force along the rail on the cart"),
    "swing": ("displacement along its arc of the swing", "force along its arc on the swing"),
    "tilt": ("angle of the board", "torque on the board"),
    "heave": ("displacement upwards of the support", "force upwards on the support"),
    "sway_m": ("displacement along the rail of the platform", "force along the rail on the platform"),
    "heave_m": ("displacement upwards of the platform", "force upwards on the platform"),
    "roll_rad": ("angle of the platform", "torque on the platform"),
    "modal": ("coordinate of the modal support", "generalized force on a coordinate of the modal support"),
}
"""What coordinates are, and forces on them, by the kind of their carrier or their own ending."""


def coordinates_of(structure: Structure) -> tuple[StructureCoordinate, ...]:
    """The coordinates of a structure in their order."""
    if structure.names == ("x",):
        return (StructureCoordinate("x", "m", "position of the cart", "force on the cart along the rail", 1.0),)
    coordinates = []
    for number, carrier in enumerate(structure.carriers):
        still = (0.0,) * carrier.size
        origin = carrier.moving(0 if carrier.M is not None else (0.0, 0.0), still, still).slopes
        for k, suffix in enumerate(carrier.suffixes):
            unit = "" if carrier.M is not None else suffix.rpartition("_")[2]
            meaning, pushed = (f"{words} {carrier.name}" for words in WORDS.get(suffix) or WORDS[carrier.kind])
            along = 0.0 if carrier.M is not None or unit == "rad" else float(origin[k][0])
            name = structure.names[structure.offsets[number] + k]
            coordinates.append(StructureCoordinate(name, unit, meaning, pushed, along))
    return tuple(coordinates)


def geometry_of(scene: Scene) -> Geometry:
    """The rows of a scene, one for each copy."""
    return geometry_of_rig(rig_of(scene))


def geometry_of_rig(rig: Rig) -> Geometry:
    """The rows of the scene of a rig."""
    first = rig.leading
    hung = [(rig.blocks[block], column) for block, column, count in rig.members for _ in range(count)]
    total = sum(block.n for block, _ in hung)
    relative = np.zeros((total, total + first))
    numbers, pendulum = [], []
    labels: list[str] = []
    for p, (block, column) in enumerate(hung):
        at = len(labels)
        span = slice(at + first, at + first + block.n)
        relative[at : at + block.n, span] = np.eye(block.n) - np.eye(block.n, k=-1)
        sinking = np.zeros_like(block.sigma) if block.sinking is None else block.sinking
        each = (block.mass, block.drag, block.length, block.centre, block.across, sinking)
        numbers.append([part[:, column] for part in each])
        pendulum.append(np.full(block.n, float(p)))
        labels += [f"{p + 1}_{i}" for i in range(1, block.n + 1)]
    alone = int(rig.cart is not None)
    rows, below = displacements(hung, alone), displacements(hung, alone, joints)
    mass, drag, length, centre, across, sunk = (np.concatenate(parts) for parts in zip(*numbers, strict=True))
    owners, rest, place = np.concatenate(pendulum), rig.rest_angles, rig.cart_rest
    carried = _carried(rig, first + total) if rig.structure else None
    if carried:
        each_pivot = Hanging(rig).phi
        owner = owners.astype(int)
        rows, below = (np.hstack([each_pivot.along[owner], part]) for part in (rows, below))
        tops = np.array(carried.first_links[:-1])
        relative[tops] -= carried.turning[tops]
    on_cart = rig.cart is not None or (rig.structure is not None and rig.structure.names == ("x",))
    return Geometry(
        rows, below, relative, mass, drag, rest, place, length, centre, across, sunk, owners, tuple(labels), on_cart,
        carried=carried,
    )  # fmt: skip


def _carried(rig: Rig, size: int) -> StructureRows:
    """What the structure of a rig adds."""
    hanging, structure = Hanging(rig), rig.structure
    assert structure is not None
    momentum, d = np.zeros(size), structure.size
    for number, carrier in enumerate(structure.carriers):
        if carrier.M is None and carrier.size:
            for column, value in slopes(structure, number, carrier.centre)[0].items():
                momentum[column] += carrier.mass * value
    owner = np.repeat(np.arange(len(hanging.kinds)), np.diff(hanging.first))
    down, turning = (
        np.hstack([part[owner], np.zeros((len(owner), size - d))]) for part in (hanging.phi.down, hanging.phi.turning)
    )
    first = hanging.first.tolist()
    springs = tuple(hanging.spring_rows)
    return StructureRows(structure, coordinates_of(structure), momentum, down, turning, springs, first)


# ------------------------------------------------------------------------------------------------------- inputs


class InputGroup(NamedTuple):
    """Inputs as generalized forces F (q, m), and the external force of each on each pendulum (p, m)."""

    signals: list[Signal]
    F: Floats
    thrust: Floats


def _cart_force(geometry: Geometry) -> InputGroup:
    F = np.zeros((geometry.size, 1))
    F[0] = 1.0
    return InputGroup([Signal("cart_force", "N", "force on the cart along the rail")], F, _nothing(geometry, 1))


def _joint_torques(geometry: Geometry) -> InputGroup:
    signals = [Signal(f"torque_{label}", "N m", "torque of a joint on the link below it") for label in geometry.labels]
    return InputGroup(signals, geometry.relative.T, _nothing(geometry, len(signals)))


def _link_forces(geometry: Geometry) -> InputGroup:
    signals = [
        Signal(f"force_{label}", "N", "horizontal force at a link's centre of mass") for label in geometry.labels
    ]
    thrust = (geometry.pendulum == np.unique(geometry.pendulum)[:, None]).astype(float)
    return InputGroup(signals, geometry.centres.T, thrust)


def _coordinate_forces(geometry: Geometry) -> InputGroup:
    coordinates = coordinates_in(geometry)
    signals = [Signal(coordinate.force, coordinate.force_unit, coordinate.pushed) for coordinate in coordinates]
    return InputGroup(signals, np.eye(geometry.size)[:, : len(signals)], _nothing(geometry, len(signals)))


def coordinates_in(geometry: Geometry) -> tuple[StructureCoordinate, ...]:
    """Those of the structure, none of other scenes."""
    return geometry.carried.coordinates if geometry.carried else ()


def _nothing(geometry: Geometry, m: int) -> Floats:
    return np.zeros((len(geometry.tips), m))


PUSHES: dict[str, Callable[[Geometry], InputGroup]] = {
    "cart_force": _cart_force,
    "joint_torques": _joint_torques,
    "link_forces": _link_forces,
    "coordinate_forces": _coordinate_forces,
}
DRIVES = {
    "cart_acceleration": Signal("cart_acceleration", "m/s^2", "prescribed acceleration of the cart"),
    "cart_velocity": Signal("cart_velocity", "m/s", "prescribed velocity of the cart"),
}
SUPPORT = {
    "support_displacement": Signal("support_displacement", "m", "displacement of the support along the rail"),
    "support_velocity": Signal("support_velocity", "m/s", "velocity of the support along the rail"),
    "support_acceleration": Signal("support_acceleration", "m/s^2", "acceleration of the support along the rail"),
}
"""Motions of the fixed support, or of the ground under a cart and under a structure."""
PRESCRIBED = {
    **{name: (False, order) for order, name in enumerate(SUPPORT)},
    "cart_velocity": (True, 1),
    "cart_acceleration": (True, 2),
}
"""Whether each prescribes the cart, or else the support, and how often its displacement is differentiated."""
INPUTS = (*(name for name in PUSHES if name != "coordinate_forces"), *DRIVES, *SUPPORT)
"""Those of scenes on a fixed support or a cart; a structure has `coordinate_forces` besides."""


# ------------------------------------------------------------------------------------------------------ outputs


class OutputGroup(NamedTuple):
    """Outputs as Y0 q + Y1 q' + Y2 q'' + thrust u; a part that is None is zero.

    `translation` (p,) is what a translation of everything along the rail adds: per metre, per m/s where there is a Y1,
    per m/s² where there is a Y2; `order` says which, and `streamed` (p,) what drag adds per m/s besides.
    `pulls` (p, springs) are the parts of the forces of springs between points, which loss angles turn.
    """

    signals: list[Signal]
    position: Floats | None = None
    rate: Floats | None = None
    acceleration: Floats | None = None
    pushed: bool = False
    translation: Floats | None = None
    pulls: Floats | None = None
    streamed: Floats | None = None

    @property
    def carried(self) -> tuple[Floats | None, Floats | None, Floats | None]:
        """What the displacement, the velocity and the acceleration of the ground add, each (p,)."""
        every = [None, self.streamed, None]
        every[self.order] = self.translation
        return every[0], every[1], every[2]

    @property
    def order(self) -> int:
        """Of the highest derivative that it contains."""
        return 2 if self.acceleration is not None else 1 if self.rate is not None else 0


def _named(prefix: str, unit: str, meaning: str, labels: tuple[str, ...]) -> list[Signal]:
    return [Signal(f"{prefix}_{label}", unit, meaning) for label in labels]


def _tips(geometry: Geometry) -> OutputGroup:
    signals = [Signal(f"tip_{p}", "m", "horizontal position of a pendulum's end") for p in _pendula(geometry)]
    return OutputGroup(signals, geometry.joints[geometry.tips], translation=np.ones(len(signals)))


def _tip_accelerations(geometry: Geometry) -> OutputGroup:
    signals = [Signal(f"tip_ddot_{p}", "m/s^2", "acceleration of a pendulum's end") for p in _pendula(geometry)]
    parts = _accelerations(geometry, geometry.joints, lambda rows: rows[geometry.tips])
    return OutputGroup(signals, *parts, translation=np.ones(len(signals)))


def _accelerations(
    geometry: Geometry, rows: Floats, of: Callable[[Floats], Floats]
) -> tuple[Floats | None, Floats | None, Floats]:
    """What multiplies q, q' and q'' in linear combinations of accelerations of the links' points with these rows."""
    if geometry.rate is None or geometry.bend is None:
        return None, None, of(rows)
    return of(geometry.bend), of(2 * geometry.rate), of(rows)


def _pivot_forces(geometry: Geometry) -> OutputGroup:
    signals = [
        Signal(f"pivot_force_{p}", "N", "horizontal force of a pendulum on its pivot") for p in _pendula(geometry)
    ]
    belongs = geometry.pendulum == np.unique(geometry.pendulum)[:, None]
    weights, dragged = belongs * -geometry.mass, belongs * -geometry.drag
    position, rate, inertia = _accelerations(geometry, geometry.centres, lambda rows: weights @ rows)
    if geometry.drag.any():
        rate = dragged @ geometry.centres + (0.0 if rate is None else rate)
        position = None if geometry.rate is None else position + dragged @ geometry.rate
    if geometry.carried and geometry.carried.pulls.any():
        stiffness, damping = _springs_by(geometry, geometry.carried.pulls)
        position = stiffness if position is None else position + stiffness
        rate = damping if rate is None else rate + damping
    pulls = geometry.carried.pulls if geometry.carried else None
    streamed = dragged.sum(1) if geometry.drag.any() else None
    return OutputGroup(signals, position, rate, inertia, True, weights.sum(1), pulls, streamed)


def _springs_by(geometry: Geometry, weights: Floats) -> tuple[Floats, Floats]:
    """Sums of the forces of springs with these weights (rows, springs): what multiplies q and q', (rows, q)."""
    carried = geometry.carried
    assert carried is not None
    k, d = (np.array([getattr(spring, name) for spring in carried.springs]) for name in ("stiffness", "damping"))
    return (weights * k) @ carried.extension, (weights * d) @ carried.extension


def _spring_signals(geometry: Geometry, prefix: str, units: tuple[str, str], meaning: str) -> list[Signal]:
    springs = geometry.carried.springs if geometry.carried else ()
    return [
        Signal(f"{prefix}_{spring.label}", units[int(spring.torsion)], f"{meaning} of a spring between {spring.words}")
        for spring in springs
    ]


def _spring_extensions(geometry: Geometry) -> OutputGroup:
    signals = _spring_signals(geometry, "spring_extension", ("m", "rad"), "extension")
    return OutputGroup(signals, geometry.carried.extension if geometry.carried else np.zeros((0, geometry.size)))


def _spring_forces(geometry: Geometry) -> OutputGroup:
    signals = _spring_signals(geometry, "spring_force", ("N", "N m"), "pull, with that of its damper,")
    if not signals:
        return OutputGroup(signals, np.zeros((0, geometry.size)))
    unit = np.eye(len(signals))
    return OutputGroup(signals, *_springs_by(geometry, unit), pulls=unit)


def _coordinates(geometry: Geometry) -> OutputGroup:
    coordinates = coordinates_in(geometry)
    signals = [Signal(coordinate.name, coordinate.unit or "1", coordinate.meaning) for coordinate in coordinates]
    return OutputGroup(signals, np.eye(geometry.size)[: len(coordinates)], translation=_in_laboratory(coordinates))


def _coordinate_rates(geometry: Geometry) -> OutputGroup:
    coordinates = coordinates_in(geometry)
    signals = [
        Signal(coordinate.derivative(1), f"{coordinate.unit or '1'}/s", f"rate of the {coordinate.meaning}")
        for coordinate in coordinates
    ]
    return OutputGroup(signals, rate=np.eye(geometry.size)[: len(coordinates)], translation=_in_laboratory(coordinates))


def _in_laboratory(coordinates: Sequence[StructureCoordinate]) -> Floats:
    """What the ground's motion adds: to the position of one cart alone, which is that in the laboratory."""
    return np.array([float(coordinate.name == "x") for coordinate in coordinates])


def _coordinate_accelerations(geometry: Geometry) -> OutputGroup:
    coordinates = coordinates_in(geometry)
    signals = [
        Signal(
            coordinate.derivative(2), f"{coordinate.unit or '1'}/s^2", f"second derivative of the {coordinate.meaning}"
        )
        for coordinate in coordinates
    ]
    along = np.array([coordinate.along for coordinate in coordinates])
    return OutputGroup(signals, acceleration=np.eye(geometry.size)[: len(coordinates)], translation=along)


def _pendula(geometry: Geometry) -> range:
    return range(1, len(geometry.tips) + 1)


READINGS: dict[str, Callable[[Geometry], OutputGroup]] = {
    "cart_position": lambda g: OutputGroup(
        [Signal("x", "m", "position of the cart")], np.eye(g.size)[:1], translation=np.ones(1)
    ),
    "cart_velocity": lambda g: OutputGroup(
        [Signal("x_dot", "m/s", "velocity of the cart")], rate=np.eye(g.size)[:1], translation=np.ones(1)
    ),
    "angles": lambda g: OutputGroup(_named("theta", "rad", "angle from equilibrium", g.labels), g.angles),
    "rates": lambda g: OutputGroup(_named("theta_dot", "rad/s", "rate of the angle", g.labels), rate=g.angles),
    "relative_angles": lambda g: OutputGroup(_named("rel", "rad", "angle to the link above", g.labels), g.relative),
    "relative_rates": lambda g: OutputGroup(
        _named("rel_dot", "rad/s", "rate of that angle", g.labels), rate=g.relative
    ),
    "joint_positions": lambda g: OutputGroup(
        _named("joint", "m", "horizontal position of a lower joint", g.labels),
        g.joints,
        translation=np.ones(len(g.labels)),
    ),
    "tip_positions": _tips,
    "tip_accelerations": _tip_accelerations,
    "pivot_forces": _pivot_forces,
    "coordinates": _coordinates,
    "coordinate_rates": _coordinate_rates,
    "coordinate_accelerations": _coordinate_accelerations,
    "spring_forces": _spring_forces,
    "spring_extensions": _spring_extensions,
}
OF_A_CART = {"cart_force", "cart_position", "cart_velocity", "cart_acceleration"}
OF_STRUCTURES = {"coordinate_forces", "coordinates", "coordinate_rates", "coordinate_accelerations"}
OF_SPRINGS = {"spring_forces", "spring_extensions"}
OUTPUTS = tuple(name for name in READINGS if name not in OF_STRUCTURES | OF_SPRINGS)
"""Those of scenes on a fixed support or a cart."""


def pushes_in(geometry: Geometry, name: str) -> InputGroup:
    """A group of inputs, or the one on a coordinate of a structure by its name."""
    if name in PUSHES:
        return PUSHES[name](geometry)
    every = _coordinate_forces(geometry)
    at = [signal.name for signal in every.signals].index(name)
    return InputGroup(every.signals[at : at + 1], every.F[:, [at]], every.thrust[:, [at]])


def reading_in(geometry: Geometry, name: str) -> OutputGroup:
    """A group of outputs, or one of the signals of a structure by its name."""
    if name in READINGS:
        return READINGS[name](geometry)
    every = next(group for group in _named_readings(geometry) if name in {signal.name for signal in group.signals})
    at = [[signal.name for signal in every.signals].index(name)]
    position, rate, second, moved = (
        None if part is None else part[at]
        for part in (every.position, every.rate, every.acceleration, every.translation)
    )
    return OutputGroup([every.signals[at[0]]], position, rate, second, translation=moved)


def _named_readings(geometry: Geometry) -> list[OutputGroup]:
    """The groups whose signals are outputs by their own names."""
    if geometry.carried is None:
        return []
    return [READINGS[name](geometry) for name in (*sorted(OF_STRUCTURES - {"coordinate_forces"}), *sorted(OF_SPRINGS))]


def own_inputs(geometry: Geometry) -> tuple[str, ...]:
    """The names of the inputs on single coordinates of a structure."""
    return tuple(coordinate.force for coordinate in coordinates_in(geometry))


def inputs_of(geometry: Geometry) -> tuple[str, ...]:
    """The names of all inputs of a scene but those at points."""
    of_structure = own_inputs(geometry)
    return (*INPUTS, *["coordinate_forces"] * bool(of_structure), *of_structure)


def outputs_of(geometry: Geometry) -> tuple[str, ...]:
    """The names of all groups of outputs of a scene, and of those that a structure has by themselves."""
    of_structure = [name for name in READINGS if name in OF_STRUCTURES | OF_SPRINGS and not _lacks(name, geometry)]
    return (*OUTPUTS, *of_structure, *own_outputs(geometry))


def own_signals(geometry: Geometry) -> frozenset[str]:
    """The names of all signals that a structure has by itself, those of states among them."""
    states = [coordinate.derivative(1).replace("_dot", "_dot_free") for coordinate in coordinates_in(geometry)]
    states += [f"{coordinate.name}_free" for coordinate in coordinates_in(geometry)]
    return frozenset((*own_inputs(geometry), *own_outputs(geometry), *states))


def own_outputs(geometry: Geometry) -> tuple[str, ...]:
    """The names of all outputs that a structure has by themselves."""
    return tuple(signal.name for group in _named_readings(geometry) for signal in group.signals)


def validate_signals(
    words: tuple[str, ...],
    known: tuple[str, ...],
    what: str,
    geometry: Geometry,
    *,
    more: Callable[[str], bool] = lambda word: False,
    written: str = "",
) -> tuple[str, ...]:
    """The words themselves; SceneError names every one that is unknown, repeated, or needs what is not there.

    `more` tells of further ones that are known, and `written` how these are.
    """
    if isinstance(words, str):
        raise SceneError([f'{what} {words}: must be a tuple of names: ("{words}",)'])
    there = ", ".join(known) + (f"; or {written}" if written else "")
    unknown = [word for word in words if word not in known and not more(word) and not _lacks(word, geometry)]
    problems = [f"{what} {word}: must be one of {there}{meant(word, known)}" for word in unknown]
    problems += [f"{what} {word}: named twice" for word in dict.fromkeys(words) if words.count(word) > 1]
    problems += [f"{what} {word}: {why}" for word in words if (why := _lacks(word, geometry))]
    if problems:
        raise SceneError(problems)
    return words


def _lacks(word: str, geometry: Geometry) -> str:
    """What a scene does not have that a word needs; "" where it has it."""
    if word in OF_A_CART and not geometry.on_cart:
        names = [coordinate.force for coordinate in coordinates_in(geometry)]
        return f"there is no cart alone: name one of {', '.join(names)}" if names else "the support is fixed"
    if word in OF_STRUCTURES and not coordinates_in(geometry):
        return "the scene has no structure with coordinates of its own"
    if word in OF_SPRINGS and not (geometry.carried and geometry.carried.springs):
        return "the scene has no springs between points"
    return ""
