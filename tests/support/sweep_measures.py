"""Measures for tests of sweeps: they count, fail, die and wait, in whatever process they run."""

from __future__ import annotations

import os
import time
from pathlib import Path

from modal.extend.measures import SCENE_ITSELF, SECONDS, Measure
from modal.scene import Cart, Scene
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


class Product(Measure):
    name, words, columns, needs, usual = "product", "for tests", ("product_kg",), "a cart", 1.0
    reads = SCENE_ITSELF
    counts = SECONDS

    def of_scene(self, scene: Scene, number: float, portion: Portion) -> dict[str, float]:
        cart = cart_of(scene)
        log(f"{cart.mass:g}")
        return {"product_kg": number * cart.mass + cart.damping}


class Failing(Product):
    name = "failing"

    def of_scene(self, scene: Scene, number: float, portion: Portion) -> dict[str, float]:
        if cart_of(scene).mass == number:
            raise RuntimeError("nothing\nto see")
        return super().of_scene(scene, 1.0, portion)


class Dying(Product):
    name = "dying"

    def of_scene(self, scene: Scene, number: float, portion: Portion) -> dict[str, float]:
        if cart_of(scene).mass == number:
            os._exit(7)
        return super().of_scene(scene, 1.0, portion)


class Interrupted(Product):
    name = "interrupted"

    def of_scene(self, scene: Scene, number: float, portion: Portion) -> dict[str, float]:
        if cart_of(scene).mass == number and os.environ.get("SWEEP_INTERRUPTS"):
            raise KeyboardInterrupt
        return super().of_scene(scene, 1.0, portion)


class Slow(Product):
    name = "slow"

    def of_scene(self, scene: Scene, number: float, portion: Portion) -> dict[str, float]:
        time.sleep(number)
        return super().of_scene(scene, 1.0, portion)


PRODUCT, FAILING, DYING, INTERRUPTED, SLOW = (
    RequestedMeasure(measure(), 1.0) for measure in (Product, Failing, Dying, Interrupted, Slow)
)
