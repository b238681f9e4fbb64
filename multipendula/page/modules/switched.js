// A motion with dry friction or forces: the whole text of its equations, whose steps end where a contact stops, breaks
// loose or a kick is due.  What happens there, and where a step ends, is Python's own text in `whole`.
//
// Its z is (x of a cart, angles, their rates, work): y without the places that are always 0 on what is fixed.

import { placed } from "./carriers.js";
import { forcesAmong, isRecorded, leadingOf } from "./courses.js";
import { factorOf, Integrator } from "./dop853.js";
import { whole } from "./whole.js";

const FIELDS = 9; // numbers of a link among the entries, the first of its `numbers`
const ASIDE = 1e-3; // of a step: within which the rates of forces are seen
const LEAST = 1e-14; // s and of the time: the shortest step

export const isWhole = () => whole !== null;

// What the text takes of a system and its scene: constants, and the numbers of its switches.
export function wholeOf(scene, { gravity, cart, links }, motions) {
  const fields = Array.from({ length: FIELDS }, (_, field) => links.map(({ numbers }) => numbers[field])).flat();
  const entries = [gravity, ...fields, 0, 0, cart?.mass ?? 0, 0, 0, 0, cart?.stiffness ?? 0, cart?.damping ?? 0];
  const prescribed = whole.places.map(([place, unit], k) => (placed(scene, place) === undefined ? whole.prescribed[k] : placed(scene, place) * unit));
  const constantsOf = (acting) => whole.constants([...whole.kept.map((k) => entries[k]), ...acting]);
  const constants = constantsOf(prescribed);
  const still = constantsOf(prescribed.map((value, k) => (isSize(whole.places[k][0]) ? 0 : value)));
  const link = (below) => links[below - whole.first];
  const kicks = ["bent", "angle", "impulse"].flatMap((key) => whole.kicks.map(([below]) => link(below)[key]));
  const limits = whole.contacts.map(([below]) => (below < whole.first ? cart.friction : link(below).friction));
  const rate = Math.sqrt(gravity / Math.max(...links.map(({ l }) => l)));
  return { constants, still, numbers: [...kicks, ...limits, rate], leading: leadingOf(motions, scene.force, whole.leading) };
}

const isSize = (place) => place[0] === "force" && place.at(-1) === "amplitude";

// What the forces of a scene add to the accelerations of small motions, a function of time (s); null without any.
export function forcedIn(system) {
  if (!whole || !(forcesAmong() || whole.places.some(([place]) => place[0] === "force"))) return null;
  const skipped = 1 - whole.first;
  const inputs = new Array(system.size - skipped + 2 * whole.contacts.length).fill(0);
  const rest = [...new Array(system.size - skipped - system.links.length).fill(0), ...system.links.map((link) => link.rest)];
  const z = [...rest, ...rest.map(() => 0), 0];
  return (time) => {
    const leading = system.whole.leading(time);
    const quiet = leading.map((value, k) => (isRecorded() && k >= leading.length - forcesAmong() ? 0 : value));
    const [acted, none] = [[system.whole.constants, leading], [system.whole.still, quiet]].map(([c, first]) => whole.rates(c, z, [...first, ...inputs], []));
    const added = acted.map((value, i) => value - none[i]).slice(rest.length, 2 * rest.length);
    return [...new Array(skipped).fill(0), ...added];
  };
}

export class SwitchedIntegrator {
  // `forces(t)` are those of the page's own drive on all coordinates of y, or null.
  constructor(system, y, forces, { tolerance, time = 0 }) {
    Object.assign(this, { system, forces, state: new Array(whole.length).fill(0), happened: [], met: null, look: null });
    this.skipped = 1 - whole.first;
    const z = this.packed(y);
    const rates = (at, own, out) => out.set(this.ratesAt(at, own));
    this.method = new Integrator(rates, z, { tolerance, uncounted: 1, time });
    this.seeking = { which: [-1], low: [0], high: [Infinity], tried: [0], usual: [0] };
    const { constants, numbers } = system.whole;
    whole.begin(time, [...z], whole.kicks.map(() => 0), this.state, numbers, constants, this.timed(time), this.happened);
    this.hold();
    const due = whole.due([...z], this.ratesAt(time, z), this.state, numbers);
    if (due >= 0) this.met = due;
  }

  packed(y) {
    const { size } = this.system;
    return Float64Array.from([...y.slice(this.skipped, size), ...y.slice(size + this.skipped)]);
  }

  get y() {
    const { y } = this.method;
    const { size } = this.system;
    if (!this.skipped) return y;
    return Float64Array.of(0, ...y.slice(0, size - 1), 0, ...y.slice(size - 1));
  }

  // The numbers of the links whose joints stick, and -1 for the rail; null in a scene without friction.
  get stuck() {
    if (!whole.contacts.length) return null;
    return whole.contacts.flatMap(([below], i) => (this.state[whole.kicks.length + i] ? [] : [below - whole.first]));
  }

  get time() {
    return this.method.time;
  }

  // The inputs before those of contacts: the time, and the drive's forces.
  timed(time) {
    const pushes = this.forces ? [...this.forces(time).slice(this.skipped)] : new Array(this.system.size - this.skipped).fill(0);
    return [...this.system.whole.leading(time), ...pushes];
  }

  ratesAt(time, z) {
    const { constants } = this.system.whole;
    const rates = this.sticking ? whole.sticking : whole.rates;
    return rates(constants, z, [...this.timed(time), ...this.held], []).slice(0, z.length);
  }

  // What the state of the contacts makes of the equations.
  hold() {
    const count = whole.contacts.length;
    const signs = this.state.slice(whole.kicks.length, whole.kicks.length + count);
    if (signs.some(Number.isNaN)) throw new Error("friction has no value");
    this.held = count ? whole.inputs(this.state, this.system.whole.numbers) : [];
    this.sticking = count > 0 && (whole.presses || signs.some((sign) => !sign));
    this.slides = !whole.presses && signs.every(Boolean);
    this.rests = count > 0 && !this.forces && !whole.leading && count === this.system.size - this.skipped && signs.every((sign) => !sign);
    this.look = null;
  }

  // The values of all switches and their rates.
  values(time, z, rates, length) {
    const { constants, numbers } = this.system.whole;
    const aside = ASIDE * length;
    const pushed = () => {
      const [early, late] = [-1, 1].map((side) => this.timed(time + side * aside));
      return late.map((value, k) => (value - early[k]) / (2 * aside));
    };
    const beside = this.forces || isRecorded() ? pushed() : this.timed(0).map((_, k) => (whole.leading && !k ? 1 : 0));
    const given = [...rates, ...this.state.slice(0, whole.told), ...numbers.slice(0, -1), ...beside];
    const both = (this.slides ? whole.clear : whole.values)(constants, z, [...this.timed(time), ...this.held], given);
    return [both.slice(0, both.length / 2), both.slice(both.length / 2)];
  }

  // One step that does not pass `end`, as far as the next switch.
  step(end) {
    const { method } = this;
    if (this.met !== null) this.change();
    if (this.rests) {
      method.time = end;
      return;
    }
    const least = LEAST * Math.max(1, Math.abs(method.time));
    let [length, refused] = [Math.min(method.next, end - method.time), false];
    for (let tries = 0; tries < 200; tries++) {
      const last = length >= end - method.time;
      if (last) length = end - method.time;
      const seen = [];
      const error = method.attempt(length, (stage, z) => whole.seen_.includes(stage) && seen.push([stage, Float64Array.from(z)]));
      const factor = factorOf(error);
      if (!(error < 1)) {
        [length, refused] = [length * factor, true];
        this.seekNone();
        if (length < least) break;
        continue;
      }
      const answer = this.answerOf(length, seen, length * (refused ? Math.min(1, factor) : factor));
      if (answer === whole.AGAIN && length > least) {
        length = Math.max(this.seeking.tried[0], least);
        continue;
      }
      this.accept(answer, length, last ? end : method.time + length);
      return;
    }
    throw new Error("the step became too small");
  }

  // What becomes of a step that was good, whose next one would be so long.
  answerOf(length, seen, following) {
    const { method, seeking } = this;
    const { time, stages } = method;
    this.look ??= this.values(time, method.y, stages[0], length);
    const looked = [this.look, ...seen.map(([stage, z]) => this.values(time + whole.nodes[stage] * length, z, stages[stage], length))];
    this.rate = this.ratesAt(time + length, method.trial);
    this.last = this.values(time + length, method.trial, this.rate, length);
    looked.push(this.last);
    const [V, R] = [0, 1].map((k) => looked.map((own) => own[k]));
    seeking.tried[0] = following;
    if (seeking.which[0] < 0 && !whole.may_pass(length, V, R, whole.looks)) {
      seeking.usual[0] = following;
      return whole.STANDS;
    }
    const { which, low, high, tried, usual } = seeking;
    return whole.meet(0, [length], V, R, whole.looks, which, low, high, tried, usual);
  }

  accept(answer, length, end) {
    const { method, seeking } = this;
    let time = end;
    if (answer === whole.STANDS) {
      method.next = end > method.time && length < method.next ? Math.max(method.next, seeking.tried[0]) : seeking.tried[0];
      this.look = this.last;
      method.y.set(method.trial);
    } else {
      const j = seeking.which[0];
      const [V, R] = this.last;
      let left = R[j] > 0 ? -V[j] / R[j] : 0;
      if (Math.abs(left) > 2 * whole.PASSING_SHARE * (seeking.usual[0] + length)) left = 0;
      left = Math.max(left, -length / 2);
      method.y.set(method.trial.map((value, i) => value + left * this.rate[i]));
      time = end + left;
      [method.next, this.met, this.look] = [seeking.usual[0], j, null];
      this.seekNone();
    }
    method.time = time;
    this.level();
  }

  seekNone() {
    Object.assign(this.seeking, { which: [-1], low: [0], high: [Infinity] });
  }

  change() {
    const { method, state } = this;
    const { constants, numbers } = this.system.whole;
    const rates = this.ratesAt(method.time, method.y);
    const after = whole.change(method.time, this.met, [...method.y], rates, state, numbers, constants, this.timed(method.time), [], this.happened);
    method.y.set(after);
    this.met = null;
    this.happened.length = 0;
    this.hold();
  }

  // No rounding moves what sticks.
  level() {
    const { y } = this.method;
    const [half, count] = [(y.length - 1) / 2, whole.contacts.length];
    whole.contacts.forEach(([below, above], i) => {
      if (this.state[whole.kicks.length + i]) return;
      y[below] = this.state[whole.told + 2 * count + i] + (above >= 0 ? y[above] : 0);
      y[half + below] = above >= 0 ? y[half + above] : 0;
    });
  }
}
