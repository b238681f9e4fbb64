// Words for how pendula move in a mode, as in `modal.modes.rows`.  A phasor x has the parts `real` and `twist` of a complex
// shape, the latter null without dampers.

import { pivotsAt } from "./carriers.js";
import { inertiaOf } from "./matrices.js";
import { inPhase } from "./shapes.js";
import { sum } from "./system.js";

const FAIR = 0.01; // of the energy of the pendulum that moves most
const SMALL = 1e-6;

// How the pivots move in a small motion, each along the rail and down.
export function pivotsMoved(system, x) {
  if (!system.structure) return system.chains.map(() => [x[0], 0]);
  const [ahead, back] = [SMALL, -SMALL].map((step) => pivotsAt(x.map((value) => step * value)));
  return ahead.map(([along, down], number) => [(along - back[number][0]) / 2 / SMALL, (down - back[number][1]) / 2 / SMALL]);
}

// The kinetic energy of each chain, up to a factor, with the motion of its pivot.
function energiesOf(system, { real, twist }) {
  const parts = [real, twist].filter(Boolean).map((x) => ({ x, pivots: pivotsMoved(system, x) }));
  return system.chains.map(({ first, links }, number) => {
    const mass = sum(links.map(({ m }) => m));
    return sum(
      parts.map(({ x, pivots: { [number]: [along, down] } }) => {
        const angles = x.slice(system.lead + first, system.lead + first + links.length);
        return inertiaOf([{ links }], null, null, Float64Array.of(along, ...angles)) + mass * down ** 2;
      }),
    );
  });
}

// The numbers of the pendula with a fair share of the energy.
export function busyIn(system, x) {
  const energies = energiesOf(system, x);
  const least = FAIR * Math.max(...energies);
  return energies.flatMap((energy, number) => (energy >= least ? [number] : []));
}

// Real parts of these coordinates where the largest of them is real.
export const partly = ({ real, twist }, places) => inPhase(places.map((i) => real[i]), twist && places.map((i) => twist[i]));

export const topOf = ({ chains, lead }, number) => lead + chains[number].first;

// How the links of the chain that moves most agree.
export function orderIn(system, x) {
  const energies = energiesOf(system, x);
  const { first, links } = system.chains[energies.indexOf(Math.max(...energies))];
  const f = partly(x, links.map((_, i) => system.lead + first + i));
  const n = f.length;
  const opposed = f.slice(1).filter((value, i) => value * f[i] < 0).length;
  if (n === 1) return "";
  if (n === 2) return opposed ? "fast" : "slow";
  if (!opposed) return "slowest (all links in phase)";
  return opposed === n - 1 ? "fastest (adjacent links in antiphase)" : `${opposed} node${opposed > 1 ? "s" : ""}`;
}

// Whether all pendula with a fair share of the energy swing with their pivots or against; "" for neither.
export function following(system, x) {
  const [along, aside] = [x.real, x.twist].map((part) => part && pivotsMoved(system, part).map((pivot) => pivot[0]));
  const signs = busyIn(system, x).map((number) => {
    const top = topOf(system, number);
    return Math.sign(x.real[top] * along[number] + (aside ? x.twist[top] * aside[number] : 0));
  });
  if (!signs[0] || signs.some((sign) => sign !== signs[0])) return "";
  return `${system.chains.length > 1 ? "pendula" : "pendulum"} in ${signs[0] > 0 ? "phase" : "antiphase"} with the support`;
}
