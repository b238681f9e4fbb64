"""Many members of a scene at once: other starts or other numbers, each integrated with its own steps.

In: a scene with starts or with what to vary, and the measures.  Out: an `Ensemble`: end states, samples or measures
of every member, with its energy drift and horizon, in chunks that may be files and that any workers compute.

    y_s' = f(y_s, p_s),    s = 1 … S

Start with `running`; `measures` says what can be measured, `lanes`, `compiled` and `series` are the engines, and
`plain` takes one by one what these do not; `basins`, `sections` and `spread` are what ensembles are run for most,
`executors` and `cluster` share the work among processes.  `preparing` compiles ahead of time what a scene can use.
"""

from nonlinear.ensembles.basins import Basins, basins_table, begins_in_mode, find_basins, grid_of
from nonlinear.ensembles.costs import ENGINES
from nonlinear.ensembles.measures import MEASURES
from nonlinear.ensembles.members import Members, members_of
from nonlinear.ensembles.preparing import Compilation, CompiledCode, compilation_table, compile_engines
from nonlinear.ensembles.running import Ensemble, ensemble
from nonlinear.ensembles.runs import run_together
from nonlinear.ensembles.sections import PoincareSection, find_section, section_table
from nonlinear.ensembles.spread import Spread, find_spread, motion_words, spread_table

__all__ = [
    "ENGINES",
    "MEASURES",
    "Basins",
    "Compilation",
    "CompiledCode",
    "Ensemble",
    "Members",
    "PoincareSection",
    "Spread",
    "basins_table",
    "begins_in_mode",
    "compilation_table",
    "compile_engines",
    "ensemble",
    "find_basins",
    "find_section",
    "find_spread",
    "grid_of",
    "members_of",
    "motion_words",
    "run_together",
    "section_table",
    "spread_table",
]
