"""Random scenes of every pair of features, in every engine, against equations from the places of masses alone.

    python benchmarks/feature_pairs.py [--scenes 300] [--from 0] [--only NUMBER …] [--keep FILE] [--all] [--table]

Scene number k has the pair k modulo the number of pairs, the rest of it drawn by the seed k.  Its end, after SECONDS,
is computed by `tests/support/places.py` (places of masses, contacts and kicks piece by piece), in floats, in NumPy's
lanes and by the loop that numba compiles, which Python runs here as it stands; and once more with every switch made
simultaneous: each pendulum three times, all else three times as heavy, as stiff and as strong (`three`), and with its
mirror image, on a support that then stands still (`mirrored`).  Floats do both, and of the two compiled engines one
does one of them, in turn (with `--all` all do both).  Each scene is one JSON line of `--keep`; those that are there are
not computed again, `--table` only prints them.  Exit code 1 where a scene differs by more than LIMIT, fails, or takes
longer than PATIENCE.
"""

from __future__ import annotations

import argparse
import json
import random
import signal
import sys
import time
import traceback
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from tabulate import tabulate

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))

from support.loops import interpreted
from support.pieces import LONGEST
from support.places import SwitchedPlaces

from modal.errors import SceneError
from modal.scene import Scene, scene_from
from modal.types import Floats
from nonlinear import ensemble, simulate
from nonlinear.system import initial_state

FEATURES = (
    "friction", "rail", "drag", "ratios", "drives", "forces", "records", "hoists", "moved", "structures", "copies",
    "rotors",
)  # fmt: skip
REFUSED = {
    ("friction", "structures"): "dry friction on structures is not solved",
    ("rail", "structures"): "dry friction on structures is not solved",
    ("rail", "moved"): "dry friction on structures is not solved",
    ("ratios", "hoists"): "a hoist changes the modes",
}
PAIRS = [pair for pair in combinations(FEATURES, 2) if pair not in REFUSED]
SECONDS = 1.0
TOLERANCE = 1e-12
SHORT = LONGEST / 20
"""s of the oracle's longest steps where those of 20 ms may have passed a switch and its return, or a kink of drag."""
LIMIT = 1e-9
NOTHING: Mapping[str, Sequence[str]] = {}
PATIENCE = 240.0
"""Seconds after which a run counts as endless."""


# ---------------------------------------------------------------------------------------------------- the scenes


class Drawn:
    """A scene with some features as a dictionary, drawn by a seed."""

    def __init__(self, seed: int, features: tuple[str, ...]) -> None:
        self.rng, self.features = random.Random(seed), features
        self.structured = "structures" in features
        self.scene: dict[str, Any] = {"gravity": self.number(5.0, 12.0), "pendulum": []}
        self.names = self._supports()
        for _ in range(self.rng.choice([1, 1, 2])):
            self.scene["pendulum"].append(self._pendulum())
        for feature in features:
            getattr(self, f"_{feature}", lambda: None)()

    def number(self, low: float, high: float) -> float:
        """Between these, of three decimals."""
        return round(self.rng.uniform(low, high), 3)

    def some(self, low: float, high: float, often: float = 0.4) -> float:
        """Such a number, or 0."""
        return self.number(low, high) if self.rng.random() < often else 0.0

    # -------------------------------------------------------------------------------------------------- supports

    def _supports(self) -> list[str]:
        moves = self._motions() if "moved" in self.features else None
        if self.structured:
            names = ["a", "b"][: self.rng.choice([1, 2])]
            self.scene["support"] = [self._support(name) for name in names]
            if moves:
                self.scene["ground"] = {"motion": moves}
            return names
        if moves:
            self.scene["support"] = {"kind": "moved", "motion": moves}
        elif "rail" in self.features or self.rng.random() < 0.5:
            self.scene["support"] = self._cart()
        return []

    def _cart(self) -> dict[str, Any]:
        return {
            "kind": "cart",
            "mass": self.number(0.5, 4),
            "stiffness": self.some(1, 20),
            "damping": self.some(0.1, 1),
        }

    def _support(self, name: str) -> dict[str, Any]:
        kind = self.rng.choice(["cart", "swing", "tilt", "heave", "platform"])
        place = {"name": name, "position": [self.number(-1, 1), self.number(-0.3, 0.3)], "kind": kind}
        if kind == "cart":
            return self._cart() | place
        numbers = {**place, "mass": self.number(0.5, 4)}
        body = {**numbers, "inertia": self.number(0.2, 1), "centre": [self.number(-0.2, 0.2), self.number(0, 0.3)]}
        if kind == "swing":
            return {
                **numbers,
                "length": self.number(0.3, 2),
                "stiffness": self.some(1, 9),
                "damping": self.some(0.1, 1),
            }
        if kind == "heave":
            return {**numbers, "stiffness": self.number(50, 300), "damping": self.some(0.1, 1)}
        if kind == "tilt":
            return {**body, "stiffness": self.number(5, 50), "damping": self.some(0.1, 1)}
        ways = {"sway": self.some(1, 20), "heave": self.number(50, 300), "roll": self.number(10, 50)}
        return {**body, "stiffness": ways, "damping": {way: self.some(0.1, 1) for way in ways}}

    def _motions(self) -> list[dict[str, Any]]:
        ways = self.rng.choice([["horizontal"], ["vertical"], ["horizontal", "vertical"]])
        return [self._motion(way) for way in ways]

    def _motion(self, way: str) -> dict[str, Any]:
        if "records" not in self.features or self.rng.random() < 0.3:
            wave = {"frequency_hz": self.number(0.5, 3), "phase_deg": self.number(0, 360)}
            return {"kind": "sine", "direction": way, "amplitude": self.number(0.01, 0.08), **wave}
        key = self.rng.choice(["displacement_m", "velocity_m_per_s", "acceleration_m_per_s2"])
        size = {"displacement_m": 0.05, "velocity_m_per_s": 0.3, "acceleration_m_per_s2": 2.0}[key]
        return {"kind": "record", "direction": way, **self._record(key, size)}

    def _record(self, key: str, size: float) -> dict[str, Any]:
        """Two sines at 20 samples a period of the faster one, some of which begin or end during the run."""
        slow, fast = self.number(0.3, 1.0), self.number(1.0, 2.0)
        first = self.rng.choice([-0.3, self.number(0.0, 0.5)])
        last = self.rng.choice([SECONDS + 0.3, self.number(0.8, 1.1)])
        times = np.linspace(first, last, int((last - first) * fast * 20) + 4)
        a, b = self.number(0, 6), self.number(0, 6)
        values = size * (np.sin(2 * np.pi * slow * times + a) + 0.5 * np.sin(2 * np.pi * fast * times + b))
        return {"time_s": times.tolist(), key: values.tolist()}

    # --------------------------------------------------------------------------------------------------- pendula

    def _pendulum(self) -> dict[str, Any]:
        links = [self._link() for _ in range(self.rng.choice([1, 2, 2, 3]))]
        start = {"angles_deg": [self.number(-60, 60) for _ in links]}
        if self.rng.random() < 0.6:
            start["rates_deg"] = [self.number(-60, 60) for _ in links]
        pendulum: dict[str, Any] = {"links": links, "start": start}
        if self.names:
            pendulum |= {"on": self.rng.choice(self.names), "position": [self.number(-0.5, 0.5), self.number(0, 0.3)]}
        return pendulum

    def _link(self) -> dict[str, Any]:
        link: dict[str, Any] = {"kind": self.rng.choice(["bob", "rod", "body"]), "mass": self.number(0.3, 2)}
        link |= {"length": self.number(0.4, 1.2), "damping": self.some(0.01, 0.1, 0.3)}
        link["stiffness"] = self.some(0.2, 3, 0.3)
        if link["kind"] == "body":
            link |= {"centre": self.number(0.3, 1.2) * link["length"], "inertia": self.number(0.01, 0.3)}
        return link

    def _some_links(self) -> list[dict[str, Any]]:
        """At least one of them."""
        links = [link for pendulum in self.scene["pendulum"] for link in pendulum["links"]]
        return [link for link in links if self.rng.random() < 0.6] or [self.rng.choice(links)]

    # -------------------------------------------------------------------------------------------------- features

    def _friction(self) -> None:
        for link in self._some_links():
            link["friction"] = self.number(0.05, 0.6)

    def _rail(self) -> None:
        by_force = self.rng.random() < 0.5
        rubs = {"friction": self.number(0.2, 2)} if by_force else {"friction_coefficient": self.number(0.02, 0.1)}
        self.scene["support"] |= rubs

    def _drag(self) -> None:
        for link in self._some_links():
            link.update(
                self.rng.choice([{"drag": 0.1}, {"quadratic_drag": 0.2}, {"drag": 0.05, "quadratic_drag": 0.1}])
            )

    def _ratios(self) -> None:
        self.scene["damping_ratio"] = self.number(0.005, 0.1)

    def _rotors(self) -> None:
        for link in self._some_links():
            link.update(rotor_inertia=self.number(1e-3, 9e-3), gear_ratio=self.number(1, 9))

    def _drives(self) -> None:
        clocks = "hoists" not in self.features and "friction_coefficient" not in self.scene.get("support", ())
        for link in self._some_links():
            if clocks and self.rng.random() < 0.6:
                link["drive"] = {
                    "kind": "escapement",
                    "impulse": self.number(0.02, 0.2),
                    "angle_deg": self.number(1, 9),
                }
            else:
                link["drive"] = {
                    "kind": "van-der-pol",
                    "strength": self.number(0.1, 0.5),
                    "angle_deg": self.number(5, 30),
                }

    def _place(self) -> dict[str, Any]:
        """Where a force acts, and how."""
        kind = self.scene.get("support", {"kind": "fixed"})
        if self.names and self.rng.random() < 0.3:
            carrier = self.rng.choice(self.scene["support"])
            way = self.rng.choice(["horizontal", "vertical"])
            way = {"cart": "horizontal", "heave": "vertical"}.get(carrier["kind"], way)
            return {"on": f"{carrier['name']}@{self.number(-0.5, 0.5)},{self.number(-0.2, 0.2)}", "direction": way}
        if not self.names and kind["kind"] == "cart" and self.rng.random() < 0.4:
            return {"on": "cart"}
        p = self.rng.randrange(len(self.scene["pendulum"]))
        links = self.scene["pendulum"][p]["links"]
        i = self.rng.randrange(len(links))
        below = self.rng.choice(["", f"@{round(self.rng.random() * links[i]['length'], 3)}"])
        return {
            "on": f"pendulum[{p}].links[{i}]{below}",
            "direction": self.rng.choice(["horizontal", "vertical", "torque"]),
        }

    def _forces(self) -> None:
        for _ in range(self.rng.choice([1, 2])):
            place = self._place()
            if "ratios" not in self.features and self.rng.random() < 0.2:
                self._add_force({"kind": "constant", "amplitude": self.number(-1.5, 1.5), **place})
                continue
            wave = {"frequency_hz": self.number(0.4, 4), "phase_deg": self.number(0, 360)}
            self._add_force({"kind": "sine", "amplitude": self.number(0.2, 2), **wave, **place})

    def _records(self) -> None:
        if "moved" not in self.features or self.rng.random() < 0.3:
            place = self._place()
            key = "moment_nm" if place.get("direction") == "torque" else "force_n"
            self._add_force({"kind": "record", **place, **self._record(key, 1.0)})

    def _add_force(self, force: dict[str, Any]) -> None:
        self.scene.setdefault("force", []).append(force)

    def _hoists(self) -> None:
        link = self._some_links()[0]
        for key in ("centre", "inertia"):
            link.pop(key, None)
        begin = self.number(-0.2, 0.4)
        law: dict[str, Any] = {"to": round(link["length"] * self.number(0.6, 1.4), 3), "begin": begin}
        law |= {"duration": self.number(0.5, 1.2)}
        way = self.rng.choice(["smooth", "trapezoidal", "record"])
        if way == "trapezoidal":
            law |= {"profile": way, "ramp": self.number(0.1, 0.5)}
        if way == "record":
            s = np.linspace(0, 1, 9)
            lengths = link["length"] + (law["to"] - link["length"]) * s**2 * (3 - 2 * s)
            law = {"time_s": (begin + law["duration"] * s).tolist(), "length_m": lengths.tolist()}
        link |= {"kind": "bob", "hoist": law}
        for force in self.scene.get("force", []):  # on a rope whose length changes there are no points but its bob
            force["on"] = force["on"].partition("@")[0]

    def _structures(self) -> None:
        for _ in range(self.rng.choice([0, 1, 1])):
            p = self.rng.randrange(len(self.scene["pendulum"]))
            links = self.scene["pendulum"][p]["links"]
            i = self.rng.randrange(len(links))
            ends = [f"ground@{self.number(-2, 2)},{self.number(1.5, 2.5)}"]
            ends += [f"{name}@{self.number(-0.5, 0.5)},{self.number(-1.2, -0.6)}" for name in self.names]
            other = self.rng.choice(ends)
            first = f"pendulum[{p}].links[{i}]"
            if links[i].get("hoist"):
                first, other = ends[:2]
            elif not other.startswith("ground") and self.rng.random() < 0.5:
                first = ends[0]
            spring = {"between": [first, other], "stiffness": self.number(1, 20), "damping": self.some(0.05, 0.5)}
            self.scene.setdefault("spring", []).append(spring)

    def _copies(self) -> None:
        for pendulum in self.scene["pendulum"]:
            pendulum["count"] = self.rng.choice([2, 2, 3])


def pair_of(number: int) -> tuple[str, str]:
    return PAIRS[number % len(PAIRS)]


def drawn(number: int) -> dict[str, Any]:
    """The scene of a number."""
    return Drawn(number, pair_of(number)).scene


# --------------------------------------------------------------------------------------- simultaneous switches


def three(scene: dict[str, Any]) -> dict[str, Any]:
    """Every pendulum three times, on what is three times as much."""
    tripled = json.loads(json.dumps(scene))
    for pendulum in tripled["pendulum"]:
        pendulum["count"] = 3 * pendulum.get("count", 1)
    supports = tripled.get("support", [])
    for support in supports if isinstance(supports, list) else [supports]:
        for key in ("mass", "inertia", "stiffness", "damping", "friction"):
            if isinstance(support.get(key), dict):
                support[key] = {way: 3 * value for way, value in support[key].items()}
            elif key in support:
                support[key] *= 3
    for spring in tripled.get("spring", []):
        if not any(end.startswith("pendulum") for end in spring["between"]):
            spring |= {key: 3 * spring[key] for key in ("stiffness", "damping")}
    for force in tripled.get("force", []):
        if not force["on"].startswith("pendulum"):
            for key in ("amplitude", "force_n", "moment_nm"):
                if key in force:
                    force[key] = [3 * x for x in force[key]] if isinstance(force[key], list) else 3 * force[key]
    return tripled


def mirrored(scene: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]] | None:
    """Every pendulum next to its mirror image, and what this is without it; None where a support moves sideways."""
    support = scene.get("support", {"kind": "fixed"})
    if isinstance(support, list):
        return None
    if any(motion["direction"] == "horizontal" for motion in support.get("motion", [])):
        return None
    both, alone = (json.loads(json.dumps(scene)) for _ in range(2))
    count = len(scene["pendulum"])
    both["pendulum"] += json.loads(json.dumps(scene["pendulum"]))
    for pendulum in both["pendulum"][count:]:
        pendulum["start"] = {key: [-x for x in values] for key, values in pendulum["start"].items()}
    for each in (both, alone):
        each["force"] = [force for force in scene.get("force", []) if force["on"] != "cart"]
    if support["kind"] == "cart":
        alone["support"] = {"kind": "fixed"}
    both["force"] += [_turned(force, count) for force in both["force"]]
    return both, alone


def _turned(force: dict[str, Any], count: int) -> dict[str, Any]:
    """The mirror image of a force on a pendulum, which stands `count` pendula further on."""
    image = json.loads(json.dumps(force))
    p = int(force["on"].split("[")[1].split("]")[0])
    image["on"] = force["on"].replace(f"pendulum[{p}]", f"pendulum[{p + count}]", 1)
    if force.get("direction", "horizontal") == "vertical":
        return dict(image)
    if force["kind"] == "sine":
        image["phase_deg"] = force["phase_deg"] + 180.0
    for key in ("force_n", "moment_nm"):
        if key in image:
            image[key] = [-x for x in image[key]]
    if force["kind"] == "constant":
        image["amplitude"] = -force["amplitude"]
    return dict(image)


# ------------------------------------------------------------------------------------------------------- engines


def numbers_of(state: Any) -> Floats:
    """Carriers, links, and their rates, (2, size)."""
    has_cart = not np.size(state.supports)
    supports, rates = (
        ([state.cart], [state.cart_rate]) if has_cart else (np.ravel(state.supports), np.ravel(state.support_rates))
    )
    return np.array([[*supports, *np.ravel(state.links)], [*rates, *np.ravel(state.link_rates)]], dtype=float)


def in_floats(scene: Scene, duration: float, tolerance: float) -> Floats:
    return numbers_of(simulate(scene, duration, output=2, tolerance=tolerance).final)


def side_by_side(engine: str) -> Callable[[Scene, float, float], Floats]:
    def end(scene: Scene, duration: float, tolerance: float) -> Floats:
        """Of one member by this engine."""
        options: dict[str, Any] = {"engine": engine, "workers": 1, "check": 0, "tolerance": tolerance}
        final = ensemble(scene, duration, starts=[initial_state(scene)], **options).final
        return numbers_of(final[0])

    return end


ENGINES: dict[str, Callable[[Scene, float, float], Floats]] = {
    "floats": in_floats,
    "numpy": side_by_side("numpy"),
    "numba": side_by_side("numba"),
}


class EndlessError(Exception):
    """A run that did not end in time."""


@contextmanager
def patience() -> Iterator[None]:
    def late(*_: Any) -> None:
        raise EndlessError(f"endless: more than {PATIENCE:g} s")

    signal.signal(signal.SIGALRM, late)
    signal.setitimer(signal.ITIMER_REAL, PATIENCE)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)


def apart(a: Floats, b: Floats) -> float:
    """The largest difference, of numbers above 1 relative to them; infinite where one is none."""
    differences = np.abs(a - b) / np.maximum(1.0, np.abs(b))
    return float(differences.max()) if np.isfinite(differences).all() else np.inf


def spread(end: Floats, scene: dict[str, Any], times: int) -> Floats:
    """The end of a scene with every copy so many times."""
    links = sum(len(p["links"]) * p.get("count", 1) for p in scene["pendulum"])
    first = end.shape[1] - links
    columns, at = list(range(first)), first
    for pendulum in scene["pendulum"]:
        for _ in range(pendulum.get("count", 1)):
            each = list(range(at, at + len(pendulum["links"])))
            at += len(each)
            columns += each * times
    return end[:, columns]


class Judged:
    """What a scene gave: differences from the oracle by engine, failures and refusals in words, seconds."""

    def __init__(self, number: int, duration: float = SECONDS, tolerance: float = TOLERANCE) -> None:
        self.number, self.duration, self.tolerance = number, duration, tolerance
        self.events, self.longest = 0, LONGEST
        self.ends: dict[str, Floats | None] = {}
        self.differences: dict[str, float] = {}
        self.failures: dict[str, str] = {}
        self.refused: dict[str, str] = {}
        self.seconds: dict[str, float] = {}

    @property
    def row(self) -> dict[str, Any]:
        """As it is kept."""
        head = {"number": self.number, "pair": pair_of(self.number), "events": self.events, "longest": self.longest}
        return {**head, **{name: getattr(self, name) for name in ("differences", "failures", "refused", "seconds")}}

    def _run(self, name: str, compute: Callable[..., Floats], scene: dict[str, Any]) -> Floats | None:
        begun = time.perf_counter()
        try:
            with patience():
                return compute(scene_from(scene), self.duration, self.tolerance)
        except SceneError as error:
            self.refused[name] = str(error)
            return None
        except Exception as error:
            told = traceback.extract_tb(error.__traceback__)[-1]
            self.failures[name] = f"{type(error).__name__}: {error} ({Path(told.filename).name}:{told.lineno})"[:500]
            return None
        finally:
            self.seconds[name] = round(time.perf_counter() - begun, 2)

    def places(self, scene: dict[str, Any], name: str = "oracle") -> Floats | None:
        """The end of a scene by the oracle."""

        def compute(built: Scene, duration: float, tolerance: float) -> Floats:
            oracle = SwitchedPlaces(built, self.longest)
            end = numbers_of(oracle.end(initial_state(built), duration, tolerance))
            self.events += oracle.events
            return end

        return self._run(name, compute, scene)

    def compare(self, engine: str, way: str, scene: dict[str, Any], true: Floats) -> None:
        """The end of a scene by an engine, with what it must be."""
        name = f"{engine} {way}".rstrip()
        if name not in self.ends:
            self.ends[name] = self._run(name, ENGINES[engine], scene)
        end = self.ends[name]
        if end is not None:
            self.differences[name] = apart(end, true)

    def judge(self, engines: Sequence[str], at_once: Mapping[str, Sequence[str]]) -> None:
        """All comparisons."""
        written, self.events = drawn(self.number), 0
        true = self.places(written)
        if true is None:
            return
        for engine in engines:
            self.compare(engine, "", written, true)
        for engine in at_once.get("three", ()):
            self.compare(engine, "three", three(written), spread(true, written, 3))
        images = mirrored(written) if at_once.get("mirrored") else None
        single = self.places(images[1], "alone") if images else None
        if images and single is not None:
            links = single[:, 1:]
            for engine in at_once["mirrored"]:
                self.compare(engine, "mirrored", images[0], np.hstack((0 * single[:, :1], links, -links)))


def judge(
    number: int,
    engines: Sequence[str] = tuple(ENGINES),
    at_once: Mapping[str, Sequence[str]] = NOTHING,
    duration: float = SECONDS,
    tolerance: float = TOLERANCE,
) -> dict[str, Any]:
    """A row of a scene by these engines, and where all switch `at_once` in the ways "three" and "mirrored" by those."""
    judged = Judged(number, duration, tolerance)
    judged.judge(engines, at_once)
    if wrong(judged.row):
        judged.longest = SHORT
        judged.judge(engines, at_once)
    return judged.row


def turns(number: int) -> dict[str, Sequence[str]]:
    """Both ways in floats, and one of them by one of the compiled engines."""
    way, engine = ("three", "mirrored")[number // 2 % 2], ("numpy", "numba")[number % 2]
    return {each: ("floats", *[engine] * (each == way)) for each in ("three", "mirrored")}


# --------------------------------------------------------------------------------------------------------- rows


def wrong(row: dict[str, Any]) -> bool:
    return bool(row["failures"]) or any(not each <= LIMIT for each in row["differences"].values())


def table(rows: list[dict[str, Any]]) -> str:
    """By pair: scenes, switches, largest differences, how many an engine refuses, and which of them fail."""
    kinds = [f"{engine}{way}" for way in ("", " three", " mirrored") for engine in ENGINES]
    lines = []
    for pair in [*PAIRS, None]:
        of_pair = [row for row in rows if pair is None or tuple(row["pair"]) == pair]
        if not of_pair:
            continue
        largest = [max((row["differences"].get(kind, 0.0) for row in of_pair), default=0.0) for kind in kinds]
        refused = sum(bool(row["refused"]) for row in of_pair)
        failing = ", ".join(str(row["number"]) for row in of_pair if wrong(row)) if pair else sum(map(wrong, of_pair))
        events = sum(row.get("events", 0) for row in of_pair)
        lines.append([" × ".join(pair) if pair else "all", len(of_pair), events, *largest, refused, failing])
    return tabulate(lines, ["pair", "scenes", "switches", *kinds, "refused", "wrong"], floatfmt=".0e")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=300)
    parser.add_argument("--from", type=int, default=0, dest="first")
    parser.add_argument("--only", type=int, nargs="+")
    parser.add_argument("--keep", type=Path)
    parser.add_argument("--all", action="store_true", help="all engines both ways")
    parser.add_argument("--table", action="store_true", help="compute nothing")
    arguments = parser.parse_args()
    rows: dict[int, dict[str, Any]] = {}
    if arguments.keep and arguments.keep.exists():
        rows = {row["number"]: row for row in map(json.loads, arguments.keep.read_text().splitlines())}
    numbers = arguments.only or range(arguments.first, arguments.first + arguments.scenes)
    everything = {way: tuple(ENGINES) for way in ("three", "mirrored")}
    warnings.simplefilter("ignore")
    for number in () if arguments.table else numbers:
        if number in rows and not arguments.only:
            continue
        with interpreted():
            rows[number] = judge(number, at_once=everything if arguments.all else turns(number))
        line = json.dumps(rows[number])
        if arguments.keep:
            with arguments.keep.open("a") as file:
                file.write(line + "\n")
        print(line, flush=True)
    kept = [rows[number] for number in sorted(rows)]
    print(table(kept))
    sys.exit(any(map(wrong, kept)))


if __name__ == "__main__":
    main()
