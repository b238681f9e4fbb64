"""Every number of the coupling as plain mappings, units in the names."""

from __future__ import annotations

from typing import Any

from modal.coupling.analysis import CartMode, Coupling, Family
from modal.coupling.damping import Damped
from modal.coupling.exchange import EnergyExchange
from modal.coupling.families import family_name
from modal.coupling.structures import Exchanged, PendulumFamily, StructureCoupling
from modal.report import finite
from modal.scene import describe


def coupling_record(coupling: Coupling) -> dict[str, Any]:
    """The contents of the JSON form; None for an infinite or undefined number; modes are numbered as in the table."""
    dynamic = coupling.dynamic
    return {
        "scene": describe(coupling.scene),
        "total_mass_kg": dynamic.at_rest if coupling.on_cart else None,
        "cart_mass_kg": dynamic.cart if coupling.on_cart else None,
        "residual_mass_kg": dynamic.residual,
        "cart_stiffness_n_per_m": dynamic.spring,
        "sum_rule_residual": coupling.residual(),
        "families": [_family(coupling, *numbered) for numbered in enumerate(coupling.families)],
        "cart_modes": [_cart_mode(coupling, mode) for mode in coupling.cart_modes],
        "pairs": [_pair(coupling, pair) for pair in coupling.pairs],
        "damping": [_damped(coupling, mode) for mode in coupling.damped],
    }


def structure_record(coupling: StructureCoupling) -> dict[str, Any]:
    """The same of a coupling through a structure; the structure's modes are s1, s2, … over its `coordinates`."""
    structure = coupling.structure
    return {
        "scene": describe(coupling.scene),
        "coordinates": list(structure.names),
        "springs": len(structure.springs),
        "structure_modes": [
            {
                "omega_rad_per_s": mode.omega,
                "shape": mode.shape.tolist(),
                "mass": mode.mass,
                "mass_for_a_fast_push": float(fast),
            }
            for mode, fast in zip(coupling.modes, coupling.fast.tolist(), strict=True)
        ],
        "scene_modes_of_the_structure": [
            {"mode": coupling.number(omega), "omega_rad_per_s": omega, "structure_motion": motion.tolist()}
            for omega, motion in coupling.structure_modes
        ],
        "families": [_pendulum_family(coupling, *numbered) for numbered in enumerate(coupling.families)],
        "pairs": [_exchanged(coupling, pair) for pair in coupling.pairs],
        "damping": [_damped(coupling, mode) for mode in coupling.damped],
    }


def _pendulum_family(coupling: StructureCoupling, index: int, family: PendulumFamily) -> dict[str, Any]:
    return {
        "family": family_name(index),
        "omega_all_else_held_rad_per_s": family.omega,
        "members": [_member(coupling, k) for k in family.members],
        "fold": family.fold,
        "combinations_that_move_nothing_else": family.still,
        "mode_of_these": coupling.number(family.omega) if family.still else None,
        "modal_effective_mass_kg": family.mass.tolist(),
        "modes": [
            {
                "mode": coupling.number(branch.omega),
                "omega_rad_per_s": branch.omega,
                "splitting_rad_per_s": branch.splitting,
                "coupling_strength": finite(branch.strength),
                "structure_still": branch.still,
                "structure_motion": branch.motion.tolist(),
                "modal_effective_mass_kg": coupling.effective_mass(family, branch),
                "beat_period_s": coupling.beat(family, branch),
                "pattern": branch.pattern.tolist(),
            }
            for branch in family.branches
        ],
        "beat_periods_s": list(coupling.beats(family)),
        "energy_share_of_the_others": coupling.share(family),
    }


def _exchanged(coupling: StructureCoupling, pair: Exchanged) -> dict[str, Any]:
    return {
        "first": _member(coupling, pair.first),
        "second": _member(coupling, pair.second),
        "detuning_rad_per_s": pair.detuning,
        "coupling_rad_per_s": pair.coupling,
        "coupling_strength": pair.strength,
        "energy_share": pair.exchange.most,
        "beat_period_s": finite(pair.exchange.period) if pair.exchange.beats else None,
        "energy_left_after_a_beat": pair.exchange.left if pair.exchange.beats else None,
    }


def _family(coupling: Coupling, index: int, family: Family) -> dict[str, Any]:
    return {
        "family": family_name(index),
        "omega_cart_still_rad_per_s": family.omega,
        "members": [_member(coupling, k) for k in family.members],
        "fold": family.fold,
        "modal_effective_mass_kg": family.mass,
        "dynamic_mass_of_the_rest_kg": finite(family.rest),
        "coupling_strength": finite(family.strength),
        "cart_mode": None if family.cart_mode is None else coupling.number(coupling.cart_modes[family.cart_mode].omega),
        "mode_cart_still": coupling.number(family.omega) if coupling.on_cart and family.fold > 1 else None,
        "splitting_rad_per_s": family.splitting,
        "beat_period_s": family.beat,
        "energy_share_of_the_others": family.exchange.most if family.exchange else None,
        "energy_left_after_a_beat": family.exchange.left if family.exchange and family.beat else None,
    }


def _member(coupling: Coupling | StructureCoupling, k: int) -> dict[str, Any]:
    modes = coupling.fixed_base
    return {
        "pendulum": coupling.names[modes.kind[k]],
        "mode_of_the_pendulum": int(modes.number[k]),
        "copies": int(modes.count[k]),
        "modal_effective_mass_of_one_kg": float(modes.mass[k]),
    }


def _cart_mode(coupling: Coupling, mode: CartMode) -> dict[str, Any]:
    return {
        "mode": coupling.number(mode.omega),
        "omega_rad_per_s": mode.omega,
        "cart_participation": mode.participation,
        "omega_massless_cart_rad_per_s": finite(mode.light),
        "omega_immense_cart_rad_per_s": mode.heavy,
        "family": None if mode.family is None else family_name(mode.family),
    }


def _pair(coupling: Coupling, pair: EnergyExchange) -> dict[str, Any]:
    return {
        "first": _member(coupling, pair.first),
        "second": _member(coupling, pair.second),
        "detuning_rad_per_s": pair.detuning,
        "coupling_rad_per_s": pair.coupling,
        "dynamic_mass_between_kg": finite(pair.cart_mass),
        "energy_share": pair.share if pair.alone else None,
        "beat_period_s": finite(pair.period) if pair.alone and pair.exchange.beats else None,
        "energy_left_after_a_beat": pair.exchange.left if pair.alone and pair.exchange.beats else None,
    }


def _damped(coupling: Coupling | StructureCoupling, mode: Damped) -> dict[str, Any]:
    return {
        "mode": coupling.number(mode.omega),
        "omega_rad_per_s": mode.omega,
        "fold": mode.fold,
        "cart_still": mode.still,
        "pendulum": mode.kind,
        "rate_from_cart_per_s": mode.from_cart,
        "rate_from_joints_per_s": mode.from_joints,
        "rate_from_drag_per_s": mode.from_drag,
        "rate_fed_by_drives_per_s": mode.from_drives,
        "damping_ratio_first_order": mode.ratio,
        "exact_rate_per_s": None if mode.exact is None else mode.decay,
        "exact_omega_rad_per_s": None if mode.exact is None else abs(mode.exact),
        "drive_gain_per_kg_m2": mode.fed,
        "drive_threshold_n_m_s_per_rad": finite(mode.threshold),
    }
