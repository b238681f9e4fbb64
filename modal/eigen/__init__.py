"""Eigenvalues and mode shapes of a rig, by the cheapest route that keeps every digit.

In: a `Rig`.  Out: a `Spectrum`, the eigenvalues in ascending order, each with the source that describes its shape.

    K φ = ω² M φ,    with dampers  (λ² M + λ D + K) φ = 0

A chain takes the effective-mass recursion and bisection (`chains`), with joint springs or standing links
`sprung_chains`; many different pendula on one cart the secular equation (`coupled`); dampers the quadratic problem
(`quadratic`). Start with `routes`, which chooses.
"""
