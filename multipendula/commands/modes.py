"""The commands: call and print.  Data goes to standard output, everything else to standard error."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import IO, TYPE_CHECKING

if TYPE_CHECKING:
    from modal.modes import Mode, Modes
    from modal.scene import Scene

LONG_TABLE = 2000


def scenes(options: argparse.Namespace) -> None:
    """List the shipped scenes, or print one."""
    from modal.scene import files

    if options.name:
        sys.stdout.write(files.example_text(options.name))
        return
    names = files.example_names()
    width = max(map(len, names))
    for name in names:
        print(f"{name:<{width}}  {files.load(name).title}")


def schema(options: argparse.Namespace) -> None:
    """Print the JSON Schema of a scene file."""
    import json

    from modal.scene import files

    print(json.dumps(files.schema(), indent=2))


def table(options: argparse.Namespace) -> None:
    """Print the table of modes."""
    from modal.errors import SceneError
    from modal.modes import tables

    if options.shapes and options.format != "json":
        raise SceneError(["--shapes: needs --format json"])
    modes, numbers = _modes(options)
    rows = list(_with_progress(modes.rows(numbers), len(numbers)))
    with _output(options.output) as write:
        write(tables.table(modes, rows, options.format, shapes=options.shapes))
    if options.explain:
        from modal.modes.solution_report import report_solution

        sys.stderr.write(report_solution(modes).text())


def shapes(options: argparse.Namespace) -> None:
    """Draw the mode shapes."""
    form = picture(options.output)
    modes, numbers = _modes(options)
    from modal.plotting import MOST_PANELS, draw_shapes

    chosen = numbers[:MOST_PANELS] if options.modes is None else numbers
    with drawn(options.output, options.theme) as stream:
        draw_shapes(modes, chosen, stream, amplitude_deg=options.amplitude, form=form)
    if len(chosen) < len(numbers):
        print(
            f"multipendula: drew the first {len(chosen)} of {len(numbers)} modes; choose with --modes", file=sys.stderr
        )


def matrices(options: argparse.Namespace) -> None:
    """Print M, K and D."""
    from modal.assembly import matrices as matrices_of
    from modal.modes.tables import matrices_table
    from modal.scene import load

    scene = small_swings(load(options.scene))
    with _output(options.output) as write:
        write(matrices_table(scene, matrices_of(scene), options.format))


def derive(options: argparse.Namespace) -> None:
    """Derive equations of motion, matrices, eigen-polynomial and modes in symbols."""
    from modal.errors import SceneError
    from modal.symbolic import derivation, typesetting
    from modal.symbolic.papers import catalogue

    show, symbols, ways = (listed(getattr(options, name)) for name in ("show", "symbolic", "equilibrium"))
    if unknown := [word for word in show if word not in derivation.SECTIONS]:
        raise SceneError([f"--show {word}: must be one of {', '.join(derivation.SECTIONS)}" for word in unknown])
    if options.target.startswith("paper:"):
        if show or symbols or ways or options.links != "bob":
            raise SceneError([f"{options.target}: takes none of --show, --symbolic, --links and --equilibrium"])
        title, sections = catalogue.paper(options.target.removeprefix("paper:"))
    else:
        system, scene = derivation.target(options.target, options.links, symbols, ways)
        title = system.title
        sections = list(derivation.derive(system, show or derivation.SECTIONS, scene and small_swings(scene)))
    with _output(options.output) as write:
        write(typesetting.typeset(title, sections, options.format))


def enclose(options: argparse.Namespace) -> None:
    """Print every natural frequency in a proved enclosure, to as many digits as asked for."""
    from modal.exact import enclose
    from modal.scene import load

    with _output(options.output) as write, bar(1.0, "scene") as report:
        for row in enclose(small_swings(load(options.scene)), options.digits, report):
            folds = f", {row.multiplicity}-fold" if row.multiplicity > 1 else ""
            write(f"{row.low} <= omega <= {row.high} rad/s  {row.label}{folds}\n")


def explain(options: argparse.Namespace) -> None:
    """Say in words, and draw, how the cart couples the pendula."""
    from modal.coupling import coupling_report, explain
    from modal.scene import load

    kind = picture(options.output) if options.output else ""
    coupling = explain(load(options.scene))
    if kind:
        from modal.plotting import draw_coupling

        with drawn(options.output, options.theme) as stream:
            draw_coupling(coupling, stream, kind)
    sys.stdout.write(coupling_report(coupling, options.format))


# -------------------------------------------------------------------------------------------------- helpers


def small_swings(scene: Scene) -> Scene:
    """The scene itself, with a word on what its small swings leave out."""
    from modal.modes import UNDRIVEN

    if scene.is_driven:
        print(f"multipendula: {UNDRIVEN}", file=sys.stderr)
    return scene


@contextmanager
def drawn(name: str, theme: str) -> Iterator[IO[bytes]]:
    """A file for a picture or a film, and the theme that it is drawn in."""
    from modal.plotting import style as pictures
    from modal.scene import files

    with pictures.theme(theme), files.whole_file(name) as stream:
        yield stream


def listed(text: str | None) -> tuple[str, ...]:
    """The words of a list with commas."""
    return tuple(word.strip() for word in text.split(",")) if text else ()


def picture(name: str, option: str = "-o") -> str:
    """The kind of picture that a file name asks for."""
    from modal.scene import kind_of

    return kind_of(name, ("png", "svg", "pdf"), f"{option} ")


def _modes(options: argparse.Namespace) -> tuple[Modes, Sequence[int]]:
    from modal.modes import natural_modes
    from modal.scene import load

    found = natural_modes(load(options.scene))
    return found, chosen(options.modes, len(found))


def _with_progress(rows: Iterator[Mode], total: int) -> Iterable[Mode]:
    """A progress bar for long tables, on a terminal only."""
    if total < LONG_TABLE or not sys.stderr.isatty():
        return rows
    from tqdm import tqdm

    return tqdm(rows, total=total, unit="mode", leave=False)


def chosen(text: str | None, total: int, option: str = "--modes") -> range:
    """Indices from 0 of `first:last`, counted from 1 and inclusive; either end, or all of it, may be left out."""
    from modal.errors import SceneError

    if text is None:
        return range(total)
    first, colon, last = text.partition(":")
    try:
        low = int(first) if first or not colon else 1
        high = (int(last) if last else total) if colon else low
    except ValueError:
        raise SceneError([f"{option} {text}: must be a number or a range such as 1:10"]) from None
    if colon and low > high and (last or low <= total):
        raise SceneError([f"{option} {text}: begins after its end"])
    if low < 1 or low > total:
        raise SceneError([f"{option} {text}: the scene has modes 1 to {total}"])
    return range(low - 1, min(high, total))


@contextmanager
def bar(total: float, unit: str = "s") -> Iterator[Callable[[float], object]]:
    """A progress bar, by default in seconds of pendulum time, on a terminal and for what takes a while."""
    if not sys.stderr.isatty():
        yield lambda elapsed: None
        return
    from tqdm import tqdm

    with tqdm(total=total, unit=unit, unit_scale=True, delay=1.0, leave=False) as shown:
        yield lambda elapsed: shown.update(elapsed - shown.n)


@contextmanager
def _output(path: str | None) -> Iterator[Callable[[str], object]]:
    if path is None:
        yield sys.stdout.write
        return
    from modal.scene import whole_file

    with whole_file(path) as stream:
        yield lambda text: stream.write(text.encode())
