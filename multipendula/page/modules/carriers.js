// Supports: how they are drawn, and of structures what the text of `structure` takes and gives.  The state is (carriers'
// coordinates, angles, their rates, work); which numbers of the scene stand where is told by Python, which wrote that text.

import { drawing } from "./drawing.js";
import { structure } from "./structure.js";

const BEFORE = 1; // entries before those of links: gravity
const FIELDS = 9; // numbers of a link among the entries, the first of its `numbers`
const BALANCED = 1e-8; // of gravity

export const isStructure = () => structure !== null;

// The coordinates of the carriers, each with its carrier, kind, unit ("m", "rad" or none) and name.
export const coordinatesOf = () => drawing.coordinates;

// What changes of a system with the numbers of its scene; an error where these leave the scene as drawn no equilibrium.
export function carriedBy(scene, links) {
  const [lead, units] = [coordinatesOf().length, structure.constants];
  const rest = new Float64Array(2 * (lead + links.length) + 1);
  links.forEach((link, k) => (rest[lead + k] = link.rest));
  const prescribed = units.map(([place, unit], k) => scaled(placed(scene, place), unit) ?? structure.prescribed[k]);
  const entries = entriesOf(scene, links);
  const constants = (acting) => Float64Array.from(structure.steps.constants([...structure.kept.map((k) => entries[k]), ...acting]));
  balanced(scene, rest, constants(prescribed.map(() => 0)));
  return { rest, constants: constants(prescribed), bases: structure.bases };
}

const scaled = (value, unit) => (value === undefined ? null : value * unit);

// The value at a place of a scene; undefined where the file leaves it out.
export const placed = (scene, place) => place.reduce((part, key) => part?.[key], scene);

// The place in a scene of the support of a number.
export const supportPlace = ({ support }, number) => (Array.isArray(support) ? ["support", number] : ["support"]);

// The numbers of supports and springs that may change: those that are not 0, which the text has, and all dampers.
export function numbersOf(scene) {
  const supports = [scene.support].flat().map(({ name, kind }, k) => {
    const place = supportPlace(scene, k);
    const ofWhole = Object.keys(UNITS).map((key) => ({ label: key.replace("_", " "), unit: UNITS[key], place: [...place, key] }));
    return { name: name ?? (kind === "cart" ? kind : "support"), numbers: [...ofWhole, ...lawsOf(k, place)] };
  });
  const springs = (scene.spring ?? []).map(({ kind }, k) => {
    const numbers = Object.keys(LAWS).map((law) => ({ label: law, unit: LAWS[law][kind === "torsion" ? "rad" : "m"], place: ["spring", k, law] }));
    return { name: `Spring ${k + 1}`, numbers };
  });
  const parts = [...supports, ...springs].map(({ name, numbers }) => ({ name, numbers: numbers.filter(({ place }) => isThere(scene, place)) }));
  return parts.filter(({ numbers }) => numbers.length);
}

const UNITS = { mass: "kg", inertia: "kg m²", friction: "N", friction_coefficient: "" };
const LAWS = { stiffness: { m: "N/m", rad: "N m/rad" }, damping: { m: "N s/m", rad: "N m s/rad" } };

// Stiffness and damping of every coordinate of a support.
function lawsOf(number, place) {
  const own = coordinatesOf().filter(({ carrier, unit }) => carrier === number && unit);
  return Object.keys(LAWS).flatMap((law) =>
    own.map(({ name, unit, kind }) => {
      const way = kind === "platform" ? name.split(" ").at(-1) : null;
      return { label: way ? `${law} in ${way}` : law, unit: LAWS[law][unit], place: [...place, law, ...(way ? [way] : [])] };
    }),
  );
}

const isThere = (scene, place) => placed(scene, place) > 0 || (place.includes("damping") && placed(scene, place.slice(0, -1)) !== undefined);
export const capital = (words) => words[0].toUpperCase() + words.slice(1);

// How many inputs of the text come before the forces on its coordinates.
export const leadingCount = () => structure.leading;

// The places in a scene of the motions of the ground or of a support, and these motions.
export function motionPlacesIn({ support }) {
  if (structure) return structure.motions;
  if (Array.isArray(support.motion)) return support.motion.map((_, k) => ["support", "motion", k]);
  return support.motion ? [["support", "motion"]] : [];
}

export const motionsIn = (scene) => motionPlacesIn(scene).map((place) => placed(scene, place));

function entriesOf(scene, links) {
  const entries = [...structure.entries];
  entries[0] = scene.gravity;
  links.forEach(({ numbers }, k) => {
    for (let field = 0; field < FIELDS; field++) entries[BEFORE + field * links.length + k] = numbers[field];
  });
  for (const [k, place] of structure.places) entries[k] = placed(scene, place) ?? entries[k];
  return entries;
}

function balanced(scene, rest, constants) {
  const size = (rest.length - 1) / 2;
  const out = new Float64Array(rest.length);
  structure.steps.rates(constants, rest, new Float64Array(size + structure.leading), null, out);
  const longest = Math.max(...scene.pendulum.flatMap(({ links }) => links.map(({ length }) => length)));
  if (!out.slice(size).every((value) => Math.abs(value) <= BALANCED * scene.gravity * Math.max(1, 1 / longest))) {
    throw new Error("the scene as drawn is no equilibrium");
  }
}

// A function f(t, y, out) for the derivative of y, or of small deviations from rest; `forces(t)` are those on all
// coordinates.
export function ratesOf({ size, leading, structure: { constants, rest } }, forces, linear) {
  const first = structure.leading;
  const inputs = new Float64Array(first + size);
  return (time, y, out) => {
    if (first) inputs.set(leading(time));
    if (forces) inputs.set(forces(time), first);
    if (linear) structure.steps.linear(constants, rest, inputs, y, out);
    else structure.steps.rates(constants, y, inputs, null, out);
  };
}

// Kinetic and potential energy (J), the latter from rest.
export function storedIn({ structure: { constants } }, y) {
  const energies = new Float64Array(2);
  structure.steps.stored(constants, y, null, null, energies);
  return { kinetic: energies[0], potential: energies[1] };
}

// The bilinear forms x'Mz, x'Kz and x'Dz of small motions of all coordinates.
export function pairedIn({ structure: { constants, rest } }, x, z) {
  const forms = new Float64Array(3);
  structure.steps.paired(constants, rest, x, z, forms);
  return forms;
}

// What impulses on all coordinates add to the rates.
export function impelledIn({ size, structure: { constants } }, y, impulses) {
  const rates = new Float64Array(size);
  structure.steps.impelled(constants, y, impulses, null, rates);
  return rates;
}

// ------------------------------------------------------------------------------------------------ drawing

const constants = drawing && drawing.functions.constants([]);

// Where the first joints of all pendula are, in metres along the rail and down.
export function pivotsAt(y) {
  const places = new Float64Array(2 * drawing.pendula);
  drawing.functions.pivots(constants, y, null, null, places);
  return paired(places);
}

// The lines and outlines of carriers, springs and ground: { role, carrier, closed, points }.
export function piecesAt(y, joints) {
  const places = new Float64Array(2 * drawing.pieces.reduce((total, { count = 0 }) => total + count, 0));
  drawing.functions.pieces(constants, y, joints.flat(2), null, places);
  const points = paired(places);
  let at = 0;
  return drawing.pieces.map((piece) => ({ ...piece, points: piece.points ? paired(piece.points) : points.slice(at, (at += piece.count)) }));
}

const paired = (values) => Array.from({ length: values.length / 2 }, (_, k) => [values[2 * k], values[2 * k + 1]]);

// Whether what is prescribed sets off what hangs at rest, and the state at which the scene starts, null at rest.
export const isPushed = () => drawing.pushed;
export const startGiven = () => structure.start;
