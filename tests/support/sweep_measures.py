"""Measures for tests of sweeps: they count, fail, die and wait, in whatever process they run."""

from __future__ import annotations

import os
import time
from pathlib import Path

from modal.scene import Cart, Scene
from nonlinear.measures import Measure
from nonlinear.sweeps.measures import Portion, RequestedMeasure


def cart_of(scene: Scene) -> Cart:
    assert isinstance(scene.support, Cart)
    return scene.support


def log(line: str) -> None:
    with open(os.environ["SWEEP_LOG"], "a", encoding="utf-8") as stream:
        stream.write(line + "\n")


def logged() -> list[str]:
    path = Path(os.environ["SWEEP_LOG"])
    return path.read_text(encoding="utf-8").split() if path.exists() else []


def product(scene: Scene, number: float, portion: Portion) -> dict[str, float]:
    cart = cart_of(scene)
    log(f"{cart.mass:g}")
    return {"product_kg": number * cart.mass + cart.damping}


def failing(scene: Scene, number: float, portion: Portion) -> dict[str, float]:
    if cart_of(scene).mass == number:
        raise RuntimeError("nothing\nto see")
    return product(scene, 1.0, portion)


def dying(scene: Scene, number: float, portion: Portion) -> dict[str, float]:
    if cart_of(scene).mass == number:
        os._exit(7)
    return product(scene, 1.0, portion)


def interrupted(scene: Scene, number: float, portion: Portion) -> dict[str, float]:
    if cart_of(scene).mass == number and os.environ.get("SWEEP_INTERRUPTS"):
        raise KeyboardInterrupt
    return product(scene, 1.0, portion)


def slow(scene: Scene, number: float, portion: Portion) -> dict[str, float]:
    time.sleep(number)
    return product(scene, 1.0, portion)


PRODUCT, FAILING, DYING, INTERRUPTED, SLOW = (
    RequestedMeasure(Measure(function.__name__, "for tests", ("product_kg",), "a cart", usual=1.0), function, 1.0)
    for function in (product, failing, dying, interrupted, slow)
)
