"""The recorded steps of one link, looped along chains, against the equations of whole scenes, energies and matrices."""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import pytest
from amounts import usually
from scenes import geared, motion_scene

from modal.assembly import matrices
from modal.scene import Scene
from nonlinear.dynamics import Generated, Mechanics, Minimal, Module, link_steps, support_steps
from nonlinear.dynamics.steps import LINK
from nonlinear.system import System, system_of

SEEDS = usually(range(4), range(60))
READ = ((r"const (.*);", r" \1"), (r"(return .*|o\[.*);", r" \1"), (r"(\w+\(.*\)) \{", r"def \1:"), (r"[{}],?", ""))


class Spoken:
    """The functions that JavaScript is given, which differ from Python's in their braces."""

    def __init__(self, module: Module) -> None:
        lines = module.javascript().split("\n")
        text = "\n".join(next(re.sub(old, new, line) for old, new in READ if re.fullmatch(old, line)) for line in lines)
        self.made: dict[str, Any] = {"sin": math.sin, "cos": math.cos, "sqrt": math.sqrt}
        exec(text, self.made)

    def __call__(self, name: str, p: list[float], y: Any, u: Any, v: Any = ()) -> list[float]:
        entries: dict[int, float] = {}
        self.made[name](self.made["constants"](p), y, u, v, entries)
        return [entries[k] for k in range(len(entries))]


def chains(system: System) -> list[tuple[list[int], list[dict[str, float]]]]:
    """Of every pendulum the places of its links, and their numbers p by name."""
    pairs = []
    for group in system.groups:
        block = group.block
        for p in range(group.index.shape[1]):
            links = []
            for i in range(group.n):
                names = ("mass", "length", "centre", "inertia", "rotor", "damping", "stiffness", "drag", "sigma")
                numbers = {
                    name: float(np.broadcast_to(getattr(block, name), group.index.shape)[i, p]) for name in names
                }
                numbers |= {"strength": 0.0, "angle_deg": 180.0, "quadratic": 0.0, "static": float(block.b[i, p])}
                for term in group.laws:
                    for number in np.flatnonzero((term.rows == i) & (term.columns == p)):
                        named = zip(("strength", "angle_deg"), term.numbers, strict=True)
                        numbers |= {name: float(values[number]) for name, values in named}
                if group.quadratic_drag is not None:
                    numbers["quadratic"] = float(group.quadratic_drag[i, p])
                numbers |= {"rest": float(system.rest[group.index[i, p]]), "bent": float(group.joint_rest[i, p])}
                links.append(numbers | {"gravity": system.gravity})
            pairs.append((group.index[:, p].tolist(), links))
    return pairs


def stepped(system: System, y: Any, at_rest: bool = False) -> Any:
    """The rates (2 half,) of y; with `at_rest` those of small deviations y from equilibrium."""
    links, support = Spoken(link_steps(linear=at_rest)), Spoken(support_steps(linear=at_rest))
    first, half, wide = system.first, system.n_links + system.first, 1 + at_rest

    def step(name: str, numbers: dict[str, float], *arguments: Any) -> list[float]:
        return links(name, [numbers[key] for key in LINK], *arguments)

    q, v = y[:half], y[half : 2 * half]
    cart = (q[0], v[0]) if first else (0.0, 0.0)
    total, kept = np.zeros(13 * wide), []
    for places, numbers in chains(system):
        states, swung = [], [[0.0, 0.0] * at_rest + [cart[1], 0.0]]
        for i, (place, constants) in enumerate(zip(places, numbers, strict=True)):
            above = [q[first + places[i - 1]], v[first + places[i - 1]]] if i else [0.0, 0.0]
            moving = [q[first + place], v[first + place], *above, *[0.0] * 5]
            rest = [constants["rest"], 0.0, numbers[i - 1]["rest"] if i else 0.0, *[0.0] * 6]
            states.append([*rest, *moving] if at_rest else moving)
            swung.append(step("swung", constants, states[i], swung[i]))
        answers = [[0.0] * (13 * wide)]
        for i in reversed(range(len(places))):
            answers.insert(0, step("answered", numbers[i], states[i], answers[0], swung[i]))
        total += answers[0]
        kept.append((places, numbers, states, answers))
    held = system.cart
    p = [held.mass, held.damping, held.stiffness, system.gravity] if held else [1.0, 0.0, 0.0, system.gravity]
    rail = [0.0] * 5 * at_rest + [*cart, 0.0, 0.0, 0.0]
    start = support("railed" if held else "held", p, rail, total.tolist())
    accelerations = np.zeros(half)
    accelerations[:first] = sum(start[::3])
    for places, numbers, states, answers in kept:
        fallen = start
        for i, place in enumerate(places):
            fallen = step("fallen", numbers[i], states[i], fallen, answers[i])
            accelerations[first + place] = sum(fallen[2::3])
    return np.concatenate((v, accelerations))


@pytest.mark.parametrize("seed", SEEDS)
def test_steps_along_chains_are_the_equations_of_a_scene(seed: int) -> None:
    scene = aired(motion_scene(seed))
    equations = Generated(system_of(scene))
    y = np.random.default_rng(seed).normal(size=equations.layout.size)
    n = 2 * equations.layout.half
    assert stepped(equations.system, y) == pytest.approx(equations.derivative(0.0, y)[:n], rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("seed", SEEDS)
def test_linear_steps_are_their_derivative_at_rest(seed: int) -> None:
    """By complex steps; quadratic drag has none at rest and is omitted."""
    equations = Generated(system_of(aired(motion_scene(seed), quadratic_drag=0.0)))
    layout, system = equations.layout, equations.system
    rest = np.concatenate((np.zeros(system.first), system.rest, np.zeros(layout.size)))[: layout.size]
    y = np.random.default_rng(seed).normal(size=2 * layout.half)
    y = np.append(y, np.zeros(layout.size - len(y)))
    slope = equations.derivative(0.0, (rest + 1e-30j * y)[:, None])[: 2 * layout.half, 0].imag / 1e-30
    assert stepped(system, y, at_rest=True) == pytest.approx(slope, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("seed", SEEDS)
def test_paired_links_are_the_matrices(seed: int) -> None:
    scene = geared(aired(motion_scene(seed), quadratic_drag=0.0), seed)
    system, known = system_of(scene), matrices(scene)
    first, said = system.first, Spoken(link_steps())
    x, z = np.random.default_rng(seed).normal(size=(2, system.n_links + first))
    products = np.zeros(3)
    if cart := system.cart:
        products += np.array([cart.mass, cart.stiffness, cart.damping]) * x[0] * z[0]
    for places, numbers in chains(system):
        pair, above = [x[0] * first, z[0] * first, 0.0, 0.0, 0.0], [0.0, 0.0]
        for place, constants in zip(places, numbers, strict=True):
            here = [x[first + place], z[first + place]]
            pair, above = said("paired", [constants[key] for key in LINK], [*here, *above], pair), here
        products += pair[2:]
    expected = [x @ matrix @ z for matrix in (known.M, known.K, known.D)]
    assert products == pytest.approx(expected, rel=1e-12, abs=1e-12)


def test_stored_energies_are_those_of_mechanics() -> None:
    equations = Minimal(system_of(motion_scene(3)), ())
    system, layout, said = equations.system, equations.layout, Spoken(link_steps())
    y, first = np.random.default_rng(3).normal(size=layout.size), layout.first
    q, v = y[: layout.half], y[layout.half : 2 * layout.half]
    known = Mechanics(system, equations.read(y[None]))
    for places, numbers in chains(system):
        stored, above = [v[0] * first, 0.0, 0.0, 0.0], 0.0
        for place, constants in zip(places, numbers, strict=True):
            state = [q[first + place], v[first + place], above]
            stored, above = said("stored", [constants[key] for key in LINK], state, stored), q[first + place]
        assert stored[2:] == pytest.approx([known.kinetic[0, places].sum(), known.potential[0, places].sum()])


def aired(scene: Scene, drag: float = 0.2, quadratic_drag: float = 0.1) -> Scene:
    pendula = (
        pendulum.replace(links=tuple(link.replace(drag=drag, quadratic_drag=quadratic_drag) for link in pendulum.links))
        for pendulum in scene.pendulum
    )
    return scene.replace(pendulum=tuple(pendula))
