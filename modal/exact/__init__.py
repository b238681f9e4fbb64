"""Exact and proved results: integer polynomials, isolated roots, ball arithmetic.

In: a `Scene` whose numbers are taken exactly as stored.  Out: characteristic polynomials with integer coefficients,
intervals that provably contain their roots, and enclosures of every natural frequency to any number of digits.

    det(K − ω² M) = 0

Start with `characteristic` for polynomials and with `enclosures` for proofs (extra `certified`).
"""

from typing import TYPE_CHECKING

from modal.lazy import lazy_attributes

if TYPE_CHECKING:
    from modal.exact.assembly import flint
    from modal.exact.characteristic import (
        Polynomial,
        Variable,
        eliminate_links,
        equal_bobs,
        exact,
        exact_links,
        of_scene,
    )
    from modal.exact.enclosures import enclose
    from modal.exact.polynomials import isolate, multiple, product, total

__all__ = [
    "Polynomial",
    "Variable",
    "eliminate_links",
    "enclose",
    "equal_bobs",
    "exact",
    "exact_links",
    "flint",
    "isolate",
    "multiple",
    "of_scene",
    "product",
    "total",
]

if not TYPE_CHECKING:
    __getattr__ = lazy_attributes(__name__)
