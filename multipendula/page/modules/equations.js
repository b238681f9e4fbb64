// The equations of motion in the plane: loops over the steps of `nonlinear.dynamics.steps`, which are written into
// `steps`, from joint to joint; any number of chains and links.
//
// y = (x, angles, x', rates, work): x and x' stay 0 without a cart, work is that of dampers, drives, drag, a moved
// support and the forces from outside.  Structures have their own text (`carriers`).

import { ratesOf, storedIn } from "./carriers.js";
import { zeros } from "./matrices.js";
import { full, linearized } from "./steps.js";

const STILL = new Float64Array(6);

// A function f(t, y, out) for the derivative of y; `forces(t)` gives the force on the cart (N) and the moment on every
// link (N m).  With the steps `linearized` it is that of the deviations from equilibrium, without work.
export function equationsOf(system, forces = null, steps = full) {
  if (system.structure) return ratesOf(system, forces, steps === linearized);
  const { size, cart, gravity } = system;
  const [wide, shift] = steps === linearized ? [2, 1] : [1, 0];
  const read = (record, k) => record[k] + shift * record[k + 3 * shift];
  const top = steps.support.constants([cart?.mass, cart?.damping, cart?.stiffness, gravity]);
  const respond = cart ? steps.support.railed : steps.support.held;
  const [own, total, start] = [5, 13, 3].map((length) => new Float64Array(length * wide));
  const none = new Float64Array(size);
  const chains = system.chains.map(({ first, links }) => {
    const n = links.length;
    const [states, swung, answers, fallen] = [zeros(n, 9 * wide), zeros(n + 1, 2 * wide), zeros(n + 1, 13 * wide), zeros(n, 3 * wide)];
    states.forEach((state, i) => state.set([links[i].rest, 0, i ? links[i - 1].rest : 0]));
    return { first, n, constants: links.map(({ numbers }) => steps.link.constants(numbers)), states, swung, answers, fallen };
  });
  return (time, y, out) => {
    const outside = forces ? forces(time) : none;
    const [, , along, down, ax, az] = system.support ? system.support(time) : STILL;
    total.fill(0);
    for (const { first, n, constants, states, swung, answers } of chains) {
      swung[0][2 * shift] = y[size];
      for (let i = 0; i < n; i++) {
        const state = states[i];
        const [angle, rate, at] = [1 + first + i, size + 1 + first + i, 9 * shift];
        [state[4], state[5], state[6], state[7], state[8]] = [outside[angle], ax, az, along, down];
        [state[at], state[at + 1]] = [y[angle], y[rate]];
        if (i) [state[at + 2], state[at + 3]] = [y[angle - 1], y[rate - 1]];
        steps.link.swung(constants[i], state, swung[i], null, swung[i + 1]);
      }
      for (let i = n - 1; i >= 0; i--) steps.link.answered(constants[i], states[i], answers[i + 1], swung[i], answers[i]);
      for (let k = 0; k < total.length; k++) total[k] += answers[0][k];
    }
    [own[2], own[3], own[4]] = [outside[0], ax, az];
    [own[5 * shift], own[5 * shift + 1]] = [y[0], y[size]];
    respond(top, own, total, null, start);
    for (let i = 0; i < size; i++) out[i] = y[size + i];
    out[size] = cart ? read(start, 0) : 0;
    for (const { first, n, constants, states, answers, fallen } of chains) {
      for (let i = 0; i < n; i++) {
        steps.link.fallen(constants[i], states[i], i ? fallen[i - 1] : start, answers[i], fallen[i]);
        out[size + 1 + first + i] = read(fallen[i], 2);
      }
    }
    if (!shift) out[2 * size] = start[2];
  };
}

// Kinetic and potential energy (J), the latter from equilibrium: small motions keep their digits.
export function energiesOf(system, y) {
  if (system.structure) return storedIn(system, y);
  const { size, cart, chains } = system;
  let kinetic = cart ? (cart.mass * y[size] ** 2) / 2 : 0;
  let potential = cart ? (cart.stiffness * y[0] ** 2) / 2 : 0;
  for (const { first, links } of chains) {
    const stored = Float64Array.of(y[size], 0, 0, 0);
    links.forEach(({ constants }, i) => {
      const state = [y[1 + first + i], y[size + 1 + first + i], i ? y[first + i] : 0];
      full.link.stored(constants, state, stored, null, stored);
    });
    kinetic += stored[2];
    potential += stored[3];
  }
  return { kinetic, potential };
}
