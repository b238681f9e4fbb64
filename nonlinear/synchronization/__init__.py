"""Who keeps time with whom: prediction and simulation of synchronization side by side.

In: a scene.  Out: a `Synchrony`: phases and amplitudes of every pendulum, which mode holds the energy, the branches of
configurations along a parameter, and a report.

    η_p = |η_p| e^{iψ_p},    R = |Σ e^{iψ_p}|/N

Start with `study`; `phases` measures, `continuation` follows branches, `report` words both.
"""
