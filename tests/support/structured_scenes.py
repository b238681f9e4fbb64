"""Scenes on structures, one of every kind with every term that its equations have; `oracle` answers for them."""

from __future__ import annotations

from modal import Bob, Body, Cart, Pendulum, Rod, Scene
from modal.scene import Ground, Hoist, SineForce, SineMotion, Spring, VanDerPol
from modal.scene.supports import Heave, ModalSupport, Planar, Platform, Swing, Tilt

DRIVE = VanDerPol(strength=0.05, angle_deg=20.0)


def _springs() -> Scene:
    """Double pendula on a fixed support, joined link to link, to the ground and by torsion, copy by copy."""
    links = (Bob(mass=1.0, length=1.0, damping=0.02), Rod(mass=0.5, length=0.6, stiffness=0.3))
    return Scene(
        gravity=9.81,
        pendulum=[Pendulum(links=links, count=2), Pendulum(links=links[::-1], count=2, position=(0.4, -0.1))],
        spring=[
            Spring(between=("pendulum[0].links[0]@0.5", "pendulum[1].links[1]"), stiffness=5.0, damping=0.1),
            Spring(between=("pendulum[0].links[1]", "ground@-0.7,1.1"), stiffness=2.0),
            Spring(between=("pendulum[1].copies[1].links[0]@0.2", "ground"), stiffness=3.0, damping=0.2),
            Spring(
                kind="torsion", between=("pendulum[0].links[1]", "pendulum[1].links[0]"), stiffness=0.4, damping=0.1
            ),
            Spring(kind="torsion", between=("ground", "pendulum[1].copies[0].links[1]"), stiffness=0.2),
        ],
    )


def _swings() -> Scene:
    """Two swings with a long spring and one driven bob each."""
    bob = Bob(mass=0.3, length=0.1, damping=0.001, drive=VanDerPol(strength=0.004, angle_deg=18.0))
    return Scene(
        gravity=9.81,
        support=[
            Swing(name="left", mass=2.0, length=0.25, damping=1.0),
            Swing(name="right", mass=2.2, length=0.3, stiffness=4.0, position=(2.0, 0.05)),
        ],
        pendulum=[
            Pendulum(on="left", position=(0.1, -0.05), links=[bob]),
            Pendulum(on="right", links=[bob], position=(-0.1, 0.02)),
        ],
        spring=[Spring(between=("left@0.2,0.1", "right"), stiffness=60.0, damping=0.3)],
    )


def _board() -> Scene:
    """A board that carries unequal pendula by its spring, with joints that turn against it."""
    rods = (
        Rod(mass=1.0, length=0.7, stiffness=0.9, damping=0.02, drive=DRIVE),
        Rod(mass=0.5, length=0.4, stiffness=0.2),
    )
    bob = Bob(mass=1.2, length=0.9, stiffness=0.4, drag=0.05)
    return Scene(
        gravity=9.81,
        support=Tilt(name="board", mass=6.0, inertia=1.5, centre=(0.1, 0.4), stiffness=25.0, damping=0.3),
        pendulum=[Pendulum(position=(-0.8, 0.3), links=rods), Pendulum(position=(0.5, 0.25), links=[bob])],
        spring=[Spring(kind="torsion", between=("board", "pendulum[0].links[1]"), stiffness=0.5, damping=0.1)],
    )


def _ship() -> Scene:
    """A platform on moorings with a hanging double pendulum in air."""
    body = Body(mass=1.0, length=0.5, centre=0.3, inertia=0.02, quadratic_drag=0.1)
    return Scene(
        gravity=9.81,
        support=Platform(
            name="ship",
            mass=20.0,
            inertia=15.0,
            centre=(0.2, 0.1),
            stiffness=Planar(sway=5.0, heave=300.0, roll=400.0),
            damping=Planar(heave=2.0, roll=1.0),
        ),
        pendulum=[Pendulum(position=(2.0, -1.0), links=[Bob(mass=2.0, length=1.5, drag=0.1), body])],
        spring=[
            Spring(between=("ground@-4.0,0.0", "ship@-2.0,0.0"), stiffness=80.0, damping=3.0),
            Spring(between=("ship@2.0,0.0", "ground@2.0,3.0"), stiffness=90.0),
        ],
    )


def _carts() -> Scene:
    """Two carts in a row under copies of two pendula, joined by linear and torsion springs from link to link."""
    first = Pendulum(on="left", links=[Rod(mass=1.0, length=1.2, stiffness=0.5), Bob(mass=0.4, length=0.5)], count=2)
    return Scene(
        gravity=9.81,
        support=[
            Cart(name="left", mass=5.0, stiffness=7.0),
            Cart(name="right", mass=4.0, damping=0.4, position=(1.5, 0.2)),
        ],
        pendulum=[first, Pendulum(on="right", position=(0.1, 0.3), links=[Bob(mass=0.8, length=1.1)], count=2)],
        spring=[
            Spring(between=("ground", "left"), stiffness=30.0, damping=0.5),
            Spring(between=("left", "right"), stiffness=20.0),
            Spring(between=("pendulum[0].links[0]@0.5", "pendulum[1].links[0]@0.6"), stiffness=12.0, damping=0.3),
            Spring(
                kind="torsion", between=("pendulum[0].links[1]", "pendulum[1].links[0]"), stiffness=1.7, damping=0.2
            ),
        ],
    )


def _frame() -> Scene:
    """A modal support with two points, its damping coupled, and a spring from one of them to the ground."""
    frame = ModalSupport(
        name="frame",
        M=((2.0, 0.1), (0.1, 3.0)),
        K=((50.0, -10.0), (-10.0, 80.0)),
        D=((0.1, 0.05), (0.05, 0.3)),
        points=(((1.0, 0.5), (0.0, 0.1)), ((0.3, 1.0), (0.2, -0.1))),
    )
    links = [Rod(mass=0.6, length=0.7, stiffness=0.3), Bob(mass=0.2, length=0.4)]
    return Scene(
        gravity=9.81,
        support=frame,
        pendulum=[Pendulum(on="frame[0]", links=[Bob(mass=0.5, length=0.7)]), Pendulum(on="frame[1]", links=links)],
        spring=[Spring(between=("frame[1]", "ground"), stiffness=20.0, damping=0.4)],
    )


def _mixed() -> Scene:
    """Five supports of as many kinds, joined across them."""
    bob = Bob(mass=0.5, length=0.8)
    return Scene(
        gravity=9.81,
        support=[
            Cart(name="truck", mass=3.0, stiffness=6.0),
            Heave(name="lift", mass=2.0, stiffness=150.0, damping=0.5, position=(3.0, 0.0)),
            Tilt(name="beam", mass=2.0, inertia=0.3, stiffness=20.0, position=(1.5, 0.0)),
        ],
        pendulum=[
            Pendulum(on="truck", links=[bob, bob]),
            Pendulum(on="lift", links=[bob], position=(0.3, 0.1)),
            Pendulum(on="beam", links=[bob], position=(0.4, 0.1)),
        ],
        spring=[
            Spring(between=("truck@0.5,0.0", "beam@-0.5,0.1"), stiffness=40.0, damping=0.2),
            Spring(between=("lift", "pendulum[2].links[0]"), stiffness=10.0, damping=0.3),
        ],
    )


def _standing() -> Scene:
    """A board below a link that stands on its joint's spring, with another one hung from it."""
    links = [Bob(mass=1.0, length=0.5, stiffness=9.0, damping=0.1), Rod(mass=0.4, length=0.3, stiffness=2.0)]
    return Scene(
        gravity=9.81,
        support=Tilt(name="board", mass=6.0, inertia=1.5, stiffness=25.0, damping=0.3),
        pendulum=[Pendulum(links=links, equilibrium=("up", "down"), position=(0.2, 0.1))],
    )


STRUCTURED = {
    "springs": _springs(),
    "swings": _swings(),
    "board": _board(),
    "ship": _ship(),
    "carts": _carts(),
    "frame": _frame(),
    "mixed": _mixed(),
    "standing": _standing(),
}
"""By name; all terms of their equations act, nothing is prescribed in time."""


def pushed(scene: Scene, *forces: tuple[str, str]) -> Scene:
    """The same scene with a sine of its own on each of these points, in these directions."""
    sines = [
        SineForce(on=on, direction=way, amplitude=1.5 + k, frequency_hz=0.3 + 0.2 * k, phase_deg=20.0 * k)
        for k, (on, way) in enumerate(forces)
    ]
    return scene.replace(force=sines)


def shaken(scene: Scene) -> Scene:
    """The same scene on a ground that moves both ways by sines."""
    along = SineMotion(amplitude=0.1, frequency_hz=0.8, phase_deg=10.0)
    return scene.replace(
        ground=Ground(motion=[along, along.replace(direction="vertical", amplitude=0.05, frequency_hz=1.3)])
    )


def hoisting() -> Scene:
    """A ship whose crane hoists its load, above a second bob."""
    ropes = [Bob(mass=2.0, length=1.5, hoist=Hoist(to=0.8, begin=0.5, duration=3.0)), Bob(mass=0.5, length=0.4)]
    ship = STRUCTURED["ship"]
    return ship.replace(pendulum=[ship.pendulum[0].replace(links=ropes)])


MOVED = {
    "forces on a ship": pushed(
        STRUCTURED["ship"],
        ("ship@1.0,0.5", "horizontal"),
        ("ship", "vertical"),
        ("ship", "torque"),
        ("pendulum[0].links[0]@0.7", "vertical"),
        ("pendulum[0].links[1]", "torque"),
    ),
    "forces on a board": pushed(
        STRUCTURED["board"],
        ("board@0.4,0.1", "horizontal"),
        ("board", "torque"),
        ("pendulum[0].links[0]", "torque"),
        ("pendulum[0].links[1]@0.2", "torque"),
    ),
    "forces on swings": pushed(STRUCTURED["swings"], ("left@0.1,0.0", "horizontal"), ("right", "vertical")),
    "forces on a frame": pushed(STRUCTURED["frame"], ("frame[0]", "horizontal"), ("frame[1]", "vertical")),
    **{f"{name} on a ground that moves": shaken(STRUCTURED[name]) for name in ("swings", "board", "ship", "carts")},
    "a crane that hoists": hoisting(),
    "a crane that hoists on a ground that moves": shaken(hoisting()),
}
"""By name, of those that change in time."""
