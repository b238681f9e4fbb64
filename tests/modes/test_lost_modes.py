"""Every state has its mode: free motions that dampers drag, balanced boards, dampers to the ground."""

from __future__ import annotations

import random
from itertools import pairwise

import numpy as np
import pytest

from modal.assembly import matrices
from modal.eigen import spectrum
from modal.errors import ComputationError
from modal.modes import natural_modes
from modal.scene import Bob, Cart, Heave, Pendulum, Scene, Spring, Swing, Tilt, load
from modal.statespace import minimal, modal_gains, state_space, truncate


def loose_support(rng: random.Random, name: str) -> Cart | Tilt | Heave | Swing:
    """A support that often has no spring, a damper or neither."""
    mass, stiffness, damping = rng.uniform(0.5, 3), rng.choice([0, 0, 5.0]), rng.choice([0, 0, 2.0])
    kind = rng.choice(["cart", "cart", "swing", "tilt", "heave"])
    if kind == "cart":
        return Cart(name=name, mass=mass, stiffness=stiffness, damping=damping)
    if kind == "tilt":
        centre = (0.0, rng.choice([0.0, 0.0, 0.2]))
        return Tilt(name=name, mass=mass, inertia=0.5, centre=centre, stiffness=stiffness, damping=damping)
    if kind == "heave":
        return Heave(name=name, mass=mass, stiffness=stiffness or 3.0, damping=damping)
    return Swing(name=name, mass=mass, length=rng.uniform(0.5, 2), damping=damping)


def loose_scene(seed: int) -> Scene:
    """Up to three supports, some joined, some dragged by dampers alone; pendula balance boards without a spring."""
    rng = random.Random(seed)
    supports = [loose_support(rng, name) for name in "abc"[: rng.choice([1, 2, 3])]]
    pendula = []
    for support in supports:
        if support.kind == "tilt" and not support.stiffness and support.centre == (0.0, 0.0):
            bob = Bob(mass=0.3, length=0.7)
            pendula += [Pendulum(on=support.name, position=(x, 0.0), links=(bob,)) for x in (-0.5, 0.5)]
            continue
        links = [
            Bob(mass=rng.uniform(0.1, 1), length=rng.uniform(0.3, 1), damping=rng.choice([0, 0, 0.05]))
            for _ in range(rng.choice([1, 2]))
        ]
        pendula.append(Pendulum(on=support.name, count=rng.choice([1, 2]), links=tuple(links)))
    springs = [
        Spring(between=(first.name, second.name), stiffness=rng.choice([0, 4.0]), damping=rng.choice([0, 0.7]))
        for first, second in pairwise(supports)
        if rng.random() < 0.4
    ]
    if rng.random() < 0.4:
        springs.append(Spring(between=("ground@0.3,0.4", f"{supports[0].name}@0.1,0.2"), damping=0.5))
    support = tuple(supports) if len(supports) > 1 else supports[0]
    return Scene(gravity=9.81, support=support, pendulum=tuple(pendula), spring=tuple(springs))


def test_all_roots_of_the_state_matrix_are_those_of_modes() -> None:
    """But 0, of which dense matrices know no digit; and models of these scenes are reduced."""
    for seed in range(40):
        scene = loose_scene(seed)
        modes, dense = natural_modes(scene), matrices(scene)
        inverse, none = np.linalg.inv(dense.M), np.zeros_like(dense.M)
        A = np.block([[none, np.eye(len(none))], [-inverse @ dense.K, -inverse @ dense.D]])
        expected = [root for root in np.linalg.eigvals(A) if abs(root) > 1e-4]
        roots = [
            root
            for value, fold in zip(modes.eigenvalue, modes.multiplicity, strict=True)
            for root in ([value, np.conj(value)] if value.imag else [value]) * fold
            if abs(root) > 1e-4
        ]
        assert len(roots) == len(expected)
        assert max(min(abs(root - other) / abs(root) for other in roots) for root in expected) < 1e-4
        model = state_space(scene)
        modal_gains(modes, model)
        minimal(scene)
        truncate(modes, model, 1)


def test_a_lone_cart_with_a_damper_has_its_decay() -> None:
    scene = Scene(
        gravity=9.81,
        support=(Cart(name="lone", mass=2.0, damping=6.0), Cart(name="held", mass=1.0, stiffness=30.0)),
        pendulum=(Pendulum(on="held", links=(Bob(mass=1.0, length=1.0),)),),
    )
    modes = natural_modes(scene)
    assert modes.eigenvalue[2] == pytest.approx(-3.0, rel=1e-14)
    assert modes.family.tolist()[:3] == [
        "lone moves: free",
        "held moves: pendulum in phase with the support",
        "lone moves: overdamped",
    ]


def test_two_free_translations_have_a_row_each() -> None:
    scene = Scene(
        gravity=9.81,
        support=(Cart(name="a", mass=3.0), Cart(name="b", mass=6.0)),
        pendulum=[Pendulum(on=name, links=[Bob(mass=0.5, length=1.5)]) for name in "ab"],
    )
    assert natural_modes(scene).family.tolist()[:2] == ["a moves: free", "b moves: free"]


def test_modes_are_compared_with_states(monkeypatch: pytest.MonkeyPatch) -> None:
    batches = spectrum.batches
    monkeypatch.setattr(spectrum, "batches", lambda *arguments: list(batches(*arguments))[1:])
    with pytest.raises(ComputationError, match="the modes found have 6 of the 10 states of this scene"):
        natural_modes(load("paper-cart-2")).omega  # noqa: B018
