"""Films in a notebook: in both themes, small enough to be part of it, and playing without being asked."""

from __future__ import annotations

from io import BytesIO
from typing import Any

from modal.plotting.style import theme
from modal.plotting.themes import ThemedPicture
from modal.report import visible
from modal.scene import title_of
from modal.scene.doors import require_type
from nonlinear.integration import Trajectory
from nonlinear.plotting.animation import animate


def show_film(trajectory: Trajectory, words: str = "", **options: Any) -> ThemedPicture:
    """A film of a motion as a GIF on light and on dark paper, to be the last line of a cell.

    `words` say what is seen, by default the scene's title; the options are those of `animate`, such as `speed`,
    `seconds` and `fps`.  Raises what `animate` raises.

    >>> from modal import load
    >>> from nonlinear import simulate
    >>> show_film(simulate(load("chain-1"), 1.0), "a pendulum swings", seconds=0.2)
    ThemedPicture('a pendulum swings', gif)
    """
    require_type("trajectory", trajectory, "Trajectory")
    films = []
    for name in ("light", "dark"):
        buffer = BytesIO()
        with theme(name):
            animate(trajectory, buffer, "gif", **options)
        films.append(buffer.getvalue())
    return ThemedPicture(films[0], films[1], words or visible(title_of(trajectory.scene)), "gif")
