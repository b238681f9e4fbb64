"""The commands about the modes of a scene: table, shapes, matrices."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

import modal
from multipendula.command import SCENE, THEME, Command, main_file, option, text_file
from multipendula.commands.shared import about, bar, chosen, drawn, large, made, noted, output, picture
from multipendula.completion import words
from multipendula.options import FILMS, PICTURES, REPORTS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from modal.assembly import Matrices
    from modal.modes import Mode, Modes

ELSEWHERE = "--columns all shows every column, --format csv every digit"
COLUMN_NAMES = (
    *("mode", "omega_rad_per_s", "frequency_hz", "period_s", "damping_ratio", "quality_factor"),
    *("growth_rate_per_s", "multiplicity"),
    *("family", "cart_participation", "effective_mass_kg", "effective_mass_share", "fixed_base_effective_mass_kg"),
    *("effective_mass_across_kg", "linear_to_1_percent_deg", "relative_error_bound", "participation_factor_per_m"),
    *("cumulative_effective_mass_share", "cumulative_fixed_base_mass_share"),
)
"""The columns of `modal.modes.tables` that are printed; the help page must not load that module."""
LONG_CHAIN = 2000
"""Cost: links of a scene of which only the modes that are shown are looked for: `benchmarks/few_modes.py`."""


def table(options: argparse.Namespace) -> Modes | None:
    """Print the table of modes.

    One row per mode: frequency and period, multiplicity, description, participation of the cart, modal effective
    mass (on a free cart with the cart held), the angle up to which the linear frequency is accurate to 1 %, and a
    bound on the relative error. Dampers and drag add damping ratios, an inverted equilibrium growth rates; dry
    friction is neglected, except in the damping ratio that --amplitude adds. Columns that do not apply to the scene
    are omitted. A narrow terminal omits, in this order, the bound, shares and masses, participation, multiplicity,
    period, 1 % angle and frequency in Hz, and names them; a pipe or a file gets all.

    Examples
    --------
    table paper-cart-2
        every mode of two double pendula on a cart
    table rope --modes 1:5
        the first five modes of a rope of 1000 links
    table crane-hook --columns +cumulative --sensitivities
        what a change of each number does
    table tower --energies
        which link moves, which spring holds, which damper damps
    table paper-cart-2 --format json --shapes
        in full precision, with shapes and energy shares
    """
    from modal.report import limit

    if options.places:
        _list_places(options)
        return None
    if options.shapes and options.format != "json":
        raise modal.SceneError(["--shapes: needs --format json"])
    modes, every = _modes(options, options.relative_error)
    rest = limit() if options.format == "text" and options.output is None else None
    numbers = every[: rest.rows] if rest else every
    rows = list(_with_progress(modes.rows(numbers), len(numbers)))
    starred = f"{modal.modes.tables.GUIDE} (`--orbits` computes it)"
    stds = proofs = None
    if options.orbits or options.covariance or options.prove:
        from multipendula.commands.evidence import evidence

        rows, starred, stds, proofs = evidence(options, modes, rows, starred)
    with output(options.output) as write:
        more = {"shapes": options.shapes, "starred": starred, "amplitude_deg": options.amplitude, "stds": stds}
        more |= {"proofs": proofs, "sensitive": options.sensitivities, "energies": options.energies}
        more |= {"chosen": options.columns or "", "elsewhere": ELSEWHERE, "left": len(every) - len(numbers)}
        write(modal.modes.tables.table(modes, rows, options.format, **more))
    if options.explain:
        from modal.modes.solution_report import report_solution

        sys.stderr.write(report_solution(modes).text())
    asked = options.orbits or stds or proofs or options.amplitude or len(numbers) < len(modes)
    return None if asked else modes


def _list_places(options: argparse.Namespace) -> None:
    """The numbers of the scene by their places."""
    from modal.report import folded
    from modal.scene.number_names import numbers_table

    if options.format not in REPORTS:
        raise modal.SceneError([f"--format {options.format}: --places takes {', '.join(REPORTS)}"])
    with output(options.output) as write:
        text = numbers_table(modal.load(options.scene), options.format)
        write(folded(text) if options.format == "text" else text)


def shapes(options: argparse.Namespace) -> Figure | None:
    """Draw the mode shapes, or film the modes.

    One panel per mode, drawn with the largest angle that you choose. For a repeated frequency one shape of each
    kind is shown. For more than 12 pendula, angles are drawn against the number of the pendulum. In a film (GIF,
    MP4 with the extra `video`, HTML) every mode swings once a loop, whatever its period, and the loop has no seam.

    Examples
    --------
    shapes paper-cart-2 -o shapes.png
        every mode
    shapes rope --modes 1:4 -o rope.svg
        the first four, as vector graphics
    shapes paper-cart-2 -o modes.gif
        modes that move
    shapes crane-hook --amplitude 10 -o hook.pdf
        with a largest angle of 10 degrees
    """
    form = picture(options.output, kinds=PICTURES + FILMS)
    modes, numbers = _modes(options)
    about(noted(modes.scene, "mode shapes"))
    from modal.plotting import LOOP, USUAL_PANELS, film_modes, save, shapes_figure

    asked = None if options.modes is None else numbers
    if not form:
        return modes.plot(asked, theme=options.theme, amplitude_deg=options.amplitude)
    with drawn(options.output, options.theme) as stream:
        if form in FILMS:
            with bar(LOOP) as report:
                film_modes(modes, stream, form, asked, amplitude_deg=options.amplitude, report=report)
        else:
            save(shapes_figure(modes, asked, amplitude_deg=options.amplitude), stream, form)
    shown = numbers[:USUAL_PANELS] if asked is None else numbers
    last = f" to {shown[-1] + 1}" if len(shown) > 1 else ""
    more = f" of {len(modes)}; --modes chooses others" if len(shown) < len(numbers) else ""
    made(options.output, f"mode{'s' * bool(last)} {shown[0] + 1}{last}{more}")
    return None


def matrices(options: argparse.Namespace) -> Matrices:
    """Print M, K and D.

    Mass, damping and stiffness matrices about the scene's equilibrium, M q'' + D q' + K q = 0, with the names of
    the coordinates: x of the cart, then the absolute angle of every link of every copy.

    Examples
    --------
    matrices chain-3
        a chain of three bobs
    matrices paper-cart-2 --format json -o paper.json
        in full precision, with coordinate names
    """
    from modal.assembly.linearization import matrices_table

    scene = about(noted(modal.load(options.scene), "mode shapes"))
    dense = modal.matrices(scene)
    with output(options.output) as write:
        write(matrices_table(scene, dense, options.format))
    return dense


def _modes(options: argparse.Namespace, accuracy: float | None = None) -> tuple[Modes, Sequence[int]]:
    """The modes, of a long chain no more than are needed, and the places of those to be shown."""
    scene = large(modal.load(options.scene))
    last = chosen(options.modes, sys.maxsize).stop
    lowest = slice(0, last) if scene.n_links > LONG_CHAIN and last < sys.maxsize else None
    modes = modal.natural_modes(scene, accuracy=accuracy, modes=lowest)
    return modes, chosen(options.modes, len(modes))


def _with_progress(rows: Iterator[Mode], total: int) -> Iterable[Mode]:
    """A progress bar for long tables, on a terminal only."""
    if total < LONG_CHAIN or not sys.stderr.isatty():
        return rows
    from tqdm import tqdm

    return tqdm(rows, total=total, unit="mode", leave=False)


COMMANDS = (
    Command(
        topic="modes",
        run=table,
        main=("--modes", "--columns", "--format", "--amplitude", "--output"),
        takes=(
            SCENE,
            "--covariance: adds standard deviations",
            *text_file("text", "markdown", "latex", "csv", "html", "json"),
            "--modes, counted from 1 (default all)",
            "--relative-error, met at less cost for long chains (default: every digit)",
            option("--amplitude: adds the damping ratio there, with dry friction and quadratic drag", group="computed"),
            "--orbits: the 1 %% angle is that in the full equations",
            option(
                "--columns: all, or some by their names in --format csv, or how these begin; after a + in addition "
                "to the usual ones, as in +participation,cumulative",
                completion=words(("all", *COLUMN_NAMES)),
            ),
            "--sensitivities",
            "--energies",
            "--shapes (json only)",
            "--places",
            "--prove, which `check_proof.py` re-checks",
            "--explain",
        ),
    ),
    Command(
        topic="modes",
        run=shapes,
        main=("--output", "--modes", "--amplitude", "--theme"),
        takes=(
            SCENE,
            main_file("the figure, or a film", PICTURES + FILMS, "-shapes.png"),
            THEME,
            "--modes, counted from 1 (default the first 12)",
            option("--amplitude in its drawing (default 25)", default=25.0),
        ),
    ),
    Command(topic="modes", run=matrices, main=("--format", "--output"), takes=(SCENE, *text_file("text", "json"))),
)
