"""The door: every mistake is named with its place, and what passes is written back bit for bit."""

from __future__ import annotations

import copy
import inspect
import io
import json
import sys
import tomllib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from amounts import usually
from hypothesis import given, settings
from hypothesis import strategies as st

from modal import (
    Bob,
    Body,
    Cart,
    Fixed,
    InitialCondition,
    Pendulum,
    Rod,
    Scene,
    SceneError,
    dump,
    dumps,
    example_names,
    load,
)
from modal import scene as scene_room
from modal.scene import parse, whole_file
from modal.scene.files import example_text, schema
from modal.scene.parameters import find_places, number_paths, unit_at
from modal.scene.validation import Part

GOOD = {"gravity": 9.81, "pendulum": [{"links": [{"kind": "bob", "mass": 1.0, "length": 1.0}]}]}


def refused(text: str) -> list[str]:
    with pytest.raises(SceneError) as caught:
        parse(text.encode())
    return list(caught.value.problems)


def with_link(**changes: object) -> list[str]:
    link = {"kind": "bob", "mass": 1.0, "length": 1.0} | changes
    inline = ", ".join(
        f"{key} = {value if isinstance(value, str) else json.dumps(value)}" for key, value in link.items()
    )
    return refused(f"gravity = 9.81\n[[pendulum]]\nlinks = [{{ {inline} }}]".replace("kind = bob", 'kind = "bob"'))


def test_all_mistakes_at_once_each_with_its_place() -> None:
    text = """
gravity = -9.81
space = "aether"
colour = "red"
[support]
kind = "cart"
mas = 3.0
[[pendulum]]
links = [{ kind = "bob", mass = 1.0, length = 1.0 }]
[[pendulum]]
links = []
[[pendulum]]
count = 0
links = [{ kind = "rod", mass = -1.0, length = nan }, { kind = "gear", mass = 1.0, length = 1.0 }, { mass = 1.0 }]
"""
    assert set(refused(text)) == {
        "gravity = -9.81: must be positive",
        'space = "aether": must be one of "plane" or "space"',
        "colour: is not a known key",
        "support.mass: is required",
        "support.mas: is not a known key (did you mean mass?)",
        "pendulum[1].links: must not be empty",
        "pendulum[2].count = 0: must be positive",
        "pendulum[2].links[0].mass = -1.0: must be positive",
        "pendulum[2].links[0].length = nan: must be finite",
        'pendulum[2].links[1].kind = "gear": must be one of "bob", "rod", "body"',
        'pendulum[2].links[2]: needs a kind, one of "bob", "rod", "body"',
    }


@pytest.mark.parametrize(("written", "place"), [("support = {", "support"), ("support = [{", "support[0]")])
def test_a_support_without_a_kind(written: str, place: str) -> None:
    closed = "}]" if "[" in written else "}"
    text = f"gravity = 9.81\n{written} mass = 1.0 {closed}\n[[pendulum]]\nlinks = []"
    words = f'{place}: needs a kind, one of "fixed", "cart", "swing", "tilt", "heave", "platform", "modal", "moved"'
    assert set(refused(text)) == {words, "pendulum[0].links: must not be empty"}


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"mass": "0.0"}, "pendulum[0].links[0].mass = 0.0: must be positive"),
        ({"mass": "inf"}, "pendulum[0].links[0].mass = inf: must be finite"),
        ({"mass": "true"}, "pendulum[0].links[0].mass = true: must be a number"),
        ({"mass": '"heavy"'}, 'pendulum[0].links[0].mass = "heavy": must be a number'),
        ({"mass": "1e101"}, "pendulum[0].links[0].mass = 1e+101: must be at most 1e+100"),
        ({"mass": "1e-101"}, "pendulum[0].links[0].mass = 1e-101: must be at least 1e-100"),
        ({"length": "2026-11-21"}, "pendulum[0].links[0].length = 2026-11-21: must be a number"),
        ({"count": "1.5"}, "pendulum[0].links[0].count = 1.5: must be a whole number"),
        ({"count": "2000000"}, "pendulum[0].links[0].count = 2000000: must be at most 1000000"),
        ({"count": "20001"}, "pendulum[0].links: has 20001 links, counting repeats: at most 20000"),
        ({"damping": "-0.1"}, "pendulum[0].links[0].damping = -0.1: must not be negative"),
        ({"centre": "0.1"}, "pendulum[0].links[0].centre: does not belong here"),
        ({"angle_deg": "3.0"}, "pendulum[0].links[0].angle_deg: does not belong here (did you mean angles_deg?)"),
    ],
)
def test_one_mistake_in_a_link(changes: dict, words: str) -> None:
    assert with_link(**changes) == [words]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("gravity = ", "line 1: a value is missing here"),
        ("gravity = 9.81\ngravity = 9.81", "line 2: gravity stands twice"),
        ("a = " + "[" * 5000, "broken TOML: "),
        ("gravity = " + "9" * 5000, "broken TOML: "),
        ("", "gravity: is required"),
        ("gravity = 9.81\npendulum = 3", "pendulum = 3: must be a list"),
        ("gravity = 9.81\npendulum = [3]", "pendulum[0] = 3: must be a table"),
        ("self = 1\ncls = 2\n'' = 3\ngravity = 1", "self: is not a known key"),
        (f"gravity = 0x{'f' * 5000}", "gravity = (an enormous integer): is too large"),
        ('title = "a\\u0007"\ngravity = 1.0', "title: must be one line without control characters"),
        ("[pendulum]\nlinks = []", "pendulum: must be a list: write [[pendulum]]"),
        (f"gravity = {10**400}", "gravity = (an enormous integer): is too large"),
    ],
)
def test_broken_documents(text: str, words: str) -> None:
    assert any(problem.startswith(words) for problem in refused(text)), refused(text)


@pytest.mark.parametrize(
    ("start", "words"),
    [
        ("{ angles_deg = [1, 2] }", "pendulum[0].start.angles_deg: has 2 values for 1 links"),
        ("{ angles_deg = [1], rates_deg = [] }", "pendulum[0].start.rates_deg: has 0 values for 1 links"),
        ("{ angles_deg = [nan] }", "pendulum[0].start.angles_deg[0] = nan: must be finite"),
        ("{ angles_deg = [1], azimuths_deg = [1] }", 'pendulum[0].start.azimuths_deg: needs space = "space"'),
    ],
)
def test_starts(start: str, words: str) -> None:
    link = '{ kind = "bob", mass = 1.0, length = 1.0 }'
    assert refused(f"gravity = 9.81\n[[pendulum]]\nlinks = [{link}]\nstart = {start}") == [words]


def test_a_last_link_on_its_own_pivot_is_refused() -> None:
    with pytest.raises(SceneError, match=r"links\[1\]\.centre = 0\.0: must be positive in the last link"):
        Pendulum(links=(Bob(mass=1.0, length=1.0), Body(mass=1.0, length=1.0, centre=0.0, inertia=1.0)))


def test_a_body_that_nothing_keeps_from_turning_is_refused() -> None:
    with pytest.raises(SceneError, match=r"^inertia = 0\.0: must be positive if .*pivot$"):
        Body(mass=1.0, length=1.0, centre=0.0, inertia=0.0)


def test_too_many_links_in_all() -> None:
    with pytest.raises(SceneError, match="20000000 links in all"):
        Scene(gravity=1.0, pendulum=[Pendulum(links=(Bob(mass=1.0, length=1.0, count=20),), count=1_000_000)])


def test_python_objects_are_checked_alike() -> None:
    with pytest.raises(SceneError, match=r"^mass = -1: must be positive$"):
        Bob(mass=-1, length=1.0)
    with pytest.raises(ValueError, match="angles_deg: is required"):
        InitialCondition()


def test_scenes_are_immutable_and_hashable() -> None:
    scene, same = load("paper-cart-2"), load("paper-cart-2")
    assert hash(scene) == hash(same)
    assert scene == same
    assert len({scene, same, load("chain-1")}) == 2
    with pytest.raises(ValueError, match="frozen"):
        scene.gravity = 1.0


def test_every_promised_scene_is_shipped() -> None:
    promised = {*(f"paper-cart-{n}" for n in (1, 2, 3)), *(f"chain-{n}" for n in range(1, 6))}
    promised |= {"damped-suspension", "driven-pendulum", "kapitza", "measured-swing", "shaken-pendulum"}
    promised |= {"beam", "ship-crane", "suspension", "tower", "two-bobs", "two-swings"}
    promised |= {
        "cart-upright",
        "chain-unequal",
        "chain-spatial",
        "clocks-double",
        "crane-held",
        "crane-hook",
        "crane-two-loads",
        "hoisting-crane",
        "huygens",
        "metronomes",
        "rope",
        "thousand-pendula",
    }
    assert set(example_names()) == promised
    assert load("rope").n_links == 1000
    lengths = [pendulum.links[0].length for pendulum in load("thousand-pendula").pendulum]
    assert len(set(lengths)) == 1000


@cache
def validator() -> Any:
    """Of the schema, which is itself one: to examine it again for every scene takes longer than the scene."""
    from jsonschema.validators import validator_for

    validator_for(schema()).check_schema(schema())
    return validator_for(schema())(schema())


@pytest.mark.parametrize("name", example_names())
def test_shipped_scenes_come_back_exactly(name: str) -> None:
    scene = load(name)
    assert parse(dumps(scene).encode()) == scene
    validator().validate(tomllib.loads(example_text(name)))


NUMBERS = st.floats(1e-100, 1e100)
COUNTS = st.integers(1, 5)
LINKS = st.one_of(
    st.builds(Bob, mass=NUMBERS, length=NUMBERS, count=COUNTS, damping=st.just(0.0) | NUMBERS),
    st.builds(Rod, mass=NUMBERS, length=NUMBERS, stiffness=st.just(0.0) | NUMBERS),
    st.builds(Body, mass=NUMBERS, length=NUMBERS, centre=NUMBERS, inertia=st.just(0.0) | NUMBERS),
)
PENDULA = st.builds(Pendulum, links=st.lists(LINKS, min_size=1, max_size=3).map(tuple), count=COUNTS)
SCENES = st.builds(
    Scene,
    title=st.text(st.characters(exclude_categories=["Cs", "Cc", "Zl", "Zp"]), max_size=200),
    gravity=NUMBERS,
    space=st.sampled_from(["plane", "space"]),
    support=st.just(Fixed()) | st.builds(Cart, mass=st.just(0.0) | NUMBERS, stiffness=st.just(0.0) | NUMBERS),
    pendulum=st.lists(PENDULA, min_size=1, max_size=3).map(tuple),
)


@settings(max_examples=usually(20, 400), deadline=None, derandomize=True)
@given(SCENES)
def test_any_scene_comes_back_exactly(scene: Scene) -> None:
    text = dumps(scene)
    assert parse(text.encode()) == scene
    validator().validate(tomllib.loads(text))


def test_the_schema_refuses_what_we_refuse() -> None:
    import jsonschema

    validator().validate(GOOD)
    for bad in ({**GOOD, "gravity": -1}, {**GOOD, "colour": "red"}, {**GOOD, "pendulum": []}):
        with pytest.raises(jsonschema.ValidationError):
            validator().validate(bad)


def test_a_written_scene_is_read_back(tmp_path: Path) -> None:
    scene = load("metronomes")
    dump(scene, tmp_path / "mine.toml")
    assert load(tmp_path / "mine.toml") == scene


@pytest.mark.parametrize("prefix", [b"\xef\xbb\xbf", b""])
def test_windows_files_are_read(tmp_path: Path, prefix: bytes) -> None:
    path = tmp_path / "windows.toml"
    path.write_bytes(prefix + example_text("chain-3").replace("\n", "\r\n").encode())
    assert load(path) == load("chain-3")


def test_standard_input(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(example_text("chain-2").encode())))
    assert load("-") == load("chain-2")


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("paper-cart", r"paper-cart: no such file and no such shipped scene \(did you mean paper-cart-"),
        ("nowhere.toml", "nowhere.toml: cannot be read: No such file"),
        (".", ".: not a file"),
        ("bad\0name.toml", "cannot be read"),
    ],
)
def test_what_cannot_be_read(name: str, words: str) -> None:
    with pytest.raises(SceneError, match=words):
        load(name)


def test_text_that_is_not_utf8(tmp_path: Path) -> None:
    path = tmp_path / "latin.toml"
    path.write_bytes('title = "caf\xe9"'.encode("latin-1"))
    with pytest.raises(SceneError, match=r"latin\.toml: byte 12 is not UTF-8 text"):
        load(path)


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "old.txt"
    path.write_text("old")

    def half_written() -> None:
        with whole_file(path) as stream:
            stream.write(b"new")
            raise RuntimeError("power cut")

    with pytest.raises(RuntimeError, match="power cut"):
        half_written()
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_all_mistakes_of_one_pendulum_and_of_several() -> None:
    link = '{ kind = "bob", mass = 1, length = 1 }'
    turned = f"[[pendulum]]\nlinks = [{link}]\nstart = {{ angles_deg = [1], azimuths_deg = [2] }}\n"
    assert refused("gravity = 1\n" + turned + turned) == [
        f'pendulum[{k}].start.azimuths_deg: needs space = "space"' for k in (0, 1)
    ]
    pendulum = f"links = [{link}, {{ kind = 'body', mass = 1, length = 1, centre = 0, inertia = 1 }}]"
    text = f"gravity = 1\n[[pendulum]]\n{pendulum}\nequilibrium = ['up']\nstart = {{ angles_deg = [1] }}"
    assert [line.split(":")[0] for line in refused(text)] == [
        *("pendulum[0].links[1].centre = 0.0", "pendulum[0].equilibrium", "pendulum[0].start.angles_deg"),
    ]


@pytest.mark.parametrize(
    ("support", "link", "message"),
    [
        ("cart = 3", "", 'support.cart: is not a known key: write kind = "cart"'),
        ("", ", rod = 1", 'pendulum[0].links[0].rod: is not a known key: write kind = "rod"'),
        ("", ", mass = -1", "pendulum[0].links[0].mass = -1: must be positive"),
    ],
)
def test_keys_named_like_kinds_keep_their_place(support: str, link: str, message: str) -> None:
    size = "length = 1" + ("" if "mass" in link else ", mass = 1")
    text = f"gravity = 1\n[support]\nkind = 'cart'\nmass = 1\n{support}\n"
    assert message in refused(text + f"[[pendulum]]\nlinks = [{{ kind = 'bob', {size}{link} }}]")


def test_numbers_below_the_smallest_are_refused() -> None:
    link = "{ kind = 'body', mass = 1.0, length = 0.2, centre = 1e-310, inertia = 0.1 }"
    assert "must be 0 or at least 1e-100" in refused(f"gravity = 1\n[[pendulum]]\nlinks = [{link}]")[0]


def test_a_count_may_come_from_numpy() -> None:
    assert Bob(mass=1.0, length=1.0, count=np.int64(3)) == Bob(mass=1.0, length=1.0, count=3)
    for wrong in (True, np.array([1, 2]), np.float64(2.0), np.int64(0)):
        with pytest.raises(SceneError, match="count"):
            Bob(mass=1.0, length=1.0, count=wrong)


COPIES = [
    lambda part, **changes: part.replace(**changes),
    lambda part, **changes: part.model_copy(update=changes),
    lambda part, **changes: part.copy(update=changes),
]


@pytest.mark.parametrize("changed", COPIES)
def test_what_is_changed_is_checked_like_a_file(changed: Callable[..., object]) -> None:
    scene = load("paper-cart-2")
    with pytest.raises(SceneError) as caught:
        changed(scene, gravity=-9.81, suport=Fixed(), pendulum=[GOOD["pendulum"][0] | {"count": 0}])
    assert caught.value.problems == (
        "gravity = -9.81: must be positive",
        "pendulum[0].count = 0: must be positive",
        "suport: is not a known key (did you mean support?)",
    )
    with pytest.raises(SceneError, match=r"^mass = -1.0: must be positive$"):
        changed(scene.pendulum[0].links[0], mass=-1.0)
    with pytest.raises(SceneError, match="has 1 values for 2 links"):
        changed(scene.pendulum[0], equilibrium=("up",))


@pytest.mark.parametrize("changed", COPIES)
def test_a_changed_scene_is_the_one_that_the_file_would_give(changed: Callable[..., object]) -> None:
    scene = load("crane-two-loads")
    support = changed(scene.support, damping=5.0)
    written = dumps(scene).replace('kind = "cart"', 'kind = "cart"\ndamping = 5.0').encode()
    assert changed(scene, support=support) == parse(written) != scene
    assert changed(scene) == scene == scene.model_copy(deep=True) == copy.copy(scene)


def test_a_part_where_a_list_belongs_says_how_to_write_it() -> None:
    with pytest.raises(SceneError, match=r"^links: must be a list: write \[Bob\(…\)\]$"):
        Pendulum(links=Bob(mass=1.0, length=1.0))
    with pytest.raises(SceneError, match=r"^pendulum: must be a list: write \[Pendulum\(…\)\]$"):
        load("chain-1").replace(pendulum=load("chain-1").pendulum[0])


def test_every_field_has_a_meaning_in_help_and_in_the_schema() -> None:
    classes = [part for name in dir(scene_room) if isinstance(part := getattr(scene_room, name), type)]
    parts = [part for part in classes if issubclass(part, Part) and part.fields]
    assert len(parts) > 20
    definitions = schema()["$defs"]
    for part in parts:
        told = part.__doc__ or ""
        for name, field in part.fields.items():
            assert field.words.strip(), (part, name)
            assert f"\n{name}\n    {field.words}" in told
            assert "Several" not in str(inspect.signature(part))
            if part.__name__ in definitions:
                assert definitions[part.__name__]["properties"][name]["description"] == field.words
    assert "mass\n    positive (kg)\n" in (Bob.__doc__ or "")
    assert ">>> bob.centre" in (Bob.__doc__ or "")


@pytest.mark.parametrize("name", ["crane-hook", "ship-crane", "beam", "two-bobs", "hoisting-crane", "metronomes"])
def test_units_of_fields_are_those_of_numbers(name: str) -> None:
    scene = load(name)
    for path in number_paths(scene):
        (place,) = find_places(scene, path)
        part: Any = scene
        for step in place[:-1]:
            part = part[step] if isinstance(step, int) else getattr(part, step)
        if isinstance(part, Part) and (unit := unit_at(scene, place)):
            assert unit in part.fields[str(place[-1])].unit, path
