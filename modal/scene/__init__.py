"""What hangs from what: the scene, its file, and its numbers by their paths.

In: TOML, or the same objects from Python.  Out: an immutable `Scene`, checked once and completely at the door.

    pendulum[2].links[0].mass = -1.0: must be positive

Start with `model`; `files` reads and writes, `validation` words every mistake, `parameters` varies numbers by path.
"""
