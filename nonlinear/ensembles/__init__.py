"""Many members of a scene at once: other starts or other numbers, each integrated with its own steps.

In: a scene with starts or with what to vary, and the measures.  Out: an `Ensemble`: end states, samples or measures
of every member, with its energy drift and horizon, in chunks that may be files and that any workers compute.

    y_s' = f(y_s, p_s),    s = 1 … S

Start with `running`; `measures` says what can be measured, `lanes`, `compiled` and `series` are the engines, and
`plain` takes one by one what these do not.
"""

from nonlinear.ensembles.costs import ENGINES
from nonlinear.ensembles.measures import MEASURES
from nonlinear.ensembles.members import Members, members_of
from nonlinear.ensembles.running import Ensemble, ensemble
from nonlinear.ensembles.runs import run_together

__all__ = ["ENGINES", "MEASURES", "Ensemble", "Members", "ensemble", "members_of", "run_together"]
