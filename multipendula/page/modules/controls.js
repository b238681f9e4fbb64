// Sliders with their numbers: what can be changed, and by how much.

import { capital, motionPlacesIn, numbersOf, placed } from "./carriers.js";
import { slowestOf } from "./modes.js";
import { digits } from "./numbers.js";
import { rounded } from "./stage.js";
import { pushedAt } from "./system.js";

const STEPS = 600;

// A slider from `low` to `high` on a logarithmic scale, or on a linear one from 0.
class Slider {
  // `there` tells whether it applies at all.
  constructor(box, { label, unit, read, write, range, linear = false, there = () => true }) {
    Object.assign(this, { label, read, write, range, linear, unit, there });
    const id = `slider-${Slider.count++}`;
    const name = document.createElement("label");
    name.htmlFor = id;
    const small = document.createElement("small");
    small.textContent = unit;
    name.append(label, " ", small);
    this.bar = Object.assign(document.createElement("input"), { type: "range", id, min: 0, max: STEPS, step: 1 });
    this.number = Object.assign(document.createElement("input"), { type: "number", step: "any", min: 0 });
    this.number.setAttribute("aria-label", `${label}, ${unit}`);
    this.refusal = Object.assign(document.createElement("p"), { className: "refused", id: `${id}-refused`, hidden: true });
    this.refusal.setAttribute("role", "alert");
    this.bar.addEventListener("input", () => this.enter(rounded(this.valueAt(Number(this.bar.value) / STEPS))));
    this.number.addEventListener("change", () => this.typed());
    this.name = name;
    box.append(name, this.bar, this.number, this.refusal);
  }

  // A number from the keys: what is none, or has no meaning here, is refused beside it.
  typed() {
    const text = this.number.value;
    const value = Number(text);
    if (text === "" || !Number.isFinite(value)) this.refuse("a number is needed");
    else if (value < 0 || (!value && !this.linear)) this.refuse(`it must be ${this.linear ? "0 or more" : "above 0"}`);
    else this.enter(value);
  }

  enter(value) {
    this.accept();
    Slider.entering = this;
    this.write(value);
    Slider.entering = null;
    this.show();
  }

  // Said beside the number, which stays as it was, and read to those who do not see it.
  refuse(why) {
    const value = `${written(this.read())} ${this.unit}`.trim();
    this.refusal.textContent = `${this.label}: ${why}. It stays ${value}.`;
    this.refusal.hidden = false;
    this.number.setAttribute("aria-invalid", "true");
    this.number.setAttribute("aria-describedby", this.refusal.id);
    this.show(true);
  }

  accept() {
    this.refusal.hidden = true;
    this.refusal.textContent = "";
    this.number.removeAttribute("aria-invalid");
    this.number.removeAttribute("aria-describedby");
  }

  static count = 0;
  static entering = null; // whose number is being tried

  ends() {
    const value = this.read();
    if (!this.limits || value < this.limits[0] || value > this.limits[1]) this.limits = this.range(value);
    return this.limits;
  }

  valueAt(part) {
    const [low, high] = this.ends();
    return this.linear ? low + part * (high - low) : low * (high / low) ** part;
  }

  show(always = false) {
    for (const part of [this.name, this.bar, this.number]) part.hidden = !this.there();
    if (this.name.hidden) return;
    const value = this.read();
    const [low, high] = this.ends();
    const part = this.linear ? (value - low) / (high - low) : Math.log(value / low) / Math.log(high / low);
    this.bar.value = Math.round(STEPS * part);
    this.bar.setAttribute("aria-valuetext", `${digits(value)} ${this.unit}`);
    if (always || document.activeElement !== this.number) this.number.value = written(value);
  }

  // For another number that it stands for now.
  forget() {
    this.limits = null;
    this.accept();
  }
}

// Four digits, as short as a field needs them.
const written = (value) => {
  const own = Number(value.toPrecision(4));
  return own >= 1e6 || (own && own < 1e-4) ? own.toExponential().replace("e+", "e") : String(own);
};
const decade = (value) => [value / 10, value * 10];
const century = (value) => [value / 100, value * 100];
const fromZero = (more) => ({ linear: true, range: (value) => [0, 2 * value || more] });

export class Controls {
  constructor(boxes, player) {
    Object.assign(this, { player, boxes, chooser: boxes.chooser, ofPart: [] });
    this.ofLink = this.linkSliders();
    this.ofCarriers(boxes.cart);
    const { unit } = pushedAt(player.system);
    const ofDrive = (key) => ({ read: () => player.drive[key], write: (value) => player.drives({ [key]: value }), range: decade });
    this.others = [
      this.number(boxes.scene, "Gravity", "m/s²", () => ["gravity"]),
      new Slider(boxes.scene, {
        label: "Damping",
        unit: "% critical",
        there: () => player.system.links.some(({ s }) => s > 0),
        linear: true,
        read: () => this.dampingOf(),
        write: (value) => this.damp(value),
        range: (value) => [0, Math.max(10, value * 2)],
      }),
      new Slider(boxes.scene, {
        label: "Mode amplitude",
        unit: "°",
        linear: true,
        read: () => player.amplitude,
        write: (value) => {
          player.amplitude = Math.min(value, 170);
          this.show();
        },
        range: (value) => [0.5, Math.max(90, value)],
      }),
      ...this.timeSliders(),
      new Slider(boxes.drive, { label: unit === "N" ? "Force" : "Moment", unit, ...ofDrive("amount") }),
      new Slider(boxes.drive, { label: "Frequency", unit: "Hz", ...ofDrive("frequency") }),
    ];
    this.chooser.addEventListener("change", () => player.choose(Number(this.chooser.value)));
    this.chooser.replaceChildren(...player.system.links.map((_, number) => new Option(player.nameOf(number), String(number))));
  }

  // A slider for the number at a place of the scene, which may depend on what is chosen.
  number(box, label, unit, place, more = {}) {
    const { player } = this;
    const [read, write] = [() => placed(player.scene, place()) ?? 0, (value) => player.set(place(), value)];
    return new Slider(box, { label, unit, read, write, range: decade, ...more });
  }

  // The numbers of the chosen link: drag and friction where the scene has some.
  linkSliders() {
    const { player, boxes } = this;
    const { links, structure } = player.system;
    const of = (label, unit, key, more) => this.number(boxes.link, label, unit, () => [...player.home(player.selected).place, key], more);
    const sliders = [of("Mass", "kg", "mass"), of("Length", "m", "length")];
    if (!structure && links.some(({ drag }) => drag)) sliders.push(of("Drag", "N s/m", "drag", fromZero(1)));
    if (!structure && links.some(({ quadratic }) => quadratic)) sliders.push(of("Quadratic drag", "N s²/m²", "quadratic_drag", fromZero(1)));
    const there = () => player.system.links[player.selected].friction > 0;
    if (links.some(({ friction }) => friction)) sliders.push(of("Friction", "N m", "friction", { there }));
    return sliders;
  }

  // What moves a support or acts in time.
  timeSliders() {
    const { scene, view } = this.player;
    const places = motionPlacesIn(scene);
    const motions = places.flatMap((place) => {
      const whose = places.length === 1 ? "Support" : placed(scene, place).direction === "vertical" ? "Upward" : "Sideways";
      return this.courseSliders(place, `${whose} amplitude`, "m", `${whose} frequency`, fromZero(view.reach / 10));
    });
    const forces = (scene.force ?? []).flatMap(({ on, direction }, k) => {
      const [what, unit] = direction === "torque" ? ["Torque", "N m"] : ["Force", "N"];
      return this.courseSliders(["force", k], `${what} on ${on}`, unit, "Its frequency");
    });
    return [...motions, ...forces];
  }

  // The amplitude and the frequency of a sine; of a sweep where it begins and ends.
  courseSliders(place, amplitude, unit, frequency, more) {
    const { boxes, player } = this;
    const ends = { sine: { frequency_hz: "" }, sweep: { from_hz: ", first", to_hz: ", last" } }[placed(player.scene, place).kind];
    if (!ends) return [];
    const of = (key, label, unitOfKey, range) => this.number(boxes.time, label, unitOfKey, () => [...place, key], range);
    return [of("amplitude", amplitude, unit, more), ...Object.entries(ends).map(([key, end]) => of(key, `${frequency}${end}`, "Hz"))];
  }

  // The numbers of supports and springs, of several those of the one that is chosen from a list.
  ofCarriers(box) {
    const parts = numbersOf(this.player.scene);
    if (!parts.length) return;
    const shown = ({ name, numbers }) => {
      box.replaceChildren();
      this.ofPart = numbers.map(({ label, unit, place }) => {
        const more = place.includes("damping") ? fromZero(1) : place.at(-1) === "mass" ? { range: century } : {};
        return this.number(box, capital(parts.length > 1 ? label : `${name} ${label}`), unit, () => place, more);
      });
    };
    shown(parts[0]);
    if (parts.length === 1) return;
    const label = Object.assign(document.createElement("label"), { className: "select wide" });
    const choice = document.createElement("select");
    choice.replaceChildren(...parts.map(({ name }, number) => new Option(name, String(number))));
    label.append("Support or spring ", choice);
    box.before(label);
    choice.addEventListener("change", () => {
      shown(parts[Number(choice.value)]);
      this.show();
    });
  }

  // Dampers at every joint: for a share of critical damping c they are 2 c g b/w of the slowest mode.
  damp(percent) {
    const { player } = this;
    const slowest = slowestOf(player.system);
    player.change((scene) => {
      for (const chain of player.system.chains) {
        chain.links.forEach((link, i) => {
          const value = rounded((2 * percent * player.system.gravity * link.b) / slowest / 100);
          const own = scene.pendulum[chain.entry].links[i];
          if (value) own.damping = value;
          else delete own.damping;
        });
      }
    });
  }

  // The share that the first joint has now.
  dampingOf() {
    const { player } = this;
    const [link] = player.system.links;
    return link.damping ? (50 * link.damping * slowestOf(player.system)) / (player.system.gravity * link.b) : 0;
  }

  // After another choice the sliders of a link have other limits.
  chose() {
    for (const slider of this.ofLink) slider.forget();
    this.show();
  }

  // Whether a number of a slider was refused by the scene, which is said beside it.
  refuse(why) {
    Slider.entering?.refuse(why);
    return Slider.entering !== null;
  }

  show() {
    this.chooser.value = String(this.player.selected);
    for (const slider of [...this.ofLink, ...this.others, ...this.ofPart]) slider.show();
  }
}
