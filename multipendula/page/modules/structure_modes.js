// The modes of a structure without its drives: M f w^2 = K f, or with D, of all its coordinates, with the matrices that
// the text of the scene gives.

import { kappaOf, LIGHT, onePercentOf } from "./amplitude.js";
import { coordinatesOf } from "./carriers.js";
import { eigen, formsIn, formsOf, gathered, matricesBy } from "./matrices.js";
import { aligned, dampedModes, decayOf, undampedMode } from "./shapes.js";
import { sum } from "./system.js";
import { busyIn, following, orderIn, partly, pivotsMoved, topOf } from "./words.js";

const [SAME, NOTHING, NEGLIGIBLE, STILL] = [1e-10, 1e-13, 0.01, 1e-7];
const MOST_NAMED = 3;

// Rows as those of `modesOf`; of equal frequencies one.  What a carrier moves in metres counts as an angle over the
// longest pendulum.  A range of validity have those of pendula alone, which leave all else at rest.
export function structureModes(system) {
  const { M, K, D } = matricesBy(system.size, (x, z) => formsIn(system, x, z));
  const form = (x, z = x) => formsIn(system, x, z);
  const vectors = eigen(M, K);
  const undamped = vectors.map((x) => undampedMode(x, form));
  const most = Math.max(...undamped.map(({ omega }) => omega ** 2));
  const isFree = (square) => Math.abs(square) <= NOTHING * most;
  const free = undamped.filter(({ omega }) => isFree(omega ** 2)).map((mode) => ({ ...mode, omega: 0, ratio: 0, rate: 0, turn: 0 }));
  const damped = D.some((line) => line.some(Boolean));
  const others = damped ? dampedModes(vectors, form, isFree) : undamped.filter(({ omega }) => !isFree(omega ** 2));
  const modes = [...free, ...others].sort((one, other) => one.omega - other.omega || one.rate - other.rate);
  const isSame = (mode, first) => Math.hypot(mode.rate - first.rate, mode.turn - first.turn) <= SAME * first.omega;
  return gathered(modes, isSame).map((group) => rowOf(system, M, group));
}

function rowOf(system, M, group) {
  const sizes = coordinatesOf().map(({ unit }) => (unit === "rad" ? 1 : 1 / system.reach));
  const weights = Float64Array.from({ length: system.size }, (_, i) => sizes[i] ?? 1);
  const shapes = group.map(({ x, twist }) => aligned(x, twist, system.lead, weights));
  const [{ omega, ratio, rate, turn, twist }] = group;
  const words = wordsFor(system, M, shapes, group[0]);
  const twists = twist && shapes.map(([, own]) => own);
  const kappa = omega && Math.abs(rate) < LIGHT * omega ? kappaAlone(system, group[0], shapes[0]) : NaN;
  const judged = { kappa, onePercent: onePercentOf(kappa), resonant: false };
  return { omega, ratio, rate, turn, growing: rate > 0 && !turn, multiplicity: group.length, shapes: shapes.map(([x]) => x), twists, words, ...judged };
}

// That of the chain that moves most, where the row is a mode of it alone, no spring holds it and it shakes no pivot up and down.
function kappaAlone(system, { omega }, [x, twist]) {
  const { lead, chains, gravity } = system;
  const held = (part) => part.slice(0, lead).every((value) => Math.abs(value) <= STILL);
  if (!held(x) || (twist && !held(twist))) return NaN;
  const largest = x.indexOf(Math.max(...x));
  const { first, links } = chains.findLast((chain) => lead + chain.first <= largest);
  if (shakes(system, x)) return NaN;
  const own = (part) => Float64Array.of(0, ...part.slice(lead + first, lead + first + links.length));
  const [shape, aside] = [own(x), twist && own(twist)];
  const [inertia, stiffness] = formsOf([{ links }], null, null, shape, shape);
  const only = x.map((value, i) => (i >= lead + first && i < lead + first + links.length ? value : 0));
  if (Math.abs(formsIn(system, only)[1] - stiffness) > SAME * Math.abs(stiffness)) return NaN;
  if (!(Math.abs(stiffness / inertia / omega ** 2 - 1) < (twist ? LIGHT ** 2 : SAME))) return NaN;
  return kappaOf({ omega, x: shape, chains: [{ links }], cart: null, weights: [1], inertia, gravity }, aside);
}

// Whether a shape pushes pivots that the structure moves down: it then answers at twice the frequency, and changes kappa.
function shakes(system, x) {
  const { lead, size, chains } = system;
  const pushes = chains.map(({ first, links }) => sum(links.map(({ b, s }, i) => b * s * x[lead + first + i] ** 2)));
  const largest = Math.max(...pushes.map(Math.abs));
  return Array.from({ length: lead }, (_, k) => {
    const pivots = pivotsMoved(system, Float64Array.from({ length: size }, (__, i) => (i === k ? 1 : 0)));
    return sum(pivots.map(([, down], number) => down * pushes[number]));
  }).some((push) => Math.abs(push) > STILL * largest);
}

// ------------------------------------------------------------------------------------------------ words
// As in `modal.modes.rows`, whose vocabulary comes with the coordinates.

function wordsFor(system, M, shapes, mode) {
  const [[real, twist]] = shapes;
  const x = { real, twist, sizes: real.map((value, i) => Math.hypot(value, twist?.[i] ?? 0)) };
  const folds = shapes.length > 1 ? ` (${shapes.length} degenerate modes)` : "";
  const moved = movedBy(system, M, x);
  const where = moved.length ? moving(moved, x) : system.lead ? "supports at rest" : "fixed support";
  const told = moved.length ? following(system, x) || phasesOf(system, x) : phasesOf(system, x);
  const motion = mode.omega ? [told, orderIn(system, x), decayOf(mode)] : ["free"];
  const words = motion.filter(Boolean).join(", ");
  return words ? `${where}${folds}: ${words}` : `${where}${folds}`;
}

// The coordinates of carriers with a fair share of what carriers move; none where they are still.
function movedBy({ lead }, M, { sizes }) {
  const weights = [...sizes].map((size, i) => size * Math.sqrt(M[i][i]));
  const most = Math.max(0, ...weights.slice(0, lead));
  if (most <= STILL * Math.max(...weights)) return [];
  return weights.slice(0, lead).flatMap((weight, i) => (weight >= NEGLIGIBLE * most ? [i] : []));
}

function moving(moved, x) {
  const coordinates = coordinatesOf();
  const own = moved.map((i) => coordinates[i]);
  const listed = (words) => (words.length > 1 ? `${words.slice(0, -1).join(", ")} and ${words.at(-1)}` : words[0]);
  const [{ kind, alike, counted }] = own;
  if (moved.length > 1 && alike && own.every((one) => one.kind === kind)) {
    const along = partly(x, moved);
    const agree = along.every((value) => value * along[0] > 0);
    const phase = agree ? "in phase" : moved.length === 2 ? "in antiphase" : "in mixed phases";
    const every = moved.length === coordinates.filter((one) => one.kind === kind).length;
    if (!every && moved.length <= MOST_NAMED) return `${listed(own.map(({ named }) => named))} ${phase}`;
    return `${counted[moved.length] ?? moved.length} ${alike} ${phase}`;
  }
  const carriers = [...new Set(own.map(({ carrier }) => carrier))];
  if (carriers.length > MOST_NAMED) return `${moved.length} coordinates move`;
  return carriers
    .map((carrier) => {
      const each = own.filter((one) => one.carrier === carrier);
      return `${each[0].named} ${listed([...new Set(each.map(({ verb }) => verb))])}`;
    })
    .join(", ");
}

// How pendula with a fair share of the energy agree, by their first links.
function phasesOf(system, x) {
  const busy = busyIn(system, x);
  if (system.chains.length < 2) return "";
  if (busy.length < 2) return `mostly pendulum ${busy[0] + 1}`;
  const tops = partly(x, busy.map((number) => topOf(system, number)));
  return tops.every((top) => top * tops[0] > 0) ? "in phase" : "antiphase";
}
