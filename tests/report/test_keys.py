"""The keys of JSON, which programs read, are those that were stored, to the letter and in their order."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from multipendula.cli import main

STORED: dict[str, list[str]] = json.loads((Path(__file__).parent / "written" / "keys.json").read_text("utf-8"))
FILES = {
    "modes.csv": "mode,frequency_hz,std_hz\n1,0.38,0.001\n2,0.92,0.002\n",
    "psd.csv": "frequency_hz,psd\n0.1,1e-3\n10,1e-3\n",
    "record.csv": "time_s,acceleration_m_per_s2\n0,0\n0.1,1\n0.2,1\n0.3,0\n",
}


def keys(value: Any, place: str = "") -> Iterator[str]:
    """Every key with those that it stands in, those in a list once."""
    if isinstance(value, dict):
        for key, part in value.items():
            yield f"{place}{key}"
            yield from keys(part, f"{place}{key}.")
    elif isinstance(value, list):
        for part in value:
            yield from keys(part, f"{place}[].")


@pytest.mark.parametrize("command", STORED)
def test_json_has_the_keys_that_it_had(
    command: str, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name, content in FILES.items():
        (tmp_path / name).write_text(content, encoding="utf-8")
    assert main([*command.split(), "--format", "json"]) == 0
    assert list(dict.fromkeys(keys(json.loads(capsys.readouterr().out)))) == STORED[command]
