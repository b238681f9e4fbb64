"""The step loop of a module for numba: members in WIDTH lanes, without branches in vectorized code.

The code here is the same for every form of scene: `nonlinear.integration.kernels` writes it into a module after the
sizes and the texts of a form, of which these alone are compiled with sums in any order: decisions keep to the
arithmetic that Python has.  A lane takes the steps that it would take alone, and ends them where a switch passes, as
in `nonlinear.integration.lanes`.  Steps in which something happens that is measured go into a buffer, to be examined
in NumPy.

Of a lane `front` holds the TIME and the STEP to try (s), whether the last one was REFUSED, whether it is FRESH, with
rates yet to be found, the sample DUE, the LARGEST angle (rad), ERROR (rad) and HORIZON (s), and how often each link has
TURNED. What belongs to switches are constants d of their texts, numbers a, a `state`, what next to y their values s
take, values and rates V of these (5, 2 N, WIDTH) at the looks of a step, the one that is sought, `aim`, and the one
that is due, `next`, −1 for none; the bracket low, high, and lengths (s) tried and usual.
"""

from __future__ import annotations

from math import floor, inf, log, pi, sqrt, tau
from typing import Any

from numpy import isfinite, spacing, zeros

from nonlinear.integration.lanes import SWITCHES_AT_ONCE
from nonlinear.integration.meeting import AGAIN, MET, PASSING_SHARE, STANDS
from nonlinear.integration.method import LOOKS, STAGES, STEP_RATIO_MAX, STEP_RATIO_MIN, STEP_SAFETY
from nonlinear.integration.steppers import BREAK_ULPS, SHORTEST_STEP
from nonlinear.integration.watches import EPSILON, ERROR_KNOWN_MAX, NEIGHBOUR_DISTANCE

WIDTH = 16
"""Cost: lanes that take turns, so that loops over them become vectors (benchmarks/ensembles.py)."""
FRONT = ["TIME", "STEP", "REFUSED", "FRESH", "DUE", "LARGEST", "ERROR", "HORIZON", "TURNED"]
TIME, STEP, REFUSED, FRESH, DUE, LARGEST, ERROR, HORIZON, TURNED = range(len(FRONT))
"""Rows of `front`; that of the first link, TURNED, is the number of those before."""
BEGINS, LANDS = range(2, 4)
"""Of a lane that is fresh: its member has just come; it has come to a break."""
SHORT, INFINITE, JAMMED = range(1, 4)
"""Why a member failed."""
CLOCK, TABLES = range(1, 3)
"""The inputs of a scene: the time, or polynomials of it."""
SIZES = ["D", "SIZE", "HALF", "FIRST", "CONSTANTS", "N", "M", "TOLD", "HELD", "TIMED", "DRIVEN"]
SIZES += ["KICKS", "PRESSES"]
"""Numbers of a form: lengths of y in all, of a motion, of its half and before its links; of c; switches, their state,
and what of it enters texts; inputs of contacts, and those before these; what drives it; kicked joints; whether the
friction of the rail has a coefficient."""


def looping(
    attempt: Any,
    rates: Any,
    values: Any,
    begin: Any,
    due: Any,
    change: Any,
    inputs: Any,
    may_pass: Any,
    meet: Any,
    **of: int,
) -> Any:
    """The function `run` with the texts of a form, and its SIZES; not called here, but written into modules."""
    D, SIZE, HALF, FIRST, CONSTANTS, N, M, TOLD, HELD, TIMED, DRIVEN, KICKS, PRESSES = (of[name] for name in SIZES)

    def driven(part: Any, h: Any, front: Any, tables: Any, u: Any, s: Any) -> None:
        if DRIVEN == CLOCK:
            for k in range(WIDTH):
                u[0, k] = front[TIME, k] + part * h[k]
        if DRIVEN == TABLES:
            first, knots, origins, coefficients, periods = tables
            for k in range(WIDTH):
                clear = BREAK_ULPS * spacing(front[TIME, k] + h[k])
                time = max(min(front[TIME, k] + part * h[k], front[TIME, k] + h[k] - clear), front[TIME, k] + clear)
                for j in range(len(periods)):
                    t = time - floor(time / periods[j]) * periods[j] if isfinite(periods[j]) else time
                    low, high = first[j], first[j + 1] - 1
                    while low < high:
                        middle = (low + high) // 2
                        if knots[middle] <= t:
                            low = middle + 1
                        else:
                            high = middle
                    since, value, rate = t - origins[low], 0.0, 0.0
                    for power in range(coefficients.shape[1]):
                        rate = rate * since + value
                        value = value * since + coefficients[low, power]
                    u[j, k] = value
                    if N > 0:
                        s[len(s) - TIMED + j, k] = rate

    def look(y: Any, f: Any, u: Any, s: Any, d: Any, V: Any) -> None:
        for i in range(SIZE):
            for k in range(WIDTH):
                s[i, k] = f[i, k]
        values(y, u, s, d, V)

    def load(
        k: Any, member: Any, task: Any, front: Any, y: Any, c: Any, rel: Any, ab: Any, sc: Any, loc: Any, v: Any
    ) -> None:
        starts, constants_of, relative, absolute, first, ends, longest, scale, local, _ = task
        for i in range(D):
            y[i, k] = starts[i, member]
            ab[i, k] = absolute[i, member]
            sc[i, k] = scale[i, member % scale.shape[1]]
        for i in range(CONSTANTS):
            c[i, k] = constants_of[i, member % constants_of.shape[1]]
        rel[k], loc[k] = relative[member], local[member]
        for i in range(len(front)):
            front[i, k] = 0.0
        front[STEP, k], front[FRESH, k], front[HORIZON, k] = min(first[member], longest, ends[0]), BEGINS, inf
        for i in range(2 * HALF):
            v[i, k] = 1.0 / sqrt(2.0 * HALF)
        for i in range(FIRST, HALF):
            front[LARGEST, k] = max(front[LARGEST, k], abs(y[i, k]))

    def reach(k: Any, i: Any, y: Any, z: Any, K: Any, h: Any) -> Any:
        low, high = min(y[i, k], z[i, k]), max(y[i, k], z[i, k])
        slow, fast = K[0, i, k], K[0, i, k]
        for j in range(1, STAGES + 1):
            slow, fast = min(slow, K[j, i, k]), max(fast, K[j, i, k])
        if slow < 0.0 and fast > 0.0:
            excess = 0.5 * h * max(-slow, fast)
            return low - excess, high + excess
        return low, high

    def happens(k: Any, y: Any, z: Any, K: Any, h: Any, front: Any, times: Any, wants: Any, level: Any) -> Any:
        waiting = int(front[DUE, k])
        if wants[0] and waiting < len(times) and times[waiting] <= front[TIME, k] + h:
            return True
        for i in range(FIRST, HALF):
            turns = wants[1] and front[TURNED + i - FIRST, k] < 2.0
            if turns or wants[2]:
                low, high = reach(k, i, y, z, K, h)
                if turns and floor((low - pi) / tau) != floor((high - pi) / tau):
                    return True
                if wants[2] and max(-low, high) > max(front[LARGEST, k], abs(z[i, k])):
                    return True
        if wants[3]:
            low, high = reach(k, wants[4], y, z, K, h)
            if wants[4] < FIRST:
                return (low >= level) != (high >= level)
            return floor((low - level) / tau) != floor((high - level) / tau)
        return False

    def grown(z: Any, h: Any, g: Any, K: Any, sc: Any, v: Any, w: Any) -> None:
        for i in range(HALF):
            for k in range(WIDTH):
                faster = v[HALF + i, k] * sc[HALF + i, k] + h[k] * (
                    (g[HALF + i, k] - K[STAGES, HALF + i, k]) / NEIGHBOUR_DISTANCE
                )
                w[HALF + i, k] = faster / sc[HALF + i, k]
                w[i, k] = v[i, k] + h[k] * faster / sc[i, k]
        for k in range(WIDTH):
            total = 0.0
            for i in range(2 * HALF):
                total += w[i, k] * w[i, k]
            g[0, k] = sqrt(total)

    def apply_switch(k: Any, member: Any, front: Any, y: Any, f: Any, u: Any, switching: Any) -> Any:
        constants_of, numbers, d, a, state, s, _, aim, following, low, high, _, usual, _ = switching
        begins, t = front[FRESH, k] == BEGINS, front[TIME, k]
        if begins:
            for i in range(len(d)):
                d[i, k] = constants_of[i, member % constants_of.shape[1]]
            for i in range(len(a)):
                a[i, k] = numbers[i, member % numbers.shape[1]]
            for i in range(len(a) - 1):
                s[SIZE + TOLD + i, k] = a[i, k]
            if DRIVEN == CLOCK:
                s[len(s) - 1, k] = 1.0
            aim[k], following[k], low[k], high[k], usual[k] = -1, -1, 0.0, inf, front[STEP, k]
        parameters, constants = [a[i, k] for i in range(len(a))], [d[i, k] for i in range(len(d))]
        time_inputs = [u[i, k] for i in range(TIMED)]
        now, slope = [y[i, k] for i in range(SIZE)], [f[i, k] for i in range(SIZE)]
        state_values, events = [0.0 if begins else state[i, k] for i in range(M)], [(0.0, 0.0, 0.0, 0.0)]
        if begins:
            begin(t, now, [0.0] * len(parameters), state_values, parameters, constants, time_inputs, events)
        else:
            columns = zeros((D // SIZE - 1, SIZE))
            for n in range(len(columns)):
                for i in range(SIZE):
                    columns[n, i] = y[(n + 1) * SIZE + i, k]
            now = change(t, following[k], now, slope, state_values, parameters, constants, time_inputs, columns, events)
            for i in range(SIZE):
                y[i, k] = now[i]
            for n in range(len(columns)):
                for i in range(SIZE):
                    y[(n + 1) * SIZE + i, k] = columns[n, i]
        for i in range(M):
            state[i, k] = state_values[i]
        for i in range(TOLD):
            s[SIZE + i, k] = state_values[i]
        acting = inputs(state_values, parameters)
        for i in range(HELD):
            u[TIMED + i, k] = acting[i]
        return HELD == 0 or state_values[KICKS] == state_values[KICKS]

    def passes(k: Any, front: Any, y: Any, f: Any, switching: Any) -> Any:
        _, _, _, a, state, _, V, _, _, _, _, _, _, _ = switching
        if front[FRESH, k] == BEGINS:
            now, slope = [y[i, k] for i in range(SIZE)], [f[i, k] for i in range(SIZE)]
            return due(now, slope, [state[i, k] for i in range(M)], [a[i, k] for i in range(len(a))])
        switch, largest = -1, 0.0
        for j in range(N):
            if V[0, j, k] > 0 and front[FRESH, k] == LANDS:
                return N
            if V[0, j, k] > largest and V[0, N + j, k] > 0:
                switch, largest = j, V[0, j, k]
        return switch

    def renew(lanes: Any, tables: Any, results: Any, switching: Any) -> None:
        members, front, y, _, K, c, _, _, _, _, _, _, g, h, _, _, u = lanes
        _, _, d, _, _, s, V, _, following, _, _, _, _, _ = switching
        for _ in range(SWITCHES_AT_ONCE):
            fresh = False
            for k in range(WIDTH):
                fresh = fresh or front[FRESH, k] > 0.0
            if not fresh:
                return
            driven(0.0, h, front, tables, u, s)
            if N > 0:
                for k in range(WIDTH):
                    changes = front[FRESH, k] == BEGINS or following[k] >= 0
                    if changes and not apply_switch(k, members[k], front, y, K[0], u, switching):
                        fail(k, JAMMED, lanes, results)
            rates(y, u, s, c, g)
            for k in range(WIDTH):
                if front[FRESH, k] > 0.0:
                    for i in range(D):
                        K[0, i, k] = g[i, k]
            if N > 0:
                look(y, K[0], u, s, d, V[0])
            for k in range(WIDTH):
                if front[FRESH, k] > 0.0:
                    if N > 0:
                        following[k] = passes(k, front, y, K[0], switching)
                    front[FRESH, k] = 1.0 if N > 0 and following[k] >= 0 else 0.0
        for k in range(WIDTH):
            front[FRESH, k] = 0.0
            if N > 0:
                following[k] = -1

    def fail(k: Any, why: Any, lanes: Any, results: Any) -> None:
        members, front, y, _, _, _, _, _, _, _, _, _, _, _, _, _, _ = lanes
        out, _, horizon, _, _, status = results
        member = members[k]
        status[member], horizon[member] = why, front[TIME, k]
        for i in range(D):
            out[i, member] = y[i, k]
        members[k], front[STEP, k], front[FRESH, k] = -1, 0.0, 0.0

    def run(
        task: Any, times: Any, wants: Any, level: Any, counts: Any, lanes: Any, results: Any, kept: Any, switching: Any
    ) -> Any:
        members, front, y, z, K, c, rel, ab, sc, loc, v, w, g, h, err, ok, u = lanes
        out, error, horizon, gain, largest, _ = results
        which, marks, before, after, stages, contact_inputs = kept
        ends, longest, tables, size = task[5], task[6], task[9], task[0].shape[1]
        _, _, d, _, state, s, V, aim, following, low, high, next_length, usual, final = switching
        end = ends[len(ends) - 1]
        step_count, room = 0, len(which) - WIDTH
        while step_count <= room:
            renew(lanes, tables, results, switching)
            came, busy = False, False
            for k in range(WIDTH):
                if members[k] >= 0 and front[TIME, k] >= end - BREAK_ULPS * spacing(end):
                    member = members[k]
                    error[member], horizon[member] = front[ERROR, k], front[HORIZON, k]
                    for i in range(D):
                        out[i, member] = y[i, k]
                    for i in range(M):
                        final[i, member] = state[i, k]
                    members[k], front[STEP, k] = -1, 0.0
                if members[k] < 0 and counts[0] < size:
                    members[k], came = counts[0], True
                    load(k, counts[0], task, front, y, c, rel, ab, sc, loc, v)
                    counts[0] += 1
                busy = busy or members[k] >= 0
                h[k] = front[STEP, k]
            if came:
                continue
            if not busy:
                return -1 - step_count
            attempt(y, h, c, K, z, front, tables, u, s, d, V, rel, ab, err)
            if wants[5]:
                for i in range(D):
                    for k in range(WIDTH):
                        w[i, k] = z[i, k]
                for i in range(2 * HALF):
                    for k in range(WIDTH):
                        w[i, k] += NEIGHBOUR_DISTANCE * v[i, k] * sc[i, k]
                driven(1.0, h, front, tables, u, s)
                rates(w, u, s, c, g)
                grown(z, h, g, K, sc, v, w)
            for k in range(WIDTH):
                ok[k] = 0.0
                if members[k] < 0:
                    continue
                member, e, answer = members[k], err[k], STANDS
                is_good = e < 1.0
                factor = STEP_SAFETY * sqrt(sqrt(sqrt(1.0 / e))) if e > 0.0 else STEP_RATIO_MAX
                factor = min(STEP_RATIO_MAX, max(STEP_RATIO_MIN, factor)) if isfinite(e) else STEP_RATIO_MIN
                if not is_good or front[REFUSED, k] == 1.0:
                    factor = min(factor, 1.0)
                front[REFUSED, k] = 0.0 if is_good else 1.0
                next_length[k], shortest = h[k] * factor, SHORTEST_STEP * spacing(front[TIME, k])
                if N > 0:
                    if not is_good:
                        aim[k], low[k], high[k] = -1, 0.0, inf
                    elif aim[k] >= 0 or may_pass(h[k], V[:, :N, k], V[:, N:, k], LOOKS):
                        answer = meet(k, h, V[:, :N, k], V[:, N:, k], LOOKS, aim, low, high, next_length, usual)
                    else:
                        usual[k] = next_length[k]
                    if aim[k] >= 0:
                        shortest = 0.0
                if not is_good or answer == AGAIN:
                    front[STEP, k] = next_length[k]
                    if not front[STEP, k] >= shortest:
                        finite = True
                        for i in range(D):
                            finite = finite and isfinite(K[0, i, k])
                        error[member], gain[member] = front[ERROR, k], front[TIME, k]
                        fail(k, SHORT if finite else INFINITE, lanes, results)
                    continue
                ok[k] = 1.0
                if N > 0 and answer == MET:
                    j = aim[k]
                    remaining = -V[len(V) - 1, j, k] / V[len(V) - 1, N + j, k]
                    if not abs(remaining) <= 2.0 * PASSING_SHARE * (usual[k] + h[k]):
                        remaining = 0.0
                    remaining = max(remaining, -h[k] / 2)
                    h[k] += remaining
                    for i in range(D):
                        z[i, k] += remaining * K[STAGES, i, k]
                    following[k], front[FRESH, k], next_length[k] = j, 1.0, usual[k]
                    aim[k], low[k], high[k] = -1, 0.0, inf
                rubs = PRESSES > 0 and u[TIMED + HELD // 2, k] == 0.0
                if rubs or happens(k, y, z, K, h[k], front, times, wants, level):
                    which[step_count], marks[0, step_count], marks[1, step_count] = member, front[TIME, k], h[k]
                    for i in range(D):
                        before[i, step_count], after[i, step_count] = y[i, k], z[i, k]
                        for j in range(STAGES + 1):
                            stages[j, i, step_count] = K[j, i, k]
                    for i in range(HELD):
                        contact_inputs[i, step_count] = u[TIMED + i, k]
                    step_count += 1
                    waiting = int(front[DUE, k])
                    while wants[0] and waiting < len(times) and times[waiting] <= front[TIME, k] + h[k]:
                        waiting += 1
                    front[DUE, k] = waiting
                    for i in range(FIRST, HALF):
                        if floor((y[i, k] - pi) / tau) != floor((z[i, k] - pi) / tau):
                            front[TURNED + i - FIRST, k] += 1.0
                if wants[2]:
                    for i in range(FIRST, HALF):
                        front[LARGEST, k] = max(front[LARGEST, k], abs(z[i, k]))
                    largest[member] = front[LARGEST, k]
                next_end, last = 0, len(ends) - 1
                while next_end < last:
                    middle = (next_end + last) // 2
                    if ends[middle] <= front[TIME, k]:
                        next_end = middle + 1
                    else:
                        last = middle
                front[TIME, k] += h[k]
                if next_end < len(ends) - 1 and front[TIME, k] >= ends[next_end] - BREAK_ULPS * spacing(ends[next_end]):
                    front[TIME, k], front[FRESH, k] = ends[next_end], LANDS
                    next_end += 1
                if front[TIME, k] >= end - BREAK_ULPS * spacing(end):
                    front[FRESH, k] = 0.0  # what is due at the end is left to the caller that continues
                    if N > 0:
                        following[k] = -1
                front[STEP, k] = min(next_length[k], longest, ends[next_end] - front[TIME, k])
                if wants[5] and isfinite(g[0, k]) and g[0, k] > 0.0:
                    largest_angle = 0.0
                    for i in range(FIRST, HALF):
                        largest_angle = max(largest_angle, abs(z[i, k]))
                    front[ERROR, k] = front[ERROR, k] * g[0, k] + max(loc[k], EPSILON / 2.0 * largest_angle)
                    for i in range(2 * HALF):
                        v[i, k] = w[i, k] / g[0, k]
                    if front[ERROR, k] > ERROR_KNOWN_MAX and front[HORIZON, k] == inf:
                        front[HORIZON, k] = front[TIME, k]
                if wants[6]:
                    total = 0.0
                    for i in range(D // 2, D):
                        total += (z[i, k] / sc[i, k]) ** 2
                    length = sqrt(total)
                    gain[member] += log(length)
                    for i in range(D // 2, D):
                        z[i, k] /= length
                        K[STAGES, i, k] /= length
            for i in range(D):
                for k in range(WIDTH):
                    y[i, k] = z[i, k] if ok[k] > 0.0 else y[i, k]
                    K[0, i, k] = K[STAGES, i, k] if ok[k] > 0.0 else K[0, i, k]
            for j in range(2 * N):
                for k in range(WIDTH):
                    V[0, j, k] = V[len(V) - 1, j, k] if ok[k] > 0.0 else V[0, j, k]
        return step_count

    return run
