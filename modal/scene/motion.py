"""How a support moves: a sine, a sweep, a record, or one realization of a random process.

Displacements are in metres, positive along the rail (`direction = "horizontal"`) or upwards (`"vertical"`).  A file
named by a record or by a PSD is read with the scene file that names it (`modal.scene.records`); the scene holds its
numbers.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Literal

from modal.scene.validation import (
    NON_NEGATIVE,
    POSITIVE,
    REAL,
    Part,
    any_kind,
    before,
    field,
    list_of,
    number,
    one_of,
    optional,
)

Direction = Literal["horizontal", "vertical"]
Quantity = Literal["acceleration", "velocity", "displacement"]
FEWEST = 4  # samples of a record
LARGEST_SEED = 2**63 - 1
MOST_SINES = 20_000
RECORDED: dict[str, Quantity] = {
    "displacement_m": "displacement",
    "velocity_m_per_s": "velocity",
    "acceleration_m_per_s2": "acceleration",
}
"""What a record holds, by its key."""
UNREAD = "is read with the scene file that names it: load that file, or give the numbers themselves"


def _numbers(value: object) -> object:
    if isinstance(value, str):
        raise ValueError(UNREAD)
    return value


class Movement(Part):
    """A motion in one direction."""

    direction: Direction = field(one_of("horizontal", "vertical"), default="horizontal")


class SineMotion(Movement):
    """The displacement A sin(2π f t + φ), at all times t of the run."""

    kind: Literal["sine"] = field(one_of("sine"), default="sine")
    amplitude: float = field(NON_NEGATIVE)
    frequency_hz: float = field(POSITIVE)
    phase_deg: float = field(REAL, default=0.0)


class SweepMotion(Movement):
    """The displacement A sin(phase) with a frequency that rises or falls evenly over `duration` (s) from t = 0.

    Before and afterwards the frequency is constant.
    """

    kind: Literal["sweep"] = field(one_of("sweep"), default="sweep")
    amplitude: float = field(NON_NEGATIVE)
    from_hz: float = field(POSITIVE)
    to_hz: float = field(POSITIVE)
    duration: float = field(POSITIVE)


class RecordMotion(Movement):
    """Samples at `time_s` of the displacement, of the velocity or of the acceleration, joined by a spline.

    Before the first sample and after the last one the support moves on at a constant velocity.  `baseline` "velocity"
    takes out the constant acceleration by which the velocity at the end differs from that at the beginning.
    """

    kind: Literal["record"] = field(one_of("record"), default="record")
    file: str | None = field(optional({"type": "str", "max_length": 4096}), default=None)
    time_s: tuple[float, ...] | None = field(optional(list_of(REAL)), default=None)
    displacement_m: tuple[float, ...] | None = field(optional(list_of(REAL)), default=None)
    velocity_m_per_s: tuple[float, ...] | None = field(optional(list_of(REAL)), default=None)
    acceleration_m_per_s2: tuple[float, ...] | None = field(optional(list_of(REAL)), default=None)
    baseline: Literal["keep", "velocity"] = field(one_of("keep", "velocity"), default="keep")

    @property
    def samples(self) -> tuple[Quantity, tuple[float, ...]]:
        """What is recorded, and its values in SI units."""
        return next((own, value) for name, own in RECORDED.items() if (value := getattr(self, name)) is not None)

    def problems(self) -> Iterator[str]:
        """A file that is not read, missing or several quantities, and times that do not ascend."""
        if self.file is not None:
            yield f".file: {UNREAD}"
            return
        given = [name for name in RECORDED if getattr(self, name) is not None]
        if len(given) != 1 or self.time_s is None:
            yield f": needs a file, or time_s and one of {', '.join(RECORDED)}"
            return
        times, values = self.time_s, getattr(self, given[0])
        if len(times) != len(values):
            yield f".{given[0]}: has {len(values)} values for {len(times)} times"
        elif len(times) < FEWEST:
            yield f".time_s: has {len(times)} samples: at least {FEWEST} are needed"
        if any(later <= earlier for earlier, later in pairwise(times)):
            yield ".time_s: must be strictly ascending"


class RandomMotion(Movement):
    """One realization of a stationary random process with the one-sided power spectral density (PSD) `psd`.

    `psd` is that of the acceleration, in (m/s²)²/Hz, or of the quantity named by `of`; it is interpolated by straight
    lines over logarithmic axes and is zero outside `frequency_hz`.  The realization repeats after `duration` (s).
    """

    kind: Literal["random"] = field(one_of("random"), default="random")
    psd: tuple[float, ...] = field(before(_numbers, list_of(NON_NEGATIVE)))
    frequency_hz: tuple[float, ...] | None = field(optional(list_of(number(ge=0, le=1e100))), default=None)
    of: Quantity = field(one_of("acceleration", "velocity", "displacement"), default="acceleration")
    seed: int = field({"type": "int", "strict": True, "ge": 0, "le": LARGEST_SEED})
    duration: float = field(POSITIVE)

    def problems(self) -> Iterator[str]:
        """Frequencies that do not fit or do not ascend, a duration too short or too long for them."""
        if self.frequency_hz is None:
            yield ".frequency_hz: is required beside a list of psd"
            return
        found = list(spectrum_problems(self.frequency_hz, self.psd))
        yield from found
        if found:
            return
        sines = int(self.frequency_hz[-1] * self.duration)
        if sines < max(1.0, self.frequency_hz[0] * self.duration):
            yield f".duration = {self.duration!r}: holds no whole period of a frequency between those of the PSD"
        elif sines - self.frequency_hz[0] * self.duration > MOST_SINES:
            yield f".duration = {self.duration!r}: takes about {sines} sines: at most {MOST_SINES} are summed"


def spectrum_problems(frequencies: tuple[float, ...], psd: tuple[float, ...]) -> Iterator[str]:
    """What is wrong with a PSD, each line beginning with its key."""
    if len(frequencies) != len(psd):
        yield f".psd: has {len(psd)} values for {len(frequencies)} frequencies"
    elif len(psd) < 2:
        yield f".psd: has {len(psd)} values: at least 2 are needed"
    if any(later <= earlier for earlier, later in pairwise(frequencies)):
        yield ".frequency_hz: must be strictly ascending"


SupportMotion = SineMotion | SweepMotion | RecordMotion | RandomMotion


class Moved(Part):
    """A support that moves as prescribed."""

    kind: Literal["moved"] = field(one_of("moved"), default="moved")
    motion: SupportMotion = field(any_kind(SineMotion, SweepMotion, RecordMotion, RandomMotion))
