"""The coupling in one picture: the dynamic mass with its poles and zeros, each family close up, and the cart's mass."""

from __future__ import annotations

from typing import IO

from matplotlib.figure import Figure
from matplotlib.gridspec import GridSpec
from matplotlib.lines import Line2D

from modal.coupling import Coupling
from modal.plotting.cart_mass_figures import draw_limits
from modal.plotting.coupling import close_families, curve, draw_close, draw_mass, pole, zero
from modal.plotting.layout import headline, key
from modal.plotting.palette import muted, paper
from modal.plotting.style import WIDE, save, sheet


def draw_coupling(coupling: Coupling, stream: IO[bytes], kind: str = "png") -> None:
    """Write the picture as png, svg or pdf."""
    save(coupling_figure(coupling), stream, kind)


def coupling_figure(coupling: Coupling) -> Figure:
    """The coupling in one picture; of many poles and lines it shows some and says so."""
    close = close_families(coupling)
    figure = sheet(WIDE, 10.5 if close else 7.6)
    rows = GridSpec(3 if close else 2, max(1, len(close)), figure, height_ratios=(3, 2.1, 3) if close else (1, 1))
    draw_mass(figure.add_subplot(rows[0, :]), coupling)
    for column, number in enumerate(close):
        draw_close(figure.add_subplot(rows[1, column]), coupling, number)
    draw_limits(figure.add_subplot(rows[-1, :]), coupling)
    _finish(figure, coupling)
    return figure


def _finish(figure: Figure, coupling: Coupling) -> None:
    what = "what a force on the cart feels" if coupling.on_cart else "what a cart here would feel"
    headline(figure, coupling.scene.title, what)
    entries = {
        "dynamic mass": Line2D([], [], color=curve()),
        "poles: the cart stands still": Line2D([], [], color=pole(), ls="--", lw=1.1),
        "zeros: the cart moves": Line2D([], [], color=zero(), marker="o", mec=paper()),
        "felt by a fast push": Line2D([], [], color=muted(), ls=":", lw=0.9),
    }
    entries = entries if coupling.on_cart else dict(list(entries.items())[:3])
    key(figure, list(entries.values()), list(entries))
