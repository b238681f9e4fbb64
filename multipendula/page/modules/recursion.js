// The equations of motion in the plane: one pass from the tips up and one back down, `nonlinear.dynamics.recursion`.
//
// y = (x, angles, x', rates, work): x and x' stay 0 on a fixed support, work is that of dampers, drives and the push.

// A function f(t, y, out) for the derivative of y; `push(t)` gives a force on the cart (N) or, where the support is
// fixed, a moment on the first link of every pendulum (N m).
export function equationsOf(system, push = null) {
  const { size, links } = system;
  const torques = new Float64Array(links.length);
  const respond = responseOf(system);
  return (time, y, out) => {
    const outside = push ? push(time) : 0;
    const rates = y.subarray(size + 1, 2 * size);
    let power = jointTorques(system, y, rates, torques);
    let force = 0;
    if (system.cart) {
      const working = outside - system.cart.damping * y[size];
      force = working - system.cart.stiffness * y[0];
      power += working * y[size];
    } else if (outside) {
      for (const { first } of system.chains) {
        torques[first] += outside;
        power += outside * rates[first];
      }
    }
    respond(y.subarray(1, size), rates, torques, force, system.gravity, out.subarray(size, 2 * size));
    for (let i = 0; i < size; i++) out[i] = y[size + i];
    out[2 * size] = power;
  };
}

// Torques of springs, dampers and van der Pol drives on the angles, and the power of the latter two.
function jointTorques(system, y, rates, torques) {
  torques.fill(0);
  let power = 0;
  for (const { first, links } of system.chains) {
    for (let i = 0; i < links.length; i++) {
      const link = links[i];
      if (!link.stiffness && !link.damping && !link.strength) continue;
      const own = first + i;
      const gamma = y[1 + own] - (i ? y[own] : 0) - link.bent;
      const rate = rates[own] - (i ? rates[own - 1] : 0);
      const working = (link.strength - link.damping - link.curb * gamma * gamma) * rate;
      const torque = working - link.stiffness * gamma;
      torques[own] += torque;
      if (i) torques[own - 1] -= torque;
      power += working * rate;
    }
  }
  return power;
}

// A function that writes the accelerations (x'', angles'') under torques, a force on the cart and gravity.
export function responseOf(system) {
  const memory = new Float64Array(6 * system.links.length);
  return (angles, rates, torques, force, gravity, out) => {
    let mass = system.cart ? system.cart.mass : 0;
    let pull = 0;
    for (const chain of system.chains) {
      const answer = upward(chain, angles, rates, torques, memory);
      mass += answer.xx;
      pull += answer.px - gravity * answer.xz;
    }
    out[0] = system.cart ? (force - pull) / mass : 0;
    for (const chain of system.chains) downward(chain, rates, memory, out, -gravity);
  };
}

const answer = { xx: 0, xz: 0, zz: 0, px: 0, pz: 0 };

function upward({ first, links }, angles, rates, torques, memory) {
  let [xx, xz, zz, px, pz] = [0, 0, 0, 0, 0];
  for (let i = links.length - 1; i >= 0; i--) {
    const { m, l, c: centre, I, J, far, cross } = links[i];
    const own = first + i;
    const [s, c] = [Math.sin(angles[own]), Math.cos(angles[own])];
    const ww = rates[own] * rates[own];
    const twice = 2 * s * c * xz;
    const nn = c * c * xx - twice + s * s * zz;
    const uu = s * s * xx + twice + c * c * zz;
    const nu = s * c * (xx - zz) + (c * c - s * s) * xz;
    let [pn, pu] = [c * px - s * pz, s * px + c * pz];
    const D = J + l * l * nn;
    const [hn, hu] = [m * centre + l * nn, l * nu];
    const e = l * (pn - l * ww * nu) - torques[own];
    const nn_ = (m * I + far * nn) / D;
    const nu_ = (cross * nu) / D;
    const uu_ = m + (uu - (hu * hu) / D);
    pn += -ww * l * nu - (hn * e) / D;
    pu += -ww * (m * centre + l * uu) - (hu * e) / D;
    xz = s * c * (uu_ - nn_) + (c * c - s * s) * nu_;
    xx = c * c * nn_ + 2 * s * c * nu_ + s * s * uu_;
    zz = s * s * nn_ - 2 * s * c * nu_ + c * c * uu_;
    [px, pz] = [c * pn + s * pu, c * pu - s * pn];
    const at = 6 * own;
    memory[at] = c * hn + s * hu;
    memory[at + 1] = c * hu - s * hn;
    memory[at + 2] = e;
    memory[at + 3] = D;
    memory[at + 4] = s;
    memory[at + 5] = c;
  }
  return Object.assign(answer, { xx, xz, zz, px, pz });
}

function downward({ first, links }, rates, memory, out, az) {
  let ax = out[0];
  for (let i = 0; i < links.length; i++) {
    const at = 6 * (first + i);
    const turn = -(memory[at] * ax + memory[at + 1] * az + memory[at + 2]) / memory[at + 3];
    const ww = rates[first + i] * rates[first + i];
    ax += links[i].l * (turn * memory[at + 5] - ww * memory[at + 4]);
    az -= links[i].l * (turn * memory[at + 4] + ww * memory[at + 5]);
    out[1 + first + i] = turn;
  }
}

// Kinetic and potential energy (J), the latter from equilibrium: small motions keep their digits.
export function energiesOf(system, y) {
  const { size, cart, gravity } = system;
  let kinetic = cart ? (cart.mass * y[size] ** 2) / 2 : 0;
  let potential = cart ? (cart.stiffness * y[0] ** 2) / 2 : 0;
  for (const { first, links } of system.chains) {
    let [vx, vz] = [y[size], 0];
    links.forEach((link, i) => {
      const [angle, rate] = [y[1 + first + i], y[size + 1 + first + i]];
      const [s, c] = [Math.sin(angle), Math.cos(angle)];
      kinetic += (link.m * ((vx + link.c * c * rate) ** 2 + (vz + link.c * s * rate) ** 2) + link.I * rate ** 2) / 2;
      potential += 2 * gravity * link.b * link.s * Math.sin((angle - link.rest) / 2) ** 2;
      potential += (link.stiffness * (angle - (i ? y[first + i] : 0) - link.bent) ** 2) / 2;
      vx += link.l * c * rate;
      vz += link.l * s * rate;
    });
  }
  return { kinetic, potential };
}
