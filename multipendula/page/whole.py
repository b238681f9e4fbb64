"""Scenes whose equations the page has as one text: those with dry friction, or with forces, on a cart or a support.

The module `whole` of the page is made here, null for other scenes: the functions of `switching_of` in
`nonlinear.dynamics.forms`, the changes at a switch and where a step ends at one, all the same text as Python runs
(`multipendula.page.scalars`), and where the numbers are that they take.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from modal.scene import Scene
from multipendula.page.prescribed import leading
from multipendula.page.scalars import HELPERS, functions_of
from multipendula.page.structure import FUNCTIONS, is_structural

NONE = "export const whole = null;"
SWITCHED_LINKS_MAX = 12
"""Limit: links of a scene with dry friction or forces, whose text grows with the square of their number."""
TEXTS = ("rates", "sticking", "friction", "responses", "values", "clear", "kick")
CHANGED = ("damping", "drag", "quadratic_drag")
"""The numbers of links that have a slider also where they are 0."""
CALLED = ("sticking", "friction", "responses", "kick", "kicked")
"""The texts that are called at a switch."""
LISTS = frozenset({"inputs"})


def is_whole(scene: Scene) -> bool:
    """Whether the page has the equations of a scene as one text."""
    return not is_structural(scene) and (scene.has_friction or bool(scene.force))


def whole_module(scene: Scene) -> str:
    """The text of the module of a scene."""
    if not is_whole(scene):
        return NONE
    from nonlinear.integration import method, switches_of
    from nonlinear.system import constants_of, prescribed_places, system_of
    from nonlinear.system.numbers import BEFORE, FIELDS

    system = system_of(scene)
    switches = switches_of(system, has_load=True, works=True)
    firsts = [BEFORE + system.n_links * FIELDS.index(name) for name in CHANGED]
    changed = {k for first in firsts for k in range(first, first + system.n_links)}
    present = tuple(has or k in changed for k, has in enumerate(switches.form.present))
    switches = replace(switches, form=replace(switches.form, present=present))
    at, module = switches.places, switches.module
    names = [name for name in TEXTS if name in module.functions]
    data = {
        "first": switches.form.first,
        "kept": [k for k, has in enumerate(present) if has],
        "prescribed": constants_of(system),
        "places": [[list(place), unit] for place, unit in prescribed_places(scene, system)],
        "leading": leading(system),
        "told": at.state_count,
        "length": at.length,
        "presses": at.presses,
        "contacts": at.contacts,
        "kicks": at.kicks,
        "seen_": method.SEEN,
        "looks": method.LOOKS,
        "nodes": method.NODES,
    }
    sizes = {name: len(module.functions[name]) for name in names}
    lines = (
        "// Written by `multipendula.page.whole`.",
        FUNCTIONS,
        f"const steps = {module.javascript(*names)};",
        *(_called(name, sizes.get(name)) for name in dict.fromkeys((*names, *CALLED))),
        _switches(switches),
        f"const data = {json.dumps(data, allow_nan=False)};",
        "const constants = (p) => Float64Array.from(steps.constants(p));",
        f"const called = {{ {', '.join(names)} }};",
        "const switching = { inputs, begin, due, change, may_pass, meet, PASSING_SHARE, STANDS, AGAIN };",
        "export const whole = { ...data, ...called, ...switching, constants };",
    )
    return "\n".join(lines)


def _called(name: str, size: int | None) -> str:
    """A text as a function that returns its results; one that the scene does not have returns nothing."""
    if size is None:
        return f"const {name} = () => [];"
    return f"const {name} = (c, y, u, v) => {{ const o = new Array({size}); steps.{name}(c, y, u, v, o); return o; }};"


def _switches(switches: Any) -> str:
    """The changes at a switch, and where steps end at one."""
    from nonlinear.integration import MEETING, meeting_source, names_in, switching_source

    constants = [*_constants(names_in(switches.places)), *_constants(MEETING)]
    named = ["const [NOTHING, NAN, INF] = [[], NaN, Infinity];", *constants]
    return "\n".join((HELPERS, *named, functions_of(switching_source(), LISTS), functions_of(meeting_source())))


def _constants(names: Mapping[str, Any]) -> list[str]:
    return [f"const {name} = {json.dumps(value)};" for name, value in names.items()]
