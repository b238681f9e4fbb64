"""Parameter sweeps: measures of a scene over a grid of its parameters, on all cores.

In: a `Study`: a scene, its variations and the measures.  Out: a `Sweep`, saved row by row in a checkpoint, so that an
interrupted sweep can resume.  Start with `measures` and `study`; `running` runs the points, `files` saves the result.
"""

from nonlinear.ensembles.executors import WorkerPool
from nonlinear.sweeps.checkpoint import Checkpoint, open_checkpoint
from nonlinear.sweeps.files import KINDS, load, save
from nonlinear.sweeps.measures import MEASURES, parse_measures
from nonlinear.sweeps.running import Sweep, reasons, sweep, sweep_text
from nonlinear.sweeps.study import Study

__all__ = [
    "KINDS",
    "MEASURES",
    "Checkpoint",
    "Study",
    "Sweep",
    "WorkerPool",
    "load",
    "open_checkpoint",
    "parse_measures",
    "reasons",
    "save",
    "sweep",
    "sweep_text",
]
