"""What is read off a trajectory: resampling, spectra, frequencies, reaction forces, a summary.

In: a `Trajectory`.  Out: signals at other times, line frequencies far finer than 2π/T, pivot forces, words.
Start with `summary`.
"""
