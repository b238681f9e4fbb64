"""Proofs of tables: they hold for every kind of scene, the checker is alone, and what is forged is found."""

from __future__ import annotations

import ast
import copy
import json
import random
import subprocess
import sys
import tomllib
from collections.abc import Callable
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import mpmath as mp
import oracle
import pytest
from scenes import decimal_scene, extreme_scene, spatial_scene, sprung_scene, structured_scene

import multipendula
from modal import Bob, Body, Cart, Fixed, Pendulum, Rod, Scene, load, natural_modes
from modal.assembly import matrices
from modal.modes.tables import record_of
from modal.scene import ConstantForce, ModalSupport, Swing, Tilt, dumps, example_names, scene_from
from modal.scene.feedback import Feedback
from multipendula import check_proof
from multipendula.check_proof import Verdict, check
from multipendula.cli import main
from multipendula.commands.evidence import angle_of_one_link, prove

FILE = Path(check_proof.__file__)
Documents = dict[str, Any]
LEANING = "force[0]: links lean at irrational angles, enclosed at best"
LARGE = {"rope", "thousand-pendula"}


def documents(scene: Scene, source: str | None = None) -> Documents:
    """What the three files hold: the scene, its table and the proof."""
    modes = natural_modes(scene)
    proof, _ = prove(modes, modes.every, source, lambda rows: None)
    table = json.loads(json.dumps({"modes": [record_of(row) for row in modes.every]}))
    return {"scene": tomllib.loads(dumps(scene)), "table": table, "proof": json.loads(proof)}


def verdicts(files: Documents) -> list[Verdict]:
    return check(files["scene"], files["table"], files["proof"])


def unproved(scene: Scene) -> list[Verdict]:
    return [verdict for verdict in verdicts(documents(scene)) if not verdict.proved]


@pytest.mark.parametrize("name", sorted(set(example_names()) - LARGE - {"crane-held"}))
def test_every_shipped_scene_is_proved(name: str) -> None:
    assert not unproved(load(name))


@pytest.mark.parametrize("seed", range(60))
def test_random_scenes_are_proved(seed: int) -> None:
    """Matrices from displacements of masses in fractions, frequencies from the recursion in floats."""
    assert not unproved(structured_scene(seed, 2.0))
    assert not unproved(sprung_scene(seed, 3.0, standing=seed % 2 == 0))
    assert not unproved(extreme_scene(seed, copies=seed % 2 == 0))
    assert not unproved(decimal_scene(seed))
    assert not unproved(spatial_scene(seed))


@pytest.mark.parametrize("seed", [1, 4, 8, 9, 10, 12])
def test_roots_of_structures_with_dampers_are_proved(seed: int) -> None:
    assert not unproved(structured_scene(seed, 0.5, damped=0.7))


@pytest.mark.parametrize("name", ["beam", "huygens", "tower"])
def test_roots_in_a_disc_are_eigenvalues_of_the_state_matrix(name: str) -> None:
    """That of the program's own M, K and D, in angles and 40 digits."""
    with mp.workdps(40):
        dense = matrices(load(name))
        M, K, D = (mp.matrix(S.tolist()) for S in (dense.M, dense.K, dense.D))
        n, A = M.rows, mp.zeros(2 * M.rows)
        A[:n, n:], A[n:, :n], A[n:, n:] = mp.eye(n), -(M**-1) * K, -(M**-1) * D
        eigenvalues = mp.eig(A, left=False, right=False)
        for claim in documents(load(name))["proof"]["modes"]:
            centre, radius = mp.mpc(*claim["centre"]), mp.mpf(claim["radius"]) or mp.mpf(10) ** -15
            assert sum(abs(value - centre) < radius for value in eigenvalues) == claim["roots"]


def mixed() -> Scene:
    """Two different pendula with springs, one of them three times, on a cart with a spring."""
    first = Pendulum(links=(Rod(mass=1.3, length=0.7, stiffness=0.4), Bob(mass=0.6, length=0.9)), count=3)
    second = Pendulum(links=(Body(mass=2.0, length=1.1, centre=0.4, inertia=0.05), Rod(mass=0.2, length=0.3)))
    return Scene(gravity=9.81, support=Cart(mass=3.0, stiffness=7.0), pendulum=(first, second))


def holds(scene: Scene, row: dict[str, Any]) -> bool:
    """Whether so many frequencies are within the bound of a row, by the positions of masses in 60 digits and more."""
    dense = oracle.dense(scene)
    omega, error = mp.mpf(row["omega_rad_per_s"]), mp.mpf(row["relative_error_bound"])
    low, high = (dense.below((omega * (1 + sign * error)) ** 2) for sign in (-1, 1))
    return high - low >= row["multiplicity"]


def leaves(content: Any) -> list[tuple[Any, Any]]:
    """Every container with every key of it, of all that a document holds."""
    items = content.items() if isinstance(content, dict) else enumerate(content) if isinstance(content, list) else ()
    return [pair for key, value in items for pair in ((content, key), *leaves(value))]


def mutate(value: Any, rng: random.Random) -> Any:
    """Another value, often one that is near."""
    if isinstance(value, bool) or value is None:
        return rng.choice([0, 1.0, "1"])
    if isinstance(value, int):
        return value + rng.choice([-1, 1, 2])
    if isinstance(value, float):
        return rng.choice([value * (1 + rng.choice([-1, 1]) * 2.0 ** -rng.randint(1, 52)), -value, value + 1, None])
    if isinstance(value, str) and any(letter.isdigit() for letter in value):
        at = rng.choice([k for k, letter in enumerate(value) if letter.isdigit()])
        return value[:at] + str((int(value[at]) + rng.randint(1, 9)) % 10) + value[at + 1 :]
    return rng.choice([[], "", 0, {}])


REFUSALS = (ValueError, TypeError, LookupError, AttributeError, ArithmeticError)


def damped_roots() -> list[mp.mpc]:
    """Roots of the quartic of a bob on a cart by hand: (3 s² + 0.3 s + 8)(4 s² + 0.2 s + 2 g) − 4 s⁴."""
    g = mp.mpf(9.81)
    cart, swing = [3, mp.mpf(0.3), 8], [4, mp.mpf(0.2), 2 * g]  # m_c + m, c, k;  m l², d, m g l
    product = [sum(cart[i] * swing[k - i] for i in range(3) if 0 <= k - i < 3) for k in range(5)]
    product[0] -= 4  # (m l)²
    return [root for root in mp.polyroots(product, maxsteps=200, extraprec=200) if root.imag >= 0]


def test_of_damped_mutations_each_is_refused_or_true() -> None:
    """By roots in 60 digits."""
    pendulum = Pendulum(links=(Bob(mass=1.0, length=2.0, damping=0.2),))
    scene = Scene(gravity=9.81, support=Cart(mass=2.0, stiffness=8.0, damping=0.3), pendulum=(pendulum,))
    with mp.workdps(60):
        roots = damped_roots()

        def is_true(row: dict[str, Any]) -> bool:
            omega, error, zeta = (
                mp.mpf(row[key]) for key in ("omega_rad_per_s", "relative_error_bound", "damping_ratio")
            )
            near = [z for z in roots if abs(abs(z) - omega) <= error * omega]
            return any(abs(-z.real / abs(z) - zeta) <= 4 * error for z in near)

        refused, harmless = mutations(scene, 150, is_true)
    assert refused > 75
    assert harmless > 15


def test_of_500_mutations_each_is_refused_or_true() -> None:
    scene = mixed()
    refused, harmless = mutations(scene, 500, lambda row: holds(scene, row))
    assert refused > 250
    assert harmless > 50  # of columns that are not looked at


def mutations(scene: Scene, count: int, is_true: Callable[[dict[str, Any]], bool]) -> tuple[int, int]:
    """How many mutations of three files are refused, and how many change nothing; what is then proved is true."""
    rng, refused, harmless, whole = random.Random(63), 0, 0, documents(scene)
    assert all(verdict.proved for verdict in verdicts(whole))
    for trial in range(count):
        which = ("table", "proof", "scene")[trial % 3]
        files = {**whole, which: copy.deepcopy(whole[which])}
        container, key = rng.choice(leaves(files[which]))
        if rng.random() < 0.1:
            del container[key]
        else:
            container[key] = mutate(container[key], rng)
        if files[which] == whole[which]:
            continue
        try:
            rows = dict(zip(verdicts(files), files["table"]["modes"], strict=True))
        except REFUSALS:
            refused += 1
            continue
        assert which != "scene"
        assert all(is_true(row) for verdict, row in rows.items() if verdict.proved)
        refused += not all(verdict.proved for verdict in rows)
        harmless += all(verdict.proved for verdict in rows)
    return refused, harmless


@pytest.mark.parametrize("scene", [mixed(), load("huygens"), load("two-bobs"), load("cart-upright")])
def test_frequencies_shifted_by_four_bounds_are_found(scene: Scene) -> None:
    files = documents(scene)
    for row in files["table"]["modes"]:
        shift = 1 + 4 * row["relative_error_bound"]
        row["omega_rad_per_s"] *= shift
        row["frequency_hz"] = row["frequency_hz"] and row["frequency_hz"] * shift
        if row["growth_rate_per_s"]:
            row["growth_rate_per_s"] *= shift
    proved = [verdict.mode for verdict in verdicts(files) if verdict.proved]
    assert proved == [row["mode"] for row in files["table"]["modes"] if row["omega_rad_per_s"] == 0]


def test_a_proof_elsewhere_than_at_the_frequency_is_none() -> None:
    """The shifted row with a true count about the shifted place: none is there."""
    files = documents(load("chain-3"))
    row, claim = files["table"]["modes"][1], files["proof"]["modes"][1]
    for key in ("omega_rad_per_s", "frequency_hz"):
        row[key] *= 1 + 1e-9
    low, high = ((row["omega_rad_per_s"] * (1 + s * row["relative_error_bound"] / 2)) ** 2 for s in (-1, 1))
    claim["omega_squared"], claim["counts"] = [low, high], [1, 1]
    assert [verdict.proved for verdict in verdicts(files)] == [True, False, True]
    claim["counts"] = [1, 2]
    assert [verdict.proved for verdict in verdicts(files)] == [True, False, True]


def called(*arguments: Path | str) -> subprocess.CompletedProcess[str]:
    """The checker by itself: isolated, from a copy that has nothing next to it."""
    return subprocess.run(
        [sys.executable, "-I", "-S", *map(str, arguments)], capture_output=True, text=True, check=False
    )


def test_the_file_alone_says_what_is_proved(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    checker, scene, table, proof = (tmp_path / name for name in ("check.py", "s.toml", "t.json", "p.json"))
    checker.write_bytes(FILE.read_bytes())
    scene.write_text(dumps(mixed()))
    assert main(["table", str(scene), "--prove", str(proof), "--format", "json", "-o", str(table)]) == 0
    assert f"python -m multipendula.check_proof SCENE.toml TABLE.json {proof}" in capsys.readouterr().err
    assert all(row["proof"] == "proved" for row in json.loads(table.read_text())["modes"])
    told = called(checker, scene, table, proof)
    assert (told.returncode, told.stderr, told.stdout.count(": proved: ")) == (0, "", 7)
    assert told.stdout.count("the only one") == 7
    table.write_text(table.read_text().replace('"multiplicity": 2', '"multiplicity": 3'))
    told = called(checker, scene, table, proof)
    assert (told.returncode, told.stdout.count("NOT PROVED: the proof has a different multiplicity")) == (1, 2)
    scene.write_text(scene.read_text().replace("1.3", "1.3000000000000003"))
    told = called(checker, scene, table, proof)
    assert told.returncode == 2
    assert 'scene: "mass": 1.3000000000000003, is "mass": 1.3, in the proof of another scene' in told.stderr
    assert called(checker, scene, table).returncode == 2
    assert called(checker, scene, table, tmp_path / "none.json").returncode == 2


def test_the_checker_uses_the_standard_library_alone() -> None:
    text = FILE.read_text(encoding="utf-8")
    nodes = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Import | ast.ImportFrom)]
    roots = {name.name for node in nodes if isinstance(node, ast.Import) for name in node.names}
    roots |= {str(node.module).partition(".")[0] for node in nodes if isinstance(node, ast.ImportFrom)}
    assert roots <= sys.stdlib_module_names
    assert max(map(len, text.splitlines())) <= 100


def test_what_is_not_known_is_refused_by_name() -> None:
    """The proof says why, and the checker once more."""
    bob = Pendulum(links=(Bob(mass=1.0, length=1.0),))
    frame = ModalSupport(M=[[3.0]], K=[[16.0]], points=[[[0.0], [1.0]]])
    windy = Scene(gravity=9.81, pendulum=(bob,), force=(ConstantForce(on="pendulum[0].links[0]", amplitude=1.0),))
    files = documents(Scene(gravity=9.0, support=frame, pendulum=(bob.replace(on="modal[0]"),)))
    assert "kind = modal: not supported by this checker" in files["proof"]["modes"][0]["why"]
    with pytest.raises(check_proof.UnreadableError, match="kind = modal: not supported"):
        verdicts(files)
    assert [verdict.words for verdict in verdicts(documents(windy))] == [LEANING]
    assert [verdict.proved for verdict in verdicts(documents(windy))] == [False]
    files = documents(load("chain-2"))
    for data in (files["scene"], files["proof"]["scene"]):
        data["pendulum"][0]["links"][0]["springiness"] = 3.0
    with pytest.raises(check_proof.UnreadableError, match=r"pendulum\[0\].links\[0\].springiness: not supported"):
        verdicts(files)


def test_many_coordinates_are_counted_with_integers_rounded_outwards(tmp_path: Path) -> None:
    rows = multipendula.table("rope", modes="500:501", prove=tmp_path / "p.json", format="json")
    files = {"table": json.loads(str(rows)), "proof": json.loads((tmp_path / "p.json").read_text())}
    assert files["proof"]["bits"] == 128
    assert [claim["counts"] for claim in files["proof"]["modes"]] == [[499, 500], [500, 501]]
    few = {**files["proof"], "bits": 8}
    blocks = check_proof.blocks_of(few["scene"])
    (verdict, _) = (check_proof.judge(row, few["modes"][0], blocks, 8) for row in files["table"]["modes"])
    assert not verdict.proved


def test_dampers_beside_ratios_are_not_proved() -> None:
    damped = Scene(
        gravity=9.81, damping_ratio=0.01, pendulum=(Pendulum(links=(Bob(mass=1.0, length=1.0, damping=0.1),)),)
    )
    assert [verdict.proved for verdict in verdicts(documents(damped))] == [False]
    assert not unproved(Scene.model_validate(damped.model_dump() | {"pendulum": mixed().model_dump()["pendulum"]}))


def test_a_swing_is_the_cart_that_it_is_for_small_motions() -> None:
    """Weights of the swing itself and of what hangs from it hold it: (M + N m) g/L."""
    hung = Pendulum(links=(Bob(mass=1.0, length=1.0),), count=2)
    swing = Scene(gravity=9.81, support=Swing(mass=2.0, length=0.5), pendulum=(hung,))
    cart = scene_from({**tomllib.loads(dumps(swing)), "support": {"kind": "cart", "mass": 2.0, "stiffness": 78.48}})
    blocks = [check_proof.blocks_of(tomllib.loads(dumps(scene))) for scene in (swing, cart)]
    x = check_proof.Q(20)
    assert check_proof.count(blocks[0], x) == check_proof.count(blocks[1], x) == (2, 0)


def test_one_frequency_is_not_proved_for_two_rows() -> None:
    """A row that is in the table twice, under its number or another, with all that the proof says of it."""
    files = documents(load("two-bobs"))
    first, second = files["table"]["modes"]
    files["table"]["modes"] = [first, {**first, "mode": second["mode"]}]
    files["proof"]["modes"][1] = {**files["proof"]["modes"][0], "mode": second["mode"]}
    assert [verdict.proved for verdict in verdicts(files)] == [True, False]
    files["table"]["modes"] = [first, first]
    assert [verdict.proved for verdict in verdicts(files)] == [True, False]


def test_a_row_is_not_counted_twice_by_numbers_between_or_a_conjugate_root() -> None:
    files = documents(load("two-bobs"))
    rows, claims = files["table"]["modes"], files["proof"]["modes"]
    rows.append({**rows[0], "mode": 3})
    claims.append({**claims[0], "mode": 3, "numbers": [0.75, 0.75]})
    claims[0] = {**claims[0], "numbers": [0.25, 0.25]}
    assert [verdict.proved for verdict in verdicts(files)] == [False, True, False]
    files = documents(load("huygens"))
    rows, claims = files["table"]["modes"], files["proof"]["modes"]
    number = next(k for k, claim in enumerate(claims) if float(claim["centre"][1]) > 1)
    real, imaginary = claims[number]["centre"]
    rows.append({**rows[number], "mode": 99})
    claims.append({**claims[number], "mode": 99, "centre": [real, f"-{imaginary}"]})
    assert not verdicts(files)[-1].proved


def test_a_growth_rate_is_that_of_its_row() -> None:
    files = documents(load("cart-upright"))
    row = next(row for row in files["table"]["modes"] if row["growth_rate_per_s"])
    row["growth_rate_per_s"] *= 1.5
    assert not verdicts(files)[row["mode"] - 1].proved


def test_rotors_are_proved() -> None:
    rotor = Bob(mass=1.0, length=0.5, rotor_inertia=2e-4, gear_ratio=36.0)
    pendulum = Pendulum(links=(rotor, rotor.replace(stiffness=2.0), Bob(mass=0.3, length=0.2)))
    for support in (Fixed(), Cart(mass=2.0), Tilt(mass=3.0, inertia=0.5, stiffness=60.0)):
        assert not unproved(Scene(gravity=9.81, support=support, pendulum=(pendulum,)))


def test_why_rows_are_not_proved_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    loop = Feedback(input="cart_force", output="x", gain=3.0)
    bob = Pendulum(links=(Bob(mass=1.0, length=1.0),))
    path = tmp_path / "loop.toml"
    path.write_text(dumps(Scene(gravity=9.81, support=Cart(mass=1.0), pendulum=(bob,), feedback=[loop])))
    assert main(["table", str(path), "--prove", str(tmp_path / "proof.json")]) == 0
    assert "not proved: scene.feedback: not supported by this checker" in capsys.readouterr().err
    assert main(["table", str(path), "--prove", str(tmp_path / "none" / "proof.json")]) == 2
    assert "--prove " in capsys.readouterr().err


def windy(damping: float = 0.0) -> Scene:
    links = (Rod(mass=1.0, length=1.0, damping=damping), Bob(mass=0.5, length=0.7, stiffness=1.5))
    wind = ConstantForce(on="pendulum[0].links[1]", amplitude=3.0)
    cart = Cart(mass=2.0, stiffness=30.0)
    return Scene(gravity=9.81, support=cart, pendulum=(Pendulum(links=links, count=2),), force=(wind,))


def test_rests_that_lean_are_enclosed_and_not_replayed() -> None:
    pytest.importorskip("flint")
    files = documents(windy())
    assert [verdict.words for verdict in verdicts(files)] == [LEANING] * 5
    for row, claim in zip(files["table"]["modes"], files["proof"]["modes"], strict=True):
        low, high = map(float, claim["enclosed"]["omega_squared"])
        assert low < row["omega_rad_per_s"] ** 2 < high < low * (1 + 5 * row["relative_error_bound"])
        assert claim["enclosed"]["counts"] == [row["mode"] - 1, row["mode"]]
    assert all(claim.keys() == {"mode", "why"} for claim in documents(windy(0.1))["proof"]["modes"])


def test_a_wrong_frequency_of_a_rest_that_leans_is_not_enclosed() -> None:
    pytest.importorskip("flint")
    modes = natural_modes(windy())
    rows = [replace(row, omega=row.omega * (1 + 4 * row.relative_error_bound)) for row in modes.every]
    assert set(prove(modes, rows, None, lambda done: None)[1].values()) == {"not proved"}


def test_without_flint_rests_that_lean_are_not_proved(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "flint", None)
    assert {claim["why"] for claim in documents(windy())["proof"]["modes"]} == {LEANING}


def frequency(angle: mp.mpf) -> mp.mpf:
    """ω(a)/ω₀ of one link, by the complete elliptic integral."""
    return mp.pi / (2 * mp.ellipk(mp.sin(angle / 2) ** 2))


def test_the_1_percent_angle_of_one_link_is_enclosed(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    with mp.workdps(40):
        low, high = (mp.radians(mp.mpf(str(angle))) for angle in angle_of_one_link())
        assert frequency(low) > mp.mpf("0.99") > frequency(high)
        for k in range(1, 41):
            angle = mp.mpf(k) / 20
            excess = frequency(angle) - 1 + angle**2 / 16
            assert 0 < excess < angle**4 / 3072
    path = tmp_path / "scene.toml"
    for scene, is_told in (
        (Scene(gravity=9.81, pendulum=(Pendulum(links=(Rod(mass=1.0, length=1.0),)),)), True),
        (mixed(), False),
    ):
        path.write_text(dumps(scene))
        assert main(["table", str(path), "--prove", str(tmp_path / "proof.json")]) == 0
        assert ("between 22.91° and 22.93°" in capsys.readouterr().err) is is_told


def test_rounded_counts_enclose_exact_ones() -> None:
    """Near frequencies, with so few bits that rounding matters: none is too small at -1, none too large at 1."""
    scene, different = mixed(), 0
    blocks = check_proof.blocks_of(tomllib.loads(dumps(scene)))
    for omega, exponent, bits in product(natural_modes(scene).omega, range(2, 24, 3), (2, 6, 10, 14)):
        for way in (-1, 1):
            x = check_proof.Q(omega) ** 2 * (1 + way * check_proof.Q(2) ** -exponent)
            (fewest, exact, most) = (check_proof.count(blocks, x, bits, gain)[0] for gain in (1, 0, -1))
            assert fewest <= exact <= most
            different += fewest < most
    assert different > 20


def test_rounded_eliminations_of_small_integers_enclose_exact_ones() -> None:
    """Where every division is rounded, and by as much as the entries themselves."""
    rng, n = random.Random(1), 5
    for _ in range(300):
        entries = {(i, j): rng.randint(-6, 6) for i in range(n) for j in range(i + 1)}
        whole = [{j: entries[max(i, j), min(i, j)] for j in range(n)} for i in range(n)]
        fractions = [{j: check_proof.Q(value) for j, value in row.items()} for row in whole]
        try:
            exact = check_proof.eliminate(fractions)[0]
            fewest, most = (check_proof.eliminate([dict(row) for row in whole], gain)[0] for gain in (1, -1))
        except check_proof.NotProvedError:
            continue
        assert fewest <= exact <= most
