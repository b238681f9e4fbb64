"""All measures by name."""

from __future__ import annotations

from collections.abc import Sequence

from modal.errors import SceneError, meant
from nonlinear.sweeps.measure import Measure, RequestedMeasure
from nonlinear.sweeps.modal_measures import MODAL
from nonlinear.sweeps.run_measures import RUNS
from nonlinear.sweeps.sync_measures import SYNC

MEASURES: dict[str, Measure] = {measure.name: measure for measure in (*MODAL, *RUNS, *SYNC)}


def parse_measures(texts: Sequence[str]) -> tuple[RequestedMeasure, ...]:
    """The measures in texts such as "frequencies" or "frequencies:6"; SceneError names every mistake.

    >>> [one.text for one in parse_measures(["frequencies:6", "beat"])]
    ['frequencies:6', 'beat']
    """
    found: dict[str, RequestedMeasure] = {}
    problems: list[str] = []
    for text in texts:
        try:
            one = _asked(text)
            name = one.text if one.measure.whole else one.measure.name
            if name in found:
                raise SceneError([f"{text}: {name} is asked for twice"])
            found[name] = one
        except SceneError as error:
            problems += error.problems
    if problems:
        raise SceneError(problems)
    return tuple(found.values())


def _asked(text: str) -> RequestedMeasure:
    name, colon, number = text.partition(":")
    if name not in MEASURES:
        hint = meant(name, MEASURES) or f" (there are {', '.join(MEASURES)})"
        raise SceneError([f"{text}: no such measure{hint}"])
    measure = MEASURES[name]
    try:
        return RequestedMeasure(measure, float(number)).insist() if colon else RequestedMeasure(measure, measure.usual)
    except ValueError as error:
        if isinstance(error, SceneError):
            raise
        raise SceneError([f'{text}: "{number}" is not a number']) from None
