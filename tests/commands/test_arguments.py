"""Arguments of the packages' functions have the names that the table of options gives them, and take the same texts."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from modal import SceneError, load, tuning
from modal.scene.parameters import parse_variations
from multipendula.cli import main
from multipendula.commands import command_named
from nonlinear import chaos, ensembles, identification, orbits, sweeps, synchronization

CREW = {"--workers", "--scheduler"}
OF_COMMAND = {
    "orbits": {"--enter", "--depth", "--settled", "--duration", "--film"},
    "sync": {"--film", "--words", "--map"},
    "chaos": {"--quick"},
    "fit": {"--picture", "--report", "--where", "--every", "--angles", "--column", "--pixel", "--bootstrap"},
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
    "orbits": (orbits.nonlinear_mode, orbits.mode_along, orbits.follow_cycles, orbits.follow_forced_orbits),
    "sync": (synchronization.study_synchronization, synchronization.follow_branches, ensembles.find_rhythms),
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
    excepted = WRITTEN | OF_COMMAND.get(name, set())
    missing = {
        option.name: option.keyword
        for option in taken
        if option.name not in excepted and not ({option.keyword, "crew" if option.name in CREW else ""} & arguments)
    }
    assert missing == {}


def test_a_text_stands_for_a_list_of_one() -> None:
    assert parse_variations("gravity=9,10") == parse_variations(["gravity=9,10"])
    scene = load("chain-2")
    single, several = (sweeps.find_spread(scene, texts, members=3) for texts in ("gravity=1%", ["gravity=1%"]))
    assert (single.omega == several.omega).all()


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda scene: chaos.lyapunov_exponent(scene, ensemble=3), "ensemble: is now members"),
        (lambda scene: ensembles.find_section(scene, orbits=3, at="x=0"), "orbits: is now members"),
        (lambda scene: ensembles.find_strobes(scene, orbits=3), "orbits: is now members"),
        (lambda scene: sweeps.find_spread(scene, tolerances=["gravity=1%"]), "tolerances: is now uncertain"),
        (lambda scene: orbits.follow_forced_orbits(scene, variation="gravity=1:2:2"), "variation: is now vary"),
    ],
)
def test_a_former_name_says_the_present_one(call: Callable[[Any], object], words: str) -> None:
    with pytest.raises(SceneError, match=words):
        call(load("chain-2"))


PAGE = (Path(__file__).parents[2] / "docs/reference/values.md").read_text(encoding="utf-8")
ROWS = [(row[1], row[2]) for row in re.finditer(r"^\| `(gravt?i?ty[^`]*)` \| (.*) \|$", PAGE, re.MULTILINE)]
VALUES = [(text, words) for text, words in ROWS if re.fullmatch(r"[0-9., ]+", words)]
REFUSALS = [row for row in ROWS if row not in VALUES]
VARYING = {"sweep": (), "basins": ("--vary", "pendulum[0].links[0].mass=1:2:2"), "orbits": ("--mode", "1"), "sync": ()}


@pytest.mark.parametrize(("text", "words"), VALUES)
def test_values_of_the_manual_are_those_of_a_branch(text: str, words: str) -> None:
    values = [float(word) for word in words.split(",")]
    (variation,) = parse_variations(text)
    assert variation.values == pytest.approx(values, rel=1e-15)
    branch = orbits.mode_along(load("chain-1"), 1, text, 0.3)
    assert all(np.isclose(branch.value, value, rtol=1e-9).any() for value in values)


@pytest.mark.parametrize(("text", "words"), REFUSALS)
def test_every_command_refuses_alike_what_are_no_values(
    text: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert len(VALUES) == 3
    assert len(REFUSALS) == 8
    for name, more in VARYING.items():
        assert main([name, "metronomes" if name == "sync" else "chain-1", "--vary", text, *more]) == 2, name
        assert words in " ".join(capsys.readouterr().err.split()), name
