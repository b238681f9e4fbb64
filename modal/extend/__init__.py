"""Interfaces for extensions: joint laws, point forces, supports, measures and formats.

In: a class of another package or of a script. Out: the same class, known by its kind and name in scene files, options
and lists. The built-in ones use the same base classes:

    from modal.extend import JointLaw, Parameter, register, sin

    @register
    class Magnet(JointLaw):
        name = "magnet"
        parameters = (Parameter("strength", "N m", low=0.0),)

        def torque(self, angle, rate, parameters):
            return -parameters["strength"] * sin(3 * angle)

JointLaw and PointForce give torques and forces, Support the positions of pivots, Measure numbers of a scene or a
motion, Format the bytes of a file. They are plain arithmetic with the functions of `scalars`, which accept floats,
arrays, complex numbers, recorded symbols and expressions of SymPy alike. A package names its classes in the group
`multipendula.extensions` of its entry points; they are loaded when a name is first needed. Nothing in a scene file is
ever executed. Failures of an extension raise ExtensionError, with its name and package. Start with `registry`.
"""

from typing import TYPE_CHECKING

from modal.lazy import lazy_attributes

if TYPE_CHECKING:
    from modal.errors import ExtensionError
    from modal.extend.formats import Format
    from modal.extend.laws import JointLaw, PointForce
    from modal.extend.measures import Measure
    from modal.extend.registry import Extension, Parameter, find_extension, register, registered, registration
    from modal.extend.scalars import cos, exp, log, sin, sqrt, tanh
    from modal.extend.supports import Support, SupportCoordinate

__all__ = [
    "Extension",
    "ExtensionError",
    "Format",
    "JointLaw",
    "Measure",
    "Parameter",
    "PointForce",
    "Support",
    "SupportCoordinate",
    "cos",
    "exp",
    "find_extension",
    "log",
    "register",
    "registered",
    "registration",
    "sin",
    "sqrt",
    "tanh",
]

if not TYPE_CHECKING:
    __getattr__ = lazy_attributes(__name__)
