"""Motion in modes: modal coordinates, superposition, truncation, and how wrong these are.

In: a scene, its modes and a start.  Out: a motion in closed form or in a few modes, with a stated error.

    q(t) = Σ_r φ_r η_r(t),    M e'' + D e' + K e = ρ(t)

where ρ is what the motion leaves of the full equations (`residual`) and e its error (`defect`).  Start with
`modal_coordinates`.
"""
