"""Supports in a list, springs and the ground: how they are written, what is wrong with them, what weighs on them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from modal import Cart, Fixed, Scene, SceneError, Tilt, load
from modal.scene import Moved, dumps, left_out, parse, refusals, scene_from, title_of
from modal.scene.files import schema
from modal.scene.parameters import find_places, parse_variations, unit_at, validate_variations, vary
from modal.scene.supports import read_matrices
from modal.structure import carried_weights, find_imbalance, hung_masses, structure_of, weights

BOB = {"kind": "bob", "mass": 1.0, "length": 1.0}
CART = {"kind": "cart", "mass": 2.0}
LEFT, RIGHT = CART | {"name": "left"}, CART | {"name": "right"}
SINE = {"kind": "sine", "amplitude": 0.1, "frequency_hz": 1.0}
ONE, TWO = [[1.0]], [[1.0, 0.0], [0.0, 1.0]]
FRAME = {"kind": "modal", "M": TWO, "K": TWO, "points": [[[1.0, 0.0], [0.0, 0.0]]]}
TILT = {"kind": "tilt", "mass": 1.0, "inertia": 1.0}
HEAVE = {"kind": "heave", "mass": 1.0}


def hung(**more: Any) -> dict[str, Any]:
    return {"links": [BOB]} | more


def described(**more: Any) -> dict[str, Any]:
    return {"gravity": 9.81, "pendulum": [hung()]} | more


def springy(first: str, second: str, **more: Any) -> dict[str, Any]:
    spring = {"between": [first, second], "stiffness": 5.0} | more
    return described(pendulum=[hung(count=2), hung(count=3)], spring=[spring])


def pushed(on: str, **more: Any) -> dict[str, Any]:
    two = [HEAVE | {"name": "left", "stiffness": 1.0}, RIGHT]
    return described(support=two, pendulum=[hung(on="left")], force=[SINE | {"on": on} | more])


def standing(**support: Any) -> dict[str, Any]:
    return described(support=support, pendulum=[hung(on=f"{support['kind']}[0]")])


# --------------------------------------------------------------------------------------------------- what is wrong

MISTAKES = {
    "names": (described(support=[CART, LEFT]), "support[0].name: is required among several supports"),
    "twice": (described(support=[LEFT, LEFT]), 'support[1].name = "left": is the name of support[0] too'),
    "reserved": (described(support=[LEFT, CART | {"name": "ground"}]), 'support[1].name = "ground": is reserved'),
    "key": (described(support=[LEFT, CART | {"name": "mass"}]), 'support[1].name = "mass": is reserved'),
    "digits": (described(support=[LEFT, CART | {"name": "12"}]), 'support[1].name = "12": must have a letter'),
    "letters": (described(support=[CART | {"name": "a-b"}]), "support[0].name: must consist of letters, digits and _"),
    "clash": (
        described(support=[CART | {"name": "a_sway"}, HEAVE | {"kind": "platform", "inertia": 1.0, "name": "a"}]),
        'support[1].name = "a": gives a_sway_m to support[0] too',
    ),
    "clash of forces": (
        described(support=[CART | {"name": "a_1"}, FRAME | {"name": "a"}]),
        'support[1].name = "a": gives a_1_force to support[0] too',
    ),
    "axis": (
        described(
            support=TILT | {"name": "board"}, spring=[{"between": ["ground@1.0,0.5", "board"], "stiffness": 5.0}]
        ),
        "spring[0].between: both ends are at rest: it would do nothing",
    ),
    "place": (described(support=[LEFT, RIGHT | {"mass": -1.0}]), "support[1].mass = -1.0: must not be negative"),
    "moved": (
        described(support=[LEFT, {"kind": "moved", "motion": SINE}]),
        'support[1].kind = "moved": cannot stand among several supports: write [ground] with its motion',
    ),
    "moved twice": (
        described(support={"kind": "moved", "motion": SINE}, ground={"motion": SINE}),
        'support.kind = "moved": cannot be combined with [ground], which moves it',
    ),
    "both ways": (described(ground={"motion": [SINE, SINE]}), "ground.motion: has 2 motions"),
    "on": (described(support=[LEFT, RIGHT]), 'pendulum[0].on: is required among several supports: "left", "right"'),
    "no such": (
        described(support=[LEFT, RIGHT], pendulum=[hung(on="lefft")]),
        'pendulum[0].on = "lefft": there is no support "lefft" (did you mean left?)',
    ),
    "numbered": (
        described(support=[LEFT, RIGHT], pendulum=[hung(on="left[2]")]),
        'pendulum[0].on = "left[2]": only a modal support has numbered points',
    ),
    "two places": (
        described(support=[LEFT, RIGHT], pendulum=[hung(on="left@1,2")]),
        'write on = "left" and position = [1.0, 2.0]',
    ),
    "on the ground": (
        described(pendulum=[hung(on="ground")]),
        'pendulum[0].on = "ground": is not the name of a support: hang it from one of kind fixed',
    ),
    "no number": (described(support=FRAME), 'pendulum[0].on: is required on a modal support: write on = "modal[0]"'),
    "beyond": (
        described(support=FRAME, pendulum=[hung(on="modal[3]")]),
        'support "modal" has 1 points, numbered from 0',
    ),
    "position": (
        described(support=FRAME, pendulum=[hung(on="modal[0]", position=[1.0, 0.0])]),
        "pendulum[0].position: cannot be combined with a numbered point",
    ),
    "no end": (springy("nope", "ground"), 'spring[0].between[0] = "nope": there is no support "nope"'),
    "no link": (springy("ground", "pendulum[5].links[0]"), "the scene has 2 entries of pendulum, numbered from 0"),
    "no cart": (springy("cart", "ground"), 'spring[0].between[0] = "cart": the support is fixed'),
    "beyond a link": (springy("pendulum[0].links[0]@2", "ground"), "the link reaches 1 m below its upper joint"),
    "counts": (
        springy("pendulum[0].links[0]", "pendulum[1].links[0]"),
        "spring[0].between: joins 2 points to 3: as many of both, or one",
    ),
    "one body": (springy("pendulum[0].links[0]@0.5", "pendulum[0].links[0]@0.2"), "both ends are on one body"),
    "at rest": (springy("ground@1,0", "fixed"), "spring[0].between: both ends are at rest"),
    "far": (springy("ground@1e200,0", "pendulum[0].links[0]"), "a place is at most 1e+100 m away"),
    "hoisted": (
        springy("ground@1,0", "pendulum[0].links[0]")
        | {"pendulum": [{"links": [BOB | {"hoist": {"to": 2.0, "duration": 1.0}}]}]},
        "the length of this rope changes, and no spring can end on it",
    ),
    "turning": (springy("fixed", "pendulum[0].links[0]", kind="torsion"), "a support of kind fixed does not turn"),
    "angles": (springy("ground", "pendulum[0].links[0]@1", kind="torsion"), "an angle has no place: omit @"),
    "torque": (pushed("right", direction="torque"), "a support of kind cart does not turn"),
    "upwards": (pushed("right", direction="vertical"), "a support of kind cart moves only along a horizontal force"),
    "sideways": (pushed("left"), "a support of kind heave moves only along a vertical force"),
    "which cart": (pushed("cart"), 'force[0].on = "cart": there are several supports: write the name of one'),
    "the ground": (pushed("ground"), 'force[0].on = "ground": the ground cannot be moved by a force'),
    "constant": (
        pushed("right") | {"force": [{"on": "right", "kind": "constant", "amplitude": 1.0}]},
        'force[0].kind = "constant": constant forces are not supported in a structure',
    ),
    "no support": (pushed("rihgt"), 'there is no support "rihgt" (did you mean right?)'),
    "space": (described(support=TILT | {"stiffness": 1.0}, space="space"), 'write space = "plane"'),
    "friction": (
        described(support=[LEFT | {"friction": 1.0}, RIGHT], pendulum=[hung(on="left")]),
        "support[0].friction = 1.0: dry friction is not supported in a structure",
    ),
    "joints": (
        described(support=TILT, pendulum=[{"links": [BOB | {"friction": 0.1}]}]),
        "pendulum[0].links[0].friction = 0.1: dry friction is not supported in a structure",
    ),
    "massless": (described(support=[LEFT, RIGHT | {"mass": 0.0}]), "support[1].mass = 0.0: must be positive"),
    "inverted": (
        springy("ground@1,0", "pendulum[0].links[0]") | {"pendulum": [hung(equilibrium=["up"])]},
        "pendulum[0].equilibrium: inverted links cannot be combined with springs between points",
    ),
    "spread": (
        described(pendulum=[hung(start={"angles_deg": [5.0], "rates_deg": [1.0], "spread": True})]),
        "pendulum[0].start.rates_deg: cannot be combined with spread",
    ),
    "board": (
        described(support=TILT, pendulum=[hung(position=[0.5, 0.1])]),
        "support: the weights turn it with -4.905 N m, which nothing holds: give it stiffness, or balance them",
    ),
    "falls": (
        described(support=[HEAVE | {"name": "h"}, LEFT], pendulum=[hung(on="h")]),
        "support.h: the weights pull it with 19.62 N, which nothing holds: give it stiffness",
    ),
    "no arrays": (standing(kind="modal"), "support: needs a file, or M, K, points"),
    "no K": (standing(kind="modal", M=TWO, points=FRAME["points"]), "support: needs a file, or K"),
    "no file": (standing(kind="modal", file="x.npz"), "support.file: is read with the scene file that names it"),
    "square": (standing(**FRAME | {"K": ONE}), "support.K: must have 2 rows of 2 numbers"),
    "skew": (standing(**FRAME | {"K": [[1.0, 0.5], [0.4, 1.0]]}), "support.K: must be symmetric"),
    "definite": (standing(**FRAME | {"M": [[1.0, 2.0], [2.0, 1.0]]}), "support.M: must be positive definite"),
    "sign": (standing(**FRAME | {"D": [[1.0, 2.0], [2.0, 1.0]]}), "support.D: must be positive semidefinite"),
    "points": (standing(**FRAME | {"points": [[[1.0, 0.0]]]}), "support.points[0]: must be 2 lists of 2 numbers"),
    "start": (
        standing(**FRAME | {"start": {"displacements": [1.0]}}),
        "support.start.displacements: has 1 values for 2 coordinates",
    ),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_is_told_with_its_place(name: str) -> None:
    data, words = MISTAKES[name]
    with pytest.raises(SceneError) as error:
        scene_from(data)
    assert words in str(error.value)


def test_all_mistakes_are_told_at_once() -> None:
    data = described(support=[LEFT, LEFT], pendulum=[hung(on="lefft"), hung()])
    with pytest.raises(SceneError) as error:
        scene_from(data)
    assert len(error.value.problems) == 3


# --------------------------------------------------------------------------------------------------- what it is


def test_one_support_of_a_list_is_that_support() -> None:
    scene = scene_from(described(support=[LEFT]))
    assert scene.support == Cart(mass=2.0, name="left")
    assert scene.cart is scene.support
    assert not scene.is_structured
    assert scene == parse(dumps(scene).encode())


def test_a_cart_is_a_structure_under_springs_and_over_moving_ground() -> None:
    spring = [{"between": ["cart", "ground"], "stiffness": 1.0}]
    for more in ({"spring": spring}, {"ground": {"motion": SINE}}):
        scene = scene_from(described(support=CART) | more)
        assert "structure" in scene.features
        assert "cart" not in scene.features
        assert scene.cart is None


def test_moving_ground_under_a_fixed_support_is_a_moved_support() -> None:
    moved = scene_from(described(support={"kind": "moved", "motion": SINE}))
    ground = scene_from(described(ground={"motion": [SINE]}))
    assert moved.motions == ground.motions
    assert moved.features == ground.features == {"moved_support"}
    assert moved.motion_places == (("support", "motion"),)
    assert ground.motion_places == (("ground", "motion", 0),)
    assert moved.still == ground.still == scene_from(described())
    assert isinstance(moved.support, Moved)
    assert isinstance(ground.support, Fixed)


def test_what_is_conservative_and_still_has_neither_dampers_nor_motions() -> None:
    planar = {"kind": "platform", "name": "ship", "mass": 2.0, "inertia": 1.0}
    planar |= {"damping": {"roll": 1.0}, "stiffness": {"heave": 9.0}}
    frame = FRAME | {"name": "frame", "D": TWO}
    spring = {"between": ["ship", "frame[0]"], "stiffness": 1.0, "damping": 1.0}
    scene = scene_from(described(support=[planar, frame], pendulum=[hung(on="ship")], spring=[spring]))
    assert scene.features == {"structure", "springs", "dampers"}
    assert scene.conservative.features == {"structure", "springs"}
    assert scene.conservative.support[0].stiffness.heave == 9.0
    shaken = scene_from(described(support=[planar], pendulum=[hung(on="ship")], ground={"motion": SINE}))
    assert shaken.features == {"structure", "dampers", "moved_support"}
    assert shaken.conservative.still.features == {"structure"}
    assert refusals(scene, "form maximal")


def test_titles_say_what_pendula_hang_from() -> None:
    swings = load("two-swings").replace(title="")
    assert title_of(swings) == "30 simple pendula on two swings, joined by a spring"
    assert title_of(load("beam").replace(title="")) == "Two simple pendula on a board that tilts"


# --------------------------------------------------------------------------------------------------- numbers


@pytest.mark.parametrize(
    ("name", "path", "place", "unit"),
    [
        ("two-swings", "support[1].mass", ("support", 1, "mass"), "kg"),
        ("two-swings", "support.right.length", ("support", 1, "length"), "m"),
        ("two-swings", "support.right.damping", ("support", 1, "damping"), "N s/m"),
        ("two-swings", "support.right.position[0]", ("support", 1, "position", 0), "m"),
        ("two-swings", "spring[0].stiffness", ("spring", 0, "stiffness"), "N/m"),
        ("beam", "support.stiffness", ("support", "stiffness"), "N m/rad"),
        ("beam", "support.tilt.damping", ("support", "damping"), "N m s/rad"),
        ("beam", "support[0].centre[1]", ("support", "centre", 1), "m"),
        ("ship-crane", "support.ship.stiffness.heave", ("support", "stiffness", "heave"), "N/m"),
        ("ship-crane", "support.damping.roll", ("support", "damping", "roll"), "N m s/rad"),
        ("ship-crane", "pendulum[0].position[0]", ("pendulum", 0, "position", 0), "m"),
    ],
)
def test_numbers_of_supports_have_places_and_units(name: str, path: str, place: tuple[Any, ...], unit: str) -> None:
    scene = load(name)
    assert find_places(scene, path) == [place]
    assert unit_at(scene, place) == unit
    (variation,) = parse_variations([f"{path}=1,2"])
    validate_variations(scene, [variation])
    assert variation.unit == unit


def test_a_variation_by_name_is_one_by_index_and_matrices_are_not_varied() -> None:
    scene = load("two-swings")
    assert vary(scene, {"support.right.mass": 7.0}) == vary(scene, {"support[1].mass": 7.0})
    (variation,) = parse_variations(["spring[0].stiffness=1:2:3"])
    validate_variations(scene, [variation])
    assert variation.column == "spring[0].stiffness_N_per_m"
    frame = scene_from(standing(**FRAME))
    for path in ("support.K[0][0]", "support.modal.M[0][0]", "support.left.mass"):
        with pytest.raises(SceneError, match=r"not a number of this scene|is not a place"):
            find_places(frame, path)


# --------------------------------------------------------------------------------------------------- weights


def potential(scene: Scene, eta: np.ndarray) -> complex:
    """−g Σ m z of all that a structure carries, from places alone."""
    structure = structure_of(scene)
    parts = [
        (k, carrier.centre, carrier.mass)
        for k, carrier in enumerate(structure.carriers)
        if carrier.size and carrier.M is None
    ]
    parts += [
        (pivot.carrier, pivot.where, mass) for pivot, mass in zip(structure.pivots, hung_masses(scene), strict=True)
    ]
    total = 0.0 + 0.0j
    for carrier, where, mass in parts:
        coordinates = structure.part(carrier, eta)
        total -= scene.gravity * mass * structure.carriers[carrier].moving(where, coordinates, coordinates).place[1]
    return total


def test_weights_are_slopes_of_the_potential() -> None:
    supports = [
        {"kind": "swing", "name": "a", "mass": 2.0, "length": 0.5},
        {"kind": "tilt", "name": "b", "mass": 3.0, "inertia": 0.2, "centre": [0.3, 0.1], "stiffness": 50.0},
        {"kind": "heave", "name": "c", "mass": 3.0, "stiffness": 50.0},
        {"kind": "platform", "name": "d", "mass": 4.0, "inertia": 1.0, "stiffness": {"heave": 9.0, "roll": 8.0}},
        FRAME | {"name": "e", "points": [[[1.0, 0.0], [0.25, -0.5]]]},
    ]
    hanging = [hung(on=name, position=[0.4, 0.2], count=2) for name in "abcd"] + [hung(on="e[0]")]
    scene = scene_from(described(support=supports, pendulum=hanging))
    structure = structure_of(scene)
    forces = np.array([weight.force for weight in weights(structure, hung_masses(scene), scene.gravity)])
    steps = 1e-30j * np.eye(structure.size)
    expected = np.array([-potential(scene, step).imag / 1e-30 for step in steps])
    assert forces == pytest.approx(expected, rel=1e-14, abs=1e-14)
    assert np.abs(forces).max() > 40
    assert list(find_imbalance(scene)) == []


def test_only_what_springs_hold_is_carried() -> None:
    hanging = [hung(position=[side, 0.1]) for side in (-0.3, 0.3)]
    loose = scene_from(described(support=TILT, pendulum=hanging))
    assert carried_weights(structure_of(loose), hung_masses(loose), loose.gravity) == [0.0]
    assert isinstance(loose.support, Tilt)
    held = loose.replace(support=loose.support.replace(stiffness=1.0), pendulum=loose.pendulum[1:])
    assert carried_weights(structure_of(held), hung_masses(held), held.gravity) == pytest.approx(
        [-9.81 * 0.3], rel=1e-15
    )


# --------------------------------------------------------------------------------------------------- files


def test_a_modal_support_is_read_from_its_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(0)
    root, points = rng.standard_normal((3, 3)), rng.standard_normal((4, 2, 3))
    np.savez(tmp_path / "frame.npz", M=np.eye(3), K=root @ root.T, points=points, mesh=np.arange(5))
    text = (
        'gravity = 9.81\nsupport = [{ kind = "modal", name = "frame", file = "frame.npz" }, '
        '{ kind = "cart", name = "left", mass = 1.0 }]\n'
        '[[pendulum]]\non = "frame[3]"\nlinks = [{ kind = "bob", mass = 1.0, length = 1.0 }]\n'
    )
    scene = parse(text.encode(), tmp_path)
    assert np.array_equal(scene.support[0].points, points)
    assert np.array_equal(scene.support[0].K, root @ root.T)
    assert parse(dumps(scene).encode()) == scene
    monkeypatch.setattr("modal.scene.supports.FILE_BYTES_MAX", 100)
    with pytest.raises(SceneError, match=r'support\[0\].file = "frame.npz": has arrays of more than'):
        parse(text.encode(), tmp_path)


@pytest.mark.parametrize(
    ("arrays", "words"),
    [
        ({"M": np.eye(2)}, "has no array K, points"),
        ({"M": np.eye(2), "K": np.eye(2), "points": np.eye(2)}, "points: must be an array of real numbers with 3 axes"),
        ({"M": np.array([{}]), "K": np.eye(2), "points": np.eye(2)}, "is incomplete, or is not a"),
    ],
)
def test_another_file_is_refused(arrays: dict[str, Any], words: str, tmp_path: Path) -> None:
    np.savez(tmp_path / "frame.npz", **arrays)
    with pytest.raises(SceneError, match=words):
        read_matrices(tmp_path / "frame.npz")


def test_the_schema_takes_structures() -> None:
    from jsonschema.exceptions import ValidationError
    from jsonschema.validators import validator_for

    check = validator_for(schema())(schema())
    data = described(
        support=[LEFT, FRAME | {"name": "frame"}],
        pendulum=[hung(on="left", start={"angles_deg": [5.0], "spread": True})],
        spring=[{"between": ["left@0.1,0.2", "ground"], "stiffness": 1.0}],
    )
    check.validate(data)
    check.validate(data | {"ground": {"motion": [SINE]}})
    assert scene_from(data).is_structured
    with pytest.raises(ValidationError):
        check.validate(data | {"spring": [{"between": ["left"]}]})


def test_a_spring_ends_on_an_axis_from_a_link_and_an_idle_one_is_named() -> None:
    springs = [
        {"between": ["pendulum[0].links[0]@0.5", "board"], "stiffness": 5.0},
        {"between": ["ground@0.3,0.2", "board@0.1,0.2"]},
    ]
    scene = scene_from(described(support=TILT | {"name": "board", "centre": [0.0, 0.2]}, spring=springs))
    assert left_out(scene) == ("spring[1] does nothing: its stiffness and damping are 0.",)
    assert left_out(scene.replace(spring=scene.spring[:1])) == ()
