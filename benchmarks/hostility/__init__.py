"""Attacks on the command line, and the outcomes that must never result from them.

`judge` runs one command and reports what is wrong with its end; `scene_files`, `options`, `damage`, `interruptions`,
`measurements`, `calls` and `kept` each make cases of one kind, every case from its number, so that any one can be
repeated.
"""
