"""Every option of every command means what the table of options says, or stands among the exceptions."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest
from generated import combinations, function_named, functions, options, parsers

from modal.scene import CAPABILITIES, FEATURES
from multipendula.flags import FLAGS, OTHERWISE


def flags(command: str) -> dict[str, str]:
    """The longest name of every option of a command, with its metavar."""
    actions = [action for action in parsers()[command]._actions if action.option_strings]
    named = (
        (next((flag for flag in FLAGS if flag in one.option_strings), one.option_strings[-1]), one) for one in actions
    )
    return {flag: str(one.metavar or "") for flag, one in named}


@pytest.mark.parametrize("command", parsers())
def test_every_option_is_in_the_table(command: str) -> None:
    for flag, metavar in flags(command).items():
        assert flag in FLAGS, f"{command} {flag}: stands in no table"
        assert (command, flag) in OTHERWISE or metavar == FLAGS[flag][0]


def test_the_table_has_no_option_and_no_exception_that_is_gone() -> None:
    used = {(command, flag) for command in parsers() for flag in flags(command)}
    assert FLAGS.keys() == {flag for _, flag in used}
    assert OTHERWISE.keys() <= used


def test_every_command_has_its_functions() -> None:
    told = tomllib.loads((Path(__file__).parents[2] / "docs" / "functions.toml").read_text("utf-8"))
    assert told.keys() == parsers().keys()
    named = {name for entry in told.values() for names in entry.values() for name in names}
    assert all(callable(function_named(name)) for name in named)
    assert all(entry for command, entry in told.items() if command != "completion")
    page = functions()
    assert all(f"`{command}`](" in page for command in told)
    assert all(name in page for name in named)


def test_the_pages_hold_every_entry() -> None:
    page = combinations()
    assert all(f"## {at}. {name}" in page for at, name in enumerate(CAPABILITIES, 1))
    assert all(f"\n| {one.words} |" in page for one in FEATURES.values())
    assert all(f"`{flag}" in options() for flag in FLAGS)
