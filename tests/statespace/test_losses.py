"""Responses with loss angles against matrices in many digits, and the losses of modes against complex eigenvalues."""

from __future__ import annotations

from collections.abc import Sequence
from math import tau

import mpmath as mp
import numpy as np
import pytest
import scipy
from response_oracle import Oracle

from modal import Bob, Cart, Pendulum, Rod, Scene, SceneError, load
from modal.assembly import Dissipator, dissipators_of, loss_at, losses_of, matrices
from modal.modes import mode_losses, natural_modes, quality_factors, table
from modal.modes.dissipation import sharing
from modal.scene import LossTable, SineMotion, Spring
from modal.scene.motion import ConstantForce, Moved
from modal.statespace import frequency_response, impulse_response, state_space, to_modal_form
from modal.statespace.transfer import transfer_functions
from modal.types import Complexes, Floats

TABLE = LossTable(frequency_hz=[0.1, 1.0, 50.0], loss=[1e-3, 5e-3, 2e-2])
MIXED = Scene(
    gravity=9.80665,
    support=Cart(mass=3.0, stiffness=40.0),
    pendulum=[
        Pendulum(
            links=[Bob(mass=1.0, length=0.7, wire_loss=TABLE), Rod(mass=0.4, length=0.3, stiffness=0.5, loss=0.1)]
        ),
        Pendulum(links=[Bob(mass=1.0, length=0.7), Rod(mass=0.4, length=0.3, stiffness=0.5)]),
    ],
)
"""Two pendula that differ in their losses alone."""
FRAME = load("tower").replace(
    spring=[
        spring.replace(damping=0.0, loss=loss) for spring, loss in zip(load("tower").spring, (0.02, TABLE), strict=True)
    ]
)


class Lossy(Oracle):
    """The oracle with i k φ of every joint and wire."""

    def _ratio_dampers(self, first: int) -> mp.matrix:
        whole, self.K = self.K, self.K.apply(mp.re)
        dampers = super()._ratio_dampers(first)
        self.K = whole
        return dampers

    def response(self, inputs: list[str], outputs: list[str], omega: float) -> mp.matrix:
        with mp.workdps(self.digits):
            kept, at = self.K.copy(), int(self.cart)
            for pendulum in self.scene.pendulum:
                below = sum(mp.mpf(link.mass) for link in pendulum.links)
                for i, link in enumerate(pendulum.links):
                    angle, wire = (
                        mp.mpf(float(loss_at(loss, np.array(omega)))) for loss in (link.loss, link.wire_loss)
                    )
                    for a, b, sign in (
                        (at, at, 1),
                        *(((at - 1, at - 1, 1), (at, at - 1, -1), (at - 1, at, -1)) if i else ()),
                    ):
                        self.K[a, b] += mp.mpc(0, sign * link.stiffness * angle)
                    self.K[at, at] += mp.mpc(0, wire * mp.mpf(self.scene.gravity) * below * link.length)
                    below, at = below - link.mass, at + 1
            response = self._response(inputs, outputs, mp.mpf(omega))
            self.K = kept
            return response


def responses(scene: Scene, drive: str, read: Sequence[str], omega: Floats) -> Complexes:
    form = to_modal_form(natural_modes(scene), state_space(scene, (drive,), tuple(read)))
    return frequency_response(form, omega)[:, 0]


@pytest.mark.parametrize("drive", ["cart_force", "support_displacement"])
@pytest.mark.parametrize("damping", [0.0, 0.1])
def test_losses_are_in_the_elimination_from_the_tips(drive: str, damping: float) -> None:
    links = [tuple(link.replace(damping=damping) for link in pendulum.links) for pendulum in MIXED.pendulum]
    scene = MIXED.replace(
        pendulum=[pendulum.replace(links=chain) for pendulum, chain in zip(MIXED.pendulum, links, strict=True)]
    )
    omega = np.array([0.3, 3.9, 30.0, 3e3, 3e6])
    computed = responses(scene, drive, ("cart_position", "angles", "tip_positions"), omega)
    names = ["x", "theta_1_1", "theta_1_2", "theta_2_1", "theta_2_2", "tip_1", "tip_2"]
    oracle = Lossy(scene)
    exact = np.array([[complex(z) for z in oracle.response([drive], names, w)] for w in omega.tolist()]).T
    np.testing.assert_allclose(computed, exact, rtol=1e-12)


def test_of_the_whole_they_are_the_same() -> None:
    """A damping ratio and an input at a point are eliminated as a whole."""
    scene, omega = MIXED.replace(damping_ratio=0.01), np.array([0.3, 3.9, 300.0])
    names = ["x", "theta_1_1", "theta_1_2", "theta_2_1", "theta_2_2"]
    oracle = Lossy(scene)
    exact = np.array([[complex(z) for z in oracle.response(["cart_force"], names, w)] for w in omega.tolist()]).T
    np.testing.assert_allclose(responses(scene, "cart_force", ("cart_position", "angles"), omega), exact, rtol=1e-11)
    at_point = responses(MIXED, "force:cart", ("cart_position", "angles"), omega)
    np.testing.assert_allclose(at_point, responses(MIXED, "cart_force", ("cart_position", "angles"), omega), rtol=1e-11)


def test_transmissibility_keeps_all_digits_down_to_1e_minus_32() -> None:
    """The product of k/(k + s) over the stages, from the tip, in 40 digits."""
    scene = load("suspension")
    links, frequencies = scene.pendulum[0].links, np.array([10.0, 100.0, 1e4])
    with mp.workdps(40):
        exact = []
        for omega in (tau * frequencies).tolist():
            H, s, below = mp.mpc(1), mp.mpc(0), mp.mpf(0)
            for link in reversed(links):
                below += mp.mpf(link.mass)
                k = mp.mpf(scene.gravity) * below / mp.mpf(link.length) * mp.mpc(1, link.wire_loss)
                s -= mp.mpf(link.mass) * mp.mpf(omega) ** 2
                H, s = H * k / (k + s), k * s / (k + s)
            exact.append(complex(H))
    computed = responses(scene, "support_displacement", ("tip_positions",), tau * frequencies)[0]
    np.testing.assert_allclose(computed, exact, rtol=9e-16)
    assert abs(computed[-1]) < 1e-31


def dense(scene: Scene, omega: float) -> tuple[Floats, Complexes]:
    """M, and K with its losses at ω."""
    model = matrices(scene)
    H = np.zeros_like(model.K)
    for loss in losses_of(scene):
        row = dense_row(loss, len(H))
        H += loss.stiffness * float(loss_at(loss.loss, np.array(omega))) * np.outer(row, row)
    return model.M, model.K + 1j * H


def dense_row(dissipator: Dissipator, size: int) -> Floats:
    row = np.zeros(size)
    row[list(dissipator.row)] = list(dissipator.row.values())
    return row


def test_springs_of_structures_lose_and_their_forces_turn() -> None:
    omega = np.array([0.5, 2.2, 40.0])
    computed = responses(FRAME, "floor1_force", ("coordinates", "angles", "spring_forces"), omega)
    stiff = [spring.stiffness for spring in FRAME.spring]
    for at, w in enumerate(omega.tolist()):
        M, K = dense(FRAME, w)
        D = matrices(FRAME).D
        q = np.linalg.solve(K + 1j * w * D - w * w * M, [1.0, 0.0, 0.0])
        np.testing.assert_allclose(computed[:3, at], q, rtol=1e-12)
        angles = [float(loss_at(spring.loss, np.array(w))) for spring in FRAME.spring]
        pulls = [stiff[0] * (1 + 1j * angles[0]) * q[0], stiff[1] * (1 + 1j * angles[1]) * (q[1] - q[0])]
        np.testing.assert_allclose(np.abs(computed[3:, at]), np.abs(pulls), rtol=1e-11)


APART = MIXED.replace(
    pendulum=[
        MIXED.pendulum[0],
        Pendulum(links=[Bob(mass=1.0, length=0.3, wire_loss=0.01), MIXED.pendulum[1].links[1]]),
    ]
)


@pytest.mark.parametrize("scene", [APART, FRAME, load("suspension")], ids=["cart", "structure", "suspension"])
def test_the_loss_of_a_mode_is_the_imaginary_part_of_its_complex_eigenvalue(scene: Scene) -> None:
    small = scene.replace(
        pendulum=[
            pendulum.replace(links=[link.replace(damping=0.0) for link in pendulum.links])
            for pendulum in scene.pendulum
        ]
    )
    modes = natural_modes(small)
    for omega, loss, Q in zip(
        modes.omega.tolist(), mode_losses(modes).tolist(), quality_factors(modes).tolist(), strict=True
    ):
        M, K = dense(small, omega)
        eigen = scipy.linalg.eigvals(K, M)
        eigenvalue = eigen[np.argmin(np.abs(eigen - omega**2))]
        assert loss == pytest.approx(eigenvalue.imag / eigenvalue.real, rel=30 * loss + 1e-9, abs=1e-12)
        assert pytest.approx(1 / loss) == Q


def test_modes_closer_than_their_losses_are_told() -> None:
    """In antiphase and in phase two pendula that differ in their losses alone mix."""
    modes = natural_modes(MIXED)
    assert sharing(modes) == [4, 5]
    assert "Q of modes 4, 5 is approximate" in table(modes, list(modes), "text")
    assert "Q of modes" not in table(natural_modes(APART), list(natural_modes(APART)), "text")


def test_equal_pendula_that_lose_differently_show_the_one_that_loses_most() -> None:
    links = [Bob(mass=1.0, length=1.0, wire_loss=loss) for loss in (1e-3, 1e-5)]
    two = Scene(gravity=9.81, pendulum=[Pendulum(links=[link], count=2) for link in links])
    assert mode_losses(natural_modes(two)) == pytest.approx([1e-3])
    assert mode_losses(natural_modes(two.replace(pendulum=two.pendulum[1:]))) == pytest.approx([1e-5])
    damped = Scene(gravity=9.81, pendulum=[Pendulum(links=[links[0].replace(damping=0.2)])])
    modes = natural_modes(damped)
    assert quality_factors(modes)[0] == pytest.approx(1 / (2 * modes.damping_ratio[0] + 1e-3))


SCENES = ("tower", "ship-crane", "beam", "crane-hook")


@pytest.mark.parametrize("name", SCENES)
def test_the_rows_of_what_dissipates_make_up_the_damping_matrix(name: str) -> None:
    plain = load(name)
    links = [
        pendulum.replace(links=[link.replace(damping=0.2, drag=0.3) for link in pendulum.links])
        for pendulum in plain.pendulum
    ]
    scene = plain.replace(pendulum=links)
    scene = scene.replace(damping_ratio=0.01) if name == "crane-hook" else scene
    D = matrices(scene).D
    assembled = sum(
        dissipator.damping * np.outer(*[dense_row(dissipator, len(D))] * 2) for dissipator in dissipators_of(scene)
    )
    np.testing.assert_allclose(assembled, D, atol=1e-13 * np.abs(D).max())


def test_a_leaning_wire_loses_by_its_pull() -> None:
    """A force along the rail of tan 30° of the weight: tension over length, 1/cos² … of what holds it upright."""
    pushed = ConstantForce(on="pendulum[0].links[0]", amplitude=9.81 / np.sqrt(3.0))
    scene = Scene(gravity=9.81, force=[pushed], pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0, wire_loss=0.01)])])
    (loss,) = losses_of(scene)
    assert loss.stiffness == pytest.approx(9.81 / np.cos(np.pi / 6))
    assert mode_losses(natural_modes(scene)) == pytest.approx([0.01])


def test_models_leave_them_out_and_impulses_refuse_them() -> None:
    scene = MIXED
    form = to_modal_form(natural_modes(scene), state_space(scene, ("cart_force",), ("cart_position",)))
    plain = to_modal_form(
        natural_modes(scene.lossless), state_space(scene.lossless, ("cart_force",), ("cart_position",))
    )
    assert transfer_functions(form)[0][0].zeros.tolist() == transfer_functions(plain)[0][0].zeros.tolist()
    with pytest.raises(SceneError, match="an impulse response does not support loss angles"):
        impulse_response(form, [1.0])


def test_what_a_spring_at_a_moved_ground_passes_on() -> None:
    """A cart under a spring of complex stiffness: x = (m ω²)/(k (1 + iφ) − m ω²) of the ground's displacement."""
    scene = Scene(
        gravity=9.81,
        support=[Cart(name="table", mass=10.0), Cart(name="rig", mass=5.0)],
        spring=[
            Spring(between=["ground", "table"], stiffness=4e3, loss=0.05),
            Spring(between=["ground", "rig"], stiffness=1e3),
        ],
        pendulum=[Pendulum(on="rig", links=[Bob(mass=1.0, length=1.0)])],
    )
    omega = np.array([5.0, 20.0, 300.0])
    computed = responses(scene, "support_displacement", ("table_m",), omega)[0]
    exact = 10.0 * omega**2 / (4e3 * (1 + 0.05j) - 10.0 * omega**2)
    np.testing.assert_allclose(computed, exact, rtol=1e-12)
    moved = load("suspension").replace(support=Moved(motion=SineMotion(amplitude=0.1, frequency_hz=1.0)))
    assert moved.has_losses
