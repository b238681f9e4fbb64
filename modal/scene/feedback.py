"""Feedback: inputs of a scene that depend on measured outputs.

    u = −gain (output − reference),    or    u = −K z,    z = (q, q') from equilibrium,

limited to ±`limit`; with a `sample_time` T it is computed at k T, held until the next sample, and delayed by `delay`. A
file of gains has a column for each state, with its name as heading, and a row for each input.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from modal.errors import SceneError
from modal.scene.stored import OneOrSeveral, Several
from modal.scene.validation import (
    NON_NEGATIVE,
    POSITIVE,
    REAL,
    REALS,
    Part,
    Schema,
    field,
    function_before,
    list_of,
    one_or_list,
    optional,
    refuse_file,
    text,
)
from modal.types import NOISE_OF_SUM

NAME = text(200)


class GainMatrix(Part):
    """The rows of a gain matrix K, one for each input, with the names of the states that its columns multiply.

    >>> GainMatrix(states=["theta_1_1", "theta_dot_1_1"], rows=[[12.0, 3.0]]).rows
    ((12.0, 3.0),)
    """

    states: Several[str] = field(list_of(NAME), "names of the states, as in an exported model")
    rows: Several[tuple[float, ...]] = field(list_of(REALS), "a row for each input: u = −K z")

    def problems(self) -> Iterator[str]:
        """Rows of other lengths, and states named twice."""
        for k, row in enumerate(self.rows):
            if len(row) != len(self.states):
                yield f".rows[{k}]: must have a number for each of the {len(self.states)} states, not {len(row)}"
        for name in dict.fromkeys(self.states):
            if self.states.count(name) > 1:
                yield f".states: has {name} twice"


class Feedback(Part):
    """A loop from an `output` to an `input` with a `gain`, or from all states by the matrix `gains`.

    >>> loop = Feedback(input="cart_force", output="theta_1_1", gain=-40.0, limit=20.0)
    >>> loop.inputs, loop.reference
    (('cart_force',), 0.0)
    """

    input: OneOrSeveral[str] = field(one_or_list(NAME), "of an exported model, as cart_force; several for gains")
    output: str | None = field(optional(NAME), "that is measured: a state, or an angle to the link above", default=None)
    gain: float | None = field(optional(REAL), "the input is −gain × (output − reference)", default=None)
    reference: float = field(REAL, "of the output, in its unit", default=0.0)
    gains: GainMatrix | None = field(
        function_before(refuse_file, optional(GainMatrix.schema())), "or u = −K z: a table, or a CSV file", default=None
    )
    limit: float | None = field(optional(POSITIVE), "largest size of the input, in its unit", default=None)
    sample_time: float | None = field(
        optional(POSITIVE), "between samples, each held until the next", "s", default=None
    )
    delay: float = field(NON_NEGATIVE, "from a sample to its input: a multiple of sample_time", "s", default=0.0)

    @property
    def inputs(self) -> tuple[str, ...]:
        """The names of its inputs, as a tuple even for one."""
        return self.input if isinstance(self.input, tuple) else (self.input,)

    @property
    def delayed_samples(self) -> int:
        """The delay in samples."""
        return round(self.delay / self.sample_time) if self.sample_time else 0

    def problems(self) -> Iterator[str]:
        """Outputs given twice or not at all, and inconsistent times."""
        has_output = self.output is not None or self.gain is not None
        if has_output == (self.gains is not None):
            yield ": needs either output and gain, or gains"
        elif has_output and (self.output is None or self.gain is None):
            missing, given = ("output", "gain") if self.output is None else ("gain", "output")
            yield f".{missing}: is required with {given}"
        if len(set(self.inputs)) < len(self.inputs):
            yield ".input: names an input twice"
        if self.gains is not None and self.reference:
            yield f".reference = {self.reference!r}: needs an output: gains hold all states at equilibrium"
        if self.delay and self.sample_time is None:
            yield f".delay = {self.delay!r}: needs a sample_time, of which it is a multiple"
        elif self.sample_time:
            samples = self.delay / self.sample_time
            if abs(samples - round(samples)) > NOISE_OF_SUM * max(samples, 1.0):
                yield f".delay = {self.delay!r}: must be a multiple of sample_time = {self.sample_time!r}"


def parts_of(values: Sequence[Any]) -> tuple[Feedback, ...]:
    """Return the loops that a list describes; raise ValueError with every mistake and its place."""
    loops, problems = [], list[str]()
    for k, value in enumerate(values):
        try:
            loops.append(Feedback.model_validate(value))
        except SceneError as error:
            problems += [f"[{k}]{'' if problem.startswith(':') else '.'}{problem}" for problem in error.problems]
    if problems:
        raise ValueError("\n".join(problems))
    return tuple(loops)


def schema_of() -> Schema:
    """Return the schema of one loop, for editors."""
    return Feedback.schema()
