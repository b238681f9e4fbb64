"""A magnetic joint, how long a motion stays in its well, and a format for lists: what `multipendula` has not."""

from modal.extend import Format, JointLaw, Measure, Parameter, cos, sin, sqrt


class Dipole(JointLaw):
    """A magnet in the link and one above, at a relative distance √(2 (1 + gap − cos γ)): anharmonic, with a well."""

    name = "dipole"
    parameters = (
        Parameter("strength", "N m", low=0.0, meaning="torque scale"),
        Parameter("gap", "", low=0.01, high=10.0, default=0.5, meaning="clearance of the magnets, relative"),
    )
    is_odd = True

    def torque(self, angle, rate, parameters):
        distance = 1.0 + parameters["gap"] - cos(angle)
        return -parameters["strength"] * sin(angle) / (distance * sqrt(distance))

    def potential(self, angle, parameters):
        return -2.0 * parameters["strength"] / sqrt(1.0 + parameters["gap"] - cos(angle))


class CapturedShare(Measure):
    """How much of a motion the first joint spends in the well."""

    name, words, columns = "captured", "the share of N seconds that the first link is within 30°", ("captured_share",)

    def of_motion(self, run, seconds):
        return (abs(run.motion.links[:, 0]) < 0.5235987755982988).mean()


class RowLists(Format):
    """Matrices for a program that reads lines."""

    name, extension, what = "rows", ".rows", "the matrices A, B, C and D, a line for each row"

    def write(self, model):
        rows = [f"{name} {' '.join(map(repr, row))}\n" for name in "ABCD" for row in getattr(model, name).tolist()]
        return "".join(rows).encode()
