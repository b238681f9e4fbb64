"""The page as one file: markup, style and modules in one document, which may load and send nothing.

The modules are joined in the order of `MODULES`, each below those that it imports, in one script without remarks.
`system.js` becomes a function whose result `$system` holds what the module exports; its names are its own, as in a
module by itself.  The policy of the document admits this script and this style by their digests and nothing else; data
are inert text.
"""

from __future__ import annotations

import json
import re
from base64 import b64encode
from collections.abc import Sequence
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any
from urllib.parse import quote

from modal.report import html
from modal.scene import Scene, left_out, scene_from, title_of
from multipendula.page.equations import drawing_module, prescribed_module, structure_module, whole_module
from multipendula.page.payload import known_rows

HERE = Path(__file__).parent
MODAL = (
    *("steps", "structure", "drawing", "whole", "prescribed", "numbers", "courses", "carriers", "tableau", "dop853"),
    *("switched", "system", "matrices", "amplitude", "quadratic", "shapes", "families", "words"),
    *("structure_modes", "modes"),
)
PHYSICS = (*MODAL, "equations", "kicks", "motion", "scene_file", "recording")
"""The modules that touch no document; `steps`, `structure`, `drawing`, `whole`, `prescribed`, `tableau` are written."""
MODULES = (*PHYSICS, "view", "picture", "sound", "player", "stage", "table", "controls", "challenges", "main")
LARGEST = 350_000
"""Limit: bytes of a page, which mail and forums take as an attachment."""
LARGEST_OF_STRUCTURES = 800_000
"""Limit: bytes of a page whose equations stand in it link by link: of a structure, friction, forces."""
ICON = (
    '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 32 32"><path d="M5 4h22" stroke="#8a949c" stroke-width="3"/>'
    '<path d="M16 4 11 16l9 9" fill="none" stroke="#8a949c" stroke-width="2"/>'
    '<circle cx="11" cy="16" r="4" fill="#c48700"/><circle cx="20" cy="25" r="5" fill="#005f9e"/></svg>'
)
"""A double pendulum."""
IMPORT = re.compile(r"^import (\{[^}]*\}) from \"\./(\w+)\.js\";$", re.MULTILINE)
REMARK = re.compile(r"^ *//.*\n", re.MULTILINE)
EXPORT = re.compile(r"^export (?=(?:const|function|class) (\w+))", re.MULTILINE)


def joined(names: Sequence[str] = MODULES, scene: Scene | None = None) -> str:
    """The modules of these names as one script, on the page of a scene."""
    return "\n".join(_scoped(name, _module(name, scene)) for name in names)


def _module(name: str, scene: Scene | None) -> str:
    written_for = {"structure": structure_module, "drawing": drawing_module}
    written_for |= {"whole": whole_module, "prescribed": prescribed_module}
    if name in written_for:
        return written_for[name](scene) if scene else f"export const {name} = null;"
    return {"steps": steps, "tableau": tableau}[name]() if name in {"steps", "tableau"} else _file(f"modules/{name}.js")


@cache
def steps() -> str:
    """The module of the equations of motion, written from the records of `nonlinear.dynamics.steps`."""
    from nonlinear.dynamics import link_steps, sine_steps, support_steps

    kinds = {
        kind: f"{{ link: {link_steps(linear=on).javascript()}, support: {support_steps(linear=on).javascript()} }}"
        for kind, on in (("full", False), ("linearized", True))
    }
    parts = {**kinds, "sine": sine_steps().javascript()}
    lines = [f"export const {name} = {text};" for name, text in parts.items()]
    return "\n".join(("// Written by `nonlinear.dynamics.text`.", "const { sin, cos, sqrt } = Math;", *lines))


@cache
def tableau() -> str:
    """The module of the coefficients of DOP853 and the limits of its steps, from `nonlinear.integration.method`."""
    from nonlinear.integration import method

    def row(shares: Sequence[tuple[int, float]], length: int) -> list[float]:
        weights = [0.0] * length
        for stage, share in shares:
            weights[stage] = share
        return weights

    count = method.STAGES
    coefficients = {
        "A": [row(shares, stage) for stage, shares in enumerate(method.ROWS[:count])],
        "B": row(method.END, count),
        "C": method.NODES[:count],
        "E3": row(method.THIRD, count + 1)[:count],
        "E5": row(method.FIFTH, count + 1)[:count],
    }
    limits = {
        "safety": method.STEP_SAFETY,
        "shrinks": method.STEP_RATIO_MIN,
        "grows": method.STEP_RATIO_MAX,
        "power": method.ERROR_POWER,
    }
    parts = {"DOP853": coefficients, "LIMITS": limits}
    lines = [f"export const {name} = {json.dumps(value)};" for name, value in parts.items()]
    return "\n".join(("// Written from `nonlinear.integration.method`.", *lines))


def _scoped(name: str, text: str) -> str:
    exported = ", ".join(EXPORT.findall(text))
    body = EXPORT.sub("", IMPORT.sub(r"const \1 = $\2;", REMARK.sub("", text)))
    return f"const ${name} = (() => {{\n{body}\nreturn {{ {exported} }};\n}})();\n"


def page(data: dict[str, Any], recording: dict[str, Any] | None = None) -> str:
    """The document that shows the scene in `data` and plays a recording of it."""
    scene = scene_from(data)
    script, style = f"\n{joined(scene=scene)}", f"\n{_file('page.css')}"
    sources = f"script-src '{_digest(script)}'; style-src '{_digest(style)}'; img-src data:"
    policy = f"default-src 'none'; {sources}; base-uri 'none'"
    parts = {
        "title": html(title_of(scene)),
        "policy": html(policy),
        "icon": f"data:image/svg+xml,{quote(ICON)}",
        "style": style,
        "script": script,
        "data": inert({"scene": data, "recording": recording, "notes": left_out(scene), "known": known_rows(scene)}),
    }
    return re.sub(r"\{\{(\w+)\}\}", lambda field: parts[field[1]], _file("page.html"))


def inert(whole: Any) -> str:
    r"""JSON that ends no element and begins none.

    >>> inert({"title": "</script>"})
    '{"title": "\\u003c/script>"}'
    """
    return json.dumps(whole, allow_nan=False).replace("<", "\\u003c")


def _digest(text: str) -> str:
    return f"sha256-{b64encode(sha256(text.encode()).digest()).decode()}"


def _file(name: str) -> str:
    return (HERE / name).read_text(encoding="utf-8")
