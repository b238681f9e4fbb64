"""Rates of lanes whose joints have dry friction, each slipping to a side or sticking.

The accelerations are linear in the friction torques,

    q'' = a(q, q') + Σ_j T_j w_j(q),        T_j = −s_j M_j of a joint that slips to the side s_j,

and of those that stick T makes the relative acceleration vanish.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from nonlinear.dynamics import Lanes
from nonlinear.integration.within import fill
from nonlinear.system import Numbers


@dataclass(frozen=True, eq=False)
class Joint:
    """A joint with dry friction: the components of y' that its relative rate is made of, and the limit (W,) in N m.

    On the rail `above` is None and the limit a force (N).  `acts` are the places of its torque, with signs, among the
    force on the cart and the moments on all links.
    """

    below: int
    above: int | None
    limit: Any
    acts: tuple[tuple[int, float], ...]

    def relative(self, rows: Any) -> Any:
        """The rate of the joint from the components of velocity, or its acceleration from those of acceleration."""
        return rows[self.below] if self.above is None else rows[self.below] - rows[self.above]


class Responses:
    """The accelerations of W lanes without friction, and their responses to a unit of torque at each joint."""

    def __init__(self, lanes: Lanes, numbers: Numbers, joints: Sequence[Joint], width: int) -> None:
        self.joints, self.width, self.half = joints, width, lanes.layout.half
        self.limits, self.eye = np.stack([one.limit for one in joints]), np.eye(len(joints))[:, :, None]
        self.relative = np.array([one.relative(np.eye(self.half)) for one in joints])
        unit = np.repeat(np.eye(1 + len(joints))[1:], width, axis=1)
        every = numbers.at(np.tile(np.arange(width), 1 + len(joints)))
        self.rates = pushed(lanes, every, joints, unit)

    def __call__(self, y: Any) -> tuple[Any, Any]:
        """The rates y' (size, W) without friction, and the responses (J, half, W)."""
        every = np.tile(y, 1 + len(self.joints))
        free, *found = np.split(filled(self.rates(every), every), 1 + len(self.joints), axis=1)
        return free, np.array([own[self.half :] - free[self.half :] for own in found])

    def torques(self, free: Any, responses: Any, sides: Any) -> Any:
        """The torques (J, W) of joints that slip to these sides (J, W), or at side 0 stick."""
        slipping = sides != 0
        matrix = np.tensordot(self.relative, responses, axes=(1, 1))
        matrix = np.where(slipping[:, None], self.eye, matrix)
        right = np.where(slipping, -sides * self.limits, -(self.relative @ free[self.half :]))
        if len(self.joints) == 1:
            return right / matrix[0]
        return np.linalg.solve(np.moveaxis(matrix, -1, 0), right.T[..., None])[..., 0].T

    def under(self, free: Any, responses: Any, torques: Any) -> Any:
        """The rates y' (size, W) under torques (J, W)."""
        found = free.copy()
        for response, torque in zip(responses, torques, strict=True):
            found[self.half :] += response * torque
        return found


class Rates:
    """The rates y' of W lanes, of which each joint slips to a side or, at side 0, sticks."""

    def __init__(self, lanes: Lanes, numbers: Numbers, joints: Sequence[Joint], sides: Any) -> None:
        self.lanes, self.numbers, self.joints = lanes, numbers, joints
        self.sides = sides
        self.set(sides)

    def set(self, sides: Any) -> None:
        """The sides (J, W) from now on."""
        self.sides = sides
        limits = np.array([joint.limit for joint in self.joints]).reshape(sides.shape)
        self.slip = pushed(self.lanes, self.numbers, self.joints, -sides * limits)
        self.stuck = np.flatnonzero(np.any(sides == 0, axis=0))
        if len(self.stuck):
            own = [replace(joint, limit=joint.limit[self.stuck]) for joint in self.joints]
            self.responses = Responses(self.lanes, self.numbers.at(self.stuck), own, len(self.stuck))

    def __call__(self, y: Any) -> Any:
        """The rates y' (size, W)."""
        found = filled(self.slip(y), y) if len(self.stuck) < y.shape[1] else np.empty_like(y)
        if len(self.stuck):
            free, responses = self.responses(y[:, self.stuck])
            torques = self.responses.torques(free, responses, self.sides[:, self.stuck])
            found[:, self.stuck] = self.responses.under(free, responses, torques)
        return found


def pushed(lanes: Lanes, numbers: Numbers, joints: Sequence[Joint], torques: Any) -> Any:
    """The function that gives y' of lanes with these numbers under torques (J, W) of the joints."""
    pushes: list[Any] = [np.zeros(1)] * (1 + lanes.system.n_links)
    for joint, torque in zip(joints, torques, strict=True):
        for place, sign in joint.acts:
            pushes[place] = pushes[place] + sign * torque
    return lanes.rates(Numbers(numbers.system, (*numbers.entries, *pushes)))


def filled(rates: Any, like: Any) -> Any:
    """Rows, each an array or one number, as an array like another."""
    found = np.empty(like.shape, dtype=like.dtype)
    fill(rates, found)
    return found
