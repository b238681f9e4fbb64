// The modes of a structure without its drives: M f w^2 = K f, or with D, of all its coordinates, with the matrices that
// the text of the scene gives.

import { kappaOf, LIGHT, onePercentOf } from "./amplitude.js";
import { coordinatesOf, pivotsAt } from "./carriers.js";
import { eigen, formsIn, formsOf, inertiaOf, matricesBy } from "./matrices.js";
import { aligned, dampedModes, decayOf, inPhase, undampedMode } from "./shapes.js";
import { orderOf, sum } from "./system.js";

const [SAME, NOTHING, NEGLIGIBLE, STILL, SMALL] = [1e-10, 1e-13, 0.01, 1e-7, 1e-6];
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
  return gathered(modes).map((group) => rowOf(system, M, group));
}

function gathered(modes) {
  const groups = [];
  for (const mode of modes) {
    const group = groups.findLast(([first]) => Math.hypot(mode.rate - first.rate, mode.turn - first.turn) <= SAME * first.omega);
    if (group) group.push(mode);
    else groups.push([mode]);
  }
  return groups;
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
function shakes({ lead, size, chains }, x) {
  const pushes = chains.map(({ first, links }) => sum(links.map(({ b, s }, i) => b * s * x[lead + first + i] ** 2)));
  const largest = Math.max(...pushes.map(Math.abs));
  return Array.from({ length: lead }, (_, k) => {
    const pivots = pivotsMoved(Float64Array.from({ length: size }, (__, i) => (i === k ? 1 : 0)));
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
  const motion = mode.omega ? [told, orderOf(busiest(system, x)), decayOf(mode)] : ["free"];
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

// Real parts of these coordinates where the largest of them is real.
const partly = ({ real, twist }, places) => inPhase(places.map((i) => real[i]), twist && places.map((i) => twist[i]));

// The kinetic energy of each chain, up to a factor, with the motion of its pivot.
function energiesOf({ chains, lead }, { real, twist }) {
  const parts = [real, twist].filter(Boolean).map((x) => ({ x, pivots: pivotsMoved(x) }));
  return chains.map(({ first, links }, number) => {
    const mass = sum(links.map(({ m }) => m));
    return sum(
      parts.map(({ x, pivots: { [number]: [along, down] } }) => {
        const angles = x.slice(lead + first, lead + first + links.length);
        return inertiaOf([{ links }], null, null, Float64Array.of(along, ...angles)) + mass * down ** 2;
      }),
    );
  });
}

// How the pivots move in a small motion, each along the rail and down.
function pivotsMoved(x) {
  const [ahead, back] = [SMALL, -SMALL].map((step) => pivotsAt(x.map((value) => step * value)));
  return ahead.map(([along, down], number) => [(along - back[number][0]) / 2 / SMALL, (down - back[number][1]) / 2 / SMALL]);
}

function busy(system, x) {
  const energies = energiesOf(system, x);
  return system.chains.flatMap((chain, number) => (energies[number] >= NEGLIGIBLE * Math.max(...energies) ? [number] : []));
}

function busiest(system, x) {
  const energies = energiesOf(system, x);
  const { first, links } = system.chains[energies.indexOf(Math.max(...energies))];
  return partly(x, links.map((_, i) => system.lead + first + i));
}

const topOf = ({ chains, lead }, number) => lead + chains[number].first;

// Whether all pendula with a fair share of the energy swing with their pivots or against; "" for neither.
function following(system, x) {
  const [along, aside] = [x.real, x.twist].map((part) => part && pivotsMoved(part).map((pivot) => pivot[0]));
  const signs = busy(system, x).map((number) => {
    const top = topOf(system, number);
    return Math.sign(x.real[top] * along[number] + (aside ? x.twist[top] * aside[number] : 0));
  });
  if (!signs[0] || signs.some((sign) => sign !== signs[0])) return "";
  const pendula = system.chains.length > 1 ? "pendula" : "pendulum";
  if (signs[0] > 0) return `${pendula} in phase with the support`;
  return `${pendula} in antiphase with the support`;
}

// How pendula with a fair share of the energy agree, by their first links.
function phasesOf(system, x) {
  const tops = partly(x, busy(system, x).map((number) => topOf(system, number)));
  if (system.chains.length < 2) return "";
  if (tops.length < 2) return `mostly pendulum ${busy(system, x)[0] + 1}`;
  return tops.every((top) => top * tops[0] > 0) ? "in phase" : "antiphase";
}
