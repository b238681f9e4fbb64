"""The synchronization of a scene as text and as numbers: prediction, simulation, and limits of the theory."""

from __future__ import annotations

from collections.abc import Iterator
from math import degrees, isfinite, pi
from textwrap import TextWrapper, fill
from typing import Any

import numpy as np

from modal.errors import ComputationError
from modal.modes import table_numbers
from modal.report import (
    ReportColumn,
    ReportTable,
    capital,
    counted,
    finite,
    headed,
    line_width,
    listed,
    percent,
    rad,
    short,
)
from modal.scene import Scene, describe, title_of
from modal.scene.doors import require_type
from modal.types import Floats
from nonlinear.averaging import ASIDE, RelativeEquilibrium
from nonlinear.orbits import Orbit, growth
from nonlinear.orbits.cycles import drift_growth
from nonlinear.orbits.report import TABLE_ROWS_MAX
from nonlinear.postprocessing import last, smooth
from nonlinear.synchronization.attractors import rhythm_of
from nonlinear.synchronization.modal_energy import BEAT_DIFFERENCE_MAX, Survival
from nonlinear.synchronization.patterns import agreement, own_amplitudes
from nonlinear.synchronization.phases import ENDING
from nonlinear.synchronization.population_report import (
    population_record,
    population_sections,
)
from nonlinear.synchronization.study import SynchronizationStudy, Theory
from nonlinear.system import System

NOT_COVERED = (
    "The averaged equations are of first order in dampers, drives, coupling within a band and squares of angles, with "
    "the third harmonic of every swing. They neglect everything else within a swing, stiction, backlash, motion "
    "across the rail, inverted links and noise. Motions in which modes of one band beat forever, with two or more "
    "frequencies, may exist as well; they are not searched for."
)
EXACT = (
    "Angle, frequency, stability and e-folding time are those of the periodic orbit near each, of its period and its "
    "Floquet multipliers in the full equations."
)
COPIED = "Copies are the same motion with the roles of equal pendula exchanged."
LEFT = "(averaged): no such orbit was found."
NUMBERED = "Modes are numbered as in the table."
LISTED_FREQUENCIES_MAX = 6
"""Format: frequencies of pendula in a sentence."""


def sync_text(study: SynchronizationStudy, *, words: bool = False, elsewhere: str = "") -> str:
    """The report for a terminal: the verdict, the steady motions, what both omit, and the sentence `elsewhere`.

    `words` adds everything about the prediction and the simulation in sentences.
    """
    require_type("study", study, "SynchronizationStudy")
    parts = [headed(title_of(study.scene)), *_sections(study), elsewhere]
    if words and study.theory is not None:
        parts.append(_paragraph("Predicted from this start", _prediction(study, study.theory)))
    if words:
        is_perturbed = study.theory is not None and study.theory.prediction.unstable
        title = f"Simulated for {short(float(study.trajectory.times[-1]))} s"
        parts.append(_paragraph(title + ", and from a start nearby" * bool(is_perturbed), _simulation(study)))
    return "\n\n".join(part for part in parts if part) + "\n"


def _sections(study: SynchronizationStudy) -> Iterator[str]:
    yield "\n".join(fill(sentence, line_width()) for sentence in sync_verdict(study))
    if study.populations is not None:
        yield from population_sections(study.populations, study.motions, study.motionless)
    if study.theory is not None:
        yield "Steady motions by the averaged equations\n" + _table(study.theory)
    if study.scene.has_damping:
        yield NUMBERED
    if study.theory is not None:
        yield fill(NOT_COVERED, line_width())


def sync_verdict(study: SynchronizationStudy) -> list[str]:
    """At most five sentences: which mode wins, predicted and simulated, from when on, and whether the pendula lock."""
    sentences = [] if study.populations is None else [f"{capital(study.populations.verdict)}."]
    if study.theory is None:
        sentences.append(f"No prediction: {study.silent}.")
    elif study.theory.prediction.unstable:
        sentences.append(
            "This start lies on an unstable motion of the averaged equations (often by symmetry); it was perturbed by "
            f"{100 * ASIDE:.0f} %."
        )
    sentences += [*_winner(study), *_since(study), *_orbit_at_the_end(study)]
    phases = study.phases
    if phases.z.shape[1] > 1 and study.populations is None:
        sentences += _locking(study)
    if reasons := _reasons(study):
        remainder = f"; {counted(len(reasons) - 1, 'further warning', 'further warnings')}" if len(reasons) > 1 else ""
        sentences.append(f"The prediction is not certain: {reasons[0]}{remainder}.")
    return sentences


def _reasons(study: SynchronizationStudy) -> list[str]:
    """Reasons why the survivor is not certain, without the one that no mode wins, which is said first."""
    indecision = study.theory.prediction.indecision if study.theory else ""
    return [reason for reason in study.doubts if reason != indecision]


def _winner(study: SynchronizationStudy) -> Iterator[str]:
    """Which mode holds the energy at the end, and whether that was predicted."""
    survival, end = study.survival, f"{float(study.trajectory.times[-1]):.4g} s"
    try:
        share = percent(survival.survivor_share) if survival else ""
        outcome = survival and f"mode {survival.number} contains {share} of the energy at the end of the run ({end})"
    except ComputationError as error:
        outcome = str(error)
    if survival and survival.beat:
        beats = survival.beat
        outcome = (
            f"the energy beats indefinitely: mode {survival.number} contains between {percent(beats.low)} and "
            f"{percent(beats.high)} of it, every {beats.period:.4g} s ({_angles(study)}{_slow_period(study)})"
        )
    elif survival and outcome and not survival.is_settled:
        outcome += f", undecided after {end}: it has not settled"
    if study.theory is None:
        if outcome:
            yield f"{capital(outcome)}."
        return
    prediction = study.theory.prediction
    if prediction.motion.dies:
        yield "The swing dies out, by the prediction: no drive sustains it."
        return
    mode = f"mode {prediction.number} ({prediction.averaged.modes[prediction.row].family})"
    share_then = "" if prediction.unsettled else f", {percent(prediction.share)}"
    strongest = f"No mode wins; {mode} has most{share_then}"
    forecast = f"{capital(mode)} wins" if prediction.is_won else strongest
    if not outcome:
        yield f"{forecast}, by the prediction."
    elif study.agrees and survival and survival.beat:
        yield f"{forecast}, as predicted: {outcome}."
    elif study.agrees:
        yield (
            f"{forecast}, as predicted: in the simulation it contains {share} of the energy at the end of the run "
            f"({end})."
        )
    elif study.agrees is None:
        yield f"{forecast}, by the prediction; the simulation is too short to confirm it: {outcome}."
    else:
        yield f"The simulation differs from the prediction: {outcome}. Predicted: {forecast[:1].lower()}{forecast[1:]}."


def _orbit_at_the_end(study: SynchronizationStudy) -> Iterator[str]:
    """The periodic motion in which the run ends, where the prediction alone was not certain."""
    if study.orbit:
        family = "one of a continuous family, " if study.orbit.floquet.is_of_family else ""
        yield (
            f"The run settles on a periodic motion of {study.orbit.period:.6g} s ({rhythm_of(study.orbit)}), {family}"
            f"stable in the full equations: {_multipliers(study.orbit)}."
        )


def _multipliers(orbit: Orbit) -> str:
    """A clause on the largest multiplier, and on that of the sliding of a cart if it is larger."""
    size, drift = (float(np.exp(rate * orbit.period)) for rate in (growth(orbit), drift_growth(orbit)))
    if drift <= size:
        return f"no multiplier exceeds {size:.6g}"
    return f"no multiplier exceeds {size:.6g}, but {drift:.6g} of the sliding of the {_support(orbit.scene)}"


def _support(scene: Scene) -> str:
    """What carries the pendula."""
    return "structure" if scene.is_structured else "cart"


def _late_swing(study: SynchronizationStudy) -> tuple[Floats, Floats]:
    """The times (s) of the second half of the run, (T,), and the angles (rad) to which pendula swing then, (T, N)."""
    late = last(study.trajectory.times, 0.5)
    angles, times = study.phases.amplitude[late, :, study.phases.leading], study.trajectory.times[late]
    return times, smooth(times, angles, 2 * pi / float(study.phases.omega.min()))


def _angles(study: SynchronizationStudy) -> str:
    """From which to which angle the swing of one pendulum goes in the second half of the run."""
    _, swing = _late_swing(study)
    widest = swing[:, int(np.ptp(swing, axis=0).argmax())]
    return f"a pendulum swings between {degrees(widest.min()):.3g}° and {degrees(widest.max()):.3g}°"


def _slow_period(study: SynchronizationStudy) -> str:
    """A clause on the slow period of the motion, where that is a multiple of the energy's as pendula swap roles."""
    assert study.survival
    assert study.survival.beat
    period, (times, swing) = study.survival.beat.period, _late_swing(study)
    for turns in range(1, int(np.ptp(times) / period) + 1):
        is_later = times >= times[0] + turns * period
        earlier = np.array([np.interp(times[is_later] - turns * period, times, angle) for angle in swing.T]).T
        if np.abs(earlier - swing[is_later]).max() < BEAT_DIFFERENCE_MAX * np.ptp(swing, axis=0).max():
            roles = f"; they are back in their roles after {turns} of these, the slow period of {turns * period:.4g} s"
            return roles if turns > 1 else ""
    return ""


def _since(study: SynchronizationStudy) -> Iterator[str]:
    """From when on all other modes hold next to nothing, where there are others."""
    if study.survival and len(study.survival.row) == 1:
        return
    prediction = study.theory.prediction if study.theory else None
    predicted_time = prediction.locking_time() if prediction and not prediction.motion.dies else None
    try:
        simulated_time = study.survival.locking_time() if study.survival else None
    except ComputationError:
        return
    times = [(predicted_time, "predicted"), (simulated_time, "simulated")]
    clauses = [f"{time:.4g} s ({how})" for time, how in times if time is not None]
    if clauses:
        from_start = not any(time for time, _ in times)
        when = "from the start" if from_start else f"after {listed(clauses, len(clauses))}"
        yield f"All other modes contain less than 1 % of the energy {when}."
    elif study.survival and study.survival.beating:
        yield _beating(study.survival)


def _locking(study: SynchronizationStudy) -> Iterator[str]:
    """Whether the pendula have one frequency."""
    phases = study.phases
    try:
        frequencies = phases.frequency
    except ComputationError:
        return
    if not np.all(np.isfinite(frequencies)) or phases.resolution > frequencies.max():
        return
    order = float(phases.order[last(study.trajectory.times, ENDING), phases.leading].mean())
    if study.theory is not None and study.theory.prediction.motion.dies:
        return
    if study.survival and study.survival.beat:
        yield f"The pendula are not locked: they beat, at {frequencies.mean():.6g} rad/s on average (R = {order:.4f})."
    elif phases.locked and study.locks_later:
        low, high = f"{frequencies.min():.5g}", f"{frequencies.max():.5g}"
        yield (
            f"The pendula are predicted to lock at {_locked_frequency(study):.6g} rad/s, and have not by the end of "
            f"the run: their frequencies go from {low} to {high} rad/s (R = {order:.4f})."
        )
    elif phases.locked:
        omega = f"{_locked_frequency(study):.6g} rad/s"
        yield f"The pendula are locked at {omega}, with the order parameter R = {order:.4f}."
    else:
        low, high = f"{frequencies.min():.6g}", f"{frequencies.max():.6g}"
        yield f"The pendula are not locked: their frequencies go from {low} to {high} rad/s (R = {order:.4f})."


def _locked_frequency(study: SynchronizationStudy) -> float:
    """The frequency (rad/s) of the orbit in which locked pendula end, the mean of the run where there is none."""
    mean = float(study.phases.frequency.mean())
    orbit = study.orbit or (study.theory.ending if study.theory and (study.agrees or study.locks_later) else None)
    return orbit.omega * max(1, round(mean / orbit.omega)) if orbit else mean


def _paragraph(title: str, sentences: Iterator[str]) -> str:
    wrapper = TextWrapper(line_width(), "  ", "    ", break_long_words=False, break_on_hyphens=False)
    return "\n".join([title, *map(wrapper.fill, sentences)])


def _table(theory: Theory) -> str:
    if not theory.configurations:
        return "none was found"
    motions = theory.distinct
    # of many those that may last, and the first of the others
    lasting = [orbit.is_stable if orbit else state.is_stable for state, orbit in motions]
    unstable = [k for k, lasts in enumerate(lasting) if lasts is False]
    omissions = set(unstable[TABLE_ROWS_MAX // 2 :]) if len(lasting) > TABLE_ROWS_MAX else set()
    rows_shown = [k for k in range(len(lasting)) if k not in omissions]
    rows = ReportTable.of(STEADY, [motions[k] for k in rows_shown]).written()
    notes = [f"Averaged alone: {theory.certificate_refusal}."] * bool(theory.certificate_refusal)
    notes += [EXACT] * any(theory.orbits) + [LEFT] * (None in theory.orbits and any(theory.orbits))
    slow = [orbit for _, orbit in motions if orbit and orbit.is_stable and drift_growth(orbit) > growth(orbit)]
    drifts = {f"{-1 / drift_growth(orbit):.3g}" for orbit in slow}
    if drifts:
        what = _support(theory.prediction.averaged.scene)
        notes.append(
            f"These are of the pendula; the sliding of the {what} as a whole decays more slowly, with an e-folding "
            f"time of {listed(sorted(drifts), len(drifts))} s."
        )
    if any(state.copies > 1 for state, _ in motions):
        notes.insert(0, COPIED)
    if n_more := len(motions) - len(rows_shown):
        notes.insert(0, f"{n_more} more, all unstable, are in the JSON output.")
    return "\n\n".join([rows, *(fill(note, line_width()) for note in notes)])


def _fate(state: RelativeEquilibrium, orbit: Orbit | None) -> str:
    if state.is_stable is None:
        return "neutral"
    if orbit:
        rate = growth(orbit)
        return f"{'stable' if orbit.is_stable else 'unstable'}, e-folding time {abs(1 / rate):.4g} s"
    return f"{'stable' if state.is_stable else 'unstable'}, e-folding time {state.relaxation:.4g} s (averaged)"


STEADY = (
    ReportColumn(lambda each: each[0].number, None, "mode"),
    ReportColumn(lambda each: each[0].averaged.modes[each[0].row].family, None, "description"),
    ReportColumn(lambda each: _agreement(each[0]), None, "pendula"),
    ReportColumn(
        lambda each: degrees(each[1].amplitude) if each[1] else _largest(each[0]), None, "largest angle (deg)", ".4g"
    ),
    ReportColumn(lambda each: each[1].omega if each[1] else each[0].omega, None, "frequency (rad/s)", ".6g"),
    ReportColumn(lambda each: _fate(*each), None, "stability"),
)
"""The quantities of a steady motion and of the orbit near it."""


def _agreement(state: RelativeEquilibrium) -> str:
    return agreement(state) + (f" ({state.copies} copies)" if state.copies > 1 else "")


def _largest(state: RelativeEquilibrium) -> float:
    return degrees(float(np.abs(own_amplitudes(state)).max()))


def _prediction(study: SynchronizationStudy, theory: Theory) -> Iterator[str]:
    prediction = theory.prediction
    if state := prediction.unstable:
        yield (
            f"From exactly this start mode {state.number} survives ({agreement(state)}), but that motion is unstable, "
            f"e-folding time {state.relaxation:.4g} s. Real pendula leave it, so what follows is for a start "
            f"that is off by {100 * ASIDE:.0f} %."
        )
    if prediction.motion.dies:
        yield "The swing dies out: no drive sustains it."
        return
    mode = prediction.averaged.modes[prediction.row]
    share = percent(prediction.share)
    which = f"({mode.family}; {rad(mode.omega)} at small angles{', without dampers' * study.scene.has_damping})"
    if prediction.is_won:
        yield f"Mode {prediction.number} survives {which}, with {share} of the energy."
    else:
        yield f"No mode wins: mode {prediction.number} {which} has most, {share} of the energy."
    if theory.ending:
        yield f"The orbit in which it ends is stable in the full equations: {_multipliers(theory.ending)}."
    if theory.certificate_refusal:
        yield f"Its stability is that of the averaged equations alone ({theory.certificate_refusal})."
    if reasons := _reasons(study):
        yield f"This is not certain: {'; '.join(reasons)}."
    elif not theory.ending:
        yield "This is certain as far as the averaged equations reach."
    locking = prediction.locking_time()
    if locking is None or not np.ptp(prediction.averaged.row):
        return
    yield f"All other modes contain less than 1 % of the energy after {short(locking)} s."
    if doubts := prediction.timing_doubts[len(prediction.doubts) :]:
        yield f"That time is approximate: {'; '.join(doubts)}."


def _simulation(study: SynchronizationStudy) -> Iterator[str]:
    yield from _survivor(study.survival) if study.survival else [f"No energies by modes: {study.unmeasured_reason}."]
    if study.agrees is not None:
        share = ": the mode is, its share of the energy is not" if study.leads else ""
        yield "As predicted." if study.agrees else f"This is not what was predicted{share}."
    elif study.survival and study.too_short:
        yield "The run ends before the predicted time: it cannot show whether the prediction is right."
    yield from _phases(study)
    yield from _energies(study)


def _survivor(survival: Survival) -> Iterator[str]:
    try:
        mode = survival.mode
    except ComputationError as error:
        yield f"{capital(str(error))}."
        return
    share = percent(survival.survivor_share)
    yield f"Mode {survival.number} contains {share} of the energy at the end ({mode.family})."
    time = survival.locking_time()
    if len(survival.row) == 1:
        return
    if survival.beating:
        yield _beating(survival)
    if time is None:
        yield "The others do not stay below 1 %."
    else:
        yield f"All others contain less than 1 % after {short(time)} s."


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


def _phases(study: SynchronizationStudy) -> Iterator[str]:
    phases, late = study.phases, last(study.trajectory.times, ENDING)
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
    numbers = [f"{omega:.5g}" for omega in frequencies[:LISTED_FREQUENCIES_MAX]]
    words = listed(numbers, len(frequencies))
    if len(frequencies) == 1:
        yield f"Mean frequency {words} rad/s."
    elif phases.resolution > frequencies.max():
        yield f"Mean frequencies {words} rad/s: the run is too short to tell whether they lock."
    else:
        fate = "locked within" if phases.locked else "not locked: they differ by"
        if study.survival and study.survival.beat:
            fate = "they beat, and differ by"
        elif study.locks_later:
            fate = "not locked yet: they differ by"
        yield f"Mean frequencies {words} rad/s: {fate} {np.ptp(frequencies):.2g} rad/s."


def _energies(study: SynchronizationStudy) -> Iterator[str]:
    trajectory = study.trajectory
    late = last(trajectory.times, ENDING)
    pendula, cart = study.phases.energy[late].sum(axis=1).mean(), trajectory.mechanics.cart_kinetic[late].mean()
    carrying = "cart" if trajectory.system.cart else "supports"
    has = trajectory.system.cart or trajectory.system.structure
    yield f"Energy at the end: pendula {pendula:.4g} J" + (f", {carrying} {cart:.3g} J." if has else ".")
    kicks, work = trajectory.kicks, float(trajectory.motion.work[-1])
    if len(kicks.time):
        kick_energy = float(kicks.energy.sum())
        rest = _others(trajectory.system, work - kick_energy)
        yield f"{counted(len(kicks.time), 'kick', 'kicks')} supplied {kick_energy:.6g} J{rest}."
    elif trajectory.system.works:
        yield f"Drives and dampers together did {work:.6g} J of work."
    if isfinite(drift := trajectory.energy_drift()):
        yield f"Energy balance closes to {drift:.1g} relative."


def _others(system: System, work: float) -> str:
    """A clause on other drives and dampers, with their work (J)."""
    if any(group.has_active_laws for group in system.groups):
        return f", van der Pol drives and dampers together did {work:.6g} J of work"
    what = "dampers, friction and drag" if system.rubs or system.has_drag else "dampers"
    return f"; {what} dissipated {-work:.6g} J" if system.dissipates else ""


def sync_record(study: SynchronizationStudy) -> dict[str, Any]:
    """The JSON record: modes are numbered as in the table; null where there is no value."""
    require_type("study", study, "SynchronizationStudy")
    theory, populations = study.theory, study.populations
    return {
        "scene": describe(study.scene),
        "configurations": [_configuration_record(*pair) for pair in theory.distinct] if theory else None,
        "prediction": _prediction_record(study, theory) if theory else None,
        "no_prediction": study.silent or None,
        "verdict_sentences": sync_verdict(study),
        "simulation": _simulation_record(study),
        "agrees": study.agrees,
        **({} if populations is None else population_record(populations, study.motions, study.motionless)),
    }


def _configuration_record(state: RelativeEquilibrium, orbit: Orbit | None = None) -> dict[str, Any]:
    """One configuration; `lasts` and `growth_rate_per_s` are those of its orbit where one was found."""
    eta = own_amplitudes(state)
    return {
        "mode": state.number,
        "family": state.averaged.modes[state.row].family,
        "pendula": agreement(state),
        "copies": state.copies,
        "amplitudes_deg": np.rad2deg(np.abs(eta)).tolist(),
        "phases_deg": (np.rad2deg(np.angle(eta / eta[np.abs(eta).argmax()])) % 360).tolist(),
        "omega_rad_per_s": state.omega,
        "lasts": orbit.is_stable if orbit and state.is_stable is not None else state.is_stable,
        "growth_rate_per_s": finite(growth(orbit) if orbit else state.growth),
        "averaged_growth_rate_per_s": finite(state.growth),
        "orbit": orbit and _orbit_record(orbit),
    }


def _orbit_record(orbit: Orbit) -> dict[str, Any]:
    return {
        "omega_rad_per_s": orbit.omega,
        "amplitude_deg": degrees(orbit.amplitude),
        "stable": orbit.is_stable,
        "floquet": [[float(multiplier.real), float(multiplier.imag)] for multiplier in orbit.floquet.all],
        "residual": orbit.residual,
    }


def _final_orbit_record(orbit: Orbit) -> dict[str, Any]:
    """Of the orbit in which a run ends: by its multipliers it attracts, alone or with others of a family."""
    family = orbit.floquet.is_of_family
    return {"name": rhythm_of(orbit), **_orbit_record(orbit), "stable": True, "family": family}


def _prediction_record(study: SynchronizationStudy, theory: Theory) -> dict[str, Any]:
    prediction = theory.prediction
    dies = prediction.motion.dies
    doubts = list(study.doubts)
    return {
        "unstable": _configuration_record(prediction.unstable) if prediction.unstable else None,
        "dies_out": prediction.motion.dies,
        "survivor": None if dies or not prediction.is_won else prediction.number,
        "strongest": None if dies else prediction.number,
        "survivor_share": None if dies else prediction.share,
        "certain": not doubts,
        "doubts": doubts,
        "ends_on": theory.ending and _orbit_record(theory.ending),
        "locking_time_s": prediction.locking_time(),
        "locking_time_doubts": list(prediction.timing_doubts),
        "largest_angle_deg": degrees(prediction.averaged.largest(prediction.motion.z[:, -1])),
    }


def _simulation_record(study: SynchronizationStudy) -> dict[str, Any]:
    trajectory, phases = study.trajectory, study.phases
    late = last(trajectory.times, ENDING)
    return {
        "duration_s": float(trajectory.times[-1]),
        "verdict": study.verdict or None,
        "orbit": study.orbit and _final_orbit_record(study.orbit),
        **(_survival_record(study.survival) if study.survival else {"no_modes": study.unmeasured_reason}),
        "own_mode": phases.leading + 1,
        "order_parameter": float(phases.order[late, phases.leading].mean()),
        **_frequencies(study),
        "energy_of_pendula_J": phases.energy[late].mean(axis=0).tolist(),
        "kicks": len(trajectory.kicks.time),
        "energy_of_kicks_J": float(trajectory.kicks.energy.sum()),
        "work_J": float(trajectory.motion.work[-1]),
        "energy_drift": trajectory.energy_drift(),
    }


def _survival_record(survival: Survival) -> dict[str, Any]:
    try:
        return {
            "survivor": None if survival.beat or survival.beating or not survival.is_settled else survival.number,
            "strongest": survival.number,
            "survivor_share": survival.survivor_share,
            "settled": survival.is_settled,
            "beat": survival.beat and dict(zip(("period_s", "low", "high"), survival.beat, strict=True)),
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


def _frequencies(study: SynchronizationStudy) -> dict[str, Any]:
    try:
        frequencies = study.phases.frequency.tolist()
    except ComputationError as error:
        return {"frequencies_rad_per_s": None, "no_frequencies": str(error)}
    return {
        "frequencies_rad_per_s": [finite(omega) for omega in frequencies],
        "locked": study.phases.locked and not study.locks_later,
    }
