"""The commands about state-space models: export, gains, response, shaper."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING

from multipendula.commands.modes import drawn, listed, picture, small_swings

if TYPE_CHECKING:
    from modal.scene import Scene
    from modal.statespace import StateSpace


def export(options: argparse.Namespace) -> None:
    """Write a named state-space model for a control program, a simulator or a controller."""
    from modal.exports import format_named
    from modal.scene import whole_file

    target = format_named(options.to)
    model = _model(_scene(options), options)
    if options.discrete:
        from modal.statespace.sampling import sample

        model = sample(model, options.discrete)
    content = target.write(model)
    with whole_file(options.file) as stream:
        stream.write(content)
    if note := target.note(content):
        print(f"multipendula: {note}", file=sys.stderr)


def gains(options: argparse.Namespace) -> None:
    """Say how well each mode is reached by every input and seen by every output."""
    from modal.modes import natural_modes
    from modal.statespace import modal_gains

    scene = _scene(options)
    print(modal_gains(natural_modes(scene), _model(scene, options)).text())


def response(options: argparse.Namespace) -> None:
    """Draw a Bode plot or an impulse response, with the modes marked."""
    from modal.errors import SceneError
    from modal.modes import natural_modes
    from modal.plotting import draw_bode, draw_impulse
    from modal.statespace import to_modal_form

    kind, scene = picture(options.file), _scene(options)
    model = _model(scene, options)
    inputs, outputs = ([signal.name for signal in signals] for signals in (model.inputs, model.outputs))
    source, shown = options.source or inputs[0], listed(options.of)
    problems = [f"--from {source}: must be one of {', '.join(inputs)}"] if source not in inputs else []
    problems += [f"--of {name}: must be one of {', '.join(outputs)}" for name in shown if name not in outputs]
    if problems:
        raise SceneError(problems)
    form = to_modal_form(natural_modes(scene), model)
    draw = draw_impulse if options.impulse else draw_bode
    with drawn(options.file, options.theme) as stream:
        draw(form, stream, source=inputs.index(source), outputs=[outputs.index(name) for name in shown], kind=kind)


def shaper(options: argparse.Namespace) -> None:
    """Print an input shaper that leaves the slowest modes of a crane at rest."""
    from modal.scene import load
    from modal.statespace import shaper_for, swing_words

    scene = small_swings(load(options.scene))
    found = shaper_for(scene, options.count, options.kind, options.drive)
    for words in swing_words(scene, options.count, options.drive):
        print(f"# {words}")
    print("time_s,amplitude")
    for time, amplitude in zip(found.times, found.amplitudes, strict=True):
        print(f"{float(time)!r},{float(amplitude)!r}")


def _scene(options: argparse.Namespace) -> Scene:
    from modal.scene import load

    return small_swings(load(options.scene))


def _model(scene: Scene, options: argparse.Namespace) -> StateSpace:
    """The model that --input, --output, --minimal and --modes ask for."""
    from modal.statespace import state_space

    inputs, outputs = listed(options.input), listed(options.output)
    count = getattr(options, "modes", None)
    if not getattr(options, "minimal", False) and count is None:
        return state_space(scene, inputs, outputs)
    from modal.modes import natural_modes
    from modal.statespace import minimal, truncate

    if count is None:
        return minimal(scene, inputs, outputs)
    return truncate(natural_modes(scene), state_space(scene, inputs, outputs), count)
