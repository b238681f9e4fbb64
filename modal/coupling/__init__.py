"""How the cart couples the pendula that hang from it.

In: a `Scene`.  Out: a `Coupling`: families of modes, their splitting and beats, the limits of a light and a heavy cart,
which pendula exchange energy, and what dampers and drives do to each mode; in words, as numbers, as JSON.

    m_dyn(ω) = m + Σ_r μ_r ω_r²/(ω_r² − ω²)

is the dynamic mass that a force on the cart feels: its poles are the fixed-base modes, its zeros the modes that move
the cart.  Start with `analysis`.
"""
