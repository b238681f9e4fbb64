"""The warning about the other distribution that owns the import name."""

import warnings
from pathlib import Path

import pytest

from modal._namesake import warn_about_namesake


def test_the_other_distribution_is_named(tmp_path: Path) -> None:
    (tmp_path / "modal-1.2.dist-info").mkdir()
    with pytest.warns(UserWarning, match="the Modal cloud client"):
        warn_about_namesake(["", str(tmp_path)])


@pytest.mark.parametrize("folder", ["modal_client-1.2.dist-info", "multimodal-1.dist-info", "modal"])
def test_others_are_not(tmp_path: Path, folder: str) -> None:
    (tmp_path / folder).mkdir()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warn_about_namesake([str(tmp_path), str(tmp_path / "nowhere")])
