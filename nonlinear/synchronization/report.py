"""The synchronization of a scene as text and as numbers: prediction, simulation, and limits of the theory.

Also branches of configurations: where each is stable, the critical values, and all of them as CSV.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import degrees, isfinite
from textwrap import TextWrapper, fill
from typing import Any

import numpy as np

from modal.errors import ComputationError
from modal.loci import followed_columns
from modal.modes import table_numbers
from modal.report import (
    NOTHING,
    as_csv,
    capital,
    counted,
    finite,
    grid,
    headed,
    line_width,
    listed,
    percent,
    rad,
    short,
    with_unit,
)
from modal.scene import describe, title_of
from modal.scene.doors import require_type
from modal.types import Floats
from nonlinear.averaging import ASIDE, RelativeEquilibrium
from nonlinear.orbits import Orbit, Special, growth
from nonlinear.postprocessing import last
from nonlinear.synchronization.continuation import Branch, Branches, Change
from nonlinear.synchronization.modal_energy import Survival
from nonlinear.synchronization.patterns import agreement, own_amplitudes
from nonlinear.synchronization.phases import ENDING
from nonlinear.synchronization.population_report import population_record, population_sections
from nonlinear.synchronization.study import SynchronizationStudy, Theory
from nonlinear.system import System

HEAD = ("mode", "description", "pendula", "largest angle (deg)", "frequency (rad/s)", "stability")
NOT_COVERED = (
    "The averaged equations are of first order in dampers, drives, coupling within a band and squares of angles, with "
    "the third harmonic of every swing. They leave out: what else happens within a swing, joints that stick, play, "
    "motion across the rail, inverted links, noise. Motions in which modes of one band beat for ever, with two or more "
    "frequencies, may exist beside the steady ones; they are not searched for."
)
EXACT = (
    "Stability and e-folding time are those of the periodic orbit beside each: of its Floquet multipliers in the full "
    "equations."
)
COPIED = "Copies are the same motion with the parts of equal pendula exchanged."
LEFT = "(averaged): no such orbit was found."
LOCATED = (
    "exact: where periodic orbits of the full equations turn or change their stability, by their Floquet multipliers."
)
NUMBERED = "Modes have their numbers in the table; frequencies here are those without dampers."
MOST_FREQUENCIES = 6
MOST_LINES, MOST_UNSTABLE = 16, 8  # configurations in the table, and unstable ones where there are more


def sync_text(found: SynchronizationStudy) -> str:
    """The report for a terminal."""
    require_type("found", found, "SynchronizationStudy")
    parts = [headed(title_of(found.scene)), *_sections(found)]
    return "\n\n".join(part for part in parts if part) + "\n"


def _sections(found: SynchronizationStudy) -> Iterator[str]:
    if found.populations is not None:
        yield from population_sections(found.populations, found.motions, found.motionless)
    if found.theory is None:
        yield f"No prediction: {found.silent}."
    else:
        yield "Steady motions by the averaged equations\n" + _table(found.theory)
        yield _paragraph("Predicted from this start", _prediction(found.theory))
    beside = ", and from a start nearby" if found.theory is not None and found.theory.prediction.unstable else ""
    yield _paragraph(f"Simulated for {short(float(found.trajectory.times[-1]))} s{beside}", _simulation(found))
    if found.scene.has_damping:
        yield NUMBERED
    if found.theory is not None:
        yield fill(NOT_COVERED, line_width())


def _paragraph(title: str, sentences: Iterator[str]) -> str:
    wrapper = TextWrapper(line_width(), "  ", "    ", break_long_words=False, break_on_hyphens=False)
    return "\n".join([title, *map(wrapper.fill, sentences)])


def _table(theory: Theory) -> str:
    if not theory.configurations:
        return "none was found"
    each = _each(theory)
    shown = _shown(theory)
    rows = grid([_cells(*each[k]) for k in shown], HEAD, "text")
    notes = [f"Averaged alone: {theory.uncertified}."] * bool(theory.uncertified)
    notes += [EXACT] * any(theory.orbits) + [LEFT] * (None in theory.orbits and any(theory.orbits))
    if any(one.copies > 1 for one, _ in each):
        notes.insert(0, COPIED)
    if more := len(each) - len(shown):
        notes.insert(0, f"{more} more, all unstable, are in the JSON form.")
    return "\n\n".join([rows, *(fill(note, line_width()) for note in notes)])


def _each(theory: Theory) -> list[tuple[RelativeEquilibrium, Orbit | None]]:
    return list(zip(theory.configurations, theory.orbits, strict=True))


def _shown(theory: Theory) -> list[int]:
    """The places of the configurations with a line: of many all that may last and the first of the others."""
    lasting = [orbit.is_stable if orbit else one.is_stable for one, orbit in _each(theory)]
    unstable = [k for k, lasts in enumerate(lasting) if lasts is False]
    dropped = set(unstable[MOST_UNSTABLE:]) if len(lasting) > MOST_LINES else set()
    return [k for k in range(len(lasting)) if k not in dropped]


def _cells(one: RelativeEquilibrium, orbit: Orbit | None) -> list[str]:
    modes = one.averaged.modes
    mode = modes[one.row]
    angle = degrees(float(np.abs(own_amplitudes(one)).max()))
    return [
        str(one.number),
        mode.family,
        agreement(one) + (f" ({one.copies} copies)" if one.copies > 1 else ""),
        f"{angle:.4g}",
        f"{one.omega:.6g}",
        _fate(one, orbit),
    ]


def _fate(one: RelativeEquilibrium, orbit: Orbit | None) -> str:
    if one.is_stable is None:
        return "neutral"
    if orbit:
        rate = growth(orbit)
        return f"{'stable' if orbit.is_stable else 'unstable'}, e-folding time {abs(1 / rate):.4g} s"
    return f"{'stable' if one.is_stable else 'unstable'}, e-folding time {one.relaxation:.4g} s (averaged)"


def _prediction(theory: Theory) -> Iterator[str]:
    prediction = theory.prediction
    if prediction.unstable:
        yield from _unstable(prediction.unstable)
    if prediction.motion.dies:
        yield "The swing dies out: no drive keeps it up."
        return
    mode = prediction.averaged.modes[prediction.row]
    share = percent(prediction.share)
    yield f"Mode {prediction.number} survives ({mode.family}; {rad(mode.omega)}), with {share} of the energy."
    if theory.ending:
        size = float(np.abs(theory.ending.floquet.others).max())
        yield f"The orbit in which it ends is stable in the full equations: no multiplier exceeds {size:.6g}."
    if theory.uncertified:
        yield f"Its stability is that of the averaged equations alone ({theory.uncertified})."
    if theory.doubts:
        yield f"This is not certain: {'; '.join(theory.doubts)}."
    elif not theory.ending:
        yield "This is certain as far as the averaged equations reach."
    locking = prediction.locking_time()
    if locking is None or not np.ptp(prediction.averaged.row):
        return
    yield f"All other modes hold less than 1 % of the energy after {short(locking)} s."
    if doubts := prediction.timing_doubts[len(prediction.doubts) :]:
        yield f"That time is a guide: {'; '.join(doubts)}."


def _unstable(kept: RelativeEquilibrium) -> Iterator[str]:
    """Sentences about the configuration that only an exact start maintains."""
    yield (
        f"From exactly this start mode {kept.number} survives ({agreement(kept)}), but that motion is unstable, "
        f"e-folding time {kept.relaxation:.4g} s. Real pendula leave it, so what follows is for a start "
        f"{100 * ASIDE:.0f} % away."
    )


def _simulation(found: SynchronizationStudy) -> Iterator[str]:
    yield from _survivor(found.survival) if found.survival else [f"No energies by modes: {found.unmeasured}."]
    if found.agrees is not None:
        share = ": the mode is, its share of the energy is not" if found.leads else ""
        yield "As predicted." if found.agrees else f"This is not what was predicted{share}."
    elif found.survival and found.too_short:
        yield "The run ends before the predicted time: it cannot tell whether the prediction is right."
    yield from _phases(found)
    yield from _energies(found)


def _survivor(survival: Survival) -> Iterator[str]:
    try:
        mode = survival.mode
    except ComputationError as error:
        yield f"{capital(str(error))}."
        return
    yield f"Mode {survival.number} holds {percent(survival.survivor_share)} of the energy at the end ({mode.family})."
    time = survival.locking_time()
    if len(survival.row) == 1:
        return
    if survival.beating:
        yield _beating(survival)
    if time is None:
        yield "The others do not stay below 1 %."
    else:
        yield f"All others hold less than 1 % after {short(time)} s."


def _beating(survival: Survival) -> str:
    """A sentence on the modes that share the energy, with frequencies of their own."""
    places = list(survival.beating)
    rows = table_numbers(survival.scene, survival.modes)[survival.row[places] - 1]
    shares, rates = (
        " and ".join(text.format(value) for value in values[places])
        for text, values in (("{:.3g} %", 100 * survival.late_share), ("{:.6g}", survival.omega))
    )
    return (
        f"Modes {' and '.join(map(str, rows))} keep {shares} in the last quarter, at {rates} rad/s: they beat, "
        f"a motion of {len(places)} frequencies."
    )


def _phases(found: SynchronizationStudy) -> Iterator[str]:
    phases, late = found.phases, last(found.trajectory.times, ENDING)
    order = float(phases.order[late, phases.leading].mean())
    which = f"in fixed-base mode {phases.leading + 1}, mean of the last tenth"
    if phases.z.shape[1] > 1:
        yield f"Order parameter R = {order:.4f} [|Σ exp(i phase)|/N {which}]."
    try:
        frequencies = phases.frequency
    except ComputationError as error:
        yield f"{capital(str(error))}."
        return
    if not np.all(np.isfinite(frequencies)):
        yield "A pendulum at rest has no frequency."
        return
    shown = [f"{omega:.6g}" for omega in frequencies[:MOST_FREQUENCIES]]
    words = listed(shown, len(frequencies))
    if len(frequencies) == 1:
        yield f"Mean frequency {words} rad/s."
    elif phases.resolution > frequencies.max():
        yield f"Mean frequencies {words} rad/s: the run is too short to tell whether they lock."
    else:
        fate = "locked" if phases.locked else "not locked"
        yield f"Mean frequencies {words} rad/s: {fate} within {phases.resolution:.2g} rad/s."


def _energies(found: SynchronizationStudy) -> Iterator[str]:
    trajectory = found.trajectory
    late = last(trajectory.times, ENDING)
    pendula, cart = found.phases.energy[late].sum(axis=1).mean(), trajectory.mechanics.cart_kinetic[late].mean()
    carrying = "cart" if trajectory.system.cart else "supports"
    has = trajectory.system.cart or trajectory.system.structure
    yield f"Energy at the end: pendula {pendula:.4g} J" + (f", {carrying} {cart:.3g} J." if has else ".")
    kicks, work = trajectory.kicks, float(trajectory.motion.work[-1])
    if len(kicks.time):
        fed = float(kicks.energy.sum())
        rest = _others(trajectory.system, work - fed)
        yield f"{counted(len(kicks.time), 'kick', 'kicks')} fed {fed:.6g} J{rest}."
    elif trajectory.system.works:
        yield f"Drives and dampers together did {work:.6g} J of work."
    if isfinite(drift := trajectory.energy_drift()):
        yield f"Energy balance closes to {drift:.1g} of its range."


def _others(system: System, work: float) -> str:
    """A clause on other drives and dampers, with their work (J)."""
    if any(group.excitation and group.excitation.steady for group in system.groups):
        return f", van der Pol drives and dampers together did {work:.6g} J of work"
    what = "dampers, friction and drag" if system.rubs or system.dragged else "dampers"
    return f", {what} took {-work:.6g} J" if system.dissipates else ""


def sync_record(found: SynchronizationStudy) -> dict[str, Any]:
    """The JSON record: modes are numbered as in the table; null where there is no value."""
    require_type("found", found, "SynchronizationStudy")
    theory = found.theory
    return {
        "scene": describe(found.scene),
        "configurations": [*map(_configuration_record, theory.configurations, theory.orbits)] if theory else None,
        "prediction": _prediction_record(theory) if theory else None,
        "no_prediction": found.silent or None,
        "simulation": _simulation_record(found),
        "agrees": found.agrees,
        **_populations_record(found),
    }


def _populations_record(found: SynchronizationStudy) -> dict[str, Any]:
    if found.populations is None:
        return {}
    return population_record(found.populations, found.motions, found.motionless)


def _configuration_record(one: RelativeEquilibrium, orbit: Orbit | None = None) -> dict[str, Any]:
    """One configuration; `lasts` and `growth_rate_per_s` are those of its orbit where one was found."""
    eta = own_amplitudes(one)
    return {
        "mode": one.number,
        "family": one.averaged.modes[one.row].family,
        "pendula": agreement(one),
        "copies": one.copies,
        "amplitudes_deg": np.rad2deg(np.abs(eta)).tolist(),
        "phases_deg": (np.rad2deg(np.angle(eta / eta[np.abs(eta).argmax()])) % 360).tolist(),
        "omega_rad_per_s": one.omega,
        "lasts": orbit.is_stable if orbit and one.is_stable is not None else one.is_stable,
        "growth_rate_per_s": finite(growth(orbit) if orbit else one.growth),
        "averaged_growth_rate_per_s": finite(one.growth),
        "orbit": _orbit_record(orbit),
    }


def _orbit_record(orbit: Orbit | None) -> dict[str, Any] | None:
    if orbit is None:
        return None
    return {
        "omega_rad_per_s": orbit.omega,
        "amplitude_deg": degrees(orbit.amplitude),
        "stable": orbit.is_stable,
        "floquet": [[float(one.real), float(one.imag)] for one in orbit.floquet.all],
        "residual": orbit.residual,
    }


def _prediction_record(theory: Theory) -> dict[str, Any]:
    prediction = theory.prediction
    return {
        "unstable": _configuration_record(prediction.unstable) if prediction.unstable else None,
        "dies_out": prediction.motion.dies,
        "survivor": None if prediction.motion.dies else prediction.number,
        "survivor_share": None if prediction.motion.dies else prediction.share,
        "certain": not theory.doubts,
        "doubts": list(theory.doubts),
        "ends_on": _orbit_record(theory.ending),
        "locking_time_s": prediction.locking_time(),
        "locking_time_doubts": list(prediction.timing_doubts),
        "largest_angle_deg": degrees(prediction.averaged.largest(prediction.motion.z[:, -1])),
    }


def _simulation_record(found: SynchronizationStudy) -> dict[str, Any]:
    trajectory, phases = found.trajectory, found.phases
    late = last(trajectory.times, ENDING)
    return {
        "duration_s": float(trajectory.times[-1]),
        **(_survival_record(found.survival) if found.survival else {"no_modes": found.unmeasured}),
        "own_mode": phases.leading + 1,
        "order_parameter": float(phases.order[late, phases.leading].mean()),
        **_frequencies(found),
        "energy_of_pendula_J": phases.energy[late].mean(axis=0).tolist(),
        "kicks": len(trajectory.kicks.time),
        "energy_of_kicks_J": float(trajectory.kicks.energy.sum()),
        "work_J": float(trajectory.motion.work[-1]),
        "energy_drift": trajectory.energy_drift(),
    }


def _survival_record(survival: Survival) -> dict[str, Any]:
    try:
        return {
            "survivor": survival.number,
            "survivor_share": survival.survivor_share,
            "beating": _beating_record(survival),
            "locking_time_s": survival.locking_time(),
        }
    except ComputationError as error:
        return {"survivor": None, "no_survivor": str(error)}


def _beating_record(survival: Survival) -> list[dict[str, float]]:
    """The modes that share the energy with frequencies of their own, strongest first; [] where only one is left."""
    numbers = table_numbers(survival.scene, survival.modes)
    return [
        {
            "mode": int(numbers[survival.row[place] - 1]),
            "share": float(survival.late_share[place]),
            "omega_rad_per_s": float(survival.omega[place]),
        }
        for place in survival.beating
    ]


def _frequencies(found: SynchronizationStudy) -> dict[str, Any]:
    try:
        frequencies = found.phases.frequency.tolist()
    except ComputationError as error:
        return {"frequencies_rad_per_s": None, "no_frequencies": str(error)}
    return {"frequencies_rad_per_s": [finite(one) for one in frequencies], "locked": found.phases.locked}


def branches_text(found: Branches) -> str:
    """One line per branch, counted from 1, then one per critical value."""
    variation = found.variation
    values, unit = variation.values, variation.unit
    where = f"{variation.path} = {values[0]:.6g} to {values[-1]:.6g} {unit}".rstrip()
    head = f"{len(found.branches)} configurations over {where}"
    rows = [_branch_cells(number, one) for number, one in enumerate(found.branches, start=1)]
    headers = ("", "pendula", "ω (rad/s)", "largest angle (°)", with_unit("exists", unit), with_unit("stable", unit))
    parts = [head, grid(rows, headers) or "no steady motion"]
    if found.changes:
        each = zip(found.changes, found.located, strict=True)
        turns = [
            (f"{change.value:.7g}", _located(special), str(number + 1), change_words(change))
            for (change, number), special in each
        ]
        parts += ["", grid(turns, (with_unit("averaged", unit), with_unit("exact", unit), "", "event"))]
        if any(found.located):
            parts += ["", fill(LOCATED, line_width())]
    return "\n".join(parts) + "\n"


def _located(special: Special | None) -> str:
    value = special.orbit.value if special else None
    return NOTHING if value is None else f"{value:.7g}"


def branches_csv(found: Branches) -> str:
    """One row per branch and value: frequency, stability, largest angle, growth rate, and the pattern."""
    return as_csv(list(_branch_rows(found)))


def _branch_rows(found: Branches) -> Iterator[dict[str, Any]]:
    for number, branch in enumerate(found.branches, start=1):
        numbers = branch.values.tolist(), branch.is_stable, branch.omega.tolist(), branch.angle.tolist(), branch.states
        for value, stable, omega, angle, state in zip(*numbers, strict=True):
            columns = followed_columns(
                found.variation, value, omega, stable=bool(stable), angle_deg=degrees(angle), growth=state.growth
            )
            yield {**columns, "branch": number, "pendula": agreement(state)}


def change_words(change: Change) -> str:
    """What happens at a critical value: loses stability (neighbours beat at 0.063 rad/s)."""
    return change.kind + (f" (neighbours beat at {change.beat:.3g} rad/s)" if change.beat else "")


def _branch_cells(number: int, one: Branch) -> tuple[str, ...]:
    stable = ", ".join(f"{low:.7g} to {high:.7g}" for low, high in one.intervals) or "nowhere"
    exists = f"{one.values[0]:.7g} to {one.values[-1]:.7g}"
    return str(number), one.words, _ends(one.omega), _ends(np.rad2deg(one.angle)), exists, stable


def _ends(values: Floats) -> str:
    """From the first value to the last."""
    ends = dict.fromkeys(f"{value:#.4g}".rstrip(".") for value in (values[0], values[-1]))
    return " → ".join(ends)
