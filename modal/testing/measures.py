"""Tests of measures: the same numbers by every command that accepts it, and one error for each mistake."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

from modal.errors import SceneError
from modal.extend.measures import SCENE_ITSELF, VERBS, columns_of, measure_for, parse_request
from modal.report import deferred
from modal.scene import InitialCondition, Scene, load
from modal.scene.signal_names import column_label
from modal.testing.extensions import ExtensionTests

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
