// The modes of a scene without its drives, in the rows and under the numbers of the table of modes: M f w^2 = K f, with
// dampers (l^2 M + l D + K) f = 0; by symmetry first, then dense.
//
// Equal pendula separate exactly: moving alike they are one heavy pendulum; moving against each other they leave the
// cart still, and each swings as on a fixed support.  An undamped frequency is the Rayleigh quotient of the shape, whose
// error is the square of the shape's.

import { isGuide, kappaOf, LIGHT, onePercentOf } from "./amplitude.js";
import { beatsOf } from "./families.js";
import { structureModes } from "./structure_modes.js";
import { eigen, formsIn, formsOf, gathered, inertiaOf, matricesBy, matricesOf, zeros } from "./matrices.js";
import { aligned, dampedModes, decayOf, undampedMode } from "./shapes.js";
import { busyIn, following, orderIn, partly, topOf } from "./words.js";

const [SAME, STILL] = [1e-13, 1e-11];

// Rows as in the table, by |l|: omega = |l| (rad/s), ratio = -Re l/|l|, turn = |Im l|, growing (without a swing),
// multiplicity, shapes (cart in m and every angle, largest angle 1, real there), twists (their imaginary parts, null
// without dampers), words, kappa, onePercent (degrees), resonant, and beat (s, with the next row, NaN for unrelated ones).
export function modesOf(system) {
  const rows = system.structure ? structureModes(system) : plainModes(system);
  const beats = beatsOf(system, rows);
  rows.forEach((row, i) => (row.beat = beats[i]));
  return rows;
}

// The slowest swing without dampers (rad/s), that of the drawing of dampers by their share of critical damping.
export function slowestOf(system) {
  const { M, K } = matricesBy(system.size, (x, z) => formsIn(system, x, z));
  const [from, most] = [system.cart || system.structure ? 0 : 1, system.gravity / Math.max(...system.links.map(({ l }) => l))];
  const parts = [M, K].map((S) => S.slice(from).map((line) => line.slice(from)));
  const squares = eigen(...parts).map((x) => {
    const whole = Float64Array.from({ length: system.size }, (_, i) => x[i - from] ?? 0);
    const [inertia, stiffness] = formsIn(system, whole);
    return stiffness / inertia;
  });
  return Math.sqrt(Math.min(...squares.filter((square) => square > 1e-9 * most), most * 1e12));
}

function plainModes(system) {
  const kinds = kindsOf(system.chains);
  const parts = kinds.flatMap((kind) => alone(system, kind));
  if (system.cart) parts.push(...together(system, kinds));
  parts.sort((one, other) => one.omega - other.omega || one.rate - other.rate);
  const isSame = (own, first) => first.still && own.still && Math.hypot(own.rate - first.rate, own.turn - first.turn) <= SAME * own.omega;
  const rows = gathered(parts, isSame).map(rowOf);
  for (const row of rows) row.words = wordsOf(system, kinds, row);
  judged(system, rows);
  return rows;
}

function kindsOf(chains) {
  const kinds = new Map();
  for (const chain of chains) {
    const key = JSON.stringify(chain.links.map(({ m, l, c, I, rotor, damping, stiffness, drag, s }) => [m, l, c, I, rotor, damping, stiffness, drag, s]));
    if (!kinds.has(key)) kinds.set(key, []);
    kinds.get(key).push(chain);
  }
  return [...kinds.values()];
}

// ------------------------------------------------------------------------------------------------ parts of rows

// The modes of one kind of pendulum with the support at rest.
function alone(system, kind) {
  const fold = kind.length - (system.cart ? 1 : 0);
  if (!fold) return [];
  const chains = [kind[0]];
  const { M, K } = matricesOf(chains, null, [1]);
  const links = (matrix) => matrix.slice(1).map((row) => row.slice(1));
  const vectors = eigen(links(M), links(K)).map((vector) => Float64Array.of(0, ...vector));
  const problem = { chains, cart: null, weights: [1], gravity: system.gravity, still: true, kind };
  return solved(problem, vectors).map((mode) => {
    const copies = Array.from({ length: fold }, (_, copy) => (x) => {
      const shape = new Float64Array(system.size);
      const share = ({ first }, factor) => shape.set(x.slice(1).map((value) => factor * value), 1 + first);
      if (!system.cart) share(kind[copy], 1);
      else {
        for (let other = 0; other <= copy; other++) share(kind[other], 1 / (copy + 1));
        share(kind[copy + 1], -1);
      }
      return shape;
    });
    return part(problem, mode, copies);
  });
}

// The modes in which all pendula of a kind move alike, with the cart.
function together(system, kinds) {
  const { cart, gravity } = system;
  const chains = kinds.map((kind) => kind[0]);
  const weights = kinds.map((kind) => kind.length);
  const { M, K } = matricesOf(chains, cart, weights);
  const rigid = Float64Array.from(M, (_, i) => (i ? 0 : 1));
  const vectors = cart.stiffness ? eigen(M, K) : [rigid, ...withoutCart(M, K)];
  const problem = { chains, cart, weights, gravity, kind: null };
  const spread = (x) => spreadOver(system, kinds, x);
  const parts = solved(problem, vectors).map((mode) => part(problem, mode, [spread]));
  if (!cart.stiffness) parts.push(part({ ...problem, rigid: true }, { omega: 0, ratio: 0, rate: 0, turn: 0, x: rigid, twist: null }, [spread]));
  return parts;
}

// A free cart follows the pendula, x = -b'f/M: what remains is a problem of the angles alone.
function withoutCart(M, K) {
  const n = M.length - 1;
  const reduced = zeros(n);
  for (let i = 0; i < n; i++) for (let j = 0; j < n; j++) reduced[i][j] = M[1 + i][1 + j] - (M[0][1 + i] * M[0][1 + j]) / M[0][0];
  const links = K.slice(1).map((line) => line.slice(1));
  return eigen(reduced, links).map((f) => Float64Array.of(-f.reduce((total, value, i) => total + M[0][1 + i] * value, 0) / M[0][0], ...f));
}

function spreadOver(system, kinds, x) {
  const shape = new Float64Array(system.size);
  shape[0] = x[0];
  let at = 1;
  for (const kind of kinds) {
    const angles = x.slice(at, (at += kind[0].links.length));
    for (const { first } of kind) shape.set(angles, 1 + first);
  }
  return shape;
}

// The modes of a problem from its undamped ones: those of a free cart's place are left out.
function solved({ chains, cart, weights }, vectors) {
  const form = (x, z = x) => formsOf(chains, cart, weights, x, z);
  const damped = cart?.damping || chains.some(({ links }) => links.some(({ damping, drag }) => damping || drag));
  return damped ? dampedModes(vectors, form) : vectors.map((x) => undampedMode(x, form)).filter(({ omega }) => omega);
}

// A part of a row: modes of one frequency from one problem, one for each of `copies`.
function part(problem, { omega, ratio, rate, turn, x, twist }, copies) {
  const { chains, cart, weights, gravity } = problem;
  const [own, aside] = aligned(x, twist);
  const held = !problem.still && !problem.rigid && Math.hypot(own[0], aside?.[0] ?? 0) <= STILL * reachOf(chains);
  if (held) own[0] = 0;
  if (held && aside) aside[0] = 0;
  const still = problem.still || held;
  const inertia = inertiaOf(chains, cart, weights, own) + (aside ? inertiaOf(chains, cart, weights, aside) : 0);
  const swing = { omega, x: own, chains, cart, weights, inertia, gravity };
  const shapes = copies.map((copy) => aligned(copy(own), aside && copy(aside)));
  return { omega, ratio, rate, turn, shapes, swing, aside, still, rigid: problem.rigid, alone: problem.still, kind: problem.kind };
}

const reachOf = (chains) => Math.max(...chains.map(({ links }) => links.reduce((total, { l, c }) => total + Math.max(l, c), 0)));

// Parts of one frequency as one row: those that leave the cart still, and those of different pendula on what is fixed.
function rowOf(parts) {
  const [{ omega, ratio, rate, turn, still, rigid, swing, aside }] = parts;
  const pairs = parts.flatMap((each) => each.shapes);
  const shapes = pairs.map(([shape]) => shape);
  const twists = aside && pairs.map(([shape, twist]) => twist ?? shape.map(() => 0));
  const growing = rate > 0 && !turn;
  return { omega, ratio, rate, turn, growing, still, rigid, multiplicity: shapes.length, shapes, twists, swing, parts };
}

// ------------------------------------------------------------------------------------------ how far it is linear

// kappa, the angle of 1 % and the star of every row, as `modal.modes.rows` has them.
function judged(system, rows) {
  const lightly = ({ omega, rate }) => omega > 0 && Math.abs(rate) < LIGHT * omega;
  for (const row of rows) {
    row.kappa = lightly(row) ? kappaOf(row.swing, row.parts[0].aside) : NaN;
    row.onePercent = onePercentOf(row.kappa);
  }
  for (const row of rows) {
    const akin = (other) => system.cart || other.parts.some(({ kind }) => row.parts.some((own) => own.kind === kind));
    const partners = rows.filter((other) => other !== row && lightly(other) && akin(other));
    const several = row.multiplicity > 1 && system.cart !== null;
    row.resonant = Number.isFinite(row.kappa) && (several || isGuide(row, partners));
  }
}

// -------------------------------------------------------------------------------------------------------- words
// As in `modal.modes.rows`.

function wordsOf(system, kinds, row) {
  if (row.rigid) return "rigid translation";
  const [head] = row.parts;
  const folds = row.multiplicity > 1 ? ` (${row.multiplicity} degenerate modes)` : "";
  const where = `${!system.cart ? "fixed support" : row.still ? "cart still" : "cart moves"}${folds}`;
  const antiphase = row.parts.some((own) => own.alone && system.cart) ? "antiphase" : "";
  const x = { real: row.shapes[0], twist: row.twists?.[0] ?? null };
  const agreement = head.alone ? whose(system, kinds, row) : agreementOf(system, kinds, row, x);
  const motion = [antiphase, agreement, orderIn(system, x), decayOf(row)].filter(Boolean);
  return motion.length ? `${where}: ${motion.join(", ")}` : where;
}

function named(system, kind) {
  const first = system.chains.indexOf(kind[0]) + 1;
  return kind.length === 1 ? `pendulum ${first}` : `the ${kind.length} equal to pendulum ${first}`;
}

// The pendula that move while all others are at rest, where there are different ones.
function whose(system, kinds, { parts }) {
  const moving = new Set(parts.map(({ kind }) => kind));
  return kinds.length === 1 || moving.size > 1 ? "" : named(system, [...moving][0]);
}

// How the pendula with a fair share of the energy agree, by their first links; of a cart on a spring that moves, whether
// they swing with it or against it, which tells its own mode from theirs.
function agreementOf(system, kinds, { still }, x) {
  const busy = busyIn(system, x);
  const moving = kinds.filter((kind) => busy.some((number) => kind.includes(system.chains[number])));
  if (kinds.length > 1 && moving.length === 1) return `mostly ${named(system, moving[0])}`;
  const tops = partly(x, busy.map((number) => topOf(system, number)));
  if (kinds.length > 1 && tops.some((top) => !(top * tops[0] > 0))) return still ? "antiphase" : "mixed phases";
  const alike = system.chains.length > 1 ? "in phase" : "";
  return still || !system.cart?.stiffness ? alike : following(system, x) || alike;
}
