"""A scene as arrays, and the matrices M, K and D about its equilibrium.

In: a `Scene`.  Out: `Rig`, arrays of pendula with equal ones counted once, and `Matrices`, written out in full.

    M q'' + D q' + K q = 0,    q = (x, θ_1, …, θ_n)

All other subpackages work on these arrays, independent of the kinds of links. Start with `arrays`; `squares` are M, K
and D as sums of squares in any arithmetic, `structure` puts them together for the supports of the pendula, a fixed
support or a cart being the simplest; `stacks` are many scenes of one form, and one short chain in floats;
`linearization` is the dense form for printing, for small problems and for tests.
"""

from typing import TYPE_CHECKING

from modal.lazy import lazy_attributes

if TYPE_CHECKING:
    from modal.assembly.arrays import ARRAYS, Block, CartNumbers, Rig, Units, masses_below, rig_of
    from modal.assembly.equilibrium import Equilibrium, equilibrium_of
    from modal.assembly.hoisting import (
        Hoisting,
        HoistInstant,
        Hoists,
        hoisting_of,
        instants,
        matrices_along,
        matrices_at,
        no_hoist,
        quadratic_drags,
    )
    from modal.assembly.linearization import (
        Arrays,
        Matrices,
        centres,
        coordinate_labels,
        differences,
        displacements,
        joints,
        matrices,
        matrices_of,
        shared_differences,
    )
    from modal.assembly.losses import (
        CART,
        Dissipator,
        LossAngles,
        dissipators_of,
        loss_angles,
        loss_at,
        losses_of,
        on_lines,
    )
    from modal.assembly.modal_damping import RatioAt, frequencies, modal_dampers, modal_factor, ratio_at
    from modal.assembly.squares import (
        DRAG,
        JOINT,
        SPRING,
        WAYS,
        WIRE,
        Columns,
        Element,
        SquareRows,
        chain_squares,
    )
    from modal.assembly.stacks import Stack, can_stack, keep_form, single, stack_scenes, vary_scene
    from modal.assembly.structure import Hanging, SpringRow, assemble_pendula, modal_supports, null_space, scene_squares


if not TYPE_CHECKING:
    __getattr__ = lazy_attributes(__name__)
