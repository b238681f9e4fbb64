"""Event handling in scalars: kicks, contacts that stop, stick and break loose, and the effect on columns.

A segment's state are floats: the side of each joint's next kick (K), 0 where either is possible; the sign of every
contact's sliding (J), 0 if it sticks; on a rail with a coefficient the sign e of N; then of every contact its firmness,
its brief phases in a row, the time (s) of its last change, its place (rad or m) then, and the work (J) of friction
until then.

A contact that stops loses the remainder of its velocity by an impulse of friction, so that those already sticking stay
at rest; which of all begin to slide then is the complementarity problem of `nonlinear.dynamics.complementarity`.

Columns V of derivatives by the initial state become at a switch n·y = 0 that maps y to G(y)

    V₊ = DG V₋ + (f₊ − DG f₋) (n·V₋)/(n·f₋)

taken one after the other where several switch at once (saltation; [Leine2004, §7]).
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from math import inf, nan
from typing import Any

from nonlinear.dynamics import complementarity
from nonlinear.dynamics.compiling import inner, source_of
from nonlinear.dynamics.complementarity import EXCESS, UNBOUNDED, consistent, on_rail, solve_definite

SWITCH_EARLINESS = 1e-12
"""Tolerance: rad by which a kick, or natural velocity by which a stop, may come early to coincide with another."""
CHATTER_PHASE = 1e-7
"""Tolerance: over √(l/g), phases shorter than that, of which four in a row are chatter."""
CHATTER_EXCESS = 1e-6
"""Tolerance: excess over its limit by which a contact breaks loose after chatter, ten times more after each phase."""
NAN, INF, NOTHING = nan, inf, (0.0,)
WHERE = "def where(x, a, b):\n return a if x > 0 else b\n"
TEXTS = "sticking", "friction", "responses", "kick", "kicked"


@dataclass(frozen=True)
class Places:
    """Where numbers stand: the size of y and its half, pairs of coordinates of K kicks and J contacts, and the rest.

    `e`, `firm`, `brief`, `since`, `turned` and `work` are places in the state, `told` numbers of it for messages;
    `limit` is a place among the numbers of a member, which end with √(g/l) (rad/s) after those.
    """

    size: int
    half: int
    K: int
    J: int
    kicks: tuple[tuple[int, int], ...]
    contacts: tuple[tuple[int, int], ...]
    presses: bool
    input_count: int

    @cached_property
    def e(self) -> int:
        """The place of the sign of N."""
        return self.K + self.J

    @cached_property
    def firm(self) -> int:
        """The place of the first firmness."""
        return self.e + self.presses

    @cached_property
    def state_count(self) -> int:
        """How many numbers of the state enter texts."""
        return self.firm + self.J

    @property
    def work(self) -> int:
        """The place of the work (J) of the first contact."""
        return self.state_count + 3 * self.J

    @property
    def length(self) -> int:
        """How many numbers a state has."""
        return self.state_count + 4 * self.J


def changing(at: Places, texts: dict[str, Callable[..., Any]]) -> tuple[Callable[..., Any], ...]:  # noqa: PLR0915
    """The functions `begin`, `due` and `change` of one segment, from the texts (c, y, u, v) of its form.

    begin(t, y, last, state, numbers, c, u, events) fills the state of a segment that begins at y after the impulses
    `last` (K,); due(y, f, state, numbers) is the kick that is due there at once, at its angle on the way out, else −1;
    change(t, j, y, f, state, numbers, c, u, V, events) is y after switch j, in lists, the state and the columns V (k,
    size) being changed in place; a j beyond all switches reselects the sticking contacts, as inputs have jumped to u.
    c are the constants of the texts. Events are appended as (time, switch, a, b): impulse and energy of a kick; 1
    where a contact begins to stick, 0 if it ends.
    """
    size, half, K, J, presses, input_count = at.size, at.half, at.K, at.J, at.presses, at.input_count
    kicks, contacts, E, F, B = at.kicks, at.contacts, at.e, at.firm, at.state_count
    T, P, W, LIMIT, RATE = B + J, B + 2 * J, B + 3 * J, 3 * K, 3 * K + J
    functions: list[Callable[..., Any]] = [texts.get(name, _none) for name in TEXTS]
    sticking, friction, responses, kick, kicked = functions

    def relative(x: Any, first: int, pair: Any) -> Any:
        return x[first + pair[0]] - x[first + pair[1]] if pair[1] >= 0 else x[first + pair[0]]

    def inputs(state: Any, numbers: Any) -> Any:
        u = [-state[K + i] * numbers[LIMIT + i] for i in range(J)]
        if presses:
            u[0] = u[0] * state[E]
        return u + [1.0 - state[K + i] * state[K + i] for i in range(J)]

    def answers(y: Any, c: Any, u: Any) -> Any:
        """Effects of unit friction, G (J J,), and accelerations a (J,) at contacts; columns, and N with its own."""
        answer = responses(c, y, u + [0.0] * (2 * J), NOTHING)
        columns = answer[size : size + half * J]
        a = [relative(answer, half, pair) for pair in contacts]
        G = [0.0] * 0
        for below, above in contacts:
            for k in range(J):
                G.append(columns[below * J + k] - (columns[above * J + k] if above >= 0 else 0.0))
        return a, G, columns, answer[size + half * J :]

    def settle(
        t: Any, y: Any, signs: Any, was: Any, state: Any, numbers: Any, c: Any, u: Any, is_firm: Any, events: Any
    ) -> Any:
        a, G, _, normal = answers(y, c, u)
        limit = [*numbers[LIMIT : LIMIT + J]]
        if presses:
            tau, new_signs, state[E] = on_rail(a, G, limit, signs, normal, J)
        else:
            tau, new_signs = consistent(a, G, limit, signs, J)
        if len(tau) < J:
            state[K] = NAN
            return
        for i in range(J):
            sign, place = 0.0 if is_firm[i] else new_signs[i], relative(y, 0, contacts[i])
            if was[i] != 0:
                if not (presses and i == 0):
                    state[W + i] -= limit[i] * abs(place - state[P + i])
                state[P + i] = place
            if (was[i] == 0) != (sign == 0):
                events.append((t, float(2 * K + i), 1.0 if sign == 0 else 0.0, 0.0))
            if sign != was[i]:
                state[T + i] = t
            state[K + i] = sign

    def halt(y: Any, resting: Any, columns: Any, G: Any) -> None:
        """Stop these contacts by a friction impulse."""
        speed = [relative(y, half, contacts[i]) for i in resting]
        push = solve_definite([G[i * J + k] for i in resting for k in resting], speed, len(resting))
        for i in range(half):
            for k in range(len(resting)):
                y[half + i] -= columns[i * J + resting[k]] * push[k]

    def level(y: Any, state: Any) -> None:
        """No relative velocity at contacts that stick, each where it came to rest."""
        for i in range(J):
            if state[K + i] == 0:
                below, above = contacts[i]
                y[below] = state[P + i] + (y[above] if above >= 0 else 0.0)
                y[half + below] = y[half + above] if above >= 0 else 0.0

    def at_limit(i: Any, tau: Any, state: Any, numbers: Any) -> Any:
        """Whether a contact that sticks is at its limit to rounding: it breaks loose with one that does."""
        limit = numbers[LIMIT + i] * (abs(tau[J]) if presses and i == 0 else 1.0)
        return abs(tau[i]) >= limit * (1.0 + state[F + i]) * (1.0 - EXCESS)

    def slide(t: Any, j: Any, y: Any, f: Any, state: Any, numbers: Any, c: Any, u: Any, V: Any, events: Any) -> Any:
        after, was = [*y], [*state[K : K + J]]
        stopping = [False] * J
        for i in range(J):
            speed, slope = relative(y, half, contacts[i]) * was[i], relative(f, half, contacts[i]) * was[i]
            stopping[i] = was[i] != 0 and (i == j or (speed <= numbers[RATE] * SWITCH_EARLINESS and slope < 0))
        stops = was[j] != 0
        resting = [i for i in range(J) if stopping[i] or was[i] == 0]
        _, G, columns, _ = answers(y, c, u)
        halt(after, resting, columns, G)
        new_signs, loose = [0.0 if stopping[i] else was[i] for i in range(J)], [False] * J
        if not stops:
            tau = friction(c, after, u + inputs(state, numbers), NOTHING)
            loose = [i == j or (was[i] == 0 and at_limit(i, tau, state, numbers)) for i in range(J)]
            new_signs = [(-1.0 if tau[i] > 0 else 1.0) if loose[i] else new_signs[i] for i in range(J)]
        for i in range(J):
            if stopping[i] or loose[i]:
                brief = (t - state[T + i]) * numbers[RATE] < CHATTER_PHASE
                state[B + i] = state[B + i] + 1 if brief else 0.0
                state[F + i] = CHATTER_EXCESS * 10.0 ** (state[B + i] - 4.0) if state[B + i] >= 4.0 else 0.0
                state[T + i] = t
        is_firm = [(stopping[i] or loose[i]) and state[F + i] > 0 for i in range(J)]
        settle(t, after, new_signs, was, state, numbers, c, u, is_firm, events)
        level(after, state)
        if len(V) > 0 and stops:
            g, mid_state = [*f], [*state]
            for i in range(J):
                mid_state[K + i] = was[i]
            order = [j] + [i for i in range(J) if stopping[i] and i != j]
            for i in order:
                mid_state[K + i] = state[K + i]
                g2 = sticking(
                    c, after, u + inputs(state if i == order[len(order) - 1] else mid_state, numbers), NOTHING
                )
                for n in range(len(V)):
                    dt = -relative(V[n], half, contacts[i]) / relative(g, half, contacts[i])
                    for m in range(size):
                        V[n][m] += (g[m] - g2[m]) * dt
                g = g2
            for n in range(len(V)):
                for i in range(J):
                    if state[K + i] == 0:
                        below, above = contacts[i]
                        V[n][half + below] = V[n][half + above] if above >= 0 else 0.0
        return after

    def strike(t: Any, j: Any, y: Any, f: Any, state: Any, numbers: Any, c: Any, u: Any, V: Any, events: Any) -> Any:
        pushes, first = [0.0] * K, j
        for i in range(K):
            gamma, speed = relative(y, 0, kicks[i]) - numbers[i], relative(f, 0, kicks[i])
            for side in [1.0, -1.0]:
                is_due = side * gamma - numbers[K + i] > -SWITCH_EARLINESS and side * speed > 0 and state[i] * side >= 0
                if is_due or j == i + (0 if side > 0 else K):
                    pushes[i] += side * numbers[2 * K + i]
        acting = pushes + [*state[K:B]] + [*numbers[:RATE]] + [0.0] * input_count
        all_inputs = u + inputs(state, numbers)
        after = kick(c, y, all_inputs, [0.0] * size + acting)
        for i in range(K):
            if pushes[i] != 0:
                state[i] = -1.0 if pushes[i] > 0 else 1.0
                energy = pushes[i] * (relative(y, half, kicks[i]) + relative(after, half, kicks[i])) / 2
                events.append((t, float(i), pushes[i], energy))
        if J > 0:
            was, signs = [*state[K : K + J]], [0.0] * J
            for i in range(J):
                moving = relative(after, half, contacts[i])
                signs[i] = 1.0 if moving > 0 else -1.0 if moving < 0 else 0.0
                state[B + i], state[F + i] = 0.0, 0.0
            settle(t, after, signs, was, state, numbers, c, u, [False] * J, events)
        if len(V) > 0:
            now, z, g = u + inputs(state, numbers), [*y], [*f]
            for i in [first % K] + [i for i in range(K) if pushes[i] != 0 and i != first % K]:
                single_push = [pushes[k] if k == i else 0.0 for k in range(K)] + acting[K:]
                z2 = kick(c, z, all_inputs, [0.0] * size + single_push)
                g2 = sticking(c, z2, now, NOTHING)
                for n in range(len(V)):
                    dt = -relative(V[n], 0, kicks[i]) / relative(g, 0, kicks[i])
                    columns = kicked(c, z, all_inputs, [V[n][m] + g[m] * dt for m in range(size)] + single_push)
                    for m in range(size):
                        V[n][m] = columns[size + m] - g2[m] * dt
                z, g = z2, g2
        return after

    def change(t: Any, j: Any, y: Any, f: Any, state: Any, numbers: Any, c: Any, u: Any, V: Any, events: Any) -> Any:
        if K > 0 and j < 2 * K:
            return strike(t, j, y, f, state, numbers, c, u, V, events)
        if J > 0 and j < 2 * K + J:
            return slide(t, j - 2 * K, y, f, state, numbers, c, u, V, events)
        if presses and j == 2 * K + J:
            state[E] = -state[E]
        elif J > 0:
            was = [*state[K : K + J]]
            settle(t, y, was, was, state, numbers, c, u, [False] * J, events)
        return [*y]

    def begin(t: Any, y: Any, last: Any, state: Any, numbers: Any, c: Any, u: Any, events: Any) -> Any:
        for i in range(K):
            gamma = relative(y, 0, kicks[i]) - numbers[i]
            aside = gamma if abs(gamma) > numbers[K + i] + SWITCH_EARLINESS else last[i]
            state[i] = -1.0 if aside > 0 else 1.0 if aside < 0 else 0.0
        if presses:
            state[E] = 1.0
        if J > 0:
            signs, slides = [0.0] * J, [1.0] * J
            for i in range(J):
                speed = relative(y, half, contacts[i])
                signs[i] = 1.0 if speed > 0 else -1.0 if speed < 0 else 0.0
                state[T + i], state[P + i] = -INF, relative(y, 0, contacts[i])
            settle(t, y, signs, slides, state, numbers, c, u, [False] * J, events)

    def due(y: Any, f: Any, state: Any, numbers: Any) -> Any:
        for i in range(K):
            for side in [1.0, -1.0]:
                gamma = side * (relative(y, 0, kicks[i]) - numbers[i]) - numbers[K + i]
                speed, slope = side * relative(y, half, kicks[i]), side * relative(f, half, kicks[i])
                if gamma == 0 and state[i] * side >= 0 and (speed > 0 or (speed == 0 and slope > 0)):
                    return i if side > 0 else K + i
        return -1

    return begin, due, change


def _none(c: Any, y: Any, u: Any, v: Any) -> Any:
    return [0.0]


def names_in(at: Places) -> dict[str, Any]:
    """The globals of the functions of `changing`: constants, and where numbers stand."""
    J, K, B = at.J, at.K, at.state_count
    numbers: dict[str, Any] = {
        "SWITCH_EARLINESS": SWITCH_EARLINESS,
        "CHATTER_PHASE": CHATTER_PHASE,
        "CHATTER_EXCESS": CHATTER_EXCESS,
    }
    numbers |= {"EXCESS": EXCESS, "UNBOUNDED": UNBOUNDED}
    numbers |= {"size": at.size, "half": at.half, "K": K, "J": J, "presses": at.presses, "input_count": at.input_count}
    numbers |= {"kicks": at.kicks or ((0, -1),), "contacts": at.contacts or ((0, -1),), "E": at.e, "F": at.firm}
    numbers |= {"B": B, "T": B + J, "P": B + 2 * J, "W": B + 3 * J, "LIMIT": 3 * K, "RATE": 3 * K + J}
    return numbers


def _complementarity() -> list[str]:
    return [source_of(function) for function in vars(complementarity).values() if inspect.isfunction(function)]


def switching_source() -> str:
    """The functions of `changing`, and those that they call, as a text of Python; their names are in `names_in`."""
    return "\n".join((*_complementarity(), inner(changing, "part").replace("@part\n", "")))


def compiled_source(at: Places, texts: dict[str, str]) -> str:
    """The functions of `changing` as a text for numba, which has the decorator `part`; these are sources of texts.

    All arguments but the columns, (k, size), are lists; `events` is one of tuples of four floats.
    """
    head = [
        "from math import atan as arctan, cos, exp, inf as INF, log, nan as NAN, sin, sqrt, tanh",
        "from typing import Any",
        "NOTHING = (0.0,)",
    ]
    head += [*(f"{name} = {value!r}" for name, value in names_in(at).items())]
    none = "def {}(c, y, u, v):\n return [0.0]\n"
    sources = [f"@part\n{texts.get(name, none.format(name))}" for name in TEXTS]
    sources += [f"@part\n{source}" for source in _complementarity()]
    return "\n".join((*head, f"@part\n{WHERE}", *sources, inner(changing, "part"))) + "\n"
