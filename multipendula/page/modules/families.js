// Which neighbours of the table beat with each other: the rule of `modal.coupling`, from the modes of the whole scene.
//
// An own mode s of a pendulum swings at w with all else at rest; those of one frequency are a family.  Their amplitude in
// a mode f is p = s'Mf/sqrt(f'Mf s'Ms), M that of the pendulum alone.  What all else does shifts w^2 by the parts e' that
// are the eigenvalues of the inverse of the sum of w^2 p p'/(w_f^2 - w^2) over the modes that move something else; the
// coupling strength e counts only what does not belong to the family, e = e'/(1 - e') where something carries it.  Where
// every e is below one half, and every splitting near e w/2, energy passes from one pendulum of the family to the others
// and back.  Own modes of different pendula beat where they exchange more than half of it.

import { dot, eigen, formsIn, gathered, jacobi, matricesBy, zeros } from "./matrices.js";
import { mannerOf } from "./shapes.js";
import { sum } from "./system.js";

const [SAME, WHOLE] = [1e-9, 1e-6];
const [STRONG, NEAR, LEAST, HALF, ALONE, STEADY] = [0.5, 0.2, 0.01, 0.5, 0.95, 0.05]; // as in `modal.coupling.families`
const INSTANTS = Array.from({ length: 101 }, (_, i) => i / 100);

// The beat (s) of every row with the next, NaN where there is none.
export function beatsOf(system, rows) {
  const stands = system.links.some(({ s }) => s < 0);
  const modes = stands || !(system.cart || system.structure) ? null : undamped(system, rows);
  if (!modes) return rows.map(() => NaN);
  const { own, squares } = modes;
  const ascending = own.toSorted((one, other) => one.square - other.square);
  const families = gathered(ascending, (mode, first) => mode.square - first.square <= SAME * mode.square).map((members) => levelsOf(system, members, rows, squares));
  return rows.map((row, i) => {
    const next = rows[i + 1];
    if (!next || [row, next].some((each) => mannerOf(each) !== "swings") || next.turn === row.turn) return NaN;
    const within = families.some((levels) => passes(levels.get(i), levels.get(i + 1), row, next));
    const pair = pairAt(own, squares, i).map(({ shares }) => [shares[i], shares[i + 1]]);
    const [here, there] = [0, 1].map((k) => pair.map((shares) => shares[k]));
    return within || (pair.length && passes(here, there, row, next, HALF)) ? (2 * Math.PI) / Math.abs(next.turn - row.turn) : NaN;
  });
}

// The modes without dampers, row by row: the square of each frequency, and of the own modes of all pendula (`square`) the
// amplitudes in every shape and the shares of every row; null where the dampers have changed the order of the rows.
function undamped(system, rows) {
  const { M, K } = matricesBy(system.size, (x, z) => formsIn(system, x, z));
  const squareOf = (x) => dot(x, timesOf(K, x)) / dot(x, timesOf(M, x));
  let shapes = rows.map((row) => row.shapes);
  if (rows.some(({ twists }) => twists)) {
    const vectors = eigen(M, K).map((x) => ({ x, square: squareOf(x) })).sort((one, other) => one.square - other.square);
    const swing = (row) => mannerOf(row) === "swings";
    let at = vectors.length - sum(rows.filter(swing).map(({ multiplicity }) => multiplicity));
    if (at < 0) return null;
    shapes = rows.map((row) => (swing(row) ? vectors.slice(at, (at += row.multiplicity)).map(({ x }) => x) : row.shapes));
  }
  const sizes = shapes.map((each) => each.map((x) => Math.sqrt(dot(x, timesOf(M, x)))));
  const own = system.chains.flatMap(({ first, links }) => {
    const [from, to] = [system.lead + first, system.lead + first + links.length];
    const [inertia, stiffness] = [M, K].map((S) => S.slice(from, to).map((line) => line.slice(from, to)));
    return eigen(inertia, stiffness).map((s) => {
      const pushed = timesOf(inertia, s);
      const size = dot(s, pushed);
      const amplitudes = shapes.map((each, i) => each.map((x, k) => dot(pushed, x.slice(from, to)) / sizes[i][k] / Math.sqrt(size)));
      return { chain: first, square: dot(s, timesOf(stiffness, s)) / size, amplitudes, shares: amplitudes.map((each) => dot(each, each)) };
    });
  });
  return { own, squares: shapes.map(([x]) => squareOf(x)) };
}

const timesOf = (S, x) => S.map((line) => dot(line, x));

// The rows of a family, each with its share of every member; none where first order does not hold.
function levelsOf(system, members, rows, squares) {
  const [{ square }] = members;
  const shares = rows.map((_, i) => members.map((member) => member.shares[i]));
  const still = rows.findIndex(({ multiplicity }, i) => Math.abs(sum(shares[i]) - multiplicity) < WHOLE);
  const strengths = strengthsOf(members, squares, square, still).map((shift) => (system.lead ? shift / (1 - shift) : shift));
  const branches = [...rows.keys()].filter((i) => i !== still).toSorted((i, j) => sum(shares[j]) - sum(shares[i])).slice(0, strengths.length);
  branches.sort((i, j) => i - j);
  const isNear = (strength, k) => {
    const splitting = Math.sqrt(squares[branches[k]] / square) - 1;
    return Math.abs(strength) <= STRONG && Math.abs(strength / 2 - splitting) <= NEAR * Math.abs(splitting);
  };
  if (members.length < 2 || !strengths.length || !strengths.every(isNear)) return new Map();
  const levels = new Map(branches.map((i) => [i, shares[i].map((share) => share / sum(shares[i]))]));
  if (still >= 0) levels.set(still, members.map((_, j) => 1 - sum(branches.map((i) => levels.get(i)[j]))));
  return levels;
}

// By how much of a square x the pull of all else, taken at x, shifts these own modes; ascending.
function strengthsOf(members, squares, x, still = -1) {
  const G = zeros(members.length);
  squares.forEach((square, i) => {
    if (i === still) return;
    members.forEach((one, j) => members.forEach((other, k) => (G[j][k] += (x / (square - x)) * dot(one.amplitudes[i], other.amplitudes[i]))));
  });
  const { values } = jacobi(G);
  const largest = Math.max(...values.map(Math.abs));
  return values.filter((value) => Math.abs(value) > SAME * largest).map((value) => 1 / value).sort((one, other) => one - other);
}

// Whether two rows with these shares of the members pass energy of one to the others, and have it back.
function passes(here, there, row, next, least = LEAST) {
  if (!here || !there) return false;
  const most = Math.max(...here.map((share, j) => 4 * share * there[j]));
  const gap = Math.abs(next.turn - row.turn);
  const passed = INSTANTS.map((part) => {
    const time = (part * 2 * Math.PI) / gap;
    const [p, q] = [row, next].map(({ rate }) => Math.exp(rate * time));
    return (most * (p * p + q * q - 2 * p * q * Math.cos(gap * time))) / 4;
  });
  return most > least && gap > Math.abs(next.rate - row.rate) && Math.max(...passed) > least;
}

// The two own modes of different frequency that are in this row and the next alone; none where there are others.
function pairAt(own, squares, i) {
  const pair = own.filter(({ shares }) => 4 * shares[i] * shares[i + 1] > HALF && shares[i] + shares[i + 1] > ALONE);
  if (pair.length !== 2 || pair[0].chain === pair[1].chain || Math.abs(pair[1].square - pair[0].square) <= SAME * pair[1].square) return [];
  const x = Math.sqrt(pair[0].square * pair[1].square);
  const [low, high] = strengthsOf(pair, squares, x);
  const gap = Math.sqrt(squares[i + 1]) - Math.sqrt(squares[i]);
  return Math.abs((Math.sqrt(x) * (high - low)) / 2 - gap) <= STEADY * gap ? pair : [];
}
