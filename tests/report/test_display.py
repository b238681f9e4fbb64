"""What results show of themselves: bounded, escaped, and of every public result."""

from __future__ import annotations

import json
from dataclasses import dataclass, fields, is_dataclass
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from re import MULTILINE, findall

import numpy as np
import pytest
from shown import assert_shown, parsed

import modal
import nonlinear
from modal.modes import natural_modes
from modal.report import (
    HTML_ROWS,
    TEXT_ROWS,
    WIDTH,
    Displayed,
    ReportColumn,
    Result,
    Summary,
    breadth,
    brief,
    by_column,
    summary_of,
)
from modal.report.results import PROMPT_LINES
from modal.scene import Bob, Cart, Pendulum, Scene
from nonlinear.system import AppliedForces, Kicks

ROOT = Path(__file__).parent.parent.parent
HOSTILE = "<script>alert('x')</script> & \u202e"
MACHINERY = (
    *("modal.assembly", "modal.eigen", "nonlinear.dynamics", "nonlinear.integration", "nonlinear.system"),
    *("modal.plotting", "modal.report", "modal.structure"),
)
"""Where equations and arrays of the inside are, which are nobody's result."""
RESULTS = {
    *("modal.assembly.linearization.Matrices", "nonlinear.dynamics.mechanics.Mechanics"),
    *("nonlinear.dynamics.mechanics.Reactions", "nonlinear.integration.trajectory.Trajectory"),
    *("nonlinear.integration.trajectory.SolverInfo", "nonlinear.system.state.State", "nonlinear.system.state.Motion"),
    "nonlinear.system.system.System",
}
"""Results in those subpackages."""
SCALARS = ("float", "int", "str", "bool", "complex")


# ---------------------------------------------------------------------------------------------- every result


def public_classes() -> dict[str, type]:
    classes = {}
    for package in (modal, nonlinear):
        rooms = [f"{package.__name__}.{module.name}" for module in iter_modules(package.__path__)]
        for room in (package.__name__, *rooms):
            home = import_module(room)
            for name in getattr(home, "__all__", ()):
                thing = getattr(home, name)
                if isinstance(thing, type):
                    classes[f"{thing.__module__}.{thing.__name__}"] = thing
    return classes


def may_be_long(kind: type) -> bool:
    return is_dataclass(kind) and any(
        part.strip() not in {*SCALARS, "None"} for field in fields(kind) for part in str(field.type).split("|")
    )


def long_winded(classes: dict[str, type]) -> set[str]:
    """Public dataclasses that hold more than some numbers and leave showing them to dataclasses."""
    return {
        name
        for name, kind in classes.items()
        if may_be_long(kind) and not issubclass(kind, Displayed) and (name in RESULTS or not name.startswith(MACHINERY))
    }


def test_every_public_result_shows_itself() -> None:
    assert long_winded(public_classes()) == set()
    assert public_classes().keys() >= RESULTS


def test_the_search_for_results_bites() -> None:
    @dataclass
    class Long:
        values: tuple[float, ...]

    @dataclass
    class Short:
        value: float
        other: float | None

    assert long_winded({"modal.x.Long": Long, "modal.x.Short": Short}) == {"modal.x.Long"}


def test_what_is_imported_late_is_there() -> None:
    places = {
        place
        for package in ("modal", "nonlinear")
        for path in (ROOT / package).rglob("*.py")
        for place in findall(r'(?:deferred\(|figure = |writer = )"([\w.]+:\w+)"', path.read_text(encoding="utf-8"))
    }
    assert len(places) > 10
    for module, name in (place.split(":") for place in places):
        assert callable(getattr(import_module(module), name))


def test_a_package_loads_each_name_from_the_module_that_its_types_come_from() -> None:
    """Two modules of one package may have the same name: the package must export the right one."""
    for path in (path for package in ("modal", "nonlinear") for path in (ROOT / package).rglob("__init__.py")):
        text, package = path.read_text(encoding="utf-8"), ".".join(path.parent.relative_to(ROOT).parts)
        door = import_module(package)
        for module, names in findall(
            r"^    from ([\w.]+) import \(?([\w\s,]+)", text.partition("TYPE_CHECKING:")[2], MULTILINE
        ):
            for name in set(findall(r"\w+", names)) & set(door.__all__):
                assert getattr(door, name) is getattr(import_module(module), name), f"{package}.{name}"


# ---------------------------------------------------------------------------------------------- any size


def many(count: int, title: str = "") -> Scene:
    pendula = [Pendulum(links=[Bob(mass=1.0, length=1 + k / count, damping=0.1)]) for k in range(count)]
    return Scene(title=title, gravity=9.81, support=Cart(mass=5.0), pendulum=pendula)


@pytest.mark.parametrize("name", ["paper-cart-2", "rope", "thousand-pendula", "huygens", "cart-upright"])
def test_modes_of_any_size_are_shown(name: str) -> None:
    scene = modal.load(name)
    modes = natural_modes(scene, modes=slice(0, 30) if scene.n_links > 100 else None)
    for thing in (scene, modes, modes[1], modes.shape(1)):
        assert_shown(thing)
    assert repr(modes).startswith(scene.title)
    assert (f"… {len(modes) - TEXT_ROWS} more" in repr(modes)) == (len(modes) > TEXT_ROWS)
    assert scene.title in repr(scene)


def test_what_is_left_out_is_counted() -> None:
    scene = many(50)
    assert "… 46 more" in repr(scene)
    assert f"… {50 - HTML_ROWS} more" in parsed(scene._repr_html_()).text
    modes = natural_modes(scene, modes=slice(0, 20))
    assert "… 16 more" in repr(modes)
    assert f"… {20 - HTML_ROWS} more" in parsed(modes._repr_html_()).text


def test_titles_are_escaped_and_seen() -> None:
    scene = modal.load("paper-cart-2").replace(title=HOSTILE.replace("\u202e", ""))
    modes = natural_modes(scene)
    run = nonlinear.simulate(scene, 0.1, output=3)
    for thing in (scene, modes, run):
        page = thing._repr_html_()
        assert "<script" not in page
        assert "script" in parsed(page).text
        assert "script" not in parsed(page).seen


def test_invisible_characters_are_shown() -> None:
    shown = Summary(HOSTILE, [("a\x1b", "b\u202e")], ["c\x1b"], [["d\u202e"]], 1)
    for text in (shown.text(), shown.html()):
        assert not set(text) & {"\x1b", "\u202e"}
        assert "\\u202e" in text


def test_a_wide_table_leaves_out_columns_and_says_so() -> None:
    rows = [[f"{k}" for k in range(40)] for _ in range(3)]
    shown = Summary("wide", (), [f"column {k}" for k in range(40)], rows, 3)
    assert all(line.endswith("…") for line in shown.text().splitlines()[1:])
    assert "29 more" in parsed(shown.html()).text


def test_wide_letters_take_two_columns() -> None:
    shown = Summary("振" * 100, [], ["名", "f (Hz)"], [["振り子", "1"], ["a", "2.5"]], 2, words=frozenset({0})).text()
    title, *lines = shown.splitlines()
    assert breadth(title) in (WIDTH - 1, WIDTH)
    assert {breadth(line) for line in lines} == {2 + 6 + 2 + 6}


def test_long_facts_are_cut() -> None:
    shown = Summary("long", [("word", "x " * 1000)]).text()
    assert len(shown.splitlines()) <= PROMPT_LINES
    assert shown.endswith("…")


# ---------------------------------------------------------------------------------------------- parts of a scene


def test_a_part_is_written_without_defaults() -> None:
    pendulum = Pendulum(links=[Bob(mass=1.0, length=2.0, count=3)], count=2)
    assert repr(pendulum) == "Pendulum(links=(Bob(mass=1.0, length=2.0, count=3),), count=2)"
    assert eval(repr(pendulum), {"Pendulum": Pendulum, "Bob": Bob}) == pendulum


def test_a_long_chain_is_written_short() -> None:
    pendulum = Pendulum(links=[Bob(mass=1.0 + k, length=1.0) for k in range(1000)])
    assert len(repr(pendulum)) < 200
    assert "… 997 more" in repr(pendulum)


def test_values_on_less_than_a_line() -> None:
    assert brief(np.arange(3.0)) == "0, 1, 2"
    assert brief(np.zeros((4, 5))) == "4 × 5 array"
    assert brief(np.zeros(100)) == "100 numbers"
    assert brief(float("nan")) == "–"
    assert brief(-0.0) == "0"
    assert brief(["a" * 50, "b" * 50]) == "2 of str"
    assert brief(modal.load("chain-2")).startswith('Scene "Chain of 2')
    assert brief({}) == "none"


def test_by_default_the_fields_are_shown() -> None:
    @dataclass(repr=False)
    class Found(Displayed):
        size: float
        rows: tuple[str, ...]
        none: None = None

    assert repr(Found(1.5, ("a", "b"))) == "Found\n  size 1.5; rows a, b"
    assert summary_of(Found(1.5, ())).facts == [("size", "1.5"), ("rows", "none")]


def test_named_tuples_with_arrays_are_short() -> None:
    kicks = Kicks(np.arange(900.0), np.arange(900), np.ones(900), np.ones(900))
    assert len(repr(kicks).splitlines()) <= 3
    assert "900 numbers" in repr(kicks)
    assert "100 numbers" in repr(AppliedForces(1.0, np.zeros(100)))
    assert repr(AppliedForces(2.0)) == "AppliedForces\n  cart 2"


def test_records_by_column() -> None:
    columns = by_column([{"x": 1.0, "y": "a"}, {"x": 2.0, "y": "b"}])
    assert columns["x"].tolist() == [1.0, 2.0]
    assert columns["y"].tolist() == ["a", "b"]
    assert by_column([]) == {}


def test_scenes_show_themselves_and_still_compare_and_hash() -> None:
    scene, other = modal.load("paper-cart-2"), modal.load("paper-cart-2")
    assert scene == other
    assert hash(scene) == hash(other)
    assert repr(scene) == repr(other) != repr(scene.replace(gravity=1.0))


# ---------------------------------------------------------------------------------------------- results of commands


@dataclass(frozen=True, repr=False)
class Falls(Result):
    scene: Scene
    rows: tuple[tuple[str, float], ...]
    what = "falls"
    key = "falls"

    def columns(self) -> tuple[ReportColumn, ...]:
        return (
            ReportColumn(lambda row: row[0], "method", "method"),
            ReportColumn(lambda row: row[1], "height_m", "height (m)", ".2f"),
            ReportColumn(lambda row: row[1] > 1, "high"),
            ReportColumn(lambda row: "*" * (row[1] > 1), None, ""),
        )

    def footnotes(self) -> tuple[str, ...]:
        return ("*: high",)

    def facts(self) -> dict[str, int]:
        return {"count": len(self.rows)}


def test_all_forms_of_a_result_come_from_its_columns() -> None:
    falls = Falls(modal.load("chain-2").replace(title=HOSTILE), (("a & b", 0.5), ("c", 2.0), ("d", float("nan"))))
    title, _, head, rule, *rows, _, note = falls.report().rstrip("\n").split("\n")
    assert title.endswith("\\u202e: falls")
    assert head.split() == ["method", "height", "(m)"]
    assert set(rule) == {"-", " "}
    assert [row.split() for row in rows] == [["a", "&", "b", "0.50"], ["c", "2.00", "*"], ["d", "–"]]
    assert note == "*: high"
    assert repr(falls) == falls.report().rstrip("\n")
    assert falls.report("csv").splitlines() == ["method,height_m,high", "a & b,0.5,False", "c,2.0,True", "d,,False"]
    whole = json.loads(falls.report("json"))
    assert list(whole) == ["scene", "count", "falls"]
    assert whole["falls"][2] == {"method": "d", "height_m": None, "high": False}
    np.testing.assert_array_equal(falls.to_dict()["height_m"], [0.5, 2.0, np.nan])
    assert "| a & b" in falls.report("markdown").replace("&amp;", "&")
    assert "script" not in parsed(falls._repr_html_()).seen
    rows_of_latex = [r"a \& b & 0.50 &  \\", r"c & 2.00 & * \\", r"d & -- &  \\"]
    begin = [r"\begin{tabular}{lrr}", r"method & height (m) &  \\", r"\hline"]
    assert str(falls._repr_latex_()).split("\n") == [*begin, *rows_of_latex, r"\end{tabular}"]


def test_a_long_result_says_that_more_follows() -> None:
    many_falls = Falls(modal.load("chain-2"), tuple((f"{k}", float(k)) for k in range(20)))
    assert repr(many_falls).endswith("\n… 16 more")
    assert repr(many_falls).split("\n")[:-1] == [line.rstrip() for line in many_falls.report().split("\n")[:8]]
    assert_shown(many_falls)
