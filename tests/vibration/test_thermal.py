"""Thermal noise against the compliance in many digits, equipartition, published numbers, and random vibration."""

from __future__ import annotations

import json
from math import sqrt, tau
from pathlib import Path

import mpmath as mp
import numpy as np
import pytest

from modal import Bob, Cart, Pendulum, Rod, Scene, SceneError, load
from modal.assembly import dissipators_of, matrices
from modal.errors import ComputationError
from modal.modes import natural_modes, quality_factors
from modal.plotting.vibration import thermal_figure
from modal.scene.records import Spectrum
from modal.vibration import BOLTZMANN, random_response, thermal_frequencies, thermal_noise, thermal_report
from multipendula.cli import main

SUSPENSION = load("suspension")
HUNG = Scene(
    gravity=9.81,
    support=Cart(mass=10.0, stiffness=50.0, damping=3.0),
    pendulum=[
        Pendulum(links=[Bob(mass=2.0, length=1.0, damping=0.4, drag=0.2), Rod(mass=1.0, length=0.6, drag=0.1)]),
        Pendulum(links=[Bob(mass=1.5, length=0.8, damping=0.1)], count=2),
    ],
)
JOINTS = (
    SUSPENSION.replace(
        pendulum=[
            Pendulum(
                links=[Bob(mass=2.0, length=1.0, stiffness=3.0, loss=0.02), Rod(mass=1.0, length=0.5, damping=0.1)]
            )
        ]
    ),
    load("tower").replace(spring=[spring.replace(loss=0.01) for spring in load("tower").spring]),
)


def test_the_quadruple_suspension_has_the_numbers_that_are_known() -> None:
    noise = thermal_noise(SUSPENSION, 290.0)
    exact = [3.16564673e-14, 2.97071603e-20, 8.91779349e-25]
    np.testing.assert_allclose(noise.asd([1.0, 10.0, 100.0])[0], exact, rtol=2e-9)
    assert noise.places == tuple(f"pendulum[0].links[{k}].wire_loss" for k in range(3))
    np.testing.assert_allclose(noise.budget([1.0, 10.0]).sum(0), noise.psd([1.0, 10.0]), rtol=1e-15)


@pytest.mark.parametrize("frequency", [0.3, 10.0, 300.0])
def test_it_is_the_imaginary_part_of_the_compliance(frequency: float) -> None:
    """4 k_B T |Im (K − ω²M)⁻¹|/ω in 60 digits, where Im cancels, for the angles and for the end."""
    noise = thermal_noise(SUSPENSION, 290.0, ("angles", "tip_positions"))
    links = SUSPENSION.pendulum[0].links
    with mp.workdps(60):
        omega, n = mp.mpf(tau * frequency), len(links)
        A = mp.zeros(n)
        for i in range(n):
            below = [mp.mpf(link.mass) for link in links[i:]]
            A[i, i] += mp.mpf(SUSPENSION.gravity) * sum(below) * links[i].length * mp.mpc(1, links[i].wire_loss)
            for a in range(i + 1):
                for b in range(i + 1):
                    A[a, b] -= omega**2 * mp.mpf(links[i].mass) * mp.mpf(links[a].length) * mp.mpf(links[b].length)
        compliance = A**-1
        row = mp.matrix([mp.mpf(link.length) for link in links])
        each = [*(compliance[i, i] for i in range(n)), (row.T * compliance * row)[0]]
        exact = [float(4 * mp.mpf(BOLTZMANN) * 290 * abs(z.imag) / omega) for z in each]
    np.testing.assert_allclose(noise.psd([frequency])[:, 0], exact, rtol=1e-13)


@pytest.mark.parametrize(
    "scene", [HUNG, load("chain-2").replace(damping_ratio=0.05), load("tower")], ids=["cart", "ratio", "tower"]
)
def test_all_frequencies_together_are_equipartition(scene: Scene) -> None:
    """∫ S_q df = k_B T (K⁻¹)_qq for dampers at joints, carts and springs, drag, and dampers of modes."""
    noise = thermal_noise(scene, 300.0, ("angles",))
    exact = BOLTZMANN * 300.0 * np.diag(np.linalg.inv(matrices(scene).K))[-scene.n_links :]
    np.testing.assert_allclose(noise.rms(0.0, 300.0) ** 2, exact, rtol=1e-4)


@pytest.mark.parametrize("scene", JOINTS, ids=["joints", "structure"])
def test_losses_of_joints_and_springs_beside_dampers(scene: Scene) -> None:
    """4 k_B T (H Im Z Hᴴ) with dense matrices."""
    noise, M = thermal_noise(scene, 290.0, ("angles",)), matrices(scene)
    for f in (0.1, 0.9, 20.0):
        omega = tau * f
        lost = np.zeros_like(M.K)
        for dissipator in dissipators_of(scene):
            row = np.zeros(len(lost))
            row[list(dissipator.row)] = list(dissipator.row.values())
            strength = dissipator.damping * omega + dissipator.stiffness * float(
                dissipator.loss if dissipator.stiffness else 0.0
            )  # type: ignore[arg-type]
            lost += strength * np.outer(row, row)
        H = np.linalg.inv(M.K + 1j * lost - omega**2 * M.M)
        exact = -4 * BOLTZMANN * 290.0 * np.diag(H.imag)[-scene.n_links :] / omega
        np.testing.assert_allclose(noise.psd([f])[:, 0], exact, rtol=1e-9)


def test_white_noise_on_a_mode_with_a_loss_is_miles_equation() -> None:
    """Random vibration takes losses: with Q = 1/φ the RMS of one pendulum is that of a damper of the same Q."""
    scene = Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=2.0, length=0.5, wire_loss=1e-4)])])
    near = Spectrum((0.3, 1.5), (2.0, 2.0), "acceleration")
    response = random_response(scene, near, ("angles",))
    omega = sqrt(9.81 / 0.5)
    exact = sqrt(2.0 * 1e4 / (4 * omega**3 * 0.5**2))
    assert response.rms[0] == pytest.approx(exact, rel=1e-4)
    assert response.by_mode[0, 0] == pytest.approx(response.rms[0], rel=1e-9)
    assert response.white[0, 0] == pytest.approx(exact, rel=1e-7)
    assert quality_factors(natural_modes(scene)) == pytest.approx([1e4])


def test_a_scene_without_losses_growing_modes_and_forces_are_refused() -> None:
    for scene, temperature, outputs, words in (
        (load("chain-2"), 290.0, ("angles",), "nothing dissipates in this scene"),
        (SUSPENSION, 0.0, ("angles",), "temperature 0: must be above 0 K"),
        (SUSPENSION, float("nan"), ("angles",), "temperature nan: must be a finite number"),
        (SUSPENSION, 290.0, ("pivot_forces",), "outputs: thermal noise is that of positions"),
        (SUSPENSION, 290.0, ("cart_position",), "the support is fixed"),
    ):
        with pytest.raises(SceneError, match=words):
            thermal_noise(scene, temperature, outputs)
    up = Scene(gravity=9.81, pendulum=[Pendulum(links=[Bob(mass=1.0, length=1.0, damping=1.0)], equilibrium=["up"])])
    with pytest.raises(ComputationError, match="grows without being driven"):
        thermal_noise(up, 290.0)


def test_the_command_prints_draws_and_writes_it(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    psd = tmp_path / "psd.csv"
    psd.write_text("frequency_hz,displacement_psd\n0.1,1e-12\n30,1e-16\n")
    assert main(["vibration", "suspension", "--temperature", "290", "--at", "1,10", "-q"]) == 0
    text = capsys.readouterr().out
    assert "3.1656e-14" in text
    assert "loss angle of the wire of link 3 of pendulum 1" in text
    asked = ["vibration", "suspension", "--temperature", "290", "--psd", str(psd)]
    assert main([*asked, "--format", "csv", "-q"]) == 0
    head, *rows = capsys.readouterr().out.splitlines()
    assert head.split(",")[:3] == ["frequency_hz", "tip_1_thermal_m_per_sqrt_Hz", "tip_1_driven_m_per_sqrt_Hz"]
    assert main([*asked, "--format", "json", "-q"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["outputs"][0]["asd_unit"] == "(m)/sqrt(Hz)"
    assert len(printed["frequency_hz"]) == len(printed["outputs"][0]["driven_asd"]) == len(rows)
    assert printed["driven"]["outputs"][0]["rms"] > 0
    for words, told in (
        ([], "give --psd CSV, --temperature KELVIN, or both"),
        (["--psd", str(psd), "--at", "1"], "--at"),
    ):
        assert main(["vibration", "suspension", *words]) == 2
        assert told in capsys.readouterr().err


def test_a_picture_has_a_panel_for_each_output_and_a_line_for_each_place() -> None:
    noise = thermal_noise(SUSPENSION, 290.0, ("tip_positions", "angles"))
    with pytest.raises(ComputationError, match="choose at most 4"):
        thermal_figure(noise)
    figure = thermal_figure(thermal_noise(SUSPENSION, 290.0))
    (axis,) = figure.axes
    assert [line.get_label() for line in axis.lines[:2]] == [
        "thermal noise",
        "loss angle of the wire of link 1 of pendulum 1",
    ]
    assert axis.get_ylabel() == "position (m/√Hz)"
    f = thermal_frequencies(thermal_noise(SUSPENSION, 290.0), at=[1e3])
    assert f[-1] == 1e3
    other = random_response(SUSPENSION, Spectrum((0.1, 1.0), (1.0, 1.0), "acceleration"), ("angles",))
    with pytest.raises(SceneError, match="must be the same"):
        thermal_report(thermal_noise(SUSPENSION, 290.0), "text", other)


def test_the_line_of_a_sharp_mode_has_its_share_of_equipartition() -> None:
    """At Q = 3e12 all of k_B T/K but what is outside the band is within 1e-12 of the mode."""
    stiffness = 2.0 * 9.81 * 0.5
    link = Bob(mass=2.0, length=0.5, damping=sqrt(9.81 / 0.5) / 3e12 * 2.0 * 0.5**2)
    noise = thermal_noise(Scene(gravity=9.81, pendulum=[Pendulum(links=[link])]), 290.0, ("angles",))
    assert noise.rms(0.5, 1.0) == pytest.approx([sqrt(BOLTZMANN * 290.0 / stiffness)], rel=1e-11)
