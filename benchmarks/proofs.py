"""Proofs of the tables of all shipped scenes and of random ones, with the times of the table, the proof and its check.

    python benchmarks/proofs.py [--quick] [--random 300]

Each scene gets its table and proof (`table SCENE --prove`), which `multipendula/check_proof.py` then checks, run as a
file by itself.  Each line is printed when it is measured, and a terminal shows how many scenes are done.  Exit code 1
where a row is not proved.  `--quick` omits random scenes and those of over 40 rows.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from tqdm import tqdm

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "support"))

from scenes import decimal_scene, extreme_scene, spatial_scene, sprung_scene, structured_scene

from modal import dump, load, natural_modes
from modal.modes import tables
from modal.scene import Scene, example_names
from multipendula.commands.evidence import prove

ROOT = Path(__file__).parent.parent
RANDOM = {
    "carts, extreme ratios": extreme_scene,
    "joint springs, standing links": lambda seed: sprung_scene(seed, 3.0, standing=True),
    "structures": lambda seed: structured_scene(seed, 2.0),
    "decimals": decimal_scene,
    "in space": spatial_scene,
}
QUICK_ROWS = 40


def measure(scene: Scene, folder: Path, source: str | None = None) -> tuple[int, int, float, float, float]:
    """Rows, how many of them are proved, and the seconds of processor time of modes, proof and check."""
    times = [time.process_time()]
    modes = natural_modes(scene)
    rows = modes.every
    times.append(time.process_time())
    proof, _ = prove(modes, rows, source, lambda done: None)
    times.append(time.process_time())
    scene_file, table_file, proof_file = (folder / name for name in ("scene.toml", "table.json", "proof.json"))
    if source:
        scene_file.write_text(
            (ROOT / f"modal/scene/shipped/{source}.toml").read_text(encoding="utf-8"), encoding="utf-8"
        )
    else:
        dump(scene, scene_file)
    table_file.write_text(tables.table(modes, rows, "json"), encoding="utf-8")
    proof_file.write_text(proof, encoding="utf-8")
    checker = [sys.executable, "-I", str(ROOT / "multipendula" / "check_proof.py")]
    before = os.times()
    checked = subprocess.run(
        [*checker, scene_file, table_file, proof_file], capture_output=True, text=True, check=False
    )
    proved = checked.stdout.count(": proved: ")
    after = os.times()
    check = after.children_user - before.children_user + after.children_system - before.children_system
    return len(rows), proved, times[1] - times[0], times[2] - times[1], check


def measurements(folder: Path, count: int, quick: bool) -> Iterator[tuple[str, Sequence[float]]]:
    """What was measured of each shipped scene, and of `count` random scenes of each kind in all."""
    silent = not sys.stderr.isatty()
    for name in tqdm(example_names(), disable=silent, leave=False):
        scene = load(name)
        if scene.feedback:  # the checker knows no controllers
            continue
        if not quick or len(natural_modes(scene)) <= QUICK_ROWS:
            yield name, measure(scene, folder, name)
    if quick or not count:
        return
    for kind, maker in RANDOM.items():
        seeds = tqdm(range(count), kind, disable=silent, leave=False)
        measured = [measure(maker(seed), folder) for seed in seeds]
        yield f"{count} of {kind}", [sum(column) for column in zip(*measured, strict=True)]


def main() -> int:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--quick", action="store_true")
    arguments.add_argument("--random", type=int, default=300)
    options = arguments.parse_args()
    every_row_is_proved = True
    print(f"{'scene':36} {'rows':>6} {'proved':>6} {'modes (s)':>10} {'proof (s)':>10} {'check (s)':>10}", flush=True)
    with TemporaryDirectory() as folder:
        for name, measured in measurements(Path(folder), options.random // len(RANDOM), options.quick):
            rows, proved, *seconds = measured
            tqdm.write(f"{name:36} {rows:6} {proved:6} " + " ".join(f"{each:10.2f}" for each in seconds))
            sys.stdout.flush()
            every_row_is_proved &= rows == proved
    return 0 if every_row_is_proved else 1


if __name__ == "__main__":
    sys.exit(main())
