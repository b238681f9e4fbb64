"""Where the energy of a mode is: by motions of masses over a cycle, by differences of frequencies, and as it prints."""

import csv
import json
from io import StringIO

import numpy as np
import pytest
import scipy.linalg

from modal import Bob, Cart, ComputationError, Pendulum, Platform, Rod, Scene, Spring, load, natural_modes
from modal.assembly import matrices
from modal.modes import UNCERTAIN, ModeEnergies, mode_energies
from modal.modes.tables import table
from modal.scene import ConstantForce, Fixed, ModalSupport
from modal.scene.parameters import find_places, number_at, vary
from modal.scene.supports import Planar

G = 9.81
LINKS = [Bob(mass=2.0, length=0.7, damping=0.3), Bob(mass=0.5, length=1.1, stiffness=4.0, damping=0.8, drag=0.2)]
TROLLEY = Scene(
    gravity=G, support=Cart(mass=3.0, damping=0.5, stiffness=20.0), pendulum=[Pendulum(links=LINKS)], title="trolley"
)
SHIP = Scene(
    gravity=G,
    support=Platform(
        mass=40.0,
        inertia=30.0,
        centre=(0.0, 0.4),
        stiffness=Planar(sway=300.0, heave=4e3, roll=900.0),
        damping=Planar(sway=9.0, heave=20.0, roll=4.0),
    ),
    pendulum=[
        Pendulum(position=(1.5, -0.5), links=[Bob(mass=6.0, length=1.0, damping=0.4)]),
        Pendulum(position=(-1.0, 0.2), links=[Rod(mass=3.0, length=1.4, stiffness=5.0), Bob(mass=1.0, length=0.5)]),
    ],
    spring=[Spring(between=("pendulum[0].links[0]", "pendulum[1].links[0]"), stiffness=15.0, damping=0.7)],
)
STANDING = [Bob(mass=1.0, length=1.0, stiffness=60.0), Bob(mass=0.5, length=1.0, stiffness=20.0)]
LEANING = load("chain-3").replace(force=[ConstantForce(on="pendulum[0].links[0]", amplitude=4.0)])
SCENES = {
    "trolley": TROLLEY,
    "ship": SHIP,
    "standing": Scene(gravity=G, pendulum=[Pendulum(links=STANDING, equilibrium=["up", "up"])]),
    "falling": Scene(
        gravity=30.0, support=Cart(mass=2.0), pendulum=[Pendulum(links=STANDING, equilibrium=["up", "up"])]
    ),
    "leaning": LEANING,
    "space": Scene(
        gravity=G, space="space", support=Cart(mass=3.0, damping=1.0), pendulum=[Pendulum(links=LINKS, count=2)]
    ),
    "ratios": TROLLEY.replace(damping_ratio=[0.02, 0.1]),
    "lossy": TROLLEY.replace(
        pendulum=[Pendulum(links=[Bob(mass=2.0, length=1.0, stiffness=3.0, loss=0.02, wire_loss=0.01)])]
    ),
    "beam": load("beam"),
    "tower": load("tower"),
    "swings": load("two-swings"),
    "light": TROLLEY.replace(support=Cart(mass=1e-12)),
    "unequal": Scene(gravity=G, pendulum=[Pendulum(links=[Bob(mass=1e12, length=1e-3), Rod(mass=1e-12, length=1e3)])]),
}


def by_part(energies: ModeEnergies, energy: str) -> dict[str, np.ndarray]:
    return {row.part: row.percent for row in energies.rows if row.energy == energy}


def total(energies: ModeEnergies, energy: str) -> np.ndarray:
    return np.sum(list(by_part(energies, energy).values()), axis=0)


@pytest.mark.parametrize("name", SCENES)
def test_all_of_it_adds_up(name: str) -> None:
    """The potential energy of a growing mode is negative, and so is its share; a translation has none."""
    modes = natural_modes(SCENES[name])
    certain = np.flatnonzero(modes.error < UNCERTAIN)
    assert len(certain) == len(modes) - (name == "light")
    energies = mode_energies(modes, certain.tolist())
    np.testing.assert_allclose(total(energies, "kinetic"), 100.0, rtol=1e-12)
    whole = np.where(modes.omega == 0, np.nan, np.where(modes.eigenvalue.real > 0, -100.0, 100.0))[certain]
    if name == "falling":
        assert (whole == -100.0).any()
    np.testing.assert_allclose(total(energies, "potential"), whole, rtol=1e-9)
    weights = [share for part, share in by_part(energies, "potential").items() if part.startswith("weight of link")]
    assert (np.nan_to_num(weights) <= 0).all() == (name in {"standing", "falling"})
    if modes.scene.has_damping or name == "lossy":
        damped = ((modes.damping_ratio > 1e-9) | (name == "lossy"))[certain]
        np.testing.assert_allclose(total(energies, "dissipated")[damped], 100.0, rtol=1e-9)


def test_shares_are_the_means_over_a_cycle() -> None:
    """The motion Re φ e^{iβt} of matrices written by hand, energies of every mass at 64 instants of a cycle."""
    (l1, l2), (m1, m2), (d1, d2), k = (0.7, 1.1), (2.0, 0.5), (0.3, 0.8), 4.0
    z1, z2 = np.array([1.0, l1, 0.0]), np.array([1.0, l1, l2])
    turn, x = np.array([0.0, -1.0, 1.0]), np.array([1.0, 0.0, 0.0])
    M = 3.0 * np.outer(x, x) + m1 * np.outer(z1, z1) + m2 * np.outer(z2, z2)
    K = np.diag([20.0, (m1 + m2) * G * l1, m2 * G * l2]) + k * np.outer(turn, turn)
    D = np.diag([0.5, d1, 0.0]) + d2 * np.outer(turn, turn) + 0.2 * np.outer(z2, z2)
    companion = np.block([[np.zeros((3, 3)), np.eye(3)], [-np.linalg.solve(M, K), -np.linalg.solve(M, D)]])
    values, vectors = np.linalg.eig(companion)
    order = [at for at in np.argsort(np.abs(values)) if values[at].imag > 0]
    assert len(order) == 3
    energies = mode_energies(natural_modes(TROLLEY))
    for mode, at in enumerate(order):
        turns = np.exp(2j * np.pi * np.arange(64) / 64)[:, None]
        q, v = (vectors[:3, at] * turns).real, (values[at] * vectors[:3, at] * turns).real

        def mean(squares: np.ndarray) -> float:
            return float(squares.mean())

        expected = {
            "kinetic": {
                "cart": 3.0 * mean(v[:, 0] ** 2),
                "link 1_1": m1 * mean((v @ z1) ** 2),
                "link 1_2": m2 * mean((v @ z2) ** 2),
            },
            "potential": {
                "spring of cart": 20.0 * mean(q[:, 0] ** 2),
                "weight of link 1_1": m1 * G * mean(l1 * q[:, 1] ** 2),
                "weight of link 1_2": m2 * G * mean(l1 * q[:, 1] ** 2 + l2 * q[:, 2] ** 2),
                "joint spring 1_2": k * mean((q @ turn) ** 2),
            },
            "dissipated": {
                "damper of cart": 0.5 * mean(v[:, 0] ** 2),
                "joint damper 1_1": d1 * mean(v[:, 1] ** 2),
                "joint damper 1_2": d2 * mean((v @ turn) ** 2),
                "drag on link 1_2": 0.2 * mean((v @ z2) ** 2),
            },
        }
        assert sum(expected["kinetic"].values()) == pytest.approx(sum(expected["potential"].values()), rel=1e-12)
        for energy, parts in expected.items():
            shares = {part: share[mode] for part, share in by_part(energies, energy).items() if share[mode]}
            assert shares.keys() == parts.keys()
            for part, value in parts.items():
                assert shares[part] == pytest.approx(100 * value / sum(parts.values()), rel=1e-9), (mode, part)


def spring(*parts: str) -> list[tuple[float, str, str]]:
    return [(1.0, "potential", part) for part in parts]


def mass(link: str) -> list[tuple[float, str, str]]:
    return [*spring(f"weight of link {link}"), (-1.0, "kinetic", f"link {link}")]


RAISES = {
    "ship": {
        "pendulum[1].links[0].stiffness": spring("joint spring 2_1"),
        "spring[0].stiffness": spring("spring 1"),
        "support.stiffness.sway": spring("spring of platform sway"),
        "support.stiffness.roll": spring("spring of platform roll"),
        "pendulum[0].links[0].mass": mass("1_1"),
        "pendulum[1].links[0].mass": mass("2_1"),
    },
    "tower": {"spring[1].stiffness": spring("spring 2"), "support[0].mass": [(-1.0, "kinetic", "floor1")]},
    "standing": {
        "pendulum[0].links[1].stiffness": spring("joint spring 1_2"),
        "pendulum[0].links[0].mass": mass("1_1"),
    },
    "space": {
        "pendulum[0].links[1].stiffness": spring("joint spring 1_2", "joint spring 2_2"),
        "support.mass": [(-1.0, "kinetic", "cart")],
    },
}


@pytest.mark.parametrize("name", RAISES)
def test_a_spring_has_the_share_by_which_it_raises_the_frequency(name: str) -> None:
    """Rayleigh: (k/ω²) ∂ω²/∂k, of two scenes; of a mass its weight less its motion."""
    scene = SCENES[name].conservative
    energies = mode_energies(natural_modes(scene))
    shares = {energy: by_part(energies, energy) for energy in ("potential", "kinetic")}
    for place, parts in RAISES[name].items():
        number = number_at(scene, find_places(scene, place)[0])
        squares = [natural_modes(vary(scene, {place: number * (1 + h)})).omega ** 2 for h in (1e-4, -1e-4)]
        swings = squares[0] > 0
        slopes = (squares[0] - squares[1])[swings] / (squares[0] + squares[1])[swings] / 1e-4
        expected = sum(sign * shares[energy][part] for sign, energy, part in parts)
        np.testing.assert_allclose(expected[swings], 100 * slopes, atol=2e-5, err_msg=place)


@pytest.mark.parametrize("name", ["trolley", "ship"])
def test_a_damper_has_the_share_by_which_it_raises_the_damping_ratio(name: str) -> None:
    """To first order: all dampers a ten thousandth, and each of them 1 % stronger."""
    dampers = {
        "trolley": {
            "support.damping": ("damper of cart", 0.5),
            "pendulum[0].links[0].damping": ("joint damper 1_1", 0.3),
            "pendulum[0].links[1].drag": ("drag on link 1_2", 0.2),
        },
        "ship": {
            "spring[0].damping": ("damper of spring 1", 0.7),
            "support.damping.roll": ("damper of platform roll", 4.0),
        },
    }[name]
    keys = {
        "trolley": [
            "support.damping",
            *(f"pendulum[0].links[{k}].damping" for k in (0, 1)),
            "pendulum[0].links[1].drag",
        ],
        "ship": ["pendulum[0].links[0].damping", "spring[0].damping"]
        + [f"support.damping.{way}" for way in ("sway", "heave", "roll")],
    }[name]
    scene = SCENES[name]
    numbers = {place: 1e-4 * number_at(scene, find_places(scene, place)[0]) for place in keys}
    light = vary(scene, numbers)
    modes = natural_modes(light)
    shares = by_part(mode_energies(modes), "dissipated")
    for place, (part, number) in dampers.items():
        stronger = natural_modes(vary(light, {place: number * 1.01e-4})).damping_ratio
        change = (stronger / modes.damping_ratio - 1) / 0.01
        np.testing.assert_allclose(shares[part], 100 * change, atol=1e-3, err_msg=place)


def test_dampers_of_modes_have_what_the_others_leave() -> None:
    modes = natural_modes(SCENES["ratios"])
    shares = by_part(mode_energies(modes), "dissipated")["damping_ratio"]
    full, others = matrices(SCENES["ratios"]).D, matrices(TROLLEY).D
    for k in range(len(modes)):
        phi = modes.column(modes.shape(k))
        part, whole = (np.vdot(phi, D @ phi).real for D in (full - others, full))
        assert shares[k] == pytest.approx(100 * part / whole, rel=1e-9)


def test_a_loss_angle_dissipates_as_its_share_of_the_quality_factor() -> None:
    modes = natural_modes(SCENES["lossy"])
    shares = by_part(mode_energies(modes), "dissipated")
    for k in range(len(modes)):
        phi, omega = modes.column(modes.shape(k)), modes.omega[k]
        losses = {"joint loss 1_1": 3.0 * 0.02, "wire loss 1_1": 2.0 * G * 1.0 * 0.01}
        energies = {part: loss / omega * abs(phi[1]) ** 2 for part, loss in losses.items()}
        energies["damper of cart"] = 0.5 * abs(phi[0]) ** 2
        whole = sum(energies.values())
        assert {part: share[k] for part, share in shares.items()} == pytest.approx(
            {part: 100 * energy / whole for part, energy in energies.items()}, rel=1e-9
        )


def test_modes_of_one_frequency_share_alike() -> None:
    scene = Scene(gravity=G, support=Cart(mass=1.0), pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0)], count=4)])
    modes = natural_modes(scene)
    energies = mode_energies(modes)
    still = int(np.flatnonzero(modes.multiplicity == 3)[0])
    assert [by_part(energies, "kinetic")[f"link {p}_1"][still] for p in (1, 2, 3, 4)] == pytest.approx([25.0] * 4)
    assert "the mean over all of them" in energies.text()
    assert np.isnan(total(energies, "potential")[0])


def test_a_modal_support_is_one_part() -> None:
    M, K = np.diag([2.0, 1.0]), np.diag([50.0, 90.0])
    support = ModalSupport(
        M=M.tolist(), K=K.tolist(), D=(0.01 * K).tolist(), points=[[[1.0, 0.5], [0.0, 0.2]]], name="frame"
    )
    scene = Scene(gravity=G, support=support, pendulum=[Pendulum(on="frame[0]", links=[Bob(mass=1.0, length=1.0)])])
    modes = natural_modes(scene)
    energies = mode_energies(modes)
    dense = matrices(scene)
    for k in range(len(modes)):
        phi = modes.column(modes.shape(k))
        part, whole = np.vdot(phi[:2], M @ phi[:2]).real, np.vdot(phi, dense.M @ phi).real
        assert by_part(energies, "kinetic")["frame"][k] == pytest.approx(100 * part / whole, rel=1e-9)
    np.testing.assert_allclose(total(energies, "dissipated"), 100.0)


def test_every_form_says_the_same() -> None:
    modes = natural_modes(TROLLEY)
    rows, energies = list(modes), mode_energies(modes)
    text = table(modes, rows, "text", energies=True)
    assert energies.text().split("\n\n", 1)[1].strip() in text
    document = json.loads(table(modes, rows, "json", energies=True))
    cells = list(csv.DictReader(StringIO(table(modes, rows, "csv", energies=True))))
    columns = energies.to_dict()
    for k, (record, line) in enumerate(zip(document["modes"], cells, strict=True)):
        for at, row in enumerate(energies.rows):
            share = record["energies"][f"{row.energy}_percent"][row.part]
            assert share == float(line[row.key]) == row.percent[k] == columns[f"mode_{k + 1}_percent"][at]
    for form in ("markdown", "latex", "html"):
        assert "weight of link 1" in table(modes, rows, form, energies=True)
    assert "weight of link" in energies._repr_html_()
    assert [row["part"] for row in json.loads(energies.report("json"))["energies"]] == [
        row.part for row in energies.rows
    ]


def test_a_long_chain_prints_sums_and_the_largest() -> None:
    """Of sixty links the largest, of seven pendula sums, of fourteen the largest sums; the others as one."""
    rope = Scene(gravity=G, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0, count=60)])])
    energies = mode_energies(natural_modes(rope), [0, 3])
    assert energies.modes == (1, 4)
    assert len(energies.rows) == 120
    _, parts, _ = energies.parts()
    kinetic, potential = parts.cells[:12], parts.cells[12:]
    assert [row[1] for row in kinetic] == [*(f"link {k} of pendulum 1" for k in range(50, 61)), "49 others"]
    assert potential[-1][1] == "49 others"
    assert sum(float(row[2]) for row in kinetic) == pytest.approx(100.0, abs=0.1)
    pairs = Scene(gravity=G, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1 + k, count=2)]) for k in range(7)])
    _, parts, _ = mode_energies(natural_modes(pairs), [0]).parts()
    assert [row[1:] for row in parts.cells[6:8]] == [["pendulum 7", "100.00"], ["weight of pendulum 1", "0.00"]]
    clocks = Scene(
        gravity=G, support=Cart(mass=5.0), pendulum=[Pendulum(links=[Bob(mass=1.0, length=1 + k)]) for k in range(14)]
    )
    _, parts, _ = mode_energies(natural_modes(clocks), [2]).parts()
    kinetic = [row for row in parts.cells if row[0] == "kinetic"]
    assert len(kinetic) == 12
    assert kinetic[-1][1] == "4 others"
    assert sum(float(row[2]) for row in kinetic) == pytest.approx(100.0, abs=0.1)


def test_what_has_no_energies_says_why() -> None:
    long = Scene(gravity=G, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0, count=4001)])])
    with pytest.raises(ComputationError, match="energies: "):
        mode_energies(natural_modes(long, modes=slice(0, 1)))
    with pytest.raises(IndexError, match="no mode of index 3"):
        mode_energies(natural_modes(TROLLEY), [3])


def test_rounding_that_outweighs_a_share_leaves_none(monkeypatch: pytest.MonkeyPatch) -> None:
    modes = natural_modes(Scene(gravity=G, support=Fixed(), pendulum=[Pendulum(links=LINKS)]))
    shape = modes.shape(0)
    monkeypatch.setattr(type(modes), "column", lambda self, of: shape.angles * np.array([1.0, 1.001]))
    assert np.isnan(total(mode_energies(modes, [0]), "kinetic")).all()
    assert scipy.linalg.norm(shape.angles) > 0
