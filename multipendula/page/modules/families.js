// Which neighbours of the table beat with each other: modes of one family, as `modal.coupling` has families.
//
// A pendulum's own modes are those with all else at rest; those of one frequency are a family.  Its combinations that move
// nothing else stay at that frequency; every other mode belongs to the family, or to the mode of what carries the pendula,
// that has the largest share of its potential energy.  Of the energy of an own mode s a row has the share
// (f'M s)^2/(f'M f s'M s), over its shapes f; two rows of other families beat, too, where they pass half of it on and
// back, 4 p q.

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
  const family = byEnergy(system, rows, swings, families, M, K);
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
  const [momenta, forces] = [momentaOf(rows, M), momentaOf(rows, K)];
  return system.chains.flatMap(({ first, links }) => {
    const [from, to] = [system.lead + first, system.lead + first + links.length];
    const kind = JSON.stringify(links.map(({ m, l, c, I, rotor, stiffness }) => [m, l, c, I, rotor, stiffness]));
    const [alone, stored] = [[momenta, M], [forces, K]].map(([every, S]) => every.map((each) => each.map(({ x, Mx }) => partOf(x, Mx, S, from, to))));
    return within(M, K, from, to).map(({ square, s }) => ({
      square, kind, shares: sharesOf(momenta, M, from, s), parts: sharesOf(alone, M, from, s), stored: sharesOf(stored, K, from, s),
    }));
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
  const sum = ({ members }, name) => members[0][name].map((_, i) => members.reduce((total, mode) => total + mode[name][i], 0));
  return families.map((one) => ({ ...one, held: sum(one, "parts"), stored: sum(one, "stored") }));
}

// The family whose combinations a row is, all else at rest; -1 where there is none: what it has of it is a whole number.
function stillIn(families, row, i) {
  return families.findIndex(({ held }) => Math.abs(held[i] - row.multiplicity) < WHOLE);
}

// Every moving row to what has most of its potential energy, none of one mode of a carrier, and on a cart of one family, twice.
function byEnergy(system, rows, swings, families, M, K) {
  const family = rows.map((row, i) => (swings[i] && (system.structure || row.still) ? stillIn(families, row, i) : -1));
  const moving = [...rows.keys()].filter((i) => swings[i] && family[i] < 0 && (system.structure || !rows[i].still));
  const carried = system.lead ? within(M, K, 0, system.lead).filter(({ square }) => square > 0).map(({ s }) => sharesOf(momentaOf(rows, K), K, 0, s)) : [];
  const places = [
    ...families.map(({ stored, members }, number) => ({ number, shares: stored, room: system.cart ? 1 : members.length })),
    ...carried.map((shares) => ({ number: -1, shares, room: 1 })),
  ];
  const entries = moving.flatMap((i) => places.map((place) => ({ i, place, share: place.shares[i] })));
  const taken = new Set();
  for (const { i, place } of entries.toSorted((one, other) => other.share - one.share)) {
    if (taken.has(i) || !place.room) continue;
    taken.add(i);
    family[i] = place.number;
    place.room--;
  }
  return family;
}
