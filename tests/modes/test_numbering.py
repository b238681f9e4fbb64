"""One number for every mode, that of the table, by routes that know nothing of how it is found."""

from __future__ import annotations

import json

import numpy as np
import pytest
from numpy.typing import NDArray

from modal import Bob, Cart, Pendulum, Scene, example_names, load, matrices, natural_modes
from modal.coupling import coupling_report, explain
from modal.loci import follow_loci, loci_csv, loci_text
from modal.modes import letters, table_numbers
from modal.scene.parameters import parse_variations
from modal.statespace import modal_gains, state_space
from nonlinear.sweeps import Study, parse_measures, sweep, sweep_text
from nonlinear.verification import check

STEPS = 400
DRIVEN = ("huygens", "metronomes", "clocks-double")


def pair(d: tuple[float, float], c: float, mass: float = 20.0) -> Scene:
    """Two bobs with joint dampers under a cart with one."""
    pendula = [Pendulum(links=[Bob(mass=1.0, length=1.0, damping=damping)]) for damping in d]
    return Scene(gravity=9.81, support=Cart(mass=mass, damping=c), pendulum=pendula)


SCENES = {
    **{name: load(name) for name in DRIVEN},
    "one joint": pair((0.3, 0.0), 0.0),
    "both": pair((0.2, 0.1), 5.0),
    "stiff cart": pair((0.1, 0.1), 300.0),
    "three": Scene(
        gravity=9.81,
        support=Cart(mass=3.0, damping=1.0),
        pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0, damping=0.05), Bob(mass=0.5, length=0.4)], count=3)],
    ),
}


def followed(scene: Scene) -> NDArray[np.complex128]:
    """The eigenvalues at which the undamped ones, in ascending order, arrive as the dampers are turned up slowly."""
    model = matrices(scene)
    n = len(model.M)
    inverse = np.linalg.inv(model.M)

    def upper(share: float) -> NDArray[np.complex128]:
        A = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ model.K, -share * inverse @ model.D]])
        return np.linalg.eigvals(A)

    values = np.sort_complex(1j * upper(0.0)[upper(0.0).imag > 1e-6].imag)
    for share in np.linspace(0.0, 1.0, STEPS)[1:]:
        there = upper(share)
        values = there[np.abs(there[None] - values[:, None]).argmin(axis=1)]
    return values


@pytest.mark.parametrize("name", SCENES)
def test_a_mode_keeps_its_number_as_its_dampers_are_turned_up(name: str) -> None:
    scene = SCENES[name]
    still, table, numbers = natural_modes(scene.conservative), natural_modes(scene), table_numbers(scene)
    swinging = np.flatnonzero(still.omega)
    assert len(set(numbers[swinging])) == len(swinging)
    arrived = np.split(followed(scene), np.cumsum(still.multiplicity[swinging])[:-1])
    for row, values in zip(swinging, arrived, strict=True):
        at = table.eigenvalue[numbers[row] - 1]
        assert np.abs(values - at).min() < 1e-6 * abs(at)


@pytest.mark.parametrize("name", example_names())
def test_without_dampers_the_numbers_are_the_tables(name: str) -> None:
    scene = load(name).conservative
    if scene.n_links <= 100:
        assert table_numbers(scene).tolist() == [mode.number for mode in natural_modes(scene)]


@pytest.mark.parametrize("name", ["paper-cart-2", "paper-cart-3", "crane-two-loads", "chain-2", *DRIVEN])
def test_maps_have_the_tables_numbers(name: str) -> None:
    scene = load(name)
    study = Study(scene, parse_variations([f"gravity={scene.gravity}"]), parse_measures(["frequencies:9", "damping:9"]))
    swept, modes = sweep(study, workers=1), natural_modes(scene)
    for column in swept.columns:
        kind, number = ("omega", 1) if column.startswith("omega") else ("damping_ratio", 2)
        mode = modes[int(column.split("_")[number].rstrip("bcdef")) - 1]
        assert mode.oscillates
        assert swept.values(column)[0] == pytest.approx(getattr(mode, kind), rel=1e-14, abs=1e-14)
    assert "Modes are numbered as in the table" in sweep_text(swept)


def test_numbers_stay_where_dampers_appear_and_frequencies_meet() -> None:
    """A free cart's damper adds a mode that creeps, number 2; a third equal bob shares the row of the first two."""
    study = Study(
        load("huygens"),
        parse_variations(["support.damping=0,1"]),
        parse_measures(["frequencies", "beat", "splitting:3"]),
    )
    swept = sweep(study, workers=1)
    assert swept.columns == ("omega_3_rad_per_s", "omega_4_rad_per_s", "beat_3_s", "splitting_3_rad_per_s")
    assert np.isfinite([swept.values(column) for column in swept.columns]).all()
    bobs = [Pendulum(links=[Bob(mass=1.0, length=l)]) for l in (1.0, 1.1, 1.2)]
    three = Scene(gravity=9.81, support=Cart(mass=5.0), pendulum=bobs)
    asking = Study(three, parse_variations(["pendulum[*].links[0].length=1,1.1"]), parse_measures(["frequencies"]))
    merged = sweep(asking, workers=1)
    assert merged.columns == ("omega_2_rad_per_s", "omega_3_rad_per_s", "omega_4_rad_per_s")
    assert merged.values("omega_2_rad_per_s").tolist() == merged.values("omega_3_rad_per_s").tolist()


def test_copies_have_letters() -> None:
    columns = parse_measures(["damping:9"])[0].of(load("paper-cart-3"))
    assert list(columns) == [f"damping_ratio_{name}" for name in ("2", "2b", "3", "4", "4b", "5")]
    assert [letters(k) for k in (0, 25, 26, 27, 701, 702)] == ["a", "z", "aa", "ab", "zz", "aaa"]


def test_loci_have_the_numbers_of_the_table_at_the_scenes_own_value() -> None:
    """Light and long cross short and heavy, so that at the first value the order is another."""
    long, short = (Pendulum(links=[Bob(mass=1.0, length=l)]) for l in (3.0, 1.0))
    scene = Scene(gravity=9.81, pendulum=[long, short])
    (variation,) = parse_variations(["pendulum[0].links[0].length=0.5:4:8"])
    loci, table = follow_loci(scene, variation), natural_modes(scene)
    assert loci.numbered_at == 3.0
    assert loci.names == ("2", "1")
    here = loci.values.tolist().index(3.0)
    for k, name in enumerate(loci.names):
        assert loci.omega[here, k] == pytest.approx(table.omega[int(name) - 1], rel=1e-14)
    assert "crossing  2 · 1" in loci_text(loci)
    assert "numbered as in the table at 3 m" in loci_text(loci)
    assert loci_csv(loci).startswith("pendulum[0].links[0].length_m,omega_2_rad_per_s,omega_1_rad_per_s\n")
    outside = follow_loci(scene, parse_variations(["pendulum[0].links[0].length=0.5:0.9:3"])[0])
    assert (outside.numbered_at, outside.names) == (0.5, ("1", "2"))


@pytest.mark.parametrize("name", ["paper-cart-2", "paper-cart-3", "crane-two-loads", "chain-2", *DRIVEN])
def test_the_page_that_explains_has_the_tables_numbers(name: str) -> None:
    scene = load(name)
    told, table = json.loads(coupling_report(explain(scene), "json")), natural_modes(scene)
    listed = [*told["cart_modes"], *told["damping"]]
    assert len(listed) >= 2
    for row in listed:
        mode = table[row["mode"] - 1]
        omega = row.get("exact_omega_rad_per_s") or row["omega_rad_per_s"]
        assert mode.omega == pytest.approx(omega, rel=1e-3 if name in DRIVEN else 1e-12)
        assert mode.oscillates
    for mode in told["cart_modes"]:
        assert "cart moves" in table[mode["mode"] - 1].family
    for number, family in enumerate(told["families"]):
        assert family["family"] == "ABCDEFGH"[number]
        if still := family["mode_cart_still"]:
            assert "cart still" in table[still - 1].family
    text = coupling_report(explain(scene), words=True)
    assert f"(mode {told['cart_modes'][0]['mode']})" in text if told["cart_modes"] else "(mode 1)" in text
    assert "Family A" in text
    assert "Family 1" not in text


def test_checks_and_gains_have_the_tables_numbers() -> None:
    scene = load("huygens")
    assert [row.mode.number for row in check(scene, [2], (3.0,), periods=20).rows] == [3]
    modes = natural_modes(scene)
    pushed = modal_gains(modes, state_space(scene, ("cart_force",)))
    assert pushed.text().split()[0] == "mode"
    assert [record["mode"] for record in pushed.records()][:4] == [1, 2, 3, 4]
    moved = modal_gains(modes, state_space(scene, ("cart_acceleration",)))
    assert moved.text().startswith("fixed-base mode")
    assert moved.modes.omega[0] == pytest.approx(8.37086785, rel=1e-8)
