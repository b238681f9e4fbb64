"""Tests for those who extend: what a package runs to know that its laws, supports, measures and formats are right.

In: a class of `modal.extend`, as a test class names it.  Out: some forty tests by pytest, which compare its physics by
routes that do not know each other:

    from modal.testing import LawTests
    from magnet import Magnet

    class TestMagnet(LawTests):
        extension, parameters = Magnet, {"strength": 0.02}

Start with `extensions`, which has what all kinds are tested for; `laws`, `measures` and `formats` have one class each.
"""

from modal.testing.extensions import ExtensionTests
from modal.testing.formats import FormatTests
from modal.testing.laws import LawTests
from modal.testing.measures import MeasureTests

__all__ = ["ExtensionTests", "FormatTests", "LawTests", "MeasureTests"]
__dir__ = __all__.copy
