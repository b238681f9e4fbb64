"""Families of modes, their splitting and beats, and both limits of the cart's mass, in words."""

from __future__ import annotations

from collections.abc import Iterator
from math import isinf

from modal.coupling.analysis import CartMode, Coupling, Family, family_name
from modal.coupling.exchange import MOST_MODES, STRONG, Transfer
from modal.report import counted, listed, percent, rad, short

MOST_LISTED, FEW = 8, 3
ROUGH = 0.1
"""Coupling strength from which first order is only a guide."""
GUIDE = " (only a guide: the coupling is strong)"
NEAR = " (only a guide: another family is near)"
SLIGHT = 1e-4
"""What is left of an energy below this share of it is not worth a number."""
ELSEWHERE = "in the JSON form"


def shown(coupling: Coupling) -> int:
    """How many of a sort are written out: a few of a crowd."""
    return MOST_LISTED if len(coupling.own.omega) <= MOST_MODES else FEW


def families(coupling: Coupling) -> Iterator[str]:
    """A sentence or more about each family."""
    every, most = coupling.families, shown(coupling)
    for index, family in enumerate(every[:most]):
        yield _family(coupling, family_name(index), family)
    if len(every) > most:
        yield f"{len(every) - most} more families, up to {rad(every[-1].omega)}, are {ELSEWHERE}."


def limits(coupling: Coupling) -> Iterator[str]:
    """Where each mode that moves the cart goes as the cart's mass goes from 0 to ∞."""
    if not coupling.on_cart:
        yield "A fixed support is the limit of an immense cart: the poles above are its frequencies [m_c → ∞]."
        return
    modes, most = coupling.cart_modes, shown(coupling)
    busiest = sorted(range(len(modes)), key=lambda number: -modes[number].participation)[:most]
    yield from (_limit(coupling, modes[number]) for number in sorted(busiest))
    if len(modes) > most:
        yield f"The {len(modes) - most} other modes that move the cart, all of them less, are {ELSEWHERE}."
    if any(family.fold > 1 for family in coupling.families):
        yield "The modes that leave the cart still do not feel its mass at all [ω = ω_r for every m_c]."
    held = ", one to 0 with the cart's spring" if coupling.dynamic.spring else ""
    yield f"As m_c → ∞ every coupling strength goes to 0 [ε_r = μ_r/m_r] and every mode to its pole{held}."


def member(coupling: Coupling, k: int) -> str:
    """A fixed-base mode by its place and its pendulum."""
    return f"fixed-base mode {coupling.own.number[k]} of {coupling.names[coupling.own.kind[k]]}"


def numbered(coupling: Coupling, omega: float) -> str:
    """Behind a frequency the number of its mode in the table, where that is known."""
    number = coupling.number(omega)
    return "" if number is None else f" (mode {number})"


def _family(coupling: Coupling, r: str, family: Family) -> str:
    who = listed([member(coupling, k) for k in family.members[:MOST_LISTED]], len(family.members))
    own = "" if coupling.on_cart else numbered(coupling, family.omega)
    head = (
        f"Family {r}, ω_{r} = {rad(family.omega)}{own} [K φ = ω² A φ]: {who}, of modal effective mass "
        f"{short(family.mass)} kg [μ_{r} = Σ (φᵀb)²/(φᵀAφ)]."
    )
    if not coupling.on_cart:
        return head
    return " ".join((head, *_moved(coupling, r, family), *_exchange(coupling, family)))


def _moved(coupling: Coupling, r: str, family: Family) -> Iterator[str]:
    """Which of a family stay and which moves the cart, and how strongly it is coupled."""
    several = family.fold > 1
    if several:
        many = counted(family.fold - 1, "combination stays", "combinations stay")
        own = numbered(coupling, family.omega)
        yield f"{many} at ω_{r} with the cart still, in antiphase{own} [Σ φᵀb = 0];"
    if family.cart_mode is None or family.splitting is None:
        yield f"{'the' if several else 'The'} one that moves the cart is lost to infinity [m_dyn(∞) = 0]."
        return
    moved, bare = coupling.cart_modes[family.cart_mode], " without dampers" if coupling.scene.has_damping else ""
    yield (
        f"{'one moves' if several else 'It moves'} the cart, at {rad(moved.omega)}"
        f"{numbered(coupling, moved.omega)} [m_dyn(ω) = 0], Δω = {short(family.splitting)} rad/s away{bare} "
        f"[ω_zero − ω_{r}]."
    )
    if isinf(family.strength):
        yield f"Nothing else resists it [m_{r} = 0]."
        return
    guess = f", which to first order gives Δω ≈ {short(family.first_order)} rad/s [½ ε_{r} ω_{r}]{_guide(family)}"
    if abs(family.strength) > STRONG:
        guess = ", too strong for first order"
    elif not family.is_first_order:
        guess = f"; m_{r} changes too much up to the zero for first order"
    yield (
        f"Coupling strength ε_{r} = {short(family.strength)} [μ_{r}/m_{r}; m_{r} = {short(family.rest)} kg is the "
        f"dynamic mass of all else at ω_{r}]{guess}."
    )


def _guide(family: Family) -> str:
    return GUIDE if abs(family.strength) > ROUGH else NEAR if family.is_rough else ""


def left(share: float) -> str:
    """A share of an energy."""
    return percent(share) if share >= SLIGHT else f"less than {percent(SLIGHT)}"


def _exchange(coupling: Coupling, family: Family) -> Iterator[str]:
    """Beats within a family."""
    if family.fold == 1 or family.splitting is None:
        return
    passed = family.exchange
    if passed is None and family.is_first_order:
        yield "Dampers drain some of its pendula faster than others: what two of them exchange is said below."
        return
    if passed is None:
        yield "The coupling is too strong, or another family too near, for beats within this one."
        return
    share, n = "", family.fold
    if not passed.lossless:
        yield from _damped_exchange(coupling, family, passed)
        return
    if len(family.members) == 1:
        share = f", of which the others hold {percent(4 * (n - 1) / n**2)} halfway [4(N − 1)/N², N = {n}]"
    yield (
        f"One pendulum set swinging alone in this mode has its energy back after {short(passed.period)} s [2π/|Δω|]"
        f"{share}; a run shorter than half of that shows only a part of the "
        f"exchange{_guide(family)}."
    )


def _damped_exchange(coupling: Coupling, family: Family, passed: Transfer) -> Iterator[str]:
    """What dampers leave of beats."""
    sigma = float(coupling.own.rate[family.members[0]])
    if sigma >= family.omega:
        yield "Joint dampers let its pendula creep back without a swing [σ ≥ ω]: there are no beats."
        return
    aside = ", its drives aside," if coupling.scene.is_driven else ""
    most = f"the others never hold more than {left(passed.most)} of the energy given"
    if not passed.beats:
        yield (
            "There are no beats: what moves the cart dies before its phase has run away from the rest "
            f"[−Re Δλ > Im Δλ]. Of one pendulum set swinging alone{aside}, {most}{_guide(family)}."
        )
        return
    yield (
        f"One pendulum set swinging alone in this mode{aside} has {left(passed.left)} of its energy again after a beat "
        f"of {short(passed.period)} s [2π/Im Δλ]: dampers take the rest, and {most}{_guide(family)}."
    )


def _limit(coupling: Coupling, mode: CartMode) -> str:
    number = coupling.number(mode.omega)
    name = "A mode that moves the cart" if number is None else f"Mode {number}"
    whose = f"of family {family_name(mode.family)}" if mode.family is not None else "of the cart on its spring"
    heavy, why = (rad(mode.heavy), "the pole below") if mode.heavy else ("0", "√(k_c/m_c)")
    return (
        f"{name}, {whose}, now at {rad(mode.omega)} with {percent(mode.participation)} of the "
        f"cart's velocity after a push [φ_x²/Σφ_x²], goes to {rad(mode.light)} with a massless cart [zero of "
        f"m_dyn − m_c] and to {heavy} with an immense one [{why}]."
    )
