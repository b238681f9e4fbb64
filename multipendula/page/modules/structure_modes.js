// The modes of a structure without its dampers and drives: M f w^2 = K f of all coordinates, with the matrices that the
// text of the scene gives.

import { coordinatesOf } from "./carriers.js";
import { eigen, formsIn, matricesBy } from "./matrices.js";
import { sum } from "./system.js";

const [SAME, NOTHING, NEGLIGIBLE, STILL] = [1e-10, 1e-13, 0.01, 1e-7];

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

function wordsFor(system, M, shapes, square) {
  const folds = shapes.length > 1 ? `, ${shapes.length}-fold` : "";
  const moved = movedBy(system, M, shapes[0]);
  const where = moved.length ? moving(moved, shapes[0]) : system.lead ? "supports still" : "fixed support";
  const phases = moved.length || !square ? "" : phasesOf(system, M, shapes[0]);
  const motion = [phases, square < 0 ? "unstable" : ""].filter(Boolean).join(", ");
  return motion ? `${where}${folds}: ${motion}` : `${where}${folds}`;
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
  const names = [...new Set(moved.map((i) => coordinates[i].name))];
  if (names.length > 3) return `${moved.length} coordinates move`;
  const listed = names.length > 1 ? `${names.slice(0, -1).join(", ")} and ${names.at(-1)} move` : `${names[0]} moves`;
  const alike = moved.length > 1 && moved.every((i) => coordinates[i].unit && coordinates[i].kind === coordinates[moved[0]].kind);
  if (!alike || coordinates[moved[0]].kind === "platform") return listed;
  const agree = moved.every((i) => x[i] * x[moved[0]] > 0);
  return `${listed} ${agree ? "in phase" : moved.length === 2 ? "in antiphase" : "in mixed phases"}`;
}

// How pendula with a fair share of the energy agree, by their first links.
function phasesOf({ chains, lead }, M, x) {
  const energies = chains.map(({ first, links }) => sum(links.map((_, i) => M[lead + first + i][lead + first + i] * x[lead + first + i] ** 2)));
  const tops = chains.flatMap(({ first }, number) => (energies[number] >= NEGLIGIBLE * Math.max(...energies) ? [x[lead + first]] : []));
  if (tops.length < 2) return "";
  return tops.every((top) => top * tops[0] > 0) ? "in phase" : "antiphase";
}
