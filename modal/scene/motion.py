"""Prescribed time histories: motions of supports and forces on a scene.

Both are a sine, a sweep, a record, or one realization of a random process; a force may also be constant.  Displacements
are in metres, forces in newtons, positive along the rail (`direction = "horizontal"`) or upwards (`"vertical"`);
torques in newton metres are positive as angles are.  A file named by a record or by a PSD is read with the scene file
that names it (`modal.scene.records`); the scene holds its numbers.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from itertools import pairwise
from typing import Literal

from modal.scene.contents import MEASURED_MIN
from modal.scene.points import point_text
from modal.scene.stored import OneOrSeveralKinds, Several, SeveralOrNone
from modal.scene.validation import (
    FILE_NAME,
    NON_NEGATIVE,
    POSITIVE,
    REAL,
    REALS_OR_NONE,
    UNREAD,
    Part,
    any_kind,
    curve_problems,
    field,
    function_after,
    function_before,
    list_of,
    number,
    one_of,
    one_or_list,
    optional,
    refuse_file,
    text,
)

Direction = Literal["horizontal", "vertical"]
Acting = Literal["horizontal", "vertical", "torque"]
Quantity = Literal["acceleration", "velocity", "displacement"]
SINES_MAX = 20_000
"""Limit: sines of a random motion; more are refused."""
RECORDED: dict[str, Quantity] = {
    "displacement_m": "displacement",
    "velocity_m_per_s": "velocity",
    "acceleration_m_per_s2": "acceleration",
}
"""What a record of a motion holds, by its key."""
FORCES = ("force_n", "moment_nm")
"""The keys of a record of a force, and of a torque."""


class SineSignal(Part):
    """The value A sin(2π f t + φ), at all times t of the run."""

    kind: Literal["sine"] = field(one_of("sine"), default="sine")
    amplitude: float = field(NON_NEGATIVE, "largest value", "m, of a force N or N m")
    frequency_hz: float = field(POSITIVE, "positive", "Hz")
    phase_deg: float = field(REAL, "at t = 0", "°", default=0.0)


class SweepSignal(Part):
    """The value A sin(phase) with a frequency that rises or falls evenly over `duration` (s) from t = 0.

    Before and afterwards the frequency is constant.
    """

    kind: Literal["sweep"] = field(one_of("sweep"), default="sweep")
    amplitude: float = field(NON_NEGATIVE, "largest value", "m, of a force N or N m")
    from_hz: float = field(POSITIVE, "frequency at the beginning", "Hz")
    to_hz: float = field(POSITIVE, "frequency at the end", "Hz")
    duration: float = field(POSITIVE, "of the sweep, from t = 0", "s")


Interpolation = Literal["auto", "linear", "cubic"]
INTERPOLATION = one_of("auto", "linear", "cubic")
NO_LINES = "straight lines would change the velocity at once, which takes an infinite force: write auto or cubic"


class RecordSignal(Part):
    """Samples at `time_s`, joined by a spline, or as `interpolation` says."""

    kind: Literal["record"] = field(one_of("record"), default="record")
    file: str | None = field(FILE_NAME, "name of a CSV file with time_s and samples", default=None)
    time_s: SeveralOrNone[float] = field(REALS_OR_NONE, "times of at least 4 samples", "s", default=None)
    interpolation: Interpolation = field(
        INTERPOLATION, "between samples; auto: a spline, lines where it would leave their range", default="auto"
    )

    def recorded_problems(self, keys: tuple[str, ...]) -> Iterator[str]:
        """A file that is not read, missing or several quantities of these keys, and times that do not ascend."""
        if self.file is not None:
            yield f".file: {UNREAD}"
            return
        present_keys = [name for name in keys if getattr(self, name) is not None]
        if len(present_keys) != 1 or self.time_s is None:
            yield f": needs a file, or time_s and {'one of ' if len(keys) > 1 else ''}{', '.join(keys)}"
            return
        (key,), times = present_keys, self.time_s
        yield from curve_problems("time_s", key, times, getattr(self, key), least=4)  # of a cubic spline
        if any(0 < later - earlier < MEASURED_MIN for earlier, later in pairwise(times)):
            yield f".time_s: has samples less than {MEASURED_MIN:g} s apart"


class RandomSignal(Part):
    """One realization of a stationary random process with the one-sided power spectral density (PSD) `psd`.

    The PSD is interpolated linearly on logarithmic axes and is zero outside `frequency_hz`.  The realization
    repeats after `duration` (s).
    """

    kind: Literal["random"] = field(one_of("random"), default="random")
    psd: Several[float] = field(
        function_before(refuse_file, list_of(NON_NEGATIVE)), "one-sided power spectral density", "square of the unit/Hz"
    )
    frequency_hz: SeveralOrNone[float] = field(
        optional(list_of(number(ge=0, le=1e100))), "frequencies of the PSD", "Hz", default=None
    )
    seed: int = field(
        {"type": "int", "strict": True, "ge": 0, "le": sys.maxsize}, "equal seeds give equal realizations"
    )
    duration: float = field(POSITIVE, "after which it repeats", "s")

    def problems(self) -> Iterator[str]:
        """Frequencies that are inconsistent or not ascending, a duration too short or too long for them."""
        yield from super().problems()
        if self.frequency_hz is None:
            yield ".frequency_hz: is required with a list of psd"
            return
        problems = list(curve_problems("frequency_hz", "psd", self.frequency_hz, self.psd, least=2))
        yield from problems
        if problems:
            return
        sines = int(self.frequency_hz[-1] * self.duration)
        if sines < max(1.0, self.frequency_hz[0] * self.duration):
            yield f".duration = {self.duration!r}: holds no whole period of a frequency between those of the PSD"
        elif sines - self.frequency_hz[0] * self.duration > SINES_MAX:
            yield f".duration = {self.duration!r}: takes about {sines} sines: at most {SINES_MAX} are summed"


# --------------------------------------------------------------------------------------------- motion of a support


class Movement(Part):
    """A motion in one direction."""

    direction: Direction = field(one_of("horizontal", "vertical"), "vertical: upwards", default="horizontal")


class SineMotion(SineSignal, Movement):
    """The displacement A sin(2π f t + φ), at all times t of the run."""


class SweepMotion(SweepSignal, Movement):
    """The displacement A sin(phase) with a frequency that rises or falls evenly over `duration` (s) from t = 0.

    Before and afterwards the frequency is constant.
    """


class RecordMotion(RecordSignal, Movement):
    """Samples at `time_s` of the displacement, of the velocity or of the acceleration, joined by a spline.

    Before the first sample and after the last one the support moves on at a constant velocity. `baseline` "velocity"
    subtracts a constant acceleration so that the final velocity equals the initial one.
    """

    displacement_m: SeveralOrNone[float] = field(REALS_OR_NONE, "samples of a record", "m", default=None)
    velocity_m_per_s: SeveralOrNone[float] = field(REALS_OR_NONE, "or these", "m/s", default=None)
    acceleration_m_per_s2: SeveralOrNone[float] = field(REALS_OR_NONE, "or these", "m/s²", default=None)
    baseline: Literal["keep", "velocity"] = field(
        one_of("keep", "velocity"), "velocity: end at the velocity of the beginning", default="keep"
    )

    @property
    def samples(self) -> tuple[Quantity, tuple[float, ...]]:
        """The recorded quantity and its values in SI units."""
        return next((of, values) for name, of in RECORDED.items() if (values := getattr(self, name)) is not None)

    def problems(self) -> Iterator[str]:
        """The mistakes of records, and displacements on straight lines."""
        yield from self.recorded_problems(tuple(RECORDED))
        if self.displacement_m is not None and self.interpolation == "linear":
            yield f".interpolation: {NO_LINES}, or a record of velocities"


class RandomMotion(RandomSignal, Movement):
    """One realization of a stationary random process with the one-sided power spectral density (PSD) `psd`.

    `psd` is that of the acceleration, in (m/s²)²/Hz, or of the quantity named by `of`; it is interpolated linearly on
    logarithmic axes and is zero outside `frequency_hz`. The realization repeats after `duration` (s).
    """

    of: Quantity = field(
        one_of("acceleration", "velocity", "displacement"), "quantity of the PSD", default="acceleration"
    )


SupportMotion = SineMotion | SweepMotion | RecordMotion | RandomMotion
MOTION = any_kind(SineMotion, SweepMotion, RecordMotion, RandomMotion)


class Ground(Part):
    """The ground under all supports, with one prescribed motion or a horizontal and a vertical one.

    >>> from modal.scene import SineMotion
    >>> len(Ground(motion=SineMotion(amplitude=0.01, frequency_hz=1.0)).motions)
    1
    """

    motion: OneOrSeveralKinds[SupportMotion, Movement] = field(
        one_or_list(MOTION), "one, or a horizontal and a vertical one"
    )

    @property
    def motions(self) -> tuple[SupportMotion, ...]:
        """Its motions, as a tuple even for one."""
        return self.motion if isinstance(self.motion, tuple) else (self.motion,)

    def problems(self) -> Iterator[str]:
        """Several motions in one direction."""
        for direction in ("horizontal", "vertical"):
            count = sum(motion.direction == direction for motion in self.motions)
            if count > 1:
                yield f'.motion: has {count} motions with direction = "{direction}": one of each direction is possible'


class Moved(Ground):
    """A support with a prescribed motion, or with a horizontal and a vertical one at once."""

    kind: Literal["moved"] = field(one_of("moved"), default="moved")


# ---------------------------------------------------------------------------------------------------------- forces


class AppliedForce(Part):
    """A force `on` a point of a scene (`modal.scene.points`), or with `direction` "torque" a torque.

    A torque on a link acts on its upper joint: on the link and, reversed, on the one above; one on a point of it
    (`…@0.5`) acts on the link alone.
    """

    on: str = field(function_after(point_text, text(200)), "point, such as pendulum[0].links[1]@0.6")
    direction: Acting = field(one_of("horizontal", "vertical", "torque"), "vertical: upwards", default="horizontal")

    def problems(self) -> Iterator[str]:
        """Directions in which a cart on a horizontal rail cannot move."""
        if self.on == "cart" and self.direction != "horizontal":
            yield f'.direction = "{self.direction}": a force on the cart is horizontal'


class SineForce(SineSignal, AppliedForce):
    """The force A sin(2π f t + φ) in N, or a torque in N m.

    >>> from modal.scene import SineForce
    >>> SineForce(on="pendulum[0].links[0]", direction="torque", amplitude=0.3, frequency_hz=1.0).on
    'pendulum[0].links[0]'
    """


class SweepForce(SweepSignal, AppliedForce):
    """The force A sin(phase) in N, or a torque in N m, with a frequency that changes evenly over `duration` (s)."""


class RecordForce(RecordSignal, AppliedForce):
    """Samples at `time_s` of a force (`force_n`) or a torque (`moment_nm`), joined by a spline; zero outside them."""

    force_n: SeveralOrNone[float] = field(REALS_OR_NONE, "samples of a force", "N", default=None)
    moment_nm: SeveralOrNone[float] = field(REALS_OR_NONE, "samples of a torque", "N m", default=None)

    @property
    def samples(self) -> tuple[float, ...]:
        """The values in N or N m."""
        return next(values for name in FORCES if (values := getattr(self, name)) is not None)

    def problems(self) -> Iterator[str]:
        """The mistakes of records, and a force recorded for a torque."""
        yield from super().problems()
        right_key, wrong_key = FORCES[:: -1 if self.direction == "torque" else 1]
        if getattr(self, wrong_key) is not None:
            yield f'.{wrong_key}: with direction = "{self.direction}" a record holds {right_key}'
        yield from self.recorded_problems((right_key,)) if getattr(self, wrong_key) is None else ()


class RandomForce(RandomSignal, AppliedForce):
    """One realization of a random force with a PSD in N²/Hz, or of a torque in (N m)²/Hz; it repeats."""


class ConstantForce(AppliedForce):
    """The same force (N) or torque (N m) at all times: the scene is linearized about the equilibrium under it."""

    kind: Literal["constant"] = field(one_of("constant"), default="constant")
    amplitude: float = field(REAL, "value, of either sign", "N or N m")


Force = SineForce | SweepForce | RecordForce | RandomForce | ConstantForce
FORCE = any_kind(SineForce, SweepForce, RecordForce, RandomForce, ConstantForce)
