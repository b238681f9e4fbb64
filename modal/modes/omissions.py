"""What the linear model of a scene leaves out, in sentences."""

from __future__ import annotations

from modal.scene import Cart, Scene

HOISTED = "Lengths change with the hoist: these are the modes at the lengths before it; hoist lists them along it."
AT_REST = "The support's motion is left out: the modes are those about a support at rest."
RUBBING = "Dry friction is left out: at an amplitude it acts as a damping ratio, and in the end it stops a swing."
GRIPPED = (
    "Dry friction on the rail is left out: at an amplitude it acts as a damping ratio, and in the end it holds the "
    "cart, and what hangs there swings on as on a fixed support."
)
FAST_AIR = "Quadratic drag is left out: it dies out with the square of the speed."
UNDRIVEN = "Drives are left out: they sustain small swings without changing the modes."


def omitted(scene: Scene) -> tuple[str, ...]:
    """What the linear model of a scene leaves out, a sentence each."""
    quadratic = any(link.quadratic_drag for link in scene.links())
    return (
        *[HOISTED] * scene.is_hoisted,
        *[UNDRIVEN] * scene.is_driven,
        *[AT_REST] * scene.is_moved,
        *[GRIPPED if scene.is_gripped else RUBBING] * scene.has_friction,
        *[FAST_AIR] * quadratic,
    )


def unconserved(scene: Scene) -> tuple[str, ...]:
    """What the periodic orbits of a mode leave out, a sentence each: all that drains or supplies energy."""
    cart, links = scene.support if isinstance(scene.support, Cart) else None, tuple(scene.links())
    damped = any(link.damping for link in links) or bool(cart and cart.damping)
    left_out = {
        "Dampers are": damped,
        "Drag is": any(link.drag for link in links),
        "Damping ratios are": scene.has_modal_damping,
        "Drives are": scene.is_driven,
        "Dry friction is": scene.has_friction,
        "Quadratic drag is": any(link.quadratic_drag for link in links),
    }
    return tuple(
        f"{words} left out: the orbits of a mode conserve energy." for words, there in left_out.items() if there
    )
