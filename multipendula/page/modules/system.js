// A scene as numbers: every copy of a pendulum is a chain of links, top link first, in SI units.
//
// A scene has the keys of a scene file, every link written out.  With s the direction of a link at equilibrium
// (1 down, -1 up), b = m c + l (mass below) its first moment and g b s what gravity adds to its stiffness.

export const MOST_LINKS = 60;

export function systemOf(scene) {
  const chains = [];
  scene.pendulum.forEach((pendulum, entry) => {
    for (let copy = 0; copy < (pendulum.count ?? 1); copy++) chains.push({ entry, copy, links: linksOf(pendulum) });
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
    chains,
    links,
    size: links.length + 1,
    mass: mass + sum(links.map((link) => link.m)),
  };
}

function linksOf(pendulum) {
  const links = pendulum.links.map((link, i) => numbersOf(link, pendulum.equilibrium?.[i] === "up" ? -1 : 1));
  let below = 0;
  for (const link of links.toReversed()) {
    link.below = below;
    link.b = link.m * link.c + link.l * below;
    below += link.m;
  }
  links.forEach((link, i) => (link.bent = link.rest - (i ? links[i - 1].rest : 0)));
  return links;
}

function numbersOf({ kind, mass: m, length: l, centre, inertia, damping = 0, stiffness = 0, drive }, s) {
  const c = { bob: l, rod: l / 2 }[kind] ?? centre;
  const I = { bob: 0, rod: (m * l ** 2) / 12 }[kind] ?? inertia;
  const J = I + m * c * c;
  const far = I + m * (l - c) ** 2;
  const cross = I - m * c * (l - c);
  const angle = ((drive?.angle_deg ?? 0) * Math.PI) / 180;
  const strength = drive?.kind === "van-der-pol" ? drive.strength : 0;
  const impulse = drive?.kind === "escapement" ? drive.impulse : 0;
  const curb = strength ? strength / angle ** 2 : 0;
  return { kind, m, l, c, I, J, far, cross, s, rest: s > 0 ? 0 : Math.PI, damping, stiffness, strength, curb, impulse, angle };
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
