"""Many members of a scene at once: other starts or other numbers, each integrated with its own steps.

In: a scene with starts or with what to vary, and the measures.  Out: an `Ensemble`: end states, samples or measures
of every member, with its energy drift and horizon, in chunks that may be files and that any workers compute.

    y_s' = f(y_s, p_s),    s = 1 … S

Start with `running`; `measures` says how measures are computed, `lanes` and `compiled` are the engines, and `plain`
takes one by one what these do not; `basins` and `sections` are what ensembles are run for most, of scenes that are
driven in time `strobes` and `bifurcations`; `endings` finds what starts end in, from `return_maps`; `rhythm_maps` does
so along a number and keeps it in `rhythm_store`, with `rhythm_borders` of what has no orbit; `executors` and `cluster`
share the work among processes, also that of other subpackages. `preparing` compiles ahead of time what a scene can use.
"""

from nonlinear.ensembles.basins import Basins, basins_table, begins_in_mode, find_basins, grid_of
from nonlinear.ensembles.bifurcations import BifurcationDiagram, bifurcation_table, find_bifurcations
from nonlinear.ensembles.cluster import workers_at
from nonlinear.ensembles.costs import ENGINES
from nonlinear.ensembles.endings import EndingGroup
from nonlinear.ensembles.executors import WorkerPool, Workers
from nonlinear.ensembles.measures import validate_measures
from nonlinear.ensembles.members import Members, members_of
from nonlinear.ensembles.plain import measured_run
from nonlinear.ensembles.preparing import Compilation, CompiledCode, compilation_table, compile_engines
from nonlinear.ensembles.rhythm_maps import find_rhythm_grid, find_rhythms
from nonlinear.ensembles.rhythms import RhythmGrid, RhythmMap
from nonlinear.ensembles.running import Ensemble, ensemble
from nonlinear.ensembles.runs import measured_together, run_together, times_of
from nonlinear.ensembles.sections import PoincareSection, energy_of, find_section, section_table, starts_at
from nonlinear.ensembles.strobes import StroboscopicSection, find_strobes, strobes_table

__all__ = [
    "ENGINES",
    "Basins",
    "BifurcationDiagram",
    "Compilation",
    "CompiledCode",
    "EndingGroup",
    "Ensemble",
    "Members",
    "PoincareSection",
    "RhythmGrid",
    "RhythmMap",
    "StroboscopicSection",
    "WorkerPool",
    "Workers",
    "basins_table",
    "begins_in_mode",
    "bifurcation_table",
    "compilation_table",
    "compile_engines",
    "energy_of",
    "ensemble",
    "find_basins",
    "find_bifurcations",
    "find_rhythm_grid",
    "find_rhythms",
    "find_section",
    "find_strobes",
    "grid_of",
    "measured_run",
    "measured_together",
    "members_of",
    "run_together",
    "section_table",
    "starts_at",
    "strobes_table",
    "times_of",
    "validate_measures",
    "workers_at",
]
__dir__ = __all__.copy
