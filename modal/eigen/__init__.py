"""Eigenvalues and mode shapes of a rig, by the cheapest method that keeps every digit.

In: a `Rig`.  Out: a `ModalSpectrum`, the eigenvalues in ascending order, each with the source that describes its shape.

    K φ = ω² M φ,    with dampers  (λ² M + λ D + K) φ = 0

A rig is divided into parts that move together (`components`): everything on a cart, or each chain on a fixed support.
Plain chains use the effective-mass recursion and bisection (`squares`, in floats `short`), on a cart with many
different ones the secular equation (`coupled`). All else is a structure (`structured`), without its free motions
(`free_motions`): eigenvalue counts extend to trees of springs (`trees`); closed loops and springs between links use the
factors of K and M (`product`), dampers the quadratic problem (`dense`). Start with `spectrum`, which chooses.

`elimination` is the recursion at any complex frequency, with loads, in floats or decimals.
"""

from typing import TYPE_CHECKING

from modal.lazy import lazy_attributes

if TYPE_CHECKING:
    from modal.eigen.amplitude import LIGHT, ONE_PERCENT, ModeSwing, distortion, one_percent_amplitude
    from modal.eigen.coupled import LIGHTEST, degenerate_modes
    from modal.eigen.dense import is_singular
    from modal.eigen.elimination import (
        FORCE,
        REFINED_DIGITS,
        REPLICAS,
        TORQUE,
        TURN,
        Arithmetic,
        ChainResponse,
        Digits,
        Load,
        Rounded,
        cart_of,
        chain_response,
        precise_values,
    )
    from modal.eigen.free_motions import FreeMotions
    from modal.eigen.recursion import Suspension, at_infinity
    from modal.eigen.secular import Poles, solve
    from modal.eigen.short import short_squares
    from modal.eigen.sources import (
        MOST_COORDINATES,
        UNCERTAIN,
        Details,
        largest_angle,
        noun_count,
        structured_error,
    )
    from modal.eigen.spectrum import ModalSpectrum, SpectrumPart, find_spectrum, notes
    from modal.eigen.squares import CLOSE, EVERYTHING, Limits, smallest_where, squares_of
    from modal.eigen.trees import inertial_mass


if not TYPE_CHECKING:
    __getattr__ = lazy_attributes(__name__)
