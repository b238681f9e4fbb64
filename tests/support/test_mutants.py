"""Faults that are put in on purpose: which they are, and what the text of the file is then."""

from __future__ import annotations

from pathlib import Path

import pytest
from faults import Fault, Faults, with_fault
from mutants import Result, compare, read_results

SOURCE = '''"""Ω of a module."""
NEAR, WHERE = 1e-3, 4
FAR: float = 2.0


def sign(α, things):
    things.append(-α)
    if α < 0 and things:
        raise ValueError(f"{α + 1}")
    things[0] += α - (
        1 + α)
    return α
'''


def faults() -> dict[tuple[str, str], str]:
    return {(site.fault.old, site.fault.new): with_fault(SOURCE, site) for site in Faults("modal/x.py", SOURCE).sites}


def test_every_kind_is_found_and_nothing_in_messages() -> None:
    kinds = [site.fault.kind for site in Faults("modal/x.py", SOURCE).sites]
    assert (kinds.count("number"), kinds.count("operator"), kinds.count("statement")) == (2, 5, 3)


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        ("2.0", "(2.0 / 8)", "FAR: float = (2.0 / 8)"),
        ("-α", "(α)", "    things.append((α))"),
        ("α < 0", "(α <= 0)", "    if (α <= 0) and things:"),
        ("α < 0 and things", "(α < 0 or things)", "    if (α < 0 or things):"),
        ("things.append(-α)", "pass", "    pass"),
        ("α - (\n        1 + α)", "(α + (1 + α))", "    things[0] += (α + (1 + α))"),
    ],
)
def test_a_fault_changes_its_own_text_alone(old: str, new: str, line: str) -> None:
    changed = faults()[old, new]
    assert line in changed.splitlines()
    assert changed.replace(line, "") == SOURCE.replace(line.replace(new, old, 1), "")


def test_two_runs_are_compared_by_room(tmp_path: Path) -> None:
    fault, other = (Fault("operator", f"modal/eigen/{name}.py", "f", "a < b", "(a <= b)") for name in "xy")
    for name, states in (("before", ("killed", "hung")), ("after", ("killed", "alive"))):
        (tmp_path / name).mkdir()
        rows = [Result(each, state, "t", 1, 0.5).to_json() for each, state in zip((fault, other), states, strict=True)]
        (tmp_path / name / "results.jsonl").write_text("\n".join(rows), encoding="utf-8")
    assert read_results(tmp_path / "after" / "results.jsonl")[other].state == "alive"
    said = compare(tmp_path / "after", tmp_path / "before")
    assert "| modal.eigen | 2 of 2 | 1 of 2 |" in said
    assert f"- hung, alive: {other}" in said
