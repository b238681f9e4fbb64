// A scene as numbers: every copy of a pendulum is a chain of links, top link first, in SI units.
//
// A scene has the keys of a scene file, every link written out.  With s the direction of a link at equilibrium
// (1 down, -1 up), b = m c + l (mass below) its first moment and g b s what gravity adds to its stiffness.

import { carriedBy, coordinatesOf, isStructure, leadingCount, motionsIn, startGiven } from "./carriers.js";
import { courseOf, leadingOf } from "./courses.js";
import { full } from "./steps.js";
import { isWhole, wholeOf } from "./switched.js";

export function systemOf(scene) {
  const chains = [];
  scene.pendulum.forEach((pendulum, entry) => {
    for (let copy = 0; copy < (pendulum.count ?? 1); copy++) chains.push({ entry, copy, links: linksOf(pendulum, scene.gravity) });
  });
  let first = 0;
  for (const chain of chains) {
    chain.first = first;
    first += chain.links.length;
  }
  const links = chains.flatMap((chain) => chain.links);
  const reach = Math.max(...chains.map((chain) => sum(chain.links.map((link) => Math.max(link.l, link.c)))));
  const common = { gravity: scene.gravity, cart: null, support: null, structure: null, chains, links, reach };
  const motions = motionsIn(scene);
  const support = motions.length ? movedBy(motions) : null;
  if (isStructure()) {
    const lead = coordinatesOf().length;
    return { ...common, structure: carriedBy(scene, links), leading: leadingOf(motions, scene.force, leadingCount()), support, lead, size: lead + links.length };
  }
  const { kind, mass = 0, damping = 0, stiffness = 0, friction, friction_coefficient: coefficient } = scene.support;
  const cart = kind === "cart" ? { mass, damping, stiffness, friction: coefficient || friction || 0 } : null;
  const plain = { ...common, cart, support, lead: 1, size: links.length + 1 };
  return isWhole() ? { ...plain, whole: wholeOf(scene, plain, motions) } : plain;
}

// Where a push acts, among the coordinates, and its unit: on the cart or the first carrier, else as a moment on the
// first link of every pendulum.
export function pushedAt({ structure, cart, lead, chains }) {
  if (structure && lead) return { places: [0], unit: coordinatesOf()[0].unit === "rad" ? "N m" : "N" };
  return cart ? { places: [0], unit: "N" } : { places: chains.map(({ first }) => lead + first), unit: "N m" };
}

// Displacement, velocity and acceleration of a support at a time (s), each along the rail and down.
function movedBy(motions) {
  const courses = motions.map((motion, k) => courseOf(motion, k));
  const moved = new Float64Array(6);
  return (time) => {
    moved.fill(0);
    motions.forEach(({ direction }, k) => {
      const [place, sign] = direction === "vertical" ? [1, -1] : [0, 1];
      for (const order of [0, 1, 2]) moved[2 * order + place] += sign * courses[k](time, order);
    });
    return moved;
  };
}

// A link with its numbers and constants for the steps.
export function numbered(link, gravity) {
  const { m, l, c, I, rotor, damping, stiffness, drag, quadratic, strength, angle_deg, b, s, rest, bent } = link;
  const numbers = [m, l, c, I, rotor, damping, stiffness, drag, quadratic, strength, angle_deg, b, s, rest, bent, gravity];
  return { ...link, numbers, constants: Float64Array.from(full.link.constants(numbers)) };
}

function linksOf(pendulum, gravity) {
  const links = pendulum.links.map((link, i) => numbersOf(link, pendulum.equilibrium?.[i] === "up" ? -1 : 1));
  let below = 0;
  for (const link of links.toReversed()) {
    link.b = link.m * link.c + link.l * below;
    below += link.m;
  }
  links.forEach((link, i) => (link.bent = link.rest - (i ? links[i - 1].rest : 0)));
  return links.map((link) => numbered(link, gravity));
}

function numbersOf(link, s) {
  const { kind, mass: m, length: l, centre, inertia, damping = 0, stiffness = 0, drag = 0, quadratic_drag: quadratic = 0, friction = 0, drive } = link;
  const rotor = (link.rotor_inertia ?? 0) * (link.gear_ratio ?? 1) ** 2;
  const c = { bob: l, rod: l / 2 }[kind] ?? centre;
  const I = { bob: 0, rod: (m * l ** 2) / 12 }[kind] ?? inertia;
  const angle_deg = drive?.angle_deg || 180;
  const angle = ((drive?.angle_deg ?? 0) * Math.PI) / 180;
  const strength = drive?.kind === "van-der-pol" ? drive.strength : 0;
  const impulse = drive?.kind === "escapement" ? drive.impulse : 0;
  return { kind, m, l, c, I, rotor, s, rest: s > 0 ? 0 : Math.PI, damping, stiffness, drag, quadratic, strength, angle_deg, impulse, angle, friction };
}

export const sum = (values) => values.reduce((total, value) => total + value, 0);

// The state (x, angles, x', rates, work) at rest in equilibrium; `lead` coordinates stand before the angles.
export function atRest(system) {
  const y = new Float64Array(2 * system.size + 1);
  system.links.forEach((link, i) => (y[system.lead + i] = link.rest));
  return y;
}

// The state that a scene's `start` describes; null where it has none.
export function startOf(scene, system) {
  if (system.structure) return startGiven() && Float64Array.from(startGiven());
  const { start: onRail } = scene.support;
  if (!onRail && !scene.pendulum.some((pendulum) => pendulum.start)) return null;
  const y = atRest(system);
  [y[0], y[system.size]] = [onRail?.displacement ?? 0, onRail?.rate ?? 0];
  for (const { entry, first, links } of system.chains) {
    const start = scene.pendulum[entry].start;
    for (let i = 0; start && i < links.length; i++) {
      y[system.lead + first + i] = (start.angles_deg[i] * Math.PI) / 180;
      y[system.size + system.lead + first + i] = ((start.rates_deg?.[i] ?? 0) * Math.PI) / 180;
    }
  }
  return y;
}
