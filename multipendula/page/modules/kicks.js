// Escapements: a kick whenever a joint passes its angle outwards, as in `nonlinear.integration.escapements`.
//
// A kick P acts on the link below the joint and -P on the one above; the velocities jump by the response of the
// recursion to these moments without gravity or velocities.

import { responseOf } from "./recursion.js";

export class Escapements {
  constructor(system, y) {
    this.system = system;
    this.joints = system.chains.flatMap(({ first, links }) =>
      links.flatMap((link, i) => (link.impulse ? [{ own: first + i, above: i ? first + i - 1 : -1, link }] : [])),
    );
    // The side of the next kick: 0 where either is possible.
    this.sides = this.joints.map((joint) => {
      const gamma = this.angleOf(joint, y);
      return Math.abs(gamma) > joint.link.angle ? -Math.sign(gamma) : 0;
    });
    this.respond = responseOf({ ...system, cart: system.cart && { ...system.cart, stiffness: 0, damping: 0 } });
  }

  angleOf({ own, above, link }, y) {
    return y[1 + own] - (above < 0 ? 0 : y[1 + above]) - link.bent;
  }

  rateOf({ own, above }, y) {
    const { size } = this.system;
    return y[size + 1 + own] - (above < 0 ? 0 : y[size + 1 + above]);
  }

  // How far a joint is beyond the angle of its next kick; its side.
  beyond(number, y) {
    const joint = this.joints[number];
    const gamma = this.angleOf(joint, y);
    const side = this.sides[number] || Math.sign(gamma) || Math.sign(this.rateOf(joint, y)) || 1;
    return { over: side * gamma - joint.link.angle, side };
  }

  // The part of a step of length h, just tried by the integrator, up to the first kick; it is left in `trial`.
  watch(integrator, h) {
    this.due = [];
    const inside = this.joints.map((_, number) => this.beyond(number, integrator.y).over < 0);
    const passed = () => this.joints.flatMap((_, number) => (inside[number] && this.beyond(number, integrator.trial).over >= 0 ? [number] : []));
    if (!passed().length) return h;
    let [low, high] = [0, h];
    for (let halvings = 0; halvings < 50 && high - low > 1e-15 * (1 + Math.abs(integrator.time)); halvings++) {
      const middle = (low + high) / 2;
      integrator.attempt(middle);
      if (passed().length) high = middle;
      else low = middle;
    }
    integrator.attempt(high);
    this.due = passed();
    return high;
  }

  // The kicks that `watch` has found.
  kick(y) {
    if (!this.due?.length) return;
    const { size, links } = this.system;
    const moments = new Float64Array(links.length);
    const kicks = this.due.map((number) => {
      const { own, above, link } = this.joints[number];
      const side = this.beyond(number, y).side;
      moments[own] += side * link.impulse;
      if (above >= 0) moments[above] -= side * link.impulse;
      this.sides[number] = -side;
      return { joint: this.joints[number], impulse: side * link.impulse };
    });
    const jump = new Float64Array(size);
    this.respond(y.subarray(1, size), new Float64Array(links.length), moments, 0, 0, jump);
    for (const { joint, impulse } of kicks) y[2 * size] += (impulse * this.rateOf(joint, y)) / 2;
    for (let i = 0; i < size; i++) y[size + i] += jump[i];
    for (const { joint, impulse } of kicks) y[2 * size] += (impulse * this.rateOf(joint, y)) / 2;
    this.due = [];
  }
}
