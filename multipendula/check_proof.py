"""Check a proof that each natural frequency of a scene is within the error printed beside it.

    python check_proof.py SCENE.toml TABLE.json PROOF.json

Python's standard library is all that is needed, and all that is trusted; nothing of the program
that made the table is.  The numbers of the scene, each the double nearest to what the file says,
become fractions, and these become M and K, sums of squares of small displacements:

    energy of motion = 1/2 sum m (displacement')^2,      potential energy = 1/2 sum k (extension)^2

SYLVESTER'S LAW OF INERTIA [Sylvester1852].  However K - x M is written as a sum of squares, as many
of them have a minus.  This is the number of natural frequencies whose w^2 is below x: none is where
x is far below zero, and as x grows, a sign changes at each w^2 and nowhere else, as M has no square
with a minus.  So two counts, at both ends of an interval, prove how many w^2 are in it, by + - * /
of fractions alone.  The proof says where to count.  Of many coordinates it may say with how many
bits: then each number is between two integers over 2^bits, which are rounded outwards.

With dampers, roots of the polynomial p(z) = det(z^2 M + z D + K) are counted instead, in a disc:
where one term |a_n| r^n of p(c + y) = sum a_k y^k is larger than the sum of all others, p has
exactly n roots within r of c (Rouche 1862).
"""

from __future__ import annotations

import json
import re
import sys
import tomllib
from fractions import Fraction as Q
from pathlib import Path
from typing import Any, NamedTuple

Row = dict[int, Any]  # entries of a row by the numbers of their coordinates
Known = dict[str, Any]  # keys with their defaults, None for those that must be there


class UnreadableError(ValueError):
    """What a file has that this checker does not know; nothing is proved then."""


class NotProvedError(Exception):
    """Why a row is not proved."""


# ------------------------------------------------------------------------------- sums of squares


class Sums:
    """What moves together, `times` over: M, K and D as sums of squares of rows."""

    def __init__(self, times: int) -> None:
        self.times, self.n, self.ready = times, 0, dict[Any, Any]()
        self.squares: dict[str, list[tuple[Q, Row]]] = {"M": [], "K": [], "D": []}

    def coordinate(self) -> int:
        """The number of a new one."""
        self.n += 1
        return self.n - 1

    def add(self, name: str, amount: Q, *rows: Row) -> None:
        """An amount times the squares of rows."""
        self.squares[name] += [(amount, row) for row in rows if amount]

    def matrix(self, name: str) -> list[Row]:
        """The sum of all squares, row by row."""
        matrix: list[Row] = [{} for _ in range(self.n)]
        for amount, row in self.squares[name]:
            for i, a in row.items():
                for j, b in row.items():
                    matrix[i][j] = matrix[i].get(j, 0) + amount * a * b
        return matrix


def combine(*terms: tuple[Q | int, Row]) -> Row:
    """The sum of rows, each times a factor."""
    row: Row = {}
    for factor, other in terms:
        for i, value in other.items():
            row[i] = row.get(i, 0) + factor * value
    return row


# ---------------------------------------------------------------------------- supports and points


def part(data: Any, where: str, known: Known, unused: str = "") -> dict[str, Any]:
    """A table of the file with its defaults; no frequency depends on its `unused` keys."""
    for key in data:
        if key not in known and key not in unused.split():
            raise UnreadableError(f"{where}.{key}: this checker does not know it")
    for key, default in known.items():
        if default is None and key not in data:
            raise UnreadableError(f"{where}.{key}: is missing")
    return {**known, **data}


def size(value: Any) -> Q:
    """A number that is not negative, exactly."""
    if Q(value) < 0:
        raise UnreadableError(f"{value}: must not be negative")
    return Q(value)


class Point(NamedTuple):
    """How a point moves along and down, how that turns which it is on, and where it is drawn."""

    along: Row
    down: Row
    turn: Row
    x: Q
    z: Q


NOWHERE = Point({}, {}, {}, Q(0), Q(0))
WAYS = {"fixed": "", "moved": "", "cart": "sway", "swing": "sway", "heave": "heave", "tilt": "roll"}
WAYS |= {"platform": "sway heave roll"}
UNUSED_OF_SUPPORTS = "start friction friction_coefficient motion"


class Carrier:
    """A support with its coordinates: sway, heave (upwards) and roll."""

    def __init__(self, block: Sums, data: dict[str, Any], where: str, gravity: Q) -> None:
        kind = data["kind"]
        if kind not in WAYS:
            raise UnreadableError(f"{where}.kind = {kind}: this checker does not know it")
        known: Known = {"kind": None, "name": "", "position": [0, 0]}
        known |= {"mass": None, "stiffness": 0, "damping": 0} if WAYS[kind] else {}
        known |= {"length": None} if kind == "swing" else {}
        known |= {"inertia": None, "centre": [0, 0]} if "roll" in WAYS[kind] else {}
        self.data = part(data, where, known, UNUSED_OF_SUPPORTS)
        self.name, self.gravity, self.block = self.data["name"] or kind, gravity, block
        self.at = {way: block.coordinate() for way in WAYS[kind].split()}
        for way, i in self.at.items():
            for name, key in (("K", "stiffness"), ("D", "damping")):
                law = self.data[key]
                if isinstance(law, dict):
                    law = part(law, f"{where}.{key}", {"sway": 0, "heave": 0, "roll": 0})[way]
                block.add(name, size(law), {i: 1})
        if self.at:
            centre, mass = self.point(*self.data.get("centre", (0, 0))), size(self.data["mass"])
            block.add("M", mass, centre.along, centre.down)
            block.add("M", size(self.data.get("inertia", 0)), centre.turn)
            self.hold(centre, mass)

    def point(self, s: Any, h: Any) -> Point:
        """The point s along and h below its origin as drawn."""
        (x, z), at, s, h = map(Q, self.data["position"]), self.at, Q(s), Q(h)
        along = {at[way]: value for way, value in (("sway", Q(1)), ("roll", h)) if way in at}
        down = {at[way]: value for way, value in (("heave", Q(-1)), ("roll", -s)) if way in at}
        return Point(along, down, {at[way]: Q(1) for way in at if way == "roll"}, x + s, z + h)

    def hold(self, point: Point, mass: Q) -> None:
        """Adds the weight of a mass at a point that moves on an arc, and rises."""
        weight = self.gravity * mass
        if self.data["kind"] == "swing":
            self.block.add("K", weight / size(self.data["length"]), {self.at["sway"]: 1})
        self.block.add("K", weight * (point.z - Q(self.data["position"][1])), point.turn)


# ------------------------------------------------------------------------------ pendula, springs

LINK = {"kind": None, "mass": None, "length": None, "count": 1}
LINK |= {"stiffness": 0, "damping": 0, "drag": 0, "rotor_inertia": 0, "gear_ratio": 1}
UNUSED_OF_LINKS = "friction quadratic_drag loss wire_loss drive hoist"


def links_of(pendulum: dict[str, Any], where: str) -> list[dict[str, Any]]:
    """Every link, with centre `c` of mass, inertia `I` about it, and 1 or -1 for down or up."""
    links = []
    for k, entry in enumerate(pendulum["links"]):
        known = {**LINK, "centre": None, "inertia": None} if entry["kind"] == "body" else LINK
        data = part(entry, f"{where}.links[{k}]", known, UNUSED_OF_LINKS)
        link = {key: size(data[key]) for key in data if key in known and key != "kind"}
        m, l = link["mass"], link["length"]
        shapes: dict[str, Any] = {"bob": (l, Q(0)), "rod": (l / 2, m * l * l / 12)}
        shapes["body"] = link.get("centre"), link.get("inertia")
        c, I = shapes[data["kind"]]
        links += [{**link, "c": c, "I": I, "entry": k}] * int(data["count"])
    ways = pendulum["equilibrium"] or ["down"] * len(links)
    ups = [{"down": 1, "up": -1}[way] for way in ways]
    return [{**link, "sign": sign} for link, sign in zip(links, ups, strict=True)]


def hang(block: Sums, links: list[dict[str, Any]], pivot: Point, gravity: Q, times: int) -> Any:
    """Adds a chain, `times` as heavy; each link's coordinate is how far its lower end moves along.

    Its angle is then that of the line between both ends, and its centre of mass is on this line.
    """
    upper, turn, z, hung = pivot.along, pivot.turn, pivot.z, []
    below = sum(link["mass"] for link in links)
    for link in links:
        m, l, c, sign = (link[key] for key in ("mass", "length", "c", "sign"))
        below -= m
        lower = {block.coordinate(): Q(1)}
        angle = combine((sign / l, lower), (-sign / l, upper))
        centre, bend = combine((c / l, lower), (1 - c / l, upper)), combine((1, angle), (-1, turn))
        block.add("M", times * m, centre, pivot.down)
        block.add("M", times * link["I"], angle)
        block.add("M", times * link["rotor_inertia"] * link["gear_ratio"] ** 2, bend)
        block.add("K", times * gravity * sign * (m * c + l * below), angle)
        block.add("K", times * link["stiffness"], bend)
        block.add("D", times * link["damping"], bend)
        block.add("D", times * link["drag"], centre, pivot.down)
        hung.append((link, upper, lower, pivot._replace(turn=angle, z=z)))
        upper, turn, z = lower, angle, z + sign * l
    return hung


NUMBER = r"([-+.\deE]+)"
LINK_END = re.compile(rf"pendulum\[(\d+)\](?:\.copies\[(\d+)\])?\.links\[(\d+)\](?:@{NUMBER})?")
OTHER_END = re.compile(rf"(\w+)(?:@{NUMBER},{NUMBER})?")


def ends_of(text: str, carriers: list[Carrier], chains: dict[int, Any]) -> list[Point | None]:
    """The points that an end of a spring means; None is the ground, wherever the other end is."""
    if match := LINK_END.fullmatch(text):
        p, copy, entry, depth = match.groups()
        points: list[Point | None] = []
        for chain in chains[int(p)] if copy is None else [chains[int(p)][int(copy)]]:
            for link, upper, lower, joint in chain:
                if link["entry"] == int(entry):
                    reach = link["c"] if depth is None else Q(float(depth))
                    share, z = reach / link["length"], joint.z + link["sign"] * reach
                    along = combine((share, lower), (1 - share, upper))
                    points.append(joint._replace(along=along, z=z))
        return points
    match = OTHER_END.fullmatch(text)
    name, s, h = match.groups() if match else ("", None, None)
    place = Q(float(s or 0)), Q(float(h or 0))
    if name == "ground":
        return [NOWHERE._replace(x=place[0], z=place[1]) if s else None]
    for carrier in carriers:
        if name in {carrier.name, "cart" if len(carriers) == 1 else ""}:
            return [carrier.point(*place)]
    raise UnreadableError(f"spring: there is no point {text}")


def stretch(block: Sums, spring: dict[str, Any], a: Point | None, b: Point | None) -> None:
    """Adds a spring and its damper between two points."""
    if a is None or b is None:  # the ground
        there = a or b or NOWHERE
        a, b = there, NOWHERE._replace(x=there.x, z=there.z)
    x, z, near = b.x - a.x, b.z - a.z, max(map(abs, (a.x, a.z, b.x, b.z))) / 2**40
    along, down = combine((1, b.along), (-1, a.along)), combine((1, b.down), (-1, a.down))
    factor, rows = Q(1), [along, down]  # where both ends are drawn together, in each way
    if spring["kind"] == "torsion":
        rows = [combine((1, b.turn), (-1, a.turn))]
    elif x * x + z * z > near * near:  # else what is along its line
        factor, rows = 1 / (x * x + z * z), [combine((x, along), (z, down))]
    block.add("K", size(spring["stiffness"]) * factor, *rows)
    block.add("D", size(spring["damping"]) * factor, *rows)


SCENE: Known = {"gravity": None, "space": "plane", "support": {"kind": "fixed"}, "pendulum": None}
SCENE |= {"spring": [], "force": [], "damping_ratio": 0}
PENDULUM = {"links": None, "count": 1, "equilibrium": [], "on": "", "position": [0, 0]}
SPRING = {"between": None, "kind": "linear", "stiffness": 0, "damping": 0}


def blocks_of(data: dict[str, Any]) -> list[Sums]:
    """What moves with the supports, and every pendulum that moves while its support is still.

    Of N equal pendula that hang together, the sum moves with the support, like one N times as
    heavy; N - 1 differences leave it still, and so does, in space, all motion across the rail.
    """
    scene = part(data, "scene", SCENE, "title ground")
    for k, force in enumerate(scene["force"]):
        if force["kind"] == "constant":
            raise NotProvedError(f"force[{k}]: links lean, at no fractions, and are enclosed at best")
    gravity, moving, given = size(scene["gravity"]), Sums(1), scene["support"]
    given = given if isinstance(given, list) else [given]
    carriers = [Carrier(moving, each, f"support[{k}]", gravity) for k, each in enumerate(given)]
    springs = [part(each, f"spring[{k}]", SPRING, "loss") for k, each in enumerate(scene["spring"])]
    words = " ".join(text for spring in springs for text in spring["between"])
    tied = set(map(int, re.findall(r"pendulum\[(\d+)\]", words)))
    across = {"plane": 0, "space": 1}[scene["space"]]
    kinds = {carrier.data["kind"] for carrier in carriers}
    if across and (springs or kinds - {"fixed", "moved", "cart"}):
        raise UnreadableError("scene.space: this checker does not know structures in space")
    blocks, chains = [moving], {}
    for p, each in enumerate(scene["pendulum"]):
        pendulum = part(each, f"pendulum[{p}]", PENDULUM, "start")
        links, count = links_of(pendulum, f"pendulum[{p}]"), int(pendulum["count"])
        (carrier,) = (each for each in carriers if pendulum["on"] in {"", each.name})
        pivot = carrier.point(*pendulum["position"])
        carrier.hold(pivot, count * sum(link["mass"] for link in links))
        still = count * (1 + across)
        if p in tied:
            chains[p], still = [hang(moving, links, pivot, gravity, 1) for _ in range(count)], 0
        elif carrier.at:
            hang(moving, links, pivot, gravity, count)
            still -= 1
        if still:
            blocks.append(Sums(still))
            hang(blocks[-1], links, NOWHERE, gravity, 1)
    for spring in springs:
        ends = [ends_of(text, carriers, chains) for text in spring["between"]]
        many = max(map(len, ends))
        for a, b in zip(*(end * many if len(end) == 1 else end for end in ends), strict=True):
            stretch(moving, spring, a, b)
    return [block for block in blocks if block.n]


# ---------------------------------------------------------------------------------------- counts


class Between:
    """A number between two integers over 2**bits, which arithmetic rounds outwards."""

    def __init__(self, low: int, high: int, bits: int) -> None:
        self.low, self.high, self.bits = low, high, bits

    def __sub__(self, other: Between) -> Between:
        return Between(self.low - other.high, self.high - other.low, self.bits)

    def __mul__(self, other: Between) -> Between:
        ends = [a * b for a in (self.low, self.high) for b in (other.low, other.high)]
        return Between(min(ends) >> self.bits, -(-max(ends) >> self.bits), self.bits)

    def __truediv__(self, other: Between) -> Between:  # by one that has a sign
        ends = [(a << self.bits, b) for a in (self.low, self.high) for b in (other.low, other.high)]
        return Between(min(a // b for a, b in ends), max(-(-a // b) for a, b in ends), self.bits)


def rounded(q: Q | int, bits: int) -> Any:
    """A number between integers over 2**bits; the number itself for no bits."""
    if not bits:
        return Q(q)
    shifted = Q(q).numerator << bits
    return Between(shifted // Q(q).denominator, -(-shifted // Q(q).denominator), bits)


def sign(value: Any) -> int:
    """1, 0 or -1."""
    low, high = (value.low, value.high) if isinstance(value, Between) else (value, value)
    if low <= 0 <= high and low != high:
        raise NotProvedError("a sign needs more bits")
    return (low > 0) - (low < 0)


def signs(A: list[Row], bits: int = 0) -> tuple[int, int]:
    """How many squares of a symmetric matrix have a minus, and how many are missing; A is used up.

    Completing the square of x_k takes A_ik A_kj / A_kk from all A_ij; then x_k is done with.
    """
    minus, left, zero = 0, list(range(len(A)))[::-1], rounded(0, bits)
    while left:
        k = next((k for k in left if sign(A[k].get(k, zero))), -1)
        if k < 0:
            if any(sign(value) for i in left for value in A[i].values()):
                raise NotProvedError("products without squares are left")
            return minus, len(left)
        left.remove(k)
        row = A[k]
        square = row.pop(k)
        minus += sign(square) < 0
        for i, value in row.items():
            del A[i][k]
            factor = value / square
            for j, entry in row.items():
                A[i][j] = A[i].get(j, zero) - factor * entry
    return minus, 0


def count(blocks: list[Sums], x: Q, bits: int) -> tuple[int, int]:
    """How many w^2 are below x, and how many are x."""
    y, below, equal = rounded(x, bits), 0, 0
    for block in blocks:
        if bits not in block.ready:
            block.ready[bits] = []
            for K, M in zip(block.matrix("K"), block.matrix("M"), strict=True):
                pairs = {j: (K.get(j, 0), M.get(j, 0)) for j in {**K, **M}}
                pairs = {j: (rounded(k, bits), rounded(m, bits)) for j, (k, m) in pairs.items()}
                block.ready[bits].append(pairs)
        A = [{j: k - y * m for j, (k, m) in row.items()} for row in block.ready[bits]]
        minus, missing = signs(A, bits)
        below, equal = below + block.times * minus, equal + block.times * missing
    return below, equal


# ----------------------------------------------------------------------------------------- roots


def determinant(A: list[list[Q]]) -> Q:
    """By elimination."""
    product = Q(1)
    while A:
        at = next((i for i, row in enumerate(A) if row[0]), None)
        if at is None:
            return Q(0)
        row = A.pop(at)
        product *= row[0] * (-1) ** at
        pairs = [(other[0] / row[0], zip(row[1:], other[1:], strict=True)) for other in A]
        A = [[b - factor * a for a, b in entries] for factor, entries in pairs]
    return product


def polynomial(block: Sums) -> list[Q]:
    """det(z^2 M + z D + K), lowest power first, by Newton from its values at z = 0, 1, 2, ..."""
    M, D, K = (block.matrix(name) for name in "MDK")
    values, p, at = list[Q](), list[Q](), range(block.n)
    for z in range(2 * block.n + 1):
        rows = [combine((z * z, M[i]), (z, D[i]), (1, K[i])) for i in at]
        values.append(determinant([[Q(row.get(j, 0)) for j in at] for row in rows]))
    for order in range(1, len(values)):
        for i in reversed(range(order, len(values))):
            values[i] = (values[i] - values[i - 1]) / order
    for z, value in reversed(list(enumerate(values))):  # value + (y - z) p
        p = [a - z * b for a, b in zip([Q(0), *p], [*p, Q(0)], strict=True)]
        p[0] += value
    return p


def roots_near(p: list[Q], re: Q, im: Q, radius: Q) -> int:
    """The number of roots of p within a radius of re + i im."""
    real, imaginary = list(p), [Q(0)] * len(p)
    for end in range(len(p)):  # Horner's rule again and again leaves the coefficients of p(c + y)
        for k in reversed(range(end, len(p) - 1)):
            a, b = real[k + 1], imaginary[k + 1]
            real[k], imaginary[k] = real[k] + re * a - im * b, imaginary[k] + re * b + im * a
    pairs = [(abs(a), abs(b)) for a, b in zip(real, imaginary, strict=True)]
    if not radius:
        return next(k for k, pair in enumerate(pairs) if any(pair))
    most = [sum(pair) * radius**k for k, pair in enumerate(pairs)]
    for n, pair in enumerate(pairs):
        if max(pair) * radius**n > sum(most) - most[n]:
            return n
    raise NotProvedError("no term is larger than the sum of the others")


def count_roots(blocks: list[Sums], re: Q, im: Q, radius: Q) -> int:
    """How many roots all polynomials have within a radius of re + i im."""
    total = 0
    for block in blocks:
        if "p" not in block.ready:
            block.ready["p"] = polynomial(block)
        total += block.times * roots_near(block.ready["p"], re, im, radius)
    return total


# --------------------------------------------------------------------------------------- judging


class Verdict(NamedTuple):
    """Whether a row of the table is proved, and what that says, or why not."""

    mode: int
    proved: bool
    words: str


def judge(row: dict[str, Any], claim: dict[str, Any], blocks: list[Sums], bits: int) -> Verdict:
    """Whether what the proof claims for a row of the table proves it."""
    try:
        if not {"counts", "roots"} & claim.keys():
            raise NotProvedError(claim.get("why", "the proof leaves it out"))
        if None in (row["omega_rad_per_s"], row["relative_error_bound"]):
            raise NotProvedError("no digit of it is certain")
        w, e = size(row["omega_rad_per_s"]), size(row["relative_error_bound"])
        turn = 2 * Q("3.14159265358979323846264338328")
        hertz = w / turn if row["frequency_hz"] is None else Q(row["frequency_hz"])
        if abs(turn * hertz - w) > (e + Q(1, 2**50)) * w or e > Q(1, 4):
            raise NotProvedError("omega is not 2 pi times its frequency, or has no digit")
        if any(block.squares["D"] for block in blocks):
            words = judge_roots(row, claim, blocks)
        else:
            words = judge_counts(row, claim, blocks, bits)
        words = f"{float(w)!r} rad/s within {float(e):.1e} of itself, {words}"
        return Verdict(row["mode"], True, words)
    except NotProvedError as error:
        return Verdict(row["mode"], False, str(error))


def judge_counts(row: Any, claim: Any, blocks: list[Sums], bits: int) -> str:
    """Counts at both ends of an interval within the bound; a growing mode has w^2 = -(growth)^2."""
    w, e = Q(row["omega_rad_per_s"]), Q(row["relative_error_bound"])
    grows = row["growth_rate_per_s"] is not None
    least, most = (w * (1 - e)) ** 2, (w * (1 + e)) ** 2
    least, most = (-most, -least) if grows else (least, most)
    (low, high), (first, last) = map(Q, claim["omega_squared"]), claim["numbers"]
    if not least <= low <= high <= most:
        raise NotProvedError("it is counted elsewhere than within the bound of the table")
    before, missing = count(blocks, low, bits if low < high else 0)
    upto = sum(count(blocks, high, bits if low < high else 0))
    if missing if low < high else count(blocks, low - 1, bits)[1]:
        raise NotProvedError("a square vanishes for every x")
    if claim["counts"] != [before, upto] or not before < first <= last <= upto:
        raise NotProvedError(f"{before} are below its interval, {upto} up to its end")
    if last - first + 1 != row["multiplicity"]:
        raise NotProvedError("the proof is of another multiplicity")
    return f"{'growth rate ' * grows}number {first} to {last}; {upto - before} so near"


def judge_roots(row: Any, claim: Any, blocks: list[Sums]) -> str:
    """Roots z in a disc within the bound of w = |z|, about the root of the table."""
    w, e, zeta = Q(row["omega_rad_per_s"]), Q(row["relative_error_bound"]), Q(row["damping_ratio"])
    (re, im), radius = map(Q, claim["centre"]), size(claim["radius"])
    near, far = w * (1 - e) + radius, w * (1 + e) - radius
    if far < 0 or not near**2 <= re * re + im * im <= far**2 or abs(re + zeta * w) > e * w:
        raise NotProvedError("its root is sought elsewhere than within the bound of the table")
    roots = count_roots(blocks, re, im, radius)
    if claim["roots"] != roots or (w and roots != row["multiplicity"]) or not roots:
        raise NotProvedError(f"{roots} roots are in its disc")
    return f"damping ratio {float(zeta)!r} within {float(4 * e):.1e}, {roots} such roots"


def numbers_in(content: Any, where: str) -> dict[str, Any]:
    """Everything in a file by its place."""
    if not isinstance(content, dict | list):
        return {where: content}
    numbers: dict[str, Any] = {where: len(content)}
    for key, each in content.items() if isinstance(content, dict) else enumerate(content):
        numbers |= numbers_in(each, f"{where}.{key}")
    return numbers


def check(scene: dict[str, Any], table: dict[str, Any], proof: dict[str, Any]) -> list[Verdict]:
    """A verdict for each row of the table."""
    known = {"what": "", "scene": None, "bits": None, "modes": None}
    part(proof, "proof", known)
    here, there = numbers_in(scene, "scene"), numbers_in(proof["scene"], "scene")
    for place in {**here, **there}:
        if place not in here or place not in there or here[place] != there[place]:
            raise UnreadableError(f"{place}: is not that of the proof, which is of another scene")
    claims, bits = {claim["mode"]: claim for claim in proof["modes"]}, int(proof["bits"])
    try:
        blocks = blocks_of(scene)
    except NotProvedError as error:
        return [Verdict(row["mode"], False, str(error)) for row in table["modes"]]
    verdicts, seen = [], list[Any]()
    for row in table["modes"]:
        claim = claims.get(row["mode"], {})
        verdict = judge(row, claim, blocks, bits)
        if verdict.proved and any(meet(claim, other) for other in seen):
            verdict = Verdict(row["mode"], False, "another row of the table counts the same")
        seen += [claim] * verdict.proved
        verdicts.append(verdict)
    return verdicts


def meet(claim: Any, other: Any) -> bool:
    """Whether two claims share a number, or a point of their discs."""
    if "counts" in claim:
        (first, last), (begin, end) = claim["numbers"], other["numbers"]
        return bool(first <= end and begin <= last)
    (a, b), (c, d) = map(Q, claim["centre"]), map(Q, other["centre"])
    return (a - c) ** 2 + (b - d) ** 2 <= (size(claim["radius"]) + size(other["radius"])) ** 2


FAULTS = OSError, ValueError, TypeError, LookupError, AttributeError, ArithmeticError


def main(arguments: list[str]) -> int:
    """0 where all is proved, 1 where not, 2 for files that it cannot read."""
    if len(arguments) != 3:
        print("usage: python check_proof.py SCENE.toml TABLE.json PROOF.json", file=sys.stderr)
        return 2
    try:
        scene, table, proof = (Path(name).read_text(encoding="utf-8") for name in arguments)
        verdicts = check(tomllib.loads(scene), json.loads(table), json.loads(proof))
    except (*FAULTS, RecursionError) as error:
        print(f"check_proof: {type(error).__name__}: {error}", file=sys.stderr)
        return 2
    for mode, is_proved, words in verdicts:
        print(f"mode {mode}: {'proved' if is_proved else 'NOT PROVED'}: {words}")
    proved = sum(verdict.proved for verdict in verdicts)
    print(f"{proved} of {len(verdicts)} rows are proved; other modes and columns are not looked at")
    return 0 if 0 < proved == len(verdicts) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
