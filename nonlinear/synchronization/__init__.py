"""Synchronization: which pendula lock, predicted and simulated.

In: a scene.  Out: a `SynchronizationStudy`: phases and amplitudes of every pendulum and the mode that has the
energy; the branches of configurations along a parameter, and a report.

    η_p = |η_p| e^{iψ_p},    R = |Σ e^{iψ_p}|/N

Start with `study`; `phases` measures, `continuation` follows branches, `report` words both.
"""

from nonlinear.synchronization.continuation import Branch, Branches, follow_branches
from nonlinear.synchronization.modal_energy import Survival, find_survival
from nonlinear.synchronization.patterns import agreement
from nonlinear.synchronization.phases import ENDING, Phases, phases_of
from nonlinear.synchronization.report import branches_csv, branches_text, sync_record, sync_text
from nonlinear.synchronization.study import SynchronizationStudy, study_synchronization, theory_of_scene

__all__ = [
    "ENDING",
    "Branch",
    "Branches",
    "Phases",
    "Survival",
    "SynchronizationStudy",
    "agreement",
    "branches_csv",
    "branches_text",
    "find_survival",
    "follow_branches",
    "phases_of",
    "study_synchronization",
    "sync_record",
    "sync_text",
    "theory_of_scene",
]
