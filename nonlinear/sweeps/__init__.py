"""Measures of a scene over a grid of its parameters, on all cores, or over numbers drawn at random.

In: a `Study`: a scene, its variations and the measures.  Out: a `Sweep`, saved row by row in a checkpoint, so that an
interrupted sweep can resume.  Start with `measures` and `study`; `running` runs the points, `files` saves the result.
`spread` draws numbers that are not known exactly, and says what frequencies, motion and measures become.
"""

from nonlinear.ensembles.executors import WorkerPool
from nonlinear.sweeps.checkpoint import Checkpoint, RowFolder, open_checkpoint
from nonlinear.sweeps.files import KINDS, load, save
from nonlinear.sweeps.measures import parse_measures
from nonlinear.sweeps.running import MEMBERS, Sweep, chaos_by_energy, reasons, sweep, sweep_text
from nonlinear.sweeps.spread import Spread, find_spread, motion_words, spread_table
from nonlinear.sweeps.study import CHAOTIC, ENERGY, LYAPUNOV, Study

__all__ = [
    "CHAOTIC",
    "ENERGY",
    "KINDS",
    "LYAPUNOV",
    "MEMBERS",
    "Checkpoint",
    "RowFolder",
    "Spread",
    "Study",
    "Sweep",
    "WorkerPool",
    "chaos_by_energy",
    "find_spread",
    "load",
    "motion_words",
    "open_checkpoint",
    "parse_measures",
    "reasons",
    "save",
    "spread_table",
    "sweep",
    "sweep_text",
]
__dir__ = __all__.copy
