"""Joint laws and point forces: plain arithmetic over any scalar, and quantities derived from it.

A joint law gives the torque τ(γ, γ') on the link below, and reversed on the link above, γ being the angle of the joint
from equilibrium. With a potential V the part τ(γ, 0) = −V'(γ) conserves energy, and the rest of the torque does work;
without a potential all of it does. About equilibrium

    stiffness = −∂τ/∂γ,    damping = −∂τ/∂γ'    at (0, 0),

by complex steps [Squire1998].  A point force F(v) acts on the centre of mass of a link with the velocity v.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import isfinite, radians
from typing import Any, ClassVar

import numpy as np

from modal.extend.registry import Extension, Parameter, call, mistake_of, register
from modal.extend.scalars import sqrt
from modal.types import IMAGINARY_STEP

Values = Mapping[str, Any]
"""The parameters of a law by name: floats, arrays or symbols."""
PROBE = 0.25
"""Physics: an angle (rad) and a rate (rad/s) at which a law is compared with its own declarations."""
SMALL = 1e-5
"""Tolerance: an angle (rad) whose square, and whose rounding error divided by it, are negligible against 1e-9."""
AGREEMENT = 1e-9
"""Tolerance: of that comparison, far above rounding."""


class Law(Extension):
    """The common base of joint laws and point forces: parameters by name, and declared properties."""

    parameters: ClassVar[tuple[Parameter, ...]] = ()
    is_smooth: ClassVar[bool] = True
    """Whether it has all derivatives everywhere."""

    @classmethod
    def mistakes(cls) -> Iterator[str]:
        """Parameters without unique names."""
        names = [parameter.name for parameter in cls.parameters]
        if len(set(names)) < len(names) or not all(name.isidentifier() and name != "kind" for name in names):
            yield f"parameters must have different names, which are words and not kind: {', '.join(names)}"


class JointLaw(Law):
    """A torque at a joint, `torque(angle, rate, parameters)`, and optionally its `potential`.

    Parameters arrive as a mapping by name.  Write plain arithmetic with the functions of `modal.extend`.

    >>> from modal.extend import JointLaw, Parameter, sin
    >>> class Magnet(JointLaw):
    ...     name = "magnet"
    ...     parameters = (Parameter("strength", "N m"),)
    ...     is_odd = True
    ...     def torque(self, angle, rate, parameters):
    ...         return -parameters["strength"] * sin(3 * angle)
    >>> stiffness, damping = Magnet().linear_coefficients({"strength": 2.0})
    >>> round(stiffness, 12), damping
    (6.0, 0.0)
    """

    kind = "joint law"
    is_odd: ClassVar[bool] = False
    """Whether the mirrored motion has the mirrored torque."""
    is_dissipative: ClassVar[bool] = False
    """Whether it never supplies energy."""
    is_drive: ClassVar[bool] = False
    """Whether it sustains a swing: linear models ignore it."""

    @classmethod
    def mistakes(cls) -> Iterator[str]:
        """Mistakes of parameters, and a missing torque."""
        yield from super().mistakes()
        if cls.torque is JointLaw.torque:
            yield "has no torque"

    def torque(self, angle: Any, rate: Any, parameters: Values) -> Any:
        """The torque (N m) on the link below from the joint's angle (rad) from equilibrium and its rate (rad/s)."""
        raise NotImplementedError

    def potential(self, angle: Any, parameters: Values) -> Any:
        """The energy (J) that it stores."""
        raise NotImplementedError

    @property
    def has_potential(self) -> bool:
        """Whether it stores energy."""
        return type(self).potential is not JointLaw.potential

    @property
    def is_conservative(self) -> bool:
        """Whether it does only the work of its potential: whether its torque is independent of the rate."""
        return self.has_potential and not self.is_dissipative

    def torques(self, angle: Any, rate: Any, parameters: Values) -> tuple[Any, Any]:
        """The part that its potential accounts for, 0 without one, and the rest, which does work."""
        total = call(self, "torque", angle, rate, parameters)
        if not self.has_potential:
            return 0.0, total
        if self.is_conservative:
            return total, 0.0
        elastic = call(self, "torque", angle, 0.0 * rate, parameters)
        return elastic, total - elastic

    def linear_coefficients(self, parameters: Values) -> tuple[float, float]:
        """Stiffness (N m/rad) and damping (N m s/rad) about equilibrium."""
        steps = ((complex(0.0, IMAGINARY_STEP), 0.0), (0.0, complex(0.0, IMAGINARY_STEP)))
        stiffness, damping = (-complex(call(self, "torque", *step, parameters)).imag / IMAGINARY_STEP for step in steps)
        return stiffness + 0.0, damping + 0.0

    def coefficient_slopes(self, parameters: Values) -> dict[str, tuple[float, float]]:
        """How stiffness and damping change with every parameter: complex steps of it, between two small motions.

        >>> from modal.extend.laws import DamperLaw
        >>> DamperLaw().coefficient_slopes({"damping": 4.0})["damping"]
        (0.0, 1.0)
        """

        def slope(name: str, *motion: float) -> float:
            changed = {**parameters, name: complex(parameters[name], IMAGINARY_STEP)}
            ends = (call(self, "torque", *(sign * part for part in motion), changed) for sign in (1.0, -1.0))
            above, below = (complex(end).imag / IMAGINARY_STEP for end in ends)
            return (below - above) / (2 * SMALL) + 0.0

        return {name: (slope(name, SMALL, 0.0), slope(name, 0.0, SMALL)) for name in parameters}

    def judge(self, parameters: Values) -> None:
        """Raise ExtensionError if it is not as declared: at rest, mirrored, by its potential, by its power."""
        with np.errstate(all="ignore"):
            self._judge(parameters)

    def _judge(self, parameters: Values) -> None:
        at_rest = call(self, "torque", 0.0, 0.0, parameters, shape=())
        if abs(at_rest) > 0:
            raise mistake_of(self, f"torque is {float(at_rest):g} N m at rest: must be 0 at angle 0 and rate 0")
        for k, coefficient in enumerate(self.linear_coefficients(parameters)):
            motions = [[sign * SMALL * (k == j) for j in (0, 1)] for sign in (1, -1)]
            above, below = (float(call(self, "torque", *motion, parameters)) for motion in motions)
            slope = (below - above) / (2 * SMALL)
            agrees = abs(slope - coefficient) <= SMALL * (1 + abs(slope))
            if not isfinite(coefficient) or (self.is_smooth and not agrees):
                raise mistake_of(self, "torque has no derivative at rest: say is_smooth = False where it has a kink")
        places = [(sign * PROBE, other * PROBE) for sign in (1, -1) for other in (1, -1)]
        torques = [float(call(self, "torque", *place, parameters)) for place in places]
        size = max(map(abs, torques))
        if self.is_odd and abs(torques[0] + torques[3]) + abs(torques[1] + torques[2]) > AGREEMENT * size:
            raise mistake_of(self, "says that it is odd, and torque(−γ, −γ') is not −torque(γ, γ')")
        elastic = [0.0] * len(places)
        if self.has_potential:
            for k, (angle, _) in enumerate(places):
                slope = (
                    complex(call(self, "potential", complex(angle, IMAGINARY_STEP), parameters)).imag / IMAGINARY_STEP
                )
                elastic[k] = float(call(self, "torque", angle, 0.0, parameters))
                if abs(slope + elastic[k]) > AGREEMENT * max(size, abs(slope)):
                    words = f"its potential's slope is {slope:g} N m at {angle:g} rad, its torque {elastic[k]:g} N m"
                    raise mistake_of(self, words)
        works = [(total - part) * rate for total, part, (_, rate) in zip(torques, elastic, places, strict=True)]
        if self.is_conservative and any(abs(work) > AGREEMENT * size for work in works):
            raise mistake_of(self, "has a potential and a torque that depends on the rate: say is_dissipative = True")
        if self.is_dissipative and max(works) > AGREEMENT * size:
            raise mistake_of(self, "says that it is dissipative, and supplies energy")


class PointForce(Law):
    """A force on the centre of mass of a link, `force(velocity, parameters)`, in still air.

    The velocity is a list of its components (m/s), the force (N) one of as many.

    >>> from modal.extend import Parameter, PointForce
    >>> class Wake(PointForce):
    ...     name = "wake"
    ...     parameters = (Parameter("drag", "N s/m", low=0.0),)
    ...     def force(self, velocity, parameters):
    ...         return [-parameters["drag"] * component for component in velocity]
    >>> Wake().force([2.0, 0.0], {"drag": 0.5})
    [-1.0, -0.0]
    """

    kind = "point force"

    @classmethod
    def mistakes(cls) -> Iterator[str]:
        """Mistakes of parameters, and a missing force."""
        yield from super().mistakes()
        if cls.force is PointForce.force:
            yield "has no force"

    def force(self, velocity: Any, parameters: Values) -> Any:
        """The force (N) at a velocity (m/s), component by component."""
        raise NotImplementedError

    def linear_drag(self, parameters: Values) -> float:
        """The linear drag (N s/m) at rest."""
        along, _ = call(self, "force", [complex(0.0, IMAGINARY_STEP), 0.0], parameters, shape=(2,))
        return -complex(along).imag / IMAGINARY_STEP + 0.0

    def judge(self, parameters: Values) -> None:
        """Raise ExtensionError if it is not as declared: zero at rest, and isotropic for small motions."""
        with np.errstate(all="ignore"):
            at_rest = call(self, "force", [0.0, 0.0], parameters, shape=(2,))
            along, down = call(self, "force", [0.0, complex(0.0, IMAGINARY_STEP)], parameters, shape=(2,))
            drag = self.linear_drag(parameters)
        if any(at_rest):
            raise mistake_of(self, "force is not 0 at rest")
        if not isfinite(drag) or abs(complex(down).imag / IMAGINARY_STEP + drag) + abs(
            complex(along).imag / IMAGINARY_STEP
        ) > 1e-9 * abs(drag):
            raise mistake_of(self, "force differs from one direction of small motions to another")


# ------------------------------------------------------------------------------------------------------------- ours


class SpringLaw(JointLaw):
    """A spring at a joint or between a support and the ground.

    >>> from modal.extend.laws import SpringLaw
    >>> SpringLaw().torque(0.5, 0.0, {"stiffness": 4.0})
    -2.0
    """

    name = "spring"
    parameters = (Parameter("stiffness", "N m/rad", low=0.0),)
    is_odd = True

    def torque(self, angle: Any, rate: Any, parameters: Values) -> Any:
        """Return a torque against the angle."""
        return -parameters["stiffness"] * angle

    def potential(self, angle: Any, parameters: Values) -> Any:
        """Half the stiffness times the square of the angle."""
        return parameters["stiffness"] * angle**2 / 2


class DamperLaw(JointLaw):
    """A damper at a joint or between a support and the ground.

    >>> from modal.extend.laws import DamperLaw
    >>> DamperLaw().torque(0.0, 0.5, {"damping": 4.0})
    -2.0
    """

    name = "damper"
    parameters = (Parameter("damping", "N m s/rad", low=0.0),)
    is_odd, is_dissipative = True, True

    def torque(self, angle: Any, rate: Any, parameters: Values) -> Any:
        """Return a torque against the rate."""
        return -parameters["damping"] * rate


class VanDerPolLaw(JointLaw):
    """The torque e (1 − (γ/γ₀)²) γ', which supplies energy within γ₀ and dissipates it beyond.

    >>> from modal.extend.laws import VanDerPolLaw
    >>> VanDerPolLaw().torque(0.0, 0.5, {"strength": 4.0, "angle_deg": 10.0})
    2.0
    """

    name = "van-der-pol"
    parameters = (Parameter("strength", "N m s/rad", low=0.0), Parameter("angle_deg", "°", low=1e-6, high=180.0))
    is_odd, is_drive = True, True

    def torque(self, angle: Any, rate: Any, parameters: Values) -> Any:
        """Return a torque with the rate within γ₀, against it beyond."""
        curb = parameters["strength"] / (parameters["angle_deg"] * radians(1)) ** 2
        return (parameters["strength"] - curb * angle**2) * rate


class DragLaw(PointForce):
    """The force −(drag + quadratic_drag |v|) v [Landau1987, §§20 and 45].

    >>> from modal.extend.laws import DragLaw
    >>> [*map(float, DragLaw().force([3.0, 4.0], {"drag": 1.0, "quadratic_drag": 0.2}))]
    [-6.0, -8.0]
    """

    name = "drag"
    parameters = (Parameter("drag", "N s/m", low=0.0), Parameter("quadratic_drag", "N s²/m²", low=0.0, default=0.0))
    is_smooth = False

    def force(self, velocity: Any, parameters: Values) -> Any:
        """Return a force against the velocity."""
        strength, quadratic = parameters["drag"], parameters["quadratic_drag"]
        if not isinstance(quadratic, float) or quadratic:
            strength = strength + quadratic * sqrt(sum(component * component for component in velocity))
        return [-(strength * component) for component in velocity]


for _law in (SpringLaw, DamperLaw, VanDerPolLaw, DragLaw):
    register(_law)
