"""The tour as a user's script: scenes, modes, coupling, motion, figures, models, orbits, fits and symbols.

`tests/site/test_types.py` checks it as a user would, with mypy and pyright at their strictest, and runs it.
"""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import modal
import nonlinear
from modal import Bob, Body, Cart, InitialCondition, Pendulum, Rod, Scene, SceneError, Spring, natural_modes
from modal.coupling import explain
from modal.loci import follow_loci
from modal.modes import sensitivities
from modal.scene import ConstantForce, ModalSupport, SineForce, parse_variations, whole_file
from modal.statespace import shaper_for, state_space
from nonlinear.orbits import mode_orbit
from nonlinear.postprocessing import reaction_forces_of
from nonlinear.reduction import start_in_mode


def scenes() -> list[Scene]:
    """Scenes made in Python: lists where a scene holds several."""
    links = [Bob(mass=1.0, length=2.0), Rod(mass=0.5, length=1.0, damping=0.01)]
    start = InitialCondition(angles_deg=[10.0, -5.0])
    chains = [Pendulum(links=links, count=2, start=start), Pendulum(links=[Bob(mass=1.0, length=1.0)])]
    cart = Scene(gravity=9.81, support=Cart(mass=3.0), pendulum=chains)
    upright = Pendulum(links=[Body(mass=1.0, length=0.5, centre=0.3, inertia=0.01, stiffness=40.0)], equilibrium=["up"])
    still = ConstantForce(on="pendulum[0].links[0]", amplitude=0.1)
    pushed = cart.replace(force=[SineForce(on="pendulum[0].links[0]", amplitude=0.1, frequency_hz=0.3), still])
    frame = ModalSupport(M=[[3.0]], K=[[16.0]], points=[[[1.0], [0.0]]])
    hung = Scene(
        gravity=9.81,
        support=[Cart(mass=2.0, name="a"), Cart(mass=2.0, name="b", stiffness=5.0)],
        pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0)], on=on) for on in ("a", "b")],
        spring=[Spring(between=["a", "b"], stiffness=3.0)],
        damping_ratio=[0.01, 0.02, 0.01, 0.0],
    )
    framed = Scene(gravity=9.81, support=frame, pendulum=[Pendulum(on="modal[0]", links=[Bob(mass=1.0, length=1.0)])])
    return [cart, Scene(gravity=9.81, pendulum=[upright]), pushed, hung, framed]


def tour(folder: Path) -> None:
    """Every stop of the tour; what is computed is asserted."""
    cart, *_ = scenes()
    modal.dump(cart, folder / "mine.toml")
    scene = modal.load(folder / "mine.toml")
    links: tuple[modal.Bob | Rod | Body, ...] = scene.pendulum[0].links
    assert scene == cart
    assert links[0].length == 2.0

    modes = natural_modes(scene)
    for mode in modes:
        print(mode.number, mode.omega, mode.multiplicity, mode.family)
    print(modes.table("markdown", modes[:3]), modes.shape(1, copy=0).angles, modal.matrices(scene).M)
    figure = modes.plot(range(1, 3), amplitude_deg=15.0)
    figure.savefig(folder / "shapes.svg")
    frequencies: float = float(modes.frequency[1:].max())
    assert 0.0 < frequencies < 2.0
    print(explain(scene), sensitivities(modes, 2))
    lighter = scene.replace(pendulum=[scene.pendulum[1].replace(count=3)])
    loci = follow_loci(lighter, parse_variations(["support.mass=1:10:3"])[0])
    loci.plot().savefig(folder / "loci.svg")

    run = nonlinear.simulate(scene, 1.0, output=11, report=lambda time: None)
    assert run.complete
    assert run.energy_drift() < 1e-6
    nonlinear.save(run, folder / "run.npz")
    print(nonlinear.load(folder / "run.npz").times, reaction_forces_of(run).normal.max())
    single = modal.load("chain-1")
    swing = nonlinear.state_at_rest(single, [20.0])
    passing = nonlinear.level_crossing(nonlinear.system_of(single), "theta[1,1]", direction=1)
    events = nonlinear.simulate(single, 3.0, start=swing, events=[passing], tolerance=1e-9).happenings
    print([event.time for event in events], start_in_mode(single, natural_modes(single), 0))

    orbit = mode_orbit(modal.load("chain-2"), 1, 0.2)
    print(orbit.period, shaper_for(modal.load("crane-hook"), 2, "zvd"), state_space(scene).A.shape)
    with whole_file(folder / "table.csv") as stream:
        stream.write(modes.table("csv").encode())
    try:
        Bob(mass=-1.0, length=np.pi)
    except SceneError as error:
        print(error.problems)


if __name__ == "__main__":
    with TemporaryDirectory() as place:
        tour(Path(place))
