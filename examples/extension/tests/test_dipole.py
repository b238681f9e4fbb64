"""What `modal.testing` asks of the three classes of this package."""

from dipole import CapturedShare, Dipole, RowLists

from modal.testing import FormatTests, LawTests, MeasureTests


class TestDipole(LawTests):
    extension, parameters = Dipole, {"strength": 0.3, "gap": 0.4}


class TestCapturedShare(MeasureTests):
    extension = CapturedShare


class TestRowLists(FormatTests):
    extension = RowLists
