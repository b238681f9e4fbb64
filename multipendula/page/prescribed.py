"""Motions of a support and loads in time on a page other than sines: sweeps, records and random processes.

The module `prescribed` of the page is made here, null where all that time brings are sines.  It has the functions of a
sweep, as Python runs them (`multipendula.page.scalars`), the polynomials of a record, the lines of a random process,
and which of them, in which derivative, are the inputs u of the equations (`nonlinear.dynamics.inputs`).
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from modal.scene import Scene
from multipendula.page.scalars import HELPERS, method_source

if TYPE_CHECKING:
    from modal.vibration import Polynomials, PrescribedMotion, Record
    from nonlinear.system import System

NONE = "export const prescribed = null;"
PIECES_MAX = 2000
"""Limit: samples of a record or lines of a random process: "cannot show more than 2000 samples or sines of it"."""
SWEEP = ("_turning", "velocity_at", "acceleration_at")


def prescribed_module(scene: Scene) -> str:
    """The text of the module of a scene."""
    from nonlinear.system import system_of

    system = system_of(scene)
    if not system.prescribed_motions or system.is_analytic:
        return NONE
    from modal.vibration import SweptSine

    data = {
        "sources": [_source(motion) for motion in system.prescribed_motions],
        "courses": [[system.prescribed_motions.index(course.motion), course.order] for course in system.courses()],
        "forces": len(system.forces),
        "breaks": sorted({float(time) for motion in system.prescribed_motions for time in motion.breaks}),
        "shortest": system.shortest,
    }
    return "\n".join(
        (
            "// Written by `multipendula.page.prescribed`.",
            HELPERS,
            "const { sin, cos } = Math;",
            method_source([getattr(SweptSine, name) for name in SWEEP]),
            f"const sweep = {{ turning: {SWEEP[0]}, velocity: {SWEEP[1]}, acceleration: {SWEEP[2]} }};",
            f"export const prescribed = {{ ...{json.dumps(data, allow_nan=False)}, sweep }};",
        )
    )


def leading(system: System) -> int:
    """How many inputs u of the equations come first: the time, or the prescribed values."""
    if not system.prescribed_motions:
        return 0
    return 1 if system.is_analytic else len(system.courses())


def long_ones(scene: Scene) -> Iterator[str]:
    """The kinds of motions and forces that are too long for a page."""
    from modal.vibration import RandomProcess, Record, prescribed_motion

    for part in (*scene.motions, *scene.force):
        if part.kind in {"record", "random"}:
            motion = prescribed_motion(part)
            size = len(motion.pieces[0]) if isinstance(motion, Record) else 0
            size = len(motion.omega) if isinstance(motion, RandomProcess) else size
            if size > PIECES_MAX:
                yield part.kind


def _source(motion: PrescribedMotion) -> dict[str, Any]:
    from modal.vibration import RandomProcess, Record, SweptSine

    if isinstance(motion, Record):
        return {"kind": "record", "orders": [_listed(pieces) for pieces in _polynomials(motion)]}
    if isinstance(motion, RandomProcess):
        return {
            "kind": "random",
            "omega": motion.omega.tolist(),
            "real": motion.lines.real.tolist(),
            "imaginary": motion.lines.imag.tolist(),
        }
    return {"kind": "sweep" if isinstance(motion, SweptSine) else "sine" if len(motion.constants) > 1 else "constant"}


def _polynomials(motion: Record) -> tuple[Polynomials, Polynomials, Polynomials]:
    """The polynomials of the displacement, the velocity and the acceleration."""
    velocity, acceleration = (motion.polynomials(order) for order in (1, 2))
    powers = np.arange(1, velocity.coefficients.shape[1] + 1)
    begun = np.asarray(motion.derivative(velocity.origins, 0))
    place = velocity._replace(coefficients=np.column_stack((begun, velocity.coefficients / powers)))
    return place, velocity, acceleration


def _listed(polynomials: Polynomials) -> dict[str, Any]:
    return {name: getattr(polynomials, name).tolist() for name in ("knots", "origins", "coefficients")}
