// The modes of a scene without its dampers and drives: M f w^2 = K f, by symmetry first, then dense.
//
// Equal pendula separate exactly: moving alike they are one heavy pendulum; moving against each other they leave the
// cart still, and each swings as on a fixed support.  The frequency is the Rayleigh quotient of the shape, whose error
// is the square of the shape's.

import { isGuide, kappaOf } from "./amplitude.js";
import { structureModes } from "./structure_modes.js";
import { orderOf, sum } from "./system.js";
import { eigen, formsOf, inertiaOf, matricesOf, zeros } from "./matrices.js";

// Rows in ascending order of frequency: omega (rad/s), growing (whether it grows at that rate instead), multiplicity,
// shapes (cart in m and every angle, largest angle 1), kappa, onePercent (degrees), ratio (of the dampers, to first
// order), beat (s, with the next row), resonant, and the `swing` of these.
export function modesOf(system) {
  if (system.structure) return structured(system);
  const kinds = kindsOf(system.chains);
  const rows = kinds.flatMap((kind) => alone(system, kind));
  if (system.cart) rows.push(...together(system, kinds));
  rows.sort((one, other) => one.omega - other.omega);
  rows.forEach((row, i) => describe(system, rows, row, i));
  return rows;
}

// Those of a structure have no range of validity here.
function structured(system) {
  const rows = structureModes(system);
  rows.forEach((row, i) => Object.assign(row, { kappa: NaN, onePercent: NaN, resonant: false, beat: beatOf(row, rows[i + 1]) }));
  return rows;
}

function beatOf(row, next) {
  const beats = next && [row, next].every((one) => mannerOf(one) === "swings");
  return beats ? (2 * Math.PI) / (next.omega - row.omega) : NaN;
}

// What a row does when it is let go: "swings", "grows", "decays" (overdamped to first order), or "shifts" everything.
export function mannerOf({ omega, growing, ratio }) {
  if (!omega) return "shifts";
  if (growing) return "grows";
  return ratio >= 1 ? "decays" : "swings";
}

function kindsOf(chains) {
  const kinds = new Map();
  for (const chain of chains) {
    const key = JSON.stringify(chain.links.map(({ numbers }) => numbers));
    if (!kinds.has(key)) kinds.set(key, []);
    kinds.get(key).push(chain);
  }
  return [...kinds.values()];
}

// The modes of one kind of pendulum with the support at rest.
function alone(system, kind) {
  const fold = kind.length - (system.cart ? 1 : 0);
  if (!fold) return [];
  const chains = [kind[0]];
  const { M, K } = matricesOf(chains, null, [1]);
  const own = (matrix) => matrix.slice(1).map((row) => row.slice(1));
  return eigen(own(M), own(K)).map((vector) => {
    const x = Float64Array.of(0, ...vector);
    const shapes = Array.from({ length: fold }, (_, copy) => {
      const shape = new Float64Array(system.size);
      const share = (chain, factor) => vector.forEach((value, i) => (shape[1 + chain.first + i] = factor * value));
      if (!system.cart) share(kind[copy], 1);
      else {
        for (let other = 0; other <= copy; other++) share(kind[other], 1 / (copy + 1));
        share(kind[copy + 1], -1);
      }
      return shape;
    });
    return row(shapes, x, chains, null, system.gravity, [1], system.cart ? "cart still" : "fixed support");
  });
}

// The modes in which all pendula of a kind move alike, with the cart.
function together(system, kinds) {
  const { cart, gravity } = system;
  const chains = kinds.map((kind) => kind[0]);
  const weights = kinds.map((kind) => kind.length);
  const { M, K } = matricesOf(chains, cart, weights);
  const free = !cart.stiffness;
  const vectors = free ? withoutCart(M, K) : eigen(M, K);
  const found = vectors.map((x) => row([spread(system, kinds, x)], x, chains, cart, gravity, weights, "cart moves"));
  if (free) {
    const shape = new Float64Array(system.size);
    shape[0] = 1;
    found.push({ omega: 0, growing: false, multiplicity: 1, shapes: [shape], ratio: 0, where: "rigid translation" });
  }
  return found;
}

// A free cart follows the pendula, x = -b'f/M: what remains is a problem of the angles alone.
function withoutCart(M, K) {
  const n = M.length - 1;
  const reduced = zeros(n);
  for (let i = 0; i < n; i++) for (let j = 0; j < n; j++) reduced[i][j] = M[1 + i][1 + j] - (M[0][1 + i] * M[0][1 + j]) / M[0][0];
  const links = K.slice(1).map((line) => line.slice(1));
  return eigen(reduced, links).map((f) => Float64Array.of(-sum([...f].map((value, i) => M[0][1 + i] * value)) / M[0][0], ...f));
}

function spread(system, kinds, x) {
  const shape = new Float64Array(system.size);
  shape[0] = x[0];
  let at = 1;
  for (const kind of kinds) {
    for (const chain of kind) for (let i = 0; i < chain.links.length; i++) shape[1 + chain.first + i] = x[at + i];
    at += kind[0].links.length;
  }
  return shape;
}

function row(shapes, x, chains, cart, gravity, weights, where) {
  const [inertia, stiffness, drag] = formsOf(chains, cart, weights, x, x);
  const square = stiffness / inertia;
  const omega = Math.sqrt(Math.abs(square));
  const ratio = omega && square > 0 ? drag / (2 * omega * inertia) : 0;
  const unit = scaled(x);
  const swing = { omega, x: unit, chains, weights, inertia: inertiaOf(chains, cart, weights, unit), gravity };
  return { omega, growing: square < 0, multiplicity: shapes.length, shapes: shapes.map(scaled), ratio, where, swing };
}

// The largest angle 1, the first of the largest positive.
function scaled(shape) {
  const angles = [...shape.slice(1)];
  const largest = Math.max(...angles.map(Math.abs));
  const leading = angles.find((value) => Math.abs(value) > (1 - 1e-9) * largest) || shape[0];
  return shape.map((value) => value / leading);
}

function describe(system, rows, row, i) {
  const swings = ({ omega, growing }) => omega > 0 && !growing;
  row.kappa = swings(row) ? kappaOf(row.swing) : NaN;
  row.onePercent = Number.isNaN(row.kappa) ? NaN : (Math.sqrt(0.01 / Math.abs(row.kappa)) * 180) / Math.PI;
  row.beat = beatOf(row, rows[i + 1]);
  const partners = rows.filter((other) => other !== row && swings(other) && (system.cart || other.swing.chains === row.swing.chains));
  row.resonant = swings(row) && ((row.multiplicity > 1 && system.cart !== null) || isGuide(row, partners));
  const where = row.multiplicity > 1 ? `${row.where}, ${row.multiplicity}-fold` : row.where;
  const antiphase = row.where === "cart still" ? "antiphase" : "";
  const motion = [antiphase, agreementOf(system, row), orderIn(system, row), row.growing ? "unstable" : ""].filter(Boolean);
  row.words = motion.length ? `${where}: ${motion.join(", ")}` : where;
}

// The kinetic energy of each chain in a mode, up to a factor.
function energiesIn(system, { shapes: [shape] }) {
  return system.chains.map(({ first, links }) => {
    const own = Float64Array.of(shape[0], ...shape.slice(1 + first, 1 + first + links.length));
    return inertiaOf([{ links }], null, null, own);
  });
}

// How the pendula with a fair share of the energy agree, by their first links; with a cart on a spring also whether they
// swing with it or against it, which tells its own mode from theirs.
function agreementOf(system, row) {
  if (!row.omega || row.where !== "cart moves") return "";
  const many = system.chains.length > 1;
  if (!many && !system.cart.stiffness) return "";
  const energies = energiesIn(system, row);
  const most = Math.max(...energies);
  const busy = system.chains.filter((_, i) => energies[i] >= 0.01 * most);
  if (many && busy.length === 1) return `mostly pendulum ${system.chains.indexOf(busy[0]) + 1}`;
  const [shape] = row.shapes;
  const tops = busy.map(({ first }) => shape[1 + first]);
  if (!tops.every((top) => top * tops[0] > 0 || !many)) return "mixed phases";
  if (!system.cart.stiffness || !tops[0] || !shape[0]) return many ? "in phase" : "";
  if (tops[0] * shape[0] > 0) return many ? "pendula follow" : "pendulum follows";
  return many ? "pendula opposed" : "pendulum opposed";
}

// How the links of the chain that moves most agree.
function orderIn(system, row) {
  if (!row.omega) return "";
  const energies = energiesIn(system, row);
  const chain = system.chains[energies.indexOf(Math.max(...energies))];
  return orderOf([...row.shapes[0].slice(1 + chain.first, 1 + chain.first + chain.links.length)]);
}
