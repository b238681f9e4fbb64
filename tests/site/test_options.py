"""Every option has one meaning in all commands: that of the table, with which help pages begin what they say of it."""

from __future__ import annotations

import argparse
import tomllib
from collections import defaultdict
from importlib import import_module
from inspect import isfunction
from pathlib import Path
from pkgutil import iter_modules

import pytest
from generated import combinations, function_named, functions, options, parsers
from namespace import STUB, stub

import modal
import nonlinear
from modal.scene import CAPABILITIES, FEATURES
from multipendula.cli import main
from multipendula.flags import FLAGS, FORMER

PARTICULAR = {"beamer"}
"""Words of a choice that one command alone can take: only a derivation makes slides."""
Use = tuple[str, argparse.Action]
"""A command and its option."""


def uses(pages: dict[str, argparse.ArgumentParser]) -> dict[str, list[Use]]:
    """The commands that take each option, which goes by its long name."""
    by_flag: dict[str, list[Use]] = defaultdict(list)
    for command, page in pages.items():
        for action in page._actions:
            for flag in (word for word in action.option_strings if word.startswith("--")):
                by_flag[flag].append((command, action))
    return by_flag


def kind_of(action: argparse.Action) -> tuple[object, ...]:
    """What a value of an option is: how it is written, how many, what becomes of it, and what it is read as."""
    convert = action.type
    return (
        action.metavar,
        action.nargs,
        type(action).__name__,
        getattr(convert, "of", getattr(convert, "__name__", convert)),
        bool(action.choices) and action.metavar is None,
    )


def several_meanings(used: dict[str, list[Use]]) -> dict[str, set[str]]:
    """The options that mean several things, with the commands of each meaning but the most frequent one.

    Commands mean the same if its value is the same kind of thing, if their help begins with the meaning in the table,
    and if, of a choice of words, one of them takes all that the others take but for particular ones.
    """
    odd: dict[str, set[str]] = {}
    for flag, known in used.items():
        groups: dict[object, set[str]] = defaultdict(set)
        widest = max((set(action.choices or ()) for _, action in known), key=len)
        for command, action in known:
            entry = FLAGS.get(flag)
            told = bool(entry and (action.help or "").startswith(entry.words))
            told &= (action.metavar or "") == (entry and entry.metavar)
            groups[(kind_of(action), told, set(action.choices or ()) - PARTICULAR <= widest)].add(command)
        usual = max(groups, key=lambda group: (group[1], len(groups[group])))  # type: ignore[index]
        others = set().union(*(names for group, names in groups.items() if group != usual or not group[1]))  # type: ignore[index]
        if others:
            odd[flag] = others
    return odd


def test_no_option_has_several_meanings() -> None:
    assert several_meanings(uses(parsers())) == {}


def page_with(**how: object) -> argparse.ArgumentParser:
    page = argparse.ArgumentParser(add_help=False)
    page.add_argument(how.pop("flag", "--modes"), **how)  # type: ignore[arg-type]
    return page


@pytest.mark.parametrize(
    "how",
    [
        {"metavar": "1:10", "help": "write the modes to this file"},
        {"metavar": "FILE", "help": "rows of the table of modes"},
        {"metavar": "1:10", "help": "rows of the table of modes", "type": int},
        {"metavar": "1:10", "help": "rows of the table of modes", "action": "append"},
        {"metavar": "1:10", "help": "rows of the table of modes", "nargs": "+"},
        {"flag": "--new", "help": "-"},
    ],
)
def test_another_meaning_is_found(how: dict[str, object]) -> None:
    usual = {name: page_with(metavar="1:10", help="rows of the table of modes") for name in ("table", "shapes")}
    assert several_meanings(uses(usual)) == {}
    flag = str(how.get("flag", "--modes"))
    assert several_meanings(uses(usual | {"odd": page_with(**how)})) == {flag: {"odd"}}


def test_other_choices_are_another_meaning() -> None:
    pages = {
        str(at): page_with(flag="--kind", choices=words, help="kind of input shaper")
        for at, words in enumerate((("zv", "zvd"), ("zv",), ("bob", "zv")))
    }
    assert several_meanings(uses(pages)) == {"--kind": {"2"}}


def test_the_table_has_every_option_and_none_that_is_gone() -> None:
    assert FLAGS.keys() == uses(parsers()).keys()


@pytest.mark.parametrize(("command", "flag"), FORMER)
def test_a_former_spelling_is_told_with_the_new_one(
    command: str, flag: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Next to its name, and with an equals sign; where the option is still there, for the values that are not."""
    former, known = FORMER[command, flag], parsers()[command]._option_string_actions
    assert former.now in known
    assert bool(former.values) == (flag in known)
    value = {"--tolerance": "support.mass=2%", "--output": "angles"}.get(flag, "1") if former.values else "1"
    for words in ([flag, value], [f"{flag}={value}"]):
        with pytest.raises(SystemExit) as left:
            main([command, "crane-hook", *words])
        assert left.value.code == 2
        assert (
            f"multipendula: {flag}{f' {value}' if former.values else ''}: is now {former.now}"
            in capsys.readouterr().err
        )


def test_values_of_today_are_taken_where_an_option_stays() -> None:
    assert not FORMER["spread", "--tolerance"].words("--tolerance", "1e-10")
    assert not FORMER["response", "--output"].words("--output", "angles.txt")


def test_every_command_has_its_functions() -> None:
    told = tomllib.loads((Path(__file__).parents[2] / "docs" / "functions.toml").read_text("utf-8"))
    assert told.keys() == parsers().keys()
    named = {name for entry in told.values() for names in entry.values() for name in names}
    assert all(callable(function_named(name)) for name in named)
    assert all(entry for command, entry in told.items() if command != "completion")
    page = functions()
    assert all(f"`{command}`](" in page for command in told)
    assert all(name in page for name in named)


def test_no_public_function_is_missing_on_the_page_of_functions() -> None:
    page = functions()
    rooms = [
        import_module(f"{package.__name__}{inner}")
        for package in (modal, nonlinear)
        for inner in ("", *(f".{room.name}" for room in iter_modules(package.__path__) if room.ispkg))
    ]
    public = [(room, name) for room in rooms for name in room.__all__]
    assert len(rooms) > 30
    assert not [name for room, name in public if isfunction(getattr(room, name)) and f".{name}" not in page]


def test_editors_see_the_namespace_as_it_is() -> None:
    assert STUB.read_text(encoding="utf-8") == stub(), "python docs/namespace.py makes it anew"


def test_the_pages_hold_every_entry() -> None:
    page = combinations()
    assert all(f"## {at}. {name}" in page for at, name in enumerate(CAPABILITIES, 1))
    assert all(f"\n| {feature.words} |" in page for feature in FEATURES.values())
    table = options()
    assert all(f"`{flag}" in table for flag in FLAGS)
    assert "| `tolerance` |" in table
