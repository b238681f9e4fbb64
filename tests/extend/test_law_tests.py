"""The tests that a stranger's package runs, on laws of several natures, and that they bite."""

from __future__ import annotations

from types import MappingProxyType

from support import magnets

from modal.extend.laws import VanDerPolLaw
from modal.testing import LawTests


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
