"""The command line of multipendula; the packages `modal` and `nonlinear` do the work."""
