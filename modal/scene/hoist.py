"""The description of a hoisted rope in a scene, which `modal.scene.length_laws` turns into a law of time."""

from __future__ import annotations

from collections.abc import Iterator
from math import isclose
from typing import TYPE_CHECKING, Literal

import numpy as np

from modal.report import deferred
from modal.scene.stored import SeveralOrNone
from modal.scene.validation import (
    FILE_NAME,
    NUMBER_SIZE_MAX,
    POSITIVE,
    REAL,
    REALS_OR_NONE,
    UNREAD,
    Part,
    curve_problems,
    field,
    list_of,
    number,
    one_of,
    optional,
)
from modal.types import EPS

if TYPE_CHECKING:
    from modal.scene.length_laws import LengthLaw

RECORD = ("time_s", "length_m")
RAMP_SHARE = 0.25
"""Limit: default of `ramp`, the share of a hoist's duration in which its speed rises."""
Profile = Literal["smooth", "trapezoidal"]


class Hoist(Part):
    """A new length `to` (m), from `begin` (s) over `duration` (s), or a record of lengths `length_m` at `time_s`.

    A record's `file` is read with the scene file that names it (`modal.scene.records`); the hoist holds its numbers.
    `ramp` is the fraction of the duration during which a trapezoidal speed rises, and during which it falls.
    """

    to: float | None = field(optional(POSITIVE), "length at the end, required without a file", "m", default=None)
    begin: float = field(REAL, "time at which the length begins to change", "s", default=0.0)
    duration: float | None = field(optional(POSITIVE), "of the change, required without a file", "s", default=None)
    profile: Profile = field(one_of("smooth", "trapezoidal"), "how the speed rises and falls", default="smooth")
    ramp: float | None = field(optional(number(ge=1e-3, le=0.5)), "share of the duration, of trapezoids", default=None)
    file: str | None = field(FILE_NAME, "name of a CSV file with time_s and length_m", default=None)
    time_s: SeveralOrNone[float] = field(REALS_OR_NONE, "times of a record in place of these", "s", default=None)
    length_m: SeveralOrNone[float] = field(optional(list_of(POSITIVE)), "lengths at these times", "m", default=None)
    interpolation: Literal["auto", "cubic"] = field(
        one_of("auto", "cubic"), "of a record; auto: a spline, where that stays within the samples", default="auto"
    )

    @property
    def is_recorded(self) -> bool:
        """Whether its lengths come from a record."""
        return any(getattr(self, name) is not None for name in ("file", *RECORD))

    def problems(self) -> Iterator[str]:
        """Neither a length nor a record, both, a file that is not read, and a ramp of another profile."""
        keys = [name for name in ("to", "duration") if getattr(self, name) is not None]
        if self.is_recorded:
            profile_keys = [*keys, *["begin"] * (self.begin != 0), *["profile"] * (self.profile != "smooth")]
            yield from (f".{name}: does not belong to a record" for name in profile_keys)
            yield from [f".file: {UNREAD}"] if self.file is not None else self._record_problems()
        else:
            yield from (f".{name}: is required" for name in ("to", "duration") if name not in keys)
        if self.interpolation != "auto" and not self.is_recorded:
            yield f'.interpolation = "{self.interpolation}": is that of a record'
        if self.ramp is not None and self.profile == "smooth":
            yield f'.ramp = {self.ramp}: needs profile = "trapezoidal"'

    def _record_problems(self) -> Iterator[str]:
        """A list without the other, of another size, of fewer than two values, and times that do not ascend."""
        if self.time_s is None or self.length_m is None:
            yield f".{RECORD[self.time_s is not None]}: is required in a record"
            return
        yield from curve_problems(*RECORD, self.time_s, self.length_m, least=2)

    def problems_from(self, length: float) -> Iterator[str]:
        """Return what is wrong with the law from `length` (m) on: another start, lengths not positive or not finite."""
        key, words = ("length_m", f"a record that begins at {self.length_m[0]:g} m") if self.length_m else ("to", "it")
        if self.length_m and not isclose(self.length_m[0], length):
            yield f".length_m: begins at {self.length_m[0]:g} m, and its link has length = {length:g}"
            return
        last = self.length_m[-1] if self.length_m else self.to
        assert last is not None
        with np.errstate(all="ignore"):
            law = self.law(length)
            has_law = law.greatest <= NUMBER_SIZE_MAX and isclose(law.end, last, abs_tol=EPS**0.5 * length)
        if not has_law:
            yield f".{key}: {words} changes too fast or too slowly for double precision"
        elif self.length_m and (shortest := law.extremes[0]) <= 0:
            yield f".length_m: the spline through it reaches a length of {shortest:g} m: must be positive"

    def law(self, length: float) -> LengthLaw:
        """The length as a function of time, from `length` (m) on."""
        law: LengthLaw
        if self.time_s and self.length_m:
            law = deferred("modal.scene.length_laws:recorded_law")(self.time_s, self.length_m, self.interpolation)
        else:
            ramp = RAMP_SHARE if self.ramp is None else self.ramp
            share = None if self.profile == "smooth" else ramp
            law = deferred("modal.scene.length_laws:profile_law")(length, self.to, self.begin, self.duration, share)
        return law
