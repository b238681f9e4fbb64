"""Members against individual runs, and the numbers and equations of members against those of their scenes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from amounts import usually
from scenes import plane_scene
from support.scenes import complex_step

from modal import load
from modal.errors import SceneError
from modal.scene import Bob, Cart, Fixed, InitialCondition, Pendulum, Rod, Scene, VanDerPol, refusals
from modal.scene.parameters import find_places, number_at, number_paths, vary
from nonlinear import simulate, system_of
from nonlinear.dynamics import Generated, Lanes, Minimal, Recursion
from nonlinear.ensembles import computing, ensemble, members_of
from nonlinear.ensembles.energies import Accounts
from nonlinear.ensembles.question import refused
from nonlinear.integration.switches import numbers_of as switching_of
from nonlinear.system import State, apart, initial_state, numbers_of

VARIED = {"gravity": (9.0, 11.0), "pendulum[0].links[0].mass": (0.5, 1.5), "pendulum[0].links[0].length": (0.7, 1.3)}


def drawn(scene: Scene, seed: int, size: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    return {path: rng.uniform(*ends, size) for path, ends in VARIED.items()}


def driven_scene(seed: int) -> Scene:
    """Pendula of one or two links with dampers, springs and van der Pol drives, on a support of any kind."""
    rng = np.random.default_rng(seed)

    def link(top: bool) -> Bob | Rod:
        mass, length, damping, stiffness = rng.uniform(0.2, 1.5, 4)
        drive = VanDerPol(strength=rng.uniform(0.05, 0.3), angle_deg=rng.uniform(10, 60)) if top else None
        numbers = {"mass": mass, "length": length, "damping": 0.1 * damping * rng.integers(2)}
        numbers["stiffness"] = stiffness * rng.integers(2)
        return (Bob, Rod)[rng.integers(2)](**numbers, drive=drive)

    pendula = [
        Pendulum(links=[link(k == 0) for k in range(rng.integers(1, 3))], count=int(rng.integers(1, 3)))
        for _ in range(rng.integers(1, 3))
    ]
    cart = Cart(mass=rng.uniform(0.5, 5), damping=float(rng.integers(2)), stiffness=3.0 * rng.integers(2))
    return Scene(gravity=9.81, support=cart if seed % 3 else Fixed(), pendulum=pendula)


def test_equations_of_members_are_those_of_their_scenes() -> None:
    """Written out and by the recursion, with numbers that differ and that do not."""
    for seed in range(30):
        scene = plane_scene(seed) if seed % 2 else driven_scene(seed)
        values, size = drawn(scene, seed, 3), 3
        system = system_of(scene)
        members = members_of(scene, None, values) if all(p.start for p in scene.pendulum) else None
        assert members is None or members.size == size
        at = {("gravity",): values["gravity"]}
        at |= {("pendulum", 0, "links", 0, name): values[f"pendulum[0].links[0].{name}"] for name in ("mass", "length")}
        numbers = numbers_of(scene, at, system)
        equations = Lanes(numbers)
        y = np.random.default_rng(seed).standard_normal((equations.size, size))
        written = np.array(np.broadcast_arrays(*equations.rates(numbers)(y)))
        recursion = Minimal(
            numbers.arrays,
            tuple(Recursion(group) for group in numbers.arrays.groups),
            counts_work=equations.layout.works,
        )
        np.testing.assert_allclose(written, recursion.derivative(0.0, y), rtol=1e-10, atol=1e-10)
        for k in range(size):
            member = vary(scene, {path: float(column[k]) for path, column in values.items()})
            np.testing.assert_allclose(
                written[:, k], Generated(system_of(member)).derivative(0.0, y[:, k]), rtol=1e-10, atol=1e-10
            )


def test_tangent_equations_are_those_of_the_complex_step() -> None:
    for seed in range(20):
        scene = plane_scene(seed) if seed % 2 else driven_scene(seed)
        numbers = numbers_of(scene)
        equations, other = Lanes(numbers, tangent=True), system_of(scene)
        both = np.random.default_rng(seed).standard_normal((equations.size, 4))
        y, v = np.split(both, 2)
        tangent = np.array(np.broadcast_arrays(*equations.rates(numbers)(both)))
        np.testing.assert_allclose(tangent, np.concatenate(complex_step(other, y, v)), rtol=1e-9, atol=1e-9)


def test_energies_of_members_are_those_of_runs() -> None:
    for seed in range(10):
        scene = driven_scene(seed)
        run = simulate(scene, 0.2, start=random_state(scene, seed), output=5)
        numbers = numbers_of(scene)
        layout = Lanes(numbers).layout
        rows = np.stack([layout.begin(run.motion[k]) for k in range(5)], axis=1)
        energies = Accounts(numbers, layout).energies(rows)
        np.testing.assert_allclose(energies.total, run.mechanics.energy, rtol=1e-12, atol=1e-12)
        each = run.mechanics.of_pendula(run.mechanics.kinetic + run.mechanics.potential)
        np.testing.assert_allclose((energies.kinetic + energies.potential).T, each, rtol=1e-12, atol=1e-12)


def random_state(scene: Scene, seed: int) -> State:
    system = system_of(scene)
    rng = np.random.default_rng(seed)
    links = system.rest + rng.uniform(-1, 1, system.n_links)
    cart = rng.uniform(-1, 1, 2) if system.cart else (0.0, 0.0)
    return State(links, rng.uniform(-1, 1, system.n_links), *map(float, cart))


@pytest.mark.parametrize("first", usually([0], range(0, 200, 25)))
def test_members_agree_with_runs_by_themselves(first: int) -> None:
    """Random scenes of all kinds, 200 in all: carts, unequal pendula, joint springs and dampers, drives."""
    for seed in range(first, first + 25):
        scene = plane_scene(seed) if seed % 4 == 0 else driven_scene(seed)
        states = [random_state(scene, seed + k) for k in range(2)]
        runs = ensemble(scene, 0.4, starts=states, engine="numpy", workers=1, check=0)
        run = simulate(scene, 0.4, start=states[1], method="DOP853", output=2)
        assert apart(runs.final.at([1]), run.motion.at([-1]))[0] < 1e-9
        assert runs.energy_drift.max() < 1e-6


def test_members_with_other_numbers_agree_with_runs_of_those_scenes() -> None:
    scene = load("paper-cart-2")
    values = {"support.mass": [3.0, 50.0], "pendulum[0].links[0].length": [0.5, 1.5], "support.damping": [0.0, 2.0]}
    runs = ensemble(scene, 2.0, vary=values, engine="numpy", workers=1)
    assert runs.largest_difference < 1e-9
    for k in range(2):
        run = simulate(vary(scene, {path: column[k] for path, column in values.items()}), 2.0, output=2)
        assert apart(runs.final.at([k]), run.motion.at([-1]))[0] < 1e-9


def test_a_grid_of_starts_goes_the_last_place_fastest() -> None:
    scene = load("chain-2").replace(
        pendulum=[load("chain-2").pendulum[0].replace(start=InitialCondition(angles_deg=(0.0, 0.0)))]
    )
    places = [f"pendulum[0].start.angles_deg[{k}]" for k in range(2)]
    runs = ensemble(scene, 1e-6, vary=[f"{places[0]}=-10:10:3", f"{places[1]}=0:30:4"], workers=1, check=0)
    angles = np.degrees(runs.grid("links_rad"))
    assert angles.shape == (3, 4, 2)
    np.testing.assert_allclose(angles[2, 3], [10.0, 30.0], atol=1e-6)
    np.testing.assert_allclose(angles[0, 1], [-10.0, 10.0], atol=1e-6)


def test_a_member_that_cannot_be_has_its_reason_and_the_others_go_on() -> None:
    scene = load("chain-2")
    values = {"pendulum[0].links[0].mass": [1.0, -1.0, 2.0]}
    start = scene.replace(pendulum=[scene.pendulum[0].replace(start=InitialCondition(angles_deg=(20.0, 0.0)))])
    runs = ensemble(start, 0.5, vary=values, workers=1, check=0)
    assert list(runs.failures) == [1]
    assert "mass = -1.0: must be" in runs.failures[1]
    assert np.isfinite(runs.column("links_rad")[[0, 2]]).all()
    assert np.isnan(runs.column("links_rad")[1]).all()


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({}, "give starts"),
        ({"starts": [[0.1]]}, "must be an array"),
        ({"starts": [[0.1, np.nan]]}, "must be finite"),
        ({"starts": [[0.1, 0.2]], "measures": ["flips"]}, "no such measure"),
        ({"starts": [[0.1, 0.2]], "measures": ["section:phi=0"]}, "must be section:"),
        ({"starts": [[0.1, 0.2]], "tolerance": 1.0}, "tolerance"),
        ({"starts": [[0.1, 0.2]], "output": "all"}, "must be"),
        ({"starts": [[0.1, 0.2]], "engine": "cuda"}, "engine cuda"),
        ({"vary": {"gravity": [1.0], "pendulum[0].links[0].mass": [1.0, 2.0]}}, "as many values"),
    ],
)
def test_what_cannot_be_is_told(more: dict, words: str) -> None:
    with pytest.raises(SceneError, match=words):
        ensemble(load("chain-2"), 1.0, **more)


WRONG = {
    "check": [-1, 1.5, np.nan, "2", None, True, [1]],
    "chunk": [np.nan, 0, 1.5, "3", -1, True, np.inf, [2]],
    "share": [(0.5, 2), (0, 0), (2, 2), (0,), (0, 1, 2), 5, "ab", (0, np.nan), (None, 2), (True, 2), (-1, 2)],
    "workers": [0, -1, 1.5, np.nan, "2", True],
    "folder": [5, 1.5, ""],
    "measures": ["largest_angle", 5, [5], [None]],
    "vary": [5, [5], {"gravity": "a"}, {5: [1]}, {"gravity": [[1, 2], [3]]}],
    "starts": [5, "a", [[1, "b"]], [], {}],
}


@pytest.mark.parametrize(("name", "value"), [(name, value) for name, values in WRONG.items() for value in values])
def test_a_wrong_argument_is_named_with_its_value(name: str, value: object) -> None:
    options = {"starts": [[0.1, 0.2]], "workers": 1} if name not in {"vary", "starts"} else {"workers": 1}
    with pytest.raises(SceneError, match=f"^{name}") as told:
        ensemble(load("chain-2"), 1.0, **options | {name: value})  # type: ignore[arg-type]
    assert name in {"vary", "starts"} or repr(value) in str(told.value)


def test_all_wrong_arguments_are_named_at_once() -> None:
    with pytest.raises(SceneError) as told:
        ensemble(load("chain-2"), 1.0, starts=[[0.1, 0.2]], check=-1, chunk=0, share=(2, 1), workers=-3)
    assert [problem.split()[0] for problem in told.value.problems] == ["check", "chunk", "workers", "share"]


KINDS = Path(__file__).parents[1] / "combinations" / "scenes"
SPREAD_AND_DRIVEN = {"metronomes", "two-swings", "ship-crane"}


def second_of(entries: tuple) -> np.ndarray:
    return np.array([entry[1] if isinstance(entry, np.ndarray) else entry for entry in entries], dtype=float)


def test_every_number_of_every_kind_of_scene_is_that_of_its_member() -> None:
    """What engines are given, numbers and states, against those of the scene of the member alone."""
    tried, scenes = 0, [load(str(path)) for path in sorted(KINDS.glob("*.toml"))]
    scenes += map(load, sorted(SPREAD_AND_DRIVEN))
    for scene in [scene for scene in scenes if not refusals(scene, "an ensemble")]:
        for path in number_paths(scene):
            value = number_at(scene, find_places(scene, path)[0])
            other = 1.01 * value or 0.01
            try:
                members = members_of(scene, None, {path: [value, other]})
                member = members.part(0, 2).scene_of(1)
            except SceneError:  # a number that has one value alone, a scene without a start
                continue
            if path.endswith("count") or refused(members, 1.0, 1e-9):
                continue
            places = {place: np.ones(1) for place in find_places(scene, path) if "start" not in place}
            layout = Lanes(numbers_of(scene, places, system_of(scene))).layout
            block, alone = members.part(0, 2).block(layout), numbers_of(member)
            np.testing.assert_allclose(second_of(block.numbers.entries), alone.entries, rtol=1e-14, err_msg=path)
            np.testing.assert_allclose(second_of(block.numbers.constants), alone.constants, rtol=1e-12, err_msg=path)
            if block.numbers.switching:
                switching = switching_of(system_of(member))
                np.testing.assert_allclose(second_of(block.numbers.switching), switching, rtol=1e-14, err_msg=path)
            begun = layout.begin(initial_state(member))
            np.testing.assert_allclose(block.y[:, 1], begun, rtol=1e-14, atol=1e-300, err_msg=path)
            tried += 1
    assert tried > 300


def clock() -> Scene:
    drive = VanDerPol(strength=0.2, angle_deg=8.0)
    links = (Bob(mass=1.0, length=1.0, damping=0.01, drive=drive),)
    return Scene(gravity=9.81, pendulum=(Pendulum(links=links, start=InitialCondition(angles_deg=(15.0,))),))


def test_the_angle_of_a_van_der_pol_drive_is_that_of_each_member() -> None:
    varied = {"pendulum[0].links[0].drive.angle_deg": [8.0, 10.0, 12.0, 20.0]}
    runs = ensemble(clock(), 20.0, vary=varied, engine="numpy", workers=1, output=[20.0], check=4)
    angles = np.degrees(runs.column("links_rad")[:, -1, 0])
    np.testing.assert_allclose(angles, [13.758617, 16.245590, 17.952965, 15.648501], atol=1e-6)
    assert not runs.failures
    assert runs.largest_difference < 1e-9


def test_a_member_that_disagrees_with_its_run_fails_by_name(monkeypatch: pytest.MonkeyPatch) -> None:
    """Which is what a wrong number among those of members looks like: a thousandth more gravity for one of them."""
    engine = computing.engine_of("numpy")

    def wrong(numbers, y, wanted):
        gravity = numbers.entries[0] * np.array([1.0, 1.001, 1.0])
        return engine(type(numbers)(numbers.system, (gravity, *numbers.entries[1:])), y, wanted)

    options = {"vary": {"gravity": [9.0, 9.5, 10.0]}, "engine": "numpy", "workers": 1, "check": 3}
    assert not ensemble(load("chain-2").replace(pendulum=clock().pendulum), 5.0, **options).failures
    monkeypatch.setattr(computing, "engine_of", lambda name: wrong)
    runs = ensemble(load("chain-2").replace(pendulum=clock().pendulum), 5.0, **options)
    assert list(runs.failures) == [1]
    assert "a run of it alone ends" in runs.failures[1]
    assert np.isnan(runs.final.links[:, 0]).tolist() == [False, True, False]
    assert "warning: member 1:" in runs.words()


def test_members_on_a_damped_massless_cart_end_with_the_reason_of_a_run_by_itself() -> None:
    pendulum = Pendulum(links=(Bob(mass=1.9, length=0.33),), start=InitialCondition(angles_deg=(0.5,)))
    scene = Scene(gravity=9.81, support=Cart(mass=0.0, damping=0.27), pendulum=(pendulum,))
    runs = ensemble(scene, 1.0, vary={"support.damping": [0.27, 0.3]}, workers=1)
    assert runs.engine == "simulate"
    assert all("give it a mass" in reason for reason in runs.failures.values())
    assert len(runs.failures) == 2
