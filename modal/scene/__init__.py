"""Scenes: the description of a system of pendula, its file, and its parameters by their paths.

In: TOML, or the same objects from Python.  Out: an immutable `Scene`, checked completely on construction.

    pendulum[2].links[0].mass = -1.0: must be positive

Start with `model`, whose pendula are chains of `links`, with their loss angles, and hang from `supports`, which springs
join; `structures` checks both; `motion` prescribes support motions and forces on `points`, `feedback` defines feedback
loops, `periods` finds common periods, `records` reads records, `hoist` changes a length by one of `length_laws`;
`files` reads and writes scenes, `sealed` detects damaged files, `contents` reads files and recognizes their kinds;
`validation` checks every part, `mistakes` words the messages, `parameters` finds and varies numbers by path,
`number_names` names them in words and `signal_names` signals, `doors` checks arguments, `titles` describes scenes in
words, `free_body` draws free-body diagrams.
"""

from typing import TYPE_CHECKING

from modal.lazy import lazy_attributes

if TYPE_CHECKING:
    from modal.scene.capabilities import CAPABILITIES, left_out, one_by_one, refusals, require
    from modal.scene.features import FEATURES
    from modal.scene.feedback import Feedback, GainMatrix
    from modal.scene.files import STANDARD, dump, dumps, example_names, kind_of, load, parse, whole_file
    from modal.scene.free_body import FreeBodies, FreeBody, free_bodies
    from modal.scene.hoist import Hoist
    from modal.scene.length_laws import LengthLaw
    from modal.scene.links import AnyLink, Bob, Body, Escapement, LossTable, Rod, VanDerPol, is_lossy
    from modal.scene.model import (
        InitialCondition,
        Pendulum,
        Scene,
        describe,
        scene_from,
        validate_scene,
        validate_scenes,
    )
    from modal.scene.motion import (
        ConstantForce,
        Force,
        Ground,
        Moved,
        RandomForce,
        RandomMotion,
        RecordForce,
        RecordMotion,
        SineForce,
        SineMotion,
        SupportMotion,
        SweepForce,
        SweepMotion,
    )
    from modal.scene.number_names import number_label, number_unit, number_words, scene_numbers
    from modal.scene.parameters import parse_variations
    from modal.scene.periods import DrivePeriod, drive_period, frequencies_of, sines_of
    from modal.scene.points import places_of
    from modal.scene.records import Spectrum
    from modal.scene.supports import Carrier, Cart, Fixed, Heave, ModalSupport, Platform, Spring, Swing, Tilt
    from modal.scene.titles import name_of, title_of, what_hangs

__all__ = [
    "CAPABILITIES",
    "FEATURES",
    "STANDARD",
    "AnyLink",
    "Bob",
    "Body",
    "Carrier",
    "Cart",
    "ConstantForce",
    "DrivePeriod",
    "Escapement",
    "Feedback",
    "Fixed",
    "Force",
    "FreeBodies",
    "FreeBody",
    "GainMatrix",
    "Ground",
    "Heave",
    "Hoist",
    "InitialCondition",
    "LengthLaw",
    "LossTable",
    "ModalSupport",
    "Moved",
    "Pendulum",
    "Platform",
    "RandomForce",
    "RandomMotion",
    "RecordForce",
    "RecordMotion",
    "Rod",
    "Scene",
    "SineForce",
    "SineMotion",
    "Spectrum",
    "Spring",
    "SupportMotion",
    "SweepForce",
    "SweepMotion",
    "Swing",
    "Tilt",
    "VanDerPol",
    "describe",
    "drive_period",
    "dump",
    "dumps",
    "example_names",
    "free_bodies",
    "frequencies_of",
    "is_lossy",
    "kind_of",
    "left_out",
    "load",
    "name_of",
    "number_label",
    "number_unit",
    "number_words",
    "one_by_one",
    "parse",
    "parse_variations",
    "places_of",
    "refusals",
    "require",
    "scene_from",
    "scene_numbers",
    "sines_of",
    "title_of",
    "validate_scene",
    "validate_scenes",
    "what_hangs",
    "whole_file",
]

if not TYPE_CHECKING:
    __getattr__ = lazy_attributes(__name__)
