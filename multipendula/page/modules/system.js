// A scene as numbers: every copy of a pendulum is a chain of links, top link first, in SI units.
//
// A scene has the keys of a scene file, every link written out.  With s the direction of a link at equilibrium
// (1 down, -1 up), b = m c + l (mass below) its first moment and g b s what gravity adds to its stiffness.

import { full, sine } from "./steps.js";

export const MOST_LINKS = 60;

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
  const { kind, mass = 0, damping = 0, stiffness = 0 } = scene.support;
  const links = chains.flatMap((chain) => chain.links);
  return {
    gravity: scene.gravity,
    cart: kind === "cart" ? { mass, damping, stiffness } : null,
    support: kind === "moved" ? movedBy(scene.support.motion) : null,
    chains,
    links,
    size: links.length + 1,
    mass: mass + sum(links.map((link) => link.m)),
  };
}

// Displacement, velocity and acceleration of a support at a time (s), each along the rail and down.
function movedBy({ amplitude, frequency_hz, phase_deg = 0, direction }) {
  const upwards = direction === "vertical";
  const constants = sine.constants([amplitude, 2 * Math.PI * frequency_hz, (phase_deg * Math.PI) / 180, upwards ? 0 : 1, upwards ? -1 : 0]);
  const found = new Float64Array(6);
  return (time) => {
    sine.moved(constants, null, [time], null, found);
    return found;
  };
}

// A link with its numbers and constants for the steps.
export function numbered(link, gravity) {
  const { m, l, c, I, damping, stiffness, strength, curb, drag, quadratic, b, s, rest, bent } = link;
  const numbers = [m, l, c, I, damping, stiffness, strength, curb, drag, quadratic, b, s, rest, bent, gravity];
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

function numbersOf({ kind, mass: m, length: l, centre, inertia, damping = 0, stiffness = 0, drag = 0, quadratic_drag: quadratic = 0, drive }, s) {
  const c = { bob: l, rod: l / 2 }[kind] ?? centre;
  const I = { bob: 0, rod: (m * l ** 2) / 12 }[kind] ?? inertia;
  const angle = ((drive?.angle_deg ?? 0) * Math.PI) / 180;
  const strength = drive?.kind === "van-der-pol" ? drive.strength : 0;
  const impulse = drive?.kind === "escapement" ? drive.impulse : 0;
  const curb = strength ? strength / angle ** 2 : 0;
  return { kind, m, l, c, I, s, rest: s > 0 ? 0 : Math.PI, damping, stiffness, drag, quadratic, strength, curb, impulse, angle };
}

export function sum(values) {
  return values.reduce((total, value) => total + value, 0);
}

// The state (x, angles, x', rates, work) at rest in equilibrium.
export function atRest(system) {
  const y = new Float64Array(2 * system.size + 1);
  system.links.forEach((link, i) => (y[1 + i] = link.rest));
  return y;
}

// The state that a scene's `start` describes; null where it has none.
export function startOf(scene, system) {
  if (!scene.pendulum.some((pendulum) => pendulum.start)) return null;
  const y = atRest(system);
  for (const { entry, first, links } of system.chains) {
    const start = scene.pendulum[entry].start;
    for (let i = 0; start && i < links.length; i++) {
      y[1 + first + i] = (start.angles_deg[i] * Math.PI) / 180;
      y[1 + system.size + first + i] = ((start.rates_deg?.[i] ?? 0) * Math.PI) / 180;
    }
  }
  return y;
}
