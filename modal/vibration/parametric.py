"""Parametric excitation: a support that moves up and down as a sine makes gravity vary with time.

About the equilibrium small angles obey Hill's equations (`modal.vibration.hill`).  Solutions grow where a Floquet
multiplier μ, an eigenvalue of the matrix that takes (θ, θ') across one period, lies outside the unit circle: with the
period of the support where μ > 1, with twice the period where μ < −1, and with two frequencies that add up to a
multiple of the support's, or differ by one, where μ is complex (Yakubovich & Starzhinskii, Linear Differential
Equations with Periodic Coefficients, 1975, chapter V).

One undamped pendulum obeys Mathieu's equation, whose unstable regions are the tongues of the chart of Ince and Strutt
(McLachlan, Theory and Application of Mathieu Functions, 1947, §4.10), and an inverted one stands where a²Ω² exceeds
about 2 g l (Kapitza, 1951; Landau & Lifshitz, Mechanics, §30).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import log, tau

import numpy as np

from modal.report import Displayed, Summary, brief
from modal.scene import Scene, validate_scene, validate_scenes
from modal.types import Complexes, Floats
from modal.vibration.hill import HillSystem, hill_systems, vertical_sine

CERTAIN, COUPLED = 1e-9, 1e-7
"""Distance from 1 above which |μ| counts as larger or smaller; of modes that couple without losses, whose multipliers
have half of all digits where two are equal."""
KINDS = {
    -1: "decays",
    0: "neutral",
    1: "grows at the frequency",
    2: "grows at half the frequency",
    3: "grows at a combination",
}
"""What small angles do, by number: the periods of the support after which a growing motion repeats but for its size, 3
where it never does."""


@dataclass(frozen=True, eq=False, repr=False)
class ParametricStability(Displayed):
    """Floquet multipliers (2n,) of the small angles of a scene over one `period` (s) of its support, largest first."""

    multipliers: Complexes
    period: float
    certain: float = CERTAIN

    @property
    def largest(self) -> float:
        """The largest |μ|."""
        return float(abs(self.multipliers[0]))

    @property
    def growth_rate(self) -> float:
        """The rate (1/s) at which small angles grow, negative where they decay."""
        return log(max(self.largest, 1e-300)) / self.period

    @property
    def number(self) -> int:
        """What small angles do, by its number in KINDS."""
        first = self.multipliers[0]
        if self.largest <= 1 + self.certain:
            return 0 if self.largest >= 1 - self.certain else -1
        return 3 if abs(first.imag) > self.certain * abs(first) else 1 if first.real > 0 else 2

    @property
    def kind(self) -> str:
        """What small angles do, in words."""
        return KINDS[self.number]

    @property
    def grows(self) -> bool:
        """Whether small angles grow."""
        return self.number > 0

    @property
    def words(self) -> str:
        """One line."""
        what = self.kind if self.number else "neither grows nor decays"
        return f"small motion {what}: the largest Floquet multiplier of a period is {self.largest:.6g}"

    def _summary(self) -> Summary:
        rows = [
            [brief(multiplier.real), brief(multiplier.imag), brief(abs(multiplier))] for multiplier in self.multipliers
        ]
        facts = [("period", f"{self.period:.6g} s"), ("growth rate", f"{self.growth_rate:.6g} 1/s")]
        return Summary(self.words, facts, ("Re", "Im", "size"), rows, len(rows))


def parametric_stability(scene: Scene) -> ParametricStability:
    """Of a scene whose support moves up and down as a sine, hanging or standing, with any number of links.

    A motion along the rail beside it pushes small angles and does not change their growth.  SceneError for any other
    motion, and for what Hill's equation does not include: forces, friction, drives, hoists.

    >>> from modal import Bob, Pendulum, Scene
    >>> from modal.scene import Moved, SineMotion
    >>> shaken = Moved(motion=SineMotion(direction="vertical", amplitude=0.02, frequency_hz=1.0))
    >>> scene = Scene(gravity=9.81, support=shaken, pendulum=[Pendulum(links=[Bob(mass=1, length=1)])])
    >>> found = parametric_stability(scene)
    >>> found.kind, round(found.growth_rate, 6)
    ('grows at half the frequency', 0.062242)
    """
    validate_scene(scene)
    return stabilities([scene])[0]


def stabilities(scenes: Sequence[Scene]) -> list[ParametricStability]:
    """Of several scenes, together where they differ in the motion of their support alone; SceneError as above.

    >>> from modal import Bob, Pendulum, Scene
    >>> from modal.scene import Moved, SineMotion
    >>> from modal.scene.parameters import vary
    >>> shaken = Moved(motion=SineMotion(direction="vertical", amplitude=0.02, frequency_hz=1.0))
    >>> scene = Scene(gravity=9.81, support=shaken, pendulum=[Pendulum(links=[Bob(mass=1, length=1)])])
    >>> several = [vary(scene, {"support.motion.frequency_hz": hertz}) for hertz in (0.9, 1.0)]
    >>> [one.kind for one in stabilities(several)]
    ['neutral', 'grows at half the frequency']
    """
    validate_scenes(scenes)
    answers: list[ParametricStability | None] = [None] * len(scenes)
    groups: dict[tuple[object, ...], list[int]] = {}
    sines = [vertical_sine(scene) for scene in scenes]
    for at, scene in enumerate(scenes):
        carried = (scene.supports, scene.spring) if scene.is_structured else ()
        groups.setdefault((scene.gravity, scene.pendulum, scene.damping_ratio, scene.space, carried), []).append(at)
    for alike in groups.values():
        systems = hill_systems(scenes[alike[0]])
        amplitude, hertz = np.array([(sines[at].amplitude, sines[at].frequency_hz) for at in alike]).T
        for at, values, certain in zip(alike, *_multipliers(systems, amplitude, tau * hertz), strict=True):
            answers[at] = ParametricStability(values, 1 / sines[at].frequency_hz, float(certain))
    return [answer for answer in answers if answer]


def _multipliers(systems: Sequence[HillSystem], amplitude: Floats, omega: Floats) -> tuple[Complexes, Floats]:
    """All multipliers (B, 2n), largest first, and what is certain of the largest (B,)."""
    values, certain = [], []
    for system in systems:
        of_system = system.multipliers(amplitude, omega)
        values.append(np.tile(of_system, (1, system.count)))
        room = COUPLED if system.is_reversible and system.size > 1 else CERTAIN
        certain.append(np.full(values[-1].shape, room))
    whole, rooms = np.concatenate(values, axis=1), np.concatenate(certain, axis=1)
    order = np.argsort(-np.abs(whole), axis=1, kind="stable")
    return np.take_along_axis(whole, order, 1), np.take_along_axis(rooms, order, 1)[:, 0]
