"""Laws of joints for tests, as a stranger's package has them, and scenes with them."""

from __future__ import annotations

from typing import Any

from modal import Scene
from modal.extend import JointLaw, Parameter, PointForce, exp, register, sin, tanh
from modal.scene.files import parse


@register
class Magnet(JointLaw):
    """An anharmonic torque −s sin(n γ) of magnets around a joint."""

    name = "magnet"
    parameters = (Parameter("strength", "N m"), Parameter("order", "", 1.0, 9.0, 3.0))
    is_odd = True

    def torque(self, angle: Any, rate: Any, parameters: Any) -> Any:
        """Towards the nearest magnet."""
        return -parameters["strength"] * sin(parameters["order"] * angle)

    def potential(self, angle: Any, parameters: Any) -> Any:
        """From the angle 0."""
        order = parameters["order"]
        return 2 * parameters["strength"] * sin(order * angle / 2) ** 2 / order


@register
class Grease(JointLaw):
    """A damper that gets weaker with speed and harder with the bend, and pulls one way."""

    name = "grease"
    parameters = (Parameter("strength", "N m", low=0.0), Parameter("pull", "N m/rad", low=0.0, default=0.0))
    is_dissipative = True

    def torque(self, angle: Any, rate: Any, parameters: Any) -> Any:
        """A saturated damper and a spring that hardens."""
        return -parameters["strength"] * (1 + angle**2) * tanh(rate) - parameters["pull"] * (exp(angle) - 1)

    def potential(self, angle: Any, parameters: Any) -> Any:
        """Of the spring."""
        return parameters["pull"] * (exp(angle) - angle - 1)


@register
class Engine(JointLaw):
    """A torque without a potential: it follows the bend and the rate."""

    name = "engine"
    parameters = (Parameter("gain", "N m/rad"), Parameter("lead", "N m s/rad"))

    def torque(self, angle: Any, rate: Any, parameters: Any) -> Any:
        """Of odd and even powers."""
        return parameters["gain"] * (angle - angle**3) + parameters["lead"] * rate / (1 + angle**2 + angle)


FILE = """
gravity = 9.81
{support}
[[pendulum]]
links = [
  {{ kind = "bob", mass = 1.0, length = 1.0, stiffness = 0.2, law = {{ kind = "magnet", strength = 0.5 }} }},
  {{ kind = "rod", mass = 0.5, length = 0.7, damping = 0.01, law = [{laws}] }},
]
equilibrium = ["down", "{way}"]
start = {{ angles_deg = [30.0, {start}] }}
"""
CART = '[support]\nkind = "cart"\nmass = 2.0\nstiffness = 3.0'
GREASE = '{ kind = "grease", strength = 0.1, pull = 0.4 }'
ENGINE = '{ kind = "engine", gain = 0.3, lead = 0.02 }'


def lawful_scene(support: str = CART, laws: str = f"{GREASE}, {ENGINE}", way: str = "down") -> Scene:
    """Two links with laws at both joints."""
    return parse(FILE.format(support=support, laws=laws, way=way, start=-20.0 if way == "down" else 170.0).encode())


@register
class Wake(PointForce):
    """A drag that grows with the square of the speed."""

    name = "wake"
    parameters = (Parameter("drag", "N s/m", low=0.0), Parameter("growth", "N s³/m³", low=0.0, default=0.0))

    def force(self, velocity: Any, parameters: Any) -> Any:
        """Against the velocity."""
        speed_square = sum(component * component for component in velocity)
        return [-(parameters["drag"] + parameters["growth"] * speed_square) * component for component in velocity]
