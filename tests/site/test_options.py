"""Every option of every command means what the table of options says, or stands among the exceptions."""

from __future__ import annotations

import pytest
from generated import combinations, options, parsers

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


def test_the_pages_hold_every_entry() -> None:
    page = combinations()
    assert all(f"## {at}. {name}" in page for at, name in enumerate(CAPABILITIES, 1))
    assert all(f"\n| {one.words} |" in page for one in FEATURES.values())
    assert all(f"`{flag}" in options() for flag in FLAGS)
