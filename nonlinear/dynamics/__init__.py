"""Equations of motion, in minimal, maximal and Hamiltonian form, in the plane and in space.

In: a `System` and its state.  Out: accelerations, and the positions, energies, momenta and forces that go with them.

    M(q) q'' = f(q, q', t)

solved without M by one pass up each chain and one down (`recursion`), written out in floats (`generated`), as a band
for long chains, or compiled (`compiled`, extra `fast`).  Start with `minimal`;
`symmetries` replaces a scene by a smaller one that moves alike.
"""

from nonlinear.dynamics.compiling import children_without_interrupts, without_interrupts
from nonlinear.dynamics.contacts import Contacts, Escaping, contacts_of, escaping, links_of_contacts
from nonlinear.dynamics.elimination import Banded, loses_digits
from nonlinear.dynamics.forms import form_of, jacobian_of, module_of
from nonlinear.dynamics.generated import Generated, Lanes, Written
from nonlinear.dynamics.hamiltonian import Hamiltonian
from nonlinear.dynamics.maximal import Maximal
from nonlinear.dynamics.mechanics import Mechanics, Reactions, vectors
from nonlinear.dynamics.minimal import Arranged, GroupBody, Minimal, Recursion
from nonlinear.dynamics.spatial import Spatial, SpatialRecursion
from nonlinear.dynamics.steps import link_steps, sine_steps, structure_steps, support_steps
from nonlinear.dynamics.symmetries import (
    Reduced,
    Symmetry,
    exactly_symmetric,
    find_symmetries,
    is_unstable_equilibrium,
    symmetrize,
    synchronous,
)
from nonlinear.dynamics.tape import Tape
from nonlinear.dynamics.text import Module, sincos

__all__ = [
    "Arranged",
    "Banded",
    "Contacts",
    "Escaping",
    "Generated",
    "GroupBody",
    "Hamiltonian",
    "Lanes",
    "Maximal",
    "Mechanics",
    "Minimal",
    "Module",
    "Reactions",
    "Recursion",
    "Reduced",
    "Spatial",
    "SpatialRecursion",
    "Symmetry",
    "Tape",
    "Written",
    "children_without_interrupts",
    "contacts_of",
    "escaping",
    "exactly_symmetric",
    "find_symmetries",
    "form_of",
    "is_unstable_equilibrium",
    "jacobian_of",
    "link_steps",
    "links_of_contacts",
    "loses_digits",
    "module_of",
    "sincos",
    "sine_steps",
    "structure_steps",
    "support_steps",
    "symmetrize",
    "synchronous",
    "vectors",
    "without_interrupts",
]
__dir__ = __all__.copy
