"""What a stranger can do to the command line, and what must never come of it.

`judge` runs one command and says what is wrong with how it ended; `scene_files`, `options`, `damage` and
`interruptions` each make cases of one sort, every case from its own number, so that any one can be done again.
"""
