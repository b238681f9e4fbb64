"""Equations of motion, in minimal, maximal and Hamiltonian form, in the plane and in space.

In: a `Plant` and its state.  Out: accelerations, and the positions, energies, momenta and forces that go with them.

    M(q) q'' = f(q, q', t)

solved without M by one pass up each chain and one down (`recursion`), densely for small scenes, as a band for long
ones, or compiled (`compiled`, extra `fast`).  Start with `minimal`; `symmetries` replaces a scene by a smaller one that
moves alike.
"""
