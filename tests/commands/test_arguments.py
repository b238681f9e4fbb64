"""Arguments of the packages' functions have the names that the table of options gives them, and take the same texts."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

import pytest

from modal import SceneError, load, tuning
from modal.scene.parameters import parse_variations
from multipendula.commands import command_named
from nonlinear import chaos, ensembles, identification, orbits, sweeps, synchronization

CREW = {"--workers", "--scheduler"}
OF_COMMAND = {
    "orbits": {"--enter", "--depth", "--settled", "--duration", "--film"},
    "sync": {"--film", "--words"},
    "chaos": {"--quick"},
    "fit": {"--picture", "--report", "--where", "--angles", "--column", "--bootstrap"},
    "tune": {"--picture", "--report", "--largest-angle"},
    "sweep": {"--picture", "--fresh", "--loci", "--strobe", "--output"},
}
"""What the command itself does, or another function than these: what a record has, which branches are entered."""
WRITTEN = {"--output", "--format", "--theme", "--quiet"}
FUNCTIONS: dict[str, tuple[Callable[..., Any], ...]] = {
    "sweep": (sweeps.sweep, ensembles.find_bifurcations),
    "basins": (ensembles.find_basins, ensembles.ensemble),
    "section": (ensembles.find_section, ensembles.find_strobes, ensembles.ensemble),
    "spread": (sweeps.find_spread, ensembles.ensemble),
    "orbits": (orbits.nonlinear_mode, orbits.mode_along, orbits.follow_cycles, orbits.follow_forced),
    "sync": (synchronization.study_synchronization, synchronization.follow_branches),
    "chaos": (chaos.lyapunov_exponent, chaos.measure),
    "fit": (identification.fit, identification.compare),
    "tune": (tuning.tune,),
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_an_option_is_an_argument_by_its_name(name: str) -> None:
    arguments = {argument for function in FUNCTIONS[name] for argument in inspect.signature(function).parameters}
    command = command_named(name)
    assert command
    taken = [option for option in command.options if option.name.startswith("--")]
    own = WRITTEN | OF_COMMAND.get(name, set())
    missing = {
        option.name: option.keyword
        for option in taken
        if option.name not in own and not ({option.keyword, "crew" if option.name in CREW else ""} & arguments)
    }
    assert missing == {}


def test_a_text_stands_for_a_list_of_one() -> None:
    assert parse_variations("gravity=9,10") == parse_variations(["gravity=9,10"])
    scene = load("chain-2")
    one, several = (sweeps.find_spread(scene, texts, members=3) for texts in ("gravity=1%", ["gravity=1%"]))
    assert (one.omega == several.omega).all()


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda scene: chaos.lyapunov_exponent(scene, ensemble=3), "ensemble: is now members"),
        (lambda scene: ensembles.find_section(scene, orbits=3, at="x=0"), "orbits: is now members"),
        (lambda scene: ensembles.find_strobes(scene, orbits=3), "orbits: is now members"),
        (lambda scene: sweeps.find_spread(scene, tolerances=["gravity=1%"]), "tolerances: is now uncertain"),
        (lambda scene: orbits.follow_forced(scene, variation="gravity=1:2:2"), "variation: is now vary"),
    ],
)
def test_a_former_name_says_the_present_one(call: Callable[[Any], object], words: str) -> None:
    with pytest.raises(SceneError, match=words):
        call(load("chain-2"))
