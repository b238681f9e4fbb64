"""Figures of linear results.  matplotlib is imported here and in `nonlinear.plotting`, nowhere else.

In: the results of other rooms.  Out: a `Figure` from a `…_figure` function, or an image written to a stream.  Every
figure has a light and a dark form, axes with units, and colours that colour-blind readers tell apart. Start with
`style` and `layout`; the other modules are one kind of figure each.
"""
