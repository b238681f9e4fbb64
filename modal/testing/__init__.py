"""Tests for extension packages: checks that their laws, supports, measures and formats are correct.

In: a class of `modal.extend`, as a test class names it.  Out: some forty tests by pytest, which compare its physics by
routes that do not know each other:

    from modal.testing import LawTests
    from magnet import Magnet

    class TestMagnet(LawTests):
        extension, parameters = Magnet, {"strength": 0.02}

Start with `extensions`, which has what all kinds are tested for, and the classes of measures and formats; `mechanics`
has those of laws, forces and supports.
"""

from modal.testing.extensions import ExtensionTests, FormatTests, MeasureTests
from modal.testing.mechanics import ForceTests, LawTests, SupportTests

__all__ = ["ExtensionTests", "ForceTests", "FormatTests", "LawTests", "MeasureTests", "SupportTests"]
__dir__ = __all__.copy
