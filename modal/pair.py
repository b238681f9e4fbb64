"""Reduced inertia matrices A and b: the only module that uses masses and lengths directly.

With u_i the unit direction of link i (in the plane or in space), e_x along the rail and e_z down,

    T = ½ M x'² + x' e_x·Σ b_i u_i' + ½ Σ_ij A_ij u_i'·u_j',    V = −g Σ b_i u_i·e_z,    M = m_c + Σ m
    b_i = m_i c_i + l_i Σ_{k>i} m_k,   A_ii = I_i + m_i c_i² + l_i² Σ_{k>i} m_k,   A_ij = l_i b_j (i above j).

The functions are plain arithmetic over sequences, top link first, so that the same code works with floats, fractions,
SymPy symbols and whole arrays (one entry per pendulum).
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from numpy.typing import NDArray

Scalars = Sequence[Any] | NDArray[Any]


def proportions(kind: str, m: Any, l: Any) -> tuple[Any, Any]:
    """Centre and moment of inertia of a bob (c = l, I = 0) or a uniform rod (c = l/2, I = m l²/12).

    The centre scales with l and the inertia with m l² for every kind here; raise KeyError for another.
    """
    return PROPORTIONS[kind](m, l)


PROPORTIONS: dict[str, Callable[[Any, Any], tuple[Any, Any]]] = {
    "bob": lambda m, l: (l, 0 * m),
    "rod": lambda m, l: (l / 2, m * l**2 / 12),
}


def masses_below(mass: Scalars) -> list[Any]:
    """Σ_{k>i} m_k for every link i (kg)."""
    sums = [0 * mass[-1]]
    for m in reversed(mass[1:]):
        sums.append(sums[-1] + m)
    return sums[::-1]


def first_moments(mass: Scalars, length: Scalars, centre: Scalars) -> list[Any]:
    """b_i (kg m): K_ii = g b_i, and b_i θ_i'' is the reaction on the cart."""
    return list(map(first_moment, mass, length, centre, masses_below(mass)))


def first_moment(m: Any, l: Any, c: Any, mass_below: Any) -> Any:
    """Return b of a link with the mass `mass_below` below it, elementwise for arrays."""
    return m * c + l * mass_below


def second_moments(mass: Scalars, length: Scalars, centre: Scalars, inertia: Scalars) -> list[Any]:
    """A_ii (kg m²)."""
    return list(map(second_moment, mass, length, centre, inertia, masses_below(mass)))


def second_moment(m: Any, l: Any, c: Any, I: Any, mass_below: Any) -> Any:
    """Return A_ii of a link with the mass `mass_below` below it, elementwise for arrays."""
    return I + m * c * c + l * l * mass_below


def inertia_matrix(mass: Scalars, length: Scalars, centre: Scalars, inertia: Scalars) -> list[list[Any]]:
    """Return the full A (kg m²) as nested lists; the recursion along a chain needs only l, b and the diagonal."""
    b = first_moments(mass, length, centre)
    diagonal = second_moments(mass, length, centre, inertia)
    return [
        [*(l * b[i] for l in length[:i]), diagonal[i], *(length[i] * moment for moment in b[i + 1 :])]
        for i in range(len(b))
    ]


class Constants(NamedTuple):
    """The effect of one link on the motion of its ends: in kg, but mJ in kg² and k in N/m (`modal.eigen.recursion`).

    With s = c/l and J = I/l², a link whose upper end moves by y and lower end by y + a has T = ½ r a'² + (q + r) a' y'
    + ½ m y'²; p belongs to the lower end as r to the upper.
    """

    m: Any  # its mass
    mJ: Any  # m J (kg²), J = I/l²
    r: Any  # m s² + J
    p: Any  # m (1 − s)² + J
    q: Any  # m s (1 − s) − J
    upper: Any  # m s = r + q, the first moment about the upper end
    lower: Any  # m (1 − s) = p + q, the first moment about the lower end
    k: Any  # g b / l² (N/m)


def constants(mass: Scalars, length: Scalars, centre: Scalars, inertia: Scalars, gravity: Any = 1) -> list[Constants]:
    """The constants of every link."""
    mass_below = masses_below(mass)
    return [link_constants(*link, gravity) for link in zip(mass, length, centre, inertia, mass_below, strict=True)]


def link_constants(m: Any, l: Any, c: Any, I: Any, mass_below: Any, gravity: Any = 1) -> Constants:
    """Return the constants of a link with the mass `mass_below` below it, elementwise for arrays.

    l − c is computed before the division, so a centre next to a joint keeps every digit.
    """
    s, rest, J = c / l, (l - c) / l, I / l / l
    return Constants(
        m=m,
        mJ=m * J,
        r=m * s * s + J,
        p=m * rest * rest + J,
        q=m * s * rest - J,
        upper=m * s,
        lower=m * rest,
        k=gravity * (m * s + mass_below) / l,
    )


def standing(links: Sequence[Constants], sigma: Scalars) -> list[Constants]:
    """Return the constants in the coordinates σ_i θ_i: an inverted link (σ_i = −1) has −k, all else as if hanging."""
    return [link._replace(k=sign * link.k) for link, sign in zip(links, sigma, strict=True)]
