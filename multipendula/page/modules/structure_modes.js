// The modes of a structure without its dampers and drives: M f w^2 = K f of all coordinates, with the matrices that the
// text of the scene gives.

import { coordinatesOf, pivotsAt } from "./carriers.js";
import { eigen, formsIn, matricesBy } from "./matrices.js";
import { orderOf, sum } from "./system.js";

const [SAME, NOTHING, NEGLIGIBLE, STILL, SMALL] = [1e-10, 1e-13, 0.01, 1e-7, 1e-6];
const MOST_NAMED = 3;

// Rows as those of `modesOf`; of equal frequencies one, whose shapes are orthogonal.  What a carrier moves in metres
// counts as an angle over the longest pendulum.
export function structureModes(system) {
  const { M, K } = matricesBy(system.size, (x, z) => formsIn(system, x, z));
  const vectors = eigen(M, K).map((x) => ({ x, square: quotient(system, x) }));
  vectors.sort((one, other) => one.square - other.square);
  const most = Math.max(...vectors.map(({ square }) => Math.abs(square)));
  const groups = [];
  for (const { x, square } of vectors) {
    const own = Math.abs(square) <= NOTHING * most ? 0 : square;
    const last = groups.at(-1);
    if (last && Math.abs(own - last.square) <= SAME * Math.abs(own)) last.shapes.push(x);
    else groups.push({ square: own, shapes: [x] });
  }
  const rows = groups.map(({ square, shapes }) => {
    const omega = Math.sqrt(Math.abs(square));
    const scaled = shapes.map((x) => unit(system, x));
    const ratio = square > 0 ? sum(scaled.map((x) => ratioOf(system, x, omega))) / scaled.length : 0;
    return { omega, growing: square < 0, multiplicity: shapes.length, shapes: scaled, ratio, words: wordsFor(system, M, scaled, square) };
  });
  return rows.sort((one, other) => one.omega - other.omega);
}

function quotient(system, x) {
  const [inertia, stiffness] = formsIn(system, x);
  return stiffness / inertia;
}

function ratioOf(system, x, omega) {
  const [inertia, , drag] = formsIn(system, x);
  return drag / (2 * omega * inertia);
}

// The largest of the angles, and of distances over the longest pendulum, 1; the first of the largest positive.
function unit(system, x) {
  const coordinates = coordinatesOf();
  const sizes = [...x].map((value, i) => value / (i < system.lead && coordinates[i].unit !== "rad" ? system.reach : 1));
  const largest = Math.max(...sizes.map(Math.abs));
  const leading = sizes.find((value) => Math.abs(value) > (1 - 1e-9) * largest);
  return x.map((value) => value / leading);
}

// ------------------------------------------------------------------------------------------------ words
// As in `modal.modes.labels`, whose vocabulary comes with the coordinates.

function wordsFor(system, M, shapes, square) {
  const [x] = shapes;
  const folds = shapes.length > 1 ? `, ${shapes.length}-fold` : "";
  const moved = movedBy(system, M, x);
  const where = moved.length ? moving(moved, x) : system.lead ? "supports still" : "fixed support";
  const told = moved.length ? following(system, M, x) || phasesOf(system, M, x) : phasesOf(system, M, x);
  const motion = square ? [told, orderOf(busiest(system, M, x)), square < 0 ? "unstable" : ""] : ["free"];
  const words = motion.filter(Boolean).join(", ");
  return words ? `${where}${folds}: ${words}` : `${where}${folds}`;
}

// The coordinates of carriers with a fair share of what carriers move; none where they are still.
function movedBy({ lead }, M, x) {
  const weights = [...x].map((value, i) => Math.abs(value) * Math.sqrt(M[i][i]));
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
    const agree = moved.every((i) => x[i] * x[moved[0]] > 0);
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

// The energy of each chain, up to a factor.
function energiesOf({ chains, lead }, M, x) {
  return chains.map(({ first, links }) => sum(links.map((_, i) => M[lead + first + i][lead + first + i] * x[lead + first + i] ** 2)));
}

function busy(system, M, x) {
  const energies = energiesOf(system, M, x);
  return system.chains.flatMap((chain, number) => (energies[number] >= NEGLIGIBLE * Math.max(...energies) ? [number] : []));
}

function busiest(system, M, x) {
  const energies = energiesOf(system, M, x);
  const { first, links } = system.chains[energies.indexOf(Math.max(...energies))];
  return [...x.slice(system.lead + first, system.lead + first + links.length)];
}

const topOf = ({ chains, lead }, x, number) => x[lead + chains[number].first];

// Whether all pendula with a fair share of the energy swing with their pivots or against; "" for neither.
function following(system, M, x) {
  const pivots = [SMALL, -SMALL].map((step) => pivotsAt(x.map((value) => step * value)));
  const signs = busy(system, M, x).map((number) => Math.sign(topOf(system, x, number) * (pivots[0][number][0] - pivots[1][number][0])));
  if (!signs[0] || signs.some((sign) => sign !== signs[0])) return "";
  const many = system.chains.length > 1;
  if (signs[0] > 0) return many ? "pendula follow" : "pendulum follows";
  return many ? "pendula opposed" : "pendulum opposed";
}

// How pendula with a fair share of the energy agree, by their first links.
function phasesOf(system, M, x) {
  const tops = busy(system, M, x).map((number) => topOf(system, x, number));
  if (system.chains.length < 2) return "";
  if (tops.length < 2) return `mostly pendulum ${busy(system, M, x)[0] + 1}`;
  return tops.every((top) => top * tops[0] > 0) ? "in phase" : "antiphase";
}
