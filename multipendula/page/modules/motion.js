// A motion from a state on: the full equations, the linear prediction from the same start, and the energy's books.

import { Integrator } from "./dop853.js";
import { breaksOf, longestStep } from "./courses.js";
import { Escapements } from "./kicks.js";
import { energiesOf, equationsOf } from "./equations.js";
import { formsIn } from "./matrices.js";
import { linearized } from "./steps.js";
import { forcedIn, isWhole, SwitchedIntegrator } from "./switched.js";
import { atRest, pushedAt } from "./system.js";

const CLOSE = 1e-12; // s
const FAR = 100; // rad between the motion and a prediction that has grown away from it and is given up

export class Motion {
  constructor(system, y, { tolerance = 1e-10, push = null, linear = true, time = 0 } = {}) {
    const start = Float64Array.from(y);
    start[2 * system.size] = 0;
    const forces = push && forcesOf(system, push);
    this.system = system;
    this.full = isWhole() ? new SwitchedIntegrator(system, start, forces, { tolerance, time }) : new Integrator(equationsOf(system, forces), start, { tolerance, uncounted: 1, time });
    this.escapements = !isWhole() && system.links.some((link) => link.impulse) ? new Escapements(system, start) : null;
    this.linear = linear ? new Integrator(linearOf(system, forces), deviation(system, start), { tolerance, time }) : null;
    this.first = this.energy;
    this.largest = Math.max(this.first.kinetic, 1e-7 * system.gravity * system.links.reduce((total, link) => total + link.b, 0));
    this.lowest = this.highest = this.first.potential;
    this.worst = 0;
  }

  get time() {
    return this.full.time;
  }

  get y() {
    return this.full.y;
  }

  // To a time (s), or as far as it comes until the clock says `until` (ms): one step at least.
  advance(end, until = Infinity) {
    const { full, escapements } = this;
    while (full.time < end) {
      full.step(this.until(end), escapements && ((h) => escapements.watch(full, h)));
      escapements?.kick(full.y);
      if (performance.now() >= until) break;
    }
    this.linear?.advance(full.time);
    if (this.linear && !(this.apart < FAR)) this.linear = null;
    this.book();
  }

  // The end of a step towards an end: no step passes a kink of what is prescribed, or is longer than it may change in.
  until(end) {
    const ahead = breaksOf().find((time) => time > this.full.time + CLOSE);
    return Math.min(end, ahead ?? end, this.full.time + longestStep());
  }

  get energy() {
    return energiesOf(this.system, this.y);
  }

  // (E - E(0) - work) over the range of the energies, as `Trajectory.energy_error`.
  book() {
    const { kinetic, potential } = this.energy;
    const work = this.y[2 * this.system.size];
    this.largest = Math.max(this.largest, kinetic, Math.abs(work));
    this.lowest = Math.min(this.lowest, potential);
    this.highest = Math.max(this.highest, potential);
    const error = kinetic + potential - this.first.kinetic - this.first.potential - work;
    this.worst = Math.max(this.worst, Math.abs(error) / Math.max(this.largest, this.highest - this.lowest));
  }

  // The state that the linear equations predict.
  get predicted() {
    const y = atRest(this.system);
    for (let i = 0; i < 2 * this.system.size; i++) y[i] += this.linear.y[i];
    return y;
  }

  // The largest angle (rad) between the motion and its linear prediction.
  get apart() {
    const { y, predicted } = this;
    let largest = 0;
    for (let i = this.system.lead; i < this.system.size; i++) largest = Math.max(largest, Math.abs(y[i] - predicted[i]));
    return largest;
  }
}

// The linear equations, with the forces of the scene.
function linearOf(system, forces) {
  const [rates, forced] = [equationsOf(system, forces, linearized), forcedIn(system)];
  if (!forced) return rates;
  return (time, q, out) => {
    rates(time, q, out);
    forced(time).forEach((value, i) => (out[system.size + i] += value));
  };
}

function forcesOf(system, push) {
  const forces = new Float64Array(system.size);
  const { places } = pushedAt(system);
  return (time) => {
    const amount = push(time);
    for (const place of places) forces[place] = amount;
    return forces;
  };
}

function deviation(system, y) {
  const rest = atRest(system);
  return y.slice(0, 2 * system.size).map((value, i) => value - rest[i]);
}

// A state in the shape of a mode whose largest angle is `amplitude` (rad), which moves on as that mode alone; a
// translation moves the cart or the carriers at `amplitude` m/s instead.
export function inShape(system, row, amplitude, copy = 0) {
  const y = atRest(system);
  const [shape, twist] = [row.shapes[copy], row.twists?.[copy]];
  if (!row.omega) {
    shape.forEach((value, i) => (y[system.size + i] = amplitude * value));
    return y;
  }
  shape.forEach((value, i) => (y[i] += amplitude * value));
  const rate = twist ? row.rate : row.growing ? row.omega : 0;
  if (rate) shape.forEach((value, i) => (y[system.size + i] = amplitude * (rate * value - row.turn * (twist?.[i] ?? 0))));
  return y;
}

// The largest angle (rad) that each mode has in a state: the amplitude of its swing, over its shapes.  Of a mode l with
// the shape f that is |2c|, |c| of one that does not swing, where c f'(2 l M + D) f = f'((l M + D) q + M q').
export function amplitudesOf(system, rows, y) {
  const q = deviation(system, y);
  const [place, speed] = [q.subarray(0, system.size), q.subarray(system.size)];
  return rows.map((row) => {
    if (!row.omega || row.growing) return 0;
    return Math.hypot(...row.shapes.map((shape, copy) => partIn(system, row, shape, row.twists?.[copy], place, speed)));
  });
}

function partIn(system, { rate, turn }, shape, twist, place, speed) {
  const [real, aside] = [shape, twist].map((x) => x && [place, speed].map((own) => formsIn(system, x, own)));
  const along = ([[M0, , D0], [M1]]) => [rate * M0 + D0 + M1, turn * M0];
  const own = formsIn(system, shape);
  let [p, q] = along(real);
  let [m, d, b, e] = [own[0], own[2], 0, 0];
  if (twist) {
    const [u, v] = along(aside);
    [p, q] = [p - v, q + u];
    const [other, mixed] = [formsIn(system, twist), formsIn(system, shape, twist)];
    [m, d, b, e] = [m - other[0], d - other[2], 2 * mixed[0], 2 * mixed[2]];
  } else d = 0;
  const [below, beside] = [2 * (rate * m - turn * b) + d, 2 * (rate * b + turn * m) + e];
  return ((turn ? 2 : 1) * Math.hypot(p, q)) / Math.hypot(below, beside);
}
