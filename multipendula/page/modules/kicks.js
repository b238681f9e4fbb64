// Escapements: a kick whenever a joint passes its angle outwards, as in `nonlinear.integration.switches`.
//
// A kick P acts on the link below the joint and -P on the one above, or on the carrier that turns; the velocities jump by
// the accelerations that these moments give the scene at rest without gravity and springs.

import { impelledIn } from "./carriers.js";
import { equationsOf } from "./equations.js";
import { numbered } from "./system.js";

const BUMP = 0.25; // a curve of one curvature rises above its ends by at most this times its change of slope

export class Escapements {
  constructor(system, y) {
    this.system = system;
    // Coordinates below and above; -1 where the upper one is at rest.
    this.joints = system.chains.flatMap(({ first, links }, number) =>
      links.flatMap((link, i) => {
        const own = system.lead + first + i;
        return link.impulse ? [{ own, above: i ? own - 1 : (system.structure?.bases[number] ?? -1), link }] : [];
      }),
    );
    // The side of the next kick: 0 where either is possible.
    this.sides = this.joints.map((joint) => {
      const gamma = this.angleOf(joint, y);
      return Math.abs(gamma) > joint.link.angle ? -Math.sign(gamma) : 0;
    });
    this.moments = new Float64Array(system.size);
    this.respond = system.structure ? (y) => impelledIn(system, y, this.moments) : this.jumps(slack(system));
  }

  jumps(system) {
    const respond = equationsOf(system, () => this.moments);
    return (y) => {
      const [still, jump] = [Float64Array.from(y).fill(0, system.size), new Float64Array(y.length)];
      respond(0, still, jump);
      return jump.subarray(system.size);
    };
  }

  angleOf({ own, above, link }, y) {
    return y[own] - (above < 0 ? 0 : y[above]) - link.bent;
  }

  rateOf({ own, above }, y) {
    const { size } = this.system;
    return y[size + own] - (above < 0 ? 0 : y[size + above]);
  }

  // How far a joint is beyond the angle of its next kick, how fast it goes out there, and on which side that is.
  beyond(number, y) {
    const joint = this.joints[number];
    const [gamma, rate] = [this.angleOf(joint, y), this.rateOf(joint, y)];
    const side = this.sides[number] || Math.sign(gamma) || Math.sign(rate) || 1;
    return { over: side * gamma - joint.link.angle, rate: side * rate, side };
  }

  // The part of a step of length h, just tried by the integrator, up to the first kick; it is left in `trial`.
  watch(integrator, h) {
    const before = this.joints.map((_, number) => this.beyond(number, integrator.y));
    const leaving = before.flatMap(({ over, rate }, number) => (over >= 0 && rate > 0 ? [number] : []));
    if (leaving.length) return this.stop(integrator, 0, leaving);
    const passed = () => before.flatMap(({ over }, number) => (over < 0 && this.beyond(number, integrator.trial).over >= 0 ? [number] : []));
    const end = passed().length ? h : this.peak(integrator, h, before);
    if (end === null) return this.stop(integrator, h, []);
    const high = halved(0, end, (middle) => (integrator.attempt(middle), passed().length > 0));
    integrator.attempt(high);
    return this.stop(integrator, high, passed());
  }

  stop(integrator, h, due) {
    integrator.attempt(h);
    this.due = due;
    return h;
  }

  // The first time within a step at which a joint that turns back inside has passed its angle; null where none has.
  peak(integrator, h, before) {
    const after = before.map((_, number) => this.beyond(number, integrator.trial));
    let first = null;
    before.forEach(({ over, rate }, number) => {
      const end = after[number];
      const bump = Math.max(over, end.over) + BUMP * h * (rate - end.rate);
      if (!(over < 0 && end.over < 0 && rate > 0 && end.rate < 0 && bump >= 0)) return;
      const at = halved(0, h, (middle) => (integrator.attempt(middle), this.beyond(number, integrator.trial).rate <= 0));
      integrator.attempt(at);
      if (this.beyond(number, integrator.trial).over >= 0) first = Math.min(first ?? h, at);
    });
    return first;
  }

  // The kicks that `watch` has found.
  kick(y) {
    if (!this.due?.length) return;
    const { size } = this.system;
    const moments = this.moments.fill(0);
    const kicks = this.due.map((number) => {
      const { own, above, link } = this.joints[number];
      const side = this.beyond(number, y).side;
      moments[own] += side * link.impulse;
      if (above >= 0) moments[above] -= side * link.impulse;
      this.sides[number] = -side;
      return { joint: this.joints[number], impulse: side * link.impulse };
    });
    const jump = this.respond(y);
    for (const { joint, impulse } of kicks) y[2 * size] += (impulse * this.rateOf(joint, y)) / 2;
    for (let i = 0; i < size; i++) y[size + i] += jump[i];
    for (const { joint, impulse } of kicks) y[2 * size] += (impulse * this.rateOf(joint, y)) / 2;
    this.due = [];
  }
}

// The scene without gravity and springs, on a support at rest.
function slack(system) {
  const chains = system.chains.map((chain) => ({ ...chain, links: chain.links.map((link) => numbered({ ...link, stiffness: 0 }, 0)) }));
  return { ...system, chains, gravity: 0, support: null, cart: system.cart && { ...system.cart, stiffness: 0 } };
}

// The least number from `low` to `high` for which a test holds, which it does from there on.
function halved(low, high, test) {
  for (let i = 0; i < 60; i++) {
    const middle = (low + high) / 2;
    if (!(middle > low && middle < high)) break;
    if (test(middle)) high = middle;
    else low = middle;
  }
  return high;
}
