"""The command sweep: from its options to files, and on from where Ctrl-C cut it."""

from __future__ import annotations

import json
from argparse import Namespace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sweep_measures

from modal import ComputationError, SceneError, load
from modal.extend import registration
from modal.scene.parameters import parse_variations, vary
from multipendula.cli import main
from multipendula.commands import command_named
from multipendula.commands.sweeps import sweep
from nonlinear.ensembles import bifurcations
from nonlinear.reduction import usual_start
from nonlinear.simulation import simulate
from nonlinear.sweeps import Study, parse_measures
from nonlinear.sweeps import files as sweep_files
from nonlinear.sweeps import sweep as swept

DRIVEN = """
gravity = 9.81
pendulum = [{ links = [{ kind = "bob", mass = 1.0, length = 1.0, damping = 2.0 }], start = { angles_deg = [20.0] } }]
force = [{ on = "pendulum[0].links[0]", kind = "sine", amplitude = 1.0, frequency_hz = 4.0 }]
"""

KAPITZA = "kapitza"


def options(*places: str, **changes: Any) -> Namespace:
    command = command_named("sweep")
    assert command is not None
    asked: Namespace = command.page().parse_args(["paper-cart-2", "--vary", ""])
    vars(asked).update({"vary": list(places), "workers": 1} | changes)
    return asked


def test_a_map_is_kept_and_drawn(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    kept, drawn = tmp_path / "m.npz", tmp_path / "m.png"
    sweep(options("support.mass=1:100:3log", "gravity=5:10:3", measure=["beat"], output=str(kept), picture=str(drawn)))
    assert capsys.readouterr().out.startswith("9 of 9 points, 0 failed")
    assert sweep_files.load(kept).values("beat_2_s").shape == (3, 3)
    assert drawn.read_bytes().startswith(b"\x89PNG")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["m.npz", "m.png"]


def test_ctrl_c_leaves_a_journal_that_the_same_command_goes_on_from(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("SWEEP_LOG", str(tmp_path / "log"))
    kept = tmp_path / "m.csv"
    with registration(sweep_measures.Interrupted):
        asked = options("support.mass=1,2,3", measure=["interrupted:3"], output=str(kept))
        monkeypatch.setenv("SWEEP_INTERRUPTS", "1")
        with pytest.raises(KeyboardInterrupt):
            sweep(asked)
        assert not kept.exists()
        assert f"{kept}.journal" in capsys.readouterr().err
        monkeypatch.delenv("SWEEP_INTERRUPTS")
        sweep(asked)
        assert sweep_measures.logged() == ["1", "2", "3"]
        assert np.array_equal(sweep_files.load(kept).values("product_kg"), [1, 2, 3])
        assert not (tmp_path / "m.csv.journal").exists()


def test_loci_are_told_kept_and_drawn(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    kept, drawn = tmp_path / "l.csv", tmp_path / "l.svg"
    place = "pendulum[0].links[0].length=5:20:4"
    sweep(options(place, scene="crane-two-loads", loci=True, workers=None, output=str(kept), picture=str(drawn)))
    assert "veering  2 · 3  10.0833" in capsys.readouterr().out
    rows = np.loadtxt(kept, delimiter=",", skiprows=1)
    assert rows[0, 0] == 5.0
    assert rows.shape[1] == 4
    assert b"<svg" in drawn.read_bytes()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"output": "m.txt"}, "must end in .npz, .csv, .json, .png, .svg or .pdf"),
        ({"picture": "m.bmp"}, "must end in .png"),
        ({"output": "/nowhere/m.npz"}, "there is no folder"),
        (
            {"measure": ["beet"], "output": "m.txt"},
            "must end in .npz, .csv, .json, .png, .svg or .pdf\nmeasure beet: no such measure",
        ),
        ({"loci": True, "measure": ["beat"]}, "--measure: "),
        ({"loci": True, "workers": None, "output": "l.npz"}, "-o l.npz: .*csv"),
        ({"loci": True, "workers": None, "vary": ["gravity=1:2:3"] * 2}, "--loci: .*one --vary"),
    ],
)
def test_bad_options_are_refused(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(SceneError, match=words):
        sweep(options(**{"vary": ["support.mass=1:2:3"]} | changes))


def test_a_picture_that_cannot_be_drawn_is_refused_at_once(capsys: pytest.CaptureFixture[str]) -> None:
    for places in (["gravity=1"], ["gravity=1,2", "support.mass=1,2", "pendulum[0].links[0].mass=1,2"]):
        with pytest.raises(ComputationError, match="one or two parameters"):
            sweep(options(*places, picture="m.png"))
    assert not capsys.readouterr().out


def test_a_sweep_without_a_number_says_why(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    kept = tmp_path / "m.npz"
    with pytest.raises(ComputationError, match="failed\n3 × mode 9 of the table"):
        sweep(options("support.mass=1:2:3", measure=["beat:9"], output=str(kept)))
    assert not capsys.readouterr().out
    assert not list(tmp_path.iterdir())


def unstarted(folder: Path) -> str:
    """A file of two unequal pendula on a cart, without a start."""
    link = 'links = [{{ kind = "bob", mass = 0.15, length = {} }}]'
    pendula = "".join(f"[[pendulum]]\n{link.format(length)}\n" for length in (0.25, 0.26))
    path = folder / "scene.toml"
    path.write_text(f'gravity = 9.81\nsupport = {{ kind = "cart", mass = 1.2 }}\n{pendula}', encoding="utf-8")
    return str(path)


@pytest.mark.parametrize("count", [2, 5])
def test_points_without_a_start_begin_in_their_first_mode_that_swings(
    count: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Individually and together, as `simulate` does with the scene of each point; and a note says so."""
    scene, kept = unstarted(tmp_path), tmp_path / "m.npz"
    sweep(options(f"support.mass=1:9:{count}", scene=scene, measure=["cart_travel:2"], output=str(kept)))
    assert "begins in the shape of its first mode that swings, its largest angle 5°" in capsys.readouterr().err
    loaded = sweep_files.load(kept)
    for mass, travel in zip(loaded.study.variations[0].values, loaded.values("cart_travel_m"), strict=True):
        point = vary(load(scene), {"support.mass": mass})
        cart = simulate(point, 2.0, start=usual_start(point), output=2001).motion.cart
        assert travel == pytest.approx(np.ptp(cart), rel=1e-4)


def test_modes_need_no_start(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    sweep(options("gravity=9,10", scene=unstarted(tmp_path), measure=["frequencies:1"]))
    assert capsys.readouterr().err == ""


def test_tongues_are_kept_and_drawn(tmp_path: Path) -> None:
    grid = ("support.motion.amplitude=0.01:0.03:3", "support.motion.frequency_hz=10:40:4")
    kept, drawn = tmp_path / "t.json", tmp_path / "t.png"
    sweep(options(*grid, scene=KAPITZA, measure=["floquet"], output=str(kept), picture=str(drawn)))
    told = json.loads(kept.read_text())
    assert list(told["data"]) == [
        *("support.motion.amplitude_m", "support.motion.frequency_hz"),
        *("largest_multiplier", "growth_rate_per_s", "kind"),
    ]
    assert told["data"]["kind"][:4] == [1, 1, 1, -1]
    assert [(boundary["kind"], boundary["turns"]) for boundary in told["boundaries"]] == [("at the frequency", False)]
    assert drawn.read_bytes().startswith(b"\x89PNG")
    line = swept(Study(load(KAPITZA), parse_variations(grid[1:]), parse_measures(["floquet"])), workers=1)
    held = np.interp(0.02, told["boundaries"][0]["amplitude_m"][::-1], told["boundaries"][0]["frequency_hz"][::-1])
    assert [boundary.frequency_hz.tolist() for boundary in line.boundaries] == [[pytest.approx(held, rel=1e-3)]]


def test_floquet_is_refused_before_anything_is_computed() -> None:
    with pytest.raises(SceneError, match='kind = "moved"'):
        sweep(options("gravity=9,10", measure=["floquet"]))
    with pytest.raises(SceneError, match="takes no number"):
        sweep(options("gravity=9,10", scene=KAPITZA, measure=["floquet:3"]))
    with pytest.raises(SceneError, match=r"as well as --picture"):
        sweep(options("gravity=9,10", picture="a.png", output="b.png"))


def test_chaos_against_energy_is_told_kept_and_drawn(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    kept, drawn = tmp_path / "e.csv", tmp_path / "e.png"
    words = ["sweep", "chain-2", "--vary", "start.energy=1,40", "--members", "3", "--measure", "lyapunov:8"]
    assert main([*words, "--seed", "0", "--workers", "1", "-o", str(kept), "--picture", str(drawn)]) == 0
    text = capsys.readouterr().out
    assert "energy (J)" in text
    assert "At every energy 3 starts at random (seed 0)" in text
    loaded = sweep_files.load(kept)
    assert loaded.study.variations[0].column == "start.energy_J"
    assert loaded.values("chaotic_share").tolist() == [0.0, 1.0]
    assert drawn.read_bytes().startswith(b"\x89PNG")
    assert main(["sweep", "chain-2", "--vary", "gravity=1,2", "--members", "3"]) == 2
    assert "--members: needs --vary start.energy=VALUES" in capsys.readouterr().err


def test_every_verb_takes_a_measure_by_the_same_words(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["spread", "paper-cart-2", "--uncertain", "gravity=1%", "--members", "5", "--measure", "beat:2"]) == 0
    assert "beat_2_s" in capsys.readouterr().out
    grid = ["--vary", "pendulum[0].start.angles_deg[0]=10,20", "--vary", "pendulum[0].start.angles_deg[1]=5,9"]
    assert main(["basins", "chain-2", *grid, "--measure", "largest_angle:1"]) == 0
    assert "Each start was simulated for 1 s." in capsys.readouterr().out
    assert main(["basins", "chain-2", *grid, "--measure", "largest_angle:1", "--duration", "2"]) == 2
    assert "--measure largest_angle:1: has its own --duration" in capsys.readouterr().err
    assert main(["basins", "chain-2", *grid, "--measure", "beat"]) == 2
    assert "basins does not take beat: it belongs to a scene whatever its start" in capsys.readouterr().err


@pytest.mark.parametrize(
    "command",
    [
        "section chain-2 --energy 10 --members 40 --duration 2",
        "basins chain-2 --duration 1 --vary pendulum[0].start.angles_deg[0]=-90:90:6 --vary gravity=9:10:6",
    ],
)
def test_shares_in_a_folder_are_the_whole(command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asked = [*command.split(), "--engine", "numpy", "--format", "csv"]
    assert main(asked) == 0
    whole = capsys.readouterr().out
    folder = ["--folder", str(tmp_path / "kept")]
    for share in ("2/2", "1/2"):
        assert main([*asked, *folder, "--share", share]) == 0
        assert capsys.readouterr().out.startswith(f"share {share.replace('/', ' of ')} is in ")
    before = {path.name: path.stat().st_mtime_ns for path in (tmp_path / "kept").iterdir()}
    assert main([*asked, *folder]) == 0
    assert capsys.readouterr().out == whole
    assert {path.name: path.stat().st_mtime_ns for path in (tmp_path / "kept").iterdir()} == before
    assert main([*asked, "--share", "1/2"]) == 2
    assert "--share: needs --folder" in capsys.readouterr().err
    assert main(["spread", "chain-2", "--uncertain", "gravity=0.1", *folder]) == 2
    assert "--folder: needs --duration" in capsys.readouterr().err


@pytest.mark.parametrize(
    "command",
    [
        "sweep chain-2 --vary gravity=9:10:40 --measure frequencies",
        "sweep chain-2 --vary gravity=9:10:40 --measure beat:9",
        "sweep {driven} --vary force[0].amplitude=0.9:1.1:4 --strobe --settle 9",
        "sweep {driven} --vary force[0].frequency_hz=4:5:4 --strobe --settle 9",
    ],
)
def test_shares_of_a_sweep_are_the_whole(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of values with one period, with periods of their own, of points; and where all fail."""
    driven = tmp_path / "driven.toml"
    driven.write_text(DRIVEN)
    monkeypatch.setattr(bifurcations, "VALUES_TOGETHER", 2)
    asked = [*command.format(driven=driven).split(), "--workers", "1"]
    outcome = main([*asked, "-o", str(tmp_path / "whole.csv")])
    told, folder = capsys.readouterr().out, ["--folder", str(tmp_path / "kept")]
    for share in ("2/2", "1/2"):
        assert main([*asked, *folder, "--share", share]) == 0
        assert capsys.readouterr().out.startswith(f"share {share.replace('/', ' of ')} is in ")
    before = {path: path.stat().st_mtime_ns for path in (tmp_path / "kept").rglob("*.npz")}
    assert len(before) == 1 if "amplitude" in command else len(before) >= 2
    assert main([*asked, *folder, "-o", str(tmp_path / "together.csv")]) == outcome
    assert capsys.readouterr().out == told
    if not outcome:
        assert (tmp_path / "together.csv").read_bytes() == (tmp_path / "whole.csv").read_bytes()
        assert {path: path.stat().st_mtime_ns for path in before} == before


def test_a_share_may_have_nothing_to_do(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "driven.toml").write_text(DRIVEN)
    grid = [f"--vary=pendulum[0].start.{name}[0]=-20,20" for name in ("angles_deg", "rates_deg")]
    asked = ["basins", str(tmp_path / "driven.toml"), "--measure", "attractor", "--duration", "15", *grid]
    assert main([*asked, "--workers", "1", "--folder", str(tmp_path / "kept"), "--share", "2/2"]) == 0
    assert capsys.readouterr().out.startswith("share 2 of 2 is in ")


def test_folders_of_sweeps_are_refused_where_they_are_another_s(tmp_path: Path) -> None:
    asked = ["sweep", "chain-2", "--vary", "gravity=9:10:40", "--folder", str(tmp_path / "kept"), "--workers", "1"]
    assert main(asked) == 0
    assert main([*asked, "--measure", "beat"]) == 2
    for more in (["--loci"], ["--fresh"]):
        assert main([*asked, *more]) == 2
    path = tmp_path / "kept" / "part-000001.npz"
    path.write_bytes((tmp_path / "kept" / "part-000000.npz").read_bytes())
    assert main(asked) == 2
    path.write_bytes(path.read_bytes()[:-9])
    assert main(asked) == 2


@pytest.mark.parametrize("text", ["0/2", "3/2", "1", "a/b", "1/2/3"])
def test_shares_that_cannot_be_are_refused(text: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["section", "chain-2", "--folder", "kept", "--share", text])
    assert "must be K/N with whole numbers" in capsys.readouterr().err
