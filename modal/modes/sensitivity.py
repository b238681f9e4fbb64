"""The sensitivity of a natural frequency to each parameter of a scene, in closed form.

The derivative of a simple eigenvalue λ, with ω = |λ|, is that of φᵀ(λ²M + λD + K)φ at constant shape φ, transposed and
not conjugated where dampers make it complex:

    φᵀ(2λM + D)φ ∂λ/∂p = −∂(2V + λ 2R + λ² 2T)/∂p,      ∂ω/∂p = Re(λ̄ ∂λ/∂p)/ω

    2T = m_c φ_x² + Σ (m_i z_i² + I_i φ_i²),      z_i = φ_x + Σ_{k<i} l_k φ_k + c_i φ_i
    2V = k_c φ_x² + Σ (m_i g h_i + k_i (φ_i − φ_{i−1})²),      h_i = Σ_{k<i} l_k φ_k² + c_i φ_i²
    2R = d_c φ_x² + Σ (d_i (φ_i − φ_{i−1})² + e_i z_i²)

with −l and −c for inverted links, d of a damper and e of drag; z_i is the horizontal displacement of the centre of
link i and h_i/2 its rise: running sums along each chain, O(n) for all parameters together.  Without dampers λ = iω, and
with φᵀMφ = 1 this is 2ω ∂ω/∂p = φᵀ(∂K/∂p − ω² ∂M/∂p)φ.  ([Fox1968]; with dampers [Andrew1993].)

A number of the scene's file may belong to many links: copies of a pendulum, and a run of equal links.  All of them
change with it, so their derivatives add up (`of_mode`). On a structure they come from the squares of which M, K and D
are sums, and their dependence on every number (`modal.modes.squares`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from decimal import Context, Decimal, localcontext
from typing import Any, NamedTuple

import numpy as np

from modal import pair
from modal.assembly import Rig
from modal.eigen import REFINED_DIGITS, TORQUE, UNCERTAIN, Digits, cart_of, chain_response
from modal.errors import ComputationError, SceneError
from modal.modes.mode import Mode
from modal.modes.modes import Modes
from modal.modes.shapes import Shape
from modal.modes.squares import CANCELLED, slopes_by_squares
from modal.report import NOTHING, Displayed, ReportTable, Summary, brief, listed, tabulated
from modal.scene import Body, Scene, refusals
from modal.scene.doors import checked
from modal.scene.number_names import number_words
from modal.scene.parameters import number_at, with_numbers
from modal.types import EPS, NEWTON_ROUNDS, Complexes, Floats

MOST_SENSITIVITIES = 200_000
"""Limit: sensitivities of one table, refused beyond as too many."""
SENSITIVITIES = (
    "Sensitivities (p/ω) ∂ω/∂p: the change of a frequency, in percent, for an increase of a number p by 1 %."
)
NO_DERIVATIVE = "growing, damped by a damping_ratio, or shared by several modes"
BY_PLACE = (
    "support: sensitivities link by link are those of pendula on a fixed support or one cart: take "
    "modal.modes.sensitivity.of_mode, which has them by places of the scene"
)


@dataclass(frozen=True, eq=False, repr=False)
class Sensitivities(Displayed):
    """∂ω/∂p of one mode; arrays (n_links,) in the order of `Shape.angles`, each entry for one link of one copy.

    mass            rad/s per kg; a rod remains a rod, so I = m l²/12 follows; the inertia of a body does not
    length          rad/s per m; a bob's c = l, a rod's c = l/2 and I = m l²/12 follow, a body's c and I do not
    centre          rad/s per m, of a centre of mass along its link, all else fixed
    inertia         rad/s per kg m², all else fixed
    rotor           rad/s per kg m², of the reflected inertia J of the rotor at a link's upper joint
    stiffness       rad/s per N m/rad, of the torsion spring at a link's upper joint
    cart_mass       rad/s per kg, 0 on a fixed support
    cart_stiffness  rad/s per N/m, 0 on a fixed support
    gravity         rad/s per m/s²
    damping         rad/s per N m s/rad, of the damper at a link's upper joint
    drag            rad/s per N s/m, of a link's linear drag
    cart_damping    rad/s per N s/m, 0 on a fixed support
    """

    mass: Floats
    length: Floats
    centre: Floats
    inertia: Floats
    rotor: Floats
    stiffness: Floats
    cart_mass: float
    cart_stiffness: float
    gravity: float
    damping: Floats
    drag: Floats
    cart_damping: float

    def _summary(self) -> Summary:
        facts = [
            ("cart mass (kg)", brief(self.cart_mass)),
            ("cart stiffness (N/m)", brief(self.cart_stiffness)),
            ("gravity (m/s²)", brief(self.gravity)),
        ]
        columns = {
            "link": np.arange(1, len(self.mass) + 1),
            "mass (kg)": self.mass,
            "length (m)": self.length,
            "centre (m)": self.centre,
            "inertia (kg m²)": self.inertia,
            "stiffness (N m/rad)": self.stiffness,
        }
        return tabulated("Sensitivities of a frequency, in rad/s per unit of each number", facts, columns)


@checked
def sensitivities(modes: Modes, number: int) -> Sensitivities:
    """Return the derivatives of the natural frequency ω = |λ| of the mode with index `number`, from 0.

    All are 0 if ω = 0. Raise ComputationError for a mode that grows, for one that a `damping_ratio` of the scene damps,
    for one beyond double precision and for a frequency that several modes share: it splits into branches, along shapes
    that depend on the parameter changed; SceneError under constant forces. Close to another frequency, or to critical
    damping, the derivative holds for changes much smaller than the gap. Raise IndexError for a mode that does not
    exist.

    12 digits of the largest p ∂ω/∂p are correct: z_i is a running sum, and comes from `centre_displacements` where that
    sum cancels.
    """
    if not -len(modes) <= number < len(modes):
        raise IndexError(f"there is no mode of index {number}: {len(modes)} modes have indices 0 to {len(modes) - 1}")
    if modes.rig.structure:
        raise SceneError([BY_PLACE])
    refuse(modes, number)
    value, shape = complex(modes.eigenvalue[number]), modes.shape(number, 0, "mass")
    if value == 0:
        zero = np.zeros(modes.scene.n_links)
        zeros = {field.name: zero if field.type == "Floats" else 0.0 for field in fields(Sensitivities)}
        return Sensitivities(**zeros)  # type: ignore[arg-type]
    links_and_angles = list(_chains_with_angles(modes, shape))
    centres = [_centres(*chain, shape.cart) for chain in links_and_angles]
    errors = [_rounding_error(*chain, shape.cart, z) for chain, z in zip(links_and_angles, centres, strict=True)]
    if sum(errors) > CANCELLED:
        centres = centre_displacements(modes.rig, value, shape)
    pairs = zip(links_and_angles, centres, strict=True)
    chains = [_of_chains(*chain, z, value, modes.scene.gravity) for chain, z in pairs]
    columns = {name: np.concatenate([chain[name].ravel() for chain in chains]) for name in chains[0]}
    cart, support = shape.cart**2, modes.rig.cart
    pencil, of_links = 2 * value, complex(columns.pop("pencil").sum())
    if value.real:
        pencil = of_links + (cart * (2 * value * support.mass + support.damping) if support else 0.0)
    factor = -value.conjugate() / abs(value) / pencil
    slopes: dict[str, Any] = {name: (factor * column).real for name, column in columns.items()}
    slopes["gravity"] = float(slopes["gravity"].sum())
    slopes["cart_mass"] = (factor * value**2 * cart).real
    slopes["cart_damping"] = (factor * value * cart).real
    return Sensitivities(**slopes, cart_stiffness=(factor * cart).real)


def refuse(modes: Modes, number: int) -> None:
    """Raise ComputationError or SceneError if a mode has no derivatives."""
    if modes.rig.leans or modes.rig.has_loops:
        raise SceneError(refusals(modes.scene, "a derivative of modes"))
    value, fold = modes.eigenvalue[number], modes.multiplicity[number]
    name = f"mode index {number} ({modes.omega[number]:.6g} rad/s)"
    if not modes.error[number] < UNCERTAIN:
        raise ComputationError(f"{name} is beyond double precision: its derivative is not available")
    if value.real > 0:
        raise ComputationError(f"{name} grows: sensitivities are for modes that swing or decay")
    if value.real and modes.scene.has_modal_damping:
        raise ComputationError(
            f"{name} has a damping_ratio of the scene, which depends on every number through the modes: give dampers"
        )
    if fold > 1:
        raise ComputationError(
            f"{name} is shared by {fold} modes: a repeated frequency splits when one link changes, so it has no "
            f"single derivative"
        )


class _Chain(NamedTuple):
    """The links of one pendulum, each (n,), with σ = ±1 for down or up, and a mask of proportional c and I."""

    mass: Floats
    length: Floats
    centre: Floats
    inertia: Floats
    rotor: Floats
    sigma: Floats
    damping: Floats
    drag: Floats
    follows: Floats


def _chains_with_angles(modes: Modes, shape: Shape) -> Iterator[tuple[_Chain, Complexes]]:
    """Every pendulum as specified in the scene, with the angles (copies, n) of its copies."""
    angles, at = shape.angles.astype(np.complex128), 0
    for pendulum, (block, column, copies) in zip(modes.scene.pendulum, modes.rig.members, strict=True):
        arrays = modes.rig.blocks[block]
        size = copies * arrays.n
        follows = [float(link.is_uniform) for link in pendulum.chain]
        numbers = (getattr(arrays, name)[:, column] for name in _Chain._fields[:-1])
        yield _Chain(*[*numbers, np.array(follows)]), angles[at : at + size].reshape(copies, arrays.n)
        at += size


def _centres(chain: _Chain, phi: Complexes, cart: complex) -> Complexes:
    """The displacement z (copies, n) of every centre of mass."""
    return cart + _sum_above(chain.sigma * chain.length * phi) + chain.sigma * chain.centre * phi


def _rounding_error(chain: _Chain, phi: Complexes, cart: complex, z: Complexes) -> float:
    """The error of the relative derivatives that is due to rounding of z, where φᵀMφ = 1."""
    m, turns = chain.mass, np.abs(phi)
    rounding = EPS * (
        abs(cart) + _sum_above((chain.length * turns).astype(np.complex128)) + np.abs(chain.centre) * turns
    )
    load = (chain.centre * m * rounding) + chain.length * _sum_below(m * rounding)
    return float(np.sum(m * np.abs(z) * rounding.real + turns * np.abs(load)))


def _of_chains(chain: _Chain, phi: Complexes, z: Complexes, value: complex, g: float) -> dict[str, Complexes]:
    """∂(2V + λ 2R + λ² 2T)/∂p of the copies of a chain, each (copies, n), including dependent quantities.

    z (copies, n) are the displacements of the centres of mass.

    `pencil` is the part of φᵀ(2λM + D)φ that each link adds.
    """
    m, l, c, I, J, sigma, d, e, follows = chain
    square, turn = value**2, phi**2
    h = _sum_above(sigma * l * turn) + sigma * c * turn
    push = (square * m + value * e) * z
    inertia = square * turn
    centre = sigma * (m * g * turn + 2 * push * phi)
    length = sigma * (g * turn * pair.masses_below(m) + 2 * phi * _sum_below(push))
    bend = np.diff(phi, axis=1, prepend=0.0) ** 2
    return {
        "mass": g * h + square * z**2 + follows * I / m * inertia,
        "length": length + follows * (c * centre + 2 * I * inertia) / l,
        "centre": centre,
        "inertia": inertia,
        "rotor": square * bend,
        "stiffness": bend,
        "gravity": m * h,
        "damping": value * bend,
        "drag": value * z**2,
        "pencil": 2 * value * (m * z**2 + I * turn + J * bend) + d * bend + e * z**2,
    }


def _sum_above(values: Complexes) -> Complexes:
    """Σ_{k<i} along the last axis."""
    return np.pad(np.cumsum(values[..., :-1], axis=-1), ((0, 0), (1, 0)))


def _sum_below(values: Complexes) -> Complexes:
    """Σ_{k>i} along the last axis."""
    return _sum_above(values[..., ::-1])[..., ::-1]


# ------------------------------------------------------------------------------------------ where sums of angles cancel


def centre_displacements(rig: Rig, value: complex, shape: Shape) -> list[Complexes]:
    """The displacement z (copies, n) of every centre of mass, for each pendulum of the file, in a simple mode.

    The frequency is refined in many digits, as the zero of 1/G for the turn G of one joint by its own torque, and the
    shape is what that torque excites there (`modal.eigen.elimination`): a centre that hardly moves keeps its digits.
    `value` is its eigenvalue in 1/s and `shape` its shape, which sets the scale of z.
    """
    angles = np.split(shape.angles, np.cumsum([copies * rig.blocks[block].n for block, _, copies in rig.members])[:-1])
    chain_angles = [
        chain.reshape(copies, rig.blocks[block].n)
        for chain, (block, _, copies) in zip(angles, rig.members, strict=True)
    ]
    member = int(np.argmax([np.abs(chain).max() for chain in chain_angles]))
    copy, link = np.unravel_index(np.abs(chain_angles[member]).argmax(), chain_angles[member].shape)
    with localcontext(Context(prec=REFINED_DIGITS)):
        centres, turns = _excite(rig, value, rig.members[member][:2], int(link), moves_cart=shape.cart != 0)
        places = []
        for chain, (block, column, copies) in zip(chain_angles, rig.members, strict=True):
            z = np.zeros((copies, chain.shape[1]), dtype=np.complex128)
            for k in range(copies):
                at = int(np.abs(chain[k]).argmax())
                if shape.cart != 0 or ((block, column) == rig.members[member][:2] and chain[k, at] != 0):
                    ratio = centres[block][:, column] / turns[block][at, column]
                    z[k] = chain[k, at] * np.array([complex(factor) for factor in ratio])
            places.append(z)
    assert places[member][copy].any() or not shape.cart
    return places


def _excite(
    rig: Rig, value: complex, kind: tuple[int, int], link: int, *, moves_cart: bool
) -> tuple[list[Any], list[Any]]:
    """Centres and angles (n, P) of every block where the torque of one link excites the mode alone."""
    numbers = Digits(np.ones(1), REFINED_DIGITS, is_real=not rig.is_damped)
    omega = numbers.number(np.array([value.imag]))
    if rig.is_damped:
        omega = omega - numbers.imaginary(numbers.number(np.array([value.real])))
    last: Any = None
    next_omega = omega * (numbers.exact(np.array([1 + Decimal(1).scaleb(-REFINED_DIGITS // 3)])))
    for _ in range(NEWTON_ROUNDS):
        numbers.omega = omega
        centres, turns, turn = _load_link(rig, kind, link, numbers, moves_cart=moves_cart)
        inverse = numbers.exact(np.array([Decimal(1)])) / turn
        if last is None:
            last, omega = (omega, inverse), next_omega
            continue
        slope = inverse - last[1]
        step = abs(complex(slope[0]))
        change = abs(complex((omega - last[0])[0]))
        has_settled = change <= 10.0 ** (20 - REFINED_DIGITS) * abs(complex(omega[0]))
        if not step or abs(complex(inverse[0])) < 1e-60 * abs(complex(last[1][0])) or has_settled:
            break
        following = omega - inverse * (omega - last[0]) / slope
        last, omega = (omega, inverse), following
    return centres, turns


def _load_link(
    rig: Rig, kind: tuple[int, int], link: int, numbers: Digits, *, moves_cart: bool
) -> tuple[list[Any], list[Any], Any]:
    """Centres (n, P) and angles with a torque on this link of every copy of a kind, and the turn of its joint (1,)."""
    loads = [[(TORQUE, link)] if block == kind[0] else [] for block in range(len(rig.blocks))]
    responses = [
        chain_response(block, load, rig.gravity, numbers) for block, load in zip(rig.blocks, loads, strict=True)
    ]
    pivot: Any = 0 * numbers.omega
    if moves_cart and rig.cart:
        counts = [numbers.number(block.count[:, None]) for block in rig.blocks]
        mass = np.sum([(count * hanging.mass).sum(0) for count, hanging in zip(counts, responses, strict=True)], axis=0)
        _, inertial, _ = cart_of(rig.cart, mass, numbers)
        pivot = inertial * counts[kind[0]][kind[1]] * responses[kind[0]].inertial[kind[1], 0]
    centres, turns = [], []
    for number, (block, hanging) in enumerate(zip(rig.blocks, responses, strict=True)):
        y, theta = (motion[:, :, 0] * pivot for motion in (hanging.joints, hanging.angles))
        if number == kind[0]:
            y[:, kind[1]] = y[:, kind[1]] + hanging.joints[:, kind[1], 1]
            theta[:, kind[1]] = theta[:, kind[1]] + hanging.angles[:, kind[1], 1]
            turn = theta[link, kind[1]] - (theta[link - 1, kind[1]] if link else 0 * numbers.omega)
        offset = numbers.number((block.sigma * block.centre)[..., None])
        centres.append((y[:-1] + offset * theta)[..., 0])
        turns.append(theta[..., 0])
    return centres, turns, turn


class Sensitivity(NamedTuple):
    """A number p of the scene, ∂ω/∂p in rad/s per unit of p, and (p/ω) ∂ω/∂p; None if it is undefined."""

    number: float
    derivative: float
    relative: float | None

    def record(self) -> dict[str, float | None]:
        """The same for JSON."""
        return {"value": self.number, "d_omega": self.derivative, "relative": self.relative}


def of_mode(modes: Modes, row: Mode) -> dict[str, Sensitivity]:
    """Return the derivatives of one mode's frequency by a cart's mass and every positive number, by place.

    Empty if it has none: for frequencies that several modes share, modes that grow or that a `damping_ratio` damps, and
    those beyond double precision.

    >>> from modal import load, natural_modes
    >>> modes = natural_modes(load("chain-1"))
    >>> {place: abs(round(one.relative, 9)) for place, one in of_mode(modes, modes[0]).items()}
    {'pendulum[0].links[0].mass': 0.0, 'pendulum[0].links[0].length': 0.5, 'gravity': 0.5}
    """
    try:
        if modes.rig.structure:
            return dict(_on_structure(modes, row.omega, modes.index_of(row)))
        places = _places(modes.scene, sensitivities(modes, modes.index_of(row)))
        return {
            path: _sensitivity(number, derivative, row.omega)
            for path, number, derivative in places
            if number or path == "support.mass"
        }
    except ComputationError:
        return {}


def _on_structure(modes: Modes, omega: float, number: int) -> Iterator[tuple[str, Sensitivity]]:
    """Those of every number above 0 that may change alone; a board that it would unbalance has none."""
    refuse(modes, number)
    phi = modes.column(modes.shape(number, 0, "mass")).astype(np.complex128)
    for place, derivative in slopes_by_squares(modes, number, phi).items():
        yield with_numbers(place), _sensitivity(number_at(modes.scene, place), derivative, omega)


def _places(scene: Scene, slopes: Sensitivities) -> Iterator[tuple[str, float, float]]:
    """Places with their numbers and derivatives."""
    at = 0
    if (cart := scene.cart) is not None:
        yield "support.mass", cart.mass, slopes.cart_mass
        yield "support.damping", cart.damping, slopes.cart_damping
        yield "support.stiffness", cart.stiffness, slopes.cart_stiffness
    for p, pendulum in enumerate(scene.pendulum):
        members = slice(at, at + pendulum.count * pendulum.n_links)
        at, first = members.stop, 0
        for i, link in enumerate(pendulum.links):
            span = slice(first, first + link.count)
            first = span.stop

            def total(values: Floats, links: slice = members, span: slice = span, n: int = pendulum.n_links) -> float:
                return float(values[links].reshape(-1, n)[:, span].sum())

            name = f"pendulum[{p}].links[{i}]"
            of_body = ("centre", "inertia") if isinstance(link, Body) else ()
            for key in ("mass", "length", *of_body, "damping", "stiffness", "drag"):
                yield f"{name}.{key}", getattr(link, key), total(getattr(slopes, key))
            reflected, gear = total(slopes.rotor), link.gear_ratio
            yield f"{name}.rotor_inertia", link.rotor_inertia, gear**2 * reflected
            if link.rotor_inertia:
                yield f"{name}.gear_ratio", gear, 2 * link.rotor_inertia * gear * reflected
            spring, damper = total(slopes.stiffness), total(slopes.damping)
            for steps, part in link.placed_laws:
                for parameter, (stiffness, damping) in part.coefficient_slopes.items():
                    path = with_numbers(("pendulum", p, "links", i, *steps, parameter))
                    yield path, part.numbers[parameter], stiffness * spring + damping * damper
    yield "gravity", scene.gravity, slopes.gravity


def _sensitivity(number: float, derivative: float, omega: float) -> Sensitivity:
    return Sensitivity(number, derivative, number / omega * derivative if omega else None)


def sensitivities_of(modes: Modes, rows: Sequence[Mode]) -> tuple[str, ReportTable, str]:
    """The relative sensitivities, a row for each number of the scene and a column for each mode, between two sentences.

    Raise ComputationError for too many.
    """
    size = len(rows) * 5 * sum(len(pendulum.links) for pendulum in modes.scene.pendulum)
    size *= modes.rig.leading if modes.rig.structure else 1
    if size > MOST_SENSITIVITIES:
        raise ComputationError(f"{size} sensitivities are too many for a table: choose fewer modes with `modes`")
    slopes_of_modes = [of_mode(modes, row) for row in rows]
    relative = [{place: slope.relative for place, slope in slopes.items()} for slopes in slopes_of_modes]
    places = list(dict.fromkeys(place for slopes in slopes_of_modes for place in slopes))
    columns = [[slopes.get(place) for slopes in relative] for place in places]
    words = ([NOTHING if value is None else f"{value:z.4f}" for value in row] for row in columns)
    cells = [[number_words(modes.scene, place), *row] for place, row in zip(places, words, strict=True)]
    headings = ["number", *(f"mode {row.number}" for row in rows)]
    lacking = [f"{row.number}" for row, slopes in zip(rows, slopes_of_modes, strict=True) if not slopes]
    which = f"mode{'s' * (len(lacking) > 1)} {listed(lacking, len(lacking))}"
    why = f"No single derivative: {which} ({NO_DERIVATIVE})." if lacking else ""
    return SENSITIVITIES, ReportTable(headings, cells), why
