"""Check a proof that each natural frequency of a scene is within the error printed next to it.

    python check_proof.py SCENE.toml TABLE.json PROOF.json

Python's standard library is all that is needed, and all that is trusted; nothing of the program
that made the table is.  The numbers of the scene, each the double nearest to what the file says,
become fractions, and these become M and K, sums of squares of small displacements:

    energy of motion = 1/2 sum m (displacement')^2,      potential energy = 1/2 sum k (extension)^2

SYLVESTER'S LAW OF INERTIA [Sylvester1852].  However K - x M is written as a sum of squares, as many
of them have a minus.  This is the number of natural frequencies whose w^2 is below x: none is where
x is far below zero, and as x grows, a sign changes at each w^2 and nowhere else, as M has no square
with a minus.  So two counts, at both ends of an interval, prove how many w^2 are in it, by + - * /
of fractions alone.  The proof says where to count.

ROUNDING.  Of many coordinates the proof may ask for integers, multiples of 2^-bits.  Where entries
are rounded by less than 1 and the diagonal loses 1 for each of its row, the matrix is smaller, with
no fewer minuses; where it gains as much it is larger, with no more.  So a count at the lower end is
never too small, at the upper never too large.

With dampers, roots of the polynomial p(z) = det(z^2 M + z D + K) are counted instead, in a disc:
where one term |a_n| r^n of p(c + y) = sum a_k y^k is larger than the sum of all others, p has
exactly n roots within r of c (Rouche 1862).
"""

from __future__ import annotations

import json
import sys
import tomllib
from fractions import Fraction as Q
from itertools import zip_longest
from pathlib import Path
from typing import Any, NamedTuple

Row = dict[int, Any]  # entries of a row by the numbers of their coordinates
Data = dict[str, Any]


class UnreadableError(ValueError):
    """Unknown content of a file; nothing is proved then."""


class NotProvedError(Exception):
    """The reason why a row is not proved."""


class Sums:
    """M, K and D, row by row, of coupled coordinates, with a multiplicity `times`."""

    def __init__(self, times: int) -> None:
        self.times, self.p = times, list[Q]()
        self.M, self.K, self.D = list[Row](), list[Row](), list[Row]()

    def coordinate(self) -> int:
        """The number of a new one."""
        for S in (self.M, self.K, self.D):
            S.append({})
        return len(self.M) - 1

    def add(self, S: list[Row], amount: Q, *rows: Row) -> None:
        """An amount times the squares of rows, to M, K or D."""
        for row in rows if amount else ():
            for i, a in row.items():
                for j, b in row.items():
                    S[i][j] = S[i].get(j, 0) + amount * a * b


def combine(*terms: tuple[Q | int, Row]) -> Row:
    """The sum of rows, each times a factor."""
    row: Row = {}
    for factor, other in terms:
        for i, value in other.items():
            row[i] = row.get(i, 0) + factor * value
    return row


def part(data: Data, where: str, known: Data, unused: str = "") -> Data:
    """A table of a file, its numbers as fractions; no frequency depends on its `unused` keys.

    Those `known` have their defaults, None if there must be something.
    """
    for key in {**known, **data}:
        if key not in known and key not in unused.split():
            raise UnreadableError(f"{where}.{key}: not supported by this checker")
        if known.get(key, "") is None and key not in data:
            raise UnreadableError(f"{where}.{key}: is missing")
    every = {**known, **data}
    numbers = {key: Q(value) for key, value in every.items() if isinstance(value, int | float)}
    if any(value < 0 for value in numbers.values()):
        raise UnreadableError(f"{where}: must not contain negative numbers")
    return every | numbers


class Point(NamedTuple):
    """A point: displacements along and down, rotation of its body, and position as drawn."""

    along: Row
    down: Row
    turn: Row
    x: Q
    z: Q


NOWHERE = Point({}, {}, {}, Q(0), Q(0))
WAYS = {"fixed": "", "moved": "", "cart": "sway", "swing": "sway", "heave": "heave", "tilt": "roll"}
WAYS |= {"platform": "sway heave roll"}


class Carrier:
    """A support with its coordinates: sway, heave (upwards) and roll."""

    def __init__(self, block: Sums, data: Data, where: str, gravity: Q) -> None:
        kind = data["kind"]
        if kind not in WAYS:
            raise UnreadableError(f"{where}.kind = {kind}: not supported by this checker")
        known: Data = {"kind": None, "name": "", "position": [0, 0]}
        known |= {"mass": None, "stiffness": 0, "damping": 0} if WAYS[kind] else {}
        known |= {"length": None} if kind == "swing" else {}
        known |= {"inertia": None, "centre": [0, 0]} if "roll" in WAYS[kind] else {}
        self.data = part(data, where, known, "start friction friction_coefficient motion")
        self.name, self.gravity, self.block = self.data["name"] or kind, gravity, block
        self.at = {way: block.coordinate() for way in WAYS[kind].split()}
        for way, i in self.at.items():
            for S, key in ((block.K, "stiffness"), (block.D, "damping")):
                law = self.data[key]
                if isinstance(law, dict):
                    law = part(law, f"{where}.{key}", {"sway": 0, "heave": 0, "roll": 0})[way]
                block.add(S, law, {i: 1})
        if self.at:
            centre = self.point(*self.data.get("centre", (0, 0)))
            block.add(block.M, self.data["mass"], centre.along, centre.down)
            block.add(block.M, self.data.get("inertia", Q(0)), centre.turn)
            self.hold(centre, self.data["mass"])

    def point(self, s: Any, h: Any) -> Point:
        """The point s along and h below its origin as drawn."""
        (x, z), at, s, h = map(Q, self.data["position"]), self.at, Q(s), Q(h)
        along = {at[way]: value for way, value in (("sway", Q(1)), ("roll", h)) if way in at}
        down = {at[way]: value for way, value in (("heave", Q(-1)), ("roll", -s)) if way in at}
        return Point(along, down, {at[way]: Q(1) for way in at if way == "roll"}, x + s, z + h)

    def hold(self, point: Point, mass: Q) -> None:
        """Adds the weight of a mass at a point that moves on an arc, and rises."""
        block, weight = self.block, self.gravity * mass
        if self.data["kind"] == "swing":
            block.add(block.K, weight / self.data["length"], {self.at["sway"]: 1})
        block.add(block.K, weight * (point.z - Q(self.data["position"][1])), point.turn)


LINK = {"kind": None, "mass": None, "length": None, "count": 1}
LINK |= {"stiffness": 0, "damping": 0, "drag": 0, "rotor_inertia": 0, "gear_ratio": 1}
UNUSED_OF_LINKS = "friction quadratic_drag loss wire_loss drive hoist"


def links_of(pendulum: Data, where: str) -> list[Data]:
    """Every link, with centre `c` of mass, inertia `I` about it, and 1 or -1 for down or up."""
    links: list[Data] = []
    for k, entry in enumerate(pendulum["links"]):
        known = {**LINK, "centre": None, "inertia": None} if entry["kind"] == "body" else LINK
        link = part(entry, f"{where}.links[{k}]", known, UNUSED_OF_LINKS)
        m, l = link["mass"], link["length"]
        shapes: Data = {"bob": (l, Q(0)), "rod": (l / 2, m * l * l / 12)}
        shapes["body"] = link.get("centre"), link.get("inertia")
        c, I = shapes[link["kind"]]
        links += [{**link, "c": c, "I": I, "entry": k}] * int(link["count"])
    ways = pendulum["equilibrium"] or ["down"] * len(links)
    signs = [{"down": 1, "up": -1}[way] for way in ways]
    return [{**link, "sign": sign} for link, sign in zip(links, signs, strict=True)]


def hang(block: Sums, links: list[Data], pivot: Point, gravity: Q, times: int) -> list[Any]:
    """Adds a chain, `times` as heavy; each link's coordinate is how far its lower end moves along.

    Its angle is then that of the line between both ends, and its centre of mass is on this line.
    """
    M, K, D, upper, joints = block.M, block.K, block.D, pivot, []
    below = sum(link["mass"] for link in links)
    for link in links:
        m, l, c, sign = (link[key] for key in ("mass", "length", "c", "sign"))
        below -= m
        lower = {block.coordinate(): Q(1)}
        angle = combine((sign / l, lower), (-sign / l, upper.along))
        centre = combine((c / l, lower), (1 - c / l, upper.along))
        bend = combine((1, angle), (-1, upper.turn))
        block.add(M, times * m, centre, pivot.down)
        block.add(M, times * link["I"], angle)
        block.add(M, times * link["rotor_inertia"] * link["gear_ratio"] ** 2, bend)
        block.add(K, times * gravity * sign * (m * c + l * below), angle)
        block.add(K, times * link["stiffness"], bend)
        block.add(D, times * link["damping"], bend)
        block.add(D, times * link["drag"], centre, pivot.down)
        joints.append((link, lower, upper._replace(turn=angle)))
        upper = upper._replace(along=lower, turn=angle, z=upper.z + sign * l)
    return joints


def ends_of(text: str, carriers: list[Carrier], joints: dict[str, Any]) -> list[Point | None]:
    """The points that an end of a spring means; None is the ground, wherever the other end is."""
    name, _, place = text.partition("@")
    at = [Q(float(number)) for number in place.split(",")] if place else []
    points: list[Point | None] = []
    for link, lower, upper in joints.get(name, ()):
        (reach,) = at or [link["c"]]
        share = reach / link["length"]
        along, z = combine((share, lower), (1 - share, upper.along)), upper.z + link["sign"] * reach
        points.append(upper._replace(along=along, z=z))
    for carrier in carriers:
        if not points and name in (carrier.name, "cart" if len(carriers) == 1 else ""):
            points = [carrier.point(*at or (0, 0))]
    if name == "ground":
        points = [Point({}, {}, {}, *at) if at else None]
    if not points:
        raise UnreadableError(f"spring: there is no point {text}")
    return points


def stretch(block: Sums, spring: Data, a: Point | None, b: Point | None) -> None:
    """Adds a spring and its damper between two points."""
    if a is None or b is None:  # the ground
        there = a or b or NOWHERE
        a, b = there, NOWHERE._replace(x=there.x, z=there.z)
    x, z, near = b.x - a.x, b.z - a.z, max(map(abs, (a.x, a.z, b.x, b.z))) / 2**40
    along, down = combine((1, b.along), (-1, a.along)), combine((1, b.down), (-1, a.down))
    factor, rows = Q(1), [along, down]  # where both ends are drawn together, in each way
    if spring["kind"] == "torsion":
        rows = [combine((1, b.turn), (-1, a.turn))]
    elif x * x + z * z > near * near:  # else the component along its line
        factor, rows = 1 / (x * x + z * z), [combine((x, along), (z, down))]
    block.add(block.K, spring["stiffness"] * factor, *rows)
    block.add(block.D, spring["damping"] * factor, *rows)


SCENE: Data = {"gravity": None, "space": "plane", "support": {"kind": "fixed"}, "pendulum": None}
SCENE |= {"spring": [], "force": [], "damping_ratio": 0}
PENDULUM = {"links": None, "count": 1, "equilibrium": [], "on": "", "position": [0, 0]}
SPRING = {"between": None, "kind": "linear", "stiffness": 0, "damping": 0}


def blocks_of(data: Data) -> list[Sums]:
    """The parts that move with the supports, and pendula that move while their supports are still.

    Of N equal pendula that hang together, the sum moves with the support, like one N times as
    heavy; N - 1 differences leave it still, and so does, in space, all motion across the rail.
    """
    scene = part(data, "scene", SCENE, "title ground")
    for k, force in enumerate(scene["force"]):
        if force["kind"] == "constant":
            raise NotProvedError(f"force[{k}]: links lean at irrational angles, enclosed at best")
    gravity, moving, supports = scene["gravity"], Sums(1), scene["support"]
    supports = supports if isinstance(supports, list) else [supports]
    carriers = [Carrier(moving, each, f"support[{k}]", gravity) for k, each in enumerate(supports)]
    springs = [part(each, f"spring[{k}]", SPRING, "loss") for k, each in enumerate(scene["spring"])]
    words = [text for spring in springs for text in spring["between"]]
    across = {"plane": 0, "space": 1}[scene["space"]]
    kinds = {carrier.data["kind"] for carrier in carriers}
    if across and (springs or kinds - {"fixed", "moved", "cart"}):
        raise UnreadableError("scene.space: this checker does not know structures in space")
    blocks, joints = [moving], dict[str, Any]()
    for p, each in enumerate(scene["pendulum"]):
        name = f"pendulum[{p}]"
        pendulum = part(each, name, PENDULUM, "start")
        links, count = links_of(pendulum, name), int(pendulum["count"])
        (carrier,) = (each for each in carriers if pendulum["on"] in {"", each.name})
        pivot = carrier.point(*pendulum["position"])
        carrier.hold(pivot, count * sum(link["mass"] for link in links))
        still = count * (1 + across)
        if any(text.startswith(name) for text in words):
            still = 0
            for copy in range(count):
                for joint in hang(moving, links, pivot, gravity, 1):
                    for whose in (name, f"{name}.copies[{copy}]"):
                        joints.setdefault(f"{whose}.links[{joint[0]['entry']}]", []).append(joint)
        elif carrier.at:
            hang(moving, links, pivot, gravity, count)
            still -= 1
        if still:
            blocks.append(Sums(still))
            hang(blocks[-1], links, NOWHERE, gravity, 1)
    for spring in springs:
        ends = [ends_of(text, carriers, joints) for text in spring["between"]]
        many = max(map(len, ends))
        for a, b in zip(*(end * many if len(end) == 1 else end for end in ends), strict=True):
            stretch(moving, spring, a, b)
    return [block for block in blocks if block.M]


def eliminate(A: list[Row], gain: int = 0) -> tuple[int, int, Q]:
    """How many squares of a symmetric matrix have a minus, how many are missing; its determinant.

    Completing the square of x_k takes A_ik A_kj / A_kk from all A_ij; then x_k is done with.  With
    a gain of 1 or -1 these are integers, rounded by less than 1, and the diagonal gains as much.
    """
    minus, product, left = 0, Q(1), list(range(len(A)))[::-1]
    while left:
        k = next((k for k in left if A[k].get(k)), -1)
        if k < 0:
            if any(value for i in left for value in A[i].values()):
                raise NotProvedError("products without squares are left")
            return minus, len(left), Q(0)
        left.remove(k)
        row = A[k]
        square = row.pop(k)
        minus, product = minus + (square < 0), product * (1 if gain else square)
        for i, value in row.items():
            del A[i][k]
            for j, entry in row.items():
                taken = value * entry // square if gain else value * entry / square
                A[i][j] = A[i].get(j, 0) - taken
                A[i][i] = A[i].get(i, 0) + gain
    return minus, 0, product


def count(blocks: list[Sums], x: Q, bits: int = 0, gain: int = 0) -> tuple[int, int]:
    """How many w^2 are below x, and how many are x; a gain of -1 finds no fewer, of 1 no more."""
    below, equal = 0, 0
    for block in blocks:
        rows = zip(block.K, block.M, strict=True)
        A: list[Row] = [{j: K.get(j, 0) - x * M.get(j, 0) for j in {**K, **M}} for K, M in rows]
        for i, row in enumerate(A if gain else ()):
            A[i] = {j: value * 2**bits // 1 for j, value in row.items()}
            A[i][i] = A[i].get(i, 0) + gain * len(row)
        minus, missing, _ = eliminate(A, gain)
        below, equal = below + block.times * minus, equal + block.times * missing
    return below, equal


def polynomial(block: Sums) -> list[Q]:
    """det(z^2 M + z D + K), lowest power first, by Newton from its values at z = 0, 1, 2, ..."""
    values, p, rows = list[Q](), list[Q](), list(zip(block.M, block.D, block.K, strict=True))
    for z in range(2 * len(rows) + 1):
        values.append(eliminate([combine((z * z, M), (z, D), (1, K)) for M, D, K in rows])[2])
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
    for block in blocks:
        block.p = block.p or polynomial(block)
    return sum(block.times * roots_near(block.p, re, im, radius) for block in blocks)


class Verdict(NamedTuple):
    """Whether a row of the table is proved, with the statement, or why not."""

    mode: int
    proved: bool
    words: str


def judge(row: Data, claim: Data, blocks: list[Sums], bits: int) -> Verdict:
    """Judge whether the claims of the proof prove a row of the table."""
    try:
        if not {"counts", "roots"} & claim.keys():
            raise NotProvedError(claim.get("why", "not covered by the proof"))
        if None in (row["omega_rad_per_s"], row["relative_error_bound"]):
            raise NotProvedError("no digit of it is certain")
        w, e = Q(row["omega_rad_per_s"]), Q(row["relative_error_bound"])
        turn = 2 * Q("3.14159265358979323846264338328")
        hertz = w / turn if row["frequency_hz"] is None else Q(row["frequency_hz"])
        if not 0 <= e <= Q(1, 4) or abs(turn * hertz - w) > (e + Q(1, 2**50)) * w:
            raise NotProvedError("omega is not 2 pi times its frequency, or has no digit")
        if any(any(block.D) for block in blocks):
            words = judge_roots(row, claim, blocks, w, e)
        else:
            words = judge_counts(row, claim, blocks, w, e, bits)
        words = f"{float(w)!r} rad/s, relative error <= {float(e):.1e}; {words}"
        return Verdict(row["mode"], True, words)
    except NotProvedError as error:
        return Verdict(row["mode"], False, str(error))


def judge_counts(row: Data, claim: Data, blocks: list[Sums], w: Q, e: Q, bits: int) -> str:
    """Counts at both ends of an interval within the bound; a growing mode has w^2 = -(growth)^2."""
    grows = row["growth_rate_per_s"] is not None
    least, most = (w * (1 - e)) ** 2, (w * (1 + e)) ** 2
    least, most = (-most, -least) if grows else (least, most)
    (low, high), (first, last) = map(Q, claim["omega_squared"]), claim["numbers"]
    if not (type(first) is type(last) is int):
        raise NotProvedError("its numbers are not integers")
    if grows and abs(Q(row["growth_rate_per_s"]) - w) > e * w:
        raise NotProvedError("its growth rate differs from its omega")
    if not least <= low <= high <= most:
        raise NotProvedError("its interval is not within the error bound of the table")
    gain = 1 if bits and low < high else 0
    before, missing = count(blocks, low, bits, -gain)
    upto = sum(count(blocks, high, bits, gain))
    if missing if low < high else count(blocks, low - 1)[1]:
        raise NotProvedError("a square vanishes for every x")
    if claim["counts"] != [before, upto] or not before < first <= last <= upto:
        raise NotProvedError(f"{before} are below its interval, {upto} up to its end")
    if last - first + 1 != row["multiplicity"]:
        raise NotProvedError("the proof has a different multiplicity")
    several, alone = last > first, upto - before == last - first + 1
    which = f"numbers {first} to {last}" if several else f"number {first}"
    near = f"the only one{'s' * several} there" if alone else f"of {upto - before} there"
    return f"{'growth rate; ' * grows}{which} from below, {near}"


def judge_roots(row: Data, claim: Data, blocks: list[Sums], w: Q, e: Q) -> str:
    """Roots z in a disc within the bound of w = |z|, about the root of the table."""
    (re, im), zeta, radius = (map(Q, claim["centre"]), Q(row["damping_ratio"]), Q(claim["radius"]))
    near, far = w * (1 - e) + radius, w * (1 + e) - radius
    is_near = min(radius, far) >= 0 and near**2 <= re * re + im * im <= far**2
    if im < 0 or not is_near or abs(re + zeta * w) > e * w:
        raise NotProvedError("its disc is not within the error bound of the table")
    roots = count_roots(blocks, re, im, radius)
    if claim["roots"] != roots or (w and roots != row["multiplicity"]) or not roots:
        raise NotProvedError(f"{roots} roots are in its disc")
    there = "exactly one root there" if roots == 1 else f"exactly {roots} roots there"
    return f"damping ratio {float(zeta)!r} within {float(4 * e):.1e}, {there}"


def meet(claim: Data, other: Data) -> bool:
    """Whether two claims share a number, or a point of their discs."""
    if "counts" in claim:
        (first, last), (begin, end) = claim["numbers"], other["numbers"]
        return bool(first <= end and begin <= last)
    (a, b), (c, d) = map(Q, claim["centre"]), map(Q, other["centre"])
    return (a - c) ** 2 + (b - d) ** 2 <= (Q(claim["radius"]) + Q(other["radius"])) ** 2


def check(scene: Data, table: Data, proof: Data) -> list[Verdict]:
    """A verdict for each row of the table."""
    part(proof, "proof", {"what": "", "scene": None, "bits": None, "modes": None})
    lines = (json.dumps(each, indent=0).splitlines() for each in (scene, proof["scene"]))
    for here, there in zip_longest(*lines):
        if here != there:
            raise UnreadableError(f"scene: {here} is {there} in the proof of another scene")
    claims, bits = {claim["mode"]: claim for claim in proof["modes"]}, int(proof["bits"])
    try:
        blocks = blocks_of(scene)
    except NotProvedError as error:
        return [Verdict(row["mode"], False, str(error)) for row in table["modes"]]
    verdicts, seen = [], list[Data]()
    for row in table["modes"]:
        claim = claims.get(row["mode"], {})
        verdict = judge(row, claim, blocks, bits)
        if verdict.proved and any(meet(claim, other) for other in seen):
            verdict = Verdict(row["mode"], False, "another row of the table claims the same roots")
        seen += [claim] * verdict.proved
        verdicts.append(verdict)
    return verdicts


def main(arguments: list[str]) -> int:
    """Return 0 if all rows are proved, 1 if not, 2 for files that it cannot use."""
    if len(arguments) != 3:
        print("usage: python check_proof.py SCENE.toml TABLE.json PROOF.json", file=sys.stderr)
        return 2
    try:
        scene, table, proof = (Path(name).read_text(encoding="utf-8") for name in arguments)
        verdicts = check(tomllib.loads(scene), json.loads(table), json.loads(proof))
    except Exception as error:  # whatever is wrong with a file
        print(f"check_proof: {type(error).__name__}: {error}", file=sys.stderr)
        return 2
    for mode, is_proved, words in verdicts:
        print(f"mode {mode}: {'proved' if is_proved else 'NOT PROVED'}: {words}")
    proved = sum(verdict.proved for verdict in verdicts)
    print(f"{proved} of {len(verdicts)} rows are proved; other modes and columns are not checked")
    return 0 if 0 < proved == len(verdicts) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
