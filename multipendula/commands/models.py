"""Arguments shared by the commands about state-space models: the model, its signals, and the file that is written."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from multipendula.command import option
from multipendula.commands.shared import about, large, listed, noted
from multipendula.completion import words

if TYPE_CHECKING:
    from modal.scene import Scene
    from modal.statespace import StateSpace

OUTPUTS = (
    *("cart_position", "cart_velocity", "angles", "rates", "relative_angles", "relative_rates"),
    *("joint_positions", "tip_positions", "tip_accelerations", "pivot_forces"),
    *("coordinates", "coordinate_rates", "coordinate_accelerations", "spring_forces", "spring_extensions"),
)
"""The groups of outputs of a model."""
INPUTS = (
    *("cart_force", "cart_acceleration", "cart_velocity", "joint_torques", "link_forces", "coordinate_forces"),
    *("support_displacement", "support_velocity", "support_acceleration", "force:", "lift:", "torque:", "force[0]"),
)
SIGNALS = (
    option(
        "--input: cart_force (default on a cart), cart_acceleration or cart_velocity; coordinate_forces (default on a "
        "structure) or one of them, such as floor2_force; joint_torques (default on a fixed support), link_forces; "
        "support_displacement, support_velocity or support_acceleration; force:POINT, lift:POINT or torque:POINT, with "
        "a POINT such as pendulum[0].links[1]@0.5 or ship@0.2,0.1; force[0], the scene's first force",
        completion=words(INPUTS),
    ),
    option(
        "--signals: cart_position,angles (default), cart_velocity, rates, relative_angles, relative_rates, "
        "joint_positions, tip_positions, tip_accelerations, pivot_forces; of a structure coordinates,angles (default), "
        "coordinate_rates, coordinate_accelerations, spring_forces, spring_extensions, or single ones, such as "
        "floor2_m",
        completion=words(OUTPUTS),
    ),
    "--when",
)
"""The groups of inputs and outputs of a model, and the time of a hoist."""


def scene_of(options: argparse.Namespace, capability: str) -> Scene:
    """The scene, with a note on what a capability leaves out of it."""
    return about(large(noted(scene_at(options), capability)))


def scene_at(options: argparse.Namespace) -> Scene:
    """The scene, at the time asked for if it has a hoist."""
    from modal.errors import SceneError
    from modal.scene import load

    scene = load(options.scene)
    if options.when is None:
        return scene
    if not scene.is_hoisted:
        raise SceneError(["--when: this scene has no hoist, and its lengths are those of every time"])
    return scene.at(options.when)


def model_of(scene: Scene, options: argparse.Namespace) -> StateSpace:
    """The model with the inputs and outputs, and the reduction, given by the options."""
    from modal.statespace import state_space

    inputs, outputs = listed(options.input), listed(options.signals)
    count = getattr(options, "dominant", None)
    if not getattr(options, "minimal", False) and count is None:
        return state_space(scene, inputs, outputs)
    from modal.modes import natural_modes
    from modal.statespace import minimal, truncate

    if count is None:
        return minimal(scene, inputs, outputs)
    return truncate(natural_modes(scene), state_space(scene, inputs, outputs), count)
