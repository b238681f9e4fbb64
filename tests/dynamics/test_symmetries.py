"""Scenes that move as a smaller one does: the same motion, and nothing of what is not needed."""

from __future__ import annotations

import numpy as np
import pytest
from amounts import usually
from scenes import motion_scene

from modal.scene import Bob, Cart, InitialCondition, Pendulum, Scene
from nonlinear import AppliedForces, State, level_crossing, load, resume, save, simulate, state_at_rest
from nonlinear.dynamics import find_symmetries
from nonlinear.integration import Choice, equations_of
from nonlinear.postprocessing import reaction_forces_of
from nonlinear.system import initial_state, system_of


def doubled(seed: int) -> Scene:
    """A random scene whose pendula, with their starts, hang there twice, thrice and four times."""
    scene = motion_scene(seed)
    again = [pendulum.model_copy(update={"count": 2 + at % 3}) for at, pendulum in enumerate(scene.pendulum)]
    return scene.model_copy(update={"pendulum": (*again, scene.pendulum[0])})


@pytest.mark.parametrize("seed", usually([0, 2], range(5)))
def test_pendula_that_start_equally_move_as_one(seed: int) -> None:
    scene, duration = doubled(seed), usually(1.5, 3.0)
    run = simulate(scene, duration, tolerance=1e-12, output=31)
    system = system_of(scene)
    whole = simulate(scene, duration, tolerance=1e-12, output=31, load=lambda time, state: AppliedForces())
    assert run.run.reduced == f"{len(scene.pendulum) - 1} of {system.n_pendula} pendula, the others moving with them"
    assert whole.run.reduced == ""
    assert np.abs(run.motion.links - whole.motion.links).max() < 1e-8
    assert np.abs(run.motion.cart - whole.motion.cart).max() < 1e-8
    assert run.energy_drift() < 1e-9


@pytest.mark.parametrize("seed", range(5))
def test_the_smaller_equations_are_the_whole_ones(seed: int) -> None:
    scene = doubled(seed)
    system, start = system_of(scene), initial_state(scene)
    (symmetry,) = find_symmetries(system, start)
    choice = Choice("minimal", "", compiled=False, reason="")
    small, whole = equations_of(symmetry.system, choice), equations_of(system, choice)
    rate = symmetry.extend(small.read(small.derivative(0.0, small.begin(symmetry.restrict(start)))[None]))
    sure = whole.read(whole.derivative(0.0, whole.begin(start))[None])
    for name in ("links", "link_rates", "cart", "cart_rate", "work"):
        expected = getattr(sure, name)
        assert np.allclose(getattr(rate, name), expected, rtol=1e-11, atol=1e-11 * (1 + np.abs(expected).max())), name


def test_a_thousand_equal_pendula_are_integrated_as_one() -> None:
    pendulum = Pendulum(links=(Bob(mass=1.0, length=1.0), Bob(mass=0.5, length=0.7)), count=1000)
    scene = Scene(gravity=9.81, support=Cart(mass=100.0), pendulum=(pendulum,))
    run = simulate(scene, 5.0, start=state_at_rest(scene, [60.0, -20.0]), output=11)
    assert run.motion.links.shape == (11, 2000)
    assert run.equations is not None
    assert len(run.equations.begin(run.final)) == 2 * 3
    apart = state_at_rest(scene, [60.0, -20.0])
    apart.links[1] += 1e-3
    (symmetry,) = find_symmetries(system_of(scene), apart)
    assert symmetry.system.n_pendula == 2


def test_pendula_that_differ_or_start_elsewhere_stay_apart() -> None:
    bobs = [Pendulum(links=(Bob(mass=1.0, length=length),)) for length in (1.0, np.nextafter(1.0, 2.0))]
    scene = Scene(gravity=9.81, pendulum=tuple(bobs))
    assert find_symmetries(system_of(scene), state_at_rest(scene, [10.0, 10.0])) == ()
    scene = Scene(gravity=9.81, pendulum=(bobs[0], bobs[0]))
    assert find_symmetries(system_of(scene), state_at_rest(scene, [10.0, -10.0])) == ()
    assert len(find_symmetries(system_of(scene), state_at_rest(scene, [10.0, 10.0]))) == 1


def spatial(scene: Scene, azimuth: float) -> Scene:
    pendula = []
    for pendulum in scene.pendulum:
        assert pendulum.start
        start = InitialCondition(
            angles_deg=pendulum.start.angles_deg,
            rates_deg=pendulum.start.rates_deg,
            azimuths_deg=(azimuth,) * pendulum.n_links,
        )
        pendula.append(pendulum.model_copy(update={"start": start}))
    return scene.model_copy(update={"space": "space", "pendulum": tuple(pendula)})


@pytest.mark.parametrize("seed", usually(range(3), range(6)))
def test_a_start_in_the_plane_of_the_rail_is_integrated_there(seed: int) -> None:
    scene = spatial(motion_scene(seed, sprung=False), 0.0)
    run = simulate(scene, 1.0, tolerance=1e-12, output=11)
    whole = simulate(scene, 1.0, tolerance=1e-12, output=11, form="spatial")
    assert (run.run.form, run.run.reduced) == ("minimal", "one vertical plane of space")
    assert (whole.run.form, whole.run.reduced) == ("spatial", "")
    assert np.abs(run.motion.links - whole.motion.links).max() < 1e-8
    assert np.abs(run.motion.link_rates - whole.motion.link_rates).max() < 1e-7
    assert run.energy_drift() < 1e-9
    forces, sure = reaction_forces_of(run), reaction_forces_of(whole)
    assert np.allclose(forces.pivots, sure.pivots, rtol=1e-5, atol=1e-6 * np.abs(sure.pivots).max())


def test_joint_springs_in_space_and_azimuths_keep_it_spatial() -> None:
    sprung = spatial(motion_scene(1), 0.0)
    sprung = sprung.model_copy(
        update={
            "pendulum": (
                sprung.pendulum[0].model_copy(
                    update={
                        "links": (Bob(mass=1, length=1, stiffness=3.0),),
                        "start": InitialCondition(angles_deg=(9.0,)),
                    }
                ),
            )
        }
    )
    aside = spatial(motion_scene(0, sprung=False), 30.0)
    for scene in (sprung, aside):
        assert find_symmetries(system_of(scene), initial_state(scene)) == ()


def test_a_reduced_run_is_kept_and_gone_on_from(tmp_path) -> None:  # type: ignore[no-untyped-def]
    scene = spatial(motion_scene(2, sprung=False), 0.0)
    first = simulate(scene, 1.0, output=11)
    save(first, tmp_path / "run.npz")
    again = load(tmp_path / "run.npz")
    assert again.run == first.run
    both = [resume(run, 1.0, output=11) for run in (first, again)]
    assert np.array_equal(*(run.motion.links for run in both))
    assert both[0].run.reduced == first.run.reduced
    straight = simulate(scene, 2.0, output=[2.0])
    assert np.abs(both[0].final.links - straight.final.links).max() < 1e-6


def test_events_and_loads_see_the_whole_scene() -> None:
    scene = Scene(
        gravity=9.81,
        pendulum=(Pendulum(links=(Bob(mass=1.0, length=1.0),), count=3, start=InitialCondition(angles_deg=(10.0,))),),
    )
    seen = set()

    def load_of(time: float, state: State) -> AppliedForces:
        seen.add(len(state.links))
        return AppliedForces()

    assert simulate(scene, 0.1, load=load_of).run.reduced == ""
    assert seen == {3}
    run = simulate(scene, 3.0, events=[level_crossing(system_of(scene), "theta[3,1]")])
    assert run.run.reduced
    assert len(run.happenings) == 3
