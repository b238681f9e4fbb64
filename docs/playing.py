"""The live pages of the shipped scenes: `python docs/playing.py FOLDER` writes them, as the manual's build does."""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path

from modal.errors import SceneError
from modal.scene import Scene, example_names, load
from multipendula.page import page, scene_data


@cache
def pages() -> dict[str, tuple[Scene, str]]:
    """Every shipped scene by its name, and why it has no page (empty where it has one)."""
    return {name: (load(name), _reason(load(name))) for name in example_names()}


def _reason(scene: Scene) -> str:
    try:
        scene_data(scene)
    except SceneError as error:
        return "; ".join(error.problems)
    return ""


def build(folder: Path) -> None:
    """Write the page of every scene that has one."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, (scene, why) in pages().items():
        if not why:
            (folder / f"{name}.html").write_text(page(scene_data(scene)), encoding="utf-8")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("which folder? python docs/playing.py FOLDER")
    build(Path(sys.argv[1]))
