"""The results of a check and of a comparison as text, Markdown, CSV or JSON."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import ceil, degrees, floor, isfinite, isinf, log10
from typing import Any

from modal.modes.dissipation import stop_words
from modal.report import (
    NOTHING,
    Form,
    ReportColumn,
    ReportTable,
    as_csv,
    as_json,
    digits,
    finite,
    grid,
    listed,
    markdown,
    percent,
    records_of,
    titled,
)
from modal.scene import describe, left_out, title_of
from modal.scene.doors import checked
from nonlinear.postprocessing import PushingLink, words_of
from nonlinear.verification.modes import ANGLE_MAX_DEG, Check, Comparison, Measurement, ModeCheck, ModeInMotion

DIGITS_BEYOND = 1e-3
"""Format: of the error of κ, how far its digits go."""
HEADINGS = ("mode", "ω (rad/s)", "largest (°)", "energy", "lines")


@checked
def check_table(check: Check, form: Form = "text") -> str:
    """A check as text, markdown, csv (one line per run) or json, as `form` says."""
    if form == "json":
        modes_with_runs = []
        for row, record in zip(check.rows, records_of(MODE, check.rows), strict=True):
            pairs = zip(records_of(RUN, _runs([row])), row.measurements, strict=True)
            modes_with_runs.append(record | {"runs": [run | {"pushing": _pushing(m.pushing)} for run, m in pairs]})
        record_of_all = {
            "scene": describe(check.scene),
            "modes": modes_with_runs,
            "skipped": [{"mode": number, "reason": reason} for number, reason in check.skipped],
            "verdict_sentences": check_verdict(check),
        }
        return as_json(record_of_all)
    if form == "csv":
        return as_csv(records_of(RUN, _runs(check.rows)))
    modes, runs = ReportTable.of(MODE, check.rows), ReportTable.of(RUN, _runs(check.rows))
    notes = "\n\n".join(map(markdown, _notes(check))) if form == "markdown" else "\n".join(_notes(check))
    parts = [_paragraph(check_verdict(check), form), modes.written(form), runs.written(form), notes]
    return titled(title_of(check.scene), "the table of modes against the full motion", parts, form)


def _runs(rows: Iterable[ModeCheck]) -> list[tuple[ModeCheck, Measurement]]:
    return [(row, measurement) for row in rows for measurement in row.measurements]


def _paragraph(sentences: list[str], form: str) -> str:
    """A sentence a line, or one paragraph of Markdown."""
    return " ".join(map(markdown, sentences)) if form == "markdown" else "\n".join(sentences)


def check_verdict(check: Check) -> list[str]:
    """How accurate the table is: at the smallest angle, at the largest with and without κa², and its 1 % angles."""
    runs = _runs(check.rows)
    regular = [(row, measurement) for row, measurement in runs if not measurement.irregular]
    sentences = []
    several = len(check.rows) > 1
    most = "at most " if several else ""
    what = f"the frequencies of {len(check.rows)} modes differ" if several else "the frequency differs"
    if regular:
        small, large = (choose(measurement.amplitude for _, measurement in regular) for choose in (min, max))
        off = max(abs(measurement.shift) for _, measurement in regular if measurement.amplitude == small)
        sentences.append(f"At {degrees(small):.3g}° {what} from the table by {most}{percent(off)}.")
        if large > small:
            largest_runs = [(row, measurement) for row, measurement in regular if measurement.amplitude == large]
            plain = max(abs(measurement.shift) for _, measurement in largest_runs)
            residual = max(
                abs(measurement.shift - row.predicted_shift(measurement)) for row, measurement in largest_runs
            )
            they = "they differ" if several else "it differs"
            accuracy_words = f", and from ω (1 + κa²) by {most}{percent(residual)}" if isfinite(residual) else ""
            sentences.append(f"At {degrees(large):.3g}° {they} from it by {most}{percent(plain)}{accuracy_words}.")
    angles = [(row.mode.linear_to_1_percent_deg, row.one_percent_deg) for row in check.rows]
    known = [pair for pair in angles if all(map(isfinite, pair))]
    if misses := [abs(table_angle / run_angle - 1) for table_angle, run_angle in known]:
        which = "angles at which a frequency is 1 % off differ" if several else "angle at which it is 1 % off differs"
        sentences.append(f"The {which} from the table by {most}{percent(max(misses))}.")
    if odd := sorted({row.mode.number for row, measurement in runs if measurement.irregular}):
        modes = f"{'Mode' if len(odd) == 1 else 'Modes'} {listed(list(map(str, odd)), len(odd))}"
        sentences.append(f"{modes}: irregular at large angles, where no single frequency describes the motion.")
    return sentences or ["No mode was checked."]


def comparison_verdict(comparison: Comparison) -> list[str]:
    """Return which modes contain the energy, and how far their lines are from the table."""
    rows = sorted((row for row in comparison.rows if isfinite(row.share)), key=lambda row: -row.share)
    if not rows:
        return ["Nothing moves."]
    first, *others = rows[:4]
    shares = "".join(f", mode {row.mode.number} {percent(row.share)}" for row in others)
    rest = "" if len(rows) <= 4 else f", {len(rows) - 4} others the rest"
    sentences = [f"Mode {first.mode.number} contains {percent(first.share)} of the energy{shares}{rest}."]
    lines = [(row, row.lines[0]) for row in rows[:4] if row.lines]
    off = [abs(line.omega / row.mode.omega - 1) for row, line in lines if row.mode.omega]
    if off:
        most = percent(max(off))
        sentences.append(f"The strongest line of each differs from the frequency in the table by at most {most}.")
    return sentences


def _angle(degree: float) -> str:
    return f">{ANGLE_MAX_DEG:g}" if isinf(degree) or degree > ANGLE_MAX_DEG else digits(degree, 0.0, 3)


def _at_most(share: float) -> str:
    """A bound to one digit, rounded up."""
    if not isfinite(share) or not share:
        return NOTHING if share else "0"
    unit = 10.0 ** floor(log10(share))
    return f"{ceil(share / unit * (1 - 1e-12)) * unit:.0e}"


def _omega_cell(pair: tuple[ModeCheck, Measurement]) -> str:
    measurement = pair[1]
    return "irregular" if measurement.irregular else digits(measurement.omega, measurement.error, 9)


def _shift_cell(pair: tuple[ModeCheck, Measurement]) -> str:
    measurement = pair[1]
    if measurement.irregular:
        return NOTHING
    return digits(measurement.shift, measurement.error / max(abs(measurement.shift), measurement.error), 4)


RUN = (
    ReportColumn(lambda pair: pair[0].mode.number, "mode", "mode"),
    ReportColumn(lambda pair: pair[0].mode.omega, "omega_linear_rad_per_s"),
    ReportColumn(lambda pair: pair[0].mode.kappa, "kappa_per_rad2"),
    ReportColumn(lambda pair: degrees(pair[1].amplitude), "amplitude_deg", "angle (°)", ".4g"),
    ReportColumn(lambda pair: degrees(pair[1].effective), "effective_amplitude_deg"),
    ReportColumn(lambda pair: pair[1].irregular, "irregular"),
    ReportColumn(_omega_cell, None, "ω(a) (rad/s)"),
    ReportColumn(lambda pair: None if pair[1].irregular else pair[1].omega, "omega_rad_per_s"),
    ReportColumn(lambda pair: pair[1].error, "relative_error"),
    ReportColumn(lambda pair: NOTHING if pair[1].irregular else f"{pair[1].error:.0e}", None, "rel. error ≤"),
    ReportColumn(_shift_cell, None, "ω(a)/ω − 1"),
    ReportColumn(lambda pair: None if pair[1].irregular else pair[1].shift, "shift"),
    ReportColumn(lambda pair: pair[0].exact(pair[1]), "orbit_shift", "orbit", lambda shift: digits(shift, 0.0, 5)),
    ReportColumn(
        lambda pair: pair[0].predicted_shift(pair[1]), "predicted_shift", "κa²", lambda shift: digits(shift, 0.0, 4)
    ),
    ReportColumn(lambda pair: pair[1].outside, "energy_share_outside", "outside", "{:.1e}".format),
)
"""The quantities of a run with its mode, units in the keys."""


def _notes(check: Check) -> list[str]:
    notes = [f"mode {number} was skipped: {reason}." for number, reason in check.skipped]
    if any(row.mode.resonances for row in check.rows):
        notes.append("* near a 1:1, 1:2 or 1:3 resonance, with another mode or among its own.")
    if check.scene.has_damping:
        notes.append(
            "dampers: κa² and ω(a) refer to the mean amplitude of a run, which is less than the initial angle."
        )
    notes += left_out(check.scene, "a check of modes")
    if check.scene.features & {"joint_friction", "rail_friction", "rail_coefficient", "quadratic_drag"}:
        largest = max(
            (degrees(measurement.amplitude) for row in check.rows for measurement in row.measurements), default=0.0
        )
        prefixes = tuple(f"mode {row.mode.number}:" for row in check.rows)
        notes += [words for words in stop_words(check.scene, largest) if words.startswith(prefixes)] if largest else []
    if any(row.backbone for row in check.rows):
        notes.append("orbit: ω(a)/ω − 1 of the mode's exact periodic orbit with the same largest angle.")
    notes.append("outside: the largest share of the energy in other modes.")
    for row in check.rows:
        for measurement in row.measurements:
            where = f"mode {row.mode.number} at {degrees(measurement.amplitude):.4g}°"
            notes += [f"{where}: {words}" for words in words_of(measurement.pushing, check.scene)]
    return notes


def _pushing(links: Sequence[PushingLink]) -> list[dict[str, Any]]:
    """The links of bobs that push, where a rope would be slack."""
    return [link.record() for link in links]


def _certain(row: ModeCheck) -> float:
    kappa, error = row.kappa
    return error / abs(kappa) if kappa else 1.0


MODE = (
    ReportColumn("mode.number", "mode"),
    ReportColumn(lambda row: f"{row.mode.number}{'*' if row.mode.resonances else ''}", None, "mode"),
    ReportColumn("mode.family", "family"),
    ReportColumn(lambda row: digits(row.mode.omega, row.mode.relative_error_bound, 9), None, "ω (rad/s)"),
    ReportColumn("mode.omega", "omega_rad_per_s"),
    ReportColumn("mode.kappa", "kappa_per_rad2", "κ (1/rad²)", lambda kappa: digits(kappa, 0.0, 5)),
    ReportColumn(lambda row: digits(row.kappa[0], DIGITS_BEYOND * min(_certain(row), 1.0), 5), None, "measured"),
    ReportColumn(lambda row: row.kappa[0], "kappa_measured_per_rad2"),
    ReportColumn(lambda row: row.kappa[1], "kappa_measured_error_per_rad2"),
    ReportColumn(_certain, None, "rel. error ≤", _at_most),
    ReportColumn("mode.linear_to_1_percent_deg", "linear_to_1_percent_deg", "1 % at (°)", _angle),
    ReportColumn("one_percent_deg", "measured_to_1_percent_deg", "measured (°)", _angle),
    ReportColumn("mode.family", None, "description"),
    ReportColumn(lambda row: list(row.mode.resonances), "resonances"),
)
"""The quantities of a mode."""


@checked
def comparison_table(comparison: Comparison, form: Form = "text") -> str:
    """A comparison as text, markdown, csv (one line for each line of the motion) or json, as `form` says."""
    if form == "json":
        record_of_all = {
            "scene": describe(comparison.modes.scene),
            "coordinates": [_record(comparison, row) for row in comparison.rows],
            "verdict_sentences": comparison_verdict(comparison),
            "pushing": _pushing(comparison.pushing),
        }
        return as_json(record_of_all)
    if form == "csv":
        heads = [({"mode": row.mode.number, "copy": row.copy + 1}, row) for row in comparison.rows]
        return as_csv([head | line for head, row in heads for line in _lines(comparison, row)])
    note = "lines: frequency (rad/s), amplitude, and difference from the nearest frequency of the table."
    words = words_of(comparison.pushing, comparison.modes.scene)
    verdict_text = _paragraph(comparison_verdict(comparison), form)
    parts = [verdict_text, grid([_cells(comparison, row) for row in comparison.rows], HEADINGS, form), note, *words]
    return titled(title_of(comparison.modes.scene), "the motion in modal coordinates", parts, form)


def _cells(comparison: Comparison, row: ModeInMotion) -> list[str]:
    mode = row.mode
    label = f"{mode.number}.{row.copy + 1}" if mode.multiplicity > 1 else str(mode.number)
    largest = f"{degrees(row.largest):.3g}" if mode.omega else f"{row.largest:.3g} m"
    omega = digits(mode.omega, mode.relative_error_bound, 9)
    return [label, omega, largest, f"{row.share:.1%}", row.note or "; ".join(_words(comparison, row))]


def _words(comparison: Comparison, row: ModeInMotion) -> list[str]:
    words = []
    for line in row.lines:
        number, off = comparison.nearest(line)
        where = f"mode {number} {off:+.2%}" if abs(off) < 0.2 else "between modes"
        words.append(f"{digits(line.omega, line.relative_error, 6)} ({degrees(line.amplitude):.2g}°, {where})")
    return words


def _lines(comparison: Comparison, row: ModeInMotion) -> list[dict[str, Any]]:
    return [
        {
            "omega_rad_per_s": line.omega,
            "relative_error": finite(line.relative_error),
            "amplitude_deg": degrees(line.amplitude),
            "phase_rad": line.phase,
            "nearest_mode": comparison.nearest(line)[0],
            "relative_difference": comparison.nearest(line)[1],
        }
        for line in row.lines
    ]


def _record(comparison: Comparison, row: ModeInMotion) -> dict[str, Any]:
    return {
        "mode": row.mode.number,
        "copy": row.copy + 1,
        "omega_rad_per_s": row.mode.omega,
        "largest_rad": row.largest,
        "energy_share": finite(row.share),
        "lines": _lines(comparison, row),
        "note": row.note,
    }
