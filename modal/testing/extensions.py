"""Tests of every extension, whatever its kind, and of formats and measures.

Of every one: its name, its words, and that other processes find it.  Of formats: bytes for every model, reproducible
output, and reading back if there is a reader.  Of measures: the same numbers by every command that accepts it, and one
error for each mistake.
"""

from __future__ import annotations

import pickle
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

from modal.errors import ExtensionError, SceneError
from modal.exports import FORMATS, find_format, format_of_file
from modal.extend import Extension, Format, find_extension, register, registration
from modal.extend.measures import SCENE_ITSELF, VERBS, columns_of, measure_for, parse_request
from modal.report import deferred
from modal.scene import InitialCondition, Scene, load
from modal.scene.signal_names import column_label
from modal.statespace import StateSpace, state_space
from modal.statespace.sampling import sample

HOSTILE: tuple[Any, ...] = (float("nan"), float("inf"), -float("inf"), 1e301, "x", "1", "", None, True, [], {})
"""Values that no number of a scene can have."""


class ExtensionTests:
    """Tests of an `extension`, a class: subclasses of this by a name that begins with Test are run by pytest.

    >>> from modal.testing import ExtensionTests
    >>> class TestMine(ExtensionTests):
    ...     pass
    """

    extension: ClassVar[Any]

    @pytest.fixture(autouse=True)
    def _registered(self) -> Iterator[None]:
        """Known by its name, as an installed package is."""
        with registration(self.extension):
            yield

    def cases(self, name: str) -> Sequence[Any] | None:
        """The values of an argument of tests, one test for each; None for what is no such argument."""
        return None

    def pytest_generate_tests(self, metafunc: Any) -> None:
        """A test for each of the cases."""
        for name in metafunc.fixturenames:
            if (cases := self.cases(name)) is not None:
                metafunc.parametrize(name, cases, ids=[f"{name}{k}" for k in range(len(cases))])

    def test_it_is_found_by_its_name(self) -> None:
        """Among those of its kind."""
        assert find_extension(self.extension.kind, self.extension.name) is self.extension

    def test_it_says_what_it_is(self) -> None:
        """In its docstring or words."""
        assert getattr(self.extension, "words", "") or self.extension.__doc__

    def test_it_has_no_mistake(self) -> None:
        """The messages that come before anything is computed."""
        assert not [*self.extension.mistakes()]

    def test_its_name_is_its_own(self) -> None:
        """Another class of the same name is refused."""
        other = type("Other", (Extension,), {"kind": self.extension.kind, "name": self.extension.name})
        with pytest.raises(ExtensionError, match=f"a {self.extension.kind} of this name exists"):
            register(other)

    def test_other_processes_find_it(self) -> None:
        """Its class is at the top level of a module."""
        assert type(pickle.loads(pickle.dumps(self.extension()))) is self.extension


SCENES = ("chain-1", "chain-3", "paper-cart-2", "crane-hook", "cart-upright", "huygens")
TITLES = ('a "title"', "*/ /*", "{}; \\ % ' <&>", "Größe ∀", "")
"""Characters that a title may contain."""


class FormatTests(ExtensionTests):
    """Tests of a format: `read` gets A, B, C, D back from its bytes, None if nobody can read them.

    >>> from modal.testing import FormatTests
    >>> class TestMine(FormatTests):
    ...     @staticmethod
    ...     def read(content):
    ...         return None
    """

    step: ClassVar[float] = 0.0
    """Of a discrete model (s), for formats that hold no other."""

    @staticmethod
    def read(content: bytes) -> Sequence[Any] | None:
        """A, B, C and D as written."""
        return None

    def cases(self, name: str) -> Sequence[Any] | None:
        """Models by the names of scenes, titles."""
        return {"scene_name": SCENES, "title": TITLES}.get(name)

    def model_of(self, scene_name: str) -> StateSpace:
        """The model of a scene."""
        model = state_space(load(scene_name))
        return sample(model, self.step) if self.step else model

    def test_it_writes_bytes_of_every_model(self, scene_name: str) -> None:
        """And a note about them is text."""
        form, model = self.extension(), self.model_of(scene_name)
        content = form.content(model)
        assert isinstance(form.note(content), str)

    def test_it_writes_twice_alike(self, scene_name: str) -> None:
        """Byte for byte."""
        model = self.model_of(scene_name)
        assert self.extension().content(model) == self.extension().content(model)

    def test_what_is_read_back_is_what_was_written(self, scene_name: str) -> None:
        """Every number exactly."""
        model = self.model_of(scene_name)
        back = self.read(self.extension().content(model))
        for read, written in zip(back or (), (model.A, model.B, model.C, model.D), strict=False):
            np.testing.assert_array_equal(read, written)

    def test_a_title_does_no_harm(self, title: str) -> None:
        """The same numbers are read back under any title."""
        model = replace(self.model_of("chain-3"), title=title)
        back = self.read(self.extension().content(model))
        for read, written in zip(back or (), (model.A, model.B, model.C, model.D), strict=False):
            np.testing.assert_array_equal(read, written)

    def test_a_discrete_model_is_another(self) -> None:
        """Its numbers are those of a step."""
        model = self.model_of("chain-2")
        stepped = sample(state_space(load("chain-2")), 0.02)
        assert self.extension().content(stepped) != self.extension().content(replace(stepped, A=2 * model.A))

    def test_a_hoist_is_written_or_refused(self) -> None:
        """By one error that says which formats take it."""
        if self.extension.write_varying is Format.write_varying:
            with pytest.raises(SceneError, match="holds a constant model"):
                self.extension().content(None, is_varying=True)

    def test_its_ending_is_its_own(self) -> None:
        """No other format has it."""
        others = [form.extension for name, form in FORMATS.items() if name != self.extension.name]
        assert self.extension.extension not in others
        assert format_of_file(f"model{self.extension.extension}") == self.extension.name

    def test_it_is_among_the_formats(self) -> None:
        """That an unknown name is reported."""
        assert type(find_format(self.extension.name)) is self.extension
        with pytest.raises(SceneError, match=self.extension.name):
            find_format("nosuch")

    def test_the_command_writes_it(self, tmp_path: Path) -> None:
        """By its name, and by the ending of a file."""
        main, files = deferred("multipendula.cli:main"), [tmp_path / f"{k}{self.extension.extension}" for k in "ab"]
        step = ["--discrete", f"{self.step:g}"] if self.step else []
        assert main(["export", "chain-2", "--to", self.extension.name, "-o", str(files[0]), *step]) == 0
        assert main(["export", "chain-2", "-o", str(files[1]), *step]) == 0
        assert files[0].read_bytes() == files[1].read_bytes() == self.extension().content(self.model_of("chain-2"))


NOT_NUMBERS = ("x", "nan", "inf", "-1", "0", "1e9", "", "1,5")
"""Values that no N of NAME:N can have."""


class MeasureTests(ExtensionTests):
    """Tests of a measure: of a `scene` for N = `number`, which is `expected` where that is known, by columns.

    >>> from modal.testing import MeasureTests
    >>> class TestMine(MeasureTests):
    ...     scene, number = "chain-2", 2.0
    """

    scene: ClassVar[Scene | str] = "chain-2"
    number: ClassVar[float] = 2.0
    expected: ClassVar[Mapping[str, float] | None] = None

    def cases(self, name: str) -> Sequence[Any] | None:
        """Verbs, and values that are not numbers."""
        return {"verb": VERBS, "text": NOT_NUMBERS}.get(name)

    @property
    def moving(self) -> Scene:
        """The scene with a start."""
        scene = load(self.scene) if isinstance(self.scene, str) else self.scene
        if any(pendulum.start for pendulum in scene.pendulum):
            return scene
        starts = [InitialCondition(angles_deg=[20.0 - 15.0 * k for k in range(p.n_links)]) for p in scene.pendulum]
        return scene.replace(pendulum=[p.replace(start=s) for p, s in zip(scene.pendulum, starts, strict=True)])

    @property
    def request_text(self) -> str:
        """NAME or NAME:N."""
        return f"{self.extension.name}:{self.number:g}" if self.extension.counts else self.extension.name

    def swept(self) -> dict[str, float]:
        """Its values at a point of a sweep."""
        scene = self.moving
        sweep = deferred("nonlinear.sweeps:sweep")(scene, "gravity=9.81", measures=self.request_text, workers=1)
        assert not sweep.failures, sweep.failures
        return {name: float(sweep.values(name)[0]) for name in sweep.columns}

    def by_verb(self, verb: str) -> dict[str, float]:
        """Its values by one of the verbs, of the scene itself."""
        scene, name = self.moving.replace(gravity=9.81), self.extension.name
        if verb == "sweep":
            return self.swept()
        if verb == "spread":
            spread = deferred("nonlinear.sweeps:find_spread")
            drawn = spread(scene, ["gravity=0.01"], members=3, measures=[self.request_text])
            return {column: nominal for column, (nominal, _) in drawn.measured.items()}
        options = {"check": 0, "workers": 1, "tolerance": 1e-9}
        if verb == "ensemble":
            ensemble = deferred("nonlinear:ensemble")
            members = ensemble(scene, self.number, vary={"gravity": [9.81]}, measures=[name], **options)
            return {column: float(members.column(column)[0]) for column in columns_of(name, members.columns)}
        find_basins = deferred("nonlinear.ensembles:find_basins")
        axes = ["gravity=9.81", f"pendulum[0].links[0].mass={scene.pendulum[0].links[0].mass!r}"]
        basins = find_basins(scene, vary=axes, measure=self.request_text, **options)
        return {basins.column: float(basins.values.ravel()[0])}

    def test_every_verb_has_the_same_numbers_or_a_reason(self, verb: str) -> None:
        """A verb that does not take it says why."""
        if why := self.extension.refused.get(verb):
            with pytest.raises(SceneError, match="does not take"):
                measure_for(verb, self.extension.name)
            assert " " in why
            return
        first = self.swept()
        for column, number in self.by_verb(verb).items():
            assert number == pytest.approx(first[column], rel=2e-4, abs=2e-4, nan_ok=True), column

    def test_the_columns_are_those_that_it_states(self) -> None:
        """By the beginnings of their names."""
        columns = list(self.swept())
        assert columns
        assert columns_of(self.extension.name, columns) == tuple(columns)

    def test_the_numbers_are_those_expected(self) -> None:
        """If they are known."""
        numbers = self.swept()
        for column, number in (self.expected or {}).items():
            assert numbers[column] == pytest.approx(number, rel=1e-6, abs=1e-9), column

    def test_it_measures_twice_alike(self) -> None:
        """Bit for bit, as files are compared."""
        first, second = self.swept(), self.swept()
        np.testing.assert_array_equal([*first.values()], [*second.values()])

    def test_what_is_no_number_is_one_error(self, text: str) -> None:
        """That names the measure."""
        with pytest.raises(SceneError, match=self.extension.name):
            parse_request("sweep", f"{self.extension.name}:{text}")

    def test_its_number_may_be_left_out(self) -> None:
        """Then it is the usual one."""
        measure, number = parse_request("sweep", self.extension.name)
        assert type(measure) is self.extension
        assert number == self.extension.usual

    def test_a_scene_keeps_or_moves(self) -> None:
        """A measure of a scene takes no seconds."""
        assert (self.extension.reads == SCENE_ITSELF) <= (self.extension.counts != "seconds")

    def test_a_file_keeps_it(self, tmp_path: Path) -> None:
        """And it is read back by its name."""
        sweep, path = deferred("nonlinear.sweeps:sweep"), tmp_path / "sweep.npz"
        whole = sweep(self.moving, "gravity=9.81,9.9", measures=self.request_text, workers=1)
        deferred("nonlinear.sweeps:save")(whole, path)
        assert deferred("nonlinear.sweeps:load")(path).rows == whole.rows

    def test_the_command_prints_it(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        """With its columns."""
        path = tmp_path / "scene.toml"
        deferred("modal.scene:dump")(self.moving, path)
        main = deferred("multipendula.cli:main")
        assert main(["sweep", str(path), "--vary", "gravity=9.8,9.9", "--measure", self.request_text]) == 0
        printed = capsys.readouterr().out
        assert all(column_label(column) in printed for column in self.swept())

    def test_its_summary_names_it(self) -> None:
        """At the prompt."""
        assert self.extension.name in repr(self.extension())
