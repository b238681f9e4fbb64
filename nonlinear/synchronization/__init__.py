"""Synchronization of pendula, predicted and simulated.

In: a scene.  Out: a `SynchronizationStudy`: phases and amplitudes of every pendulum and the mode that has the
energy; the branches of configurations along a parameter, and a report.

    η_p = |η_p| e^{iψ_p},    R = |Σ e^{iψ_p}|/N

Equal pendula on the supports of a structure are populations: which of them lock (`populations`), which perturbations
leave the motions in which they all do the same (`sectors`), and where (`thresholds`). Start with `study`; `phases`
measures, `continuation` follows branches, `report` and `branch_report` word them.
"""

from nonlinear.synchronization.attractors import Ending, ending_of, ending_orbit, orbit_amplitudes, rhythm_of
from nonlinear.synchronization.branch_report import (
    AveragedThreshold,
    averaged_thresholds,
    branches_csv,
    branches_text,
)
from nonlinear.synchronization.continuation import Branches, EquilibriumBranch, follow_branches
from nonlinear.synchronization.modal_energy import Survival, find_survival
from nonlinear.synchronization.patterns import agreement, rhythm_name
from nonlinear.synchronization.phases import ENDING, Phases, phases_of
from nonlinear.synchronization.population_report import diagram_csv, diagram_text
from nonlinear.synchronization.populations import PopulationPhases, population_phases
from nonlinear.synchronization.report import sync_record, sync_text
from nonlinear.synchronization.sectors import SymmetricMotion, symmetric_motions
from nonlinear.synchronization.study import SynchronizationStudy, study_synchronization, theory_of_scene
from nonlinear.synchronization.thresholds import (
    MotionBranch,
    PopulationDiagram,
    Threshold,
    follow_populations,
    has_patterns,
)

__all__ = [
    "ENDING",
    "AveragedThreshold",
    "Branches",
    "Ending",
    "EquilibriumBranch",
    "MotionBranch",
    "Phases",
    "PopulationDiagram",
    "PopulationPhases",
    "Survival",
    "SymmetricMotion",
    "SynchronizationStudy",
    "Threshold",
    "agreement",
    "averaged_thresholds",
    "branches_csv",
    "branches_text",
    "diagram_csv",
    "diagram_text",
    "ending_of",
    "ending_orbit",
    "find_survival",
    "follow_branches",
    "follow_populations",
    "has_patterns",
    "orbit_amplitudes",
    "phases_of",
    "population_phases",
    "rhythm_name",
    "rhythm_of",
    "study_synchronization",
    "symmetric_motions",
    "sync_record",
    "sync_text",
    "theory_of_scene",
]
__dir__ = __all__.copy
