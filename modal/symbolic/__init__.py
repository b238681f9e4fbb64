"""Symbols (SymPy): Lagrangians, equations of motion, eigen-polynomials, derivations in print, the three papers.

In: a scene or a template such as `chain:3`.  Out: `System` with M, K and D as formulas, and a `Derivation` that prints
as text, LaTeX or Markdown.  SymPy is imported in this room alone.

    d/dt ∂L/∂q' − ∂L/∂q = 0,    L = T − V

Start with `system`, then `derivation`; `papers` holds each numbered equation as printed and as it should read.
"""
