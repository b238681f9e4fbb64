"""The unknowns of a fit, the residuals and their exact derivatives.

Unknowns are the free numbers z, an offset for each sensor, on request its scale, a delay of each sensor behind the
first, and the initial state of every segment.  A reading is scale · (value at t − delay) + offset.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from modal.errors import refuse_any
from modal.identification import Parameter, scene_with
from modal.identification.parameters import numbers_at
from modal.report import Displayed
from modal.scene import Scene, refusals
from modal.scene.parameters import Place, is_of_switch, number_at, with_numbers
from modal.types import IMAGINARY_STEP, Booleans, Floats
from nonlinear.dynamics.inputs import Inputs
from nonlinear.identification.flow import MOTION_STEPS_MAX, Readings, Segments, SensorChannel, integrate_segments
from nonlinear.identification.points import PointReading
from nonlinear.identification.records import Recording, Sensor
from nonlinear.integration.switches import numbers_of as switching_of
from nonlinear.system import Numbers, System, numbers_of, system_of, translations

MOTION_TOLERANCE = 1e-8
"""Tolerance: of the motion: well below the resolution of sensors."""
GAP_STD = 0.1
"""Tolerance: of the sensors' noise, a gap between a motion and its continuation: less than is seen."""
DELAY_MAX = 0.1
"""Limit: of sqrt(l/g), the longest delay of a sensor behind the first."""
FITTED_LINKS_MAX = 32
"""Limit: links of a scene: "motions of at most 32 are fitted"."""


@dataclass(frozen=True)
class Unknowns:
    """Arrangement of the unknowns: p parameters, C offsets, scales and delays, S states of `width`."""

    numbers: int
    sensors: int
    segments: int
    width: int

    @property
    def offsets(self) -> slice:
        """The offsets of the sensors, in their units."""
        return slice(self.numbers, self.numbers + self.sensors)

    @property
    def scales(self) -> slice:
        """The scale factors of the sensors, less 1."""
        return slice(self.offsets.stop, self.offsets.stop + self.sensors)

    @property
    def delays(self) -> slice:
        """The delays of the sensors relative to the first (s)."""
        return slice(self.scales.stop, self.scales.stop + self.sensors)

    def state(self, segment: int) -> slice:
        """The initial state of a segment: x, θ, x', θ'."""
        begin = self.delays.stop + segment * self.width
        return slice(begin, begin + self.width)

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.numbers + 3 * self.sensors + self.segments * self.width


def require_fittable(scene: Scene, free: Sequence[Parameter] = ()) -> None:
    """Raise SceneError for a scene whose motions cannot be fitted, or not by these numbers, with every reason."""
    reasons = refusals(scene, "a fit of motions")
    if scene.n_links > FITTED_LINKS_MAX:
        reasons.append(f"the scene has {scene.n_links} links: motions of at most {FITTED_LINKS_MAX} are fitted")
    for parameter in free:
        for place in parameter.places:
            is_length = place[0] == "pendulum" and place[-1] == "length"
            if is_length and scene.pendulum[int(place[1])].links[int(place[3])].hoist:
                reasons.append(f"{with_numbers(place)}: follows its hoist, whose course a fit does not change")
    refuse_any(reasons)


class EvaluatedMotions(NamedTuple):
    """The motions and their derivatives at unknowns of a problem."""

    problem: FitProblem
    unknowns: bytes
    flow: Readings


@dataclass(frozen=True, eq=False, repr=False)
class FitProblem(Displayed):
    """A recording, and a scene of which these numbers are free; `scaled` frees the sensors' scales.

    Where it is `shifted`, the first sensor has a delay too, relative to the prescribed motions of the scene.

    `noise` (C,) is the standard deviation of every sensor, `tightness` times that the one of a gap between a motion and
    its continuation.  Motions of more than this many `steps` are not followed.  `evaluations` are the last two, of this
    problem or of one that it replaces: a search asks for them again where it ends, or once a trial has failed.
    """

    scene: Scene
    parameters: tuple[Parameter, ...]
    recording: Recording
    noise: Floats
    scaled: bool = False
    tolerance: float = MOTION_TOLERANCE
    tightness: float = GAP_STD
    steps: int = MOTION_STEPS_MAX
    shifted: bool = False
    evaluations: list[EvaluatedMotions] = field(default_factory=list)

    @cached_property
    def system(self) -> System:
        """The scene as arrays, with every switch that it may have."""
        return system_of(self._rubbing)

    @cached_property
    def layout(self) -> Unknowns:
        """The arrangement of unknowns."""
        return Unknowns(
            len(self.parameters), len(self.recording.sensors), len(self.recording.segments), 2 * self.coordinates
        )

    @property
    def coordinates(self) -> int:
        """Number of coordinates of the scene."""
        return self.system.n_links + self.system.first

    @cached_property
    def late(self) -> float:
        """The longest delay (s), by which every motion begins before its first sample; 0 for a single sensor."""
        if self.shifted:
            return 1 / self.system.rate
        return DELAY_MAX / self.system.rate if len(self.recording.sensors) > 1 else 0.0

    @cached_property
    def scale(self) -> Floats:
        """Natural units of a state."""
        units = np.ones(2 * self.coordinates)
        units[: self.system.first] = self.system.first_units
        units[self.coordinates :] = units[: self.coordinates] * self.system.rate
        return units

    def parts(self, sensor: Sensor) -> tuple[tuple[int, float], ...]:
        """The components of a state, with signs, that a sensor adds up; none where it reads a point."""
        first = self.system.first
        if sensor.carrier and self.system.structure is not None:
            return ((self.system.structure.names.index(sensor.carrier), 1.0),)
        if not sensor.pendulum:
            return ((0, 1.0),)
        if sensor.is_of_point:
            return ()
        row = first + self._links(sensor)[-1]
        if sensor.quantity == "rate":
            return ((row + self.coordinates, 1.0),)
        is_relative = self.recording.relative or sensor.quantity == "relative"
        upper_link = ((row - 1, -1.0),) if is_relative and sensor.link > 1 else ()
        return ((row, 1.0), *upper_link)

    def _links(self, sensor: Sensor) -> tuple[int, ...]:
        """The links down to that of a sensor, in the order of the file."""
        links = [k for k, pendulum in enumerate(self.system.pendulum) if pendulum == sensor.pendulum - 1]
        return tuple(links[: sensor.link])

    @cached_property
    def _points(self) -> list[PointReading | None]:
        """The readings of every sensor at a point."""
        return [
            PointReading(self.system, sensor.quantity, self._links(sensor), sensor.radius)
            if sensor.is_of_point
            else None
            for sensor in self.recording.sensors
        ]

    @cached_property
    def picks(self) -> Floats:
        """The matrix from coordinates to the readings of sensors, (C, coordinates)."""
        picks = np.zeros((len(self.recording.sensors), self.coordinates))
        for c, sensor in enumerate(self.recording.sensors):
            for row, sign in self.parts(sensor):
                if row < self.coordinates:
                    picks[c, row] = sign
        return picks

    @property
    def is_seen(self) -> bool:
        """Whether the sensors read every coordinate."""
        return int(np.linalg.matrix_rank(self.picks)) == self.coordinates

    @property
    def is_read_by_motion(self) -> bool:
        """Whether other sensors determine, through the motion, numbers that the angles do not."""
        return not self.is_seen and any(
            sensor.is_of_point or sensor.quantity == "rate" for sensor in self.recording.sensors
        )

    @cached_property
    def free(self) -> Booleans:
        """Which unknowns are fitted, (size,)."""
        layout, is_free = self.layout, np.ones(self.layout.size, dtype=bool)
        is_free[layout.scales] = self.scaled
        if len(self.recording.sensors) and not self.shifted:
            is_free[layout.delays.start] = False
        adrift = np.abs(translations(self.system)).sum(axis=0) > 0
        is_drift_read = False
        for k, sensor in enumerate(self.recording.sensors):
            moves = not sensor.pendulum and adrift[self.parts(sensor)[0][0]]
            # Of marks the first stands for where the cart is, if no sensor of the cart does.
            if moves or (sensor.quantity == "x" and adrift.any() and not is_drift_read):
                is_free[layout.offsets.start + k] = False
                is_drift_read = True
        return is_free

    @cached_property
    def bounds(self) -> tuple[Floats, Floats]:
        """The bounds of all unknowns, (size,) each."""
        layout = self.layout
        low, high = np.full(layout.size, -np.inf), np.full(layout.size, np.inf)
        low[: layout.numbers] = [parameter.z_min for parameter in self.parameters]
        high[: layout.numbers] = [-parameter.z_min if parameter.log else np.inf for parameter in self.parameters]
        low[layout.scales], low[layout.delays], high[layout.delays] = -0.9, -self.late or -1, self.late or 1
        return low, high

    def scene_at(self, u: Floats) -> Scene:
        """The scene with the numbers of these unknowns."""
        return scene_with(self.scene, numbers_at(self.parameters, u[: self.layout.numbers]))

    def readings(self, u: Floats, with_derivatives: bool = False) -> list[Floats]:
        """The predicted readings, (K, C) for each segment; raise ComputationError if a motion cannot be followed.

        With `with_derivatives` these are computed along, as for `residuals`.
        """
        return self._readings(u, self._motions(u, with_derivatives))

    def misses(self, u: Floats, with_derivatives: bool = False) -> list[Floats]:
        """Return predicted less measured readings, (K, C) for each segment."""
        readings = self.readings(u, with_derivatives)
        return [reading - segment.values for reading, segment in zip(readings, self.recording.segments, strict=True)]

    def _readings(self, u: Floats, flow: Readings) -> list[Floats]:
        layout, readings = self.layout, []
        for s, segment in enumerate(self.recording.segments):
            values = flow.values[: len(u[layout.offsets]), s, : len(segment.times), 0].real.T
            readings.append((1 + u[layout.scales]) * values + u[layout.offsets])
        return readings

    def residuals(self, u: Floats, with_derivatives: bool = False) -> Floats:
        """(N,) in units of the noise, of all values that are there, then those of priors.

        With `with_derivatives` the derivatives are computed along, for a `jacobian` at the same unknowns.
        """
        flow = self._motions(u, with_derivatives)
        rows = [
            ((values - segment.values) / self.noise)[np.isfinite(segment.values)]
            for values, segment in zip(self._readings(u, flow), self.recording.segments, strict=True)
        ]
        priors = [(u[k] - mean) / std for k, mean, std in self._beliefs]
        return np.concatenate([*rows, *self._gaps(u, flow), np.array(priors)])

    @cached_property
    def _joints(self) -> list[int]:
        """The segments that are continued by the next."""
        return [s for s, segment in enumerate(self.recording.segments[:-1]) if segment.continued]

    @cached_property
    def _tightness(self) -> Floats:
        """The standard deviation of a gap between a motion and its continuation, for every component of a state."""
        return np.asarray(self.tightness * float(self.noise.min()) * self.scale)

    def _gaps(self, u: Floats, flow: Readings) -> list[Floats]:
        """How far each continuation begins from where the motion before it has come, in units of `_tightness`."""
        first = len(self.recording.sensors)
        return [
            (flow.values[first:, s, 0, 0].real - u[self.layout.state(s + 1)]) / self._tightness for s in self._joints
        ]

    def _gap_slopes(self, flow: Readings) -> list[Floats]:
        """The derivatives of the gaps."""
        layout, first, blocks = self.layout, len(self.recording.sensors), []
        for s in self._joints:
            block = np.zeros((layout.width, layout.size))
            slopes = flow.values[first:, s, 0].imag / IMAGINARY_STEP
            block[:, : layout.numbers] = slopes[:, : layout.numbers]
            block[:, layout.state(s)] = slopes[:, layout.numbers :]
            block[:, layout.state(s + 1)] -= np.eye(layout.width)
            blocks.append(block / self._tightness[:, None])
        return blocks

    @cached_property
    def _beliefs(self) -> list[tuple[int, float, float]]:
        """The numbers with priors: their index, and mean and standard deviation of z."""
        return [(k, *parameter.prior_of_z) for k, parameter in enumerate(self.parameters) if parameter.prior_of_z]

    def jacobian(self, u: Floats) -> Floats:
        """The derivatives of the residuals, (N, size)."""
        layout = self.layout
        flow = self._flow_with_derivatives(u)
        blocks = []
        for s, segment in enumerate(self.recording.segments):
            K, C = segment.values.shape
            block = np.zeros((K, C, layout.size))
            values = np.moveaxis(flow.values[:C, s, :K], 0, 1)
            scale = (1 + u[layout.scales])[:, None]
            block[..., : layout.numbers] = scale * values[..., : layout.numbers].imag / IMAGINARY_STEP
            block[..., layout.state(s)] = scale * values[..., layout.numbers :].imag / IMAGINARY_STEP
            rates = flow.rates[:C, s, :K].T
            for c in range(C):
                block[:, c, layout.offsets.start + c] = 1.0
                block[:, c, layout.scales.start + c] = values[:, c, 0].real
                block[:, c, layout.delays.start + c] = -scale[c] * rates[:, c]
            block /= self.noise[:, None]
            blocks.append(block[np.isfinite(segment.values)])
        priors = np.zeros((len(self._beliefs), layout.size))
        for row, (k, _, std) in enumerate(self._beliefs):
            priors[row, k] = 1 / std
        return np.vstack([*blocks, *self._gap_slopes(flow), priors])

    def series(self) -> list[tuple[int, int, slice]]:
        """Segment, sensor and rows of the residuals of each series, once `sort_by_sensor` has sorted them."""
        series, at = [], 0
        for s, segment in enumerate(self.recording.segments):
            for c, values in enumerate(segment.values.T):
                count = int(np.count_nonzero(np.isfinite(values)))
                if count:
                    series.append((s, c, slice(at, at + count)))
                at += count
        return series

    def sort_by_sensor(self, rows: Floats) -> Floats:
        """Residuals or their derivatives with each sensor's values of a segment together, priors last."""
        sorted_rows, at = [], 0
        for segment in self.recording.segments:
            is_present = np.isfinite(segment.values)
            count = int(np.count_nonzero(is_present))
            sensor = np.broadcast_to(np.arange(is_present.shape[1]), is_present.shape)[is_present]
            sorted_rows.append(rows[at : at + count][np.argsort(sensor, kind="stable")])
            at += count
        return np.concatenate([*sorted_rows, rows[at:]])

    def _continuations(self, length: int, starts: Floats) -> list[SensorChannel]:
        """Channels for every component of a state where the next segment begins."""
        if not self._joints:
            return []
        segments = self.recording.segments
        times = np.full((len(segments), length), np.inf)
        for s in self._joints:
            times[s, 0] = segments[s + 1].times[0] - segments[s].times[0] + starts[s]
        half = self.coordinates
        return [SensorChannel(((row, 1.0),), times, None, False) for row in range(2 * half)]

    def _evaluated(self, u: Floats) -> Readings | None:
        """The motions at these unknowns, where they are among the last evaluations."""
        unknowns = u.tobytes()
        for evaluation in self.evaluations:
            parts = zip(self._of_motions, evaluation.problem._of_motions, strict=True)  # whatever the noise
            if evaluation.unknowns == unknowns and all(part is other_part for part, other_part in parts):
                return evaluation.flow
        return None

    @property
    def _of_motions(self) -> tuple[object, ...]:
        return self.scene, self.parameters, self.recording, self.tolerance, self.steps, self.shifted

    def _motions(self, u: Floats, with_derivatives: bool) -> Readings:
        if with_derivatives:
            return self._flow_with_derivatives(u)
        return self._evaluated(u) or self._flow(u, 0)

    def _flow_with_derivatives(self, u: Floats) -> Readings:
        flow = self._evaluated(u)
        if flow is None:
            flow = self._flow(u, self.layout.numbers + self.layout.width)
            self.evaluations[:] = [*self.evaluations[-1:], EvaluatedMotions(self, u.tobytes(), flow)]
        return flow

    def _flow(self, u: Floats, columns: int) -> Readings:
        """The motions of all segments; with `columns` the derivatives by numbers and states in this many of them."""
        layout, segments = self.layout, self.recording.segments
        P, S, kind = max(columns, 1), len(segments), complex if columns else float
        real, steps = dict[Place, float](), dict[Place, Any]()
        for k, parameter in enumerate(self.parameters):
            step = np.zeros((S, P), dtype=kind)
            if columns:
                step[:, k] = 1j * IMAGINARY_STEP * parameter.slope(float(u[k]))
            numbers = parameter.unknown.numbers(parameter.at(float(u[k])))
            real |= numbers
            steps |= dict.fromkeys(numbers, step)
        y = np.empty((layout.width, S, P), dtype=kind)
        for s in range(S):
            y[:, s] = u[layout.state(s), None]
        if columns:
            y[:, :, layout.numbers :] += 1j * IMAGINARY_STEP * np.eye(layout.width)[:, None]
        begins = np.array([segment.times[0] - self.late for segment in segments])
        starts = begins if Inputs(self.system).count else np.zeros(S)
        longest = max(len(segment.times) for segment in segments)
        channels = []
        for c, sensor in enumerate(self.recording.sensors):
            has_rate = columns > 0 and (c > 0 or self.shifted)
            times = np.full((S, longest), np.inf)
            for s, segment in enumerate(segments):
                times[s, : len(segment.times)] = segment.times - begins[s] - u[layout.delays][c] + starts[s]
            channels.append(SensorChannel(self.parts(sensor), times, self._points[c], has_rate))
        channels += self._continuations(longest, starts)
        times_all = np.array([channel.times for channel in channels])
        ends = np.where(np.isfinite(times_all), times_all, -np.inf).max(axis=(0, 2))
        integrands = Segments(
            self._numbers({place: np.full(S, value) for place, value in real.items()}),
            self._numbers({place: value + steps[place] for place, value in real.items()}),
            y,
            starts,
            ends,
            self.scale,
            self.system.rate,
        )
        return integrate_segments(integrands, channels, self.tolerance, self.steps)

    def _numbers(self, values: dict[Place, Any]) -> Numbers:
        """The numbers of all segments, with arrays at some places."""
        numbers = numbers_of(self.scene, values, self.system)
        switching: list[Any] = [*switching_of(self.system)]
        for place, shares in self._shares.items():
            for k, share in shares:
                switching[k] = share * values[place]
        return replace(numbers, switching=tuple(switching))

    @cached_property
    def _shares(self) -> dict[Place, list[tuple[int, float]]]:
        """Which numbers of switches are how many times a free one, by its place: all are proportional to theirs."""
        shares, numbers = {}, np.array(switching_of(self.system))
        for place in (place for parameter in self.parameters for place in parameter.places):
            if is_of_switch(self.scene, place) and len(numbers):
                now = number_at(self._rubbing, place)
                twice = switching_of(system_of(scene_with(self._rubbing, {with_numbers(place): 2 * now})))
                shares[place] = [(int(k), numbers[k] / now) for k in np.flatnonzero(np.array(twice) != numbers)]
        return shares

    @cached_property
    def _rubbing(self) -> Scene:
        """The scene with some friction or impulse wherever these are free: a joint without any has no switch."""
        none = {
            with_numbers(place): parameter.unit
            for parameter in self.parameters
            for place in parameter.places
            if is_of_switch(self.scene, place) and not number_at(self.scene, place)
        }
        return scene_with(self.scene, none)
