"""The command: parse, call, print.  Data goes to standard output, everything else to standard error.

Exit codes: 0, 1 for what could not be computed or written, 2 for bad input.
"""

from __future__ import annotations

import argparse
import errno
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from io import TextIOWrapper
from typing import TYPE_CHECKING

os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")

if TYPE_CHECKING:
    from modal.mode import Mode
    from modal.modes import Modes

SCENE_HELP = "a scene file, the name of a shipped scene (see `multipendula scenes`), or - for standard input"
LONG_TABLE = 2000
FORMATS = ("text", "markdown", "latex", "csv", "html", "json")
USER_ERRORS = {errno.ENOENT, errno.ENOTDIR, errno.EISDIR, errno.EACCES, errno.EPERM, errno.EROFS, errno.ENAMETOOLONG}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code."""
    options = _parser().parse_args(arguments)
    from modal.errors import MultipendulaError, SceneError

    if sys.stdout is None:
        return _refuse("standard output is closed", 1)
    if isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")
    try:
        options.run(options)
        sys.stdout.flush()
    except SceneError as error:
        return _refuse(error, 2)
    except MultipendulaError as error:
        return _refuse(error, 1)
    except MemoryError:
        return _refuse("there is not enough memory for this scene", 1)
    except KeyboardInterrupt:
        return _refuse("interrupted", 130)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except OSError as error:
        return _refuse(
            f"cannot write{_named(error)}: {error.strerror or error}", 2 if error.errno in USER_ERRORS else 1
        )
    return 0


def _refuse(problem: object, code: int) -> int:
    for line in str(problem).splitlines():
        print(f"multipendula: {line}", file=sys.stderr)
    return code


def _named(error: OSError) -> str:
    return f" {error.filename}" if error.filename else ""


# ------------------------------------------------------------------------------------------------- commands


def scenes(options: argparse.Namespace) -> None:
    """List the shipped scenes, or print one."""
    from modal import files

    if options.name:
        sys.stdout.write(files.shipped_text(options.name))
        return
    names = files.shipped()
    width = max(map(len, names))
    for name in names:
        print(f"{name:<{width}}  {files.load(name).title}")


def schema(options: argparse.Namespace) -> None:
    """Print the JSON Schema of a scene file."""
    import json

    from modal import files

    print(json.dumps(files.schema(), indent=2))


def table(options: argparse.Namespace) -> None:
    """Print the table of modes."""
    from modal import tables
    from modal.errors import SceneError

    if options.shapes and options.format != "json":
        raise SceneError(["--shapes: needs --format json"])
    modes, numbers = _modes(options)
    rows = list(_with_progress(modes.rows(numbers), len(numbers)))
    with _output(options.output) as write:
        write(tables.table(modes, rows, options.format, shapes=options.shapes))


def shapes(options: argparse.Namespace) -> None:
    """Draw the mode shapes."""
    from modal.errors import SceneError
    from modal.files import whole_file

    form = os.path.splitext(options.output)[1].removeprefix(".").lower()
    if form not in {"png", "svg", "pdf"}:
        raise SceneError([f"--output {options.output}: the name must end in .png, .svg or .pdf"])
    modes, numbers = _modes(options)
    from modal.figures import MOST_PANELS, draw_shapes

    chosen = numbers[:MOST_PANELS] if options.modes is None else numbers
    with whole_file(options.output) as stream:
        draw_shapes(modes, chosen, stream, amplitude_deg=options.amplitude, form=form)
    if len(chosen) < len(numbers):
        print(
            f"multipendula: drew the first {len(chosen)} of {len(numbers)} modes; choose with --modes", file=sys.stderr
        )


def matrices(options: argparse.Namespace) -> None:
    """Print M, K and D."""
    from modal.files import load
    from modal.linear import matrices as matrices_of
    from modal.matrix_tables import matrices_table

    scene = load(options.scene)
    with _output(options.output) as write:
        write(matrices_table(scene, matrices_of(scene), options.format))


def derive(options: argparse.Namespace) -> None:
    """Derive equations of motion, matrices, eigen-polynomial and modes in symbols."""
    from modal import catalogue, derivation, targets, typeset
    from modal.errors import SceneError

    show, symbols, ways = (_listed(getattr(options, name)) for name in ("show", "symbolic", "equilibrium"))
    if unknown := [word for word in show if word not in derivation.SECTIONS]:
        raise SceneError([f"--show {word}: must be one of {', '.join(derivation.SECTIONS)}" for word in unknown])
    if options.target.startswith("paper:"):
        title, sections = catalogue.paper(options.target.removeprefix("paper:"))
    else:
        system, scene = targets.target(options.target, options.links, symbols, ways)
        title = system.title
        sections = list(derivation.derivation(system, show or derivation.SECTIONS, scene))
    with _output(options.output) as write:
        write(typeset.typeset(title, sections, options.format))


def enclose(options: argparse.Namespace) -> None:
    """Print every natural frequency in a proved enclosure, to as many digits as asked for."""
    from modal.certified import enclosures
    from modal.files import load

    with _output(options.output) as write:
        for row in enclosures(load(options.scene), options.digits):
            folds = f", {row.multiplicity}-fold" if row.multiplicity > 1 else ""
            write(f"{row.low} <= omega <= {row.high} rad/s  {row.label}{folds}\n")


# -------------------------------------------------------------------------------------------------- helpers


def _listed(text: str | None) -> tuple[str, ...]:
    return tuple(word.strip() for word in text.split(",")) if text else ()


def _digits(text: str) -> int:
    if not (text.isascii() and text.isdigit() and len(text) < 5 and 1 <= int(text) <= 1000):
        raise argparse.ArgumentTypeError(f"{text}: must be a whole number from 1 to 1000")
    return int(text)


def _modes(options: argparse.Namespace) -> tuple[Modes, Sequence[int]]:
    from modal.files import load
    from modal.modes import natural_modes

    found = natural_modes(load(options.scene))
    return found, _chosen(options.modes, len(found))


def _with_progress(rows: Iterator[Mode], total: int) -> Iterable[Mode]:
    """A progress bar for long tables, on a terminal only."""
    if total < LONG_TABLE or not sys.stderr.isatty():
        return rows
    from tqdm import tqdm

    return tqdm(rows, total=total, unit="mode", leave=False)


def _chosen(text: str | None, total: int) -> range:
    """Indices from 0 of `first:last`, counted from 1 and inclusive; either end, or all of it, may be left out."""
    from modal.errors import SceneError

    if text is None:
        return range(total)
    first, colon, last = text.partition(":")
    try:
        low = int(first) if first or not colon else 1
        high = (int(last) if last else total) if colon else low
    except ValueError:
        raise SceneError([f"--modes {text}: must be a number or a range such as 1:10"]) from None
    if colon and low > high and (last or low <= total):
        raise SceneError([f"--modes {text}: begins after its end"])
    if low < 1 or low > total:
        raise SceneError([f"--modes {text}: the scene has modes 1 to {total}"])
    return range(low - 1, min(high, total))


@contextmanager
def _output(path: str | None) -> Iterator[Callable[[str], object]]:
    if path is None:
        yield sys.stdout.write
        return
    from modal.files import whole_file

    with whole_file(path) as stream:
        yield lambda text: stream.write(text.encode())


def _amplitude(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not 0 < value <= 90:
        raise argparse.ArgumentTypeError(f"{text}: must be a number of degrees above 0 and at most 90")
    return value


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="multipendula",
        description="Linearized modal analysis of pendulum chains, alone or coupled by a cart.",
        epilog="example: multipendula table paper-cart-2",
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version and leave")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)

    def command(run: Callable[[argparse.Namespace], None], name: str, example: str) -> argparse.ArgumentParser:
        words = (run.__doc__ or "").strip()
        made = commands.add_parser(name, help=words, description=words, epilog=f"example: multipendula {example}")
        made.set_defaults(run=run)
        return made

    add = command(scenes, "scenes", "scenes crane-hook > my-crane.toml")
    add.add_argument("name", nargs="?", help="print this scene's file, to start one of your own")

    add = command(table, "table", "table rope --modes 1:5 --format markdown")
    add.add_argument("scene", metavar="SCENE", help=SCENE_HELP)
    add.add_argument("--format", choices=FORMATS, default="text")
    add.add_argument("--output", "-o", metavar="FILE", help="write here instead of standard output")
    add.add_argument("--modes", metavar="1:10", help="only these modes, counted from 1")
    add.add_argument("--shapes", action="store_true", help="add mode shapes and energy shares (json only)")

    add = command(shapes, "shapes", "shapes paper-cart-2 -o shapes.png")
    add.add_argument("scene", metavar="SCENE", help=SCENE_HELP)
    add.add_argument("--output", "-o", metavar="FILE", required=True, help="a .png, .svg or .pdf file")
    add.add_argument("--modes", metavar="1:10", help="only these modes, counted from 1")
    add.add_argument(
        "--amplitude", metavar="DEG", type=_amplitude, default=25.0, help="largest angle drawn (default 25)"
    )

    add = command(matrices, "matrices", "matrices chain-3")
    add.add_argument("scene", metavar="SCENE", help=SCENE_HELP)
    add.add_argument("--format", choices=("text", "json"), default="text")
    add.add_argument("--output", "-o", metavar="FILE", help="write here instead of standard output")

    add = command(derive, "derive", "derive chain:3 --symbolic masses,lengths --format latex")
    add.add_argument(
        "target",
        metavar="TARGET",
        help="chain:N, cart:N (a chain of N links on a cart), cart:PxN (P of them), "
        "paper:000, paper:001 or paper:002 (what it prints and what is right), or a scene",
    )
    add.add_argument("--symbolic", metavar="WORDS", help="in symbols, each link its own: masses,lengths,gravity,cart")
    add.add_argument("--show", metavar="WORDS", help="only these: lagrangian,equations,matrices,polynomial,modes")
    add.add_argument("--links", choices=("bob", "rod"), default="bob", help="what chain: and cart: are made of")
    add.add_argument("--equilibrium", metavar="down,up", help="where the links of chain: and cart: point at rest")
    add.add_argument("--format", choices=("text", "latex", "markdown"), default="text")
    add.add_argument("--output", "-o", metavar="FILE", help="write here instead of standard output")

    add = command(enclose, "enclose", "enclose paper-cart-2 --digits 50")
    add.add_argument("scene", metavar="SCENE", help=SCENE_HELP)
    add.add_argument("--digits", metavar="N", type=_digits, default=30, help="relative width 10^-N (default 30)")
    add.add_argument("--output", "-o", metavar="FILE", help="write here instead of standard output")

    command(schema, "schema", "schema > scene.schema.json")
    return parser


class _Version(argparse.Action):
    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        from importlib.metadata import version

        print(f"multipendula {version('multipendula')}")
        parser.exit()
