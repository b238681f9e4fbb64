"""The members of an ensemble: a scene with other starts, or with other numbers at some of its places.

Members of a grid are counted with the last place running fastest.  A `MemberPart` is what a worker needs to know of
some of them that follow each other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from hashlib import sha256
from math import prod
from typing import Any

import numpy as np

from modal.errors import SceneError
from modal.report import Displayed, Summary, counted
from modal.scene import Scene, describe, name_of, validate_scene
from modal.scene.features import varied_features
from modal.scene.parameters import (
    Place,
    Variable,
    Variation,
    Vary,
    find_places,
    parse_vary,
)
from modal.types import Floats, Ints
from nonlinear.integration import validate
from nonlinear.integration.switches import numbers_of as switching_of
from nonlinear.system import (
    Layout,
    Motion,
    Numbers,
    State,
    System,
    initial_state,
    motion_of,
    numbers_of,
    system_of,
    validate_state,
)

Starts = Floats | Sequence[Sequence[float]] | Sequence[State] | Motion
STARTING = {"angles_deg": 0, "rates_deg": 1}
"""The numbers of a start that are angles and rates (deg)."""
RATIO = "damping_ratio"
NONE_GIVEN = "members: give starts, or what to vary"


@dataclass(frozen=True, eq=False)
class MemberBlock:
    """Members whose numbers can be: their places in the part, numbers and y (size, S); why others cannot, by place."""

    places: Ints
    numbers: Numbers
    y: Floats
    reasons: dict[int, str]


@dataclass(frozen=True, eq=False)
class MemberPart:
    """Some members that follow each other, of a scene: `first` is the number of the first of them.

    `values` are (S,) by their paths; `states` (S rows) stand in the place of the scene's own start.
    """

    scene: Scene
    first: int
    size: int
    values: Mapping[str, Floats]
    states: Motion | None = None

    @cached_property
    def _variable(self) -> Variable:
        return Variable(self.scene, self.values)

    def scene_of(self, place: int) -> Scene:
        """The scene of one member; raise SceneError if its numbers cannot be."""
        return self._variable.at({path: float(numbers[place]) for path, numbers in self.values.items()})

    def state_of(self, place: int) -> State:
        """The start of one member."""
        return self.states[place] if self.states is not None else initial_state(self.scene_of(place))

    @property
    def places(self) -> tuple[Place, ...]:
        """The numbers of the scene that differ."""
        return tuple(self._at)

    @cached_property
    def _at(self) -> dict[Place, Floats]:
        return {place: numbers for path, numbers in self.values.items() for place in find_places(self.scene, path)}

    def block(self, layout: Layout) -> MemberBlock:
        """The members in arrays."""
        reasons = self._reasons()
        good = np.array([place for place in range(self.size) if place not in reasons], dtype=np.int64)
        differing, numbers = {place: values[good] for place, values in self._at.items()}, self.numbers(good)
        begun = replace(self._starts(good, differing), work=np.zeros(len(good)))
        y = np.ascontiguousarray(layout.rows(begun).T)
        return MemberBlock(good, numbers, y, reasons)

    @property
    def system(self) -> System:
        """The system with the numbers of the members in its arrays, whether they can be or not."""
        return numbers_of(self.scene, self._others(slice(None))).arrays

    def _others(self, members: Any) -> dict[Place, Floats]:
        """The differences beyond the start."""
        return {place: values[members] for place, values in self._at.items() if "start" not in place}

    def numbers(self, good: Ints) -> Numbers:
        """The numbers of the members at these places; raise SceneError if switches cannot be."""
        others = self._others(good)
        numbers = numbers_of(self.scene, others, modal=self._dampers(others, good))
        if (system := numbers.system).has_escapements or system.rubs:
            every = [self.scene_of(int(place)) for place in good] if others else [self.scene]
            values = np.array([switching_of(system_of(scene)) for scene in every]).T
            numbers = replace(numbers, switching=tuple(values if others else values[:, 0]))
        return numbers

    def _dampers(self, others: Mapping[Place, Floats], good: Ints) -> Floats | None:
        """D_modal (S, n, n) where it differs between these members, else None."""
        if not others or not (self.scene.has_modal_damping or any(place[0] == RATIO for place in others)):
            return None
        dampers = [system_of(self.scene_of(int(place))).modal_damping for place in good]
        system = system_of(self.scene)
        size = system.first + system.n_links
        none = np.zeros((size, size))
        return np.array([none if D is None else D for D in dampers]).reshape(len(dampers), size, size)

    def _reasons(self) -> dict[int, str]:
        """Why members cannot be, of those whose numbers differ in more than the start."""
        if all("start" in place for place in self._at):
            return {}
        reasons = {}
        for place in range(self.size):
            try:
                self.scene_of(place)
            except SceneError as error:
                reasons[place] = " ".join(str(error).split())
        return reasons

    def _starts(self, good: Ints, differing: Mapping[Place, Floats]) -> Motion:
        """The starts of the members at these places."""
        if self.states is not None:
            return self.states.at(good)
        pendula = self.scene.pendulum
        angles_alone = all(place[0] == "pendulum" and place[-2] in STARTING for place in differing if "start" in place)
        if angles_alone and not any(pendulum.start and pendulum.start.spread for pendulum in pendula):
            return self._turned(differing, len(good))
        return motion_of([self.state_of(int(place)) for place in good])

    def _turned(self, differing: Mapping[Place, Floats], size: int) -> Motion:
        """The start of the scene with other angles and rates of some links."""
        begun = initial_state(self.scene)
        parts = [np.repeat(values[None], size, axis=0) for values in (begun.links, begun.link_rates)]
        at = np.cumsum([0, *(pendulum.count * pendulum.n_links for pendulum in self.scene.pendulum)])
        for place, values in differing.items():
            if "start" in place:
                _, p, _, name, link = place
                pendulum = self.scene.pendulum[int(p)]
                columns = at[int(p)] + int(link) + pendulum.n_links * np.arange(pendulum.count)
                parts[STARTING[str(name)]][:, columns] = np.deg2rad(values)[:, None]
        cart = np.full(size, begun.cart), np.full(size, begun.cart_rate)
        carried = (np.repeat(values[None], size, axis=0) for values in (begun.supports, begun.support_rates))
        return Motion(parts[0], parts[1], *cart, np.zeros(size), *carried)


@dataclass(frozen=True, eq=False, repr=False)
class Members(Displayed):
    """All members: over the grid of `axes`, or with one value each in `lists`, (S,) by path, or from `states`."""

    scene: Scene
    axes: tuple[Variation, ...] = ()
    lists: Mapping[str, Floats] | None = None
    states: Motion | None = None

    def _summary(self) -> Summary:
        differ = ", ".join(self.paths) or "their starts"
        return Summary(f"{counted(self.size, 'member', 'members')} of {name_of(self.scene)} that differ in {differ}")

    @property
    def shape(self) -> tuple[int, ...]:
        """The numbers along every axis."""
        if self.axes:
            return tuple(len(axis.values) for axis in self.axes)
        if self.states is not None:
            return (len(self.states.links),)
        return (len(next(iter((self.lists or {}).values()))),)

    @property
    def size(self) -> int:
        """How many there are."""
        return prod(self.shape)

    @property
    def paths(self) -> tuple[str, ...]:
        """The varied places."""
        return (*(axis.path for axis in self.axes), *(self.lists or ()))

    @cached_property
    def varied(self) -> tuple[str, ...]:
        """The features that some members may have because of the variation."""
        return tuple(sorted({name for path in self.paths for name in varied_features(path)}))

    @property
    def values(self) -> dict[str, Floats]:
        """The values of each member at every varied place, (S,) by path."""
        grid = self._grid(np.arange(self.size))
        return {**dict(zip([axis.path for axis in self.axes], grid, strict=True)), **(self.lists or {})}

    def part(self, first: int, stop: int) -> MemberPart:
        """Those from one number on until before another."""
        members = np.arange(first, min(stop, self.size))
        values = dict(zip([axis.path for axis in self.axes], self._grid(members), strict=True))
        values |= {path: numbers[members] for path, numbers in (self.lists or {}).items()}
        states = None if self.states is None else self.states.at(members)
        return MemberPart(self.scene, first, len(members), values, states)

    def _grid(self, members: Ints) -> list[Floats]:
        if not self.axes:
            return []
        at = np.unravel_index(members, self.shape)
        return [np.array(axis.values)[k] for axis, k in zip(self.axes, at, strict=True)]

    def header(self) -> dict[str, Any]:
        """Their description, for a file."""
        axes = [{"path": axis.path, "values": axis.values, "log": axis.log} for axis in self.axes]
        header: dict[str, Any] = {"scene": describe(self.scene), "axes": axes, "size": self.size}
        arrays = [*(self.lists or {}).values(), *(vars(self.states).values() if self.states is not None else ())]
        if arrays:
            header["given"] = list(self.lists or ())
            header["sha256"] = sha256(b"".join(np.ascontiguousarray(array).tobytes() for array in arrays)).hexdigest()
        return header


def members_of(scene: Scene, starts: Starts | None, vary: Vary | None) -> Members:
    """The members of a scene with these starts or variations; raise SceneError with every mistake."""
    validate_scene(scene)
    if (starts is None) and not vary:
        raise SceneError([NONE_GIVEN])
    states, (axes, lists) = validate(
        lambda: None if starts is None else _states(scene, starts), lambda: _varied(scene, vary, starts is not None)
    )
    members = Members(scene, axes, lists, states)
    if states is not None and (axes or lists) and len({members.size, len(states.links)}) > 1:
        raise SceneError([f"starts: are {len(states.links)} for {members.size} members"])
    if states is None:
        initial_state(scene)
    return members


def _varied(scene: Scene, vary: Vary | None, started: bool) -> tuple[tuple[Variation, ...], dict[str, Floats]]:
    if not vary:
        return (), {}
    axes, arrays = parse_vary(scene, vary)
    lists = {path: numbers.ravel() for path, numbers in arrays.items()}
    if lists and (len({len(numbers) for numbers in lists.values()}) != 1 or not len(next(iter(lists.values())))):
        raise SceneError(["vary: needs as many values at every place, at least one"])
    paths = (*(axis.path for axis in axes), *lists)
    if started and (numbers := [path for path in paths if ".start." in path]):
        raise SceneError([f"{path}: cannot be varied where starts are given" for path in numbers])
    return axes, lists


def _states(scene: Scene, starts: Starts) -> Motion:
    system = system_of(scene)
    if isinstance(starts, Motion):
        return starts
    if isinstance(starts, Sequence) and len(starts) and isinstance(starts[0], State):
        return motion_of([validate_state(state, system) for state in starts])  # type: ignore[arg-type]
    try:
        angles = np.array(starts, dtype=float)
    except (TypeError, ValueError):
        angles = np.empty(0)
    if angles.ndim != 2 or angles.shape[1] != system.n_links or not len(angles):
        words = f"must be an array (members, {system.n_links}) of angles in rad, or states"
        raise SceneError([f"starts: {words}, not of shape {angles.shape}"])
    if not np.all(np.isfinite(angles)):
        raise SceneError(["starts: must be finite"])
    if system.spatial:
        raise SceneError(["starts: in space they must be states"])
    none, still = np.zeros(len(angles)), np.zeros((len(angles), system.first if system.structure else 0))
    return Motion(angles, np.zeros_like(angles), none, none, none, still, still)
