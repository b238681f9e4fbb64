"""What an error costs: the cheapest way to a wished accuracy, and work-precision studies.

In: a scene, an accuracy in rad, a duration.  Out: `Advice`, the run with its evidence, or a `Tradeoff`, every way with
its time and its error beside a reference, up to the horizon

    t* = ln(tolerable/ε)/λ

beyond which nobody can know more.  Start with `advice`; `candidates` lists the ways, `references` judges them.
"""
