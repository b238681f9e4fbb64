"""Symbolic derivations (SymPy): Lagrangians, equations of motion, eigen-polynomials, printed output, the three papers.

In: a scene or a template such as `chain:3`. Out: a `SymbolicStructure` with M, K and D as formulas, and derivations as
text, LaTeX or Markdown. SymPy is imported in this subpackage alone.

    d/dt ∂L/∂q' − ∂L/∂q = 0,    L = T − V

Start with `derivation`; `hamiltonian` has Hamilton's equations, `newton_euler` the balances of parts,
which are taken apart in `modal.scene.free_body`; `structures` has the energies of all scenes, of which a support that
stands still or one cart are the smallest; `papers` holds each numbered equation as printed and as corrected.
"""

from modal.symbolic.carriers import Coordinate, coordinate, lagrange_equations, time_derivative
from modal.symbolic.derivation import chain, derive, symbolic_structure
from modal.symbolic.eigen import polynomial_roots, symbolic
from modal.symbolic.hamiltonian import derive_lagrangian, vanishes
from modal.symbolic.newton_euler import NewtonEuler, part_sections
from modal.symbolic.structures import SymbolicStructure
from modal.symbolic.typesetting import Line, Section, plain, typeset

__all__ = [
    "Coordinate",
    "Line",
    "NewtonEuler",
    "Section",
    "SymbolicStructure",
    "chain",
    "coordinate",
    "derive",
    "derive_lagrangian",
    "lagrange_equations",
    "part_sections",
    "plain",
    "polynomial_roots",
    "symbolic",
    "symbolic_structure",
    "time_derivative",
    "typeset",
    "vanishes",
]
__dir__ = __all__.copy
