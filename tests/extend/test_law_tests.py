"""The tests that a stranger's package runs, on laws, forces and supports of several natures."""

from __future__ import annotations

from types import MappingProxyType

from support import magnets

from modal.extend.laws import DragLaw, VanDerPolLaw
from modal.scene.carriers import PlatformMotion, SwingMotion
from modal.testing import ForceTests, LawTests, SupportTests


class TestMagnet(LawTests):
    """Conservative and odd."""

    extension, parameters = magnets.Magnet, MappingProxyType({"strength": 0.5, "order": 3.0})


class TestGrease(LawTests):
    """Dissipative, with a potential."""

    extension, parameters = magnets.Grease, MappingProxyType({"strength": 0.1, "pull": 0.4})


class TestEngine(LawTests):
    """Neither."""

    extension, parameters = magnets.Engine, MappingProxyType({"gain": 0.3, "lead": 0.02})


class TestVanDerPol(LawTests):
    """Ours."""

    extension, parameters = VanDerPolLaw, MappingProxyType({"strength": 0.1, "angle_deg": 8.0})


class TestWake(ForceTests):
    """Smooth."""

    extension, parameters = magnets.Wake, MappingProxyType({"drag": 0.2, "growth": 0.05})


class TestDrag(ForceTests):
    """Ours, which is not."""

    extension, parameters = DragLaw, MappingProxyType({"drag": 0.2, "quadratic_drag": 0.1})


class TestSwing(SupportTests):
    """Ours, of one coordinate."""

    extension, parameters = SwingMotion, MappingProxyType({"mass": 2.0, "length": 1.5, "damping": 0.1})


class TestPlatform(SupportTests):
    """Of three."""

    extension = PlatformMotion
    parameters = MappingProxyType(
        {"mass": 2.0, "inertia": 0.1, "stiffness": {"sway": 30.0, "heave": 200.0, "roll": 40.0}}
    )
