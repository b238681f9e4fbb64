"""The common period of all prescribed sines: support motions and forces."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from math import lcm

from modal.errors import SceneError
from modal.report import Displayed, Summary
from modal.scene.doors import require_type
from modal.scene.model import Scene
from modal.scene.motion import Force, SineForce, SineMotion, SupportMotion
from modal.scene.parameters import with_numbers
from modal.types import NOISE_OF_SUM

SINES = (SineMotion, SineForce)
RATIO_DENOMINATOR_MAX = 64
"""Limit: of a ratio of two frequencies; others have no common period and are refused."""


@dataclass(frozen=True, repr=False)
class DrivePeriod(Displayed):
    """The common period (s) of sines; `places` are their frequencies' in the scene, `cycles` those in one period."""

    seconds: float
    places: tuple[str, ...]
    cycles: tuple[int, ...]

    def _summary(self) -> Summary:
        facts = [(place, f"{count} in it") for place, count in zip(self.places, self.cycles, strict=True)]
        return Summary(f"Common period of the drives: {self.seconds:.6g} s", facts)


def sines_of(scene: Scene) -> dict[str, SineMotion | SineForce]:
    """Return every sine by its place, the support's first; raise SceneError for time dependence that does not repeat.

    >>> from modal import load
    >>> sines_of(load("chain-2"))
    {}
    """
    require_type("scene", scene, "Scene")
    motions = zip(scene.motion_places, scene.motions, strict=True)
    drives: dict[str, SupportMotion | Force] = {with_numbers(place): motion for place, motion in motions}
    drives |= {f"force[{k}]": force for k, force in enumerate(scene.force) if force.kind != "constant"}
    sines = {at: drive for at, drive in drives.items() if isinstance(drive, SINES)}
    if len(sines) < len(drives):
        nonperiodic_places = (at for at, drive in drives.items() if not isinstance(drive, SINES))
        raise SceneError([f'{at}.kind = "{drives[at].kind}": is not periodic: a sine is' for at in nonperiodic_places])
    return sines


def frequencies_of(scene: Scene) -> dict[str, float]:
    """Return the frequency (Hz) of every sine by its place; raise SceneError for time dependence that does not repeat.

    >>> from modal import load
    >>> frequencies_of(load("chain-2"))
    {}
    """
    return {f"{at}.frequency_hz": sine.frequency_hz for at, sine in sines_of(scene).items()}


def drive_period(scene: Scene) -> DrivePeriod:
    """Return the common period of a scene's drives; raise SceneError if there is none.

    The ratios of their frequencies are fractions p/q with q ≤ 64, to 1e-12.

    >>> from modal import Bob, Pendulum, Scene
    >>> from modal.scene import SineForce
    >>> push = SineForce(on="pendulum[0].links[0]", amplitude=1.0, frequency_hz=0.5)
    >>> scene = Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0)])], force=[push])
    >>> drive_period(scene).seconds
    2.0
    """
    require_type("scene", scene, "Scene")
    frequencies = frequencies_of(scene)
    if not frequencies:
        raise SceneError(['nothing drives this scene: give it a [[force]], or a support of kind = "moved"'])
    first, *_ = frequencies.values()
    ratios = {place: Fraction(hz / first).limit_denominator(RATIO_DENOMINATOR_MAX) for place, hz in frequencies.items()}
    incommensurate_places = [
        place for place, hz in frequencies.items() if abs(float(ratios[place]) * first - hz) > NOISE_OF_SUM * hz
    ]
    if incommensurate_places:
        words = f"is not a ratio p/q of {next(iter(frequencies))} = {first!r} with q of at most {RATIO_DENOMINATOR_MAX}"
        raise SceneError(
            [
                f"{place} = {frequencies[place]!r}: {words}: these drives have no common period"
                for place in incommensurate_places
            ]
        )
    common_denominator = lcm(*(ratio.denominator for ratio in ratios.values()))
    return DrivePeriod(
        common_denominator / first, tuple(ratios), tuple(int(ratio * common_denominator) for ratio in ratios.values())
    )
