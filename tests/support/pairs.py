"""Every kind of scene by every capability, tried as a user would: by the command where there is one.

A pair works, is refused with one of the project's messages, breaks with any other exception, or gives no answer within
so many seconds of processor time.
"""

from __future__ import annotations

import contextlib
import io
import signal
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from itertools import count
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
import pytest
from loops import interpreted

from modal.errors import MultipendulaError
from modal.scene import CAPABILITIES, Scene, left_out, load, refusals
from multipendula import cli
from nonlinear.accuracy import Candidate, work_precision
from nonlinear.ensembles import ensemble
from nonlinear.simulation import simulate
from nonlinear.system import AppliedForces, State

SCENES = Path(__file__).parents[1] / "combinations" / "scenes"
PATIENCE = 20.0
"""Seconds of processor time that an answer may take."""
EXTRA = "in a clone of multipendula"  # how messages name what is not installed
GRAVITY = "--vary gravity=9.8:9.9:2"
FIRST, SECOND = "pendulum[0].start.angles_deg[0]", "pendulum[0].start.angles_deg[1]"
GRID = f"--vary {FIRST}=5:10:2 --vary {SECOND}=5:10:2"


@dataclass(frozen=True)
class Outcome:
    """What became of a pair, with the message or the output: works, refused, absent (an extra), breaks, silent."""

    status: str
    words: str = ""


class _Late(BaseException):
    """No answer in time."""


@contextlib.contextmanager
def _patiently(seconds: float) -> Iterator[None]:
    """Raise `_Late` after so many seconds of processor time, and again where a library swallows it.

    Not while numba compiles: what is left half made there is a failure of its own.
    """

    def late(number: int, frame: FrameType | None) -> None:
        while frame is not None:
            if frame.f_globals.get("__name__", "").startswith(("numba.", "llvmlite.")):
                return
            frame = frame.f_back
        raise _Late

    if not hasattr(signal, "SIGPROF"):
        yield
        return
    before = signal.signal(signal.SIGPROF, late)
    signal.setitimer(signal.ITIMER_PROF, seconds, 1.0)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def push(time: float, state: State) -> AppliedForces:
    """A load that every scene can take: moments on all links."""
    moments = np.zeros_like(state.links)
    moments[..., 0] = 0.3 * np.sin(2.0 * time)
    return AppliedForces(0.0, moments)


def _command(words: str, scene: Path, folder: Path) -> str:
    """Run `multipendula words`, with @ for the scene and # for a file in the folder."""
    said = io.StringIO()
    arguments = [word.replace("@", str(scene)).replace("#", str(folder / "out")) for word in words.split()]
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        status = cli.main(arguments)
    if status:
        raise RefusedError(said.getvalue())
    written = [sha256(path.read_bytes()).hexdigest() for path in sorted(folder.glob("out*"))]
    return "\n".join([said.getvalue(), *written])


class RefusedError(MultipendulaError):
    """A command ended with a message."""


def _motion(path: Path, scene: Scene, **options: Any) -> str:
    if path.stem == "load":
        options |= {"load": push, "breaks": []}
    run = simulate(scene, 1.0, output=11, **options)
    return repr([run.motion.links.tolist(), run.motion.cart.tolist()])


def _members(path: Path, scene: Scene, engine: str) -> str:
    """Of engine numba the loop as Python runs it: compiled forms are compared in `tests/ensembles`."""
    with interpreted() if engine == "numba" else contextlib.nullcontext():
        runs = ensemble(scene, 1.0, vary={"gravity": [9.8, 9.81, 9.82, 9.83]}, engine=engine, workers=1)
    return f"{runs.engine} {runs.column('links_rad').tolist()}"


def _fit(path: Path, scene: Scene, folder: Path) -> str:
    run = simulate(scene, 2.0, output=201)
    rng = np.random.default_rng(0)
    links = run.motion.links if run.motion.links.ndim == 2 else run.motion.links[..., 0]
    data = np.column_stack((run.times, links + 1e-3 * rng.standard_normal(links.shape)))
    names = [label.replace("[", "_").replace(",", "_").rstrip("]") for label in run.system.labels[run.system.first :]]
    header = ",".join(["time_s", *(f"{name}_rad" for name in names[: links.shape[1]])])
    np.savetxt(folder / "data.csv", data, delimiter=",", header=header, comments="")
    free = "damping" if scene.is_hoisted else "length"
    return _command(f"fit @ {folder / 'data.csv'} --free pendulum[0].links[0].{free}", path, folder)


def _vibration(path: Path, scene: Scene, folder: Path) -> str:
    (folder / "psd.csv").write_text("frequency_hz,psd\n0.1,0.01\n10,0.01\n")
    return _command(f"vibration @ --psd {folder / 'psd.csv'}", path, folder)


def _shock(path: Path, scene: Scene, folder: Path) -> str:
    times = np.arange(81) * 0.025
    rows = "\n".join(f"{t},{a}" for t, a in zip(times, np.sin(3 * times) * np.exp(-times), strict=True))
    (folder / "quake.csv").write_text("time_s,acceleration_m_per_s2\n" + rows + "\n")
    return _command(f"vibration @ --record {folder / 'quake.csv'}", path, folder)


Attempt = Callable[[Path, Scene, Path], str]


def _by(words: str) -> Attempt:
    return lambda path, scene, folder: _command(words, path, folder)


def _compared_with_modes(path: Path, scene: Scene, folder: Path) -> str:
    links = scene.n_links if scene.is_structured else scene.pendulum[0].n_links
    return _command(
        f"check @ --general --start angles:{','.join(['5', *['0'] * (links - 1)])} --duration 2", path, folder
    )


def _followed(path: Path, scene: Scene, folder: Path) -> str:
    begin = "" if scene.is_forced else " --settled --start scene --duration 20"
    return _command(f"orbits @ {GRAVITY}{begin} --format json", path, folder)


def first_of_each_family(candidates: Sequence[Candidate]) -> list[Candidate]:
    """In their order."""
    firsts: dict[str, Candidate] = {}
    for candidate in candidates:
        firsts.setdefault(candidate.family, candidate)
    return [*firsts.values()]


def _compared(path: Path, scene: Scene, folder: Path) -> str:
    """The loosest candidate of each family, once: omissions are reported by family, with reasons."""
    every = work_precision.list_candidates
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(work_precision, "perf_counter", count().__next__)
        patch.setattr(work_precision, "list_candidates", lambda scene: first_of_each_family(every(scene)))
        return _command("tradeoff @ --duration 0.2", path, folder)


def _simulated(**options: Any) -> Attempt:
    return lambda path, scene, folder: _motion(path, scene, **options)


def _ensemble(engine: str) -> Attempt:
    return lambda path, scene, folder: _members(path, scene, engine)


ATTEMPTS: dict[str, Attempt] = {
    "table": _by("table @ --format json"),
    "shapes": _by("shapes @ -o #.png"),
    "matrices": _by("matrices @"),
    "explain": _by("explain @"),
    "check": _by("check @ --modes 2 --amplitudes 5"),
    "check general": _compared_with_modes,
    "simulate": _simulated(),
    "simulate maximal": _simulated(form="maximal"),
    "simulate hamiltonian": _simulated(form="hamiltonian"),
    "simulate RK45": _simulated(method="RK45"),
    "simulate Radau": _simulated(method="Radau"),
    "simulate taylor": _simulated(method="taylor"),
    "simulate accuracy": _simulated(accuracy=1e-4),
    "ensemble auto": _ensemble("auto"),
    "ensemble numpy": _ensemble("numpy"),
    "ensemble numba": _ensemble("numba"),
    "orbits mode": _by("orbits @ --mode 2 --largest-angle 10 --format json"),
    "orbits vary": _followed,
    "sync": _by("sync @ --duration 5"),
    "sync vary": _by(f"sync @ {GRAVITY}"),
    "motion": _by("export @ --start mode:1:5 --to json -o #.json"),
    "chaos": _by("chaos @ --duration 7 --members 2"),
    "section": _by("section @ --members 2 --duration 2 --workers 1"),
    "energies": _by("sweep @ --vary start.energy=0.5,1 --members 2 --measure largest_angle:1 --workers 1"),
    "attractors": _by(f"basins @ {GRID} --measure attractor --duration 75 --workers 1"),
    "strobes": _by("sweep @ --vary gravity=9:10:2 --strobe --settle 5 --workers 1"),
    "basins": _by(f"basins @ {GRID} --measure largest_angle --duration 1 --workers 1"),
    "fit": _fit,
    "sweep": _by("sweep @ --vary gravity=9:10:2 --workers 1 -o #.csv"),
    "sweep floquet": _by("sweep @ --vary gravity=9:10:2 --measure floquet --workers 1 -o #.csv"),
    "response": _by("response @ --at 0.1,1"),
    "impulse": _by("response @ --impulse -o #.csv"),
    "gains": _by("response @ --gains"),
    "shaper": _by("shaper @"),
    "tune": _by("tune @ --free pendulum[0].links[0].damping=0.01:1 --maximize damping --mode 2"),
    "export": _by("export @ --to json -o #.json"),
    "vibration": _vibration,
    "thermal noise": _by("vibration @ --temperature 300 --signals angles --at 0.1,1"),
    "shock": _shock,
    "play": _by("play @ -o #.html"),
    "derive": _by("derive @ --show matrices"),
    "derive freebody": _by("derive @ --show freebody -o #.svg"),
    "enclose": _by("enclose @ --digits 10"),
    "spread": _by("spread @ --uncertain gravity=1% --members 20 --workers 1"),
    "spread motion": _by("spread @ --uncertain gravity=1% --members 8 --duration 1 --workers 1"),
    "keep modes": _by("simulate @ --keep-modes 1 --duration 1 -o #.csv"),
    "tradeoff": _compared,
    "proved": _by("simulate @ --proved --duration 0.1 --samples 2"),
    "advise": _by("simulate @ --accuracy 1e-3 --duration 1"),
    "plot": _by("plot @ --duration 1 -o #.png"),
}
ASKS: dict[str, tuple[str, ...]] = {
    "table": ("the table of modes",),
    **dict.fromkeys(("shapes", "matrices"), ("mode shapes",)),
    "explain": ("the explanation of the coupling",),
    "check": ("a check of modes",),
    "check general": ("a comparison with modes",),
    "simulate maximal": ("form maximal",),
    "simulate hamiltonian": ("form hamiltonian",),
    "simulate RK45": ("a method other than DOP853",),
    "simulate Radau": ("an implicit method",),
    "simulate taylor": ("method taylor",),
    "proved": ("a proved motion",),
    "ensemble auto": ("an ensemble",),
    "ensemble numpy": ("an ensemble", "engine numpy"),
    "ensemble numba": ("an ensemble", "engine numba"),
    "orbits mode": ("a periodic orbit of a mode",),
    "orbits vary": ("a limit cycle",),
    "sync": ("synchronization",),
    "sync vary": ("a branch of configurations",),
    "chaos": ("a Lyapunov exponent",),
    "section": ("a Poincaré section",),
    "energies": ("a start by its energy",),
    "attractors": ("a limit cycle",),
    "strobes": ("a stroboscopic section",),
    "basins": ("an ensemble",),
    "fit": ("a fit of motions",),
    "sweep": ("the table of modes",),
    "sweep floquet": ("a Floquet multiplier",),
    "response": ("a frequency response",),
    "impulse": ("an impulse response",),
    "motion": ("a model along a motion",),
    "gains": ("a constant linear model",),
    "export": ("a constant linear model",),
    "vibration": ("random vibration",),
    "thermal noise": ("thermal noise",),
    "shock": ("a shock",),
    "shaper": ("a shaper",),
    "tune": ("tuning",),
    "play": ("the live page",),
    "derive": ("a derivation",),
    "derive freebody": ("a free-body diagram",),
    "enclose": ("an enclosure",),
    "spread": ("the table of modes",),
    "spread motion": ("an ensemble",),
    "keep modes": ("motion in a few modes",),
    "tradeoff": ("a comparison of methods",),
}
"""The capability that each requires; of others, the form of the equations of motion."""
UNDAMPED = (
    *(
        "bob",
        "rod",
        "body",
        "cart",
        "cart_m_0",
        "count_100",
        "quadratic_drag",
        "moved_vertical",
    ),
    *(
        "moved_horizontal",
        "moved_both_ways",
        "force",
        "constant_force",
        "joint_springs",
        "rotor",
        "inverted",
        "space",
        "load",
    ),
    *("joint_friction", "rail_friction", "rail_coefficient", "space_and_cart"),
)
"""Kinds without anything that dissipates near the equilibrium."""
DRIVEN = {
    "attractors": ("an attractor",),
    "section": ("a stroboscopic section",),
    "orbits vary": ("a forced periodic orbit",),
}
"""What stands there instead for a scene that is driven in time."""
BEYOND = {
    **dict.fromkeys((("count_100", "fit"), ("count_100", "proved")), "at most"),
    ("count_100", "play"): "cannot show more than",
    ("structure", "tune"): "nothing damps mode 2",
    **dict.fromkeys((("count_100", "derive"), ("count_100", "tune")), "at most"),
    **dict.fromkeys((("hoist", "export"), ("hoist_and_drag", "export")), "holds a constant model"),
    ("moved_horizontal", "sweep floquet"): "along the rail only",
    ("count_100", "section"): "no motion of this energy",
    ("count_100", "energies"): "no start drawn at random has this energy",
    ("loss", "fit"): "does not support loss angles",
    **dict.fromkeys(((kind, "thermal noise") for kind in UNDAMPED), "nothing dissipates in this scene"),
    **dict.fromkeys((("escapement", "orbits vary"), ("van_der_Pol", "orbits vary")), "no limit cycle was found"),
}
"""Pairs that are refused for their numbers, not for a feature, with words of the message."""
MINUTES = {("count_100", "chaos"), ("count_100", "orbits mode"), ("count_100", "ensemble numba")}
"""Pairs that take minutes, which the commands say beforehand, or as Python."""
LOADED = tuple(name for name in ATTEMPTS if name.startswith("simulate"))
"""What takes a load, which a scene file has not."""


def declared(kind: str, capability: str) -> tuple[str, tuple[str, ...]]:
    """What the table says of a pair, works, refused or unless, and words that the answer has."""
    scene, more = load(kinds()[kind]), ("load",) if kind == "load" else ()
    form = "form spatial" if scene.space == "space" else "form minimal"
    asked = (DRIVEN if scene.is_forced else ASKS).get(capability, ASKS.get(capability, (form,)))
    if (kind, capability) in BEYOND:
        return "refused", (BEYOND[kind, capability],)
    if reasons := next(filter(None, (refusals(scene, name, *more) for name in asked)), []):
        return "refused", tuple(reasons)
    ends = [
        words for name in asked for feature, words in CAPABILITIES[name].unless.items() if feature in scene.features
    ]
    if ends:
        return "unless", tuple(ends)
    return "works", tuple(words for name in asked for words in left_out(scene, name))


def _links_without(**numbers: Any) -> Callable[[Scene], Scene]:
    def plain(scene: Scene) -> Scene:
        pendula = [
            pendulum.replace(links=tuple(link.replace(**numbers) for link in pendulum.links))
            for pendulum in scene.pendulum
        ]
        return scene.replace(pendulum=tuple(pendula))

    return plain


OFF: dict[str, tuple[str, Callable[[Scene], Scene]]] = {
    "damping_ratio": ("damping_ratio", lambda scene: scene.replace(damping_ratio=0.0)),
    "escapement": ("escapement", _links_without(drive=None)),
    "van_der_Pol": ("van_der_pol", _links_without(drive=None)),
    "hoist": ("hoist", lambda scene: scene.at(0.0)),
    "joint_dampers": ("dampers", _links_without(damping=0.0)),
    "joint_friction": ("joint_friction", lambda scene: scene.frictionless),
    "rail_friction": ("rail_friction", lambda scene: scene.frictionless),
    "rail_coefficient": ("rail_coefficient", lambda scene: scene.frictionless),
    "joint_springs": ("joint_springs", _links_without(stiffness=0.0)),
    "rotor": ("rotor", _links_without(rotor_inertia=0.0)),
    "linear_drag": ("linear_drag", _links_without(drag=0.0)),
    "quadratic_drag": ("quadratic_drag", _links_without(quadratic_drag=0.0)),
    "moved_horizontal": ("moved_support", lambda scene: scene.still),
    "moved_vertical": ("moved_support", lambda scene: scene.still),
    "moved_both_ways": ("moved_support", lambda scene: scene.still),
    "force": ("force", lambda scene: scene.replace(force=())),
    "constant_force": ("constant_force", lambda scene: scene.replace(force=())),
    "feedback": ("feedback", lambda scene: scene.replace(feedback=())),
    "loss": ("loss", lambda scene: scene.lossless),
    "springs": ("springs", lambda scene: scene.replace(spring=())),
}
"""The feature of a kind, and how to switch it off."""
TIMED = {"tradeoff", "advise"}
"""What prints how long it took, so that no two answers are equal."""


def guarded() -> list[tuple[str, str]]:
    """Pairs in which a feature is taken or omitted, and can be switched off."""
    return [
        (kind, candidate)
        for kind, candidate in pairs()
        if kind in OFF and candidate not in TIMED and declared(kind, candidate)[0] == "works"
    ]


def entry(kind: str, capability: str) -> str:
    """What the table says of the feature of a kind: takes, singly or leaves."""
    forced = DRIVEN if load(kinds()[kind]).is_forced else ASKS
    asked = forced.get(capability, ASKS.get(capability, ("form minimal",)))
    return CAPABILITIES[asked[-1]].entries(OFF[kind][0])[0][0]


@cache
def kinds() -> dict[str, Path]:
    """The kinds of scene by name."""
    return {path.stem: path for path in sorted(SCENES.glob("*.toml"))}


def pairs() -> list[tuple[str, str]]:
    """Every pair that can be asked for."""
    return [
        (kind, capability)
        for kind in kinds()
        for capability in ATTEMPTS
        if (kind != "load" or capability in LOADED) and (kind, capability) not in MINUTES
    ]


def attempt(kind: str | Path, capability: str, folder: Path, patience: float | None = None) -> Outcome:
    """Try a pair, of a kind of scene or of a file; files go into the folder."""
    path = kinds()[kind] if isinstance(kind, str) else kind
    try:
        with _patiently(patience or PATIENCE):
            return Outcome("works", ATTEMPTS[capability](path, load(path), folder))
    except MultipendulaError as refusal:
        words = str(refusal)
        return Outcome("absent" if EXTRA in words else "refused", words)
    except _Late:
        return Outcome("silent")
    except Exception as error:
        return Outcome("breaks", f"{type(error).__name__}: {error}")
