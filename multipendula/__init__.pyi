"""The namespace as type checkers see it; made by `python docs/namespace.py`."""

from collections.abc import Mapping
from collections.abc import Sequence
from os import PathLike
from typing import Any

from matplotlib.figure import Figure
from modal.assembly import Matrices
from modal.coupling import Coupling
from modal.errors import ComputationError as ComputationError
from modal.errors import MissingExtraError as MissingExtraError
from modal.errors import MultipendulaError as MultipendulaError
from modal.errors import SceneError as SceneError
from modal.modes import Mode as Mode
from modal.modes import Modes as Modes
from modal.modes import mode_energies as mode_energies
from modal.modes import natural_frequencies as natural_frequencies
from modal.modes import natural_modes as natural_modes
from modal.modes import sensitivities as sensitivities
from modal.scene import Bob as Bob
from modal.scene import Body as Body
from modal.scene import Carrier as Carrier
from modal.scene import Cart as Cart
from modal.scene import ConstantForce as ConstantForce
from modal.scene import Escapement as Escapement
from modal.scene import Fixed as Fixed
from modal.scene import Ground as Ground
from modal.scene import Heave as Heave
from modal.scene import Hoist as Hoist
from modal.scene import InitialCondition as InitialCondition
from modal.scene import LossTable as LossTable
from modal.scene import ModalSupport as ModalSupport
from modal.scene import Moved as Moved
from modal.scene import Pendulum as Pendulum
from modal.scene import Platform as Platform
from modal.scene import RandomForce as RandomForce
from modal.scene import RandomMotion as RandomMotion
from modal.scene import RecordForce as RecordForce
from modal.scene import RecordMotion as RecordMotion
from modal.scene import Rod as Rod
from modal.scene import Scene as Scene
from modal.scene import SineForce as SineForce
from modal.scene import SineMotion as SineMotion
from modal.scene import Spring as Spring
from modal.scene import SweepForce as SweepForce
from modal.scene import SweepMotion as SweepMotion
from modal.scene import Swing as Swing
from modal.scene import Tilt as Tilt
from modal.scene import VanDerPol as VanDerPol
from modal.scene import dumps as dumps
from modal.scene import example_names as example_names
from modal.scene import free_bodies as free_bodies
from modal.scene.links import Link as Link
from modal.scene.parameters import vary as vary
from modal.statespace import StateSpace as StateSpace
from modal.statespace import modal_gains as modal_gains
from modal.statespace import state_space as state_space
from modal.statespace.hoisting import Along
from modal.statespace.modal_form import Gains
from modal.statespace.shapers import Shaper
from modal.tuning import Tuned
from multipendula.functions import Text
from nonlinear import AppliedForces as AppliedForces
from nonlinear import Event as Event
from nonlinear import Motion as Motion
from nonlinear import SimulationError as SimulationError
from nonlinear import State as State
from nonlinear import Trajectory as Trajectory
from nonlinear import initial_state as initial_state
from nonlinear import level_crossing as level_crossing
from nonlinear import resume as resume
from nonlinear import state_at_rest as state_at_rest
from nonlinear import system_of as system_of
from nonlinear import turning_point as turning_point
from nonlinear.ensembles import Basins
from nonlinear.sweeps import Spread
from nonlinear.sweeps import Sweep

def scenes(
    name: str | PathLike[str] | None = None,
    *,
    schema: bool = False,
    output: str | PathLike[str] | None = None,
) -> Text: ...
def table(
    scene: Scene | str | PathLike[str],
    *,
    covariance: str | PathLike[str] | None = None,
    format: str = "text",
    output: str | PathLike[str] | None = None,
    modes: int | range | str | None = None,
    relative_error: float | None = None,
    amplitude: float | None = None,
    orbits: bool = False,
    columns: str | Sequence[str] | None = None,
    sensitivities: bool = False,
    energies: bool = False,
    shapes: bool = False,
    places: bool = False,
    prove: str | PathLike[str] | None = None,
    explain: bool = False,
) -> Modes | Any: ...
def shapes(
    scene: Scene | str | PathLike[str],
    *,
    output: str | PathLike[str] | None = None,
    theme: str = "light",
    modes: int | range | str | None = None,
    amplitude: float = 25.0,
) -> Figure | Any: ...
def matrices(
    scene: Scene | str | PathLike[str],
    *,
    format: str = "text",
    output: str | PathLike[str] | None = None,
) -> Matrices | Any: ...
def simulate(
    scene: Trajectory | Scene | str | PathLike[str] | None = None,
    duration: float | None = None,
    *,
    start: State | str | None = None,
    samples: int | None = None,
    method: str | None = None,
    form: str | None = None,
    tolerance: float | None = None,
    accuracy: float | None = None,
    keep_modes: int | None = None,
    proved: bool = False,
    compile: bool = False,
    format: str = "text",
    covariance: str | PathLike[str] | None = None,
    band: str | PathLike[str] | None = None,
    theme: str = "light",
    output: str | PathLike[str] | None = None,
    explain: bool = False,
) -> Trajectory | Any: ...
def plot(
    scene: Trajectory | Scene | str | PathLike[str],
    duration: float | None = None,
    *,
    start: State | str | None = None,
    samples: int | None = None,
    method: str | None = None,
    form: str | None = None,
    tolerance: float | None = None,
    accuracy: float | None = None,
    keep_modes: int | None = None,
    output: str | PathLike[str] | None = None,
    theme: str = "light",
) -> Figure | Any: ...
def animate(
    scene: Trajectory | Scene | str | PathLike[str],
    duration: float | None = None,
    *,
    start: State | str | None = None,
    samples: int | None = None,
    method: str | None = None,
    form: str | None = None,
    tolerance: float | None = None,
    accuracy: float | None = None,
    keep_modes: int | None = None,
    output: str | PathLike[str] | None = None,
    fps: float | None = None,
    speed: float = 1.0,
    seconds: float | None = None,
    theme: str = "light",
) -> Text: ...
def play(
    scene: Trajectory | Scene | str | PathLike[str],
    *,
    output: str | PathLike[str] | None = None,
) -> Text: ...
def orbits(
    scene: Scene | str | PathLike[str],
    mode: int | None = None,
    *,
    largest_angle: float | None = None,
    vary: str | Mapping[str, Any] | None = None,
    enter: bool = False,
    depth: int | None = None,
    periods: int | None = None,
    settled: bool = False,
    start: State | str | None = None,
    duration: float | None = None,
    format: str = "text",
    output: str | PathLike[str] | None = None,
    theme: str = "light",
    film: str | PathLike[str] | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
) -> Any: ...
def check(
    scene: Scene | str | PathLike[str],
    duration: float | None = None,
    *,
    start: State | str | None = None,
    samples: int | None = None,
    method: str | None = None,
    form: str | None = None,
    tolerance: float | None = None,
    accuracy: float | None = None,
    modes: int | range | str | None = None,
    amplitudes: float | Sequence[float] | None = None,
    general: bool = False,
    proved: bool = False,
    format: str = "text",
    output: str | PathLike[str] | None = None,
    theme: str = "light",
) -> Any: ...
def tradeoff(
    scene: Scene | str | PathLike[str],
    duration: float | None = None,
    *,
    start: State | str | None = None,
    proved: bool = False,
    linear: bool = False,
    relative_error: float | None = None,
    format: str = "text",
    output: str | PathLike[str] | None = None,
    theme: str = "light",
) -> Any: ...
def chaos(
    scene: Scene | str | PathLike[str],
    duration: float | None = None,
    *,
    members: int | None = None,
    quick: bool = False,
    workers: int | None = None,
    scheduler: str | None = None,
    output: str | PathLike[str] | None = None,
    theme: str = "light",
) -> Any: ...
def explain(
    scene: Scene | str | PathLike[str],
    *,
    format: str = "text",
    words: bool = False,
    output: str | PathLike[str] | None = None,
    theme: str = "light",
) -> Coupling | Any: ...
def sweep(
    scene: Scene | str | PathLike[str],
    vary: str | Sequence[str] | Mapping[str, Any] | None = None,
    *,
    measure: str | Sequence[str] | None = None,
    members: int | None = None,
    seed: int | None = None,
    loci: bool = False,
    strobe: bool = False,
    phase_deg: float | None = None,
    settle: float | None = None,
    of: str | Sequence[str] | None = None,
    output: str | PathLike[str] | None = None,
    picture: str | PathLike[str] | None = None,
    theme: str = "light",
    workers: int | None = None,
    scheduler: str | None = None,
    share: tuple[int, int] | str | None = None,
    folder: str | None = None,
    fresh: bool = False,
) -> Any: ...
def sync(
    scene: Scene | str | PathLike[str],
    duration: float | None = None,
    *,
    start: State | str | None = None,
    vary: str | Sequence[str] | Mapping[str, Any] | None = None,
    map: bool = False,
    members: int | None = None,
    spread: float | None = None,
    seed: int | None = None,
    folder: str | None = None,
    format: str = "text",
    words: bool = False,
    output: str | PathLike[str] | None = None,
    theme: str = "light",
    film: str | PathLike[str] | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
) -> Any: ...
def basins(
    scene: Scene | str | PathLike[str],
    vary: str | Sequence[str] | Mapping[str, Any] | None = None,
    *,
    measure: str | None = None,
    duration: float | None = None,
    engine: str = "auto",
    tolerance: float | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    share: tuple[int, int] | str | None = None,
    folder: str | None = None,
    format: str = "text",
    output: str | PathLike[str] | None = None,
    theme: str = "light",
) -> Basins | Any: ...
def section(
    scene: Scene | str | PathLike[str],
    duration: float | None = None,
    *,
    energy: float | None = None,
    crossing: str | None = None,
    members: int | None = None,
    spread: float | None = None,
    seed: int | None = None,
    phase_deg: float | None = None,
    settle: float | None = None,
    of: str | Sequence[str] | None = None,
    engine: str = "auto",
    tolerance: float | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    share: tuple[int, int] | str | None = None,
    folder: str | None = None,
    format: str = "text",
    output: str | PathLike[str] | None = None,
    theme: str = "light",
) -> Any: ...
def spread(
    scene: Scene | str | PathLike[str],
    uncertain: str | Sequence[str] | Mapping[str, Any] | None = None,
    *,
    covariance: str | PathLike[str] | None = None,
    members: int | None = None,
    seed: int | None = None,
    measure: str | Sequence[str] | None = None,
    duration: float | None = None,
    engine: str = "auto",
    tolerance: float | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    share: tuple[int, int] | str | None = None,
    folder: str | None = None,
    format: str = "text",
    output: str | PathLike[str] | None = None,
    theme: str = "light",
) -> Spread | Any: ...
def fit(
    scene: Scene | str | PathLike[str],
    data: str | PathLike[str] | Sequence[str],
    free: str | Sequence[str] | None = None,
    *,
    where: str | Sequence[str] | Mapping[str, Any] | None = None,
    every: int | None = None,
    column: str | Sequence[str] | Mapping[str, Any] | None = None,
    pixel: float | None = None,
    angles: str = "absolute",
    prior: str | Sequence[str] | Mapping[str, Any] | None = None,
    scale: bool = False,
    shift: bool = False,
    loss: str = "linear",
    window: float | None = None,
    bootstrap: int | None = None,
    compare: str | Sequence[str] | None = None,
    output: str | PathLike[str] | None = None,
    report: str | PathLike[str] | None = None,
    picture: str | PathLike[str] | None = None,
    theme: str = "light",
    workers: int | None = None,
    scheduler: str | None = None,
    format: str = "text",
) -> Any: ...
def poles(
    data: str | PathLike[str] | Sequence[str],
    *,
    where: str | Sequence[str] | Mapping[str, Any] | None = None,
    every: int | None = None,
    column: str | Sequence[str] | Mapping[str, Any] | None = None,
    pixel: float | None = None,
    angles: str = "absolute",
    scene: Scene | str | PathLike[str] | None = None,
    excitation: str = "free",
    identification: str = "era",
    order: int | None = None,
    format: str = "text",
    identified_modes: str | PathLike[str] | None = None,
    output: str | PathLike[str] | None = None,
    theme: str = "light",
) -> Any: ...
def export(
    scene: Scene | str | PathLike[str],
    to: str | None = None,
    *,
    input: str | Sequence[str] | None = None,
    signals: str | Sequence[str] | None = None,
    when: float | None = None,
    output: str | PathLike[str] | None = None,
    discrete: float | None = None,
    minimal: bool = False,
    dominant: int | None = None,
    start: State | str | None = None,
    along: str | None = None,
) -> StateSpace | Any: ...
def response(
    scene: Scene | str | PathLike[str],
    *,
    covariance: str | PathLike[str] | None = None,
    input: str | Sequence[str] | None = None,
    signals: str | Sequence[str] | None = None,
    when: float | None = None,
    output: str | PathLike[str] | None = None,
    theme: str = "light",
    at: float | Sequence[float] | None = None,
    format: str = "text",
    source: str | None = None,
    of: str | Sequence[str] | None = None,
    impulse: bool = False,
    gains: bool = False,
    lqr: bool = False,
    weights: str | None = None,
) -> Gains | Any: ...
def shaper(
    scene: Scene | str | PathLike[str],
    *,
    covariance: str | PathLike[str] | None = None,
    kind: str | None = None,
    range: str | None = None,
    discrete: float | None = None,
    residual: float = 5.0,
    count: int = 1,
    drive: str | None = None,
    travel: float | None = None,
    over: float | None = None,
    max_acceleration: float | None = None,
    max_speed: float | None = None,
    max_jerk: float | None = None,
    output: str | PathLike[str] | None = None,
    picture: str | PathLike[str] | None = None,
    theme: str = "light",
) -> Shaper | Any: ...
def hoist(
    scene: Scene | str | PathLike[str],
    *,
    samples: int = 11,
    drive: str | None = None,
    travel: float | None = None,
    over: float | None = None,
    max_acceleration: float | None = None,
    max_speed: float | None = None,
    max_jerk: float | None = None,
    kind: str | None = None,
    count: int | None = None,
    format: str = "text",
    output: str | PathLike[str] | None = None,
    theme: str = "light",
) -> Along | Any: ...
def vibration(
    scene: Scene | str | PathLike[str],
    *,
    psd: float | str | PathLike[str] | None = None,
    temperature: float | None = None,
    at: float | Sequence[float] | None = None,
    record: float | str | PathLike[str] | None = None,
    column: str | Sequence[str] | Mapping[str, Any] | None = None,
    baseline: str = "keep",
    input: str | Sequence[str] = "support_acceleration",
    signals: str | Sequence[str] | None = None,
    format: str = "text",
    output: str | PathLike[str] | None = None,
    picture: str | PathLike[str] | None = None,
    theme: str = "light",
) -> Any: ...
def tune(
    scene: Scene | str | PathLike[str],
    free: str | Sequence[str] | None = None,
    *,
    minimize: str | Sequence[str] | None = None,
    maximize: str | Sequence[str] | None = None,
    max: str | Sequence[str] | Mapping[str, Any] | None = None,
    over_hz: tuple[float, float] | str | None = None,
    psd: float | str | PathLike[str] | None = None,
    mode: int | Sequence[int] | None = None,
    travel: float | None = None,
    over: float | None = None,
    kind: str | None = None,
    robust: bool = False,
    largest_angle: float | None = None,
    output: str | PathLike[str] | None = None,
    report: str | PathLike[str] | None = None,
    picture: str | PathLike[str] | None = None,
    theme: str = "light",
    workers: int | None = None,
    scheduler: str | None = None,
    format: str = "text",
) -> Tuned | Any: ...
def derive(
    target: Scene | str | PathLike[str],
    *,
    symbolic: str | Sequence[str] | None = None,
    show: str | Sequence[str] | None = None,
    links: str = "bob",
    equilibrium: str | Sequence[str] | None = None,
    names: str | None = None,
    parts: int | range | str | None = None,
    format: str = "text",
    output: str | PathLike[str] | None = None,
    theme: str = "light",
) -> Text: ...
def enclose(
    scene: Scene | str | PathLike[str],
    *,
    digits: int = 30,
    output: str | PathLike[str] | None = None,
) -> Any: ...
def load(
    source: str | PathLike[str],
) -> Scene | Any: ...
def save(
    thing: Scene | Trajectory | Sweep,
    path: str | PathLike[str],
) -> None: ...
