"""What a derivation is asked for: `chain:3`, `cart:2`, `cart:3x2` (three chains of two links), or a scene."""

from __future__ import annotations

import re

from modal.errors import SceneError
from modal.scene import Scene, load
from modal.symbolic import system as symbolic
from modal.symbolic.system import SYMBOLIC, SymbolicSystem

MOST_CHAINED = 1000
_TARGET = re.compile(r"(chain|cart):(?:(\d{1,4})x)?(\d{1,4})")
KINDS = ("bob", "rod")


def target(
    name: str, kind: str = "bob", chosen: tuple[str, ...] = (), ways: tuple[str, ...] = ()
) -> tuple[SymbolicSystem, Scene | None]:
    """The system that `name` asks for, and its scene where it is one.

    `kind` and `ways` (down or up, top to bottom) are for chain: and cart: alone, a scene has its own.  Raises
    SceneError for whatever cannot be.
    """
    unknown = [word for word in chosen if word not in SYMBOLIC]
    if unknown:
        raise SceneError([f"{word}: must be one of {', '.join(SYMBOLIC)}" for word in unknown])
    found = _TARGET.fullmatch(name)
    if not found:
        if ways or kind != KINDS[0]:
            raise SceneError(
                [f"{name}: a kind of link and an equilibrium are for chain: and cart:, a scene has its own"]
            )
        scene = load(name)
        return symbolic.of_scene(scene, chosen), scene
    support, count, links = found[1], int(found[2] or 1), int(found[3])
    if support == "chain" and found[2]:
        raise SceneError([f"{name}: a chain hangs alone; write chain:{links}, or cart:{count}x{links}"])
    if links < 1 or count < 1 or links * count > MOST_CHAINED:
        raise SceneError([f"{name}: from 1 to {MOST_CHAINED} links in all"])
    sigma = _sigma(name, ways, links)
    if support == "chain":
        return symbolic.chain(links, kind, chosen, sigma), None
    return symbolic.cart(links, count, kind, chosen, sigma), None


def _sigma(name: str, ways: tuple[str, ...], links: int) -> tuple[int, ...]:
    if ways and (len(ways) != links or not set(ways) <= {"down", "up"}):
        raise SceneError([f"{name}: the equilibrium must be {links} of down and up, top to bottom"])
    return tuple(-1 if way == "up" else 1 for way in ways)
