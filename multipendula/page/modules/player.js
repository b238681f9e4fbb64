// What hangs there and what it does now: a scene, its modes, a motion or a recording.

import { isPushed, placed } from "./carriers.js";
import { amplitudesOf, inShape, Motion } from "./motion.js";
import { modesOf } from "./modes.js";
import { mannerOf } from "./shapes.js";
import { atRest, pushedAt, startOf, sum, systemOf } from "./system.js";
import { View } from "./view.js";
import { busyIn } from "./words.js";

const BUDGET = 10; // ms of a frame for the equations
const SLICE = 1 / 120; // s of motion between looks at the clock
const KICK = 0.6; // of sqrt(g/l), rad/s
export const SPAN = 12; // s of the graph at least
const [LONGEST, MOST] = [600, 6]; // s of a beat, and pendula, that it shows
const EASING = 2; // s until the first motion runs at full speed

export class Player {
  // `known` are numbers of the table that the page cannot compute, row by row, and the scene of which they are.
  constructor(scene, recording = null, known = null) {
    Object.assign(this, { scene, recording, known, listeners: [], speed: 1, ease: 1, amplitude: 10, selected: 0 });
    this.rebuild();
    const slowest = this.rows.find((row) => mannerOf(row) === "swings");
    this.drive = { on: false, amount: 0.05 * this.weight, frequency: slowest ? slowest.omega / (2 * Math.PI) : 1 };
    this.hang();
    if (recording) this.replay();
  }

  listen(listener) {
    this.listeners.push(listener);
  }

  tell(what) {
    for (const listener of this.listeners) listener(what);
  }

  rebuild() {
    this.system = systemOf(this.scene);
    this.rows = modesOf(this.system);
    this.isKnown = JSON.stringify(this.scene) === this.known?.scene;
    if (this.isKnown) this.rows.forEach((row, i) => Object.assign(row, this.known.rows[i]));
    this.view = new View(this.system);
    this.watch();
  }

  // What the graph shows: the chosen link, and that of every pendulum in the shortest beat, for a little more than it.
  watch() {
    const { system, rows, selected } = this;
    const { chain, index } = this.home(selected);
    const beat = Math.min(LONGEST, ...rows.map((row) => row.beat || LONGEST));
    const at = rows.findIndex((row) => row.beat === beat);
    const busy = at < 0 ? [] : rows.slice(at, at + 2).flatMap(({ shapes, twists }) => busyIn(system, { real: shapes[0], twist: twists?.[0] ?? null }));
    const others = [...new Set(busy)].map((number) => system.chains[number]).filter((one) => one !== chain && one.links[index]);
    const links = [selected, ...others.slice(0, MOST - 1).map(({ first }) => first + index)];
    this.watched = { links, span: at < 0 ? SPAN : Math.max(SPAN, 1.1 * beat) };
  }

  get weight() {
    const { system } = this;
    const lever = pushedAt(system).unit === "N" ? 1 : Math.max(...system.links.map((link) => link.l));
    return sum(system.links.map((link) => link.m)) * system.gravity * lever;
  }

  // -------------------------------------------------------------------------------------------- what it does

  // At rest in equilibrium.
  hang() {
    this.place(atRest(this.system));
    this.row = null;
    this.view.forget();
    this.tell("state");
  }

  // Held in a state.
  place(y) {
    Object.assign(this, { y, replaying: false, playing: false, motion: null, behind: false });
    this.tell("state");
  }

  // The full motion from the present state.
  release() {
    const time = this.isTimed ? this.now : 0;
    this.replaying = false;
    const { amount, frequency, on } = this.drive;
    const push = on ? (time) => amount * Math.cos(2 * Math.PI * frequency * time) : null;
    this.motion = new Motion(this.system, this.y, { push, time });
    this.y = this.motion.y;
    this.playing = true;
    this.tell("state");
  }

  // The same from here on with other numbers, or held as before.
  renew() {
    const { playing } = this;
    this.release();
    this.playing = playing;
  }

  // Whether the scene has a time of its own, by a support that moves or forces.
  get isTimed() {
    return this.system.support !== null || isPushed();
  }

  // The time of the scene (s): a support that moves goes on where it is.
  get now() {
    return this.replaying ? this.time + this.recording.begin : (this.motion?.time ?? 0);
  }

  // From the scene's start, slowly at first; in a mode where pendula lie on each other there.
  begin() {
    const start = startOf(this.scene, this.system);
    if (start && this.view.overlaps(start)) this.swing(this.rows.indexOf(this.firstRow));
    else this.toggle();
    this.ease = 0;
  }

  toggle() {
    if (this.replaying) {
      if (this.time >= this.recording.duration) this.time = 0;
      this.playing = !this.playing;
    } else if (this.motion) this.playing = !this.playing;
    else {
      if (this.isAtRest && !this.drive.on) this.y = startOf(this.scene, this.system) ?? (isPushed() ? this.y : this.shape(this.firstRow, 0));
      return this.release();
    }
    this.tell("state");
  }

  get isAtRest() {
    const rest = atRest(this.system);
    return this.y.every((value, i) => Math.abs(value - rest[i]) < 1e-12);
  }

  // The links and the rail that dry friction holds now; null where the scene has none.
  get stuck() {
    return this.motion?.full.stuck ?? null;
  }

  get firstRow() {
    return ["swings", "grows", "decays", "shifts"].flatMap((manner) => this.rows.filter((row) => mannerOf(row) === manner))[0];
  }

  shape(row, copy) {
    const degrees = row.growing ? Math.min(1, this.amplitude) : this.amplitude;
    return inShape(this.system, row, row.omega ? (degrees * Math.PI) / 180 : 0.1 * this.view.reach, copy);
  }

  // A mode swings; again, and the next of several shapes of one frequency does.
  swing(number) {
    this.copy = this.row === number ? ((this.copy ?? 0) + 1) % this.rows[number].multiplicity : 0;
    this.row = number;
    this.view.forget();
    this.y = this.shape(this.rows[number], this.copy);
    this.release();
    this.tell("mode");
  }

  // A push: on the cart, or on the chosen link.
  kick() {
    const y = Float64Array.from(this.y);
    const link = this.system.links[this.selected];
    y[this.system.size + this.system.lead + this.selected] += KICK * 2 * Math.sqrt(this.system.gravity / link.l);
    this.y = y;
    this.release();
  }

  drives(changes) {
    Object.assign(this.drive, changes);
    if (this.motion) this.renew();
    this.tell("drive");
  }

  // ----------------------------------------------------------------------------------------------- a recording

  replay() {
    Object.assign(this, { replaying: true, playing: false, motion: null, time: 0, row: null });
    this.seek(0);
  }

  seek(time) {
    this.time = Math.min(this.recording.duration, Math.max(0, time));
    this.y = this.recording.at(this.time);
    this.tell("time");
  }

  step(samples) {
    const { recording } = this;
    this.playing = false;
    const at = recording.indexAt(this.time);
    const next = Math.min(recording.times.length - 1, Math.max(0, at + samples));
    this.seek(recording.times[next] - recording.times[0]);
    this.tell("state");
  }

  // ------------------------------------------------------------------------------------------------- the clock

  // One frame, `elapsed` seconds after the last.
  frame(elapsed) {
    if (!this.playing) return;
    const real = Math.min(elapsed, 0.05);
    this.ease = Math.min(1, this.ease + real / EASING);
    const passed = real * this.speed * this.ease;
    if (this.replaying) {
      this.seek(this.time + passed);
      if (this.time >= this.recording.duration) {
        this.playing = false;
        this.tell("state");
      }
      return;
    }
    const [begun, end] = [performance.now(), this.motion.time + passed];
    try {
      while (this.motion.time < end && performance.now() - begun < BUDGET) {
        this.motion.advance(Math.min(end, this.motion.time + SLICE * Math.max(1, this.speed)), begun + BUDGET);
      }
    } catch {
      this.hang();
      this.tell("lost");
      return;
    }
    this.behind = this.motion.time < end;
    this.y = this.motion.y;
  }

  get amplitudes() {
    return amplitudesOf(this.system, this.rows, this.y);
  }

  // ------------------------------------------------------------------------------------------------- changes

  // The scene after a change of a copy of it; what moves goes on from where it is.
  change(edit) {
    const scene = structuredClone(this.scene);
    edit(scene);
    const before = this.scene;
    this.scene = scene;
    const [y, extent, camera, followed] = [Float64Array.from(this.y), this.view.extent, this.view.camera, this.view.followed];
    try {
      this.rebuild();
    } catch {
      this.scene = before;
      this.rebuild();
      return this.tell("refused");
    }
    Object.assign(this.view, { camera, followed });
    if (this.view.reach === this.reach) this.view.extent = extent;
    this.reach = this.view.reach;
    this.y = y;
    if (this.motion) this.renew();
    else this.replaying = false;
    this.tell("scene");
  }

  // A number of the scene, by its place.
  set(place, value) {
    this.change((scene) => (placed(scene, place.slice(0, -1))[place.at(-1)] = value));
  }

  // Where a link is: its chain, its index there, and its place in the scene.
  home(number) {
    const pendulum = this.system.chains.findLastIndex((one) => one.first <= number);
    const chain = this.system.chains[pendulum];
    const index = number - chain.first;
    return { chain, pendulum, index, place: ["pendulum", chain.entry, "links", index] };
  }

  // The name of a link, and of those of the same index of other pendula.
  nameOf(...links) {
    const pendula = links.map((link) => this.home(link).pendulum + 1).join(", ");
    return `Pendul${links.length > 1 ? "a" : "um"} ${pendula}, link ${this.home(links[0]).index + 1}`;
  }

  choose(number) {
    this.selected = (number + this.system.links.length) % this.system.links.length;
    this.watch();
    this.tell("choice");
  }
}
