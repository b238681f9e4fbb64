"""Pictures of identified, compared and fitted modes, and of a response with its band: examined in both themes."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import cycle

import numpy as np
import pytest
from amounts import usually
from matplotlib.figure import Figure
from seen import flaws

from modal import load
from modal.identification import (
    MeasuredMode,
    MeasuredModes,
    compare_modes,
    estimate_of,
    fit_modes,
    identify,
    magnitude_std,
)
from modal.modes import natural_modes
from modal.plotting import assurance_figure, bode_figure, mode_fit_figure, poles_figure
from modal.plotting.style import theme
from modal.scene.parameters import vary
from modal.statespace import state_space, to_modal_form


def measured(*, shapes: bool) -> MeasuredModes:
    modes = natural_modes(load("chain-3"))
    measured_modes = [
        MeasuredMode(k + 1, w / (2 * np.pi) * (1.02 - 0.01 * k), 0.004, 0.01, 0.002, modes.matrix.shapes[:, k] * shapes)
        for k, w in enumerate(modes.omega.tolist())
    ]
    if not shapes:
        measured_modes = [MeasuredMode(mode.number, mode.frequency, mode.std) for mode in measured_modes]
    return MeasuredModes("m.csv", tuple(measured_modes), ((1, 1), (1, 2), (1, 3)) if shapes else ())


def poles() -> Figure:
    times = 0.02 * np.arange(600)
    waves = [np.exp(complex(-0.05 - 0.1 * k, 4 + 5 * k) * times).real for k in range(3)]
    mixed = np.column_stack(waves) @ np.array([[1, 2, 2.5], [1, 0.3, -1], [1, -1.5, 0.6]])
    noise = 0.01 * np.random.default_rng(0).standard_normal(mixed.shape)
    return poles_figure(identify([(times, mixed + noise)], ["theta_1_1", "theta_1_2", "theta_1_3"]), "record.csv")


def compared(shapes: bool) -> Figure:
    return assurance_figure(compare_modes(natural_modes(load("chain-3")), measured(shapes=shapes)))


def fitted() -> Figure:
    scene = vary(load("chain-3"), {"pendulum[0].links[0].damping": 0.1})
    return mode_fit_figure(fit_modes(scene, measured(shapes=True), ["pendulum[0].links[0].length"]))


def banded() -> Figure:
    scene = vary(load("crane-hook"), {"pendulum[0].links[0].damping": 3000.0})
    record = {"parameters": [{"place": "pendulum[0].links[0].length", "value": 12.0}], "covariance": [[0.09]]}
    model = state_space(scene)
    std = partial(magnitude_std, model, estimate_of(scene, record))
    return bode_figure(to_modal_form(natural_modes(scene), model), std=std)


FIGURES: dict[str, Callable[[], Figure]] = {
    "poles": poles,
    "compared": partial(compared, True),
    "frequencies": partial(compared, False),
    "fitted": fitted,
    "banded": banded,
}


@pytest.mark.parametrize(("kind", "name"), [*zip(FIGURES, cycle(["light", "dark"]))][: usually(2, 5)])
def test_nothing_is_wrong_with_the_figure(kind: str, name: str) -> None:
    with theme(name):
        assert flaws(FIGURES[kind]()) == []
