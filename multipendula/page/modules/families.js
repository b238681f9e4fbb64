// Which neighbours of the table beat with each other: modes of one family, as `modal.coupling` has families.
//
// A pendulum's own modes are those with all else at rest; those of one frequency are a family.  Its combinations that move
// nothing else stay at that frequency, and one mode moves the cart, at a zero of the dynamic mass between two poles: the
// moving modes belong to the families in their order, but for that of a cart on its own spring.  On a structure each mode
// belongs to what it has most of.  Of the energy of an own mode s a row has the share (f'M s)^2/(f'M f s'M s), over its
// shapes f; two rows of other families beat, too, where they pass half of it on and back, 4 p q.

import { dot, eigen, formsIn, matricesBy } from "./matrices.js";
import { mannerOf } from "./shapes.js";

const [SAME, WHOLE, HALF] = [1e-9, 1e-6, 0.5];

// The beat (s) of every row with the next, NaN where there is none.
export function beatsOf(system, rows) {
  const swings = rows.map((row) => mannerOf(row) === "swings");
  const neighbours = rows.map((row, i) => swings[i] && swings[i + 1] && rows[i + 1].turn !== row.turn);
  const stands = system.links.some(({ s }) => s < 0);
  if (stands || !(system.cart || system.structure) || !neighbours.some(Boolean)) return rows.map(() => NaN);
  const { M, K } = matricesBy(system.size, (x, z) => formsIn(system, x, z));
  const own = ownModes(system, rows, M, K);
  const families = familiesOf(own);
  const family = system.structure ? onStructure(system, rows, swings, families, M, K) : onCart(system, rows, swings, families);
  return rows.map((row, i) => {
    if (!neighbours[i]) return NaN;
    const [here, there] = [families[family[i]], families[family[i + 1]]];
    const apart = here && there && here !== there && !here.members.some(({ kind }) => there.members.some((other) => other.kind === kind));
    const passed = () => [...here.members, ...there.members].some(({ shares }) => 4 * shares[i] * shares[i + 1] >= HALF);
    return here && (here === there || (apart && passed())) ? (2 * Math.PI) / Math.abs(rows[i + 1].turn - row.turn) : NaN;
  });
}

// The own modes of all pendula: their square, what kind of pendulum, their shares in all rows, and those without the
// motion of what they hang from.
function ownModes(system, rows, M, K) {
  const momenta = momentaOf(rows, M);
  return system.chains.flatMap(({ first, links }) => {
    const [from, to] = [system.lead + first, system.lead + first + links.length];
    const kind = JSON.stringify(links.map(({ m, l, c, I, stiffness }) => [m, l, c, I, stiffness]));
    const alone = rows.map(({ shapes }, i) => shapes.map((x, k) => partOf(x, momenta[i][k].Mx, M, from, to)));
    return within(M, K, from, to).map(({ square, s }) => ({ square, kind, shares: sharesOf(momenta, M, from, s), parts: sharesOf(alone, M, from, s) }));
  });
}

// The momenta of a chain as if all else were at rest.
function partOf(x, Mx, M, from, to) {
  const momenta = new Float64Array(x.length);
  for (let i = from; i < to; i++) for (let j = from; j < to; j++) momenta[i] += M[i][j] * x[j];
  return { x, Mx: momenta, size: dot(x, Mx) };
}

function momentaOf(rows, M) {
  return rows.map(({ shapes }) => shapes.map((x) => ({ x, Mx: M.map((line) => dot(line, x)) })));
}

// The modes of some coordinates, all others at rest.
function within(M, K, from, to) {
  const [inertia, stiffness] = [M, K].map((S) => S.slice(from, to).map((line) => line.slice(from, to)));
  return eigen(inertia, stiffness).map((s) => ({ s, square: squareIn(stiffness, s) / squareIn(inertia, s) }));
}

const squareIn = (S, s) => dot(s, S.map((line) => dot(line, s)));

function sharesOf(momenta, M, from, s) {
  const inertia = squareIn(M.slice(from, from + s.length).map((line) => line.slice(from, from + s.length)), s);
  const share = ({ x, Mx, size = dot(x, Mx) }) => dot(s, Mx.slice(from, from + s.length)) ** 2 / (inertia * size);
  return momenta.map((shapes) => shapes.reduce((total, one) => total + share(one), 0));
}

// Own modes of one frequency, ascending, and what each row has of them.
function familiesOf(modes) {
  const families = [];
  for (const mode of modes.toSorted((one, other) => one.square - other.square)) {
    const last = families.at(-1);
    if (last && mode.square - last.square <= SAME * mode.square) last.members.push(mode);
    else families.push({ square: mode.square, members: [mode] });
  }
  return families.map((one) => ({ ...one, held: one.members[0].parts.map((_, i) => one.members.reduce((total, { parts }) => total + parts[i], 0)) }));
}

// The family whose combinations a row is, all else at rest; -1 where there is none: what it has of it is a whole number.
function stillIn(families, row, i) {
  return families.findIndex(({ held }) => Math.abs(held[i] - row.multiplicity) < WHOLE);
}

function onCart(system, rows, swings, families) {
  const family = rows.map((row, i) => (swings[i] && row.still ? stillIn(families, row, i) : -1));
  const moving = [...rows.keys()].filter((i) => swings[i] && !rows[i].still);
  const held = system.cart.stiffness > 0;
  if (moving.length !== families.length + held) return byShares(families, moving, family, held ? null : []);
  const push = moving.map((i) => rows[i].swing.x[0] ** 2 / rows[i].swing.inertia);
  const own = held ? push.indexOf(Math.max(...push)) : -1;
  moving.forEach((i, j) => (family[i] = j === own ? -1 : j - (held && j > own)));
  return family;
}

function onStructure(system, rows, swings, families, M, K) {
  const family = rows.map((row, i) => (swings[i] ? stillIn(families, row, i) : -1));
  const moving = [...rows.keys()].filter((i) => swings[i] && family[i] < 0);
  const momenta = momentaOf(rows, M);
  const carried = system.lead ? within(M, K, 0, system.lead).map(({ s }) => sharesOf(momenta, M, 0, s)) : [];
  return byShares(families, moving, family, carried);
}

// Every moving row to what it has most of, each of the structure's own modes to one row.
function byShares(families, moving, family, carried) {
  const entries = moving.flatMap((i) => [
    ...families.map(({ held }, number) => ({ i, number, share: held[i] })),
    ...(carried ?? []).map((shares, mode) => ({ i, number: -1, mode, share: shares[i] })),
  ]);
  let room = moving.length - (carried?.length ?? 1);
  const [rowsTaken, modesTaken] = [new Set(), new Set()];
  for (const { i, number, mode } of entries.toSorted((one, other) => other.share - one.share)) {
    if (rowsTaken.has(i) || (number < 0 ? modesTaken.has(mode) : room <= 0)) continue;
    rowsTaken.add(i);
    family[i] = number;
    if (number < 0) modesTaken.add(mode);
    else room--;
  }
  return family;
}
