"""Checks of the arguments of public functions against their annotations.

    @checked
    def mode_orbit(scene: Scene, number: int, amplitude: float) -> Orbit: …

    mode_orbit("chain-2", 1.5, nan)

    scene: a Scene is required, not str: load("chain-2") gives one
    number 1.5: must be a whole number
    amplitude nan: must be a finite number

The checks are made here once, so that functions need not repeat their signatures; ranges are checked by the functions.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial, wraps
from math import isfinite, isnan
from numbers import Integral, Real
from os import PathLike
from typing import Any, Literal, TypeVar, get_args, get_origin

import numpy as np

from modal.errors import SceneError, refuse_any, spelling_hint
from modal.report.results import VALUE_LETTERS

Function = TypeVar("Function", bound=Callable[..., Any])
Check = Callable[[object], str]
"""What is wrong with a value, "" where nothing is."""
LISTS = ("Sequence", "Iterable", "tuple", "list")
WAYS = {
    "Scene": ': load("{value}") gives one',
    "Modes": ": natural_modes(scene) gives them",
    "Trajectory": ": simulate(scene, duration) gives one",
    "State": ": state_at_rest(scene, angles_deg) gives one",
    "System": ": system_of(scene) gives one",
    "Variation": ': parse_variations(["support.mass=1:10:5"]) gives some',
}
"""How to obtain the required object, by its type."""


def checked(function: Function) -> Function:
    """Decorate a function to raise one SceneError for all arguments of wrong types.

    Numbers must be finite, unless the default is infinite. Annotations other than a type, a number, words or a list of
    them are not checked.
    """
    door = _Door(function)

    @wraps(function)
    def checking(*arguments: Any, **keywords: Any) -> Any:
        if problems := list(door.problems(arguments, keywords)):
            raise SceneError(problems)
        return function(*arguments, **keywords)

    return checking  # type: ignore[return-value]


def formerly(**names: str) -> Callable[[Function], Function]:
    """Decorate a function whose arguments had these names before: one SceneError gives the present names.

    >>> @formerly(orbits="members")
    ... def draw(scene: str, *, members: int = 24) -> int:
    ...     return members
    >>> try:
    ...     draw("chain-2", orbits=3)
    ... except SceneError as error:
    ...     print(error)
    orbits: is now members
    """

    def decorator(function: Function) -> Function:
        @wraps(function)
        def renaming(*arguments: Any, **keywords: Any) -> Any:
            refuse_any(f"{name}: is now {names[name]}" for name in keywords if name in names)
            return function(*arguments, **keywords)

        return renaming  # type: ignore[return-value]

    return decorator


def problem_of(kind: str, value: object) -> str:
    """Return why a value is not of a kind, the name of a class; "" if it is.

    >>> problem_of("Modes", "chain-2")
    'a Modes is required, not str: natural_modes(scene) gives them'
    """
    if kind in [cls.__name__ for cls in type(value).__mro__]:
        return ""
    way = WAYS.get(kind, "")
    if "{value}" in way:
        way = way.format(value=value) if isinstance(value, str | PathLike) else ""
    return f"a {kind} is required, not {type(value).__name__}{way}"


def require_type(name: str, value: object, *kinds: str) -> None:
    """Raise SceneError for an argument of none of these kinds, names of classes.

    >>> try:
    ...     require_type("trajectory", "run.npz", "Trajectory")
    ... except SceneError as error:
    ...     print(error)
    trajectory: a Trajectory is required, not str: simulate(scene, duration) gives one
    """
    problems = [problem_of(kind, value) for kind in kinds]
    if all(problems):
        raise SceneError([f"{name}: {problems[0]}"])


def checked_number(name: str, value: object, lowest: float = -float("inf"), highest: float = float("inf")) -> float:
    """Return a finite number within bounds; raise SceneError with any other value.

    >>> checked_number("energy", 2)
    2.0
    """
    number = float(value) if _is_finite(value) else float("nan")  # type: ignore[arg-type]
    if not isfinite(number) or not lowest <= number <= highest:
        bounds = [f" from {lowest:g}"] * isfinite(lowest) + [f" to {highest:g}"] * isfinite(highest)
        raise SceneError([f"{name} {_value_text(value)}: must be a finite number{''.join(bounds)}"])
    return number


def checked_index(name: str, value: object, lowest: int, highest: int) -> int:
    """Return an integer from `lowest` to `highest`; raise SceneError with any other value.

    >>> checked_index("copy", 1, 0, 2)
    1
    """
    if isinstance(value, bool) or not isinstance(value, Integral) or not lowest <= int(value) <= highest:
        raise SceneError([f"{name} {_value_text(value)}: must be a whole number from {lowest} to {highest}"])
    return int(value)


def _value_text(value: object) -> str:
    try:
        text = repr(value)
    except ValueError:  # of a whole number of thousands of digits
        text = "(an enormous integer)"
    return shorten(text)


def shorten(text: str) -> str:
    """Return a value for a message, shortened if it is long."""
    return text if len(text) <= VALUE_LETTERS else f"{text[: VALUE_LETTERS - 1]}…"


@dataclass(frozen=True, eq=False)
class _Door:
    """The checks of a function's arguments, read from its signature when it is first called."""

    function: Callable[..., Any]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The parameters that can be given by position."""
        kinds = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
        return tuple(
            name for name, parameter in inspect.signature(self.function).parameters.items() if parameter.kind in kinds
        )

    @cached_property
    def checks(self) -> Mapping[str, Check]:
        """The checks, by parameter."""
        checks = {}
        for name, parameter in inspect.signature(self.function).parameters.items():
            has_no_bound = isinstance(parameter.default, float) and not isfinite(parameter.default)
            check = _check(str(parameter.annotation), self.function.__globals__, has_no_bound)
            if check is not None and parameter.kind not in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD):
                checks[name] = check
        return checks

    def problems(self, arguments: Sequence[object], keywords: Mapping[str, object]) -> Iterator[str]:
        """What is wrong with the arguments of a call."""
        for name, value in [*zip(self.names, arguments, strict=False), *keywords.items()]:
            if name in self.checks and (words := self.checks[name](value)):
                yield f"{name}: {words}" if words.startswith(("a ", "has ")) else f"{name} {words}"


def _check(annotation: str, names: Mapping[str, Any], has_no_bound: bool) -> Check | None:
    """The check of an annotation, None if it says more than can be checked."""
    atoms = [atom.strip() for atom in annotation.split(" | ")]
    checks = [_of_atom(atom, names, has_no_bound) for atom in atoms if atom != "None"]
    known_checks = [check for check in checks if check is not None]
    if len(known_checks) < len(checks):
        return None
    if len(known_checks) == len(atoms) == 1:  # most calls are right, and cost little
        return known_checks[0]

    def problem(value: object) -> str:
        if value is None and "None" in atoms:
            return ""
        problems = [check(value) for check in known_checks]
        return "" if "" in problems else problems[0]

    return problem


def _of_atom(atom: str, names: Mapping[str, Any], has_no_bound: bool) -> Check | None:
    base, _, inner = atom.partition("[")
    if base.split(".")[-1] in LISTS and inner:
        item_check = _of_atom(inner.removesuffix("]").removesuffix(", ..."), names, has_no_bound)
        return _list_of(item_check) if item_check else None
    if atom in PLAIN:
        return NUMBER if has_no_bound and atom == "float" else PLAIN[atom]
    if atom.removeprefix("os.").startswith("PathLike"):
        return _must_be("the path of a file", _is_of(PathLike))
    meaning = names.get(atom)
    if base.split(".")[-1] == "Callable" or get_origin(meaning) is Callable:
        return _must_be("a function", callable)
    if get_origin(meaning) is Literal:
        return _one_of(get_args(meaning))
    if atom in WAYS or (isinstance(meaning, type) and not getattr(meaning, "_is_protocol", False)):
        return partial(problem_of, atom)
    return None


def _is_finite(value: object) -> bool:
    try:
        return not isinstance(value, bool) and isinstance(value, Real) and isfinite(value)
    except OverflowError:  # of a whole number beyond all floats
        return False


def _must_be(words: str, is_right: Callable[[Any], bool]) -> Check:
    return lambda value: "" if is_right(value) else f"{_value_text(value)}: must be {words}"


def _is_of(*kinds: type) -> Callable[[object], bool]:
    """Whether a value is of one of these kinds, True and False aside."""
    return lambda value: isinstance(value, kinds) and not isinstance(value, bool)


def _list_of(item_check: Check) -> Check:
    def problem(value: object) -> str:
        if isinstance(value, str):
            return f"{_value_text(value)}: must be a list: [{_value_text(value)}]"
        if not isinstance(value, Sequence | np.ndarray):
            return f"{_value_text(value)}: must be a list"
        return next((f"has {words}" for item in value if (words := item_check(item))), "")

    return problem


NUMBER = _must_be("a number", lambda value: _is_of(Real)(value) and not isnan(value))
PLAIN: dict[str, Check] = {
    "float": _must_be("a finite number", _is_finite),
    "int": _must_be("a whole number", _is_of(Integral)),
    "str": _must_be("text", _is_of(str)),
    "bool": _must_be("True or False", lambda value: type(value).__name__ in {"bool", "bool_"}),
}


def _one_of(words: Sequence[str]) -> Check:
    def problem(value: object) -> str:
        if isinstance(value, str) and value in words:
            return ""
        hint = spelling_hint(value, words) if isinstance(value, str) else ""
        return f"{_value_text(value)}: must be one of {', '.join(words)}{hint}"

    return problem
