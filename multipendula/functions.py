"""Every command as a function: a keyword for each option, a result that shows what the command prints.

    mp.sweep(scene, "support.mass=0.05:0.2:6", measure="beat")

is the command `sweep` with these words, read and checked by its parser, and ends in the object that the command prints
(or in its text, where that has no object or was requested in a form of its own). Nothing is printed; what the command
says next to its result comes on standard error.
"""

from __future__ import annotations

import inspect
import keyword
import textwrap
from argparse import Namespace
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from importlib import import_module
from io import StringIO
from os import PathLike, fspath
from typing import TYPE_CHECKING, Any, NoReturn

import modal
import nonlinear
from multipendula.cli import perform
from multipendula.commands import command_named
from multipendula.commands.runs import recorded
from multipendula.commands.shared import text_into, with_keywords
from multipendula.options import PICTURES, Joined, Repeated

if TYPE_CHECKING:
    from modal.scene import Scene
    from multipendula.command import Command, Option
    from multipendula.parser import Page
    from nonlinear.integration import Trajectory
    from nonlinear.sweeps import Sweep

    Arguments = Sequence[tuple[Option, Any]]

Parameter = inspect.Parameter
SECOND = frozenset({"--vary", "--uncertain", "--free", "--mode", "--duration", "--to"})
"""Options of which the first that a command takes may follow its arguments without a keyword."""
WITHOUT = frozenset({"--quiet"})
"""Options of the command line alone."""
FORMS = frozenset({"--format", "--columns", "--words", "--sensitivities", "--energies", "--shapes", "--show"})
"""Options that request a text of its own form, which the function then returns."""
ROWS, SCENE = "int | range | str", "Scene | str | PathLike[str]"
TYPES = {
    **{"1:10": ROWS, "1:12": ROWS, "FILE": "str | PathLike[str]", "FROM:TO": "tuple[float, float] | str"},
    **{"K/N": "tuple[int, int] | str", "SCENE": SCENE, "TARGET": SCENE, "FIT.json": "str | PathLike[str]"},
    "CSV": "float | str | PathLike[str]",
}
OBJECTS = {"SCENE": ("Scene", "Trajectory"), "TARGET": ("Scene",), "WORDS": ("State",)}
"""Classes of values that are taken as they are, by metavar."""
RECORDED = "saved run"
"""The marks of an argument that may be a run."""
READ = dict.fromkeys(("angles", "frequencies"), "float | Sequence[float]") | {"joules": "float"}
"""Types of values by their metavar, and by their readers."""
SIGNS = {"FROM:TO": ":", "K/N": "/"}
"""The separator of the numbers of an option that has several; a comma by default."""

WRITERS = {"Scene": "modal.scene", "Trajectory": "nonlinear.files", "Sweep": "nonlinear.sweeps"}
"""The objects that `save` writes, and the subpackage that does so."""


class Text(str):
    """The output of a command, which displays itself verbatim."""

    __slots__ = ()

    def __repr__(self) -> str:
        return self.rstrip("\n")


class Results(tuple[Any, ...]):
    """Several results, which display the command's output."""

    text: str

    def __repr__(self) -> str:
        return self.text.rstrip("\n")


@cache
def function_of(name: str) -> Callable[..., Any]:
    """The command of this name as a function.

    >>> function_of("table")("chain-1").omega.round(4).tolist()
    [3.1321]
    """
    command = command_named(name)
    assert command is not None
    options = {keyword_of(taken): taken for taken in command.options if taken.name not in WITHOUT}
    signature = inspect.Signature(list(_parameters(options)), return_annotation=_return_type(command))

    def function(*arguments: Any, **keywords: Any) -> Any:
        try:
            given = signature.bind(*arguments, **keywords).arguments
        except TypeError as error:
            raise TypeError(f"{name}: {error}{_suggestion(command.page(), options, keywords)}") from None
        return _result_of(command, [(taken, given[word]) for word, taken in options.items() if word in given])

    function.__name__ = function.__qualname__ = name
    function.__module__ = "multipendula"
    function.__annotations__ = {}  # those of the signature hold
    function.__signature__ = signature  # type: ignore[attr-defined]
    function.__doc__ = "\n".join(_docstring(command, options))
    return function


def __getattr__(name: str) -> Callable[..., Any]:
    """The commands by their names."""
    if name.startswith("_") or command_named(name) is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}", name=name)
    return function_of(name)


def keyword_of(taken: Option) -> str:
    """The keyword of an option, its name with underscores; of --from, a reserved word, its replacement."""
    return taken.keyword if keyword.iskeyword(taken.name.strip("-")) else taken.name.strip("-").replace("-", "_")


def _parameters(options: Mapping[str, Option]) -> Iterator[inspect.Parameter]:
    """The arguments, then the option that may follow them, by position or keyword; all others by keyword."""
    second = next((word for word, taken in options.items() if taken.name in SECOND), None)
    first = [word for word, taken in options.items() if not taken.name.startswith("-") or word == second]
    for word in sorted(options, key=lambda word: first.index(word) if word in first else len(first)):
        taken, how = options[word], options[word].how or {}
        is_required = how.get("required", not taken.name.startswith("-") and how.get("nargs") != "?")
        default = how.get("default", taken.flag.default)
        kind, told = type_of(taken), default if taken.flag.metavar or taken.flag.choices else False
        yield Parameter(
            word,
            Parameter.POSITIONAL_OR_KEYWORD if word in first else Parameter.KEYWORD_ONLY,
            default=Parameter.empty if is_required else told,
            annotation=kind if is_required or told is not None else f"{kind} | None",
        )


def _return_type(command: Command) -> str:
    """The return annotation of a function; a text where the command has no result."""
    return str(inspect.signature(command.run).return_annotation).replace("None", "Text")


def type_of(taken: Option) -> str:
    """The type of an option's values, as an annotation.

    >>> from multipendula.command import option
    >>> type_of(option("--vary")), type_of(option("--duration")), type_of(option("--loci"))
    ('str | Sequence[str] | Mapping[str, Any]', 'float', 'bool')
    """
    flag, how = taken.flag, taken.how or {}
    if not taken.name.startswith("-"):
        of_several = " | Sequence[str]" * (how.get("nargs") == "+")
        return "Trajectory | " * (RECORDED in flag.meaning) + TYPES.get(flag.metavar, f"{TYPES['FILE']}{of_several}")
    if taken.name == "--start":
        return "State | str"
    if not (flag.metavar or flag.choices):
        return "bool"
    if flag.metavar in TYPES:
        return TYPES[flag.metavar]
    name, unit = getattr(flag.type, "__name__", ""), getattr(flag.type, "of", "")
    kind = READ.get(name) or ("int" if unit == "whole number" else "float" if unit else "str")
    several = flag.action is Joined or (flag.action is Repeated and how.get("most") != 1)
    pairs = " | Mapping[str, Any]" * (flag.action is Repeated and "=" in flag.metavar)
    return f"{kind} | Sequence[{kind}]{pairs}" if several and name not in READ else f"{kind}{pairs}"


def _docstring(command: Command, options: Mapping[str, Option]) -> Iterator[str]:
    yield with_keywords(command.summary)
    yield from ("", *_lines_of(command.details), "", "Parameters", "----------")
    for word, taken in options.items():
        yield from (word, *_lines_of(taken.words.replace("%%", "%"), "    "))
    yield from ("", "Returns", "-------", _return_type(command))


def _lines_of(words: str, indent: str = "") -> list[str]:
    """Words with the keywords of options, as lines of a docstring."""
    words = words.replace("repeat for several", "or a list of several")
    return textwrap.wrap(
        with_keywords(words), 88, initial_indent=indent, subsequent_indent=indent, break_on_hyphens=False
    )


def _suggestion(page: Page, options: Mapping[str, Option], keywords: Mapping[str, object]) -> str:
    """A suggestion for the first unknown keyword."""
    page.given = [f"--{word.replace('_', '-')}" for word in keywords if word not in options]
    return next((with_keywords(words.partition("no such option")[2]) for words in page._strangers()), "")


def _result_of(command: Command, given: Arguments) -> Any:
    """The result of the command with these options."""
    try:
        options = _options_of(command.page(), given)
        with text_into(StringIO(), of_function=True) as text:
            result = perform(options)
    except modal.SceneError as error:
        if type(error) is not modal.SceneError:
            raise
        raise modal.SceneError([with_keywords(problem, quote="") for problem in error.problems]) from None
    is_text = result is None or any(taken.name in FORMS and value for taken, value in given)
    told = text.getvalue()
    if isinstance(result, tuple) and not hasattr(result, "_fields"):
        result = Results(result)
        result.text = told
    return Text(told) if is_text and told else result


def _options_of(page: Page, given: Arguments) -> Namespace:
    """The options of a command as its parser reads them; objects are passed unchanged."""

    def refuse(message: str) -> NoReturn:
        raise modal.SceneError([message.removeprefix("argument ")])

    page.error = refuse  # type: ignore[method-assign]
    page.keywords = {}  # messages call arguments by their names
    page.usual = "" if page.usual.endswith(PICTURES) else page.usual  # a figure is returned
    words, last, objects = [], ["--"], {}
    for taken, value in given:
        if value is None or value is False:
            continue
        if type(value).__name__ in OBJECTS.get(taken.flag.metavar, ()):
            objects[taken.dest] = value
            last += [] if taken.name.startswith("-") else [taken.dest]
        elif value is True:
            words.append(taken.name)
        elif taken.name.startswith("-"):
            words += [f"{taken.name}={word}" for word in _words_of(taken, value)]
        else:
            last += _words_of(taken, value)
    options: Namespace = page.parse_args([*words, *last])
    vars(options).update(objects)
    return options


def _words_of(taken: Option, value: Any) -> list[str]:
    """A value as words of a command line.

    A mapping has a word PLACE=VALUE for each of its entries, a list one for each item where an option is repeated.
    """
    several = taken.flag.action is Repeated or (taken.how or {}).get("nargs") == "+"
    value = value.tolist() if hasattr(value, "tolist") else value
    if isinstance(value, Mapping):
        return [f"{place}={_word(taken, item)}" for place, item in value.items()]
    items = value if several and isinstance(value, list | tuple) else [value]
    return [_word(taken, item) for item in items]


def _word(taken: Option, value: Any) -> str:
    value = value.tolist() if hasattr(value, "tolist") else value
    if isinstance(value, range) and value:
        return f"{value[0]}:{value[-1]}"
    if isinstance(value, list | tuple):
        return SIGNS.get(taken.flag.metavar, ",").join(_word(taken, item) for item in value)
    return fspath(value) if isinstance(value, PathLike) else str(value)


def load(source: str | PathLike[str]) -> Scene | Trajectory:
    """The scene at a path or of a shipped name, or the run saved there: the class of what is returned says which.

    >>> load("crane-hook").title
    'Crane trolley with a hook and a load'
    """
    if recorded(fspath(source)):
        return nonlinear.load(source)

    return modal.load(source)


def save(thing: Scene | Trajectory | Sweep, path: str | PathLike[str]) -> None:
    """Write a scene (.toml), a run (.npz or .csv) or a sweep (.npz, .csv or .json): whole, or not at all.

    Every other result is written by `output` of the function that gives it.
    """
    from modal.scene.doors import require_type

    require_type("thing", thing, *WRITERS)
    room = import_module(WRITERS[type(thing).__name__])
    (room.dump if room.__name__ == "modal.scene" else room.save)(thing, path)
