"""How the frequencies of the modes that move the cart change as its mass goes from 0 to ∞."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from modal.coupling import Coupling
from modal.plotting.coupling import crowded, name, plain, pole, span, zero
from modal.plotting.layout import SMALL
from modal.plotting.palette import ink, paper
from modal.types import Floats, Ints

MOST_LINES, MASSES = 12, 81
CART_MASS = r"mass of the cart $m_c$ (kg)"


def draw_limits(axis: Axes, coupling: Coupling) -> None:
    """Frequencies of the modes that move the cart, as its mass goes from 0 to ∞."""
    poles, here = coupling.dynamic.omega, coupling.dynamic.cart if coupling.on_cart else np.inf
    low, high = _masses(coupling, here)
    masses = np.geomspace(low, high, MASSES)
    omega = coupling.swept(masses)
    chosen, drawn = _some(omega.shape[1]), _some(len(poles))
    crowd = crowded(coupling)
    axis.hlines(poles[drawn], low, high, color=pole(), ls="--", lw=0.6 if crowd else 1.0, alpha=0.8)
    axis.plot(masses, omega[:, chosen], color=zero(), lw=0.9 if crowd else 1.6)
    light = np.array([mode.light for mode in coupling.cart_modes])
    now = np.array([mode.omega for mode in coupling.cart_modes]) if coupling.on_cart else poles
    bottom, top, wide = span(np.concatenate([poles, now, light[np.isfinite(light)]]))
    axis.set(
        xscale="log",
        xlim=(low, high),
        yscale="log" if wide else "linear",
        xlabel=CART_MASS,
        ylabel="angular frequency ω (rad/s)",
    )
    axis.set_ylim(bottom, top)
    _here(axis, here, float(np.clip(here, low, high)), now[chosen[chosen < len(now)]], size=4 if crowd else 6)
    if not crowd:
        _ends(axis, low, [(value, f"{value:.5g}") for value in light[np.isfinite(light)].tolist()], zero(), (4, 4))
        _ends(axis, high, [(value, name(k)) for k, value in enumerate(poles.tolist())], pole(), (5, -3))
    some = f"; {len(chosen)} of {omega.shape[1]} modes" if len(chosen) < omega.shape[1] else ""
    axis.set_title(f"massless cart  ←  modes that move the cart, as its mass changes{some}  →  fixed support")


def _ends(axis: Axes, x: float, marks: list[tuple[float, str]], hue: str, offset: tuple[int, int]) -> None:
    """Words where the lines end, those left out that would touch the last."""
    last, to_share = -np.inf, axis.transData + axis.transAxes.inverted()
    for y, word in marks:
        at = float(to_share.transform((x, y))[1])
        if at - last > 0.06:
            last = at
            axis.annotate(
                word,
                (x, y),
                offset,
                textcoords="offset points",
                fontsize=SMALL,
                color=hue,
                zorder=5,
                bbox=plain() | {"pad": 0.5},
            )


def _masses(coupling: Coupling, here: float) -> tuple[float, float]:
    """Carts (kg) from far lighter to far heavier than what hangs, the scene's own among them."""
    hanging = coupling.dynamic.with_cart(0.0).at_rest
    low, high = hanging * 1e-3, hanging * 1e3
    return (min(low, here / 10), max(high, here * 10)) if 0 < here < np.inf else (low, high)


def _some(count: int) -> Ints:
    """At most MOST_LINES indices, the first and the last among them."""
    return np.unique(np.linspace(0, count - 1, min(MOST_LINES, count)).round().astype(np.int64))


def _here(axis: Axes, here: float, spot: float, now: Floats, *, size: float) -> None:
    """The scene's own cart, and its frequencies as dots."""
    where = "a massless cart" if here == 0 else "a fixed support" if np.isinf(here) else f"{here:.6g} kg"
    late = spot > np.sqrt(np.prod(axis.get_xlim()))
    axis.axvline(spot, color=ink(), lw=1.2, ls=":")
    if now.size:
        spots = np.full(len(now), spot)
        axis.plot(spots, now, "o", color=zero(), ms=size, mec=paper(), mew=size / 8, zorder=4, clip_on=False)
    axis.annotate(
        f"this scene: {where}",
        (spot, 0.0),
        (-5 if late else 5, 6),
        axis.get_xaxis_transform(),
        textcoords="offset points",
        ha="right" if late else "left",
        fontsize=SMALL,
        bbox=plain(),
    )
