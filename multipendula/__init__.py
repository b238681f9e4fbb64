"""Multi-pendulum systems in one namespace: every command as a function, the parts of a scene, and their files.

    import multipendula as mp

    scene = mp.load("paper-cart-2")                       # a shipped scene, or a file
    mp.table(scene)                                       # what `multipendula table paper-cart-2` prints
    mp.sweep(scene, "support.mass=0.05:0.2:6")            # a keyword for each option of the command
    run = mp.simulate(scene, 10, start="mode:2:20")
    mp.save(run, "run.npz")

The packages `modal` and `nonlinear` do the work, know nothing of this namespace, and have more.  Names are loaded when
they are first used.  `python -m multipendula` is the command line.
"""

HOMES = {
    "multipendula.functions": ("load", "save"),
    "modal.scene": (
        *("Bob", "Body", "Carrier", "Cart", "ConstantForce", "Escapement", "Fixed", "Ground", "Heave", "Hoist"),
        *("InitialCondition", "LossTable", "ModalSupport", "Moved", "Pendulum", "Platform", "RandomForce"),
        *("RandomMotion", "RecordForce", "RecordMotion", "Rod", "Scene", "SineForce", "SineMotion", "Spring"),
        *("SweepForce", "SweepMotion", "Swing", "Tilt", "VanDerPol", "dumps", "example_names", "free_bodies"),
    ),
    "modal.scene.links": ("Link",),
    "modal.scene.parameters": ("vary",),
    "modal.errors": ("ComputationError", "MissingExtraError", "MultipendulaError", "SceneError"),
    "modal.modes": ("Mode", "Modes", "mode_energies", "natural_frequencies", "natural_modes", "sensitivities"),
    "modal.statespace": ("StateSpace", "modal_gains", "state_space"),
    "nonlinear": (
        *("AppliedForces", "Event", "Motion", "SimulationError", "State", "Trajectory", "initial_state"),
        *("level_crossing", "resume", "state_at_rest", "system_of", "turning_point"),
    ),
}
"""Names other than the commands, by the module that defines them."""


def _homes() -> dict[str, str]:
    """Every name with its module; of the commands all but `completion`, which is for shells."""
    from multipendula.commands import NAMES

    commands = (name for names in NAMES.values() for name in names if name != "completion")
    told = {name: home for home, names in HOMES.items() for name in names}
    return dict.fromkeys(commands, "multipendula.functions") | told


def __getattr__(name: str) -> object:
    """Load a name when it is first used."""
    if name == "__all__":
        return __dir__()
    home = None if name.startswith("_") else _homes().get(name)
    if home is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}", name=name)
    from importlib import import_module

    globals()[name] = getattr(import_module(home), name)
    return globals()[name]


def __dir__() -> list[str]:
    return sorted(_homes())
